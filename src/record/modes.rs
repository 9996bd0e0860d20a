//! Returns warnings about a record's median, for example that the samples lie around two values.

use super::point_times::{launches, median};
use super::types::Record;
use crate::measure::Modes;
use crate::numbers::ms;
use crate::words::counted;

/// A launch counts as having only one of a record's two modes if at most this fraction of the launch's samples lies in
/// the other mode.
const STRAYS: f64 = 0.1;

/// The timer's step with NVIDIA's driver, in milliseconds. raycl assumes this step for every device, since records do
/// not contain the step of their device's timer.
const TIMER_STEP_MS: f64 = 0.001;

/// Returns a record's warning and, if the record's samples lie around two values, a note on these values;
/// `None` if there is neither a warning nor a note.
pub(crate) fn to_mind(record: &Record) -> Option<String> {
    let parts: Vec<String> = record.warning.clone().into_iter().chain(two_modes(record)).collect();
    (!parts.is_empty()).then(|| parts.join("; "))
}

/// Returns a note such as "two modes: 108.9 ms (18 samples) and 174.5 ms (12 samples), one mode per launch".
/// The words "one mode per launch" are added if each launch has a single mode. Returns `None` if the record has
/// no time, if the samples do not show two modes, or if the two modes may be steps of the timer (see
/// [`are_steps`]).
pub(crate) fn two_modes(record: &Record) -> Option<String> {
    median(record)?;
    let modes =
        Modes::of(&record.samples_ms, &record.sample_launches).filter(|modes| !are_steps(record, modes))?;
    let ([fast, slow], [many, few]) = (modes.ms, modes.samples.map(|count| counted(count, "sample")));
    let whose = if is_by_launch(record, &modes) { ", one mode per launch" } else { "" };
    Some(format!("two modes: {} ms ({many}) and {} ms ({few}){whose}", ms(fast), ms(slow)))
}

/// Returns true if the two modes of a record may be steps of the timer instead of two speeds. This is so if the modes
/// are less than three steps apart, or if a sample is 0. (A timer reports 0 for a time of less than a step.)
fn are_steps(record: &Record, modes: &Modes) -> bool {
    let [fast, slow] = modes.ms;
    slow - fast < 3.0 * TIMER_STEP_MS || record.samples_ms.iter().any(|ms| *ms <= 0.0)
}

/// Returns true if a record has several launches and each launch has a single mode (see [`STRAYS`]).
fn is_by_launch(record: &Record, modes: &Modes) -> bool {
    let of_one = |launch: &u32| {
        let own = record.sample_launches.iter().zip(&record.samples_ms).filter(|(other, _)| *other == launch);
        let (mut fast, mut all) = (0.0, 0.0);
        for (_, ms) in own {
            all += 1.0;
            fast += f64::from(u8::from(*ms <= modes.parted_at_ms));
        }
        fast <= STRAYS * all || fast >= (1.0 - STRAYS) * all
    };
    launches(record) > 1 && record.sample_launches.iter().all(of_one)
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::{measured, sampled};
    use super::*;

    /// Returns a record of three launches with ten samples each; `speeds` has the time of a frame in each launch, in
    /// milliseconds.
    fn launches_of(speeds: [f64; 3]) -> Record {
        let sample = |index: u32| {
            (index / 10, speeds[index as usize / 10] * (1.0 + 0.001 * f64::from(index * 7 % 10)))
        };
        sampled("naive", (0..30).map(sample))
    }

    #[test]
    fn a_launch_of_another_speed_is_said() {
        let said = two_modes(&launches_of([110.0, 110.0, 170.0])).expect("two modes");
        assert_eq!(said, "two modes: 110.5 ms (20 samples) and 170.8 ms (10 samples), one mode per launch");
        assert_eq!(two_modes(&launches_of([110.0, 110.2, 109.9])), None);
        assert_eq!(two_modes(&measured("gpu", "naive", 8, 3.0)), None);
    }

    /// Each launch has seven samples, so that one sample is more than a tenth of a launch. If the slowest
    /// sample of the fast mode were counted as slow, the launch of that sample would have two modes.
    #[test]
    fn each_sample_of_a_short_launch_counts() {
        let sample = |index: u32| {
            let ms = [110.0, 170.0, 110.0, 170.0][index as usize / 7];
            (index / 7, ms * (1.0 + 0.001 * f64::from(index % 7)))
        };
        let said = two_modes(&sampled("naive", (0..28).map(sample))).expect("two modes");
        assert!(said.ends_with(", one mode per launch"), "{said}");
    }

    /// A slow point has few samples, so the dip test cannot show that one of four launches is slow.
    #[test]
    fn one_slow_launch_of_four_is_said_also_of_twenty_samples() {
        let sample = |index: u32| {
            let ms = if index < 15 { 1.0 } else { 3.0 };
            (index / 5, ms * (1.0 + 0.001 * f64::from(index % 5)))
        };
        let said = two_modes(&sampled("naive", (0..20).map(sample))).expect("two modes");
        assert_eq!(said, "two modes: 1.002 ms (15 samples) and 3.006 ms (5 samples), one mode per launch");
    }

    #[test]
    fn speeds_that_change_within_a_launch_are_of_no_launch() {
        let sample = |index: u32| {
            (index / 10, if index.is_multiple_of(3) { 9.0 } else { 5.0 } + 0.01 * f64::from(index % 7))
        };
        let record = Record { warning: Some("it throttled".into()), ..sampled("naive", (0..30).map(sample)) };
        let said = to_mind(&record).expect("two modes");
        assert!(said.starts_with("it throttled; two modes: 5.0") && said.ends_with("(10 samples)"), "{said}");
    }

    #[test]
    fn steps_of_the_timer_are_no_modes() {
        let of = |times: [f64; 2]| {
            two_modes(&sampled("naive", (0..30).map(move |index| (index / 10, times[index as usize % 2]))))
        };
        for steps in [[0.0, 0.001], [0.0, 0.016], [0.002, 0.003], [0.002, 0.004]] {
            assert_eq!(of(steps), None, "{steps:?}");
        }
        let said = of([0.002, 0.006]).expect("two modes");
        assert!(said.starts_with("two modes: ") && said.ends_with("(15 samples)"), "{said}");
    }

    /// A point whose image is wrong has no time, even if its record contains samples.
    #[test]
    fn what_has_no_time_has_no_modes() {
        let record = launches_of([110.0, 110.0, 170.0]);
        assert!(two_modes(&record).is_some());
        assert_eq!(two_modes(&Record { outcome: crate::record::Outcome::WrongImage, ..record }), None);
    }
}
