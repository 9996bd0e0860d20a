//! Removes damaged lines from a folder's journals, and keeps a copy of each journal that had damaged lines.

use super::journal::unreadable;
use super::journals::{ANCHORS, CONTROLS, LAUNCHES, RECORDS, ROUNDS, SAMPLES};
use super::{AnchorSample, LaunchEnd, Record, RoundLoad, Sample, ordinary, own_file, write_new, write_whole};
use crate::error::{Error, Result};
use crate::existing;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// A journal that was repaired.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Repaired {
    /// The path of the repaired journal.
    pub file: PathBuf,
    /// The path of the copy of the original journal.
    pub copy: PathBuf,
    /// Number of damaged lines that were removed from the journal.
    pub damaged: usize,
    /// Number of lines that remain in the repaired journal.
    pub kept: usize,
}

/// Repairs a folder's journals. Adds one `Repaired` to `repaired` for each journal that was damaged. If a file cannot
/// be written, the other journals are still repaired, and the error of the first file that cannot be written is
/// returned. If a journal cannot be read, no journal is changed. The caller must hold the folder's lock, by which
/// only one process at a time writes to the folder.
pub fn repair(folder: &Path, repaired: &mut Vec<Repaired>) -> Result<()> {
    let damaged = [
        damaged(&folder.join(RECORDS), is_a::<Record>)?,
        damaged(&folder.join(SAMPLES), is_a::<Sample>)?,
        damaged(&folder.join(LAUNCHES), is_a::<LaunchEnd>)?,
        damaged(&folder.join(ROUNDS), is_a::<RoundLoad>)?,
        damaged(&folder.join(ANCHORS), is_a::<AnchorSample>)?,
        damaged(&folder.join(CONTROLS), is_a::<Record>)?,
    ];
    repair_each(damaged.into_iter().flatten(), repaired)
}

/// Repairs journals, and adds each repaired journal to `repaired`. Returns the error of the first journal that cannot
/// be written.
fn repair_each(all: impl Iterator<Item = Damaged>, repaired: &mut Vec<Repaired>) -> Result<()> {
    let mut outcome = Ok(());
    for damaged in all {
        let one = damaged.repair().map(|one| repaired.push(one));
        outcome = outcome.and(one);
    }
    outcome
}

/// A journal with damaged lines, before its repair.
struct Damaged {
    path: PathBuf,
    /// The bytes of the journal.
    bytes: Vec<u8>,
    /// The bytes of the lines that remain.
    whole: Vec<u8>,
    /// Number of damaged lines.
    damaged: usize,
    /// Number of lines that remain.
    kept: usize,
}

impl Damaged {
    /// Copies the journal, and then removes the damaged lines from the journal.
    fn repair(self) -> Result<Repaired> {
        let Self { path, bytes, whole, damaged, kept } = self;
        let copy = keep_copy(&path, &bytes)?;
        write_whole(&path, &whole)?;
        Ok(Repaired { file: path, copy, damaged, kept })
    }
}

fn is_a<T: DeserializeOwned>(line: &[u8]) -> bool {
    serde_json::from_slice::<T>(line).is_ok()
}

/// Reads a journal; returns `None` if no line is damaged, or if there is no such journal. `is_whole` returns true for a
/// line that is not damaged.
fn damaged(path: &Path, is_whole: fn(&[u8]) -> bool) -> Result<Option<Damaged>> {
    if !existing::exists(path)? {
        return Ok(None);
    }
    let refused = |error| {
        Error::input(format!("cannot repair {}: {error}", path.display()))
            .with_help("give the path of a folder that `raycl run` wrote; its files must not be links")
    };
    own_file(path).and_then(|()| ordinary(path)).map_err(refused)?;
    let bytes = std::fs::read(path).map_err(|error| unreadable(path, &error))?;
    // A whole last line without a line break is not damaged: the next run in the folder adds the line break.
    let is_kept = |line: &&[u8]| line.trim_ascii().is_empty() || is_whole(line);
    let (kept, damaged): (Vec<&[u8]>, Vec<&[u8]>) =
        bytes.split_inclusive(|&byte| byte == b'\n').partition(is_kept);
    if damaged.is_empty() {
        return Ok(None);
    }
    let (whole, damaged, kept) = (kept.concat(), damaged.len(), kept.len());
    Ok(Some(Damaged { path: path.to_owned(), bytes, whole, damaged, kept }))
}

/// Writes a copy of a journal to the disk, in the same folder and under an unused name. Returns the copy's
/// path. A copy that cannot be written completely, for example because the disk is full, does not appear.
fn keep_copy(path: &Path, bytes: &[u8]) -> Result<PathBuf> {
    let named = |number: usize| path.with_extension(format!("jsonl.damaged-{number}"));
    let mut number = 1;
    // Before the copy is written, the loop checks whether a file has this name already. Writing a large journal to
    // the disk takes long, and only after writing, `write_new` would notice that the name is taken.
    while existing::exists(&named(number))? || !write_new(&named(number), bytes)? {
        number += 1;
    }
    Ok(named(number))
}

#[cfg(test)]
mod tests {
    use super::super::read_lines;
    use super::*;

    /// Repairs a folder's journals, and returns those that were damaged.
    fn repair(folder: &Path) -> Result<Vec<Repaired>> {
        let mut repaired = Vec::new();
        super::repair(folder, &mut repaired).map(|()| repaired)
    }

    const LAUNCH_END: &str = "{\"launch\":0,\"stop_reason\":\"precise\",\"samples\":{\"a\":5}}";

    #[test]
    fn every_journal_is_repaired() {
        let line = |line: serde_json::Result<String>| line.unwrap() + "\n";
        for (journal, good) in [
            (RECORDS, line(serde_json::to_string(&Record::default()))),
            (SAMPLES, line(serde_json::to_string(&Sample::default()))),
            (LAUNCHES, LAUNCH_END.to_owned() + "\n"),
            (ROUNDS, line(serde_json::to_string(&RoundLoad::default()))),
            (ANCHORS, line(serde_json::to_string(&AnchorSample::default()))),
            (CONTROLS, line(serde_json::to_string(&Record::default()))),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(journal);
            std::fs::write(&path, format!("{good}nonsense\n")).unwrap();
            let repaired = repair(folder.path()).unwrap();
            assert_eq!(repaired.iter().map(|one| &one.file).collect::<Vec<_>>(), [&path]);
            assert_eq!(std::fs::read_to_string(&path).unwrap(), good);
        }
    }

    /// Lines of different journals have different types; only records and control points have the same type.
    #[test]
    fn whole_lines_of_every_journal_are_kept() {
        let record = serde_json::to_string(&Record::default()).unwrap();
        let round = serde_json::to_string(&RoundLoad::default()).unwrap();
        let anchor = "{\"anchor\":\"a\",\"device\":\"d\",\"launch\":0,\"round\":0,\"at_ms\":1.0,\"ms\":1.5}";
        let lines = [
            (ROUNDS, round.as_str()),
            (ANCHORS, anchor),
            (RECORDS, record.as_str()),
            (CONTROLS, record.as_str()),
            (SAMPLES, "{\"key\":\"a\",\"round\":0,\"ms\":1.5}"),
            (LAUNCHES, LAUNCH_END),
        ];
        for (journal, line) in lines {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(journal);
            std::fs::write(&path, format!("{line}\nnonsense\n")).unwrap();
            let [repaired] = &repair(folder.path()).unwrap()[..] else { panic!("{journal} was not damaged") };
            assert_eq!((repaired.damaged, repaired.kept), (1, 1), "{journal}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), format!("{line}\n"), "{journal}");
        }
    }

    #[test]
    fn damaged_lines_go_and_a_copy_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("samples.jsonl");
        let good = "{\"key\":\"a\",\"round\":0,\"ms\":1.5}\n";
        for (index, text) in [
            format!("{good}nonsense\n\n{good}{{\"key\":"),
            format!("\0\n{good}"),
            format!("{good}{}", good.trim_end_matches("}\n")),
        ]
        .iter()
        .enumerate()
        {
            std::fs::write(&path, text).unwrap();
            let [repaired] = &repair(folder.path()).unwrap()[..] else { panic!("one file was damaged") };
            assert_eq!((repaired.damaged, repaired.kept), [(2, 3), (1, 1), (1, 1)][index]);
            assert_eq!(std::fs::read_to_string(&repaired.copy).unwrap(), *text);
            assert!(read_lines::<Sample>(&path).unwrap().damaged.is_empty());
            assert!(repair(folder.path()).unwrap().is_empty());
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4);
    }

    #[test]
    fn a_whole_last_line_without_a_line_break_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(SAMPLES);
        let good = "{\"key\":\"a\",\"round\":0,\"ms\":1.5}";
        for (text, kept) in [(format!("{good}\n{good}"), None), (format!("nonsense\n{good}"), Some(1))] {
            std::fs::write(&path, &text).unwrap();
            assert_eq!(repair(folder.path()).unwrap().first().map(|repaired| repaired.kept), kept);
            assert!(std::fs::read_to_string(&path).unwrap().ends_with(good));
        }
    }

    /// The journal's name is so long that the copy's longer name exceeds the limit of the file system.
    #[test]
    fn a_copy_that_cannot_be_written_is_no_mistake_of_the_user_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("k".repeat(250) + ".jsonl");
        let error = keep_copy(&path, b"nonsense\n").unwrap_err();
        assert_eq!(error.exit_code(), 1, "{error}");
        assert!(error.to_string().starts_with("cannot write ") && error.to_string().contains(".damaged-1: "));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    /// A link that leads to nothing takes a name although no file seems to have this name.
    #[cfg(unix)]
    #[test]
    fn a_copy_replaces_nothing_even_if_its_name_seems_to_be_free() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(SAMPLES);
        std::os::unix::fs::symlink("nothing", folder.path().join("samples.jsonl.damaged-1")).unwrap();
        let copy = keep_copy(&path, b"nonsense\n").unwrap();
        assert_eq!(copy, folder.path().join("samples.jsonl.damaged-2"));
        assert_eq!(std::fs::read_to_string(copy).unwrap(), "nonsense\n");
    }

    #[test]
    fn a_folder_in_the_place_of_a_journal_is_the_users_mistake() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join(SAMPLES)).unwrap();
        assert_eq!(repair(folder.path()).unwrap_err().exit_code(), 2);
    }

    /// The journal that cannot be read is the last one that a repair reads.
    #[test]
    fn a_journal_that_cannot_be_read_leaves_the_others_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join(CONTROLS)).unwrap();
        std::fs::write(folder.path().join(RECORDS), "nonsense\n").unwrap();
        assert!(repair(folder.path()).is_err());
        assert_eq!(std::fs::read_to_string(folder.path().join(RECORDS)).unwrap(), "nonsense\n");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "there is no copy");
    }

    /// The second journal's folder is missing, so that no copy can be written.
    #[test]
    fn the_journals_before_and_after_a_failed_write_are_repaired() {
        let folder = tempfile::tempdir().unwrap();
        let names = ["records.jsonl", "missing/samples.jsonl", "rounds.jsonl"];
        let [first, second, third] = names.map(|name| folder.path().join(name));
        [&first, &third].iter().for_each(|path| std::fs::write(path, "nonsense\n").unwrap());
        let damaged = |path: &PathBuf| Damaged {
            path: path.clone(),
            bytes: b"nonsense\n".to_vec(),
            whole: Vec::new(),
            damaged: 1,
            kept: 0,
        };
        let mut repaired = Vec::new();
        let all = [&first, &second, &third].map(damaged).into_iter();
        let error = repair_each(all, &mut repaired).unwrap_err();
        let copy = folder.path().join("missing/samples.jsonl.damaged-1");
        assert!(error.to_string().starts_with(&format!("cannot write {}: ", copy.display())), "{error}");
        assert_eq!(repaired.iter().map(|one| &one.file).collect::<Vec<_>>(), [&first, &third]);
        assert_eq!([&first, &third].map(|path| std::fs::read_to_string(path).unwrap()), ["", ""]);
    }

    #[test]
    fn of_several_failed_writes_the_first_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let damaged = |name: &str| Damaged {
            path: folder.path().join(name).join("records.jsonl"),
            bytes: b"nonsense\n".to_vec(),
            whole: Vec::new(),
            damaged: 1,
            kept: 0,
        };
        let error =
            repair_each(["a", "b"].map(damaged).into_iter(), &mut Vec::new()).unwrap_err().to_string();
        let copy = folder.path().join("a/records.jsonl.damaged-1");
        assert!(error.starts_with(&format!("cannot write {}: ", copy.display())), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_out_of_the_folder_is_not_repaired() {
        let folder = tempfile::tempdir().unwrap();
        let outer = folder.path().join("outer");
        std::fs::write(&outer, "nonsense\n").unwrap();
        let inner = folder.path().join("inner");
        std::fs::create_dir(&inner).unwrap();
        std::os::unix::fs::symlink(&outer, inner.join(RECORDS)).unwrap();
        let error = repair(&inner).expect_err("a link");
        assert!(error.exit_code() == 2 && error.to_string().contains("it is a link"), "{error}");
        assert_eq!(std::fs::read_to_string(&outer).unwrap(), "nonsense\n");
    }
}
