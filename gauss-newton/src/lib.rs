//! The differentiable planner: Gauss-Newton over the controls of the next five seconds.
//!
//! The heart of DIPP (Huang et al., section III-C), exact to the authors' code and its gradients, and some thousand times
//! faster. Pure and f64: no IO, no clock, nothing random.
//!
//! ```text
//! Inputs ──▶ Problem ──▶ Solver ── evaluate ──▶ Evaluation ── factorize, solve ──▶ step ──▶ best controls, history, status
//!           (checked)      └──────── next iteration ◀──────────────────────────────┘
//!                      └─▶ Layer: the same for training, with the gradient back to controls, predictions and weights
//! ```
//!
//! | file | subject |
//! | --- | --- |
//! | `constants` | the authors' numbers, the cost terms |
//! | `controls` | the unknowns |
//! | `problem` | what is to be solved, checked |
//! | `nearest` | the reference line and its exact nearest sample |
//! | `motion` | rollout and its first and second derivatives |
//! | `rows`, `objective` | the cost terms and products with their Jacobian |
//! | `shapes` | how near boxes come to each other |
//! | `sweep`, `dense`, `linear` | the normal equations: along the chain of steps, and written out |
//! | `wide` | loops by the machine's widest vector instructions |
//! | `tree` | futures that share their first controls |
//! | `tree_solver`, `solver` | iterations, stopping, polish: of a tree, and of a chain |
//! | `coupling` | how the authors' samples of a batch depend on the first |
//! | `gradient`, `batch` | the unrolled iterations as a layer of a network; many samples at once |
//!
//! `docs/planner.md` explains the mathematics.

mod batch;
pub mod constants;
mod controls;
mod coupling;
pub mod dense;
mod gradient;
mod linear;
mod motion;
mod nearest;
mod objective;
mod problem;
mod rows;
mod shapes;
mod solver;
mod sweep;
#[cfg(test)]
mod tests;
mod tree;
mod tree_solver;
mod wide;

pub use batch::{Batch, BatchError};
pub use controls::Controls;
pub use coupling::{Choices, Nearest};
pub use gradient::{Gradients, Layer, LayerSettings, OutputGradient};
pub use linear::LinearSolver;
pub use motion::{Motion, StateChange};
pub use nearest::{Frenet, Line};
pub use objective::{Costing, Evaluation, Safety, SafetyRow};
pub use problem::{InfoColumn, Inputs, Neighbor, Problem, ProblemError, Vehicle};
pub use rows::{Extent, Rows};
pub use shapes::Margins;
pub use solver::{Settings, SolveError, Solver, Status, Summary, trajectory};
pub use sweep::BadPivot;
pub use tree::{BRANCHES, Branch, TRUNK, Tree, TreeControls, TreeError};
pub use tree_solver::TreeSolver;
