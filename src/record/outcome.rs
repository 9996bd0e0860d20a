//! The outcome of a point: whether the point was measured, and if not, why.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The outcome of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The image was correct, and the point was timed.
    Measured,
    /// The point cannot be measured: the device or the host has too little memory; the device, the kernel or the
    /// strategy does not support the local size; or the strategy does not support the scene or the image size. The
    /// record's `reason` says which of these conditions makes the point infeasible. If memory is too small,
    /// `reason` also says how the needed size was computed.
    Infeasible,
    /// The point's preset is meant for devices of another kind, so the point was not compiled or
    /// timed.
    OtherKind,
    /// The device's compiler rejected the program.
    BuildFailed,
    /// The device refused or failed to run the kernel, the driver broke down or reported impossible times, or
    /// the free memory became too small for the point after the point had been cast once.
    LaunchFailed,
    /// The image is not correct. For example, pixels that are certain (that do not depend on rounding) differ
    /// from the reference, too many other pixels are outside the range of values that the reference yields
    /// for them, or the number of pixels with a hit is wrong. Points with wrong images are not timed.
    WrongImage,
    /// A step of the measurement, such as compiling the program or casting a frame, took longer than the time
    /// limit.
    TimedOut,
    /// The process that measured the point ended unexpectedly. A record has the outcome `Crashed` until raycl
    /// assigns another outcome.
    #[default]
    Crashed,
}

impl Outcome {
    /// Returns the outcome's name in records.
    pub fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Infeasible => "infeasible",
            Self::OtherKind => "other-kind",
            Self::BuildFailed => "build-failed",
            Self::LaunchFailed => "launch-failed",
            Self::WrongImage => "wrong-image",
            Self::TimedOut => "timed-out",
            Self::Crashed => "crashed",
        }
    }

    /// Returns true if this outcome is not a failure: the point was measured, or raycl knew before the point's
    /// first frame that the point cannot or need not be measured.
    pub fn is_fine(self) -> bool {
        matches!(self, Self::Measured | Self::Infeasible | Self::OtherKind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outcome_has_the_same_name_in_tables_as_in_records() {
        use Outcome::{
            BuildFailed, Crashed, Infeasible, LaunchFailed, Measured, OtherKind, TimedOut, WrongImage,
        };
        let fine = [Measured, Infeasible, OtherKind];
        let failures = [BuildFailed, LaunchFailed, WrongImage, TimedOut, Crashed];
        for outcome in fine.into_iter().chain(failures) {
            assert_eq!(serde_json::to_value(outcome).unwrap(), outcome.name());
        }
        assert!(fine.iter().all(|outcome| outcome.is_fine()));
        assert!(!failures.iter().any(|outcome| outcome.is_fine()));
    }
}
