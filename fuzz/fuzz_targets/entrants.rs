#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let _ = sim::entrants::parse(text, Path::new("entrants.toml"));
});
