//! An answer allocates nothing once there is a workspace. A program of its own: its allocator counts.

#![allow(clippy::unwrap_used, reason = "a test says what failed by failing")]

use network::features::{SceneFeatures, Settings, Window};
use network::inference::{Network, Workspace};
use network::weights::{Variant, Weights};
use network::{Frame, Prediction};
use scenarios::generated::FAMILIES;

#[test]
fn an_answer_allocates_nothing_however_many_frames() {
    let network = Network::new(&Weights::formula(Variant::Joint)).unwrap();
    let frames: Vec<Frame> = FAMILIES
        .iter()
        .map(|family| {
            let scene = scenarios::womd::read(&family.payload("count", 1, 0, &Default::default()).unwrap()).unwrap().0;
            SceneFeatures::new(scene.map(), Settings::Mended).at(&Window::logged(&scene, 60).unwrap()).frame
        })
        .collect();
    let frames: Vec<&Frame> = frames.iter().collect();
    for together in [1, 3] {
        let (mut workspace, mut out) = (Workspace::new(together), vec![Prediction::empty(); frames.len()]);
        let count = allocation_counter::measure(|| network.forward(&frames, &mut workspace, &mut out)).count_total;
        assert_eq!(count, 0, "{together} together");
    }
}
