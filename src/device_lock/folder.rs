//! The folder of the device locks. On Unix, all users of a machine share this folder by default, so that their
//! measurements wait for each other.

use crate::error::{Error, Result, cause, limit_advice};
use crate::existing;
use crate::reader::folder_of;
use crate::record::{TEMPORARY_PREFIX, own_file, temporary_in};
use std::fs::{File, OpenOptions};
use std::io::{Error as IoError, ErrorKind};
use std::path::{Path, PathBuf};

/// The environment variable that names, by an absolute path, a folder for the device locks instead of the
/// shared folder.
const VARIABLE: &str = "RAYCL_LOCK_DIR";
/// The largest number of attempts to open a lock whose folder is replaced again and again. Every process replaces the
/// folder at most once.
const ATTEMPTS: usize = 100;
/// The remedy if [`VARIABLE`] names a relative path.
const ABSOLUTE: &str = "set it to an absolute path, such as /tmp/my-locks; all processes that measure on this machine \
                        must use the same folder";

/// Returns an input error if the environment variable that names the folder of the locks is not an absolute
/// path. With a relative path, processes that were started in different folders would not see each other's
/// locks.
pub fn check() -> Result<()> {
    refuse_relative(named_by_user().as_deref())
}

/// Returns the path in the environment variable [`VARIABLE`]; `None` if the variable is not set or empty.
fn named_by_user() -> Option<PathBuf> {
    std::env::var_os(VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from)
}

fn refuse_relative(path: Option<&Path>) -> Result<()> {
    let Some(path) = path.filter(|path| !path.is_absolute()) else { return Ok(()) };
    let message = format!("{VARIABLE}: '{}' is not an absolute path", path.display());
    Err(Error::input(message).with_help(ABSOLUTE))
}

/// A folder with the files of device locks.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    /// True if every user of the machine may create locks in the folder.
    shared: bool,
}

impl Folder {
    /// Returns the folder that `RAYCL_LOCK_DIR` names, or else the shared folder.
    pub fn of_machine() -> Self {
        match named_by_user() {
            Some(path) => Self::named(&path),
            None => Self { path: shared_in(&std::env::temp_dir()), shared: true },
        }
    }

    /// Returns the folder of locks at `path`. raycl does not let every user create locks in this folder.
    pub fn named(path: &Path) -> Self {
        Self { path: path.to_owned(), shared: false }
    }

    /// Returns the path of the file of the lock `lock`.
    pub fn path(&self, lock: &str) -> PathBuf {
        self.path.join(format!("{lock}.lock"))
    }

    /// Opens the file of the lock `lock` for reading and writing. Creates the folder and the file if they are missing.
    pub fn open(&self, lock: &str) -> std::io::Result<File> {
        if self.shared { until_found(|| self.open_once(lock)) } else { self.open_once(lock) }
    }

    fn open_once(&self, lock: &str) -> std::io::Result<File> {
        self.make()?;
        let path = self.path(lock);
        own_file(&path)?;
        // `create` is not set: in a shared folder, Linux refuses this flag for a file that another user made.
        let open = || OpenOptions::new().read(true).write(true).open(&path);
        let file = match open() {
            Err(error) if error.kind() == ErrorKind::NotFound => match create(&path) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => open()?,
                created => created?,
            },
            opened => opened?,
        };
        refuse_second_name(&file)?;
        Ok(file)
    }

    /// Returns true if the folder still has `file` under the lock's name, and this name is not a link.
    pub fn still_has(&self, lock: &str, file: &File) -> bool {
        existing::still_leads_to(&self.path(lock), file).unwrap_or(false)
    }

    /// Returns the error for a lock whose file cannot be used.
    pub fn unusable(&self, lock: &str, error: &IoError) -> Error {
        let file = self.path(lock);
        let message = format!("cannot open {}, the lock file of a device: {}", file.display(), cause(error));
        let another = || {
            format!(
                "set {VARIABLE} to another folder; all processes that measure on this machine must use the same folder"
            )
        };
        Error::run(message).with_help(limit_advice(error).map_or_else(another, str::to_owned))
    }

    fn make(&self) -> std::io::Result<()> {
        if !self.shared {
            return std::fs::create_dir_all(&self.path);
        }
        make_shared(&self.path)?;
        // Another user may have replaced the folder by a link.
        match self.path.symlink_metadata()?.is_dir() {
            true => Ok(()),
            false => Err(IoError::new(ErrorKind::NotADirectory, "this path is not a folder")),
        }
    }
}

/// Opens a lock in the shared folder with `open`. If several processes make this folder at the same time, one of them
/// may replace the empty folder of another ([`make_shared`]). If `open` creates a file in the folder just when the
/// folder is replaced, the file is not found, so `open` is called again.
fn until_found(mut open: impl FnMut() -> std::io::Result<File>) -> std::io::Result<File> {
    for _ in 1..ATTEMPTS {
        match open() {
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            opened => return opened,
        }
    }
    open()
}

/// Returns the path of the shared folder, where `temporary` is the process's folder for temporary files. On
/// Unix, the path does not depend on `temporary`, which each process can choose with TMPDIR.
fn shared_in(temporary: &Path) -> PathBuf {
    let parent = if cfg!(unix) { Path::new("/tmp") } else { temporary };
    parent.join("raycl-locks")
}

/// Makes a folder that every user can write to. Does nothing if something exists at `path`. The folder gets
/// its name only when every user can write to it. If the folder got its name before its permissions, a
/// process that is killed too soon would leave a folder that only one user can write to.
fn make_shared(path: &Path) -> std::io::Result<()> {
    if path.symlink_metadata().is_ok() {
        return Ok(());
    }
    let made = tempfile::Builder::new().prefix(TEMPORARY_PREFIX).tempdir_in(folder_of(path))?;
    open_to_all(made.path(), 0o1777)?;
    // Renaming a folder can replace only an empty folder, in which no process has a lock yet.
    match std::fs::rename(made.path(), path) {
        // Another process has made the shared folder since this process looked for it.
        Err(_) if path.symlink_metadata().is_ok() => Ok(()),
        renamed => renamed,
    }
}

/// Creates a file that every user can lock. If the file system allows it, the file gets its name only when
/// every user can open it.
fn create(path: &Path) -> std::io::Result<File> {
    let file = temporary_in(folder_of(path))?;
    open_to_all(file.path(), 0o666)?;
    match file.persist_noclobber(path) {
        Ok(file) => Ok(file),
        Err(error) if error.error.kind() == ErrorKind::AlreadyExists => Err(error.error),
        // On some file systems, a file cannot be renamed without the risk of replacing another file.
        Err(_) => {
            let file = OpenOptions::new().read(true).write(true).create_new(true).open(path)?;
            open_to_all(path, 0o666)?;
            Ok(file)
        }
    }
}

/// Refuses a file that has a second hard link. Another user may have linked some file into the folder, and
/// writing to the lock would change that file.
#[cfg(unix)]
fn refuse_second_name(file: &File) -> std::io::Result<()> {
    use std::os::unix::fs::MetadataExt as _;
    match file.metadata()?.nlink() {
        0 | 1 => Ok(()),
        _ => Err(IoError::new(ErrorKind::InvalidInput, "it is a hard link to another file")),
    }
}

#[cfg(not(unix))]
fn refuse_second_name(_file: &File) -> std::io::Result<()> {
    Ok(())
}

#[cfg(unix)]
fn open_to_all(path: &Path, mode: u32) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt as _;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode))
}

#[cfg(not(unix))]
fn open_to_all(_path: &Path, _mode: u32) -> std::io::Result<()> {
    Ok(())
}

#[cfg(all(test, unix))]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use std::os::unix::fs::{PermissionsExt as _, symlink};

    fn mode(path: &Path) -> u32 {
        path.metadata().unwrap().permissions().mode() & 0o7777
    }

    #[test]
    fn processes_with_different_folders_for_temporary_files_share_the_locks() {
        assert_eq!(shared_in(Path::new("/elsewhere")), Path::new("/tmp/raycl-locks"));
    }

    #[test]
    fn every_user_can_lock_what_one_made() {
        let parent = tempfile::tempdir().unwrap();
        let folder = Folder { path: parent.path().join("locks"), shared: true };
        let file = folder.open("cpu").unwrap();
        assert!(folder.still_has("cpu", &file));
        assert_eq!((mode(&folder.path), mode(&folder.path("cpu"))), (0o1777, 0o666));
        assert!(folder.open("cpu").is_ok(), "and open it again");
        let entries = |path: &Path| std::fs::read_dir(path).unwrap().count();
        assert_eq!([entries(parent.path()), entries(&folder.path)], [1, 1], "nothing temporary stays");
    }

    #[test]
    fn of_processes_that_make_the_same_lock_at_once_all_open_the_same_file() {
        use std::os::unix::fs::MetadataExt as _;
        for _ in 0..20 {
            let parent = tempfile::tempdir().unwrap();
            let folder = Folder { path: parent.path().join("locks"), shared: true };
            let files: Vec<u64> = std::thread::scope(|scope| {
                let open = |_| scope.spawn(|| folder.open("cpu").unwrap().metadata().unwrap().ino());
                let threads: Vec<_> = (0..8).map(open).collect();
                threads.into_iter().map(|thread| thread.join().unwrap()).collect()
            });
            assert!(files.iter().all(|file| *file == files[0]), "{files:?}");
        }
    }

    #[test]
    fn a_lock_whose_folder_is_replaced_is_opened_again_and_other_errors_are_reported_at_once() {
        let attempts = |missing: usize, end: fn() -> std::io::Result<File>| {
            let mut count = 0;
            let opened = until_found(|| {
                count += 1;
                if count <= missing { Err(ErrorKind::NotFound.into()) } else { end() }
            });
            (count, opened.map(drop).map_err(|error| error.kind()))
        };
        assert_eq!(attempts(2, tempfile::tempfile), (3, Ok(())));
        let denied = ErrorKind::PermissionDenied;
        assert_eq!(attempts(1, || Err(ErrorKind::PermissionDenied.into())), (2, Err(denied)));
        assert_eq!(attempts(usize::MAX, tempfile::tempfile), (ATTEMPTS, Err(ErrorKind::NotFound)));
    }

    #[test]
    fn an_error_names_the_locks_file_and_a_limit_on_open_files_has_its_own_remedy() {
        let of = |errno: rustix::io::Errno| {
            let error = IoError::from_raw_os_error(errno.raw_os_error());
            Folder::named(Path::new("locks")).unusable("cpu", &error)
        };
        let closed = of(rustix::io::Errno::ACCESS);
        let expected = "cannot open locks/cpu.lock, the lock file of a device: ";
        assert!(closed.to_string().starts_with(expected), "{closed}");
        assert!(closed.remedy().contains(VARIABLE), "{}", closed.remedy());
        let limited = of(rustix::io::Errno::MFILE);
        assert!(limited.remedy().contains("ulimit -n"), "{}", limited.remedy());
    }

    #[test]
    fn a_relative_path_names_a_folder_for_each_current_folder_and_is_refused() {
        for path in ["locks", "~/l", "./locks"] {
            let error = refuse_relative(Some(Path::new(path))).unwrap_err();
            let expected = format!("RAYCL_LOCK_DIR: '{path}' is not an absolute path");
            assert_eq!((error.to_string(), error.exit_code()), (expected, 2));
            assert!(error.remedy().contains("the same folder"), "{}", error.remedy());
        }
        assert!(refuse_relative(Some(Path::new("/tmp/locks"))).is_ok() && refuse_relative(None).is_ok());
    }

    #[test]
    fn links_are_refused_and_nothing_behind_them_is_written() {
        let parent = tempfile::tempdir().unwrap();
        let precious = parent.path().join("precious");
        std::fs::write(&precious, "kept").unwrap();
        let folder = Folder::named(parent.path());
        symlink(&precious, folder.path("a")).unwrap();
        assert!(folder.open("a").is_err());
        std::fs::hard_link(&precious, folder.path("b")).unwrap();
        assert!(folder.open("b").is_err());
        let shared = Folder { path: folder.path("c"), shared: true };
        symlink(parent.path(), &shared.path).unwrap();
        let refused = shared.open("cpu").unwrap_err();
        assert!(shared.unusable("cpu", &refused).to_string().contains("this path is not a folder"));
        assert_eq!(std::fs::read_to_string(&precious).unwrap(), "kept");
    }
}
