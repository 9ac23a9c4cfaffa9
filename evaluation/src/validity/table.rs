//! What was found, printed.

use comfy_table::{Cell, CellAlignment, Table, presets};

use super::figures::{Figure, stray};
use super::{Checked, Figures, Step};
use crate::table::{TableFormat, plain, quoted};

/// Prints the figures of runs, one after the other.
#[must_use]
pub fn render(runs: &[Figures], format: TableFormat) -> String {
    if format == TableFormat::Csv {
        return csv(runs);
    }
    let texts = runs.iter().map(|run| {
        let mut table = Table::new();
        table.set_header([Cell::new("metric"), right("all steps"), right("without"), right("unit")]);
        let fewer = run.driven().count();
        let number = |value: Option<(f64, usize)>| match value {
            Some((value, episodes)) => format!("{value:.3}{}", if episodes < fewer { "*" } else { "" }),
            None => "-".to_owned(),
        };
        for Figure { name, unit, all, without } in &run.metrics {
            table.add_row([Cell::new(name), right(number(*all)), right(number(*without)), right(unit)]);
        }
        let grid = laid_out(table, format);
        let note = "* a mean over fewer episodes than were driven";
        let note = if grid.contains('*') { format!("\n{note}\n") } else { String::new() };
        format!("{}\n{grid}\n{note}", head(run, format))
    });
    texts.collect::<Vec<_>>().join("\n")
}

/// Prints the episodes of runs, those that say least of the world first.
#[must_use]
pub fn scenes(runs: &[Figures], format: TableFormat) -> String {
    if format == TableFormat::Csv {
        let mut lines = String::from(
            "run,driver,scene,steps,must_react,first,drives_through,from_log_m,most_from_log_m,from_path_m\n",
        );
        for run in runs {
            let folder = quoted(&run.folder.to_string_lossy());
            for (scene, checked) in run.driven() {
                let found = Found::of(checked);
                let stray = stray([checked].into_iter());
                let number = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
                let first = found.first.map(|first| first.to_string()).unwrap_or_default();
                lines += &format!(
                    "{folder},{},{},{},{},{first},{},{},{},{}\n",
                    quoted(&run.driver),
                    quoted(scene),
                    checked.steps.len(),
                    found.react,
                    found.through,
                    number(stray.map(|stray| stray.from_log)),
                    number(stray.map(|stray| stray.most_from_log)),
                    number(stray.map(|stray| stray.from_path)),
                );
            }
        }
        return lines;
    }
    let texts = runs.iter().map(|run| {
        let mut rows: Vec<(&str, &Checked, Found)> =
            run.driven().map(|(scene, checked)| (scene, checked, Found::of(checked))).collect();
        rows.sort_by_key(|(_, _, found)| std::cmp::Reverse(found.react));
        let mut table = Table::new();
        let head_cells = ["steps", "must react", "first", "through", "from log m", "at most m", "from path m"];
        table.set_header(std::iter::once(Cell::new("scene")).chain(head_cells.map(right)).chain([Cell::new("tracks")]));
        for (scene, checked, found) in rows {
            let stray = stray([checked].into_iter());
            let metres =
                |value: Option<f64>| right(value.map_or_else(|| "-".to_owned(), |value| format!("{value:.1}")));
            table.add_row([
                Cell::new(scene),
                right(checked.steps.len()),
                right(found.react),
                right(found.first.map_or_else(|| "-".to_owned(), |first| first.to_string())),
                right(found.through),
                metres(stray.map(|stray| stray.from_log)),
                metres(stray.map(|stray| stray.most_from_log)),
                metres(stray.map(|stray| stray.from_path)),
                Cell::new(found.tracks.join(" ")),
            ]);
        }
        format!("{}\n{}\n", head(run, format), laid_out(table, format))
    });
    texts.collect::<Vec<_>>().join("\n")
}

/// What is told of an episode.
struct Found {
    /// Steps at which somebody would have had to react.
    react: usize,
    /// The first of them.
    first: Option<u32>,
    /// Steps at which somebody drives through the AV.
    through: usize,
    /// Who, in the order of the first time.
    tracks: Vec<String>,
}

impl Found {
    fn of(checked: &Checked) -> Self {
        let found = || checked.steps.iter().filter(|step| !step.is_valid());
        let mut tracks: Vec<String> = Vec::new();
        for agent in found().flat_map(|step| &step.reacting) {
            let track = agent.track.to_string();
            if !tracks.contains(&track) {
                tracks.push(track);
            }
        }
        Self {
            react: found().count(),
            first: found().next().map(|step| step.step),
            through: found().filter(|step| step.is_driven_through()).count(),
            tracks,
        }
    }
}

fn right(text: impl ToString) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

fn laid_out(mut table: Table, format: TableFormat) -> String {
    if format == TableFormat::Markdown {
        table.load_preset(presets::ASCII_MARKDOWN);
        return table.to_string();
    }
    plain(table).join("\n")
}

/// What a run comes to, in sentences.
fn head(run: &Figures, format: TableFormat) -> String {
    let steps = || run.driven().flat_map(|(_, checked)| &checked.steps);
    let (all, react) = (steps().count(), steps().filter(|step| !step.is_valid()).count());
    let through = steps().filter(|step: &&Step| step.is_driven_through()).count();
    let episodes = run.driven().count();
    let touched = run.driven().filter(|(_, checked)| checked.steps.iter().any(|step| !step.is_valid())).count();
    let name = format!("{}: driver {}, protocol {}", run.folder.display(), run.driver, run.protocol);
    let name = if format == TableFormat::Markdown { format!("**{name}**") } else { name };
    let share = if all > 0 { 100.0 * react as f64 / all as f64 } else { 0.0 };
    let mut lines = vec![
        name,
        String::new(),
        format!(
            "At {react} of {all} steps ({share:.1} %), in {touched} of {episodes} episodes, a replayed agent would have had to react"
        ),
        format!("to the AV; at {through} of them it drives through it."),
    ];
    let reacted: u32 = steps().map(|step| step.reacted).sum();
    if let Some(traffic) = &run.traffic {
        let steps = steps().filter(|step| step.reacted > 0).count();
        lines.push(format!("Others reacted (traffic {traffic}): {reacted} times an agent, at {steps} steps."));
    }
    if let Some(stray) = run.stray() {
        lines.push(format!(
            "The AV is {:.1} m from where the log has it, on average ({:.1} m at most), and {:.1} m from its path.",
            stray.from_log, stray.most_from_log, stray.from_path
        ));
    }
    lines.push(String::new());
    lines.join("\n")
}

fn csv(runs: &[Figures]) -> String {
    let mut lines = String::from("run,driver,metric,unit,all,all_episodes,without,without_episodes\n");
    for run in runs {
        let (folder, driver) = (quoted(&run.folder.to_string_lossy()), quoted(&run.driver));
        for Figure { name, unit, all, without } in &run.metrics {
            let told = |value: Option<(f64, usize)>| {
                value.map_or_else(|| ",0".to_owned(), |(value, episodes)| format!("{value},{episodes}"))
            };
            lines += &format!("{folder},{driver},{name},{unit},{},{}\n", told(*all), told(*without));
        }
    }
    lines
}
