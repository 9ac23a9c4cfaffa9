//! Network, planner and losses as the loop asks for them.

use gauss_newton::constants::TERMS;

use crate::batch::{self, BatchError, Work};
use crate::cost;
use crate::loss::LossError;
use crate::model::Layout;
use crate::parameters::tensors;
use crate::planning::Planning;
use crate::settings::{Mode, Rules, Settings};
use crate::start::{StartError, first_cost};
use crate::step::{Answer, Ask, Learner, StepError, Terms};
use crate::tape::Spares;
use crate::windows::Window;

/// What reckons on this machine's cores.
#[derive(Debug)]
pub struct Reckoner {
    settings: Settings,
    layout: Layout,
    /// The cost's weights at the beginning, for the penalty on how far they are from it.
    start: Option<[f64; TERMS]>,
    spares: Spares<f32>,
}

impl Reckoner {
    /// By these settings.
    ///
    /// # Errors
    /// [`StartError`] where the cost is held near that of a file that cannot be read.
    pub fn new(settings: &Settings) -> Result<Self, StartError> {
        let start = if settings.cost.prior > 0.0 { first_cost(settings)? } else { None };
        Ok(Self {
            settings: settings.clone(),
            layout: Layout::new(settings.variant()),
            start,
            spares: Spares::default(),
        })
    }
}

impl Learner for Reckoner {
    fn take_back(&mut self, gradient: Vec<f32>) {
        let mut spare = self.spares.take();
        spare.keep(gradient);
        self.spares.bring(spare);
    }

    fn step(&mut self, ask: &Ask<'_>) -> Result<Answer, StepError> {
        let settings = &self.settings;
        let work = Work {
            rules: settings.rules,
            weights: settings.loss,
            planning: ask.planning.then(|| Planning::of(settings)),
            keeps_predictor_loss: settings.keep_predictor_loss || !ask.planning,
            couples: settings.rules == Rules::Authors,
            prior: self.start.filter(|_| ask.planning).map(|start| (settings.cost.prior, start)),
            dropout: ask.dropout.map(|seed| (seed, settings.dropout)),
            wants_gradient: ask.wants_gradient,
            wants_looks: ask.wants_looks,
        };
        let windows: Vec<&Window> = ask.windows.iter().collect();
        let done = batch::run(&self.layout, ask.parameters.values(), &windows, &work, &self.spares)?;
        let weights = &settings.loss;
        let parts = &done.parts;
        let predicted = parts.predicted.max(1.0);
        let cost_weights = ask.planning.then(|| cost::weights(ask.parameters, settings.cost.kind)).flatten();
        let has_gradient = |name: &str| ask.planning || settings.mode != Mode::Dipp || !name.starts_with("plan.cost.");
        Ok(Answer {
            has_gradient: if ask.wants_gradient {
                tensors(settings.variant()).map(|(name, ..)| has_gradient(&name)).collect()
            } else {
                Vec::new()
            },
            gradient: done.gradient,
            looks: done.looks,
            terms: Terms {
                total: parts.total(weights, work.keeps_predictor_loss) + done.prior,
                prediction: parts.prediction_loss(),
                score: parts.score,
                mfma: parts.without_planner(weights),
                plan: parts.plan.iter().sum(),
                cost: parts.cost,
                prior: done.prior,
                planner_ade: parts.plan_error[0],
                planner_fde: parts.plan_error[1],
                predictor_ade: parts.prediction_error[0] / predicted,
                predictor_fde: parts.prediction_error[1] / predicted,
                cost_weights: cost_weights.unwrap_or_default(),
            },
        })
    }
}

impl From<BatchError> for StepError {
    fn from(BatchError { scene, step, error }: BatchError) -> Self {
        match error {
            LossError::Said => Self::NotFinite { scene, step, what: "output of the network" },
            LossError::Loss => Self::NotFinite { scene, step, what: "loss" },
            LossError::Problem(error) => Self::Planner { scene, step, reason: error.to_string() },
            LossError::Planner(error) => Self::Planner { scene, step, reason: error.to_string() },
        }
    }
}
