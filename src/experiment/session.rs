//! A group of verified points while they are timed together.

use super::bench::Refusal;
use super::complete::complete;
use super::host;
use super::keeper::Keeper;
use super::rounds::Rounds;
use crate::config::Baseline;
use crate::error::Result;
use crate::launch::{Caster, FrameTimes};
use crate::measure::StopReason;
use crate::record::{Record, Sample};
use crate::scene::Scene;

/// A point that passed its check and can be cast again and again.
pub enum Ready {
    /// On a device.
    Kernel(Box<Caster>),
    /// On the host.
    Host(Baseline),
}

/// One of the session's points.
struct Entry {
    record: Record,
    ready: Ready,
    label: String,
}

/// Verified points of one scene, size and device.
pub struct Session<'a> {
    scene: &'a Scene,
    entries: Vec<Entry>,
}

impl<'a> Session<'a> {
    /// An empty session.
    pub fn new(scene: &'a Scene) -> Self {
        Self { scene, entries: Vec::new() }
    }

    /// Adds a point.
    pub fn add(&mut self, record: Record, ready: Ready, label: String) {
        self.entries.push(Entry { record, ready, label });
    }

    /// How many points there are.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Casts frames that are not kept; the check has cast one already, so where frames are long in comparison
    /// with the time limit fewer will do. A frame that fails here fails again when it is timed, and is told then.
    pub fn warm_up(&self, frames: u32, time_limit_ms: f64) {
        for entry in &self.entries {
            let mut spent_ms = 0.0;
            for _ in 0..frames {
                match self.frame(entry) {
                    Ok(times) => spent_ms += times.host_ms,
                    Err(_) => break,
                }
                if spent_ms > 0.1 * time_limit_ms {
                    break;
                }
            }
        }
    }

    /// The session as [`measure`](super::rounds::measure) wants it.
    pub fn with<'b, 'k>(&'b self, keeper: &'b mut Keeper<'k>) -> Timed<'b, 'a, 'k> {
        Timed { session: self, keeper }
    }

    fn frame(&self, entry: &Entry) -> std::result::Result<FrameTimes, Refusal> {
        match &entry.ready {
            Ready::Kernel(caster) => Ok(caster.cast()?),
            Ready::Host(baseline) => Ok(host::cast(*baseline, self.scene, entry.record.image_size).1),
        }
    }
}

/// A session whose samples and records are kept as they come.
pub struct Timed<'b, 'a, 'k> {
    session: &'b Session<'a>,
    keeper: &'b mut Keeper<'k>,
}

impl Rounds for Timed<'_, '_, '_> {
    fn cast(&mut self, point: usize) -> Result<Option<FrameTimes>> {
        let entry = &self.session.entries[point];
        self.keeper.observer.works_on(&format!("timing {}", entry.label));
        match self.session.frame(entry) {
            Ok(times) => Ok(Some(times)),
            Err(refusal) => self.keeper.keep(refusal.write_into(entry.record.clone())).map(|()| None),
        }
    }

    fn sampled(&mut self, point: usize, round: u32, times: &FrameTimes) -> Result<()> {
        self.keeper.results.sample(&Sample {
            key: self.session.entries[point].record.key.clone(),
            round,
            ms: times.frame_ms,
            primary_ms: times.primary_ms,
            shadow_ms: times.shadow_ms,
            host_ms: Some(times.host_ms),
        })
    }

    fn stopped(&mut self, point: usize, frames: Vec<FrameTimes>, reason: StopReason) -> Result<()> {
        let mut record = self.session.entries[point].record.clone();
        complete(&mut record, &frames, reason);
        self.keeper.keep(record)
    }
}
