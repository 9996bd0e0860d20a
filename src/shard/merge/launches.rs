//! Renumbers launches (of worker processes), since each attempt numbers its own launches from 0. An attempt
//! may have copied the results of a launch from an earlier attempt at its shard. The copied launch gets the
//! same new number as the original launch.

use super::Measured;
use super::origins::{Launch, Origins};
use crate::record::Record;
use std::collections::{BTreeMap, BTreeSet, HashSet};

/// The number, in the merged folder, of each launch (of worker processes) that a record uses.
#[derive(Clone, Debug, Default)]
pub struct Launches {
    origins: Origins,
    /// The number of each launch in the merged folder. If a launch was copied to the folder of a later
    /// attempt, `numbers` contains only the original launch.
    numbers: BTreeMap<Launch, u32>,
}

impl Launches {
    /// Numbers the launches (of worker processes) that these records use. The new numbers of the launches
    /// start at 0 and follow the order of the attempts.
    pub fn of<'a>(origins: Origins, records: impl Iterator<Item = &'a Measured>) -> Self {
        let used = |(attempt, record): &Measured| origins.of_record(*attempt, record);
        let all: BTreeSet<Launch> = records.flat_map(used).collect();
        Self { numbers: all.into_iter().zip(0..).collect(), origins }
    }

    /// Returns which attempts measured the launches, and which launches are copies.
    pub fn origins(&self) -> &Origins {
        &self.origins
    }

    /// Returns the new number of a launch (of worker processes); `None` if no record uses the launch.
    pub fn number(&self, attempt: usize, launch: u32) -> Option<u32> {
        self.numbers.get(&self.origins.of((attempt, launch))).copied()
    }

    /// Renumbers the launches (of worker processes) in which a record's samples were measured, and sets the
    /// record's `host` to the machines that measured the samples.
    pub fn renumber(&self, attempt: usize, record: &mut Record) {
        if let Some(host) = self.origins.host(attempt, record) {
            record.host = Some(host);
        }
        for launch in &mut record.sample_launches {
            *launch = self.number(attempt, *launch).unwrap_or(*launch);
        }
    }

    /// Identifies the samples that the records use. Each returned pair consists of a launch (of worker processes) and
    /// the key of a point whose samples were measured in this launch.
    pub fn counted<'a>(&self, records: &'a [Measured]) -> HashSet<(Launch, &'a str)> {
        let mut counted = HashSet::new();
        for (attempt, record) in records {
            let launches = self.origins.of_record(*attempt, record);
            counted.extend(launches.into_iter().map(|launch| (launch, record.key.as_str())));
        }
        counted
    }
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
        let launches = Launches::of(Origins::default(), records.iter());
        let counted = launches.counted(&records);
        assert!(counted.contains(&((3, 2), "k")) && !counted.contains(&((3, 0), "k")));
        records.iter_mut().for_each(|(attempt, record)| launches.renumber(*attempt, record));
        let actual: Vec<_> = records.iter().map(|(_, record)| record.sample_launches.clone()).collect();
        assert_eq!(actual, [vec![0, 0, 1], vec![2, 3], vec![1]]);
        assert_eq!(launches.number(0, 0), None);
    }
}
