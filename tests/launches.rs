//! Tests of launches. A launch is one measurement of a group of points. Each launch uses new worker
//! processes. A launch is repeated completely if one of its workers died or if it was interrupted.

use crate::common::mock::{Act, Mock, count, execute, folder, nothing_twice, once, with_run};
use raycl::experiment::Past;
use raycl::record::{Outcome, Record, Sample, read_lines};
use std::collections::HashSet;
use std::sync::atomic::{AtomicBool, Ordering};

const LAUNCHES: &str = r#"
question = "?"
expectation = "!"
scenes = ["scenes/triangle.toml"]
image_sizes = [[8, 5], [16, 10]]
local_sizes = [1]
strategies = ["naive", "deferred"]
baselines = ["serial"]
timing = { launches = 3, warmup = 0, min_samples = 15, max_samples = 15 }
"#;

#[test]
fn each_launch_is_a_fresh_worker_and_groups_take_turns() {
    let folder = folder();
    let mut mock = Mock::new(|_| Act::Answer);
    let records = execute(LAUNCHES, folder.path(), &mut mock, &AtomicBool::new(false)).expect("it runs");
    assert_eq!(mock.counts.borrow().workers, 3, "both groups of a launch use the same worker");
    assert!(mock.counts.borrow().checks.values().all(|checks| *checks == 3), "each launch checks its points");
    for record in &records {
        assert_eq!((record.samples_ms.len(), record.samples_at_ms.len()), (15, 15));
        let mut launches = record.sample_launches.clone();
        launches.dedup();
        assert_eq!(launches.len(), 3, "{launches:?}");
        assert!(launches.windows(2).all(|pair| pair[0] < pair[1]) && launches != [0, 1, 2], "{launches:?}");
        assert!(record.interval_ms.is_some());
    }
    // The baseline (the caster on the host) is measured in the same rounds of samples as the kernels.
    let samples = read_lines::<Sample>(&folder.path().join("samples.jsonl")).expect("samples").lines;
    for round in samples.chunks(3) {
        assert!(round.iter().all(|one| (one.launch, one.round) == (round[0].launch, round[0].round)));
        let keys: HashSet<_> = round.iter().map(|sample| &sample.key).collect();
        assert_eq!(keys.len(), 3);
    }
}

#[test]
fn a_resumed_run_takes_whole_launches_over_and_repeats_half_ones() {
    let folder = folder();
    let interrupted: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
    // The run is interrupted while the first group of points is in its second launch. By then, both groups of
    // points have finished their first launch, which took 42 requests to the workers.
    let mut mock = Mock::new(|scene| {
        interrupted.store(scene.requests >= 52, Ordering::Relaxed);
        Act::Answer
    });
    execute(LAUNCHES, folder.path(), &mut mock, interrupted).expect_err("it is interrupted");
    let before = read_lines::<Sample>(&folder.path().join("samples.jsonl")).expect("samples").lines;
    let half = before.last().expect("samples").launch;
    let mut mock = Mock::new(|_| Act::Answer);
    let records = execute(LAUNCHES, folder.path(), &mut mock, &AtomicBool::new(false)).expect("it resumes");
    assert_eq!(mock.counts.borrow().workers, 2, "one launch of each group was complete");
    assert_eq!(count(&records, Outcome::Measured), 2 * 3);
    for record in &records {
        assert!(!record.sample_launches.contains(&half) && record.samples_ms.len() == 15);
    }
    let after = read_lines::<Sample>(&folder.path().join("samples.jsonl")).expect("samples").lines;
    assert!(after.starts_with(&before), "nothing measured is lost");
    nothing_twice(folder.path());
}

#[test]
fn a_launch_that_loses_its_worker_is_repeated_whole() {
    let (records, counts) = once(LAUNCHES, |scene| if scene.requests == 10 { Act::Die } else { Act::Answer });
    assert_eq!(count(&records, Outcome::Measured), 2 * 3);
    assert_eq!(counts.borrow().workers, 3 + 1);
    assert!(
        records.iter().all(|record| record.samples_ms.len() == 15 && !record.sample_launches.contains(&0)
            || record.image_size == [16, 10])
    );
}

#[test]
fn how_long_a_run_takes_is_estimated_from_earlier_times() {
    let folder = folder();
    let expected = |earlier: &[Record], done: &[Record]| {
        let past = Past { records: done.to_vec(), ..Past::default() };
        with_run(LAUNCHES, folder.path(), |run| run.expected(earlier, &past)).expect("it is foreseen")
    };
    let unknown = expected(&[], &[]).to_string();
    assert!(
        unknown.starts_with(
            "6 points in 3 launches: the duration is unknown; measuring each point takes at least 15 frames"
        ),
        "{unknown}"
    );
    // The records of the mock (a run with simulated workers) have neither times nor sizes, so the test sets
    // them.
    let timed = |(index, record): (usize, &Record)| Record {
        host_median_ms: Some(1000.0),
        image_size: if index < 3 { [8, 5] } else { [16, 10] },
        local_size: (!record.is_baseline()).then_some([1, 1]),
        ..record.clone()
    };
    let records = execute(LAUNCHES, folder.path(), &mut Mock::new(|_| Act::Answer), &AtomicBool::new(false));
    let records: Vec<Record> = records.expect("it runs").iter().enumerate().map(timed).collect();
    let known = expected(&records, &[]);
    // The expected time of the run is the sum of a second for each sample (15 per point), a second for each check of a
    // frame (3 per point), and half a second for each of three launches of each of two groups. The records say that the
    // mock's first checks took no time, but raycl expects that a check takes at least the time of a frame.
    assert_eq!((known.points, known.known), (6, 6));
    assert!((111..=116).contains(&known.time.as_secs()), "{:?}", known.time);
    // The run may add at most as many launches as the config asks for. In the added launches, too, each check takes a
    // second. Each of the six launches may also take twice as many samples, which takes 30 s more. Each launch may
    // also wait for half the time of all its samples, for another 30 s.
    assert!((468..=474).contains(&known.additional.as_secs()), "{:?}", known.additional);
    // The times of two strategies at one size also allow an estimate for the other size, which has four times the
    // pixels.
    let some = expected(&records[..2], &[]);
    assert_eq!((some.points, some.known), (6, 4));
    assert!(some.to_string().contains("for 4 of these points, based on earlier times"), "{some}");
    let rest = expected(&records, &records[1..]);
    assert_eq!((rest.points, rest.known, rest.others), (1, 1, 0));
    let of_another = Record { key: "of another config".to_owned(), ..Record::default() };
    let rest = expected(&records, &[&records[1..], &[of_another]].concat());
    assert_eq!((rest.points, rest.known, rest.others), (1, 1, 1));
}
