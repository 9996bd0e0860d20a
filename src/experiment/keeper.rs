//! Where what is found goes: the results' folder, the observer, the caller.

use super::{Observer, Results};
use crate::error::Result;
use crate::launch::FrameTimes;
use crate::peak::Peak;
use crate::record::{Record, Sample};

/// What measuring points hands its findings to.
pub trait Keep {
    /// Tells what is being done now, in a few words.
    fn works_on(&mut self, what: &str);
    /// Says something at once.
    fn says(&mut self, line: &str);
    /// Completes a record.
    fn keep(&mut self, record: Record) -> Result<()>;
    /// Keeps a sample of a point.
    fn sample(&mut self, key: &str, round: u32, times: &FrameTimes) -> Result<()>;
    /// An earlier session's samples of a point, and the round after their last.
    fn past(&self, key: &str) -> (Vec<FrameTimes>, u32);
}

/// Keeps what a run finds as soon as it is found.
pub struct Keeper<'a> {
    /// The folder.
    pub results: &'a mut Results,
    /// Who listens.
    pub observer: &'a mut dyn Observer,
    /// How many points have stopped, those of earlier sessions among them.
    pub done: usize,
}

impl Keep for Keeper<'_> {
    fn works_on(&mut self, what: &str) {
        self.observer.works_on(what);
    }

    fn says(&mut self, line: &str) {
        self.observer.says(line);
    }

    fn past(&self, key: &str) -> (Vec<FrameTimes>, u32) {
        self.results.past().samples.get(key).cloned().unwrap_or_default()
    }

    /// First on disk, then heard of.
    fn keep(&mut self, mut record: Record) -> Result<()> {
        Peak::apply(self.results.peak(), &mut record);
        record.timestamp = Some(jiff::Timestamp::now().to_string());
        self.results.record(&record)?;
        self.observer.finished(&record);
        self.done += 1;
        Ok(())
    }

    fn sample(&mut self, key: &str, round: u32, times: &FrameTimes) -> Result<()> {
        self.results.sample(&Sample {
            key: key.to_owned(),
            round,
            ms: times.frame_ms,
            primary_ms: times.primary_ms,
            shadow_ms: times.shadow_ms,
            shade_ms: times.shade_ms,
            host_ms: Some(times.host_ms),
            batch: times.batch,
            sensed: times.sensed,
        })
    }
}
