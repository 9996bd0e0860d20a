//! Writes inputs to files, for functions that read files. The files lie in memory, in one folder per process.

use std::path::PathBuf;

/// Writes a file and returns its path.
pub fn write(name: &str, bytes: &[u8]) -> PathBuf {
    let folder = PathBuf::from(format!("/dev/shm/raycl-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("a file");
    path
}
