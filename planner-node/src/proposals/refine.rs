//! A proposal improved by Gauss-Newton: the same way and speed, with clear distance between boxes, over a tree of the predicted futures.

use gauss_newton::constants::{HAND_TUNED, NEIGHBORS, TERMS, Term};
use gauss_newton::{Branch, Controls, Inputs, LinearSolver, Neighbor, Problem, Settings, Tree, TreeSolver, Vehicle};
use wire::node::StepInput;
use world::geometry::{Point, angle_difference};
use world::observation::Briefing;
use world::plan::{Control, PLAN_STEPS};
use world::vehicle::{BicycleModel, VehicleState};

use super::TRUNK;
use super::company::{FUTURES, LOOK_STEPS, Other};
use super::rollout::{Road, Rollout};

/// Steps of the search, each downhill.
const STEPS: usize = 8;

/// The weights tuned by hand, with more for what is felt in the car: jerk and the turning of the wheels.
const WEIGHTS: [f64; TERMS] = {
    let mut weights = HAND_TUNED;
    weights[Term::Jerk as usize] = 0.3;
    weights[Term::SteeringChange as usize] = 2.0;
    weights
};

/// Samples of the line behind the AV, and ahead (0.1 m).
const BEHIND: usize = 100;
const AHEAD: usize = 900;

/// A red light stops the AV's front this far before it (m).
const BEFORE_RED: f64 = 0.5;

/// Refines proposals. What it needs is kept from step to step.
pub(super) struct Refinery {
    settings: Settings,
    solver: TreeSolver,
    problems: [Option<Problem>; FUTURES],
    line: [Vec<f64>; 3],
    expected: Vec<Seen>,
    /// Places of the nearest, the nearest first.
    nearest: Vec<usize>,
}

/// A neighbor in the AV's frame.
#[derive(Clone, Debug, Default)]
struct Seen {
    length: f64,
    width: f64,
    positions: Vec<(f64, f64)>,
    headings: Vec<f64>,
}

impl Refinery {
    pub fn new(briefing: &Briefing) -> Self {
        Self {
            settings: Settings::contingency(BicycleModel::new(briefing.wheelbase)).refining(STEPS),
            solver: TreeSolver::new(LinearSolver::Sweep),
            problems: [const { None }; FUTURES],
            line: [const { Vec::new() }; 3],
            expected: vec![Seen::default(); NEIGHBORS],
            nearest: Vec::new(),
        }
    }

    /// The controls of the likeliest branch; none where there is no better plan.
    pub fn refine(
        &mut self,
        step: &StepInput<'_>,
        road: &Road<'_>,
        from: &Rollout,
        branches: bool,
    ) -> Option<impl Iterator<Item = Control> + use<>> {
        let company = road.company;
        let probabilities = company.probabilities();
        self.fill_line(road, from.places[PLAN_STEPS].lateral);
        for future in 0..probabilities.len() {
            self.pose(step, road, from, future)?;
        }
        let mut tree = [Branch { problem: self.problems[0].as_ref()?, probability: 1.0 }; FUTURES];
        let mut count = 0;
        for (problem, probability) in self.problems.iter().zip(probabilities).filter(|(_, p)| **p > 0.0) {
            tree[count] = Branch { problem: problem.as_ref()?, probability: *probability };
            count += 1;
        }
        let tree = Tree { trunk: if branches { TRUNK } else { PLAN_STEPS }, branches: &tree[..count] };
        let begin = Controls::from_pairs(from.controls.iter().map(|c| (c.acceleration, c.steering)))?;
        self.solver.solve(&tree, &self.settings, &[begin]).ok()?;
        let best = self.solver.best().branches().first()?.clone();
        Some((0..PLAN_STEPS).map(move |k| best.at(k)))
    }

    /// The line to be followed, in the AV's frame: the road's, as far aside as the proposal comes.
    fn fill_line(&mut self, road: &Road<'_>, aside: f64) {
        let frame = road.av.pose();
        let forward = Point::unit(frame.heading);
        let [x, y, heading] = &mut self.line;
        x.clear();
        y.clear();
        heading.clear();
        for k in road.own.saturating_sub(BEHIND)..(road.own + AHEAD).min(road.corridor.len()) {
            let along = road.corridor.direction(k);
            let place = road.corridor.point(k) + Point::new(-along.y, along.x) * aside - frame.position();
            x.push(forward.dot(place));
            y.push(forward.cross(place));
            heading.push(angle_difference(frame.heading, road.corridor.heading(k)));
        }
    }

    /// The problem of a future in its place.
    fn pose(&mut self, step: &StepInput<'_>, road: &Road<'_>, from: &Rollout, future: usize) -> Option<()> {
        let frame = road.av.pose();
        let forward = Point::unit(frame.heading);
        let distance =
            |other: &Other| road.company.places(other, future)[0].outline.center.distance_squared(frame.position());
        let all = road.company.others();
        self.nearest.clear();
        self.nearest.extend(0..all.len());
        let order = |a: &usize, b: &usize| distance(&all[*a]).total_cmp(&distance(&all[*b])).then(a.cmp(b));
        self.nearest.sort_unstable_by(order);
        self.nearest.truncate(NEIGHBORS);
        let others = self.nearest.iter().map(|other| &all[*other]);
        let count = others.len();
        for (seen, other) in self.expected.iter_mut().zip(others) {
            let places = road.company.places(other, future);
            seen.length = 2.0 * places[0].outline.half_length;
            seen.width = 2.0 * places[0].outline.half_width;
            seen.positions.clear();
            seen.headings.clear();
            for k in 1..=PLAN_STEPS {
                // Between two looks in the middle of both.
                let (a, b) = (&places[k / LOOK_STEPS].outline, &places[k.div_ceil(LOOK_STEPS)].outline);
                let center = a.center + (b.center - a.center) * 0.5 - frame.position();
                seen.positions.push((forward.dot(center), forward.cross(center)));
                seen.headings.push(libm::atan2(forward.cross(b.forward), forward.dot(b.forward)));
            }
        }
        let neighbors: [Option<Neighbor<'_>>; NEIGHBORS] = std::array::from_fn(|i| {
            let seen = self.expected.get(i).filter(|_| i < count)?;
            let Seen { length, width, positions, headings } = seen;
            Some(Neighbor { length: *length, width: *width, positions, headings, deviations: &[] })
        });
        let speeds: [f64; PLAN_STEPS] = std::array::from_fn(|k| from.states[k + 1].speed);
        let front = from.places[0].station + 0.5 * road.av.length;
        let stop = road.stops.iter().filter(|stop| **stop > front).fold(f64::INFINITY, |a, b| a.min(*b));
        let inputs = Inputs {
            line_x: &self.line[0],
            line_y: &self.line[1],
            line_heading: &self.line[2],
            speed_target: speeds[0],
            speed_targets: Some(&speeds),
            stop_distance: stop.is_finite().then_some(stop - front - BEFORE_RED),
            av: Vehicle {
                state: VehicleState { speed: road.av.speed(), ..VehicleState::default() },
                length: road.av.length,
                width: road.av.width,
            },
            present: Some(step.observation.control),
            neighbors: &neighbors,
            weights: WEIGHTS,
        };
        match &mut self.problems[future] {
            Some(problem) => problem.set(&inputs).ok(),
            empty => Problem::new(&inputs).ok().map(|problem| *empty = Some(problem)),
        }
    }
}
