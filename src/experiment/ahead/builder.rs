//! The processes that compile programs ahead.

use super::{LOOK_UP, Order};
use crate::experiment::protocol::{Built, Reply, Request};
use crate::experiment::supervisor::{Spawner, Wait, Worker};
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A builder: starts the processes that build one program after another.
pub struct Builder {
    /// Starts the usual processes. They use the driver's cache of programs. They store machine code
    /// in it, so that the measuring workers do not generate it again.
    pub usual: Box<dyn Spawner + Send>,
    /// Starts processes that do not use the driver's cache, for programs that an earlier process
    /// stored in it. The driver would not compile such a program again, and so would not print its
    /// number of registers.
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

    /// Builds a program; `None` if it was not built. A process that died or hung is replaced at the next program.
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

    /// Starts a process and waits until its device is open; `None` if that fails, which the run will notice itself.
    fn start(&mut self, device: usize, patience: &Patience<'_>) -> Option<Box<dyn Worker>> {
        let mut worker = self.spawner.spawn(device).ok()?;
        matches!(patience.wait(worker.as_mut()), Some(Reply::Started)).then_some(worker)
    }
}

impl Patience<'_> {
    /// Returns a process's reply; `None` if it died, hangs or is no longer needed.
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
