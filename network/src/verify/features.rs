//! Features against those of another implementation.

use std::f64::consts::TAU;

use vectors::{Npz, NpzError, Quantity};
use world::scene::{AgentState, Scene};

use super::outputs::frame;
use crate::Frame;
use crate::constants::{AGENTS, HISTORY, LANES, NEIGHBORS};
use crate::features::{Features, SceneFeatures, Window};

const NEIGHBOR_ORDER: Quantity = Quantity::exact("neighbours");
const LANE_IDS: Quantity = Quantity::exact("lane ids");
const LANE_STARTS: Quantity = Quantity::exact("lane starts");
const CANDIDATES: Quantity = Quantity::exact("lane candidates");
const CODES: Quantity = Quantity::exact("codes, sizes, types");
const SPEED_LIMITS: Quantity = Quantity::within("speed limits", 1e-5, "m/s");
const AGENT_POSITIONS: Quantity = Quantity::within("agent positions", 5e-5, "m");
const AGENT_HEADINGS: Quantity = Quantity::within("agent headings", 1e-5, "rad");
const VELOCITIES: Quantity = Quantity::within("velocities", 1e-5, "m/s");
const LANE_POSITIONS: Quantity = Quantity::within("lane positions", 5e-5, "m");
const LANE_HEADINGS: Quantity = Quantity::within("lane headings", 1e-5, "rad");
const CROSSWALK_POSITIONS: Quantity = Quantity::within("crosswalk positions", 5e-5, "m");
const CROSSWALK_HEADINGS: Quantity = Quantity::within("crosswalk headings", 1e-5, "rad");

/// What is compared, with the tolerances of the vectors' README.
pub(super) const QUANTITIES: [Quantity; 13] = [
    NEIGHBOR_ORDER,
    LANE_IDS,
    LANE_STARTS,
    CANDIDATES,
    CODES,
    SPEED_LIMITS,
    AGENT_POSITIONS,
    AGENT_HEADINGS,
    VELOCITIES,
    LANE_POSITIONS,
    LANE_HEADINGS,
    CROSSWALK_POSITIONS,
    CROSSWALK_HEADINGS,
];

/// Lanes of a sequence whose ids are written down.
const IDS: usize = 12;

/// The scene that a file is of; none where its frame was made up.
pub(super) fn scene_of(npz: &Npz) -> Option<String> {
    let text = npz.array("scenario_id", &[None]).ok()?;
    Some(text.iter().map(|byte| char::from(*byte as u8)).collect())
}

/// What is known at the step that a file is of.
///
/// # Errors
/// [`NpzError`] where the file does not say which.
pub fn window(npz: &Npz, scene: &Scene) -> Result<Window, NpzError> {
    let states = npz.rows::<8>("sdc_hist_states", &[Some(HISTORY), Some(8)])?;
    let state = |index: usize| {
        let [x, y, heading, velocity_x, velocity_y, length, width, height] = states[index];
        AgentState { x, y, z: 0.0, heading, velocity_x, velocity_y, length, width, height }
    };
    let before = std::array::from_fn(|index| Some(state(index)));
    let step = npz.number("timestep")? as usize;
    Ok(Window::driven(scene, step, state(HISTORY - 1), before, npz.number("override")? == 0.0))
}

/// How far the features of a step are from those that a file has.
pub(super) fn deviations(npz: &Npz, scene: &Scene, prepared: &SceneFeatures) -> Result<Vec<(Quantity, f64)>, NpzError> {
    let features = prepared.at(&window(npz, scene)?);
    let mut found = ids(npz, scene, &features)?;
    found.extend(tensors(&features.frame, &frame(npz)?));
    Ok(found)
}

fn ids(npz: &Npz, scene: &Scene, features: &Features) -> Result<Vec<(Quantity, f64)>, NpzError> {
    let order = npz.array("neighbors_to_predict", &[None])?;
    let tracks: Vec<f64> = features
        .tracks
        .iter()
        .map(|track| scene.tracks().iter().position(|other| other.id == *track).map_or(-1.0, |index| index as f64))
        .collect();
    let shape = [Some(AGENTS), Some(LANES), Some(IDS)];
    let (ids, starts) = (npz.array("lane_ids", &shape)?, npz.array("lane_start", &shape)?);
    let candidates = npz.array("lane_candidates", &[Some(AGENTS)])?;
    let (mut off_ids, mut off_starts, mut off_candidates) = (0, 0, 0);
    for (agent, wanted) in candidates.iter().enumerate() {
        let view = features.views.get(agent);
        let count = view.and_then(|view| view.candidates).map_or(-1.0, |count| count as f64);
        off_candidates += usize::from(count != *wanted);
        for lane in 0..LANES {
            let sequence = view.and_then(|view| view.sequences.get(lane));
            for index in 0..IDS {
                let place = (agent * LANES + lane) * IDS + index;
                let own = sequence.and_then(|sequence| sequence.lanes.get(index));
                off_ids += usize::from(own.map_or(-1.0, |(id, _)| id.0 as f64) != ids[place]);
                off_starts += usize::from(own.is_some_and(|(_, start)| *start as f64 != starts[place]));
            }
        }
    }
    Ok(vec![
        (NEIGHBOR_ORDER, f64::from(u8::from(tracks != order))),
        (LANE_IDS, off_ids as f64),
        (LANE_STARTS, off_starts as f64),
        (CANDIDATES, off_candidates as f64),
    ])
}

/// The worst of each quantity.
#[derive(Default)]
struct Worst {
    positions: f64,
    headings: f64,
    velocities: f64,
    speed_limits: f64,
    others: usize,
}

impl Worst {
    fn pose(&mut self, own: &[f32], other: &[f32]) {
        for index in 0..2 {
            self.positions = larger(self.positions, f64::from(own[index]) - f64::from(other[index]));
        }
        let turn = (f64::from(own[2]) - f64::from(other[2])).abs() % TAU;
        self.headings = larger(self.headings, turn.min(TAU - turn));
    }

    fn agent(&mut self, own: &[f32], other: &[f32]) {
        self.pose(own, other);
        for index in 3..5 {
            self.velocities = larger(self.velocities, f64::from(own[index]) - f64::from(other[index]));
        }
        self.same(&own[5..], &other[5..]);
    }

    fn same(&mut self, own: &[f32], other: &[f32]) {
        self.others += own.iter().zip(other).filter(|(own, other)| own != other).count();
    }
}

/// The larger of the two, what is no number being the largest.
fn larger(worst: f64, deviation: f64) -> f64 {
    let deviation = deviation.abs();
    if deviation.is_nan() { f64::INFINITY } else { worst.max(deviation) }
}

fn tensors(own: &Frame, other: &Frame) -> [(Quantity, f64); 9] {
    let (mut agents, mut lanes, mut crosswalks) = (Worst::default(), Worst::default(), Worst::default());
    for row in 0..HISTORY {
        agents.agent(&own.ego[row], &other.ego[row]);
        for neighbor in 0..NEIGHBORS {
            agents.agent(&own.neighbors[neighbor][row], &other.neighbors[neighbor][row]);
        }
    }
    for (own, other) in own.lanes.as_flattened().iter().zip(other.lanes.as_flattened()) {
        for start in [0, 3, 6] {
            lanes.pose(&own[start..], &other[start..]);
        }
        lanes.speed_limits = larger(lanes.speed_limits, f64::from(own[9]) - f64::from(other[9]));
        lanes.same(&own[10..], &other[10..]);
    }
    for (own, other) in own.crosswalks.as_flattened().iter().zip(other.crosswalks.as_flattened()) {
        crosswalks.pose(own, other);
    }
    [
        (CODES, (agents.others + lanes.others) as f64),
        (SPEED_LIMITS, lanes.speed_limits),
        (AGENT_POSITIONS, agents.positions),
        (AGENT_HEADINGS, agents.headings),
        (VELOCITIES, agents.velocities),
        (LANE_POSITIONS, lanes.positions),
        (LANE_HEADINGS, lanes.headings),
        (CROSSWALK_POSITIONS, crosswalks.positions),
        (CROSSWALK_HEADINGS, crosswalks.headings),
    ]
}
