//! Changes of lane, on a road of two lanes.

use std::sync::Arc;

use traffic_node::{Cast, Characters};
use world::geometry::{Point3, Pose};
use world::map::{BoundarySegment, Lane, LaneNeighbor, Map, MapId, RoadLineKind};
use world::observation::{Briefing, Observation, ObservedAgent};
use world::plan::Control;
use world::reference_line::{ReferenceLine, ReferenceWindow};
use world::scene::{AgentKind, AgentState, SceneId, TrackId};
use world::traffic::{Taken, Ways};

/// Two lanes to the east, 1 on the right; what lies between them is painted so.
fn road(between: RoadLineKind) -> Arc<Map> {
    let points = 1200;
    let lane = |id: i64, other: i64, y: f64| {
        let last = points - 1;
        let boundary = BoundarySegment { lane_start_index: 0, lane_end_index: last, feature: MapId(9), kind: between };
        let beside = LaneNeighbor {
            lane: MapId(other),
            self_start_index: 0,
            self_end_index: last,
            neighbor_start_index: 0,
            neighbor_end_index: last,
            boundaries: vec![boundary],
        };
        let (left, right) = if other > id { (vec![beside], Vec::new()) } else { (Vec::new(), vec![beside]) };
        Lane {
            id: MapId(id),
            speed_limit_mph: 30.0,
            centerline: (0..points).map(|k| Point3::new(-50.0 + 0.5 * f64::from(k), y, 0.0)).collect(),
            left_neighbors: left,
            right_neighbors: right,
            ..Lane::default()
        }
    };
    Arc::new(Map { lanes: vec![lane(1, 2, 0.0), lane(2, 1, 3.5)], ..Map::default() })
}

fn state(pose: Pose, speed: f64) -> AgentState {
    let Pose { x, y, heading } = pose;
    AgentState { x, y, heading, velocity_x: speed, length: 4.6, width: 2.0, height: 1.5, ..AgentState::default() }
}

/// Where somebody at 10 m/s is, step by step, who comes up behind one who goes at 4 m/s; others, replayed, begin at the place and go at the speed that
/// `others` says. The AV is far behind.
fn drive(map: &Arc<Map>, cast: Cast, steps: u32, others: &[(f64, f64, f64)]) -> Vec<AgentState> {
    let column = |of: fn(f64) -> f64| (0..100).map(|k| of(-500.0 + 0.1 * f64::from(k))).collect::<Vec<f64>>();
    let line = Arc::new(ReferenceLine {
        x: column(|x| x),
        y: column(|_| 0.0),
        z: column(|_| 0.0),
        heading: column(|_| 0.0),
        ..ReferenceLine::default()
    });
    let briefing = Briefing {
        scene: SceneId::new("two-lanes").unwrap(),
        protocol: "strict".to_owned(),
        start: 0,
        horizon: steps,
        wheelbase: 3.0,
        map: Arc::clone(map),
        route: vec![MapId(1)],
        reference_line: Arc::clone(&line),
        history: Vec::new(),
    };
    let log: Vec<_> = (0..300).map(|k| Some(state(Pose::new(f64::from(k), 0.0, 0.0), 10.0))).collect();
    let way = Arc::new(Ways::on(map).of_log(&log, 0, AgentKind::Vehicle).unwrap());
    let kind = AgentKind::Vehicle;
    let mut taken = vec![Taken { track: TrackId(1), kind, since_step: 0, state: log[0].unwrap(), way }];
    let mut traffic = Characters { cast, seed: 1 }.company(&briefing);
    let mut states = Vec::new();
    for step in 0..steps {
        let seconds = 0.1 * f64::from(step);
        let slow = state(Pose::new(40.0 + 4.0 * seconds, 0.0, 0.0), 4.0);
        let others = others.iter().map(|(x, y, speed)| state(Pose::new(x + speed * seconds, *y, 0.0), *speed));
        let all = [taken[0].state, slow].into_iter().chain(others);
        let agents =
            all.enumerate().map(|(k, state)| ObservedAgent { track: TrackId(k as i32 + 1), kind, state, unseen: 0 });
        let window = ReferenceWindow {
            line: Arc::clone(&line),
            start: 0,
            samples: 100,
            first_sample: 0,
            red_stops: Vec::new(),
            speed_limit: None,
        };
        let observation = Observation {
            step,
            log_index: step,
            av: state(Pose::new(-500.0, 0.0, 0.0), 0.0),
            control: Control::default(),
            agents: agents.collect(),
            signals: Vec::new(),
            window,
        };
        let moves = traffic.next(&observation, &taken).check(step, &taken).unwrap();
        taken[0].state = moves.moves()[0].state;
        states.push(taken[0].state);
    }
    states
}

#[test]
fn who_is_held_up_goes_over_smoothly_and_passes() {
    let states = drive(&road(RoadLineKind::BrokenSingleWhite), Cast::Idm, 150, &[]);
    let last = states.last().unwrap();
    assert!((last.y - 3.5).abs() < 0.2 && last.speed() > 8.0, "{last:?}");
    assert!(last.x > 40.0 + 4.0 * 15.0 + 10.0, "it has passed: {last:?}");
    for pair in states.windows(2) {
        assert!((pair[1].heading - pair[0].heading).abs() < 0.04 && (pair[1].y - pair[0].y).abs() < 0.25);
    }
}

#[test]
fn nobody_goes_over_a_solid_line_or_into_somebody() {
    let stays = |states: Vec<AgentState>| states.iter().all(|state| state.y.abs() < 0.1);
    assert!(stays(drive(&road(RoadLineKind::SolidSingleWhite), Cast::Idm, 150, &[])));
    // The other lane is full: 10 m apart, as fast as it came.
    let full: Vec<_> = (-12..12).map(|k| (10.0 * f64::from(k), 3.5, 10.0)).collect();
    assert!(stays(drive(&road(RoadLineKind::BrokenSingleWhite), Cast::Idm, 150, &full)));
    assert!(stays(drive(&road(RoadLineKind::BrokenSingleWhite), Cast::Cautious, 150, &[])), "it never does");
}

#[test]
fn who_has_gone_over_sees_who_stands_beyond_the_way_that_he_took_then() {
    let standing = 240.0;
    let states = drive(&road(RoadLineKind::BrokenSingleWhite), Cast::Idm, 300, &[(standing, 3.5, 0.0)]);
    assert!(states.iter().any(|state| state.y > 3.0), "he goes over");
    let strikes = |state: &&AgentState| (state.x - standing).abs() < 4.6 && (state.y - 3.5).abs() < 2.0;
    assert_eq!(states.iter().find(strikes), None);
    assert!(states.last().unwrap().x > standing - 20.0, "he has come so far: {:?}", states.last());
}
