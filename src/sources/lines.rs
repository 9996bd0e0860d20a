//! Splits a kernel file into lines and finds its directives as a compiler does: comments and strings hide them, and a
//! line that ends in a backslash or within a comment continues on the next line.

use crate::error::{Error, Result};

/// A line of a kernel file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceLine<'a> {
    /// Its text as written.
    pub text: &'a str,
    /// Its code without comments, after that of the lines that it continues; empty if the next line continues it.
    pub code: String,
    /// The file that it includes.
    pub includes: Option<&'a str>,
}

/// What a position in a file is within.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Within {
    Code,
    LineComment,
    BlockComment,
    /// A string or a character, with its quote.
    Literal(char),
}

/// Directives by which a compiler reads another file.
const READING: [&str; 3] = ["include", "import", "embed"];

/// Splits a file into lines; `name` is its name for messages. Refuses an `#include` in any form other than a line
/// `#include "FILE"`: only a compiler could resolve it, and it could name any file of the machine. Refuses a comment
/// without an end, which would hide the next file.
pub fn lines<'a>(name: &str, text: &'a str) -> Result<Vec<SourceLine<'a>>> {
    let (mut within, mut begun, mut continues) = (Within::Code, String::new(), false);
    let mut lines = Vec::new();
    for (number, text) in (1..).zip(text.lines()) {
        let spliced = text.ends_with('\\');
        begun += &within.code_of(text.strip_suffix('\\').unwrap_or(text));
        if !spliced && within != Within::BlockComment {
            within = Within::Code;
        }
        let continued = spliced || within == Within::BlockComment;
        let includes = included(text).filter(|_| !continues);
        if includes.is_none() && is_reading(&begun) {
            return Err(other_form(name, number));
        }
        let code = if continued { String::new() } else { std::mem::take(&mut begun) };
        lines.push(SourceLine { text, code, includes });
        continues = continued;
    }
    if within == Within::BlockComment {
        return Err(Error::input(format!("cl/{name}: the last comment has no end"))
            .with_help("close the comment with */ in the same file"));
    }
    if continues {
        // A backslash ends the file. The empty line keeps it away from the next file.
        lines.push(SourceLine { text: "", code: begun, includes: None });
    }
    Ok(lines)
}

/// Returns whether a line's code makes a compiler read another file. `%:` means `#`.
fn is_reading(code: &str) -> bool {
    let code = code.trim_start();
    let directive = code.strip_prefix('#').or_else(|| code.strip_prefix("%:")).map(str::trim_start);
    directive.is_some_and(|directive| READING.iter().any(|word| directive.starts_with(word)))
}

/// Returns the file that a line of the form `#include "FILE"` includes.
fn included(line: &str) -> Option<&str> {
    line.strip_prefix("#include \"").and_then(|rest| rest.split_once('"')).map(|(file, _)| file)
}

fn other_form(name: &str, number: usize) -> Error {
    Error::input(format!("cl/{name}, line {number}: raycl does not support this form of #include"))
        .with_help("write #include \"FOLDER/FILE.cl\" at the start of the line; paths are relative to cl/")
}

impl Within {
    /// Returns a line's code, with a blank for each comment, and goes on to the line's end.
    fn code_of(&mut self, line: &str) -> String {
        let mut code = String::new();
        let mut rest = line.chars().peekable();
        while let Some(c) = rest.next() {
            let next = rest.peek().copied();
            match (*self, c, next) {
                (Self::LineComment, ..) => return code,
                (Self::BlockComment, '*', Some('/')) => {
                    rest.next();
                    *self = Self::Code;
                }
                (Self::BlockComment, ..) => {}
                (Self::Code, '/', Some('/')) => *self = Self::LineComment,
                (Self::Code, '/', Some('*')) => {
                    rest.next();
                    *self = Self::BlockComment;
                    code.push(' ');
                }
                (Self::Code, ..) => {
                    code.push(c);
                    if c == '"' || c == '\'' {
                        *self = Self::Literal(c);
                    }
                }
                (Self::Literal(quote), ..) => {
                    code.push(c);
                    match c {
                        '\\' => code.extend(rest.next()),
                        _ if c == quote => *self = Self::Code,
                        _ => {}
                    }
                }
            }
        }
        code
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn includes(text: &str) -> Vec<&str> {
        lines("a.cl", text).unwrap().into_iter().filter_map(|line| line.includes).collect()
    }

    fn codes(text: &str) -> Vec<String> {
        lines("a.cl", text).unwrap().into_iter().map(|line| line.code.trim().to_owned()).collect()
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
        ] {
            assert!(includes(text).is_empty(), "{text}");
        }
        let after = ["it's // dead\n", "\"/*\"\n", "'\\'' /* \\ */\n", "/**/\n", "/*/ */\n", "\"\\\\\"\n"];
        for text in after {
            assert_eq!(includes(&format!("{text}#include \"b.cl\"\n")), ["b.cl"], "{text}");
        }
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
            let told = error.to_string().contains("does not support this form of #include");
            assert!(told && error.exit_code() == 2, "{text}: {error}");
        }
        let error = lines("a.cl", "x\n/* y\n// */ /* z").unwrap_err();
        assert_eq!(error.to_string(), "cl/a.cl: the last comment has no end");
    }

    #[test]
    fn a_directive_is_whole_on_its_last_line() {
        assert_eq!(codes("#if A /* why */\n#else// why"), ["#if A", "#else"]);
        assert_eq!(codes("#if A \\\n && B\nx"), ["", "#if A  && B", "x"]);
        assert_eq!(codes("#if A /* why\n*/ && B"), ["", "#if A   && B"]);
    }
}
