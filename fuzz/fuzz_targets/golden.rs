#![no_main]

use std::path::Path;

use sim::check::golden::Golden;
use wire::keys::Role;

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Ok(golden) = Golden::parse(text, Path::new("golden.json"), Role::Planner) {
        // What was read is like itself, unless it holds a number beyond all numbers.
        let _ = golden.compare(&golden);
    }
});
