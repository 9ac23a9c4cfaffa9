//! An episode as a Rerun recording. `docs/recordings.md` lists the entities and timelines.
//!
//! Written from Rerun's own crates below its SDK: the SDK batches by the clock and names things at random, which would make
//! every file another; and it brings a hundred packages more.

mod blueprint;
mod columns;
mod drawing;
mod store;

pub use drawing::Drawing;
pub use store::{APPLICATION, RrdError};
