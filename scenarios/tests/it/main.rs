//! The crate from outside: real files where they are present, damaged files, sets, the binary.
#![allow(clippy::unwrap_used, clippy::expect_used, missing_docs, reason = "a test may fail by panic")]

mod argoverse;
mod cases;
mod cli;
mod damage;
mod generate;
mod identity;
mod index;
mod packed;
mod real;
mod render;
#[path = "../../src/lint/tests/road.rs"]
mod road;
mod scenarionet;
mod sets;
mod skim;
mod stats;
mod tf_example;

use std::path::PathBuf;

/// A file or folder of material that is licensed or large, so not in this repository; `None` with a word on standard error
/// where it is not at hand.
fn shared(name: &str) -> Option<PathBuf> {
    let repository = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let places = [
        std::env::var_os("RELOOP_SHARED").map(PathBuf::from),
        Some(repository.join("../shared")),
        Some(repository.join("../../shared")),
    ];
    let found = places.into_iter().flatten().map(|place| place.join(name)).find(|path| path.exists());
    if found.is_none() {
        eprintln!("skipped: no {name} here (set RELOOP_SHARED)");
    }
    found
}

/// The folder of real scenes.
fn real_data() -> Option<PathBuf> {
    shared("data")
}
