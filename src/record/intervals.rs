//! Updates the 95% intervals that are stored in a journal of records.

use super::outcome::Outcome;
use super::point_times::interval;
use super::types::Record;
use super::write_whole;
use crate::error::{Error, Result};
use std::collections::HashMap;
use std::path::Path;

/// Copies the 95% intervals of `records` to the journal from which the records were read. raycl writes a
/// record as soon as the record's group ends. The samples of later groups show more precisely how much
/// launches differ, so the final interval is known only at the end of the run.
///
/// If the interval of any record differs, replaces the whole journal; lines of records without a new interval
/// keep their text. The caller must hold the folder's lock (by which only one process at a time writes to the
/// folder), and must open the journal again afterwards. Returns true if the file was replaced.
pub fn renew_intervals(journal: &Path, records: &[Record]) -> Result<bool> {
    let by_key: HashMap<&str, Option<[f64; 2]>> =
        records.iter().map(|record| (record.key.as_str(), interval(record))).collect();
    let bytes = std::fs::read(journal).map_err(|error| {
        Error::run(format!("cannot read {}: {error}", journal.display()))
            .with_help("check that the folder of results still exists")
    })?;
    let mut replaced = false;
    let mut text = Vec::with_capacity(bytes.len());
    for line in bytes.split_inclusive(|&byte| byte == b'\n') {
        match renewed(line, &by_key) {
            Some(line) => {
                text.extend(line);
                text.push(b'\n');
                replaced = true;
            }
            None => text.extend(line),
        }
    }
    if replaced {
        write_whole(journal, &text)?;
    }
    Ok(replaced)
}

/// Returns a line of the journal with the new interval of its record; `None` if the line stays unchanged.
fn renewed(line: &[u8], by_key: &HashMap<&str, Option<[f64; 2]>>) -> Option<Vec<u8>> {
    let mut record: Record = serde_json::from_slice(line).ok()?;
    let interval = *by_key.get(record.key.as_str())?;
    if record.outcome != Outcome::Measured || record.interval_ms == interval {
        return None;
    }
    record.interval_ms = interval;
    serde_json::to_vec(&record).ok()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::super::summary::tests::sampled;
    use super::super::together::judge;
    use super::super::{Lines, read_lines};
    use super::*;

    /// Returns a record of three launches. Each launch takes longer than the previous launch, by the fraction
    /// `apart` of the first launch's time.
    fn launches(key: &str, first: u32, apart: f64) -> Record {
        let sample = |index: u32| (first + index / 10, 10.0 * (1.0 + apart * f64::from(index / 10)));
        Record { key: key.to_owned(), ..sampled(key, (0..30).map(sample)) }
    }

    #[test]
    fn a_journal_has_the_intervals_of_the_whole_run_and_nothing_else_changes() {
        let folder = tempfile::tempdir().unwrap();
        let journal = folder.path().join("records.jsonl");
        let mut records = vec![launches("a", 0, 0.04), launches("b", 3, 0.05)];
        for record in &mut records {
            let mut alone = [record.clone()];
            judge(&mut alone);
            record.interval_ms = interval(&alone[0]);
        }
        let line = |record: &Record| serde_json::to_string(record).unwrap();
        let skipped = Record { key: "c".to_owned(), outcome: Outcome::OtherKind, ..Record::default() };
        // A point whose image is wrong has no time. If an earlier version of raycl stored an interval for a
        // point with a wrong image, the interval stays in the journal.
        let (outcome, interval_ms) = (Outcome::WrongImage, Some([1.0, 2.0]));
        let wrong = Record { outcome, interval_ms, ..launches("d", 6, 0.01) };
        let text = format!(
            "{}\n{{damaged\n{}\n{}\n{}\n",
            line(&records[0]),
            line(&skipped),
            line(&records[1]),
            line(&wrong)
        );
        std::fs::write(&journal, &text).unwrap();
        let alone = records.clone();
        records.push(wrong.clone());
        judge(&mut records);
        assert!(renew_intervals(&journal, &records).unwrap());
        let Lines { lines, damaged, .. } = read_lines::<Record>(&journal).unwrap();
        assert_eq!((damaged, &lines[3]), (vec![2], &wrong));
        for (actual, (whole, alone)) in [&lines[0], &lines[2]].into_iter().zip(records.iter().zip(&alone)) {
            assert_eq!(actual.interval_ms, interval(whole));
            assert_ne!(actual.interval_ms, alone.interval_ms);
            assert_eq!(actual.samples_ms, whole.samples_ms);
        }
        let after = std::fs::read(&journal).unwrap();
        assert!(!renew_intervals(&journal, &records).unwrap(), "nothing is left to renew");
        assert_eq!(std::fs::read(&journal).unwrap(), after);
    }
}
