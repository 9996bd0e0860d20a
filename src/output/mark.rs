//! The mark by which raycl recognises its own files: a BLAKE3 hash of the file, as hexadecimal digits near
//! the beginning. The hash covers the whole file except the hash's digits and, in a PNG, the checksum of the
//! chunk that contains these digits. A mark is only valid if the mark's hash matches the file.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result, Seek as _, SeekFrom, Write};
use std::ops::Range;

/// The text before the digits of the hash in a mark, by which raycl recognises its own files.
const LABEL: &str = "made by raycl, blake3 of the rest: ";
/// The text before the key that identifies a frame of an animation or a turntable. The frame's key is a hash
/// of what determines the picture.
const KEY_LABEL: &str = "frame of raycl: ";
/// Number of hexadecimal digits of a hash.
const DIGITS: usize = 64;
/// The mark lies within the first `HEAD_BYTES` bytes of a file.
const HEAD_BYTES: u64 = 4096;
/// Offset in bytes of a PNG's second chunk, after the signature and the first chunk (IHDR). raycl's mark is
/// in the second chunk of the PNG.
const PNG_CHUNK: usize = 33;
const PNG_SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Whether raycl made a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Maker {
    /// raycl made the file, and nobody has changed the file since.
    Raycl,
    /// The file has a mark, or the list in the file's folder contains the file's name, but the hash does not match the
    /// file: somebody has probably changed the file since raycl made it.
    Changed,
    /// Neither a mark nor the list in the file's folder shows that raycl made the file.
    Other,
}

/// Returns a blank mark, which has zeros in place of the hash. Once the blank mark is in a file, [`seal`]
/// replaces the zeros of the mark by the hash of the rest of the file.
pub fn blank() -> String {
    format!("{LABEL}{}", "0".repeat(DIGITS))
}

/// Returns a PNG chunk that contains a blank mark, and the offset at which the chunk is inserted into a PNG.
pub fn png() -> (usize, Vec<u8>) {
    let text = [b"Comment\0", blank().as_bytes()].concat();
    let length = (text.len() as u32).to_be_bytes();
    (PNG_CHUNK, [&length[..], b"tEXt", &text, &[0; 4]].concat())
}

/// Returns [`png()`]'s offset and chunk, followed by a chunk with the frame's key.
pub fn keyed_png(key: &str) -> (usize, Vec<u8>) {
    let (position, chunk) = png();
    let text = [b"tEXtComment\0".as_slice(), KEY_LABEL.as_bytes(), key.as_bytes()].concat();
    let length = (text.len() as u32 - 4).to_be_bytes();
    let checksum = crc32fast::hash(&text).to_be_bytes();
    (position, [&chunk[..], &length, &text, &checksum].concat())
}

/// Returns the key of the frame in a file; `None` if raycl did not make the file as a frame, or if somebody
/// changed the file.
pub fn key(file: &mut File) -> Option<String> {
    let mark = MarkInFile::read(file).ok()??;
    let unchanged = mark.head[mark.hole.clone()] == mark.filled;
    let start = mark.head.windows(KEY_LABEL.len()).position(|bytes| bytes == KEY_LABEL.as_bytes())?;
    let key = mark.head.get(start + KEY_LABEL.len()..)?.get(..DIGITS)?;
    unchanged.then(|| String::from_utf8_lossy(key).into_owned())
}

/// Returns the JSON text with a blank mark (with zeros in place of the hash) as the first field of its first
/// object.
pub fn json(text: &str) -> String {
    text.replacen('{', &format!("{{\n\"mark\": \"{}\",", blank()), 1)
}

/// Replaces the zeros in a file's blank mark by the hash of the rest of the file. In a PNG, also sets the
/// checksum of the chunk that contains the mark.
pub fn seal(file: &mut File) -> Result<()> {
    let mark = MarkInFile::read(file)?.ok_or_else(|| Error::new(ErrorKind::InvalidData, "it has no mark"))?;
    file.seek(SeekFrom::Start(mark.hole.start as u64))?;
    file.write_all(&mark.filled)
}

/// Finds out, from the mark in a file, whether raycl made the file and whether the file is unchanged.
pub fn maker(file: &mut File) -> Result<Maker> {
    Ok(match MarkInFile::read(file)? {
        None => Maker::Other,
        Some(mark) if mark.head[mark.hole.clone()] == mark.filled => Maker::Raycl,
        Some(_) => Maker::Changed,
    })
}

/// The mark in a file: the file's first bytes (`head`), the range of these bytes that the hash excludes
/// (`hole`), and the bytes that an unchanged file has in this range (`filled`).
struct MarkInFile {
    head: Vec<u8>,
    hole: Range<usize>,
    filled: Vec<u8>,
}

impl MarkInFile {
    fn read(file: &mut File) -> Result<Option<Self>> {
        file.rewind()?;
        let mut head = Vec::new();
        (&mut *file).take(HEAD_BYTES).read_to_end(&mut head)?;
        let Some(hole) = hole(&head) else { return Ok(None) };
        let mut hasher = blake3::Hasher::new();
        hasher.update(&head[..hole.start]).update(&head[hole.end..]).update_reader(file)?;
        let filled = filled(&head, &hole, &hasher.finalize());
        Ok(Some(Self { head, hole, filled }))
    }
}

/// Returns the range of bytes that is excluded from the hash: the hash's digits and, in a PNG, the checksum
/// of the chunk that contains them. Returns `None` if the file has no mark.
fn hole(head: &[u8]) -> Option<Range<usize>> {
    let label = head.windows(LABEL.len()).position(|bytes| bytes == LABEL.as_bytes())?;
    let start = label + LABEL.len();
    let end = start + DIGITS + if head.starts_with(PNG_SIGNATURE) { 4 } else { 0 };
    (end <= head.len()).then_some(start..end)
}

/// Returns the bytes that replace the zeros in the range `hole`: the hash's digits and, in a PNG, the chunk's
/// checksum.
fn filled(head: &[u8], hole: &Range<usize>, hash: &blake3::Hash) -> Vec<u8> {
    let mut bytes = hash.to_hex().as_bytes().to_vec();
    // A PNG's checksum covers the chunk's type and contents.
    let chunk = head.get(PNG_CHUNK + 4..hole.start).filter(|_| head.starts_with(PNG_SIGNATURE));
    if let Some(chunk) = chunk {
        let mut checksum = crc32fast::Hasher::new();
        checksum.update(chunk);
        checksum.update(&bytes);
        bytes.extend(checksum.finalize().to_be_bytes());
    }
    bytes
}

/// Passes bytes on to the writer `inner`, and inserts `piece` after the next `left` bytes.
pub struct Insert<W> {
    inner: W,
    left: usize,
    piece: Vec<u8>,
}

impl<W: Write> Insert<W> {
    /// Makes a writer that inserts `piece` at the offset `at`.
    pub fn new(inner: W, (at, piece): (usize, Vec<u8>)) -> Self {
        Self { inner, left: at, piece }
    }
}

impl<W: Write> Write for Insert<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        if self.left == 0 {
            return self.inner.write(bytes);
        }
        let written = self.inner.write(&bytes[..bytes.len().min(self.left)])?;
        self.left -= written;
        if self.left == 0 {
            self.inner.write_all(&self.piece)?;
        }
        Ok(written)
    }

    fn flush(&mut self) -> Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn file(bytes: &[u8]) -> File {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        file
    }

    fn bytes(file: &mut File) -> Vec<u8> {
        let mut bytes = Vec::new();
        file.rewind().unwrap();
        file.read_to_end(&mut bytes).unwrap();
        bytes
    }

    fn sealed(text: &str) -> Vec<u8> {
        let mut file = file(text.as_bytes());
        seal(&mut file).unwrap();
        bytes(&mut file)
    }

    #[test]
    fn a_sealed_file_is_known_and_every_changed_byte_noticed() {
        let sealed = sealed(&format!("before {} after", blank()));
        assert_eq!(maker(&mut file(&sealed)).unwrap(), Maker::Raycl);
        for index in 0..sealed.len() {
            let mut changed = sealed.clone();
            changed[index] ^= 1;
            assert_ne!(maker(&mut file(&changed)).unwrap(), Maker::Raycl, "byte {index}");
        }
        assert_eq!(maker(&mut file(&[&sealed[..], b"."].concat())).unwrap(), Maker::Changed);
        assert_eq!(maker(&mut file(&sealed[..sealed.len() - 1])).unwrap(), Maker::Changed);
    }

    #[test]
    fn a_mark_on_other_bytes_proves_nothing() {
        let one = String::from_utf8(sealed(&format!("{} one", blank()))).unwrap();
        let other = one.replace("one", "two");
        assert_eq!(maker(&mut file(other.as_bytes())).unwrap(), Maker::Changed);
    }

    #[test]
    fn files_without_a_whole_mark_are_others() {
        for bytes in [&b""[..], b"text", LABEL.as_bytes(), &[0; 10_000], PNG_SIGNATURE] {
            assert_eq!(maker(&mut file(bytes)).unwrap(), Maker::Other);
            assert!(seal(&mut file(bytes)).is_err());
        }
    }

    #[test]
    fn a_key_is_read_until_the_file_is_changed() {
        let key_of = |bytes: &[u8]| key(&mut file(bytes));
        let wanted = "5".repeat(DIGITS);
        let mut whole = PNG_SIGNATURE.to_vec();
        whole.resize(PNG_CHUNK, 0);
        whole.extend(keyed_png(&wanted).1);
        let mut sealed = file(&whole);
        seal(&mut sealed).unwrap();
        let mut sealed = bytes(&mut sealed);
        assert_eq!(key_of(&sealed), Some(wanted));
        *sealed.last_mut().unwrap() ^= 1;
        assert_eq!(key_of(&sealed), None);
    }

    #[test]
    fn json_stays_json() {
        let text = json("[\n  {\n    \"a\": 1\n  },\n  {}\n]");
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!((value[0]["a"].as_u64(), value[0]["mark"].as_str()), (Some(1), Some(blank().as_str())));
        assert_eq!(value[1], serde_json::json!({}));
    }

    #[test]
    fn a_piece_goes_where_it_belongs_however_bytes_come() {
        for step in 1..=6 {
            let mut out = Vec::new();
            let mut writer = Insert::new(&mut out, (4, b"--".to_vec()));
            b"abcdef".chunks(step).for_each(|bytes| writer.write_all(bytes).unwrap());
            assert_eq!(out, b"abcd--ef");
        }
    }

    /// The checksum of the chunk must be right, since other programs refuse a chunk with a wrong checksum.
    #[test]
    fn the_checksum_of_a_sealed_pngs_mark_is_right() {
        let mut whole = PNG_SIGNATURE.to_vec();
        whole.resize(PNG_CHUNK, 0);
        whole.extend(png().1);
        let mut sealed = file(&whole);
        seal(&mut sealed).unwrap();
        let sealed = bytes(&mut sealed);
        let (chunk, checksum) = sealed[PNG_CHUNK + 4..].split_at(sealed.len() - PNG_CHUNK - 8);
        assert!(chunk.starts_with(b"tEXtComment\0made by raycl"));
        assert_eq!(checksum, crc32fast::hash(chunk).to_be_bytes());
    }

    /// A program that reads PNGs skips chunks that it does not know. To find the next chunk, the program
    /// needs the right length in each chunk.
    #[test]
    fn the_chunks_of_a_frames_mark_and_key_have_right_lengths() {
        let key = "5".repeat(DIGITS);
        let (position, mut rest) = keyed_png(&key);
        assert_eq!(position, PNG_CHUNK);
        let mut texts = Vec::new();
        while !rest.is_empty() {
            let length = u32::from_be_bytes(rest[..4].try_into().unwrap()) as usize;
            texts.push(String::from_utf8(rest[4..8 + length].to_vec()).unwrap());
            rest = rest.split_off(12 + length);
        }
        let [mark, key] =
            [blank(), format!("frame of raycl: {key}")].map(|text| format!("tEXtComment\0{text}"));
        assert_eq!(texts, [mark, key]);
    }
}
