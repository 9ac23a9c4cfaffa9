//! Signals that are unlisted, or listed as unknown, for a while.

use std::collections::{BTreeMap, BTreeSet};

use super::{LONGEST_GAP, SeenSignal};
use crate::map::MapId;
use crate::scene::Scene;
use crate::signal::{Signal, SignalState};

/// Signals of so many lanes are remembered at most: a scene of a damaged file must not grow with every step.
const MOST_LANES: usize = 1000;

/// The last step at which a lane's signal was known, and what it showed.
type Last = BTreeMap<MapId, (usize, Signal)>;

/// Whether `seen` tells what the signal of `lane` shows.
pub(super) fn is_known(seen: &SeenSignal, lane: MapId) -> bool {
    seen.signal.lane == lane && seen.signal.state != SignalState::Unknown
}

/// The signals of each step, with what unlisted and unknown ones showed last.
pub(super) fn by_the_past(scene: &Scene) -> Vec<Vec<SeenSignal>> {
    let mut last = Last::new();
    let at = |step: usize| {
        let listed = scene.signals(step);
        for signal in listed.iter().filter(|signal| signal.state != SignalState::Unknown) {
            remember(&mut last, step, *signal);
        }
        last.retain(|_, (seen, _)| step - *seen <= LONGEST_GAP);
        let held = |(seen, signal): &(usize, Signal)| SeenSignal { signal: *signal, unseen: (step - seen) as u32 };
        let now = |signal: &Signal| match last.get(&signal.lane).filter(|_| signal.state == SignalState::Unknown) {
            Some(known) => held(known),
            None => SeenSignal { signal: *signal, unseen: 0 },
        };
        let lanes: BTreeSet<MapId> = listed.iter().map(|signal| signal.lane).collect();
        let unlisted = last.iter().filter(|(lane, _)| !lanes.contains(lane)).map(|(_, known)| held(known));
        listed.iter().map(now).chain(unlisted).collect()
    };
    (0..scene.steps()).map(at).collect()
}

/// The signals of each step, with those gaps filled in before and after which a lane is shown the same; `None` where there is none.
pub(super) fn between(scene: &Scene) -> Option<Vec<Vec<Signal>>> {
    let mut last = Last::new();
    let mut put_in: BTreeMap<usize, BTreeMap<MapId, Signal>> = BTreeMap::new();
    for step in 0..scene.steps() {
        for signal in scene.signals(step).iter().filter(|signal| signal.state != SignalState::Unknown) {
            let Some((seen, before)) = remember(&mut last, step, *signal) else { continue };
            if step - seen <= LONGEST_GAP + 1 && before.state == signal.state {
                for gap in seen + 1..step {
                    put_in.entry(gap).or_default().insert(before.lane, before);
                }
            }
        }
    }
    (!put_in.is_empty())
        .then(|| (0..scene.steps()).map(|step| filled(scene.signals(step), put_in.remove(&step))).collect())
}

fn filled(listed: &[Signal], put_in: Option<BTreeMap<MapId, Signal>>) -> Vec<Signal> {
    let mut put_in = put_in.unwrap_or_default();
    let mut signals: Vec<Signal> = listed.iter().map(|s| put_in.remove(&s.lane).unwrap_or(*s)).collect();
    signals.extend(put_in.into_values());
    signals
}

/// Takes in what a signal shows at `step`; answers what was known of its lane before.
fn remember(last: &mut Last, step: usize, signal: Signal) -> Option<(usize, Signal)> {
    let room = last.len() < MOST_LANES || last.contains_key(&signal.lane);
    room.then(|| last.insert(signal.lane, (step, signal))).flatten()
}
