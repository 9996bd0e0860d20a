//! Finds samples during which other programs probably used the processors.
//!
//! A frame that is cast on processors needs about the same processor time in every sample. If the system
//! preempts one of the frame's threads to run another program, the frame takes longer, but needs no more
//! processor time. The ratio of processor time to elapsed time (the utilization) therefore shows how much a
//! sample was delayed. The utilization does not depend on the speed of the frame itself.

use super::{MIN_SAMPLES, quantile};
use std::collections::HashMap;

/// A sample counts as preempted if its utilization is less than the fraction `LEAST_UTILIZATION` of the usual
/// utilization of its point or anchor. Probably, other programs delayed such a sample by more than a tenth of
/// its usual time.
const LEAST_UTILIZATION: f64 = 0.9;

/// Returns the ratio of a sample's processor time to its elapsed time. The ratio of processor time to elapsed
/// time can be above 1 if several threads run. Returns `None` if the processor time is unknown or the elapsed
/// time is 0.
pub fn utilization(processor_ms: Option<f64>, elapsed_ms: f64) -> Option<f64> {
    let ratio = processor_ms? / elapsed_ms;
    ratio.is_finite().then_some(ratio)
}

/// Returns the samples of a point or an anchor without the preempted samples. `launch_and_utilization`
/// returns a sample's launch and its utilization. If a launch would have fewer than five samples left, its
/// five samples with the highest utilization remain. Returns `None` if there is no sample, or if the
/// utilization of a sample is unknown.
pub fn without_preempted<T: Clone>(
    samples: &[T],
    launch_and_utilization: impl Fn(&T) -> Option<(u32, f64)>,
) -> Option<Vec<T>> {
    let known: Vec<(u32, f64)> = samples.iter().map(launch_and_utilization).collect::<Option<_>>()?;
    let mut sorted: Vec<f64> = known.iter().map(|(_, utilization)| *utilization).collect();
    sorted.sort_by(f64::total_cmp);
    // The usual utilization is the upper quartile, since up to three quarters of the samples may be preempted.
    let usual = (!sorted.is_empty()).then(|| quantile(&sorted, 0.75))?;
    // The sort is stable, so samples with equal utilization stay in the order of measurement.
    let mut highest_first: Vec<usize> = (0..known.len()).collect();
    highest_first.sort_by(|a, b| known[*b].1.total_cmp(&known[*a].1));
    let (mut ranks, mut remains) = (HashMap::new(), vec![false; known.len()]);
    for index in highest_first {
        let (launch, utilization) = known[index];
        let rank: &mut usize = ranks.entry(launch).or_default();
        remains[index] = utilization >= LEAST_UTILIZATION * usual || *rank < MIN_SAMPLES;
        *rank += 1;
    }
    let remaining = samples.iter().zip(remains).filter(|(_, remains)| *remains);
    Some(remaining.map(|(sample, _)| sample.clone()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sample of two threads: its launch, its elapsed time, and the time that the threads together waited.
    type Waited = (u32, f64, f64);

    fn remaining(samples: &[Waited]) -> Vec<f64> {
        let used = |(launch, elapsed_ms, waited_ms): &Waited| {
            Some((*launch, utilization(Some(2.0 * elapsed_ms - waited_ms), *elapsed_ms)?))
        };
        let remaining = without_preempted(samples, used).expect("utilizations");
        remaining.iter().map(|(_, elapsed_ms, _)| *elapsed_ms).collect()
    }

    #[test]
    fn preempted_samples_are_left_out_and_slow_ones_stay() {
        let mut samples = vec![(0, 10.0, 0.1); 8];
        samples[1] = (0, 12.0, 4.0);
        samples[2] = (0, 20.0, 0.1);
        // A sample remains if its utilization is at most a tenth below the usual utilization.
        samples[3] = (0, 11.0, 1.9);
        samples[4] = (0, 11.0, 2.5);
        assert_eq!(remaining(&samples), [10.0, 20.0, 11.0, 10.0, 10.0, 10.0]);
    }

    #[test]
    fn each_launch_keeps_its_five_best_samples() {
        let preempted = [16.0, 18.0, 15.0, 17.0, 14.0, 19.0].map(|ms| (1, ms, ms - 10.0));
        let remaining_ms = remaining(&[&preempted[..], &[(0, 10.0, 0.0); 20]].concat());
        assert_eq!(remaining_ms[..5], [16.0, 18.0, 15.0, 17.0, 14.0]);
        assert_eq!(remaining_ms.len(), 25);
        // Of samples with equal utilization, the first five remain.
        let equal = [16.0, 17.0, 18.0, 19.0, 20.0, 21.0, 22.0].map(|ms| (1, ms, 0.5 * ms));
        let remaining_ms = remaining(&[&equal[..], &[(0, 10.0, 0.0); 22]].concat());
        assert_eq!((&remaining_ms[..5], remaining_ms.len()), (&[16.0, 17.0, 18.0, 19.0, 20.0][..], 27));
    }

    #[test]
    fn the_usual_utilization_is_known_although_most_samples_are_preempted() {
        let sample = |n: u32| if n < 14 { (0, 15.0, 5.0) } else { (0, 10.0, 0.0) };
        let samples: Vec<Waited> = (0..20).map(sample).collect();
        assert_eq!(remaining(&samples), [10.0; 6]);
    }

    #[test]
    fn without_utilizations_nothing_is_known() {
        let of = |samples: &[Option<f64>]| without_preempted(samples, |one| Some((0, (*one)?)));
        assert_eq!((of(&[Some(1.0), None, Some(1.0)]), of(&[])), (None, None));
        assert_eq!((utilization(None, 1.0), utilization(Some(1.0), 0.0)), (None, None));
    }
}
