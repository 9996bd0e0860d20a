//! The drivers that an OpenCL loader (the library that starts all installed drivers) would start. raycl can
//! try each driver alone, and so find the broken drivers.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

/// The folder whose .icd files OpenCL loaders read by default.
pub(super) const VENDORS: &str = "/etc/OpenCL/vendors";
/// The environment variable that names a folder of .icd files, which OpenCL loaders read instead of `VENDORS`.
/// In some loaders, such as ocl-icd, the variable may also name a single .icd file or the library of a driver.
const FOLDER: &str = "OCL_ICD_VENDORS";
/// The environment variable that names a folder of .icd files, which some loaders, such as ocl-icd, read instead
/// of `VENDORS` if `OCL_ICD_VENDORS` is not set.
const USUAL_FOLDER: &str = "OPENCL_VENDOR_PATH";
/// The environment variable that names the libraries of further drivers.
pub const LIBRARIES: &str = "OCL_ICD_FILENAMES";

/// The advice to a user if a driver crashes or hangs and other drivers are installed.
const USE_OTHERS: &str = "if a driver crashes or hangs, set the environment variable OCL_ICD_VENDORS to a folder that contains only the .icd files of the other drivers";
/// The advice to a user if the only installed driver crashes or hangs.
const CORRECT_DRIVER: &str = "check the environment variables that the driver reads (those of PoCL begin with POCL_) and the limits on processes and memory (`ulimit -a` shows them), update the driver, or install it again";

/// Returns the advice to a user if a driver crashes or hangs. `others` is the number of other installed
/// drivers.
pub fn crash_advice(others: usize) -> &'static str {
    if others > 0 { USE_OTHERS } else { CORRECT_DRIVER }
}

/// A driver, identified by the file or the library by which an OpenCL loader finds the driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Driver {
    /// An .icd file, which names the driver's library.
    Icd(PathBuf),
    /// The file name of the driver's library.
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

impl Driver {
    /// Returns true if the driver is PoCL: the name of the driver's library contains `pocl`.
    pub fn is_pocl(&self) -> bool {
        let library = match self {
            Self::Icd(file) => std::fs::read(file).unwrap_or_default(),
            Self::Library(name) => name.as_bytes().to_vec(),
        };
        String::from_utf8_lossy(&library).contains("pocl")
    }
}

/// Returns every driver that an OpenCL loader would start in the environment of this process.
pub fn installed() -> Vec<Driver> {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let usual = set(USUAL_FOLDER).unwrap_or_else(|| VENDORS.into());
    let libraries = std::env::var(LIBRARIES).unwrap_or_default();
    let named = libraries.split(':').filter(|name| !name.is_empty()).map(|name| Driver::Library(name.into()));
    drivers_at(set(FOLDER).as_deref(), &usual).into_iter().chain(named).collect()
}

/// Returns the drivers that an OpenCL loader finds in the folder `usual`. If `named_path` is not `None`,
/// returns instead the drivers in the folder `named_path`, or the driver that the .icd file or library
/// `named_path` names. An .icd file whose name has no slash is first searched for in `usual`.
fn drivers_at(named_path: Option<&Path>, usual: &Path) -> Vec<Driver> {
    let folder = named_path.unwrap_or(usual);
    if named_path.is_none() || folder.is_dir() {
        return icd_files(folder).into_iter().map(Driver::Icd).collect();
    }
    if !is_icd(folder) {
        return vec![Driver::Library(folder.to_string_lossy().into_owned())];
    }
    let beside = usual.join(folder);
    let is_bare = folder.components().count() == 1;
    vec![Driver::Icd(if is_bare && beside.is_file() { beside } else { folder.to_owned() })]
}

/// Returns the .icd files of a folder, sorted by name.
fn icd_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut files: Vec<PathBuf> =
        entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|file| is_icd(file)).collect();
    files.sort();
    files
}

fn is_icd(file: &Path) -> bool {
    file.extension().is_some_and(|extension| extension == "icd")
}

/// Returns environment variables that make an OpenCL loader find only the given drivers. Copies the .icd
/// files of these drivers into `folder`, which must be empty, and must exist as long as the loader is used.
/// Also writes an .icd file for a driver that is named as a library, since not every loader reads a variable
/// that names libraries.
///
/// # Errors
///
/// Fails if a file cannot be copied or written.
pub fn only(drivers: &[Driver], folder: &Path) -> io::Result<[(&'static str, OsString); 2]> {
    for (index, driver) in drivers.iter().enumerate() {
        let copy = folder.join(format!("{index:03}.icd"));
        match driver {
            Driver::Icd(file) => drop(std::fs::copy(file, copy)?),
            Driver::Library(name) => std::fs::write(copy, format!("{name}\n"))?,
        }
    }
    Ok([(FOLDER, folder.into()), (LIBRARIES, OsString::new())])
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
        assert!(icd_files(&folder.path().join("none")).is_empty());
        let icd = |file: &Path| vec![Driver::Icd(file.to_owned())];
        assert_eq!(drivers_at(None, folder.path()).len(), 2);
        assert_eq!(drivers_at(Some(folder.path()), Path::new("/none")).len(), 2);
        assert_eq!(drivers_at(Some(&a), Path::new("/none")), icd(&a));
        // Like `drivers_at`, the OpenCL loader ocl-icd searches for a name without a slash first in its usual
        // folder.
        assert_eq!(drivers_at(Some(Path::new("a.icd")), folder.path()), icd(&a));
        assert_eq!(drivers_at(Some(Path::new("c.icd")), folder.path()), icd(Path::new("c.icd")));
        std::fs::create_dir(folder.path().join("within")).expect("a folder");
        std::fs::write(folder.path().join("within/a.icd"), "lib.so\n").expect("a file");
        let within = Path::new("within/a.icd");
        assert_eq!(drivers_at(Some(within), folder.path()), icd(within), "the name has a slash");
        let library = Driver::Library("libone.so.1".into());
        assert_eq!(drivers_at(Some(Path::new("libone.so.1")), folder.path()), [library]);
    }

    #[test]
    fn an_environment_that_names_no_driver_adds_none() {
        let installed = installed();
        assert!(!installed.contains(&Driver::Library(String::new())), "{installed:?}");
    }

    #[test]
    fn the_only_driver_must_be_corrected_and_one_of_several_can_be_left_out() {
        assert_eq!([0, 1, 2].map(crash_advice), [CORRECT_DRIVER, USE_OTHERS, USE_OTHERS]);
    }

    #[test]
    fn more_than_ten_drivers_keep_their_order() {
        let folder = tempfile::tempdir().expect("a folder");
        let libraries: Vec<String> = (0..11).map(|number| format!("lib{number}.so")).collect();
        let drivers: Vec<Driver> = libraries.iter().cloned().map(Driver::Library).collect();
        only(&drivers, folder.path()).expect("files");
        let read = |file: &PathBuf| std::fs::read_to_string(file).expect("a file").trim().to_owned();
        assert_eq!(icd_files(folder.path()).iter().map(read).collect::<Vec<_>>(), libraries);
    }

    #[test]
    fn pocl_is_known_by_the_name_of_its_library() {
        let folder = tempfile::tempdir().expect("a folder");
        let icd = |text: &str| {
            let file = folder.path().join("a.icd");
            std::fs::write(&file, text).expect("a file");
            Driver::Icd(file).is_pocl()
        };
        assert!(icd("/usr/lib/libpocl.so.2\n") && !icd("libnvidia-opencl.so.1\n"));
        assert!(
            Driver::Library("libpocl.so".into()).is_pocl() && !Driver::Library("libone.so".into()).is_pocl()
        );
        assert!(!Driver::Icd(folder.path().join("missing.icd")).is_pocl());
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
        assert_eq!(libraries, (LIBRARIES, "".into()));
        let texts: Vec<_> =
            icd_files(to.path()).iter().map(|copy| std::fs::read_to_string(copy).expect("a copy")).collect();
        assert_eq!(texts, ["libone.so\n", "libtwo.so\n", "/three.so\n"]);
    }

    #[test]
    fn a_driver_whose_file_cannot_be_copied_is_not_left_out_silently() {
        let [from, to] = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
        let missing = [Driver::Icd(from.path().join("missing.icd"))];
        assert_eq!(only(&missing, to.path()).expect_err("no copy").kind(), io::ErrorKind::NotFound);
    }
}
