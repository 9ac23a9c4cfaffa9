//! How agents attend to each other: two encoder layers (paper III-B), norms behind the residuals.

use pulp::{Simd, WithSimd};

use crate::activation::{fused, softmax};
use crate::gemm::{Finish, Left, Multiplier};
use crate::weights::Weights;
use crate::weights::layout::{HIDDEN, WIDTH};

use super::linear::{Linear, Norm};

const HEADS: usize = 8;
const HEAD: usize = WIDTH / HEADS;

/// One encoder layer.
#[derive(Clone, Debug)]
pub(super) struct Interaction {
    projection: Linear,
    output: Linear,
    wide: Linear,
    narrow: Linear,
    norms: [Norm; 2],
}

/// Memory of a layer.
#[derive(Clone, Debug, Default)]
pub(super) struct InteractionMemory {
    projected: Vec<f32>,
    attended: Vec<f32>,
    added: Vec<f32>,
    hidden: Vec<f32>,
    scores: Vec<f32>,
    /// For each query and key the weights, added over the heads.
    pub(super) weights: Vec<f32>,
}

impl Interaction {
    pub(super) fn of(weights: &Weights, layer: usize) -> Self {
        let name = format!("agent_agent.interaction_net.layers.{layer}");
        let linear = |part: &str| Linear::of(weights, &format!("{name}.{part}"));
        let bias = weights.get(&format!("{name}.self_attn.in_proj_bias")).to_vec();
        let projection = weights.get(&format!("{name}.self_attn.in_proj_weight"));
        Self {
            projection: Linear { weight: crate::gemm::Right::of_rows(projection, WIDTH), bias },
            output: linear("self_attn.out_proj"),
            wide: linear("linear1"),
            narrow: linear("linear2"),
            norms: ["norm1", "norm2"].map(|norm| Norm::of(weights, &format!("{name}.{norm}"))),
        }
    }

    /// The layer over `agents` (rows of 256), in place. Nobody attends to those that are `masked`.
    pub(super) fn apply(
        &self,
        multiplier: &mut Multiplier,
        memory: &mut InteractionMemory,
        masked: &[bool],
        agents: &mut [f32],
    ) {
        let InteractionMemory { projected, attended, added, hidden, scores, weights } = memory;
        let count = masked.len();
        let arch = multiplier.arch();
        self.projection.apply(multiplier, Left::dense(agents, WIDTH), Finish::Plain, projected);
        attended.clear();
        attended.resize(count * WIDTH, 0.0);
        weights.clear();
        weights.resize(count * count, 0.0);
        scores.resize(count, 0.0);
        arch.dispatch(Attend { projected, masked, attended, scores, weights });
        self.output.apply(multiplier, Left::dense(attended, WIDTH), Finish::Plain, added);
        add(agents, added);
        self.norms[0].apply(arch, agents);
        self.wide.apply(multiplier, Left::dense(agents, WIDTH), Finish::Relu, hidden);
        self.narrow.apply(multiplier, Left::dense(hidden, HIDDEN), Finish::Plain, added);
        add(agents, added);
        self.norms[1].apply(arch, agents);
    }
}

/// The attention itself: each agent's queries to each agent's keys, head by head.
struct Attend<'a> {
    /// Query, key and value of each agent.
    projected: &'a [f32],
    masked: &'a [bool],
    attended: &'a mut [f32],
    scores: &'a mut [f32],
    weights: &'a mut [f32],
}

impl WithSimd for Attend<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { projected, masked, attended, scores, weights } = self;
        let scale = 1.0 / (HEAD as f32).sqrt();
        let row = |agent: usize, part: usize, head: usize| {
            let begin = (agent * 3 + part) * WIDTH + head * HEAD;
            &projected[begin..begin + HEAD]
        };
        for (query, attended) in attended.chunks_exact_mut(WIDTH).enumerate() {
            for (head, attended) in attended.chunks_exact_mut(HEAD).enumerate() {
                let own = row(query, 0, head);
                for (key, score) in scores.iter_mut().enumerate() {
                    *score = scale * dot(own, row(key, 1, head));
                }
                softmax(scores, |key| !masked[key]);
                for (key, weight) in scores.iter().enumerate() {
                    let values = row(key, 2, head);
                    attended.iter_mut().zip(values).for_each(|(sum, value)| *sum = fused(*weight, *value, *sum));
                    weights[query * masked.len() + key] += *weight;
                }
            }
        }
    }
}

fn add(to: &mut [f32], terms: &[f32]) {
    to.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
}

/// The sum of products, in 16 sums side by side.
#[inline(always)]
pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; 16];
    for (a, b) in a.as_chunks::<16>().0.iter().zip(b.as_chunks::<16>().0) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum = fused(*a, *b, *sum);
        }
    }
    sums.iter().sum()
}
