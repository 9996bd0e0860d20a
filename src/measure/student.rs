//! How many standard errors an interval reaches when the error itself is known from few values.

/// The 97.5% quantile of Student's t for 1 to 10 degrees of freedom.
const FEW: [f64; 10] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228];
/// The same of the normal distribution.
const NORMAL: f64 = 1.959_964;

/// The 97.5% quantile of Student's t, so that 95% lie between it and its negative. Beyond the table the expansion of
/// Abramowitz and Stegun (1964, 26.7.5) is right to three decimals. No degrees of freedom know nothing: infinity.
pub(super) fn t975(degrees: usize) -> f64 {
    if degrees == 0 {
        return f64::INFINITY;
    }
    if let Some(quantile) = FEW.get(degrees - 1) {
        return *quantile;
    }
    let (x, n) = (NORMAL, degrees as f64);
    let first = (x.powi(3) + x) / 4.0;
    let second = (5.0 * x.powi(5) + 16.0 * x.powi(3) + 3.0 * x) / 96.0;
    let third = (3.0 * x.powi(7) + 19.0 * x.powi(5) + 17.0 * x.powi(3) - 15.0 * x) / 384.0;
    x + first / n + second / n.powi(2) + third / n.powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (degrees, expected) in
            [(1, 12.706), (2, 4.303), (10, 2.228), (11, 2.201), (30, 2.042), (1000, 1.962)]
        {
            assert!((t975(degrees) - expected).abs() < 1e-3, "{degrees}: {}", t975(degrees));
        }
        assert_eq!(t975(0), f64::INFINITY);
        assert!((0..40).all(|degrees| t975(degrees) > t975(degrees + 1)));
    }
}
