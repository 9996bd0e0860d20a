//! Summarises a point's samples.

use serde::Serialize;

use super::mean_and_sigma;

/// A summary of a point's samples, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Number of samples.
    pub n: usize,
    /// Median.
    pub median_ms: f64,
    /// First quartile.
    pub q1_ms: f64,
    /// Third quartile.
    pub q3_ms: f64,
    /// Mean.
    pub mean_ms: f64,
    /// Sample standard deviation; 0 for one sample.
    pub sigma_ms: f64,
    /// Minimum.
    pub min_ms: f64,
    /// Maximum.
    pub max_ms: f64,
}

impl Summary {
    /// Summarises samples in any order; `None` if there are none or one is not finite.
    pub fn of(samples_ms: &[f64]) -> Option<Self> {
        if samples_ms.is_empty() || !samples_ms.iter().all(|sample| sample.is_finite()) {
            return None;
        }
        let mut sorted = samples_ms.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (mean_ms, sigma_ms) = mean_and_sigma(&sorted);
        Some(Self {
            n: sorted.len(),
            median_ms: quantile(&sorted, 0.5),
            q1_ms: quantile(&sorted, 0.25),
            q3_ms: quantile(&sorted, 0.75),
            mean_ms,
            sigma_ms,
            min_ms: sorted[0],
            max_ms: sorted[sorted.len() - 1],
        })
    }
}

/// Returns the median of values in any order; `None` if there are none.
pub(crate) fn median_of(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    (!sorted.is_empty()).then(|| quantile(&sorted, 0.5))
}

/// Returns the quantile `q` (0 to 1) of at least one sorted value, by linear interpolation (type 7 of Hyndman
/// and Fan 1996, as in R and NumPy).
pub(crate) fn quantile(sorted: &[f64], q: f64) -> f64 {
    let place = q * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    below + (above - below) * place.fract()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn figures_of_a_known_sample() {
        let summary = Summary::of(&[4.0, 1.0, 3.0, 2.0, 10.0]).unwrap();
        assert_eq!((summary.n, summary.min_ms, summary.max_ms), (5, 1.0, 10.0));
        assert_eq!((summary.q1_ms, summary.median_ms, summary.q3_ms), (2.0, 3.0, 4.0));
        assert_eq!(summary.mean_ms, 4.0);
        assert!((summary.sigma_ms - 12.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(Summary::of(&[1.0, 2.0]).unwrap().median_ms, 1.5);
    }

    #[test]
    fn of_an_even_number_the_median_is_halfway_between_the_middle_two() {
        assert_eq!(median_of(&[4.0, 1.0, 3.0, 2.0]), Some(2.5));
        let summary = Summary::of(&[4.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!((summary.q1_ms, summary.median_ms, summary.q3_ms), (1.75, 2.5, 3.25));
    }

    #[test]
    fn one_sample_has_no_spread_and_none_is_no_summary() {
        assert_eq!(Summary::of(&[2.5]).unwrap().sigma_ms, 0.0);
        assert_eq!(Summary::of(&[]), None);
        assert_eq!(Summary::of(&[1.0, f64::NAN]), None);
    }

    #[test]
    fn an_outlier_moves_the_mean_but_not_the_median() {
        let mut samples = vec![1.0; 20];
        samples.push(100.0);
        let summary = Summary::of(&samples).unwrap();
        assert!(summary.mean_ms > 5.0);
        assert_eq!(summary.median_ms, 1.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn figures_are_in_order(samples in prop::collection::vec(1e-4..1e4_f64, 1..60)) {
            let s = Summary::of(&samples).unwrap();
            prop_assert!(s.min_ms <= s.q1_ms && s.q1_ms <= s.median_ms);
            prop_assert!(s.median_ms <= s.q3_ms && s.q3_ms <= s.max_ms);
            let rounding = 1e-9 * s.max_ms;
            prop_assert!(s.min_ms - rounding <= s.mean_ms && s.mean_ms <= s.max_ms + rounding);
        }

        #[test]
        fn the_order_of_samples_does_not_matter(mut samples in prop::collection::vec(1e-4..1e4_f64, 1..60)) {
            let forward = Summary::of(&samples);
            samples.reverse();
            prop_assert_eq!(forward, Summary::of(&samples));
        }

        #[test]
        fn times_scale(samples in prop::collection::vec(1e-2..1e2_f64, 2..30)) {
            let doubled: Vec<f64> = samples.iter().map(|sample| 2.0 * sample).collect();
            let (one, two) = (Summary::of(&samples).unwrap(), Summary::of(&doubled).unwrap());
            prop_assert_eq!(two.median_ms, 2.0 * one.median_ms);
        }
    }
}
