//! Renumbers launches (of worker processes), since each attempt numbers its own launches from 0.

use super::Measured;
use crate::record::Record;
use std::collections::{BTreeMap, BTreeSet, HashSet};

/// The new number of each launch (of worker processes) that a record uses, by the attempt's index and the launch's
/// number in that attempt.
#[derive(Clone, Debug, Default)]
pub struct Launches(BTreeMap<(usize, u32), u32>);

impl Launches {
    /// Numbers the launches (of worker processes) that these records use. Numbers start at 0 and follow the order of
    /// the attempts.
    pub fn of<'a>(records: impl Iterator<Item = &'a Measured>) -> Self {
        let used = |(attempt, record): &Measured| {
            let attempt = *attempt;
            record.sample_launches.clone().into_iter().map(move |launch| (attempt, launch))
        };
        let all: BTreeSet<(usize, u32)> = records.flat_map(used).collect();
        Self(all.into_iter().zip(0..).collect())
    }

    /// Returns the new number of a launch (of worker processes); `None` if no record uses the launch.
    pub fn number(&self, attempt: usize, launch: u32) -> Option<u32> {
        self.0.get(&(attempt, launch)).copied()
    }

    /// Renumbers the launches (of worker processes) in which a record's samples were measured.
    pub fn renumber(&self, attempt: usize, record: &mut Record) {
        for launch in &mut record.sample_launches {
            *launch = self.number(attempt, *launch).unwrap_or(*launch);
        }
    }
}

/// Returns the samples that records use. A sample is identified by the attempt's index, the number of the launch (of
/// worker processes) in that attempt, and the point's key.
pub fn counted(records: &[Measured]) -> HashSet<(usize, u32, &str)> {
    let of = |(attempt, record): &'_ Measured| (*attempt, record.sample_launches.clone());
    let mut counted = HashSet::new();
    for measured in records {
        let (attempt, launches) = of(measured);
        counted.extend(launches.into_iter().map(|launch| (attempt, launch, measured.1.key.as_str())));
    }
    counted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn launches_of_two_attempts_never_share_a_number() {
        let record = |launches: &[u32]| Record {
            key: "k".into(),
            sample_launches: launches.to_vec(),
            ..Record::default()
        };
        let mut records = [(0, record(&[1, 1, 2])), (3, record(&[1, 2])), (0, record(&[2]))];
        let launches = Launches::of(records.iter());
        assert!(counted(&records).contains(&(3, 2, "k")) && !counted(&records).contains(&(3, 0, "k")));
        records.iter_mut().for_each(|(attempt, record)| launches.renumber(*attempt, record));
        let found: Vec<_> = records.iter().map(|(_, record)| record.sample_launches.clone()).collect();
        assert_eq!(found, [vec![0, 0, 1], vec![2, 3], vec![1]]);
        assert_eq!(launches.number(0, 0), None);
    }
}
