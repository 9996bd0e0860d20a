//! Compares records with the plan to find what still has to be measured, and the command that measures it.

use super::{Attempt, Kind, ShardPlan};
use crate::record::HOST;
use crate::words::{option, quote};
use std::collections::BTreeSet;
use std::path::Path;

/// The missing points of all kinds of device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Missing {
    /// Kinds with missing points.
    pub kinds: Vec<MissingKind>,
    /// True if no shard has begun.
    pub nothing_began: bool,
    /// The names of the kinds that took part. They are listed only if a selected kind did not take part, since that
    /// kind's name may be misspelt.
    pub took_part: Option<String>,
}

/// The missing points of a kind of device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MissingKind {
    /// The kind's name, with the differences from other kinds of the same name. If no shard has begun on the kind, the
    /// text is the word that selects the kind.
    pub device: String,
    /// The kind's points without a record, in a readable form.
    pub points: Vec<String>,
    /// The number of points that the plan has for the kind.
    pub of: usize,
    /// The shards that contain the missing points.
    pub shards: Vec<u32>,
    /// The command that measures all missing points of the kind.
    pub command: String,
}

impl Missing {
    /// Returns whether nothing is missing.
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty() && !self.nothing_began
    }

    /// Returns the number of missing points.
    pub fn count(&self) -> usize {
        self.kinds.iter().map(|kind| kind.points.len()).sum()
    }
}

/// The kinds of device whose points are looked for.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// All kinds that took part.
    pub all: &'a [Kind],
    /// The kinds that took part and are selected. The host's kinds are always selected.
    pub kinds: &'a [Kind],
    /// The words that select kinds on which no shard has begun.
    pub not_begun: &'a [String],
}

/// Returns, for each selected kind of device, the points of the plan that have no record on this kind. If no shard has
/// begun on a selected kind, these are all points except casters on the host. A caster on the host is missing only if
/// it has no record on any kind of host. If no shard with casters on the host has begun, all of these casters are
/// missing. The commands that measure the points write to the folder `out`.
pub fn missing(
    out: &Path,
    plan: &ShardPlan,
    wanted: Wanted<'_>,
    attempts: &[Attempt],
    has: &dyn Fn(&str) -> bool,
) -> Missing {
    let Wanted { all, kinds, not_begun } = wanted;
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
        let label = distinction.filter(|_| !is_host).map_or(String::new(), |what| format!(" ({what})"));
        let words = started_with(out, Some(kind), attempts);
        found.push(lacking(plan, format!("{}{label}", kind.device), (&lacks, kind.points.len()), &words));
    }
    let (of_host, of_device) = divided(plan, all);
    if !of_host.is_empty() && !all.iter().any(|kind| kind.device == HOST) {
        let words = started_with(out, None, attempts);
        found.push(lacking(plan, HOST.to_owned(), (&of_host, of_host.len()), &words));
    }
    found.extend(not_begun.iter().map(|device| {
        let mut words = without(&started_with(out, None, attempts), "--device");
        words.extend(["--device".to_owned(), device.clone()]);
        lacking(plan, device.clone(), (&of_device, of_device.len()), &words)
    }));
    let took_part = not_begun.first().map(|_| names(all));
    Missing { kinds: found, nothing_began: all.is_empty(), took_part }
}

/// Returns the plan's casters on the host and the plan's other points, as indices. Every kind of device except the host
/// has all of the other points, so the points of one kind are enough to divide the plan.
fn divided(plan: &ShardPlan, all: &[Kind]) -> (Vec<usize>, Vec<usize>) {
    let device = all.iter().find(|kind| kind.device != HOST);
    let on_host = |point: &usize| match device {
        Some(device) => device.points.iter().all(|other| other.point != *point),
        None => all.iter().flat_map(|kind| &kind.points).any(|other| other.point == *point),
    };
    (0..plan.points.len()).partition(on_host)
}

/// Returns the names of all kinds of device that took part in the experiment: each name once, joined by commas.
fn names(all: &[Kind]) -> String {
    let mut names: Vec<&str> = all.iter().map(|kind| kind.device.as_str()).collect();
    names.dedup();
    names.join(", ")
}

/// Describes a kind of device that has no records for the points `lacks`, out of `of` points in all.
fn lacking(
    plan: &ShardPlan,
    device: String,
    (lacks, of): (&[usize], usize),
    words: &[String],
) -> MissingKind {
    let shards: BTreeSet<u32> =
        lacks.iter().filter_map(|point| plan.block_of(*point)).map(|block| block.shard).collect();
    MissingKind {
        device,
        points: lacks.iter().filter_map(|point| plan.points.get(*point).cloned()).collect(),
        of,
        command: command(plan, words, &shards),
        shards: shards.into_iter().collect(),
    }
}

/// Returns the command line of an attempt on this kind of device or, if there is none, that of the first attempt. The
/// option `--shard` is removed. The option `--out` names the folder by its present path: the attempt may have been
/// started in another folder, and its folder may have been moved or copied.
fn started_with(out: &Path, kind: Option<&Kind>, attempts: &[Attempt]) -> Vec<String> {
    let abouts: Vec<_> = attempts.iter().filter_map(Attempt::about).collect();
    let own = kind.and_then(|kind| abouts.iter().find(|about| about.devices.contains(&kind.identity)));
    let command = own.or(abouts.first()).map_or_else(Vec::new, |about| about.command.clone());
    let mut words = without_out(&without_shard(&command));
    words.extend(option("--out", out.display()));
    words
}

/// Returns the command that runs raycl with these words once for each of the missing shards.
fn command(plan: &ShardPlan, words: &[String], shards: &BTreeSet<u32>) -> String {
    let of = plan.header.shards;
    let words = words.iter().map(|word| quote(word)).collect::<Vec<_>>().join(" ");
    match shards.iter().copied().collect::<Vec<_>>()[..] {
        [one] => format!("{words} --shard {one}/{of}"),
        _ => {
            let numbers = shards.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
            format!("for shard in {numbers}; do {words} --shard $shard/{of}; done")
        }
    }
}

/// Returns this command line with `raycl` in place of the program's path, and without the option `--shard`.
fn without_shard(command: &[String]) -> Vec<String> {
    let rest = command.iter().skip(1).cloned();
    without(&std::iter::once("raycl".to_owned()).chain(rest).collect::<Vec<_>>(), "--shard")
}

/// Returns a command line without an option and its value.
fn without(command: &[String], option: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut rest = command.iter();
    while let Some(word) = rest.next() {
        match word.strip_prefix(option) {
            Some("") => drop(rest.next()),
            Some(value) if value.starts_with('=') => {}
            _ => words.push(word.clone()),
        }
    }
    words
}

/// Returns a command line without the option `--out` and its value. The option's short form may follow short options
/// that have no value, as in `-qo DIR`; these options stay.
fn without_out(command: &[String]) -> Vec<String> {
    let mut words = Vec::new();
    let mut rest = without(command, "--out").into_iter();
    while let Some(word) = rest.next() {
        let letters = word.strip_prefix('-').filter(|letters| !letters.starts_with('-'));
        match letters.and_then(|letters| letters.split_once('o')) {
            Some((others, value)) if others.chars().all(|letter| "qv".contains(letter)) => {
                if value.is_empty() {
                    rest.next();
                }
                words.extend((!others.is_empty()).then(|| format!("-{others}")));
            }
            _ => words.push(word),
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::super::{Header, KindPoint};
    use super::*;
    use crate::experiment::Block;
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

    /// Returns the missing points of kinds that are all selected.
    fn lacks(kinds: &[Kind], not_begun: &[String], has: &dyn Fn(&str) -> bool) -> Missing {
        missing(Path::new("o"), &plan(), Wanted { all: kinds, kinds, not_begun }, &[], has)
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
        let found = lacks(&kinds, &[], &|key| there.contains(&key));
        let [two] = &found.kinds[..] else { panic!("{found:?}") };
        assert_eq!((two.device.as_str(), two.points.len(), &two.shards[..]), ("gpu (2)", 2, &[3, 7][..]));
        assert_eq!(two.command, "for shard in 3 7; do raycl --out o --shard $shard/16; done");
        let found = lacks(&kinds[..1], &[], &|_| false);
        assert_eq!(found.kinds[0].command, "raycl --out o --shard 3/16");
        assert!(lacks(&[], &[], &|_| true).nothing_began);
    }

    #[test]
    fn a_kind_that_is_meant_and_has_not_begun_lacks_all_but_the_hosts_points() {
        let kinds = [kind(HOST, "amd", &[0]), kind("gpu", "1", &[1, 2])];
        let found = lacks(&kinds, &["h200".to_owned()], &|_| true);
        let [h200] = &found.kinds[..] else { panic!("{found:?}") };
        assert_eq!((h200.device.as_str(), h200.points.len(), h200.of), ("h200", 2, 2));
        assert_eq!(h200.command, "for shard in 3 7; do raycl --out o --device h200 --shard $shard/16; done");
        assert_eq!(found.took_part.as_deref(), Some("host, gpu"));
    }

    #[test]
    fn casters_on_a_host_that_has_not_begun_are_the_hosts_alone() {
        let all = [kind("gpu", "1", &[1, 2])];
        let wanted = Wanted { all: &all, kinds: &[], not_begun: &["h200".to_owned()] };
        let found = missing(Path::new("o"), &plan(), wanted, &[], &|_| true);
        let told = |kind: &MissingKind| format!("{} {:?} {:?}", kind.device, kind.points, kind.shards);
        let told: Vec<_> = found.kinds.iter().map(told).collect();
        assert_eq!(told, [r#"host ["a"] [3]"#, r#"h200 ["b", "c"] [3, 7]"#]);
        assert!(!found.nothing_began, "a shard on a gpu has begun");
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

    #[test]
    fn the_command_has_no_trace_of_the_attempts_folder() {
        let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
        for given in ["--out old", "--out=old", "-o old", "-oold", "-o=old"] {
            assert_eq!(
                without_out(&words(&format!("raycl run a.toml {given} -q"))),
                words("raycl run a.toml -q")
            );
        }
        for given in ["-qo old", "-qoold"] {
            assert_eq!(
                without_out(&words(&format!("raycl run {given} a.toml"))),
                words("raycl run -q a.toml")
            );
        }
        let other = words("raycl run a-o.toml -q --no-wait --set x=-o");
        assert_eq!(without_out(&other), other);
    }

    #[test]
    fn an_option_whose_name_begins_like_another_stays() {
        let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
        let given = words("raycl run a.toml --device gpu --device-list --device=cpu --devices 2");
        assert_eq!(without(&given, "--device"), words("raycl run a.toml --device-list --devices 2"));
    }

    #[test]
    fn nothing_is_missing_only_if_a_shard_has_begun_and_no_kind_lacks_a_point() {
        let kinds = [kind(HOST, "amd", &[0]), kind("gpu", "1", &[1, 2])];
        let of = |kinds: &[Kind], has: bool| lacks(kinds, &[], &|_| has).is_empty();
        assert_eq!([of(&kinds, true), of(&kinds, false)], [true, false]);
        let none = lacks(&[], &[], &|_| true);
        assert!(none.kinds.is_empty() && !none.is_empty(), "without any shard, no kind is known");
    }

    #[test]
    fn a_kinds_command_is_that_of_an_attempt_on_it_and_a_host_is_told_once() {
        use crate::shard::About;
        let out = tempfile::tempdir().unwrap();
        let attempts = [("1", "one"), ("2", "other")].map(|(identity, device)| {
            let words = ["raycl", "run", "-o", "its old path", "--device", device, "--shard", "1/16"];
            let about = About {
                host: device.into(),
                devices: vec![identity.into()],
                command: words.map(str::to_owned).to_vec(),
                ..About::default()
            };
            Attempt::begin(out.path(), &about).unwrap()
        });
        let kinds = [
            kind(HOST, "amd", &[0]),
            kind(HOST, "intel", &[0]),
            kind("gpu", "1", &[2]),
            kind("gpu", "2", &[2]),
        ];
        let wanted = Wanted { all: &kinds, kinds: &kinds, not_begun: &[] };
        let now = Path::new("my results");
        let found = missing(now, &plan(), wanted, &attempts, &|_| false);
        let told: Vec<_> =
            found.kinds.iter().map(|kind| (kind.device.as_str(), kind.command.as_str())).collect();
        let expected = [
            (HOST, "raycl run --device one --out 'my results' --shard 3/16"),
            ("gpu (1)", "raycl run --device one --out 'my results' --shard 7/16"),
            ("gpu (2)", "raycl run --device other --out 'my results' --shard 7/16"),
        ];
        assert_eq!((told, found.count()), (expected.to_vec(), 3));
        let not_begun = ["tpu".to_owned()];
        let wanted = Wanted { all: &kinds, kinds: &kinds[..2], not_begun: &not_begun };
        let found = missing(now, &plan(), wanted, &attempts, &|_| true);
        assert_eq!(found.took_part.as_deref(), Some("host, gpu"));
    }
}
