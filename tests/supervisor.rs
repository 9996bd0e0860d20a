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
fn a_refused_frame_costs_its_point_only() {
    struct Refusing(Mock);
    struct RefusingWorker(Box<dyn Worker>, bool);
    impl Spawner for Refusing {
        fn spawn(&mut self, device: usize) -> raycl::Result<Box<dyn Worker>> {
            Ok(Box::new(RefusingWorker(self.0.spawn(device)?, false)))
        }
    }
    impl Worker for RefusingWorker {
        fn send(&mut self, request: &Request) {
            self.1 = matches!(request, Request::Cast { point: 1 });
            self.0.send(request);
        }
        fn wait(&mut self, limit: Duration) -> Wait {
            match self.0.wait(limit) {
                Wait::Reply(_) if self.1 => Wait::Reply(Reply::Refused(PointFailure::new(
                    Outcome::LaunchFailed,
                    "CL_OUT_OF_RESOURCES",
                ))),
                wait => wait,
            }
        }
    }
    let folder = folder();
    let mut refusing = Refusing(Mock::new(|_| Act::Answer));
    let records = execute(CONFIG, folder.path(), &mut refusing, &AtomicBool::new(false)).expect("it runs");
    assert_eq!((count(&records, Outcome::LaunchFailed), count(&records, Outcome::Measured)), (1, POINTS - 1));
}

#[test]
fn workers_that_die_at_random_moments_cost_nothing() {
    for seed in 0..50 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut struck = HashMap::new();
        let (records, _) = once(CONFIG, move |scene| {
            // At most one worker dies per point. After a second loss, the supervisor would count the point as
            // failed.
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
