//! What the AV and its neighbours did after a step, in the AV's frame (`training.md` 1).

use network::constants::{AGENTS, STEPS};
use world::authors_frame;
use world::geometry::Pose;
use world::scene::{AgentState, Scene, TrackId};

use super::recipe::Whose;

/// Five seconds of each agent: x, y, heading, velocity x and y.
pub(super) type Future = Box<[[[f32; 5]; STEPS]; AGENTS]>;
/// At which of its steps each was seen.
pub(super) type Seen = Box<[[bool; STEPS]; AGENTS]>;

/// What the AV and `neighbors` did in the steps after `step`, at which the AV was at `av`; zeros where they were not seen. Under
/// [`Whose::Authors`] each component that is 0 in the log stays so.
pub(super) fn future(scene: &Scene, step: usize, av: Pose, neighbors: &[TrackId], whose: Whose) -> (Future, Seen) {
    let mut future = Box::new([[[0.0; 5]; STEPS]; AGENTS]);
    let mut seen = Box::new([[false; STEPS]; AGENTS]);
    let track = |id: &TrackId| scene.tracks().iter().find(|track| track.id == *id);
    let agents = std::iter::once(Some(scene.av())).chain(neighbors.iter().map(track));
    for ((track, rows), seen) in agents.zip(future.iter_mut()).zip(seen.iter_mut()) {
        let states = track.map_or(&[][..], |track| &track.states);
        let after = states.iter().skip(step + 1);
        for ((state, row), seen) in after.zip(rows.iter_mut()).zip(seen.iter_mut()) {
            if let Some(state) = state {
                *row = own(state, av, whose);
                *seen = true;
            }
        }
    }
    (future, seen)
}

fn own(state: &AgentState, av: Pose, whose: Whose) -> [f32; 5] {
    let (pose, velocity) = match whose {
        Whose::Authors => (authors_frame::pose(state, av), authors_frame::velocity(state, av)),
        Whose::Mended => (av.pose_to_body(state.pose()), Pose::new(0.0, 0.0, av.heading).to_body(state.velocity())),
    };
    [pose.x, pose.y, pose.heading, velocity.x, velocity.y].map(|value| value as f32)
}
