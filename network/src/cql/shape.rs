//! Layers of policy and critics: convolutions and a dense layer over the picture, then what each says.
//!
//! That is d3rlpy's encoder of pixels with other numbers. Its own (Nature's: 32, 64, 64 filters of 8, 4, 3 pixels in steps of 4, 2, 1, dense 512) is
//! made for 84 x 84 pixels; at 256 x 256 it has 26 million weights and 110 million multiply-adds, here 0.7 and 4.9 million.
//!
//! Numbers of a picture, and of what comes out of a convolution, lie row by row, all channels of a place together. A filter's weights lie so too.

use super::ACTIONS;
use super::picture::{CHANNELS, SIDE};
use crate::weights::TensorLayout;

/// A layer of filters, each no less than 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Convolution {
    /// How many.
    pub filters: usize,
    /// Places to a side that a filter sees.
    pub kernel: usize,
    /// Places from one to the next.
    pub stride: usize,
}

/// The layers over a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Places to a side of the picture.
    pub side: usize,
    /// Numbers of a place.
    pub channels: usize,
    /// One after another.
    pub convolutions: Vec<Convolution>,
    /// Outputs of the layer after them.
    pub dense: usize,
    /// Numbers of an action.
    pub actions: usize,
}

impl Shape {
    /// That of the driver `cql`.
    #[must_use]
    pub fn driver() -> Self {
        let layer = |filters, kernel, stride| Convolution { filters, kernel, stride };
        let convolutions = vec![layer(16, 8, 8), layer(32, 4, 4), layer(64, 3, 1)];
        Self { side: SIDE, channels: CHANNELS, convolutions, dense: 256, actions: ACTIONS }
    }

    /// Numbers of a picture.
    #[must_use]
    pub fn picture(&self) -> usize {
        self.side * self.side * self.channels
    }

    /// Side and channels of what each convolution sees, and in the end of what comes out.
    #[must_use]
    pub fn grids(&self) -> Vec<[usize; 2]> {
        let mut grids = vec![[self.side, self.channels]];
        let mut side = self.side;
        for layer in &self.convolutions {
            side = (side - layer.kernel) / layer.stride + 1;
            grids.push([side, layer.filters]);
        }
        grids
    }

    /// Numbers that the dense layer sees of a picture.
    #[must_use]
    pub fn flat(&self) -> usize {
        self.grids().last().map_or(0, |[side, channels]| side * side * channels)
    }

    /// The policy's tensors: the middle of its actions, and the logarithm of how far they spread where that is `learned`.
    #[must_use]
    pub fn policy(&self, learned: bool) -> Vec<TensorLayout> {
        let mut all = self.encoder();
        let heads = if learned { &["mean", "deviation"][..] } else { &["mean"] };
        all.extend(heads.iter().flat_map(|head| linear(head, self.actions, self.dense)));
        all
    }

    /// A critic's tensors: the dense layer sees the action too, and one number comes out.
    #[must_use]
    pub fn critic(&self) -> Vec<TensorLayout> {
        let mut all = self.encoder();
        all.push(tensor("dense.action", vec![self.dense, self.actions]));
        all.extend(linear("value", 1, self.dense));
        all
    }

    fn encoder(&self) -> Vec<TensorLayout> {
        let mut all = Vec::new();
        for (number, (layer, [_, channels])) in self.convolutions.iter().zip(self.grids()).enumerate() {
            all.extend(linear(&format!("convolution.{number}"), layer.filters, layer.kernel * layer.kernel * channels));
        }
        all.extend(linear("dense", self.dense, self.flat()));
        all
    }
}

fn linear(name: &str, outputs: usize, inputs: usize) -> [TensorLayout; 2] {
    [tensor(&format!("{name}.weight"), vec![outputs, inputs]), tensor(&format!("{name}.bias"), vec![outputs])]
}

fn tensor(name: &str, shape: Vec<usize>) -> TensorLayout {
    TensorLayout { name: name.to_owned(), shape }
}
