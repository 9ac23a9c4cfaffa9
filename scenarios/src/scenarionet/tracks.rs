//! Road users over time.

use world::geometry::Point;
use world::scene::{AgentState, Track, TrackId};

use super::dataset::Dataset;
use super::layout::{Layout, Rows, Wrong};
use super::pickle::Value;
use super::{ScenarioNetError, form};
use crate::numbering::Numbering;

/// Tracks by name, and their numbers.
pub(super) fn numbering<'p>(layout: &Layout<'p>, tracks: &[(Value<'p>, Value<'p>)]) -> Numbering {
    let name = |(key, _): &(Value<'p>, Value<'p>)| layout.pickle.name(*key).map(|name| name.into_owned());
    let names: Vec<String> = tracks.iter().map(|pair| name(pair).unwrap_or_default()).collect();
    Numbering::of(&names, 0, (i64::from(i32::MIN), i64::from(i32::MAX)))
}

pub(super) fn track<'p>(
    layout: &Layout<'p>,
    (key, track): (Value<'p>, Value<'p>),
    numbers: &mut Numbering,
    dataset: Dataset,
) -> Result<Track, ScenarioNetError> {
    let name = layout.pickle.name(key).unwrap_or_default();
    let columns = Columns::of(layout, track, &name)?;
    let steps = columns.steps();
    layout.spend(steps)?;
    let mut states: Vec<Option<AgentState>> = (0..steps).map(|step| columns.state(step)).collect();
    if dataset.is_flat() {
        states.iter_mut().flatten().for_each(stand);
    }
    if dataset.has_forward_velocities() {
        keep_last_velocities(&mut states, false);
    }
    let id = i32::try_from(numbers.number(&name)).unwrap_or(i32::MAX);
    Ok(Track { id: TrackId(id), kind: form::agent(layout, layout.find(track, &["type"])), states })
}

/// Puts a box onto the ground, which is at 0.
fn stand(state: &mut AgentState) {
    state.z = if state.height > 0.0 { 0.5 * state.height } else { 0.0 };
}

/// From the rear axle of a Renault Zoe to its middle (m): it is 4.084 m long, of which 0.657 m lie behind the axle.
const AXLE_TO_MIDDLE: f64 = 4.084 / 2.0 - 0.657;

/// Gives the AV of nuScenes, a Renault Zoe, its length for its length, and moves it from its rear axle to its middle; velocities are then
/// those of the middle.
pub(super) fn put_av_right(av: &mut Track) {
    for state in av.states.iter_mut().flatten() {
        if state.width > state.length {
            (state.length, state.width) = (state.width, state.length);
        }
        let ahead = Point::unit(state.heading);
        state.x += AXLE_TO_MIDDLE * ahead.x;
        state.y += AXLE_TO_MIDDLE * ahead.y;
    }
    for step in 1..av.states.len() {
        let Some(next) = av.states[step] else { continue };
        if let Some(state) = &mut av.states[step - 1] {
            (state.velocity_x, state.velocity_y) = ((next.x - state.x) / 0.1, (next.y - state.y) / 0.1);
        }
    }
    keep_last_velocities(&mut av.states, true);
}

/// Where a track ends, or is lost, there is no next state to take a difference to, and the converter writes 0: the velocity before goes on;
/// also where it is not 0, if velocities were reckoned `anew`.
fn keep_last_velocities(states: &mut [Option<AgentState>], anew: bool) {
    for step in (1..states.len()).rev() {
        let is_last = states.get(step + 1).is_none_or(Option::is_none);
        let Some(before) = states[step - 1] else { continue };
        if let Some(state) = states[step].as_mut().filter(|state| is_last && (anew || state.speed() == 0.0)) {
            (state.velocity_x, state.velocity_y) = (before.velocity_x, before.velocity_y);
        }
    }
}

/// A track's numbers, a row a step: of each quantity the rows that it is in, and its first column.
struct Columns<'p> {
    position: (Rows<'p>, usize),
    /// Whether positions have a third number.
    has_height: bool,
    heading: (Rows<'p>, usize),
    velocity: (Rows<'p>, usize),
    /// Length, width, height. What is not there is mended later.
    sizes: [Option<(Rows<'p>, usize)>; 3],
    valid: (Rows<'p>, usize),
}

impl<'p> Columns<'p> {
    fn of(layout: &Layout<'p>, track: Value<'p>, name: &str) -> Result<Self, ScenarioNetError> {
        let at = |key: &str| format!("track {name}: {key}");
        let state = layout.find(track, &["state"]).ok_or_else(|| Layout::wrong(at("state"), Wrong::Missing))?;
        if let Some(numbers) = layout.pickle.numbers(state) {
            return match numbers.columns {
                10 => Ok(Self::of_one(Rows::Array(numbers))),
                columns => {
                    let wrong = Wrong::Shape { expected: "rows of 10", rows: numbers.rows, columns };
                    Err(Layout::wrong(at("state"), wrong))
                }
            };
        }
        let rows = |key: &'static str, least: usize| {
            let value = layout.find(state, &[key]).ok_or_else(|| Layout::wrong(at(key), Wrong::Missing))?;
            let rows = layout.rows(at(key), value)?;
            if rows.len() > 0 && rows.columns() < least {
                let expected = if least == 2 { "rows of 2 or 3" } else { "a number a row" };
                let wrong = Wrong::Shape { expected, rows: rows.len(), columns: rows.columns() };
                return Err(Layout::wrong(at(key), wrong));
            }
            Ok((rows, 0))
        };
        let size = |key: &'static str, column: usize| match layout.find(state, &["size"]) {
            Some(value) => Ok(Some((layout.rows(at("size"), value)?, column))),
            None if layout.find(state, &[key]).is_none() => Ok(None),
            None => rows(key, 1).map(Some),
        };
        let position = rows("position", 2)?;
        Ok(Self {
            position,
            has_height: position.0.columns() > 2,
            heading: rows("heading", 1)?,
            velocity: rows("velocity", 2)?,
            sizes: [size("length", 0)?, size("width", 1)?, size("height", 2)?],
            valid: rows("valid", 1)?,
        })
    }

    /// Of the oldest scenes: x, y, z, length, width, height, heading, velocity x and y, valid.
    fn of_one(rows: Rows<'p>) -> Self {
        Self {
            position: (rows, 0),
            has_height: true,
            heading: (rows, 6),
            velocity: (rows, 7),
            sizes: [Some((rows, 3)), Some((rows, 4)), Some((rows, 5))],
            valid: (rows, 9),
        }
    }

    fn steps(&self) -> usize {
        self.valid.0.len()
    }

    fn state(&self, step: usize) -> Option<AgentState> {
        let at = |(rows, column): &(Rows<'p>, usize), next: usize| rows.at(step, column + next);
        let [length, width, height] = self.sizes.map(|size| size.map_or(f64::NAN, |size| at(&size, 0)));
        (at(&self.valid, 0) > 0.5).then(|| AgentState {
            x: at(&self.position, 0),
            y: at(&self.position, 1),
            z: if self.has_height { at(&self.position, 2) } else { 0.0 },
            heading: at(&self.heading, 0),
            velocity_x: at(&self.velocity, 0),
            velocity_y: at(&self.velocity, 1),
            length,
            width,
            height,
        })
    }
}
