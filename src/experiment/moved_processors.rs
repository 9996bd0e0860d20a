//! Finds samples during which the processors of a virtual machine probably ran on cores that were not at their usual
//! distance.
//!
//! The host of a virtual machine runs each of the machine's processors on one of the host's cores. Two processors can
//! share a core, as its two hardware threads. A host moves the processors of a virtual machine from one core to
//! another, often for some seconds. While a virtual machine's processors run on cores far from each other, kernels
//! whose work-groups share data take up to 1.5 times as long as usual. While two processors of a virtual machine share
//! a core, kernels take about 1.4 times as long as usual (a median; some kernels even become faster). The core-to-core
//! latency around a sample is the time in which a cache line moves from one processor to another. The core-to-core
//! latency is larger than usual if the cores are far from each other, and smaller if processors share a core. The
//! core-to-core latency is measured between samples, so it does not depend on the times of the points. *Near*
//! processors run on cores at their usual distance. A sample does not count if the core-to-core latency around the
//! sample is much larger or smaller than the latency of near processors in the same run. Before a sample, a launch
//! waits until the processors run on cores at their usual distance, but only for a limited time. All samples count
//! until a run has read the latency often enough to know the latency's usual value. A launch does not count if too few
//! of its samples count; an additional launch replaces a launch that does not count. A group has at most twice as many
//! launches as requested.

use super::Taken;
use crate::measure::MIN_SAMPLES;
use crate::record::LEAST_READINGS;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The largest number of launches of a group, including additional launches, as a multiple of the requested number.
const MOST: usize = 2;
/// If the core-to-core latency around a sample is more than `FAR` times the usual latency, raycl assumes that the
/// processors ran on cores further apart than usual. Readings of the latency between the same two cores differ by a
/// factor of up to 1.7.
const FAR: f64 = 2.0;
/// If the core-to-core latency around a sample is less than `SHARED` times the usual latency, raycl assumes that two
/// processors shared a core. Processors that share a core have 0.45 to 0.5 times the usual latency (docs/log.md,
/// section "2026-11-26, morning: two processors on one core, ..."). The limit is below 1 / 1.7, since readings between
/// the same two cores differ by a factor of up to 1.7.
const SHARED: f64 = 0.55;
/// The pause between two readings of the latency while a launch waits until its processors are at their usual distance.
/// The processors are idle during the pause, since a host moves idle processors back sooner than busy processors: idle
/// processors after at most two seconds, and busy processors after two to ten seconds (docs/log.md, section
/// "2026-11-26, afternoon: a launch waits for near processors, ...").
const PAUSE: Duration = Duration::from_millis(50);
/// All waits of a launch for processors at their usual distance together take at most the fraction `WAITS` of
/// the time for the launch's samples, plus [`PATIENCE`].
pub(super) const WAITS: f64 = 0.5;
/// The time that a launch may wait for processors at their usual distance, beyond the fraction [`WAITS`] of
/// the time for its samples. Before its first sample, a launch may wait only for the time `PATIENCE`.
const PATIENCE: Duration = Duration::from_secs(1);

/// A complete launch of a group of points (every point has enough samples), with a core-to-core latency for
/// each sample.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Launch {
    /// The launch's number, which is unique in the folder of results.
    pub number: u32,
    /// The core-to-core latency around each sample of each point, in nanoseconds; `None` if the latency is
    /// unknown.
    latencies_ns: Vec<Vec<Option<f64>>>,
}

impl Launch {
    /// Returns the launch with the number `number`. `points` has the samples of each point from all launches.
    pub fn of<'a>(number: u32, points: impl Iterator<Item = &'a [Taken]>) -> Self {
        let of_launch = |taken: &[Taken]| {
            let samples = taken.iter().filter(|one| one.launch == number);
            samples.map(|one| one.core_to_core_ns).collect()
        };
        Self { number, latencies_ns: points.map(of_launch).collect() }
    }

    /// Returns true if enough samples of the launch count: for each point, at least five samples (see
    /// [`is_near`]). If a point has fewer than five samples in the launch, all its samples must count.
    fn counts(&self, near_ns: f64) -> bool {
        self.latencies_ns.iter().all(|point| {
            let near = point.iter().filter(|ns| is_near(**ns, near_ns)).count();
            near >= point.len().min(MIN_SAMPLES)
        })
    }
}

/// Readings of the core-to-core latency, in a run or an attempt.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Latencies {
    /// The readings in nanoseconds, in ascending order.
    ascending_ns: Vec<f64>,
    /// The reading that was added last, in nanoseconds.
    last_ns: Option<f64>,
}

impl Latencies {
    /// Collects readings in nanoseconds, in the order in which they were taken; `None` is an unknown latency.
    pub fn of(readings_ns: impl IntoIterator<Item = Option<f64>>) -> Self {
        let mut ascending_ns: Vec<f64> = readings_ns.into_iter().flatten().collect();
        // Sorting once is much faster than inserting each reading at its place, as `add` does.
        ascending_ns.dedup();
        let last_ns = ascending_ns.last().copied();
        ascending_ns.sort_unstable_by(f64::total_cmp);
        Self { ascending_ns, last_ns }
    }

    /// Adds a reading in nanoseconds, if the latency is known. Short samples that follow each other have the same
    /// reading, which is added only once.
    pub fn add(&mut self, reading_ns: Option<f64>) {
        let Some(ns) = reading_ns.filter(|_| reading_ns != self.last_ns) else { return };
        let index = self.ascending_ns.partition_point(|other| *other < ns);
        self.ascending_ns.insert(index, ns);
        self.last_ns = reading_ns;
    }

    /// Returns the latency of near processors in nanoseconds: the 20th percentile of all readings. Returns infinity if
    /// there are fewer than `LEAST_READINGS` readings. The smallest reading would be a worse result: if two processors
    /// of the virtual machine had shared a core during this reading, processors at their usual distance would count as
    /// far apart. The median would also be a worse result: in some runs, the processors run on cores far from each
    /// other for most of the time.
    pub fn near_ns(&self) -> f64 {
        match self.ascending_ns.len() {
            0..LEAST_READINGS => f64::INFINITY,
            count => self.ascending_ns[count / 5],
        }
    }
}

/// Returns true if a sample counts: the core-to-core latency around the sample is unknown, or lies
/// between `SHARED` and `FAR` times the usual latency `near_ns`. If `near_ns` is infinite, every sample
/// counts: either the usual latency of the run is not known yet, or the sample's group keeps all samples.
pub(super) fn is_near(core_to_core_ns: Option<f64>, near_ns: f64) -> bool {
    let near = SHARED * near_ns..=FAR * near_ns;
    near_ns.is_infinite() || core_to_core_ns.is_none_or(|ns| near.contains(&ns))
}

/// Of the readings of the core-to-core latency before and after a sample, returns the reading that decides whether the
/// sample counts. If a reading is far from the usual latency, this reading decides; otherwise, the larger reading
/// decides.
pub(super) fn decisive_ns(readings: [Option<f64>; 2], near_ns: f64) -> Option<f64> {
    let known = || readings.into_iter().flatten();
    known().find(|ns| !is_near(Some(*ns), near_ns)).or_else(|| known().reduce(f64::max))
}

/// Returns how long a launch may still wait until its processors are at their usual distance. The launch
/// began `elapsed` ago, and has spent the part `waited` of this time waiting.
pub(super) fn patience(elapsed: Duration, waited: Duration) -> Duration {
    let most = elapsed.saturating_sub(waited).mul_f64(WAITS) + PATIENCE;
    most.saturating_sub(waited)
}

/// Waits until the processors are near, but not longer than `most`; ends early if the run is `interrupted`. `read`
/// reads the core-to-core latency in nanoseconds, and `last` is the reading before the wait. Returns the last reading.
pub(super) fn wait_until_near(
    mut last: Option<f64>,
    near_ns: f64,
    most: Duration,
    interrupted: &AtomicBool,
    mut read: impl FnMut() -> Option<f64>,
) -> Option<f64> {
    let start = Instant::now();
    while !is_near(last, near_ns) && start.elapsed() < most && !interrupted.load(Ordering::Relaxed) {
        std::thread::sleep(PAUSE);
        last = read();
    }
    last
}

/// Returns true if a group of points needs no further launch: either `wanted` of its launches count, or the
/// group already has the largest number of launches.
pub(super) fn are_enough(launches: &[Launch], wanted: usize, near_ns: f64) -> bool {
    let counted = launches.iter().filter(|launch| launch.counts(near_ns)).count();
    counted >= wanted || launches.len() >= MOST * wanted
}

/// Returns the largest number of additional launches of a group of points if `wanted` launches were
/// requested.
pub(super) fn most_additional(wanted: usize) -> usize {
    (MOST - 1) * wanted
}

/// Returns the numbers of the launches that do not count, because too few of their samples count. If every
/// launch has too few samples that count, all launches count nevertheless.
fn moved_launches(launches: &[Launch], near_ns: f64) -> Vec<u32> {
    let moved = launches.iter().filter(|launch| !launch.counts(near_ns));
    let moved: Vec<u32> = moved.map(|launch| launch.number).collect();
    if moved.len() < launches.len() { moved } else { Vec::new() }
}

/// The number of launches that do not count, and, in the launches that count, the number of samples that do
/// not count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LeftOut {
    pub launches: u32,
    pub samples: u32,
}

/// Removes two kinds of samples from `taken`: all samples of launches that do not count and, in the other
/// launches, the samples for which `is_near` is false. If every launch has too few samples that count, no
/// sample is removed. Returns how many launches and samples were left out; `None` if no latency is known.
pub(super) fn leave_out_moved(taken: &mut Vec<Taken>, launches: &[Launch], near_ns: f64) -> Option<LeftOut> {
    let is_known = taken.iter().any(|one| one.core_to_core_ns.is_some());
    let moved = moved_launches(launches, near_ns);
    taken.retain(|one| !moved.contains(&one.launch));
    let all = taken.len();
    if launches.iter().any(|launch| launch.counts(near_ns)) {
        taken.retain(|one| is_near(one.core_to_core_ns, near_ns));
    }
    let left_out = LeftOut { launches: moved.len() as u32, samples: (all - taken.len()) as u32 };
    is_known.then_some(left_out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::launch::FrameTimes;

    /// Returns one launch for each of these core-to-core latencies. In each launch, a point has five samples with the
    /// launch's latency; 0 means that the latency is unknown.
    fn launches(latencies: &[f64]) -> Vec<Launch> {
        let launch =
            |(number, ns): (u32, &f64)| Launch { number, latencies_ns: vec![vec![known(*ns); MIN_SAMPLES]] };
        (0..).zip(latencies).map(launch).collect()
    }

    fn known(ns: f64) -> Option<f64> {
        (ns > 0.0).then_some(ns)
    }

    /// Returns samples of a launch, one for each of these core-to-core latencies.
    fn samples(launch: u32, latencies: &[f64]) -> Vec<Taken> {
        let sample = |ns: &f64| {
            let times = FrameTimes::whole(1.0, 1.0);
            Taken { launch, at_ms: 0.0, core_to_core_ns: known(*ns), times }
        };
        latencies.iter().map(sample).collect()
    }

    #[test]
    fn moments_in_which_processors_share_a_core_do_not_decide_which_samples_are_near() {
        let near_ns = |counts: [usize; 3]| {
            let ascending_ns =
                [vec![14.0; counts[0]], vec![31.0; counts[1]], vec![164.0; counts[2]]].concat();
            Latencies { ascending_ns, last_ns: None }.near_ns()
        };
        assert_eq!([near_ns([3, 40, 20]), near_ns([3, 20, 70]), near_ns([2, 8, 0])], [31.0; 3]);
        assert_eq!(near_ns([3, 7, 0]), 14.0);
    }

    #[test]
    fn few_readings_leave_no_sample_out() {
        let latencies = |count: u32| Latencies::of((0..count).map(|n| Some(60.0 + f64::from(n))));
        assert_eq!(
            [latencies(0), latencies(9), latencies(10)].map(|all| all.near_ns()),
            [f64::INFINITY, f64::INFINITY, 62.0]
        );
        // The readings of a short run: the first is from the only line of `rounds.jsonl`, the others are from
        // the samples of a point.
        let read = [119.52, 102.0, 74.07, 98.0, 92.0, 95.0, 95.0, 104.0];
        let near_ns = Latencies::of(read.map(Some)).near_ns();
        assert!(read.into_iter().all(|ns| is_near(Some(ns), near_ns)));
        let enough = Latencies::of(read.into_iter().chain([97.0, 99.0, 101.0]).map(Some));
        assert!(enough.near_ns() == 95.0 && read.into_iter().all(|ns| is_near(Some(ns), enough.near_ns())));
    }

    #[test]
    fn a_reading_of_several_samples_is_one_reading() {
        let of_samples = [95.0, 95.0, 90.0, 90.0, 90.0, 95.0].map(Some);
        let mut added = Latencies::default();
        of_samples.into_iter().for_each(|reading_ns| added.add(reading_ns));
        assert_eq!(added.ascending_ns, [90.0, 95.0, 95.0]);
        assert_eq!(Latencies::of(of_samples), added);
        assert_eq!(Latencies::of([None, Some(90.0), None]).ascending_ns, [90.0]);
    }

    #[test]
    fn samples_with_processors_further_apart_or_on_one_core_do_not_count() {
        let count = |ns| is_near(Some(ns), 31.0);
        assert_eq!([15.5, 17.0, 17.1, 31.0, 62.0, 62.1].map(count), [false, false, true, true, true, false]);
        // Readings between the same two cores differ by a factor of up to 1.7.
        assert!(count(31.0 / 1.7) && count(31.0 * 1.7));
        assert!(is_near(None, 31.0));
        assert!(is_near(Some(14.0), f64::INFINITY) && is_near(Some(164.0), f64::INFINITY));
    }

    #[test]
    fn a_sample_counts_only_if_both_readings_around_it_are_near() {
        let of = |before, after| decisive_ns([before, after], 31.0);
        assert_eq!([of(Some(14.0), Some(31.0)), of(Some(31.0), Some(14.0))], [Some(14.0); 2]);
        assert_eq!([of(Some(164.0), Some(31.0)), of(Some(30.0), Some(33.0))], [Some(164.0), Some(33.0)]);
        assert_eq!([of(None, Some(31.0)), of(None, None)], [Some(31.0), None]);
        assert_eq!(decisive_ns([Some(14.0), Some(31.0)], f64::INFINITY), Some(31.0));
    }

    /// Waits until the core-to-core latency has about its usual value of 31 ns. Successive readings return
    /// the values `latencies_ns`, and then always the last value; 0 means that the latency is unknown.
    /// Returns the last value that was read, and the number of readings during the wait.
    fn waits(latencies_ns: &[f64], most: Duration, is_interrupted: bool) -> (Option<f64>, usize) {
        let mut readings = 0;
        let read = || {
            readings += 1;
            latencies_ns.get(readings).or(latencies_ns.last()).copied().and_then(known)
        };
        let last = known(latencies_ns[0]);
        let last = wait_until_near(last, 31.0, most, &AtomicBool::new(is_interrupted), read);
        (last, readings)
    }

    #[test]
    fn a_launch_waits_until_processors_are_near() {
        // A minute is far longer than the waits in this test take, even on a busy machine.
        let minute = Duration::from_secs(60);
        assert_eq!(waits(&[164.0, 14.0, 32.0, 164.0], minute, false), (Some(32.0), 2));
        assert_eq!(waits(&[31.0, 164.0], 3 * PAUSE, false), (Some(31.0), 0));
        assert_eq!(
            waits(&[164.0, 0.0, 164.0], minute, false),
            (None, 1),
            "an unknown latency counts as near"
        );
        assert_eq!(waits(&[164.0], 3 * PAUSE, true), (Some(164.0), 0), "the user has ended the run");
        assert_eq!(waits(&[164.0], Duration::ZERO, false), (Some(164.0), 0));
        let (last, readings) = waits(&[164.0], 3 * PAUSE, false);
        assert!(last == Some(164.0) && (1..=3).contains(&readings), "{readings} readings");
    }

    #[test]
    fn a_launch_waits_for_half_the_time_of_its_samples_and_a_second() {
        let left = |elapsed, waited| {
            patience(Duration::from_secs(elapsed), Duration::from_secs(waited)).as_secs_f64()
        };
        assert_eq!(
            [left(0, 0), left(10, 0), left(12, 2), left(9, 3), left(10, 4)],
            [1.0, 6.0, 4.0, 1.0, 0.0]
        );
    }

    #[test]
    fn a_launch_counts_if_five_samples_of_each_point_do() {
        let counts = |points: &[Vec<Taken>]| Launch::of(7, points.iter().map(Vec::as_slice)).counts(20.0);
        let first = samples(7, &[200.0, 21.0, 24.0, 9.0, 23.0, 190.0, 22.0, 25.0]);
        assert!(counts(&[first.clone(), samples(7, &[20.0; 5])]));
        assert!(!counts(&[first.clone(), samples(7, &[20.0, 180.0, 20.0, 20.0, 20.0])]));
        assert!(!counts(&[samples(7, &[9.0, 9.0, 20.0, 20.0, 20.0, 20.0])]));
        assert!(!counts(&[[samples(7, &[180.0; 5]), samples(6, &[20.0; 5])].concat()]), "only this launch");
        assert!(counts(&[samples(7, &[20.0, 30.0, 0.0])]), "fewer than five");
        assert!(!counts(&[samples(7, &[20.0, 180.0, 0.0])]));
        assert!(counts(&[samples(7, &[0.0; 5])]));
        assert!(
            counts(&[samples(7, &[0.0, 20.0, 180.0, 20.0, 20.0, 20.0])]),
            "an unknown latency counts as near"
        );
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
        // Both launches count if the usual core-to-core latency is 180 ns. Neither launch counts if the usual
        // latency is 20 ns, for example because another group of the run had samples with 20 ns.
        let far = launches(&[180.0, 190.0]);
        assert!(are_enough(&far, 2, 180.0) && !are_enough(&far, 2, 20.0));
    }

    /// Returns the latencies of the samples that are used, and the numbers of launches and samples that are
    /// left out.
    fn counted(taken: &[Vec<Taken>], launches: &[Launch]) -> (Vec<f64>, Option<[u32; 2]>) {
        let mut taken = taken.concat();
        let left_out = leave_out_moved(&mut taken, launches, 20.0).map(|out| [out.launches, out.samples]);
        (taken.iter().map(|one| one.core_to_core_ns.unwrap_or(0.0)).collect(), left_out)
    }

    #[test]
    fn only_samples_with_near_processors_count() {
        let taken = [samples(0, &[180.0, 20.0]), samples(1, &[40.0, 41.0, 9.0, 0.0])];
        assert_eq!(counted(&taken, &launches(&[180.0, 40.0])), (vec![40.0, 0.0], Some([1, 2])));
        assert_eq!(counted(&taken, &launches(&[30.0, 40.0])), (vec![20.0, 40.0, 0.0], Some([0, 3])));
    }

    #[test]
    fn all_samples_count_if_no_launch_is_near_or_nothing_is_known() {
        let taken = [samples(0, &[180.0, 20.0]), samples(1, &[190.0])];
        assert_eq!(counted(&taken, &launches(&[180.0, 190.0])), (vec![180.0, 20.0, 190.0], Some([0, 0])));
        assert_eq!(counted(&[samples(0, &[0.0; 2])], &launches(&[0.0])), (vec![0.0; 2], None));
    }
}
