//! How far a drive through a log can be believed. Replayed agents do what they did, whatever the AV does: where somebody would have had to
//! brake for it or swerve, what follows would not have happened so.
//!
//! ```text
//! drive ─▶ Episode, judged again step by step ─┬─▶ who would have had to react, how far from the log ─▶ Step
//!                                              └─▶ every metric, of all steps and without those ─▶ Checked ─▶ Figures of the run
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | here | an episode |
//! | `figures` | a run |
//! | `table` | both, printed |
//! | `file` | each step, in Parquet |

mod figures;
pub mod file;
mod table;

use std::sync::Arc;

use episode::judges::Body;
use episode::judges::reaction::must_react;
use episode::metrics::Counted;
use episode::protocol::Protocol;
use episode::strict::traffic::Traffic;
use world::geometry::{Point, Segment};
use world::scene::bridged::Bridged;
use world::scene::{AgentState, Scene, TrackId};

use crate::drives::{Driven, RetraceError};

pub use figures::{Figures, Stray};
pub use table::{render, scenes};

/// A step of a drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Its number.
    pub step: u32,
    /// Log index of the moment after it.
    pub log_index: u32,
    /// Replayed agents that would have had to react to the AV, and not to the logged AV too, in the order of the log.
    pub reacting: Vec<Reacting>,
    /// How many agents were not replayed, and did what they had to.
    pub reacted: u32,
    /// Distance (m) to where the logged AV is at that moment; none where it is not there.
    pub from_log: Option<f64>,
    /// Distance (m) to the path of the logged AV, whenever it is there; none without one.
    pub from_path: Option<f64>,
}

/// Somebody who would have had to react.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reacting {
    /// Who.
    pub track: TrackId,
    /// Time (s) until it meets the AV if both go on as they do; 0 where it is driving through it.
    pub time: f64,
}

impl Step {
    /// Whether what was driven in it can be believed: nobody would have had to react.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.reacting.is_empty()
    }

    /// Whether somebody drives through the AV.
    #[must_use]
    pub fn is_driven_through(&self) -> bool {
        self.reacting.iter().any(|agent| agent.time == 0.0)
    }
}

/// An episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked {
    /// Its steps.
    pub steps: Vec<Step>,
    /// Its metrics without the steps at which somebody would have had to react, in the order of [`episode::metrics::METRICS`].
    pub without: Vec<Option<f64>>,
}

/// Checks a drive under `protocol`.
///
/// # Errors
/// [`RetraceError`] where its scene cannot be driven, so that nothing was.
pub fn check(driven: &Driven, protocol: &Protocol) -> Result<Checked, RetraceError> {
    let mut avs = Vec::with_capacity(driven.states.len());
    let episode = driven.retrace(protocol, |_, episode| avs.push(*episode.av()))?;
    let steps = steps(driven, &avs);
    let flags: Vec<bool> = steps.iter().map(Step::is_valid).collect();
    Ok(Checked { without: episode.measure(Counted::only(&flags)), steps })
}

/// The steps of a drive, by where the AV was after each.
pub(crate) fn steps(driven: &Driven, avs: &[AgentState]) -> Vec<Step> {
    let around = Around::of(&driven.scene);
    let step = |(step, av): (u32, &AgentState)| {
        let mut own = around.step(step, driven.start + step + 1, &Body::of(*av));
        let reacts = driven.moved.get(step as usize).map_or(&[][..], |moved| moved);
        own.reacting.retain(|agent| reacts.iter().all(|other| other.track != agent.track));
        own.reacted = reacts.len() as u32;
        own
    };
    (0..).zip(avs).map(step).collect()
}

/// A scene, as far as it does not depend on the AV that is driven.
struct Around {
    scene: Arc<Scene>,
    traffic: Traffic,
    path: Vec<Segment>,
}

impl Around {
    fn of(scene: &Arc<Scene>) -> Self {
        let bridged = Bridged::of(scene);
        let logged = bridged.judged().av();
        let places: Vec<Point> = logged.states.iter().flatten().map(|state| state.position()).collect();
        let ends = places.iter().skip(1).chain(places.last());
        Self {
            path: places.iter().zip(ends).map(|(&start, &end)| Segment { start, end }).collect(),
            traffic: Traffic::of(&bridged),
            scene: Arc::clone(bridged.judged()),
        }
    }

    fn step(&self, step: u32, log_index: u32, av: &Body) -> Step {
        let at = log_index as usize;
        let logged = self.scene.av().states.get(at).copied().flatten();
        let human = logged.map(Body::of);
        let mut reacting = Vec::new();
        // An agent's own reach is what it travels in 2.9 s; the AV's is added.
        let reach = av.outline.radius() + av.speed * episode::judges::reaction::HORIZON;
        self.traffic.for_each_near(at, av.outline.center, reach, |agent| {
            let Some(time) = must_react(av, agent) else { return };
            // What the logged AV asks of it too it has answered in the log.
            if human.is_none_or(|human| must_react(&human, agent).is_none()) {
                reacting.push(Reacting { track: self.scene.tracks()[agent.track].id, time });
            }
        });
        let center = av.outline.center;
        let from_path = self.path.iter().map(|segment| segment.nearest_to(center).distance_squared).reduce(f64::min);
        Step {
            step,
            log_index,
            reacting,
            reacted: 0,
            from_log: logged.map(|state| state.position().distance(center)),
            from_path: from_path.map(f64::sqrt),
        }
    }
}
