//! The simulator: many episodes in one run, with nodes that drive them over the bus.
//!
//! | module | what |
//! | --- | --- |
//! | [`cli`], [`request`] | what can be typed, and what it means |
//! | [`matrix`] | several drivers over the same scenes |
//! | [`predictions`] | the predictions of recorded episodes, scored |
//! | [`replay`] | recorded episodes driven again |
//! | [`report`], [`render`] | finished runs as a page, drives as pictures and clips |
//! | [`run`] | many episodes: workers, nodes, the bus, interrupts |
//! | [`evaluate`] | drivers side by side on frames of the log |
//! | [`verify`](mod@verify) | the protocol `paper` beside the authors' own numbers |
//!
//! One drive is in [`episode`], what a run leaves in [`results`], tables are in [`evaluation`].

pub mod cli;
pub mod evaluate;
pub mod matrix;
pub mod predictions;
pub mod render;
pub mod replay;
pub mod report;
pub mod request;
pub mod run;
pub mod verify;
