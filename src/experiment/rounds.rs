//! Times the points of an experiment in interleaved rounds. Every round takes a sample of each point that has not
//! failed, in a seeded random order, so that drift of the machine does not look like a difference between points. The
//! sampling of all points that have not failed stops after the same round.

use crate::error::Result;
use crate::launch::FrameTimes;
use crate::measure::{StopReason, StoppingRule, round_order};

/// Takes the samples of a launch's points; [`measure`] decides the order of the points and the number of
/// rounds.
pub trait Rounds {
    /// Takes one sample of a point: casts a frame or a batch of frames. Returns `None` if the worker process was lost
    /// or the point failed. A failed point is not cast again.
    fn cast(&mut self, point: usize) -> Result<Option<FrameTimes>>;
    /// Is called after each sample. Returns true if the sample counts. A sample does not count if the core-to-core
    /// latency around it was unusual: during the sample, the processors of a virtual machine probably shared a core, or
    /// ran on cores further apart than usual.
    fn sampled(&mut self, point: usize, round: u32, times: &FrameTimes) -> Result<bool>;
    /// Is called at the end of a round, when every point that did not fail has its sample.
    fn ended(&mut self, _round: u32) -> Result<()> {
        Ok(())
    }
    /// Returns true if the launch's samples cannot be used because a worker process was lost.
    fn is_broken(&self) -> bool {
        false
    }
}

/// Why the rounds of a launch (one measurement of a group of points) ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Every point that did not fail has enough samples, or the launch has reached a limit.
    Enough(StopReason),
    /// Every point of the launch failed, so no point is left to be timed.
    AllFailed,
    /// A worker process was lost; the launch must be repeated.
    Broken,
}

/// The largest number of samples of a launch, as a multiple of the number that the launch would need if no
/// sample were left out. If some samples are left out, the launch ends at the latest after the round in which
/// it reaches `MOST` times the usual number of samples.
pub(super) const MOST: u32 = 2;

/// A sample's time in milliseconds, and true if the sample counts.
type TimedSample = (f64, bool);

/// The samples of all points. If a round took a sample of a point twice, the list has only the second sample.
/// `None` stands for a point that failed.
type Samples = [Option<Vec<TimedSample>>];

/// Returns a number that no other round of any launch has. The returned number determines the random order of the
/// points in a round, so each launch has its own orders. The order of the points affects a point's time, for example
/// through the frame that was cast before. Since each launch has its own orders, this effect differs from launch to
/// launch, so the points' 95% intervals include the effect.
fn in_launch(launch: u32, round: u32) -> u64 {
    u64::from(launch) << 32 | u64::from(round)
}

/// Measures rounds of `points` points until each point has enough samples that count. The usual number of
/// rounds is the number that the launch would need if no sample had to be left out. Samples that do not count
/// are taken again in the same round, unless they are too many (see [`sample_round`]). If a point still has
/// too few samples that count after the usual number of rounds, the launch continues until every point has
/// enough of them. The launch ends earlier if it has taken [`MOST`] times as many samples as there are in the
/// usual number of rounds. If no sample of a point counts, the launch ends after the usual number of rounds.
pub fn measure(
    points: usize,
    rule: &StoppingRule,
    launch: u32,
    seed: u64,
    rounds: &mut impl Rounds,
) -> Result<End> {
    let mut samples: Vec<Option<Vec<TimedSample>>> = vec![Some(Vec::new()); points];
    let (mut elapsed_ms, mut casts) = (0.0, 0);
    // The number of rounds after which the launch would end if all samples counted, and the reason.
    let mut usual: Option<(u32, StopReason)> = None;
    for round in 0.. {
        let active: Vec<usize> = (0..points).filter(|&point| samples[point].is_some()).collect();
        let order = round_order(active.len(), in_launch(launch, round), seed);
        let order = order.into_iter().map(|index| active[index]).collect();
        let Some(round_ms) = sample_round(round, order, &mut samples, rounds)? else {
            return Ok(End::Broken);
        };
        casts += round_ms.len();
        elapsed_ms += round_ms.iter().sum::<f64>();
        rounds.ended(round)?;
        let left: Vec<&Vec<TimedSample>> = samples.iter().flatten().collect();
        if left.is_empty() {
            break;
        }
        let that_count = times_ms(&left, |(_, counts)| *counts);
        if let Some(reason) = rule.stop(&that_count, elapsed_ms) {
            return Ok(End::Enough(reason));
        }
        usual = usual.or_else(|| Some((round + 1, rule.stop(&times_ms(&left, |_| true), elapsed_ms)?)));
        if let Some((needed, reason)) = usual
            && (that_count.iter().any(Vec::is_empty) || casts >= (MOST * needed) as usize * left.len())
        {
            return Ok(End::Enough(reason));
        }
    }
    Ok(End::AllFailed)
}

/// Takes a sample of each point, in the order `order`, and adds the samples to `samples`. A sample does not count if
/// the host of a virtual machine had probably moved the machine's processors to other cores (see [`Rounds::sampled`]).
/// Samples that do not count are taken again, once, at the end of the round. If more than half of the round's samples
/// do not count, no sample is taken again. The processors probably still run on the other cores, so new samples would
/// not count either. Returns the time that each cast took, in milliseconds; `None` if the worker process was lost.
fn sample_round(
    round: u32,
    order: Vec<usize>,
    samples: &mut Samples,
    rounds: &mut impl Rounds,
) -> Result<Option<Vec<f64>>> {
    let mut elapsed_ms = Vec::new();
    let mut repeated = Vec::new();
    for point in order.iter().copied() {
        let Some(counts) = sample(point, round, samples, rounds, &mut elapsed_ms)? else { return Ok(None) };
        if !counts {
            repeated.push(point);
        }
    }
    if 2 * repeated.len() > order.len() {
        return Ok(Some(elapsed_ms));
    }
    for point in repeated {
        samples[point].as_mut().and_then(Vec::pop);
        if sample(point, round, samples, rounds, &mut elapsed_ms)?.is_none() {
            return Ok(None);
        }
    }
    Ok(Some(elapsed_ms))
}

/// Takes a sample of a point, and adds its time to `elapsed_ms`. Returns `Some(true)` if the sample counts or
/// the point has failed, `Some(false)` if the sample does not count, and `None` if the worker process was
/// lost.
fn sample(
    point: usize,
    round: u32,
    samples: &mut Samples,
    rounds: &mut impl Rounds,
    elapsed_ms: &mut Vec<f64>,
) -> Result<Option<bool>> {
    let times = rounds.cast(point)?;
    if rounds.is_broken() {
        return Ok(None);
    }
    let (Some(times), Some(taken)) = (times, &mut samples[point]) else {
        samples[point] = None;
        return Ok(Some(true));
    };
    let counts = rounds.sampled(point, round, &times)?;
    // The worker process may run the anchor (a fixed kernel) after a sample, and may be lost while it runs
    // the anchor.
    if rounds.is_broken() {
        return Ok(None);
    }
    taken.push((times.frame_ms, counts));
    elapsed_ms.push(times.elapsed_ms());
    Ok(Some(counts))
}

/// Returns, for each point, the times of the samples for which `is_meant` is true.
fn times_ms(points: &[&Vec<TimedSample>], is_meant: fn(&TimedSample) -> bool) -> Vec<Vec<f64>> {
    let of =
        |samples: &&Vec<TimedSample>| samples.iter().filter(|one| is_meant(one)).map(|(ms, _)| *ms).collect();
    points.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Point 0 takes about 1 ms per frame, point 1 about 2 ms, and so on. The point `failing` fails
    /// at its third frame.
    #[derive(Default)]
    struct Fake {
        order: Vec<usize>,
        failing: Option<usize>,
        breaks_after: Option<usize>,
        /// How many samples were taken so far. The process is lost after the sample with the number
        /// `breaks_at_sample`.
        taken: usize,
        breaks_at_sample: Option<usize>,
        /// The number of frames of a sample.
        batch: Option<u32>,
        /// The rounds whose samples do not count.
        far: Vec<u32>,
        /// The number of samples of point 0 that count; `None` if all of them count.
        counting: Option<usize>,
        /// The numbers of the casts whose samples do not count; the first cast has the number 1.
        lost: Vec<usize>,
    }

    impl Rounds for Fake {
        fn cast(&mut self, point: usize) -> Result<Option<FrameTimes>> {
            self.order.push(point);
            let casts = self.order.iter().filter(|&&cast| cast == point).count();
            if self.failing == Some(point) && casts == 3 {
                return Ok(None);
            }
            let ms = (point + 1) as f64 + 0.1 * (casts % 3) as f64;
            Ok(Some(FrameTimes { batch: self.batch, ..FrameTimes::whole(ms, ms) }))
        }
        fn sampled(&mut self, point: usize, round: u32, _times: &FrameTimes) -> Result<bool> {
            let casts = self.order.iter().filter(|&&cast| cast == point).count();
            let is_lost = point == 0 && self.counting.is_some_and(|most| casts > most);
            self.taken += 1;
            Ok(!is_lost && !self.far.contains(&round) && !self.lost.contains(&self.order.len()))
        }
        fn is_broken(&self) -> bool {
            self.breaks_after.is_some_and(|casts| self.order.len() > casts)
                || self.breaks_at_sample == Some(self.taken)
        }
    }

    const RULE: StoppingRule =
        StoppingRule { min_samples: 5, max_samples: 7, relative_sigma: 1e-9, time_limit_ms: 1e9 };

    /// Measures a launch with two points that needs seven samples of each. The samples of the rounds whose
    /// numbers are in `far` do not count. Returns the number of rounds, and why the launch ended.
    fn rounds_if_far(far: impl IntoIterator<Item = u32>) -> Result<(usize, End)> {
        let mut fake = Fake { far: far.into_iter().collect(), ..Fake::default() };
        let end = measure(2, &RULE, 0, 1, &mut fake)?;
        Ok((fake.order.len() / 2, end))
    }

    #[test]
    fn every_launch_has_orders_of_its_own() -> Result<()> {
        let order = |launch| {
            let mut fake = Fake::default();
            measure(9, &RULE, launch, 1, &mut fake)?;
            Ok::<_, crate::error::Error>(fake.order)
        };
        assert_eq!(order(2)?, order(2)?);
        assert_ne!(order(2)?, order(3)?);
        assert!(in_launch(1, 0) > in_launch(0, u32::MAX));
        Ok(())
    }

    #[test]
    fn samples_that_do_not_count_are_replaced_up_to_twice_the_number_of_rounds() -> Result<()> {
        let end = End::Enough(StopReason::MaxSamples);
        assert_eq!(rounds_if_far([])?, (7, end));
        assert_eq!(rounds_if_far([0, 3, 8])?, (10, end));
        assert_eq!(rounds_if_far(1..100)?, (14, end), "the first round counts");
        Ok(())
    }

    #[test]
    fn a_launch_in_which_no_sample_counts_is_no_longer_than_usual() -> Result<()> {
        assert_eq!(rounds_if_far(0..100)?, (7, End::Enough(StopReason::MaxSamples)));
        // The first samples that count come in the seventh round, the last of the usual number of rounds. The seventh
        // round and six more rounds give the seven samples of each point that the launch needs.
        assert_eq!(rounds_if_far(0..6)?, (13, End::Enough(StopReason::MaxSamples)));
        Ok(())
    }

    #[test]
    fn a_sample_that_does_not_count_is_taken_again_at_the_end_of_its_round() -> Result<()> {
        let mut fake = Fake { lost: vec![3], ..Fake::default() };
        assert_eq!(measure(2, &RULE, 0, 1, &mut fake)?, End::Enough(StopReason::MaxSamples));
        // The second round begins with the third cast, whose sample does not count. The fifth cast of the
        // launch, at the end of the second round, repeats the sample of the third cast.
        assert_eq!((fake.order.len(), fake.order[2]), (2 * 7 + 1, fake.order[4]));
        // The repeated sample replaces the sample that does not count.
        let mut samples = [Some(Vec::new()), Some(Vec::new())];
        let mut fake = Fake { lost: vec![1], ..Fake::default() };
        let casts = sample_round(0, vec![0, 1], &mut samples, &mut fake)?;
        assert_eq!(casts.map(|times_ms| times_ms.len()), Some(3));
        let counting = samples.map(|point| point.map(|taken| taken.iter().map(|one| one.1).collect()));
        assert_eq!(counting, [Some(vec![true]), Some(vec![true])]);
        // Two of the three samples in the second round do not count. Since more than half of the round's
        // samples do not count, no sample is taken again. Each point needs seven samples that count, so the
        // launch has an eighth round.
        let mut fake = Fake { lost: vec![4, 6], ..Fake::default() };
        measure(3, &RULE, 0, 1, &mut fake)?;
        assert_eq!(fake.order.len(), 3 * 8);
        Ok(())
    }

    #[test]
    fn samples_are_repeated_up_to_twice_the_number_of_frames() -> Result<()> {
        let casts = |counting| -> Result<usize> {
            let mut fake = Fake { counting: Some(counting), ..Fake::default() };
            assert_eq!(measure(2, &RULE, 0, 1, &mut fake)?, End::Enough(StopReason::MaxSamples));
            Ok(fake.order.len())
        };
        // The first round has two casts, and each later round has three, until there are at least 28 casts.
        assert_eq!(casts(1)?, 2 + 9 * 3);
        // If no sample of a point counts, the launch ends after seven rounds.
        assert_eq!(casts(0)?, 7 * 3);
        Ok(())
    }

    #[test]
    fn the_time_limit_counts_the_samples_of_all_rounds() -> Result<()> {
        let rule = StoppingRule { max_samples: 100, time_limit_ms: 20.0, ..RULE };
        assert_eq!(measure(3, &rule, 0, 1, &mut Fake::default())?, End::Enough(StopReason::TimeLimit));
        Ok(())
    }

    #[test]
    fn the_time_limit_counts_every_frame_of_a_batch() -> Result<()> {
        let rule = StoppingRule { time_limit_ms: 1000.0, ..RULE };
        let mut batches = Fake { batch: Some(1000), ..Fake::default() };
        let end = measure(1, &rule, 0, 1, &mut batches)?;
        assert_eq!((end, batches.order.len()), (End::Enough(StopReason::TimeLimit), 5));
        assert_eq!(measure(1, &rule, 0, 1, &mut Fake::default())?, End::Enough(StopReason::MaxSamples));
        Ok(())
    }

    #[test]
    fn each_round_takes_one_sample_of_every_point() -> Result<()> {
        let mut fake = Fake::default();
        assert_eq!(measure(3, &RULE, 0, 1, &mut fake)?, End::Enough(StopReason::MaxSamples));
        assert_eq!(fake.order.len(), 3 * 7);
        for round in fake.order.chunks(3) {
            let mut points = round.to_vec();
            points.sort_unstable();
            assert_eq!(points, [0, 1, 2]);
        }
        assert!(fake.order.chunks(3).any(|round| round != [0, 1, 2]), "never shuffled");
        Ok(())
    }

    #[test]
    fn a_failing_point_is_not_cast_again_and_costs_the_others_nothing() -> Result<()> {
        let mut fake = Fake { failing: Some(1), ..Fake::default() };
        assert_eq!(measure(3, &RULE, 0, 1, &mut fake)?, End::Enough(StopReason::MaxSamples));
        let casts = |point| fake.order.iter().filter(|&&cast| cast == point).count();
        assert_eq!([casts(0), casts(1), casts(2)], [7, 3, 7]);
        let mut alone = Fake { failing: Some(0), ..Fake::default() };
        assert_eq!(measure(1, &RULE, 0, 1, &mut alone)?, End::AllFailed);
        Ok(())
    }

    #[test]
    fn a_lost_process_ends_the_launch() -> Result<()> {
        let mut fake = Fake { breaks_after: Some(4), ..Fake::default() };
        assert_eq!((measure(3, &RULE, 0, 1, &mut fake)?, fake.order.len()), (End::Broken, 5));
        // The process may be lost even after the last sample, while it runs the anchor.
        let mut last = Fake { breaks_at_sample: Some(3 * 7), ..Fake::default() };
        assert_eq!((measure(3, &RULE, 0, 1, &mut last)?, last.order.len()), (End::Broken, 3 * 7));
        Ok(())
    }
}
