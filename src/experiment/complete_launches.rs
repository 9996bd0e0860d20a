//! Finds the complete launches of a group of points: the launches (measurements by processes of their own) in
//! which each point of the group has enough samples.

use super::taken::Taken;
use crate::measure::{StopReason, StoppingRule};
use crate::record::LaunchEnd;
use std::collections::BTreeSet;

/// Returns the numbers of the complete launches in ascending order, each with the reason why the launch
/// ended. `points` has the key and the samples of each point. `end_of` returns a launch's stored end: why the
/// launch ended, and the number of samples of each point that did not fail in this launch. A launch is
/// incomplete if a point has fewer than `rule.least()` samples in the launch, or if the launch's stored end
/// gives no number of samples for a point. Any other launch is complete if each point has exactly the number of samples
/// that the launch's stored end gives. If no end of a launch is stored (earlier versions of raycl stored none), or if
/// samples were lost, `rule` decides whether the launch has enough samples.
pub fn complete_launches(
    points: &[(&str, &[Taken])],
    end_of: impl Fn(u32) -> Option<LaunchEnd>,
    rule: &StoppingRule,
) -> Vec<(u32, StopReason)> {
    let reason = |launch: u32| {
        let samples: Vec<Vec<&Taken>> = points
            .iter()
            .map(|(_, taken)| taken.iter().filter(|one| one.launch == launch).collect())
            .collect();
        if samples.iter().any(|samples| samples.len() < rule.least()) {
            return None;
        }
        let end = end_of(launch);
        // A point that failed in the launch has samples from before the failure. If only the failed point is
        // measured again, the stopping rule is applied to this point alone, and its samples may seem to be
        // enough.
        let lacks_one = |end: &LaunchEnd| points.iter().any(|(key, _)| !end.samples.contains_key(*key));
        if end.as_ref().is_some_and(lacks_one) {
            return None;
        }
        let has_all = |end: &LaunchEnd| {
            points.iter().zip(&samples).all(|((key, _), own)| end.samples.get(*key) == Some(&own.len()))
        };
        let stored = end.filter(has_all).map(|end| end.stop_reason);
        stored.or_else(|| {
            let ms = |samples: &Vec<&Taken>| samples.iter().map(|one| one.times.frame_ms).collect();
            let elapsed_ms: f64 = samples.iter().flatten().map(|one| one.times.elapsed_ms()).sum();
            rule.stop(&samples.iter().map(ms).collect::<Vec<Vec<f64>>>(), elapsed_ms)
        })
    };
    let all = points.iter().flat_map(|(_, taken)| taken.iter());
    let launches: BTreeSet<u32> = all.map(|sample| sample.launch).collect();
    launches.into_iter().filter_map(|launch| Some((launch, reason(launch)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::launch::FrameTimes;

    fn sample() -> Taken {
        Taken { launch: 3, at_ms: 0.0, core_to_core_ns: None, times: FrameTimes::whole(1.0, 1.0) }
    }

    /// Returns why a launch of two points ended; `None` if the launch is not complete. `counts` has the
    /// points' numbers of samples; each sample took 1 ms. If the launch has a stored end, `end` has the
    /// numbers of samples that this end states.
    fn reason_of(counts: [usize; 2], end: Option<[usize; 2]>) -> Option<StopReason> {
        let rule =
            StoppingRule { min_samples: 10, max_samples: 40, relative_sigma: 0.0, time_limit_ms: 30.0 };
        let samples = counts.map(|count| vec![sample(); count]);
        let points = [("a", &samples[0][..]), ("b", &samples[1][..])];
        let end_of = |launch: u32| {
            let samples = ["a", "b"].map(str::to_owned).into_iter().zip(end?).collect();
            Some(LaunchEnd { launch, stop_reason: StopReason::NoiseSettled, samples })
        };
        let complete = complete_launches(&points, end_of, &rule);
        assert!(complete.iter().all(|(launch, _)| *launch == 3), "{complete:?}");
        complete.first().map(|(_, reason)| *reason)
    }

    #[test]
    fn a_launch_without_a_stored_end_is_complete_if_its_samples_are_enough_by_the_rule() {
        let reason = |counts| reason_of(counts, None);
        assert_eq!(reason([20, 20]), None, "the launch was interrupted");
        // Together, the samples of both points take 60 ms, the time limit of two points.
        assert_eq!([reason([30, 30]), reason([5, 55])], [Some(StopReason::TimeLimit); 2]);
        assert_eq!(reason([5, 40]), None, "only one of the two points has `max_samples` samples");
        assert_eq!(reason([4, 60]), None, "a complete launch has at least five samples of each point");
    }

    #[test]
    fn a_launch_with_all_samples_of_its_stored_end_is_complete() {
        let reason = |counts, end| reason_of(counts, Some(end));
        assert_eq!(reason([20, 21], [20, 21]), Some(StopReason::NoiseSettled));
        assert_eq!(reason([4, 4], [4, 4]), None, "a complete launch has at least five samples of each point");
        // According to the launch's stored end, the second point has 21 samples, but there are only 20. A
        // sample was lost, so the stopping rule decides whether the launch is complete.
        assert_eq!(reason([20, 20], [20, 21]), None);
        assert_eq!(reason([30, 30], [30, 31]), Some(StopReason::TimeLimit));
    }

    /// The point "b" failed in the launch after 40 samples. With `--retry-failed`, "b" is measured again, but
    /// "a" is not.
    #[test]
    fn a_launch_is_not_complete_for_a_point_that_failed_in_it() {
        let rule =
            StoppingRule { min_samples: 10, max_samples: 40, relative_sigma: 0.0, time_limit_ms: 30.0 };
        let samples = [sample(); 40];
        let is_complete = |key: &str| {
            let end_of = |launch: u32| {
                let samples = [("a".to_owned(), 40)].into();
                Some(LaunchEnd { launch, stop_reason: StopReason::NoiseSettled, samples })
            };
            !complete_launches(&[(key, &samples[..])], end_of, &rule).is_empty()
        };
        assert!(is_complete("a") && !is_complete("b"));
        let both = [("a", &samples[..]), ("b", &samples[..])];
        let end_of = |launch: u32| {
            let samples = [("a".to_owned(), 40)].into();
            Some(LaunchEnd { launch, stop_reason: StopReason::NoiseSettled, samples })
        };
        assert!(complete_launches(&both, end_of, &rule).is_empty(), "one of two points failed");
    }
}
