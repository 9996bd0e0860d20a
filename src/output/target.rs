//! The path of a single file that a command writes, with the rules for replacing an existing file.

use super::mark::{self, maker};
use super::replace::{Choice, check_writable, folder_of, permit, put};
use crate::error::{Error, Result, cause, limit_advice};
use crate::reader::in_canonical_folder;
use serde::Serialize;
use std::fs::File;
use std::io::{ErrorKind, Result as IoResult, Seek as _, Write};
use std::path::{Path, PathBuf};

/// The path that means standard output.
const STANDARD_OUTPUT: &str = "-";

/// The advice to a user in whose temporary folder no file can be written.
const NO_TEMPORARY: &str = "free up space there, set the environment variable TMPDIR to another folder, or write to a file with `-o FILE`";

/// The path of a file that a command will write, and whether the command may replace an existing file there.
#[derive(Clone, Debug)]
pub struct Target {
    path: PathBuf,
    choice: Choice,
}

impl Target {
    /// Returns the target for an output file that the user named.
    pub fn new(path: impl Into<PathBuf>, choice: Choice) -> Self {
        Self { path: path.into(), choice }
    }

    /// Returns the target for a file in a folder of results, where every file belongs to raycl.
    pub fn of_results(path: impl Into<PathBuf>) -> Self {
        Self::new(path, Choice::new(true, "--out DIR"))
    }

    /// Returns a target for another file in the same folder, with the same rules for replacing an existing file. The
    /// file's name is this target's name without extension, followed by `ending`.
    #[must_use]
    pub fn with_ending(&self, ending: &str) -> Self {
        // A file name need not be valid UTF-8, so the parts of the name are joined as `OsString`s.
        let mut name = self.path.file_stem().unwrap_or_default().to_owned();
        name.push(ending);
        Self { path: self.path.with_file_name(name), choice: self.choice }
    }

    /// Returns true if the target is standard output.
    pub fn is_standard_output(&self) -> bool {
        self.path.as_os_str() == STANDARD_OUTPUT
    }

    /// Returns the target's path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns true if the paths of this target and of `other` lead to the same file, even if the paths are
    /// written differently. Returns false if the folder of one of the two paths does not exist.
    pub fn is_same_file(&self, other: &Self) -> bool {
        in_canonical_folder(&self.path).is_some_and(|path| in_canonical_folder(&other.path) == Some(path))
    }

    /// Returns an error if the file's folder does not exist.
    pub fn check_folder(&self) -> Result<()> {
        folder_of(&self.path).map(drop)
    }

    /// Returns an error if [`write`](Self::write) would refuse the path, or if this process may not create
    /// files in the file's folder. Commands call `check` before their work, so that a wrong path is reported
    /// at once.
    pub fn check(&self) -> Result<()> {
        if self.is_standard_output() {
            return Ok(());
        }
        folder_of(&self.path)?;
        permit(&self.path, self.choice, maker)?;
        check_writable(&self.path, self.choice)
    }

    /// Returns an error if the command reads the file: not even `--force` replaces a file that the command
    /// reads. If the file is missing, the error prevents a later command from reading the new file in its place.
    /// `is_read` gets the file's path, in which the folder's part is canonical (absolute, without links and `..`), and
    /// returns true if the command has read, or tried to read, this file. In the message, `what` says what the file is,
    /// such as "a file of the scene".
    pub fn check_unread(&self, what: &str, is_read: impl FnOnce(&Path) -> bool) -> Result<()> {
        let path = if self.is_standard_output() { None } else { in_canonical_folder(&self.path) };
        let Some(path) = path.filter(|path| is_read(path)) else { return Ok(()) };
        let name = self.path.display();
        let message = match path.symlink_metadata() {
            Ok(_) => format!("'{name}' is {what}, and is not replaced"),
            Err(_) => format!(
                "'{name}' is {what}, but does not exist: later commands would read what is written there"
            ),
        };
        Err(Error::input(message).with_help(format!("`{}` writes elsewhere", self.choice.elsewhere)))
    }

    /// Writes a file by calling `write`, whose output includes a blank mark (zeros in place of the hash).
    /// After that, this function replaces the zeros of the blank mark by the hash of the rest of the file.
    /// The file appears at its path completely or not at all.
    pub fn write(&self, write: impl FnOnce(&mut File) -> IoResult<()>) -> Result<()> {
        if self.is_standard_output() {
            return to_standard_output(write);
        }
        put(&self.path, self.choice, maker, |file| {
            write(file)?;
            mark::seal(file)
        })
    }

    /// Writes indented JSON with a mark (a hash of the rest of the file). If the target is a file, the file's
    /// data is on the disk when this function returns.
    pub fn write_json(&self, value: &impl Serialize) -> Result<()> {
        let text = serde_json::to_string_pretty(value).map_err(|error| Error::fault(error.to_string()))?;
        let text = mark::json(&text);
        if self.is_standard_output() {
            return to_standard_output(|file| writeln!(file, "{text}"));
        }
        put(&self.path, self.choice, maker, |file| {
            writeln!(file, "{text}")?;
            mark::seal(file)?;
            file.sync_all()
        })
    }
}

/// Writes to standard output. The output is first written to a temporary file, because the hash in the
/// output's mark is known only at the end, and a pipe cannot seek back to the mark.
fn to_standard_output(write: impl FnOnce(&mut File) -> IoResult<()>) -> Result<()> {
    let file = temporary(&std::env::temp_dir(), write)?;
    copy(file, &mut std::io::stdout().lock())
}

/// Copies the rest of a file, after its current position, to `out`, which is standard output. A closed pipe
/// is not an error: the program that reads the pipe needs no more of the file.
fn copy(mut file: File, out: &mut impl Write) -> Result<()> {
    match std::io::copy(&mut file, out).and_then(|_| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Error::unwritable_output(&error)),
        _ => Ok(()),
    }
}

/// Writes a temporary file without a name in a folder, and returns the file, positioned at its beginning. If
/// no file can be created in the folder, the temporary file is in memory on Linux, so that a container whose folders
/// are read-only can write to standard output.
fn temporary(folder: &Path, write: impl FnOnce(&mut File) -> IoResult<()>) -> Result<File> {
    let written = || -> IoResult<File> {
        let mut file = tempfile::tempfile_in(folder).or_else(|error| in_memory().map_err(|_| error))?;
        write(&mut file)?;
        mark::seal(&mut file)?;
        file.rewind()?;
        Ok(file)
    };
    written().map_err(|error| {
        let folder = folder.display();
        Error::run(format!("cannot write a temporary file in the folder '{folder}': {}", cause(&error)))
            .with_help(limit_advice(&error).unwrap_or(NO_TEMPORARY))
    })
}

/// Creates a file whose data is in memory.
#[cfg(target_os = "linux")]
pub fn in_memory() -> IoResult<File> {
    use rustix::fs::{MemfdFlags, memfd_create};
    let file = memfd_create("raycl", MemfdFlags::CLOEXEC)?;
    Ok(File::from(file))
}

/// Returns an error: only on Linux can raycl create a file whose data is in memory.
#[cfg(not(target_os = "linux"))]
pub fn in_memory() -> IoResult<File> {
    Err(ErrorKind::Unsupported.into())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    const KEEP: Choice = Choice::new(false, "-o FILE");

    fn target(folder: &tempfile::TempDir) -> Target {
        Target::new(folder.path().join("a.json"), KEEP)
    }

    #[test]
    fn a_file_that_the_command_reads_is_refused_even_with_force_or_if_it_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let read = folder.path().canonicalize().unwrap().join("a.json");
        let check = |name: &str| {
            let target = Target::new(folder.path().join(name), Choice::new(true, "-o FILE"));
            target.check_unread("a file of the test", |path| path == read)
        };
        let why = [
            "is a file of the test, but does not exist: later commands would read what is written there",
            "is a file of the test, and is not replaced",
        ];
        for why in why {
            let error = check("a.json").unwrap_err();
            assert_eq!(error.to_string(), format!("'{}' {why}", folder.path().join("a.json").display()));
            assert_eq!((error.exit_code(), error.remedy()), (2, "`-o FILE` writes elsewhere"));
            assert!(check("b.json").is_ok());
            for name in ["a.json", "b.json"] {
                std::fs::write(folder.path().join(name), "{}").unwrap();
            }
        }
        assert!(Target::new("-", KEEP).check_unread("a file", |_| true).is_ok());
    }

    #[test]
    fn json_is_replaced_until_somebody_changes_it() {
        let folder = tempfile::tempdir().unwrap();
        let target = target(&folder);
        target.write_json(&serde_json::json!([{"a": 1}])).unwrap();
        target.check().unwrap();
        target.write_json(&serde_json::json!([{"a": 2}])).unwrap();
        let text = std::fs::read_to_string(target.path()).unwrap();
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(value[0]["a"], 2);
        std::fs::write(target.path(), text.replace("2", "3")).unwrap();
        assert_eq!(target.check().unwrap_err().exit_code(), 2);
        assert!(target.write_json(&value).is_err());
    }

    #[test]
    fn json_for_standard_output_makes_no_file() {
        Target::new("-", KEEP).write_json(&serde_json::json!([{"a": 1}])).unwrap();
        assert!(!Path::new("-").exists());
    }

    #[test]
    fn a_temporary_file_that_cannot_be_written_is_not_blamed_on_standard_output() {
        let parent = tempfile::tempdir().unwrap();
        let full = |_: &mut File| -> IoResult<()> { Err(std::io::ErrorKind::StorageFull.into()) };
        let error = temporary(parent.path(), full).unwrap_err();
        let expected = format!("cannot write a temporary file in the folder '{}': ", parent.path().display());
        assert!(error.to_string().starts_with(&expected), "{error}");
        assert!(error.exit_code() == 1 && error.remedy().contains("TMPDIR"), "{}", error.remedy());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn without_a_folder_for_temporary_files_the_file_is_in_memory() {
        let parent = tempfile::tempdir().unwrap();
        let missing = parent.path().join("missing");
        let [written, usual] = [missing.as_path(), parent.path()].map(|folder| {
            let mut bytes = Vec::new();
            let file = temporary(folder, |file| write!(file, "{} 17", mark::blank())).unwrap();
            copy(file, &mut bytes).unwrap();
            bytes
        });
        assert!(written == usual && written.ends_with(b" 17"));
        assert!(!missing.exists());
    }

    /// A standard output that cannot be written to, for the given reason.
    struct Closed(ErrorKind);

    impl Write for Closed {
        fn write(&mut self, _: &[u8]) -> IoResult<usize> {
            Err(self.0.into())
        }
        fn flush(&mut self) -> IoResult<()> {
            Ok(())
        }
    }

    #[test]
    fn a_reader_that_goes_away_is_no_error_and_a_full_disk_is_one() {
        let to = |kind| {
            let file = temporary(&std::env::temp_dir(), |file| write!(file, "{}", mark::blank())).unwrap();
            copy(file, &mut Closed(kind))
        };
        to(ErrorKind::BrokenPipe).unwrap();
        let error = to(ErrorKind::StorageFull).unwrap_err();
        assert!(error.to_string().starts_with("cannot write to standard output: "), "{error}");
        assert!(error.exit_code() == 1 && error.remedy().contains("free up space"), "{}", error.remedy());
    }

    /// If another program makes a file at the target's path while raycl writes, raycl does not replace the
    /// other program's file.
    #[test]
    fn what_comes_or_changes_meanwhile_stays() {
        let folder = tempfile::tempdir().unwrap();
        let target = target(&folder);
        let mine = |file: &mut File| {
            std::fs::write(target.path(), "mine")?;
            write!(file, "{}", mark::blank())
        };
        assert!(target.write(mine).unwrap_err().to_string().contains("raycl did not make it"));
        assert_eq!(std::fs::read(target.path()).unwrap(), b"mine");
        std::fs::remove_file(target.path()).unwrap();
        target.write(|file| write!(file, "{}", mark::blank())).unwrap();
        assert!(target.write(mine).is_err());
        assert_eq!(std::fs::read(target.path()).unwrap(), b"mine");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_is_the_same_however_its_path_is_written() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("inner")).unwrap();
        let target = |name: &str| Target::new(folder.path().join(name), KEEP);
        for same in ["a.png", "./a.png", "inner/../a.png"] {
            assert!(target("a.png").is_same_file(&target(same)), "{same}");
        }
        for other in ["b.png", "inner/a.png", "missing/a.png"] {
            assert!(!target("a.png").is_same_file(&target(other)), "{other}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_name_that_is_not_utf_8_keeps_its_bytes_before_another_ending() {
        use std::os::unix::ffi::OsStrExt as _;
        let named = |name: &[u8]| {
            let target = Target::new(std::ffi::OsStr::from_bytes(name), KEEP);
            target.with_ending("-0001.png").path().as_os_str().as_bytes().to_vec()
        };
        assert_eq!(named(b"turn/f\xff.png"), b"turn/f\xff-0001.png");
        assert_eq!(named(b"f.v1.png"), b"f.v1-0001.png");
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_folders_stay_even_with_force() {
        let folder = tempfile::tempdir().unwrap();
        for path in [Path::new("/dev/null"), folder.path()] {
            let target = Target::new(path, Choice { force: true, ..KEEP });
            assert_eq!(target.check().unwrap_err().exit_code(), 2);
        }
    }

    #[test]
    fn every_file_in_a_folder_of_results_is_raycls_own() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.html");
        std::fs::write(&path, "mine").unwrap();
        assert!(Target::new(&path, KEEP).check().is_err());
        let target = Target::of_results(&path);
        target.check().unwrap();
        target.write(|file| write!(file, "{}", mark::blank())).unwrap();
        assert_ne!(std::fs::read(&path).unwrap(), b"mine");
    }

    #[test]
    fn a_missing_folder_is_reported_before_any_work() {
        let folder = tempfile::tempdir().unwrap();
        let target = Target::new(folder.path().join("nowhere/a.png"), KEEP);
        for error in [target.check().unwrap_err(), target.check_folder().unwrap_err()] {
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains("there is no folder '"), "{error}");
        }
        assert!(Target::new("-", KEEP).check().is_ok() && Target::new("-", KEEP).is_standard_output());
    }

    /// Not even the superuser can create files in /proc/sys.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_that_cannot_be_written_to_is_reported_before_any_work() {
        let target = Target::new("/proc/sys/a.png", KEEP);
        let error = target.check().unwrap_err();
        assert_eq!(error.exit_code(), 2);
        let expected = "cannot write '/proc/sys/a.png': the folder '/proc/sys' cannot be written to (";
        assert!(error.to_string().starts_with(expected), "{error}");
        assert_eq!(error.remedy(), "write to another folder with `-o FILE`");
        // `check_folder` accepts the folder: if all frames of a moving picture exist already, no frame has to
        // be written into the folder.
        target.check_folder().unwrap();
    }
}
