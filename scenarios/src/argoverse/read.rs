//! From the two files of a scene to a checked scene.

use world::scene::{Finding, Scene, SceneId, SceneParts};

use super::table::Table;
use super::tracks::{self, Tracks};
use super::{ArgoverseError, MAX_FILE_BYTES, map};
use crate::budget::Budget;

const ID: &str = "scenario_id";

/// Steps that are longer or shorter than this (s) are not those of 0.1 s.
const STEP_LENGTHS: std::ops::RangeInclusive<f64> = 0.08..=0.12;

/// The scene in the bytes of a table and of a map, and what was found odd in it and mended.
///
/// # Errors
/// [`ArgoverseError`]: in which of the two, where, and what is wrong there.
pub fn read(table: &[u8], map: &[u8]) -> Result<(Scene, Vec<Finding>), ArgoverseError> {
    if let Some(bytes) = [table.len(), map.len()].into_iter().find(|bytes| *bytes as u64 > MAX_FILE_BYTES) {
        return Err(ArgoverseError::TooLong(bytes as u64));
    }
    let budget = Budget::of_a_scene();
    let table = Table::open(table)?;
    let timestamps = timestamps(&table, &budget)?;
    let Tracks { tracks, av_index, tracks_to_predict, focal, last_observed, last } =
        tracks::tracks(&table, timestamps.len(), &budget)?;
    if last_observed == Some(last) && last + 1 < timestamps.len() {
        return Err(ArgoverseError::FutureWithheld { known: last + 1, steps: timestamps.len() });
    }
    let sizes = Finding::AssumedSizes { tracks: tracks.len() };
    let parts = SceneParts {
        id: id(&table)?,
        timestamps,
        tracks,
        av_index,
        signals: Vec::new(),
        map: map::read(map, &budget)?,
        current_time_index: last_observed.unwrap_or(0),
        objects_of_interest: focal.into_iter().collect(),
        tracks_to_predict,
    };
    let (scene, mut findings) = parts.check()?;
    findings.push(sizes);
    Ok((scene, findings))
}

/// The id of the scene in a table.
///
/// # Errors
/// [`ArgoverseError`] as of [`read`].
pub fn scene_id(table: &[u8]) -> Result<SceneId, ArgoverseError> {
    Ok(SceneId::new(id(&Table::open(table)?)?)?)
}

fn id(table: &Table<'_>) -> Result<String, ArgoverseError> {
    let ids = table.texts(ID)?;
    ids.names.into_iter().next().ok_or(ArgoverseError::NoRows)
}

/// Time of each step (s), from the first on: they lie evenly between the first and the last. Who wrote them may have had them as floats.
fn timestamps(table: &Table<'_>, budget: &Budget) -> Result<Vec<f64>, ArgoverseError> {
    let first = |column| -> Result<f64, ArgoverseError> {
        table.floats(column)?.first().copied().ok_or(ArgoverseError::NoRows)
    };
    let (begin, end, number) = (first("start_timestamp")?, first("end_timestamp")?, first("num_timestamps")?);
    // What is no number is no step, which the check of the scene says.
    let steps = number as usize;
    budget.spend(steps)?;
    let step = 1e-9 * (end - begin) / steps.saturating_sub(1).max(1) as f64;
    if steps > 1 && !STEP_LENGTHS.contains(&step) {
        return Err(ArgoverseError::StepLength { seconds: format!("{step:.3}") });
    }
    Ok((0..steps).map(|index| index as f64 * step).collect())
}
