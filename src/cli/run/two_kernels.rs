//! Compares two folders of kernels within one run.

use super::Args;
use crate::cli::compare::{THRESHOLD_PERCENT, print_table, refuse_regressions};
use crate::config;
use crate::error::{Error, Result};
use crate::program::Sources;
use crate::record::Folder;
use crate::record::journals::IMAGES;
use crate::report::Comparison;
use std::path::{Path, PathBuf};

/// Compares the times of the kernels in the second folder to the times of the kernels in the first folder,
/// and prints the comparison unless `quiet` is true. If `limit_percent` is given, returns an error with exit
/// code 1 if the kernels of the second folder are slower by more than `limit_percent`. The slowdown must be
/// statistically significant for a single point, for the mean of one strategy's points, or for the mean of
/// all points except baselines. If `limit_percent` is given, also returns this error if a point fails with the kernels
/// of the second folder, but was measured with those of the first.
pub fn compare(folder: &Folder, limit_percent: Option<f64>, quiet: bool) -> Result<()> {
    let mut comparison = Comparison::of_kernels(folder, THRESHOLD_PERCENT / 100.0);
    if limit_percent.is_some() {
        comparison.notes.extend(comparison.left_out_of_means());
    }
    if !quiet {
        print_table(&comparison)?;
    }
    let [first, second] = &comparison.labels;
    let between = format!(" with {second} instead of {first}");
    refuse_regressions(&comparison, limit_percent, &between, remedy(&comparison, folder))
}

/// Returns the advice for the user if kernels of the second folder fail, or are slower than those of the
/// first folder.
fn remedy(comparison: &Comparison, folder: &Folder) -> String {
    let [first, second] = &comparison.labels;
    match comparison.broken.is_empty() {
        true => format!(
            "change the kernels of {second}, which are slower than those of {first}, or allow a larger slowdown with --fail-on-regression"
        ),
        false => {
            let images = folder.path.join(IMAGES);
            format!(
                "with the kernels of {second}, points fail or have wrong pictures; the pictures are in {}",
                images.display()
            )
        }
    }
}

/// Returns the kernels of each folder, or the built-in kernels if no folder is given. `spread` is true if the points
/// are distributed over several devices or machines. A run whose points are distributed cannot compare kernels, so this
/// function refuses two folders of kernels if `spread` is true. The function also refuses more than two folders, and a
/// single folder with `--fail-on-regression`.
pub fn sources(args: &Args, spread: bool) -> Result<Vec<Sources>> {
    let folders = &args.cl_dir;
    if folders.len() == 1 && args.fail_on_regression.is_some() {
        return Err(Error::input("--fail-on-regression needs two folders of kernels, but only one is named")
            .with_help("give --cl-dir twice: first for the old kernels, then for the new ones"));
    }
    if folders.len() > 2 {
        return Err(Error::input(format!("--cl-dir names {} folders of kernels", folders.len()))
            .with_help("give --cl-dir once, or twice to compare two folders"));
    }
    if folders.len() == 2 && spread {
        return Err(Error::input("--spread, --shard and --sbatch cannot compare two folders of kernels")
            .with_help("leave out --spread, --shard or --sbatch, or give --cl-dir only once"));
    }
    match folders.as_slice() {
        [] => Ok(vec![Sources::of(None)?]),
        [folder] => Ok(vec![Sources::of(Some(folder.clone()))?]),
        folders => both(args, folders),
    }
}

/// Returns the kernels of two folders. A folder may add values to axes, and each folder's workers know only
/// the values of their own folder. Therefore this function returns an error if the experiment names a value
/// of an axis that only one folder has.
fn both(args: &Args, folders: &[PathBuf]) -> Result<Vec<Sources>> {
    let (mut sources, mut refused) = (Vec::new(), Vec::new());
    for folder in folders {
        sources.push(Sources::of(Some(folder.clone()))?);
        refused.extend(config::load(&args.config, &args.set).err().map(|error| (error, folder)));
    }
    match refused.pop() {
        None => Ok(sources),
        Some((error, folder)) if refused.is_empty() => Err(refused_by(error, folder)),
        // The experiment is refused with the kernels of both folders, so the mistake is in the experiment
        // itself.
        Some((error, _)) => Err(error),
    }
}

/// Returns `error`, an error about the experiment, with help that also says that the error occurs only with
/// the kernels of `folder`.
fn refused_by(error: Error, folder: &Path) -> Error {
    let help = format!(
        "this error occurs only with the kernels of {}; both folders of kernels must have every value that the experiment names; {}",
        folder.display(),
        error.remedy()
    );
    error.with_help(help)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::fixtures::args;
    use super::*;
    use crate::record::{Outcome, Record};

    #[test]
    fn a_point_that_fails_only_with_the_second_kernels_is_a_regression_if_a_limit_is_given() {
        let record = |kernels: &str, outcome| Record {
            kernels_of: Some(kernels.to_owned()),
            name: "naive".to_owned(),
            outcome,
            ..Record::default()
        };
        let folder = |outcomes: [Outcome; 2]| Folder {
            path: "results/a".into(),
            records: vec![record("old", outcomes[0]), record("new", outcomes[1])],
            ..Folder::default()
        };
        let worse = folder([Outcome::Measured, Outcome::WrongImage]);
        let error = compare(&worse, Some(5.0), true).unwrap_err();
        assert_eq!(error.exit_code(), 1);
        let (message, remedy) = (error.to_string(), error.remedy());
        assert!(message.starts_with("1 regression with new instead of old: "), "{message}");
        assert!(
            remedy.starts_with("with the kernels of new, points fail")
                && remedy.ends_with("results/a/images"),
            "{remedy}"
        );
        assert!(compare(&worse, None, true).is_ok());
        assert!(compare(&folder([Outcome::WrongImage, Outcome::Measured]), Some(5.0), true).is_ok());
    }

    #[test]
    fn two_folders_of_kernels_are_for_one_device_and_a_limit_is_for_two_folders() {
        let of = |words: &[&str], spread| sources(&args(&[&["configs/quick.toml"], words].concat()), spread);
        let two = ["--cl-dir", "cl", "--cl-dir", "cl"];
        assert_eq!(
            [of(&[], true), of(&two[..2], true), of(&two, false)].map(|folders| folders.unwrap().len()),
            [1, 1, 2]
        );
        let error = of(&two, true).unwrap_err();
        assert!(error.to_string().contains("cannot compare two folders"), "{error}");
        for option in ["--spread", "--shard", "--sbatch"] {
            assert!(error.remedy().contains(option), "{}", error.remedy());
        }
        let limit = ["--fail-on-regression", "5"];
        assert!(
            of(&[&two[..2], &limit].concat(), false).unwrap_err().to_string().contains("only one is named")
        );
        assert!(of(&[&two[..], &limit].concat(), false).is_ok());
    }

    #[test]
    fn more_than_two_folders_of_kernels_are_refused() {
        let folders = ["--cl-dir", "cl", "--cl-dir", "cl", "--cl-dir", "cl"];
        let error = sources(&args(&[&["configs/quick.toml"], &folders[..]].concat()), false).unwrap_err();
        let message = error.to_string();
        assert_eq!((message.as_str(), error.exit_code()), ("--cl-dir names 3 folders of kernels", 2));
    }

    #[test]
    fn a_mistake_that_occurs_with_both_folders_is_the_experiments_own() {
        let folders = ["--cl-dir", "cl", "--cl-dir", "cl", "--set", "strategies=['nothing']"];
        let error = sources(&args(&[&["configs/quick.toml"], &folders[..]].concat()), false).unwrap_err();
        assert!(error.to_string().contains("nothing"), "{error}");
        assert!(!error.remedy().contains("occurs only with"), "{}", error.remedy());
    }
}
