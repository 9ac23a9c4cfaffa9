//! Rows of the AV and its neighbours (`network.md` 2).

use world::geometry::{Point, Pose};
use world::scene::{AgentKind, AgentState};

use super::av_frame::{AvFrame, unless_missing};
use super::settings::Settings;
use super::window::{Neighbor, Window};
use crate::constants::{HISTORY, NEIGHBOR_ROW, STATE};

/// Seconds of a step.
const STEP: f64 = 0.1;

/// The AV's rows.
pub(super) fn ego(window: &Window, frame: &AvFrame) -> [[f32; STATE]; HISTORY] {
    let mut states = with_now(&window.av_before, window.av);
    if frame.settings == Settings::Mended {
        fill(&mut states);
    }
    states.map(|state| {
        let Some(state) = state else { return [0.0; STATE] };
        let row = match frame.settings {
            Settings::Authors if window.av_is_logged => logged(&state, frame),
            _ => frame.driven(state.pose(), state.velocity()),
        };
        with_size(row, &state)
    })
}

/// A neighbour's rows.
pub(super) fn neighbor(neighbor: &Neighbor, frame: &AvFrame) -> [[f32; NEIGHBOR_ROW]; HISTORY] {
    let mut states = with_now(&neighbor.before, neighbor.now);
    let kind = kind_code(neighbor.kind);
    let whole = |state: &AgentState, row: [f32; 5]| {
        let row = with_size(row, state);
        std::array::from_fn(|index| if index < STATE { row[index] } else { kind })
    };
    match frame.settings {
        Settings::Mended => {
            fill(&mut states);
            states.map(|state| state.map_or([0.0; NEIGHBOR_ROW], |state| whole(&state, logged(&state, frame))))
        }
        Settings::Authors => authors_rows(&states, frame, whole),
    }
}

/// Their way: zeros are what is missing, what is filled in has neither size nor type, and is rounded row by row.
fn authors_rows(
    states: &[Option<AgentState>; HISTORY],
    frame: &AvFrame,
    whole: impl Fn(&AgentState, [f32; 5]) -> [f32; NEIGHBOR_ROW],
) -> [[f32; NEIGHBOR_ROW]; HISTORY] {
    let world = |state: &AgentState| [state.x, state.y, state.heading, state.velocity_x, state.velocity_y];
    let mut rows = states.map(|state| state.map_or([0.0_f32; 5], |state| world(&state).map(|value| value as f32)));
    if rows[HISTORY - 1][0] != 0.0 {
        for index in (0..HISTORY - 1).rev() {
            if rows[index][0] == 0.0 {
                let [x, y, heading, velocity_x, velocity_y] = rows[index + 1];
                let back = |place: f32, velocity: f32| (f64::from(place) - f64::from(velocity) * STEP) as f32;
                rows[index] = [back(x, velocity_x), back(y, velocity_y), heading, velocity_x, velocity_y];
            }
        }
    }
    std::array::from_fn(|index| {
        let [x, y, heading, velocity_x, velocity_y] = rows[index].map(f64::from);
        let [own_x, own_y] = frame.place(Point::new(x, y));
        let own_heading = unless_missing(heading as f32, frame.heading(heading));
        let [own_velocity_x, own_velocity_y] = frame.velocity(Point::new(velocity_x, velocity_y));
        let row = [own_x, own_y, own_heading, own_velocity_x, own_velocity_y];
        match &states[index] {
            Some(state) => whole(state, row),
            None => std::array::from_fn(|column| row.get(column).copied().unwrap_or(0.0)),
        }
    })
}

/// Place, heading and velocity of a logged state.
fn logged(state: &AgentState, frame: &AvFrame) -> [f32; 5] {
    let [x, y] = frame.place(state.position());
    let heading = match frame.settings {
        Settings::Authors => unless_missing(state.heading as f32, frame.heading(state.heading)),
        Settings::Mended => frame.heading(state.heading),
    };
    let [velocity_x, velocity_y] = frame.velocity(state.velocity());
    [x, y, heading, velocity_x, velocity_y]
}

fn with_size([x, y, heading, velocity_x, velocity_y]: [f32; 5], state: &AgentState) -> [f32; STATE] {
    [x, y, heading, velocity_x, velocity_y, state.length as f32, state.width as f32, state.height as f32]
}

fn with_now(before: &[Option<AgentState>; HISTORY - 1], now: AgentState) -> [Option<AgentState>; HISTORY] {
    std::array::from_fn(|index| if index < HISTORY - 1 { before[index] } else { Some(now) })
}

/// What was not seen is where the state after it says: as fast and as large, a step back.
fn fill(states: &mut [Option<AgentState>; HISTORY]) {
    for index in (0..HISTORY - 1).rev() {
        if let (None, Some(after)) = (states[index], states[index + 1]) {
            let (x, y) = (after.x - STEP * after.velocity_x, after.y - STEP * after.velocity_y);
            states[index] = Some(AgentState { x, y, ..after });
        }
    }
}

fn kind_code(kind: AgentKind) -> f32 {
    match kind {
        AgentKind::Vehicle => 1.0,
        AgentKind::Pedestrian => 2.0,
        AgentKind::Cyclist => 3.0,
        AgentKind::Other => 4.0,
    }
}

/// Where a neighbour is for the search of its lanes and crosswalks: the authors' is rounded.
pub(super) fn pose_for_search(state: &AgentState, is_rounded: bool) -> Pose {
    if is_rounded {
        Pose::new(f64::from(state.x as f32), f64::from(state.y as f32), f64::from(state.heading as f32))
    } else {
        state.pose()
    }
}
