//! `raycl man`: prints man pages, generated from the text of `--help`.

use crate::error::{Error, Result, meant};
use crate::output::{Choice, OutFolder};
use clap::{Command, CommandFactory as _};
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};
use std::path::PathBuf;

/// Arguments of `raycl man`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl man | man -l -
  raycl man render | man -l -
  raycl man --out ~/.local/share/man/man1

Packagers can write all pages with --out, and print completions with `raycl completions`. With --out, raycl also writes raycl.b3sum, a list by which raycl later recognises the pages that it wrote; a package does not need this list.")]
pub struct Args {
    /// Print the page of this command; cache-clear stands for `raycl cache clear`. Not with --out [default: raycl
    /// itself]
    #[arg(value_name = "COMMAND", conflicts_with = "out")]
    command: Option<String>,
    /// Print no page; write the pages of raycl and of all its commands to this folder: raycl.1, raycl-render.1, ...
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace files in the folder of --out even if they were not written by raycl, or were changed after raycl wrote
    /// them
    #[arg(long, requires = "out", conflicts_with = "command")]
    force: bool,
}

/// The beginning of a page's first section, in roff (the markup language of man pages).
const FIRST_SECTION: &str = "\n.SH NAME\n";
/// Text in roff that stops man from hyphenating words and, on terminals, from stretching the spaces of a
/// line. A hyphenated file name or option would not be what the user has to type.
const AS_WRITTEN: &str = "\n.if n .ad l\n.nh";

/// The name of a man page, and the page's text in roff (the markup language of man pages).
type Page = (String, Vec<u8>);

/// Prints one page, or writes all pages to a folder.
pub fn run(args: Args) -> Result<()> {
    let pages = pages()?;
    let Some(out) = &args.out else { return print_one(&pages, args.command.as_deref()) };
    let files: Vec<Page> = pages.into_iter().map(|(name, text)| (format!("{name}.1"), text)).collect();
    OutFolder::open(out, Choice::new(args.force, "--out DIR"))?.write(&files)?;
    super::print(format!("{} man pages written to {}", files.len(), out.display()))
}

fn print_one(pages: &[Page], command: Option<&str>) -> Result<()> {
    let wanted = command.map_or("raycl".to_owned(), |command| format!("raycl-{command}"));
    match pages.iter().find(|(name, _)| *name == wanted) {
        Some((_, text)) => super::print(String::from_utf8_lossy(text).trim_end()),
        None => Err(unknown(pages, command.unwrap_or_default())),
    }
}

fn unknown(pages: &[Page], command: &str) -> Error {
    let names: Vec<_> = pages.iter().filter_map(|(name, _)| name.strip_prefix("raycl-")).collect();
    let error = Error::input(format!("there is no command '{command}'"));
    let list = format!("the commands are {}", names.join(", "));
    error.with_help(match meant(command, names) {
        Some(meant) => format!("{meant} {list}"),
        None => list,
    })
}

/// Returns the pages of raycl and of its commands, except hidden commands. The subcommand `help` is disabled
/// first, so that it has no page and is listed on no other page.
fn pages() -> Result<Vec<Page>> {
    let mut whole = super::Cli::command().disable_help_subcommand(true);
    whole.build();
    pages_of(&whole)
}

/// Returns the pages of a command and of all its subcommands, except hidden ones.
fn pages_of(command: &Command) -> Result<Vec<Page>> {
    let mut pages = vec![page(command.clone())?];
    for below in command.get_subcommands().filter(|one| !one.is_hide_set()) {
        pages.extend(pages_of(below)?);
    }
    Ok(pages)
}

/// Returns a command's page. The function [`after_help`] formats the text after the help, because
/// `clap_mangen` (the library that generates man pages) would join the lines of the examples into a paragraph
/// of a section EXTRA.
fn page(command: Command) -> Result<Page> {
    let name = command.get_display_name().unwrap_or("raycl").to_owned();
    let after = command.get_after_help().map(|text| after_help(&text.to_string()).render());
    let mut text = Vec::new();
    let page = Man::new(command.after_help(None::<&'static str>));
    // Pages have no date. If the date were empty, man would show the version in its place, because
    // `clap_mangen` does not quote an empty date. Therefore raycl passes a date that consists of two
    // quotation marks.
    let page = page.title(name.to_uppercase()).date("\"\"").manual("raycl").source(env!("RAYCL_VERSION"));
    page.render(&mut text)
        .map_err(|error| Error::fault(format!("a man page could not be generated: {error}")))?;
    let first = format!("{AS_WRITTEN}{FIRST_SECTION}");
    let text = String::from_utf8_lossy(&text).replacen(FIRST_SECTION, &first, 1);
    Ok((name, [text, after.unwrap_or_default()].concat().into_bytes()))
}

/// Converts `text`, the text after a command's help, to roff. Indented lines under a title (`Examples:`)
/// become a section with this title and keep their line breaks. Consecutive paragraphs without a title become
/// a section with the title NOTES.
fn after_help(text: &str) -> Roff {
    let (mut roff, mut is_in_notes) = (Roff::new(), false);
    for paragraph in text.split("\n\n") {
        let Some((title, lines)) = paragraph.split_once(":\n  ") else {
            match is_in_notes {
                true => roff.control("PP", []),
                false => roff.control("SH", ["NOTES"]),
            };
            roff.text([roman(paragraph)]);
            is_in_notes = true;
            continue;
        };
        roff.control("SH", [title.to_uppercase().as_str()]).control("nf", []);
        for line in lines.split("\n  ") {
            roff.text([roman(line)]);
        }
        roff.control("fi", []);
        is_in_notes = false;
    }
    roff
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shown_command_has_a_page_with_its_options_and_examples() {
        let pages = pages().expect("pages");
        let whole = super::super::Cli::command();
        for command in whole.get_subcommands() {
            let name = format!("raycl-{}", command.get_name());
            let page = pages.iter().find(|(page, _)| *page == name);
            assert_eq!(page.is_some(), !command.is_hide_set(), "{name}");
            let Some((_, text)) = page else { continue };
            let text = String::from_utf8_lossy(text).replace("\\-", "-");
            for option in command.get_arguments().filter(|one| !one.is_hide_set()) {
                let long = option.get_long().unwrap_or_default();
                assert!(text.contains(&format!("--{long}")) || long.is_empty(), "{name}: no --{long}");
            }
            assert!(text.contains(&format!("raycl {}", command.get_name())), "{name}: {text}");
        }
    }

    #[test]
    fn every_page_that_a_page_names_is_written() {
        let pages = pages().expect("pages");
        let is_written = |wanted: &str| pages.iter().any(|(name, _)| name == wanted);
        for (name, text) in &pages {
            let text = String::from_utf8_lossy(text).replace("\\-", "-");
            for named in text.split_whitespace().filter_map(|word| word.strip_suffix("(1)")) {
                assert!(is_written(named), "{name} names {named}");
            }
        }
        assert!(is_written("raycl") && is_written("raycl-cache-show") && !is_written("raycl-help"));
    }

    #[test]
    fn the_version_is_not_in_the_place_of_the_date() {
        for (name, text) in pages().expect("pages") {
            let text = String::from_utf8_lossy(&text);
            let title = format!("\n.TH {} 1 \"\" ", name.to_uppercase());
            assert!(text.contains(&title), "{name}: {text}");
        }
    }

    #[test]
    fn the_lines_of_examples_stay_as_they_are() {
        let pages = pages().expect("pages");
        let (_, text) = pages.iter().find(|(name, _)| name == "raycl-run").expect("a page");
        let text = String::from_utf8_lossy(text).replace("\\-", "-");
        let (before, examples) = text.split_once(".SH EXAMPLES\n.nf\nraycl run ").expect("examples");
        let (examples, notes) = examples.split_once("\n.fi\n.SH NOTES\n").expect("notes");
        assert!(examples.lines().any(|line| line.ends_with("--fail-on-regression 5")), "{examples}");
        assert!(notes.starts_with("The exit code is 0 "), "{notes}");
        assert!(before.contains("\n.if n .ad l\n.nh\n.SH NAME\n") && !text.contains(".SH EXTRA"), "{text}");
    }

    #[test]
    fn the_text_after_the_help_is_divided_into_sections() {
        let text = "Keys:\n  a    one\n  b    two\n\nFirst\nnote.\n\nSecond.\n\nExamples:\n  .x\n\nThird.";
        let keys = ".SH KEYS\n.nf\na    one\nb    two\n.fi\n";
        let notes = ".SH NOTES\nFirst\nnote.\n.PP\nSecond.\n";
        let expected = format!("{keys}{notes}.SH EXAMPLES\n.nf\n\\&.x\n.fi\n.SH NOTES\nThird.\n");
        assert_eq!(after_help(text).to_roff(), expected);
    }
}
