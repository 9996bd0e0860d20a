//! How sure a comparison of two times is: nothing is said to hold, or not to, that the samples leave open.

use super::Verdict;
use crate::record::{Record, median, significant};
use crate::report::words::ratio_interval;
use std::ops::RangeInclusive;

/// With fewer samples than these an interval says little: it counts as wider by a tenth at each end.
const FEW: usize = 5;
const DOUBT: f64 = 1.1;

/// How many times as long one record takes as another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ratio {
    /// The ratio of the medians.
    pub(super) middle: f64,
    /// What it surely lies between: the ends of the two 95% intervals divided, and a tenth for few samples.
    ends: [f64; 2],
    /// The fewer of the two numbers of samples.
    n: usize,
}

impl Ratio {
    /// Of two measured records.
    pub(super) fn of(slow: &Record, fast: &Record) -> Option<Self> {
        let middle = median(slow)? / median(fast)?;
        let [low, high] = ratio_interval(slow, fast)?;
        let n = slow.samples_ms.len().min(fast.samples_ms.len());
        let doubt = if n < FEW { DOUBT } else { 1.0 };
        Some(Self { middle, ends: [low / doubt, high * doubt], n })
    }

    /// Whether it is in `held`: surely, surely not, or unclear.
    pub(super) fn verdict(&self, held: RangeInclusive<f64>) -> Verdict {
        let [low, high] = self.ends;
        match () {
            () if held.contains(&low) && held.contains(&high) => Verdict::Held,
            () if high < *held.start() || low > *held.end() => Verdict::DidNotHold,
            () => Verdict::Unclear,
        }
    }

    /// Whether it is surely above 1, where a tie (intervals that touch) is unclear.
    pub(super) fn verdict_slower(&self) -> Verdict {
        match self.ends {
            [low, _] if low > 1.0 => Verdict::Held,
            [_, high] if high < 1.0 => Verdict::DidNotHold,
            _ => Verdict::Unclear,
        }
    }

    /// "3.07 times (3.02 to 3.11, n = 12)".
    pub(super) fn text(&self) -> String {
        let [middle, low, high] =
            [self.middle, self.ends[0], self.ends[1]].map(|ratio| significant(ratio, 3));
        let few = if self.n < FEW { ", few" } else { "" };
        format!("{middle} times ({low} to {high}, n = {}{few})", self.n)
    }
}

/// The fastest of some records, and all that are not surely slower, fastest first.
pub(super) fn fastest<'a>(records: &[&'a Record]) -> Vec<&'a Record> {
    let mut ranked: Vec<_> = records.iter().copied().filter(|record| median(record).is_some()).collect();
    ranked.sort_by(|a, b| median(a).unwrap_or(f64::MAX).total_cmp(&median(b).unwrap_or(f64::MAX)));
    let Some(best) = ranked.first().copied() else { return ranked };
    let level = |record: &&Record| {
        Ratio::of(record, best).is_some_and(|ratio| ratio.verdict_slower() != Verdict::Held)
    };
    ranked.retain(|record| record.key == best.key || level(record));
    ranked
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::measured;

    fn ratio(slow: [f64; 2], fast: [f64; 2], n: usize) -> Ratio {
        let record = |ends: [f64; 2]| {
            let mut record = measured("gpu", "naive", 8, ends);
            record.samples_ms.truncate(n);
            record
        };
        Ratio::of(&record(slow), &record(fast)).expect("both are measured")
    }

    #[test]
    fn intervals_that_touch_are_unclear() {
        assert_eq!(ratio([2.0, 2.1], [1.0, 1.1], 10).verdict_slower(), Verdict::Held);
        assert_eq!(ratio([1.0, 1.1], [2.0, 2.1], 10).verdict_slower(), Verdict::DidNotHold);
        assert_eq!(ratio([1.05, 1.2], [1.0, 1.1], 10).verdict_slower(), Verdict::Unclear);
        assert_eq!(ratio([1.1, 1.2], [1.0, 1.1], 10).verdict_slower(), Verdict::Unclear);
    }

    #[test]
    fn few_samples_need_a_greater_difference() {
        let close = |n| ratio([1.15, 1.2], [1.0, 1.1], n).verdict_slower();
        assert_eq!([close(10), close(3)], [Verdict::Held, Verdict::Unclear]);
        assert_eq!(ratio([2.0, 2.1], [1.0, 1.1], 3).verdict_slower(), Verdict::Held);
        assert!(ratio([2.0, 2.1], [1.0, 1.1], 3).text().contains("n = 3, few"));
    }

    #[test]
    fn a_range_holds_only_with_both_ends_in_it() {
        let about_two = ratio([1.9, 2.1], [1.0, 1.0], 10);
        let verdicts = [1.5..=2.5, 2.0..=3.0, 3.0..=4.0, 0.5..=1.5].map(|range| about_two.verdict(range));
        assert_eq!(verdicts, [Verdict::Held, Verdict::Unclear, Verdict::DidNotHold, Verdict::DidNotHold]);
    }
}
