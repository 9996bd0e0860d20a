//! Stores data that later runs would otherwise recompute, such as compiled programs and lists of devices.
//! Each cache entry is one file in a folder that belongs to the user. raycl ignores an entry that is corrupt,
//! that belongs to another user, or whose key is not the requested key.

mod entry;
mod folder;

pub use folder::{
    LIMIT, can_be_written, check_limit, existing_ancestor, is_private, limit_bytes, private_in_shared,
    temporary, temporary_path,
};

use entry::{file_name, opened, sealed};
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// The prefix of the names of unfinished files: files that a process is writing, or was writing when it was
/// killed.
const UNFINISHED: &str = ".unfinished-";
/// The least space that a file takes on most disks: a block. A cache entry counts as at least this many
/// bytes, so the limit of the cache's size also limits the number of its entries.
const BLOCK_BYTES: u64 = 4096;
/// The clock of a file server can differ from this machine's clock. A modification time of a cache file that lies at
/// most `CLOCKS_DIFFER_BY` in the future is therefore accepted.
const CLOCKS_DIFFER_BY: Duration = Duration::from_secs(60);

/// A cache: a folder of entries, and the limit of its size. If `folder` is `None`, the cache stores nothing.
#[derive(Clone, Debug, Default)]
pub struct Cache {
    folder: Option<PathBuf>,
    limit_bytes: u64,
    /// True if raycl does not make the cache's folder when the folder is missing.
    only_existing: bool,
}

/// An entry of the cache, described by the path, the size and the modification time of its file.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The path of the entry's file.
    pub path: PathBuf,
    /// The size of the entry's file.
    pub bytes: u64,
    /// The time of the last use of the entry. If the file's modification time lies in the future, the last
    /// use is unknown; `used` is then the Unix epoch, so that this entry is removed before all others.
    pub used: SystemTime,
}

impl Entry {
    /// Returns the number of bytes by which the entry counts towards the limit of the cache's size.
    pub fn counted_bytes(&self) -> u64 {
        counted_bytes(self.bytes)
    }
}

impl Cache {
    /// Returns the user's cache, as configured in the environment.
    pub fn of_user() -> Self {
        let limit_bytes = limit_bytes();
        Self { folder: folder::of_user().filter(|_| limit_bytes > 0), limit_bytes, only_existing: false }
    }

    /// Returns a cache in the given folder. The cache's entries take at most `limit_bytes` together.
    pub fn at(folder: &Path, limit_bytes: u64) -> Self {
        Self { folder: Some(folder.to_owned()), limit_bytes, only_existing: false }
    }

    /// Returns a cache that stores nothing.
    pub fn none() -> Self {
        Self::default()
    }

    /// Returns this cache, changed so that it never makes its folder: while the folder is missing, the cache
    /// stores nothing.
    #[must_use]
    pub fn only_while_it_exists(self) -> Self {
        Self { only_existing: true, ..self }
    }

    /// Returns the path of the cache's folder.
    pub fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// Returns the limit of the total size of all entries, in bytes. In this total, an entry smaller than
    /// `BLOCK_BYTES` counts as `BLOCK_BYTES`.
    pub fn limit_bytes(&self) -> u64 {
        self.limit_bytes
    }

    /// Returns true if the cache has a folder that raycl can use.
    pub fn is_usable(&self) -> bool {
        self.folder.is_some() && self.why_unusable().is_none()
    }

    /// Returns why raycl cannot use the cache's folder; `None` if raycl can use the folder, or if the cache
    /// has no folder.
    pub fn why_unusable(&self) -> Option<&'static str> {
        self.folder().and_then(folder::why_unusable)
    }

    /// Returns the content of the entry with this kind (the sort of data, such as `program`) and this key;
    /// `None` if the cache has no valid entry with this kind and key.
    pub fn get(&self, kind: &str, key: &str) -> Option<Vec<u8>> {
        let path = folder::trusted(self.folder()?)?.join(file_name(kind, key));
        let content = opened(folder::read_own(&path)?, key)?;
        // The modification time of the entry's file is set to the present, since entries that were not used
        // for a long time are removed first.
        let used = std::fs::File::open(&path).and_then(|file| file.set_modified(SystemTime::now()));
        drop(used);
        Some(content)
    }

    /// Stores an entry. Returns true if the cache contains the entry afterwards. Makes the folder if it is
    /// missing, except after [`only_while_it_exists`](Self::only_while_it_exists). Stores nothing if another
    /// user owns the folder or may write into it, since [`get`](Self::get) would ignore the entry. Also
    /// stores nothing if the cache's folder cannot be listed, since raycl could not remove old entries from a
    /// folder that it cannot list. If the entry cannot be stored, for example because the disk is full, no
    /// error is reported: the next run only takes longer.
    pub fn put(&self, kind: &str, key: &str, content: &[u8]) -> bool {
        let Some(folder) = self.folder() else { return false };
        let bytes = sealed(key, content);
        let fits = counted_bytes(bytes.len() as u64) <= self.limit_bytes;
        let may_write = fits && (self.only_existing || folder::make(folder).is_ok());
        if !may_write || folder::trusted(folder).is_none() {
            return false;
        }
        let path = folder.join(file_name(kind, key));
        let is_stored = folder::files(folder).is_ok() && write(folder, &path, &bytes).is_ok();
        self.trim();
        is_stored && path.exists()
    }

    /// Returns all entries, the most recently used entry first. Returns no entry if the folder cannot be
    /// listed.
    pub fn entries(&self) -> Vec<Entry> {
        self.listed().unwrap_or_default()
    }

    /// Removes all entries. Returns the number of removed entries and their size in bytes. If some entries
    /// cannot be removed, removes all others, and returns the first error. An error is also returned if the
    /// cache's folder cannot be listed.
    pub fn clear(&self) -> std::io::Result<(usize, u64)> {
        remove(&self.listed()?)
    }

    /// Returns all entries, the most recently used entry first, or the error if the folder cannot be listed.
    fn listed(&self) -> std::io::Result<Vec<Entry>> {
        let files = self.folder().map(folder::files).transpose()?.flatten();
        let latest = SystemTime::now() + CLOCKS_DIFFER_BY;
        let mut entries: Vec<Entry> =
            files.into_iter().flatten().filter_map(|file| entry_of(&file.ok()?, latest)).collect();
        entries.sort_by_key(|entry| std::cmp::Reverse(entry.used));
        Ok(entries)
    }

    /// Removes the least recently used entries, until the total size of the remaining entries is within the
    /// limit.
    fn trim(&self) {
        let mut left_bytes = 0;
        for entry in self.entries() {
            left_bytes += entry.counted_bytes();
            if left_bytes > self.limit_bytes {
                let _ = std::fs::remove_file(&entry.path);
            }
        }
    }
}

/// Returns the number of bytes by which an entry of the given size counts towards the limit of the cache's
/// size.
fn counted_bytes(bytes: u64) -> u64 {
    bytes.max(BLOCK_BYTES)
}

/// Removes entries. Returns the number of removed entries and their size in bytes. It is no error if an entry is
/// already gone: another process may have finished, replaced or removed the entry's file since the entries were listed.
fn remove(entries: &[Entry]) -> std::io::Result<(usize, u64)> {
    let (mut count, mut bytes, mut failed) = (0, 0, None);
    for entry in entries {
        match std::fs::remove_file(&entry.path) {
            Ok(()) => (count, bytes) = (count + 1, bytes + entry.bytes),
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => failed = failed.or(Some(error)),
        }
    }
    failed.map_or(Ok((count, bytes)), Err)
}

#[allow(
    clippy::disallowed_methods,
    reason = "a cache's folder belongs to raycl, and its entries can be regenerated"
)]
fn write(folder: &Path, path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut file = tempfile::Builder::new().prefix(UNFINISHED).tempfile_in(folder)?;
    file.write_all(bytes)?;
    // Without the following call, a file server would date the file by the server's clock,
    // which may differ from this machine's clock.
    let _ = file.as_file().set_modified(SystemTime::now());
    file.persist(path)?;
    Ok(())
}

/// Returns the cache entry that a file of the cache's folder contains, even if the file is unfinished; `None`
/// if the cache did not create the file. A modification time after `latest` is wrong, for example because the
/// clock was ahead when the file was written.
fn entry_of(file: &std::fs::DirEntry, latest: SystemTime) -> Option<Entry> {
    let metadata = file.metadata().ok().filter(std::fs::Metadata::is_file)?;
    let name = file.file_name();
    let name = name.to_str()?;
    let ours = entry::is_name(name) || name.starts_with(UNFINISHED);
    let modified = metadata.modified().ok().filter(|time| *time <= latest);
    ours.then(|| Entry {
        path: file.path(),
        bytes: metadata.len(),
        used: modified.unwrap_or(SystemTime::UNIX_EPOCH),
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn cache(limit_bytes: u64) -> (tempfile::TempDir, Cache) {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::at(&folder.path().join("raycl"), limit_bytes);
        (folder, cache)
    }

    fn only_file(cache: &Cache) -> PathBuf {
        let [entry] = cache.entries().try_into().unwrap();
        entry.path
    }

    /// Sets the time of the last use of an entry of the kind `program`.
    fn date(cache: &Cache, key: &str, used: SystemTime) {
        let file = std::fs::File::open(cache.folder().unwrap().join(file_name("program", key))).unwrap();
        file.set_modified(used).unwrap();
    }

    #[test]
    fn what_is_stored_comes_back_by_its_key_and_kind_alone() {
        let (_parent, cache) = cache(10_000);
        assert_eq!(cache.get("program", "key"), None);
        assert!(cache.put("program", "key", b"content"));
        assert_eq!(cache.get("program", "key").unwrap(), b"content");
        assert_eq!((cache.get("program", "other"), cache.get("devices", "key")), (None, None));
        assert!(cache.put("program", "key", b"newer"));
        assert_eq!(cache.get("program", "key").unwrap(), b"newer");
        assert_eq!(cache.entries().len(), 1);
        assert_eq!(cache.clear().unwrap().0, 1);
        assert_eq!(cache.get("program", "key"), None);
        assert!(!Cache::none().put("program", "key", b"content"));
    }

    #[test]
    fn a_folder_that_was_removed_is_made_again_only_by_a_cache_that_may_do_so() {
        let (_parent, cache) = cache(10_000);
        let background = cache.clone().only_while_it_exists();
        assert!(!background.put("program", "key", b"content") && !cache.folder().unwrap().exists());
        assert!(cache.put("program", "key", b"content") && background.put("program", "other", b"content"));
        std::fs::remove_dir_all(cache.folder().unwrap()).unwrap();
        assert!(!background.put("program", "key", b"content") && !cache.folder().unwrap().exists());
    }

    #[test]
    fn a_changed_byte_anywhere_counts_as_no_entry() {
        let (_parent, cache) = cache(10_000);
        assert!(cache.put("program", "key", b"content"));
        let path = only_file(&cache);
        let whole = std::fs::read(&path).unwrap();
        for position in 0..whole.len() {
            let mut broken = whole.clone();
            broken[position] ^= 1;
            std::fs::write(&path, broken).unwrap();
            assert_eq!(cache.get("program", "key"), None, "byte {position}");
        }
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert_eq!(cache.get("program", "key"), None, "{length} bytes");
        }
        std::fs::write(&path, whole).unwrap();
        assert_eq!(cache.get("program", "key").unwrap(), b"content");
    }

    #[test]
    fn an_entry_under_anothers_name_is_not_taken_for_it() {
        let (_parent, cache) = cache(10_000);
        assert!(cache.put("program", "other", b"of another program"));
        let name = cache.folder().unwrap().join(file_name("program", "key"));
        std::fs::rename(only_file(&cache), name).unwrap();
        assert_eq!(cache.get("program", "key"), None);
    }

    #[test]
    fn what_was_not_used_for_longest_goes_first() {
        let (_parent, cache) = cache(3 * BLOCK_BYTES);
        let day = Duration::from_secs(86_400);
        for (key, days) in [("a", 3), ("b", 1), ("c", 2)] {
            assert!(cache.put("program", key, &[0; 200]));
            date(&cache, key, SystemTime::now() - day * days);
        }
        assert!(cache.get("program", "a").is_some(), "this counts as a use");
        assert!(cache.put("program", "d", &[0; 200]));
        let present = ["a", "b", "c", "d"].map(|key| cache.get("program", key).is_some());
        assert_eq!(present, [true, true, false, true]);
        assert!(!cache.put("program", "e", &[0; 20_000]), "larger than the cache may be");
    }

    #[test]
    fn entries_that_are_dated_in_the_future_go_first() {
        let (_parent, cache) = cache(2 * BLOCK_BYTES);
        let year = Duration::from_secs(365 * 86_400);
        for key in ["a", "b"] {
            assert!(cache.put("program", key, b"content"));
            date(&cache, key, SystemTime::now() + year);
        }
        assert!(cache.put("program", "c", b"content"));
        assert!(cache.get("program", "c").is_some());
        assert_eq!(cache.entries().len(), 2);
    }

    /// The files of the first two entries are dated half a minute ahead, so the third entry counts as the
    /// least recently used.
    #[test]
    fn an_entry_that_is_removed_at_once_counts_as_not_stored() {
        let (_parent, cache) = cache(2 * BLOCK_BYTES);
        for key in ["a", "b"] {
            assert!(cache.put("program", key, b"content"));
            date(&cache, key, SystemTime::now() + CLOCKS_DIFFER_BY / 2);
        }
        assert!(!cache.put("program", "c", b"content"));
        assert_eq!(cache.get("program", "c"), None);
    }

    #[test]
    fn a_folder_that_cannot_be_listed_is_not_taken_for_an_empty_one() {
        let (parent, cache) = cache(10_000);
        assert_eq!(cache.clear().unwrap(), (0, 0), "the folder does not exist yet");
        let file = parent.path().join("file");
        std::fs::write(&file, "").unwrap();
        assert_eq!(Cache::at(&file, 10_000).clear().unwrap(), (0, 0), "a file has no entries");
        // No file system lists a folder with a name of this length, not even for the superuser.
        let nowhere = Cache::at(&parent.path().join("a".repeat(5_000)), 10_000);
        assert!(nowhere.clear().is_err() && nowhere.entries().is_empty());
        assert_eq!(nowhere.why_unusable(), Some("raycl cannot list its files"));
        assert!(!nowhere.put("program", "key", b"content"));
    }

    #[test]
    fn entries_that_fill_the_limit_stay() {
        let (_parent, large) = cache(10_000);
        assert!(large.put("program", "a", &[0; 5_000]));
        let (_parent, full) = cache(2 * large.entries()[0].bytes);
        assert!(["a", "b"].iter().all(|key| full.put("program", key, &[0; 5_000])));
        assert_eq!(full.entries().len(), 2);
    }

    #[test]
    fn a_small_entry_counts_as_the_block_that_it_takes_on_a_disk() {
        let (_parent, full) = cache(2 * BLOCK_BYTES);
        assert!((0..5).all(|key| full.put("program", &key.to_string(), b"small")));
        assert_eq!(full.entries().len(), 2);
    }

    #[cfg(unix)]
    #[test]
    fn what_others_may_write_is_not_trusted() {
        use std::os::unix::fs::{PermissionsExt as _, symlink};
        let (parent, cache) = cache(10_000);
        assert!(cache.put("program", "key", b"content"));
        let (folder, file) = (cache.folder().unwrap().to_owned(), only_file(&cache));
        let mode = |path: &Path, mode| {
            std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
        };
        assert_eq!(folder.metadata().unwrap().permissions().mode() & 0o777, 0o700);
        // The cache is not used if the group or other users may write into its folder. Permission to read the
        // folder is harmless.
        for others in [0o777, 0o720, 0o702] {
            mode(&folder, others);
            assert_eq!(cache.get("program", "key"), None, "a folder of {others:o}");
        }
        mode(&folder, 0o755);
        for others in [0o666, 0o620, 0o602] {
            mode(&file, others);
            assert_eq!(cache.get("program", "key"), None, "a file of {others:o}");
        }
        mode(&file, 0o644);
        assert!(cache.get("program", "key").is_some());
        let elsewhere = parent.path().join("elsewhere");
        std::fs::rename(&file, &elsewhere).unwrap();
        symlink(&elsewhere, &file).unwrap();
        assert_eq!(cache.get("program", "key"), None);
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_that_others_may_write_and_a_file_in_its_place_store_nothing() {
        use std::os::unix::fs::PermissionsExt as _;
        let (parent, cache) = cache(10_000);
        assert!(cache.is_usable(), "the folder can be made");
        assert!(!Cache::none().is_usable());
        assert!(cache.put("program", "key", b"content") && cache.is_usable());
        let folder = cache.folder().unwrap();
        std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o770)).unwrap();
        assert!(!cache.is_usable() && !cache.put("program", "other", b"content"));
        assert_eq!(cache.entries().len(), 1, "only the entry that was stored before");
        assert!(cache.why_unusable().unwrap().contains("users other than its owner"));
        let file = parent.path().join("file");
        std::fs::write(&file, "").unwrap();
        assert_eq!(Cache::at(&file, 10_000).why_unusable(), Some("it is not a folder"));
        let below = Cache::at(&file.join("raycl"), 10_000);
        assert_eq!((below.is_usable(), below.why_unusable()), (false, Some("raycl cannot write into it")));
    }

    #[test]
    fn only_the_caches_own_files_are_cleared() {
        let (_parent, cache) = cache(10_000);
        assert!(cache.put("program", "key", b"content"));
        let bytes = cache.entries()[0].bytes;
        let folder = cache.folder().unwrap();
        let digits = "0".repeat(32);
        let others =
            ["notes".to_owned(), format!("-{digits}"), format!("{digits}-program"), format!("a-{digits}0")];
        for name in &others {
            std::fs::write(folder.join(name), "mine").unwrap();
        }
        std::fs::create_dir(folder.join(format!("a-{digits}"))).unwrap();
        std::fs::write(folder.join(".unfinished-x"), "12345").unwrap();
        assert_eq!(cache.clear().unwrap(), (2, bytes + 5));
        assert!(others.iter().all(|name| folder.join(name).exists()) && cache.entries().is_empty());
    }

    #[test]
    fn entries_are_removed_although_some_are_gone_and_some_cannot_be_removed() {
        let (_parent, cache) = cache(10_000);
        assert!(["a", "b"].iter().all(|key| cache.put("program", key, b"content")));
        let entry = |name: &str| Entry {
            path: cache.folder().unwrap().join(name),
            bytes: 3,
            used: SystemTime::UNIX_EPOCH,
        };
        // The first entry in the list has no file, as if another process had removed the file.
        let listed = [vec![entry("gone")], cache.entries()].concat();
        let bytes = listed[1].bytes + listed[2].bytes;
        assert_eq!(remove(&listed).unwrap(), (2, bytes));
        assert!(cache.entries().is_empty());
        // The first entry is a folder, which cannot be removed like a file.
        assert!(cache.put("program", "c", b"content"));
        std::fs::create_dir(&entry("folder").path).unwrap();
        let error = remove(&[vec![entry("folder")], cache.entries()].concat()).unwrap_err();
        assert_ne!(error.kind(), ErrorKind::NotFound);
        assert!(cache.entries().is_empty());
    }

    #[test]
    fn an_entry_may_be_as_large_as_the_cache() {
        let (_parent, large) = cache(10_000);
        assert!(large.put("program", "a", &[0; 5_000]));
        let bytes = large.entries()[0].bytes;
        let [(_full, full), (_small, small)] = [bytes, bytes - 1].map(cache);
        assert_eq!([full, small].map(|cache| cache.put("program", "a", &[0; 5_000])), [true, false]);
    }
}
