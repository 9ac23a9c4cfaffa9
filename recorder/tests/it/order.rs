//! Whatever the order of arrival, the order of the recording is one.

use proptest::prelude::*;
use recorder::message::{Body, Message};
use recorder::sequence::{Answers, Counts, Sequence};
use wire::proto;

use crate::synthetic::{self, SMALL};

fn drain(sequence: &mut Sequence) -> Vec<Message> {
    std::iter::from_fn(|| sequence.pop()).collect()
}

fn sorted(predictor: bool, arrivals: impl IntoIterator<Item = Message>) -> (Vec<Message>, Sequence) {
    let mut sequence = Sequence::new(Answers { predictor, traffic: false });
    let mut given = Vec::new();
    for message in arrivals {
        sequence.push(message).unwrap();
        given.extend(drain(&mut sequence));
    }
    sequence.close();
    given.extend(drain(&mut sequence));
    (given, sequence)
}

/// A plan that answers nothing.
fn stray_plan(step: u32) -> Message {
    Message::encode(Body::Plan(proto::Plan { step, status: "stray".to_owned(), ..proto::Plan::default() }))
}

proptest! {
    #[test]
    fn any_order_of_arrival_gives_the_same_sequence(arrivals in Just(synthetic::episode("s", SMALL)).prop_shuffle()) {
        let (given, _) = sorted(true, arrivals);
        prop_assert_eq!(given, synthetic::episode("s", SMALL));
    }

    #[test]
    fn what_is_said_twice_is_recorded_once(twice in 0_usize..20, arrivals in Just(synthetic::episode("s", SMALL)).prop_shuffle()) {
        let mut arrivals = arrivals;
        let again = arrivals[twice].clone();
        prop_assume!(matches!(again.body, Body::Scene(_) | Body::Observation(_) | Body::Record(_)));
        arrivals.push(again);
        let (given, sequence) = sorted(true, arrivals);
        prop_assert_eq!(given, synthetic::episode("s", SMALL));
        prop_assert_eq!(sequence.ignored(), 1);
    }

    #[test]
    fn an_answer_to_no_question_comes_before_the_end(step in 5_u32.., place in 0_usize..27) {
        let mut expected = synthetic::episode("s", SMALL);
        let mut arrivals = expected.clone();
        arrivals.insert(place.min(arrivals.len()), stray_plan(step));
        expected.insert(expected.len() - 1, stray_plan(step));
        let (given, sequence) = sorted(true, arrivals);
        prop_assert_eq!(given, expected);
        prop_assert_eq!(sequence.counts().plans, 6);
    }
}

#[test]
fn a_second_answer_comes_before_the_end_too() {
    let mut expected = synthetic::episode("s", SMALL);
    let mut arrivals = expected.clone();
    arrivals.insert(10, stray_plan(1));
    arrivals.insert(20, stray_plan(0));
    let end = expected.pop();
    expected.extend([stray_plan(0), stray_plan(1)].into_iter().chain(end));
    let (given, sequence) = sorted(true, arrivals);
    let said =
        |messages: &[Message]| messages.iter().map(|message| (message.channel(), message.step())).collect::<Vec<_>>();
    assert_eq!(said(&given), said(&expected));
    assert_eq!(sequence.counts().plans, 7);
}

#[test]
fn a_step_is_given_out_as_soon_as_it_is_complete() {
    let episode = synthetic::episode("s", SMALL);
    let mut sequence = Sequence::new(Answers { predictor: true, traffic: false });
    let mut given = Vec::new();
    // Scene, then observation, prediction, plan and record of step 0.
    for message in &episode[..5] {
        sequence.push(message.clone()).unwrap();
        given.extend(drain(&mut sequence));
    }
    assert_eq!(given, episode[..5]);
    assert!(!sequence.is_whole());
}

#[test]
fn nothing_is_given_out_before_the_scene() {
    let episode = synthetic::episode("s", SMALL);
    let mut sequence = Sequence::new(Answers { predictor: true, traffic: false });
    for message in &episode[1..] {
        sequence.push(message.clone()).unwrap();
    }
    assert_eq!(sequence.pop(), None);
    sequence.push(episode[0].clone()).unwrap();
    assert!(sequence.is_whole());
    assert_eq!(drain(&mut sequence).len(), episode.len() - 1);
    sequence.close();
    assert_eq!(drain(&mut sequence).len(), 1);
}

#[test]
fn the_answer_that_was_refused_is_recorded() {
    let episode = synthetic::episode("s", SMALL);
    // The driver fails at the last step: its answers are told, no record follows.
    let is_last_record = |message: &Message| matches!(&message.body, Body::Record(record) if record.step == 4);
    let expected: Vec<Message> = episode.into_iter().filter(|message| !is_last_record(message)).collect();
    let (given, sequence) = sorted(true, expected.clone());
    assert!(given == expected);
    assert_eq!(
        sequence.counts(),
        Counts { observations: 5, predictions: 5, plans: 5, moves: 0, records: 4, events: 2 }
    );
}

#[test]
fn a_run_without_a_predictor_waits_for_none() {
    let without = synthetic::episode("s", synthetic::Size { futures: 0, ..SMALL });
    let mut sequence = Sequence::new(Answers { predictor: false, traffic: false });
    without.iter().for_each(|message| sequence.push(message.clone()).unwrap());
    assert!(sequence.is_whole());
}

#[test]
fn a_lost_message_is_named() {
    let mut episode = synthetic::episode("s", SMALL);
    episode.remove(3);
    let mut sequence = Sequence::new(Answers { predictor: true, traffic: false });
    episode.iter().for_each(|message| sequence.push(message.clone()).unwrap());
    assert!(!sequence.is_whole());
    let expected = Counts::of_end(sequence.end().unwrap());
    assert_eq!(sequence.counts().first_difference(&expected), Some(("plans", 4, 5)));
}
