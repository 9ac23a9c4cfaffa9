#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    wire::fuzzing::asked(bytes);
    wire::fuzzing::replied(bytes);
});
