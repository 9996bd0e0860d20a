//! Computes the numbers and tables of the documents from stored records. Every number in README.md,
//! docs/kernels.md, docs/paper.md and docs/performance.md is computed here or listed under
//! `[facts]` in docs/figures.toml. Exceptions are numbers in names, in targets of links, in most code, and in
//! the numbering of lists.

mod occupancy;
mod of_record;
mod page;
mod published;
mod query;
mod reproduced;
mod runs;
mod sheet;
mod sources;
mod unrecorded;

pub use page::Difference;

use crate::error::{Error, Result};
use crate::reader::{self, Kind};
use crate::record::write_whole;
use page::Page;
use sheet::Sheet;
use std::path::Path;

/// The documents whose numbers `raycl` compares with the stored records.
pub const DOCUMENTS: [&str; 4] = ["README.md", "docs/kernels.md", "docs/paper.md", "docs/performance.md"];

/// The documents of a repository, and the contents of docs/figures.toml, which names the records.
pub struct Documents {
    sheet: Sheet,
    texts: Vec<(&'static str, String)>,
}

impl Documents {
    /// Reads the documents of the repository at `root`, and docs/figures.toml.
    pub fn read(root: &Path) -> Result<Self> {
        let text = |name: &'static str| {
            let path = root.join(name);
            let text = reader::text(&path, Kind::Results).map_err(|error| {
                Error::unreadable("document", &path, &error, "run this command in raycl's repository")
            })?;
            Ok((name, text))
        };
        Ok(Self { sheet: Sheet::read(root)?, texts: DOCUMENTS.into_iter().map(text).collect::<Result<_>>()? })
    }

    /// Returns the differences between a document's text and the records, and the mistakes in the text, such
    /// as wrong queries.
    pub fn check(&self, text: &str) -> Vec<Difference> {
        let page = Page::of(text, &self.sheet);
        page.stale.into_iter().chain(page.wrong).collect()
    }

    /// Returns the text of the document `name` as it was read; `None` if `name` is not in [`DOCUMENTS`].
    pub fn text(&self, name: &str) -> Option<&str> {
        self.texts.iter().find(|(own, _)| *own == name).map(|(_, text)| text.as_str())
    }

    /// Returns every difference between a document and the records, and every mistake in a document, with the
    /// document's name. The result also contains every entry under `[facts]` and `[blocks]` in docs/figures.toml
    /// that no document uses.
    pub fn differences(&self) -> Vec<(&'static str, Difference)> {
        let of = |(name, text): &(&'static str, String)| {
            let name = *name;
            self.check(text).into_iter().map(move |difference| (name, difference)).collect::<Vec<_>>()
        };
        let unused = self.unused().into_iter().map(|phrase| {
            let records_say = "no document uses this entry; remove it".to_owned();
            (sheet::SHEET, Difference { line: 0, stands: phrase, records_say })
        });
        self.texts.iter().flat_map(of).chain(unused).collect()
    }

    /// Returns each phrase under `[facts]` in docs/figures.toml that no document contains, and the beginning marker of
    /// each block under `[blocks]` that no document uses.
    fn unused(&self) -> Vec<String> {
        let nowhere = |phrase: &&str| !self.texts.iter().any(|(_, text)| text.contains(*phrase));
        let facts = self.sheet.facts.iter().map(String::as_str).filter(nowhere).map(str::to_owned);
        let blocks = self.sheet.names().map(|name| format!("<!-- figures: {name} -->"));
        facts.chain(blocks.filter(|block| nowhere(&block.as_str()))).collect()
    }

    /// Rewrites the documents at `root` from the records. Returns the number of changed places (numbers in sentences,
    /// and lines of blocks), and the mistakes that rewriting cannot correct.
    pub fn rewrite(&self, root: &Path) -> Result<(usize, Vec<(&'static str, Difference)>)> {
        let (mut changed, mut wrong) = (0, Vec::new());
        for (name, text) in &self.texts {
            let page = Page::of(text, &self.sheet);
            changed += page.stale.len();
            wrong.extend(page.wrong.into_iter().map(|difference| (*name, difference)));
            if page.text != *text {
                write_whole(&root.join(name), page.text.as_bytes())?;
            }
        }
        Ok((changed, wrong))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUERY: &str = "<!-- published: teapot naive 8x8 -->";

    /// Writes a small repository in which the four documents have the given texts.
    fn repository(texts: [&str; 4]) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir(root.path().join("docs")).unwrap();
        let sheet = "[sources]\n[facts]\nsizes = [\"7 apples\", \"9 pears\"]\n[blocks]\n";
        std::fs::write(root.path().join(sheet::SHEET), sheet).unwrap();
        for (name, text) in DOCUMENTS.iter().zip(texts) {
            std::fs::write(root.path().join(name), text).unwrap();
        }
        root
    }

    #[test]
    fn documents_are_rewritten_and_what_no_record_mends_is_reported() {
        let stale = format!("It took 1{QUERY} and\n2{QUERY} ms.\n");
        let wrong = "There are 5 of 7 apples.\n";
        let root = repository(["7 apples\n", &stale, wrong, ""]);
        let documents = Documents::read(root.path()).unwrap();
        assert_eq!((documents.text("docs/paper.md"), documents.text("other")), (Some(wrong), None));
        let actual: Vec<_> = documents
            .differences()
            .into_iter()
            .map(|(name, difference)| (name, difference.line, difference.stands))
            .collect();
        let expected = [
            ("docs/kernels.md", 1, "1"),
            ("docs/kernels.md", 2, "2"),
            ("docs/paper.md", 1, "5"),
            ("docs/figures.toml", 0, "9 pears"),
        ];
        assert_eq!(actual, expected.map(|(name, line, stands)| (name, line, stands.to_owned())));
        let (changed, left) = documents.rewrite(root.path()).unwrap();
        assert_eq!((changed, left.len(), left[0].0, left[0].1.line), (2, 1, "docs/paper.md", 1));
        let text = std::fs::read_to_string(root.path().join("docs/kernels.md")).unwrap();
        assert_eq!(text, format!("It took 10400{QUERY} and\n10400{QUERY} ms.\n"));
        let again = Documents::read(root.path()).unwrap().rewrite(root.path()).unwrap();
        assert_eq!((again.0, again.1.len()), (0, 1));
    }
}
