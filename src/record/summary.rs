//! Divides records into groups and finds the winners of each group.

use super::point_times::{fewest, interval, is_below_resolution, median};
use super::ranking::ranking;
use super::types::{HOST, Record};
use crate::measure::{BELOW_RESOLUTION, Ranking, not_enough as not_enough_samples};
use crate::strategy::PRESETS;
use crate::words;
use std::collections::HashMap;

/// Records that are compared with each other: they have the same scene, image size and device.
#[derive(Clone, Debug)]
pub struct Group<'a> {
    /// The scene's name.
    pub scene: &'a str,
    /// Image size in pixels: across, down.
    pub image_size: [u32; 2],
    /// The device's name, or "host".
    pub device: &'a str,
    /// The group's records, sorted by strategy and then by local size. Presets come first, in the order of
    /// `PRESETS`. Strategies that are not presets follow, sorted by name, with numbers in names in numerical
    /// order.
    pub records: Vec<&'a Record>,
}

/// Divides records into groups, in the order in which the groups first occur. In a group, the records are sorted by
/// preset, name and local size. If a group has two records with the same key, only the later record is used.
pub fn groups<'a>(records: &'a [Record]) -> Vec<Group<'a>> {
    let named = |record: &'a Record| (record.scene.as_str(), record.image_size, record.device.as_str());
    let identity = |record: &'a Record| (named(record), record.key.as_str());
    // If several records have the same scene, image size, device and key, the map contains the last of these
    // records.
    let last: HashMap<_, &Record> = records.iter().map(|record| (identity(record), record)).collect();
    let mut indices: HashMap<_, usize> = HashMap::new();
    let mut groups: Vec<Group<'a>> = Vec::new();
    for record in records {
        let index = *indices.entry(named(record)).or_insert(groups.len());
        if index == groups.len() {
            let (scene, image_size, device) = named(record);
            groups.push(Group { scene, image_size, device, records: Vec::new() });
        }
        if std::ptr::eq(last[&identity(record)], record) {
            groups[index].records.push(record);
        }
    }
    for group in &mut groups {
        group.records.sort_by_cached_key(|record| sort_key(record));
    }
    groups
}

/// Returns the notes that records contain on the files of scenes, as pairs of a scene's name and a note,
/// without repetitions.
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

/// The parts of a strategy's name ([`parts`]), and the whole name.
type NameKey<'a> = (Vec<(&'a str, u64)>, &'a str);

/// Returns the key by which the records of a group are sorted: the position of the preset in `PRESETS`, the
/// strategy's name, the number of work-items per work-group, and the local size.
fn sort_key(record: &Record) -> (usize, NameKey<'_>, Option<u32>, Option<[u32; 2]>) {
    let preset = PRESETS.iter().position(|preset| preset.name == record.name).unwrap_or(PRESETS.len());
    let work_items = record.local_size.map(|[across, down]| across * down);
    (preset, (parts(&record.name), record.name.as_str()), work_items, record.local_size)
}

/// Splits a name into parts, each a text and the number that follows the text (0 if no number follows). Names
/// are sorted by their parts, so that "width=2" comes before "width=16".
fn parts(name: &str) -> Vec<(&str, u64)> {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let (text, after) = rest.split_at(rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len()));
        let end = after.find(|c: char| !c.is_ascii_digit()).unwrap_or(after.len());
        let (digits, after) = after.split_at(end);
        parts.push((text, if digits.is_empty() { 0 } else { digits.parse().unwrap_or(u64::MAX) }));
        rest = after;
    }
    parts
}

impl<'a> Group<'a> {
    /// Ranks the measured records of the group. Records with too few samples, or with times of 0, are in
    /// [`Ranking::unranked`].
    pub fn ranking(&self) -> Ranking<&'a Record> {
        ranking(self.records.iter().copied())
    }

    /// Returns the fastest of the ranked records for which `wanted` is true. If there is no such record, returns
    /// the record with the shortest median time among the unranked records for which `wanted` is true.
    pub fn best_where(&self, wanted: impl Fn(&Record) -> bool) -> Option<&'a Record> {
        let Ranking { ranked, unranked, .. } = self.ranking();
        let shortest = || {
            let matching = unranked.into_iter().filter(|record| wanted(record));
            matching
                .filter_map(|record| Some((record, median(record)?)))
                .min_by(|(_, a), (_, b)| a.total_cmp(b))
        };
        let best = ranked.into_iter().find(|record| wanted(record));
        best.or_else(|| shortest().map(|(record, _)| record))
    }

    /// Returns the fastest record with the preset `naive`, as [`Self::best_where`] finds it; `None` if no record with
    /// this preset has a time.
    pub fn naive(&self) -> Option<&'a Record> {
        self.best_where(Record::is_naive)
    }

    /// Returns the number of samples per pixel, which is the same for all records of a scene.
    pub fn samples(&self) -> u32 {
        self.records.first().and_then(|record| record.samples_per_pixel).unwrap_or(1)
    }

    /// Returns the baselines of the group among `groups`: the host's records with a time for the same scene and image
    /// size.
    pub fn baselines(&self, groups: &[Self]) -> Vec<&'a Record> {
        let is_host = |other: &&Self| {
            other.device == HOST && other.scene == self.scene && other.image_size == self.image_size
        };
        groups.iter().find(is_host).map(|host| host.ranking().all()).unwrap_or_default()
    }

    /// Returns the group's records without a time, each with the reason or, if a record states none, a text that says
    /// so.
    pub fn failures(&self) -> Vec<(&'a Record, &'a str)> {
        let failed = self.records.iter().filter(|record| median(record).is_none());
        failed.map(|record| (*record, record.reason.as_deref().unwrap_or("no reason was recorded"))).collect()
    }
}

/// Returns the first and third quartile of a record's samples in milliseconds; `None` for a record with too
/// few samples, or with times of 0.
pub(crate) fn quartiles(record: &Record) -> Option<[f64; 2]> {
    interval(record)?;
    Some([record.q1_ms?, record.q3_ms?])
}

/// Returns a text such as "not enough samples (n = 3)" for a measured record with too few samples in a launch, or
/// [`BELOW_RESOLUTION`] for a record with times of 0; `None` for all other records.
pub(crate) fn not_enough(record: &Record) -> Option<String> {
    median(record)?;
    record.relative_times.is_none().then(|| match is_below_resolution(record) {
        true => BELOW_RESOLUTION.to_owned(),
        false => not_enough_samples(fewest(record)),
    })
}

/// Returns the first line of the reason why a record has no time, or a text that says that the record states no reason.
pub(crate) fn first_line(record: &Record) -> &str {
    let reason = record.reason.as_deref().unwrap_or("no reason was recorded");
    reason.lines().next().unwrap_or_default()
}

/// Returns a short text that says why a measured record has no rank: "n = 3" if the launch with the fewest
/// samples has 3 samples, or [`BELOW_RESOLUTION`] if times are 0.
pub(crate) fn why_unranked(record: &Record) -> String {
    match is_below_resolution(record) {
        true => BELOW_RESOLUTION.to_owned(),
        false => format!("n = {}", fewest(record)),
    }
}

/// Returns the names of up to four unranked points, and the number of further unranked points:
/// "naive at 8 x 8 (n = 3), ... and 9 more".
pub(crate) fn few_names(records: &[&Record], title: impl Fn(&Record) -> String) -> String {
    let name = |record: &&Record| format!("{} ({})", title(record), why_unranked(record));
    words::few(&records.iter().map(name).collect::<Vec<_>>())
}

#[cfg(test)]
pub mod tests {
    use super::super::outcome::Outcome;
    use super::super::together::judge;
    use super::*;

    /// Returns a measured record for tests: ten equal samples, five in each of two launches.
    pub fn measured(device: &str, name: &str, side: u32, median: f64) -> Record {
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
            q1_ms: Some(0.99 * median),
            q3_ms: Some(1.01 * median),
            samples_ms: vec![median; 10],
            sample_launches: [[0; 5], [1; 5]].concat(),
            samples_at_ms: (0..10).map(f64::from).collect(),
            rays_per_s: Some(4e8 / median),
            tests_per_s: Some(4e11 / median),
            ..Record::default()
        }
    }

    /// Returns, for tests, a record of a point that could not be measured (outcome "infeasible").
    pub fn infeasible(device: &str, name: &str, side: u32, reason: &str) -> Record {
        Record {
            outcome: Outcome::Infeasible,
            reason: Some(reason.into()),
            median_ms: None,
            samples_ms: Vec::new(),
            sample_launches: Vec::new(),
            rays_per_s: None,
            tests_per_s: None,
            ..measured(device, name, side, 1.0)
        }
    }

    /// Returns the record, changed to the axes of an exhaustive strategy whose working vectors are in the
    /// memory `vectors`.
    pub fn in_memory(record: Record, vectors: &str) -> Record {
        Record { strategy: format!("traversal=exhaustive vectors={vectors}"), ..record }
    }

    /// Returns a measured record with `n` samples in one launch.
    pub fn few(device: &str, name: &str, side: u32, ms: f64, n: usize) -> Record {
        Record { samples_ms: vec![ms; n], sample_launches: vec![0; n], ..measured(device, name, side, ms) }
    }

    /// Returns a measured record with the given samples. A sample is given as a launch's number and a time in
    /// milliseconds.
    pub fn sampled(name: &str, samples: impl Iterator<Item = (u32, f64)> + Clone) -> Record {
        let times: Vec<f64> = samples.clone().map(|(_, ms)| ms).collect();
        let middle = crate::measure::median_of(&times).expect("samples");
        Record {
            sample_launches: samples.map(|(launch, _)| launch).collect(),
            samples_at_ms: (0..times.len()).map(|index| index as f64).collect(),
            samples_ms: times,
            ..measured("gpu", name, 8, middle)
        }
    }

    /// Returns the records with their relative times, which raycl computes when it reads a folder.
    pub fn judged(records: impl Into<Vec<Record>>) -> Vec<Record> {
        let mut records = records.into();
        judge(&mut records);
        records
    }

    #[test]
    fn four_samples_have_no_interval_and_five_do() {
        let of = |n| judged([few("gpu", "naive", 8, 1798.0, n)]).remove(0);
        assert_eq!((interval(&of(4)), quartiles(&of(4))), (None, None));
        assert!(interval(&of(5)).is_some() && quartiles(&of(5)).is_some());
        assert_eq!(not_enough(&of(1)).as_deref(), Some("not enough samples (n = 1)"));
        assert_eq!(not_enough(&infeasible("gpu", "naive", 8, "no")), None);
    }

    #[test]
    fn times_of_zero_are_below_the_timers_resolution_and_not_too_few() {
        let zero = few("gpu", "naive", 8, 0.0, 30);
        let step = |index: u32| (index / 10, if index % 10 < 3 { 0.001 } else { 0.0 });
        let sometimes = Record { key: "sometimes".into(), ..sampled("naive", (0..30).map(step)) };
        let records =
            judged([zero, sometimes, few("gpu", "wide", 1, 0.0, 3), measured("gpu", "wide", 2, 1.0)]);
        let reason = "times below the timer's resolution";
        assert_eq!(
            [0, 1].map(|index| not_enough(&records[index])),
            [Some(reason.to_owned()), Some(reason.to_owned())]
        );
        assert_eq!(not_enough(&records[2]).as_deref(), Some("not enough samples (n = 0)"));
        assert!(records[..3].iter().all(|record| record.relative_times.is_none()));
        assert!(records[3].relative_times.is_some());
        assert_eq!(few_names(&[&records[0]], |_| "naive".into()), format!("naive ({reason})"));
    }

    /// The record of this test has enough samples above 0 for an interval, but the median of all samples
    /// is 0.
    #[test]
    fn a_median_of_zero_has_no_rank() {
        let step = |index: u32| (index / 15, if index % 15 < 6 { 0.001 } else { 0.0 });
        let records = judged([sampled("naive", (0..30).map(step)), measured("gpu", "wide", 1, 1.0)]);
        assert!(records[0].relative_times.is_none() && is_below_resolution(&records[0]));
        assert_eq!(ranking(&records).ranked.len(), 1);
    }

    #[test]
    fn too_few_samples_are_those_of_the_launch_that_has_the_fewest() {
        let uneven = sampled("wide", (0..15).map(|index| (u32::from(index >= 12), 5.0)));
        let records = judged([measured("gpu", "naive", 8, 10.0), uneven]);
        assert_eq!(not_enough(&records[0]), None);
        assert_eq!(not_enough(&records[1]).as_deref(), Some("not enough samples (n = 3)"));
    }

    #[test]
    fn the_best_of_some_has_few_samples_only_where_all_have() {
        let records = judged([
            few("gpu", "naive", 4, 1.0, 1),
            measured("gpu", "naive", 8, 2.05),
            few("gpu", "wide", 1, 0.3, 2),
            few("gpu", "wide", 4, 0.1, 2),
        ]);
        let groups = groups(&records);
        let best = |name: &str| groups[0].best_where(|record| record.name == name).and_then(median);
        assert_eq!((best("naive"), best("wide")), (Some(2.05), Some(0.1)));
        assert_eq!(groups[0].ranking().winners.len(), 1);
    }

    #[test]
    fn a_wrong_image_never_wins_and_a_later_record_replaces_an_earlier() {
        let mut wrong = measured("gpu", "wide", 1, 0.1);
        wrong.outcome = Outcome::WrongImage;
        let records = judged([measured("gpu", "naive", 8, 11.0), wrong, measured("gpu", "naive", 8, 21.0)]);
        let groups = groups(&records);
        assert_eq!(groups[0].records.len(), 2);
        assert_eq!(groups[0].ranking().winners[0].median_ms, Some(21.0));
        assert_eq!(groups[0].failures().len(), 1);
    }

    #[test]
    fn records_stand_in_the_order_of_presets_and_sizes() {
        let records = [
            measured("gpu", "a-kernel-of-one's-own", 1, 1.0),
            measured("gpu", "wide", 1, 1.0),
            measured("gpu", "naive", 16, 1.0),
            Record {
                key: "gpu naive 128x1".into(),
                local_size: Some([128, 1]),
                ..measured("gpu", "naive", 8, 1.0)
            },
            measured("gpu", "naive", 2, 1.0),
        ];
        let groups = groups(&records);
        let keys: Vec<_> = groups[0].records.iter().map(|record| record.key.as_str()).collect();
        // 16 x 16 comes after 128 x 1, since it has more work-items.
        assert_eq!(
            keys,
            ["gpu naive 2", "gpu naive 128x1", "gpu naive 16", "gpu wide 1", "gpu a-kernel-of-one's-own 1"]
        );
    }

    #[test]
    fn numbers_in_the_names_of_strategies_are_in_numerical_order() {
        let sorted = [
            "deferred+width=1",
            "deferred+width=1+math=fast",
            "deferred+width=2",
            "deferred+width=16",
            "tile+leaf_size=8+width=4",
            "tile+leaf_size=32+width=2",
            "tile+leaf_size=99999999999999999999999",
        ];
        let mut names = sorted;
        names.sort_unstable();
        assert_ne!(names, sorted);
        let records = names.map(|name| measured("gpu", name, 8, 1.0));
        let groups = groups(&records);
        let names: Vec<_> = groups[0].records.iter().map(|record| record.name.as_str()).collect();
        assert_eq!(names, sorted);
    }

    #[test]
    fn images_of_two_sizes_are_two_groups() {
        let large = Record { image_size: [1600, 1000], ..measured("gpu", "wide", 1, 4.0) };
        assert_eq!(groups(&judged([measured("gpu", "wide", 1, 1.0), large])).len(), 2);
    }

    #[test]
    fn quartiles_are_the_first_and_the_third() {
        let records = judged([measured("gpu", "wide", 1, 100.0)]);
        assert_eq!(quartiles(&records[0]), Some([99.0, 101.0]));
    }

    #[test]
    fn at_most_four_unranked_points_are_named() {
        let records = [1, 2, 4, 8, 16].map(|side| few("gpu", "naive", side, 1.0, 3));
        let named = |count: usize| {
            let some: Vec<&Record> = records[..count].iter().collect();
            few_names(&some, |record| format!("{}", record.local_size.map_or(0, |[across, _]| across)))
        };
        assert_eq!(named(0), "");
        assert_eq!(named(4), "1 (n = 3), 2 (n = 3), 4 (n = 3), 8 (n = 3)");
        assert_eq!(named(5), "1 (n = 3), 2 (n = 3), 4 (n = 3), 8 (n = 3), and 1 more");
    }

    #[test]
    fn a_note_on_a_scene_is_given_once() {
        let with = |scene: &str, notes: &[&str]| Record {
            scene: scene.into(),
            scene_notes: notes.iter().map(|note| (*note).to_owned()).collect(),
            ..measured("gpu", "naive", 8, 1.0)
        };
        let records = [with("a", &["one", "two"]), with("a", &["two"]), with("b", &["two"])];
        assert_eq!(scene_notes(&records), [("a", "one"), ("a", "two"), ("b", "two")]);
    }

    #[test]
    fn local_sizes_are_sorted_by_their_products_and_then_by_their_width() {
        let at = |size: [u32; 2]| Record {
            local_size: Some(size),
            key: format!("{size:?}"),
            ..measured("gpu", "naive", 8, 1.0)
        };
        let records = [[4, 16], [16, 4], [2, 16], [32, 1], [16, 1]].map(at);
        let groups = groups(&records);
        let sizes: Vec<_> = groups[0].records.iter().filter_map(|record| record.local_size).collect();
        assert_eq!(sizes, [[16, 1], [2, 16], [32, 1], [4, 16], [16, 4]]);
    }
}
