//! Finds launches in which the processors of a virtual machine were further apart than in other launches.
//!
//! A host moves the processors of a virtual machine from core to core, often for less than a minute. While they are on
//! cores far from each other, kernels whose work-groups share data take up to 1.5 times as long. The core-to-core
//! latency of a launch shows this, and does not depend on the times of the points. Launches with a much larger latency
//! than the smallest one are therefore replaced by additional launches, and left out of all results.

use crate::record::{MOVED, median_latency_ns};
use std::collections::HashSet;

/// The largest number of launches of a group, including additional launches, as a multiple of the requested number.
const MOST: usize = 2;

/// A complete launch of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Launch {
    /// The launch's number in the folder of results.
    pub number: u32,
    /// The median of the readings of the core-to-core latency during the launch, in nanoseconds; `None` if there are
    /// too few readings.
    pub core_to_core_ns: Option<f64>,
}

impl Launch {
    /// Returns a launch with these readings of the core-to-core latency.
    pub fn of(number: u32, readings_ns: Vec<f64>) -> Self {
        Self { number, core_to_core_ns: median_latency_ns(readings_ns) }
    }
}

/// Returns whether a launch's latency is unknown, or at most 1.5 times `nearest_ns`, the smallest latency of the run.
fn is_near(launch: &Launch, nearest_ns: f64) -> bool {
    launch.core_to_core_ns.is_none_or(|ns| ns <= MOVED * nearest_ns)
}

/// Returns whether a group needs no further launch if `wanted` launches were requested.
pub(super) fn are_enough(launches: &[Launch], wanted: usize, nearest_ns: f64) -> bool {
    let near = launches.iter().filter(|launch| is_near(launch, nearest_ns)).count();
    near >= wanted || launches.len() >= MOST * wanted
}

/// Returns the largest number of additional launches if `wanted` launches were requested.
pub(super) fn most_additional(wanted: usize) -> usize {
    (MOST - 1) * wanted
}

/// Returns the numbers of the launches whose samples do not count: those for which `is_near` is false. If it is false
/// for all launches, all launches count.
pub(super) fn left_out(launches: &[Launch], nearest_ns: f64) -> HashSet<u32> {
    let (near, far): (Vec<&Launch>, Vec<&Launch>) =
        launches.iter().partition(|launch| is_near(launch, nearest_ns));
    let numbers = far.iter().map(|launch| launch.number);
    if near.is_empty() { HashSet::new() } else { numbers.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns launches with these latencies; 0 means that a latency is unknown.
    fn launches(latencies: &[f64]) -> Vec<Launch> {
        let launch =
            |(number, ns): (u32, &f64)| Launch { number, core_to_core_ns: (*ns > 0.0).then_some(*ns) };
        (0..).zip(latencies).map(launch).collect()
    }

    #[test]
    fn a_launch_has_the_median_of_at_least_three_readings() {
        assert_eq!(Launch::of(7, vec![180.0, 20.0, 30.0]), Launch { number: 7, core_to_core_ns: Some(30.0) });
        assert_eq!(Launch::of(7, vec![20.0, 30.0]).core_to_core_ns, None);
    }

    #[test]
    fn launches_with_processors_further_apart_are_replaced() {
        let near = launches(&[20.0, 30.0, 25.0]);
        assert!(are_enough(&near, 3, 20.0) && !are_enough(&near, 4, 20.0));
        assert_eq!(left_out(&near, 20.0), HashSet::new());
        let moved = launches(&[180.0, 20.0, 170.0, 30.0]);
        assert!(!are_enough(&moved, 3, 20.0) && are_enough(&moved, 2, 20.0));
        assert_eq!(left_out(&moved, 20.0), HashSet::from([0, 2]));
        // 31 is more than 1.5 times 20, and 30 is not.
        assert_eq!(left_out(&launches(&[20.0, 31.0, 30.0]), 20.0), HashSet::from([1]));
    }

    #[test]
    fn launches_end_at_twice_their_number() {
        let moved = launches(&[20.0, 180.0, 180.0, 180.0]);
        assert!(are_enough(&moved, 2, 20.0) && !are_enough(&moved[..3], 2, 20.0));
        assert_eq!(left_out(&moved, 20.0), HashSet::from([1, 2, 3]));
    }

    #[test]
    fn launches_of_unknown_or_equal_latency_all_count() {
        assert!(are_enough(&launches(&[0.0, 0.0]), 2, 20.0));
        assert_eq!(left_out(&launches(&[0.0, 20.0, 180.0]), 20.0), HashSet::from([2]));
        // In another group of the run, the processors were closer together.
        let far = launches(&[180.0, 190.0]);
        assert!(are_enough(&far, 2, 180.0) && !are_enough(&far, 2, 20.0));
        assert_eq!(left_out(&far, 20.0), HashSet::new());
    }
}
