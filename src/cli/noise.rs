//! `raycl noise`: measures the smallest difference in time that runs on this machine can show.

use super::choice::parse_assignment;
use super::progress::observer;
use super::run;
use crate::config::{Experiment, parse_built_in, with_absolute_paths};
use crate::device::common_names;
use crate::error::{Error, Result};
use crate::numbers::significant;
use crate::record::{Folder, Noise, percent};
use crate::words::{counted, counted_are};
use std::path::Path;

/// Arguments of `raycl noise`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl noise
  raycl noise --device nvidia
  raycl noise --device cpu --set timing.time_limit_ms=2000 --json

For each device, the command prints the smallest difference between two times that one launch can show, and the smallest that all launches together can show. A launch is one measurement of the whole experiment by new worker processes. Times differ more between launches than within one launch.")]
pub struct Args {
    /// Measure on the devices that NAME selects. NAME is part of a device's name, platform or vendor; a label in `raycl
    /// devices`; a kind (cpu, gpu, accelerator); or all [default: the devices in RAYCL_DEVICE or your settings, else
    /// all]
    #[arg(long, value_name = "NAME")]
    device: Vec<String>,
    /// Change a value of the experiment that the command measures (configs/noise.toml in raycl's repository). If VALUE
    /// contains paths of scenes, they are relative to the current folder
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse_assignment)]
    set: Vec<(String, String)>,
    /// If another process is measuring on a selected device, end at once instead of waiting for it
    #[arg(long)]
    no_wait: bool,
    /// Print one JSON object per device instead of text
    #[arg(long)]
    json: bool,
    /// Do not print the progress
    #[arg(short, long)]
    quiet: bool,
}

/// The names and contents of the experiment's files. The experiment's files are built into raycl, so that
/// `raycl noise` needs no other files.
const FILES: [(&str, &str); 2] = [
    ("configs/noise.toml", include_str!("../../configs/noise.toml")),
    ("scenes/still-life.toml", include_str!("../../scenes/still-life.toml")),
];

/// Measures the experiment in a temporary folder, and prints the noise of each device. Returns an error if nothing
/// could be measured.
pub fn run(args: Args) -> Result<()> {
    let failed = |error: std::io::Error| {
        Error::run(format!("cannot create a temporary folder: {error}"))
            .with_help("free up space in the folder for temporary files, or set TMPDIR to another folder")
    };
    let folder = tempfile::tempdir().map_err(failed)?;
    unpack(folder.path()).map_err(failed)?;
    let set = with_absolute_paths(&args.set);
    let experiment = experiment(folder.path(), &set)?;
    let out = folder.path().join("out");
    let mut run = run::Args::of(experiment.path, &out, &args.device, &set);
    run.no_wait = args.no_wait;
    let (_, measured) = run::measure(&run, observer(args.quiet, false).as_mut())?;
    measured.map_err(to_be_repeated)?;
    let noise = Noise::of(&Folder::read(&out)?);
    if noise.iter().all(|one| one.samples == 0) {
        return Err(Error::run("nothing could be measured")
            .with_help("`raycl devices` shows which devices are usable, and why others are not"));
    }
    match args.json {
        true => noise.iter().try_for_each(super::print_json),
        false => texts(&noise).into_iter().try_for_each(super::print),
    }
}

/// Returns the experiment whose files were unpacked into `folder`, with the values of `set`. Returns an error if the
/// experiment has no strategy.
fn experiment(folder: &Path, set: &[(String, String)]) -> Result<Experiment> {
    let (name, text) = FILES[0];
    let experiment = parse_built_in(&folder.join(name), name, text, set)?;
    if experiment.strategies.is_empty() {
        let help = "add one with --set 'strategies=[\"naive\"]'; `raycl strategies` lists the presets";
        return Err(Error::input("the experiment has no strategy, so it measures no device").with_help(help));
    }
    Ok(experiment)
}

/// If the user interrupted the measurement, returns an error that says that no results are kept. (The message of
/// `error` says which results are kept, but `raycl noise` removes the temporary folder with all results.) Returns
/// `error` unchanged if it has another cause.
fn to_be_repeated(error: Error) -> Error {
    match error {
        Error::Interrupted { .. } => {
            Error::interrupted("no results are kept").with_help("run `raycl noise` again")
        }
        error => error,
    }
}

fn unpack(folder: &Path) -> std::io::Result<()> {
    for (name, text) in FILES {
        let path = folder.join(name);
        path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
        std::fs::write(path, text)?;
    }
    Ok(())
}

/// Returns the lines about each device's noise. The lines call each device by its common name; devices whose common
/// names would be equal keep the names that their drivers report.
fn texts(all: &[Noise]) -> Vec<String> {
    let names = common_names(all.iter().map(|noise| noise.device.as_str()));
    all.iter().map(|noise| text(noise, &names[noise.device.as_str()])).collect()
}

/// Returns the lines about a device; `device` is the device's name in the lines.
fn text(noise: &Noise, device: &str) -> String {
    let part = |part: Option<f64>| part.map_or("not known".to_owned(), percent);
    let causes = &noise.causes;
    let mut lines = vec![
        format!("{device}, {} in {}", counted(noise.samples, "sample"), counted(noise.launches, "launch")),
        format!("  smallest difference that one launch can show             {}", part(noise.within_launch)),
        format!(
            "  smallest difference that all launches together can show  {}",
            part(noise.between_launches)
        ),
        format!("  upper half of the 95% interval of a point's time         {}", part(noise.own_time)),
    ];
    lines.extend(noise.not_compared.as_ref().map(|why| format!("  {why}")));
    let number = |value: f64| significant(value, 2);
    if let (Some(all), Some(others), Some(stolen)) = (causes.processors, causes.others, causes.stolen) {
        let words = [others, stolen].map(number);
        lines.push(format!(
            "  on average, other processes kept {} of {all} processors busy, and other virtual machines on the same hardware used {} more",
            words[0], words[1]
        ));
    }
    let samples = |count: u32| counted(count as usize, "sample");
    lines.extend(causes.preempted_samples.map(|count| counted_are(count as usize, "sample")).map(|are| {
        format!("  {are} left out of all results, since other programs probably used the processors")
    }));
    if let Some(percentiles) = causes.core_to_core_ns {
        let [low, high] = percentiles.map(number);
        lines.push(format!(
            "  in four fifths of the readings, a cache line took {low} to {high} ns from one processor to another"
        ));
    }
    if let Some([least, most]) = causes.clocks_mhz {
        let governor = causes.governor.as_ref().map_or(String::new(), |name| format!(", governor {name}"));
        lines.push(format!("  when the run began, processors ran at {least:.0} to {most:.0} MHz{governor}"));
    }
    lines.extend(causes.device_clock_mhz.map(|mhz| format!("  the device ran at {mhz:.0} MHz")));
    lines.extend(
        causes
            .throttled_samples
            .map(|count| format!("  the device throttled (reduced its clock rate) in {}", samples(count))),
    );
    let threads = |count: u32| counted(count as usize, "thread");
    lines.extend(causes.threads.map(|count| format!("  the device used {}", threads(count))));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Causes;

    /// Returns the lines of the text that reports this noise; several spaces in a row are replaced by one.
    fn lines(noise: &Noise) -> Vec<String> {
        let text = texts(std::slice::from_ref(noise)).concat();
        text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
    }

    #[test]
    fn each_difference_and_each_cause_has_a_line_of_its_own() {
        let noise = Noise {
            device: "a device".into(),
            samples: 60,
            launches: 3,
            within_launch: Some(0.01),
            between_launches: Some(0.02),
            own_time: Some(0.03),
            not_compared: Some("1 of 4 points was not compared".into()),
            causes: Causes {
                processors: Some(8.0),
                others: Some(0.25),
                stolen: Some(0.5),
                preempted_samples: Some(4),
                core_to_core_ns: Some([20.0, 90.0]),
                clocks_mhz: Some([1200.0, 3400.0]),
                governor: Some("powersave".into()),
                device_clock_mhz: Some(1980.0),
                throttled_samples: Some(7),
                threads: Some(6),
            },
        };
        assert_eq!(
            lines(&noise),
            [
                "a device, 60 samples in 3 launches".to_owned(),
                format!("smallest difference that one launch can show {}", percent(0.01)),
                format!("smallest difference that all launches together can show {}", percent(0.02)),
                format!("upper half of the 95% interval of a point's time {}", percent(0.03)),
                "1 of 4 points was not compared".to_owned(),
                "on average, other processes kept 0.25 of 8 processors busy, and other virtual machines on the same hardware used 0.50 more"
                    .to_owned(),
                "4 samples are left out of all results, since other programs probably used the processors"
                    .to_owned(),
                "in four fifths of the readings, a cache line took 20 to 90 ns from one processor to another"
                    .to_owned(),
                "when the run began, processors ran at 1200 to 3400 MHz, governor powersave".to_owned(),
                "the device ran at 1980 MHz".to_owned(),
                "the device throttled (reduced its clock rate) in 7 samples".to_owned(),
                "the device used 6 threads".to_owned(),
            ]
        );
    }

    fn with_causes(causes: Causes) -> Noise {
        Noise {
            device: "a device".into(),
            samples: 60,
            launches: 3,
            within_launch: None,
            between_launches: None,
            own_time: None,
            not_compared: None,
            causes,
        }
    }

    #[test]
    fn devices_of_one_common_name_have_different_headings() {
        let all = ["basic", "pthread"].map(|driver| Noise {
            device: format!("{driver}-Intel(R) Xeon(R) Processor"),
            ..with_causes(Causes::default())
        });
        let texts = texts(&all);
        assert_ne!(texts[0].lines().next(), texts[1].lines().next());
    }

    #[test]
    fn one_thread_is_a_thread() {
        let causes = Causes { threads: Some(1), ..Causes::default() };
        let noise = with_causes(causes);
        assert!(lines(&noise).contains(&"the device used 1 thread".to_owned()), "{:?}", lines(&noise));
    }

    #[test]
    fn causes_that_the_system_does_not_report_have_no_line() {
        let noise = with_causes(Causes::default());
        let printed = lines(&noise);
        assert_eq!(printed.len(), 4, "{printed:?}");
        assert!(printed[1..].iter().all(|line| line.ends_with("not known")), "{printed:?}");
    }

    #[test]
    fn an_interrupted_measurement_is_repeated_and_a_failed_one_keeps_its_message_and_remedy() {
        let interrupted = to_be_repeated(Error::interrupted("finished launches are kept"));
        assert_eq!((interrupted.exit_code(), interrupted.remedy()), (130, "run `raycl noise` again"));
        assert_eq!(interrupted.to_string(), "interrupted: no results are kept");
        let failed = to_be_repeated(Error::run("full").with_help("make room"));
        assert_eq!((failed.to_string().as_str(), failed.remedy()), ("full", "make room"));
    }

    /// Returns the built-in experiment, with the value `value` for `key`.
    fn with(key: &str, value: &str) -> Result<Experiment> {
        let folder = tempfile::tempdir().expect("a folder");
        unpack(folder.path()).expect("it writes");
        experiment(folder.path(), &with_absolute_paths(&[(key.to_owned(), value.to_owned())]))
    }

    #[test]
    fn the_experiment_that_is_built_in_can_be_read() {
        with("timing.launches", "1").expect("its scene is there");
    }

    #[test]
    fn scenes_that_are_set_are_relative_to_the_current_folder() {
        // Cargo runs the tests in the repository's folder.
        let own = with("scenes", "[\"scenes/teapot.toml\"]").expect("the scene is there");
        assert!(own.scenes[0].path.is_absolute() && own.scenes[0].path.ends_with("scenes/teapot.toml"));
        let missing = with("scenes", "[\"none/teapot.toml\"]").expect_err("a mistake").in_a_line();
        assert!(missing.starts_with("--set:1:") && missing.contains("there is no scene file"), "{missing}");
    }

    #[test]
    fn a_mistake_in_a_value_is_reported_without_the_temporary_folder() {
        let Error::Input(limit) = with("timing.max_samples", "10").expect_err("a mistake") else { panic!() };
        assert_eq!(limit.message, "max_samples 10 is less than min_samples 1000");
        let label = "min_samples is 1000 in configs/noise.toml (built in):";
        assert!(limit.label.starts_with(label), "{}", limit.label);
        let none = with("strategies", "[]").expect_err("a mistake");
        assert!(none.exit_code() == 2 && none.to_string().contains("has no strategy"), "{none}");
    }
}
