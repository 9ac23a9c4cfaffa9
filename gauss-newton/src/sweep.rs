//! The normal equations, solved along the chain of steps.
//!
//! The normal matrix is that of a linear-quadratic control problem: what later steps cost depends on earlier controls only
//! through the state between them and the control before (jerk and steering change). So the controls are eliminated from the
//! last step to the first, each out of a matrix of six numbers' changes:
//!
//! ```text
//! acceleration, steering angle, x, y, heading, speed [, distance for the red light, speed as it is costed]
//! ```
//!
//! The last two only where a red light is passed, or where the vehicle model clips a control so that the speed that is costed
//! is another than that which is driven. The pivots are those of a Cholesky factorization of the normal matrix, its unknowns in
//! backward order; a solve for a right-hand side goes back and forth once over the chain. 50 small steps instead of 100^3 / 3.
//!
//! A tree of futures is a chain up to the junction and one for each branch from there on. What the branches cost depends on the trunk
//! through the same numbers, so their matrices are added where they meet: as many small steps as the tree has.

#![allow(
    clippy::needless_range_loop,
    reason = "indices are the mathematics: rows and columns by name, several arrays at once"
)]

use world::vehicle::UpdateOrder;

use super::constants::{DT, SINGULAR, STEPS, TERMS, Term};
use super::controls::Controls;
use super::motion::{Stage, StateChange};
use super::objective::{Evaluation, SafetyRow};
use super::tree::{BRANCHES, Part, share_trunk};
use super::wide::wide;

const ACCELERATION: usize = 0;
const STEERING: usize = 1;
const X: usize = 2;
const Y: usize = 3;
const HEADING: usize = 4;
const SPEED: usize = 5;
/// Distance driven as it is costed.
const DISTANCE: usize = 6;
/// Speed as it is costed.
const COSTED: usize = 7;

/// Sizes of the matrix without and with the last two.
const SMALL: usize = 6;
const LARGE: usize = 8;

/// The pivot of this control is not positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadPivot {
    /// Step of the control.
    pub step: usize,
}

/// How the controls of a step follow from the state before it and the controls before.
#[derive(Clone, Copy, Debug, Default)]
struct Gains {
    /// Acceleration by steering angle (of the same step) and by state; by position of [`STEERING`] and on.
    acceleration: [f64; LARGE],
    /// Acceleration by the acceleration before.
    acceleration_before: f64,
    /// Steering by state.
    steering: [f64; LARGE],
    /// Steering by the acceleration and the steering before.
    steering_before: [f64; 2],
    /// One over the pivots.
    acceleration_pivot: f64,
    steering_pivot: f64,
}

/// The factorized normal matrix.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// A leg for each branch; the first has the trunk's steps too.
    legs: Vec<Leg>,
    trunk: usize,
    large: bool,
}

#[derive(Clone, Debug)]
struct Leg {
    gains: [Gains; STEPS],
    feed: [[f64; 2]; STEPS],
}

impl Sweep {
    /// For trees of at most so many branches.
    #[must_use]
    pub fn new(branches: usize) -> Self {
        let leg = Leg { gains: [Gains::default(); STEPS], feed: [[0.0; 2]; STEPS] };
        Self { legs: vec![leg; branches], trunk: STEPS, large: false }
    }
}

/// The curvature that each term adds: squared weights.
#[derive(Clone, Copy, Default)]
struct Curvature {
    squared: [f64; TERMS],
    jerk: f64,
    steering_change: f64,
}

impl Curvature {
    fn new(part: &Part<'_>) -> Self {
        let squared = part.weights.map(|w| part.probability * (w * w));
        let per_step = 1.0 / (DT * DT);
        let jerk = squared[Term::Jerk as usize] * per_step;
        let steering_change = squared[Term::SteeringChange as usize] * per_step;
        Self { squared, jerk, steering_change }
    }

    fn of(&self, term: Term) -> f64 {
        self.squared[term as usize]
    }

    /// What all of them add together.
    fn sum(all: &[Self]) -> Self {
        let Some((first, others)) = all.split_first() else { return Self::default() };
        others.iter().fold(*first, |a, b| Self {
            squared: std::array::from_fn(|i| a.squared[i] + b.squared[i]),
            jerk: a.jerk + b.jerk,
            steering_change: a.steering_change + b.steering_change,
        })
    }
}

type Matrix<const N: usize> = [[f64; N]; N];

impl Sweep {
    /// Factorizes the normal matrix of a tree with these branches. Branches beyond those it was made for do not count.
    ///
    /// # Errors
    /// [`BadPivot`], if the matrix is singular.
    pub(super) fn factorize(&mut self, parts: &[Part<'_>], trunk: usize) -> Result<(), BadPivot> {
        self.trunk = trunk;
        let as_driven = |stage: &Stage| stage.acceleration == DT && stage.speed == 1.0;
        self.large = parts.iter().any(|part| part.at.red_from < STEPS || !part.at.motion.stages.iter().all(as_driven));
        let Some(order) = parts.first().map(|part| part.at.motion.order) else { return Ok(()) };
        wide(
            #[inline(always)]
            || match (self.large, order) {
                (false, UpdateOrder::FromUpdated) => self.factorize_sized::<SMALL, true>(parts, trunk),
                (false, UpdateOrder::FromBefore) => self.factorize_sized::<SMALL, false>(parts, trunk),
                (true, UpdateOrder::FromUpdated) => self.factorize_sized::<LARGE, true>(parts, trunk),
                (true, UpdateOrder::FromBefore) => self.factorize_sized::<LARGE, false>(parts, trunk),
            },
        )
    }

    #[inline(always)]
    fn factorize_sized<const N: usize, const UPDATED: bool>(
        &mut self,
        parts: &[Part<'_>],
        trunk: usize,
    ) -> Result<(), BadPivot> {
        let mut junction: Matrix<N> = [[0.0; N]; N];
        let mut curvatures = [Curvature::default(); BRANCHES];
        let mut safety: [&[SafetyRow]; BRANCHES] = [&[]; BRANCHES];
        for (k, (part, leg)) in parts.iter().zip(&mut self.legs).enumerate() {
            let mut p: Matrix<N> = [[0.0; N]; N];
            curvatures[k] = Curvature::new(part);
            safety[k] = part.at.safety();
            for t in (trunk..STEPS).rev() {
                add_curvature(&mut p, t, part.at, &curvatures[k], &mut safety[k]);
                pull_both_sides::<N, UPDATED>(part.at, t, &mut p);
                eliminate(&mut p, t, part.at, &curvatures[k], &mut leg.gains[t]).ok_or(BadPivot { step: t })?;
            }
            if k == 0 {
                junction = p;
            } else {
                for i in 0..N {
                    for j in 0..N {
                        junction[i][j] += p[i][j];
                    }
                }
            }
        }
        let (Some(part), Some(leg)) = (parts.first(), self.legs.first_mut()) else { return Ok(()) };
        // The states are the same in all branches there; the rows are not.
        let (at, p) = (part.at, &mut junction);
        let together = Curvature::sum(&curvatures[..parts.len().min(BRANCHES)]);
        for t in (0..trunk).rev() {
            for (k, part) in parts.iter().enumerate() {
                add_curvature(p, t, part.at, &curvatures[k], &mut safety[k]);
            }
            pull_both_sides::<N, UPDATED>(at, t, p);
            eliminate(p, t, at, &together, &mut leg.gains[t]).ok_or(BadPivot { step: t })?;
        }
        Ok(())
    }

    /// Solves `matrix * solution = right` for the tree that was factorized last, controls by branch. The trunk's steps are those of the
    /// first branch of `right`, and in `solution` those of all.
    pub(super) fn solve(&mut self, parts: &[Part<'_>], right: &[Controls], solution: &mut [Controls]) {
        let Some(order) = parts.first().map(|part| part.at.motion.order) else { return };
        wide(
            #[inline(always)]
            || match (self.large, order) {
                (false, UpdateOrder::FromUpdated) => self.solve_sized::<SMALL, true>(parts, right, solution),
                (false, UpdateOrder::FromBefore) => self.solve_sized::<SMALL, false>(parts, right, solution),
                (true, UpdateOrder::FromUpdated) => self.solve_sized::<LARGE, true>(parts, right, solution),
                (true, UpdateOrder::FromBefore) => self.solve_sized::<LARGE, false>(parts, right, solution),
            },
        );
    }

    #[inline(always)]
    fn solve_sized<const N: usize, const UPDATED: bool>(
        &mut self,
        parts: &[Part<'_>],
        right: &[Controls],
        solution: &mut [Controls],
    ) {
        let (trunk, Some(shared)) = (self.trunk, right.first()) else { return };
        let mut junction = [0.0; N];
        for (k, ((part, leg), right)) in parts.iter().zip(&mut self.legs).zip(right).enumerate() {
            let mut q = [0.0; N];
            for t in (trunk..STEPS).rev() {
                leg.back::<N, UPDATED>(part.at, t, right, &mut q);
            }
            if k == 0 {
                junction = q;
            } else {
                for i in 0..N {
                    junction[i] += q[i];
                }
            }
        }
        let Some((part, leg)) = parts.first().zip(self.legs.first_mut()) else { return };
        for t in (0..trunk).rev() {
            leg.back::<N, UPDATED>(part.at, t, shared, &mut junction);
        }
        let mut at_junction = Position::default();
        if let Some(solution) = solution.first_mut() {
            for t in 0..trunk {
                leg.forth::<N, UPDATED>(part.at, t, &mut at_junction, solution);
            }
        }
        for ((part, leg), solution) in parts.iter().zip(&self.legs).zip(&mut *solution) {
            let mut position = at_junction;
            for t in trunk..STEPS {
                leg.forth::<N, UPDATED>(part.at, t, &mut position, solution);
            }
        }
        share_trunk(trunk, solution);
    }
}

/// Where the way forth is: changes of what it has passed.
#[derive(Clone, Copy, Default)]
struct Position {
    state: StateChange,
    costed: f64,
    distance: f64,
    acceleration: f64,
    steering: f64,
}

impl Leg {
    /// Takes the controls of step `t` out of the right-hand side.
    #[inline(always)]
    fn back<const N: usize, const UPDATED: bool>(
        &mut self,
        at: &Evaluation,
        t: usize,
        right: &Controls,
        q: &mut [f64; N],
    ) {
        q[ACCELERATION] += right.acceleration[t];
        q[STEERING] += right.steering[t];
        pull::<N, UPDATED>(at, t, q);
        let gains = &self.gains[t];
        let a = q[ACCELERATION];
        for i in STEERING..N {
            q[i] -= a * gains.acceleration[i];
        }
        let s = q[STEERING];
        for i in X..N {
            q[i] -= s * gains.steering[i];
        }
        self.feed[t] = [a * gains.acceleration_pivot, s * gains.steering_pivot];
        q[ACCELERATION] = -a * gains.acceleration_before - s * gains.steering_before[0];
        q[STEERING] = -s * gains.steering_before[1];
    }

    /// Finds the controls of step `t`, and goes past it.
    #[inline(always)]
    fn forth<const N: usize, const UPDATED: bool>(
        &self,
        at: &Evaluation,
        t: usize,
        position: &mut Position,
        solution: &mut Controls,
    ) {
        let Position { state, costed, distance, acceleration: a, steering: s } = position;
        let gains = &self.gains[t];
        let by_state = |gain: &[f64; LARGE]| {
            let small =
                gain[X] * state.x + gain[Y] * state.y + gain[HEADING] * state.heading + gain[SPEED] * state.speed;
            if N == LARGE { small + gain[DISTANCE] * *distance + gain[COSTED] * *costed } else { small }
        };
        let before = gains.steering_before[0] * *a + gains.steering_before[1] * *s;
        *s = self.feed[t][1] - by_state(&gains.steering) - before;
        *a = self.feed[t][0]
            - gains.acceleration[STEERING] * *s
            - by_state(&gains.acceleration)
            - gains.acceleration_before * *a;
        solution.acceleration[t] = *a;
        solution.steering[t] = *s;
        let order = if UPDATED { UpdateOrder::FromUpdated } else { UpdateOrder::FromBefore };
        at.motion.stages[t].push(order, state, *a, *s);
        if N == LARGE {
            *costed += DT * *a;
            *distance += DT * at.moves[t] * *costed;
        }
    }
}

/// Adds what the rows of step `t` cost.
#[inline(always)]
fn add_curvature<const N: usize>(
    p: &mut Matrix<N>,
    t: usize,
    at: &Evaluation,
    curvature: &Curvature,
    safety: &mut &[SafetyRow],
) {
    p[ACCELERATION][ACCELERATION] += curvature.of(Term::Acceleration);
    p[STEERING][STEERING] += curvature.of(Term::Steering);
    let costed = if N == LARGE { COSTED } else { SPEED };
    p[costed][costed] += curvature.of(Term::Speed) * at.moves[t];
    if N == LARGE && t >= at.red_from {
        p[DISTANCE][DISTANCE] += curvature.of(Term::RedLight);
    }
    if t % 2 == 1 {
        p[X][X] += curvature.of(Term::LanePosition);
        p[Y][Y] += curvature.of(Term::LanePosition);
        p[HEADING][HEADING] += curvature.of(Term::LaneHeading);
        if at.rows.extent.lane_edge > 0 {
            add_position(p, curvature.of(Term::LanePosition), at.edge[t / 2]);
        }
    }
    while let Some((row, rest)) = safety.split_last()
        && row.step == t
    {
        *safety = rest;
        if row.turn == 0.0 {
            add_position(p, curvature.of(Term::Safety), row.away);
        } else {
            add_pose(p, curvature.of(Term::Safety), [row.away.0, row.away.1, row.turn]);
        }
    }
}

/// Adds what a row costs that changes by this vector with the position.
#[inline(always)]
fn add_position<const N: usize>(p: &mut Matrix<N>, weight: f64, (x, y): (f64, f64)) {
    p[X][X] += weight * x * x;
    p[X][Y] += weight * x * y;
    p[Y][X] += weight * x * y;
    p[Y][Y] += weight * y * y;
}

/// The same for a row that changes with x, y and heading.
#[inline(always)]
fn add_pose<const N: usize>(p: &mut Matrix<N>, weight: f64, by: [f64; 3]) {
    for (i, a) in by.iter().enumerate() {
        for (j, b) in by.iter().enumerate() {
            p[X + i][X + j] += weight * (a * b);
        }
    }
}

/// What is linear in the state after step `t` becomes linear in the state before it and the controls.
#[inline(always)]
fn pull<const N: usize, const UPDATED: bool>(at: &Evaluation, t: usize, q: &mut [f64; N]) {
    let order = if UPDATED { UpdateOrder::FromUpdated } else { UpdateOrder::FromBefore };
    let mut state = StateChange { x: q[X], y: q[Y], heading: q[HEADING], speed: q[SPEED] };
    let (acceleration, steering) = at.motion.stages[t].pull(order, &mut state);
    (q[X], q[Y], q[HEADING], q[SPEED]) = (state.x, state.y, state.heading, state.speed);
    q[ACCELERATION] += acceleration;
    q[STEERING] += steering;
    if N == LARGE {
        q[COSTED] += DT * at.moves[t] * q[DISTANCE];
        q[ACCELERATION] += DT * q[COSTED];
    }
}

/// The same for what is quadratic: [`pull`] from either side, entry by entry.
#[inline(always)]
fn pull_both_sides<const N: usize, const UPDATED: bool>(at: &Evaluation, t: usize, p: &mut Matrix<N>) {
    let stage = &at.motion.stages[t];
    let to_heading = [(stage.side_x, X), (stage.side_y, Y)];
    let to_speed = [(stage.forward_x, X), (stage.forward_y, Y), (stage.turn, HEADING)];
    if UPDATED {
        add_to(p, HEADING, to_heading);
        add_to(p, SPEED, to_speed);
    }
    add_to(p, STEERING, [(stage.steering, HEADING)]);
    if N == LARGE {
        add_to(p, COSTED, [(DT * at.moves[t], DISTANCE)]);
        add_to(p, ACCELERATION, [(stage.acceleration, SPEED), (DT, COSTED)]);
        for i in 0..N {
            p[SPEED][i] *= stage.speed;
            p[i][SPEED] *= stage.speed;
        }
    } else {
        // No clip is active: the gains are the step and 1.
        add_to(p, ACCELERATION, [(DT, SPEED)]);
    }
    if !UPDATED {
        add_to(p, SPEED, to_speed);
        add_to(p, HEADING, to_heading);
    }
}

/// Adds multiples of rows to row `to`, and the same of columns to column `to`: the matrix stays symmetric.
#[inline(always)]
fn add_to<const N: usize, const K: usize>(p: &mut Matrix<N>, to: usize, from: [(f64, usize); K]) {
    let mut row = p[to];
    for (factor, from) in from {
        for i in 0..N {
            row[i] += factor * p[from][i];
        }
    }
    for (factor, from) in from {
        row[to] += factor * row[from];
    }
    for i in 0..N {
        p[i][to] = row[i];
    }
    p[to] = row;
}

/// Takes the controls of step `t` out of the matrix and puts those of the step before in their place. `None` if a pivot is
/// not positive.
#[inline(always)]
fn eliminate<const N: usize>(
    p: &mut Matrix<N>,
    t: usize,
    at: &Evaluation,
    curvature: &Curvature,
    gains: &mut Gains,
) -> Option<()> {
    let (jerk, steering_change) = if t < at.rows.extent.first_change {
        (0.0, 0.0)
    } else {
        (curvature.jerk, curvature.steering_change * at.stiffness[t] * at.stiffness[t])
    };

    let rest = p[ACCELERATION][ACCELERATION];
    let row = p[ACCELERATION];
    let pivot = checked_pivot(rest, jerk, curvature.of(Term::Acceleration) + 2.0 * jerk)?;
    gains.acceleration_pivot = pivot;
    let gain: [f64; N] = row.map(
        #[inline(always)]
        |entry| entry * pivot,
    );
    gains.acceleration[..N].copy_from_slice(&gain);
    gains.acceleration_before = -jerk * pivot;
    for i in STEERING..N {
        for j in STEERING..N {
            p[i][j] -= row[i] * gain[j];
        }
    }
    // The row of the acceleration before.
    let before: [f64; N] = gain.map(
        #[inline(always)]
        |gain| jerk * gain,
    );
    let mut before_before = rest * jerk * pivot;

    let rest = p[STEERING][STEERING];
    let row = p[STEERING];
    let pivot = checked_pivot(rest, steering_change, curvature.of(Term::Steering) + 2.0 * steering_change)?;
    gains.steering_pivot = pivot;
    let gain: [f64; N] = row.map(
        #[inline(always)]
        |entry| entry * pivot,
    );
    gains.steering[..N].copy_from_slice(&gain);
    let across = before[STEERING] * pivot;
    gains.steering_before = [across, -steering_change * pivot];
    for i in X..N {
        for j in X..N {
            p[i][j] -= row[i] * gain[j];
        }
    }
    for i in X..N {
        let a = before[i] - across * row[i];
        let s = steering_change * gain[i];
        (p[ACCELERATION][i], p[i][ACCELERATION]) = (a, a);
        (p[STEERING][i], p[i][STEERING]) = (s, s);
    }
    before_before -= before[STEERING] * across;
    p[ACCELERATION][ACCELERATION] = before_before;
    p[ACCELERATION][STEERING] = steering_change * across;
    p[STEERING][ACCELERATION] = steering_change * across;
    p[STEERING][STEERING] = rest * steering_change * pivot;
    Some(())
}

/// One over `rest + coupling`, if that is positive and more than rounding of `scale`.
#[inline(always)]
fn checked_pivot(rest: f64, coupling: f64, scale: f64) -> Option<f64> {
    let pivot = rest + coupling;
    (pivot > SINGULAR * scale && pivot.is_finite()).then(|| 1.0 / pivot)
}
