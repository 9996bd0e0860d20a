//! The messages between a run and its workers: JSON lines over pipes.

use super::fault::{Fault, Step};
use super::point_failure::PointFailure;
use crate::device::{Device, DeviceInfo, Hardware};
use crate::error::{Error, Result};
use crate::launch::FrameTimes;
use crate::record::Record;
use crate::sources::Sources;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The task of a worker. The run sends the job to the worker as the first line. A run has one job per device
/// (or a single job for the host), for each of its folders of kernels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// The config's path.
    pub config: PathBuf,
    /// The config's text when the run began; the file may have changed since then.
    pub text: String,
    /// The overrides of the config.
    pub overrides: Vec<(String, String)>,
    /// The scenes that are not in the plan, as indices into the config's list of scenes. Each scene that is
    /// left out has the same content as an earlier scene of the list.
    #[serde(default)]
    pub left_out: Vec<usize>,
    /// Number of devices in the plan: 1 if points are distributed over several devices of the same model.
    pub device_count: usize,
    /// The [identity](crate::device::DeviceInfo::identity) of the worker's device; `None` if the run has
    /// baselines only.
    pub device: Option<String>,
    /// The UUID and the PCI address of the worker's device, as far as they are known. If a device of the same
    /// model disappears, the remaining devices are numbered anew. A device may then get the identity of
    /// another device, but never the other device's UUID.
    #[serde(default)]
    pub hardware: Hardware,
    /// The device whose name is in records, if points are distributed over several devices of the same model.
    #[serde(default)]
    pub stands_for: Option<DeviceInfo>,
    /// The folder whose kernel files replace built-in kernel files; `None` if only built-in files are used.
    pub cl_dir: Option<PathBuf>,
    /// The folder of results, in which the worker saves pictures.
    pub folder: PathBuf,
    /// For tests: how the worker fails.
    pub fault: Option<Fault>,
    /// For tests: the number of milliseconds that a worker waits in place of casting a frame. A worker that
    /// only waits opens no device.
    #[serde(default)]
    pub asleep_ms: Option<f64>,
}

/// The answer of a process that lists devices.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeviceList {
    /// All devices that the drivers list.
    Devices(Vec<Listed>),
    /// There is no device, or an error occurred.
    Failed(Failure),
}

/// A device that another process listed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Listed {
    /// The device's properties.
    pub info: DeviceInfo,
    /// A mistake in one of the user's kernel files, with which the device cannot be used; `None` if there is no
    /// such mistake.
    mistake: Option<Failure>,
}

impl Listed {
    /// Returns the data about a device that is sent to another process. If the device's lane operations have
    /// not been tested yet, this function tests them first.
    pub fn of(mut device: Device, sources: &Sources) -> Self {
        let mistake = device.test_lanes(sources).err().map(|error| Failure::of(&error));
        Self { info: device.info, mistake }
    }

    /// Returns the properties of a device that is chosen.
    ///
    /// # Errors
    ///
    /// Fails if one of the user's kernel files is wrong on this device.
    pub fn chosen(&self) -> Result<&DeviceInfo> {
        self.mistake.clone().map_or(Ok(&self.info), |mistake| Err(mistake.into_error()))
    }
}

impl From<DeviceInfo> for Listed {
    fn from(info: DeviceInfo) -> Self {
        Self { info, mistake: None }
    }
}

/// An error that occurred in the process that lists devices.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// What went wrong, as a sentence.
    message: String,
    /// What the user can do about the error.
    help: String,
    /// True if the user made a mistake, for example in a kernel file.
    is_mistake: bool,
}

impl Failure {
    fn of(error: &Error) -> Self {
        Self {
            message: error.to_string(),
            help: error.remedy().to_owned(),
            is_mistake: matches!(error, Error::Input(_)),
        }
    }

    fn into_error(self) -> Error {
        let error = if self.is_mistake { Error::input(self.message) } else { Error::run(self.message) };
        error.with_help(self.help)
    }
}

impl DeviceList {
    /// Returns the devices, or the error that occurred.
    pub fn result(self) -> Result<Vec<Listed>> {
        match self {
            Self::Devices(devices) => Ok(devices),
            Self::Failed(failure) => Err(failure.into_error()),
        }
    }
}

impl From<Result<Vec<Listed>>> for DeviceList {
    fn from(result: Result<Vec<Listed>>) -> Self {
        result.map_or_else(|error| Self::Failed(Failure::of(&error)), Self::Devices)
    }
}

/// The result of building a program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Built {
    /// Time to build the program and to make its kernels ready to start, including the time to store the program in the
    /// cache.
    pub build_ms: f64,
    /// True if the program came from the cache and nothing was compiled.
    pub from_cache: bool,
    /// The key under which the cache stores the program; `None` if the program could not be stored.
    pub key: Option<String>,
    /// True if the program could not be stored because its number of registers is unknown. The number is
    /// unknown if the compiler printed nothing, probably because the driver took the program from its own
    /// cache.
    pub lacks_log: bool,
}

/// A request to a worker. Points are given by their indices in the plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Request {
    /// Cast a point's image once, and compare the image with the reference picture.
    Check {
        /// The point.
        point: usize,
        /// The key that the point's record must have.
        key: String,
        /// The hash of the point's picture, if an earlier launch has verified the picture. A picture with the
        /// same hash is not compared with the reference again.
        verified: Option<String>,
    },
    /// Build the program with which a point is measured, and store the program.
    Build {
        /// The point.
        point: usize,
    },
    /// Take one sample of a point that has passed its check: cast a frame, or a batch of frames if the device's timer
    /// is coarse. Warm up before the first sample.
    Cast {
        /// The point.
        point: usize,
    },
    /// Run the device's anchor once.
    Anchor,
}

impl Request {
    /// Returns the worker's step (a check or a cast) for this request, and the request's point; `None` for other
    /// requests.
    pub fn step(&self) -> Option<(Step, usize)> {
        match self {
            Self::Check { point, .. } => Some((Step::Check, *point)),
            Self::Cast { point } => Some((Step::Cast, *point)),
            Self::Build { .. } | Self::Anchor => None,
        }
    }
}

/// A part of a worker's work on a request. Each request begins with the phase `Cast`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// The worker builds a program or casts frames. The run limits the time of this phase, since a driver may
    /// hang.
    Cast,
    /// The worker loads a scene, or compares a picture with the reference and saves pictures. The run does not
    /// limit the time of this phase, since the phase uses no driver, and large scenes and pictures take long.
    Host,
}

/// A reply of a worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reply {
    /// Reply to the first line that the run sends, which describes the worker's job: the worker's device is
    /// open.
    Started,
    /// A sign of life before the reply to a request: the worker begins another phase of its work.
    Begins(Phase),
    /// Reply to a request to build a program; `None` if the program cannot be built. The point's check will
    /// report the error.
    Built(Option<Built>),
    /// Reply to a request to check a point.
    Checked {
        /// The point's record after the check.
        record: Box<Record>,
        /// True if the point has passed the check and can be timed. If the point cannot be timed, the record
        /// states the reason.
        ready: bool,
    },
    /// Reply to a request to cast a point: the times of the sample.
    Sample(FrameTimes),
    /// Reply to a cast that failed, or to any request during which the device broke down. If the device broke
    /// down, the worker then ends.
    Refused(PointFailure),
    /// Reply to any request: an error. An error of the anchor or of a builder does not end the run; every
    /// other error does.
    Failed {
        /// What went wrong, as a sentence for the user.
        message: String,
        /// The remedy for the user.
        help: String,
    },
}

impl Reply {
    /// Makes the reply that reports an error.
    pub fn of_error(error: &Error) -> Self {
        Self::Failed { message: error.to_string(), help: error.remedy().to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::DeviceKind;
    use crate::device::tests::example;

    #[test]
    fn what_is_sent_arrives() {
        let times =
            FrameTimes { primary_ms: Some(0.07), batch: Some(7), ..FrameTimes::whole(0.1, 1.0 / 3.0) };
        let checked = Reply::Checked { record: Box::default(), ready: true };
        for reply in [Reply::Started, Reply::Begins(Phase::Host), Reply::Sample(times), checked] {
            let line = serde_json::to_string(&reply).unwrap();
            assert!(!line.contains('\n'));
            assert_eq!(serde_json::from_str::<Reply>(&line).unwrap(), reply);
        }
        let request = Request::Check { point: 7, key: "k".into(), verified: Some("h".into()) };
        let line = serde_json::to_string(&request).unwrap();
        assert_eq!(serde_json::from_str::<Request>(&line).unwrap(), request);
    }

    #[test]
    fn the_process_that_lists_devices_tells_a_users_mistake_from_a_failure() {
        for (error, code) in [(Error::input("a mistake"), 2), (Error::run("a failure"), 1)] {
            let message = error.to_string();
            let failed: Result<Vec<Listed>> = Err(error.with_help("a remedy"));
            let line = serde_json::to_string(&DeviceList::from(failed)).unwrap();
            let received = serde_json::from_str::<DeviceList>(&line).unwrap().result().unwrap_err();
            assert_eq!(
                (received.exit_code(), received.to_string(), received.remedy()),
                (code, message, "a remedy")
            );
        }
    }

    #[test]
    fn a_mistake_on_one_device_is_reported_only_if_this_device_is_chosen() {
        let [cpu, gpu] = [("a cpu", DeviceKind::Cpu), ("a gpu", DeviceKind::Gpu)]
            .map(|(name, kind)| Listed::from(example("A", name, kind, 1)));
        let mistake = Some(Failure::of(&Error::input("a mistake").with_help("a remedy")));
        let list: Result<Vec<Listed>> = Ok(vec![cpu, Listed { mistake, ..gpu }]);
        let line = serde_json::to_string(&DeviceList::from(list)).unwrap();
        let received = serde_json::from_str::<DeviceList>(&line).unwrap().result().unwrap();
        assert_eq!(received[0].chosen().unwrap().name, "a cpu");
        let error = received[1].chosen().unwrap_err();
        assert_eq!((error.exit_code(), error.remedy()), (2, "a remedy"));
    }
}
