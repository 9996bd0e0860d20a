//! What a point's samples amount to.

use rand::RngExt as _;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::{MIN_SAMPLES, mean_and_sigma};

/// Resamples of the bootstrap.
const RESAMPLES: usize = 1000;
/// The bootstrap's seed: the same samples always give the same interval.
const SEED: u64 = 2026;

/// What a point's samples amount to, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Samples.
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
    /// Least.
    pub min_ms: f64,
    /// Greatest.
    pub max_ms: f64,
    /// The median's 95% interval, by percentile bootstrap; none of fewer than [`MIN_SAMPLES`].
    pub ci95_ms: Option<[f64; 2]>,
}

impl Summary {
    /// Summarises samples in any order; none of no samples, or if one is not finite.
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
            ci95_ms: (sorted.len() >= MIN_SAMPLES).then(|| median_interval(&sorted)),
        })
    }
}

/// The quantile `q` (0 to 1) of at least one sorted value, interpolated linearly
/// (type 7 of Hyndman and Fan 1996, as R and NumPy have it).
fn quantile(sorted: &[f64], q: f64) -> f64 {
    let place = q * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    below + (above - below) * place.fract()
}

/// The 95% percentile interval of the median over resamples of the sorted values, and the median with it.
fn median_interval(sorted: &[f64]) -> [f64; 2] {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut places = vec![0; sorted.len()];
    let mut medians: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            places.fill_with(|| rng.random_range(0..sorted.len()));
            resampled_median(sorted, &mut places)
        })
        .collect();
    medians.sort_by(f64::total_cmp);
    let median = quantile(sorted, 0.5);
    [quantile(&medians, 0.025).min(median), quantile(&medians, 0.975).max(median)]
}

/// The median of the values at `places`. The values are sorted, so places order as values do.
fn resampled_median(sorted: &[f64], places: &mut [usize]) -> f64 {
    let n = places.len();
    let (lower, &mut upper, _) = places.select_nth_unstable(n / 2);
    match lower.iter().max() {
        Some(&below) if n.is_multiple_of(2) => f64::midpoint(sorted[below], sorted[upper]),
        _ => sorted[upper],
    }
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
    fn few_samples_have_no_interval_and_none_is_no_summary() {
        let summary = Summary::of(&[2.5]).unwrap();
        assert_eq!((summary.ci95_ms, summary.sigma_ms), (None, 0.0));
        assert_eq!(Summary::of(&[2.5; 4]).unwrap().ci95_ms, None);
        assert_eq!(Summary::of(&[2.5; 5]).unwrap().ci95_ms, Some([2.5, 2.5]));
        assert_eq!(Summary::of(&[]), None);
        assert_eq!(Summary::of(&[1.0, f64::NAN]), None);
    }

    #[test]
    fn the_interval_is_about_that_of_order_statistics() {
        // For 0..=100 the exact 95% interval of the median is the 41st to the 61st value.
        let samples: Vec<f64> = (0..=100).map(f64::from).collect();
        let [low, high] = Summary::of(&samples).unwrap().ci95_ms.unwrap();
        assert!((low - 40.0).abs() <= 2.0 && (high - 60.0).abs() <= 2.0, "{low} {high}");
    }

    #[test]
    fn an_outlier_moves_the_mean_but_not_the_interval() {
        let mut samples = vec![1.0; 20];
        samples.push(100.0);
        let summary = Summary::of(&samples).unwrap();
        assert!(summary.mean_ms > 5.0);
        assert_eq!(summary.ci95_ms, Some([1.0, 1.0]));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn figures_are_in_order(samples in prop::collection::vec(1e-4..1e4_f64, 1..60)) {
            let s = Summary::of(&samples).unwrap();
            prop_assert!(s.min_ms <= s.q1_ms && s.q1_ms <= s.median_ms);
            prop_assert!(s.median_ms <= s.q3_ms && s.q3_ms <= s.max_ms);
            prop_assert_eq!(s.ci95_ms.is_some(), samples.len() >= MIN_SAMPLES);
            let [low, high] = s.ci95_ms.unwrap_or([s.median_ms; 2]);
            prop_assert!(s.min_ms <= low && low <= s.median_ms && s.median_ms <= high && high <= s.max_ms);
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
            prop_assert_eq!(two.ci95_ms, one.ci95_ms.map(|ends| ends.map(|end| 2.0 * end)));
        }
    }
}
