//! Where a record stands among those that were measured with it.

use super::control::Control;
use crate::measure::Standing;

/// Where a record stands among those that were measured with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// What tells those that were measured together from others.
    pub(super) together: blake3::Hash,
    /// Its own times, and how they go with the others'.
    pub(super) standing: Standing,
    /// The anchor of its device: its name, and where it stands among the same points. Only where it was asked for.
    pub(super) anchor: Option<(String, Standing)>,
    /// The control point of its block, where it was measured in one of several.
    pub(super) control: Option<Control>,
}
