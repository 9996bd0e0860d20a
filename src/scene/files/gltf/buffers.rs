//! The buffers of a glTF file: embedded as base64, in separate files, or at the end of a binary file.

use super::left_out::{Counted, notes_on};
use super::{Flaw, Parsed};
use crate::memory::Available;
use crate::reader::{self, Kind};
use crate::scene::obj::{Reach, quoted_name};
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use base64::{DecodeError, Engine as _};
use gltf::json::Root;
use gltf::json::buffer::{Buffer, View};
use std::borrow::Cow;
use std::collections::HashMap;
use std::iter;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// The remedy if raycl cannot read a file that a buffer names.
const FILES: &str = "put the files that a glTF file names into the folder of the glTF file, or export everything as one .glb file";

/// The text before the data in a `data:` URI. Capital letters do not matter.
const BASE64: &[u8] = b";base64,";

/// The bytes of a buffer. Buffers that name the same file share its bytes.
pub(super) type Bytes<'a> = Rc<Cow<'a, [u8]>>;

/// Returns the bytes of all buffers, in the file's order. `binary` is the binary part of the glTF file, if there is
/// one: the bytes of the first buffer, unless the first buffer has a URI.
pub(super) fn load<'a>(
    root: &Root,
    reach: Reach<'_>,
    binary: Option<Cow<'a, [u8]>>,
) -> Result<Vec<Bytes<'a>>, Flaw> {
    let (has_binary, mut binary) = (binary.is_some(), binary);
    let mut files = HashMap::new();
    root.buffers
        .iter()
        .enumerate()
        .map(|(number, buffer)| {
            let lacking = if has_binary {
                "it has no URI, and only the first buffer may be the file's binary part"
            } else {
                "it has no URI, and the file has no binary part"
            };
            let bytes = read(buffer, reach, binary.take().ok_or(lacking), &mut files)
                .map_err(|flaw| flaw.within(&format!("buffer {number}")))?;
            let expected = buffer.byte_length.0;
            match bytes.len() as u64 {
                // A buffer that is empty although the file states a length above 0 is refused here, even if no
                // accessor uses it. A buffer that is merely too short is refused later, if an accessor needs more.
                0 if expected > 0 => {
                    Err(format!("buffer {number} is empty; expected {expected} bytes").into())
                }
                _ => Ok(bytes),
            }
        })
        .collect()
}

/// Returns notes on buffers, and on buffer views (parts of buffers), that are not as long as the file states, and on a
/// binary part that is in no buffer. `binary` is the length of the binary part.
pub(super) fn notes(
    root: &Root,
    buffers: &[Bytes<'_>],
    binary: usize,
) -> impl Iterator<Item = String> + use<> {
    let is_short = |(buffer, bytes): &(&Buffer, &Bytes<'_>)| (bytes.len() as u64) < buffer.byte_length.0;
    let ends_beyond = |view: &&View| {
        let end = view.byte_offset.unwrap_or_default().0.saturating_add(view.byte_length.0);
        let bytes = buffers.get(view.buffer.value()).map(|bytes| bytes.len() as u64);
        let stated = root.get(view.buffer).map(|buffer| buffer.byte_length.0);
        bytes.zip(stated).is_some_and(|(bytes, stated)| end > bytes.min(stated))
    };
    // Up to three bytes are padding.
    let is_longer =
        |buffer: &Buffer| buffer.uri.is_none() && binary as u64 > buffer.byte_length.0.saturating_add(3);
    let is_unused = binary > 0 && root.buffers.first().is_none_or(|buffer| buffer.uri.is_some());
    let counts: [Counted; 4] = [
        (
            usize::from(root.buffers.first().is_some_and(is_longer)),
            "BIN chunk with more bytes than its buffer's byteLength states",
            "used as far as buffer views reach",
        ),
        (
            root.buffers.iter().zip(buffers).filter(is_short).count(),
            "buffer with fewer bytes than byteLength states",
            "read as it is",
        ),
        (
            root.buffer_views.iter().filter(ends_beyond).count(),
            "buffer view with an end beyond the buffer",
            "read as far as there are bytes",
        ),
        (usize::from(is_unused), "BIN chunk that no buffer uses", "ignored"),
    ];
    notes_on(counts)
}

fn read<'a>(
    buffer: &Buffer,
    reach: Reach<'_>,
    binary: Result<Cow<'a, [u8]>, &str>,
    files: &mut HashMap<PathBuf, Bytes<'a>>,
) -> Result<Bytes<'a>, Flaw> {
    let Some(uri) = &buffer.uri else {
        return binary.map(Rc::new).map_err(Flaw::from);
    };
    if is_data(uri) {
        let bytes = decoded(uri).map(|bytes| Rc::new(Cow::Owned(bytes)));
        let quotes = reach.permitted.quotes;
        return bytes.map_err(|why| {
            if quotes { format!("it {why}") } else { "its data: URI is damaged".to_owned() }.into()
        });
    }
    named(uri, reach, files).map_err(|what| Flaw::from(what).with_remedy(FILES))
}

/// Returns the bytes of the file that a buffer's URI names.
fn named<'a>(uri: &str, reach: Reach<'_>, files: &mut HashMap<PathBuf, Bytes<'a>>) -> Parsed<Bytes<'a>> {
    let quotes = reach.permitted.quotes;
    let shown = |name: &str| if quotes { quoted_name(name) } else { "its URI".to_owned() };
    if uri.contains("://") {
        return Err(format!("{} is not a file; nothing is downloaded", shown(uri)));
    }
    let name = unescaped(uri);
    let bytes = reach.locate(&name).and_then(|path| match files.get(&path) {
        Some(bytes) => Ok(Rc::clone(bytes)),
        None => {
            let bytes = Rc::new(Cow::Owned(file(&path)?));
            files.insert(path, Rc::clone(&bytes));
            Ok(bytes)
        }
    });
    let similar = || if quotes { reach.other_case(iter::once(&name)) } else { String::new() };
    bytes.map_err(|why| format!("{} {why}{}", shown(&name), similar()))
}

/// Reads a file. Returns an error if the file cannot be read or is too large for the host's memory.
fn file(path: &Path) -> Parsed<Vec<u8>> {
    let unreadable = |error: std::io::Error| format!("cannot be read ({error})");
    let length = path.metadata().map_err(unreadable)?.len();
    Available::read()
        .hold(length, "reading it", "its length")
        .map_err(|error| format!("is too large ({error})"))?;
    reader::bytes(path, Kind::Mesh).map_err(unreadable)
}

/// Returns true if a URI contains data itself. As in browsers, blanks before `data:` and capital letters do not matter.
pub(super) fn is_data(uri: &str) -> bool {
    let start = uri.trim_ascii_start().as_bytes().get(..5);
    start.is_some_and(|start| start.eq_ignore_ascii_case(b"data:"))
}

/// Decodes a `data:` URI, which consists of a media type, `;base64,` and the data. The media type is not
/// checked. The text of an error lacks its subject: the caller puts a name or "it" before this text.
pub(super) fn decoded(data: &str) -> Parsed<Vec<u8>> {
    let mut starts = data.as_bytes().windows(BASE64.len());
    let start = starts.position(|start| start.eq_ignore_ascii_case(BASE64));
    let text = &data[start.ok_or("is a data: URI without base64")? + BASE64.len()..];
    let either = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    let engine = GeneralPurpose::new(&base64::alphabet::STANDARD, either);
    let damaged = |error: DecodeError| {
        let what = error.to_string();
        format!("has damaged base64 ({})", what.trim_end_matches('.'))
    };
    engine.decode(text).or_else(|_| engine.decode(plain(text))).map_err(damaged)
}

/// Returns base64 in its usual form. Escapes such as `%2B` are replaced by their characters, and the `-` and `_` of the
/// alphabet for URLs by `+` and `/`. Blanks and line ends are removed.
fn plain(text: &str) -> String {
    let text = unescaped(text).replace('-', "+").replace('_', "/");
    text.split_ascii_whitespace().collect()
}

/// Replaces escapes such as `%20` in a file's name by the bytes that they stand for.
pub(super) fn unescaped(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let digits =
            after.get(..2).filter(|_| first == b'%').and_then(|digits| std::str::from_utf8(digits).ok());
        let escaped = digits.and_then(|digits| u8::from_str_radix(digits, 16).ok());
        bytes.push(escaped.unwrap_or(first));
        rest = if escaped.is_some() { &after[2..] } else { after };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::Named;
    use super::*;
    use crate::scene::obj::Permitted;

    fn message(flaw: Flaw) -> String {
        Named { name: "a", quotes: true }.error(flaw).to_string()
    }

    #[test]
    fn a_file_that_several_buffers_name_is_read_once() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.bin"), "1234").unwrap();
        let text = r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "a.bin", "byteLength": 4},
{"uri": "data:;base64,AQID", "byteLength": 3}, {"uri": "./a.bin", "byteLength": 4}]}"#;
        let root: Root = serde_json::from_str(text).unwrap();
        let permitted = Permitted { beyond: false, quotes: true, scaled: false };
        let buffers = load(&root, Reach { folder: folder.path(), permitted }, None).unwrap();
        assert_eq!(buffers.iter().map(|bytes| bytes.len()).collect::<Vec<_>>(), [4, 3, 4]);
        assert!(Rc::ptr_eq(&buffers[0], &buffers[2]));
    }

    #[test]
    fn a_missing_file_is_named_with_one_that_differs_only_in_upper_and_lower_case() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("Mesh.bin"), "1234").unwrap();
        let text = r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "mesh.bin", "byteLength": 4}]}"#;
        let root: Root = serde_json::from_str(text).unwrap();
        let error = |quotes| {
            let permitted = Permitted { beyond: false, quotes, scaled: false };
            message(load(&root, Reach { folder: folder.path(), permitted }, None).err().unwrap())
        };
        assert!(error(true).ends_with("), but there is a file `Mesh.bin`"), "{}", error(true));
        assert!(!error(false).contains("Mesh"), "{}", error(false));
    }

    #[test]
    fn only_the_first_buffer_is_the_binary_part_of_a_file() {
        let loaded = |buffers: &str, binary: Option<&'static [u8]>| -> Result<Vec<Vec<u8>>, String> {
            let text = format!(r#"{{"asset": {{"version": "2.0"}}, "buffers": [{buffers}]}}"#);
            let root: Root = serde_json::from_str(&text).unwrap();
            let permitted = Permitted { beyond: false, quotes: true, scaled: false };
            let reach = Reach { folder: Path::new(""), permitted };
            let buffers = load(&root, reach, binary.map(Cow::Borrowed)).map_err(message)?;
            Ok(buffers.iter().map(|bytes| bytes.to_vec()).collect())
        };
        let own = r#"{"byteLength": 3}"#;
        assert_eq!(loaded(own, Some(b"123")), Ok(vec![b"123".to_vec()]));
        let expected = "a: buffer 0: it has no URI, and the file has no binary part".to_owned();
        assert_eq!(loaded(own, None), Err(expected));
        let expected =
            "a: buffer 1: it has no URI, and only the first buffer may be the file's binary part".to_owned();
        for first in [own, r#"{"uri": "data:;base64,AQID", "byteLength": 3}"#] {
            let found = loaded(&format!("{first}, {own}"), Some(b"123"));
            assert_eq!(found, Err(expected.clone()), "{first}");
        }
    }

    #[test]
    fn names_are_unescaped_and_data_is_decoded() {
        assert_eq!(unescaped("Box%20With%20Spaces%C3%A9.bin%"), "Box With Spaces\u{e9}.bin%");
        for text in ["application/octet-stream;base64,AQID", "application/gltf-buffer;base64,AQIDBA=="] {
            assert!(decoded(text).unwrap().starts_with(&[1, 2, 3]));
        }
        for text in ["-_-_", " +/\n+/\r\n", "%2B%2f%2B/"] {
            assert_eq!(decoded(&format!("DATA:;BASE64,{text}")).unwrap(), [0xfb, 0xff, 0xbf], "{text}");
        }
        assert_eq!([" Data:,a", "data:", "data.bin", "a"].map(is_data), [true, true, false, false]);
        for (uri, expected) in [
            ("data:text/plain,abc", "is a data: URI without base64"),
            ("data:;base64,!AAA", "has damaged base64 (Invalid symbol 33, offset 0)"),
        ] {
            assert_eq!(decoded(uri).unwrap_err(), expected);
        }
    }

    #[test]
    fn a_buffer_that_is_damaged_is_named_in_one_sentence() {
        let error = |uri: &str| {
            let buffer = format!(r#"{{"uri": "{uri}", "byteLength": 3}}"#);
            let text = format!(r#"{{"asset": {{"version": "2.0"}}, "buffers": [{buffer}]}}"#);
            let root: Root = serde_json::from_str(&text).unwrap();
            let permitted = Permitted { beyond: false, quotes: true, scaled: false };
            message(load(&root, Reach { folder: Path::new(""), permitted }, None).unwrap_err())
        };
        assert_eq!(error("data:,abc"), "a: buffer 0: it is a data: URI without base64");
        let damaged = "a: buffer 0: it has damaged base64 (Invalid symbol 33, offset 0)";
        assert_eq!(error("data:;base64,!AAA"), damaged);
    }

    #[test]
    fn a_buffer_is_empty_only_if_its_length_is_0() {
        let length = |stated: u32| {
            let buffer = format!(r#"{{"uri": "data:;base64,", "byteLength": {stated}}}"#);
            let text = format!(r#"{{"asset": {{"version": "2.0"}}, "buffers": [{buffer}]}}"#);
            let root: Root = serde_json::from_str(&text).unwrap();
            let permitted = Permitted { beyond: false, quotes: true, scaled: false };
            let buffers = load(&root, Reach { folder: Path::new(""), permitted }, None);
            buffers.map(|buffers| buffers[0].len()).map_err(message)
        };
        assert_eq!(length(0), Ok(0));
        assert_eq!(length(3), Err("a: buffer 0 is empty; expected 3 bytes".to_owned()));
    }
}
