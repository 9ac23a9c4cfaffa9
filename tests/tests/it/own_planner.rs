//! The example of a planner of one's own drives.

use results::parquet::Table;

use crate::stage::{Stage, program};

#[test]
fn the_example_in_the_documentation_drives_and_makes_way() {
    let stage = Stage::new();
    let mut command = stage.command("run --scenarios small.toml --record none --parallel 1 --out run");
    let output = command.arg("--planner-command").arg(program("follow_the_line")).output().unwrap();
    stage.wait_until_alone();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let results = Table::read(&stage.path("run/results.parquet")).unwrap();
    let steps = Table::read(&stage.path("run/steps.parquet")).unwrap();
    let reasons = results.text("end_reason").unwrap();
    assert!(reasons.iter().all(|reason| reason == "horizon" || reason == "log-end"), "{reasons:?}");
    let speeds = steps.number("av_velocity_x_mps").unwrap();
    assert!(speeds.iter().flatten().any(|speed| speed.abs() > 4.0), "it only stands");
}
