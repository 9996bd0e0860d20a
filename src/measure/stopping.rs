//! When a point has been sampled enough.

/// Noise values that must have settled.
const SETTLING: usize = 16;
/// How much they may vary, relative to their mean.
const SETTLED: f64 = 0.05;

/// When a point has been sampled enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoppingRule {
    /// Samples before precision is judged.
    pub min_samples: usize,
    /// Samples never exceeded.
    pub max_samples: usize,
    /// Precise is when sigma / mean is below this.
    pub relative_sigma: f64,
    /// The time a point may take, which may cut it before `min_samples`.
    pub time_limit_ms: f64,
}

impl Default for StoppingRule {
    fn default() -> Self {
        Self { min_samples: 10, max_samples: 1000, relative_sigma: 0.005, time_limit_ms: 10_000.0 }
    }
}

/// Why sampling stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StopReason {
    /// The samples agree: sigma / mean is small.
    Precise,
    /// They do not, but more of them would not change by how much.
    NoiseSettled,
    /// The point's time was up.
    TimeLimit,
    /// The point has as many samples as it may.
    MaxSamples,
}

impl StopReason {
    /// Its name in records.
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
    /// Why to stop after these samples, which took `elapsed_ms` in all; none to go on.
    pub fn stop(&self, samples_ms: &[f64], elapsed_ms: f64) -> Option<StopReason> {
        if samples_ms.len() >= self.min_samples.max(2) {
            let noise = running_noise(samples_ms);
            if noise.last().is_some_and(|&last| last < self.relative_sigma) {
                return Some(StopReason::Precise);
            }
            if settled(&noise) {
                return Some(StopReason::NoiseSettled);
            }
        }
        if elapsed_ms >= self.time_limit_ms {
            return Some(StopReason::TimeLimit);
        }
        (samples_ms.len() >= self.max_samples).then_some(StopReason::MaxSamples)
    }
}

/// sigma / mean of the first 2, 3, ... samples (Welford 1962: one pass, no cancellation).
fn running_noise(samples: &[f64]) -> Vec<f64> {
    let (mut mean, mut squares) = (0.0, 0.0);
    let mut noise = Vec::with_capacity(samples.len());
    for (before, sample) in samples.iter().enumerate() {
        let distance = sample - mean;
        mean += distance / (before + 1) as f64;
        squares += distance * (sample - mean);
        if before > 0 {
            let sigma = (squares / before as f64).sqrt();
            // Samples below the clock's resolution are all 0: they agree.
            noise.push(if sigma == 0.0 { 0.0 } else { sigma / mean });
        }
    }
    noise
}

/// Whether the last values of the noise vary little.
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

    #[test]
    fn ten_equal_samples_are_precise_and_nine_are_not_enough() {
        assert_eq!(RULE.stop(&[1.0; 9], 9.0), None);
        assert_eq!(RULE.stop(&[1.0; 10], 10.0), Some(StopReason::Precise));
        assert_eq!(RULE.stop(&[0.0; 10], 10.0), Some(StopReason::Precise));
    }

    #[test]
    fn steady_noise_settles() {
        let noisy: Vec<f64> = (0..100).map(|i| if i % 2 == 0 { 1.0 } else { 1.1 }).collect();
        let stopped = (1..=100).find_map(|n| RULE.stop(&noisy[..n], 0.0).map(|reason| (n, reason)));
        let Some((n, StopReason::NoiseSettled)) = stopped else { panic!("{stopped:?}") };
        assert!((17..60).contains(&n), "{n}");
    }

    #[test]
    fn growing_noise_does_not_settle() {
        let worse: Vec<f64> = (0..24).map(|i| 1.0 + 0.001 * f64::from(i).powi(3)).collect();
        assert_eq!(RULE.stop(&worse, 0.0), None);
    }

    #[test]
    fn time_cuts_before_ten_samples_and_the_cap_comes_last() {
        assert_eq!(RULE.stop(&[700.0, 900.0], 1600.0), Some(StopReason::TimeLimit));
        let rule = StoppingRule { max_samples: 3, ..RULE };
        assert_eq!(rule.stop(&[1.0, 2.0, 9.0], 12.0), Some(StopReason::MaxSamples));
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
            let reason = RULE.stop(&samples, elapsed);
            prop_assert!(elapsed < RULE.time_limit_ms || reason.is_some());
            prop_assert!(samples.len() >= RULE.min_samples || elapsed >= RULE.time_limit_ms || reason.is_none());
        }
    }
}
