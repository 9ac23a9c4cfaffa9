//! The crate from outside: real files where they are present, damaged files, sets, the binary.
#![allow(clippy::unwrap_used, clippy::expect_used, missing_docs, reason = "a test may fail by panic")]

mod cli;
mod damage;
mod identity;
mod packed;
mod real;
mod sets;

use std::path::PathBuf;

/// The folder of real scenes, or `None` with a word on standard error: they are licensed, so not in this repository.
fn real_data() -> Option<PathBuf> {
    let repository = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let places = [
        std::env::var_os("RELOOP_SHARED").map(PathBuf::from),
        Some(repository.join("../shared")),
        Some(repository.join("../../shared")),
    ];
    let found = places.into_iter().flatten().map(|place| place.join("data")).find(|data| data.is_dir());
    if found.is_none() {
        eprintln!("skipped: no real scenes here (set RELOOP_SHARED)");
    }
    found
}
