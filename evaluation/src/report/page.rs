//! All of a report in one file. Text is escaped by the template; scripts and styles run by their hash alone, and nothing is loaded from
//! anywhere, because the page says so to the browser.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use sha2::{Digest, Sha256};

use super::plots::{Sample, boxplots};
use super::{Episode, Played, ReportError, Source, episodes, overview, stage, versus};
use crate::compare::Comparison;
use crate::compare::figures::FIGURES;
use crate::table;

const CSS: &str = include_str!("report.css");
const SCRIPTS: [&str; 2] = [include_str!("table.js"), include_str!("player.js")];

/// The file.
pub fn page(
    sources: &[Source],
    drives: &[Episode<'_>],
    comparison: Option<&Result<Comparison, String>>,
    played: &[Played],
    most_players: usize,
    notes: &[String],
) -> Result<String, ReportError> {
    let title = title(sources);
    let script = SCRIPTS.join("\n");
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(policy(&script));
                meta name="referrer" content="no-referrer";
                title { (title) }
                link rel="icon" href="data:,";
                style { (PreEscaped(CSS)) }
            }
            body {
                header {
                    h1 { (title) }
                    p.lead { (lead(sources)) }
                    nav aria-label="Parts" {
                        a href="#overview" { "Overview" }
                        @if comparison.is_some() { a href="#versus" { "A against B" } }
                        a href="#drives" { "Drives" }
                        a href="#distributions" { "Distributions" }
                    }
                }
                main {
                    (overview::section(sources))
                    @if let Some(comparison) = comparison { (versus::section(comparison)) }
                    section id="drives" {
                        h2 { "Drives" }
                        p.note { (players(drives, played, most_players)) }
                        @for note in notes { p.note { (note) } }
                        (stage::section(sources, played))
                        (episodes::table(sources, drives, played)?)
                    }
                    (distributions(sources)?)
                }
                footer {
                    p { "Made by reloop " (results::version::VERSION) " (" (results::version::GIT_REVISION) "). One file, nothing is loaded from anywhere." }
                }
                script { (PreEscaped(&script)) }
            }
        }
    };
    Ok(page.into_string())
}

fn title(sources: &[Source]) -> String {
    let labels: Vec<&str> = sources.iter().map(|source| source.label.as_str()).collect();
    match labels[..] {
        [one] => format!("Drive report: {one}"),
        [a, b] => format!("Drive report: {a} against {b}"),
        _ => format!("Drive report: {} runs", labels.len()),
    }
}

fn lead(sources: &[Source]) -> String {
    let summaries: Vec<_> = sources.iter().map(|source| &source.summary).collect();
    let alike = summaries.windows(2).all(|pair| pair[0].protocol == pair[1].protocol);
    if alike { table::title(&summaries) } else { "runs under different protocols, never in one table".to_owned() }
}

/// Which drives have a player.
fn players(drives: &[Episode<'_>], played: &[Played], most: usize) -> String {
    let failed = drives.iter().filter(|one| !one.judged.faults.is_empty()).count();
    let all = drives.len();
    let told = match (failed, played.len()) {
        (0, 0) => format!("None of {all} drives failed, so that none has a player"),
        (failed, 0) => format!("{failed} of {all} drives failed; none has a player"),
        (failed, shown) if failed > most => {
            format!(
                "{failed} of {all} drives failed; the player has {shown}: the {most} worst, and those that were asked for (--players, --episodes)"
            )
        }
        (failed, shown) => format!("{failed} of {all} drives failed; the player has {shown}"),
    };
    format!("{told}. The table is sorted by trouble: drives without a result, then by score.")
}

fn distributions(sources: &[Source]) -> Result<Markup, ReportError> {
    let mut figures = Vec::new();
    let protocols = {
        let mut names: Vec<&str> = Vec::new();
        sources.iter().map(|source| source.summary.protocol.as_str()).for_each(|name| {
            if !names.contains(&name) {
                names.push(name);
            }
        });
        names
    };
    for protocol in &protocols {
        for (name, unit, metric, digits) in table::measures(protocol) {
            let Some(column) = FIGURES.iter().position(|(figure, _)| *figure == metric) else { continue };
            let of = |source: &Source| {
                let values = source.judged.episodes.iter().filter_map(|one| one.values.get(column).copied().flatten());
                Sample::new(source.label.clone(), values)
            };
            let samples: Vec<Sample> =
                sources.iter().filter(|one| one.summary.protocol == **protocol).map(of).collect();
            let Some(svg) = boxplots(&name, &samples)? else { continue };
            let unit = if protocols.len() > 1 { format!("{unit} · {protocol}") } else { unit.to_owned() };
            figures.push(html! {
                figure.card {
                    figcaption { (name) span { (unit) } }
                    div role="img" aria-label=(spoken(&name, digits, &samples)) { (PreEscaped(svg)) }
                }
            });
        }
    }
    Ok(html! {
        section id="distributions" {
            h2 { "Distributions" }
            p.note {
                "Over the episodes with a result. A box holds the middle half of the values, its line is the median; whiskers reach the last \
                 values within one and a half times the box, dots are beyond."
            }
            div.plots { @for figure in figures { (figure) } }
        }
    })
}

/// A plot in words.
fn spoken(name: &str, digits: usize, samples: &[Sample]) -> String {
    let one = |sample: &Sample| {
        let boxed = sample.boxed()?;
        let (first, median, third) = (boxed.first, boxed.median, boxed.third);
        Some(format!(
            "{}: median {median:.digits$}, middle half {first:.digits$} to {third:.digits$}, n = {}",
            sample.label,
            sample.count()
        ))
    };
    let all: Vec<String> = samples.iter().filter_map(one).collect();
    format!("Boxplots of {name}. {}", all.join("; "))
}

/// What the browser lets the page do: run this script, look like this, and nothing else.
fn policy(script: &str) -> String {
    let hash = |text: &str| format!("'sha256-{}'", STANDARD.encode(Sha256::digest(text.as_bytes())));
    format!("default-src 'none'; script-src {}; style-src {}; img-src data:", hash(script), hash(CSS))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// The colours of the page in the light, and in the dark.
    fn colours() -> [BTreeMap<&'static str, [u8; 3]>; 2] {
        let mut blocks = CSS.match_indices(":root").map(|(at, _)| CSS[at..].split('}').next().unwrap());
        [blocks.next().unwrap(), blocks.next().unwrap()].map(|block| {
            let named = block.split("--").skip(1).filter_map(|line| {
                let (name, colour) = line.split_once(": #")?;
                let part = |at: usize| u8::from_str_radix(&colour[at..at + 2], 16).unwrap();
                Some((name, [part(0), part(2), part(4)]))
            });
            named.collect()
        })
    }

    /// The contrast of two colours (WCAG 2.2).
    fn contrast(one: [u8; 3], other: [u8; 3]) -> f64 {
        let light = |part: u8| {
            let part = f64::from(part) / 255.0;
            if part <= 0.04045 { part / 12.92 } else { libm::pow((part + 0.055) / 1.055, 2.4) }
        };
        let luminance = |[r, g, b]: [u8; 3]| 0.2126 * light(r) + 0.7152 * light(g) + 0.0722 * light(b);
        let (low, high) = (luminance(one).min(luminance(other)), luminance(one).max(luminance(other)));
        (high + 0.05) / (low + 0.05)
    }

    #[test]
    fn text_is_well_seen_in_the_light_and_in_the_dark() {
        for colours in colours() {
            for text in ["ink", "muted", "accent", "bad", "good"] {
                for ground in ["paper", "card"] {
                    let found = contrast(colours[text], colours[ground]);
                    assert!(found >= 4.5, "{text} on {ground}: {found:.2}");
                }
            }
            for shape in ["av", "plan", "future", "vehicle", "pedestrian", "cyclist", "log", "beside"] {
                let found = contrast(colours[shape], colours["road"]);
                assert!(found >= 1.9, "{shape} on the road: {found:.2}");
            }
        }
    }

    #[test]
    fn scripts_and_styles_cannot_end_early() {
        assert!(
            !CSS.contains("</")
                && SCRIPTS.iter().all(|script| !script.contains("</script") && !script.contains("innerHTML"))
        );
    }
}
