//! `scenarios stats`: figures of a set as a whole.

use std::io::{self, Write};
use std::path::Path;

use arrow_array::ArrayRef;
use comfy_table::{Table, presets};
use scenarios::stats::{self, COLUMNS, Figures, PERCENTS, Section, ShareRow, SpreadRow, Summary};

use super::Failure;
use super::parquet::{counts, numbers, text, write};
use super::scenes::Scenes;
use super::table::{count, table};
use crate::cli::StatsArguments;

const SPREADS: [&str; 8] = ["quantity", ">p5", ">p25", ">p50", ">p75", ">p95", ">mean", ">n"];
const SHARES: [&str; 3] = ["share of", ">%", ">n"];

pub fn run(arguments: &StatsArguments, out: &mut impl Write) -> Result<bool, Failure> {
    let scenes = Scenes::open(&arguments.inputs)?;
    let places: Vec<usize> = scenes.iter().map(|(index, _)| index).collect();
    // Asked for 0 to the number of places alone.
    let load = |nth: usize| scenes.set.load(places[nth]).map(|(scene, _)| scene);
    let (samples, rows) = stats::measure(places.len(), load)?;
    let figures = Figures::of(&samples);
    if let Some(path) = &arguments.parquet {
        write_figures(path, &figures)?;
    }
    if let Some(path) = &arguments.per_scene {
        write_rows(path, &rows)?;
    }
    print(&figures, scenes.len(), arguments.markdown, out).map_err(Failure::Output)?;
    Ok(false)
}

fn print(figures: &Figures, scenes: usize, markdown: bool, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{}", count(scenes, "scene"))?;
    for section in Section::ALL {
        writeln!(out, "\n{}{section}\n", if markdown { "## " } else { "" })?;
        let mut spreads = table(&SPREADS);
        spreads.add_rows(figures.spreads.iter().filter(|row| row.quantity.section() == section).map(spread));
        let mut shares = table(&SHARES);
        shares.add_rows(figures.shares.iter().filter(|row| row.share.section() == section).map(share));
        for (nth, table) in [spreads, shares].into_iter().filter(|table| table.row_count() > 0).enumerate() {
            if nth > 0 {
                writeln!(out)?;
            }
            writeln!(out, "{}", text_of(table, markdown))?;
        }
    }
    Ok(())
}

fn text_of(mut table: Table, markdown: bool) -> String {
    if markdown {
        table.load_preset(presets::ASCII_MARKDOWN);
        table.column_iter_mut().for_each(|column| {
            column.set_padding((1, 1));
        });
    }
    table.trim_fmt()
}

fn spread(row: &SpreadRow) -> Vec<String> {
    let quantity = row.quantity;
    let shown = |value: Option<f64>, decimals: usize| value.map_or("-".to_owned(), |v| format!("{v:.decimals$}"));
    let name = [quantity.words(), quantity.unit()].join(" ").trim_end().to_owned();
    let percentiles = (0..PERCENTS.len()).map(|at| shown(row.percentiles.map(|p| p[at]), quantity.decimals()));
    let end = [shown(row.mean, quantity.decimals().max(1)), row.n.to_string()];
    std::iter::once(name).chain(percentiles).chain(end).collect()
}

fn share(row: &ShareRow) -> Vec<String> {
    let percent = row.part.map_or("-".to_owned(), |part| format!("{:.1}", 100.0 * part));
    vec![row.share.words().to_owned(), percent, row.n.to_string()]
}

/// A row a figure; percentiles are null for shares, whose part is the mean.
fn write_figures(path: &Path, figures: &Figures) -> Result<(), Failure> {
    let (spreads, shares) = (&figures.spreads, &figures.shares);
    let texts = |of_spread: fn(&SpreadRow) -> String, of_share: fn(&ShareRow) -> String| {
        text(spreads.iter().map(of_spread).chain(shares.iter().map(of_share)))
    };
    let mut columns: Vec<(&str, ArrayRef)> = vec![
        ("section", texts(|row| row.quantity.section().to_string(), |row| row.share.section().to_string())),
        ("quantity", texts(|row| row.quantity.words().to_owned(), |row| row.share.words().to_owned())),
        ("unit", texts(|row| row.quantity.unit().to_owned(), |_| "share".to_owned())),
    ];
    for (at, name) in ["p5", "p25", "p50", "p75", "p95"].into_iter().enumerate() {
        let percentiles = spreads.iter().map(|row| row.percentiles.map(|p| p[at]));
        columns.push((name, numbers(percentiles.chain(shares.iter().map(|_| None)))));
    }
    columns.push(("mean", numbers(spreads.iter().map(|row| row.mean).chain(shares.iter().map(|row| row.part)))));
    columns.push(("n", counts(spreads.iter().map(|row| row.n as u64).chain(shares.iter().map(|row| row.n)))));
    write(path, columns)
}

fn write_rows(path: &Path, rows: &[Summary]) -> Result<(), Failure> {
    let mut columns = vec![("scene", text(rows.iter().map(|row| row.scene.to_string())))];
    for (at, column) in COLUMNS.iter().enumerate() {
        columns.push((column.name, numbers(rows.iter().map(|row| row.values[at]))));
    }
    write(path, columns)
}
