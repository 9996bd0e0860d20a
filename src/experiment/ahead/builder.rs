//! The processes that compile programs before points need them.

use super::{LOOK_UP, Order};
use crate::experiment::protocol::{Built, Reply, Request};
use crate::experiment::supervisor::{Spawner, Wait, Worker};
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A builder: starts the processes that build one program after another.
pub struct Builder {
    /// Starts the usual processes, which use the driver's cache of programs. They store machine code in this cache,
    /// so that the workers that measure do not generate the code again.
    pub usual: Box<dyn Spawner + Send>,
    /// Starts processes that do not use the driver's cache, for programs that an earlier process stored in this
    /// cache. With the cache, the driver would not compile such a program again, and would not print its number of
    /// registers.
    pub without_driver_cache: Box<dyn Spawner + Send>,
}

/// How long to wait for a process.
pub struct Patience<'a> {
    /// The longest time for one reply.
    pub limit: Duration,
    /// Becomes true when the user ends the run.
    pub interrupted: &'a AtomicBool,
}

/// The processes of one builder, either with or without the driver's cache. There is one process
/// for each device, started when it is first needed.
pub struct Pool {
    spawner: Box<dyn Spawner + Send>,
    workers: HashMap<usize, Box<dyn Worker>>,
}

impl Pool {
    pub fn new(spawner: Box<dyn Spawner + Send>) -> Self {
        Self { spawner, workers: HashMap::new() }
    }

    /// Builds a program; `None` if it was not built. If a process died or hung, the next program gets a new
    /// process.
    pub fn build(&mut self, order: &Order, patience: &Patience<'_>) -> Option<Built> {
        let device = order.program.device;
        let mut worker = self.workers.remove(&device).or_else(|| self.start(device, patience))?;
        worker.send(&Request::Build { point: order.point });
        let reply = patience.wait(worker.as_mut())?;
        self.workers.insert(device, worker);
        match reply {
            Reply::Built(built) => built,
            _ => None,
        }
    }

    /// Starts a process and waits until its device is open. If this fails, returns `None`; the run will notice the
    /// failure itself.
    fn start(&mut self, device: usize, patience: &Patience<'_>) -> Option<Box<dyn Worker>> {
        let mut worker = self.spawner.spawn(device).ok()?;
        matches!(patience.wait(worker.as_mut()), Some(Reply::Started)).then_some(worker)
    }
}

impl Patience<'_> {
    /// Returns a process's reply; `None` if the process is dead, hangs or is no longer needed.
    fn wait(&self, worker: &mut dyn Worker) -> Option<Reply> {
        let start = Instant::now();
        loop {
            match worker.wait(LOOK_UP.min(self.limit)) {
                Wait::Reply(reply) => return Some(reply),
                Wait::Dead(_) => return None,
                Wait::Silence if start.elapsed() >= self.limit => return None,
                Wait::Silence if self.interrupted.load(Ordering::Relaxed) => return None,
                Wait::Silence => {}
            }
        }
    }
}
