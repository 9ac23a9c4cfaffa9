//! The planner at hand-made steps.

use std::sync::Arc;

use wire::node::History;
use world::geometry::Pose;
use world::observation::{Observation, ObservedAgent};
use world::plan::{Future, PredictedTrajectory, Prediction, UncheckedPrediction};
use world::reference_line::{ReferenceLine, ReferenceWindow};
use world::scene::{AgentKind, AgentState, SceneId, TrackId};

use super::*;

const SAMPLES: usize = 2000;

/// A straight line that leaves (700, -300) at this heading, and the AV on it.
pub(crate) struct Road {
    pub briefing: Briefing,
    pub observation: Observation,
    pub prediction: UncheckedPrediction,
}

impl Road {
    pub fn new(heading: f64, speed: f64, protocol: &str) -> Self {
        let start = Pose::new(700.0, -300.0, heading);
        let at = |k: usize| start.to_world(world::geometry::Point::new(0.1 * k as f64, 0.0));
        let line = Arc::new(ReferenceLine {
            x: (0..SAMPLES).map(|k| at(k).x).collect(),
            y: (0..SAMPLES).map(|k| at(k).y).collect(),
            z: vec![0.0; SAMPLES],
            heading: vec![heading; SAMPLES],
            curvature: vec![0.0; SAMPLES],
            speed_limit: vec![12.0; SAMPLES],
            crosswalk: vec![false; SAMPLES],
        });
        let place = at(200);
        let av = AgentState {
            x: place.x,
            y: place.y,
            heading,
            velocity_x: speed * libm::cos(heading),
            velocity_y: speed * libm::sin(heading),
            length: 5.0,
            width: 2.2,
            height: 1.6,
            ..Default::default()
        };
        let briefing = Briefing {
            scene: SceneId::new("road").unwrap(),
            protocol: protocol.to_owned(),
            start: 19,
            horizon: 150,
            wheelbase: 3.089,
            map: Arc::default(),
            route: vec![],
            reference_line: Arc::clone(&line),
            history: vec![],
        };
        let observation = Observation {
            step: 0,
            log_index: 19,
            av,
            control: Control::default(),
            agents: vec![],
            signals: vec![],
            window: ReferenceWindow {
                line,
                start: 0,
                samples: 1200,
                first_sample: 0,
                red_stops: vec![],
                speed_limit: None,
            },
        };
        Self { briefing, observation, prediction: UncheckedPrediction::default() }
    }

    /// A car `ahead` metres along the line that stands, and is expected to.
    pub fn with_standing_car(mut self, ahead: f64) -> Self {
        let frame = self.observation.av.pose();
        let place = frame.to_world(world::geometry::Point::new(ahead, 0.0));
        let state = AgentState { x: place.x, y: place.y, velocity_x: 0.0, velocity_y: 0.0, ..self.observation.av };
        let track = TrackId(7);
        self.observation.agents = vec![ObservedAgent { track, kind: AgentKind::Vehicle, state, unseen: 0 }];
        let poses = vec![state.pose(); PLAN_STEPS];
        let trajectories = vec![PredictedTrajectory { track, poses }];
        self.prediction.futures = vec![Future { probability: 1.0, trajectories, controls: vec![] }];
        self
    }

    pub fn step<T>(&self, with: impl FnOnce(&StepInput<'_>) -> T) -> T {
        let mut history = History::new(&self.briefing);
        history.push(&self.observation);
        let prediction: Prediction = self.prediction.clone().check(0).unwrap();
        with(&StepInput {
            briefing: &self.briefing,
            observation: &self.observation,
            history: &history,
            prediction: Some(&prediction),
        })
    }

    pub fn plan(&self, options: Options) -> Result<UncheckedPlan, String> {
        let mut planner = GaussNewton(options).start(&self.briefing)?;
        self.step(|step| planner.plan(step))
    }

    /// How far the plan goes along the line, and how far from it.
    fn end(&self, plan: &UncheckedPlan) -> (f64, f64) {
        let last = plan.states.last().unwrap();
        let own = self.observation.av.pose().to_body(world::geometry::Point::new(last.x, last.y));
        (own.x, own.y)
    }
}

#[test]
fn on_a_free_road_it_speeds_up_towards_the_limit_and_stays_on_the_line() {
    for protocol in ["strict", "paper"] {
        let road = Road::new(2.0, 8.0, protocol);
        let plan = road.plan(Options::default()).unwrap().check(0).unwrap();
        let (along, beside) = road.end(&plan.clone().into_unchecked());
        assert!(along > 40.5 && along < 60.0 && beside.abs() < 0.2, "{protocol}: {along} {beside}");
        let speed = plan.states().last().unwrap().speed;
        assert!(speed > 8.2 && speed < 12.5, "{protocol}: {speed}");
        assert_eq!(plan.diagnostics().objective.len(), 9);
        assert!(plan.diagnostics().iterations > 0);
    }
}

#[test]
fn it_keeps_clear_of_a_standing_car() {
    let road = Road::new(-2.5, 8.0, "strict").with_standing_car(25.0);
    let free = Road::new(-2.5, 8.0, "strict");
    let (along, _) = road.end(&road.plan(Options::default()).unwrap());
    let (freely, _) = free.end(&free.plan(Options::default()).unwrap());
    assert!(along < 19.0 && freely > 40.0, "{along} {freely}");
}

#[test]
fn what_has_no_height_is_nobody_to_the_authors() {
    let plan = |protocol: &str, height: f64| {
        let mut road = Road::new(-2.5, 8.0, protocol).with_standing_car(25.0);
        road.observation.agents[0].state.height = height;
        road.end(&road.plan(Options::default()).unwrap()).0
    };
    assert!(plan("paper", 1.6) < 25.0 && plan("paper", 0.0) > 40.0);
    assert_eq!(plan("strict", 1.6), plan("strict", 0.0));
}

#[test]
fn it_stops_before_a_red_light() {
    for protocol in ["strict", "paper"] {
        let mut road = Road::new(0.7, 8.0, protocol);
        road.observation.window.red_stops = vec![500, 501];
        let (along, _) = road.end(&road.plan(Options::default()).unwrap());
        assert!(along < 28.5, "{protocol}: {along}");
    }
}

#[test]
fn what_is_planned_is_within_limits_and_drives_where_it_says() {
    let road = Road::new(1.0, 14.0, "strict").with_standing_car(15.0);
    let plan = road.plan(Options { init: Init::Idm, ..Options::default() }).unwrap();
    let av = &road.observation.av;
    let mut state = VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() };
    let mut wheel = 0.0;
    for (control, planned) in plan.controls.iter().zip(&plan.states) {
        assert!(control.acceleration.abs() <= 5.0 && control.steering.abs() <= 0.5);
        assert!((control.steering - wheel).abs() <= 0.05 + 1e-12);
        wheel = control.steering;
        state = BicycleModel::new(3.089).step(state, *control, STEP_SECONDS);
        assert_eq!((state.x, state.y, state.speed), (planned.x, planned.y, planned.speed));
    }
}

#[test]
fn where_the_road_lies_changes_no_plan() {
    let reference = Road::new(0.0, 9.0, "strict").with_standing_car(30.0).plan(Options::default()).unwrap();
    for heading in [1.0, -3.0, 3.1] {
        let plan = Road::new(heading, 9.0, "strict").with_standing_car(30.0).plan(Options::default()).unwrap();
        for (a, b) in plan.controls.iter().zip(&reference.controls) {
            // Nearest samples and hinges decide by digits that a turned road has differently.
            assert!((a.acceleration - b.acceleration).abs() < 0.05, "{heading}: {a:?} {b:?}");
        }
    }
}

#[test]
fn what_a_predictor_does_not_bring_is_asked_for_by_name() {
    let road = Road::new(0.0, 5.0, "strict");
    let error = road.plan(Options { init: Init::Network, ..Options::default() }).unwrap_err();
    assert_eq!(error, "the prediction has no initial controls; --init zero or idm needs none");
    let error = road.plan(Options { weights: Weights::Learned, ..Options::default() }).unwrap_err();
    assert_eq!(error, "the prediction has no cost weights; --weights hand-tuned needs none");
}

#[test]
fn a_velocity_component_of_exactly_zero_is_missing_to_the_authors() {
    // Due north at 8 m/s: what is 0 to the east stays 0 ahead, so the AV is taken to slide sideways, as fast as sideways is.
    for (protocol, speed) in [("strict", 8.0), ("paper", 8.0 * libm::cos(1.5))] {
        let mut road = Road::new(1.5, 8.0, protocol);
        (road.observation.av.velocity_x, road.observation.av.velocity_y) = (0.0, 8.0);
        let plan = road.plan(Options::default()).unwrap();
        let first = plan.states[0].speed - 0.1 * plan.controls[0].acceleration;
        assert!((first - speed).abs() < 1e-6, "{protocol}: {first}");
    }
}

#[test]
fn an_empty_line_is_refused() {
    let mut road = Road::new(0.0, 5.0, "strict");
    road.observation.window.samples = 0;
    assert_eq!(road.plan(Options::default()).unwrap_err(), "the window of the reference line is empty");
}
