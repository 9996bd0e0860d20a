//! Checks whether results may be written into a folder.

use super::replace::Choice;
use crate::error::{Error, Result};
use crate::existing;
use crate::record::TEMPORARY_PREFIX;
use crate::record::journals::{
    ANCHORS, ENVIRONMENT, IMAGES, LAUNCHES, RECORDS, ROUNDS, SAMPLES, SUMMARY, is_earlier_environment,
};
use std::path::Path;

/// The files that a run may leave if it ends before it creates `records.jsonl`, for example because the disk
/// is full. A run also renames the `environment.json` of an earlier run (see [`is_earlier_environment`]).
const BEGUN: [&str; 7] = [".lock", ENVIRONMENT, SAMPLES, LAUNCHES, ROUNDS, ANCHORS, IMAGES];

/// Returns an error, before any work is done, if a folder contains files but no results. A run would mix its own files
/// with the existing files, and could replace some of them. Files that a run may write before it creates
/// `records.jsonl` do not count. Returns no error with `--force`, or if `known` is true (raycl has written into the
/// folder before).
pub fn refuse_other_folders(folder: &Path, choice: Choice, known: bool) -> Result<()> {
    if choice.force || known {
        return Ok(());
    }
    let entries = existing::entries(folder)?;
    // If records.jsonl exists but is not a file, the run fails later, when it opens records.jsonl.
    if entries.iter().any(|entry| entry.ends_with(RECORDS)) {
        return Ok(());
    }
    let Some(other) = entries.iter().find(|entry| !is_begun(entry)) else { return Ok(()) };
    if [SAMPLES, SUMMARY].iter().all(|name| entries.iter().any(|entry| entry.ends_with(name))) {
        return Err(without_records(folder, choice));
    }
    let what = match other.join(RECORDS).is_file() {
        true => "which is a folder of results itself",
        false => "which raycl did not make",
    };
    let message = format!(
        "'{}' is not a folder of results: it contains '{}', {what}",
        folder.display(),
        other.file_name().unwrap_or_default().display()
    );
    let help = format!("`--force` writes into the folder anyway; `{}` writes elsewhere", choice.elsewhere);
    Err(Error::input(message).with_help(help))
}

/// Returns the error for a folder whose records were deleted, or not copied with its samples.
fn without_records(folder: &Path, choice: Choice) -> Error {
    let message = format!("'{}' has {SAMPLES} and {SUMMARY}, but no {RECORDS}", folder.display());
    Error::input(message).with_help(format!(
        "copy {RECORDS} into the folder; `raycl run` with `--resume --force` makes it again from the samples; `{}` \
         writes elsewhere",
        choice.elsewhere
    ))
}

/// Returns true if `path` is one of the files that a run may write before it creates `records.jsonl`. For a
/// folder `images` with pictures in it, returns true only if the file `.lock` is beside the folder.
fn is_begun(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let empty = || std::fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none());
    name.starts_with(TEMPORARY_PREFIX)
        || is_earlier_environment(&name)
        || (BEGUN.contains(&name.as_ref()) && (name != IMAGES || empty()))
        || (name == IMAGES && path.with_file_name(".lock").exists())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    const KEEP: Choice = Choice::new(false, "--out DIR");

    #[test]
    fn results_empty_folders_and_new_ones_are_written_to_and_no_others() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let refused = |known| refuse_other_folders(&out, KEEP, known).is_err();
        assert!(!refused(false), "it is not there");
        std::fs::create_dir_all(out.join("images")).unwrap();
        assert!(!refused(false), "a run that ended at once left an empty folder `images`");
        std::fs::write(out.join("images/holiday.png"), "").unwrap();
        assert!(refused(false), "pictures of somebody's");
        std::fs::write(out.join(".lock"), "1").unwrap();
        assert!(!refused(false), "pictures of a run");
        for name in ["environment.json", "environment-1.json", "environment-12.json", "anchors.jsonl"] {
            std::fs::write(out.join(name), "").unwrap();
            assert!(!refused(false), "{name} of runs that failed at their beginning");
        }
        std::fs::write(out.join("thesis.tex"), "").unwrap();
        let error = refuse_other_folders(&out, KEEP, false).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("'thesis.tex', which raycl did not make"), "{error}");
        assert!(!refused(true));
        assert!(refuse_other_folders(&out, Choice { force: true, ..KEEP }, false).is_ok());
        std::fs::write(out.join("records.jsonl"), "").unwrap();
        assert!(!refused(false), "results");
    }

    #[test]
    fn results_whose_records_are_missing_are_called_so() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["samples.jsonl", "summary.md"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let error = refuse_other_folders(folder.path(), KEEP, false).unwrap_err();
        assert!(
            error.to_string().ends_with("has samples.jsonl and summary.md, but no records.jsonl"),
            "{error}"
        );
        assert!(error.remedy().contains("`--resume --force` makes it again"), "{}", error.remedy());
    }

    #[test]
    fn a_folder_of_results_in_the_folder_is_called_so() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("rep");
        std::fs::create_dir(&inner).unwrap();
        std::fs::write(inner.join(RECORDS), "").unwrap();
        let error = refuse_other_folders(folder.path(), KEEP, false).unwrap_err();
        assert!(error.to_string().ends_with("'rep', which is a folder of results itself"), "{error}");
        assert!(error.remedy().contains("`--out DIR` writes elsewhere"), "{}", error.remedy());
    }

    #[test]
    fn files_with_other_names_than_those_of_earlier_sessions_are_somebodys() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["environment-.json", "environment-01.json", "environment-a.json", "environment-1.txt"] {
            let path = folder.path().join(name);
            std::fs::write(&path, "").unwrap();
            let error = refuse_other_folders(folder.path(), KEEP, false).unwrap_err();
            assert!(error.to_string().contains(name), "{error}");
            std::fs::remove_file(&path).unwrap();
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_that_cannot_be_listed_is_not_an_empty_one() {
        let parent = tempfile::tempdir().unwrap();
        let out = parent.path().join("out");
        std::os::unix::fs::symlink(&out, &out).unwrap();
        let error = refuse_other_folders(&out, KEEP, false).unwrap_err();
        assert!(error.to_string().starts_with("cannot read "), "the link leads to itself: {error}");
    }
}
