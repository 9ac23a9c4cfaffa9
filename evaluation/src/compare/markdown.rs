//! A comparison for a pull request: the flips at once, the figures folded.

use super::comparison::{Comparison, Flip};
use super::figures::Verdict;
use super::gate::Gate;
use super::grid::{Grid, Side, escaped};
use super::sentences::{self, cells};

/// Flips that are listed before the rest is counted: comments have a limit.
const LISTED: usize = 50;

/// The comparison and its gates as Markdown (GitHub's and GitLab's).
#[must_use]
pub fn render(comparison: &Comparison, gates: &[Gate]) -> String {
    let mut blocks = vec![format!("### {}: {}\n", verdict(comparison, gates), sentences::headline(comparison))];
    blocks.push(sides(comparison));
    blocks.push(format!("{}. {}.\n", escaped(&sentences::rules(comparison)), sentences::test(comparison)));
    if !gates.is_empty() {
        let line = |gate: &Gate| format!("- {}\n", escaped(&sentences::gate(gate)));
        blocks.push(gates.iter().map(line).collect());
    }
    for (flips, name, side) in
        [(&comparison.new_failures, "new failure", "in B"), (&comparison.mended, "mended", "in A")]
    {
        if !flips.is_empty() {
            blocks.push(flip_grid(flips, name, side));
        }
    }
    blocks.extend(figures(comparison));
    let notes: String = sentences::notes(comparison).iter().map(|note| format!("- {}\n", escaped(note))).collect();
    if !notes.is_empty() {
        blocks.push(notes);
    }
    blocks.join("\n")
}

fn verdict(comparison: &Comparison, gates: &[Gate]) -> &'static str {
    if gates.iter().any(|gate| gate.hit) {
        "❌ sim compare"
    } else if !gates.is_empty() || comparison.new_failures.is_empty() {
        "✅ sim compare"
    } else {
        "⚠️ sim compare"
    }
}

fn sides(comparison: &Comparison) -> String {
    let head = ["", "driver", "run"].map(|name| (name, Side::Left));
    let numbers = ["passed", "rate", "95 % interval"].map(|name| (name, Side::Right));
    let mut grid = Grid::new(&[&head[..], &numbers[..]].concat());
    for (name, side) in [("A", &comparison.a), ("B", &comparison.b)] {
        let texts = [name.to_owned(), side.driver.clone(), side.folder.clone()];
        grid.row(texts.into_iter().chain(sentences::passed(side, comparison.pairs)));
    }
    grid.markdown()
}

fn flip_grid(flips: &[Flip], name: &'static str, side: &'static str) -> String {
    let mut grid = Grid::new(&[(name, Side::Left), (side, Side::Left), ("drives part", Side::Left)]);
    for flip in flips.iter().take(LISTED) {
        grid.row([flip.scene.clone(), sentences::why(flip), sentences::parting(flip)]);
    }
    let rest = flips.len().saturating_sub(LISTED);
    let rest = if rest > 0 { format!("\nand {rest} more\n") } else { String::new() };
    grid.markdown() + &rest
}

fn figures(comparison: &Comparison) -> Option<String> {
    let shown = [Verdict::Better, Verdict::Worse, Verdict::NotDistinguishable];
    let shown = shown.iter().flat_map(|verdict| sentences::figures(comparison, &[*verdict])).collect::<Vec<_>>();
    if shown.is_empty() {
        return None;
    }
    let numbers = ["A", "B", "B - A", "95 % interval", "detectable", "p", "n"].map(|name| (name, Side::Right));
    let head = [("figure", Side::Left), ("B is", Side::Left)];
    let mut grid = Grid::new(&[&head[..], &numbers[..]].concat());
    for figure in shown {
        let [name, rest @ ..] = cells(figure);
        grid.row([name, figure.verdict.to_string()].into_iter().chain(rest));
    }
    let tally = sentences::tally(comparison);
    Some(format!("<details><summary>Figures: {tally}</summary>\n\n{}\n</details>\n", grid.markdown()))
}
