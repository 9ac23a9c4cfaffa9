//! Traffic that drives everybody straight on, but for one step of a scene, at which it does what `RELOOP_LIE` says: `SCENE STEP LIE`, with LIE
//! one of `die`, `silence`, `error`, `step` and `jump`; the last at the first step from there on at which anybody is taken over.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;
use std::time::Duration;

use clap::Parser;
use nix::sys::signal::{Signal, raise};
use wire::node::{Options, StepInput, Traffic, TrafficFactory, serve_traffic};
use world::observation::Briefing;
use world::plan::STEP_SECONDS;
use world::traffic::{Taken, TrafficMove, UncheckedMoves};

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    node: Options,
}

/// The step and what is done there; none in other scenes.
#[derive(Clone)]
struct Rogue(String, Option<(u32, String)>);

impl TrafficFactory for Rogue {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Traffic>, String> {
        let lie = self.1.clone().filter(|_| self.0 == briefing.scene.as_str());
        Ok(Box::new(Rogue(self.0.clone(), lie)))
    }
}

impl Traffic for Rogue {
    fn moves(&mut self, input: &StepInput<'_>, taken: &[Taken]) -> Result<UncheckedMoves, String> {
        let straight_on = |taken: &Taken| {
            let mut state = taken.state;
            state.x += state.velocity_x * STEP_SECONDS;
            state.y += state.velocity_y * STEP_SECONDS;
            TrafficMove { track: taken.track, state }
        };
        let step = input.observation.step;
        let mut moves = UncheckedMoves { step, moves: taken.iter().map(straight_on).collect() };
        match &self.1 {
            Some((at, what)) if what == "jump" && step >= *at => {
                moves.moves.first_mut().into_iter().for_each(|moved| moved.state.x += 3.0);
            }
            Some((at, what)) if step == *at => match what.as_str() {
                "die" => raise(Signal::SIGKILL).unwrap(),
                "silence" => std::thread::sleep(Duration::from_secs(600)),
                "error" => return Err("I would rather not".to_owned()),
                "step" => moves.step += 1,
                "jump" => {}
                other => panic!("no such lie: {other}"),
            },
            _ => {}
        }
        Ok(moves)
    }
}

fn main() {
    let lie = std::env::var("RELOOP_LIE").unwrap_or_default();
    let words: Vec<&str> = lie.split(' ').collect();
    let rogue = match words[..] {
        [scene, step, what] => Rogue(scene.to_owned(), Some((step.parse().unwrap(), what.to_owned()))),
        _ => Rogue(String::new(), None),
    };
    serve_traffic(&Cli::parse().node, Arc::new(rogue)).unwrap();
}
