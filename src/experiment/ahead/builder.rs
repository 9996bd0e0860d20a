//! The child processes that compile OpenCL programs before points of the experiment need these programs.

use super::Order;
use crate::experiment::protocol::{Built, Reply, Request};
use crate::experiment::waiting::{Spawner, Worker, reply_of};
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// The two spawners (objects that start processes) from which a builder starts its child processes. A thread
/// of the run lets the builder's child processes build one program after another.
pub struct Builder {
    /// Starts the builder's usual processes, which use the driver's cache of programs. The builder's usual
    /// processes store machine code in the driver's cache, so that the workers that measure do not generate
    /// the code again.
    pub usual: Box<dyn Spawner + Send>,
    /// Starts processes that do not use the driver's cache, for programs that an earlier process stored in
    /// this cache. A driver that finds a program in its cache does not compile the program again, and does
    /// not print the program's number of registers.
    pub without_driver_cache: Box<dyn Spawner + Send>,
}

/// How long a builder waits for a reply of one of its processes.
pub struct Patience<'a> {
    /// The longest time that a process may take for one reply, without the time to load a scene.
    pub limit: Duration,
    /// Becomes true when the user ends the run.
    pub interrupted: &'a AtomicBool,
}

/// The processes with which one builder compiles programs, either with or without the driver's cache. Each
/// job (the task of the workers of one device) has one process, which is started when the first program of
/// the job is built.
pub struct Pool {
    spawner: Box<dyn Spawner + Send>,
    workers: HashMap<usize, Box<dyn Worker>>,
}

impl Pool {
    pub fn new(spawner: Box<dyn Spawner + Send>) -> Self {
        Self { spawner, workers: HashMap::new() }
    }

    /// Lets a process build a program, and returns the result; `None` if the program was not built. If the
    /// process died or hung, a new process builds the next program of the same job.
    pub fn build(&mut self, order: &Order, patience: &Patience<'_>) -> Option<Built> {
        let job = order.program.job;
        let mut worker = self.workers.remove(&job).or_else(|| self.start(job, patience))?;
        worker.send(&Request::Build { point: order.point });
        let reply = patience.wait(worker.as_mut())?;
        // A process sends the reply `Refused` if its device breaks down, and then ends.
        if matches!(reply, Reply::Refused(_)) {
            return None;
        }
        self.workers.insert(job, worker);
        match reply {
            Reply::Built(built) => built,
            _ => None,
        }
    }

    /// Ends all processes of the pool. A new process builds the next program.
    pub fn end(&mut self) {
        // Dropping a `Worker` waits until its process has ended. All processes are told to end before the
        // first wait, so that the processes end at the same time.
        self.workers.values_mut().for_each(|worker| worker.dismiss());
        self.workers.clear();
    }

    /// Starts a process and waits until its device is open. Returns `None`, without reporting an error, if
    /// the process or the device cannot be started. If the cause of the failure persists, the worker that
    /// measures on the same device cannot start either, and the run reports that error.
    fn start(&mut self, job: usize, patience: &Patience<'_>) -> Option<Box<dyn Worker>> {
        let mut worker = self.spawner.spawn(job).ok()?;
        matches!(patience.wait(worker.as_mut()), Some(Reply::Started)).then_some(worker)
    }
}

impl Patience<'_> {
    /// Waits for a process's reply and returns it. Returns `None` if the process is dead or hangs, or if the
    /// user has ended the run.
    fn wait(&self, worker: &mut dyn Worker) -> Option<Reply> {
        reply_of(worker, self.limit, Some(self.interrupted))?.ok()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::super::{Program, Room};
    use super::*;
    use crate::error::Result;
    use crate::experiment::waiting::{Death, Wait};
    use std::sync::{Arc, Mutex};

    /// A time limit that is far longer than anything in these tests takes.
    const LIMIT: Duration = Duration::from_secs(120);

    /// Starts processes that reply to each `Build` with the next of `answers`. Stores the jobs (tasks of the
    /// workers of one device) for which processes were started, and the points that were sent to the
    /// processes. Also stores the time limit of each wait for a process.
    #[derive(Clone, Default)]
    struct Scripted {
        answers: Arc<Mutex<Vec<Wait>>>,
        jobs: Arc<Mutex<Vec<usize>>>,
        points: Arc<Mutex<Vec<usize>>>,
        limits: Arc<Mutex<Vec<Duration>>>,
        starts_with: Option<Wait>,
    }

    struct Process {
        of: Scripted,
        has_started: bool,
    }

    impl Spawner for Scripted {
        fn spawn(&mut self, job: usize) -> Result<Box<dyn Worker>> {
            self.jobs.lock().unwrap().push(job);
            Ok(Box::new(Process { of: self.clone(), has_started: false }))
        }
    }

    impl Worker for Process {
        fn send(&mut self, request: &Request) {
            let Request::Build { point } = request else { panic!("a builder only builds") };
            self.of.points.lock().unwrap().push(*point);
        }

        fn wait(&mut self, limit: Duration) -> Wait {
            self.of.limits.lock().unwrap().push(limit);
            if !std::mem::replace(&mut self.has_started, true) {
                return self.of.starts_with.clone().unwrap_or(Wait::Reply(Reply::Started));
            }
            self.of.answers.lock().unwrap().remove(0)
        }
    }

    fn order(job: usize, point: usize) -> Order {
        Order { program: Program { job, hash: "a".into(), scene: None }, point, room: Room::UNLIMITED }
    }

    fn built(build_ms: f64) -> Wait {
        Wait::Reply(Reply::Built(Some(Built { build_ms, from_cache: false, key: None, lacks_log: false })))
    }

    /// Builds the programs of `orders` one after another, and returns the build times in the processes'
    /// replies. Each order consists of a job's number and a point's number.
    fn build(processes: &Scripted, orders: &[(usize, usize)], limit: Duration) -> Vec<Option<f64>> {
        let (mut pool, interrupted) = (Pool::new(Box::new(processes.clone())), AtomicBool::new(false));
        let patience = Patience { limit, interrupted: &interrupted };
        let build = |&(job, point): &(usize, usize)| pool.build(&order(job, point), &patience);
        orders.iter().map(build).map(|built| built.map(|built| built.build_ms)).collect()
    }

    #[test]
    fn each_device_has_one_process_which_builds_all_its_programs() {
        let answers = [1.0, 2.0, 3.0].map(built);
        let processes = Scripted { answers: Arc::new(Mutex::new(answers.into())), ..Scripted::default() };
        let times = build(&processes, &[(2, 10), (0, 11), (2, 12)], LIMIT);
        assert_eq!(times, [1.0, 2.0, 3.0].map(Some));
        assert_eq!(*processes.jobs.lock().unwrap(), [2, 0]);
        assert_eq!(*processes.points.lock().unwrap(), [10, 11, 12]);
    }

    #[test]
    fn after_a_process_died_or_hung_the_next_program_gets_a_new_one() {
        for lost in [Wait::Dead(Death::default()), Wait::Silence] {
            let answers = Arc::new(Mutex::new(vec![lost, built(2.0)]));
            let processes = Scripted { answers, ..Scripted::default() };
            assert_eq!(build(&processes, &[(1, 0), (1, 3)], Duration::ZERO), [None, Some(2.0)]);
            assert_eq!(*processes.jobs.lock().unwrap(), [1, 1]);
            assert!(
                processes.limits.lock().unwrap().iter().all(Duration::is_zero),
                "no wait exceeds the limit"
            );
        }
        // A process that cannot open its device ends without building anything, and each program gets a new process.
        let processes = Scripted { starts_with: Some(Wait::Dead(Death::default())), ..Scripted::default() };
        assert_eq!(build(&processes, &[(1, 0), (1, 3)], LIMIT), [None, None]);
        assert_eq!(*processes.jobs.lock().unwrap(), [1, 1]);
        assert!(processes.points.lock().unwrap().is_empty());
    }

    #[test]
    fn a_silent_process_is_waited_for_until_the_user_ends_the_run() {
        let process = |answers: Vec<Wait>| Process {
            of: Scripted { answers: Arc::new(Mutex::new(answers)), ..Scripted::default() },
            has_started: true,
        };
        let reply = |ends: bool| {
            let patience = Patience { limit: LIMIT, interrupted: &AtomicBool::new(ends) };
            patience.wait(&mut process(vec![Wait::Silence, Wait::Silence, built(4.0)]))
        };
        assert!(matches!(reply(false), Some(Reply::Built(Some(built))) if built.build_ms == 4.0));
        assert!(reply(true).is_none());
    }
}
