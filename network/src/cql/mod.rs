//! The policy of the driver `cql`: what it is shown, what it has learned, what it does (paper section IV-C, `docs/cql.md`).
//!
//! ```text
//! Briefing ──▶ Painter ─┐                          Policy (a file's bytes)
//! history, signals ─────┴▶ picture, 256 x 256 x 3 ───▶ act ──▶ Action ──▶ the AV's next pose
//! ```
//!
//! | file | what |
//! | --- | --- |
//! | `picture` | the scene around the AV from above, as numbers |
//! | `ground` | of that, what does not move, as outlines; where in the picture a point is |
//! | `brush` | outlines filled, fast |
//! | `action` | the next pose, and the numbers that stand for it |
//! | `shape` | layers of policy and critics, and the tensors that they have |
//! | `policy` | the policy's weights in and out of files, and what it does, fast |

mod action;
mod brush;
mod ground;
mod picture;
mod policy;
mod shape;

pub use action::{ACTIONS, action_of, next_pose};
pub use picture::{AGES, CHANNELS, PICTURE, Painter, SIDE};
pub use policy::{Policy, Workspace, write};
pub use shape::{Convolution, Shape};
