//! `raycl repair`: removes damaged lines from a folder's journals.

use crate::error::{Error, Result};
use crate::experiment::Lock;
use crate::record::{Repaired, repair};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Arguments of `raycl repair`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl repair results/quick
  raycl run configs/quick.toml --resume      measures the damaged points again")]
pub struct Args {
    /// A folder that `raycl run` wrote
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Removes damaged lines from the folder's journals: records, samples, rounds, samples of the anchor and records of
/// control points. A copy of the original of each changed file stays in the folder.
pub fn run(args: Args) -> Result<()> {
    if !args.folder.join("records.jsonl").is_file() {
        let error =
            Error::input(format!("{} holds no results: records.jsonl is missing", args.folder.display()));
        return Err(
            error.with_help("give the path of a folder that `raycl run` wrote, such as results/quick")
        );
    }
    let _lock = Lock::take(&args.folder)?;
    let repaired = repair(&args.folder)?;
    if args.json {
        return super::print_json(&json(&repaired));
    }
    if repaired.is_empty() {
        return super::print("no line is damaged");
    }
    let line = |Repaired { file, copy, damaged, kept }: &Repaired| {
        format!(
            "{}: removed damaged lines: {damaged}, lines kept: {kept}; copy of the original: {}",
            file.display(),
            copy.display()
        )
    };
    super::print(repaired.iter().map(line).collect::<Vec<_>>().join("\n"))
}

/// Returns the object for `--json`. A path need not be UTF-8, which JSON requires.
fn json(repaired: &[Repaired]) -> Value {
    let one = |Repaired { file, copy, damaged, kept }: &Repaired| {
        let [file, copy] = [file, copy].map(|path| path.display().to_string());
        json!({ "file": file, "copy": copy, "damaged": damaged, "kept": kept })
    };
    json!({ "repaired": repaired.iter().map(one).collect::<Vec<_>>() })
}
