//! What is said of a picture: the scene's name and time, who is who, how long a metre is.

use std::collections::BTreeSet;

use world::geometry::Point;

use super::Moment;
use super::agents::{Guise, Shown};
use super::canvas::{Canvas, Path, Stroke};
use super::colours;
use super::frame::Frame;
use super::text;

/// Height of the band below a picture, in sizes of its letters.
const BAND: f64 = 2.4;

/// The size of letters in a picture of `width` pixels.
fn letters(width: f64) -> f64 {
    (7.0 + width / 100.0).clamp(9.0, 44.0)
}

/// Height of the band below a picture of `width` pixels.
pub fn height(width: u32) -> u32 {
    (BAND * letters(f64::from(width))).round() as u32
}

/// The base line of letters in the middle of a band: capitals are 0.73 high.
fn base(size: f64) -> f64 {
    (0.5 * BAND + 0.36) * size
}

/// Draws the band; its origin is its upper left corner.
pub fn draw(canvas: &mut Canvas, width: u32, moment: Moment<'_>, legend: &Legend) {
    let (width, size) = (f64::from(width), letters(f64::from(width)));
    let base = base(size);
    let margin = 0.8 * size;
    let when = format!("step {} · {:.1} s", moment.step(), moment.time());
    let when_width = text::width(&when, size);
    let room = width - 2.0 * margin;
    let name = text::fitted(moment.scene().id().as_str(), size, room - when_width - size);
    canvas.text(Point::new(margin, base), size, colours::INK, &name);
    let after = margin + text::width(&name, size) + size;
    let legend_width = legend.width(size);
    if legend_width > 0.0 && after + when_width + 2.0 * size + legend_width <= width - margin {
        canvas.text(Point::new(after, base), size, colours::PALE_INK, &when);
        legend.draw(canvas, Point::new(width - margin - legend_width, base), size);
    } else {
        canvas.text(Point::new(width - margin - when_width, base), size, colours::PALE_INK, &when);
    }
}

/// Who is who among those that are drawn.
#[derive(Debug, Default)]
pub struct Legend {
    guises: BTreeSet<Guise>,
    of_interest: bool,
}

/// Names and marks of the legend, in letters' sizes: mark, gap, name, gap to the next.
const MARK: f64 = 0.9;
const MARK_GAP: f64 = 0.35;
const NEXT: f64 = 1.1;
const OF_INTEREST: &str = "of interest";

impl Legend {
    pub fn add(&mut self, agents: &[Shown]) {
        self.guises.extend(agents.iter().map(|agent| agent.guise));
        self.of_interest |= agents.iter().any(|agent| agent.of_interest);
    }

    fn width(&self, size: f64) -> f64 {
        let names = self.guises.iter().map(|guise| guise.name()).chain(self.of_interest.then_some(OF_INTEREST));
        let each = names.map(|name| text::width(name, size) + (MARK + MARK_GAP + NEXT) * size);
        (each.sum::<f64>() - NEXT * size).max(0.0)
    }

    /// Draws it from `at` on, on its base line.
    fn draw(&self, canvas: &mut Canvas, at: Point, size: f64) {
        let mut x = at.x;
        for guise in &self.guises {
            let center = Point::new(x + 0.5 * MARK * size, at.y - 0.36 * size);
            let mark = match guise {
                Guise::Pedestrian => Path::of_disc(center, 0.32 * size),
                Guise::Cyclist => rectangle(center, 0.45 * size, 0.2 * size),
                _ => rectangle(center, 0.45 * size, 0.28 * size),
            };
            canvas.fill(&mark, guise.colour());
            x = named(canvas, Point::new(x, at.y), size, guise.name());
        }
        if self.of_interest {
            let mark = rectangle(Point::new(x + 0.5 * MARK * size, at.y - 0.36 * size), 0.45 * size, 0.3 * size);
            canvas.stroke(&mark, Stroke::new(colours::INTEREST, 0.1 * size));
            named(canvas, Point::new(x, at.y), size, OF_INTEREST);
        }
    }

    /// Height of a band of its own below a sheet of tiles of `tile` pixels; 0 where `width` pixels have no room for it.
    pub fn height(&self, tile: u32, width: u32) -> u32 {
        let room = f64::from(width) - f64::from(tile / 20);
        if self.width(letters(f64::from(tile))) <= room { height(tile) } else { 0 }
    }

    /// Draws that band; `at` is its upper right corner.
    pub fn draw_band(&self, canvas: &mut Canvas, tile: u32, at: Point) {
        let size = letters(f64::from(tile));
        self.draw(canvas, Point::new(at.x - self.width(size), at.y + base(size)), size);
    }
}

/// Writes the name of the mark at `at`; answers where the next begins.
fn named(canvas: &mut Canvas, at: Point, size: f64, name: &str) -> f64 {
    let x = at.x + (MARK + MARK_GAP) * size;
    canvas.text(Point::new(x, at.y), size, colours::PALE_INK, name);
    x + text::width(name, size) + NEXT * size
}

fn rectangle(center: Point, half_width: f64, half_height: f64) -> Path {
    let corner = |x: f64, y: f64| center + Point::new(x * half_width, y * half_height);
    Path::of_area(&[corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)])
}

/// A bar of a round number of metres, in the lower left corner of a map.
pub fn scale_bar(canvas: &mut Canvas, frame: &Frame) {
    let size = 0.85 * letters(frame.width);
    let widest = 0.2 * frame.width.min(frame.height) / frame.pixels(1.0);
    let lengths = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0];
    let meters = lengths.into_iter().rev().find(|length| *length <= widest).unwrap_or(lengths[0]);
    let (length, tick) = (frame.pixels(meters), 0.3 * size);
    let label = format!("{meters} m");
    let margin = 1.1 * size;
    let left = Point::new(margin, frame.height - margin);
    let right = left + Point::new(length, 0.0);
    let up = Point::new(0.0, -tick);
    let bar = Path::of_line(&[left + up, left, right, right + up]);
    // A plate, so that it is read on whatever lies below.
    let text_width = text::width(&label, size);
    let plate_right = (right.x + 0.6 * size).max(left.x + text_width + 0.6 * size);
    let (top, bottom) = (left.y - tick - 1.5 * size, left.y + 0.5 * size);
    let plate = [(margin - 0.6 * size, top), (plate_right, top), (plate_right, bottom), (margin - 0.6 * size, bottom)];
    canvas.veil(&Path::of_area(&plate.map(|(x, y)| Point::new(x, y))));
    canvas.stroke(&bar, Stroke::new(colours::INK, 0.11 * size));
    let middle = left.x + 0.5 * (length - text_width).max(0.0);
    canvas.text(Point::new(middle, left.y - tick - 0.35 * size), size, colours::INK, &label);
}
