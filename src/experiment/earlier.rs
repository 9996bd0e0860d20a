//! Reads the results of earlier attempts at the same part of an experiment. The folders of these attempts are not
//! changed, since one of the attempts may still be running.

use crate::error::Result;
use crate::record::journals::{ANCHORS, CONTROLS, RECORDS, ROUNDS, SAMPLES};
use crate::record::{AnchorSample, Record, RoundLoad, Sample, read_lines};
use serde::de::DeserializeOwned;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// The results of earlier attempts: all records, and everything that was measured in each launch in which a point
/// without a record was measured.
#[derive(Debug, Default)]
pub struct Before {
    /// For each point, records of later attempts follow those of earlier attempts.
    pub records: Vec<Record>,
    /// Launches are renumbered, so that each number is unique. Each sample states by which attempt and launch it
    /// was taken.
    pub samples: Vec<Sample>,
    /// The times of the anchor in these launches, under their new numbers.
    pub anchors: Vec<AnchorSample>,
    /// The load during the rounds of these launches, under their new numbers.
    pub rounds: Vec<RoundLoad>,
}

/// Reads the folders of earlier attempts.
pub fn read(folders: &[PathBuf]) -> Result<Before> {
    let mut before = Before::default();
    for folder in folders {
        before.records.extend(lines::<Record>(&folder.join(RECORDS))?);
    }
    let done: HashSet<&str> = before.records.iter().map(|record| record.key.as_str()).collect();
    let mut next = 0;
    for folder in folders {
        let mut samples = lines::<Sample>(&folder.join(SAMPLES))?;
        // What an attempt copied from an earlier attempt is dropped, since the earlier attempt's folder contains it
        // too.
        samples.retain(|sample| sample.origin.is_none());
        // The record of a control point that a block borrows is in a journal of its own.
        let controls = lines::<Record>(&folder.join(CONTROLS))?;
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
            &mut sample.launch
        }));
        let anchors = lines::<AnchorSample>(&folder.join(ANCHORS))?;
        before.anchors.extend(renumbered(anchors, &numbers, |line| &mut line.launch));
        let rounds = lines::<RoundLoad>(&folder.join(ROUNDS))?;
        before.rounds.extend(renumbered(rounds, &numbers, |line: &mut RoundLoad| {
            // Latencies of different machines are not compared, and the earlier attempt may have run on another one.
            line.core_to_core_ns = None;
            &mut line.launch
        }));
    }
    Ok(before)
}

/// Returns the new number of each launch. The launches get consecutive numbers from `next` on, in the order in which
/// they first appear.
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

/// Returns the lines of the launches that have a new number, under this number. `launch` is called once with each line;
/// it may change the line, and returns its launch.
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

/// Reads a journal, which is a file with one JSON object per line. Returns nothing if the file is missing, as in the
/// folder of an attempt that was killed early.
fn lines<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>> {
    if path.is_file() { Ok(read_lines(path)?.lines) } else { Ok(Vec::new()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::JsonLines;

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
        let place = tempfile::tempdir().unwrap();
        let one = attempt(
            &place.path().join("one"),
            "done",
            &[("done", 0, None), ("open", 3, None), ("done", 3, None)],
        );
        let two = attempt(
            &place.path().join("two"),
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
        let before = read(&[one, two, place.path().join("gone")]).unwrap();
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
        // The anchors and the load of these launches follow, and only theirs: the second attempt's launch 0 is a copy.
        let anchors: Vec<_> = before.anchors.iter().map(|anchor| (anchor.launch, anchor.ms)).collect();
        let rounds: Vec<_> = before.rounds.iter().map(|load| (load.launch, load.ms)).collect();
        assert_eq!(anchors, [(0, 3.5), (1, 1.5)]);
        assert_eq!(rounds, anchors);
    }

    #[test]
    fn a_finished_block_with_a_control_point_of_another_block_is_not_taken_over() {
        let place = tempfile::tempdir().unwrap();
        let samples = [("done", 0, None), ("control", 0, None), ("control", 1, None)];
        let folder = attempt(place.path(), "done", &samples[..2]);
        let record = Record { key: "control".into(), sample_launches: vec![0; 5], ..Record::default() };
        JsonLines::append_to(&folder.join(CONTROLS)).unwrap().append(&record).unwrap();
        let taken = |folder: &PathBuf| read(std::slice::from_ref(folder)).unwrap().samples.len();
        assert_eq!(taken(&folder), 0);
        // A launch of the control point without a record in the journal is not finished.
        let more = attempt(&place.path().join("more"), "done", &samples);
        JsonLines::append_to(&more.join(CONTROLS)).unwrap().append(&record).unwrap();
        assert_eq!(taken(&more), 1);
    }
}
