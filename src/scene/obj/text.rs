//! Divides the text of OBJ and MTL files into pieces (of whole lines each), into lines and into words. Also parses
//! numbers, and locates mistakes.

use crate::error::Error;
use crate::words::counted;
use memchr::memchr_iter;
use rayon::prelude::*;
use std::borrow::Cow;

/// An error quotes only lines of at most `SHOWN_LINE_BYTES` bytes.
const SHOWN_LINE_BYTES: usize = 400;
/// Largest size in bytes of a file whose text is copied into an error.
const SHOWN_FILE_BYTES: usize = 4 << 20;
/// Largest number of characters of a file's name that messages show in full.
const SHOWN_NAME_CHARACTERS: usize = 200;
/// Smallest number of bytes of a piece of an OBJ file's text, except of the last piece. Reading shorter pieces
/// in parallel would save no time.
const CHUNK_BYTES: usize = 1 << 17;
/// Largest number of bytes of a piece of the text. A piece may be longer by the rest of its last line. With
/// longer pieces, the other threads would wait long while one thread reads the last piece.
const MOST_CHUNK_BYTES: usize = 8 << 20;

/// Number of pieces per thread, unless the pieces would be shorter than `CHUNK_BYTES` or longer than
/// `MOST_CHUNK_BYTES`.
pub(super) const PIECES_PER_THREAD: usize = 4;

/// A mistake at a byte offset in the text that [`normalise`] returns.
#[derive(Debug)]
pub(super) struct Mistake {
    offset: usize,
    message: String,
    /// The form that the line with the mistake should have; `None` if the form depends only on
    /// the line's keyword (see [`expected`]).
    expected: Option<String>,
}

impl Mistake {
    pub fn new(offset: usize, message: impl Into<String>) -> Self {
        Self { offset, message: message.into(), expected: None }
    }

    /// Sets the form that the line with the mistake should have. The string `expected` must quote nothing
    /// from the file.
    pub fn expecting(self, expected: impl Into<String>) -> Self {
        Self { expected: Some(expected.into()), ..self }
    }

    /// Returns the form that the line should have; `text` begins at the mistake.
    fn expected(&self, text: &[u8]) -> String {
        self.expected.clone().unwrap_or_else(|| expected(text).to_owned())
    }
}

/// The number of lines with one kind of irregularity, and the byte offset of the first such line.
#[derive(Clone, Copy, Default)]
pub(super) struct Seen {
    pub count: usize,
    pub first: usize,
}

impl Seen {
    pub fn at(&mut self, offset: usize) {
        self.first = if self.count == 0 { offset } else { self.first };
        self.count += 1;
    }

    /// Counts a line if `is_irregular` is true.
    pub fn at_if(&mut self, is_irregular: bool, offset: usize) {
        if is_irregular {
            self.at(offset);
        }
    }

    /// Joins the counts of all pieces of the file, in the order of the pieces.
    pub fn of_all(pieces: impl Iterator<Item = Self>) -> Self {
        pieces.fold(Self::default(), Self::joined)
    }

    /// Joins the counts of this piece of the file and of a later piece. Returns the number of irregular lines in both
    /// pieces together, and the byte offset of the first irregular line.
    pub fn joined(self, later: Self) -> Self {
        Self {
            count: self.count + later.count,
            first: if self.count == 0 { later.first } else { self.first },
        }
    }
}

/// A text and its name in messages.
pub(super) struct Source<'a> {
    pub name: &'a str,
    pub text: &'a [u8],
    /// True if messages may quote the text.
    pub quotes: bool,
}

impl Source<'_> {
    /// Returns the number, from 1, of the line that contains the byte at `offset`.
    pub fn line(&self, offset: usize) -> usize {
        1 + self.text[..offset.min(self.text.len())].iter().filter(|&&byte| byte == b'\n').count()
    }

    /// Returns a note on the lines in `seen`; `None` if there are none. `what` says what raycl does with the lines.
    /// `before` is the text before the number of the first line.
    pub fn note_on_lines(&self, before: &str, seen: Seen, what: &str) -> Option<String> {
        let note = || format!("{before}{}: {what} ({})", self.line(seen.first), counted(seen.count, "line"));
        (seen.count > 0).then(note)
    }

    /// Returns a mistake's line and message for a note. If the text may not be quoted, the message is
    /// replaced by the form that the line should have.
    pub fn note_of(&self, mistake: &Mistake) -> String {
        let line = self.line(mistake.offset);
        match self.quotes {
            true => format!("line {line}: {}", mistake.message),
            false => format!(
                "line {line}: the line is not valid; expected {}",
                mistake.expected(&self.text[mistake.offset..])
            ),
        }
    }

    /// Returns the error for a mistake, with its file and line. The error also shows the line, if it may be quoted, if
    /// neither the line nor the file is too long, and if the file is UTF-8. If the text may not be quoted, the error
    /// has the form that the line should have, instead of the message.
    pub fn error(&self, mistake: Mistake) -> Error {
        let before = &self.text[..mistake.offset.min(self.text.len())];
        let rest = &self.text[before.len()..];
        let expected = mistake.expected(rest);
        let line_number = self.line(mistake.offset);
        if !self.quotes {
            return Error::withheld(self.name, line_number, &format!("expected {expected}"));
        }
        let message = format!("{}:{line_number}: {}", self.name, mistake.message);
        let length = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
        let begin = before.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
        let whole_line = before.len() - begin + length;
        // Only UTF-8 text is shown beside the message. In other text, some bytes would have to be replaced before
        // the text can be shown, and `span` would then mark the wrong place.
        match std::str::from_utf8(self.text) {
            Ok(text) if text.len() <= SHOWN_FILE_BYTES && whole_line <= SHOWN_LINE_BYTES => {
                let span = before.len()..before.len() + length;
                Error::in_file(self.name, text, span, message, "here")
            }
            _ => Error::input(message),
        }
        .with_help(format!("expected {expected}"))
    }
}

/// Returns the form that the first line of a text should have, according to the line's keyword. Every error
/// names the expected form of the line, even if the error must not quote the line.
fn expected(text: &[u8]) -> &'static str {
    let line = text.split(|&byte| byte == b'\n').next().unwrap_or_default();
    match keyword(line.trim_ascii_start()).0 {
        b"vn" => "`vn x y z`: three finite numbers",
        b"vt" => "`vt u v`: two finite numbers",
        b"f" | b"fo" => "`f 1 2 3`: the numbers of three or more vertices that the file has",
        b"newmtl" => "`newmtl NAME`",
        _ => "a mesh: vertices (`v x y z`) and faces (`f 1 2 3`)",
    }
}

/// A piece of a text, which consists of whole lines.
pub(super) struct Chunk<'a> {
    start: usize,
    bytes: &'a [u8],
}

impl<'a> Chunk<'a> {
    /// Returns a whole text as one piece.
    pub fn whole(text: &'a [u8]) -> Self {
        Self { start: 0, bytes: text }
    }

    /// Returns the piece's lines without surrounding blanks, each after its byte offset in the text.
    pub fn lines(&self) -> impl Iterator<Item = (usize, &'a [u8])> {
        let (first, bytes) = (self.start, self.bytes);
        let mut start = 0;
        memchr_iter(b'\n', bytes).chain(std::iter::once(bytes.len())).map(move |end| {
            let line = (first + start, bytes[start..end].trim_ascii());
            start = end + 1;
            line
        })
    }
}

/// Divides a text at line ends into pieces: about `PIECES_PER_THREAD` for each thread, unless such pieces
/// would be too short or too long.
pub(super) fn chunks(text: &[u8]) -> Vec<Chunk<'_>> {
    let target = (text.len() / (PIECES_PER_THREAD * rayon::current_num_threads()))
        .clamp(CHUNK_BYTES, MOST_CHUNK_BYTES);
    let mut chunks = Vec::new();
    let mut start = 0;
    while start < text.len() {
        let from = (start + target).min(text.len());
        let end = text[from..].iter().position(|&byte| byte == b'\n').map_or(text.len(), |at| from + at + 1);
        chunks.push(Chunk { start, bytes: &text[start..end] });
        start = end;
    }
    chunks
}

/// Returns the text without a byte order mark, and with line feeds as its only line ends. Lines that end in `\`, which
/// blanks may follow, are joined with the next line. Lines with a word that begins with `#`, as a comment does, are not
/// joined. Empty lines are added after a joined line, so that line numbers stay the same.
pub(super) fn normalise(bytes: &[u8]) -> Cow<'_, [u8]> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let has = |byte: &u8| bytes.par_chunks(CHUNK_BYTES).any(|piece| piece.contains(byte));
    if !(has(&b'\r') || has(&b'\\') && has_continuation(bytes)) {
        return Cow::Borrowed(bytes);
    }
    let mut out = Vec::with_capacity(bytes.len());
    let mut joined = 0;
    for line in split_lines(bytes) {
        match line.trim_ascii_end().strip_suffix(b"\\") {
            // A comment such as `# made from C:\` is not continued.
            Some(head) if !separated(line).any(|word| word.starts_with(b"#")) => {
                out.extend_from_slice(head);
                out.push(b' ');
                joined += 1;
            }
            _ => {
                out.extend_from_slice(line);
                out.extend(std::iter::repeat_n(b'\n', 1 + joined));
                joined = 0;
            }
        }
    }
    Cow::Owned(out)
}

/// Returns true if a line ends in `\`, which blanks may follow.
fn has_continuation(bytes: &[u8]) -> bool {
    let ends_line = |at: usize| {
        let mut rest = bytes[at + 1..].iter();
        rest.find(|byte| **byte == b'\n' || !byte.is_ascii_whitespace()).is_none_or(|byte| *byte == b'\n')
    };
    memchr_iter(b'\\', bytes).any(ends_line)
}

/// Splits lines at LF, CR LF or CR.
pub(in crate::scene) fn split_lines(bytes: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    let mut rest = Some(bytes);
    std::iter::from_fn(move || {
        let text = rest?;
        let Some(end) = text.iter().position(|&byte| byte == b'\n' || byte == b'\r') else {
            return rest.take();
        };
        let skip = if text[end..].starts_with(b"\r\n") { 2 } else { 1 };
        rest = Some(&text[end + skip..]);
        Some(&text[..end])
    })
}

/// Returns a line's first word, and the rest of the line.
pub(super) fn keyword(line: &[u8]) -> (&[u8], &[u8]) {
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    line.split_at(end)
}

/// Returns the words of a line of numbers, up to a comment. A comment may begin right after a number.
pub(super) fn tokens(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = line;
    std::iter::from_fn(move || {
        let token = &rest[rest.iter().position(|byte| !byte.is_ascii_whitespace())?..];
        let (token, after) = token.split_at(token_length(token));
        rest = if after.starts_with(b"#") { &[] } else { after };
        (!token.is_empty()).then_some(token)
    })
}

/// Returns the length of the word at the beginning of a text, up to a blank or a comment.
fn token_length(text: &[u8]) -> usize {
    let is_end = |byte: &u8| byte.is_ascii_whitespace() || *byte == b'#';
    let length = |text: &[u8]| text.iter().position(is_end).unwrap_or(text.len());
    let (before, after) = text.split_at(length(text));
    match after {
        [b'#', rest @ ..] if is_in_number(before, after) => before.len() + 1 + length(rest),
        _ => before.len(),
    }
}

/// Returns true if the `#` at the beginning of `after` begins no comment, but belongs to a number that is not finite,
/// as old Windows programs write such numbers: `1.#INF`, `-1.#IND`, `1.#QNAN`.
fn is_in_number(before: &[u8], after: &[u8]) -> bool {
    const WORDS: [&[u8]; 4] = [b"#QNAN", b"#SNAN", b"#IND", b"#INF"];
    let begins = |word: &&[u8]| after.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word));
    before.ends_with(b"1.") && WORDS.iter().any(begins)
}

/// Returns the words of a line with a name, up to a word that is only `#`: from there on, the line is a
/// comment.
pub(super) fn name_tokens(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    separated(line).take_while(|token| *token != b"#")
}

/// Returns the three names that a text may mean, in the order in which they are looked up. Each name is a
/// beginning of the previous one.
///
/// 1. The whole text.
/// 2. The text before the first word that is only `#`. A word that is only `#` certainly begins a comment.
/// 3. The text before the first word that begins with `#`, whatever follows the `#`. A word that begins with
///    `#` may begin a comment, or belong to a name such as `Material #25`. If the text begins with `#`, the
///    third name is the same as the second name.
pub(super) fn possible_names(text: &str) -> [&str; 3] {
    let certain = before_comment(text, |comment| {
        let rest = &comment[1..];
        rest.is_empty() || rest.starts_with(|next: char| next.is_ascii_whitespace())
    });
    let shortest = before_comment(text, |_| true);
    [text, certain, if shortest.is_empty() { certain } else { shortest }]
}

/// Returns the paths that a text may mean, in the order in which they are looked up: the paths of the text as it is
/// and, if the text begins with a name in double quotes, the paths of this name. Some programs write such quotes.
pub(super) fn possible_paths(text: &str) -> impl Iterator<Item = &str> {
    with_unquoted(text).flat_map(unquoted_paths)
}

/// Returns those of the [`possible_paths`] that have all folders of the text.
pub(super) fn stated_paths(text: &str) -> impl Iterator<Item = &str> {
    with_unquoted(text).flat_map(possible_names)
}

/// Returns a text and, if it begins with a name in double quotes, this name.
fn with_unquoted(text: &str) -> impl Iterator<Item = &str> {
    let quoted = text.trim_ascii_start().strip_prefix('"').and_then(|rest| rest.split_once('"'));
    let name = quoted.map(|(name, _)| name).filter(|name| !name.is_empty());
    std::iter::once(text).chain(name)
}

/// Returns the paths that a text without quotes may mean: the [`possible_names`], and then each of these names without
/// its folders. Many files contain paths from their authors' disks.
fn unquoted_paths(text: &str) -> impl Iterator<Item = &str> {
    let names = possible_names(text);
    // Only slashes in the shortest of the three names separate folders: the longer names may contain a
    // comment, and a comment may contain slashes, too.
    let folders = names[2].rfind(['/', '\\']).map_or(0, |slash| slash + 1);
    names.into_iter().chain(names.map(|name| &name[folders..]))
}

/// Returns a text up to the first word that begins with `#` and for which `is_comment` returns true. The
/// argument of `is_comment` is the text from the beginning of the word to the end of the whole text.
fn before_comment(text: &str, is_comment: impl Fn(&str) -> bool) -> &str {
    let begins_word =
        |at: usize| text[..at].chars().next_back().is_none_or(|before| before.is_ascii_whitespace());
    let mut marks = text.match_indices('#').map(|(at, _)| at);
    let comment = marks.find(|at| begins_word(*at) && is_comment(&text[*at..]));
    text[..comment.unwrap_or(text.len())].trim_ascii_end()
}

fn separated(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|token| !token.is_empty())
}

/// Decodes a name or a word as UTF-8 or, if it is not UTF-8, as Latin-1.
pub(super) fn words(bytes: &[u8]) -> String {
    let bytes = bytes.trim_ascii();
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
    }
}

/// Returns a token for messages: in backquotes, printable, and shortened to 40 characters.
pub(in crate::scene) fn quoted(token: &[u8]) -> String {
    let text = words(token);
    let end = if text.chars().nth(40).is_some() { "..." } else { "" };
    format!("`{}{end}`", printable(text.chars().take(40)))
}

/// Returns the name of a file for messages: in backquotes and printable. A name of more than 200 characters
/// loses its beginning, and not its end, since the end tells which file is meant.
pub(in crate::scene) fn quoted_name(name: &str) -> String {
    let omitted = name.chars().count().saturating_sub(SHOWN_NAME_CHARACTERS);
    let begin = if omitted > 0 { "..." } else { "" };
    format!("`{begin}{}`", printable(name.chars().skip(omitted)))
}

/// Returns a text in which all characters are escaped, except printable ASCII characters.
fn printable(characters: impl Iterator<Item = char>) -> String {
    let mut shown = String::new();
    for character in characters {
        match character {
            '\\' | '\'' | '"' => shown.push(character),
            _ => shown.extend(character.escape_default()),
        }
    }
    shown
}

/// Parses a finite f32.
pub(super) fn number(token: &[u8]) -> Option<f32> {
    let parsed = || std::str::from_utf8(token).ok()?.parse().ok();
    short_number(token).or_else(parsed).filter(|value: &f32| value.is_finite())
}

/// Parses a finite decimal number in double precision.
pub(in crate::scene) fn decimal(token: &[u8]) -> Option<f64> {
    std::str::from_utf8(token).ok()?.parse().ok().filter(|value: &f64| value.is_finite())
}

/// Returns true if a token would be a finite decimal number with a point in place of its comma. Some programs write
/// numbers in the form that is usual in their user's language.
pub(in crate::scene) fn has_decimal_comma(token: &[u8]) -> bool {
    let with_point = || token.iter().map(|byte| if *byte == b',' { b'.' } else { *byte }).collect::<Vec<_>>();
    token.contains(&b',') && decimal(&with_point()).is_some()
}

/// Returns a token that is not a valid number, in quotation marks. If its only mistake is a decimal comma, the text says
/// so.
pub(in crate::scene) fn quoted_number(token: &[u8]) -> String {
    let comma = if has_decimal_comma(token) { " (a comma instead of a decimal point)" } else { "" };
    format!("{}{comma}", quoted(token))
}

/// Parses a decimal number of few digits; most numbers in meshes have few digits. Returns `None` for text
/// that is not a decimal number of few digits.
fn short_number(token: &[u8]) -> Option<f32> {
    leading_number(token).and_then(|(number, rest)| rest.is_empty().then_some(number))
}

/// Splits a decimal number of few digits off the beginning of a text. The digits as an integer and the power
/// of ten are exact in f32, so their quotient is the f32 nearest to the number (Clinger, "How to Read
/// Floating Point Numbers Accurately", 1990).
fn leading_number(text: &[u8]) -> Option<(f32, &[u8])> {
    const POWERS: [f32; 11] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10];
    let digits = text.strip_prefix(b"-").unwrap_or(text);
    let (mut integer, mut point, mut length) = (0_u64, None, 0);
    // Ten digits fit into 64 bits, so no step needs a check for overflow.
    for byte in digits.iter().take(10) {
        match byte {
            b'0'..=b'9' => integer = 10 * integer + u64::from(byte - b'0'),
            b'.' if point.is_none() => point = Some(length),
            _ => break,
        }
        length += 1;
    }
    let decimals = point.map_or(0, |index| length - 1 - index);
    if length == usize::from(point.is_some()) || integer > 1 << 24 {
        return None;
    }
    let size = integer as f32 / POWERS.get(decimals)?;
    Some((if digits.len() < text.len() { -size } else { size }, &digits[length..]))
}

/// Returns the text after the blanks at its beginning; `None` if the text does not begin with a blank.
pub(super) fn after_blanks(text: &[u8]) -> Option<&[u8]> {
    let rest = text.trim_ascii_start();
    (rest.len() < text.len()).then_some(rest)
}

/// Reads three numbers in the most frequent form: each has few digits and follows blanks. Returns `None` for
/// text in another form, which [`tokens`] and [`number`] read.
pub(super) fn usual_vector(line: &[u8]) -> Option<[f32; 3]> {
    let mut values = [0.0; 3];
    let mut rest = line;
    for value in &mut values {
        (*value, rest) = leading_number(after_blanks(rest)?)?;
    }
    rest.is_empty().then_some(values)
}

/// Splits an index (a number of one to nine digits) off the beginning of a text. Returns `None` if the text
/// does not begin with a digit, or if the number is 0. If the number has more than nine digits, the returned
/// rest of the text begins with a digit.
pub(super) fn leading_index(text: &[u8]) -> Option<(u32, &[u8])> {
    // Numbers of nine digits fit into 32 bits, so no step needs a check for overflow.
    let (mut value, mut length) = (0, 0);
    for byte in text.iter().take(9).take_while(|byte| byte.is_ascii_digit()) {
        value = 10 * value + u32::from(byte - b'0');
        length += 1;
    }
    (value > 0).then(|| (value, &text[length..]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn short_numbers_are_what_the_standard_library_reads(text in "-?[0-9]{0,9}\\.?[0-9]{0,12}") {
            if let Some(value) = short_number(text.as_bytes()) {
                prop_assert_eq!(text.parse::<f32>().map(f32::to_bits), Ok(value.to_bits()));
            }
        }
    }

    proptest! {
        #[test]
        fn usual_vectors_are_the_numbers_of_the_words(line in "([ \\t]{1,2}-?[0-9]{0,8}\\.?[0-9]{0,4}){3}") {
            if let Some(vector) = usual_vector(line.as_bytes()) {
                let words: Vec<_> = tokens(line.as_bytes()).map(number).collect();
                prop_assert_eq!(words, vector.map(Some));
            }
        }
    }

    #[test]
    fn quotes_around_a_name_may_belong_to_it_or_not() {
        let paths: Vec<&str> = possible_paths("\"C:\\x\\a b.png\" # wood").collect();
        assert_eq!(paths[0], "\"C:\\x\\a b.png\" # wood");
        assert!(["C:\\x\\a b.png", "a b.png"].iter().all(|name| paths.contains(name)), "{paths:?}");
        for text in ["a b.png", "\"a.png", "\"\""] {
            assert_eq!(possible_paths(text).collect::<Vec<_>>(), unquoted_paths(text).collect::<Vec<_>>());
        }
    }

    #[test]
    fn only_three_short_numbers_after_blanks_are_a_usual_vector() {
        assert_eq!(usual_vector(b" 1 -2.5 .25"), Some([1.0, -2.5, 0.25]));
        assert_eq!(usual_vector(b"  1 2\t3"), Some([1.0, 2.0, 3.0]));
        let others = ["", "1 2 3", " 1 2", " 1 2 3 4", " 1 2 3 ", " 1 2 3#", " 1 2 3e1", " 1 2 12345678901"];
        for line in others {
            assert_eq!(usual_vector(line.as_bytes()), None, "{line}");
        }
    }

    #[test]
    fn what_is_no_short_number_is_left_to_the_standard_library() {
        for text in ["", "-", ".", "-.", "1e5", "+1", "--1", "1.2.3", "16777217", "0.00000000001", "nan"] {
            assert_eq!(short_number(text.as_bytes()), None, "{text}");
        }
        assert_eq!(short_number(b"-0.0321981"), Some(-0.032_198_1));
    }

    #[test]
    fn a_mistake_is_reported_by_the_form_that_its_line_should_have_if_it_may_not_be_quoted() {
        for (line, expected) in [
            ("vn x", "`vn x y z`: three finite numbers"),
            ("vt x", "`vt u v`: two finite numbers"),
            ("f x", "`f 1 2 3`: the numbers of three or more vertices that the file has"),
            ("newmtl", "`newmtl NAME`"),
            ("", "a mesh: vertices (`v x y z`) and faces (`f 1 2 3`)"),
        ] {
            // Some programs indent the statements of a group.
            for line in [line.to_owned(), format!("  {line}"), format!("\t{line}")] {
                let text = format!("# one\n{line}\nvn 0 0 1\n");
                let source = |quotes| Source { name: "a.obj", text: text.as_bytes(), quotes };
                let mistake = || Mistake::new(6, "`x` is wrong");
                let withheld = source(false).error(mistake());
                assert_eq!(withheld.to_string(), format!("a.obj:2: expected {expected}"));
                let note = format!("line 2: the line is not valid; expected {expected}");
                assert_eq!(source(false).note_of(&mistake()), note);
                let shown = source(true).error(mistake());
                assert_eq!(shown.to_string(), "a.obj:2: `x` is wrong");
                assert_eq!(shown.remedy(), format!("expected {expected}"));
                let Error::Input(shown) = shown else { panic!("not an input error") };
                assert_eq!(shown.span.map(|span| (span.offset(), span.len())), Some((6, line.len())));
            }
        }
    }

    #[test]
    fn a_comment_begins_at_a_word_and_certainly_at_a_word_of_one_character() {
        for (text, certain, shortest) in [
            ("red # walls", "red", "red"),
            ("red #2", "red #2", "red"),
            ("red #2 # walls", "red #2", "red"),
            ("red #\twalls", "red", "red"),
            ("a#b c# d", "a#b c# d", "a#b c# d"),
            ("#ff8800", "#ff8800", "#ff8800"),
            ("#1 # a", "#1", "#1"),
            ("# a", "", ""),
            ("#", "", ""),
            ("", "", ""),
        ] {
            assert_eq!(possible_names(text), [text, certain, shortest]);
        }
        let tokens: Vec<&[u8]> = name_tokens(b" -s 1 a #2.png # old #3.png").collect();
        assert_eq!(tokens, [&b"-s"[..], b"1", b"a", b"#2.png"]);
    }

    #[test]
    fn a_comment_may_begin_right_after_a_number() {
        for line in [" 1 2.5", " 1 2.5 # left", " 1 2.5# left", " 1 2.5#"] {
            let numbers: Vec<&[u8]> = tokens(line.as_bytes()).collect();
            assert_eq!(numbers, [&b"1"[..], b"2.5"], "{line}");
        }
    }

    #[test]
    fn infinities_and_nans_of_old_windows_programs_are_words_but_no_finite_numbers() {
        for word in ["1.#QNAN", "-1.#IND", "1.#INF00", "1.#snan0", "-1.#INFe+000"] {
            for line in [format!(" {word} 2"), format!("{word}\t2# left"), format!("{word} 2 #QNAN")] {
                let words: Vec<&[u8]> = tokens(line.as_bytes()).collect();
                assert_eq!(words, [word.as_bytes(), b"2"], "{line}");
            }
            assert_eq!(number(word.as_bytes()), None, "{word}");
        }
        for line in ["1.#INF# left", "1.#INF#INF", "1.#INF #left"] {
            assert_eq!(tokens(line.as_bytes()).collect::<Vec<_>>(), [b"1.#INF"], "{line}");
        }
        for line in ["1.# INF", "1.#left", "1.#", "1.#IN", "1.#2 2"] {
            assert_eq!(tokens(line.as_bytes()).collect::<Vec<_>>(), [b"1."], "{line}");
        }
        assert_eq!(tokens(b"2#INF 3").collect::<Vec<_>>(), [b"2"]);
    }

    #[test]
    fn only_characters_that_cannot_be_printed_are_escaped() {
        assert_eq!(quoted(b"C:\\a'b\"c"), "`C:\\a'b\"c`");
        assert_eq!(quoted(b"a\x1b[31m"), "`a\\u{1b}[31m`");
        assert_eq!(quoted_name("a\x1b[31m"), "`a\\u{1b}[31m`");
    }

    #[test]
    fn a_comma_instead_of_a_decimal_point_is_named() {
        for token in ["0,5", "-1,000000", "2,5e-3", ",5"] {
            let expected = format!("`{token}` (a comma instead of a decimal point)");
            assert_eq!(quoted_number(token.as_bytes()), expected);
        }
        for token in ["1,000,000", "1,000.5", ",", "a,b", "nan", "x"] {
            assert_eq!(quoted_number(token.as_bytes()), format!("`{token}`"));
        }
    }

    #[test]
    fn a_long_name_of_a_file_keeps_its_end_and_any_other_long_word_its_beginning() {
        let long = "a".repeat(100) + &"b".repeat(100);
        assert_eq!(quoted(long.as_bytes()), format!("`{}...`", "a".repeat(40)));
        // 40 characters of two bytes each, and 41 of them.
        assert_eq!(quoted("\u{e9}".repeat(40).as_bytes()), format!("`{}`", "\\u{e9}".repeat(40)));
        assert_eq!(quoted("\u{e9}".repeat(41).as_bytes()), format!("`{}...`", "\\u{e9}".repeat(40)));
        assert_eq!(quoted_name(&long), format!("`{long}`"));
        assert_eq!(quoted_name(&format!("{long}.png")), format!("`...{}.png`", &long[4..]));
    }

    #[test]
    fn the_first_of_several_offsets_is_kept() {
        let mut seen = [Seen::default(); 3];
        seen[1].at(7);
        seen[1].at(9);
        seen[2].at(20);
        let all = seen.into_iter().fold(Seen::default(), Seen::joined);
        assert_eq!((all.count, all.first), (3, 7));
    }

    #[test]
    fn pieces_are_whole_lines_and_none_is_lost() {
        let text = "0123456789abcde\n".repeat(CHUNK_BYTES / 4);
        let chunks = chunks(text.as_bytes());
        assert!(chunks.len() > 1, "the text is four times as long as the shortest piece");
        let mut end = 0;
        for chunk in &chunks {
            assert_eq!(chunk.start, end);
            end += chunk.bytes.len();
            assert!(
                chunk.bytes.ends_with(b"e\n")
                    && chunk.bytes.len() >= CHUNK_BYTES.min(text.len() - chunk.start)
            );
        }
        assert_eq!(end, text.len());
    }
}
