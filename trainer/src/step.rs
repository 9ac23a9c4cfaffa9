//! What a step of learning is asked, and what it answers: all that the loop knows of network, planner and losses.

use network::constants::{NEIGHBORS, STEPS};
use thiserror::Error;

use crate::parameters::Parameters;
use crate::windows::Window;

/// What a step of learning is asked: which windows, with what.
#[derive(Clone, Copy, Debug)]
pub struct Ask<'a> {
    /// The batch.
    pub windows: &'a [Window],
    /// The weights as they are.
    pub parameters: &'a Parameters,
    /// Whether the planner is on.
    pub planning: bool,
    /// The seed of this step's dropout; none where nothing is dropped out: in validation, and at a probability of 0.
    pub dropout: Option<u64>,
    /// Whether to go backward too.
    pub wants_gradient: bool,
    /// Whether to tell what came of each window, to look at.
    pub wants_looks: bool,
}

impl<'a> Ask<'a> {
    /// Losses alone, with nothing dropped out.
    #[must_use]
    pub fn without_gradient(windows: &'a [Window], parameters: &'a Parameters, planning: bool) -> Self {
        Self { windows, parameters, planning, dropout: None, wants_gradient: false, wants_looks: false }
    }
}

/// What it answers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// Derivatives of the total by each parameter, in the order of [`Parameters`]; empty where they are not wanted.
    pub gradient: Vec<f32>,
    /// For each tensor in the order of the layout, whether it has a gradient. One that has none is absent, not zero: Adam skips it
    /// (`training.md` 2). Empty where none is wanted.
    pub has_gradient: Vec<bool>,
    /// Losses and metrics.
    pub terms: Terms,
    /// What came of each window; empty where it is not wanted.
    pub looks: Vec<Look>,
}

/// What came of a window, in the future that is nearest to what happened: positions at each step (m, the AV's frame).
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// The AV's plan, the planner's where it is on.
    pub plan: [[f64; 2]; STEPS],
    /// Where the network predicts the neighbours to be; of those who are not there, nothing that means anything. None where nobody is
    /// predicted.
    pub predictions: Option<Box<[[[f64; 2]; STEPS]; NEIGHBORS]>>,
}

/// Losses and metrics of a batch (`training.md` 2 and 4), each before its weight unless said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// What is minimized.
    pub total: f64,
    /// `L_pred`: the best future of all agents, the AV's first plan among them.
    pub prediction: f64,
    /// `L_score`: the cross-entropy of the scores.
    pub score: f64,
    /// `L_mfma`: the two, weighted.
    pub mfma: f64,
    /// `L_plan`: the planner's trajectory; 0 without the planner.
    pub plan: f64,
    /// `L_cost`: the mean square of the planner's residuals; 0 without the planner.
    pub cost: f64,
    /// The penalty that keeps the cost's weights near their start; 0 without.
    pub prior: f64,
    /// Mean distance of the best plan, the planner's where it is on, to what the AV did (m).
    pub planner_ade: f64,
    /// The same at the last step (m).
    pub planner_fde: f64,
    /// Mean distance of the best predictions to what the neighbours did (m).
    pub predictor_ade: f64,
    /// The same at the last step (m).
    pub predictor_fde: f64,
    /// The planner's weights as the network has them, in the order of the planner's terms; 0 without the planner.
    pub cost_weights: [f64; 9],
}

impl Terms {
    /// How many numbers they are.
    pub const COUNT: usize = 20;

    /// All of them, in the order in which they are declared.
    #[must_use]
    pub fn numbers(&self) -> [f64; Self::COUNT] {
        let Self { total, prediction, score, mfma, plan, cost, prior, planner_ade, planner_fde, .. } = *self;
        let mut all = [0.0; Self::COUNT];
        all[..9].copy_from_slice(&[total, prediction, score, mfma, plan, cost, prior, planner_ade, planner_fde]);
        all[9..11].copy_from_slice(&[self.predictor_ade, self.predictor_fde]);
        all[11..].copy_from_slice(&self.cost_weights);
        all
    }

    /// The other way.
    #[must_use]
    pub fn of(numbers: &[f64; Self::COUNT]) -> Self {
        let [
            total,
            prediction,
            score,
            mfma,
            plan,
            cost,
            prior,
            planner_ade,
            planner_fde,
            predictor_ade,
            predictor_fde,
            cost_weights @ ..,
        ] = *numbers;
        Self {
            total,
            prediction,
            score,
            mfma,
            plan,
            cost,
            prior,
            planner_ade,
            planner_fde,
            predictor_ade,
            predictor_fde,
            cost_weights,
        }
    }
}

/// Means over batches of equal weight: a short last batch counts as much as a full one (`training.md` 4).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// How many were added.
    pub batches: u64,
    /// Their sums.
    pub terms: [f64; Terms::COUNT],
    /// Of the gradients' norms before clipping.
    pub gradient_norm: f64,
}

impl Sums {
    /// One batch more.
    pub fn add(&mut self, terms: &Terms, gradient_norm: f64) {
        self.batches += 1;
        self.gradient_norm += gradient_norm;
        for (sum, number) in self.terms.iter_mut().zip(terms.numbers()) {
            *sum += number;
        }
    }

    /// The means, and that of the norms; none of no batch.
    #[must_use]
    pub fn means(&self) -> Option<(Terms, f64)> {
        let count = self.batches as f64;
        (self.batches > 0).then(|| (Terms::of(&self.terms.map(|sum| sum / count)), self.gradient_norm / count))
    }
}

/// Network, losses and planner, as the loop sees them.
pub trait Learner {
    /// Losses of a batch, and their gradient where it is wanted. The same question has the same answer to the last bit.
    ///
    /// # Errors
    /// [`StepError`] names the window that has no loss.
    fn step(&mut self, ask: &Ask<'_>) -> Result<Answer, StepError>;

    /// The gradient of an answer, when it is done with: its memory can serve the next.
    fn take_back(&mut self, _gradient: Vec<f32>) {}
}

/// Why a batch has no loss.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum StepError {
    /// A number that is none.
    #[error("the window at step {step} of scene {scene}: its {what} is not finite")]
    NotFinite {
        /// The window's scene.
        scene: String,
        /// Its step.
        step: u32,
        /// What was reckoned.
        what: &'static str,
    },
    /// The planner's equations have no solution.
    #[error("the window at step {step} of scene {scene}: the planner stopped: {reason}")]
    Planner {
        /// The window's scene.
        scene: String,
        /// Its step.
        step: u32,
        /// What it said.
        reason: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_are_numbers_and_numbers_terms() {
        let numbers = std::array::from_fn(|index| index as f64);
        let terms = Terms::of(&numbers);
        assert_eq!((terms.total, terms.prior, terms.predictor_fde, terms.cost_weights[8]), (0.0, 6.0, 10.0, 19.0));
        assert_eq!(terms.numbers(), numbers);
    }

    #[test]
    fn batches_weigh_alike() {
        let mut sums = Sums::default();
        assert_eq!(sums.means(), None);
        sums.add(&Terms { total: 2.0, ..Terms::default() }, 1.0);
        sums.add(&Terms { total: 4.0, ..Terms::default() }, 5.0);
        assert_eq!(sums.means(), Some((Terms { total: 3.0, ..Terms::default() }, 3.0)));
    }
}
