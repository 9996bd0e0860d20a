//! `raycl run`: an experiment, from its TOML to a folder of results.

use super::choice::parse_assignment;
use super::progress::observer;
use crate::config::{self, Experiment};
use crate::device::{Device, discover, select};
use crate::error::{Error, Result};
use crate::experiment::{Forecast, Results, Run, dry_run};
use crate::program::Sources;
use crate::record::{DeviceEnvironment, Environment, Host, Record, summary_terminal};
use crate::strategy::Requirements;
use std::path::{Path, PathBuf};

/// Arguments of `raycl run`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl run configs/quick.toml
  raycl run configs/figure-8.toml --dry-run
  raycl run configs/figure-8.toml --device nvidia --out results/figure-8-h200
  raycl run configs/figure-6.toml --device pocl --device nvidia
  raycl run configs/quick.toml --set image_sizes='[[800, 500]]' --set timing.time_limit_ms=2000

Exit code: 0 when every point was measured or cannot fit the device, 1 when one failed, 2 for a mistake in what was given.")]
pub struct Args {
    /// The experiment
    config: PathBuf,
    /// The folder of results [default: results/NAME, or results/NAME-2, ... where that is taken]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// A word of a device's name, platform or vendor, or cpu, gpu or all; replaces the config's devices
    #[arg(long, value_name = "NAME")]
    device: Vec<String>,
    /// Print the points and what each needs, and measure nothing
    #[arg(long)]
    dry_run: bool,
    /// Change a value of the config
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse_assignment)]
    set: Vec<(String, String)>,
    /// Print one JSON object a point instead of tables; with --dry-run, what each needs
    #[arg(long)]
    json: bool,
    /// No progress and no tables
    #[arg(short, long)]
    quiet: bool,
    /// A line for every point as it stops, instead of a bar
    #[arg(short, long, conflicts_with = "quiet")]
    verbose: bool,
    /// Use the kernels of this folder instead of those built in
    #[arg(long, value_name = "DIR")]
    cl_dir: Option<PathBuf>,
}

impl Args {
    /// The arguments of a run that another subcommand makes.
    pub(super) fn of(
        config: PathBuf,
        out: &Path,
        device: &[String],
        set: &[(String, String)],
        quiet: bool,
    ) -> Self {
        let (out, device, set) = (Some(out.to_owned()), device.to_vec(), set.to_vec());
        Self { config, out, device, dry_run: false, set, json: false, quiet, verbose: false, cl_dir: None }
    }
}

/// Runs an experiment.
pub fn run(args: Args) -> Result<()> {
    let experiment = config::load(&args.config, &args.set)?;
    let devices = discover()?;
    let patterns = if args.device.is_empty() { &experiment.devices } else { &args.device };
    let devices = select(&devices, patterns)?;
    let sources = args.cl_dir.clone().map_or(Sources::Embedded, Sources::Folder);
    let run = Run { experiment: &experiment, devices: &devices, sources: &sources };
    if args.dry_run {
        return forecast(&dry_run(&run)?, args.json);
    }
    let out = args.out.clone().unwrap_or_else(|| free_folder(&experiment.name));
    let mut results = Results::create(&out, &environment(&experiment, &devices))?;
    let records = run.execute(&mut results, observer(args.quiet, args.verbose).as_mut())?;
    report(&args, &out, &records)
}

/// `results/NAME`, or the first of `results/NAME-2`, ... that is free.
fn free_folder(name: &str) -> PathBuf {
    let folder = |number: u32| match number {
        1 => Path::new("results").join(name),
        _ => Path::new("results").join(format!("{name}-{number}")),
    };
    (1..).map(folder).find(|folder| !folder.exists()).unwrap_or_else(|| folder(1))
}

fn environment(experiment: &Experiment, devices: &[&Device]) -> Environment {
    let device = |device: &&Device| {
        let info = device.info.clone();
        DeviceEnvironment {
            device: info.label,
            platform: info.platform,
            platform_version: info.platform_version,
            version: info.version,
            vendor: info.vendor,
            driver: info.driver,
            kind: info.kind.name().to_owned(),
        }
    };
    Environment {
        raycl_version: env!("CARGO_PKG_VERSION").to_owned(),
        git_revision: option_env!("RAYCL_GIT_REVISION").map(str::to_owned),
        started: jiff::Timestamp::now().to_string(),
        command_line: std::env::args().collect(),
        host: Host::read(),
        devices: devices.iter().map(device).collect(),
        build_options: vec!["-cl-std=CL1.2".to_owned(), "-cl-kernel-arg-info".to_owned()],
        config_path: experiment.path.display().to_string(),
        config: experiment.source.clone(),
        config_hash: Environment::hash_of(&experiment.source, &experiment.overrides),
        overrides: experiment.overrides.clone(),
    }
}

/// Says what was found and where it lies. Points that failed are an error: exit code 1.
fn report(args: &Args, out: &Path, records: &[Record]) -> Result<()> {
    let written = crate::report::write(&[crate::report::Folder::read(out)?], out)?;
    if args.json {
        for record in records {
            super::print_json(record)?;
        }
    } else if !args.quiet {
        super::print(summary_terminal(records, super::coloured()))?;
        super::print(format!("Report:   {}", written.page.display()))?;
        super::print(format!("Pictures: {}", out.join("images").display()))?;
        super::print(format!(
            "Tables:   {}, {}; every point: {}",
            out.join("summary.md").display(),
            out.join("summary.csv").display(),
            out.join("records.jsonl").display()
        ))?;
    }
    let failed = records.iter().filter(|record| !record.outcome.is_fine()).count();
    if failed == 0 {
        return Ok(());
    }
    let error = Error::run(format!("{failed} of {} points were not measured", records.len()));
    Err(error.with_help(format!("{} tells why of each", out.join("summary.md").display())))
}

/// What `--dry-run` prints.
fn forecast(points: &[Forecast], json: bool) -> Result<()> {
    if json {
        return points.iter().try_for_each(super::print_json);
    }
    let mut table = super::table(&["point", "device", "fits", "__local B", "__constant B", "scratch B"], 3);
    for point in points {
        let bytes = |of: fn(&Requirements) -> u64| {
            point.needs.as_ref().map_or(String::new(), |needs| of(needs).to_string())
        };
        let cells = [
            point.label.clone(),
            point.device.clone(),
            point.refused.clone().unwrap_or_else(|| "yes".to_owned()),
            bytes(|needs| needs.local_bytes),
            bytes(|needs| needs.constant_bytes),
            bytes(|needs| needs.scratch_bytes),
        ];
        table.add_row(cells);
    }
    super::print(table)?;
    let refused = points.iter().filter(|point| point.refused.is_some()).count();
    super::print(format!(
        "{} points, {refused} of which do not fit. Nothing was compiled or measured.",
        points.len()
    ))
}
