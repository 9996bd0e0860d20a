//! `raycl figures`, for contributors: updates the numbers in raycl's documents from stored records.

use crate::documents::{Difference, Documents};
use crate::error::{Error, Result};
use crate::words::counted;
use std::path::PathBuf;

/// Arguments of `raycl figures`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder of raycl's repository
    #[arg(default_value = ".", value_name = "DIR")]
    root: PathBuf,
    /// Write nothing; list the places in documents that differ from the records, and fail if there are any
    #[arg(long)]
    check: bool,
}

/// Updates or checks the numbers. A check fails if a document differs from the records. An update fails only if
/// differences remain that rewriting cannot remove.
pub fn run(args: Args) -> Result<()> {
    let documents = Documents::read(&args.root)?;
    let left = if args.check {
        documents.differences()
    } else {
        let (changed, wrong) = documents.rewrite(&args.root)?;
        super::print(format!("{} changed", counted(changed, "place")))?;
        wrong
    };
    match left.len() {
        0 => Ok(()),
        count => Err(Error::run(format!(
            "{count} places in documents differ from the records:\n{}",
            listed(&left)
        ))
        .with_help("`raycl figures` without --check corrects numbers that have a record; CONTRIBUTING.md explains how to correct other places")),
    }
}

/// Formats differences, each with the file, the line, the text in the document, and the text that the records yield.
fn listed(differences: &[(&str, Difference)]) -> String {
    let one = |(file, Difference { line, stands, records_say }): &(&str, Difference)| {
        format!("{file}:{line}: the document has '{stands}', the records give {records_say}")
    };
    differences.iter().map(one).collect::<Vec<_>>().join("\n")
}
