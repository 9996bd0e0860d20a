//! The drivers that an OpenCL loader would start. They can be tried one by one, so that a broken one can be
//! left out.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

/// The folder that loaders read by default.
pub(super) const VENDORS: &str = "/etc/OpenCL/vendors";
/// The environment variable that names another folder, or one .icd file.
const FOLDER: &str = "OCL_ICD_VENDORS";
/// The environment variable that names additional libraries.
const LIBRARIES: &str = "OCL_ICD_FILENAMES";

/// A driver, as a loader finds it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Driver {
    /// An .icd file, which names the driver's library.
    Icd(PathBuf),
    /// The name of the driver's library.
    Library(String),
}

impl std::fmt::Display for Driver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Icd(file) => write!(f, "{}", file.display()),
            Self::Library(name) => f.write_str(name),
        }
    }
}

/// Returns every driver that is installed or named in the environment.
pub fn installed() -> Vec<Driver> {
    let folder = std::env::var_os(FOLDER).map_or_else(|| VENDORS.into(), PathBuf::from);
    let libraries = std::env::var(LIBRARIES).unwrap_or_default();
    let named = libraries.split(':').filter(|name| !name.is_empty()).map(|name| Driver::Library(name.into()));
    icd_files(&folder).into_iter().map(Driver::Icd).chain(named).collect()
}

/// Returns the .icd files of a folder, or the path itself if it is such a file.
fn icd_files(path: &Path) -> Vec<PathBuf> {
    let is_icd = |file: &PathBuf| file.extension().is_some_and(|extension| extension == "icd");
    if path.is_file() {
        return vec![path.to_owned()];
    }
    let entries = std::fs::read_dir(path).into_iter().flatten();
    let mut files: Vec<PathBuf> =
        entries.filter_map(|entry| Some(entry.ok()?.path())).filter(is_icd).collect();
    files.sort();
    files
}

/// Returns environment variables with which a loader finds these drivers only. Their .icd files are copied to
/// `folder`, which must be empty and must outlive the loader.
///
/// # Errors A file that cannot be copied.
pub fn only(drivers: &[Driver], folder: &Path) -> io::Result<[(&'static str, OsString); 2]> {
    let mut libraries = Vec::new();
    for (place, driver) in drivers.iter().enumerate() {
        match driver {
            Driver::Icd(file) => drop(std::fs::copy(file, folder.join(format!("{place:03}.icd")))?),
            Driver::Library(name) => libraries.push(name.as_str()),
        }
    }
    Ok([(FOLDER, folder.into()), (LIBRARIES, libraries.join(":").into())])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drivers_are_the_icd_files_of_a_folder_in_order_or_one_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["b.icd", "a.icd", "a.icd.off", "readme"] {
            std::fs::write(folder.path().join(name), "lib.so\n").expect("a file");
        }
        let [a, b] = ["a.icd", "b.icd"].map(|name| folder.path().join(name));
        assert_eq!(icd_files(folder.path()), [a.clone(), b]);
        assert_eq!(icd_files(&a), [a]);
        assert!(icd_files(&folder.path().join("none")).is_empty());
    }

    #[test]
    fn some_drivers_are_found_without_the_others() {
        let [from, to] = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
        let icd = from.path().join("one.icd");
        std::fs::write(&icd, "libone.so\n").expect("a file");
        let some =
            [Driver::Icd(icd), Driver::Library("libtwo.so".into()), Driver::Library("/three.so".into())];
        let [folder, libraries] = only(&some, to.path()).expect("a copy");
        assert_eq!(folder, (FOLDER, to.path().into()));
        assert_eq!(libraries, (LIBRARIES, "libtwo.so:/three.so".into()));
        let copies = icd_files(to.path());
        assert_eq!(copies.len(), 1);
        assert_eq!(std::fs::read_to_string(&copies[0]).expect("the copy"), "libone.so\n");
    }
}
