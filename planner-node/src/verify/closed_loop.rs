//! The plans of the authors' closed loop: every tenth step of an episode, from the inputs that were stored with it.
//!
//! The reference line comes from the episode's route, rounded to f32 where the authors store it; the predictions from the
//! neighbors' states and the turn rate that the stored poses tell.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use gauss_newton::constants::{DT, HAND_TUNED, NEIGHBORS, STEPS, STOP_MARGIN};
use gauss_newton::{Controls, Inputs, LinearSolver, Neighbor, Problem, Settings, Solver, Vehicle, trajectory};
use vectors::{Npz, NpzError, absolute, relative, worst_deviation};
use world::authors_frame::single;
use world::geometry::wrap_angle;
use world::vehicle::{BicycleModel, VehicleState};

use super::case::CaseError;
use super::quantities::{Deviations, LOOP_CONTROLS, LOOP_OBJECTIVES, LOOP_POSES};

/// Rows of the reference line that lie behind the AV.
const BEHIND: usize = 200;

/// Every tenth row of the reference line is stored.
const ROWS_STORED: usize = 120;

/// The route file beside an episode's, if this is an episode of the planner.
pub(super) fn route_of(episode: &Path) -> Option<PathBuf> {
    let scene = episode.file_name()?.to_str()?.strip_suffix("__planner.npz")?;
    Some(episode.with_file_name(format!("{scene}__route.npz")))
}

/// The plans of an episode that can be compared.
pub(super) struct Episode {
    plans: Vec<Stored>,
    /// How many cannot, since it is not known which red light was ahead.
    pub left_out: usize,
}

/// A situation and what the authors planned in it.
struct Stored {
    problem: Problem,
    control: [f64; 2],
    pose: [f64; 3],
    objective: f64,
}

/// Reads an episode.
pub(super) fn read(npz: &Npz, route: &Npz) -> Result<Episode, CaseError> {
    let steps = npz.array("every10_step", &[None])?;
    let objectives = npz.array("plan_objective", &[None])?;
    let mut episode = Episode { plans: Vec::new(), left_out: 0 };
    for (stored, step) in steps.iter().enumerate() {
        let step = *step as usize;
        // The observation after the last step has no plan.
        let Some(objective) = objectives.get(step) else { continue };
        let Some(problem) = problem(npz, route, stored, step)? else {
            episode.left_out += 1;
            continue;
        };
        episode.plans.push(Stored {
            problem,
            control: row(npz, "control_first", &[Some(objectives.len()), Some(2)], step)?,
            pose: row(npz, "plan_first", &[Some(objectives.len()), Some(3)], step)?,
            objective: *objective,
        });
    }
    Ok(episode)
}

/// The deviations of an episode.
pub(super) fn deviations(episode: &Episode, linear: LinearSolver) -> Deviations {
    let mut solver = Solver::new(linear);
    let mut found = Vec::new();
    for Stored { problem, control, pose, objective } in &episode.plans {
        let Ok(summary) = solver.solve(problem, &Settings::paper_test(), &Controls::ZERO) else {
            found.push((LOOP_OBJECTIVES, f64::INFINITY));
            continue;
        };
        let first = solver.best().at(0);
        found.push((LOOP_CONTROLS, worst_deviation([first.acceleration, first.steering], control, absolute)));
        let state = trajectory(problem, &BicycleModel::authors_test(), solver.best())[0];
        found.push((LOOP_POSES, worst_deviation([state.x, state.y, state.heading], pose, absolute)));
        found.push((LOOP_OBJECTIVES, worst_deviation([summary.best_objective], &[*objective], relative)));
    }
    found
}

/// The problem before step `step`, whose inputs are the `stored`-th that the file has; `None` where they do not tell all of it.
fn problem(npz: &Npz, route: &Npz, stored: usize, step: usize) -> Result<Option<Problem>, CaseError> {
    let number = |name: &str| -> Result<f64, NpzError> {
        let all = npz.array(name, &[None])?;
        all.get(step).copied().ok_or_else(|| npz.error(name, format!("has no entry {step}")))
    };
    let line = [None, Some(ROWS_STORED), Some(5)];
    let is_red = |tenth: usize| {
        Ok::<_, NpzError>(row::<5>(npz, "every10_ref_line", &line, stored * ROWS_STORED + tenth)?[4] == 0.0)
    };
    let Some(stop_distance) = stop_distance(number("red_first")?, number("red_count")?, is_red(BEHIND / 10)?) else {
        return Ok(None);
    };
    let av = row::<8>(npz, "av_state", &[None, Some(8)], step)?;
    let start = number("route_start")? as usize;
    let (sin, cos) = libm::sincos(av[2]);
    let (mut x, mut y, mut heading) = (Vec::new(), Vec::new(), Vec::new());
    for k in start..start + number("route_rows")? as usize {
        let pose = row::<4>(route, "route", &[None, Some(4)], k)?.map(single);
        let (dx, dy) = (pose[0] - av[0], pose[1] - av[1]);
        x.push(single(cos * dx + sin * dy));
        y.push(single(cos * dy - sin * dx));
        heading.push(single(wrap_angle(pose[2] - av[2])));
    }
    let agents: Vec<[f64; 8]> = (0..=NEIGHBORS)
        .map(|j| row(npz, "every10_current_state", &[None, Some(NEIGHBORS + 1), Some(8)], stored * (NEIGHBORS + 1) + j))
        .collect::<Result<_, _>>()?;
    let mut positions = Vec::with_capacity(NEIGHBORS);
    for j in 0..NEIGHBORS {
        let poses =
            row::<15>(npz, "every10_predictions", &[None, Some(NEIGHBORS), Some(5), Some(3)], stored * NEIGHBORS + j)?;
        positions.push(constant_turn_rate(&agents[j + 1], poses[2]));
    }
    let neighbors: Vec<_> = agents[1..]
        .iter()
        .zip(&positions)
        .map(|(a, positions)| {
            (a[7] != 0.0).then_some(Neighbor { length: a[5], width: a[6], positions, headings: &[], deviations: &[] })
        })
        .collect();
    let own = agents[0];
    let state = VehicleState { x: own[0], y: own[1], heading: own[2], speed: libm::hypot(own[3], own[4]) };
    Ok(Some(Problem::new(&Inputs {
        line_x: &x,
        line_y: &y,
        line_heading: &heading,
        speed_target: number("speed_limit")?,
        speed_targets: None,
        stop_distance,
        av: Vehicle { state, length: own[5], width: own[6] },
        present: None,
        neighbors: &neighbors,
        weights: HAND_TUNED,
    })?))
}

/// How far the AV may drive until the first red row ahead, if there is one; `None` where the file does not say. It tells the
/// first of all red rows and how many there are, but not which, and `own`: whether the AV's row is one.
fn stop_distance(first: f64, count: f64, own: bool) -> Option<Option<f64>> {
    if first < 0.0 || own {
        // The authors ignore what is red at the AV's own row, and with it all that is further ahead.
        return Some(None);
    }
    if first as usize > BEHIND {
        return Some(Some(0.1 * (first as usize - BEHIND) as f64 - STOP_MARGIN));
    }
    // One red row that is behind leaves none ahead; of several, any but the first may be.
    (count <= 1.0).then_some(None)
}

/// Positions at constant speed and turn rate, the heading after a second given.
fn constant_turn_rate(agent: &[f64; 8], heading_after_a_second: f64) -> Vec<(f64, f64)> {
    // The stored heading is a remainder of a turn. Within a second nobody turns by half of one.
    let turn = heading_after_a_second - agent[2];
    let turn_rate = turn - TAU * (turn / TAU).round();
    let speed = libm::hypot(agent[3], agent[4]);
    let (mut x, mut y) = (agent[0], agent[1]);
    (1..=STEPS)
        .map(|k| {
            let (sin, cos) = libm::sincos(agent[2] + DT * turn_rate * k as f64);
            x += DT * speed * cos;
            y += DT * speed * sin;
            (x, y)
        })
        .collect()
}

/// The `index`-th group of `N` numbers of an array.
fn row<const N: usize>(npz: &Npz, name: &str, shape: &[Option<usize>], index: usize) -> Result<[f64; N], NpzError> {
    let all = npz.rows::<N>(name, shape)?;
    all.get(index).copied().ok_or_else(|| npz.error(name, format!("has no row {index}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_red_light_ahead_is_known_or_the_plan_is_left_out() {
        assert_eq!(stop_distance(-1.0, 0.0, false), Some(None));
        assert_eq!(stop_distance(500.0, 4.0, false), Some(Some(27.0)));
        assert_eq!(stop_distance(210.0, 4.0, false), Some(Some(-2.0)));
        // The AV stands on it.
        assert_eq!(stop_distance(200.0, 4.0, true), Some(None));
        assert_eq!(stop_distance(198.0, 4.0, true), Some(None));
        // One behind; or several, of which some may be ahead, say at 27 m.
        assert_eq!(stop_distance(100.0, 1.0, false), Some(None));
        assert_eq!(stop_distance(100.0, 8.0, false), None);
    }
}
