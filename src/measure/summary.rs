//! Computes medians, quartiles and other quantiles of samples.

/// The median and the quartiles of some samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// The median of the samples.
    pub median: f64,
    /// The first quartile of the samples: a quarter of them lie below it.
    pub q1: f64,
    /// The third quartile of the samples: three quarters of them lie below it.
    pub q3: f64,
}

impl Summary {
    /// Summarises samples in any order. Returns `None` if there are no samples or if a sample is not finite.
    pub fn of(samples: &[f64]) -> Option<Self> {
        if samples.is_empty() || !samples.iter().all(|sample| sample.is_finite()) {
            return None;
        }
        let mut sorted = samples.to_vec();
        sorted.sort_by(f64::total_cmp);
        Some(Self {
            median: quantile(&sorted, 0.5),
            q1: quantile(&sorted, 0.25),
            q3: quantile(&sorted, 0.75),
        })
    }
}

/// Returns the median of values in any order; `None` if there are no values.
pub(crate) fn median_of(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    (!sorted.is_empty()).then(|| quantile(&sorted, 0.5))
}

/// Returns the quantile `q` (0 to 1) of at least one sorted value, by linear interpolation (type 7 of Hyndman
/// and Fan 1996, as in R and NumPy).
pub(crate) fn quantile(sorted: &[f64], q: f64) -> f64 {
    let position = q * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[position.floor() as usize], sorted[position.ceil() as usize]);
    below + (above - below) * position.fract()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn figures_of_a_known_sample() {
        let summary = Summary::of(&[4.0, 1.0, 3.0, 2.0, 10.0]).unwrap();
        assert_eq!((summary.q1, summary.median, summary.q3), (2.0, 3.0, 4.0));
        assert_eq!(Summary::of(&[1.0, 2.0]).unwrap().median, 1.5);
    }

    #[test]
    fn of_an_even_number_the_median_is_halfway_between_the_middle_two() {
        assert_eq!(median_of(&[4.0, 1.0, 3.0, 2.0]), Some(2.5));
        let summary = Summary::of(&[4.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!((summary.q1, summary.median, summary.q3), (1.75, 2.5, 3.25));
    }

    #[test]
    fn one_sample_has_no_spread_and_none_is_no_summary() {
        assert_eq!(Summary::of(&[2.5]), Some(Summary { median: 2.5, q1: 2.5, q3: 2.5 }));
        assert_eq!(Summary::of(&[]), None);
        assert_eq!([f64::NAN, f64::INFINITY].map(|odd| Summary::of(&[1.0, odd])), [None; 2]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn figures_are_in_order(samples in prop::collection::vec(1e-4..1e4_f64, 1..60)) {
            let s = Summary::of(&samples).unwrap();
            prop_assert!(s.q1 <= s.median && s.median <= s.q3);
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
            prop_assert_eq!(two.median, 2.0 * one.median);
        }
    }
}
