//! A comparison for the terminal: what a reader asks first stands first.

use super::comparison::{Comparison, Flip};
use super::figures::{Figure, Verdict};
use super::gate::Gate;
use super::grid::{Grid, Side};
use super::sentences::{self, cells, counted};

/// Flips that are listed before the rest is counted.
const LISTED: usize = 30;

/// The comparison and its gates as text, no wider than `width` where words and names can be broken.
#[must_use]
pub fn render(comparison: &Comparison, gates: &[Gate], width: usize) -> String {
    let mut blocks = vec![head(comparison), capital(&sentences::headline(comparison)) + "\n"];
    if comparison.alike < comparison.pairs {
        for (flips, name, side) in
            [(&comparison.new_failures, "new failure", "in B"), (&comparison.mended, "mended", "in A")]
        {
            if !flips.is_empty() {
                blocks.push(flip_grid(flips, name, side, width));
            }
        }
    }
    blocks.push(pass_rates(comparison, width));
    if comparison.alike < comparison.pairs {
        blocks.extend(figures(comparison, width));
    }
    let notes: String = sentences::notes(comparison).iter().map(|note| wrapped(note, width)).collect();
    if !notes.is_empty() {
        blocks.push(notes);
    }
    if !gates.is_empty() {
        blocks.push(gates.iter().map(|gate| wrapped(&sentences::gate(gate), width)).collect());
    }
    blocks.join("\n")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

fn head(comparison: &Comparison) -> String {
    let sides = [("A", &comparison.a), ("B", &comparison.b)];
    let longest = sides.iter().map(|(_, side)| side.driver.chars().count()).max().unwrap_or(0);
    let line = |(name, side): &(&str, &super::comparison::Side)| {
        format!("{name}  {:longest$}  {}\n", side.driver, side.folder)
    };
    sides.iter().map(line).collect::<String>() + &sentences::rules(comparison) + "\n"
}

fn flip_grid(flips: &[Flip], name: &'static str, side: &'static str, width: usize) -> String {
    let mut grid = Grid::new(&[(name, Side::Left), (side, Side::Words), ("drives part", Side::Left)]);
    for flip in flips.iter().take(LISTED) {
        grid.row([flip.scene.clone(), sentences::why(flip), sentences::parting(flip)]);
    }
    let rest = flips.len().saturating_sub(LISTED);
    let rest = if rest > 0 { format!("and {rest} more (all: --format json)\n") } else { String::new() };
    grid.text(width) + &rest
}

fn pass_rates(comparison: &Comparison, width: usize) -> String {
    let line = |name: &str, side| {
        let [count, rate, interval] = sentences::passed(side, comparison.pairs);
        format!("{name} passes {count}: {rate} (95 % interval {interval})\n")
    };
    let both = match comparison.both_fail {
        0 => String::new(),
        count => format!("{} failed in both\n", counted(count, "scene")),
    };
    let sides = [line("A", &comparison.a), line("B", &comparison.b)].concat();
    sides + &both + &wrapped(&sentences::test(comparison), width)
}

fn figures(comparison: &Comparison, width: usize) -> Vec<String> {
    let mut blocks = Vec::new();
    let told = sentences::figures(comparison, &[Verdict::Better, Verdict::Worse]);
    let open = sentences::figures(comparison, &[Verdict::NotDistinguishable]);
    if !told.is_empty() || !open.is_empty() {
        blocks.push(wrapped(&sentences::tally(comparison), width));
    }
    if !told.is_empty() {
        blocks.push(figure_grid(&told, "better or worse", true, width));
    }
    if !open.is_empty() {
        blocks.push(figure_grid(&open, "not distinguishable", false, width));
    }
    let lists = [(Verdict::Same, "the same in every pair"), (Verdict::NoValue, "no pair has a value")];
    let lists = lists.map(|(verdict, name)| (sentences::figures(comparison, &[verdict]), name));
    let line = |(figures, name): &(Vec<&Figure>, &str)| {
        let names: Vec<&str> = figures.iter().map(|figure| figure.name).collect();
        if names.is_empty() { String::new() } else { wrapped(&format!("{name}: {}", names.join(", ")), width) }
    };
    let lists: String = lists.iter().map(line).collect();
    if !lists.is_empty() {
        blocks.push(lists);
    }
    blocks
}

fn figure_grid(figures: &[&Figure], name: &'static str, verdict: bool, width: usize) -> String {
    let numbers = ["A", "B", "B - A", "95 % interval", "detectable", "p", "n"].map(|name| (name, Side::Right));
    let says = Some(("B is", Side::Left)).filter(|_| verdict);
    let head: Vec<_> = std::iter::once((name, Side::Name)).chain(says).chain(numbers).collect();
    let mut grid = Grid::new(&head);
    for figure in figures {
        let [name, rest @ ..] = cells(figure);
        let says = Some(figure.verdict.to_string()).filter(|_| verdict);
        grid.row(std::iter::once(name).chain(says).chain(rest));
    }
    grid.text(width)
}

/// A paragraph, broken between words; a word that is too long stands alone.
fn wrapped(text: &str, width: usize) -> String {
    let (mut lines, mut line) = (String::new(), String::new());
    for word in text.split(' ') {
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > width {
            lines += &(line + "\n");
            line = format!("  {word}");
        } else {
            if !line.is_empty() {
                line.push(' ');
            }
            line += word;
        }
    }
    lines + &line + "\n"
}
