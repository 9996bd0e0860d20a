//! Computes the ratio of two times with its 95% interval, and the verdict on a claim about this ratio.

use super::verdict::{Line, Verdict};
use crate::measure::{BELOW_RESOLUTION, MIN_SAMPLES};
use crate::numbers::significant;
use crate::record::{Record, fewest, median, not_enough, ratio, ratio_of_passes};
use std::ops::RangeInclusive;

/// The ratio of the times of two records, or of two passes of a record.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratio {
    /// The ratio with its 95% interval, or the reason why the ratio is unknown, such as "not enough samples
    /// (n = 3)".
    sure: Result<(f64, [f64; 2]), String>,
    /// For two records: the number of samples of the record with fewer samples. For two passes of a record:
    /// the number of samples in which both passes have a time above 0.
    n: usize,
}

impl Ratio {
    /// Returns the ratio of `slow`'s time to `fast`'s time; `None` if either record has no time. If a record has too
    /// few samples or times of 0, the result contains a reason instead of a ratio.
    pub fn of(slow: &Record, fast: &Record) -> Option<Self> {
        median(slow)?;
        median(fast)?;
        let sure = match ratio(slow, fast) {
            Some(ratio) => Ok((ratio.middle, [ratio.low, ratio.high])),
            None => Err(why_unsure(slow, fast)?),
        };
        let count = |record: &Record| record.samples_ms.len();
        Some(Self { sure, n: count(slow).min(count(fast)) })
    }

    /// Returns the ratio of the times of two passes of a record's frames. `times` contains each sample's
    /// launch number and the times of the two passes. If a pass has the time 0 in some sample, the result
    /// contains a reason instead of a ratio. Returns `None` if `times` is empty.
    pub(super) fn of_passes(record: &Record, times: &[(u32, [f64; 2])]) -> Option<Self> {
        let timed = times.iter().filter(|(_, both)| is_timed(both));
        let ratios: Vec<(u32, f64)> = timed.map(|(launch, [of, to])| (*launch, of / to)).collect();
        let are_timed = ratios.len() == times.len();
        let sure = match are_timed.then(|| ratio_of_passes(record, &ratios)).flatten() {
            Some(ratio) => Ok((ratio.middle, [ratio.low, ratio.high])),
            None => Err(why_unsure_of_passes(times)),
        };
        (!times.is_empty()).then_some(Self { sure, n: ratios.len() })
    }

    /// Returns the ratio, or infinity if the ratio is unknown.
    pub(super) fn middle(&self) -> f64 {
        self.sure.as_ref().map_or(f64::INFINITY, |(middle, _)| *middle)
    }

    /// Returns `Held` if the ratio's 95% interval lies completely inside the range `held`, and `NotHeld` if
    /// the interval lies completely outside. Returns `Unclear` if the interval contains a bound of the range,
    /// or if the ratio is unknown.
    pub(super) fn verdict(&self, held: &RangeInclusive<f64>) -> Verdict {
        let (least, most) = (*held.start(), *held.end());
        match self.sure {
            Ok((_, [low, high])) if low > least && high < most => Verdict::Held,
            Ok((_, [low, high])) if high < least || low > most => Verdict::NotHeld,
            _ => Verdict::Unclear,
        }
    }

    /// Formats the ratio as "3.07 times (3.02 to 3.11, n = 12)". If the ratio is unknown, returns the reason,
    /// such as "not enough samples (n = 3)".
    pub fn text(&self) -> String {
        match &self.sure {
            Ok((middle, [low, high])) => {
                let [middle, low, high] = [middle, low, high].map(|ratio| significant(*ratio, 3));
                format!("{middle} times ({low} to {high}, n = {})", self.n)
            }
            Err(why) => why.clone(),
        }
    }

    /// Formats the ratio as a sentence, such as "a takes 3.07 times (3.02 to 3.11, n = 12) as long as b" or
    /// "a against b: not enough samples (n = 3)".
    pub fn between(&self, of: &str, to: &str) -> String {
        match self.sure {
            Ok(_) => format!("{of} takes {} as long as {to}", self.text()),
            Err(_) => format!("{of} against {to}: {}", self.text()),
        }
    }

    /// Returns the result line for the claim that the ratio is in the range `held`.
    pub(super) fn line(&self, text: String, held: RangeInclusive<f64>) -> Line {
        let text = format!("{text}; required: {}", asked(&held));
        match self.verdict(&held) {
            Verdict::Unclear => Line::unclear(text, self.decides(&held)),
            sure => Line::decided(text, sure == Verdict::Held),
        }
    }

    fn decides(&self, held: &RangeInclusive<f64>) -> String {
        let (low, high) = match &self.sure {
            Ok((_, [low, high])) => (*low, *high),
            Err(why) if why == BELOW_RESOLUTION => return LONGER_FRAMES.to_owned(),
            Err(_) => return more_samples(),
        };
        let bound = [*held.start(), *held.end()].into_iter().find(|bound| (low..=high).contains(bound));
        let bound = bound.map_or(String::new(), |bound| format!(", which contains the bound {bound}"));
        let ends = [low, high].map(|end| significant(end, 3)).join(" to ");
        format!(
            "a narrower interval than {ends}{bound}: more launches or samples, or less load from other programs"
        )
    }
}

/// The text that says what a verdict needs if times are below the timer's resolution: longer frames, since
/// more samples do not help.
const LONGER_FRAMES: &str =
    "longer frames, such as those of a larger image: the times are below the timer's resolution";

/// Returns why the ratio of two records' times is unknown: a record has too few samples, or times of 0. If both
/// records have such a reason, returns the reason of the record for which [`fewest`] is smaller. ([`fewest`] returns
/// the number of samples with a time above 0 in the launch with the fewest such samples.) Returns `None` if neither
/// record has such a reason.
fn why_unsure(slow: &Record, fast: &Record) -> Option<String> {
    let reasons = [slow, fast].into_iter().filter_map(|record| Some((fewest(record), not_enough(record)?)));
    reasons.min_by_key(|(n, _)| *n).map(|(_, why)| why)
}

/// Returns true if both passes of a sample have a time above 0. The measured time is 0 if a pass is shorter
/// than a step of the device's timer.
fn is_timed(both: &[f64; 2]) -> bool {
    both.iter().all(|ms| *ms > 0.0)
}

/// Returns why the ratio of two passes is unknown. If the text states a number n, then n is the number of
/// samples in the launch with the fewest samples. Samples in which a pass has the time 0 are not counted.
fn why_unsure_of_passes(times: &[(u32, [f64; 2])]) -> String {
    let fewest = |counts: &dyn Fn(&[f64; 2]) -> bool| {
        let of =
            |number: u32| times.iter().filter(|(launch, both)| *launch == number && counts(both)).count();
        times.iter().map(|(launch, _)| of(*launch)).min().unwrap_or(0)
    };
    match fewest(&|_| true) >= MIN_SAMPLES {
        true => BELOW_RESOLUTION.to_owned(),
        false => crate::measure::not_enough(fewest(&is_timed)),
    }
}

/// Returns a text that says how many samples a verdict needs. Every launch takes at least this number of
/// samples of a point, unless `timing.max_samples` in the config is smaller.
fn more_samples() -> String {
    format!(
        "{MIN_SAMPLES} samples of each point per launch; `timing.max_samples` must be at least {MIN_SAMPLES}"
    )
}

/// Formats the required range of a ratio as "at least 2", "at most 2" or "0.95 to 1.05".
fn asked(held: &RangeInclusive<f64>) -> String {
    match (*held.start(), *held.end()) {
        (least, f64::INFINITY) => format!("at least {least}"),
        (least, most) if least <= 0.0 => format!("at most {most}"),
        (least, most) => format!("{least} to {most}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{few, judged, measured, sampled};

    /// Returns the ratio of the times of two records with three launches of `n` samples each. `slow` contains
    /// the least and the greatest time of the record whose time is divided, and `fast` those of the other
    /// record. A record's time changes in equal steps from launch to launch.
    fn ratio(slow: [f64; 2], fast: [f64; 2], n: u32) -> Ratio {
        let record = |name: &str, [low, high]: [f64; 2]| {
            let at = move |launch: u32| low + (high - low) * 0.5 * f64::from(launch);
            sampled(name, (0..3).flat_map(move |launch| (0..n).map(move |_| (launch, at(launch)))))
        };
        // When one record is slow in a launch, the other record is fast. If both records were slow in the
        // same launch, the slowdowns would cancel out in the ratio.
        let records = judged([record("naive", slow), record("wide", [fast[1], fast[0]])]);
        Ratio::of(&records[0], &records[1]).expect("both are measured")
    }

    const LONGER: RangeInclusive<f64> = 1.0..=f64::INFINITY;

    #[test]
    fn what_launches_do_not_agree_on_is_unclear() {
        let verdict = |slow, fast| ratio(slow, fast, 5).verdict(&LONGER);
        assert_eq!(verdict([2.0, 2.1], [1.0, 1.1]), Verdict::Held);
        assert_eq!(verdict([1.0, 1.1], [2.0, 2.1]), Verdict::NotHeld);
        assert_eq!(verdict([1.05, 1.2], [1.0, 1.1]), Verdict::Unclear);
        assert_eq!(verdict([1.0, 1.2], [1.0, 1.1]), Verdict::Unclear);
    }

    #[test]
    fn few_samples_are_unclear_however_great_the_difference_and_say_what_would_do() {
        let far = |n| ratio([20.0, 21.0], [1.0, 1.1], n);
        assert_eq!([far(5), far(4)].map(|far| far.verdict(&LONGER)), [Verdict::Held, Verdict::Unclear]);
        assert_eq!(far(4).text(), "not enough samples (n = 4)");
        let text = far(5).text();
        assert!(text.starts_with("19.") && text.ends_with(", n = 15)"), "{text}");
        let line = far(4).line("a".into(), LONGER);
        assert_eq!(
            line.decides,
            "5 samples of each point per launch; `timing.max_samples` must be at least 5"
        );
        let near = ratio([1.05, 1.2], [1.0, 1.1], 5).line("a".into(), LONGER);
        assert!(
            near.decides.starts_with("a narrower interval than 0.")
                && near.decides.contains(", which contains the bound 1:"),
            "{near:?}"
        );
    }

    #[test]
    fn a_range_holds_only_with_both_ends_in_it() {
        let about_two = ratio([1.95, 2.05], [1.0, 1.0], 5);
        let verdicts = [1.5..=2.5, 2.0..=3.0, 3.0..=4.0, 0.5..=1.5].map(|range| about_two.verdict(&range));
        assert_eq!(verdicts, [Verdict::Held, Verdict::Unclear, Verdict::NotHeld, Verdict::NotHeld]);
        assert_eq!(
            [1.0..=f64::INFINITY, 0.0..=2.0, 0.5..=2.0].map(|range| asked(&range)),
            ["at least 1", "at most 2", "0.5 to 2"]
        );
    }

    #[test]
    fn parts_of_the_same_frames_have_a_ratio_of_their_own() {
        let parts = |ratios: &[f64]| ratios.iter().map(|ratio| (0, [*ratio, 1.0])).collect::<Vec<_>>();
        let record = measured("gpu", "deferred", 8, 10.0);
        let of = |times: &[(u32, [f64; 2])]| Ratio::of_passes(&record, times);
        let ratio = of(&parts(&[2.0, 2.1, 1.9, 2.0, 2.05])).expect("it is finite");
        assert_eq!(ratio.verdict(&LONGER), Verdict::Held);
        assert_eq!(of(&parts(&[2.0; 4])).map(|few| few.verdict(&LONGER)), Some(Verdict::Unclear));
        assert!(of(&[]).is_none());
    }

    /// Each case of this test has four launches. In all cases except the last, the ratio is unknown: each
    /// launch has too few samples, or one of the two passes has times of 0.
    #[test]
    fn a_ratio_of_passes_that_is_not_known_has_a_reason() {
        let record = measured("gpu", "deferred", 8, 10.0);
        let of = |per_launch: u32, timed: u32| {
            let sample = |launch, index| (launch, [if index < timed { 2.0 } else { 0.0 }, 1.0]);
            let launches =
                (0..4_u32).flat_map(|launch| (0..per_launch).map(move |index| sample(launch, index)));
            let ratio = Ratio::of_passes(&record, &launches.collect::<Vec<_>>()).expect("there are samples");
            (ratio.text(), ratio.line("a".into(), LONGER).decides)
        };
        assert_eq!(of(4, 4), ("not enough samples (n = 4)".to_owned(), more_samples()));
        assert_eq!(of(4, 3), ("not enough samples (n = 3)".to_owned(), more_samples()));
        for timed in [0, 4, 8] {
            assert_eq!(of(9, timed), (BELOW_RESOLUTION.to_owned(), LONGER_FRAMES.to_owned()), "{timed}");
        }
        assert!(of(9, 9).0.starts_with("2.00 times"));
    }

    /// The test relies on raycl's assumption that the times of a frame's two passes change independently of
    /// each other from run to run.
    #[test]
    fn the_ratio_of_two_passes_includes_the_differences_between_runs() {
        let steady: Vec<(u32, [f64; 2])> = (0..10).map(|index| (index / 5, [2.0, 1.0])).collect();
        for (threads, own) in [(None, 0.004), (Some(2), 0.011)] {
            let record = Record { threads, ..measured("gpu", "deferred", 8, 10.0) };
            let ratio = Ratio::of_passes(&record, &steady).expect("enough samples");
            let (_, [low, high]) = ratio.sure.expect("enough samples");
            assert!(((high / low).ln() - 2.0 * 1.96 * own * 2.0_f64.sqrt()).abs() < 1e-4, "{low} to {high}");
        }
    }

    #[test]
    fn an_interval_that_ends_at_a_bound_is_unclear() {
        let of = |low: f64, high: f64| Ratio { sure: Ok((2.0, [low, high])), n: 10 };
        let within = 1.0..=3.0;
        for (low, high) in [(1.0, 2.5), (1.5, 3.0), (3.0, 4.0), (0.5, 1.0)] {
            assert_eq!(of(low, high).verdict(&within), Verdict::Unclear, "{low} to {high}");
        }
        assert_eq!(of(1.5, 2.5).verdict(&within), Verdict::Held);
        assert_eq!(
            [(3.5, 4.0), (0.5, 0.9)].map(|(low, high)| of(low, high).verdict(&within)),
            [Verdict::NotHeld; 2]
        );
    }

    #[test]
    fn a_comparison_without_enough_samples_has_no_ratio() {
        let of = |sure| Ratio { sure, n: 3 };
        assert_eq!(
            of(Ok((2.0, [1.9, 2.1]))).between("a", "b"),
            "a takes 2.00 times (1.90 to 2.10, n = 3) as long as b"
        );
        let few = Err("not enough samples (n = 3)".to_owned());
        assert_eq!(of(few).between("a", "b"), "a against b: not enough samples (n = 3)");
    }

    #[test]
    fn times_of_zero_are_not_called_few_and_ask_for_longer_frames() {
        let records = judged([few("gpu", "naive", 8, 0.0, 30), measured("gpu", "wide", 8, 1.0)]);
        for [slow, fast] in [[0, 1], [1, 0]] {
            let ratio = Ratio::of(&records[slow], &records[fast]).expect("both are measured");
            assert_eq!(ratio.between("a", "b"), "a against b: times below the timer's resolution");
            let line = ratio.line("a".into(), LONGER);
            assert_eq!((line.verdict, line.decides.as_str()), (Verdict::Unclear, LONGER_FRAMES));
        }
    }

    #[test]
    fn n_is_that_of_the_record_with_fewer_samples() {
        let of = |name: &str, ms: f64, n: u32| sampled(name, (0..n).map(move |_| (0, ms)));
        let records = judged([of("naive", 2000.0, 4), of("wide", 1.0, 9)]);
        for [slow, fast] in [[0, 1], [1, 0]] {
            let ratio = Ratio::of(&records[slow], &records[fast]).expect("both are measured");
            assert_eq!(ratio.text(), "not enough samples (n = 4)");
            let line = ratio.line("a".into(), LONGER);
            assert_eq!(
                line.decides,
                "5 samples of each point per launch; `timing.max_samples` must be at least 5"
            );
        }
        let both = judged([of("naive", 2000.0, 4), of("wide", 1.0, 3)]);
        for [slow, fast] in [[0, 1], [1, 0]] {
            let ratio = Ratio::of(&both[slow], &both[fast]).expect("both are measured");
            assert_eq!(ratio.text(), "not enough samples (n = 3)");
        }
        let records = judged([of("naive", 2000.0, 7), of("wide", 1.0, 9)]);
        let ratio = Ratio::of(&records[0], &records[1]).expect("both are measured");
        assert!(ratio.text().ends_with(", n = 7)"), "{}", ratio.text());
    }
}
