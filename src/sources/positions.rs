//! Finds the file and the line from which a line of a program's text comes. (The text is joined from several
//! files.)

/// The name that a compiler gives to the whole text of a program if it ignores `#line`, as NVIDIA's compiler does.
const WHOLE_TEXT: &str = "<kernel>";

/// Returns the compiler's messages with positions in kernel files, such as `cast/shade.cl:7:1`, instead of
/// positions in the whole text `text`, such as `<kernel>:1042:1`.
pub fn in_files(log: &str, text: &str) -> String {
    let located = |word: &str| {
        let (number, rest) = word.strip_prefix(WHOLE_TEXT)?.strip_prefix(':')?.split_once(':')?;
        let (name, number) = position_of_line(text, number.parse().ok()?)?;
        Some(format!("{name}:{number}:{rest}"))
    };
    log.split_inclusive([' ', '\n']).map(|word| located(word).unwrap_or_else(|| word.to_owned())).collect()
}

/// Returns the file from which line `number` of a text comes, and the line's number in this file, according
/// to the text's directives `#line`. Lines are counted from 1. Returns `None` if no directive precedes the
/// line.
fn position_of_line(text: &str, number: usize) -> Option<(&str, usize)> {
    let mut next = None;
    for line in text.lines().take(number.checked_sub(1)?) {
        next = directive(line).or(next.map(|(name, number)| (name, number + 1)));
    }
    next
}

/// Returns the file and the number that a directive `#line` gives to the next line; `None` for any other
/// line.
fn directive(line: &str) -> Option<(&str, usize)> {
    let (number, name) = line.strip_prefix("#line ")?.split_once(' ')?;
    Some((name.trim_matches('"'), number.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_in_the_whole_text_become_positions_in_files() {
        let text = "#define A 1\n#line 1 \"outer.cl\"\none\n#line 1 \"inner.cl\"\nwithin\n#line 3 \"outer.cl\"\nthree\nfour\n";
        assert_eq!(
            [1, 2, 3, 5, 7, 8].map(|number| position_of_line(text, number)),
            [
                None,
                None,
                Some(("outer.cl", 1)),
                Some(("inner.cl", 1)),
                Some(("outer.cl", 3)),
                Some(("outer.cl", 4)),
            ]
        );
        let log = "<kernel>:5:7: error: no type 'x'\n within\n<kernel>:8:1: note: here\n<kernel>:1:1: <kernel>: a:1:2";
        let expected = "inner.cl:1:7: error: no type 'x'\n within\nouter.cl:4:1: note: here\n<kernel>:1:1: <kernel>: a:1:2";
        assert_eq!(in_files(log, text), expected);
    }
}
