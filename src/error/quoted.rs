//! Prepares a file's text to be quoted in messages: long lines are shortened, and control characters and invisible
//! characters are replaced.

use crate::printer;

/// The character with which some editors begin a file.
const BYTE_ORDER_MARK: char = '\u{feff}';
/// Largest number of bytes of a line or a message that is shown in full.
pub(super) const SHOWN_LINE_BYTES: usize = 400;
/// Largest number of bytes of a note that is shown in full. A note may contain the paths of two files, the
/// name of a third file, what is wrong with the third file, and the remedy.
const SHOWN_NOTE_BYTES: usize = 2000;

/// Returns the text with control characters and invisible characters replaced, and with its middle omitted if the text
/// has more than 400 bytes.
pub fn shortened(text: impl Into<String>) -> String {
    within(text.into(), SHOWN_LINE_BYTES)
}

/// Does the same as [`shortened`] for a note, whose middle is omitted only if the note has more than 2000 bytes.
pub fn shortened_note(note: impl Into<String>) -> String {
    within(note.into(), SHOWN_NOTE_BYTES)
}

fn within(text: String, most_bytes: usize) -> String {
    let text = printable(text);
    if text.len() <= most_bytes {
        return text;
    }
    let head = &text[..boundary(&text, most_bytes / 2)];
    let tail = &text[boundary(&text, text.len() - most_bytes / 3)..];
    format!("{head} ... {tail}")
}

/// Returns the index of the first byte of the character that contains the byte at `offset`. Returns the text's length
/// if `offset` is not in the text.
pub(super) fn boundary(text: &str, offset: usize) -> usize {
    (0..=offset.min(text.len())).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0)
}

/// Returns the number, from 1, of the line that contains the byte at `offset`.
pub fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|&byte| byte == b'\n').count()
}

/// Returns the text with long lines cut. Also returns the number of bytes by which the lines before the marked line
/// became shorter. The marked line is the one that contains the byte at `offset`.
pub(super) fn cut_long_lines(text: String, offset: usize) -> (String, usize) {
    if text.split('\n').all(|line| line.len() <= SHOWN_LINE_BYTES) {
        return (text, 0);
    }
    let (mut shortened, mut read, mut cut) = (String::new(), 0, 0);
    for line in text.split_inclusive('\n') {
        read += line.len();
        let shown = match line.len() {
            0..=SHOWN_LINE_BYTES => line.to_owned(),
            _ => line[..boundary(line, SHOWN_LINE_BYTES / 2)].to_owned() + " ...\n",
        };
        cut += if read <= offset { line.len() - shown.len() } else { 0 };
        shortened.push_str(&shown);
    }
    (shortened, cut)
}

/// Returns the text with control characters and invisible characters, except tabs and line ends, replaced by
/// question marks. The number of question marks is the character's number of bytes, so that the rest of the
/// text stays at the same positions. A byte order mark at the start is no mistake and stays.
pub(super) fn printable(text: String) -> String {
    let steers = |c: char| printer::steers(c) && c != '\r';
    if !text.contains(steers) {
        return text;
    }
    let shown = |(at, c): (usize, char)| match steers(c) && (at, c) != (0, BYTE_ORDER_MARK) {
        true => "?".repeat(c.len_utf8()),
        false => c.to_string(),
    };
    text.char_indices().map(shown).collect()
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

    #[test]
    fn a_long_text_keeps_its_beginning_and_its_end() {
        let long = "a".repeat(300) + &"b".repeat(300);
        assert_eq!(shortened(long), format!("{} ... {}", "a".repeat(200), "b".repeat(133)));
        assert_eq!(shortened("c".repeat(400)), "c".repeat(400));
        assert_eq!(shortened_note("c".repeat(2000)), "c".repeat(2000));
        let long = "a".repeat(1500) + &"b".repeat(1500);
        assert_eq!(shortened_note(long), format!("{} ... {}", "a".repeat(1000), "b".repeat(666)));
    }

    #[test]
    fn a_boundary_is_the_start_of_a_character_or_the_end_of_the_text() {
        assert_eq!([0, 1, 2, 3, 9].map(|offset| boundary("\u{fc}b", offset)), [0, 0, 2, 3, 3]);
    }

    #[test]
    fn a_long_line_is_cut_and_the_positions_behind_it_move() {
        let text = format!("short\n{}\nbad\n", "x".repeat(500));
        let cut = format!("short\n{} ...\nbad\n", "x".repeat(200));
        assert_eq!(cut_long_lines(text.clone(), 2), (cut.clone(), 0));
        // A line of 501 bytes becomes a line of 205 bytes.
        assert_eq!(cut_long_lines(text, 507), (cut, 296));
        let most = format!("{}\n", "x".repeat(400));
        assert_eq!(cut_long_lines(most.clone(), 3), (most, 0));
    }

    #[test]
    fn invisible_characters_are_shown_and_a_byte_order_mark_at_the_start_is_left() {
        assert_eq!(printable("\u{feff}a\u{feff}b\u{2028}c\u{202e}".to_owned()), "\u{feff}a???b???c???");
    }

    #[test]
    fn tabs_and_line_ends_are_shown_and_other_control_characters_are_not() {
        assert_eq!(printable("a\tb\r\n\u{1b}\u{9b}c".to_owned()), "a\tb\r\n???c");
    }
}
