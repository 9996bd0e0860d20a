//! Estimates how much the variances of the measured points' times differ from each other. If the variances of
//! all points are similar, they show much about the variance of one point.

use statrs::function::gamma::digamma;

/// Before the distribution of the points' true variances ([`Prior`]) is estimated, a variance of more than
/// `MOST_TIMES` times the typical variance is reduced to this limit. Before a variance is compared with the
/// limit, the bias of the logarithm of an observed variance ([`log_bias`]) is corrected. With two degrees of
/// freedom, the correction of the bias lowers the limit of an observed variance from 16 to 9 times the
/// typical variance. If all points have the same true variance, one observed variance in 8,000 exceeds 9
/// times the typical variance by chance.
const MOST_TIMES: f64 = 16.0;
/// Before the distribution of the points' true variances is estimated, a variance below the fraction
/// `LEAST_SHARE` of the mean variance is raised to this fraction. A variance can be 0, because with a coarse
/// clock all times of a point can be equal.
const LEAST_SHARE: f64 = 1e-4;
/// The limits between which [`inverse_trigamma`] searches the degrees of freedom of the distribution of true
/// variances ([`Prior`]). Few degrees of freedom (near the lower limit) mean that the true variances of
/// points have practically nothing in common. Many degrees of freedom (near the upper limit) mean that the
/// true variances of points are practically equal.
const DEGREES: [f64; 2] = [1e-2, 1e4];
/// Number of halvings of the interval between the limits [`DEGREES`]. After `HALVINGS` halvings, the degrees
/// of freedom are known with a relative error below a millionth.
const HALVINGS: usize = 44;

/// The distribution of the true variances of the points' times: a scaled inverse chi-square distribution,
/// estimated from the observed variances. The method is that of Smyth, "Linear models and empirical Bayes
/// methods for assessing differential expression in microarray experiments" (Statistical Applications in
/// Genetics and Molecular Biology 3, 2004), section 6.2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Prior {
    /// The variance that is assumed for a point before the point's own samples are known.
    pub variance: f64,
    /// The largest weight, in degrees of freedom, that `variance` may get in the mean of `variance` and a point's own
    /// variance. The largest weight is small if the times of some points vary far more than those of others, and large
    /// if the times of all points vary alike.
    pub degrees: f64,
    /// The geometric mean of the true variances.
    pub typical: f64,
}

impl Prior {
    /// Estimates the distribution from one observed variance per point, each with `degrees` degrees of freedom.
    /// All true variances are taken to be equal in four cases: if there are fewer than three points (which
    /// cannot show whether variances differ), if `degrees` is 0, if all observed variances are 0, or if the
    /// observed variances differ no more than by chance.
    pub fn of(variances: &[f64], degrees: usize) -> Self {
        let mean = mean_of(variances.iter().copied());
        if variances.len() < 3 || degrees == 0 || mean == 0.0 {
            return Self { variance: mean, degrees: f64::INFINITY, typical: mean };
        }
        let half = 0.5 * degrees as f64;
        // The mean logarithm of observed variances is the logarithm of the true variance plus `bias`, which
        // is negative.
        let bias = log_bias(half);
        let logs: Vec<f64> =
            variances.iter().map(|variance| variance.max(LEAST_SHARE * mean).ln() - bias).collect();
        let most = mean_of(logs.iter().copied()) + MOST_TIMES.ln();
        let logs: Vec<f64> = logs.iter().map(|log| log.min(most)).collect();
        let typical = mean_of(logs.iter().copied());
        let squares = logs.iter().map(|log| (log - typical).powi(2)).sum::<f64>();
        // The observed variances differ by chance even if all true variances are equal. By chance alone, the
        // logarithms of observed variances have the variance trigamma(half), where trigamma is the second
        // derivative of the logarithm of the gamma function. After trigamma(half) is subtracted, what remains
        // is the variance of the logarithms of the true variances.
        let own = squares / (logs.len() - 1) as f64 - trigamma(half);
        let degrees = 2.0 * inverse_trigamma(own);
        let scale = if degrees.is_finite() { log_bias(0.5 * degrees) } else { 0.0 };
        Self { variance: (typical + scale).exp(), degrees, typical: typical.exp() }
    }
}

fn mean_of(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
}

/// Returns the mean of ln(x / d), where x is a chi-square variable with d = `2 * half` degrees of freedom.
fn log_bias(half: f64) -> f64 {
    digamma(half) - half.ln()
}

/// Returns trigamma(x), the second derivative of ln(gamma(x)), for positive `x`. For arguments below 6, the recurrence
/// (a relation between trigamma at `x` and at `x` + 1) increases the argument; from 6 on, the asymptotic series is
/// used (Abramowitz and Stegun 1964, 6.4.6 and 6.4.12).
fn trigamma(x: f64) -> f64 {
    let (mut at, mut sum) = (x, 0.0);
    while at < 6.0 {
        sum += at.powi(-2);
        at += 1.0;
    }
    let inverse = at.recip();
    let square = inverse * inverse;
    sum + inverse * (1.0 + 0.5 * inverse + square * (1.0 / 6.0 - square * (1.0 / 30.0 - square / 42.0)))
}

/// Returns the argument at which trigamma is `value`. The argument is searched from half of the lower limit in
/// [`DEGREES`] to half of the upper limit. Returns infinity if the argument lies above the range of the search, and the
/// lower end of this range if the argument lies below the range.
fn inverse_trigamma(value: f64) -> f64 {
    let [mut low, mut high] = DEGREES.map(|degrees| 0.5 * degrees);
    if value <= trigamma(high) {
        return f64::INFINITY;
    }
    for _ in 0..HALVINGS {
        // Trigamma decreases as its argument grows.
        let middle = (low * high).sqrt();
        if trigamma(middle) > value { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    /// Returns a thousand quantiles of the exponential distribution, which variances with two degrees of freedom have.
    fn alike() -> Vec<f64> {
        (0..1000).map(|k| -(1.0 - (f64::from(k) + 0.5) / 1000.0).ln()).collect()
    }

    #[test]
    fn trigamma_is_that_of_the_tables() {
        let square = std::f64::consts::PI.powi(2);
        for (x, expected) in [(0.5, square / 2.0), (1.0, square / 6.0), (2.0, square / 6.0 - 1.0)] {
            assert!((trigamma(x) - expected).abs() < 1e-8, "{x}");
            assert!((inverse_trigamma(expected) - x).abs() < 1e-4, "{x}");
        }
        // For a large argument x, trigamma is about 1/x + 1/(2 x^2) + 1/(6 x^3).
        assert!((trigamma(100.0) - 0.010_050_166_7).abs() < 1e-9);
        assert_eq!((inverse_trigamma(0.0), inverse_trigamma(-1.0)), (f64::INFINITY, f64::INFINITY));
    }

    #[test]
    fn points_that_vary_alike_borrow_without_limit() {
        let prior = Prior::of(&alike(), 2);
        assert!(prior.degrees > 100.0 && (prior.variance - 1.0).abs() < 0.02, "{prior:?}");
        assert!((prior.typical - 1.0).abs() < 0.02, "{prior:?}");
    }

    #[test]
    fn the_spread_of_true_variances_is_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut exponential = || -rng.random_range(1e-12..1.0_f64).ln();
        // A chi-square variable with four degrees of freedom is twice the sum of two exponential variables.
        let mut observed = || 4.0 / (2.0 * (exponential() + exponential())) * exponential();
        let observed: Vec<f64> = (0..20_000).map(|_| observed()).collect();
        let prior = Prior::of(&observed, 2);
        assert!((prior.degrees - 4.0).abs() < 0.6 && (prior.variance - 1.0).abs() < 0.1, "{prior:?}");
        // By definition, the geometric mean of the true variances is given by ln(typical) = ln(1) -
        // (digamma(2) - ln(2)). In this formula, 1 is the prior's variance, and 2 is half of the prior's four
        // degrees of freedom.
        assert!((prior.typical - 1.31).abs() < 0.05, "{prior:?}");
    }

    /// The variances of half of the points are a hundred times as large as those of the other points, so the
    /// variance of one point says little about the variance of another point.
    #[test]
    fn points_of_two_kinds_borrow_little() {
        let of_two: Vec<f64> =
            alike().iter().enumerate().map(|(k, v)| if k % 2 == 0 { *v } else { 100.0 * v }).collect();
        let prior = Prior::of(&of_two, 2);
        assert!(prior.degrees < 1.5 && prior.variance < 10.0, "{prior:?}");
    }

    #[test]
    fn one_point_far_away_hardly_changes_what_the_others_borrow() {
        let thirty: Vec<f64> = (0..30).map(|k| alike()[16 + 33 * k]).collect();
        let mut with_one = thirty.clone();
        with_one[7] = 1e4;
        let (before, after) = (Prior::of(&thirty, 2), Prior::of(&with_one, 2));
        assert!(
            after.degrees > 4.0 && (after.typical / before.typical - 1.0).abs() < 0.2,
            "{before:?} {after:?}"
        );
        assert!(after.variance < before.variance * 1.2);
    }

    #[test]
    fn few_points_are_taken_to_be_alike_and_no_variance_is_no_error() {
        assert_eq!(Prior::of(&[1.0, 3.0], 2), Prior { variance: 2.0, degrees: f64::INFINITY, typical: 2.0 });
        assert_eq!(Prior::of(&[0.0; 4], 2).variance, 0.0);
        assert_eq!(Prior::of(&[], 2).variance, 0.0);
        // If a clock has coarse steps, some observed variances may be zero.
        let coarse = Prior::of(&[0.0, 1.0, 1.0, 1.0, 1.0, 1.0], 3);
        assert!(coarse.variance > 0.0 && coarse.variance.is_finite() && coarse.degrees > 0.0, "{coarse:?}");
    }
}
