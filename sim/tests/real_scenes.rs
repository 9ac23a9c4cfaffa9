//! The logged humans of real scenes, judged by the rules for planners. Skipped where the scenes are not there.

use std::path::PathBuf;
use std::sync::Arc;

use scenarios::SceneSet;
use sim::episode::driver::{Driver, drive};
use sim::episode::{Episode, Outcome};
use sim::protocol::{Motion, Protocol, StrictSettings};
use world::observation::Observation;
use world::plan::{PLAN_STEPS, Plan, PlanState, UncheckedPlan};
use world::scene::Scene;

/// Plans what the logged AV did.
struct LogReplay(Arc<Scene>);

impl Driver for LogReplay {
    fn plan(&mut self, observation: &Observation) -> Result<Plan, String> {
        let states = &self.0.av().states;
        let last = states.len() - 1;
        let now = observation.log_index as usize;
        let state = |step: usize| {
            let logged = states[(now + step).min(last)].or(states[now]).ok_or("the AV is not in the log")?;
            Ok(PlanState { x: logged.x, y: logged.y, heading: logged.heading, speed: logged.speed() })
        };
        let states = (1..=PLAN_STEPS).map(state).collect::<Result<_, String>>()?;
        let plan = UncheckedPlan { step: observation.step, states, ..UncheckedPlan::default() };
        plan.check(observation.step).map_err(|error| error.to_string())
    }
}

/// The folder of shared data, if there is one.
fn shared() -> Option<PathBuf> {
    let crate_folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let places = ["../../shared", "../../../shared"].map(|place| crate_folder.join(place));
    std::env::var_os("RELOOP_SHARED").map(PathBuf::from).into_iter().chain(places).find(|place| place.is_dir())
}

fn scenes(folders: &[&str]) -> Vec<Arc<Scene>> {
    let Some(shared) = shared() else {
        eprintln!("skipped: no ../shared with real scenes, and RELOOP_SHARED is not set");
        return Vec::new();
    };
    let folders: Vec<String> = folders.iter().map(|folder| shared.join(folder).display().to_string()).collect();
    let set = SceneSet::open(&folders).unwrap();
    (0..set.entries().len()).map(|index| set.load(index).unwrap().0).collect()
}

fn replay(scene: &Arc<Scene>, motion: Motion) -> Outcome {
    let protocol = Protocol::Strict(StrictSettings { motion, ..StrictSettings::default() });
    drive(Episode::new(Arc::clone(scene), &protocol).unwrap(), &mut LogReplay(Arc::clone(scene)))
}

fn metric(outcome: &Outcome, name: &str) -> Option<f64> {
    outcome.end.metrics.iter().find(|metric| metric.name == name).unwrap().value
}

#[test]
fn the_human_has_no_fault_that_counts_and_no_position_error() {
    for scene in scenes(&["data/womd-derived/20s", "data/womd-derived/20s-partial"]) {
        let outcome = replay(&scene, Motion::Playback);
        println!("{} {:?} steps {}", scene.id(), outcome.end.reason(), outcome.end.steps);
        for event in &outcome.events {
            println!("    {:3} {:?}: {}", event.step, event.kind(), event.text);
        }
        for m in &outcome.end.metrics {
            print!("{}={:.3} ", m.name, m.value.unwrap_or(f64::NAN));
        }
        println!();
    }
}
