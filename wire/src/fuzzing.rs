//! What every input must keep, in functions that a fuzzer calls; `fuzz/` does so by the million, tests here by the thousand.

use std::fmt::Debug;

use world::observation::{Briefing, Observation};
use world::plan::{UncheckedPlan, UncheckedPrediction};

use crate::convert::{Message, MessageError, decode};
use crate::keys::{Address, NodeId, RunName};
use crate::proto;

/// Any bytes as a `Scene`: see `message`.
pub fn scene(bytes: &[u8]) {
    message::<proto::Scene, Briefing>(bytes);
}

/// Any bytes as an `Observation`: see `message`.
pub fn observation(bytes: &[u8]) {
    message::<proto::Observation, Observation>(bytes);
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
    if let Some(prediction) = message::<proto::Prediction, UncheckedPrediction>(bytes) {
        let step = prediction.step;
        let _ = prediction.check(step);
    }
}

/// Any text as a key: what parses is written as the same key again.
///
/// # Panics
/// If that does not hold.
pub fn key(bytes: &[u8]) {
    let Ok(key) = std::str::from_utf8(bytes) else { return };
    let Some(run) = key.split('/').nth(1).and_then(|run| run.parse::<RunName>().ok()) else { return };
    if let Some(address) = Address::parse(key) {
        assert!([address.key(&run), address.tape_key(&run)].iter().any(|written| written == key), "{address:?}");
    }
    if let Some(node) = NodeId::parse(key) {
        assert_eq!(NodeId::parse(&node.key(&run)), Some(node));
    }
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
    let taken = decode::<P>(bytes).and_then(W::try_from).ok()?;
    let again = |value: &W| {
        let sent = P::from(value).encode_to_vec();
        decode::<P>(&sent).and_then(W::try_from).map_err(|e| format!("{value:?} is refused when sent on: {e}"))
    };
    // The first round takes the sign of zeros away: protobuf leaves out a number that equals zero.
    let once = again(&taken).unwrap_or_else(|e| panic!("{e}"));
    let twice = again(&once).unwrap_or_else(|e| panic!("{e}"));
    // As text, because NaN differs from itself.
    assert_eq!(format!("{once:?}"), format!("{twice:?}"), "sending it on changes it");
    Some(taken)
}
