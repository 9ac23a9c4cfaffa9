//! What nuPlan's own code gives on drives, rides and plans that differed once. Skipped where the shared cases are not there.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "../examples/judge/case.rs"]
mod case;

use episode::metrics::Counted;
use episode::metrics::comfort::{Extremes, Ride};
use episode::tracker;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use world::plan::{PlanState, STEP_SECONDS};
use world::vehicle::{VehicleState, WHEELBASE};

fn read<T: DeserializeOwned>(name: &str) -> Option<T> {
    let path = vectors::shared("cases/nuplan")?.join(name);
    Some(serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap())
}

#[test]
fn a_lane_driven_backwards_is_kept_whatever_the_heading() {
    #[derive(Deserialize)]
    struct File {
        case: case::Case,
        nuplan: Value,
        back_nuplan: Vec<f64>,
    }
    let Some(file) = read::<File>("wrong-way-over-two-lanes.json") else { return };
    let answer = file.case.drive().unwrap();
    assert_eq!(answer["metrics"]["nuplan_driving_direction"], file.nuplan["DDC"]);
    for (step, expected) in answer["steps"].as_array().unwrap().iter().zip(file.back_nuplan) {
        let travel = step["backward_travel"].as_f64().unwrap();
        assert!((travel - expected).abs() < 1e-9, "{travel} {expected}");
    }
}

#[derive(Deserialize)]
struct Cases<T> {
    cases: Vec<T>,
}

#[test]
fn comfort_is_read_at_the_centre_as_nuplan_moves_it_there() {
    #[derive(Deserialize)]
    struct Drive {
        name: String,
        acceleration: Vec<f64>,
        steering: Vec<f64>,
        speed: Vec<f64>,
        heading: Vec<f64>,
        nuplan: Value,
    }
    let Some(file) = read::<Cases<Drive>>("comfort-centre-acceleration.json") else { return };
    for drive in file.cases {
        let mut before = 0.0;
        let samples = (0..drive.speed.len()).map(|step| {
            let yaw_rate = drive.speed[step] * libm::tan(drive.steering[step]) / WHEELBASE;
            let (speed, heading) = (drive.speed[step], drive.heading[step]);
            let ride = Ride { acceleration: drive.acceleration[step], speed, heading, turning: yaw_rate, yaw_rate };
            ride.nuplan(std::mem::replace(&mut before, yaw_rate), 1.461)
        });
        let extremes = Extremes::of(&samples.collect::<Vec<_>>(), Counted::ALL).unwrap();
        for (name, value) in [
            ("min", extremes.least_acceleration),
            ("max", extremes.greatest_acceleration),
            ("lonjerk", extremes.longitudinal_jerk),
            ("jerk", extremes.jerk),
            ("lat", extremes.lateral_acceleration),
            ("yaw", extremes.yaw_rate),
            ("yawacc", extremes.yaw_acceleration),
        ] {
            let expected = drive.nuplan[name].as_f64().unwrap();
            assert!((value - expected).abs() < 1e-6, "{}, {name}: {value} {expected}", drive.name);
        }
        assert_eq!(Value::from(extremes.are_comfortable()), drive.nuplan["ok"], "{}", drive.name);
    }
}

#[test]
fn the_tracker_commands_what_nuplans_does() {
    #[derive(Deserialize)]
    struct Track {
        state: [f64; 5],
        plan: Vec<[f64; 4]>,
        nuplan: Value,
    }
    let Some(file) = read::<Cases<Track>>("tracker-s-curve.json") else { return };
    for Track { state: [x, y, heading, speed, steering], plan, nuplan } in file.cases {
        let states = plan.into_iter().map(|[x, y, heading, speed]| PlanState { x, y, heading, speed });
        let vehicle = VehicleState { x, y, heading, speed };
        let control = tracker::track(&vehicle, steering, WHEELBASE, &states.collect::<Vec<_>>());
        let rate = (control.steering - steering) / STEP_SECONDS;
        let (a, expected) = (nuplan["a"].as_f64().unwrap(), nuplan["rate"].as_f64().unwrap());
        assert!((control.acceleration - a).abs() < 1e-4, "{} {a}", control.acceleration);
        // Its trajectory has a pose of now; ours is carried back there.
        assert!((rate - expected).abs() < 2e-3, "{rate} {expected}");
    }
}
