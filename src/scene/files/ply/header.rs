//! The header of a PLY file, and lines in it that PLY does not define.

use std::borrow::Cow;

/// The first words of the lines that PLY defines for a header.
const WORDS: [&[u8]; 7] =
    [b"ply", b"format", b"comment", b"obj_info", b"element", b"property", b"end_header"];
/// The word that is put before a line that begins with none of `WORDS`.
const COMMENT: &[u8] = b"comment ";
/// The longest header that is searched for lines that PLY does not define, in bytes. Such lines are refused in a longer
/// header.
const MAX_BYTES: usize = 1 << 20;

/// Turns lines that PLY does not define into comments, and counts them: some exporters write their
/// name without `comment`. Lines keep their numbers.
pub(super) fn tidied(bytes: &[u8]) -> (Cow<'_, [u8]>, usize) {
    let Some(length) = length(bytes) else { return (Cow::Borrowed(bytes), 0) };
    let mut header = Vec::new();
    let mut strange = 0;
    for line in bytes[..length].split_inclusive(|&byte| byte == b'\n') {
        if !is_ply(line) {
            header.extend_from_slice(COMMENT);
            strange += 1;
        }
        header.extend_from_slice(line);
    }
    if strange == 0 {
        return (Cow::Borrowed(bytes), 0);
    }
    header.extend_from_slice(&bytes[length..]);
    (Cow::Owned(header), strange)
}

/// Returns the number of bytes up to the end of the header; `None` if the end is not found.
fn length(bytes: &[u8]) -> Option<usize> {
    let mut end = 0;
    for line in bytes[..bytes.len().min(MAX_BYTES)].split_inclusive(|&byte| byte == b'\n') {
        end += line.len();
        if line.trim_ascii() == b"end_header" {
            return Some(end);
        }
    }
    None
}

fn is_ply(line: &[u8]) -> bool {
    let first = line.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    WORDS.contains(&first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strange_lines_become_comments_and_data_stays() {
        let plain = &b"ply\r\nformat ascii 1.0\r\ncomment a\r\nend_header\r\nBlender 1\r\n"[..];
        assert!(matches!(tidied(plain), (Cow::Borrowed(same), 0) if same == plain));
        let (tidy, strange) = tidied(b"ply\nformat ascii 1.0\nCreated by Blender\n\nend_header\nBlender\n");
        let text = b"ply\nformat ascii 1.0\ncomment Created by Blender\ncomment \nend_header\nBlender\n";
        assert_eq!((&tidy[..], strange), (&text[..], 2));
        let (tidy, strange) = tidied(b"ply\r\nBlender\r\nend_header\r\nBlender\r\n");
        let text = b"ply\r\ncomment Blender\r\nend_header\r\nBlender\r\n";
        assert_eq!((&tidy[..], strange), (&text[..], 1));
        assert!(matches!(tidied(b"ply\nBlender\n"), (Cow::Borrowed(_), 0)), "no header's end");
    }
}
