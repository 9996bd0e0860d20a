//! Checks the paths in a folder of results. A folder of results may come from a stranger, so paths in the
//! folder must not lead out of the folder or to a device file.

use crate::error::{Error, Result};
use crate::reader;
use std::io::{Error as IoError, ErrorKind};
use std::path::Path;

const LINK: &str = "it is a link, which may lead out of the folder";
/// The remedy for a link, a pipe or a device to which raycl would have to append.
const ORDINARY: &str = "put an ordinary file in its place, such as the file to which a link leads (in git-annex and DataLad: `git annex unlock FILE`), or choose another folder with --out DIR";

/// Creates a subfolder in a folder of results. Fails if the subfolder's path is a link.
pub fn own_folder(path: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(path)?;
    match path.symlink_metadata()?.is_symlink() {
        true => Err(IoError::new(ErrorKind::InvalidInput, LINK)),
        false => Ok(()),
    }
}

/// Fails if `path` is a link, a pipe or a device, to which raycl must not append. Accepts the path of a
/// missing file.
pub fn own_file(path: &Path) -> std::io::Result<()> {
    match path.symlink_metadata() {
        Ok(metadata) if metadata.is_symlink() => Err(IoError::new(ErrorKind::InvalidInput, LINK)),
        Ok(_) => ordinary(path),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error),
    }
}

/// Returns an input error (a mistake of the user) if `path` is a link, a pipe or a device, to which raycl must not
/// append. Returns another error if the system does not say what is at `path`.
pub fn refuse_link(path: &Path) -> Result<()> {
    own_file(path).map_err(|error| match error.kind() {
        ErrorKind::InvalidInput => {
            Error::input(format!("cannot write {}: {error}", path.display())).with_help(ORDINARY)
        }
        _ => Error::unwritable(path, &error),
    })
}

/// Fails if `path` is a pipe or a device, since reading from a pipe or a device may never end.
pub fn ordinary(path: &Path) -> std::io::Result<()> {
    let metadata = path.metadata()?;
    match metadata.is_file() || metadata.is_dir() {
        true => Ok(()),
        false => Err(IoError::new(ErrorKind::InvalidInput, "it is not an ordinary file")),
    }
}

/// Returns the bytes of a picture file in a folder of results.
///
/// # Errors
///
/// Fails if the path leads, after links are followed, out of the folder or to something that is not an
/// ordinary file. Another cause of failure is a file that cannot be read, or that is larger than reports
/// allow for a picture.
pub fn read_inside(folder: &Path, path: &str) -> std::io::Result<Vec<u8>> {
    let resolved = folder.join(path).canonicalize()?;
    match resolved.starts_with(folder.canonicalize()?) {
        true => reader::bytes(&resolved, reader::Kind::Shown),
        false => Err(IoError::new(ErrorKind::InvalidInput, "it leads out of the folder")),
    }
}

#[cfg(all(test, unix))]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::super::whole::write_page;
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn links_are_not_followed_and_devices_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let [outer, file, plots] = ["outer", "file", "plots"].map(|name| folder.path().join(name));
        std::fs::write(&outer, "untouched").unwrap();
        symlink(&outer, &file).unwrap();
        symlink("/tmp", &plots).unwrap();
        assert!(own_file(&file).unwrap_err().to_string().contains("link"));
        for path in [file.as_path(), Path::new("/dev/null")] {
            let refused = refuse_link(path).unwrap_err();
            assert!(refused.to_string().starts_with(&format!("cannot write {}: it is ", path.display())));
            assert_eq!((refused.exit_code(), refused.remedy()), (2, ORDINARY));
        }
        assert!(own_folder(&plots).unwrap_err().to_string().contains("link"));
        assert!(
            own_file(&folder.path().join("new")).is_ok() && own_folder(&folder.path().join("made")).is_ok()
        );
        assert!(ordinary(Path::new("/dev/zero")).is_err() && ordinary(folder.path()).is_ok());
        write_page(&file, b"page").unwrap();
        assert_eq!(
            (std::fs::read(&outer).unwrap(), std::fs::read(&file).unwrap()),
            (b"untouched".into(), b"page".into())
        );
    }

    #[test]
    fn pictures_are_read_through_a_link_to_the_folder() {
        let parent = tempfile::tempdir().unwrap();
        let [folder, link] = ["results", "latest"].map(|name| parent.path().join(name));
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join("a.png"), "a picture").unwrap();
        symlink(&folder, &link).unwrap();
        assert_eq!(read_inside(&link, "a.png").unwrap(), b"a picture");
    }
}
