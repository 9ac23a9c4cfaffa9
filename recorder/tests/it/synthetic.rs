//! A made-up episode of any size: a crossing of two roads with agents of all kinds, 9 km from the log's origin.

use std::f64::consts::{FRAC_PI_2, PI};

use recorder::message::{Body, Message};
use wire::digest::Digest;
use wire::proto;
use wire::proto::{AgentKind, SignalState};

/// Where the crossing lies (m).
pub const CENTER: (f64, f64, f64) = (8_412.25, -9_377.5, 31.0);

/// Ground speed of the AV (m/s).
const SPEED: f64 = 8.0;

/// How large an episode is.
#[derive(Clone, Copy)]
pub struct Size {
    pub agents: usize,
    pub steps: u32,
    pub futures: usize,
}

/// A small one, for snapshots.
pub const SMALL: Size = Size { agents: 6, steps: 5, futures: 2 };

/// The settings of the made-up run.
pub const SETTINGS: &str = "driver = \"synthetic\"\nprotocol = \"strict\"\n";

/// All messages in canonical order.
pub fn episode(scene: &str, size: Size) -> Vec<Message> {
    let mut messages = vec![Body::Scene(Box::new(self::scene(scene, size)))];
    let mut events = 0;
    for step in 0..size.steps {
        messages.push(Body::Observation(Box::new(observation(step, size))));
        if size.futures > 0 {
            messages.push(Body::Prediction(prediction(step, size)));
        }
        messages.push(Body::Plan(plan(step)));
        let happens = step == size.steps / 2;
        messages.push(Body::Record(Box::new(record(step, u32::from(happens) * 2))));
        if happens {
            messages.push(Body::Event(event(step, proto::event::Kind::Speeding, "1.2 m/s above the limit")));
            messages.push(Body::Event(event(step, proto::event::Kind::LowTimeToCollision, "time to collision 0.8 s")));
            events += 2;
        }
    }
    let mut messages: Vec<Message> = messages.into_iter().map(Message::encode).collect();
    let end = proto::EpisodeEnd {
        scene: scene.to_owned(),
        protocol: "strict".to_owned(),
        reason: proto::EndReason::Horizon.into(),
        detail: String::new(),
        steps: size.steps,
        metrics: vec![
            proto::Metric { name: "progress".to_owned(), value: Some(f64::from(size.steps) * 0.1 * SPEED) },
            proto::Metric { name: "position_error_10s".to_owned(), value: None },
        ],
        observations: size.steps,
        plans: size.steps,
        predictions: if size.futures > 0 { size.steps } else { 0 },
        records: size.steps,
        events,
        digest: digest(&messages).to_bytes(),
        moves: 0,
    };
    messages.push(Message::encode(Body::End(end)));
    messages
}

/// What simulator and recorder compare.
pub fn digest(messages: &[Message]) -> Digest {
    let mut digest = Digest::default();
    messages.iter().for_each(|message| digest.add(message.channel(), &message.payload));
    digest
}

fn scene(name: &str, size: Size) -> proto::Scene {
    let line = reference_line(0, 3_000);
    proto::Scene {
        wire_version: wire::WIRE_VERSION,
        scene: name.to_owned(),
        protocol: "strict".to_owned(),
        start: 2,
        horizon: size.steps,
        wheelbase: 3.0,
        map: Some(map()),
        route: vec![1],
        reference_line: Some(line),
        history: (0..2)
            .map(|log_index| proto::HistoryStep {
                log_index,
                av: Some(av(f64::from(log_index) - 2.0)),
                agents: agents(f64::from(log_index) - 2.0, size),
            })
            .collect(),
    }
}

fn reference_line(first: usize, samples: usize) -> proto::ReferenceLine {
    let x = |index: usize| CENTER.0 - 80.0 + 0.1 * index as f64;
    proto::ReferenceLine {
        x: (first..first + samples).map(x).collect(),
        y: vec![CENTER.1 - 1.75; samples],
        z: vec![CENTER.2; samples],
        heading: vec![0.0; samples],
        curvature: vec![0.0; samples],
        speed_limit: vec![11.0; samples],
        crosswalk: vec![false; samples],
    }
}

fn straight(from: (f64, f64), to: (f64, f64), points: usize) -> Option<proto::Polyline> {
    let share = |index: usize| index as f64 / (points - 1) as f64;
    let between = |a: f64, b: f64| (0..points).map(move |index| a + share(index) * (b - a)).collect::<Vec<_>>();
    Some(proto::Polyline {
        x: between(CENTER.0 + from.0, CENTER.0 + to.0),
        y: between(CENTER.1 + from.1, CENTER.1 + to.1),
        z: vec![CENTER.2; points],
    })
}

fn map() -> proto::Map {
    let lane = |id, from, to| proto::Lane {
        id,
        kind: proto::LaneKind::SurfaceStreet.into(),
        speed_limit_mph: 25.0,
        centerline: straight(from, to, 480),
        ..proto::Lane::default()
    };
    let line = |id, kind: proto::RoadLineKind, from, to| proto::RoadLine {
        id,
        kind: kind.into(),
        polyline: straight(from, to, 120),
    };
    let edge = |id, from, to| proto::RoadEdge {
        id,
        kind: proto::RoadEdgeKind::Boundary.into(),
        polyline: straight(from, to, 120),
    };
    let yellow = proto::RoadLineKind::SolidDoubleYellow;
    let area = |id, (x, y): (f64, f64), (length, width): (f64, f64)| proto::Area {
        id,
        polygon: Some(proto::Polyline {
            x: [x, x + length, x + length, x].map(|x| CENTER.0 + x).to_vec(),
            y: [y, y, y + width, y + width].map(|y| CENTER.1 + y).to_vec(),
            z: vec![CENTER.2; 4],
        }),
    };
    proto::Map {
        lanes: vec![
            lane(1, (-80.0, -1.75), (160.0, -1.75)),
            lane(2, (160.0, 1.75), (-80.0, 1.75)),
            lane(3, (1.75, -90.0), (1.75, 90.0)),
            lane(4, (-1.75, 90.0), (-1.75, -90.0)),
        ],
        road_lines: vec![
            line(10, yellow, (-80.0, 0.0), (-8.0, 0.0)),
            line(11, yellow, (8.0, 0.0), (160.0, 0.0)),
            line(12, yellow, (0.0, -90.0), (0.0, -8.0)),
            line(13, yellow, (0.0, 8.0), (0.0, 90.0)),
        ],
        road_edges: [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
            .into_iter()
            .enumerate()
            .flat_map(|(index, (x, y))| {
                let far = if x > 0.0 { 160.0 } else { -80.0 };
                [
                    edge(20 + 2 * index as i64, (x * 6.0, y * 6.0), (far, y * 6.0)),
                    edge(21 + 2 * index as i64, (x * 6.0, y * 6.0), (x * 6.0, y * 90.0)),
                ]
            })
            .collect(),
        stop_signs: vec![proto::StopSign { id: 40, lanes: vec![3], x: CENTER.0 + 7.0, y: CENTER.1 - 9.0, z: CENTER.2 }],
        crosswalks: vec![area(50, (-10.0, -6.0), (3.0, 12.0)), area(51, (7.0, -6.0), (3.0, 12.0))],
        speed_bumps: vec![area(60, (60.0, -6.0), (1.0, 12.0))],
        driveways: Vec::new(),
    }
}

fn state(x: f64, y: f64, heading: f64, speed: f64, size: [f64; 3]) -> proto::AgentState {
    let (sine, cosine) = libm::sincos(heading);
    proto::AgentState {
        x: CENTER.0 + x,
        y: CENTER.1 + y,
        z: CENTER.2 + 0.5 * size[2],
        heading,
        velocity_x: speed * cosine,
        velocity_y: speed * sine,
        length: size[0],
        width: size[1],
        height: size[2],
    }
}

fn av(step: f64) -> proto::AgentState {
    state(-70.0 + 0.1 * SPEED * step, -1.75, 0.0, SPEED, [4.9, 2.0, 1.6])
}

fn agents(step: f64, size: Size) -> Vec<proto::Agent> {
    let agent = |index: usize| {
        let spread = index as f64 / size.agents as f64;
        let speed = 3.0 + 6.0 * ((index * 7919) % 97) as f64 / 97.0;
        let along = -75.0 + 150.0 * spread + 0.1 * speed * step * if index % 4 == 1 { -1.0 } else { 1.0 };
        let (kind, state) = match index % 4 {
            0 => (AgentKind::Vehicle, state(1.75, along, FRAC_PI_2, speed, [4.6, 1.9, 1.6])),
            1 => (AgentKind::Vehicle, state(along, 1.75, PI, speed, [5.2, 2.1, 1.9])),
            2 => (AgentKind::Pedestrian, state(-8.5 + 0.01 * spread, 0.2 * along, FRAC_PI_2, 1.3, [0.7, 0.7, 1.75])),
            _ => (AgentKind::Cyclist, state(along, 4.9, 0.0, 0.5 * speed, [1.8, 0.7, 1.7])),
        };
        proto::Agent { track: 100 + index as i32, kind: kind.into(), state: Some(state), unseen: 0 }
    };
    (0..size.agents).map(agent).collect()
}

fn observation(step: u32, size: Size) -> proto::Observation {
    let green = step > size.steps / 3;
    let signal = |lane, state: SignalState, (x, y): (f64, f64)| proto::Signal {
        lane,
        state: state.into(),
        stop_x: CENTER.0 + x,
        stop_y: CENTER.1 + y,
        stop_z: CENTER.2,
        unseen: 0,
    };
    let (own, other) =
        if green { (SignalState::Go, SignalState::Stop) } else { (SignalState::Caution, SignalState::Go) };
    let first = (8 * step) as usize;
    proto::Observation {
        step,
        log_index: 2 + step,
        av: Some(av(f64::from(step))),
        control: Some(proto::Control { acceleration: 0.1, steering: 0.0 }),
        agents: agents(f64::from(step), size),
        signals: vec![signal(1, own, (-11.0, -1.75)), signal(3, other, (1.75, -11.0))],
        window: None,
        window_first_sample: first as u32,
        window_samples: 1_200,
        red_stops: vec![300],
        window_speed_limit: None,
    }
}

fn plan(step: u32) -> proto::Plan {
    let state = |ahead: u32| {
        let av = av(f64::from(step + ahead));
        let bend = 0.0006 * f64::from(ahead * ahead);
        proto::PlanState { x: av.x, y: av.y + bend, heading: 0.02, speed: SPEED }
    };
    proto::Plan {
        step,
        states: (1..=50).map(state).collect(),
        iterations: 4,
        status: "ok".to_owned(),
        ..proto::Plan::default()
    }
}

fn prediction(step: u32, size: Size) -> proto::Prediction {
    let agents = agents(f64::from(step), size);
    let future = |number: usize| {
        let trajectory = |agent: &proto::Agent| {
            let state = agent.state.unwrap_or_default();
            let at = |velocity: f64, start: f64| {
                (1..=50).map(|t| start + 0.1 * f64::from(t) * velocity / (1.0 + number as f64)).collect()
            };
            proto::PredictedTrajectory {
                track: agent.track,
                x: at(state.velocity_x, state.x),
                y: at(state.velocity_y, state.y),
                heading: vec![state.heading; 50],
                ..Default::default()
            }
        };
        let probability = [0.7, 0.3, 0.1][number.min(2)];
        let brakes =
            |t: i32| proto::Control { acceleration: 0.5 - 0.02 * f64::from(t) * number as f64, steering: 0.01 };
        proto::Future {
            probability,
            trajectories: agents.iter().map(trajectory).collect(),
            controls: (1..=50).map(brakes).collect(),
            ..Default::default()
        }
    };
    proto::Prediction { step, futures: (0..size.futures).map(future).collect(), ..proto::Prediction::default() }
}

fn record(step: u32, events: u32) -> proto::StepRecord {
    let swing = libm::sin(0.12 * f64::from(step));
    proto::StepRecord {
        step,
        log_index: 3 + step,
        av: Some(av(f64::from(step + 1))),
        control: Some(proto::Control { acceleration: 0.8 * swing, steering: 0.03 * swing }),
        station: 10.0 + 0.8 * f64::from(step),
        speed_limit: 11.176,
        time_to_collision: (step % 60 > 20).then_some(3.0 + swing),
        position_error: Some(0.01 * f64::from(step)),
        in_one_lane: true,
        events,
        logged_av: Some(av(1.02 * f64::from(step + 1))),
        ..proto::StepRecord::default()
    }
}

fn event(step: u32, kind: proto::event::Kind, text: &str) -> proto::Event {
    proto::Event { step, kind: kind.into(), text: text.to_owned(), ..proto::Event::default() }
}
