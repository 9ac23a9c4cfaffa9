//! From SVG to PNG.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};
use thiserror::Error;

use super::Picture;

/// The most pixels of a PNG: each takes four bytes of memory.
const MOST_PIXELS: u64 = 150_000_000;

/// Why there is no PNG.
#[derive(Debug, Error)]
pub enum PngError {
    /// It would have too many pixels.
    #[error("a picture of {width} x {height} pixels is too large for a PNG: at most {} million", MOST_PIXELS / 1_000_000)]
    TooLarge {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// The rasteriser does not take the drawing.
    #[error("the drawing cannot be made a PNG: {0}")]
    Drawing(String),
}

pub fn png(picture: &Picture) -> Result<Vec<u8>, PngError> {
    pixels(picture)?.encode_png().map_err(|error| PngError::Drawing(error.to_string()))
}

pub fn pixels(picture: &Picture) -> Result<Pixmap, PngError> {
    let (width, height) = (picture.width(), picture.height());
    let too_large = || PngError::TooLarge { width, height };
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err(too_large());
    }
    let tree =
        Tree::from_str(picture.svg(), &Options::default()).map_err(|error| PngError::Drawing(error.to_string()))?;
    let mut pixels = Pixmap::new(width, height).ok_or_else(too_large)?;
    resvg::render(&tree, Transform::identity(), &mut pixels.as_mut());
    Ok(pixels)
}
