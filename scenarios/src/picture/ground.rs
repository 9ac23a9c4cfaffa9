//! The still part of a picture alone: the road, what is painted on it, and stop signs, as pixels for whoever draws over them, frame by frame.

use resvg::tiny_skia::Pixmap;
use world::geometry::Point;
use world::map::Map;

use super::canvas::{Canvas, Path};
use super::frame::Frame;
use super::raster::{self, PngError};
use super::{colours, markings, signs, surface};

/// What of a map is drawn, north up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// What is in the middle (m, the log's frame).
    pub center: Point,
    /// Pixels a metre.
    pub scale: f64,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Lines are as thin as they are well seen in a picture of so many pixels across.
    pub seen_width: u32,
}

/// A part of a map, drawn.
#[derive(Clone, Debug)]
pub struct Ground {
    pixels: Pixmap,
}

impl Ground {
    /// Draws `map` as it is seen by `view`.
    ///
    /// # Errors
    /// [`PngError`] where there would be too many pixels.
    pub fn draw(map: &Map, view: &View) -> Result<Self, PngError> {
        let [width, height] = view.size;
        let frame = Frame::scaled(view.center, view.scale, [width, height].map(f64::from), f64::from(view.seen_width));
        let mut canvas = Canvas::default();
        canvas.begin_cut("map", width, height);
        canvas.fill(&Path::of_rectangle(width, height), colours::GROUND);
        surface::draw(&mut canvas, &frame, map);
        markings::draw(&mut canvas, &frame, map);
        signs::draw_stop_signs(&mut canvas, &frame, map);
        canvas.end();
        Ok(Self { pixels: raster::pixels(&canvas.finish("map", width, height))? })
    }

    /// Pixels across.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.pixels.width()
    }

    /// Pixels down.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.pixels.height()
    }

    /// The pixels, row by row from the upper left corner: red, green, blue and opacity, which is full everywhere.
    #[must_use]
    pub fn rgba(&self) -> &[u8] {
        self.pixels.data()
    }
}
