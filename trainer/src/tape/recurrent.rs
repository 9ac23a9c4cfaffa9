//! An LSTM of two layers over sequences of one length, as PyTorch's: gates in the order i, f, g, o; two biases; begun at zero.

use super::products::add_columns;
use super::scalar::Side::{Plain, Transposed};
use super::{Scalar, Tape, Var};

/// A layer's parameters: weights of input and hidden state [4 hidden, inputs] and [4 hidden, hidden], their biases.
#[derive(Clone, Copy, Debug)]
pub struct LstmLayer {
    /// [4 hidden, inputs].
    pub input: Var,
    /// [4 hidden, hidden].
    pub hidden: Var,
    /// [1, 4 hidden].
    pub input_bias: Var,
    /// [1, 4 hidden].
    pub hidden_bias: Var,
}

/// What a layer has computed, step after step.
struct Run<T> {
    /// Gates after their functions, `[step][sequence][4 hidden]`.
    gates: Vec<T>,
    /// Cells and their hyperbolic tangents, `[step][sequence][hidden]`.
    cells: Vec<T>,
    tangents: Vec<T>,
    /// `[step][sequence][hidden]`.
    outputs: Vec<T>,
}

/// Sequences, steps and widths.
#[derive(Clone, Copy)]
struct Size {
    count: usize,
    steps: usize,
    inputs: usize,
    hidden: usize,
}

impl<'a, T: Scalar> Tape<'a, T> {
    /// The top layer's last outputs [count, hidden] for sequences of `steps` rows: `histories` is `[step][sequence][input]`, and not learned.
    pub fn lstm(&mut self, histories: Vec<T>, count: usize, steps: usize, layers: [LstmLayer; 2]) -> Var {
        let hidden = self.value(layers[0].hidden).columns;
        let first = Size { count, steps, inputs: self.value(layers[0].input).columns, hidden };
        let second = Size { inputs: hidden, ..first };
        let one = self.run(&histories, layers[0], first);
        let two = self.run(&one.outputs, layers[1], second);
        let last = two.outputs[(steps - 1) * count * hidden..].to_vec();
        let of: Vec<Var> = layers.iter().flat_map(|l| [l.input, l.hidden, l.input_bias, l.hidden_bias]).collect();
        self.result(
            &of,
            count,
            hidden,
            last,
            Box::new(move |values, gradient, gradients| {
                let mut by_outputs = vec![T::ZERO; steps * count * hidden];
                by_outputs[(steps - 1) * count * hidden..].copy_from_slice(gradient);
                let mut back = |run: &Run<T>,
                                inputs: &[T],
                                layer: LstmLayer,
                                size: Size,
                                by_outputs: Vec<T>,
                                wants_inputs: bool| {
                    let wide = 4 * hidden;
                    let by_gates = by_gates(run, &values.get(layer.hidden).data, size, by_outputs);
                    if let Some(sum) = gradients.by(values, layer.input) {
                        T::multiply(
                            true,
                            Transposed(&by_gates),
                            Plain(inputs),
                            [wide, steps * count, size.inputs],
                            sum,
                        );
                    }
                    if let Some(sum) = gradients.by(values, layer.hidden) {
                        let (later, before) = (&by_gates[count * wide..], &run.outputs[..(steps - 1) * count * hidden]);
                        T::multiply(true, Transposed(later), Plain(before), [wide, (steps - 1) * count, hidden], sum);
                    }
                    for bias in [layer.input_bias, layer.hidden_bias] {
                        if let Some(sum) = gradients.by(values, bias) {
                            add_columns(&by_gates, wide, sum);
                        }
                    }
                    let mut by_inputs = vec![T::ZERO; if wants_inputs { steps * count * size.inputs } else { 0 }];
                    if wants_inputs {
                        let w = &values.get(layer.input).data;
                        T::multiply(
                            false,
                            Plain(&by_gates),
                            Plain(w),
                            [steps * count, wide, size.inputs],
                            &mut by_inputs,
                        );
                    }
                    by_inputs
                };
                let by_first = back(&two, &one.outputs, layers[1], second, by_outputs, true);
                back(&one, &histories, layers[0], first, by_first, false);
            }),
        )
    }

    fn run(&self, inputs: &[T], layer: LstmLayer, Size { count, steps, inputs: width, hidden }: Size) -> Run<T> {
        let wide = 4 * hidden;
        let biases = (&self.value(layer.input_bias).data, &self.value(layer.hidden_bias).data);
        let bias: Vec<T> = biases.0.iter().zip(&**biases.1).map(|(a, b)| *a + *b).collect();
        let mut gates = bias.repeat(steps * count);
        T::multiply(
            true,
            Plain(inputs),
            Transposed(&self.value(layer.input).data),
            [steps * count, width, wide],
            &mut gates,
        );
        let size = steps * count * hidden;
        let mut run =
            Run { gates, cells: vec![T::ZERO; size], tangents: vec![T::ZERO; size], outputs: vec![T::ZERO; size] };
        let none = vec![T::ZERO; count * hidden];
        for step in 0..steps {
            let (from, part) = (step * count * hidden, count * hidden);
            let (before, outputs) = run.outputs.split_at_mut(from);
            let (cells_before, cells) = run.cells.split_at_mut(from);
            let gates = &mut run.gates[step * count * wide..][..count * wide];
            let before = if step == 0 { &none } else { &before[from - part..] };
            let cells_before = if step == 0 { &none } else { &cells_before[from - part..] };
            if step > 0 {
                T::multiply(
                    true,
                    Plain(before),
                    Transposed(&self.value(layer.hidden).data),
                    [count, hidden, wide],
                    gates,
                );
            }
            let tangents = &mut run.tangents[from..][..part];
            pulp::Arch::new().dispatch(
                #[inline(always)]
                || advance(hidden, gates, cells_before, &mut cells[..part], tangents, &mut outputs[..part]),
            );
        }
        run
    }
}

/// One step: gates before their functions become those after, and lead to cells and outputs.
#[inline(always)]
fn advance<T: Scalar>(
    hidden: usize,
    gates: &mut [T],
    before: &[T],
    cells: &mut [T],
    tangents: &mut [T],
    outputs: &mut [T],
) {
    for (row, gates) in gates.chunks_exact_mut(4 * hidden).enumerate() {
        let here = row * hidden..(row + 1) * hidden;
        let (i, rest) = gates.split_at_mut(hidden);
        let (f, rest) = rest.split_at_mut(hidden);
        let (g, o) = rest.split_at_mut(hidden);
        let before = &before[here.clone()];
        let (cells, tangents, outputs) = (&mut cells[here.clone()], &mut tangents[here.clone()], &mut outputs[here]);
        for k in 0..hidden {
            (i[k], f[k], g[k], o[k]) = (i[k].sigmoid(), f[k].sigmoid(), g[k].tangent(), o[k].sigmoid());
            cells[k] = f[k] * before[k] + i[k] * g[k];
            tangents[k] = cells[k].tangent();
            outputs[k] = o[k] * tangents[k];
        }
    }
}

/// The gradient by the gates before their functions, from that by the outputs of each step.
fn by_gates<T: Scalar>(
    run: &Run<T>,
    weight: &[T],
    Size { count, steps, hidden, .. }: Size,
    mut by_outputs: Vec<T>,
) -> Vec<T> {
    let (wide, part) = (4 * hidden, count * hidden);
    let mut by_gates = vec![T::ZERO; steps * count * wide];
    let mut by_cells = vec![T::ZERO; part];
    for step in (0..steps).rev() {
        let from = step * part;
        let own = &mut by_gates[step * count * wide..][..count * wide];
        let gates = &run.gates[step * count * wide..][..count * wide];
        let (tangents, by_output) = (&run.tangents[from..][..part], &by_outputs[from..][..part]);
        let before = (step > 0).then(|| &run.cells[from - part..from]);
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || retreat(hidden, own, gates, tangents, before, by_output, &mut by_cells),
        );
        if step > 0 {
            T::multiply(true, Plain(own), Plain(weight), [count, wide, hidden], &mut by_outputs[from - part..from]);
        }
    }
    by_gates
}

/// One step back.
#[inline(always)]
fn retreat<T: Scalar>(
    hidden: usize,
    by_gates: &mut [T],
    gates: &[T],
    tangents: &[T],
    before: Option<&[T]>,
    by_output: &[T],
    by_cells: &mut [T],
) {
    for (row, (own, gates)) in by_gates.chunks_exact_mut(4 * hidden).zip(gates.chunks_exact(4 * hidden)).enumerate() {
        let here = row * hidden..(row + 1) * hidden;
        let (i, f, g, o) =
            (&gates[..hidden], &gates[hidden..2 * hidden], &gates[2 * hidden..3 * hidden], &gates[3 * hidden..]);
        let (di, rest) = own.split_at_mut(hidden);
        let (df, rest) = rest.split_at_mut(hidden);
        let (dg, d_o) = rest.split_at_mut(hidden);
        let (tangents, by_output) = (&tangents[here.clone()], &by_output[here.clone()]);
        let before = before.map(|before| &before[here.clone()]);
        let by_cells = &mut by_cells[here];
        for k in 0..hidden {
            let by_cell = by_cells[k] + by_output[k] * o[k] * (T::ONE - tangents[k] * tangents[k]);
            d_o[k] = by_output[k] * tangents[k] * o[k] * (T::ONE - o[k]);
            di[k] = by_cell * g[k] * i[k] * (T::ONE - i[k]);
            dg[k] = by_cell * i[k] * (T::ONE - g[k] * g[k]);
            df[k] = before.map_or(T::ZERO, |before| by_cell * before[k] * f[k] * (T::ONE - f[k]));
            by_cells[k] = by_cell * f[k];
        }
    }
}
