//! Predictions read fast. Prost takes packed numbers one at a time and has each column grow five times; on the wire a packed column is the bytes
//! of its numbers, so here it is left as such until its poses are made.

use prost::Message as _;
use prost::bytes::Bytes;
use world::geometry::Pose;
use world::plan::{PredictedTrajectory, UncheckedPrediction};
use world::scene::TrackId;

use super::answers::{assembled, refuse};
use super::{Checked, Message, MessageError, decode, same_length, unsigned};
use crate::proto;

/// Bytes of a number.
const NUMBER: usize = size_of::<f64>();

/// `proto::Prediction`, on the wire.
#[derive(Clone, PartialEq, prost::Message)]
struct Prediction {
    #[prost(uint32, tag = "1")]
    step: u32,
    #[prost(message, repeated, tag = "2")]
    futures: Vec<PackedFuture>,
    #[prost(message, repeated, tag = "3")]
    initial_controls: Vec<proto::Control>,
    #[prost(double, repeated, tag = "4")]
    cost_weights: Vec<f64>,
    #[prost(string, tag = "5")]
    error: String,
}

#[derive(Clone, PartialEq, prost::Message)]
struct PackedFuture {
    #[prost(double, tag = "1")]
    probability: f64,
    #[prost(message, repeated, tag = "2")]
    trajectories: Vec<Trajectory>,
    #[prost(message, repeated, tag = "3")]
    controls: Vec<proto::Control>,
}

#[derive(Clone, PartialEq, prost::Message)]
struct Trajectory {
    #[prost(int32, tag = "1")]
    track: i32,
    #[prost(bytes = "bytes", tag = "2")]
    x: Bytes,
    #[prost(bytes = "bytes", tag = "3")]
    y: Bytes,
    #[prost(bytes = "bytes", tag = "4")]
    heading: Bytes,
}

/// The prediction in the bytes of a `Prediction`: what [`decode`] and [`UncheckedPrediction::try_from`] give, in a third of the time.
///
/// # Errors
/// [`MessageError`].
pub fn prediction(bytes: &[u8]) -> Result<UncheckedPrediction, MessageError> {
    let usual = || decode::<proto::Prediction>(bytes).and_then(UncheckedPrediction::try_from);
    if bytes.len() > proto::Prediction::MAX_BYTES {
        return usual();
    }
    match Prediction::decode(Bytes::copy_from_slice(bytes)) {
        // Only where every byte is what it would be written as. A column may lawfully come in pieces, or number by number.
        Ok(packed) if packed.encoded_len() == bytes.len() && packed.is_of_whole_numbers() => {
            refuse(&packed.error)?;
            let Prediction { step, futures, initial_controls, cost_weights, error: _ } = packed;
            let parts = |future: PackedFuture| (future.probability, future.trajectories, future.controls);
            let futures = futures.into_iter().map(parts).collect();
            let prediction = assembled(step, futures, initial_controls, cost_weights, |t| trajectory(&t));
            prediction.map_err(|e| e.of(proto::Prediction::NAME))
        }
        _ => usual(),
    }
}

impl Prediction {
    fn is_of_whole_numbers(&self) -> bool {
        let trajectories = self.futures.iter().flat_map(|future| &future.trajectories);
        trajectories.flat_map(|t| [&t.x, &t.y, &t.heading]).all(|column| column.len() % NUMBER == 0)
    }
}

fn trajectory(message: &Trajectory) -> Checked<PredictedTrajectory> {
    let numbers = message.x.len() / NUMBER;
    same_length("y", numbers, message.y.len() / NUMBER)?;
    same_length("heading", numbers, message.heading.len() / NUMBER)?;
    let columns = [&message.x, &message.y, &message.heading].map(|column| column.as_chunks::<NUMBER>().0);
    let number = |bytes: [u8; NUMBER]| unsigned(f64::from_le_bytes(bytes));
    let [x, y, heading] = columns;
    let poses =
        x.iter().zip(y).zip(heading).map(|((x, y), heading)| Pose::new(number(*x), number(*y), number(*heading)));
    Ok(PredictedTrajectory { track: TrackId(message.track), poses: poses.collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message() -> proto::Prediction {
        let column = |from: f64| (0..50).map(|k| from + f64::from(k)).collect::<Vec<f64>>();
        let [x, y, heading] = [1.0, -2.0, 0.0].map(column);
        let trajectory = proto::PredictedTrajectory { track: 7, x, y, heading, ..Default::default() };
        let control = |k: u32| proto::Control { acceleration: 0.5 * f64::from(k), steering: -0.01 };
        let controls = (0..50).map(control).collect();
        let future =
            proto::Future { probability: 0.5, trajectories: vec![trajectory; 3], controls, ..Default::default() };
        proto::Prediction { step: 3, futures: vec![future; 2], cost_weights: vec![1.0, 2.0], ..Default::default() }
    }

    fn usual(bytes: &[u8]) -> Result<UncheckedPrediction, MessageError> {
        decode::<proto::Prediction>(bytes).and_then(UncheckedPrediction::try_from)
    }

    #[test]
    fn it_reads_what_the_usual_way_reads() {
        let bytes = message().encode_to_vec();
        let read = prediction(&bytes).unwrap();
        assert!(
            read.futures[1].trajectories[2].poses[49].x == 50.0 && read.futures[1].controls[49].acceleration == 24.5
        );
        assert_eq!(prediction(&bytes), usual(&bytes));
        let refusal = proto::Prediction { step: 1, error: "no".to_owned(), ..Default::default() }.encode_to_vec();
        assert_eq!(prediction(&refusal), Err(MessageError::Refused("no".to_owned())));
    }

    #[test]
    fn a_column_in_pieces_or_of_half_a_number_is_read_as_ever() {
        // Field 2 of a trajectory twice, in a future, in a prediction: one number each.
        let number = 1.5_f64.to_le_bytes();
        let piece = [&[0x12, 8][..], &number].concat();
        let columns = [&piece[..], &piece, &[0x1a, 8], &number, &[0x22, 8], &number].concat();
        let wrap = |inner: &[u8]| [&[0x12, inner.len() as u8][..], inner].concat();
        let in_pieces = wrap(&wrap(&columns));
        assert_eq!(prediction(&in_pieces), usual(&in_pieces));
        assert!(prediction(&in_pieces).is_err(), "two numbers beside one");
        let half = wrap(&wrap(&[0x12, 4, 0, 0, 0, 0]));
        assert_eq!(prediction(&half).is_err(), usual(&half).is_err());
    }

    #[test]
    fn any_damage_is_answered_alike() {
        let bytes = message().encode_to_vec();
        for place in 0..bytes.len().min(400) {
            for bit in [1, 0x80] {
                let mut damaged = bytes.clone();
                damaged[place] ^= bit;
                let said = |result: Result<UncheckedPrediction, MessageError>| format!("{result:?}");
                assert_eq!(said(prediction(&damaged)), said(usual(&damaged)), "byte {place}");
            }
        }
    }
}
