//! The values of axes that are kernel files: built-in files, and those in the folder that the option `--cl-dir` names.
//! A new file in a folder of values is a new value.

use super::AXES;
use super::header::{Header, Reader};
use crate::entry::entry;
use crate::error::{Error, Result, nearest};
use crate::reader::folder_of;
use crate::sources::{SourceLine, Sources, lines, meant_file, stem};
use crate::threads::locked;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError, RwLock};

/// The folders of values, each with the axis to which its files belong. A value may have files in several
/// folders, for different kernel families. The first of these files contains the header.
pub const FOLDERS: [(&str, &str); 8] = [
    ("cast/vectors/", "vectors"),
    ("cast/triangles/", "triangles"),
    ("cast/layout/", "layout"),
    ("tile_cpu/layout/", "layout"),
    ("cast/shading/", "shading"),
    ("cast/intersect/", "intersector"),
    ("tile_cpu/intersect/", "intersector"),
    ("tile_gpu/intersect/", "intersector"),
];

type Headers = &'static [Header];

/// The headers of all values. The headers are constant for the process, which reads its `--cl-dir` before it
/// parses any name of a value. If a run compares two folders of kernels, these are the headers of the second
/// folder (see [`Values`]). The headers live as long as the process, so that a strategy can hold their names
/// and be copied.
static KNOWN: LazyLock<RwLock<Headers>> = LazyLock::new(|| {
    // A test checks that the built-in headers can be read.
    RwLock::new(headers(&Sources::Embedded).unwrap_or_default().leak())
});

thread_local! {
    /// The headers that this thread uses instead of [`KNOWN`].
    static INSTEAD: Cell<Option<Headers>> = const { Cell::new(None) };
}

/// Returns the headers of all values that are files, in the order of their axes and names.
fn known() -> Headers {
    INSTEAD.get().unwrap_or_else(|| *KNOWN.read().unwrap_or_else(PoisonError::into_inner))
}

/// The values that are files in some sources, with their headers. A run that compares two folders of kernels needs the
/// values of both, since the same value may have other properties in the other folder.
#[derive(Clone, Copy, Debug)]
pub struct Values(Headers);

impl Values {
    /// Calls `work`. During this call, values have the properties that these headers state, in this thread.
    pub fn during<R>(self, work: impl FnOnce() -> R) -> R {
        let before = INSTEAD.replace(Some(self.0));
        let result = work();
        INSTEAD.set(before);
        result
    }
}

/// Stores headers for the rest of the process. Equal headers are stored once.
fn stored(headers: Vec<Header>) -> Headers {
    static ALL: Mutex<Vec<Headers>> = Mutex::new(Vec::new());
    let mut all = locked(&ALL);
    if let Some(same) = all.iter().find(|known| **known == headers) {
        return same;
    }
    all.push(headers.leak());
    all[all.len() - 1]
}

/// Returns the headers of an axis's values, by name.
pub fn values_of(axis: &str) -> impl Iterator<Item = &'static Header> {
    known().iter().filter(move |header| header.axis == axis)
}

/// Returns the header of a value; an empty header if the value has no file. Names that were parsed always
/// have a file.
pub(super) fn header_of(axis: &str, name: &str) -> &'static Header {
    static NONE: Header = Header::NONE;
    values_of(axis).find(|header| header.name == name).unwrap_or(&NONE)
}

impl Sources {
    /// Returns the kernel files for a command: the built-in files, and the files in `folder` (the option
    /// `--cl-dir`), which replace built-in files or are additional ones. From then on, `values_of` returns
    /// the values that are files in these sources.
    pub fn of(folder: Option<PathBuf>) -> Result<Self> {
        let sources = folder.map_or(Self::Embedded, Self::Folder);
        refuse_names(&sources)?;
        refuse_unused(&sources)?;
        let headers = headers(&sources)?;
        let mut known = KNOWN.write().unwrap_or_else(PoisonError::into_inner);
        replace(&mut known, headers);
        Ok(sources)
    }

    /// Returns the values that are files in these sources.
    pub fn values(&self) -> Result<Values> {
        Ok(Values(stored(headers(self)?)))
    }
}

/// Replaces the known headers if any of them differs. Equal headers are not replaced, since the memory of
/// replaced headers is never freed.
fn replace(known: &mut Headers, headers: Vec<Header>) {
    if *known != headers {
        *known = headers.leak();
    }
}

/// A value before its header is read: its axis, its name, and the folders that contain a file of it.
struct Named {
    axis: &'static str,
    name: String,
    folders: Vec<&'static str>,
}

impl Named {
    /// Returns the value's files. The first one contains the header.
    fn files(&self) -> impl Iterator<Item = String> {
        self.folders.iter().map(move |folder| format!("{folder}{}.cl", self.name.replace('-', "_")))
    }
}

/// Returns the name of the value that a file in `folder` defines; `None` if the file does not lie in
/// `folder`.
fn value_in(folder: &str, file: &str) -> Option<String> {
    let stem = file.strip_prefix(folder)?.strip_suffix(".cl")?;
    (!stem.contains('/')).then(|| stem.replace('_', "-"))
}

fn named(files: &[String]) -> Vec<Named> {
    let mut all: Vec<Named> = Vec::new();
    for (folder, axis) in FOLDERS {
        for name in files.iter().filter_map(|file| value_in(folder, file)) {
            let is_it = |named: &Named| named.axis == axis && named.name == name;
            let new = || Named { axis, name: name.clone(), folders: Vec::new() };
            entry(&mut all, is_it, new).folders.push(folder);
        }
    }
    let position = |axis: &str| AXES.iter().position(|info| info.name == axis);
    all.sort_by(|a, b| (position(a.axis), &a.name).cmp(&(position(b.axis), &b.name)));
    all
}

/// Returns the names of an axis's values; an empty list if there is no such axis. `all` contains the values that are
/// files.
fn names_of(all: &[Named], axis: &str) -> Vec<String> {
    let listed = AXES.iter().filter(|info| info.name == axis).flat_map(|info| info.listed);
    let files = all.iter().filter(|named| named.axis == axis).map(|named| named.name.clone());
    listed.map(|(name, _)| (*name).to_owned()).chain(files).collect()
}

/// Returns the headers of all values. The headers are sorted by the order of their axes in [`AXES`], and
/// within an axis by the values' names.
fn headers(sources: &Sources) -> Result<Vec<Header>> {
    let all = named(&sources.files()?);
    let names_of = |axis: &str| names_of(&all, axis);
    let read = |named: &Named| -> Result<Header> {
        let mut files = named.files();
        let file = files.next().unwrap_or_default();
        let path = sources.path_of(&file);
        let included_at = || {
            // Kernel files of raycl may include the file of a built-in value, so such an `#include` shows no mistake.
            if Sources::Embedded.read(&file).is_ok() {
                return None;
            }
            let includes = includes_of_all(sources).ok()?;
            let of_file = includes.iter().find(|include| include.path == file);
            let wrong = || wrong_include(&file, &includes).filter(|include| has_name_of(include, &file));
            of_file.or_else(wrong).map(|include| include.location.clone())
        };
        let (names_of, included_at) = (&names_of, &included_at);
        let reader = Reader { axis: named.axis, file: &file, path: &path, names_of, included_at };
        let header = reader.read(named.name.clone(), named.folders.clone(), &sources.read(&file)?)?;
        for other in files {
            let checked = reader.refuse_another(&sources.path_of(&other), &sources.read(&other)?);
            checked.map_err(|error| match sources.own_path(&other) {
                Some(_) => error,
                // If the other file is built in, the user cannot edit it, so the error is about the user's own file.
                None => taken(&path, &named.name, &other),
            })?;
        }
        Ok(header)
    };
    all.iter().map(read).collect()
}

/// Returns the error about a file of the user that has the name of a built-in value. In `FOLDERS`, the file's
/// folder comes before the folder of the built-in header.
fn taken(path: &str, name: &str, built_in: &str) -> Error {
    Error::input(format!(
        "{path}: '{name}' is the name of a built-in value, whose header is in cl/{built_in}"
    ))
    .with_help("choose another file name")
}

/// Refuses values whose names cannot be written in `--strategy`, in TOML and in records.
fn refuse_names(sources: &Sources) -> Result<()> {
    let fits = |name: &str| name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    for file in sources.own_files()? {
        let Some((folder, axis)) = FOLDERS.iter().find(|(folder, _)| value_in(folder, &file).is_some())
        else {
            continue;
        };
        let stem = file[folder.len()..].trim_end_matches(".cl");
        if !fits(stem) || stem.is_empty() {
            let path = sources.path_of(&file);
            let message = format!(
                "{path}: this file is a value of the axis '{axis}' and gives the value its name: before '.cl', the \
                 file's name may have only lower-case letters, digits and '_'"
            );
            let plain = stem.to_ascii_lowercase().replace(|c: char| !c.is_ascii_alphanumeric(), "_");
            return Err(Error::input(message)
                .with_help(format!("rename the file, for example to {folder}{plain}.cl")));
        }
    }
    Ok(())
}

/// Refuses a file that is neither a value nor included by a file with an effect. Such a file would silently
/// have no effect.
fn refuse_unused(sources: &Sources) -> Result<()> {
    let Sources::Folder(folder) = sources else { return Ok(()) };
    let mut unknown = sources.own_files()?;
    unknown.retain(|file| !is_known(file));
    if unknown.is_empty() {
        return Ok(());
    }
    let (files, includes) = (sources.files()?, includes_of_all(sources)?);
    let all = named(&files);
    let includes_file = |include: &Include, file: &str| include.may_be_of(file, |axis| names_of(&all, axis));
    let used = files_with_effect(&files, &includes, includes_file);
    unknown.retain(|file| !used.contains(&file.as_str()));
    // If possible, the error names a file that no other file includes: since this file has no effect, neither
    // have the files that it includes.
    let is_included = |file: &String| includes.iter().any(|include| includes_file(include, file));
    match unknown.iter().find(|file| !is_included(file)).or(unknown.first()) {
        Some(file) => Err(unused(folder, file, &includes, is_included(file))),
        None => Ok(()),
    }
}

/// Returns the files that have an effect: the built-in files, values, and all files that these files include,
/// directly or through other files. `includes_file` returns true if an `#include` may include a file.
fn files_with_effect<'a>(
    files: &'a [String],
    includes: &[Include],
    includes_file: impl Fn(&Include, &str) -> bool,
) -> Vec<&'a str> {
    let (mut used, mut others): (Vec<&str>, Vec<&str>) =
        files.iter().map(String::as_str).partition(|file| is_known(file));
    let mut done = 0;
    while let Some(file) = used.get(done).copied() {
        let own: Vec<_> = includes.iter().filter(|include| include.file == file).collect();
        let (reached, left): (Vec<&str>, Vec<&str>) =
            others.into_iter().partition(|other| own.iter().any(|include| includes_file(include, other)));
        others = left;
        used.extend(reached);
        done += 1;
    }
    used
}

/// Returns true if a file is a value of an axis or has the path of a built-in file.
fn is_known(file: &str) -> bool {
    Sources::names().contains(&file) || FOLDERS.iter().any(|(folder, _)| value_in(folder, file).is_some())
}

/// A line `#include "path"` of a kernel file.
struct Include {
    path: String,
    /// The file that has this line.
    file: String,
    /// The file that has this line, and the number of the line, as messages show them.
    location: String,
    /// True if a file has this path, or if the path contains an axis in braces.
    is_there: bool,
}

impl Include {
    /// Returns true if this path may be the path of `file`. An axis in braces stands for each of the axis's
    /// values, whose names `names_of` returns.
    fn may_be_of(&self, file: &str, names_of: impl Fn(&str) -> Vec<String>) -> bool {
        let braces =
            self.path.split_once('{').and_then(|(before, rest)| Some((before, rest.split_once('}')?)));
        let Some((before, (axis, after))) = braces else { return self.path == file };
        let value = file.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
        value.is_some_and(|value| names_of(axis).iter().any(|name| name.replace('-', "_") == value))
    }
}

/// Returns the lines with which kernel files include other files. The kernel files are the built-in ones and those in
/// the user's folder.
fn includes_of_all(sources: &Sources) -> Result<Vec<Include>> {
    let files = sources.files()?;
    let mut all = Vec::new();
    for file in &files {
        let own = includes(&sources.path_of(file), &sources.read(file)?)?;
        all.extend(own.into_iter().map(|include| Include { file: file.clone(), ..include }));
    }
    for include in &mut all {
        include.is_there = include.path.contains('{') || files.contains(&include.path);
    }
    Ok(all)
}

/// Returns the lines with which a kernel file includes other files. An `#include` in a comment has no effect.
fn includes(path: &str, text: &str) -> Result<Vec<Include>> {
    let lines = (1..).zip(lines(path, text)?);
    let include = |(number, line): (usize, SourceLine<'_>)| {
        let location = format!("{path}, line {number}");
        Some(Include { path: line.includes?.to_owned(), file: String::new(), location, is_there: false })
    };
    Ok(lines.filter_map(include).collect())
}

/// Returns the line that probably includes a file by a wrong path: its path names no file, and its last part is the
/// file's name or a similar name.
fn wrong_include<'a>(file: &str, includes: &'a [Include]) -> Option<&'a Include> {
    let mut wrong = includes.iter().filter(|include| !include.is_there);
    let meant = nearest(stem(file), wrong.clone().map(|include| stem(&include.path)))?;
    wrong.find(|include| stem(&include.path) == meant)
}

/// Returns true if the last part of an include's path is the name of this file. If the last part is only
/// similar to the file's name, another file may be meant.
fn has_name_of(include: &Include, file: &str) -> bool {
    stem(&include.path) == stem(file)
}

/// Returns the error about a file without effect. `is_included` means that another file includes this file; that other
/// file has no effect either.
fn unused(folder: &Path, file: &str, includes: &[Include], is_included: bool) -> Error {
    let (path, folder_name) = (folder.join(file), folder.display());
    let by = if is_included { "only files without effect include it" } else { "no file includes it" };
    let message = format!("is neither a file of raycl nor a value of an axis, and {by}");
    let error = Error::input(format!("{} {message}", path.display()));
    if let Some(include) = wrong_include(file, includes) {
        let Include { path, location, .. } = include;
        return error.with_help(if has_name_of(include, file) {
            format!(
                "{location} includes \"{path}\", but paths in #include are relative to {folder_name}: write #include \"{file}\""
            )
        } else {
            format!("{location} includes \"{path}\", which does not exist: did you mean \"{file}\"?")
        });
    }
    if file.starts_with("cl/") {
        let inner = folder.join("cl");
        let inner = inner.display();
        return error.with_help(format!(
            "{inner} is a folder of kernels inside the folder that --cl-dir names: write --cl-dir {inner}, or remove {inner}"
        ));
    }
    error.with_help(match outer_folder(folder, file) {
        Some(outer) => format!(
            "{folder_name} is only a part of a folder laid out like raycl's cl/: write --cl-dir {}",
            outer.display()
        ),
        None => elsewhere(file),
    })
}

/// Returns the folder that the user should have named with `--cl-dir` instead of `folder`. The returned
/// folder contains `folder`. Relative to the returned folder, the file's path is the path of a value or of a
/// built-in file. Returns `None` if there is no such folder.
fn outer_folder<'a>(folder: &'a Path, file: &str) -> Option<&'a Path> {
    let (mut outer, mut inner) = (folder, file.to_owned());
    while !is_known(&inner) {
        inner = format!("{}/{inner}", outer.file_name()?.to_str()?);
        outer = folder_of(outer);
    }
    Some(outer)
}

/// Returns the help for a file without effect: the path that is probably meant, if there is one, and the
/// folders of values.
fn elsewhere(file: &str) -> String {
    let folders = FOLDERS.map(|(folder, _)| folder);
    let expected = format!("the file of an axis's value lies in one of the folders {}", folders.join(", "));
    let (own_folder, name) = file.split_at(file.rfind('/').map_or(0, |at| at + 1));
    let as_value = nearest(own_folder, folders).map(|folder| format!("{folder}{name}"));
    let candidates = Sources::names().into_iter().chain(as_value.as_deref());
    match meant_file(file, candidates) {
        Some(meant) => format!("did you mean {meant}? {expected}"),
        None => expected,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kernel_file_in_a_wrong_folder_is_sent_to_the_right_one() {
        for (folder, file, remedy) in [
            ("k", "cast/moller_trumbore.cl", "did you mean cast/intersect/moller_trumbore.cl? the file of"),
            ("k", "cast/layuot/suop.cl", "did you mean cast/layout/suop.cl? the file of"),
            ("k", "cast/exhaustve.cl", "did you mean cast/exhaustive.cl? the file of"),
            ("k", "cast/my_own.cl", "the file of an axis's value lies in one of the folders cast/vectors/,"),
            ("k", "cl/cast/layout/soup.cl", "k/cl is a folder of kernels inside the folder that --cl-dir"),
            ("k/cast", "intersect/mine.cl", "k/cast is only a part of a folder laid out like raycl's cl/: "),
        ] {
            let error = unused(Path::new(folder), file, &[], false);
            assert!(error.remedy().starts_with(remedy), "{file}: {}", error.remedy());
        }
        for (folder, file, outer) in [
            ("k/cast", "intersect/mine.cl", Some("k")),
            ("cast/intersect", "mine.cl", Some(".")),
            ("k/cast", "mine.cl", None),
        ] {
            assert_eq!(outer_folder(Path::new(folder), file), outer.map(Path::new), "{folder}");
        }
    }

    /// Returns the headers of all values, if the folder of `--cl-dir` contains the kernel files `files`. Each
    /// element of `files` is a path in the folder and a text. Returns the error if the folder is refused.
    fn checked(files: &[(&str, &str)]) -> Result<Vec<Header>> {
        let folder = tempfile::tempdir().unwrap();
        for (file, text) in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let sources = Sources::Folder(folder.path().to_owned());
        refuse_unused(&sources).and_then(|()| headers(&sources))
    }

    /// Returns the error about a folder with these kernel files.
    fn refused_of(files: &[(&str, &str)]) -> Error {
        checked(files).unwrap_err()
    }

    #[test]
    fn a_wrong_path_in_an_include_is_reported_with_its_line() {
        let value = "cast/vectors/mine.cl";
        for path in ["../helper.cl", "helper.cl"] {
            let text = format!("int a;\n#include \"{path}\"\n");
            let error = refused_of(&[(value, &text), ("cast/helper.cl", "")]);
            assert!(error.to_string().contains("cast/helper.cl is neither a file of raycl"), "{error}");
            let line = format!("{value}, line 2 includes \"{path}\", but paths in #include are relative to ");
            let help = error.remedy();
            assert!(help.contains(&line) && help.ends_with("write #include \"cast/helper.cl\""), "{help}");
        }
        // Another file may be meant, so raycl only asks.
        let error = refused_of(&[(value, "int a;\n#include \"cast/helpr.cl\"\n"), ("cast/helper.cl", "")]);
        let asked =
            "line 2 includes \"cast/helpr.cl\", which does not exist: did you mean \"cast/helper.cl\"?";
        assert!(error.remedy().ends_with(asked), "{}", error.remedy());
        // raycl cannot follow other forms of #include.
        for text in ["#include <cast/helper.cl>\n", "#define H \"cast/helper.cl\"\n#include H\n"] {
            let error = refused_of(&[(value, text), ("cast/helper.cl", "")]);
            assert!(error.to_string().ends_with("does not support this form of #include"), "{error}");
            assert!(error.remedy().contains("write #include \"FOLDER/FILE.cl\""), "{}", error.remedy());
        }
    }

    #[test]
    fn a_file_that_is_only_included_is_sent_out_of_a_folder_of_values() {
        for path in ["helper.cl", "cast/vectors/helper.cl"] {
            let value = Sources::Embedded.read("cast/vectors/private.cl").unwrap();
            let text = format!("{value}\n#include \"{path}\"\n");
            let error =
                refused_of(&[("cast/vectors/mine.cl", &text), ("cast/vectors/helper.cl", "int a;\n")]);
            assert!(error.to_string().contains("helper.cl, line 1: "), "{error}");
            let line = value.lines().count() + 2;
            let help = error.remedy();
            assert!(
                help.contains(&format!("cast/vectors/mine.cl, line {line} includes this file")),
                "{help}"
            );
            assert!(help.contains("move it, for example to cast/helper.cl"), "{help}");
        }
    }

    #[test]
    fn an_include_of_a_similar_name_may_mean_another_file() {
        let value = Sources::Embedded.read("cast/vectors/private.cl").unwrap();
        let text = format!("{value}\n#include \"cast/helpr.cl\"\n");
        let error = refused_of(&[("cast/vectors/mine.cl", &text), ("cast/vectors/helper.cl", "int a;\n")]);
        assert!(error.to_string().contains("helper.cl, line 1: "), "{error}");
        assert!(!error.remedy().contains("includes this file"), "{}", error.remedy());
    }

    #[test]
    fn every_built_in_value_has_a_header_that_can_be_read() {
        let headers = headers(&Sources::Embedded).unwrap_or_else(|error| panic!("{error}"));
        let count = |axis: &str| headers.iter().filter(|header| header.axis == axis).count();
        let counts = ["vectors", "triangles", "layout", "shading", "intersector"].map(count);
        assert_eq!(counts, [4, 6, 3, 2, 6]);
        let watertight = headers.iter().find(|header| header.name == "watertight");
        let folders = watertight.map(|header| header.folders.clone()).unwrap_or_default();
        assert_eq!(folders, ["cast/intersect/", "tile_cpu/intersect/", "tile_gpu/intersect/"]);
    }

    #[test]
    fn an_include_in_a_comment_has_no_effect() {
        let included = |text: &str| -> Vec<_> {
            let includes = includes("a.cl", text).unwrap();
            includes.into_iter().map(|include| (include.path, include.location)).collect()
        };
        let second = ("b.cl".to_owned(), "a.cl, line 2".to_owned());
        assert_eq!(included("int a;\n#include \"b.cl\"\n"), [second]);
        assert!(included("/*\n#include \"b.cl\"\n*/\n").is_empty());
    }

    #[test]
    fn a_file_in_the_place_of_a_built_in_one_brings_its_own_header() {
        let file = "cast/intersect/moller_trumbore.cl";
        let text = Sources::Embedded.read(file).unwrap();
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("cast/intersect")).unwrap();
        let longer = text.replace("// record_floats: 12\n", "// record_floats: 16\n");
        std::fs::write(folder.path().join(file), longer).unwrap();
        let floats = |known: Headers| {
            let header = known.iter().find(|header| header.name == "moller-trumbore");
            header.and_then(|header| header.number("record_floats"))
        };
        let mut known: Headers = headers(&Sources::Embedded).unwrap().leak();
        assert_eq!(floats(known), Some(12));
        replace(&mut known, headers(&Sources::Folder(folder.path().to_owned())).unwrap());
        assert_eq!(floats(known), Some(16));
    }

    #[test]
    fn every_file_of_a_folder_of_values_is_a_value() {
        let files: Vec<_> = Sources::names().into_iter().map(str::to_owned).collect();
        let named = named(&files);
        for (folder, axis) in FOLDERS {
            for file in files.iter().filter(|file| file.starts_with(folder)) {
                let name = value_in(folder, file).unwrap_or_default();
                let own = named.iter().find(|named| named.axis == axis && named.name == name);
                assert!(own.is_some_and(|own| own.folders.contains(&folder)), "{file}");
            }
        }
    }

    /// Returns the message about a folder that contains only this kernel file; `None` if the folder is
    /// accepted.
    fn refused(file: &str, check: fn(&Sources) -> Result<()>) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "int a;\n").unwrap();
        check(&Sources::Folder(folder.path().to_owned())).err().map(|error| error.to_string())
    }

    #[test]
    fn the_name_of_a_value_can_be_written_anywhere() {
        for name in ["My", "a-b", "a b", "é"] {
            let message = refused(&format!("cast/vectors/{name}.cl"), refuse_names).unwrap_or_default();
            assert!(
                message.contains("a value of the axis 'vectors' and gives the value its name"),
                "{name}: {message}"
            );
        }
        assert_eq!(refused("cast/vectors/my_2.cl", refuse_names), None);
        assert_eq!(refused("My/File.cl", refuse_names), None, "no axis has this folder");
    }

    #[test]
    fn a_file_that_has_no_effect_is_refused() {
        let message = refused("cast/other.cl", refuse_unused).unwrap_or_default();
        assert!(message.contains("other.cl is neither a file of raycl nor a value"), "{message}");
        assert_eq!(refused("cast/vectors/mine.cl", refuse_unused), None, "a value");
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("cast/vectors")).unwrap();
        std::fs::write(folder.path().join("cast/other.cl"), "int a;\n").unwrap();
        std::fs::write(folder.path().join("cast/vectors/mine.cl"), "#include \"cast/other.cl\"\n").unwrap();
        assert!(refuse_unused(&Sources::Folder(folder.path().to_owned())).is_ok(), "a value includes it");
    }

    #[test]
    fn an_axis_in_an_includes_path_stands_for_each_of_its_values() {
        let value = Sources::Embedded.read("cast/vectors/private.cl").unwrap();
        let text = format!("{value}\n#include \"my/a_{{vectors}}.cl\"\n");
        let with = |file: &str| checked(&[("cast/vectors/mine.cl", &text), (file, "int a;\n")]);
        for file in ["my/a_private.cl", "my/a_mine.cl"] {
            assert!(with(file).is_ok(), "{file}");
        }
        for file in ["my/a_privat.cl", "my/private.cl", "my/a_watertight.cl", "your/a_private.cl"] {
            let message = with(file).unwrap_err().to_string();
            assert!(message.contains(&format!("{file} is neither a file of raycl nor a value")), "{message}");
        }
    }

    #[test]
    fn files_that_only_include_each_other_have_no_effect() {
        let (one, two) =
            (("my/one.cl", "#include \"my/two.cl\"\n"), ("my/two.cl", "#include \"my/one.cl\"\n"));
        let error = refused_of(&[one, two]);
        let said =
            "my/one.cl is neither a file of raycl nor a value of an axis, and only files without effect";
        assert!(error.to_string().contains(said), "{error}");
        // If one file includes the other, the error is about the file that nothing includes.
        let error = refused_of(&[("my/a.cl", "int a;\n"), ("my/z.cl", "#include \"my/a.cl\"\n")]);
        assert!(error.to_string().contains("my/z.cl is neither"), "{error}");
        assert!(error.to_string().ends_with("and no file includes it"), "{error}");
    }

    #[test]
    fn only_the_first_file_of_a_value_has_the_header() {
        for text in ["// record_floats: 999\n", "// A test.\n// meaning: mine\n//\n"] {
            let error = refused_of(&[("tile_cpu/intersect/watertight.cl", text)]);
            let line = text.lines().take_while(|line| !line.contains(": ")).count() + 1;
            let location = format!("tile_cpu/intersect/watertight.cl, line {line}: ");
            assert!(error.to_string().contains(&location), "{error}");
            assert!(error.to_string().ends_with("is in cl/cast/intersect/watertight.cl"), "{error}");
        }
    }

    #[test]
    fn a_new_file_before_a_built_in_header_needs_another_name() {
        let (file, built_in) = ("cast/intersect/edge_planes.cl", "tile_cpu/intersect/edge_planes.cl");
        let text = Sources::Embedded.read("cast/intersect/moller_trumbore.cl").unwrap();
        let error = refused_of(&[(file, &text)]);
        let said = format!(
            "{file}: 'edge-planes' is the name of a built-in value, whose header is in cl/{built_in}"
        );
        assert!(error.to_string().ends_with(&said), "{error}");
        assert_eq!((error.exit_code(), error.remedy()), (2, "choose another file name"));
        // If the user's folder also replaces the built-in file, the error is about this replacement, which the user can
        // edit.
        let own = Sources::Embedded.read(built_in).unwrap();
        let error = refused_of(&[(file, &text), (built_in, &own)]);
        assert!(
            error.to_string().contains(&format!("{built_in}, line 1: 'meaning' is a key of a header")),
            "{error}"
        );
    }
}
