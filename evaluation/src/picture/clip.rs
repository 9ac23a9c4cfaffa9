//! A clip as GIF: one palette for all of its frames.

use std::io::Write;

use color_quant::NeuQuant;
use gif::{Encoder, Frame, Repeat};

use super::{Painter, PictureError};

/// Frames from which the palette is taken, spread over the clip.
const SAMPLES: usize = 5;
/// Of their pixels every so many.
const EVERY: usize = 7;
/// How well the palette is sought: 1 is best, 30 fastest.
const HASTE: i32 = 5;
/// Colours of a palette.
const COLOURS: usize = 256;
/// Bits of a colour's parts by which it is looked up.
const BITS: u32 = 6;
/// How long a step is shown (hundredths of a second): as long as it took.
const DELAY: u16 = 10;
/// How long the last one is.
const LAST_DELAY: u16 = 150;

/// Writes the frames of `painter` up to `last` as a GIF that plays again and again.
///
/// # Errors
/// [`PictureError`].
pub fn gif(painter: &mut Painter<'_>, last: usize, out: impl Write) -> Result<(), PictureError> {
    let failed = |error: gif::EncodingError| PictureError::Clip(error.to_string());
    let [width, height] = painter.look.size.map(|side| u16::try_from(side).unwrap_or(u16::MAX));
    let mut palette = Palette::of(painter, last)?;
    let mut encoder = Encoder::new(out, width, height, &palette.quantiser.color_map_rgb()).map_err(failed)?;
    encoder.set_repeat(Repeat::Infinite).map_err(failed)?;
    for frame in 0..=last {
        let pixels = painter.frame(frame)?;
        let mut shown = Frame::from_indexed_pixels(width, height, palette.indices(pixels), None);
        shown.delay = if frame == last { LAST_DELAY } else { DELAY };
        encoder.write_frame(&shown).map_err(failed)?;
    }
    Ok(())
}

/// The colours of a clip, and which is nearest to another: looked up once for all that are alike.
struct Palette {
    quantiser: NeuQuant,
    nearest: Vec<Option<u8>>,
}

impl Palette {
    fn of(painter: &mut Painter<'_>, last: usize) -> Result<Self, PictureError> {
        let mut pixels = Vec::new();
        for sample in 0..SAMPLES.min(last + 1) {
            let frame = painter.frame(last * sample / (SAMPLES - 1).max(1))?;
            pixels.extend(frame.chunks_exact(4).step_by(EVERY).flatten());
        }
        Ok(Self { quantiser: NeuQuant::new(HASTE, COLOURS, &pixels), nearest: vec![None; 1 << (3 * BITS)] })
    }

    fn indices(&mut self, pixels: &[u8]) -> Vec<u8> {
        let part = |value: u8| usize::from(value >> (8 - BITS));
        let index = |pixel: &[u8]| {
            let place = (part(pixel[0]) << (2 * BITS)) | (part(pixel[1]) << BITS) | part(pixel[2]);
            *self.nearest[place].get_or_insert_with(|| self.quantiser.index_of(pixel) as u8)
        };
        pixels.chunks_exact(4).map(index).collect()
    }
}
