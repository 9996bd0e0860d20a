//! An estimate and how sure it is.

/// A value and its 95% interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The estimate.
    pub middle: f64,
    /// The interval's lower end.
    pub low: f64,
    /// The interval's upper end.
    pub high: f64,
}

impl Interval {
    /// This over another that was found apart from it.
    pub fn over(self, other: Self) -> Self {
        let half = |one: Self| (one.high / one.middle).ln();
        interval((self.middle / other.middle).ln(), half(self).hypot(half(other)))
    }
}

/// From a logarithm and half of its interval.
pub(super) fn interval(middle: f64, half: f64) -> Interval {
    Interval { middle: middle.exp(), low: (middle - half).exp(), high: (middle + half).exp() }
}
