//! Splits source text into tokens. Blanks, line ends and comments are tokens too, so that the text's layout
//! is not lost.

/// The kind of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// An identifier or keyword.
    Name,
    /// A number in the sense of C's preprocessor, for example `0x1p-3f`.
    Number,
    /// A string literal or a character literal.
    Literal,
    /// An operator, a bracket, or any other character.
    Symbol,
    /// A run of blanks within a line.
    Space,
    /// A comment, in `/* */` or after `//`.
    Comment,
    /// The end of a line.
    NewLine,
    /// A backslash with the line end after it. In a macro's body, the text of this token is instead the
    /// indentation of the next line.
    Break,
    /// A mark in place of an empty expansion or an empty argument of a macro. A mark in place of an empty
    /// expansion shows that the line was changed.
    Nothing,
}

/// A piece of source text: a word, number, literal, operator, blank, comment or line end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Token {
    pub kind: Kind,
    pub text: String,
    /// The number of the line on which the token begins, counted from 1 in the whole text.
    pub line: u32,
    /// True if the token comes from a macro's expansion.
    pub made: bool,
    /// The names of the macros from which the token came. The preprocessor does not expand the token as a
    /// call of a macro in this list.
    pub hidden: Vec<String>,
}

impl Token {
    pub fn new(kind: Kind, text: impl Into<String>, line: u32) -> Self {
        Self { kind, text: text.into(), line, made: false, hidden: Vec::new() }
    }

    /// Returns true if the token is the operator or bracket `symbol`.
    pub fn is(&self, symbol: &str) -> bool {
        self.kind == Kind::Symbol && self.text == symbol
    }

    /// Returns true if the token is a name, a number, a literal or a symbol. A compiler ignores all other tokens,
    /// except that a line end is the end of a directive.
    pub fn is_code(&self) -> bool {
        matches!(self.kind, Kind::Name | Kind::Number | Kind::Literal | Kind::Symbol)
    }

    /// Returns true if the token is a comment that ends with its line.
    pub fn is_line_comment(&self) -> bool {
        self.kind == Kind::Comment && self.text.starts_with("//")
    }
}

/// Splits a text into tokens. The texts of all tokens, joined together, are the same text again.
pub(super) fn lex(text: &str) -> Vec<Token> {
    let mut tokens = Vec::new();
    let (mut rest, mut line) = (text, 1);
    while let Some(first) = rest.chars().next() {
        let (kind, length) = measure(rest, first);
        let (token, after) = rest.split_at(length);
        tokens.push(Token::new(kind, token, line));
        line += token.matches('\n').count() as u32;
        rest = after;
    }
    tokens
}

/// Returns a text's tokens except blanks, line ends and comments.
pub(super) fn code(text: &str) -> Vec<Token> {
    lex(text).into_iter().filter(Token::is_code).collect()
}

/// Returns the words of the pragma that `_Pragma` states in the string `string`. In the string, a backslash
/// precedes each quote and each backslash of the pragma.
pub(super) fn words_of_pragma(string: &str) -> String {
    let inner = string.strip_prefix('"').unwrap_or(string);
    let inner = inner.strip_suffix('"').unwrap_or(inner);
    inner.replace("\\\"", "\"").replace("\\\\", "\\")
}

/// Returns the kind and length in bytes of the first token of a text.
fn measure(text: &str, first: char) -> (Kind, usize) {
    let while_is = |belongs: fn(char) -> bool| text.find(|c| !belongs(c)).unwrap_or(text.len());
    let second_is_digit = text.chars().nth(1).is_some_and(|c| c.is_ascii_digit());
    match first {
        '\n' => (Kind::NewLine, 1),
        '\\' if text.starts_with("\\\n") => (Kind::Break, 2),
        '\\' if text.starts_with("\\\r\n") => (Kind::Break, 3),
        '/' if text.starts_with("//") => (Kind::Comment, line_length(text)),
        '/' if text.starts_with("/*") => {
            (Kind::Comment, text[2..].find("*/").map_or(text.len(), |at| at + 4))
        }
        '"' | '\'' => (Kind::Literal, literal_length(text, first)),
        _ if is_blank(first) => (Kind::Space, while_is(is_blank)),
        _ if first.is_ascii_digit() => (Kind::Number, number_length(text)),
        '.' if second_is_digit => (Kind::Number, number_length(text)),
        _ if is_of_name(first) => (Kind::Name, while_is(is_of_name)),
        _ => (Kind::Symbol, symbol_length(text, first)),
    }
}

fn is_blank(c: char) -> bool {
    c.is_whitespace() && c != '\n'
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Returns the length of the text up to the first line end that does not follow a backslash.
fn line_length(text: &str) -> usize {
    let ends = |&(at, _): &(usize, &str)| !text[..at].trim_end_matches('\r').ends_with('\\');
    text.match_indices('\n').find(ends).map_or(text.len(), |(at, _)| at)
}

/// Returns the length of a literal up to its closing quote, or up to the end of the line if the quote is not
/// closed.
fn literal_length(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            '\n' if !escaped => return at,
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            _ if c == quote => return at + c.len_utf8(),
            _ => {}
        }
    }
    text.len()
}

/// Returns the length of a number, which consists of digits, letters, points, and signs after an exponent's
/// letter.
fn number_length(text: &str) -> usize {
    let mut before = ' ';
    for (at, c) in text.char_indices() {
        let sign = "+-".contains(c) && "eEpP".contains(before);
        if !(is_of_name(c) || c == '.' || sign) {
            return at;
        }
        before = c;
    }
    text.len()
}

/// Operators with several characters, the longer ones first.
const SYMBOLS: &[&str] = &[
    "<<=", ">>=", "...", "->", "++", "--", "<<", ">>", "<=", ">=", "==", "!=", "&&", "||", "+=", "-=", "*=",
    "/=", "%=", "&=", "^=", "|=", "##",
];

fn symbol_length(text: &str, first: char) -> usize {
    SYMBOLS.iter().find(|symbol| text.starts_with(**symbol)).map_or(first.len_utf8(), |symbol| symbol.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(text: &str) -> Vec<String> {
        code(text).into_iter().map(|token| token.text).collect()
    }

    #[test]
    fn numbers_names_and_operators_are_told_apart() {
        let words = ["a", "+=", "0x1p-3f", "-", ".5e+2f", "<<=", "b", "->", "c", "[", "1", "]", ";"];
        assert_eq!(texts("a+=0x1p-3f-.5e+2f<<=b->c[1];"), words);
        assert_eq!(texts("\"a // \\\" b\" '\\'' // c\n/* d\n */ e"), ["\"a // \\\" b\"", "'\\''", "e"]);
    }

    #[test]
    fn a_backslash_at_either_kind_of_line_end_continues_a_line_comment() {
        assert_eq!(texts("a // b\nc"), ["a", "c"]);
        for end in ["\n", "\r\n"] {
            assert_eq!(texts(&format!("a // b \\{end}c\nd")), ["a", "d"], "{end:?}");
        }
    }

    #[test]
    fn tokens_know_their_lines() {
        let lines: Vec<_> = code("a /* b\n c */ d\ne").iter().map(|token| token.line).collect();
        assert_eq!(lines, [1, 2, 3]);
    }

    proptest::proptest! {
        #[test]
        fn any_text_is_the_sum_of_its_tokens(text in "[ -~\n\\\\\"'/*éµ]{0,80}") {
            let again: String = lex(&text).into_iter().map(|token| token.text).collect();
            proptest::prop_assert_eq!(again, text);
        }
    }
}
