//! Reads the journals of a run. Records that can be read can be summarised, and their journal can still be read after a
//! line is appended.
#![no_main]

mod folder;

use libfuzzer_sys::fuzz_target;
use raycl::record::{JsonLines, Record, Sample, read_lines, summary_csv, summary_markdown, summary_terminal};

fuzz_target!(|bytes: &[u8]| {
    let path = folder::write("records.jsonl", bytes);
    let _ = read_lines::<Sample>(&path);
    if let Ok(read) = read_lines::<Record>(&path) {
        let _ = summary_csv(&read.lines);
        summary_markdown(&read.lines, &[], "?", "!");
        let _ = summary_terminal(&read.lines, false);
        let mut journal = JsonLines::append_to(&path).expect("a journal");
        journal.append(&Record::default()).expect("a line");
        let again = read_lines::<Record>(&path).expect("what was read before");
        assert_eq!((again.lines.len(), again.torn), (read.lines.len() + 1, false));
    }
});
