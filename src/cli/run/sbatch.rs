//! `raycl run --sbatch N`: prints a shell script that submits N shards and their merge to Slurm. raycl itself submits
//! no job.

use super::{Args, chosen, default_folder, listed, named_in_text, patterns, shard, two_kernels};
use crate::cli::print;
use crate::config;
use crate::device::{DeviceInfo, DeviceKind};
use crate::device_lock::Locks;
use crate::error::Result;
use crate::experiment::{Past, asleep, distinct_scenes};
use crate::record::refuse_file;
use crate::shard::{Header, ShardPlan, Wishes, scripts};
use crate::words::{option, path_word};
use std::path::Path;
use std::time::Duration;

/// Parts of the words with which users select CPUs, in lower case.
const PROCESSORS: [&str; 6] = ["cpu", "pocl", "portable", "epyc", "ryzen", "xeon"];

/// Prints the shell script for this number of shards. This machine, such as a login node, need not have the devices.
pub fn run(args: &Args, shards: u32) -> Result<()> {
    let sources = two_kernels::sources(args, true)?;
    let experiment = config::load(&args.config, &args.set)?;
    let devices = listed(args).unwrap_or_default();
    let here = chosen(args, &experiment, &devices).ok().filter(|chosen| !chosen.is_empty());
    let on_gpu = here.as_ref().map(|chosen| chosen.iter().any(|device| device.kind != DeviceKind::Cpu));
    let stand_in = asleep::device(0.0);
    let infos: Vec<&DeviceInfo> = here.unwrap_or_else(|| vec![&stand_in]);
    let locks = Locks::of_machine(false);
    let experiment = distinct_scenes(experiment)?;
    let run = super::run_of(args, &experiment, &infos, &sources, &locks)?;
    let out = args.out.clone().unwrap_or_else(|| default_folder(&experiment.name, false));
    named_in_text([&out])?;
    refuse_file(&out).map_err(|error| error.with_help(shard::OTHER_FOLDER))?;
    shard::refuse_others(&out, args.force)?;
    let header = shard::header(&experiment, &sources[0], shards);
    ShardPlan::read(&out)?.map(|plan| plan.checked(&header, &out)).transpose()?;
    let plan = shard::make(&run, Header { shards, ..Header::default() }, &out)?;
    let expected = super::foreseen(&run, &out, &Past::default())?;
    let wishes = Wishes {
        name: experiment.name.clone(),
        shards,
        command: command(args, &out),
        out: path_word(&out),
        on_gpu: on_gpu.or_else(|| by_words(&patterns(args, &experiment))),
        longest: longest(&plan),
        is_known: expected.is_known(),
    };
    print(scripts(&wishes).trim_end())
}

/// Returns the expected time of the shard that takes longest.
fn longest(plan: &ShardPlan) -> Duration {
    let longest_ms = plan.expected_ms.iter().copied().fold(0.0, f64::max);
    Duration::try_from_secs_f64(1e-3 * longest_ms).unwrap_or_default()
}

/// Guesses whether one of the experiment's devices is a GPU, since this machine may not have the devices. The guess is
/// made from the words that select devices ([`patterns`]). Returns true if at least one word other than `all` contains
/// none of [`PROCESSORS`]: such a word is taken for the name of a GPU. Returns `None` if there is no word other than
/// `all`.
fn by_words(devices: &[String]) -> Option<bool> {
    let is_gpu = |word: &str| !PROCESSORS.iter().any(|processor| word.contains(processor));
    let words = devices.iter().map(|word| word.to_lowercase()).filter(|word| word != "all");
    words.map(|word| is_gpu(&word)).reduce(|one, other| one || other)
}

/// Returns the command that each shard runs, without `--shard`.
fn command(args: &Args, out: &Path) -> Vec<String> {
    let mut words = vec!["raycl".to_owned(), "run".to_owned(), path_word(&args.config)];
    words.extend(option("--out", out.display()));
    words.extend(super::choices(args));
    words.extend(super::resume::peak_option(args));
    words.extend(args.force.then(|| "--force".to_owned()));
    words.extend(args.no_wait.then(|| "--no-wait".to_owned()));
    words
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::*;

    #[test]
    fn one_word_for_a_gpu_is_enough_in_any_order() {
        let by = |words: &[&str]| by_words(&words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>());
        assert_eq!((by(&[]), by(&["all"])), (None, None));
        assert_eq!((by(&["cpu"]), by(&["AMD EPYC", "PoCL"])), (Some(false), Some(false)));
        assert_eq!((by(&["cpu", "nvidia"]), by(&["nvidia", "cpu"])), (Some(true), Some(true)));
    }

    #[test]
    fn the_time_that_is_asked_for_is_that_of_the_longest_shard() {
        let plan = ShardPlan { expected_ms: vec![2000.0, 8000.0, 4000.0], ..ShardPlan::default() };
        assert_eq!(longest(&plan), Duration::from_secs(8));
    }

    #[test]
    fn each_shard_measures_what_the_arguments_say() {
        let of = |more: &[&str]| {
            let words = [&["a.toml", "--device", "nvidia", "--set", "timing.seed=3"], more].concat();
            command(&fixtures::args(&words), Path::new("results/a")).join(" ")
        };
        let always = "raycl run a.toml --out results/a --device nvidia --set timing.seed=3";
        assert_eq!(of(&[]), always);
        assert_eq!(of(&["--peak"]), format!("{always} --peak"));
        let more = ["--out", "results/a", "--force", "--no-wait"];
        assert_eq!(of(&more), format!("{always} --force --no-wait"));
        assert_eq!(
            of(&["--peak=peak.json", "--cl-dir", "cl"]),
            format!("{always} --cl-dir cl --peak=peak.json")
        );
    }
}
