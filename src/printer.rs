//! Prints text from any source (names, contents of files, drivers' messages) to terminals and Markdown. All
//! text that raycl did not write itself must pass through this module. Control characters could move a
//! terminal's cursor, rename its window or forge lines of a log, and invisible characters could hide a
//! mistake. These characters are printed as escapes such as `\u001b`, which are also valid in strings of JSON.

use std::borrow::Cow;
use std::cell::Cell;
use std::fmt::Write as _;

/// Returns true if a character could control a terminal or mislead a reader. There are four kinds of such characters:
/// control characters other than line breaks and tabs, Unicode's separators of lines and paragraphs, characters that
/// change the direction of text, and invisible characters.
pub fn steers(c: char) -> bool {
    c.is_control() && c != '\n' && c != '\t' || formats(c)
}

/// Returns true if a character only formats text. The characters that only format text are Unicode's
/// separators of lines and paragraphs, most of its format characters (general category Cf), and some letters
/// and marks without a shape.
fn formats(c: char) -> bool {
    matches!(
        c,
        '\u{ad}' | '\u{34f}' | '\u{600}'..='\u{605}' | '\u{61c}' | '\u{6dd}' | '\u{70f}' | '\u{115f}'..='\u{1160}'
            | '\u{180b}'..='\u{180f}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}'
            | '\u{3164}' | '\u{feff}' | '\u{ffa0}' | '\u{fff9}'..='\u{fffb}' | '\u{1d173}'..='\u{1d17a}'
            | '\u{e0000}'..='\u{e007f}'
    )
}

/// Returns the text with control characters and invisible characters replaced by escapes such as `\u001b`. Line
/// breaks and tabs stay.
pub fn plain(text: &str) -> Cow<'_, str> {
    escaped(text, steers)
}

fn escaped(text: &str, refused: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&refused) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        match refused(c) {
            true => c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| {
                // Writing to a String cannot fail.
                let _ = write!(shown, "\\u{unit:04x}");
            }),
            false => shown.push(c),
        }
    }
    Cow::Owned(shown)
}

/// Returns the text for a single line: like [`plain`], but with line breaks and tabs replaced too.
pub fn line(text: &str) -> Cow<'_, str> {
    escaped(text, |c| steers(c) || c == '\n' || c == '\t')
}

/// Escapes text that raycl itself has coloured: like [`plain`], but colour codes (`ESC [ 1 ; 31 m`) stay. Text
/// of files, drivers or users must go through [`plain`] before raycl adds colours to it.
pub fn coloured(text: &str) -> Cow<'_, str> {
    if !text.contains(steers) {
        return Cow::Borrowed(text);
    }
    let (mut shown, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(at) = rest.find(steers) {
        shown.push_str(&rest[..at]);
        let length =
            colour(&rest[at..]).unwrap_or_else(|| rest[at..].chars().next().map_or(1, char::len_utf8));
        let piece = &rest[at..at + length];
        shown.push_str(if colour(piece).is_some() { piece.into() } else { plain(piece) }.as_ref());
        rest = &rest[at + length..];
    }
    Cow::Owned(shown + rest)
}

/// Returns the length in bytes of the colour code at the start of a text; `None` if the text does not begin
/// with a colour code.
fn colour(text: &str) -> Option<usize> {
    let inner = text.strip_prefix("\u{1b}[")?;
    let digits = inner.find(|c: char| !c.is_ascii_digit() && c != ';')?;
    inner[digits..].starts_with('m').then_some(2 + digits + 1)
}

/// Escapes text for one line of Markdown, so that none of its characters marks a heading, a link, HTML or the
/// end of a table's cell.
pub fn markdown(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in escaped(&text.replace(['\n', '\t'], " "), steers).chars() {
        if matches!(c, '\\' | '`' | '*' | '_' | '[' | ']' | '<' | '|' | '#' | '~' | '&' | '!') {
            shown.push('\\');
        }
        shown.push(c);
    }
    shown
}

thread_local! {
    /// True while [`tell`] prints nothing in this thread.
    static IS_MUTED: Cell<bool> = const { Cell::new(false) };
}

/// Calls `work`. Until `work` returns or panics, [`tell`] prints nothing in this thread.
pub(crate) fn muted<T>(work: impl FnOnce() -> T) -> T {
    /// The value that `IS_MUTED` had before the call of `muted`. `drop` restores this value.
    struct Before(bool);
    impl Drop for Before {
        fn drop(&mut self) {
            IS_MUTED.set(self.0);
        }
    }
    let _before = Before(IS_MUTED.replace(true));
    work()
}

/// Wraps `work`, which another thread will call. If this thread is muted now, [`tell`] prints nothing during `work`.
pub(crate) fn muted_as_here<T>(work: impl FnOnce() -> T) -> impl FnOnce() -> T {
    let is_muted = IS_MUTED.get();
    move || if is_muted { muted(work) } else { work() }
}

/// Prints a line to standard error, unless this thread is muted. If printing fails, the command continues.
pub fn tell(text: impl std::fmt::Display) {
    tell_to(&mut std::io::stderr(), text);
}

/// Prints a line to `out`, as [`tell`] prints it to standard error.
fn tell_to(out: &mut impl std::io::Write, text: impl std::fmt::Display) {
    if IS_MUTED.get() {
        return;
    }
    let _ = writeln!(out, "{}", coloured(&text.to_string()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_is_muted_until_the_work_ends_even_if_it_panics() {
        assert!(!IS_MUTED.get());
        assert!(muted(|| muted(|| true) && IS_MUTED.get()));
        assert!(!IS_MUTED.get());
        assert!(std::panic::catch_unwind(|| muted(|| -> u8 { panic!("in a test") })).is_err());
        assert!(!IS_MUTED.get());
    }

    #[test]
    fn a_muted_thread_tells_nothing() {
        let told = || {
            let mut out: Vec<u8> = Vec::new();
            tell_to(&mut out, "a note");
            out
        };
        assert_eq!((told(), muted(told)), (b"a note\n".to_vec(), Vec::new()));
    }

    #[test]
    fn another_thread_is_muted_as_the_thread_that_starts_it() {
        let of_another = || {
            let work = muted_as_here(|| IS_MUTED.get());
            std::thread::scope(|scope| scope.spawn(work).join().unwrap())
        };
        assert_eq!((of_another(), muted(of_another)), (false, true));
    }

    #[test]
    fn what_steers_a_terminal_is_shown_and_not_obeyed() {
        let hostile = "a\u{1b}]0;title\u{7}\r\u{9b}2J\u{202e}\u{7f}b\tc\nd";
        assert_eq!(plain(hostile), "a\\u001b]0;title\\u0007\\u000d\\u009b2J\\u202e\\u007fb\tc\nd");
        assert_eq!(line("a\nb"), "a\\u000ab");
        for harmless in ["", "naïve 8 x 8 µs", "a\n\tb"] {
            assert!(matches!(plain(harmless), Cow::Borrowed(_)), "{harmless}");
        }
    }

    #[test]
    fn characters_that_break_lines_or_are_invisible_are_shown() {
        let hidden = "a\u{2028}b\u{2029}c\u{feff}d\u{200b}e\u{ad}f\u{e0041}";
        let shown = "a\\u2028b\\u2029c\\ufeffd\\u200be\\u00adf\\udb40\\udc41";
        assert_eq!(plain(hidden), shown);
        assert_eq!((line(hidden).as_ref(), coloured(hidden).as_ref()), (shown, shown));
    }

    #[test]
    fn escapes_within_json_are_json() {
        let hidden = "a\u{1b}\u{9b}\u{7f}\u{202e}\u{2028}\u{e0041}";
        let text = serde_json::to_string(hidden).unwrap_or_default();
        let read: String = serde_json::from_str(&plain(&text)).unwrap_or_default();
        assert_eq!(read, hidden);
    }

    #[test]
    fn colours_of_the_program_stay() {
        let text = "\u{1b}[1;31mred\u{1b}[0m \u{1b}]0;x\u{7} \u{1b}[2J \u{1b}[";
        assert_eq!(coloured(text), "\u{1b}[1;31mred\u{1b}[0m \\u001b]0;x\\u0007 \\u001b[2J \\u001b[");
    }

    #[test]
    fn markdown_stands_for_itself() {
        assert_eq!(
            markdown("# a | b\n<img src=x> [l](u) *c* `d` \u{1b}"),
            "\\# a \\| b \\<img src=x> \\[l\\](u) \\*c\\* \\`d\\` \\\\u001b"
        );
        assert_eq!(markdown("~~a~~ _b_ &lt; ![c](d)"), "\\~\\~a\\~\\~ \\_b\\_ \\&lt; \\!\\[c\\](d)");
    }
}
