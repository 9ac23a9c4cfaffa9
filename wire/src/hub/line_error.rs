//! Why a step has no answer, or an episode no recording.

use std::time::Duration;

use thiserror::Error;
use world::scene::SceneId;

use super::inbox::INBOX;
use crate::convert::MessageError;
use crate::envelope::Saying;
use crate::keys::{Role, Worker};
use crate::session::SessionError;

/// Why a step has no answer, or an episode no recording.
#[derive(Debug, Error)]
pub enum LineError {
    /// It did not come in time.
    #[error("the {role} gave no answer within {} s", deadline.as_secs_f64())]
    NoAnswer {
        /// Who was waited for.
        role: Role,
        /// How long.
        deadline: Duration,
    },
    /// It died, left, or was never there.
    #[error("the {role} is gone")]
    NodeLost {
        /// Who.
        role: Role,
    },
    /// It says something that is no answer, or that it has none.
    #[error("the {role}'s answer is refused: {error}")]
    BadAnswer {
        /// Who.
        role: Role,
        /// Why.
        error: MessageError,
    },
    /// It says something that it was not asked for.
    #[error("the {role} says more than it was asked for: {what}")]
    Surplus {
        /// Who.
        role: Role,
        /// What came.
        what: String,
    },
    /// Answers come that nobody asked for.
    #[error("more than {INBOX} answers wait: a node sends what it was not asked for")]
    Flooded,
    /// Somebody told the node something, and it was not the simulator.
    #[error("somebody else spoke to the {role} in the simulator's name")]
    Intruded {
        /// To whom.
        role: Role,
    },
    /// The recording lacks something.
    #[error("the recording is not whole: {what} {sent} sent, {recorded} recorded")]
    NotWhole {
        /// Of what.
        what: &'static str,
        /// As many as were sent.
        sent: u32,
        /// As many as are in the recording.
        recorded: u32,
    },
    /// The recording has as many messages as there were, but not those.
    #[error("the recording does not hold what was told: its digest is another")]
    OtherDigest,
    /// The recorder could not write.
    #[error("the recorder failed: {0}")]
    NotRecorded(String),
    /// The episode is already open.
    #[error("worker {worker} has an episode on already; {scene} is another")]
    Busy {
        /// The episode.
        scene: SceneId,
        /// The worker.
        worker: Worker,
    },
    /// The session failed.
    #[error(transparent)]
    Bus(#[from] SessionError),
}

impl LineError {
    /// What is wrong with an answer, by whom it is.
    pub(super) fn bad(role: Role) -> impl FnOnce(MessageError) -> Self {
        move |error| Self::BadAnswer { role, error }
    }

    /// What was said and not asked for.
    pub(super) fn surplus(role: Role, saying: Saying) -> Self {
        let what = match saying {
            Saying::Plan => "one plan too many",
            Saying::Prediction => "one prediction too many",
            Saying::Moves => "moves once too often",
            Saying::Done => "that it is done, before the end",
        };
        Self::Surplus { role, what: what.to_owned() }
    }
}
