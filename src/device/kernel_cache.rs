//! The folder in which PoCL stores compiled kernels. If PoCL cannot write to this folder, PoCL lists no
//! device. PoCL runs the kernels that it finds in this folder, so nobody but the user may write to the
//! folder.

use crate::cache::{can_be_written, is_private, private_in_shared, temporary, temporary_path};
use std::path::{Path, PathBuf};

/// The environment variable that names PoCL's folder for compiled kernels.
const FOLDER: &str = "POCL_CACHE_DIR";
/// The value that raycl gives to `POCL_CACHE_DIR` if PoCL can use none of the folders that raycl tries. /dev/null is
/// not a folder, so nobody can create a folder in it, and PoCL lists no device.
const NO_FOLDER: &str = "/dev/null/no-folder-for-pocl";
/// raycl treats a disk with less than `ROOM_BYTES` bytes of free space as a full disk. PoCL usually writes some hundred
/// KiB for each program.
const ROOM_BYTES: u64 = 1 << 20;
/// raycl treats a disk that can hold fewer than `ROOM_FILES` further files as a full disk. PoCL writes about ten files
/// and folders for each program.
const ROOM_FILES: u64 = 16;

/// Returns `POCL_CACHE_DIR` and the value that raycl must give to this variable before a driver is loaded. The value
/// is PoCL's default folder or, if PoCL cannot or must not use this folder, a private folder in the system's folder of
/// temporary files. If PoCL cannot use the private folder either, the value is the default folder, which raycl makes
/// as a private folder. If PoCL can use none of these folders, the value is a folder that cannot exist, so that PoCL
/// lists no device.
///
/// Returns no variable in three cases: on systems other than Unix; if the user has set `POCL_CACHE_DIR` to a text
/// that is not empty; or if `POCL_CACHE_DIR` is not set and PoCL can use its default folder.
pub fn cache_variables() -> Vec<(&'static str, String)> {
    if cfg!(not(unix)) || named().is_some() {
        return Vec::new();
    }
    let is_fit = |folder: &PathBuf| why_unfit(folder).is_none();
    let default = default_folder().filter(is_fit);
    // PoCL ends the process if `POCL_CACHE_DIR` is set, but empty. raycl therefore replaces an empty text, even if
    // PoCL can use its default folder.
    if default.is_some() && std::env::var_os(FOLDER).is_none() {
        return Vec::new();
    }
    let other = || temporary().map(|folder| folder.join("pocl")).filter(is_fit);
    // PoCL's default folder may lie in a container's volume into which everybody may write. If the folder of temporary
    // files cannot be used either, raycl itself makes the default folder, as a folder into which only the user may
    // write.
    let made =
        || default_folder().filter(|folder| folder.is_absolute()).and_then(private_in_shared).filter(is_fit);
    let folder = default.or_else(other).or_else(made);
    let folder = folder.and_then(|folder| folder.to_str().map(str::to_owned));
    vec![(FOLDER, folder.unwrap_or_else(|| NO_FOLDER.to_owned()))]
}

/// Returns why PoCL cannot use a folder, or must not use it; `None` if PoCL can use the folder, or can create it.
fn why_unfit(folder: &Path) -> Option<&'static str> {
    if !folder.is_absolute() {
        Some("its path is relative")
    } else if !can_be_written(folder) {
        Some("raycl cannot write to it")
    } else if !is_private(folder) {
        Some(
            "another user owns this folder or the folder that contains it, or may write into one of the two folders",
        )
    } else {
        is_noexec(folder).then_some("its file system is mounted with the option noexec")
    }
}

/// Returns advice if PoCL cannot write to its folder for compiled kernels, and therefore lists no device.
pub fn cache_advice() -> Option<String> {
    cache_advice_on(&folder()?)
}

/// Returns advice if PoCL cannot write to `folder`, its folder for compiled kernels.
fn cache_advice_on(folder: &Path) -> Option<String> {
    if folder == Path::new(NO_FOLDER) {
        return Some(no_folder_advice(default_folder().as_deref(), temporary_path().as_deref()));
    }
    (!can_be_written(folder)).then(|| {
        format!(
            "PoCL lists no device if it cannot write to its folder for compiled kernels, '{}'; \
             set {FOLDER} to a folder to which you can write",
            folder.display()
        )
    })
}

/// Returns the advice for the case that PoCL can use neither its default folder nor the user's private folder in the
/// system's folder of temporary files.
fn no_folder_advice(default: Option<&Path>, temporary: Option<&Path>) -> String {
    let reason = |folder: &Path| {
        let why = why_unfit(folder).unwrap_or("it is a link, or it cannot be created");
        format!("'{}' cannot be used: {why}", folder.display())
    };
    let default = default.map_or_else(|| "neither XDG_CACHE_HOME nor HOME is set".to_owned(), reason);
    let reasons: Vec<_> = std::iter::once(default).chain(temporary.map(reason)).collect();
    format!(
        "PoCL lists no device, because it has no folder for compiled kernels ({}); set {FOLDER} to a folder that only \
         you can write, on a file system that is not mounted with noexec",
        reasons.join("; ")
    )
}

/// Returns advice if PoCL can store no compiled kernel in its folder, because the disk is full, or can run no
/// kernel from this folder, because the file system is mounted with the option noexec. With a full disk or the
/// option noexec, PoCL reports that the build of a program has failed, or ends the process.
pub fn folder_advice() -> Option<String> {
    let folder = folder().filter(|folder| folder != Path::new(NO_FOLDER))?;
    if is_noexec(&folder) {
        return Some(noexec_advice(&folder));
    }
    advice_for(&room(&folder)?, &folder)
}

/// Returns the advice for the case that the file system of PoCL's folder is mounted with the option noexec.
fn noexec_advice(folder: &Path) -> String {
    format!(
        "the file system of PoCL's folder for compiled kernels, '{}', is mounted with the option noexec, so PoCL can run no \
         kernel from there: set {FOLDER} to a folder on another file system",
        folder.display()
    )
}

/// Returns advice if a disk with the given free space counts as full. `folder` is PoCL's folder on the disk.
fn advice_for(room: &Room, folder: &Path) -> Option<String> {
    let remedy = if room.bytes < ROOM_BYTES {
        "is full: free up space on it"
    } else if room.files.is_some_and(|files| files < ROOM_FILES) {
        "has no room for further files (`df -i` shows its inodes): remove files from it"
    } else {
        return None;
    };
    Some(format!(
        "the disk of PoCL's folder for compiled kernels, '{}', {remedy}, or set {FOLDER} to a folder on another disk; \
         `raycl run` measures failed points again with --resume --retry-failed",
        folder.display()
    ))
}

/// The free space of a disk, in bytes and in files.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Room {
    /// Number of free bytes on the disk.
    bytes: u64,
    /// The number of further files that the disk can store; `None` if the file system does not limit the
    /// number of files.
    files: Option<u64>,
}

/// Returns the free space of a folder's disk; `None` if the folder is missing, or if the system reports no
/// size of the disk.
#[cfg(unix)]
fn room(folder: &Path) -> Option<Room> {
    let disk = rustix::fs::statvfs(folder).ok().filter(|disk| disk.f_blocks > 0)?;
    let files = files_left(disk.f_files, disk.f_favail);
    Some(Room { bytes: disk.f_bavail.saturating_mul(disk.f_frsize), files })
}

/// Returns the number of further files for which a disk has room; `None` if the file system does not limit
/// the number of files. Btrfs, for example, has no limit, and reports a limit of 0 and room for 0 files.
#[cfg(unix)]
fn files_left(most: u64, left: u64) -> Option<u64> {
    (most > 0).then_some(left)
}

/// On systems other than Unix, raycl does not query the free space of disks.
#[cfg(not(unix))]
fn room(_: &Path) -> Option<Room> {
    None
}

/// Returns true if no program can be run from a folder, because the folder's file system is mounted with the option
/// noexec. If the folder does not exist, examines the file system of its nearest ancestor that exists. PoCL's compiled
/// kernels are shared libraries, which cannot be loaded from a file system with the option noexec.
#[cfg(target_os = "linux")]
fn is_noexec(folder: &Path) -> bool {
    use crate::cache::existing_ancestor;
    use rustix::fs::{StatVfsMountFlags, statvfs};
    let disk = existing_ancestor(folder).and_then(|existing| statvfs(existing).ok());
    disk.is_some_and(|disk| disk.f_flag.contains(StatVfsMountFlags::NOEXEC))
}

/// On systems other than Linux, raycl does not query the mount options of file systems.
#[cfg(not(target_os = "linux"))]
fn is_noexec(_: &Path) -> bool {
    false
}

/// Returns the folder that `POCL_CACHE_DIR` names or, if this variable is not set or empty, PoCL's default folder.
fn folder() -> Option<PathBuf> {
    named().or_else(default_folder)
}

/// Returns the folder that `POCL_CACHE_DIR` names; `None` if the variable is not set, or empty.
fn named() -> Option<PathBuf> {
    std::env::var_os(FOLDER).filter(|name| !name.is_empty()).map(PathBuf::from)
}

/// Returns the folder that PoCL uses if `POCL_CACHE_DIR` is not set. If `HOME` is not set, and
/// `XDG_CACHE_HOME` is empty or not set, returns `None`: PoCL then uses the folder /tmp/pocl/kcache, which
/// all users share.
fn default_folder() -> Option<PathBuf> {
    let path_in = |name: &str| std::env::var_os(name).map(PathBuf::from);
    default_in(path_in("XDG_CACHE_HOME"), path_in("HOME"))
}

/// Returns the folder that PoCL uses by default if `XDG_CACHE_HOME` has the value `caches`, and `HOME` the value
/// `home`; `None` stands for a variable that is not set.
fn default_in(caches: Option<PathBuf>, home: Option<PathBuf>) -> Option<PathBuf> {
    let caches = caches.filter(|path| !path.as_os_str().is_empty());
    let caches = caches.or_else(|| Some(home?.join(".cache")))?;
    Some(caches.join("pocl/kcache"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_reported_with_its_folder() {
        let advice = |bytes, files| advice_for(&Room { bytes, files }, Path::new("/caches/pocl"));
        let full = advice(40_000, None).expect("advice");
        let start = "the disk of PoCL's folder for compiled kernels, '/caches/pocl', is full: free up space";
        assert!(full.starts_with(start), "{full}");
        assert!(full.contains("POCL_CACHE_DIR") && full.ends_with("--resume --retry-failed"), "{full}");
        let no_files = advice(ROOM_BYTES, Some(0)).expect("advice");
        assert!(no_files.contains("no room for further files") && no_files.contains("inodes"), "{no_files}");
        assert_eq!(advice(ROOM_BYTES, None), None);
        assert_eq!(advice(ROOM_BYTES, Some(ROOM_FILES)), None);
    }

    #[test]
    #[cfg(unix)]
    fn the_room_is_that_of_the_folders_disk() {
        let folder = tempfile::tempdir().expect("a folder");
        let room_there = room(folder.path()).expect("a disk");
        assert!(room_there.bytes > 0 && room_there.files != Some(0), "{room_there:?}");
        assert_eq!(room(&folder.path().join("missing")), None);
    }

    #[test]
    fn the_default_folder_is_in_the_users_caches_and_an_empty_variable_counts_as_not_set() {
        let default = |caches: Option<&str>, home: Option<&str>| {
            default_in(caches.map(PathBuf::from), home.map(PathBuf::from))
        };
        let folder = |path: &str| Some(PathBuf::from(path));
        assert_eq!(default(Some("/caches"), Some("/home/ada")), folder("/caches/pocl/kcache"));
        for caches in [Some(""), None] {
            assert_eq!(default(caches, Some("/home/ada")), folder("/home/ada/.cache/pocl/kcache"));
            assert_eq!(default(caches, None), None);
        }
    }

    #[test]
    #[cfg(unix)]
    fn the_advice_without_any_folder_begins_with_the_default_folder() {
        let (default, temporary) = (default_folder(), temporary_path());
        let expected = no_folder_advice(default.as_deref(), temporary.as_deref());
        assert_eq!(cache_advice_on(Path::new(NO_FOLDER)), Some(expected));
        let closed = cache_advice_on(Path::new("/dev/null/pocl")).expect("advice");
        assert!(closed.contains("if it cannot write to its folder") && closed.contains("'/dev/null/pocl'"));
    }

    /// Whether a file system is mounted with noexec depends on the machine, so this test reads the list of
    /// mounts. If several file systems are mounted at one path, the last mount in the list is in force.
    #[test]
    #[cfg(target_os = "linux")]
    fn a_mount_without_execution_is_noticed() {
        let mounts = std::fs::read_to_string("/proc/self/mounts").expect("the mounts");
        for place in ["/", "/proc", "/sys", "/dev/shm", "/tmp"] {
            let fields = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
            let Some(mount) = mounts.lines().map(fields).rfind(|fields| fields[1] == place) else { continue };
            let expected = mount[3].split(',').any(|option| option == "noexec");
            assert_eq!(is_noexec(Path::new(place)), expected, "{mount:?}");
            assert_eq!(is_noexec(&Path::new(place).join("missing/folder")), expected, "{mount:?}");
        }
        let advice = noexec_advice(Path::new("/caches/pocl"));
        for part in ["'/caches/pocl'", "noexec", "POCL_CACHE_DIR"] {
            assert!(advice.contains(part), "{part}: {advice}");
        }
    }

    #[test]
    #[cfg(unix)]
    fn a_folder_of_others_a_relative_one_and_one_that_cannot_be_written_are_unfit() {
        use std::os::unix::fs::PermissionsExt as _;
        let parent = tempfile::tempdir().expect("a folder");
        let folder = parent.path().join("pocl");
        assert_eq!(why_unfit(&folder).is_some(), is_noexec(&folder));
        assert_eq!(why_unfit(Path::new("pocl/kcache")), Some("its path is relative"));
        assert_eq!(why_unfit(Path::new("/dev/null/pocl")), Some("raycl cannot write to it"));
        std::fs::create_dir(&folder).expect("a folder");
        std::fs::set_permissions(&folder, std::fs::Permissions::from_mode(0o777)).expect("a mode");
        let advice = no_folder_advice(Some(Path::new("/dev/null/kcache")), Some(&folder));
        let reasons = format!(
            "('/dev/null/kcache' cannot be used: raycl cannot write to it; '{}' cannot be used: another user owns this folder",
            folder.display()
        );
        assert!(advice.contains(&reasons) && advice.contains("set POCL_CACHE_DIR to"), "{advice}");
        let advice = no_folder_advice(None, Some(parent.path()));
        let reasons = format!(
            "(neither XDG_CACHE_HOME nor HOME is set; '{}' cannot be used: ",
            parent.path().display()
        );
        assert!(advice.contains(&reasons), "{advice}");
    }

    #[test]
    #[cfg(unix)]
    fn a_disk_without_a_limit_of_files_has_room_for_them() {
        assert_eq!([files_left(0, 0), files_left(100, 0), files_left(100, 7)], [None, Some(0), Some(7)]);
    }
}
