//! Tests with real runs, real worker processes and real faults: a run loses only the data that the fault
//! destroyed.

use crate::binary::{copy_program, finish, run, until};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use raycl::experiment::{Job, Phase, Reply, Request};
use raycl::record::{Outcome, Record, Sample, read_lines};
use rustix::process::{Pid, Resource, Rlimit, Signal, kill_process, prlimit};
use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::Write as _;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// Number of points: one baseline, and two strategies at two local sizes; all of these at two image sizes.
const POINTS: usize = 10;

/// A folder with a config, in which the test starts runs.
struct Ground {
    folder: TempDir,
    config: PathBuf,
    out: PathBuf,
}

impl Ground {
    fn new(samples: u32) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
        let text = format!(
            "question = \"?\"\nexpectation = \"!\"\nscenes = [{scene:?}]\nimage_sizes = [[40, 25], [24, 15]]\n\
             local_sizes = [2, 4]\nstrategies = [\"naive\", \"deferred\"]\nbaselines = [\"serial\"]\n\
             [timing]\nlaunches = 1\nwarmup = 1\nmin_samples = {samples}\nmax_samples = {samples}\n"
        );
        let config = folder.path().join("test.toml");
        std::fs::write(&config, text).expect("a config");
        Self { config, out: folder.path().join("out"), folder }
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let device =
            std::env::var("RAYCL_TEST_DEVICE").unwrap_or_else(|_| "portable computing language".to_owned());
        let mut command = crate::binary::program();
        command.arg("run").arg(&self.config).arg("--out").arg(&self.out);
        command.args(["--quiet", "--device", &device]).args(arguments);
        // Each test has its own folder for the locks of devices, so that tests do not wait for each other.
        command.env("RAYCL_LOCK_DIR", self.folder.path().join("locks")).env("RAYCL_CACHE_MIB", "0");
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        run(&mut self.command(arguments))
    }

    fn start(&self, arguments: &[&str]) -> Child {
        self.command(arguments).spawn().expect("it starts")
    }

    fn records(&self) -> Vec<Record> {
        read_lines(&self.out.join("records.jsonl")).map(|read| read.lines).unwrap_or_default()
    }

    fn count(&self, outcome: Outcome) -> usize {
        self.records().iter().filter(|record| record.outcome == outcome).count()
    }

    /// Checks that every point of the experiment was measured exactly once, and that no sample is stored
    /// twice. Usually, a round of the experiment has one sample of each point. A round has two samples of a
    /// point if the first sample does not count because the host had moved a virtual machine's processors to
    /// other cores. The host may move the processors at any time, and only the core-to-core latency shows
    /// such a move.
    fn all_measured_once(&self) {
        assert_eq!((self.count(Outcome::Measured), self.records().len()), (POINTS, POINTS));
        let keys: HashSet<_> = self.records().into_iter().map(|record| record.key).collect();
        assert_eq!(keys.len(), POINTS);
        let samples = read_lines::<Sample>(&self.out.join("samples.jsonl")).expect("samples").lines;
        let mut rounds: HashMap<_, Vec<&Sample>> = HashMap::new();
        for sample in &samples {
            rounds.entry((&sample.key, sample.launch, sample.round)).or_default().push(sample);
        }
        for taken in rounds.values() {
            let is_repeated =
                |first: &Sample, again: &Sample| first.core_to_core_ns.is_some() && first.at_ms < again.at_ms;
            assert!(
                matches!(taken[..], [_]) || matches!(taken[..], [first, again] if is_repeated(first, again)),
                "{taken:?}"
            );
        }
    }

    /// Returns the number of samples on disk. Only complete lines count.
    fn samples(&self) -> usize {
        let bytes = std::fs::read(self.out.join("samples.jsonl")).unwrap_or_default();
        bytes.iter().filter(|&&byte| byte == b'\n').count()
    }

    fn resume(&self) {
        let output = self.run(&["--resume"]);
        assert!(output.status.success(), "{}", said(&output));
        self.all_measured_once();
    }

    /// Waits until the worker hangs, as `--fault` requests.
    fn until_it_hangs(&self) {
        until("it hangs", || self.out.join(".hangs").exists());
    }

    /// Lets the worker that waits because of `--fault` continue.
    fn let_go(&self) {
        std::fs::remove_file(self.out.join(".hangs")).expect("the file that a waiting worker makes");
    }
}

fn said(output: &Output) -> String {
    // Line breaks depend on the terminal's width, so they are replaced by blanks.
    let text = String::from_utf8_lossy(&output.stderr).replace('│', " ");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Sends a signal; returns false if the process no longer existed.
fn send(signal: Signal, process: u32) -> bool {
    Pid::from_raw(process as i32).is_some_and(|process| kill_process(process, signal).is_ok())
}

/// Sends a signal and waits until the process has received it.
fn signal(signal: Signal, process: u32) {
    assert!(send(signal, process), "process {process} is gone");
    until("the signal is taken", || !has_pending_signals(process));
}

/// Returns true if a signal to the process has not reached its handler yet, and false if none is pending or
/// if the process has ended.
fn has_pending_signals(process: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let masks =
        status.lines().filter_map(|line| line.strip_prefix("ShdPnd:").or(line.strip_prefix("SigPnd:")));
    masks.into_iter().any(|mask| mask.trim().contains(|digit| digit != '0'))
}

/// Returns the process ids of a process's children.
pub fn children(process: u32) -> Vec<u32> {
    let list =
        std::fs::read_to_string(format!("/proc/{process}/task/{process}/children")).unwrap_or_default();
    list.split_whitespace().filter_map(|word| word.parse().ok()).collect()
}

/// Returns true if a process exists and has not ended.
pub fn is_alive(process: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    !status.is_empty() && !status.contains(") Z ")
}

#[test]
fn every_way_to_die_costs_its_point_only() {
    let faults = [
        ("abort@cast:2", Outcome::Crashed, "SIGABRT"),
        ("segv@check:1", Outcome::Crashed, "SIGSEGV"),
        ("kill@cast:4", Outcome::Crashed, "SIGKILL"),
        ("exit@check:3", Outcome::Crashed, "exit status: 7"),
        ("panic@cast:7", Outcome::Crashed, "a fault on purpose"),
        ("hang@cast:6", Outcome::TimedOut, "did not answer within 5 s"),
    ];
    for (fault, outcome, reason) in faults {
        let ground = Ground::new(3);
        let limit = if outcome == Outcome::TimedOut { "5" } else { "600" };
        let output = ground.run(&["--fault", fault, "--hang-limit", limit]);
        assert_eq!(output.status.code(), Some(1), "{fault}: {}", said(&output));
        assert_eq!((ground.count(Outcome::Measured), ground.count(outcome)), (POINTS - 1, 1), "{fault}");
        let lost = ground.records().into_iter().find(|record| record.outcome == outcome);
        let why = lost.and_then(|record| record.reason).unwrap_or_default();
        assert!(why.contains(reason), "{fault}: {why}");
        // A resumed run does not measure the failed point again. With `--retry-failed`, the run measures this
        // point again, but no other point.
        assert_eq!(ground.run(&["--resume"]).status.code(), Some(1));
        assert_eq!(ground.records().len(), POINTS);
        assert!(ground.run(&["--resume", "--retry-failed"]).status.success());
        assert_eq!((ground.records().len(), ground.count(Outcome::Measured)), (POINTS + 1, POINTS));
    }
}

/// A run does not limit the time in which a worker loads a scene. The worker therefore tells the run when it begins
/// and ends to load a scene.
#[test]
fn a_worker_says_when_it_begins_and_ends_to_load_a_scene() {
    let ground = Ground::new(3);
    let text = std::fs::read_to_string(&ground.config).expect("a config");
    let job = Job { config: ground.config.clone(), text, device_count: 1, ..Job::default() };
    let request = Request::Build { point: 0 };
    let file = ground.folder.path().join("replies");
    let mut command = crate::binary::program();
    command.arg("worker").env("RAYCL_WORKER", "1").stdin(Stdio::piped());
    command.stdout(File::create(&file).expect("a file"));
    let mut worker = command.spawn().expect("it starts");
    let mut input = worker.stdin.take().expect("standard input");
    let lines =
        [serde_json::to_string(&job), serde_json::to_string(&request)].map(|line| line.expect("JSON"));
    writeln!(input, "{}", lines.join("\n")).expect("the worker reads");
    let replies = || -> Vec<Reply> {
        let text = std::fs::read_to_string(&file).expect("replies");
        text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
    };
    // The first point is a caster on the host, which has no program.
    until("the worker replies", || replies().contains(&Reply::Built(None)));
    // The worker ends when its standard input ends.
    drop(input);
    assert!(finish(worker).status.success());
    let [loads, casts] = [Phase::Host, Phase::Cast].map(Reply::Begins);
    assert_eq!(replies(), [Reply::Started, loads, casts, Reply::Built(None)]);
}

#[test]
fn what_happens_once_and_what_drivers_print_cost_nothing() {
    for fault in ["segv@cast:2:once", "abort@check:0:once", "garbage@check:3", "garbage@cast:1"] {
        let ground = Ground::new(3);
        let output = ground.run(&["--fault", fault]);
        assert!(output.status.success(), "{fault}: {}", said(&output));
        ground.all_measured_once();
    }
}

/// Returns how many times a test kills a process: the value of RAYCL_KILLS, or 8.
fn kills() -> usize {
    std::env::var("RAYCL_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(8)
}

/// Waits for a random moment of a run: until some time has passed since its start, or until it has some
/// samples.
fn random_moment(rng: &mut ChaCha8Rng, ground: &Ground, run: &mut Child) {
    let samples = rng.random_range(0..100_usize).saturating_sub(40);
    if samples == 0 {
        std::thread::sleep(Duration::from_millis(rng.random_range(0..400)));
        return;
    }
    let ended = std::cell::RefCell::new(run);
    until("there are samples, or the run has ended", || {
        ground.samples() >= samples || !matches!(ended.borrow_mut().try_wait(), Ok(None))
    });
}

/// A test that kills runs or workers gives up after this many runs per kill. Most runs have not ended yet when the
/// test is about to kill, so fewer runs are enough.
const RUNS_FOR_A_KILL: usize = 20;

#[test]
fn runs_killed_at_random_moments_lose_and_repeat_nothing() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (mut killed, mut finished) = (0, 0);
    while killed < kills() {
        assert!(finished < RUNS_FOR_A_KILL * kills(), "{killed} kills in {finished} runs");
        let ground = Ground::new(12);
        while killed < kills() {
            let mut run = ground.start(&["--resume"]);
            random_moment(&mut rng, &ground, &mut run);
            if run.try_wait().expect("a process").is_some() {
                break;
            }
            let workers = children(run.id());
            run.kill().expect("a kill");
            run.wait().expect("a process");
            killed += 1;
            until("its workers are gone", || !workers.iter().any(|&worker| is_alive(worker)));
        }
        ground.resume();
        finished += 1;
    }
    eprintln!("killed {killed} times over {finished} runs; points lost: 0, measured twice: 0");
}

#[test]
fn workers_killed_at_random_moments_cost_nothing() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let (mut killed, mut runs) = (0, 0);
    while killed < kills() {
        assert!(runs < RUNS_FOR_A_KILL * kills(), "{killed} kills in {runs} runs");
        runs += 1;
        let ground = Ground::new(12);
        let mut run = ground.start(&[]);
        random_moment(&mut rng, &ground, &mut run);
        // At most one worker is killed per run. If two workers died at the same point, the point would count as failed.
        killed += children(run.id()).first().is_some_and(|&worker| send(Signal::KILL, worker)) as usize;
        let output = finish(run);
        assert!(output.status.success() || said(&output).contains("could not start"), "{}", said(&output));
        ground.resume();
    }
    eprintln!("killed {killed} workers; points lost: 0, measured twice: 0");
}

#[test]
fn ctrl_c_ends_after_the_sample_says_how_to_resume_and_exits_with_130() {
    for name in [Signal::INT, Signal::TERM] {
        let ground = Ground::new(12);
        // A point of the second image size is being timed, and its worker waits until the test lets it continue.
        let run = ground.start(&["--fault", "hold@cast:7"]);
        ground.until_it_hangs();
        signal(name, run.id());
        ground.let_go();
        let output = finish(run);
        let said = said(&output);
        assert_eq!(output.status.code(), Some(130), "{said}");
        assert!(said.contains("interrupted") && said.contains("--resume"), "{said}");
        let before = ground.records().len();
        assert!((1..POINTS).contains(&before), "{before}");
        assert!(ground.out.join("summary.md").exists());
        ground.resume();
    }
}

#[test]
fn a_signal_to_the_whole_process_group_ends_no_worker_before_its_run() {
    for name in [Signal::INT, Signal::TERM] {
        let ground = Ground::new(12);
        let run = ground.start(&["--fault", "hold@cast:7"]);
        ground.until_it_hangs();
        for worker in children(run.id()) {
            signal(name, worker);
            assert!(is_alive(worker), "{name:?}");
        }
        // The program `timeout` signals its child process twice: alone, and as a member of its process group.
        signal(name, run.id());
        signal(name, run.id());
        ground.let_go();
        let output = finish(run);
        let said = said(&output);
        assert_eq!(output.status.code(), Some(130), "{said}");
        // If the second signal had ended the run, the run would have printed nothing.
        assert!(said.contains("interrupted") && said.contains("--resume"), "{said}");
        ground.resume();
    }
}

#[test]
fn a_second_ctrl_c_ends_at_once_and_leaves_no_worker() {
    let ground = Ground::new(3);
    let run = ground.start(&["--fault", "hang@cast:7"]);
    ground.until_it_hangs();
    let workers = children(run.id());
    assert_eq!(workers.len(), 1);
    signal(Signal::INT, run.id());
    std::thread::sleep(Duration::from_millis(300));
    assert!(is_alive(run.id()), "the first waits for the sample");
    // The worker hangs, so the current sample never ends, and only the second signal can end the run. When
    // the second signal arrives, the first one may not have been handled yet. The test therefore sends
    // further signals until the run has ended; more signals do no harm.
    let process = run.id();
    until("the second ends it", || !send(Signal::INT, process) || !is_alive(process));
    let output = finish(run);
    assert_eq!(output.status.code(), Some(130));
    until("the worker is gone", || !is_alive(workers[0]));
    ground.resume();
}

#[test]
fn a_second_run_into_the_same_folder_is_refused() {
    let ground = Ground::new(3);
    let mut first = ground.start(&["--fault", "hang@cast:7"]);
    ground.until_it_hangs();
    let second = ground.run(&["--resume"]);
    assert_eq!(second.status.code(), Some(2));
    assert!(said(&second).contains(&format!("another run (process {})", first.id())), "{}", said(&second));
    first.kill().expect("a kill");
    first.wait().expect("a process");
    let third = ground.run(&[]);
    assert_eq!(third.status.code(), Some(2));
    assert!(said(&third).contains("--resume"), "{}", said(&third));
    ground.resume();
}

#[test]
fn a_program_whose_file_is_removed_meanwhile_ends_its_run() {
    let ground = Ground::new(3);
    let file = ground.folder.path().join("raycl");
    copy_program(env!("CARGO_BIN_EXE_raycl"), &file);
    let command = ground.command(&[]);
    let mut copy = Command::new(&file);
    copy.args(command.get_args()).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    copy.envs(command.get_envs().filter_map(|(name, value)| Some((name, value?))));
    // After its start, raycl no longer needs its program file. Without this file, raycl can even start the processes
    // that list the devices and measure the points.
    let started = copy.spawn().expect("it starts");
    std::fs::remove_file(&file).expect("a file to remove");
    let output = finish(started);
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(ground.count(Outcome::Measured), POINTS);
}

#[test]
fn a_driver_that_is_gone_ends_the_run_and_loses_no_point() {
    // Debian's OpenCL loader reads the folder that the variable OCL_ICD_VENDORS names.
    let vendors = tempfile::tempdir().expect("a folder");
    let list = std::env::var_os("OCL_ICD_VENDORS").map_or("/etc/OpenCL/vendors".into(), PathBuf::from);
    for entry in std::fs::read_dir(list).into_iter().flatten().flatten() {
        std::fs::copy(entry.path(), vendors.path().join(entry.file_name())).expect("a copy");
    }
    let ground = Ground::new(3);
    let run = ground
        .command(&["--fault", "hang@cast:7"])
        .env("OCL_ICD_VENDORS", vendors.path())
        .spawn()
        .expect("it starts");
    ground.until_it_hangs();
    vendors.close().expect("an empty place");
    assert!(send(Signal::KILL, children(run.id())[0]), "the worker hangs");
    let output = finish(run);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        said(&output).contains("no OpenCL platform") && said(&output).contains("--resume"),
        "{}",
        said(&output)
    );
    assert_eq!(ground.records().len(), ground.count(Outcome::Measured));
    ground.resume();
}

/// raycl does the work of `render` in a child process. The system may kill this process, for example because memory
/// runs out.
#[test]
fn a_command_whose_child_process_is_killed_names_the_signal() {
    let mut command = crate::binary::program();
    command.args(["render", "-", "-o", "-"]).env("RAYCL_CACHE_MIB", "0");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut render = command.spawn().expect("it starts");
    // As long as standard input is open, the child process waits for its scene.
    let input = render.stdin.take();
    let process = render.id();
    until("it has a child process", || !children(process).is_empty());
    assert!(send(Signal::KILL, children(process)[0]), "it waits");
    let output = finish(render);
    drop(input);
    assert_eq!(output.status.code(), Some(137), "{}", said(&output));
    assert!(said(&output).contains("SIGKILL (signal 9)"), "{}", said(&output));
}

#[test]
fn a_full_disk_ends_the_run_with_a_message_and_loses_nothing_finished() {
    let ground = Ground::new(60);
    let run = ground.start(&[]);
    until("a point is done", || !ground.records().is_empty());
    // From now on, the run's own process cannot make any file larger than 1000 bytes. The run's worker and
    // the driver's cache do not have this limit for the size of files.
    let limit = Rlimit { current: Some(1000), maximum: Some(1000) };
    prlimit(Pid::from_raw(run.id() as i32), Resource::Fsize, limit).expect("a limit");
    let output = finish(run);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    for part in ["cannot write", "ulimit -f", "--resume"] {
        assert!(said(&output).contains(part), "{part} is not in {}", said(&output));
    }
    assert!((1..POINTS).contains(&ground.records().len()));
    ground.resume();
}

/// Returns a command that runs `command`. Run in this way, `command` cannot make a file larger than `kibibytes` KiB.
fn limited(kibibytes: u32, command: &Command) -> Command {
    let mut bash = Command::new("bash");
    let words = format!("ulimit -f {kibibytes}; exec \"$@\"");
    bash.args(["-c", &words, "bash"]).arg(command.get_program()).args(command.get_args());
    for (name, value) in command.get_envs() {
        value.map(|value| bash.env(name, value));
    }
    bash
}

#[test]
fn a_repair_on_a_full_disk_changes_nothing_and_leaves_no_half_copy() {
    let out = tempfile::tempdir().expect("a folder");
    let (journal, damaged) = (out.path().join("records.jsonl"), "nonsense\n".repeat(1000));
    std::fs::write(&journal, &damaged).expect("a journal");
    let mut repair = crate::binary::program();
    repair.arg("repair").arg(out.path());
    let output = run(&mut limited(1, &repair));
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    for part in ["cannot write", "records.jsonl.damaged-1", "ulimit -f"] {
        assert!(said(&output).contains(part), "{part} is not in {}", said(&output));
    }
    assert_eq!(std::fs::read_to_string(&journal).expect("a journal"), damaged);
    let names = std::fs::read_dir(out.path()).expect("a folder").flatten().map(|entry| entry.file_name());
    assert_eq!(names.filter(|name| name != ".lock").count(), 1, "the journal");
}

/// In this test, the run cannot write a file at one of two moments: before anything is measured, or after all
/// points are measured.
#[test]
fn a_full_disk_before_or_after_the_measurement_leaves_a_folder_that_can_be_continued() {
    let ground = Ground::new(3);
    let limited = |kibibytes: u32, arguments: &[&str]| {
        let output = run(&mut limited(kibibytes, &ground.command(arguments)));
        assert_eq!(output.status.code(), Some(1), "{}", said(&output));
        let names = std::fs::read_dir(&ground.out).expect("results").flatten().map(|entry| entry.file_name());
        let unfinished: Vec<_> = names.filter(|name| name.to_string_lossy().starts_with(".raycl-")).collect();
        assert!(unfinished.is_empty(), "{unfinished:?}");
        said(&output)
    };
    let resumes = |said: &str, file: &str| {
        let command = ["to continue from here: ", "RAYCL_MOVED_SAMPLES=keep ", " raycl run ", "--resume"];
        for part in ["cannot write", file, "ulimit -f"].into_iter().chain(command) {
            assert!(said.contains(part), "{part} is not in {said}");
        }
    };
    resumes(&limited(1, &[]), "environment.json");
    assert!(!ground.out.join("records.jsonl").exists(), "a new run would be refused");
    ground.resume();
    std::fs::remove_file(ground.out.join("report.html")).expect("a report");
    resumes(&limited(64, &["--resume"]), "report.html");
    ground.resume();
    assert!(ground.out.join("report.html").exists());
}

#[test]
fn a_folder_that_cannot_be_written_is_the_users_mistake() {
    let mut ground = Ground::new(3);
    // Not even root can create folders in /sys.
    let mut paths = vec![PathBuf::from("/sys/raycl")];
    let closed = ground.folder.path().join("closed");
    std::fs::create_dir(&closed).expect("a folder");
    std::fs::set_permissions(&closed, std::fs::Permissions::from_mode(0o555)).expect("a mode");
    // Root may write to folders without write permission, so the test uses this folder only if writing to it fails.
    if std::fs::write(closed.join("probe"), "").is_err() {
        paths.push(closed.join("out"));
    }
    for path in paths {
        ground.out = path;
        let output = ground.run(&[]);
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(
            said(&output).contains("cannot make") && said(&output).contains("--out"),
            "{}",
            said(&output)
        );
    }
}
