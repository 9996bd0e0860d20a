//! Chooses one record of each point, if several attempts have a record of it.

use super::{Measured, lines};
use crate::error::Result;
use crate::record::journals::RECORDS;
use crate::record::{Outcome, Record};
use crate::shard::Attempt;
use std::collections::{BTreeMap, HashMap};

/// The chosen record of each point, and all outcomes of points with several records.
#[derive(Debug, Default)]
pub struct Chosen {
    /// For each point, by its key: the chosen record.
    best: HashMap<String, Measured>,
    /// For each point with several records, by its key: the index of each attempt that has a record, and the outcome
    /// of that record.
    several: BTreeMap<String, Vec<(usize, Outcome)>>,
}

/// Reads the attempts' records and chooses one record for each point. A record with a wrong image takes precedence over
/// all other records, and a record with a time takes precedence over a record without a time. Among records without a
/// time, `rank` orders the outcomes. Of records that are equal by these rules, the one with the most samples is chosen.
/// Of records that also have equally many samples, the one of the attempt whose name sorts first is chosen. Times of
/// day are never compared, since the clocks of two machines may differ. If an attempt has several records of a point,
/// its last record is used, as in any journal.
pub fn choose(attempts: &[Attempt]) -> Result<Chosen> {
    let mut chosen = Chosen::default();
    for (place, attempt) in attempts.iter().enumerate() {
        let mut own: HashMap<String, Record> = HashMap::new();
        for record in lines::<Record>(&attempt.folder.join(RECORDS))? {
            own.insert(record.key.clone(), record);
        }
        own.into_values().for_each(|record| chosen.offer(place, record));
    }
    Ok(chosen)
}

/// Returns a record's rank. The record with the lowest rank is chosen.
fn rank(record: &Record) -> (u8, usize) {
    let kind = match record.outcome {
        Outcome::WrongImage => 0,
        Outcome::Measured => 1,
        // A limit of the device holds for all attempts, whereas a failure may be due to a single attempt.
        Outcome::Infeasible | Outcome::BuildFailed => 2,
        Outcome::LaunchFailed | Outcome::TimedOut | Outcome::Crashed => 3,
        // The point was not tried; another attempt may have been asked to try it.
        Outcome::OtherKind => 4,
    };
    (kind, usize::MAX - record.samples_ms.len())
}

impl Chosen {
    /// Adds an attempt's record. Only a record of lower rank replaces the chosen record. Attempts are added in the
    /// order of their names, so that among records of equal rank, the first attempt's record is chosen.
    fn offer(&mut self, attempt: usize, record: Record) {
        let Some((known, held)) = self.best.get_mut(&record.key) else {
            self.best.insert(record.key.clone(), (attempt, record));
            return;
        };
        let several = self.several.entry(record.key.clone()).or_insert_with(|| vec![(*known, held.outcome)]);
        several.push((attempt, record.outcome));
        if rank(&record) < rank(held) {
            (*known, *held) = (attempt, record);
        }
    }

    /// Returns whether a point has a record.
    pub fn has(&self, key: &str) -> bool {
        self.best.contains_key(key)
    }

    /// Returns the chosen records of the points with these keys, in the order of the keys.
    pub fn of_keys<'a>(mut self, keys: impl Iterator<Item = &'a str>) -> Vec<Measured> {
        keys.filter_map(|key| self.best.remove(key)).collect()
    }

    /// Returns notes on points that several attempts measured.
    pub fn notes(&self, attempts: &[Attempt]) -> Vec<String> {
        let mut notes = Vec::new();
        for (key, found) in self.several.iter().filter(|(_, found)| is_wrong_and_right(found)) {
            let Some((_, record)) = self.best.get(key) else { continue };
            let told: Vec<String> = found
                .iter()
                .map(|(attempt, outcome)| format!("{} in {}", outcome.name(), attempts[*attempt].name))
                .collect();
            notes.push(format!(
                "Attempts disagree on {} of {}: {}; the record with the wrong image is used, so that the error is not hidden.",
                record.name,
                record.scene,
                told.join(", ")
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
                "1 point was".to_owned()
            } else {
                format!("{} points were", self.several.len())
            };
            notes.push(format!(
                "{points} measured by several attempts ({}); one record per point is used.",
                few(&who)
            ));
        }
        notes
    }
}

fn is_wrong_and_right(found: &[(usize, Outcome)]) -> bool {
    let wrong = |outcome: &Outcome| *outcome == Outcome::WrongImage;
    found.iter().any(|(_, outcome)| wrong(outcome)) && !found.iter().all(|(_, outcome)| wrong(outcome))
}

/// Joins names with commas. Of more than four names, only the first four are listed and the others are counted.
pub fn few(names: &[&str]) -> String {
    let more = names.len().checked_sub(4).filter(|more| *more > 0).map(|more| format!("and {more} more"));
    names.iter().take(4).map(|name| (*name).to_owned()).chain(more).collect::<Vec<_>>().join(", ")
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
            let mut chosen = Chosen::default();
            for (attempt, (outcome, samples)) in offered.iter().enumerate() {
                chosen.offer(attempt, record(*outcome, *samples));
            }
            let found = chosen.of_keys(["k", "absent"].into_iter());
            assert_eq!((found.len(), found[0].0), (1, expected), "{offered:?}");
        }
    }

    #[test]
    fn both_attempts_are_told_where_one_saw_a_wrong_image() {
        let attempt = |name: &str| Attempt { folder: "x".into(), name: name.into() };
        let mut chosen = Chosen::default();
        chosen.offer(0, record(Outcome::Measured, 5));
        chosen.offer(1, record(Outcome::WrongImage, 0));
        let notes = chosen.notes(&[attempt("one"), attempt("two")]);
        assert!(notes[0].contains("measured in one, wrong-image in two"), "{notes:?}");
        assert!(notes[1].starts_with("1 point was measured by several attempts (one, two)"), "{notes:?}");
    }

    #[test]
    fn points_of_several_attempts_are_counted_and_only_contradictions_are_named() {
        let attempt = |name: &str| Attempt { folder: "x".into(), name: name.into() };
        let of = |key: &str, outcome| Record { key: key.into(), ..record(outcome, 5) };
        let mut chosen = Chosen::default();
        for (attempt, key) in [(2, "a"), (0, "a"), (0, "b"), (1, "b"), (1, "c")] {
            chosen.offer(attempt, of(key, Outcome::Measured));
        }
        let notes = chosen.notes(&["one", "two", "three"].map(attempt));
        assert_eq!(
            notes,
            ["2 points were measured by several attempts (one, three, two); one record per point is used."]
        );
        assert_eq!([chosen.has("c"), chosen.has("d")], [true, false]);
        assert!(Chosen::default().notes(&[]).is_empty());
        let names = ["a", "b", "c", "d", "e"];
        assert_eq!([few(&names[..4]), few(&names)], ["a, b, c, d", "a, b, c, d, and 1 more"]);
    }
}
