//! Tests of builders (processes that compile programs before points need the programs): for which points
//! builders build programs, and what happens if builders die.

use super::*;
use crate::device::DeviceKind;
use crate::device::tests::example;
use crate::experiment::pending::PendingPoint;
use crate::experiment::protocol::{Reply, Request};
use crate::experiment::waiting::{Death, Spawner, Wait, Worker};
use crate::program::StoredProgram;
use crate::record::Record;
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

/// A time limit that is far longer than anything in these tests takes.
const LIMIT: Duration = Duration::from_secs(120);

/// Builders that record the points for which they build programs. A builder dies when it builds the program
/// of the point `deadly`.
#[derive(Clone, Default)]
struct Noting {
    built: Arc<Mutex<Vec<usize>>>,
    /// The numbers of processes that were started, and of processes that have ended.
    started: Arc<AtomicUsize>,
    ended: Arc<AtomicUsize>,
    deadly: Option<usize>,
    /// The point whose program the driver takes from its own cache, without the compiler's
    /// messages.
    unlogged: Option<usize>,
}

struct Fake {
    of: Noting,
    answer: Wait,
}

impl Spawner for Noting {
    fn spawn(&mut self, _job: usize) -> Result<Box<dyn Worker>> {
        self.started.fetch_add(1, Ordering::Relaxed);
        Ok(Box::new(Fake { of: self.clone(), answer: Wait::Reply(Reply::Started) }))
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        self.of.ended.fetch_add(1, Ordering::Relaxed);
    }
}

impl Worker for Fake {
    fn send(&mut self, request: &Request) {
        let Request::Build { point } = request else { return };
        self.of.built.lock().unwrap().push(*point);
        let key = Some(format!("the program of point {point}"));
        let lacks_log = self.of.unlogged == Some(*point);
        let key = key.filter(|_| !lacks_log);
        let built = Built { build_ms: 1000.0, from_cache: *point == 0, key, lacks_log };
        self.answer = match self.of.deadly == Some(*point) {
            true => Wait::Dead(Death::default()),
            false => Wait::Reply(Reply::Built(Some(built))),
        };
    }

    fn wait(&mut self, _limit: Duration) -> Wait {
        self.answer.clone()
    }
}

fn open(point: usize, scene: usize, program: &str, traversal: &str) -> PendingPoint {
    let record = Record {
        program_hash: Some(program.to_owned()),
        strategy: format!("traversal={traversal}"),
        device: "a device".to_owned(),
        scene_hash: Some(format!("scene {scene}")),
        ..Record::default()
    };
    PendingPoint::new([point, 0, scene], String::new(), record)
}

fn builder(usual: &Noting, without_driver_cache: &Noting) -> Builder {
    Builder { usual: Box::new(usual.clone()), without_driver_cache: Box::new(without_driver_cache.clone()) }
}

/// Requests the programs of groups of points, one group after the other. Returns three results: for which
/// points builders built programs, which points received a built program, and how many programs were compiled
/// or taken from the cache.
fn built(deadly: Option<usize>, groups: &mut [Vec<PendingPoint>]) -> (Vec<usize>, Vec<usize>, Tally) {
    built_by(&Ahead::default(), deadly, groups)
}

fn built_by(
    ahead: &Ahead,
    deadly: Option<usize>,
    groups: &mut [Vec<PendingPoint>],
) -> (Vec<usize>, Vec<usize>, Tally) {
    let (noting, never) = (Noting { deadly, ..Noting::default() }, AtomicBool::new(false));
    let builders = (0..3).map(|_| builder(&noting, &noting)).collect();
    let work = || groups.iter_mut().flatten().for_each(|point| ahead.need(point, &never).unwrap());
    ahead.beside(builders, LIMIT, &never, work).unwrap();
    let with = groups
        .iter()
        .flatten()
        .filter(|pending| pending.built.is_some())
        .map(|pending| pending.point)
        .collect();
    let mut points = noting.built.lock().unwrap().clone();
    points.sort_unstable();
    (points, with, ahead.tally())
}

#[test]
fn a_program_is_built_once_and_one_of_a_tree_for_each_scene() {
    let group = |first, scene| {
        let (all, tree) = ("exhaustive", "bvh");
        vec![
            open(first, scene, "a", all),
            open(first + 1, scene, "b", all),
            open(first + 2, scene, "c", tree),
        ]
    };
    let (points, with, tally) = built(None, &mut [group(0, 0), group(3, 1)]);
    assert_eq!((points, with), (vec![0, 1, 2, 5], vec![0, 1, 2, 5]));
    assert_eq!((tally.compiled, tally.from_cache), (3, 1));
    let text = tally.text().unwrap();
    assert!(
        text.starts_with("Built: 3 programs compiled, 1 taken from the cache; this took 4.0 s of work"),
        "{text}"
    );
    assert_eq!(Tally::default().text(), None);
    let text = Tally { compiled: 1, from_cache: 2, work_ms: 1500.0, waited_ms: 500.0 }.text().unwrap();
    assert_eq!(
        text,
        "Built: 1 program compiled, 2 taken from the cache; this took 1.5 s of work in all, and the run waited 0.5 s for programs"
    );
    assert!(Tally { from_cache: 1, ..Tally::default() }.text().is_some());
}

#[test]
fn programs_are_built_in_the_order_of_their_points_and_a_wait_for_one_is_counted() {
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut points: Vec<PendingPoint> =
        (0..4).map(|point| open(point, 0, &format!("program {point}"), "exhaustive")).collect();
    let ahead = Ahead::default();
    let start = Instant::now();
    let work = || {
        ahead.order(points.iter());
        ahead.need(&mut points[3], &never).unwrap();
    };
    ahead.beside(vec![builder(&noting, &noting)], LIMIT, &never, work).unwrap();
    assert_eq!(*noting.built.lock().unwrap(), [0, 1, 2, 3]);
    let waited_ms = ahead.tally().waited_ms;
    assert!(0.0 < waited_ms && waited_ms <= ms_since(start), "{waited_ms} ms");
}

#[test]
fn a_run_that_ends_builds_nothing_more() {
    let ahead = Ahead::default();
    ahead.order(&[open(0, 0, "a", "exhaustive"), open(1, 0, "b", "exhaustive")]);
    assert_eq!(ahead.next(0).map(|order| order.point), Some(0));
    drop(Closing(&ahead));
    assert!(ahead.next(0).is_none() && !ahead.has_next(0));
}

/// Lets one builder build two programs one after the other. `scenes` is the number of builders whose scenes
/// would fit into memory. After the first program, waits until `ends[0]` of the builder's processes have
/// ended. After the second program, waits until `ends[1]` of the builder's processes have ended. Returns the
/// number of processes that were started.
fn processes(scenes: usize, ends: [usize; 2]) -> usize {
    let (noting, never, ahead) = (Noting::default(), AtomicBool::new(false), Ahead::default());
    let work = || {
        for (point, program) in ["a", "b"].into_iter().enumerate() {
            let room = Room { builders: 1, scenes };
            let mut pending = PendingPoint { room, ..open(point, 0, program, "exhaustive") };
            ahead.need(&mut pending, &never).unwrap();
            let start = Instant::now();
            while noting.ended.load(Ordering::Relaxed) < ends[point] {
                assert!(start.elapsed() < LIMIT, "an idle process stays");
                std::thread::yield_now();
            }
        }
    };
    ahead.beside(vec![builder(&noting, &noting)], LIMIT, &never, work).unwrap();
    assert_eq!(*noting.built.lock().unwrap(), [0, 1]);
    noting.started.load(Ordering::Relaxed)
}

#[test]
fn idle_builders_end_their_processes_if_scenes_take_much_memory() {
    assert_eq!(processes(PLENTY - 1, [1, 2]), 2);
    assert_eq!(processes(PLENTY, [0, 0]), 1);
}

#[test]
fn only_as_many_builders_as_fit_into_memory_hold_a_scene() {
    let ahead = Ahead::default();
    let large = PendingPoint { room: Room { builders: 2, scenes: 2 }, ..open(0, 0, "a", "exhaustive") };
    ahead.order(&[large, open(1, 1, "b", "exhaustive")]);
    let next = |number: usize| ahead.next(number).map(|order| order.point);
    assert_eq!([next(2), next(2), next(1)], [Some(1), None, Some(0)]);
}

#[test]
fn no_program_is_begun_on_a_device_on_which_another_process_measures() {
    let devices = [LockName::of(None)];
    let ahead = Ahead::new(Vec::new(), devices.to_vec());
    ahead.order(&[open(0, 0, "a", "exhaustive"), open(1, 0, "b", "exhaustive")]);
    let next = || ahead.next(0).map(|order| order.point);
    assert_eq!(next(), None, "the run has not had the device's lock yet");
    ahead.go_on(&devices);
    assert_eq!(next(), Some(0));
    ahead.pause(&devices);
    assert_eq!(next(), None);
    ahead.go_on(&devices);
    assert_eq!(next(), Some(1));
}

#[test]
fn a_gpu_that_two_drivers_list_is_paused_for_both() {
    let locks = ["Intel", "rusticl"].map(|platform| {
        let mut gpu = example(platform, "Arc", DeviceKind::Gpu, 32);
        gpu.label = format!("Arc ({platform})");
        gpu.hardware.uuid = Some("00ff".into());
        LockName::of(Some(&gpu))
    });
    let ahead = Ahead::new(Vec::new(), locks.to_vec());
    let may_build = || [0, 1].map(|job| ahead.may_build_on(job));
    assert_eq!(may_build(), [false; 2]);
    ahead.go_on(&locks[..1]);
    assert_eq!(may_build(), [true; 2]);
    ahead.pause(&locks[1..]);
    assert_eq!(may_build(), [false; 2]);
}

/// A program that traverses a tree is compiled for one scene and for one way of building trees. Two versions
/// of raycl that build trees in different ways must not share stored programs, so they give these programs
/// different names.
#[test]
fn the_name_of_a_trees_program_has_the_scene_and_the_kind_of_tree() {
    let name =
        |scene: Option<&str>| Program { job: 0, hash: "hash".into(), scene: scene.map(str::to_owned) }.name();
    assert_eq!(name(Some("scene 1")), format!("hash scene 1 {FINGERPRINT}"));
    assert!(!name(None).contains(FINGERPRINT), "{}", name(None));
}

#[test]
fn a_builder_that_dies_costs_its_program_and_nothing_waits_for_ever() {
    let group =
        vec![open(0, 0, "a", "exhaustive"), open(1, 0, "b", "exhaustive"), open(2, 0, "c", "exhaustive")];
    let (points, with, tally) = built(Some(1), &mut [group]);
    assert_eq!((points, with), (vec![0, 1, 2], vec![0, 2]));
    assert_eq!(tally.compiled + tally.from_cache, 2);
}

#[test]
fn a_program_of_the_driver_s_cache_is_compiled_again_for_its_messages_and_no_other_is() {
    let (usual, again) = (Noting { unlogged: Some(1), ..Noting::default() }, Noting::default());
    let never = AtomicBool::new(false);
    let mut points = [open(0, 0, "a", "exhaustive"), open(1, 0, "b", "exhaustive")];
    let ahead = Ahead::default();
    let work = || points.iter_mut().for_each(|point| ahead.need(point, &never).unwrap());
    ahead.beside(vec![builder(&usual, &again)], LIMIT, &never, work).unwrap();
    assert_eq!(*usual.built.lock().unwrap(), [0, 1]);
    assert_eq!(*again.built.lock().unwrap(), [1]);
    assert!(points.iter().all(|point| point.built.as_ref().is_some_and(|built| built.key.is_some())));
    assert_eq!(ahead.tally().compiled + ahead.tally().from_cache, 2);
}

#[test]
fn casters_on_the_host_and_points_that_do_not_fit_have_no_program_and_ctrl_c_ends_the_wait() {
    let (never, now) = (AtomicBool::new(false), AtomicBool::new(true));
    let mut host = open(0, 0, "a", "exhaustive");
    host.record.device = crate::record::HOST.to_owned();
    let ahead = Ahead::default();
    let mut too_large = PendingPoint { fits: false, ..open(2, 0, "c", "exhaustive") };
    for point in [&mut host, &mut too_large] {
        ahead.need(point, &never).unwrap();
    }
    let error = ahead.need(&mut open(1, 0, "b", "exhaustive"), &now).unwrap_err();
    assert_eq!(error.exit_code(), 130);
}

#[test]
fn what_an_earlier_run_has_stored_needs_no_builder() {
    let folder = tempfile::tempdir().unwrap();
    let device = example("PoCL", "cpu", DeviceKind::Cpu, 2);
    let stored = ProgramCache::of(crate::cache::Cache::at(folder.path(), 1 << 20), &device);
    let group = |scene| vec![open(0, scene, "a", "exhaustive"), open(1, scene, "b", "bvh")];
    let run = |scene| built_by(&Ahead::new(vec![stored.clone()], Vec::new()), None, &mut [group(scene)]);
    assert_eq!(run(0).0, [0, 1]);
    assert_eq!(run(0).0, [0, 1], "no program has been stored yet, so builders build both again");
    for point in [0, 1] {
        let program = StoredProgram { log: String::new(), binary: vec![1] };
        stored.store(&format!("the program of point {point}"), &program);
    }
    let (points, with, tally) = run(0);
    assert_eq!((points, with, tally.from_cache, tally.compiled), (vec![], vec![], 2, 0));
    assert_eq!(run(1).0, [1], "the tree of another scene may need another program");
}
