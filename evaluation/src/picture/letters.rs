//! Text: the outlines of `scenarios::picture::text` as paths.

use std::collections::BTreeMap;

use scenarios::picture::text::{self, EM};
use tiny_skia::{Path, PathBuilder, Transform};

/// Letters that were needed so far, each read once; none for a space.
#[derive(Default)]
pub struct Letters(BTreeMap<char, Option<Path>>);

impl Letters {
    /// A line of text as one path: it begins at `x` on the base line `y`, `size` is what a font's size is (pixels).
    pub fn line(&mut self, line: &str, [x, y]: [f64; 2], size: f64) -> Option<Path> {
        let mut path = PathBuilder::new();
        let scale = (size / EM) as f32;
        for (letter, at) in text::set(line) {
            let outline = self.0.entry(letter).or_insert_with(|| outline(text::outline(letter)));
            let place = Transform::from_row(scale, 0.0, 0.0, scale, x as f32 + scale * at as f32, y as f32);
            if let Some(placed) = outline.clone().and_then(|outline| outline.transform(place)) {
                path.push_path(&placed);
            }
        }
        path.finish()
    }
}

/// An outline as the font's file writes it: `M`, `L`, `Q` and `Z`, coordinates behind the first three.
fn outline(text: &str) -> Option<Path> {
    let mut path = PathBuilder::new();
    for part in text.split_inclusive('Z').flat_map(commands) {
        let (command, numbers) = part;
        match (command, numbers.as_slice()) {
            ('M', [x, y]) => path.move_to(*x, *y),
            ('L', [x, y]) => path.line_to(*x, *y),
            ('Q', [x1, y1, x, y]) => path.quad_to(*x1, *y1, *x, *y),
            ('Z', _) => path.close(),
            _ => {}
        }
    }
    path.finish()
}

/// The commands of a part, each with its numbers.
fn commands(part: &str) -> Vec<(char, Vec<f32>)> {
    let starts: Vec<usize> =
        part.char_indices().filter(|(_, letter)| letter.is_ascii_uppercase()).map(|(at, _)| at).collect();
    let ends = starts.iter().skip(1).copied().chain([part.len()]);
    let command = |(start, end): (&usize, usize)| {
        let text = part.get(*start..end)?;
        let numbers = text.get(1..)?.split_whitespace().filter_map(|number| number.parse().ok()).collect();
        Some((text.chars().next()?, numbers))
    };
    starts.iter().zip(ends).filter_map(command).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn letters_stand_on_the_base_line_and_a_line_is_as_long_as_it_is_said_to_be() {
        let mut letters = Letters::default();
        let bounds = letters.line("step 42", [10.0, 50.0], 20.0).unwrap().bounds();
        let end = 10.0 + text::width("step 42", 20.0);
        assert!(bounds.left() > 9.0 && f64::from(bounds.right()) < end + 1.0 && bounds.bottom() < 56.0, "{bounds:?}");
        assert!(bounds.top() > 30.0 && f64::from(bounds.right()) > end - 4.0, "{bounds:?}");
        assert!(letters.line(" ", [0.0, 0.0], 20.0).is_none());
    }
}
