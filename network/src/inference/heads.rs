//! From what is known of agents and modes to controls, poses, scores and the cost's weights (`network.md` 5.7, 5.8).

use super::aligned::Aligned;
use super::functions::{elu, softmax_of};
use super::product::{End, Kernel, Linear, ROWS, Rows};
use super::source::Source;
use crate::constants::{AGENTS, COST_WEIGHTS, FUTURES, HISTORY, NEIGHBORS, SLOTS, STEPS, WIDTH};
use crate::frame::{Frame, Prediction};
use crate::weights::{CostForm, WeightsError};

/// Two layers with an exponential linear unit between.
#[derive(Debug)]
struct Decoder {
    kernel: Kernel,
    first: Linear,
    second: Linear,
}

impl Decoder {
    fn new(source: Source<'_>, first: &str, second: &str) -> Result<Self, WeightsError> {
        Ok(Self { kernel: source.kernel, first: source.linear(first)?, second: source.linear(second)? })
    }

    /// Rows of twice the width into rows of [`Linear::stride`] of the second layer.
    fn run(&self, features: &[f32], rows: usize, hidden: &mut [f32], out: &mut [f32]) {
        self.first.apply_packed(features, rows, hidden, End::Sum);
        self.kernel.run(|| elu(&mut hidden[..rows * self.first.stride()]));
        self.second.apply_packed(hidden, rows, out, End::Sum);
    }

    fn multiply_adds(&self) -> u64 {
        self.first.multiply_adds() + self.second.multiply_adds()
    }
}

/// The heads that a variant has.
#[derive(Debug)]
pub(super) struct Heads {
    plan: Decoder,
    others: Option<Others>,
    cost_weights: Option<[f32; COST_WEIGHTS]>,
}

#[derive(Debug)]
struct Others {
    predict: Decoder,
    reduce: Linear,
    score: Decoder,
}

/// What the heads need.
#[derive(Debug)]
pub(super) struct Room {
    features: Aligned,
    hidden: Aligned,
    out: Aligned,
    pooled: Aligned,
    reduced: Aligned,
}

impl Room {
    pub fn new(frames: usize) -> Self {
        let rows = (frames * FUTURES * NEIGHBORS).next_multiple_of(ROWS);
        let scored = (frames * FUTURES).next_multiple_of(ROWS);
        Self {
            features: Aligned::new(rows * 2 * WIDTH),
            hidden: Aligned::new(rows * WIDTH),
            out: Aligned::new(rows * (3 * STEPS).next_multiple_of(32)),
            pooled: Aligned::new(scored * 2 * WIDTH),
            reduced: Aligned::new(scored * WIDTH),
        }
    }
}

/// What is known: `agents[frame][agent]`, `modes[mode][frame][agent]`, `slots[frame][agent][slot]`, rows of the network's width.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    pub agents: &'a [f32],
    pub modes: &'a [f32],
    pub slots: &'a [f32],
    pub futures: usize,
}

impl Heads {
    pub fn new(source: Source<'_>) -> Result<Self, WeightsError> {
        let variant = source.weights.variant();
        let others = || -> Result<Others, WeightsError> {
            Ok(Others {
                predict: Decoder::new(source, "predict.decode.1", "predict.decode.3")?,
                reduce: source.linear("score.reduce.1")?,
                score: Decoder::new(source, "score.decode.1", "score.decode.3")?,
            })
        };
        Ok(Self {
            plan: Decoder::new(source, "plan.control.1", "plan.control.3")?,
            others: if variant.predicts() { Some(others()?) } else { None },
            cost_weights: if variant.has_cost() { Some(cost_weights(source)?) } else { None },
        })
    }

    /// Multiply-adds of a frame.
    pub fn multiply_adds(&self, futures: usize) -> u64 {
        let others = self.others.as_ref().map_or(0, |others| {
            (FUTURES * NEIGHBORS) as u64 * others.predict.multiply_adds()
                + FUTURES as u64 * others.score.multiply_adds()
                + others.reduce.multiply_adds()
        });
        futures as u64 * self.plan.multiply_adds() + others
    }

    pub fn run(&self, known: Known<'_>, frames: &[&Frame], out: &mut [Prediction], room: &mut Room) {
        self.controls(known, out, room);
        if let Some(others) = &self.others {
            others.poses(known, frames, out, room);
            others.scores(known, out, room);
        }
        for prediction in out {
            prediction.futures = known.futures;
            prediction.cost_weights = self.cost_weights;
            prediction.probabilities = [0.0; FUTURES];
            prediction.probabilities[..known.futures].copy_from_slice(&prediction.scores[..known.futures]);
            softmax_of(&mut prediction.probabilities[..known.futures]);
        }
    }

    fn controls(&self, known: Known<'_>, out: &mut [Prediction], room: &mut Room) {
        let count = out.len();
        for (row, feature) in room.features.chunks_exact_mut(2 * WIDTH).take(known.futures * count).enumerate() {
            known.feature(row / count, row % count, 0, count, feature);
        }
        self.plan.run(&room.features, known.futures * count, &mut room.hidden, &mut room.out);
        for (row, values) in room.out.chunks_exact(self.plan.second.stride()).take(known.futures * count).enumerate() {
            let controls = out[row % count].controls[row / count].as_flattened_mut();
            controls.copy_from_slice(&values[..2 * STEPS]);
        }
    }
}

impl Known<'_> {
    /// What is decoded of an agent in a mode.
    fn feature(self, mode: usize, frame: usize, agent: usize, frames: usize, feature: &mut [f32]) {
        let place =
            |rows: &[f32], row: usize, feature: &mut [f32]| feature.copy_from_slice(&rows[row * WIDTH..][..WIDTH]);
        let (of_map, of_agent) = feature.split_at_mut(WIDTH);
        place(self.modes, (mode * frames + frame) * AGENTS + agent, of_map);
        place(self.agents, frame * AGENTS + agent, of_agent);
    }
}

impl Others {
    fn poses(&self, known: Known<'_>, frames: &[&Frame], out: &mut [Prediction], room: &mut Room) {
        let rows = FUTURES * frames.len() * NEIGHBORS;
        let place = |row: usize| (row / NEIGHBORS / frames.len(), row / NEIGHBORS % frames.len(), row % NEIGHBORS);
        for (row, feature) in room.features.chunks_exact_mut(2 * WIDTH).take(rows).enumerate() {
            let (mode, frame, neighbor) = place(row);
            known.feature(mode, frame, neighbor + 1, frames.len(), feature);
        }
        self.predict.run(&room.features, rows, &mut room.hidden, &mut room.out);
        for (row, offsets) in room.out.chunks_exact(self.predict.second.stride()).take(rows).enumerate() {
            let (mode, frame, neighbor) = place(row);
            let now = &frames[frame].neighbors[neighbor][HISTORY - 1];
            let poses = out[frame].poses[mode][neighbor].iter_mut();
            for (pose, offset) in poses.zip(offsets.as_chunks::<3>().0) {
                *pose = std::array::from_fn(|index| now[index] + offset[index]);
            }
        }
    }

    /// Pools over agents and slots, absent ones too.
    fn scores(&self, known: Known<'_>, out: &mut [Prediction], room: &mut Room) {
        let count = out.len();
        for (frame, pooled) in room.features.chunks_exact_mut(2 * WIDTH).take(count).enumerate() {
            let (of_map, of_agents) = pooled.split_at_mut(WIDTH);
            most(&known.slots[frame * AGENTS * SLOTS * WIDTH..][..AGENTS * SLOTS * WIDTH], of_map);
            most(&known.agents[frame * AGENTS * WIDTH..][..AGENTS * WIDTH], of_agents);
        }
        self.reduce.apply_packed(&room.features, count, &mut room.reduced, End::Sum);
        self.score.kernel.run(|| elu(&mut room.reduced[..count * WIDTH]));
        for (row, pooled) in room.pooled.chunks_exact_mut(2 * WIDTH).take(FUTURES * count).enumerate() {
            let (mode, frame) = (row / count, row % count);
            let (reduced, of_mode) = pooled.split_at_mut(WIDTH);
            reduced.copy_from_slice(&room.reduced[frame * WIDTH..][..WIDTH]);
            most(&known.modes[(mode * count + frame) * AGENTS * WIDTH..][..AGENTS * WIDTH], of_mode);
        }
        self.score.first.apply_packed(&room.pooled, FUTURES * count, &mut room.hidden, End::Sum);
        let hidden = FUTURES * count * self.score.first.stride();
        self.score.kernel.run(|| elu(&mut room.hidden[..hidden]));
        let second = Rows { numbers: &room.hidden, stride: self.score.first.stride() };
        let stride = self.score.second.stride();
        self.score.second.apply(second, FUTURES * count, &mut room.out, stride, End::Sum);
        for (row, values) in room.out.chunks_exact(stride).take(FUTURES * count).enumerate() {
            out[row % count].scores[row / count] = values[0];
        }
    }
}

/// The greatest of each column.
fn most(rows: &[f32], most: &mut [f32]) {
    let (first, rest) = rows.split_at(WIDTH);
    most.copy_from_slice(first);
    for row in rest.chunks_exact(WIDTH) {
        for (most, value) in most.iter_mut().zip(row) {
            *most = if *value > *most { *value } else { *most };
        }
    }
}

/// Weights of the planner's cost: they depend on nothing but the network (`network.md` 5.7).
fn cost_weights(source: Source<'_>) -> Result<[f32; COST_WEIGHTS], WeightsError> {
    const SCALES: [f64; 7] = [1.0, 1.0, 1.0, 1.0, 1.0, 10.0, 100.0];
    const CONSTRAINT: f32 = 10.0;
    let tensor = |name: &str| source.tensor(&format!("plan.cost.{name}"));
    let (w0, b0, w2, b2) = (tensor("0.weight")?, tensor("0.bias")?, tensor("2.weight")?, tensor("2.bias")?);
    let hidden: Vec<f64> = w0.iter().zip(b0).map(|(w, b)| (f64::from(*w) + f64::from(*b)).max(0.0)).collect();
    let rows = w2.chunks_exact(hidden.len()).zip(b2);
    let logits: Vec<f64> = rows
        .map(|(row, b)| f64::from(*b) + row.iter().zip(&hidden).map(|(w, h)| f64::from(*w) * h).sum::<f64>())
        .collect();
    let largest = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let shares: Vec<f64> = logits.iter().map(|logit| libm::exp(logit - largest)).collect();
    let sum: f64 = shares.iter().sum();
    let mut weights = [CONSTRAINT; COST_WEIGHTS];
    for (term, (weight, scale)) in weights.iter_mut().zip(SCALES).enumerate() {
        *weight = match source.weights.cost_form() {
            CostForm::Shares => (shares[term] / sum * scale) as f32,
            CostForm::Exponentials => libm::exp(logits[term]) as f32,
        };
    }
    Ok(weights)
}
