//! What agents' motion is encoded by: an LSTM of two layers for each kind (paper III-B), over all agents of the kind at once.

use pulp::{Simd, WithSimd};

use crate::activation::{fused, sigmoid, tanh};
use crate::frame::{AgentRow, HISTORY};
use crate::gemm::{Begin, Finish, Left, Multiplier, Right};
use crate::weights::Weights;
use crate::weights::layout::WIDTH;

const GATES: usize = 4 * WIDTH;

/// The two layers of one kind.
#[derive(Clone, Debug)]
pub(super) struct MotionEncoder([Layer; 2]);

#[derive(Clone, Debug)]
struct Layer {
    input: Right,
    recurrent: Right,
    /// Both of PyTorch's, added.
    bias: Vec<f32>,
}

/// Memory of an encoder. Rows stand step by step, and within a step agent by agent.
#[derive(Clone, Debug, Default)]
pub(super) struct MotionMemory {
    gates: Vec<f32>,
    outputs: Vec<f32>,
    cells: Vec<f32>,
    inputs: Vec<f32>,
}

impl MotionEncoder {
    pub(super) fn of(weights: &Weights, net: &str) -> Self {
        let layer = |number: usize, inner: usize| {
            let get = |part: &str| weights.get(&format!("{net}.motion.{part}_l{number}"));
            Layer {
                input: Right::of_rows(get("weight_ih"), inner),
                recurrent: Right::of_rows(get("weight_hh"), WIDTH),
                bias: get("bias_ih").iter().zip(get("bias_hh")).map(|(a, b)| a + b).collect(),
            }
        };
        Self([layer(0, 8), layer(1, WIDTH)])
    }

    /// The encoding of each history, a row of 256 each: what the upper layer holds after the last step.
    pub(super) fn encode<'a>(
        &self,
        multiplier: &mut Multiplier,
        memory: &mut MotionMemory,
        histories: impl ExactSizeIterator<Item = &'a [AgentRow; HISTORY]>,
        mut output: impl FnMut(usize, &[f32]),
    ) {
        let count = histories.len();
        if count == 0 {
            return;
        }
        memory.inputs.resize(HISTORY * count * 8, 0.0);
        for (agent, history) in histories.enumerate() {
            for (step, row) in history.iter().enumerate() {
                memory.inputs[(step * count + agent) * 8..][..8].copy_from_slice(row);
            }
        }
        for (number, layer) in self.0.iter().enumerate() {
            if number > 0 {
                std::mem::swap(&mut memory.inputs, &mut memory.outputs);
            }
            layer.run(multiplier, count, memory);
        }
        let last = &memory.outputs[(HISTORY - 1) * count * WIDTH..];
        last.chunks_exact(WIDTH).enumerate().for_each(|(agent, row)| output(agent, row));
    }
}

impl Layer {
    fn run(&self, multiplier: &mut Multiplier, count: usize, memory: &mut MotionMemory) {
        let MotionMemory { gates, outputs, cells, inputs } = memory;
        gates.resize(HISTORY * count * GATES, 0.0);
        outputs.resize(HISTORY * count * WIDTH, 0.0);
        cells.clear();
        cells.resize(count * WIDTH, 0.0);
        // What does not depend on the step before, for all steps at once.
        let input = Left::dense(inputs, self.input.inner);
        multiplier.multiply(input, &self.input, Begin::Bias(&self.bias), Finish::Plain, gates, GATES);
        let arch = multiplier.arch();
        for (step, gates) in gates.chunks_exact_mut(count * GATES).enumerate() {
            let (before, now) = outputs.split_at_mut(step * count * WIDTH);
            if step > 0 {
                let before = Left::dense(&before[(step - 1) * count * WIDTH..], WIDTH);
                multiplier.multiply(before, &self.recurrent, Begin::Result, Finish::Plain, gates, GATES);
            }
            arch.dispatch(Step { gates, cells, outputs: &mut now[..count * WIDTH] });
        }
    }
}

/// One step of all agents.
struct Step<'a> {
    gates: &'a mut [f32],
    cells: &'a mut [f32],
    outputs: &'a mut [f32],
}

impl WithSimd for Step<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let agents = self.gates.chunks_exact_mut(GATES).zip(self.cells.chunks_exact_mut(WIDTH));
        for ((gates, cells), output) in agents.zip(self.outputs.chunks_exact_mut(WIDTH)) {
            advance(gates, cells, output);
        }
    }
}

/// One step of one agent: gates in PyTorch's order, input, forget, cell, output. One simple loop after the other, for the compiler to
/// make vectors of.
#[inline(always)]
fn advance(gates: &mut [f32], cells: &mut [f32], output: &mut [f32]) {
    let (entry, rest) = gates.split_at_mut(2 * WIDTH);
    let (candidate, out) = rest.split_at_mut(WIDTH);
    entry.iter_mut().for_each(|gate| *gate = sigmoid(*gate));
    candidate.iter_mut().for_each(|value| *value = tanh(*value));
    out.iter_mut().for_each(|gate| *gate = sigmoid(*gate));
    let (input, forget) = entry.split_at(WIDTH);
    candidate.iter_mut().zip(input).for_each(|(value, gate)| *value *= gate);
    cells.iter_mut().zip(forget).zip(candidate).for_each(|((cell, gate), value)| *cell = fused(*gate, *cell, *value));
    output.iter_mut().zip(cells).for_each(|(output, cell)| *output = tanh(*cell));
    output.iter_mut().zip(out).for_each(|(output, gate)| *output *= *gate);
}
