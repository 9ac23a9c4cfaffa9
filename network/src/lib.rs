//! The learned predictor of DIPP: what it is shown, what it has learned, what it says.
//!
//! ```text
//! a logged scene ─┐                        Weights (a file's bytes) ──▶ Network
//!                 ├─▶ Window ──▶ features ──▶ Frame ──────────────────────▶ forward ──▶ Prediction
//! observations ───┘
//! ```
//!
//! The architecture is the authors', number for number (paper section III-B; `network.md` is cited throughout). Pure: no IO, no
//! message, no learning framework.
//!
//! | module | what |
//! | --- | --- |
//! | [`features`] | from what a node knows at a step to a frame |
//! | [`weights`] | the weights, by name, in and out of files |
//! | [`inference`] | the network as a function of a frame |
//! | [`cql`] | the policy of the driver `cql`, a network of its own: what it is shown, its weights, what it does |
//! | [`verify`] | both against the numbers of other implementations |
//! | [`fuzzing`] | what every file must keep |

pub mod constants;
pub mod cql;
pub mod features;
mod frame;
pub mod fuzzing;
pub mod inference;
pub mod verify;
pub mod weights;

pub use frame::{Attention, Frame, Prediction, Presence};
