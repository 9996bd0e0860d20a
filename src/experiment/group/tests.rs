//! Tests that a launch is used only if every point was sampled in it. Other tests check which workers are
//! started for a group of points, and which locks of devices the group takes.

use super::*;
use crate::device::Hardware;
use crate::device_lock::{Held, LockName, Locks};
use crate::experiment::ahead::Ahead;
use crate::experiment::asleep;
use crate::experiment::fixtures;
use crate::experiment::protocol::{Reply, Request};
use crate::experiment::rounds::Rounds as _;
use crate::experiment::waiting::{Death, Spawner, Wait, Worker};
use crate::launch::FrameTimes;
use crate::record::{AnchorSample, RoundLoad};
use std::cell::Cell;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// The frame at which a worker dies: the last frame of the third round, if a round has two points and no anchor.
const DEADLY: usize = 6;

/// A sink for tests: collects the run's records, and returns the samples in `past` as those of an earlier
/// session.
#[derive(Default)]
struct Noting {
    past: HashMap<String, Vec<Taken>>,
    /// The device that measured each earlier launch.
    measured_on: HashMap<u32, MeasuredOn>,
    /// How launches ended: for each launch, the reason for its end, and each point's number of samples. A test may
    /// set the ends of earlier launches; the run adds those of new launches.
    ends: Vec<LaunchEnd>,
    /// For each sample, the UUID or the PCI address of the device that took the sample; `None` if both are
    /// unknown.
    measured_by: Vec<Option<String>>,
    /// The core-to-core latency of each earlier launch.
    latencies_ns: Vec<f64>,
    records: Vec<Record>,
    launches: u32,
    works: Vec<String>,
    said: Vec<String>,
    steps: usize,
    loads: Vec<RoundLoad>,
    anchors: Vec<AnchorSample>,
    waits: usize,
    /// A device's lock that another process seems to hold. The test releases the device's lock when the run
    /// begins to wait for the lock.
    of_another: Option<Held>,
    /// The folder of the locks. When this run has to wait, a file takes the place of the folder, so that no lock can be
    /// taken.
    unusable: Option<PathBuf>,
    /// The list of programs that builders (processes that compile programs before points need them) build. Whenever the
    /// run waits for a lock, `may_build` notes whether builders may begin programs for the first device.
    ahead: Option<&'static Ahead>,
    may_build: Vec<bool>,
}

impl ResultSink for Noting {
    fn works_on(&mut self, what: &str) {
        self.works.push(what.to_owned());
    }
    fn says(&mut self, line: &str) {
        self.said.push(line.to_owned());
    }
    fn waits(&mut self) {
        self.waits += 1;
        self.may_build.extend(self.ahead.map(|ahead| ahead.may_build_on(0)));
        self.of_another = None;
        if let Some(folder) = self.unusable.take() {
            std::fs::remove_dir_all(&folder).and_then(|()| std::fs::write(&folder, "")).unwrap();
        }
    }
    fn keep(&mut self, record: Record) -> Result<()> {
        self.records.push(record);
        Ok(())
    }
    fn sample(
        &mut self,
        _record: &Record,
        _round: u32,
        measured_by: Option<&str>,
        _taken: &Taken,
    ) -> Result<()> {
        self.measured_by.push(measured_by.map(str::to_owned));
        Ok(())
    }
    fn launch_end(&mut self, end: &LaunchEnd) -> Result<()> {
        self.ends.push(end.clone());
        Ok(())
    }
    fn load(&mut self, load: &RoundLoad) -> Result<()> {
        self.loads.push(load.clone());
        Ok(())
    }
    fn anchor(&mut self, sample: &AnchorSample) -> Result<()> {
        self.anchors.push(sample.clone());
        Ok(())
    }
    fn next_launch(&mut self) -> u32 {
        // raycl leaves out samples whose core-to-core latency is far from the usual one. The test does not know the
        // latencies of its machine. The test forgets those of earlier launches, so that all samples of the new launch
        // count.
        self.latencies_ns.clear();
        self.launches += 1;
        self.launches - 1
    }
    fn advances(&mut self, steps: usize) {
        self.steps += steps;
    }
    fn past(&self, key: &str) -> Vec<Taken> {
        self.past.get(key).cloned().unwrap_or_default()
    }
    fn past_end(&self, launch: u32) -> Option<LaunchEnd> {
        self.ends.iter().find(|end| end.launch == launch).cloned()
    }
    fn measured_on(&self, launch: u32) -> Option<MeasuredOn> {
        self.measured_on.get(&launch).cloned()
    }
    fn near_ns(&self) -> f64 {
        self.latencies_ns.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// Starts workers, one of which dies at the frame `DEADLY`, and counts the workers and the frames that all workers cast
/// (including those of the anchor). If a test sets `frames` to `DEADLY` at the beginning, no worker dies.
#[derive(Default)]
struct Mortals {
    started: Rc<Cell<usize>>,
    frames: Rc<Cell<usize>>,
    /// True if the anchor (a fixed kernel) fails in every worker.
    fails_anchor: bool,
}

/// Returns the times that a worker answers: the anchor's device, host and processor times differ.
fn times_of(request: &Request) -> FrameTimes {
    match request {
        Request::Anchor => FrameTimes { processor_ms: Some(3.0), ..FrameTimes::whole(1.0, 2.0) },
        _ => FrameTimes::whole(1.0, 1.0),
    }
}

struct Mortal {
    frames: Rc<Cell<usize>>,
    fails_anchor: bool,
    answer: Wait,
}

impl Spawner for Mortals {
    fn spawn(&mut self, _job: usize) -> Result<Box<dyn Worker>> {
        let frames = Rc::clone(&self.frames);
        self.started.set(self.started.get() + 1);
        let fails_anchor = self.fails_anchor;
        Ok(Box::new(Mortal { frames, fails_anchor, answer: Wait::Reply(Reply::Started) }))
    }
}

impl Worker for Mortal {
    fn send(&mut self, request: &Request) {
        if let Request::Check { key, .. } = request {
            let record = Record { key: key.clone(), scene: "triangle".to_owned(), ..Record::default() };
            let record = Box::new(record);
            self.answer = Wait::Reply(Reply::Checked { record, ready: true });
            return;
        }
        if self.fails_anchor && *request == Request::Anchor {
            let failed = Reply::Failed { message: "no anchor".to_owned(), help: "go on".to_owned() };
            self.answer = Wait::Reply(failed);
            return;
        }
        self.frames.set(self.frames.get() + 1);
        self.answer = match self.frames.get() {
            DEADLY => Wait::Dead(Death::default()),
            _ => Wait::Reply(Reply::Sample(times_of(request))),
        };
    }

    fn wait(&mut self, _limit: Duration) -> Wait {
        self.answer.clone()
    }
}

/// Returns a sample of 1 ms with a core-to-core latency.
fn sample(launch: u32, core_to_core_ns: Option<f64>) -> Taken {
    Taken { launch, at_ms: 0.0, core_to_core_ns, times: FrameTimes::whole(1.0, 1.0) }
}

/// Returns a group of the points "a" and "b".
fn group() -> OpenGroup {
    let pending = |(point, key): (usize, &str)| {
        let record = Record { key: key.to_owned(), ..Record::default() };
        PendingPoint::new([point, 0, 0], String::new(), record)
    };
    OpenGroup::new([(0, "a"), (1, "b")].map(pending).into())
}

#[test]
fn a_launch_that_lacks_samples_of_a_point_is_not_taken_over() {
    let samples = |launch: u32, count: usize| vec![sample(launch, None); count];
    let past = HashMap::from([
        ("a".to_owned(), [samples(0, 5), samples(1, 5), samples(2, 5)].concat()),
        ("b".to_owned(), [samples(0, 5), samples(1, 4)].concat()),
    ]);
    let experiment = fixtures::experiment("local_sizes = [4]\ntiming = { launches = 3, min_samples = 15 }");
    let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let mut group = group();
    group.adopt(&run, &mut Noting { past, ..Noting::default() });
    let launches = |pending: &PendingPoint| pending.taken.iter().map(|sample| sample.launch).collect();
    let taken: Vec<Vec<u32>> = group.points().iter().map(launches).collect();
    assert_eq!((group.whole.len(), taken), (1, vec![vec![0; 5]; 2]));
}

#[test]
fn a_launch_that_was_interrupted_is_not_taken_over_and_one_that_ended_is() {
    let timing = "timing = { launches = 4, min_samples = 400, max_samples = 400, time_limit_ms = 10000 }";
    let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
    let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let adopted = |count: usize, ends: Vec<LaunchEnd>| {
        let past = ["a", "b"].map(|key| (key.to_owned(), vec![sample(0, None); count]));
        let mut group = group();
        group.adopt(&run, &mut Noting { past: past.into(), ends, ..Noting::default() });
        (group.whole.len(), group.reason)
    };
    assert_eq!(adopted(20, Vec::new()), (0, None));
    assert_eq!(adopted(100, Vec::new()), (1, Some(StopReason::Precise)));
    let samples = ["a", "b"].map(|key| (key.to_owned(), 20)).into();
    let end = LaunchEnd { launch: 0, stop_reason: StopReason::TimeLimit, samples };
    assert_eq!(adopted(20, vec![end]), (1, Some(StopReason::TimeLimit)));
}

#[test]
fn a_group_returns_to_the_device_of_its_launches_and_takes_over_no_launch_of_another_device() {
    let experiment = fixtures::experiment("local_sizes = [4]\ntiming = { launches = 3, min_samples = 15 }");
    let [one, two] = ["one", "two"].map(|name| DeviceInfo { name: name.into(), ..asleep::device(1.0) });
    let (devices, locks) = ([&one, &two], fixtures::own_locks());
    let run = Run { spread: true, ..fixtures::run(&experiment, &devices, &locks) };
    let sink = |measured_on: &[(u32, &str)]| {
        let samples = [0, 1, 2].map(|launch| vec![sample(launch, None); 5]).concat();
        let past = ["a", "b"].map(|key| (key.to_owned(), samples.clone()));
        let on = |device: &str| MeasuredOn { slug: device.to_owned(), hardware: None };
        let measured_on = measured_on.iter().map(|(launch, device)| (*launch, on(device)));
        Noting { past: past.into(), measured_on: measured_on.collect(), ..Noting::default() }
    };
    let slugs = [one.slug(), two.slug()];
    let [on_one, on_two] = [slugs[0].as_str(), slugs[1].as_str()];
    let adopted = |device: usize| -> Vec<u32> {
        let mut group = group();
        group.settle(device);
        group.adopt(&run, &mut sink(&[(0, on_one), (1, on_two)]));
        group.whole.iter().map(|launch| launch.number).collect()
    };
    // Launch 2 was measured when points were not distributed over the devices, so the first device measured it.
    assert_eq!([adopted(0), adopted(1)], [vec![0, 2], vec![1]]);
    let may_go = |measured_on: &[(u32, &str)]| {
        let mut group = group();
        group.return_to_device(&run, &sink(measured_on));
        [0, 1].map(|device| group.may_go_to(device))
    };
    assert_eq!(may_go(&[(0, on_one), (2, on_two)]), [false, true]);
    assert_eq!([may_go(&[]), may_go(&[(2, "gone")])], [[true, false], [true, true]]);
}

#[test]
fn a_launch_of_another_device_with_the_same_name_is_not_taken_over() {
    let timing = "timing = { launches = 2, min_samples = 10, max_samples = 10, time_limit_ms = 1000 }";
    let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
    let hardware = Hardware { uuid: Some("own".into()), ..Hardware::default() };
    let (device, locks) = (DeviceInfo { hardware, ..asleep::device(1.0) }, fixtures::own_locks());
    let devices = [&device];
    let run = Run { spread: true, ..fixtures::run(&experiment, &devices, &locks) };
    let taken_over = |hardware: Option<&str>| {
        let past = ["a", "b"].map(|key| (key.to_owned(), vec![sample(0, None); 5]));
        let on = MeasuredOn { slug: device.slug(), hardware: hardware.map(str::to_owned) };
        let mut sink = Noting { past: past.into(), measured_on: [(0, on)].into(), ..Noting::default() };
        let mut group = group();
        group.return_to_device(&run, &sink);
        group.adopt(&run, &mut sink);
        (group.home, group.whole.len())
    };
    assert_eq!([Some("own"), None].map(taken_over), [(Some(0), 1); 2]);
    assert_eq!(taken_over(Some("another")), (None, 0));
    // Each stored sample names its device, so that later sessions know which device took the sample.
    let (off, mut workers, mut sink) = (AtomicBool::new(false), Mortals::default(), Noting::default());
    workers.frames.set(DEADLY);
    let mut supervisor = Supervisor::new(&mut workers, &off, run.limit);
    group().visit(&run, &mut supervisor, &mut sink).unwrap();
    assert_eq!(sink.measured_by, vec![Some("own".to_owned()); 10]);
}

/// Times a group in two launches, on a device of this kind. Each point gets `count` samples in all. On CPUs, samples
/// whose core-to-core latency is far from the usual one are left out. Returns what the sink has noted.
fn noted(
    (kind, count): (DeviceKind, u32),
    (mut group, mut workers): (OpenGroup, Mortals),
    mut sink: Noting,
) -> Noting {
    let timing = format!("launches = 2, min_samples = {count}, max_samples = {count}, time_limit_ms = 1000");
    let experiment = fixtures::experiment(&format!("local_sizes = [4]\ntiming = {{ {timing} }}"));
    let (device, locks) = (DeviceInfo { kind, ..asleep::device(1.0) }, fixtures::own_locks());
    let devices = [&device];
    let run = Run { keeps_moved_samples: false, ..fixtures::run(&experiment, &devices, &locks) };
    let off = AtomicBool::new(false);
    let mut supervisor = Supervisor::new(&mut workers, &off, run.limit);
    group.visit(&run, &mut supervisor, &mut sink).unwrap();
    sink
}

/// Returns the launches of each record's samples. Three launches were measured earlier, and two are
/// requested. The core-to-core latency was 180 ns in the first of the three earlier launches, 20 ns in the
/// second, and 25 ns in the third.
fn launches_in_records(kind: DeviceKind) -> Vec<Vec<u32>> {
    let latencies_ns = vec![180.0, 20.0, 25.0];
    let samples = |launch: u32| vec![sample(launch, Some(latencies_ns[launch as usize])); 5];
    let past = ["a", "b"].map(|key| (key.to_owned(), (0..3).flat_map(samples).collect()));
    let sink = Noting { past: past.into(), latencies_ns, ..Noting::default() };
    let sink = noted((kind, 10), (group(), Mortals::default()), sink);
    assert_eq!(sink.steps, 4, "two launches of two points were requested");
    sink.records.into_iter().map(|record| record.sample_launches).collect()
}

#[test]
fn a_launch_with_processors_further_apart_counts_only_for_devices_with_their_own_clocks() {
    let of = |first: u32, second: u32| vec![[vec![first; 5], vec![second; 5]].concat(); 2];
    assert_eq!(launches_in_records(DeviceKind::Cpu), of(1, 2));
    assert_eq!(launches_in_records(DeviceKind::Gpu), of(0, 1));
}

#[test]
fn moved_samples_are_left_out_only_on_processors_and_unless_the_user_keeps_them() {
    let experiment = fixtures::experiment("local_sizes = [4]");
    let locks = fixtures::own_locks();
    let of = |kind, keeps_moved_samples| {
        let device = DeviceInfo { kind, ..asleep::device(1.0) };
        let devices = [&device];
        let run = Run { keeps_moved_samples, ..fixtures::run(&experiment, &devices, &locks) };
        leaves_out_moved(&run, group().points())
    };
    assert!(of(DeviceKind::Cpu, false));
    assert!(!of(DeviceKind::Cpu, true) && !of(DeviceKind::Gpu, false));
}

#[test]
fn a_launch_that_lost_its_worker_has_no_samples_in_records_and_no_stored_end() {
    let timing = "timing = { launches = 1, min_samples = 5, max_samples = 5, time_limit_ms = 1000 }";
    let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
    // The device of this test casts nothing, so no lock is taken for the device.
    let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let (off, mut workers, mut sink) = (AtomicBool::new(false), Mortals::default(), Noting::default());
    let mut supervisor = Supervisor::new(&mut workers, &off, run.limit);
    group().visit(&run, &mut supervisor, &mut sink).unwrap();
    assert!(sink.records.iter().all(|record| record.interval_ms.is_some()));
    let samples = ["a", "b"].map(|key| (key.to_owned(), 5)).into();
    assert_eq!(sink.ends, [LaunchEnd { launch: 1, stop_reason: StopReason::Precise, samples }]);
    assert_eq!(
        (sink.steps, sink.said),
        (2, vec!["a worker process was lost or replaced: the whole launch is repeated".to_owned()])
    );
    let launches: Vec<_> = sink.records.into_iter().map(|record| record.sample_launches).collect();
    assert_eq!(launches, vec![vec![1_u32; 5]; 2]);
}

#[test]
fn after_a_failure_of_the_anchor_new_workers_repeat_the_launch_without_it() {
    let timing = "timing = { launches = 2, min_samples = 10, max_samples = 10, time_limit_ms = 1000 }";
    let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
    let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let mut workers = Mortals { fails_anchor: true, ..Mortals::default() };
    workers.frames.set(DEADLY);
    let started = Rc::clone(&workers.started);
    let (off, mut sink, mut group) = (AtomicBool::new(false), Noting::default(), group());
    let mut supervisor = Supervisor::new(&mut workers, &off, run.limit);
    group.visit(&run, &mut supervisor, &mut sink).unwrap();
    let repeated = "a worker process was lost or replaced: the whole launch is repeated";
    assert_eq!(sink.said, ["asleep: no anchor; go on", repeated]);
    assert_eq!((started.get(), sink.launches), (2, 2));
    let launches: Vec<Vec<u32>> = group
        .points()
        .iter()
        .map(|pending| pending.taken.iter().map(|sample| sample.launch).collect())
        .collect();
    assert_eq!(launches, vec![vec![1; 5]; 2]);
}

#[test]
fn anchors_have_one_name_on_all_devices_that_stand_for_each_other() {
    let timing = "timing = { launches = 2, min_samples = 10, max_samples = 10, time_limit_ms = 1000 }";
    let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
    let (one, locks) = (asleep::device(1.0), fixtures::own_locks());
    let two = DeviceInfo { twins_before: 1, ..asleep::device(1.0) };
    let devices = [&one, &two];
    let count_names = |spread: bool| {
        let run = Run { spread, ..fixtures::run(&experiment, &devices, &locks) };
        let (off, mut workers, mut sink) = (AtomicBool::new(false), Mortals::default(), Noting::default());
        workers.frames.set(DEADLY);
        let mut supervisor = Supervisor::new(&mut workers, &off, run.limit);
        for device in [0, 1] {
            let mut group = group();
            group.settle(device);
            group.visit(&run, &mut supervisor, &mut sink).unwrap();
        }
        let times = |one: &AnchorSample| (one.ms, one.host_ms, one.processor_ms);
        assert!(
            sink.anchors.iter().all(|one| times(one) == (1.0, Some(2.0), Some(3.0))),
            "{:?}",
            sink.anchors
        );
        sink.anchors.iter().map(|sample| &sample.anchor).collect::<HashSet<_>>().len()
    };
    assert_eq!([true, false].map(count_names), [1, 2]);
}

#[test]
fn a_run_that_waits_for_a_device_tells_for_whom_once_and_that_it_waits_again_and_again() {
    let (folder, off) = (tempfile::tempdir().unwrap(), AtomicBool::new(false));
    let locks = Locks::in_folder(folder.path(), true);
    let experiment = fixtures::experiment("local_sizes = [4]");
    let run = fixtures::run(&experiment, &[], &locks);
    let host = LockName::of(None);
    let mut sink = Noting::default();
    for waits in [1, 2] {
        sink.of_another = Some(locks.held_by_another_process(&host));
        drop(take_locks(&run, vec![host.clone()], &mut sink, &off).unwrap());
        assert_eq!((sink.said.len(), sink.waits), (1, waits), "{:?}", sink.said);
    }
    assert_eq!(sink.works, sink.said, "the second wait is only shown as the current work");
}

#[test]
fn builders_begin_nothing_before_a_run_had_its_devices_lock_or_while_it_waits_for_the_lock() {
    let (folder, off) = (tempfile::tempdir().unwrap(), AtomicBool::new(false));
    let locks = Locks::in_folder(folder.path(), true);
    let experiment = fixtures::experiment("local_sizes = [4]");
    let host = LockName::of(None);
    let ahead: &'static Ahead = Box::leak(Box::new(Ahead::new(Vec::new(), vec![host.clone()])));
    let run = Run { ahead: Some(ahead), ..fixtures::run(&experiment, &[], &locks) };
    let mut sink = Noting { ahead: Some(ahead), ..Noting::default() };
    let mut take = |of_another: Option<Held>| {
        sink.of_another = of_another;
        drop(take_locks(&run, vec![host.clone()], &mut sink, &off).unwrap());
        (std::mem::take(&mut sink.may_build), ahead.may_build_on(0))
    };
    assert!(!ahead.may_build_on(0), "the run has not had the lock yet");
    assert_eq!(take(None), (vec![], true));
    let of_another = locks.held_by_another_process(&host);
    assert_eq!(take(Some(of_another)), (vec![false], true));
}

/// With `--spread`, each device has a thread, and the thread of another device may be waiting for a program
/// that a builder (a process that compiles programs) has to build. If builders stayed paused after a device's
/// lock could not be taken, the waiting thread would wait until the user ends the run.
#[test]
fn builders_go_on_if_a_device_waits_in_vain_for_a_lock() {
    let (folder, off) = (tempfile::tempdir().unwrap(), AtomicBool::new(false));
    let locks = Locks::in_folder(&folder.path().join("locks"), true);
    let experiment = fixtures::experiment("local_sizes = [4]");
    let host = LockName::of(None);
    let ahead: &'static Ahead = Box::leak(Box::new(Ahead::new(Vec::new(), vec![host.clone()])));
    let run = Run { ahead: Some(ahead), ..fixtures::run(&experiment, &[], &locks) };
    let of_another = Some(locks.held_by_another_process(&host));
    let unusable = Some(folder.path().join("locks"));
    let mut sink = Noting { ahead: Some(ahead), of_another, unusable, ..Noting::default() };
    assert!(take_locks(&run, vec![host], &mut sink, &off).is_err());
    assert_eq!((&sink.may_build[..], ahead.may_build_on(0)), (&[false][..], true));
}

#[test]
fn a_worker_is_started_ahead_only_if_none_is_there() {
    let (off, group, mut workers) = (AtomicBool::new(false), group(), Mortals::default());
    let started = Rc::clone(&workers.started);
    let mut supervisor = Supervisor::new(&mut workers, &off, Duration::MAX);
    for visit in ["first", "second"] {
        supervisor.start_ahead(group.tasks()).unwrap();
        assert_eq!(started.get(), 1, "at the {visit} visit");
        assert!(supervisor.check(group.points()[0].task()).unwrap().is_ok());
    }
}

#[test]
fn casters_on_the_host_take_a_lock_and_a_device_that_casts_nothing_does_not() {
    let experiment = fixtures::experiment("local_sizes = [4]");
    let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let mut points = group().points;
    points[0].record.device = crate::record::HOST.to_owned();
    assert_eq!(lock_names(&run, &points), [LockName::of(None)]);
}

#[test]
fn a_sample_has_the_time_since_its_launch_in_milliseconds_to_the_microsecond() {
    let experiment = fixtures::experiment("local_sizes = [4]\ntiming = { launches = 1 }");
    let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let (off, mut workers, mut sink) = (AtomicBool::new(false), Mortals::default(), Noting::default());
    let (group, start) = (group(), Instant::now());
    let mut timed = Timed {
        points: &group.points,
        run: &run,
        launch: 3,
        number: 1,
        start,
        watch: Watch::start(),
        losses: 0,
        supervisor: &mut Supervisor::new(&mut workers, &off, run.limit),
        sink: &mut sink,
        taken: vec![Vec::new(); 2],
        failed: HashSet::new(),
        casts: HashMap::new(),
        latency: Latency::of(true),
    };
    let ms = || ms_since(start);
    let before = ms();
    assert!(timed.sampled(1, 0, &FrameTimes::whole(1.0, 1.0)).unwrap(), "no smaller latency is known");
    let after = ms();
    let [taken] = &timed.taken[1][..] else { panic!("one sample of the second point") };
    assert_eq!((timed.taken[0].len(), taken.launch), (0, 3));
    // The sample's time is rounded to microseconds, which changes it by at most half a microsecond.
    let possible = before - 5.1e-4..after + 5.1e-4;
    assert!(possible.contains(&taken.at_ms), "{} {possible:?}", taken.at_ms);
    assert!((taken.at_ms * 1e3 - (taken.at_ms * 1e3).round()).abs() < 1e-6, "{}", taken.at_ms);
    // In a short round, the load of other processes cannot be measured. Some systems do not report the load
    // of other processes at all.
    while cfg!(target_os = "linux") && timed.sink.loads.is_empty() {
        assert!(start.elapsed() < Duration::from_secs(120), "the load is never told");
        std::thread::sleep(Duration::from_millis(20));
        timed.ended(5).unwrap();
    }
    let loads = timed.sink.loads.iter();
    assert!(loads.clone().all(|load| (load.launch, load.round) == (3, 5)));
}

#[test]
fn an_additional_launch_is_reported_and_is_no_step() {
    let latencies_ns = vec![180.0, 20.0];
    let samples = |launch: u32| vec![sample(launch, Some(latencies_ns[launch as usize])); 5];
    let past = ["a", "b"].map(|key| (key.to_owned(), (0..2).flat_map(samples).collect()));
    let sink = Noting { past: past.into(), latencies_ns, launches: 2, ..Noting::default() };
    let (workers, mut group) = (Mortals::default(), group());
    workers.frames.set(DEADLY);
    group.points[1].label = "b".into();
    let sink = noted((DeviceKind::Cpu, 10), (group, workers), sink);
    let words = format!("triangle: {ADDITIONAL}");
    assert_eq!((sink.said, sink.steps), (vec![words], 4));
    assert!(sink.works.contains(&"timing b, additional launch 1".to_owned()), "{:?}", sink.works);
    let launches: Vec<_> = sink.records.into_iter().map(|record| record.sample_launches).collect();
    assert_eq!(launches, vec![[[0; 5], [1; 5], [2; 5]].concat(); 2]);
}

#[test]
fn a_checked_record_has_the_names_of_its_draft_and_the_results_of_its_check() {
    let draft = Record {
        name: "naive (mine)".into(),
        preset: Some("naive".into()),
        kernels_of: Some("mine".into()),
        control: Some("control".into()),
        block: Some(3),
        is_control: true,
        image_hash: Some("of the draft".into()),
        scene_notes: vec!["a note".into()],
        ..Record::default()
    };
    let checked =
        Record { name: "naive".into(), image_hash: Some("of the check".into()), ..Record::default() };
    for ready in [false, true] {
        let expected = Record { image_hash: checked.image_hash.clone(), ..draft.clone() };
        assert_eq!(named((Box::new(checked.clone()), ready), &draft), (Box::new(expected), ready));
    }
}

#[test]
fn a_launch_is_repeated_by_new_workers_on_all_devices() {
    let timing = "timing = { launches = 1, min_samples = 5, max_samples = 5, time_limit_ms = 1000 }";
    let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
    let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
    let devices = [&device, &device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let (off, mut workers, mut sink) = (AtomicBool::new(false), Mortals::default(), Noting::default());
    let started = Rc::clone(&workers.started);
    let mut supervisor = Supervisor::new(&mut workers, &off, run.limit);
    let mut group = group();
    group.points[1].job = 1;
    group.visit(&run, &mut supervisor, &mut sink).unwrap();
    assert_eq!((started.get(), sink.records.len()), (4, 2));
}

#[test]
fn a_record_counts_the_launches_and_the_samples_that_were_left_out() {
    let some = |launch: u32, count: usize, ns: f64| vec![sample(launch, Some(ns)); count];
    let all = [some(0, 6, 180.0), some(1, 5, 20.0), some(1, 2, 180.0), some(2, 6, 25.0)].concat();
    let past = ["a", "b"].map(|key| (key.to_owned(), all.clone()));
    let sink = Noting { past: past.into(), latencies_ns: vec![20.0], ..Noting::default() };
    let sink = noted((DeviceKind::Cpu, 12), (group(), Mortals::default()), sink);
    let counts = sink.records.iter().map(|one| (one.moved_launches, one.moved_samples));
    assert_eq!(counts.collect::<Vec<_>>(), [(Some(1), Some(2)); 2]);
}
