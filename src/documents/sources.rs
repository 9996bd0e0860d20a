//! The stored records from which figures are computed. Each folder or file is read only once.

use crate::reader::{self, Kind};
use crate::record::Folder;
use serde_json::Value;
use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// The contents of a source, which is a folder or file from which a document's numbers are computed.
pub enum Source {
    /// The results in a folder that `raycl run` wrote.
    Folder(Folder),
    /// A JSON file that another command of raycl, or another program, wrote.
    Json(Value),
}

/// Finds the sources of a document's numbers by name. The part of a source's name before the first `/` stands
/// for a folder, and the part after the `/` is a path within this folder.
pub struct Sources {
    root: PathBuf,
    folders: BTreeMap<String, String>,
    read: RefCell<HashMap<String, Rc<Source>>>,
}

impl Sources {
    /// Returns access to the stored records of the repository at `root`. `folders` maps the first part of a
    /// source's name to a folder.
    pub fn new(root: &Path, folders: BTreeMap<String, String>) -> Self {
        Self { root: root.to_owned(), folders, read: RefCell::default() }
    }

    /// Returns the source with this name, such as "h200/reproduce/figure-8". The name of a JSON file does not contain
    /// the file's extension. The error says why the source cannot be read.
    pub fn get(&self, name: &str) -> Result<Rc<Source>, String> {
        if let Some(known) = self.read.borrow().get(name) {
            return Ok(known.clone());
        }
        let source = Rc::new(self.read(name)?);
        self.read.borrow_mut().insert(name.to_owned(), source.clone());
        Ok(source)
    }

    /// Returns the folder of results with this name. Returns an error if the source is a JSON file or cannot
    /// be read.
    pub fn folder(&self, name: &str) -> Result<Folder, String> {
        match &*self.get(name)? {
            Source::Folder(folder) => Ok(folder.clone()),
            Source::Json(_) => Err(format!("'{name}' is a JSON file; expected a folder of results")),
        }
    }

    fn read(&self, name: &str) -> Result<Source, String> {
        let (first, rest) = name.split_once('/').unwrap_or((name, ""));
        let folder = self.folders.get(first).ok_or_else(|| {
            let known: Vec<_> = self.folders.keys().map(String::as_str).collect();
            format!("'{first}' is not a source; expected one of {}", known.join(", "))
        })?;
        let path = self.root.join(folder).join(rest);
        let file = PathBuf::from(format!("{}.json", path.display()));
        if !file.is_file() {
            return Folder::read(&path).map(Source::Folder).map_err(|error| error.to_string());
        }
        let text =
            reader::text(&file, Kind::Results).map_err(|error| format!("{}: {error}", file.display()))?;
        serde_json::from_str(&text).map(Source::Json).map_err(|error| format!("{}: {error}", file.display()))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn a_source_may_lie_in_folders_within_its_folder() {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(root.path().join("docs/gpu/sweeps")).unwrap();
        std::fs::write(root.path().join("docs/gpu/sweeps/one.json"), "{\"a\": 1}").unwrap();
        let sources = Sources::new(root.path(), BTreeMap::from([("gpu".to_owned(), "docs/gpu".to_owned())]));
        let Source::Json(value) = &*sources.get("gpu/sweeps/one").unwrap() else { panic!("no file") };
        assert_eq!(value["a"], 1);
    }

    #[test]
    fn a_json_file_that_cannot_be_read_is_named() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("one.json");
        let sources = Sources::new(root.path(), BTreeMap::from([("gpu".to_owned(), String::new())]));
        for contents in [&b"{"[..], b"\xff"] {
            std::fs::write(&path, contents).unwrap();
            let error = sources.get("gpu/one").err().unwrap();
            assert!(error.starts_with(&format!("{}: ", path.display())), "{error}");
        }
    }
}
