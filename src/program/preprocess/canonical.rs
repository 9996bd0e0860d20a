//! Converts preprocessed source texts to a canonical form, without differences that a compiler ignores, such as
//! comments and layout.

use super::token::{Kind, Token, code, lex, words_of_pragma};

/// Returns a preprocessed text without comments, with one blank between tokens and one statement per line.
/// Two texts that differ only in blanks, comments and the spelling of a pragma become equal.
pub fn canonical(text: &str) -> String {
    let tokens = lex(text);
    let mut lines = Lines::default();
    for line in tokens.split(|token| token.kind == Kind::NewLine) {
        let code: Vec<&Token> = line.iter().filter(|token| token.is_code()).collect();
        match &code[..] {
            [hash, rest @ ..] if hash.is("#") => lines.pragma(rest.iter().map(|token| token.text.as_str())),
            _ => lines.code(&code),
        }
    }
    lines.end();
    lines.text
}

#[derive(Default)]
struct Lines {
    text: String,
    line: Vec<String>,
    /// Number of open round brackets. Within round brackets, as in the head of a `for`, semicolons do not end a line.
    depth: i32,
}

impl Lines {
    fn end(&mut self) {
        if !self.line.is_empty() {
            self.text += &self.line.join(" ");
            self.text.push('\n');
            self.line.clear();
        }
    }

    fn code(&mut self, mut tokens: &[&Token]) {
        while let [token, after @ ..] = tokens {
            tokens = after;
            if let ("_Pragma", [_, what, _, rest @ ..]) = (token.text.as_str(), after) {
                let words = code(&format!("pragma {}", words_of_pragma(&what.text)));
                self.pragma(words.iter().map(|word| word.text.as_str()));
                tokens = rest;
                continue;
            }
            self.line.push(token.text.clone());
            match token.text.as_str() {
                "(" => self.depth += 1,
                ")" => self.depth -= 1,
                ";" | "{" | "}" if self.depth <= 0 => self.end(),
                _ => {}
            }
        }
    }

    fn pragma<'a>(&mut self, words: impl Iterator<Item = &'a str>) {
        self.end();
        self.line.push(format!("#{}", words.collect::<Vec<_>>().join(" ")));
        self.end();
    }
}
