//! A run whose workers are simulated, and follow a script: the run uses no OpenCL and starts no processes.

use raycl::config::{self, Experiment};
use raycl::device::{DeviceInfo, DeviceKind, DeviceLimits, Hardware};
use raycl::device_lock::Locks;
use raycl::experiment::{Death, Reply, Request, Results, Run, Spawner, Wait, Worker};
use raycl::launch::FrameTimes;
use raycl::program::Sources;
use raycl::record::{Environment, Outcome, Record, Sample, read_lines};
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

pub const CONFIG: &str = r#"
question = "Does it come through?"
expectation = "Yes."
scenes = ["scenes/triangle.toml"]
image_sizes = [[40, 25], [8, 5]]
local_sizes = [1, 2, 4]
strategies = ["naive", "deferred"]
timing = { launches = 1, warmup = 0, min_samples = 4, max_samples = 4, time_limit_ms = 1000 }
"#;
/// Number of points that the experiment measures. The experiment has two image sizes, three local sizes and
/// two strategies.
pub const POINTS: usize = 12;
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
            local_is_emulated: false,
            constant_is_emulated: false,
            global_bytes: 1 << 30,
            allocation_bytes: 1 << 28,
            work_group_size: 1024,
            work_item_sizes: [1024; 3],
            compute_units: 1,
            native_width: 1,
            shares_memory: true,
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

/// What a worker's script knows when it decides how the worker responds to a request.
pub struct Scene<'a> {
    pub request: &'a Request,
    /// Number of requests so far to all workers.
    pub requests: usize,
}

/// How a worker responds to a request, as its script decides.
pub enum Act {
    Answer,
    Die,
    Hang,
}

type Script = Rc<RefCell<dyn FnMut(&Scene<'_>) -> Act>>;

/// Counts the workers, and the requests to all of them.
#[derive(Default)]
pub struct Counts {
    pub workers: usize,
    pub requests: usize,
    pub checks: HashMap<usize, usize>,
    pub casts: HashMap<usize, usize>,
}

/// Starts simulated workers, which follow a script.
pub struct Mock {
    script: Script,
    pub counts: Rc<RefCell<Counts>>,
}

struct MockWorker {
    script: Script,
    counts: Rc<RefCell<Counts>>,
    next: Wait,
}

impl Mock {
    pub fn new(script: impl FnMut(&Scene<'_>) -> Act + 'static) -> Self {
        Self { script: Rc::new(RefCell::new(script)), counts: Rc::default() }
    }
}

impl Spawner for Mock {
    fn spawn(&mut self, _job: usize) -> raycl::Result<Box<dyn Worker>> {
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
                // The times are arbitrary; the number of samples depends only on the config.
                let ms = CASTS.fetch_add(1, Ordering::Relaxed) as f64 % 7.0 + 1.0;
                Reply::Sample(FrameTimes::whole(ms, ms))
            }
            Request::Build { .. } => Reply::Built(None),
            Request::Anchor => Reply::Sample(FrameTimes::whole(1.0, 1.0)),
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

/// Runs the experiment, with its results in a folder.
pub fn execute(
    text: &str,
    folder: &Path,
    spawner: &mut impl Spawner,
    interrupted: &AtomicBool,
) -> raycl::Result<Vec<Record>> {
    with_run(text, folder, |run| execute_run(run, folder, spawner, interrupted))
}

/// Runs an experiment with simulated workers, like `execute`. The experiment was already read, and is a part of
/// `run`.
pub fn execute_run(
    run: &Run<'_>,
    folder: &Path,
    spawner: &mut impl Spawner,
    interrupted: &AtomicBool,
) -> raycl::Result<Vec<Record>> {
    let mut results = Results::resume(folder, &Environment::default())?;
    // Normally, a run leaves out samples during which the host moved a virtual machine's processors to other
    // cores. The runs of raycl's tests keep such samples, so that the number of samples does not depend on
    // the machine.
    Run { keeps_moved_samples: true, ..*run }.execute(&mut results, &mut (), spawner, interrupted)
}

pub fn with_run<T>(text: &str, folder: &Path, then: impl FnOnce(&Run<'_>) -> T) -> T {
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
        keeps_moved_samples: false,
        locks: &locks,
        spread: false,
        blocks: None,
        ahead: None,
        caches_programs: true,
    })
}

/// Returns a folder in memory, if the system has one, since these tests write many files.
pub fn folder() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.expect("a folder")
}

pub fn once(
    text: &str,
    script: impl FnMut(&Scene<'_>) -> Act + 'static,
) -> (Vec<Record>, Rc<RefCell<Counts>>) {
    let folder = folder();
    let mut mock = Mock::new(script);
    let records = execute(text, folder.path(), &mut mock, &AtomicBool::new(false)).expect("it runs");
    nothing_twice(folder.path());
    (records, mock.counts)
}

pub fn count(records: &[Record], outcome: Outcome) -> usize {
    records.iter().filter(|record| record.outcome == outcome).count()
}

pub fn point_of(request: &Request) -> usize {
    match request {
        Request::Build { point } | Request::Check { point, .. } | Request::Cast { point } => *point,
        Request::Anchor => usize::MAX,
    }
}

/// Checks that no point has two records, and that no point has two samples of the same round of a launch.
pub fn nothing_twice(folder: &Path) {
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
