//! The values of axes that are kernel files: built-in files, and those in the folder that the option
//! `--cl-dir` names. A new file in one of the [`FOLDERS`] defines a new value of the folder's axis.

#[cfg(test)]
mod fixtures;
mod folders;
mod includes;
mod unused;

pub use folders::FOLDERS;

use super::header::{Header, Reader};
use crate::error::{Error, Result};
use crate::sources::Sources;
use crate::threads::locked;
use folders::{Named, named, names_of, refuse_names};
use includes::{has_name_of, includes_file, includes_of_all, wrong_include};
use std::cell::Cell;
use std::path::PathBuf;
use std::sync::{LazyLock, Mutex, PoisonError, RwLock};
use unused::refuse_unused;

type Headers = &'static [Header];

/// The headers of all values that are built-in kernel files.
static BUILT_IN: LazyLock<Headers> = LazyLock::new(built_in);

/// The headers of all values that are kernel files. A process reads its `--cl-dir` before it parses the first
/// name of a value; after that, the headers do not change. Only a run that compares two folders of kernels
/// reads a second folder later: `KNOWN` then has the headers of the second folder (see [`Values`]). The headers
/// live as long as the process, so that a strategy can hold their names and be copied.
static KNOWN: LazyLock<RwLock<Headers>> = LazyLock::new(|| RwLock::new(*BUILT_IN));

thread_local! {
    /// The headers that this thread uses instead of [`KNOWN`].
    static INSTEAD: Cell<Option<Headers>> = const { Cell::new(None) };
}

/// Reads the headers of all values that are built-in kernel files. A test checks that these headers can be
/// read.
fn built_in() -> Headers {
    headers(&Sources::Embedded).unwrap_or_default().leak()
}

/// Returns the headers of all values of axes that are kernel files, in the order of the axes and of the
/// values' names.
fn known() -> Headers {
    INSTEAD.get().unwrap_or_else(|| *KNOWN.read().unwrap_or_else(PoisonError::into_inner))
}

/// The values of axes that the kernel files of certain sources define, with the files' headers. A run that
/// compares two folders of kernels needs the values that each folder defines, since a value of the same name
/// may have different properties in the two folders.
#[derive(Clone, Copy, Debug)]
pub struct Values(Headers);

impl Values {
    /// Calls `work`. During the call, and only in this thread, the values of axes have the properties that
    /// the headers in `self` state.
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

/// Returns the headers of an axis's values, in the order of the values' names.
pub fn values_of(axis: &str) -> impl Iterator<Item = &'static Header> {
    known().iter().filter(move |header| header.axis == axis)
}

/// Returns the header of the kernel file that defines a value of an axis; an empty header if the value has no
/// kernel file. If the values of an axis are kernel files, a name that was parsed as a value of this axis has a
/// file.
pub(super) fn header_of(axis: &str, name: &str) -> &'static Header {
    static NONE: Header = Header::NONE;
    values_of(axis).find(|header| header.name == name).unwrap_or(&NONE)
}

/// If the kernel file with this header replaces a built-in file that has another header, returns the file's
/// name, relative to the folder of `--cl-dir`. Otherwise, returns `None`.
pub(super) fn replacing(header: &Header) -> Option<String> {
    let replaced = BUILT_IN.iter().find(|other| other.axis == header.axis && other.name == header.name)?;
    let folder = header.folders.first().filter(|_| replaced != header)?;
    Some(format!("{folder}{}.cl", header.name.replace('-', "_")))
}

impl Sources {
    /// Returns the kernel files for a command: the built-in files, and the files in `folder` (the option
    /// `--cl-dir`), which replace built-in files or are additional ones. After this call, `values_of` returns
    /// the headers of the kernel files in the returned sources.
    pub fn of(folder: Option<PathBuf>) -> Result<Self> {
        let sources = folder.map_or(Self::Embedded, Self::Folder);
        refuse_names(&sources)?;
        refuse_unused(&sources)?;
        let headers = headers(&sources)?;
        let mut known = KNOWN.write().unwrap_or_else(PoisonError::into_inner);
        replace(&mut known, headers);
        Ok(sources)
    }

    /// Returns the values of axes that the kernel files in these sources define.
    pub fn values(&self) -> Result<Values> {
        Ok(Values(stored(headers(self)?)))
    }
}

/// Replaces the known headers of values by `headers` if any header differs. Equal headers are not replaced,
/// since the memory of replaced headers is never freed.
fn replace(known: &mut Headers, headers: Vec<Header>) {
    if *known != headers {
        *known = headers.leak();
    }
}

/// Returns the headers of all values. The headers are sorted by the order of their axes in [`super::AXES`],
/// and within an axis by the values' names.
fn headers(sources: &Sources) -> Result<Vec<Header>> {
    let all = named(&sources.files()?);
    let names_of = |axis: &str| names_of(&all, axis);
    let read = |named: &Named| -> Result<Header> {
        let mut files = named.files();
        let file = files.next().unwrap_or_default();
        let path = sources.path_of(&file);
        let included_at = || {
            // raycl's own kernel files may include the built-in file of a value, so an `#include` of such a
            // file shows no mistake.
            if Sources::Embedded.read(&file).is_ok() {
                return None;
            }
            let includes = includes_of_all(sources).ok()?;
            let of_file = includes.iter().find(|include| include.path == file);
            let wrong = || wrong_include(&file, &includes).filter(|include| has_name_of(include, &file));
            of_file.or_else(wrong).map(|include| include.location.clone())
        };
        let includes = |other: &str| includes_file(sources, &file, other);
        let (names_of, included_at, includes) = (&names_of, &included_at, &includes);
        let reader = Reader { axis: named.axis, file: &file, path: &path, names_of, included_at, includes };
        let header = reader.read(named.name.clone(), named.folders.clone(), &sources.read(&file)?)?;
        for other in files {
            let checked = reader.refuse_another(&sources.path_of(&other), &sources.read(&other)?);
            checked.map_err(|error| match sources.own_path(&other) {
                Some(_) => error,
                // If the value's other file is built in, the user cannot edit the other file, so the error is
                // about the user's own file.
                None => taken(&path, &named.name, &other),
            })?;
        }
        Ok(header)
    };
    all.iter().map(read).collect()
}

/// Returns the error about one of the user's files that has the name of a built-in value. In `FOLDERS`, the file's
/// folder comes before the folder of the built-in header.
fn taken(path: &str, name: &str, built_in: &str) -> Error {
    Error::input(format!(
        "{path}: '{name}' is the name of a built-in value, whose header is in cl/{built_in}"
    ))
    .with_help("choose another file name")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::values::fixtures::{checked, refused_of};

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
    fn exact_signs_need_an_include_in_the_file_or_in_one_that_it_includes() {
        let (file, include) = ("cast/intersect/mine.cl", "#include \"common/exact_signs.cl\"\n");
        let text = Sources::Embedded.read("cast/intersect/watertight.cl").unwrap();
        assert_eq!(text.matches(include).count(), 1);
        let with = |other: &str| text.replace(include, other);
        for other in ["", "// #include \"common/exact_signs.cl\"\n", "#include \"common/lanes.cl\"\n"] {
            let error = refused_of(&[(file, &with(other))]);
            let said = format!("{file}, line 4: 'exact_signs' is yes, but the file does not include common/");
            assert!(error.to_string().contains(&said), "{error}");
            assert_eq!(error.exit_code(), 2);
        }
        let through = with("#include \"my/helper.cl\"\n");
        assert!(checked(&[(file, &text)]).is_ok());
        assert!(checked(&[(file, &through), ("my/helper.cl", include)]).is_ok());
        // The kernels of tiles include `common/exact_signs.cl` themselves.
        let planes = Sources::Embedded.read("tile_cpu/intersect/edge_planes.cl").unwrap();
        let planes = planes.replace("exact_signs: no", "exact_signs: yes");
        assert!(checked(&[("tile_cpu/intersect/mine.cl", &planes)]).is_ok());
        let error = refused_of(&[(file, &with("#include \"common/exact_sign.cl\"\n"))]);
        assert!(error.to_string().contains("mine.cl, line 15, #include \"common/exact_sign.cl\""), "{error}");
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
