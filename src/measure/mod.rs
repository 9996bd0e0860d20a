//! Statistics of repeated measurements: when to stop, medians and intervals, which points are the winners,
//! and whether two results differ.
//!
//! This module uses no device and no clock: its functions get measured times as arguments, in milliseconds.

mod batch;
mod compare;
mod enough;
mod modes;
mod order;
mod paired;
mod preempted;
mod ranking;
mod stopping;
mod student;
mod summary;

pub use batch::batch_size;
pub use compare::Verdict;
pub use enough::{BELOW_RESOLUTION, MIN_SAMPLES, not_enough};
pub use modes::Modes;
pub use order::round_order;
pub use paired::{BetweenRuns, Interval, Paired, PairedSample, Relative, Standing};
pub use preempted::{utilization, without_preempted};
pub use ranking::Ranking;
pub use stopping::{StopReason, StoppingRule};
pub use summary::Summary;
pub(crate) use summary::{median_of, quantile};

/// Returns the mean and the sample standard deviation (n - 1); the deviation of fewer than two samples is 0. Without
/// samples, the mean is not a number (NaN).
fn mean_and_sigma(samples: &[f64]) -> (f64, f64) {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let squares: f64 = samples.iter().map(|sample| (sample - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0).max(1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deviation_is_that_of_a_sample_and_0_for_one_value() {
        let (mean, sigma) = mean_and_sigma(&[4.0, 1.0, 3.0, 2.0, 10.0]);
        assert_eq!(mean, 4.0);
        assert!((sigma - 12.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(mean_and_sigma(&[2.5]), (2.5, 0.0));
    }
}
