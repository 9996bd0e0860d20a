//! Describes the machines, programs and commands of runs on a page, so that readers can repeat these runs.

use crate::entry::entry;
use crate::record::journals::earlier_environment;
use crate::record::{Folder, Record};
use crate::words::{counted, quote};
use serde_json::Value;

/// The environment of a folder of results (the file `environment.json`), as a page shows it.
#[derive(Clone, Debug, Default)]
pub struct EnvironmentView {
    /// The folder's label.
    pub label: String,
    /// The command that repeats the run.
    pub command: String,
    /// A text with the version of raycl that wrote the environment, and the commands that build this version
    /// again, or the reason why this version cannot be built again. If other commits of raycl measured some
    /// of the records, the text also lists the commits of all records.
    pub program: String,
    /// The text of the run's config.
    pub config: String,
    /// All further values of the environment: for each heading, pairs of name and value.
    pub sections: Vec<(String, Vec<(String, String)>)>,
}

/// The OpenCL programs of one strategy.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// The strategy's name.
    pub name: String,
    /// The value of every axis of the strategy.
    pub strategy: String,
    /// The hashes of the strategy's programs. A hash covers the source, the defines and the build options, so
    /// programs for different local sizes and scenes can have different hashes.
    pub hashes: Vec<String>,
}

/// Returns a folder's environment as a page shows it.
pub fn view(folder: &Folder) -> EnvironmentView {
    let environment = &folder.environment;
    let mut view = EnvironmentView {
        label: folder.label.clone(),
        command: command(environment),
        program: program_of(folder),
        config: environment["config"].as_str().unwrap_or_default().to_owned(),
        ..EnvironmentView::default()
    };
    let mut run: Vec<(String, String)> = sessions(folder).into_iter().collect();
    for (key, value) in environment.as_object().into_iter().flatten() {
        match value {
            Value::Object(_) => view.sections.push((words(key), facts(value))),
            Value::Array(items) if key == "sources" => {
                view.sections.push(("input files".to_owned(), items.iter().map(source).collect()));
            }
            Value::Array(items) if items.iter().any(Value::is_object) => {
                let name =
                    |item: &Value| item["device"].as_str().or(item["name"].as_str()).unwrap_or("").to_owned();
                view.sections
                    .extend(items.iter().map(|item| (format!("{} {}", words(key), name(item)), facts(item))));
            }
            _ if ["config", "command_line"].contains(&key.as_str()) => {}
            scalar => run.push((words(key), plain(scalar))),
        }
    }
    view.sections.insert(0, ("run".to_owned(), run));
    view
}

/// Returns the name "sessions", and a text with the number of a run's sessions and the files that describe
/// the earlier sessions. Returns `None` if the run had only one session.
fn sessions(folder: &Folder) -> Option<(String, String)> {
    let is_there = |number: &usize| folder.path.join(earlier_environment(*number)).is_file();
    let earlier = (1..).take_while(is_there).count();
    let first = earlier_environment(1);
    let described = match earlier {
        0 => return None,
        1 => format!("{first} describes the earlier session"),
        _ => format!("{first} to {} describe the earlier sessions", earlier_environment(earlier)),
    };
    Some(("sessions".to_owned(), format!("{}; {described}", earlier + 1)))
}

/// Describes the version of raycl that wrote a folder's environment: the version of the last session or, in a
/// merged folder, of the first attempt. If other commits of raycl measured some of the records, the text also
/// lists the commits of all records.
fn program_of(folder: &Folder) -> String {
    let last = program(&folder.environment);
    let own = folder.environment["git_revision"].as_str();
    let mut counts: Vec<(&str, usize)> = Vec::new();
    for revision in folder.records.iter().filter_map(|record| record.revision.as_deref().or(own)) {
        entry(&mut counts, |(known, _)| *known == revision, || (revision, 0)).1 += 1;
    }
    if counts.iter().all(|(revision, _)| Some(*revision) == own) {
        return last;
    }
    let of = |(revision, count): &(&str, usize)| {
        let (commit, changes) = match revision.strip_suffix("-dirty") {
            Some(commit) => (commit, " with uncommitted changes"),
            None => (*revision, ""),
        };
        format!("{commit}{changes} ({})", counted(*count, "record"))
    };
    let all: Vec<String> = counts.iter().map(of).collect();
    let all = all.join(", ");
    format!("These commits of raycl measured the records: {all}. The environment was written by {last}")
}

/// Returns a text with the version and the commit of raycl that wrote an environment, and how to build this
/// commit again.
fn program(environment: &Value) -> String {
    let version = environment["raycl_version"].as_str().unwrap_or("of an unknown version");
    match environment["git_revision"].as_str().map(|revision| (revision.trim_end_matches("-dirty"), revision))
    {
        Some((commit, revision)) if commit == revision => {
            format!("raycl {version}; to build it again: git checkout {commit}, then make build")
        }
        Some((commit, _)) => {
            format!("raycl {version}, commit {commit} with uncommitted changes, so it cannot be built again")
        }
        None => format!("raycl {version}, built from an unknown commit"),
    }
}

/// Returns two texts about an input file of the run: its kind (such as "scene") and path, and its commit and
/// the beginning of its hash.
fn source(source: &Value) -> (String, String) {
    let text = |key: &str| source[key].as_str();
    let name = format!("{} {}", text("what").unwrap_or_default(), text("path").unwrap_or_default());
    let hash = text("hash").map(|hash| format!("hash {}", hash.get(..12).unwrap_or(hash)));
    let git = match (text("path"), text("git")) {
        (Some("built in"), _) => None,
        (_, git) => Some(git.map_or("in no git repository".to_owned(), |git| format!("commit {git}"))),
    };
    let facts: Vec<_> = git.into_iter().chain(hash).collect();
    (name, facts.join("; ").replace("commit in no", "in no"))
}

/// Returns the run's command for a shell, without `--resume` and `--retry-failed`, since a new run has nothing to
/// continue.
fn command(environment: &Value) -> String {
    let arguments = environment["command_line"].as_array().into_iter().flatten().filter_map(Value::as_str);
    let quoted: Vec<_> = arguments
        .filter(|argument| !["--resume", "--retry-failed"].contains(argument))
        .enumerate()
        // The path of the program raycl differs between machines, so the command begins with the name "raycl"
        // alone.
        .map(|(index, argument)| if index == 0 { "raycl".to_owned() } else { quote(argument) })
        .collect();
    quoted.join(" ")
}

fn facts(value: &Value) -> Vec<(String, String)> {
    let entries = value.as_object().into_iter().flatten();
    entries.flat_map(|(key, value)| fact(&words(key), value)).collect()
}

fn fact(key: &str, value: &Value) -> Vec<(String, String)> {
    match value {
        Value::Object(map) => {
            map.iter().flat_map(|(inner, value)| fact(&format!("{key}, {}", words(inner)), value)).collect()
        }
        scalar => vec![(key.to_owned(), plain(scalar))],
    }
}

fn plain(value: &Value) -> String {
    match value {
        Value::Null => "unknown".into(),
        Value::String(text) => text.clone(),
        Value::Array(items) => items.iter().map(plain).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}

fn words(key: &str) -> String {
    key.replace("_mhz", ", MHz").replace('_', " ")
}

/// Returns the OpenCL programs of each strategy, in the order of the strategies' first records. Baselines
/// have no OpenCL programs.
pub fn programs(records: &[Record]) -> Vec<Program> {
    let mut programs: Vec<Program> = Vec::new();
    for record in records.iter().filter(|record| !record.is_baseline()) {
        let same = |known: &Program| known.name == record.name && known.strategy == record.strategy;
        let new =
            || Program { name: record.name.clone(), strategy: record.strategy.clone(), hashes: Vec::new() };
        let hashes = &mut entry(&mut programs, same, new).hashes;
        hashes.extend(record.program_hash.clone().filter(|hash| !hashes.contains(hash)));
    }
    programs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_can_be_pasted_into_a_shell() {
        let folder = Folder {
            environment: serde_json::json!({
                "command_line": ["target/debug/raycl", "run", "a b.toml", "--set", "image_sizes=[[160,100]]",
                                 "it's", "--resume", "--retry-failed"],
                "raycl_version": "1", "git_revision": "abc-dirty",
                "sources": [{"what": "config", "path": "a b.toml", "hash": "0123456789abcdef", "git": "abc, unchanged"},
                            {"what": "kernels", "path": "built in", "hash": "4567", "git": null}],
                "host": {"cpu": "EPYC", "clocks": {"now_mhz": 2450}},
                "devices": [{"device": "gpu", "driver": "1"}],
            }),
            ..Folder::default()
        };
        let view = view(&folder);
        assert_eq!(view.program, "raycl 1, commit abc with uncommitted changes, so it cannot be built again");
        let made_of = &view.sections.iter().find(|(name, _)| name == "input files").expect("files").1;
        assert_eq!(made_of[0], ("config a b.toml".into(), "commit abc, unchanged; hash 0123456789ab".into()));
        assert_eq!(made_of[1], ("kernels built in".into(), "hash 4567".into()));
        assert_eq!(view.command, r"raycl run 'a b.toml' --set 'image_sizes=[[160,100]]' 'it'\''s'");
        let host = &view.sections.iter().find(|(name, _)| name == "host").expect("a host").1;
        assert!(host.contains(&("clocks, now, MHz".into(), "2450".into())), "{host:?}");
        assert!(view.sections.iter().any(|(name, _)| name == "devices gpu"));
    }

    #[test]
    fn a_program_is_built_again_from_its_commit_if_it_has_one() {
        let text = |revision: Option<&str>| {
            program(&serde_json::json!({"raycl_version": "1", "git_revision": revision}))
        };
        assert_eq!(text(Some("abc")), "raycl 1; to build it again: git checkout abc, then make build");
        assert!(text(Some("abc-dirty")).contains("with uncommitted changes"));
        assert_eq!(text(None), "raycl 1, built from an unknown commit");
    }

    #[test]
    fn records_of_other_commits_than_that_of_the_last_session_are_counted_by_commit() {
        let of = |revisions: &[Option<&str>]| {
            let record = |revision: &Option<&str>| Record {
                revision: revision.map(str::to_owned),
                ..Record::default()
            };
            let environment = serde_json::json!({"raycl_version": "1", "git_revision": "b"});
            program_of(&Folder {
                environment,
                records: revisions.iter().map(record).collect(),
                ..Folder::default()
            })
        };
        let last = "raycl 1; to build it again: git checkout b, then make build";
        assert_eq!([of(&[]), of(&[Some("b"), None])], [last; 2]);
        let others = of(&[Some("a"), Some("c-dirty"), None, Some("a")]);
        let commits = "a (2 records), c with uncommitted changes (1 record), b (1 record)";
        let expected = format!(
            "These commits of raycl measured the records: {commits}. The environment was written by {last}"
        );
        assert_eq!(others, expected);
    }

    #[test]
    fn a_run_of_several_sessions_names_the_files_of_the_earlier_ones() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = Folder { path: temporary.path().to_owned(), ..Folder::default() };
        let said = || {
            let run = view(&folder).sections.swap_remove(0).1;
            run.into_iter().find(|(name, _)| name == "sessions").map(|(_, value)| value)
        };
        let mut found = vec![said()];
        for number in [1, 2] {
            std::fs::write(temporary.path().join(earlier_environment(number)), "{}").unwrap();
            found.push(said());
        }
        let expected = [
            "2; environment-1.json describes the earlier session",
            "3; environment-1.json to environment-2.json describe the earlier sessions",
        ];
        assert_eq!(found, [None, Some(expected[0].to_owned()), Some(expected[1].to_owned())]);
    }

    #[test]
    fn a_file_outside_a_repository_says_so_and_a_long_hash_is_shortened() {
        let file = serde_json::json!({"what": "scene", "path": "a.toml", "hash": "0123456789abcdef"});
        assert_eq!(source(&file), ("scene a.toml".into(), "in no git repository; hash 0123456789ab".into()));
    }

    #[test]
    fn a_program_has_each_of_its_hashes_once_and_baselines_are_none() {
        let of = |name: &str, strategy: &str, hash: &str| Record {
            name: name.into(),
            strategy: strategy.into(),
            program_hash: Some(hash.into()),
            device: "gpu".into(),
            ..Record::default()
        };
        let records = [
            of("naive", "width=1", "a"),
            of("wide", "width=4", "b"),
            of("naive", "width=1", "c"),
            of("naive", "width=1", "a"),
            of("naive", "width=2", "d"),
            Record { program_hash: None, ..of("bvh", "traversal=bvh", "") },
            Record { device: crate::record::HOST.into(), ..of("serial", "serial-f32", "e") },
        ];
        let program = |name: &str, strategy: &str, hashes: &[&str]| Program {
            name: name.into(),
            strategy: strategy.into(),
            hashes: hashes.iter().map(|hash| (*hash).to_owned()).collect(),
        };
        assert_eq!(
            programs(&records),
            [
                program("naive", "width=1", &["a", "c"]),
                program("wide", "width=4", &["b"]),
                program("naive", "width=2", &["d"]),
                program("bvh", "traversal=bvh", &[]),
            ]
        );
    }
}
