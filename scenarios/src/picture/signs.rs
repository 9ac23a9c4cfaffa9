//! Stop signs and signals.

use world::geometry::Point;
use world::map::Map;
use world::signal::{Signal, SignalState};

use super::canvas::{Canvas, Path, Stroke};
use super::frame::Frame;
use super::{colours, text};

/// Radius of a stop sign (m): larger than signs are, so that it is found.
const STOP_SIGN: f64 = 0.95;
/// It stands on the sign where there is room.
const WORD: &str = "STOP";
/// Radius of a signal's dot (m).
const SIGNAL: f64 = 0.75;

pub fn draw_stop_signs(canvas: &mut Canvas, frame: &Frame, map: &Map) {
    let radius = frame.at_least(STOP_SIGN, 4.0);
    for sign in &map.stop_signs {
        let center = frame.pixel(sign.position.xy());
        if !frame.sees(center, center, radius) {
            continue;
        }
        let octagon = octagon(center, radius);
        canvas.stroke(&octagon, Stroke::new(colours::PAPER, frame.hairs(3.0)));
        canvas.fill(&octagon, colours::STOP_SIGN);
        let size = 0.66 * radius;
        if size >= 4.5 {
            let at = center + Point::new(-0.5 * text::width(WORD, size), 0.36 * size);
            canvas.text(at, size, colours::PAPER, WORD);
        }
    }
}

fn octagon(center: Point, radius: f64) -> Path {
    let corner = |eighth: u32| center + Point::unit((f64::from(eighth) + 0.5) * std::f64::consts::FRAC_PI_4) * radius;
    Path::of_area(&[0, 1, 2, 3, 4, 5, 6, 7].map(corner))
}

/// A dot at each stop point; a ring for a light that flashes.
pub fn draw_signals(canvas: &mut Canvas, frame: &Frame, signals: &[Signal]) {
    let radius = frame.at_least(SIGNAL, 2.8);
    for signal in signals {
        let center = frame.pixel(signal.stop_point.xy());
        if !frame.sees(center, center, radius) {
            continue;
        }
        let dot = Path::of_disc(center, radius);
        canvas.stroke(&dot, Stroke::new(colours::INK, frame.hairs(2.2)));
        canvas.fill(&dot, colours::signal(signal.state));
        if matches!(signal.state, SignalState::FlashingStop | SignalState::FlashingCaution) {
            canvas.fill(&Path::of_disc(center, 0.45 * radius), colours::PAPER);
        }
    }
}
