//! The simulator: many episodes in one run, with nodes that drive them over the bus.
//!
//! | module | what |
//! | --- | --- |
//! | [`cli`], [`request`] | what can be typed, and what it means |
//! | [`entrants`] | a file of who drives |
//! | [`matrix`] | several drivers over the same scenes |
//! | [`side_by_side`] | two drives of a scene in one viewer |
//! | [`check`] | is a node what the bus expects of one? |
//! | [`blame`] | failures driven again with one thing changed |
//! | [`predictions`] | the predictions of recorded episodes, scored |
//! | [`replay`] | recorded episodes driven again |
//! | [`report`], [`render`] | finished runs as a page, drives as pictures and clips |
//! | [`serve`], [`client`] | a service that drives what others ask for, and who asks it |
//! | [`shards`] | a run that several processes drive together |
//! | [`run`] | many episodes: workers, nodes, the bus, interrupts |
//! | [`evaluate`] | drivers side by side on frames of the log |
//! | [`verify`](mod@verify) | the protocol `paper` beside the authors' own numbers |
//!
//! One drive is in [`episode`], what a run leaves in [`results`], tables are in [`evaluation`].

pub mod blame;
pub mod check;
pub mod cli;
pub mod client;
pub mod entrants;
pub mod evaluate;
pub mod matrix;
pub mod predictions;
pub mod render;
pub mod replay;
pub mod report;
pub mod request;
pub mod run;
pub mod serve;
pub mod shards;
pub mod side_by_side;
pub mod verify;
