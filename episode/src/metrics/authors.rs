//! Under `paper`: the ten numbers and two flags of the authors' code, as it computes them (`dipp/closed-loop.md` section 7).
//! Where that gives NaN there is no value.

use wire::proto;
use world::geometry::Pose;

use super::drive::pose;
use super::paper::{Comfort, comfort, progress};
use super::{Counted, METRICS, flag};

/// With fewer logged states than these the authors' code cannot compute position errors.
const LOGGED_STATES: usize = 120;

/// A drive as the authors measure it.
struct Facts<'a> {
    records: &'a [proto::StepRecord],
    /// The logged AV, by log index.
    logged: &'a [Option<Pose>],
    driven: Vec<Pose>,
    counted: Counted<'a>,
    comfort: Comfort,
    human_comfort: Comfort,
}

impl Facts<'_> {
    /// How a flag stands at the last step.
    fn last(&self, rule: fn(&proto::StepRecord) -> bool) -> Option<f64> {
        let counts = self.counted.has(self.records.len().saturating_sub(1));
        self.records.last().map(|record| counts && rule(record)).and_then(flag)
    }

    /// Distance to the logged AV (m) after so many steps; a drive that ended before stays where it was.
    fn position_error(&self, steps: usize) -> Option<f64> {
        let start = self.records.first()?.log_index as usize;
        let place = self.driven.get(steps - 1).or(self.driven.last())?;
        if !self.counted.has(steps.min(self.driven.len()) - 1) {
            return None;
        }
        let human = self.logged.get(start + steps - 1).copied().flatten()?;
        (self.logged.len() >= LOGGED_STATES).then(|| place.position().distance(human.position()))
    }
}

type Value = fn(&Facts<'_>) -> Option<f64>;

/// What the authors measure, by the names of [`METRICS`].
const MEASURED: [(&str, Value); 12] = [
    ("collision", |f| f.last(|record| record.collision)),
    ("off_route", |f| f.last(|record| record.off_route)),
    ("progress_m", |f| progress(&f.driven, f.counted)),
    ("mean_abs_acceleration_mps2", |f| f.comfort.acceleration),
    ("mean_abs_jerk_mps3", |f| f.comfort.jerk),
    ("mean_abs_lateral_acceleration_mps2", |f| f.comfort.lateral_acceleration),
    ("human_mean_abs_acceleration_mps2", |f| f.human_comfort.acceleration),
    ("human_mean_abs_jerk_mps3", |f| f.human_comfort.jerk),
    ("human_mean_abs_lateral_acceleration_mps2", |f| f.human_comfort.lateral_acceleration),
    ("position_error_3s_m", |f| f.position_error(30)),
    ("position_error_5s_m", |f| f.position_error(50)),
    ("position_error_10s_m", |f| f.position_error(100)),
];

/// Whether the authors measure the metric of this name.
#[must_use]
pub fn is_measured(name: &str) -> bool {
    MEASURED.iter().any(|(measured, _)| *measured == name)
}

/// All metrics of a drive under `paper`, in the order of [`METRICS`]; `logged` is the logged AV by log index.
#[must_use]
pub fn measure(records: &[proto::StepRecord], logged: &[Option<Pose>], counted: Counted<'_>) -> Vec<Option<f64>> {
    let driven: Vec<Pose> = records.iter().map(pose).collect();
    let human = records.iter().map(|record| logged.get(record.log_index as usize).copied().flatten());
    let human: Option<Vec<Pose>> = human.collect();
    let facts = Facts {
        records,
        logged,
        comfort: comfort(&driven, counted),
        human_comfort: human.map(|human| comfort(&human, counted)).unwrap_or_default(),
        counted,
        driven,
    };
    let value = |name: &str| MEASURED.iter().find(|(measured, _)| *measured == name)?.1(&facts);
    METRICS.iter().map(|metric| value(metric.name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// So many steps at 10 m/s, of a log of so many states at 8 m/s.
    fn measured(steps: u32, states: u32, last: impl Fn(&mut proto::StepRecord)) -> impl Fn(&str) -> Option<f64> {
        let record = |step: u32| proto::StepRecord {
            step,
            log_index: 20 + step,
            av: Some(proto::AgentState { x: f64::from(step + 1), ..proto::AgentState::default() }),
            ..proto::StepRecord::default()
        };
        let mut records: Vec<_> = (0..steps).map(record).collect();
        records.last_mut().into_iter().for_each(last);
        let logged: Vec<_> = (0..states).map(|at| Some(Pose::new(0.8 * (f64::from(at) - 19.0), 0.0, 0.0))).collect();
        let values = measure(&records, &logged, Counted::ALL);
        move |name| METRICS.iter().zip(&values).find(|(metric, _)| metric.name == name).unwrap().1.to_owned()
    }

    #[test]
    fn every_name_is_a_metric() {
        for (name, _) in MEASURED {
            assert!(METRICS.iter().any(|metric| metric.name == name), "{name}");
        }
    }

    #[test]
    fn a_drive_that_ended_early_is_measured_where_it_stopped() {
        let value = measured(40, 200, |_| {});
        let near = |name: &str, wanted: f64| assert!((value(name).unwrap() - wanted).abs() < 1e-9, "{name}");
        near("progress_m", 39.0);
        near("position_error_3s_m", 30.0 - 24.0);
        near("position_error_5s_m", 40.0 - 40.0);
        near("position_error_10s_m", 80.0 - 40.0);
        near("mean_abs_acceleration_mps2", 0.0);
        near("human_mean_abs_jerk_mps3", 0.0);
        assert_eq!(value("nuplan_score"), None, "not the authors'");
    }

    #[test]
    fn flags_are_those_of_the_last_step() {
        let value = measured(5, 200, |record| record.collision = true);
        assert_eq!((value("collision"), value("off_route")), (Some(1.0), Some(0.0)));
        assert_eq!(measured(0, 200, |_| {})("collision"), None);
    }

    #[test]
    fn what_is_not_a_number_in_their_code_is_missing() {
        assert_eq!(measured(2, 200, |_| {})("mean_abs_acceleration_mps2"), None);
        assert_eq!(measured(3, 200, |_| {})("mean_abs_jerk_mps3"), None);
        assert_eq!(measured(40, 119, |_| {})("position_error_3s_m"), None);
        assert!(measured(40, 120, |_| {})("position_error_10s_m").is_some());
    }
}
