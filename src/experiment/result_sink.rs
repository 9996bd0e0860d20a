//! Receives results and passes them on to the folder of results and to the observer.

use super::complete::Taken;
use super::{Observer, Results};
use crate::error::Result;
use crate::peak::Peak;
use crate::record::{AnchorSample, Record, RoundLoad, Sample};

/// Receives the results of measurements.
pub trait ResultSink {
    /// Describes the current work, in a few words.
    fn works_on(&mut self, what: &str);
    /// Prints a line at once.
    fn says(&mut self, line: &str);
    /// Stores a complete record.
    fn keep(&mut self, record: Record) -> Result<()>;
    /// Stores a sample of a point.
    fn sample(&mut self, key: &str, round: u32, taken: &Taken) -> Result<()>;
    /// Stores the load of other processes while rounds were timed.
    fn load(&mut self, load: &RoundLoad) -> Result<()>;
    /// Stores a time of the anchor.
    fn anchor(&mut self, sample: &AnchorSample) -> Result<()>;
    /// Returns the number of a new launch, which is unique in the folder.
    fn next_launch(&mut self) -> u32;
    /// Is called when launches of points are finished or will not take place, with their number.
    fn advances(&mut self, steps: usize);
    /// Returns an earlier session's samples of a point.
    fn past(&self, key: &str) -> Vec<Taken>;
}

/// Stores a run's results as soon as they are known.
pub struct FolderSink<'a> {
    /// The folder.
    pub results: &'a mut Results,
    /// The observer.
    pub observer: &'a mut dyn Observer,
    /// Number of finished points, including those of earlier sessions.
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

    /// Writes the record to disk before it informs the observer.
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
            processor_ms: times.processor_ms,
            batch: times.batch,
            sensed: times.sensed,
            origin: None,
        })
    }
}
