//! Tells the user how to resume an interrupted run.

use super::{Args, HANG_LIMIT};
use crate::device::variables::{self, Setting};
use crate::error::Error;
use crate::experiment::MOVED_SAMPLES;
use crate::peak;
use crate::settings;
use crate::words::{command_line, option, path_word};
use std::path::Path;

/// Returns `error`, with help that contains the command that continues the run. If the folder `out` is missing, this
/// command begins the run again. A mistake in the input is returned unchanged.
pub fn say_how_to_resume(error: Error, args: &Args, out: &Path) -> Error {
    let command = resuming(args, out, &deciding_variables(&args.device));
    // If the folder was removed or moved during the run, its old path has nothing to continue.
    let is_removed = matches!(error, Error::Run { .. }) && !out.is_dir();
    let purpose = if is_removed { "to begin again" } else { "to continue from here" };
    error.to_be_continued(format!("{purpose}: {command}"))
}

/// Returns the environment variables that decide what a command measures, each as `NAME=VALUE`: raycl's own variables
/// and those of drivers. If one of these variables is missing when the user runs the command again, raycl may measure
/// on other devices, or measure points with other keys. `devices` contains the words of the option `--device`.
pub fn deciding_variables(devices: &[String]) -> Vec<Setting> {
    let own = own_variables(devices, &|name| std::env::var(name).ok());
    own.into_iter().chain(variables::of_user().iter().cloned()).collect()
}

/// Returns raycl's own variables that decide what a command measures. If the option `--device` names
/// `devices`, `RAYCL_DEVICE` decides nothing, and is left out.
fn own_variables(devices: &[String], value: &dyn Fn(&str) -> Option<String>) -> Vec<Setting> {
    let names = [settings::DEVICE, MOVED_SAMPLES].into_iter();
    let names = names.filter(|name| *name != settings::DEVICE || devices.is_empty());
    let filled = |name| value(name).filter(|value| !value.trim().is_empty());
    names.filter_map(|name| Some(format!("{name}={}", filled(name)?))).collect()
}

/// Returns the command that resumes a run, with the environment variables that it needs.
fn resuming(args: &Args, out: &Path, variables: &[Setting]) -> String {
    let mut words = vec!["raycl".to_owned(), "run".to_owned(), path_word(&args.config)];
    words.extend(option("--out", out.display()));
    words.extend(choices(args));
    // Once the peak rates are in the folder, the run does not need the option `--peak` again.
    words.extend(peak_option(args).filter(|_| !out.join(peak::FILE).exists()));
    words.extend(args.no_wait.then(|| "--no-wait".to_owned()));
    words.extend(args.spread.then(|| "--spread".to_owned()));
    words.extend(args.retry_failed.then(|| "--retry-failed".to_owned()));
    // Before the first record, a folder with other files is accepted only with `--force`.
    words.extend(args.force.then(|| "--force".to_owned()));
    if let Some(percent) = args.fail_on_regression {
        words.extend(["--fail-on-regression".to_owned(), percent.to_string()]);
    }
    words.push("--resume".to_owned());
    command_line(variables, &words)
}

/// Returns the options with which another command measures the same points: devices, changed values of the config,
/// folders of kernels, and the time limit.
pub fn choices(args: &Args) -> Vec<String> {
    let devices = args.device.iter().flat_map(|device| option("--device", device));
    let set = args.set.iter().flat_map(|(key, value)| option("--set", format!("{key}={value}")));
    let kernels = args.cl_dir.iter().flat_map(|folder| option("--cl-dir", folder.display()));
    let limit = (args.hang_limit != HANG_LIMIT)
        .then(|| ["--hang-limit".to_owned(), args.hang_limit.as_secs_f64().to_string()]);
    devices.chain(set).chain(kernels).chain(limit.into_iter().flatten()).collect()
}

/// Returns the option `--peak` as it was given; `None` if it was not given.
pub fn peak_option(args: &Args) -> Option<String> {
    args.peak.as_ref().map(|file| match file {
        None => "--peak".to_owned(),
        Some(file) => format!("--peak={}", file.display()),
    })
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::args;
    use super::*;

    /// Returns the command that resumes a run without environment variables.
    fn plain(args: &Args, out: &Path) -> String {
        resuming(args, out, &[])
    }

    #[test]
    fn the_command_that_continues_measures_the_same() {
        let all = args(&[
            "configs/my config.toml",
            "--device",
            "nvidia",
            "--device",
            "pocl",
            "--set",
            "timing.seed=3",
            "--cl-dir",
            "kernels",
            "--hang-limit",
            "2.5",
            "--spread",
            "--out",
            "results/a",
            "--force",
        ]);
        assert_eq!(
            plain(&all, Path::new("results/a")),
            "raycl run 'configs/my config.toml' --out results/a --device nvidia --device pocl --set timing.seed=3 \
             --cl-dir kernels --hang-limit 2.5 --spread --force --resume"
        );
        let usual = plain(&args(&["a.toml", "--hang-limit", "600"]), Path::new("b"));
        assert_eq!(usual, "raycl run a.toml --out b --resume");
    }

    /// If `RAYCL_DEVICE` or a driver's variable were missing, the run could continue on other devices.
    #[test]
    fn the_command_that_continues_sets_the_variables_that_decide_what_is_measured() {
        let value = |name: &str| match name {
            "RAYCL_DEVICE" => Some("my gpu".to_owned()),
            "RAYCL_MOVED_SAMPLES" => Some("keep".to_owned()),
            _ => None,
        };
        let own = |devices: &[String]| own_variables(devices, &value);
        let moved = "RAYCL_MOVED_SAMPLES=keep".to_owned();
        assert_eq!(own(&[]), ["RAYCL_DEVICE=my gpu".to_owned(), moved.clone()]);
        assert_eq!(own(&["cpu".to_owned()]), [moved]);
        assert!(own_variables(&[], &|_| Some(" ".to_owned())).is_empty());
        let drivers = ["POCL_DEVICES=pthread basic".to_owned()];
        let all: Vec<Setting> = own(&[]).into_iter().chain(drivers).collect();
        assert_eq!(
            resuming(&args(&["a.toml"]), Path::new("b"), &all),
            "RAYCL_DEVICE='my gpu' RAYCL_MOVED_SAMPLES=keep POCL_DEVICES='pthread basic' raycl run a.toml --out b \
             --resume"
        );
    }

    #[test]
    fn names_that_begin_with_a_dash_are_not_read_as_options() {
        let dashed = args(&["--device=-h200", "--cl-dir=-kernels", "--", "-e.toml"]);
        let command = plain(&dashed, Path::new("-a"));
        assert_eq!(command, "raycl run ./-e.toml --out=-a --device=-h200 --cl-dir=-kernels --resume");
        let again = args(&command.split(' ').skip(2).collect::<Vec<_>>());
        assert_eq!(again.out.as_deref(), Some(Path::new("-a")));
        assert_eq!(plain(&again, Path::new("-a")), command);
    }

    #[test]
    fn the_command_that_continues_waits_as_little_and_has_the_peak_rates_unless_they_are_stored() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().display().to_string();
        let of = |more: &[&str]| plain(&args(&[&["a.toml"], more].concat()), folder.path());
        let command = |options: &str| format!("raycl run a.toml --out {out}{options} --resume");
        assert_eq!(of(&["--peak", "--no-wait"]), command(" --peak --no-wait"));
        assert_eq!(of(&["--peak=h200.json"]), command(" --peak=h200.json"));
        assert_eq!(of(&["--resume", "--retry-failed"]), command(" --retry-failed"));
        std::fs::write(folder.path().join(peak::FILE), "[]").unwrap();
        assert_eq!(of(&["--peak=h200.json"]), command(""));
    }

    #[test]
    fn the_command_that_continues_fails_on_the_same_regression() {
        let two = args(&["a.toml", "--cl-dir", "a", "--cl-dir", "b", "--fail-on-regression", "2.5"]);
        let line = plain(&two, Path::new("c"));
        assert_eq!(line, "raycl run a.toml --out c --cl-dir a --cl-dir b --fail-on-regression 2.5 --resume");
    }

    #[test]
    fn a_run_that_failed_keeps_its_remedy_and_a_mistake_is_not_to_be_continued() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let remedy_of = |error: Error| say_how_to_resume(error, &args(&["a.toml"]), out).remedy().to_owned();
        let again = resuming(&args(&["a.toml"]), out, &deciding_variables(&[]));
        let command = format!("to continue from here: {again}");
        let gone = say_how_to_resume(Error::run("full"), &args(&["a.toml"]), Path::new("b"));
        assert!(gone.remedy().contains("\nto begin again: ") && gone.remedy().ends_with(" --out b --resume"));
        assert_eq!(remedy_of(Error::run("full").with_help("make room")), format!("make room\n{command}"));
        assert_eq!(remedy_of(Error::interrupted("half")), command);
        assert_eq!(remedy_of(Error::input("no").with_help("correct it")), "correct it");
    }
}
