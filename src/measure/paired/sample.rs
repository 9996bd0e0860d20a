//! One measured time of a point.

/// One measured time of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairedSample {
    /// The point's index among the points that are compared.
    pub point: usize,
    /// The number of the launch.
    pub launch: u32,
    /// The time in milliseconds.
    pub ms: f64,
}
