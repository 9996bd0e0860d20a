//! Points that are compared with each other, casters on the host among them: in every launch each is checked, then those that passed
//! are timed together.

use super::Run;
use super::complete::{Taken, complete};
use super::keeper::Keep;
use super::rounds::{End, Rounds, measure};
use super::supervisor::{Checked, Supervisor, Task};
use crate::error::Result;
use crate::launch::FrameTimes;
use crate::load::Watch;
use crate::measure::{StopReason, StoppingRule};
use crate::record::{Record, RoundLoad, judge};
use std::collections::{BTreeSet, HashSet};
use std::time::Instant;

/// A point that is yet to be measured.
pub struct Open {
    /// Its place in the plan.
    pub point: usize,
    /// The device whose worker runs it.
    pub device: usize,
    /// Its scene, by its number.
    scene: usize,
    /// For the observer.
    pub label: String,
    /// What is known of it.
    pub record: Record,
    /// The hash of its picture, once that was compared with the reference.
    verified: Option<String>,
    /// Its samples of whole launches.
    taken: Vec<Taken>,
}

impl Open {
    /// A point of which nothing is known but its draft: by its number, its device's and its scene's.
    pub fn new([point, device, scene]: [usize; 3], label: String, record: Record) -> Self {
        Self { point, device, scene, label, record, verified: None, taken: Vec::new() }
    }

    fn task(&self) -> Task<'_> {
        let (key, verified) = (&self.record.key, self.verified.as_deref());
        Task { point: self.point, device: self.device, scene: self.scene, key, verified }
    }
}

/// Points that are compared with each other, and how far they are.
pub struct OpenGroup {
    points: Vec<Open>,
    /// Launches that every point has been sampled in.
    whole: usize,
    /// How often it was visited: each time in fresh workers.
    visits: u32,
    /// Why the last launch ended.
    reason: Option<StopReason>,
    /// The device that it stays on, where groups are spread over several.
    home: Option<usize>,
}

impl OpenGroup {
    /// A group that has not been visited yet.
    pub fn new(points: Vec<Open>) -> Self {
        Self { points, whole: 0, visits: 0, reason: None, home: None }
    }

    /// How often it was visited.
    pub fn visits(&self) -> u32 {
        self.visits
    }

    /// Whether its points are casters on the host alone.
    pub fn is_on_host(&self) -> bool {
        self.points.iter().all(|open| open.record.is_baseline())
    }

    /// Whether it may be measured on this device.
    pub fn may_go_to(&self, device: usize) -> bool {
        self.home.is_none_or(|home| home == device)
    }

    /// Stays on a device: what is compared is measured on one.
    pub fn settle(&mut self, device: usize) {
        self.home = Some(device);
        self.points.iter_mut().for_each(|open| open.device = device);
    }

    /// Whether each of its points has its record.
    pub fn is_finished(&self) -> bool {
        self.points.is_empty()
    }

    /// Measures one launch in fresh workers. One that loses a worker is repeated whole. While points are timed nobody else
    /// measures on their devices.
    pub fn visit(
        &mut self,
        run: &Run<'_>,
        supervisor: &mut Supervisor<'_>,
        keeper: &mut impl Keep,
    ) -> Result<()> {
        let launches = run.experiment.timing.launches as usize;
        if self.visits == 0 {
            self.adopt(&run.stopping_rule(), launches, keeper);
        }
        self.visits += 1;
        loop {
            supervisor.retire();
            self.check(run, supervisor, keeper)?;
            if self.whole == launches || self.points.is_empty() {
                break;
            }
            match self.time(run, supervisor, keeper)? {
                End::Enough(reason) => {
                    self.whole += 1;
                    self.reason = Some(reason);
                    keeper.advances(self.points.len());
                    break;
                }
                End::AllFailed => break,
                End::Broken => keeper.says("a worker was lost: its launch is repeated whole"),
            }
        }
        if self.whole == launches { self.finish(keeper) } else { Ok(()) }
    }

    /// Takes over what an earlier session measured: launches in which every point has samples enough. Of half a launch
    /// nothing is used, for the other half would be another process's.
    fn adopt(&mut self, rule: &StoppingRule, launches: usize, keeper: &mut impl Keep) {
        let past: Vec<Vec<Taken>> = self.points.iter().map(|open| keeper.past(&open.record.key)).collect();
        let has = |taken: &Vec<Taken>, launch: u32| {
            taken.iter().filter(|sample| sample.launch == launch).count() >= rule.least()
        };
        let all: BTreeSet<u32> = past.iter().flatten().map(|sample| sample.launch).collect();
        let whole: HashSet<u32> = all
            .into_iter()
            .filter(|launch| past.iter().all(|taken| has(taken, *launch)))
            .take(launches)
            .collect();
        for (open, taken) in self.points.iter_mut().zip(past) {
            open.taken.extend(taken.into_iter().filter(|sample| whole.contains(&sample.launch)));
        }
        self.whole = whole.len();
        keeper.advances(self.whole * self.points.len());
    }

    /// Checks every point; one that fails has its record.
    fn check(
        &mut self,
        run: &Run<'_>,
        supervisor: &mut Supervisor<'_>,
        keeper: &mut impl Keep,
    ) -> Result<()> {
        let left = run.experiment.timing.launches as usize - self.whole;
        let devices = run.lock_names(&self.points);
        for mut open in std::mem::take(&mut self.points) {
            // A check needs no lock, but it would disturb whoever holds it: it begins when nobody does.
            let interrupted = supervisor.interrupted();
            drop(run.locks.take_all(devices.clone(), &mut |line| keeper.says(line), interrupted)?);
            keeper.works_on(&format!("checking {}", open.label));
            let start = Instant::now();
            match supervisor.check(open.task())?.map(|found| named(found, &open.record)) {
                Ok((record, true)) => {
                    // Of later launches only the picture is looked at, which is the same.
                    if open.verified.is_none() {
                        open.verified.clone_from(&record.image_hash);
                        open.record = *record;
                        open.record.check_ms = Some(start.elapsed().as_secs_f64() * 1e3);
                    }
                    self.points.push(open);
                    continue;
                }
                Ok((record, false)) => keeper.keep(*record)?,
                Err(refusal) => keeper.keep(refusal.write_into(open.record))?,
            }
            keeper.advances(left);
        }
        Ok(())
    }

    /// Takes the rounds of one launch.
    fn time(
        &mut self,
        run: &Run<'_>,
        supervisor: &mut Supervisor<'_>,
        keeper: &mut impl Keep,
    ) -> Result<End> {
        let timing = &run.experiment.timing;
        let devices = run.lock_names(&self.points);
        let interrupted = supervisor.interrupted();
        let _held = run.locks.take_all(devices, &mut |line| keeper.says(line), interrupted)?;
        let launch = keeper.next_launch();
        let (number, losses) = (self.whole + 1, supervisor.losses());
        let taken = vec![Vec::new(); self.points.len()];
        let failed = HashSet::new();
        let (points, start, watch) = (&self.points, Instant::now(), Watch::start());
        let mut timed =
            Timed { points, run, launch, number, start, watch, losses, supervisor, keeper, taken, failed };
        let end = measure(points.len(), &run.stopping_rule(), timing.seed, &mut timed)?;
        let Timed { taken, failed, .. } = timed;
        let left = timing.launches as usize - self.whole;
        keeper.advances(left * failed.len());
        let points = std::mem::take(&mut self.points).into_iter().zip(taken).enumerate();
        for (_, (mut open, taken)) in points.filter(|(place, _)| !failed.contains(place)) {
            if matches!(end, End::Enough(_)) {
                open.taken.extend(taken);
            }
            self.points.push(open);
        }
        Ok(end)
    }

    /// Completes the records of its points, which all stop together.
    fn finish(&mut self, keeper: &mut impl Keep) -> Result<()> {
        let reason = self.reason;
        let completed = |mut open: Open| {
            complete(&mut open.record, &open.taken, reason);
            open.record
        };
        let mut records: Vec<Record> = self.points.drain(..).map(completed).collect();
        judge(&mut records);
        for record in &mut records {
            record.interval_ms = crate::record::interval(record);
        }
        records.into_iter().try_for_each(|record| keeper.keep(record))
    }
}

/// What was checked, by the names of its draft: a worker knows of one folder of kernels only.
fn named((mut record, ready): Checked, draft: &Record) -> Checked {
    record.name.clone_from(&draft.name);
    record.preset.clone_from(&draft.preset);
    record.kernels_of.clone_from(&draft.kernels_of);
    (record, ready)
}

/// A launch whose samples are kept as they come.
struct Timed<'b, 's, K> {
    points: &'b [Open],
    run: &'b Run<'b>,
    /// The launch's number in the folder, and among those of the group.
    launch: u32,
    number: usize,
    start: Instant,
    /// What else the machine does.
    watch: Watch,
    /// Workers that were lost before it began.
    losses: usize,
    supervisor: &'b mut Supervisor<'s>,
    keeper: &'b mut K,
    taken: Vec<Vec<Taken>>,
    failed: HashSet<usize>,
}

impl<K: Keep> Rounds for Timed<'_, '_, K> {
    fn cast(&mut self, point: usize) -> Result<Option<FrameTimes>> {
        let open = &self.points[point];
        let launches = self.run.experiment.timing.launches;
        let of = if launches > 1 { format!(", launch {} of {launches}", self.number) } else { String::new() };
        self.keeper.works_on(&format!("timing {}{of}", open.label));
        match self.supervisor.cast(open.task())? {
            Some(Ok(times)) => Ok(Some(times)),
            Some(Err(refusal)) => {
                self.failed.insert(point);
                self.keeper.keep(refusal.write_into(open.record.clone())).map(|()| None)
            }
            None => Ok(None),
        }
    }

    fn sampled(&mut self, point: usize, round: u32, times: &FrameTimes) -> Result<()> {
        // To the microsecond, which is enough to tell their order.
        let at_ms = (self.start.elapsed().as_secs_f64() * 1e6).round() * 1e-3;
        let taken = Taken { launch: self.launch, at_ms, times: *times };
        self.keeper.sample(&self.points[point].record.key, round, &taken)?;
        self.taken[point].push(taken);
        Ok(())
    }

    fn ended(&mut self, round: u32) -> Result<()> {
        let load = self.watch.look();
        load.map_or(Ok(()), |load| self.keeper.load(&RoundLoad::of(self.launch, round, &load)))
    }

    fn is_broken(&self) -> bool {
        self.supervisor.losses() > self.losses
    }
}
