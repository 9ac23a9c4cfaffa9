//! An observation and a prediction become a problem, in the AV's own frame.

use std::ops::Range;

use gauss_newton::constants::{NEIGHBORS, STOP_MARGIN, TERMS};
use gauss_newton::{InfoColumn, Inputs, Neighbor, Vehicle};
use wire::node::StepInput;
use world::authors_frame;
use world::geometry::{Point, Pose, angle_difference, wrap_angle_single};
use world::observation::{Observation, ObservedAgent};
use world::plan::{Control, PLAN_STEPS, Prediction};
use world::reference_line::{ReferenceWindow, SAMPLES_BEHIND};
use world::scene::TrackId;
use world::vehicle::VehicleState;

use crate::idm::{Corridor, DesiredSpeed};

/// A red light whose stop point is this far behind the AV's front is passed (m): the AV may stand on it.
const PASSED: f64 = 1.0;

/// Samples farther apart than these (20 m) are of two passes, if they are nearer to each other than this (m).
const PASS: usize = 200;
const SAME_PLACE: f64 = 2.5;

/// Samples between those that are looked at for another pass, and those behind the AV that are always kept.
const COARSE: usize = 10;
const KEPT_BEHIND: usize = 50;

/// Whose rules make a problem of what is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rules {
    /// The authors': one wanted speed and the red light from their info column, numbers rounded to f32 where theirs are.
    Paper,
    /// Ours: the wanted speed of the line here, red lights until they are passed.
    Strict,
}

impl Rules {
    /// Those of a protocol.
    #[must_use]
    pub fn of(protocol: &str) -> Self {
        if protocol == "paper" { Self::Paper } else { Self::Strict }
    }

    /// A number as it is stored.
    fn stored(self, value: f64) -> f64 {
        match self {
            Self::Paper => authors_frame::single(value),
            Self::Strict => value,
        }
    }
}

/// Everything of a problem but the weights. Buffers are kept from step to step.
#[derive(Default)]
pub struct Situation {
    /// Under [`Rules::Strict`], with the speed wanted along it.
    corridor: Option<Corridor>,
    desired: DesiredSpeed,
    line_x: Vec<f64>,
    line_y: Vec<f64>,
    line_heading: Vec<f64>,
    speed_target: f64,
    stop_distance: Option<f64>,
    stop_margin: f64,
    av: Vehicle,
    present: Option<Control>,
    neighbors: Vec<Expected>,
}

/// A neighbor and where it is expected.
#[derive(Clone, Debug, Default)]
struct Expected {
    track: Option<TrackId>,
    /// Whether the planner takes it to be there.
    present: bool,
    length: f64,
    width: f64,
    positions: Vec<(f64, f64)>,
}

impl Situation {
    /// Takes in what is seen and what is expected.
    ///
    /// # Errors
    /// Where the line is empty.
    pub fn fill(&mut self, rules: Rules, step: &StepInput<'_>, prediction: &Prediction) -> Result<(), String> {
        let observation = step.observation;
        self.fill_av(rules, observation);
        let samples = samples(&observation.window);
        if samples.is_empty() {
            return Err("the window of the reference line is empty".to_owned());
        }
        match rules {
            Rules::Paper => {
                self.fill_line(rules, observation, samples);
                self.fill_info(&observation.window);
            }
            Rules::Strict => {
                let own = self.fill_road(step)?;
                self.fill_line(rules, observation, single_pass(&observation.window, own));
            }
        }
        self.fill_neighbors(rules, observation, prediction);
        Ok(())
    }

    fn fill_av(&mut self, rules: Rules, observation: &Observation) {
        let av = &observation.av;
        let velocity = match rules {
            Rules::Paper => authors_frame::av_velocity(av, observation.step),
            Rules::Strict => Pose::new(0.0, 0.0, av.heading).to_body(av.velocity()),
        };
        let speed = libm::hypot(velocity.x, velocity.y);
        self.present = (rules == Rules::Strict).then_some(observation.control);
        self.av = Vehicle {
            state: VehicleState { speed, ..VehicleState::default() },
            length: rules.stored(av.length),
            width: rules.stored(av.width),
        };
    }

    /// Takes in these samples of the window's line.
    fn fill_line(&mut self, rules: Rules, observation: &Observation, samples: Range<usize>) {
        let frame = observation.av.pose();
        let forward = Point::unit(frame.heading);
        for column in [&mut self.line_x, &mut self.line_y, &mut self.line_heading] {
            column.clear();
        }
        for k in samples {
            let pose = observation.window.line.pose(k);
            let pose = Pose::new(rules.stored(pose.x), rules.stored(pose.y), rules.stored(pose.heading));
            let offset = pose.position() - frame.position();
            self.line_x.push(rules.stored(forward.dot(offset)));
            self.line_y.push(rules.stored(forward.cross(offset)));
            self.line_heading.push(match rules {
                Rules::Paper => f64::from(wrap_angle_single(pose.heading as f32 - frame.heading as f32)),
                Rules::Strict => angle_difference(frame.heading, pose.heading),
            });
        }
    }

    /// The authors' reading.
    fn fill_info(&mut self, window: &ReferenceWindow) {
        let read = InfoColumn::read(&window.authors_info(), SAMPLES_BEHIND);
        self.speed_target = read.speed_target;
        self.stop_distance = read.stop_distance;
        self.stop_margin = STOP_MARGIN;
    }

    /// Our reading. The answer is the window's sample nearest to the AV.
    fn fill_road(&mut self, step: &StepInput<'_>) -> Result<usize, String> {
        let (line, observation) = (&step.briefing.reference_line, step.observation);
        let corridor = self.corridor.take().filter(|corridor| corridor.is_of(line));
        let corridor = self.corridor.insert(corridor.unwrap_or_else(|| Corridor::new(line)));
        corridor.move_to(&observation.window).ok_or("the window of the reference line has less than two samples")?;
        self.desired.fill(corridor, &observation.window);
        let own = corridor.own(observation.av.position());
        self.speed_target = self.desired.at(own).speed;
        let front = corridor.station(own) + observation.av.length / 2.0;
        let ahead = observation.window.red_stops.iter().map(|red| corridor.station(*red as usize));
        let stop = ahead.filter(|station| *station > front - PASSED).fold(f64::INFINITY, f64::min);
        // The authors' margin is from the AV's center: half of a long vehicle is more.
        self.stop_margin = STOP_MARGIN.max(observation.av.length / 2.0 + 0.5);
        self.stop_distance = stop.is_finite().then(|| stop - corridor.station(own) - self.stop_margin);
        Ok(own)
    }

    /// The nearest neighbors, each where it is expected; one that is not predicted keeps its velocity.
    fn fill_neighbors(&mut self, rules: Rules, observation: &Observation, prediction: &Prediction) {
        let frame = observation.av.pose();
        let forward = Point::unit(frame.heading);
        let distance = |agent: &ObservedAgent| agent.state.position().distance_squared(frame.position());
        let mut agents: Vec<&ObservedAgent> = observation.agents.iter().collect();
        // Stable: of equally near ones the first in the log.
        agents.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        agents.truncate(NEIGHBORS);
        let trajectories = prediction.most_likely().map_or(&[][..], |future| &future.trajectories);
        self.neighbors.truncate(agents.len());
        self.neighbors.resize_with(agents.len(), Default::default);
        for (agent, neighbor) in agents.iter().zip(&mut self.neighbors) {
            neighbor.track = Some(agent.track);
            // To the authors what has no height is nobody, though it keeps its place among the nearest.
            neighbor.present = rules == Rules::Strict || rules.stored(agent.state.height) != 0.0;
            neighbor.length = rules.stored(agent.state.length);
            neighbor.width = rules.stored(agent.state.width);
            let expected = trajectories.iter().find(|t| t.track == agent.track);
            let positions = &mut neighbor.positions;
            positions.clear();
            let own = |place: Point| {
                let offset = place - frame.position();
                (forward.dot(offset), forward.cross(offset))
            };
            match expected {
                Some(expected) => positions.extend(expected.poses.iter().map(|pose| own(pose.position()))),
                None => positions.extend((1..=PLAN_STEPS).map(|k| {
                    let seconds = 0.1 * k as f64;
                    let velocity = Point::new(agent.state.velocity_x, agent.state.velocity_y);
                    own(agent.state.position() + velocity * seconds)
                })),
            }
        }
    }

    /// The AV's speed (m/s).
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.av.state.speed
    }

    /// How far before a red light the AV's center is to stop (m).
    #[must_use]
    pub fn stop_margin(&self) -> f64 {
        self.stop_margin
    }

    /// Which track a neighbor of the problem is.
    #[must_use]
    pub fn track(&self, neighbor: usize) -> Option<TrackId> {
        self.neighbors.get(neighbor)?.track
    }

    /// Calls `with` with the inputs of this situation under these weights.
    pub fn with_inputs<T>(&self, weights: [f64; TERMS], with: impl FnOnce(&Inputs<'_>) -> T) -> T {
        let mut neighbors = [None; NEIGHBORS];
        for (place, n) in neighbors.iter_mut().zip(&self.neighbors) {
            *place = n.present.then_some(Neighbor {
                length: n.length,
                width: n.width,
                positions: &n.positions,
                headings: &[],
                deviations: &[],
            });
        }
        with(&Inputs {
            line_x: &self.line_x,
            line_y: &self.line_y,
            line_heading: &self.line_heading,
            speed_target: self.speed_target,
            speed_targets: None,
            stop_distance: self.stop_distance,
            av: self.av,
            present: self.present,
            neighbors: &neighbors,
            weights,
        })
    }
}

/// The window's samples in its line.
fn samples(window: &ReferenceWindow) -> Range<usize> {
    window.start..(window.start + window.samples).min(window.line.len())
}

/// The window's samples in its line that do not pass by the same place again: the search goes by the nearest sample, and must not
/// take the next round for this one. The AV is nearest to the window's sample `own`.
fn single_pass(window: &ReferenceWindow, own: usize) -> Range<usize> {
    let all = samples(window);
    let own = window.start + own;
    let meets =
        |a: usize, b: usize| window.line.point(a).distance_squared(window.line.point(b)) < SAME_PLACE * SAME_PLACE;
    let coarse = |range: Range<usize>| range.step_by(COARSE);
    // What lies ahead comes first: of two passes the one behind goes, then the second one ahead.
    let behind = own.saturating_sub(KEPT_BEHIND).max(all.start);
    let comes_by = |a: usize| coarse(own..all.end).any(|b| b - a > PASS && meets(a, b));
    let start = if coarse(all.start..behind).any(comes_by) { behind } else { all.start };
    let again = |b: &usize| coarse(behind..b.saturating_sub(PASS)).any(|a| meets(a, *b));
    start..coarse(own..all.end).find(again).unwrap_or(all.end)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use world::reference_line::{ReferenceLine, WINDOW_SAMPLES};
    use world::scene::AgentState;

    use super::*;

    /// A line 0.1 m a sample, and what an AV on its sample `at` sees of it.
    fn on(line: impl Fn(f64) -> (f64, f64), samples: usize, at: usize) -> Observation {
        let points: Vec<(f64, f64)> = (0..samples).map(|k| line(0.1 * k as f64)).collect();
        let (x, y) = points[at];
        let line = Arc::new(ReferenceLine {
            x: points.iter().map(|(x, _)| *x).collect(),
            y: points.iter().map(|(_, y)| *y).collect(),
            z: vec![0.0; samples],
            heading: vec![0.0; samples],
            curvature: vec![0.0; samples],
            speed_limit: vec![12.0; samples],
            crosswalk: vec![false; samples],
        });
        let start = at.saturating_sub(SAMPLES_BEHIND);
        let window = ReferenceWindow {
            samples: WINDOW_SAMPLES.min(samples - start),
            line,
            start,
            first_sample: start,
            red_stops: vec![],
            speed_limit: None,
        };
        let av = AgentState { x, y, length: 5.0, width: 2.0, height: 1.5, ..AgentState::default() };
        Observation { step: 0, log_index: 19, av, control: Control::default(), agents: vec![], signals: vec![], window }
    }

    /// [`single_pass`] of what is seen there.
    fn told(seen: &Observation) -> Range<usize> {
        let mut corridor = Corridor::new(&seen.window.line);
        corridor.move_to(&seen.window).unwrap();
        single_pass(&seen.window, corridor.own(seen.av.position()))
    }

    fn circle(station: f64) -> (f64, f64) {
        (12.0 * libm::sin(station / 12.0), -12.0 * libm::cos(station / 12.0))
    }

    #[test]
    fn a_line_that_passes_no_place_twice_is_told_whole() {
        let seen = on(|station| (station, 0.0), 2000, 500);
        assert_eq!(told(&seen), 300..1500);
    }

    #[test]
    fn of_a_line_that_goes_round_and_round_less_than_a_round_is_told() {
        for at in [100, 400, 700, 1100] {
            let seen = on(circle, 2500, at);
            let told = told(&seen);
            let line = &seen.window.line;
            // 5 m behind the AV stay, and nearly a round (75 m) ahead.
            assert!(told.contains(&at) && told.start + KEPT_BEHIND <= at && told.end >= at + 600, "{told:?} from {at}");
            let meets = |a: usize, b: usize| line.point(a).distance(line.point(b)) < SAME_PLACE;
            let pairs = told.clone().flat_map(|a| (a + PASS + 1..told.end).map(move |b| (a, b)));
            // To within the samples between those that are looked at.
            let twice = pairs.filter(|(a, b)| meets(*a, *b)).count();
            assert!(twice <= COARSE * COARSE, "{twice} pairs of {told:?}");
        }
    }

    #[test]
    fn of_a_crossing_behind_and_ahead_the_way_ahead_is_told() {
        // 30 m on, a loop to the left, and across the way again.
        let eight = |station: f64| match station {
            s if s < 40.0 => (s, 0.0),
            s if s < 40.0 + 18.0 * std::f64::consts::PI => {
                let angle = (s - 40.0) / 12.0;
                (40.0 + 12.0 * libm::sin(angle), 12.0 - 12.0 * libm::cos(angle))
            }
            s => (28.0, 12.0 - (s - 40.0 - 18.0 * std::f64::consts::PI)),
        };
        // The crossing at (28, 0) is 17 m behind the AV and 63.5 m ahead.
        let seen = on(eight, 1600, 450);
        let told = told(&seen);
        assert!(told.start > 290 && told.contains(&450) && told.end == 1450, "{told:?}");
    }
}
