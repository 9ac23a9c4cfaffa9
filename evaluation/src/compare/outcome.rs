//! Whether a drive passed, and if not, why: by its end and its flags in `results.parquet`.

use results::parquet::{ParquetError, Table};
use serde::Serialize;

/// What makes a drive a failure. Softer rules (speeding, comfort, time to collision) are figures and fail nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// The planner or predictor died, was late, or made no sense.
    DriverFailed,
    /// Under `strict` one that the AV is at fault for, or that ended the episode; under `paper` any.
    Collision,
    /// The AV left the route's corridor.
    OffRoute,
    /// `paper`: no lane had the AV's heading any more.
    RouteLost,
    /// A corner was beyond the road's edge.
    OffRoad,
    /// The front bumper crossed a stop point at red.
    RedLight,
    /// The AV drove against its lane.
    WrongWay,
}

/// Every fault, with the end that it makes, if it makes one, its column under `strict` and under `paper`.
const FAULTS: [(Fault, &str, Option<&str>, Option<&str>); 7] = [
    (Fault::DriverFailed, "driver-failed", None, None),
    (Fault::Collision, "collision", Some("at_fault_collision"), Some("collision")),
    (Fault::OffRoute, "off-route", Some("off_route"), Some("off_route")),
    (Fault::RouteLost, "route-lost", None, None),
    (Fault::OffRoad, "off-road", Some("off_road"), None),
    (Fault::RedLight, "red-light", Some("red_light"), None),
    (Fault::WrongWay, "wrong-way", Some("wrong_way"), None),
];

impl Fault {
    /// As tables call it; of those that end an episode it is the name of that end.
    #[must_use]
    pub fn name(self) -> &'static str {
        FAULTS.iter().find(|(fault, ..)| *fault == self).map_or("", |(_, name, ..)| name)
    }

    /// Its flag in `results.parquet` and `steps.parquet`; none where nothing but the end tells it.
    #[must_use]
    pub fn column(self, protocol: &str) -> Option<&'static str> {
        let (.., strict, paper) = FAULTS.iter().find(|(fault, ..)| *fault == self)?;
        if protocol == "paper" { *paper } else { *strict }
    }

    /// The columns of `steps.parquet` that tell faults under `protocol`.
    #[must_use]
    pub fn columns(protocol: &str) -> Vec<&'static str> {
        Self::all().filter_map(|fault| fault.column(protocol)).collect()
    }

    /// Each fault that has a column in `steps`, with its flag in every row.
    ///
    /// # Errors
    /// [`ParquetError`] where a column was not read.
    pub fn flags(steps: &Table, protocol: &str) -> Result<Vec<(Self, Vec<bool>)>, ParquetError> {
        let columns = Self::all().filter_map(|fault| Some((fault, fault.column(protocol)?)));
        columns.map(|(fault, column)| Ok((fault, steps.flags(column)?))).collect()
    }

    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> {
        FAULTS.iter().map(|(fault, ..)| *fault)
    }
}

/// The faults of an episode that ended as `end`; `failed` as in `results.parquet`, `is_set` says whether a column is not 0. What could not be
/// judged (null) is no fault.
#[must_use]
pub fn faults(protocol: &str, end: &str, failed: bool, is_set: impl Fn(&str) -> bool) -> Vec<Fault> {
    let has = |fault: &Fault| {
        let flagged = fault.column(protocol).is_some_and(&is_set);
        // Also what ended without a reason has no result.
        fault.name() == end || flagged || (*fault == Fault::DriverFailed && failed && end != UNDRIVABLE)
    };
    Fault::all().filter(has).collect()
}

/// The end of an episode whose scene nobody could drive: it says nothing about the driver.
pub const UNDRIVABLE: &str = "undrivable";

#[cfg(test)]
mod tests {
    use super::*;

    fn strict(end: &str, set: &[&str]) -> Vec<Fault> {
        faults("strict", end, end == "driver-failed" || end == "unknown", |column| set.contains(&column))
    }

    #[test]
    fn a_drive_to_the_horizon_without_a_flag_passes() {
        assert_eq!(strict("horizon", &[]), []);
        assert_eq!(strict("log-end", &["collision", "speeding", "comfort"]), [], "not at fault; soft rules");
    }

    #[test]
    fn ends_and_flags_are_faults_once() {
        assert_eq!(strict("collision", &["collision", "at_fault_collision"]), [Fault::Collision]);
        assert_eq!(strict("horizon", &["at_fault_collision"]), [Fault::Collision], "ending-collision = none");
        assert_eq!(strict("collision", &["collision"]), [Fault::Collision], "ending-collision = any");
        assert_eq!(strict("off-route", &["off_route", "off_road"]), [Fault::OffRoute, Fault::OffRoad]);
        assert_eq!(strict("horizon", &["red_light", "wrong_way"]), [Fault::RedLight, Fault::WrongWay]);
    }

    #[test]
    fn a_drive_without_a_result_is_a_failure_and_an_undrivable_scene_is_nobodys() {
        assert_eq!(strict("driver-failed", &[]), [Fault::DriverFailed]);
        assert_eq!(strict("unknown", &[]), [Fault::DriverFailed]);
        assert_eq!(strict(UNDRIVABLE, &[]), []);
        assert_eq!(faults("strict", UNDRIVABLE, true, |_| false), []);
    }

    #[test]
    fn under_paper_every_collision_counts_and_lost_routes_do() {
        assert_eq!(faults("paper", "route-lost", false, |_| false), [Fault::RouteLost]);
        assert_eq!(faults("paper", "collision", false, |column| column == "collision"), [Fault::Collision]);
        assert_eq!(faults("paper", "horizon", false, |column| column == "red_light"), []);
    }
}
