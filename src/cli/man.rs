//! `raycl man`: prints man pages, generated from the text of `--help`.

use crate::error::{Error, Result, meant};
use crate::output::{Choice, OutFolder};
use clap::{Command, CommandFactory as _};
use clap_mangen::Man;
use std::path::PathBuf;

/// Arguments of `raycl man`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl man | man -l -
  raycl man render | man -l -
  raycl man --out ~/.local/share/man/man1

Packagers can write all pages with --out, and print completions with `raycl completions`.")]
pub struct Args {
    /// The command whose page to print [default: raycl itself]
    #[arg(value_name = "COMMAND", conflicts_with = "out")]
    command: Option<String>,
    /// Print no page; write the pages of raycl and of all its commands to this folder: raycl.1, raycl-render.1, ...
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace files in the folder of --out even if they were not written by raycl, or were changed after raycl wrote
    /// them
    #[arg(long, requires = "out")]
    force: bool,
}

/// A page's name, and its text in roff (the markup language of man pages).
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

/// Returns raycl's page and those of its commands, except hidden ones.
fn pages() -> Result<Vec<Page>> {
    let mut whole = super::Cli::command();
    whole.build();
    let commands = whole.get_subcommands().filter(|one| !one.is_hide_set() && one.get_name() != "help");
    let commands = commands.map(|one| one.clone().display_name(format!("raycl-{}", one.get_name())));
    std::iter::once(whole.clone()).chain(commands).map(page).collect()
}

fn page(command: Command) -> Result<Page> {
    let name = command.get_display_name().unwrap_or("raycl").to_owned();
    let mut text = Vec::new();
    let page = Man::new(command).title(name.to_uppercase()).manual("raycl").source(env!("RAYCL_VERSION"));
    page.render(&mut text)
        .map_err(|error| Error::fault(format!("a man page could not be generated: {error}")))?;
    Ok((name, text))
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
}
