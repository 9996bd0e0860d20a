//! Reads the results of earlier attempts at the same part of an experiment. The folders of these attempts are not
//! changed, since one of the attempts may still be running.

use crate::error::Result;
use crate::record::journals::{RECORDS, SAMPLES};
use crate::record::{Record, Sample, read_lines};
use serde::de::DeserializeOwned;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// The results of earlier attempts: all records, and all samples of each launch in which a point without a record was
/// measured.
#[derive(Debug, Default)]
pub struct Before {
    /// For each point, records of later attempts follow those of earlier attempts.
    pub records: Vec<Record>,
    /// Launches are renumbered, so that each number is unique. Each sample states by which attempt and launch it
    /// was taken.
    pub samples: Vec<Sample>,
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
        // Samples that an attempt copied from an earlier attempt are dropped, since the earlier attempt's folder
        // contains them too.
        samples.retain(|sample| sample.origin.is_none());
        let open: HashSet<u32> = samples
            .iter()
            .filter(|sample| !done.contains(sample.key.as_str()))
            .map(|sample| sample.launch)
            .collect();
        samples.retain(|sample| open.contains(&sample.launch));
        before.samples.extend(renumbered(samples, &name(folder), &mut next));
    }
    Ok(before)
}

fn renumbered(samples: Vec<Sample>, attempt: &str, next: &mut u32) -> Vec<Sample> {
    let mut numbers: HashMap<u32, u32> = HashMap::new();
    let mut renumbered = Vec::new();
    for mut sample in samples {
        sample.origin = Some(format!("{attempt} launch {}", sample.launch));
        sample.launch = *numbers.entry(sample.launch).or_insert_with(|| {
            *next += 1;
            *next - 1
        });
        renumbered.push(sample);
    }
    renumbered
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
    }
}
