//! Defines a record's relative times, which say how the record's times compare with the times of records that
//! were measured in the same rounds.

use super::anchors::AnchorUtilization;
use super::control::Control;
use crate::measure::{Interval, Standing};

/// A record's times, relative to the times of the records, the anchor and the control point that were
/// measured in the same rounds.
#[derive(Clone, Debug, PartialEq)]
pub struct RelativeTimes {
    /// A hash that is equal for all records that were measured together.
    pub(super) together: blake3::Hash,
    /// The record's times, relative to the times of the records that were measured together.
    pub(super) standing: Standing,
    /// The median of the record's samples in milliseconds. The interval of this median never depends on anchors, so
    /// every output of raycl shows the same interval.
    pub(super) median_ms: Interval,
    /// The anchor of the record's device. `None` if the device has no anchor, or if the relative times were
    /// computed without anchors.
    pub(super) anchor: Option<MeasuredAnchor>,
    /// The control point of the record's block; `None` if the group was not divided into blocks, or if the
    /// control point has no time in this block.
    pub(super) control: Option<Control>,
}

/// An anchor that was measured with some records.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeasuredAnchor {
    /// The anchor's name.
    pub(super) name: String,
    /// The anchor's times, relative to the times of the records that were measured together.
    pub(super) standing: Standing,
    /// The ratio of the anchor's processor time to its elapsed time; `None` if a sample of the anchor lacks
    /// one of these times.
    pub(super) utilization: Option<AnchorUtilization>,
}
