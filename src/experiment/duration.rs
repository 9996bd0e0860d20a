//! Predicts how long a run will take, from earlier times of its points.

use super::complete_launches::complete_launches;
use super::group::leaves_out_moved;
use super::moved_processors::{WAITS, most_additional};
use super::pending::PendingPoint;
use super::rounds::MOST as MOST_ROUNDS;
use super::taken::Taken;
use super::{Cost, Past, Run};
use crate::error::Result;
use crate::numbers::significant;
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
    /// Number of points to be measured. A control point is counted at most once, even if several blocks measure it.
    pub points: usize,
    /// How many of these points have a time in an earlier record.
    pub known: usize,
    /// Number of launches per point.
    pub launches: usize,
    /// Smallest number of frames that each point still needs.
    pub least_frames: usize,
    /// Expected time for the points that have a time in an earlier record.
    pub time: Duration,
    /// The longest additional time that the run may need because the host moves this virtual machine's
    /// processors to other cores. Launches then wait during their rounds, take more rounds, or are replaced by
    /// additional launches. Waits before the first round of a launch (at most one second each) and all other
    /// delays, such as crashes of workers, are not included.
    pub additional: Duration,
    /// The longest time that all frames take, including those of the warm-up, if a frame takes at most
    /// `usual_frame_ms` on average and no sample is repeated. The time for everything else, such as building,
    /// checking and waiting, is not included. Zero if the time is too long for this type.
    pub most: Duration,
    /// The longest mean time of a frame, in milliseconds, with which a launch takes its least number of rounds
    /// within its time limit.
    pub usual_frame_ms: f64,
    /// Number of records of points that are not in the plan, for example because the config has changed.
    pub others: usize,
}

/// A point's times in an earlier record, in milliseconds.
#[derive(Clone, Copy, Default)]
struct Known {
    /// Time of a sample.
    sample_ms: f64,
    /// Time of a check that only hashes the picture, and time of a check that compares the picture
    /// with the reference.
    check_ms: [f64; 2],
    /// Number of samples per launch; `None` if the record's key is not the point's key, since the stopping
    /// rule may then differ.
    rounds: Option<usize>,
}

impl Run<'_> {
    /// Predicts the duration of the run from `earlier` records. A point's time comes from a record of the same scene,
    /// device, strategy, local size and image size. If there is no such record, the time comes from a record of the
    /// same scene, device and strategy, scaled by the number of pixels. `past` contains the run's results so far: its
    /// finished points and its complete launches are not measured again.
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
        for group in &groups {
            let (own, again) = left(group, &done);
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
        // these points would be counted in `others` by mistake, so `others` stays 0.
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

    /// Returns the expected time in milliseconds of each point of the plan for one device, in groups of
    /// comparable points. A point's time comes from an `earlier` record. If there is no such record, the time
    /// is estimated from the amount of computation. A point without a record whose preset is meant for
    /// another kind of device is skipped, so it costs only the start of a worker. Each cost states the index
    /// of its point in the plan.
    pub fn costs(&self, earlier: &[Record]) -> Result<Vec<Vec<Cost>>> {
        let plan = self.plan_of_one_device();
        let earlier = ByName::of(earlier);
        let cost = |pending: &PendingPoint| {
            let before = earlier.of_same(&pending.record);
            let known = self.known_before(pending, &earlier);
            let known = known.or_else(|| pending.not_for.as_ref().map(|_| Known::default()));
            let known = known.unwrap_or_else(|| guessed(&pending.record));
            let ms = self.group_ms(&[known], self.launches());
            let failed = before.is_some_and(|earlier| earlier.outcome != Outcome::Measured);
            Cost {
                point: pending.point,
                ms,
                may_control: !failed && self.is_for_every_kind(&plan.points[pending.point]),
            }
        };
        let groups = self.pending_points(&plan, &plan.by_device())?;
        Ok(groups.iter().map(|group| group.iter().map(cost).collect()).collect())
    }

    /// Returns a point's times by an earlier record of the same point or, if there is none, of the same scene,
    /// device and strategy. Returns `None` if there is no such record, or if the record has no time. Also
    /// returns `None` if the record says that the point did not fit on its device, but the point fits in this
    /// session.
    fn known_before(&self, pending: &PendingPoint, earlier: &ByName<'_>) -> Option<Known> {
        let before = earlier.of_same(&pending.record).filter(|before| !pending.fits_meanwhile(before));
        self.known(&pending.record, before?)
    }

    /// Returns a point's times by the record `earlier`; `None` if this record has no time. `draft` is the
    /// point's record before the point is tried.
    fn known(&self, draft: &Record, earlier: &Record) -> Option<Known> {
        // A point that does not fit on its device takes no time. If too little memory was free during the
        // earlier run, the record is not final: the point may fit now, and then takes time.
        if earlier.outcome == Outcome::Infeasible && earlier.is_final() && point(earlier) == point(draft) {
            return Some(Known::default());
        }
        let larger = draft.pixels() / earlier.pixels();
        let sample_ms = larger * earlier.host_median_ms? * f64::from(earlier.batch.unwrap_or(1));
        let again_ms = earlier.build_ms.unwrap_or(0.0) + sample_ms;
        let first_ms = earlier.check_ms.map_or(again_ms, |ms| ms * larger.max(1.0));
        let launches = self.launches();
        let left_out = earlier.preempted_samples.unwrap_or(0) + earlier.moved_samples.unwrap_or(0);
        let samples = earlier.samples_ms.len() + left_out as usize;
        let rounds = (earlier.key == draft.key).then_some(samples / launches);
        Some(Known { sample_ms, check_ms: [again_ms, first_ms], rounds })
    }

    /// Returns the number of launches in which these points of a group still have to be measured. The number
    /// is at least 1, since a group without a record is checked once more, even if earlier sessions have
    /// taken all its samples.
    fn launches_left<'r>(&self, points: impl Iterator<Item = &'r Record>, past: &Past) -> usize {
        let samples = |key: &str| past.samples.get(key).map(Vec::as_slice).unwrap_or_default();
        let points: Vec<(&str, &[Taken])> =
            points.map(|record| (record.key.as_str(), samples(&record.key))).collect();
        let end_of = |launch: u32| past.ends.get(&launch).cloned();
        let complete = complete_launches(&points, end_of, &self.stopping_rule()).len();
        self.launches().saturating_sub(complete).max(1)
    }

    /// Returns the time for this many launches of a group, in milliseconds. In the first launch, pictures are
    /// compared with the reference.
    fn group_ms(&self, points: &[Known], launches: usize) -> f64 {
        let compare_ms: f64 = points.iter().map(|point| point.check_ms[1] - point.check_ms[0]).sum();
        launches as f64 * self.launch_ms(points) + compare_ms
    }

    /// Returns the longest time, in milliseconds, that a group may need beyond `group_ms` for this many
    /// launches. In the worst case, all launches of the group are replaced, and every launch takes more
    /// rounds and waits during its rounds. The second that each launch may wait before its first round is not
    /// included.
    fn most_additional_ms(&self, points: &[Known], launches: usize) -> f64 {
        let replaced = most_additional(self.launches());
        let most_rounds = f64::from(MOST_ROUNDS);
        let continued_ms = (most_rounds - 1.0 + WAITS * most_rounds) * self.rounds_ms(points);
        replaced as f64 * self.launch_ms(points) + (launches + replaced) as f64 * continued_ms
    }

    /// Returns the time, in milliseconds, for a launch of a group in which pictures are not compared with the
    /// reference.
    fn launch_ms(&self, points: &[Known]) -> f64 {
        if points.is_empty() {
            return 0.0;
        }
        let sum = |of: &dyn Fn(&Known) -> f64| points.iter().map(of).sum::<f64>();
        let warm_ms = sum(&|point| self.warm_up_ms(point.sample_ms));
        START_MS + warm_ms + self.rounds_ms(points) + sum(&|point| point.check_ms[0])
    }

    /// Returns the time, in milliseconds, for a point's warm-up in a launch. The warm-up ends early if frames are long.
    fn warm_up_ms(&self, frame_ms: f64) -> f64 {
        let timing = &self.experiment.timing;
        (f64::from(timing.warmup) * frame_ms).min(0.1 * timing.time_limit_ms + frame_ms)
    }

    /// Returns the longest mean time of a frame, in milliseconds, with which a launch takes its least number of rounds
    /// within its time limit. With longer frames, the launch exceeds its limit.
    fn usual_frame_ms(&self) -> f64 {
        let rule = self.stopping_rule();
        rule.time_limit_ms / rule.least() as f64
    }

    /// Returns the longest time, in milliseconds, for the frames of this many launches of a group with this many
    /// points, if a frame takes at most [`usual_frame_ms`](Self::usual_frame_ms) on average. A launch ends after the
    /// round in which it reaches its time limit, so it may exceed the limit by the time of a round.
    fn most_frames_ms(&self, points: usize, launches: usize) -> f64 {
        let (rule, frame_ms) = (self.stopping_rule(), self.usual_frame_ms());
        let sampling_ms = (rule.time_limit_ms + frame_ms).min(rule.max_samples as f64 * frame_ms);
        (points * launches) as f64 * (self.warm_up_ms(frame_ms) + sampling_ms)
    }

    /// Returns the time, in milliseconds, for the rounds of a launch in which all samples count.
    fn rounds_ms(&self, points: &[Known]) -> f64 {
        let rule = self.stopping_rule();
        let round_ms = points.iter().map(|point| point.sample_ms).sum::<f64>();
        let by_time = (rule.time_limit_ms * points.len() as f64 / round_ms.max(1e-3)).ceil();
        let by_rule = (by_time as usize).clamp(rule.least(), rule.max_samples);
        let rounds = points.iter().filter_map(|point| point.rounds).max().unwrap_or(by_rule);
        rounds as f64 * round_ms
    }
}

/// The times of groups, in milliseconds.
#[derive(Clone, Copy, Default)]
struct Together {
    /// The time of all groups of casters on the host.
    host_ms: f64,
    /// The time of all groups that are measured on devices.
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
    /// group on one device. Groups of casters on the host are measured while no other group is measured.
    fn ms_on(&self, devices: usize) -> f64 {
        self.host_ms + self.longest_ms.max(self.devices_ms / devices.max(1) as f64)
    }
}

/// Returns two lists. The first has the points of a group that have to be measured. The second has the
/// group's control point, if the control point is finished and must be measured again together with the
/// points of the first list. Points whose keys are in `done` are finished.
fn left<'a>(
    group: &'a [PendingPoint],
    done: &HashSet<String>,
) -> (Vec<&'a PendingPoint>, Vec<&'a PendingPoint>) {
    let is_finished = |record: &Record| record.is_control || done.contains(&record.key);
    let is_control = |record: &Record| record.control.as_ref() == Some(&record.key);
    let meant = group.iter().filter(|pending| pending.not_for.is_none());
    let (finished, own): (Vec<_>, Vec<_>) = meant.partition(|pending| is_finished(&pending.record));
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
    /// If there is none, returns an earlier record of the same scene, device and strategy.
    fn of_same(&self, draft: &Record) -> Option<&'a Record> {
        self.0.get(&point(draft)).or_else(|| self.0.get(&strategy(draft))).copied()
    }
}

/// Estimates the time of a point that was never measured, well enough to distinguish slow points
/// from fast points. A ray is tested against every triangle, or against about thirty boxes and
/// triangles on each level of a tree. The estimate assumes that a device does a fixed number of
/// these tests per millisecond, and the host a tenth of that number.
fn guessed(draft: &Record) -> Known {
    const TESTS_PER_MS: f64 = 1e6;
    let rays = draft.pixels() * (1.0 + draft.lights.unwrap_or(1) as f64);
    let triangles = draft.triangles.unwrap_or(1) as f64;
    let tests = if draft.walks_tree() { 30.0 * (triangles + 1.0).log2() } else { triangles };
    let sample_ms = rays * tests / if draft.is_baseline() { 0.1 * TESTS_PER_MS } else { TESTS_PER_MS };
    Known { sample_ms, check_ms: [COMPILE_MS + sample_ms, COMPILE_MS + 2.0 * sample_ms], rounds: None }
}

/// Returns the names of a record's scene, device and strategy, without the local size and the image size.
fn strategy(record: &Record) -> String {
    format!("{}|{}|{}", record.scene, record.device, record.name)
}

impl fmt::Display for Expected {
    /// Formats as "33 points in 3 launches: about 6m 10s, based on earlier times".
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

    /// Returns a text that says how long the run takes or, if no time is known, how many frames it takes, and
    /// an upper limit of their total time.
    fn how_long(&self) -> String {
        let known = self.known;
        if known == 0 {
            let frames = counted(self.least_frames, "frame");
            return format!("at least {frames} of each point; {}", self.at_most());
        }
        let more = match self.additional {
            Duration::ZERO => String::new(),
            more => format!(" (up to {} more if samples must be repeated)", in_minutes(more)),
        };
        let some = match self.is_known() {
            true => ", based on earlier times".to_owned(),
            false => {
                format!(" for {known} of them, based on earlier times; the times of the others are unknown")
            }
        };
        format!("about {}{more}{some}", in_minutes(self.time))
    }

    /// Returns a text with an upper limit of the frames' total time, and the condition under which it holds.
    fn at_most(&self) -> String {
        if self.most.is_zero() {
            return "how long this takes is unknown".to_owned();
        }
        format!(
            "all frames together take about {} or less, if a frame takes at most {} ms on average; building, \
             checking and waiting for other measurements take additional time",
            in_minutes(self.most),
            significant(self.usual_frame_ms, 3)
        )
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
mod tests {
    use super::*;
    use crate::experiment::fixtures;
    use crate::launch::FrameTimes;
    use crate::measure::StopReason;
    use crate::record::LaunchEnd;

    /// The earlier times of three points. The first two points were sampled four times per launch. The number
    /// of rounds of the third point is unknown, so the estimate assumes four rounds for this point too.
    const POINTS: [Known; 3] = [
        Known { sample_ms: 2.0, check_ms: [10.0, 300.0], rounds: Some(4) },
        Known { sample_ms: 5.0, check_ms: [20.0, 400.0], rounds: Some(4) },
        Known { sample_ms: 13.0, check_ms: [70.0, 100.0], rounds: None },
    ];

    /// Returns the expected time of the points, in this many launches with this many warm-up frames.
    fn group_ms(launches: u32, warmup: u32) -> f64 {
        let timing = format!("timing = {{ launches = {launches}, warmup = {warmup}, time_limit_ms = 30 }}");
        let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
        fixtures::run(&experiment, &[], &fixtures::own_locks()).group_ms(&POINTS, launches as usize)
    }

    #[test]
    fn every_launch_checks_its_points_and_only_the_first_compares_them_with_the_reference() {
        // A launch consists of the start of a worker, the checks of the points, and four rounds of 20 ms
        // each. The value `launch_ms` does not include the checks. The checks take 800 ms in the first
        // launch, and 100 ms in each later launch.
        let launch_ms = START_MS + 4.0 * 20.0;
        assert_eq!(group_ms(1, 0), launch_ms + 800.0);
        assert_eq!(group_ms(3, 0), 3.0 * launch_ms + 800.0 + 2.0 * 100.0);
    }

    #[test]
    fn a_group_takes_at_most_twice_its_launches_with_twice_their_rounds_and_waits() {
        let timing = "timing = { launches = 3, warmup = 0, time_limit_ms = 30 }";
        let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
        let locks = fixtures::own_locks();
        let run = fixtures::run(&experiment, &[], &locks);
        // At most, all three launches are replaced. A replacement consists of the start of a worker, the checks (100
        // ms) and four rounds of 20 ms. Each of the six launches may take four more rounds, and wait for half the time
        // of all eight rounds.
        let replaced_ms = 3.0 * (START_MS + 100.0 + 80.0);
        assert_eq!(run.most_additional_ms(&POINTS, 3), replaced_ms + 6.0 * 160.0);
        assert_eq!(run.most_additional_ms(&POINTS, 1), replaced_ms + 4.0 * 160.0);
        assert_eq!(run.most_additional_ms(&[], 3), 0.0);
    }

    #[test]
    fn additional_launches_are_said_beside_the_expected_time() {
        let minutes = |n: u64| Duration::from_secs(60 * n + 5);
        let expected = Expected { points: 2, known: 2, launches: 3, time: minutes(4), ..Expected::default() };
        assert_eq!(expected.to_string(), "2 points in 3 launches: about 4m 5s, based on earlier times");
        let additional = Expected { additional: minutes(3), ..expected }.to_string();
        let more = "(up to 3m 5s more if samples must be repeated)";
        assert_eq!(additional, format!("2 points in 3 launches: about 4m 5s {more}, based on earlier times"));
    }

    #[test]
    fn the_time_is_known_only_if_every_point_was_measured_before() {
        let is_known = |(points, known)| Expected { points, known, ..Expected::default() }.is_known();
        assert_eq!([(0, 0), (2, 0), (2, 1), (2, 2)].map(is_known), [false, false, false, true]);
    }

    #[test]
    fn finished_points_that_are_not_in_the_plan_are_said() {
        let of =
            |others| Expected { points: 2, launches: 3, least_frames: 15, others, ..Expected::default() };
        let plan = "2 points in 3 launches: at least 15 frames of each point; how long this takes is unknown";
        assert_eq!(of(0).to_string(), plan);
        let one = "1 record in this folder is of an earlier plan; it is kept, but not shown";
        assert_eq!(of(1).to_string(), format!("{plan}\n{one}"));
        let two = "2 records in this folder are of earlier plans; they are kept, but not shown";
        assert_eq!(of(2).to_string(), format!("{plan}\n{two}"));
        let finished = Expected { points: 0, ..of(2) };
        assert_eq!(finished.to_string(), format!("no point is left to measure\n{two}"));
    }

    #[test]
    fn samples_that_are_left_out_took_time_too() {
        let experiment = fixtures::experiment("local_sizes = [4]\ntiming = { launches = 3 }");
        let of = |count, preempted_samples, moved_samples| {
            let record = Record {
                samples_ms: vec![1.0; count],
                preempted_samples,
                moved_samples,
                host_median_ms: Some(1.0),
                image_size: [8, 5],
                ..Record::default()
            };
            let known = fixtures::run(&experiment, &[], &fixtures::own_locks()).known(&record, &record);
            known.and_then(|known| known.rounds)
        };
        let known =
            [of(30, None, None), of(30, Some(0), Some(0)), of(21, Some(9), None), of(17, Some(9), Some(4))];
        assert_eq!(known, [Some(10); 4]);
    }

    #[test]
    fn one_point_and_one_frame_are_in_the_singular() {
        let expected = |points, least_frames| {
            Expected { points, launches: 3, least_frames, ..Expected::default() }.to_string()
        };
        let unknown = "of each point; how long this takes is unknown";
        assert_eq!(expected(1, 1), format!("1 point in 3 launches: at least 1 frame {unknown}"));
        assert_eq!(expected(2, 15), format!("2 points in 3 launches: at least 15 frames {unknown}"));
    }

    /// The device in this test is a GPU, and the preset `wide` is meant for CPUs.
    #[test]
    fn a_point_for_another_kind_of_device_takes_no_time_and_is_no_control_point() {
        let lines = "baselines = ['serial']\nlocal_sizes = [4]\n[[strategy]]\npreset = 'wide'";
        let experiment = fixtures::experiment(lines);
        let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let expected = run.expected(&[], &Past::default()).unwrap();
        assert_eq!((expected.points, expected.known), (2, 0), "the caster on the host and `naive`");
        let plan = run.plan();
        let groups = run.pending_points(&plan, &plan.by_device()).unwrap();
        let [host, naive, wide] =
            [0, 1, 2].map(|index| groups.iter().flatten().nth(index).unwrap().record.clone());
        let of = |earlier: &[Record]| -> Vec<(usize, f64, bool)> {
            let costs = run.costs(earlier).unwrap().concat();
            costs.iter().map(|cost| (cost.point, cost.ms, cost.may_control)).collect()
        };
        let guesses = of(&[]);
        let seen: Vec<_> = guesses.iter().map(|(point, _, may_control)| (*point, *may_control)).collect();
        assert_eq!(seen, [(0, true), (1, true), (2, false)]);
        // A point that is skipped takes less time than any point whose program is compiled.
        assert!(guesses[2].1 < guesses[1].1, "{guesses:?}");
        // A point that failed may fail again, so it must not become a block's control point.
        let failed = Record { outcome: Outcome::Crashed, ..naive.clone() };
        let measured = Record { outcome: Outcome::Measured, host_median_ms: Some(1e6), ..host };
        let known = of(&[failed, measured, wide]);
        assert_eq!([known[0].2, known[1].2], [true, false]);
        assert!(known[0].1 > 1e6 && guesses[0].1 < 1e6, "{known:?}");
    }

    #[test]
    fn a_control_point_is_measured_again_only_beside_unfinished_points_of_its_block() {
        let pending = |key: &str, is_control| {
            let record =
                Record { key: key.into(), control: Some("c".into()), is_control, ..Record::default() };
            PendingPoint::new([0; 3], String::new(), record)
        };
        let keys = |group: &[PendingPoint], done: &[&str]| {
            let done: HashSet<String> = done.iter().map(|key| (*key).to_owned()).collect();
            let (own, again) = left(group, &done);
            [own, again].map(|points| points.iter().map(|one| one.record.key.as_str()).collect::<String>())
        };
        let lends = [pending("c", false), pending("a", false)];
        assert_eq!([keys(&lends, &[]), keys(&lends, &["c"])], [["ca", ""], ["a", "c"]]);
        let borrows = [pending("c", true), pending("b", false)];
        assert_eq!([keys(&borrows, &["c"]), keys(&borrows, &["c", "b"])], [["b", "c"], ["", ""]]);
    }

    #[test]
    fn devices_that_share_the_points_measure_them_at_the_same_time() {
        let lines = "local_sizes = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]\ntiming = { launches = 2 }";
        let experiment = fixtures::experiment(lines);
        let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
        let devices = [&device, &device];
        let alone = fixtures::run(&experiment, &devices[..1], &locks);
        let plan = alone.plan();
        let groups = alone.pending_points(&plan, &plan.by_device()).unwrap();
        let measured = |pending: &PendingPoint| Record {
            outcome: Outcome::Measured,
            host_median_ms: Some(1000.0),
            samples_ms: vec![1000.0; 10],
            ..pending.record.clone()
        };
        let earlier: Vec<Record> = groups.iter().flatten().map(measured).collect();
        let blocks = crate::experiment::cut(&alone.costs(&earlier).unwrap(), 2);
        assert!(blocks.iter().any(crate::experiment::Block::borrows_control), "{blocks:?}");
        let shared =
            Run { spread: true, blocks: Some(&blocks[..]), ..fixtures::run(&experiment, &devices, &locks) };
        let of_earlier_plan = Record { key: "of an earlier plan".into(), ..Record::default() };
        let past = Past { records: vec![of_earlier_plan], ..Past::default() };
        let expected = |run: &Run<'_>| run.expected(&earlier, &past).unwrap();
        let (alone, shared) = (expected(&alone), expected(&shared));
        assert_eq!((alone.points, alone.known, alone.others), (12, 12, 1));
        assert_eq!((shared.points, shared.known, shared.others), (12, 12, 1));
        // One of the two devices measures seven points: the six points of its own block, and the control
        // point of the other block.
        let share = shared.time.as_secs_f64() / alone.time.as_secs_f64();
        assert!((0.5..0.7).contains(&share), "{share}: {blocks:?}");
        // Groups on the host are measured while no other group is measured, and a group is not divided.
        let mut groups = Together::default();
        for (is_on_host, ms) in [(true, 5.0), (false, 6.0), (false, 1.0), (false, 2.0)] {
            groups.add(is_on_host, ms);
        }
        assert_eq!([1, 2, 0].map(|devices| groups.ms_on(devices)), [14.0, 11.0, 14.0]);
    }

    #[test]
    fn launches_that_are_complete_are_not_expected_again() {
        let timing = "timing = { launches = 4, min_samples = 20, max_samples = 20 }";
        let experiment = fixtures::experiment(&format!("local_sizes = [4, 8]\n{timing}"));
        let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let groups = run.pending_points(&run.plan(), &run.plan().whole()).unwrap();
        let timed = |pending: &PendingPoint| Record {
            outcome: Outcome::Measured,
            host_median_ms: Some(1000.0),
            samples_ms: vec![1000.0; 20],
            ..pending.record.clone()
        };
        let earlier: Vec<Record> = groups.iter().flatten().map(timed).collect();
        let times = FrameTimes::whole(1.0, 1.0);
        let sample = |launch: u32| Taken { launch, at_ms: 0.0, core_to_core_ns: None, times };
        // The second point lacks a sample of the last launch.
        let expected = |launches: &[u32]| {
            let all: Vec<Taken> =
                launches.iter().flat_map(|launch| std::iter::repeat_n(sample(*launch), 5)).collect();
            let fewer = all[..all.len().saturating_sub(1)].to_vec();
            let keys = earlier.iter().map(|record| record.key.clone());
            let samples: HashMap<String, Vec<Taken>> = keys.zip([all, fewer]).collect();
            let past = Past { samples, ..Past::default() };
            let of = |earlier: &[Record]| run.expected(earlier, &past).unwrap();
            (of(&earlier).time.as_secs_f64(), of(&[]).least_frames)
        };
        let (all_s, frames) = expected(&[]);
        let (half_s, frames_of_half) = expected(&[3, 5, 6]);
        assert!((half_s / all_s - 0.5).abs() < 1e-6, "{half_s} of {all_s} s");
        assert_eq!([frames, frames_of_half], [20, 10]);
        // Even if no sample is missing, the points are checked once more, in one launch.
        let (least_s, _) = expected(&[0, 1, 2, 3, 4, 5, 6]);
        assert!((least_s / all_s - 0.25).abs() < 1e-6, "{least_s} of {all_s} s");
    }

    #[test]
    fn a_launch_that_was_interrupted_is_expected_again() {
        let timing = "timing = { launches = 4, min_samples = 400, max_samples = 400, time_limit_ms = 10000 }";
        let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
        let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let [(_, _, point)] = &run.planned_points().unwrap()[..] else { panic!("one point") };
        let times = FrameTimes::whole(1.0, 1.0);
        let taken = Taken { launch: 0, at_ms: 0.0, core_to_core_ns: None, times };
        let samples = |count| HashMap::from([(point.key.clone(), vec![taken; count])]);
        let frames = |past: &Past| run.expected(&[], past).unwrap().least_frames;
        let interrupted = Past { samples: samples(20), ..Past::default() };
        let complete = Past { samples: samples(100), ..Past::default() };
        assert_eq!([frames(&interrupted), frames(&complete)], [20, 15]);
        let end = LaunchEnd {
            launch: 0,
            stop_reason: StopReason::TimeLimit,
            samples: [(point.key.clone(), 20)].into(),
        };
        assert_eq!(frames(&Past { ends: HashMap::from([(0, end)]), ..interrupted }), 15);
    }

    #[test]
    fn a_warm_up_of_long_frames_ends_early() {
        // The point with frames of 2 ms casts both of its warm-up frames. For the other points, the estimate of the
        // warm-up is a tenth of the 30 ms limit, plus one frame.
        let warm_ms = 4.0 + (3.0 + 5.0) + (3.0 + 13.0);
        assert_eq!(group_ms(1, 2) - group_ms(1, 0), warm_ms);
    }

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
        let text = "2 points in 2 launches: at least 10 frames of each point; all frames together take about 3s or \
                    less, if a frame takes at most 100 ms on average; building, checking and waiting for other \
                    measurements take additional time";
        assert_eq!(expected.to_string(), text);
    }

    #[test]
    fn a_time_of_another_size_is_scaled_by_the_number_of_pixels() {
        let experiment = fixtures::experiment("local_sizes = [4]\ntiming = { launches = 2 }");
        let locks = fixtures::own_locks();
        let run = fixtures::run(&experiment, &[], &locks);
        let earlier = Record {
            key: "small".into(),
            image_size: [8, 5],
            host_median_ms: Some(1.5),
            batch: Some(4),
            build_ms: Some(10.0),
            check_ms: Some(100.0),
            samples_ms: vec![1.5; 20],
            ..Record::default()
        };
        let same = run.known(&earlier, &earlier).unwrap();
        assert_eq!((same.sample_ms, same.check_ms, same.rounds), (6.0, [16.0, 100.0], Some(10)));
        let larger = Record { key: "large".into(), image_size: [16, 10], ..earlier.clone() };
        let scaled = run.known(&larger, &earlier).unwrap();
        assert_eq!((scaled.sample_ms, scaled.check_ms, scaled.rounds), (24.0, [34.0, 400.0], None));
        let smaller = Record { key: "tiny".into(), image_size: [4, 5], ..earlier.clone() };
        // A part of a check's time does not depend on the image size, so the time of a first check is not
        // scaled down.
        assert_eq!(run.known(&smaller, &earlier).unwrap().check_ms, [13.0, 100.0]);
        let refused = Record { outcome: Outcome::Infeasible, host_median_ms: None, ..earlier.clone() };
        assert_eq!(run.known(&refused, &refused).unwrap().sample_ms, 0.0);
        let reason = Some("the host's memory (casting): 2 B > 1 B according to a test".to_owned());
        let lacked = Record { reason, ..refused.clone() };
        assert!(run.known(&lacked, &lacked).is_none(), "the point may fit at another moment");
        let crashed = Record { outcome: Outcome::Crashed, ..refused };
        assert!(run.known(&crashed, &crashed).is_none());
    }

    #[test]
    fn a_point_is_known_by_its_own_name_and_otherwise_by_a_timed_point_of_its_strategy() {
        let of = |side: u32, host_median_ms: Option<f64>| Record {
            name: "naive".into(),
            local_size: Some([side; 2]),
            image_size: [8, 5],
            host_median_ms,
            ..Record::default()
        };
        let earlier = [of(4, Some(1.0)), of(8, None)];
        let known = ByName::of(&earlier);
        let size = |side: u32| known.of_same(&of(side, None)).and_then(|record| record.local_size);
        assert_eq!([size(4), size(8)], [Some([4; 2]), Some([8; 2])]);
        assert_eq!(size(16), Some([4; 2]), "only this one has a time");
    }

    /// 10 x 10 pixels with two lights make 300 rays: a primary ray and two shadow rays for each pixel.
    #[test]
    fn a_guess_counts_rays_and_the_tests_of_each_ray() {
        let draft = |strategy: &str| Record {
            strategy: strategy.into(),
            image_size: [10, 10],
            lights: Some(2),
            triangles: Some(1023),
            local_size: Some([8, 8]),
            ..Record::default()
        };
        let of = |name: &str| guessed(&draft(&crate::strategy::preset(name).unwrap().strategy.to_string()));
        let every = of("naive");
        assert!((every.sample_ms - 300.0 * 1023.0 / 1e6).abs() < 1e-9, "{}", every.sample_ms);
        let [again, first] = every.check_ms;
        assert_eq!(
            [again - COMPILE_MS, first - COMPILE_MS],
            [every.sample_ms, 2.0 * every.sample_ms].map(|ms| (COMPILE_MS + ms) - COMPILE_MS)
        );
        // 300 rays, with 300 tests each: 30 tests in each of the log2(1023 triangles + 1) = 10 levels of the tree.
        assert!((of("bvh").sample_ms - 300.0 * 300.0 / 1e6).abs() < 1e-9, "{}", of("bvh").sample_ms);
        let host = Record { device: crate::record::HOST.into(), local_size: None, ..draft("serial-f32") };
        assert!((guessed(&host).sample_ms / every.sample_ms - 10.0).abs() < 1e-9);
    }
}
