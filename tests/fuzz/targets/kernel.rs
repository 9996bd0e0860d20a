#![no_main]

#[path = "../../fuzzed.rs"]
#[allow(dead_code, reason = "a target calls one of these functions")]
mod fuzzed;

libfuzzer_sys::fuzz_target!(|text: &str| fuzzed::kernel(text));
