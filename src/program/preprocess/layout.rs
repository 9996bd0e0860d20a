//! Lays out the preprocessed text in lines that are easy to read.

use super::breaking::{broken, whole_brackets};
use super::token::{Kind, Token};
use std::collections::VecDeque;
use std::rc::Rc;

/// A line of the preprocessed text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// The name of the line's file, as given by `#line`; empty if no `#line` named a file.
    pub file: Rc<str>,
    /// The line's number in the file. All lines of a macro's expansion have the line number of the macro
    /// call.
    pub number: u32,
    /// The text of the line.
    pub text: String,
    /// True if the line contains code; false if the line is empty or contains only a comment.
    pub is_code: bool,
}

/// The lines of the preprocessed text in order, with marks where directives were removed.
#[derive(Debug, Default)]
pub(super) struct Layout(Vec<Row>);

#[derive(Debug)]
struct Row {
    line: Line,
    what: What,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    Blank,
    Comment,
    Code,
    /// A mark for a removed directive.
    Cut,
}

impl What {
    fn of(line: &[Token]) -> Self {
        if line.iter().any(Token::is_code) {
            Self::Code
        } else if line.iter().any(|token| token.kind == Kind::Comment) {
            Self::Comment
        } else {
            Self::Blank
        }
    }
}

impl Layout {
    /// Adds expanded text. The line number of a token plus `offset` is its line number in the file.
    pub fn add(&mut self, file: &Rc<str>, offset: i64, text: &[Token]) {
        // A final line end does not begin another line.
        let ended = text.last().is_none_or(|last| last.kind == Kind::NewLine);
        let mut lines: VecDeque<&[Token]> = text.split(|token| token.kind == Kind::NewLine).collect();
        if ended {
            lines.pop_back();
        }
        while let Some(line) = lines.pop_front() {
            let number = line.first().map_or(0, |first| i64::from(first.line) + offset);
            let number = u32::try_from(number).unwrap_or(0);
            let changed = line.iter().any(|token| token.made);
            if changed && line.iter().any(Token::is_code) {
                let broken = broken(whole_brackets(line, &mut lines));
                broken.into_iter().for_each(|line| self.push(file, number, What::Code, line));
            } else if !changed {
                let text: String = line.iter().map(|token| token.text.as_str()).collect();
                self.push(file, number, What::of(line), text.trim_end().to_owned());
            }
            // A line that macro expansion changed and that has no code was a macro call that expanded to
            // nothing. The output leaves out lines whose macro calls expanded to nothing.
        }
    }

    /// Adds a mark for a removed directive.
    pub fn cut(&mut self, file: &Rc<str>) {
        self.push(file, 0, What::Cut, String::new());
    }

    fn push(&mut self, file: &Rc<str>, number: u32, what: What, text: String) {
        let line = Line { file: file.clone(), number, text, is_code: what == What::Code };
        self.0.push(Row { line, what });
    }

    /// Returns the lines, without comments on removed directives, and without unneeded empty lines. An empty line is
    /// unneeded after another empty line, at the beginning of a file's lines, and at the end of the text.
    pub fn lines(self) -> Vec<Line> {
        let rows = without_orphans(self.0);
        let mut lines: Vec<Line> = Vec::new();
        for row in rows.into_iter().filter(|row| row.what != What::Cut) {
            let same = |last: &Line| last.file == row.line.file && !last.text.is_empty();
            if row.what != What::Blank || lines.last().is_some_and(same) {
                lines.push(row.line);
            }
        }
        while lines.last().is_some_and(|line| line.text.is_empty()) {
            lines.pop();
        }
        lines
    }
}

/// Removes comments that describe definitions which the preprocessor has removed. After such a comment, only directives
/// and comments follow, up to the next empty line or the end of the file's lines. The last of these lines is a
/// directive.
fn without_orphans(rows: Vec<Row>) -> Vec<Row> {
    let mut remaining = Vec::new();
    // True if all rows between the loop's current row and the next empty line are directives, or comments
    // that describe directives. The loop goes from the last row to the first.
    let (mut orphaned, mut after) = (false, What::Blank);
    let mut file: Rc<str> = "".into();
    for row in rows.into_iter().rev() {
        if row.line.file != file {
            (orphaned, after, file) = (false, What::Blank, row.line.file.clone());
        }
        orphaned = match (row.what, after) {
            (What::Cut, What::Blank) => true,
            (What::Cut | What::Comment, What::Cut | What::Comment) => orphaned,
            _ => false,
        };
        after = row.what;
        if row.what != What::Comment || !orphaned {
            remaining.push(row);
        }
    }
    remaining.reverse();
    remaining
}
