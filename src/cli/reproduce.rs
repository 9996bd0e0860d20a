//! `raycl reproduce`: measures the experiments of the student paper that raycl reproduces, and writes a page
//! that judges the paper's claims.

use super::choice::parse_assignment;
use super::measured::failures;
use super::progress::{Stages, observer};
use super::run;
use crate::config::with_absolute_paths;
use crate::device::variables::Setting;
use crate::error::{Error, Result};
use crate::existing;
use crate::experiment::find_devices;
use crate::output::{Choice, OutFolder, refuse_other_folders};
use crate::record::Folder;
use crate::record::journals::RECORDS;
use crate::report;
use crate::report::paper::{CONFIGS, SCENES};
use crate::settings::results;
use crate::words::{command_line, few, option};
use std::path::{Path, PathBuf};

/// Arguments of `raycl reproduce`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl reproduce
  raycl reproduce --device nvidia --out results/reproduction-h200
  raycl reproduce --resume
  raycl reproduce --resume --retry-failed
  raycl reproduce --set 'image_sizes=[[200, 125]]' --set timing.time_limit_ms=100
  raycl reproduce --page-only --out results/reproduction")]
pub struct Args {
    /// Measure on the devices that NAME selects. NAME is part of a device's name, platform or vendor; a label in `raycl
    /// devices`; a kind (cpu, gpu, accelerator); or all [default: the devices in RAYCL_DEVICE or your settings, else
    /// all]
    #[arg(long, value_name = "NAME")]
    device: Vec<String>,
    /// The folder to write to. In this folder, raycl makes a folder of results for each experiment, and writes the page
    /// that judges the student paper's claims
    #[arg(short, long, value_name = "DIR", default_value_os_t = results().join("reproduction"))]
    out: PathBuf,
    /// Write into the folder of --out even if it contains files that raycl did not write. Such a file is replaced if it
    /// has the name of a file that raycl writes into this folder (a page, a plot, or a copy of a config or scene).
    /// Existing measurements are never replaced
    #[arg(long)]
    force: bool,
    /// Change a value in the configs of all experiments. If VALUE contains paths of scenes, they are relative to the
    /// current folder
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse_assignment)]
    set: Vec<(String, String)>,
    /// Continue an interrupted reproduction: keep its measurements and measure the missing points
    #[arg(long)]
    resume: bool,
    /// With --resume, also measure two kinds of points again: points that failed, and points that did not fit because
    /// other programs or other points were using the memory that these points need
    #[arg(long, requires = "resume")]
    retry_failed: bool,
    /// If another process is measuring on a selected device, end at once instead of waiting for it
    #[arg(long)]
    no_wait: bool,
    /// Measure nothing; from existing results, generate the page that judges the student paper's claims. Not with
    /// --device, --set, --resume, --no-wait or --verbose
    #[arg(long, conflicts_with_all = ["device", "set", "resume", "retry_failed", "no_wait", "verbose"])]
    page_only: bool,
    /// Print neither the progress, nor the devices' answers to the paper's question, nor the paths of written files
    #[arg(short, long)]
    quiet: bool,
    /// Print a line for every finished point, instead of a progress bar. Not with --quiet
    #[arg(short, long, conflicts_with = "quiet")]
    verbose: bool,
}

/// Measures the experiments of the student paper (the built-in configs), and writes the page that judges the paper's
/// claims. Points that could not be measured are listed on the page and do not stop the command; if points failed, the
/// command returns an error at its end. With `--page-only`, measures nothing.
pub fn run(args: Args) -> Result<()> {
    let choice = Choice::new(args.force, "--out DIR");
    let mut out = OutFolder::open(&args.out, choice)?;
    let has_results = !present(&args.out)?.is_empty();
    if args.page_only && !has_results {
        refuse_without_results(&args.out)?;
    }
    refuse_other_folders(&args.out, choice, out.is_known() || has_results)?;
    out.check(report::REPRODUCTION)?;
    let failed = if args.page_only { Vec::new() } else { measure_all(&args, &mut out)? };
    say_result(&args, &write_page(&mut out)?)?;
    match failed.as_slice() {
        [] => Ok(()),
        some => Err(Error::run(some.join("; ")).with_help(
            "raycl still wrote the reproduction's page; for each config, the file summary.md in the \
                 config's folder of results says why points failed; the same command with \
                 --resume --retry-failed measures these points again",
        )),
    }
}

/// Writes copies of the configs and scenes into the output folder, measures the configs one after another, and writes
/// their reports. Returns one line for each config with failed points.
fn measure_all(args: &Args, out: &mut OutFolder) -> Result<Vec<String>> {
    run::named_in_text([&args.out])?;
    unpack(out)?;
    let devices = find_devices(None)?;
    let runs = CONFIGS.map(|(name, _)| (name, arguments(args, name)));
    let counts = runs.iter().map(|(_, run)| run::count(run, &devices)).collect::<Result<Vec<_>>>()?;
    let [total, steps] = [0, 1].map(|index| counts.iter().map(|count| count[index]).sum::<usize>());
    let mut stages = Stages::of(total, steps, observer(args.quiet, args.verbose));
    let mut failed = Vec::new();
    for (index, (name, run)) in runs.iter().enumerate() {
        stages.enter(format!("{name} ({} of {})", index + 1, runs.len()));
        let end = run::measure(run, &mut stages).and_then(|(_, measured)| measured);
        let records = end.map_err(|error| stopped(error, args, out, &mut stages, total))?;
        let folder = args.out.join(name);
        report::write(&[Folder::read(&folder)?], &mut OutFolder::open(&folder, out.choice())?)?;
        failed.extend(failures(&records).map(|message| format!("{name}: {message}")));
    }
    stages.end();
    Ok(failed)
}

fn arguments(args: &Args, name: &str) -> run::Args {
    let config = args.out.join("configs").join(format!("{name}.toml"));
    let set = with_absolute_paths(&args.set);
    let mut run = run::Args::of(config, &args.out.join(name), &args.device, &set);
    (run.resume, run.force, run.no_wait) = (args.resume, args.force, args.no_wait);
    run.retry_failed = args.retry_failed;
    // The page needs the devices' peak rates, to check the latencies that the paper states and to explain which memory
    // is fastest.
    run.peak = (name == "figure-8").then_some(None);
    run
}

/// Writes the page from the results that were measured before the error, and returns the error with a help line that
/// says how to continue. The help of a mistake in the input stays unchanged.
fn stopped(error: Error, args: &Args, out: &mut OutFolder, stages: &mut Stages, total: usize) -> Error {
    stages.end();
    let page = write_page(out)
        .map_or(String::new(), |(page, _)| format!("a page of the finished points: {}\n", page.display()));
    let command = resuming(args, &run::deciding_variables(&args.device));
    let help = format!("{page}to continue from here: {command}");
    let error = match error {
        Error::Interrupted { .. } => {
            Error::interrupted(format!("{} of {total} points are done", stages.done()))
        }
        other => other,
    };
    error.to_be_continued(help)
}

/// Returns the command that continues the reproduction, with the environment variables that it needs.
fn resuming(args: &Args, variables: &[Setting]) -> String {
    let mut words = vec!["raycl".to_owned(), "reproduce".to_owned()];
    words.extend(option("--out", args.out.display()));
    words.extend(args.device.iter().flat_map(|device| option("--device", device)));
    words.extend(args.set.iter().flat_map(|(key, value)| option("--set", format!("{key}={value}"))));
    words.extend(args.no_wait.then(|| "--no-wait".to_owned()));
    words.extend(args.force.then(|| "--force".to_owned()));
    words.extend(args.retry_failed.then(|| "--retry-failed".to_owned()));
    words.push("--resume".to_owned());
    command_line(variables, &words)
}

/// Prints the devices' answers, the path of each config's report, and the path of the page. (The page contains the
/// answers too, but the user of a server may be unable to view a page.)
fn say_result(args: &Args, (page, answers): &(PathBuf, String)) -> Result<()> {
    if args.quiet {
        return Ok(());
    }
    if !answers.is_empty() {
        super::print(answers)?;
    }
    let pages = present(&args.out)?.into_iter().map(|folder| folder.join(report::PAGE));
    for page in pages.filter(|page| page.exists()) {
        super::print(format!("Report:       {}", page.display()))?;
    }
    super::print(format!("Reproduction: {}", page.display()))
}

/// Returns those folders of results, one per config of the paper, that contain a file of records.
fn present(out: &Path) -> Result<Vec<PathBuf>> {
    let mut present = Vec::new();
    for folder in CONFIGS.iter().map(|(name, _)| out.join(name)) {
        if existing::exists(&folder.join(RECORDS))? {
            present.push(folder);
        }
    }
    Ok(present)
}

/// Returns an error that says what is wrong if the folder does not exist, is a folder of results itself, or
/// contains folders of results that are not named after the paper's configs. Call this function only if no
/// folder of results in `out` is named after one of the paper's configs.
fn refuse_without_results(out: &Path) -> Result<()> {
    if !existing::exists(out)? {
        return Err(no_results(format!("there is no folder {}", out.display())));
    }
    if existing::is_file(&out.join(RECORDS))? {
        let message = format!(
            "{} is a folder of results; expected a folder that contains folders of results",
            out.display()
        );
        return Err(no_results(message));
    }
    let folders = existing::entries(out)?.into_iter().filter(|entry| entry.join(RECORDS).is_file());
    let mut names: Vec<String> =
        folders.map(|folder| folder.file_name().unwrap_or_default().display().to_string()).collect();
    names.sort_unstable();
    if names.is_empty() {
        return Ok(());
    }
    Err(no_results(format!("{}; it holds other folders of results: {}", holds_none(out), few(&names))))
}

/// Returns the message which says that a folder contains no results of the paper's configs.
fn holds_none(out: &Path) -> String {
    format!("{} holds no results of the paper's configs", out.display())
}

/// Returns an error with the text `message`, for a folder without results for the page. The error's help says which
/// folder `--out` must name.
fn no_results(message: String) -> Error {
    let names = CONFIGS.map(|(name, _)| name).join(", ");
    Error::input(message).with_help(format!(
        "let --out name the folder that contains the folders of results; each of them must be named after its config \
         ({names}); `raycl reproduce` without --page-only measures these configs"
    ))
}

/// Writes copies of the paper's configs and scenes into the output folder.
fn unpack(out: &mut OutFolder) -> Result<()> {
    let scenes = SCENES.files().filter_map(|file| Some((file.path().to_str()?, file.contents_utf8()?)));
    let scenes = scenes.map(|(name, text)| (format!("scenes/{name}"), alone(text)));
    let configs = CONFIGS.iter().map(|(name, text)| (format!("configs/{name}.toml"), alone(text)));
    out.write(&configs.chain(scenes).collect::<Vec<_>>())
}

/// Returns a file's text without the line that names its schema for editors, since the schema is not in the output
/// folder.
fn alone(text: &str) -> Vec<u8> {
    let rest =
        text.split_once('\n').filter(|(first, _)| first.starts_with("#:schema ")).map(|(_, rest)| rest);
    rest.unwrap_or(text).into()
}

/// Writes the page. Returns its path, and the devices' answers as text.
fn write_page(out: &mut OutFolder) -> Result<(PathBuf, String)> {
    let folders = present(out.path())?;
    let folders = folders.iter().map(|folder| Folder::read(folder)).collect::<Result<Vec<_>>>()?;
    if folders.is_empty() {
        return Err(no_results(holds_none(out.path())));
    }
    report::write_reproduction(&folders, out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_of_the_papers_configs_is_unpacked() {
        let out = tempfile::tempdir().expect("a folder");
        let choice = Choice::new(false, "--out DIR");
        OutFolder::open(out.path(), choice).and_then(|mut out| unpack(&mut out)).expect("it writes");
        for (name, _) in CONFIGS {
            crate::config::load(&out.path().join(format!("configs/{name}.toml")), &[])
                .expect("its scenes are there");
        }
    }

    fn args() -> Args {
        Args {
            device: vec!["cpu".to_owned(), "nvidia".to_owned()],
            out: PathBuf::from("out"),
            force: false,
            set: vec![("timing.launches".to_owned(), "1".to_owned())],
            resume: false,
            retry_failed: false,
            no_wait: false,
            page_only: false,
            quiet: false,
            verbose: false,
        }
    }

    #[test]
    fn a_page_of_results_with_other_names_is_refused_with_the_names_that_the_folders_must_have() {
        let folder = tempfile::tempdir().expect("a folder");
        let refused = |out: &Path| {
            let args = Args { out: out.to_owned(), page_only: true, device: Vec::new(), ..args() };
            let error = run(args).expect_err("no results of the paper's configs");
            let remedy = error.remedy();
            assert!(error.exit_code() == 2 && remedy.contains("(pictures, figure-6, figure-7, "), "{remedy}");
            error.to_string()
        };
        let message = format!("{} holds no results of the paper's configs", folder.path().display());
        assert_eq!(refused(folder.path()), message);
        let add = |name: &str| {
            std::fs::create_dir(folder.path().join(name)).expect("a folder");
            std::fs::write(folder.path().join(name).join(RECORDS), "").expect("a file");
        };
        ["rep", "b"].into_iter().for_each(add);
        let others = format!("{message}; it holds other folders of results");
        assert_eq!(refused(folder.path()), format!("{others}: b, rep"));
        ["c", "d", "e"].into_iter().for_each(add);
        assert_eq!(refused(folder.path()), format!("{others}: b, c, d, e, and 1 more"));
        let missing = folder.path().join("nowhere");
        assert_eq!(refused(&missing), format!("there is no folder {}", missing.display()));
        let own = refused(&folder.path().join("rep"));
        assert!(own.contains("rep is a folder of results; expected a folder that contains "), "{own}");
    }

    #[cfg(unix)]
    #[test]
    fn nothing_is_written_into_a_folder_whose_path_is_not_utf8() {
        use std::os::unix::ffi::OsStrExt as _;
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join(std::ffi::OsStr::from_bytes(b"\xff"));
        let error = run(Args { out: out.clone(), ..args() }).expect_err("a path that is not UTF-8");
        assert_eq!((error.exit_code(), out.exists()), (2, false), "{error}");
        assert_eq!(error.to_string(), format!("the path {} is not UTF-8", out.display()));
    }

    #[test]
    fn only_figure_8_measures_the_devices_peak_rates() {
        for (name, _) in CONFIGS {
            let run = arguments(&args(), name);
            assert_eq!(run.peak, (name == "figure-8").then_some(None), "{name}");
        }
        assert!(CONFIGS.iter().any(|(name, _)| *name == "figure-8"));
    }

    #[test]
    fn each_config_is_run_into_its_own_folder_with_the_choices_of_the_command() {
        let command = |args: &Args| format!("{:?}", arguments(args, "quick"));
        let text = command(&args());
        let [config, out] = ["out/configs/quick.toml", "out/quick"];
        for part in [
            format!("config: {config:?}"),
            format!("out: Some({out:?})"),
            "device: [\"cpu\", \"nvidia\"]".to_owned(),
            "set: [(\"timing.launches\", \"1\")]".to_owned(),
            "no_wait: false".to_owned(),
            "force: false".to_owned(),
            "resume: false".to_owned(),
            "retry_failed: false".to_owned(),
        ] {
            assert!(text.contains(&part), "{part} is not in {text}");
        }
        for (args, part) in [
            (Args { no_wait: true, ..args() }, "no_wait: true"),
            (Args { force: true, ..args() }, "force: true"),
            (Args { resume: true, ..args() }, "resume: true"),
            (Args { retry_failed: true, ..args() }, "retry_failed: true"),
        ] {
            assert!(command(&args).contains(part), "{part}");
        }
        let own = command(&Args { set: vec![("scenes".to_owned(), "['sc/a.toml']".to_owned())], ..args() });
        let path = std::path::absolute("sc/a.toml").expect("a path");
        assert!(own.contains(path.to_str().expect("UTF-8")), "the current folder's scene: {own}");
    }

    #[test]
    fn a_run_that_failed_keeps_its_remedy_and_a_mistake_is_not_to_be_continued() {
        let folder = tempfile::tempdir().expect("a folder");
        let message_and_remedy = |error: Error| {
            let choice = Choice::new(false, "--out DIR");
            let mut out = OutFolder::open(folder.path(), choice).expect("a folder");
            let mut stages = Stages::of(4, 4, observer(true, false));
            let stopped = stopped(error, &args(), &mut out, &mut stages, 4);
            (stopped.to_string(), stopped.remedy().to_owned())
        };
        let again = resuming(&args(), &run::deciding_variables(&args().device));
        let command = format!("to continue from here: {again}");
        let [failed, mistake] =
            [Error::run("full"), Error::input("no")].map(|error| error.with_help("remedy"));
        assert_eq!(message_and_remedy(failed), ("full".to_owned(), format!("remedy\n{command}")));
        assert_eq!(message_and_remedy(mistake), ("no".to_owned(), "remedy".to_owned()));
        let interrupted = message_and_remedy(Error::interrupted("half"));
        assert_eq!(interrupted, ("interrupted: 0 of 4 points are done".to_owned(), command));
    }

    #[test]
    fn the_command_that_continues_names_every_device() {
        let args = args();
        let devices = "--device cpu --device nvidia";
        let command = format!("raycl reproduce --out out {devices} --set timing.launches=1 --resume");
        assert_eq!(resuming(&args, &[]), command);
        let variables = ["POCL_DEVICES=pthread basic".to_owned()];
        assert_eq!(resuming(&args, &variables), format!("POCL_DEVICES='pthread basic' {command}"));
        let other = resuming(&Args { no_wait: true, force: true, ..args }, &[]);
        assert!(other.ends_with(" --no-wait --force --resume"), "{other}");
        let again = resuming(&Args { resume: true, retry_failed: true, ..self::args() }, &[]);
        assert!(again.ends_with(" --retry-failed --resume"), "{again}");
    }
}
