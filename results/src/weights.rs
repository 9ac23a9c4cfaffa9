//! The weights that are part of the repository (`weights/`), as far as a run must know them: their names, and who they are.
//!
//! The numbers themselves are in `predictor-node`: those of `dipp` are built in there.

/// Those that `predictor-node` has built in.
pub const BUILT_IN: &str = "dipp.f16.safetensors";

/// Those of a network that was trained without a planner.
pub const IL_PRED: &str = "il-pred.f16.safetensors";

/// Those of a network that predicts nobody.
pub const IL: &str = "il.f16.safetensors";

/// The policy of the driver `cql`.
pub const CQL: &str = "cql.f16.safetensors";

/// How features are made for any of them.
pub const FEATURES: &str = "mended";

/// What `sha256sum` says of them.
const SUMS: &str = include_str!("../../weights/SHA256SUMS");

/// SHA-256 of those that are built in, in hexadecimal digits.
#[must_use]
pub fn built_in_sha256() -> &'static str {
    // That there is one is a test's claim.
    sums().find(|(_, name)| *name == BUILT_IN).map_or("", |(sum, _)| sum)
}

/// Whether a file with this SHA-256 is one of them.
#[must_use]
pub fn is_ours(sha256: &str) -> bool {
    sums().any(|(sum, _)| sum == sha256)
}

/// SHA-256 and name of each.
pub fn sums() -> impl Iterator<Item = (&'static str, &'static str)> {
    SUMS.lines().filter_map(|line| line.split_once("  "))
}
