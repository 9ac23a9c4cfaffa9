//! All of a drive that can be seen: the scene around it, where the AV was, what it planned and what was predicted, and what happened. For
//! whoever draws it.
//!
//! ```text
//! scene ── agents, signals, the log's own AV ──┐
//! steps.parquet ── the AV after each step ─────┼─▶ Footage: frame 0 before the first step, frame k after k steps
//! episodes/ID.mcap ── plans, predictions ──────┘
//! ```

use std::collections::BTreeMap;
use std::sync::Arc;

use prost::Message as _;
use results::folder::recording_of;
use results::parquet::{ParquetError, Table};
use wire::proto;
use world::geometry::{Point, Pose};
use world::plan::{PlanState, UncheckedPlan, UncheckedPrediction};
use world::scene::{AgentState, Scene, TrackId};

use crate::compare::outcome::Fault;
use crate::drives::{Driven, Run};
use crate::recorded::{RecordedError, messages};
use crate::scenes::NOT_COUNTED;

/// What is read of `steps.parquet`, beside the AV's place and what brought it there.
pub const COLUMNS: [&str; 9] = [
    "speed_limit_mps",
    "events",
    "collision",
    "at_fault_collision",
    "off_route",
    "off_road",
    "red_light",
    "wrong_way",
    "step",
];

/// A drive.
#[derive(Debug)]
pub struct Footage {
    /// Where.
    pub scene: Arc<Scene>,
    /// Log index of frame 0.
    pub start: usize,
    /// Length and width of the AV (m).
    pub size: [f64; 2],
    /// Frame 0 is before the first step, frame k after k steps, 0.1 s apart.
    pub frames: Vec<Frame>,
    /// From which frame on whoever reacts is where he was driven to.
    pub reacts: BTreeMap<TrackId, usize>,
    /// What happened, in order.
    pub events: Vec<Event>,
    /// Where plans and predictions come from.
    pub recording: Recording,
}

/// The AV at a moment, and what it was about to do.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Where it is.
    pub av: PlanState,
    /// What brought it here (m/s^2); 0 in frame 0.
    pub acceleration: f64,
    /// The speed limit (m/s), where it is known.
    pub limit: Option<f64>,
    /// Where it plans to be, 0.1 s apart.
    pub plan: Vec<Point>,
    /// What is predicted, the likeliest first.
    pub futures: Vec<Future>,
}

/// A future that is predicted.
#[derive(Clone, Debug, Default)]
pub struct Future {
    /// How likely it is.
    pub probability: f64,
    /// Where agents will be, 0.1 s apart.
    pub tracks: Vec<(TrackId, Vec<Point>)>,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// The frame that shows it.
    pub frame: usize,
    /// The sentence on it.
    pub text: String,
    /// Whether a fault begins with it.
    pub is_fault: bool,
}

/// Where plans and predictions come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Recording {
    /// From the episode's recording.
    Read,
    /// There is none: nothing is known of them.
    Missing,
    /// There is one, which cannot be used, and why.
    Unusable(String),
}

impl Footage {
    /// A drive of `run`, and its recording if there is one. `driven` must have been read with [`COLUMNS`].
    ///
    /// # Errors
    /// [`ParquetError`] where a column is missing.
    pub fn of(run: &Run, driven: &Driven) -> Result<Self, ParquetError> {
        let mut footage = Self::unrecorded(run, driven)?;
        let path = recording_of(&run.folder, &run.file.scenes[driven.index].id);
        if path.exists() {
            let read = recording::load(&path).map_err(|error| error.to_string());
            footage.recording = match read.and_then(|bytes| footage.add_recording(&bytes)) {
                Ok(()) => Recording::Read,
                Err(why) => Recording::Unusable(why),
            };
        }
        Ok(footage)
    }

    fn unrecorded(run: &Run, driven: &Driven) -> Result<Self, ParquetError> {
        let scene = Arc::clone(&driven.scene);
        let start = driven.start as usize;
        let logged = scene.logged(scene.av_index(), start).copied();
        let any = || scene.av().states.iter().flatten().next().copied();
        let at_start = logged.or_else(any).unwrap_or_default();
        let av = PlanState { x: at_start.x, y: at_start.y, heading: at_start.heading, speed: at_start.speed() };
        let mut frames = vec![Frame { av, ..Frame::default() }];
        let mut events = Vec::new();
        if let Some(steps) = &driven.table {
            let numbers = steps.numbers()?;
            let limits = numbers.get("speed_limit_mps");
            for (step, (av, control)) in driven.states.iter().zip(&driven.controls).enumerate() {
                let limit = limits.and_then(|limits| limits.get(step)).copied().flatten();
                frames.push(Frame { av: *av, acceleration: control.acceleration, limit, ..Frame::default() });
            }
            events = self::events(steps, run.file.settings.protocol.name())?;
        }
        if let Some(second) = frames.get(1).and_then(|frame| frame.limit) {
            frames[0].limit = Some(second);
        }
        let size = [at_start.length, at_start.width].map(|side| if side > 0.0 { side } else { 1.0 });
        let reacts = reacts(driven.moved.iter().map(|moved| moved.iter().map(|moved| moved.track)));
        Ok(Self { scene, start, size, frames, reacts, events, recording: Recording::Missing })
    }

    fn add_recording(&mut self, bytes: &[u8]) -> Result<(), String> {
        for (step, (plan, futures)) in answers(bytes).map_err(|error| error.to_string())? {
            if let Some(frame) = self.frames.get_mut(step) {
                (frame.plan, frame.futures) = (plan, futures);
            }
        }
        Ok(())
    }

    /// Whether somebody reacts in a frame.
    #[must_use]
    pub fn is_reacting(&self, track: TrackId, frame: usize) -> bool {
        self.reacts.get(&track).is_some_and(|from| *from <= frame)
    }

    /// Where the log has its own AV in a frame.
    #[must_use]
    pub fn logged_av(&self, frame: usize) -> Option<&AgentState> {
        self.scene.logged(self.scene.av_index(), self.start + frame)
    }

    /// The log index of a frame; the last one the scene has where it ends before.
    #[must_use]
    pub fn log_index(&self, frame: usize) -> usize {
        (self.start + frame).min(self.scene.steps() - 1)
    }
}

/// The first frame after a step in which each was moved: he stays so.
fn reacts<Moved: Iterator<Item = TrackId>>(steps: impl Iterator<Item = Moved>) -> BTreeMap<TrackId, usize> {
    let mut reacts = BTreeMap::new();
    for (step, moved) in steps.enumerate() {
        for track in moved {
            reacts.entry(track).or_insert(step + 1);
        }
    }
    reacts
}

/// A plan, and the futures that were predicted for it.
pub type Answer = (Vec<Point>, Vec<Future>);

/// The plan and the futures of each step in the bytes of an MCAP file, as far as they are there.
///
/// # Errors
/// [`RecordedError`].
pub fn answers(bytes: &[u8]) -> Result<BTreeMap<usize, Answer>, RecordedError> {
    let mut answers: BTreeMap<usize, Answer> = BTreeMap::new();
    messages(bytes, |channel, data| {
        match channel {
            "plan" => {
                let told = proto::Plan::decode(data).map_err(|error| error.to_string())?;
                let plan = UncheckedPlan::try_from(told).map_err(|error| error.to_string())?;
                let points = plan.states.iter().map(|state| Point::new(state.x, state.y)).collect();
                answers.entry(plan.step as usize).or_default().0 = points;
            }
            "prediction" => {
                let told = proto::Prediction::decode(data).map_err(|error| error.to_string())?;
                let told = UncheckedPrediction::try_from(told).map_err(|error| error.to_string())?;
                let step = told.step as usize;
                answers.entry(step).or_default().1 = futures(told);
            }
            _ => {}
        }
        Ok(())
    })?;
    Ok(answers)
}

/// Numbers that no picture can show are left out.
fn futures(told: UncheckedPrediction) -> Vec<Future> {
    let points = |poses: Vec<Pose>| poses.iter().map(|pose| pose.position()).collect::<Vec<Point>>();
    let mut futures: Vec<Future> = told
        .futures
        .into_iter()
        .map(|future| Future {
            probability: future.probability,
            tracks: future.trajectories.into_iter().map(|one| (one.track, points(one.poses))).collect(),
        })
        .collect();
    futures.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    futures
}

/// What the rows of an episode tell, a line each.
fn events(steps: &Table, protocol: &str) -> Result<Vec<Event>, ParquetError> {
    let flags = Fault::flags(steps, protocol)?;
    let begins = |row: usize| flags.iter().any(|(_, set)| set[row] && (row == 0 || !set[row - 1]));
    let mut events = Vec::new();
    for (row, (step, text)) in steps.counts("step")?.into_iter().zip(steps.text("events")?).enumerate() {
        for line in text.lines() {
            let is_fault = begins(row) && !line.ends_with(NOT_COUNTED);
            events.push(Event { frame: step as usize + 1, text: line.to_owned(), is_fault });
        }
    }
    Ok(events)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_reacts_does_so_from_the_first_step_on_in_which_he_is_moved() {
        let steps: [&[i32]; 4] = [&[], &[7], &[7, 5], &[5]];
        let reacts = reacts(steps.iter().map(|moved| moved.iter().copied().map(TrackId)));
        assert_eq!(reacts, BTreeMap::from([(TrackId(7), 2), (TrackId(5), 3)]));
    }
}
