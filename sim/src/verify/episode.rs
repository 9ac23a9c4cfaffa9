//! An episode beside the authors', step by step.

use std::sync::Arc;

use episode::driver::Driver;
use episode::paper::Sight;
use episode::protocol::Protocol;
use episode::{Episode, Outcome};
use vectors::{Quantity, Report, absolute, worst_deviation};
use wire::proto::StepRecord;
use world::authors_frame::{self, single};
use world::geometry::{Point, Pose, angle_difference};
use world::observation::Observation;
use world::scene::{AgentState, Scene};

use super::policy::Policy;
use super::vector::{CURRENT, LINE_COLUMNS, LINE_ROWS, StoredObservation, StoredSight, Vector, Verdict};

const STATES: Quantity = Quantity::within("AV states", 1e-6, "abs");
const NEIGHBORS: Quantity = Quantity::exact("neighbors");
const WINDOW: Quantity = Quantity::exact("window, start and rows");
const LANE: Quantity = Quantity::exact("lane of the limit");
const LIMIT: Quantity = Quantity::within("speed limit", 1e-6, "m/s");
const ROWS: Quantity = Quantity::exact("red and crosswalk rows");
const MARGIN: Quantity = Quantity::within("collision margin", 1e-6, "m");
/// The authors' line has single precision: ours too, but an independent one need not.
const DISTANCE: Quantity = Quantity::within("distance to the line", 2e-3, "m");
const FLAGS: Quantity = Quantity::exact("flags");
/// Half a millimetre is the last digit of single precision at 8 km.
const LINE: Quantity = Quantity::within("line as it is seen", 1e-3, "abs");
const CURRENT_STATE: Quantity = Quantity::within("agents as they are seen", 1e-3, "abs");
const END: Quantity = Quantity::exact("steps and end");
const ERRORS: Quantity = Quantity::within("position errors", 1e-6, "m");
const METRICS: Quantity = Quantity::within("metrics", 1e-6, "abs");

/// A flag may differ where what it is read from is this near to its threshold (m).
const CLOSE_CONTACT: f64 = 1e-6;
const CLOSE_TO_OFF_ROUTE: f64 = 2e-3;
const OFF_ROUTE: f64 = 5.0;

/// Drives the episode of `vector` and compares all that it has.
pub fn compare(scene: &Arc<Scene>, vector: &Vector, policy: &Policy<'_>, place: &str, report: &mut Report) {
    let mut episode = match Episode::new(Arc::clone(scene), &Protocol::Paper) {
        Ok(episode) => episode,
        Err(error) => return report.add(0, END, f64::INFINITY, format_args!("{place}: {error}")),
    };
    let mut driver = policy;
    for step in 0..=vector.end.steps {
        let place = format!("{place} step {step}");
        let mut add = |quantity, deviation| report.add(0, quantity, deviation, &place);
        let observation = episode.observe();
        add(STATES, worst_deviation(numbers(&observation.av), &vector.states[step], absolute));
        let lost = step.checked_sub(1).is_some_and(|before| vector.verdicts[before].route_distance.is_nan());
        if let Some(sight) = episode.paper_sight().filter(|_| !lost) {
            compare_sight(sight, &vector.sights[step], &mut add);
            if let Some(stored) = vector.observations.iter().find(|stored| stored.step == step) {
                compare_observation(scene, &observation, sight, stored, &mut add);
            }
        }
        if step == vector.end.steps || episode.ended().is_some() {
            break;
        }
        // A policy's plan is whole: it comes from a scene's numbers, which are finite, or from the vectors'.
        let Ok(plan) = driver.plan(&observation) else {
            add(STATES, f64::INFINITY);
            return;
        };
        let record = episode.advance(&plan).record;
        compare_verdict(&record, episode.paper_sight(), &vector.verdicts[step], &mut add);
    }
    compare_end(&episode.finish(), scene, vector, &mut |quantity, deviation| report.add(0, quantity, deviation, place));
}

fn compare_sight(sight: &Sight, stored: &StoredSight, add: &mut impl FnMut(Quantity, f64)) {
    add(NEIGHBORS, differences([sight.neighbors == stored.neighbors]));
    let window = &sight.window;
    add(WINDOW, differences([window.start as f64 == stored.window_start, window.samples as f64 == stored.window_rows]));
    add(LANE, differences([sight.lane.map(|lane| lane.0 as f64) == Some(stored.lane)]));
    let info = window.authors_info();
    let limit = info.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    add(LIMIT, (limit - stored.speed_limit).abs());
    let count = |value: f64| info.iter().filter(|entry| **entry == value).count() as f64;
    let first = info.iter().position(|entry| *entry == 0.0).map_or(-1.0, |row| row as f64);
    add(
        ROWS,
        differences([first, count(0.0), count(1.0)].iter().zip(&stored.rows).map(|(ours, theirs)| ours == theirs)),
    );
}

fn compare_verdict(record: &StepRecord, sight: Option<&Sight>, verdict: &Verdict, add: &mut impl FnMut(Quantity, f64)) {
    let collision = record.collision == verdict.collision || verdict.collision_margin.abs() < CLOSE_CONTACT;
    let near = (verdict.route_distance - OFF_ROUTE).abs() < CLOSE_TO_OFF_ROUTE;
    add(FLAGS, differences([collision, record.off_route == verdict.off_route || near]));
    if verdict.route_distance.is_nan() {
        return;
    }
    // Without neighbors there is no margin.
    let margin = sight.and_then(|sight| sight.collision_margin);
    if verdict.collision_margin.is_finite() || margin.is_some() {
        add(MARGIN, (margin.unwrap_or(f64::INFINITY) - verdict.collision_margin).abs());
    }
    add(DISTANCE, (record.route_distance - verdict.route_distance).abs());
}

fn compare_observation(
    scene: &Scene,
    observation: &Observation,
    sight: &Sight,
    stored: &StoredObservation,
    add: &mut impl FnMut(Quantity, f64),
) {
    let ours = seen_line(sight);
    let deviation = |(ours, theirs): (&[f64; LINE_COLUMNS], &[f64; LINE_COLUMNS])| {
        let turn = angle_difference(ours[2], theirs[2]);
        worst_deviation([ours[0], ours[1], theirs[2] + turn, ours[3], ours[4]], theirs, absolute)
    };
    add(LINE, ours.iter().zip(&stored.line).map(deviation).fold(0.0, f64::max));
    let ours = seen_agents(scene, observation, sight);
    let deviation = |(ours, theirs): (&[f64; 8], &[f64; 8])| {
        let mut ours = *ours;
        ours[2] = theirs[2] + angle_difference(ours[2], theirs[2]);
        worst_deviation(ours, theirs, absolute)
    };
    let theirs = stored.current.as_chunks::<8>().0;
    add(CURRENT_STATE, ours.as_chunks::<8>().0.iter().zip(theirs).map(deviation).fold(0.0, f64::max));
}

/// Every tenth row of the line in the log's frame; past its end the last one again.
fn seen_line(sight: &Sight) -> [[f64; LINE_COLUMNS]; LINE_ROWS] {
    let (window, info) = (&sight.window, sight.window.authors_info());
    let line = &window.line;
    std::array::from_fn(|row| {
        let row = (10 * row).min(window.samples.saturating_sub(1));
        let at = window.start + row;
        [single(line.x[at]), single(line.y[at]), single(line.heading[at]), single(line.curvature[at]), info[row]]
    })
}

/// The AV and its neighbors in the AV's frame, zeros where there is none.
fn seen_agents(scene: &Scene, observation: &Observation, sight: &Sight) -> [f64; CURRENT] {
    let mut numbers = [0.0; CURRENT];
    let rows = numbers.as_chunks_mut::<8>().0;
    let av = &observation.av;
    rows[0] = seen_agent(Pose::default(), authors_frame::av_velocity(av, observation.step), av);
    let log_index = observation.log_index as usize;
    let neighbors = sight.neighbors.iter().filter_map(|track| scene.tracks()[*track].states[log_index]);
    for (row, state) in rows[1..].iter_mut().zip(neighbors) {
        let frame = av.pose();
        *row = seen_agent(authors_frame::pose(&state, frame), authors_frame::velocity(&state, frame), &state);
    }
    numbers
}

fn seen_agent(pose: Pose, velocity: Point, state: &AgentState) -> [f64; 8] {
    let [length, width, height] = [state.length, state.width, state.height].map(single);
    [pose.x, pose.y, pose.heading, velocity.x, velocity.y, length, width, height]
}

fn compare_end(outcome: &Outcome, scene: &Scene, vector: &Vector, add: &mut impl FnMut(Quantity, f64)) {
    let end = &outcome.end;
    let reason = vector.end.end_reason.ours().is_none_or(|reason| reason == end.reason());
    add(END, differences([end.steps as usize == vector.end.steps, reason]));
    add(ERRORS, worst_deviation(position_errors(&outcome.records, scene), &vector.position_errors, absolute));
    for (name, theirs) in vector.end.metrics.named() {
        let ours = end.metrics.iter().find(|metric| metric.name == name).and_then(|metric| metric.value);
        add(
            METRICS,
            match (ours, theirs) {
                (Some(ours), Some(theirs)) => (ours - theirs).abs(),
                (None, None) => 0.0,
                _ => f64::INFINITY,
            },
        );
    }
}

/// After each of 100 steps; the last place again where the drive was over.
fn position_errors(records: &[StepRecord], scene: &Scene) -> Vec<f64> {
    let first = records.first().map_or(0, |record| record.log_index as usize);
    let error = |step: usize| -> Option<f64> {
        let av = records.get(step).or(records.last())?.av?;
        let human = scene.av().states.get(first + step).copied().flatten()?;
        Some(human.position().distance(Point::new(av.x, av.y)))
    };
    (0..100).map(|step| error(step).unwrap_or(f64::NAN)).collect()
}

fn numbers(av: &AgentState) -> [f64; 8] {
    [av.x, av.y, av.heading, av.velocity_x, av.velocity_y, av.length, av.width, av.height]
}

fn differences(same: impl IntoIterator<Item = bool>) -> f64 {
    same.into_iter().filter(|same| !same).count() as f64
}
