//! Journals: files with one JSON object per line. What is appended is on the disk before more is appended. If a crash
//! interrupts a write, only lines of this write are lost.

use std::fs::{File, OpenOptions};
use std::io::{BufRead as _, BufReader, Seek, SeekFrom, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::own_file;
use crate::error::{Error, Result};
use crate::reader;
use crate::words::counted;

/// A file to which values of type `T` are appended.
#[derive(Debug)]
pub struct JsonLines<T> {
    path: PathBuf,
    file: File,
    line_type: PhantomData<fn(&T)>,
}

impl<T: Serialize> JsonLines<T> {
    /// Opens the file for appending, and creates it if it is missing. An incomplete last line is removed.
    pub fn append_to(path: &Path) -> Result<Self> {
        let fail = |error| Error::unwritable(path, &error);
        own_file(path).map_err(fail)?;
        let mut file = OpenOptions::new()
            .create(true)
            .read(true)
            .write(true)
            .truncate(false)
            .open(path)
            .map_err(fail)?;
        let end = whole_lines(&std::fs::read(path).map_err(fail)?) as u64;
        file.set_len(end).and_then(|()| file.seek(SeekFrom::End(0))).map_err(fail)?;
        Ok(Self { path: path.to_path_buf(), file, line_type: PhantomData })
    }

    /// Appends one line. When this function returns, the line is on the disk.
    pub fn append(&mut self, line: &T) -> Result<()> {
        self.append_all(std::slice::from_ref(line))
    }

    /// Appends lines. When this function returns, all of them are on the disk. They are written together, since each
    /// write waits for the disk.
    pub fn append_all(&mut self, lines: &[T]) -> Result<()> {
        let mut bytes = Vec::new();
        for line in lines {
            serde_json::to_writer(&mut bytes, line)
                .map_err(|error| Error::fault(format!("cannot write {}: {error}", self.path.display())))?;
            bytes.push(b'\n');
        }
        let written = self.file.write_all(&bytes).and_then(|()| self.file.sync_data());
        written.map_err(|error| Error::unwritable(&self.path, &error))
    }
}

/// The contents of a file of JSON lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines<T> {
    /// All complete, readable lines.
    pub lines: Vec<T>,
    /// True if the last line is incomplete and was left out.
    pub torn: bool,
    /// The numbers, counted from 1, of the damaged lines, which were left out because they cannot be read.
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
    /// Returns a note on the damaged lines of the file `name`.
    pub fn damage(&self, name: &str) -> Option<String> {
        let first = self.damaged.first()?;
        let lines = counted(self.damaged.len(), "damaged line");
        Some(format!(
            "raycl ignores {lines} of {name}; the first is line {first}. `raycl repair` removes damaged lines and keeps a copy of the file."
        ))
    }

    /// Returns an input error (a mistake of the user) if no line of the file can be read, although the file has
    /// complete lines: such a file is probably not a journal. `path` is the file's path.
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

/// The help in an error about a folder or a file that holds no results.
pub(super) const FOLDER: &str = "give the path of a folder that `raycl run` wrote, such as results/quick";

/// Reads a journal. A missing journal counts as empty: folders of earlier versions lack some journals, and an attempt
/// that was killed early has none.
pub fn read_lines_if_any<T: DeserializeOwned>(path: &Path) -> Result<Lines<T>> {
    if path.is_file() { read_lines(path) } else { Ok(Lines::default()) }
}

/// Reads a file of JSON lines. An incomplete last line and damaged lines are left out and reported.
pub fn read_lines<T: DeserializeOwned>(path: &Path) -> Result<Lines<T>> {
    let unreadable =
        |error| Error::input(format!("cannot read {}: {error}", path.display())).with_help(FOLDER);
    let mut file = BufReader::new(reader::open(path).map_err(unreadable)?);
    let mut read = Lines::default();
    let mut line = Vec::new();
    for number in 1.. {
        line.clear();
        if file.read_until(b'\n', &mut line).map_err(unreadable)? == 0 {
            break;
        }
        if !line.ends_with(b"\n") {
            read.torn = true;
            break;
        }
        match serde_json::from_slice(&line) {
            Ok(value) => read.lines.push(value),
            Err(_) if line.trim_ascii().is_empty() => {}
            Err(error) => {
                read.reason = without_position(&error);
                read.damaged.push(number);
            }
        }
    }
    Ok(read)
}

/// Returns the message of serde's error without the position. Serde counts lines within one record, so this position
/// would contradict the line's number in the file.
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
    use crate::record::{Outcome, Record, Sample};

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
    }

    /// Writes to a pipe, which accepts bytes but cannot guarantee that they are on a disk.
    #[cfg(unix)]
    #[test]
    fn a_line_is_on_the_disk_or_an_error() {
        let (mut reader, writer) = std::io::pipe().unwrap();
        let file = File::from(std::os::fd::OwnedFd::from(writer));
        let mut journal = JsonLines { path: PathBuf::from("pipe"), file, line_type: PhantomData };
        assert!(journal.append(&record("a")).is_err());
        // All lines are written first, and then the function waits for the disk once.
        assert!(journal.append_all(&["b", "c", "d"].map(record)).is_err());
        drop(journal);
        let mut text = String::new();
        std::io::Read::read_to_string(&mut reader, &mut text).unwrap();
        assert!(text.ends_with('\n'), "it was written: {text}");
        assert_eq!(text.lines().count(), 4, "{text}");
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
