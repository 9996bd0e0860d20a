//! Subtracts the drift that all points of a launch share from the samples of this launch.

use super::sample::{PairedSample, by_point};
use crate::measure::summary::median_of;
use std::collections::HashSet;

/// Number of iterations of the median polish. In practice, the third and later iterations change the values
/// only by rounding.
const ITERATIONS: usize = 5;
/// The machine's speed at a sample is estimated from at most `MOST_NEIGHBOURS` samples before the sample, and from as
/// many samples after the sample. A machine usually stays at one speed for tens of samples, so most of these
/// neighbouring samples were probably measured at the same speed.
const MOST_NEIGHBOURS: usize = 6;

/// Returns the logarithm of each sample's time in one launch, minus the drift of the machine at the time of the
/// sample.
///
/// The function assumes that the logarithm of a sample's time is the sum of two terms: the level of the
/// sample's point, and the machine's drift at the moment of the sample. A point's level is the same for all
/// samples of this point in the launch. A median polish (Tukey 1977) separates the levels from the drift by
/// repeating two steps. The first step subtracts the machine's drift from the logarithms of the times, and
/// computes a point's level as the median of the point's differences. The second step subtracts the points'
/// levels from the logarithms of the times, and computes the drift as a running median of the differences.
/// The running median at a sample includes this sample and its neighbours in time, which may belong to any
/// point. The drift has a value for every sample, so the drift also follows a change of the machine's speed
/// within a round. If a change slows all points equally, subtracting the drift removes this change.
pub(super) fn without_drift(samples: &[PairedSample], points: usize) -> Vec<f64> {
    let logs: Vec<f64> = samples.iter().map(|sample| sample.ms.ln()).collect();
    let present = samples.iter().map(|sample| sample.point).collect::<HashSet<_>>().len();
    let reach = present.clamp(2, MOST_NEIGHBOURS);
    let mut left = logs.clone();
    for _ in 0..ITERATIONS {
        let levels = levels(samples, &left, points);
        let residuals: Vec<f64> =
            samples.iter().zip(&logs).map(|(sample, log)| log - levels[sample.point]).collect();
        left = logs
            .iter()
            .enumerate()
            .map(|(index, log)| log - running_median(&residuals, index, reach))
            .collect();
    }
    left
}

/// Returns the median of each point's `values`; 0 for a point without samples.
fn levels(samples: &[PairedSample], values: &[f64], points: usize) -> Vec<f64> {
    by_point(samples, values, points).iter().map(|values| median_of(values).unwrap_or(0.0)).collect()
}

fn running_median(values: &[f64], index: usize, reach: usize) -> f64 {
    let window = index.saturating_sub(reach)..(index + reach + 1).min(values.len());
    median_of(&values[window]).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_regime_that_begins_in_the_midst_of_a_round_is_taken_away() {
        // Three points take 1, 2 and 4 ms. From sample 20 on (counted from 0), all three points take twice as
        // long.
        let sample = |index: usize| {
            let (point, slow) = (index % 3, if index < 20 { 1.0 } else { 2.0 });
            PairedSample { point, launch: 0, ms: f64::from(1 << point) * slow }
        };
        let samples: Vec<_> = (0..40).map(sample).collect();
        let left = without_drift(&samples, 3);
        let reference = left[0];
        for (sample, left) in samples.iter().zip(&left) {
            let expected = f64::from(1 << sample.point).ln();
            assert!((left - reference - expected).abs() < 1e-9, "{sample:?}: {left}");
        }
    }
    /// A point without samples gives no information about the machine, so it does not increase the number of
    /// neighbouring samples from which the drift is estimated.
    #[test]
    fn only_points_with_samples_count_as_neighbours() {
        // The times of two points increase from sample to sample; after 15 samples, they suddenly return to the time of
        // the first sample.
        let ms = |index: usize| 1.0 + if index < 15 { index as f64 } else { 0.0 };
        let sample = |index: usize| PairedSample { point: index % 2, launch: 0, ms: ms(index) };
        let samples: Vec<_> = (0..30).map(sample).collect();
        assert_eq!(without_drift(&samples, 40), without_drift(&samples, 2));
    }

    /// If a launch has only two points, the drift at a sample is estimated from two samples on either side.
    #[test]
    fn a_short_slow_regime_of_two_points_is_taken_away() {
        // Two points take 1 and 2 ms, and in five samples twice as long.
        let sample = |index: usize| {
            let (point, slow) = (index % 2, if (12..17).contains(&index) { 2.0 } else { 1.0 });
            PairedSample { point, launch: 0, ms: f64::from(1 << point) * slow }
        };
        let samples: Vec<_> = (0..30).map(sample).collect();
        let left = without_drift(&samples, 2);
        for (sample, value) in samples.iter().zip(&left) {
            let expected = f64::from(1 << sample.point).ln();
            assert!((value - left[0] - expected).abs() < 1e-9, "{sample:?}: {value}");
        }
    }
}
