//! The figures of predictions, printed.

use comfy_table::{Cell, CellAlignment, Table, presets};
use world::scene::AgentKind;

use super::{BINS, Errors, Figures, HORIZONS, MISS, Sum};
use crate::table::{TableFormat, plain, quoted};

/// Kinds in the order in which they are told.
const KINDS: [(AgentKind, &str); 4] = [
    (AgentKind::Vehicle, "vehicles"),
    (AgentKind::Pedestrian, "pedestrians"),
    (AgentKind::Cyclist, "cyclists"),
    (AgentKind::Other, "others"),
];

/// Prints the figures of runs: each by its name.
#[must_use]
pub fn render(runs: &[(String, Figures)], format: TableFormat) -> String {
    if format == TableFormat::Csv {
        return csv(runs);
    }
    let texts = runs.iter().map(|(name, figures)| {
        let title = format!("{name}: {} steps with predictions", figures.steps);
        let tables = [errors(figures), reliability(figures)].map(|mut table| match format {
            TableFormat::Markdown => {
                table.load_preset(presets::ASCII_MARKDOWN);
                table.to_string()
            }
            _ => plain(table).join("\n"),
        });
        let title = if format == TableFormat::Markdown { format!("**{title}**") } else { title };
        format!("{title}\n\n{}\n", tables.join("\n\n"))
    });
    texts.collect::<Vec<_>>().join("\n")
}

fn right(text: impl ToString) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

/// A row a kind of agent that there is, and all.
fn rows(figures: &Figures) -> Vec<(&'static str, Errors)> {
    let kinds = KINDS.iter().filter_map(|(kind, name)| Some((*name, *figures.kinds.get(kind)?)));
    kinds.chain([("all", figures.all())]).collect()
}

fn errors(figures: &Figures) -> Table {
    let mut table = Table::new();
    let mut head = vec![Cell::new("agents"), right("cases"), right("ADE m"), right("min ADE m")];
    for seconds in HORIZONS {
        head.extend([
            right(format!("@{seconds} s m")),
            right(format!("min @{seconds} s m")),
            right(format!("miss @{seconds} s %")),
        ]);
    }
    table.set_header(head);
    let number = |value: Option<f64>, digits: usize| {
        right(value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}")))
    };
    for (name, errors) in rows(figures) {
        let of = |sum: &Sum, index: usize| sum.means().map(|means| means[index]);
        let mut row = vec![Cell::new(name), right(errors.average.count)];
        row.extend([number(of(&errors.average, 0), 2), number(of(&errors.average, 1), 2)]);
        for sum in &errors.at {
            let misses = of(sum, 2).map(|share| 100.0 * share);
            row.extend([number(of(sum, 0), 2), number(of(sum, 1), 2), number(misses, 1)]);
        }
        table.add_row(row);
    }
    table
}

fn reliability(figures: &Figures) -> Table {
    let mut table = Table::new();
    table.set_header([
        Cell::new("probability"),
        right("futures"),
        right("mean probability %"),
        right("came nearest %"),
    ]);
    for (index, bin) in figures.bins.iter().enumerate().filter(|(_, bin)| bin.count > 0) {
        let share = |sum: f64| right(format!("{:.1}", 100.0 * sum / bin.count as f64));
        let width = 100 / BINS;
        table.add_row([
            Cell::new(format!("{} to {} %", index * width, (index + 1) * width)),
            right(bin.count),
            share(bin.probability),
            share(bin.came as f64),
        ]);
    }
    table
}

fn csv(runs: &[(String, Figures)]) -> String {
    let mut lines = format!("run,agents,horizon_s,cases,error_m,best_error_m,share_above_{MISS}_m\n");
    for (name, figures) in runs {
        for (kind, errors) in rows(figures) {
            let horizons = HORIZONS.map(|seconds| seconds.to_string());
            let named = std::iter::once("mean".to_owned()).chain(horizons);
            for (horizon, sum) in named.zip(std::iter::once(&errors.average).chain(&errors.at)) {
                let [likely, best, misses] =
                    sum.means().map_or_else(Default::default, |means| means.map(|mean| mean.to_string()));
                let name = quoted(name);
                lines += &format!("{name},{kind},{horizon},{},{likely},{best},{misses}\n", sum.count);
            }
        }
    }
    lines
}
