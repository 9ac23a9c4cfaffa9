//! Many samples of the layer at once, over the threads of the current rayon pool.
//!
//! Samples do not depend on each other and each writes to its own place, so results are the same for any number of threads.

use rayon::prelude::*;

use super::controls::Controls;
use super::gradient::{Gradients, Layer, LayerSettings, OutputGradient};
use super::linear::LinearSolver;
use super::problem::Problem;
use super::solver::SolveError;

/// Layers for a batch of samples, kept from batch to batch.
#[derive(Clone, Debug)]
pub struct Batch {
    samples: Vec<Sample>,
}

#[derive(Clone, Debug)]
struct Sample {
    layer: Layer,
    gradients: Gradients,
    result: Result<(), SolveError>,
}

/// A sample of a batch that has no result, the first one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("sample {sample}: {error}")]
pub struct BatchError {
    /// Which sample.
    pub sample: usize,
    /// Why.
    pub error: SolveError,
}

impl Batch {
    /// Layers for at most `samples` samples.
    #[must_use]
    pub fn new(settings: LayerSettings, linear: LinearSolver, samples: usize) -> Self {
        let sample = Sample { layer: Layer::new(settings, linear), gradients: Gradients::ZERO, result: Ok(()) };
        Self { samples: vec![sample; samples] }
    }

    /// [`Layer::forward`] of each problem; at most as many as there are layers are looked at.
    ///
    /// # Errors
    /// [`BatchError`]; the other samples are done none the less.
    pub fn forward(&mut self, problems: &[Problem], initial: &[Controls]) -> Result<(), BatchError> {
        let inputs = problems.par_iter().zip(initial);
        self.samples.par_iter_mut().zip(inputs).for_each(|(sample, (problem, initial))| {
            sample.result = sample.layer.forward(problem, initial);
        });
        self.first_error(problems.len())
    }

    /// [`Layer::backward`] of each problem of the last [`Batch::forward`].
    ///
    /// # Errors
    /// [`BatchError`]; the other samples are done none the less.
    pub fn backward(&mut self, problems: &[Problem], outputs: &[OutputGradient]) -> Result<(), BatchError> {
        let inputs = problems.par_iter().zip(outputs);
        self.samples.par_iter_mut().zip(inputs).for_each(|(sample, (problem, output))| {
            sample.result = sample.layer.backward(problem, output, &mut sample.gradients);
        });
        self.first_error(problems.len())
    }

    fn first_error(&self, problems: usize) -> Result<(), BatchError> {
        let mut samples = self.samples.iter().take(problems).enumerate();
        samples.try_for_each(|(sample, s)| s.result.map_err(|error| BatchError { sample, error }))
    }

    /// What each sample's last passes gave.
    pub fn results(&self) -> impl ExactSizeIterator<Item = (&Layer, &Gradients)> {
        self.samples.iter().map(|sample| (&sample.layer, &sample.gradients))
    }
}
