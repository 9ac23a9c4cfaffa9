//! Laws of the conversion: what is sent is what arrives, and no bytes whatever bring it down.

use std::sync::Arc;

use proptest::collection::vec;
use proptest::prelude::*;
use prost::Message as _;
use world::geometry::{Point3, Pose};
use world::map::*;
use world::observation::*;
use world::plan::*;
use world::reference_line::{ReferenceLine, ReferenceWindow};
use world::scene::bridged::SeenSignal;
use world::scene::{AgentKind, AgentState, SceneId, TrackId};
use world::signal::{Signal, SignalState};

use super::*;
use crate::{convert, fuzzing};

fn number() -> impl Strategy<Value = f64> {
    -1e5..1e5
}

fn state() -> impl Strategy<Value = AgentState> {
    (vec(number(), 6), vec(0.0..20.0, 3)).prop_map(|(n, size)| AgentState {
        x: n[0],
        y: n[1],
        z: n[2],
        heading: n[3],
        velocity_x: n[4],
        velocity_y: n[5],
        length: size[0],
        width: size[1],
        height: size[2],
    })
}

fn agents() -> impl Strategy<Value = Vec<ObservedAgent>> {
    let kind =
        prop::sample::select(vec![AgentKind::Vehicle, AgentKind::Pedestrian, AgentKind::Cyclist, AgentKind::Other]);
    let agent = (any::<i32>(), kind, state(), any::<u32>());
    vec(
        agent.prop_map(|(track, kind, state, unseen)| ObservedAgent { track: TrackId(track), kind, state, unseen }),
        0..6,
    )
}

fn points() -> impl Strategy<Value = Vec<Point3>> {
    vec((number(), number(), number()).prop_map(|(x, y, z)| Point3 { x, y, z }), 1..8)
}

fn line(samples: std::ops::Range<usize>) -> impl Strategy<Value = ReferenceLine> {
    vec((vec(number(), 6), any::<bool>()), samples).prop_map(|rows| {
        let column = |k: usize| rows.iter().map(|(row, _)| row[k]).collect();
        ReferenceLine {
            x: column(0),
            y: column(1),
            z: column(2),
            heading: column(3),
            curvature: column(4),
            speed_limit: column(5),
            crosswalk: rows.iter().map(|(_, crosswalk)| *crosswalk).collect(),
        }
    })
}

fn observation() -> impl Strategy<Value = Observation> {
    let state_of_signal =
        prop::sample::select(vec![SignalState::Stop, SignalState::Go, SignalState::ArrowCaution, SignalState::Unknown]);
    let signal = (any::<i64>(), state_of_signal, number(), any::<u32>()).prop_map(|(lane, state, x, unseen)| {
        let signal = Signal { lane: MapId(lane), state, stop_point: Point3 { x, y: -x, z: 1.0 } };
        SeenSignal { signal, unseen }
    });
    (any::<u32>(), state(), agents(), vec(signal, 0..3), line(3..9), number()).prop_map(
        |(step, av, agents, signals, line, a)| Observation {
            step,
            log_index: step.wrapping_add(19),
            av,
            control: Control { acceleration: a, steering: -a },
            agents,
            signals,
            window: ReferenceWindow {
                start: 1,
                samples: line.x.len() - 1,
                first_sample: 1,
                red_stops: vec![0, line.x.len() as u32 - 2],
                speed_limit: (a > 0.0).then_some(a),
                line: Arc::new(line),
            },
        },
    )
}

fn briefing() -> impl Strategy<Value = Briefing> {
    (points(), points(), line(0..9), vec((state(), agents()), 0..3)).prop_map(|(a, b, line, history)| {
        let segment = BoundarySegment {
            lane_start_index: 0,
            lane_end_index: 1,
            feature: MapId(5),
            kind: RoadLineKind::SolidSingleWhite,
        };
        let neighbor = LaneNeighbor {
            lane: MapId(9),
            self_start_index: 1,
            self_end_index: 2,
            neighbor_start_index: 3,
            neighbor_end_index: 4,
            boundaries: vec![segment],
        };
        let lane = Lane {
            id: MapId(4),
            kind: LaneKind::SurfaceStreet,
            speed_limit_mph: 25.0,
            interpolating: true,
            centerline: a.clone(),
            entries: vec![MapId(1)],
            exits: vec![MapId(2), MapId(3)],
            left_neighbors: vec![neighbor.clone()],
            right_neighbors: vec![neighbor],
            left_boundaries: vec![segment],
            right_boundaries: vec![],
        };
        let area = |id: i64| Area { id: MapId(id), polygon: b.clone() };
        Briefing {
            scene: SceneId::new("scene-1").unwrap(),
            protocol: "strict".to_owned(),
            start: 19,
            horizon: 150,
            wheelbase: 3.089,
            map: Arc::new(Map {
                lanes: vec![lane],
                road_lines: vec![RoadLine {
                    id: MapId(5),
                    kind: RoadLineKind::BrokenDoubleYellow,
                    polyline: b.clone(),
                }],
                road_edges: vec![RoadEdge { id: MapId(6), kind: RoadEdgeKind::Median, polyline: a.clone() }],
                stop_signs: vec![StopSign { id: MapId(7), lanes: vec![MapId(4)], position: a[0] }],
                crosswalks: vec![area(10)],
                speed_bumps: vec![area(11)],
                driveways: vec![area(12)],
            }),
            route: vec![MapId(4), MapId(2)],
            reference_line: Arc::new(line),
            history: history
                .into_iter()
                .enumerate()
                .map(|(i, (av, agents))| HistoryStep { log_index: i as u32, av, agents })
                .collect(),
        }
    })
}

fn plan() -> impl Strategy<Value = UncheckedPlan> {
    (any::<u32>(), vec(number(), 0..60), vec(number(), 0..60)).prop_map(|(step, xs, accelerations)| UncheckedPlan {
        step,
        states: xs.iter().map(|&x| PlanState { x, y: 2.0 * x, heading: -x, speed: 0.5 * x }).collect(),
        controls: accelerations.iter().map(|&a| Control { acceleration: a, steering: 0.1 * a }).collect(),
        diagnostics: Diagnostics {
            objective: vec![("speed".to_owned(), 1.5)],
            iterations: 7,
            status: "converged".to_owned(),
        },
    })
}

fn prediction() -> impl Strategy<Value = UncheckedPrediction> {
    (any::<u32>(), vec((vec(number(), 0..60), vec(number(), 0..60)), 0..4)).prop_map(|(step, futures)| {
        UncheckedPrediction {
            step,
            futures: futures
                .into_iter()
                .map(|(xs, accelerations)| Future {
                    probability: 0.25,
                    trajectories: vec![PredictedTrajectory {
                        track: TrackId(3),
                        poses: xs.iter().map(|&x| Pose::new(x, -x, 0.1 * x)).collect(),
                    }],
                    controls: accelerations.iter().map(|&a| Control { acceleration: a, steering: 0.1 * a }).collect(),
                })
                .collect(),
            initial_controls: vec![Control::default(); 2],
            cost_weights: vec![1.0, 2.0],
        }
    })
}

/// Sends `value` through its message's bytes.
fn through<P: Message, W>(message: P) -> Result<W, MessageError>
where
    W: TryFrom<P, Error = MessageError>,
{
    W::try_from(decode::<P>(&message.encode_to_vec())?)
}

fn take_as_anything(bytes: &[u8]) {
    fuzzing::scene(bytes);
    fuzzing::observation(bytes);
    fuzzing::plan(bytes);
    fuzzing::prediction(bytes);
    fuzzing::told(bytes);
    fuzzing::answer(bytes);
    fuzzing::admission(bytes);
    fuzzing::asked(bytes);
    fuzzing::replied(bytes);
    fuzzing::key(bytes);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_briefing_arrives_as_it_was_sent(briefing in briefing()) {
        prop_assert_eq!(through::<proto::Scene, Briefing>((&briefing).into()).unwrap(), briefing);
    }

    #[test]
    fn an_observation_arrives_as_it_was_sent(observation in observation()) {
        let line = Arc::clone(&observation.window.line);
        let sent = proto::Observation::from(&observation).encode_to_vec();
        prop_assert_eq!(convert::observation(decode(&sent).unwrap(), &line).unwrap(), observation);
    }

    #[test]
    fn an_observation_of_version_2_is_read_by_its_own_samples_and_known_by_their_number(observation in observation()) {
        let line = Arc::clone(&observation.window.line);
        let sent = proto::Observation::from(&observation);
        let whole = proto::ReferenceLine::from(line.as_ref());
        let mut window = whole.clone();
        for column in
            [&mut window.x, &mut window.y, &mut window.z, &mut window.heading, &mut window.curvature, &mut window.speed_limit]
        {
            column.remove(0);
        }
        window.crosswalk.remove(0);
        if let Some(limit) = sent.window_speed_limit {
            window.speed_limit.fill(limit);
        }
        let old = proto::Observation { window: Some(window), window_samples: 0, window_speed_limit: None, ..sent.clone() };
        let read = convert::observation(old.clone(), &Arc::default()).unwrap();
        prop_assert_eq!((read.window.start, read.window.first_sample, read.window.samples), (0, 1, line.len() - 1));
        let limits: Vec<f64> = (0..read.window.samples).map(|k| read.window.speed_limit_at(k)).collect();
        let expected: Vec<f64> = (1..line.len()).map(|k| observation.window.speed_limit_at(k)).collect();
        prop_assert_eq!(limits, expected);
        prop_assert_eq!(convert::by_number(old.clone(), &whole), sent.clone());
        prop_assert_eq!(convert::by_number(old.clone(), &proto::ReferenceLine::default()), old);
        prop_assert_eq!(convert::by_number(sent.clone(), &whole), sent);
    }

    #[test]
    fn a_plan_arrives_as_it_was_sent(plan in plan()) {
        prop_assert_eq!(through::<proto::Plan, UncheckedPlan>((&plan).into()).unwrap(), plan);
    }

    #[test]
    fn a_prediction_arrives_as_it_was_sent(prediction in prediction()) {
        prop_assert_eq!(through::<proto::Prediction, UncheckedPrediction>((&prediction).into()).unwrap(), prediction);
    }

    #[test]
    fn noise_is_refused_or_taken_but_never_a_panic(bytes in vec(any::<u8>(), 0..300)) {
        take_as_anything(&bytes);
    }

    #[test]
    fn texts_that_look_like_keys_are_taken_or_refused(key in "reloop/[a-z]{0,2}/(@seat-[a-z0-9]{0,2}/)?(@tape/|@node/)?([a-z@*0-9]{0,3}/){0,5}(told|plan|end|1|x)?") {
        fuzzing::key(key.as_bytes());
    }

    #[test]
    fn damaged_messages_are_refused_or_taken_but_never_a_panic(
        briefing in briefing(),
        observation in observation(),
        prediction in prediction(),
        damage in vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in any::<prop::sample::Index>(),
    ) {
        let messages = [
            proto::Scene::from(&briefing).encode_to_vec(),
            proto::Observation::from(&observation).encode_to_vec(),
            proto::Prediction::from(&prediction).encode_to_vec(),
        ];
        for mut bytes in messages {
            for (place, byte) in &damage {
                let place = place.index(bytes.len());
                bytes[place] = *byte;
            }
            take_as_anything(&bytes);
            take_as_anything(&bytes[..cut.index(bytes.len())]);
        }
    }
}

fn field(result: Result<impl Sized, MessageError>) -> (String, Problem) {
    match result.map(|_| ()) {
        Err(MessageError::Field { field, problem, .. }) => (field, problem),
        other => panic!("a field's error was expected, not {other:?}"),
    }
}

fn honest_observation() -> proto::Observation {
    let agent = proto::Agent { track: 1, kind: 1, state: Some(proto::AgentState::default()), unseen: 0 };
    proto::Observation {
        av: Some(proto::AgentState::default()),
        agents: vec![agent; 2],
        window_samples: 1,
        ..Default::default()
    }
}

/// As whoever has a line of one sample reads it.
fn read(message: proto::Observation) -> Result<Observation, MessageError> {
    let [x, y, z, heading, curvature, speed_limit] = std::array::from_fn(|_| vec![0.0]);
    let line = ReferenceLine { x, y, z, heading, curvature, speed_limit, crosswalk: vec![false] };
    convert::observation(message, &Arc::new(line))
}

#[test]
fn an_error_names_the_field() {
    assert!(read(honest_observation()).is_ok());

    let mut message = honest_observation();
    message.av = None;
    assert_eq!(field(read(message)), ("av".to_owned(), Problem::Missing));

    let mut message = honest_observation();
    message.agents[1].state.as_mut().unwrap().velocity_y = f64::NAN;
    assert_eq!(field(read(message)), ("agents[1].state.velocity_y".to_owned(), Problem::NotFinite));

    let mut message = honest_observation();
    message.agents[0].kind = 9;
    assert_eq!(field(read(message)), ("agents[0].kind".to_owned(), Problem::UnknownValue(9)));

    let mut message = honest_observation();
    message.window_first_sample = 1;
    assert_eq!(field(read(message)), ("window_samples".to_owned(), Problem::TooLong { limit: 0, got: 1 }));

    let mut message = honest_observation();
    message.window_first_sample = 2;
    let problem = Problem::OutOfRange { index: 2, samples: 1 };
    assert_eq!(field(read(message)), ("window_first_sample".to_owned(), problem));

    let mut message = honest_observation();
    message.window = Some(proto::ReferenceLine { x: vec![1.0], ..Default::default() });
    let problem = Problem::UnequalColumns { expected: 1, got: 0 };
    assert_eq!(field(read(message)), ("window.y".to_owned(), problem));

    let mut message = honest_observation();
    message.red_stops = vec![1];
    let problem = Problem::OutOfRange { index: 1, samples: 1 };
    assert_eq!(field(read(message)), ("red_stops[0]".to_owned(), problem));
}

#[test]
fn a_message_that_is_too_big_is_not_even_decoded() {
    let bytes = vec![0; proto::Plan::MAX_BYTES + 1];
    assert!(matches!(decode::<proto::Plan>(&bytes), Err(MessageError::TooBig { message: "Plan", .. })));
}

#[test]
fn a_node_that_cannot_answer_is_quoted() {
    let message = proto::Plan { error: "no lane here".to_owned(), ..Default::default() };
    let refused = MessageError::Refused("no lane here".to_owned());
    assert_eq!(UncheckedPlan::try_from(message), Err(refused.clone()));
    assert_eq!(refused.to_string(), "it cannot answer: no lane here");
}

#[test]
fn a_negative_zero_arrives_as_zero_whatever_library_sent_it() {
    // As Google's protobuf writes `PlanState(x=-0.0)`; prost leaves the field out.
    let x_of_first_state = [0x12, 9, 0x09, 0, 0, 0, 0, 0, 0, 0, 0x80];
    let message = decode::<proto::Plan>(&x_of_first_state).unwrap();
    assert!(message.states[0].x.is_sign_negative());
    let plan = UncheckedPlan::try_from(message).unwrap();
    assert!(plan.states[0].x.is_sign_positive());
    let text = |zero: f64| {
        let state = proto::PlanState { x: zero, y: zero, heading: zero, speed: zero };
        let control = proto::Control { acceleration: zero, steering: zero };
        let term = proto::ObjectiveTerm { name: "t".to_owned(), value: zero };
        let plan =
            proto::Plan { states: vec![state], controls: vec![control], objective: vec![term], ..Default::default() };
        let trajectory = proto::PredictedTrajectory {
            track: 1,
            x: vec![zero],
            y: vec![zero],
            heading: vec![zero],
            ..Default::default()
        };
        let future = proto::Future {
            probability: zero,
            trajectories: vec![trajectory],
            controls: vec![control],
            ..Default::default()
        };
        let prediction = proto::Prediction {
            futures: vec![future],
            initial_controls: vec![control],
            cost_weights: vec![zero],
            ..Default::default()
        };
        let (plan, prediction) = (UncheckedPlan::try_from(plan), UncheckedPrediction::try_from(prediction));
        format!("{plan:?} {prediction:?}")
    };
    assert_eq!(text(-0.0), text(0.0));
    let mut observation = proto::Observation::from(&crate::node::desk::tests::observation(0));
    let mut seen = |zero: f64| {
        let av = proto::AgentState { x: zero, y: zero, z: zero, heading: zero, velocity_x: zero, ..Default::default() };
        observation.av = Some(av);
        observation.window_speed_limit = Some(zero);
        format!("{:?}", read(observation.clone()).unwrap())
    };
    assert_eq!(seen(-0.0), seen(0.0));
}

#[test]
fn control_characters_of_nodes_are_escaped() {
    let plan = proto::Plan { error: "no\u{1b}[2Jway\n\rahead é".to_owned(), ..Default::default() };
    let error = UncheckedPlan::try_from(plan).unwrap_err().to_string();
    assert_eq!(error, r"it cannot answer: no\u{1b}[2Jway\n\rahead é");
    let plan = proto::Plan { status: "fine\u{7}".to_owned(), ..Default::default() };
    assert_eq!(UncheckedPlan::try_from(plan).unwrap().diagnostics.status, r"fine\u{7}");
}
