//! Decides when a launch has taken enough samples of a group of points.

use super::MIN_SAMPLES;
use serde::{Deserialize, Serialize};

/// The noise of a point is the standard deviation of the point's samples, divided by their mean (sigma / mean). The
/// noise is computed again after each sample. The noise has settled if the latest `SETTLING` values of the noise agree.
const SETTLING: usize = 16;
/// Values of the noise agree if their standard deviation is less than the fraction `SETTLED` of their mean.
const SETTLED: f64 = 0.05;

/// Decides when a group of points has enough samples in a launch. All points of the group stop together, so each
/// point has one sample of every round. All fields except `time_limit_ms` concern only the samples that count
/// (`sample_round` in src/experiment/rounds.rs says which samples do not count).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoppingRule {
    /// Smallest number of samples of a point in a launch, unless the launch reaches its time limit or `max_samples`
    /// earlier.
    pub min_samples: usize,
    /// A launch ends at the latest when each point has this number of samples.
    pub max_samples: usize,
    /// Samples are precise if their standard deviation divided by their mean is below this value.
    pub relative_sigma: f64,
    /// The time limit of a launch, divided by the number of the group's points. Even if this time limit is
    /// exceeded, the launch continues until each point has [`MIN_SAMPLES`] samples that count, or `max_samples`
    /// if that is less.
    pub time_limit_ms: f64,
}

/// The reason why a launch takes no further samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopReason {
    /// The samples of each point are precise: sigma / mean is small.
    Precise,
    /// The samples of some points are not precise, but more samples would hardly change their sigma / mean.
    NoiseSettled,
    /// The group reached its time limit.
    TimeLimit,
    /// The points have reached the largest permitted number of samples.
    MaxSamples,
}

impl StopReason {
    /// Returns the reason's name in records.
    pub fn name(self) -> &'static str {
        match self {
            Self::Precise => "precise",
            Self::NoiseSettled => "noise-settled",
            Self::TimeLimit => "time-limit",
            Self::MaxSamples => "max-samples",
        }
    }
}

impl StoppingRule {
    /// Returns the rule for one of several launches of the worker processes. The limits of samples and time
    /// hold for all launches together, so each launch gets a share of each limit. Each launch takes at least
    /// [`MIN_SAMPLES`] samples, unless `max_samples` is lower.
    pub fn shared_by(self, launches: usize) -> Self {
        let least = self.least();
        Self {
            min_samples: self.min_samples.div_ceil(launches).max(least),
            max_samples: self.max_samples.div_ceil(launches).max(least),
            time_limit_ms: self.time_limit_ms / launches as f64,
            ..self
        }
    }

    /// Returns the least number of samples that each point must have in a launch for the launch to be used.
    pub fn least(&self) -> usize {
        MIN_SAMPLES.min(self.max_samples)
    }

    /// Returns the reason to stop after a round, or `None` if another round is needed. `points_ms` contains, for
    /// each point, the times of the samples that count. `elapsed_ms` is the time that all samples together took,
    /// including those that do not count.
    pub fn stop(&self, points_ms: &[Vec<f64>], elapsed_ms: f64) -> Option<StopReason> {
        let rounds = points_ms.iter().map(Vec::len).min().unwrap_or(0);
        if rounds >= self.min_samples.max(2)
            && let Some(reason) = self.known(points_ms)
        {
            return Some(reason);
        }
        if rounds >= self.least() && elapsed_ms >= self.time_limit_ms * points_ms.len() as f64 {
            return Some(StopReason::TimeLimit);
        }
        (rounds >= self.max_samples).then_some(StopReason::MaxSamples)
    }

    /// Returns the reason to stop if, for each point, the samples are precise or the noise has settled; otherwise
    /// `None`.
    fn known(&self, points_ms: &[Vec<f64>]) -> Option<StopReason> {
        let noise: Vec<_> = points_ms.iter().map(|samples| running_noise(samples)).collect();
        let precise = |noise: &Vec<f64>| noise.last().is_some_and(|&last| last < self.relative_sigma);
        if noise.iter().all(precise) {
            return Some(StopReason::Precise);
        }
        noise.iter().all(|noise| precise(noise) || settled(noise)).then_some(StopReason::NoiseSettled)
    }
}

/// Returns sigma / mean of the first 2, 3, ... samples by the method of Welford (1962), which reads the samples once
/// and does not subtract large numbers that are almost equal.
fn running_noise(samples: &[f64]) -> Vec<f64> {
    let (mut mean, mut squares) = (0.0, 0.0);
    let mut noise = Vec::with_capacity(samples.len());
    for (before, sample) in samples.iter().enumerate() {
        let distance = sample - mean;
        mean += distance / (before + 1) as f64;
        squares += distance * (sample - mean);
        if before > 0 {
            let sigma = (squares / before as f64).sqrt();
            // If all samples are 0, because the frames take less than a step of the clock, sigma / mean would
            // not be a number.
            noise.push(if sigma == 0.0 { 0.0 } else { sigma / mean });
        }
    }
    noise
}

/// Returns true if the last [`SETTLING`] noise values agree (see [`SETTLED`]). Returns false if there are
/// fewer than [`SETTLING`] values.
fn settled(noise: &[f64]) -> bool {
    noise.last_chunk::<SETTLING>().is_some_and(|last| {
        let (mean, sigma) = super::mean_and_sigma(last);
        sigma < SETTLED * mean
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const RULE: StoppingRule =
        StoppingRule { min_samples: 10, max_samples: 500, relative_sigma: 0.005, time_limit_ms: 1000.0 };

    fn stop(samples: &[f64], elapsed_ms: f64) -> Option<StopReason> {
        RULE.stop(&[samples.to_vec()], elapsed_ms)
    }

    #[test]
    fn a_reason_has_the_same_name_in_all_files() {
        for reason in
            [StopReason::Precise, StopReason::NoiseSettled, StopReason::TimeLimit, StopReason::MaxSamples]
        {
            assert_eq!(serde_json::to_value(reason).unwrap(), reason.name());
        }
    }

    #[test]
    fn ten_equal_samples_are_precise_and_nine_are_not_enough() {
        assert_eq!(stop(&[1.0; 9], 9.0), None);
        assert_eq!(stop(&[1.0; 10], 10.0), Some(StopReason::Precise));
        assert_eq!(stop(&[0.0; 10], 10.0), Some(StopReason::Precise));
    }

    #[test]
    fn precise_is_below_the_rules_sigma() {
        let samples_of =
            |sigma: f64| (0..10).map(|i| 1.0 + if i % 2 == 0 { sigma } else { -sigma }).collect();
        let stop = |sigma: f64| RULE.stop(&[samples_of(sigma)], 10.0);
        assert_eq!((stop(0.0046), stop(0.0054)), (Some(StopReason::Precise), None));
    }

    #[test]
    fn with_a_sigma_of_zero_no_samples_are_precise() {
        let rule = StoppingRule { relative_sigma: 0.0, ..RULE };
        assert_eq!(rule.stop(&[vec![1.0; 40]], 40.0), None);
    }

    #[test]
    fn noise_settles_where_it_varies_by_less_than_a_twentieth() {
        let noise_of = |part: f64| -> Vec<f64> {
            (0..16).map(|i| 0.1 * (1.0 + if i % 2 == 0 { part } else { -part })).collect()
        };
        assert!(settled(&noise_of(0.047)) && !settled(&noise_of(0.053)));
        assert!(!settled(&noise_of(0.0)[1..]), "too few values");
    }

    #[test]
    fn precise_points_and_points_whose_noise_settled_stop_together() {
        let noisy: Vec<f64> = (0..60).map(|i| if i % 2 == 0 { 0.9 } else { 1.1 }).collect();
        let stop = |other: &[f64]| RULE.stop(&[noisy.clone(), other.to_vec()], 60.0);
        assert_eq!(stop(&[1.0; 60]), Some(StopReason::NoiseSettled));
        assert_eq!(stop(&noisy), Some(StopReason::NoiseSettled));
    }

    #[test]
    fn one_noisy_point_keeps_its_group_going() {
        let noisy: Vec<f64> = (0..12).map(|i| 1.0 + 0.01 * f64::from(i)).collect();
        assert_eq!(RULE.stop(&[vec![1.0; 12], noisy], 12.0), None);
        assert_eq!(RULE.stop(&[vec![1.0; 12], vec![2.0; 12]], 12.0), Some(StopReason::Precise));
    }

    #[test]
    fn steady_noise_settles() {
        let noisy: Vec<f64> = (0..100).map(|i| if i % 2 == 0 { 1.0 } else { 1.1 }).collect();
        let stopped = (1..=100).find_map(|n| stop(&noisy[..n], 0.0).map(|reason| (n, reason)));
        let Some((n, StopReason::NoiseSettled)) = stopped else { panic!("{stopped:?}") };
        assert!((17..60).contains(&n), "{n}");
    }

    #[test]
    fn growing_noise_does_not_settle() {
        let worse: Vec<f64> = (0..24).map(|i| 1.0 + 0.001 * f64::from(i).powi(3)).collect();
        assert_eq!(stop(&worse, 0.0), None);
    }

    #[test]
    fn time_cuts_no_launch_below_five_rounds_and_is_the_groups() {
        assert_eq!(stop(&[700.0; 4], 2800.0), None);
        assert_eq!(stop(&[700.0, 900.0, 700.0, 900.0, 800.0], 4000.0), Some(StopReason::TimeLimit));
        let two = [vec![1.0, 2.0, 1.0, 2.0, 1.0], vec![300.0, 200.0, 300.0, 200.0, 300.0]];
        assert_eq!(RULE.stop(&two, 1307.0), None, "a point has 1000 ms, two have 2000");
        let rule = StoppingRule { max_samples: 3, ..RULE };
        assert_eq!(rule.stop(&[vec![1.0, 2.0, 9.0]], 12.0), Some(StopReason::MaxSamples));
    }

    #[test]
    fn launches_share_samples_and_time_and_have_five_rounds_each() {
        let each = RULE.shared_by(3);
        assert_eq!((each.min_samples, each.max_samples, each.least()), (5, 167, 5));
        assert!((each.time_limit_ms - 1000.0 / 3.0).abs() < 1e-9);
        let look = StoppingRule { min_samples: 1, max_samples: 2, ..RULE }.shared_by(1);
        assert_eq!((look.min_samples, look.max_samples, look.least()), (2, 2, 2));
        let few = StoppingRule { min_samples: 5, max_samples: 10, ..RULE }.shared_by(3);
        assert_eq!((few.min_samples, few.max_samples), (5, 5));
    }

    #[test]
    fn noise_runs_as_it_would_be_computed_afresh() {
        let samples = [3.0, 4.0, 8.0, 1.0];
        for (n, noise) in (2..).zip(running_noise(&samples)) {
            let (mean, sigma) = crate::measure::mean_and_sigma(&samples[..n]);
            assert!((noise - sigma / mean).abs() < 1e-12);
        }
    }

    proptest! {
        #[test]
        fn it_always_stops_in_time(samples in prop::collection::vec(0.0..1e3_f64, 0..40), elapsed in 0.0..2e3_f64) {
            let reason = stop(&samples, elapsed);
            prop_assert!(samples.len() < 5 || elapsed < RULE.time_limit_ms || reason.is_some());
            prop_assert!(samples.len() >= RULE.min_samples || elapsed >= RULE.time_limit_ms || reason.is_none());
        }
    }
}
