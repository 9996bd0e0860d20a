//! Where finished records go: the results' folder, the observer, the caller.

use super::{Observer, Results};
use crate::error::Result;
use crate::record::Record;

/// Keeps what a run finds as soon as it is found.
pub struct Keeper<'a> {
    /// The folder.
    pub results: &'a mut Results,
    /// Who listens.
    pub observer: &'a mut dyn Observer,
    /// Every record so far.
    pub done: Vec<Record>,
}

impl Keeper<'_> {
    /// Completes a record: first on disk, then heard of.
    pub fn keep(&mut self, mut record: Record) -> Result<()> {
        record.timestamp = Some(jiff::Timestamp::now().to_string());
        self.results.record(&record)?;
        self.observer.finished(&record);
        self.done.push(record);
        Ok(())
    }
}
