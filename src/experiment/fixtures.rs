//! Provides tests with small experiments, and with runs of these experiments that take no lock of this
//! machine.

use super::Run;
use crate::config::{self, Experiment};
use crate::device::DeviceInfo;
use crate::device_lock::Locks;
use crate::program::Sources;
use std::ops::Deref;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

/// Returns an experiment that casts a small picture of a triangle with the strategy `naive`. `lines` are more
/// lines of the experiment's config.
pub(super) fn experiment(lines: &str) -> Experiment {
    experiment_of(&format!("scenes = ['scenes/triangle.toml']\nstrategies = ['naive']\n{lines}"))
}

/// Returns an experiment whose pictures have 8 x 5 pixels. `lines` are the lines of the config that state
/// scenes and strategies.
pub(super) fn experiment_of(lines: &str) -> Experiment {
    let text = format!("question = '?'\nexpectation = '!'\nimage_sizes = [[8, 5]]\n{lines}\n");
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("test.toml");
    config::parse(&config, text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// Locks of devices in a temporary folder, so that tests do not lock each other's devices.
pub(super) struct TestLocks {
    locks: Locks,
    _folder: TempDir,
}

impl Deref for TestLocks {
    type Target = Locks;

    fn deref(&self) -> &Locks {
        &self.locks
    }
}

/// Returns device locks that no other test uses.
pub(super) fn own_locks() -> TestLocks {
    let folder = tempfile::tempdir().expect("a folder");
    TestLocks { locks: Locks::in_folder(folder.path(), false), _folder: folder }
}

/// Returns a run of an experiment with the built-in kernels, in which workers may take any time to reply. All
/// samples of the run count, whatever their core-to-core latency.
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
        keeps_moved_samples: true,
        locks,
        spread: false,
        blocks: None,
        ahead: None,
        caches_programs: true,
    }
}
