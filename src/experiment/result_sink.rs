//! Where what is found goes: the results' folder, the observer, the caller.

use super::complete::Taken;
use super::{Observer, Results};
use crate::error::Result;
use crate::peak::Peak;
use crate::record::{AnchorSample, Record, RoundLoad, Sample};

/// What measuring points hands its findings to.
pub trait ResultSink {
    /// Tells what is being done now, in a few words.
    fn works_on(&mut self, what: &str);
    /// Says something at once.
    fn says(&mut self, line: &str);
    /// Completes a record.
    fn keep(&mut self, record: Record) -> Result<()>;
    /// Keeps a sample of a point.
    fn sample(&mut self, key: &str, round: u32, taken: &Taken) -> Result<()>;
    /// Keeps what else the machine did while rounds were timed.
    fn load(&mut self, load: &RoundLoad) -> Result<()>;
    /// Keeps what the anchor took.
    fn anchor(&mut self, sample: &AnchorSample) -> Result<()>;
    /// The number of a launch that begins: one that no other of the folder has.
    fn next_launch(&mut self) -> u32;
    /// So many launches of points are done, or will not be.
    fn advances(&mut self, steps: usize);
    /// An earlier session's samples of a point.
    fn past(&self, key: &str) -> Vec<Taken>;
}

/// Keeps what a run finds as soon as it is found.
pub struct FolderSink<'a> {
    /// The folder.
    pub results: &'a mut Results,
    /// Who listens.
    pub observer: &'a mut dyn Observer,
    /// How many points have stopped, those of earlier sessions among them.
    pub done: usize,
}

impl ResultSink for FolderSink<'_> {
    fn works_on(&mut self, what: &str) {
        self.observer.works_on(what);
    }

    fn says(&mut self, line: &str) {
        self.observer.says(line);
    }

    fn load(&mut self, load: &RoundLoad) -> Result<()> {
        self.results.load(load)
    }

    fn anchor(&mut self, sample: &AnchorSample) -> Result<()> {
        self.results.anchor(sample)
    }

    fn next_launch(&mut self) -> u32 {
        self.results.next_launch()
    }

    fn advances(&mut self, steps: usize) {
        self.observer.advances(steps);
    }

    fn past(&self, key: &str) -> Vec<Taken> {
        self.results.past().samples.get(key).cloned().unwrap_or_default()
    }

    /// First on disk, then heard of.
    fn keep(&mut self, mut record: Record) -> Result<()> {
        Peak::apply(self.results.peak(), &mut record);
        record.timestamp = Some(jiff::Timestamp::now().to_string());
        record.host = self.results.host().map(str::to_owned);
        if record.is_control {
            return self.results.control(&record);
        }
        self.results.record(&record)?;
        self.observer.finished(&record);
        self.done += 1;
        Ok(())
    }

    fn sample(&mut self, key: &str, round: u32, taken: &Taken) -> Result<()> {
        let times = &taken.times;
        self.results.sample(&Sample {
            key: key.to_owned(),
            launch: taken.launch,
            round,
            at_ms: Some(taken.at_ms),
            ms: times.frame_ms,
            primary_ms: times.primary_ms,
            shadow_ms: times.shadow_ms,
            shade_ms: times.shade_ms,
            host_ms: Some(times.host_ms),
            batch: times.batch,
            sensed: times.sensed,
            origin: None,
        })
    }
}
