//! `raycl report`: writes a page from stored records.

use crate::error::Result;
use crate::existing;
use crate::output::{Choice, OutFolder};
use crate::peak::Peak;
use crate::printer::plain;
use crate::record::{Folder, no_results};
use crate::report;
use std::path::{Path, PathBuf};

/// Arguments of `raycl report`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl report results/quick
  raycl report results/figure-8-h200 results/figure-8-pocl --out results/both")]
pub struct Args {
    /// Folders of results that `raycl run` wrote
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// The folder in which to write the page, the plots and the exports [default: the first DIR]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace files in the folder of --out even if they were not written by raycl, or were changed after raycl wrote
    /// them
    #[arg(long, requires = "out")]
    force: bool,
    /// Print one JSON object with the paths of the page and of the folders of plots and exports
    #[arg(long)]
    json: bool,
    /// Print nothing but errors. Not with --json
    #[arg(short, long, conflicts_with = "json")]
    quiet: bool,
}

/// Writes the report. For a single folder without --out, also writes the folder's summary.md and summary.csv again. The
/// command reads records and pictures, and uses no device.
pub fn run(args: Args) -> Result<()> {
    let out = args.out.as_deref().map_or_else(|| usual_out(&args.folders[0]), Ok)?;
    let mut out = OutFolder::open(out, Choice::new(args.force, "--out DIR"))?;
    out.check([report::PAGE])?;
    let folders = args.folders.iter().map(|path| Folder::read(path)).collect::<Result<Vec<_>>>()?;
    folders.iter().for_each(|folder| tell_damage(folder, args.quiet));
    let written = report::write(&folders, &mut out)?;
    if let ([folder], None) = (&folders[..], &args.out) {
        let (question, expectation) = folder.question();
        folder.summarise(&question, &expectation)?;
    }
    let (plots, count) = &written.plots;
    if args.json {
        // JSON requires UTF-8, so `display` replaces the bytes of a path that are not UTF-8.
        let [page, plots, exports] =
            [&written.page, plots, &written.exports].map(|path| path.display().to_string());
        return super::print_json(&serde_json::json!({
            "report": page, "plots": plots, "plot_count": count, "exports": exports,
        }));
    }
    if args.quiet {
        return Ok(());
    }
    super::print(format!("Report:  {}", written.page.display()))?;
    super::print(format!("Plots:   {} ({count}, each as SVG and PNG)", plots.display()))?;
    super::print(format!("Exports: {} (T4, Kernel Tuner, CSV)", written.exports.display()))
}

/// Returns the folder in which the page is written without `--out`: the first folder of results. Returns an error if
/// `first` is a file, such as the journal of a folder of results.
fn usual_out(first: &Path) -> Result<&Path> {
    if existing::is_file(first)? { Err(no_results(first)) } else { Ok(first) }
}

/// Unless `quiet` is true, prints how many damaged lines of the folder's journals (files such as
/// records.jsonl) are left out. If the folder's peak rates cannot be read, also prints the reason.
fn tell_damage(folder: &Folder, quiet: bool) {
    if quiet {
        return;
    }
    for note in &folder.damage {
        crate::printer::tell(format!("note: {}: {}", folder.path.display(), plain(note)));
    }
    if let Err(error) = Peak::stored_in(&folder.path) {
        crate::printer::tell(format!("note: {error}; {}", error.remedy()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::measured;

    #[test]
    fn the_summary_of_a_folder_is_written_again_with_its_question_and_its_expectation() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let record = serde_json::to_string(&measured("gpu", "naive", 8, 1.0)).unwrap();
        std::fs::write(at("records.jsonl"), format!("{record}\n")).unwrap();
        let config = "question = 'Which one?'\nexpectation = 'This one.'\n";
        std::fs::write(at("environment.json"), serde_json::json!({ "config": config }).to_string()).unwrap();
        let folders = vec![folder.path().to_owned()];
        run(Args { folders, out: None, force: false, json: false, quiet: true }).unwrap();
        let summary = std::fs::read_to_string(at("summary.md")).unwrap();
        assert!(summary.starts_with("# Which one?\n\nExpected: This one.\n"), "{summary}");
        let folders = vec![at("records.jsonl")];
        let error = run(Args { folders, out: None, force: false, json: false, quiet: true }).unwrap_err();
        assert_eq!(error.remedy(), format!("give the path of the folder: {}", folder.path().display()));
    }
}
