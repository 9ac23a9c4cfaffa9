use proptest::prelude::*;
use scenarios::generated::Family;
use vectors::Npz;
use world::scene::Scene;

use super::product::kernels;
use super::reference::Reference;
use super::*;
use crate::constants::NEIGHBORS;
use crate::features::{SceneFeatures, Settings, Window};
use crate::verify::{frame, verify_outputs};

fn scene(family: &str, seed: u64) -> Scene {
    let payload = Family::named(family).unwrap().payload("test", seed, 0, &Default::default()).unwrap();
    scenarios::womd::read(&payload).unwrap().0
}

fn frame_of(scene: &Scene, step: usize) -> Frame {
    SceneFeatures::new(scene.map(), Settings::Mended).at(&Window::logged(scene, step).unwrap()).frame
}

/// A step of a generated scene.
fn generated(family: &str, seed: u64, step: usize) -> Frame {
    frame_of(&scene(family, seed), step)
}

/// A step of a generated scene, in which there are `others` beside the AV and no more.
fn sparse(family: &str, step: usize, others: usize) -> Frame {
    let mut parts = scene(family, 1).into_parts();
    let av = parts.tracks.remove(parts.av_index);
    parts.tracks.retain(|track| track.states[step].is_some());
    parts.tracks.truncate(others);
    parts.tracks.push(av);
    parts.av_index = parts.tracks.len() - 1;
    parts.objects_of_interest.clear();
    parts.tracks_to_predict.clear();
    frame_of(&parts.check().unwrap().0, step)
}

fn network(variant: Variant) -> Network {
    Network::new(&Weights::formula(variant)).unwrap()
}

fn answers(network: &Network, frames: &[Frame], together: usize) -> Vec<Prediction> {
    let mut out = vec![Prediction::empty(); frames.len()];
    network.forward(&frames.iter().collect::<Vec<_>>(), &mut Workspace::new(together), &mut out);
    out
}

fn farthest(got: &[f32], wanted: &[f64]) -> f64 {
    vectors::worst_deviation(got.iter().map(|value| f64::from(*value)), wanted, vectors::absolute)
}

#[test]
fn every_output_of_the_authors_network_holds_with_the_formula_s_weights() {
    let (Some(inputs), Some(outputs)) =
        (vectors::shared("dipp/feature-vectors"), vectors::shared("dipp/network-vectors"))
    else {
        return;
    };
    let report = verify_outputs(&network(Variant::Joint), &inputs, &outputs).unwrap();
    assert!(report.holds(), "{report}");
}

#[test]
fn the_fast_network_is_the_reference_but_for_rounding() {
    for variant in [Variant::Joint, Variant::Separate, Variant::Imitation] {
        let weights = Weights::formula(variant);
        let frame = generated("stop-sign", 3, 60);
        let got = &answers(&network(variant), std::slice::from_ref(&frame), 1)[0];
        let wanted = Reference(&weights).forward(&frame);
        let futures = variant.futures();
        assert_eq!((got.futures, got.cost_weights.is_some()), (futures, variant == Variant::Joint));
        let controls = got.controls[..futures].as_flattened().as_flattened();
        assert!(farthest(controls, &wanted.controls) < 1e-5);
        if variant.predicts() {
            assert!(farthest(got.poses.as_flattened().as_flattened().as_flattened(), &wanted.poses) < 1e-4);
            assert!(farthest(&got.scores, &wanted.scores) < 2e-5);
        }
        assert!((got.probabilities.iter().sum::<f32>() - 1.0).abs() < 1e-6);
    }
}

/// Every tenth number of what the authors' network has in between, too.
fn reference_holds(name: &str) {
    let (Some(inputs), Some(outputs)) =
        (vectors::shared("dipp/feature-vectors"), vectors::shared("dipp/network-vectors"))
    else {
        return;
    };
    let weights = Weights::formula(Variant::Joint);
    let frame = frame(&Npz::read(&inputs.join(name)).unwrap()).unwrap();
    let npz = Npz::read(&outputs.join(name)).unwrap();
    let answer = Reference(&weights).forward(&frame);
    let off = |got: &[f64], array: &str, shape: &[usize]| {
        let shape: Vec<_> = shape.iter().map(|axis| Some(*axis)).collect();
        vectors::worst_deviation(got.iter().copied(), npz.array(array, &shape).unwrap(), vectors::absolute)
    };
    assert!(off(&answer.controls, "plans_f64", &[3, 50, 2]) < 1e-10, "{name}");
    assert!(off(&answer.poses, "predictions_f64", &[3, 10, 50, 3]) < 1e-10, "{name}");
    assert!(off(&answer.scores, "scores_f64", &[3]) < 1e-10, "{name}");
    assert!(off(&answer.agents.concat(), "agent_agent", &[11, 256]) < 1e-4, "{name}");
    assert!(off(&answer.modes.concat(), "agent_map", &[3, 11, 256]) < 1e-4, "{name}");
    let sub: Vec<f64> =
        [0, 1, 5, 10].iter().flat_map(|agent| answer.slots[agent * SLOTS..][..SLOTS].concat()).collect();
    assert!(off(&sub, "map_actor_sub", &[4, 10, 256]) < 1e-4, "{name}");
}

#[test]
fn the_reference_is_the_authors_network_to_1e_10() {
    reference_holds("synthetic_sparse.npz");
}

#[test]
#[ignore = "half a minute"]
fn the_reference_is_the_authors_network_to_1e_10_on_every_frame() {
    let Some(folder) = vectors::shared("dipp/network-vectors") else { return };
    for path in vectors::npz_files(&folder).unwrap() {
        reference_holds(&path.file_name().unwrap().to_string_lossy());
    }
}

#[test]
fn a_frame_s_answer_has_the_same_bytes_in_any_batch() {
    let network = network(Variant::Joint);
    let frames: Vec<Frame> =
        [("stop-sign", 1, 50), ("merge", 2, 30), ("cut-in", 0, 90), ("red-light", 4, 20), ("curve", 1, 19)]
            .map(|(family, seed, step)| generated(family, seed, step))
            .to_vec();
    let alone: Vec<Prediction> =
        frames.iter().flat_map(|frame| answers(&network, std::slice::from_ref(frame), 1)).collect();
    for together in [1, 2, 8] {
        assert_eq!(answers(&network, &frames, together), alone);
    }
    let reversed: Vec<Frame> = frames.into_iter().rev().collect();
    assert_eq!(answers(&network, &reversed, 3), alone.into_iter().rev().collect::<Vec<_>>());
}

#[test]
fn an_answer_has_the_same_bytes_on_every_machine() {
    let weights = Weights::formula(Variant::Joint);
    let mut frame = generated("stop-sign", 1, 50);
    // A few slots will do: without such an instruction of the machine's, a fused multiply-add is slow.
    frame.lanes[2..].as_flattened_mut().iter_mut().for_each(|row| *row = [0.0; LANE_ROW]);
    let all: Vec<Prediction> = kernels()
        .into_iter()
        .map(|kernel| {
            answers(&Network::for_kernel(&weights, kernel).unwrap(), std::slice::from_ref(&frame), 1).remove(0)
        })
        .collect();
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn what_is_not_there_is_not_looked_at() {
    let network = network(Variant::Joint);
    let frame = sparse("urban", 50, 3);
    let count = frame.presence.agents.iter().filter(|present| **present).count();
    assert!((2..AGENTS).contains(&count), "{count} agents");
    let attention = &answers(&network, std::slice::from_ref(&frame), 1)[0].attention;
    for agent in 0..AGENTS {
        for shares in &attention.agents {
            assert!((shares[agent].iter().sum::<f32>() - 1.0).abs() < 1e-5);
            assert!(shares[agent].iter().zip(&frame.presence.agents).all(|(share, there)| *there || *share == 0.0));
        }
        for shares in &attention.map {
            assert!((shares[agent].iter().sum::<f32>() - 1.0).abs() < 1e-5);
            let mut seen = shares[agent].iter().zip(&frame.presence.slots[agent]).skip(1);
            assert!(seen.all(|(share, there)| *there || *share == 0.0));
        }
    }
}

#[test]
fn a_frame_of_nothing_gives_numbers() {
    let answer = &answers(&network(Variant::Joint), &[Frame::empty()], 1)[0];
    assert!(answer.controls.as_flattened().as_flattened().iter().chain(&answer.scores).all(|value| value.is_finite()));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn permuting_the_neighbors_permutes_their_answers(shift in 1..NEIGHBORS, seed in 0..5_u64) {
        let network = network(Variant::Joint);
        let frame = generated("stop-sign", seed, 50);
        let mut other = frame.clone();
        // Neighbour i comes to place i + shift.
        other.neighbors.rotate_right(shift);
        other.lanes[LANES..].rotate_right(shift * LANES);
        other.crosswalks[CROSSWALKS..].rotate_right(shift * CROSSWALKS);
        other.presence.agents[1..].rotate_right(shift);
        other.presence.slots[1..].rotate_right(shift);
        let [a, b] = [frame, other].map(|frame| answers(&network, &[frame], 1).remove(0));
        let close = |a: &[f32], b: &[f32], within: f32| a.iter().zip(b).all(|(a, b)| (a - b).abs() < within);
        prop_assert!(close(&a.scores, &b.scores, 2e-5));
        prop_assert!(close(a.controls.as_flattened().as_flattened(), b.controls.as_flattened().as_flattened(), 1e-5));
        for (mut a, b) in a.poses.into_iter().zip(b.poses) {
            a.rotate_right(shift);
            prop_assert!(close(a.as_flattened().as_flattened(), b.as_flattened().as_flattened(), 1e-4));
        }
    }
}
