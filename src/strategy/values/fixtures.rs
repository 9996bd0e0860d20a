//! For tests: folders of kernel files, and the errors about them.

use super::headers;
use super::unused::refuse_unused;
use crate::error::{Error, Result};
use crate::sources::Sources;
use crate::strategy::header::Header;
use tempfile::TempDir;

/// Returns a folder with these kernel files. Each element of `files` is a path in the folder and a text.
fn folder_with(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (file, text) in files {
        let path = folder.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    folder
}

/// Returns the headers of all values that are kernel files, if the folder of `--cl-dir` contains `files`.
/// Each element of `files` is a path in the folder and a text. Returns the error if the folder is refused.
pub fn checked(files: &[(&str, &str)]) -> Result<Vec<Header>> {
    let folder = folder_with(files);
    let sources = Sources::Folder(folder.path().to_owned());
    refuse_unused(&sources).and_then(|()| headers(&sources))
}

/// Returns the error about a folder that contains the kernel files `files`.
pub fn refused_of(files: &[(&str, &str)]) -> Error {
    checked(files).unwrap_err()
}

/// Returns the message about a folder that contains only this kernel file; `None` if the folder is
/// accepted.
pub fn refused(file: &str, check: fn(&Sources) -> Result<()>) -> Option<String> {
    let folder = folder_with(&[(file, "int a;\n")]);
    check(&Sources::Folder(folder.path().to_owned())).err().map(|error| error.to_string())
}
