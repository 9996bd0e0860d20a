//! Preprocesses a kernel's source as its compiler would: decides the conditions, expands the macros, and
//! removes all directives except `#pragma`. A line of code without macro calls stays unchanged, unless it
//! continues a statement in which a macro was expanded.
//!
//! Unlike a compiler's own preprocessor (`cc -E`), this preprocessor keeps what helps a reader: comments on
//! the remaining code, indentation, each line's file and number, and the lines of a multi-line macro. If a
//! constant replaces a macro, the macro's name follows as a comment. This preprocessor supports all
//! directives of C99 except `#include`, and macros with a fixed number of arguments; raycl's kernels need no more.
//! Before preprocessing, `source.rs` replaces each `#include` by the file's text.

mod breaking;
mod canonical;
mod condition;
mod expand;
mod layout;
mod macros;
mod reading;
mod substitute;
#[cfg(test)]
mod tests;
mod token;
mod value;

pub use canonical::canonical;
pub use layout::Line;
pub use reading::{Reading, read};
pub use value::Value;

use crate::error::{Error, Result};
use condition::Compiler;
use expand::expand;
use layout::Layout;
use macros::Macros;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use token::{Kind, Token, lex};

/// A preprocessed text.
#[derive(Clone, Debug)]
pub struct Preprocessed {
    /// The lines that remain after preprocessing.
    pub lines: Vec<Line>,
    /// The questions of conditions that neither the text nor the caller answers: `defined(NAME)`,
    /// `__has_builtin(NAME)`, or the name of a macro whose value a condition uses. The preprocessor has taken 0 as the
    /// answer. A caller can ask the compiler, and preprocess the text again with the compiler's answers.
    pub asked: Vec<String>,
    /// The files named by `#line`, in order, except files that are named only in branches that are not
    /// compiled.
    pub files: Vec<String>,
}

impl Preprocessed {
    /// Returns the lines as one text. If `asked` is empty, this text compiles to the same program as the source.
    pub fn text(&self) -> String {
        self.lines.iter().flat_map(|line| [line.text.as_str(), "\n"]).collect()
    }

    /// Returns the names, and texts such as `__has_builtin(NAME)`, that the preprocessor has treated as undefined.
    pub fn undefined(&self) -> BTreeSet<&str> {
        self.asked.iter().map(|asked| subject(asked)).collect()
    }
}

/// Returns the name in the question `defined(NAME)`, and any other question as it is.
fn subject(asked: &str) -> &str {
    let name = asked.strip_prefix("defined(").and_then(|name| name.strip_suffix(')'));
    name.unwrap_or(asked)
}

/// Preprocesses a text with the `-D NAME=VALUE` options of a compiler. `given` contains the compiler's answers to
/// questions of conditions ([`Preprocessed::asked`]). The compiler's own macros are expanded only in conditions, such
/// as `#if`.
///
/// Mistakes in the text are reported as errors of the user, such as an `#error` that is reached, an unknown directive,
/// an invalid condition, an `#if` without `#endif`, and a wrong definition or use of a macro.
pub fn preprocess(source: &str, options: &str, given: &BTreeMap<String, Value>) -> Result<Preprocessed> {
    let mut run = Preprocessor::new(given);
    for option in defines(options) {
        run.macros
            .define_option(option)
            .map_err(|message| Error::input(format!("-D {option}: {message}")))?;
    }
    let tokens = lex(source);
    for line in tokens.split_inclusive(|token| token.kind == Kind::NewLine) {
        run.line(line)?;
    }
    run.finish()
}

/// Returns the definitions of `-D` options, such as `A=1` for `-D A=1` and for `-DA=1`.
fn defines(options: &str) -> Vec<&str> {
    let mut words = options.split_whitespace();
    let mut defines = Vec::new();
    while let Some(word) = words.next() {
        match word.strip_prefix("-D") {
            Some("") => defines.extend(words.next()),
            Some(define) => defines.push(define),
            None => {}
        }
    }
    defines
}

/// An `#if` whose `#endif` has not been reached.
struct Branch {
    /// True if the current branch is compiled.
    live: bool,
    /// True if a branch of the `#if` is or was compiled, so that no further branch is compiled.
    decided: bool,
    /// True if the text around the `#if` is compiled.
    around: bool,
    /// True if the current branch is that of the `#else`, so that no branch follows.
    is_last: bool,
    /// The file and the line of the `#if`.
    position: Position,
}

/// The position of a line: the source file, and the line's number in this file.
#[derive(Clone, Debug)]
struct Position {
    file: Rc<str>,
    /// The number of the line in the file.
    line: i64,
}

/// The advice in an error about an `#error` or a condition. The line with the error may require another value
/// of a macro.
const VALUES: &str = "if the line requires another value of a macro, set this value with --local-size or with an axis, such as \
    width=4; otherwise correct this line of the file in the folder of --cl-dir";
/// The advice in an error about a line other than an `#error` or a condition.
const CORRECT: &str = "correct this line of the file in the folder of --cl-dir";
/// The advice in an error about an `#if` without `#endif`.
const CLOSE: &str = "close the #if with #endif in the same file, in the folder of --cl-dir";

impl Position {
    fn mistake(&self, message: impl std::fmt::Display) -> Error {
        let file = if self.file.is_empty() { "the text" } else { &self.file };
        Error::input(format!("{file}, line {}: {message}", self.line))
    }
}

struct Preprocessor {
    macros: Macros,
    compiler: Compiler,
    branches: Vec<Branch>,
    file: Rc<str>,
    files: Vec<String>,
    /// The difference between a line's number in its file and the line's number in the whole text.
    offset: i64,
    /// The tokens since the last directive; empty if they are in a branch that is not compiled.
    text: Vec<Token>,
    layout: Layout,
}

impl Preprocessor {
    fn new(given: &BTreeMap<String, Value>) -> Self {
        Self {
            macros: Macros::default(),
            compiler: Compiler { given: given.clone(), ..Compiler::default() },
            branches: Vec::new(),
            file: "".into(),
            files: Vec::new(),
            offset: 0,
            text: Vec::new(),
            layout: Layout::default(),
        }
    }

    fn is_live(&self) -> bool {
        self.branches.last().is_none_or(|branch| branch.live)
    }

    /// Returns the position in the current file of the line that has the number `line` in the whole text. The
    /// line must belong to the current file.
    fn position_of(&self, line: u32) -> Position {
        Position { file: Rc::clone(&self.file), line: i64::from(line) + self.offset }
    }

    fn mistake(&self, line: u32, message: impl std::fmt::Display) -> Error {
        self.position_of(line).mistake(message).with_help(CORRECT)
    }

    fn line(&mut self, line: &[Token]) -> Result<()> {
        let first = line.iter().position(Token::is_code);
        match first.filter(|first| line[*first].is("#")) {
            Some(first) => {
                self.flush()?;
                self.directive(line, &line[first + 1..])
            }
            None if self.is_live() => {
                self.text.extend_from_slice(line);
                Ok(())
            }
            None => Ok(()),
        }
    }

    /// Expands and lays out the text up to a directive, with the macros that are defined before the
    /// directive.
    fn flush(&mut self) -> Result<()> {
        let text = std::mem::take(&mut self.text);
        let expanded =
            expand(&self.macros, text, false).map_err(|(line, message)| self.mistake(line, message))?;
        self.layout.add(&self.file, self.offset, &expanded);
        Ok(())
    }

    fn directive(&mut self, line: &[Token], after: &[Token]) -> Result<()> {
        let start = after.iter().position(Token::is_code).unwrap_or(after.len());
        let Some((name, rest)) = after[start..].split_first() else { return Ok(()) };
        let number = name.line;
        let code: Vec<Token> = rest.iter().filter(|token| token.is_code()).cloned().collect();
        match name.text.as_str() {
            "line" => self.set_position(&code, number)?,
            "if" | "ifdef" | "ifndef" => self.open(&name.text, &code, number)?,
            "elif" | "else" | "endif" => self.turn(&name.text, &code, number)?,
            _ if !self.is_live() => {}
            "pragma" => {
                self.layout.add(&self.file, self.offset, line);
                return Ok(());
            }
            "define" => self.macros.define(rest).map_err(|message| self.mistake(number, message))?,
            "undef" => code.first().into_iter().for_each(|name| self.macros.undefine(&name.text)),
            "error" => {
                let text: String = rest.iter().map(|token| token.text.as_str()).collect();
                return Err(self.mistake(number, format!("#error {}", text.trim())).with_help(VALUES));
            }
            other => {
                return Err(self.mistake(number, format!("raycl does not support the directive #{other}")));
            }
        }
        self.layout.cut(&self.file);
        Ok(())
    }

    /// Processes the directive `#line NUMBER "FILE"`, even in branches that are not compiled. `#line` states
    /// the number and the file of the next line.
    fn set_position(&mut self, code: &[Token], line: u32) -> Result<()> {
        let next = code.first().and_then(|number| number.text.parse::<i64>().ok());
        let next = next.ok_or_else(|| self.mistake(line, "#line needs a number"))?;
        self.offset = next - i64::from(line) - 1;
        if let Some(file) = code.get(1) {
            let name = file.text.trim_matches('"');
            self.file = name.into();
            if self.is_live() && !self.files.iter().any(|file| file == name) {
                self.files.push(name.to_owned());
            }
        }
        Ok(())
    }

    /// Returns true if the condition of the directive `name` is true. An invalid condition is reported as a
    /// mistake of the user.
    fn decide(&mut self, name: &str, code: &[Token], line: u32) -> Result<bool> {
        let named = code.first().map(|token| token.text.clone());
        let decided = match (name, named) {
            ("ifdef", Some(named)) => Ok(self.compiler.is_defined(&self.macros, &named)),
            ("ifndef", Some(named)) => Ok(!self.compiler.is_defined(&self.macros, &named)),
            ("ifdef" | "ifndef", None) => Err(format!("#{name} needs a name")),
            _ => condition::holds(code, &self.macros, &mut self.compiler),
        };
        decided.map_err(|message| self.mistake(line, message).with_help(VALUES))
    }

    fn open(&mut self, name: &str, code: &[Token], line: u32) -> Result<()> {
        let around = self.is_live();
        let live = around && self.decide(name, code, line)?;
        self.branches.push(Branch {
            live,
            decided: live,
            around,
            is_last: false,
            position: self.position_of(line),
        });
        Ok(())
    }

    fn turn(&mut self, name: &str, code: &[Token], line: u32) -> Result<()> {
        let Some(mut branch) = self.branches.pop() else {
            return Err(self.mistake(line, format!("#{name} without #if")));
        };
        if name == "endif" {
            return Ok(());
        }
        if branch.is_last {
            return Err(self.mistake(line, format!("#{name} after #else")));
        }
        branch.is_last = name == "else";
        let open = branch.around && !branch.decided;
        branch.live = open && (name == "else" || self.decide(name, code, line)?);
        branch.decided |= branch.live;
        self.branches.push(branch);
        Ok(())
    }

    fn finish(mut self) -> Result<Preprocessed> {
        self.flush()?;
        if let Some(branch) = self.branches.last() {
            return Err(branch.position.mistake("this #if has no #endif").with_help(CLOSE));
        }
        let asked = self.compiler.asked.into_iter().collect();
        Ok(Preprocessed { lines: self.layout.lines(), asked, files: self.files })
    }
}
