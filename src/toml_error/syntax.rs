//! The most common syntax mistakes in TOML, in plain words. A mistake is recognised by the text at which the
//! parser stopped. The message of the crate `toml` does not matter, except the message about a key or a table
//! that occurs twice.

use crate::error::line_of;
use std::ops::Range;
use toml::de::DeTable;

/// A message about a mistake, and its remedy.
type Answer = (String, String);

/// The whole message of the crate `toml` about a key or a table that occurs twice.
const TWICE: &str = "duplicate key";

/// Returns the message about a common syntax mistake, and its remedy. Returns `None` for any other mistake, and if
/// `text` is TOML. `error` is the parser's error about `text`.
pub fn syntax(error: &toml::de::Error, text: &str) -> Option<Answer> {
    let span = error.span()?;
    if DeTable::parse(text).is_ok() {
        return None;
    }
    if error.message().trim_end() == TWICE {
        return twice(text, span);
    }
    Place::of(text, span.start)?.answer()
}

/// The place at which the parser stopped.
struct Place<'t> {
    text: &'t str,
    /// The byte at which the parser stopped.
    at: usize,
    /// The byte at which the line of `at` begins.
    begin: usize,
    /// The line of `at`.
    line: &'t str,
}

impl<'t> Place<'t> {
    fn of(text: &'t str, at: usize) -> Option<Self> {
        let begin = text.get(..at)?.rfind('\n').map_or(0, |end| end + 1);
        let line = text[begin..].lines().next().unwrap_or_default();
        Some(Self { text, at, begin, line })
    }

    fn answer(&self) -> Option<Answer> {
        let above = Open::at_end_of(&self.text[..self.begin]);
        if let Some(quote) = above.quote {
            return unclosed_quote(self.text, quote);
        }
        let is_inside = !above.brackets.is_empty();
        self.unquoted()
            .or_else(|| self.unquoted_colour())
            .or_else(|| self.unclosed_quote())
            .or_else(|| if is_inside { None } else { self.header() })
            .or_else(|| self.unclosed_bracket())
            .or_else(|| if is_inside { None } else { self.statement() })
    }

    /// Returns the answer if the parser stopped at a text without quotes in the place of a value.
    fn unquoted(&self) -> Option<Answer> {
        let rest = self.text[self.at..].split([',', ']', '}', '#', '\n']).next()?;
        let word = rest.trim().trim_end_matches(['"', '\'']);
        let begins_text = word.starts_with(|first: char| first.is_alphabetic() || "./~_\\".contains(first));
        // Rust also parses numbers that TOML writes in another way, such as `.5e-3` and `NaN`. Such numbers need no
        // quotes.
        let is_number = word.parse::<f64>().is_ok();
        if !begins_text || !word.contains(char::is_alphabetic) || is_number || !self.is_at_value() {
            return None;
        }
        let (no_value, lower) = (format!("`{word}` is not a value"), word.to_lowercase());
        Some(match lower.as_str() {
            "true" | "false" => (no_value, format!("write {lower}, in lower case")),
            "yes" | "on" => (no_value, "write true".to_owned()),
            "no" | "off" => (no_value, "write false".to_owned()),
            _ => (format!("the text `{word}` is not in quotes"), format!("write \"{word}\"")),
        })
    }

    /// Returns the answer if the parser stopped at a colour without quotes, such as `#203040`, in the place of a value.
    fn unquoted_colour(&self) -> Option<Answer> {
        let digits = self.text[self.at..].trim_start_matches([' ', '\t']).strip_prefix('#')?;
        let end = digits.find(|c: char| !c.is_alphanumeric()).unwrap_or(digits.len());
        let digits = &digits[..end];
        let is_colour = !digits.is_empty() && digits.chars().all(|c| c.is_ascii_hexdigit());
        (is_colour && self.is_at_value()).then(|| {
            let message = format!("the text `#{digits}` is not in quotes, so `#` begins a comment");
            (message, format!("write \"#{digits}\""))
        })
    }

    /// Returns true if a value must begin where the parser stopped: after `=`, or in a list after `[` or a comma.
    fn is_at_value(&self) -> bool {
        let before = &self.text[..self.at];
        let open = Open::at_end_of(before);
        let is_in_list = open.brackets.last().is_some_and(|&bracket| self.is_list(bracket));
        open.quote.is_none()
            && match before.trim_end().chars().next_back() {
                Some('=') => true,
                Some('[' | ',') => is_in_list,
                _ => false,
            }
    }

    fn is_list(&self, bracket: usize) -> bool {
        self.text.as_bytes().get(bracket) == Some(&b'[')
    }

    /// Returns the answer if the line has a quote that nothing closes. If the parser stopped before this quote, the
    /// quote is not the mistake: in `'it's'`, the mistake is the second quote, which ends the text too early.
    fn unclosed_quote(&self) -> Option<Answer> {
        let end = self.begin + self.line.len();
        let quote = Open::at_end_of(&self.text[..end]).quote.filter(|quote| *quote <= self.at)?;
        unclosed_quote(self.text, quote)
    }

    /// Returns the answer if the line begins a table, but its brackets do not match.
    fn header(&self) -> Option<Answer> {
        let line = without_comment(self.line).trim();
        let name = line.trim_start_matches('[').trim_end_matches(']').trim();
        let opening = line.len() - line.trim_start_matches('[').len();
        let closing = line.len() - line.trim_end_matches(']').len();
        let is_name = !name.is_empty() && name.chars().all(is_of_key);
        (opening != closing && is_name).then(|| {
            let remedy = format!("write [{name}] for a table, or [[{name}]] for an element of a list");
            (format!("the brackets in `{line}` do not match"), remedy)
        })
    }

    /// Returns the answer if a list or an inline table is still open where the next key or table begins, or at the end
    /// of the text.
    fn unclosed_bracket(&self) -> Option<Answer> {
        let bracket = *Open::at_end_of(&self.text[..self.at]).brackets.last()?;
        let goes_on = self.text[..self.at].trim_end().ends_with(',') && !self.is_list(bracket);
        let is_next = bracket < self.begin && begins_statement(self.line) && !goes_on;
        if !is_next && !self.text[self.at..].trim().is_empty() {
            return None;
        }
        let (open, close, what) =
            if self.is_list(bracket) { ('[', ']', "list") } else { ('{', '}', "table") };
        let line = line_of(self.text, bracket);
        let message = format!("the bracket `{open}` in line {line} is not closed");
        Some((message, format!("write `{close}` where the {what} ends")))
    }

    /// Returns the answer if the line has a key, but no `=` or no value.
    fn statement(&self) -> Option<Answer> {
        let (key, rest) = key_and_rest(self.line);
        let message = match without_comment(rest).trim() {
            "" | "=" => format!("the key `{key}` has no value"),
            rest if rest.starts_with(':') => "`:` in place of `=`".to_owned(),
            rest if !rest.contains('=') => format!("`=` is missing after the key `{key}`"),
            _ => return None,
        };
        (!key.is_empty()).then(|| (message, format!("write `{key} = ...`")))
    }
}

/// Returns the answer about a quote that nothing closes, at the byte `quote`; `None` if the quote begins a text
/// of several lines.
fn unclosed_quote(text: &str, quote: usize) -> Option<Answer> {
    let mark = text.get(quote..=quote)?;
    (!text[quote..].starts_with(&mark.repeat(3))).then(|| {
        let message = format!("the text in line {} has no closing quote", line_of(text, quote));
        (message, format!("write {mark} at the end of the text"))
    })
}

/// Returns the answer about a key or a table that occurs twice; `span` is the range of the second one's name.
fn twice(text: &str, span: Range<usize>) -> Option<Answer> {
    let Place { begin, line, .. } = Place::of(text, span.start)?;
    let (above, name) = (&text[..begin], text.get(span)?);
    let (header, key) = (header_of(line), key_and_rest(line).0);
    let first = match &header {
        Some(header) => above.lines().position(|line| header_of(line).as_ref() == Some(header)),
        // A key of the same name in another table is not the same key. If the key is in an inline table, its
        // line begins with another key; the first of the two equal keys is then not searched for.
        None if key.ends_with(name) => above
            .lines()
            .enumerate()
            .collect::<Vec<_>>()
            .into_iter()
            .rev()
            .take_while(|(_, line)| header_of(line).is_none())
            .find(|(_, line)| key_and_rest(line).0 == key)
            .map(|(index, _)| index),
        None => None,
    };
    let place = first.map_or(String::new(), |index| format!("the first is in line {}: ", index + 1));
    Some(match (header, first) {
        (Some(header), Some(_)) => {
            let path = header.trim_matches(['[', ']']);
            let remedy = format!("{place}join the two, or write [[{path}]] for each element of a list");
            (format!("the table {header} occurs twice"), remedy)
        }
        _ => (format!("the key `{name}` occurs twice"), format!("{place}remove one of the two")),
    })
}

/// Returns a line that begins a table, without blanks and comments; `None` for another line.
fn header_of(line: &str) -> Option<String> {
    let line = without_comment(line).replace([' ', '\t'], "");
    line.starts_with('[').then_some(line)
}

fn without_comment(line: &str) -> &str {
    line.split('#').next().unwrap_or_default()
}

/// Returns true if a key without quotes, or several such keys joined by dots, may contain the character.
fn is_of_key(character: char) -> bool {
    character.is_ascii_alphanumeric() || matches!(character, '_' | '-' | '.')
}

/// Returns the key with which a line begins, and the rest of the line; the key is empty if the line begins otherwise.
fn key_and_rest(line: &str) -> (&str, &str) {
    let line = line.trim_start();
    let end = line.find(|character| !is_of_key(character)).unwrap_or(line.len());
    (&line[..end], line[end..].trim())
}

/// Returns true if a line begins with a key and `=`, or begins a table.
fn begins_statement(line: &str) -> bool {
    let (key, rest) = key_and_rest(line);
    let header = header_of(line).filter(|header| header.ends_with(']')).unwrap_or_default();
    let name = header.trim_matches(['[', ']']);
    // A line such as `[1.5]` may be an element of a list.
    let is_header = name.starts_with(char::is_alphabetic) && name.chars().all(is_of_key);
    is_header || !key.is_empty() && rest.starts_with('=')
}

/// The quote and the brackets that are open at the end of a text.
#[derive(Default)]
struct Open {
    /// The positions, in bytes, of the brackets that are not closed, outermost first.
    brackets: Vec<usize>,
    /// The position, in bytes, of the first quote that nothing closes. The text after this quote was not read.
    quote: Option<usize>,
}

impl Open {
    fn at_end_of(text: &str) -> Self {
        let mut open = Self::default();
        let mut at = 0;
        while let Some(byte) = text.as_bytes().get(at) {
            at += match byte {
                b'"' | b'\'' => match quoted_bytes(&text[at..]) {
                    Some(count) => count,
                    None => return Self { quote: Some(at), ..open },
                },
                b'#' => text[at..].find('\n').unwrap_or(text.len() - at),
                b'[' | b'{' => {
                    open.brackets.push(at);
                    1
                }
                b']' | b'}' => {
                    open.brackets.pop();
                    1
                }
                _ => 1,
            };
        }
        open
    }
}

/// Returns the number of bytes of the quoted text with which `text` begins; `None` if nothing closes the quote.
fn quoted_bytes(text: &str) -> Option<usize> {
    let (quote, after) = text.split_at_checked(1)?;
    let of_lines = quote.repeat(3);
    if let Some(after) = text.strip_prefix(&of_lines) {
        return Some(after.find(&of_lines)? + 2 * of_lines.len());
    }
    let mut is_escaped = false;
    let end = after.lines().next()?.bytes().position(|byte| {
        let closes = byte == quote.as_bytes()[0] && !is_escaped;
        is_escaped = byte == b'\\' && !is_escaped && quote == "\"";
        closes
    })?;
    Some(end + 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the answer about a text that is not TOML.
    fn of(text: &str) -> Option<Answer> {
        syntax(&DeTable::parse(text).expect_err("this is TOML"), text)
    }

    #[track_caller]
    fn says(text: &str, message: &str, remedy: &str) {
        assert_eq!(of(text), Some((message.to_owned(), remedy.to_owned())), "{text}");
    }

    #[test]
    fn a_missing_quote_is_named_with_its_line() {
        let closing = "write \" at the end of the text";
        says("x = 1\nmesh = \"a.obj\ny = 2\n", "the text in line 2 has no closing quote", closing);
        says("x = \"a\\\" b\ny = 2\n", "the text in line 1 has no closing quote", closing);
        says("x = [\"naive, bvh]\ny = 1\n", "the text in line 1 has no closing quote", closing);
        says("x = 'abc\"\n", "the text in line 1 has no closing quote", "write ' at the end of the text");
        for (text, word) in [
            ("mesh = models/a.obj # ours\n", "models/a.obj"),
            ("mesh = ./a.obj\n", "./a.obj"),
            ("mesh = a.obj\"\n", "a.obj"),
            ("x = [naive, bvh]\n", "naive"),
            ("x = { a = abc }\n", "abc"),
        ] {
            says(text, &format!("the text `{word}` is not in quotes"), &format!("write \"{word}\""));
        }
    }

    #[test]
    fn a_truth_value_in_other_words_is_answered_with_that_of_toml() {
        for (word, remedy) in [
            ("True", "write true, in lower case"),
            ("yes", "write true"),
            ("On", "write true"),
            ("NO", "write false"),
            ("off", "write false"),
        ] {
            says(&format!("x = {word}\n"), &format!("`{word}` is not a value"), remedy);
        }
    }

    #[test]
    fn a_colour_that_the_parser_takes_for_a_comment_is_answered_with_quotes() {
        for text in ["x = #203040\n", "x =#203040 # ours\n", "x = { a = #203040, b = 1 }\n"] {
            let message = "the text `#203040` is not in quotes, so `#` begins a comment";
            says(text, message, "write \"#203040\"");
        }
    }

    #[test]
    fn a_key_without_an_equals_sign_or_a_value_is_named() {
        says("mesh \"a.obj\"\n", "`=` is missing after the key `mesh`", "write `mesh = ...`");
        for text in ["position: [0, 0, 1]\n", "position : 1\n"] {
            says(text, "`:` in place of `=`", "write `position = ...`");
        }
        for text in ["mesh\n", "mesh =\n", "mesh = # none\n", "mesh = #none\n"] {
            says(text, "the key `mesh` has no value", "write `mesh = ...`");
        }
    }

    #[test]
    fn a_bracket_that_is_not_closed_is_named_with_its_line() {
        let message = "the bracket `[` in line 2 is not closed";
        for text in
            ["1\n", "1", "1\nfov = 3\n", "1,\nfov = 3\n", "1\n\n[light]\npower = 1\n", "\n1,\n2\nfov = 3\n"]
        {
            says(&format!("x = 1\ny = [0, {text}"), message, "write `]` where the list ends");
        }
        let message = "the bracket `{` in line 1 is not closed";
        for text in ["x = { a = 1\n", "x = { a = 1\ny = 2\n"] {
            says(text, message, "write `}` where the table ends");
        }
        for line in ["[camera", "[camera]]", "[[camera]", "[[camera # ours"] {
            let message = format!("the brackets in `{}` do not match", without_comment(line).trim());
            let remedy = "write [camera] for a table, or [[camera]] for an element of a list";
            says(&format!("x = 1\n{line}\nfov = 3\n"), &message, remedy);
        }
    }

    #[test]
    fn a_key_or_a_table_that_occurs_twice_is_named_with_the_first_ones_line() {
        let first = |line: u32| format!("the first is in line {line}: remove one of the two");
        says("[a]\nx = 1\n[b]\ny = 1\nx = 2\nx = 3\n", "the key `x` occurs twice", &first(5));
        says("a.b = 1\na.b = 2\n", "the key `b` occurs twice", &first(1));
        says("x = { a = 1, a = 2 }\n", "the key `a` occurs twice", "remove one of the two");
        let remedy = "the first is in line 1: join the two, or write [[light]] for each element of a list";
        says("[light] # One.\nx = 1\n[ light ]\nx = 2\n", "the table [light] occurs twice", remedy);
        says("light = 1\n[light]\n", "the key `light` occurs twice", "remove one of the two");
    }

    #[test]
    fn other_mistakes_and_texts_of_several_lines_have_no_answer() {
        for text in [
            "x = \"\"\"\nsome words \\q\n\"\"\"\n",
            "x = \"a, \\q\"\n",
            "x = \"a\" \"b\"\n",
            "x = 1,5\n",
            "x = [0 0 1]\n",
            "x = .5e-3\n",
            "x = NaN\n",
            "x = Infinity\n",
            "x = 'it's.obj'\n",
            "x = \"a 3\" pipe.obj\"\n",
            "x = [\n'it's.obj',\n'b'\n]\n",
        ] {
            assert_eq!(of(text), None, "{text}");
        }
        let mistyped = toml::from_str::<std::collections::BTreeMap<String, u8>>("x = 'a'\n");
        assert_eq!(syntax(&mistyped.expect_err("a mistake"), "x = 'a'\n"), None, "this is TOML");
    }
}
