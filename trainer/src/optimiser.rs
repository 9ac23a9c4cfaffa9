//! Adam as PyTorch has it, after clipping the gradient by its norm.
//!
//! Numbers are f32, as PyTorch's are; factors are reckoned in f64 and rounded once. Each tensor counts its own steps: one without a
//! gradient is skipped, and its moments begin when it first has one.

use std::ops::Range;

use network::weights::Variant;
use rayon::prelude::*;

use crate::parameters::{Parameters, tensors};
use crate::schedule::Schedule;
use crate::settings::AdamSettings;

/// How many numbers a thread takes at a time.
const CHUNK: usize = 1 << 15;

/// Whether a tensor is of the planner's weights.
#[must_use]
pub fn is_cost(name: &str) -> bool {
    name.starts_with("plan.cost.")
}

/// Shortens the gradient to `most` (L2 norm over all tensors that have one), and tells the norm that it had.
///
/// The factor is `most / (norm + 1e-6)` where that is below 1, as in PyTorch's `clip_grad_norm_`.
pub fn clip(gradient: &mut [f32], tensors: &[Range<usize>], has_gradient: &[bool], most: f64) -> f64 {
    let squares: Vec<f64> = tensors
        .par_iter()
        .zip(has_gradient)
        .map(|(range, has)| {
            let values = if *has { &gradient[range.clone()] } else { &[] };
            values.iter().map(|value| f64::from(*value) * f64::from(*value)).sum()
        })
        .collect();
    // In the order of the tensors: the same bits for any number of threads.
    let norm = squares.iter().sum::<f64>().sqrt();
    let factor = most / (norm + 1e-6);
    if factor < 1.0 {
        gradient.par_iter_mut().for_each(|value| *value *= factor as f32);
    }
    norm
}

/// The optimiser's state.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Running means of the gradient.
    pub first: Vec<f32>,
    /// Running means of its squares.
    pub second: Vec<f32>,
    /// How many steps each tensor has made.
    pub steps: Vec<u64>,
}

impl Adam {
    /// Before the first step.
    #[must_use]
    pub fn new(variant: Variant) -> Self {
        let count = Parameters::zeros(variant).values().len();
        Self { first: vec![0.0; count], second: vec![0.0; count], steps: vec![0; tensors(variant).len()] }
    }

    /// One step against the gradient.
    pub fn step(
        &mut self,
        parameters: &mut Parameters,
        gradient: &[f32],
        has_gradient: &[bool],
        schedule: &Schedule,
        settings: &AdamSettings,
    ) {
        let layout = tensors(parameters.variant());
        for (((name, _, range), has), steps) in layout.zip(has_gradient).zip(&mut self.steps) {
            if !has {
                continue;
            }
            *steps += 1;
            let rate = if is_cost(&name) { schedule.cost_learning_rate } else { schedule.learning_rate };
            let values = &mut parameters.values_mut()[range.clone()];
            let (first, second) = (&mut self.first[range.clone()], &mut self.second[range.clone()]);
            adam(settings, rate, *steps, [values, first, second], &gradient[range]);
        }
    }
}

/// The step with the number `steps`, from 1, of numbers with their moments.
pub(crate) fn adam(
    settings: &AdamSettings,
    rate: f64,
    steps: u64,
    [values, first, second]: [&mut [f32]; 3],
    gradient: &[f32],
) {
    let factors = Factors::new(settings, rate, steps);
    let moments = first.par_chunks_mut(CHUNK).zip(second.par_chunks_mut(CHUNK));
    let all = values.par_chunks_mut(CHUNK).zip(moments).zip(gradient.par_chunks(CHUNK));
    all.for_each(|((values, (first, second)), gradient)| {
        for (((value, first), second), gradient) in values.iter_mut().zip(first).zip(second).zip(gradient) {
            factors.apply(value, first, second, *gradient);
        }
    });
}

/// What a tensor's numbers have in common in a step.
struct Factors {
    keep_first: f32,
    take_first: f32,
    keep_second: f32,
    take_second: f32,
    root_correction: f32,
    epsilon: f32,
    size: f32,
}

impl Factors {
    fn new(settings: &AdamSettings, rate: f64, steps: u64) -> Self {
        let AdamSettings { beta1, beta2, epsilon } = *settings;
        let correction = |beta| 1.0 - libm::pow(beta, steps as f64);
        Self {
            keep_first: beta1 as f32,
            take_first: (1.0 - beta1) as f32,
            keep_second: beta2 as f32,
            take_second: (1.0 - beta2) as f32,
            root_correction: correction(beta2).sqrt() as f32,
            epsilon: epsilon as f32,
            size: (rate / correction(beta1)) as f32,
        }
    }

    /// In the order of operations of `torch.optim.adam`, 1.11: `mul_`, `add_`, `mul_`, `addcmul_`, `sqrt`, `/`, `add_`, `addcdiv_`.
    fn apply(&self, value: &mut f32, first: &mut f32, second: &mut f32, gradient: f32) {
        *first = *first * self.keep_first + self.take_first * gradient;
        *second = *second * self.keep_second + self.take_second * gradient * gradient;
        let scale = second.sqrt() / self.root_correction + self.epsilon;
        *value += -self.size * *first / scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;

    const SCHEDULE: Schedule = Schedule { learning_rate: 1e-2, cost_learning_rate: 1e-1, planning: true };

    /// One step of each tensor with `gradient` in all its places, if it has one.
    fn step(adam: &mut Adam, parameters: &mut Parameters, gradient: f32, has: &dyn Fn(&str) -> bool) {
        let gradient = vec![gradient; parameters.values().len()];
        let has: Vec<bool> = tensors(parameters.variant()).map(|(name, ..)| has(&name)).collect();
        adam.step(parameters, &gradient, &has, &SCHEDULE, &AdamSettings::default());
    }

    fn first_of(parameters: &Parameters, wanted: &str) -> f64 {
        let found = tensors(parameters.variant()).find(|(name, ..)| name == wanted).unwrap();
        f64::from(parameters.values()[found.2.start])
    }

    #[test]
    fn two_steps_are_those_of_the_closed_form() {
        // After gradients g and h: m = 0.1 (0.9 g + h), v = 0.001 (0.999 g^2 + h^2); corrections 1 - 0.81 and 1 - 0.998001.
        let (g, h) = (0.5_f64, -2.0_f64);
        let after_one = -1e-2 * g / (g.abs() + 1e-8);
        let (mean, square) = ((0.9 * g + h) * 0.1 / 0.19, (0.999 * g * g + h * h) * 0.001 / 0.001_999);
        let after_two = after_one - 1e-2 * mean / (square.sqrt() + 1e-8);
        let mut parameters = Parameters::zeros(Variant::Joint);
        let mut adam = Adam::new(Variant::Joint);
        let close = |got: f64, wanted: f64| assert!((got / wanted - 1.0).abs() < 1e-5, "{got} {wanted}");
        step(&mut adam, &mut parameters, g as f32, &|_| true);
        close(first_of(&parameters, "plan.control.1.weight"), after_one);
        step(&mut adam, &mut parameters, h as f32, &|_| true);
        close(first_of(&parameters, "plan.control.1.weight"), after_two);
        close(first_of(&parameters, "plan.cost.2.bias"), 10.0 * after_two);
    }

    #[test]
    fn a_tensor_without_a_gradient_stands_and_begins_when_it_has_one() {
        let mut parameters = Parameters::zeros(Variant::Joint);
        let mut adam = Adam::new(Variant::Joint);
        for _ in 0..3 {
            step(&mut adam, &mut parameters, 1.0, &|name| !is_cost(name));
        }
        assert_eq!(first_of(&parameters, "plan.cost.0.weight"), 0.0);
        step(&mut adam, &mut parameters, 1.0, &|_| true);
        // Its first step, which is as long as the learning rate.
        assert!((first_of(&parameters, "plan.cost.0.weight") + 0.1).abs() < 1e-6);
        assert_eq!((adam.steps.iter().max(), adam.steps.iter().min()), (Some(&4), Some(&1)));
    }

    #[test]
    fn a_gradient_is_shortened_over_all_tensors_that_have_one() {
        let tensors = [0..2, 2..3, 3..4];
        let mut gradient = [3.0, 0.0, 100.0, 4.0];
        assert_eq!(clip(&mut gradient, &tensors, &[true, false, true], 10.0), 5.0);
        assert_eq!(gradient, [3.0, 0.0, 100.0, 4.0]);
        assert_eq!(clip(&mut gradient, &tensors, &[true, false, true], 1.0), 5.0);
        assert!((gradient[0] - 0.6).abs() < 1e-6 && (gradient[3] - 0.8).abs() < 1e-6, "{gradient:?}");
        gradient[0] = f32::NAN;
        assert!(clip(&mut gradient, &tensors, &[true, false, true], 1.0).is_nan());
    }

    #[test]
    fn on_a_bowl_it_comes_to_the_ground() {
        let mut parameters = Parameters::zeros(Variant::Imitation);
        let mut adam = Adam::new(Variant::Imitation);
        let settings = Settings::default();
        let mut gradient = vec![0.0; parameters.values().len()];
        let has: Vec<bool> = (0..tensors(Variant::Imitation).len()).map(|index| index == 0).collect();
        for _ in 0..1000 {
            gradient[5] = parameters.values()[5] - 1.5;
            adam.step(&mut parameters, &gradient, &has, &SCHEDULE, &settings.adam);
        }
        assert!((parameters.values()[5] - 1.5).abs() < 1e-3);
    }
}
