//! Same command, same bytes.

use crate::stage::{Stage, assert_same};

#[test]
fn two_runs_and_any_number_of_workers_give_the_same_bytes() {
    let stage = Stage::new();
    let outs: Vec<String> = [1, 1, 2, 3]
        .iter()
        .enumerate()
        .map(|(index, workers)| {
            let ended = stage
                .good_sim(&format!("run --driver idm --scenarios small.toml --parallel {workers} --out run{index}"));
            ended.out.replace(&format!("folder run{index}"), "")
        })
        .collect();
    let first = stage.files("run0");
    assert!(first.keys().any(|name| name.ends_with(".mcap")));
    for (index, out) in outs.iter().enumerate() {
        assert_same(&first, &stage.files(&format!("run{index}")));
        assert_eq!(*out, outs[0], "the digest is printed");
    }
}

#[test]
fn predictions_repeat_too_and_on_cores_of_their_own() {
    let stage = Stage::new();
    for run in ["one --parallel 2", "two --parallel 1 --pin"] {
        stage.good_sim(&format!("run --driver idm --scenarios small.toml --predictor ctrv --out {run}"));
    }
    assert_same(&stage.files("one"), &stage.files("two"));
}

#[test]
fn in_process_and_over_the_bus_all_is_the_same() {
    let stage = Stage::new();
    let drivers =
        [("idm", "strict"), ("human", "strict"), ("gn-oracle", "paper"), ("dipp", "strict"), ("cql", "paper")];
    for (driver, protocol) in drivers {
        let weights = match driver {
            "cql" => concat!(" --weights ", env!("CARGO_MANIFEST_DIR"), "/../weights/cql.f16.safetensors"),
            _ => "",
        };
        let run = format!("run --scenarios small.toml --driver {driver} --protocol {protocol}{weights}");
        let [bus, here] = ["bus", "here --in-process --parallel 2"].map(|way| {
            let name = way.split(' ').next().unwrap();
            let ended = stage.good_sim(&format!("{run} --out {driver}-{way}"));
            ended.out.replace(&format!("folder {driver}-{name}"), "")
        });
        assert_eq!(here, bus);
        assert_same(&stage.files(&format!("{driver}-bus")), &stage.files(&format!("{driver}-here")));
        // Without a recorder there is no bus at all.
        stage.good_sim(&format!("{run} --in-process --record none --out {driver}-bare"));
        let steps = |way| stage.files(&format!("{driver}-{way}")).remove("steps.parquet").unwrap();
        assert!(steps("bare") == steps("bus"));
    }
}

#[test]
fn who_is_no_driver_of_ours_is_not_driven_in_process() {
    let stage = Stage::new();
    let ended = stage.sim("run --in-process --planner-command true");
    assert!(ended.code == Some(2) && ended.err.contains("cannot be used with"), "{ended:?}");
}

#[test]
fn drives_under_paper_repeat_too() {
    let stage = Stage::new();
    for workers in [1, 3] {
        let out = format!("--parallel {workers} --out run{workers}");
        stage.good_sim(&format!("run --scenarios small.toml --protocol paper --driver gn-ctrv {out}"));
    }
    assert_same(&stage.files("run1"), &stage.files("run3"));
}
