//! Separates the parts of a glTF file: the JSON and, in a binary file (GLB), the bytes of the first buffer.

use super::left_out::{Counted, notes_on};
use super::{Named, Result};
use crate::error::Error;
use crate::words::counted;
use std::borrow::Cow;

/// The first bytes of a binary file.
const MAGIC: &[u8] = b"glTF";
/// Number of bytes before the first chunk: the bytes [`MAGIC`], the version, and the length of the file.
const HEADER_BYTES: usize = 12;
/// Number of bytes before a chunk's contents: their length and the chunk's type.
const CHUNK_HEADER_BYTES: usize = 8;

/// The JSON and, if the file is binary and has a chunk of the type `BIN`, the contents of the first such chunk.
pub(super) type Halves<'a> = (&'a [u8], Option<Cow<'a, [u8]>>);

/// Separates the JSON from the first chunk of the type `BIN`. Chunks of other types are skipped, as glTF 2.0, 4.4.3
/// requires. The length in the file's header is not used, because each chunk states its own length. Returns an error
/// if a chunk, up to the first one of the type `BIN`, does not end within the file.
pub(super) fn split<'a>(named: Named<'_>, bytes: &'a [u8]) -> Result<Halves<'a>> {
    if !bytes.starts_with(MAGIC) {
        return Ok((bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), None));
    }
    match number(bytes, MAGIC.len()) {
        Some(2) => {}
        Some(version) => return Err(other_version(named, version)),
        None => return Err(named.error("the header of this binary glTF file is cut off")),
    }
    let what = |what: String| named.error(what);
    let (json, rest) = chunk(bytes, HEADER_BYTES).map_err(what)?;
    if json.kind != b"JSON" {
        return Err(what("the first chunk of this binary glTF file is not JSON".to_owned()));
    }
    // glTF pads the JSON with blanks, but some programs write zero bytes.
    let padding = json.contents.iter().rev().take_while(|byte| **byte == 0).count();
    let text = &json.contents[..json.contents.len() - padding];
    Ok((text, buffer(bytes, rest).map_err(what)?.map(Cow::Borrowed)))
}

/// Returns notes on the parts of a binary file that are not used: a length in the header that differs from the file's
/// length, a damaged end, and surplus chunks. raycl uses the first chunk (the JSON) and the first chunk of the type
/// `BIN`; all other chunks are surplus.
pub(super) fn notes(bytes: &[u8]) -> impl Iterator<Item = String> + use<> {
    let surplus = if bytes.starts_with(MAGIC) { Surplus::of(bytes) } else { Surplus::default() };
    let Surplus { json, binary, others, damage } = surplus;
    let counts: [Counted; 3] = [
        (json, "further chunk of the type JSON", "ignored"),
        (binary, "further chunk of the type BIN", "ignored"),
        (others, "chunk of a type other than JSON and BIN", "ignored"),
    ];
    let damage = damage.map(|what| format!("the end of the file is ignored: {what}"));
    note_length(bytes).into_iter().chain(notes_on(counts)).chain(damage)
}

/// The numbers of chunks that are not used, and the mistake in the first chunk that is damaged.
#[derive(Default)]
struct Surplus {
    json: usize,
    binary: usize,
    others: usize,
    damage: Option<String>,
}

impl Surplus {
    fn of(bytes: &[u8]) -> Self {
        let (mut surplus, mut has_buffer, mut at) = (Self::default(), false, HEADER_BYTES);
        while bytes.len() >= at.saturating_add(CHUNK_HEADER_BYTES) {
            match chunk(bytes, at) {
                Ok((Chunk { kind, .. }, next)) => {
                    match kind {
                        b"JSON" => surplus.json += usize::from(at > HEADER_BYTES),
                        b"BIN\0" => surplus.binary += usize::from(std::mem::replace(&mut has_buffer, true)),
                        _ => surplus.others += 1,
                    }
                    at = next;
                }
                Err(what) => return Self { damage: Some(what), ..surplus },
            }
        }
        surplus
    }
}

/// Returns a note if the length in the header of a binary file is not the length of the file.
fn note_length(bytes: &[u8]) -> Option<String> {
    let stated = number(bytes, HEADER_BYTES - 4).filter(|_| bytes.starts_with(MAGIC))? as usize;
    (stated != bytes.len()).then(|| {
        let [stated, actual] = [stated, bytes.len()].map(|count| counted(count, "byte"));
        format!(
            "the file's header states {stated}, but the file has {actual}: the header's length is not used"
        )
    })
}

fn other_version(named: Named<'_>, version: u32) -> Error {
    named
        .error(format!("raycl does not read binary glTF of version {version}; expected version 2"))
        .with_help("export the file as glTF 2.0")
}

/// Returns the contents of the first chunk of the type `BIN` at or after the offset `at`, if there is one.
fn buffer(bytes: &[u8], mut at: usize) -> std::result::Result<Option<&[u8]>, String> {
    // If fewer bytes remain than a chunk's header has, these bytes are padding.
    while bytes.len() >= at.saturating_add(CHUNK_HEADER_BYTES) {
        let (current, next) = chunk(bytes, at)?;
        if current.kind == b"BIN\0" {
            return Ok(Some(current.contents));
        }
        at = next;
    }
    Ok(None)
}

struct Chunk<'a> {
    kind: &'a [u8],
    contents: &'a [u8],
}

/// Returns the chunk at the offset `at`, and the offset after this chunk.
fn chunk(bytes: &[u8], at: usize) -> std::result::Result<(Chunk<'_>, usize), String> {
    let cut = || format!("the file ends within the header of the chunk at byte {at}");
    let length = number(bytes, at).ok_or_else(cut)? as usize;
    let start = at + CHUNK_HEADER_BYTES;
    let kind = bytes.get(start - 4..start).ok_or_else(cut)?;
    let contents = start.checked_add(length).and_then(|end| bytes.get(start..end)).ok_or_else(|| {
        format!("the chunk at byte {at} has {length} bytes, of which the file holds {}", bytes.len() - start)
    })?;
    Ok((Chunk { kind, contents }, start + length))
}

fn number(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn split<'a>(name: &str, bytes: &'a [u8]) -> Result<Halves<'a>> {
        super::split(Named { name, quotes: true }, bytes)
    }

    /// Returns a binary file of version 2 with these chunks, and with `length` in its header.
    fn file(length: u32, chunks: &[(&[u8], &[u8])]) -> Vec<u8> {
        let mut bytes = [b"glTF\x02\0\0\0", &length.to_le_bytes()[..]].concat();
        for (kind, contents) in chunks {
            bytes.extend((contents.len() as u32).to_le_bytes());
            bytes.extend_from_slice(kind);
            bytes.extend_from_slice(contents);
        }
        bytes
    }

    #[test]
    fn unknown_chunks_are_skipped_and_the_headers_length_is_not_used() {
        let chunks: [(&[u8], &[u8]); 3] = [(b"JSON", b"{}  "), (b"ODD?", b"1234"), (b"BIN\0", b"abcd")];
        for length in [0, 12, 24, 1000] {
            let bytes = file(length, &chunks);
            let (json, buffer) = split("a", &bytes).unwrap();
            assert_eq!((json, buffer.as_deref()), (&b"{}  "[..], Some(&b"abcd"[..])), "{length}");
        }
        let padded = [&file(20, &chunks[..1])[..], b"\0\0\0"].concat();
        assert_eq!(split("a", &padded).unwrap().1, None);
    }

    #[test]
    fn zeros_after_the_json_are_padding() {
        let bytes = file(0, &[(b"JSON", b"{}\0\0"), (b"BIN\0", b"ab\0\0")]);
        let (json, buffer) = split("a", &bytes).unwrap();
        assert_eq!((json, buffer.as_deref()), (&b"{}"[..], Some(&b"ab\0\0"[..])));
    }

    #[test]
    fn a_length_in_the_header_that_is_not_the_files_is_noted() {
        let with = |length| note_length(&file(length, &[(b"JSON", b"{}  ")]));
        assert_eq!(with(24), None);
        let note =
            "the file's header states 1 byte, but the file has 24 bytes: the header's length is not used";
        assert_eq!(with(1), Some(note.to_owned()));
        let more = [&file(24, &[(b"JSON", b"{}  ")])[..], b"more"].concat();
        assert!(
            note_length(&more)
                .is_some_and(|note| note.contains("states 24 bytes, but the file has 28 bytes"))
        );
        assert_eq!([&b"glTF\x02\0\0\0"[..], b"{\"asset\": {}}"].map(note_length), [None, None]);
    }

    #[test]
    fn chunks_that_are_not_used_are_noted() {
        let noted = |chunks: &[(&[u8], &[u8])], end: &[u8]| {
            let length = file(0, chunks).len() + end.len();
            notes(&[&file(length as u32, chunks)[..], end].concat()).collect::<Vec<_>>()
        };
        let whole: [(&[u8], &[u8]); 2] = [(b"JSON", b"{}  "), (b"BIN\0", b"abcd")];
        assert_eq!(noted(&whole, b"\0\0\0"), [""; 0]);
        let more = [whole[0], whole[0], whole[1], (b"ODD?", b""), whole[1], whole[1]];
        let expected = [
            "1 further chunk of the type JSON is ignored",
            "2 further chunks of the type BIN are ignored",
            "1 chunk of a type other than JSON and BIN is ignored",
        ];
        assert_eq!(noted(&more, b""), expected);
        let damage =
            "the end of the file is ignored: the chunk at byte 36 has 99 bytes, of which the file holds 1";
        assert_eq!(noted(&whole, b"\x63\0\0\0BIN\0a"), [damage]);
        assert_eq!(notes(b"{}").next(), None);
    }

    #[test]
    fn what_is_cut_off_or_of_another_version_is_refused() {
        let whole = file(28, &[(b"JSON", b"{}  "), (b"BIN\0", b"abcd")]);
        let message_of = |bytes: &[u8]| split("a", bytes).err().unwrap().to_string();
        assert!(message_of(&whole[..6]).contains("the header of this binary glTF file is cut off"));
        assert!(message_of(&whole[..14]).contains("the file ends within the header of the chunk at byte 12"));
        assert!(
            message_of(&whole[..22]).contains("the chunk at byte 12 has 4 bytes, of which the file holds 2")
        );
        assert!(
            message_of(&whole[..34]).contains("the chunk at byte 24 has 4 bytes, of which the file holds 2")
        );
        assert!(message_of(&file(0, &[(b"BIN\0", b"abcd")])).contains("is not JSON"));
        let older = [b"glTF\x01\0\0\0", &whole[8..]].concat();
        assert!(
            message_of(&older).contains("raycl does not read binary glTF of version 1; expected version 2")
        );
    }

    #[test]
    fn a_buffer_may_be_empty_and_end_the_file() {
        let bytes = file(32, &[(b"JSON", b"{}  "), (b"BIN\0", b"")]);
        assert_eq!(split("a", &bytes).unwrap().1.as_deref(), Some(&b""[..]));
    }

    #[test]
    fn a_byte_order_mark_before_the_text_is_skipped() {
        assert_eq!(split("a", b"\xef\xbb\xbf{}").unwrap(), (&b"{}"[..], None));
        assert_eq!(split("a", b"{}").unwrap(), (&b"{}"[..], None));
    }
}
