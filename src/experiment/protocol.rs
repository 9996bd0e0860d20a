//! What passes between a run and its workers: JSON lines over pipes.

use super::fault::{Fault, Step};
use super::point_failure::PointFailure;
use crate::device::DeviceInfo;
use crate::error::Error;
use crate::launch::FrameTimes;
use crate::record::Record;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The first line to a worker: what it works on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// The config's path.
    pub config: PathBuf,
    /// Its text, which the file may no longer have.
    pub text: String,
    /// The values laid over it.
    pub overrides: Vec<(String, String)>,
    /// How many devices the run has: the plan depends on it.
    pub device_count: usize,
    /// The [identity](crate::device::DeviceInfo::identity) of the worker's device; none where the run has baselines only.
    pub device: Option<String>,
    /// The device of whose kind it is, and in whose name it measures, where points are spread over several.
    #[serde(default)]
    pub stands_for: Option<DeviceInfo>,
    /// The folder of kernels that replaces those built in.
    pub cl_dir: Option<PathBuf>,
    /// The folder of results, for pictures.
    pub folder: PathBuf,
    /// For tests: how the worker is to fail.
    pub fault: Option<Fault>,
    /// For tests: every frame is a sleep of so long, and no device is opened.
    #[serde(default)]
    pub asleep_ms: Option<f64>,
}

/// What a process that lists devices answers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeviceList {
    /// Every device there is.
    Devices(Vec<DeviceInfo>),
    /// There is none, or no way to ask.
    Failed {
        /// Why.
        message: String,
        /// The remedy.
        help: String,
    },
}

/// What building a program took.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Built {
    /// From the strategy to a kernel that can be launched, with keeping it for later.
    pub build_ms: f64,
    /// Whether it was kept since an earlier build, and nothing was compiled.
    pub from_cache: bool,
}

/// What a worker is asked; numbers are places in the plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Request {
    /// Cast a point once and compare its image with the reference.
    Check {
        /// Which.
        point: usize,
        /// The key it must have.
        key: String,
        /// The hash of its picture, where an earlier launch compared that with the reference: the same needs no comparing.
        verified: Option<String>,
    },
    /// Build the program of a point and keep it.
    Build {
        /// Which.
        point: usize,
    },
    /// Cast one frame of a point that passed; the first time after its warm-up.
    Cast {
        /// Which.
        point: usize,
    },
    /// Run the device's anchor once.
    Anchor,
}

impl Request {
    /// What a worker is at when it does this, and of which point; none where it is of no point.
    pub fn step(&self) -> Option<(Step, usize)> {
        match self {
            Self::Check { point, .. } => Some((Step::Check, *point)),
            Self::Cast { point } => Some((Step::Cast, *point)),
            Self::Build { .. } | Self::Anchor => None,
        }
    }
}

/// What a worker answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reply {
    /// To the job: the device is open.
    Started,
    /// To a build; none where the point cannot be built, which its check will tell of.
    Built(Option<Built>),
    /// To a check.
    Checked {
        /// What was found.
        record: Box<Record>,
        /// Whether the point can be cast; if not, the record says why.
        ready: bool,
    },
    /// To a cast.
    Sample(FrameTimes),
    /// To a cast that failed.
    Refused(PointFailure),
    /// To anything: what ends the run.
    Failed {
        /// What happened.
        message: String,
        /// What to do about it.
        help: String,
    },
}

impl Reply {
    /// An error that ends the run, with its remedy.
    pub fn of_error(error: &Error) -> Self {
        Self::Failed { message: error.to_string(), help: error.remedy().to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_sent_arrives() {
        let times =
            FrameTimes { primary_ms: Some(0.07), batch: Some(7), ..FrameTimes::whole(0.1, 1.0 / 3.0) };
        for reply in
            [Reply::Started, Reply::Sample(times), Reply::Checked { record: Box::default(), ready: true }]
        {
            let line = serde_json::to_string(&reply).unwrap();
            assert!(!line.contains('\n'));
            assert_eq!(serde_json::from_str::<Reply>(&line).unwrap(), reply);
        }
        let request = Request::Check { point: 7, key: "k".into(), verified: Some("h".into()) };
        let line = serde_json::to_string(&request).unwrap();
        assert_eq!(serde_json::from_str::<Request>(&line).unwrap(), request);
    }
}
