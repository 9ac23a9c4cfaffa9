//! An episode as the authors' simulator wrote it down.

use std::fs;
use std::path::Path;

use episode::paper::sight::NEIGHBORS;
use serde::Deserialize;
use vectors::{Npz, NpzError};
use wire::proto::EndReason;

use super::error::VerifyError;

/// Columns of a stored reference line: x, y, heading, curvature, info.
pub const LINE_COLUMNS: usize = 5;
/// Rows of a stored reference line: every tenth of 1,200.
pub const LINE_ROWS: usize = 120;
/// Numbers of what a planner gets: 8 of the AV and of each neighbor.
pub const CURRENT: usize = (NEIGHBORS + 1) * 8;

/// The arrays, checked for their shapes; of N steps.
pub struct Vector {
    /// N + 1: x, y, heading, velocity, length, width, height.
    pub states: Vec<[f64; 8]>,
    /// N + 1: what was seen.
    pub sights: Vec<StoredSight>,
    /// N: what was judged.
    pub verdicts: Vec<Verdict>,
    /// Every tenth step: the observation before it, whole.
    pub observations: Vec<StoredObservation>,
    /// After each of 100 steps (m).
    pub position_errors: Vec<f64>,
    /// The file that goes with the arrays.
    pub end: Json,
}

/// What was seen at a step.
pub struct StoredSight {
    /// Places in the log, nearest first.
    pub neighbors: Vec<usize>,
    pub window_start: f64,
    pub window_rows: f64,
    pub lane: f64,
    /// Greatest of the info column.
    pub speed_limit: f64,
    /// First row with info 0, or -1; how many with 0 and with 1.
    pub rows: [f64; 3],
}

/// What was judged after a step.
pub struct Verdict {
    pub collision: bool,
    pub off_route: bool,
    pub collision_margin: f64,
    /// NaN where there was no route any more: then nothing else was judged.
    pub route_distance: f64,
}

/// The observation before a step.
pub struct StoredObservation {
    pub step: usize,
    pub line: [[f64; LINE_COLUMNS]; LINE_ROWS],
    pub current: [f64; CURRENT],
}

/// How the episode ended.
#[derive(Debug, Deserialize)]
pub struct Json {
    pub steps: usize,
    pub end_reason: Reason,
    pub metrics: Metrics,
}

/// Why it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    Horizon,
    LogEnd,
    Collision,
    OffRoute,
    RouteFailed,
    /// Whoever made the vectors had enough.
    Truncated,
}

impl Reason {
    /// As we call it; none where the simulator did not end the episode.
    pub fn ours(self) -> Option<EndReason> {
        match self {
            Self::Horizon => Some(EndReason::Horizon),
            Self::LogEnd => Some(EndReason::LogEnd),
            Self::Collision => Some(EndReason::Collision),
            Self::OffRoute => Some(EndReason::OffRoute),
            Self::RouteFailed => Some(EndReason::RouteLost),
            Self::Truncated => None,
        }
    }
}

/// The metrics; none where one is not defined.
#[derive(Debug, Deserialize)]
pub struct Metrics {
    pub collision: bool,
    pub off_route: bool,
    pub progress: Option<f64>,
    pub acc: Option<f64>,
    pub jerk: Option<f64>,
    pub lat_acc: Option<f64>,
    pub human_acc: Option<f64>,
    pub human_jerk: Option<f64>,
    pub human_lat_acc: Option<f64>,
    pub l2_3s: Option<f64>,
    pub l2_5s: Option<f64>,
    pub l2_10s: Option<f64>,
}

impl Metrics {
    /// By our names.
    pub fn named(&self) -> [(&'static str, Option<f64>); 12] {
        let flag = |is_so: bool| Some(f64::from(u8::from(is_so)));
        [
            ("collision", flag(self.collision)),
            ("off_route", flag(self.off_route)),
            ("progress_m", self.progress),
            ("mean_abs_acceleration_mps2", self.acc),
            ("mean_abs_jerk_mps3", self.jerk),
            ("mean_abs_lateral_acceleration_mps2", self.lat_acc),
            ("human_mean_abs_acceleration_mps2", self.human_acc),
            ("human_mean_abs_jerk_mps3", self.human_jerk),
            ("human_mean_abs_lateral_acceleration_mps2", self.human_lat_acc),
            ("position_error_3s_m", self.l2_3s),
            ("position_error_5s_m", self.l2_5s),
            ("position_error_10s_m", self.l2_10s),
        ]
    }
}

impl Vector {
    /// Reads the arrays, and the JSON file at `json`.
    ///
    /// # Errors
    /// [`VerifyError`] names what is missing or of another shape.
    pub fn read(npz: &Npz, json: &Path) -> Result<Self, VerifyError> {
        let text = fs::read(json).map_err(|source| VerifyError::Json { path: json.to_owned(), source })?;
        let content = |source| VerifyError::JsonContent { path: json.to_owned(), source };
        let end: Json = serde_json::from_slice(&text).map_err(content)?;
        let moments = end.steps.saturating_add(1);
        Ok(Self {
            states: npz.rows("av_state", &[Some(moments), Some(8)])?.to_vec(),
            sights: sights(npz, moments)?,
            verdicts: verdicts(npz, end.steps)?,
            observations: observations(npz)?,
            position_errors: npz.array("position_error", &[Some(100)])?.to_vec(),
            end,
        })
    }
}

fn sights(npz: &Npz, moments: usize) -> Result<Vec<StoredSight>, NpzError> {
    let neighbors = npz.rows::<NEIGHBORS>("neighbor_tracks", &[Some(moments), Some(NEIGHBORS)])?;
    let column = |name| npz.array(name, &[Some(moments)]);
    let (start, rows) = (column("route_start")?, column("route_rows")?);
    let (lane, limit) = (column("lane_id")?, column("speed_limit")?);
    let (red_first, red, crosswalk) = (column("red_first")?, column("red_count")?, column("crosswalk_count")?);
    let sight = |at: usize| StoredSight {
        neighbors: neighbors[at].iter().filter(|track| **track >= 0.0).map(|track| *track as usize).collect(),
        window_start: start[at],
        window_rows: rows[at],
        lane: lane[at],
        speed_limit: limit[at],
        rows: [red_first[at], red[at], crosswalk[at]],
    };
    Ok((0..moments).map(sight).collect())
}

fn verdicts(npz: &Npz, steps: usize) -> Result<Vec<Verdict>, NpzError> {
    let column = |name| npz.array(name, &[Some(steps)]);
    let (collision, off_route) = (column("collision")?, column("off_route")?);
    let (margin, distance) = (column("collision_margin")?, column("route_distance")?);
    let verdict = |at: usize| Verdict {
        collision: collision[at] != 0.0,
        off_route: off_route[at] != 0.0,
        collision_margin: margin[at],
        route_distance: distance[at],
    };
    Ok((0..steps).map(verdict).collect())
}

fn observations(npz: &Npz) -> Result<Vec<StoredObservation>, NpzError> {
    let steps = npz.array("every10_step", &[None])?;
    let count = Some(steps.len());
    let rows = npz.rows::<LINE_COLUMNS>("every10_ref_line", &[count, Some(LINE_ROWS), Some(LINE_COLUMNS)])?;
    let currents = npz.rows::<CURRENT>("every10_current_state", &[count, Some(NEIGHBORS + 1), Some(8)])?;
    let lines = rows.as_chunks::<LINE_ROWS>().0;
    let observation =
        |at: usize| StoredObservation { step: steps[at] as usize, line: lines[at], current: currents[at] };
    Ok((0..steps.len()).map(observation).collect())
}
