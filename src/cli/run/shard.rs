//! `raycl run --shard`: measures one part of an experiment; other processes, on any machines, measure the
//! other parts.

use super::environment::environment;
use super::{Args, chosen, earlier, interrupt_flag, listed, two_kernels};
use crate::cli::measured::{MEASURE_AGAIN, refuse_failed};
use crate::cli::print;
use crate::cli::progress::observer;
use crate::config::{self, Experiment};
use crate::device::DeviceInfo;
use crate::device_lock::Locks;
use crate::error::{Error, Result};
use crate::existing;
use crate::experiment::{Cost, Observer, Results, Run, cut, distinct_scenes};
use crate::output::{Choice, refuse_other_folders};
use crate::peak::Peak;
use crate::program::Sources;
use crate::record::journals::RECORDS;
use crate::record::{Environment, Record, refuse_closed};
use crate::settings;
use crate::shard::{
    About, Asked, Attempt, End, Header, Kind, KindPoint, Pulse, Shard, ShardPlan, watch_launcher,
};
use crate::words::{counted, path_word, quote};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// The advice if raycl cannot write into a folder.
pub const OTHER_FOLDER: &str = "choose another folder with --out DIR";

/// Measures one shard in a folder of its own.
pub fn run(args: &Args, asked: Asked) -> Result<()> {
    let shard = asked.resolve(&|name| std::env::var(name).ok())?;
    let out = args.out.clone().ok_or_else(|| {
        Error::input("--shard needs --out, the folder to which all shards write")
            .with_help("name a folder that every machine can reach, such as --out results/sweep")
    })?;
    let sources = two_kernels::sources(args, true)?;
    let experiment = config::load(&args.config, &args.set)?;
    let peak = super::peak_of_file(args)?;
    let experiment = distinct_scenes(experiment)?;
    let header = header(&experiment, &sources[0], shard.of);
    refuse_others(&out, args.force)?;
    refuse_closed(&out, OTHER_FOLDER)?;
    let interrupted = interrupt_flag()?;
    let devices = listed(args)?;
    let infos = chosen(args, &experiment, &devices)?;
    let locks = Locks::of_machine(!args.no_wait);
    let run = super::run_of(args, &experiment, &infos, &sources, &locks)?;
    let plan = ShardPlan::open(&out, &header, || make(&run, header.clone(), &out))?;
    let environment = environment(&experiment, &infos, &sources);
    let part = Part { args, out, run, plan, asked, shard, environment, peak };
    let records = part.measure(&interrupted)?;
    part.report(&records)
}

/// Returns an error for a folder with files that raycl did not make, unless `force` is true. Also returns an
/// error for the folder of a run without shards, because `raycl merge` writes files with the same names.
/// Accepts a folder of shards.
pub fn refuse_others(out: &Path, force: bool) -> Result<()> {
    let refused = match existing::exists(&out.join(RECORDS))? {
        true => Err(Error::input(format!("{} holds the results of a run without shards", out.display()))
            .with_help("choose another folder with --out")),
        false => refuse_other_folders(out, Choice::new(force, "--out DIR"), false),
    };
    // A folder with a plan of shards is accepted even if the checks above refused it. This function looks for the plan
    // after the other checks: the process of another shard may have written the plan during these checks.
    refused.or_else(|error| ShardPlan::read(out)?.map_or(Err(error), |_| Ok(())))
}

/// Returns the header of the shards' plan, in case this process writes the plan. The headers of all shards must agree
/// in the number of shards, the hash of the config, the scenes and the kernels.
pub fn header(experiment: &Experiment, sources: &Sources, shards: u32) -> Header {
    Header {
        shards,
        config: experiment.path.display().to_string(),
        config_hash: Environment::hash_of(&experiment.source, &experiment.overrides),
        overrides: experiment.overrides.clone(),
        scenes: experiment.scenes.iter().map(|scene| scene.hashes.join("+")).collect(),
        kernels: sources.hash(),
        raycl: Some(version()),
    }
}

/// Returns the version of raycl, with the git revision if it is known.
fn version() -> String {
    let revision =
        option_env!("RAYCL_GIT_REVISION").map_or(String::new(), |revision| format!(" ({revision})"));
    format!("{}{revision}", env!("CARGO_PKG_VERSION"))
}

/// Returns the plan of the experiment's points, cut into shards of about equal expected time.
pub fn make(run: &Run<'_>, header: Header, out: &Path) -> Result<ShardPlan> {
    let costs = run.costs(&earlier::earlier(out))?;
    let blocks = cut(&costs, header.shards);
    let costs: HashMap<usize, Cost> = costs.iter().flatten().map(|cost| (cost.point, *cost)).collect();
    let mut expected_ms = vec![0.0; header.shards as usize];
    for block in &blocks {
        expected_ms[block.shard as usize - 1] += block.expected_ms(&costs);
    }
    let points = run.plan_of_one_device().points;
    let mut cases: Vec<usize> = Vec::new();
    for (index, point) in points.iter().enumerate() {
        let is_new = index > 0 && !point.has_scene_and_size_of(&points[index - 1]);
        cases.push(cases.last().map_or(0, |case| case + usize::from(is_new)));
    }
    let points = points.iter().map(|point| point.label(run.experiment)).collect();
    Ok(ShardPlan { header, points, cases, blocks, expected_ms })
}

/// The shard that this process measures, with all that measuring the shard needs.
struct Part<'a> {
    args: &'a Args,
    out: PathBuf,
    run: Run<'a>,
    plan: ShardPlan,
    asked: Asked,
    shard: Shard,
    environment: Environment,
    /// The peak rates in the file of `--peak=FILE`.
    peak: Option<Vec<Peak>>,
}

impl Part<'_> {
    fn measure(&self, interrupted: &AtomicBool) -> Result<Vec<Record>> {
        let devices = self.run.devices.iter().map(|device| identity(device)).collect();
        // If neither the command nor the config names a device, `RAYCL_DEVICE` or the user's settings file may select
        // the devices by a word, such as `gpu`. In this case, the attempt stores this word.
        let is_named = super::names_devices(self.args, self.run.experiment);
        let about = About {
            device: settings::device().filter(|_| !is_named),
            plan: Some(self.plan.hash()?),
            ..About::of_this_process(self.shard, devices, self.args.hang_limit.as_secs_f64())
        };
        let attempt = Attempt::begin(&self.out, &about)?;
        store_end(&attempt, self.watched(&attempt, &about.host, interrupted))
    }

    /// Measures the shard. Meanwhile, one thread watches the launcher (the program that started this process). Another
    /// thread regularly increases a counter in the attempt's folder, which shows other processes that the attempt is
    /// alive. When this function returns, the counter has its last value in the folder. The caller may mark the attempt
    /// as ended only after this function has returned, since other processes may copy the folder of an attempt that has
    /// ended.
    fn watched(&self, attempt: &Attempt, host: &str, interrupted: &AtomicBool) -> Result<Vec<Record>> {
        watch_launcher(attempt, self.asked)?;
        let pulse = Pulse::start(&attempt.folder)?;
        let mut listener = observer(self.args.quiet, self.args.verbose);
        let mut steps = pulse.listening(listener.as_mut());
        self.attempt(attempt, host, &mut steps, interrupted)
    }

    fn attempt(
        &self,
        attempt: &Attempt,
        host: &str,
        observer: &mut dyn Observer,
        interrupted: &AtomicBool,
    ) -> Result<Vec<Record>> {
        let blocks = self.plan.of_shard(self.shard.number);
        let run = Run { blocks: Some(&blocks), ..self.run };
        self.write_kinds(&blocks.iter().flat_map(|block| block.points.clone()).collect::<Vec<_>>())?;
        let earlier = attempt.earlier(&self.out)?;
        let (folder, keeps, retries) = (&attempt.folder, run.keeps_moved_samples, run.retry_failed);
        let mut results = Results::of_attempt(folder, &self.environment, host, &earlier, keeps, retries)?;
        super::keep_peak(self.args, &run, self.peak.clone(), &mut results, observer, interrupted)?;
        if !self.args.quiet {
            observer.says(&begun(self.shard, earlier.len(), &attempt.folder));
            super::say_copies(run.experiment, observer);
        }
        super::measuring::execute(self.args, run, &attempt.folder, &mut results, observer, interrupted)
    }

    /// Writes one file for each kind of device on which this shard measures. The file contains the keys of all points
    /// of the experiment on this kind of device, including points of other shards. Writes nothing if the files of all
    /// these kinds of devices exist already. `own` contains the indices, in the plan, of this shard's points. The host
    /// counts as a kind of device if baselines (ray casters on the host) are among these points.
    fn write_kinds(&self, own: &[usize]) -> Result<()> {
        let plan = self.run.plan_of_one_device();
        let mut own_points = own.iter().filter_map(|index| plan.points.get(*index));
        let has_host = own_points.any(|point| point.device.is_none());
        let kinds = self
            .run
            .devices
            .iter()
            .enumerate()
            .map(|(index, device)| (Some(index), device.label.clone(), identity(device)));
        let host =
            has_host.then(|| (None, crate::record::HOST.to_owned(), crate::experiment::host_identity()));
        let wanted: Vec<_> = kinds.chain(host).collect();
        let path = |label: &str, identity: &str| Kind::file(&self.out, label, identity);
        if wanted.iter().all(|(_, label, identity)| path(label, identity).exists()) {
            return Ok(());
        }
        let points = self.run.planned_points()?;
        for (device, label, identity) in wanted {
            let own = points.iter().filter(|(_, on, _)| *on == device);
            let points = own
                .map(|(point, _, planned)| KindPoint { point: *point, planned: planned.clone() })
                .collect();
            let path = path(&label, &identity);
            Kind { device: label, identity, raycl: Some(version()), points }.write(&path)?;
        }
        Ok(())
    }

    fn report(&self, records: &[Record]) -> Result<()> {
        if self.args.json {
            records.iter().try_for_each(crate::cli::print_json)?;
        } else if !self.args.quiet {
            let out = quote(&path_word(&self.out));
            print(done(self.shard, [records.len(), self.point_count()], &out))?;
        }
        refuse_failed(records, format!("`raycl merge` gives the reason for each point; {MEASURE_AGAIN}"))
    }

    /// Returns the number of the shard's points, on all devices of this process.
    fn point_count(&self) -> usize {
        let pieces = self.run.plan().of_blocks(&self.plan.of_shard(self.shard.number));
        pieces.iter().map(|piece| piece.points.len()).sum()
    }
}

/// Stores in the attempt's folder how the attempt ended, and returns the attempt's `result`. If the attempt failed, and
/// its end cannot be stored either, for example on a full disk, the returned error is that of the attempt.
fn store_end<T>(attempt: &Attempt, result: Result<T>) -> Result<T> {
    let stored = attempt.ended(&match &result {
        Ok(_) => End::Done,
        Err(Error::Interrupted { .. }) => End::Interrupted,
        Err(error) => End::Failed(error.to_string()),
    });
    let value = result?;
    stored.map(|()| value)
}

/// Returns the line with which an attempt at a shard begins. `earlier` is the number of earlier attempts.
fn begun(shard: Shard, earlier: usize, folder: &Path) -> String {
    let again = match earlier {
        0 => String::new(),
        1 => ", after an earlier attempt".to_owned(),
        attempts => format!(", after {attempts} earlier attempts"),
    };
    format!("shard {shard}{again}: {}", folder.display())
}

/// Returns the line that says how many points a shard has, and with which command the user merges the results
/// of all shards. `all` is the number of the shard's points. `new` is the number of the points that this attempt
/// finished; earlier attempts finished the others.
fn done(shard: Shard, [new, all]: [usize; 2], out: &str) -> String {
    let points = match all.saturating_sub(new) {
        0 => counted(new, "point"),
        before => format!("{}; {before} finished before", counted(new, "new point")),
    };
    format!("shard {shard}: {points}. When all shards have ended: raycl merge {out}")
}

/// Returns the text by which the keys of points identify a kind of device.
fn identity(device: &DeviceInfo) -> String {
    format!("{} | {}", device.identity(), device.state())
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::*;
    use crate::experiment::Block;

    #[test]
    fn the_points_of_a_shard_are_counted_and_one_is_a_point() {
        let line = |new, all| done(Shard { number: 1, of: 2 }, [new, all], "out");
        let end = "When all shards have ended: raycl merge out";
        assert_eq!(
            [line(1, 1), line(2, 2)],
            ["1 point", "2 points"].map(|points| format!("shard 1/2: {points}. {end}"))
        );
        assert_eq!(
            [line(0, 5), line(1, 2)],
            ["0 new points; 5 finished before", "1 new point; 1 finished before"]
                .map(|points| format!("shard 1/2: {points}. {end}"))
        );
    }

    #[test]
    fn the_points_of_a_shard_are_counted_on_every_device_and_once_on_the_host() {
        let folder = tempfile::tempdir().expect("a folder");
        let experiment = fixtures::experiment("local_sizes = [1, 2, 4]\nbaselines = ['serial']");
        let (device, locks) = (crate::experiment::asleep::device(1.0), Locks::of_machine(false));
        let (sources, args) = ([Sources::Embedded], fixtures::args(&["a.toml"]));
        let devices = [&device, &device];
        let run = super::super::run_of(&args, &experiment, &devices, &sources, &locks).expect("a run");
        let (out, shard) = (folder.path().join("out"), Shard { number: 1, of: 1 });
        let plan = make(&run, Header { shards: 1, ..Header::default() }, &out).expect("a plan");
        let (asked, environment, peak) = (Asked::Given(shard), Environment::default(), None);
        let part = Part { args: &args, out, run, plan, asked, shard, environment, peak };
        // The experiment has two image sizes.
        assert_eq!(part.point_count(), 2 * (1 + 2 * 3));
    }

    #[test]
    fn the_first_line_of_an_attempt_counts_the_earlier_ones() {
        let line = |earlier| begun(Shard { number: 1, of: 2 }, earlier, Path::new("out/a"));
        let expected = ["", ", after an earlier attempt", ", after 2 earlier attempts"];
        assert_eq!([0, 1, 2].map(line), expected.map(|again| format!("shard 1/2{again}: out/a")));
    }

    #[test]
    fn an_attempt_whose_end_cannot_be_stored_keeps_its_own_error() {
        let folder = tempfile::tempdir().expect("a folder").path().join("gone");
        let attempt = Attempt { folder, name: "a".to_owned() };
        for (error, code) in [(Error::interrupted("a"), 130), (Error::input("a"), 2), (Error::run("a"), 1)] {
            let (message, ended) = (error.to_string(), store_end::<()>(&attempt, Err(error)));
            let ended = ended.expect_err("the attempt failed");
            assert_eq!((ended.to_string(), ended.exit_code()), (message, code));
        }
        let stored = store_end(&attempt, Ok(())).expect_err("the folder is missing");
        assert!(stored.to_string().starts_with("cannot write "), "{stored}");
    }

    #[test]
    fn a_shard_cannot_compare_two_folders_of_kernels() {
        let plain = Args::of(PathBuf::from("a.toml"), Path::new("out"), &[], &[]);
        let args = Args { cl_dir: ["a", "b"].map(PathBuf::from).into(), ..plain };
        let error = run(&args, Asked::Given(Shard { number: 1, of: 2 })).expect_err("there are two folders");
        assert!(error.to_string().contains("cannot compare two folders"), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_that_cannot_be_made_is_refused_before_the_devices_are_listed() {
        let folder = tempfile::tempdir().expect("a folder");
        let (config, root) = (folder.path().join("a.toml"), env!("CARGO_MANIFEST_DIR"));
        let lines = "question = '?'\nexpectation = '!'\nstrategies = ['naive']\nimage_sizes = [[8, 5]]\nlocal_sizes = [4]";
        std::fs::write(&config, format!("{lines}\nscenes = ['{root}/scenes/triangle.toml']\n"))
            .expect("a file");
        // Not even the superuser can make folders in /proc/sys.
        let args = Args::of(config, Path::new("/proc/sys/out"), &["no such device".to_owned()], &[]);
        let error = run(&args, Asked::Given(Shard { number: 1, of: 4 })).expect_err("the folder is closed");
        assert_eq!((error.exit_code(), error.remedy()), (2, "choose another folder with --out DIR"));
        let expected = "cannot make /proc/sys/out: the folder '/proc/sys' cannot be written to (";
        assert!(error.to_string().starts_with(expected), "{error}");
    }

    /// The plan has six shards for two groups of kernels and two groups of a caster on the host, so the groups of
    /// kernels are divided among shards. One of the shards that share a group also measures (borrows) the
    /// group's control point, although the control point belongs to another shard.
    #[test]
    fn a_plan_names_its_points_and_cases_and_expects_each_shards_time() {
        let folder = tempfile::tempdir().expect("a folder");
        let experiment = fixtures::experiment("local_sizes = [1, 2, 4, 8]\nbaselines = ['serial']");
        let (device, locks) = (crate::experiment::asleep::device(1.0), Locks::of_machine(false));
        let (devices, sources, args) = ([&device], [Sources::Embedded], fixtures::args(&["a.toml"]));
        let run = super::super::run_of(&args, &experiment, &devices, &sources, &locks).expect("a run");
        let header = Header { shards: 6, ..Header::default() };
        let plan = make(&run, header.clone(), &folder.path().join("out")).expect("a plan");
        assert_eq!(plan.header, header);
        assert_eq!(plan.cases, [0, 0, 0, 0, 0, 1, 1, 1, 1, 1]);
        let named = |index: usize| plan.points[index].as_str();
        assert_eq!(plan.points.len(), 10);
        assert_eq!([named(0), named(9)], ["triangle 8x5 host serial-f32", "triangle 16x10 naive 8x8"]);
        check_times(&run, &plan);
        assert!(
            plan.blocks.iter().any(Block::borrows_control),
            "the test must show the time of a borrowed point"
        );
    }

    /// Checks that the expected time of each shard is the sum of the expected times of its points and of its
    /// borrowed control points: points of another block, which the shard measures only for comparison. The sum also
    /// contains the time to start the workers of each block.
    fn check_times(run: &Run<'_>, plan: &ShardPlan) {
        let costs: Vec<_> = run.costs(&[]).expect("costs").concat();
        let cost = |point: usize| costs.iter().find(|cost| cost.point == point).expect("a cost");
        for (number, planned) in (1..).zip(&plan.expected_ms) {
            let own = plan.blocks.iter().filter(|block| block.shard == number);
            let expected: f64 = own
                .map(|block| {
                    let borrowed = block.control.filter(|control| !block.points.contains(control));
                    let points = block.points.iter().copied().chain(borrowed);
                    cost(block.points[0]).start_ms + points.map(|point| cost(point).ms).sum::<f64>()
                })
                .sum();
            assert!(
                expected > 0.0 && (planned - expected).abs() < 1e-9 * expected,
                "{number}: {planned} {expected}"
            );
        }
    }

    #[test]
    fn a_shard_is_expected_to_measure_its_points_on_every_device() {
        let folder = tempfile::tempdir().expect("a folder");
        let experiment = fixtures::experiment("local_sizes = [4]");
        let (device, locks) = (crate::experiment::asleep::device(1.0), Locks::of_machine(false));
        let (sources, args) = ([Sources::Embedded], fixtures::args(&["a.toml"]));
        let expected_ms = |devices: &[&DeviceInfo]| {
            let run = super::super::run_of(&args, &experiment, devices, &sources, &locks).expect("a run");
            let header = Header { shards: 2, ..Header::default() };
            make(&run, header, &folder.path().join("out")).expect("a plan").expected_ms
        };
        let alone: Vec<f64> = expected_ms(&[&device]).iter().map(|ms| 2.0 * ms).collect();
        assert_eq!(expected_ms(&[&device, &device]), alone);
    }

    /// In the plan, the host's point of the second scene lies between the device's points of both scenes.
    #[test]
    fn scenes_that_are_compared_are_in_one_block_of_each_device_and_size() {
        let folder = tempfile::tempdir().expect("a folder");
        let lines = "compare_scenes = true\nlocal_sizes = [1, 2]\nbaselines = ['serial']";
        let other = "[[scene]]\nfile = 'scenes/pyramid-upper.toml'";
        let experiment = fixtures::experiment(&format!("{lines}\n{other}"));
        let (device, locks) = (crate::experiment::asleep::device(1.0), Locks::of_machine(false));
        let (devices, sources, args) = ([&device], [Sources::Embedded], fixtures::args(&["a.toml"]));
        let run = super::super::run_of(&args, &experiment, &devices, &sources, &locks).expect("a run");
        let header = Header { shards: 2, ..Header::default() };
        let plan = make(&run, header, &folder.path().join("out")).expect("a plan");
        let points: Vec<_> = plan.blocks.iter().map(|block| block.points.clone()).collect();
        assert_eq!(points, [vec![0, 3], vec![1, 2, 4, 5], vec![6, 9], vec![7, 8, 10, 11]]);
        check_times(&run, &plan);
    }

    #[test]
    fn shards_agree_only_on_the_same_config_scenes_and_kernels() {
        let of = |lines: &str| {
            let experiment = distinct_scenes(fixtures::experiment(lines)).expect("scenes");
            header(&experiment, &Sources::Embedded, 4)
        };
        let first = of("local_sizes = [1]");
        let scene =
            crate::scene::load_scene(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml"));
        assert_eq!((first.shards, &first.kernels), (4, &Sources::Embedded.hash()));
        assert_eq!(first.scenes, [scene.expect("a scene").scene.content_hash()]);
        assert_ne!(first.config_hash, of("local_sizes = [2]").config_hash);
    }

    #[test]
    fn only_folders_of_shards_and_new_folders_are_written_to() {
        let parent = tempfile::tempdir().expect("a folder");
        let [new, run, others] = ["new", "run", "others"].map(|name| parent.path().join(name));
        assert!(refuse_others(&new, false).is_ok());
        for (folder, file) in [(&run, "records.jsonl"), (&others, "thesis.tex")] {
            std::fs::create_dir(folder).expect("a folder");
            std::fs::write(folder.join(file), "").expect("a file");
        }
        let refused = |folder: &Path, force| refuse_others(folder, force).map_err(|error| error.to_string());
        assert!(
            refused(&run, true)
                .is_err_and(|message| message.ends_with("holds the results of a run without shards"))
        );
        assert!(refused(&others, false).is_err() && refused(&others, true).is_ok());
    }
}
