//! Random numbers by seed and purpose, the same on every machine.

use world::pcg::Pcg32;

/// What numbers are drawn for; streams of one seed do not repeat one another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// The first weights.
    Weights,
    /// The order of an epoch.
    Order,
    /// The dropout of a step.
    Dropout,
    /// The actions that a step of Q-learning samples.
    Actions,
}

/// The generator.
#[derive(Clone, Debug)]
pub struct Draw(Pcg32);

impl Draw {
    /// The numbers of `seed` for a purpose, in the epoch or step `number`.
    #[must_use]
    pub fn new(seed: u64, purpose: Purpose, number: u64) -> Self {
        Self(Pcg32::new(seed, ((purpose as u64) << 56) | number))
    }

    /// 32 random bits.
    fn bits(&mut self) -> u32 {
        self.0.bits()
    }

    /// 64 of them.
    pub fn wide(&mut self) -> u64 {
        (u64::from(self.bits()) << 32) | u64::from(self.bits())
    }

    /// A number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        f64::from(self.bits()) / 4_294_967_296.0
    }

    /// A number in [-`bound`, `bound`).
    pub fn within(&mut self, bound: f64) -> f64 {
        bound * (2.0 * self.unit() - 1.0)
    }

    /// A number of the standard normal distribution (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let (radius, angle) = (1.0 - self.unit(), self.unit());
        (-2.0 * libm::log(radius)).sqrt() * libm::cos(std::f64::consts::TAU * angle)
    }

    /// A whole number below `count`, all alike (Lemire 2019); 0 of none.
    pub fn below(&mut self, count: u32) -> u32 {
        let rejected = if count == 0 { 0 } else { count.wrapping_neg() % count };
        loop {
            let product = u64::from(self.bits()) * u64::from(count);
            if product as u32 >= rejected {
                return (product >> 32) as u32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_alike_and_normal_ones_normal() {
        let mut draw = Draw::new(1, Purpose::Weights, 0);
        let mut counts = [0; 3];
        for _ in 0..30_000 {
            counts[draw.below(3) as usize] += 1;
        }
        assert!(counts.iter().all(|count| (9_700..10_300).contains(count)), "{counts:?}");
        assert_eq!((draw.below(0), draw.below(1)), (0, 0));
        let normal: Vec<f64> = (0..30_000).map(|_| draw.normal()).collect();
        let mean = normal.iter().sum::<f64>() / 3e4;
        let square = normal.iter().map(|value| value * value).sum::<f64>() / 3e4;
        assert!(mean.abs() < 0.02 && (square - 1.0).abs() < 0.03, "{mean} {square}");
    }
}
