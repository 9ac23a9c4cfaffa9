//! What a plan at a frame was worth: a row of the file of frames.

use std::path::Path;

use episode::metrics::paper::Comfort;
use results::columns::Columns;
use results::parquet::{self, ParquetError};

use super::Definitions;

/// What is told of five seconds of driving, a plan's or the human's. `None` where it is not judged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// It meets somebody of the log.
    pub collision: Option<bool>,
    /// It meets somebody and is at fault.
    pub at_fault_collision: Option<bool>,
    /// It runs a red light.
    pub red_light: Option<bool>,
    /// It leaves the route.
    pub off_route: Option<bool>,
    /// A corner is beyond the road's edge.
    pub off_road: Option<bool>,
    /// It drives against its lane.
    pub wrong_way: Option<bool>,
    /// It is too fast.
    pub speeding: Option<bool>,
    /// How it feels.
    pub comfort: Comfort,
}

/// How far off a prediction is (m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PredictionFigures {
    /// Agents that the averages are over.
    pub agents: u32,
    /// Average displacement in the likeliest future.
    pub average: f64,
    /// Agents that the final displacements are over.
    pub last_agents: u32,
    /// Displacement after 5 s in the likeliest future.
    pub last: Option<f64>,
    /// The least average displacement of any future.
    pub best_average: Option<f64>,
    /// The least final displacement of any future.
    pub best_last: Option<f64>,
}

/// A frame under one driver.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// The scene.
    pub scene: String,
    /// The log index of the frame.
    pub frame: u32,
    /// Why there is no plan; empty where there is one.
    pub failure: String,
    /// Of the plan.
    pub plan: Figures,
    /// Of the logged AV over the same five seconds.
    pub human: Figures,
    /// Distance between the plan and the logged AV after 1, 3 and 5 s (m).
    pub position_errors: [Option<f64>; 3],
    /// How far off the prediction is; none without one, and with nobody to predict.
    pub prediction: Option<PredictionFigures>,
    /// The place of the likeliest future among the predictor's.
    pub mode: Option<u32>,
    /// Iterations of the planner's search, if it searches.
    pub iterations: Option<u32>,
    /// What its search came to.
    pub objective: Option<f64>,
}

impl Row {
    /// A row of which nothing is told yet.
    #[must_use]
    pub fn of(scene: &str, frame: u32) -> Self {
        Self { scene: scene.to_owned(), frame, ..Self::default() }
    }

    /// Whether there is no plan.
    #[must_use]
    pub fn failed(&self) -> bool {
        !self.failure.is_empty()
    }
}

/// A column of numbers: its name with its unit, and its value in a row.
#[derive(Clone, Copy)]
pub struct Column {
    /// Its name, as `docs/open-loop.md` defines it.
    pub name: &'static str,
    /// Its value.
    pub value: fn(&Row) -> Option<f64>,
}

fn flag(value: Option<bool>) -> Option<f64> {
    value.map(|is_so| f64::from(u8::from(is_so)))
}

macro_rules! columns {
    ($($name:literal, $value:expr;)*) => {
        &[$(Column { name: $name, value: $value }),*]
    };
}

/// Every column of numbers, in the order of the file.
#[rustfmt::skip]
pub const COLUMNS: &[Column] = columns![
    "collision", |row| flag(row.plan.collision);
    "at_fault_collision", |row| flag(row.plan.at_fault_collision);
    "red_light", |row| flag(row.plan.red_light);
    "off_route", |row| flag(row.plan.off_route);
    "off_road", |row| flag(row.plan.off_road);
    "wrong_way", |row| flag(row.plan.wrong_way);
    "speeding", |row| flag(row.plan.speeding);
    "mean_abs_acceleration_mps2", |row| row.plan.comfort.acceleration;
    "mean_abs_jerk_mps3", |row| row.plan.comfort.jerk;
    "mean_abs_lateral_acceleration_mps2", |row| row.plan.comfort.lateral_acceleration;
    "position_error_1s_m", |row| row.position_errors[0];
    "position_error_3s_m", |row| row.position_errors[1];
    "position_error_5s_m", |row| row.position_errors[2];
    "prediction_ade_m", |row| Some(row.prediction?.average);
    "prediction_fde_m", |row| row.prediction?.last;
    "prediction_min_ade_m", |row| row.prediction?.best_average;
    "prediction_min_fde_m", |row| row.prediction?.best_last;
    "predicted_agents", |row| Some(f64::from(row.prediction?.agents));
    "predicted_agents_5s", |row| Some(f64::from(row.prediction?.last_agents));
    "mode", |row| row.mode.map(f64::from);
    "iterations", |row| row.iterations.map(f64::from);
    "objective", |row| row.objective;
    "human_collision", |row| flag(row.human.collision);
    "human_at_fault_collision", |row| flag(row.human.at_fault_collision);
    "human_red_light", |row| flag(row.human.red_light);
    "human_off_route", |row| flag(row.human.off_route);
    "human_off_road", |row| flag(row.human.off_road);
    "human_wrong_way", |row| flag(row.human.wrong_way);
    "human_speeding", |row| flag(row.human.speeding);
    "human_mean_abs_acceleration_mps2", |row| row.human.comfort.acceleration;
    "human_mean_abs_jerk_mps3", |row| row.human.comfort.jerk;
    "human_mean_abs_lateral_acceleration_mps2", |row| row.human.comfort.lateral_acceleration;
];

/// Writes the rows of all drivers, each with its name, under `path`.
///
/// # Errors
/// [`ParquetError`] where the disk fails.
pub fn write<'a>(
    path: &Path,
    definitions: Definitions,
    drivers: impl IntoIterator<Item = (&'a str, &'a [Row])>,
) -> Result<(), ParquetError> {
    let batch = |driver: &str, rows: &[Row]| {
        let mut table = Columns::default();
        table.text("driver", rows.iter().map(|_| driver));
        table.text("definitions", rows.iter().map(|_| definitions.name()));
        table.text("scene", rows.iter().map(|row| &row.scene));
        table.count("frame", rows.iter().map(|row| row.frame));
        table.flag("failed", rows.iter().map(Row::failed));
        table.text("failure", rows.iter().map(|row| &row.failure));
        for column in COLUMNS {
            table.maybe(column.name, rows.iter().map(column.value));
        }
        table.batch()
    };
    let schema = batch("", &[])?.schema();
    parquet::write(path, schema, drivers.into_iter().map(|(driver, rows)| Ok(batch(driver, rows)?)))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::collections::BTreeSet;

    use results::parquet::Table;

    use super::*;

    #[test]
    fn names_are_unique_and_the_documentation_defines_each() {
        let names: BTreeSet<&str> = COLUMNS.iter().map(|column| column.name).collect();
        assert_eq!(names.len(), COLUMNS.len());
        let page = include_str!("../../../docs/open-loop.md");
        for name in names.iter().map(|name| name.strip_prefix("human_").unwrap_or(name)) {
            assert!(page.contains(&format!("`{name}`")), "docs/open-loop.md does not define {name}");
        }
    }

    #[test]
    fn a_row_reads_back_and_what_is_not_judged_is_null() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.parquet");
        let good = Row {
            plan: Figures { collision: Some(true), ..Figures::default() },
            position_errors: [Some(1.0), None, Some(f64::NAN)],
            ..Row::of("a", 20)
        };
        let bad = Row { failure: "no way".to_owned(), ..Row::of("b", 30) };
        write(&path, Definitions::Strict, [("x", &[good, bad][..]), ("y", &[][..])]).unwrap();
        let table = Table::read(&path).unwrap();
        assert_eq!(table.text("scene").unwrap(), ["a", "b"]);
        assert_eq!(table.flags("failed").unwrap(), [false, true]);
        assert_eq!(table.counts("frame").unwrap(), [20, 30]);
        let numbers = table.numbers().unwrap();
        assert_eq!(numbers["collision"], [Some(1.0), None]);
        assert_eq!(numbers["position_error_1s_m"], [Some(1.0), None]);
        assert_eq!(numbers["position_error_5s_m"], [None, None]);
        assert_eq!(numbers.len(), COLUMNS.len());
    }
}
