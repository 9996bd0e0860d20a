//! The points of the experiment that a merged folder contains, with their names. The points of every selected
//! kind of device are included.

use super::Measured;
use crate::record::{HOST, PlannedPoint, Record};
use crate::shard::{Kind, ShardPlan};
use std::collections::{BTreeMap, HashMap, HashSet};

/// The points of a merged folder: all points of the plan, on every selected kind of device.
pub struct Planned {
    /// The points, each once, sorted by scene and image size, then by kind of device.
    pub points: Vec<PlannedPoint>,
    /// Maps the key of each point that is a caster on the host to the words that distinguish the caster's kind of host
    /// from the other kinds of host. The map is empty if there is only one kind of host.
    hosts: HashMap<String, String>,
}

impl Planned {
    /// Makes the points of a plan on these kinds of device.
    pub fn of(plan: &ShardPlan, kinds: &[Kind]) -> Self {
        let mut all: Vec<(usize, usize, usize, PlannedPoint)> = Vec::new();
        let mut hosts = HashMap::new();
        for (number, (kind, distinction)) in kinds.iter().zip(Kind::distinctions(kinds)).enumerate() {
            for point in &kind.points {
                let mut planned = point.planned.clone();
                if let Some(what) = &distinction {
                    match kind.device == HOST {
                        true => {
                            planned.name = format!("{} ({what})", planned.name);
                            hosts.insert(planned.key.clone(), what.clone());
                        }
                        false => planned.device = format!("{} ({what})", planned.device),
                    }
                }
                let case = plan.cases.get(point.point).copied().unwrap_or(0);
                all.push((case, number, point.point, planned));
            }
        }
        all.sort_by_key(|(case, kind, point, _)| (*case, *kind, *point));
        let mut seen = HashSet::new();
        let points = all.into_iter().map(|(.., point)| point);
        Self { points: points.filter(|point| seen.insert(point.key.clone())).collect(), hosts }
    }

    /// Returns the keys of all points of the merged folder, in the order of the points.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.points.iter().map(|point| point.key.as_str())
    }

    /// Returns a map from each attempt's devices to the names of these devices in the merged folder. A key of
    /// the map is an attempt's index and a device's name in the attempt's records. Two attempts may give the
    /// same name to devices of different kinds.
    pub fn devices<'a>(
        &self,
        records: impl Iterator<Item = &'a Measured>,
    ) -> BTreeMap<(usize, String), String> {
        let planned: HashMap<&str, &str> =
            self.points.iter().map(|point| (point.key.as_str(), point.device.as_str())).collect();
        let named = |(attempt, record): &Measured| {
            let name = planned.get(record.key.as_str())?;
            Some(((*attempt, record.device.clone()), (*name).to_owned()))
        };
        records.filter_map(named).collect()
    }

    /// If there are several kinds of host, adds the kind of host to the strategy in the record of a caster on the
    /// host. Tables and plots then distinguish this caster from casters on other kinds of host.
    pub fn tell_apart(&self, record: &mut Record) {
        if let Some(what) = self.hosts.get(&record.key) {
            record.strategy = format!("{} ({what})", record.strategy);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shard::KindPoint;

    /// Returns a kind of device with these points of the plan.
    fn kind(device: &str, identity: &str, points: &[usize]) -> Kind {
        let point = |point: &usize| {
            let key = format!("{identity} {point}");
            let planned = PlannedPoint {
                key,
                device: device.into(),
                name: format!("s{point}"),
                ..PlannedPoint::default()
            };
            KindPoint { point: *point, planned }
        };
        let points = points.iter().map(point).collect();
        Kind { device: device.into(), identity: identity.into(), points, ..Kind::default() }
    }

    #[test]
    fn points_follow_cases_then_kinds_then_the_plan_and_namesakes_are_distinguished() {
        // Points 0 and 2 belong to the second case (combination of scene and image size).
        let plan = ShardPlan { cases: vec![1, 0, 1, 0], ..ShardPlan::default() };
        let kinds = [kind(HOST, "amd", &[3]), kind(HOST, "intel", &[2, 3]), kind("gpu", "x", &[2, 1, 0])];
        let planned = Planned::of(&plan, &kinds);
        assert_eq!(planned.keys().collect::<Vec<_>>(), ["amd 3", "intel 3", "x 1", "intel 2", "x 0", "x 2"]);
        let names: Vec<_> =
            planned.points.iter().map(|point| (point.device.as_str(), point.name.as_str())).collect();
        let expected = [
            (HOST, "s3 (amd)"),
            (HOST, "s3 (intel)"),
            ("gpu", "s1"),
            (HOST, "s2 (intel)"),
            ("gpu", "s0"),
            ("gpu", "s2"),
        ];
        assert_eq!(names, expected);
        let strategy_of = |key: &str| {
            let mut record = Record { key: key.into(), strategy: "serial-f32".into(), ..Record::default() };
            planned.tell_apart(&mut record);
            record.strategy
        };
        assert_eq!([strategy_of("intel 3"), strategy_of("x 1")], ["serial-f32 (intel)", "serial-f32"]);
    }

    #[test]
    fn a_device_has_the_name_of_its_kind_in_each_attempt() {
        let plan = ShardPlan { cases: vec![0, 0], ..ShardPlan::default() };
        let kinds =
            [kind("cpu", "PoCL | 3.1", &[0, 1]), kind("cpu", "PoCL | 7.0", &[0, 1]), kind("gpu", "x", &[0])];
        let planned = Planned::of(&plan, &kinds);
        let record = |attempt: usize, key: &str, device: &str| {
            (attempt, Record { key: key.into(), device: device.into(), ..Record::default() })
        };
        let records = [
            record(0, "PoCL | 3.1 0", "cpu"),
            record(0, "x 0", "gpu"),
            record(1, "PoCL | 7.0 1", "cpu"),
            record(1, "of no kind", "other"),
        ];
        let devices = planned.devices(records.iter()).into_iter().collect::<Vec<_>>();
        let name = |attempt: usize, from: &str, to: &str| ((attempt, from.to_owned()), to.to_owned());
        assert_eq!(
            devices,
            [name(0, "cpu", "cpu (3.1)"), name(0, "gpu", "gpu"), name(1, "cpu", "cpu (7.0)")]
        );
    }

    #[test]
    fn devices_of_one_name_get_their_differences_and_a_point_of_two_kinds_is_there_once() {
        let plan = ShardPlan { cases: vec![0], ..ShardPlan::default() };
        let twin = Kind { identity: "PoCL | 2 units".into(), ..kind("cpu", "PoCL | 1 units", &[0]) };
        let kinds = [kind("cpu", "PoCL | 1 units", &[0]), twin];
        let planned = Planned::of(&plan, &kinds);
        let devices: Vec<_> = planned.points.iter().map(|point| point.device.as_str()).collect();
        assert_eq!(devices, ["cpu (1 unit)"]);
    }
}
