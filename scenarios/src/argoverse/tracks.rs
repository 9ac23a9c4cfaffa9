//! Road users over time, by the rows of a table: a row a state.

use world::geometry::angle_difference;
use world::scene::{AgentState, Track, TrackId, TrackToPredict};

use super::table::Table;
use super::{ArgoverseError, kinds};
use crate::budget::Budget;
use crate::numbering::Numbering;

/// Categories of tracks that prediction tasks ask for, and of the one that the scene was picked for.
const SCORED: i64 = 2;
const FOCAL: i64 = 3;

/// All tracks of a scene.
pub(super) struct Tracks {
    pub tracks: Vec<Track>,
    pub av_index: usize,
    /// Those that prediction tasks ask for, and the one that the scene was picked for.
    pub tracks_to_predict: Vec<TrackToPredict>,
    pub focal: Option<TrackId>,
    /// The last step that a predictor is shown.
    pub last_observed: Option<usize>,
    /// The last step at which anybody is.
    pub last: usize,
}

/// The tracks of a scene of so many steps.
pub(super) fn tracks(table: &Table<'_>, steps: usize, budget: &Budget) -> Result<Tracks, ArgoverseError> {
    let (ids, types) = (table.texts("track_id")?, table.texts("object_type")?);
    let (timesteps, categories) = (table.ints("timestep")?, table.ints("object_category")?);
    let observed = if table.has("observed") { table.ints("observed")? } else { vec![0; timesteps.len()] };
    let [x, y, heading, velocity_x, velocity_y] =
        ["position_x", "position_y", "heading", "velocity_x", "velocity_y"].map(|column| table.floats(column));
    let [x, y, heading, velocity_x, velocity_y] = [x?, y?, heading?, velocity_x?, velocity_y?];
    budget.spend(ids.names.len().saturating_mul(steps))?;
    let mut numbers = Numbering::of(&ids.names, 0, (0, i64::from(i32::MAX)));
    let track = |name: &String| {
        let id = TrackId(i32::try_from(numbers.number(name)).unwrap_or(i32::MAX));
        Track { id, states: vec![None; steps], ..Track::default() }
    };
    let mut tracks: Vec<Track> = ids.names.iter().map(track).collect();
    let mut category = vec![0; tracks.len()];
    let mut sizes: Vec<Option<[f64; 3]>> = vec![None; tracks.len()];
    let (mut last_observed, mut last) = (None, 0);
    for (row, (&place, &timestep)) in ids.rows.iter().zip(&timesteps).enumerate() {
        let name = || ids.names[place].clone();
        let step = usize::try_from(timestep).ok().filter(|step| *step < steps);
        let step = step.ok_or_else(|| ArgoverseError::Step { track: name(), step: timestep, steps })?;
        // What a track is, its first row says.
        let [length, width, height] = *sizes[place].get_or_insert_with(|| {
            let (kind, size) = kinds::agent(&ids.names[place], &types.names[types.rows[row]]);
            (tracks[place].kind, category[place]) = (kind, categories[row]);
            size
        });
        let state = AgentState {
            x: x[row],
            y: y[row],
            z: 0.5 * height,
            heading: heading[row],
            velocity_x: velocity_x[row],
            velocity_y: velocity_y[row],
            length,
            width,
            height,
        };
        if tracks[place].states[step].replace(state).is_some() {
            return Err(ArgoverseError::Twice { track: name(), step });
        }
        last = last.max(step);
        if observed[row] != 0 {
            last_observed = last_observed.max(Some(step));
        }
    }
    tracks.iter_mut().for_each(|track| unwrap_headings(&mut track.states));
    let av_index = ids.names.iter().position(|name| name == kinds::AV).ok_or(ArgoverseError::NoAv)?;
    let is_asked_for = |place: &usize| (SCORED..=FOCAL).contains(&category[*place]);
    let asked_for =
        (0..tracks.len()).filter(is_asked_for).map(|track_index| TrackToPredict { track_index, difficulty: 0 });
    let tracks_to_predict = asked_for.collect();
    let focal = category.iter().position(|category| *category == FOCAL).map(|place| tracks[place].id);
    Ok(Tracks { tracks, av_index, tracks_to_predict, focal, last_observed, last })
}

/// Makes headings go on where they jump by a whole turn.
fn unwrap_headings(states: &mut [Option<AgentState>]) {
    let mut before: Option<f64> = None;
    for state in states.iter_mut().flatten() {
        if let Some(before) = before.filter(|before| (state.heading - before).abs() > std::f64::consts::PI) {
            state.heading = before + angle_difference(before, state.heading);
        }
        before = Some(state.heading);
    }
}
