//! Agents that react: what whoever drives them is told, and what it answers.
//!
//! The simulator takes agents over from the log, one by one, and says of each where it goes and where it is now: a [`Taken`]. The answer is a
//! state a step later for each of them, [`UncheckedMoves`] until they are checked.
//!
//! | module | what |
//! | --- | --- |
//! | [`way`] | where an agent goes: where, never when |
//! | [`ways`] | how ways are made, of a log and of lanes |
//! | [`moves`] | the answer, and what is refused |

pub mod moves;
pub mod way;
pub mod ways;

use std::sync::Arc;

pub use moves::{Change, MoveError, Moves, TrafficMove, UncheckedMoves};
pub use way::{LaneStretch, Way, WayPlace};
pub use ways::Ways;

use crate::scene::{AgentKind, AgentState, TrackId};

/// An agent that is taken over from the log.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// Which track.
    pub track: TrackId,
    /// What it is.
    pub kind: AgentKind,
    /// The step of the first observation at which it was taken over; there it still is where it was logged.
    pub since_step: u32,
    /// Where it is now.
    pub state: AgentState,
    /// Where it goes. It begins a little behind the place where it was taken over.
    pub way: Arc<Way>,
}
