//! Opens the files that users name, and files that raycl has written. Only ordinary files are read. For most kinds
//! of files, a file with more bytes than a limit is an error.

#[cfg(unix)]
use rayon::prelude::*;
use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Read as _, Result};
use std::path::{Path, PathBuf};

/// The path that means standard input.
pub const STANDARD_INPUT: &str = "-";

/// Returns true if the path means standard input, which can be read only once.
pub fn is_standard_input(path: &Path) -> bool {
    path.as_os_str() == STANDARD_INPUT
}

/// A file with more bytes than this number is read by all threads, in pieces of this size.
const PIECE_BYTES: usize = 4 << 20;

/// The purpose for which a file is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A TOML file, such as a scene, an experiment or the user's settings.
    Toml,
    /// An MTL file, which describes the materials of an OBJ mesh.
    Materials,
    /// An image that a mesh uses as a texture, or the picture of a sky.
    Texture,
    /// The output of `raycl peak` for a device.
    Peaks,
    /// A kernel file in the folder that the option `--cl-dir` names.
    Kernel,
    /// A mesh of any format, or a buffer of a glTF file. The file's size is compared with the free memory.
    Mesh,
    /// A picture that the user names for a comparison with another picture. The file's size, and the size of
    /// the decoded picture, are compared with the free memory.
    Picture,
    /// A file that a run writes about itself (such as `environment.json`), a stored sweep, or one of raycl's documents.
    Results,
    /// The plan of a run, `plan.json`. Its size grows with the number of points, like the sizes of journals.
    Plan,
    /// A picture that a report shows or `raycl merge` copies.
    Shown,
}

/// For each purpose, what messages call the file, and the size in MiB of the largest file that is read. `None` means
/// that this module does not limit the size. `docs/scenes.md` and `docs/reliability.md` state the same limits.
const LIMITS_MIB: [(Kind, &str, Option<u64>); 10] = [
    (Kind::Toml, "a TOML file", Some(16)),
    (Kind::Materials, "an MTL file", Some(16)),
    (Kind::Texture, "a texture", Some(256)),
    (Kind::Peaks, "a file of a device's peak rates", Some(16)),
    (Kind::Kernel, "a kernel file", Some(1)),
    (Kind::Mesh, "a mesh", None),
    (Kind::Picture, "a picture", None),
    (Kind::Results, "a file of results", Some(64)),
    (Kind::Plan, "a plan", None),
    (Kind::Shown, "a picture of results", Some(64)),
];

/// Opens an ordinary file. Returns an error for pipes and devices without reading them, since a read may
/// never end.
///
/// # Errors
///
/// Returns the system's error. Also fails if `path` is not an ordinary file.
pub fn open(path: &Path) -> Result<File> {
    // Opening a pipe would wait for its writer, so the path is checked before it is opened. The open file is
    // checked again, since the file at this path may have been replaced after the first check.
    ordinary(&path.metadata()?)?;
    let file = File::open(path)?;
    ordinary(&file.metadata()?)?;
    Ok(file)
}

fn ordinary(metadata: &Metadata) -> Result<()> {
    match (metadata.is_file(), metadata.is_dir()) {
        (true, _) => Ok(()),
        (_, true) => Err(Error::new(ErrorKind::IsADirectory, "it is a folder; expected an ordinary file")),
        _ => Err(Error::new(
            ErrorKind::InvalidInput,
            "it is a pipe, a socket or a device; expected an ordinary file",
        )),
    }
}

/// Reads all of an ordinary file.
///
/// # Errors
///
/// Fails under the same conditions as [`open`] and [`rest`].
pub fn bytes(path: &Path, kind: Kind) -> Result<Vec<u8>> {
    rest(open(path)?, Vec::new(), kind)
}

/// Reads all of an ordinary file as text.
///
/// # Errors
///
/// Fails under the same conditions as [`bytes`], and if the text is not UTF-8.
pub fn text(path: &Path, kind: Kind) -> Result<String> {
    utf8(bytes(path, kind)?)
}

/// Returns a file's bytes as text.
///
/// # Errors
///
/// Fails if the bytes are not UTF-8.
pub fn utf8(bytes: Vec<u8>) -> Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + valid.iter().filter(|&&byte| byte == b'\n').count();
        Error::new(ErrorKind::InvalidData, NotUtf8 { line })
    })
}

/// The error of a text that is not UTF-8.
#[derive(Debug, thiserror::Error)]
#[error("line {line} is not UTF-8 text")]
pub struct NotUtf8 {
    /// The number, counted from 1, of the first line that is not UTF-8.
    pub line: usize,
}

impl NotUtf8 {
    /// Returns the number of the first line that is not UTF-8, if such a line caused `error`.
    pub fn line_of(error: &Error) -> Option<usize> {
        error.get_ref()?.downcast_ref::<Self>().map(|error| error.line)
    }
}

/// The error of a packed (compressed) file that is cut off or damaged.
#[derive(Debug, thiserror::Error)]
#[error("it cannot be unpacked ({0})")]
pub struct Damaged(Error);

impl Damaged {
    /// Returns true if a damaged packed file caused `error`.
    pub fn caused(error: &Error) -> bool {
        error.get_ref().is_some_and(|inner| inner.is::<Self>())
    }

    /// Returns `error`, marked as caused by a damaged packed file. Returns `error` unchanged if it comes from
    /// the operating system or means that memory ran out.
    pub fn mark(error: Error) -> Error {
        if error.raw_os_error().is_some() || error.kind() == ErrorKind::OutOfMemory {
            return error;
        }
        Error::new(ErrorKind::InvalidData, Self(error))
    }
}

/// Reads the rest of a file whose first bytes, `head`, have already been read, and returns all of its bytes.
/// Reads at most one byte more than the limit of `kind` allows. If `kind` has no limit, reads no more bytes than the
/// file's size, as the file system reports it.
///
/// # Errors
///
/// Returns the system's error. Also fails if the file is larger than the limit of `kind`.
pub fn rest(file: File, head: Vec<u8>, kind: Kind) -> Result<Vec<u8>> {
    let length = file.metadata()?.len();
    let Some((limit, too_large)) = limit_of(kind) else { return read_on(file, head, length) };
    if length > limit {
        return Err(too_large);
    }
    // Files in /proc report a length of 0, and other files may grow while they are read. The number of bytes
    // that were read is therefore checked too, not only the reported length.
    within(read_on(file, head, limit + 1)?, kind)
}

/// Returns `bytes`, unless their number is above the limit of `kind`. The bytes are already in memory, such
/// as those of standard input or of an unpacked file.
///
/// # Errors
///
/// Fails if there are more bytes than the limit.
pub fn within(bytes: Vec<u8>, kind: Kind) -> Result<Vec<u8>> {
    match limit_of(kind) {
        Some((limit, too_large)) if bytes.len() as u64 > limit => Err(too_large),
        _ => Ok(bytes),
    }
}

/// Returns the largest number of bytes that a file of this kind may have, and the error for a larger file; `None`
/// if this module does not limit the size.
fn limit_of(kind: Kind) -> Option<(u64, Error)> {
    let (_, what, limit_mib) = LIMITS_MIB.iter().find(|(known, ..)| *known == kind)?;
    let limit_mib = (*limit_mib)?;
    let too_large = format!("{what} may have at most {limit_mib} MiB");
    Some((limit_mib << 20, Error::new(ErrorKind::FileTooLarge, too_large)))
}

/// Returns `head` and the bytes that follow it, up to `length` bytes in all.
fn read_on(file: File, head: Vec<u8>, length: u64) -> Result<Vec<u8>> {
    let size = file.metadata()?.len().min(length) as usize;
    let mut bytes = if size > PIECE_BYTES { read_pieces(&file, &head, size)? } else { head };
    let left = length.saturating_sub(bytes.len() as u64);
    bytes.reserve_exact(size.saturating_sub(bytes.len()));
    file.take(left).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Returns `head` and the bytes that follow it, `size` bytes in all. All threads read pieces of the file,
/// since a single thread would take long to copy a large file from the system's cache.
#[cfg(unix)]
fn read_pieces(mut file: &File, head: &[u8], size: usize) -> Result<Vec<u8>> {
    use std::io::{Seek as _, SeekFrom};
    use std::os::unix::fs::FileExt as _;
    let start = head.len() as u64;
    let mut bytes = vec![0; size];
    let (begin, rest) = bytes.split_at_mut(head.len());
    begin.copy_from_slice(head);
    let pieces = rest.par_chunks_mut(PIECE_BYTES).enumerate();
    pieces.try_for_each(|(index, piece)| file.read_exact_at(piece, start + (index * PIECE_BYTES) as u64))?;
    file.seek(SeekFrom::Start(size as u64))?;
    Ok(bytes)
}

#[cfg(not(unix))]
fn read_pieces(_file: &File, head: &[u8], _size: usize) -> Result<Vec<u8>> {
    Ok(head.to_vec())
}

/// Returns the folder of a file: `.` if the path is only a name.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Returns true if a path can only mean a folder, such as `a/`, `a/.` or `..`.
pub fn names_a_folder(path: &Path) -> bool {
    let text = path.as_os_str().as_encoded_bytes();
    path.file_name().is_none_or(|name| !text.ends_with(name.as_encoded_bytes()))
}

/// Returns a file's path with its folder made canonical (absolute, without links and `..`); `None` if the folder does
/// not exist, or if the path ends in no file's name, such as `..`. The file itself need not exist.
pub fn in_canonical_folder(path: &Path) -> Option<PathBuf> {
    Some(folder_of(path).canonicalize().ok()?.join(path.file_name()?))
}

/// Returns an error if this process may not create files in a folder, or may not read and write a file. Nothing is
/// opened, because opening a device's file could start the device.
#[cfg(unix)]
pub fn may_write(path: &Path) -> Result<()> {
    use rustix::fs::{Access, access};
    let also = if path.is_dir() { Access::EXEC_OK } else { Access::READ_OK };
    access(path, Access::WRITE_OK | also).map_err(Error::from)
}

#[cfg(not(unix))]
pub fn may_write(_path: &Path) -> Result<()> {
    Ok(())
}

/// Returns true if a file lies in a folder or its subfolders, after following links. Messages must not show
/// the text of a file that a scene names and that lies outside the scene's folder.
pub fn lies_in(path: &Path, folder: &Path) -> bool {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    matches!((path.canonicalize(), folder.canonicalize()), (Ok(path), Ok(folder)) if path.starts_with(&folder))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn the_limits_are_those_of_the_documents() {
        let limits = LIMITS_MIB.map(|(kind, _, limit_mib)| (kind, limit_mib));
        let expected = [
            (Kind::Toml, Some(16)),
            (Kind::Materials, Some(16)),
            (Kind::Texture, Some(256)),
            (Kind::Peaks, Some(16)),
            (Kind::Kernel, Some(1)),
            (Kind::Mesh, None),
            (Kind::Picture, None),
            (Kind::Results, Some(64)),
            (Kind::Plan, None),
            (Kind::Shown, Some(64)),
        ];
        assert_eq!(limits, expected);
    }

    #[test]
    fn every_limit_is_enforced_and_stated() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        for (kind, what, limit_mib) in LIMITS_MIB {
            let bytes_of = |length: u64| {
                File::create(&path).unwrap().set_len(length).unwrap();
                bytes(&path, kind).map(|bytes| bytes.len() as u64)
            };
            // Packed files and standard input are already in memory when their length is checked.
            let held = |length: u64| within(vec![0; length as usize], kind).map(|bytes| bytes.len() as u64);
            let limit = limit_mib.unwrap_or(20) << 20;
            assert_eq!([bytes_of(limit).unwrap(), held(limit).unwrap()], [limit; 2], "{what}");
            for length in [bytes_of(limit + 1), held(limit + 1)] {
                match (limit_mib, length) {
                    (Some(mib), Err(error)) => {
                        assert_eq!(error.to_string(), format!("{what} may have at most {mib} MiB"));
                    }
                    (None, Ok(length)) => assert_eq!(length, limit + 1, "{what}"),
                    (_, other) => panic!("{what}: {other:?}"),
                }
            }
        }
    }

    #[test]
    fn large_files_are_read_whole_and_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let written: Vec<u8> =
            (0..5 * PIECE_BYTES as u32 / 8).flat_map(|number| number.to_le_bytes()).collect();
        std::fs::write(&path, &written).unwrap();
        assert!(bytes(&path, Kind::Mesh).unwrap() == written);
        let mut file = open(&path).unwrap();
        let mut head = vec![0; 100];
        file.read_exact(&mut head).unwrap();
        assert!(rest(file, head, Kind::Results).unwrap() == written);
    }

    #[test]
    fn a_path_that_ends_without_a_files_name_means_a_folder() {
        for path in ["a.png/", "b/a.png/.", ".", "..", "a/..", "/", "./"] {
            assert!(names_a_folder(Path::new(path)), "{path}");
        }
        for path in ["a.png", "b/a.png", "./a", "/a", "..a", "-"] {
            assert!(!names_a_folder(Path::new(path)), "{path}");
        }
    }

    #[test]
    fn what_was_read_before_counts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, "abcdef").unwrap();
        for kind in [Kind::Toml, Kind::Mesh] {
            let mut file = open(&path).unwrap();
            let mut head = vec![0; 4];
            file.read_exact(&mut head).unwrap();
            assert_eq!(rest(file, head, kind).unwrap(), b"abcdef");
        }
    }

    #[test]
    fn only_errors_of_the_packed_bytes_themselves_count_as_damage() {
        let is_damage = |error: Error| Damaged::caused(&Damaged::mark(error));
        assert!(is_damage(Error::new(ErrorKind::UnexpectedEof, "it ends")));
        assert!(!is_damage(Error::new(ErrorKind::OutOfMemory, "it is large")));
        // 5 is the system's number for a disk error (EIO), which is not damage of the packed file.
        assert!(!is_damage(Error::from_raw_os_error(5)));
    }

    #[test]
    #[cfg(unix)]
    fn devices_pipes_and_folders_are_refused_without_waiting() {
        use rustix::fs::{CWD, FileType, Mode, mknodat};
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        mknodat(CWD, &pipe, FileType::Fifo, Mode::RWXU, 0).unwrap();
        for path in [&pipe, Path::new("/dev/zero"), Path::new("/dev/null")] {
            assert!(
                open(path).unwrap_err().to_string().contains("expected an ordinary file"),
                "{}",
                path.display()
            );
        }
        assert!(open(folder.path()).unwrap_err().to_string().contains("folder"));
    }

    #[test]
    #[cfg(unix)]
    fn a_link_that_leads_out_of_a_folder_lies_outside() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("inner");
        std::fs::create_dir(&inner).unwrap();
        let [outside, inside, link] = [folder.path().join("a"), inner.join("a"), inner.join("b")];
        std::fs::write(&outside, "").unwrap();
        std::fs::write(&inside, "").unwrap();
        std::os::unix::fs::symlink(&outside, &link).unwrap();
        assert!(lies_in(&inside, &inner) && lies_in(&inside, folder.path()));
        assert!(!lies_in(&outside, &inner) && !lies_in(&link, &inner) && !lies_in(&inner.join("c"), &inner));
    }
}
