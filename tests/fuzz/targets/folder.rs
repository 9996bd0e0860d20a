//! The folder of inputs, for functions that read files. It lies in memory; each process has its own.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

static OF_INPUTS: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = PathBuf::from(format!("/dev/shm/raycl-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
});

pub fn of_inputs() -> &'static Path {
    &OF_INPUTS
}
