//! The band below a picture: which drive, which step, how fast, and what happens.

use scenarios::picture::{colours, text};

use super::brush::Brush;
use super::letters::Letters;
use crate::footage::Footage;

/// For so many frames an event is told.
const TOLD: usize = 25;
/// What faults are told in.
const FAULT: &str = "#b42318";

pub fn draw(brush: &mut Brush<'_>, letters: &mut Letters, footage: &Footage, frame: usize, title: &str) {
    let [width, height] = brush.size();
    let size = (width / 58.0).clamp(10.0, 26.0);
    let (margin, band) = (0.8 * size, 2.1 * size);
    let mut write = |brush: &mut Brush<'_>, line: &str, at: [f64; 2], colour: &str| {
        if let Some(path) = letters.line(line, at, size) {
            brush.fill(&path, colour, 1.0);
        }
    };
    brush.rectangle([0.0, height - band], [width, band], colours::PAPER, 0.88);
    let base = height - 0.72 * size;
    let shown = &footage.frames[frame];
    let limit = shown.limit.map(|limit| format!(" of {limit:.1}")).unwrap_or_default();
    let step = frame.checked_sub(1).map_or_else(|| "start".to_owned(), |step| format!("step {step}"));
    let figures = format!("{step}   {:.1} s   {:.1}{limit} m/s", frame as f64 / 10.0, shown.av.speed);
    let taken = text::width(&figures, size);
    write(brush, &figures, [width - margin - taken, base], colours::INK);
    let room = width - 4.0 * margin - taken;
    write(brush, &text::fitted(title, size, room), [margin, base], colours::PALE_INK);
    let told = footage.events.iter().rev().find(|event| event.frame <= frame && frame < event.frame + TOLD);
    if let Some(event) = told {
        let line = text::fitted(&event.text, size, width - 4.0 * margin);
        let long = text::width(&line, size);
        brush.rectangle([margin, margin], [long + 1.6 * size, band], colours::PAPER, 0.88);
        let colour = if event.is_fault { FAULT } else { colours::INK };
        write(brush, &line, [margin + 0.8 * size, margin + 1.4 * size], colour);
    }
}
