//! What the tables hold, as curves.

use std::fs;
use std::path::Path;

use re_chunk::TimeColumn;
use re_sdk_types::archetypes::{Scalars, SeriesLines};
use rrd::{Store, color};

use super::{EPOCH, STEP, ViewError};

/// The two sides of a figure: columns of `metrics.csv` begin with the one, entities end with the other.
const SIDES: [(&str, &str, [u8; 4]); 2] =
    [("train_", "training", [118, 140, 186, 255]), ("val_", "validation", [242, 196, 104, 255])];

/// Figures of both sides: the column of `metrics.csv` behind its side, and the entity.
const FIGURES: [(&str, &str); 10] = [
    ("loss", "loss/total"),
    ("part_prediction", "loss/terms/prediction"),
    ("part_score", "loss/terms/score"),
    ("part_plan", "loss/terms/plan"),
    ("part_cost", "loss/terms/cost"),
    ("part_prior", "loss/terms/prior"),
    ("plannerADE", "errors/planner/ade"),
    ("plannerFDE", "errors/planner/fde"),
    ("predictorADE", "errors/predictor/ade"),
    ("predictorFDE", "errors/predictor/fde"),
];

/// The learned weights of the cost, in the order of the columns `w1` to `w9`: name and colour.
const COST: [(&str, [u8; 4]); 9] = [
    ("speed", [0, 205, 240, 255]),
    ("acceleration", [242, 196, 104, 255]),
    ("jerk", [198, 128, 240, 255]),
    ("steering", [64, 220, 120, 255]),
    ("steering_change", [255, 186, 48, 255]),
    ("lane_position", [118, 140, 186, 255]),
    ("lane_heading", [168, 186, 232, 255]),
    ("red_light", [255, 72, 72, 255]),
    ("safety", [240, 240, 245, 255]),
];

/// One table of numbers.
struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn read(path: &Path) -> Result<Self, ViewError> {
        let text = fs::read_to_string(path).map_err(|source| ViewError::Read { path: path.to_owned(), source })?;
        let mut lines = text.lines().map(|line| line.split(',').map(String::from).collect());
        Ok(Self { header: lines.next().unwrap_or_default(), rows: lines.collect() })
    }

    /// The values of a column, where there are any, each with the number in `by`.
    fn column(&self, by: &str, name: &str) -> Vec<(i64, f64)> {
        let place = |name: &str| self.header.iter().position(|own| own == name);
        let (Some(by), Some(column)) = (place(by), place(name)) else { return Vec::new() };
        let value = |row: &Vec<String>| Some((row.get(by)?.parse().ok()?, row.get(column)?.parse().ok()?));
        self.rows.iter().filter_map(value).collect()
    }
}

/// Logs the curves of the tables in `folder`.
pub fn log(store: &mut Store<'_>, folder: &Path) -> Result<(), ViewError> {
    let epochs = Table::read(&folder.join("metrics.csv"))?;
    let steps = Table::read(&folder.join("steps.csv"))?;
    // The step at which an epoch ends: the last row of `steps.csv` that has it.
    let ends = steps.column("epoch", "step");
    let end = |epoch: i64| ends.iter().rev().find(|(of, _)| *of == epoch).map_or(0, |(_, step)| *step as i64);
    let by_epoch = |column: &str| {
        let values = epochs.column("epoch", column);
        let times = vec![
            TimeColumn::new_sequence(EPOCH, values.iter().map(|(epoch, _)| *epoch)),
            TimeColumn::new_sequence(STEP, values.iter().map(|(epoch, _)| end(*epoch))),
        ];
        (times, values)
    };
    let by_step = |column: &str| {
        let values = steps.column("step", column);
        (vec![TimeColumn::new_sequence(STEP, values.iter().map(|(step, _)| *step))], values)
    };
    for (figure, path) in FIGURES {
        let term = path.rsplit('/').next().unwrap_or(path);
        for (column, side, rgba) in SIDES {
            let curve = by_epoch(&format!("{column}{figure}"));
            draw(store, &format!("{path}/{side}"), &format!("{term}, {side}"), rgba, curve)?;
        }
    }
    for (term, (name, rgba)) in COST.into_iter().enumerate() {
        let curve = by_epoch(&format!("w{}", term + 1));
        draw(store, &format!("cost_weights/{name}"), &name.replace('_', " "), rgba, curve)?;
    }
    draw(store, "learning_rate", "learning rate", [168, 186, 232, 255], by_epoch("lr"))?;
    draw(store, "steps/loss", "loss", [118, 140, 186, 255], by_step("loss"))?;
    draw(store, "steps/gradient_norm", "gradient norm", [198, 128, 240, 255], by_step("gradient_norm"))
}

/// A curve: nothing where there is no value.
fn draw(
    store: &mut Store<'_>,
    path: &str,
    name: &str,
    rgba: [u8; 4],
    (times, values): (Vec<TimeColumn>, Vec<(i64, f64)>),
) -> Result<(), ViewError> {
    if values.is_empty() {
        return Ok(());
    }
    store.log(path, &SeriesLines::new().with_colors([color(rgba)]).with_names([name]).with_widths([1.6]))?;
    let scalars = Scalars::update_fields().with_scalars(values.into_iter().map(|(_, value)| value));
    let columns = scalars.columns_of_unit_batches().map_err(rrd::RrdError::from)?;
    Ok(store.log_columns(path, times, columns)?)
}
