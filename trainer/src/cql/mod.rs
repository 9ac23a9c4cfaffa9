//! Conservative Q-learning: the policy of the driver `cql` from logged drives alone (paper section IV-C; Kumar, Zhou, Tucker and Levine 2020).
//!
//! ```text
//! Transitions ──▶ batch ──▶ policy, critics on a tape ──▶ losses ──▶ Adam ──▶ targets follow
//! ```
//!
//! The algorithm is that of d3rlpy 2.8.1 (`CQLImpl`, `SACImpl`), step for step, with its defaults; `checks/d3rlpy_step.py` holds one step to it.
//!
//! | file | what |
//! | --- | --- |
//! | `settings` | what a training is told |
//! | `loss` | the Bellman error, the conservative gap, squashed normal distributions: numbers in, numbers and slopes out |
//! | `networks` | policy and critics on a tape |
//! | `state` | all that is learned, and how it goes to disk |
//! | `learner` | one step on a batch |
//! | `training` | the loop |

mod learner;
mod loss;
mod networks;
mod settings;
mod state;
#[cfg(test)]
mod tests;
mod training;

pub use learner::{Batch, Noise, Report, greedy, step};
pub use networks::Networks;
pub use settings::Settings;
pub use state::State;
pub use training::{EpochMeans, Task, Watch, train};
