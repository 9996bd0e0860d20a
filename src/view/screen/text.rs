//! Text in a terminal, in its last line and over the picture.

/// Returns the codes that write a text into the last line of a terminal of this size. Some characters are two
/// columns wide, so a text may be wider than the terminal although it has no more characters than the
/// terminal has columns. The terminal's line wrapping is off while the text is written, since a wrapped last
/// line would scroll the picture up.
pub fn last_line(text: &str, [across, down]: [u16; 2]) -> String {
    let shown = cut(text, usize::from(across));
    format!("\x1b[{down};1H\x1b[0m\x1b[K\x1b[?7l{shown}\x1b[?7h")
}

/// Returns the codes that write lines of text over a picture, from its upper left corner. The picture covers `[across,
/// down]` characters. Lines below the picture are left out, and lines wider than the picture are cut. Shorter lines are
/// filled with blanks to the width of the widest line.
pub fn over(lines: &[String], [across, down]: [usize; 2]) -> String {
    let widest = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0).min(across);
    let rows = (1..=down).zip(lines);
    let shown: String =
        rows.map(|(row, line)| format!("\x1b[{row};1H{:<widest$}", cut(line, across))).collect();
    format!("\x1b[0m{shown}")
}

/// Returns the text, or its beginning and `…` if the text has more characters than there are columns. A
/// number that does not fit as a whole is left out, because its first digits would look like another number.
fn cut(text: &str, columns: usize) -> String {
    let characters: Vec<char> = text.chars().collect();
    if characters.len() <= columns {
        return text.to_owned();
    }
    let mut end = columns.saturating_sub(1);
    while end > 0 && are_of_a_number(characters[end - 1], characters[end]) {
        end -= 1;
    }
    characters[..end].iter().chain(&['…']).collect()
}

/// Returns true if two characters, one after the other, may be parts of one number.
fn are_of_a_number(first: char, second: char) -> bool {
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | ',');
    is_part(second) && (is_part(first) || first == '-')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_line_has_at_most_a_character_per_column_and_never_wraps() {
        assert_eq!(last_line("abcd", [4, 24]), "\x1b[24;1H\x1b[0m\x1b[K\x1b[?7labcd\x1b[?7h");
        assert_eq!(last_line("abcdef", [4, 24]), "\x1b[24;1H\x1b[0m\x1b[K\x1b[?7labc…\x1b[?7h");
    }

    #[test]
    fn no_number_is_cut_in_its_middle() {
        for (text, columns, shown) in [
            ("triangle 1234", 13, "triangle 1234"),
            ("triangle 1234 | tile", 14, "triangle 1234…"),
            ("triangle 1234 | tile", 13, "triangle …"),
            ("triangle 1234 | tile", 11, "triangle …"),
            ("normal (0.85, -0.44)", 18, "normal (0.85, …"),
            ("normal (0.85, -0.44)", 16, "normal (0.85, …"),
            ("ends. Then", 5, "ends…"),
            ("1234", 3, "…"),
            ("ab", 1, "…"),
        ] {
            assert_eq!(cut(text, columns), shown, "{text} in {columns} columns");
        }
    }

    #[test]
    fn lines_over_a_picture_have_one_width_and_stay_within_it() {
        let lines = ["a b", "c"].map(str::to_owned);
        assert_eq!(over(&lines, [80, 23]), "\x1b[0m\x1b[1;1Ha b\x1b[2;1Hc  ");
        assert_eq!(over(&lines, [2, 1]), "\x1b[0m\x1b[1;1Ha…");
    }
}
