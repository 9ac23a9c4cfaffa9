//! The plans of the authors' closed loop: every tenth step of an episode, from the inputs that were stored with it.
//!
//! The reference line comes from the episode's route, rounded to f32 where the authors store it; the predictions from the
//! neighbors' states and the turn rate that the stored poses tell.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use vectors::{Npz, NpzError, absolute, relative, worst_deviation};
use world::authors_frame::single;
use world::geometry::wrap_angle;
use world::vehicle::{BicycleModel, VehicleState};

use super::case::CaseError;
use super::quantities::{Deviations, LOOP_CONTROLS, LOOP_OBJECTIVES, LOOP_POSES};
use crate::gauss_newton::constants::{DT, HAND_TUNED, NEIGHBORS, STEPS, STOP_MARGIN};
use crate::gauss_newton::{Controls, Inputs, LinearSolver, Neighbor, Problem, Settings, Solver, Vehicle, trajectory};

/// Rows of the reference line that lie behind the AV.
const BEHIND: usize = 200;

/// The route file beside an episode's, if this is an episode of the planner.
pub(super) fn route_of(episode: &Path) -> Option<PathBuf> {
    let scene = episode.file_name()?.to_str()?.strip_suffix("__planner.npz")?;
    Some(episode.with_file_name(format!("{scene}__route.npz")))
}

/// The deviations of one episode.
pub(super) fn deviations(npz: &Npz, route: &Npz, linear: LinearSolver) -> Result<Deviations, CaseError> {
    let steps = npz.array("every10_step", &[None])?;
    let objectives = npz.array("plan_objective", &[None])?;
    let controls = npz.array("control_first", &[Some(objectives.len()), Some(2)])?;
    let poses = npz.array("plan_first", &[Some(objectives.len()), Some(3)])?;
    let mut solver = Solver::new(linear);
    let mut found = Vec::new();
    for (stored, step) in steps.iter().enumerate() {
        let step = *step as usize;
        // The observation after the last step has no plan.
        let Some(objective) = objectives.get(step) else { continue };
        let problem = problem(npz, route, stored, step)?;
        let Ok(summary) = solver.solve(&problem, &Settings::paper_test(), &Controls::ZERO) else {
            found.push((LOOP_OBJECTIVES, f64::INFINITY));
            continue;
        };
        let first = solver.best().at(0);
        let first = [first.acceleration, first.steering];
        found.push((LOOP_CONTROLS, worst_deviation(first, &controls[2 * step..][..2], absolute)));
        let pose = trajectory(&problem, &BicycleModel::authors_test(), solver.best())[0];
        found.push((LOOP_POSES, worst_deviation([pose.x, pose.y, pose.heading], &poses[3 * step..][..3], absolute)));
        found.push((LOOP_OBJECTIVES, worst_deviation([summary.best_objective], &[*objective], relative)));
    }
    Ok(found)
}

/// The problem before step `step`, whose inputs are the `stored`-th that the file has.
fn problem(npz: &Npz, route: &Npz, stored: usize, step: usize) -> Result<Problem, CaseError> {
    let number = |name: &str| -> Result<f64, NpzError> {
        let all = npz.array(name, &[None])?;
        all.get(step).copied().ok_or_else(|| npz.error(name, format!("has no entry {step}")))
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
        .map(|(a, positions)| (a[7] != 0.0).then_some(Neighbor { length: a[5], width: a[6], positions }))
        .collect();
    let own = agents[0];
    let state = VehicleState { x: own[0], y: own[1], heading: own[2], speed: libm::hypot(own[3], own[4]) };
    Ok(Problem::new(&Inputs {
        line_x: &x,
        line_y: &y,
        line_heading: &heading,
        speed_target: number("speed_limit")?,
        stop_distance: stop_distance(number("red_first")?, number("red_count")?),
        av: Vehicle { state, length: own[5], width: own[6] },
        present: None,
        neighbors: &neighbors,
        weights: HAND_TUNED,
    })?)
}

/// The stop before the first red row ahead, of rows that follow each other.
fn stop_distance(first: f64, count: f64) -> Option<f64> {
    if first < 0.0 {
        return None;
    }
    let ahead = (first as usize..(first + count) as usize).find(|row| *row >= BEHIND)?;
    (ahead != BEHIND).then(|| 0.1 * (ahead - BEHIND) as f64 - STOP_MARGIN)
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
