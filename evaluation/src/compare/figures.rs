//! Which figures are compared, and which way each is better; one of them compared.

use std::fmt;

use episode::metrics::{METRICS, authors};
use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use serde::Serialize;

use super::statistics::proportion::mcnemar;
use super::statistics::{Interval, LEVEL, bootstrap, power, signs};

/// Which way a figure is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Better {
    /// More is better.
    Higher,
    /// Less is better.
    Lower,
}

use Better::{Higher, Lower};

/// Whether the drive passed: no metric of the drive, but compared as one.
pub const PASSED: &str = "passed";

/// What is compared, in the order of reports: [`PASSED`], then columns of `results.parquet`.
#[rustfmt::skip]
pub const FIGURES: &[(&str, Better)] = &[
    (PASSED, Higher),
    ("collision", Lower), ("at_fault_collision", Lower), ("contacts", Lower), ("impact_relative_speed_mps", Lower),
    ("off_route", Lower), ("off_road", Lower), ("red_light", Lower), ("wrong_way", Lower), ("speeding", Lower),
    ("nuplan_score", Higher), ("nuplan_no_at_fault_collision", Higher), ("nuplan_drivable_area", Higher),
    ("nuplan_driving_direction", Higher), ("nuplan_making_progress", Higher), ("nuplan_progress", Higher),
    ("nuplan_time_to_collision", Higher), ("nuplan_speed_limit", Higher), ("nuplan_comfort", Higher),
    ("progress_m", Higher), ("route_progress_m", Higher), ("progress_ratio", Higher),
    ("min_time_to_collision_s", Higher), ("speed_limit_compliance", Higher),
    ("position_error_3s_m", Lower), ("position_error_5s_m", Lower), ("position_error_10s_m", Lower),
    ("mean_abs_acceleration_mps2", Lower), ("mean_abs_jerk_mps3", Lower), ("mean_abs_lateral_acceleration_mps2", Lower),
    ("comfort", Higher), ("min_acceleration_mps2", Higher), ("max_acceleration_mps2", Lower),
    ("max_abs_lateral_acceleration_mps2", Lower), ("max_abs_yaw_rate_radps", Lower), ("max_abs_yaw_acceleration_radps2", Lower),
    ("max_abs_longitudinal_jerk_mps3", Lower), ("max_abs_jerk_mps3", Lower), ("kinematic_infeasibility", Lower),
];

/// A difference below this, in any unit, is one of rounding, and none.
const ROUNDING: f64 = 1e-9;

/// What a figure says about B.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The difference is hardly chance, and for the better.
    Better,
    /// The difference is hardly chance, and for the worse.
    Worse,
    /// It may be chance: the interval holds 0, or p is not below 0.05.
    NotDistinguishable,
    /// No pair differs.
    Same,
    /// No pair has a value in both runs.
    NoValue,
}

/// A figure of A and B over the pairs in which both have it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// Its column in `results.parquet`, or [`PASSED`].
    pub name: &'static str,
    /// Its unit; `0/1` for what is so or not, whose means are shares.
    pub unit: &'static str,
    /// Which way it is better.
    pub better: Better,
    /// Pairs in which both runs have a value: n.
    pub pairs: usize,
    /// Of those, pairs in which the values differ.
    pub differing: usize,
    /// A's mean over those pairs.
    pub a: Option<f64>,
    /// B's mean over those pairs.
    pub b: Option<f64>,
    /// The mean of B - A.
    pub difference: Option<f64>,
    /// Its 95 % interval (BCa).
    pub interval: Option<Interval>,
    /// The difference that so many pairs with this spread would show four times out of five.
    pub detectable: Option<f64>,
    /// The chance of a difference at least so large if A and B drove alike: the sign-flip test, where all values are 0 or 1 McNemar's.
    pub p: Option<f64>,
    /// How many resamples the interval is from, and choices of signs p, where there are many.
    pub resamples: usize,
    /// What it says.
    pub verdict: Verdict,
}

impl Figure {
    /// The figure of these name and values, a pair each.
    #[must_use]
    pub fn of(name: &'static str, better: Better, pairs: &[(f64, f64)], seed: u64) -> Self {
        let off = |difference: f64| if difference.abs() < ROUNDING { 0.0 } else { difference };
        let differences: Vec<f64> = pairs.iter().map(|(a, b)| off(b - a)).collect();
        let differing = differences.iter().filter(|difference| **difference != 0.0).count();
        let mean = |values: &mut dyn Iterator<Item = f64>| {
            (!pairs.is_empty()).then(|| values.sum::<f64>() / pairs.len() as f64).filter(|mean| mean.is_finite())
        };
        let difference = mean(&mut differences.iter().copied());
        let resamples = bootstrap::resamples(pairs.len());
        let interval = bootstrap::mean_interval(&differences, seed, resamples);
        let two_valued = pairs.iter().all(|(a, b)| [a, b].iter().all(|value| **value == 0.0 || **value == 1.0));
        let ups = differences.iter().filter(|difference| **difference > 0.0).count();
        let p = match two_valued && !pairs.is_empty() {
            true => Some(mcnemar(ups, differing - ups)),
            false => signs::mean_chance(&differences, seed, resamples),
        };
        // Of few or skewed differences the bootstrap alone is too bold (up to one false alarm in five); the test is exact.
        let told = p.is_some_and(|p| p < LEVEL) && interval.is_some_and(|interval| !interval.holds(0.0));
        let verdict = match difference {
            None => Verdict::NoValue,
            Some(_) if differing == 0 => Verdict::Same,
            Some(difference) if told && (difference > 0.0) == (better == Higher) => Verdict::Better,
            Some(_) if told => Verdict::Worse,
            Some(_) => Verdict::NotDistinguishable,
        };
        Self {
            name,
            unit: unit(name),
            better,
            pairs: pairs.len(),
            differing,
            a: mean(&mut pairs.iter().map(|pair| pair.0)),
            b: mean(&mut pairs.iter().map(|pair| pair.1)),
            difference,
            interval: interval.filter(|_| differing > 0),
            detectable: power::detectable_mean(&differences),
            p,
            resamples,
            verdict,
        }
    }

    /// Whether its means are shares of scenes.
    #[must_use]
    pub fn is_share(&self) -> bool {
        self.unit == "0/1"
    }
}

/// The values of A and of B in a scene.
pub type ValuePair<'a> = (&'a [Option<f64>], &'a [Option<f64>]);

/// All figures of these pairs; the values of a pair stand in the order of [`FIGURES`].
#[must_use]
pub fn compare(protocol: &str, pairs: &[ValuePair<'_>], seed: u64) -> Vec<Figure> {
    let known = |name: &str| name == PASSED || protocol != "paper" || authors::is_measured(name);
    let wanted: Vec<_> = FIGURES.iter().enumerate().filter(|(_, (name, _))| known(name)).collect();
    let figure = |(at, (name, better)): &(usize, &(&'static str, Better))| {
        let value = |values: &[Option<f64>]| values.get(*at).copied().flatten().filter(|value| value.is_finite());
        let both = pairs.iter().filter_map(|(a, b)| Some((value(a)?, value(b)?)));
        Figure::of(name, *better, &both.collect::<Vec<_>>(), seed)
    };
    // Each in the place of its name, whichever thread is done first.
    wanted.par_iter().map(figure).collect()
}

/// Whether the means of the figure of this name are shares of scenes.
#[must_use]
pub fn is_share(name: &str) -> bool {
    unit(name) == "0/1"
}

/// The unit of a figure.
fn unit(name: &str) -> &'static str {
    METRICS.iter().find(|metric| metric.name == name).map_or("0/1", |metric| metric.unit)
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Better => "better",
            Self::Worse => "worse",
            Self::NotDistinguishable => "not distinguishable",
            Self::Same => "the same",
            Self::NoValue => "no value",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is measured and not compared: the human, what only explains another figure, what counts what was judged.
    const LEFT_OUT: [&str; 10] = [
        "contacts_netted",
        "human_mean_abs_acceleration_mps2",
        "human_mean_abs_jerk_mps3",
        "human_mean_abs_lateral_acceleration_mps2",
        "human_route_progress_m",
        "nuplan_min_acceleration_mps2",
        "nuplan_max_acceleration_mps2",
        "nuplan_max_abs_longitudinal_jerk_mps3",
        "nuplan_max_abs_jerk_mps3",
        "nuplan_terms",
    ];

    #[test]
    fn every_metric_is_compared_or_left_out_on_purpose() {
        for metric in METRICS {
            let compared = FIGURES.iter().filter(|(name, _)| *name == metric.name).count();
            assert_eq!(compared, usize::from(!LEFT_OUT.contains(&metric.name)), "{}", metric.name);
        }
        assert_eq!(FIGURES.len() + LEFT_OUT.len(), METRICS.len() + 1);
    }

    #[test]
    fn the_documentation_tells_which_way_every_figure_is_better() {
        let page = include_str!("../../../docs/compare.md");
        for (name, _) in FIGURES {
            assert!(page.contains(&format!("`{name}`")), "docs/compare.md does not list {name}");
        }
    }

    #[test]
    fn a_shift_of_all_is_told_and_the_sense_decides() {
        let pairs: Vec<(f64, f64)> =
            (0..30).map(|at| (f64::from(at), f64::from(at) + 1.0 + f64::from(at % 3))).collect();
        let figure = |better| Figure::of("progress_m", better, &pairs, 0);
        assert_eq!((figure(Higher).verdict, figure(Lower).verdict), (Verdict::Better, Verdict::Worse));
        assert_eq!((figure(Higher).difference, figure(Higher).differing), (Some(2.0), 30));
        assert!(figure(Higher).interval.unwrap().holds(2.0));
    }

    #[test]
    fn few_pairs_that_differ_tell_nothing_however_large_the_difference() {
        let pairs = |differing: usize| -> Vec<(f64, f64)> {
            (0..200).map(|at| (1.0, if at < differing { 100.0 + at as f64 } else { 1.0 })).collect()
        };
        let verdict = |differing| Figure::of("progress_m", Higher, &pairs(differing), 0).verdict;
        assert_eq!([0, 5, 6].map(verdict), [Verdict::Same, Verdict::NotDistinguishable, Verdict::Better]);
    }

    #[test]
    fn what_is_so_or_not_goes_by_mcnemars_test() {
        let pairs =
            |flips: usize| -> Vec<(f64, f64)> { (0..100).map(|at| (0.0, f64::from(u8::from(at < flips)))).collect() };
        let five = Figure::of("red_light", Lower, &pairs(5), 0);
        assert!((five.p.unwrap() - 0.0625).abs() < 1e-9);
        assert_eq!(five.verdict, Verdict::NotDistinguishable);
        assert_eq!(Figure::of("red_light", Lower, &pairs(6), 0).verdict, Verdict::Worse);
        assert_eq!(Figure::of("red_light", Lower, &[], 0).verdict, Verdict::NoValue);
    }

    #[test]
    fn what_rounding_makes_is_no_difference() {
        let pairs: Vec<(f64, f64)> = (0..30).map(|at| (0.0, 1e-12 * f64::from(at))).collect();
        assert_eq!(Figure::of("progress_m", Higher, &pairs, 0).verdict, Verdict::Same);
    }

    #[test]
    fn a_pair_counts_where_both_have_the_number() {
        let at = FIGURES.iter().position(|(name, _)| *name == "position_error_10s_m").unwrap();
        let row = |value: Option<f64>| {
            let mut values = vec![None; FIGURES.len()];
            values[at] = value;
            values
        };
        let (a, b) =
            ([row(Some(1.0)), row(None), row(Some(3.0))], [row(Some(2.0)), row(Some(9.0)), row(Some(f64::INFINITY))]);
        let pairs: Vec<ValuePair<'_>> = a.iter().zip(&b).map(|(a, b)| (&**a, &**b)).collect();
        let figures = compare("strict", &pairs, 0);
        assert_eq!((figures[at].pairs, figures[at].difference, figures[at].interval), (1, Some(1.0), None));
        assert_eq!(figures[0].verdict, Verdict::NoValue);
        let paper: Vec<&str> = compare("paper", &pairs, 0).iter().map(|figure| figure.name).collect();
        assert!(paper.contains(&"collision") && !paper.contains(&"nuplan_score"), "{paper:?}");
    }
}
