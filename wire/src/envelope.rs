//! The two envelopes of the bus, `Told` and `Answer`, without unpacking what they hold: a message is encoded once, goes into the
//! envelopes of several nodes and onto the tape, and is taken out again as the bytes that came.

use zenoh::bytes::ZBytes;

use crate::convert::{MessageError, Problem};

/// What a `Told` holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Telling {
    /// `Scene`.
    Scene = 2,
    /// `Observation`.
    Observation = 3,
    /// `Prediction`.
    Prediction = 4,
    /// `EpisodeEnd`.
    End = 5,
    /// `TakenAgents`.
    Taken = 6,
}

/// What an `Answer` holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saying {
    /// `Plan`.
    Plan = 2,
    /// `Prediction`.
    Prediction = 3,
    /// `Done`.
    Done = 4,
    /// `TrafficMoves`.
    Moves = 5,
}

/// What an envelope may hold: the fields of its `oneof`.
pub trait Content: Copy + 'static {
    /// The envelope's name.
    const ENVELOPE: &'static str;
    /// All of them.
    const ALL: &'static [Self];
    /// The number of its field.
    fn field(self) -> u64;
}

impl Content for Telling {
    const ENVELOPE: &'static str = "Told";
    const ALL: &'static [Self] = &[Self::Scene, Self::Observation, Self::Prediction, Self::End, Self::Taken];
    fn field(self) -> u64 {
        self as u64
    }
}

impl Content for Saying {
    const ENVELOPE: &'static str = "Answer";
    const ALL: &'static [Self] = &[Self::Plan, Self::Prediction, Self::Done, Self::Moves];
    fn field(self) -> u64 {
        self as u64
    }
}

/// Field 1 of both envelopes.
const EPISODE: u64 = 1;

const VARINT: u64 = 0;
const FIXED64: u64 = 1;
const BYTES: u64 = 2;
const FIXED32: u64 = 5;

/// An envelope with `message` in it, which is not copied.
#[must_use]
pub fn seal<C: Content>(episode: u64, content: C, message: ZBytes) -> ZBytes {
    let mut head = Vec::with_capacity(24);
    for number in [EPISODE << 3 | VARINT, episode, content.field() << 3 | BYTES, message.len() as u64] {
        put_varint(&mut head, number);
    }
    let mut envelope = ZBytes::writer();
    envelope.append(head.into());
    envelope.append(message);
    envelope.finish()
}

/// What an envelope holds: the number of the episode, what the message is, and its bytes.
///
/// # Errors
/// [`MessageError`] where it is no such envelope, or an empty one.
pub fn open<C: Content>(mut bytes: &[u8]) -> Result<(u64, C, &[u8]), MessageError> {
    let malformed = || MessageError::Malformed { message: C::ENVELOPE, reason: "it is cut off".to_owned() };
    let (mut episode, mut found) = (0, None);
    while !bytes.is_empty() {
        let key = varint(&mut bytes).ok_or_else(malformed)?;
        let (field, kind) = (key >> 3, key & 7);
        let content = C::ALL.iter().copied().find(|content| content.field() == field);
        match (kind, content) {
            (VARINT, _) => {
                let value = varint(&mut bytes).ok_or_else(malformed)?;
                episode = if field == EPISODE { value } else { episode };
            }
            (BYTES, content) => {
                let length =
                    varint(&mut bytes).and_then(|length| usize::try_from(length).ok()).ok_or_else(malformed)?;
                let message = take(&mut bytes, length).ok_or_else(malformed)?;
                found = content.map(|content| (content, message)).or(found);
            }
            // Fields of a later version, perhaps.
            (FIXED64, _) => drop(take(&mut bytes, 8).ok_or_else(malformed)?),
            (FIXED32, _) => drop(take(&mut bytes, 4).ok_or_else(malformed)?),
            _ => {
                let reason = format!("field {field} has the wire type {kind}");
                return Err(MessageError::Malformed { message: C::ENVELOPE, reason });
            }
        }
    }
    let missing = MessageError::Field { message: C::ENVELOPE, field: "what".to_owned(), problem: Problem::Missing };
    let (content, message) = found.ok_or(missing)?;
    Ok((episode, content, message))
}

fn put_varint(to: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        to.push(number as u8 | 0x80);
        number >>= 7;
    }
    to.push(number as u8);
}

fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut number = 0_u64;
    for shift in (0..70).step_by(7) {
        let byte = *bytes.split_off_first()?;
        number |= u64::from(byte & 0x7f).checked_shl(shift).unwrap_or(0);
        if byte < 0x80 {
            return Some(number);
        }
    }
    None
}

fn take<'a>(bytes: &mut &'a [u8], length: usize) -> Option<&'a [u8]> {
    bytes.split_off(..length)
}

#[cfg(test)]
mod tests {
    use prost::Message as _;

    use super::*;
    use crate::proto::{self, answer, told};

    #[test]
    fn an_envelope_is_what_protobuf_makes_of_it() {
        for episode in [0, 1, 127, 128, u64::MAX] {
            let observation = proto::Observation { step: 7, log_index: 26, ..Default::default() };
            let sealed =
                seal(episode, Telling::Observation, observation.encode_to_vec().into()).to_bytes().into_owned();
            let told = proto::Told::decode(sealed.as_slice()).unwrap();
            assert_eq!(told, proto::Told { episode, what: Some(told::What::Observation(observation.clone())) });
            for bytes in [sealed, told.encode_to_vec()] {
                let (number, content, message) = open::<Telling>(&bytes).unwrap();
                assert_eq!((number, content), (episode, Telling::Observation));
                assert_eq!(proto::Observation::decode(message).unwrap(), observation);
            }
        }
    }

    #[test]
    fn each_content_is_its_field() {
        let answers = [
            (Saying::Plan, answer::What::Plan(proto::Plan::default())),
            (Saying::Prediction, answer::What::Prediction(proto::Prediction::default())),
            (Saying::Done, answer::What::Done(proto::Done {})),
        ];
        for (saying, what) in answers {
            let bytes = proto::Answer { episode: 3, what: Some(what) }.encode_to_vec();
            assert_eq!(open::<Saying>(&bytes).unwrap(), (3, saying, [].as_slice()));
        }
        let tellings = [
            (Telling::Scene, told::What::Scene(proto::Scene::default())),
            (Telling::Prediction, told::What::Prediction(proto::Prediction::default())),
            (Telling::End, told::What::End(proto::EpisodeEnd::default())),
        ];
        for (telling, what) in tellings {
            let bytes = proto::Told { episode: 3, what: Some(what) }.encode_to_vec();
            assert_eq!(open::<Telling>(&bytes).unwrap(), (3, telling, [].as_slice()));
        }
    }

    #[test]
    fn what_is_no_envelope_is_refused() {
        let refused = |bytes: &[u8]| open::<Saying>(bytes).unwrap_err().to_string();
        assert_eq!(refused(&[]), "Answer: field what is missing");
        assert_eq!(refused(&[8]), "these bytes are no Answer: it is cut off");
        assert_eq!(refused(&[0x12, 5, 1]), "these bytes are no Answer: it is cut off");
        assert_eq!(
            refused(&[0x12, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1]),
            "these bytes are no Answer: it is cut off"
        );
        assert_eq!(refused(&[0xff; 30]), "these bytes are no Answer: it is cut off");
        assert_eq!(refused(&[0x13]), "these bytes are no Answer: field 2 has the wire type 3");
    }
}
