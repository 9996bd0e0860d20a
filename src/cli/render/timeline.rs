//! Measures how long each part of a command's work takes. The parts follow one another without gaps, so that their
//! durations add up to the whole time of the command.

use crate::entry::entry;
use crate::load::processor_time;
use serde::Serialize;
use std::time::Instant;

/// A part of a command's time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    /// The name of the part of the command's work, such as `load`.
    pub part: &'static str,
    /// The part's duration by the wall clock. In the part with the name `start`, the time before the timeline was made
    /// is processor time (see [`Timeline::of_process`]).
    pub ms: f64,
}

/// The parts of a command's time that have ended so far.
pub struct Timeline {
    /// The time at which the latest part ended; before the first part, the time at which the timeline was made.
    last: Instant,
    parts: Vec<Part>,
}

impl Timeline {
    /// Returns a timeline that begins with the process. The time since the start of the process is taken to be the
    /// processor time that the process has used so far. The process must therefore not have waited or started a thread
    /// before this call.
    pub fn of_process() -> Self {
        let mut timeline = Self::begin();
        timeline.add("start", processor_time().as_secs_f64() * 1e3);
        timeline
    }

    /// Returns a timeline that begins now.
    pub fn begin() -> Self {
        Self { last: Instant::now(), parts: Vec::new() }
    }

    /// Ends the part `part` of the command's work. This part began when the previous part ended.
    pub fn ends(&mut self, part: &'static str) {
        self.ends_with(part, &[]);
    }

    /// Ends the part `part` of the command's work. This part began when the previous part ended. `others` lists other
    /// parts of the work that were done since then, with their durations in milliseconds. These durations are
    /// subtracted from the duration of `part`.
    pub fn ends_with(&mut self, part: &'static str, others: &[(&'static str, f64)]) {
        let now = Instant::now();
        let mut left_ms = now.duration_since(self.last).as_secs_f64() * 1e3;
        self.last = now;
        for (other, ms) in others {
            let ms = ms.clamp(0.0, left_ms);
            self.add(other, ms);
            left_ms -= ms;
        }
        self.add(part, left_ms);
    }

    fn add(&mut self, part: &'static str, ms: f64) {
        entry(&mut self.parts, |known| known.part == part, || Part { part, ms: 0.0 }).ms += ms;
    }

    /// Returns the duration in milliseconds of the part of this name; 0 if the timeline has no such part.
    pub fn ms(&self, part: &str) -> f64 {
        self.parts.iter().find(|known| known.part == part).map_or(0.0, |known| known.ms)
    }

    /// Returns all parts, in the order in which they were first added, and the sum of their durations.
    pub fn into_parts(self) -> (Vec<Part>, f64) {
        let total_ms = self.parts.iter().map(|part| part.ms).sum();
        (self.parts, total_ms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::ms_since;

    #[test]
    fn parts_follow_each_other_and_nothing_is_lost() {
        let begin = Instant::now();
        let mut timeline = Timeline::begin();
        timeline.ends("load");
        timeline.ends_with("buffers", &[("tree", 1e9), ("build", 5.0)]);
        timeline.ends("load");
        let most_ms = ms_since(begin);
        assert_eq!((timeline.ms("buffers"), timeline.ms("build"), timeline.ms("none")), (0.0, 0.0, 0.0));
        let (parts, total_ms) = timeline.into_parts();
        assert_eq!(
            parts.iter().map(|part| part.part).collect::<Vec<_>>(),
            ["load", "tree", "build", "buffers"]
        );
        assert!(parts.iter().all(|part| part.ms >= 0.0) && total_ms <= most_ms);
    }

    #[test]
    fn a_process_has_begun_before_its_timeline() {
        let timeline = Timeline::of_process();
        assert!(cfg!(not(unix)) || timeline.ms("start") > 0.0);
    }
}
