//! Letters as outlines: those of Inter Medium 4.001 (SIL Open Font License, `font/LICENSE`), so that no font is needed to see a picture, and none is
//! searched for.
//!
//! `font/inter.txt` has a line a letter: the letter, how far the next one is from it, and its outline as SVG writes paths; a tab between. Units
//! are those of the font, y down from the base line.

/// Units of the font for its size.
pub const EM: f64 = 2048.0;

static INTER: &str = include_str!("font/inter.txt");

/// What is set for a letter that there is not.
const STRANGER: char = '?';

/// The letters of a line, and where each begins (units of the font).
pub fn set(line: &str) -> impl Iterator<Item = (char, u32)> {
    line.chars().scan(0, |x, letter| {
        let letter = if find(letter).is_some() { letter } else { STRANGER };
        let at = *x;
        *x += advance(letter);
        Some((letter, at))
    })
}

/// How long a line becomes at a font's size (pixels).
#[must_use]
pub fn width(line: &str, size: f64) -> f64 {
    let units: u32 = set(line).map(|(letter, _)| advance(letter)).sum();
    f64::from(units) * size / EM
}

/// `line`, or as much of it as fits, with an ellipsis where the rest was.
#[must_use]
pub fn fitted(line: &str, size: f64, room: f64) -> String {
    if width(line, size) <= room {
        return line.to_owned();
    }
    let mut kept = line.to_owned();
    while kept.pop().is_some() {
        let cut = format!("{kept}…");
        if width(&cut, size) <= room {
            return cut;
        }
    }
    kept
}

/// A letter's outline; empty for a space.
#[must_use]
pub fn outline(letter: char) -> &'static str {
    find(letter).map_or("", |(_, outline)| outline)
}

fn advance(letter: char) -> u32 {
    find(letter).map_or(0, |(advance, _)| advance)
}

fn find(letter: char) -> Option<(u32, &'static str)> {
    INTER.lines().find_map(|line| {
        let (advance, outline) = line.strip_prefix(letter)?.strip_prefix('\t')?.split_once('\t')?;
        Some((advance.parse().ok()?, outline))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_of_ids_and_captions_has_an_outline() {
        let ids = ('a'..='z').chain('A'..='Z').chain('0'..='9').chain("_.-".chars());
        for letter in ids.chain("·…–".chars()) {
            assert!(
                advance(letter) > 300 && outline(letter).starts_with('M') && outline(letter).ends_with('Z'),
                "{letter}"
            );
        }
        assert_eq!((outline(' '), advance(' ') > 0), ("", true));
        assert_eq!(INTER.lines().count(), INTER.lines().filter_map(|line| find(line.chars().next()?)).count());
    }

    #[test]
    fn what_does_not_fit_is_cut_short_and_what_has_no_outline_is_a_question_mark() {
        assert_eq!(fitted("demo-curve", 12.0, 200.0), "demo-curve");
        let cut = fitted("demo-curve", 12.0, 50.0);
        assert!(cut.ends_with('…') && cut.starts_with("dem") && width(&cut, 12.0) <= 50.0, "{cut}");
        assert_eq!(fitted("demo", 12.0, 1.0), "");
        assert_eq!(set("é1").map(|(letter, _)| letter).collect::<String>(), "?1");
    }
}
