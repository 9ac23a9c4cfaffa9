//! Open loop through `sim evaluate`: the authors' own test is met number by number, and one frame costs no other.

use std::collections::BTreeMap;
use std::fs;

use results::parquet::Table;
use vectors::{Npz, Quantity, Report, npz_files};

use crate::stage::{Stage, program, shared};

/// The columns of flags and numbers of a file of frames, by driver, scene and frame.
type Frames = BTreeMap<(String, String, u32), BTreeMap<String, Option<f64>>>;

fn read(stage: &Stage, name: &str) -> Frames {
    let table = Table::read(&stage.path(name)).unwrap();
    let (drivers, scenes) = (table.text("driver").unwrap(), table.text("scene").unwrap());
    let (frames, numbers) = (table.counts("frame").unwrap(), table.numbers().unwrap());
    let keys = drivers.into_iter().zip(scenes).zip(frames).enumerate();
    let row = |at: usize| numbers.iter().map(|(name, values)| (name.clone(), values[at])).collect();
    keys.map(|(at, ((driver, scene), frame))| ((driver, scene, frame), row(at))).collect()
}

/// The authors' columns and ours.
const FLAGS: [(&str, &str); 4] =
    [("collision", "collision"), ("red_light", "red_light"), ("off_route", "off_route"), ("mode", "mode")];
const NUMBERS: [(&str, &str); 9] = [
    ("Acc", "mean_abs_acceleration_mps2"),
    ("Human_Acc", "human_mean_abs_acceleration_mps2"),
    ("Human_Jerk", "human_mean_abs_jerk_mps3"),
    ("Human_Lat_Acc", "human_mean_abs_lateral_acceleration_mps2"),
    ("Prediction_ADE", "prediction_ade_m"),
    ("Prediction_FDE", "prediction_fde_m"),
    ("Human_L2_1s", "position_error_1s_m"),
    ("Human_L2_3s", "position_error_3s_m"),
    ("Human_L2_5s", "position_error_5s_m"),
];

const FLAG: Quantity = Quantity::exact("flags, likeliest future");
const NUMBER: Quantity = Quantity::within("accelerations, position and prediction errors", 1e-3, "abs");
const JERK: Quantity = Quantity::within("jerk of the planner's plans", 1e-3, "abs");
// Theirs is rolled out in single precision: a rounding of 4e-6 m at 40 m is 4e-3 m/s^3 of a sample.
const JERK_OF_NETWORK: Quantity = Quantity::within("jerk of the network's own plans", 2e-3, "abs");
const OBJECTIVE: Quantity = Quantity::within("objective", 1e-3, "rel");
const ITERATIONS: Quantity = Quantity::exact("iterations");

#[test]
fn plans_over_the_authors_weights_are_worth_what_the_authors_test_says() {
    let (Some(trained), Some(scenes)) = (shared("dipp/trained"), shared("data/womd-derived/20s")) else { return };
    let stage = Stage::new();
    stage.good_sim(&format!(
        "evaluate --open-loop --definitions authors --features authors --drivers dipp={dipp},sep={sep},il-pred={sep} \
         --scenarios {scenes} --out frames.parquet",
        dipp = trained.join("dipp42.f16.safetensors").display(),
        sep = trained.join("sep42.f16.safetensors").display(),
        scenes = scenes.display(),
    ));
    let own = read(&stage, "frames.parquet");
    let csv = fs::read_to_string(trained.join("open_loop.csv")).unwrap();
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let mut report = Report::new(&["off by"], &[FLAG, NUMBER, JERK, JERK_OF_NETWORK, OBJECTIVE, ITERATIONS]);
    let mut compared = 0;
    for line in lines {
        let theirs = |name: &str| -> f64 {
            line[names.iter().position(|other| *other == name).unwrap()].parse().unwrap_or(f64::NAN)
        };
        let driver = match line[0] {
            "dipp42" => "dipp",
            "sep42" => "sep",
            _ => "il-pred",
        };
        let place = format!("{driver}, {} at {}", line[1], line[2]);
        let row = &own[&(driver.to_owned(), line[1].to_owned(), line[2].parse().unwrap())];
        // Both have no number where there is nobody to predict.
        let apart = |ours: &str, name: &str| match (row[ours], theirs(name)) {
            (None, theirs) => {
                if theirs.is_nan() {
                    0.0
                } else {
                    f64::INFINITY
                }
            }
            (Some(ours), theirs) => (ours - theirs).abs(),
        };
        FLAGS.iter().for_each(|(name, ours)| report.add(0, FLAG, apart(ours, name), &place));
        NUMBERS.iter().for_each(|(name, ours)| report.add(0, NUMBER, apart(ours, name), format!("{place}: {name}")));
        let jerk = if driver == "il-pred" { JERK_OF_NETWORK } else { JERK };
        report.add(0, jerk, apart("mean_abs_jerk_mps3", "Jerk"), &place);
        if driver != "il-pred" {
            report.add(0, OBJECTIVE, apart("objective", "objective") / theirs("objective"), &place);
            report.add(0, ITERATIONS, apart("iterations", "iterations"), &place);
        }
        report.count_case();
        compared += 1;
    }
    println!("{report}");
    assert!(report.holds(), "{report}");
    assert_eq!((compared, own.len()), (273, 273));
}

#[test]
fn straight_plans_and_constant_turn_rates_are_worth_what_the_authors_functions_say() {
    let (Some(folder), Some(scenes)) = (shared("dipp/open-loop-vectors"), shared("data/womd-derived/20s")) else {
        return;
    };
    let stage = Stage::new();
    let asked = "evaluate --open-loop --definitions authors --drivers constant-velocity --predictor ctrv";
    stage.good_sim(&format!("{asked} --out frames.parquet {}", scenes.display()));
    let own = read(&stage, "frames.parquet");
    let mut report = Report::new(&["off by"], &[FLAG, NUMBER, JERK]);
    for path in npz_files(&folder).unwrap() {
        let npz = Npz::read(&path).unwrap();
        let scene = path.file_stem().unwrap().to_string_lossy().into_owned();
        let frames = npz.array("frame", &[None]).unwrap();
        let plans = npz.rows::<9>("constant_velocity", &[None, Some(9)]).unwrap();
        let predictions = npz.rows::<2>("prediction", &[None, Some(2)]).unwrap();
        for ((frame, plan), prediction) in frames.iter().zip(plans).zip(predictions) {
            let place = format!("{scene} at {frame}");
            let row = &own[&("constant-velocity-ctrv".to_owned(), scene.clone(), *frame as u32)];
            let names = ["collision", "red_light", "off_route"];
            for (name, theirs) in names.iter().zip(plan) {
                report.add(0, FLAG, (row[*name].unwrap() - theirs).abs(), format!("{place}: {name}"));
            }
            report.add(0, NUMBER, (row["mean_abs_acceleration_mps2"].unwrap() - plan[3]).abs(), &place);
            report.add(0, JERK, (row["mean_abs_jerk_mps3"].unwrap() - plan[4]).abs(), &place);
            let errors = ["position_error_1s_m", "position_error_3s_m", "position_error_5s_m"];
            for (name, theirs) in errors.iter().zip(&plan[6..]) {
                report.add(0, NUMBER, (row[*name].unwrap() - theirs).abs(), format!("{place}: {name}"));
            }
            for (name, theirs) in ["prediction_ade_m", "prediction_fde_m"].iter().zip(prediction) {
                let apart = row[*name].map_or(if theirs.is_nan() { 0.0 } else { 1.0 }, |ours| (ours - theirs).abs());
                report.add(0, NUMBER, apart, format!("{place}: {name}"));
            }
            report.count_case();
        }
    }
    println!("{report}");
    assert!(report.holds(), "{report}");
}

#[test]
fn any_number_of_workers_gives_the_same_bytes() {
    let stage = Stage::new();
    let tables = ["1", "3"].map(|workers| {
        let asked = "evaluate --open-loop --drivers idm,gn-ctrv --scenarios small.toml --format csv";
        stage.good_sim(&format!("{asked} --parallel {workers} --out of{workers}")).out
    });
    assert_eq!(tables[0], tables[1]);
    let bytes = |workers: &str| fs::read(stage.path(&format!("of{workers}/frames.parquet"))).unwrap();
    assert!(bytes("1") == bytes("3"), "the frames differ");
    let told = fs::read_to_string(stage.path("of1/gn-ctrv.toml")).unwrap();
    assert!(told.contains("name = \"gauss-newton\"") && told.contains("[[scenes]]"), "{told}");
    let again = stage.sim("evaluate --open-loop --drivers idm --scenarios small.toml --out of1");
    assert_eq!(again.code, Some(2));
    assert!(again.err.contains("of1 is there already\nhint: "), "{}", again.err);
}

#[test]
fn a_planner_that_dies_costs_its_own_frames() {
    let stage = Stage::new();
    let scene = {
        stage.good_sim("evaluate --open-loop --drivers constant-velocity --scenarios small.toml --out honest.parquet");
        let scenes = Table::read(&stage.path("honest.parquet")).unwrap().text("scene").unwrap();
        scenes.last().unwrap().clone()
    };
    let stage = Stage::with_lie(&format!("{scene} 0 die"));
    let mut command = stage.command(
        "evaluate --open-loop --scenarios small.toml --label mine --out frames.parquet --parallel 2 --planner-command",
    );
    let output = command.arg(program("liar")).output().unwrap();
    let (out, err) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(1), "{out}{err}");
    assert!(out.contains("has no plan: step 0: the planner is gone: the planner "), "{out}");
    let table = Table::read(&stage.path("frames.parquet")).unwrap();
    let failed: Vec<String> = {
        let rows = table.text("scene").unwrap().into_iter().zip(table.flags("failed").unwrap());
        rows.filter(|(_, failed)| *failed).map(|(scene, _)| scene).collect()
    };
    assert!(!failed.is_empty() && failed.iter().all(|of| *of == scene), "{failed:?}");
    assert_eq!(failed.len(), table.text("scene").unwrap().iter().filter(|of| **of == scene).count());
    // Of the human all is told even so.
    let numbers = table.numbers().unwrap();
    assert!(numbers["human_collision"].iter().all(Option::is_some));
    assert!(stage.processes().is_empty(), "left running: {:?}", stage.processes());
}
