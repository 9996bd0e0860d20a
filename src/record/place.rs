//! A record's position among those that were measured with it.

use super::control::Control;
use crate::measure::Standing;

/// A record's position among those that were measured with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Identifies the records that were measured together.
    pub(super) together: blake3::Hash,
    /// The record's times, relative to those of the other records that were measured with it.
    pub(super) standing: Standing,
    /// The anchor of its device, if requested: its name, and its times relative to the same points.
    pub(super) anchor: Option<(String, Standing)>,
    /// The control point of its block, if it was measured in one of several blocks.
    pub(super) control: Option<Control>,
}
