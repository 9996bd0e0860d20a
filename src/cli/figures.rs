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
    /// Change no file; list the numbers and the lines of tables in raycl's documents that differ from the
    /// stored records. Exit with code 1 if any number or line differs
    #[arg(long)]
    check: bool,
}

/// Updates or checks the numbers in raycl's documents. A check fails if a document differs from the records.
/// An update fails if a document has a mistake that raycl cannot correct, such as a number without a record.
pub fn run(args: Args) -> Result<()> {
    let documents = Documents::read(&args.root)?;
    let left = if args.check {
        documents.differences()
    } else {
        let (changed, wrong) = documents.rewrite(&args.root)?;
        super::print(format!("corrected numbers and lines of tables: {changed}"))?;
        wrong
    };
    if left.is_empty() {
        return Ok(());
    }
    let error = Error::run(format!("{}:\n{}", differ(left.len()), listed(&left)));
    Err(error.with_help(
        "`raycl figures` without --check writes every number that the records yield; correct the other numbers by hand: CONTRIBUTING.md explains how documents state from which record a number comes",
    ))
}

/// Returns the first line of the message if a document differs from the records. `count` is the number of differences.
fn differ(count: usize) -> String {
    let differences = counted(count, "difference");
    format!("{differences} between the numbers in raycl's documents and the stored records")
}

/// Formats differences, each with the file, the line, the text in the document, and the text that the records yield.
fn listed(differences: &[(&str, Difference)]) -> String {
    let one = |(file, Difference { line, stands, records_say }): &(&str, Difference)| match line {
        0 => format!("{file}: {records_say}: '{stands}'"),
        _ => format!("{file}:{line}: the document has '{stands}', the records give {records_say}"),
    };
    differences.iter().map(one).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::documents::DOCUMENTS;

    #[test]
    fn differences_are_counted() {
        let rest = "between the numbers in raycl's documents and the stored records";
        assert_eq!([1, 2].map(differ), [format!("1 difference {rest}"), format!("2 differences {rest}")]);
    }

    #[test]
    fn a_number_without_a_source_fails_a_check_and_an_update() {
        let root = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(root.path().join(name), text).unwrap();
        std::fs::create_dir(root.path().join("docs")).unwrap();
        write("docs/figures.toml", "[sources]\n[facts]\n[blocks]\n");
        for name in DOCUMENTS {
            write(name, "");
        }
        write("README.md", "It took 7 ms.\n");
        for check in [true, false] {
            let error = run(Args { root: root.path().to_owned(), check }).unwrap_err();
            assert_eq!(error.exit_code(), 1);
            assert!(error.to_string().contains("README.md:1: the document has '7'"), "{error}");
        }
    }
}
