//! For tests: small experiments, and runs of them that take no lock of this machine.

use super::Run;
use crate::config::{self, Experiment};
use crate::device::DeviceInfo;
use crate::device_lock::Locks;
use crate::program::Sources;
use std::path::Path;
use std::time::Duration;

/// Returns an experiment with `naive` on a small picture of a triangle. `lines` are more lines of its config.
pub(super) fn experiment(lines: &str) -> Experiment {
    experiment_of(&format!("scenes = ['scenes/triangle.toml']\nstrategies = ['naive']\n{lines}"))
}

/// Returns an experiment on small pictures. `lines` are its scenes and strategies.
pub(super) fn experiment_of(lines: &str) -> Experiment {
    let text = format!("question = '?'\nexpectation = '!'\nimage_sizes = [[8, 5]]\n{lines}\n");
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("test.toml");
    config::parse(&config, text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns locks in a folder that does not exist, for runs that lock no device.
pub(super) fn no_locks() -> Locks {
    Locks::in_folder(Path::new("no-locks"), false)
}

/// Returns a plain run of an experiment.
pub(super) fn run<'a>(
    experiment: &'a Experiment,
    devices: &'a [&'a DeviceInfo],
    locks: &'a Locks,
) -> Run<'a> {
    Run {
        experiment,
        overrides: &[],
        devices,
        sources: &Sources::Embedded,
        other_sources: None,
        limit: Duration::MAX,
        retry_failed: false,
        locks,
        spread: false,
        blocks: None,
        ahead: None,
    }
}
