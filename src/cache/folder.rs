//! Finds the cache's folder, and checks who owns it. raycl runs programs from the cache, so only the user may write
//! there.

use std::path::{Path, PathBuf};

/// The environment variable that limits the cache's size in MiB; 0 turns the cache off.
pub const LIMIT: &str = "RAYCL_CACHE_MIB";
const DEFAULT_LIMIT_MIB: u64 = 512;

/// Returns the limit of the cache's size in bytes, from the environment.
pub fn limit_bytes() -> u64 {
    limit_of(std::env::var(LIMIT).ok().as_deref())
}

/// Returns the limit in bytes that the variable's text gives, or the default if the text is not a number.
fn limit_of(text: Option<&str>) -> u64 {
    let told = text.and_then(|text| text.trim().parse::<u64>().ok());
    told.unwrap_or(DEFAULT_LIMIT_MIB).saturating_mul(1 << 20)
}

/// Returns the folder `raycl` in the user's cache folder; `None` if the environment names no cache folder.
pub fn of_user() -> Option<PathBuf> {
    crate::xdg::folder("XDG_CACHE_HOME", ".cache")
}

/// Makes a private folder among the temporary files. Later processes of this user get the same folder. Returns `None`
/// if the folder cannot be made, if it is a link, or if somebody else owns it or may write into it.
#[cfg(unix)]
pub fn temporary() -> Option<PathBuf> {
    let user = rustix::process::geteuid().as_raw();
    let folder = std::env::temp_dir().join(format!("raycl-{user}"));
    make(&folder).ok()?;
    let own = folder.symlink_metadata().is_ok_and(|found| found.is_dir());
    (own && trusted(&folder).is_some()).then_some(folder)
}

#[cfg(not(unix))]
pub fn temporary() -> Option<PathBuf> {
    None
}

/// Makes a folder that only its owner can use.
#[cfg(unix)]
pub fn make(folder: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::DirBuilderExt as _;
    std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder)
}

#[cfg(not(unix))]
pub fn make(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)
}

/// Returns the folder if it belongs to the user and nobody else may write into it.
pub fn trusted(folder: &Path) -> Option<&Path> {
    let found = folder.metadata().ok()?;
    (found.is_dir() && is_own(&found)).then_some(folder)
}

/// Reads an ordinary file that belongs to the user and that nobody else may write. Returns `None` for all other files,
/// and for links.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_told_in_mebibytes_and_is_512_of_them_otherwise() {
        const MIB: u64 = 1024 * 1024;
        for (text, bytes) in [(Some("64"), 64 * MIB), (Some("0"), 0), (None, 512 * MIB)] {
            assert_eq!(limit_of(text), bytes, "{text:?}");
        }
        let most = u64::MAX.to_string();
        assert_eq!(limit_of(Some(most.as_str())), u64::MAX);
    }
}
