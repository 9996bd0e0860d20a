//! What records say when they are put side by side: groups, winners, speed-ups.

use super::types::{Outcome, Record};
use crate::measure::winners;
use crate::strategy::PRESETS;

/// Records that are compared: those of one scene, image size and device.
#[derive(Clone, Debug)]
pub struct Group<'a> {
    /// The scene's name.
    pub scene: &'a str,
    /// Pixels across and down.
    pub image_size: [u32; 2],
    /// The device's name, or "host".
    pub device: &'a str,
    /// Presets in their order, then other strategies by name; each by local size.
    pub records: Vec<&'a Record>,
}

/// The groups in order of first appearance. Where a key comes twice, the later record counts.
pub fn groups(records: &[Record]) -> Vec<Group<'_>> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    for record in records {
        let (scene, image_size, device) = (record.scene.as_str(), record.image_size, record.device.as_str());
        let same = |group: &&mut Group<'_>| {
            (group.scene, group.image_size, group.device) == (scene, image_size, device)
        };
        match groups.iter_mut().find(same) {
            Some(group) => {
                group.records.retain(|other| other.key != record.key);
                group.records.push(record);
            }
            None => groups.push(Group { scene, image_size, device, records: vec![record] }),
        }
    }
    for group in &mut groups {
        group.records.sort_by_key(|record| place(record));
    }
    groups
}

/// What was said of reading each scene, a scene's name and a note at a time, each once.
pub fn scene_notes(records: &[Record]) -> Vec<(&str, &str)> {
    let mut notes: Vec<(&str, &str)> = Vec::new();
    for record in records {
        for note in &record.scene_notes {
            let note = (record.scene.as_str(), note.as_str());
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
    }
    notes
}

/// Where a record stands in a table.
fn place(record: &Record) -> (usize, &str, Option<u32>, Option<[u32; 2]>) {
    let preset = PRESETS.iter().position(|preset| preset.name == record.name).unwrap_or(PRESETS.len());
    (preset, &record.name, record.local_size.map(|[across, down]| across * down), record.local_size)
}

impl<'a> Group<'a> {
    /// Measured records, fastest first.
    pub fn ranked(&self) -> Vec<&'a Record> {
        let mut ranked: Vec<_> = self.records.iter().copied().filter(|one| median(one).is_some()).collect();
        ranked.sort_by(|one, other| {
            median(one).unwrap_or(f64::MAX).total_cmp(&median(other).unwrap_or(f64::MAX))
        });
        ranked
    }

    /// The fastest record and all whose 95% intervals overlap its own, fastest first.
    pub fn winners(&self) -> Vec<&'a Record> {
        let ranked = self.ranked();
        let intervals: Vec<_> = ranked.iter().filter_map(|record| interval(record)).collect();
        winners(&intervals).into_iter().map(|place| ranked[place]).collect()
    }

    /// The fastest measured record of those that `wanted` picks.
    pub fn best_where(&self, wanted: impl Fn(&Record) -> bool) -> Option<&'a Record> {
        self.ranked().into_iter().find(|record| wanted(record))
    }

    /// Records without a time, with why.
    pub fn failures(&self) -> Vec<(&'a Record, &'a str)> {
        let failed = self.records.iter().filter(|record| median(record).is_none());
        failed.map(|record| (*record, record.reason.as_deref().unwrap_or("no reason was recorded"))).collect()
    }
}

/// The median of a measured record.
pub fn median(record: &Record) -> Option<f64> {
    record.median_ms.filter(|_| record.outcome == Outcome::Measured)
}

/// The 95% interval; a record without one has the median alone.
pub(crate) fn interval(record: &Record) -> Option<[f64; 2]> {
    record.ci95_ms.or(record.median_ms.map(|median| [median; 2]))
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// A measured record for tests.
    pub fn measured(device: &str, name: &str, side: u32, ci95_ms: [f64; 2]) -> Record {
        let median = (ci95_ms[0] + ci95_ms[1]) / 2.0;
        let preset = PRESETS.iter().find(|preset| preset.name == name).map(|preset| preset.name.to_string());
        Record {
            key: format!("{device} {name} {side}"),
            scene: "teapot".into(),
            device: device.into(),
            name: name.into(),
            preset,
            strategy: name.into(),
            local_size: (device != "host").then_some([side, side]),
            image_size: [800, 500],
            outcome: Outcome::Measured,
            median_ms: Some(median),
            q1_ms: Some(ci95_ms[0]),
            q3_ms: Some(ci95_ms[1]),
            ci95_ms: Some(ci95_ms),
            samples_ms: vec![median; 10],
            rays_per_s: Some(4e8 / median),
            tests_per_s: Some(4e11 / median),
            ..Record::default()
        }
    }

    /// An infeasible record for tests.
    pub fn infeasible(device: &str, name: &str, side: u32, reason: &str) -> Record {
        Record {
            outcome: Outcome::Infeasible,
            reason: Some(reason.into()),
            median_ms: None,
            ci95_ms: None,
            samples_ms: Vec::new(),
            rays_per_s: None,
            tests_per_s: None,
            ..measured(device, name, side, [1.0, 1.0])
        }
    }

    #[test]
    fn winners_overlap_the_best_interval_and_not_each_other_in_a_chain() {
        let records = [
            measured("gpu", "naive", 8, [10.0, 12.0]),
            measured("gpu", "private", 8, [11.5, 14.0]),
            measured("gpu", "deferred", 8, [13.0, 15.0]),
        ];
        let groups = groups(&records);
        let names: Vec<_> = groups[0].winners().iter().map(|record| record.name.as_str()).collect();
        assert_eq!(names, ["naive", "private"]);
    }

    #[test]
    fn a_wrong_image_never_wins_and_a_later_record_replaces_an_earlier() {
        let mut wrong = measured("gpu", "wide", 1, [0.1, 0.2]);
        wrong.outcome = Outcome::WrongImage;
        let records =
            [measured("gpu", "naive", 8, [10.0, 12.0]), wrong, measured("gpu", "naive", 8, [20.0, 22.0])];
        let groups = groups(&records);
        assert_eq!(groups[0].records.len(), 2);
        assert_eq!(groups[0].winners()[0].median_ms, Some(21.0));
        assert_eq!(groups[0].failures().len(), 1);
    }

    #[test]
    fn records_stand_in_the_order_of_presets_and_sizes() {
        let records = [
            measured("gpu", "wide", 1, [1.0, 1.0]),
            measured("gpu", "naive", 16, [1.0, 1.0]),
            measured("gpu", "naive", 2, [1.0, 1.0]),
        ];
        let groups = groups(&records);
        let keys: Vec<_> = groups[0].records.iter().map(|record| record.key.as_str()).collect();
        assert_eq!(keys, ["gpu naive 2", "gpu naive 16", "gpu wide 1"]);
    }
}
