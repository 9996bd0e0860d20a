//! What is yet to be measured, by the plan and never by an exit code, and the command that measures it.

use super::{Attempt, Kind, ShardPlan};
use crate::record::HOST;
use crate::report::quote;
use std::collections::BTreeSet;

/// What every kind of device lacks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Missing {
    /// Kinds that lack something.
    pub kinds: Vec<MissingKind>,
    /// Whether no shard has begun.
    pub nothing_began: bool,
}

/// What a kind of device lacks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MissingKind {
    /// The kind.
    pub device: String,
    /// Its points without a record, for people, and how many it has in all.
    pub points: Vec<String>,
    /// How many points the plan has for it.
    pub of: usize,
    /// The shards that measure them.
    pub shards: Vec<u32>,
    /// The command for all of these.
    pub command: String,
}

impl Missing {
    /// Whether all is there.
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty() && !self.nothing_began
    }

    /// How many points they are.
    pub fn count(&self) -> usize {
        self.kinds.iter().map(|kind| kind.points.len()).sum()
    }
}

/// Points of the plan that have no record, on each kind. A caster on the host is there when any kind of host measured it: it belongs to no
/// kind of device.
pub fn missing(
    plan: &ShardPlan,
    kinds: &[Kind],
    attempts: &[Attempt],
    has: &dyn Fn(&str) -> bool,
) -> Missing {
    let hosts: BTreeSet<usize> = kinds
        .iter()
        .filter(|kind| kind.device == HOST)
        .flat_map(|kind| &kind.points)
        .filter(|point| has(&point.planned.key))
        .map(|point| point.point)
        .collect();
    let mut found: Vec<MissingKind> = Vec::new();
    for (kind, distinction) in kinds.iter().zip(Kind::distinctions(kinds)) {
        let is_host = kind.device == HOST;
        if is_host && found.iter().any(|known| known.device == HOST) {
            continue;
        }
        let lacks: Vec<usize> = kind
            .points
            .iter()
            .filter(|point| !(has(&point.planned.key) || is_host && hosts.contains(&point.point)))
            .map(|point| point.point)
            .collect();
        if lacks.is_empty() {
            continue;
        }
        let shards: BTreeSet<u32> =
            lacks.iter().filter_map(|point| plan.block_of(*point)).map(|block| block.shard).collect();
        let label = distinction.filter(|_| !is_host).map_or(String::new(), |what| format!(" ({what})"));
        found.push(MissingKind {
            device: format!("{}{label}", kind.device),
            points: lacks.iter().filter_map(|point| plan.points.get(*point).cloned()).collect(),
            of: kind.points.len(),
            command: command(plan, kind, attempts, &shards),
            shards: shards.into_iter().collect(),
        });
    }
    Missing { kinds: found, nothing_began: kinds.is_empty() }
}

/// What an attempt on the kind was started with, for the shards that are missing.
fn command(plan: &ShardPlan, kind: &Kind, attempts: &[Attempt], shards: &BTreeSet<u32>) -> String {
    let abouts: Vec<_> = attempts.iter().filter_map(Attempt::about).collect();
    let own = abouts.iter().find(|about| about.devices.contains(&kind.identity)).or(abouts.first());
    let words = own.map_or_else(Vec::new, |about| about.command.clone());
    let of = plan.header.shards;
    let words = without_shard(&words).iter().map(|word| quote(word)).collect::<Vec<_>>().join(" ");
    match shards.iter().copied().collect::<Vec<_>>()[..] {
        [one] => format!("{words} --shard {one}/{of}"),
        _ => {
            let numbers = shards.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
            format!("for shard in {numbers}; do {words} --shard $shard/{of}; done")
        }
    }
}

/// A command's words under the name that the program has everywhere, without the option that says which shard.
fn without_shard(command: &[String]) -> Vec<String> {
    let mut words = vec!["raycl".to_owned()];
    let mut rest = command.iter().skip(1);
    while let Some(word) = rest.next() {
        match word.as_str() {
            "--shard" => drop(rest.next()),
            word if word.starts_with("--shard=") => {}
            _ => words.push(word.clone()),
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::super::{Block, Header, KindPoint};
    use super::*;
    use crate::record::PlannedPoint;

    fn kind(device: &str, identity: &str, points: &[usize]) -> Kind {
        let point = |point: &usize| KindPoint {
            point: *point,
            planned: PlannedPoint { key: format!("{identity} {point}"), ..PlannedPoint::default() },
        };
        Kind { device: device.into(), identity: identity.into(), points: points.iter().map(point).collect() }
    }

    fn plan() -> ShardPlan {
        let block = |number: u32, points: &[usize]| Block {
            number,
            shard: number,
            points: points.to_vec(),
            control: None,
        };
        ShardPlan {
            header: Header { shards: 16, ..Header::default() },
            points: ["a", "b", "c"].map(str::to_owned).to_vec(),
            blocks: vec![block(3, &[0, 1]), block(7, &[2])],
            ..ShardPlan::default()
        }
    }

    #[test]
    fn each_kind_lacks_what_it_lacks_and_any_host_will_do() {
        let kinds = [
            kind(HOST, "amd", &[0]),
            kind(HOST, "intel", &[0]),
            kind("gpu", "1", &[1, 2]),
            kind("gpu", "2", &[1, 2]),
        ];
        let there = ["intel 0", "1 1", "1 2"];
        let found = missing(&plan(), &kinds, &[], &|key| there.contains(&key));
        let [two] = &found.kinds[..] else { panic!("{found:?}") };
        assert_eq!((two.device.as_str(), two.points.len(), &two.shards[..]), ("gpu (2)", 2, &[3, 7][..]));
        assert_eq!(two.command, "for shard in 3 7; do raycl --shard $shard/16; done");
        let found = missing(&plan(), &kinds[..1], &[], &|_| false);
        assert_eq!(found.kinds[0].command, "raycl --shard 3/16");
        assert!(missing(&plan(), &[], &[], &|_| true).nothing_began);
    }

    #[test]
    fn the_command_is_the_attempts_with_another_shard() {
        let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
        let given = words("/x/raycl run a.toml --shard 3/16 --out o --set x=1");
        assert_eq!(without_shard(&given), words("raycl run a.toml --out o --set x=1"));
        assert_eq!(
            without_shard(&words("raycl run a.toml --shard=auto --out o")),
            words("raycl run a.toml --out o")
        );
    }
}
