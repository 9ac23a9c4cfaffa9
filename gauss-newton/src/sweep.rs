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
//! Each number waits for the one before, so the chains of several searches at once take hardly longer than that of one.

#![allow(
    clippy::needless_range_loop,
    reason = "indices are the mathematics: rows and columns by name, several arrays at once"
)]

use world::vehicle::UpdateOrder;

use super::constants::{DT, KEY_STEPS, SINGULAR, STEPS, TERMS, Term};
use super::controls::Controls;
use super::lanes::Lanes;
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
struct Gains<const L: usize> {
    /// Acceleration by steering angle (of the same step) and by state; by position of [`STEERING`] and on.
    acceleration: [Lanes<L>; LARGE],
    /// Acceleration by the acceleration before.
    acceleration_before: Lanes<L>,
    /// Steering by state.
    steering: [Lanes<L>; LARGE],
    /// Steering by the acceleration and the steering before.
    steering_before: [Lanes<L>; 2],
    /// One over the pivots.
    acceleration_pivot: Lanes<L>,
    steering_pivot: Lanes<L>,
}

/// The factorized normal matrices of `L` searches.
#[derive(Clone, Debug)]
pub struct Sweep<const L: usize> {
    gains: [Gains<L>; STEPS],
    feed: [[Lanes<L>; 2]; STEPS],
    shape: Shape,
}

impl<const L: usize> Default for Sweep<L> {
    fn default() -> Self {
        Self {
            gains: [Gains::default(); STEPS],
            feed: [[Lanes::ZERO; 2]; STEPS],
            shape: Shape { large: false, order: UpdateOrder::FromUpdated },
        }
    }
}

/// How a matrix is made. Those that are factorized at once are made alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    large: bool,
    order: UpdateOrder,
}

impl Shape {
    /// That of the normal matrix at a point.
    pub fn of(at: &Evaluation) -> Self {
        let as_driven = |stage: &Stage| stage.acceleration == DT && stage.speed == 1.0;
        let large = at.red_from < STEPS || !at.motion.stages.iter().all(as_driven);
        Self { large, order: at.motion.order }
    }
}

/// The curvature that each term adds: squared weights.
struct Curvature {
    squared: [f64; TERMS],
    jerk: f64,
    steering_change: f64,
}

impl Curvature {
    #[inline(always)]
    fn of<const L: usize>(&self, term: Term) -> Lanes<L> {
        Lanes::all(self.squared[term as usize])
    }
}

type Matrix<const N: usize, const L: usize> = [[Lanes<L>; N]; N];

impl<const L: usize> Sweep<L> {
    /// Factorizes the normal matrices at these points, all of one [`Shape`].
    ///
    /// # Errors
    /// [`BadPivot`], if a matrix is singular.
    pub fn factorize(&mut self, at: [&Evaluation; L], weights: &[f64; TERMS]) -> [Result<(), BadPivot>; L] {
        let squared = weights.map(|w| w * w);
        let per_step = 1.0 / (DT * DT);
        let jerk = squared[Term::Jerk as usize] * per_step;
        let steering_change = squared[Term::SteeringChange as usize] * per_step;
        let curvature = Curvature { squared, jerk, steering_change };
        self.shape = Shape::of(at[0]);
        wide(
            #[inline(always)]
            || match (self.shape.large, self.shape.order) {
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
        at: [&Evaluation; L],
        curvature: &Curvature,
    ) -> [Result<(), BadPivot>; L] {
        let mut results = [Ok(()); L];
        let mut p: Matrix<N, L> = [[Lanes::ZERO; N]; N];
        let mut safety = at.map(Evaluation::safety);
        for t in (0..STEPS).rev() {
            add_curvature(&mut p, t, at, curvature, &mut safety);
            pull_both_sides::<N, L, UPDATED>(at, t, &mut p);
            let good = eliminate(&mut p, t, at, curvature, &mut self.gains[t]);
            for l in 0..L {
                if !good[l] && results[l].is_ok() {
                    results[l] = Err(BadPivot { step: t });
                }
            }
            if results.iter().all(Result::is_err) {
                break;
            }
        }
        results
    }

    /// Solves `matrix * solution = right` for each.
    pub fn solve(&mut self, at: [&Evaluation; L], right: [&Controls; L], solution: [&mut Controls; L]) {
        wide(
            #[inline(always)]
            || match (self.shape.large, self.shape.order) {
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
        at: [&Evaluation; L],
        right: [&Controls; L],
        mut solution: [&mut Controls; L],
    ) {
        let mut q = [Lanes::ZERO; N];
        for t in (0..STEPS).rev() {
            q[ACCELERATION] += Lanes::of(|l| right[l].acceleration[t]);
            q[STEERING] += Lanes::of(|l| right[l].steering[t]);
            pull::<N, L, UPDATED>(at, t, &mut q);
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
        let (mut state, mut costed, mut distance) = (StateChange::<Lanes<L>>::default(), Lanes::ZERO, Lanes::ZERO);
        let (mut a, mut s) = (Lanes::ZERO, Lanes::ZERO);
        for t in 0..STEPS {
            let gains = &self.gains[t];
            let by_state = |gain: &[Lanes<L>; LARGE]| {
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
            for (l, solution) in solution.iter_mut().enumerate() {
                solution.acceleration[t] = a.0[l];
                solution.steering[t] = s.0[l];
            }
            stage(at, t).push(order::<UPDATED>(), &mut state, a, s);
            if N == LARGE {
                costed += Lanes::all(DT) * a;
                distance += Lanes::all(DT) * moves(at, t) * costed;
            }
        }
    }
}

#[inline(always)]
fn order<const UPDATED: bool>() -> UpdateOrder {
    if UPDATED { UpdateOrder::FromUpdated } else { UpdateOrder::FromBefore }
}

/// The chain's link at a step, of each search.
#[inline(always)]
fn stage<const L: usize>(at: [&Evaluation; L], t: usize) -> Stage<Lanes<L>> {
    let of = |part: fn(&Stage) -> f64| Lanes::of(|l| part(&at[l].motion.stages[t]));
    Stage {
        forward_x: of(|stage| stage.forward_x),
        forward_y: of(|stage| stage.forward_y),
        side_x: of(|stage| stage.side_x),
        side_y: of(|stage| stage.side_y),
        turn: of(|stage| stage.turn),
        steering: of(|stage| stage.steering),
        acceleration: of(|stage| stage.acceleration),
        speed: of(|stage| stage.speed),
    }
}

#[inline(always)]
fn moves<const L: usize>(at: [&Evaluation; L], t: usize) -> Lanes<L> {
    Lanes::of(|l| at[l].moves[t])
}

/// Adds what the rows of step `t` cost.
#[inline(always)]
fn add_curvature<const N: usize, const L: usize>(
    p: &mut Matrix<N, L>,
    t: usize,
    at: [&Evaluation; L],
    curvature: &Curvature,
    safety: &mut [&[SafetyRow]; L],
) {
    p[ACCELERATION][ACCELERATION] += curvature.of(Term::Acceleration);
    p[STEERING][STEERING] += curvature.of(Term::Steering);
    let costed = if N == LARGE { COSTED } else { SPEED };
    p[costed][costed] += curvature.of(Term::Speed) * moves(at, t);
    if N == LARGE {
        for l in 0..L {
            if t >= at[l].red_from {
                p[DISTANCE][DISTANCE].0[l] += curvature.squared[Term::RedLight as usize];
            }
        }
    }
    if t % 2 == 1 {
        p[X][X] += curvature.of(Term::LanePosition);
        p[Y][Y] += curvature.of(Term::LanePosition);
        p[HEADING][HEADING] += curvature.of(Term::LaneHeading);
        for l in 0..L {
            if at[l].rows.extent.lane_edge > 0 {
                add_position(p, l, curvature.squared[Term::LanePosition as usize], at[l].edge[t / 2]);
            }
        }
    }
    for l in 0..L {
        while let Some((row, rest)) = safety[l].split_last()
            && KEY_STEPS[row.key] == t
        {
            safety[l] = rest;
            add_position(p, l, curvature.squared[Term::Safety as usize], row.away);
        }
    }
}

/// Adds what a row of a search costs that changes by this vector with the position.
#[inline(always)]
fn add_position<const N: usize, const L: usize>(p: &mut Matrix<N, L>, l: usize, weight: f64, (x, y): (f64, f64)) {
    p[X][X].0[l] += weight * x * x;
    p[X][Y].0[l] += weight * x * y;
    p[Y][X].0[l] += weight * x * y;
    p[Y][Y].0[l] += weight * y * y;
}

/// What is linear in the state after step `t` becomes linear in the state before it and the controls.
#[inline(always)]
fn pull<const N: usize, const L: usize, const UPDATED: bool>(at: [&Evaluation; L], t: usize, q: &mut [Lanes<L>; N]) {
    let mut state = StateChange { x: q[X], y: q[Y], heading: q[HEADING], speed: q[SPEED] };
    let (acceleration, steering) = stage(at, t).pull(order::<UPDATED>(), &mut state);
    (q[X], q[Y], q[HEADING], q[SPEED]) = (state.x, state.y, state.heading, state.speed);
    q[ACCELERATION] += acceleration;
    q[STEERING] += steering;
    if N == LARGE {
        let by_distance = Lanes::all(DT) * moves(at, t) * q[DISTANCE];
        q[COSTED] += by_distance;
        let by_speed = Lanes::all(DT) * q[COSTED];
        q[ACCELERATION] += by_speed;
    }
}

/// The same for what is quadratic: [`pull`] from either side, entry by entry.
#[inline(always)]
fn pull_both_sides<const N: usize, const L: usize, const UPDATED: bool>(
    at: [&Evaluation; L],
    t: usize,
    p: &mut Matrix<N, L>,
) {
    let stage = stage(at, t);
    let to_heading = [(stage.side_x, X), (stage.side_y, Y)];
    let to_speed = [(stage.forward_x, X), (stage.forward_y, Y), (stage.turn, HEADING)];
    if UPDATED {
        add_to(p, HEADING, to_heading);
        add_to(p, SPEED, to_speed);
    }
    add_to(p, STEERING, [(stage.steering, HEADING)]);
    let step = Lanes::all(DT);
    if N == LARGE {
        add_to(p, COSTED, [(step * moves(at, t), DISTANCE)]);
        add_to(p, ACCELERATION, [(stage.acceleration, SPEED), (step, COSTED)]);
        for i in 0..N {
            p[SPEED][i] *= stage.speed;
            p[i][SPEED] *= stage.speed;
        }
    } else {
        // No clip is active: the gains are the step and 1.
        add_to(p, ACCELERATION, [(step, SPEED)]);
    }
    if !UPDATED {
        add_to(p, SPEED, to_speed);
        add_to(p, HEADING, to_heading);
    }
}

/// Adds multiples of rows to row `to`, and the same of columns to column `to`: the matrix stays symmetric.
#[inline(always)]
fn add_to<const N: usize, const L: usize, const K: usize>(
    p: &mut Matrix<N, L>,
    to: usize,
    from: [(Lanes<L>, usize); K],
) {
    let mut row = p[to];
    for (factor, from) in from {
        for i in 0..N {
            row[i] += factor * p[from][i];
        }
    }
    for (factor, from) in from {
        let across = factor * row[from];
        row[to] += across;
    }
    for i in 0..N {
        p[i][to] = row[i];
    }
    p[to] = row;
}

/// Takes the controls of step `t` out of the matrix and puts those of the step before in their place. Says of each search whether its
/// pivots are positive.
#[inline(always)]
fn eliminate<const N: usize, const L: usize>(
    p: &mut Matrix<N, L>,
    t: usize,
    at: [&Evaluation; L],
    curvature: &Curvature,
    gains: &mut Gains<L>,
) -> [bool; L] {
    let coupled =
        |of: &dyn Fn(usize) -> f64| Lanes::of(|l| if t < at[l].rows.extent.first_change { 0.0 } else { of(l) });
    let jerk = coupled(&|_| curvature.jerk);
    let steering_change = coupled(&|l| curvature.steering_change * at[l].stiffness[t] * at[l].stiffness[t]);
    let two = Lanes::all(2.0);

    let rest = p[ACCELERATION][ACCELERATION];
    let row = p[ACCELERATION];
    let (pivot, good_acceleration) = checked_pivot(rest, jerk, curvature.of(Term::Acceleration) + two * jerk);
    gains.acceleration_pivot = pivot;
    let gain: [Lanes<L>; N] = row.map(
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
    let before: [Lanes<L>; N] = gain.map(
        #[inline(always)]
        |gain| jerk * gain,
    );
    let mut before_before = rest * jerk * pivot;

    let rest = p[STEERING][STEERING];
    let row = p[STEERING];
    let (pivot, good_steering) =
        checked_pivot(rest, steering_change, curvature.of(Term::Steering) + two * steering_change);
    gains.steering_pivot = pivot;
    let gain: [Lanes<L>; N] = row.map(
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
    std::array::from_fn(|l| good_acceleration[l] && good_steering[l])
}

/// One over `rest + coupling`, and of each whether that is positive and more than rounding of `scale`.
#[inline(always)]
fn checked_pivot<const L: usize>(rest: Lanes<L>, coupling: Lanes<L>, scale: Lanes<L>) -> (Lanes<L>, [bool; L]) {
    let pivot = rest + coupling;
    let good = std::array::from_fn(|l| pivot.0[l] > SINGULAR * scale.0[l] && pivot.0[l].is_finite());
    (Lanes::of(|l| 1.0 / pivot.0[l]), good)
}
