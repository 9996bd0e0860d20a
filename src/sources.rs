//! Kernel source files: the files built into the binary, and the files of a folder. A file of the folder replaces the
//! built-in file of the same name, or is an additional file.

mod lines;
mod places;

use crate::error::{Error, Result, nearest};
use crate::reader::{self, Kind};
use include_dir::{Dir, include_dir};
pub use lines::lines;
use places::in_files;
use std::path::{Path, PathBuf};

static EMBEDDED: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/cl");

/// The origin of kernel source files.
#[derive(Clone, Debug, Default)]
pub enum Sources {
    /// The files this binary was built with.
    #[default]
    Embedded,
    /// A folder laid out like `cl/`, for users who edit kernels. Files that are not in the folder come from
    /// the binary.
    Folder(PathBuf),
}

impl Sources {
    /// Returns the text of a file, named relative to `cl/`.
    pub fn read(&self, name: &str) -> Result<String> {
        if let Self::Folder(folder) = self {
            let path = folder.join(name);
            if path.exists() {
                return read_inside(&path, folder);
            }
        }
        let text = EMBEDDED.get_file(name).and_then(|file| file.contents_utf8());
        text.map(str::to_owned).ok_or_else(|| self.lacks(name))
    }

    fn lacks(&self, name: &str) -> Error {
        match self {
            Self::Embedded => Error::input(format!("there is no kernel file {name}")).with_help(LAYOUT),
            Self::Folder(folder) => {
                let message =
                    format!("there is no kernel file {name}: neither in {} nor built in", folder.display());
                let error = Error::input(message);
                match nearest(name, Self::names()) {
                    Some(meant) => error.with_help(format!("did you mean {meant}?")),
                    None => error.with_help(LAYOUT),
                }
            }
        }
    }

    /// Returns a file with its includes inserted, and the names of the files that this text consists of, each once. For
    /// files whose includes do not depend on a strategy.
    pub fn read_joined(&self, name: &str) -> Result<(String, Vec<String>)> {
        let (mut text, mut files) = (String::new(), Vec::new());
        self.join(name, &mut Chain::default(), &mut text, &mut files)?;
        Ok((text, files))
    }

    fn join(&self, name: &str, chain: &mut Chain, text: &mut String, files: &mut Vec<String>) -> Result<()> {
        chain.enter(name, text.len())?;
        if !files.iter().any(|file| file == name) {
            files.push(name.to_owned());
        }
        text.push_str(&format!("#line 1 \"{name}\"\n"));
        for (number, line) in lines(&self.path_of(name), &self.read(name)?)?.into_iter().enumerate() {
            match line.includes {
                Some(inner) => {
                    self.join(inner, chain, text, files)?;
                    text.push_str(&format!("#line {} \"{name}\"\n", number + 2));
                }
                None => text.extend([line.text, "\n"]),
            }
        }
        chain.leave();
        Ok(())
    }

    /// Returns the sorted names of the folder's files; none if there is no folder.
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

    /// Returns the sorted names of all files: those built in and those that a folder adds.
    pub fn files(&self) -> Result<Vec<String>> {
        let mut files = self.own_files()?;
        files.extend(Self::names().into_iter().map(str::to_owned));
        files.sort_unstable();
        files.dedup();
        Ok(files)
    }

    /// Returns a file's name for messages: its path if it comes from the folder, otherwise `cl/` and its
    /// name.
    pub fn path_of(&self, name: &str) -> String {
        match self {
            Self::Folder(folder) if folder.join(name).exists() => folder.join(name).display().to_string(),
            _ => format!("cl/{name}"),
        }
    }

    /// Returns a compiler's messages with the paths of kernel files instead of their names, and whether an error is
    /// known to be in a file of the folder. The program's text, `text`, consists of the files `files`. The compiler names
    /// them relative to `cl/` or to the folder, or names lines of the whole text.
    pub fn located(&self, log: &str, text: &str, files: &[String]) -> (String, bool) {
        let path = |name: &str| files.iter().any(|file| file == name).then(|| self.path_of(name));
        let log = with_paths(&in_files(log, text), path);
        let own = self.own_files().unwrap_or_default();
        let of_own = |line: &str| own.iter().any(|file| line.contains(&format!("{}:", self.path_of(file))));
        let in_own_file = log.lines().any(|line| line.contains("error") && of_own(line));
        (log, in_own_file)
    }

    /// Returns the sorted names of all files built into the binary.
    pub fn names() -> Vec<&'static str> {
        let mut names = Vec::new();
        file_names(&EMBEDDED, &mut names);
        names.sort_unstable();
        names
    }
}

const LAYOUT: &str =
    "--cl-dir expects a folder laid out like raycl's cl/, with the files that differ or are new";

/// The remedy for an error in a kernel file of the user.
const OWN_FILE: &str =
    "correct the file; `raycl kernel STRATEGY --cl-dir DIR` shows the program that contains it";

/// Returns the error for a kernel file of the user that does not compile; `log` has the compiler's messages.
pub fn does_not_compile(log: &str) -> Error {
    Error::input(format!("a kernel file does not compile: {log}")).with_help(OWN_FILE)
}

/// The longest program that is passed to a compiler.
const LONGEST_PROGRAM_MIB: usize = 16;

/// The files that are being joined. Each file is included by the file before it.
#[derive(Default)]
pub struct Chain(Vec<String>);

impl Chain {
    /// Enters an included file; `length` is the length of the program so far, in bytes. Returns an error if a
    /// file includes itself, or if the program becomes too long, for example because files include other
    /// files several times.
    pub fn enter(&mut self, name: &str, length: usize) -> Result<()> {
        if self.0.iter().any(|open| open == name) {
            let chain = [self.0.join(" includes "), name.to_owned()].join(" includes ");
            return Err(Error::input(format!("a kernel file includes itself: {chain}"))
                .with_help("remove one of these #include lines"));
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

    /// Leaves the innermost file.
    pub fn leave(&mut self) {
        self.0.pop();
    }
}

/// Reads a file of the folder. A path that leads out of the folder, by its name or by a link, is refused.
fn read_inside(path: &Path, folder: &Path) -> Result<String> {
    if !reader::lies_in(path, folder) {
        let message =
            format!("{} lies outside the kernels' folder, so raycl does not read it", path.display());
        return Err(Error::input(message).with_help(LAYOUT));
    }
    reader::text(path, Kind::Kernel).map_err(|error| {
        Error::not_utf8(path, &error).unwrap_or_else(|| {
            Error::input(format!("cannot read {}: {error}", path.display())).with_help(LAYOUT)
        })
    })
}

/// Collects the `.cl` files of a folder and its subfolders, named relative to `root`.
fn kernel_files(root: &Path, folder: &Path, files: &mut Vec<String>) -> Result<()> {
    let failed = |error| Error::input(format!("cannot read {}: {error}", folder.display())).with_help(LAYOUT);
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() {
            kernel_files(root, &path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "cl") {
            let name = path.strip_prefix(root).unwrap_or(&path).to_string_lossy();
            files.push(name.replace('\\', "/"));
        }
    }
    Ok(())
}

fn file_names(folder: &'static Dir<'_>, names: &mut Vec<&'static str>) {
    names.extend(folder.files().filter_map(|file| file.path().to_str()));
    folder.dirs().for_each(|inner| file_names(inner, names));
}

/// Replaces the name of a file at the start of a word, as in `name:7:1: error`, by its path.
fn with_paths(log: &str, path: impl Fn(&str) -> Option<String>) -> String {
    let located = |word: &str| {
        let (name, place) = word.split_once(':')?;
        Some(format!("{}:{place}", path(name)?))
    };
    log.split_inclusive([' ', '\n']).map(|word| located(word).unwrap_or_else(|| word.to_owned())).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn messages_about_kernel_files_get_the_files_paths() {
        let path = |name: &str| (name == "cast/a.cl").then(|| "mine/cast/a.cl".to_owned());
        let log =
            "error: cast/a.cl:7:1: expected ';'\ncast/a.cl:8: note\ncl/cast/a.cl:9: cast/b.cl:1: a ? b : c";
        let expected = "error: mine/cast/a.cl:7:1: expected ';'\nmine/cast/a.cl:8: note\ncl/cast/a.cl:9: cast/b.cl:1: a ? b : c";
        assert_eq!(with_paths(log, path), expected);
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
