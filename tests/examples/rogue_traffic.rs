//! Traffic that drives everybody straight on, but for one step of a scene, at which it does what `RELOOP_LIE` says: `SCENE STEP LIE`, with LIE
//! one of `die`, `silence`, `error`, `step`, `chance`, or of those that are about somebody who is taken over: `missing`, `twice`, `stranger`, `nan`,
//! `size`, `jump`, `turn`, `speed`. These are told from that step on, at the first of which anybody is. `hand-over` puts everybody aside who is
//! taken over from there on, by what the sim lets pass.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;
use std::time::Duration;

use clap::Parser;
use nix::sys::signal::{Signal, raise};
use wire::node::{Options, StepInput, Traffic, TrafficFactory, serve_traffic};
use world::observation::Briefing;
use world::plan::STEP_SECONDS;
use world::scene::TrackId;
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
            Some((at, what)) if what == "hand-over" && step >= *at => {
                let new = moves.moves.iter_mut().zip(taken).filter(|(_, taken)| taken.since_step == step);
                new.for_each(|(moved, _)| moved.state.x += 0.4);
            }
            Some((at, what)) if step >= *at && !taken.is_empty() && about_somebody(what, &mut moves.moves) => {}
            Some((at, what)) if step == *at => match what.as_str() {
                "die" => raise(Signal::SIGKILL).unwrap(),
                "silence" => std::thread::sleep(Duration::from_secs(600)),
                "error" => return Err("I would rather not".to_owned()),
                "step" => moves.step += 1,
                "chance" => moves.moves.iter_mut().for_each(|moved| moved.state.x += by_process()),
                "missing" | "twice" | "stranger" | "nan" | "size" | "jump" | "turn" | "speed" | "rise" => {}
                other => panic!("no such lie: {other}"),
            },
            _ => {}
        }
        Ok(moves)
    }
}

/// Tells a lie about the first of them, if it is such a lie.
fn about_somebody(lie: &str, moves: &mut Vec<TrafficMove>) -> bool {
    let first = moves[0];
    match lie {
        "missing" => drop(moves.remove(0)),
        "twice" => moves.push(first),
        "stranger" => moves.push(TrafficMove { track: TrackId(i32::MAX), ..first }),
        "nan" => moves[0].state.y = f64::NAN,
        "size" => moves[0].state.width += 0.5,
        "jump" => moves[0].state.x += 3.0,
        "turn" => moves[0].state.heading += 1.0,
        "speed" => moves[0].state.velocity_x += 5.0,
        "rise" => moves[0].state.z += 3.5,
        _ => return false,
    }
    true
}

/// Up to 0.1 m, other for each process.
fn by_process() -> f64 {
    f64::from(std::process::id() % 1000) * 1e-4
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
