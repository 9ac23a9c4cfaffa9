//! Scenes: one logged stretch of traffic, checked and immutable.
//!
//! A reader of any format fills [`SceneParts`]; [`SceneParts::check`] makes a [`Scene`] of it, or says why not. What a scene
//! can do without is dropped and reported as a [`Finding`]; what it cannot do without is a [`SceneError`].

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use thiserror::Error;

use crate::geometry::{OrientedBox, Point, Pose};
use crate::map::{Map, MapId};
use crate::signal::Signal;

pub mod bridged;
mod check;
mod steps;
mod unjudged;

pub use steps::Steps;
pub use unjudged::{Judgement, Unjudged};

/// The name of a scene: 1 to 128 of `A-Z a-z 0-9 _ . -`, not beginning with a dot; so it is a file name and a bus key as it is.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SceneId(String);

impl SceneId {
    /// The id, if `text` can be one.
    ///
    /// # Errors
    /// [`SceneError::BadId`].
    pub fn new(text: impl Into<String>) -> Result<Self, SceneError> {
        let text = text.into();
        let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.' | '-');
        if text.is_empty() || text.len() > 128 || text.starts_with('.') || !text.chars().all(allowed) {
            return Err(SceneError::BadId(text.chars().take(140).collect()));
        }
        Ok(Self(text))
    }

    /// The id as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for SceneId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// The number of a track, unique in its scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TrackId(pub i32);

impl fmt::Display for TrackId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// What a road user is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum AgentKind {
    /// A car, truck, bus or motorcycle.
    Vehicle,
    /// Somebody on foot.
    Pedestrian,
    /// Somebody on a bicycle.
    Cyclist,
    /// Anything else, and what is not said.
    #[default]
    Other,
}

impl fmt::Display for AgentKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Vehicle => "vehicle",
            Self::Pedestrian => "pedestrian",
            Self::Cyclist => "cyclist",
            Self::Other => "other",
        })
    }
}

/// A road user at one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AgentState {
    /// Centre of the box, x (m).
    pub x: f64,
    /// Centre of the box, y (m).
    pub y: f64,
    /// Centre of the box, z (m); not the ground.
    pub z: f64,
    /// Direction of the front (rad); continuous over a track rather than wrapped.
    pub heading: f64,
    /// Velocity along the log's x axis (m/s).
    pub velocity_x: f64,
    /// Velocity along the log's y axis (m/s).
    pub velocity_y: f64,
    /// Length of the box (m).
    pub length: f64,
    /// Width of the box (m).
    pub width: f64,
    /// Height of the box (m).
    pub height: f64,
}

impl AgentState {
    /// Place and heading.
    #[must_use]
    pub fn pose(&self) -> Pose {
        Pose::new(self.x, self.y, self.heading)
    }

    /// Place.
    #[must_use]
    pub fn position(&self) -> Point {
        Point::new(self.x, self.y)
    }

    /// Velocity (m/s).
    #[must_use]
    pub fn velocity(&self) -> Point {
        Point::new(self.velocity_x, self.velocity_y)
    }

    /// Speed (m/s), never negative.
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.velocity().norm()
    }

    /// The box seen from above.
    #[must_use]
    pub fn oriented_box(&self) -> OrientedBox {
        OrientedBox::new(self.pose(), self.length, self.width)
    }

    /// Whether place, heading and velocity are numbers to reckon with.
    fn has_place(&self) -> bool {
        [self.x, self.y, self.z, self.heading, self.velocity_x, self.velocity_y].into_iter().all(is_in_range)
    }

    /// Whether the size can be a size, flat boxes and points included.
    fn has_size(&self) -> bool {
        [self.length, self.width, self.height].into_iter().all(is_size)
    }
}

fn is_size(value: f64) -> bool {
    (0.0..=1e3).contains(&value)
}

/// Stands for a size that is none.
const NO_SIZE: f64 = -1.0;

/// The largest number that a place, a heading, a speed or a control may have: 1e7 m is past any map, and beyond it squares of
/// distances lose their millimetres.
pub const LARGEST_NUMBER: f64 = 1e7;

/// Whether `value` is a number of at most [`LARGEST_NUMBER`], either way.
#[must_use]
pub fn is_in_range(value: f64) -> bool {
    value.abs() <= LARGEST_NUMBER
}

/// A logged road user over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    /// Its number.
    pub id: TrackId,
    /// What it is.
    pub kind: AgentKind,
    /// Its state at each step; `None` where it was not seen.
    pub states: Vec<Option<AgentState>>,
}

/// How hard a track is to predict, by the data set's word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrackToPredict {
    /// Place in [`SceneParts::tracks`].
    pub track_index: usize,
    /// 0 not said, 1 or 2.
    pub difficulty: i32,
}

/// A scene as a reader found it, unchecked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneParts {
    /// Its name.
    pub id: String,
    /// Time of each step (s); nominally 0.1 s apart.
    pub timestamps: Vec<f64>,
    /// All road users, the AV among them.
    pub tracks: Vec<Track>,
    /// Place of the AV in `tracks`.
    pub av_index: usize,
    /// What signals show at each step; as long as `timestamps`, or empty.
    pub signals: Vec<Vec<Signal>>,
    /// The map.
    pub map: Map,
    /// Last step of the history in prediction tasks; meaningless in 20 s scenes.
    pub current_time_index: usize,
    /// Tracks that interact.
    pub objects_of_interest: Vec<TrackId>,
    /// Tracks that a prediction task asks for.
    pub tracks_to_predict: Vec<TrackToPredict>,
}

/// A scene that holds what its type promises: at least one step, every track as long as the scene, every number finite,
/// ids unique, the AV among the tracks, links between lanes whole.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    id: SceneId,
    parts: SceneParts,
    map: Arc<Map>,
    /// States whose place is known and whose size is not, by track and step: tracks have no state there, but somebody was.
    without_size: BTreeMap<(usize, usize), AgentState>,
}

/// Why a scene cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum SceneError {
    #[error("scene id {0:?} is not 1 to 128 of A-Z a-z 0-9 _ . - beginning with something but a dot")]
    BadId(String),
    #[error("it has no steps: no timestamps are given")]
    NoSteps,
    #[error("it has no tracks")]
    NoTracks,
    #[error("the AV's index is {index}, but there are {tracks} tracks")]
    AvIndex { index: i64, tracks: usize },
    #[error("track {track} has {states} states, but the scene has {steps} steps")]
    TrackLength { track: TrackId, states: usize, steps: usize },
    #[error("two tracks have the id {0}")]
    DuplicateTrack(TrackId),
    #[error("the AV (track {0}) is valid at no step")]
    AvNeverValid(TrackId),
    #[error("timestamp {step} is not finite")]
    Timestamp { step: usize },
    #[error("signals are given for {signals} steps, but the scene has {steps}")]
    SignalLength { signals: usize, steps: usize },
}

/// Something odd in a scene that can still be used; what was done about it is part of the text.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum Finding {
    #[error("track {track} is valid at no step")]
    EmptyTrack { track: TrackId },
    #[error("track {track} has an unusable state at {steps} (not finite, or out of range): taken as not valid")]
    BadState { track: TrackId, steps: Steps },
    #[error("the AV is not valid at {missing} of {steps} steps, first at step {first}")]
    AvGaps { missing: usize, steps: usize, first: usize },
    #[error("lane {lane} names lane {missing}, which is not in the map: link dropped")]
    DanglingLane { lane: MapId, missing: MapId },
    #[error("lane {lane} names boundary {missing}, which is not in the map: boundary dropped")]
    DanglingBoundary { lane: MapId, missing: MapId },
    #[error("stop sign {sign} names lane {missing}, which is not in the map: link dropped")]
    DanglingStopSign { sign: MapId, missing: MapId },
    #[error("lane {lane} has lane {neighbor} beside it over points that are not there: neighbour dropped")]
    BadNeighbor { lane: MapId, neighbor: MapId },
    #[error("lane {from} leads to lane {to}, but {to} does not name {from} as its entry")]
    OneWayLink { from: MapId, to: MapId },
    #[error(
        "a signal is given for lane {lane}, which is not in the map (first at step {step}): kept, its stop point counts"
    )]
    SignalWithoutLane { lane: MapId, step: usize },
    #[error("a signal of lane {lane} has an unusable stop point at {steps}: dropped")]
    BadSignal { lane: MapId, steps: Steps },
    #[error("two signals are given for lane {lane} at {steps}: the later one dropped")]
    DuplicateSignal { lane: MapId, steps: Steps },
    #[error("map feature {0} has an unusable point (not finite, or out of range) or no point: dropped")]
    BadFeature(MapId),
    #[error("two map features have the id {0}: the later one dropped")]
    DuplicateFeature(MapId),
    #[error("lane {0} has a single point")]
    OnePointLane(MapId),
    #[error("lane {lane} has the speed limit {text} mph, which cannot be: taken as not known")]
    BadSpeedLimit { lane: MapId, text: String },
    #[error("the time goes back at step {step}: steps are taken as 0.1 s")]
    TimeGoesBack { step: usize },
    #[error("object of interest {0} is not a track: dropped")]
    UnknownObjectOfInterest(TrackId),
    #[error("track to predict {index} is not a track's place: dropped")]
    UnknownTrackToPredict { index: i64 },
    #[error(
        "the data set gives no sizes: those of all {tracks} tracks are what is usual for their types, and contacts are judged by them"
    )]
    AssumedSizes { tracks: usize },
    #[error(
        "the file has no lane graph: {links} links of its {lanes} lanes were made where one ends and another begins; which lie beside each other is not known"
    )]
    LinkedByPlace { lanes: usize, links: usize },
    #[error("the file gives no speed limits: {lanes} lanes of motorways have been given the usual 65 mph")]
    AssumedSpeedLimits { lanes: usize },
    #[error(
        "all {most} places that the file has for {what} are taken: there were more, as a rule, which it leaves out"
    )]
    Full { what: &'static str, most: usize },
    #[error("current_time_index {index} is outside the scene: taken as the nearest step")]
    CurrentTimeIndex { index: i64 },
}

impl Scene {
    /// Its name.
    #[must_use]
    pub fn id(&self) -> &SceneId {
        &self.id
    }

    /// Number of steps.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.parts.timestamps.len()
    }

    /// Time of each step (s), as logged. The simulation counts in steps of 0.1 s whatever these say.
    #[must_use]
    pub fn timestamps(&self) -> &[f64] {
        &self.parts.timestamps
    }

    /// All tracks, the AV's among them, in the file's order.
    #[must_use]
    pub fn tracks(&self) -> &[Track] {
        &self.parts.tracks
    }

    /// The state of track number `track` at `step` as it lies in the file, also where its size cannot be one: the numbers that
    /// are none are then -1, and [`Scene::tracks`] has no state there.
    #[must_use]
    pub fn logged(&self, track: usize, step: usize) -> Option<&AgentState> {
        let state = self.parts.tracks.get(track)?.states.get(step)?.as_ref();
        state.or_else(|| self.without_size.get(&(track, step)))
    }

    /// Place of the AV in [`Scene::tracks`].
    #[must_use]
    pub fn av_index(&self) -> usize {
        self.parts.av_index
    }

    /// The logged AV: "the human".
    #[must_use]
    pub fn av(&self) -> &Track {
        &self.parts.tracks[self.parts.av_index]
    }

    /// What signals show at `step`; nothing past the end.
    #[must_use]
    pub fn signals(&self, step: usize) -> &[Signal] {
        self.parts.signals.get(step).map_or(&[], Vec::as_slice)
    }

    /// The map.
    #[must_use]
    pub fn map(&self) -> &Arc<Map> {
        &self.map
    }

    /// Last step of the history in prediction tasks.
    #[must_use]
    pub fn current_time_index(&self) -> usize {
        self.parts.current_time_index
    }

    /// Tracks that interact.
    #[must_use]
    pub fn objects_of_interest(&self) -> &[TrackId] {
        &self.parts.objects_of_interest
    }

    /// Tracks that a prediction task asks for.
    #[must_use]
    pub fn tracks_to_predict(&self) -> &[TrackToPredict] {
        &self.parts.tracks_to_predict
    }

    /// The same scene in which these tracks, by their places, were in these states: one a step, none beyond those given.
    #[must_use]
    pub fn with_states(&self, states: impl IntoIterator<Item = (usize, Vec<Option<AgentState>>)>) -> Self {
        let mut scene = self.clone();
        for (place, mut states) in states {
            states.resize(self.steps(), None);
            if let Some(track) = scene.parts.tracks.get_mut(place) {
                track.states = states;
                scene.without_size.retain(|(track, _), _| *track != place);
            }
        }
        scene
    }

    /// The parts again, to be changed and checked anew.
    #[must_use]
    pub fn into_parts(self) -> SceneParts {
        let mut parts = SceneParts { id: self.id.0, map: Arc::unwrap_or_clone(self.map), ..self.parts };
        for ((track, step), state) in self.without_size {
            parts.tracks[track].states[step] = Some(state);
        }
        parts
    }
}
