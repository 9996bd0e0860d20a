//! A file that was opened, and whose type was recognised. A packed file (gzip) is unpacked.

use super::{FileType, Foreign, JSON, MeshFormat, UNKNOWN, endings, is_toml, signatures, stl, text};
use crate::memory::Available;
use crate::reader::{self, Damaged, Kind, is_standard_input};
use crate::words::counted;
use flate2::bufread::GzDecoder;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

/// Number of bytes that are read to recognise a file.
const HEAD_BYTES: usize = 1 << 16;
/// The first bytes of a gzip file.
const GZIP: &[u8] = b"\x1f\x8b";

/// Reads all of standard input.
///
/// # Errors
///
/// Fails if standard input cannot be read, or is larger than half of the free memory.
pub fn standard_input() -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    within_memory(io::stdin().lock(), half_of_memory(), &mut bytes)?;
    Ok(bytes)
}

/// An open file. A packed file (gzip) or standard input has been read completely. If a file is neither packed
/// nor standard input, only its first bytes have been read.
#[derive(Debug)]
pub struct Opened {
    /// The file, whose bytes after `head` have not been read yet; `None` for a packed file and for standard input,
    /// whose bytes are all in `head`.
    rest: Option<File>,
    /// The bytes that have been read, unpacked.
    head: Vec<u8>,
    /// The file's length in bytes; for a packed file, the length of the unpacked bytes.
    pub length: u64,
    /// The type of the file.
    pub filetype: FileType,
}

impl Opened {
    /// Opens an ordinary file, or standard input for `-`, and recognises its type.
    ///
    /// # Errors
    ///
    /// Fails if the system cannot open or read the file, if `path` is not an ordinary file, or if a packed
    /// file is damaged. Also fails if standard input, or a packed file after unpacking, is larger than half
    /// of the free memory.
    pub fn at(path: &Path) -> io::Result<Self> {
        if is_standard_input(path) {
            let head = standard_input()?;
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

    /// Reads the whole file. The number of bytes that may be read depends on `kind`, the file's purpose.
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
    /// Fails if the system cannot read the file, if the file is larger than the limit for `kind`, or if the
    /// file's text is not UTF-8.
    pub fn text(self, kind: Kind) -> io::Result<String> {
        reader::utf8(self.bytes(kind)?)
    }
}

/// Unpacks a file of one or more members, each of which gzip has packed separately.
fn unpacked(packed: impl Read, path: &Path) -> io::Result<Opened> {
    let (mut packed, mut bytes, most) = (BufReader::new(packed), Vec::new(), half_of_memory());
    while packed.fill_buf()?.first() == GZIP.first() {
        within_memory(GzDecoder::new(&mut packed), most, &mut bytes).map_err(Damaged::mark)?;
    }
    check_rest(packed).map_err(Damaged::mark)?;
    Ok(Opened::held(bytes, path))
}

/// Refuses bytes after the last member, unless all of them are zeros: some programs fill the last block of a file with
/// zeros.
fn check_rest(rest: impl BufRead) -> io::Result<()> {
    let (mut count, mut is_padding) = (0, true);
    for byte in rest.bytes() {
        count += 1;
        is_padding &= byte? == 0;
    }
    if is_padding {
        return Ok(());
    }
    let message =
        format!("{}; expected none, or only zeros", counted(count, "byte after the compressed data"));
    Err(io::Error::new(io::ErrorKind::InvalidData, message))
}

/// Returns a file's type. A complete binary STL file is recognised by its length, which matches the count of
/// triangles in its header. A binary file that matches no known type is STL if its name ends in `.stl`, or if
/// the file begins with triangles and is cut off. The STL reader then reports the error. A JSON file without
/// keys of glTF in `head` is glTF if its name ends in `.gltf` and more bytes follow, since the later bytes
/// may contain the keys. JSON without keys of glTF in a file whose name ends in `.toml` counts as unclear: the
/// reader of TOML then reports the mistake. If the contents do not show the format, the file's extension may name a
/// format that raycl does not read. A text that matches no known type may also be recognised as a list of numbers,
/// such as the coordinates of points.
fn recognised(head: &[u8], length: u64, path: &Path) -> FileType {
    let of_contents = FileType::of(head, length);
    if of_contents == FileType::Unclear {
        return foreign_text(head, path).map_or(FileType::Unclear, FileType::Foreign);
    }
    let FileType::Foreign(Foreign { name, remedy }) = of_contents else { return of_contents };
    let has_more = length > head.len() as u64;
    // The files of some formats are archives or packed: for example, a newer Blender file may be a zstd
    // archive.
    let is_vague = name == UNKNOWN || remedy == signatures::UNPACK;
    if let Some(foreign) = endings::foreign(path).filter(|_| is_vague) {
        return FileType::Foreign(foreign);
    }
    match MeshFormat::from_ending(path) {
        Some(MeshFormat::Stl) if name == UNKNOWN => FileType::Mesh(MeshFormat::Stl),
        Some(MeshFormat::Gltf) if name == JSON && has_more => FileType::Mesh(MeshFormat::Gltf),
        // TOML whose first line lacks its last bracket, such as `[camera`, looks like JSON.
        None if name == JSON && is_toml(path) => FileType::Unclear,
        _ if name == UNKNOWN && stl::is_cut_off(head, length) => FileType::Mesh(MeshFormat::Stl),
        _ => of_contents,
    }
}

/// Returns the format of a text that matches no known type; `None` if the file is empty, if its extension stands for a
/// mesh format that raycl reads, or if neither its first lines nor its extension show the format.
fn foreign_text(head: &[u8], path: &Path) -> Option<Foreign> {
    if head.trim_ascii().is_empty() || MeshFormat::from_ending(path).is_some() {
        return None;
    }
    let points =
        Foreign { name: "a list of numbers, such as points without triangles", remedy: signatures::POINTS };
    endings::foreign(path).or_else(|| text::is_list_of_numbers(head).then_some(points))
}

/// Returns half of the free memory, in bytes.
fn half_of_memory() -> u64 {
    Available::read().bytes / 2
}

/// Appends a stream of unknown length to `bytes`. Returns an error if `bytes` has more than `most` bytes
/// after the stream was appended.
fn within_memory(stream: impl Read, most: u64, bytes: &mut Vec<u8>) -> io::Result<()> {
    let left = most.saturating_sub(bytes.len() as u64);
    stream.take(left.saturating_add(1)).read_to_end(bytes)?;
    if bytes.len() as u64 > most {
        let message = format!("it has more than {most} bytes, half of the memory that raycl may still use");
        return Err(io::Error::new(io::ErrorKind::OutOfMemory, message));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::GzEncoder;
    use std::io::Write as _;

    fn packed(bytes: &[u8]) -> Vec<u8> {
        let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
        packer.write_all(bytes).unwrap();
        packer.finish().unwrap()
    }

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
        assert_eq!(of("[camera\n", "a.toml"), FileType::Unclear);
        assert_eq!(of("[1, 2]", "a"), json);
    }

    /// When a file that is not packed is opened, only its first bytes are read. This test checks that `bytes` also
    /// returns the bytes that were not read when the file was opened.
    #[test]
    fn all_bytes_of_a_long_file_are_returned_whether_or_not_it_is_packed() {
        let folder = tempfile::tempdir().unwrap();
        let bytes: Vec<u8> = (0..HEAD_BYTES + 999).map(|number| (number % 251) as u8).collect();
        for (name, contents) in [("plain", bytes.clone()), ("packed.gz", packed(&bytes))] {
            let path = folder.path().join(name);
            std::fs::write(&path, contents).unwrap();
            let opened = Opened::at(&path).unwrap();
            assert_eq!(opened.length, bytes.len() as u64, "{name}");
            assert!(opened.bytes(Kind::Mesh).unwrap() == bytes, "{name}");
        }
    }

    #[test]
    fn members_of_a_packed_file_are_joined_and_only_zeros_may_follow_them() {
        let of = |rest: &[u8]| {
            let members = [&packed(b"v 0 0 0\n")[..], &packed(b"v 1 0 0\n"), rest].concat();
            unpacked(&members[..], Path::new("a.obj.gz")).map(|opened| opened.bytes(Kind::Mesh).unwrap())
        };
        // The last number of zeros, 100,000, is larger than the reader's buffer.
        for rest in [0, 1, 64, 100_000] {
            assert_eq!(of(&vec![0; rest]).unwrap(), b"v 0 0 0\nv 1 0 0\n", "{rest}");
        }
        for (rest, count) in
            [(&b"\0\0x"[..], "3 bytes"), (b"x", "1 byte"), (b"x\0", "2 bytes"), (b"\0\x1f\x8b", "3 bytes")]
        {
            let error = of(rest).unwrap_err();
            let expected = format!(
                "it cannot be unpacked ({count} after the compressed data; expected none, or only zeros)"
            );
            assert_eq!((Damaged::caused(&error), error.to_string()), (true, expected));
        }
    }

    #[test]
    fn an_unpacked_file_has_the_limit_of_its_kind() {
        let of = |length: usize| Opened::held(vec![b' '; length], Path::new("a.cl")).bytes(Kind::Kernel);
        assert_eq!(of(1 << 20).unwrap().len(), 1 << 20);
        assert_eq!(of((1 << 20) + 1).unwrap_err().to_string(), "a kernel file may have at most 1 MiB");
    }
}
