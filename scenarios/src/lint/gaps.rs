//! Road users who are in the AV's way and are not listed throughout, and whose size is none or jumps.

use std::collections::BTreeMap;

use world::geometry::Point3;
use world::scene::bridged::Bridged;
use world::scene::{AgentState, Steps};

use super::Lint;
use super::way::{IN_THE_WAY, Way};

/// What is higher or lower (m) is on another level of the road.
const STOREY: f64 = 4.0;

/// Who is this near the AV (m) where the log begins or ends to list it does not come from, or go, out of sight.
const IN_SIGHT: f64 = 50.0;

pub(super) fn lint(bridged: &Bridged, way: &Way, lints: &mut Vec<Lint>) {
    drop_outs(bridged, way, lints);
    beginnings_and_ends(bridged, way, lints);
    lints.extend(bridged.mended_sizes().iter().cloned().map(Lint::Size));
}

fn place(state: &AgentState) -> Point3 {
    Point3::new(state.x, state.y, state.z)
}

fn drop_outs(bridged: &Bridged, way: &Way, lints: &mut Vec<Lint>) {
    let scene = bridged.judged();
    let mut by_track: BTreeMap<usize, (Steps, usize, bool)> = BTreeMap::new();
    for gap in bridged.gaps().iter().filter(|gap| gap.track != scene.av_index()) {
        let sides = [gap.before, gap.after].map(|step| scene.tracks()[gap.track].states[step]);
        if sides.iter().flatten().any(|state| way.holds(place(state), IN_THE_WAY, gap.before)) {
            let (steps, longest, bridged) = by_track.entry(gap.track).or_insert((Steps::default(), 0, true));
            (gap.before + 1..gap.after).for_each(|step| steps.push(step));
            *longest = (*longest).max(gap.steps());
            *bridged &= gap.bridged;
        }
    }
    lints.extend(by_track.into_iter().map(|(track, (steps, longest, bridged))| {
        let track = &scene.tracks()[track];
        Lint::TrackDropsOut { track: track.id, kind: track.kind, steps, longest, bridged }
    }));
}

/// Who is listed first, or last, right before the AV.
fn beginnings_and_ends(bridged: &Bridged, way: &Way, lints: &mut Vec<Lint>) {
    let scene = bridged.judged();
    let before_the_av = |state: &AgentState, step: usize| {
        let av = scene.av().states[step].filter(|av| (av.z - state.z).abs() <= STOREY);
        av.is_some_and(|av| {
            let seen = av.pose().to_body(state.position());
            seen.x > 0.0 && seen.norm() <= IN_SIGHT && way.holds(place(state), IN_THE_WAY, step)
        })
    };
    let others = scene.tracks().iter().enumerate().filter(|(index, _)| *index != scene.av_index());
    for (_, track) in others {
        let there = |step: &usize| track.states[*step].is_some();
        let (first, last) = ((0..scene.steps()).find(there), (0..scene.steps()).rfind(there));
        let at = |step: usize| track.states[step].as_ref().is_some_and(|state| before_the_av(state, step));
        if let Some(step) = first.filter(|step| *step > 0 && at(*step)) {
            lints.push(Lint::TrackAppears { track: track.id, kind: track.kind, step });
        }
        if let Some(step) = last.filter(|step| step + 1 < scene.steps() && at(*step)) {
            lints.push(Lint::TrackVanishes { track: track.id, kind: track.kind, step });
        }
    }
}
