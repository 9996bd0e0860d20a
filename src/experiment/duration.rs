//! Predicts how long a run will take, from earlier times of its points.

mod upper_limit;

use super::complete_launches::complete_launches;
use super::group::leaves_out_moved;
use super::moved_processors::{WAITS, most_additional};
use super::pending::PendingPoint;
use super::rounds::MOST as MOST_ROUNDS;
use super::taken::Taken;
use super::{Cost, Past, Run};
use crate::error::Result;
use crate::record::{Outcome, Record, point};
use crate::words::counted;
use std::collections::{HashMap, HashSet};
use std::fmt;
use std::time::Duration;

/// Expected time to start a worker: to start its process and its driver, and to load its scene.
const START_MS: f64 = 500.0;

/// Expected time to compile a program, if no earlier time is known.
const COMPILE_MS: f64 = 300.0;

/// The expected duration of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Expected {
    /// Number of points to be measured, without those that do not fit on their device. A control point (which
    /// several blocks of points measure for comparison) is counted at most once.
    pub points: usize,
    /// How many of the points to be measured have a time in an earlier record.
    pub known: usize,
    /// Number of launches (measurements by processes of their own) of each point.
    pub launches: usize,
    /// The least number of frames that a point of the run still needs.
    pub least_frames: usize,
    /// Expected time for the points that have a time in an earlier record.
    pub time: Duration,
    /// The longest additional time that the run may need because the host moves a virtual machine's
    /// processors to other cores. If the host moves processors, launches wait during their rounds, take more
    /// rounds, or are replaced by additional launches. The field `additional` does not include waits before
    /// the first round of a launch (at most one second each), or other delays, such as crashes of workers.
    pub additional: Duration,
    /// If a frame takes at most `usual_frame_ms` on average and no sample is repeated, all frames together
    /// take at most this time. The frames of the warm-up are included. The time for everything else, such as
    /// building, checking and waiting, is not included. Zero if the time is too long for the type `Duration`.
    pub most: Duration,
    /// The longest mean time of a frame, in milliseconds, with which a launch completes its least number of rounds
    /// within its time limit.
    pub usual_frame_ms: f64,
    /// Number of points that have the same program with both folders of kernels, if the run compares two folders.
    /// Points with the same program in both folders are measured once, and `points` counts them once.
    pub of_both_folders: usize,
    /// Number of records of points that are not in the plan, for example because the config has changed; 0 if the run
    /// measures only a shard.
    pub others: usize,
}

/// A point's times in an earlier record, in milliseconds.
#[derive(Clone, Copy, Default)]
struct Known {
    /// Time of one sample of the point.
    sample_ms: f64,
    /// Times of two checks: of a check in a later launch, and of the check in the first launch. A later launch loads
    /// the program (without a cache, compiles it), and only hashes the picture. The first launch compiles the program
    /// if it is in no cache, and compares the picture with the reference.
    check_ms: [f64; 2],
    /// Number of samples of the point per launch. `None` if the earlier record's key differs from the point's
    /// key, because the rule that ends the sampling may differ too.
    rounds: Option<usize>,
}

impl Run<'_> {
    /// Predicts the duration of the run from `earlier` records. A point's time comes from a record of the
    /// same scene, device, strategy, local size and image size. If no record has the same sizes, the time
    /// comes from a record of the same scene, device and strategy, scaled by the number of pixels. `past`
    /// contains the run's results so far: its finished points and its complete launches are not measured
    /// again.
    pub fn expected(&self, earlier: &[Record], past: &Past) -> Result<Expected> {
        let launches = self.launches();
        let earlier = ByName::of(earlier);
        let mut expected = Expected {
            launches,
            least_frames: launches * self.stopping_rule().least(),
            usual_frame_ms: self.usual_frame_ms(),
            ..Expected::default()
        };
        let [mut all, mut additional, mut most] = [Together::default(); 3];
        let plan = self.plan();
        let groups = self.pending_points(&plan, &self.pieces(&plan))?;
        let done = self.done(groups.iter().flatten(), past);
        let mut keys = HashSet::new();
        for group in &groups {
            let (missing, again) = left(group, &done);
            // Of several points with the same key, a run measures only one.
            let is_new = |pending: &&PendingPoint| keys.insert(pending.record.key.clone());
            let (own, repeated): (Vec<_>, Vec<_>) = missing.into_iter().partition(is_new);
            expected.of_both_folders += self.other_sources.map_or(0, |_| repeated.len());
            let known = |points: &[&PendingPoint]| -> Vec<Known> {
                points.iter().filter_map(|pending| self.known_before(pending, &earlier)).collect()
            };
            let timed = known(&own);
            expected.points += own.len();
            expected.known += timed.len();
            let timed = [timed, known(&again)].concat();
            let records = own.iter().chain(&again).map(|pending| &pending.record);
            let launches = self.launches_left(records, past);
            expected.least_frames = expected.least_frames.min(launches * self.stopping_rule().least());
            let is_on_host = group.iter().all(|pending| pending.record.is_baseline());
            all.add(is_on_host, self.group_ms(&timed, launches));
            most.add(is_on_host, self.most_frames_ms(own.len() + again.len(), launches));
            if leaves_out_moved(self, group) {
                additional.add(is_on_host, self.most_additional_ms(&timed, launches));
            }
        }
        // If only a shard is measured, `groups` lacks the points of the other shards' blocks. The records of
        // the other shards' points would wrongly be counted as records that are not in the plan, so `others`
        // stays 0.
        if self.spread || self.blocks.is_none() {
            expected.others = not_planned(&groups, past);
        }
        // The times come from a file of records, which may contain anything; an invalid time counts as zero.
        let duration = |ms: f64| Duration::try_from_secs_f64(1e-3 * ms).unwrap_or_default();
        let devices = if self.spread { self.devices.len() } else { 1 };
        expected.time = duration(all.ms_on(devices));
        expected.additional = duration(additional.ms_on(devices));
        expected.most = duration(most.ms_on(devices));
        Ok(expected)
    }

    /// Returns the expected time in milliseconds of each point of the plan for one device, in groups of comparable
    /// points. Unless the points are distributed over devices, each point is measured on every device, so the point's
    /// expected time is the sum of its times on all devices. The time on a device comes from an `earlier` record. If
    /// there is no earlier record, the time is estimated from the amount of computation. A point that does not fit on
    /// its device takes no time. A point whose preset is meant for another kind of device takes no time either, if it
    /// has no earlier record: the run skips the point. Each returned `Cost` contains the index of its point in the plan
    /// for one device.
    pub fn costs(&self, earlier: &[Record]) -> Result<Vec<Vec<Cost>>> {
        let mut sums: HashMap<usize, Cost> = HashMap::new();
        for cost in self.costs_on_devices(earlier)? {
            let sum = sums.entry(cost.point).or_insert(Cost { ms: 0.0, start_ms: 0.0, ..cost });
            sum.ms += cost.ms;
            sum.start_ms += cost.start_ms;
            sum.may_control &= cost.may_control;
        }
        let groups = self.plan_of_one_device().groups_by_device();
        let of_group =
            |points: &Vec<usize>| points.iter().filter_map(|point| sums.get(point).copied()).collect();
        Ok(groups.iter().map(of_group).collect())
    }

    /// Returns the expected time of each point on each device, or on the host. The indices of the points are
    /// those of the plan for one device.
    fn costs_on_devices(&self, earlier: &[Record]) -> Result<Vec<Cost>> {
        let plan = self.plan();
        let indices = plan.indices_on_devices().into_iter();
        let of_one_device: HashMap<usize, usize> = indices.map(|((of, _), index)| (index, of)).collect();
        let earlier = ByName::of(earlier);
        let start_ms = self.launches() as f64 * START_MS;
        let cost = |pending: &PendingPoint| {
            let before = earlier.of_same(&pending.record);
            let fits = pending.fits;
            let known = if fits { self.known_before(pending, &earlier) } else { Some(Known::default()) };
            let known = known.or_else(|| pending.not_for.as_ref().map(|_| Known::default()));
            let known = known.unwrap_or_else(|| guessed(&pending.record));
            let ms = self.points_ms(&[known], self.launches());
            let failed = before.is_some_and(|earlier| earlier.outcome != Outcome::Measured);
            let may_control = !failed && fits && self.is_for_every_kind(&plan.points[pending.point]);
            Some(Cost { point: *of_one_device.get(&pending.point)?, ms, start_ms, may_control })
        };
        let groups = self.pending_points(&plan, &plan.by_device())?;
        Ok(groups.iter().flatten().filter_map(cost).collect())
    }

    /// Returns a point's times from an earlier record of the same point or, if there is none, of the same
    /// scene, device and strategy. Returns `None` if no earlier record matches the point, or if the matching
    /// record has no time. Also returns `None` if the record says that the point did not fit on its device,
    /// but the point fits in this session.
    fn known_before(&self, pending: &PendingPoint, earlier: &ByName<'_>) -> Option<Known> {
        let before = earlier.of_same(&pending.record).filter(|before| !pending.fits_meanwhile(before));
        self.known(&pending.record, before?)
    }

    /// Returns a point's times from the record `earlier`; `None` if this record has no time. `draft` is the
    /// point's record before the point is tried.
    fn known(&self, draft: &Record, earlier: &Record) -> Option<Known> {
        // A point that does not fit on its device takes no time. If too little memory was free during the
        // earlier run, the record is not final: the point may fit now, and then takes time.
        if earlier.outcome == Outcome::Infeasible && earlier.is_final() && point(earlier) == point(draft) {
            return Some(Known::default());
        }
        let larger = draft.pixels() / earlier.pixels();
        let sample_ms = larger * earlier.host_median_ms? * f64::from(earlier.batch.unwrap_or(1));
        let again_ms = self.load_ms(earlier) + sample_ms;
        let first_ms = earlier.check_ms.map_or(again_ms, |ms| (ms * larger.max(1.0)).max(again_ms));
        let launches = self.launches();
        let left_out = earlier.preempted_samples.unwrap_or(0) + earlier.moved_samples.unwrap_or(0);
        let samples = earlier.samples_ms.len() + left_out as usize;
        let rounds = (earlier.key == draft.key).then_some(samples / launches);
        Some(Known { sample_ms, check_ms: [again_ms, first_ms], rounds })
    }

    /// Returns the expected time, in milliseconds, in which a later launch gets the program of a point. `earlier` is a
    /// record of the point.
    fn load_ms(&self, earlier: &Record) -> f64 {
        let build_ms = earlier.build_ms.unwrap_or(0.0);
        match (self.caches_programs, earlier.build_from_cache) {
            // The earlier run compiled the program in `build_ms`. raycl's cache is assumed to hold the program now. The
            // time to load the stored program is unknown but short, so it is set to 0.
            (true, Some(false)) => 0.0,
            // Each launch compiles the program, but the earlier run only loaded it.
            (false, Some(true)) => build_ms.max(COMPILE_MS),
            _ => build_ms,
        }
    }

    /// Returns the number of launches in which these points of a group still have to be measured. The number of
    /// launches is at least 1, since points without a record are checked again, even if earlier sessions have taken all
    /// their samples.
    fn launches_left<'r>(&self, points: impl Iterator<Item = &'r Record>, past: &Past) -> usize {
        let samples = |key: &str| past.samples.get(key).map(Vec::as_slice).unwrap_or_default();
        let points: Vec<(&str, &[Taken])> =
            points.map(|record| (record.key.as_str(), samples(&record.key))).collect();
        let end_of = |launch: u32| past.ends.get(&launch).cloned();
        let complete = complete_launches(&points, end_of, &self.stopping_rule()).len();
        self.launches().saturating_sub(complete).max(1)
    }

    /// Returns the time for `launches` launches of a group, in milliseconds.
    fn group_ms(&self, points: &[Known], launches: usize) -> f64 {
        launches as f64 * self.launch_ms(points) + first_launch_ms(points)
    }

    /// Returns the time for `launches` launches of a group without the starts of its workers, in milliseconds.
    fn points_ms(&self, points: &[Known], launches: usize) -> f64 {
        launches as f64 * self.started_launch_ms(points) + first_launch_ms(points)
    }

    /// Returns the longest time, in milliseconds, that a group may need in addition to `group_ms` for
    /// `launches` launches. In the worst case, all launches of the group are replaced by additional launches,
    /// and every launch takes more rounds and waits during its rounds. The wait of up to one second before a
    /// launch's first round is not included.
    fn most_additional_ms(&self, points: &[Known], launches: usize) -> f64 {
        let replaced = most_additional(self.launches());
        let most_rounds = f64::from(MOST_ROUNDS);
        let continued_ms = (most_rounds - 1.0 + WAITS * most_rounds) * self.rounds_ms(points);
        replaced as f64 * self.launch_ms(points) + (launches + replaced) as f64 * continued_ms
    }

    /// Returns the time, in milliseconds, for a later launch of a group (any launch but the group's first).
    fn launch_ms(&self, points: &[Known]) -> f64 {
        if points.is_empty() { 0.0 } else { START_MS + self.started_launch_ms(points) }
    }

    /// Returns the time, in milliseconds, for a launch of a group after the launch's workers have started. The
    /// launch is not the group's first launch.
    fn started_launch_ms(&self, points: &[Known]) -> f64 {
        let sum = |of: &dyn Fn(&Known) -> f64| points.iter().map(of).sum::<f64>();
        let warm_ms = sum(&|point| self.warm_up_ms(point.sample_ms));
        warm_ms + self.rounds_ms(points) + sum(&|point| point.check_ms[0])
    }

    /// Returns the time, in milliseconds, for a point's warm-up in a launch. The warm-up ends early if frames are long.
    fn warm_up_ms(&self, frame_ms: f64) -> f64 {
        let timing = &self.experiment.timing;
        (f64::from(timing.warmup) * frame_ms).min(0.1 * timing.time_limit_ms + frame_ms)
    }

    /// Returns the time, in milliseconds, for the rounds of a launch if no sample of the launch is left out.
    fn rounds_ms(&self, points: &[Known]) -> f64 {
        let rule = self.stopping_rule();
        let round_ms = points.iter().map(|point| point.sample_ms).sum::<f64>();
        let by_time = (rule.time_limit_ms * points.len() as f64 / round_ms.max(1e-3)).ceil();
        let by_rule = (by_time as usize).clamp(rule.least(), rule.max_samples);
        let rounds = points.iter().filter_map(|point| point.rounds).max().unwrap_or(by_rule);
        rounds as f64 * round_ms
    }
}

/// Returns by how many milliseconds the first launch of a group takes longer than a later launch. Only the
/// first launch compares pictures with the reference and, if raycl has a cache, compiles programs.
fn first_launch_ms(points: &[Known]) -> f64 {
    points.iter().map(|point| point.check_ms[1] - point.check_ms[0]).sum()
}

/// The expected times of groups of points, in milliseconds, added up for the host and for all devices.
#[derive(Clone, Copy, Default)]
struct Together {
    /// The sum of the times of all groups of baselines, which are measured on the host.
    host_ms: f64,
    /// The sum of the times of all groups that are measured on devices.
    devices_ms: f64,
    /// The longest time of a group that is measured on a device.
    longest_ms: f64,
}

impl Together {
    fn add(&mut self, is_on_host: bool, ms: f64) {
        if is_on_host {
            self.host_ms += ms;
        } else {
            self.devices_ms += ms;
            self.longest_ms = self.longest_ms.max(ms);
        }
    }

    /// Returns the time for all groups, in milliseconds, if `devices` devices measure at the same time, each
    /// group on one device. Groups of baselines are measured while no other group is measured.
    fn ms_on(&self, devices: usize) -> f64 {
        self.host_ms + self.longest_ms.max(self.devices_ms / devices.max(1) as f64)
    }
}

/// Returns two lists. The first returned list has the points of a group that have to be measured. The second
/// returned list has the group's control point if this point is finished, but must be measured again for
/// comparison with the first list. Points whose keys are in `done` are finished. Neither list has points that
/// do not fit on their device: their programs are not even built.
fn left<'a>(
    group: &'a [PendingPoint],
    done: &HashSet<String>,
) -> (Vec<&'a PendingPoint>, Vec<&'a PendingPoint>) {
    let is_finished = |record: &Record| record.is_control || done.contains(&record.key);
    let is_control = |record: &Record| record.control.as_ref() == Some(&record.key);
    let possible = group.iter().filter(|pending| pending.not_for.is_none() && pending.fits);
    let (finished, own): (Vec<_>, Vec<_>) = possible.partition(|pending| is_finished(&pending.record));
    let is_again = |pending: &&PendingPoint| !own.is_empty() && is_control(&pending.record);
    let again = finished.into_iter().filter(is_again).collect();
    (own, again)
}

/// Returns how many earlier records belong to no point of the plan.
fn not_planned(groups: &[Vec<PendingPoint>], past: &Past) -> usize {
    let planned: HashSet<&String> = groups.iter().flatten().map(|pending| &pending.record.key).collect();
    past.records.iter().filter(|record| !planned.contains(&record.key)).count()
}

/// Finds earlier records by name. The name of a record is the text that [`point`] returns. A record that has
/// a time also has a second name, the text that [`strategy`] returns.
struct ByName<'a>(HashMap<String, &'a Record>);

impl<'a> ByName<'a> {
    fn of(earlier: &'a [Record]) -> Self {
        let timed = earlier.iter().filter(|record| record.host_median_ms.is_some());
        let mut by_name: HashMap<String, &Record> = timed.map(|record| (strategy(record), record)).collect();
        by_name.extend(earlier.iter().map(|record| (point(record), record)));
        Self(by_name)
    }

    /// Returns the earlier record of the same point as `draft` (a point's record before the point is tried).
    /// If no earlier record is of the same point, returns an earlier record of the same scene, device and
    /// strategy.
    fn of_same(&self, draft: &Record) -> Option<&'a Record> {
        self.0.get(&point(draft)).or_else(|| self.0.get(&strategy(draft))).copied()
    }
}

/// Estimates the time of a point that was never measured, well enough to distinguish slow points from fast points. The
/// estimate assumes that a ray is tested against every triangle or, with a tree, against thirty boxes and triangles on
/// each level. The estimate also assumes that a device does a fixed number of these tests per millisecond. The host is
/// assumed to do a tenth as many tests per millisecond.
fn guessed(draft: &Record) -> Known {
    const TESTS_PER_MS: f64 = 1e6;
    let rays = draft.primary_rays() * (1.0 + draft.lights.unwrap_or(1) as f64);
    let triangles = draft.triangles.unwrap_or(1) as f64;
    let tests = if draft.walks_tree() { 30.0 * (triangles + 1.0).log2() } else { triangles };
    let sample_ms = rays * tests / if draft.is_baseline() { 0.1 * TESTS_PER_MS } else { TESTS_PER_MS };
    Known { sample_ms, check_ms: [sample_ms, COMPILE_MS + 2.0 * sample_ms], rounds: None }
}

/// Returns the names of a record's scene, device and strategy, without the local size and the image size.
fn strategy(record: &Record) -> String {
    format!("{}|{}|{}", record.scene, record.device, record.name)
}

impl fmt::Display for Expected {
    /// Formats the expected duration as "33 points in 3 launches: about 6m 10s, based on earlier times". Further lines
    /// give the number of points whose programs are the same in both folders of kernels, and the number of records of
    /// earlier plans, unless these numbers are 0.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let launches = if self.launches == 1 {
            "1 launch (times in other launches may differ)".to_owned()
        } else {
            format!("{} launches", self.launches)
        };
        match self.points {
            0 => write!(f, "no point is left to measure")?,
            points => write!(f, "{} in {launches}: {}", counted(points, "point"), self.how_long())?,
        }
        match self.of_both_folders {
            0 => {}
            1 => {
                write!(f, "\n1 point has the same program in both folders of kernels, and is measured once")?
            }
            n => write!(
                f,
                "\n{n} points have the same programs in both folders of kernels, and are measured once"
            )?,
        }
        match self.others {
            0 => Ok(()),
            1 => write!(f, "\n1 record in this folder is of an earlier plan; it is kept, but not shown"),
            n => write!(f, "\n{n} records in this folder are of earlier plans; they are kept, but not shown"),
        }
    }
}

impl Expected {
    /// Returns true if there are points to be measured, and each of them has a time in an earlier record.
    pub fn is_known(&self) -> bool {
        self.points > 0 && self.known == self.points
    }

    /// Returns a text that says how long the run takes. If no time is known, the text gives the least number of frames
    /// that each point needs, and an upper limit of the total time of all frames.
    fn how_long(&self) -> String {
        let known = self.known;
        if known == 0 {
            let frames = counted(self.least_frames, "frame");
            return format!(
                "the duration is unknown; measuring each point takes at least {frames}{}",
                self.at_most()
            );
        }
        let more = match self.additional {
            Duration::ZERO => String::new(),
            more => format!(" (up to {} more if samples must be repeated)", in_minutes(more)),
        };
        let some = match self.is_known() {
            true => ", based on earlier times".to_owned(),
            false => {
                format!(
                    " for {known} of these points, based on earlier times; the times of the other points are unknown"
                )
            }
        };
        format!("about {}{more}{some}", in_minutes(self.time))
    }
}

/// Formats a duration as "6m 10s" or "10s"; the shortest result is "1s".
fn in_minutes(time: Duration) -> String {
    match time.as_secs() {
        seconds @ 0..60 => format!("{}s", seconds.max(1)),
        seconds => format!("{}m {}s", seconds / 60, seconds % 60),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
