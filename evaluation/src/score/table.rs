//! Scores, printed: a table a score, a row a run or a row an episode; for programs every figure.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::Range;

use clap::ValueEnum;
use comfy_table::{Cell, CellAlignment, ContentArrangement, Table, presets};
use results::summary::Summary;
use serde_json::{Map, Value, json};

use super::rows::reasons;
use super::{Episode, Group, Score, Scored};
use crate::table::{FEWER, Show, folded, label, quoted, title};

/// How `sim score` prints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For the terminal
    #[default]
    Text,
    /// For a spreadsheet: every figure
    Csv,
    /// For a page
    Markdown,
    /// For programs: every figure
    Json,
}

/// The scores of runs; with `scenes` a row an episode.
#[must_use]
pub fn render(runs: &[Scored], scenes: bool, format: Format, width: usize) -> String {
    match format {
        Format::Csv if scenes => csv_of_episodes(runs),
        Format::Csv => csv(runs),
        Format::Json => json_of(runs, scenes),
        Format::Text | Format::Markdown => Printed { runs, scenes, format, width }.all(),
    }
}

/// Tables of the same scores.
struct Printed<'a> {
    runs: &'a [Scored],
    scenes: bool,
    format: Format,
    width: usize,
}

impl Printed<'_> {
    fn all(&self) -> String {
        let summaries: Vec<&Summary> = self.runs.iter().map(|run| &run.run).collect();
        let Some(first) = self.runs.first() else { return String::new() };
        let shared = |of: fn(&Summary) -> &str| summaries.windows(2).all(|pair| of(pair[0]) == of(pair[1]));
        let head = if shared(|run| &run.protocol) { title(&summaries) } else { "different protocols".to_owned() };
        let mut text = if self.format == Format::Markdown { format!("**{head}**\n") } else { format!("{head}\n") };
        for (index, group) in first.groups.iter().enumerate() {
            if self.scenes {
                for run in self.runs {
                    let name =
                        if self.runs.len() > 1 { format!(", {}", label(&run.run, &summaries)) } else { String::new() };
                    text += &self.table(group, &name, |range| of_episodes(run, &run.groups[index], range));
                }
            } else {
                text += &self.table(group, "", |range| of_runs(self.runs, index, &summaries, range));
            }
        }
        text + &self.notes(&summaries)
    }

    /// The table of a score, under its name.
    fn table(&self, group: &Group, of: &str, body: impl Fn(Range<usize>) -> Table) -> String {
        let shown = shown(group).filter(|(index, _)| !self.scenes || group.figures[*index].is_of_episodes()).count();
        let name = group.score.name();
        if self.format == Format::Markdown {
            let mut table = body(0..shown);
            table.load_preset(presets::ASCII_MARKDOWN);
            return format!("\n**{name}{of}**\n\n{table}\n");
        }
        format!("\n{name}{of}\n\n{}\n", folded(shown, self.width, body))
    }

    fn notes(&self, summaries: &[&Summary]) -> String {
        let bullet = if self.format == Format::Markdown { "- " } else { "" };
        let mut lines = String::new();
        let fewer = |run: &Scored| {
            run.groups.iter().any(|group| shown(group).any(|(index, _)| value(run, group, index).ends_with(FEWER)))
        };
        if !self.scenes && self.runs.iter().any(fewer) {
            lines += &format!("{bullet}{FEWER} over those of the episodes that have a value\n");
        }
        for run in self.runs {
            let of = if self.runs.len() > 1 { format!("{}: ", label(&run.run, summaries)) } else { String::new() };
            for ((score, reason), episodes) in counted(run) {
                let _ = writeln!(lines, "{bullet}{of}{}, {}: {reason}", score.name(), episodes.describe());
            }
        }
        if lines.is_empty() { lines } else { format!("\n{lines}") }
    }
}

/// Episodes with one reason.
struct Episodes<'e> {
    count: usize,
    first: &'e str,
}

impl Episodes<'_> {
    fn describe(&self) -> String {
        match self.count {
            1 => self.first.to_owned(),
            count => format!("{} and {} more", self.first, count - 1),
        }
    }
}

/// Why scores say nothing, or not all, and of how many episodes.
fn counted(run: &Scored) -> BTreeMap<(Score, &str), Episodes<'_>> {
    let mut counted: BTreeMap<(Score, &str), Episodes<'_>> = BTreeMap::new();
    for episode in &run.episodes {
        for (score, reason) in &episode.reasons {
            let found = counted.entry((*score, reason)).or_insert(Episodes { count: 0, first: &episode.scene });
            found.count += 1;
        }
    }
    counted
}

/// The figures of a score's table, with their places.
fn shown(group: &Group) -> impl Iterator<Item = (usize, (&'static [&'static str], Show))> {
    group.figures.iter().enumerate().filter_map(|(index, figure)| Some((index, figure.shown?)))
}

fn written(value: f64, show: Show) -> String {
    match show {
        Show::Percent => format!("{:.1}", 100.0 * value),
        Show::Mean(digits) => format!("{value:.digits$}"),
    }
}

/// A run's figure, with [`FEWER`] where it is not of all episodes that are judged.
fn value(run: &Scored, group: &Group, figure: usize) -> String {
    let Some((value, episodes)) = run.of_run(group, figure) else { return "-".to_owned() };
    let show = group.figures[figure].shown.map_or(Show::Mean(3), |(_, show)| show);
    written(value, show) + if episodes < run.judged(group) { FEWER } else { "" }
}

fn right(text: impl ToString) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

/// The head of a table: names on the left, then the score's figures.
fn table_of(left: &[(&str, CellAlignment)], group: &Group, range: &Range<usize>) -> Table {
    let mut table = Table::new();
    let left = left.iter().map(|(name, side)| Cell::new(name).set_alignment(*side));
    let figures =
        shown(group).skip(range.start).take(range.len()).map(|(_, (head, _))| right(head.join("\n").trim_end()));
    table.set_header(left.chain(figures));
    table.set_content_arrangement(ContentArrangement::Disabled);
    table
}

fn of_runs(runs: &[Scored], index: usize, summaries: &[&Summary], range: Range<usize>) -> Table {
    let counts = range.start == 0;
    let left: &[(&str, CellAlignment)] = &[
        ("driver", CellAlignment::Left),
        ("driven\nunder", CellAlignment::Left),
        ("epi-\nsodes", CellAlignment::Right),
        ("judged", CellAlignment::Right),
    ];
    let left = &left[..if counts { 4 } else { 1 }];
    let mut table = table_of(left, &runs[0].groups[index], &range);
    for run in runs {
        let group = &run.groups[index];
        let mut row = vec![Cell::new(label(&run.run, summaries))];
        if counts {
            row.extend([Cell::new(&run.run.protocol), right(run.episodes.len()), right(run.judged(group))]);
        }
        let figures = shown(group).skip(range.start).take(range.len());
        row.extend(figures.map(|(figure, _)| right(value(run, group, figure))));
        table.add_row(row);
    }
    table
}

fn of_episodes(run: &Scored, group: &Group, range: Range<usize>) -> Table {
    let mut table = table_of(&[("scene", CellAlignment::Left)], group, &range);
    for episode in &run.episodes {
        let values = group.values(episode);
        let figures = shown(group).skip(range.start).take(range.len());
        let cells = figures.map(|(figure, (_, show))| {
            right(values[figure].map_or_else(|| "-".to_owned(), |value| written(value, show)))
        });
        table.add_row(std::iter::once(Cell::new(&episode.scene)).chain(cells));
    }
    table
}

fn csv(runs: &[Scored]) -> String {
    let mut lines = String::from("run,driver,protocol,settings,episodes");
    for group in runs.first().map(|run| run.groups.as_slice()).unwrap_or_default() {
        let _ = write!(lines, ",{}_judged", group.score.name());
        group.figures.iter().for_each(|figure| lines += &format!(",{}", figure.name));
    }
    lines.push('\n');
    for run in runs {
        let summary = &run.run;
        let [folder, driver, settings] =
            [&*summary.folder.to_string_lossy(), &summary.driver, &summary.settings().join("; ")].map(quoted);
        let _ = write!(lines, "{folder},{driver},{},{settings},{}", summary.protocol, run.episodes.len());
        for group in &run.groups {
            let _ = write!(lines, ",{}", run.judged(group));
            for figure in 0..group.figures.len() {
                lines += &run.of_run(group, figure).map_or_else(|| ",".to_owned(), |(value, _)| format!(",{value}"));
            }
        }
        lines.push('\n');
    }
    lines
}

fn csv_of_episodes(runs: &[Scored]) -> String {
    let mut lines = String::from("run,driver,protocol,scene");
    for group in runs.first().map(|run| run.groups.as_slice()).unwrap_or_default() {
        let figures = group.figures.iter().filter(|figure| figure.is_of_episodes());
        figures.for_each(|figure| lines += &format!(",{}", figure.name));
    }
    lines += ",not_judged\n";
    for run in runs {
        let summary = &run.run;
        for episode in &run.episodes {
            let [folder, driver, scene] =
                [&*summary.folder.to_string_lossy(), &summary.driver, &episode.scene].map(quoted);
            let _ = write!(lines, "{folder},{driver},{},{scene}", summary.protocol);
            for group in &run.groups {
                let told =
                    group.figures.iter().zip(group.values(episode)).filter(|(figure, _)| figure.is_of_episodes());
                told.for_each(|(_, value)| {
                    lines += &value.map_or_else(|| ",".to_owned(), |value| format!(",{value}"));
                });
            }
            let _ = writeln!(lines, ",{}", quoted(&reasons(episode)));
        }
    }
    lines
}

fn json_of(runs: &[Scored], scenes: bool) -> String {
    let told: Vec<Value> = runs.iter().map(|run| json_of_run(run, scenes)).collect();
    // What is made of numbers, texts and objects alone can always be written.
    serde_json::to_string_pretty(&told).unwrap_or_default() + "\n"
}

fn json_of_run(run: &Scored, scenes: bool) -> Value {
    let score = |group: &Group| {
        let figures: Map<String, Value> = group
            .figures
            .iter()
            .enumerate()
            .map(|(index, figure)| {
                let told =
                    run.of_run(group, index).map(|(value, episodes)| json!({ "value": value, "episodes": episodes }));
                (figure.name.clone(), json!(told))
            })
            .collect();
        (group.score.name().to_owned(), json!({ "judged": run.judged(group), "figures": figures }))
    };
    let scores: Map<String, Value> = run.groups.iter().map(score).collect();
    let mut told = json!({
        "run": run.run.folder.to_string_lossy(),
        "driver": run.run.driver,
        "protocol": run.run.protocol,
        "settings": run.run.settings(),
        "episodes": run.episodes.len(),
        "scores": scores,
    });
    if scenes {
        told["scenes"] = run.episodes.iter().map(|episode| json_of_episode(run, episode)).collect();
    }
    told
}

fn json_of_episode(run: &Scored, episode: &Episode) -> Value {
    let figures = run.groups.iter().flat_map(|group| {
        let told = group.figures.iter().zip(group.values(episode)).filter(|(figure, _)| figure.is_of_episodes());
        told.map(|(figure, value)| (figure.name.clone(), json!(value)))
    });
    let reasons = episode.reasons.iter().map(|(score, reason)| (score.name().to_owned(), json!(reason)));
    json!({
        "scene": episode.scene,
        "figures": figures.collect::<Map<_, _>>(),
        "not_judged": reasons.collect::<Map<_, _>>(),
    })
}
