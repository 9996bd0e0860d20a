//! Tells the user how to resume an interrupted run.

use super::{Args, HANG_LIMIT};
use crate::error::Error;
use crate::peak;
use crate::words::{option, path_word, quote};
use std::path::Path;

/// Returns `error`, with help that contains the command that continues the run.
pub fn say_how_to_resume(error: Error, args: &Args, out: &Path) -> Error {
    error.to_be_continued(format!("to continue from here: {}", resuming(args, out)))
}

/// Returns the command that resumes a run.
fn resuming(args: &Args, out: &Path) -> String {
    let mut words = vec!["raycl".to_owned(), "run".to_owned(), path_word(&args.config)];
    words.extend(option("--out", out.display()));
    words.extend(choices(args));
    // Once the peak rates are in the folder, the run does not need the option `--peak` again.
    words.extend(peak_option(args).filter(|_| !out.join(peak::FILE).exists()));
    words.extend(args.no_wait.then(|| "--no-wait".to_owned()));
    words.extend(args.spread.then(|| "--spread".to_owned()));
    words.extend(args.retry_failed.then(|| "--retry-failed".to_owned()));
    if let Some(percent) = args.fail_on_regression {
        words.extend(["--fail-on-regression".to_owned(), percent.to_string()]);
    }
    words.push("--resume".to_owned());
    words.iter().map(|word| quote(word)).collect::<Vec<_>>().join(" ")
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
        ]);
        assert_eq!(
            resuming(&all, Path::new("results/a")),
            "raycl run 'configs/my config.toml' --out results/a --device nvidia --device pocl --set timing.seed=3 \
             --cl-dir kernels --hang-limit 2.5 --spread --resume"
        );
        let plain = resuming(&args(&["a.toml", "--hang-limit", "600"]), Path::new("b"));
        assert_eq!(plain, "raycl run a.toml --out b --resume");
    }

    #[test]
    fn names_that_begin_with_a_dash_are_not_read_as_options() {
        let dashed = args(&["--device=-h200", "--cl-dir=-kernels", "--", "-e.toml"]);
        let command = resuming(&dashed, Path::new("-a"));
        assert_eq!(command, "raycl run ./-e.toml --out=-a --device=-h200 --cl-dir=-kernels --resume");
        let again = args(&command.split(' ').skip(2).collect::<Vec<_>>());
        assert_eq!(again.out.as_deref(), Some(Path::new("-a")));
        assert_eq!(resuming(&again, Path::new("-a")), command);
    }

    #[test]
    fn the_command_that_continues_waits_as_little_and_has_the_peak_rates_unless_they_are_stored() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().display().to_string();
        let of = |more: &[&str]| resuming(&args(&[&["a.toml"], more].concat()), folder.path());
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
        let line = resuming(&two, Path::new("c"));
        assert_eq!(line, "raycl run a.toml --out c --cl-dir a --cl-dir b --fail-on-regression 2.5 --resume");
    }

    #[test]
    fn a_run_that_failed_keeps_its_remedy_and_a_mistake_is_not_to_be_continued() {
        let remedy_of =
            |error: Error| say_how_to_resume(error, &args(&["a.toml"]), Path::new("b")).remedy().to_owned();
        let command = "to continue from here: raycl run a.toml --out b --resume";
        assert_eq!(remedy_of(Error::run("full").with_help("make room")), format!("make room\n{command}"));
        assert_eq!(remedy_of(Error::interrupted("half")), command);
        assert_eq!(remedy_of(Error::input("no").with_help("correct it")), "correct it");
    }
}
