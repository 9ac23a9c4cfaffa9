//! What a scene leaves out, filled in and marked: absence of data is not absence of the thing.
//!
//! A log is what sensors saw. A car behind a truck is not listed for a while, a signal is read as unknown, a box has no size.
//! [`Bridged`] is the scene as `strict` takes it; `paper` takes the [`Scene`] as it lies. Two sides are told apart:
//!
//! | side | what it gets | where |
//! | --- | --- | --- |
//! | judges | what was there, by the states on either side of a gap | [`Bridged::judged`] |
//! | observations | what a driver could suppose, by the past alone | [`Bridged::observed`], [`Bridged::observed_signals`] |
//!
//! Nothing of the observations' side depends on a later step: it is reckoned from `..=step` of the log.
//!
//! | module | what |
//! | --- | --- |
//! | `tracks` | gaps: between two states, and on from the last |
//! | `sizes` | boxes without a size, and those that jump |
//! | `signals` | signals that are unlisted or unknown for a while |
//! | `lanes` | centre lines of few points |

mod lanes;
mod signals;
mod sizes;
#[cfg(test)]
mod tests;
mod tracks;

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{AgentState, Scene, SceneParts, Track, TrackId};
use crate::map::MapId;
use crate::signal::Signal;

pub use lanes::{SPACING, SPARSE};
pub use sizes::{MendedSize, SizeSource, usual_size};
pub use tracks::TrackGap;

/// The longest time that is filled in (steps of 0.1 s): 3 s. In 471 real scenes 99.8 % of 17,400 gaps were of 9 steps at most, and
/// the longest had 23.
pub const LONGEST_GAP: usize = 30;

/// A road user as it is supposed to be at a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenAgent {
    /// Where it is; its size is always one.
    pub state: AgentState,
    /// Steps since it was last logged: 0 where it is logged at this very step.
    pub unseen: u32,
}

/// A signal as it is supposed to be at a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenSignal {
    /// What is shown.
    pub signal: Signal,
    /// Steps since that was last listed and known: 0 where it is at this very step.
    pub unseen: u32,
}

/// A scene with its gaps filled in.
#[derive(Clone, Debug)]
pub struct Bridged {
    logged: Arc<Scene>,
    judged: Arc<Scene>,
    /// Tracks whose sizes had to be mended, with sizes by the past alone; all others are as they are logged.
    resized: BTreeMap<usize, Vec<Option<AgentState>>>,
    mended_sizes: Vec<MendedSize>,
    gaps: Vec<TrackGap>,
    observed_signals: Vec<Vec<SeenSignal>>,
    sparse_lanes: Vec<MapId>,
}

impl Bridged {
    /// The bridged view of `scene`. Where nothing is missing, [`Bridged::judged`] is `scene` itself.
    #[must_use]
    pub fn of(scene: &Arc<Scene>) -> Self {
        let mut resized = BTreeMap::new();
        let mut tracks: BTreeMap<usize, Vec<Option<AgentState>>> = BTreeMap::new();
        let (mut mended_sizes, mut gaps) = (Vec::new(), Vec::new());
        for (index, track) in scene.tracks().iter().enumerate() {
            let logged = || (0..scene.steps()).map(|step| scene.logged(index, step).copied()).collect::<Vec<_>>();
            if sizes::need_mending(scene, index) {
                let mut states = logged();
                resized.insert(index, sizes::by_the_past(&states, track.kind));
                mended_sizes.extend(sizes::mend(&mut states, index, track));
                tracks.insert(index, states);
            }
            let found = tracks::gaps(tracks.get(&index).unwrap_or(&track.states));
            for (before, after) in found {
                let states = tracks.entry(index).or_insert_with(logged);
                let bridged = tracks::bridge(states, before, after);
                gaps.push(TrackGap { track: index, before, after, bridged });
            }
        }
        let signals = signals::between(scene);
        let (map, sparse_lanes) = lanes::resampled(scene.map());
        let judged = if tracks.is_empty() && signals.is_none() && sparse_lanes.is_empty() {
            Arc::clone(scene)
        } else {
            let map = map.map_or_else(|| Arc::clone(scene.map()), Arc::new);
            let of = |(index, track): (usize, &Track)| match tracks.remove(&index) {
                Some(states) => Track { id: track.id, kind: track.kind, states },
                None => track.clone(),
            };
            let parts = &scene.parts;
            Arc::new(Scene {
                id: scene.id.clone(),
                parts: SceneParts {
                    tracks: parts.tracks.iter().enumerate().map(of).collect(),
                    signals: signals.unwrap_or_else(|| parts.signals.clone()),
                    id: String::new(),
                    timestamps: parts.timestamps.clone(),
                    av_index: parts.av_index,
                    map: crate::map::Map::default(),
                    current_time_index: parts.current_time_index,
                    objects_of_interest: parts.objects_of_interest.clone(),
                    tracks_to_predict: parts.tracks_to_predict.clone(),
                },
                map,
                without_size: BTreeMap::new(),
            })
        };
        let observed_signals = signals::by_the_past(scene);
        Self { logged: Arc::clone(scene), judged, resized, mended_sizes, gaps, observed_signals, sparse_lanes }
    }

    /// The scene as it lies in its file.
    #[must_use]
    pub fn logged(&self) -> &Arc<Scene> {
        &self.logged
    }

    /// The scene as judges take it: gaps in tracks filled between the states on either side, the AV's own too; sizes mended;
    /// a signal that shows the same before and after a gap shown throughout; centre lines of about 0.5 m.
    ///
    /// A track has no state before it is first listed, after it is last listed, and in a gap of more than [`LONGEST_GAP`] steps.
    #[must_use]
    pub fn judged(&self) -> &Arc<Scene> {
        &self.judged
    }

    /// Steps since track number `track` was last logged, for a step at which [`Bridged::judged`] has a state of it: 0 where that
    /// state is logged, more where it is bridged. `None` where there is no state.
    #[must_use]
    pub fn unseen(&self, track: usize, step: usize) -> Option<u32> {
        self.judged.tracks().get(track)?.states.get(step)?.as_ref()?;
        (0..=step).rev().position(|at| self.logged.logged(track, at).is_some()).map(|steps| steps as u32)
    }

    /// Track number `track` as a driver may suppose it at `step`: as logged, or on from where it was last, at the speed of then,
    /// for [`LONGEST_GAP`] steps. It does not depend on any step after `step`.
    #[must_use]
    pub fn observed(&self, track: usize, step: usize) -> Option<SeenAgent> {
        tracks::supposed(self.past(track, step)?)
    }

    /// For how many steps, `step` included, a driver has had track number `track` before its eyes: logged, or not logged for
    /// [`LONGEST_GAP`] steps at most. 1 at the step at which it appears; `None` where it is not to be seen.
    #[must_use]
    pub fn visible_for(&self, track: usize, step: usize) -> Option<u32> {
        tracks::visible_for(self.past(track, step)?)
    }

    /// For how many steps in a row, `step` included, track number `track` has been logged: 0 where it is not logged at `step`.
    #[must_use]
    pub fn logged_for(&self, track: usize, step: usize) -> u32 {
        (0..=step).rev().take_while(|at| self.logged.logged(track, *at).is_some()).count() as u32
    }

    fn past(&self, track: usize, step: usize) -> Option<&[Option<AgentState>]> {
        let states = match self.resized.get(&track) {
            Some(states) => states,
            None => &self.logged.tracks().get(track)?.states,
        };
        states.get(..=step)
    }

    /// The signals as a driver may suppose them at `step`: as listed; where one is unlisted or unknown, what it showed last, for
    /// [`LONGEST_GAP`] steps. Listed ones come first, in the file's order. It does not depend on any step after `step`.
    #[must_use]
    pub fn observed_signals(&self, step: usize) -> &[SeenSignal] {
        self.observed_signals.get(step).map_or(&[], Vec::as_slice)
    }

    /// For how many steps, `step` included, a driver has known what the signal of `lane` shows, gaps of [`LONGEST_GAP`] steps at
    /// most counted in; `None` where it does not know.
    #[must_use]
    pub fn signal_known_for(&self, lane: MapId, step: usize) -> Option<u32> {
        let known = |at: &usize| self.observed_signals(*at).iter().any(|seen| signals::is_known(seen, lane));
        let steps = (0..=step).rev().take_while(known).count();
        (steps > 0).then_some(steps as u32)
    }

    /// The gaps in tracks, in the tracks' order.
    #[must_use]
    pub fn gaps(&self) -> &[TrackGap] {
        &self.gaps
    }

    /// What was done about sizes, one entry a track, in the tracks' order.
    #[must_use]
    pub fn mended_sizes(&self) -> &[MendedSize] {
        &self.mended_sizes
    }

    /// Lanes whose centre lines have points farther apart than [`SPARSE`], in the map's order.
    #[must_use]
    pub fn sparse_lanes(&self) -> &[MapId] {
        &self.sparse_lanes
    }

    /// The id of track number `track`.
    #[must_use]
    pub fn track_id(&self, track: usize) -> Option<TrackId> {
        self.logged.tracks().get(track).map(|track| track.id)
    }
}
