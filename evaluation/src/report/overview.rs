//! Who drove what, by which rules, and how it came out.

use std::collections::BTreeMap;

use maud::{Markup, html};
use results::settings::{Node, Planner, RunFile};
use results::summary::Summary;

use super::Source;
use crate::compare::outcome::Fault;
use crate::compare::run::Run as Judged;
use crate::compare::statistics::proportion::wilson;
use crate::table;

/// Digits of a hash that tell it from others.
const HASH: usize = 12;

/// A card a run, and the table of figures.
pub fn section(sources: &[Source]) -> Markup {
    html! {
        section id="overview" {
            h2 { "Overview" }
            div.cards { @for (index, source) in sources.iter().enumerate() { (card(sources.len(), index, source)) } }
            @for runs in by_protocol(sources) { (figures(&runs)) }
        }
    }
}

fn card(runs: usize, index: usize, source: &Source) -> Markup {
    let drivable = source.judged.episodes.iter().filter(|one| one.is_drivable()).count();
    let passed = source.judged.episodes.iter().filter(|one| one.is_drivable() && one.faults.is_empty()).count();
    let undrivable = source.judged.episodes.len() - drivable;
    let share = passed as f64 / drivable.max(1) as f64;
    let interval =
        wilson(passed, drivable).map(|at| format!(", 95 % interval {:.1} to {:.1} %", 100.0 * at.low, 100.0 * at.high));
    html! {
        article.card {
            h3 {
                @if runs == 2 { span.side { (if index == 0 { "A" } else { "B" }) } }
                span { (source.label) }
            }
            p.big { (passed) " of " (drivable) small { " scenes passed" } }
            svg.bar viewBox="0 0 100 6" preserveAspectRatio="none" aria-hidden="true" {
                rect width="100" height="6" rx="0" {}
                rect.passed width=(format!("{:.2}", 100.0 * share)) height="6" {}
            }
            p.note { (format!("{:.1} %", 100.0 * share)) (interval.unwrap_or_default()) }
            ul.tags {
                @for (fault, scenes) in faults(&source.judged) { li.tag { (fault.name()) " " (scenes) } }
                @if undrivable > 0 { li.tag { "undrivable " (undrivable) } }
            }
            (facts(source))
        }
    }
}

/// In how many scenes each fault was made.
fn faults(judged: &Judged) -> Vec<(Fault, usize)> {
    let mut scenes: BTreeMap<Fault, usize> = BTreeMap::new();
    for fault in judged.episodes.iter().flat_map(|one| &one.faults) {
        *scenes.entry(*fault).or_default() += 1;
    }
    Fault::all().filter_map(|fault| Some((fault, *scenes.get(&fault)?))).collect()
}

fn facts(source: &Source) -> Markup {
    let RunFile { settings, build, machine, .. } = &source.file;
    let changes = settings.protocol.changes();
    let rules = if changes.is_empty() { "as usual".to_owned() } else { changes.join(", ") };
    let predictor = settings.predictor.as_ref().map_or_else(|| "none".to_owned(), node);
    let scenes =
        if machine.scenarios.is_empty() { "the built-in demo set".to_owned() } else { machine.scenarios.join(", ") };
    let recorded = source.file.settings.record;
    let facts = [
        ("Driver", settings.driver.clone()),
        ("Planner", planner(&settings.planner)),
        ("Predictor", predictor),
        ("Protocol", settings.protocol.name().to_owned()),
        ("Motion", settings.protocol.motion_name().to_owned()),
        ("Settings", rules),
        ("Latency", table::latency_name(settings.latency.as_ref())),
        ("Traffic", settings.traffic.as_ref().map_or_else(|| "replayed".to_owned(), ToString::to_string)),
        ("Deadline", format!("{} s", settings.deadline_s)),
        ("Recorded", format!("{recorded:?}").to_lowercase()),
        ("Build", format!("{} ({})", build.version, build.git_revision)),
        ("Scenes", format!("{} of {scenes}", source.file.scenes.len())),
        ("Folder", source.summary.folder.display().to_string()),
    ];
    html! { dl { @for (name, value) in facts { div { dt { (name) } dd { (value) } } } } }
}

fn planner(planner: &Planner) -> String {
    match planner {
        Planner::Node(one) => node(one),
        Planner::Command { command, .. } => format!("command {command}"),
        Planner::External => "started by hand".to_owned(),
    }
}

fn node(node: &Node) -> String {
    if let Some(command) = &node.command {
        return format!("command {command}");
    }
    let weights = node.weights_sha256.iter().map(|hash| format!("weights {}", hash.get(..HASH).unwrap_or(hash)));
    let told = std::iter::once(node.name.clone()).chain(node.options.iter().cloned()).collect::<Vec<_>>().join(" ");
    std::iter::once(told).chain(weights).collect::<Vec<_>>().join(", ")
}

/// The runs, those of one protocol together.
fn by_protocol(sources: &[Source]) -> Vec<Vec<&Summary>> {
    let mut all: Vec<Vec<&Summary>> = Vec::new();
    for source in sources {
        match all.iter_mut().find(|runs| runs[0].protocol == source.summary.protocol) {
            Some(runs) => runs.push(&source.summary),
            None => all.push(vec![&source.summary]),
        }
    }
    all
}

fn figures(runs: &[&Summary]) -> Markup {
    let table::Figures { title, heads, rows, notes } = table::figures(runs);
    html! {
        div.scroll tabindex="0" role="region" aria-label=(format!("Figures: {title}")) {
            table {
                thead { tr {
                    th.words scope="col" { "driver" }
                    th scope="col" { "episodes" }
                    th scope="col" { "failed" }
                    @for head in &heads { th scope="col" { (head) } }
                } }
                tbody { @for (label, counts, values) in &rows { tr {
                    th scope="row" { (label) }
                    @for count in counts { td { (count) } }
                    @for value in values { td { (value) } }
                } } }
            }
        }
        p.note { "Means over the episodes with a result: " (title) "." }
        @for note in &notes { p.note { (note) } }
    }
}
