//! A file that was opened, and whose type was recognised. A packed file (gzip) is unpacked.

use super::{FileType, Foreign, JSON, MeshFormat, UNKNOWN, stl};
use crate::memory::Available;
use crate::reader::{self, Kind};
use flate2::read::MultiGzDecoder;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Number of bytes that are read to recognise a file.
const HEAD_BYTES: usize = 1 << 16;
/// The first bytes of a gzip file.
const GZIP: &[u8] = b"\x1f\x8b";
/// The path that means standard input.
pub const STANDARD_INPUT: &str = "-";

/// An open file. A packed file (gzip) or standard input has been read completely. Of any other file, only the first
/// bytes have been read.
#[derive(Debug)]
pub struct Opened {
    /// The file, whose bytes after `head` have not been read yet; `None` if `head` contains all bytes.
    rest: Option<File>,
    /// The bytes that have been read, unpacked.
    head: Vec<u8>,
    /// Length in bytes, after unpacking.
    pub length: u64,
    /// The type of the file.
    pub filetype: FileType,
}

impl Opened {
    /// Opens an ordinary file, or standard input for `-`, and recognises its type.
    ///
    /// # Errors
    ///
    /// Returns the system's error. Also fails if `path` is not an ordinary file, if a packed file is damaged, or if a
    /// packed file or standard input has more bytes than half of the free memory.
    pub fn at(path: &Path) -> io::Result<Self> {
        if path.as_os_str() == STANDARD_INPUT {
            let head = within_memory(io::stdin().lock())?;
            return if head.starts_with(GZIP) {
                unpacked(&head[..], path)
            } else {
                Ok(Self::held(head, path))
            };
        }
        let file = reader::open(path)?;
        let length = file.metadata()?.len();
        let mut head = Vec::new();
        (&file).take(HEAD_BYTES as u64).read_to_end(&mut head)?;
        if head.starts_with(GZIP) {
            return unpacked(head.chain(file), path);
        }
        let filetype = recognised(&head, length, path);
        Ok(Self { rest: Some(file), head, length, filetype })
    }

    /// Recognises a file whose bytes have all been read already.
    fn held(bytes: Vec<u8>, path: &Path) -> Self {
        let length = bytes.len() as u64;
        let filetype = recognised(&bytes[..bytes.len().min(HEAD_BYTES)], length, path);
        Self { rest: None, head: bytes, length, filetype }
    }

    /// Reads the whole file, up to the limit of its kind.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`reader::rest`].
    pub fn bytes(self, kind: Kind) -> io::Result<Vec<u8>> {
        match self.rest {
            Some(file) => reader::rest(file, self.head, kind),
            None => reader::within(self.head, kind),
        }
    }

    /// Reads the whole file as text.
    ///
    /// # Errors
    ///
    /// Returns the system's error. Also fails if the file is too large or not UTF-8.
    pub fn text(self, kind: Kind) -> io::Result<String> {
        reader::utf8(self.bytes(kind)?)
    }
}

/// The error of a packed file that is cut off or damaged.
#[derive(Debug, thiserror::Error)]
#[error("it cannot be unpacked ({0})")]
pub struct Damaged(io::Error);

impl Damaged {
    /// Returns whether a damaged packed file caused an error.
    pub fn caused(error: &io::Error) -> bool {
        error.get_ref().is_some_and(|inner| inner.is::<Self>())
    }

    /// Marks an error as caused by a damaged packed file, unless the error comes from the operating system or means
    /// that memory ran out.
    fn mark(error: io::Error) -> io::Error {
        if error.raw_os_error().is_some() || error.kind() == io::ErrorKind::OutOfMemory {
            return error;
        }
        io::Error::new(io::ErrorKind::InvalidData, Self(error))
    }
}

fn unpacked(packed: impl Read, path: &Path) -> io::Result<Opened> {
    let bytes = within_memory(MultiGzDecoder::new(packed)).map_err(Damaged::mark)?;
    Ok(Opened::held(bytes, path))
}

/// Returns a file's type. A complete binary STL file is recognised by its length, which matches its count of triangles.
/// A binary file that matches no known type is STL if its name ends in `.stl`, or if it begins with triangles and is
/// cut off; the STL reader then reports the error. A JSON file whose name ends in `.gltf` is glTF, even without a key
/// of glTF in the bytes that were read, if more bytes follow: they may contain the keys.
fn recognised(head: &[u8], length: u64, path: &Path) -> FileType {
    let of_contents = FileType::of(head, length);
    let FileType::Foreign(Foreign { name, .. }) = of_contents else { return of_contents };
    let has_more = length > head.len() as u64;
    match MeshFormat::from_ending(path) {
        Some(MeshFormat::Stl) if name == UNKNOWN => FileType::Mesh(MeshFormat::Stl),
        Some(MeshFormat::Gltf) if name == JSON && has_more => FileType::Mesh(MeshFormat::Gltf),
        _ if name == UNKNOWN && stl::is_cut_off(head, length) => FileType::Mesh(MeshFormat::Stl),
        _ => of_contents,
    }
}

/// Reads all of a stream of unknown length, up to half of the free memory.
fn within_memory(stream: impl Read) -> io::Result<Vec<u8>> {
    let most = Available::read().bytes / 2;
    let mut bytes = Vec::new();
    stream.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        let message = format!("it has more than {most} bytes, half of the memory that raycl may still use");
        return Err(io::Error::new(io::ErrorKind::OutOfMemory, message));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_is_gltf_by_its_name_if_the_keys_of_gltf_may_follow() {
        let nodes = r#"{"nodes":[{}"#.to_owned() + &",{}".repeat(HEAD_BYTES);
        let whole = nodes + r#"],"asset":{"version":"2.0"}}"#;
        let of = |text: &str, name: &str| Opened::held(text.into(), Path::new(name)).filetype;
        let json = FileType::Foreign(Foreign { name: JSON, remedy: "" });
        assert_eq!(of(&whole, "a.gltf"), FileType::Mesh(MeshFormat::Gltf));
        assert_eq!(of(&whole, "A.GLTF"), FileType::Mesh(MeshFormat::Gltf));
        assert_eq!(of(&whole, "a.json"), json);
        assert_eq!(of(r#"{"nodes":[]}"#, "a.gltf"), json);
    }

    /// When a file is opened, only its first bytes are read; this test checks that `bytes` returns the others too.
    #[test]
    fn all_bytes_of_a_long_file_are_returned_whether_or_not_it_is_packed() {
        let folder = tempfile::tempdir().unwrap();
        let bytes: Vec<u8> = (0..HEAD_BYTES + 999).map(|number| (number % 251) as u8).collect();
        let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut packer, &bytes).unwrap();
        for (name, contents) in [("plain", bytes.clone()), ("packed.gz", packer.finish().unwrap())] {
            let path = folder.path().join(name);
            std::fs::write(&path, contents).unwrap();
            let opened = Opened::at(&path).unwrap();
            assert_eq!(opened.length, bytes.len() as u64, "{name}");
            assert!(opened.bytes(Kind::Mesh).unwrap() == bytes, "{name}");
        }
    }

    #[test]
    fn only_errors_of_the_packed_bytes_themselves_count_as_damage() {
        let is_damage = |error: io::Error| Damaged::caused(&Damaged::mark(error));
        assert!(is_damage(io::Error::new(io::ErrorKind::UnexpectedEof, "it ends")));
        assert!(!is_damage(io::Error::new(io::ErrorKind::OutOfMemory, "it is large")));
        // 5 is the system's number for a disk error (EIO), which is not damage of the packed file.
        assert!(!is_damage(io::Error::from_raw_os_error(5)));
    }
}
