//! A planner that drives straight on, but for one step of a scene or more, at which it does what `RELOOP_LIE` says:
//! `SCENE STEP LIE`, several of them with `;` between, with LIE one of `die`, `stop`, `silence`, `raise`, `error`, `nan`, `length`, `controls`, `step`, `chance`, `version`.
//!
//! What it is to do comes by the environment, for two runs of one command must differ in nothing else.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;
use std::time::Duration;

use clap::Parser;
use nix::sys::signal::{Signal, raise};
use wire::keys::{NodeId, Place, Role};
use wire::node::{Options, Planner, PlannerFactory, StepInput, serve_planner};
use wire::{WIRE_VERSION, session};
use world::observation::Briefing;
use world::plan::{Control, PLAN_STEPS, PlanState, UncheckedPlan};
use zenoh::Wait;

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    node: Options,
}

#[derive(Clone)]
struct Lie {
    scene: String,
    step: u32,
    what: String,
}

struct Liar(Vec<Lie>);

impl PlannerFactory for Liar {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Planner>, String> {
        let here = |lie: &&Lie| lie.scene == briefing.scene.as_str();
        Ok(Box::new(Liar(self.0.iter().filter(here).cloned().collect())))
    }
}

impl Planner for Liar {
    fn plan(&mut self, input: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        let plan = straight_on(input);
        match self.0.iter().find(|lie| lie.step == plan.step) {
            Some(lie) => tell(&lie.what, plan),
            None => Ok(plan),
        }
    }
}

fn tell(lie: &str, mut plan: UncheckedPlan) -> Result<UncheckedPlan, String> {
    match lie {
        "die" => raise(Signal::SIGKILL).unwrap(),
        "stop" => raise(Signal::SIGSTOP).unwrap(),
        "silence" => std::thread::sleep(Duration::from_secs(600)),
        // As a Python planner whose main thread is gone, and whose other threads are not.
        "raise" => {
            eprintln!(
                "Traceback (most recent call last):\n  File \"planner.py\", line 7, in plan\nValueError: no lane here"
            );
            std::thread::sleep(Duration::from_secs(600));
        }
        "error" => return Err("I would rather not".to_owned()),
        "nan" => plan.states[7].x = f64::NAN,
        "length" => plan.states.truncate(49),
        "controls" => plan.controls.truncate(10),
        "step" => plan.step += 1,
        // Another plan each time, that drives the AV where it drove.
        "chance" => plan.states[7].x += 1e-6 * f64::from(std::process::id()),
        other => panic!("no such lie: {other}"),
    }
    Ok(plan)
}

fn straight_on(input: &StepInput<'_>) -> UncheckedPlan {
    let av = &input.observation.av;
    let state = |k: usize| {
        let seconds = 0.1 * k as f64;
        PlanState {
            x: av.x + av.velocity_x * seconds,
            y: av.y + av.velocity_y * seconds,
            heading: av.heading,
            speed: av.speed(),
        }
    };
    UncheckedPlan {
        step: input.observation.step,
        states: (1..=PLAN_STEPS).map(state).collect(),
        controls: vec![Control::default(); PLAN_STEPS],
        ..UncheckedPlan::default()
    }
}

/// Shows the token of a node of the next version, and waits to be ended.
fn pose_as_newer(options: &Options) {
    let session = session::open_client(&options.endpoint).unwrap();
    let name = options.name.as_deref().unwrap();
    let mut node = NodeId::new(Role::Planner, options.worker.clone(), name, &session.zid().to_string()).unwrap();
    node.version = WIRE_VERSION + 1;
    let place = Place::seat(&options.run, options.secret.as_ref().unwrap()).unwrap();
    let _token = session.liveliness().declare_token(node.key(&place)).wait().unwrap();
    let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
}

fn main() {
    let options = Cli::parse().node;
    let lie = |text: &str| {
        let words: Vec<&str> = text.split(' ').collect();
        let [scene, step, what] = words[..] else { panic!("RELOOP_LIE is SCENE STEP LIE") };
        Lie { scene: scene.to_owned(), step: step.parse().unwrap(), what: what.to_owned() }
    };
    let lies = std::env::var("RELOOP_LIE").unwrap_or_default();
    let lies: Vec<Lie> = lies.split(';').filter(|text| !text.is_empty()).map(lie).collect();
    if lies.iter().any(|lie| lie.what == "version") {
        return pose_as_newer(&options);
    }
    serve_planner(&options, Arc::new(Liar(lies))).unwrap();
}
