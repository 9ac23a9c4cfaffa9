//! What the judges of `strict` say, for programs in other languages: a question in JSON on a line of standard input, its answer on
//! a line of standard output.
//!
//! | question | answer |
//! | --- | --- |
//! | `{"op": "world", "scene": PATH}` | the first scene of that input as the judges see it: lanes as strips, road edges, everybody's states |
//! | `{"op": "episode", ...}` | metrics, steps and world of a drive that is given state by state (`case.rs` has the fields) |
//! | `{"op": "boxes", "av": ROW, "agent": ROW}` | contact and time to collision of two boxes |
//! | `{"op": "track", "state": [x, y, heading, speed, steering], "plan": [[x, y, heading, speed], ...]}` | what the tracker commands |
//!
//! A row is x, y, heading, speed, length, width. `evaluation/checks/nuplan.py` asks.

#![allow(clippy::print_stdout, reason = "it answers there")]

mod case;
mod world;

use std::io::BufRead;

use ::world::plan::{PlanState, STEP_SECONDS};
use ::world::scene::{AgentKind, AgentState};
use ::world::vehicle::{VehicleState, WHEELBASE};
use case::Row;
use episode::judges::Body;
use episode::judges::collision::{classify, is_ahead, is_behind, overlaps};
use episode::judges::time_to_collision::{TrafficAgent, time_to_collision};
use episode::protocol::StrictSettings;
use episode::tracker;
use serde::Deserialize;
use serde_json::{Value, json};

type Error = Box<dyn std::error::Error>;

#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "lowercase")]
enum Question {
    World { scene: String },
    Episode(case::Case),
    Boxes { av: Row, agent: Row },
    Track { state: [f64; 5], plan: Vec<[f64; 4]> },
}

fn main() -> Result<(), Error> {
    for line in std::io::stdin().lock().lines() {
        let answer = match serde_json::from_str(&line?)? {
            Question::World { scene } => world::seen(&world::read(&scene)?, &StrictSettings::default())?,
            Question::Episode(case) => {
                let mut answer = case.drive()?;
                answer["world"] = world::seen(&case.scene()?, &case::settings())?;
                answer
            }
            Question::Boxes { av, agent } => boxes(av, agent),
            Question::Track { state, plan } => track(state, &plan),
        };
        println!("{answer}");
    }
    Ok(())
}

fn boxes(av: Row, agent: Row) -> Value {
    let body = |row: Row| Body { speed: row[3], ..Body::of(AgentState { z: 0.0, ..case::state(row) }) };
    let (av, Body { state, outline, speed }) = (body(av), body(agent));
    let agent = TrafficAgent {
        track: 0,
        kind: AgentKind::Vehicle,
        outline,
        z: 0.0,
        velocity: state.velocity(),
        speed,
        sudden: false,
    };
    let contact = overlaps(&av, &agent).then(|| classify(&av, WHEELBASE, &agent).as_str_name());
    json!({
        "contact": contact,
        "ahead": is_ahead(&av, WHEELBASE, outline.center),
        "behind": is_behind(&av, WHEELBASE, outline.center),
        "time_to_collision": time_to_collision(&av, &agent),
    })
}

fn track([x, y, heading, speed, steering]: [f64; 5], plan: &[[f64; 4]]) -> Value {
    let states = plan.iter().map(|[x, y, heading, speed]| PlanState { x: *x, y: *y, heading: *heading, speed: *speed });
    let states: Vec<PlanState> = states.collect();
    let control = tracker::track(&VehicleState { x, y, heading, speed }, steering, WHEELBASE, &states);
    json!({ "acceleration": control.acceleration, "steering_rate": (control.steering - steering) / STEP_SECONDS })
}
