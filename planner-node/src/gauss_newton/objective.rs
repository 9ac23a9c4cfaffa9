//! The nine cost terms and their derivatives.
//!
//! A residual row is `weight * c`; the objective is half the sum of their squares. [`Evaluation`] holds the rows `c` at one
//! point, and the products of their Jacobian with a vector, from either side, at a few operations a step. Only rows that can
//! be other than zero are touched: red-light rows from where the stop is passed, safety rows of neighbors that are too near.

use std::f64::consts::PI;

use world::geometry::wrap_angle;
use world::vehicle::BicycleModel;

use super::constants::{DT, KEY_STEPS, LANE_STEPS, LATERAL_MARGIN, NEIGHBORS, SAFE_GAP, STEPS, TERMS, Term, lane_step};
use super::controls::Controls;
use super::motion::{Motion, StateChange};
use super::problem::{PlacedNeighbor, Problem};

/// The most safety rows: every neighbor at every key step.
pub const SAFETY_ROWS: usize = KEY_STEPS.len() * NEIGHBORS;

/// What the objective is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costing {
    /// The vehicle that the poses are computed with.
    pub model: BicycleModel,
    /// Whether the lane-heading residual is the angle between the headings, or (as the authors have it) their plain
    /// difference, which jumps by a turn where the line crosses west.
    pub wrap_heading: bool,
    /// Whose distance is costed.
    pub safety: Safety,
}

/// Whose distance is costed at a key step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Safety {
    /// That of the nearest of those ahead in the AV's path: the authors' choice.
    Nearest,
    /// That of everyone ahead in the AV's path.
    Everyone,
}

/// A number for each residual row, term by term.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// [`Term::Speed`].
    pub speed: [f64; STEPS],
    /// [`Term::Acceleration`].
    pub acceleration: [f64; STEPS],
    /// [`Term::Jerk`].
    pub jerk: [f64; STEPS - 1],
    /// [`Term::Steering`].
    pub steering: [f64; STEPS],
    /// [`Term::SteeringChange`].
    pub steering_change: [f64; STEPS - 1],
    /// [`Term::LanePosition`], x.
    pub lane_x: [f64; LANE_STEPS],
    /// [`Term::LanePosition`], y.
    pub lane_y: [f64; LANE_STEPS],
    /// [`Term::LaneHeading`].
    pub lane_heading: [f64; LANE_STEPS],
    /// [`Term::RedLight`].
    pub red_light: [f64; STEPS],
    /// [`Term::Safety`]: as many as [`Evaluation::safety`] has entries.
    pub safety: [f64; SAFETY_ROWS],
}

impl Rows {
    /// All zero.
    pub const ZERO: Self = Self {
        speed: [0.0; STEPS],
        acceleration: [0.0; STEPS],
        jerk: [0.0; STEPS - 1],
        steering: [0.0; STEPS],
        steering_change: [0.0; STEPS - 1],
        lane_x: [0.0; LANE_STEPS],
        lane_y: [0.0; LANE_STEPS],
        lane_heading: [0.0; LANE_STEPS],
        red_light: [0.0; STEPS],
        safety: [0.0; SAFETY_ROWS],
    };

    /// The rows of each term, in the order of the weights; lane position has two parts, `safety` rows are the first `safety`.
    #[must_use]
    pub fn parts(&self, safety: usize) -> [(Term, &[f64]); TERMS + 1] {
        [
            (Term::Speed, &self.speed),
            (Term::Acceleration, &self.acceleration),
            (Term::Jerk, &self.jerk),
            (Term::Steering, &self.steering),
            (Term::SteeringChange, &self.steering_change),
            (Term::LanePosition, &self.lane_x),
            (Term::LanePosition, &self.lane_y),
            (Term::LaneHeading, &self.lane_heading),
            (Term::RedLight, &self.red_light),
            (Term::Safety, &self.safety[..safety]),
        ]
    }

    /// [`Rows::parts`], to be changed.
    fn parts_mut(&mut self, safety: usize) -> [(Term, &mut [f64]); TERMS + 1] {
        [
            (Term::Speed, &mut self.speed),
            (Term::Acceleration, &mut self.acceleration),
            (Term::Jerk, &mut self.jerk),
            (Term::Steering, &mut self.steering),
            (Term::SteeringChange, &mut self.steering_change),
            (Term::LanePosition, &mut self.lane_x),
            (Term::LanePosition, &mut self.lane_y),
            (Term::LaneHeading, &mut self.lane_heading),
            (Term::RedLight, &mut self.red_light),
            (Term::Safety, &mut self.safety[..safety]),
        ]
    }

    /// `self = weight^2 * (rows + more)`, term by term.
    pub(super) fn set_weighted(&mut self, weights: &[f64; TERMS], rows: &Self, more: Option<&Self>, safety: usize) {
        let mores = more.map(|more| more.parts(safety));
        for (i, ((term, into), (_, from))) in self.parts_mut(safety).into_iter().zip(rows.parts(safety)).enumerate() {
            let squared = weights[term as usize] * weights[term as usize];
            match &mores {
                None => into.iter_mut().zip(from).for_each(|(into, from)| *into = squared * from),
                Some(mores) => {
                    into.iter_mut().zip(from).zip(mores[i].1).for_each(|((into, a), b)| *into = squared * (a + b));
                }
            }
        }
    }
}

/// A safety row that is not zero: a neighbor that is too near.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SafetyRow {
    /// Which key step.
    pub key: usize,
    /// Which neighbor.
    pub neighbor: usize,
    /// Distance of the centers (m).
    pub distance: f64,
    /// Unit vector from the neighbor to the AV; zero where both are at one place.
    pub away: (f64, f64),
}

/// The objective at one point, and its linearization there.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// The poses that the controls lead to.
    pub motion: Motion,
    /// The rows before weighting.
    pub rows: Rows,
    /// The nearest sample at each look at the lane.
    pub lane_sample: [usize; LANE_STEPS],
    /// The nearest sample at each key step, where there are neighbors.
    pub key_sample: [usize; KEY_STEPS.len()],
    /// 1 where the speed that is costed is not clamped at zero, else 0.
    pub(super) moves: [f64; STEPS],
    /// First step past the red light's stop; [`STEPS`] if there is none.
    pub red_from: usize,
    safety: [SafetyRow; SAFETY_ROWS],
    safety_count: usize,
    /// Half the sum of squares of each term.
    pub terms: [f64; TERMS],
    /// Their sum.
    pub objective: f64,
}

impl Default for Evaluation {
    fn default() -> Self {
        Self {
            motion: Motion::default(),
            rows: Rows::ZERO,
            lane_sample: [0; LANE_STEPS],
            key_sample: [0; KEY_STEPS.len()],
            moves: [0.0; STEPS],
            red_from: STEPS,
            safety: [SafetyRow::default(); SAFETY_ROWS],
            safety_count: 0,
            terms: [0.0; TERMS],
            objective: 0.0,
        }
    }
}

impl Evaluation {
    /// Evaluates the objective at `controls`, which are finite.
    pub fn evaluate(&mut self, problem: &Problem, costing: &Costing, controls: &Controls) {
        self.motion.roll_out(&costing.model, problem.av.state, controls);
        self.evaluate_controls(problem, controls);
        self.evaluate_lane(problem, costing);
        self.evaluate_safety(problem, costing);
        self.terms = [0.0; TERMS];
        for (term, rows) in self.rows.parts(self.safety_count) {
            let weight = problem.weights[term as usize];
            self.terms[term as usize] += 0.5 * weight * weight * rows.iter().map(|c| c * c).sum::<f64>();
        }
        self.objective = self.terms.iter().sum();
    }

    /// Begins the search for nearest samples where `other` found its own.
    pub(super) fn start_search_at(&mut self, other: &Self) {
        self.lane_sample = other.lane_sample;
        self.key_sample = other.key_sample;
    }

    /// Terms of the controls as they are: not clipped as the vehicle model clips them. Speed and distance among them.
    fn evaluate_controls(&mut self, problem: &Problem, controls: &Controls) {
        let rows = &mut self.rows;
        rows.acceleration = controls.acceleration;
        rows.steering = controls.steering;
        for t in 0..STEPS - 1 {
            rows.jerk[t] = (controls.acceleration[t + 1] - controls.acceleration[t]) / DT;
            rows.steering_change[t] = (controls.steering[t + 1] - controls.steering[t]) / DT;
        }
        let (mut owed, mut distance) = (problem.av.state.speed, 0.0);
        self.red_from = STEPS;
        for t in 0..STEPS {
            owed += controls.acceleration[t] * DT;
            let speed = owed.max(0.0);
            distance += speed * DT;
            self.moves[t] = if owed >= 0.0 { 1.0 } else { 0.0 };
            rows.speed[t] = speed - problem.speed_target;
            rows.red_light[t] = match problem.stop_distance {
                Some(stop) if distance > stop => {
                    self.red_from = self.red_from.min(t);
                    distance - stop
                }
                _ => 0.0,
            };
        }
    }

    fn evaluate_lane(&mut self, problem: &Problem, costing: &Costing) {
        for i in 0..LANE_STEPS {
            let state = &self.motion.states[lane_step(i)];
            let sample = problem.line.nearest(state.x, state.y, self.lane_sample[i]);
            self.lane_sample[i] = sample;
            let (x, y, heading) = problem.line.sample(sample);
            self.rows.lane_x[i] = state.x - x;
            self.rows.lane_y[i] = state.y - y;
            let turn = state.heading - heading;
            self.rows.lane_heading[i] = if costing.wrap_heading && turn.abs() > PI { wrap_angle(turn) } else { turn };
        }
    }

    fn evaluate_safety(&mut self, problem: &Problem, costing: &Costing) {
        self.safety_count = 0;
        if !problem.company {
            return;
        }
        for (key, &t) in KEY_STEPS.iter().enumerate() {
            let state = self.motion.states[t];
            let sample = if t % 2 == 1 {
                self.lane_sample[t / 2]
            } else {
                problem.line.nearest(state.x, state.y, self.key_sample[key])
            };
            self.key_sample[key] = sample;
            let av = problem.line.frenet_at(state.x, state.y, sample);
            let ahead_in_path = |neighbor: &PlacedNeighbor| {
                let other = &neighbor.frenet[key];
                let reach = (problem.av.width + neighbor.width) / 2.0 + LATERAL_MARGIN;
                other.sample > av.sample && (av.lateral - other.lateral).abs() < reach
            };
            let mut nearest: Option<(SafetyRow, f64)> = None;
            for (j, neighbor) in problem.neighbors.iter().enumerate() {
                let Some(neighbor) = neighbor.as_ref().filter(|n| ahead_in_path(n)) else { continue };
                let (x, y) = neighbor.position[key];
                let (dx, dy) = (state.x - x, state.y - y);
                let distance = (dx * dx + dy * dy).sqrt();
                let away = if distance > 0.0 { (dx / distance, dy / distance) } else { (0.0, 0.0) };
                let row = SafetyRow { key, neighbor: j, distance, away };
                let missing = (problem.av.length + neighbor.length) / 2.0 + SAFE_GAP - distance;
                match costing.safety {
                    Safety::Everyone => self.add_safety_row(row, missing),
                    Safety::Nearest if nearest.is_none_or(|(other, _)| distance < other.distance) => {
                        nearest = Some((row, missing));
                    }
                    Safety::Nearest => {}
                }
            }
            if let Some((row, missing)) = nearest {
                self.add_safety_row(row, missing);
            }
        }
    }

    fn add_safety_row(&mut self, row: SafetyRow, missing: f64) {
        if missing > 0.0 {
            self.safety[self.safety_count] = row;
            self.rows.safety[self.safety_count] = missing;
            self.safety_count += 1;
        }
    }

    /// The safety rows that are not zero, by key step.
    #[must_use]
    pub fn safety(&self) -> &[SafetyRow] {
        &self.safety[..self.safety_count]
    }

    /// How the rows (before weighting) change with the controls: the product of the Jacobian with `direction`. `change` becomes
    /// the change of the states.
    pub fn push_forward(&self, direction: &Controls, change: &mut [StateChange; STEPS], rows: &mut Rows) {
        self.motion.push_forward(direction, change);
        rows.acceleration = direction.acceleration;
        rows.steering = direction.steering;
        for t in 0..STEPS - 1 {
            rows.jerk[t] = (direction.acceleration[t + 1] - direction.acceleration[t]) / DT;
            rows.steering_change[t] = (direction.steering[t + 1] - direction.steering[t]) / DT;
        }
        let (mut owed, mut distance) = (0.0, 0.0);
        for t in 0..STEPS {
            owed += DT * direction.acceleration[t];
            rows.speed[t] = self.moves[t] * owed;
            distance += DT * rows.speed[t];
            rows.red_light[t] = if t < self.red_from { 0.0 } else { distance };
        }
        for i in 0..LANE_STEPS {
            let s = &change[lane_step(i)];
            (rows.lane_x[i], rows.lane_y[i], rows.lane_heading[i]) = (s.x, s.y, s.heading);
        }
        for (row, safety) in rows.safety.iter_mut().zip(self.safety()) {
            let s = &change[KEY_STEPS[safety.key]];
            *row = -(safety.away.0 * s.x + safety.away.1 * s.y);
        }
    }

    /// The gradient by the states, of that by the rows (before weighting).
    pub(super) fn state_gradient(&self, rows: &Rows) -> [StateChange; STEPS] {
        let mut states = [StateChange::default(); STEPS];
        for i in 0..LANE_STEPS {
            let s = &mut states[lane_step(i)];
            (s.x, s.y, s.heading) = (rows.lane_x[i], rows.lane_y[i], rows.lane_heading[i]);
        }
        for (row, safety) in rows.safety.iter().zip(self.safety()) {
            let s = &mut states[KEY_STEPS[safety.key]];
            s.x -= row * safety.away.0;
            s.y -= row * safety.away.1;
        }
        states
    }

    /// The gradient by the controls, of that by the rows (before weighting): the product of the transposed Jacobian with `rows`.
    pub fn pull_back(&self, rows: &Rows, controls: &mut Controls) {
        controls.acceleration = rows.acceleration;
        controls.steering = rows.steering;
        for t in 0..STEPS - 1 {
            controls.acceleration[t] -= rows.jerk[t] / DT;
            controls.acceleration[t + 1] += rows.jerk[t] / DT;
            controls.steering[t] -= rows.steering_change[t] / DT;
            controls.steering[t + 1] += rows.steering_change[t] / DT;
        }
        let (mut owed, mut distance) = (0.0, 0.0);
        for t in (0..STEPS).rev() {
            if t >= self.red_from {
                distance += rows.red_light[t];
            }
            owed += self.moves[t] * (rows.speed[t] + DT * distance);
            controls.acceleration[t] += DT * owed;
        }
        self.motion.pull_back(&self.state_gradient(rows), controls);
    }

    /// The gradient of the objective by the controls. `scratch` is overwritten.
    pub fn gradient(&self, problem: &Problem, scratch: &mut Rows, controls: &mut Controls) {
        scratch.set_weighted(&problem.weights, &self.rows, None, self.safety_count);
        self.pull_back(scratch, controls);
    }
}
