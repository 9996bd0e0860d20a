//! The values of axes that are kernel files: built-in files, and those in the folder that the option `--cl-dir` names.
//! A new file in a folder of values is a new value.

use super::AXES;
use super::header::{Header, Reader};
use crate::error::{Error, Result, nearest};
use crate::sources::{Sources, lines};
use std::cell::Cell;
use std::path::PathBuf;
use std::sync::{LazyLock, Mutex, PoisonError, RwLock};

/// The folders of values, and the axis to which their files belong. A value may have a file in several
/// folders, one per family that supports it; the first file contains its header.
pub const FOLDERS: [(&str, &str); 7] = [
    ("cast/vectors/", "vectors"),
    ("cast/triangles/", "triangles"),
    ("cast/layout/", "layout"),
    ("cast/shading/", "shading"),
    ("cast/intersect/", "intersector"),
    ("tile_cpu/intersect/", "intersector"),
    ("tile_gpu/intersect/", "intersector"),
];

type Headers = &'static [Header];

/// The headers of all values. The headers are constant for the process, which reads its `--cl-dir` before it parses any
/// name of a value. (If a run compares two folders, these are the headers of the second one; see [`Values`].) The
/// headers live as long as the process, so that a strategy can hold their names and be copied.
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
    let mut all = ALL.lock().unwrap_or_else(PoisonError::into_inner);
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

/// Returns the header of a value; an empty header if the value has no file, which does not happen for names that were
/// parsed.
pub(super) fn header_of(axis: &str, name: &str) -> &'static Header {
    static NONE: Header = Header::NONE;
    values_of(axis).find(|header| header.name == name).unwrap_or(&NONE)
}

impl Sources {
    /// Returns the kernel files for a command: the built-in ones, replaced or extended by those of its
    /// `--cl-dir`. From then on, `values_of` returns the values that are files in these sources.
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

/// Replaces the known headers if any of them differs. Equal headers are not replaced, since headers
/// are never freed.
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
    /// Returns the file that contains the value's header.
    fn file(&self) -> String {
        let folder = self.folders.first().copied().unwrap_or_default();
        format!("{folder}{}.cl", self.name.replace('-', "_"))
    }
}

/// Returns the name of the value for a file, if the file lies in this folder.
fn value_in(folder: &str, file: &str) -> Option<String> {
    let stem = file.strip_prefix(folder)?.strip_suffix(".cl")?;
    (!stem.contains('/')).then(|| stem.replace('_', "-"))
}

fn named(files: &[String]) -> Vec<Named> {
    let mut all: Vec<Named> = Vec::new();
    for (folder, axis) in FOLDERS {
        for name in files.iter().filter_map(|file| value_in(folder, file)) {
            match all.iter_mut().find(|named| named.axis == axis && named.name == name) {
                Some(named) => named.folders.push(folder),
                None => all.push(Named { axis, name, folders: vec![folder] }),
            }
        }
    }
    let place = |axis: &str| AXES.iter().position(|info| info.name == axis);
    all.sort_by(|a, b| (place(a.axis), &a.name).cmp(&(place(b.axis), &b.name)));
    all
}

/// Returns the headers of all values, in the order of their axes and names.
fn headers(sources: &Sources) -> Result<Vec<Header>> {
    let all = named(&sources.files()?);
    let names_of = |axis: &str| -> Vec<String> {
        let listed = AXES.iter().filter(|info| info.name == axis).flat_map(|info| info.listed);
        let files = all.iter().filter(|named| named.axis == axis).map(|named| named.name.clone());
        listed.map(|(name, _)| (*name).to_owned()).chain(files).collect()
    };
    let read = |named: &Named| {
        let file = named.file();
        let reader = Reader { axis: named.axis, path: &sources.path_of(&file), names_of: &names_of };
        reader.read(named.name.clone(), named.folders.clone(), &sources.read(&file)?)
    };
    all.iter().map(read).collect()
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

/// Refuses a file that nothing includes and that is not a value, since it would silently have no effect.
fn refuse_unused(sources: &Sources) -> Result<()> {
    let files = sources.own_files()?;
    let built_in = Sources::names();
    let is_value = |file: &str| FOLDERS.iter().any(|(folder, _)| value_in(folder, file).is_some());
    let mut texts = None;
    for file in files.iter().filter(|file| !built_in.contains(&file.as_str()) && !is_value(file)) {
        let read = || {
            let named = |name: String| Ok((sources.read(&name)?, name));
            sources.files()?.into_iter().map(named).collect::<Result<Vec<(String, String)>>>()
        };
        let texts = match &texts {
            Some(texts) => texts,
            None => texts.insert(read()?),
        };
        if !texts.iter().any(|(text, name)| includes(name, text, file)) {
            return Err(unused(&sources.path_of(file), file, &built_in));
        }
    }
    Ok(())
}

/// Returns whether a kernel file includes another one; an `#include` in a comment has no effect.
fn includes(name: &str, text: &str, included: &str) -> bool {
    lines(name, text).is_ok_and(|lines| lines.iter().any(|line| line.includes == Some(included)))
}

fn unused(path: &str, file: &str, built_in: &[&'static str]) -> Error {
    let message =
        format!("{path} is neither a file of raycl nor a value of an axis, and no file includes it");
    if let Some(folder) = path.strip_suffix(file).filter(|_| file.starts_with("cl/")) {
        return Error::input(message).with_help(format!(
            "{folder}cl is a folder of kernels inside the folder that --cl-dir names: write --cl-dir {folder}cl, or remove {folder}cl"
        ));
    }
    let folders: Vec<_> = FOLDERS.iter().map(|(folder, _)| *folder).collect();
    let stem = file.rsplit('/').next().unwrap_or(file);
    let as_values: Vec<_> = folders.iter().map(|folder| format!("{folder}{stem}")).collect();
    let places = format!("the file of an axis's value lies in one of the folders {}", folders.join(", "));
    // A file in a wrong folder is more likely than a misspelt name.
    let is_named_so = |name: &&str| name.rsplit('/').next() == Some(stem);
    let same: Vec<&str> = built_in.iter().copied().filter(is_named_so).collect();
    let others =
        built_in.iter().copied().chain(as_values.iter().map(String::as_str)).filter(|other| *other != file);
    let meant =
        nearest(file, same.iter().copied()).or(same.first().copied()).or_else(|| nearest(file, others));
    Error::input(message).with_help(match meant {
        Some(meant) => format!("did you mean {meant}? {places}"),
        None => places,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kernel_file_in_a_wrong_folder_is_sent_to_the_right_one() {
        let built_in = ["anchor/spheres.cl", "cast/intersect/moller_trumbore.cl", "cast/layout/soup.cl"];
        let help = |path: &str, file: &str| format!("{:?}", unused(path, file, &built_in));
        let moved = help("k/cast/moller_trumbore.cl", "cast/moller_trumbore.cl");
        assert!(moved.contains("did you mean cast/intersect/moller_trumbore.cl?"), "{moved}");
        let misspelt = help("k/cast/layout/suop.cl", "cast/layout/suop.cl");
        assert!(misspelt.contains("did you mean cast/layout/soup.cl?"), "{misspelt}");
        let nested = help("k/cl/cast/layout/soup.cl", "cl/cast/layout/soup.cl");
        assert!(nested.contains("--cl-dir k/cl,"), "{nested}");
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
        let is_included = |text: &str| includes("a.cl", text, "b.cl");
        assert!(is_included("int a;\n#include \"b.cl\"\n"));
        assert!(!is_included("/*\n#include \"b.cl\"\n*/\n") && !is_included("#include \"c.cl\"\n"));
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

    /// Returns the message about a folder of kernel files with this additional file; `None` if the folder is accepted.
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
            let told = refused(&format!("cast/vectors/{name}.cl"), refuse_names).unwrap_or_default();
            assert!(
                told.contains("a value of the axis 'vectors' and gives the value its name"),
                "{name}: {told}"
            );
        }
        assert_eq!(refused("cast/vectors/my_2.cl", refuse_names), None);
        assert_eq!(refused("My/File.cl", refuse_names), None, "no axis has this folder");
    }

    #[test]
    fn a_file_that_has_no_effect_is_refused() {
        let told = refused("cast/other.cl", refuse_unused).unwrap_or_default();
        assert!(told.contains("other.cl is neither a file of raycl nor a value"), "{told}");
        assert_eq!(refused("cast/vectors/mine.cl", refuse_unused), None, "a value");
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("cast/vectors")).unwrap();
        std::fs::write(folder.path().join("cast/other.cl"), "int a;\n").unwrap();
        std::fs::write(folder.path().join("cast/vectors/mine.cl"), "#include \"cast/other.cl\"\n").unwrap();
        assert!(refuse_unused(&Sources::Folder(folder.path().to_owned())).is_ok(), "a value includes it");
    }
}
