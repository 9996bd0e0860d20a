//! The page of `raycl compile`: the source beside the instructions of each kernel.

use super::environment::quote;
use super::page::{SCRIPT, STYLE, nonce};
use crate::error::{Error, Result};
use crate::microscope::{Counts, Instruction, Kind, Listing, Microscope, Row, RowsAre};
use crate::program::CompiledKernel;
use crate::record::Record;
use crate::words::counted;
use askama::Template;
use std::collections::HashMap;

/// The file name of the page.
pub const MICROSCOPE: &str = "microscope.html";

/// The additions of this page to the style sheet and the script of every page.
const OWN_STYLE: &str = include_str!("templates/microscope.css");
const OWN_SCRIPT: &str = include_str!("templates/microscope.js");

#[derive(Template)]
#[template(path = "microscope.html")]
struct Page<'a> {
    style: String,
    script: String,
    nonce: String,
    version: &'static str,
    title: &'a str,
    about: &'a str,
    notes: &'a [String],
    views: Vec<View>,
}

/// A kernel's instructions, as one compiler or assembler made them.
struct View {
    id: String,
    name: String,
    /// Facts about the kernel, with their names.
    facts: Vec<(&'static str, String)>,
    /// How far the rows can be trusted.
    note: String,
    source: Vec<SourceLine>,
    steps: Vec<Step>,
    /// The kinds of instructions that occur, which are the columns of the table.
    kinds: Vec<String>,
    table: Vec<TableRow>,
}

struct SourceLine {
    number: u32,
    text: String,
    /// Number of instructions; empty without any.
    instructions: String,
    memory: String,
    tip: String,
}

/// An instruction, or the label of a part.
struct Step {
    /// The number of its line; empty without one.
    line: String,
    text: String,
    memory: String,
    is_label: bool,
}

struct TableRow {
    place: String,
    text: String,
    instructions: u32,
    /// The number of instructions of each kind; empty for 0.
    counts: Vec<String>,
}

/// Returns the page of a program. `kernels` are as the driver describes them.
pub fn microscope_page(
    title: &str,
    about: &str,
    microscope: &Microscope,
    kernels: &[CompiledKernel],
) -> Result<String> {
    let lines: Vec<&str> = microscope.source.lines().collect();
    let views = microscope.listings.iter().enumerate().map(|(place, listing)| {
        let kernel = kernels.iter().find(|kernel| kernel.name == listing.kernel);
        view(place, listing, kernel, &lines)
    });
    let page = Page {
        style: format!("{STYLE}{OWN_STYLE}"),
        script: format!("{SCRIPT}{OWN_SCRIPT}"),
        nonce: nonce(),
        version: env!("CARGO_PKG_VERSION"),
        title,
        about,
        notes: &microscope.notes,
        views: views.collect(),
    };
    page.render().map_err(|error| Error::fault(format!("{MICROSCOPE} could not be written: {error}")))
}

/// Returns the command that makes the page of a record on the device with this name; `None` if the record does not
/// name the scene's file, if the run changed values of the scene, or if it compared kernels, since records do not
/// name the folders of kernels.
pub(super) fn command(record: &Record, device: &str) -> Option<String> {
    let is_plain = record.scene_values.is_empty() && record.kernels_of.is_none();
    let scene = record.scene_file.as_ref().filter(|_| is_plain)?;
    let [x, y] = record.local_size?;
    let (size, axes) = (format!("{x}x{y}"), record.strategy.replace(' ', ","));
    let strategy = record.preset.as_ref().unwrap_or(&axes);
    let mut words = vec!["raycl", "compile", scene, "--device", device, "--local-size", &size];
    words.extend(["--strategy", strategy, "--out", "compiled"]);
    Some(words.into_iter().map(quote).collect::<Vec<_>>().join(" "))
}

fn view(place: usize, listing: &Listing, kernel: Option<&CompiledKernel>, lines: &[&str]) -> View {
    let kinds: Vec<Kind> = listing.counts.iter().map(|(kind, _)| kind).collect();
    View {
        id: format!("view-{place}"),
        name: format!("{}: {}", listing.kernel, listing.made_by),
        facts: facts(listing, kernel),
        note: note(listing),
        source: source(listing, lines),
        steps: steps(&listing.code.instructions),
        table: listing.rows.iter().map(|row| table_row(row, &kinds)).collect(),
        kinds: kinds.iter().map(Kind::to_string).collect(),
    }
}

fn facts(listing: &Listing, kernel: Option<&CompiledKernel>) -> Vec<(&'static str, String)> {
    let printed =
        |value: Option<u64>| value.map_or("not printed by this compiler".to_owned(), |n| n.to_string());
    let mut facts = vec![
        ("instructions", listing.instructions.to_string()),
        ("of these with a source line", listing.with_line.to_string()),
        ("registers per work-item", printed(listing.registers.map(u64::from))),
    ];
    if listing.counts.iter().next().is_some() {
        facts.insert(2, ("by kind", listing.counts.to_string()));
    }
    // These facts are not known for the code of another assembler.
    if let Some(kernel) = kernel.filter(|_| listing.is_drivers) {
        facts.push(("bytes of spilled registers", printed(kernel.resources.spill_store_bytes)));
        facts.push(("bytes of __local memory per work-group", kernel.group_local_bytes().to_string()));
        facts.extend(kernel.occupancy.map(|part| ("predicted occupancy", format!("{:.0}%", 100.0 * part))));
    }
    facts
}

/// Describes how instructions are assigned to rows, and whether they are the same as those of the program that is
/// timed.
fn note(listing: &Listing) -> String {
    let rows = match listing.rows_are {
        RowsAre::Lines => {
            "An instruction belongs to the line that the compiler's line table names; an inlined function's instructions belong to the function's lines, wherever it is called."
        }
        RowsAre::Parts => {
            "The compiler wrote no line table, so instructions are counted by part of the kernel, from one \
             label to the next, and not by line."
        }
    };
    let same = match listing.same_as_timed {
        Some(true) => {
            " The program that is timed is compiled without a line table; it has the same instructions, apart from registers and addresses."
        }
        Some(false) => {
            " The program that is timed is compiled without a line table, and its instructions differ from these."
        }
        None => "",
    };
    let kinds = match listing.counts.iter().next() {
        Some(_) => "",
        None => " The instructions of this processor are listed, not counted by kind.",
    };
    format!("{rows}{same}{kinds}")
}

fn source(listing: &Listing, lines: &[&str]) -> Vec<SourceLine> {
    let rows: HashMap<u32, &Row> = listing.rows.iter().filter_map(|row| Some((row.line?, row))).collect();
    let line = |(number, text): (u32, &&str)| {
        let row = rows.get(&number);
        SourceLine {
            number,
            text: (*text).to_owned(),
            instructions: row.map_or(String::new(), |row| row.instructions.to_string()),
            memory: row.map_or(String::new(), |row| memories(&row.counts)),
            tip: row.map_or(String::new(), |row| tip(number, row)),
        }
    };
    (1..).zip(lines).map(line).collect()
}

fn tip(number: u32, row: &Row) -> String {
    let counts = row.counts.to_string().replace(", ", "\n");
    format!("line {number}: {}\n{counts}", counted(row.instructions as usize, "instruction"))
}

/// Returns the names of the memories that instructions access.
fn memories(counts: &Counts) -> String {
    counts.memories().into_iter().map(|memory| memory.name()).collect::<Vec<_>>().join(" ")
}

fn steps(instructions: &[Instruction]) -> Vec<Step> {
    let mut steps = Vec::new();
    let mut part = "";
    for one in instructions {
        if one.part != part {
            part = &one.part;
            steps.push(Step {
                line: String::new(),
                text: part.to_owned(),
                memory: String::new(),
                is_label: true,
            });
        }
        let mut counts = Counts::default();
        counts.add(&one.kinds);
        steps.push(Step {
            line: one.line.map_or(String::new(), |line| line.to_string()),
            text: one.text.clone(),
            memory: memories(&counts),
            is_label: false,
        });
    }
    steps
}

fn table_row(row: &Row, kinds: &[Kind]) -> TableRow {
    let part = || match row.part.as_deref() {
        Some("") | None => "before the first label".to_owned(),
        Some(label) => label.to_owned(),
    };
    let count = |kind: &Kind| match row.counts.of(*kind) {
        0 => String::new(),
        count => count.to_string(),
    };
    TableRow {
        place: row.line.map_or_else(part, |line| line.to_string()),
        text: row.source.clone().unwrap_or_default(),
        instructions: row.instructions,
        counts: kinds.iter().map(count).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_names_the_point_and_can_be_pasted_into_a_shell() {
        let record = Record {
            scene_file: Some("scenes/teapot.toml".into()),
            local_size: Some([8, 4]),
            strategy: "traversal=bvh width=4".into(),
            ..Record::default()
        };
        let expected = "raycl compile scenes/teapot.toml --device 'a CPU' --local-size 8x4 --strategy traversal=bvh,width=4 --out compiled";
        let command = |record: &Record| command(record, "a CPU");
        assert_eq!(command(&record).as_deref(), Some(expected));
        let preset = Record { preset: Some("bvh".into()), ..record.clone() };
        assert!(command(&preset).is_some_and(|text| text.ends_with("--strategy bvh --out compiled")));
        assert_eq!(command(&Record { kernels_of: Some("built in".into()), ..record.clone() }), None);
        assert_eq!(command(&Record { scene_values: vec!["a = 1".into()], ..record }), None);
    }
}
