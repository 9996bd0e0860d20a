//! Tests of whole runs whose workers answer every request at once: of which events the observer is informed,
//! what is stored, and what a later session measures.

use super::*;
use crate::config;
use crate::device::DeviceInfo;
use crate::experiment::ahead::{Ahead, Builder};
use crate::experiment::asleep;
use crate::experiment::fixtures;
use crate::experiment::protocol::{Built, Reply, Request};
use crate::experiment::waiting::{Wait, Worker};
use crate::experiment::{Block, distinct_scenes};
use crate::launch::FrameTimes;
use crate::record::{AnchorSample, Environment, Sample, read_lines};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const TIMING: &str = "timing = { launches = 2, warmup = 0, min_samples = 5, max_samples = 5 }";
/// A number of requests that no test reaches.
const NEVER: usize = usize::MAX;

/// Starts workers that answer at once. Stores the number of each worker's job (the task of the workers of one
/// device).
#[derive(Clone)]
struct Answering {
    jobs: Arc<Mutex<Vec<usize>>>,
    requests: Arc<AtomicUsize>,
    /// When the workers have received `interrupts_at` requests, the user interrupts the run.
    interrupts_at: usize,
    interrupted: Arc<AtomicBool>,
    /// The outcome that workers report for every check of a point; `reason` is the reason that the workers
    /// report.
    outcome: Outcome,
    reason: Option<String>,
    /// True if a point passes its check in the first launch, whatever the outcome of later checks is.
    passes_once: bool,
    /// True if workers refuse to cast any frame of a point that has passed its check.
    refuses: bool,
    /// The hash in each request to check a point; `None` if the request has no hash. If a worker's picture has the hash
    /// in the request, the picture need not be compared with the reference again.
    verified: Arc<Mutex<Vec<Option<String>>>>,
    /// The time limit of every wait for a worker.
    limits: Arc<Mutex<Vec<Duration>>>,
    /// The number of workers that had been started at the first request.
    at_first: Arc<AtomicUsize>,
    /// A counter, if the test needs one. At its first request, each worker adds 1 to the counter, and then
    /// waits until the counter is 2.
    gathering: Option<Arc<AtomicUsize>>,
}

impl Default for Answering {
    fn default() -> Self {
        Self {
            jobs: Arc::default(),
            requests: Arc::default(),
            interrupts_at: NEVER,
            interrupted: Arc::default(),
            outcome: Outcome::Measured,
            reason: None,
            passes_once: false,
            refuses: false,
            verified: Arc::default(),
            limits: Arc::default(),
            at_first: Arc::default(),
            gathering: None,
        }
    }
}

struct Answer {
    of: Answering,
    next: Reply,
}

impl Spawner for Answering {
    fn spawn(&mut self, job: usize) -> Result<Box<dyn Worker>> {
        self.jobs.lock().unwrap().push(job);
        Ok(Box::new(Answer { of: self.clone(), next: Reply::Started }))
    }
}

impl Worker for Answer {
    fn send(&mut self, request: &Request) {
        let requests = self.of.requests.fetch_add(1, Ordering::Relaxed) + 1;
        if requests == self.of.interrupts_at {
            self.of.interrupted.store(true, Ordering::Relaxed);
        }
        if requests == 1 {
            self.of.at_first.store(self.of.jobs.lock().unwrap().len(), Ordering::Relaxed);
        }
        if let Some(all) = self.of.gathering.take() {
            all.fetch_add(1, Ordering::Relaxed);
            let deadline = Instant::now() + Duration::from_secs(120);
            while all.load(Ordering::Relaxed) < 2 {
                assert!(Instant::now() < deadline, "the other device has no work");
                std::thread::yield_now();
            }
        }
        let outcome = self.of.outcome;
        self.next = match request {
            Request::Check { key, verified, .. } => {
                self.of.verified.lock().unwrap().push(verified.clone());
                let ready = outcome == Outcome::Measured || self.of.passes_once && verified.is_none();
                let image_hash = Some("a hash".to_owned());
                let build_ms = Some(if verified.is_none() { 1.0 } else { 2.0 });
                let reason = self.of.reason.clone().filter(|_| !ready);
                let key = key.clone();
                let record = Record { key, outcome, reason, image_hash, build_ms, ..Record::default() };
                Reply::Checked { record: Box::new(record), ready }
            }
            Request::Build { .. } => {
                Reply::Built(Some(Built { build_ms: 42.0, from_cache: true, key: None, lacks_log: false }))
            }
            Request::Cast { .. } if self.of.refuses => {
                Reply::Refused(PointFailure::new(Outcome::LaunchFailed, "no"))
            }
            Request::Cast { .. } | Request::Anchor => Reply::Sample(FrameTimes::whole(1.0, 1.0)),
        };
    }

    fn wait(&mut self, limit: Duration) -> Wait {
        self.of.limits.lock().unwrap().push(limit);
        Wait::Reply(self.next.clone())
    }
}

/// The events that the observer of a run has heard of, except waits and lines to print.
#[derive(Debug, Default, PartialEq)]
struct Heard {
    begun: Vec<[usize; 2]>,
    resumed: Vec<[usize; 2]>,
    steps: usize,
    finished: usize,
    ended: usize,
    works: Vec<String>,
}

impl Observer for Heard {
    fn begins(&mut self, points: usize, steps: usize) {
        self.begun.push([points, steps]);
    }
    fn resumes(&mut self, points: usize, steps: usize) {
        self.resumed.push([points, steps]);
    }
    fn advances(&mut self, steps: usize) {
        self.steps += steps;
    }
    fn works_on(&mut self, what: &str) {
        self.works.push(what.to_owned());
    }
    fn finished(&mut self, _record: &Record) {
        self.finished += 1;
    }
    fn ends(&mut self) {
        self.ended += 1;
    }
}

/// Runs an experiment in a folder, after `change` has changed the run.
fn session(
    folder: &Path,
    lines: &str,
    workers: &Answering,
    change: impl for<'a> Fn(Run<'a>) -> Run<'a>,
) -> (Result<Vec<Record>>, Heard) {
    let (experiment, device, locks) =
        (fixtures::experiment(lines), asleep::device(1.0), fixtures::own_locks());
    let devices = [&device, &device];
    let run = change(fixtures::run(&experiment, &devices[..1], &locks));
    let run = Run { devices: if run.spread { &devices } else { &devices[..1] }, ..run };
    let mut results = Results::resume(folder, &Environment::default()).unwrap();
    let mut heard = Heard::default();
    let records = match run.spread {
        false => run.execute(&mut results, &mut heard, &mut workers.clone(), &workers.interrupted),
        true => {
            let spawners = (0..2).map(|_| Box::new(workers.clone()) as Box<dyn Spawner + Send>).collect();
            run.execute_spread(&mut results, &mut heard, spawners, &workers.interrupted)
        }
    };
    (records, heard)
}

fn plain(run: Run<'_>) -> Run<'_> {
    run
}

#[test]
fn the_observer_hears_of_each_point_and_step_and_of_those_that_were_done_before() {
    let folder = tempfile::tempdir().unwrap();
    let first = format!("local_sizes = [1]\n{TIMING}");
    let (records, heard) = session(folder.path(), &first, &Answering::default(), plain);
    assert_eq!(records.unwrap().len(), 1);
    assert_eq!((heard.begun, heard.resumed), (vec![[1, 2]], vec![[0, 0]]));
    assert_eq!((heard.steps, heard.finished, heard.ended), (2, 1, 1));
    assert!(heard.works.iter().any(|work| work == "checking triangle 8x5 naive 1x1"), "{:?}", heard.works);
    let is_timing = |launch: u32| {
        heard.works.iter().any(|work| *work == format!("timing triangle 8x5 naive 1x1, launch {launch} of 2"))
    };
    assert!(is_timing(1) && is_timing(2), "{:?}", heard.works);
    let both = format!("local_sizes = [1, 2, 4]\n{TIMING}");
    let (records, heard) = session(folder.path(), &both, &Answering::default(), plain);
    assert_eq!(records.unwrap().len(), 3);
    assert_eq!((heard.begun, heard.resumed), (vec![[3, 6]], vec![[1, 2]]));
    assert_eq!((heard.steps, heard.finished, heard.ended), (4, 2, 1));
    // The results do not contain a point that is no longer in the plan.
    let (records, heard) = session(folder.path(), &first, &Answering::default(), plain);
    assert_eq!((records.unwrap().len(), heard.resumed, heard.finished), (1, vec![[1, 2]], 0));
    let summary = std::fs::read_to_string(folder.path().join("summary.md")).unwrap();
    assert!(summary.contains("# ?\n") && summary.contains("Expected: \\!\n"), "{summary}");
}

#[test]
fn an_interruption_says_how_many_points_are_done_including_those_of_earlier_sessions() {
    let folder = tempfile::tempdir().unwrap();
    let lines = "local_sizes = [1]\ntiming = { launches = 1, warmup = 0, min_samples = 5, max_samples = 5 }";
    session(folder.path(), lines, &Answering::default(), plain).0.unwrap();
    let more = lines.replace("[1]", "[1, 2]");
    let workers = Answering { interrupts_at: 1, ..Answering::default() };
    let (records, heard) = session(folder.path(), &more, &workers, plain);
    let message = "interrupted: 1 of 2 points are done; finished launches of other points are kept";
    assert_eq!(records.unwrap_err().to_string(), message);
    assert_eq!(heard.ended, 1);
}

#[test]
fn failed_points_are_measured_again_only_if_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let lines = format!("local_sizes = [1]\n{TIMING}");
    let failing = Answering { outcome: Outcome::BuildFailed, ..Answering::default() };
    let outcome = |workers: &Answering, retry_failed: bool| {
        let (records, heard) = session(folder.path(), &lines, workers, |run| Run { retry_failed, ..run });
        assert!(heard.steps == 2 || heard.resumed == [[1, 2]], "{heard:?}");
        records.unwrap()[0].outcome
    };
    assert_eq!(outcome(&failing, false), Outcome::BuildFailed);
    let workers = Answering::default();
    assert_eq!(outcome(&workers, false), Outcome::BuildFailed);
    assert_eq!(workers.requests.load(Ordering::Relaxed), 0);
    assert_eq!(outcome(&workers, true), Outcome::Measured);
}

#[test]
fn a_point_that_lacked_memory_at_that_moment_is_infeasible_until_failed_points_are_measured_again() {
    let lines = format!("local_sizes = [1]\n{TIMING}");
    let host = "the host's memory (casting): 2 B > 1 B according to a test";
    for (reason, again) in [(host, Outcome::Measured), ("__local memory: 2 B > 1 B", Outcome::Infeasible)] {
        let folder = tempfile::tempdir().unwrap();
        let (outcome, reason) = (Outcome::Infeasible, Some(reason.to_owned()));
        let refusing = Answering { outcome, reason, ..Answering::default() };
        let outcome = |workers: &Answering, retry_failed: bool| {
            let (records, _) = session(folder.path(), &lines, workers, |run| Run { retry_failed, ..run });
            records.unwrap()[0].outcome
        };
        assert_eq!(outcome(&refusing, false), Outcome::Infeasible);
        assert_eq!(outcome(&Answering::default(), false), Outcome::Infeasible);
        assert_eq!(outcome(&Answering::default(), true), again);
    }
}

#[test]
fn a_point_that_exceeded_the_devices_global_memory_is_measured_in_a_later_session_in_which_it_fits() {
    let folder = tempfile::tempdir().unwrap();
    let lines = format!("local_sizes = [1]\n{TIMING}");
    let (outcome, reason) = (Outcome::Infeasible, Some("global memory: 2 B > 1 B".to_owned()));
    let refusing = Answering { outcome, reason, ..Answering::default() };
    for (workers, outcome) in [(refusing, Outcome::Infeasible), (Answering::default(), Outcome::Measured)] {
        let (records, heard) = session(folder.path(), &lines, &workers, plain);
        assert_eq!((records.unwrap()[0].outcome, heard.resumed), (outcome, vec![[0, 0]]));
    }
}

#[test]
fn a_record_of_another_device_counts_only_if_points_are_distributed_over_the_devices() {
    let experiment = fixtures::experiment("local_sizes = [1]");
    let (one, locks) = (asleep::device(1.0), fixtures::own_locks());
    let two = DeviceInfo { twins_before: 1, ..asleep::device(1.0) };
    let devices = [&one, &two];
    // Returns how many points this run need not measure again if the device `measured_on` measured the first
    // point in an earlier session.
    let done = |spread: bool, measured_on: Option<String>| {
        let run = Run { spread, ..fixtures::run(&experiment, &devices, &locks) };
        let plan = run.plan();
        let groups = run.pending_points(&plan, &run.pieces(&plan)).unwrap();
        let point = groups.iter().flatten().find(|pending| pending.job == 0).unwrap();
        let record = Record { outcome: Outcome::Measured, measured_on, ..point.record.clone() };
        let past = Past { records: vec![record], ..Past::default() };
        run.done(groups.iter().flatten(), &past).len()
    };
    assert_eq!([None, Some(one.slug()), Some(two.slug())].map(|slug| done(false, slug)), [1, 1, 0]);
    assert_eq!(done(true, Some(two.slug())), 1);
}

#[test]
fn a_point_that_lacks_memory_in_a_later_launch_fails_and_a_retry_measures_only_the_missing_launch() {
    let folder = tempfile::tempdir().unwrap();
    let lines = format!("local_sizes = [1]\n{TIMING}");
    let reason = Some("the host's memory (verifying): 2 B > 1 B according to a test".to_owned());
    let (outcome, passes_once) = (Outcome::Infeasible, true);
    let refusing = Answering { outcome, passes_once, reason: reason.clone(), ..Answering::default() };
    let (records, heard) = session(folder.path(), &lines, &refusing, plain);
    let record = records.unwrap().remove(0);
    assert_eq!((record.outcome, record.reason), (Outcome::LaunchFailed, reason));
    assert_eq!((heard.steps, heard.finished), (2, 1));
    let workers = Answering::default();
    let (records, _) = session(folder.path(), &lines, &workers, |run| Run { retry_failed: true, ..run });
    let record = records.unwrap().remove(0);
    assert_eq!((record.outcome, record.samples_ms.len()), (Outcome::Measured, 10));
    // The point is checked once and cast five times, and the anchor runs five times.
    assert_eq!(workers.requests.load(Ordering::Relaxed), 11);
}

#[test]
fn a_launch_of_an_earlier_session_counts_as_a_step_and_is_not_repeated() {
    let folder = tempfile::tempdir().unwrap();
    let lines = format!("local_sizes = [1]\n{TIMING}");
    // The first launch consists of eleven requests: the point is checked once and cast five times, and the
    // anchor runs once in each of the five rounds. The twelfth request, at which the user interrupts the run,
    // is the first request of the second launch.
    let first = Answering { interrupts_at: 12, ..Answering::default() };
    assert!(session(folder.path(), &lines, &first, plain).0.is_err());
    let second = Answering::default();
    let (records, heard) = session(folder.path(), &lines, &second, plain);
    let record = records.unwrap().remove(0);
    assert_eq!((heard.steps, heard.finished, second.requests.load(Ordering::Relaxed)), (2, 1, 11));
    assert_eq!((record.samples_ms.len(), record.check_ms.is_some()), (10, true));
}

#[test]
fn a_launch_that_was_interrupted_after_five_samples_is_repeated() {
    let folder = tempfile::tempdir().unwrap();
    let timing = "timing = { launches = 1, warmup = 0, min_samples = 20, max_samples = 20 }";
    let lines = format!("local_sizes = [1]\n{timing}");
    let first = Answering { interrupts_at: 10, ..Answering::default() };
    assert!(session(folder.path(), &lines, &first, plain).0.is_err());
    let samples: Vec<Sample> = read_lines(&folder.path().join("samples.jsonl")).unwrap().lines;
    assert!((6..20).contains(&samples.len()), "{} samples", samples.len());
    let record = session(folder.path(), &lines, &Answering::default(), plain).0.unwrap().remove(0);
    assert_eq!((record.sample_launches, record.stop_reason.as_deref()), (vec![1; 20], Some("precise")));
}

#[test]
fn a_record_whose_launches_all_ended_in_earlier_sessions_says_why_the_last_one_ended() {
    let folder = tempfile::tempdir().unwrap();
    let lines = format!("local_sizes = [1]\n{TIMING}");
    session(folder.path(), &lines, &Answering::default(), plain).0.unwrap();
    let reason = || {
        std::fs::write(folder.path().join("records.jsonl"), "").unwrap();
        let workers = Answering::default();
        let record = session(folder.path(), &lines, &workers, plain).0.unwrap().remove(0);
        assert_eq!((record.samples_ms.len(), workers.requests.load(Ordering::Relaxed)), (10, 1));
        record.stop_reason
    };
    assert_eq!(reason().as_deref(), Some("precise"));
    // Earlier versions of raycl did not write `launches.jsonl`.
    std::fs::remove_file(folder.path().join("launches.jsonl")).unwrap();
    assert_eq!(reason().as_deref(), Some("precise"));
}

#[test]
fn a_picture_is_compared_in_the_first_launch_only_and_a_refused_point_has_no_more_launches() {
    let folder = tempfile::tempdir().unwrap();
    let lines = format!("local_sizes = [1]\n{TIMING}");
    let workers = Answering::default();
    let records = session(folder.path(), &lines, &workers, plain).0.unwrap();
    assert_eq!(*workers.verified.lock().unwrap(), [None, Some("a hash".to_owned())]);
    assert_eq!(records[0].build_ms, Some(1.0), "a record is of the first launch's check");
    let folder = tempfile::tempdir().unwrap();
    let refusing = Answering { refuses: true, ..Answering::default() };
    let (records, heard) = session(folder.path(), &lines, &refusing, plain);
    assert_eq!(records.unwrap()[0].outcome, Outcome::LaunchFailed);
    assert_eq!((heard.steps, heard.finished, refusing.requests.load(Ordering::Relaxed)), (2, 1, 2));
}

#[test]
fn a_record_has_the_time_for_which_a_builder_built_its_program() {
    let folder = tempfile::tempdir().unwrap();
    let ahead: &'static Ahead = Box::leak(Box::default());
    let workers = Answering::default();
    let builder =
        Builder { usual: Box::new(workers.clone()), without_driver_cache: Box::new(workers.clone()) };
    let limit = Duration::from_secs(120);
    let work = || {
        let lines = format!("local_sizes = [1, 2]\n{TIMING}");
        session(folder.path(), &lines, &workers, |run| Run { ahead: Some(ahead), ..run })
    };
    let (records, heard) = ahead.beside(vec![builder], limit, &AtomicBool::new(false), work).unwrap();
    let records = records.unwrap();
    let built = heard.works.iter().filter(|work| work.starts_with("building ")).map(String::as_str);
    assert!(
        built.eq(["building triangle 8x5 naive 1x1", "building triangle 8x5 naive 2x2"]),
        "{:?}",
        heard.works
    );
    let built = |record: &Record| (record.build_ms, record.build_from_cache);
    assert_eq!([built(&records[0]), built(&records[1])], [(Some(42.0), Some(true)); 2]);
    assert_eq!(ahead.tally().from_cache, 2);
}

/// The device in this test is a GPU, and the point's preset is meant for CPUs.
#[test]
fn a_point_for_another_kind_of_device_is_passed_over_until_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let of = |more: &str| {
        let lines =
            format!("local_sizes = [1]\n{TIMING}\n[[strategy]]\npreset = 'tile'\nlocal_sizes = [1]\n{more}");
        let (records, heard) = session(folder.path(), &lines, &Answering::default(), plain);
        let outcomes: Vec<Outcome> = records.unwrap().iter().map(|record| record.outcome).collect();
        (outcomes, heard.steps, heard.finished)
    };
    assert_eq!(of(""), (vec![Outcome::Measured, Outcome::OtherKind], 4, 2));
    assert_eq!(of(""), (vec![Outcome::Measured, Outcome::OtherKind], 0, 0));
    assert_eq!(of("any_kind = true"), (vec![Outcome::Measured; 2], 2, 1));
}

#[test]
fn programs_are_built_while_points_are_timed_only_if_no_point_needs_the_cores() {
    let (gpu, locks) = (asleep::device(1.0), fixtures::own_locks());
    let cpu = crate::device::DeviceInfo { kind: DeviceKind::Cpu, ..gpu.clone() };
    let builds = |lines: &str, devices: &[&crate::device::DeviceInfo]| {
        fixtures::run(&fixtures::experiment(lines), devices, &locks).builds_while_timing()
    };
    let with_baseline = "local_sizes = [1]\nbaselines = ['serial']";
    assert!(builds("local_sizes = [1]", &[&gpu]));
    assert!(!builds(with_baseline, &[&gpu]) && !builds("local_sizes = [1]", &[&gpu, &cpu]));
}

/// Runs an experiment on the scenes `a.toml` and `b.toml` in a folder. Returns true if the summary says that
/// the contents of the two scenes are equal.
fn says_that_scenes_are_equal(folder: &Path) -> bool {
    let text = format!(
        "question = '?'\nexpectation = '!'\nscenes = ['a.toml', 'b.toml']\nimage_sizes = [[8, 5]]\n\
         strategies = ['naive']\nlocal_sizes = [1]\n{TIMING}"
    );
    let experiment = config::parse(&folder.join("test.toml"), text, &[]).unwrap();
    let experiment = distinct_scenes(experiment).unwrap();
    let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let out = folder.join("out");
    let mut results = Results::resume(&out, &Environment::default()).unwrap();
    let off = AtomicBool::new(false);
    run.execute(&mut results, &mut Heard::default(), &mut Answering::default(), &off).unwrap();
    let summary = std::fs::read_to_string(out.join("summary.md")).unwrap();
    summary.contains("scene b has the same content as a;")
}

#[test]
fn results_have_the_notes_of_the_last_session_on_equal_scenes() {
    for sides in [[1, 2, 1], [2, 1, 2]] {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, side: u32| {
            let vertices = format!("[[0, 0, -3], [{side}, 0, -3], [0, 1, -3]]");
            let scene = format!("[[object]]\nvertices = {vertices}\nfaces = [[0, 1, 2]]\n");
            std::fs::write(folder.path().join(name), scene).unwrap();
        };
        write("a.toml", 1);
        for side in sides {
            write("b.toml", side);
            assert_eq!(says_that_scenes_are_equal(folder.path()), side == 1, "{sides:?}");
        }
    }
}

#[test]
fn a_run_on_two_devices_stores_and_tells_what_a_run_on_one_does() {
    let folder = tempfile::tempdir().unwrap();
    let lines = format!("local_sizes = [1, 2]\nbaselines = ['serial']\n{TIMING}");
    let workers = Answering::default();
    let (records, heard) = session(folder.path(), &lines, &workers, |run| Run { spread: true, ..run });
    assert_eq!(records.unwrap().len(), 3);
    assert_eq!((heard.begun, heard.steps, heard.finished), (vec![[3, 6]], 6, 3));
    assert!(heard.works.iter().any(|work| work.starts_with("timing ")), "{:?}", heard.works);
    let anchors: Vec<AnchorSample> = read_lines(&folder.path().join("anchors.jsonl")).unwrap().lines;
    assert!(!anchors.is_empty() && anchors.iter().all(|anchor| anchor.ms == 1.0));
    // A later session in the same folder measures no point again, and sends no request to a worker.
    let before = workers.requests.load(Ordering::Relaxed);
    let (_, heard) = session(folder.path(), &lines, &workers, |run| Run { spread: true, ..run });
    assert_eq!((workers.requests.load(Ordering::Relaxed), heard.resumed), (before, vec![[3, 6]]));
}

/// A run on two devices measures the casters on the host first. In this test, no other points are left to
/// measure.
#[test]
fn an_interruption_of_a_caster_on_the_host_ends_a_run_on_two_devices() {
    let folder = tempfile::tempdir().unwrap();
    let kernels = format!("local_sizes = [1]\n{TIMING}");
    let spread = session(folder.path(), &kernels, &Answering::default(), |run| Run { spread: true, ..run });
    assert_eq!(spread.0.unwrap().len(), 1);
    let lines = format!("local_sizes = [1]\nbaselines = ['serial']\n{TIMING}");
    let workers = Answering { interrupts_at: 1, ..Answering::default() };
    let (records, heard) = session(folder.path(), &lines, &workers, |run| Run { spread: true, ..run });
    assert_eq!((records.unwrap_err().exit_code(), heard.resumed), (130, vec![[1, 2]]));
}

#[test]
fn workers_have_the_time_limit_of_the_run_on_one_device_and_on_two() {
    let limit = Duration::from_millis(30);
    for spread in [false, true] {
        let (folder, workers) = (tempfile::tempdir().unwrap(), Answering::default());
        let lines = format!("local_sizes = [1]\nbaselines = ['serial']\n{TIMING}");
        session(folder.path(), &lines, &workers, |run| Run { limit, spread, ..run }).0.unwrap();
        let limits = workers.limits.lock().unwrap();
        assert!(!limits.is_empty() && limits.iter().all(|one| *one == limit), "{spread}: {limits:?}");
    }
}

/// Returns the order of three scenes in the second launch, and the order of the samples of the first scene's points in
/// the first launch.
fn orders(seed: u64, spread: bool) -> [Vec<String>; 2] {
    let scenes =
        ["pyramid-upper", "pyramid-lower"].map(|name| format!("[[scene]]\nfile = 'scenes/{name}.toml'\n"));
    let timing = TIMING.replace("launches", &format!("seed = {seed}, launches"));
    let lines = format!("local_sizes = [1, 2, 4]\n{timing}\n{}", scenes.concat());
    let (experiment, device, locks) =
        (fixtures::experiment(&lines), asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = Run { spread, ..fixtures::run(&experiment, &devices, &locks) };
    let (folder, mut workers, mut heard) =
        (tempfile::tempdir().unwrap(), Answering::default(), Heard::default());
    let mut results = Results::resume(folder.path(), &Environment::default()).unwrap();
    let interrupted = Arc::clone(&workers.interrupted);
    let records = match spread {
        false => run.execute(&mut results, &mut heard, &mut workers, &interrupted),
        true => run.execute_spread(&mut results, &mut heard, vec![Box::new(workers)], &interrupted),
    };
    assert_eq!(records.unwrap().len(), 9);
    let timed = |launch: &str| {
        let ending = format!("launch {launch} of 2");
        let timed =
            heard.works.iter().filter(move |work| work.starts_with("timing ") && work.ends_with(&ending));
        timed.map(|work| work.split(' ').nth(1).unwrap_or_default().to_owned())
    };
    let mut scenes: Vec<String> = timed("2").collect();
    scenes.dedup();
    let points =
        heard.works.iter().filter(|work| work.starts_with("timing triangle ") && work.ends_with("1 of 2"));
    [scenes, points.cloned().collect()]
}

#[test]
fn the_order_of_groups_and_of_their_points_follows_from_the_seed() {
    for spread in [false, true] {
        let all = [1, 2, 3, 4, 5].map(|seed| orders(seed, spread));
        assert_eq!(all[0], orders(1, spread), "the same seed makes the same order");
        for (index, count) in [(0, 3), (1, 15)] {
            assert!(all.iter().all(|orders| orders[index].len() == count), "{all:?}");
            let different: HashSet<&Vec<String>> = all.iter().map(|orders| &orders[index]).collect();
            assert!(different.len() > 1, "{spread}: {:?}", all[0][index]);
        }
    }
}

#[test]
fn every_sixth_frame_of_a_device_is_followed_by_its_anchor_if_there_are_several_launches() {
    let anchors = |points: usize, launches: u32| {
        let folder = tempfile::tempdir().unwrap();
        let timing = TIMING.replace("launches = 2", &format!("launches = {launches}"));
        let sizes = &[1, 2, 3, 4, 5, 6, 7][..points];
        let lines = format!("local_sizes = {sizes:?}\n{timing}");
        let (records, heard) = session(folder.path(), &lines, &Answering::default(), plain);
        assert_eq!(records.unwrap().len(), points);
        let anchors: Vec<AnchorSample> = read_lines(&folder.path().join("anchors.jsonl")).unwrap().lines;
        let samples: Vec<Sample> = read_lines(&folder.path().join("samples.jsonl")).unwrap().lines;
        (anchors, samples, heard)
    };
    let (anchor_samples, samples, _) = anchors(7, 2);
    let name = crate::anchor::name(&asleep::device(1.0)).unwrap();
    // In each launch, each of seven points is cast five times. The anchor (a fixed kernel) runs after the
    // frames 1, 7, 13, 19, 25 and 31 of a launch's 35 frames.
    let of: Vec<_> = anchor_samples.iter().map(|anchor| (anchor.launch, anchor.round)).collect();
    assert_eq!(of, [0, 1].map(|launch| [0, 0, 1, 2, 3, 4].map(|round| (launch, round))).concat());
    for anchor in &anchor_samples {
        assert_eq!((&anchor.anchor, anchor.ms), (&name, 1.0));
        let of_round = samples.iter().filter(|one| (one.launch, one.round) == (anchor.launch, anchor.round));
        let first_ms = of_round.filter_map(|one| one.at_ms).fold(f64::INFINITY, f64::min);
        assert!(anchor.at_ms >= first_ms, "{anchor:?}");
    }
    // If a round of a launch has fewer than six frames, the anchor (a fixed kernel) runs once in each round.
    // The anchor then has the five samples that a 95% interval needs.
    for points in [1, 3, 5] {
        let of: Vec<_> = anchors(points, 2).0.iter().map(|anchor| (anchor.launch, anchor.round)).collect();
        let expected = [0, 1].map(|launch| [0, 1, 2, 3, 4].map(|round| (launch, round))).concat();
        assert_eq!(of, expected, "{points} points");
    }
    let (none, _, heard) = anchors(1, 1);
    assert!(none.is_empty());
    assert!(heard.works.iter().any(|work| work == "timing triangle 8x5 naive 1x1"), "{:?}", heard.works);
}

/// Runs an experiment on these devices in a new folder. Returns the records, and what the observer heard.
fn on_devices(
    lines: &str,
    devices: &[&DeviceInfo],
    workers: &Answering,
    change: impl for<'a> Fn(Run<'a>) -> Run<'a>,
) -> (Result<Vec<Record>>, Heard) {
    let (experiment, locks) = (fixtures::experiment(lines), fixtures::own_locks());
    let run = change(fixtures::run(&experiment, devices, &locks));
    let folder = tempfile::tempdir().unwrap();
    let mut results = Results::resume(folder.path(), &Environment::default()).unwrap();
    let mut heard = Heard::default();
    let records = if run.spread {
        let spawners = devices.iter().map(|_| Box::new(workers.clone()) as Box<dyn Spawner + Send>).collect();
        run.execute_spread(&mut results, &mut heard, spawners, &workers.interrupted)
    } else {
        run.execute(&mut results, &mut heard, &mut workers.clone(), &workers.interrupted)
    };
    (records, heard)
}

#[test]
fn each_of_two_devices_has_its_workers_which_start_together() {
    let devices = ["one", "two"].map(|name| DeviceInfo { name: name.into(), ..asleep::device(1.0) });
    let devices = [&devices[0], &devices[1]];
    let lines = format!("local_sizes = [1]\n{}", TIMING.replace("launches = 2", "launches = 1"));
    let workers = Answering::default();
    let (records, heard) = on_devices(&lines, &devices, &workers, plain);
    assert_eq!((records.unwrap().len(), heard.begun), (2, vec![[2, 2]]));
    let mut started = workers.jobs.lock().unwrap().clone();
    started.sort_unstable();
    assert_eq!((started, workers.at_first.load(Ordering::Relaxed)), (vec![0, 1], 2));
    // The two groups are distributed over the devices. Neither group ends before both groups have begun, so
    // each device measures one group.
    let lines = format!("{lines}\n[[scene]]\nfile = 'scenes/pyramid-upper.toml'");
    let workers = Answering { gathering: Some(Arc::default()), ..Answering::default() };
    let (records, _) = on_devices(&lines, &devices, &workers, |run| Run { spread: true, ..run });
    let mut started = workers.jobs.lock().unwrap().clone();
    started.sort_unstable();
    assert_eq!((records.unwrap().len(), started), (2, vec![0, 1]));
}

#[test]
fn a_control_point_that_a_block_borrows_counts_as_steps_and_not_as_a_point() {
    let blocks = [(1, [0, 1]), (2, [2, 3])].map(|(number, points)| Block {
        number,
        shard: 1,
        points: points.to_vec(),
        control: Some(1),
    });
    let blocks: &'static [Block] = Box::leak(Box::new(blocks));
    let lines = format!("local_sizes = [1, 2, 4, 8]\n{TIMING}");
    let device = asleep::device(1.0);
    let (records, heard) =
        on_devices(&lines, &[&device], &Answering::default(), |run| Run { blocks: Some(blocks), ..run });
    assert_eq!((records.unwrap().len(), heard.finished), (4, 4));
    assert_eq!((heard.begun, heard.steps), (vec![[4, 10]], 10));
}

#[test]
fn programs_of_later_groups_are_ordered_at_once_unless_a_processor_is_timed() {
    // Both scenes use the same program of `naive`, but each scene needs its own program of `bvh`, which traverses the
    // scene's tree.
    let more =
        "[[strategy]]\npreset = 'bvh'\nlocal_sizes = [1]\n[[scene]]\nfile = 'scenes/pyramid-upper.toml'";
    let lines = format!("local_sizes = [1]\n{TIMING}\n{more}");
    let ordered = |kind: DeviceKind| {
        let ahead: &'static Ahead = Box::leak(Box::default());
        let workers = Answering::default();
        // There are no builders (processes that compile programs), so the run would wait for the first group's
        // program for ever. The test therefore interrupts the run.
        workers.interrupted.store(true, Ordering::Relaxed);
        let device = DeviceInfo { kind, ..asleep::device(1.0) };
        let (records, _) = on_devices(&lines, &[&device], &workers, |run| Run { ahead: Some(ahead), ..run });
        assert_eq!(records.unwrap_err().exit_code(), 130);
        ahead.ordered()
    };
    assert_eq!((ordered(DeviceKind::Gpu), ordered(DeviceKind::Cpu)), (3, 2));
}

#[test]
fn after_an_error_no_other_group_is_visited() {
    let lines = format!("local_sizes = [1]\n{TIMING}\n[[scene]]\nfile = 'scenes/pyramid-upper.toml'");
    let (experiment, device, locks) =
        (fixtures::experiment(&lines), asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let plan = run.plan();
    let groups = run.pending_points(&plan, &run.pieces(&plan)).unwrap();
    let waiting = Waiting::new(groups.into_iter().map(OpenGroup::new).collect(), 1);
    let folder = tempfile::tempdir().unwrap();
    let mut results = Results::resume(folder.path(), &Environment::default()).unwrap();
    let mut sink = FolderSink { results: &mut results, observer: &mut (), names: HashMap::new(), done: 0 };
    let mut workers = Answering::default();
    let mut served = |interrupted: bool| {
        let interrupted = AtomicBool::new(interrupted);
        let mut supervisor = Supervisor::new(&mut workers, &interrupted, run.limit);
        serve(&run, &waiting, Some(0), &mut supervisor, &mut sink).is_ok()
    };
    // The first call of `serve` ends with an error, since the run is interrupted. The second call of `serve`
    // then finds no group to measure.
    assert!(!served(true) && served(false));
    assert_eq!(workers.requests.load(Ordering::Relaxed), 0);
}
