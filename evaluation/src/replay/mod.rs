//! An episode driven again: what was said then is said now, byte for byte, or the first difference is named. By the plans of its recording in
//! process, or by its nodes, which leave a second recording.
//!
//! ```text
//! recording ──▶ Recorded ─ plans ─▶ Episode ─▶ scene, observations, records, events, end ──┐
//!                  └────────────── the same of then ───────────────────────────────────────┴─▶ Verdict
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | here | the drive in process |
//! | [`held`] | a second recording held to the first, and which process made the difference |
//! | `recorded` | what a recording says |
//! | `difference` | where two messages part |

mod difference;
pub mod held;
mod recorded;

use std::sync::Arc;

use episode::protocol::{Protocol, SettingError};
use episode::traffic::TrafficSettings;
use episode::{Episode, Undrivable};
use thiserror::Error;
use wire::proto::{self, EndReason};
use world::scene::Scene;
use world::traffic::MoveError;

pub use difference::Difference;
use recorded::of_the_drive;
pub use recorded::{PlanError, Recorded};

/// What came of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// All that was said is said again; so many steps.
    Same(u32),
    /// It is not: the first difference.
    Differs(Difference),
}

/// An episode that cannot be driven again.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ReplayError {
    #[error(transparent)]
    Undrivable(#[from] Undrivable),
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error("step {step}: the recorded traffic cannot be driven: {source}")]
    Moves { step: u32, source: MoveError },
}

/// Drives `scene` by the plans of `recorded` and, where agents reacted, by what they did: `traffic` says who is taken over.
///
/// # Errors
/// [`ReplayError`].
pub fn replay(
    scene: Arc<Scene>,
    protocol: &Protocol,
    traffic: Option<&TrafficSettings>,
    recorded: &Recorded,
) -> Result<Verdict, ReplayError> {
    let mut episode = Episode::new(Arc::clone(&scene), protocol)?;
    if let Some(settings) = traffic {
        episode = episode.with_traffic(settings)?;
    }
    let mut drive = Drive { episode, recorded, step: 0 };
    match drive.run() {
        Ok(()) => Ok(Verdict::Same(drive.step)),
        Err(Stop::Differs(difference)) => Ok(Verdict::Differs(difference)),
        Err(Stop::Error(error)) => Err(error),
    }
}

enum Stop {
    Differs(Difference),
    Error(ReplayError),
}

impl From<Difference> for Stop {
    fn from(difference: Difference) -> Self {
        Self::Differs(difference)
    }
}

struct Drive<'r> {
    episode: Episode,
    recorded: &'r Recorded,
    /// Steps that are driven.
    step: u32,
}

impl Drive<'_> {
    fn run(&mut self) -> Result<(), Stop> {
        let recorded = self.recorded;
        difference::at(None, "scene", Some(&recorded.scene), Some(&proto::Scene::from(&self.episode.briefing())))?;
        let mut events = recorded.events.iter();
        let failed = recorded.end.reason() == EndReason::DriverFailed;
        loop {
            let (step, index) = (Some(self.step), self.step as usize);
            if failed && recorded.records.get(index).is_none() {
                // Then the driver had no plan either, or none that could be driven; the end says why.
                break;
            }
            let observation = proto::Observation::from(&self.episode.observe());
            difference::at(step, "observation", recorded.observations.get(index), Some(&observation))?;
            let error = |error: PlanError| Stop::Error(error.into());
            if self.episode.reacts() {
                let moves = recorded.moves(self.step).map_err(error)?;
                let refused = |source| Stop::Error(ReplayError::Moves { step: self.step, source });
                self.episode.move_traffic(moves).map_err(refused)?;
            }
            let advance = match recorded.late_plans(self.step).map_err(error)? {
                Some(plans) => self.episode.follow(&plans.guidance()),
                None => self.episode.advance(&recorded.plan(self.step).map_err(error)?),
            };
            difference::at(step, "record", recorded.records.get(index), Some(&advance.record))?;
            for event in &advance.events {
                difference::at(step, "event", events.next(), Some(event))?;
            }
            let ended = advance.ended.is_some();
            self.step += 1;
            if ended {
                break;
            }
        }
        if failed {
            self.episode.fail(recorded.end.detail.clone());
        }
        let outcome = self.episode.finish();
        if !failed {
            difference::at(None, "event", events.next(), None)?;
            difference::at(None, "record", recorded.records.get(self.step as usize), None)?;
        }
        Ok(difference::at(None, "end", Some(&of_the_drive(&recorded.end)), Some(&of_the_drive(&outcome.end)))?)
    }
}
