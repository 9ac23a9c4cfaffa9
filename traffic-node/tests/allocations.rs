//! What a step allocates.
#![allow(clippy::unwrap_used, missing_docs, reason = "a test may panic")]

use traffic_node::{Cast, Characters, TrafficFactory};

#[path = "../benches/bend/mod.rs"]
mod bend;

#[test]
fn a_step_allocates_its_answer_alone() {
    let drive = bend::drive();
    let mut traffic = Characters { cast: Cast::Idm, seed: 1 }.start(&drive.briefing).unwrap();
    for (index, (observation, taken)) in drive.steps.iter().enumerate() {
        let mut moves = None;
        let allocated = allocation_counter::measure(|| moves = Some(traffic.moves(observation, taken)));
        // In the first step everybody is met, and room is made.
        assert!(index == 0 || allocated.count_total == 1, "step {index}: {allocated:?}");
        assert_eq!(moves.unwrap().unwrap().moves.len(), bend::AGENTS);
    }
}
