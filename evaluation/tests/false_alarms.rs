//! How often a comparison tells a difference where there is none: a thousand simulated pairs of runs whose A and B are drawn alike.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints its table")]

use evaluation::compare::figures::{Better, Figure, Verdict};
use evaluation::compare::statistics::proportion::mcnemar;
use rayon::prelude::*;
use world::pcg::Pcg32;

const COMPARISONS: u64 = 1_000;

/// Values that A and B have in a scene.
type Draw = fn(&mut Pcg32) -> (f64, f64);

fn uniform(generator: &mut Pcg32) -> f64 {
    // Never 0: its logarithm is asked for.
    generator.between(1e-9, 1.0)
}

fn normal(generator: &mut Pcg32) -> f64 {
    let radius = (-2.0 * libm::log(uniform(generator))).sqrt();
    radius * libm::cos(std::f64::consts::TAU * uniform(generator))
}

fn flag(generator: &mut Pcg32, share: f64) -> f64 {
    f64::from(u8::from(uniform(generator) < share))
}

/// Figures as drives have them. In each the scene adds the same to both.
const KINDS: [(&str, Draw); 6] = [
    ("normal", |g| {
        let scene = 10.0 * normal(g);
        (scene + normal(g), scene + normal(g))
    }),
    ("long tails", |g| (libm::exp(normal(g)), libm::exp(normal(g)))),
    ("one in five differs", |g| {
        let differs = flag(g, 0.2);
        (1.0 - differs * uniform(g), 1.0 - differs * uniform(g))
    }),
    ("a score that is often 0", |g| {
        let score = |g: &mut Pcg32| flag(g, 0.85) * (1.0 - 0.3 * uniform(g));
        (score(g), score(g))
    }),
    ("one in ten is set", |g| (flag(g, 0.1), flag(g, 0.1))),
    ("one in fifty is set", |g| (flag(g, 0.02), flag(g, 0.02))),
];

/// The share of comparisons at which A and B, `pairs` scenes each, are told apart.
fn alarms(pairs: usize, at: usize, draw: Draw) -> f64 {
    let alarm = |comparison: &u64| {
        let mut generator = Pcg32::new(*comparison, 1 + at as u64);
        let values: Vec<(f64, f64)> = (0..pairs).map(|_| draw(&mut generator)).collect();
        let figure = Figure::of("nuplan_score", Better::Higher, &values, *comparison);
        matches!(figure.verdict, Verdict::Better | Verdict::Worse)
    };
    let comparisons: Vec<u64> = (0..COMPARISONS).collect();
    comparisons.par_iter().filter(|comparison| alarm(comparison)).count() as f64 / COMPARISONS as f64
}

#[test]
#[ignore = "takes minutes"]
fn of_a_thousand_null_comparisons_no_more_are_told_apart_than_the_level_says() {
    // 5 %, and three standard errors of a share of a thousand.
    let most = 0.05 + 3.0 * (0.05 * 0.95 / COMPARISONS as f64).sqrt();
    for pairs in [10, 20, 50, 200] {
        for (at, (name, draw)) in KINDS.iter().enumerate() {
            let share = alarms(pairs, at, *draw);
            println!("n = {pairs:3}  {name:24} {:4.1} %", 100.0 * share);
            assert!(share <= most, "{name}, {pairs} pairs: {share}");
        }
    }
    let flips = |comparison: u64| {
        let mut generator = Pcg32::new(comparison, 99);
        let new = (0..40).filter(|_| flag(&mut generator, 0.5) > 0.0).count();
        mcnemar(new, 40 - new) < 0.05
    };
    let share = (0..COMPARISONS).filter(|comparison| flips(*comparison)).count() as f64 / COMPARISONS as f64;
    println!("flips {:.1} %", 100.0 * share);
    assert!(share <= most, "{share}");
}
