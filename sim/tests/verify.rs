//! `sim verify` on the authors' vectors: it holds, and a number that is off makes it fail. Skipped where they are not there.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::path::{Path, PathBuf};
use std::process::Command;

use sim::verify::verify;
use vectors::{Npz, npz_files, shared};

/// Scenes and vectors.
fn data() -> Option<(Vec<String>, PathBuf)> {
    let scenes = shared("data/womd-derived/20s")?;
    Some((vec![scenes.display().to_string()], shared("dipp/closed-loop-vectors")?))
}

#[test]
fn every_vector_of_the_authors_simulator_is_met() {
    let Some((scenes, folder)) = data() else { return };
    let report = verify(&scenes, &folder).unwrap();
    println!("{report}");
    assert!(report.holds(), "{report}");
}

/// An `.npz` file, stored: as much of a zip archive as the reader looks at.
fn write_npz(path: &Path, arrays: &[(String, Vec<usize>, Vec<f64>)]) {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, shape, values) in arrays {
        let axes: String = shape.iter().map(|axis| format!("{axis},")).collect();
        let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({axes}), }}\n");
        let mut array = b"\x93NUMPY\x01\x00".to_vec();
        array.extend((header.len() as u16).to_le_bytes());
        array.extend(header.as_bytes());
        array.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        let size = (array.len() as u32).to_le_bytes();
        let name = format!("{name}.npy");
        // Version, flags, method, time, date and checksum are 0; sizes; lengths of the name and of what is extra.
        let common = [&[0; 14][..], &size, &size, &(name.len() as u16).to_le_bytes(), &[0; 2]].concat();
        directory.extend(b"PK\x01\x02\0\0");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend((bytes.len() as u32).to_le_bytes());
        directory.extend(name.as_bytes());
        bytes.extend(b"PK\x03\x04");
        bytes.extend(&common);
        bytes.extend(name.as_bytes());
        bytes.extend(array);
    }
    let start = bytes.len() as u32;
    bytes.extend(&directory);
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend([(arrays.len() as u16).to_le_bytes(); 2].concat());
    bytes.extend((directory.len() as u32).to_le_bytes());
    bytes.extend(start.to_le_bytes());
    bytes.extend([0; 2]);
    std::fs::write(path, bytes).unwrap();
}

/// All arrays of a file: name, shape, numbers.
fn arrays(path: &Path) -> Vec<(String, Vec<usize>, Vec<f64>)> {
    let npz = Npz::read(path).unwrap();
    let array = |(name, shape): (&str, &[usize])| {
        let open: Vec<Option<usize>> = shape.iter().map(|axis| Some(*axis)).collect();
        (name.to_owned(), shape.to_vec(), npz.array(name, &open).unwrap().to_vec())
    };
    npz.shapes().map(array).collect()
}

#[test]
fn one_number_that_is_off_makes_it_fail() {
    let Some((scenes, folder)) = data() else { return };
    let scene = "eb4b91b10ca94ff2";
    // What the simulator does not compute is the planner's and the predictor's.
    let others = [
        "control_first",
        "plan_first",
        "plan_first_global",
        "plan_objective",
        "every10_plan",
        "every10_predictions",
        "every10_step",
        "metrics",
    ];
    for file in npz_files(&folder).unwrap() {
        let name = file.file_name().unwrap().to_str().unwrap().to_owned();
        let part = name.strip_prefix(scene).and_then(|rest| rest.strip_suffix(".npz"));
        let Some(part) = part.filter(|part| *part != "__planner") else { continue };
        let own = tempfile::tempdir().unwrap();
        let json = file.with_extension("json");
        if json.exists() {
            std::fs::copy(&json, own.path().join(json.file_name().unwrap())).unwrap();
        }
        let whole = arrays(&file);
        let path = own.path().join(&name);
        write_npz(&path, &whole);
        assert!(verify(&scenes, own.path()).unwrap().holds(), "{part}: as it was");
        for index in 0..whole.len() {
            if others.contains(&whole[index].0.as_str()) {
                continue;
            }
            let mut changed = whole.clone();
            let values = &mut changed[index].2;
            let middle = values.len() / 2;
            values[middle] += 1.0;
            write_npz(&path, &changed);
            assert!(!verify(&scenes, own.path()).unwrap().holds(), "{part}: {} is off", whole[index].0);
        }
        if json.exists() {
            write_npz(&path, &whole);
            let json = own.path().join(json.file_name().unwrap());
            let text = std::fs::read_to_string(&json).unwrap();
            for (from, to) in [
                ("\"jerk\": ", "\"jerk\": 1"),
                ("\"off_route\": false", "\"off_route\": true"),
                ("horizon", "log_end"),
                ("collision\",", "off_route\","),
            ] {
                let changed = text.replacen(from, to, 1);
                if changed != text {
                    std::fs::write(&json, changed).unwrap();
                    assert!(!verify(&scenes, own.path()).unwrap().holds(), "{part}: {to}");
                }
            }
        }
    }
}

#[test]
fn what_cannot_be_used_is_said_with_code_2() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("set.toml"), "[[generate]]\nfamily = 'curve'\n").unwrap();
    let sim = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sim"));
        command
            .args(["verify", "--scenarios", "set.toml", "--vectors", "."])
            .current_dir(folder.path())
            .env_remove("RUST_LOG");
        let output = command.output().unwrap();
        format!("code {:?}\n{}", output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    insta::assert_snapshot!(sim(), @"
    code Some(2)
    error: . holds no .npz file
    hint: give a folder of vectors
    ");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("other__human.npz", "");
    insta::assert_snapshot!(sim(), @"
    code Some(2)
    error: . has no vectors of any of these scenes
    hint: they are named SCENE__route.npz, SCENE__human.npz, SCENE__constant-velocity.npz, SCENE__planner.npz
    ");
    write("curve-0-0__human.npz", "no zip");
    insta::assert_snapshot!(sim(), @"
    code Some(2)
    error: ./curve-0-0__human.npz: it is no zip archive
    ");
    write_npz(&folder.path().join("curve-0-0__human.npz"), &[]);
    insta::assert_snapshot!(sim(), @"
    code Some(2)
    error: cannot read ./curve-0-0__human.json: No such file or directory (os error 2)
    ");
    write("curve-0-0__human.json", "{\"steps\": 3}");
    insta::assert_snapshot!(sim(), @"
    code Some(2)
    error: ./curve-0-0__human.json is not what it should be: missing field `end_reason` at line 1 column 12
    ");
    let zero = "\"collision\": false, \"off_route\": false";
    write("curve-0-0__human.json", &format!("{{\"steps\": 3, \"end_reason\": \"horizon\", \"metrics\": {{{zero}}}}}"));
    insta::assert_snapshot!(sim(), @"
    code Some(2)
    error: ./curve-0-0__human.npz: array av_state is missing
    ");
}
