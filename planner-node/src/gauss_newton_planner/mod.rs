//! The planner `gauss-newton`: [`crate::gauss_newton`] on the bus.
//!
//! | file | what |
//! | --- | --- |
//! | `situation.rs` | observation and prediction become a problem |
//! | `weights.rs` | where the weights of the cost terms come from |
//!
//! Under `paper` it is the authors' planner, quirks and all: their objective, their stopping rule, a new start at every step, and
//! the poses of their test model as plan. Under any other protocol it is ours: the objective of the vehicle that is driven, from
//! what it does now on and in a lane with an edge, a polished search, and the last plan as a second start, of which the better one is
//! kept.

mod situation;
mod weights;

use gauss_newton::constants::Term;
use gauss_newton::{Controls, Evaluation, LinearSolver, Problem, Settings, Solver, Summary};
use wire::node::{Planner, PlannerFactory, StepInput};
use world::observation::Briefing;
use world::plan::{Control, Diagnostics, PLAN_STEPS, PlanState, STEP_SECONDS, UncheckedPlan};
use world::vehicle::{BicycleModel, Limits, VehicleState};

use crate::idm::IdmDrive;
pub use situation::{Rules, Situation};
pub use weights::{Weights, WeightsError};

/// Where the search starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Init {
    /// Straight on at the present speed
    #[default]
    Zero,
    /// Along the line, by the intelligent driver model
    Idm,
    /// Where the prediction says
    Network,
}

/// What can be chosen.
#[derive(Clone, Debug, Default, PartialEq, clap::Args)]
#[group(id = "gauss_newton")]
#[command(next_help_heading = "Options of gauss-newton")]
pub struct Options {
    /// Weights of the cost terms: hand-tuned, learned (they come with the prediction), or a TOML file
    #[arg(long, value_name = "WEIGHTS", default_value = "hand-tuned")]
    pub weights: Weights,
    /// Where the search starts
    #[arg(long, value_enum, default_value_t = Init::Zero)]
    pub init: Init,
}

/// The planner `gauss-newton`.
pub struct GaussNewton(pub Options);

impl PlannerFactory for GaussNewton {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Planner>, String> {
        Ok(Box::new(Drive::new(self.0.clone(), briefing)))
    }

    fn needs_prediction(&self) -> bool {
        true
    }
}

/// The planner in one episode.
struct Drive {
    options: Options,
    rules: Rules,
    settings: Settings,
    situation: Situation,
    problem: Option<Problem>,
    solver: Solver,
    /// The best controls of this step, then those of the step before.
    best: Controls,
    planned: bool,
    at: Evaluation,
    /// For [`Init::Idm`].
    idm: Option<IdmDrive>,
}

impl Drive {
    fn new(options: Options, briefing: &Briefing) -> Self {
        let rules = Rules::of(&briefing.protocol);
        Self {
            options,
            rules,
            settings: rules.settings(briefing),
            situation: Situation::default(),
            problem: None,
            solver: Solver::new(LinearSolver::Sweep),
            best: Controls::ZERO,
            planned: false,
            at: Evaluation::default(),
            idm: None,
        }
    }

    fn initial(&mut self, step: &StepInput<'_>) -> Result<Controls, String> {
        let controls = |controls: &[Control]| {
            let pairs = controls.iter().map(|c| (c.acceleration, c.steering));
            Controls::from_pairs(pairs)
                .ok_or_else(|| format!("{} initial controls, but {PLAN_STEPS} are needed", controls.len()))
        };
        match self.options.init {
            Init::Zero => Ok(Controls::ZERO),
            Init::Idm => {
                let idm = self.idm.get_or_insert_with(|| IdmDrive::new(step.briefing));
                controls(&idm.plan(step)?.controls)
            }
            Init::Network => {
                let from = step.prediction.and_then(|prediction| prediction.initial_controls());
                controls(from.ok_or("the prediction has no initial controls; --init zero or idm needs none")?)
            }
        }
    }

    /// The problem of this step in `self.problem`.
    fn pose_problem(&mut self, step: &StepInput<'_>) -> Result<(), String> {
        let prediction = step.prediction.ok_or("there is no prediction")?;
        let weights = self.options.weights.of(prediction)?;
        self.situation.fill(self.rules, step, prediction)?;
        let problem = &mut self.problem;
        self.situation.with_inputs(weights, |inputs| match problem {
            Some(problem) => problem.set(inputs).map_err(|e| e.to_string()),
            None => Problem::new(inputs).map(|new| *problem = Some(new)).map_err(|e| e.to_string()),
        })
    }
}

impl Planner for Drive {
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        self.pose_problem(step)?;
        let initial = self.initial(step)?;
        let problem = self.problem.as_ref().ok_or("there is no problem")?;
        let mut summary = self.solver.solve(problem, &self.settings, &initial).map_err(|e| e.to_string())?;
        if self.rules == Rules::Strict && self.planned {
            let from_last = one_step_on(&self.best);
            self.best.clone_from(self.solver.best());
            // A start that leads nowhere takes nothing from what the first one found.
            if let Ok(again) = self.solver.solve(problem, &self.settings, &from_last) {
                summary.iterations += again.iterations;
                if again.best_objective < summary.best_objective {
                    summary = Summary { iterations: summary.iterations, ..again };
                    self.best.clone_from(self.solver.best());
                }
            }
        } else {
            self.best.clone_from(self.solver.best());
        }
        self.planned = true;
        self.at.evaluate(problem, &self.settings.costing, &self.best);
        let objective = Term::ALL.iter().map(|term| (term.name().to_owned(), self.at.terms[*term as usize])).collect();
        let diagnostics = Diagnostics {
            objective,
            iterations: u32::try_from(summary.iterations).unwrap_or(u32::MAX),
            status: summary.status.name().to_owned(),
        };
        let (states, controls) = self.rules.output(step, self.situation.speed(), &self.best);
        Ok(UncheckedPlan { step: step.observation.step, states, controls, diagnostics })
    }
}

/// A plan a step later: without its first control, the last one twice.
#[must_use]
pub fn one_step_on(controls: &Controls) -> Controls {
    let mut later = controls.clone();
    later.acceleration.rotate_left(1);
    later.steering.rotate_left(1);
    later.acceleration[PLAN_STEPS - 1] = controls.acceleration[PLAN_STEPS - 1];
    later.steering[PLAN_STEPS - 1] = controls.steering[PLAN_STEPS - 1];
    later
}

impl Rules {
    /// How a search goes under them.
    #[must_use]
    pub fn settings(self, briefing: &Briefing) -> Settings {
        match self {
            Self::Paper => Settings::paper_test(),
            Self::Strict => Settings::strict(BicycleModel::new(briefing.wheelbase)),
        }
    }

    /// The plan of these controls: under `paper` the poses of the authors' test model, from the speed (m/s) that was planned
    /// with, else what the vehicle can follow.
    pub(crate) fn output(self, step: &StepInput<'_>, speed: f64, best: &Controls) -> (Vec<PlanState>, Vec<Control>) {
        let av = &step.observation.av;
        let mut wheel = step.observation.control.steering;
        let (model, speed) = match self {
            Self::Paper => (BicycleModel::authors_test(), speed),
            Self::Strict => (BicycleModel::new(step.briefing.wheelbase), av.speed()),
        };
        let mut rollout = model.roll_out(VehicleState { x: av.x, y: av.y, heading: av.heading, speed });
        let drive = |t: usize| {
            let control = match self {
                Self::Paper => best.at(t),
                Self::Strict => Limits::STRICT.apply(best.at(t), wheel, STEP_SECONDS),
            };
            wheel = control.steering;
            let state = rollout.step(control, STEP_SECONDS);
            (PlanState { x: state.x, y: state.y, heading: state.heading, speed: state.speed.max(0.0) }, control)
        };
        (0..PLAN_STEPS).map(drive).unzip()
    }
}

#[cfg(test)]
pub(crate) mod tests;
