#![no_main]

mod folder;
#[path = "../../fuzzed.rs"]
#[allow(dead_code, reason = "a target calls one of these functions")]
mod fuzzed;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzzed::scene(bytes, folder::of_inputs()));
