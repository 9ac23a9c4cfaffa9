//! Boxes without a size, and boxes whose size jumps: mended by the track's other states, or by what road users of its kind measure.

use crate::scene::{AgentKind, AgentState, Scene, Steps, Track, TrackId};

/// What is smaller (m) is flat: the smallest side in 471 real scenes has 0.34 m.
const SMALLEST: f64 = 0.1;

/// What is longer (m) is nothing that drives on a road: the longest vehicle in 471 real scenes has 19.7 m.
const LARGEST: f64 = 50.0;

/// More than so many times the median, or less than its so many-th part, is a jump. In 471 real scenes 0.1 % of tracks have one.
const JUMP: f64 = 2.0;

/// What a driver has seen of a size: so many states.
const STATES_BEFORE: usize = 10;

/// Where a mended size comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SizeSource {
    /// The median of the track's other states.
    Median,
    /// What road users of its kind measure: the track has no size at all.
    Kind,
    /// Nothing tells: the track is of no known kind either. It is taken for a metre each way, and collisions with it cannot be
    /// judged.
    Nothing,
}

/// What was done about a track's sizes.
#[derive(Clone, Debug, PartialEq)]
pub struct MendedSize {
    /// The track's place in the scene.
    pub track: usize,
    /// Its number.
    pub id: TrackId,
    /// What it is.
    pub kind: AgentKind,
    /// Where its size was none, or jumped.
    pub steps: Steps,
    /// Where the sizes come from that it was given there.
    pub source: SizeSource,
    /// Length, width and height (m) that it was given.
    pub size: [f64; 3],
}

/// Length, width and height (m) that are usual for a kind: medians of 27,900 tracks of 471 real scenes. None for what may be anything.
#[must_use]
pub fn usual_size(kind: AgentKind) -> Option<[f64; 3]> {
    match kind {
        AgentKind::Vehicle => Some([4.6, 2.1, 1.7]),
        AgentKind::Pedestrian => Some([0.9, 0.8, 1.7]),
        AgentKind::Cyclist => Some([1.9, 0.9, 1.8]),
        AgentKind::Other => None,
    }
}

/// What stands for a size of which nothing is known (m).
const UNKNOWN: [f64; 3] = [1.0; 3];

fn size(state: &AgentState) -> [f64; 3] {
    [state.length, state.width, state.height]
}

fn set(state: &mut AgentState, [length, width, height]: [f64; 3]) {
    (state.length, state.width, state.height) = (length, width, height);
}

fn is_one(value: f64) -> bool {
    (SMALLEST..=LARGEST).contains(&value)
}

/// Whether a size of the track may have to be mended: none of those that need it is missed.
pub(super) fn need_mending(scene: &Scene, track: usize) -> bool {
    if scene.without_size.range((track, 0)..(track + 1, 0)).next().is_some() {
        return true;
    }
    let (mut least, mut most) = ([f64::INFINITY; 3], [0.0; 3]);
    for state in scene.tracks()[track].states.iter().flatten() {
        for (side, value) in size(state).into_iter().enumerate() {
            least[side] = f64::min(least[side], value);
            most[side] = f64::max(most[side], value);
        }
    }
    (0..3).any(|side| least[side] < SMALLEST || most[side] > LARGEST || most[side] > JUMP * least[side])
}

/// Mends the sizes of a track by all its states; `None` where there was nothing to mend.
pub(super) fn mend(states: &mut [Option<AgentState>], index: usize, track: &Track) -> Option<MendedSize> {
    let (usual, source) = usual(states.iter().flatten(), track.kind);
    let mut steps = Steps::default();
    for (step, state) in states.iter_mut().enumerate() {
        let Some(state) = state else { continue };
        let mended = mended(size(state), usual);
        if mended != size(state) {
            set(state, mended);
            steps.push(step);
        }
    }
    let Track { id, kind, .. } = *track;
    (!steps.is_empty()).then_some(MendedSize { track: index, id, kind, steps, source, size: usual })
}

/// The states with their sizes mended by what was seen before them.
pub(super) fn by_the_past(states: &[Option<AgentState>], kind: AgentKind) -> Vec<Option<AgentState>> {
    let mut before = std::collections::VecDeque::with_capacity(STATES_BEFORE);
    let mend = |state: &Option<AgentState>| {
        let mut state = (*state)?;
        if before.len() == STATES_BEFORE {
            before.pop_front();
        }
        before.push_back(state);
        let (usual, _) = usual(before.iter(), kind);
        let mended = mended(size(&state), usual);
        set(&mut state, mended);
        Some(state)
    };
    states.iter().map(mend).collect()
}

/// Side by side the median of these states' sizes; where they have none, the kind's.
fn usual<'a>(states: impl Iterator<Item = &'a AgentState>, kind: AgentKind) -> ([f64; 3], SizeSource) {
    let mut sides: [Vec<f64>; 3] = Default::default();
    for state in states {
        for (values, value) in sides.iter_mut().zip(size(state)) {
            values.extend(Some(value).filter(|value| is_one(*value)));
        }
    }
    let fallback = usual_size(kind);
    let mut source = SizeSource::Median;
    let mut usual = fallback.unwrap_or(UNKNOWN);
    for (side, values) in usual.iter_mut().zip(&mut sides) {
        if values.is_empty() {
            source = if fallback.is_some() { SizeSource::Kind } else { SizeSource::Nothing };
        } else {
            *side = median(values);
        }
    }
    (usual, source)
}

/// `size`, with those sides that are none or jump replaced by the usual ones.
fn mended(size: [f64; 3], usual: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|side| {
        let (value, usual) = (size[side], usual[side]);
        let jumps = value > JUMP * usual || value < usual / JUMP;
        if is_one(value) && !jumps { value } else { usual }
    })
}

/// The median, the lower of two; 0 of nothing.
pub(super) fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len().saturating_sub(1) / 2).copied().unwrap_or(0.0)
}
