//! The reason why a point is not timed, for its record.

use crate::device::DeviceInfo;
use crate::launch::{LaunchError, Refused};
use crate::record::{Outcome, Record};
use serde::{Deserialize, Serialize};

/// Why a point cannot be timed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointFailure {
    /// The outcome that the point's record gets.
    pub outcome: Outcome,
    /// The reason, in a sentence.
    pub reason: String,
}

impl PointFailure {
    /// Makes a failure from an outcome and its reason.
    pub fn new(outcome: Outcome, reason: impl Into<String>) -> Self {
        Self { outcome, reason: reason.into() }
    }

    /// Returns the failure of a kernel that has no device to run on.
    pub fn no_device() -> Self {
        Self::new(Outcome::LaunchFailed, "no device was chosen")
    }

    /// Returns the failure of an image that differs from the reference.
    pub fn wrong_image(reason: String) -> Self {
        Self::new(Outcome::WrongImage, reason)
    }

    /// Returns the failure of a point whose program could not be built, or whose image could not be cast, for
    /// the reason `refused`. `device` is the worker's device; `None` if the worker has no device.
    pub fn of(refused: &Refused, device: Option<&DeviceInfo>) -> Self {
        let outcome = match refused {
            Refused::Launch { error: LaunchError::WorkGroup { .. }, .. }
            | Refused::Device(_)
            | Refused::Host(_) => Outcome::Infeasible,
            Refused::Build(_) => Outcome::BuildFailed,
            Refused::Mistake(_) | Refused::Launch { .. } => Outcome::LaunchFailed,
        };
        Self::new(outcome, device.map_or_else(|| refused.reason(), |device| refused.reason_on(device)))
    }

    /// Writes this failure's outcome and reason into the point's record, and returns the record.
    pub fn write_into(self, mut record: Record) -> Record {
        record.outcome = self.outcome;
        record.reason = Some(self.reason);
        record
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::program::BuildError;
    use crate::strategy::Infeasible;

    #[test]
    fn a_failure_replaces_the_outcome_and_keeps_the_rest() {
        let draft = Record { key: "a".into(), ..Record::default() };
        let failed = PointFailure::new(Outcome::TimedOut, "why").write_into(draft.clone());
        let expected = Record { outcome: Outcome::TimedOut, reason: Some("why".into()), ..draft };
        assert_eq!(failed, expected);
        assert_eq!(PointFailure::wrong_image("w".into()).outcome, Outcome::WrongImage);
    }

    #[test]
    fn only_a_point_that_is_too_large_for_its_device_or_the_host_is_infeasible() {
        let beyond = || Infeasible::beyond("memory: 2 B > 1 B".to_owned());
        let launch = |error: LaunchError| Refused::Launch { step: "the launch", error };
        let too_many = LaunchError::WorkGroup { kernel: "cast_frame".into(), most: 64, items: 81 };
        let build = BuildError { log: "error: no".into(), has_own_file: false, may_pass: false };
        for (refused, outcome, reason) in [
            (Refused::Device(beyond()), Outcome::Infeasible, "memory: 2 B > 1 B"),
            (Refused::Host(beyond()), Outcome::Infeasible, "memory: 2 B > 1 B"),
            (
                launch(too_many),
                Outcome::Infeasible,
                "the local size has 81 work-items; the compiled kernel cast_frame supports at most 64",
            ),
            (launch(LaunchError::OpenCl("lost".into())), Outcome::LaunchFailed, "lost"),
            (Refused::Build(build), Outcome::BuildFailed, "error: no"),
            (Refused::Mistake(Error::input("a mistake")), Outcome::LaunchFailed, "a mistake"),
        ] {
            assert_eq!(PointFailure::of(&refused, None), PointFailure::new(outcome, reason));
        }
    }
}
