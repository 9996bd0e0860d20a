//! How a result stands to an earlier one.

use super::ranking::overlap;
use super::{MIN_SAMPLES, Summary};

/// How a result stands to an earlier one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Verdict {
    /// Surely faster, by more than the threshold.
    Faster,
    /// Surely slower, by more than the threshold.
    Slower,
    /// The medians differ by no more than the threshold.
    Same,
    /// The medians differ by more, but the samples overlap.
    Unclear,
    /// One of them has too few samples to say.
    NotEnough,
}

impl Verdict {
    /// Every verdict.
    pub const ALL: [Self; 5] = [Self::Faster, Self::Slower, Self::Same, Self::Unclear, Self::NotEnough];

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Faster => "faster",
            Self::Slower => "slower",
            Self::Same => "same",
            Self::Unclear => "unclear",
            Self::NotEnough => "not enough samples",
        }
    }
}

/// How `after` stands to `before`. Medians within `threshold` of each other (0.02 is 2% of
/// `before`'s) are the same; beyond it the intervals [min, Q3] must be disjoint to be sure. Fewer than
/// [`MIN_SAMPLES`] of either are not enough.
pub fn compare(before: &Summary, after: &Summary, threshold: f64) -> Verdict {
    let gap = after.median_ms - before.median_ms;
    let body = |summary: &Summary| [summary.min_ms, summary.q3_ms];
    if before.n.min(after.n) < MIN_SAMPLES {
        Verdict::NotEnough
    } else if gap.abs() <= threshold * before.median_ms {
        Verdict::Same
    } else if overlap(body(before), body(after)) {
        Verdict::Unclear
    } else if gap < 0.0 {
        Verdict::Faster
    } else {
        Verdict::Slower
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn steady(ms: f64) -> Summary {
        Summary::of(&[0.99 * ms, 0.995 * ms, ms, 1.005 * ms, 1.01 * ms]).unwrap()
    }

    fn spread(ms: f64) -> Summary {
        Summary::of(&[0.7 * ms, 0.85 * ms, ms, 1.15 * ms, 1.3 * ms]).unwrap()
    }

    #[test]
    fn verdicts_of_enough_samples() {
        let base = steady(1.0);
        assert_eq!(compare(&base, &steady(0.8), 0.02), Verdict::Faster);
        assert_eq!(compare(&base, &steady(1.2), 0.02), Verdict::Slower);
        assert_eq!(compare(&base, &steady(1.01), 0.02), Verdict::Same);
        assert_eq!(compare(&base, &spread(1.1), 0.02), Verdict::Unclear);
    }

    #[test]
    fn a_sure_difference_below_the_threshold_is_the_same() {
        assert_eq!(compare(&steady(1.0), &steady(1.05), 0.1), Verdict::Same);
    }

    #[test]
    fn four_samples_are_not_enough_however_far_apart() {
        let few = Summary::of(&[9.0; 4]).unwrap();
        assert_eq!(compare(&steady(1.0), &few, 0.02), Verdict::NotEnough);
        assert_eq!(compare(&few, &steady(1.0), 0.02), Verdict::NotEnough);
        assert_eq!(compare(&few, &few, 0.02), Verdict::NotEnough);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn nothing_differs_from_itself(samples in prop::collection::vec(0.1..10.0_f64, 5..20)) {
            let summary = Summary::of(&samples).unwrap();
            prop_assert_eq!(compare(&summary, &summary, 0.0), Verdict::Same);
        }
    }
}
