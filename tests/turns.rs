//! Two runs that take turns on one device. The workers of both runs are replaced by objects that only record
//! the order of casts, so the test needs no worker process, no real device and no clock.

use raycl::config;
use raycl::device_lock::Locks;
use raycl::experiment::{Reply, Request, Results, Run, Spawner, Wait, Worker};
use raycl::launch::FrameTimes;
use raycl::program::Sources;
use raycl::record::{Environment, Record};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Barrier, Mutex};
use std::time::Duration;

/// An experiment with three groups of points, one per image size. Each group has two points.
const CONFIG: &str = r#"
question = "Do they meet?"
expectation = "No."
scenes = ["scenes/triangle.toml"]
image_sizes = [[8, 5], [16, 10], [24, 15]]
baselines = ["serial", "parallel"]
timing = { launches = 1, warmup = 0, min_samples = 20, max_samples = 20, time_limit_ms = 1e8 }
"#;
const GROUPS: usize = 3;
const CASTS_OF_A_GROUP: usize = 2 * 20;

/// A list of all casts of the two runs, in order. Each element is the number of the run that made the cast.
type Log = Arc<Mutex<Vec<usize>>>;

struct Noting {
    run: usize,
    log: Log,
    reply: Reply,
}

impl Spawner for Noting {
    fn spawn(&mut self, _job: usize) -> raycl::Result<Box<dyn Worker>> {
        Ok(Box::new(Self { run: self.run, log: Arc::clone(&self.log), reply: Reply::Started }))
    }
}

impl Worker for Noting {
    fn send(&mut self, request: &Request) {
        self.reply = match request {
            Request::Build { .. } => Reply::Built(None),
            Request::Check { key, .. } => {
                let record = Record { key: key.clone(), ..Record::default() };
                Reply::Checked { record: Box::new(record), ready: true }
            }
            Request::Cast { .. } => {
                self.log.lock().expect("no test panicked").push(self.run);
                // Yields the processor to the other one of the two runs. If nothing prevents the other run from casting
                // now, the other run may cast.
                std::thread::yield_now();
                Reply::Sample(FrameTimes::whole(1.0, 1.0))
            }
            Request::Anchor => Reply::Sample(FrameTimes::whole(1.0, 1.0)),
        };
    }

    fn wait(&mut self, _limit: Duration) -> Wait {
        Wait::Reply(self.reply.clone())
    }
}

fn measure(run: usize, log: &Log, locks: &Locks) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("test.toml");
    let experiment = config::parse(&path, CONFIG.to_owned(), &[]).expect("a config");
    let folder = tempfile::tempdir().expect("a folder");
    let plan = Run {
        experiment: &experiment,
        overrides: &[],
        devices: &[],
        sources: &Sources::Embedded,
        other_sources: None,
        limit: Duration::from_secs(120),
        retry_failed: false,
        keeps_moved_samples: true,
        locks,
        spread: false,
        blocks: None,
        ahead: None,
        caches_programs: true,
    };
    let mut results = Results::create(folder.path(), &Environment::default()).expect("results");
    let mut spawner = Noting { run, log: Arc::clone(log), reply: Reply::Started };
    let records =
        plan.execute(&mut results, &mut (), &mut spawner, &AtomicBool::new(false)).expect("it runs");
    assert_eq!(records.len(), 2 * GROUPS);
}

/// Returns the number of consecutive casts by the same run, for each turn.
fn turns(log: &Log) -> Vec<usize> {
    let log = log.lock().expect("no test panicked");
    assert_eq!(log.len(), 2 * GROUPS * CASTS_OF_A_GROUP);
    log.chunk_by(|one, other| one == other).map(<[usize]>::len).collect()
}

fn both(locks: &[Locks; 2]) -> Log {
    let (log, together) = (Log::default(), Barrier::new(2));
    std::thread::scope(|scope| {
        for (run, locks) in locks.iter().enumerate() {
            let (log, together) = (&log, &together);
            scope.spawn(move || {
                together.wait();
                measure(run, log, locks);
            });
        }
    });
    log
}

#[test]
fn a_group_is_timed_whole_before_another_run_times_on_the_device() {
    let folder = tempfile::tempdir().expect("a folder");
    let locks = [(); 2].map(|()| Locks::in_folder(folder.path(), true));
    for turn in turns(&both(&locks)) {
        assert_eq!(turn % CASTS_OF_A_GROUP, 0, "a run was timed inside another's group");
    }
}
