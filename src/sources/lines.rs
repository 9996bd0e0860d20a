//! Splits a kernel file into lines and finds its directives as a compiler does: comments and strings hide
//! directives, and a line that ends in a backslash or within a block comment (`/* */`) continues on the next
//! line.

use crate::error::{Error, Result};

/// A line of a kernel file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceLine<'a> {
    /// The line's text as written.
    pub text: &'a str,
    /// The directive that ends on this line, without comments. Empty if no directive ends on this line.
    pub directive: String,
    /// The file that the line includes, if any.
    pub includes: Option<&'a str>,
}

/// The kind of text at a position in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Within {
    Code,
    LineComment,
    BlockComment,
    /// A string or character literal, which ends with the given quotation mark.
    Literal(char),
}

/// Directives by which a compiler reads another file.
const READING: [&str; 3] = ["include", "import", "embed"];

/// Splits a file into lines; `name` is its path for messages. Refuses `#import`, `#embed`, and any `#include`
/// that is not at the start of its line in the form `#include "FILE"`: a compiler would follow such a
/// directive, which can name any file of the machine. Refuses a block comment without an end, since it would
/// hide the files that are joined after this file. Refuses a carriage return within a line: compilers start a
/// new line at a carriage return, so compilers would give other numbers to later lines, in messages and in line
/// tables.
pub fn lines<'a>(name: &str, text: &'a str) -> Result<Vec<SourceLine<'a>>> {
    let (mut within, mut begun, mut continues) = (Within::Code, String::new(), false);
    let (mut lines, mut opened) = (Vec::new(), 1);
    for (number, text) in (1..).zip(text.lines()) {
        if text.contains('\r') {
            return Err(Error::input(format!("{name}, line {number}: this line contains a carriage return"))
                .with_help("save the file with the line ends of Linux or Windows"));
        }
        let spliced = text.ends_with('\\');
        // A block comment that is open at this line's end usually began on this line. The exception is a line
        // without `*/` at whose start the comment was already open.
        if within != Within::BlockComment || text.contains("*/") {
            opened = number;
        }
        within.add_code(text.strip_suffix('\\').unwrap_or(text), &mut begun);
        if !spliced && within != Within::BlockComment {
            within = Within::Code;
        }
        let continued = spliced || within == Within::BlockComment;
        let includes = included(text).filter(|_| !continues);
        if includes.is_none() && is_reading(&begun) {
            return Err(other_form(name, number));
        }
        // Nothing is allocated for a line that is not a directive, since most lines are no directives.
        let directive = if continued || !is_directive(&begun) { String::new() } else { begun.clone() };
        if !continued {
            begun.clear();
        }
        lines.push(SourceLine { text, directive, includes });
        continues = continued;
    }
    if within == Within::BlockComment {
        return Err(Error::input(format!("{name}, line {opened}: this comment has no end"))
            .with_help("close the comment with */ in the same file"));
    }
    if continues {
        // The file ends in a backslash, which joins the last line to the line after it. An empty line is
        // added after the last line, so that the backslash does not join the first line of the next file.
        lines.push(SourceLine { text: "", directive: begun, includes: None });
    }
    Ok(lines)
}

fn is_directive(code: &str) -> bool {
    code.trim_start().starts_with(['#', '%'])
}

/// Returns true if a line's code makes a compiler read another file. In C, `%:` is another spelling of `#`.
fn is_reading(code: &str) -> bool {
    let code = code.trim_start();
    let directive = code.strip_prefix('#').or_else(|| code.strip_prefix("%:")).map(str::trim_start);
    directive.is_some_and(|directive| READING.iter().any(|word| directive.starts_with(word)))
}

/// Returns the file that a line of the form `#include "FILE"` includes; `None` for any other line.
fn included(line: &str) -> Option<&str> {
    line.strip_prefix("#include \"").and_then(|rest| rest.split_once('"')).map(|(file, _)| file)
}

fn other_form(name: &str, number: usize) -> Error {
    Error::input(format!("{name}, line {number}: raycl does not support this form of #include"))
        .with_help("write #include \"FOLDER/FILE.cl\" at the start of the line; the path is relative to cl/ or to the folder of --cl-dir")
}

impl Within {
    /// Adds a line's code to `code`, with a blank for each block comment. Sets `self` to the kind of text
    /// (such as code or a comment) at the line's end.
    fn add_code(&mut self, line: &str, code: &mut String) {
        let mut rest = line;
        while !rest.is_empty() {
            rest = match self {
                Self::LineComment => return,
                Self::BlockComment => match rest.split_once("*/") {
                    Some((_, after)) => {
                        *self = Self::Code;
                        after
                    }
                    None => return,
                },
                Self::Code => self.leave_code(rest, code),
                Self::Literal(quote) => {
                    let end = [*quote, '\\'];
                    let Some(at) = rest.find(end) else { return code.push_str(rest) };
                    // Within a literal, the character after a backslash does not end the literal.
                    let escapes = rest[at..].starts_with('\\');
                    let hidden = rest[at + 1..].chars().next().filter(|_| escapes);
                    if !escapes {
                        *self = Self::Code;
                    }
                    let (literal, after) = rest.split_at(at + 1 + hidden.map_or(0, char::len_utf8));
                    code.push_str(literal);
                    after
                }
            };
        }
    }

    /// Adds the code before the next comment or literal to `code`, sets `self` to the kind of text that
    /// follows, and returns the text that remains to be read. (Also stops after a `/` that begins no comment;
    /// `self` is then still `Code`.)
    fn leave_code<'a>(&mut self, text: &'a str, code: &mut String) -> &'a str {
        let Some(at) = text.find(['/', '"', '\'']) else {
            code.push_str(text);
            return "";
        };
        let (before, from) = text.split_at(at);
        code.push_str(before);
        if let Some(comment) = from.strip_prefix("/*") {
            *self = Self::BlockComment;
            code.push(' ');
            return comment;
        }
        if from.starts_with("//") {
            *self = Self::LineComment;
            return "";
        }
        let (first, after) = from.split_at(1);
        code.push_str(first);
        if let Some(quote) = first.chars().next().filter(|first| *first != '/') {
            *self = Self::Literal(quote);
        }
        after
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn includes(text: &str) -> Vec<&str> {
        lines("a.cl", text).unwrap().into_iter().filter_map(|line| line.includes).collect()
    }

    fn directives(text: &str) -> Vec<String> {
        lines("a.cl", text).unwrap().into_iter().map(|line| line.directive.trim().to_owned()).collect()
    }

    #[test]
    fn an_include_in_a_comment_or_a_string_is_none() {
        let own = "#include \"b.cl\"\n#include \"c.cl\" // why\n#include \"d.cl\" /* why */";
        assert_eq!(includes(own), ["b.cl", "c.cl", "d.cl"]);
        for text in [
            "// #include \"b.cl\"\n",
            "// why \\\n#include \"b.cl\"\n",
            "/* why\n#include \"b.cl\"\n*/\n",
            "/* \" */ x /* // */ /*\n#include \"b.cl\"\n*/\n",
            "\"text \\\n#include \\\"b.cl\\\" \"\n",
            "\"text \\\\\n#include \\\"b.cl\\\" \"\n",
            "\"\\\\\" /*\n#include \"b.cl\"\n*/\n",
            "\"text\"/*\n#include \"b.cl\"\n*/\n",
        ] {
            assert!(includes(text).is_empty(), "{text}");
        }
        let after = ["it's // dead\n", "\"/*\"\n", "'\\'' /* \\ */\n", "/**/\n", "/*/ */\n", "\"\\\\\"\n"];
        for text in after {
            assert_eq!(includes(&format!("{text}#include \"b.cl\"\n")), ["b.cl"], "{text}");
        }
        // The character after a backslash may have several bytes in UTF-8.
        assert_eq!(includes("\"\\é\" /*\n*/\n#include \"b.cl\"\n"), ["b.cl"]);
    }

    #[test]
    fn lines_end_in_any_way() {
        for text in ["#include \"b.cl\"\nx\n", "#include \"b.cl\"\r\nx\r\n", "#include \"b.cl\"\nx"] {
            let texts: Vec<_> = lines("a.cl", text).unwrap().into_iter().map(|line| line.text).collect();
            assert_eq!((includes(text), texts), (vec!["b.cl"], vec!["#include \"b.cl\"", "x"]));
        }
        let texts: Vec<_> = lines("a.cl", "x \\").unwrap().into_iter().map(|line| line.text).collect();
        assert_eq!(texts, ["x \\", ""]);
        assert!(lines("a.cl", "").unwrap().is_empty());
    }

    #[test]
    fn a_carriage_return_within_a_line_is_refused() {
        for (text, line) in [("/* a\rb */\n", 1), ("a\nb\r\r\n", 2), ("a\r", 1), ("a\n\rb", 2)] {
            let error = lines("a.cl", text).unwrap_err();
            let expected = format!("a.cl, line {line}: this line contains a carriage return");
            assert_eq!((error.to_string(), error.exit_code()), (expected, 2), "{text:?}");
        }
    }

    #[test]
    fn an_include_in_any_other_form_is_refused() {
        for text in [
            "# include \"b.cl\"",
            "#include <b.cl>",
            "#include \"b.cl",
            "/* why */ #include \"b.cl\"",
            "# /* why\n*/ include \"b.cl\"",
            "#\\\ninclude \"b.cl\"",
            "#inc\\\nlude \"b.cl\"",
            "#include \"b.cl\" /* why\n*/",
            "#import \"b.cl\"",
            "%:include \"b.cl\"",
        ] {
            let error = lines("a.cl", text).unwrap_err();
            let is_named = error.to_string().contains("does not support this form of #include");
            assert!(is_named && error.exit_code() == 2, "{text}: {error}");
        }
        let error = lines("cl/a.cl", "x\n# include \"b.cl\"").unwrap_err();
        assert!(error.to_string().starts_with("cl/a.cl, line 2: raycl does not"), "{error}");
    }

    #[test]
    fn a_comment_without_an_end_has_the_line_of_its_start() {
        for (text, line) in [
            ("x\n/* y\n// */ /* z", 3),
            ("x\n/* y\nz\n\n", 2),
            ("/* x\n*/\n/* y\n/* z\n", 3),
            ("/* x */ /* y\n", 1),
        ] {
            let error = lines("a.cl", text).unwrap_err();
            assert_eq!(error.to_string(), format!("a.cl, line {line}: this comment has no end"));
            assert_eq!(error.remedy(), "close the comment with */ in the same file");
        }
    }

    #[test]
    fn a_directive_is_whole_on_its_last_line() {
        assert_eq!(directives("#if A /* why */\n#else// why"), ["#if A", "#else"]);
        assert_eq!(directives("#if A \\\n && B\nx"), ["", "#if A  && B", ""]);
        assert_eq!(directives("#if A /* why\n*/ && B"), ["", "#if A   && B"]);
    }
}
