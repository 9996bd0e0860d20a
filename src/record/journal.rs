//! JSON lines: appended one at a time and on the disk before the next; a last
//! line torn by a crash costs that line only.

use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{ordinary, own_file};
use crate::error::{Error, Result};

/// A file that `T`s are appended to.
#[derive(Debug)]
pub struct JsonLines<T> {
    path: PathBuf,
    file: File,
    line_type: PhantomData<fn(&T)>,
}

impl<T: Serialize> JsonLines<T> {
    /// Opens the file for appending, making it if need be. A torn last line is cut off.
    pub fn append_to(path: &Path) -> Result<Self> {
        let fail = |error| io_error("open", path, &error);
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

    /// Appends one line; it is on the disk when this returns.
    pub fn append(&mut self, line: &T) -> Result<()> {
        let mut bytes = serde_json::to_vec(line)
            .map_err(|error| Error::run(format!("cannot write {}: {error}", self.path.display())))?;
        bytes.push(b'\n');
        let written = self.file.write_all(&bytes).and_then(|()| self.file.sync_data());
        written.map_err(|error| io_error("write", &self.path, &error))
    }
}

/// What a file of JSON lines holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines<T> {
    /// Every whole line.
    pub lines: Vec<T>,
    /// Whether a last line was cut short and left out.
    pub torn: bool,
}

/// Reads a file of JSON lines. A last line without its end is left out; any other bad line is an input
/// error at its place.
pub fn read_lines<T: DeserializeOwned>(path: &Path) -> Result<Lines<T>> {
    let bytes = ordinary(path)
        .and_then(|()| std::fs::read(path))
        .map_err(|error| Error::input(format!("cannot read {}: {error}", path.display())))?;
    let (mut lines, mut start) = (Vec::new(), 0);
    for line in bytes.split_inclusive(|&byte| byte == b'\n') {
        if !line.ends_with(b"\n") {
            return Ok(Lines { lines, torn: true });
        }
        match serde_json::from_slice(line) {
            Ok(value) => lines.push(value),
            Err(_) if line.trim_ascii().is_empty() => {}
            Err(error) => {
                let text = String::from_utf8_lossy(&bytes).into_owned();
                let place = start..start + line.trim_ascii_end().len().min(1);
                let message = format!("this line is no record: {error}");
                return Err(Error::in_file(path.display().to_string(), text, place, message, "starts here"));
            }
        }
        start += line.len();
    }
    Ok(Lines { lines, torn: false })
}

/// The length of `bytes` up to the end of its last line.
fn whole_lines(bytes: &[u8]) -> usize {
    bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |place| place + 1)
}

fn io_error(what: &str, path: &Path, error: &std::io::Error) -> Error {
    Error::run(format!("cannot {what} {}: {error}", path.display()))
        .with_help("choose another folder with --out DIR, or make room in this one")
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
    fn a_bad_line_in_the_middle_is_an_error_at_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("samples.jsonl");
        std::fs::write(&path, "{\"key\":\"a\",\"round\":0,\"ms\":1.5}\nnonsense\n").unwrap();
        let Err(Error::Input(error)) = read_lines::<Sample>(&path) else { panic!("it was read") };
        assert_eq!(error.span.unwrap().offset(), 31);
        assert!(error.message.starts_with("this line is no record"));
    }
}
