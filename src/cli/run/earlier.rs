//! Predicts how long a run will take, from the records of earlier runs.

use crate::error::Result;
use crate::experiment::{Expected, Past, Run};
use crate::reader::folder_of;
use crate::record::journals::RECORDS;
use crate::record::{Record, read_lines};
use std::path::{Path, PathBuf};

/// Returns the expected duration of the run. The time of a point comes from earlier records with the same scene, device
/// and strategy. `past` contains this run's results so far.
pub fn foreseen(run: &Run<'_>, out: &Path, past: &Past) -> Result<Expected> {
    run.expected(&earlier(out), past)
}

/// Returns the records in a folder of results and in its sibling folders, in the order in which the folders' files
/// records.jsonl last changed. Unreadable files are ignored.
pub fn earlier(out: &Path) -> Vec<Record> {
    let folders = std::fs::read_dir(folder_of(out)).into_iter().flatten().flatten();
    let mut journals: Vec<PathBuf> =
        folders.map(|entry| entry.path().join(RECORDS)).filter(|file| file.is_file()).collect();
    journals.sort_by_key(|file| file.metadata().and_then(|data| data.modified()).ok());
    journals.iter().filter_map(|file| read_lines::<Record>(file).ok()).flat_map(|read| read.lines).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::fixtures::{args, experiment};
    use super::*;
    use crate::device_lock::Locks;
    use crate::experiment::{Taken, asleep};
    use crate::launch::FrameTimes;
    use crate::program::Sources;
    use crate::record::Outcome;
    use std::time::{Duration, SystemTime};

    #[test]
    fn records_come_from_all_folders_beside_and_the_latest_last() {
        let parent = tempfile::tempdir().unwrap();
        for (age_s, name) in [(10, "b"), (30, "a"), (20, "c")] {
            let folder = parent.path().join(name);
            std::fs::create_dir(&folder).unwrap();
            let record = Record { name: name.to_owned(), ..Record::default() };
            let journal = folder.join("records.jsonl");
            std::fs::write(&journal, serde_json::to_string(&record).unwrap() + "\n").unwrap();
            let changed = SystemTime::now() - Duration::from_secs(age_s);
            std::fs::File::options().append(true).open(&journal).unwrap().set_modified(changed).unwrap();
        }
        std::fs::create_dir(parent.path().join("empty")).unwrap();
        let names: Vec<String> =
            earlier(&parent.path().join("b")).into_iter().map(|record| record.name).collect();
        assert_eq!(names, ["a", "c", "b"]);
    }

    #[test]
    fn launches_that_the_run_has_completed_are_not_expected_again() {
        let folder = tempfile::tempdir().unwrap();
        let experiment = experiment("local_sizes = [4]\ntiming = { launches = 2 }");
        let (device, locks) = (asleep::device(1.0), Locks::of_machine(false));
        let (devices, sources, arguments) = ([&device], [Sources::Embedded], args(&["a.toml"]));
        let run = super::super::run_of(&arguments, &experiment, &devices, &sources, &locks).unwrap();
        let times = FrameTimes::whole(1.0, 1.0);
        let taken = Taken { launch: 0, at_ms: 0.0, core_to_core_ns: None, times };
        let planned = run.planned_points().unwrap().into_iter();
        let samples = planned.map(|(_, _, point)| (point.key, vec![taken; 5])).collect();
        let past = Past { samples, ..Past::default() };
        let frames = |past: &Past| foreseen(&run, &folder.path().join("out"), past).unwrap().least_frames;
        assert_eq!([frames(&Past::default()), frames(&past)], [10, 5]);
    }

    #[test]
    fn failed_points_are_expected_again_only_if_they_are_retried() {
        let folder = tempfile::tempdir().unwrap();
        let experiment = experiment("local_sizes = [4]");
        let (device, locks) = (asleep::device(1.0), Locks::of_machine(false));
        let devices = [&device];
        let run = |retry_failed| Run {
            experiment: &experiment,
            overrides: &[],
            devices: &devices,
            sources: &Sources::Embedded,
            other_sources: None,
            limit: Duration::MAX,
            retry_failed,
            keeps_moved_samples: true,
            locks: &locks,
            spread: false,
            blocks: None,
            ahead: None,
            caches_programs: true,
        };
        let planned = run(false).planned_points().unwrap();
        let counts = |outcome: Outcome, reason: &str| {
            let outcomes = [Outcome::Measured, outcome].into_iter();
            let done: Vec<Record> = outcomes
                .zip(&planned)
                .map(|(outcome, (_, _, point))| Record {
                    key: point.key.clone(),
                    outcome,
                    reason: Some(reason.to_owned()),
                    ..Record::default()
                })
                .collect();
            assert_eq!(done.len(), planned.len());
            let past = Past { records: done, ..Past::default() };
            [false, true]
                .map(|retries| foreseen(&run(retries), &folder.path().join("out"), &past).unwrap().points)
        };
        assert_eq!(counts(Outcome::BuildFailed, "no"), [0, 1]);
        assert_eq!(counts(Outcome::Infeasible, "the host's memory (casting): 2 B > 1 B"), [0, 1]);
        assert_eq!(counts(Outcome::Infeasible, "__local memory: 2 B > 1 B"), [0, 0]);
        assert_eq!(counts(Outcome::Infeasible, "global memory: 2 B > 1 B"), [1, 1], "now the point fits");
        assert_eq!(counts(Outcome::OtherKind, "meant for CPUs"), [1, 1], "now the point is asked for");
    }
}
