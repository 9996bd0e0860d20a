//! Where the cache lies and whose it is: what is read from it is run, so that nobody else may write there.

use std::path::{Path, PathBuf};

/// The variable that says how many MiB the cache may take; 0 keeps nothing.
pub const LIMIT: &str = "RAYCL_CACHE_MIB";
const DEFAULT_LIMIT_MIB: u64 = 512;

/// The most bytes of the cache, as the environment says.
pub fn limit_bytes() -> u64 {
    let told = std::env::var(LIMIT).ok().and_then(|text| text.trim().parse::<u64>().ok());
    told.unwrap_or(DEFAULT_LIMIT_MIB).saturating_mul(1 << 20)
}

/// `raycl` in the user's folder of caches; none where the environment names no such folder.
pub fn of_user() -> Option<PathBuf> {
    crate::xdg::folder("XDG_CACHE_HOME", ".cache")
}

/// Makes a folder that is its owner's alone.
#[cfg(unix)]
pub fn make(folder: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::DirBuilderExt as _;
    std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder)
}

#[cfg(not(unix))]
pub fn make(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)
}

/// The folder, where it is the user's and nobody else may write into it.
pub fn trusted(folder: &Path) -> Option<&Path> {
    let found = folder.metadata().ok()?;
    (found.is_dir() && is_own(&found)).then_some(folder)
}

/// What an ordinary file of the user's holds; a link is none.
pub fn read_own(path: &Path) -> Option<Vec<u8>> {
    let found = path.symlink_metadata().ok()?;
    if !found.is_file() || !is_own(&found) {
        return None;
    }
    std::fs::read(path).ok()
}

#[cfg(unix)]
fn is_own(found: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    const OTHERS_WRITE: u32 = 0o022;
    found.uid() == rustix::process::geteuid().as_raw() && found.mode() & OTHERS_WRITE == 0
}

#[cfg(not(unix))]
fn is_own(_: &std::fs::Metadata) -> bool {
    true
}
