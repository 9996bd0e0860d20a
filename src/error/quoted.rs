//! Prepares a file's text to be quoted in messages: long lines are shortened, and control characters
//! are replaced.

/// Largest number of bytes of a line or a message that is shown in full.
pub(super) const SHOWN_LINE_BYTES: usize = 400;

/// Returns the text with control characters replaced, and with its middle omitted if it is too long.
pub fn shortened(text: impl Into<String>) -> String {
    let text = printable(text.into());
    if text.len() <= SHOWN_LINE_BYTES {
        return text;
    }
    let head = &text[..boundary(&text, SHOWN_LINE_BYTES / 2)];
    let tail = &text[boundary(&text, text.len() - SHOWN_LINE_BYTES / 3)..];
    format!("{head} ... {tail}")
}

/// Finds the character that contains the byte at `place`. Returns the index of its first byte, at most the text's
/// length.
pub(super) fn boundary(text: &str, place: usize) -> usize {
    (0..=place.min(text.len())).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0)
}

/// Returns the number, from 1, of the line that contains the byte at `offset`.
pub fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|&byte| byte == b'\n').count()
}

/// Returns the text with long lines cut, and the number of bytes that were removed before `place`.
pub(super) fn cut_long_lines(text: String, place: usize) -> (String, usize) {
    if text.split('\n').all(|line| line.len() <= SHOWN_LINE_BYTES) {
        return (text, 0);
    }
    let (mut kept, mut read, mut cut) = (String::new(), 0, 0);
    for line in text.split_inclusive('\n') {
        read += line.len();
        let shown = match line.len() {
            0..=SHOWN_LINE_BYTES => line.to_owned(),
            _ => line[..boundary(line, SHOWN_LINE_BYTES / 2)].to_owned() + " ...\n",
        };
        cut += if read <= place { line.len() - shown.len() } else { 0 };
        kept.push_str(&shown);
    }
    (kept, cut)
}

/// Returns the text with control characters, except tabs and line ends, replaced by question marks. The positions of
/// all other bytes stay the same.
pub(super) fn printable(text: String) -> String {
    let steers = |c: char| c.is_control() && c != '\n' && c != '\t' && c != '\r';
    if !text.contains(steers) {
        return text;
    }
    let shown = |c: char| if steers(c) { "?".repeat(c.len_utf8()) } else { c.to_string() };
    text.chars().map(shown).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_line_belongs_to_this_line() {
        let lines = [0, 1, 2, 3, 4].map(|offset| line_of("a\nb\n", offset));
        assert_eq!(lines, [1, 1, 2, 2, 3]);
    }
}
