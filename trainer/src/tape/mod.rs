//! Reverse-mode derivatives of functions of matrices: what is computed is noted on a tape, and walked back.
//!
//! Every operation says in one place what it computes and what its derivative is. Products run on `faer`; nothing here knows the network.
//!
//! | file | what |
//! | --- | --- |
//! | `scalar` | single and double precision |
//! | `products` | linear layers, products of matrices, heads of attention |
//! | `pointwise` | activations, sums, dropout, layer norms |
//! | `rows` | rows picked, matrices side by side |
//! | `patches` | what the filters of a convolution see |
//! | `recurrent` | LSTMs of two layers |
//! | `attention` | attention to chosen rows, and within groups |
//! | `spare` | memory that is used again |
//! | `wide` | loops on wide vectors |

mod attention;
mod patches;
mod pointwise;
mod products;
mod recurrent;
mod rows;
mod scalar;
mod spare;
#[cfg(test)]
mod tests;
mod wide;

use std::borrow::Cow;
use std::ops::Range;

pub use attention::Slot;
pub use patches::Patches;
pub use products::Activation;
pub use recurrent::LstmLayer;
pub use rows::Part;
pub use scalar::Scalar;
pub use spare::{Spare, Spares};

/// A value on the tape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Var(usize);

/// A matrix, row after row.
#[derive(Clone, Debug)]
pub struct Matrix<'a, T: Clone> {
    /// How many rows.
    pub rows: usize,
    /// How many columns.
    pub columns: usize,
    /// The numbers.
    pub data: Cow<'a, [T]>,
}

/// What walks a gradient back through one operation; the gradient is handed over.
type Back<'a, T> = Box<dyn FnOnce(&Values<'a, T>, Vec<T>, &mut Gradients<'_, T>) + Send + 'a>;

/// The tape. It borrows the parameters.
pub struct Tape<'a, T: Scalar> {
    values: Values<'a, T>,
    /// What each value came from; none for leaves.
    backs: Vec<Option<Back<'a, T>>>,
    dropout: Option<Dropout>,
    spare: Spare<T>,
}

/// All values, by their number.
pub struct Values<'a, T: Clone> {
    matrices: Vec<Matrix<'a, T>>,
    /// Where a parameter's gradient goes.
    places: Vec<Option<Range<usize>>>,
    /// Whether anything learned is behind it.
    learned: Vec<bool>,
}

/// Random numbers of dropout, and how much is dropped.
#[derive(Clone, Debug)]
struct Dropout {
    random: fastrand::Rng,
    rate: f64,
}

/// Gradients by values, while they are walked back.
pub struct Gradients<'g, T> {
    /// By all parameters.
    parameters: &'g mut [T],
    others: Vec<Option<Vec<T>>>,
    spare: Spare<T>,
}

impl<'a, T: Clone> Values<'a, T> {
    /// One of them.
    #[must_use]
    pub fn get(&self, var: Var) -> &Matrix<'a, T> {
        &self.matrices[var.0]
    }
}

impl<T: Scalar> Gradients<'_, T> {
    /// Where the gradient by a value is summed; none if nothing learned is behind it.
    fn by(&mut self, values: &Values<'_, T>, var: Var) -> Option<&mut [T]> {
        let (has, sum) = self.place(values, var)?;
        if !has {
            sum.fill(T::ZERO);
        }
        Some(sum)
    }

    /// The same, and whether there is something to add to: else the numbers there have no meaning.
    fn place(&mut self, values: &Values<'_, T>, var: Var) -> Option<(bool, &mut [T])> {
        if !values.learned[var.0] {
            return None;
        }
        if let Some(place) = &values.places[var.0] {
            return Some((true, &mut self.parameters[place.clone()]));
        }
        let place = &mut self.others[var.0];
        let has = place.is_some();
        Some((has, place.get_or_insert_with(|| self.spare.any(values.matrices[var.0].data.len()))))
    }

    /// Hands over what is to be added to the gradient by a value.
    fn give(&mut self, values: &Values<'_, T>, var: Var, gradient: Vec<T>) {
        let is_first = values.learned[var.0] && values.places[var.0].is_none() && self.others[var.0].is_none();
        if is_first {
            self.others[var.0] = Some(gradient);
            return;
        }
        if let Some(sum) = self.by(values, var) {
            sum.iter_mut().zip(&gradient).for_each(|(sum, more)| *sum = *sum + *more);
        }
        self.spare.keep(gradient);
    }
}

impl<'a, T: Scalar> Tape<'a, T> {
    /// An empty one. With dropout where a seed and a rate are given; without it the operation does nothing. It takes its memory from `spare`.
    #[must_use]
    pub fn new(dropout: Option<(u64, f64)>, spare: Spare<T>) -> Self {
        Self {
            values: Values { matrices: Vec::new(), places: Vec::new(), learned: Vec::new() },
            backs: Vec::new(),
            dropout: dropout.map(|(seed, rate)| Dropout { random: fastrand::Rng::with_seed(seed), rate }),
            spare,
        }
    }

    /// A value's numbers.
    #[must_use]
    pub fn value(&self, var: Var) -> &Matrix<'a, T> {
        self.values.get(var)
    }

    /// Numbers that are not learned.
    pub fn constant(&mut self, rows: usize, columns: usize, data: Vec<T>) -> Var {
        self.push(rows, columns, Cow::Owned(data), None, false, None)
    }

    /// Numbers that are learned: their gradient is added at `place` of the row of parameters.
    pub fn parameter(&mut self, rows: usize, columns: usize, data: &'a [T], place: Range<usize>) -> Var {
        self.push(rows, columns, Cow::Borrowed(data), Some(place), true, None)
    }

    /// Numbers of a row of parameters that are not learned here.
    pub fn fixed(&mut self, rows: usize, columns: usize, data: &'a [T]) -> Var {
        self.push(rows, columns, Cow::Borrowed(data), None, false, None)
    }

    /// The same numbers, through which no gradient comes.
    pub fn detached(&mut self, var: Var) -> Var {
        let Matrix { rows, columns, data } = self.values.get(var).clone();
        self.push(rows, columns, data, None, false, None)
    }

    /// The result of an operation on `of`.
    fn result(&mut self, of: &[Var], rows: usize, columns: usize, data: Vec<T>, back: Back<'a, T>) -> Var {
        let learned = of.iter().any(|var| self.values.learned[var.0]);
        self.push(rows, columns, Cow::Owned(data), None, learned, learned.then_some(back))
    }

    fn push(
        &mut self,
        rows: usize,
        columns: usize,
        data: Cow<'a, [T]>,
        place: Option<Range<usize>>,
        learned: bool,
        back: Option<Back<'a, T>>,
    ) -> Var {
        debug_assert_eq!(rows * columns, data.len(), "a matrix of {rows} x {columns}");
        self.values.matrices.push(Matrix { rows, columns, data });
        self.values.places.push(place);
        self.values.learned.push(learned);
        self.backs.push(back);
        Var(self.backs.len() - 1)
    }

    /// Walks gradients by these values back, and adds what comes out to those by the parameters. Its memory can be used again.
    pub fn backward(mut self, from: Vec<(Var, Vec<T>)>, parameters: &mut [T]) -> Spare<T> {
        let spare = std::mem::take(&mut self.spare);
        let mut gradients = Gradients { parameters, others: vec![None; self.backs.len()], spare };
        for (var, gradient) in from {
            gradients.give(&self.values, var, gradient);
        }
        for index in (0..self.backs.len()).rev() {
            let Some(back) = self.backs[index].take() else { continue };
            if let Some(gradient) = gradients.others[index].take() {
                back(&self.values, gradient, &mut gradients);
            }
            // What came after it is done with it.
            if let Cow::Owned(numbers) = std::mem::take(&mut self.values.matrices[index].data) {
                gradients.spare.keep(numbers);
            }
        }
        self.spare = gradients.spare;
        self.discard()
    }

    /// The memory that can be used again; nothing is walked back.
    pub fn discard(mut self) -> Spare<T> {
        for matrix in self.values.matrices {
            if let Cow::Owned(numbers) = matrix.data {
                self.spare.keep(numbers);
            }
        }
        self.spare.end();
        self.spare
    }
}
