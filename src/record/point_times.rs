//! Computes the times of a single point: the median with its interval, and the numbers of launches and
//! samples.

use super::outcome::Outcome;
use super::types::Record;
use crate::measure::MIN_SAMPLES;
use std::collections::HashMap;

/// Returns the median of a record's samples in milliseconds; `None` if the record's outcome is not "measured".
pub fn median(record: &Record) -> Option<f64> {
    record.median_ms.filter(|_| record.outcome == Outcome::Measured)
}

/// Returns the 95% interval of the median in milliseconds; `None` for a record with too few samples, or with
/// times of 0.
pub(crate) fn interval(record: &Record) -> Option<[f64; 2]> {
    let interval = record.relative_times.as_ref()?.median_ms;
    Some([interval.low, interval.high])
}

/// Returns the number of launches in which a record was measured: 0 without samples, and 1 if the record has samples
/// but does not state their launches.
pub(crate) fn launches(record: &Record) -> usize {
    let mut numbers = record.sample_launches.clone();
    numbers.dedup();
    numbers.len().max(usize::from(!record.samples_ms.is_empty()))
}

/// Returns the number of samples in the launch that has the fewest samples, not counting samples with a time
/// of 0.
pub(crate) fn fewest(record: &Record) -> usize {
    fewest_where(record, |ms| ms > 0.0)
}

/// Counts, in each launch, the samples for which `counts` returns true. Returns the smallest of these numbers of
/// samples over all launches. If the record does not state the launches of its samples, counts all samples together.
fn fewest_where(record: &Record, counts: impl Fn(f64) -> bool) -> usize {
    // The map first gets an entry for every launch, so that a launch in which no sample counts has the
    // number 0.
    let mut of_launches: HashMap<u32, usize> =
        record.sample_launches.iter().map(|launch| (*launch, 0)).collect();
    for (launch, ms) in record.sample_launches.iter().zip(&record.samples_ms) {
        *of_launches.entry(*launch).or_default() += usize::from(counts(*ms));
    }
    let all = || record.samples_ms.iter().filter(|ms| counts(**ms)).count();
    of_launches.into_values().min().unwrap_or_else(all)
}

/// Returns true if a measured record has enough samples, but cannot be ranked, because some of its times
/// are 0. A measured time can be 0 if a frame takes less than a step of the device's timer.
pub(crate) fn is_below_resolution(record: &Record) -> bool {
    let has_zero = record.samples_ms.iter().any(|ms| *ms <= 0.0);
    median(record).is_some()
        && record.relative_times.is_none()
        && has_zero
        && fewest_where(record, |_| true) >= MIN_SAMPLES
}

#[cfg(test)]
mod tests {
    use super::super::together::tests::in_two_launches;
    use super::*;

    #[test]
    fn a_launch_without_times_above_0_has_the_fewest_samples() {
        let record = in_two_launches("naive", 10.0, 0.0);
        assert_eq!(fewest(&record), 5);
        let zeros = in_two_launches("naive", 10.0, -1.0);
        assert_eq!((fewest(&zeros), fewest_where(&zeros, |_| true)), (0, 5));
        // Records of earlier versions of raycl do not state the launches of samples.
        let old = Record { sample_launches: Vec::new(), ..record };
        assert_eq!(fewest(&old), 10);
    }
}
