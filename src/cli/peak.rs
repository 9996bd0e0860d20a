//! `raycl peak`: measures a device's peak rates.

use super::choice::one_device;
use super::measured::{store, until_error};
use super::turn::hold;
use crate::child::output_unless;
use crate::clock::LOOK_UP;
use crate::device::{Device, DeviceInfo, common_names, discover, matching_indices, select};
use crate::error::{Error, Result};
use crate::experiment::Observer;
use crate::numbers::significant;
use crate::output::{Choice, Target};
use crate::own_program::own_program;
use crate::peak::{Figure, Peak, measure};
use crate::printer;
use crate::program::Sources;
use crate::record::dirty_program;
use crate::settings;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// Arguments of `raycl peak`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl peak
  raycl peak --device nvidia --out h200-peak.json
  raycl run configs/beyond.toml --peak=h200-peak.json
  raycl peak --json | jq '.[0].fma_per_s.median'

The numbers are medians of repeated measurements, with quartiles. A latency is measured by one work-item, which waits for each result before its next step. Latencies in cycles are computed from the highest clock rate that the driver reports, not from the clock rate during the measurement.")]
pub struct Args {
    /// The devices: part of a name, platform or vendor; a label in `raycl devices`; a kind (cpu, gpu, accelerator);
    /// or all [default: the devices in RAYCL_DEVICE or your settings, else the most capable device]
    #[arg(long)]
    device: Option<String>,
    /// Write the peak rates to FILE, which `raycl run --peak=FILE` reads; - writes them to standard output, without the
    /// table. If FILE exists already and a device fails, raycl does not change FILE
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace the file of --out even if it was not written by raycl, or was changed after raycl wrote it
    #[arg(long, requires = "out")]
    force: bool,
    /// If another process is measuring on a selected device, end at once instead of waiting for it
    #[arg(long)]
    no_wait: bool,
    /// Print a JSON list with one object per device
    #[arg(long)]
    json: bool,
    /// Use the kernel files in this folder instead of the built-in files of the same names
    #[arg(long, value_name = "DIR")]
    pub(super) cl_dir: Option<PathBuf>,
}

/// Measures the peak rates of the devices, one device after another, and prints the rates. Also writes the
/// rates to the file of `--out`, if this option is given. If a device fails, the rates of the devices that
/// were measured earlier are printed. If a device fails, the rates of the earlier devices are written to the
/// file of `--out` only if the file does not exist yet; an existing file keeps its earlier rates.
pub fn run(args: Args) -> Result<()> {
    let choice = Choice::new(args.force, "--out FILE");
    let target = args.out.as_ref().map(|path| Target::new(path, choice));
    target.iter().try_for_each(Target::check)?;
    let sources = Sources::of(args.cl_dir.clone())?;
    let devices = devices(args.device.as_deref(), &sources)?;
    let (all, end) = until_error(devices.iter().map(|device| {
        let _held = hold(&[&device.info], args.no_wait)?;
        measure(device, &sources)
    }));
    if all.is_empty() {
        return end;
    }
    target.iter().try_for_each(|target| store_rates(&all, &end, target))?;
    if target.as_ref().is_some_and(Target::is_standard_output) {
        return end;
    }
    if args.json {
        super::print_json(&all)?;
        return end;
    }
    texts(&all).into_iter().try_for_each(super::print)?;
    dirty_program().iter().try_for_each(|note| super::print(format!("note: {note}")))?;
    end
}

/// Writes the rates `all` to the file `target`. If the file exists already and is replaced, tells the user which rates
/// the file loses ([`replaced`]).
fn store_rates(all: &[Peak], end: &Result<()>, target: &Target) -> Result<()> {
    let replaced = if end.is_ok() { replaced(all, target) } else { Vec::new() };
    store(&all, end, target)?;
    replaced.iter().for_each(|note| printer::tell(printer::plain(note)));
    Ok(())
}

/// Returns a note for each entry of the file `target` that will be lost. An entry has the peak rates of one device. An
/// entry is lost if `all` (the file's new entries) contains no entry for the same device with the same driver and in
/// the same state. (For an entry without a state, a new entry in any state is enough.) If the file contains no rates,
/// returns no notes.
fn replaced(all: &[Peak], target: &Target) -> Vec<String> {
    if target.is_standard_output() {
        return Vec::new();
    }
    let file = target.path();
    let earlier = Peak::read(file).unwrap_or_default();
    let is_lost = |peak: &&Peak| !all.iter().any(|new| new.is_of_state_of(peak));
    let note = |peak: &Peak| {
        let Peak { device, driver, timestamp, .. } = peak;
        let state = peak.state.as_ref().map_or(String::new(), |state| format!(" ({state})"));
        format!(
            "note: '{}' no longer has the peak rates of {device} with the driver {driver}{state}, measured at {timestamp}",
            file.display()
        )
    };
    earlier.iter().filter(is_lost).map(note).collect()
}

/// Returns the devices that `pattern` selects. Without `pattern`, returns the devices that match `RAYCL_DEVICE` or, if
/// this variable is not set, the user's settings. If the settings name no device either, returns the most capable
/// device.
fn devices(pattern: Option<&str>, sources: &Sources) -> Result<Vec<Device>> {
    let Some(word) = pattern.map(str::to_owned).or_else(settings::device) else {
        return one_device(None, sources).map(|device| vec![device]);
    };
    let (all, words) = (discover(sources)?, [word]);
    if pattern.is_none() {
        let infos: Vec<DeviceInfo> = all.iter().map(|device| device.info.clone()).collect();
        matching_indices(&infos, &words).map_err(settings::blame_device)?;
    }
    select(&all, &words, sources)
}

/// How `raycl run --peak` measures the peak rates.
pub(super) struct Wanted<'a> {
    /// Words that select the devices to measure.
    pub patterns: &'a [String],
    /// The folder of kernel files that replace built-in kernel files.
    pub cl_dir: Option<&'a Path>,
    /// True if the command ends at once when another process is measuring on a device.
    pub no_wait: bool,
}

impl Wanted<'_> {
    /// Measures the peak rates in child processes, because the process of `raycl run` itself starts no driver. Returns
    /// an error if the user interrupts the run or if a child process fails. While this process waits for a child
    /// process, it calls `observer.waits()`. Without these calls, a shard that waits for its peak rates would count as
    /// hung in `raycl merge --status`.
    pub fn measured(&self, observer: &mut dyn Observer, interrupted: &AtomicBool) -> Result<Vec<Peak>> {
        let mut all: Vec<Peak> = Vec::new();
        for pattern in self.patterns {
            let peaks = self.measured_apart(pattern, &mut || {
                observer.waits();
                interrupted.load(Ordering::Relaxed)
            });
            // Ctrl-C in a terminal also reaches the child process, which may be waiting for the device. The user then
            // gets a message about the interruption, not about the child's failure.
            if interrupted.load(Ordering::Relaxed) {
                return Err(Error::interrupted("the devices' peak rates were being measured"));
            }
            Peak::add_new(&mut all, peaks?);
        }
        Ok(all)
    }

    /// Measures the devices that match `pattern` in a child process, which is killed as soon as `is_over` returns true.
    fn measured_apart(&self, pattern: &str, is_over: &mut dyn FnMut() -> bool) -> Result<Vec<Peak>> {
        let failed = |why: &dyn std::fmt::Display| {
            Error::run(format!("the devices' peak rates could not be measured: {why}"))
                .with_help("`raycl peak --device NAME` measures again, and shows why a device fails")
        };
        let mut command = own_program()?;
        // The messages of the child process go to the user. The messages name the other process for which the child
        // process waits, or say why the child process failed.
        command.args(self.arguments(pattern)).stderr(Stdio::inherit());
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        let ended = command.spawn().and_then(|child| output_unless(child, LOOK_UP, is_over));
        let output = ended.map_err(|error| failed(&error))?;
        let peaks = output.as_ref().and_then(complete);
        // A child process that succeeded has printed no reason for a failure.
        let why = match output.is_some_and(|finished| finished.status.success()) {
            true => "`raycl peak` printed no valid JSON",
            false => "the messages above give the reason",
        };
        peaks.ok_or_else(|| failed(&why))
    }

    /// Returns the arguments of the child process that measures the devices that match `pattern`.
    fn arguments(&self, pattern: &str) -> Vec<OsString> {
        let mut arguments = ["peak", "--json", "--device", pattern].map(OsString::from).to_vec();
        arguments.extend(self.no_wait.then(|| "--no-wait".into()));
        arguments.extend(self.cl_dir.into_iter().flat_map(|folder| ["--cl-dir".into(), folder.into()]));
        arguments
    }
}

/// Returns the peak rates that a child process printed. Returns `None` if there is no valid JSON. Also
/// returns `None` if the child process failed, since a failed child process may have printed only the rates
/// of its first devices.
fn complete(output: &Output) -> Option<Vec<Peak>> {
    let printed = output.status.success().then(|| String::from_utf8_lossy(&output.stdout))?;
    listed(&printed)
}

/// Returns the peak rates in `printed`, the output of a child process. Skips the lines before the JSON, which
/// a driver may have printed. Returns `None` if there is no valid JSON.
fn listed(printed: &str) -> Option<Vec<Peak>> {
    serde_json::from_str(&printed[printed.find("[\n")?..]).ok()
}

/// Returns a heading and a table of rates per device. The headings call each device by its common name; devices whose
/// common names would be equal keep the names that their drivers report.
fn texts(all: &[Peak]) -> Vec<String> {
    let names = common_names(all.iter().map(|peak| peak.device.as_str()));
    all.iter().map(|peak| text(peak, &names[peak.device.as_str()])).collect()
}

/// Returns a heading and the table of a device's peak rates and latencies. The heading begins with `device`,
/// a name that no other device in the output has.
fn text(peak: &Peak, device: &str) -> String {
    let mut table = super::table(&["rate or time", "median", "quartiles", "unit", "cycles"], 1);
    let mut row = |name: &str, figure: &Figure, scale: f64, unit: &str, cycles: Option<f64>| {
        let number = |value: f64| significant(value * scale, 3);
        let quartiles = format!("{} to {}", number(figure.q1), number(figure.q3));
        let cycles = cycles.map_or(String::new(), |cycles| significant(cycles, 2));
        table.add_row([name.to_owned(), number(figure.median), quartiles, unit.to_owned(), cycles]);
    };
    row("multiply-adds", &peak.fma_per_s, 1e-9, "Gfma/s", None);
    row("copy, read + written", &peak.copy_bytes_per_s, 1e-9, "GB/s", None);
    row("__local reads", &peak.local_bytes_per_s, 1e-9, "GB/s", None);
    row("start of a kernel, device's clock", &peak.launch_device_us, 1.0, "us", None);
    row("start of a kernel, host's clock", &peak.launch_host_us, 1.0, "us", None);
    row("start of a kernel, mean of many", &peak.launch_batched_us, 1.0, "us", None);
    let mut latency = |name: &str, figure: &Figure| row(name, figure, 1.0, "ns", peak.cycles(figure));
    latency("private multiply-add", &peak.private_ns);
    latency("private array", &peak.private_array_ns);
    latency("__local memory", &peak.local_ns);
    latency("global memory", &peak.global_ns);
    let clock = peak.max_clock_mhz.map_or(String::new(), |mhz| format!(", cycles at {mhz} MHz"));
    format!("{device} ({}, driver {}){clock}\n{table}", peak.platform, peak.driver)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_runs_choices_are_those_of_the_process_that_measures() {
        let wanted = Wanted { patterns: &[], cl_dir: None, no_wait: false };
        assert_eq!(wanted.arguments("cpu"), ["peak", "--json", "--device", "cpu"]);
        let wanted = Wanted { cl_dir: Some(Path::new("mine")), no_wait: true, ..wanted };
        let expected = ["peak", "--json", "--device", "all", "--no-wait", "--cl-dir", "mine"];
        assert_eq!(wanted.arguments("all"), expected);
    }

    #[test]
    fn a_device_that_two_patterns_match_is_listed_once_and_a_drivers_lines_are_skipped() {
        let peak = |device: &str, driver: &str| Peak {
            device: device.into(),
            driver: driver.into(),
            ..Peak::default()
        };
        let mut all = vec![peak("a", "first")];
        Peak::add_new(&mut all, vec![peak("a", "second"), peak("b", "first")]);
        assert_eq!(all, [peak("a", "first"), peak("b", "first")]);
        let json = serde_json::to_string_pretty(&all).unwrap();
        assert_eq!(listed(&format!("[driver] ready\n{json}\n")), Some(all));
        assert_eq!((listed(""), listed("[\nno list")), (None, None));
    }

    /// A process that fails at its second device has printed the rates of its first device.
    #[test]
    #[cfg(unix)]
    fn the_rates_that_a_process_printed_before_it_failed_are_not_used() {
        use std::os::unix::process::ExitStatusExt as _;
        use std::process::ExitStatus;
        let printed = vec![Peak { device: "a".into(), ..Peak::default() }];
        let stdout = serde_json::to_vec_pretty(&printed).unwrap();
        let of = |status| {
            let status = ExitStatus::from_raw(status);
            complete(&Output { status, stdout: stdout.clone(), stderr: Vec::new() })
        };
        // The three numbers are the exit statuses (as `wait` returns them) of a process that succeeded, of
        // one that exited with code 1, and of one that was killed.
        assert_eq!([0, 1 << 8, 9].map(of), [Some(printed), None, None]);
    }

    #[test]
    fn rates_of_another_state_are_not_replaced_silently() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("peak.json");
        let peak = |device: &str, state: Option<&str>| Peak {
            device: device.into(),
            driver: "1".into(),
            timestamp: "noon".into(),
            state: state.map(str::to_owned),
            ..crate::peak::fixtures::rates()
        };
        let target = Target::of_results(&path);
        let new = [peak("cpu", Some("2 threads"))];
        assert!(replaced(&new, &target).is_empty(), "there is no file yet");
        let of_any_state = peak("cpu", None);
        let earlier = [peak("gpu", None), peak("cpu", Some("4 threads")), new[0].clone(), of_any_state];
        Peak::write(&earlier, &path).unwrap();
        let expected = ["gpu with the driver 1", "cpu with the driver 1 (4 threads)"].map(|device| {
            let file = path.display();
            format!("note: '{file}' no longer has the peak rates of {device}, measured at noon")
        });
        assert_eq!(replaced(&new, &target), expected);
        store_rates(&new, &Ok(()), &target).unwrap();
        assert_eq!(Peak::read(&path).unwrap(), new);
        assert!(replaced(&new, &target).is_empty(), "the same state");
    }

    #[test]
    fn devices_of_one_common_name_have_different_headings() {
        let all = ["basic", "pthread"]
            .map(|driver| Peak { device: format!("{driver}-Intel(R) Xeon(R) Processor"), ..Peak::default() });
        let first_line = |text: &String| text.lines().next().map(str::to_owned).unwrap();
        let headings: Vec<String> = texts(&all).iter().map(first_line).collect();
        assert!(headings[0].starts_with("basic-Intel(R) Xeon(R)"), "{headings:?}");
        assert_ne!(headings[0], headings[1]);
        assert!(texts(&all[..1])[0].starts_with("Intel Xeon, PoCL ("), "{:?}", texts(&all[..1]));
    }

    #[test]
    fn each_row_has_its_own_rate_or_time_in_its_own_unit() {
        let figure = |median: f64| Figure { median, q1: 0.9 * median, q3: 1.1 * median, repeats: 3 };
        let peak = Peak {
            device: "gpu".into(),
            platform: "CUDA".into(),
            driver: "580".into(),
            max_clock_mhz: Some(2000),
            fma_per_s: figure(1e12),
            copy_bytes_per_s: figure(2e12),
            local_bytes_per_s: figure(3e12),
            launch_device_us: figure(4.0),
            launch_host_us: figure(5.0),
            launch_batched_us: figure(6.0),
            private_ns: figure(10.0),
            private_array_ns: figure(20.0),
            local_ns: figure(30.0),
            global_ns: figure(40.0),
            ..Peak::default()
        };
        let text = texts(&[peak]).concat();
        assert!(text.starts_with("gpu (CUDA, driver 580), cycles at 2000 MHz\n"), "{text}");
        let cells = |name: &str| -> Vec<String> {
            let rows = text.lines().map(|line| line.split('┆').map(|cell| cell.trim_matches(['│', ' '])));
            let mut rows = rows.map(|row| row.map(str::to_owned).collect::<Vec<_>>());
            rows.find(|row| row[0] == name).map_or_else(Vec::new, |row| row[1..].to_vec())
        };
        for (name, expected) in [
            ("multiply-adds", ["1000", "900 to 1100", "Gfma/s", ""]),
            ("copy, read + written", ["2000", "1800 to 2200", "GB/s", ""]),
            ("__local reads", ["3000", "2700 to 3300", "GB/s", ""]),
            ("start of a kernel, device's clock", ["4.00", "3.60 to 4.40", "us", ""]),
            ("start of a kernel, host's clock", ["5.00", "4.50 to 5.50", "us", ""]),
            ("start of a kernel, mean of many", ["6.00", "5.40 to 6.60", "us", ""]),
            ("private multiply-add", ["10.0", "9.00 to 11.0", "ns", "20"]),
            ("private array", ["20.0", "18.0 to 22.0", "ns", "40"]),
            ("__local memory", ["30.0", "27.0 to 33.0", "ns", "60"]),
            ("global memory", ["40.0", "36.0 to 44.0", "ns", "80"]),
        ] {
            assert_eq!(cells(name), expected, "{name}: {text}");
        }
    }
}
