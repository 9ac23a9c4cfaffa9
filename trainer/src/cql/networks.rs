//! Policy and critics on a tape.

use std::ops::Range;

use network::cql::Shape;
use network::weights::TensorLayout;

use crate::draw::{Draw, Purpose};
use crate::tape::{Activation, Patches, Tape, Var};

/// How many critics there are; d3rlpy's `n_critics`.
pub const CRITICS: usize = 2;

/// The layers of policy and critics, and where each tensor's numbers are in a row.
#[derive(Clone, Debug)]
pub struct Networks {
    /// The layers.
    pub shape: Shape,
    /// The policy's tensors.
    pub policy: Vec<Tensor>,
    /// Those of both critics, one after the other.
    pub critics: Vec<Tensor>,
}

/// A tensor and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Its name.
    pub name: String,
    /// Length along each axis.
    pub shape: Vec<usize>,
    /// Where its numbers are.
    pub place: Range<usize>,
}

/// A network's tensors on a tape, in the order of its layout.
#[derive(Clone, Debug)]
pub struct Placed(Vec<Var>);

impl Networks {
    /// Those of these layers.
    #[must_use]
    pub fn new(shape: Shape) -> Self {
        let policy = places(&[("", shape.policy(true))]);
        let critics = ["critic.0.", "critic.1."].map(|name| (name, shape.critic()));
        Self { policy, critics: places(&critics), shape }
    }

    /// First numbers of a row of `tensors`: weights and biases uniform within 1 / √inputs, as PyTorch draws those of convolutions and linear layers.
    #[must_use]
    pub fn first(&self, tensors: &[Tensor], seed: u64, stream: u64) -> Vec<f32> {
        let mut values = Vec::new();
        for (number, tensor) in tensors.iter().enumerate() {
            let mut draw = Draw::new(seed, Purpose::Weights, (stream << 16) | number as u64);
            let inputs = |tensor: &Tensor| tensor.shape.get(1).copied();
            // A bias stands after its weight.
            let mut inputs = inputs(tensor).or_else(|| inputs(&tensors[number - 1])).unwrap_or(1);
            if tensor.name.contains("dense.") && tensor.name.starts_with("critic.") {
                // In d3rlpy one layer sees picture and action.
                inputs = self.shape.flat() + self.shape.actions;
            }
            let bound = 1.0 / (inputs as f64).sqrt();
            values.extend(tensor.place.clone().map(|_| draw.within(bound) as f32));
        }
        values
    }

    /// The tensors of one critic.
    #[must_use]
    pub fn critic(&self, number: usize) -> &[Tensor] {
        let count = self.critics.len() / CRITICS;
        &self.critics[number * count..][..count]
    }

    /// Pictures as the first layer sees them.
    pub fn seen<'a>(&self, tape: &mut Tape<'a, f32>, pictures: &[&[u8]]) -> Var {
        let number = |value: &u8| f32::from(*value) / 255.0;
        let Some(patches) = self.patches(0) else {
            let numbers = pictures.iter().flat_map(|picture| picture.iter().map(number)).collect();
            return tape.constant(pictures.len(), self.shape.picture(), numbers);
        };
        let (length, width) = (patches.kernel * patches.channels, patches.kernel * patches.kernel * patches.channels);
        let rows = pictures.len() * patches.out() * patches.out();
        let mut numbers = Vec::with_capacity(rows * width);
        for picture in pictures {
            patches.starts().for_each(|start| numbers.extend(picture[start..start + length].iter().map(number)));
        }
        tape.constant(rows, width, numbers)
    }

    fn patches(&self, layer: usize) -> Option<Patches> {
        let convolution = self.shape.convolutions.get(layer)?;
        let [side, channels] = self.shape.grids()[layer];
        Some(Patches { side, channels, kernel: convolution.kernel, stride: convolution.stride })
    }

    /// What the dense layer sees of `count` pictures.
    fn flat<'a>(&self, tape: &mut Tape<'a, f32>, placed: &Placed, seen: Var, count: usize) -> Var {
        let mut x = seen;
        for layer in 0..self.shape.convolutions.len() {
            if let Some(patches) = self.patches(layer).filter(|_| layer > 0) {
                x = tape.patches(x, patches);
            }
            x = tape.linear(x, placed.0[2 * layer], Some(placed.0[2 * layer + 1]), Activation::Relu);
        }
        tape.reshaped(x, count, self.shape.flat())
    }

    /// Means of the actions before they are squashed, and logarithms of their spreads.
    pub fn act<'a>(&self, tape: &mut Tape<'a, f32>, placed: &Placed, seen: Var, count: usize) -> [Var; 2] {
        let flat = self.flat(tape, placed, seen, count);
        let [dense, dense_bias, mean, mean_bias, spread, spread_bias] = placed.last();
        let hidden = tape.linear(flat, dense, Some(dense_bias), Activation::Relu);
        let means = tape.linear(hidden, mean, Some(mean_bias), Activation::None);
        [means, tape.linear(hidden, spread, Some(spread_bias), Activation::None)]
    }

    /// What a critic says of `each` actions of every picture.
    pub fn value<'a>(
        &self,
        tape: &mut Tape<'a, f32>,
        placed: &Placed,
        (seen, count): (Var, usize),
        (actions, each): (Var, usize),
    ) -> Var {
        let flat = self.flat(tape, placed, seen, count);
        let [dense, dense_bias, of_action, value, value_bias] = placed.last();
        let of_picture = tape.linear(flat, dense, Some(dense_bias), Activation::None);
        let of_picture = tape.pick(of_picture, (0..count * each).map(|row| row / each).collect());
        let of_action = tape.linear(actions, of_action, None, Activation::None);
        let hidden = tape.sum(of_picture, of_action);
        let hidden = tape.activated(hidden, Activation::Relu);
        tape.linear(hidden, value, Some(value_bias), Activation::None)
    }
}

impl Placed {
    /// Tensors on a tape, to be learned or not.
    pub fn new<'a>(tape: &mut Tape<'a, f32>, tensors: &[Tensor], values: &'a [f32], learned: bool) -> Self {
        let place = |tensor: &Tensor| {
            let (rows, columns) = match tensor.shape[..] {
                [rows, columns] => (rows, columns),
                _ => (1, tensor.place.len()),
            };
            let data = &values[tensor.place.clone()];
            if learned {
                tape.parameter(rows, columns, data, tensor.place.clone())
            } else {
                tape.fixed(rows, columns, data)
            }
        };
        Self(tensors.iter().map(place).collect())
    }

    fn last<const N: usize>(&self) -> [Var; N] {
        let first = self.0.len() - N;
        std::array::from_fn(|index| self.0[first + index])
    }
}

fn places(networks: &[(&str, Vec<TensorLayout>)]) -> Vec<Tensor> {
    let mut all: Vec<Tensor> = Vec::new();
    for (prefix, layout) in networks {
        for TensorLayout { name, shape } in layout {
            let start = all.last().map_or(0, |last| last.place.end);
            let place = start..start + shape.iter().product::<usize>();
            all.push(Tensor { name: format!("{prefix}{name}"), shape: shape.clone(), place });
        }
    }
    all
}
