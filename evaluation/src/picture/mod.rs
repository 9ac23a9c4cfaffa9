//! A drive drawn from above: frame by frame, for a picture or a clip.
//!
//! ```text
//! Footage ─▶ Painter: ground (drawn once, cut to what is seen) ▸ predictions ▸ plan ▸ agents ▸ AV ▸ signals ▸ caption ─▶ pixels ─▶ PNG, GIF, ...
//! ```
//!
//! The ground, the colours and the letters are those of `scenarios render`; what moves is drawn over them by `tiny-skia`. The same drive gives
//! the same bytes on every machine.
//!
//! | module | what |
//! | --- | --- |
//! | here | the painter |
//! | `block` | the ground under some frames |
//! | `brush` | lines, boxes and discs |
//! | `caption` | step, time, speed, and what happens |
//! | `letters` | text |
//! | [`clip`] | a clip as GIF |

mod block;
mod brush;
mod caption;
pub mod clip;
mod letters;

use std::ops::RangeInclusive;

use scenarios::picture::{PngError, colours};
use thiserror::Error;
use tiny_skia::Pixmap;
use world::geometry::Point;
use world::scene::{AgentKind, AgentState};
use world::signal::SignalState;

use crate::footage::{Footage, Frame};
use block::{Block, Window};
use brush::{Brush, Line};
use letters::Letters;

/// Past this a prediction's points are no longer told apart (every so many poses of 0.1 s).
const PREDICTION_STRIDE: usize = 5;
/// Predictions that stay within this distance are not drawn (m).
const STILL: f64 = 0.5;
/// What plans and predictions are drawn in.
const PLAN: &str = "#f08a5d";
const PREDICTION: &str = "#6f4bb0";
/// The least and the most pixels of a picture's sides.
pub const SIDES: RangeInclusive<u32> = 64..=4096;
/// The least and the most metres across.
pub const ACROSS: RangeInclusive<f64> = 5.0..=2000.0;

/// How a drive is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Pixels across and down, each within [`SIDES`].
    pub size: [u32; 2],
    /// Metres across, within [`ACROSS`].
    pub across: f64,
}

/// A picture that cannot be drawn.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum PictureError {
    #[error(
        "the drive has the steps 0 to {last}, so no step {step}\nhint: `last` is where it ended, `start` before its first step"
    )]
    NoStep { step: usize, last: usize },
    #[error("no step of it was driven\nhint: `start` is all that there is to be seen")]
    NotDriven,
    #[error("a picture is {} to {} pixels a side, not {across} x {down}", SIDES.start(), SIDES.end())]
    Size { across: u32, down: u32 },
    #[error("a picture shows {least} to {most} m across, not {0}", least = ACROSS.start(), most = ACROSS.end())]
    Across(f64),
    #[error(transparent)]
    Ground(#[from] PngError),
    #[error("the picture cannot be made a PNG: {0}")]
    Png(String),
    #[error("the clip cannot be written: {0}")]
    Clip(String),
}

/// Draws the frames of a drive, one after the other.
pub struct Painter<'f> {
    footage: &'f Footage,
    /// What the caption calls it.
    title: String,
    look: Look,
    /// Pixels a metre.
    scale: f64,
    last: usize,
    block: Option<Block>,
    letters: Letters,
    canvas: Pixmap,
}

impl<'f> Painter<'f> {
    /// For the frames up to `last` of `footage`.
    ///
    /// # Errors
    /// [`PictureError`] where the look cannot be, or there is no such frame.
    pub fn new(footage: &'f Footage, title: &str, look: Look, last: usize) -> Result<Self, PictureError> {
        let [across, down] = look.size;
        if !look.size.iter().all(|side| SIDES.contains(side)) {
            return Err(PictureError::Size { across, down });
        }
        if !ACROSS.contains(&look.across) {
            return Err(PictureError::Across(look.across));
        }
        let end = footage.frames.len() - 1;
        if last > end {
            return Err(no_frame(last, end));
        }
        let canvas = Pixmap::new(across, down).ok_or(PictureError::Size { across, down })?;
        let scale = f64::from(across) / look.across;
        let title = title.to_owned();
        Ok(Self { footage, title, look, scale, last, block: None, letters: Letters::default(), canvas })
    }

    /// Draws a frame: its pixels, row by row from the upper left corner, as red, green, blue and opacity, which is full.
    ///
    /// # Errors
    /// [`PictureError`] where there is no such frame.
    pub fn frame(&mut self, frame: usize) -> Result<&[u8], PictureError> {
        let footage = self.footage;
        let shown = footage.frames.get(frame).ok_or_else(|| no_frame(frame, footage.frames.len() - 1))?;
        let window = self.window(shown);
        if !self.block.as_ref().is_some_and(|block| block.holds(window)) {
            let rest = footage.frames[frame..=self.last.max(frame)].iter().map(|frame| self.window(frame));
            self.block = Some(Block::draw(footage.scene.map(), rest, self.scale, self.look.size[0])?);
        }
        if let Some(block) = &self.block {
            block.copy(window, self.canvas.data_mut());
        }
        let mut brush = Brush::new(&mut self.canvas, self.scale, window);
        draw(&mut brush, footage, frame, shown);
        caption::draw(&mut brush, &mut self.letters, footage, frame, &self.title);
        Ok(self.canvas.data())
    }

    /// The frame that was drawn last, as the bytes of a PNG file.
    ///
    /// # Errors
    /// [`PictureError::Png`].
    pub fn png(&self) -> Result<Vec<u8>, PictureError> {
        self.canvas.encode_png().map_err(|error| PictureError::Png(error.to_string()))
    }

    /// What is seen: the AV is in the middle.
    fn window(&self, frame: &Frame) -> Window {
        let [across, down] = self.look.size;
        Window::around(Point::new(frame.av.x, frame.av.y), self.scale, across, down)
    }
}

/// In words of steps: frame k + 1 shows what came of step k.
fn no_frame(frame: usize, end: usize) -> PictureError {
    match end {
        0 => PictureError::NotDriven,
        end => PictureError::NoStep { step: frame.saturating_sub(1), last: end - 1 },
    }
}

fn draw(brush: &mut Brush<'_>, footage: &Footage, frame: usize, shown: &Frame) {
    for future in shown.futures.iter().rev() {
        let line =
            Line::new(PREDICTION, brush.at_least(0.25, 1.6)).opacity(0.25 + 0.7 * future.probability.clamp(0.0, 1.0));
        for (_, points) in &future.tracks {
            let moves = points.first().zip(points.last()).is_some_and(|(first, last)| first.distance(*last) > STILL);
            if moves {
                brush.line(points.iter().step_by(PREDICTION_STRIDE).chain(points.last()).copied(), line);
            }
        }
    }
    let av = Point::new(shown.av.x, shown.av.y);
    let plan = Line::new(PLAN, brush.at_least(0.8, 3.0)).opacity(0.85);
    brush.line(std::iter::once(av).chain(shown.plan.iter().step_by(PREDICTION_STRIDE).copied()), plan);
    let scene = &footage.scene;
    let log_index = footage.start + frame;
    for (index, track) in scene.tracks().iter().enumerate().filter(|(index, _)| *index != scene.av_index()) {
        let Some(state) = scene.logged(index, log_index) else { continue };
        if track.kind == AgentKind::Pedestrian {
            brush.disc(state.position(), brush.at_least(0.45, 3.0), colours::agent(track.kind), Some(colours::PAPER));
        } else {
            let nose = if footage.is_reacting(track.id, frame) { colours::AV } else { colours::NOSE };
            brush.body(state, colours::agent(track.kind), nose);
        }
    }
    let [length, width] = footage.size;
    if let Some(logged) = footage.logged_av(frame) {
        brush.ghost(&AgentState { length, width, ..*logged });
    }
    let state =
        AgentState { x: shown.av.x, y: shown.av.y, heading: shown.av.heading, length, width, ..AgentState::default() };
    brush.body(&state, colours::AV, colours::NOSE);
    for signal in scene.signals(footage.log_index(frame)) {
        let point = signal.stop_point.xy();
        let radius = brush.at_least(0.75, 3.0);
        brush.disc(point, radius, colours::signal(signal.state), Some(colours::INK));
        if matches!(signal.state, SignalState::FlashingStop | SignalState::FlashingCaution) {
            brush.disc(point, 0.45 * radius, colours::PAPER, None);
        }
    }
}
