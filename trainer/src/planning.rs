//! The planner while it is learned through: what it is asked, of whom it is told, with which weights.

use gauss_newton::constants::{HAND_TUNED, TERMS};
use gauss_newton::{Controls, InfoColumn, Inputs, LayerSettings, Neighbor, Problem, ProblemError, Vehicle};
use network::constants::{COST_WEIGHTS, HISTORY, NEIGHBORS, STEPS};
use world::geometry::{Point, wrap_angle};
use world::plan::STEP_SECONDS;
use world::vehicle::VehicleState;

use crate::cost;
use crate::loss::Said;
use crate::settings::{CostKind, Cut, InitialControls, Predictor, Settings};
use crate::windows::Window;

/// The AV's sample of the reference line.
const OWN_SAMPLE: usize = 200;

/// How is planned while learning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planning {
    /// Iterations.
    pub iterations: usize,
    /// Share of each step that is taken.
    pub step: f64,
    /// How the cost's weights come out of the network; tuned by hand if they do not.
    pub cost: Option<CostKind>,
    /// Where it starts.
    pub start: InitialControls,
    /// Whose predictions it is given.
    pub predictor: Predictor,
    /// What is cut off.
    pub cut: Cut,
}

impl Planning {
    /// By these settings.
    #[must_use]
    pub fn of(settings: &Settings) -> Self {
        Self {
            iterations: settings.planner.iterations,
            step: settings.planner.step,
            cost: settings.variant().has_cost().then_some(settings.cost.kind),
            start: settings.initial_controls,
            predictor: settings.predictor,
            cut: settings.cut,
        }
    }

    pub(crate) fn layer(&self) -> LayerSettings {
        LayerSettings { iterations: self.iterations, step: self.step, ..LayerSettings::paper() }
    }

    /// What is to be solved, and from where.
    pub(crate) fn problem(
        &self,
        window: &Window,
        said: &Said,
        future: usize,
    ) -> Result<(Problem, Controls), ProblemError> {
        let weights = self.weights(said.cost.as_ref());
        let others = match self.predictor {
            Predictor::Network => said.poses.get(future).map(|poses| poses.map(|poses| poses.map(|[x, y, _]| (x, y)))),
            Predictor::Ctrv => Some(ctrv(window)),
            Predictor::Oracle => Some(oracle(window)),
        };
        let start = match self.start {
            InitialControls::Network => said.plans[future].clone(),
            InitialControls::Zero => Controls::ZERO,
        };
        Ok((problem(window, others.as_ref(), weights)?, start))
    }

    /// The weights that are planned with.
    fn weights(&self, outputs: Option<&[f64; COST_WEIGHTS]>) -> [f64; TERMS] {
        match (self.cost, outputs) {
            (Some(kind), Some(outputs)) => cost::of_outputs(outputs, kind),
            _ => HAND_TUNED,
        }
    }
}

/// The AV now.
pub(crate) fn now(window: &Window) -> VehicleState {
    let [x, y, heading, vx, vy, ..] = window.sketch.ego[HISTORY - 1].map(f64::from);
    VehicleState { x, y, heading, speed: Point::new(vx, vy).norm() }
}

/// Where each neighbour is at each step (m).
type Positions = [[(f64, f64); STEPS]; NEIGHBORS];

/// Neighbours go on at the turn rate of their last two states and at their speed, as the predictor `ctrv` has it.
fn ctrv(window: &Window) -> Positions {
    let mut all = [[(0.0, 0.0); STEPS]; NEIGHBORS];
    for (positions, history) in all.iter_mut().zip(&window.sketch.neighbors) {
        let [mut x, mut y, mut heading, vx, vy, ..] = history[HISTORY - 1].map(f64::from);
        let before = f64::from(history[HISTORY - 2][2]);
        let turn = (wrap_angle(heading - before) / STEP_SECONDS).clamp(-0.5, 0.5) * STEP_SECONDS;
        for position in positions {
            heading += turn;
            x += STEP_SECONDS * Point::new(vx, vy).norm() * libm::cos(heading);
            y += STEP_SECONDS * Point::new(vx, vy).norm() * libm::sin(heading);
            *position = (x, y);
        }
    }
    all
}

/// Neighbours do what they did; one that is out of sight stays where it was seen last.
fn oracle(window: &Window) -> Positions {
    let mut all = [[(0.0, 0.0); STEPS]; NEIGHBORS];
    for (neighbor, positions) in all.iter_mut().enumerate() {
        let [x, y, ..] = window.sketch.neighbors[neighbor][HISTORY - 1].map(f64::from);
        let mut last = (x, y);
        for (t, position) in positions.iter_mut().enumerate() {
            if window.seen[neighbor + 1][t] {
                let [x, y, ..] = window.future[neighbor + 1][t].map(f64::from);
                last = (x, y);
            }
            *position = last;
        }
    }
    all
}

fn problem(window: &Window, others: Option<&Positions>, weights: [f64; TERMS]) -> Result<Problem, ProblemError> {
    let column = |column: usize| window.line.iter().map(|sample| f64::from(sample[column])).collect::<Vec<f64>>();
    let info = InfoColumn::read(&column(4), OWN_SAMPLE);
    let ego = window.sketch.ego[HISTORY - 1].map(f64::from);
    let neighbors: Vec<Option<Neighbor<'_>>> = others
        .into_iter()
        .flatten()
        .enumerate()
        .map(|(number, positions)| {
            let now = &window.sketch.neighbors[number][HISTORY - 1];
            let (length, width) = (f64::from(now[5]), f64::from(now[6]));
            window.sketch.presence.agents[number + 1].then_some(Neighbor {
                length,
                width,
                positions,
                headings: &[],
                deviations: &[],
            })
        })
        .collect();
    Problem::new(&Inputs {
        line_x: &column(0),
        line_y: &column(1),
        line_heading: &column(2),
        speed_target: info.speed_target,
        speed_targets: None,
        stop_distance: info.stop_distance,
        av: Vehicle { state: now(window), length: ego[5], width: ego[6] },
        present: None,
        neighbors: &neighbors,
        weights,
    })
}
