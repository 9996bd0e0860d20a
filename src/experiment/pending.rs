//! The points of a plan that still have to be measured, each with the results so far.

use super::ahead::{Needs, Order, Program, Room};
use super::check::SMALLEST;
use super::draft::{Drafter, HeldScene};
use super::piece::Piece;
use super::supervisor::Task;
use super::taken::Taken;
use super::{Built, Plan, Point, Run, Work, host};
use crate::config::Experiment;
use crate::device::DeviceInfo;
use crate::error::Result;
use crate::memory::Available;
use crate::program::Sources;
use crate::record::{Outcome, PlannedPoint, Record};
use crate::scene::{Sampling, Scene};
use crate::strategy::{Requirements, Values, Workload};
use std::collections::HashMap;

/// A point that still has to be measured.
pub struct PendingPoint {
    /// The point's index in the plan.
    pub point: usize,
    /// The number of the job (see [`Run::jobs`]) whose worker casts the point.
    pub job: usize,
    /// The number of the point's scene in the experiment's list of scenes.
    pub scene: usize,
    /// The name of the point that is shown to the user while the point is measured.
    pub label: String,
    /// The point's record, which holds what is known about the point so far.
    pub record: Record,
    /// The sizes and features from which the memory that the point needs is computed; `None` for a caster on
    /// the host.
    pub workload: Option<Workload>,
    /// Why the point is not measured, if its preset is meant for another kind of device; otherwise `None`.
    pub not_for: Option<String>,
    /// True if the point fits on the device, as far as that is known before a tree is built. A caster on the host fits
    /// if it can cast the scene's number of samples per pixel. If the point does not fit, its program is not built, and
    /// the check of the point reports the reason.
    pub fits: bool,
    /// How many builders (groups of processes that hold the point's scene while they compile programs) fit into memory.
    pub room: Room,
    /// The result of building the program with which the point is measured. If several points use the program, only one
    /// of these points receives the result.
    pub built: Option<Built>,
    /// The hash of the point's picture, once the picture has been compared with the reference.
    pub verified: Option<String>,
    /// The point's samples from complete launches.
    pub taken: Vec<Taken>,
}

impl PendingPoint {
    /// Makes a pending point from the numbers of the point, of the point's job and of the point's scene. `label` is the
    /// point's name as shown to the observer. `record` is the point's record before the point is tried.
    pub fn new([point, job, scene]: [usize; 3], label: String, record: Record) -> Self {
        Self {
            point,
            job,
            scene,
            label,
            record,
            workload: None,
            not_for: None,
            fits: true,
            room: Room::UNLIMITED,
            built: None,
            verified: None,
            taken: Vec::new(),
        }
    }

    /// Returns the data about the point that a request to a worker contains.
    pub fn task(&self) -> Task<'_> {
        let (key, verified) = (&self.record.key, self.verified.as_deref());
        Task { point: self.point, job: self.job, scene: self.scene, key, verified }
    }

    /// Returns true if the point fits now, but exceeded a limit of the device according to an earlier record.
    /// A limit of a device may differ from session to session, so the earlier record does not show whether
    /// the point fits in this session.
    pub fn fits_meanwhile(&self, earlier: &Record) -> bool {
        self.fits && earlier.is_of_the_session()
    }

    /// Returns the final record of this point, which cannot be cast now; `record` is the point's record, and states the
    /// reason. A point that has been cast before fits on the device. If such a point is now `Infeasible`, the point
    /// lacks only memory that other programs or other points use at the moment, and gets the outcome `LaunchFailed`
    /// instead. With the outcome `Infeasible`, nobody would notice that the point has lost its earlier launches.
    pub fn refused(&self, record: Record) -> Record {
        let was_cast = self.verified.is_some() || !self.taken.is_empty();
        match record.outcome {
            Outcome::Infeasible if was_cast => Record { outcome: Outcome::LaunchFailed, ..record },
            _ => record,
        }
    }
}

impl Needs for PendingPoint {
    fn order(&self) -> Option<Order> {
        let hash = self.record.program_hash.clone().filter(|_| self.fits && !self.record.is_baseline())?;
        let scene = self.record.scene_hash.clone().filter(|_| self.record.walks_tree());
        let program = Program { job: self.job, hash, scene };
        Some(Order { program, point: self.point, room: self.room })
    }

    fn hears(&mut self, built: Option<Built>) {
        self.built = built;
    }
}

impl Run<'_> {
    /// Returns all points of all devices and of the host. Each point is returned with its index in the plan for
    /// one device, its device (`None` is the host), and the key and names of its record.
    pub fn planned_points(&self) -> Result<Vec<(usize, Option<usize>, PlannedPoint)>> {
        let plan = self.plan();
        let of: HashMap<usize, (usize, Option<usize>)> =
            plan.indices_on_devices().into_iter().map(|(of, number)| (number, of)).collect();
        let groups = self.pending_points(&plan, &plan.by_device())?;
        let planned = |pending: &PendingPoint| {
            let (index, device) = of.get(&pending.point)?;
            Some((*index, *device, PlannedPoint::of(&pending.record)))
        };
        Ok(groups.iter().flatten().filter_map(planned).collect())
    }

    /// Returns why a point is not measured on a device, if its preset is meant for another kind of device;
    /// otherwise `None`. If the point's strategy has several names in the experiment, the point is measured
    /// if one of these names is meant for the device.
    pub(super) fn not_for(&self, point: &Point, device: Option<&DeviceInfo>) -> Option<String> {
        let Work::Kernel { strategy, local_size } = point.work else { return None };
        let kind = device?.kind;
        let names = self.experiment.names_of(strategy, local_size);
        let reasons: Option<Vec<String>> = names.map(|named| named.not_for(kind)).collect();
        reasons?.into_iter().next()
    }

    /// Returns true if a point fits on a device, as far as that is known before a tree is built. A caster on the host
    /// fits if it can cast the scene's number of samples per pixel.
    fn fits(&self, point: &Point, device: Option<&DeviceInfo>, workload: Option<&Workload>) -> bool {
        let strategy = match point.work {
            Work::Kernel { strategy, .. } => strategy,
            Work::Host(baseline) => {
                return host::refusal(baseline, &self.experiment.scenes[point.scene].sampling()).is_none();
            }
        };
        let Some((device, workload)) = device.zip(workload) else { return true };
        let limits = self.experiment.emulate.apply(device.limits);
        Requirements::check(&self.experiment.strategies[strategy].strategy, workload, &limits).is_ok()
    }

    /// Returns how many builders (groups of processes that hold the point's scene while they compile programs) fit into
    /// memory. `available_bytes` is the available memory of the host.
    fn room(&self, point: &Point, device: Option<&DeviceInfo>, scene: &Scene, available_bytes: u64) -> Room {
        let (Work::Kernel { strategy, local_size }, Some(device)) = (point.work, device) else {
            return Room::UNLIMITED;
        };
        let sampling = self.experiment.scenes[point.scene].sampling();
        let workload = Workload::of(scene, SMALLEST, local_size).sampled(scene, &sampling);
        let strategy = &self.experiment.strategies[strategy].strategy;
        let processes = [self.devices.len(), self.all_sources().count()];
        Room::of(strategy, &workload, &device.limits, available_bytes, processes)
    }

    /// Returns true if the point is measured on the host, or on every kind of device (CPUs, GPUs and others).
    pub(super) fn is_for_every_kind(&self, point: &Point) -> bool {
        match point.work {
            Work::Kernel { strategy, local_size } => {
                self.experiment.names_of(strategy, local_size).any(|named| named.meant_for.is_none())
            }
            Work::Host(_) => true,
        }
    }

    /// Returns the points of these pieces (parts of the plan whose points are measured together), one list
    /// per piece. The lists also contain points that already have a result, and points that will not be
    /// measured (see `not_for` and `fits`). Only one scene at a time is in memory while the points' records
    /// are drafted.
    pub(super) fn pending_points(&self, plan: &Plan, pieces: &[Piece]) -> Result<Vec<Vec<PendingPoint>>> {
        let kernels = self.kernels()?;
        let available_bytes = self.ahead.map(|_| Available::read().bytes);
        let mut groups = Vec::new();
        let mut held = HeldScene::default();
        for piece in pieces {
            let mut points = Vec::new();
            for number in piece.point_indices() {
                let point = &plan.points[number];
                let at = held.of(self.experiment, point)?;
                let device = point.device.map(|device| self.devices[device]);
                let sampling = self.experiment.scenes[point.scene].sampling();
                let workload = workload_of(point, (&at.scene, sampling));
                for (folder_index, kernels) in of_point(&kernels, point).iter().enumerate() {
                    let drafter = &kernels.drafter;
                    let draft =
                        || (drafter.draft(point, device, at), self.fits(point, device, workload.as_ref()));
                    let (record, fits) = kernels.during(draft);
                    let room_of = |bytes| self.room(point, device, &at.scene, bytes);
                    let room = kernels.during(|| available_bytes.map_or(Room::UNLIMITED, room_of));
                    let mut record = record?;
                    record.block = piece.block;
                    record.is_control = piece.borrows(number);
                    let of = kernels.label_of(point);
                    of.into_iter().for_each(|label| of_kernels(&mut record, label));
                    // Casters on the host have no device, so any worker can run them. If there are devices,
                    // the first device's worker runs the casters on the host.
                    let job = point.device.unwrap_or(0) + folder_index * self.devices.len().max(1);
                    let label = kernels.named(point, self.experiment);
                    let mut drafted = PendingPoint::new([number, job, point.scene], label, record);
                    drafted.not_for = self.not_for(point, device);
                    (drafted.workload, drafted.fits, drafted.room) = (workload, fits, room);
                    points.push(drafted);
                }
            }
            if piece.control.is_some() {
                let key = points.first().map(|pending| pending.record.key.clone());
                points.iter_mut().for_each(|pending| pending.record.control.clone_from(&key));
            }
            groups.push(points);
        }
        Ok(groups)
    }
}

/// Returns the sizes and features from which the memory that a point of the experiment needs is computed;
/// `None` for a caster on the host.
fn workload_of(point: &Point, (scene, sampling): (&Scene, Sampling)) -> Option<Workload> {
    match point.work {
        Work::Kernel { local_size, .. } => {
            Some(Workload::of(scene, point.image_size, local_size).sampled(scene, &sampling))
        }
        Work::Host(_) => None,
    }
}

/// One of the folders from which the run takes its kernels (two folders if the run compares them).
pub(super) struct Kernels<'a> {
    drafter: Drafter<'a>,
    /// If two folders of kernels are compared: this folder's label, and the values of axes that the headers
    /// of the folder's kernel files define. Workers that cast with the kernels of a folder read only that
    /// folder's headers.
    compared: Option<(String, Values)>,
}

impl Run<'_> {
    /// Returns the run's folder of kernels or, if the run compares two folders, both folders.
    pub(super) fn kernels(&self) -> Result<Vec<Kernels<'_>>> {
        let of = |sources| Drafter { experiment: self.experiment, sources };
        let Some(other) = self.other_sources else {
            return Ok(vec![Kernels { drafter: of(self.sources), compared: None }]);
        };
        let labelled = self.all_sources().zip(labels([self.sources, other]));
        labelled
            .map(|(one, label)| Ok(Kernels { drafter: of(one), compared: Some((label, one.values()?)) }))
            .collect()
    }

    /// Returns the folder of kernels with which `pending` is measured. `kernels` contains all folders of
    /// kernels that the run uses.
    pub(super) fn kernels_of<'k, 'a>(
        &self,
        pending: &PendingPoint,
        kernels: &'k [Kernels<'a>],
    ) -> &'k Kernels<'a> {
        &kernels[pending.job / self.devices.len().max(1)]
    }
}

/// Returns the folders of kernels with which a point is measured. A caster on the host uses no kernels, so
/// only one folder is returned, and the caster is measured once.
fn of_point<'k, 'a>(kernels: &'k [Kernels<'a>], point: &Point) -> &'k [Kernels<'a>] {
    let count = if point.device.is_some() { 2 } else { 1 };
    &kernels[..count.min(kernels.len())]
}

impl Kernels<'_> {
    /// Calls `work`. During this call, the values of axes have the properties that the headers of this folder's kernel
    /// files state.
    pub(super) fn during<R>(&self, work: impl FnOnce() -> R) -> R {
        match &self.compared {
            Some((_, values)) => values.during(work),
            None => work(),
        }
    }

    /// Returns the folder's label, if two folders are compared and the point uses kernels.
    fn label_of(&self, point: &Point) -> Option<&str> {
        self.compared.as_ref().filter(|_| point.device.is_some()).map(|(label, _)| label.as_str())
    }

    /// Formats a point of the experiment for progress and logs, with the folder's label if two folders of
    /// kernels are compared: "teapot 800x500 naive 16x16 (mine)".
    fn named(&self, point: &Point, experiment: &Experiment) -> String {
        let label = self.label_of(point).map_or(String::new(), |label| format!(" ({label})"));
        point.label(experiment) + &label
    }
}

/// Returns the labels of two folders of kernels that are compared. A label in the name of a measured point
/// shows from which folder the point's kernels come.
fn labels(sources: [&Sources; 2]) -> [String; 2] {
    let name = |sources: &Sources| match sources {
        Sources::Embedded => "built in".to_owned(),
        Sources::Folder(folder) => {
            let name = folder.file_name().map(|name| name.to_string_lossy().into_owned());
            name.unwrap_or_else(|| folder.display().to_string())
        }
    };
    let [one, other] = sources.map(name);
    if one == other { [format!("{one}, A"), format!("{other}, B")] } else { [one, other] }
}

/// If two folders of kernels are compared, labels a point with the folder that the point uses. If folders are
/// compared, a point's record names no preset (a strategy to which raycl gives a name), since a preset's name
/// implies the built-in kernels.
fn of_kernels(record: &mut Record, label: &str) {
    record.name = format!("{} ({label})", record.name);
    record.preset = None;
    record.kernels_of = Some(label.to_owned());
}

#[cfg(test)]
mod tests {
    use super::super::ahead::Ahead;
    use super::super::asleep;
    use super::*;
    use crate::experiment::fixtures;
    use crate::launch::FrameTimes;

    #[test]
    fn all_blocks_of_a_group_name_the_same_control_point() {
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let experiment = fixtures::experiment("local_sizes = [1, 2, 4, 8]");
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let piece = |number, points: [usize; 2]| Piece {
            points: points.to_vec(),
            block: Some(number),
            control: Some(1),
        };
        let groups = run.pending_points(&run.plan(), &[piece(1, [0, 1]), piece(2, [2, 3])]).unwrap();
        let records: Vec<&Record> = groups.iter().flatten().map(|pending| &pending.record).collect();
        // The second block also measures the control point, whose local size is 2, so this block has three
        // points.
        let sides: Vec<_> = records.iter().map(|record| record.local_size.unwrap()[0]).collect();
        assert_eq!(sides, [2, 1, 2, 4, 8]);
        let control = Some(&records[0].key);
        assert!(records.iter().all(|record| record.control.as_ref() == control), "{records:?}");
    }

    #[test]
    fn only_kernels_are_meant_for_kinds_of_devices() {
        // The device in this test is a GPU.
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let entries = "baselines = ['serial']\nlocal_sizes = [4]\n[[strategy]]\npreset = 'wide'";
        let experiment = fixtures::experiment(entries);
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let plan = run.plan();
        let groups = run.pending_points(&plan, &plan.by_device()).unwrap();
        let actual: Vec<_> =
            groups.iter().flatten().map(|one| (one.record.name.as_str(), one.not_for.as_deref())).collect();
        let reason = "meant for CPUs; to measure the strategy on this device too, set any_kind = true in the \
            experiment, or in the strategy's [[strategy]] entry";
        assert_eq!(actual, [("serial", None), ("naive", None), ("wide", Some(reason))]);
    }

    #[test]
    fn a_strategy_of_two_names_has_the_first_one_on_all_devices_for_which_one_of_them_is_meant() {
        // The device in this test is a GPU.
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let any = "[[strategy]]\nname = 'any'\npreset = 'wide'\nlocal_sizes = [4]\nany_kind = true";
        let experiment = fixtures::experiment_of(&format!(
            "scenes = ['scenes/triangle.toml']\n[[strategy]]\npreset = 'wide'\nlocal_sizes = [4, 8]\n{any}"
        ));
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let plan = run.plan();
        let groups = run.pending_points(&plan, &plan.by_device()).unwrap();
        let actual: Vec<_> = groups
            .iter()
            .flatten()
            .map(|one| {
                let is_for_every_kind = run.is_for_every_kind(&plan.points[one.point]);
                (one.label.as_str(), one.not_for.is_none(), is_for_every_kind)
            })
            .collect();
        assert_eq!(actual, [("triangle 8x5 wide 4x4", true, true), ("triangle 8x5 wide 8x8", false, false)]);
    }

    #[test]
    fn two_folders_of_kernels_are_measured_on_devices_and_not_on_the_host() {
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let experiment = fixtures::experiment("baselines = ['serial']\nlocal_sizes = [4]");
        let devices = [&device];
        let plain = fixtures::run(&experiment, &devices, &locks);
        let names = |run: &Run<'_>| {
            let plan = run.plan();
            let groups = run.pending_points(&plan, &plan.by_device()).unwrap();
            let name = |one: &PendingPoint| (one.record.name.clone(), one.job);
            groups.iter().flatten().map(name).collect::<Vec<_>>()
        };
        let named = |name: &str, worker: usize| (name.to_owned(), worker);
        assert_eq!(names(&plain), [named("serial", 0), named("naive", 0)]);
        let both = Run { other_sources: Some(&Sources::Embedded), ..plain };
        let expected = [named("serial", 0), named("naive (built in, A)", 0), named("naive (built in, B)", 1)];
        assert_eq!(names(&both), expected);
        let plan = both.plan();
        let groups = both.pending_points(&plan, &plan.by_device()).unwrap();
        let actual = groups
            .iter()
            .flatten()
            .map(|one| (one.label.as_str(), one.record.preset.as_deref(), one.record.kernels_of.as_deref()));
        let expected = [
            ("triangle 8x5 host serial-f32", None, None),
            ("triangle 8x5 naive 4x4 (built in, A)", None, Some("built in, A")),
            ("triangle 8x5 naive 4x4 (built in, B)", None, Some("built in, B")),
        ];
        assert_eq!(actual.collect::<Vec<_>>(), expected);
        let two = [&device, &device];
        let workers: Vec<usize> =
            names(&Run { devices: &two, ..both }).into_iter().map(|(_, worker)| worker).collect();
        assert_eq!(workers, [0, 0, 2, 1, 3], "the workers with the other folder follow the first ones");
        let folders = ["a/cl", "b/cl", "b/mine"].map(|path| Sources::Folder(path.into()));
        assert_eq!(labels([&folders[0], &folders[1]]), ["cl, A", "cl, B"]);
        assert_eq!(labels([&folders[2], &Sources::Embedded]), ["mine", "built in"]);
    }

    #[test]
    fn each_folder_of_kernels_drafts_its_points_by_its_own_headers() {
        let file = "cast/intersect/moller_trumbore.cl";
        let text = Sources::Embedded.read(file).unwrap();
        let folders = ["a", "b"].map(|_| tempfile::tempdir().unwrap());
        let sources = [0, 1].map(|index| {
            let folder = folders[index].path();
            std::fs::create_dir_all(folder.join("cast/intersect")).unwrap();
            let floats = ["// record_floats: 20\n", "// record_floats: 16\n"][index];
            let operations = ["// operations: 40\n", "// operations: 30\n"][index];
            let text = text.replace("// record_floats: 12\n", floats);
            std::fs::write(folder.join(file), text.replace("// operations: 15\n", operations)).unwrap();
            Sources::Folder(folder.to_owned())
        });
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let experiment = fixtures::experiment("local_sizes = [4]");
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let drafts = |run: &Run<'_>| -> Vec<(String, Option<u32>)> {
            let plan = run.plan();
            let groups = run.pending_points(&plan, &plan.by_device()).unwrap();
            let records = groups.into_iter().flatten().map(|pending| pending.record);
            records.map(|record| (record.key, record.operations_per_test)).collect()
        };
        // A worker reads the headers of one folder of kernels only. The worker's drafts (records of points
        // that are not tried yet) must equal the run's drafts, although the run reads both compared folders
        // of kernels.
        let of_worker = |sources: &Sources| {
            sources.values().unwrap().during(|| drafts(&Run { sources, ..run })).remove(0)
        };
        let [one, other] = [&sources[0], &sources[1]];
        let both = drafts(&Run { sources: one, other_sources: Some(other), ..run });
        assert_eq!(both, [of_worker(one), of_worker(other)]);
        assert_ne!(both[0].0, both[1].0);
        assert_eq!([both[0].1, both[1].1], [Some(40), Some(30)]);
    }

    #[test]
    fn a_program_is_built_by_as_many_builders_as_fit_into_memory() {
        let (small, locks, ahead) = (asleep::device(1.0), fixtures::own_locks(), Ahead::default());
        let mut tiny = small.clone();
        tiny.limits.global_bytes = 1;
        let experiment = fixtures::experiment("local_sizes = [4]\nbaselines = ['serial']");
        let builders = |device: &DeviceInfo, ahead: Option<&Ahead>| {
            let devices = [device];
            let run = fixtures::run(&experiment, &devices, &locks);
            let run = Run { ahead, ..run };
            let groups = run.pending_points(&run.plan(), &run.plan().whole()).unwrap();
            groups.iter().flatten().map(|pending| pending.room.builders).collect::<Vec<_>>()
        };
        assert_eq!(builders(&tiny, Some(&ahead)), [usize::MAX, 1]);
        assert_eq!(builders(&tiny, None), [usize::MAX; 2], "without builders, memory is not looked at");
        assert!(builders(&small, Some(&ahead))[1] < usize::MAX);
        let record = Record { program_hash: Some("a".into()), ..Record::default() };
        let room = Room { builders: 3, scenes: 4 };
        let pending = PendingPoint { room, ..PendingPoint::new([0; 3], String::new(), record) };
        assert_eq!(pending.order().map(|order| order.room), Some(room));
    }

    #[test]
    fn only_a_point_that_was_never_cast_is_infeasible() {
        let of = |verified: Option<&str>, taken: usize, outcome: Outcome| {
            let times = FrameTimes::whole(1.0, 1.0);
            let sample = Taken { launch: 0, at_ms: 0.0, core_to_core_ns: None, times };
            let mut pending = PendingPoint::new([0; 3], String::new(), Record::default());
            pending.verified = verified.map(str::to_owned);
            pending.taken = vec![sample; taken];
            let refused =
                pending.refused(Record { outcome, reason: Some("why".into()), ..Record::default() });
            assert_eq!(refused.reason.as_deref(), Some("why"));
            refused.outcome
        };
        assert_eq!(of(None, 0, Outcome::Infeasible), Outcome::Infeasible);
        assert_eq!(of(Some("a hash"), 0, Outcome::Infeasible), Outcome::LaunchFailed);
        assert_eq!(of(None, 5, Outcome::Infeasible), Outcome::LaunchFailed);
        assert_eq!(of(Some("a hash"), 5, Outcome::WrongImage), Outcome::WrongImage);
    }

    #[test]
    fn a_program_is_built_only_for_points_that_fit_the_imitated_device() {
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let lines = "local_sizes = [4]\nbaselines = ['serial']\n[[strategy]]\npreset = 'local-vectors'";
        let experiment = fixtures::experiment(&format!("{lines}\n[emulate]\nlocal_bytes = 100"));
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let plan = run.plan();
        let groups = run.pending_points(&plan, &plan.by_device()).unwrap();
        let actual: Vec<_> = groups
            .iter()
            .flatten()
            .map(|one| (one.record.name.as_str(), one.fits, one.order().map(|order| order.point)))
            .collect();
        assert_eq!(
            actual,
            [("serial", true, None), ("naive", true, Some(1)), ("local-vectors", false, None)]
        );
    }
}
