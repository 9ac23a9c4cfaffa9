//! The table of all drives, the worst first. The first rows stand in the page as they are; the page's script turns to the others.

use maud::{Markup, html};
use serde::Serialize;

use super::packed::letters;
use super::{Episode, Played, ReportError, Source};
use crate::compare::outcome::Fault;

/// Rows that stand in the page, for paper and for whoever runs no scripts; `table.js` has as many to a page.
const STANDING: usize = 50;

/// All rows, as `table.js` reads them.
#[derive(Serialize)]
struct Rows<'a> {
    runs: Vec<&'a str>,
    reasons: Vec<&'static str>,
    rows: Vec<Line<'a>>,
}

/// Run, scene, numbers of reasons, end, score, story, number of its drive in the player or -1.
type Line<'a> = (usize, &'a str, Vec<usize>, &'a str, Option<f64>, String, i64);

fn row<'a>(one: &Episode<'a>, faults: &[Fault], drive: i64) -> Line<'a> {
    let why = one.judged.faults.iter().filter_map(|fault| faults.iter().position(|other| other == fault)).collect();
    (one.run, one.row.scene.as_str(), why, one.row.end.as_str(), one.row.score, one.row.story(), drive)
}

/// The table, its filters, and all its rows, packed.
pub fn table(sources: &[Source], episodes: &[Episode<'_>], played: &[Played]) -> Result<Markup, ReportError> {
    let faults: Vec<Fault> = Fault::all().collect();
    let drive = |one: &Episode<'_>| {
        let place = played.iter().position(|other| other.run == one.run && other.scene == one.row.scene);
        place.map_or(-1, |place| place as i64)
    };
    let rows = Rows {
        runs: sources.iter().map(|source| source.label.as_str()).collect(),
        reasons: faults.iter().map(|fault| fault.name()).collect(),
        rows: episodes.iter().map(|one| row(one, &faults, drive(one))).collect(),
    };
    let packed = letters(&serde_json::to_vec(&rows)?);
    let scored = episodes.iter().any(|one| one.row.score.is_some());
    let many = sources.len() > 1;
    Ok(html! {
        (filters(sources, episodes))
        div.scroll id="scenes" tabindex="0" role="region" aria-label="Scenes, worst first" {
            table {
                thead { tr {
                    th.words scope="col" data-key="scene" { button type="button" { "scene" } }
                    @if many { th.words scope="col" { "run" } }
                    th.words scope="col" data-key="trouble" aria-sort="descending" { button type="button" { "trouble" } }
                    th.words scope="col" { "end" }
                    @if scored { th.score scope="col" data-key="score" { button type="button" { "score" } } }
                    th.words scope="col" { "what happened" }
                    th.play scope="col" {}
                } }
                tbody { @for one in episodes.iter().take(STANDING) { (line(sources, one, many, scored)) } }
            }
        }
        div.bars.pager id="pager" hidden {
            button type="button" id="before" { "Previous page" }
            span.note id="shown" aria-live="polite" {}
            button type="button" id="after" { "Next page" }
        }
        @if episodes.len() > STANDING {
            noscript { p.note { "The worst " (STANDING) " of " (episodes.len()) " drives; the others take a script." } }
        }
        script type="text/plain" id="rows" { (packed) }
    })
}

fn line(sources: &[Source], one: &Episode<'_>, many: bool, scored: bool) -> Markup {
    let score = one.row.score.map_or_else(|| "-".to_owned(), |score| format!("{score:.3}"));
    let calm = if one.judged.is_drivable() { "passed" } else { "undrivable" };
    html! { tr {
        td.words.id { (one.row.scene) }
        @if many { td.words { (sources[one.run].label) } }
        td.words {
            @if one.judged.faults.is_empty() { span.tag.calm { (calm) } }
            @for fault in &one.judged.faults { span.tag { (fault.name()) } " " }
        }
        td.words.end { (one.row.end) }
        @if scored { td.score { (score) } }
        td.words.story { (one.row.story()) }
        td.play {}
    } }
}

/// What is shown of the table: by reason, by run, by words.
fn filters(sources: &[Source], episodes: &[Episode<'_>]) -> Markup {
    let failed = episodes.iter().filter(|one| !one.judged.faults.is_empty()).count();
    let passed = episodes.iter().filter(|one| one.judged.faults.is_empty() && one.judged.is_drivable()).count();
    let of = |fault: Fault| episodes.iter().filter(|one| one.judged.faults.contains(&fault)).count();
    let by_fault = Fault::all().map(|fault| (fault.name(), of(fault)));
    let chips = [("failed", failed)].into_iter().chain(by_fault).chain([("passed", passed)]);
    html! {
        div id="filters" hidden {
            div.bars id="reasons" role="group" aria-label="Which drives" {
                @for (name, count) in chips.filter(|(_, count)| *count > 0) {
                    button type="button" value=(name) aria-pressed="false" { (name) " " (count) }
                }
            }
            div.bars {
                input.grow id="find" type="search" placeholder="Find a scene or a word" aria-label="Find a scene or a word";
                @if sources.len() > 1 {
                    select id="run" aria-label="Run" {
                        option value="" { "all runs" }
                        @for (index, source) in sources.iter().enumerate() { option value=(index) { (source.label) } }
                    }
                }
            }
        }
    }
}
