//! Reads an experiment's TOML, and makes the plan of the experiment.
#![no_main]

use libfuzzer_sys::fuzz_target;
use raycl::experiment::Plan;
use std::path::Path;

fuzz_target!(|text: &str| {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/test.toml"));
    if let Ok(experiment) = raycl::config::parse(path, text.to_owned(), &[]) {
        let points = experiment.scenes.len() * experiment.image_sizes.len() * experiment.strategies.len();
        if points < 10_000 {
            Plan::new(&experiment, 2);
        }
    }
});
