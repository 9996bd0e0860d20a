//! Detects times that cluster around two values, for example because a machine changes between two speeds.

use super::MIN_SAMPLES;
use super::summary::quantile;
use std::collections::BTreeMap;

/// The [`dip`] of n times is too large for times with one mode if the dip, multiplied by sqrt(n), exceeds the
/// threshold [`DIP_LIMIT`] - [`DIP_DECREASE`] / sqrt(n). Among distributions with one mode, the uniform
/// distribution has the largest dips (Hartigan and Hartigan, *The Dip Test of Unimodality*, Annals of
/// Statistics 13, 1985). In a simulation, sets of 10 to 200 random numbers were drawn from the uniform
/// distribution. For 99.9% of these sets, the dip (multiplied by sqrt(n)) stayed below the threshold.
/// Therefore, if the times of a point have one mode (they cluster around one value), their dip exceeds the
/// threshold with a probability of at most about 1 in 1000. In practice the probability of such a dip is
/// lower, since distributions of times have tails, unlike the uniform distribution.
const DIP_LIMIT: f64 = 0.8;
const DIP_DECREASE: f64 = 0.75;
/// [`Modes::of`] returns `None` for fewer than `FEWEST` times.
const FEWEST: usize = 10;
/// Two values around which times cluster are treated as one mode if the greater value exceeds the smaller value by at
/// most the fraction `LEAST_DISTANCE`. Without this rule, the steps of a timer would look like modes.
const LEAST_DISTANCE: f64 = 0.05;

/// Two values around which times cluster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modes {
    /// The median of the faster times, and the median of the slower times.
    pub ms: [f64; 2],
    /// The number of times in each mode, the faster mode first.
    pub samples: [usize; 2],
    /// The longest time of the faster mode; longer times belong to the slower mode.
    pub parted_at_ms: f64,
}

impl Modes {
    /// Returns the two modes of some times; `None` if there are fewer than [`FEWEST`] times, or if the times may have a
    /// single mode. `launches` has the number of each time's launch, or is empty if these numbers are unknown.
    pub fn of(times_ms: &[f64], launches: &[u32]) -> Option<Self> {
        let mut sorted = times_ms.to_vec();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        if n < FEWEST {
            return None;
        }
        let (fast, slow) = sorted.split_at(cut(&sorted));
        let ms = [fast, slow].map(|mode| quantile(mode, 0.5));
        let modes = Self { ms, samples: [fast.len(), slow.len()], parted_at_ms: *fast.last()? };
        let are_apart = ms[1] > ms[0] * (1.0 + LEAST_DISTANCE);
        let are_two =
            modes.have_dip(&sorted) || is_gap_wide(fast, slow) && modes.are_launches(times_ms, launches);
        (are_apart && are_two).then_some(modes)
    }

    /// Returns true if two conditions hold. First, the [`dip`] of the times exceeds the threshold (see
    /// [`DIP_LIMIT`]). Second, two groups of times with the sizes `samples` can have a dip above this
    /// threshold. If n times have only two values, and the rarer value occurs k times, the dip of these times
    /// is k / 2n. If the values within the two groups of times differ, the dip is larger than k / 2n by at most
    /// about 1 / 2n. If the smaller group of times is too small to cause the dip, this group consists of a few
    /// outliers, such as samples that took long. The dip then has another cause, such as the steps of a timer.
    fn have_dip(&self, sorted: &[f64]) -> bool {
        let n = sorted.len() as f64;
        let root = n.sqrt();
        let (least, fewer) = (DIP_LIMIT - DIP_DECREASE / root, self.samples[0].min(self.samples[1]));
        dip(sorted) * root > least && (fewer as f64 + 1.0) / (2.0 * n) * root > least
    }

    /// Returns true if there are at least two launches, each launch has at least [`MIN_SAMPLES`] times, and
    /// no launch has times of both modes. A comparison of launches can find one slow launch of four even if
    /// the launches have too few times for the dip test ([`dip`]). If all launches are equally fast, the five
    /// times of a given launch exceed the fifteen times of the three other launches with a probability of
    /// only 1 in 15,504.
    fn are_launches(&self, times_ms: &[f64], launches: &[u32]) -> bool {
        let mut counts: BTreeMap<u32, [usize; 2]> = BTreeMap::new();
        for (launch, ms) in launches.iter().zip(times_ms) {
            counts.entry(*launch).or_default()[usize::from(*ms > self.parted_at_ms)] += 1;
        }
        let is_whole = |[fast, slow]: &[usize; 2]| *fast.min(slow) == 0 && fast + slow >= MIN_SAMPLES;
        counts.len() > 1 && counts.values().all(is_whole)
    }
}

/// Returns true if the gap between two groups of sorted times is wider than each of the groups. If the gap
/// between fast and slow times is narrower, all launches may differ a little from each other, instead of
/// having one of two speeds.
fn is_gap_wide(fast: &[f64], slow: &[f64]) -> bool {
    let width = |group: &[f64]| group.first().zip(group.last()).map_or(0.0, |(first, last)| last - first);
    let gap = fast.last().zip(slow.first()).map_or(0.0, |(below, above)| above - below);
    gap > width(fast).max(width(slow))
}

/// Splits sorted values into two groups such that the sum of the squared distances from the groups' means is least.
/// Returns the number of values in the group with the lower values.
fn cut(sorted: &[f64]) -> usize {
    let total: f64 = sorted.iter().sum();
    let n = sorted.len() as f64;
    let mut lower = 0.0;
    let mut best = (1, f64::NEG_INFINITY);
    for (index, value) in sorted.iter().enumerate().take(sorted.len() - 1) {
        lower += value;
        let below = (index + 1) as f64;
        // Up to a constant, `between` is the sum of the squared distances of the groups' means from the mean of all
        // values, each weighted by the group's size. If `between` is greatest, the sum of the squared
        // distances within the two groups is least.
        let between = lower * lower / below + (total - lower) * (total - lower) / (n - below);
        if between > best.1 {
            best = (index + 1, between);
        }
    }
    best.0
}

/// Returns the dip: the largest distance between the values' distribution function and the nearest distribution
/// function with one mode. The algorithm is AS 217 (Hartigan, *Computation of the Dip Statistic to Test for
/// Unimodality*, Applied Statistics 34, 1985). The algorithm narrows the *modal interval*, the interval in
/// which the mode lies. The algorithm compares the distribution function with two hulls: the greatest convex
/// minorant (the highest convex curve that is nowhere above the function) and the least concave majorant (the
/// lowest concave curve that is nowhere below it). For values below the modal interval, the algorithm measures
/// the largest distance between the distribution function and its greatest convex minorant; for values above
/// the modal interval, the largest distance between the distribution function and its least concave majorant.
/// The algorithm ends when the modal interval stays the same or has only equal values, or when the largest
/// distance between the two hulls within the modal interval is at most the largest distance measured so far.
fn dip(sorted: &[f64]) -> f64 {
    let n = sorted.len();
    let (mut low, mut high, mut dip) = (0, n - 1, 1.0_f64);
    while sorted[low] < sorted[high] {
        let below = minorant(sorted, low, high);
        let above = majorant(sorted, low, high);
        let (distance, from, to) = widest(sorted, &below, &above);
        if distance <= dip {
            break;
        }
        let under = |ends: &[usize]| deviation(sorted, ends, |steps, line| steps + 1.0 - line);
        let over = |ends: &[usize]| deviation(sorted, ends, |steps, line| line - (steps - 1.0));
        let before = below.windows(2).filter(|ends| ends[1] <= from).map(under);
        let after = above.windows(2).filter(|ends| ends[0] >= to).map(over);
        dip = before.chain(after).fold(dip, f64::max);
        if (low, high) == (from, to) {
            break;
        }
        (low, high) = (from, to);
    }
    dip / (2.0 * n as f64)
}

/// Returns the indices, from `low` to `high`, of the corners of the greatest convex minorant of the
/// distribution function.
fn minorant(sorted: &[f64], low: usize, high: usize) -> Vec<usize> {
    hull(sorted, low, high, |left, right| left >= right)
}

/// Returns the indices, from `low` to `high`, of the corners of the least concave majorant of the distribution
/// function.
fn majorant(sorted: &[f64], low: usize, high: usize) -> Vec<usize> {
    hull(sorted, low, high, |left, right| left <= right)
}

/// Returns the indices of those points of the distribution function that are corners of a hull, including its
/// two ends. The coordinates of a point are a value and the value's index. The arguments of `bent` are the
/// slopes of the hull before and after a point, multiplied by the same number. `bent` returns true if the point
/// is no corner of the hull.
fn hull(sorted: &[f64], low: usize, high: usize, bent: impl Fn(f64, f64) -> bool) -> Vec<usize> {
    let mut hull: Vec<usize> = Vec::new();
    for index in low..=high {
        while let [.., one, other] = hull[..] {
            // The slopes are compared without division, since values may be equal and their difference 0.
            let left = (other - one) as f64 * (sorted[index] - sorted[other]);
            let right = (index - other) as f64 * (sorted[other] - sorted[one]);
            if !bent(left, right) {
                break;
            }
            hull.pop();
        }
        hull.push(index);
    }
    hull
}

/// Returns the greatest distance between the two hulls, measured at the corners of both hulls. The hulls are
/// the convex minorant `below` and the concave majorant `above`. Also returns the first and the last index of
/// the narrower modal interval in which this distance was measured.
fn widest(sorted: &[f64], below: &[usize], above: &[usize]) -> (f64, usize, usize) {
    let mut best = (0.0, below[0], below[below.len() - 1]);
    let mut consider = |distance: f64, from: usize, to: usize| {
        if distance > best.0 {
            best = (distance, from, to);
        }
    };
    for index in above {
        let from = *below.iter().rev().find(|touch| *touch <= index).unwrap_or(&below[0]);
        consider(*index as f64 + 1.0 - on_hull(sorted, below, *index), from, *index);
    }
    for index in below {
        let to = *above.iter().find(|touch| *touch >= index).unwrap_or(&above[above.len() - 1]);
        consider(on_hull(sorted, above, *index) - (*index as f64 - 1.0), *index, to);
    }
    best
}

/// Returns the height of a hull (straight lines between the points with the indices `hull`) at the value with
/// the index `index`.
fn on_hull(sorted: &[f64], hull: &[usize], index: usize) -> f64 {
    let after = hull.partition_point(|touch| *touch < index);
    match (after.checked_sub(1).map(|before| hull[before]), hull.get(after)) {
        (_, Some(touch)) if *touch == index => index as f64,
        (Some(one), Some(other)) => one as f64 + line(sorted, one, *other, index),
        _ => index as f64,
    }
}

/// Returns the difference in height between a straight line and point `one`, at the value with the index `at`. The
/// straight line connects point `one` with point `other`. If the values of the two points are equal, returns `at` -
/// `one`.
fn line(sorted: &[f64], one: usize, other: usize, at: usize) -> f64 {
    let across = sorted[other] - sorted[one];
    if across > 0.0 { (other - one) as f64 * (sorted[at] - sorted[one]) / across } else { (at - one) as f64 }
}

/// Returns the greatest distance between the steps of the distribution function and the line between two
/// points of a hull. The result is at least 1. `distance` takes the heights of the distribution function's
/// step and of the line at the same value, and returns their distance.
fn deviation(sorted: &[f64], ends: &[usize], distance: impl Fn(f64, f64) -> f64) -> f64 {
    let (one, other) = (ends[0], ends[1]);
    let at = |index: usize| distance((index - one) as f64, line(sorted, one, other, index));
    if sorted[one] < sorted[other] { (one..=other).map(at).fold(1.0, f64::max) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        values
    }

    #[test]
    fn the_dip_is_that_of_the_published_algorithm() {
        // The expected dips were not computed by `dip`, but by a translation of the code of R's package diptest, which
        // implements the same algorithm (AS 217).
        let samples = [
            (sorted((1..21).map(|i| f64::from(i * i))), 0.025),
            (sorted([1, 2, 3, 4, 5, 16, 17, 18, 19, 20].map(f64::from).into_iter()), 0.183_333_333),
            (
                sorted((0..40).map(|i| f64::from(i * 37 % 101) / 7.0 + if i % 3 == 0 { 20.0 } else { 0.0 })),
                0.052_622_378,
            ),
            (sorted([1, 1, 1, 1, 2, 2, 2, 2, 3, 9].map(f64::from).into_iter()), 0.2),
            (sorted((0..30).map(f64::from)), 1.0 / 60.0),
            (sorted((0..25).map(|i| f64::from(i * i * 7 % 53))), 0.087_777_778),
        ];
        for (sample, expected) in samples {
            assert!((dip(&sample) - expected).abs() < 1e-8, "{} is not {expected}", dip(&sample));
        }
    }

    #[test]
    fn one_mode_is_hardly_ever_taken_for_two() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut uniform = |n: usize| sorted((0..n).map(|_| 10.0 + 5.0 * random.random_range(0.0..1.0_f64)));
        for n in [10, 30, 100] {
            let bimodal = (0..2000).filter(|_| Modes::of(&uniform(n), &[]).is_some()).count();
            assert!(bimodal <= 8, "{bimodal} of 2000 samples of {n}");
        }
    }

    #[test]
    fn two_speeds_are_detected_with_their_times() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        // Every third time is slow. Each set has at least 24 times: of 15 times, only five would be slow,
        // too few for a second mode.
        for n in [24, 30, 60] {
            let mut time = |index: usize| {
                let noise: f64 = (0..4).map(|_| random.random_range(0.0..1.0_f64) - 0.5).sum();
                if index.is_multiple_of(3) { 174.0 + 3.0 * noise } else { 110.0 + 3.0 * noise }
            };
            let modes = Modes::of(&(0..n).map(&mut time).collect::<Vec<_>>(), &[]).expect("two modes");
            assert_eq!(modes.samples, [n - n.div_ceil(3), n.div_ceil(3)]);
            assert!((modes.ms[0] - 110.0).abs() < 2.0 && (modes.ms[1] - 174.0).abs() < 3.0, "{modes:?}");
        }
    }

    #[test]
    fn a_timers_steps_are_no_modes() {
        assert_eq!(Modes::of(&[10.0, 10.1].repeat(20), &[]), None);
        assert_eq!(Modes::of(&[5.0; 40], &[]), None);
        let expected = Modes { ms: [10.0, 12.0], samples: [20, 20], parted_at_ms: 10.0 };
        assert_eq!(Modes::of(&[12.0, 10.0].repeat(20), &[]), Some(expected));
        assert_eq!(Modes::of(&[10.0, 12.0].repeat(4), &[]), None, "too few");
    }

    /// A timer has steps of 1 us, frames take about 60.5 us, and some of them take 1.3 times as long.
    #[test]
    fn a_few_times_that_took_long_are_no_mode_although_a_timers_steps_make_a_dip() {
        let with = |slow: usize| {
            let time = |index: usize| if index < slow { 0.0785 } else { 0.060 + 0.001 * (index % 2) as f64 };
            Modes::of(&(0..40).map(time).collect::<Vec<_>>(), &[])
        };
        assert_eq!([1, 2, 7].map(with), [None; 3]);
        assert_eq!(with(8).map(|modes| modes.samples), Some([32, 8]));
    }

    /// If one of four launches with five times each is slow, the dip of all times stays below the threshold
    /// for two modes.
    #[test]
    fn a_launch_of_another_speed_is_a_mode_although_the_dip_is_small() {
        let launches: Vec<u32> = (0..20).map(|index| index / 5).collect();
        let times = |of_launch: [f64; 4]| -> Vec<f64> {
            (0..20).map(|index| of_launch[index / 5] * (1.0 + 0.004 * (index * 3 % 5) as f64)).collect()
        };
        let one = times([1.0, 1.0, 1.0, 3.0]);
        assert_eq!(Modes::of(&one, &[]), None);
        assert_eq!(Modes::of(&one, &launches).map(|modes| modes.samples), Some([15, 5]));
        assert_eq!(Modes::of(&times([1.0, 1.0, 1.0, 1.04]), &launches), None);
        assert!(
            Modes::of(&times([1.0, 1.0, 1.0, 1.06]), &launches).is_some(),
            "more than a twentieth longer"
        );
        assert_eq!(Modes::of(&times([1.0, 1.06, 1.12, 1.18]), &launches), None, "each launch differs");
        // One fast launch has a slow sample, and the slow launch has a fast sample.
        let mut mixed = one.clone();
        mixed.swap(2, 17);
        assert_eq!(Modes::of(&mixed, &launches), None);
        // If a launch was interrupted and has too few samples, the launches are not compared, so no modes are
        // found.
        let few: Vec<u32> = (0..20).map(|index| index / 5 + u32::from(index == 19)).collect();
        assert_eq!(Modes::of(&one, &few), None);
    }

    #[test]
    fn ten_times_are_enough_for_two_modes_and_nine_are_not() {
        let times = [10.0, 12.0].repeat(5);
        let expected = Modes { ms: [10.0, 12.0], samples: [5, 5], parted_at_ms: 10.0 };
        assert_eq!(Modes::of(&times, &[]), Some(expected));
        assert_eq!(Modes::of(&times[1..], &[]), None);
    }
}
