//! The logged drivers of generated scenes, judged by the rules for planners: there is nothing that they could be charged with, and so nothing
//! that is netted against them either. What planners do wrong there is their own doing.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints its table")]

mod straight_road;

use std::num::NonZero;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};

use episode::driver::drive;
use episode::protocol::{Motion, Protocol, StrictSettings};
use episode::{Episode, Outcome};
use scenarios::generated::{FAMILIES, Family, Parameters};
use straight_road::LogReplay;
use wire::proto::EndReason;
use world::scene::Scene;

/// Events that count, each as often as it was counted.
const RULES: [&str; 6] = ["collision", "off_route", "off_road", "red_light", "wrong_way", "speeding"];
/// nuPlan's terms but comfort: a human may brake harder than nuPlan likes.
const TERMS: [&str; 7] = [
    "nuplan_no_at_fault_collision",
    "nuplan_drivable_area",
    "nuplan_driving_direction",
    "nuplan_making_progress",
    "nuplan_progress",
    "nuplan_time_to_collision",
    "nuplan_speed_limit",
];

fn replay(scene: &Arc<Scene>) -> Outcome {
    let protocol = Protocol::Strict(StrictSettings { motion: Motion::Playback, ..StrictSettings::default() });
    drive(Episode::new(Arc::clone(scene), &protocol).unwrap(), &mut LogReplay(Arc::clone(scene)))
}

/// What the judges have to say of the drive: nothing, in a good scene.
fn charges(outcome: &Outcome) -> Vec<String> {
    let mut charges = Vec::new();
    if !matches!(outcome.end.reason(), EndReason::Horizon | EndReason::LogEnd) {
        charges.push(format!("ended by {:?}", outcome.end.reason()));
    }
    charges.extend(outcome.events.iter().map(|event| format!("step {}: {}", event.step, event.text)));
    let value = |name: &str| outcome.end.metrics.iter().find(|metric| metric.name == name).unwrap().value;
    let zeros = RULES.iter().chain(&["position_error_5s_m"]).map(|name| (*name, 0.0));
    for (name, wanted) in zeros.chain(TERMS.map(|name| (name, 1.0))) {
        match value(name) {
            Some(value) if value == wanted => {}
            Some(value) => charges.push(format!("{name} is {value:.3}")),
            None => charges.push(format!("{name} cannot be judged")),
        }
    }
    charges
}

/// One line for a scene with charges.
fn charged(family: &Family, seed: u64, index: u32) -> Option<String> {
    let name = family.scene_id(seed, index);
    let payload = match family.payload(&name, seed, index, &Parameters::default()) {
        Ok(payload) => payload,
        Err(error) => return Some(format!("{name}: {error}")),
    };
    let (scene, _) = scenarios::womd::read(&payload).unwrap();
    let charges = charges(&replay(&Arc::new(scene)));
    (!charges.is_empty()).then(|| format!("{name}: {}", charges.join("; ")))
}

/// Drives the first `count` scenes of a seed of every family, on all cores.
fn nobody_is_charged_in(seed: u64, count: u32) {
    let (next, found) = (AtomicU32::new(0), Mutex::new(Vec::new()));
    let all = count * FAMILIES.len() as u32;
    std::thread::scope(|threads| {
        for _ in 0..std::thread::available_parallelism().map_or(1, NonZero::get) {
            threads.spawn(|| {
                while let Some(scene) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|scene| *scene < all) {
                    let family = &FAMILIES[(scene / count) as usize];
                    if let Some(line) = charged(family, seed, scene % count) {
                        println!("{line}");
                        found.lock().unwrap().push(line);
                    }
                }
            });
        }
    });
    let mut found = found.into_inner().unwrap();
    found.sort();
    assert!(found.is_empty(), "{} of {all} scenes:\n{}", found.len(), found.join("\n"));
}

#[test]
fn the_human_of_a_generated_scene_has_no_fault_at_all() {
    (0..3).for_each(|seed| nobody_is_charged_in(seed, 1));
}

/// `SCENES=100` of each family; `SEED=7` for others.
#[test]
#[ignore = "minutes; run it after changing the generator"]
fn the_humans_of_many_generated_scenes_have_no_fault_at_all() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u32>().ok());
    nobody_is_charged_in(number("SEED").unwrap_or(1).into(), number("SCENES").unwrap_or(20));
}
