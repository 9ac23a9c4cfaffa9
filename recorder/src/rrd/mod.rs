//! An episode as a Rerun recording. `docs/recordings.md` lists the entities and timelines.

mod beside;
mod blueprint;
mod columns;
mod drawing;
mod live;

pub use beside::{Side, beside};
pub use drawing::Drawing;
pub use live::Live;
pub use rrd::{APPLICATION, RrdError};
