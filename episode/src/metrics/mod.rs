//! What a drive was worth: every metric by name, unit and definition, in one table. Names are the columns of
//! `results.parquet`; `docs/metrics.md` has formulas and sources.
//!
//! | module | what |
//! | --- | --- |
//! | [`paper`] | the paper's metrics, by its code |
//! | [`authors`] | which of all there are under `paper`, and where they are more forgiving there |
//! | [`comfort`], [`savitzky_golay`] | nuPlan's comfort bounds and the filter in them |
//! | [`nuplan`] | nuPlan's closed-loop score, by its code |
//! | [`feasibility`] | whether a car could have driven so, by Waymax's code |

pub mod authors;
pub mod comfort;
mod counted;
mod drive;
pub mod feasibility;
pub mod nuplan;
pub mod paper;
pub mod savitzky_golay;

use world::scene::Judgement;

pub use counted::Counted;
pub use drive::{Drive, Facts, NettedStep, Start};

/// One metric of an episode.
#[derive(Clone, Copy)]
pub struct Metric {
    /// Its name, with its unit: the column of `results.parquet`.
    pub name: &'static str,
    /// Its unit, as people write it; `0/1` for what is so or not, empty for a share or a score.
    pub unit: &'static str,
    /// What it says, in a sentence.
    pub meaning: &'static str,
    value: fn(&Facts) -> Option<f64>,
}

/// All metrics of a drive under `strict`, in the order of [`METRICS`]; `None` where a metric is not defined.
#[must_use]
pub fn measure(drive: &Drive<'_>) -> Vec<Option<f64>> {
    let facts = Facts::of(drive);
    METRICS.iter().map(|metric| (metric.value)(&facts)).collect()
}

/// The values of an episode that was not driven.
#[must_use]
pub fn nothing_measured() -> Vec<Option<f64>> {
    vec![None; METRICS.len()]
}

fn flag(is_so: bool) -> Option<f64> {
    Some(f64::from(u8::from(is_so)))
}

macro_rules! metrics {
    ($($name:literal, $unit:literal, $meaning:literal, $value:expr;)*) => {
        &[$(Metric { name: $name, unit: $unit, meaning: $meaning, value: $value }),*]
    };
}

/// Every metric, in the order of all files and tables.
#[rustfmt::skip]
pub const METRICS: &[Metric] = metrics![
    "collision", "0/1", "the AV's box met an agent's, whoever's fault, where the logged AV did not", |f| f.collision(f.contacts > 0);
    "at_fault_collision", "0/1", "such a contact for which the AV is at fault", |f| f.collision(f.at_fault > 0);
    "contacts", "", "tracks that the AV's box met", |f| Some(f.contacts as f64);
    "contacts_netted", "", "tracks that the AV's box met where the logged AV met them too: not counted above", |f| Some(f.netted_contacts as f64);
    "impact_relative_speed_mps", "m/s", "the highest relative speed of the counted contacts; none without one", |f| f.relative_speed;
    "off_route", "0/1", "the AV's centre left the route's corridor", |f| flag(f.off_route);
    "off_road", "0/1", "a corner was beyond the road's edge", |f| f.judged(Judgement::OffRoad, flag(f.off_road));
    "red_light", "0/1", "the front bumper crossed a stop point of the route at red", |f| flag(f.red_light);
    "wrong_way", "0/1", "the AV drove 2 m or more against its lane within a second", |f| f.judged(Judgement::WrongWay, flag(f.wrong_way));
    "speeding", "0/1", "the AV drove more than 2.23 m/s above the speed limit", |f| f.judged(Judgement::Speeding, flag(f.speeding));
    "progress_m", "m", "length of the path driven, without the first step (the paper's)", |f| f.progress;
    "mean_abs_acceleration_mps2", "m/s^2", "mean magnitude of longitudinal acceleration (the paper's)", |f| f.comfort.acceleration;
    "mean_abs_jerk_mps3", "m/s^3", "mean magnitude of longitudinal jerk (the paper's)", |f| f.comfort.jerk;
    "mean_abs_lateral_acceleration_mps2", "m/s^2", "mean magnitude of the change of body-frame lateral velocity (the paper's; not centripetal)", |f| f.comfort.lateral_acceleration;
    "human_mean_abs_acceleration_mps2", "m/s^2", "the same of the logged AV over the same steps", |f| f.human_comfort.acceleration;
    "human_mean_abs_jerk_mps3", "m/s^3", "the same of the logged AV over the same steps", |f| f.human_comfort.jerk;
    "human_mean_abs_lateral_acceleration_mps2", "m/s^2", "the same of the logged AV over the same steps", |f| f.human_comfort.lateral_acceleration;
    "position_error_3s_m", "m", "distance to the logged AV after 3 s, where both are there (the paper's repeats the last pose)", |f| f.position_errors[0];
    "position_error_5s_m", "m", "the same after 5 s", |f| f.position_errors[1];
    "position_error_10s_m", "m", "the same after 10 s", |f| f.position_errors[2];
    "route_progress_m", "m", "arc length along the reference line from start to end", |f| f.route_progress;
    "human_route_progress_m", "m", "the same of the logged AV, to the horizon", |f| f.human_route_progress;
    "progress_ratio", "", "route progress over the human's; none where the human made less than 2 m", |f| f.progress_ratio();
    "speed_limit_compliance", "", "share of the steps with a known speed limit at which it was kept", |f| f.speed_limit_compliance;
    "min_time_to_collision_s", "s", "the least time to collision; none where nothing came within 2.9 s", |f| f.time_to_collision;
    "min_acceleration_mps2", "m/s^2", "least longitudinal acceleration, filtered (nuPlan: above -4.05)", |f| f.extremes.map(|e| e.least_acceleration);
    "max_acceleration_mps2", "m/s^2", "greatest longitudinal acceleration, filtered (nuPlan: below 2.40)", |f| f.extremes.map(|e| e.greatest_acceleration);
    "max_abs_lateral_acceleration_mps2", "m/s^2", "greatest magnitude of speed times yaw rate, filtered (nuPlan: below 4.89)", |f| f.extremes.map(|e| e.lateral_acceleration);
    "max_abs_yaw_rate_radps", "rad/s", "greatest magnitude of yaw rate, filtered (nuPlan: below 0.95)", |f| f.extremes.map(|e| e.yaw_rate);
    "max_abs_yaw_acceleration_radps2", "rad/s^2", "greatest magnitude of yaw acceleration, filtered (nuPlan: below 1.93)", |f| f.extremes.map(|e| e.yaw_acceleration);
    "max_abs_longitudinal_jerk_mps3", "m/s^3", "greatest magnitude of longitudinal jerk, filtered (nuPlan: below 4.13)", |f| f.extremes.map(|e| e.longitudinal_jerk);
    "max_abs_jerk_mps3", "m/s^3", "greatest magnitude of the change of acceleration's magnitude, filtered (nuPlan: below 8.37)", |f| f.extremes.map(|e| e.jerk);
    "comfort", "0/1", "all seven extremes above are within nuPlan's bounds", |f| f.extremes.and_then(|e| flag(e.are_comfortable()));
    "kinematic_infeasibility", "0/1", "no car gets from some state to the next: |acceleration| above 10.4 m/s^2 or |curvature| above 0.3 1/m (Waymax's)", |f| flag(f.infeasible);
    "nuplan_min_acceleration_mps2", "m/s^2", "least longitudinal acceleration as nuPlan's code reads it (above -4.05)", |f| f.nuplan_extremes.map(|e| e.least_acceleration);
    "nuplan_max_acceleration_mps2", "m/s^2", "greatest longitudinal acceleration as nuPlan's code reads it (below 2.40)", |f| f.nuplan_extremes.map(|e| e.greatest_acceleration);
    "nuplan_max_abs_longitudinal_jerk_mps3", "m/s^3", "greatest magnitude of longitudinal jerk as nuPlan's code reads it (below 4.13)", |f| f.nuplan_extremes.map(|e| e.longitudinal_jerk);
    "nuplan_max_abs_jerk_mps3", "m/s^3", "greatest magnitude of jerk as nuPlan's code reads it (below 8.37)", |f| f.nuplan_extremes.map(|e| e.jerk);
    "nuplan_no_at_fault_collision", "", "NC: 1, 1/2 after one at-fault hit of an object, 0 after any other", |f| f.terms.no_collision;
    "nuplan_drivable_area", "", "DAC: 0 if a corner was 0.3 m or more beyond the road's edge and outside of the AV's lanes", |f| f.terms.drivable_area;
    "nuplan_driving_direction", "", "DDC: 1, 1/2 or 0 by the backward travel within a second", |f| f.terms.direction;
    "nuplan_making_progress", "", "MP: 1 if EP is at least 0.2", |f| f.terms.making_progress;
    "nuplan_progress", "", "EP: route progress over the human's, both at least 2 m, at most 1", |f| f.terms.progress;
    "nuplan_time_to_collision", "", "TTC: 1 if the time to collision never falls below 0.95 s", |f| f.terms.time_to_collision;
    "nuplan_speed_limit", "", "SL: 1 less the mean speed above the limit over 2.23 m/s, at least 0", |f| f.terms.speed_limit;
    "nuplan_comfort", "", "C: 1 if all extremes, as nuPlan's code reads them, are within their bounds", |f| f.terms.comfort;
    "nuplan_score", "", "NC DAC DDC MP (5 EP + 5 TTC + 4 SL + 2 C) / 16; 0 after leaving the route; none of fewer than 4 steps", |f| f.score();
    "nuplan_terms", "", "of how many of the eight terms the score is made: those that can be judged", |f| Some(f.terms.judged() as f64);
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_are_unique_and_end_in_their_unit() {
        let names: BTreeSet<&str> = METRICS.iter().map(|metric| metric.name).collect();
        assert_eq!(names.len(), METRICS.len());
        for metric in METRICS {
            let suffix = match metric.unit {
                "m" => "_m",
                "s" => "_s",
                "m/s" => "_mps",
                "m/s^2" => "_mps2",
                "m/s^3" => "_mps3",
                "rad/s" => "_radps",
                "rad/s^2" => "_radps2",
                "" | "0/1" => "",
                other => panic!("{}: unit {other} has no suffix", metric.name),
            };
            assert!(metric.name.ends_with(suffix), "{}", metric.name);
        }
    }

    #[test]
    fn the_documentation_defines_every_metric() {
        let page = include_str!("../../../docs/metrics.md");
        for metric in METRICS {
            assert!(page.contains(&format!("`{}`", metric.name)), "docs/metrics.md does not define {}", metric.name);
        }
    }
}
