//! What a merge holds in memory at once.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test may panic")]

mod synthetic;

/// The most bytes that are allocated while so many episodes of 4,000 steps are merged.
fn bytes_at_most(episodes: usize) -> u64 {
    let root = tempfile::tempdir().unwrap();
    let file = synthetic::run_file(episodes);
    let folder = synthetic::driven(root.path(), &file, 4_000);
    allocation_counter::measure(|| results::merge(&folder, &file, None, |_, _| true).unwrap()).bytes_max
}

#[test]
fn a_merge_needs_no_more_memory_for_more_episodes() {
    // More than one row group of 131,072 rows, and thrice as many.
    let (few, many) = (bytes_at_most(40), bytes_at_most(120));
    assert!(few < 48 << 20, "{few}");
    assert!(many < few + (2 << 20), "{few}, then {many}");
}
