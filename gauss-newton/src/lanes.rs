//! Numbers of several problems side by side: what is done to one is done to all, and each comes out as it does alone.

use std::ops::{Add, AddAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// What the links of the chain reckon with: a number, or one for each of several problems.
pub trait Number: Copy + Add<Output = Self> + Mul<Output = Self> + AddAssign {}
impl<T: Copy + Add<Output = T> + Mul<Output = T> + AddAssign> Number for T {}

/// A number for each of `L` problems.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lanes<const L: usize>(pub [f64; L]);

impl<const L: usize> Lanes<L> {
    pub const ZERO: Self = Self([0.0; L]);

    /// The same number for all.
    #[inline(always)]
    pub const fn all(number: f64) -> Self {
        Self([number; L])
    }

    /// That of each problem.
    #[inline(always)]
    pub fn of(number: impl Fn(usize) -> f64) -> Self {
        let mut lanes = [0.0; L];
        for (l, lane) in lanes.iter_mut().enumerate() {
            *lane = number(l);
        }
        Self(lanes)
    }
}

impl<const L: usize> Default for Lanes<L> {
    fn default() -> Self {
        Self::ZERO
    }
}

impl<const L: usize> Add for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::of(|l| self.0[l] + other.0[l])
    }
}

impl<const L: usize> Sub for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::of(|l| self.0[l] - other.0[l])
    }
}

impl<const L: usize> Mul for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::of(|l| self.0[l] * other.0[l])
    }
}

impl<const L: usize> Neg for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::of(|l| -self.0[l])
    }
}

impl<const L: usize> AddAssign for Lanes<L> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const L: usize> SubAssign for Lanes<L> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<const L: usize> MulAssign for Lanes<L> {
    #[inline(always)]
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}
