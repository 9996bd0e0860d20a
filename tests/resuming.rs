//! Runs that continue an earlier session, which was interrupted or whose files are incomplete.

use crate::common::mock::{
    Act, CONFIG, Mock, POINTS, count, execute, execute_run, folder, nothing_twice, with_run,
};
use raycl::Error;
use raycl::experiment::Run;
use raycl::record::{Outcome, Sample, read_lines};
use std::sync::atomic::{AtomicBool, Ordering};

#[test]
fn an_interrupted_run_goes_on_where_it_stopped() {
    let folder = folder();
    let interrupted: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
    let mut sessions = 0;
    let records = loop {
        sessions += 1;
        interrupted.store(false, Ordering::Relaxed);
        // Every session (one call of `execute` on this folder) gets a little further. Each session checks again the
        // pictures of points that are not completely measured. It also repeats the launch (a measurement of points by
        // new processes) that the last session did not complete.
        let mut mock = Mock::new(move |scene| {
            interrupted.store(scene.requests >= 9 * sessions, Ordering::Relaxed);
            Act::Answer
        });
        match execute(CONFIG, folder.path(), &mut mock, interrupted) {
            Ok(records) => break records,
            Err(error @ Error::Interrupted { .. }) => assert_eq!(error.exit_code(), 130),
            Err(error) => panic!("{error}"),
        }
        nothing_twice(folder.path());
    };
    assert!((5..20).contains(&sessions), "{sessions}");
    assert_eq!(count(&records, Outcome::Measured), POINTS);
    assert!(records.iter().all(|record| record.samples_ms.len() == 4));
    nothing_twice(folder.path());
}

const SMALL: &str = r#"
question = "?"
expectation = "!"
scenes = ["scenes/triangle.toml"]
image_sizes = [[8, 5]]
local_sizes = [1]
strategies = ["naive", "deferred"]
timing = { launches = 1, warmup = 0, min_samples = 2, max_samples = 2, time_limit_ms = 1000 }
"#;

/// Resumes a run with a file that is cut off at each byte in turn: no complete line is lost, and no sample is measured
/// again.
fn torn_at_every_byte(name: &str) {
    let (whole, torn) = (folder(), folder());
    let off = AtomicBool::new(false);
    execute(SMALL, whole.path(), &mut Mock::new(|_| Act::Answer), &off).expect("it runs");
    let read = |name: &str| std::fs::read(whole.path().join(name)).expect("a journal");
    let journals = [("records.jsonl", read("records.jsonl")), ("samples.jsonl", read("samples.jsonl"))];
    let length = read(name).len();
    let resume_after = |cut: usize, run: &Run<'_>| {
        for (file, bytes) in &journals {
            // A point's samples are written before its record. A test that cuts off records.jsonl therefore
            // keeps all of samples.jsonl. A second test cuts off only samples.jsonl.
            let end = if *file == name { cut } else { bytes.len() };
            std::fs::write(torn.path().join(file), &bytes[..end]).expect("a torn journal");
        }
        // A line counts even if its line break is cut off.
        let lines = read(name)[..=cut].iter().filter(|&&byte| byte == b'\n').count();
        let mut mock = Mock::new(|_| Act::Answer);
        let records = execute_run(run, torn.path(), &mut mock, &off).expect("it resumes");
        assert_eq!(count(&records, Outcome::Measured), 2, "cut at {cut}");
        let counts = mock.counts.borrow();
        // If the record of a measured point is missing, the first frame of the point is checked again, but
        // its samples are not measured again. A point whose record is complete is not measured again, even if
        // its samples are lost.
        let checks = if name == "records.jsonl" { 2 - lines } else { 0 };
        assert_eq!((counts.checks.len(), counts.casts.len()), (checks, 0), "cut at {cut}");
        nothing_twice(torn.path());
        if cut.is_multiple_of(64) {
            // A resumed folder has an environment file for every session.
            for entry in std::fs::read_dir(torn.path()).expect("a folder").flatten() {
                if entry.file_name().to_string_lossy().starts_with("environment") {
                    let _ = std::fs::remove_file(entry.path());
                }
            }
        }
    };
    // The config is read once, since cutting off a file of results does not affect it.
    with_run(SMALL, torn.path(), |run| (0..length).for_each(|cut| resume_after(cut, run)));
}

#[test]
fn records_torn_at_every_byte() {
    torn_at_every_byte("records.jsonl");
}

#[test]
fn samples_torn_at_every_byte() {
    torn_at_every_byte("samples.jsonl");
}

#[test]
fn samples_torn_before_any_record_are_completed() {
    let whole = folder();
    let off = AtomicBool::new(false);
    execute(SMALL, whole.path(), &mut Mock::new(|_| Act::Answer), &off).expect("it runs");
    let samples = std::fs::read(whole.path().join("samples.jsonl")).expect("samples");
    for cut in (0..samples.len() - 1).step_by(7) {
        let torn = folder();
        std::fs::write(torn.path().join("samples.jsonl"), &samples[..cut]).expect("a torn journal");
        let complete = samples[..=cut].iter().filter(|&&byte| byte == b'\n').count();
        let mut mock = Mock::new(|_| Act::Answer);
        let records = execute(SMALL, torn.path(), &mut mock, &off).expect("it resumes");
        assert_eq!(count(&records, Outcome::Measured), 2);
        // The incomplete launch is repeated completely, and the samples of its first attempt stay in the
        // file.
        assert_eq!(mock.counts.borrow().casts.values().sum::<usize>(), 4, "cut at {cut}");
        let lines = read_lines::<Sample>(&torn.path().join("samples.jsonl")).expect("samples").lines;
        assert_eq!(lines.len(), complete + 4);
        nothing_twice(torn.path());
    }
}

#[test]
fn changed_timing_is_measured_again_and_unchanged_is_not() {
    let folder = folder();
    let off = AtomicBool::new(false);
    let checks = |text: &str| {
        let mut mock = Mock::new(|_| Act::Answer);
        let records = execute(text, folder.path(), &mut mock, &off).expect("it runs");
        let checks = mock.counts.borrow().checks.len();
        (records.len(), checks)
    };
    assert_eq!(checks(CONFIG), (POINTS, POINTS));
    assert_eq!(checks(CONFIG), (POINTS, 0));
    let longer = CONFIG.replace("local_sizes = [1, 2, 4]", "local_sizes = [1, 2, 4, 8]");
    assert_eq!(checks(&longer), (POINTS + 4, 4), "only what is new");
    let other = CONFIG.replace("max_samples = 4", "max_samples = 5");
    assert_eq!(checks(&other), (POINTS, POINTS));
    assert_eq!(checks(CONFIG), (POINTS, 0), "the first results are still there");
}
