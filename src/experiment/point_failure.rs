//! Why a point is not timed, as its record says it.

use crate::launch::{LaunchError, Refused};
use crate::record::{Outcome, Record};
use serde::{Deserialize, Serialize};

/// Why a point cannot be timed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointFailure {
    /// What to record.
    pub outcome: Outcome,
    /// Why, in a sentence.
    pub reason: String,
}

impl PointFailure {
    /// An outcome and its reason.
    pub fn new(outcome: Outcome, reason: impl Into<String>) -> Self {
        Self { outcome, reason: reason.into() }
    }

    /// A kernel without a device to run on.
    pub fn no_device() -> Self {
        Self::new(Outcome::LaunchFailed, "no device was chosen")
    }

    /// An image that is not the reference's.
    pub fn wrong_image(reason: String) -> Self {
        Self::new(Outcome::WrongImage, reason)
    }

    /// The record of a point refused so.
    pub fn write_into(self, mut record: Record) -> Record {
        record.outcome = self.outcome;
        record.reason = Some(self.reason);
        record
    }
}

impl From<LaunchError> for PointFailure {
    fn from(error: LaunchError) -> Self {
        let outcome = match error {
            LaunchError::WorkGroup { .. } => Outcome::Infeasible,
            _ => Outcome::LaunchFailed,
        };
        Self::new(outcome, error.to_string())
    }
}

impl From<Refused> for PointFailure {
    fn from(refused: Refused) -> Self {
        let outcome = match refused {
            Refused::Launch { error, .. } => return error.into(),
            Refused::Device(_) | Refused::Host(_) => Outcome::Infeasible,
            Refused::Build(_) => Outcome::BuildFailed,
            Refused::Mistake(_) => Outcome::LaunchFailed,
        };
        Self::new(outcome, refused.reason())
    }
}
