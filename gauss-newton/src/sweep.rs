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

#![allow(
    clippy::needless_range_loop,
    reason = "indices are the mathematics: rows and columns by name, several arrays at once"
)]

use world::vehicle::UpdateOrder;

use super::constants::{DT, KEY_STEPS, SINGULAR, STEPS, TERMS, Term};
use super::controls::Controls;
use super::motion::{Stage, StateChange};
use super::objective::{Evaluation, SafetyRow};
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
    gains: [Gains; STEPS],
    feed: [[f64; 2]; STEPS],
    large: bool,
}

impl Default for Sweep {
    fn default() -> Self {
        Self { gains: [Gains::default(); STEPS], feed: [[0.0; 2]; STEPS], large: false }
    }
}

/// The curvature that each term adds: squared weights.
struct Curvature {
    squared: [f64; TERMS],
    jerk: f64,
    steering_change: f64,
}

impl Curvature {
    fn of(&self, term: Term) -> f64 {
        self.squared[term as usize]
    }
}

type Matrix<const N: usize> = [[f64; N]; N];

impl Sweep {
    /// Factorizes the normal matrix at this point.
    ///
    /// # Errors
    /// [`BadPivot`], if the matrix is singular.
    pub fn factorize(&mut self, at: &Evaluation, weights: &[f64; TERMS]) -> Result<(), BadPivot> {
        let squared = weights.map(|w| w * w);
        let per_step = 1.0 / (DT * DT);
        let jerk = squared[Term::Jerk as usize] * per_step;
        let steering_change = squared[Term::SteeringChange as usize] * per_step;
        let curvature = Curvature { squared, jerk, steering_change };
        let as_driven = |stage: &Stage| stage.acceleration == DT && stage.speed == 1.0;
        self.large = at.red_from < STEPS || !at.motion.stages.iter().all(as_driven);
        wide(
            #[inline(always)]
            || match (self.large, at.motion.order) {
                (false, UpdateOrder::FromUpdated) => self.factorize_sized::<SMALL, true>(at, &curvature),
                (false, UpdateOrder::FromBefore) => self.factorize_sized::<SMALL, false>(at, &curvature),
                (true, UpdateOrder::FromUpdated) => self.factorize_sized::<LARGE, true>(at, &curvature),
                (true, UpdateOrder::FromBefore) => self.factorize_sized::<LARGE, false>(at, &curvature),
            },
        )
    }

    #[inline(always)]
    fn factorize_sized<const N: usize, const UPDATED: bool>(
        &mut self,
        at: &Evaluation,
        curvature: &Curvature,
    ) -> Result<(), BadPivot> {
        let mut p: Matrix<N> = [[0.0; N]; N];
        let mut safety = at.safety();
        for t in (0..STEPS).rev() {
            add_curvature(&mut p, t, at, curvature, &mut safety);
            pull_both_sides::<N, UPDATED>(at, t, &mut p);
            eliminate(&mut p, t, at, curvature, &mut self.gains[t]).ok_or(BadPivot { step: t })?;
        }
        Ok(())
    }

    /// Solves `matrix * solution = right`.
    pub fn solve(&mut self, at: &Evaluation, right: &Controls, solution: &mut Controls) {
        wide(
            #[inline(always)]
            || match (self.large, at.motion.order) {
                (false, UpdateOrder::FromUpdated) => self.solve_sized::<SMALL, true>(at, right, solution),
                (false, UpdateOrder::FromBefore) => self.solve_sized::<SMALL, false>(at, right, solution),
                (true, UpdateOrder::FromUpdated) => self.solve_sized::<LARGE, true>(at, right, solution),
                (true, UpdateOrder::FromBefore) => self.solve_sized::<LARGE, false>(at, right, solution),
            },
        );
    }

    #[inline(always)]
    fn solve_sized<const N: usize, const UPDATED: bool>(
        &mut self,
        at: &Evaluation,
        right: &Controls,
        solution: &mut Controls,
    ) {
        let mut q = [0.0; N];
        for t in (0..STEPS).rev() {
            q[ACCELERATION] += right.acceleration[t];
            q[STEERING] += right.steering[t];
            pull::<N, UPDATED>(at, t, &mut q);
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
        let (mut state, mut costed, mut distance) = (StateChange::default(), 0.0, 0.0);
        let (mut a, mut s) = (0.0, 0.0);
        for t in 0..STEPS {
            let gains = &self.gains[t];
            let by_state = |gain: &[f64; LARGE]| {
                let small =
                    gain[X] * state.x + gain[Y] * state.y + gain[HEADING] * state.heading + gain[SPEED] * state.speed;
                if N == LARGE { small + gain[DISTANCE] * distance + gain[COSTED] * costed } else { small }
            };
            let before = gains.steering_before[0] * a + gains.steering_before[1] * s;
            s = self.feed[t][1] - by_state(&gains.steering) - before;
            a = self.feed[t][0]
                - gains.acceleration[STEERING] * s
                - by_state(&gains.acceleration)
                - gains.acceleration_before * a;
            solution.acceleration[t] = a;
            solution.steering[t] = s;
            let order = if UPDATED { UpdateOrder::FromUpdated } else { UpdateOrder::FromBefore };
            at.motion.stages[t].push(order, &mut state, a, s);
            if N == LARGE {
                costed += DT * a;
                distance += DT * at.moves[t] * costed;
            }
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
        && KEY_STEPS[row.key] == t
    {
        *safety = rest;
        add_position(p, curvature.of(Term::Safety), row.away);
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
