//! Training of the learned predictor, alone or through the planner (paper, Algorithm 1 and section IV).
//!
//! ```text
//! scenes ──▶ prepare ──▶ Windows (a file) ──▶ batch ──▶ model on a tape ──▶ planner ──▶ losses
//!                                               ▲                                        │ gradient
//!                              Parameters ──────┘◀────────────── Adam ◀──────────────────┘
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | [`windows`] | examples: two seconds before, five seconds after; cut out of scenes, and kept in one file |
//! | [`examples`] | where windows come from, as the loop sees it |
//! | [`parameters`], [`initial`], [`start`] | everything that is learned, in one row of numbers; how it begins |
//! | [`tape`] | derivatives of functions of matrices |
//! | [`model`] | the network with a way back |
//! | [`cost`] | the planner's weights, as the network holds them |
//! | [`loss`], [`planning`] | what is learned from a window, through the planner too |
//! | [`batch`], [`learner`] | a batch through all of that, and back |
//! | [`step`] | what the loop asks, and what it is answered |
//! | [`settings`], [`schedule`] | what a training is told; what of it changes from epoch to epoch |
//! | [`draw`], [`order`] | random numbers that are the same everywhere; in which order windows are seen |
//! | [`optimiser`] | clipping and Adam |
//! | [`training`] | the loop |
//! | [`cql`] | conservative Q-learning, a training of its own |
//! | [`checkpoint`], [`metrics`], [`view`] | what it leaves: to go on from, to read, and to look at |
//! | [`ablation`] | lists of trainings |
//! | [`verify`] | all of it against the authors' numbers |
//! | [`fuzzing`] | what every file must keep |
//! | [`commands`] | the subcommands of the binary |

pub mod ablation;
pub mod batch;
pub mod checkpoint;
pub mod commands;
pub mod cost;
pub mod cql;
pub mod draw;
pub mod examples;
pub mod fuzzing;
pub mod initial;
pub mod learner;
pub mod loss;
pub mod metrics;
pub mod model;
pub mod optimiser;
pub mod order;
pub mod parameters;
pub mod planning;
pub mod schedule;
pub mod settings;
pub mod start;
pub mod step;
pub mod tape;
pub mod training;
pub mod verify;
#[cfg_attr(not(feature = "rerun"), path = "view/absent.rs")]
pub mod view;
pub mod whole_file;
pub mod windows;
