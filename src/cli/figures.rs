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
    if left.is_empty() {
        return Ok(());
    }
    let error = Error::run(format!("{}:\n{}", differ(left.len()), listed(&left)));
    Err(error.with_help(
        "`raycl figures` without --check corrects every number that the records give; correct the other places by hand: CONTRIBUTING.md explains how numbers refer to records",
    ))
}

/// Returns a sentence with the number of places that differ from the records.
fn differ(count: usize) -> String {
    let verb = if count == 1 { "differs" } else { "differ" };
    format!("{} in documents {verb} from the records", counted(count, "place"))
}

/// Formats differences, each with the file, the line, the text in the document, and the text that the records yield.
fn listed(differences: &[(&str, Difference)]) -> String {
    let one = |(file, Difference { line, stands, records_say }): &(&str, Difference)| {
        format!("{file}:{line}: the document has '{stands}', the records give {records_say}")
    };
    differences.iter().map(one).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_place_differs_and_two_places_differ() {
        assert_eq!(differ(1), "1 place in documents differs from the records");
        assert_eq!(differ(2), "2 places in documents differ from the records");
    }
}
