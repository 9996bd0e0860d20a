//! Compares the numbers of a document with the stored records, and rewrites the document from the records. A
//! document contains blocks between markers (lines that are HTML comments), numbers that are each followed by
//! a query in an HTML comment, and numbers without a query.

use super::of_record::Figure;
use super::query::Query;
use super::sheet::Sheet;
use super::unrecorded::{Fences, unrecorded};

/// The text with which the line before a block begins. The block's name follows in the same line.
const BEGIN: &str = "<!-- figures: ";
/// The line that marks the end of a block.
const END: &str = "<!-- end of figures -->";

/// A difference between a document and the records, or a mistake, such as a wrong query.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The line's number, from 1; 0 for an entry of docs/figures.toml that no document uses.
    pub line: usize,
    /// The text that stands in the document, such as a number. For a mistake in a block, `stands` is the text "the
    /// block" and the block's name. For an unused entry of docs/figures.toml, `stands` is this entry.
    pub stands: String,
    /// The text that raycl computes from the records, or the reason why the records yield no text; for an unused entry,
    /// that no document uses it.
    pub records_say: String,
}

/// A document that was rewritten from the records, and its differences from the document that was read.
#[derive(Debug, Default, PartialEq)]
pub struct Page {
    /// The whole text of the rewritten document.
    pub text: String,
    /// Numbers and lines of the document that differed from the records before the document was rewritten.
    pub stale: Vec<Difference>,
    /// Mistakes that rewriting the document cannot correct, such as wrong queries and numbers without a query.
    pub wrong: Vec<Difference>,
}

impl Page {
    /// Compares a document's text with the records, and rewrites the text from the records.
    pub fn of(text: &str, sheet: &Sheet) -> Self {
        let mut page = Self::default();
        let mut lines = text.lines().enumerate().map(|(index, line)| (index + 1, line));
        let mut fences = Fences::default();
        while let Some((number, line)) = lines.next() {
            let Some(name) = block_name(line) else {
                page.prose(number, line, sheet, &mut fences);
                continue;
            };
            match block_length(lines.clone().map(|(_, line)| line)) {
                Some(length) => {
                    let old: Vec<_> = lines.by_ref().take(length).map(|(_, line)| line).collect();
                    lines.next();
                    page.block(number, name, &old, sheet);
                }
                None => page.open_block(number, name, line),
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
        for index in 0..old.len().max(new.len()) {
            let said = |lines: Option<&str>| lines.unwrap_or("(no line)").to_owned();
            let (stands, says) = (old.get(index).copied(), new.get(index).map(String::as_str));
            if stands != says {
                let line = number + 1 + index;
                self.stale.push(Difference { line, stands: said(stands), records_say: said(says) });
            }
        }
        self.push(&format!("{BEGIN}{name} -->"));
        new.iter().for_each(|line| self.push(line));
        self.push(END);
    }

    /// Keeps the line with which a block without an end marker begins, and reports the block in `wrong`. The following
    /// lines are treated as lines outside of blocks, since nothing shows which of them belong to the block.
    fn open_block(&mut self, line: usize, name: &str, begin: &str) {
        let records_say = format!("nothing: no line `{END}` ends this block");
        self.wrong.push(Difference { line, stands: format!("the block '{name}'"), records_say });
        self.push(begin);
    }

    fn prose(&mut self, number: usize, line: &str, sheet: &Sheet, fences: &mut Fences) {
        let mut made = String::new();
        let mut rest = line;
        // The line's text without the queries, and without the numbers in front of the queries.
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
                "nothing: no query follows this number, and docs/figures.toml does not list it as a fact"
                    .to_owned();
            self.wrong.push(Difference { line: number, stands: phrase, records_say });
        }
        self.push(&made);
    }

    /// Returns the answer to the query in a comment. If the query has no answer, or if no number precedes the comment,
    /// returns `stands` (the number before the comment, or an empty text) and reports the reason in `wrong`. If the
    /// query's answer differs from the number before the comment, reports the difference in `stale`.
    fn answer(&mut self, line: usize, stands: &str, query: &str, sheet: &Sheet) -> String {
        let answer = Query::parse(query).and_then(|query| query.answer(&sheet.sources));
        let stands = stands.to_owned();
        let problem = match answer {
            Ok(Figure::Words(says)) if stands.is_empty() => {
                format!("{says}, but no number precedes the query: {query}")
            }
            Ok(Figure::Words(says)) => {
                if says != stands {
                    let records_say = format!("{says} ({query})");
                    self.stale.push(Difference { line, stands, records_say });
                }
                return says;
            }
            Ok(_) => format!("nothing: the query '{query}' finds no value"),
            Err(error) => format!("nothing: {error}: {query}"),
        };
        self.wrong.push(Difference { line, stands: stands.clone(), records_say: problem });
        stands
    }
}

/// Returns the name of a block of lines if the line is the marker at which the block begins.
fn block_name(line: &str) -> Option<&str> {
    line.trim_end().strip_prefix(BEGIN)?.strip_suffix(" -->")
}

/// Returns the number of lines in a block, from the lines after the block's beginning; `None` if another block begins,
/// or the document ends, before the block's end.
fn block_length<'a>(lines: impl Iterator<Item = &'a str>) -> Option<usize> {
    let mut own = lines.take_while(|line| block_name(line).is_none());
    own.position(|line| line.trim_end() == END)
}

/// Returns the text before a line's first comment, the comment's text, and the text after the comment.
/// Returns `None` if the line has no comment.
fn next_comment(line: &str) -> Option<(&str, &str, &str)> {
    let (before, rest) = line.split_once("<!-- ")?;
    let (comment, after) = rest.split_once(" -->")?;
    Some((before, comment, after))
}

/// Returns the number at the end of a text; empty if the text does not end with a number. The number may have
/// a decimal point, a minus sign and an exponent.
fn number_at_end(text: &str) -> &str {
    let start = text.trim_end_matches(|c: char| c.is_ascii_digit() || ".-e".contains(c)).len();
    let number = &text[start..];
    number.trim_start_matches(['e', '.'])
}

#[cfg(test)]
mod tests {
    use super::super::sheet::SHEET;
    use super::*;

    /// The text of docs/figures.toml with a single block, a table of two rows.
    const FIGURES: &str = r#"
        [sources]
        [facts]
        [blocks.threads]
        kind = "table"
        head = "size"
        rows = ["8x8", "10x10"]
        columns = [{ head = "threads", of = "occupancy: groups=8 threads=1536 {}" }]
    "#;
    const TABLE: [&str; 4] = ["| size | threads |", "|---|---|", "| 8x8 | 512 |", "| 10x10 | 800 |"];

    /// Returns the page of a test document that contains `lines` in a block between markers.
    fn page(lines: &[&str]) -> Page {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir(root.path().join("docs")).unwrap();
        std::fs::write(root.path().join(SHEET), FIGURES).unwrap();
        let text = format!("{BEGIN}threads -->\n{}\n{END}\n", lines.join("\n"));
        Page::of(&text, &Sheet::read(root.path()).unwrap())
    }

    #[test]
    fn a_block_that_is_too_short_or_too_long_is_stale() {
        let right = page(&TABLE);
        assert_eq!((right.stale, right.wrong), (Vec::new(), Vec::new()));
        let none = "(no line)";
        let longer = [&TABLE[..], &["| 12x12 | 1440 |"]].concat();
        for (lines, line, stands, says) in
            [(&TABLE[..3], 5, none, TABLE[3]), (&longer[..], 6, longer[4], none)]
        {
            let made = page(lines);
            let difference = Difference { line, stands: stands.to_owned(), records_say: says.to_owned() };
            assert_eq!((made.stale, made.text), (vec![difference], right.text.clone()));
        }
    }

    #[test]
    fn a_block_without_an_end_stays_with_everything_after_it() {
        let first = format!("{BEGIN}threads -->\n(old)\nmore text\n");
        let second = format!("{BEGIN}threads -->\n{}\n{END}\nthe end\n", TABLE.join("\n"));
        for text in [first.clone(), format!("{first}{second}")] {
            let page = line(&text);
            assert_eq!((page.text.as_str(), page.stale.len(), page.wrong.len()), (text.as_str(), 0, 1));
            let Difference { line, stands, records_say } = &page.wrong[0];
            assert_eq!((*line, stands.as_str()), (1, "the block 'threads'"));
            assert!(records_say.starts_with("nothing: no line `<!-- end of figures -->`"), "{records_say}");
        }
    }

    #[test]
    fn spaces_after_a_marker_change_nothing() {
        let text = format!("{BEGIN}threads --> \n{}\n{END} \nmore text\n", TABLE.join("\n"));
        let page = line(&text);
        assert_eq!((page.stale, page.wrong), (Vec::new(), Vec::new()));
        assert!(page.text.ends_with(&format!("{END}\nmore text\n")), "{}", page.text);
    }

    /// Returns the page of a document that consists of `text`.
    fn line(text: &str) -> Page {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir(root.path().join("docs")).unwrap();
        std::fs::write(root.path().join(SHEET), FIGURES).unwrap();
        Page::of(text, &Sheet::read(root.path()).unwrap())
    }

    #[test]
    fn a_number_in_a_sentence_is_replaced_by_the_answer_to_its_query() {
        const QUERY: &str = "<!-- published: teapot naive 8x8 -->";
        let right = line(&format!("It took 10400{QUERY} ms, and 10400{QUERY} again."));
        assert_eq!((right.stale, right.wrong), (Vec::new(), Vec::new()));
        let other = line(&format!("a\nIt took -1.5e3{QUERY} ms."));
        let difference = Difference {
            line: 2,
            stands: "-1.5e3".into(),
            records_say: "10400 (published: teapot naive 8x8)".into(),
        };
        assert_eq!((other.stale, other.wrong), (vec![difference], Vec::new()));
        assert_eq!(other.text, format!("a\nIt took 10400{QUERY} ms.\n"));
        assert_eq!(line(&format!("It took 10401{QUERY} ms.")).stale.len(), 1);
    }

    #[test]
    fn what_no_query_answers_stays_and_is_reported() {
        for (text, stands, says) in [
            ("It took 7 ms.", "7", "nothing: no query follows this number"),
            (
                "It took <!-- published: teapot naive 8x8 --> ms.",
                "",
                "10400, but no number precedes the query",
            ),
            (
                "It took 7<!-- published: teapot naive 14x14 --> ms.",
                "7",
                "nothing: the query 'published: teapot naive 14x14' finds no value",
            ),
            ("It took 7<!-- new: naive 8x8 --> ms.", "7", "nothing: 'new' is not a source"),
        ] {
            let page = line(text);
            assert_eq!((page.stale.len(), page.wrong.len()), (0, 1), "{text}: {page:?}");
            let Difference { line, stands: old, records_say } = &page.wrong[0];
            assert_eq!((*line, old.as_str()), (1, stands), "{text}");
            assert!(records_say.starts_with(says), "{text}: {records_say}");
            assert_eq!(page.text, format!("{text}\n"));
        }
        let unknown = line("<!-- figures: other -->\nold\n<!-- end of figures -->\nmore 3\n");
        assert_eq!(unknown.wrong[0].stands, "the block 'other'");
        assert_eq!((unknown.wrong[0].line, unknown.wrong[1].line), (1, 4));
        assert!(unknown.text.contains("\nold\n"), "{}", unknown.text);
    }
}
