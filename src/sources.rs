//! Kernel source files: the files built into the binary, and the files of a folder. A file of the folder replaces the
//! built-in file of the same name, or is an additional file.

mod lines;
mod positions;

use crate::error::{Error, Result, line_of, nearest};
use crate::existing;
use crate::reader::{self, Kind};
use crate::threads::locked;
use crate::words::counted;
use include_dir::{Dir, include_dir};
pub use lines::{SourceLine, lines};
use positions::in_files;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

static EMBEDDED: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/cl");

/// The origin of kernel source files.
#[derive(Clone, Debug, Default)]
pub enum Sources {
    /// The files that are built into this binary.
    #[default]
    Embedded,
    /// A folder laid out like `cl/`, for users who edit kernels. Files that are not in the folder come from
    /// the binary.
    Folder(PathBuf),
}

impl Sources {
    /// Returns the text of the kernel file `name`, a path relative to `cl/`. If there is a user's folder, the text
    /// of the built-in file is returned only if nothing is at the path in the user's folder, not even a link that
    /// leads nowhere.
    pub fn read(&self, name: &str) -> Result<String> {
        if let Self::Folder(folder) = self {
            let path = folder.join(name);
            if existing::is_entry(&path)? {
                return read_inside(&path, folder);
            }
        }
        built_in(name).map(str::to_owned).ok_or_else(|| self.lacks(name))
    }

    /// Returns the lines of the file `name`, whose text is `text`. Each built-in file is split into lines
    /// only once per process, since a run joins the same files for one point after another.
    ///
    /// # Errors
    ///
    /// Fails under the same conditions as [`lines`].
    pub fn lines_of<'a>(&self, name: &str, text: &'a str) -> Result<Cow<'a, [SourceLine<'a>]>> {
        match built_in_lines(name, text) {
            Some(known) => Ok(Cow::Borrowed(known)),
            None => lines(&self.path_of(name), text).map(Cow::Owned),
        }
    }

    fn lacks(&self, name: &str) -> Error {
        let Self::Folder(folder) = self else {
            return Error::input(format!("there is no kernel file {name}")).with_help(LAYOUT);
        };
        let message = format!("there is no kernel file {name}, neither in {} nor built in", folder.display());
        let files = self.files().unwrap_or_default();
        Error::input(message).with_help(match meant_file(name, files.iter().map(String::as_str)) {
            Some(meant) => format!("did you mean {meant}?"),
            None => LAYOUT.to_owned(),
        })
    }

    /// Returns an error about the line `#include "path"` that has the number `line` in `file`. If the error is a
    /// mistake of the user, the name of the file and the line are added to its message.
    pub fn at_include(&self, error: Error, path: &str, file: &str, line: usize) -> Error {
        let file = self.path_of(file);
        error.placed(|message| Error::input(format!("{file}, line {line}, #include \"{path}\": {message}")))
    }

    /// Returns a file's text with its includes inserted, and the names of the files of which this text
    /// consists. Each file is named only once. This function is for files whose includes do not depend on a
    /// strategy.
    pub fn read_joined(&self, name: &str) -> Result<(String, Vec<String>)> {
        let (mut text, mut files) = (String::new(), Vec::new());
        self.join((name, &self.read(name)?), &mut Chain::default(), &mut text, &mut files)?;
        Ok((text, files))
    }

    fn join(
        &self,
        (name, own): (&str, &str),
        chain: &mut Chain,
        text: &mut String,
        files: &mut Vec<String>,
    ) -> Result<()> {
        chain.enter(name, text.len())?;
        if !files.iter().any(|file| file == name) {
            files.push(name.to_owned());
        }
        text.push_str(&format!("#line 1 \"{name}\"\n"));
        let lines = self.lines_of(name, own)?;
        for (number, line) in (1..).zip(lines.iter()) {
            match line.includes {
                Some(inner) => {
                    let included = self.read(inner);
                    let included = included.map_err(|error| self.at_include(error, inner, name, number))?;
                    self.join((inner, &included), chain, text, files)?;
                    text.push_str(&format!("#line {} \"{name}\"\n", number + 1));
                }
                None => text.extend([line.text, "\n"]),
            }
        }
        chain.leave();
        Ok(())
    }

    /// Returns the sorted names of the kernel files in the user's folder; none if the user gives no folder.
    /// Fails if the folder cannot be read or contains no kernel file, or if the `.cl` at the end of a file's
    /// name has a capital letter.
    pub fn own_files(&self) -> Result<Vec<String>> {
        let Self::Folder(folder) = self else { return Ok(Vec::new()) };
        let mut files = Vec::new();
        kernel_files(folder, folder, &mut files)?;
        if files.is_empty() {
            let message = format!("{} contains no kernel file", folder.display());
            return Err(Error::input(message).with_help(LAYOUT));
        }
        files.sort_unstable();
        Ok(files)
    }

    /// Returns the sorted names of all files: the built-in files and the files that the user's folder adds.
    pub fn files(&self) -> Result<Vec<String>> {
        let mut files = self.own_files()?;
        files.extend(Self::names().into_iter().map(str::to_owned));
        files.sort_unstable();
        files.dedup();
        Ok(files)
    }

    /// Returns a file's name for messages: its path if it comes from the user's folder, otherwise `cl/` and its name.
    pub fn path_of(&self, name: &str) -> String {
        self.own_path(name).unwrap_or_else(|| format!("cl/{name}"))
    }

    /// Returns the paths of the files, among `files`, that the user added or changed: they come from the
    /// user's folder, and no built-in file has the same name and the same text. An unchanged copy of a
    /// built-in file is left out, since an unchanged copy is not to blame for an error.
    pub fn changed_paths(&self, files: &[String]) -> Vec<String> {
        let changed = |name: &String| {
            let path = self.own_path(name)?;
            (Self::Embedded.read(name).ok() != self.read(name).ok()).then_some(path)
        };
        files.iter().filter_map(changed).collect()
    }

    /// Returns a text that names the user's kernel files after a crash. The text begins with [`SUSPECTS`], and names
    /// the first few files that the user added or changed. Returns `None` if there are no such files.
    pub fn suspects(&self) -> Option<String> {
        let files = self.changed_paths(&self.own_files().unwrap_or_default());
        (!files.is_empty()).then(|| format!("{SUSPECTS}: {}", some_of(&files)))
    }

    /// Returns a file's path if it comes from the user's folder, or if the system does not say whether the folder has
    /// the file. Returns `None` if the file is built into the binary.
    pub fn own_path(&self, name: &str) -> Option<String> {
        let Self::Folder(folder) = self else { return None };
        let path = folder.join(name);
        let is_built_in = matches!(existing::is_entry(&path), Ok(false));
        (!is_built_in).then(|| path.display().to_string())
    }

    /// Returns a compiler's messages about a program that does not compile, with the paths of kernel files
    /// instead of their names. The second returned value is true if the program contains a file that the user
    /// added or changed. raycl then assumes that the mistake is in the user's file, since programs that consist only of
    /// built-in files compile. The compiler may nevertheless report the error in a built-in file, for example where the
    /// built-in file calls a function of the user's file with wrong arguments. If the program contains files that the
    /// user added or changed, but the compiler reports no error in these files, their names precede the compiler's
    /// messages (only the first few of many names). The program's text, `text`, consists of the files `files`. The
    /// compiler names a file by its path relative to `cl/` or to the user's folder of kernels. The compiler may also
    /// state only a line number in the program's whole text.
    pub fn located(&self, log: &str, text: &str, files: &[String]) -> (String, bool) {
        let path = |name: &str| files.iter().any(|file| file == name).then(|| self.path_of(name));
        let log = with_paths(&in_files(log, text), path);
        let own = self.changed_paths(files);
        let is_in_own = |line: &str| own.iter().any(|path| line.contains(&format!("{path}:")));
        if own.is_empty() || log.lines().any(|line| line.contains("error") && is_in_own(line)) {
            return (log, !own.is_empty());
        }
        let why = "the built-in kernel files compile by themselves, but this program contains";
        (format!("{why} {}: {log}", some_of(&own)), true)
    }

    /// Returns an error of the preprocessor. If the error's message begins with the name of a kernel file and a
    /// line number, as in `a.cl, line 1`, the file's path replaces this name. `files` are the names of the
    /// program's files.
    pub fn with_path(&self, error: Error, files: &[String]) -> Error {
        error.placed(|message| {
            let located = files.iter().find_map(|file| {
                let rest = message.strip_prefix(file.as_str()).filter(|rest| rest.starts_with(", line "))?;
                Some(format!("{}{rest}", self.path_of(file)))
            });
            Error::input(located.unwrap_or(message))
        })
    }

    /// Returns the sorted names of all files built into the binary.
    pub fn names() -> Vec<&'static str> {
        let mut names = Vec::new();
        file_names(&EMBEDDED, &mut names);
        names.sort_unstable();
        names
    }
}

/// Returns the text of a built-in file; `None` if no built-in file has this name.
fn built_in(name: &str) -> Option<&'static str> {
    EMBEDDED.get_file(name)?.contents_utf8()
}

/// Returns the lines of a built-in file, which stay in memory until the process ends. Returns `None` in three
/// cases: no built-in file has this name, the built-in file has another text than `text`, or the file cannot
/// be split into lines.
fn built_in_lines(name: &str, text: &str) -> Option<&'static [SourceLine<'static>]> {
    static KNOWN: Mutex<BTreeMap<&str, &[SourceLine<'_>]>> = Mutex::new(BTreeMap::new());
    let built_in = built_in(name).filter(|own| *own == text)?;
    let mut known = locked(&KNOWN);
    if let Some(found) = known.get(built_in).copied() {
        return Some(found);
    }
    let found: &[SourceLine<'_>] = lines(name, built_in).ok()?.leak();
    known.insert(built_in, found);
    Some(found)
}

const LAYOUT: &str =
    "--cl-dir expects a folder laid out like raycl's cl/, with the files that differ or are new";

/// The beginning of the text that names the user's kernel files after a crash ([`Sources::suspects`]). A named file
/// need not be part of the crashed program.
pub const SUSPECTS: &str =
    "the folder of --cl-dir has kernel files that are not built in, or that differ from the built-in files";

/// The remedy after a crash of a process that used the user's kernel files.
pub const OWN_KERNELS: &str = "a mistake in one of your kernel files is more likely than one in the driver: look for writes and reads out of bounds, for barriers that not all work-items of a group reach, and for a `bytes_per_ray` that is too small. The same command without --cl-dir shows whether raycl's own kernels crash too. Oclgrind, a simulator, reports accesses out of bounds with their lines: `oclgrind --build-options -cl-opt-disable raycl ... --device oclgrind`";

/// The remedy for an error in one of the user's kernel files.
const OWN_FILE: &str = "correct the file: docs/own-kernels.md lists the functions, types and macros that it must define; `raycl kernel STRATEGY --cl-dir DIR` shows the program that contains it";

/// The remedy for a file that uses a field which its `Row` does not have. The length of a `Row` is stated far from
/// where the field is used: in the file's header.
const ROW: &str = "with `record_floats: 12` in the file's header, a Row has the fields a, b, c, u, v and w, and with any other number only the array `number`";

/// The remedy for a link in the user's folder that leads to no file that raycl can reach.
const LINK: &str =
    "the path is a link that cannot be followed: correct the link, or remove it to use raycl's own file";

/// Largest number of files that a message names. Of all further files, the message states only the number.
const NAMED_FILES: usize = 3;

/// Returns the names of files for a message: all names, or the first few names and the number of further
/// files.
pub fn some_of(files: &[String]) -> String {
    let (named, others) = files.split_at(files.len().min(NAMED_FILES));
    match others.len() {
        0 => named.join(", "),
        count => format!("{} and {}", named.join(", "), counted(count, "other file")),
    }
}

/// Returns the file that is most probably meant by a wrong path: a file of the same name in another folder,
/// or else a file with a similar name. Returns `None` if there is no such file.
pub fn meant_file<'a>(path: &str, files: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let files: Vec<&str> = files.into_iter().filter(|file| *file != path).collect();
    let same: Vec<&str> = files.iter().copied().filter(|file| stem(file) == stem(path)).collect();
    // A similar path counts only if the names without folders are similar, too: a common folder makes most
    // paths similar.
    let alike = |file: &&str| nearest(stem(path), [stem(file)]).is_some();
    let others = files.iter().copied().filter(alike);
    nearest(path, same.iter().copied()).or(same.first().copied()).or_else(|| nearest(path, others))
}

/// Returns the name of a kernel file without its folders and without `.cl`.
pub fn stem(path: &str) -> &str {
    let name = path.rsplit('/').next().unwrap_or(path);
    name.strip_suffix(".cl").unwrap_or(name)
}

/// Returns the error for a program that contains the user's kernel files and does not compile; `log` has the
/// compiler's messages.
pub fn does_not_compile(log: &str) -> Error {
    let uses_no_field = log.contains("no member named") && log.contains("in 'Row'");
    let help = if uses_no_field { format!("{ROW}; {OWN_FILE}") } else { OWN_FILE.to_owned() };
    Error::input(format!("a kernel file does not compile: {log}")).with_help(help)
}

/// raycl includes no further file in a program that is longer than `LONGEST_PROGRAM_MIB` MiB.
const LONGEST_PROGRAM_MIB: usize = 16;

/// The files that are being joined. Each file in this list, except the first, is included by the file before
/// it.
#[derive(Default)]
pub struct Chain(Vec<String>);

impl Chain {
    /// Adds a file to the end of the list; `length` is the length of the program so far, in bytes. Returns an
    /// error if the file includes itself (directly, or through other files), or if the program becomes too
    /// long, for example because files include other files several times.
    pub fn enter(&mut self, name: &str, length: usize) -> Result<()> {
        if self.0.iter().any(|open| open == name) {
            let chain = [self.0.join(" includes "), name.to_owned()].join(" includes ");
            return Err(Error::input(format!("a kernel file includes itself: {chain}"))
                .with_help("remove an #include line from one of these files"));
        }
        if length > LONGEST_PROGRAM_MIB << 20 {
            let message = format!(
                "before {name} is included, the program is already longer than {LONGEST_PROGRAM_MIB} MiB"
            );
            return Err(Error::input(message).with_help("include each file once"));
        }
        self.0.push(name.to_owned());
        Ok(())
    }

    /// Removes the last file from the list.
    pub fn leave(&mut self) {
        self.0.pop();
    }
}

/// Reads a file of the folder `folder`. A path that leads out of the folder, by its name or by a link, is refused.
fn read_inside(path: &Path, folder: &Path) -> Result<String> {
    let failed = |error: std::io::Error| Error::input(format!("cannot read {}: {error}", path.display()));
    path.canonicalize().map_err(|error| failed(error).with_help(LINK))?;
    if !reader::lies_in(path, folder) {
        let message =
            format!("{} lies outside the kernels' folder, so raycl does not read it", path.display());
        return Err(Error::input(message).with_help(LAYOUT));
    }
    let text = reader::text(path, Kind::Kernel)
        .map_err(|error| Error::not_utf8(path, &error).unwrap_or_else(|| failed(error).with_help(LAYOUT)))?;
    if let Some(at) = text.find('\0') {
        let message = format!("{}:{}: a NUL byte; expected text", path.display(), line_of(&text, at));
        return Err(Error::input(message).with_help("remove the byte, and save the file as UTF-8"));
    }
    // Some editors begin a file with a byte order mark. After files are joined, the mark would stand within a
    // program's text, where compilers refuse it.
    Ok(match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_owned(),
        None => text,
    })
}

/// Collects the `.cl` files of a folder and its subfolders, named relative to `root`. Leaves out files and
/// folders whose names begin with a dot: editors, file systems and git make them, such as the link `.#a.cl` of
/// Emacs, which leads to no file. Refuses a file such as `a.CL`: raycl would otherwise ignore it silently.
fn kernel_files(root: &Path, folder: &Path, files: &mut Vec<String>) -> Result<()> {
    let failed = |error| Error::input(format!("cannot read {}: {error}", folder.display())).with_help(LAYOUT);
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if entry.file_name().as_encoded_bytes().starts_with(b".") {
            continue;
        }
        let path = entry.path();
        if existing::is_folder(&path)? {
            kernel_files(root, &path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "cl") {
            let name = path.strip_prefix(root).unwrap_or(&path).to_string_lossy();
            files.push(name.replace('\\', "/"));
        } else if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("cl")) {
            let message = format!("{}: the name of a kernel file ends in .cl, in lower case", path.display());
            return Err(Error::input(message).with_help("rename the file"));
        }
    }
    Ok(())
}

fn file_names(folder: &'static Dir<'_>, names: &mut Vec<&'static str>) {
    names.extend(folder.files().filter_map(|file| file.path().to_str()));
    folder.dirs().for_each(|inner| file_names(inner, names));
}

/// The start of a word by which PoCL names the position where a macro is defined: `<Spelling=name:7:1>`.
const SPELLING: &str = "<Spelling=";

/// Replaces the name of a file at the start of a word, as in `name:7:1: error`, by its path.
fn with_paths(log: &str, path: impl Fn(&str) -> Option<String>) -> String {
    let located = |word: &str| {
        let start = if word.starts_with(SPELLING) { SPELLING } else { "" };
        let (name, position) = word[start.len()..].split_once(':')?;
        Some(format!("{start}{}:{position}", path(name)?))
    };
    log.split_inclusive([' ', '\n']).map(|word| located(word).unwrap_or_else(|| word.to_owned())).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_the_lines_of_its_own_text_although_a_built_in_file_has_its_name() {
        let name = "common/samples.cl";
        let text = Sources::Embedded.read(name).unwrap();
        let changed = text.replacen('\n', "\n#include \"a.cl\"\n", 1);
        for text in [&text, &changed, &text] {
            let found = Sources::Embedded.lines_of(name, text).unwrap();
            assert_eq!(found.into_owned(), lines(name, text).unwrap());
        }
        let error = Sources::Embedded.lines_of(name, "/* open").unwrap_err();
        assert!(error.to_string().starts_with("cl/common/samples.cl, line 1: "), "{error}");
    }

    #[test]
    fn a_field_that_a_row_does_not_have_is_answered_with_the_key_of_the_header() {
        let help = |log: &str| does_not_compile(log).remedy().to_owned();
        let lacks = "error: cast/a.cl:7:1: no member named 'a' in 'Row'";
        assert_eq!(help(lacks), format!("{ROW}; {OWN_FILE}"));
        assert_eq!(help("error: cast/a.cl:7:1: no member named 'a' in 'Corners'"), OWN_FILE);
    }

    #[test]
    fn messages_about_kernel_files_get_the_files_paths() {
        let path = |name: &str| (name == "cast/a.cl").then(|| "mine/cast/a.cl".to_owned());
        let log =
            "error: cast/a.cl:7:1: expected ';'\ncast/a.cl:8: note\ncl/cast/a.cl:9: cast/b.cl:1: a ? b : c";
        let expected = "error: mine/cast/a.cl:7:1: expected ';'\nmine/cast/a.cl:8: note\ncl/cast/a.cl:9: cast/b.cl:1: a ? b : c";
        assert_eq!(with_paths(log, path), expected);
        // With the word `<Spelling=...>`, PoCL names the position where a macro is defined.
        let log = "error: cast/b.cl:1:2 <Spelling=cast/a.cl:7:1>: no";
        assert_eq!(with_paths(log, path), "error: cast/b.cl:1:2 <Spelling=mine/cast/a.cl:7:1>: no");
    }

    #[test]
    fn a_mistake_that_the_preprocessor_finds_begins_with_the_files_path() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.cl"), "#else\n").unwrap();
        let sources = Sources::Folder(folder.path().to_owned());
        let files = ["a.cl", "cast/shade.cl"].map(str::to_owned);
        let own = folder.path().join("a.cl").display().to_string();
        for (message, expected) in [
            ("a.cl, line 1: no", format!("{own}, line 1: no")),
            (
                "cast/shade.cl, line 7: a.cl, line 1: no",
                "cl/cast/shade.cl, line 7: a.cl, line 1: no".to_owned(),
            ),
            ("-D A: no", "-D A: no".to_owned()),
            ("a.cl: no", "a.cl: no".to_owned()),
        ] {
            let error = sources.with_path(Error::input(message).with_help("remedy"), &files);
            assert_eq!((error.to_string(), error.remedy()), (expected, "remedy"));
        }
    }

    #[test]
    fn the_file_that_a_wrong_path_means_has_the_same_name_or_a_similar_one() {
        let files = ["cast/gather.cl", "cast/intersect/watertight.cl", "cast/soft.cl"];
        for (path, meant) in [
            ("watertight.cl", Some("cast/intersect/watertight.cl")),
            ("a/folder/that/is/far/away/from/all/others/soft.cl", Some("cast/soft.cl")),
            ("cast/sotf.cl", Some("cast/soft.cl")),
            // The next two paths have only the folder in common with existing files, so raycl suggests no
            // other file for them.
            ("cast/nosuch.cl", None),
            ("cast/helper.cl", None),
        ] {
            assert_eq!(meant_file(path, files), meant, "{path}");
        }
    }

    #[test]
    fn a_file_that_includes_itself_is_refused_with_every_file_on_the_way() {
        let mut chain = Chain::default();
        chain.enter("a.cl", 0).unwrap();
        chain.enter("b.cl", 0).unwrap();
        let error = chain.enter("a.cl", 0).unwrap_err();
        let expected = "a kernel file includes itself: a.cl includes b.cl includes a.cl";
        assert_eq!((error.to_string().as_str(), error.exit_code()), (expected, 2));
    }

    #[test]
    fn only_files_that_end_in_cl_are_kernel_files_in_all_folders() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("cast")).unwrap();
        for name in ["b.cl", "cast/a.cl", "README.md", "cast/a.cl.orig"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let sources = Sources::Folder(folder.path().to_owned());
        assert_eq!(sources.own_files().unwrap(), ["b.cl", "cast/a.cl"]);
    }

    #[test]
    fn a_kernel_file_whose_name_ends_in_capital_letters_is_refused_and_not_ignored() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.cl", "a.CL"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let error = Sources::Folder(folder.path().to_owned()).own_files().unwrap_err();
        let path = folder.path().join("a.CL");
        let expected = format!("{}: the name of a kernel file ends in .cl, in lower case", path.display());
        assert_eq!((error.to_string(), error.remedy(), error.exit_code()), (expected, "rename the file", 2));
    }

    #[test]
    fn hidden_files_and_folders_have_no_kernel_files() {
        let folder = tempfile::tempdir().unwrap();
        for inner in ["cast", ".git"] {
            std::fs::create_dir(folder.path().join(inner)).unwrap();
        }
        for name in ["cast/a.cl", "cast/._a.cl", ".git/x.cl"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink("me@host.1", folder.path().join("cast/.#a.cl")).unwrap();
        let sources = Sources::Folder(folder.path().to_owned());
        assert_eq!(sources.own_files().unwrap(), ["cast/a.cl"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_that_cannot_be_followed_is_an_error_and_not_the_built_in_file() {
        use std::os::unix::fs::symlink;
        let root = tempfile::tempdir().unwrap();
        let (folder, name) = (root.path().join("common"), "common/samples.cl");
        let (path, sources) = (root.path().join(name), Sources::Folder(root.path().to_owned()));
        let refused = || {
            let error = sources.read(name).unwrap_err();
            let expected = format!("cannot read {}: ", path.display());
            assert!(error.to_string().starts_with(&expected) && error.exit_code() == 2, "{error}");
            assert_eq!(sources.own_path(name), Some(path.display().to_string()));
        };
        std::fs::create_dir(&folder).unwrap();
        assert_eq!((sources.read(name).is_ok(), sources.own_path(name)), (true, None));
        for target in ["nowhere.cl", "samples.cl"] {
            symlink(target, &path).unwrap();
            refused();
            std::fs::remove_file(&path).unwrap();
        }
        std::fs::remove_dir(&folder).unwrap();
        symlink("common", &folder).unwrap();
        refused();
        assert!(sources.own_files().is_err());
    }

    #[test]
    fn only_the_first_files_of_many_are_named() {
        let files: Vec<_> = (1..=5).map(|n| format!("{n}.cl")).collect();
        assert_eq!(some_of(&files[..2]), "1.cl, 2.cl");
        assert_eq!(some_of(&files), "1.cl, 2.cl, 3.cl and 2 other files");
    }

    #[test]
    fn a_byte_order_mark_at_the_start_of_a_file_is_no_text() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.cl"), "\u{feff}// a\n").unwrap();
        assert_eq!(Sources::Folder(folder.path().to_owned()).read("a.cl").unwrap(), "// a\n");
    }

    #[test]
    fn a_nul_byte_is_refused_with_its_file_and_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.cl");
        std::fs::write(&path, "// a\n// b\0\n").unwrap();
        let error = Sources::Folder(folder.path().to_owned()).read("a.cl").unwrap_err();
        let expected = format!("{}:2: a NUL byte; expected text", path.display());
        assert_eq!((error.to_string(), error.exit_code()), (expected, 2));
    }

    #[test]
    fn a_mistake_in_an_include_has_its_file_and_line() {
        let folder = tempfile::tempdir().unwrap();
        let sources = Sources::Folder(folder.path().to_owned());
        for (path, why) in [
            ("cast/nosuch.cl", "there is no kernel file cast/nosuch.cl, neither in"),
            ("../no-such-file.cl", "there is no kernel file ../no-such-file.cl"),
        ] {
            std::fs::write(folder.path().join("inner.cl"), format!("one\n#include \"{path}\"\n")).unwrap();
            std::fs::write(folder.path().join("outer.cl"), "#include \"inner.cl\"\n").unwrap();
            let error = sources.read_joined("outer.cl").unwrap_err();
            let inner = folder.path().join("inner.cl");
            let expected = format!("{}, line 2, #include \"{path}\": {why}", inner.display());
            assert!(error.to_string().starts_with(&expected) && error.exit_code() == 2, "{error}");
        }
    }

    #[test]
    fn a_joined_text_has_the_names_of_its_files_each_once() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("outer.cl", "one\n#include \"inner.cl\"\n#include \"inner.cl\"\nfour\n");
        write("inner.cl", "within\n");
        let sources = Sources::Folder(folder.path().to_owned());
        let (text, files) = sources.read_joined("outer.cl").unwrap();
        let inner = "#line 1 \"inner.cl\"\nwithin\n#line";
        assert_eq!(
            text,
            format!("#line 1 \"outer.cl\"\none\n{inner} 3 \"outer.cl\"\n{inner} 4 \"outer.cl\"\nfour\n")
        );
        assert_eq!(files, ["outer.cl", "inner.cl"]);
    }
}
