//! Delays drawn from a distribution: PCG32 by the seed and the scene's name, so that neither the order of scenes nor the number of workers
//! matters, nor which driver it is.

use std::f64::consts::TAU;

use world::pcg::Pcg32;

use super::{Distribution, Shape};

/// The standard normal distribution has 99 of 100 values below this.
const P99: f64 = 2.326_347_874_040_841;

/// The delays of an episode's plans, step after step.
#[derive(Clone, Debug)]
pub struct Delays {
    distribution: Distribution,
    generator: Pcg32,
}

impl Delays {
    /// Those in the scene of this name, from step 0 on.
    #[must_use]
    pub fn new(distribution: &Distribution, scene: &str) -> Self {
        let generator = Pcg32::new(distribution.seed, fnv(scene.as_bytes()));
        Self { distribution: distribution.clone(), generator }
    }

    /// The delay (us) of the next step's plan; none for one that is lost. Each step draws as often as any other.
    pub fn draw(&mut self) -> Option<u32> {
        let is_lost = self.share() < self.distribution.loss;
        let delay = match self.distribution.shape {
            Shape::Uniform(least, most) => {
                let (least, most) = (f64::from(least), f64::from(most));
                least + self.share() * (most - least)
            }
            Shape::Normal(mean, deviation) => f64::from(mean) + f64::from(deviation) * self.normal(),
            Shape::LogNormal(median, p99) => {
                let spread = libm::log(f64::from(p99) / f64::from(median)) / P99;
                f64::from(median) * libm::exp(spread * self.normal())
            }
        };
        // A cast of what is below zero is zero, and of what is too large the largest: that is lost too.
        (!is_lost).then_some(libm::round(delay) as u32)
    }

    /// In [0, 1).
    fn share(&mut self) -> f64 {
        self.generator.between(0.0, 1.0)
    }

    /// Of mean 0 and deviation 1 (Box and Muller).
    fn normal(&mut self) -> f64 {
        // Above zero, for its logarithm.
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.share()));
        radius * libm::cos(TAU * self.share())
    }
}

/// FNV-1a: names differ in it, and that is all that is asked of it.
fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::super::Latency;
    use super::*;

    fn drawn(text: &str, scene: &str) -> Vec<Option<u32>> {
        let Latency::Drawn(distribution) = text.parse().unwrap() else { panic!("{text} is not drawn") };
        let mut delays = Delays::new(&distribution, scene);
        (0..20_000).map(|_| delays.draw()).collect()
    }

    fn quantile(delays: &[Option<u32>], share: f64) -> f64 {
        let mut delays: Vec<u32> = delays.iter().flatten().copied().collect();
        delays.sort_unstable();
        f64::from(delays[(share * (delays.len() - 1) as f64) as usize])
    }

    #[test]
    fn a_scene_has_its_delays_and_another_scene_or_seed_has_others() {
        let delays = drawn("dist:normal:80ms:20ms", "a");
        assert_eq!(delays, drawn("dist:normal:80ms:20ms:seed=0", "a"));
        let others = [drawn("dist:normal:80ms:20ms", "b"), drawn("dist:normal:80ms:20ms:seed=1", "a")];
        for other in others {
            let same = delays.iter().zip(&other).filter(|(one, other)| one == other).count();
            assert!(same < 20, "{same}");
        }
        assert_eq!(delays[..3], [Some(122_413), Some(72_989), Some(44_595)], "these stay as they are: runs repeat");
    }

    #[test]
    fn each_shape_is_spread_as_it_says() {
        let near =
            |value: f64, expected: f64| assert!((value / expected - 1.0).abs() < 0.03, "{value}, not {expected}");
        let uniform = drawn("dist:uniform:100ms:200ms", "a");
        assert!(quantile(&uniform, 0.0) >= 1e5 && quantile(&uniform, 1.0) <= 2e5);
        near(quantile(&uniform, 0.25), 1.25e5);
        let normal = drawn("dist:normal:80ms:20ms", "a");
        near(quantile(&normal, 0.5), 8e4);
        near(quantile(&normal, 0.841_345), 1e5);
        let tailed = drawn("dist:lognormal:80ms:300ms", "a");
        near(quantile(&tailed, 0.5), 8e4);
        assert!((quantile(&tailed, 0.99) / 3e5 - 1.0).abs() < 0.08);
        assert_eq!(quantile(&drawn("dist:normal:1ms:20ms", "a"), 0.2), 0.0);
    }

    #[test]
    fn so_many_are_lost_and_the_others_are_delayed_as_ever() {
        let (all, some) = (drawn("dist:uniform:0:1s", "a"), drawn("dist:uniform:0:1s:loss=0.25", "a"));
        let lost = some.iter().filter(|delay| delay.is_none()).count();
        assert!((4_700..5_300).contains(&lost), "{lost}");
        assert!(all.iter().zip(&some).all(|(one, other)| other.is_none() || one == other));
        assert!(drawn("dist:uniform:0:1s:loss=1", "a").iter().all(Option::is_none));
    }
}
