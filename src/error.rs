//! Errors that end a command: mistakes of the user, failures of the run, and interruptions.

mod link;
mod nearest;
mod quoted;

pub use link::{broken_link, why_unread};
pub use nearest::{meant, nearest, nearest_file, nearest_file_among, nearest_folder, or_meant};
use quoted::{SHOWN_LINE_BYTES, boundary, cut_long_lines, printable};
pub use quoted::{line_of, shortened, shortened_note};

use std::path::{Path, PathBuf};

use crate::printer::{self, plain};
use crate::reader::{Damaged, NotUtf8, STANDARD_INPUT};
use crate::words::counted;
use miette::{Diagnostic, NamedSource, SourceSpan};
use thiserror::Error;

/// The result type of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An error that ends the command. A failure of a single measured point of an experiment is not an error but
/// an [`Outcome`](crate::record::Outcome).
#[derive(Debug, Error, Diagnostic)]
pub enum Error {
    /// A user error: exit code 2.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Input(#[from] Box<InputError>),
    /// A run that failed: exit code 1.
    #[error("{message}")]
    Run {
        /// The problem, in a sentence.
        message: String,
        /// The remedy: a next step for the user.
        #[help]
        help: String,
    },
    /// The user interrupted the command: exit code 130, as in shells after SIGINT.
    #[error("interrupted: {message}")]
    Interrupted {
        /// How far the command got before the interruption.
        message: String,
        /// The remedy: how to continue the command.
        #[help]
        help: String,
    },
}

/// The default remedy for a user error.
const GENERAL: &str = "`raycl help COMMAND` explains the command's arguments; docs/ in raycl's repository explains raycl's files";
/// The default remedy for a run that failed.
const AGAIN: &str = "run the command again; `raycl devices` shows whether the devices are still there";
/// The remedy for a run that the user interrupted.
const ON: &str =
    "run the same command again to continue; add --resume if the command writes measurements into a folder";
/// The remedy for a file of results that cannot be written, for example because the disk is full.
const ELSEWHERE: &str = "free up space on the file's disk, or choose another folder with --out DIR";
/// The remedy for a file of results that this process may not write, however much space is free.
const ELSEWHERE_ONLY: &str = "`--out DIR` writes elsewhere";
/// The remedy for a file or a folder of results that was removed or moved during a run.
const MOVED: &str = "if the folder was moved, --resume with --out NEW_PLACE continues there. If it was removed, its results are lost";
/// The remedy for standard output that cannot be written to.
const FULL: &str = "if standard output is redirected to a file, free up space on the file's disk";
/// The remedy if this process has too many open files.
const MORE_OPEN_FILES: &str =
    "this process may not open more files: raise the limit on open files, for example with `ulimit -n 1024`";
/// The remedy if all processes of the machine together have too many open files.
const FEWER_OPEN_FILES: &str = "too many files are open on this machine: end other programs";
/// The remedy for a file that would become larger than the system allows.
const LARGER_FILES: &str = "if `ulimit -f` shows a limit, remove it with `ulimit -f unlimited`; otherwise choose a folder on a file system that allows larger files";
/// The remedy for a process or a thread that cannot be started.
const MORE_PROCESSES: &str =
    "check that enough memory is free, and that `ulimit -u` allows more processes and threads";
/// The remedy for a compressed file (.gz) that cannot be decompressed.
const AFRESH: &str = "the file may be cut off or damaged; pack it or download it again";
/// The remedy for a file or a folder that this process may not read.
const NO_PERMISSION: &str = "change the permissions of the file, or those of its folder";
/// The remedy for a bug in raycl.
const FAULT: &str = "this is a bug in raycl: please report it, together with the command that you ran";

/// Returns true if `error` says that this process may not write the file or folder, so that more free space
/// would not help.
pub fn is_forbidden(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{PermissionDenied, ReadOnlyFilesystem};
    matches!(error.kind(), PermissionDenied | ReadOnlyFilesystem)
}

/// Returns the remedy if an operation failed because of a limit on open files or on the sizes of files;
/// `None` if the operation failed for another reason.
#[cfg(unix)]
pub fn limit_advice(error: &std::io::Error) -> Option<&'static str> {
    use rustix::io::Errno;
    // The crate `tempfile` wraps the system's errors, so the error's number (`errno`) is only in the text.
    let text = cause(error);
    [(Errno::MFILE, MORE_OPEN_FILES), (Errno::NFILE, FEWER_OPEN_FILES), (Errno::FBIG, LARGER_FILES)]
        .into_iter()
        .find(|(errno, _)| text.ends_with(&format!("(os error {})", errno.raw_os_error())))
        .map(|(_, remedy)| remedy)
}

/// Returns `None`: raycl recognises errors about limits on open files and on the sizes of files only on Unix.
#[cfg(not(unix))]
pub fn limit_advice(_: &std::io::Error) -> Option<&'static str> {
    None
}

/// Returns the text of an error without the path of the temporary file, which the user does not know. The
/// crate `tempfile` adds the path of the temporary file at the end of the error's text.
pub fn cause(error: &std::io::Error) -> String {
    let text = error.to_string();
    text.split(" at path ").next().unwrap_or_default().to_owned()
}

/// A mistake in the user's input, which is a file or an argument.
#[derive(Debug, Error, Diagnostic)]
#[error("{message}")]
pub struct InputError {
    /// The problem, with the wrong value and the expected value.
    pub message: String,
    /// The file that contains the mistake; the lines around `span` are shown. `None` if no lines of a file are shown.
    #[source_code]
    pub source_code: Option<NamedSource<String>>,
    /// The range of bytes to mark in the file; `None` if no lines of a file are shown.
    #[label("{label}")]
    pub span: Option<SourceSpan>,
    /// The remark that is printed under the marked range.
    pub label: String,
    /// The remedy: a step for the user.
    #[help]
    pub help: String,
}

impl Error {
    /// Returns an error for a mistake in the user's input, without an excerpt of a file.
    pub fn input(message: impl Into<String>) -> Self {
        Self::Input(Box::new(InputError {
            message: plain(&message.into()).into_owned(),
            source_code: None,
            span: None,
            label: String::new(),
            help: GENERAL.to_owned(),
        }))
    }

    /// Returns an error for a bug in raycl, which no input should be able to cause.
    pub fn fault(message: impl Into<String>) -> Self {
        Self::run(message).with_help(FAULT)
    }

    /// Returns an error for a mistake at `span` in a file with this name and this text. If the span covers
    /// several lines, only the part of the span in the span's first line is marked. If this line has more than
    /// `SHOWN_LINE_BYTES` bytes, no line is shown, and the message gives the numbers of the line and the column.
    pub fn in_file(
        name: impl AsRef<str>,
        text: impl Into<String>,
        span: std::ops::Range<usize>,
        message: impl Into<String>,
        label: impl Into<String>,
    ) -> Self {
        let (text, message) = (text.into(), shortened(message));
        let start = boundary(&text, span.start);
        let line = text[start..].split('\n').next().unwrap_or_default();
        let begin = text[..start].rfind('\n').map_or(0, |at| at + 1);
        if start - begin + line.len() > SHOWN_LINE_BYTES {
            let column = 1 + text[begin..start].chars().count();
            let location = format!("{}:{}:{column}", name.as_ref(), line_of(&text, start));
            return Self::input(format!("{location}: {message}"));
        }
        let end = boundary(&text, span.end.clamp(start, start + line.trim_end_matches('\r').len()));
        let (text, cut) = cut_long_lines(printable(text), start);
        Self::Input(Box::new(InputError {
            message,
            source_code: Some(NamedSource::new(printer::line(name.as_ref()), text)),
            span: Some((start - cut..end - cut).into()),
            label: shortened(label),
            help: GENERAL.to_owned(),
        }))
    }

    /// Returns an error for a mistake in a file whose text must not be shown, since the file may belong to
    /// another user. A file may belong to another user if it is not named on the command line, but by a file
    /// in another folder. The text `mistake` must not quote the file.
    pub fn withheld(name: &str, line: usize, mistake: &str) -> Self {
        Self::input(format!("{name}:{line}: {mistake}")).with_help(
            "the file's text is not shown, since the file is outside the folder of the file that names it; open \
             the file to see the line",
        )
    }

    /// Returns an error for a run that failed.
    pub fn run(message: impl Into<String>) -> Self {
        Self::Run { message: plain(&message.into()).into_owned(), help: AGAIN.to_owned() }
    }

    /// Returns an error for a command that the user interrupted.
    pub fn interrupted(message: impl Into<String>) -> Self {
        Self::Interrupted { message: plain(&message.into()).into_owned(), help: ON.to_owned() }
    }

    /// Returns an error for a file of results that cannot be written.
    pub fn unwritable(path: &Path, error: &std::io::Error) -> Self {
        let usual = match error.kind() {
            // raycl creates the file if only the file is missing, so this error means that the file's folder
            // is missing.
            std::io::ErrorKind::NotFound => MOVED,
            _ if is_forbidden(error) => ELSEWHERE_ONLY,
            _ => ELSEWHERE,
        };
        Self::run(format!("cannot write {}: {}", path.display(), cause(error)))
            .with_help(limit_advice(error).unwrap_or(usual))
    }

    /// Returns an error for a file or a folder of results that was removed, moved or replaced during a run.
    pub fn removed(path: &Path) -> Self {
        let what = "or its folder was removed or replaced while this run wrote to it";
        Self::run(format!("{} {what}", path.display())).with_help(MOVED)
    }

    /// Returns an error for a process or a thread that could not be started; `what` is its name in the
    /// message.
    pub fn not_started(what: &str, error: &std::io::Error) -> Self {
        Self::run(format!("{what} could not be started: {error}"))
            .with_help(limit_advice(error).unwrap_or(MORE_PROCESSES))
    }

    /// Returns an error for a thread that could not be started.
    pub fn no_thread(error: &std::io::Error) -> Self {
        Self::not_started("a thread", error)
    }

    /// Returns an error for standard output that cannot be written to, such as a file on a full disk.
    pub fn unwritable_output(error: &std::io::Error) -> Self {
        Self::run(format!("cannot write to standard output: {error}"))
            .with_help(limit_advice(error).unwrap_or(FULL))
    }

    /// Replaces the remedy of [`Error::unwritable`] if it names the option `--out`, which some commands lack. `full` is
    /// the remedy if free space may help, and `forbidden` if this process may not write the file.
    #[must_use]
    pub fn without_out(self, full: &str, forbidden: &str) -> Self {
        match self.remedy() {
            ELSEWHERE => self.with_help(full),
            ELSEWHERE_ONLY => self.with_help(forbidden),
            _ => self,
        }
    }

    /// Returns the remedy: a next step for the user.
    pub fn remedy(&self) -> &str {
        match self {
            Self::Input(error) => &error.help,
            Self::Run { help, .. } | Self::Interrupted { help, .. } => help,
        }
    }

    /// Sets the error's remedy: a next step for the user.
    #[must_use]
    pub fn with_help(mut self, remedy: impl Into<String>) -> Self {
        let remedy = plain(&remedy.into()).into_owned();
        match &mut self {
            Self::Input(error) => error.help = remedy,
            Self::Run { help, .. } | Self::Interrupted { help, .. } => *help = remedy,
        }
        self
    }

    /// Puts `words`, such as the name of the device on which the command failed, in front of the message.
    #[must_use]
    pub fn preceded_by(mut self, words: &str) -> Self {
        let words = plain(words);
        match &mut self {
            Self::Input(error) => error.message.insert_str(0, &words),
            Self::Run { message, .. } | Self::Interrupted { message, .. } => message.insert_str(0, &words),
        }
        self
    }

    /// Adds `how`, a text that says how to continue the command, to the remedy. If the run failed, the text
    /// `how` follows the error's own remedy. If the run was interrupted, the text `how` replaces the error's
    /// own remedy. A mistake in the input is returned unchanged, since the command can be continued only when
    /// the mistake is corrected.
    #[must_use]
    pub fn to_be_continued(self, how: String) -> Self {
        match &self {
            Self::Input(_) => self,
            Self::Run { help, .. } => {
                let help = format!("{help}\n{how}");
                self.with_help(help)
            }
            Self::Interrupted { .. } => self.with_help(how),
        }
    }

    /// Returns an error for a file whose text is not UTF-8. The message gives the first line that is not UTF-8. Returns
    /// `None` if `error` has another cause.
    pub fn not_utf8(path: &Path, error: &std::io::Error) -> Option<Self> {
        let line = NotUtf8::line_of(error)?;
        let message = format!("{}:{line}: not UTF-8 text", path.display());
        Some(Self::input(message).with_help("save the file as UTF-8"))
    }

    /// Returns an error for a file that cannot be read. If the file is missing and its folder has a file with
    /// a similar name, the remedy names that file. If the file is compressed (.gz) and cannot be
    /// decompressed, the remedy says that the file may be damaged. If this process may not read the file, the remedy
    /// names the permissions. If the file's text is not UTF-8, the message gives the line. If none of the causes
    /// above applies, the remedy is the text `otherwise`.
    pub fn unreadable(what: &str, path: &Path, error: &std::io::Error, otherwise: &str) -> Self {
        Self::unreadable_among((what, path), error, |_| true, otherwise)
    }

    /// Like [`unreadable`](Self::unreadable), but the remedy names only a file whose path `fits` accepts.
    pub fn unreadable_among(
        (what, path): (&str, &Path),
        error: &std::io::Error,
        fits: impl Fn(&Path) -> bool,
        otherwise: &str,
    ) -> Self {
        let nearest = |missing: &Path| nearest_file_among(missing, &fits);
        match Self::not_utf8(path, error) {
            Some(not_utf8) => not_utf8,
            None => Self::cannot_read((what, path), error, nearest, otherwise),
        }
    }

    /// Returns an error for a folder that cannot be read. If the folder is missing and a folder with a
    /// similar name exists beside it, the remedy names the existing folder. If the remedy names no folder, it
    /// is the text `otherwise`.
    pub fn unreadable_folder(path: &Path, error: &std::io::Error, otherwise: &str) -> Self {
        Self::cannot_read(("folder", path), error, nearest_folder, otherwise)
    }

    /// Returns an error for a folder that does not exist. If a folder with a similar name exists beside it, the
    /// remedy names the existing folder; otherwise, the remedy is the text `otherwise`.
    pub fn no_folder(path: &Path, otherwise: &str) -> Self {
        let meant = nearest_folder(path).map(|meant| format!("did you mean `{}`?", meant.display()));
        Self::input(format!("there is no folder {}", path.display()))
            .with_help(meant.unwrap_or_else(|| otherwise.to_owned()))
    }

    fn cannot_read(
        (what, path): (&str, &Path),
        error: &std::io::Error,
        nearest: impl Fn(&Path) -> Option<PathBuf>,
        otherwise: &str,
    ) -> Self {
        let is_missing = error.kind() == std::io::ErrorKind::NotFound && path.as_os_str() != STANDARD_INPUT;
        if let Some(link) = is_missing.then(|| broken_link(path)).flatten() {
            return Self::input(format!("the {what} `{}` {link}", path.display()))
                .with_help("restore the link's target, or give another path");
        }
        let meant = is_missing.then(|| nearest(path)).flatten();
        let remedy = match meant {
            Some(meant) => format!("did you mean `{}`?", meant.display()),
            None if Damaged::caused(error) => AFRESH.to_owned(),
            None if error.kind() == std::io::ErrorKind::PermissionDenied => NO_PERMISSION.to_owned(),
            None => otherwise.to_owned(),
        };
        Self::input(format!("cannot read the {what} `{}`: {error}", path.display())).with_help(remedy)
    }

    /// Returns the message as one line, for places that cannot show an excerpt of a file, such as a window's
    /// title. If the mistake is in a file, the returned line begins with the file's name and the line's
    /// number. If the message has several lines, returns its first line and the number of further lines.
    pub fn in_a_line(&self) -> String {
        let message = first_line(&self.to_string());
        let Self::Input(error) = self else { return message };
        let (Some(file), Some(span)) = (&error.source_code, error.span) else { return message };
        let location = format!("{}:{}: ", file.name(), line_of(file.inner(), span.offset()));
        // The messages about some files, such as OBJ files, already begin with the file and the line.
        if message.starts_with(&location) { message } else { location + &message }
    }

    /// Replaces an input error without a location by an error with a location. The function `at` returns an
    /// error with a location for the message of the old error. The new error gets the old error's remedy,
    /// unless the old remedy is the default remedy. Errors other than input errors are returned unchanged.
    #[must_use]
    pub fn placed(self, at: impl FnOnce(String) -> Self) -> Self {
        let Self::Input(input) = self else { return self };
        let InputError { message, help, .. } = *input;
        let placed = at(message);
        if help == GENERAL { placed } else { placed.with_help(help) }
    }

    /// Returns the exit code of the command.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Run { .. } => 1,
            Self::Interrupted { .. } => 130,
        }
    }
}

/// Returns the first non-empty line of `message` and, if there are more non-empty lines, their number.
fn first_line(message: &str) -> String {
    let mut lines = message.lines().map(str::trim_end).filter(|line| !line.is_empty());
    let first = lines.next().unwrap_or_default();
    match lines.count() {
        0 => first.to_owned(),
        others => format!("{first} (and {})", counted(others, "more line")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_files_control_characters_stay_out_of_the_terminal() {
        let text = "# \u{1b}]0;title\u{7}\n\u{9b}2Jv x\n";
        let error = Error::in_file("a.obj", text, 0..1, "no number", "here");
        let Error::Input(input) = error else { panic!("not an input error") };
        let shown = input.source_code.as_ref().unwrap().inner();
        assert_eq!((shown.as_str(), shown.len()), ("# ?]0;title?\n??2Jv x\n", text.len()));
    }

    #[test]
    fn a_similar_name_is_suggested_only_for_a_missing_file() {
        use std::io::ErrorKind;
        let folder = tempfile::tempdir().unwrap();
        let [there, missing] = ["scene.toml", "scnee.toml"].map(|name| folder.path().join(name));
        std::fs::write(&there, "").unwrap();
        let remedy = |path: &Path, kind: ErrorKind| {
            let error = std::io::Error::from(kind);
            Error::unreadable("scene", path, &error, "other").remedy().to_owned()
        };
        let meant = format!("did you mean `{}`?", there.display());
        assert_eq!(remedy(&missing, ErrorKind::NotFound), meant);
        assert_eq!(remedy(&missing, ErrorKind::PermissionDenied), NO_PERMISSION);
        assert_eq!(remedy(&missing, ErrorKind::InvalidInput), "other");
        let among = |fits: fn(&Path) -> bool| {
            let error = std::io::Error::from(ErrorKind::NotFound);
            Error::unreadable_among(("scene", &missing), &error, fits, "other").remedy().to_owned()
        };
        assert_eq!([among(|_| true), among(|_| false)], [meant, "other".to_owned()]);
        // The name `-` stands for standard input, which is never a missing file. If `-` counted as a missing
        // file, raycl would suggest a file with a short name that contains `-`, such as `a-`.
        assert_eq!(remedy(Path::new(STANDARD_INPUT), ErrorKind::NotFound), "other");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_without_a_target_is_not_called_missing_itself() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("link.obj");
        std::os::unix::fs::symlink("gone.obj", &link).unwrap();
        let error = Error::unreadable("mesh", &link, &std::fs::read(&link).unwrap_err(), "other");
        let expected = format!("the mesh `{}` is a link to `gone.obj`, which is missing", link.display());
        assert_eq!((error.to_string(), error.exit_code()), (expected, 2));
        assert!(error.remedy().starts_with("restore the link's target"), "{}", error.remedy());
    }

    #[test]
    fn a_text_that_is_not_utf_8_is_refused_with_its_line() {
        let refused = crate::reader::utf8(b"a\nb\xe9\n".to_vec()).unwrap_err();
        for error in [
            Error::not_utf8(Path::new("a.toml"), &refused).unwrap(),
            Error::unreadable("experiment", Path::new("a.toml"), &refused, "other"),
        ] {
            assert_eq!(error.to_string(), "a.toml:2: not UTF-8 text");
            assert_eq!(error.remedy(), "save the file as UTF-8");
        }
        let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
        assert!(Error::not_utf8(Path::new("a.toml"), &missing).is_none());
    }

    /// Returns the text of an error as it is printed without a terminal. The error is about a mistake in a
    /// file with the contents `text`, at the first occurrence of the text `mark`.
    fn printed(text: &str, mark: &str) -> String {
        let start = text.find(mark).unwrap();
        let error = Error::in_file("a.toml", text, start..start + mark.len(), "a mistake", "here");
        let handler = miette::MietteHandlerOpts::new().wrap_lines(false).color(false).build();
        struct Shown(Error, miette::MietteHandler);
        impl std::fmt::Debug for Shown {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                miette::ReportHandler::debug(&self.1, &self.0, f)
            }
        }
        format!("{:?}", Shown(error, handler))
    }

    #[test]
    fn long_lines_of_a_file_are_cut_or_not_shown() {
        let long = "\u{fc}".repeat(70_000);
        for (text, location) in [
            (format!("# {long}\nbad = 1\n# {long}\n"), "a.toml:2:1"),
            (format!("a = 1\nbad = 1\n# {long}"), "a.toml:2:1"),
            (format!("x = \"{long}\"\n\nab = 1\n  bad = 1\n"), "a.toml:4:3"),
            (format!("a = 1\nx = \"{long}\"; bad\n"), "a.toml:2:70009: a mistake"),
            (format!("bad\n{}", "y\n".repeat(50)), "a.toml:1:1"),
        ] {
            let printed = printed(&text, "bad");
            assert!(printed.contains(location), "{location}: {printed}");
            assert!(printed.lines().all(|line| line.chars().count() < 420), "{location}");
        }
        let mark = format!("bad{}", "\nz".repeat(50));
        assert!(printed(&mark, &mark).lines().count() < 10, "only the first line of a long span is shown");
    }

    #[test]
    fn long_words_of_a_file_are_shortened_in_messages() {
        let error =
            Error::in_file("a.toml", "x\n", 0..1, format!("`{}\u{1b}`, expected y", "k".repeat(9_000)), "");
        let message = error.to_string();
        assert!(message.len() < 400 && message.starts_with("`kk") && message.ends_with("?`, expected y"));
        assert_eq!(nearest(&"k".repeat(9_000), ["k"]), None);
    }

    #[test]
    fn no_error_is_made_without_a_remedy_or_with_what_steers_a_terminal() {
        let located = |message| Error::in_file("a\u{1b}.toml", "a = 1\n", 0..1, message, "here");
        for error in [
            Error::input("a\u{1b}"),
            Error::run("a\u{1b}"),
            Error::fault("a\u{1b}"),
            Error::interrupted("a\u{1b}"),
            Error::unwritable(Path::new("a\u{1b}"), &std::io::Error::other("b\u{1b}")),
            Error::unwritable_output(&std::io::Error::other("a\u{1b}")),
            Error::not_started("a\u{1b}", &std::io::Error::other("b\u{1b}")),
            Error::withheld("a\u{1b}", 1, "b"),
            located("a\u{1b}".into()),
            Error::input("a\u{1b}").placed(located),
            Error::run("a").preceded_by("b\u{1b}"),
        ] {
            let shown = format!("{error} {}", error.remedy());
            assert!(!error.remedy().is_empty() && !shown.contains('\u{1b}'), "{shown:?}");
        }
        let own = Error::input("a").with_help("b\u{1b}").placed(located);
        assert_eq!(own.remedy(), "b\\u001b");
    }

    #[test]
    fn each_kind_of_error_has_its_exit_code_words_and_remedy() {
        let unwritable = |error: &std::io::Error| Error::unwritable(Path::new("a.csv"), error);
        let [forbidden, missing] = [std::io::ErrorKind::PermissionDenied, std::io::ErrorKind::NotFound];
        for (error, code, words, remedy) in [
            (Error::input("a"), 2, "a", "`raycl help COMMAND`"),
            (Error::run("a"), 1, "a", "run the command again; `raycl devices`"),
            (Error::fault("a"), 1, "a", "this is a bug in raycl"),
            (Error::interrupted("a"), 130, "interrupted: a", "run the same command again to continue"),
            (
                unwritable(&std::io::Error::other("b")),
                1,
                "cannot write a.csv: b",
                "free up space on the file's",
            ),
            (unwritable(&forbidden.into()), 1, "cannot write a.csv: permission denied", "`--out DIR` writes"),
            (
                unwritable(&missing.into()),
                1,
                "cannot write a.csv: entity not found",
                "if the folder was moved, ",
            ),
            (Error::withheld("a.mtl", 7, "b"), 2, "a.mtl:7: b", "the file's text is not shown"),
        ] {
            assert_eq!((error.exit_code(), error.to_string().as_str()), (code, words));
            assert!(error.remedy().starts_with(remedy), "{words}: {}", error.remedy());
            assert_eq!(error.with_help("c").remedy(), "c");
        }
    }

    #[test]
    fn words_in_front_of_a_message_change_neither_its_kind_nor_its_remedy() {
        for (error, code) in [(Error::input("a"), 2), (Error::run("a"), 1)] {
            let error = error.with_help("c").preceded_by("on b: ");
            assert_eq!((error.to_string().as_str(), error.remedy()), ("on b: a", "c"));
            assert_eq!(error.exit_code(), code);
        }
    }

    #[test]
    fn a_command_without_the_option_out_names_another_remedy() {
        use std::io::ErrorKind::{PermissionDenied, StorageFull};
        for (kind, remedy) in [(StorageFull, "full"), (PermissionDenied, "forbidden")] {
            let error = Error::unwritable(Path::new("a.csv"), &kind.into());
            assert_eq!(error.without_out("full", "forbidden").remedy(), remedy);
        }
        let own = Error::run("a").with_help("own").without_out("full", "forbidden");
        assert_eq!(own.remedy(), "own");
    }

    #[cfg(unix)]
    #[test]
    fn a_limit_that_was_reached_is_named_in_the_remedy() {
        use rustix::io::Errno;
        let of_system = |errno: Errno| std::io::Error::from_raw_os_error(errno.raw_os_error());
        for (errno, limit) in [
            (Errno::MFILE, "`ulimit -n 1024`"),
            (Errno::NFILE, "end other programs"),
            (Errno::FBIG, "`ulimit -f unlimited`"),
        ] {
            let error = of_system(errno);
            // The crate `tempfile` wraps the system's error in the same way as the next line does, with the
            // path of the temporary file at the end.
            let wrapped = std::io::Error::other(format!("{error} at path \"/a/.raycl-x\""));
            for error in [&error, &wrapped] {
                for error in [
                    Error::unwritable(Path::new("a.csv"), error),
                    Error::unwritable_output(error),
                    Error::not_started("a worker process", error),
                ] {
                    assert!(error.remedy().contains(limit), "{error}: {}", error.remedy());
                }
            }
        }
        let full = Error::unwritable(Path::new("a.csv"), &of_system(Errno::NOSPC));
        assert_eq!(full.remedy(), ELSEWHERE);
        let error = Error::no_thread(&of_system(Errno::AGAIN));
        assert!(error.to_string().starts_with("a thread could not be started: "), "{error}");
        assert!(error.exit_code() == 1 && error.remedy().contains("`ulimit -u`"), "{}", error.remedy());
    }

    #[test]
    fn an_error_without_a_location_keeps_its_own_remedy_when_it_gets_one() {
        let located =
            |message| Error::in_file("a.toml", "a = 1\nb = 2\n", 6..7, message, "here").with_help("new");
        assert_eq!(Error::input("a").placed(located).remedy(), "new");
        let own = Error::input("a").with_help("own").placed(located);
        assert_eq!((own.to_string().as_str(), own.remedy()), ("a", "own"));
        let Error::Input(input_error) = own else { panic!("not an input error") };
        assert_eq!(input_error.span.map(|span| (span.offset(), span.len())), Some((6, 1)));
        assert_eq!(Error::run("a").placed(located).exit_code(), 1, "only input errors have locations");
    }

    #[test]
    fn a_mistake_in_a_file_is_reported_in_one_line_with_its_file_and_line() {
        let long = format!("# {}\n", "x".repeat(1000));
        for (text, line) in [("a = 1\nbad = 1\n".to_owned(), 2), (format!("{long}{long}bad = 1\n"), 3)] {
            let start = text.find("bad").unwrap();
            let error = Error::in_file("a.toml", text, start..start + 3, "unknown key `bad`", "here");
            assert_eq!(error.in_a_line(), format!("a.toml:{line}: unknown key `bad`"));
        }
        let message = "a.obj:2: no number";
        assert_eq!(Error::in_file("a.obj", "v 0 0 0\nv x\n", 8..11, message, "here").in_a_line(), message);
        for error in [Error::input("a"), Error::run("a")] {
            assert_eq!(error.in_a_line(), "a");
        }
    }

    #[test]
    fn of_a_message_of_several_lines_the_first_one_is_a_line() {
        let in_a_line = |message: &str| Error::run(message).in_a_line();
        let of_two = "it fails: a.cl:1: no type\na.cl:2: no name\n";
        assert_eq!(in_a_line(of_two), "it fails: a.cl:1: no type (and 1 more line)");
        assert_eq!(in_a_line("\na\n\nb\nc"), "a (and 2 more lines)");
        let error = Error::in_file("a.toml", "a = 1\nbad = 1\n", 6..9, "unknown key\nremoved", "here");
        assert_eq!(error.in_a_line(), "a.toml:2: unknown key (and 1 more line)");
    }

    #[test]
    fn a_file_that_cannot_be_read_is_named_and_a_damaged_one_is_to_be_packed_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj.gz");
        std::fs::write(&path, b"\x1f\x8b").unwrap();
        let damage = crate::filetype::Opened::at(&path).unwrap_err();
        let error = Error::unreadable("mesh", &path, &damage, "other");
        assert!(
            error
                .to_string()
                .starts_with(&format!("cannot read the mesh `{}`: it cannot be", path.display()))
        );
        assert!(error.remedy().starts_with("the file may be cut off or damaged"), "{}", error.remedy());
    }
}
