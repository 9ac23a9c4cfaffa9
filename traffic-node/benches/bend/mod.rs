//! A drive of 3 s in three lanes of dense traffic behind and beside an AV, in a bend: 64 agents that react.

use std::sync::Arc;

use traffic_node::{Cast, Characters, TrafficFactory};
use world::geometry::{Point, Point3};
use world::map::{Lane, LaneNeighbor, Map, MapId};
use world::observation::{Briefing, Observation, ObservedAgent};
use world::plan::{Control, STEP_SECONDS};
use world::reference_line::{ReferenceLine, ReferenceWindow};
use world::scene::{AgentKind, AgentState, SceneId, TrackId};
use world::traffic::{Taken, Ways};

pub const AGENTS: usize = 64;
pub const STEPS: u32 = 30;

/// Radius of the road's bend (m).
const RADIUS: f64 = 150.0;

const LANES: usize = 3;
const POINTS: i32 = 1200;

fn place(along: f64, left: f64) -> (Point, f64) {
    let heading = along / RADIUS;
    let radius = RADIUS - left;
    (Point::new(radius * libm::sin(heading), RADIUS - radius * libm::cos(heading)), heading)
}

fn left(lane: usize) -> f64 {
    3.5 * (lane as f64 - 1.0)
}

fn map() -> Arc<Map> {
    let point = |along: f64, lane| {
        let (point, _) = place(along, left(lane));
        Point3::new(point.x, point.y, 0.0)
    };
    let beside = |lane: usize| LaneNeighbor {
        lane: MapId(lane as i64),
        self_start_index: 0,
        self_end_index: POINTS - 1,
        neighbor_start_index: 0,
        neighbor_end_index: POINTS - 1,
        boundaries: Vec::new(),
    };
    let lane = |lane: usize| Lane {
        id: MapId(lane as i64),
        speed_limit_mph: 30.0,
        centerline: (0..POINTS).map(|k| point(-200.0 + 0.5 * f64::from(k), lane)).collect(),
        left_neighbors: (lane + 1 < LANES).then(|| beside(lane + 1)).into_iter().collect(),
        right_neighbors: lane.checked_sub(1).map(beside).into_iter().collect(),
        ..Lane::default()
    };
    Arc::new(Map { lanes: (0..LANES).map(lane).collect(), ..Map::default() })
}

fn state(along: f64, lane: usize, speed: f64) -> AgentState {
    let (point, heading) = place(along, left(lane));
    let velocity = Point::unit(heading) * speed;
    AgentState {
        x: point.x,
        y: point.y,
        heading,
        velocity_x: velocity.x,
        velocity_y: velocity.y,
        length: 4.6,
        width: 2.0,
        height: 1.6,
        ..AgentState::default()
    }
}

fn line() -> Arc<ReferenceLine> {
    let at = |k: usize| place(-100.0 + 0.1 * k as f64, 0.0);
    let samples = 3000;
    Arc::new(ReferenceLine {
        x: (0..samples).map(|k| at(k).0.x).collect(),
        y: (0..samples).map(|k| at(k).0.y).collect(),
        z: vec![0.0; samples],
        heading: (0..samples).map(|k| at(k).1).collect(),
        curvature: vec![1.0 / RADIUS; samples],
        speed_limit: vec![13.0; samples],
        crosswalk: vec![false; samples],
    })
}

/// Where agent number `index` begins, its lane, and its speed (m/s).
fn start(index: usize) -> (f64, usize, f64) {
    (-110.0 + 10.0 * (index / 3) as f64 + 2.0 * (index % 3) as f64, index % 3, 8.0)
}

pub struct Drive {
    pub briefing: Briefing,
    pub steps: Vec<(Observation, Vec<Taken>)>,
}

/// The drive as it comes out: moves are played back to the model, so that each round is the same.
pub fn drive() -> Drive {
    let (map, line) = (map(), line());
    let ways = Ways::on(&map);
    let briefing = Briefing {
        scene: SceneId::new("bend").unwrap(),
        protocol: "strict".to_owned(),
        start: 19,
        horizon: 150,
        wheelbase: 3.089,
        map,
        route: vec![MapId(1)],
        reference_line: Arc::clone(&line),
        history: Vec::new(),
    };
    let mut taken: Vec<Taken> = (0..AGENTS)
        .map(|index| {
            let (along, lane, speed) = start(index);
            let log: Vec<_> = (0..100).map(|k| Some(state(along + 0.1 * f64::from(k) * speed, lane, speed))).collect();
            let way = Arc::new(ways.of_log(&log, 0, AgentKind::Vehicle).unwrap());
            let track = TrackId(index as i32 + 1);
            Taken { track, kind: AgentKind::Vehicle, since_step: 0, state: state(along, lane, speed), way }
        })
        .collect();
    let mut traffic = Characters { cast: Cast::Idm, seed: 1 }.start(&briefing).unwrap();
    let mut steps = Vec::new();
    for step in 0..STEPS {
        // The AV is a little slower than everybody behind it.
        let av = state(6.0 * STEP_SECONDS * f64::from(step), 1, 6.0);
        let agents = taken.iter().map(|agent| ObservedAgent {
            track: agent.track,
            kind: agent.kind,
            state: agent.state,
            unseen: 0,
        });
        let window = ReferenceWindow {
            line: Arc::clone(&line),
            start: 0,
            samples: 1200,
            first_sample: 0,
            red_stops: Vec::new(),
            speed_limit: None,
        };
        let observation = Observation {
            step,
            log_index: 19 + step,
            av,
            control: Control::default(),
            agents: agents.collect(),
            signals: Vec::new(),
            window,
        };
        let moves = traffic.moves(&observation, &taken).unwrap().check(step, &taken).unwrap();
        steps.push((observation, taken.clone()));
        for (agent, told) in taken.iter_mut().zip(moves.moves()) {
            agent.state = told.state;
        }
    }
    Drive { briefing, steps }
}
