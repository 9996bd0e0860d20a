//! How sure a comparison of two times is: nothing is said to hold, or not to, that the samples leave open.

use super::Verdict;
use crate::measure::not_enough;
use crate::record::{Record, estimate, few_names, ranking, significant};
use std::ops::RangeInclusive;

/// How many times as long one record takes as another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ratio {
    /// The ratio of the medians, and what it surely lies between: the ends of the two 95% intervals divided. None where
    /// one of them has too few samples.
    sure: Option<(f64, [f64; 2])>,
    /// The fewer of the two numbers of samples.
    n: usize,
}

impl Ratio {
    /// Of two measured records.
    pub(super) fn of(slow: &Record, fast: &Record) -> Option<Self> {
        let (above, below) = (estimate(slow)?, estimate(fast)?);
        let middle = above.median_ms() / below.median_ms();
        let n = slow.samples_ms.len().min(fast.samples_ms.len());
        Some(Self { sure: above.ratio_interval(&below).map(|ends| (middle, ends)), n })
    }

    /// Whether it is in `held`: surely, surely not, or unclear.
    pub(super) fn verdict(&self, held: RangeInclusive<f64>) -> Verdict {
        match self.sure {
            Some((_, [low, high])) if held.contains(&low) && held.contains(&high) => Verdict::Held,
            Some((_, [low, high])) if high < *held.start() || low > *held.end() => Verdict::DidNotHold,
            _ => Verdict::Unclear,
        }
    }

    /// Whether it is surely above 1, where a tie (intervals that touch) is unclear.
    pub(super) fn verdict_slower(&self) -> Verdict {
        match self.sure {
            Some((_, [low, _])) if low > 1.0 => Verdict::Held,
            Some((_, [_, high])) if high < 1.0 => Verdict::DidNotHold,
            _ => Verdict::Unclear,
        }
    }

    /// "3.07 times as fast (3.02 to 3.11, n = 12)", where `what` is " as fast"; or "not enough samples (n = 3)".
    pub(super) fn text(&self, what: &str) -> String {
        let Some((middle, [low, high])) = self.sure else { return not_enough(self.n) };
        let [middle, low, high] = [middle, low, high].map(|ratio| significant(ratio, 3));
        format!("{middle} times{what} ({low} to {high}, n = {})", self.n)
    }
}

/// The fastest of some records.
pub(super) struct Fastest<'a> {
    /// The fastest and those that tie with it, fastest first.
    pub(super) level: Vec<&'a Record>,
    /// Those of too few samples, each of which might be as fast.
    few: Vec<&'a Record>,
}

impl<'a> Fastest<'a> {
    /// Of measured records; none where nothing was measured.
    pub(super) fn of(records: &[&'a Record]) -> Option<Self> {
        let ranking = ranking(records.iter().copied());
        let found = Self { level: ranking.winners, few: ranking.unranked };
        (!found.level.is_empty() || !found.few.is_empty()).then_some(found)
    }

    /// What is claimed of the fastest: it holds where all that may be the fastest are so, and not where none is.
    pub(super) fn verdict(&self, claimed: impl Fn(&Record) -> bool) -> Verdict {
        let all: Vec<bool> = self.level.iter().chain(&self.few).map(|record| claimed(record)).collect();
        match all.iter().filter(|claimed| **claimed).count() {
            0 if !self.level.is_empty() => Verdict::DidNotHold,
            some if some == all.len() && self.few.is_empty() => Verdict::Held,
            _ => Verdict::Unclear,
        }
    }

    /// "8 x 8, n = 12", or the first few of a tie, each by its name; then those of too few samples.
    pub(super) fn text(&self, name: impl Fn(&Record) -> String) -> String {
        let few = few_names(&self.few, |record| name(record));
        let few = if few.is_empty() { few } else { format!("not enough samples: {few}") };
        let Some(n) = self.level.iter().map(|record| record.samples_ms.len()).min() else { return few };
        let shown = self.level.iter().take(4).map(|record| name(record));
        let more =
            self.level.len().checked_sub(4).filter(|more| *more > 0).map(|more| format!("and {more} more"));
        let names = shown.chain(more).collect::<Vec<_>>().join(", ");
        let tie = if self.level.len() > 1 { " (a tie: their intervals overlap)" } else { "" };
        let few = if few.is_empty() { few } else { format!("; {few}") };
        format!("{names}{tie}, n = {n}{few}")
    }
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
    fn few_samples_are_unclear_however_great_the_difference() {
        let far = |n| ratio([20.0, 21.0], [1.0, 1.1], n);
        assert_eq!([far(5), far(4)].map(|far| far.verdict_slower()), [Verdict::Held, Verdict::Unclear]);
        assert_eq!([far(5), far(4)].map(|far| far.verdict(2.0..=99.0)), [Verdict::Held, Verdict::Unclear]);
        assert_eq!(far(4).text(" as fast"), "not enough samples (n = 4)");
        assert_eq!(far(5).text(" as fast"), "19.5 times as fast (18.2 to 21.0, n = 5)");
    }

    #[test]
    fn the_fastest_is_not_known_beside_few_samples() {
        let of = |n: usize| Record { samples_ms: vec![9.0; n], ..measured("gpu", "naive", 4, [9.0, 9.1]) };
        let verdict = |n: usize, side: u32| {
            let records = [of(n), measured("gpu", "naive", 8, [5.0, 5.1])];
            let found = Fastest::of(&records.iter().collect::<Vec<_>>()).expect("two are measured");
            found.verdict(|record| record.local_size == Some([side; 2]))
        };
        assert_eq!([verdict(5, 8), verdict(5, 4)], [Verdict::Held, Verdict::DidNotHold]);
        assert_eq!([verdict(4, 8), verdict(4, 4)], [Verdict::Unclear, Verdict::Unclear]);
        assert_eq!(verdict(4, 16), Verdict::DidNotHold, "of the ranked one it is known");
        assert!(Fastest::of(&[]).is_none());
    }

    #[test]
    fn a_range_holds_only_with_both_ends_in_it() {
        let about_two = ratio([1.9, 2.1], [1.0, 1.0], 10);
        let verdicts = [1.5..=2.5, 2.0..=3.0, 3.0..=4.0, 0.5..=1.5].map(|range| about_two.verdict(range));
        assert_eq!(verdicts, [Verdict::Held, Verdict::Unclear, Verdict::DidNotHold, Verdict::DidNotHold]);
    }
}
