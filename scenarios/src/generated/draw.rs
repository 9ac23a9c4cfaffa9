//! What a scene draws: its parameters, and all else that differs from scene to scene.

use std::f64::consts::TAU;

use super::parameters::{Parameter, Parameters};
use world::pcg::Pcg32;

/// Random numbers of one scene, and the values of its parameters.
///
/// Every parameter takes one random number, in the order in which they are declared, before anything else is drawn: giving one
/// changes nothing but what follows from it.
#[derive(Clone, Debug)]
pub(super) struct Draw {
    random: Pcg32,
    /// What this stream and its sub-streams are known by.
    key: u64,
    values: Vec<(&'static str, f64)>,
}

impl Draw {
    /// For scene `index` of `seed`. What is given must have been checked.
    pub(super) fn new<'a>(
        seed: u64,
        index: u32,
        declared: impl Iterator<Item = &'a Parameter>,
        given: &Parameters,
    ) -> Self {
        let mut random = Pcg32::new(seed, u64::from(index));
        let value = |parameter: &Parameter| {
            let [low, high] = given.range(parameter.name).unwrap_or(parameter.default);
            (parameter.name, random.between(low, high))
        };
        let values = declared.map(value).collect();
        Self { random, key: mixed(mixed(seed) ^ u64::from(index)), values }
    }

    /// The scene's value of the parameter `name`, which its family must declare: one that it does not is 1.
    pub(super) fn parameter(&self, name: &str) -> f64 {
        let found = self.values.iter().find(|(known, _)| *known == name);
        debug_assert!(found.is_some(), "the family declares no parameter {name}");
        found.map_or(1.0, |(_, value)| *value)
    }

    /// Numbers that have nothing to do with this draw's, nor with those of another `number`; the same however many this one has
    /// given. Actors with streams of their own stay as they are when another draws more.
    pub(super) fn stream(&self, number: u64) -> Self {
        let key = mixed(self.key ^ mixed(number));
        Self { random: Pcg32::new(key, number), key, values: self.values.clone() }
    }

    /// A number in [`low`, `high`).
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        self.random.between(low, high)
    }

    /// True with probability `probability`.
    pub(super) fn chance(&mut self, probability: f64) -> bool {
        self.random.between(0.0, 1.0) < probability
    }

    /// A number from 0 to before `count`; 0 if that is none.
    pub(super) fn below(&mut self, count: usize) -> usize {
        ((u64::from(self.random.bits()) * count as u64) >> 32) as usize
    }

    /// One of `choices`.
    ///
    /// # Panics
    /// If there are none.
    pub(super) fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }

    /// A number of the normal distribution (Box and Muller, 1958). Always takes two random numbers.
    pub(super) fn normal(&mut self, mean: f64, deviation: f64) -> f64 {
        // In (0, 1], for the logarithm.
        let radius = (-2.0 * libm::log(1.0 - self.random.between(0.0, 1.0))).sqrt();
        mean + deviation * radius * libm::cos(TAU * self.random.between(0.0, 1.0))
    }
}

/// Stafford's thirteenth variant of the finaliser of MurmurHash3, as in SplitMix64: near numbers give far ones.
fn mixed(number: u64) -> u64 {
    let number = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let number = (number ^ (number >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let number = (number ^ (number >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    number ^ (number >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DECLARED: [Parameter; 3] = [
        Parameter { name: "a", about: "", default: [0.0, 1.0], limits: [0.0, 9.0] },
        Parameter { name: "b", about: "", default: [2.0, 3.0], limits: [0.0, 9.0] },
        Parameter { name: "c", about: "", default: [4.0, 5.0], limits: [0.0, 9.0] },
    ];

    fn draw(given: &[&str]) -> Draw {
        Draw::new(7, 3, DECLARED.iter(), &Parameters::read(given).unwrap())
    }

    #[test]
    fn a_given_parameter_changes_nothing_else() {
        let (mut free, mut given) = (draw(&[]), draw(&["b=8"]));
        assert_eq!(given.parameter("b"), 8.0);
        assert_ne!(free.parameter("b"), 8.0);
        for name in ["a", "c"] {
            assert_eq!(free.parameter(name), given.parameter(name));
        }
        assert_eq!(free.between(0.0, 1.0), given.between(0.0, 1.0));
        assert_eq!(free.stream(4).between(0.0, 1.0), given.stream(4).between(0.0, 1.0));
    }

    #[test]
    fn a_stream_is_the_same_however_many_numbers_were_drawn_before() {
        let mut draw = draw(&[]);
        let before = draw.stream(1).between(0.0, 1.0);
        draw.between(0.0, 1.0);
        assert_eq!(draw.stream(1).between(0.0, 1.0), before);
        assert_ne!(draw.stream(2).between(0.0, 1.0), before);
        assert_ne!(draw.stream(1).stream(1).between(0.0, 1.0), before);
        assert_eq!(draw.stream(1).parameter("a"), draw.parameter("a"));
    }

    #[test]
    fn what_is_drawn_is_distributed_as_it_says() {
        const COUNT: usize = 20_000;
        let mut draw = draw(&[]);
        let mut mean =
            |value: &mut dyn FnMut(&mut Draw) -> f64| (0..COUNT).map(|_| value(&mut draw)).sum::<f64>() / COUNT as f64;
        assert!((mean(&mut |draw| draw.normal(3.0, 2.0)) - 3.0).abs() < 0.05);
        let variance = mean(&mut |draw| {
            let off = draw.normal(3.0, 2.0) - 3.0;
            off * off
        });
        assert!((variance - 4.0).abs() < 0.15, "{variance}");
        assert!((mean(&mut |draw| f64::from(u8::from(draw.chance(0.3)))) - 0.3).abs() < 0.01);
        for choice in 0..3 {
            let share = mean(&mut |draw| f64::from(u8::from(draw.below(3) == choice)));
            assert!((share - 1.0 / 3.0).abs() < 0.015, "{choice}: {share}");
        }
        assert_eq!(draw.below(0), 0);
        assert!([5, 6].contains(&draw.pick(&[5, 6])));
    }

    #[test]
    fn scenes_of_one_seed_have_nothing_in_common() {
        // The correlation of each parameter with itself in the next scene, and with its neighbour in the same.
        const COUNT: u32 = 10_000;
        let values = |index| {
            let draw = Draw::new(0, index, DECLARED.iter(), &Parameters::default());
            [draw.parameter("a") - 0.5, draw.parameter("b") - 2.5, draw.parameter("c") - 4.5]
        };
        let all: Vec<[f64; 3]> = (0..=COUNT).map(values).collect();
        let correlation =
            |product: &dyn Fn(usize) -> f64| 12.0 * (0..COUNT as usize).map(product).sum::<f64>() / f64::from(COUNT);
        for k in 0..3 {
            let next = correlation(&|index| all[index][k] * all[index + 1][k]);
            let beside = correlation(&|index| all[index][k] * all[index][(k + 1) % 3]);
            assert!(next.abs() < 0.04 && beside.abs() < 0.04, "{k}: {next} {beside}");
        }
    }
}
