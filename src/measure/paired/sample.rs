//! What was timed.

/// One timed frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairedSample {
    /// The point's place among those that are compared.
    pub point: usize,
    /// The launch it was taken in.
    pub launch: u32,
    /// What it took.
    pub ms: f64,
}
