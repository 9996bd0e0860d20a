//! Does the work of a worker, one request at a time: builds programs, checks points, casts frames, and runs
//! the anchor (a fixed kernel).

use super::check::Checker;
use super::draft::{Drafter, HeldScene};
use super::point_failure::PointFailure;
use super::protocol::{Phase, Reply, Request};
use super::ready::Ready;
use super::{Plan, Point};
use crate::anchor::Anchor;
use crate::device::{DeviceInfo, DeviceKind};
use crate::error::{Error, Result};
use crate::launch::{FrameTimes, Refused};
use crate::load::processor_time;
use crate::measure::batch_size;
use crate::record::Outcome;
use crate::sensor::{Watch, watch};
use std::collections::HashMap;
use std::time::Instant;

/// A point of the experiment that can be timed, and its number of frames per sample.
struct Entry {
    ready: Ready,
    /// Number of frames per sample; `None` before the warm-up.
    batch: Option<u32>,
}

/// Serves the requests that a run sends to one of its workers.
pub struct RequestHandler<'a> {
    drafter: Drafter<'a>,
    plan: Plan,
    checker: Checker<'a>,
    /// The loaded scene: the scene of the point that was last built, checked or cast.
    scene: HeldScene,
    /// A point with the scene and the image size of all points in `entries`; `None` before the first build or check.
    /// `entries` contains the points that passed their check; `entries` is emptied when a point with another scene or
    /// image size is built or checked.
    group: Option<Point>,
    entries: HashMap<usize, Entry>,
    /// The device's anchor (a fixed kernel that is timed in turn with points); `None` until the run first
    /// requests it.
    anchor: Option<Anchor>,
    /// The device's sensors; `None` before the first check, since processes that only build programs do not need the
    /// sensors. Always `None` in a worker without a device.
    watch: Option<Watch>,
    /// If points are distributed over several devices of the same model: the device whose name is in the
    /// records of points that kernels cast. The named device may be the worker's own device.
    stands_for: Option<DeviceInfo>,
}

impl<'a> RequestHandler<'a> {
    /// Makes a handler that has served no request yet.
    pub fn new(
        drafter: Drafter<'a>,
        plan: Plan,
        checker: Checker<'a>,
        stands_for: Option<DeviceInfo>,
    ) -> Self {
        Self {
            drafter,
            plan,
            checker,
            scene: HeldScene::default(),
            group: None,
            entries: HashMap::new(),
            anchor: None,
            watch: None,
            stands_for,
        }
    }

    /// Serves a request and returns the reply.
    pub fn answer(&mut self, request: &Request) -> Result<Reply> {
        match request {
            Request::Build { point } => self.build(*point),
            Request::Check { point, key, verified } => self.check(*point, key, verified.as_deref()),
            Request::Cast { point } => self.cast(*point),
            Request::Anchor => self.anchor(),
        }
    }

    fn build(&mut self, number: usize) -> Result<Reply> {
        let point = *self.plan.points.get(number).ok_or_else(no_such_point)?;
        self.turn_to(point)?;
        let at = self.scene.of(self.drafter.experiment, &point)?;
        Ok(Reply::Built(self.checker.build(&point, &at.scene)))
    }

    fn check(&mut self, number: usize, key: &str, verified: Option<&str>) -> Result<Reply> {
        let point = *self.plan.points.get(number).ok_or_else(no_such_point)?;
        self.turn_to(point)?;
        let at = self.scene.of(self.drafter.experiment, &point)?;
        if self.watch.is_none() {
            self.watch = self.checker.device().map(|device| watch(&device.hardware));
        }
        let own = point.device.and(self.checker.device());
        let device = self.stands_for.as_ref().filter(|_| own.is_some()).or(own);
        let mut record = self.drafter.draft(&point, device, at)?;
        record.measured_on = own.filter(|_| self.stands_for.is_some()).map(DeviceInfo::slug);
        if record.key != key {
            return Err(changed(device));
        }
        // A control point is checked in each block that measures it. The buffers of the point's earlier check
        // are freed before this check.
        self.entries.remove(&number);
        let ready = match self.checker.check(&point, &at.scene, verified, &mut record)? {
            Ok(ready) => {
                self.entries.insert(number, Entry { ready, batch: None });
                true
            }
            Err(refusal) => {
                record = refusal.write_into(record);
                false
            }
        };
        Ok(Reply::Checked { record: Box::new(record), ready })
    }

    /// Prepares the worker for requests about a point of the experiment. If the point has another scene or image size
    /// than the points in `entries`, drops the entries. If the worker does not hold the point's scene, or holds it with
    /// a camera for another image shape, frees the current scene on the device and loads the point's scene.
    fn turn_to(&mut self, point: Point) -> Result<()> {
        if self.group.is_none_or(|group| !group.has_scene_and_size_of(&point)) {
            self.entries.clear();
            self.group = Some(point);
        }
        if !self.scene.is_of(&point) {
            self.checker.leave_scene();
            self.checker.begin(Phase::Host);
            self.scene.of(self.drafter.experiment, &point)?;
            self.checker.begin(Phase::Cast);
        }
        Ok(())
    }

    fn anchor(&mut self) -> Result<Reply> {
        let anchor = match self.anchor.take() {
            Some(anchor) => anchor,
            None => self.checker.anchor()?,
        };
        let anchor = self.anchor.insert(anchor);
        let (times, processor_ms) = with_processor_ms(self.checker.device(), || anchor.run());
        Ok(Reply::Sample(FrameTimes { processor_ms, ..times? }))
    }

    fn cast(&mut self, number: usize) -> Result<Reply> {
        let timing = &self.drafter.experiment.timing;
        let (Some(point), Some(entry)) = (self.plan.points.get(number), self.entries.get_mut(&number)) else {
            return Err(no_such_point());
        };
        // The scene is loaded already, since the point has passed its check.
        let at = self.scene.of(self.drafter.experiment, point)?;
        let frame = |batch| entry.ready.frame(&at.scene, point.image_size, batch);
        // A caster on the host is timed by the host's clock, even if its worker has a device.
        let device = point.device.and(self.checker.device());
        let timer_ns = device.and_then(|device| device.hardware.timer_resolution_ns);
        let batch = match entry.batch {
            Some(batch) => batch,
            None => {
                // If the timer is coarse, a sample may be a batch of frames. The number of frames in the batch is
                // chosen by the time of one frame, so at least one frame is cast before the sample.
                let frames = timing.warmup.max(u32::from(timer_ns.is_some_and(|step| step > 1)));
                let warmed = warm_up(|| frame(1), frames, timing.time_limit_ms);
                warmed.batch(timer_ns, timing.time_limit_ms)
            }
        };
        entry.batch = Some(batch);
        let start = Instant::now();
        let why = |times: &FrameTimes| times.why_impossible(timer_ns);
        let (sample, used_ms) = possible(why, || with_processor_ms(device, || frame(batch)));
        let processor_ms = used_ms.map(|used_ms| used_ms / f64::from(batch));
        let sense = |ms| self.watch.as_ref()?.sense(start, Instant::now(), ms);
        if let Some(reason) = sample.as_ref().ok().and_then(why) {
            return Ok(Reply::Refused(PointFailure::new(Outcome::LaunchFailed, reason)));
        }
        Ok(match sample {
            Ok(times) => {
                let sensed = device.and_then(|_| sense(times.frame_ms));
                Reply::Sample(FrameTimes { processor_ms, sensed, ..times })
            }
            Err(refused) => Reply::Refused(PointFailure::of(&refused, self.checker.device())),
        })
    }
}

/// Calls `cast`, which casts on `device` or, without a device, on the host. Returns the result of `cast`, and
/// the processor time in milliseconds that this process used during the call. The processor time is `None` if
/// the device is not a CPU.
fn with_processor_ms<T>(device: Option<&DeviceInfo>, cast: impl FnOnce() -> T) -> (T, Option<f64>) {
    let before = processor_time();
    let result = cast();
    let used = processor_time().saturating_sub(before);
    let is_on_processors = device.is_none_or(|device| device.kind == DeviceKind::Cpu);
    (result, is_on_processors.then_some(used.as_secs_f64() * 1e3))
}

/// The largest number of attempts to take a sample whose times are possible. For example, times may be impossible if
/// the machine was suspended during the sample: the host's clock stood still, but the device's clock may have gone on.
const ATTEMPTS: usize = 3;

/// Takes a sample with `take`. If `why` returns a reason why the sample's times are impossible, takes another
/// sample, up to [`ATTEMPTS`] in all. Returns the last sample, even if its times are impossible.
fn possible<T>(
    why: impl Fn(&FrameTimes) -> Option<String>,
    mut take: impl FnMut() -> (std::result::Result<FrameTimes, Refused>, T),
) -> (std::result::Result<FrameTimes, Refused>, T) {
    let mut taken = take();
    for _ in 1..ATTEMPTS {
        if taken.0.as_ref().ok().and_then(&why).is_none() {
            break;
        }
        taken = take();
    }
    taken
}

/// The shortest times of the frames of a warm-up, in milliseconds; infinity if there was no frame.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Warmed {
    /// The shortest time of a pass (primary rays, shadow rays or shading), or of a frame that is not divided into
    /// passes. The time is measured by the device's clock or, for a caster on the host, by the host's clock.
    pass_ms: f64,
    /// The shortest time of a frame by the host's clock.
    host_ms: f64,
}

impl Warmed {
    /// Returns the number of frames of a sample. `timer_ns` is a step of the device's timer. If a pass took 0 steps of
    /// the timer, the number of frames is also limited so that a sample, by the host's clock, takes at most about a
    /// tenth of the time limit. If a single frame takes longer, the sample consists of one frame.
    fn batch(&self, timer_ns: Option<u64>, time_limit_ms: f64) -> u32 {
        let batch = batch_size(self.pass_ms, timer_ns);
        if self.pass_ms > 0.0 {
            return batch;
        }
        batch.min((0.1 * time_limit_ms / self.host_ms) as u32).max(1)
    }
}

/// Casts up to `frames` frames that are not recorded, and returns their shortest times. If frames are long, the warm-up
/// ends after a tenth of the time limit. A short warm-up is enough, since the check has already cast one frame. If a
/// frame fails, the warm-up ends. The first sample after a failed warm-up usually fails too, and reports the failure.
fn warm_up(
    frame: impl Fn() -> std::result::Result<FrameTimes, Refused>,
    frames: u32,
    time_limit_ms: f64,
) -> Warmed {
    let (mut spent_ms, mut warmed) = (0.0, Warmed { pass_ms: f64::INFINITY, host_ms: f64::INFINITY });
    for _ in 0..frames {
        let Ok(times) = frame() else { break };
        spent_ms += times.host_ms;
        warmed.pass_ms = warmed.pass_ms.min(times.shortest_ms());
        warmed.host_ms = warmed.host_ms.min(times.host_ms);
        if spent_ms > 0.1 * time_limit_ms {
            break;
        }
    }
    warmed
}

/// Returns the error for a request about a point that is not in the plan, or for a request to cast a point that has not
/// passed a check.
pub(super) fn no_such_point() -> Error {
    Error::fault("a worker process received a request for an unknown point")
}

fn changed(device: Option<&DeviceInfo>) -> Error {
    let what = if device.is_some() { "a scene, a kernel file or the device" } else { "a scene" };
    Error::run(format!("{what} changed during the run"))
        .with_help("run the same command with --resume to measure the affected points")
}

#[cfg(test)]
mod tests {
    use super::super::draft::Hashed;
    use super::super::{Pictures, fixtures};
    use super::*;
    use crate::config;
    use crate::device::discover;
    use crate::program::Sources;
    use crate::record::{HOST, Record};
    use std::cell::{Cell, RefCell};
    use std::path::Path;
    use std::rc::Rc;

    /// Returns a temporary folder with a folder for images.
    fn folder_of_images() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        folder
    }

    /// Returns the key of the record of a point on a device; `None` means the host.
    fn key_of(drafter: Drafter<'_>, (plan, point): (&Plan, usize), device: Option<&DeviceInfo>) -> String {
        let of = &plan.points[point];
        let at = Hashed::load(&drafter.experiment.scenes[of.scene], of.image_size).unwrap();
        drafter.draft(of, device, &at).unwrap().key
    }

    /// Lets a new worker check a caster on the host. The request has the key `key`, or the point's
    /// own key if `key` is `None`.
    fn checked(key: Option<&str>, verified: Option<&str>) -> Result<Reply> {
        let text = "question = '?'\nexpectation = '!'\nscenes = ['scenes/triangle.toml']\n\
            baselines = ['serial']\nimage_sizes = [[24, 15]]\n";
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("test.toml");
        let experiment = config::parse(&config, text.to_owned(), &[]).unwrap();
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let plan = Plan::new(&experiment, 0);
        let own = key_of(drafter, (&plan, 0), None);
        let folder = folder_of_images();
        let checker = Checker::open(drafter, None, Pictures::of(folder.path())).unwrap();
        let request = Request::Check {
            point: 0,
            key: key.map_or(own, str::to_owned),
            verified: verified.map(str::to_owned),
        };
        RequestHandler::new(drafter, plan, checker, None).answer(&request)
    }

    #[test]
    fn a_point_whose_files_changed_during_the_run_is_refused() {
        assert!(checked(None, None).is_ok());
        let error = checked(Some("of other files"), None).expect_err("its key differs");
        assert!(error.to_string().contains("changed during the run"), "{error}");
    }

    #[test]
    fn only_a_picture_that_was_verified_is_not_compared_again() {
        let compared = |verified: Option<&str>| match checked(None, verified) {
            Ok(Reply::Checked { record, ready: true }) => record.image_hash,
            other => panic!("{other:?}"),
        };
        let hash = compared(None);
        assert!(hash.is_some());
        assert_eq!(compared(hash.as_deref()), None);
        assert_eq!(compared(Some("of another picture")), hash);
    }

    #[test]
    fn the_warm_up_finds_the_shortest_frame_and_ends_early_if_frames_are_long() {
        let cast = Cell::new(0_u32);
        let frame = || {
            cast.set(cast.get() + 1);
            Ok(FrameTimes::whole(9.0 - f64::from(cast.get()), 10.0))
        };
        let warmed = |frames, time_limit_ms| {
            cast.set(0);
            (warm_up(frame, frames, time_limit_ms).pass_ms, cast.get())
        };
        assert_eq!(warmed(3, 1000.0), (6.0, 3));
        assert_eq!(warmed(3, 150.0), (7.0, 2), "two frames take more than a tenth of the limit");
        assert_eq!(warmed(0, 1000.0), (f64::INFINITY, 0));
    }

    #[test]
    fn where_the_timer_reports_nothing_a_sample_is_no_longer_than_a_tenth_of_the_time_limit() {
        let batch = |pass_ms, host_ms| Warmed { pass_ms, host_ms }.batch(Some(1000), 1000.0);
        assert_eq!([0.1, 10.0, 3000.0, 0.0].map(|host_ms| batch(0.0, host_ms)), [256, 10, 1, 256]);
        assert_eq!([batch(0.004, 3000.0), batch(f64::INFINITY, f64::INFINITY)], [13, 1]);
    }

    #[test]
    fn a_sample_with_impossible_times_is_taken_again_until_there_is_a_possible_one() {
        let sample = |impossible: u32| {
            let taken = Cell::new(0_u32);
            let take = || {
                taken.set(taken.get() + 1);
                let frame_ms = if taken.get() > impossible { 1.0 } else { 1000.0 };
                (Ok(FrameTimes::whole(frame_ms, 1.5)), ())
            };
            let (times, ()) = possible(|times| times.why_impossible(None), take);
            (times.map_err(|refused| refused.reason()).unwrap().frame_ms, taken.get())
        };
        assert_eq!([sample(0), sample(1), sample(2)], [(1.0, 1), (1.0, 2), (1.0, 3)]);
        assert_eq!(sample(5), (1000.0, 3));
    }

    /// Checks the first point of an experiment and casts a frame of this point, in a worker of this machine's
    /// first device. `lines` are the experiment's strategies or baselines. `change` changes the device's
    /// properties. `stands_for` is the device whose name is in records.
    fn served(
        lines: &str,
        change: impl Fn(&mut DeviceInfo),
        stands_for: Option<DeviceInfo>,
    ) -> (DeviceInfo, Record, FrameTimes) {
        let timing = "scenes = ['scenes/triangle.toml']\ntiming = { launches = 1, warmup = 0 }";
        let experiment = fixtures::experiment_of(&format!("{timing}\n{lines}"));
        let mut device = discover(&Sources::Embedded).unwrap().remove(0);
        change(&mut device.info);
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let plan = Plan::new(&experiment, 1);
        let named = plan.points[0].device.map(|_| stands_for.as_ref().unwrap_or(&device.info));
        let key = key_of(drafter, (&plan, 0), named);
        let folder = folder_of_images();
        let checker = Checker::open(drafter, Some(&device), Pictures::of(folder.path())).unwrap();
        let mut handler = RequestHandler::new(drafter, plan, checker, stands_for);
        assert!(handler.answer(&Request::Cast { point: 0 }).is_err(), "it was not checked");
        let check = handler.answer(&Request::Check { point: 0, key, verified: None }).unwrap();
        let Reply::Checked { record, ready: true } = check else { panic!("{check:?}") };
        let cast = handler.answer(&Request::Cast { point: 0 }).unwrap();
        let Reply::Sample(times) = cast else { panic!("{cast:?}") };
        assert_eq!(handler.entries[&0].batch, Some(times.batch.unwrap_or(1)), "the warm-up is not repeated");
        (device.info.clone(), *record, times)
    }

    /// The lines of an experiment whose only point is cast by kernels.
    const NAIVE: &str = "strategies = ['naive']\nlocal_sizes = [4]";

    /// Casts a frame of the first point of an experiment, in a worker of a device with this kind and this
    /// timer. `lines` are the experiment's strategies or baselines.
    fn sample_of(lines: &str, kind: DeviceKind, timer_resolution_ns: Option<u64>) -> FrameTimes {
        let change = |info: &mut DeviceInfo| {
            info.kind = kind;
            info.hardware.timer_resolution_ns = timer_resolution_ns;
        };
        served(lines, change, None).2
    }

    /// Takes a sample of the strategy `naive` on a device of this kind, whose timer has this resolution.
    fn sample(kind: DeviceKind, timer_resolution_ns: Option<u64>) -> FrameTimes {
        sample_of(NAIVE, kind, timer_resolution_ns)
    }

    #[test]
    fn a_record_names_the_device_for_which_another_one_of_its_model_stands() {
        let (own, record, _) = served(NAIVE, |_| {}, None);
        assert_eq!((record.device, record.measured_on), (own.label.clone(), None));
        let first = DeviceInfo { label: "the first".into(), name: "first".into(), ..own.clone() };
        let (own, record, _) = served(NAIVE, |_| {}, Some(first.clone()));
        assert_eq!((record.device.as_str(), record.measured_on), ("the first", Some(own.slug())));
        let (_, baseline, _) = served("baselines = ['serial']", |_| {}, Some(first));
        assert_eq!((baseline.device.as_str(), baseline.measured_on), (HOST, None));
    }

    #[test]
    fn a_point_of_an_earlier_scene_must_be_checked_again() {
        let scenes = "scenes = ['scenes/triangle.toml', 'scenes/pyramid-upper.toml']";
        let experiment = fixtures::experiment_of(&format!("{scenes}\nbaselines = ['serial']"));
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let plan = Plan::new(&experiment, 0);
        let keys = [0, 1].map(|point| key_of(drafter, (&plan, point), None));
        let folder = folder_of_images();
        let checker = Checker::open(drafter, None, Pictures::of(folder.path())).unwrap();
        let mut handler = RequestHandler::new(drafter, plan.clone(), checker, None);
        for (point, key) in keys.into_iter().enumerate() {
            let checked = handler.answer(&Request::Check { point, key, verified: None });
            assert!(matches!(checked, Ok(Reply::Checked { ready: true, .. })), "{point}");
        }
        assert!(matches!(handler.answer(&Request::Cast { point: 1 }), Ok(Reply::Sample(_))));
        assert!(handler.answer(&Request::Cast { point: 0 }).is_err());
    }

    #[test]
    fn a_worker_places_the_camera_for_the_shape_of_each_points_images() {
        let folder = folder_of_images();
        std::fs::write(folder.path().join("bar.obj"), "v 0 0 0\nv 9 0 0\nv 0 1 2\nf 1 2 3\n").unwrap();
        let text = "question = '?'\nexpectation = '!'\nscenes = ['bar.obj']\nbaselines = ['serial']\n\
                    image_sizes = [[8, 20], [20, 8], [8, 8]]\n";
        let experiment = config::parse(&folder.path().join("test.toml"), text.to_owned(), &[]).unwrap();
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let plan = Plan::new(&experiment, 0);
        let checker = Checker::open(drafter, None, Pictures::of(folder.path())).unwrap();
        let mut handler = RequestHandler::new(drafter, plan.clone(), checker, None);
        for point in 0..plan.points.len() {
            let key = key_of(drafter, (&plan, point), None);
            let checked = handler.answer(&Request::Check { point, key, verified: None });
            assert!(matches!(checked, Ok(Reply::Checked { ready: true, .. })), "{checked:?}");
        }
    }

    #[test]
    fn a_control_point_that_is_checked_again_in_another_block_can_be_cast() {
        let experiment = fixtures::experiment_of("scenes = ['scenes/triangle.toml']\nbaselines = ['serial']");
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let plan = Plan::new(&experiment, 0);
        let key = key_of(drafter, (&plan, 0), None);
        let folder = folder_of_images();
        let checker = Checker::open(drafter, None, Pictures::of(folder.path())).unwrap();
        let mut handler = RequestHandler::new(drafter, plan, checker, None);
        for block in [1, 2] {
            let request = Request::Check { point: 0, key: key.clone(), verified: None };
            let checked = handler.answer(&request);
            assert!(matches!(checked, Ok(Reply::Checked { ready: true, .. })), "block {block}: {checked:?}");
            let cast = handler.answer(&Request::Cast { point: 0 });
            assert!(matches!(cast, Ok(Reply::Sample(_))), "block {block}: {cast:?}");
        }
    }

    #[test]
    fn the_run_is_told_when_a_check_loads_a_scene_casts_and_compares() {
        let experiment = fixtures::experiment_of("scenes = ['scenes/triangle.toml']\nbaselines = ['serial']");
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let plan = Plan::new(&experiment, 0);
        let key = key_of(drafter, (&plan, 0), None);
        let folder = folder_of_images();
        let phases = Rc::new(RefCell::new(Vec::new()));
        let told = Rc::clone(&phases);
        let checker = Checker::open(drafter, None, Pictures::of(folder.path())).unwrap();
        let checker = checker.telling(move |phase| told.borrow_mut().push(phase));
        let mut handler = RequestHandler::new(drafter, plan, checker, None);
        let mut check = |verified: Option<String>| {
            let checked = handler.answer(&Request::Check { point: 0, key: key.clone(), verified });
            let Ok(Reply::Checked { record, ready: true }) = checked else { panic!("{checked:?}") };
            (record.image_hash, phases.take())
        };
        let (hash, of_the_first_check) = check(None);
        assert_eq!(of_the_first_check, [Phase::Host, Phase::Cast, Phase::Host]);
        // The scene is loaded already, and the picture has been compared.
        assert!(check(hash).1.is_empty());
        assert_eq!(check(None).1, [Phase::Host]);
    }

    #[test]
    fn a_sample_has_processor_time_where_processors_cast_it() {
        let on_processors = sample(DeviceKind::Cpu, None);
        assert!(on_processors.processor_ms.is_some() && on_processors.batch.is_none(), "{on_processors:?}");
        assert_eq!(sample(DeviceKind::Gpu, None).processor_ms, None);
    }

    #[test]
    fn the_anchor_has_processor_time_where_processors_cast_it() {
        let experiment = fixtures::experiment_of(&format!("scenes = ['scenes/triangle.toml']\n{NAIVE}"));
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let mut device = discover(&Sources::Embedded).unwrap().remove(0);
        let folder = tempfile::tempdir().unwrap();
        for (kind, is_known) in [(DeviceKind::Cpu, true), (DeviceKind::Gpu, false)] {
            device.info.kind = kind;
            let checker = Checker::open(drafter, Some(&device), Pictures::of(folder.path())).unwrap();
            let plan = Plan::new(&experiment, 1);
            let answer = RequestHandler::new(drafter, plan, checker, None).answer(&Request::Anchor).unwrap();
            let Reply::Sample(times) = answer else { panic!("{answer:?}") };
            assert_eq!(times.processor_ms.is_some(), is_known, "{times:?}");
        }
    }

    #[test]
    fn a_coarse_timer_times_batches_even_without_a_warm_up() {
        // Each pass of a sample should take at least fifty steps of the device's timer, here fifty steps of 1000 s. The
        // test's frames are so short, even on a busy machine, that the batch gets the largest number of frames, 256.
        let batch = sample(DeviceKind::Cpu, Some(1_000_000_000_000));
        assert_eq!(batch.batch, Some(256));
        // Processor time and elapsed time are both per frame. The test allows up to 1000 times as much processor time
        // as elapsed time, since hardly any machine has more than 1000 processors.
        let most_ms = 1e3 * batch.host_ms;
        assert!(batch.processor_ms.is_some_and(|ms| ms < most_ms), "{batch:?}");
        assert_eq!(sample(DeviceKind::Cpu, Some(1)).batch, None);
    }

    #[test]
    fn a_caster_on_the_host_casts_single_frames_whatever_the_timer_of_its_workers_device() {
        // A sample's processor time is divided by its number of frames. The function `served` checks that a
        // sample which is not a batch has one frame.
        let times = sample_of("baselines = ['serial']", DeviceKind::Gpu, Some(1_000_000_000));
        assert!(times.batch.is_none() && times.processor_ms.is_some(), "{times:?}");
    }

    #[test]
    fn processor_time_is_in_milliseconds() {
        let least = std::time::Duration::from_millis(5);
        let busy = || {
            let begin = processor_time();
            while processor_time().saturating_sub(begin) < least {
                std::hint::spin_loop();
            }
        };
        let before = processor_time();
        let ((), used_ms) = with_processor_ms(None, busy);
        let most_ms = processor_time().saturating_sub(before).as_secs_f64() * 1e3;
        assert!(used_ms.is_some_and(|ms| (4.999..most_ms + 1e-3).contains(&ms)), "{used_ms:?} {most_ms}");
    }
}
