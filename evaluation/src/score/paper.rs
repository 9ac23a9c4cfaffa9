//! The score of `paper`: the authors' twelve metrics.

use episode::metrics::METRICS;
use episode::metrics::authors::is_measured;
use episode::protocol::Protocol;

use super::figure::Figure;
use super::strict::figure;

/// The metrics, in their order.
pub(super) fn metrics() -> impl Iterator<Item = &'static str> {
    METRICS.iter().map(|metric| metric.name).filter(|name| is_measured(name))
}

/// The figures: those metrics, each with the protocol's name before its own.
pub(super) fn figures() -> Vec<Figure> {
    metrics().map(|name| figure("paper_", name)).collect()
}

/// Whether a run under `protocol` has them in `results.parquet`.
pub(super) fn is_as_driven(protocol: &Protocol) -> bool {
    *protocol == Protocol::Paper
}
