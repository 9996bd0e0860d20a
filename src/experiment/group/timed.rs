//! Measures one launch of a group of points.

use super::device_of;
use crate::anchor;
use crate::error::Result;
use crate::experiment::Run;
use crate::experiment::moved_processors::{decisive_ns, is_near, patience, wait_until_near};
use crate::experiment::pending::PendingPoint;
use crate::experiment::result_sink::ResultSink;
use crate::experiment::rounds::Rounds;
use crate::experiment::supervisor::Supervisor;
use crate::experiment::taken::Taken;
use crate::launch::FrameTimes;
use crate::load::{Watch, core_to_core_ns};
use crate::record::{AnchorSample, RoundLoad};
use std::collections::{HashMap, HashSet};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// A launch whose samples are stored as they are taken.
pub(super) struct Timed<'b, 's, K> {
    pub points: &'b [PendingPoint],
    pub run: &'b Run<'b>,
    /// The launch's number among all launches in the folder of results. `number` is the launch's number among
    /// the group's launches.
    pub launch: u32,
    pub number: usize,
    pub start: Instant,
    /// Measures the load of other processes.
    pub watch: Watch,
    /// Number of workers that were lost before the launch began.
    pub losses: usize,
    pub supervisor: &'b mut Supervisor<'s>,
    pub sink: &'b mut K,
    pub taken: Vec<Vec<Taken>>,
    pub failed: HashSet<usize>,
    /// For each job (the task of the workers of one device): the number of samples since the device's anchor
    /// was last run. A device's anchor (a fixed kernel) is run again when enough samples were taken since its
    /// last run. A job whose anchor has not been run yet has no entry.
    pub casts: HashMap<usize, usize>,
    /// Measures the core-to-core latency around samples.
    pub latency: Latency,
}

/// The shortest time between two readings of the core-to-core latency. `READING_EVERY` is many times as long as a
/// reading takes.
const READING_EVERY: Duration = Duration::from_millis(20);

/// Measures the core-to-core latency before and after samples.
pub(super) struct Latency {
    /// The last reading of the core-to-core latency in nanoseconds, and when it was taken; `None` if the latency is not
    /// measured.
    last: Option<(Instant, Option<f64>)>,
    /// How long the launch has waited for near processors (processors at their usual distance).
    waited: Duration,
}

impl Latency {
    /// Takes the first reading of the core-to-core latency, unless `is_measured` is false.
    pub fn of(is_measured: bool) -> Self {
        Self { last: is_measured.then(|| (Instant::now(), core_to_core_ns())), waited: Duration::ZERO }
    }

    /// Waits until the core-to-core latency is as usual: the processors of a virtual machine then probably run on cores
    /// at their usual distance from each other. The launch began `elapsed` ago. The wait ends early if the launch has
    /// used up its time for waits (see [`patience`]). Calls `begins` if there is a wait.
    fn wait(&mut self, near_ns: f64, elapsed: Duration, interrupted: &AtomicBool, begins: impl FnOnce()) {
        let Some((_, last)) = self.last.filter(|(_, last)| !is_near(*last, near_ns)) else { return };
        let (start, most) = (Instant::now(), patience(elapsed, self.waited));
        if most.is_zero() {
            return;
        }
        begins();
        let last = wait_until_near(last, near_ns, most, interrupted, core_to_core_ns);
        self.last = Some((Instant::now(), last));
        self.waited += start.elapsed();
    }

    /// The core-to-core latency is read before and after a sample. For a sample that has just ended, returns
    /// the one of these two readings, in nanoseconds, that decides whether the sample counts (see
    /// [`decisive_ns`]). If the last reading was taken less than [`READING_EVERY`] ago, takes no new reading,
    /// and returns the last reading. Returns `None` if no reading is known.
    fn around_sample(&mut self, near_ns: f64) -> Option<f64> {
        let (at, before) = self.last?;
        if at.elapsed() < READING_EVERY {
            return before;
        }
        let after = core_to_core_ns();
        self.last = Some((Instant::now(), after));
        decisive_ns([before, after], near_ns)
    }
}

/// The message of a run that waits until the processors of a virtual machine run on cores at their usual
/// distance from each other. raycl does not know whether this machine is virtual, so the message mentions no
/// virtual machine.
const WAITING: &str = "waiting until the core-to-core latency is as usual";

/// A device's anchor (a fixed kernel) is run at least once for every `CASTS_PER_ANCHOR` samples of measured
/// points. `CASTS_PER_ANCHOR` is small enough that the anchor kernel is run about as often as each point is
/// sampled, or more often. `CASTS_PER_ANCHOR` is large enough that the anchor kernel takes little time
/// compared with the samples.
const CASTS_PER_ANCHOR: usize = 6;

impl<K: ResultSink> Timed<'_, '_, K> {
    fn at_ms(&self) -> f64 {
        // The time since the launch began is rounded to microseconds, which is enough to order samples.
        (self.start.elapsed().as_secs_f64() * 1e6).round() * 1e-3
    }

    /// Waits for a limited time if the core-to-core latency is unusual, since a sample taken now would not count. (The
    /// host has probably moved a virtual machine's processors to other cores.)
    fn wait_for_near_processors(&mut self) {
        let (near_ns, interrupted) = (self.sink.near_ns(), self.supervisor.interrupted());
        self.latency.wait(near_ns, self.start.elapsed(), interrupted, || self.sink.works_on(WAITING));
    }

    /// Runs the anchor (a fixed kernel) of a point's device if the anchor is due. The anchor is first run
    /// after the device's first sample, and then once for every [`CASTS_PER_ANCHOR`] samples. If a round has
    /// fewer than [`CASTS_PER_ANCHOR`] samples on the device, the device's anchor kernel is run once in every
    /// round. If a launch has five rounds or more, as is usual, the anchor is thus run at least five times,
    /// which is enough for a 95% interval of the anchor's time. In a run with a single launch, the anchor is
    /// not run. If the anchor fails, the user is told why, and new workers repeat the launch.
    fn anchor(&mut self, point: usize, round: u32) -> Result<()> {
        let pending = &self.points[point];
        let Some(device) = device_of(self.run, pending).filter(|_| self.run.launches() > 1) else {
            return Ok(());
        };
        let shares_device = |(index, other): &(usize, &PendingPoint)| {
            other.job == pending.job && !other.record.is_baseline() && !self.failed.contains(index)
        };
        let every = self.points.iter().enumerate().filter(shares_device).count().min(CASTS_PER_ANCHOR);
        if let Some(casts) = self.casts.get_mut(&pending.job).filter(|casts| **casts + 1 < every) {
            *casts += 1;
            return Ok(());
        }
        self.casts.insert(pending.job, 0);
        // If points are distributed over devices of the same model, the anchors (fixed kernels) of these devices do the
        // same work. All these anchors therefore have the same name: that of the first device's anchor. A point, too,
        // has the same key on each of these devices. If the anchors had different names, their times could not be used
        // to compare blocks (parts of a group of points) that different devices measured.
        let anchor = anchor::name(self.run.named_device().unwrap_or(device))?;
        let times = match self.supervisor.anchor(pending.task())? {
            Some(Ok(times)) => times,
            Some(Err(error)) => {
                self.sink.says(&format!("{}: {error}; {}", device.label, error.remedy()));
                return Ok(());
            }
            None => return Ok(()),
        };
        let (device, launch, at_ms) = (pending.record.device.clone(), self.launch, self.at_ms());
        let (ms, host_ms, processor_ms) = (times.frame_ms, Some(times.host_ms), times.processor_ms);
        self.sink.anchor(&AnchorSample { anchor, device, launch, round, at_ms, ms, host_ms, processor_ms })
    }
}

impl<K: ResultSink> Rounds for Timed<'_, '_, K> {
    fn cast(&mut self, point: usize) -> Result<Option<FrameTimes>> {
        self.wait_for_near_processors();
        let pending = &self.points[point];
        let launches = self.run.launches();
        let of = match self.number {
            number if number > launches => format!(", additional launch {}", number - launches),
            number if launches > 1 => format!(", launch {number} of {launches}"),
            _ => String::new(),
        };
        self.sink.works_on(&format!("timing {}{of}", pending.label));
        match self.supervisor.cast(pending.task())? {
            Some(Ok(times)) => Ok(Some(times)),
            Some(Err(refusal)) => {
                self.failed.insert(point);
                let refused = pending.refused(refusal.write_into(pending.record.clone()));
                self.sink.keep(refused).map(|()| None)
            }
            None => Ok(None),
        }
    }

    fn sampled(&mut self, point: usize, round: u32, times: &FrameTimes) -> Result<bool> {
        let at_ms = self.at_ms();
        let core_to_core_ns = self.latency.around_sample(self.sink.near_ns());
        let taken = Taken { launch: self.launch, at_ms, core_to_core_ns, times: *times };
        let pending = &self.points[point];
        let device = device_of(self.run, pending).filter(|_| self.run.spread);
        let measured_by = device.and_then(|device| device.hardware.id());
        self.sink.sample(&pending.record, round, measured_by, &taken)?;
        self.taken[point].push(taken);
        self.anchor(point, round)?;
        Ok(is_near(core_to_core_ns, self.sink.near_ns()))
    }

    fn ended(&mut self, round: u32) -> Result<()> {
        let Some(load) = self.watch.look() else { return Ok(()) };
        self.sink.load(&RoundLoad::of(self.launch, round, &load))
    }

    fn is_broken(&self) -> bool {
        self.supervisor.losses() > self.losses
    }
}
