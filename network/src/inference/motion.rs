//! Agents' histories: an LSTM of two layers for each type, run on all agents of the type at once (`network.md` 5.1).

use super::aligned::Aligned;
use super::functions::{sigmoid, tanh};
use super::product::{End, Kernel, Linear, ROWS, Rows};
use super::source::Source;
use crate::constants::{HISTORY, STATE, WIDTH};
use crate::weights::WeightsError;

const GATES: usize = 4 * WIDTH;
/// So many histories are run at once: more would not fit the cache.
pub(super) const TOGETHER: usize = 48;

/// One type's LSTM.
#[derive(Debug)]
pub(super) struct Motion {
    kernel: Kernel,
    layers: [Layer; 2],
}

#[derive(Debug)]
struct Layer {
    /// With both biases.
    input: Linear,
    hidden: Linear,
}

/// What a run needs.
#[derive(Debug)]
pub(super) struct Room {
    /// `[step][history][number]`.
    pub histories: Aligned,
    /// `[step][history][gate]`.
    gates: Aligned,
    /// The first layer's outputs, `[step][history][number]`.
    first: Aligned,
    hidden: Aligned,
    cell: Aligned,
}

impl Room {
    /// For as many histories at once.
    pub fn new(together: usize) -> Self {
        let rows = together.next_multiple_of(ROWS);
        Self {
            histories: Aligned::new(HISTORY * rows * STATE),
            gates: Aligned::new(HISTORY * rows * GATES),
            first: Aligned::new(HISTORY * rows * WIDTH),
            hidden: Aligned::new(rows * WIDTH),
            cell: Aligned::new(rows * WIDTH),
        }
    }
}

impl Motion {
    pub fn new(source: Source<'_>, name: &str) -> Result<Self, WeightsError> {
        let layer = |index: usize| -> Result<Layer, WeightsError> {
            let tensor = |part: &str| source.tensor(&format!("{name}.motion.{part}_l{index}"));
            let (bias_ih, bias_hh) = (tensor("bias_ih")?, tensor("bias_hh")?);
            let bias: Vec<f32> = bias_ih.iter().zip(bias_hh).map(|(a, b)| a + b).collect();
            let hidden = tensor("weight_hh")?;
            Ok(Layer { input: source.layer(tensor("weight_ih")?, &bias), hidden: source.layer(hidden, &[0.0; GATES]) })
        };
        Ok(Self { kernel: source.kernel, layers: [layer(0)?, layer(1)?] })
    }

    /// Multiply-adds of a history.
    pub fn multiply_adds(&self) -> u64 {
        let layers = self.layers.iter().map(|layer| layer.input.multiply_adds() + layer.hidden.multiply_adds());
        HISTORY as u64 * layers.sum::<u64>()
    }

    /// What the first `count` of `room.histories` come to: row after row.
    pub fn run<'a>(&self, room: &'a mut Room, count: usize) -> &'a [f32] {
        let rows = count.next_multiple_of(ROWS);
        let Room { histories, gates, first, hidden, cell } = room;
        let [lower, upper] = &self.layers;
        lower.input.apply_packed(histories, HISTORY * rows, gates, End::Sum);
        self.recur(lower, gates, first, rows, cell, true);
        upper.input.apply_packed(first, HISTORY * rows, gates, End::Sum);
        self.recur(upper, gates, hidden, rows, cell, false);
        &hidden[..count * WIDTH]
    }

    /// Step after step: each one's outputs go to a place of their own in `hidden` if `all`, else over the last one's.
    fn recur(&self, layer: &Layer, gates: &mut [f32], hidden: &mut [f32], rows: usize, cell: &mut [f32], all: bool) {
        cell.fill(0.0);
        for step in 0..HISTORY {
            let gates = &mut gates[step * rows * GATES..][..rows * GATES];
            let at = |step: usize| if all { step * rows * WIDTH } else { 0 };
            if step > 0 {
                let before = Rows { numbers: &hidden[at(step - 1)..], stride: WIDTH };
                layer.hidden.add(before, rows, gates, GATES, End::Sum);
            }
            let outputs = &mut hidden[at(step)..][..rows * WIDTH];
            self.kernel.run(|| {
                let rows = outputs.as_chunks_mut::<WIDTH>().0.iter_mut().zip(cell.as_chunks_mut::<WIDTH>().0);
                for ((output, cell), gates) in rows.zip(gates.as_chunks::<WIDTH>().0.as_chunks::<4>().0) {
                    let [input, forget, candidate, out] = gates;
                    for index in 0..WIDTH {
                        let kept = sigmoid(forget[index]) * cell[index];
                        cell[index] = kept + sigmoid(input[index]) * tanh(candidate[index]);
                        output[index] = sigmoid(out[index]) * tanh(cell[index]);
                    }
                }
            });
        }
    }
}
