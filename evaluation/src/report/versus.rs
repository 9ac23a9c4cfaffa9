//! A against B, as `sim compare` tells it.

use maud::{Markup, html};

use crate::compare::Comparison;
use crate::compare::comparison::Flip;
use crate::compare::figures::{Figure, Verdict};
use crate::compare::sentences;

/// Flips that are listed before the rest is counted.
const LISTED: usize = 60;

/// The section; `comparison` may be the reason why there is none.
pub fn section(comparison: &Result<Comparison, String>) -> Markup {
    html! {
        section id="versus" {
            h2 { "A against B" }
            @match comparison {
                Err(why) => { p { "A and B are not compared: " (why) } },
                Ok(comparison) => { (told(comparison)) },
            }
        }
    }
}

fn told(comparison: &Comparison) -> Markup {
    let differs = comparison.alike < comparison.pairs;
    let told = sentences::figures(comparison, &[Verdict::Better, Verdict::Worse]);
    let open = sentences::figures(comparison, &[Verdict::NotDistinguishable]);
    html! {
        p { strong { (sentences::headline(comparison)) } " (" (sentences::rules(comparison)) ")." }
        @if differs {
            p { (sentences::test(comparison)) "." }
            (flips("New failures", "what went wrong in B", &comparison.new_failures))
            (flips("Mended", "what went wrong in A", &comparison.mended))
            p { (sentences::tally(comparison)) "." }
            @if !told.is_empty() { (figures("Figures that are better or worse", &told)) }
            @if !open.is_empty() {
                details {
                    summary { (open.len()) " figures that are not distinguishable" }
                    (figures("Figures that are not distinguishable", &open))
                }
            }
        }
        @for note in sentences::notes(comparison) { p.note { (note) } }
    }
}

fn flips(name: &str, what: &str, flips: &[Flip]) -> Markup {
    if flips.is_empty() {
        return html! {};
    }
    let rest = flips.len().saturating_sub(LISTED);
    html! {
        div.scroll tabindex="0" role="region" aria-label=(name) {
            table {
                thead { tr { th.words scope="col" { (name) } th.words scope="col" { (what) } th.words scope="col" { "drives part" } } }
                tbody { @for flip in flips.iter().take(LISTED) { tr {
                    td.words.id { (flip.scene) }
                    td.words.story { (sentences::why(flip)) }
                    td.words { (sentences::parting(flip)) }
                } } }
            }
        }
        @if rest > 0 { p.note { "and " (rest) " more: `sim compare` lists them" } }
    }
}

fn figures(what: &str, figures: &[&Figure]) -> Markup {
    let row = |figure: &Figure| {
        let [name, a, b, difference, interval, detectable, p, n] = sentences::cells(figure);
        let (verdict, class) = match figure.verdict {
            Verdict::Better => ("better", "words better"),
            Verdict::Worse => ("worse", "words worse"),
            _ => ("not distinguishable", "words"),
        };
        html! { tr {
            th scope="row" { (name) }
            td { (a) } td { (b) } td { (difference) } td { (interval) } td class=(class) { (verdict) } td { (p) } td { (detectable) } td { (n) }
        } }
    };
    html! {
        div.scroll tabindex="0" role="region" aria-label=(what) {
            table {
                thead { tr {
                    th.words scope="col" { "figure" }
                    @for head in ["A", "B", "B - A", "95 % interval"] { th scope="col" { (head) } }
                    th.words scope="col" { "verdict" }
                    @for head in ["p", "detectable", "n"] { th scope="col" { (head) } }
                } }
                tbody { @for figure in figures { (row(figure)) } }
            }
        }
    }
}
