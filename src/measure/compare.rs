//! Compares a new time with an earlier time.

use super::Interval;

/// The result of comparing a new time with an earlier time by their ratio. Times that differ by at most a
/// threshold count as equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Verdict {
    /// Every ratio in the 95% interval means that the new time is shorter by more than the threshold.
    Faster,
    /// Every ratio in the 95% interval means that the new time is longer by more than the threshold.
    Slower,
    /// Every ratio in the 95% interval means that the times differ by at most the threshold.
    Same,
    /// The 95% interval contains ratios within the threshold and ratios beyond the threshold.
    Unclear,
    /// The two times cannot be compared, since neither an anchor nor other points of the same rounds show how the
    /// machine's speed changed.
    NotComparable,
    /// At least one of the two compared points has too few samples.
    NotEnough,
    /// At least one of the two compared points has enough samples, but some of its samples are 0.
    BelowResolution,
}

impl Verdict {
    /// All verdicts that a comparison of two times can have.
    pub const ALL: [Self; 7] = [
        Self::Faster,
        Self::Slower,
        Self::Same,
        Self::Unclear,
        Self::NotComparable,
        Self::NotEnough,
        Self::BelowResolution,
    ];

    /// Returns the verdict's name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Faster => "faster",
            Self::Slower => "slower",
            Self::Same => "same",
            Self::Unclear => "unclear",
            Self::NotComparable => "not comparable",
            Self::NotEnough => "not enough samples",
            Self::BelowResolution => "below the timer's resolution",
        }
    }

    /// Returns the verdict for the 95% interval of a ratio: the new time divided by the earlier time. Two
    /// times count as equal if neither exceeds the other by more than `threshold` (0.02 is 2%).
    pub fn of(change: Interval, threshold: f64) -> Self {
        let (least, most) = (1.0 / (1.0 + threshold), 1.0 + threshold);
        if change.low > most {
            Self::Slower
        } else if change.high < least {
            Self::Faster
        } else if change.low >= least && change.high <= most {
            Self::Same
        } else {
            Self::Unclear
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_the_interval_leaves_no_doubt_of_is_said() {
        let of = |low: f64, high: f64| {
            let middle = f64::sqrt(low * high);
            Verdict::of(Interval { middle, low, high, error: 0.1, degrees: 8.0, bias: 0.0 }, 0.02)
        };
        assert_eq!(of(1.05, 1.2), Verdict::Slower);
        assert_eq!(of(0.7, 0.9), Verdict::Faster);
        assert_eq!(of(0.99, 1.01), Verdict::Same);
        assert_eq!(of(1.01, 1.2), Verdict::Unclear);
        assert_eq!(of(0.5, 2.0), Verdict::Unclear);
        assert_eq!((of(0.5, 0.99), of(1.01, 1.9)), (Verdict::Unclear, Verdict::Unclear), "the end decides");
    }

    #[test]
    fn an_interval_that_touches_the_threshold_is_within_it() {
        let of = |low: f64, high: f64| {
            Verdict::of(Interval { middle: 1.0, low, high, error: 0.1, degrees: 8.0, bias: 0.0 }, 0.25)
        };
        assert_eq!(of(0.8, 1.25), Verdict::Same);
        assert_eq!((of(1.25, 2.0), of(0.5, 0.8)), (Verdict::Unclear, Verdict::Unclear));
        // The ratios 1.25 and 0.8 (1 / 1.25) differ from 1 by exactly the threshold.
        assert_eq!((of(0.5, 0.79), of(0.78, 1.0)), (Verdict::Faster, Verdict::Unclear));
    }
}
