use std::collections::HashMap;

use proptest::prelude::*;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use super::*;

const VARIANTS: [Variant; 3] = [Variant::Joint, Variant::Separate, Variant::Imitation];

/// The file of `weights` with one tensor changed, left out or added.
fn with_tensor(name: &str, tensor: Option<(Dtype, Vec<usize>, Vec<u8>)>) -> Vec<u8> {
    let bytes = Weights::formula(Variant::Joint).write(Precision::Half).unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let mut views: Vec<_> = file.tensors().into_iter().filter(|(own, _)| own != name).collect();
    if let Some((dtype, shape, data)) = &tensor {
        views.push((name.to_owned(), TensorView::new(*dtype, shape.clone(), data).unwrap()));
    }
    safetensors::serialize(views, None).unwrap()
}

fn told(name: &str, tensor: Option<(Dtype, Vec<usize>, Vec<u8>)>) -> String {
    Weights::read(&with_tensor(name, tensor)).unwrap_err().to_string().lines().next().unwrap().to_owned()
}

#[test]
fn what_is_written_is_read_again_and_gives_the_same_bytes() {
    for variant in VARIANTS {
        let weights = Weights::formula(variant);
        let bytes = weights.write(Precision::Single).unwrap();
        assert_eq!(Weights::read(&bytes).unwrap(), weights);
        assert_eq!(weights.write(Precision::Single).unwrap(), bytes);
        let halves = Weights::read(&weights.write(Precision::Half).unwrap()).unwrap();
        assert_eq!(halves.variant(), variant);
        let again = Weights::read(&halves.write(Precision::Half).unwrap()).unwrap();
        assert_eq!(again, halves, "rounded once");
    }
}

#[test]
fn a_file_that_is_not_this_network_s_is_told_by_tensor() {
    let bias = "plan.cost.2.bias";
    assert_eq!(told(bias, None), "tensor plan.cost.2.bias is missing: [9] is expected");
    assert_eq!(
        told(bias, Some((Dtype::F32, vec![3, 3], vec![0; 36]))),
        "tensor plan.cost.2.bias has the shape [3, 3]: [9] is expected"
    );
    assert_eq!(
        told(bias, Some((Dtype::F64, vec![9], vec![0; 72]))),
        "tensor plan.cost.2.bias has numbers of type F64: F32 or F16 is expected"
    );
    let mut halves = vec![0; 18];
    halves[4..6].copy_from_slice(&half::f16::NEG_INFINITY.to_le_bytes());
    assert_eq!(
        told(bias, Some((Dtype::F16, vec![9], halves))),
        "tensor plan.cost.2.bias holds -inf at place 2: finite numbers are expected"
    );
    assert_eq!(
        told("plan.cost.4.bias", Some((Dtype::F32, vec![1], vec![0; 4]))),
        "tensor plan.cost.4.bias is none of this network's"
    );
    let tens: Vec<u8> = [10_i32, 11].iter().flat_map(|value| value.to_le_bytes()).collect();
    assert_eq!(
        told("plan.constraint", Some((Dtype::I32, vec![1, 2], tens))),
        "tensor plan.constraint holds [10, 11]: the architecture has [10, 10]"
    );
    assert!(Weights::read(b"no such file").unwrap_err().to_string().contains("safetensors"));
}

#[test]
fn the_constants_may_be_left_out() {
    for buffer in ["plan.scale", "plan.constraint"] {
        assert!(Weights::read(&with_tensor(buffer, None)).is_ok());
    }
}

#[test]
fn what_half_precision_cannot_hold_is_not_written() {
    let mut values: Vec<Vec<f32>> = Weights::formula(Variant::Joint).tensors().map(|(_, _, v)| v.to_vec()).collect();
    values[0][7] = 1e6;
    let weights = Weights::from_tensors(Variant::Joint, values).unwrap();
    let error = weights.write(Precision::Half).unwrap_err();
    assert!(matches!(error, WeightsError::TooLarge { place: 7, .. }), "{error}");
    assert!(weights.write(Precision::Single).is_ok());
}

#[test]
fn the_trained_weights_load() {
    let Some(folder) = vectors::shared("dipp/trained") else { return };
    for name in ["dipp42", "sep42"] {
        let bytes = std::fs::read(folder.join(format!("{name}.f16.safetensors"))).unwrap();
        assert_eq!(Weights::read(&bytes).unwrap().variant(), Variant::Joint);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn a_damaged_file_does_no_harm(
        changes in prop::collection::vec((0..30_000_usize, any::<u8>()), 1..6), cut in 0..9_usize,
    ) {
        use std::sync::OnceLock;
        static WHOLE: OnceLock<Vec<u8>> = OnceLock::new();
        let mut bytes = WHOLE.get_or_init(|| Weights::formula(Variant::Imitation).write(Precision::Half).unwrap()).clone();
        for (place, byte) in changes {
            bytes[place] ^= byte;
        }
        bytes.truncate(bytes.len() - cut.saturating_sub(6));
        crate::fuzzing::weights(&bytes);
    }
}

#[test]
fn the_features_they_were_trained_on_are_said_in_the_file() {
    let plain = Weights::formula(Variant::Imitation);
    assert_eq!(features_of(&plain.write(Precision::Half).unwrap()), None);
    for features in [features::Settings::Authors, features::Settings::Mended] {
        let weights = plain.clone().with_features(features);
        let bytes = weights.write(Precision::Single).unwrap();
        assert_eq!(features_of(&bytes), Some(features));
        assert_eq!(Weights::read(&bytes).unwrap(), weights);
    }
    let other = HashMap::from([("features".to_owned(), "mine".to_owned())]);
    let bytes = safetensors::serialize(None::<(&str, TensorView<'_>)>, Some(other)).unwrap();
    assert_eq!(features_of(&bytes), None);
    let bytes = plain.with_features(features::Settings::Mended).write(Precision::Half).unwrap();
    let place = bytes.windows(8).position(|word| word == b"\"mended\"").unwrap();
    let bytes = [&bytes[..place], b"\"melded\"", &bytes[place + 8..]].concat();
    let error = Weights::read(&bytes).unwrap_err();
    assert_eq!(error, WeightsError::Features("melded".to_owned()));
}

#[test]
fn the_form_of_the_cost_survives_a_file_and_changes_its_weights() {
    let weights = Weights::formula(Variant::Joint).with_cost_form(CostForm::Exponentials);
    for precision in [Precision::Single, Precision::Half] {
        assert_eq!(Weights::read(&weights.write(precision).unwrap()).unwrap().cost_form(), CostForm::Exponentials);
    }
    let shares = Weights::formula(Variant::Joint);
    assert_eq!(Weights::read(&shares.write(Precision::Half).unwrap()).unwrap().cost_form(), CostForm::Shares);
    let cost = |weights: &Weights| {
        let network = crate::inference::Network::new(weights).unwrap();
        let mut out = [crate::Prediction::empty()];
        network.forward(&[&crate::Frame::empty()], &mut crate::inference::Workspace::new(1), &mut out);
        out[0].cost_weights.unwrap()
    };
    let (shares, exponentials) = (cost(&shares), cost(&weights));
    // Shares are exponentials over their sum, times scales.
    let sum = exponentials[0] / shares[0];
    assert!((exponentials[5] / shares[5] * 10.0 / sum - 1.0).abs() < 1e-5);
    assert_eq!(shares[7..], exponentials[7..]);
}
