//! The reason why a device or the host cannot hold a point.

/// Why a point does not fit: the arithmetic, as a sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Infeasible {
    /// For example "__local memory: vectors 108 B x 24 x 24 = 62208 B > 49152 B".
    pub reason: String,
}
