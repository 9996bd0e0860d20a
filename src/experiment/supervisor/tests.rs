//! Tests of requests to workers: which worker gets a request, and what the supervisor does if the worker replies, dies
//! or hangs.

use super::*;
use crate::clock::LOOK_UP;
use crate::experiment::protocol::Phase;
use crate::experiment::waiting::{Death, Wait};
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;

/// A time limit that is far longer than anything in these tests takes.
const LIMIT: Duration = Duration::from_secs(120);

/// Starts workers. Stores the numbers of the workers' jobs, the requests to all workers, and the number of
/// workers that were dismissed.
#[derive(Clone, Default)]
struct Noting {
    jobs: Rc<RefCell<Vec<usize>>>,
    requests: Rc<RefCell<Vec<Request>>>,
    dismissed: Rc<Cell<usize>>,
    /// What workers return instead of the usual replies, from the next request on.
    instead: Rc<RefCell<VecDeque<Wait>>>,
    /// A flag that interrupts the run, if there is one; each request sets this flag.
    interrupts: Option<Rc<AtomicBool>>,
    /// What the next worker sends instead of `Reply::Started`.
    at_start: Option<Wait>,
    /// The time limit of every wait for a worker.
    limits: Rc<RefCell<Vec<Duration>>>,
    /// How long the wait for a reply takes if the worker sends no reply.
    silence: Duration,
    /// The number of workers that were started before each call of `compile_afresh`.
    afresh: Rc<RefCell<Vec<usize>>>,
}

struct Noted {
    of: Noting,
    next: Wait,
}

impl Spawner for Noting {
    fn spawn(&mut self, job: usize) -> Result<Box<dyn Worker>> {
        self.jobs.borrow_mut().push(job);
        let next = self.at_start.take().unwrap_or(Wait::Reply(Reply::Started));
        Ok(Box::new(Noted { of: self.clone(), next }))
    }

    fn compile_afresh(&mut self) {
        self.afresh.borrow_mut().push(self.jobs.borrow().len());
    }
}

impl Worker for Noted {
    fn send(&mut self, request: &Request) {
        self.of.requests.borrow_mut().push(request.clone());
        self.of.interrupts.iter().for_each(|flag| flag.store(true, Ordering::Relaxed));
        self.next = Wait::Reply(match request {
            Request::Check { .. } => Reply::Checked { record: Box::default(), ready: true },
            Request::Build { .. } => Reply::Built(None),
            Request::Cast { .. } | Request::Anchor => Reply::Sample(FrameTimes::whole(1.0, 1.0)),
        });
    }

    fn wait(&mut self, limit: Duration) -> Wait {
        self.of.limits.borrow_mut().push(limit);
        match self.next {
            Wait::Reply(Reply::Started) => self.next.clone(),
            _ => {
                let instead = self.of.instead.borrow_mut().pop_front();
                if instead == Some(Wait::Silence) {
                    std::thread::sleep(self.of.silence);
                }
                instead.unwrap_or_else(|| self.next.clone())
            }
        }
    }

    fn dismiss(&mut self) {
        self.of.dismissed.set(self.of.dismissed.get() + 1);
    }
}

fn task(point: usize, job: usize, scene: usize) -> Task<'static> {
    Task { point, job, scene, key: "key", verified: Some("hash") }
}

fn check(point: usize) -> Request {
    Request::Check { point, key: "key".into(), verified: Some("hash".into()) }
}

/// Checks a point, and asserts that the point passes the check.
fn passes(supervisor: &mut Supervisor<'_>, task: Task<'_>) {
    assert!(matches!(supervisor.check(task), Ok(Ok((_, true)))));
}

#[test]
fn workers_are_started_on_their_devices_and_those_started_ahead_are_used() {
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    supervisor.start_ahead([task(0, 2, 0), task(1, 1, 0), task(2, 2, 0)].into_iter()).unwrap();
    assert_eq!(*noting.jobs.borrow(), [2, 1]);
    for task in [task(0, 2, 0), task(1, 1, 0), task(3, 3, 0)] {
        passes(&mut supervisor, task);
    }
    assert_eq!(*noting.jobs.borrow(), [2, 1, 3]);
    assert_eq!(*noting.requests.borrow(), [0, 1, 3].map(check));
}

#[test]
fn in_a_launch_a_worker_goes_on_to_the_next_scene_of_its_device_and_each_launch_has_new_ones() {
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    supervisor.turn_to(1, [task(0, 0, 0), task(1, 1, 0)].into_iter());
    passes(&mut supervisor, task(0, 0, 0));
    passes(&mut supervisor, task(1, 1, 0));
    assert_eq!((noting.jobs.borrow().len(), noting.dismissed.get()), (2, 0));
    // The next group has no point of job 1, so the worker of this job is dismissed.
    supervisor.turn_to(1, [task(2, 0, 1)].into_iter());
    passes(&mut supervisor, task(2, 0, 1));
    assert_eq!((noting.jobs.borrow().clone(), noting.dismissed.get()), (vec![0, 1], 1));
    // The worker of job 0 cannot cast for job 1, so a new worker is started.
    supervisor.turn_to(1, [task(3, 1, 1)].into_iter());
    passes(&mut supervisor, task(3, 1, 1));
    assert_eq!((noting.jobs.borrow().clone(), noting.dismissed.get()), (vec![0, 1, 1], 2));
    supervisor.turn_to(2, [task(3, 1, 1)].into_iter());
    passes(&mut supervisor, task(3, 1, 1));
    assert_eq!((noting.jobs.borrow().clone(), noting.dismissed.get()), (vec![0, 1, 1, 1], 3));
}

#[test]
fn in_each_group_a_point_is_checked_before_it_is_cast() {
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    let mut casts = |turns: bool| {
        if turns {
            supervisor.turn_to(1, [task(5, 0, 0)].into_iter());
        }
        assert!(matches!(supervisor.cast(task(5, 0, 0)), Ok(Some(Ok(_)))));
        std::mem::take(&mut *noting.requests.borrow_mut())
    };
    assert_eq!(casts(true), [check(5), Request::Cast { point: 5 }]);
    assert_eq!(casts(false), [Request::Cast { point: 5 }]);
    assert_eq!(casts(true), [check(5), Request::Cast { point: 5 }]);
}

#[test]
fn an_anchor_that_fails_is_not_run_again_on_its_device() {
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    assert!(supervisor.anchor(task(0, 0, 0)).unwrap().is_none(), "no worker has been started for it");
    for job in [0, 1] {
        passes(&mut supervisor, task(job, job, 0));
    }
    let failed = Reply::Failed { message: "no anchor".into(), help: "go on".into() };
    noting.instead.borrow_mut().push_back(Wait::Reply(failed));
    let error = supervisor.anchor(task(0, 0, 0)).unwrap().unwrap().unwrap_err();
    assert_eq!((error.to_string().as_str(), error.remedy()), ("no anchor", "go on"));
    // The context of a GPU may be unusable after a fault, so a new worker serves the next requests, in another launch.
    passes(&mut supervisor, task(0, 0, 0));
    assert_eq!((noting.jobs.borrow().clone(), supervisor.losses()), (vec![0, 1, 0], 1));
    assert!(supervisor.anchor(task(0, 0, 0)).unwrap().is_none());
    assert!(matches!(supervisor.anchor(task(1, 1, 0)), Ok(Some(Ok(_)))));
    let anchors = noting.requests.borrow().iter().filter(|request| **request == Request::Anchor).count();
    assert_eq!(anchors, 2);
}

#[test]
fn after_an_interruption_a_sample_is_waited_for_and_a_check_is_not() {
    let interrupted = Rc::new(AtomicBool::new(false));
    let noting = Noting { interrupts: Some(Rc::clone(&interrupted)), ..Noting::default() };
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &interrupted, LIMIT);
    supervisor
        .posts
        .insert((0, 0), Post { worker: noting.clone().spawn(0).unwrap(), ready: HashSet::from([0]) });
    noting.instead.borrow_mut().push_back(Wait::Silence);
    assert!(matches!(supervisor.cast(task(0, 0, 0)), Ok(Some(Ok(_)))));
    interrupted.store(false, Ordering::Relaxed);
    noting.instead.borrow_mut().push_back(Wait::Silence);
    assert_eq!(supervisor.check(task(0, 0, 0)).unwrap_err().exit_code(), 130);
    assert!(supervisor.check(task(0, 0, 0)).is_err() && noting.requests.borrow().len() == 2);
}

#[test]
fn a_points_failure_says_how_its_worker_was_lost() {
    let death =
        |last_words: &str| Death { cause: "was killed by SIGSEGV".into(), last_words: last_words.into() };
    let reason = |losses: &[Wait], limit: Duration| {
        let (noting, never) = (Noting::default(), AtomicBool::new(false));
        noting.instead.borrow_mut().extend(losses.iter().cloned());
        let mut spawner = noting.clone();
        let mut supervisor = Supervisor::new(&mut spawner, &never, limit);
        let failure = supervisor.check(task(0, 0, 0)).unwrap().unwrap_err();
        assert_eq!(supervisor.losses(), losses.len());
        (failure.outcome, failure.reason)
    };
    let twice = [Wait::Dead(death("first")), Wait::Dead(death("oh"))];
    let both =
        "a worker process died on both attempts; the second one was killed by SIGSEGV; its last message: oh";
    assert_eq!(reason(&twice, LIMIT), (Outcome::Crashed, both.to_owned()));
    let hung = "the worker process did not answer within 0 s and was ended; if the point needs more time, \
                raise `raycl run --hang-limit`";
    assert_eq!(reason(&[Wait::Silence], Duration::ZERO), (Outcome::TimedOut, hung.to_owned()));
    // After three points have crashed twice, no other point is tried twice.
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    let mut attempts = |point| {
        let before = noting.requests.borrow().len();
        noting.instead.borrow_mut().extend([death(""), death("")].map(Wait::Dead));
        let failure = supervisor.check(task(point, 0, 0)).unwrap().unwrap_err();
        noting.instead.borrow_mut().clear();
        (noting.requests.borrow().len() - before, failure.reason)
    };
    let crashed = "was killed by SIGSEGV";
    for point in 0..3 {
        assert_eq!(
            attempts(point),
            (2, format!("a worker process died on both attempts; the second one {crashed}"))
        );
    }
    assert_eq!(attempts(3), (1, format!("the worker process {crashed}")));
}

#[test]
fn after_a_worker_died_the_next_one_of_its_scene_compiles_its_programs_again() {
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    passes(&mut supervisor, task(0, 0, 0));
    noting.instead.borrow_mut().push_back(Wait::Dead(Death::default()));
    assert!(matches!(supervisor.cast(task(0, 0, 0)), Ok(None)));
    passes(&mut supervisor, task(1, 0, 1));
    assert!(noting.afresh.borrow().is_empty(), "the next worker is that of another scene");
    passes(&mut supervisor, task(0, 0, 0));
    supervisor.retire();
    passes(&mut supervisor, task(0, 0, 0));
    assert_eq!((noting.afresh.borrow().clone(), noting.jobs.borrow().len()), (vec![2], 4));
}

#[test]
fn a_device_that_breaks_down_in_a_check_costs_its_point_only() {
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    let failure = PointFailure::new(Outcome::LaunchFailed, "clFinish returned the unknown status -1108");
    noting.instead.borrow_mut().push_back(Wait::Reply(Reply::Refused(failure.clone())));
    assert_eq!(supervisor.check(task(0, 0, 0)).unwrap().unwrap_err(), failure);
    passes(&mut supervisor, task(1, 0, 0));
    assert_eq!((noting.jobs.borrow().len(), supervisor.losses()), (2, 1), "a new worker goes on");
    // A device that breaks down before it is open ends the run.
    let mut broken = Noting { at_start: Some(Wait::Reply(Reply::Refused(failure))), ..Noting::default() };
    let error = Supervisor::new(&mut broken, &never, LIMIT).check(task(0, 0, 0)).unwrap_err();
    assert_eq!(error.to_string(), "clFinish returned the unknown status -1108");
}

#[test]
fn a_workers_own_error_ends_the_run_with_its_words_and_so_does_a_worker_that_cannot_start() {
    let never = AtomicBool::new(false);
    let noting = Noting::default();
    let failed = Reply::Failed { message: "a scene changed".into(), help: "use --resume".into() };
    noting.instead.borrow_mut().push_back(Wait::Reply(failed));
    let mut spawner = noting;
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    let error = supervisor.check(task(0, 0, 0)).unwrap_err();
    assert_eq!((error.to_string().as_str(), error.remedy()), ("a scene changed", "use --resume"));
    let death = Death { cause: "ended with exit status: 1".into(), last_words: String::new() };
    let mut dead = Noting { at_start: Some(Wait::Dead(death)), ..Noting::default() };
    let error = Supervisor::new(&mut dead, &never, LIMIT).check(task(0, 0, 0)).unwrap_err();
    assert_eq!(error.to_string(), "a worker process could not start: it ended with exit status: 1");
}

#[test]
fn a_frame_that_takes_longer_than_the_limit_is_given_up_with_its_worker() {
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, Duration::ZERO);
    passes(&mut supervisor, task(0, 0, 0));
    noting.instead.borrow_mut().push_back(Wait::Silence);
    let failure = supervisor.cast(task(0, 0, 0)).unwrap().unwrap().unwrap_err();
    assert_eq!((failure.outcome, supervisor.losses()), (Outcome::TimedOut, 1));
    passes(&mut supervisor, task(1, 0, 0));
    // If the anchor hangs, the run waits only until the limit.
    noting.instead.borrow_mut().push_back(Wait::Silence);
    let error = supervisor.anchor(task(1, 0, 0)).unwrap().unwrap().unwrap_err();
    assert!(
        error.to_string().ends_with("failed: the worker process did not answer within 0 s and was ended")
    );
    assert_eq!(supervisor.losses(), 2, "the launch is repeated");
    passes(&mut supervisor, task(2, 0, 0));
    assert_eq!(noting.jobs.borrow().len(), 3, "each hung worker is replaced");
}

/// If a wait takes much longer than its limit, raycl itself was stopped.
#[test]
fn time_in_which_raycl_was_stopped_does_not_count_and_a_worker_that_hangs_is_given_up() {
    let limit = LOOK_UP * 5 / 2;
    let (noting, never) = (Noting { silence: limit, ..Noting::default() }, AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, limit);
    noting.instead.borrow_mut().push_back(Wait::Silence);
    passes(&mut supervisor, task(0, 0, 0));
    noting.instead.borrow_mut().extend([Wait::Silence, Wait::Silence]);
    let failure = supervisor.cast(task(0, 0, 0)).unwrap().unwrap().unwrap_err();
    assert_eq!((failure.outcome, supervisor.losses()), (Outcome::TimedOut, 1));
}

/// A wait of more than twice `LOOK_UP` counts as twice `LOOK_UP`. The limit is 2.5 times `LOOK_UP`, so a worker exceeds
/// the limit if it is silent twice while it casts.
#[test]
fn the_limit_holds_for_each_phase_in_which_a_worker_casts_and_for_no_other_work() {
    let limit = LOOK_UP * 5 / 2;
    let (noting, never) = (Noting { silence: limit, ..Noting::default() }, AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, limit);
    let [casts, works_on_the_host] =
        [Phase::Cast, Phase::Host].map(|phase| Wait::Reply(Reply::Begins(phase)));
    let in_time = [Wait::Silence, works_on_the_host.clone(), Wait::Silence, Wait::Silence, casts.clone()];
    noting.instead.borrow_mut().extend(in_time.into_iter().chain([Wait::Silence]));
    passes(&mut supervisor, task(0, 0, 0));
    noting.instead.borrow_mut().extend([works_on_the_host, casts, Wait::Silence, Wait::Silence]);
    let failure = supervisor.check(task(1, 0, 0)).unwrap().unwrap_err();
    assert_eq!((failure.outcome, supervisor.losses()), (Outcome::TimedOut, 1));
}

#[test]
fn while_a_worker_is_silent_interruptions_are_looked_up_and_no_wait_exceeds_the_limit() {
    for (limit, wait) in
        [(LIMIT, Duration::from_millis(100)), (Duration::from_millis(7), Duration::from_millis(7))]
    {
        let (noting, never) = (Noting::default(), AtomicBool::new(false));
        let mut spawner = noting.clone();
        let mut supervisor = Supervisor::new(&mut spawner, &never, limit);
        assert!(matches!(supervisor.cast(task(0, 0, 0)), Ok(Some(Ok(_)))));
        // The supervisor waits for the start of the worker, for the point's check and for the cast.
        assert_eq!(*noting.limits.borrow(), [wait; 3]);
    }
}

#[test]
fn a_frame_is_not_cast_if_its_point_fails_the_check_and_is_cast_again_if_its_worker_died() {
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    let failed = Record { outcome: Outcome::WrongImage, reason: Some("dark".into()), ..Record::default() };
    let reply = Reply::Checked { record: Box::new(failed), ready: false };
    noting.instead.borrow_mut().push_back(Wait::Reply(reply));
    let failure = supervisor.cast(task(0, 0, 0)).unwrap().unwrap().unwrap_err();
    assert_eq!(failure, PointFailure::new(Outcome::WrongImage, "dark"));
    assert_eq!(*noting.requests.borrow(), [check(0)]);
    for point in [0, 1] {
        // A point that failed its check is checked again. A new worker also checks each point before it casts
        // the point.
        for outcome in ["it is cast", "its worker dies"] {
            noting.requests.borrow_mut().clear();
            assert!(matches!(supervisor.cast(task(point, 0, 0)), Ok(Some(Ok(_)))), "{outcome}");
            assert_eq!(*noting.requests.borrow(), [check(point), Request::Cast { point }]);
            noting.instead.borrow_mut().push_back(Wait::Dead(Death::default()));
            if outcome == "it is cast" {
                assert!(matches!(supervisor.cast(task(point, 0, 0)), Ok(None)), "the caller may try again");
            } else {
                let failure = supervisor.cast(task(point, 0, 0)).unwrap().unwrap().unwrap_err();
                assert_eq!(failure.outcome, Outcome::Crashed);
            }
        }
    }
}

#[test]
fn a_worker_that_was_started_ahead_and_died_is_replaced_and_one_that_hangs_is_reported() {
    let never = AtomicBool::new(false);
    let noting = Noting { at_start: Some(Wait::Dead(Death::default())), ..Noting::default() };
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    supervisor.start_ahead([task(0, 0, 0)].into_iter()).unwrap();
    passes(&mut supervisor, task(0, 0, 0));
    assert_eq!(noting.jobs.borrow().len(), 2);
    // `retire` also ends workers that `start_ahead` has started and that have no request yet, so the next request goes
    // to a new worker.
    supervisor.start_ahead([task(1, 1, 0)].into_iter()).unwrap();
    supervisor.retire();
    passes(&mut supervisor, task(1, 1, 0));
    assert_eq!((noting.jobs.borrow().clone(), noting.dismissed.get()), (vec![0, 0, 1, 1], 2));
    let limit = Duration::from_millis(2);
    let mut hanging = Noting { at_start: Some(Wait::Silence), ..Noting::default() };
    let error = Supervisor::new(&mut hanging, &never, limit).check(task(0, 0, 0)).unwrap_err();
    let words = "a worker process could not start: it did not open its device in 0.002 s";
    assert_eq!(error.to_string(), words);
}

#[test]
fn a_worker_that_reports_a_failed_launch_is_replaced_and_counts_as_lost() {
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    let fails = |outcome| {
        let record = Box::new(Record { outcome, ..Record::default() });
        Wait::Reply(Reply::Checked { record, ready: false })
    };
    // If a point does not fit on its device, nothing is wrong with the device's state, so the worker is kept.
    for (outcome, workers) in [(Outcome::Infeasible, 1), (Outcome::LaunchFailed, 2)] {
        noting.instead.borrow_mut().push_back(fails(outcome));
        assert!(matches!(supervisor.check(task(0, 0, 0)), Ok(Ok((_, false)))));
        passes(&mut supervisor, task(1, 0, 0));
        assert_eq!((noting.jobs.borrow().len(), supervisor.losses()), (workers, workers - 1));
    }
    let refused = Reply::Refused(PointFailure::new(Outcome::LaunchFailed, "no"));
    noting.instead.borrow_mut().push_back(Wait::Reply(refused));
    assert!(matches!(supervisor.cast(task(1, 0, 0)), Ok(Some(Err(_)))));
    passes(&mut supervisor, task(2, 0, 0));
    assert_eq!((noting.jobs.borrow().len(), supervisor.losses()), (3, 2));
}

#[test]
fn deaths_at_a_point_are_counted_for_each_device_and_each_folder_of_kernels() {
    let (noting, never) = (Noting::default(), AtomicBool::new(false));
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &never, LIMIT);
    for job in [0, 1] {
        noting.instead.borrow_mut().push_back(Wait::Dead(Death::default()));
        passes(&mut supervisor, task(0, job, 0));
    }
    assert_eq!(supervisor.losses(), 2);
}

#[test]
fn a_worker_that_dies_after_an_interruption_does_not_count_against_its_point() {
    let interrupted = Rc::new(AtomicBool::new(false));
    let noting = Noting { interrupts: Some(Rc::clone(&interrupted)), ..Noting::default() };
    let mut spawner = noting.clone();
    let mut supervisor = Supervisor::new(&mut spawner, &interrupted, LIMIT);
    noting.instead.borrow_mut().push_back(Wait::Dead(Death::default()));
    assert_eq!(supervisor.check(task(0, 0, 0)).unwrap_err().exit_code(), 130);
    assert_eq!(supervisor.losses(), 0);
}
