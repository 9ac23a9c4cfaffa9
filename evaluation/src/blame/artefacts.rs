//! Agents that are the log's own mistakes, or may be: who drives can do nothing about them.

use std::collections::BTreeSet;
use std::sync::Arc;

use episode::judges::STOREY;
use scenarios::lint::{Lint, lint};
use world::geometry::boxes_overlap;
use world::scene::{Finding, Scene, TrackId};

use super::failure::Failure;

/// Whom the AV touches, and who was logged at fewer steps before, may have come out of nothing (2 s: what every driver has of history).
pub const YOUNG: usize = 20;

/// The tracks of `scene` that are artefacts to the drive that failed so: those that the logged AV itself overlaps at some step; those
/// listed right before it from a step on, and not before (both as `scenarios lint` finds them); and whom the AV touches at the fault, if
/// it was logged at fewer than [`YOUNG`] steps before. `findings` are those of the scene's reader.
#[must_use]
pub fn artefacts(scene: &Arc<Scene>, findings: &[Finding], failure: &Failure) -> Vec<TrackId> {
    let of_the_log = lint(scene, findings).into_iter().filter_map(|lint| match lint {
        Lint::AvOverlap { track, .. } | Lint::TrackAppears { track, .. } => Some(track),
        _ => None,
    });
    let mut tracks: BTreeSet<TrackId> = of_the_log.collect();
    if let Some(av) = &failure.av {
        let others = scene.tracks().iter().enumerate().filter(|(index, _)| *index != scene.av_index());
        let young = others.map(|(_, track)| track).filter(|track| {
            let now = track.states.get(av.log_index).copied().flatten();
            let touches = now.is_some_and(|state| {
                (state.z - av.z).abs() <= STOREY && boxes_overlap(&state.oriented_box(), &av.outline)
            });
            touches && track.states[..av.log_index].iter().flatten().count() < YOUNG
        });
        tracks.extend(young.map(|track| track.id));
    }
    tracks.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use scenarios::generated::{Family, Parameters};
    use world::geometry::OrientedBox;
    use world::scene::Track;

    use super::*;
    use crate::blame::failure::Seen;
    use crate::compare::outcome::Fault;

    /// A scene with one more track, that is where the AV was logged at index 60, from `first` on.
    fn scene(first: usize) -> (Arc<Scene>, Vec<Finding>, Failure) {
        let payload = Family::named("cruise").unwrap().payload("cruise", 1, 0, &Parameters::default()).unwrap();
        let mut parts = scenarios::womd::read(&payload).unwrap().0.into_parts();
        let av = parts.tracks[parts.av_index].states[60].unwrap();
        // Beside the way, so that the log's AV does not touch it: the AV that failed is there.
        let beside = world::scene::AgentState { y: av.y + 60.0, x: av.x + 60.0, ..av };
        let states = (0..parts.timestamps.len()).map(|step| (step >= first).then_some(beside)).collect();
        parts.tracks.push(Track { id: TrackId(9999), states, ..Track::default() });
        let (scene, findings) = parts.check().unwrap();
        let outline: OrientedBox = beside.oriented_box();
        let seen = Seen { log_index: 60, outline, z: beside.z };
        let failure = Failure { scene: String::new(), fault: Fault::Collision, step: 40, av: Some(seen) };
        (Arc::new(scene), findings, failure)
    }

    #[test]
    fn whom_the_av_touches_is_an_artefact_if_it_came_a_moment_before() {
        for (first, expected) in [(41, true), (40, false), (0, false)] {
            let (scene, findings, failure) = scene(first);
            assert_eq!(artefacts(&scene, &findings, &failure).contains(&TrackId(9999)), expected, "from {first}");
        }
    }

    #[test]
    fn whom_the_logged_av_overlaps_is_an_artefact_whatever_the_fault() {
        let payload = Family::named("cruise").unwrap().payload("cruise", 1, 0, &Parameters::default()).unwrap();
        let mut parts = scenarios::womd::read(&payload).unwrap().0.into_parts();
        let there = parts.tracks[parts.av_index].states[60].unwrap();
        let states = vec![Some(there); parts.timestamps.len()];
        parts.tracks.push(Track { id: TrackId(9999), states, ..Track::default() });
        let (scene, findings) = parts.check().unwrap();
        let failure = Failure { scene: String::new(), fault: Fault::OffRoad, step: 3, av: None };
        assert!(artefacts(&Arc::new(scene), &findings, &failure).contains(&TrackId(9999)));
    }
}
