#![no_main]

use recording::Reader;

// Any bytes as a file: reading ends.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(mut reader) = Reader::new(bytes) {
        while reader.next().is_some() {}
    }
});
