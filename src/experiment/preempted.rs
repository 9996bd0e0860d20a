//! Finds samples during which other programs used the processors.
//!
//! A frame that is cast on processors needs about the same processor time in every sample. If the system preempts
//! one of the frame's threads to run another program, the frame takes longer, but needs no more processor time. The
//! ratio of processor time to elapsed time (the utilization) therefore shows how much a sample was delayed. It does
//! not depend on the speed of the frame itself.

use super::Taken;
use crate::measure::{MIN_SAMPLES, quantile};

/// A sample counts as preempted if its utilization is less than this fraction of its point's usual utilization. Other
/// programs delayed such a sample by over a tenth.
const LEAST_UTILIZATION: f64 = 0.9;

/// Returns the samples of a point without the preempted ones. If a launch would have fewer than five samples left, its
/// five samples with the highest utilization remain. Returns `None` if there is no sample, or if the processor time of
/// a sample is unknown.
pub(super) fn without_preempted(taken: &[Taken]) -> Option<Vec<Taken>> {
    let utilizations: Vec<f64> = taken.iter().map(utilization).collect::<Option<_>>()?;
    let mut sorted = utilizations.clone();
    sorted.sort_by(f64::total_cmp);
    // The point's usual utilization is the upper quartile, since up to three quarters of the samples may be
    // preempted.
    let usual = (!sorted.is_empty()).then(|| quantile(&sorted, 0.75))?;
    let remains = |(at, (one, utilization)): (usize, (&Taken, &f64))| {
        let higher = |&(other, rival): &(usize, &f64)| {
            taken[other].launch == one.launch && (rival, at) > (utilization, other)
        };
        let rank = utilizations.iter().enumerate().filter(higher).count();
        (*utilization >= LEAST_UTILIZATION * usual || rank < MIN_SAMPLES).then_some(*one)
    };
    Some(taken.iter().zip(&utilizations).enumerate().filter_map(remains).collect())
}

/// Returns the ratio of a sample's processor time to its elapsed time. The ratio can be above 1 if several threads
/// run.
fn utilization(taken: &Taken) -> Option<f64> {
    let ratio = taken.times.processor_ms? / taken.times.host_ms;
    ratio.is_finite().then_some(ratio)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::launch::FrameTimes;

    /// A sample in which two threads together used `waited_ms` less processor time than two processors offer.
    fn sample(launch: u32, host_ms: f64, waited_ms: f64) -> Taken {
        let processor_ms = Some(2.0 * host_ms - waited_ms);
        Taken {
            launch,
            at_ms: 0.0,
            core_to_core_ns: None,
            times: FrameTimes { processor_ms, ..FrameTimes::whole(host_ms, host_ms) },
        }
    }

    fn host_ms(taken: &[Taken]) -> Vec<f64> {
        without_preempted(taken).expect("utilizations").iter().map(|one| one.times.host_ms).collect()
    }

    #[test]
    fn preempted_samples_are_left_out_and_slow_ones_stay() {
        let mut taken = vec![sample(0, 10.0, 0.1); 8];
        taken[1] = sample(0, 12.0, 4.0);
        taken[2] = sample(0, 20.0, 0.1);
        // A sample still counts if its utilization is less than a tenth below the usual utilization.
        taken[3] = sample(0, 11.0, 1.9);
        taken[4] = sample(0, 11.0, 2.5);
        assert_eq!(host_ms(&taken), [10.0, 20.0, 11.0, 10.0, 10.0, 10.0]);
    }

    #[test]
    fn each_launch_keeps_its_five_best_samples() {
        let preempted = [16.0, 18.0, 15.0, 17.0, 14.0, 19.0].map(|ms| sample(1, ms, ms - 10.0));
        let taken = [&preempted[..], &[sample(0, 10.0, 0.0); 20]].concat();
        assert_eq!(host_ms(&taken)[..5], [16.0, 18.0, 15.0, 17.0, 14.0]);
        assert_eq!(host_ms(&taken).len(), 25);
        // Of samples with equal utilization, the first remain.
        assert_eq!(
            host_ms(&[&[sample(1, 16.0, 6.0); 7][..], &[sample(0, 10.0, 0.0); 22]].concat()).len(),
            27
        );
    }

    #[test]
    fn without_processor_times_nothing_is_known() {
        let mut taken = [sample(0, 10.0, 0.0); 6];
        taken[3].times.processor_ms = None;
        assert_eq!((without_preempted(&taken), without_preempted(&[])), (None, None));
    }
}
