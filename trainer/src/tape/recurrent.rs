//! An LSTM of two layers over sequences of one length, as PyTorch's: gates in the order i, f, g, o; two biases; begun at zero.

use super::products::add_columns;
use super::scalar::Side::{Plain, Transposed};
use super::wide::{Wide, widely};
use super::{Scalar, Spare, Tape, Var};

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
                let mut by_outputs = gradients.spare.zeros(steps * count * hidden);
                by_outputs[(steps - 1) * count * hidden..].copy_from_slice(&gradient);
                gradients.spare.keep(gradient);
                let mut back = |run: Run<T>,
                                inputs: &[T],
                                layer: LstmLayer,
                                size: Size,
                                by_outputs: Vec<T>,
                                wants_inputs: bool| {
                    let wide = 4 * hidden;
                    let by_gates =
                        by_gates(&run, &values.get(layer.hidden).data, size, by_outputs, &mut gradients.spare);
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
                    let wanted = if wants_inputs { steps * count * size.inputs } else { 0 };
                    let mut by_inputs = gradients.spare.any(wanted);
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
                    for buffer in [run.gates, run.cells, run.tangents, run.outputs, by_gates] {
                        gradients.spare.keep(buffer);
                    }
                    by_inputs
                };
                let by_first = back(two, &one.outputs, layers[1], second, by_outputs, true);
                back(one, &histories, layers[0], first, by_first, false);
            }),
        )
    }

    fn run(&mut self, inputs: &[T], layer: LstmLayer, Size { count, steps, inputs: width, hidden }: Size) -> Run<T> {
        let wide = 4 * hidden;
        let biases = (&self.value(layer.input_bias).data, &self.value(layer.hidden_bias).data);
        let bias: Vec<T> = biases.0.iter().zip(&**biases.1).map(|(a, b)| *a + *b).collect();
        let mut gates = self.spare.any(steps * count * wide);
        gates.chunks_exact_mut(wide).for_each(|row| row.copy_from_slice(&bias));
        T::multiply(
            true,
            Plain(inputs),
            Transposed(&self.value(layer.input).data),
            [steps * count, width, wide],
            &mut gates,
        );
        let size = steps * count * hidden;
        let [cells, tangents, outputs] = [(); 3].map(|()| self.spare.any(size));
        let mut run = Run { gates, cells, tangents, outputs };
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
            let (cells, outputs) = (&mut cells[..part], &mut outputs[..part]);
            widely(Advance { hidden, gates, before: cells_before, cells, tangents, outputs });
        }
        run
    }
}

/// One step: gates before their functions become those after, and lead to cells and outputs.
struct Advance<'s, T> {
    hidden: usize,
    gates: &'s mut [T],
    before: &'s [T],
    cells: &'s mut [T],
    tangents: &'s mut [T],
    outputs: &'s mut [T],
}

impl<T: Scalar> Wide for Advance<'_, T> {
    #[inline(always)]
    fn run(self) {
        let hidden = self.hidden;
        let rows = self.gates.chunks_exact_mut(4 * hidden).zip(self.before.chunks_exact(hidden));
        let states = self.cells.chunks_exact_mut(hidden).zip(self.tangents.chunks_exact_mut(hidden));
        for (((gates, before), (cells, tangents)), outputs) in
            rows.zip(states).zip(self.outputs.chunks_exact_mut(hidden))
        {
            let (sigmoids, rest) = gates.split_at_mut(2 * hidden);
            let (g, o) = rest.split_at_mut(hidden);
            sigmoids.iter_mut().chain(&mut *o).for_each(|gate| *gate = gate.sigmoid());
            g.iter_mut().for_each(|gate| *gate = gate.tangent());
            let (i, f) = sigmoids.split_at(hidden);
            for ((cell, before), ((i, f), g)) in cells.iter_mut().zip(before).zip(i.iter().zip(f).zip(&*g)) {
                *cell = *f * *before + *i * *g;
            }
            tangents.iter_mut().zip(&*cells).for_each(|(tangent, cell)| *tangent = cell.tangent());
            for (output, (o, tangent)) in outputs.iter_mut().zip(o.iter().zip(&*tangents)) {
                *output = *o * *tangent;
            }
        }
    }
}

/// The gradient by the gates before their functions, from that by the outputs of each step.
fn by_gates<T: Scalar>(
    run: &Run<T>,
    weight: &[T],
    Size { count, steps, hidden, .. }: Size,
    mut by_outputs: Vec<T>,
    spare: &mut Spare<T>,
) -> Vec<T> {
    let (wide, part) = (4 * hidden, count * hidden);
    let mut by_gates = spare.any(steps * count * wide);
    let (mut by_cells, none) = (vec![T::ZERO; part], vec![T::ZERO; part]);
    for step in (0..steps).rev() {
        let from = step * part;
        let own = &mut by_gates[step * count * wide..][..count * wide];
        let gates = &run.gates[step * count * wide..][..count * wide];
        let (tangents, by_output) = (&run.tangents[from..][..part], &by_outputs[from..][..part]);
        let before = if step == 0 { &none } else { &run.cells[from - part..from] };
        widely(Retreat { hidden, by_gates: own, gates, tangents, before, by_output, by_cells: &mut by_cells });
        if step > 0 {
            T::multiply(true, Plain(own), Plain(weight), [count, wide, hidden], &mut by_outputs[from - part..from]);
        }
    }
    spare.keep(by_outputs);
    by_gates
}

/// One step back.
struct Retreat<'s, T> {
    hidden: usize,
    by_gates: &'s mut [T],
    gates: &'s [T],
    tangents: &'s [T],
    /// The cells of the step before.
    before: &'s [T],
    by_output: &'s [T],
    by_cells: &'s mut [T],
}

impl<T: Scalar> Wide for Retreat<'_, T> {
    #[inline(always)]
    fn run(self) {
        let hidden = self.hidden;
        let rows = self.by_gates.chunks_exact_mut(4 * hidden).zip(self.gates.chunks_exact(4 * hidden));
        let states = self.tangents.chunks_exact(hidden).zip(self.before.chunks_exact(hidden));
        let gradients = self.by_output.chunks_exact(hidden).zip(self.by_cells.chunks_exact_mut(hidden));
        for (((own, gates), (tangents, before)), (by_output, by_cells)) in rows.zip(states).zip(gradients) {
            let (i, rest) = gates.split_at(hidden);
            let (f, rest) = rest.split_at(hidden);
            let (g, o) = rest.split_at(hidden);
            let (by_i, rest) = own.split_at_mut(hidden);
            let (by_f, rest) = rest.split_at_mut(hidden);
            let (by_g, by_o) = rest.split_at_mut(hidden);
            let output = by_output.iter().zip(o.iter().zip(tangents));
            for ((by_o, by_cell), (by_output, (o, tangent))) in by_o.iter_mut().zip(&mut *by_cells).zip(output) {
                *by_cell = *by_cell + *by_output * *o * (T::ONE - *tangent * *tangent);
                *by_o = *by_output * *tangent * *o * (T::ONE - *o);
            }
            for ((by_i, by_g), (by_cell, (i, g))) in by_i.iter_mut().zip(by_g).zip(by_cells.iter().zip(i.iter().zip(g)))
            {
                *by_i = *by_cell * *g * *i * (T::ONE - *i);
                *by_g = *by_cell * *i * (T::ONE - *g * *g);
            }
            for ((by_f, by_cell), (f, before)) in by_f.iter_mut().zip(by_cells).zip(f.iter().zip(before)) {
                *by_f = *by_cell * *before * *f * (T::ONE - *f);
                *by_cell = *by_cell * *f;
            }
        }
    }
}
