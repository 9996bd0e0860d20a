//! The traits by which a run starts workers and sends them requests, and the wait for a worker's reply.
//! Workers are processes that cast the images of a run's measured points. The wait also ends if the worker
//! dies or hangs.

use super::protocol::{Phase, Reply, Request};
use crate::clock::LOOK_UP;
use crate::error::Result;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Starts worker processes, which cast the points of a run.
pub trait Spawner {
    /// Starts a worker for the job with this number. A job is the task of the workers of one device, with one folder of
    /// kernels. The worker's first reply is [`Reply::Started`].
    fn spawn(&mut self, job: usize) -> Result<Box<dyn Worker>>;
    /// Demands that the next worker compile its programs again and remove the stored programs. A stored
    /// program may have crashed the driver of a worker that died.
    fn compile_afresh(&mut self) {}
}

/// A worker serves requests one after another, until it dies or is dropped.
pub trait Worker {
    /// Sends a request. If the worker is dead, the next call of `wait` reports the death.
    fn send(&mut self, request: &Request);
    /// Waits for the worker's next reply, for at most `limit`: for [`Reply::Started`], for the reply to the last
    /// request, or for a [`Reply::Begins`] before the reply to the last request.
    fn wait(&mut self, limit: Duration) -> Wait;
    /// Tells the worker that no request will follow, so that it ends. The call does not wait for the end, so
    /// several workers can end at the same time.
    fn dismiss(&mut self) {}
}

/// The result of waiting for a worker's reply.
#[derive(Clone, Debug, PartialEq)]
pub enum Wait {
    /// The worker's next reply. It is [`Reply::Started`], the reply to the last request, or a [`Reply::Begins`], which
    /// comes before the reply to the last request.
    Reply(Reply),
    /// No reply came within the limit.
    Silence,
    /// The worker is dead and will not reply.
    Dead(Death),
}

/// The way in which a worker died.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Death {
    /// The cause of the worker's death, such as "was killed by SIGSEGV" or "ended with exit status: 1".
    pub cause: String,
    /// The end of the text that the worker wrote to its standard error.
    pub last_words: String,
}

/// Waits for a worker's reply. Returns the inner error if the worker dies, or if a phase of its work takes
/// longer than `limit`. The phase [`Phase::Host`] has no limit. Returns `None` if the flag `interrupted`
/// becomes true while the worker is silent. If `interrupted` is `None`, an interruption of the run does not
/// end the wait.
pub fn reply_of(
    worker: &mut dyn Worker,
    limit: Duration,
    interrupted: Option<&AtomicBool>,
) -> Option<std::result::Result<Reply, Loss>> {
    let mut quiet = Quiet { limit, phase: Phase::Cast, so_far: Duration::ZERO };
    loop {
        match quiet.wait(worker) {
            Wait::Reply(Reply::Begins(phase)) => quiet.begin(phase),
            Wait::Reply(reply) => return Some(Ok(reply)),
            Wait::Dead(death) => return Some(Err(Loss::Died(death))),
            Wait::Silence if quiet.is_over() => return Some(Err(Loss::HungFor(limit))),
            Wait::Silence if interrupted.is_some_and(|flag| flag.load(Ordering::Relaxed)) => return None,
            Wait::Silence => {}
        }
    }
}

/// Adds up how long raycl has waited in the current phase of a worker's work. A single wait should end after
/// `LOOK_UP` (or `limit`, if `limit` is shorter). If a wait takes longer than twice `LOOK_UP`, raycl and its
/// workers must have been stopped for a while, by Ctrl-Z or by a scheduler that suspends jobs. Of such a long
/// wait, only twice `LOOK_UP` is added.
struct Quiet {
    /// The longest time that the phase [`Phase::Cast`] may take.
    limit: Duration,
    phase: Phase,
    so_far: Duration,
}

impl Quiet {
    /// Waits for a reply for a short time, at the end of which the caller can check for an interruption.
    fn wait(&mut self, worker: &mut dyn Worker) -> Wait {
        let start = Instant::now();
        let reply = worker.wait(LOOK_UP.min(self.limit));
        self.so_far += start.elapsed().min(2 * LOOK_UP);
        reply
    }

    /// Begins another phase, whose waits are added up anew.
    fn begin(&mut self, phase: Phase) {
        (self.phase, self.so_far) = (phase, Duration::ZERO);
    }

    /// Returns true if the phase has a limit, and the sum of the phase's waits has reached this limit. The sum
    /// of the waits also includes waits that ended with a reply, so callers use this function only after
    /// [`Wait::Silence`].
    fn is_over(&self) -> bool {
        self.phase == Phase::Cast && self.so_far >= self.limit
    }
}

/// Why a worker did not reply: it died, or the time limit passed.
pub enum Loss {
    Died(Death),
    HungFor(Duration),
}

impl Loss {
    /// Formats the loss of a worker for a sentence whose subject is the worker: "was killed by SIGSEGV".
    pub(super) fn describe(&self) -> String {
        match self {
            Self::Died(death) => death.describe(),
            Self::HungFor(limit) => {
                format!("did not answer within {} s and was ended", limit.as_secs_f64())
            }
        }
    }
}

impl Death {
    /// Formats the death of a worker for a sentence whose subject is the worker.
    pub(super) fn describe(&self) -> String {
        match self.last_words.as_str() {
            "" => self.cause.clone(),
            words => format!("{}; its last message: {words}", self.cause),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_of_one_and_a_half_seconds_is_not_reported_as_one() {
        let loss = Loss::HungFor(Duration::from_millis(1500));
        assert_eq!(loss.describe(), "did not answer within 1.5 s and was ended");
    }
}
