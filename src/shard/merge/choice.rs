//! Chooses one record of each point, if several attempts have a record of the point.

use super::{Measured, lines};
use crate::error::{Error, Result};
use crate::record::journals::RECORDS;
use crate::record::{Outcome, Record, new_names};
use crate::shard::kind::FOLDER;
use crate::shard::{Attempt, Kind};
use crate::words::{counted, few};
use std::cmp::Reverse;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;

/// The chosen record of each point, and all outcomes of points with several records.
#[derive(Debug, Default)]
pub struct Chosen {
    /// The chosen record of each point, by the point's key.
    best: HashMap<String, Measured>,
    /// Maps the key of each point with several records to a list: for each of these records, the index of its
    /// attempt, and its outcome.
    several: BTreeMap<String, Vec<(usize, Outcome)>>,
}

/// Reads the attempts' records and chooses one record for each point. A record with a wrong image takes precedence
/// over all other records. Of two records without a wrong image, a record with a time takes precedence over a record
/// without a time. Among the records without a time, [`Record::rank`] decides on the order. If several records of a
/// point are equally good by these rules of precedence, the record of the preferred attempt is used. All points of a
/// block (points that are measured together) have the same preferred attempt, because points of different attempts
/// were not measured in the same rounds. To find a block's preferred attempt, raycl counts, for each attempt, those
/// points of the block for which no other attempt has a better record. The attempt with the most counted points is
/// preferred. Between attempts with equally many counted points, the attempt with the most samples of its counted
/// points is preferred. If attempts also have equally many samples of their counted points, the attempt whose name
/// sorts first is preferred. Times of day are never compared, since the clocks of two machines may differ. If an
/// attempt has several records of a point, its last record is used, as for a run without shards.
pub fn choose(attempts: &[Attempt]) -> Result<Chosen> {
    let mut offered = Offered::default();
    for (index, attempt) in attempts.iter().enumerate() {
        let mut own: HashMap<String, Record> = HashMap::new();
        for record in lines::<Record>(&attempt.folder.join(RECORDS))? {
            own.insert(record.key.clone(), record);
        }
        own.into_values().for_each(|record| offered.add(index, record));
    }
    Ok(offered.chosen())
}

/// All records of each point, by the point's key: at most one record of each attempt, in the order of the
/// attempts.
#[derive(Default)]
struct Offered(BTreeMap<String, Vec<Measured>>);

/// Points that an attempt measured together: all points of a block on a device or, if the records name no
/// block, all points of a scene and an image size on a device.
#[derive(PartialEq, Eq, Hash)]
struct Together {
    device: String,
    block: Option<u32>,
    case: Option<(String, [u32; 2])>,
}

impl Together {
    fn of(record: &Record) -> Self {
        let case = record.block.is_none().then(|| (record.scene.clone(), record.image_size));
        Self { device: record.device.clone(), block: record.block, case }
    }
}

impl Offered {
    fn add(&mut self, attempt: usize, record: Record) {
        self.0.entry(record.key.clone()).or_default().push((attempt, record));
    }

    /// For each point, chooses one of the records that the attempts offer.
    fn chosen(self) -> Chosen {
        let shares = self.shares();
        let mut chosen = Chosen::default();
        for (key, records) in self.0 {
            if records.len() > 1 {
                let outcomes = records.iter().map(|(attempt, record)| (*attempt, record.outcome));
                chosen.several.insert(key.clone(), outcomes.collect());
            }
            let order = |(attempt, record): &Measured| {
                let share = shares.get(&(*attempt, Together::of(record))).copied();
                (record.rank(), Reverse(share.unwrap_or_default()))
            };
            // If several records are equally good, `min_by_key` returns the first of these records: the record of the
            // first attempt.
            chosen.best.extend(records.into_iter().min_by_key(order).map(|best| (key, best)));
        }
        chosen
    }

    /// Returns two numbers for each attempt and each set of points that the attempt measured together. The
    /// first of the two numbers counts those points of the set for which no other attempt has a better record
    /// (a record with a lower rank). The second of the two numbers is the number of samples in the attempt's records of
    /// the points that the first number counts.
    fn shares(&self) -> HashMap<(usize, Together), (usize, usize)> {
        let mut shares: HashMap<_, (usize, usize)> = HashMap::new();
        for records in self.0.values() {
            let lowest = records.iter().map(|(_, record)| record.rank()).min();
            for (attempt, record) in records.iter().filter(|(_, one)| Some(one.rank()) == lowest) {
                let (points, samples) = shares.entry((*attempt, Together::of(record))).or_default();
                *points += 1;
                *samples += record.samples_ms.len();
            }
        }
        shares
    }
}

impl Chosen {
    /// Returns the outcome of a point's chosen record; `None` if the point has no record.
    pub fn outcome(&self, key: &str) -> Option<Outcome> {
        self.best.get(key).map(|(_, record)| record.outcome)
    }

    /// Returns the chosen records of the points with these keys, in the order of the keys. Keys of points without a
    /// record are skipped.
    pub fn of_keys<'a>(mut self, keys: impl Iterator<Item = &'a str>) -> Vec<Measured> {
        keys.filter_map(|key| self.best.remove(key)).collect()
    }

    /// Returns an error if a point has a record, but no kind of device lists this point. `all` contains all kinds of
    /// device in the folder. The file of a kind of device may have been left out when the folders of several machines
    /// were copied together. Without this error, the merge would leave out the records of points of a kind of device
    /// whose file is missing.
    pub fn refuse_unlisted(&self, out: &Path, all: &[Kind], attempts: &[Attempt]) -> Result<()> {
        let points = all.iter().flat_map(|kind| &kind.points);
        let listed: HashSet<&str> = points.map(|point| point.planned.key.as_str()).collect();
        let others = self.best.iter().filter(|(key, _)| !listed.contains(key.as_str()));
        let mut names: Vec<&str> = others.map(|(_, (index, _))| attempts[*index].name.as_str()).collect();
        if names.is_empty() {
            return Ok(());
        }
        let records = counted(names.len(), "record");
        names.sort_unstable();
        names.dedup();
        let folder = out.join(FOLDER).display().to_string();
        let message = format!(
            "no file in {folder} lists the points of {records} of {} ({})",
            counted(names.len(), "attempt"),
            few(&names)
        );
        Err(Error::input(message).with_help(format!(
            "from each machine that measured these points, copy the files in {FOLDER}/ to {folder}. If these files are lost, start one of the shards of these attempts again, with the same version of raycl, and on a machine with the same kind of device. The shard then writes the lost list of the points of this kind of device again; results of earlier attempts are kept. To merge without these attempts, move their folders out of parts/"
        )))
    }

    /// Returns notes on points that have records of several attempts.
    pub fn notes(&self, attempts: &[Attempt]) -> Vec<String> {
        let mut notes = Vec::new();
        let names = new_names(self.best.values().map(|(_, record)| record));
        for (key, outcomes) in self.several.iter().filter(|(_, outcomes)| is_wrong_and_right(outcomes)) {
            let Some((_, record)) = self.best.get(key) else { continue };
            let texts: Vec<String> = outcomes
                .iter()
                .map(|(attempt, outcome)| format!("{} in {}", outcome.name(), attempts[*attempt].name))
                .collect();
            notes.push(format!(
                "Attempts disagree on {}: {}; the record with the wrong image is used, so that the error is not hidden.",
                point(record, &names),
                texts.join(", ")
            ));
        }
        if !self.several.is_empty() {
            let mut who: Vec<&str> = self
                .several
                .values()
                .flatten()
                .map(|(attempt, _)| attempts[*attempt].name.as_str())
                .collect();
            who.sort_unstable();
            who.dedup();
            let points = if self.several.len() == 1 {
                "1 point has".to_owned()
            } else {
                format!("{} points have", self.several.len())
            };
            notes.push(format!(
                "{points} records of several attempts ({}); one record per point is used.",
                few(&who)
            ));
        }
        notes
    }
}

/// Returns the name of a record's point, such as "naive 16x16 of teapot 800x500". If scenes with different contents
/// have the same name, `names` contains a new name for each of them, by the hash of its content.
fn point(record: &Record, names: &HashMap<String, String>) -> String {
    let by = |[across, down]: [u32; 2]| format!("{across}x{down}");
    let local_size = record.local_size.map_or(String::new(), |size| format!(" {}", by(size)));
    let scene = record.scene_hash.as_ref().and_then(|hash| names.get(hash)).unwrap_or(&record.scene);
    format!("{}{local_size} of {scene} {}", record.name, by(record.image_size))
}

fn is_wrong_and_right(outcomes: &[(usize, Outcome)]) -> bool {
    let wrong = |outcome: &Outcome| *outcome == Outcome::WrongImage;
    outcomes.iter().any(|(_, outcome)| wrong(outcome)) && !outcomes.iter().all(|(_, outcome)| wrong(outcome))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(outcome: Outcome, samples: usize) -> Record {
        Record { key: "k".into(), outcome, samples_ms: vec![1.0; samples], ..Record::default() }
    }

    #[test]
    fn a_wrong_image_beats_a_time_and_a_time_what_became_of_an_attempt() {
        use Outcome::{Crashed, Infeasible, LaunchFailed, Measured, OtherKind, TimedOut, WrongImage};
        let table = [
            (vec![(Measured, 30), (WrongImage, 0)], 1),
            (vec![(WrongImage, 0), (Measured, 30)], 0),
            (vec![(TimedOut, 0), (Measured, 10)], 1),
            (vec![(Measured, 10), (Crashed, 0)], 0),
            (vec![(LaunchFailed, 0), (Infeasible, 0)], 1),
            (vec![(Measured, 10), (Measured, 11), (Measured, 11)], 1),
            (vec![(Crashed, 0), (TimedOut, 0)], 0),
            (vec![(OtherKind, 0), (Crashed, 0)], 1),
        ];
        for (offered, expected) in table {
            let mut all = Offered::default();
            for (attempt, (outcome, samples)) in offered.iter().enumerate() {
                all.add(attempt, record(*outcome, *samples));
            }
            let records = all.chosen().of_keys(["k", "absent"].into_iter());
            assert_eq!((records.len(), records[0].0), (1, expected), "{offered:?}");
        }
    }

    #[test]
    fn a_lack_of_memory_at_one_moment_or_in_one_session_hides_no_failure_of_another_attempt() {
        let host = "the host's memory (casting): 2 B > 1 B according to a test";
        for reason in [host, "global memory: 2 B > 1 B"] {
            let lacking = Record { reason: Some(reason.to_owned()), ..record(Outcome::Infeasible, 0) };
            let others = [Outcome::Crashed, Outcome::Infeasible, Outcome::OtherKind];
            for (other, expected) in others.into_iter().zip([1, 1, 0]) {
                let mut all = Offered::default();
                all.add(0, lacking.clone());
                all.add(1, record(other, 0));
                let chosen = all.chosen().of_keys(["k"].into_iter())[0].0;
                assert_eq!(chosen, expected, "{reason}, {other:?}");
            }
        }
    }

    /// Returns the attempts whose records of the points "a", "b", ... are chosen. For each attempt, `offered` lists
    /// the attempt's records in the order of the points. Each record is given by its outcome and its number of
    /// samples.
    fn attempts_of(offered: &[&[(Outcome, usize)]], change: impl Fn(&str, Record) -> Record) -> Vec<usize> {
        let keys = ["a", "b", "c"];
        let mut all = Offered::default();
        for (attempt, records) in offered.iter().enumerate() {
            for (key, (outcome, samples)) in keys.into_iter().zip(*records) {
                let record = Record { key: key.into(), ..record(*outcome, *samples) };
                all.add(attempt, change(key, record));
            }
        }
        all.chosen().of_keys(keys.into_iter()).iter().map(|(attempt, _)| *attempt).collect()
    }

    #[test]
    fn all_points_of_a_block_are_of_one_attempt_if_it_measured_all_of_them() {
        use Outcome::{Crashed, Measured};
        let block = |_: &str, record| Record { block: Some(1), ..record };
        let apart = |key: &str, record| Record { block: Some(u32::from(key == "a")), ..record };
        let unequal: [&[(Outcome, usize)]; 2] =
            [&[(Measured, 40), (Measured, 39)], &[(Measured, 38), (Measured, 40)]];
        assert_eq!(attempts_of(&unequal, block), [0, 0]);
        assert_eq!(attempts_of(&unequal, |_, record| record), [0, 0], "records of a case without blocks");
        assert_eq!(attempts_of(&unequal, apart), [0, 1]);
        let scenes = |key: &str, record| Record { block: Some(1), scene: key.into(), ..record };
        assert_eq!(attempts_of(&unequal, scenes), [0, 0], "a block of several scenes");
        // For the choice of the preferred attempt, an attempt's record of a point counts unless the other
        // attempt's record of this point has a better outcome. In the first case, `lacking`, all three
        // records of the second attempt count, but only two records of the first attempt. The second attempt
        // is preferred, although the first one has more samples. In the second case, `both`, two records of
        // each attempt count, so the first attempt, which has more samples, is preferred. Only the point that
        // the first attempt did not measure is taken from the second attempt.
        let lacking: [&[(Outcome, usize)]; 2] =
            [&[(Measured, 90), (Crashed, 0), (Crashed, 0)], &[(Measured, 30), (Measured, 30), (Crashed, 0)]];
        assert_eq!(attempts_of(&lacking, block), [1, 1, 1]);
        let both: [&[(Outcome, usize)]; 2] = [
            &[(Measured, 30), (Crashed, 0), (Measured, 40)],
            &[(Measured, 35), (Measured, 30), (Crashed, 0)],
        ];
        assert_eq!(attempts_of(&both, block), [0, 1, 0]);
    }

    #[test]
    fn records_of_points_that_no_kind_lists_are_refused() {
        use crate::record::PlannedPoint;
        use crate::shard::KindPoint;
        let attempt = |name: &str| Attempt { folder: "x".into(), name: name.into() };
        let kind = |key: &str| {
            let planned = PlannedPoint { key: key.into(), ..PlannedPoint::default() };
            Kind { points: vec![KindPoint { point: 0, planned }], ..Kind::default() }
        };
        let mut offered = Offered::default();
        for (attempt, key) in [(0, "a"), (1, "b"), (1, "c")] {
            offered.add(attempt, Record { key: key.into(), ..record(Outcome::Measured, 5) });
        }
        let (chosen, attempts) = (offered.chosen(), [attempt("one"), attempt("two")]);
        let refused = |kinds: &[Kind]| chosen.refuse_unlisted(Path::new("out"), kinds, &attempts);
        assert!(refused(&["a", "b", "c"].map(kind)).is_ok());
        let error = refused(&[kind("a")]).unwrap_err();
        let expected = "no file in out/kinds lists the points of 2 records of 1 attempt (two)";
        assert_eq!((error.exit_code(), error.to_string().as_str()), (2, expected));
        let error = refused(&[]).unwrap_err();
        assert!(error.to_string().ends_with("3 records of 2 attempts (one, two)"), "{error}");
    }

    #[test]
    fn both_attempts_are_named_where_one_saw_a_wrong_image() {
        let attempt = |name: &str| Attempt { folder: "x".into(), name: name.into() };
        let mut offered = Offered::default();
        offered.add(0, record(Outcome::Measured, 5));
        offered.add(1, record(Outcome::WrongImage, 0));
        let notes = offered.chosen().notes(&[attempt("one"), attempt("two")]);
        assert!(notes[0].contains("measured in one, wrong-image in two"), "{notes:?}");
        assert!(notes[1].starts_with("1 point has records of several attempts (one, two)"), "{notes:?}");
    }

    #[test]
    fn a_point_on_which_attempts_disagree_has_its_sizes_and_the_name_of_its_scene_alone() {
        let attempt = |name: &str| Attempt { folder: "x".into(), name: name.into() };
        let of = |folder: &str, outcome, local_size| Record {
            key: folder.into(),
            name: "naive".into(),
            scene: "tri".into(),
            scene_file: Some(format!("{folder}/tri.toml")),
            scene_hash: Some(folder.into()),
            image_size: [40, 24],
            local_size,
            ..record(outcome, 5)
        };
        let mut offered = Offered::default();
        for (attempt, outcome) in [(0, Outcome::Measured), (1, Outcome::WrongImage)] {
            offered.add(attempt, of("a", outcome, Some([4, 2])));
            offered.add(attempt, of("b", outcome, None));
        }
        let notes = offered.chosen().notes(&["one", "two"].map(attempt));
        assert!(
            notes[0].starts_with("Attempts disagree on naive 4x2 of a/tri 40x24: measured in one"),
            "{notes:?}"
        );
        assert!(
            notes[1].starts_with("Attempts disagree on naive of b/tri 40x24: measured in one"),
            "{notes:?}"
        );
    }

    #[test]
    fn points_of_several_attempts_are_counted_and_only_contradictions_are_named() {
        let attempt = |name: &str| Attempt { folder: "x".into(), name: name.into() };
        let of = |key: &str, outcome| Record { key: key.into(), ..record(outcome, 5) };
        let mut offered = Offered::default();
        for (attempt, key) in [(2, "a"), (0, "a"), (0, "b"), (1, "b"), (1, "c")] {
            offered.add(attempt, of(key, Outcome::Measured));
        }
        let chosen = offered.chosen();
        let notes = chosen.notes(&["one", "two", "three"].map(attempt));
        assert_eq!(
            notes,
            ["2 points have records of several attempts (one, three, two); one record per point is used."]
        );
        assert_eq!([chosen.outcome("c"), chosen.outcome("d")].map(|known| known.is_some()), [true, false]);
        assert!(Chosen::default().notes(&[]).is_empty());
    }
}
