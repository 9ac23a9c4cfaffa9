//! The nine cost terms and their derivatives.
//!
//! A residual row is `weight * c`; the objective is half the sum of their squares. [`Evaluation`] holds the rows `c` at one
//! point, and the products of their Jacobian with a vector, from either side, at a few operations a step. Only rows that can
//! be other than zero are touched: red-light rows from where the stop is passed, safety rows of neighbors that are too near.

use std::f64::consts::PI;

use world::geometry::wrap_angle;
use world::plan::Control;
use world::vehicle::BicycleModel;

use super::constants::{DT, KEY_STEPS, LANE_STEPS, LATERAL_MARGIN, SAFE_GAP, STEPS, TERMS, lane_step};
use super::controls::Controls;
use super::coupling::Nearest;
use super::motion::{Motion, StateChange};
use super::problem::{PlacedNeighbor, Problem};
use super::rows::{Rows, SAFETY_ROWS};
use super::shapes::Margins;
use super::wide::wide;

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
    /// Whether the first control is tied to what the vehicle does now, where that is known.
    pub from_present: bool,
    /// The fastest that the wheels turn (rad/s). What is asked for beyond counts twenty times more; the authors have no bound,
    /// which is infinity.
    pub steering_rate: f64,
    /// How far from the line (m) the AV's center is to stay. A meter beyond counts twenty times more; infinity for the authors.
    pub lane_edge: f64,
}

/// How many times more it counts what is beyond the lane's edge, or faster than the wheels turn. By the weights tuned by hand it
/// weighs as much as red light and safety then.
const BEYOND: f64 = 20.0;

/// Whose distance is costed, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Safety {
    /// At the key steps, that of the nearest of those ahead in the AV's path: the authors' choice.
    Nearest,
    /// At the key steps, that of everyone ahead in the AV's path.
    Everyone,
    /// At each look at the lane, that of the AV's box to everyone's, wherever they are (`shapes`).
    Boxes(Margins),
}

/// How far away (m) the authors take those to be who are not ahead in the AV's path.
const ELSEWHERE: f64 = 100.0;

/// A safety row that is not zero: a neighbor that is too near.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SafetyRow {
    /// Which step.
    pub step: usize,
    /// Which key step; with [`Safety::Boxes`] which look at the lane.
    pub key: usize,
    /// Which neighbor.
    pub neighbor: usize,
    /// Distance of the centers (m).
    pub distance: f64,
    /// How fast the row falls with the AV's position. Of discs it is the unit vector from the neighbor to the AV; zero where both are at
    /// one place, and where the row is not in the Jacobian (`coupling`).
    pub away: (f64, f64),
    /// How fast it falls with the AV's heading (m/rad): 0 for discs.
    pub turn: f64,
    /// The same for the derivative of the row's value, which is another only where samples are coupled.
    pub value_away: (f64, f64),
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
    /// Which neighbor's length the authors take at each key step.
    pub(super) nearest: Nearest,
    /// How much more a change of the steering angle counts that is too fast.
    pub(super) stiffness: [f64; STEPS],
    /// How the rows of the lane's edge change with the position.
    pub(super) edge: [(f64, f64); LANE_STEPS],
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
            nearest: Nearest::default(),
            stiffness: [1.0; STEPS],
            edge: [(0.0, 0.0); LANE_STEPS],
            terms: [0.0; TERMS],
            objective: 0.0,
        }
    }
}

impl Evaluation {
    /// Evaluates the objective at `controls`, which are finite.
    pub fn evaluate(&mut self, problem: &Problem, costing: &Costing, controls: &Controls) {
        self.evaluate_led(problem, costing, controls, None);
    }

    /// [`Evaluation::evaluate`] of a sample of a batch whose first sample has these nearest neighbors (`coupling`).
    pub(super) fn evaluate_led(
        &mut self,
        problem: &Problem,
        costing: &Costing,
        controls: &Controls,
        lead: Option<&Nearest>,
    ) {
        wide(
            #[inline(always)]
            || self.evaluate_wide(problem, costing, controls, lead),
        );
    }

    #[inline(always)]
    fn evaluate_wide(&mut self, problem: &Problem, costing: &Costing, controls: &Controls, lead: Option<&Nearest>) {
        self.motion.roll_out(&costing.model, problem.av.state, controls);
        self.evaluate_controls(problem, costing, controls);
        self.evaluate_lane(problem, costing);
        self.evaluate_safety(problem, costing, lead);
        self.terms = [0.0; TERMS];
        for (term, squares) in self.rows.squares() {
            let weight = problem.weights[term as usize];
            self.terms[term as usize] += 0.5 * weight * weight * squares;
        }
        self.objective = self.terms.iter().sum();
    }

    /// Begins the search for nearest samples where `other` found its own.
    pub(super) fn start_search_at(&mut self, other: &Self) {
        self.lane_sample = other.lane_sample;
        self.key_sample = other.key_sample;
    }

    #[inline(always)]
    /// Terms of the controls as they are: not clipped as the vehicle model clips them. Speed and distance among them.
    fn evaluate_controls(&mut self, problem: &Problem, costing: &Costing, controls: &Controls) {
        let rows = &mut self.rows;
        rows.acceleration = controls.acceleration;
        rows.steering = controls.steering;
        let present = problem.present.filter(|_| costing.from_present);
        rows.extent.first_change = usize::from(present.is_none());
        let mut before = present.unwrap_or_else(|| controls.at(0));
        for t in 0..STEPS {
            let now = controls.at(t);
            rows.jerk[t] = (now.acceleration - before.acceleration) / DT;
            let change = (now.steering - before.steering) / DT;
            let excess = change - change.clamp(-costing.steering_rate, costing.steering_rate);
            rows.steering_change[t] = change + BEYOND * excess;
            self.stiffness[t] = if excess == 0.0 { 1.0 } else { 1.0 + BEYOND };
            before = now;
        }
        let (mut owed, mut distance) = (problem.av.state.speed, 0.0);
        self.red_from = STEPS;
        for t in 0..STEPS {
            owed += controls.acceleration[t] * DT;
            let speed = owed.max(0.0);
            distance += speed * DT;
            self.moves[t] = if owed >= 0.0 { 1.0 } else { 0.0 };
            rows.speed[t] = speed - problem.speed_targets[t];
            rows.red_light[t] = match problem.stop_distance {
                Some(stop) if distance > stop => {
                    self.red_from = self.red_from.min(t);
                    distance - stop
                }
                _ => 0.0,
            };
        }
    }

    #[inline(always)]
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
        self.rows.extent.lane_edge = 0;
        if costing.lane_edge.is_finite() {
            self.evaluate_lane_edge(costing.lane_edge);
        }
    }

    #[inline(always)]
    fn evaluate_lane_edge(&mut self, edge: f64) {
        self.rows.extent.lane_edge = LANE_STEPS;
        for i in 0..LANE_STEPS {
            let (x, y) = (self.rows.lane_x[i], self.rows.lane_y[i]);
            let distance = (x * x + y * y).sqrt();
            let beyond = distance > edge;
            self.rows.lane_edge[i] = if beyond { BEYOND * (distance - edge) } else { 0.0 };
            self.edge[i] = if beyond { (BEYOND * x / distance, BEYOND * y / distance) } else { (0.0, 0.0) };
        }
    }

    #[inline(always)]
    fn evaluate_safety(&mut self, problem: &Problem, costing: &Costing, lead: Option<&Nearest>) {
        self.rows.extent.safety = 0;
        self.nearest = Nearest::default();
        if !problem.company {
            return;
        }
        if let Safety::Boxes(margins) = &costing.safety {
            self.evaluate_boxes(problem, margins);
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
            let missing = |length: f64, distance: f64| (problem.av.length + length) / 2.0 + SAFE_GAP - distance;
            let mut nearest: Option<(SafetyRow, f64)> = None;
            let mut elsewhere = None;
            for (j, neighbor) in problem.neighbors.iter().enumerate() {
                let Some(neighbor) = neighbor.as_ref().filter(|n| ahead_in_path(n)) else {
                    elsewhere.get_or_insert(j);
                    continue;
                };
                let (x, y) = neighbor.position[key];
                let (dx, dy) = (state.x - x, state.y - y);
                let distance = (dx * dx + dy * dy).sqrt();
                let away = if distance > 0.0 { (dx / distance, dy / distance) } else { (0.0, 0.0) };
                let row = SafetyRow { step: t, key, neighbor: j, distance, away, turn: 0.0, value_away: away };
                let missing = missing(neighbor.length, distance);
                match costing.safety {
                    Safety::Everyone => self.add_safety_row(row, missing, missing),
                    Safety::Nearest if nearest.is_none_or(|(other, _)| distance < other.distance) => {
                        nearest = Some((row, missing));
                    }
                    Safety::Nearest | Safety::Boxes(_) => {}
                }
            }
            let own = nearest.filter(|(row, _)| row.distance < ELSEWHERE).map(|(row, _)| row.neighbor);
            self.nearest[key] = own.or(elsewhere).or(nearest.map(|(row, _)| row.neighbor)).unwrap_or_default();
            if let Some((row, own)) = nearest {
                let length = |j: usize| problem.neighbors[j].as_ref().map_or(0.0, |neighbor| neighbor.length);
                let value = lead.map_or(own, |lead| missing(length(lead[key]), row.distance));
                self.add_safety_row(row, own, value);
            }
        }
    }

    #[inline(always)]
    fn evaluate_boxes(&mut self, problem: &Problem, margins: &Margins) {
        let Self { motion, lane_sample, safety, rows, .. } = self;
        let mut count = 0;
        margins.too_near(problem, &motion.states, lane_sample, |row, value| {
            (safety[count], rows.safety[count]) = (row, value);
            count += 1;
        });
        rows.extent.safety = count;
    }

    /// Adds a row of a value, if it is there: in the Jacobian where its `own` value would be positive.
    fn add_safety_row(&mut self, mut row: SafetyRow, own: f64, value: f64) {
        let (in_jacobian, in_value) = (own > 0.0, value > 0.0);
        if !in_jacobian {
            row.away = (0.0, 0.0);
        }
        if !in_value {
            row.value_away = (0.0, 0.0);
        }
        if in_jacobian || in_value {
            let count = &mut self.rows.extent.safety;
            self.safety[*count] = row;
            self.rows.safety[*count] = if in_value { value } else { 0.0 };
            *count += 1;
        }
    }

    /// The safety rows that are not zero, by step.
    #[must_use]
    pub fn safety(&self) -> &[SafetyRow] {
        &self.safety[..self.rows.extent.safety]
    }

    /// How the rows (before weighting) change with the controls: the product of the Jacobian with `direction`. `change` becomes
    /// the change of the states.
    pub fn push_forward(&self, direction: &Controls, change: &mut [StateChange; STEPS], rows: &mut Rows) {
        self.motion.push_forward(direction, change);
        rows.extent = self.rows.extent;
        rows.acceleration = direction.acceleration;
        rows.steering = direction.steering;
        let mut before = Control::default();
        for t in 0..STEPS {
            let now = direction.at(t);
            rows.jerk[t] = (now.acceleration - before.acceleration) / DT;
            rows.steering_change[t] = self.stiffness[t] * (now.steering - before.steering) / DT;
            before = now;
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
        for (i, (x, y)) in self.edge.iter().enumerate().take(rows.extent.lane_edge) {
            let s = &change[lane_step(i)];
            rows.lane_edge[i] = x * s.x + y * s.y;
        }
        for (row, safety) in rows.safety.iter_mut().zip(self.safety()) {
            let s = &change[safety.step];
            *row = -(safety.away.0 * s.x + safety.away.1 * s.y);
            if safety.turn != 0.0 {
                *row -= safety.turn * s.heading;
            }
        }
    }

    /// The gradient by the states, of that by the rows (before weighting).
    #[inline(always)]
    pub(super) fn state_gradient(&self, rows: &Rows) -> [StateChange; STEPS] {
        self.state_gradient_along(rows, |safety| safety.away)
    }

    #[inline(always)]
    fn state_gradient_along(&self, rows: &Rows, away: impl Fn(&SafetyRow) -> (f64, f64)) -> [StateChange; STEPS] {
        let mut states = [StateChange::default(); STEPS];
        for i in 0..LANE_STEPS {
            let s = &mut states[lane_step(i)];
            (s.x, s.y, s.heading) = (rows.lane_x[i], rows.lane_y[i], rows.lane_heading[i]);
        }
        for (i, (x, y)) in self.edge.iter().enumerate().take(rows.extent.lane_edge) {
            let s = &mut states[lane_step(i)];
            s.x += rows.lane_edge[i] * x;
            s.y += rows.lane_edge[i] * y;
        }
        for (row, safety) in rows.safety.iter().zip(self.safety()) {
            let s = &mut states[safety.step];
            let away = away(safety);
            s.x -= row * away.0;
            s.y -= row * away.1;
            if safety.turn != 0.0 {
                s.heading -= row * safety.turn;
            }
        }
        states
    }

    /// The gradient by the controls, of that by the rows (before weighting): the product of the transposed Jacobian with `rows`.
    #[inline(always)]
    pub fn pull_back(&self, rows: &Rows, controls: &mut Controls) {
        self.pull_back_states(rows, &self.state_gradient(rows), controls);
    }

    /// [`Evaluation::pull_back`] by the derivative of the rows' values, which is the Jacobian but where samples are coupled.
    pub(super) fn pull_back_values(&self, rows: &Rows, controls: &mut Controls) {
        self.pull_back_states(rows, &self.state_gradient_along(rows, |safety| safety.value_away), controls);
    }

    #[inline(always)]
    fn pull_back_states(&self, rows: &Rows, states: &[StateChange; STEPS], controls: &mut Controls) {
        controls.acceleration = rows.acceleration;
        controls.steering = rows.steering;
        for t in rows.extent.first_change..STEPS {
            let (jerk, steering_change) = (rows.jerk[t] / DT, self.stiffness[t] * rows.steering_change[t] / DT);
            controls.acceleration[t] += jerk;
            controls.steering[t] += steering_change;
            if t > 0 {
                controls.acceleration[t - 1] -= jerk;
                controls.steering[t - 1] -= steering_change;
            }
        }
        let (mut owed, mut distance) = (0.0, 0.0);
        for t in (0..STEPS).rev() {
            if t >= self.red_from {
                distance += rows.red_light[t];
            }
            owed += self.moves[t] * (rows.speed[t] + DT * distance);
            controls.acceleration[t] += DT * owed;
        }
        self.motion.pull_back(states, controls);
    }

    /// The gradient of the objective by the controls. `scratch` is overwritten.
    pub fn gradient(&self, problem: &Problem, scratch: &mut Rows, controls: &mut Controls) {
        wide(
            #[inline(always)]
            || {
                scratch.set_weighted(&problem.weights, &self.rows, None);
                self.pull_back(scratch, controls);
            },
        );
    }
}
