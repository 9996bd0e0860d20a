//! Compares the machines of an experiment by the times of control points. If several machines measure blocks
//! (parts) of the same group of points, each machine measures one common point, the group's control point.

use super::point_times::{interval, median};
use super::ratios::ratio_apart;
use super::types::Record;
use crate::numbers::{by, duration, significant};
use std::collections::{BTreeMap, BTreeSet};

/// A control point (a point that every block of a group measures), and its time on each machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Control {
    /// A description such as "teapot, 800 x 500, NVIDIA H200, naive at 8 x 8".
    pub point: String,
    /// The machines that measured the control point, sorted by name, with their times.
    pub hosts: Vec<AtHost>,
}

/// The time of a control point (a point that every block of a group measures) on one machine.
#[derive(Clone, Debug, PartialEq)]
pub struct AtHost {
    /// The machine's name.
    pub host: String,
    /// Number of blocks (parts of the group) that measured the control point on this machine.
    pub blocks: usize,
    /// The smallest median of the control point, over the blocks that this machine measured.
    pub median_ms: f64,
    /// The 95% interval of `median_ms`; `None` if the machine measured too few samples, or times of 0.
    pub interval_ms: Option<[f64; 2]>,
    /// Ratio of the machine's time to the time of the fastest machine: the estimate, then the lower and the upper end
    /// of its 95% interval. `None` if one of the two machines measured too few samples, or times of 0.
    pub slower: Option<[f64; 3]>,
}

/// The fraction by which a machine must take longer than the fastest machine, even at the lower end of the
/// 95% interval, to count as different.
const DIFFERENT: f64 = 0.02;

impl AtHost {
    /// Returns true if the machine takes more than 2% longer than the fastest machine, even at the lower end
    /// of the 95% interval.
    pub fn differs(&self) -> bool {
        self.slower.is_some_and(|[_, low, _]| low > 1.0 + DIFFERENT)
    }
}

/// Returns the control points with their times on each machine. A control point is measured in several
/// blocks. The record from one block is in `records` (from `records.jsonl`), and the records from all other
/// blocks are in `borrowed` (from `controls.jsonl`). Records with equal keys belong to the same control
/// point, even if they come from different machines. Records without a median, and records with launches from
/// several machines, are left out.
pub fn controls(records: &[Record], borrowed: &[Record]) -> Vec<Control> {
    let is_control = |record: &&Record| {
        let is_itself = record.control.as_ref() == Some(&record.key);
        is_itself && median(record).is_some() && record.hosts().count() <= 1
    };
    let mut points: BTreeMap<&str, Vec<&Record>> = BTreeMap::new();
    for record in records.iter().chain(borrowed).filter(is_control) {
        points.entry(&record.key).or_default().push(record);
    }
    let mut controls: Vec<Control> = points.into_values().map(|records| control(&records)).collect();
    controls.sort_by(|one, other| one.point.cmp(&other.point));
    controls
}

fn control(records: &[&Record]) -> Control {
    let mut hosts: BTreeMap<&str, Vec<&Record>> = BTreeMap::new();
    for record in records {
        // With `--spread`, the devices of one machine are treated like separate machines.
        let host = record.host.as_deref().or(record.measured_on.as_deref());
        hosts.entry(host.unwrap_or("this machine")).or_default().push(record);
    }
    let fastest = least(records);
    let at = |(host, records): (&str, Vec<&Record>)| {
        let record = least(&records)?;
        // If a block was measured in several attempts, the control point has a record of each attempt.
        let blocks: BTreeSet<Option<u32>> = records.iter().map(|record| record.block).collect();
        Some(AtHost {
            host: host.to_owned(),
            blocks: blocks.len(),
            median_ms: record.median_ms?,
            interval_ms: interval(record),
            slower: fastest.and_then(|fastest| times_as_long(record, fastest)),
        })
    };
    let hosts = hosts.into_iter().filter_map(at).collect();
    Control { point: records.first().map_or(String::new(), |record| name(record)), hosts }
}

/// Returns the record with the smallest median.
fn least<'a>(records: &[&'a Record]) -> Option<&'a Record> {
    records
        .iter()
        .copied()
        .min_by(|a, b| a.median_ms.unwrap_or(f64::MAX).total_cmp(&b.median_ms.unwrap_or(f64::MAX)))
}

/// Returns the ratio of the time of `record` to the time of `fastest` with its interval (see [`AtHost::slower`]). The
/// ratio of a record to itself is exactly 1.
fn times_as_long(record: &Record, fastest: &Record) -> Option<[f64; 3]> {
    let ratio = ratio_apart(record, fastest)?;
    let is_itself = std::ptr::eq(record, fastest);
    Some(if is_itself { [1.0; 3] } else { [ratio.middle, ratio.low, ratio.high] })
}

fn name(record: &Record) -> String {
    let size = record.at_local_size();
    format!("{}, {}, {}, {}{size}", record.scene, by(record.image_size), record.device, record.name)
}

/// Returns one note for each machine that takes clearly longer than the fastest machine for a control point,
/// which every block measures (see [`AtHost::differs`]). If a machine takes longer for several control
/// points, its note names the point with the largest ratio of this machine's time to the fastest machine's
/// time.
pub(crate) fn hosts_that_differ(records: &[Record], borrowed: &[Record]) -> Vec<String> {
    let mut said: BTreeMap<String, (f64, String)> = BTreeMap::new();
    for control in controls(records, borrowed) {
        let Some(fastest) = control.hosts.iter().min_by(|a, b| a.median_ms.total_cmp(&b.median_ms)) else {
            continue;
        };
        for host in control.hosts.iter().filter(|host| host.differs()) {
            let Some([middle, low, high]) = host.slower else { continue };
            let [middle_text, low, high] = [middle, low, high].map(|ratio| significant(ratio, 3));
            let text = format!(
                "The hosts differ in speed: the point \"{}\" took {} on {} and {} on {}, {middle_text} times as long (95% interval {low} to {high}). raycl divides the time of each point by the time of this point (the control point) on the same host before it compares points of different hosts, so a difference that is equal for all points cancels.",
                control.point,
                duration(fastest.median_ms),
                fastest.host,
                duration(host.median_ms),
                host.host
            );
            let worst = said.entry(host.host.clone()).or_insert((0.0, String::new()));
            if middle > worst.0 {
                *worst = (middle, text);
            }
        }
    }
    said.into_values().map(|(_, text)| text).collect()
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::{judged, measured};
    use super::*;

    /// Returns the record of a control point that a block on a machine measured. Each block needs its own value of
    /// `launch`. This value is the block's number, and determines the numbers of the block's launches.
    fn on(host: &str, ms: f64, launch: u32) -> Record {
        let mut record = measured("gpu", "naive", 8, ms);
        record.sample_launches.iter_mut().for_each(|number| *number += 10 * launch);
        let control = Some(record.key.clone());
        Record { host: Some(host.to_owned()), control, block: Some(launch), ..record }
    }

    #[test]
    fn hosts_that_take_longer_for_the_same_point_are_said() {
        let same = judged([on("n1", 10.0, 0), on("n2", 10.1, 1)]);
        assert!(hosts_that_differ(&same, &[]).is_empty());
        let records = judged([on("n1", 10.0, 0), on("n2", 12.0, 1), on("n2", 12.5, 2)]);
        let said = hosts_that_differ(&records[..1], &records[1..]);
        assert!(said[0].contains("took 10.00 ms on n1 and 12.00 ms on n2, 1.20 times as long"), "{said:?}");
        let [control] = &controls(&records[..1], &records[1..])[..] else { panic!("one point") };
        assert_eq!(control.hosts.iter().map(|at| at.blocks).collect::<Vec<_>>(), [1, 2]);
        // The fastest machine takes exactly as long as itself.
        let slower: Vec<_> = control.hosts.iter().filter_map(|at| at.slower).collect();
        assert!(slower[0] == [1.0; 3] && slower[1][1] < slower[1][0], "{slower:?}");
    }

    #[test]
    fn a_block_of_which_two_attempts_are_used_is_one_block() {
        let again = Record { block: Some(0), ..on("n1", 10.1, 1) };
        let [control] = &controls(&judged([on("n1", 10.0, 0), again]), &[])[..] else { panic!("one point") };
        assert_eq!(control.hosts.iter().map(|at| at.blocks).collect::<Vec<_>>(), [1]);
    }

    #[test]
    fn a_control_point_whose_launches_are_of_two_machines_is_of_neither() {
        let records = judged([on("n1", 10.0, 0), on("n1, n2", 12.0, 1)]);
        let [control] = &controls(&records, &[])[..] else { panic!("one point") };
        assert_eq!(control.hosts.iter().map(|at| at.host.as_str()).collect::<Vec<_>>(), ["n1"]);
    }

    #[test]
    fn what_no_other_block_measured_is_no_control() {
        assert!(controls(&judged([measured("gpu", "naive", 8, 10.0)]), &[]).is_empty());
    }
    #[test]
    fn machines_are_told_apart_by_their_names_and_devices_of_one_machine_by_theirs() {
        let with = |host: Option<&str>, device: Option<&str>, launch: u32| Record {
            host: host.map(str::to_owned),
            measured_on: device.map(str::to_owned),
            ..on("", 10.0, launch)
        };
        let hosts = |records: &[Record]| -> Vec<String> {
            let [control] = &controls(&judged(records), &[])[..] else { panic!("one point") };
            control.hosts.iter().map(|at| at.host.clone()).collect()
        };
        // Each of two machines may have a device with the name `gpu 1`.
        let both = [with(Some("n1"), Some("gpu 1"), 0), with(Some("n2"), Some("gpu 1"), 1)];
        assert_eq!(hosts(&both), ["n1", "n2"]);
        assert_eq!(hosts(&[with(None, Some("gpu 1"), 0), with(None, Some("gpu 2"), 1)]), ["gpu 1", "gpu 2"]);
        assert_eq!(hosts(&[with(None, None, 0)]), ["this machine"]);
    }

    #[test]
    fn only_a_certain_difference_of_more_than_a_fiftieth_makes_hosts_differ() {
        let at = |slower| AtHost { host: "n1".into(), blocks: 1, median_ms: 10.0, interval_ms: None, slower };
        assert!(at(Some([1.1, 1.03, 1.2])).differs());
        assert!(!at(Some([1.1, 1.02, 1.2])).differs());
        assert!(!at(None).differs(), "a machine with too few samples");
    }

    #[test]
    fn control_points_are_sorted_by_what_they_are_and_their_machines_by_name() {
        let of = |scene: &str, host: &str, launch: u32| Record {
            scene: scene.into(),
            key: if scene == "bunny" { "b" } else { "a" }.into(),
            control: Some(if scene == "bunny" { "b" } else { "a" }.into()),
            ..on(host, 10.0, launch)
        };
        let records = judged([
            of("teapot", "n2", 0),
            of("teapot", "n1", 1),
            of("bunny", "n2", 2),
            of("bunny", "n1", 3),
        ]);
        let controls = controls(&records, &[]);
        assert!(
            controls[0].point.starts_with("bunny") && controls[1].point.starts_with("teapot"),
            "{controls:?}"
        );
        let hosts: Vec<_> = controls[0].hosts.iter().map(|at| at.host.as_str()).collect();
        assert_eq!(hosts, ["n1", "n2"]);
    }

    #[test]
    fn the_point_with_the_largest_ratio_is_named() {
        let with = |name: &str, host: &str, ms: f64, launch: u32| {
            let record = Record { name: name.into(), key: name.into(), ..on(host, ms, launch) };
            Record { control: Some(name.into()), ..record }
        };
        // `hosts_that_differ` looks at control points in the order of their descriptions ([`Control::point`]).
        let ratios = |a: f64, b: f64| {
            let records = [
                with("a", "n1", 10.0, 0),
                with("a", "n2", a, 1),
                with("b", "n1", 10.0, 2),
                with("b", "n2", b, 3),
            ];
            hosts_that_differ(&judged(records), &[]).concat()
        };
        let [growing, falling] = [ratios(12.0, 15.0), ratios(15.0, 12.0)];
        assert!(growing.contains("gpu, b "), "{growing}");
        assert!(falling.contains("gpu, a "), "{falling}");
    }
}
