//! `raycl run`: runs an experiment and writes a folder of results.

mod earlier;
mod environment;
#[cfg(test)]
mod fixtures;
mod folders;
mod forecast;
mod interruption;
mod measuring;
mod resume;
mod sbatch;
mod shard;
mod spread;
mod two_kernels;

pub(crate) use interruption::forget_interruption;
pub(crate) use resume::deciding_variables;

use super::choice::{parse_assignment, parse_seconds, whole};
use super::measured::{MEASURE_AGAIN, refuse_failed};
use super::progress::observer;
use crate::cache::Cache;
use crate::config::{self, Experiment};
use crate::device::{DeviceInfo, check_alike, matching_indices};
use crate::device_lock::Locks;
use crate::entry::entry;
use crate::error::{Error, Result};
use crate::existing;
use crate::experiment::{
    Fault, Listed, Observer, Past, Plan, Results, Run, asleep, distinct_scenes, dry_run, find_devices,
    keeps_moved_samples,
};
use crate::output::{Choice, OutFolder, refuse_other_folders};
use crate::peak::{self, Peak};
use crate::printer;
use crate::program::Sources;
use crate::record::journals::{IMAGES, RECORDS, SUMMARY};
use crate::record::{Folder, Record, refuse_closed, refuse_file, summary_terminal};
use crate::report::Written;
use crate::settings;
use crate::shard::{Asked, ShardPlan};
use crate::words::in_singular;
use earlier::foreseen;
use environment::environment;
use folders::{default_folder, new_folder};
use forecast::forecast;
use interruption::interrupt_flag;
use resume::{choices, say_how_to_resume};
use spread::Spread;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// The default time limit for opening a device, for building a point's kernels and casting its first image, and for
/// casting each later frame.
const HANG_LIMIT: Duration = Duration::from_secs(600);

/// Arguments of `raycl run`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl run configs/quick.toml
  raycl run configs/figure-8.toml --dry-run
  raycl run configs/figure-8.toml --device nvidia --out results/figure-8-h200
  raycl run configs/figure-6.toml --device pocl --device nvidia
  raycl run configs/quick.toml --cl-dir base --cl-dir new --fail-on-regression 5
  raycl run configs/quick.toml --set image_sizes='[[800, 500]]' --set timing.time_limit_ms=2000

The exit code is 0 if no point has failed. It is 1 if a point has failed, if --fail-on-regression finds a regression, or if the run itself fails. It is 2 for a mistake in the arguments or files, and 130 if Ctrl-C or SIGTERM stops the run. A point that does not fit on its device, or that is meant for another kind of device, has not failed.")]
pub struct Args {
    /// The config: a TOML file that describes the experiment
    config: PathBuf,
    /// The folder of results [default: results/NAME, where NAME is the name of the config's file without .toml; if this
    /// folder exists, results/NAME-2, then results/NAME-3 and so on. With --resume: the latest of these folders. Your
    /// settings may name another folder instead of results]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write into the folder of --out even if it contains files that raycl did not write. Existing results are kept
    #[arg(long, requires = "out")]
    pub(super) force: bool,
    /// Measure on the devices that NAME selects, instead of the config's devices. NAME is part of a device's name,
    /// platform or vendor; a label in `raycl devices`; a kind (cpu, gpu, accelerator); or all [default if the config
    /// names no devices: the devices in RAYCL_DEVICE or your settings, else all]
    #[arg(long, value_name = "NAME")]
    device: Vec<String>,
    /// Continue an interrupted run: keep its measurements and measure the missing points
    #[arg(long)]
    pub(crate) resume: bool,
    /// With --resume, also measure two kinds of points again: points that failed, and points that did not fit because
    /// other programs or other points were using the memory that these points need
    #[arg(long, requires = "resume")]
    pub(super) retry_failed: bool,
    /// Time limit in seconds for each of three steps: opening a device; building a point's kernels and casting
    /// the point's first image; casting one of the point's later frames
    #[arg(long, value_name = "SECONDS", default_value = "600", value_parser = parse_seconds)]
    hang_limit: Duration,
    /// Distribute the points over several devices of the same model, instead of measuring every point on every device.
    /// Not with two folders of --cl-dir
    #[arg(long)]
    spread: bool,
    /// Also report the speed as a share of the device's peak rates. raycl reads the peak rates from FILE, written by
    /// `raycl peak --out`. Without FILE, raycl measures the peak rates first (with --resume, only if the results lack
    /// the rates of a device)
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true)]
    pub(super) peak: Option<Option<PathBuf>>,
    /// If another process is measuring on a selected device, end at once instead of waiting for it
    #[arg(long)]
    pub(super) no_wait: bool,
    /// Measure nothing; print every point, whether it fits on its device, and how much __local, __constant and scratch
    /// memory it needs. (Scratch memory is global memory for working vectors.) With --json, also print how much private
    /// memory and how much other global memory the point needs. With --resume, also print which points are done
    #[arg(long)]
    dry_run: bool,
    /// Change a value of the config; may be given several times
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse_assignment)]
    set: Vec<(String, String)>,
    /// Print one JSON object per point instead of tables; with --dry-run, the object states how many bytes of memory
    /// the point needs
    #[arg(long)]
    json: bool,
    /// Print neither the progress, nor the tables, nor the paths of written files
    #[arg(short, long)]
    quiet: bool,
    /// Print a line for every finished point, instead of a progress bar. Not with --quiet
    #[arg(short, long, conflicts_with = "quiet")]
    verbose: bool,
    /// Use the kernel files in this folder instead of the built-in files of the same names. A file with a new name in
    /// the folder of an axis of strategies, such as cast/vectors/, adds a value to this axis. If the option is given
    /// twice, raycl measures the kernels of both folders in the same rounds and compares them
    #[arg(long, value_name = "DIR")]
    cl_dir: Vec<PathBuf>,
    /// With --cl-dir given twice: exit with code 1 if it is statistically significant that the second folder's kernels
    /// are slower by more than PERCENT. raycl tests each point, the mean of each strategy's points, and the mean of all
    /// points except baselines (ray casters that do not use OpenCL). Also exit with code 1 if a point can be measured
    /// with the first folder's kernels, but not with the second folder's
    #[arg(long, value_name = "PERCENT", value_parser = super::compare::percent, requires = "cl_dir")]
    fail_on_regression: Option<f64>,
    /// Measure only one part of the experiment: 3/16 is part 3 of 16. With auto, both numbers come from the program
    /// that started the processes (such as Slurm or MPI); with auto/16, only the number of the part comes from this
    /// program. `raycl merge` merges the parts. Needs --out; not with --spread, --dry-run or two folders of --cl-dir
    #[arg(long, value_name = "N/OF", requires = "out", conflicts_with_all = ["spread", "dry_run"])]
    shard: Option<Asked>,
    /// Print a shell script that submits two Slurm jobs: the first job measures the experiment in N shards, 1 to
    /// 100,000, and the second job merges the results. raycl itself submits no job. Not with --shard, --spread,
    /// --dry-run, --resume or two folders of --cl-dir
    #[arg(long, value_name = "N", conflicts_with_all = ["shard", "spread", "dry_run", "resume", "retry_failed"], value_parser = whole::<u32>(1..=100_000))]
    sbatch: Option<u32>,
    /// For tests: make a worker process fail, such as segv@cast:3
    #[arg(long, hide = true)]
    fault: Option<Fault>,
    /// For tests: cast nothing; every frame only waits for this many milliseconds
    #[arg(long, hide = true, value_name = "MS")]
    asleep: Option<f64>,
}

impl Args {
    /// Returns the arguments of a run that another subcommand starts.
    pub(crate) fn of(config: PathBuf, out: &Path, device: &[String], set: &[(String, String)]) -> Self {
        let (out, device, set) = (Some(out.to_owned()), device.to_vec(), set.to_vec());
        Self {
            config,
            out,
            force: false,
            device,
            resume: false,
            retry_failed: false,
            hang_limit: HANG_LIMIT,
            spread: false,
            peak: None,
            no_wait: false,
            dry_run: false,
            set,
            json: false,
            quiet: true,
            verbose: false,
            cl_dir: Vec::new(),
            fail_on_regression: None,
            shard: None,
            sbatch: None,
            fault: None,
            asleep: None,
        }
    }
}

/// Returns an error if a path is not UTF-8: workers receive the paths as JSON, and records and pages contain
/// them.
pub(super) fn named_in_text<'a>(paths: impl IntoIterator<Item = &'a PathBuf>) -> Result<()> {
    match paths.into_iter().find(|path| path.to_str().is_none()) {
        Some(path) => Err(Error::input(format!("the path {} is not UTF-8", path.display()))
            .with_help("rename the file or folder, or use a symbolic link whose path is UTF-8")),
        None => Ok(()),
    }
}

/// Runs an experiment; with `--dry-run`, `--shard` or `--sbatch`, does what the option says instead.
pub fn run(args: Args) -> Result<()> {
    let peak = args.peak.iter().flatten();
    named_in_text(std::iter::once(&args.config).chain(&args.out).chain(&args.cl_dir).chain(peak))?;
    if args.dry_run {
        return foresee(&args);
    }
    if let Some(asked) = args.shard {
        return shard::run(&args, asked);
    }
    if let Some(shards) = args.sbatch {
        return sbatch::run(&args, shards);
    }
    let (out, _) = measure_resumably(&args, observer(args.quiet, args.verbose).as_mut())?;
    report(&args, &out)
}

/// Returns the run that the arguments describe. With `--spread`, returns an error if the devices are not of
/// the same model.
fn run_of<'a>(
    args: &'a Args,
    experiment: &'a Experiment,
    devices: &'a [&'a DeviceInfo],
    sources: &'a [Sources],
    locks: &'a Locks,
) -> Result<Run<'a>> {
    if args.spread {
        check_alike(devices)?;
    }
    Ok(Run {
        experiment,
        overrides: &args.set,
        devices,
        sources: &sources[0],
        other_sources: sources.get(1),
        limit: args.hang_limit,
        retry_failed: args.retry_failed,
        keeps_moved_samples: keeps_moved_samples(),
        locks,
        spread: args.spread,
        blocks: None,
        ahead: None,
        caches_programs: Cache::of_user().is_usable(),
    })
}

/// Returns all devices of this machine or, with `--asleep` (for tests), only a stand-in for a device.
fn listed(args: &Args) -> Result<Vec<Listed>> {
    match args.asleep {
        Some(frame_ms) => Ok(vec![asleep::device(frame_ms).into()]),
        None => find_devices(args.cl_dir.first().map(PathBuf::as_path)),
    }
}

/// Returns an error if the folder `out` belongs to an experiment that is divided into shards. `raycl merge`
/// writes its results into the folder of an experiment in shards, so a run without shards must not write
/// results there.
fn refuse_shards(out: &Path) -> Result<()> {
    match ShardPlan::read(out)? {
        Some(plan) => Err(Error::input(format!(
            "{} holds an experiment that is divided into {} shards",
            out.display(),
            plan.header.shards
        ))
        .with_help(
            "measure one shard with `--shard N/OF`, merge all shards with `raycl merge`, or choose another \
                folder with --out",
        )),
        None => Ok(()),
    }
}

/// Returns true if raycl chooses the name of a new folder for the run's results.
fn takes_new_folder(args: &Args) -> bool {
    args.out.is_none() && !args.resume
}

/// Returns the folder of results. Returns an error if the path of this folder or of the config is not UTF-8, or if the
/// run must not write into the folder.
fn folder_of_results(args: &Args, experiment: &Experiment) -> Result<PathBuf> {
    let out = args.out.clone().unwrap_or_else(|| default_folder(&experiment.name, args.resume));
    // The user may have named these paths without typing them: by RAYCL_RESULTS, or by TMPDIR for `raycl noise`.
    named_in_text([&experiment.path, &out])?;
    // A new run without --out needs no check: its default folder did not exist. If the folder exists by now, another
    // run has just made it, and `new_folder` makes a folder of another name.
    if !takes_new_folder(args) {
        refuse_shards(&out)?;
        refuse_file(&out).map_err(|error| error.with_help(shard::OTHER_FOLDER))?;
        refuse_closed(&out, shard::OTHER_FOLDER)?;
        refuse_other_folders(&out, choice(args), false)?;
    }
    Ok(out)
}

/// Measures the missing points. Returns the folder of results and the records of all points. If the measurement ends
/// early, the error says how to continue.
pub(crate) fn measure_resumably(args: &Args, observer: &mut dyn Observer) -> Result<(PathBuf, Vec<Record>)> {
    let (out, measured) = measure(args, observer)?;
    let records = measured.map_err(|error| say_how_to_resume(error, args, &out))?;
    Ok((out, records))
}

/// Measures the missing points. Returns the folder of results and a second result: the records of all points,
/// or the error that ended the run in this folder. The outer result is an error if the run fails before it
/// opens the folder, or cannot make the folder. No error of this function says how to continue the run, since
/// the way to continue depends on the command that called it.
pub(crate) fn measure(args: &Args, observer: &mut dyn Observer) -> Result<(PathBuf, Result<Vec<Record>>)> {
    let sources = two_kernels::sources(args, args.spread)?;
    let experiment = config::load(&args.config, &args.set)?;
    let peak = peak_of_file(args)?;
    let out = folder_of_results(args, &experiment)?;
    // From here on, the first Ctrl-C or SIGTERM only sets a flag, so that the run can end in order. This process starts
    // no driver: child processes list the devices and measure the points.
    let interrupted = interrupt_flag()?;
    let devices = listed(args)?;
    let infos = chosen(args, &experiment, &devices)?;
    let locks = Locks::of_machine(!args.no_wait);
    let experiment = distinct_scenes(experiment)?;
    let run = run_of(args, &experiment, &infos, &sources, &locks)?;
    let spread = args.spread.then(|| Spread::of(&run, &out)).transpose()?;
    let run = Run { blocks: spread.as_ref().map(Spread::blocks), ..run };
    // A new run reads its scenes before it makes its folder. If the run made the folder first, a mistake in a
    // scene would leave a folder in which raycl would refuse to run the corrected command.
    let expected = if args.resume { None } else { Some(foreseen(&run, &out, &Past::default())?) };
    let out = if takes_new_folder(args) { new_folder(&experiment.name) } else { out };
    let open = if args.resume { Results::resume } else { Results::create };
    let mut results = match open(&out, &environment(&experiment, &infos, &sources)) {
        Ok(results) => results,
        // If the folder exists, the run can be continued in it, so the folder is returned with the error.
        Err(error) if out.is_dir() => return Ok((out, Err(error))),
        Err(error) => return Err(error),
    };
    let is_ready = spread
        .iter()
        .try_for_each(|spread| spread.write(&out))
        .and_then(|()| keep_peak(args, &run, peak, &mut results, observer, &interrupted));
    let measured = is_ready.and_then(|()| {
        if !args.quiet {
            if args.resume && results.past().is_empty() {
                observer.says(&format!("{} has no results yet: the run begins", out.display()));
            }
            let expected = expected.map_or_else(|| foreseen(&run, &out, results.past()), Ok)?;
            observer.says(&expected.to_string());
            say_copies(&experiment, observer);
        }
        measuring::execute(args, run, &out, &mut results, observer, &interrupted)
    });
    Ok((out, measured))
}

/// Tells the user which scenes of the config are not measured, because their content equals that of another scene. Also
/// tells the user which strategies are measured under the name of an equal strategy.
fn say_copies(experiment: &Experiment, observer: &mut dyn Observer) {
    let of_scenes = experiment.scenes.iter().flat_map(|scene| scene.notes.clone());
    let notes = of_scenes.chain(experiment.notes_on_equal_strategies());
    notes.for_each(|note| observer.says(&format!("note: {note}")));
}

/// Returns the file of `--peak=FILE`; `None` if no file is given.
fn peak_file(args: &Args) -> Option<&Path> {
    args.peak.as_ref()?.as_deref()
}

/// Returns the peak rates in the file of `--peak=FILE`; `None` if no file is given.
fn peak_of_file(args: &Args) -> Result<Option<Vec<Peak>>> {
    peak_file(args).map(Peak::read).transpose()
}

/// With `--peak`, stores the devices' peak rates in the folder of results: the rates in the file of `--peak=FILE` or,
/// without a file, measured rates. If the folder has usable rates of all devices, nothing is measured. Removes outdated
/// rates from the folder, even without `--peak`: rates that were measured on one of the run's devices, but with another
/// driver or in another state. Unless `--quiet` is given, a note names the devices that still have no rates in the
/// folder. The note is printed only if `--peak=FILE` is given, or if outdated rates were removed from the folder.
fn keep_peak(
    args: &Args,
    run: &Run<'_>,
    of_file: Option<Vec<Peak>>,
    results: &mut Results,
    observer: &mut dyn Observer,
    interrupted: &AtomicBool,
) -> Result<()> {
    let wanted = super::peak::Wanted {
        patterns: &patterns(args, run.experiment),
        cl_dir: args.cl_dir.first().map(PathBuf::as_path),
        no_wait: args.no_wait,
    };
    let rates = match of_file {
        Some(of_file) => of_file,
        None if args.peak.is_some() && !results.has_peak_of(run.devices) => {
            wanted.measured(observer, interrupted)?
        }
        None => Vec::new(),
    };
    let left_out = results.keep_peak(rates, run.devices)?;
    if !args.quiet
        && let Some(note) = without_peaks(args, run.devices, results.peak(), &left_out)
    {
        printer::tell(printer::plain(&note));
    }
    Ok(())
}

/// Returns a note that names the devices without peak rates in `peaks`. The note also names the file in which
/// the rates of the named devices are missing. The named file is that of `--peak=FILE` or, without this option, the
/// folder's file of peak rates. Returns `None` if every device has rates, or if `--peak=FILE` is not given and
/// `left_out` is empty. `left_out` contains outdated rates: rates that were measured on one of `devices`, but with
/// another driver or in another state. If a device that the note names has outdated rates, the note states the device's
/// present driver and state.
fn without_peaks(args: &Args, devices: &[&DeviceInfo], peaks: &[Peak], left_out: &[Peak]) -> Option<String> {
    let of_folder = || (!left_out.is_empty()).then(|| format!("the folder's {}", peak::FILE));
    let file = peak_file(args).map(|file| file.display().to_string()).or_else(of_folder)?;
    let is_unknown = |device: &&&DeviceInfo| peaks.iter().all(|peak| peak.device != device.label);
    let name = |device: &&DeviceInfo| match left_out.iter().any(|peak| peak.may_be_of(device)) {
        true => {
            let state = device.state().split(" | ").map(in_singular).collect::<Vec<_>>().join(", ");
            format!("{} in its present state (driver {}, {state})", device.label, device.driver)
        }
        false => device.label.clone(),
    };
    let mut unknown: Vec<String> = Vec::new();
    for name in devices.iter().filter(is_unknown).map(name) {
        entry(&mut unknown, |known| *known == name, || name.clone());
    }
    (!unknown.is_empty()).then(|| {
        format!(
            "note: {file} has no peak rates of {}, so the results do not state the speed as a share of these rates; \
             `raycl peak --device NAME --out FILE` measures them",
            unknown.join(", ")
        )
    })
}

fn choice(args: &Args) -> Choice {
    Choice::new(args.force, "--out DIR")
}

/// Returns the number of points and of steps in a run; a step is the measurement of one point in one
/// launch.
pub(super) fn count(args: &Args, devices: &[Listed]) -> Result<[usize; 2]> {
    let experiment = distinct_scenes(config::load(&args.config, &args.set)?)?;
    let infos = chosen(args, &experiment, devices)?;
    let points = Plan::new(&experiment, infos.len()).points.len();
    Ok([points, points * experiment.timing.launches as usize])
}

/// Returns the devices to measure on. Returns an error if a word of [`patterns`] matches no device, or if a chosen
/// device cannot be used.
fn chosen<'d>(args: &Args, experiment: &Experiment, devices: &'d [Listed]) -> Result<Vec<&'d DeviceInfo>> {
    let infos: Vec<DeviceInfo> = devices.iter().map(|device| device.info.clone()).collect();
    let words = patterns(args, experiment);
    for word in &words {
        let matching = matching_indices(&infos, std::slice::from_ref(word));
        matching.map_err(|error| blamed(error, word, args, experiment))?;
    }
    matching_indices(&infos, &words)?.into_iter().map(|index| devices[index].chosen()).collect()
}

/// Returns an error about a word that selects devices, with the origin of this word before the message. The
/// origin of the word is the option `--device`, a location in the config, an environment variable or the
/// settings file. For the default word `all`, the message is unchanged.
fn blamed(error: Error, word: &str, args: &Args, experiment: &Experiment) -> Error {
    let of_config = experiment.devices.iter().find(|device| device.text == word);
    match of_config.map(|device| device.location.as_str()) {
        _ if !args.device.is_empty() => error.placed(|message| Error::input(format!("--device: {message}"))),
        Some(location) => error.placed(|message| Error::input(format!("{location}: {message}"))),
        None => settings::blame_device(error),
    }
}

/// Returns true if `--device` or the config names devices.
fn names_devices(args: &Args, experiment: &Experiment) -> bool {
    !args.device.is_empty() || !experiment.devices.is_empty()
}

/// Returns the words that select devices: the words of `--device` or, without this option, the words in the
/// config. If neither `--device` nor the config names a device, returns the word in `RAYCL_DEVICE` or, without this
/// environment variable, in the user's settings file. If these name no device either, returns `all`.
fn patterns(args: &Args, experiment: &Experiment) -> Vec<String> {
    match (args.device.as_slice(), experiment.devices.as_slice()) {
        ([], []) => vec![settings::device().unwrap_or_else(|| "all".to_owned())],
        ([], named) => named.iter().map(|device| device.text.clone()).collect(),
        (named, _) => named.to_vec(),
    }
}

/// Prints the plan of the run, for `--dry-run`. Returns an error if the run would refuse its arguments, its config, its
/// scenes, its devices or its folder of results. A folder that already holds results is no error, but a note: the plan
/// does not depend on these results. Locks are not checked, since other processes may release them before the run.
fn foresee(args: &Args) -> Result<()> {
    let sources = two_kernels::sources(args, args.spread)?;
    let experiment = config::load(&args.config, &args.set)?;
    peak_of_file(args)?;
    let out = folder_of_results(args, &experiment)?;
    let devices = listed(args)?;
    let infos = chosen(args, &experiment, &devices)?;
    let locks = Locks::of_machine(!args.no_wait);
    let experiment = distinct_scenes(experiment)?;
    let run = run_of(args, &experiment, &infos, &sources, &locks)?;
    let spread = args.spread.then(|| Spread::of(&run, &out)).transpose()?;
    let run = Run { blocks: spread.as_ref().map(Spread::blocks), ..run };
    if args.resume {
        // The run itself would refuse a damaged file of peak rates in its folder, so `--dry-run` refuses this
        // file too.
        Peak::stored_in(&out)?;
    }
    let past = if args.resume { Past::in_folder(&out)? } else { Past::default() };
    let expected = foreseen(&run, &out, &past)?;
    let points = dry_run(&run, &past)?;
    if args.quiet && !args.json {
        return Ok(());
    }
    let mut notes = experiment.notes_on_equal_strategies();
    notes.extend(note_on_results(args, &out)?);
    if args.quiet {
        notes.clear();
    }
    forecast(&points, &notes, &expected, args.json)
}

/// Returns a note for `--dry-run` if the run would be refused, because the folder `out` already holds results.
fn note_on_results(args: &Args, out: &Path) -> Result<Option<String>> {
    let is_refused = !args.resume && existing::exists(&out.join(RECORDS))?;
    Ok(is_refused.then(|| {
        format!("{} already holds results, so the run needs --resume or another folder", out.display())
    }))
}

/// Writes the report. With `--json`, then prints the records; otherwise, prints the results and their paths,
/// unless `--quiet` is given. With two options `--cl-dir`, also compares the times of the kernels of both
/// folders. If points failed, returns an error with exit code 1.
fn report(args: &Args, out: &Path) -> Result<()> {
    let (folder, written) = write_report(args, out)?;
    let records = &folder.records;
    if args.json {
        for record in records {
            super::print_json(record)?;
        }
    } else if !args.quiet {
        super::print_coloured(&summary_terminal(records, super::colour::on_output()))?;
        folder.notes.iter().try_for_each(|note| super::print(format!("note: {note}")))?;
        super::print(format!("Report:   {}", written.page.display()))?;
        super::print(format!("Pictures: {}", out.join(IMAGES).display()))?;
        super::print(format!(
            "Tables:   {}, {}; every point: {}",
            out.join(SUMMARY).display(),
            out.join("summary.csv").display(),
            out.join(RECORDS).display()
        ))?;
    }
    if args.cl_dir.len() == 2 {
        two_kernels::compare(&folder, args.fail_on_regression, leaves_out_tables(args))?;
    }
    let summary = out.join(SUMMARY);
    refuse_failed(records, format!("{} gives the reason for each point; {MEASURE_AGAIN}", summary.display()))
}

/// Writes the report of the results in the folder `out`. Returns the content of `out`, and the report's files. If a
/// file cannot be written, the error says how to continue the run.
pub(crate) fn write_report(args: &Args, out: &Path) -> Result<(Folder, Written)> {
    let folder = Folder::read(out)?;
    let folders = std::slice::from_ref(&folder);
    let written =
        OutFolder::open(out, choice(args)).and_then(|mut to| crate::report::write(folders, &mut to));
    let written = written.map_err(|error| say_how_to_resume(error, args, out))?;
    Ok((folder, written))
}

/// Returns true if the tables are left out of the output.
fn leaves_out_tables(args: &Args) -> bool {
    args.quiet || args.json
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn json_has_no_tables_in_between() {
        let quiet = Args::of(PathBuf::from("a.toml"), Path::new("out"), &[], &[]);
        assert!(leaves_out_tables(&quiet));
        let loud = Args { quiet: false, ..quiet };
        assert!(!leaves_out_tables(&loud));
        assert!(leaves_out_tables(&Args { json: true, ..loud }));
    }

    #[test]
    fn a_run_of_another_command_has_its_choices_and_the_usual_limit() {
        let words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
        let set = [("timing.seed".to_owned(), "3".to_owned())];
        let args = Args::of("a.toml".into(), Path::new("out"), &words(&["cpu"]), &set);
        assert_eq!((args.resume, args.force), (false, false));
        assert_eq!((args.config, args.out), (PathBuf::from("a.toml"), Some(PathBuf::from("out"))));
        assert_eq!((args.device, args.set), (words(&["cpu"]), set.to_vec()));
        // If a run is started by another subcommand, its time limit equals the default of `raycl run --hang-limit`.
        let usual = fixtures::args(&["a.toml"]).hang_limit;
        assert_eq!((args.hang_limit, usual), (Duration::from_secs(600), Duration::from_secs(600)));
    }

    #[cfg(unix)]
    #[test]
    fn a_run_of_another_command_refuses_a_path_that_is_not_utf8_before_it_looks_for_devices() {
        use std::os::unix::ffi::OsStrExt as _;
        let folder = tempfile::tempdir().unwrap();
        let [config, out] =
            [&b"\xff.toml"[..], b"\xff"].map(|name| folder.path().join(std::ffi::OsStr::from_bytes(name)));
        let of_raycl = |file: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
        let own = of_raycl("configs/quick.toml");
        std::fs::copy(&own, &config).unwrap();
        let set = [("scenes".to_owned(), format!("[{:?}]", of_raycl("scenes/triangle.toml")))];
        let refused = |config: &Path, out: &Path| {
            let args = Args::of(config.to_owned(), out, &["nosuch".to_owned()], &set);
            let error = measure(&args, observer(true, false).as_mut()).err().unwrap();
            (error.exit_code(), error.to_string())
        };
        for (path, refusal) in [(&out, refused(&own, &out)), (&config, refused(&config, folder.path()))] {
            assert_eq!(refusal, (2, format!("the path {} is not UTF-8", path.display())));
        }
    }

    #[test]
    fn what_the_arguments_say_of_a_run_is_in_the_run() {
        let args = fixtures::args(&[
            "a.toml",
            "--out",
            "out",
            "--resume",
            "--retry-failed",
            "--hang-limit",
            "2.5",
            "--set",
            "timing.seed=3",
        ]);
        let experiment = fixtures::experiment("local_sizes = [4]");
        let device = asleep::device(1.0);
        let sources = ["one", "two"].map(|folder| Sources::Folder(folder.into()));
        let locks = Locks::of_machine(false);
        let devices = [&device];
        let of = |args, sources| run_of(args, &experiment, &devices, sources, &locks).unwrap();
        let run = of(&args, &sources);
        assert_eq!((run.limit, run.retry_failed, run.spread), (Duration::from_millis(2500), true, false));
        assert_eq!(run.overrides, [("timing.seed".to_owned(), "3".to_owned())]);
        let is_folder = |sources: &Sources, name: &str| match sources {
            Sources::Folder(folder) => folder.as_os_str() == name,
            Sources::Embedded => false,
        };
        assert!(is_folder(run.sources, "one") && run.other_sources.is_some_and(|two| is_folder(two, "two")));
        let spread = fixtures::args(&["a.toml", "--spread"]);
        let run = of(&spread, &sources[..1]);
        assert!(run.spread && !run.retry_failed && run.other_sources.is_none() && run.blocks.is_none());
    }

    #[test]
    fn devices_that_the_file_of_peak_rates_lacks_are_named() {
        let [one, other, third] = ["the first", "other", "third"]
            .map(|label| DeviceInfo { label: label.to_owned(), ..asleep::device(1.0) });
        let peaks = [Peak { device: one.label.clone(), ..Peak::default() }];
        let note_for = |peak: &str, devices: &[&DeviceInfo]| {
            without_peaks(&fixtures::args(&["a.toml", peak]), devices, &peaks, &[])
        };
        let note = note_for("--peak=h200.json", &[&one, &other, &third, &other]).unwrap();
        assert!(note.starts_with("note: h200.json has no peak rates of other, third, so"), "{note}");
        assert_eq!(note_for("--peak=h200.json", &[&one]), None);
        assert_eq!(note_for("--peak", &[&one, &other]), None);
        // Peak rates that were measured with another driver are not used, whether they come from the file of
        // `--peak=FILE` or from the folder of results.
        let outdated = [Peak { driver: "another".into(), ..peaks[0].clone() }];
        for (words, file) in [
            (&["a.toml", "--peak=h200.json"][..], "h200.json"),
            (&["a.toml", "--resume"][..], "the folder's peak.json"),
        ] {
            let note = without_peaks(&fixtures::args(words), &[&one], &[], &outdated).unwrap();
            let state = "the first in its present state (driver 1, 1 compute unit), so";
            assert!(note.starts_with(&format!("note: {file} has no peak rates of {state}")), "{note}");
        }
    }

    /// The flag `interrupted` is set, so this test would fail with an error if peak rates were measured.
    #[test]
    fn peak_rates_that_the_folder_has_are_not_measured_again() {
        let experiment = fixtures::experiment("local_sizes = [4]");
        let (device, sources, locks) = (asleep::device(1.0), [Sources::Embedded], Locks::of_machine(false));
        let (devices, args) = ([&device], fixtures::args(&["a.toml", "--peak", "--quiet"]));
        let run = run_of(&args, &experiment, &devices, &sources, &locks).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let mut results = Results::create(folder.path(), &crate::record::Environment::default()).unwrap();
        let rates = Peak {
            device: device.label.clone(),
            platform: device.platform.clone(),
            driver: device.driver.clone(),
            ..peak::fixtures::rates()
        };
        results.keep_peak(vec![rates.clone()], &devices).unwrap();
        let interrupted = AtomicBool::new(true);
        keep_peak(&args, &run, None, &mut results, observer(true, false).as_mut(), &interrupted).unwrap();
        assert_eq!(results.peak(), [rates]);
    }

    #[test]
    fn only_devices_of_one_model_share_a_run() {
        let experiment = fixtures::experiment("local_sizes = [4]");
        let (one, other) = (asleep::device(1.0), asleep::device(2.0));
        let (sources, locks) = ([Sources::Embedded], Locks::of_machine(false));
        let is_refused = |words: &[&str]| {
            run_of(&fixtures::args(words), &experiment, &[&one, &other], &sources, &locks).is_err()
        };
        assert!(is_refused(&["a.toml", "--spread"]) && !is_refused(&["a.toml"]));
    }

    #[test]
    fn devices_are_those_of_the_option_or_else_of_the_config() {
        let experiment = fixtures::experiment("local_sizes = [4]\ndevices = ['pocl', 'nvidia']");
        let of = |words: &[&str]| patterns(&fixtures::args(words), &experiment);
        assert_eq!(of(&["a.toml"]), ["pocl", "nvidia"]);
        assert_eq!(of(&["a.toml", "--device", "gpu", "--device", "cpu"]), ["gpu", "cpu"]);
    }

    #[test]
    fn a_word_that_matches_no_device_is_reported_with_its_origin() {
        let devices = [Listed::from(asleep::device(1.0))];
        let experiment = fixtures::experiment("local_sizes = [4]\ndevices = ['all', 'nosuch']");
        let error_of = |words: &[&str]| chosen(&fixtures::args(words), &experiment, &devices).unwrap_err();
        let error = error_of(&["a.toml"]);
        let location = &experiment.devices[1].location;
        assert_eq!(error.to_string(), format!("{location}: no device matches 'nosuch'"));
        assert!(error.exit_code() == 2 && error.remedy().contains("The devices are:"), "{}", error.remedy());
        let error = error_of(&["a.toml", "--device", "all", "--device", "other"]);
        assert_eq!(error.to_string(), "--device: no device matches 'other'");
    }

    #[test]
    fn a_step_is_a_launch_of_a_point_on_a_device() {
        let folder = tempfile::tempdir().unwrap();
        let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
        let config = folder.path().join("a.toml");
        let text = format!(
            "question = '?'\nexpectation = '!'\nscenes = [{scene:?}]\nstrategies = ['naive']\n\
             baselines = ['serial']\nimage_sizes = [[8, 5], [16, 10]]\nlocal_sizes = [2, 4]\n\
             timing.launches = 3\n"
        );
        std::fs::write(&config, text).unwrap();
        let devices = [1.0, 2.0].map(|ms| Listed::from(asleep::device(ms)));
        // For each image size, there are one point of the baseline and, on each device, two points with
        // different local sizes.
        let config = config.to_str().unwrap();
        assert_eq!(
            count(&fixtures::args(&[config]), &devices).unwrap(),
            [2 * (1 + 2 * 2), 3 * 2 * (1 + 2 * 2)]
        );
        let fewer = fixtures::args(&[config, "--set", "timing.launches=1", "--set", "baselines=[]"]);
        assert_eq!(count(&fewer, &devices[..1]).unwrap(), [4, 4]);
    }
}
