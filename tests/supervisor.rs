//! Tests of the supervisor, the part of a run that starts worker processes and replaces those that die. The workers of
//! these tests follow a script: they die, hang or refuse requests.

use crate::common::mock::{Act, CONFIG, Mock, POINTS, Scene, count, execute, folder, once, point_of};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use raycl::experiment::{PointFailure, Reply, Request, Spawner, Wait, Worker};
use raycl::record::Outcome;
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

#[test]
fn without_faults_one_worker_measures_all_groups_of_a_launch() {
    for launches in [1, 3] {
        let config = CONFIG.replace("launches = 1", &format!("launches = {launches}"));
        let (records, counts) = once(&config, |_| Act::Answer);
        assert_eq!(count(&records, Outcome::Measured), POINTS);
        assert!(records.iter().all(|record| record.samples_ms.len() >= 4 * launches));
        assert_eq!((counts.borrow().workers, counts.borrow().checks.len()), (launches, POINTS));
    }
}

#[test]
fn a_point_that_kills_its_worker_costs_itself_and_nothing_else() {
    for casting in [false, true] {
        let dies = move |scene: &Scene<'_>| {
            let here = matches!(scene.request, Request::Cast { .. }) == casting;
            if here && point_of(scene.request) == 3 { Act::Die } else { Act::Answer }
        };
        let (records, counts) = once(CONFIG, dies);
        assert_eq!(count(&records, Outcome::Measured), POINTS - 1);
        let lost = records.iter().find(|record| record.outcome == Outcome::Crashed).expect("a crash");
        let reason = lost.reason.as_deref().unwrap_or_default();
        assert!(
            reason.contains("SIGSEGV") && reason.contains("both attempts") && reason.contains("oh"),
            "{reason}"
        );
        assert_eq!(counts.borrow().workers, 1 + 2, "two deaths, two fresh workers");
        assert!(records.iter().filter(|r| r.outcome == Outcome::Measured).all(|r| r.samples_ms.len() == 4));
    }
}

#[test]
fn a_worker_killed_once_costs_nothing() {
    let (records, _) = once(CONFIG, |scene| if scene.requests == 17 { Act::Die } else { Act::Answer });
    assert_eq!(count(&records, Outcome::Measured), POINTS);
}

#[test]
fn a_hang_is_ended_and_not_tried_again() {
    let hangs = |scene: &Scene<'_>| if point_of(scene.request) == 2 { Act::Hang } else { Act::Answer };
    let (records, counts) = once(CONFIG, hangs);
    assert_eq!((count(&records, Outcome::Measured), count(&records, Outcome::TimedOut)), (POINTS - 1, 1));
    assert_eq!((counts.borrow().workers, counts.borrow().checks[&2]), (1 + 1, 1));
}

#[test]
fn crashes_that_repeat_stop_being_retried() {
    let (records, counts) = once(CONFIG, |_| Act::Die);
    assert_eq!(count(&records, Outcome::Crashed), POINTS);
    assert_eq!(counts.borrow().workers, 3 * 2 + (POINTS - 3), "three points twice, the others once");
}

#[test]
fn a_failed_launch_costs_its_point_only_even_if_the_device_then_refuses_everything_to_the_worker() {
    /// Starts workers whose device fails at point 1 of the experiment: if `casting` is true, when the point
    /// is cast for the first time; if `casting` is false, when the point is checked.
    struct Failing {
        of: Mock,
        casting: bool,
    }
    struct FailingWorker {
        of: Box<dyn Worker>,
        casting: bool,
        has_failed: bool,
    }
    impl Spawner for Failing {
        fn spawn(&mut self, job: usize) -> raycl::Result<Box<dyn Worker>> {
            let of = self.of.spawn(job)?;
            Ok(Box::new(FailingWorker { of, casting: self.casting, has_failed: false }))
        }
    }
    impl Worker for FailingWorker {
        fn send(&mut self, request: &Request) {
            let is_cast = matches!(request, Request::Cast { .. });
            self.has_failed |= point_of(request) == 1 && is_cast == self.casting;
            self.of.send(request);
        }
        fn wait(&mut self, limit: Duration) -> Wait {
            let failure = PointFailure::new(Outcome::LaunchFailed, "CL_OUT_OF_RESOURCES");
            match self.of.wait(limit) {
                Wait::Reply(Reply::Checked { record, .. }) if self.has_failed => {
                    let record = Box::new(failure.write_into(*record));
                    Wait::Reply(Reply::Checked { record, ready: false })
                }
                Wait::Reply(Reply::Sample(_)) if self.has_failed => Wait::Reply(Reply::Refused(failure)),
                wait => wait,
            }
        }
    }
    for casting in [false, true] {
        let folder = folder();
        let mut failing = Failing { of: Mock::new(|_| Act::Answer), casting };
        let records = execute(CONFIG, folder.path(), &mut failing, &AtomicBool::new(false)).expect("it runs");
        assert_eq!(count(&records, Outcome::LaunchFailed), 1, "casting: {casting}");
        let measured: Vec<_> = records.iter().filter(|one| one.outcome == Outcome::Measured).collect();
        assert_eq!(measured.len(), POINTS - 1);
        assert!(measured.iter().all(|one| one.samples_ms.len() == 4), "samples of the ended launch count");
        assert_eq!(failing.of.counts.borrow().workers, 2);
    }
}

#[test]
fn workers_that_die_at_random_moments_cost_nothing() {
    for seed in 0..50 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut struck = HashMap::new();
        let (records, _) = once(CONFIG, move |scene| {
            // At most one worker dies per point of the experiment. If a second worker died at the same point,
            // the supervisor would count the point as failed.
            let strikes: &mut usize = struck.entry(point_of(scene.request)).or_default();
            if *strikes == 0 && rng.random_bool(0.1) {
                *strikes += 1;
                return Act::Die;
            }
            Act::Answer
        });
        assert_eq!(count(&records, Outcome::Measured), POINTS, "seed {seed}");
    }
}
