//! The planner's plans are those of the plain algorithm, to the bit.

use std::sync::Arc;

use scenarios::SceneSet;
use wire::node::{History, PlannerFactory as _, StepInput};
use world::geometry::Point;
use world::observation::{Observation, ObservedAgent};
use world::plan::STEP_SECONDS;
use world::reference_line::{ReferenceLine, ReferenceWindow};
use world::scene::{AgentKind, AgentState, TrackId};
use world::vehicle::{BicycleModel, VehicleState};

use super::log::{HORIZON, Log, START};
use super::{Drive, Idm, line, plain};

/// Numbers as chance brings them, the same every time.
struct Chance(u64);

impl Chance {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Somebody around `place`.
    fn agent(&mut self, place: Point, track: i32) -> ObservedAgent {
        let kinds = [AgentKind::Vehicle, AgentKind::Pedestrian, AgentKind::Cyclist, AgentKind::Other];
        let far = if self.within(0.0, 1.0) < 0.5 { 10.0 } else { 80.0 };
        let speed = self.within(-3.0, 15.0).max(0.0);
        let heading = self.within(-3.2, 3.2);
        let state = AgentState {
            x: place.x + self.within(-far, far),
            y: place.y + self.within(-far, far),
            z: self.within(-4.0, 4.0),
            heading,
            velocity_x: speed * libm::cos(heading),
            velocity_y: speed * libm::sin(heading),
            length: self.within(0.3, 18.0),
            width: self.within(0.3, 3.0),
            ..Default::default()
        };
        ObservedAgent { track: TrackId(track), kind: kinds[track as usize % kinds.len()], state, unseen: 0 }
    }

    fn crowd(&mut self, place: Point) -> Vec<ObservedAgent> {
        (0..24).map(|track| self.agent(place, track)).collect()
    }
}

fn assert_same(planner: &mut dyn wire::node::Planner, step: &StepInput<'_>, at: &str) -> world::plan::Control {
    let (ours, plain) = (planner.plan(step).unwrap(), plain::plan(step));
    assert_eq!(ours.diagnostics.status, plain.diagnostics.status, "{at}");
    let bits = |numbers: [f64; 4]| numbers.map(f64::to_bits);
    for (ours, plain) in ours.states.iter().zip(&plain.states) {
        let [ours, plain] = [ours, plain].map(|state| [state.x, state.y, state.heading, state.speed]);
        assert_eq!(bits(ours), bits(plain), "{at}: {ours:?} {plain:?}");
    }
    assert_eq!((&ours.controls, ours.states.len()), (&plain.controls, plain.states.len()), "{at}");
    ours.controls[0]
}

/// The window as a node gets it where only the stretch is sent.
fn alone(window: &ReferenceWindow) -> ReferenceWindow {
    let line = &window.line;
    let range = window.start..window.start + window.samples;
    let column = |column: &[f64]| column[range.clone()].to_vec();
    let stretch = ReferenceLine {
        x: column(&line.x),
        y: column(&line.y),
        z: column(&line.z),
        heading: column(&line.heading),
        curvature: column(&line.curvature),
        speed_limit: column(&line.speed_limit),
        crosswalk: line.crosswalk[range.clone()].to_vec(),
    };
    ReferenceWindow { line: Arc::new(stretch), start: 0, ..window.clone() }
}

#[test]
fn on_generated_scenes_plans_are_those_of_the_plain_algorithm() {
    let set = SceneSet::open(&[]).unwrap();
    let mut chance = Chance(20);
    let mut held_back = 0;
    for index in 0..set.entries().len() {
        let protocol = ["strict", "paper"][index % 2];
        let mut log = Log::new(set.load(index).unwrap().0, protocol);
        let mut planner = Idm.start(&log.briefing).unwrap();
        let mut av = log.av(START).unwrap();
        let mut control = Default::default();
        // Not every step: the plain algorithm takes its time.
        for step in (0..log.steps().min(HORIZON)).step_by(5) {
            let mut observation = log.observe(step, av, control);
            let at = format!("{} at step {step}", log.scene.id());
            let crowd = chance.crowd(av.position());
            let mut plan = |observation: &Observation| {
                let (briefing, history) = (&log.briefing, &log.history);
                let input = StepInput { briefing, observation, history, prediction: None };
                let control = assert_same(&mut *planner, &input, &at);
                held_back += usize::from(plain::plan(&input).diagnostics.status != "free");
                control
            };
            control = plan(&observation);
            observation.window = alone(&observation.window);
            assert_eq!(plan(&observation), control, "{at}: of the stretch alone");
            observation.agents.extend(crowd);
            plan(&observation);
            let model = BicycleModel::new(log.briefing.wheelbase);
            let mut rollout = model.roll_out(VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() });
            let next = (0..5).map(|_| rollout.step(control, STEP_SECONDS)).last().unwrap();
            let velocity = Point::unit(next.heading) * next.speed;
            (av.x, av.y, av.heading) = (next.x, next.y, next.heading);
            (av.velocity_x, av.velocity_y) = (velocity.x, velocity.y);
        }
    }
    assert!(held_back > 100, "hardly anybody is in the way: {held_back}");
}

#[test]
fn round_and_round_plans_are_those_of_the_plain_algorithm() {
    // After 50 m it goes round and round, 38 m each.
    let line = line(1.0 / 6.0, 2500);
    let mut chance = Chance(7);
    for at in (0..2400).step_by(60) {
        let beside = chance.within(-7.0, 7.0);
        let heading = line.heading[at] + chance.within(-1.0, 1.0);
        let speed = chance.within(0.0, 14.0);
        let place = line.point(at) + Point::unit(line.heading[at] + std::f64::consts::FRAC_PI_2) * beside;
        let drive = Drive::new(Arc::clone(&line), super::car(place.x, place.y, heading, speed));
        let mut observation = drive.observe(at as u32);
        let start = at.saturating_sub(200);
        observation.window.start = start;
        observation.window.first_sample = start;
        observation.window.samples = (line.len() - start).min(1200);
        observation.agents = chance.crowd(place);
        let history = History::new(&drive.briefing);
        let input =
            StepInput { briefing: &drive.briefing, observation: &observation, history: &history, prediction: None };
        assert_same(&mut *Idm.start(&drive.briefing).unwrap(), &input, &format!("at sample {at}"));
    }
}
