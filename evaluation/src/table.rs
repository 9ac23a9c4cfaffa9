//! Runs side by side, a line each, as in the paper's Table II. Never two protocols in one table.

use std::ops::Range;

use clap::ValueEnum;
use comfy_table::{Cell, CellAlignment, ContentArrangement, Table, presets};
use episode::latency::Latency;
use episode::metrics::authors;
use results::summary::Summary;

/// How `sim table` prints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum TableFormat {
    /// For the terminal
    #[default]
    Text,
    /// For a page
    Markdown,
    /// For a spreadsheet
    Csv,
}

/// Marks a mean over fewer episodes than its line counts.
pub(crate) const FEWER: &str = "*";

/// How a column's numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Show {
    /// A share of episodes, as percentage with one digit.
    Percent,
    /// A mean, with so many digits.
    Mean(usize),
}

/// A column: its head in lines, its name in CSV, the metric behind it, how it is written.
pub(crate) struct Column(pub(crate) &'static [&'static str], &'static str, pub(crate) &'static str, pub(crate) Show);

/// After the paper's columns come ours.
pub(crate) const COLUMNS: &[Column] = &[
    Column(&["colli-", "sion", "%"], "collision_percent", "collision", Show::Percent),
    Column(&["at", "fault", "%"], "at_fault_collision_percent", "at_fault_collision", Show::Percent),
    Column(&["off", "route", "%"], "off_route_percent", "off_route", Show::Percent),
    Column(&["off", "road", "%"], "off_road_percent", "off_road", Show::Percent),
    Column(&["red", "light", "%"], "red_light_percent", "red_light", Show::Percent),
    Column(&["pro-", "gress", "m"], "progress_m", "progress_m", Show::Mean(1)),
    Column(&["acc.", "", "m/s²"], "mean_abs_acceleration_mps2", "mean_abs_acceleration_mps2", Show::Mean(3)),
    Column(&["jerk", "", "m/s³"], "mean_abs_jerk_mps3", "mean_abs_jerk_mps3", Show::Mean(3)),
    Column(
        &["lat.", "acc.", "m/s²"],
        "mean_abs_lateral_acceleration_mps2",
        "mean_abs_lateral_acceleration_mps2",
        Show::Mean(3),
    ),
    Column(&["error", "@3 s", "m"], "position_error_3s_m", "position_error_3s_m", Show::Mean(2)),
    Column(&["error", "@5 s", "m"], "position_error_5s_m", "position_error_5s_m", Show::Mean(2)),
    Column(&["error", "@10 s", "m"], "position_error_10s_m", "position_error_10s_m", Show::Mean(2)),
    Column(&["nuPlan", "score", ""], "nuplan_score", "nuplan_score", Show::Mean(3)),
];

/// Under a latency these come too.
const LATENCY_COLUMNS: &[Column] = &[
    Column(&["plan", "age", "s"], "mean_plan_age_s", "mean_plan_age_s", Show::Mean(3)),
    Column(&["plans", "late", ""], "plans_late", "plans_late", Show::Mean(1)),
    Column(&["plans", "lost", ""], "plans_lost", "plans_lost", Show::Mean(1)),
];

/// The columns of a protocol's tables, with those of latency or without.
fn columns(protocol: &str, latency: bool) -> impl Iterator<Item = &'static Column> {
    let own = COLUMNS.iter().filter(move |column| protocol != "paper" || authors::is_measured(column.2));
    own.chain(LATENCY_COLUMNS.iter().filter(move |_| latency))
}

/// When plans take effect, in words.
pub(crate) fn latency_name(latency: Option<&Latency>) -> String {
    latency.map_or_else(|| "none".to_owned(), ToString::to_string)
}

/// The tables of `runs`: one for each protocol among them, in the order in which they come. A text that is wider than `width`
/// is folded: its columns stand in blocks, one below the other, each with the drivers before it.
#[must_use]
pub fn render(runs: &[Summary], format: TableFormat, width: usize) -> String {
    let mut protocols: Vec<&str> = Vec::new();
    for run in runs {
        if !protocols.contains(&run.protocol.as_str()) {
            protocols.push(&run.protocol);
        }
    }
    let tables = protocols.iter().map(|protocol| {
        let same: Vec<&Summary> = runs.iter().filter(|run| run.protocol == *protocol).collect();
        match format {
            TableFormat::Text => text(&same, width),
            TableFormat::Markdown => markdown(&same),
            TableFormat::Csv => csv(&same),
        }
    });
    tables.collect::<Vec<_>>().join("\n")
}

/// What the table is of: whatever all its lines share.
pub(crate) fn title(runs: &[&Summary]) -> String {
    let [first, rest @ ..] = runs else { return String::new() };
    let all = |same: fn(&Summary, &Summary) -> bool| rest.iter().all(|run| same(first, run));
    let mut parts = Vec::new();
    if all(|a, b| a.driver == b.driver) {
        parts.push(format!("driver {}", first.driver));
    }
    parts.push(format!("protocol {}", first.protocol));
    if all(|a, b| a.motion == b.motion) {
        parts.push(format!("motion {}", first.motion));
    }
    if let Some(latency) = first.latency.as_ref().filter(|_| all(|a, b| a.latency == b.latency)) {
        parts.push(format!("latency {latency}"));
    }
    if let Some(traffic) = first.traffic.as_ref().filter(|_| all(|a, b| a.traffic == b.traffic)) {
        parts.push(format!("traffic {traffic}"));
    }
    if !all(|a, b| a.changes == b.changes) {
        parts.push("different settings: not to be compared".to_owned());
    }
    parts.extend(first.changes.iter().filter(|_| all(|a, b| a.changes == b.changes)).cloned());
    parts.push(match (all(|a, b| a.scenes == b.scenes), first.scenes.len()) {
        (true, 1) => "1 scene".to_owned(),
        (true, scenes) => format!("{scenes} scenes"),
        (false, _) => "different scenes: not to be compared".to_owned(),
    });
    parts.join(", ")
}

/// What a line is called: the driver, and what tells it from its namesakes.
pub(crate) fn label(run: &Summary, runs: &[&Summary]) -> String {
    let namesakes: Vec<_> = runs.iter().filter(|other| other.driver == run.driver).collect();
    if namesakes.len() == 1 {
        return run.driver.clone();
    }
    if namesakes.iter().filter(|other| other.motion == run.motion).count() == 1 {
        return format!("{} ({})", run.driver, run.motion);
    }
    if namesakes.iter().filter(|other| other.latency == run.latency).count() == 1 {
        let latency = run.latency.as_ref().map_or_else(|| "no latency".to_owned(), ToString::to_string);
        return format!("{} ({latency})", run.driver);
    }
    if namesakes.iter().filter(|other| other.traffic == run.traffic).count() == 1 {
        return format!("{} (traffic {})", run.driver, run.traffic.as_deref().unwrap_or("replayed"));
    }
    run.folder.file_name().map_or_else(|| run.driver.clone(), |name| name.to_string_lossy().into_owned())
}

/// A mean, with [`FEWER`] where some episodes do not define it.
fn value(run: &Summary, column: &Column) -> String {
    let Some((mean, episodes)) = run.mean(column.2) else { return "-".to_owned() };
    let number = match column.3 {
        Show::Percent => format!("{:.1}", 100.0 * mean),
        Show::Mean(digits) => format!("{mean:.digits$}"),
    };
    number + if episodes < run.counted() { FEWER } else { "" }
}

/// A table of these columns; the first block of a folded one also has the counts.
fn body(runs: &[&Summary], columns: &[&Column], counts: bool, head_separator: &str) -> Table {
    let head = |lines: &[&str]| {
        let words: Vec<&str> =
            lines.iter().copied().filter(|line| head_separator == "\n" || !line.is_empty()).collect();
        Cell::new(words.join(head_separator).replace("- ", "")).set_alignment(CellAlignment::Right)
    };
    let number = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
    let mut table = Table::new();
    let heads = [head(&["epi-", "sodes", ""]), head(&["", "failed", ""])].into_iter().filter(|_| counts);
    table.set_header(
        std::iter::once(Cell::new("driver")).chain(heads).chain(columns.iter().map(|column| head(column.0))),
    );
    for run in runs {
        let numbers = [number(run.counted().to_string()), number(run.failures.len().to_string())];
        let values = columns.iter().map(|column| number(value(run, column)));
        let numbers = numbers.into_iter().filter(|_| counts);
        table.add_row(std::iter::once(Cell::new(label(run, runs))).chain(numbers).chain(values));
    }
    table.set_content_arrangement(ContentArrangement::Disabled);
    table
}

/// The figures of runs under one protocol, for whoever lays them out otherwise.
pub(crate) struct Figures {
    /// What they are of.
    pub(crate) title: String,
    /// What each figure is, with its unit.
    pub(crate) heads: Vec<String>,
    /// A run each: what it is called, episodes with a result, failed ones, and its figures.
    pub(crate) rows: Vec<(String, [usize; 2], Vec<String>)>,
    /// What is to be known of single episodes, a line each.
    pub(crate) notes: Vec<String>,
}

/// Those of `runs`, which share a protocol.
pub(crate) fn figures(runs: &[&Summary]) -> Figures {
    let columns = columns_of(runs);
    let row = |run: &&Summary| {
        let values = columns.iter().map(|column| value(run, column)).collect();
        (label(run, runs), [run.counted(), run.failures.len()], values)
    };
    Figures {
        title: title(runs),
        heads: columns.iter().map(|column| words(column.0)).collect(),
        rows: runs.iter().map(row).collect(),
        notes: notes(runs, "").lines().filter(|line| !line.is_empty()).map(str::to_owned).collect(),
    }
}

/// What of a protocol's figures are means: name and unit, the metric behind it, and digits.
pub(crate) fn measures(protocol: &str) -> impl Iterator<Item = (String, &'static str, &'static str, usize)> {
    columns(protocol, false).filter_map(|column| match (column.3, column.0) {
        (Show::Mean(digits), [head @ .., unit]) => Some((words(head), *unit, column.2, digits)),
        _ => None,
    })
}

/// A head's lines as one.
fn words(lines: &[&str]) -> String {
    let words: Vec<&str> = lines.iter().copied().filter(|line| !line.is_empty()).collect();
    words.join(" ").replace("- ", "")
}

/// The columns of the table that `runs` share.
fn columns_of(runs: &[&Summary]) -> Vec<&'static Column> {
    let latency = runs.iter().any(|run| run.latency.is_some());
    runs.first().map(|run| columns(&run.protocol, latency).collect()).unwrap_or_default()
}

fn text(runs: &[&Summary], width: usize) -> String {
    let all = columns_of(runs);
    let body = |range: Range<usize>| body(runs, &all[range.clone()], range.start == 0, "\n");
    format!("{}\n\n{}\n{}", title(runs), folded(all.len(), width, body), notes(runs, ""))
}

/// Blocks of the columns, one below the other, none of them wider than `width` if one column is not.
pub(crate) fn folded(columns: usize, width: usize, body: impl Fn(Range<usize>) -> Table) -> String {
    let (mut blocks, mut begin) = (Vec::new(), 0);
    while begin < columns || blocks.is_empty() {
        let lines = |end: usize| plain(body(begin..end));
        let fits = |end: &usize| lines(*end).iter().all(|line| line.chars().count() <= width);
        // At least one column, however narrow the terminal.
        let least = (begin + 1).min(columns);
        let end = (least..=columns).rev().find(fits).unwrap_or(least);
        blocks.push(lines(end).join("\n"));
        begin = end;
    }
    blocks.join("\n\n")
}

/// A table's lines for the terminal.
pub(crate) fn plain(mut table: Table) -> Vec<String> {
    table.load_preset(presets::NOTHING);
    table.set_style(comfy_table::TableComponent::HeaderLines, '─');
    for column in table.column_iter_mut() {
        column.set_padding((0, 1));
    }
    table.lines().map(|line| line.trim_end().to_owned()).collect()
}

fn markdown(runs: &[&Summary]) -> String {
    let mut table = body(runs, &columns_of(runs), true, " ");
    table.load_preset(presets::ASCII_MARKDOWN);
    format!("**{}**\n\n{table}\n{}", title(runs), notes(runs, "- "))
}

/// What is wrong with single episodes, a line each.
fn notes(runs: &[&Summary], bullet: &str) -> String {
    let mut lines = String::new();
    let mut values =
        runs.iter().flat_map(|run| columns(&run.protocol, run.latency.is_some()).map(|column| value(run, column)));
    if values.any(|value| value.ends_with(FEWER)) {
        lines += &format!("{bullet}{FEWER} over those of the episodes that have a value\n");
    }
    // Runs over the same scenes have the same oddities, which are told once.
    let alike = runs.windows(2).all(|pair| pair[0].oddities() == pair[1].oddities());
    for run in runs.iter().take(if alike { 1 } else { runs.len() }) {
        let of = if alike { String::new() } else { format!("{}: ", label(run, runs)) };
        if let Some(oddities) = run.oddities() {
            lines += &format!("{bullet}{of}{oddities} (see --scenes)\n");
        }
    }
    for run in runs {
        let of = if runs.len() > 1 { format!("{}: ", label(run, runs)) } else { String::new() };
        for failure in &run.failures {
            let detail = if failure.detail.is_empty() { &failure.reason } else { &failure.detail };
            lines += &format!("{bullet}{of}{} failed ({}): {detail}\n", failure.scene, failure.reason);
        }
        for (scene, error) in &run.broken_recordings {
            lines += &format!("{bullet}{of}{scene} is not recorded whole: {error}\n");
        }
    }
    if lines.is_empty() { lines } else { format!("\n{lines}") }
}

fn csv(runs: &[&Summary]) -> String {
    let mut lines = String::from("run,driver,protocol,motion,settings,episodes,failed");
    let columns = columns_of(runs);
    columns.iter().for_each(|column| lines += &format!(",{}", column.1));
    lines.push('\n');
    for run in runs {
        let folder = quoted(&run.folder.to_string_lossy());
        let settings = quoted(&run.settings().join("; "));
        lines += &format!("{folder},{},{},{},{settings}", run.driver, run.protocol, run.motion);
        lines += &format!(",{},{}", run.counted(), run.failures.len());
        for column in &columns {
            let scale = if matches!(column.3, Show::Percent) { 100.0 } else { 1.0 };
            lines += &run.mean(column.2).map_or_else(|| ",".to_owned(), |(mean, _)| format!(",{}", scale * mean));
        }
        lines.push('\n');
    }
    lines
}

/// A CSV field (RFC 4180).
pub(crate) fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::path::PathBuf;

    use super::*;
    use results::summary::Failure;

    /// Nothing is folded.
    const WIDE: usize = 200;

    pub(crate) fn run(driver: &str, motion: &str, folder: &str) -> Summary {
        let means = COLUMNS.iter().enumerate().map(|(index, column)| {
            let value = match column.3 {
                Show::Percent => 0.125,
                Show::Mean(_) => 100.0 / (index + 1) as f64,
            };
            (column.2.to_owned(), Some((value, 8)))
        });
        Summary {
            folder: PathBuf::from(folder),
            driver: driver.to_owned(),
            protocol: "strict".to_owned(),
            changes: Vec::new(),
            latency: None,
            traffic: None,
            motion: motion.to_owned(),
            scenes: (0..8).map(|scene| (format!("s{scene}"), String::new())).collect(),
            failures: Vec::new(),
            warned: 0,
            unjudged: 0,
            broken_recordings: Vec::new(),
            means: means.collect(),
        }
    }

    fn failing() -> Summary {
        let mut run = run("idm", "bicycle", "runs/idm-strict-1");
        run.failures.push(Failure {
            scene: "s3".to_owned(),
            reason: "driver-failed".to_owned(),
            detail: "the planner did not answer step 12 within 5 s".to_owned(),
        });
        run.broken_recordings.push(("s4".to_owned(), "the recorder is gone".to_owned()));
        (run.warned, run.unjudged) = (2, 1);
        run.means.insert("position_error_10s_m".to_owned(), None);
        run.means.insert("position_error_5s_m".to_owned(), Some((1.5, 6)));
        run
    }

    #[test]
    fn one_run_is_a_titled_table_with_its_failures_below() {
        insta::assert_snapshot!(render(&[failing()], TableFormat::Text, WIDE), @"
        driver idm, protocol strict, motion bicycle, 8 scenes

        driver  epi-        colli-    at   off  off   red  pro-   acc.   jerk   lat. error error error nuPlan
               sodes failed   sion fault route road light gress                 acc.  @3 s  @5 s @10 s  score
                                 %     %     %    %     %     m   m/s²   m/s³   m/s²     m     m     m
        ──────────────────────────────────────────────────────────────────────────────────────────────────────
        idm        7      1   12.5  12.5  12.5 12.5  12.5  16.7 14.286 12.500 11.111 10.00 1.50*     -  7.692

        * over those of the episodes that have a value
        2 of 8 scenes have warnings, 1 cannot be judged in full (see --scenes)
        s3 failed (driver-failed): the planner did not answer step 12 within 5 s
        s4 is not recorded whole: the recorder is gone
        ");
    }

    #[test]
    fn a_table_that_is_too_wide_is_folded() {
        let runs = [run("constant-velocity", "bicycle", "runs/x"), failing()];
        let folded = render(&runs, TableFormat::Text, 80);
        insta::assert_snapshot!(folded, @"
        protocol strict, motion bicycle, 8 scenes

        driver             epi-        colli-    at   off  off   red  pro-   acc.
                          sodes failed   sion fault route road light gress
                                            %     %     %    %     %     m   m/s²
        ──────────────────────────────────────────────────────────────────────────
        constant-velocity     8      0   12.5  12.5  12.5 12.5  12.5  16.7 14.286
        idm                   7      1   12.5  12.5  12.5 12.5  12.5  16.7 14.286

        driver              jerk   lat. error error error nuPlan
                                   acc.  @3 s  @5 s @10 s  score
                            m/s³   m/s²     m     m     m
        ─────────────────────────────────────────────────────────
        constant-velocity 12.500 11.111 10.00  9.09  8.33  7.692
        idm               12.500 11.111 10.00 1.50*     -  7.692

        * over those of the episodes that have a value
        idm: 2 of 8 scenes have warnings, 1 cannot be judged in full (see --scenes)
        idm: s3 failed (driver-failed): the planner did not answer step 12 within 5 s
        idm: s4 is not recorded whole: the recorder is gone
        ");
        assert!(folded.lines().take_while(|line| !line.starts_with('*')).all(|line| line.chars().count() <= 80));
        let narrowest = render(&runs, TableFormat::Text, 1);
        assert_eq!(narrowest.matches("constant-velocity").count(), COLUMNS.len());
    }

    #[test]
    fn runs_stand_side_by_side_and_namesakes_are_told_apart() {
        let runs = [
            run("human", "bicycle", "runs/human-strict-1"),
            run("human", "playback", "runs/human-strict-2"),
            run("constant-velocity", "bicycle", "runs/x"),
        ];
        insta::assert_snapshot!(render(&runs, TableFormat::Text, WIDE), @"
        protocol strict, 8 scenes

        driver             epi-        colli-    at   off  off   red  pro-   acc.   jerk   lat. error error error nuPlan
                          sodes failed   sion fault route road light gress                 acc.  @3 s  @5 s @10 s  score
                                            %     %     %    %     %     m   m/s²   m/s³   m/s²     m     m     m
        ─────────────────────────────────────────────────────────────────────────────────────────────────────────────────
        human (bicycle)       8      0   12.5  12.5  12.5 12.5  12.5  16.7 14.286 12.500 11.111 10.00  9.09  8.33  7.692
        human (playback)      8      0   12.5  12.5  12.5 12.5  12.5  16.7 14.286 12.500 11.111 10.00  9.09  8.33  7.692
        constant-velocity     8      0   12.5  12.5  12.5 12.5  12.5  16.7 14.286 12.500 11.111 10.00  9.09  8.33  7.692
        ");
        insta::assert_snapshot!(render(&runs, TableFormat::Markdown, WIDE), @"
        **protocol strict, 8 scenes**

        | driver            | episodes | failed | collision % | at fault % | off route % | off road % | red light % | progress m | acc. m/s² | jerk m/s³ | lat. acc. m/s² | error @3 s m | error @5 s m | error @10 s m | nuPlan score |
        |-------------------|----------|--------|-------------|------------|-------------|------------|-------------|------------|-----------|-----------|----------------|--------------|--------------|---------------|--------------|
        | human (bicycle)   |        8 |      0 |        12.5 |       12.5 |        12.5 |       12.5 |        12.5 |       16.7 |    14.286 |    12.500 |         11.111 |        10.00 |         9.09 |          8.33 |        7.692 |
        | human (playback)  |        8 |      0 |        12.5 |       12.5 |        12.5 |       12.5 |        12.5 |       16.7 |    14.286 |    12.500 |         11.111 |        10.00 |         9.09 |          8.33 |        7.692 |
        | constant-velocity |        8 |      0 |        12.5 |       12.5 |        12.5 |       12.5 |        12.5 |       16.7 |    14.286 |    12.500 |         11.111 |        10.00 |         9.09 |          8.33 |        7.692 |
        ");
    }

    #[test]
    fn settings_that_are_not_as_usual_are_named_and_never_mixed_in_silence() {
        let mut short = run("idm", "bicycle", "runs/short");
        short.changes = vec!["horizon = 80".to_owned()];
        let title = |runs: &[Summary]| render(runs, TableFormat::Text, WIDE).lines().next().unwrap().to_owned();
        assert_eq!(title(&[short.clone()]), "driver idm, protocol strict, motion bicycle, horizon = 80, 8 scenes");
        let usual = run("human", "bicycle", "runs/usual");
        let expected = "protocol strict, motion bicycle, different settings: not to be compared, 8 scenes";
        assert_eq!(title(&[usual, short.clone()]), expected);
        assert!(render(&[short], TableFormat::Csv, WIDE).contains(",bicycle,horizon = 80,8,0,"));
    }

    #[test]
    fn csv_has_full_precision_and_leaves_out_what_is_not_defined() {
        insta::assert_snapshot!(render(&[failing()], TableFormat::Csv, WIDE), @"
        run,driver,protocol,motion,settings,episodes,failed,collision_percent,at_fault_collision_percent,off_route_percent,off_road_percent,red_light_percent,progress_m,mean_abs_acceleration_mps2,mean_abs_jerk_mps3,mean_abs_lateral_acceleration_mps2,position_error_3s_m,position_error_5s_m,position_error_10s_m,nuplan_score
        runs/idm-strict-1,idm,strict,bicycle,,7,1,12.5,12.5,12.5,12.5,12.5,16.666666666666668,14.285714285714286,12.5,11.11111111111111,10,1.5,,7.6923076923076925
        ");
    }

    #[test]
    fn every_column_is_a_metric() {
        for column in COLUMNS {
            assert!(episode::metrics::METRICS.iter().any(|metric| metric.name == column.2), "{}", column.2);
        }
    }

    #[test]
    fn no_table_is_wider_than_120_columns() {
        let mut wide = run("constant-velocity", "bicycle", "runs/x");
        for column in COLUMNS {
            let mean = match column.3 {
                Show::Percent => (1.0, 8),
                // Drives that end early have no position error.
                Show::Mean(_) if column.2.starts_with("position") => (188.88, 7),
                Show::Mean(_) => (if column.2.ends_with("_m") { 188.88 } else { 1.0 }, 8),
            };
            wide.means.insert(column.2.to_owned(), Some(mean));
        }
        for line in render(&[wide], TableFormat::Text, WIDE).lines() {
            assert!(line.chars().count() <= 120, "{}: {line}", line.chars().count());
        }
    }

    #[test]
    fn under_paper_there_are_the_papers_columns_alone() {
        let mut paper = run("idm", "first-pose", "runs/p");
        paper.protocol = "paper".to_owned();
        insta::assert_snapshot!(render(&[paper], TableFormat::Text, WIDE), @"
        driver idm, protocol paper, motion first-pose, 8 scenes

        driver  epi-        colli-   off  pro-   acc.   jerk   lat. error error error
               sodes failed   sion route gress                 acc.  @3 s  @5 s @10 s
                                 %     %     m   m/s²   m/s³   m/s²     m     m     m
        ──────────────────────────────────────────────────────────────────────────────
        idm        8      0   12.5  12.5  16.7 14.286 12.500 11.111 10.00  9.09  8.33
        ");
    }

    #[test]
    fn protocols_are_never_in_one_table() {
        let mut paper = run("idm", "first-pose", "runs/p");
        paper.protocol = "paper".to_owned();
        let tables = render(
            &[run("idm", "bicycle", "runs/s"), paper, run("human", "playback", "runs/h")],
            TableFormat::Text,
            WIDE,
        );
        let titles: Vec<&str> = tables.lines().filter(|line| line.contains("protocol ")).collect();
        assert_eq!(titles, ["protocol strict, 8 scenes", "driver idm, protocol paper, motion first-pose, 8 scenes"]);
    }
}
