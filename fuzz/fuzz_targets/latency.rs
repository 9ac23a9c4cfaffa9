#![no_main]

use episode::latency::Latency;
use results::trace::Trace;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let _ = Trace::parse(text);
    if let Ok(latency) = text.parse::<Latency>() {
        assert_eq!(latency.to_string().parse(), Ok(latency));
    }
});
