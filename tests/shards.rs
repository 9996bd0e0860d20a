//! One experiment that several processes measure in parts, called shards. Whatever starts the processes and whatever
//! happens to them, the merged results have the same points and as many samples as those of a single run. Most of these
//! tests use `--asleep`: frames that cast nothing and take a known time.

mod pages;
mod sweep;

use crate::binary::{WorkFolder, device, has, repository, run, until};
use raycl::record::{Record, Sample, read_lines};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// Number of points that the config's experiment measures. The config has two strategies, three local sizes
/// and two image sizes.
const POINTS: usize = 2 * 3 * 2;

/// A config, and the folder that its shards write to.
struct Ground {
    folder: WorkFolder,
}

impl Ground {
    fn new() -> Self {
        let scene = repository("scenes/triangle.toml");
        let text = format!(
            "question = \"What is measured?\"\nexpectation = \"Nothing new.\"\nscenes = [{scene:?}]\n\
             image_sizes = [[40, 25], [24, 15]]\n\
             local_sizes = [2, 4, 8]\nstrategies = [\"naive\", \"deferred\"]\n\
             [timing]\nlaunches = 2\nwarmup = 0\nmin_samples = 10\nmax_samples = 10\n"
        );
        Self { folder: WorkFolder::with(&[("test.toml", &text)]) }
    }

    fn command(&self, shard: &str, frame_ms: &str, more: &[&str]) -> Command {
        let mut command = crate::binary::program();
        command.args(["run", "test.toml", "--out", "out", "--shard", shard, "--quiet"]);
        if !frame_ms.is_empty() {
            command.args(["--asleep", frame_ms]);
        }
        command
            .args(more)
            .current_dir(self.folder.path(""))
            .env("RAYCL_LOCK_DIR", self.folder.path(".locks"));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        for name in [
            "SLURM_JOB_ID",
            "SLURMD_NODENAME",
            "SLURM_RESTART_COUNT",
            "GITHUB_RUN_ID",
            "GITHUB_RUN_ATTEMPT",
            "CI_JOB_ID",
        ] {
            command.env_remove(name);
        }
        command
    }

    fn shard(&self, shard: &str) {
        succeeds(run(&mut self.command(shard, "1", &[])));
    }

    fn merge(&self) -> String {
        self.folder.output(&["merge", "out"])
    }

    fn attempts(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.folder.path("out/parts")).into_iter().flatten().flatten();
        let mut folders: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
        folders.sort();
        folders
    }

    fn records(&self, file: &str) -> Vec<Record> {
        read_lines(&self.folder.path(file)).expect("records").lines
    }

    /// Checks that every point of the experiment has one record, that each of its samples occurs once, and
    /// that no other samples exist.
    fn is_whole(&self) {
        let records = self.records("out/records.jsonl");
        let keys: HashSet<_> = records.iter().map(|record| record.key.clone()).collect();
        assert_eq!((records.len(), keys.len()), (POINTS, POINTS));
        let samples = read_lines::<Sample>(&self.folder.path("out/samples.jsonl")).expect("samples").lines;
        let mut by_key: BTreeMap<String, Vec<(u32, u64)>> = BTreeMap::new();
        for sample in &samples {
            by_key.entry(sample.key.clone()).or_default().push((sample.launch, sample.ms.to_bits()));
        }
        for record in records {
            let times = record.samples_ms.iter().map(|ms| ms.to_bits());
            let mut own: Vec<_> = record.sample_launches.iter().copied().zip(times).collect();
            own.sort_unstable();
            let mut expected = by_key.remove(&record.key).unwrap_or_default();
            expected.sort_unstable();
            assert_eq!(own, expected, "{} {:?}", record.name, record.local_size);
        }
        assert!(by_key.is_empty(), "{by_key:?}");
    }
}

#[track_caller]
fn succeeds(output: Output) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{:?}: {said}", output.status);
}

fn kill(process: u32) {
    let process = Pid::from_raw(process as i32).expect("a process has a number");
    let _ = kill_process(process, Signal::KILL);
}

/// Returns every file of a folder with its bytes, except two files that differ from run to run. These two files are the
/// report, which contains a random number, and the file with the report's hash.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let same =
        |path: &PathBuf| path.is_file() && !path.ends_with("report.html") && !path.ends_with("raycl.b3sum");
    entries.filter(same).map(|path| (path.clone(), std::fs::read(path).expect("a file"))).collect()
}

#[test]
fn shards_are_merged_to_what_one_run_finds_and_a_second_merge_changes_nothing() {
    let ground = Ground::new();
    (1..=4).for_each(|shard| ground.shard(&format!("{shard}/4")));
    for attempt in ground.attempts() {
        let written =
            |name: &str| attempt.join(name).metadata().and_then(|file| file.modified()).expect("a time");
        assert!(
            written("pulse") <= written("end.json"),
            "an ended attempt has changed: {}",
            attempt.display()
        );
    }
    let said = ground.merge();
    has(&said, &["Merged:   4 attempts, 12 points, 120 samples", "report.html"]);
    ground.is_whole();
    // The plan has two groups of points but four shards, so both groups are divided. Both parts of a divided
    // group measure the same control point, by which the parts can be compared.
    let controls = ground.records("out/controls.jsonl");
    assert!(!controls.is_empty() && controls.iter().all(|record| record.is_control), "{}", controls.len());
    let of_controls = format!(", {} more samples of control points; 0 samples not used", 10 * controls.len());
    has(&said, &[&of_controls]);
    let records = ground.records("out/records.jsonl");
    assert!(records.iter().all(|record| record.host.is_some() && record.attempt.is_some()));
    let host = records[0].host.clone().expect("a machine");
    for (table, column) in
        [("out/summary.csv", "throttled_samples,host,block"), ("out/exports/points.csv", ",host,block")]
    {
        let table = ground.folder.text(table);
        assert!(table.lines().next().is_some_and(|header| header.ends_with(column)), "{column}");
        assert!(table.lines().skip(1).all(|row| row.contains(&format!(",{host},"))), "{table}");
    }
    has(&ground.folder.text("out/report.html"), &[&format!("measured on {host}")]);
    let summary = ground.folder.text("out/summary.csv");
    for record in &records {
        let [low, high] = record.interval_ms.expect("an interval");
        let row = summary.lines().find(|row| row.starts_with(&record.key)).expect("a row");
        assert!(
            row.contains(&format!(",{low},{high},")),
            "{low} to {high} is another interval than in {row}"
        );
    }
    let before = files(&ground.folder.path("out"));
    ground.merge();
    assert!(before == files(&ground.folder.path("out")), "the second merge changed something");
    has(&ground.folder.text("out/summary.md"), &["# What is measured?\n\nExpected: Nothing new.\n"]);
    let points = objects(&ground.folder.output(&["merge", "out", "--json"]));
    let mut keys: Vec<_> = points.iter().filter_map(|point| point["key"].as_str()).collect();
    keys.sort_unstable();
    let mut own: Vec<_> = records.iter().map(|record| record.key.as_str()).collect();
    own.sort_unstable();
    assert_eq!((points.len(), keys), (POINTS, own));
    let states = objects(&ground.folder.output(&["merge", "out", "--status", "--json"]));
    assert!(states.len() == 4 && states.iter().all(|one| one["state"] == "done"), "{states:?}");
    assert_eq!(ground.folder.output(&["merge", "out", "--quiet"]), "");
    has(&ground.folder.output(&["merge", "out", "--status"]), &["done", "4 attempts at 4 shards"]);
}

/// In this test, the plan in the folder is changed, so that it is not the plan of the folder's two attempts. Later in
/// the test, the files about the kinds of device (`kinds/`) are also missing.
#[test]
fn parts_of_another_plan_are_named_and_parts_without_their_kinds_refused() {
    let ground = Ground::new();
    ["1/2", "2/2"].iter().for_each(|shard| ground.shard(shard));
    let plan = ground.folder.text("out/shards.json");
    let mut plan: serde_json::Value = serde_json::from_str(&plan).expect("JSON");
    plan["blocks"][0]["number"] = 99.into();
    ground.folder.write("out/shards.json", &plan.to_string());
    has(&ground.merge(), &["note: The plan in shards.json is not that of 2 attempts (shard-00001."]);
    std::fs::remove_dir_all(ground.folder.path("out/kinds")).expect("a folder");
    let said = ground.folder.mistake(&["merge", "out"], 2);
    has(&said, &["no file in out/kinds lists the points of 12 records of 2 attempts (shard-00001."]);
    assert_eq!(ground.records("out/records.jsonl").len(), POINTS, "the merged results stay");
}

#[test]
fn what_is_missing_is_named_with_the_command_that_measures_it() {
    let ground = Ground::new();
    ground.shard("1/2");
    let said = ground.folder.mistake(&["merge", "out", "--quiet"], 1);
    has(
        &said,
        &["points are missing", "in shard 2", "raycl run test.toml --quiet --asleep 1 --out out --shard 2/2"],
    );
    // The shard was measured when the folder had another name. The printed command must name the folder's
    // present name.
    let [out, moved] = ["out", "moved it"].map(|name| ground.folder.path(name));
    std::fs::rename(&out, &moved).expect("a new name");
    let of_moved = ground.folder.mistake(&["merge", "moved it", "--quiet"], 1);
    has(&of_moved, &["raycl run test.toml --quiet --asleep 1 --out 'moved it' --shard 2/2"]);
    std::fs::rename(&moved, &out).expect("its name");
    let line = said.lines().find(|line| line.contains("raycl run")).expect("a command");
    // `output` sets RAYCL_MOVED_SAMPLES, too, so the variable is removed from the printed command.
    let words = line.trim_start().strip_prefix("RAYCL_MOVED_SAMPLES=keep raycl ").expect("a variable");
    let words: Vec<&str> = words.split_whitespace().collect();
    ground.folder.output(&words);
    ground.merge();
    ground.is_whole();
}

/// A user runs `raycl merge`, and then the command that `raycl merge` prints, in another current folder than the
/// attempts had. The command runs without the environment variables of the attempts (RAYCL_DEVICE and
/// RAYCL_MOVED_SAMPLES).
#[test]
fn the_command_for_what_is_missing_can_be_run_in_another_folder_with_the_same_device() {
    let ground = Ground::new();
    succeeds(run(ground.command("1/2", "1", &[]).env("RAYCL_DEVICE", "gpu")));
    let out = ground.folder.path("out").display().to_string();
    let mut merge = ground.folder.raycl(&["merge", &out, "--quiet"]);
    let merged = merge.current_dir("/").assert().code(1).get_output().clone();
    let said = String::from_utf8(merged.stderr).expect("UTF-8");
    let line = said.lines().find(|line| line.contains("raycl run")).expect("a command");
    let command = "&& RAYCL_MOVED_SAMPLES=keep raycl run test.toml --quiet --asleep 1 --device gpu --out ";
    has(line, &["(cd ", command, " --shard 2/2)"]);
    let mut shell = Command::new("sh");
    let raycl = format!("raycl() {{ '{}' \"$@\"; }}", env!("CARGO_BIN_EXE_raycl"));
    shell.args(["-c", &format!("{raycl}\n{line}")]).current_dir("/").env_remove("RAYCL_DEVICE");
    shell.env("XDG_CONFIG_HOME", crate::binary::NO_SETTINGS).env_remove("RAYCL_MOVED_SAMPLES");
    shell.env("RAYCL_LOCK_DIR", ground.folder.path(".locks"));
    succeeds(run(&mut shell));
    ground.merge();
    ground.is_whole();
}

/// Nobody can create files in /proc/sys, not even the superuser.
#[test]
#[cfg(target_os = "linux")]
fn a_merge_or_a_shard_into_a_folder_that_may_not_be_written_to_is_the_users_mistake() {
    let said = WorkFolder::new().mistake(&["merge", "/proc/sys"], 2);
    has(&said, &["the folder '/proc/sys' cannot be written to", "merge a copy of it"]);
    assert!(!said.contains("--out"), "{said}");
    let shard = ["run", "test.toml", "--out", "/proc/sys/new", "--asleep", "1", "--shard", "1/1"];
    let said = Ground::new().folder.mistake(&shard, 2);
    let expected = "cannot make /proc/sys/new: the folder '/proc/sys' cannot be written to";
    has(&said, &[expected, "choose another folder with --out DIR"]);
}

#[test]
fn shards_that_are_not_merged_are_answered_with_the_merge() {
    let ground = Ground::new();
    ground.shard("1/2");
    for command in [&["report", "out"][..], &["compare", "out", "out"]] {
        let said = ground.folder.mistake(command, 2);
        has(&said, &["out holds shards that are not merged yet", "first merge them: raycl merge out"]);
    }
}

#[test]
fn an_attempt_goes_on_where_a_killed_one_ended_and_does_not_touch_it() {
    let ground = Ground::new();
    let mut first = ground.command("1/1", "20", &[]).spawn().expect("it starts");
    until("a group is done", || {
        ground.attempts().first().is_some_and(|attempt| lines(&attempt.join("records.jsonl")) > 0)
    });
    until("the next group has begun", || lines(&ground.attempts()[0].join("samples.jsonl")) > 93);
    kill(first.id());
    first.wait().expect("it has ended");
    let rounds = ground.attempts()[0].join("rounds.jsonl");
    let damaged = [std::fs::read(&rounds).expect("rounds"), b"nonsense\n".to_vec()].concat();
    std::fs::write(&rounds, damaged).expect("a damaged line");
    let before = files(&ground.attempts()[0]);
    has(
        &ground.folder.output(&["merge", "out", "--status", "--between", "2"]),
        &["lost: the counter in the attempt's folder no longer increases"],
    );
    has(&ground.folder.mistake(&["merge", "out", "--quiet"], 1), &["points are missing"]);
    let second = run(&mut ground.command("1/1", "20", &[]));
    let message = String::from_utf8_lossy(&second.stderr).into_owned();
    has(&message, &["raycl ignores 1 damaged line of out/parts/shard-00001.", "/rounds.jsonl"]);
    succeeds(second);
    assert!(before == files(&ground.attempts()[0]), "the first attempt's folder was written to");
    let records = |attempt: usize| lines(&ground.attempts()[attempt].join("records.jsonl"));
    assert_eq!(records(0) + records(1), POINTS, "no point was measured twice");
    has(&ground.merge(), &["note: raycl ignores 1 damaged line of parts/shard-00001."]);
    ground.is_whole();
    has(
        &ground.folder.output(&["repair", "out"]),
        &["out/parts/shard-00001.", "/rounds.jsonl: removed damaged lines: 1, lines kept: "],
    );
    let said = ground.merge();
    assert!(!said.contains("damaged"), "{said}");
}

/// If a scene and its copy were measured, each shard would measure points that another shard has measured too.
#[test]
fn of_scenes_with_the_same_content_one_is_measured() {
    let ground = Ground::new();
    let [scene, other] = ["triangle", "pyramid-upper"].map(|name| repository(&format!("scenes/{name}.toml")));
    std::fs::copy(&scene, ground.folder.path("copy.toml")).expect("a copy");
    let scenes = format!("[{scene:?}, \"copy.toml\", {other:?}]");
    let text = ground.folder.text("test.toml").replace(&format!("[{scene:?}]"), &scenes);
    ground.folder.write("test.toml", &text);
    let note = "scene copy.toml has the same content as triangle; raycl measures only triangle";
    let message = ground.folder.output(&["run", "test.toml", "--dry-run", "--asleep", "1"]);
    has(&message, &[&format!("note: {note}"), &format!("{} points, 0 of which", 2 * POINTS)]);
    ["1/2", "2/2"].iter().for_each(|shard| ground.shard(shard));
    let said = ground.merge();
    has(&said, &[note, "; 0 samples not used"]);
    assert!(!said.contains("several attempts"), "{said}");
    let points = |file: &str| -> Vec<String> {
        let plan: serde_json::Value = serde_json::from_str(&ground.folder.text(file)).expect("JSON");
        plan["points"].as_array().expect("a list").iter().map(|point| point.to_string()).collect()
    };
    for file in ["out/plan.json", "out/shards.json"] {
        let points = points(file);
        assert_eq!(points.iter().collect::<HashSet<_>>().len(), 2 * POINTS, "{file}");
        assert_eq!(points.len(), 2 * POINTS, "{file}");
    }
    assert_eq!(ground.records("out/records.jsonl").len(), 2 * POINTS);
}

/// Returns the JSON objects in a text, one after another.
fn objects(text: &str) -> Vec<serde_json::Value> {
    serde_json::Deserializer::from_str(text).into_iter().map(|object| object.expect("JSON")).collect()
}

/// Returns the number of complete lines of a file, which may not exist yet.
fn lines(path: &Path) -> usize {
    std::fs::read(path).map_or(0, |bytes| bytes.iter().filter(|byte| **byte == b'\n').count())
}

#[test]
fn two_attempts_at_once_are_both_seen_and_counted_once() {
    let ground = Ground::new();
    let both: Vec<Child> =
        (0..2).map(|_| ground.command("1/1", "5", &[]).spawn().expect("it starts")).collect();
    both.into_iter().for_each(|child| succeeds(crate::binary::finish(child)));
    assert_eq!(ground.attempts().len(), 2);
    has(&ground.merge(), &["12 points have records of several attempts", "120 samples not used"]);
    ground.is_whole();
}

#[test]
fn another_plan_is_refused_and_so_are_runs_and_shards_in_one_folder() {
    let ground = Ground::new();
    ground.shard("1/2");
    has(&ground.folder.output(&["merge", "out", "--status"]), &["1 attempt at 2 shards"]);
    let refused = |arguments: &[&str]| ground.folder.mistake(arguments, 2);
    let shard = ["run", "test.toml", "--out", "out", "--asleep", "1", "--shard"];
    has(
        &refused(&[&shard[..], &["1/3"]].concat()),
        &["the number of shards differs: 2 in the folder, 3 in this command"],
    );
    let other = [&shard[..], &["1/2", "--set", "timing.seed=7"]].concat();
    has(&refused(&other), &["the config or a value of --set differs", "timing.seed = 7"]);
    has(
        &refused(&["run", "test.toml", "--out", "out", "--asleep", "1"]),
        &["holds an experiment that is divided into 2 shards"],
    );
    has(&refused(&["merge", "elsewhere"]), &["there is no folder elsewhere"]);
    has(&refused(&["merge", "."]), &["holds no experiment that is divided into shards"]);
    has(&refused(&["merge", "out", "--status", "--quiet"]), &["--quiet", "cannot be used with"]);
    has(&refused(&["merge", "out", "--status", "--device", "gpu"]), &["--device", "cannot be used with"]);
    ground.folder.output(&["run", "test.toml", "--out", "whole", "--asleep", "0.1", "--quiet"]);
    has(
        &refused(&["run", "test.toml", "--out", "whole", "--asleep", "1", "--shard", "1/2"]),
        &["holds the results of a run without shards"],
    );
}

#[test]
fn launchers_and_a_shell_loop_make_the_same_shards() {
    let ground = Ground::new();
    let loops = Ground::new();
    let plan = |ground: &Ground, attempt: usize| {
        std::fs::read_to_string(ground.attempts()[attempt].join("plan.json")).expect("a plan")
    };
    for rank in 0..4 {
        let mut command = ground.command("auto", "0.1", &[]);
        command.env("OMPI_COMM_WORLD_RANK", rank.to_string()).env("OMPI_COMM_WORLD_SIZE", "4");
        succeeds(run(&mut command));
        succeeds(run(&mut loops.command(&format!("{}/4", rank + 1), "0.1", &[])));
        assert_eq!(plan(&ground, rank), plan(&loops, rank));
    }
    let output = run(&mut ground.command("auto", "1", &[]));
    assert_eq!(output.status.code(), Some(2));
    has(&String::from_utf8_lossy(&output.stderr), &["--shard auto needs a launcher", "JOB_COMPLETION_INDEX"]);
}

#[test]
#[cfg(target_os = "linux")]
fn a_lost_launcher_ends_the_attempt_and_its_worker() {
    lose_launcher("slurmstepd", "1/1");
}

/// The launcher may be any program that is not a shell. A shell counts as a launcher only with `--shard auto` or
/// `--shard auto/N`, which both take the shard's number from a variable that the launcher sets.
#[test]
#[cfg(target_os = "linux")]
fn an_unknown_launcher_that_is_lost_ends_the_attempt_too() {
    lose_launcher("my-launcher", "1/1");
    lose_launcher("sh", "auto/1");
}

/// Starts a shard by a program with a launcher's name, kills this program, and checks that the attempt ends.
#[cfg(target_os = "linux")]
fn lose_launcher(name: &str, shard: &str) {
    let ground = Ground::new();
    let launcher = ground.folder.path(name);
    crate::binary::copy_program("/bin/sh", &launcher);
    let raycl = format!(
        "{} run test.toml --out out --shard {shard} --quiet --asleep 2000; true",
        env!("CARGO_BIN_EXE_raycl")
    );
    let mut command = Command::new(&launcher);
    command.env("XDG_CONFIG_HOME", crate::binary::NO_SETTINGS);
    command.args(["-c", &raycl]).current_dir(ground.folder.path("")).stdin(Stdio::null());
    command.env("JOB_COMPLETION_INDEX", "0");
    let mut launcher = command.spawn().expect("it starts");
    until("a worker is at work", || {
        ground.attempts().first().is_some_and(|attempt| !workers(attempt).is_empty())
    });
    let attempt = ground.attempts().remove(0);
    let workers = workers(&attempt);
    kill(launcher.id());
    launcher.wait().expect("it has ended");
    until("the attempt says that its launcher is lost", || {
        std::fs::read_to_string(attempt.join("end.json")).is_ok_and(|end| end.contains("launcher-lost"))
    });
    until("its worker is gone", || workers.iter().all(|process| !lives(process)));
    assert_eq!(lines(&attempt.join("records.jsonl")), 0, "the point under way stays unmeasured");
    has(&ground.folder.mistake(&["merge", "out", "--quiet"], 1), &["12 points are missing"]);
    has(&ground.folder.output(&["merge", "out", "--status"]), &[&format!("launcher lost: {name}")]);
}

/// Returns the workers of an attempt's process.
#[cfg(target_os = "linux")]
fn workers(attempt: &Path) -> Vec<String> {
    let about = std::fs::read_to_string(attempt.join("attempt.json")).unwrap_or_default();
    let about: serde_json::Value = serde_json::from_str(&about).unwrap_or_default();
    let process = about["process"].as_u64().unwrap_or(0);
    let children =
        std::fs::read_to_string(format!("/proc/{process}/task/{process}/children")).unwrap_or_default();
    children.split_whitespace().map(str::to_owned).collect()
}

#[cfg(target_os = "linux")]
fn lives(process: &String) -> bool {
    std::fs::read_to_string(format!("/proc/{process}/stat")).is_ok_and(|stat| !stat.contains(") Z "))
}

#[test]
fn a_device_of_one_compute_unit_and_the_same_of_two_are_two_kinds() {
    let ground = Ground::new();
    let measure = |threads: &str, shard: &str| {
        let mut command = ground.command(
            shard,
            "",
            &["--device", &device(), "--set", "strategies=['naive']", "--set", "local_sizes=[4]"],
        );
        command.env("POCL_CPU_MAX_CU_COUNT", threads).env("POCL_MAX_PTHREAD_COUNT", threads);
        succeeds(run(&mut command));
    };
    for (threads, shard) in [("1", "1/2"), ("2", "1/2"), ("2", "2/2")] {
        measure(threads, shard);
    }
    // The printed command sets two environment variables. Without them, the command would measure on a device
    // with another number of compute units.
    let message = ground.folder.mistake(&["merge", "out", "--quiet"], 1);
    has(&message, &["POCL_CPU_MAX_CU_COUNT=1 POCL_MAX_PTHREAD_COUNT=1 raycl run", "--shard 2/2"]);
    measure("1", "2/2");
    ground.merge();
    let records = ground.records("out/records.jsonl");
    let keys: HashSet<_> = records.iter().map(|record| &record.key).collect();
    assert_eq!((records.len(), keys.len()), (4, 4));
    has(&ground.folder.text("out/summary.md"), &["1 compute unit,", "2 compute units,"]);
}

#[test]
fn slurm_scripts_are_printed_and_none_submitted() {
    let ground = Ground::new();
    let said =
        ground.folder.output(&["run", "test.toml", "--out", "out", "--sbatch", "16", "--device", "h200"]);
    has(
        &said,
        &[
            "#SBATCH --array=1-16",
            "#SBATCH --gres=gpu:1",
            "--out out --device h200 --shard auto/16",
            "raycl merge out",
            "afterany",
        ],
    );
    let said =
        ground.folder.output(&["run", "test.toml", "--out", "out", "--sbatch", "4", "--device", "cpu"]);
    has(&said, &["#SBATCH --exclusive"]);
    // The config or the environment may name the device instead of the option `--device`.
    let usual = ["run", "test.toml", "--out", "out", "--sbatch", "4"];
    let said = ground.folder.output(&[&usual[..], &["--set", "devices=['h200']"]].concat());
    let mut default = ground.folder.raycl(&usual);
    let output = default.env("RAYCL_DEVICE", "h200").assert().success().get_output().clone();
    for said in [said, String::from_utf8_lossy(&output.stdout).into_owned()] {
        has(&said, &["#SBATCH --gres=gpu:1"]);
        assert!(!said.contains("--exclusive"), "{said}");
    }
    assert!(!ground.folder.path("out").exists(), "nothing was written");
    // No script is printed for a folder that the jobs would refuse.
    let refused = |out: &str| ground.folder.mistake(&["run", "test.toml", "--out", out, "--sbatch", "4"], 2);
    has(&refused("test.toml"), &["'test.toml' is a file; a folder is needed here"]);
    has(&refused("."), &["'.' is not a folder of results: it contains"]);
}

/// In this test, functions of bash take the place of the command `sbatch`. The first job gets the number 7.
#[test]
fn the_printed_script_submits_both_jobs_without_writing_a_file() {
    let ground = Ground::new();
    let arguments = ["run", "test.toml", "--out", "it's out", "--sbatch", "4", "--asleep", "1"];
    let said = ground.folder.output(&arguments);
    let submit = |sbatch: &str| {
        let mut command = Command::new("bash");
        command.args(["-c", &format!("{sbatch}\n{said}")]).current_dir(ground.folder.path(""));
        let output = run(&mut command);
        (output.status.success(), String::from_utf8(output.stderr).expect("UTF-8"))
    };
    let (is_done, submitted) = submit("sbatch() { { echo \"sbatch $*\"; cat; } >&2; echo '7;cluster'; }");
    let jobs: Vec<&str> = submitted.split("sbatch ").collect();
    let [_, shards, merge] = jobs[..] else { panic!("not two jobs: {submitted}") };
    assert!(is_done, "{submitted}");
    has(
        shards,
        &["--parsable\n#!/bin/bash\n#SBATCH --job-name=", "--out 'it'\\''s out'", "--shard auto/4\n"],
    );
    has(merge, &["--dependency=afterany:7\n#!/bin/bash\n", "raycl merge 'it'\\''s out'\n"]);
    let (is_done, submitted) = submit("sbatch() { echo \"sbatch $*\" >&2; return 1; }");
    assert!(!is_done && submitted.matches("sbatch ").count() == 1, "{submitted}");
    assert_eq!(files(&ground.folder.path("")).len(), 1, "the config is the only file");
}

#[test]
fn a_script_is_based_on_earlier_times_only_if_every_point_has_one() {
    let ground = Ground::new();
    let usual = ["run", "test.toml", "--asleep", "1", "--quiet", "--out"];
    let raycl = |more: &[&str]| ground.folder.output(&[&usual[..], more].concat());
    let script = || raycl(&["out", "--sbatch", "4"]);
    raycl(&["some", "--set", "strategies=['naive']"]);
    has(&script(), &["(a guess: not all points were measured before)", "#SBATCH --array=1-4"]);
    raycl(&["all"]);
    has(&script(), &["(based on earlier times)"]);
}
