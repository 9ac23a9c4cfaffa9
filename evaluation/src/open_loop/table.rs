//! A line a driver, and one of the human, over all frames.

use clap::ValueEnum;
use comfy_table::{Cell, CellAlignment, ContentArrangement, Table, presets};
use serde_json::{Map, Value, json};

use super::Definitions;
use super::row::{COLUMNS, Row};
use crate::table::{folded, quoted};

/// How `sim evaluate` prints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For the terminal
    #[default]
    Text,
    /// For a page
    Markdown,
    /// For a spreadsheet
    Csv,
    /// For a program
    Json,
}

/// What is called the human.
const HUMAN: &str = "human (log)";

/// How many failures of a driver are told one by one.
const TOLD: usize = 5;

/// A driver's frames.
#[derive(Clone, Copy, Debug)]
pub struct Driven<'a> {
    /// What the table calls the driver.
    pub driver: &'a str,
    /// All frames, failed ones too.
    pub rows: &'a [Row],
}

#[derive(Clone, Copy)]
enum Show {
    Percent,
    Mean(usize),
}

/// Over what a mean is taken.
#[derive(Clone, Copy, PartialEq)]
enum Over {
    Frames,
    /// Under `strict`: over agents, each frame's mean weighing as many as it is over.
    Agents,
    LastAgents,
}

struct Head {
    lines: [&'static str; 3],
    name: &'static str,
    show: Show,
    over: Over,
    /// Whether only `strict` has it.
    strict: bool,
}

const fn head(lines: [&'static str; 3], name: &'static str, show: Show) -> Head {
    Head { lines, name, show, over: Over::Frames, strict: false }
}

/// After the paper's order; what only `strict` judges stands beside its like.
const HEADS: &[Head] = &[
    head(["colli-", "sion", "%"], "collision", Show::Percent),
    Head { strict: true, ..head(["at", "fault", "%"], "at_fault_collision", Show::Percent) },
    head(["red", "light", "%"], "red_light", Show::Percent),
    head(["off", "route", "%"], "off_route", Show::Percent),
    Head { strict: true, ..head(["off", "road", "%"], "off_road", Show::Percent) },
    head(["acc.", "", "m/s²"], "mean_abs_acceleration_mps2", Show::Mean(3)),
    head(["jerk", "", "m/s³"], "mean_abs_jerk_mps3", Show::Mean(3)),
    head(["lat.", "acc.", "m/s²"], "mean_abs_lateral_acceleration_mps2", Show::Mean(3)),
    head(["error", "@1 s", "m"], "position_error_1s_m", Show::Mean(3)),
    head(["error", "@3 s", "m"], "position_error_3s_m", Show::Mean(3)),
    head(["error", "@5 s", "m"], "position_error_5s_m", Show::Mean(3)),
    Head { over: Over::Agents, ..head(["pred.", "ADE", "m"], "prediction_ade_m", Show::Mean(3)) },
    Head { over: Over::LastAgents, ..head(["pred.", "FDE", "m"], "prediction_fde_m", Show::Mean(3)) },
    Head { over: Over::Agents, strict: true, ..head(["min", "ADE", "m"], "prediction_min_ade_m", Show::Mean(3)) },
    Head { over: Over::LastAgents, strict: true, ..head(["min", "FDE", "m"], "prediction_min_fde_m", Show::Mean(3)) },
];

fn heads(definitions: Definitions) -> impl Iterator<Item = &'static Head> {
    HEADS.iter().filter(move |head| !head.strict || definitions == Definitions::Strict)
}

/// A line of the table: what it is called, and a mean a head with the number of frames behind it.
struct Line<'a> {
    name: &'a str,
    frames: usize,
    failed: usize,
    means: Vec<Option<(f64, usize)>>,
}

fn value_of(name: &str) -> Option<fn(&Row) -> Option<f64>> {
    COLUMNS.iter().find(|column| column.name == name).map(|column| column.value)
}

fn lines<'a>(drivers: &[Driven<'a>], definitions: Definitions) -> Vec<Line<'a>> {
    let mean = |rows: &[&Row], name: &str, over: Over| {
        let value = value_of(name)?;
        let (mut sum, mut weights, mut count) = (0.0, 0.0, 0);
        for row in rows {
            let Some(value) = value(row).filter(|value| !value.is_nan()) else { continue };
            let weight = match (over, definitions) {
                (Over::Agents, Definitions::Strict) => f64::from(row.prediction.map_or(0, |p| p.agents)),
                (Over::LastAgents, Definitions::Strict) => f64::from(row.prediction.map_or(0, |p| p.last_agents)),
                _ => 1.0,
            };
            sum += weight * value;
            weights += weight;
            count += 1;
        }
        (weights > 0.0).then(|| (sum / weights, count))
    };
    let mut lines = Vec::new();
    for driven in drivers {
        let good: Vec<&Row> = driven.rows.iter().filter(|row| !row.failed()).collect();
        let means = heads(definitions).map(|head| mean(&good, head.name, head.over)).collect();
        let failed = driven.rows.len() - good.len();
        lines.push(Line { name: driven.driver, frames: good.len(), failed, means });
    }
    if let Some(first) = drivers.first() {
        // The same frames for all, and the human's figures depend on no plan.
        let rows: Vec<&Row> = first.rows.iter().collect();
        let means = heads(definitions).map(|head| mean(&rows, &format!("human_{}", head.name), Over::Frames)).collect();
        lines.push(Line { name: HUMAN, frames: rows.len(), failed: 0, means });
    }
    lines
}

/// The table of these drivers over the same frames of `scenes` scenes. A text wider than `width` is folded into blocks.
#[must_use]
pub fn render(drivers: &[Driven<'_>], definitions: Definitions, scenes: usize, format: Format, width: usize) -> String {
    let lines = lines(drivers, definitions);
    let heads: Vec<&Head> = heads(definitions).collect();
    let frames = drivers.first().map_or(0, |driven| driven.rows.len());
    let plural = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    let name = definitions.name();
    let title = format!("open loop, definitions {name}, {} of {}", plural(frames, "frame"), plural(scenes, "scene"));
    match format {
        Format::Text => {
            let blocks = folded(heads.len(), width, |range| body(&lines, &heads, range, "\n"));
            format!("{title}\n\n{blocks}\n{}", notes(drivers, &lines, ""))
        }
        Format::Markdown => {
            let mut table = body(&lines, &heads, 0..heads.len(), " ");
            table.load_preset(presets::ASCII_MARKDOWN);
            format!("**{title}**\n\n{table}\n{}", notes(drivers, &lines, "- "))
        }
        Format::Csv => csv(&lines, &heads, definitions),
        Format::Json => json(drivers, &lines, &heads, definitions, scenes),
    }
}

/// Marks a mean over fewer frames than its line counts.
const FEWER: &str = "*";

fn body(lines: &[Line<'_>], heads: &[&Head], range: std::ops::Range<usize>, separator: &str) -> Table {
    let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
    let words = |lines: &[&str; 3]| {
        let words: Vec<&str> = lines.iter().copied().filter(|line| separator == "\n" || !line.is_empty()).collect();
        right(words.join(separator).replace("- ", ""))
    };
    let counts = range.start == 0;
    let mut table = Table::new();
    let mut header = vec![Cell::new("driver")];
    if counts {
        header.extend([words(&["", "frames", ""]), words(&["", "failed", ""])]);
    }
    header.extend(heads[range.clone()].iter().map(|head| words(&head.lines)));
    table.set_header(header);
    for line in lines {
        let mut cells = vec![Cell::new(line.name)];
        if counts {
            cells.extend([right(line.frames.to_string()), right(line.failed.to_string())]);
        }
        for at in range.clone() {
            let Some((mean, count)) = line.means[at] else {
                cells.push(right("-".to_owned()));
                continue;
            };
            let number = match heads[at].show {
                Show::Percent => format!("{:.1}", 100.0 * mean),
                Show::Mean(digits) => format!("{mean:.digits$}"),
            };
            cells.push(right(number + if count < line.frames { FEWER } else { "" }));
        }
        table.add_row(cells);
    }
    table.set_content_arrangement(ContentArrangement::Disabled);
    table
}

fn notes(drivers: &[Driven<'_>], lines: &[Line<'_>], bullet: &str) -> String {
    let mut notes = String::new();
    let fewer = |line: &Line<'_>| line.means.iter().flatten().any(|(_, count)| *count < line.frames);
    if lines.iter().any(fewer) {
        notes += &format!("{bullet}{FEWER} over those of the frames that have a value\n");
    }
    for driven in drivers {
        let failed: Vec<&Row> = driven.rows.iter().filter(|row| row.failed()).collect();
        for row in failed.iter().take(TOLD) {
            notes +=
                &format!("{bullet}{}: {} at {} has no plan: {}\n", driven.driver, row.scene, row.frame, row.failure);
        }
        if failed.len() > TOLD {
            notes += &format!("{bullet}{}: {} more frames have no plan\n", driven.driver, failed.len() - TOLD);
        }
    }
    if notes.is_empty() { notes } else { format!("\n{notes}") }
}

/// The name of a mean in CSV and JSON, and what it is multiplied with.
fn exported(head: &Head) -> (String, f64) {
    match head.show {
        Show::Percent => (format!("{}_percent", head.name), 100.0),
        Show::Mean(_) => (head.name.to_owned(), 1.0),
    }
}

fn csv(lines: &[Line<'_>], heads: &[&Head], definitions: Definitions) -> String {
    let mut text = String::from("driver,definitions,frames,failed");
    heads.iter().for_each(|head| text += &format!(",{}", exported(head).0));
    text.push('\n');
    for line in lines {
        text += &format!("{},{},{},{}", quoted(line.name), definitions.name(), line.frames, line.failed);
        for (head, mean) in heads.iter().zip(&line.means) {
            text += &mean.map_or_else(|| ",".to_owned(), |(mean, _)| format!(",{}", exported(head).1 * mean));
        }
        text.push('\n');
    }
    text
}

fn json(
    drivers: &[Driven<'_>],
    lines: &[Line<'_>],
    heads: &[&Head],
    definitions: Definitions,
    scenes: usize,
) -> String {
    let line = |line: &Line<'_>| {
        let mut object = Map::new();
        object.insert("driver".to_owned(), json!(line.name));
        object.insert("frames".to_owned(), json!(line.frames));
        object.insert("failed".to_owned(), json!(line.failed));
        for (head, mean) in heads.iter().zip(&line.means) {
            let (name, scale) = exported(head);
            object.insert(name, mean.map_or(Value::Null, |(mean, _)| json!(scale * mean)));
        }
        Value::Object(object)
    };
    let failure = |driver: &str, row: &Row| json!({ "driver": driver, "scene": row.scene, "frame": row.frame, "reason": row.failure });
    let failed = drivers.iter().flat_map(|driven| {
        let failed = driven.rows.iter().filter(|row| row.failed());
        failed.map(|row| failure(driven.driver, row))
    });
    let whole = json!({
        "definitions": definitions.name(),
        "scenes": scenes,
        "lines": lines.iter().map(line).collect::<Vec<_>>(),
        "failures": failed.collect::<Vec<_>>(),
    });
    format!("{whole:#}\n")
}

#[cfg(test)]
mod tests {
    use super::super::row::{Figures, PredictionFigures};
    use super::*;

    fn row(frame: u32, error: f64, agents: u32) -> Row {
        Row {
            plan: Figures { collision: Some(frame == 20), ..Figures::default() },
            human: Figures { collision: Some(false), ..Figures::default() },
            position_errors: [Some(error); 3],
            prediction: Some(PredictionFigures {
                agents,
                average: error,
                last_agents: agents,
                last: Some(error),
                best_average: Some(0.5 * error),
                best_last: Some(0.5 * error),
            }),
            ..Row::of("s", frame)
        }
    }

    fn rows() -> Vec<Row> {
        let failed = Row { failure: "the planner did not answer".to_owned(), ..Row::of("s", 40) };
        vec![row(20, 1.0, 3), row(30, 3.0, 1), failed]
    }

    #[test]
    fn each_driver_has_a_line_and_the_human_the_last() {
        let rows = rows();
        let drivers = [Driven { driver: "dipp", rows: &rows }];
        insta::assert_snapshot!(render(&drivers, Definitions::Strict, 1, Format::Text, 160), @"
        open loop, definitions strict, 3 frames of 1 scene

        driver                    colli-    at   red   off  off acc. jerk lat. error error error pred. pred.   min   min
                    frames failed   sion fault light route road           acc.  @1 s  @3 s  @5 s   ADE   FDE   ADE   FDE
                                       %     %     %     %    % m/s² m/s³ m/s²     m     m     m     m     m     m     m
        ─────────────────────────────────────────────────────────────────────────────────────────────────────────────────
        dipp             2      1   50.0     -     -     -    -    -    -    - 2.000 2.000 2.000 1.500 1.500 0.750 0.750
        human (log)      3      0   0.0*     -     -     -    -    -    -    -     -     -     -     -     -     -     -

        * over those of the frames that have a value
        dipp: s at 40 has no plan: the planner did not answer
        ");
        insta::assert_snapshot!(render(&drivers, Definitions::Authors, 1, Format::Csv, 0), @"
        driver,definitions,frames,failed,collision_percent,red_light_percent,off_route_percent,mean_abs_acceleration_mps2,mean_abs_jerk_mps3,mean_abs_lateral_acceleration_mps2,position_error_1s_m,position_error_3s_m,position_error_5s_m,prediction_ade_m,prediction_fde_m
        dipp,authors,2,1,50,,,,,,2,2,2,2,2
        human (log),authors,3,0,0,,,,,,,,,,
        ");
        let json: Value = serde_json::from_str(&render(&drivers, Definitions::Strict, 1, Format::Json, 0)).unwrap();
        assert_eq!(json["lines"][0]["prediction_ade_m"], 1.5);
        assert_eq!(json["failures"][0]["frame"], 40);
        assert!(render(&drivers, Definitions::Strict, 1, Format::Markdown, 0).contains("| dipp"));
    }

    #[test]
    fn agents_weigh_alike_under_strict_and_frames_under_the_authors_definitions() {
        let rows = rows();
        let ade = |definitions| {
            let at = heads(definitions).position(|head| head.name == "prediction_ade_m").unwrap();
            lines(&[Driven { driver: "x", rows: &rows }], definitions)[0].means[at].unwrap().0
        };
        assert_eq!((ade(Definitions::Strict), ade(Definitions::Authors)), (1.5, 2.0));
    }

    #[test]
    fn a_narrow_terminal_gets_blocks() {
        let rows = rows();
        let text = render(&[Driven { driver: "dipp", rows: &rows }], Definitions::Strict, 1, Format::Text, 70);
        assert!(text.lines().take_while(|line| !line.starts_with('*')).all(|line| line.chars().count() <= 70));
        assert!(text.matches("\ndriver").count() >= 2, "{text}");
    }
}
