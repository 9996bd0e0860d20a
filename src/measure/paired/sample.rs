//! One measured time of a point.

/// One measured time of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairedSample {
    /// The index of the measured point among the points that are compared. The indices of anchors (work that is
    /// timed for comparison) follow the indices of the points.
    pub point: usize,
    /// The number of the launch in which the time was measured.
    pub launch: u32,
    /// The measured time of a frame in milliseconds.
    pub ms: f64,
}

/// Returns the values of each of `points` points, in the order of the samples. `values` has one value per
/// sample.
pub(super) fn by_point(samples: &[PairedSample], values: &[f64], points: usize) -> Vec<Vec<f64>> {
    let mut of_points = vec![Vec::new(); points];
    for (sample, value) in samples.iter().zip(values) {
        of_points[sample.point].push(*value);
    }
    of_points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_each_point_keep_the_order_of_the_samples() {
        let samples = [2, 0, 2, 0].map(|point| PairedSample { point, launch: 0, ms: 1.0 });
        assert_eq!(by_point(&samples, &[1.0, 2.0, 3.0, 4.0], 3), [vec![2.0, 4.0], vec![], vec![1.0, 3.0]]);
    }
}
