//! The score of `strict`: its metrics but nuPlan's, which are a score of their own.

use episode::metrics::METRICS;
use episode::protocol::{EndingCollision, Protocol, StrictSettings};

use super::figure::Figure;
use crate::table::{COLUMNS, Show};

/// The metrics, in their order.
pub(super) fn metrics() -> impl Iterator<Item = &'static str> {
    METRICS.iter().map(|metric| metric.name).filter(|name| !name.starts_with("nuplan_"))
}

/// The figures: those metrics, each with the protocol's name before its own.
pub(super) fn figures() -> Vec<Figure> {
    metrics().map(|name| figure("strict_", name)).collect()
}

/// A metric of a protocol as a figure, in the table where it is in that of `sim table`.
pub(super) fn figure(prefix: &str, name: &str) -> Figure {
    let metric = METRICS.iter().find(|metric| metric.name == name);
    let (unit, meaning) = metric.map_or(("", ""), |metric| (metric.unit, metric.meaning));
    let figure = Figure::new(format!("{prefix}{name}"), unit, meaning);
    match COLUMNS.iter().find(|column| column.2 == name) {
        Some(column) => match column.3 {
            Show::Percent => figure.percent(column.0),
            Show::Mean(digits) => figure.mean(column.0, digits),
        },
        None => figure,
    }
}

/// Whether a run under `protocol` was judged by just these rules: then its figures stand in `results.parquet`. How the AV moved, from
/// where and how long it drove are what is judged, not how.
pub(super) fn is_as_driven(protocol: &Protocol) -> bool {
    let usual = StrictSettings::default();
    match protocol {
        Protocol::Strict(settings) => {
            settings.ending_collision == EndingCollision::AtFault
                && settings.off_route_distance == usual.off_route_distance
                && settings.wheelbase == usual.wheelbase
        }
        Protocol::Paper => false,
    }
}
