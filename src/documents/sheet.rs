//! Reads `docs/figures.toml`: the folders of records, the definitions of tables, and the numbers
//! that have no record.

use super::of_record::Figure;
use super::query::Query;
use super::reproduced::{answer, claims};
use super::runs::runs;
use super::sources::Sources;
use crate::error::{Error, Result, line_of};
use crate::reader::{self, Kind};
use serde::Deserialize;
use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// The path of `figures.toml` in the repository.
pub const SHEET: &str = "docs/figures.toml";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wire {
    sources: BTreeMap<String, String>,
    facts: BTreeMap<String, Vec<String>>,
    blocks: BTreeMap<String, Block>,
}

/// The contents of a block between two markers.
#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum Block {
    /// A table in which a query determines the number in each cell.
    Table(Table),
    /// The claims of the student paper that raycl reproduces, with raycl's verdicts.
    Claims { devices: Vec<Device> },
    /// For each device, the answer to the paper's question in four lines: best memory strategy, best local size, why,
    /// how sure.
    Answer { devices: Vec<Device> },
    /// A table that shows on which device, when and by which command each folder of records was made.
    Runs { folders: Vec<String> },
}

/// A device of the reproduction, and the folders of its records.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Device {
    /// The device's name in documents.
    pub head: String,
    /// The names of the folders of results (see [`Sources`]) that have records of the paper's configs.
    pub folders: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    /// The heading of the first column.
    head: String,
    rows: Vec<Row>,
    columns: Vec<Column>,
}

/// A row of a table. Each cell of the row has a query, which contains the row's words. The row's words are
/// also the row's heading, unless a separate heading is given. `with` contains modifiers (a number of digits
/// or a unit) that are added to the query of each cell in the row.
#[derive(Deserialize)]
#[serde(untagged)]
enum Row {
    Words(String),
    Headed { head: String, words: String, with: Option<String> },
}

impl Row {
    fn head(&self) -> &str {
        match self {
            Self::Words(head) | Self::Headed { head, .. } => head,
        }
    }

    fn words(&self) -> &str {
        match self {
            Self::Words(words) | Self::Headed { words, .. } => words,
        }
    }

    /// Returns the modifiers for the digits or the unit of the row's numbers, or an empty text. The query of
    /// a table's cell ends with the modifiers of the cell's column, and then those of the cell's row.
    fn modifiers(&self) -> String {
        match self {
            Self::Headed { with: Some(with), .. } => format!(", {with}"),
            _ => String::new(),
        }
    }
}

/// A column of a table, with a query in which the words of a row replace `{}`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Column {
    head: String,
    of: String,
    /// The text that a cell shows if no record matches the cell's query.
    missing: Option<String>,
    /// Which number in the column is printed bold: the least, the greatest or, if `None`, no number.
    bold: Option<Bold>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Bold {
    Least,
    Most,
}

/// The contents of docs/figures.toml.
pub struct Sheet {
    /// The records from which queries are answered.
    pub sources: Sources,
    /// Phrases with numbers that have no record, such as numbers from the paper, sizes, options, versions, and results
    /// of arithmetic. The longest phrases come first, since a phrase may contain a shorter one.
    pub facts: Vec<String>,
    blocks: BTreeMap<String, Block>,
    made: RefCell<HashMap<String, Lines>>,
}

/// The lines of a block, or the reason why they cannot be computed.
type Lines = std::result::Result<Vec<String>, String>;

impl Sheet {
    /// Reads docs/figures.toml of the repository at `root`.
    pub fn read(root: &Path) -> Result<Self> {
        let path = root.join(SHEET);
        let text = reader::text(&path, Kind::Toml).map_err(|error| {
            Error::unreadable("sheet of figures", &path, &error, "run this command in raycl's repository")
        })?;
        let wire: Wire = toml::from_str(&text).map_err(|error| {
            let line = error.span().map_or(1, |span| line_of(&text, span.start));
            Error::input(format!("{SHEET}:{line}: {}", error.message()))
                .with_help("CONTRIBUTING.md describes the contents of docs/figures.toml")
        })?;
        let mut facts: Vec<String> = wire.facts.into_values().flatten().collect();
        facts.sort_by_key(|fact| std::cmp::Reverse(fact.len()));
        Ok(Self {
            sources: Sources::new(root, wire.sources),
            facts,
            blocks: wire.blocks,
            made: RefCell::default(),
        })
    }

    /// Returns the lines of a block, which are computed on the first call only.
    pub fn block(&self, name: &str) -> Lines {
        if let Some(made) = self.made.borrow().get(name) {
            return made.clone();
        }
        let made = self.make(name);
        self.made.borrow_mut().insert(name.to_owned(), made.clone());
        made
    }

    fn make(&self, name: &str) -> Lines {
        let block = self.blocks.get(name).ok_or_else(|| format!("nothing: {SHEET} has no block '{name}'"))?;
        match block {
            Block::Table(table) => self.table(table),
            Block::Claims { devices } => claims(&self.sources, devices),
            Block::Answer { devices } => answer(&self.sources, devices),
            Block::Runs { folders } => runs(&self.sources, folders),
        }
    }

    /// Returns the names of all blocks.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.blocks.keys().map(String::as_str)
    }

    fn table(&self, table: &Table) -> Lines {
        let mut columns = Vec::new();
        for column in &table.columns {
            let cells: std::result::Result<Vec<_>, _> =
                table.rows.iter().map(|row| self.cell(column, row)).collect();
            columns.push(emboldened(cells?, column.bold));
        }
        let heads = std::iter::once(table.head.as_str())
            .chain(table.columns.iter().map(|column| column.head.as_str()));
        let row = |(index, row): (usize, &Row)| {
            line(std::iter::once(row.head()).chain(columns.iter().map(|cells| cells[index].as_str())))
        };
        let rule = format!("|{}", "---|".repeat(table.columns.len() + 1));
        Ok([line(heads), rule].into_iter().chain(table.rows.iter().enumerate().map(row)).collect())
    }

    /// Returns a cell's text, and its number before it was rounded.
    fn cell(&self, column: &Column, row: &Row) -> std::result::Result<(String, Option<f64>), String> {
        let query = column.of.replace("{}", row.words()) + &row.modifiers();
        let figure = Query::parse(&query).and_then(|query| query.answer_and_number(&self.sources));
        match figure.map_err(|error| format!("nothing: {query}: {error}"))? {
            (Figure::Words(text), number) => Ok((text, number)),
            (Figure::Nothing(why), _) if !why.is_empty() => Ok((why, None)),
            _ => {
                column.missing.clone().map(|text| (text, None)).ok_or_else(|| {
                    format!("nothing: {query}: no record, and the column has no `missing` text")
                })
            }
        }
    }
}

/// Formats a row of a Markdown table.
pub fn line<'a>(cells: impl Iterator<Item = &'a str>) -> String {
    format!("| {} |", cells.collect::<Vec<_>>().join(" | ")).replace("|  |", "| |")
}

/// Returns the texts of a column's cells, with the least or the greatest number in bold. The numbers before rounding
/// are compared. The texts stay as they are if `bold` is `None` or no cell has a number.
fn emboldened(cells: Vec<(String, Option<f64>)>, bold: Option<Bold>) -> Vec<String> {
    let (mut cells, numbers): (Vec<_>, Vec<_>) = cells.into_iter().unzip();
    let Some(bold) = bold else { return cells };
    let numbers = numbers.into_iter().enumerate().filter_map(|(index, number)| Some((index, number?)));
    let by_size = |(_, a): &(usize, f64), (_, b): &(usize, f64)| a.total_cmp(b);
    let chosen = match bold {
        Bold::Least => numbers.min_by(by_size),
        Bold::Most => numbers.max_by(by_size),
    };
    if let Some((index, _)) = chosen {
        cells[index] = format!("**{}**", cells[index]);
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn longer_facts_come_before_shorter_ones_that_they_may_contain() {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir(root.path().join("docs")).unwrap();
        let facts = "sizes = [\"8 x 8\", \"all 8 x 8 pixels\"]\nvectors = [\"nine of 8 x 8\"]\n";
        let text = format!("[sources]\n[facts]\n{facts}[blocks]\n");
        std::fs::write(root.path().join(SHEET), text).unwrap();
        let facts = Sheet::read(root.path()).unwrap().facts;
        assert_eq!(facts, ["all 8 x 8 pixels", "nine of 8 x 8", "8 x 8"]);
    }

    #[test]
    fn the_number_before_rounding_decides_which_cell_is_bold() {
        let cells = [("1.2", Some(1.24)), ("1.2", Some(1.16)), ("1.0 (n = 3)", None), ("1.3", Some(1.3))];
        let bold = |bold| emboldened(cells.map(|(text, number)| (text.to_owned(), number)).to_vec(), bold);
        assert_eq!(bold(Some(Bold::Least)), ["1.2", "**1.2**", "1.0 (n = 3)", "1.3"]);
        assert_eq!(bold(Some(Bold::Most))[3], "**1.3**");
        assert_eq!(bold(None)[1], "1.2");
    }

    #[test]
    fn a_cell_without_a_record_has_its_columns_text_and_a_column_without_one_is_refused() {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir(root.path().join("docs")).unwrap();
        let results = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/old-results");
        let block = |missing: &str| {
            let column = format!("{{ head = \"registers\", of = \"old: {{}} 1x1 registers\"{missing} }}");
            let table = "kind = \"table\"\nhead = \"preset\"\nrows = [\"bvh\", \"naive\"]\n";
            let text = format!(
                "[facts]\n[sources]\nold = \"{results}\"\n[blocks.one]\n{table}columns = [{column}]\n"
            );
            std::fs::write(root.path().join(SHEET), text).unwrap();
            Sheet::read(root.path()).unwrap().block("one")
        };
        let lines = ["| preset | registers |", "|---|---|", "| bvh | not tried |", "| naive | 64 |"];
        assert_eq!(block(", missing = \"not tried\""), Ok(lines.map(str::to_owned).to_vec()));
        let error = block("").unwrap_err();
        assert!(error.ends_with("no record, and the column has no `missing` text"), "{error}");
    }
}
