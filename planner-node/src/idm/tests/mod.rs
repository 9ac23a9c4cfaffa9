//! Hand-made traffic: what the planner does on a straight road and in a curve. `same.rs`: it does what the plain algorithm does.

#[allow(dead_code, reason = "other tests use more of it")]
#[path = "../../../tests/log/mod.rs"]
mod log;
mod plain;
mod same;

use std::sync::Arc;

use wire::node::History;
use world::observation::{Observation, ObservedAgent};
use world::reference_line::{ReferenceLine, ReferenceWindow};
use world::scene::{AgentKind, AgentState, SceneId, TrackId};

use super::*;

/// A line from the origin: straight, or with a constant curvature after 50 m, 0.1 m apart.
fn line(curvature: f64, samples: usize) -> Arc<ReferenceLine> {
    let mut line = ReferenceLine::default();
    let (mut x, mut y, mut heading) = (0.0, 0.0, 0.0_f64);
    for i in 0..samples {
        let here = if i > 500 { curvature } else { 0.0 };
        line.x.push(x);
        line.y.push(y);
        line.heading.push(heading);
        line.curvature.push(here);
        x += 0.1 * libm::cos(heading);
        y += 0.1 * libm::sin(heading);
        heading += 0.1 * here;
    }
    line.z = vec![0.0; samples];
    line.speed_limit = vec![12.0; samples];
    line.crosswalk = vec![false; samples];
    Arc::new(line)
}

fn car(x: f64, y: f64, heading: f64, speed: f64) -> AgentState {
    AgentState {
        x,
        y,
        heading,
        velocity_x: speed * libm::cos(heading),
        velocity_y: speed * libm::sin(heading),
        length: 4.8,
        width: 2.0,
        height: 1.6,
        ..Default::default()
    }
}

/// A drive of the planner's first controls, agents at constant velocity.
struct Drive {
    briefing: Briefing,
    av: AgentState,
    agents: Vec<AgentState>,
    red_at: Option<f64>,
    control: Control,
}

impl Drive {
    fn new(line: Arc<ReferenceLine>, av: AgentState) -> Self {
        let briefing = Briefing {
            scene: SceneId::new("s").unwrap(),
            protocol: "strict".to_owned(),
            start: 0,
            horizon: 150,
            wheelbase: 3.089,
            map: Arc::default(),
            route: vec![],
            reference_line: line,
            history: vec![],
        };
        Self { briefing, av, agents: vec![], red_at: None, control: Control::default() }
    }

    /// What is seen now.
    fn observe(&self, step: u32) -> Observation {
        let line = &self.briefing.reference_line;
        let nearest = (0..line.x.len()).min_by(|a, b| {
            let distance = |i: usize| libm::hypot(line.x[i] - self.av.x, line.y[i] - self.av.y);
            distance(*a).total_cmp(&distance(*b))
        });
        let start = nearest.unwrap().saturating_sub(200);
        let red = self.red_at.map(|x| (x * 10.0) as usize).filter(|sample| *sample >= start);
        let window = ReferenceWindow {
            line: Arc::clone(line),
            start,
            samples: (line.x.len() - start).min(1200),
            first_sample: start,
            red_stops: red.map(|sample| (sample - start) as u32).into_iter().collect(),
            speed_limit: None,
        };
        let agents = self.agents.iter().enumerate();
        Observation {
            step,
            log_index: step,
            av: self.av,
            control: self.control,
            agents: agents
                .map(|(i, state)| ObservedAgent {
                    track: TrackId(i as i32),
                    kind: AgentKind::Vehicle,
                    state: *state,
                    unseen: 0,
                })
                .collect(),
            signals: vec![],
            window,
        }
    }

    fn step(&mut self, step: u32) -> UncheckedPlan {
        let observation = self.observe(step);
        let history = History::new(&self.briefing);
        let input =
            StepInput { briefing: &self.briefing, observation: &observation, history: &history, prediction: None };
        let plan = Idm.start(&self.briefing).unwrap().plan(&input).unwrap();
        plan.clone().check(step).unwrap();

        let state = VehicleState { x: self.av.x, y: self.av.y, heading: self.av.heading, speed: self.av.speed() };
        let next = BicycleModel::new(3.089).step(state, plan.controls[0], 0.1);
        self.control = plan.controls[0];
        self.av = AgentState { length: 4.8, width: 2.0, ..car(next.x, next.y, next.heading, next.speed) };
        for agent in &mut self.agents {
            agent.x += 0.1 * agent.velocity_x;
            agent.y += 0.1 * agent.velocity_y;
        }
        plan
    }

    fn overlaps(&self) -> bool {
        self.agents.iter().any(|a| world::geometry::boxes_overlap(&a.oriented_box(), &self.av.oriented_box()))
    }
}

#[test]
fn a_free_road_is_driven_at_its_limit() {
    let mut drive = Drive::new(line(0.0, 4000), car(20.0, 0.0, 0.0, 5.0));
    (0..150).for_each(|step| drop(drive.step(step)));
    assert!((drive.av.speed() - 12.0).abs() < 0.5, "{}", drive.av.speed());
}

#[test]
fn under_paper_the_first_pose_is_as_far_away_as_its_speed_leads() {
    for (protocol, faster) in [("strict", false), ("paper", true)] {
        let mut drive = Drive::new(line(0.0, 4000), car(20.0, 0.0, 0.0, 5.0));
        protocol.clone_into(&mut drive.briefing.protocol);
        let first = drive.step(0).states[0];
        assert!(first.speed > 5.01, "{protocol}: {}", first.speed);
        let driven = if faster { first.speed } else { 5.0 };
        assert!((first.x - 20.0 - 0.1 * driven).abs() < 1e-6, "{protocol}: {}", first.x);
    }
}

#[test]
fn an_offset_fades_without_swinging_over() {
    let mut drive = Drive::new(line(0.0, 4000), car(20.0, 1.5, 0.1, 8.0));
    for step in 0..100 {
        drive.step(step);
        assert!(drive.av.y > -0.1, "{}", drive.av.y);
    }
    assert!(drive.av.y.abs() < 0.05, "{}", drive.av.y);
}

#[test]
fn a_curve_is_taken_on_the_line_and_slowly_enough() {
    let radius = 12.0;
    let mut drive = Drive::new(line(1.0 / radius, 1000), car(20.0, 0.0, 0.0, 12.0));
    let mut fastest = 0.0_f64;
    for step in 0..80 {
        drive.step(step);
        if drive.av.x > 52.0 {
            fastest = fastest.max(drive.av.speed());
            let off = libm::hypot(drive.av.x - 50.0, drive.av.y - radius) - radius;
            assert!(off.abs() < 0.5, "{off} m beside the line at step {step}");
        }
    }
    assert!(fastest > 3.0 && fastest * fastest / radius < 3.6, "{fastest}");
}

#[test]
fn it_follows_a_slower_car_and_stops_behind_one_that_stands() {
    let mut drive = Drive::new(line(0.0, 4000), car(20.0, 0.0, 0.0, 12.0));
    drive.agents = vec![car(50.0, 0.2, 0.0, 5.0)];
    for step in 0..150 {
        drive.step(step);
        assert!(!drive.overlaps(), "step {step}");
    }
    assert!((drive.av.speed() - 5.0).abs() < 0.5);

    let mut drive = Drive::new(line(0.0, 4000), car(20.0, 0.0, 0.0, 12.0));
    drive.agents = vec![car(80.0, 0.0, 0.0, 0.0)];
    (0..150).for_each(|step| drop(drive.step(step)));
    let gap = 80.0 - drive.av.x - 4.8;
    assert!(drive.av.speed() < 0.3 && gap > 0.5 && gap < 5.0, "gap {gap}");
}

#[test]
fn it_stops_at_a_red_light_and_goes_on_when_it_changes() {
    let mut drive = Drive::new(line(0.0, 4000), car(20.0, 0.0, 0.0, 12.0));
    drive.red_at = Some(80.0);
    (0..150).for_each(|step| drop(drive.step(step)));
    let front = drive.av.x + 2.4;
    assert!(drive.av.speed() < 0.3 && front < 80.0 && front > 75.0, "{front}");
    drive.red_at = None;
    (150..250).for_each(|step| drop(drive.step(step)));
    assert!(drive.av.speed() > 8.0);
}

#[test]
fn it_gives_way_to_crossing_traffic_and_not_to_what_is_past() {
    // Comes from the right, and would be in the way when the AV is there.
    let mut drive = Drive::new(line(0.0, 4000), car(20.0, 0.0, 0.0, 10.0));
    drive.agents = vec![car(60.0, -40.0, std::f64::consts::FRAC_PI_2, 10.0)];
    for step in 0..100 {
        drive.step(step);
        assert!(!drive.overlaps(), "step {step}");
    }
    // Drives away from the line: none of the AV's business.
    let mut drive = Drive::new(line(0.0, 4000), car(20.0, 0.0, 0.0, 10.0));
    drive.agents = vec![car(60.0, 5.0, std::f64::consts::FRAC_PI_2, 10.0)];
    assert_eq!(drive.step(0).diagnostics.status, "free");
}

#[test]
fn it_lets_in_a_car_that_cuts_in_beside_it() {
    let mut drive = Drive::new(line(0.0, 4000), car(20.0, 0.0, 0.0, 12.0));
    drive.agents = vec![car(24.5, 3.5, 0.0, 12.0)];
    drive.agents[0].velocity_y = -0.8;
    for step in 0..60 {
        drive.step(step);
        drive.agents[0].velocity_y *= if drive.agents[0].y < 0.3 { 0.0 } else { 1.0 };
        assert!(!drive.overlaps(), "step {step}");
    }
}

#[test]
fn oncoming_traffic_in_a_curve_keeps_its_lane() {
    let radius = 40.0;
    let mut drive = Drive::new(line(1.0 / radius, 1500), car(45.0, 0.0, 0.0, 8.0));
    // On the inner lane of the curve, 60 degrees further round, towards the AV.
    let (angle, inner) = (1.0_f64, radius - 3.7);
    let place = (50.0 + inner * libm::sin(angle), radius - inner * libm::cos(angle));
    drive.agents = vec![car(place.0, place.1, angle + std::f64::consts::PI, 8.0)];
    assert_eq!(drive.step(0).diagnostics.status, "free");
}

#[test]
fn oncoming_and_parked_cars_beside_the_lane_are_passed() {
    let mut drive = Drive::new(line(0.0, 4000), car(20.0, 0.0, 0.0, 10.0));
    drive.agents = vec![car(120.0, 3.5, std::f64::consts::PI, 10.0), car(60.0, -2.4, 0.0, 0.0)];
    for step in 0..100 {
        assert_eq!(drive.step(step).diagnostics.status, "free", "step {step}");
    }
    assert!(drive.av.x > 120.0);
}

#[test]
fn it_stops_before_the_line_ends() {
    let mut drive = Drive::new(line(0.0, 1000), car(20.0, 0.0, 0.0, 12.0));
    (0..200).for_each(|step| drop(drive.step(step)));
    assert!(drive.av.speed() < 0.3 && drive.av.x + 2.4 < 100.0 && drive.av.x > 90.0, "{}", drive.av.x);
}
