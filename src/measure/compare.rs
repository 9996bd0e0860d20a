//! What may be said of several results: who wins, and what has changed.

use super::Summary;

/// The places of the winners among intervals of points, the point of the least median first: that one, and every one whose 95%
/// interval overlaps its. More than one is a tie.
pub fn winners(ranked_ci95_ms: &[[f64; 2]]) -> Vec<usize> {
    let Some(best) = ranked_ci95_ms.first() else { return Vec::new() };
    (0..ranked_ci95_ms.len()).filter(|&place| overlap(ranked_ci95_ms[place], *best)).collect()
}

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
}

impl Verdict {
    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Faster => "faster",
            Self::Slower => "slower",
            Self::Same => "same",
            Self::Unclear => "unclear",
        }
    }
}

/// How `after` stands to `before`. Medians within `threshold` of each other (0.02 is 2% of
/// `before`'s) are the same; beyond it the intervals [min, Q3] must be disjoint to be sure.
pub fn compare(before: &Summary, after: &Summary, threshold: f64) -> Verdict {
    let gap = after.median_ms - before.median_ms;
    let body = |summary: &Summary| [summary.min_ms, summary.q3_ms];
    if gap.abs() <= threshold * before.median_ms {
        Verdict::Same
    } else if overlap(body(before), body(after)) {
        Verdict::Unclear
    } else if gap < 0.0 {
        Verdict::Faster
    } else {
        Verdict::Slower
    }
}

/// Whether two closed intervals share a value.
fn overlap([a_low, a_high]: [f64; 2], [b_low, b_high]: [f64; 2]) -> bool {
    a_low <= b_high && b_low <= a_high
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
    fn ties_win_together_and_the_best_comes_first() {
        let of = |medians: &[f64]| {
            let intervals: Vec<_> = medians.iter().map(|ms| steady(*ms).ci95_ms).collect();
            winners(&intervals)
        };
        assert_eq!(of(&[1.0, 1.005, 2.0]), [0, 1]);
        assert_eq!(of(&[1.0, 1.5]), [0]);
        assert!(winners(&[]).is_empty());
    }

    #[test]
    fn four_verdicts() {
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

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn nothing_differs_from_itself(samples in prop::collection::vec(0.1..10.0_f64, 1..20)) {
            let summary = Summary::of(&samples).unwrap();
            prop_assert_eq!(compare(&summary, &summary, 0.0), Verdict::Same);
        }
    }
}
