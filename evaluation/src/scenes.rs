//! A run scene by scene, the worst first: how each episode ended, and what happened with whom.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::Path;

use comfy_table::{Cell, CellAlignment, ColumnConstraint, ContentArrangement, Table as Grid, presets};
use results::parquet::{ByScene, ParquetError, Table};
use results::summary::Summary;

use crate::table::{TableFormat, label, quoted, title};

/// Events of a scene that are told beside its end.
const EVENTS: usize = 3;

/// How the sentence on an event ends that does not count, because the log's own AV breaks the same rule.
pub(crate) const NOT_COUNTED: &str = "not counted)";

/// How a run came out, scene by scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenes {
    rows: Vec<Row>,
}

/// An episode.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    pub(crate) scene: String,
    /// nuPlan's; none where the protocol or the episode has none.
    pub(crate) score: Option<f64>,
    failed: bool,
    pub(crate) end: String,
    what: String,
    /// What is odd about the scene: codes of `scenarios lint`.
    findings: String,
    /// What cannot be judged in it.
    unjudged: String,
}

impl Row {
    /// What happened, and what is to be known of the scene, in one text.
    pub(crate) fn story(&self) -> String {
        let notes = [("scene", &self.findings), ("not judged", &self.unjudged)];
        let notes = notes.iter().filter(|(_, text)| !text.is_empty()).map(|(name, text)| format!("[{name}: {text}]"));
        let what = Some(self.what.clone()).filter(|what| !what.is_empty());
        what.into_iter().chain(notes).collect::<Vec<_>>().join(" ")
    }
}

/// How bad an end is; the worst is the least.
fn gravity(end: &str) -> usize {
    const ENDS: [&str; 5] = ["driver-failed", "undrivable", "collision", "off-route", "route-lost"];
    ENDS.iter().position(|bad| *bad == end).unwrap_or(ENDS.len())
}

impl Row {
    /// Failed ones first, then by score, then by end; scenes of a kind stay in the run's order.
    pub(crate) fn compare(&self, other: &Self) -> Ordering {
        let score = |row: &Self| row.score.unwrap_or(f64::INFINITY);
        let failed = other.failed.cmp(&self.failed);
        failed.then(score(self).total_cmp(&score(other))).then(gravity(&self.end).cmp(&gravity(&other.end)))
    }
}

impl Scenes {
    /// The scenes of the finished run in `folder`; the `worst` of them, if only so many are wanted.
    ///
    /// # Errors
    /// [`ParquetError`] where its files cannot be read.
    pub fn read(folder: &Path, worst: Option<usize>) -> Result<Self, ParquetError> {
        let results = Table::read(&folder.join("results.parquet"))?;
        let mut events = events(&folder.join("steps.parquet"))?;
        let scores = results.numbers()?.remove("nuplan_score").unwrap_or_default();
        let (failed, ends) = (results.flags("failed")?, results.text("end_reason")?);
        let details = results.text("end_detail")?;
        let (findings, unjudged) = (results.text("findings")?, results.text("unjudged")?);
        let rows = results.text("scene")?.into_iter().enumerate().map(|(row, scene)| Row {
            score: scores.get(row).copied().flatten().filter(|_| !failed[row]),
            failed: failed[row],
            end: ends[row].clone(),
            what: what(&details[row], &events.remove(&scene).unwrap_or_default()),
            findings: findings[row].clone(),
            unjudged: unjudged[row].clone(),
            scene,
        });
        let mut rows: Vec<Row> = rows.collect();
        rows.sort_by(Row::compare);
        rows.truncate(worst.unwrap_or(usize::MAX));
        Ok(Self { rows })
    }

    /// The episodes, the worst first.
    pub(crate) fn rows(&self) -> &[Row] {
        &self.rows
    }
}

/// The end, and what else happened.
fn what(detail: &str, events: &[String]) -> String {
    // The last events often are the end.
    let other: Vec<&str> = events.iter().map(String::as_str).filter(|event| !detail.contains(event)).collect();
    let mut told: Vec<String> =
        Some(detail).filter(|detail| !detail.is_empty()).map(str::to_owned).into_iter().collect();
    told.extend(other.iter().take(EVENTS).map(|event| (*event).to_owned()));
    if other.len() > EVENTS {
        told.push(format!("and {} more", other.len() - EVENTS));
    }
    told.join("; ")
}

/// What counts of each scene's events, with their steps. The file is read scene by scene: that of many episodes is large.
fn events(steps: &Path) -> Result<BTreeMap<String, Vec<String>>, ParquetError> {
    let mut events = BTreeMap::new();
    for told in ByScene::open(steps, &["step", "events"])? {
        let (scene, steps) = told?;
        let of_scene: &mut Vec<String> = events.entry(scene).or_default();
        for (step, text) in steps.counts("step")?.into_iter().zip(steps.text("events")?) {
            let counted = text.lines().filter(|line| !line.ends_with(NOT_COUNTED));
            of_scene.extend(counted.map(|line| format!("step {step}: {line}")));
        }
    }
    Ok(events)
}

/// Runs scene by scene, one after the other; texts that do not fit into `width` are wrapped.
#[must_use]
pub fn render(runs: &[(Summary, Scenes)], format: TableFormat, width: usize) -> String {
    let summaries: Vec<&Summary> = runs.iter().map(|(summary, _)| summary).collect();
    if format == TableFormat::Csv {
        return csv(runs);
    }
    let tables = runs.iter().map(|(summary, scenes)| {
        let name = if runs.len() > 1 { format!("{}: ", label(summary, &summaries)) } else { String::new() };
        let head = format!("{name}{}, worst first", title(&[summary]));
        let mut grid = grid(&scenes.rows);
        if format == TableFormat::Markdown {
            grid.load_preset(presets::ASCII_MARKDOWN);
            return format!("**{head}**\n\n{grid}\n");
        }
        grid.load_preset(presets::NOTHING);
        grid.set_style(comfy_table::TableComponent::HeaderLines, '─');
        grid.set_content_arrangement(ContentArrangement::Dynamic).set_width(width.try_into().unwrap_or(u16::MAX));
        let last = grid.column_count().saturating_sub(1);
        for (index, column) in grid.column_iter_mut().enumerate() {
            column.set_padding((0, 1));
            if index < last {
                column.set_constraint(ColumnConstraint::ContentWidth);
            }
        }
        let lines: Vec<String> = grid.lines().map(|line| line.trim_end().to_owned()).collect();
        format!("{head}\n\n{}\n", lines.join("\n"))
    });
    tables.collect::<Vec<_>>().join("\n")
}

fn grid(rows: &[Row]) -> Grid {
    let mut grid = Grid::new();
    let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
    // Under `paper` nobody has a score.
    let scored = rows.iter().any(|row| row.score.is_some());
    let score = |text: String| scored.then(|| right(text));
    let head =
        [Some(Cell::new("scene")), score("score".to_owned()), Some(Cell::new("end")), Some(Cell::new("what happened"))];
    grid.set_header(head.into_iter().flatten());
    for row in rows {
        let number = row.score.map_or_else(|| "-".to_owned(), |score| format!("{score:.3}"));
        let cells =
            [Some(Cell::new(&row.scene)), score(number), Some(Cell::new(&row.end)), Some(Cell::new(row.story()))];
        grid.add_row(cells.into_iter().flatten());
    }
    grid
}

fn csv(runs: &[(Summary, Scenes)]) -> String {
    let mut lines = String::from("run,driver,scene,score,failed,end,what,findings,unjudged\n");
    for (run, scenes) in runs {
        let folder = quoted(&run.folder.to_string_lossy());
        for row in &scenes.rows {
            let score = row.score.map(|score| score.to_string()).unwrap_or_default();
            let [scene, what, findings, unjudged] =
                [&row.scene, &row.what, &row.findings, &row.unjudged].map(|text| quoted(text));
            let (driver, failed, end) = (&run.driver, row.failed, &row.end);
            lines += &format!("{folder},{driver},{scene},{score},{failed},{end},{what},{findings},{unjudged}\n");
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::tests::run;

    fn row(scene: &str, score: Option<f64>, end: &str, what: &str) -> Row {
        let failed = end == "driver-failed";
        let [findings, unjudged] = if scene == "fair" { ["no-speed-limits", "speeding"] } else { [""; 2] };
        let [scene, end, what] = [scene, end, what].map(str::to_owned);
        Row { scene, score, failed, end, what, findings: findings.to_owned(), unjudged: unjudged.to_owned() }
    }

    fn scenes() -> Scenes {
        let collision = "step 60: the AV's front struck vehicle 12 at 3.0 m/s, at fault; step 41: 9.0 m/s where 8.0 m/s are allowed";
        let mut rows = vec![
            row("good", Some(1.0), "horizon", "all 150 steps were driven"),
            row("fair", Some(0.75), "log-end", "the log ends after 71 of 150 steps"),
            row(
                "red",
                Some(0.0),
                "horizon",
                "all 150 steps were driven; step 9: crossed the stop point of lane 4 at red",
            ),
            row("struck", Some(0.0), "collision", collision),
            row("failed", None, "driver-failed", "step 12: the planner is gone: planner w0 exited with code 3"),
        ];
        rows.sort_by(Row::compare);
        Scenes { rows }
    }

    #[test]
    fn scenes_stand_worst_first_and_long_stories_are_wrapped() {
        let runs = [(run("idm", "bicycle", "runs/idm-strict-1"), scenes())];
        let text = render(&runs, TableFormat::Text, 80);
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        insta::assert_snapshot!(text, @"
        driver idm, protocol strict, motion bicycle, 8 scenes, worst first

        scene  score end           what happened
        ────────────────────────────────────────────────────────────────────────────────
        failed     - driver-failed step 12: the planner is gone: planner w0 exited with
                                   code 3
        struck 0.000 collision     step 60: the AV's front struck vehicle 12 at 3.0
                                   m/s, at fault; step 41: 9.0 m/s where 8.0 m/s are
                                   allowed
        red    0.000 horizon       all 150 steps were driven; step 9: crossed the stop
                                   point of lane 4 at red
        fair   0.750 log-end       the log ends after 71 of 150 steps [scene:
                                   no-speed-limits] [not judged: speeding]
        good   1.000 horizon       all 150 steps were driven
        ");
        let order = |text: &str| {
            let first = |line: &str| line.split([' ', ',']).next().unwrap_or_default().to_owned();
            let scenes = text.lines().map(first).filter(|word| runs[0].1.rows.iter().any(|row| row.scene == *word));
            scenes.collect::<Vec<_>>()
        };
        assert_eq!(order(&text), ["failed", "struck", "red", "fair", "good"]);
        let csv = render(&runs, TableFormat::Csv, 80);
        assert!(
            csv.contains("\nruns/idm-strict-1,idm,fair,0.75,false,log-end,the log ends after 71 of 150 steps,no-speed-limits,speeding\n"),
            "{csv}"
        );
    }

    #[test]
    fn what_happened_is_the_end_and_the_first_events_beside_it() {
        let events: Vec<String> = (1..6).map(|step| format!("step {step}: too fast")).collect();
        assert_eq!(
            what("step 5: too fast", &events),
            "step 5: too fast; step 1: too fast; step 2: too fast; step 3: too fast; and 1 more"
        );
        assert_eq!(what("", &[]), "");
    }
}
