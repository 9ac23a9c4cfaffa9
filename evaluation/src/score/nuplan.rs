//! nuPlan's closed-loop score: the terms that `strict` measures (`episode::metrics::nuplan`).

use episode::metrics::METRICS;
use episode::protocol::{Protocol, StrictSettings};

use super::figure::Figure;
use super::strict::figure;

/// The metrics, in their order.
pub(super) fn metrics() -> impl Iterator<Item = &'static str> {
    METRICS.iter().map(|metric| metric.name).filter(|name| name.starts_with("nuplan_"))
}

/// The figures.
pub(super) fn figures() -> Vec<Figure> {
    let head = |name: &str| -> Option<&'static [&'static str]> {
        Some(match name {
            "nuplan_no_at_fault_collision" => &["NC", "", ""],
            "nuplan_drivable_area" => &["DAC", "", ""],
            "nuplan_driving_direction" => &["DDC", "", ""],
            "nuplan_making_progress" => &["MP", "", ""],
            "nuplan_progress" => &["EP", "", ""],
            "nuplan_time_to_collision" => &["TTC", "", ""],
            "nuplan_speed_limit" => &["SL", "", ""],
            "nuplan_comfort" => &["C", "", ""],
            _ => return None,
        })
    };
    let with_head = |name: &'static str| match head(name) {
        Some(head) => figure("", name).mean(head, 3),
        None => figure("", name),
    };
    metrics().map(with_head).collect()
}

/// Whether a run under `protocol` has them in `results.parquet`. Which contact ends a drive and how wide its corridor is are not asked:
/// a drive that was ended has the terms of what was driven, as nuPlan would have of a log that is as long.
pub(super) fn is_as_driven(protocol: &Protocol) -> bool {
    match protocol {
        Protocol::Strict(settings) => settings.wheelbase == StrictSettings::default().wheelbase,
        Protocol::Paper => false,
    }
}
