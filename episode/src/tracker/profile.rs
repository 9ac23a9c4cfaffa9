//! How fast a plan's path is driven and how it bends, read from its poses alone as nuPlan's tracker reads them
//! (`controller/tracker/tracker_utils.py`): two regularized least squares, one after the other, over all poses.
//!
//! - speeds `v`: `sum (v_k dt - s_k)^2 + 1e-4 sum jerk_k^2`, with `s_k` the way from pose k to the next along k's heading, and
//!   `jerk_k` the second difference of the speeds over dt;
//! - curvatures `c`: `sum (v_k dt c_k - h_k)^2 + 1e-2 sum rate_k^2 + 1e-10 c_0^2`, with `h_k` the turn from pose k to the next, and
//!   `rate_k` the difference of curvatures over dt.
//!
//! nuPlan solves for the first value and all differences with a dense pseudo-inverse. In the values themselves the same
//! problems are banded, so that a pass forth and one back are enough.

use world::geometry::{Point, angle_difference};
use world::plan::{PlanState, STEP_SECONDS};

/// Cost of jerk (s^4).
const JERK_COST: f64 = 1e-4;
/// Cost of the change of curvature (m^2 s^2).
const CURVATURE_RATE_COST: f64 = 1e-2;
/// Cost of the first curvature (m^2): it has an answer where nothing moves.
const FIRST_CURVATURE_COST: f64 = 1e-10;

/// Speed and curvature at each pose but the last.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Profile {
    /// m/s.
    pub(super) speeds: Vec<f64>,
    /// 1/m, positive to the left.
    pub(super) curvatures: Vec<f64>,
}

impl Profile {
    /// The profile of `states`, at least four of them.
    pub(super) fn of(states: &[PlanState]) -> Self {
        let along = |pair: &[PlanState]| {
            Point::unit(pair[0].heading).dot(Point::new(pair[1].x - pair[0].x, pair[1].y - pair[0].y))
        };
        let ways: Vec<f64> = states.windows(2).map(along).collect();
        let speeds = speeds(&ways);
        let turns = states.windows(2).map(|pair| angle_difference(pair[0].heading, pair[1].heading));
        let curvatures = curvatures(&speeds, turns);
        Self { speeds, curvatures }
    }
}

fn speeds(ways: &[f64]) -> Vec<f64> {
    let mut system = Banded::new(ways.len());
    for (index, way) in ways.iter().enumerate() {
        system.add_square(index, &[STEP_SECONDS], *way, 1.0);
    }
    for index in 2..ways.len() {
        system.add_square(index - 2, &[1.0, -2.0, 1.0], 0.0, JERK_COST / (STEP_SECONDS * STEP_SECONDS));
    }
    system.solve()
}

fn curvatures(speeds: &[f64], turns: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut system = Banded::new(speeds.len());
    system.add_square(0, &[1.0], 0.0, FIRST_CURVATURE_COST);
    for (index, (speed, turn)) in speeds.iter().zip(turns).enumerate() {
        system.add_square(index, &[speed * STEP_SECONDS], turn, 1.0);
    }
    for index in 1..speeds.len() {
        system.add_square(index - 1, &[-1.0, 1.0], 0.0, CURVATURE_RATE_COST / (STEP_SECONDS * STEP_SECONDS));
    }
    system.solve()
}

/// The normal equations of a least squares problem whose every square joins at most [`WIDTH`] neighboring unknowns.
struct Banded {
    /// Of each row the diagonal and what lies to the right of it.
    rows: Vec<[f64; WIDTH]>,
    right: Vec<f64>,
}

const WIDTH: usize = 3;

impl Banded {
    fn new(unknowns: usize) -> Self {
        Self { rows: vec![[0.0; WIDTH]; unknowns], right: vec![0.0; unknowns] }
    }

    /// Adds `weight (sum factors_i x_(first + i) - target)^2`.
    fn add_square(&mut self, first: usize, factors: &[f64], target: f64, weight: f64) {
        for (row, factor) in factors.iter().enumerate() {
            self.right[first + row] += weight * factor * target;
            for (column, other) in factors.iter().enumerate().skip(row) {
                self.rows[first + row][column - row] += weight * factor * other;
            }
        }
    }

    /// The unknowns: the matrix is positive definite, no pivot is zero.
    fn solve(mut self) -> Vec<f64> {
        for pivot in 0..self.rows.len() {
            let upper = self.rows[pivot];
            for below in 1..WIDTH.min(self.rows.len() - pivot) {
                let factor = upper[below] / upper[0];
                for (entry, over) in self.rows[pivot + below].iter_mut().zip(&upper[below..]) {
                    *entry -= factor * over;
                }
                self.right[pivot + below] -= factor * self.right[pivot];
            }
        }
        for index in (0..self.rows.len()).rev() {
            let known = self.rows[index][1..].iter().zip(&self.right[index + 1..]);
            let known: f64 = known.map(|(factor, value)| factor * value).sum();
            self.right[index] = (self.right[index] - known) / self.rows[index][0];
        }
        self.right
    }
}

#[cfg(test)]
mod tests {
    use world::plan::PLAN_STEPS;

    use super::*;

    #[test]
    fn a_circle_at_growing_speed_is_read_as_it_is() {
        // Each pose follows from the one before as nuPlan's model moves: speed, then heading.
        let (mut x, mut y, mut heading) = (3.0, -1.0, 2.0);
        let states: Vec<PlanState> = (0..PLAN_STEPS)
            .map(|step| {
                let speed = 4.0 + 0.1 * step as f64;
                let state = PlanState { x, y, heading, speed: 0.0 };
                let direction = Point::unit(heading);
                x += direction.x * speed * STEP_SECONDS;
                y += direction.y * speed * STEP_SECONDS;
                heading += 0.05 * speed * STEP_SECONDS;
                state
            })
            .collect();
        let profile = Profile::of(&states);
        for (index, (speed, curvature)) in profile.speeds.iter().zip(&profile.curvatures).enumerate() {
            assert!((speed - (4.0 + 0.1 * index as f64)).abs() < 1e-9, "{index}: {speed}");
            assert!((curvature - 0.05).abs() < 1e-6, "{index}: {curvature}");
        }
    }

    #[test]
    fn a_plan_that_stands_has_no_curvature() {
        let states = [PlanState { x: 5.0, y: 2.0, heading: 1.0, speed: 0.0 }; PLAN_STEPS];
        let profile = Profile::of(&states);
        assert!(profile.speeds.iter().chain(&profile.curvatures).all(|value| *value == 0.0));
    }
}
