//! Puts a new file at an output path, or refuses to replace an existing file at this path.

use super::mark::Maker;
use super::unfinished::Unfinished;
use crate::error::{Error, Result, cause, limit_advice};
use crate::existing;
use crate::reader::{self, may_write, names_a_folder};
use crate::words::{path_word, quote};
use std::fs::File;
use std::io::{Error as IoError, ErrorKind, Result as IoResult};
use std::path::Path;
use tempfile::NamedTempFile;

/// Whether a command may replace files that raycl did not make, and how the user can choose another path.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// True if files that raycl did not make may be replaced.
    pub force: bool,
    /// The command's option that sets another output path, such as `-o FILE`.
    pub elsewhere: &'static str,
    /// True if the command has the option `--force`.
    pub(super) has_force: bool,
}

impl Choice {
    /// Returns the `Choice` of a command that has the option `--force`. `force` is true if the user gave this
    /// option.
    pub const fn new(force: bool, elsewhere: &'static str) -> Self {
        Self { force, elsewhere, has_force: true }
    }

    /// Returns the `Choice` of a command that has no option `--force`, or of a caller of the library.
    pub const fn without_force(elsewhere: &'static str) -> Self {
        Self { force: false, elsewhere, has_force: false }
    }

    /// Returns the advice to a user whose file is not replaced. The advice names `--force`, if the command
    /// has this option, and the option that sets another output path.
    fn help(self, what_force_does: &str) -> String {
        let force = if self.has_force { format!("`--force` {what_force_does}, ") } else { String::new() };
        format!("{force}`{}` writes elsewhere", self.elsewhere)
    }

    /// Returns the advice to a user in whose folder no file can be created.
    fn other_folder(self) -> String {
        format!("write to another folder with `{}`", self.elsewhere)
    }
}

/// Whether a path is free, or names a file that may be replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Name {
    Free,
    /// A file has this path and may be replaced.
    Replaceable,
}

/// Finds out whether a path is free, or in use by a file that may be replaced. Returns an error for paths
/// that no file can have, and for folders and devices. Without `--force`, also returns an error for links,
/// for files that raycl did not make, for files that somebody has changed, and for files that cannot be read.
pub(super) fn permit(
    path: &Path,
    choice: Choice,
    maker: impl FnOnce(&mut File) -> IoResult<Maker>,
) -> Result<Name> {
    let name = path.display();
    let refuse = |why: String, help: String| Err(Error::input(why).with_help(help));
    let elsewhere = format!("`{}` writes elsewhere", choice.elsewhere);
    let there = match path.symlink_metadata() {
        Ok(there) => there,
        Err(_) if names_a_folder(path) => {
            return refuse(format!("'{name}' names a folder; expected a file"), elsewhere);
        }
        Err(error) => return impossible(path, choice, &error).map_or(Ok(Name::Free), Err),
    };
    if there.is_dir() {
        return refuse(format!("'{name}' is a folder; expected a file"), elsewhere);
    }
    if !there.is_file() && !there.is_symlink() {
        return refuse(format!("'{name}' is not an ordinary file, and is not replaced"), elsewhere);
    }
    if choice.force {
        return Ok(Name::Replaceable);
    }
    if there.is_symlink() {
        let help = choice.help("replaces the link and not its target");
        return refuse(format!("'{name}' is a link, and is not replaced"), help);
    }
    let why = match File::open(path).and_then(|mut file| maker(&mut file)) {
        Ok(Maker::Raycl) => return Ok(Name::Replaceable),
        Ok(Maker::Changed) => "has been changed since raycl made it".to_owned(),
        Ok(Maker::Other) => "exists, and raycl did not make it".to_owned(),
        Err(error) => {
            let kind = error.kind();
            format!("exists, but cannot be read ({kind}), so raycl cannot tell whether raycl made it")
        }
    };
    refuse(format!("'{name}' {why}"), choice.help("replaces it"))
}

/// Writes a file by calling `write` and puts the file into its place, completely or not at all. If the
/// process is killed while `write` runs, an incomplete file stays only if the system or the file system does
/// not support files without names. Before the file is put into its place, the path is checked again, since
/// another program may have created a file at the path meanwhile.
pub(super) fn put(
    path: &Path,
    choice: Choice,
    maker: impl Fn(&mut File) -> IoResult<Maker>,
    write: impl FnOnce(&mut File) -> IoResult<()>,
) -> Result<()> {
    let failed = |error: IoError| match error.kind() {
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            Error::run(closed(path, &error)).with_help(choice.other_folder())
        }
        _ => impossible(path, choice, &error).unwrap_or_else(|| {
            let usual =
                || format!("free up space on the disk, or write elsewhere with `{}`", choice.elsewhere);
            let help = limit_advice(&error).map_or_else(usual, str::to_owned);
            Error::run(format!("cannot write '{}': {}", path.display(), cause(&error))).with_help(help)
        }),
    };
    let folder = folder_of(path)?;
    let mut unfinished = Unfinished::in_folder(folder).map_err(failed)?;
    write(unfinished.file()).map_err(failed)?;
    let name = permit(path, choice, &maker)?;
    let must_be_new = name == Name::Free && !choice.force;
    // If the file has no name yet, `link_to` gives it the final name. A process that is killed before
    // `link_to` then leaves no file behind.
    if must_be_new && unfinished.link_to(path).map_err(|_| appeared(path, choice))? {
        return Ok(());
    }
    let file = unfinished.named(folder).map_err(failed)?;
    match name {
        Name::Free if must_be_new => persist_new(file, path).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => appeared(path, choice),
            _ => failed(error),
        }),
        Name::Free => replace(file, path).map_err(failed),
        Name::Replaceable => {
            keep_permissions(&file, path);
            replace(file, path).map_err(|error| match error.kind() {
                ErrorKind::PermissionDenied => irreplaceable(path, choice, &error),
                _ => failed(error),
            })
        }
    }
}

/// Returns the error for a path that no file can have, such as a path with a name that is too long; `None` if
/// `error` has another cause.
fn impossible(path: &Path, choice: Choice, error: &IoError) -> Option<Error> {
    use ErrorKind::{InvalidFilename, IsADirectory, NotADirectory};
    matches!(error.kind(), InvalidFilename | IsADirectory | NotADirectory).then(|| {
        Error::input(format!("cannot write '{}': {}", path.display(), cause(error)))
            .with_help(format!("`{}` writes elsewhere", choice.elsewhere))
    })
}

/// Returns the error for a file that cannot be replaced although new files can be created in its folder. For example,
/// the file belongs to another user, and the folder has the sticky bit.
fn irreplaceable(path: &Path, choice: Choice, error: &IoError) -> Error {
    Error::run(format!("cannot replace '{}': {}", path.display(), error.kind()))
        .with_help(format!("write elsewhere with `{}`", choice.elsewhere))
}

/// Returns an error if this process may not create files in the folder of `path`.
pub(super) fn check_writable(path: &Path, choice: Choice) -> Result<()> {
    may_write(reader::folder_of(path))
        .map_err(|error| Error::input(closed(path, &error)).with_help(choice.other_folder()))
}

/// Returns the message about a folder in which no file can be created.
fn closed(path: &Path, error: &IoError) -> String {
    let (name, folder) = (path.display(), reader::folder_of(path).display());
    format!("cannot write '{name}': the folder '{folder}' cannot be written to ({})", error.kind())
}

/// Returns the error for a file that another program made at the output path after raycl last checked the
/// path.
fn appeared(path: &Path, choice: Choice) -> Error {
    let message =
        format!("another program made the file '{}' while this command was running", path.display());
    Error::input(message).with_help(choice.help("replaces it"))
}

/// Renames a temporary file to `path`, and fails if another file has this name.
fn persist_new(file: NamedTempFile, path: &Path) -> IoResult<()> {
    match file.persist_noclobber(path) {
        Ok(_) => Ok(()),
        Err(error) if error.error.kind() == ErrorKind::AlreadyExists => Err(error.error),
        // Some file systems cannot rename a file without the risk of replacing another file. The rename may
        // have failed for this reason, so this function reserves the name with an empty file, and then
        // replaces the empty file.
        Err(error) => {
            File::create_new(path)?;
            replace(error.file, path).inspect_err(|_| {
                let _ = std::fs::remove_file(path);
            })
        }
    }
}

#[allow(clippy::disallowed_methods, reason = "the caller has checked that the file may be replaced")]
fn replace(file: NamedTempFile, path: &Path) -> IoResult<()> {
    file.persist(path).map(drop).map_err(|error| error.error)
}

/// Gives a new file the permissions of the file that it will replace, so that a file in a folder that several users
/// share stays writable for the group. If the file system refuses these permissions, the new file keeps the
/// usual ones.
#[cfg(unix)]
fn keep_permissions(new: &NamedTempFile, replaced: &Path) {
    use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
    // A link has no permissions of its own.
    let old = replaced.symlink_metadata().ok().filter(std::fs::Metadata::is_file);
    let (Some(old), Ok(own)) = (old, new.as_file().metadata()) else { return };
    // If the new file belongs to another group, it does not get the replaced file's permissions for the
    // group.
    let kept = if old.gid() == own.gid() { 0o777 } else { 0o707 };
    // The owner must be able to read the file, so that later commands of raycl can see that raycl made the
    // file.
    let mode = (old.mode() & kept) | 0o400;
    let _ = new.as_file().set_permissions(std::fs::Permissions::from_mode(mode));
}

#[cfg(not(unix))]
fn keep_permissions(_: &NamedTempFile, _: &Path) {}

/// Returns the folder of a new file. Returns an error if the folder does not exist or cannot be opened.
pub(super) fn folder_of(path: &Path) -> Result<&Path> {
    let (folder, name) = (reader::folder_of(path), path.display());
    // A deleted folder stays the current folder of a process, but no file can be created in it.
    let is_gone = |error: IoError| error.kind() == ErrorKind::NotFound;
    if folder.is_relative() && std::env::current_dir().is_err_and(is_gone) {
        let message = format!("cannot write '{name}': the current folder no longer exists");
        return Err(Error::input(message).with_help("change to a folder that exists"));
    }
    match existing::metadata(folder) {
        Ok(Some(there)) if there.is_dir() => return Ok(folder),
        Ok(_) => {}
        Err(error) => {
            let why = format!("cannot open the folder '{}': {error}", folder.display());
            return Err(existing::failed(format!("cannot write '{name}': {why}"), &error));
        }
    }
    if let Some(file) = folder.ancestors().find(|part| part.exists() && !part.is_dir()) {
        let message = format!("cannot write '{name}': '{}' is a file, not a folder", file.display());
        return Err(Error::input(message).with_help("give a path whose folder exists"));
    }
    let message = format!("cannot write '{name}': there is no folder '{}'", folder.display());
    let command = format!("mkdir -p {}", quote(&path_word(folder)));
    Err(Error::input(message).with_help(format!("create this folder first: {command}")))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_cannot_be_read_stays_and_is_not_said_to_be_anybodys() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        std::fs::write(&path, "text").unwrap();
        let choice = Choice::new(false, "-o FILE");
        let closed = |_: &mut File| Err(IoError::from(ErrorKind::PermissionDenied));
        let error = permit(&path, choice, closed).unwrap_err();
        let why =
            "exists, but cannot be read (permission denied), so raycl cannot tell whether raycl made it";
        assert_eq!(error.to_string(), format!("'{}' {why}", path.display()));
        assert_eq!(
            (error.exit_code(), error.remedy()),
            (2, "`--force` replaces it, `-o FILE` writes elsewhere")
        );
        assert_eq!(permit(&path, choice, |_| Ok(Maker::Raycl)).unwrap(), Name::Replaceable);
    }

    #[test]
    fn a_refusal_names_the_path_the_reason_and_the_ways_out() {
        let folder = tempfile::tempdir().unwrap();
        let choice = Choice::new(false, "-o FILE");
        let name = |name: &str| folder.path().join(name);
        std::fs::write(name("a.png"), "text").unwrap();
        let refusal = |path: &Path, maker| permit(path, choice, |_| Ok(maker)).unwrap_err();
        for (path, maker, why, help) in [
            (name("a.png"), Maker::Other, "exists, and raycl did not make it", "`--force` replaces it, "),
            (
                name("a.png"),
                Maker::Changed,
                "has been changed since raycl made it",
                "`--force` replaces it, ",
            ),
            (folder.path().to_owned(), Maker::Raycl, "is a folder; expected a file", ""),
        ] {
            let error = refusal(&path, maker);
            assert_eq!(error.to_string(), format!("'{}' {why}", path.display()));
            assert_eq!(error.remedy(), format!("{help}`-o FILE` writes elsewhere"));
        }
        // Some commands have no option `--force`, and functions of the library have no options. The advice
        // for commands and functions without `--force` does not name `--force`.
        let without = permit(&name("a.png"), Choice::without_force("-o FILE"), |_| Ok(Maker::Other));
        assert_eq!(without.unwrap_err().remedy(), "`-o FILE` writes elsewhere");
        assert_eq!(permit(&name("b.png"), choice, |_| Ok(Maker::Other)).unwrap(), Name::Free);
        let error = folder_of(Path::new("nowhere/a.png")).unwrap_err();
        assert_eq!(error.to_string(), "cannot write 'nowhere/a.png': there is no folder 'nowhere'");
        // The `mkdir` command that the advice suggests works in a shell, whatever characters the folder's
        // name contains.
        for (path, word) in [
            ("nowhere/a.png", "nowhere"),
            ("it's/a.png", r"'it'\''s'"),
            ("-p/a.png", "./-p"),
            ("a b/a.png", "'a b'"),
        ] {
            let remedy = format!("create this folder first: mkdir -p {word}");
            assert_eq!(folder_of(Path::new(path)).unwrap_err().remedy(), remedy);
        }
        for path in [name("a.png/b.png"), name("a.png/inner/b.png")] {
            let error = folder_of(&path).unwrap_err();
            let why = format!("'{}' is a file, not a folder", name("a.png").display());
            assert_eq!(error.to_string(), format!("cannot write '{}': {why}", path.display()));
            assert_eq!((error.exit_code(), error.remedy()), (2, "give a path whose folder exists"));
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_that_cannot_be_opened_is_not_said_to_be_missing() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("endless");
        std::os::unix::fs::symlink(&folder, &folder).unwrap();
        let path = folder.join("a.png");
        let error = folder_of(&path).unwrap_err();
        let (name, folder) = (path.display(), folder.display());
        let expected = format!("cannot write '{name}': cannot open the folder '{folder}': ");
        assert!(error.to_string().starts_with(&expected), "{error}");
        assert_eq!(error.exit_code(), 2);
        assert!(error.remedy().starts_with("a link in this path leads back to itself"), "{}", error.remedy());
    }

    #[cfg(unix)]
    #[test]
    fn a_path_that_no_file_can_have_is_the_users_mistake() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("b.png"), "text").unwrap();
        let choice = Choice::new(true, "-o FILE");
        let long = format!("{}.png", "k".repeat(300));
        for name in ["a.png/", "a.png/.", "b.png/", "b.png/c.png", &long] {
            let refused = permit(&folder.path().join(name), choice, |_| Ok(Maker::Raycl)).unwrap_err();
            assert_eq!((refused.exit_code(), refused.remedy()), (2, "`-o FILE` writes elsewhere"), "{name}");
        }
        let named = permit(&folder.path().join("a.png/"), choice, |_| Ok(Maker::Raycl)).unwrap_err();
        assert!(named.to_string().ends_with("a.png/' names a folder; expected a file"), "{named}");
        assert!(impossible(&folder.path().join("c.png"), choice, &ErrorKind::StorageFull.into()).is_none());
    }

    #[test]
    fn nothing_is_in_the_folder_until_the_file_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let files = || std::fs::read_dir(folder.path()).unwrap().count();
        // Some file systems do not support files without names.
        let has_unnamed = matches!(Unfinished::in_folder(folder.path()).unwrap(), Unfinished::Unnamed(_));
        let path = folder.path().join("a.png");
        for force in [false, true] {
            let choice = Choice::new(force, "-o FILE");
            let write = |file: &mut File| {
                assert_eq!(files(), usize::from(!has_unnamed) + usize::from(force));
                std::io::Write::write_all(file, if force { b"new" } else { b"old" })
            };
            put(&path, choice, |_| Ok(Maker::Raycl), write).unwrap();
            assert_eq!(files(), 1);
        }
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_is_replaced_keeps_its_permissions() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let choice = Choice::new(false, "-o FILE");
        let write = |text: &'static [u8]| {
            put(&path, choice, |_| Ok(Maker::Raycl), |file| std::io::Write::write_all(file, text)).unwrap();
        };
        write(b"old");
        for mode in [0o444, 0o664, 0o600] {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
            write(b"new");
            assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, mode);
            assert_eq!(std::fs::read(&path).unwrap(), b"new");
        }
    }

    #[test]
    fn a_message_names_the_folder_and_no_temporary_file() {
        let read_only = closed(Path::new("a.png"), &IoError::from(ErrorKind::ReadOnlyFilesystem));
        let expected = "cannot write 'a.png': the folder '.' cannot be written to (read-only ";
        assert!(read_only.starts_with(expected), "{read_only}");
        // Nobody, not even the superuser, can create files in the folder /proc.
        if cfg!(target_os = "linux") {
            let path = Path::new("/proc/a.png");
            let choice = Choice::new(false, "-o FILE");
            let error = put(path, choice, |_| Ok(Maker::Raycl), |_| Ok(())).unwrap_err();
            assert_eq!(error.exit_code(), 1);
            let message = error.to_string();
            assert!(message.starts_with("cannot write '/proc/a.png': "), "{message}");
            assert!(!message.contains(".raycl-"), "{message}");
        }
    }

    #[test]
    fn a_file_that_cannot_be_replaced_is_named_without_its_folder() {
        let choice = Choice::new(true, "-o FILE");
        let error = irreplaceable(Path::new("/tmp/a.png"), choice, &ErrorKind::PermissionDenied.into());
        assert_eq!(error.to_string(), "cannot replace '/tmp/a.png': permission denied");
        assert_eq!((error.exit_code(), error.remedy()), (1, "write elsewhere with `-o FILE`"));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_replaced_only_with_force_and_its_target_stays() {
        let folder = tempfile::tempdir().unwrap();
        let [link, target] = ["link.png", "target.png"].map(|name| folder.path().join(name));
        std::fs::write(&target, "mine").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        let put_with = |force| {
            let choice = Choice::new(force, "-o FILE");
            put(&link, choice, |_| Ok(Maker::Raycl), |file| std::io::Write::write_all(file, b"new"))
        };
        let error = put_with(false).unwrap_err();
        assert_eq!(error.to_string(), format!("'{}' is a link, and is not replaced", link.display()));
        assert!(error.remedy().starts_with("`--force` replaces the link and not its target, "));
        put_with(true).unwrap();
        assert!(!link.is_symlink());
        assert_eq!(
            [&link, &target].map(|path| std::fs::read(path).unwrap()),
            [b"new".to_vec(), b"mine".to_vec()]
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_replaces_one_that_nobody_may_read_can_be_read_later() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        std::fs::write(&path, "mine").unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o200)).unwrap();
        let write = |file: &mut File| std::io::Write::write_all(file, b"new");
        put(&path, Choice::new(true, "-o FILE"), |_| Ok(Maker::Other), write).unwrap();
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }
}
