//! Reads folders of results. All code that displays results uses [`Folder`], which contains only records of
//! the folder's current plan (the list of the points of the latest run in the folder). If a folder has no plan,
//! [`Folder`] contains the latest record of each point.

mod notes;

use super::anchors::{AnchorSample, name_devices};
use super::journal::{FOLDER, read_lines_if_any};
use super::journals::{ANCHORS, CONTROLS, ENVIRONMENT, RECORDS, ROUNDS, SHARDS, SUMMARY};
use super::plan::CurrentPlan;
use super::rounds::RoundLoad;
use super::scenes::tell_scenes_apart;
use super::together::judge;
use super::types::Record;
use super::{Lines, read_lines, summary_csv, summary_markdown, write_whole};
use crate::error::{Error, Result};
use crate::existing;
use crate::reader;
use crate::words::{path_word, quote};
use notes::{NO_ENVIRONMENT, TORN, certainty, dirty, of_config, of_merge};
use serde_json::Value;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

/// The file in which `raycl merge` describes the attempts that it merged into a folder.
pub const MERGE: &str = "merge.json";

/// The results in a folder: the records of a run, and the conditions under which the records were measured.
#[derive(Clone, Debug, Default)]
pub struct Folder {
    /// The folder's path.
    pub path: PathBuf,
    /// The run's name in reports, which is the folder's name.
    pub label: String,
    /// The records of the current plan's points, in the plan's order and with the plan's names. A point has one
    /// record, or none if it is not measured yet. Without a plan, `records` has the latest record of every point.
    /// If scenes with different contents have the same name, each of these scenes has a new name in `records`.
    pub records: Vec<Record>,
    /// Records that serve only to compare the blocks of a plan. They are records of control points (points that
    /// every block measures). The field `records` does not contain the records in `controls`.
    pub controls: Vec<Record>,
    /// The contents of `environment.json`, unchanged, so that fields of a newer version of raycl are shown too; null if
    /// the file cannot be read.
    pub environment: Value,
    /// The load of other processes on the machine while the rounds of launches were timed.
    pub rounds: Vec<RoundLoad>,
    /// Times of the anchors (kernels that never change) that were measured together with the points.
    pub anchors: Vec<AnchorSample>,
    /// Notes that raycl shows with the results, for example a note about records that raycl does not show.
    pub notes: Vec<String>,
    /// The notes that count the damaged lines of journals. The notes on damaged lines are also contained in
    /// `notes`.
    pub damage: Vec<String>,
}

impl Folder {
    /// Reads a folder of results; `path` names the folder or its journal of records. Returns an input error
    /// (a mistake of the user) if the folder has no journal of records.
    pub fn read(path: &Path) -> Result<Self> {
        let (folder, lines) = read_journal(path)?;
        let environment = environment(folder);
        let plan = CurrentPlan::read(folder)?;
        let plan = plan.as_ref();
        let controls = read_lines_if_any::<Record>(&folder.join(CONTROLS))?;
        let anchors = anchors(folder, plan, lines.lines.iter().chain(&controls.lines))?;
        let rounds = read_lines_if_any::<RoundLoad>(&folder.join(ROUNDS))?;
        let damage: Vec<String> = lines
            .damage(RECORDS)
            .into_iter()
            .chain(controls.damage(CONTROLS))
            .chain(rounds.damage(ROUNDS))
            .chain(anchors.damage(ANCHORS))
            .collect();
        let Shown { records, notes: of_shown } = Shown::of(lines.lines, plan);
        let (records, controls) = judged(records, shown_controls(controls.lines, plan));
        let rounds = rounds.lines;
        let notes = certainty(&records, &controls, &rounds)
            .into_iter()
            .chain(of_merge(folder))
            .chain(of_config(environment.as_ref()))
            .chain(of_shown)
            .chain(dirty(&records, environment.as_ref()))
            .chain(lines.torn.then(|| TORN.to_owned()))
            .chain(damage.iter().cloned())
            .chain(environment.is_none().then(|| NO_ENVIRONMENT.to_owned()))
            .collect();
        Ok(Self {
            path: folder.to_owned(),
            label: label(folder),
            records,
            controls,
            environment: environment.unwrap_or_default(),
            rounds,
            anchors: anchors.lines,
            notes,
            damage,
        })
    }

    /// Returns the value of a top-level key in the run's config, if the value is a text. If options `--set` give the
    /// key a text, returns the text from the last of them. Returns `None` if neither the config nor `--set` gives the
    /// key a text.
    pub fn config(&self, key: &str) -> Option<String> {
        let overrides = self.environment["overrides"].as_array().into_iter().flatten().rev();
        overrides.chain([&self.environment["config"]]).find_map(|text| {
            let table: toml::Table = toml::from_str(text.as_str()?).ok()?;
            Some(table.get(key)?.as_str()?.to_owned())
        })
    }

    /// Returns the question and the expectation that the run's config states. If the config states no
    /// question, returns the name of the config's file as the question or, if this name is unknown, the
    /// folder's label. If the config states no expectation, returns an empty expectation.
    pub fn question(&self) -> (String, String) {
        let name =
            || Some(Path::new(self.environment["config_path"].as_str()?).file_stem()?.to_str()?.to_owned());
        let question = self.config("question").or_else(name).unwrap_or_else(|| self.label.clone());
        (question, self.config("expectation").unwrap_or_default())
    }

    /// Writes the folder's records to `summary.md` and `summary.csv`.
    pub fn summarise(&self, question: &str, expectation: &str) -> Result<()> {
        let markdown = summary_markdown(&self.records, &self.notes, question, expectation);
        write_whole(&self.path.join(SUMMARY), markdown.as_bytes())?;
        write_whole(&self.path.join("summary.csv"), &summary_csv(&self.records)?)
    }
}

/// Returns the error for a path without a journal of records. If shards in the folder are not merged yet, or no folder
/// is at the path, the error says so.
pub fn no_results(path: &Path) -> Error {
    match existing::exists(path) {
        Ok(true) if path.is_file() => return not_a_folder(path, FOLDER),
        Ok(true) => {}
        Ok(false) => return Error::no_folder(path, FOLDER),
        Err(error) => return error,
    }
    if path.join(SHARDS).is_file() {
        return Error::input(format!("{} holds shards that are not merged yet", path.display()))
            .with_help(format!("first merge them: raycl merge {}", quote(&path_word(path))));
    }
    Error::input(format!("{} holds no results: {RECORDS} is missing", path.display())).with_help(FOLDER)
}

/// Returns the error for something else, such as a file, in the place of a folder of results. If the file is in a
/// folder of results, the remedy names this folder; otherwise, the remedy is the text `otherwise`.
pub fn not_a_folder(path: &Path, otherwise: &str) -> Error {
    let folder = reader::folder_of(path);
    match [RECORDS, SHARDS].iter().any(|name| folder.join(name).is_file()) {
        true => {
            Error::input(format!("{} is a file in a folder of results; expected the folder", path.display()))
                .with_help(format!("give the path of the folder: {}", quote(&path_word(folder))))
        }
        false => Error::input(format!("{} is not a folder", path.display())).with_help(otherwise),
    }
}

/// Reads the journal of records of a folder of results; `path` names the folder or the journal. Returns the
/// folder's path and the records.
fn read_journal(path: &Path) -> Result<(&Path, Lines<Record>)> {
    let is_journal = existing::is_file(path)?;
    let (folder, journal) = match is_journal {
        true => (path.parent().unwrap_or(Path::new("")), path.to_owned()),
        false => (path, path.join(RECORDS)),
    };
    if !existing::is_file(&journal)? {
        return Err(no_results(path));
    }
    let lines = match is_journal {
        true => read_lines(&journal)?.refuse_if_all_damaged(&journal)?,
        false => read_records(folder)?,
    };
    Ok((folder, lines))
}

/// Reads a folder's journal of records. Returns an input error (a mistake of the user) if the folder has no
/// plan (`plan.json`), and the journal has damaged lines but no line that can be read. Such a journal was
/// probably not written by raycl.
pub fn read_records(folder: &Path) -> Result<Lines<Record>> {
    let journal = folder.join(RECORDS);
    let lines = read_lines(&journal)?;
    if CurrentPlan::is_in(folder) { Ok(lines) } else { lines.refuse_if_all_damaged(&journal) }
}

/// Reads the journal of anchors. If the folder has a plan (`plan.json`), replaces the names of the anchors' devices by
/// the names in the plan. `records` are all stored records.
fn anchors<'a>(
    folder: &Path,
    plan: Option<&CurrentPlan>,
    records: impl Iterator<Item = &'a Record>,
) -> Result<Lines<AnchorSample>> {
    let mut anchors = read_lines_if_any::<AnchorSample>(&folder.join(ANCHORS))?;
    if let Some(plan) = plan {
        name_devices(&mut anchors.lines, plan, records);
    }
    Ok(anchors)
}

/// Returns the contents of `environment.json`; `None` if the file cannot be read.
fn environment(folder: &Path) -> Option<Value> {
    let text = reader::bytes(&folder.join(ENVIRONMENT), reader::Kind::Results).ok()?;
    serde_json::from_slice(&text).ok()
}

/// The records of a folder that raycl shows, and notes on the records that raycl does not show.
struct Shown {
    records: Vec<Record>,
    notes: Vec<String>,
}

impl Shown {
    fn of(lines: Vec<Record>, plan: Option<&CurrentPlan>) -> Self {
        let all = latest(lines, |record| record.key.clone());
        let count = all.len();
        let mut notes = Vec::new();
        let mut records = match plan {
            Some(plan) => {
                let by_key: HashMap<_, _> =
                    all.into_iter().map(|record| (record.key.clone(), record)).collect();
                let (picked, missing) = plan.pick(by_key);
                notes.extend(counted(
                    missing,
                    "point of the plan is not measured yet.",
                    "points of the plan are not measured yet.",
                ));
                picked
            }
            None => latest(all, |record| format!("{:?} {}", record.scene_hash, point(record))),
        };
        let [one, several] = match plan.is_some() {
            true => ["record of an earlier plan is stored", "records of earlier plans are stored"],
            false => ["earlier record of a point is stored", "earlier records of points are stored"],
        };
        let but = |words: &str| format!("{words} but not shown.");
        notes.extend(counted(count - records.len(), &but(one), &but(several)));
        tell_scenes_apart(&mut records);
        Self { records, notes }
    }
}

/// Returns the records of control points that belong to the plan (`plan.json`), with the plan's names. If the
/// folder has no plan, returns the records of all control points (points that every block of a group
/// measures). A control point has a record for each block that measured it, and these records have different
/// launches. If a control point has several records with the same launches, returns only the last of these
/// records.
fn shown_controls(lines: Vec<Record>, plan: Option<&CurrentPlan>) -> Vec<Record> {
    let launches = |record: &Record| record.sample_launches.iter().copied().collect::<BTreeSet<_>>();
    let each = latest(lines, |record| format!("{} {:?}", record.key, launches(record)));
    match plan {
        Some(plan) => each.into_iter().filter_map(|record| plan.named(record)).collect(),
        None => each,
    }
}

/// Computes the relative times of `records`, and of `controls` (records of control points, which every block
/// measures). The records in `records` and in `controls` are compared with each other, too.
fn judged(mut records: Vec<Record>, controls: Vec<Record>) -> (Vec<Record>, Vec<Record>) {
    let count = records.len();
    records.extend(controls);
    judge(&mut records);
    let controls = records.split_off(count);
    (records, controls)
}

/// Returns a text with the count, followed by `one` if the count is 1, and by `several` if the count is
/// larger. Returns `None` if the count is 0.
fn counted(count: usize, one: &str, several: &str) -> Option<String> {
    (count > 0).then(|| format!("{count} {}", if count == 1 { one } else { several }))
}

fn label(path: &Path) -> String {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    whole.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// Returns the records without repetitions. `name` returns a text that identifies a record, such as the
/// record's key. Of several records with the same text, only the last is returned. The records are returned
/// in the order in which their identifying texts first occur.
pub fn latest(records: Vec<Record>, name: impl Fn(&Record) -> String) -> Vec<Record> {
    let mut indices: HashMap<String, usize> = HashMap::new();
    let mut newest: Vec<Record> = Vec::new();
    for record in records {
        let name = name(&record);
        match indices.get(&name) {
            Some(&index) => newest[index] = record,
            None => {
                indices.insert(name, newest.len());
                newest.push(record);
            }
        }
    }
    newest
}

/// Returns a text that identifies a record's point by its names and sizes.
pub fn point(record: &Record) -> String {
    format!(
        "{}|{}|{:?}|{}|{:?}",
        record.scene, record.device, record.image_size, record.name, record.local_size
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::JsonLines;

    fn record(key: &str, name: &str, median_ms: f64) -> Record {
        Record {
            key: key.into(),
            scene: "teapot".into(),
            device: "gpu".into(),
            name: name.into(),
            median_ms: Some(median_ms),
            ..Record::default()
        }
    }

    fn folder(records: &[Record]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let mut journal = JsonLines::append_to(&folder.path().join(RECORDS)).unwrap();
        records.iter().for_each(|record| journal.append(record).unwrap());
        folder
    }

    fn shown(folder: &tempfile::TempDir) -> (Vec<(String, Option<f64>)>, Vec<String>) {
        let read = Folder::read(folder.path()).unwrap();
        (read.records.into_iter().map(|record| (record.name, record.median_ms)).collect(), read.notes)
    }

    #[test]
    fn a_folder_with_a_plan_shows_its_points_by_its_names() {
        let folder =
            folder(&[record("a", "bvh", 1.0), record("b", "deferred", 2.0), record("b", "deferred", 3.0)]);
        let plan = [record("c", "naive", 0.0), record("b", "renamed", 0.0), record("b", "twin", 0.0)];
        CurrentPlan::of(&plan).write(folder.path()).unwrap();
        let (records, notes) = shown(&folder);
        assert_eq!(records, [("renamed".to_owned(), Some(3.0))]);
        assert!(notes[0].starts_with("1 point of the plan is not measured"), "{notes:?}");
        assert_eq!(notes[1], "1 record of an earlier plan is stored but not shown.");
    }

    #[test]
    fn a_folder_without_a_plan_shows_the_latest_record_of_each_point() {
        let folder =
            folder(&[record("a", "bvh", 1.0), record("b", "deferred", 2.0), record("c", "bvh", 3.0)]);
        let (records, notes) = shown(&folder);
        assert_eq!(records, [("bvh".to_owned(), Some(3.0)), ("deferred".to_owned(), Some(2.0))]);
        assert!(notes[0].starts_with("1 earlier record of a point is stored but"), "{notes:?}");
        std::fs::write(folder.path().join("plan.json"), "{").unwrap();
        assert_eq!(Folder::read(folder.path()).unwrap_err().exit_code(), 2);
    }

    #[test]
    fn without_a_plan_scenes_of_one_name_do_not_hide_each_other() {
        let of = |hash: &str, ms| Record { scene_hash: Some(hash.into()), ..record(hash, "bvh", ms) };
        let (records, _) = shown(&folder(&[of("a", 1.0), of("b", 2.0), of("a", 3.0)]));
        let mut times: Vec<_> = records.into_iter().map(|(_, ms)| ms).collect();
        times.sort_by(|a, b| a.partial_cmp(b).unwrap());
        assert_eq!(times, [Some(2.0), Some(3.0)]);
    }

    #[test]
    fn a_tree_that_was_changed_is_said() {
        let dirty = Record { revision: Some("0123-dirty".into()), ..record("a", "bvh", 1.0) };
        let clean = Record { revision: Some("0123".into()), ..record("b", "naive", 1.0) };
        let (_, notes) = shown(&folder(&[dirty, clean]));
        assert!(notes[0].starts_with("1 of 2 records come from"), "{notes:?}");
    }

    #[test]
    fn a_records_own_revision_goes_before_the_environments() {
        let of = |name: &str, revision: Option<&str>| Record {
            revision: revision.map(str::to_owned),
            ..record(name, name, 1.0)
        };
        let folder = folder(&[of("bvh", Some("0123")), of("naive", Some("0123-dirty")), of("wide", None)]);
        for (environment, expected) in
            [("4567", "1 of 3 records come"), ("4567-dirty", "2 of 3 records come")]
        {
            let text = serde_json::json!({"git_revision": environment}).to_string();
            std::fs::write(folder.path().join("environment.json"), text).unwrap();
            let (_, notes) = shown(&folder);
            assert!(notes.iter().any(|note| note.starts_with(expected)), "{environment}: {notes:?}");
        }
    }

    #[test]
    fn a_folder_without_records_is_a_mistake_that_names_it() {
        let error = Folder::read(Path::new("/nonexistent/x")).expect_err("it is not there");
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("/nonexistent/x"));
    }

    #[test]
    fn a_journal_that_is_missing_has_no_lines() {
        let folder = folder(&[record("a", "bvh", 1.0)]);
        let lines = |name: &str| read_lines_if_any::<Record>(&folder.path().join(name)).unwrap().lines.len();
        assert_eq!([lines(RECORDS), lines("missing.jsonl")], [1, 0]);
    }

    #[test]
    fn results_are_read_by_the_name_of_their_folder_or_of_their_journal() {
        let folder = folder(&[record("a", "bvh", 1.0)]);
        let names = |path: &Path| -> Vec<String> {
            Folder::read(path).unwrap().records.into_iter().map(|record| record.name).collect()
        };
        assert_eq!([names(folder.path()), names(&folder.path().join(RECORDS))], [["bvh"], ["bvh"]]);
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_that_cannot_be_opened_is_not_said_to_hold_no_results() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("results");
        std::os::unix::fs::symlink(&folder, &folder).unwrap();
        let error = Folder::read(&folder).expect_err("the link leads to itself").to_string();
        assert!(error.starts_with(&format!("cannot read {}", folder.display())), "{error}");
    }

    #[test]
    fn a_folder_of_something_else_is_said_to_hold_no_results() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("notes.txt"), "a").unwrap();
        let error = Folder::read(folder.path()).expect_err("it has no journal").to_string();
        let expected = format!("{} holds no results: records.jsonl is missing", folder.path().display());
        assert_eq!(error, expected);
    }

    #[test]
    fn a_file_in_the_place_of_a_folder_of_results_is_answered_with_its_folder() {
        let folder = folder(&[record("a", "bvh", 1.0)]);
        let journal = folder.path().join(RECORDS);
        let error = no_results(&journal);
        let expected = format!("{} is a file in a folder of results; expected the folder", journal.display());
        assert_eq!((error.exit_code(), error.to_string()), (2, expected));
        assert_eq!(error.remedy(), format!("give the path of the folder: {}", folder.path().display()));
        let other = tempfile::tempdir().unwrap();
        let file = other.path().join("notes.txt");
        std::fs::write(&file, "a").unwrap();
        let error = no_results(&file);
        assert_eq!(error.to_string(), format!("{} is not a folder", file.display()));
        assert_eq!(error.remedy(), FOLDER);
    }

    #[test]
    fn a_misspelt_folder_of_results_is_answered_with_the_folder_beside_it() {
        let parent = tempfile::tempdir().unwrap();
        let [there, missing] = ["quick", "quik"].map(|name| parent.path().join(name));
        std::fs::create_dir(&there).unwrap();
        let error = Folder::read(&missing).expect_err("it is missing");
        assert_eq!(error.to_string(), format!("there is no folder {}", missing.display()));
        assert_eq!(error.remedy(), format!("did you mean `{}`?", there.display()));
        assert_eq!(no_results(&parent.path().join("other")).remedy(), FOLDER);
    }

    #[test]
    fn a_folder_of_shards_that_are_not_merged_is_answered_with_the_merge() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("my shards");
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join("shards.json"), "{}").unwrap();
        let error = Folder::read(&folder).expect_err("it is not merged");
        let name = folder.display().to_string();
        assert_eq!(error.to_string(), format!("{name} holds shards that are not merged yet"));
        assert_eq!(error.remedy(), format!("first merge them: raycl merge '{name}'"));
    }

    #[test]
    fn points_that_differ_in_one_name_or_size_are_all_shown() {
        let one = || Record { local_size: Some([8, 2]), image_size: [80, 50], ..record("0", "bvh", 1.0) };
        let others = [
            Record { key: "1".into(), scene: "room".into(), ..one() },
            Record { key: "2".into(), device: "cpu".into(), ..one() },
            Record { key: "3".into(), image_size: [50, 80], ..one() },
            Record { key: "4".into(), name: "naive".into(), ..one() },
            Record { key: "5".into(), local_size: Some([2, 8]), ..one() },
        ];
        let (records, _) = shown(&folder(&[&[one()], &others[..]].concat()));
        assert_eq!(records.len(), 6, "{records:?}");
    }

    #[test]
    fn every_journal_of_a_folder_is_read_and_damage_to_each_is_reported() {
        let folder = folder(&[record("a", "bvh", 1.0)]);
        let path = |name: &str| folder.path().join(name);
        JsonLines::append_to(&path(CONTROLS)).unwrap().append(&record("c", "naive", 2.0)).unwrap();
        JsonLines::append_to(&path(ROUNDS))
            .unwrap()
            .append(&RoundLoad { launch: 3, ..RoundLoad::default() })
            .unwrap();
        let anchor = AnchorSample { anchor: "one".into(), ..AnchorSample::default() };
        JsonLines::append_to(&path(ANCHORS)).unwrap().append(&anchor).unwrap();
        let read = Folder::read(folder.path()).unwrap();
        assert_eq!(read.records.iter().map(|record| record.key.as_str()).collect::<Vec<_>>(), ["a"]);
        assert_eq!(read.controls.iter().map(|record| record.key.as_str()).collect::<Vec<_>>(), ["c"]);
        assert_eq!((read.rounds[0].launch, read.anchors), (3, vec![anchor]));
        for name in [RECORDS, CONTROLS, ROUNDS, ANCHORS] {
            let text = std::fs::read_to_string(path(name)).unwrap();
            std::fs::write(path(name), format!("{text}nonsense\n")).unwrap();
            let (_, notes) = shown(&folder);
            let expected = format!("raycl ignores 1 damaged line of {name}; the first is line 2.");
            assert_eq!(notes.iter().filter(|note| note.starts_with(&expected)).count(), 1, "{notes:?}");
        }
        assert_eq!(Folder::read(folder.path()).unwrap().damage.len(), 4);
        // If the only line of one of these three journals is damaged, the journal counts as empty, and the folder
        // can still be read.
        for name in [CONTROLS, ROUNDS, ANCHORS] {
            std::fs::write(path(name), "nonsense\n").unwrap();
        }
        let read = Folder::read(folder.path()).unwrap();
        assert_eq!((read.records.len(), read.controls.len(), read.damage.len()), (1, 0, 4));
        assert!(read.rounds.is_empty() && read.anchors.is_empty());
    }

    #[test]
    fn a_journal_of_records_without_a_whole_line_is_raycls_if_the_folder_has_a_plan() {
        let folder = tempfile::tempdir().unwrap();
        let journal = folder.path().join(RECORDS);
        std::fs::write(&journal, "nonsense\n").unwrap();
        let refused = |path: &Path| Folder::read(path).unwrap_err().to_string();
        let expected = "records.jsonl:1: neither this line nor any other line of the file is a record";
        assert!(refused(folder.path()).contains(expected), "{}", refused(folder.path()));
        CurrentPlan::of(&[record("a", "bvh", 1.0)]).write(folder.path()).unwrap();
        let read = Folder::read(folder.path()).unwrap();
        assert_eq!((read.records.len(), read.damage.len()), (0, 1));
        assert!(refused(&journal).contains(expected), "a file was given, not a folder");
    }

    #[test]
    fn control_points_are_those_of_the_plan_with_its_names_once_for_each_block() {
        let of = |key: &str, launch: u32, ms| Record {
            sample_launches: vec![launch; 5],
            ..record(key, "of another run", ms)
        };
        let folder = folder(&[record("a", "bvh", 1.0)]);
        let mut journal = JsonLines::append_to(&folder.path().join(CONTROLS)).unwrap();
        for control in [of("a", 0, 1.0), of("a", 1, 2.0), of("a", 0, 3.0), of("b", 2, 4.0)] {
            journal.append(&control).unwrap();
        }
        let controls = || -> Vec<(String, Option<f64>)> {
            let read = Folder::read(folder.path()).unwrap().controls;
            read.into_iter().map(|record| (record.name, record.median_ms)).collect()
        };
        let named = |name: &str, times: &[f64]| -> Vec<_> {
            times.iter().map(|ms| (name.to_owned(), Some(*ms))).collect()
        };
        assert_eq!(controls(), named("of another run", &[3.0, 2.0, 4.0]));
        CurrentPlan::of(&[record("a", "renamed", 0.0)]).write(folder.path()).unwrap();
        assert_eq!(controls(), named("renamed", &[3.0, 2.0]));
    }

    #[test]
    fn a_folder_tells_what_a_reader_has_to_know() {
        let folder = folder(&[record("a", "bvh", 1.0)]);
        let journal = folder.path().join(RECORDS);
        let text = std::fs::read_to_string(&journal).unwrap();
        let unknown = "environment.json is missing or cannot be read, so the machine and the drivers of the run are unknown.";
        assert_eq!(shown(&folder).1, [unknown]);
        std::fs::write(folder.path().join("environment.json"), "{}").unwrap();
        std::fs::write(folder.path().join(MERGE), r#"{"notes": ["One attempt was killed."]}"#).unwrap();
        std::fs::write(&journal, format!("{text}{{\"key\":")).unwrap();
        let torn = "The last record is incomplete, for example because raycl was killed while it wrote the record. The \
                    record is left out; `raycl run --resume` measures the record's point again.";
        assert_eq!(shown(&folder).1, ["One attempt was killed.", torn]);
    }

    #[test]
    fn values_of_the_config_are_those_of_the_run() {
        let folder = folder(&[record("a", "bvh", 1.0)]);
        let environment =
            serde_json::json!({"config": "question = \"Which?\"\nscenes = [\"a\"]\n"}).to_string();
        std::fs::write(folder.path().join("environment.json"), environment).unwrap();
        let read = Folder::read(folder.path()).unwrap();
        let name = folder.path().canonicalize().unwrap();
        assert_eq!(read.label, name.file_name().unwrap().to_string_lossy());
        let values = ["question", "scenes", "answer"].map(|key| read.config(key));
        assert_eq!(values, [Some("Which?".to_owned()), None, None]);
    }

    #[test]
    fn notes_on_the_config_are_notes_on_its_results() {
        let folder = folder(&[record("a", "bvh", 1.0)]);
        let environment = serde_json::json!({"config_notes": ["Strategy a equals b."]}).to_string();
        std::fs::write(folder.path().join("environment.json"), environment).unwrap();
        let (_, notes) = shown(&folder);
        assert!(notes.iter().any(|note| note == "Strategy a equals b."), "{notes:?}");
    }

    #[test]
    fn the_question_is_that_of_set_or_of_the_config_or_the_configs_name_or_the_folders() {
        let folder = folder(&[record("a", "bvh", 1.0)]);
        let question = |environment: Value| {
            std::fs::write(folder.path().join("environment.json"), environment.to_string()).unwrap();
            let read = Folder::read(folder.path()).unwrap();
            (read.question(), read.label)
        };
        let stated = "question = \"Which?\"\nexpectation = \"This.\"\n";
        let set = ["question = \"One?\"", "question = \"Two?\"", "timing.seed = 2"];
        let path = "configs/sizes.toml";
        let with = |config: &str, overrides: &[&str]| {
            question(serde_json::json!({"config": config, "overrides": overrides, "config_path": path})).0
        };
        assert_eq!(with(stated, &set), ("Two?".to_owned(), "This.".to_owned()));
        assert_eq!(with(stated, &[]).0, "Which?");
        assert_eq!(with("", &[]), ("sizes".to_owned(), String::new()));
        let (unknown, label) = question(serde_json::json!({"config": ""}));
        assert_eq!(unknown, (label, String::new()));
    }

    #[test]
    fn more_than_one_missing_point_and_hidden_record_are_counted() {
        let hidden = ["v", "x", "y"].map(|key| record(key, "bvh", 1.0));
        let folder = folder(&[&hidden[..], &[record("z", "tile", 2.0)]].concat());
        let plan = [record("a", "naive", 0.0), record("b", "wide", 0.0), record("z", "tile", 0.0)];
        CurrentPlan::of(&plan).write(folder.path()).unwrap();
        let (_, notes) = shown(&folder);
        let expected = [
            "2 points of the plan are not measured yet.",
            "3 records of earlier plans are stored but not shown.",
        ];
        assert_eq!(notes[..2], expected);
    }

    #[test]
    fn notes_tell_what_disturbed_the_points_that_are_shown() {
        use crate::record::fixtures::measured;
        let of = |host: &str, ms, launch: u32| {
            let mut record = measured("gpu", "naive", 8, ms);
            record.sample_launches.iter_mut().for_each(|number| *number += launch);
            Record { host: Some(host.into()), control: Some(record.key.clone()), ..record }
        };
        let delayed = Record { preempted_samples: Some(2), ..of("n1", 10.0, 0) };
        let folder = folder(&[delayed, measured("gpu", "wide", 8, 20.0)]);
        let mut controls = JsonLines::append_to(&folder.path().join(CONTROLS)).unwrap();
        controls.append(&of("n2", 15.0, 4)).unwrap();
        let mut rounds = JsonLines::append_to(&folder.path().join(ROUNDS)).unwrap();
        for n in 0..20_u32 {
            let core_to_core_ns = Some(f64::from(60 + 200 * (n % 2)));
            let line =
                RoundLoad { ms: 500.0, processors: 2, others: 0.5, core_to_core_ns, ..RoundLoad::default() };
            rounds.append(&line).unwrap();
        }
        let read = Folder::read(folder.path()).unwrap();
        for start in [
            "Differences below 2.1% between two points are mostly not detected in these results.",
            "The hosts differ in speed: the point \"teapot, 800 x 500, gpu, naive at 8 x 8\" took 10.00 ms on n1 and 15.00 ms on n2",
            "Disturbed: how busy the machine was is known for 1 of 2 launches (counted for each group of points). In this launch, other programs",
            "2 samples are left out, because a thread that cast the frame probably had to wait for a processor.",
            "The core-to-core latency changed between 60 and 260 ns",
        ] {
            assert!(read.notes.iter().any(|note| note.starts_with(start)), "{start}: {:?}", read.notes);
        }
        assert!(read.records[0].relative_times.is_some() && read.controls[0].relative_times.is_some());
    }

    #[test]
    fn latencies_of_several_machines_are_not_compared() {
        use crate::record::fixtures::measured;
        let noted = |hosts: [Option<&str>; 2]| {
            let at = |(host, name): (Option<&str>, &str)| Record {
                host: host.map(str::to_owned),
                ..measured("cpu", name, 8, 10.0)
            };
            let [first, second] = hosts;
            let folder = folder(&[at((first, "naive")), at((second, "wide"))]);
            let mut rounds = JsonLines::append_to(&folder.path().join(ROUNDS)).unwrap();
            for n in 0..20_u32 {
                let core_to_core_ns = Some(f64::from(60 + 200 * (n % 2)));
                rounds.append(&RoundLoad { core_to_core_ns, ..RoundLoad::default() }).unwrap();
            }
            let notes = Folder::read(folder.path()).unwrap().notes;
            notes.iter().any(|note| note.starts_with("The core-to-core latency changed"))
        };
        assert!(noted([None, None]) && noted([Some("n1"), Some("n1")]));
        assert!(!noted([Some("n1"), Some("n2")]));
    }

    /// A GPU gets a longer name when a second GPU of the same name becomes visible on the machine.
    #[test]
    fn anchors_are_those_of_a_device_that_a_later_session_gave_another_name() {
        use crate::numbers::significant;
        use crate::record::fixtures::measured;
        use crate::record::{anchored, judge_with_anchors};
        let earlier = measured("gpu", "naive", 8, 10.0);
        let folder = folder(std::slice::from_ref(&earlier));
        let mut journal = JsonLines::append_to(&folder.path().join(ANCHORS)).unwrap();
        for (launch, at_ms) in earlier.sample_launches.iter().zip(&earlier.samples_at_ms) {
            let (anchor, device) = ("one".into(), "gpu".into());
            let (launch, at_ms) = (*launch, at_ms + 0.5);
            journal
                .append(&AnchorSample { anchor, device, launch, at_ms, ms: 5.0, ..AnchorSample::default() })
                .unwrap();
        }
        CurrentPlan::of(&[Record { device: "cuda-gpu".into(), ..earlier }]).write(folder.path()).unwrap();
        let mut read = Folder::read(folder.path()).unwrap();
        assert!(read.anchors.iter().all(|anchor| anchor.device == "cuda-gpu"), "{:?}", read.anchors);
        judge_with_anchors(&mut read.records, &read.anchors);
        let (name, ratio) = anchored(&read.records[0]).unwrap();
        assert_eq!((name, significant(ratio.middle, 3)), ("one", "2.00".to_owned()));
    }

    #[test]
    fn scenes_of_one_name_are_shown_under_two() {
        let of = |file: &str, hash: &str| Record {
            scene_file: Some(file.into()),
            scene_hash: Some(hash.into()),
            ..record(hash, "bvh", 1.0)
        };
        let read = Folder::read(folder(&[of("a/teapot.obj", "1"), of("b/teapot.obj", "2")]).path()).unwrap();
        let scenes: Vec<_> = read.records.iter().map(|record| record.scene.as_str()).collect();
        assert_eq!(scenes, ["a/teapot", "b/teapot"]);
    }
}
