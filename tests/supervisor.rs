//! The supervisor with workers that are a script: no OpenCL and no processes.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use raycl::Error;
use raycl::config::{self, Experiment};
use raycl::device::{DeviceInfo, DeviceKind, DeviceLimits, Hardware};
use raycl::device_lock::Locks;
use raycl::experiment::{Death, Refusal, Reply, Request, Results, Run, Spawner, Wait, Worker};
use raycl::launch::FrameTimes;
use raycl::program::Sources;
use raycl::record::{Environment, Outcome, Record, Sample, read_lines};
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

const CONFIG: &str = r#"
question = "Does it come through?"
expectation = "Yes."
scenes = ["scenes/triangle.toml"]
image_sizes = [[40, 25], [8, 5]]
local_sizes = [1, 2, 4]
strategies = ["naive", "deferred"]
timing = { launches = 1, warmup = 0, min_samples = 4, max_samples = 4, time_limit_ms = 1000 }
"#;
/// Two image sizes, three local sizes, two strategies.
const POINTS: usize = 12;
const GROUPS: usize = 2;
static CASTS: AtomicUsize = AtomicUsize::new(0);

fn experiment(text: &str) -> Experiment {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("test.toml");
    config::parse(&path, text.to_owned(), &[]).expect("a config")
}

fn device() -> DeviceInfo {
    DeviceInfo {
        platform: "Mock".into(),
        platform_version: "OpenCL 1.2".into(),
        name: "mock".into(),
        vendor: "nobody".into(),
        version: "OpenCL 1.2".into(),
        driver: "1".into(),
        kind: DeviceKind::Cpu,
        extensions: Vec::new(),
        limits: DeviceLimits {
            local_bytes: 1 << 15,
            constant_bytes: 1 << 16,
            global_bytes: 1 << 30,
            allocation_bytes: 1 << 28,
            work_group_size: 1024,
            work_item_sizes: [1024; 3],
            compute_units: 1,
            native_width: 1,
            lane_operations: Default::default(),
            is_cpu: true,
        },
        hardware: Hardware::default(),
        settings: Vec::new(),
        cores: None,
        threads: None,
        twins_before: 0,
        label: "mock".into(),
        unusable: None,
    }
}

/// What a mock worker is about to do, as its script sees it.
struct Scene<'a> {
    request: &'a Request,
    /// Requests so far, of all workers.
    requests: usize,
}

/// What the script makes of a request.
enum Act {
    Answer,
    Die,
    Hang,
}

type Script = Rc<RefCell<dyn FnMut(&Scene<'_>) -> Act>>;

/// Counts what was asked of all workers.
#[derive(Default)]
struct Counts {
    workers: usize,
    requests: usize,
    checks: HashMap<usize, usize>,
    casts: HashMap<usize, usize>,
}

struct Mock {
    script: Script,
    counts: Rc<RefCell<Counts>>,
}

struct MockWorker {
    script: Script,
    counts: Rc<RefCell<Counts>>,
    next: Wait,
}

impl Mock {
    fn new(script: impl FnMut(&Scene<'_>) -> Act + 'static) -> Self {
        Self { script: Rc::new(RefCell::new(script)), counts: Rc::default() }
    }
}

impl Spawner for Mock {
    fn spawn(&mut self, _device: usize) -> raycl::Result<Box<dyn Worker>> {
        self.counts.borrow_mut().workers += 1;
        let (script, counts) = (Rc::clone(&self.script), Rc::clone(&self.counts));
        Ok(Box::new(MockWorker { script, counts, next: Wait::Reply(Reply::Started) }))
    }
}

impl Worker for MockWorker {
    fn send(&mut self, request: &Request) {
        let mut counts = self.counts.borrow_mut();
        counts.requests += 1;
        let answer = match request {
            Request::Check { point, key, .. } => {
                *counts.checks.entry(*point).or_default() += 1;
                let record = Record { key: key.clone(), build_ms: Some(1.0), ..Record::default() };
                Reply::Checked { record: Box::new(record), ready: true }
            }
            Request::Cast { point } => {
                *counts.casts.entry(*point).or_default() += 1;
                // Some number; how many samples are taken is the config's to say.
                let ms = CASTS.fetch_add(1, Ordering::Relaxed) as f64 % 7.0 + 1.0;
                Reply::Sample(FrameTimes::whole(ms, ms))
            }
        };
        let scene = Scene { request, requests: counts.requests };
        self.next = match (self.script.borrow_mut())(&scene) {
            Act::Answer => Wait::Reply(answer),
            Act::Die => Wait::Dead(Death { cause: "was killed by SIGSEGV".into(), last_words: "oh".into() }),
            Act::Hang => Wait::Silence,
        };
    }

    fn wait(&mut self, limit: Duration) -> Wait {
        if self.next == Wait::Silence {
            std::thread::sleep(limit);
        }
        self.next.clone()
    }
}

/// Runs the experiment into a folder.
fn execute(
    text: &str,
    folder: &Path,
    spawner: &mut impl Spawner,
    interrupted: &AtomicBool,
) -> raycl::Result<Vec<Record>> {
    let mut results = Results::resume(folder, &Environment::default())?;
    with_run(text, folder, |run| run.execute(&mut results, &mut (), spawner, interrupted))
}

fn with_run<T>(text: &str, folder: &Path, then: impl FnOnce(&Run<'_>) -> T) -> T {
    let (experiment, device) = (experiment(text), device());
    let locks = Locks::in_folder(&folder.join("locks"), true);
    then(&Run {
        experiment: &experiment,
        overrides: &[],
        devices: &[&device],
        sources: &Sources::Embedded,
        other_sources: None,
        limit: Duration::from_millis(30),
        retry_failed: false,
        locks: &locks,
        spread: false,
    })
}

/// A folder in memory, where there is such a thing: these tests write much and often.
fn folder() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.expect("a folder")
}

fn once(text: &str, script: impl FnMut(&Scene<'_>) -> Act + 'static) -> (Vec<Record>, Rc<RefCell<Counts>>) {
    let folder = folder();
    let mut mock = Mock::new(script);
    let records = execute(text, folder.path(), &mut mock, &AtomicBool::new(false)).expect("it runs");
    nothing_twice(folder.path());
    (records, mock.counts)
}

fn count(records: &[Record], outcome: Outcome) -> usize {
    records.iter().filter(|record| record.outcome == outcome).count()
}

fn point_of(request: &Request) -> usize {
    match request {
        Request::Check { point, .. } | Request::Cast { point } => *point,
    }
}

/// No point has two records, and none two samples of one round of a launch.
fn nothing_twice(folder: &Path) {
    let distinct = |mut names: Vec<String>| {
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count, "measured twice");
    };
    let records = read_lines::<Record>(&folder.join("records.jsonl")).expect("records").lines;
    let samples = read_lines::<Sample>(&folder.join("samples.jsonl")).expect("samples").lines;
    distinct(records.into_iter().map(|record| record.key).collect());
    distinct(
        samples
            .into_iter()
            .map(|sample| format!("{} {} {}", sample.key, sample.launch, sample.round))
            .collect(),
    );
}

#[test]
fn without_faults_a_fresh_worker_measures_each_group() {
    let (records, counts) = once(CONFIG, |_| Act::Answer);
    assert_eq!(count(&records, Outcome::Measured), POINTS);
    assert!(records.iter().all(|record| record.samples_ms.len() == 4));
    assert_eq!((counts.borrow().workers, counts.borrow().checks.len()), (GROUPS, POINTS));
}

#[test]
fn a_point_that_kills_its_worker_costs_itself_and_nothing_else() {
    for casting in [false, true] {
        let dies = move |scene: &Scene<'_>| {
            let here = matches!(scene.request, Request::Cast { .. }) == casting;
            if here && point_of(scene.request) == 3 { Act::Die } else { Act::Answer }
        };
        let (records, counts) = once(CONFIG, dies);
        assert_eq!(count(&records, Outcome::Measured), POINTS - 1);
        let lost = records.iter().find(|record| record.outcome == Outcome::Crashed).expect("a crash");
        let reason = lost.reason.as_deref().unwrap_or_default();
        assert!(reason.contains("SIGSEGV") && reason.contains("twice") && reason.contains("oh"), "{reason}");
        assert_eq!(counts.borrow().workers, GROUPS + 2, "two deaths, two fresh workers");
        assert!(records.iter().filter(|r| r.outcome == Outcome::Measured).all(|r| r.samples_ms.len() == 4));
    }
}

#[test]
fn a_worker_killed_once_costs_nothing() {
    let (records, _) = once(CONFIG, |scene| if scene.requests == 17 { Act::Die } else { Act::Answer });
    assert_eq!(count(&records, Outcome::Measured), POINTS);
}

#[test]
fn a_hang_is_ended_and_not_tried_again() {
    let hangs = |scene: &Scene<'_>| if point_of(scene.request) == 2 { Act::Hang } else { Act::Answer };
    let (records, counts) = once(CONFIG, hangs);
    assert_eq!((count(&records, Outcome::Measured), count(&records, Outcome::TimedOut)), (POINTS - 1, 1));
    assert_eq!((counts.borrow().workers, counts.borrow().checks[&2]), (GROUPS + 1, 1));
}

#[test]
fn crashes_that_repeat_stop_being_retried() {
    let (records, counts) = once(CONFIG, |_| Act::Die);
    assert_eq!(count(&records, Outcome::Crashed), POINTS);
    assert_eq!(counts.borrow().workers, 3 * 2 + (POINTS - 3), "three points twice, the others once");
}

#[test]
fn a_refused_frame_costs_its_point_only() {
    struct Refusing(Mock);
    struct RefusingWorker(Box<dyn Worker>, bool);
    impl Spawner for Refusing {
        fn spawn(&mut self, device: usize) -> raycl::Result<Box<dyn Worker>> {
            Ok(Box::new(RefusingWorker(self.0.spawn(device)?, false)))
        }
    }
    impl Worker for RefusingWorker {
        fn send(&mut self, request: &Request) {
            self.1 = matches!(request, Request::Cast { point: 1 });
            self.0.send(request);
        }
        fn wait(&mut self, limit: Duration) -> Wait {
            match self.0.wait(limit) {
                Wait::Reply(_) if self.1 => {
                    Wait::Reply(Reply::Refused(Refusal::new(Outcome::LaunchFailed, "CL_OUT_OF_RESOURCES")))
                }
                wait => wait,
            }
        }
    }
    let folder = folder();
    let mut refusing = Refusing(Mock::new(|_| Act::Answer));
    let records = execute(CONFIG, folder.path(), &mut refusing, &AtomicBool::new(false)).expect("it runs");
    assert_eq!((count(&records, Outcome::LaunchFailed), count(&records, Outcome::Measured)), (1, POINTS - 1));
}

#[test]
fn an_interrupted_run_goes_on_where_it_stopped() {
    let folder = folder();
    let interrupted: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
    let mut sessions = 0;
    let records = loop {
        sessions += 1;
        interrupted.store(false, Ordering::Relaxed);
        // Every session gets a little further. Checks are made anew, as is a launch that did not come to its end.
        let mut mock = Mock::new(move |scene| {
            interrupted.store(scene.requests >= 9 * sessions, Ordering::Relaxed);
            Act::Answer
        });
        match execute(CONFIG, folder.path(), &mut mock, interrupted) {
            Ok(records) => break records,
            Err(error @ Error::Interrupted { .. }) => assert_eq!(error.exit_code(), 130),
            Err(error) => panic!("{error}"),
        }
        nothing_twice(folder.path());
    };
    assert!((5..20).contains(&sessions), "{sessions}");
    assert_eq!(count(&records, Outcome::Measured), POINTS);
    assert!(records.iter().all(|record| record.samples_ms.len() == 4));
    nothing_twice(folder.path());
}

#[test]
fn workers_that_die_at_random_moments_cost_nothing() {
    for seed in 0..50 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut struck = HashMap::new();
        let (records, _) = once(CONFIG, move |scene| {
            // A point may lose one worker; the second loss is its own.
            let strikes: &mut usize = struck.entry(point_of(scene.request)).or_default();
            if *strikes == 0 && rng.random_bool(0.1) {
                *strikes += 1;
                return Act::Die;
            }
            Act::Answer
        });
        assert_eq!(count(&records, Outcome::Measured), POINTS, "seed {seed}");
    }
}

const SMALL: &str = r#"
question = "?"
expectation = "!"
scenes = ["scenes/triangle.toml"]
image_sizes = [[8, 5]]
local_sizes = [1]
strategies = ["naive", "deferred"]
timing = { launches = 1, warmup = 0, min_samples = 2, max_samples = 2, time_limit_ms = 1000 }
"#;

/// Resumes with a file cut at every byte: nothing is lost that was whole, and only what is missing is asked for.
fn torn_at_every_byte(name: &str) {
    let (whole, torn) = (folder(), folder());
    let off = AtomicBool::new(false);
    execute(SMALL, whole.path(), &mut Mock::new(|_| Act::Answer), &off).expect("it runs");
    let read = |name: &str| std::fs::read(whole.path().join(name)).expect("a journal");
    let journals = [("records.jsonl", read("records.jsonl")), ("samples.jsonl", read("samples.jsonl"))];
    let length = read(name).len();
    for cut in 0..length {
        for (file, bytes) in &journals {
            // Samples are written before the record they lead to; losing them alone is the other test.
            let end = if *file == name { cut } else { bytes.len() };
            std::fs::write(torn.path().join(file), &bytes[..end]).expect("a torn journal");
        }
        let lines = read(name)[..cut].iter().filter(|&&byte| byte == b'\n').count();
        let mut mock = Mock::new(|_| Act::Answer);
        let records = execute(SMALL, torn.path(), &mut mock, &off).expect("it resumes");
        assert_eq!(count(&records, Outcome::Measured), 2, "cut at {cut}");
        let counts = mock.counts.borrow();
        // A point without its record is checked again, but its samples are not taken again; one with its record
        // is left alone, whatever became of its samples.
        let checks = if name == "records.jsonl" { 2 - lines } else { 0 };
        assert_eq!((counts.checks.len(), counts.casts.len()), (checks, 0), "cut at {cut}");
        nothing_twice(torn.path());
        if cut % 64 == 0 {
            // A resumed folder holds an environment for every session.
            for entry in std::fs::read_dir(torn.path()).expect("a folder").flatten() {
                if entry.file_name().to_string_lossy().starts_with("environment") {
                    let _ = std::fs::remove_file(entry.path());
                }
            }
        }
    }
}

#[test]
fn records_torn_at_every_byte() {
    torn_at_every_byte("records.jsonl");
}

#[test]
fn samples_torn_at_every_byte() {
    torn_at_every_byte("samples.jsonl");
}

#[test]
fn samples_torn_before_any_record_are_completed() {
    let whole = folder();
    let off = AtomicBool::new(false);
    execute(SMALL, whole.path(), &mut Mock::new(|_| Act::Answer), &off).expect("it runs");
    let samples = std::fs::read(whole.path().join("samples.jsonl")).expect("samples");
    for cut in (0..samples.len()).step_by(7) {
        let torn = folder();
        std::fs::write(torn.path().join("samples.jsonl"), &samples[..cut]).expect("a torn journal");
        let kept = samples[..cut].iter().filter(|&&byte| byte == b'\n').count();
        let mut mock = Mock::new(|_| Act::Answer);
        let records = execute(SMALL, torn.path(), &mut mock, &off).expect("it resumes");
        assert_eq!(count(&records, Outcome::Measured), 2);
        // Half a launch is repeated whole, and what was measured of it stays.
        assert_eq!(mock.counts.borrow().casts.values().sum::<usize>(), 4, "cut at {cut}");
        let lines = read_lines::<Sample>(&torn.path().join("samples.jsonl")).expect("samples").lines;
        assert_eq!(lines.len(), kept + 4);
        nothing_twice(torn.path());
    }
}

#[test]
fn changed_timing_is_measured_again_and_unchanged_is_not() {
    let folder = folder();
    let off = AtomicBool::new(false);
    let checks = |text: &str| {
        let mut mock = Mock::new(|_| Act::Answer);
        let records = execute(text, folder.path(), &mut mock, &off).expect("it runs");
        let checks = mock.counts.borrow().checks.len();
        (records.len(), checks)
    };
    assert_eq!(checks(CONFIG), (POINTS, POINTS));
    assert_eq!(checks(CONFIG), (POINTS, 0));
    let longer = CONFIG.replace("local_sizes = [1, 2, 4]", "local_sizes = [1, 2, 4, 8]");
    assert_eq!(checks(&longer), (POINTS + 4, 4), "only what is new");
    let other = CONFIG.replace("max_samples = 4", "max_samples = 5");
    assert_eq!(checks(&other), (POINTS, POINTS));
    assert_eq!(checks(CONFIG), (POINTS, 0), "the first results are still there");
}

const LAUNCHES: &str = r#"
question = "?"
expectation = "!"
scenes = ["scenes/triangle.toml"]
image_sizes = [[8, 5], [16, 10]]
local_sizes = [1]
strategies = ["naive", "deferred"]
baselines = ["serial"]
timing = { launches = 3, warmup = 0, min_samples = 15, max_samples = 15 }
"#;

#[test]
fn each_launch_is_a_fresh_worker_and_groups_take_turns() {
    let folder = folder();
    let mut mock = Mock::new(|_| Act::Answer);
    let records = execute(LAUNCHES, folder.path(), &mut mock, &AtomicBool::new(false)).expect("it runs");
    assert_eq!(mock.counts.borrow().workers, 3 * GROUPS);
    assert!(mock.counts.borrow().checks.values().all(|checks| *checks == 3), "each launch checks its points");
    for record in &records {
        assert_eq!((record.samples_ms.len(), record.samples_at_ms.len()), (15, 15));
        let mut launches = record.sample_launches.clone();
        launches.dedup();
        assert_eq!(launches.len(), 3, "{launches:?}");
        assert!(launches.windows(2).all(|pair| pair[0] < pair[1]) && launches != [0, 1, 2], "{launches:?}");
        assert!(record.interval_ms.is_some());
    }
    // The baseline is measured in the rounds of its kernels.
    let samples = read_lines::<Sample>(&folder.path().join("samples.jsonl")).expect("samples").lines;
    for round in samples.chunks(3) {
        assert!(round.iter().all(|one| (one.launch, one.round) == (round[0].launch, round[0].round)));
        let keys: std::collections::HashSet<_> = round.iter().map(|sample| &sample.key).collect();
        assert_eq!(keys.len(), 3);
    }
}

#[test]
fn a_resumed_run_takes_whole_launches_over_and_repeats_half_ones() {
    let folder = folder();
    let interrupted: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
    // Both groups have had a launch (36 requests), and the first of them begins its second.
    let mut mock = Mock::new(|scene| {
        interrupted.store(scene.requests >= 46, Ordering::Relaxed);
        Act::Answer
    });
    execute(LAUNCHES, folder.path(), &mut mock, interrupted).expect_err("it is interrupted");
    let before = read_lines::<Sample>(&folder.path().join("samples.jsonl")).expect("samples").lines;
    let half = before.last().expect("samples").launch;
    let mut mock = Mock::new(|_| Act::Answer);
    let records = execute(LAUNCHES, folder.path(), &mut mock, &AtomicBool::new(false)).expect("it resumes");
    assert_eq!(mock.counts.borrow().workers, 2 * GROUPS, "one launch of each was whole");
    assert_eq!(count(&records, Outcome::Measured), 2 * 3);
    for record in &records {
        assert!(!record.sample_launches.contains(&half) && record.samples_ms.len() == 15);
    }
    let after = read_lines::<Sample>(&folder.path().join("samples.jsonl")).expect("samples").lines;
    assert!(after.starts_with(&before), "nothing measured is lost");
    nothing_twice(folder.path());
}

#[test]
fn a_launch_that_loses_its_worker_is_repeated_whole() {
    let (records, counts) = once(LAUNCHES, |scene| if scene.requests == 10 { Act::Die } else { Act::Answer });
    assert_eq!(count(&records, Outcome::Measured), 2 * 3);
    assert_eq!(counts.borrow().workers, 3 * GROUPS + 1);
    assert!(
        records.iter().all(|record| record.samples_ms.len() == 15 && !record.sample_launches.contains(&0)
            || record.image_size == [16, 10])
    );
}

#[test]
fn how_long_a_run_takes_is_told_by_earlier_times() {
    let folder = folder();
    let expected = |earlier: &[Record], done: &[String]| {
        with_run(LAUNCHES, folder.path(), |run| run.expected(earlier, done)).expect("it is foreseen")
    };
    let unknown = expected(&[], &[]).to_string();
    assert!(unknown.starts_with("6 points in 3 launches: at least 15 frames of each"), "{unknown}");
    // The mock's records know neither times nor sizes.
    let timed = |(place, record): (usize, &Record)| Record {
        host_median_ms: Some(1000.0),
        image_size: if place < 3 { [8, 5] } else { [16, 10] },
        local_size: (!record.is_baseline()).then_some([1, 1]),
        ..record.clone()
    };
    let records = execute(LAUNCHES, folder.path(), &mut Mock::new(|_| Act::Answer), &AtomicBool::new(false));
    let records: Vec<Record> = records.expect("it runs").iter().enumerate().map(timed).collect();
    let known = expected(&records, &[]);
    // A second for each of 15 samples and of 2 checks of each point, and half a second for each worker; the mock's first checks
    // take no time.
    assert_eq!(known.points, [6, 6]);
    assert!((105..=110).contains(&known.time.as_secs()), "{:?}", known.time);
    // Two strategies at one size tell of the other, too, which has four times the pixels.
    let some = expected(&records[..2], &[]);
    assert_eq!(some.points, [6, 4]);
    assert!(some.to_string().contains("for 4 of them, by earlier times"), "{some}");
    let keys: Vec<String> = records.iter().map(|record| record.key.clone()).collect();
    assert_eq!(expected(&records, &keys[1..]).points, [1, 1]);
}
