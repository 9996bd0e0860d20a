//! Finds the records of control points (points that every block of a cut group of points measures) by which
//! the merged records of different blocks are compared.

use super::origins::{Launch, Origins};
use super::{Measured, lines};
use crate::error::Result;
use crate::record::Record;
use crate::record::journals::{CONTROLS, RECORDS};
use crate::shard::Attempt;
use std::collections::{BTreeSet, HashSet};

/// Returns records of control points that are not among `records` (the merged records). A record of a control point is
/// returned only if it was measured in a launch that a record in `records` uses. The launches of all other records of
/// control points are used by no merged record: their kind of device is not selected, or the merge uses records of
/// other attempts. If an attempt copied the launches of a control point from an earlier attempt, the earlier attempt
/// may have a record of the same launches. If several records have the same launches, only one of them is returned. If
/// `records` has a record with these launches, none is returned.
pub fn controls(attempts: &[Attempt], origins: &Origins, records: &[Measured]) -> Result<Vec<Measured>> {
    let identified = |(index, record): &Measured| (record.key.clone(), origins.of_record(*index, record));
    let mut known: HashSet<(String, BTreeSet<Launch>)> = records.iter().map(identified).collect();
    let used: BTreeSet<Launch> = known.iter().flat_map(|(_, launches)| launches).copied().collect();
    let mut controls = Vec::new();
    for (index, attempt) in attempts.iter().enumerate() {
        for record in of_attempt(attempt)? {
            let measured = (index, record);
            let (key, launches) = identified(&measured);
            if !launches.is_disjoint(&used) && known.insert((key, launches)) {
                controls.push(measured);
            }
        }
    }
    Ok(controls)
}

/// Returns all records of control points that an attempt measured. The record of a control point is in
/// `controls.jsonl` if the control point belongs to another block or was finished before, and otherwise in
/// `records.jsonl`. The merge may choose another attempt's record as the result of the control point. The other
/// points of this attempt are then still compared by this attempt's own record of the control point.
fn of_attempt(attempt: &Attempt) -> Result<Vec<Record>> {
    let is_control = |record: &Record| record.control.as_ref() == Some(&record.key);
    let own = lines::<Record>(&attempt.folder.join(RECORDS))?.into_iter().filter(is_control);
    let mut controls = lines::<Record>(&attempt.folder.join(CONTROLS))?;
    controls.extend(own.map(|record| Record { is_control: true, ..record }));
    Ok(controls)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::journals::SAMPLES;
    use crate::record::{JsonLines, Sample};
    use crate::shard::About;
    use std::path::Path;

    /// Returns the record of a point of a block; the key of the block's control point is "control".
    fn record(key: &str, launches: [u32; 2]) -> Record {
        let control = Some("control".to_owned());
        Record { key: key.into(), control, sample_launches: launches.to_vec(), ..Record::default() }
    }

    /// Makes an attempt with these lines in `records.jsonl` and in `controls.jsonl`.
    fn attempt(out: &Path, host: &str, [records, controls]: [&[Record]; 2]) -> Attempt {
        let about = About { shard: 1, of: 1, host: host.into(), ..About::default() };
        let attempt = Attempt::begin(out, &about).unwrap();
        for (name, lines) in [(RECORDS, records), (CONTROLS, controls)] {
            JsonLines::append_to(&attempt.folder.join(name)).unwrap().append_all(lines).unwrap();
        }
        attempt
    }

    /// Returns the attempt and the launches of each record of a control point.
    fn found(attempts: &[Attempt], records: &[Measured]) -> Vec<(usize, Vec<u32>)> {
        let origins = Origins::read(attempts).unwrap();
        let controls = controls(attempts, &origins, records).unwrap();
        assert!(controls.iter().all(|(_, record)| record.is_control && record.key == "control"));
        controls.into_iter().map(|(index, record)| (index, record.sample_launches)).collect()
    }

    #[test]
    fn a_control_point_is_kept_only_with_a_record_of_its_launches() {
        let out = tempfile::tempdir().unwrap();
        let control = Record { is_control: true, ..record("control", [2, 3]) };
        let attempts =
            ["n1", "n2"].map(|host| attempt(out.path(), host, [&[], std::slice::from_ref(&control)]));
        assert_eq!(found(&attempts, &[(1, record("a", [2, 3]))]), [(1, vec![2, 3])]);
        assert!(found(&attempts, &[(1, record("a", [4, 5]))]).is_empty());
    }

    /// Two attempts at the control point's own block ran at the same time. A different point failed in each of
    /// the two attempts, so the merge uses records of both.
    #[test]
    fn points_of_another_attempt_at_the_control_points_own_block_keep_its_record_of_the_control_point() {
        let out = tempfile::tempdir().unwrap();
        let [one, two] = [("n1", "a", [0, 1]), ("n2", "b", [5, 6])].map(|(host, key, launches)| {
            let records = [record("control", launches), record(key, launches)];
            attempt(out.path(), host, [&records, &[]])
        });
        let attempts = [one, two];
        let merged = [(0, record("control", [0, 1])), (0, record("a", [0, 1])), (1, record("b", [5, 6]))];
        assert_eq!(found(&attempts, &merged), [(1, vec![5, 6])]);
        assert!(found(&attempts, &merged[..2]).is_empty());
    }

    /// The first attempt was killed after it had written the record of the control point. The second attempt
    /// copied the launches, and wrote the records of the block's other points.
    #[test]
    fn a_copy_of_the_merged_record_of_a_control_point_is_left_out() {
        let out = tempfile::tempdir().unwrap();
        let first = attempt(out.path(), "n1", [&[record("control", [5, 6])], &[]]);
        let copy = Record { is_control: true, ..record("control", [0, 1]) };
        let second = attempt(out.path(), "n2", [&[record("a", [0, 1])], &[copy]]);
        let samples = [(0, 5), (1, 6)].map(|(launch, original)| Sample {
            key: "a".into(),
            launch,
            origin: Some(format!("{} launch {original}", first.name)),
            ..Sample::default()
        });
        JsonLines::append_to(&second.folder.join(SAMPLES)).unwrap().append_all(&samples).unwrap();
        let merged = [(0, record("control", [5, 6])), (1, record("a", [0, 1]))];
        assert!(found(&[first, second], &merged).is_empty());
    }
}
