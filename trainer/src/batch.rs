//! A batch through network, planner and losses, and back.
//!
//! Windows go in groups of [`GROUP`], and in each [`TOGETHER`] are on a tape; gradients are summed in the order of the windows. So the result
//! is the same for any number of threads. Where the authors couple the windows (`training.md` 2), the first one's plan is found before the
//! others'.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use gauss_newton::constants::TERMS;
use gauss_newton::{Choices, Controls, Layer};
use network::constants::{COST_WEIGHTS, HISTORY, NEIGHBORS, STEPS};
use rayon::prelude::*;
use thiserror::Error;

use crate::loss::{ByWhatWasSaid, Divisors, Loss, LossError, Parts, Said};
use crate::model::{Layout, Outputs, forward};
use crate::planning::Planning;
use crate::settings::{LossWeights, Rules};
use crate::step::Look;
use crate::tape::{Scalar, Spare, Spares, Tape, Var};
use crate::windows::Window;

/// Windows that one thread takes, tape after tape.
pub const GROUP: usize = 8;
/// Windows that share a tape: of more, products go no faster, and memory grows.
pub const TOGETHER: usize = 4;

/// What is done with a batch.
#[derive(Clone, Debug)]
pub struct Work {
    /// Whose losses.
    pub rules: Rules,
    /// What they count.
    pub weights: LossWeights,
    /// Through which planner.
    pub planning: Option<Planning>,
    /// Whether the predictor's own losses count.
    pub keeps_predictor_loss: bool,
    /// Whether all windows take the lengths of the neighbours that are nearest in the first window, as the authors do.
    pub couples: bool,
    /// The weight of a penalty on how far the logarithms of the cost's weights are from those of others.
    pub prior: Option<(f64, [f64; TERMS])>,
    /// Seed and rate of the dropout; none without.
    pub dropout: Option<(u64, f64)>,
    /// Whether gradients are wanted.
    pub wants_gradient: bool,
    /// Whether to keep what came of each window, to look at.
    pub wants_looks: bool,
}

impl Work {
    /// The losses of windows that this one leads.
    pub(crate) fn loss(&self, lead: Option<Choices>) -> Loss {
        let mut loss = Loss::new(self.rules, self.weights, self.planning, self.keeps_predictor_loss);
        loss.lead = lead;
        loss
    }
}

/// What comes of it.
#[derive(Clone, Debug, Default)]
pub struct Done<T> {
    /// The gradient by all parameters; empty if it was not wanted.
    pub gradient: Vec<T>,
    /// Losses and metrics of the batch.
    pub parts: Parts,
    /// The penalty on the cost's weights.
    pub prior: f64,
    /// For each window what was said, its part, and the gradient by what was said.
    pub windows: Vec<(Said, Parts, ByWhatWasSaid)>,
    /// What came of each window, if it was wanted.
    pub looks: Vec<Look>,
}

/// A window that has no loss.
#[derive(Debug, Error)]
#[error("window {scene} at step {step}: {error}")]
pub struct BatchError {
    /// Its scene.
    pub scene: String,
    /// Its step.
    pub step: u32,
    /// Why.
    pub error: LossError,
}

/// Does the work on a batch, with the current rayon pool and the memory of a batch before.
///
/// # Errors
/// [`BatchError`] names the first window, in the batch's order, that has no loss.
pub fn run<T: Scalar>(
    layout: &Layout,
    values: &[T],
    windows: &[&Window],
    work: &Work,
    spares: &Spares<T>,
) -> Result<Done<T>, BatchError> {
    let divisors = Divisors::of(windows, work.rules);
    let batch = Batch { layout, values, work, divisors, spares };
    let mut first = None;
    let lead =
        windows.chunks(TOGETHER).next().filter(|_| work.couples && work.planning.is_some()).and_then(|windows| {
            let heard = batch.hear(0, windows, spares.take());
            let lead = lead(&heard, windows, work);
            first = Some(heard);
            lead
        });
    // One after the other from a queue, and not a part of them for each thread: what is done can be summed, and its memory used again.
    let queue = Mutex::new(windows.chunks(GROUP).enumerate());
    let (first, merged) = (Mutex::new(first), Mutex::new(Merged::default()));
    (0..rayon::current_num_threads().min(windows.len().div_ceil(GROUP))).into_par_iter().for_each(|_| {
        while let Some((index, windows)) = next(&queue) {
            let heard = if index == 0 { locked(&first).take() } else { None };
            let group = batch.group(index, windows, heard, lead.as_ref());
            locked(&merged).bring(index, group, spares);
        }
    });
    merged.into_inner().unwrap_or_else(PoisonError::into_inner).done.unwrap_or_else(|| Ok(Done::default()))
}

/// The lock; whoever panicked left nothing half done that is used again.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn next<I: Iterator>(queue: &Mutex<I>) -> Option<I::Item> {
    locked(queue).next()
}

/// What groups have done, put together in the order of the windows.
struct Merged<T> {
    /// The sum of those that came without a gap, or why one of them has none.
    done: Option<Result<Done<T>, BatchError>>,
    /// How many they are.
    count: usize,
    /// Those that came too early.
    early: BTreeMap<usize, Result<Done<T>, BatchError>>,
}

impl<T> Default for Merged<T> {
    fn default() -> Self {
        Self { done: None, count: 0, early: BTreeMap::new() }
    }
}

impl<T: Scalar> Merged<T> {
    fn bring(&mut self, index: usize, group: Result<Done<T>, BatchError>, spares: &Spares<T>) {
        self.early.insert(index, group);
        while let Some(group) = self.early.remove(&self.count) {
            self.count += 1;
            match (&mut self.done, group) {
                (Some(Ok(done)), Ok(group)) => {
                    let gradient = done.add(group);
                    let mut spare = spares.take();
                    spare.keep(gradient);
                    spares.bring(spare);
                }
                // The first window without a loss is told.
                (Some(Err(_)), _) => {}
                (done, group) => *done = Some(group),
            }
        }
    }
}

impl<T: Scalar> Done<T> {
    /// Adds what comes after it, and gives back the memory of its gradient.
    fn add(&mut self, more: Self) -> Vec<T> {
        self.gradient.iter_mut().zip(&more.gradient).for_each(|(sum, more)| *sum = *sum + *more);
        more.windows.iter().for_each(|(_, parts, _)| self.parts.add(parts));
        self.prior += more.prior;
        self.windows.extend(more.windows);
        self.looks.extend(more.looks);
        more.gradient
    }
}

/// What all windows of a batch have in common.
struct Batch<'a, T: Scalar> {
    layout: &'a Layout,
    values: &'a [T],
    work: &'a Work,
    divisors: Divisors,
    spares: &'a Spares<T>,
}

/// A tape, and where on it the network's outputs are.
type Heard<'a, T> = (Tape<'a, T>, Outputs);

impl<'a, T: Scalar> Batch<'a, T> {
    /// The network's forward pass over the windows of tape `index`.
    fn hear(&self, index: usize, windows: &[&Window], spare: Spare<T>) -> Heard<'a, T> {
        // Far apart, or neighbouring seeds would begin alike.
        let far = (index as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut tape = Tape::new(self.work.dropout.map(|(seed, rate)| (seed ^ far, rate)), spare);
        let sketches: Vec<_> = windows.iter().map(|window| &window.sketch).collect();
        let outputs = forward(&mut tape, self.layout, self.values, &sketches);
        (tape, outputs)
    }

    /// The windows of group `index`, tape after tape; the first may have been heard already.
    fn group(
        &self,
        index: usize,
        windows: &[&Window],
        mut heard: Option<Heard<'a, T>>,
        lead: Option<&Choices>,
    ) -> Result<Done<T>, BatchError> {
        let work = self.work;
        let mut spare = self.spares.take();
        let mut done = Done::default();
        if work.wants_gradient {
            done.gradient = spare.zeros(self.layout.count());
        }
        let mut loss = work.loss(lead.cloned());
        for (tape, windows) in windows.chunks(TOGETHER).enumerate() {
            let number = index * (GROUP / TOGETHER) + tape;
            let (tape, outputs) =
                heard.take().unwrap_or_else(|| self.hear(number, windows, std::mem::take(&mut spare)));
            let first = done.windows.len();
            for (sample, window) in windows.iter().enumerate() {
                let said = said(&tape, &outputs, sample, window);
                let (parts, by) = loss.of(window, &said, &self.divisors).map_err(|error| BatchError {
                    scene: window.scene.clone(),
                    step: window.step,
                    error,
                })?;
                done.parts.add(&parts);
                if work.wants_looks {
                    done.looks.push(loss.look(&said, by.future));
                }
                done.windows.push((said, parts, by));
            }
            if let (0, Some((weight, start)), Some((said, _, by))) = (number, work.prior, done.windows.first_mut()) {
                done.prior = loss.prior(weight, &start, said, by);
            }
            spare = if work.wants_gradient {
                let seeds = seeds(&tape, &outputs, &done.windows[first..]);
                tape.backward(seeds, &mut done.gradient)
            } else {
                tape.discard()
            };
        }
        self.spares.bring(spare);
        Ok(done)
    }
}

/// Which neighbours are nearest in the first window. None where it has no plan, which its group says.
fn lead<T: Scalar>((tape, outputs): &Heard<'_, T>, windows: &[&Window], work: &Work) -> Option<Choices> {
    let window = windows.first()?;
    work.loss(None).solve(window, &said(tape, outputs, 0, window)).ok().flatten().map(Layer::choices)
}

/// What the tape says of a window.
fn said<T: Scalar>(tape: &Tape<'_, T>, outputs: &Outputs, sample: usize, window: &Window) -> Said {
    let row = |var: Var, row: usize| {
        let matrix = tape.value(var);
        matrix.data[row * matrix.columns..][..matrix.columns].iter().map(|value| value.f64()).collect::<Vec<f64>>()
    };
    let plans = outputs.plans.iter().map(|plan| {
        let numbers = row(*plan, sample);
        let mut controls = Controls::ZERO;
        for (t, pair) in numbers.chunks_exact(2).enumerate().take(STEPS) {
            (controls.acceleration[t], controls.steering[t]) = (pair[0], pair[1]);
        }
        controls
    });
    let poses = outputs.offsets.iter().map(|offsets| {
        let mut poses = Box::new([[[0.0; 3]; STEPS]; NEIGHBORS]);
        for (index, (_, neighbor)) in outputs.neighbors.iter().enumerate().filter(|(_, (of, _))| *of == sample) {
            let now = window.sketch.neighbors[*neighbor][HISTORY - 1].map(f64::from);
            for (pose, offset) in poses[*neighbor].iter_mut().zip(row(*offsets, index).chunks_exact(3)) {
                *pose = [now[0] + offset[0], now[1] + offset[1], now[2] + offset[2]];
            }
        }
        poses
    });
    Said {
        plans: plans.collect(),
        poses: poses.collect(),
        scores: outputs.scores.iter().map(|score| row(*score, sample)[0]).collect(),
        cost: outputs.cost.map(|cost| {
            let logits = row(cost, 0);
            std::array::from_fn::<f64, COST_WEIGHTS, _>(|term| logits[term])
        }),
    }
}

/// Gradients by what was said, at the values of the tape that said it.
fn seeds<T: Scalar>(
    tape: &Tape<'_, T>,
    outputs: &Outputs,
    windows: &[(Said, Parts, ByWhatWasSaid)],
) -> Vec<(Var, Vec<T>)> {
    let size = |var: Var| tape.value(var).data.len();
    let mut seeds = Vec::new();
    for (future, plan) in outputs.plans.iter().enumerate() {
        let mut by = vec![T::ZERO; size(*plan)];
        for (row, (.., said)) in by.chunks_exact_mut(2 * STEPS).zip(windows).filter(|(_, (.., by))| by.future == future)
        {
            row.iter_mut().zip(said.plan.interleaved()).for_each(|(sum, value)| *sum = T::of(value));
        }
        seeds.push((*plan, by));
    }
    for (future, offsets) in outputs.offsets.iter().enumerate() {
        let mut by = vec![T::ZERO; size(*offsets)];
        for (row, (sample, neighbor)) in by.chunks_exact_mut(3 * STEPS).zip(&outputs.neighbors) {
            let said = &windows[*sample].2;
            if said.future == future {
                row.iter_mut().zip(said.poses[*neighbor].as_flattened()).for_each(|(sum, value)| *sum = T::of(*value));
            }
        }
        seeds.push((*offsets, by));
    }
    for (future, score) in outputs.scores.iter().enumerate() {
        seeds.push((*score, windows.iter().map(|(.., by)| T::of(by.scores[future])).collect()));
    }
    if let Some(cost) = outputs.cost {
        let sum = |term: usize| T::of(windows.iter().map(|(.., by)| by.cost[term]).sum());
        seeds.push((cost, (0..COST_WEIGHTS).map(sum).collect()));
    }
    seeds
}

#[cfg(test)]
mod tests;
