//! Finds launches in which the processors of a virtual machine were further apart than in other launches.
//!
//! A host moves the processors of a virtual machine from core to core, often for less than a minute. While they are on
//! cores far from each other, kernels whose work-groups share data take up to 1.5 times as long. A launch shows this by
//! its core-to-core latency, which does not depend on the times of the points. Launches at a larger latency are
//! therefore replaced by additional launches, and left out of all results.

use crate::record::{MOVED, median_latency_ns};
use std::collections::HashSet;

/// With additional launches, a group has at most this many times as many launches as were requested.
const MOST: usize = 2;
/// The smallest number of launches to which the others are not added: a single launch would be a mere look.
const LEAST: usize = 2;

/// A complete launch of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Launch {
    /// Its number in the folder.
    pub number: u32,
    /// The median of its core-to-core latency in nanoseconds; `None` if there are too few readings.
    pub core_to_core_ns: Option<f64>,
}

impl Launch {
    /// Returns a launch with these readings of the core-to-core latency.
    pub fn of(number: u32, readings_ns: Vec<f64>) -> Self {
        Self { number, core_to_core_ns: median_latency_ns(readings_ns) }
    }
}

/// Returns the launches whose latency is at most 1.5 times the smallest latency, and those of unknown latency.
fn near(launches: &[Launch]) -> Vec<Launch> {
    let least = launches.iter().filter_map(|launch| launch.core_to_core_ns).fold(f64::INFINITY, f64::min);
    let is_near = |launch: &&Launch| launch.core_to_core_ns.is_none_or(|ns| ns <= MOVED * least);
    launches.iter().filter(is_near).copied().collect()
}

/// Returns whether a group needs no further launch if `wanted` launches were requested.
pub(super) fn are_enough(launches: &[Launch], wanted: usize) -> bool {
    near(launches).len() >= wanted || launches.len() >= MOST * wanted
}

/// Returns the numbers of the launches whose samples do not count. If fewer than two launches are near, all launches
/// count.
pub(super) fn left_out(launches: &[Launch]) -> HashSet<u32> {
    let near = near(launches);
    let is_left_out = |launch: &&Launch| near.len() >= LEAST && !near.contains(launch);
    launches.iter().filter(is_left_out).map(|launch| launch.number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns launches with these latencies; 0 stands for an unknown latency.
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
        let near_at_once = launches(&[20.0, 30.0, 25.0]);
        assert!(are_enough(&near_at_once, 3) && !are_enough(&near_at_once, 4));
        assert_eq!(left_out(&near_at_once), HashSet::new());
        let moved = launches(&[180.0, 20.0, 170.0, 30.0]);
        assert!(!are_enough(&moved, 3) && are_enough(&moved, 2));
        assert_eq!(left_out(&moved), HashSet::from([0, 2]));
        // 31 is more than 1.5 times 20, and 30 is not.
        assert_eq!(left_out(&launches(&[20.0, 31.0, 30.0])), HashSet::from([1]));
    }

    #[test]
    fn launches_end_at_twice_their_number() {
        let moved = launches(&[20.0, 180.0, 180.0, 180.0]);
        assert!(are_enough(&moved, 2) && !are_enough(&moved[..3], 2));
        // One near launch is too few, so all four count.
        assert_eq!(left_out(&moved), HashSet::new());
    }

    #[test]
    fn launches_of_unknown_or_equal_latency_all_count() {
        assert!(are_enough(&launches(&[0.0, 0.0]), 2));
        assert_eq!(left_out(&launches(&[0.0, 20.0, 180.0])), HashSet::from([2]));
        let far = launches(&[180.0, 190.0]);
        assert!(are_enough(&far, 2));
        assert_eq!(left_out(&far), HashSet::new());
    }
}
