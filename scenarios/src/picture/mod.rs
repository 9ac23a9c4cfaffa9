//! Pictures of scenes from above, for papers and for the eye: one scene at one step, or a sheet of many.
//!
//! ```text
//! Moment ──▶ Tile (frame: metres to pixels) ──▶ surface ▸ markings ▸ trails ▸ agents ▸ signs ▸ caption ──▶ Canvas (SVG) ──▶ PNG
//! ```
//!
//! There is one drawing, and it is SVG: a PNG is that SVG seen by [`resvg`]. The SVG has no text, only outlines of letters (`text`), so it
//! looks alike wherever it is opened; and the same scene gives the same bytes on every machine.
//!
//! Whoever draws many frames of one scene takes the [`Ground`], the [`colours`] and the letters of [`text`], and draws what moves over them.

mod agents;
mod canvas;
mod caption;
pub mod colours;
mod course;
mod frame;
mod ground;
mod markings;
mod moment;
mod paved;
mod raster;
mod sheet;
mod signs;
mod surface;
pub mod text;
mod tile;
mod trails;

pub use ground::{Ground, View};
pub use moment::{Moment, NoStep};
pub use raster::PngError;
pub use sheet::Sheet;

use canvas::Canvas;
use tile::Tile;

/// How scenes are to be drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Width of a scene's picture (pixels), without the margins of a sheet.
    pub width: u32,
    /// How much of the scene is seen.
    pub extent: Extent,
    /// The AV heads up; else north (the log's y axis) is up.
    pub av_up: bool,
    /// How long a past agents trail behind them (s). With 0 they have no trails, and the AV's way ahead is not shown either.
    pub trail: f64,
}

/// How much of a scene is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// A square around the AV, this far to each side (m).
    Radius(f64),
    /// All that is in the map.
    Whole,
}

/// A finished drawing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    svg: String,
    width: u32,
    height: u32,
}

impl Picture {
    /// The scene at its moment, with a caption below.
    #[must_use]
    pub fn of(moment: Moment<'_>, look: &Look) -> Self {
        let tile = Tile::fitting(moment, look);
        let mut canvas = Canvas::default();
        tile.draw(&mut canvas, None);
        canvas.finish(moment.scene().id().as_str(), tile.width(), tile.height())
    }

    /// The drawing as SVG text.
    #[must_use]
    pub fn svg(&self) -> &str {
        &self.svg
    }

    /// Width (pixels).
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height (pixels).
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The drawing as the bytes of a PNG file.
    ///
    /// # Errors
    /// [`PngError`] where it is larger than a PNG is made.
    pub fn png(&self) -> Result<Vec<u8>, PngError> {
        raster::png(self)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may fail by panic")]
mod tests;
