//! The reason why a strategy cannot be cast, found before anything is compiled.

/// Why a point cannot be cast, as a sentence: the arithmetic of a limit that it exceeds, or a
/// feature that its strategy does not support.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Infeasible {
    /// For example "__local memory: vectors 108 B x 24 x 24 = 62208 B > 49152 B".
    pub reason: String,
    /// True if the strategy does not support something that the scene contains; neither the device
    /// nor a size is the cause.
    pub is_lacking: bool,
}

impl Infeasible {
    /// Returns the reason why a point exceeds a limit of a device or of the host.
    pub fn beyond(reason: String) -> Self {
        Self { reason, is_lacking: false }
    }

    /// Returns the reason why a strategy cannot cast a scene on any device.
    pub fn lacking(reason: String) -> Self {
        Self { reason, is_lacking: true }
    }
}
