//! No message holds a logged state later than its step.
//!
//! Every message of a recording is taken apart without its schema: whatever it holds, at any depth, that could be a place (two
//! doubles side by side, or two columns of doubles) is looked up among the places of the log. A place that no road user has been
//! at before a later step is the future.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use prost::Message;
use recorder::origin::Origin;
use scenarios::SceneSet;
use scenarios::generated::FAMILIES;
use wire::proto::{Agent, AgentState, Observation, StepRecord};
use world::scene::Scene;

use crate::recording::{Recorded, messages};
use crate::stage::{Stage, real_scenes};

/// The bits of x and y.
type Place = (u64, u64);

/// What a length-delimited field, or a whole message, may hold.
#[derive(Default)]
struct Parts {
    /// Doubles by field.
    doubles: BTreeMap<u64, u64>,
    /// Packed doubles by field.
    columns: BTreeMap<u64, Vec<u64>>,
}

fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0_u64;
    for shift in (0..64).step_by(7) {
        let (first, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(first & 0x7f) << shift;
        if first & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

fn take<'a>(bytes: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (taken, rest) = bytes.split_at_checked(count)?;
    *bytes = rest;
    Some(taken)
}

/// The places in `bytes`, if they can be read as a protobuf message.
fn places(mut bytes: &[u8], found: &mut Vec<Place>) -> Option<()> {
    let mut parts = Parts::default();
    let mut inner = Vec::new();
    while !bytes.is_empty() {
        let tag = varint(&mut bytes)?;
        let field = tag >> 3;
        match tag & 7 {
            0 => drop(varint(&mut bytes)?),
            1 => drop(parts.doubles.insert(field, u64::from_le_bytes(take(&mut bytes, 8)?.try_into().ok()?))),
            2 => {
                let length = varint(&mut bytes)?;
                let payload = take(&mut bytes, length.try_into().ok()?)?;
                if payload.len() % 8 == 0 {
                    let doubles = payload.chunks_exact(8).map(|bytes| u64::from_le_bytes(bytes.try_into().unwrap()));
                    parts.columns.insert(field, doubles.collect());
                }
                let mut below = Vec::new();
                if places(payload, &mut below).is_some() {
                    inner.append(&mut below);
                }
            }
            5 => drop(take(&mut bytes, 4)?),
            _ => return None,
        }
        if field == 0 {
            return None;
        }
    }
    found.append(&mut inner);
    if parts.doubles.contains_key(&1) || parts.doubles.contains_key(&2) {
        let part = |field| parts.doubles.get(&field).copied().unwrap_or(0);
        found.push((part(1), part(2)));
    }
    for (field, x) in &parts.columns {
        if let Some(y) = parts.columns.get(&(field + 1)).filter(|y| y.len() == x.len()) {
            found.extend(x.iter().copied().zip(y.iter().copied()));
        }
    }
    Some(())
}

/// For each place of the log, when it was first taken; and the places that give nothing away.
struct Log {
    first: BTreeMap<Place, usize>,
    /// Places of the map, which are no states.
    map: BTreeSet<Place>,
    /// Places reached by going straight on at the same speed: a predictor may well guess them to the last bit.
    steady: BTreeSet<Place>,
}

impl Log {
    /// As the log has them, or as pictures draw them from `origin`.
    fn of(scene: &Scene, origin: Option<Origin>) -> Self {
        let place = |x: f64, y: f64| match origin {
            None => (x.to_bits(), y.to_bits()),
            Some(origin) => {
                let [x, y, _] = origin.place(x, y, 0.0).map(|part| f64::from(part).to_bits());
                (x, y)
            }
        };
        let (mut first, mut steady) = (BTreeMap::new(), BTreeSet::new());
        for track in scene.tracks() {
            for states in track.states.windows(3) {
                let straight_on = match states {
                    &[Some(a), Some(b), Some(c)] => {
                        (a.x - 2.0 * b.x + c.x).abs() + (a.y - 2.0 * b.y + c.y).abs() < 1e-3
                    }
                    // Who has just appeared has, by the data set's convention, the velocity that leads to the next place.
                    _ => states[0].is_none(),
                };
                if let (true, Some(state)) = (straight_on, states[2]) {
                    steady.insert(place(state.x, state.y));
                }
            }
            for (log_index, state) in track.states.iter().enumerate() {
                let Some(state) = state else { continue };
                let seen = first.entry(place(state.x, state.y)).or_insert(log_index);
                *seen = log_index.min(*seen);
            }
        }
        let map = scene.map();
        let lines = map.lanes.iter().map(|lane| &lane.centerline);
        let lines = lines.chain(map.road_lines.iter().map(|line| &line.polyline));
        let lines = lines.chain(map.road_edges.iter().map(|edge| &edge.polyline));
        let map = lines.flatten().map(|point| place(point.x, point.y)).collect();
        Self { first, map, steady }
    }

    /// The first place in `bytes` that nobody has been at up to `now`, but somebody will be; and when. In a `guess`, not one
    /// that is reached by going straight on.
    fn future_in(&self, bytes: &[u8], now: usize, guess: bool) -> Option<usize> {
        let mut found = Vec::new();
        places(bytes, &mut found);
        let innocent = |place: &Place| self.map.contains(place) || guess && self.steady.contains(place);
        let later = found.iter().filter(|place| !innocent(place)).filter_map(|place| self.first.get(place));
        later.copied().find(|log_index| *log_index > now)
    }
}

/// What of the future the messages of a recording hold: topic, log index of the message, log index of what it holds.
fn futures(scene: &Scene, start: usize, recording: &[Recorded]) -> Vec<(String, usize, usize)> {
    let av = scene.av().states[start - 1].expect("the AV is there before the drive");
    let exact = Log::of(scene, None);
    let drawn = Log::of(scene, Some(Origin { x: av.x.round(), y: av.y.round(), z: 0.0 }));
    let mut now = start - 1;
    let mut found = Vec::new();
    for message in recording {
        match message.topic.as_str() {
            "/reloop/observation" => now = Observation::decode(&*message.bytes).unwrap().log_index as usize,
            "/reloop/record" => now = StepRecord::decode(&*message.bytes).unwrap().log_index as usize,
            _ => {}
        }
        // Plans and predictions are guesses. As they are drawn, in single precision, any of them may meet the log.
        let guess = ["/reloop/plan", "/reloop/prediction"].contains(&message.topic.as_str());
        let drawn_guess = ["/view/plan", "/view/predictions"].contains(&message.topic.as_str());
        for log in [Some(&exact), (!drawn_guess).then_some(&drawn)].into_iter().flatten() {
            if let Some(later) = log.future_in(&message.bytes, now, guess || drawn_guess) {
                found.push((message.topic.clone(), now, later));
            }
        }
    }
    found
}

/// Drives `scenarios` by `protocol` under idm with a predictor, and searches every message of every recording.
fn searched(scenarios: &[String], protocol: &str, at_least: usize) {
    let stage = Stage::new();
    let mut command = stage.command(&format!("run --driver idm --protocol {protocol} --predictor ctrv --out run"));
    if !scenarios.is_empty() {
        command.arg("--scenarios").args(scenarios);
    }
    let output = command.output().unwrap();
    assert!(matches!(output.status.code(), Some(0 | 1)), "{}", String::from_utf8_lossy(&output.stderr));
    let set = SceneSet::open(scenarios).unwrap();
    let (mut episodes, mut searched) = (0, 0);
    for (index, entry) in set.entries().iter().enumerate() {
        let path = stage.path("run/episodes").join(format!("{}.mcap", entry.id));
        if !Path::new(&path).exists() {
            continue;
        }
        let recording = messages(&path);
        let (scene, _) = set.load(index).unwrap();
        let found = futures(&scene, 19, &recording);
        assert!(found.is_empty(), "{}: {found:?}", entry.id);
        episodes += 1;
        searched += recording.len();
    }
    eprintln!("searched {searched} messages of {episodes} recordings");
    assert!(episodes >= at_least, "{episodes} episodes were recorded");
}

#[test]
fn no_message_of_the_demo_set_holds_the_future() {
    searched(&[], "strict", FAMILIES.len());
    searched(&[], "paper", FAMILIES.len());
}

#[test]
#[ignore = "takes minutes"]
fn no_message_of_50_real_episodes_holds_the_future() {
    let Some(folder) = real_scenes("womd-derived") else { return };
    searched(&[folder.to_string_lossy().into_owned()], "strict", 48);
}

#[test]
fn a_planted_future_is_found() {
    let set = SceneSet::open(&[]).unwrap();
    let (scene, _) = set.load(0).unwrap();
    let start = 19;
    let state = |track: usize, log_index: usize| scene.tracks()[track].states[log_index].as_ref().map(AgentState::from);
    let moving = (0..scene.tracks().len()).find(|track| {
        let at = |log_index| state(*track, log_index).map(|state| state.x.to_bits());
        at(start).is_some() && at(start) != at(start + 1)
    });
    let track = moving.expect("somebody moves");
    let observed = |log_index: usize| Observation {
        log_index: start as u32,
        agents: vec![Agent { track: 1, state: state(track, log_index), ..Agent::default() }],
        ..Observation::default()
    };
    let recorded =
        |message: Observation| [Recorded { topic: "/reloop/observation".to_owned(), bytes: message.encode_to_vec() }];
    assert_eq!(futures(&scene, start, &recorded(observed(start))), []);
    let found = futures(&scene, start, &recorded(observed(start + 1)));
    assert_eq!(found, [("/reloop/observation".to_owned(), start, start + 1)]);

    // As columns, as pictures draw it, and deep inside another message.
    let AgentState { x, y, .. } = state(track, start + 1).unwrap();
    let columns = wire::proto::Prediction {
        futures: vec![wire::proto::Future {
            trajectories: vec![wire::proto::PredictedTrajectory {
                track: 1,
                x: vec![1.0, x],
                y: vec![2.0, y],
                heading: vec![],
                ..Default::default()
            }],
            ..Default::default()
        }],
        ..Default::default()
    };
    let exact = Log::of(&scene, None);
    assert_eq!(exact.future_in(&columns.encode_to_vec(), start, false), Some(start + 1));
    let origin = Origin { x: 3.0, y: 4.0, z: 0.0 };
    let drawn = Log::of(&scene, Some(origin));
    let [x, y, _] = origin.place(x, y, 0.0).map(f64::from);
    let shown = wire::proto::PlanState { x, y, ..Default::default() };
    assert_eq!(drawn.future_in(&shown.encode_to_vec(), start, false), Some(start + 1));
}
