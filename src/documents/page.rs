//! A document. It may contain blocks between markers, numbers followed by a query in a comment, and other
//! numbers.

use super::of_record::Told;
use super::query::Query;
use super::sheet::Sheet;
use super::unrecorded::{Fences, unrecorded};

/// Text before the name of a block, at its beginning.
const BEGIN: &str = "<!-- figures: ";
/// Text at the end of a block.
const END: &str = "<!-- end of figures -->";

/// A difference between a document and the records.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The line's number, from 1.
    pub line: usize,
    /// The text in the document.
    pub stands: String,
    /// The text that the records yield, or why they yield none.
    pub records_say: String,
}

/// A document, rewritten from the records, and its differences.
#[derive(Debug, Default, PartialEq)]
pub struct Page {
    /// The whole text.
    pub text: String,
    /// Differences from the text that was read.
    pub stale: Vec<Difference>,
    /// Mistakes that rewriting cannot correct: wrong queries, numbers without a record.
    pub wrong: Vec<Difference>,
}

impl Page {
    /// Compares a document's text with the records.
    pub fn of(text: &str, sheet: &Sheet) -> Self {
        let mut page = Self::default();
        let mut lines = text.lines().enumerate().map(|(place, line)| (place + 1, line));
        let mut fences = Fences::default();
        while let Some((number, line)) = lines.next() {
            match line.strip_prefix(BEGIN).and_then(|rest| rest.strip_suffix(" -->")) {
                Some(name) => {
                    let old: Vec<_> =
                        lines.by_ref().take_while(|(_, line)| *line != END).map(|(_, line)| line).collect();
                    page.block(number, name, &old, sheet);
                }
                None => page.prose(number, line, sheet, &mut fences),
            }
        }
        page
    }

    fn push(&mut self, line: &str) {
        self.text += line;
        self.text.push('\n');
    }

    fn block(&mut self, number: usize, name: &str, old: &[&str], sheet: &Sheet) {
        let new = sheet.block(name).unwrap_or_else(|error| {
            self.wrong.push(Difference {
                line: number,
                stands: format!("the block '{name}'"),
                records_say: error,
            });
            old.iter().map(|line| (*line).to_owned()).collect()
        });
        for place in 0..old.len().max(new.len()) {
            let said = |lines: Option<&str>| lines.unwrap_or("(no line)").to_owned();
            let (stands, says) = (old.get(place).copied(), new.get(place).map(String::as_str));
            if stands != says {
                let line = number + 1 + place;
                self.stale.push(Difference { line, stands: said(stands), records_say: said(says) });
            }
        }
        self.push(&format!("{BEGIN}{name} -->"));
        new.iter().for_each(|line| self.push(line));
        self.push(END);
    }

    fn prose(&mut self, number: usize, line: &str, sheet: &Sheet, fences: &mut Fences) {
        let mut made = String::new();
        let mut rest = line;
        // The line without the numbers that have a query.
        let mut bare = String::new();
        while let Some((before, comment, after)) = next_comment(rest) {
            let at = before.len() - number_at_end(before).len();
            let stands = &before[at..];
            let says = self.answer(number, stands, comment, sheet);
            made += &format!("{}{says}<!-- {comment} -->", &before[..at]);
            bare += &format!("{} ", &before[..at]);
            rest = after;
        }
        made += rest;
        bare += rest;
        for phrase in unrecorded(&bare, &sheet.facts, fences) {
            let records_say =
                "nothing: no query follows it, and docs/figures.toml has no such fact".to_owned();
            self.wrong.push(Difference { line: number, stands: phrase, records_say });
        }
        self.push(&made);
    }

    /// Replaces the text before a comment by the answer to the comment's query.
    fn answer(&mut self, line: usize, stands: &str, query: &str, sheet: &Sheet) -> String {
        let told = Query::parse(query).and_then(|query| query.answer(&sheet.sources));
        let stands = stands.to_owned();
        let problem = match told {
            Ok(Told::Words(says)) if stands.is_empty() => {
                format!("{says}, but no number precedes the query: {query}")
            }
            Ok(Told::Words(says)) => {
                if says != stands {
                    let records_say = format!("{says} ({query})");
                    self.stale.push(Difference { line, stands, records_say });
                }
                return says;
            }
            Ok(_) => format!("nothing: no such figure: {query}"),
            Err(error) => format!("nothing: {error}: {query}"),
        };
        self.wrong.push(Difference { line, stands: stands.clone(), records_say: problem });
        stands
    }
}

/// Returns the text before a line's first comment, the comment's text, and the rest.
fn next_comment(line: &str) -> Option<(&str, &str, &str)> {
    let (before, rest) = line.split_once("<!-- ")?;
    let (comment, after) = rest.split_once(" -->")?;
    Some((before, comment, after))
}

/// Returns the number at the end of a text: digits, a point, a sign, an exponent.
fn number_at_end(text: &str) -> &str {
    let start = text.trim_end_matches(|c: char| c.is_ascii_digit() || ".-e".contains(c)).len();
    let number = &text[start..];
    number.trim_start_matches(['e', '.'])
}
