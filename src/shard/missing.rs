//! Compares records with the plan, to find the points that still have to be measured, the points that failed, and the
//! commands that measure these points.

use super::{About, Header, Kind, ShardPlan};
use crate::device::both_names;
use crate::device::variables::is_to_be_repeated;
use crate::experiment::MOVED_SAMPLES;
use crate::record::{HOST, Outcome};
use crate::words::{command_line, option, path_word, quote};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The options with which a shard measures failed points again.
const AGAIN: [&str; 2] = ["--resume", "--retry-failed"];

/// The missing points and the failed points of all selected kinds of device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Missing {
    /// The kinds of device on which points are missing: no record of these points exists.
    pub kinds: Vec<MissingKind>,
    /// The kinds of device on which points failed. A failed point has a record, so it is not missing.
    pub failed: Vec<MissingKind>,
    /// True if no shard has begun.
    pub nothing_began: bool,
    /// The names of the kinds of device that took part in the experiment, if a selected kind did not take
    /// part; otherwise `None`. The user may have misspelt the name of the selected kind, and can compare the
    /// misspelt name with the names in `took_part`.
    pub took_part: Option<String>,
}

/// The missing points, or the failed points, of a kind of device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MissingKind {
    /// The name of the kind of device, with the differences from other kinds of the same name. If no shard has begun on
    /// this kind of device, the text is the word that selects the kind. Missing casters on the host have the text
    /// `host`, since any kind of host may measure them.
    pub device: String,
    /// The readable names of those points of this kind of device that have no record, or that failed.
    pub points: Vec<String>,
    /// The number of points that the plan has for this kind of device.
    pub of: usize,
    /// The shards that contain the missing points, or the failed points.
    pub shards: Vec<u32>,
    /// The command that measures all missing points, or all failed points, of this kind of device.
    pub command: String,
}

impl Missing {
    /// Returns true if a shard has begun, and no point is missing on any selected kind of device.
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty() && !self.nothing_began
    }

    /// Returns the number of missing points on all kinds of device together.
    pub fn count(&self) -> usize {
        self.kinds.iter().map(|kind| kind.points.len()).sum()
    }
}

/// The kinds of device whose points are looked for.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// All kinds of device that took part in the experiment.
    pub all: &'a [Kind],
    /// The kinds of device that took part and are selected. The kinds of host, on which baselines run, are
    /// always selected.
    pub kinds: &'a [Kind],
    /// The words that select kinds on which no shard has begun.
    pub not_begun: &'a [String],
}

/// Returns, for each selected kind of device, the points of the plan that have no record on this kind. If no
/// shard has begun on a selected kind, all points except casters on the host are missing on this kind. A
/// caster on the host is missing only if it has no record on any kind of host. If no shard with casters on
/// the host has begun, all casters on the host are missing. The points that failed are returned too, in
/// `Missing::failed`. The result contains commands that measure the missing points and the failed points and
/// write to the folder `out`. These commands are made from the command lines in `abouts`, with which attempts
/// were started. `outcome` returns the outcome of the record with a key; `None` if there is no such record.
pub fn missing(
    out: &Path,
    plan: &ShardPlan,
    wanted: Wanted<'_>,
    abouts: &[About],
    outcome: &dyn Fn(&str) -> Option<Outcome>,
) -> Missing {
    let Wanted { all, kinds, not_begun } = wanted;
    let has = |key: &str| outcome(key).is_some();
    let start_of = |kind: Option<&Kind>| Start::of(out, &plan.header, kind, abouts);
    let hosts: BTreeSet<usize> = kinds
        .iter()
        .filter(|kind| kind.device == HOST)
        .flat_map(|kind| &kind.points)
        .filter(|point| has(&point.planned.key))
        .map(|point| point.point)
        .collect();
    let mut missing_kinds: Vec<MissingKind> = Vec::new();
    for (kind, distinction) in kinds.iter().zip(Kind::distinctions(kinds)) {
        let is_host = kind.device == HOST;
        if is_host && missing_kinds.iter().any(|known| known.device == HOST) {
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
        let name = named(kind, distinction.filter(|_| !is_host));
        let start = start_of(Some(kind));
        missing_kinds.push(lacking(plan, name, (&lacks, kind.points.len()), &start));
    }
    let (of_host, of_device) = divided(plan, all);
    if !of_host.is_empty() && !all.iter().any(|kind| kind.device == HOST) {
        let start = start_of(None);
        missing_kinds.push(lacking(plan, HOST.to_owned(), (&of_host, of_host.len()), &start));
    }
    missing_kinds.extend(not_begun.iter().map(|device| {
        let start = start_of(None).on(device);
        lacking(plan, device.clone(), (&of_device, of_device.len()), &start)
    }));
    let failed = failed(plan, kinds, outcome, &|kind| start_of(Some(kind)).again());
    let took_part = not_begun.first().map(|_| names(all));
    Missing { kinds: missing_kinds, failed, nothing_began: all.is_empty(), took_part }
}

/// Returns, for each kind of device, the points whose measurement failed on this kind. Points with a wrong
/// image are left out, because measuring these points again would be useless: a merge prefers a record with a
/// wrong image to all other records of its point. `start` returns the command that measures the points again.
fn failed(
    plan: &ShardPlan,
    kinds: &[Kind],
    outcome: &dyn Fn(&str) -> Option<Outcome>,
    start: &dyn Fn(&Kind) -> Start,
) -> Vec<MissingKind> {
    let is_failed =
        |key: &str| outcome(key).is_some_and(|outcome| !outcome.is_fine() && outcome != Outcome::WrongImage);
    let of = |(kind, distinction): (&Kind, Option<String>)| {
        let points = kind.points.iter().filter(|point| is_failed(&point.planned.key));
        let points: Vec<usize> = points.map(|point| point.point).collect();
        let counted = (&points[..], kind.points.len());
        (!points.is_empty()).then(|| lacking(plan, named(kind, distinction), counted, &start(kind)))
    };
    kinds.iter().zip(Kind::distinctions(kinds)).filter_map(of).collect()
}

/// Returns a kind's name with its differences from other kinds of the same name.
fn named(kind: &Kind, distinction: Option<String>) -> String {
    let label = distinction.map_or(String::new(), |what| format!(" ({what})"));
    format!("{}{label}", kind.device)
}

/// Returns the indices of those points of the plan that are casters on the host, and the indices of all other points.
/// If `all` has a kind of device that is no host, the casters on the host are those points that the first of these
/// kinds does not measure. If all kinds of device in `all` are hosts, the casters on the host are the points that these
/// hosts measure.
fn divided(plan: &ShardPlan, all: &[Kind]) -> (Vec<usize>, Vec<usize>) {
    let device = all.iter().find(|kind| kind.device != HOST);
    let on_host = |point: &usize| match device {
        Some(device) => device.points.iter().all(|other| other.point != *point),
        None => all.iter().flat_map(|kind| &kind.points).any(|other| other.point == *point),
    };
    (0..plan.points.len()).partition(on_host)
}

/// Returns the names of all kinds of device that took part in the experiment. Each kind's common name is followed by
/// the name that the driver gives, in brackets, if this name differs. Kinds with the same name are listed once.
/// Semicolons separate the kinds, since a common name may contain a comma.
pub(super) fn names(all: &[Kind]) -> String {
    let mut seen = BTreeSet::new();
    let names = all.iter().map(|kind| kind.device.as_str()).filter(|name| seen.insert(*name));
    names.map(both_names).collect::<Vec<_>>().join("; ")
}

/// Describes a kind of device on which the points with the indices `lacks` have to be measured. `of` is the
/// number of points that the plan has for this kind.
fn lacking(plan: &ShardPlan, device: String, (lacks, of): (&[usize], usize), start: &Start) -> MissingKind {
    let shards: BTreeSet<u32> =
        lacks.iter().filter_map(|point| plan.block_of(*point)).map(|block| block.shard).collect();
    MissingKind {
        device,
        points: lacks.iter().filter_map(|point| plan.points.get(*point).cloned()).collect(),
        of,
        command: start.of_shards(&shards, plan.header.shards),
        shards: shards.into_iter().collect(),
    }
}

/// A command that measures shards, without the shards' numbers.
struct Start {
    /// The folder in which the attempt was started; `None` if this folder is the current folder, does not
    /// exist or is not known.
    folder: Option<PathBuf>,
    /// The environment variables that the user had set, each as `NAME=VALUE`.
    variables: Vec<String>,
    /// The program, the subcommand, the config and the options.
    words: Vec<String>,
}

impl Start {
    /// Returns the command of an attempt on this kind of device or, if there is no such attempt, the command of the
    /// first attempt. If no attempt's command can be read, the command is made from the plan's `header`. The option
    /// `--shard` is removed. The option `--out` names the folder of results by its present path, since this folder
    /// may have been moved or copied. If the variable `RAYCL_DEVICE` or the user's settings selected the attempt's
    /// devices, the option `--device` is added, since the variable or the settings may be different now.
    fn of(out: &Path, header: &Header, kind: Option<&Kind>, abouts: &[About]) -> Self {
        let own = kind.and_then(|kind| abouts.iter().find(|about| about.devices.contains(&kind.identity)));
        let about = own.or(abouts.first()).cloned().unwrap_or_default();
        let current = std::env::current_dir().ok();
        let folder = about.folder.map(PathBuf::from);
        // If this machine does not have the folder in which the attempt was started, the command contains no
        // `cd`, and the user has to choose the folder.
        let folder = folder.filter(|folder| folder.is_dir() && current.as_ref() != Some(folder));
        // If the command changes to another folder, `--out` needs an absolute path, since a relative path would lead to
        // another folder.
        let absolute = folder.as_ref().and_then(|_| std::path::absolute(out).ok());
        let is_known = !about.command.is_empty();
        let command = if is_known { open_ended(&about.command) } else { of_plan(header) };
        let mut words = without_out(&without_shard(&command));
        words.extend(about.device.iter().flat_map(|device| option("--device", device)));
        words.extend(option("--out", absolute.as_deref().unwrap_or(out).display()));
        Self { folder, variables: about.variables, words }
    }

    /// Returns the command for another device, without the environment variables of drivers, which the user had set
    /// for the attempt's own device.
    fn on(mut self, device: &str) -> Self {
        self.words = without(&self.words, "--device");
        self.words.extend(option("--device", device));
        self.variables.retain(|setting| sets_moved_samples(setting));
        self
    }

    /// Returns the command that measures failed points again.
    fn again(mut self) -> Self {
        self.words.retain(|word| !AGAIN.contains(&word.as_str()));
        self.words.extend(AGAIN.map(str::to_owned));
        self
    }

    /// Returns the command line that measures these shards, out of `of` shards in all.
    fn of_shards(&self, shards: &BTreeSet<u32>, of: u32) -> String {
        let words = command_line(self.variables.iter().filter(|setting| is_harmless(setting)), &self.words);
        let command = match shards.iter().copied().collect::<Vec<_>>()[..] {
            [one] => format!("{words} --shard {one}/{of}"),
            _ => {
                let numbers = shards.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
                format!("for shard in {numbers}; do {words} --shard $shard/{of}; done")
            }
        };
        match &self.folder {
            // The brackets start a subshell, so that the user's shell stays in its folder.
            Some(folder) => format!("(cd {} && {command})", quote(&folder.display().to_string())),
            None => command,
        }
    }
}

/// Returns true if the command may set a variable, given as `NAME=VALUE`. The user runs the command in a shell, and a
/// stranger may have written the file from which `setting` comes. Therefore, the command sets only
/// `RAYCL_MOVED_SAMPLES` and the variables that [`is_to_be_repeated`] accepts.
fn is_harmless(setting: &str) -> bool {
    sets_moved_samples(setting) || setting.split_once('=').is_some_and(|(name, _)| is_to_be_repeated(name))
}

/// Returns true if a setting, given as `NAME=VALUE`, sets `RAYCL_MOVED_SAMPLES`, the variable that decides which
/// samples count.
fn sets_moved_samples(setting: &str) -> bool {
    setting.split_once('=').is_some_and(|(name, _)| name == MOVED_SAMPLES)
}

/// Returns the command line that measures the experiment of a plan, with the config and the overrides in the plan's
/// header.
fn of_plan(header: &Header) -> Vec<String> {
    let set = header.overrides.iter().flat_map(|line| option("--set", line));
    ["raycl".to_owned(), "run".to_owned(), path_word(Path::new(&header.config))]
        .into_iter()
        .chain(set)
        .collect()
}

/// Returns a command line without the word `--`, after which no option can be added. The words after `--` are
/// paths; a path that begins with `-` gets `./` in front.
fn open_ended(command: &[String]) -> Vec<String> {
    let mut parts = command.splitn(2, |word| word == "--");
    let (options, paths) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    options.iter().cloned().chain(paths.iter().map(|path| path_word(Path::new(path)))).collect()
}

/// Returns the command line `command` with `raycl` in place of the program's path, and without the option
/// `--shard`.
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

/// Returns a command line without the option `--out` and its value. The short form `-o` may follow short
/// options without a value in the same word, as in `-qo DIR`. The options before the `o` stay.
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
    use super::super::KindPoint;
    use super::*;
    use crate::experiment::Block;
    use crate::record::PlannedPoint;

    fn kind(device: &str, identity: &str, points: &[usize]) -> Kind {
        let point = |point: &usize| KindPoint {
            point: *point,
            planned: PlannedPoint { key: format!("{identity} {point}"), ..PlannedPoint::default() },
        };
        let points = points.iter().map(point).collect();
        Kind { device: device.into(), identity: identity.into(), points, ..Kind::default() }
    }

    fn plan() -> ShardPlan {
        let block = |number: u32, points: &[usize]| Block {
            number,
            shard: number,
            points: points.to_vec(),
            control: None,
        };
        ShardPlan {
            header: Header {
                shards: 16,
                config: "my config.toml".into(),
                overrides: vec!["timing.seed = 7".into()],
                ..Header::default()
            },
            points: ["a", "b", "c"].map(str::to_owned).to_vec(),
            blocks: vec![block(3, &[0, 1]), block(7, &[2])],
            ..ShardPlan::default()
        }
    }

    /// Returns what is missing on the kinds of device `kinds`, all of which are selected.
    fn lacks(kinds: &[Kind], not_begun: &[String], has: &dyn Fn(&str) -> bool) -> Missing {
        let outcome = |key: &str| has(key).then_some(Outcome::Measured);
        missing(Path::new("o"), &plan(), Wanted { all: kinds, kinds, not_begun }, &[], &outcome)
    }

    #[test]
    fn each_device_is_named_once_even_if_another_one_comes_in_between() {
        let cpu = "cpu-znver4-AMD EPYC 9B45";
        let kinds = [kind("gpu", "0f", &[1]), kind(cpu, "a", &[1]), kind("gpu", "f3", &[1])];
        assert_eq!(names(&kinds), format!("gpu; AMD EPYC 9B45, PoCL ({cpu})"));
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
        let result = lacks(&kinds, &[], &|key| there.contains(&key));
        let [two] = &result.kinds[..] else { panic!("{result:?}") };
        assert_eq!((two.device.as_str(), two.points.len(), &two.shards[..]), ("gpu (2)", 2, &[3, 7][..]));
        // No attempt's command line is known, so the command is made from the plan.
        let command = "raycl run 'my config.toml' --set 'timing.seed = 7' --out o";
        assert_eq!(two.command, format!("for shard in 3 7; do {command} --shard $shard/16; done"));
        let result = lacks(&kinds[..1], &[], &|_| false);
        assert_eq!(result.kinds[0].command, format!("{command} --shard 3/16"));
        assert!(lacks(&[], &[], &|_| true).nothing_began);
    }

    #[test]
    fn a_kind_that_is_meant_and_has_not_begun_lacks_all_but_the_hosts_points() {
        let kinds = [kind(HOST, "amd", &[0]), kind("gpu", "1", &[1, 2])];
        let result = lacks(&kinds, &["h200".to_owned()], &|_| true);
        let [h200] = &result.kinds[..] else { panic!("{result:?}") };
        assert_eq!((h200.device.as_str(), h200.points.len(), h200.of), ("h200", 2, 2));
        let command = "raycl run 'my config.toml' --set 'timing.seed = 7' --out o --device h200";
        assert_eq!(h200.command, format!("for shard in 3 7; do {command} --shard $shard/16; done"));
        assert_eq!(result.took_part.as_deref(), Some("host; gpu"));
    }

    #[test]
    fn casters_on_a_host_that_has_not_begun_are_the_hosts_alone() {
        let all = [kind("gpu", "1", &[1, 2])];
        let wanted = Wanted { all: &all, kinds: &[], not_begun: &["h200".to_owned()] };
        let result = missing(Path::new("o"), &plan(), wanted, &[], &|_| Some(Outcome::Measured));
        let text = |kind: &MissingKind| format!("{} {:?} {:?}", kind.device, kind.points, kind.shards);
        let texts: Vec<_> = result.kinds.iter().map(text).collect();
        assert_eq!(texts, [r#"host ["a"] [3]"#, r#"h200 ["b", "c"] [3, 7]"#]);
        assert!(!result.nothing_began, "a shard on a gpu has begun");
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

    /// Returns the command that measures shard 3 of 4 after an attempt that was started with the command line `words`
    /// in `folder`. The results are in the folder `results` of the current folder.
    fn repeated(folder: Option<&Path>, device: Option<&str>, words: &[&str], again: bool) -> String {
        let about = About {
            folder: folder.map(|folder| folder.display().to_string()),
            device: device.map(str::to_owned),
            command: words.iter().map(|word| (*word).to_owned()).collect(),
            ..About::default()
        };
        let start = Start::of(Path::new("results"), &Header::default(), None, &[about]);
        let start = if again { start.again() } else { start };
        start.of_shards(&BTreeSet::from([3]), 4)
    }

    #[test]
    fn the_command_of_an_attempt_in_another_folder_runs_there_and_writes_to_the_same_folder() {
        let elsewhere = tempfile::tempdir().unwrap();
        let there = elsewhere.path().join("my configs");
        let words = ["raycl", "run", "a.toml", "--cl-dir", "cl", "--out", "../o", "--shard", "1/4"];
        let here = "raycl run a.toml --cl-dir cl --out results --shard 3/4";
        assert_eq!(repeated(Some(&there), None, &words, false), here, "the folder no longer exists");
        std::fs::create_dir(&there).unwrap();
        let current = std::env::current_dir().unwrap();
        let out = quote(&current.join("results").display().to_string());
        assert_eq!(
            repeated(Some(&there), None, &words, false),
            format!("(cd '{}' && raycl run a.toml --cl-dir cl --out {out} --shard 3/4)", there.display())
        );
        for folder in [Some(current.as_path()), None] {
            assert_eq!(repeated(folder, None, &words, false), here);
        }
    }

    #[test]
    fn the_command_names_the_default_device_and_a_config_that_begins_with_a_dash() {
        let words = ["raycl", "run", "--out", "o", "--shard", "1/4", "-q", "--", "-g.toml"];
        let expected = "raycl run -q ./-g.toml --device 'my gpu' --out results --shard 3/4";
        assert_eq!(repeated(None, Some("my gpu"), &words, false), expected);
    }

    #[test]
    fn the_command_sets_the_variables_that_the_user_had_set() {
        let variables = [
            "RAYCL_MOVED_SAMPLES=keep",
            "POCL_DEVICES=pthread basic",
            "POCL_MAX_PTHREAD_COUNT=1",
            "POCL_VECTORIZER_$(id)=1",
            "LD_PRELOAD=x.so",
        ];
        let about = About {
            variables: variables.map(str::to_owned).to_vec(),
            command: ["/x/raycl", "run", "a.toml"].map(str::to_owned).to_vec(),
            ..About::default()
        };
        let abouts = [about];
        let start = || Start::of(Path::new("o"), &Header::default(), None, &abouts);
        let command = "RAYCL_MOVED_SAMPLES=keep POCL_DEVICES='pthread basic' POCL_MAX_PTHREAD_COUNT=1 raycl run \
                       a.toml --out o";
        assert_eq!(start().of_shards(&BTreeSet::from([3]), 4), format!("{command} --shard 3/4"));
        let several = start().again().of_shards(&BTreeSet::from([2, 3]), 4);
        let again = format!("{command} --resume --retry-failed");
        assert_eq!(several, format!("for shard in 2 3; do {again} --shard $shard/4; done"));
        let other = start().on("h200").of_shards(&BTreeSet::from([3]), 4);
        assert_eq!(
            other, "RAYCL_MOVED_SAMPLES=keep raycl run a.toml --out o --device h200 --shard 3/4",
            "the drivers' variables were set for another device"
        );
    }

    #[test]
    fn failed_points_are_not_missing_and_are_measured_again_by_their_shards() {
        let kinds = [kind(HOST, "amd", &[0]), kind("gpu", "1", &[1, 2]), kind("gpu", "2", &[1, 2])];
        let outcome = |key: &str| match key {
            "1 1" => None,
            "1 2" => Some(Outcome::Crashed),
            "2 2" => Some(Outcome::Infeasible),
            _ => Some(Outcome::Measured),
        };
        let wanted = Wanted { all: &kinds, kinds: &kinds, not_begun: &[] };
        let result = missing(Path::new("o"), &plan(), wanted, &[], &outcome);
        let [failed] = &result.failed[..] else { panic!("{result:?}") };
        assert_eq!((failed.device.as_str(), &failed.points[..]), ("gpu (1)", &["c".to_owned()][..]));
        let command = "raycl run 'my config.toml' --set 'timing.seed = 7' --out o";
        assert_eq!(failed.command, format!("{command} --resume --retry-failed --shard 7/16"));
        assert_eq!((result.count(), result.kinds[0].points[0].as_str()), (1, "b"));
        // The attempt in this test was itself started with the options `--resume` and `--retry-failed`.
        let words = ["raycl", "run", "a.toml", "--resume", "--out", "o", "--retry-failed", "--shard=1/4"];
        let expected = "raycl run a.toml --out results --resume --retry-failed --shard 3/4";
        assert_eq!(repeated(None, None, &words, true), expected);
    }

    #[test]
    fn points_with_a_wrong_image_are_not_measured_again() {
        let kinds = [kind("gpu", "1", &[0, 1, 2])];
        let outcome = |key: &str| match key {
            "1 0" => Some(Outcome::WrongImage),
            "1 1" => Some(Outcome::Crashed),
            _ => Some(Outcome::Measured),
        };
        let wanted = Wanted { all: &kinds, kinds: &kinds, not_begun: &[] };
        let result = missing(Path::new("o"), &plan(), wanted, &[], &outcome);
        let [failed] = &result.failed[..] else { panic!("{result:?}") };
        assert_eq!((&failed.points[..], failed.of), (&["b".to_owned()][..], 3));
        assert!(result.is_empty(), "{result:?}");
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
    fn a_kinds_command_is_that_of_an_attempt_on_it_and_a_host_is_named_once() {
        let abouts = [("1", "one"), ("2", "other")].map(|(identity, device)| {
            let words = ["raycl", "run", "-o", "its old path", "--device", device, "--shard", "1/16"];
            About {
                host: device.into(),
                devices: vec![identity.into()],
                command: words.map(str::to_owned).to_vec(),
                ..About::default()
            }
        });
        let kinds = [
            kind(HOST, "amd", &[0]),
            kind(HOST, "intel", &[0]),
            kind("gpu", "1", &[2]),
            kind("gpu", "2", &[2]),
        ];
        let wanted = Wanted { all: &kinds, kinds: &kinds, not_begun: &[] };
        let now = Path::new("my results");
        let result = missing(now, &plan(), wanted, &abouts, &|_| None);
        let commands: Vec<_> =
            result.kinds.iter().map(|kind| (kind.device.as_str(), kind.command.as_str())).collect();
        let expected = [
            (HOST, "raycl run --device one --out 'my results' --shard 3/16"),
            ("gpu (1)", "raycl run --device one --out 'my results' --shard 7/16"),
            ("gpu (2)", "raycl run --device other --out 'my results' --shard 7/16"),
        ];
        assert_eq!((commands, result.count()), (expected.to_vec(), 3));
        let not_begun = ["tpu".to_owned()];
        let wanted = Wanted { all: &kinds, kinds: &kinds[..2], not_begun: &not_begun };
        let result = missing(now, &plan(), wanted, &abouts, &|_| Some(Outcome::Measured));
        assert_eq!(result.took_part.as_deref(), Some("host; gpu"));
    }
}
