//! Journals: files with one JSON object per line. raycl waits until appended lines are on the disk before it
//! appends further lines. If a crash interrupts a write, only the lines that this write was appending are
//! lost.

use std::fs::{File, OpenOptions};
use std::io::{
    BufRead as _, BufReader, ErrorKind, Read as _, Result as IoResult, Seek as _, SeekFrom, Write as _,
};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::refuse_link;
use crate::error::{Error, Result};
use crate::existing;
use crate::reader;
use crate::words::counted;

/// A file to which values of type `T` are appended.
#[derive(Debug)]
pub struct JsonLines<T> {
    path: PathBuf,
    file: File,
    /// True if the path led to the file when the file was opened. On a file system that changes the inode
    /// numbers of its files, the path may seem to lead to another file, and the field is false.
    is_recognised: bool,
    line_type: PhantomData<fn(&T)>,
}

impl<T: Serialize + DeserializeOwned> JsonLines<T> {
    /// Opens the file for appending, and creates it if it is missing. If the last line is only the beginning of a line,
    /// removes this line. If any other last line lacks its line break, adds the line break. Returns an input error (a
    /// mistake of the user) if the path is a link, a pipe or a device. The file is opened in append mode: if two runs
    /// write to the file, they do not overwrite each other's lines. Usually, a lock keeps a second run out of the
    /// folder. The lock can fail: some file systems have no locks, and a user may have removed the lock's file. On NFS,
    /// runs on two machines can still overwrite each other's lines, since each machine stores its own position of the
    /// file's end.
    pub fn append_to(path: &Path) -> Result<Self> {
        refuse_link(path)?;
        let fail = |error| Error::unwritable(path, &error);
        let mut file = OpenOptions::new().create(true).read(true).append(true).open(path).map_err(fail)?;
        let text = std::fs::read(path).map_err(fail)?;
        end_last_line::<T>(&mut file, &text).map_err(fail)?;
        let is_recognised = existing::still_leads_to(path, &file).unwrap_or(false);
        Ok(Self { path: path.to_path_buf(), file, is_recognised, line_type: PhantomData })
    }

    /// Appends one line to the journal. When this function returns, the line is on the disk.
    pub fn append(&mut self, line: &T) -> Result<()> {
        self.append_all(std::slice::from_ref(line))
    }

    /// Appends lines. When this function returns, all lines are on the disk. The lines are written in one
    /// write, since each write waits for the disk. After an error, the function removes these lines again,
    /// including an incomplete line, since the next lines would be appended to this incomplete line. (If
    /// another process has appended lines during the write, only an incomplete last line is removed.) If the
    /// system does not let raycl remove the lines, they stay in the file.
    pub fn append_all(&mut self, lines: &[T]) -> Result<()> {
        let mut bytes = Vec::new();
        for line in lines {
            serde_json::to_writer(&mut bytes, line)
                .map_err(|error| Error::fault(format!("cannot write {}: {error}", self.path.display())))?;
            bytes.push(b'\n');
        }
        let write = |file: &mut File| file.write_all(&bytes).and_then(|()| file.sync_data());
        append_or_nothing(&mut self.file, &bytes, write)
            .map_err(|error| Error::unwritable(&self.path, &error))
    }

    /// Returns an error if the file is no longer at its path, because somebody has removed or replaced the
    /// file or its folder. Lines that are appended to a removed file would be lost. If the system does not
    /// say whether the file is still at its path, returns no error, since lines can still be appended.
    pub fn check_place(&self) -> Result<()> {
        match existing::still_leads_to(&self.path, &self.file) {
            Ok(false) if self.is_recognised => Err(Error::removed(&self.path)),
            _ => Ok(()),
        }
    }
}

/// Makes a journal with the contents `text` end with a complete line. If the last line is only the beginning of a line,
/// as after a run that was killed, removes this line. If any other last line lacks its line break, adds the line break.
/// (Such a line is not removed, since it may be a whole record, or the file may not be raycl's.)
fn end_last_line<T: DeserializeOwned>(file: &mut File, text: &[u8]) -> IoResult<()> {
    let end = whole_lines(text);
    match &text[end..] {
        // A file whose last line is complete is not changed, since another run may have appended lines after
        // `text` was read.
        [] => Ok(()),
        line if serde_json::from_slice::<T>(line).is_err_and(|error| is_beginning(line, &error)) => {
            file.set_len(end as u64)
        }
        _ => file.write_all(b"\n"),
    }
}

/// Returns true if `line` is the beginning of a line of a journal. `error` says why the line cannot be read.
fn is_beginning(line: &[u8], error: &serde_json::Error) -> bool {
    line.starts_with(b"{") && !line.ends_with(b"\n") && error.is_eof()
}

/// Calls `write`, which appends `bytes` to the file. If `write` fails, removes the bytes that `write`
/// appended. If another process appended lines at the same time, removes only an incomplete last line.
fn append_or_nothing(
    file: &mut File,
    bytes: &[u8],
    write: impl FnOnce(&mut File) -> IoResult<()>,
) -> IoResult<()> {
    let before = file.metadata()?.len();
    write(file).inspect_err(|_| {
        // If the bytes cannot be removed, the beginning of a line stays in the file, and the next line that
        // is appended becomes damaged.
        let _ = read_from(file, before).and_then(|added| {
            let kept = if bytes.starts_with(&added) { 0 } else { whole_lines(&added) };
            file.set_len(before + kept as u64)
        });
    })
}

/// Returns the bytes of a file from the position `start` to its end.
fn read_from(mut file: &File, start: u64) -> IoResult<Vec<u8>> {
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(start))?;
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The contents of a file of JSON lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines<T> {
    /// All lines that can be read. The last line counts even if it lacks its line break.
    pub lines: Vec<T>,
    /// True if the file ends with the beginning of a line. `lines` does not contain this incomplete line.
    pub torn: bool,
    /// The numbers of the damaged lines, counted from 1. A line is damaged if it cannot be read, and is neither
    /// blank nor an incomplete last line (see `torn`). `lines` does not contain damaged lines.
    pub damaged: Vec<usize>,
    /// Why the last damaged line cannot be read; empty if no line is damaged.
    reason: String,
}

impl<T> Default for Lines<T> {
    fn default() -> Self {
        Self { lines: Vec::new(), torn: false, damaged: Vec::new(), reason: String::new() }
    }
}

impl<T> Lines<T> {
    /// Returns a note on the damaged lines of the file `name`; `None` if no line is damaged.
    pub fn damage(&self, name: &str) -> Option<String> {
        let first = self.damaged.first()?;
        let lines = counted(self.damaged.len(), "damaged line");
        Some(format!(
            "raycl ignores {lines} of {name}; the first is line {first}. `raycl repair` removes damaged lines and keeps a copy of the file."
        ))
    }

    /// Returns an input error (a mistake of the user) if the file has damaged lines, but no line that can be
    /// read. A file without a readable line is probably not a journal. `path` is the file's path.
    pub fn refuse_if_all_damaged(self, path: &Path) -> Result<Self> {
        match (&self.lines[..], &self.damaged[..]) {
            ([], [.., last]) => {
                let message = format!(
                    "{}:{last}: neither this line nor any other line of the file is a record: {}",
                    path.display(),
                    self.reason
                );
                Err(Error::input(message).with_help(FOLDER))
            }
            _ => Ok(self),
        }
    }
}

/// The advice in an error about a folder or a file that contains no results.
pub(super) const FOLDER: &str = "give the path of a folder that `raycl run` wrote, such as results/quick";

/// Reads a journal. A missing journal counts as empty: folders that earlier versions of raycl wrote lack some
/// journals, and an attempt that was killed early has no journals. A journal that may exist, but cannot be
/// read, is an error.
pub fn read_lines_if_any<T: DeserializeOwned>(path: &Path) -> Result<Lines<T>> {
    if existing::exists(path)? { read_lines(path) } else { Ok(Lines::default()) }
}

/// Reads a file of JSON lines. Leaves out an incomplete last line and damaged lines; the returned `Lines` says which
/// lines are left out. Skips blank lines without saying so.
pub fn read_lines<T: DeserializeOwned>(path: &Path) -> Result<Lines<T>> {
    let unreadable = |error| unreadable(path, &error);
    let mut file = BufReader::new(reader::open(path).map_err(unreadable)?);
    let mut read = Lines::default();
    let mut line = Vec::new();
    for number in 1.. {
        line.clear();
        if file.read_until(b'\n', &mut line).map_err(unreadable)? == 0 {
            break;
        }
        match serde_json::from_slice(&line) {
            Ok(value) => read.lines.push(value),
            Err(error) if is_beginning(&line, &error) => read.torn = true,
            Err(_) if line.trim_ascii().is_empty() => {}
            Err(error) => {
                read.reason = without_position(&error);
                read.damaged.push(number);
            }
        }
    }
    Ok(read)
}

/// Returns the error for a journal that cannot be read.
pub(super) fn unreadable(path: &Path, error: &std::io::Error) -> Error {
    use ErrorKind::{InvalidInput, IsADirectory, NotADirectory, NotFound};
    match error.kind() {
        // Each of the next four kinds of error means that no journal is at the path.
        InvalidInput | IsADirectory | NotADirectory | NotFound => {
            Error::input(format!("cannot read {}: {error}", path.display())).with_help(FOLDER)
        }
        _ => existing::unreadable(path, error),
    }
}

/// Returns the message of an error of serde without the position of the error. Serde counts lines within one
/// record, so its position would contradict the line's number in the file.
fn without_position(error: &serde_json::Error) -> String {
    let message = error.to_string();
    message.rsplit_once(" at line ").map_or(message.as_str(), |(reason, _)| reason).to_owned()
}

/// Returns the length of `bytes` up to the end of the last complete line.
fn whole_lines(bytes: &[u8]) -> usize {
    bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |index| index + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::StopReason;
    use crate::record::{AnchorSample, LaunchEnd, Outcome, Record, RoundLoad, Sample};

    fn record(key: &str) -> Record {
        Record {
            key: key.into(),
            outcome: Outcome::WrongImage,
            local_size: Some([4, 2]),
            ..Record::default()
        }
    }

    #[test]
    fn records_come_back_and_outcomes_are_spelled_with_hyphens() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl");
        let mut journal = JsonLines::append_to(&path).unwrap();
        journal.append(&record("a")).unwrap();
        journal.append(&record("b")).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().count(), 2);
        assert!(
            text.contains(r#""outcome":"wrong-image""#) && text.contains(r#""local_size":[4,2]"#),
            "{text}"
        );
        let read = read_lines::<Record>(&path).unwrap();
        assert_eq!((read.lines, read.torn), (vec![record("a"), record("b")], false));
    }

    #[test]
    fn a_torn_last_line_is_left_out_and_then_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl");
        JsonLines::append_to(&path).unwrap().append(&record("a")).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        bytes.extend_from_slice(b"{\"key\":\"b\",\"sce\xc3");
        std::fs::write(&path, bytes).unwrap();

        let read = read_lines::<Record>(&path).unwrap();
        assert_eq!((read.lines.len(), read.torn), (1, true));

        JsonLines::append_to(&path).unwrap().append(&record("c")).unwrap();
        let read = read_lines::<Record>(&path).unwrap();
        assert_eq!((read.lines, read.torn), (vec![record("a"), record("c")], false));
    }

    /// An editor may remove the last line break.
    #[test]
    fn a_whole_last_line_without_a_line_break_counts_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl");
        let lines = ["a", "b"].map(|key| serde_json::to_string(&record(key)).unwrap());
        std::fs::write(&path, lines.join("\n")).unwrap();
        let read = read_lines::<Record>(&path).unwrap();
        assert_eq!((read.lines, read.torn), (["a", "b"].map(record).to_vec(), false));
        JsonLines::append_to(&path).unwrap().append(&record("c")).unwrap();
        let read = read_lines::<Record>(&path).unwrap();
        assert_eq!((read.lines, read.damaged), (["a", "b", "c"].map(record).to_vec(), Vec::new()));
    }

    #[test]
    fn a_last_line_that_is_no_beginning_of_a_record_is_damaged_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl");
        let array = "[{\"id\":1},{\"id\":2}]";
        for text in ["mine", "\"mine", "nul", array, "[\"a", "{\"id\":1}", "{\"id\":1}\n{\"id\":2}", "\0\0"] {
            std::fs::write(&path, text).unwrap();
            let read = read_lines::<Record>(&path).unwrap();
            let damaged: Vec<usize> = (1..=text.lines().count()).collect();
            assert_eq!((read.lines.len(), read.torn, read.damaged), (0, false, damaged), "{text:?}");
            JsonLines::<Record>::append_to(&path).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), format!("{text}\n"));
        }
    }

    /// A loss of power may leave zeros at the end of a file. A last line with zeros counts as damaged, so that raycl
    /// reports it.
    #[test]
    fn a_last_line_with_zeros_is_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl");
        let line = serde_json::to_string(&record("a")).unwrap();
        std::fs::write(&path, format!("{line}\n{{\"key\":\"b\0\0")).unwrap();
        let read = read_lines::<Record>(&path).unwrap();
        assert_eq!((read.lines.len(), read.torn, read.damaged), (1, false, vec![2]));
    }

    /// Checks that `value`'s line, cut off at each byte in turn, counts as the beginning of a line.
    fn check_beginnings<T: Serialize + DeserializeOwned>(value: &T) {
        let line = serde_json::to_vec(value).unwrap();
        for end in 1..line.len() {
            let is_torn = |error| is_beginning(&line[..end], &error);
            assert!(serde_json::from_slice::<T>(&line[..end]).is_err_and(is_torn), "{end}");
        }
    }

    #[test]
    fn a_line_of_any_journal_that_is_cut_off_is_the_beginning_of_a_line() {
        check_beginnings(&Record {
            scene: "\u{e9}\n\u{1}\"\\".into(),
            is_control: true,
            median_ms: Some(-1.25e-7),
            interval_ms: Some([1.5, 2e20]),
            sample_launches: vec![0, 12],
            ..record("a")
        });
        check_beginnings(&Sample { ms: 1.5, measured_on: Some("gpu".into()), ..Sample::default() });
        let stop_reason = StopReason::NoiseSettled;
        check_beginnings(&LaunchEnd { launch: 7, stop_reason, samples: [("a".to_owned(), 3)].into() });
        check_beginnings(&RoundLoad { launch: 7, load_1m: Some(0.25), ..RoundLoad::default() });
        check_beginnings(&AnchorSample { launch: 7, ms: 2.5, ..AnchorSample::default() });
    }

    #[test]
    fn damaged_lines_are_left_out_and_reported_and_a_file_of_nothing_else_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("samples.jsonl");
        let good = "{\"key\":\"a\",\"round\":0,\"ms\":1.5}\n";
        std::fs::write(&path, format!("{good}nonsense\n\n{good}\0\u{1b}\n{good}{{\"key\":")).unwrap();
        let read = read_lines::<Sample>(&path).unwrap();
        assert_eq!((read.lines.len(), read.torn, &read.damaged[..]), (3, true, &[2, 5][..]));
        assert!(
            read.damage("samples.jsonl")
                .unwrap()
                .starts_with("raycl ignores 2 damaged lines of samples.jsonl; the first is line 2.")
        );
        assert!(read.refuse_if_all_damaged(&path).is_ok());
        std::fs::write(&path, "nonsense\n").unwrap();
        let read = read_lines::<Sample>(&path).unwrap();
        assert_eq!((read.lines.len(), &read.damaged[..]), (0, &[1][..]));
        let Err(Error::Input(error)) = read.refuse_if_all_damaged(&path) else { panic!("it is a journal") };
        assert!(error.message.ends_with("is a record: expected ident"), "{}", error.message);
        assert!(
            error.message.contains("samples.jsonl:1: neither this line nor any other"),
            "{}",
            error.message
        );
        assert_eq!(error.help, FOLDER);
    }

    /// The journal is a pipe, which accepts bytes but cannot be written to a disk.
    #[cfg(unix)]
    #[test]
    fn a_line_is_on_the_disk_or_an_error() {
        let (mut reader, writer) = std::io::pipe().unwrap();
        let file = File::from(std::os::fd::OwnedFd::from(writer));
        let path = PathBuf::from("pipe");
        let mut journal = JsonLines { path, file, is_recognised: true, line_type: PhantomData };
        assert!(journal.append(&record("a")).is_err());
        // `append_all` first writes all lines, and then waits for the disk once.
        assert!(journal.append_all(&["b", "c", "d"].map(record)).is_err());
        drop(journal);
        let mut text = String::new();
        std::io::Read::read_to_string(&mut reader, &mut text).unwrap();
        assert!(text.ends_with('\n'), "it was written: {text}");
        assert_eq!(text.lines().count(), 4, "{text}");
    }

    #[test]
    fn two_writers_of_a_file_do_not_overwrite_each_others_lines() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl");
        let [mut one, mut other] = [(); 2].map(|()| JsonLines::append_to(&path).unwrap());
        for key in ["a", "b"] {
            one.append(&record(key)).unwrap();
            other.append(&record(key)).unwrap();
        }
        let read = read_lines::<Record>(&path).unwrap();
        assert_eq!((read.lines, read.damaged), (["a", "a", "b", "b"].map(record).to_vec(), Vec::new()));
    }

    #[test]
    fn after_a_failed_write_the_next_line_begins_on_a_line_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl");
        let mut journal = JsonLines::append_to(&path).unwrap();
        journal.append(&record("a")).unwrap();
        let disk_full = append_or_nothing(&mut journal.file, b"{\"key\":\"b\",\"scene\":\"c\"}\n", |file| {
            file.write_all(b"{\"key\":\"b\",\"sce")?;
            Err(ErrorKind::StorageFull.into())
        });
        assert_eq!(disk_full.unwrap_err().kind(), ErrorKind::StorageFull);
        journal.append(&record("c")).unwrap();
        let read = read_lines::<Record>(&path).unwrap();
        assert_eq!((read.lines, read.damaged), (["a", "c"].map(record).to_vec(), Vec::new()));
    }

    /// The disk becomes full while the second of two lines is written.
    #[test]
    fn after_a_failed_write_none_of_its_lines_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl");
        let mut journal = JsonLines::append_to(&path).unwrap();
        journal.append(&record("a")).unwrap();
        let lines = [record("b"), record("c")].map(|line| serde_json::to_string(&line).unwrap() + "\n");
        let disk_full = append_or_nothing(&mut journal.file, lines.concat().as_bytes(), |file| {
            file.write_all(lines[0].as_bytes())?;
            file.write_all(&lines[1].as_bytes()[..9])?;
            Err(ErrorKind::StorageFull.into())
        });
        assert_eq!(disk_full.unwrap_err().kind(), ErrorKind::StorageFull);
        journal.append(&record("d")).unwrap();
        let read = read_lines::<Record>(&path).unwrap();
        assert_eq!((read.lines, read.damaged), (["a", "d"].map(record).to_vec(), Vec::new()));
    }

    #[test]
    fn after_a_failed_write_the_lines_of_another_process_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl");
        let [mut one, mut other] = [(); 2].map(|()| JsonLines::append_to(&path).unwrap());
        one.append(&record("a")).unwrap();
        let disk_full = append_or_nothing(&mut one.file, b"{\"key\":\"b\"}\n", |file| {
            other.append(&record("c")).unwrap();
            file.write_all(b"{\"key\":")?;
            Err(ErrorKind::StorageFull.into())
        });
        assert_eq!(disk_full.unwrap_err().kind(), ErrorKind::StorageFull);
        one.append(&record("d")).unwrap();
        let read = read_lines::<Record>(&path).unwrap();
        assert_eq!((read.lines, read.damaged), (["a", "c", "d"].map(record).to_vec(), Vec::new()));
    }

    #[cfg(unix)]
    #[test]
    fn a_journal_whose_folder_was_moved_is_noticed() {
        let parent = tempfile::tempdir().unwrap();
        let [folder, moved] = ["out", "old"].map(|name| parent.path().join(name));
        std::fs::create_dir(&folder).unwrap();
        let journal = JsonLines::<Record>::append_to(&folder.join("records.jsonl")).unwrap();
        journal.check_place().unwrap();
        std::fs::rename(&folder, &moved).unwrap();
        let error = journal.check_place().unwrap_err();
        let what = "or its folder was removed or replaced while this run wrote to it";
        let expected = format!("{} {what}", folder.join("records.jsonl").display());
        assert_eq!((error.to_string(), error.exit_code()), (expected, 1));
        assert!(error.remedy().starts_with("if the folder was moved, "), "{}", error.remedy());
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join("records.jsonl"), "").unwrap();
        assert!(journal.check_place().is_err(), "it is another file");
    }

    #[cfg(unix)]
    #[test]
    fn a_journal_that_cannot_be_read_does_not_count_as_missing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl");
        assert!(read_lines_if_any::<Record>(&path).unwrap().lines.is_empty());
        std::os::unix::fs::symlink(&path, &path).unwrap();
        // The link leads to itself, which causes an error other than "not found".
        for read in [read_lines_if_any::<Record>, read_lines::<Record>] {
            let error = read(&path).unwrap_err();
            let expected = format!("cannot read {}: ", path.display());
            assert!(error.exit_code() == 2 && error.to_string().starts_with(&expected), "{error}");
            assert_ne!(error.remedy(), FOLDER);
        }
        // Here a folder has the journal's path, so the journal does not count as missing.
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        let error = read_lines_if_any::<Record>(&path).unwrap_err();
        assert_eq!((error.exit_code(), error.remedy()), (2, FOLDER));
    }

    #[test]
    fn a_note_on_damage_counts_the_lines() {
        let with = |damaged: &[usize]| Lines::<Sample> { damaged: damaged.to_vec(), ..Lines::default() };
        assert_eq!(with(&[]).damage("a.jsonl"), None);
        let one = with(&[7]).damage("a.jsonl").unwrap();
        assert!(one.starts_with("raycl ignores 1 damaged line of a.jsonl; the first is line 7."), "{one}");
        assert!(!Lines::<Sample>::default().torn);
    }

    #[test]
    fn only_whole_lines_are_kept() {
        let lengths = ["", "torn", "a\n", "a\ntorn", "a\nb\n"].map(|text| whole_lines(text.as_bytes()));
        assert_eq!(lengths, [0, 0, 2, 2, 4]);
    }
}
