//! The planner as it is meant, without a thought for speed: every sample of the window is looked at whenever one is wanted, and
//! nothing is kept. What the planner itself answers must be the same to the bit.

use wire::node::StepInput;
use world::geometry::{OrientedBox, Point, angle_difference};
use world::observation::ObservedAgent;
use world::plan::{Control, PLAN_STEPS, PlanState, STEP_SECONDS, UncheckedPlan};
use world::reference_line::{ReferenceWindow, SAMPLES_BEHIND};
use world::scene::{AgentKind, AgentState};
use world::vehicle::{BicycleModel, Limits, VehicleState};

use crate::idm::obstacles::{Obstacle, What};
use crate::idm::speed::{self, Manner, Wanted};

struct Corridor<'a> {
    window: &'a ReferenceWindow,
    stations: Vec<f64>,
}

type Range = (f64, f64);

struct Footprint {
    sample: usize,
    stations: Range,
    laterals: Range,
}

impl Footprint {
    fn moved(&self, along: f64, left: f64) -> Self {
        let by = |(low, high): Range, by: f64| (low + by, high + by);
        Self { sample: self.sample, stations: by(self.stations, along), laterals: by(self.laterals, left) }
    }
}

impl<'a> Corridor<'a> {
    fn new(window: &'a ReferenceWindow) -> Self {
        let point = |sample: usize| window.line.point(window.start + sample);
        let mut stations = vec![0.0];
        for sample in 1..window.samples {
            stations.push(stations[sample - 1] + point(sample).distance(point(sample - 1)));
        }
        Self { window, stations }
    }

    fn last(&self) -> usize {
        self.stations.len() - 1
    }

    fn heading(&self, sample: usize) -> f64 {
        self.window.line.heading[self.window.start + sample]
    }

    fn sample_at(&self, station: f64) -> usize {
        self.stations.iter().position(|s| *s >= station).unwrap_or(self.last())
    }

    fn curvature(&self, sample: usize) -> f64 {
        let (from, to) = (self.sample_at(self.stations[sample] - 1.5), self.sample_at(self.stations[sample] + 1.5));
        let length = self.stations[to] - self.stations[from];
        if length <= 0.0 { 0.0 } else { angle_difference(self.heading(from), self.heading(to)) / length }
    }

    fn distance(&self, sample: usize, place: Point) -> f64 {
        self.window.line.point(self.window.start + sample).distance_squared(place)
    }

    fn nearest_of(&self, samples: impl Iterator<Item = usize>, place: Point) -> usize {
        samples.min_by(|a, b| self.distance(*a, place).total_cmp(&self.distance(*b, place))).unwrap()
    }

    fn nearest_in(&self, from: usize, to: usize, place: Point) -> usize {
        self.nearest_of(from..=to.min(self.last()), place)
    }

    fn around(&self, sample: usize, reach: usize, place: Point) -> usize {
        self.nearest_in(sample.saturating_sub(reach), sample + reach, place)
    }

    fn nearest(&self, place: Point) -> usize {
        self.around(self.nearest_of((0..=self.last()).step_by(10), place), 10, place)
    }

    fn own(&self, av: Point) -> usize {
        let first = if self.window.first_sample > 0 { SAMPLES_BEHIND - 20 } else { 0 };
        let own = self.nearest_in(first.min(self.last()), SAMPLES_BEHIND + 20, av);
        let nearest = self.nearest(av);
        let distance = |sample: usize| self.distance(sample, av).sqrt();
        if distance(own) > distance(nearest) + 5.0 { nearest } else { own }
    }

    fn nearest_pass(&self, place: Point, own: usize) -> usize {
        let best = self.nearest(place);
        let reach = self.distance(best, place).sqrt() + 2.0;
        let another = |sample: &usize| {
            sample.abs_diff(best) > 200
                && sample.abs_diff(own) < best.abs_diff(own)
                && self.distance(*sample, place) <= reach * reach
        };
        let other = (0..=self.last()).step_by(10).filter(another).min_by_key(|sample| sample.abs_diff(own));
        let Some(mut sample) = other else { return best };
        loop {
            let next = self.around(sample, 10, place);
            if self.distance(next, place) >= self.distance(sample, place) {
                return sample;
            }
            sample = next;
        }
    }

    /// Sample, station and lateral offset.
    fn project(&self, place: Point, hint: usize) -> (usize, f64, f64) {
        let sample = self.around(hint, 40, place);
        let forward = Point::unit(self.heading(sample));
        let offset = place - self.window.line.point(self.window.start + sample);
        (sample, self.stations[sample] + forward.dot(offset), forward.cross(offset))
    }

    fn footprint(&self, body: &OrientedBox, own: usize) -> Footprint {
        let sample = self.nearest_pass(body.center, own);
        let reach = 10 * (1 + body.radius() as usize);
        let places = body.corners().map(|corner| self.project(corner, self.around(sample, reach, corner)));
        let range = |of: fn(&(usize, f64, f64)) -> f64| {
            let all = places.iter().map(of);
            (all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max))
        };
        Footprint { sample, stations: range(|place| place.1), laterals: range(|place| place.2) }
    }

    /// The speed wanted at each sample.
    fn desired(&self) -> Vec<f64> {
        let limit = |sample: usize| self.window.speed_limit_at(self.window.start + sample);
        let local = |sample: usize| speed::local(self.curvature(sample), limit(sample));
        let mut speeds: Vec<f64> = (0..=self.last()).map(local).collect();
        for sample in (0..self.last()).rev() {
            let distance = self.stations[sample + 1] - self.stations[sample];
            let next = speeds[sample + 1];
            speeds[sample] = speeds[sample].min((next * next + 2.0 * 1.5 * distance).sqrt());
        }
        speeds
    }
}

struct Av {
    sample: usize,
    lateral: f64,
    front: f64,
    rear: f64,
    half_width: f64,
    speed: f64,
}

impl Av {
    fn overlaps(&self, footprint: &Footprint, margin: f64) -> bool {
        let ahead = (footprint.stations.0 - self.front).max(0.0);
        let center = self.lateral * libm::exp(-ahead / f64::max(8.0, 2.0 * self.speed));
        footprint.laterals.0 < center + self.half_width + margin
            && footprint.laterals.1 > center - self.half_width - margin
    }

    fn is_behind(&self, footprint: &Footprint, speed: f64) -> bool {
        if speed > 0.5 { footprint.stations.1 > self.front + 0.5 } else { footprint.stations.0 > self.front - 0.5 }
    }
}

fn of_agent(corridor: &Corridor<'_>, av: &Av, agent: &ObservedAgent) -> Option<Obstacle> {
    let state = &agent.state;
    let standing = state.speed() < 0.5;
    let margin = if matches!(agent.kind, AgentKind::Pedestrian | AgentKind::Cyclist) { 0.4 } else { 0.15 };
    let now = corridor.footprint(&state.oriented_box(), av.sample);
    let reach = 2.0 * av.half_width + 3.0 * if standing { 0.0 } else { state.speed() };
    let ground = corridor.window.line.z[corridor.window.start + now.sample];
    if now.laterals.0 > reach
        || now.laterals.1 < -reach
        || now.stations.0 >= corridor.stations[corridor.last()]
        || (state.z - ground).abs() > 3.5
    {
        return None;
    }
    let velocity = if standing { Point::default() } else { state.velocity() };
    let tangent = Point::unit(corridor.heading(now.sample));
    let (along, across) = (tangent.dot(velocity), tangent.cross(velocity));
    let follows = across.abs() < 0.5 * velocity.norm();
    let across = if follows && across.abs() <= 0.3 { 0.0 } else { across };
    let speed = along.max(0.0);
    if av.overlaps(&now, margin) && av.is_behind(&now, speed) {
        return Some(Obstacle { what: What::Agent(agent.track), station: now.stations.0, speed });
    }
    if standing {
        return None;
    }
    (1..=12).find_map(|k| {
        let seconds = f64::from(k) * 0.25;
        let then = if follows {
            now.moved(along * seconds, across * seconds)
        } else {
            let ahead = state.velocity() * seconds;
            let later = AgentState { x: state.x + ahead.x, y: state.y + ahead.y, ..*state };
            corridor.footprint(&later.oriented_box(), now.sample)
        };
        if !av.overlaps(&then, margin) || then.stations.1 < av.front {
            return None;
        }
        let pace = av.speed.max(3.0);
        let arrival = (then.stations.0 - av.front) / pace - 0.8;
        let departure = (then.stations.1 - av.rear) / pace + 0.8;
        let merges = follows && along > 0.0;
        if !merges && !(arrival..=departure).contains(&seconds) {
            return None;
        }
        let speed = if merges { along } else { 0.0 };
        let start = then.moved(-speed * seconds, 0.0);
        let obstacle = Obstacle { what: What::Crossing(agent.track), station: start.stations.0, speed };
        av.is_behind(&start, speed).then_some(obstacle)
    })
}

fn in_the_way(corridor: &Corridor<'_>, step: &StepInput<'_>, av: &Av) -> Vec<Obstacle> {
    let (observation, window) = (step.observation, corridor.window);
    let mut obstacles: Vec<_> = observation.agents.iter().filter_map(|agent| of_agent(corridor, av, agent)).collect();
    let stops = window.red_stops.iter().map(|sample| corridor.stations[*sample as usize]).filter(|station| {
        let gap = station - av.front;
        gap > 0.0 && av.speed * av.speed <= 2.0 * 5.0 * (gap + av.speed * STEP_SECONDS)
    });
    let nearest = stops.min_by(f64::total_cmp);
    obstacles.extend(nearest.map(|station| Obstacle { what: What::RedLight, station, speed: 0.0 }));
    if window.first_sample + window.samples >= step.briefing.reference_line.len() {
        let station = corridor.stations[corridor.last()];
        obstacles.push(Obstacle { what: What::LineEnd, station, speed: 0.0 });
    }
    obstacles
}

/// The plan's states and controls, and what holds the AV back.
pub fn plan(step: &StepInput<'_>) -> UncheckedPlan {
    let (briefing, observation) = (step.briefing, step.observation);
    let corridor = Corridor::new(&observation.window);
    let state = &observation.av;
    let own = corridor.own(state.position());
    let (sample, station, lateral) = corridor.project(state.position(), own);
    let av = Av {
        sample,
        lateral,
        front: station + 0.5 * state.length,
        rear: station - 0.5 * state.length,
        half_width: 0.5 * state.width,
        speed: state.speed(),
    };
    let obstacles = in_the_way(&corridor, step, &av);
    let desired = corridor.desired();

    let model =
        if briefing.protocol == "paper" { BicycleModel::authors_test() } else { BicycleModel::new(briefing.wheelbase) };
    let mut rollout =
        model.roll_out(VehicleState { x: state.x, y: state.y, heading: state.heading, speed: state.speed() });
    let mut now = PlanState { x: state.x, y: state.y, heading: state.heading, speed: state.speed() };
    let (mut driven, mut hint) = (observation.control, own);
    let mut plan = UncheckedPlan { step: observation.step, ..Default::default() };
    for k in 0..PLAN_STEPS {
        let (sample, station, lateral) = corridor.project(Point::new(now.x, now.y), hint);
        hint = sample;
        let front = station + 0.5 * state.length;
        let leaders = obstacles.iter().map(|o| (o.station + o.speed * (k as f64 * STEP_SECONDS) - front, o.speed));
        let falls = sample < corridor.last() && desired[sample + 1] < desired[sample];
        let wanted = Wanted { speed: desired[sample], braking: if falls { 1.5 } else { 0.0 } };
        let acceleration =
            speed::smooth(driven.acceleration, speed::acceleration(&Manner::IDM, now.speed, wanted, leaders));

        let settling = now.speed.max(4.0);
        let ahead = corridor.sample_at(station + 0.2 * now.speed);
        let turned = angle_difference(corridor.heading(sample), now.heading);
        let offset = lateral.clamp(-3.0, 3.0);
        let curvature = corridor.curvature(ahead) - 2.0 * turned / settling - offset / (settling * settling);
        let steering = libm::atan(briefing.wheelbase * curvature);

        driven = Limits::STRICT.apply(Control { acceleration, steering }, driven.steering, STEP_SECONDS);
        let next = rollout.step(driven, STEP_SECONDS);
        now = PlanState { x: next.x, y: next.y, heading: next.heading, speed: next.speed };
        plan.controls.push(driven);
        plan.states.push(now);
    }
    let hold = |o: &Obstacle| speed::interaction(&Manner::IDM, av.speed, o.station - av.front, o.speed);
    let most = obstacles.iter().max_by(|a, b| hold(a).total_cmp(&hold(b))).filter(|o| hold(o) > 0.1);
    plan.diagnostics.status = most.map_or("free".to_owned(), |o| o.what.to_string());
    plan
}
