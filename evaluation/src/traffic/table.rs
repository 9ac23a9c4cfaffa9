//! What was found, printed: a column a run.

use comfy_table::{Cell, CellAlignment, Table, presets};
use serde_json::{Value, json};

use super::features::FEATURES;
use super::{Figures, Realism, Side};
use crate::open_loop::table::Format;
use crate::table::{plain, quoted};

/// A figure: of what, and what it is of a run and of the log.
struct Figure {
    /// What programs call it.
    name: String,
    unit: &'static str,
    digits: usize,
    run: Option<f64>,
    log: Option<f64>,
}

fn share(count: usize, of: usize) -> Option<f64> {
    (of > 0).then(|| 100.0 * count as f64 / of as f64)
}

fn figures(realism: &Realism) -> Vec<Figure> {
    let (drive, log) = (&realism.drive, &realism.log);
    let reacts = realism.agents > 0;
    let figure =
        |name: &str, unit, digits, run: Option<f64>, log| Figure { name: name.to_owned(), unit, digits, run, log };
    let count = |name, count: usize| figure(name, "", 0, reacts.then_some(count as f64), None);
    let both = |name, digits, of: fn(&Side) -> Option<f64>| figure(name, "%", digits, of(drive), of(log));
    let overlaps = share(realism.overlaps, realism.agent_steps).map(|percent| 10.0 * percent);
    let mut figures = vec![
        count("agents that reacted", realism.agents),
        count("their steps", realism.agent_steps),
        figure("overlaps in 1,000 of these", "", 2, overlaps, None),
        count("ran into the AV", realism.into_av),
        both("off road, of vehicles' steps", 2, |side| share(side.off_road, side.by_the_road)),
        both("braked below -4.05 m/s²", 2, |side| share(side.hard_braking, side.accelerated)),
        count("had to yield", realism.due),
        figure("yielded", "%", 1, share(realism.yielded, realism.due), None),
        figure("replayed: would have had to react", "%", 2, share(realism.must_react, realism.steps), None),
    ];
    for (feature, (own, logged)) in FEATURES.iter().zip(drive.features.iter().zip(&log.features)) {
        let mean = |values: &[f64]| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        let distance = feature.distance(own, logged);
        let named =
            |what: &str, unit, run, log| Figure { name: format!("{}{what}", feature.name), unit, digits: 3, run, log };
        figures.push(named("", feature.unit, mean(own), mean(logged)));
        figures.push(named(", from the log's", feature.unit, distance.map(|distance| distance.wasserstein), None));
        figures.push(named(", divergence", "", distance.map(|distance| distance.jensen_shannon), None));
    }
    figures
}

/// Prints runs side by side.
#[must_use]
pub fn render(runs: &[Figures], format: Format) -> String {
    let all: Vec<Vec<Figure>> = runs.iter().map(|run| figures(&run.realism)).collect();
    match format {
        Format::Text | Format::Markdown => grid(runs, &all, format == Format::Markdown),
        Format::Csv => csv(runs, &all),
        Format::Json => json(runs, &all),
    }
}

fn traffic(run: &Figures) -> &str {
    run.traffic.as_deref().unwrap_or("none")
}

fn grid(runs: &[Figures], all: &[Vec<Figure>], markdown: bool) -> String {
    let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
    let mut table = Table::new();
    let heads = runs.iter().map(|run| right(format!("{}\n{}", run.driver, traffic(run))));
    let heads = heads.map(|cell| if markdown { right(cell.content().replace('\n', ", ")) } else { cell });
    table.set_header([Cell::new("driver, traffic")].into_iter().chain(heads).chain([Cell::new("unit")]));
    let Some(first) = all.first() else { return String::new() };
    for (row, head) in first.iter().enumerate() {
        let cells = all.iter().map(|figures| {
            let Figure { digits, run, log, .. } = &figures[row];
            right(match (run, log) {
                (None, _) => "-".to_owned(),
                (Some(run), None) => format!("{run:.digits$}"),
                (Some(run), Some(log)) => format!("{run:.digits$} ({log:.digits$})"),
            })
        });
        table.add_row([Cell::new(&head.name)].into_iter().chain(cells).chain([Cell::new(head.unit)]));
    }
    let grid = if markdown { table.load_preset(presets::ASCII_MARKDOWN).to_string() } else { plain(table).join("\n") };
    format!(
        "{grid}\n\nIn brackets: what the log has the same agents do at the same moments. docs/traffic.md defines each.\n"
    )
}

fn csv(runs: &[Figures], all: &[Vec<Figure>]) -> String {
    let mut lines = String::from("run,driver,traffic,figure,unit,value,log\n");
    let told = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    for (run, figures) in runs.iter().zip(all) {
        let [folder, driver, traffic] = [&*run.folder.to_string_lossy(), &run.driver, traffic(run)].map(quoted);
        for Figure { name, unit, run, log, .. } in figures {
            lines += &format!("{folder},{driver},{traffic},{},{unit},{},{}\n", quoted(name), told(*run), told(*log));
        }
    }
    lines
}

fn json(runs: &[Figures], all: &[Vec<Figure>]) -> String {
    let told = runs.iter().zip(all).map(|(run, figures)| {
        let figures = figures.iter().map(|figure| {
            json!({ "figure": figure.name, "unit": figure.unit, "value": figure.run, "log": figure.log })
        });
        let figures: Vec<Value> = figures.collect();
        json!({ "run": run.folder, "driver": run.driver, "traffic": traffic(run), "episodes": run.realism.episodes, "figures": figures })
    });
    format!("{:#}\n", Value::Array(told.collect()))
}
