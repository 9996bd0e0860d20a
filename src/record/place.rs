//! A record's position among the records that were measured with it.

use super::anchors::AnchorUtilization;
use super::control::Control;
use crate::measure::{Interval, Standing};

/// A record's position: its times relative to those of the records, the anchor and the control point that were
/// measured with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// A hash that is equal for all records that were measured together.
    pub(super) together: blake3::Hash,
    /// The record's times, relative to those of the other records that were measured with it.
    pub(super) standing: Standing,
    /// The median of the record's samples in milliseconds. Its interval never depends on anchors, so all views show the
    /// same one.
    pub(super) median_ms: Interval,
    /// The anchor of the record's device. `None` if there is no anchor, or if anchors were not requested.
    pub(super) anchor: Option<PlacedAnchor>,
    /// The control point of the record's block; `None` if the group was not divided into blocks.
    pub(super) control: Option<Control>,
}

/// An anchor that was measured with some records.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PlacedAnchor {
    /// The anchor's name.
    pub(super) name: String,
    /// The anchor's times, relative to those of the records that were measured with it.
    pub(super) standing: Standing,
    /// How much of the processors the anchor got; `None` if it is unknown.
    pub(super) utilization: Option<AnchorUtilization>,
}
