//! Single precision for training, double for its proofs.

use std::ops::{Add, Div, Mul, Neg, Sub};

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use network::inference::functions;

/// What the tape computes with.
pub trait Scalar:
    Copy
    + Default
    + PartialOrd
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + std::iter::Sum
    + 'static
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;

    /// The nearest to a number.
    fn of(value: f64) -> Self;
    /// The number.
    fn f64(self) -> f64;
    /// e to the power of it.
    fn exponential(self) -> Self;
    /// Square root.
    fn root(self) -> Self;

    /// Logistic function.
    #[inline(always)]
    fn sigmoid(self) -> Self {
        Self::ONE / (Self::ONE + (-self).exponential())
    }

    /// Hyperbolic tangent.
    #[inline(always)]
    fn tangent(self) -> Self {
        Self::of(2.0) * (self + self).sigmoid() - Self::ONE
    }

    /// `c = a b`, or `c += a b`, of `rows` x `inner` and `inner` x `columns` numbers.
    fn multiply(adds: bool, a: Side<'_, Self>, b: Side<'_, Self>, size: [usize; 3], c: &mut [Self]);
}

/// A side of a product: numbers row after row, or those of its transpose.
#[derive(Clone, Copy, Debug)]
pub enum Side<'a, T> {
    /// Row after row.
    Plain(&'a [T]),
    /// Row after row of the transpose.
    Transposed(&'a [T]),
}

macro_rules! scalar {
    ($t:ty, $exp:path) => {
        impl Scalar for $t {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;

            #[inline(always)]
            fn of(value: f64) -> Self {
                value as $t
            }

            #[inline(always)]
            fn f64(self) -> f64 {
                f64::from(self)
            }

            #[inline(always)]
            fn exponential(self) -> Self {
                $exp(self)
            }

            #[inline(always)]
            fn root(self) -> Self {
                self.sqrt()
            }

            fn multiply(
                adds: bool,
                a: Side<'_, Self>,
                b: Side<'_, Self>,
                [rows, inner, columns]: [usize; 3],
                c: &mut [Self],
            ) {
                fn view<'a>(side: Side<'a, $t>, rows: usize, columns: usize) -> MatRef<'a, $t> {
                    match side {
                        Side::Plain(data) => MatRef::from_row_major_slice(data, rows, columns),
                        Side::Transposed(data) => MatRef::from_column_major_slice(data, rows, columns),
                    }
                }
                if rows * columns == 0 {
                    return;
                }
                let accum = if adds { Accum::Add } else { Accum::Replace };
                let c = MatMut::from_row_major_slice_mut(c, rows, columns);
                matmul(c, accum, view(a, rows, inner), view(b, inner, columns), 1.0, Par::Seq);
            }
        }
    };
}

scalar!(f32, functions::exp);
scalar!(f64, libm::exp);
