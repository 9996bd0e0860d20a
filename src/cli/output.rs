//! Writes to standard output, for every subcommand. `println!` panics if the reader has closed the pipe (`raycl devices
//! | head -1`), so no subcommand uses `println!`.

use std::io::{ErrorKind, Write as _};

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{CellAlignment, Table};
use serde::Serialize;

use crate::error::{Error, Result};
use crate::printer;

/// Writes `text` and a newline to standard output. Escapes such as `\u001b` replace control characters other than line
/// breaks and tabs. A closed pipe is not an error.
pub fn print(text: impl std::fmt::Display) -> Result<()> {
    write(&printer::plain(&text.to_string()))
}

/// Writes `text` and a newline to standard output. Keeps line breaks, tabs and the colour codes that raycl added.
/// Escapes replace all other control characters.
pub fn print_coloured(text: &str) -> Result<()> {
    write(&printer::coloured(text))
}

fn write(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Error::unwritable_output(&error)),
        _ => Ok(()),
    }
}

/// Ends the process with exit code 0, without running destructors. Commands call this function after they
/// have printed everything: the system frees the memory and the drivers of an ended process faster than
/// destructors would.
pub fn end_at_once() {
    signal_hook::low_level::exit(0);
}

/// Writes `value` to standard output as indented JSON.
pub fn print_json(value: &impl Serialize) -> Result<()> {
    print(json_of(value)?)
}

/// Prints a command's report: as JSON if `json` is true, and otherwise as text. The text is not printed if `quiet` is
/// true. The report goes to standard error if `streams` is true, that is, if the command writes a picture to standard
/// output.
pub fn print_report(
    report: &impl Serialize,
    text: impl FnOnce() -> String,
    streams: bool,
    (json, quiet): (bool, bool),
) -> Result<()> {
    let shown = match json {
        true => json_of(report)?,
        false if quiet => return Ok(()),
        false => text(),
    };
    if !streams {
        return print(shown);
    }
    printer::tell(printer::plain(&shown));
    Ok(())
}

fn json_of(value: &impl Serialize) -> Result<String> {
    serde_json::to_string_pretty(value)
        .map_err(|error| Error::fault(format!("the result could not be written as JSON: {error}")))
}

/// Returns an empty table with this header. The first `left` columns are left-aligned; all other columns are
/// right-aligned, for numbers.
pub fn table(header: &[&str], left: usize) -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED).set_header(header);
    for column in table.column_iter_mut().skip(left) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_left_aligned_and_numbers_right_aligned() {
        let mut table = table(&["name", "time"], 1);
        table.add_row(["a", "1"]);
        assert!(table.to_string().contains("│ a    ┆    1 │"), "{table}");
    }
}
