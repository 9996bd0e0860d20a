//! Preprocesses a kernel's source, and lays the result out as `raycl kernel` does.
#![no_main]

use libfuzzer_sys::fuzz_target;
use raycl::program::preprocess::{canonical, preprocess, read};
use std::collections::BTreeMap;

fuzz_target!(|text: &str| {
    if let Ok(program) = preprocess(text, "-D LOCAL_X=8 -DRAYS", &BTreeMap::new()) {
        read(&program.lines, None);
        read(&program.lines, Some(&["cast"]));
        canonical(&program.text());
    }
});
