//! One example.

use std::collections::HashMap;

use network::Frame;
use network::Presence;
use network::constants::{
    AGENTS, CROSSWALK_ROW, CROSSWALKS, HISTORY, LANE_ROW, LANES, NEIGHBOR_ROW, NEIGHBORS, POINTS, STATE, STEPS,
};

/// One example: two seconds of the past, five of the future, in the AV's frame of the step between (m, rad, m/s).
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// The scene's id.
    pub scene: String,
    /// The step of the log that is now.
    pub step: u32,
    /// The track that is driven here as the AV.
    pub av: i32,
    /// What the network is shown.
    pub sketch: Sketch,
    /// The reference line, 1,200 samples 0.1 m apart, the AV at 200: x, y, heading, curvature, and the authors' information column
    /// (`planner.md` 1).
    pub line: Vec<[f32; 5]>,
    /// What the AV (row 0) and its neighbours did at the 50 steps after: x, y, heading, velocity x and y; 0 where they were not seen.
    pub future: Box<[[[f32; 5]; STEPS]; AGENTS]>,
    /// At which of those steps each was seen.
    pub seen: Box<[[bool; STEPS]; AGENTS]>,
}

/// A [`Frame`] in which each lane point and crosswalk point is written once, however many agents look at it.
#[derive(Clone, Debug, PartialEq)]
pub struct Sketch {
    /// As in [`Frame`].
    pub ego: [[f32; STATE]; HISTORY],
    /// As in [`Frame`].
    pub neighbors: [[[f32; NEIGHBOR_ROW]; HISTORY]; NEIGHBORS],
    /// As in [`Frame`].
    pub presence: Presence,
    /// Different lane points.
    pub lane_points: Vec<[f32; LANE_ROW]>,
    /// For each of [`AGENTS`] x [`LANES`] slots its points, by their numbers; none where the slot is empty.
    pub lanes: Vec<Option<[u16; POINTS]>>,
    /// Different points of crosswalks.
    pub crosswalk_points: Vec<[f32; CROSSWALK_ROW]>,
    /// For each of [`AGENTS`] x [`CROSSWALKS`] slots its points.
    pub crosswalks: Vec<Option<[u16; POINTS]>>,
}

impl Sketch {
    /// The sketch of a frame.
    #[must_use]
    pub fn of(frame: &Frame) -> Self {
        let (lane_points, lanes) = distinct(&frame.lanes);
        let (crosswalk_points, crosswalks) = distinct(&frame.crosswalks);
        debug_assert!(lanes.len() == AGENTS * LANES && crosswalks.len() == AGENTS * CROSSWALKS);
        Self {
            ego: frame.ego,
            neighbors: frame.neighbors,
            presence: frame.presence.clone(),
            lane_points,
            lanes,
            crosswalk_points,
            crosswalks,
        }
    }

    /// The frame again.
    #[must_use]
    pub fn frame(&self) -> Frame {
        Frame {
            ego: self.ego,
            neighbors: self.neighbors,
            lanes: whole(&self.lane_points, &self.lanes),
            crosswalks: whole(&self.crosswalk_points, &self.crosswalks),
            presence: self.presence.clone(),
        }
    }
}

/// The slots with the points themselves.
fn whole<const N: usize>(points: &[[f32; N]], slots: &[Option<[u16; POINTS]>]) -> Vec<[[f32; N]; POINTS]> {
    let point = |number: u16| points.get(usize::from(number)).copied().unwrap_or([0.0; N]);
    slots.iter().map(|slot| slot.map_or([[0.0; N]; POINTS], |numbers| numbers.map(point))).collect()
}

impl Window {
    /// Whether every number is one.
    pub(super) fn is_finite(&self) -> bool {
        let Sketch { ego, neighbors, lane_points, crosswalk_points, .. } = &self.sketch;
        let parts = [
            ego.as_flattened(),
            neighbors.as_flattened().as_flattened(),
            lane_points.as_flattened(),
            crosswalk_points.as_flattened(),
            self.line.as_flattened(),
            self.future.as_flattened().as_flattened(),
        ];
        parts.into_iter().flatten().all(|value| value.is_finite())
    }
}

/// Different points in the order in which they are met, and each slot's by number; a slot of zeros alone is empty.
fn distinct<const N: usize>(slots: &[[[f32; N]; POINTS]]) -> (Vec<[f32; N]>, Vec<Option<[u16; POINTS]>>) {
    let mut points = Vec::new();
    let mut known: HashMap<[u32; N], u16> = HashMap::new();
    let mut place = |point: &[f32; N]| {
        *known.entry(point.map(f32::to_bits)).or_insert_with(|| {
            points.push(*point);
            (points.len() - 1) as u16 // at most 6,600 points
        })
    };
    let slots = slots
        .iter()
        .map(|slot| slot.as_flattened().iter().any(|value| *value != 0.0).then(|| slot.each_ref().map(&mut place)))
        .collect();
    (points, slots)
}
