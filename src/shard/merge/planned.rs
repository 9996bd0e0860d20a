//! The points of a merged folder, with their names. The points of every selected kind of device are included.

use crate::record::{HOST, PlannedPoint, Record};
use crate::shard::{Kind, ShardPlan};
use std::collections::{HashMap, HashSet};

/// The points of a merge.
pub struct Planned {
    /// The points, each once, sorted by scene and image size, then by kind of device.
    pub points: Vec<PlannedPoint>,
    /// For each caster on the host, by its key: the words that distinguish its kind of host from others. Empty if
    /// there is only one kind of host.
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

    /// Returns the points' keys, in their order.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.points.iter().map(|point| point.key.as_str())
    }

    /// Adds the kind of host to the name of a caster on the host, so that tables and plots distinguish it from
    /// casters on other kinds of host.
    pub fn tell_apart(&self, record: &mut Record) {
        if let Some(what) = self.hosts.get(&record.key) {
            record.strategy = format!("{} ({what})", record.strategy);
        }
    }
}
