//! Finds samples during which the processors of a virtual machine were further apart than in other samples.
//!
//! A host moves the processors of a virtual machine from core to core, often for some seconds. While they are on cores
//! far from each other, kernels whose work-groups share data take up to 1.5 times as long. The core-to-core latency
//! around a sample shows this, and does not depend on the times of the points. Samples with a much larger latency than
//! that of near processors in the same run do not count. Launches in which too few samples count are replaced by additional
//! launches.

use super::Taken;
use crate::measure::MIN_SAMPLES;

/// The largest number of launches of a group, including additional launches, as a multiple of the requested number.
const MOST: usize = 2;
/// If the latency around a sample is more than this many times the latency of near processors, the processors were
/// further apart. Latencies between the same two cores differ by a factor of up to 1.7.
const FAR: f64 = 2.0;

/// A complete launch of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Launch {
    /// The launch's number in the folder of results.
    pub number: u32,
    /// The smallest latency in nanoseconds that five samples of each point do not exceed; `None` if it is unknown.
    pub core_to_core_ns: Option<f64>,
}

impl Launch {
    /// Returns a launch; `points` has the samples of each point, including those of other launches.
    pub fn of<'a>(number: u32, points: impl Iterator<Item = &'a [Taken]>) -> Self {
        let latencies = points.filter_map(|taken| fifth_ns(taken.iter().filter(|one| one.launch == number)));
        Self { number, core_to_core_ns: latencies.reduce(f64::max) }
    }
}

/// Returns the fifth smallest latency of some samples, or the largest if there are fewer than five. Samples of unknown
/// latency are not used.
fn fifth_ns<'a>(samples: impl Iterator<Item = &'a Taken>) -> Option<f64> {
    let mut latencies_ns: Vec<f64> = samples.filter_map(|one| one.core_to_core_ns).collect();
    latencies_ns.sort_unstable_by(f64::total_cmp);
    latencies_ns.get(MIN_SAMPLES - 1).or(latencies_ns.last()).copied()
}

/// Returns the latency of near processors: the 10th percentile of all latencies of the run, which are in ascending order;
/// infinity if there are none. The smallest latency would not do: for moments, two processors of a virtual machine share a
/// core, and all other samples would then be far.
pub(super) fn near_ns(latencies_ns: &[f64]) -> f64 {
    latencies_ns.get(latencies_ns.len() / 10).copied().unwrap_or(f64::INFINITY)
}

/// Returns whether a latency is unknown, or at most twice `near_ns`, the latency of near processors.
pub(super) fn is_near(core_to_core_ns: Option<f64>, near_ns: f64) -> bool {
    core_to_core_ns.is_none_or(|ns| ns <= FAR * near_ns)
}

/// Returns whether a group needs no further launch if `wanted` launches were requested.
pub(super) fn are_enough(launches: &[Launch], wanted: usize, near_ns: f64) -> bool {
    let near = launches.iter().filter(|launch| is_near(launch.core_to_core_ns, near_ns)).count();
    near >= wanted || launches.len() >= MOST * wanted
}

/// Returns the largest number of additional launches if `wanted` launches were requested.
pub(super) fn most_additional(wanted: usize) -> usize {
    (MOST - 1) * wanted
}

/// Returns the numbers of the launches that do not count: those for which `is_near` is false. If it is false for all
/// launches, all of them count.
fn far_launches(launches: &[Launch], near_ns: f64) -> Vec<u32> {
    let far = launches.iter().filter(|launch| !is_near(launch.core_to_core_ns, near_ns));
    let far: Vec<u32> = far.map(|launch| launch.number).collect();
    if far.len() < launches.len() { far } else { Vec::new() }
}

/// The number of launches that do not count, and the number of samples that do not count although their launches count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LeftOut {
    pub launches: u32,
    pub samples: u32,
}

/// Removes the samples that do not count: those of launches that do not count, and those of other launches for which
/// `is_near` is false. If it is false for all launches, all samples count. Returns `None` if no latency is known.
pub(super) fn leave_out_far(taken: &mut Vec<Taken>, launches: &[Launch], near_ns: f64) -> Option<LeftOut> {
    let is_known = taken.iter().any(|one| one.core_to_core_ns.is_some());
    let far = far_launches(launches, near_ns);
    taken.retain(|one| !far.contains(&one.launch));
    let all = taken.len();
    if launches.iter().any(|launch| is_near(launch.core_to_core_ns, near_ns)) {
        taken.retain(|one| is_near(one.core_to_core_ns, near_ns));
    }
    let left_out = LeftOut { launches: far.len() as u32, samples: (all - taken.len()) as u32 };
    is_known.then_some(left_out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::launch::FrameTimes;

    /// Returns launches with these latencies; 0 means that a latency is unknown.
    fn launches(latencies: &[f64]) -> Vec<Launch> {
        (0..).zip(latencies).map(|(number, ns)| Launch { number, core_to_core_ns: known(*ns) }).collect()
    }

    fn known(ns: f64) -> Option<f64> {
        (ns > 0.0).then_some(ns)
    }

    /// Returns samples of a launch with these latencies.
    fn samples(launch: u32, latencies: &[f64]) -> Vec<Taken> {
        let sample = |ns: &f64| {
            let times = FrameTimes::whole(1.0, 1.0);
            Taken { launch, at_ms: 0.0, core_to_core_ns: known(*ns), times }
        };
        latencies.iter().map(sample).collect()
    }

    #[test]
    fn moments_in_which_processors_share_a_core_do_not_decide_which_samples_are_near() {
        let mut latencies_ns = [vec![14.0; 3], vec![31.0; 40], vec![164.0; 20]].concat();
        assert_eq!(near_ns(&latencies_ns), 31.0);
        assert!(is_near(Some(14.0), near_ns(&latencies_ns)) && !is_near(Some(164.0), near_ns(&latencies_ns)));
        latencies_ns.truncate(4);
        assert_eq!([near_ns(&latencies_ns), near_ns(&[])], [14.0, f64::INFINITY]);
    }

    #[test]
    fn a_launch_has_the_latency_within_which_each_point_has_five_samples() {
        let of = |points: &[Vec<Taken>]| Launch::of(7, points.iter().map(Vec::as_slice)).core_to_core_ns;
        let first = samples(7, &[200.0, 21.0, 24.0, 23.0, 190.0, 22.0, 25.0]);
        let second = samples(7, &[20.0, 20.0, 30.0, 20.0, 20.0, 20.0]);
        assert_eq!(of(&[first.clone(), second.clone()]), Some(25.0));
        let third = samples(7, &[20.0, 180.0, 20.0, 20.0, 20.0]);
        assert_eq!(of(&[first.clone(), second.clone(), third]), Some(180.0));
        let other = [first, samples(6, &[1.0; 9])].concat();
        assert_eq!(of(&[other, second]), Some(25.0), "only this launch");
        assert_eq!(of(&[samples(7, &[20.0, 30.0, 0.0])]), Some(30.0), "fewer than five");
        assert_eq!(of(&[samples(7, &[0.0; 5])]), None);
    }

    #[test]
    fn launches_with_processors_further_apart_are_replaced() {
        let near = launches(&[20.0, 40.0, 25.0]);
        assert!(are_enough(&near, 3, 20.0) && !are_enough(&near, 4, 20.0));
        let moved = launches(&[180.0, 20.0, 41.0, 30.0]);
        assert!(!are_enough(&moved, 3, 20.0) && are_enough(&moved, 2, 20.0));
    }

    #[test]
    fn launches_end_at_twice_their_number() {
        let moved = launches(&[20.0, 180.0, 180.0, 180.0]);
        assert!(are_enough(&moved, 2, 20.0) && !are_enough(&moved[..3], 2, 20.0));
    }

    #[test]
    fn launches_of_unknown_or_equal_latency_all_count() {
        assert!(are_enough(&launches(&[0.0, 0.0]), 2, 20.0));
        // In another group of the run, the processors were closer together.
        let far = launches(&[180.0, 190.0]);
        assert!(are_enough(&far, 2, 180.0) && !are_enough(&far, 2, 20.0));
    }

    /// Returns the latencies of the samples that count, and the numbers of launches and samples that do not.
    fn counted(taken: &[Vec<Taken>], launches: &[Launch]) -> (Vec<f64>, Option<[u32; 2]>) {
        let mut taken = taken.concat();
        let far = leave_out_far(&mut taken, launches, 20.0).map(|far| [far.launches, far.samples]);
        (taken.iter().map(|one| one.core_to_core_ns.unwrap_or(0.0)).collect(), far)
    }

    #[test]
    fn only_samples_with_near_processors_count() {
        let taken = [samples(0, &[180.0, 20.0]), samples(1, &[40.0, 41.0, 0.0])];
        assert_eq!(counted(&taken, &launches(&[180.0, 40.0])), (vec![40.0, 0.0], Some([1, 1])));
        assert_eq!(counted(&taken, &launches(&[30.0, 40.0])), (vec![20.0, 40.0, 0.0], Some([0, 2])));
    }

    #[test]
    fn all_samples_count_if_no_launch_is_near_or_nothing_is_known() {
        let taken = [samples(0, &[180.0, 20.0]), samples(1, &[190.0])];
        assert_eq!(counted(&taken, &launches(&[180.0, 190.0])), (vec![180.0, 20.0, 190.0], Some([0, 0])));
        assert_eq!(counted(&[samples(0, &[0.0; 2])], &launches(&[0.0])), (vec![0.0; 2], None));
    }
}
