//! A hand-made scene for tests and benches: a straight road of two lanes, in which all that moves is given as functions of time.
//!
//! Lane 1 runs along +x at y = 0, lane 2 comes the other way at y = 3.5. The road ends at y = -2.5 and y = 6. The whole
//! can be laid anywhere: rules must not depend on where a road lies.

#![allow(dead_code, reason = "each test uses its part")]
#![allow(clippy::unwrap_used, missing_docs, reason = "a test may panic")]

use std::sync::Arc;

use episode::driver::Driver;
use world::geometry::{Point, Point3, Pose};
use world::map::{Lane, LaneKind, Map, MapId, RoadEdge, RoadEdgeKind};
use world::observation::Observation;
use world::plan::{Control, PLAN_STEPS, Plan, PlanState, STEP_SECONDS, UncheckedPlan};
use world::scene::{AgentKind, AgentState, Scene, SceneParts, Track, TrackId};
use world::signal::{Signal, SignalState};

/// Log index at which the drive starts, and its time (s).
pub const START: usize = 19;
pub const START_TIME: f64 = 1.9;

/// Speed limit of both lanes (mph, m/s).
pub const LIMIT_MPH: f64 = 25.0;
pub const LIMIT: f64 = 25.0 * 0.447_04;

/// Where someone is at a time (s) from the drive's start: x, y, heading, speed.
pub type Motion = Box<dyn Fn(f64) -> Option<(f64, f64, f64, f64)>>;

pub struct Mover {
    pub kind: AgentKind,
    pub z: f64,
    pub motion: Motion,
}

/// A car that goes straight on at constant speed from where it is at the drive's start.
pub fn car(x: f64, y: f64, heading: f64, speed: f64) -> Mover {
    let forward = Point::unit(heading);
    let motion = move |time: f64| Some((x + forward.x * speed * time, y + forward.y * speed * time, heading, speed));
    Mover { kind: AgentKind::Vehicle, z: 0.75, motion: Box::new(motion) }
}

/// What the scene holds.
pub struct StraightRoad {
    pub steps: usize,
    /// The logged AV; the first is it.
    pub av: Mover,
    pub others: Vec<Mover>,
    /// The stop point of lane 1 (x), red all the time.
    pub red_at: Option<f64>,
    /// Where the road's origin lies.
    pub origin: Pose,
}

impl StraightRoad {
    /// The road with a logged AV at 10 m/s from x = 0, and nobody else.
    pub fn new() -> Self {
        Self { steps: 200, av: car(0.0, 0.0, 0.0, 10.0), others: Vec::new(), red_at: None, origin: Pose::default() }
    }

    pub fn with(mut self, other: Mover) -> Self {
        self.others.push(other);
        self
    }

    pub fn scene(&self) -> Arc<Scene> {
        let tracks = std::iter::once(&self.av).chain(&self.others).enumerate();
        let tracks = tracks.map(|(index, mover)| Track {
            id: TrackId(index as i32 + 1),
            kind: mover.kind,
            states: (0..self.steps).map(|step| self.state(mover, step)).collect(),
        });
        let lane = |id, from: f64, to: f64, y| Lane {
            id: MapId(id),
            kind: LaneKind::SurfaceStreet,
            speed_limit_mph: LIMIT_MPH,
            centerline: self.line(from, to, y),
            ..Lane::default()
        };
        let edge = |id, from: f64, to: f64, y| RoadEdge {
            id: MapId(id),
            kind: RoadEdgeKind::Boundary,
            polyline: self.line(from, to, y),
        };
        let map = Map {
            lanes: vec![lane(1, -150.0, 450.0, 0.0), lane(2, 450.0, -150.0, 3.5)],
            road_edges: vec![edge(3, -150.0, 450.0, -2.5), edge(4, 450.0, -150.0, 6.0)],
            ..Map::default()
        };
        let red = self.red_at.map(|x| {
            let place = self.origin.to_world(Point::new(x, 0.0));
            let stop_point = Point3::new(place.x, place.y, 0.0);
            Signal { lane: MapId(1), state: SignalState::Stop, stop_point }
        });
        let parts = SceneParts {
            id: "straight-road".to_owned(),
            timestamps: (0..self.steps).map(|step| step as f64 * STEP_SECONDS).collect(),
            tracks: tracks.collect(),
            signals: vec![red.into_iter().collect(); self.steps],
            map,
            ..SceneParts::default()
        };
        Arc::new(parts.check().unwrap().0)
    }

    fn state(&self, mover: &Mover, step: usize) -> Option<AgentState> {
        let (x, y, heading, speed) = (mover.motion)(step as f64 * STEP_SECONDS - START_TIME)?;
        let place = self.origin.to_world(Point::new(x, y));
        let heading = heading + self.origin.heading;
        let velocity = Point::unit(heading) * speed;
        Some(AgentState {
            x: place.x,
            y: place.y,
            z: mover.z,
            heading,
            velocity_x: velocity.x,
            velocity_y: velocity.y,
            length: 5.0,
            width: 2.0,
            height: 1.5,
        })
    }

    fn line(&self, from: f64, to: f64, y: f64) -> Vec<Point3> {
        let points = 1200;
        let point = |index: i32| {
            let x = from + (to - from) * f64::from(index) / f64::from(points);
            let place = self.origin.to_world(Point::new(x, y));
            Point3::new(place.x, place.y, 0.0)
        };
        (0..=points).map(point).collect()
    }
}

/// Plans what the logged AV did.
pub struct LogReplay(pub Arc<Scene>);

impl Driver for LogReplay {
    fn plan(&mut self, observation: &Observation) -> Result<Plan, String> {
        let states = &self.0.av().states;
        let last = states.len() - 1;
        let now = observation.log_index as usize;
        let state = |step: usize| {
            let logged = states[(now + step).min(last)].or(states[now]).ok_or("the AV is not in the log")?;
            Ok(PlanState { x: logged.x, y: logged.y, heading: logged.heading, speed: logged.speed() })
        };
        let states = (1..=PLAN_STEPS).map(state).collect::<Result<_, String>>()?;
        let plan = UncheckedPlan { step: observation.step, states, ..UncheckedPlan::default() };
        plan.check(observation.step).map_err(|error| error.to_string())
    }
}

/// Drives by the same control at every step, or as a function of the observation.
pub struct Controls<F: FnMut(&Observation) -> Control>(pub F);

impl<F: FnMut(&Observation) -> Control> Driver for Controls<F> {
    fn plan(&mut self, observation: &Observation) -> Result<Plan, String> {
        let control = (self.0)(observation);
        let plan = UncheckedPlan {
            step: observation.step,
            states: vec![PlanState::default(); PLAN_STEPS],
            controls: vec![control; PLAN_STEPS],
            ..UncheckedPlan::default()
        };
        plan.check(observation.step).map_err(|error| error.to_string())
    }
}

/// A driver that keeps its speed and its wheels straight.
pub fn straight_on() -> Controls<impl FnMut(&Observation) -> Control> {
    Controls(|_| Control::default())
}

/// A driver that steers towards y (m, of a road along x), at constant speed.
pub fn to_lateral(y: f64) -> Controls<impl FnMut(&Observation) -> Control> {
    Controls(move |observation| {
        let av = observation.av;
        let wanted = (0.15 * (y - av.y)).clamp(-0.3, 0.3);
        Control { acceleration: 0.0, steering: 0.8 * (wanted - av.heading) }
    })
}
