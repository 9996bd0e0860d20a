//! Computes quantiles of Student's t distribution.

use statrs::distribution::{ContinuousCDF as _, Normal, StudentsT};

/// From `MANY` degrees of freedom on, the quantiles of the normal distribution are used in place of the quantiles
/// of Student's t. For probabilities between 0.0001 and 0.9999, the two differ by less than 0.0002.
const MANY: f64 = 1e5;

/// Returns the value below which Student's t lies with the probability `p`. Returns infinity if `degrees` is 0.
pub(super) fn t_quantile(p: f64, degrees: f64) -> f64 {
    if degrees >= MANY {
        return Normal::standard().inverse_cdf(p);
    }
    StudentsT::new(0.0, 1.0, degrees).map_or(f64::INFINITY, |t| t.inverse_cdf(p))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (p, degrees, expected) in [
            (0.975, 1.0, 12.706),
            (0.975, 2.0, 4.303),
            (0.975, 10.0, 2.228),
            (0.975, 30.0, 2.042),
            (0.975, 1e6, 1.960),
            (0.9995, 10.0, 4.587),
            (0.9995, 2.0, 31.599),
        ] {
            let actual = t_quantile(p, degrees);
            assert!((actual - expected).abs() < 1e-3 * expected, "{p} {degrees}: {actual}");
        }
        assert_eq!(t_quantile(0.975, 0.0), f64::INFINITY);
        assert!((1..40).all(|n| t_quantile(0.975, f64::from(n)) > t_quantile(0.975, f64::from(n + 1))));
    }
}
