//! A run: an experiment, devices and kernels.

use super::ahead::Ahead;
use super::asleep;
use super::piece::Piece;
use super::protocol::Job;
use super::{Block, Fault, Plan};
use crate::config::Experiment;
use crate::device::DeviceInfo;
use crate::device_lock::Locks;
use crate::error::{Error, Result};
use crate::measure::StoppingRule;
use crate::program::Sources;
use std::ffi::OsStr;
use std::path::Path;
use std::time::Duration;

/// The inputs of a run of an experiment, except the folder of results, the observer, the processes that cast,
/// and the flag that the user sets to interrupt the run.
pub struct Run<'a> {
    /// The experiment that is run.
    pub experiment: &'a Experiment,
    /// The overrides of the experiment's config: dotted keys and their new values.
    pub overrides: &'a [(String, String)],
    /// The devices on which the experiment's points are measured.
    pub devices: &'a [&'a DeviceInfo],
    /// The kernel files with which the points are measured.
    pub sources: &'a Sources,
    /// If two folders of kernels are compared: the kernel files that are measured in the same rounds as those
    /// of `sources`.
    pub other_sources: Option<&'a Sources>,
    /// The time limit for one step of a worker. There are three kinds of steps. In the first, the worker opens its
    /// device. In the second, the worker builds a point's program and casts the point's first image. In the third, the
    /// worker takes one sample of a point or of the anchor. The step of a point's first sample includes the warm-up.
    pub limit: Duration,
    /// True if the run also measures again the points that failed in an earlier session, and the points for which too
    /// little memory was free.
    pub retry_failed: bool,
    /// The locks of devices. While a group of points is timed, no other raycl process measures on the points' devices.
    pub locks: &'a Locks,
    /// True if the points are distributed over several devices of the same model. If false, each device
    /// measures all points.
    pub spread: bool,
    /// The blocks to measure, if the plan is cut into blocks: the blocks of a shard or, with `--spread`, all
    /// blocks.
    pub blocks: Option<&'a [Block]>,
    /// Builds programs before their points are checked. If `None`, the check of a point builds the point's
    /// program.
    pub ahead: Option<&'a Ahead>,
    /// True if raycl's cache stores compiled programs. If false, each launch compiles its programs again.
    pub caches_programs: bool,
    /// True if the run keeps samples whatever their core-to-core latency. If false, groups that are measured on CPUs
    /// leave out samples whose core-to-core latency was far from the run's usual latency. A latency far from the usual
    /// one probably means that the host of a virtual machine has moved the machine's processors to other cores.
    pub keeps_moved_samples: bool,
}

/// If the environment variable `RAYCL_MOVED_SAMPLES` is `keep`, the run keeps samples whatever their core-to-core
/// latency. If `RAYCL_MOVED_SAMPLES` is blank or not set, groups that are measured on CPUs leave out some samples (see
/// [`Run::keeps_moved_samples`]). Other values are mistakes ([`check_moved_samples`]).
pub const MOVED_SAMPLES: &str = "RAYCL_MOVED_SAMPLES";

/// Returns true if the environment variable `RAYCL_MOVED_SAMPLES` is `keep`, so that samples are kept whatever their
/// core-to-core latency.
pub fn keeps_moved_samples() -> bool {
    says_keep(std::env::var_os(MOVED_SAMPLES).as_deref())
}

/// Returns an input error if the value of the environment variable `RAYCL_MOVED_SAMPLES` is neither `keep` nor blank.
pub fn check_moved_samples() -> Result<()> {
    refuse_other_than_keep(std::env::var_os(MOVED_SAMPLES).as_deref())
}

fn refuse_other_than_keep(value: Option<&OsStr>) -> Result<()> {
    let text = value.unwrap_or_default().to_string_lossy();
    match says_keep(value) || text.trim().is_empty() {
        true => Ok(()),
        false => Err(Error::input(format!("{MOVED_SAMPLES}: '{text}' is not 'keep'"))
            .with_help("set it to keep, or unset it")),
    }
}

/// Returns true if a variable's value is `keep`; `value` is `None` if the variable is not set.
fn says_keep(value: Option<&OsStr>) -> bool {
    value.is_some_and(|value| value == "keep")
}

impl Run<'_> {
    /// Makes the plan: the list of all points of the experiment on the run's devices. If the points are distributed
    /// over devices, the plan lists each point once, for the first device.
    pub fn plan(&self) -> Plan {
        Plan::new(self.experiment, self.planned_devices())
    }

    /// Makes the plan (the list of the experiment's points) for the first device only, even if the run has several
    /// devices.
    pub fn plan_of_one_device(&self) -> Plan {
        Plan::new(self.experiment, self.devices.len().min(1))
    }

    /// Returns the parts of the plan that the run measures. The points of one part of the plan are measured
    /// together.
    pub(super) fn pieces(&self, plan: &Plan) -> Vec<Piece> {
        match self.blocks {
            Some(blocks) => plan.of_blocks(blocks),
            None if self.spread => plan.by_device(),
            None => plan.whole(),
        }
    }

    /// Returns the first device if the points are distributed over devices of the same model. In this case,
    /// all records of kernels name the first device. Returns `None` if the points are not distributed.
    pub(super) fn named_device(&self) -> Option<&DeviceInfo> {
        self.devices.first().filter(|_| self.spread).copied()
    }

    fn planned_devices(&self) -> usize {
        if self.spread { self.devices.len().min(1) } else { self.devices.len() }
    }

    /// Returns the jobs of the run's workers: one job per device, or a single job for the host if there are
    /// no devices. If the run compares two folders of kernels, the jobs for the first folder come first, and
    /// those for the second folder follow.
    pub fn jobs(&self, folder: &Path, fault: Option<Fault>) -> Vec<Job> {
        self.all_sources().flat_map(|sources| self.jobs_of(sources, folder, fault)).collect()
    }

    /// Returns the kernel files in `sources` and then, if the run compares two folders of kernels, those in
    /// `other_sources`.
    pub(super) fn all_sources(&self) -> impl Iterator<Item = &Sources> {
        std::iter::once(self.sources).chain(self.other_sources)
    }

    fn jobs_of(&self, sources: &Sources, folder: &Path, fault: Option<Fault>) -> Vec<Job> {
        let job = |device: Option<&DeviceInfo>| Job {
            config: self.experiment.path.clone(),
            text: self.experiment.source.clone(),
            overrides: self.overrides.to_vec(),
            left_out: self.experiment.left_out.clone(),
            device_count: self.planned_devices(),
            device: device.map(DeviceInfo::identity),
            hardware: device.map(|device| device.hardware.clone()).unwrap_or_default(),
            stands_for: self.named_device().cloned(),
            cl_dir: match sources {
                Sources::Embedded => None,
                Sources::Folder(folder) => Some(folder.clone()),
            },
            folder: folder.to_owned(),
            fault,
            asleep_ms: asleep::frame_ms(self.devices),
        };
        match self.devices {
            [] => vec![job(None)],
            devices => devices.iter().map(|&device| job(Some(device))).collect(),
        }
    }

    /// Returns the number of launches that the experiment requests for each group of points.
    pub fn launches(&self) -> usize {
        self.experiment.timing.launches as usize
    }

    /// Returns the rule that decides when a launch has enough samples.
    pub fn stopping_rule(&self) -> StoppingRule {
        let timing = &self.experiment.timing;
        let rule = StoppingRule {
            min_samples: timing.min_samples as usize,
            max_samples: timing.max_samples as usize,
            relative_sigma: timing.relative_sigma,
            time_limit_ms: timing.time_limit_ms,
        };
        rule.shared_by(self.launches())
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::*;
    use crate::device::Hardware;

    fn device(name: &str) -> DeviceInfo {
        DeviceInfo {
            name: name.into(),
            platform: "CUDA".into(),
            hardware: Hardware { uuid: Some(name.into()), ..Hardware::default() },
            ..asleep::device(1.0)
        }
    }

    #[test]
    fn a_worker_learns_the_runs_config_its_device_and_its_kernels() {
        let mut experiment = fixtures::experiment("local_sizes = [4]");
        experiment.left_out = vec![1];
        let (one, two, locks) = (device("one"), device("two"), fixtures::own_locks());
        let devices = [&one, &two];
        let overrides = [("timing.seed".to_owned(), "7".to_owned())];
        let mine = Sources::Folder("mine".into());
        let run = Run { overrides: &overrides, ..fixtures::run(&experiment, &devices, &locks) };
        let fault: Option<Fault> = "segv@cast:3".parse().ok();
        let expected = |device: &DeviceInfo| Job {
            config: experiment.path.clone(),
            text: experiment.source.clone(),
            overrides: overrides.to_vec(),
            left_out: vec![1],
            device_count: 2,
            device: Some(device.identity()),
            hardware: device.hardware.clone(),
            folder: "out".into(),
            fault,
            ..Job::default()
        };
        let jobs = |run: &Run<'_>| run.jobs(Path::new("out"), fault);
        assert_eq!(jobs(&run), [expected(&one), expected(&two)]);
        // All records name the first device, although each device measures some of the points.
        let spread = Run { spread: true, ..run };
        let of_first = |device| Job { device_count: 1, stands_for: Some(one.clone()), ..expected(device) };
        assert_eq!(jobs(&spread), [of_first(&one), of_first(&two)]);
        let both = Run { spread: false, other_sources: Some(&mine), ..spread };
        let of_folder = |device| Job { cl_dir: Some("mine".into()), ..expected(device) };
        assert_eq!(jobs(&both), [expected(&one), expected(&two), of_folder(&one), of_folder(&two)]);
        let on_host = Run { devices: &[], other_sources: None, ..both };
        assert_eq!(
            jobs(&on_host),
            [Job { device_count: 0, device: None, hardware: Hardware::default(), ..expected(&one) }]
        );
        let asleep = asleep::device(2.5);
        let jobs = jobs(&Run { devices: &[&asleep], ..on_host });
        assert_eq!(jobs.iter().map(|job| job.asleep_ms).collect::<Vec<_>>(), [Some(2.5)]);
    }

    #[test]
    fn a_plan_of_one_device_has_the_first_of_several_and_none_if_there_is_none() {
        let experiment = fixtures::experiment("local_sizes = [4]");
        let (one, two, locks) = (device("one"), device("two"), fixtures::own_locks());
        let last_device = |devices: &[&DeviceInfo]| {
            let plan = fixtures::run(&experiment, devices, &locks).plan_of_one_device();
            plan.points.iter().filter_map(|point| point.device).max()
        };
        assert_eq!(
            [last_device(&[]), last_device(&[&one]), last_device(&[&one, &two])],
            [None, Some(0), Some(0)]
        );
    }

    #[test]
    fn a_launch_stops_by_the_experiments_rule() {
        let timing = "min_samples = 12, max_samples = 60, relative_sigma = 0.01, time_limit_ms = 900";
        let experiment =
            fixtures::experiment(&format!("local_sizes = [4]\ntiming = {{ launches = 2, {timing} }}"));
        let rule = fixtures::run(&experiment, &[], &fixtures::own_locks()).stopping_rule();
        let expected =
            StoppingRule { min_samples: 6, max_samples: 30, relative_sigma: 0.01, time_limit_ms: 450.0 };
        assert_eq!(rule, expected);
    }

    #[test]
    fn only_the_value_keep_keeps_moved_samples() {
        let values = [None, Some(""), Some("0"), Some("keep")];
        assert_eq!(values.map(|value| says_keep(value.map(OsStr::new))), [false, false, false, true]);
    }

    #[test]
    fn a_misspelt_keep_is_refused_and_a_blank_value_is_none() {
        let refused = |value: &str| refuse_other_than_keep(Some(OsStr::new(value)));
        for value in ["kep", "Keep", "0"] {
            let error = refused(value).expect_err("it is not 'keep'");
            let message = format!("RAYCL_MOVED_SAMPLES: '{value}' is not 'keep'");
            assert_eq!((error.to_string(), error.exit_code()), (message, 2));
        }
        assert!(refuse_other_than_keep(None).is_ok());
        assert!(["keep", "", " "].into_iter().all(|value| refused(value).is_ok()));
    }
}
