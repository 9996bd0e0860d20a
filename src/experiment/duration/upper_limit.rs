//! The upper limit of the frames' total time, for a run whose points were never measured before.

use super::{Expected, in_minutes};
use crate::experiment::Run;
use crate::numbers::significant;

impl Run<'_> {
    /// Returns the longest mean time of a frame, in milliseconds, with which a launch completes its least number of
    /// rounds within its time limit. If frames take longer on average, a launch exceeds its time limit.
    pub(super) fn usual_frame_ms(&self) -> f64 {
        let rule = self.stopping_rule();
        rule.time_limit_ms / rule.least() as f64
    }

    /// Returns the longest time, in milliseconds, that the frames of a group of `points` points take in
    /// `launches` launches. A frame is assumed to take at most [`usual_frame_ms`](Self::usual_frame_ms) on
    /// average. A launch ends after the round in which it reaches its time limit, so it may exceed the limit
    /// by the time of a round.
    pub(super) fn most_frames_ms(&self, points: usize, launches: usize) -> f64 {
        let (rule, frame_ms) = (self.stopping_rule(), self.usual_frame_ms());
        let sampling_ms = (rule.time_limit_ms + frame_ms).min(rule.max_samples as f64 * frame_ms);
        (points * launches) as f64 * (self.warm_up_ms(frame_ms) + sampling_ms)
    }
}

impl Expected {
    /// Returns the end of a sentence: the condition under which the frames' total time has an upper limit, then this
    /// limit. The condition comes first, since the limit is no estimate: it is computed without the image sizes.
    /// Returns an empty text if the limit is unknown.
    pub(super) fn at_most(&self) -> String {
        if self.most.is_zero() {
            return String::new();
        }
        format!(
            "; if a frame takes at most {} ms on average, all frames together take at most about {}; building, \
             checking and waiting for other measurements take additional time",
            significant(self.usual_frame_ms, 3),
            in_minutes(self.most)
        )
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use crate::experiment::duration::{Known, START_MS};
    use crate::experiment::{Past, fixtures};
    use std::time::Duration;

    #[test]
    fn without_a_known_time_the_frames_have_a_bound_that_holds_unless_they_are_long() {
        let timing = "timing = { launches = 2, warmup = 2, time_limit_ms = 1000 }";
        let experiment = fixtures::experiment(&format!("local_sizes = [4, 8]\n{timing}"));
        let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let expected = run.expected(&[], &Past::default()).unwrap();
        // In each of two launches, each of two points has 500 ms for at least five samples, so a frame may take 100 ms.
        // The launch may exceed its limit by a round. Two frames of warm-up take 200 ms.
        assert_eq!(expected.usual_frame_ms, 100.0);
        assert_eq!(expected.most, Duration::from_millis(2 * 2 * (500 + 100 + 200)));
        let frames_ms = |sample_ms: f64| {
            let points = [Known { sample_ms, ..Known::default() }; 2];
            2.0 * (run.launch_ms(&points) - START_MS)
        };
        let most_ms = 1e3 * expected.most.as_secs_f64();
        for (frame_ms, holds) in [(1.0, true), (33.0, true), (99.0, true), (100.0, true), (200.0, false)] {
            assert_eq!(frames_ms(frame_ms) <= most_ms, holds, "{frame_ms}: {}", frames_ms(frame_ms));
        }
        let text = "2 points in 2 launches: the duration is unknown; measuring each point takes at least 10 \
                    frames; if a frame takes at most 100 ms on average, all frames together take at most about 3s; \
                    building, checking and waiting for other measurements take additional time";
        assert_eq!(expected.to_string(), text);
    }
}
