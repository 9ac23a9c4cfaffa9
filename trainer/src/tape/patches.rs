//! What the filters of a convolution see: with it a convolution is a linear layer.

use super::{Scalar, Tape, Var};

/// Squares of a picture, from left to right and from the first row to the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patches {
    /// Places to a side of the picture.
    pub side: usize,
    /// Numbers of a place.
    pub channels: usize,
    /// Places to a side of a square.
    pub kernel: usize,
    /// Places from one square to the next.
    pub stride: usize,
}

impl Patches {
    /// Squares to a side.
    #[must_use]
    pub fn out(&self) -> usize {
        (self.side - self.kernel) / self.stride + 1
    }

    /// Where the rows of all squares begin in a picture, one after another; each is `kernel` places long.
    pub fn starts(self) -> impl Iterator<Item = usize> {
        let squares = (0..self.out() * self.out()).map(move |square| (square / self.out(), square % self.out()));
        squares.flat_map(move |(row, column)| {
            (0..self.kernel).map(move |y| ((row * self.stride + y) * self.side + column * self.stride) * self.channels)
        })
    }
}

impl<T: Scalar> Tape<'_, T> {
    /// A row for each square of each picture, its places row by row. `x` holds pictures one after another, place by place.
    pub fn patches(&mut self, x: Var, patches: Patches) -> Var {
        let picture = patches.side * patches.side * patches.channels;
        let (count, squares) = (self.value(x).data.len() / picture, patches.out() * patches.out());
        let (length, width) = (patches.kernel * patches.channels, patches.kernel * patches.kernel * patches.channels);
        let mut y = self.spare.any(count * squares * width);
        let pictures = self.value(x).data.chunks_exact(picture);
        for (picture, y) in pictures.zip(y.chunks_exact_mut(squares * width)) {
            for (start, y) in patches.starts().zip(y.chunks_exact_mut(length)) {
                y.copy_from_slice(&picture[start..start + length]);
            }
        }
        self.result(
            &[x],
            count * squares,
            width,
            y,
            Box::new(move |values, gradient, gradients| {
                if let Some(dx) = gradients.by(values, x) {
                    for (dx, g) in dx.chunks_exact_mut(picture).zip(gradient.chunks_exact(squares * width)) {
                        for (start, g) in patches.starts().zip(g.chunks_exact(length)) {
                            dx[start..start + length].iter_mut().zip(g).for_each(|(dx, g)| *dx = *dx + *g);
                        }
                    }
                }
                gradients.spare.keep(gradient);
            }),
        )
    }
}
