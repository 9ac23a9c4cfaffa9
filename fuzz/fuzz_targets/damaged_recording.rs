#![no_main]

use std::path::Path;

use libfuzzer_sys::Corpus;
use recording::mutants::{Dice, mutant};

// A recording (the rest of the bytes; seed the corpus with short ones) damaged by the dice that the first eight bytes are, read in
// all ways that there are.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| -> Corpus {
    let Some((dice, whole)) = bytes.split_first_chunk() else { return Corpus::Reject };
    let damaged = mutant(whole, &mut Dice(u64::from_le_bytes(*dice)));
    recorder::fuzzing::recording(&damaged);
    let _ = planner_node::explain::step_of(&damaged, Path::new("fuzzed.mcap"), u32::from(dice[0] % 4));
    Corpus::Keep
});
