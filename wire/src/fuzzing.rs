//! What every input must keep, in functions that a fuzzer calls; `fuzz/` does so by the million, tests here by the thousand.

use std::fmt::Debug;
use std::sync::Arc;

use prost::Message as _;

use world::observation::Briefing;
use world::plan::{UncheckedPlan, UncheckedPrediction};
use world::reference_line::ReferenceLine;
use world::traffic::UncheckedMoves;

use crate::convert::{self, KnownWays, Message, MessageError, compact, decode, shown};
use crate::envelope::{Content, Saying, Telling, open, seal};
use crate::keys::{Address, Answering, NodeId, Place, Workers};
use crate::session::ZenohFile;
use crate::{proto, service};

/// Any bytes as a `Scene`: see `message`.
pub fn scene(bytes: &[u8]) {
    message::<proto::Scene, Briefing>(bytes);
}

/// Any bytes as an `Observation`: see `message`.
pub fn observation(bytes: &[u8]) {
    let samples = vec![0.5; 64];
    let line = Arc::new(ReferenceLine {
        x: samples.clone(),
        y: samples.clone(),
        z: samples.clone(),
        heading: samples.clone(),
        curvature: samples.clone(),
        speed_limit: samples,
        crosswalk: vec![false; 64],
    });
    match decode::<proto::Observation>(bytes) {
        // Of version 2, with samples of its own: nobody sends it on.
        Ok(message) if message.window.is_some() => drop(convert::observation(message, &line)),
        _ => drop(message_by(bytes, |message: proto::Observation| convert::observation(message, &line))),
    }
}

/// Any bytes as a `Plan`: see `message`; and the check that follows takes it or refuses it.
pub fn plan(bytes: &[u8]) {
    if let Some(plan) = message::<proto::Plan, UncheckedPlan>(bytes) {
        let step = plan.step;
        let _ = plan.check(step);
    }
}

/// Any bytes as a `Prediction`: see `message`; and the check that follows takes it or refuses it.
pub fn prediction(bytes: &[u8]) {
    let usual = message::<proto::Prediction, UncheckedPrediction>(bytes);
    // As text, because NaN differs from itself.
    assert_eq!(format!("{:?}", convert::prediction(bytes).ok()), format!("{usual:?}"), "it depends on how it is read");
    if let Some(prediction) = usual {
        let step = prediction.step;
        let _ = prediction.check(step);
    }
    recorded_prediction(bytes);
}

/// Any bytes as `TakenAgents`: who is taken over is told on as it was told.
///
/// # Panics
/// If that does not hold.
pub fn taken(bytes: &[u8]) {
    let Ok(message) = decode::<proto::TakenAgents>(bytes) else { return };
    let step = message.step;
    if let Ok(taken) = KnownWays::default().taken(message) {
        // Only the ways of those who are taken over at this very step are told with them.
        let new: Vec<_> = taken.into_iter().filter(|taken| taken.since_step == step).collect();
        let told = convert::taken_agents(step, &new);
        // As text, because NaN differs from itself.
        let again = KnownWays::default().taken(told).map(|again| format!("{again:?}"));
        assert_eq!(again, Ok(format!("{new:?}")));
    }
}

/// Any bytes as `TrafficMoves`: see `message`; and the check that follows takes it or refuses it.
pub fn moves(bytes: &[u8]) {
    if let Some(moves) = message::<proto::TrafficMoves, UncheckedMoves>(bytes) {
        let step = moves.step;
        let _ = moves.check(step, &[]);
    }
}

/// Any bytes as a prediction in a recording: what is unpacked is packed to what leads back to it.
///
/// # Panics
/// If that does not hold.
pub fn recorded_prediction(bytes: &[u8]) {
    let told = compact::unpack(bytes);
    let Ok(prediction) = decode::<proto::Prediction>(&told) else { return };
    if let Some(packed) = compact::pack(&prediction, &told) {
        assert_eq!(compact::unpack(&packed), told);
    }
}

/// Any text as a key: what parses is written as the same key again.
///
/// # Panics
/// If that does not hold.
pub fn key(bytes: &[u8]) {
    let Ok(key) = std::str::from_utf8(bytes) else { return };
    let Some(place) = Place::of(key) else { return };
    if let Some(address) = Address::parse(key) {
        assert_eq!(place.tape(&address), key);
    }
    if let Some(answer) = Answering::parse(key) {
        assert_eq!(place.answer(&answer), key);
    }
    if let Some(worker) = Place::told_of(key) {
        assert_eq!(place.told(&Workers::One(worker)), key);
    }
    if let Some(node) = NodeId::parse(key) {
        assert_eq!(NodeId::parse(&node.key(&place)), Some(node));
    }
}

/// Any bytes as what the simulator tells: what is taken out of the envelope is the same when it is put in again; then see `message`.
///
/// # Panics
/// If that does not hold.
pub fn told(bytes: &[u8]) {
    match envelope::<Telling>(bytes) {
        Some((Telling::Scene, message)) => scene(message),
        Some((Telling::Observation, message)) => observation(message),
        Some((Telling::Prediction, message)) => prediction(message),
        Some((Telling::Taken, message)) => taken(message),
        Some((Telling::End, _)) | None => {}
    }
}

/// Any bytes as what a node answers: see `told`.
///
/// # Panics
/// If that does not hold.
pub fn answer(bytes: &[u8]) {
    match envelope::<Saying>(bytes) {
        Some((Saying::Plan, message)) => plan(message),
        Some((Saying::Prediction, message)) => prediction(message),
        Some((Saying::Moves, message)) => moves(message),
        Some((Saying::Done, _)) | None => {}
    }
}

/// Any bytes as the simulator's word to a node that asks to be let in.
pub fn admission(bytes: &[u8]) {
    if let Ok(word) = decode::<proto::Admission>(bytes) {
        assert!(!shown(&word.reason).chars().any(char::is_control));
    }
}

/// Any bytes as a Zenoh configuration: it is taken or refused.
pub fn zenoh_config(bytes: &[u8]) {
    if let Ok(text) = std::str::from_utf8(bytes) {
        let _ = ZenohFile::parse("/mine.json5".into(), text).map_err(|error| error.to_string());
    }
}

/// Any bytes as what a service is asked: what is read is read again as it is sent on.
///
/// # Panics
/// If that does not hold.
pub fn asked(bytes: &[u8]) {
    if let Ok(what) = service::read(bytes) {
        let sent = proto::service::Ask { what: Some(what.clone()) }.encode_to_vec();
        assert_eq!(service::read(&sent), Ok(what));
    }
}

/// Any bytes as what a service answers.
pub fn replied(bytes: &[u8]) {
    let _ = decode::<proto::service::Reply>(bytes);
}

fn envelope<C: Content + PartialEq + Debug>(bytes: &[u8]) -> Option<(C, &[u8])> {
    let (episode, content, message) = open::<C>(bytes).ok()?;
    let sealed = seal(episode, content, message.into());
    assert_eq!(open::<C>(&sealed.to_bytes()).ok(), Some((episode, content, message)));
    Some((content, message))
}

/// Any bytes as a message: no panic; and what is taken, sent on and taken again is the same.
///
/// # Panics
/// If that does not hold.
fn message<P, W>(bytes: &[u8]) -> Option<W>
where
    P: Message + for<'a> From<&'a W>,
    W: TryFrom<P, Error = MessageError> + Debug,
{
    message_by(bytes, W::try_from)
}

fn message_by<P, W>(bytes: &[u8], taken: impl Fn(P) -> Result<W, MessageError>) -> Option<W>
where
    P: Message + for<'a> From<&'a W>,
    W: Debug,
{
    let first = decode::<P>(bytes).and_then(&taken).ok()?;
    let again = |value: &W| {
        let sent = P::from(value).encode_to_vec();
        decode::<P>(&sent).and_then(&taken).map_err(|e| format!("{value:?} is refused when sent on: {e}"))
    };
    let once = again(&first).unwrap_or_else(|e| panic!("{e}"));
    let twice = again(&once).unwrap_or_else(|e| panic!("{e}"));
    // As text, because NaN differs from itself.
    assert_eq!(format!("{once:?}"), format!("{twice:?}"), "sending it on changes it");
    Some(first)
}
