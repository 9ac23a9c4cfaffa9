//! Predictions as recordings hold them: the same numbers, in a third of the room where they are smooth.
//!
//! No two numbers of a prediction are alike in their bits, so that no compressor makes them smaller; but along a smooth trajectory the
//! bits change evenly. A column is kept as its bits' fourth differences, as integers modulo 2^64: of the first number the bits themselves, of the
//! second the first difference, and so on. Nothing is lost, whatever the numbers are.

use std::borrow::Cow;

use prost::Message as _;

use super::decode;
use crate::keys::Channel;
use crate::proto;

/// The bytes that a recording holds in the place of `payload`, which says `prediction`; none where they would not be fewer, or would not
/// lead back to these very bytes: a node may have fields of its own.
#[must_use]
pub fn pack(prediction: &proto::Prediction, payload: &[u8]) -> Option<Vec<u8>> {
    if !prediction.futures.iter().all(is_plain) || prediction.encode_to_vec() != payload {
        return None;
    }
    let trajectory = |t: &proto::PredictedTrajectory| proto::PredictedTrajectory {
        track: t.track,
        x_bits: changes(t.x.iter().copied()),
        y_bits: changes(t.y.iter().copied()),
        heading_bits: changes(t.heading.iter().copied()),
        ..Default::default()
    };
    let future = |future: &proto::Future| proto::Future {
        probability: future.probability,
        trajectories: future.trajectories.iter().map(trajectory).collect(),
        acceleration_bits: changes(future.controls.iter().map(|control| control.acceleration)),
        steering_bits: changes(future.controls.iter().map(|control| control.steering)),
        ..Default::default()
    };
    let packed = proto::Prediction {
        step: prediction.step,
        futures: prediction.futures.iter().map(future).collect(),
        initial_controls: prediction.initial_controls.clone(),
        cost_weights: prediction.cost_weights.clone(),
        error: prediction.error.clone(),
    };
    Some(packed.encode_to_vec()).filter(|packed| packed.len() < payload.len())
}

/// Whether nothing of it is kept as bits.
fn is_plain(future: &proto::Future) -> bool {
    let trajectories =
        future.trajectories.iter().all(|t| t.x_bits.is_empty() && t.y_bits.is_empty() && t.heading_bits.is_empty());
    trajectories && future.acceleration_bits.is_empty() && future.steering_bits.is_empty()
}

/// The bytes that travelled, of a message that a recording holds as `recorded` on the channel of this name: of a prediction [`unpack`]ed.
#[must_use]
pub fn as_told<'a>(channel: &str, recorded: &'a [u8]) -> Cow<'a, [u8]> {
    if channel == Channel::Prediction.name() { unpack(recorded) } else { Cow::Borrowed(recorded) }
}

/// The bytes that travelled, of a prediction in a recording; bytes that were not packed are what they are.
#[must_use]
pub fn unpack(recorded: &[u8]) -> Cow<'_, [u8]> {
    // What is no prediction is told by whoever reads it.
    let Ok(mut prediction) = decode::<proto::Prediction>(recorded) else { return Cow::Borrowed(recorded) };
    let mut any = false;
    for future in &mut prediction.futures {
        for trajectory in &mut future.trajectories {
            let proto::PredictedTrajectory { track: _, x, y, heading, x_bits, y_bits, heading_bits } = trajectory;
            for (column, bits) in [(x, x_bits), (y, y_bits), (heading, heading_bits)] {
                if column.is_empty() && !bits.is_empty() {
                    any = true;
                    *column = numbers(&std::mem::take(bits));
                }
            }
        }
        let columns = [&mut future.acceleration_bits, &mut future.steering_bits];
        if future.controls.is_empty() && columns.iter().any(|bits| !bits.is_empty()) {
            any = true;
            future.controls = controls(&columns.map(|bits| numbers(&std::mem::take(bits))));
        }
    }
    if any { Cow::Owned(prediction.encode_to_vec()) } else { Cow::Borrowed(recorded) }
}

/// What one column has beyond the other is a control of no number there: whoever checks it refuses it.
fn controls([accelerations, steerings]: &[Vec<f64>; 2]) -> Vec<proto::Control> {
    let number = |column: &[f64], place: usize| column.get(place).copied().unwrap_or(f64::NAN);
    let control =
        |place| proto::Control { acceleration: number(accelerations, place), steering: number(steerings, place) };
    (0..accelerations.len().max(steerings.len())).map(control).collect()
}

/// How often differences are taken. Each makes what is left of a curve a hundredth, and twice the noise of rounding.
const ORDER: usize = 4;

fn changes(column: impl Iterator<Item = f64>) -> Vec<i64> {
    let mut last = [0_i64; ORDER];
    let change = |(place, number): (usize, f64)| {
        let mut value = number.to_bits().cast_signed();
        for level in &mut last[..place.min(ORDER)] {
            let now = std::mem::replace(level, value);
            value = value.wrapping_sub(now);
        }
        if let Some(level) = last.get_mut(place) {
            *level = value;
        }
        value
    };
    column.enumerate().map(change).collect()
}

fn numbers(changes: &[i64]) -> Vec<f64> {
    let mut last = [0_i64; ORDER];
    let number = |(place, change): (usize, &i64)| {
        let mut value = *change;
        if let Some(level) = last.get_mut(place) {
            *level = value;
        }
        for level in last[..place.min(ORDER)].iter_mut().rev() {
            value = value.wrapping_add(*level);
            *level = value;
        }
        f64::from_bits(value.cast_unsigned())
    };
    changes.iter().enumerate().map(number).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Two futures of two agents that go alike; the AV's accelerations are the x, its steering the other way round.
    fn message(columns: [Vec<f64>; 3]) -> proto::Prediction {
        let [x, y, heading] = columns;
        let control = |(x, back): (&f64, &f64)| proto::Control { acceleration: *x, steering: *back };
        let controls = x.iter().zip(x.iter().rev()).map(control).collect();
        let trajectory = proto::PredictedTrajectory { track: 7, x, y, heading, ..Default::default() };
        let trajectories = vec![trajectory; 2];
        let future = proto::Future { probability: 0.5, trajectories, controls, ..Default::default() };
        proto::Prediction { step: 3, futures: vec![future; 2], cost_weights: vec![1.0], ..Default::default() }
    }

    #[test]
    fn a_smooth_trajectory_takes_half_the_room() {
        let along = |start: f64, speed: f64, bend: f64| {
            (0..50).map(|k| 0.1 * f64::from(k)).map(|t| start + t * (speed + t * bend)).collect::<Vec<f64>>()
        };
        let (x, y) = (along(812.4, 9.3, -0.31), along(-377.9, 2.7, 0.17));
        let prediction = message([x, y, along(0.3, 0.1, 0.0)]);
        let payload = prediction.encode_to_vec();
        let packed = pack(&prediction, &payload).unwrap();
        assert!(2 * packed.len() < payload.len(), "{} of {}", packed.len(), payload.len());
        assert_eq!(unpack(&packed), payload);
    }

    #[test]
    fn what_would_not_come_back_is_left_alone() {
        let prediction = message([vec![1.0; 9], vec![2.0; 9], vec![0.5; 9]]);
        let payload = prediction.encode_to_vec();
        // A field of the node's own.
        assert_eq!(pack(&prediction, &[&payload[..], &[0x78, 1]].concat()), None);
        let mut both = prediction.clone();
        both.futures[0].trajectories[0].x_bits = vec![1, 2];
        let payload = both.encode_to_vec();
        assert_eq!(pack(&both, &payload), None);
        assert_eq!(unpack(&payload), payload);
        let mut both = prediction.clone();
        both.futures[1].steering_bits = vec![1];
        assert_eq!(pack(&both, &both.encode_to_vec()), None);
        let refusal = proto::Prediction { error: "no".to_owned(), ..Default::default() };
        assert_eq!(pack(&refusal, &refusal.encode_to_vec()), None);
        assert_eq!(unpack(b"nothing of the kind"), &b"nothing of the kind"[..]);
    }

    #[test]
    fn what_was_recorded_before_futures_had_controls_is_read_as_ever() {
        let line = || (0..50).map(f64::from).collect::<Vec<f64>>();
        let mut prediction = message([line(), line(), line()]);
        prediction.futures.iter_mut().for_each(|future| future.controls.clear());
        let packed = pack(&prediction, &prediction.encode_to_vec()).unwrap();
        let recorded = decode::<proto::Prediction>(&packed).unwrap();
        assert!(
            recorded.futures.iter().all(|future| future.controls.is_empty() && future.acceleration_bits.is_empty())
        );
        assert_eq!(*unpack(&packed), prediction.encode_to_vec());
    }

    #[test]
    fn a_column_of_controls_that_is_too_short_is_found_out() {
        let future = proto::Future { probability: 1.0, acceleration_bits: vec![0; 50], ..Default::default() };
        let recorded = proto::Prediction { futures: vec![future], ..Default::default() };
        let told = decode::<proto::Prediction>(&unpack(&recorded.encode_to_vec())).unwrap();
        let checked = world::plan::UncheckedPrediction::try_from(told).unwrap().check(0);
        assert!(matches!(checked, Err(world::plan::AnswerError::OutOfRange { index: 0, .. })), "{checked:?}");
    }

    proptest! {
        #[test]
        fn every_bit_of_every_number_comes_back(
            columns in proptest::array::uniform3(proptest::collection::vec(any::<u64>().prop_map(f64::from_bits), 0..60)),
        ) {
            let prediction = message(columns);
            let payload = prediction.encode_to_vec();
            let packed = pack(&prediction, &payload).unwrap_or_else(|| payload.clone());
            prop_assert!(packed.len() <= payload.len());
            prop_assert_eq!(&*unpack(&packed), &*payload);
        }
    }
}
