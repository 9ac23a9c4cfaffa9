//! An answer allocates nothing once there is a workspace, and neither does a picture. A program of its own: its allocator counts.

#![allow(clippy::unwrap_used, reason = "a test says what failed by failing")]

use network::cql::Painter;
use network::features::{SceneFeatures, Settings, Window};
use network::inference::{Network, Workspace};
use network::weights::{Variant, Weights};
use network::{Frame, Prediction};
use scenarios::generated::FAMILIES;
use world::observation::HistoryStep;
use world::reference_line::ReferenceLine;

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

#[test]
fn a_picture_allocates_nothing() {
    let family = FAMILIES.iter().find(|family| family.name == "red-light").unwrap();
    let scene = scenarios::womd::read(&family.payload("count", 1, 0, &Default::default()).unwrap()).unwrap().0;
    let mut painter = Painter::new(scene.map(), &ReferenceLine::default());
    let av = scene.av().states[20].unwrap();
    let now = [HistoryStep { log_index: 20, av, agents: Vec::new() }];
    let paint = || assert!(painter.paint(now.iter(), scene.signals(20).iter().copied()).iter().any(|value| *value > 0));
    assert_eq!(allocation_counter::measure(paint).count_total, 0);
}
