//! Defines a record's relative times, which say how the record's times compare with the times of records that
//! were measured in the same rounds.

use super::anchors::AnchorUtilization;
use super::control::Control;
use crate::measure::{Interval, Standing};

/// A record's times, relative to other times from the same rounds. These other times are the times of the
/// other records, of the anchor (work that is timed for comparison), and of the control point (a point that
/// every block measures).
#[derive(Clone, Debug, PartialEq)]
pub struct RelativeTimes {
    /// A hash that is equal for all records that were measured together.
    pub(super) together: blake3::Hash,
    /// The record's times, relative to the times of the records that were measured together.
    pub(super) standing: Standing,
    /// The median of the record's samples in milliseconds. The interval of the record's median never depends
    /// on anchors, so every output of raycl shows the same interval.
    pub(super) median_ms: Interval,
    /// The anchor of the record's device. `None` if the device has no anchor, if the anchor has too few samples
    /// or times of 0, or if the relative times were computed without anchors.
    pub(super) anchor: Option<MeasuredAnchor>,
    /// The control point (a point that every block of the group measures) of the record's block. `None` if
    /// the group was not divided into blocks, or if the control point has no time in this block.
    pub(super) control: Option<Control>,
}

/// An anchor that was measured with some records.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeasuredAnchor {
    /// The anchor's name.
    pub(super) name: String,
    /// The times of the anchor (work that is timed for comparison), relative to the times of the records that
    /// were measured together with it.
    pub(super) standing: Standing,
    /// The ratio of the anchor's processor time to its elapsed time; `None` if a sample of the anchor lacks one
    /// of these times, or if an elapsed time is 0.
    pub(super) utilization: Option<AnchorUtilization>,
}
