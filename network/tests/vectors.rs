//! The network beside the authors' own outputs; skipped where they are not there.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints its table")]

use network::frame::{Frame, Tensors};
use network::inference::{Forecast, Memory, Network};
use network::weights::formula;
use vectors::Npz;

fn single(npz: &Npz, name: &str, shape: &[usize]) -> Vec<f32> {
    let shape: Vec<Option<usize>> = shape.iter().copied().map(Some).collect();
    npz.array(name, &shape).unwrap().iter().map(|value| *value as f32).collect()
}

fn frame(npz: &Npz) -> Frame {
    let tensors = Tensors {
        ego: single(npz, "ego", &[20, 8]),
        neighbors: single(npz, "neighbors", &[10, 20, 9]),
        map_lanes: single(npz, "map_lanes", &[11, 6, 100, 17]),
        map_crosswalks: single(npz, "map_crosswalks", &[11, 4, 100, 3]),
    };
    Frame::of_tensors(&tensors).unwrap()
}

fn worst<'a>(got: impl IntoIterator<Item = &'a f32>, wanted: &[f64]) -> f64 {
    let got: Vec<f64> = got.into_iter().map(|value| f64::from(*value)).collect();
    assert_eq!(got.len(), wanted.len());
    got.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, |most, d| if d <= most { most } else { d })
}

#[test]
fn outputs_of_the_formula_weights_are_the_authors() {
    let (Some(features), Some(outputs)) =
        (vectors::shared("dipp/feature-vectors"), vectors::shared("dipp/network-vectors"))
    else {
        return;
    };
    let network = Network::of(&formula::weights());
    let mut memory = Memory::default();
    let mut forecast = Forecast::default();
    for path in vectors::npz_files(&outputs).unwrap() {
        let wanted = Npz::read(&path).unwrap();
        let frame = frame(&Npz::read(&features.join(path.file_name().unwrap())).unwrap());
        network.forecast(&frame, &mut memory, &mut forecast);
        let array = |name: &str, shape: &[usize]| {
            wanted.array(name, &shape.iter().copied().map(Some).collect::<Vec<_>>()).unwrap().to_vec()
        };
        let plans = worst(forecast.plans.as_flattened().as_flattened(), &array("plans_f64", &[3, 50, 2]));
        let predictions = worst(
            forecast.predictions.iter().flat_map(|p| p.as_flattened().as_flattened()),
            &array("predictions_f64", &[3, 10, 50, 3]),
        );
        let scores = worst(&forecast.scores, &array("scores_f64", &[3]));
        let cost = worst(&forecast.cost_weights, &array("cost_weights_f64", &[9]));
        println!(
            "{}: plans {plans:.1e}, predictions {predictions:.1e}, scores {scores:.1e}, cost weights {cost:.1e}",
            path.file_stem().unwrap().to_string_lossy()
        );
        assert!(plans <= 1e-5 && predictions <= 1e-4 && scores <= 2e-5 && cost <= 1e-6);
    }
}
