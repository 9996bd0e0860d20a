//! Reads the results of earlier attempts at the same shard (part of an experiment). The folders of the
//! earlier attempts are not changed, since one of the earlier attempts may still be running.

use super::moved_processors::{Latencies, is_near};
use crate::error::Result;
use crate::printer;
use crate::record::journals::{ANCHORS, CONTROLS, LAUNCHES, RECORDS, ROUNDS, SAMPLES};
use crate::record::{AnchorSample, LaunchEnd, Lines, Record, RoundLoad, Sample, latest, read_lines_if_any};
use serde::de::DeserializeOwned;
use std::collections::{HashMap, HashSet};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// The results of earlier attempts. `Before` contains at most one record per point, and the data of every
/// launch in which an unfinished point was measured.
#[derive(Debug, Default)]
pub struct Before {
    /// At most one record per point. If several attempts have a record of a point, the record with the lowest
    /// [rank](Record::rank) is used, as in `raycl merge`.
    pub records: Vec<Record>,
    /// The samples of all launches, of any attempt, in which an unfinished point was measured. The launches are
    /// renumbered, so that no two attempts' launches have the same number. Each sample states the attempt and the
    /// launch in which it was taken. Samples that do not count, because their core-to-core latency is far from the
    /// attempt's usual latency, are left out.
    pub samples: Vec<Sample>,
    /// The ends of the launches in `samples`, with the launches' new numbers and the numbers of samples in
    /// `samples`.
    pub ends: Vec<LaunchEnd>,
    /// The times of the anchor (a fixed kernel) in the launches in `samples`, with the numbers that this
    /// attempt gives to the launches.
    pub anchors: Vec<AnchorSample>,
    /// The load during the rounds of the launches in `samples`, with the numbers that this attempt gives to
    /// the launches.
    pub rounds: Vec<RoundLoad>,
}

/// Reads the results of earlier attempts from their folders. If `keeps_moved_samples` is true, all samples
/// count, whatever their core-to-core latency. Points with a record are finished, with two exceptions. If
/// `retry_failed` is true, a point is unfinished if its record is not final ([`Record::is_final`]): a
/// failure, or a lack of memory that may be temporary. Unfinished points are measured again. If a point
/// exceeded a limit of the device, and this limit may differ between sessions
/// ([`Record::is_of_the_session`]), the point is always unfinished. A point that exceeded a limit of the
/// device in an earlier session may fit now, and another attempt may have measured some of the point's
/// launches.
pub fn read(folders: &[PathBuf], keeps_moved_samples: bool, retry_failed: bool) -> Result<Before> {
    let mut before = Before { records: records(folders)?, ..Before::default() };
    let is_finished = |record: &&Record| (!retry_failed || record.is_final()) && !record.is_of_the_session();
    let finished = before.records.iter().filter(is_finished);
    let done: HashSet<&str> = finished.map(|record| record.key.as_str()).collect();
    let mut next = 0;
    for folder in folders {
        let rounds = lines::<RoundLoad>(folder, ROUNDS)?;
        let mut samples = lines::<Sample>(folder, SAMPLES)?;
        // Samples that an attempt copied from an earlier attempt are dropped, since the earlier attempt's
        // folder contains them too.
        samples.retain(|sample| sample.origin.is_none());
        // Only the latencies that an attempt measured itself decide which of its samples count.
        let of_samples = samples.iter().map(|sample| sample.core_to_core_ns);
        let read = Latencies::of(rounds.iter().map(|line| line.core_to_core_ns).chain(of_samples));
        let near_ns = if keeps_moved_samples { f64::INFINITY } else { read.near_ns() };
        let counts = |sample: &Sample| is_near(sample.core_to_core_ns, near_ns);
        let mut ends = lines::<LaunchEnd>(folder, LAUNCHES)?;
        count_again(&mut ends, &samples, counts);
        samples.retain(counts);
        // If a block measures a control point only for comparison with other blocks, the control point's
        // record is in a separate journal.
        let controls = lines::<Record>(folder, CONTROLS)?;
        let is_of_control = |sample: &Sample| {
            let has_it = |record: &Record| record.sample_launches.contains(&sample.launch);
            controls.iter().any(|record| record.key == sample.key && has_it(record))
        };
        let is_open = |sample: &&Sample| !done.contains(sample.key.as_str()) && !is_of_control(sample);
        let open: HashSet<u32> = samples.iter().filter(is_open).map(|sample| sample.launch).collect();
        let launches = samples.iter().map(|sample| sample.launch).filter(|launch| open.contains(launch));
        let numbers = numbers(launches, &mut next);
        before.samples.extend(renumbered(samples, &numbers, |sample: &mut Sample| {
            sample.origin = Some(format!("{} launch {}", name(folder), sample.launch));
            // Latencies of different machines are not compared, and the earlier attempt may have run on
            // another machine.
            sample.core_to_core_ns = None;
            &mut sample.launch
        }));
        before.ends.extend(renumbered(ends, &numbers, |end| &mut end.launch));
        let anchors = lines::<AnchorSample>(folder, ANCHORS)?;
        before.anchors.extend(renumbered(anchors, &numbers, |line| &mut line.launch));
        before.rounds.extend(renumbered(rounds, &numbers, |line: &mut RoundLoad| {
            line.core_to_core_ns = None;
            &mut line.launch
        }));
    }
    Ok(before)
}

/// Returns one record of each point that has records in these folders: the record with the lowest rank
/// ([`Record::rank`]). If several records of a point have the lowest rank, the record in the first folder is
/// returned. If a folder has several records of a point, its last record is used, as in a merge.
fn records(folders: &[PathBuf]) -> Result<Vec<Record>> {
    let mut records: Vec<Record> = Vec::new();
    let mut indices: HashMap<String, usize> = HashMap::new();
    for folder in folders {
        for record in latest(lines(folder, RECORDS)?, |record| record.key.clone()) {
            let index = *indices.entry(record.key.clone()).or_insert(records.len());
            match records.get_mut(index) {
                Some(held) if record.rank() < held.rank() => *held = record,
                Some(_) => {}
                None => records.push(record),
            }
        }
    }
    Ok(records)
}

/// In the stored end of each launch, replaces the number of samples of each point by the number of the point's samples
/// that count. If a sample of a point was lost, removes the point from the stored end of the launch. If the stored end
/// of a launch lacks a point, the launch does not count as complete.
fn count_again(ends: &mut [LaunchEnd], samples: &[Sample], counts: impl Fn(&Sample) -> bool) {
    let mut numbers: HashMap<(u32, &str), [usize; 2]> = HashMap::new();
    for sample in samples {
        let [all, counted] = numbers.entry((sample.launch, sample.key.as_str())).or_default();
        *all += 1;
        *counted += usize::from(counts(sample));
    }
    for LaunchEnd { launch, samples, .. } in ends {
        samples.retain(|key, number| {
            let [all, counted] = numbers.get(&(*launch, key.as_str())).copied().unwrap_or_default();
            let has_all = *number == all;
            *number = counted;
            has_all
        });
    }
}

/// Returns the new number of each launch. The launches get consecutive numbers, beginning with `next`, in the order in
/// which they first appear.
fn numbers(launches: impl Iterator<Item = u32>, next: &mut u32) -> HashMap<u32, u32> {
    let mut numbers = HashMap::new();
    for launch in launches {
        numbers.entry(launch).or_insert_with(|| {
            *next += 1;
            *next - 1
        });
    }
    numbers
}

/// Returns the lines whose launches have a new number, with the new number in place of the old number.
/// `launch` is called once with each line. `launch` returns the line's launch number, and may change other
/// parts of the line.
fn renumbered<T>(lines: Vec<T>, numbers: &HashMap<u32, u32>, launch: impl Fn(&mut T) -> &mut u32) -> Vec<T> {
    let renumbered = lines.into_iter().filter_map(|mut line| {
        let launch = launch(&mut line);
        *launch = *numbers.get(launch)?;
        Some(line)
    });
    renumbered.collect()
}

fn name(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Reads the journal `name` of a folder, which is a file with one JSON object per line, and reports damaged lines.
/// Returns no lines if the file is missing, as in the folder of an attempt that was killed early.
pub(super) fn lines<T: DeserializeOwned>(folder: &Path, name: &str) -> Result<Vec<T>> {
    let path = folder.join(name);
    Ok(intact_lines(read_lines_if_any(&path)?, path.display()))
}

/// Reports the damaged lines of a journal, and returns its other lines.
pub(super) fn intact_lines<T>(read: Lines<T>, name: impl Display) -> Vec<T> {
    read.damage(&name.to_string()).into_iter().for_each(printer::tell);
    read.lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::StopReason;
    use crate::record::{JsonLines, Outcome};

    fn attempt(folder: &Path, record: &str, samples: &[(&str, u32, Option<&str>)]) -> PathBuf {
        std::fs::create_dir_all(folder).unwrap();
        let mut records = JsonLines::append_to(&folder.join(RECORDS)).unwrap();
        records.append(&Record { key: record.into(), ..Record::default() }).unwrap();
        let mut journal = JsonLines::append_to(&folder.join(SAMPLES)).unwrap();
        for (key, launch, origin) in samples {
            let origin = origin.map(str::to_owned);
            journal
                .append(&Sample { key: (*key).into(), launch: *launch, origin, ..Sample::default() })
                .unwrap();
        }
        folder.to_owned()
    }

    #[test]
    fn launches_of_unfinished_points_are_taken_over_once_under_new_numbers() {
        let parent = tempfile::tempdir().unwrap();
        let one = attempt(
            &parent.path().join("one"),
            "done",
            &[("done", 0, None), ("open", 3, None), ("done", 3, None)],
        );
        let two = attempt(
            &parent.path().join("two"),
            "too",
            &[("open", 0, Some("one launch 3")), ("open", 1, None)],
        );
        for (folder, launches) in [(&one, [0, 3]), (&two, [0, 1])] {
            for launch in launches {
                let ms = f64::from(launch) + 0.5;
                let anchor = AnchorSample { launch, ms, ..AnchorSample::default() };
                JsonLines::append_to(&folder.join(ANCHORS)).unwrap().append(&anchor).unwrap();
                let load = RoundLoad { launch, ms, ..RoundLoad::default() };
                JsonLines::append_to(&folder.join(ROUNDS)).unwrap().append(&load).unwrap();
            }
        }
        let before = read(&[one, two, parent.path().join("gone")], false, false).unwrap();
        assert_eq!(before.records.len(), 2);
        let samples: Vec<_> = before
            .samples
            .iter()
            .map(|sample| (sample.key.as_str(), sample.launch, sample.origin.as_deref().unwrap()))
            .collect();
        assert_eq!(
            samples,
            [("open", 0, "one launch 3"), ("done", 0, "one launch 3"), ("open", 1, "two launch 1")]
        );
        // Of the earlier times of the anchor (a fixed kernel) and of the load, only those of the two launches
        // in `samples` are kept. Launch 0 of the second attempt is left out, since it is a copy of a launch
        // of the first attempt.
        let anchors: Vec<_> = before.anchors.iter().map(|anchor| (anchor.launch, anchor.ms)).collect();
        let rounds: Vec<_> = before.rounds.iter().map(|load| (load.launch, load.ms)).collect();
        assert_eq!(anchors, [(0, 3.5), (1, 1.5)]);
        assert_eq!(rounds, anchors);
    }

    #[test]
    fn launches_of_a_failed_point_are_taken_over_only_if_failed_points_are_measured_again() {
        let parent = tempfile::tempdir().unwrap();
        let folder = attempt(parent.path(), "failed", &[("failed", 0, None), ("measured", 1, None)]);
        let measured = Record { key: "measured".into(), outcome: Outcome::Measured, ..Record::default() };
        JsonLines::append_to(&folder.join(RECORDS)).unwrap().append(&measured).unwrap();
        let keys = |retry_failed| {
            let before = read(std::slice::from_ref(&folder), false, retry_failed).unwrap();
            assert_eq!(before.records.len(), 2);
            before.samples.into_iter().map(|sample| sample.key).collect::<Vec<String>>()
        };
        assert_eq!(keys(true), ["failed"]);
        assert!(keys(false).is_empty());
    }

    /// The point exceeded the device's memory in the first attempt. In the second attempt, the limit of the
    /// device's memory was larger; the attempt was killed after a launch of the point.
    #[test]
    fn a_launch_of_a_point_that_fits_meanwhile_is_taken_over() {
        let parent = tempfile::tempdir().unwrap();
        let [first, second] = ["first", "second"].map(|name| parent.path().join(name));
        let samples = [("lacking", 1, None), ("measured", 2, None)];
        let folders = [attempt(&first, "measured", &[]), attempt(&second, "other", &samples)];
        let keys_after = |reason: &str| {
            let (outcome, reason) = (Outcome::Infeasible, Some(reason.to_owned()));
            let lacking = Record { key: "lacking".into(), outcome, reason, ..Record::default() };
            JsonLines::append_to(&first.join(RECORDS)).unwrap().append(&lacking).unwrap();
            let before = read(&folders, false, false).unwrap();
            before.samples.into_iter().map(|sample| sample.key).collect::<Vec<String>>()
        };
        assert!(keys_after("__local memory: 2 B > 1 B").is_empty());
        assert_eq!(keys_after("global memory: 2 B > 1 B"), ["lacking"]);
    }

    /// Returns lines of `rounds.jsonl` by which the usual core-to-core latency is about `near_ns`.
    fn loads(near_ns: f64) -> Vec<RoundLoad> {
        let load = |n: u32| RoundLoad {
            core_to_core_ns: Some(near_ns + 0.1 * f64::from(n)),
            ..RoundLoad::default()
        };
        (0..10).map(load).collect()
    }

    /// The usual core-to-core latency of the second attempt's machine is 2.3 times that of the first attempt's machine.
    #[test]
    fn whether_samples_count_depends_on_the_latency_in_their_own_attempt_unless_the_user_keeps_all() {
        let parent = tempfile::tempdir().unwrap();
        let of = |name: &str, near_ns: f64, other_ns: f64| {
            let folder = attempt(&parent.path().join(name), "done", &[]);
            JsonLines::append_to(&folder.join(ROUNDS)).unwrap().append_all(&loads(near_ns)).unwrap();
            let sample = |ns| Sample { key: "open".into(), core_to_core_ns: Some(ns), ..Sample::default() };
            let samples = [near_ns, other_ns, near_ns].map(sample);
            JsonLines::append_to(&folder.join(SAMPLES)).unwrap().append_all(&samples).unwrap();
            folder
        };
        let folders = [of("one", 57.0, 131.0), of("two", 131.0, 57.0)];
        let launches = |keeps_moved_samples| {
            let before = read(&folders, keeps_moved_samples, false).unwrap();
            assert!(before.samples.iter().all(|sample| sample.core_to_core_ns.is_none()));
            before.samples.iter().map(|sample| sample.launch).collect::<Vec<u32>>()
        };
        assert_eq!(launches(false), [0, 0, 1, 1]);
        assert_eq!(launches(true), [0, 0, 0, 1, 1, 1]);
    }

    #[test]
    fn the_end_of_a_launch_is_taken_over_with_the_number_of_samples_that_count() {
        let parent = tempfile::tempdir().unwrap();
        let folder = attempt(parent.path(), "done", &[]);
        JsonLines::append_to(&folder.join(ROUNDS)).unwrap().append_all(&loads(57.0)).unwrap();
        let of = |key: &str, ns: [f64; 3]| {
            let sample =
                |ns| Sample { key: key.into(), launch: 6, core_to_core_ns: Some(ns), ..Sample::default() };
            ns.map(sample)
        };
        let samples = [of("a", [57.0, 131.0, 57.0]), of("b", [57.0; 3])].concat();
        JsonLines::append_to(&folder.join(SAMPLES)).unwrap().append_all(&samples).unwrap();
        // A sample of the point "b" was lost, and launch 7 has no samples.
        let end = |launch: u32, samples: &[(&str, usize)]| {
            let samples = samples.iter().map(|(key, number)| ((*key).to_owned(), *number)).collect();
            LaunchEnd { launch, stop_reason: StopReason::Precise, samples }
        };
        let ends = [end(6, &[("a", 3), ("b", 4)]), end(7, &[("c", 5)])];
        JsonLines::append_to(&folder.join(LAUNCHES)).unwrap().append_all(&ends).unwrap();
        let before = read(&[folder], false, false).unwrap();
        assert_eq!((before.samples.len(), before.ends), (5, vec![end(0, &[("a", 2)])]));
    }

    #[test]
    fn a_point_has_the_record_that_a_merge_chooses_whichever_folder_comes_first() {
        let parent = tempfile::tempdir().unwrap();
        let of = |name: &str, outcome: Outcome| {
            let folder = parent.path().join(name);
            std::fs::create_dir(&folder).unwrap();
            let record = Record { key: "k".into(), outcome, ..Record::default() };
            JsonLines::append_to(&folder.join(RECORDS)).unwrap().append(&record).unwrap();
            folder
        };
        let [crashed, measured] = [of("9999", Outcome::Crashed), of("10000", Outcome::Measured)];
        for folders in [[crashed.clone(), measured.clone()], [measured, crashed]] {
            let records = read(&folders, false, false).unwrap().records;
            let outcomes: Vec<Outcome> = records.iter().map(|record| record.outcome).collect();
            assert_eq!(outcomes, [Outcome::Measured]);
        }
    }

    #[test]
    fn a_finished_block_with_a_control_point_of_another_block_is_not_taken_over() {
        let parent = tempfile::tempdir().unwrap();
        let samples = [("done", 0, None), ("control", 0, None), ("control", 1, None)];
        let folder = attempt(parent.path(), "done", &samples[..2]);
        let record = Record { key: "control".into(), sample_launches: vec![0; 5], ..Record::default() };
        JsonLines::append_to(&folder.join(CONTROLS)).unwrap().append(&record).unwrap();
        let taken =
            |folder: &PathBuf| read(std::slice::from_ref(folder), false, false).unwrap().samples.len();
        assert_eq!(taken(&folder), 0);
        // Launch 1 measured the control point, by which parts of a group of points are compared. No record of
        // the control point contains this launch, so the launch counts as unfinished.
        let more = attempt(&parent.path().join("more"), "done", &samples);
        JsonLines::append_to(&more.join(CONTROLS)).unwrap().append(&record).unwrap();
        assert_eq!(taken(&more), 1);
        // Launch 0 also measured a point that has no record.
        let samples = [("control", 0, None), ("open", 0, None)];
        let open = attempt(&parent.path().join("open"), "done", &samples);
        JsonLines::append_to(&open.join(CONTROLS)).unwrap().append(&record).unwrap();
        assert_eq!(taken(&open), 2);
    }
}
