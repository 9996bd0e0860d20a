//! Keeps a run going when workers (the processes that cast points for the run) fail. If a worker dies or hangs, at most
//! its current point fails, and the next request goes to a new worker.

use super::point_failure::PointFailure;
use super::protocol::{Reply, Request};
use super::waiting::{Loss, Spawner, Worker, reply_of};
use crate::anchor;
use crate::error::{Error, Result};
use crate::launch::FrameTimes;
use crate::record::{Outcome, Record};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// If `ATTEMPTS` workers have died while they served requests about a point, raycl records the point as
/// crashed. One dead worker does not show that the point crashes workers, since the worker may have died from
/// an outside cause.
const ATTEMPTS: u32 = 2;
/// After raycl has recorded `PATIENCE` points as crashed, no other point is tried twice.
const PATIENCE: usize = 3;
/// The help for the user if a worker cannot open its device, or if its device broke down.
const STILL_RESPONDS: &str =
    "`raycl devices` shows whether the device still responds; finished measurements are saved";

/// The data about a point of the experiment that a supervisor needs for its requests to workers.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The point's index in the plan.
    pub point: usize,
    /// The number of the job whose worker casts the point.
    pub job: usize,
    /// The number of the point's scene; a worker holds one scene at a time.
    pub scene: usize,
    /// The key of the point's record.
    pub key: &'a str,
    /// The hash of the point's picture, once the picture has been compared with the reference.
    pub verified: Option<&'a str>,
}

impl Task<'_> {
    /// Returns the job and the scene of the worker that measures the point; these two numbers identify the
    /// worker.
    fn post(&self) -> (usize, usize) {
        (self.job, self.scene)
    }
}

/// A running worker, and the points that passed their check in this worker.
struct Post {
    worker: Box<dyn Worker>,
    ready: HashSet<usize>,
}

/// The result of a check: the point's record, and true if the point can be cast. If the point cannot be cast,
/// the record says why. In a check, a worker casts the point once and compares the picture with the
/// reference.
pub type Checked = (Box<Record>, bool);

/// Sends requests to workers, and replaces workers that are lost.
pub struct Supervisor<'a> {
    spawner: &'a mut dyn Spawner,
    interrupted: &'a AtomicBool,
    /// The time limit for each of three steps of a worker. In the first step, a worker opens its device. In the second
    /// step, the worker builds a point's program and casts the point's first frame. In the third step, the worker takes
    /// a sample of a point or of the anchor.
    limit: Duration,
    /// The running workers, by the numbers of their jobs and scenes.
    posts: HashMap<(usize, usize), Post>,
    /// Workers that were started early. The supervisor has not yet read their first reply, [`Reply::Started`].
    starting: HashMap<(usize, usize), Box<dyn Worker>>,
    /// How often this session has visited the group of points that is being measured, including the present visit.
    /// A visit measures one launch of a group.
    visit: u32,
    /// For each job and point: how many of the job's workers died while they served a request about the
    /// point.
    deaths: HashMap<(usize, usize), u32>,
    given_up: usize,
    losses: usize,
    /// The jobs and the scenes of dead workers whose point is tried again. A worker that replaces such a worker
    /// compiles its programs again.
    afresh: HashSet<(usize, usize)>,
    /// The numbers of the jobs on whose devices the anchor (a fixed kernel) failed. A job is the task of one
    /// device's workers. After a job's anchor has failed, the anchor is not run again for this job.
    without_anchor: HashSet<usize>,
}

impl<'a> Supervisor<'a> {
    /// Makes a supervisor without workers.
    pub fn new(spawner: &'a mut dyn Spawner, interrupted: &'a AtomicBool, limit: Duration) -> Self {
        Self {
            spawner,
            interrupted,
            limit,
            posts: HashMap::new(),
            starting: HashMap::new(),
            visit: 0,
            deaths: HashMap::new(),
            given_up: 0,
            losses: 0,
            afresh: HashSet::new(),
            without_anchor: HashSet::new(),
        }
    }

    /// Returns the flag that is set when the user interrupts the run.
    pub fn interrupted(&self) -> &'a AtomicBool {
        self.interrupted
    }

    /// Ends all workers, so that the next requests go to new workers.
    pub fn retire(&mut self) {
        let mut workers: Vec<_> = self.posts.drain().map(|(_, post)| post.worker).collect();
        workers.extend(self.starting.drain().map(|(_, worker)| worker));
        dismiss(workers);
    }

    /// Prepares the workers for a group's visit number `visit` in this session; a visit measures one launch of the
    /// group. Of the unfinished groups, one with the fewest visits is always visited next, so the numbers of visits
    /// never decrease. Therefore, the workers of an earlier group are kept if the earlier group had the same number of
    /// visits: these workers have measured no launch of this group yet. If the number has changed, all workers end, so
    /// that no worker measures two launches of a group.
    pub fn turn_to<'t>(&mut self, visit: u32, tasks: impl Iterator<Item = Task<'t>>) {
        if self.visit != visit {
            self.retire();
            self.visit = visit;
        }
        let wanted: BTreeSet<_> = tasks.map(|task| task.post()).collect();
        // A worker keeps its scene if the scene is still needed. If a needed scene has no worker, a worker of
        // the same job takes over this scene, provided that the worker's own scene is no longer needed.
        let (needed, mut free): (Vec<_>, Vec<_>) =
            self.posts.drain().partition(|(at, _)| wanted.contains(at));
        self.posts.extend(needed);
        for post in wanted {
            let of_job = free.iter().position(|(at, _)| at.0 == post.0);
            if let Some(index) = of_job.filter(|_| !self.posts.contains_key(&post)) {
                self.posts.insert(post, free.swap_remove(index).1);
            }
        }
        self.posts.values_mut().for_each(|post| post.ready.clear());
        dismiss(free.into_iter().map(|(_, post)| post.worker).collect());
    }

    /// Starts the workers of all points that have none yet, at the same time, since each worker mostly waits for a
    /// driver while it starts.
    pub fn start_ahead<'t>(&mut self, tasks: impl Iterator<Item = Task<'t>>) -> Result<()> {
        for post in tasks.map(|task| task.post()) {
            if !self.posts.contains_key(&post) && !self.starting.contains_key(&post) {
                let worker = self.spawn(post)?;
                self.starting.insert(post, worker);
            }
        }
        Ok(())
    }

    /// Returns how many workers were lost or replaced so far.
    pub fn losses(&self) -> usize {
        self.losses
    }

    /// Checks a point: a worker casts the point's image once, and compares the image with the reference picture.
    /// Returns the point's record. If the worker died, a new worker may check the point again (see [`ATTEMPTS`] and
    /// [`PATIENCE`]). The inner error is the point's failure: its workers died, its worker hung, or the device broke
    /// down.
    pub fn check(&mut self, task: Task<'_>) -> Result<std::result::Result<Checked, PointFailure>> {
        let verified = task.verified.map(str::to_owned);
        let request = Request::Check { point: task.point, key: task.key.to_owned(), verified };
        loop {
            match self.ask(task, &request)? {
                Ok(Reply::Checked { record, ready }) => {
                    if let Some(post) = self.posts.get_mut(&task.post()).filter(|_| ready) {
                        post.ready.insert(task.point);
                    }
                    return Ok(Ok((record, ready)));
                }
                // The reply `Refused` says that the device broke down; the worker's process has ended.
                Ok(Reply::Refused(failure)) => return Ok(Err(failure)),
                Ok(reply) => return Err(unexpected(reply)),
                Err(loss) => {
                    if let Some(refusal) = self.refusal(task, loss) {
                        return Ok(Err(refusal));
                    }
                }
            }
        }
    }

    /// Takes one sample of a point. A point that has not passed a check in its current worker is checked
    /// first. Returns `None` if the worker was lost and the point may be tried again. The point may be tried again only
    /// in a new launch, since all samples of a launch come from the same workers.
    pub fn cast(&mut self, task: Task<'_>) -> Result<Option<std::result::Result<FrameTimes, PointFailure>>> {
        if !self.posts.get(&task.post()).is_some_and(|post| post.ready.contains(&task.point)) {
            match self.check(task)? {
                Ok((_, true)) => {}
                Ok((record, false)) => {
                    let reason = record.reason.unwrap_or_default();
                    return Ok(Some(Err(PointFailure::new(record.outcome, reason))));
                }
                Err(refusal) => return Ok(Some(Err(refusal))),
            }
        }
        match self.ask(task, &Request::Cast { point: task.point })? {
            Ok(Reply::Sample(times)) => Ok(Some(Ok(times))),
            Ok(Reply::Refused(refusal)) => Ok(Some(Err(refusal))),
            Ok(reply) => Err(unexpected(reply)),
            Err(loss) => Ok(self.refusal(task, loss).map(Err)),
        }
    }

    /// Runs the anchor of the device on which a point was cast, and returns its times. Returns `None` if the point has
    /// no worker. Also returns `None` if the anchor has already failed on the device, since a failed anchor is not run
    /// again. If the anchor fails now, returns the reason and drops the worker, but the run continues. The worker is
    /// dropped because the context of a GPU may be unusable after a fault; every later point of this worker would then
    /// fail too.
    pub fn anchor(&mut self, task: Task<'_>) -> Result<Option<Result<FrameTimes>>> {
        if self.without_anchor.contains(&task.job) || !self.posts.contains_key(&task.post()) {
            return Ok(None);
        }
        let error = match self.ask(task, &Request::Anchor)? {
            Ok(Reply::Sample(times)) => return Ok(Some(Ok(times))),
            Ok(reply) => unexpected(reply),
            Err(loss) => anchor::failed_because(&format!("the worker process {}", loss.describe())),
        };
        self.posts.remove(&task.post());
        // All samples of a launch must come from the same workers, so a launch that has lost a worker is
        // repeated.
        self.losses += 1;
        self.without_anchor.insert(task.job);
        Ok(Some(Err(error)))
    }

    /// Sends a request to the worker of a point of the experiment. If the point has no worker yet, a new
    /// worker is started. A worker that did not reply is dropped. A worker that reports that its device
    /// refused or failed to run a kernel is dropped, like a worker that did not reply. The context of a GPU
    /// may be unusable after a fault, and every later point of this worker would then fail.
    fn ask(&mut self, task: Task<'_>, request: &Request) -> Result<std::result::Result<Reply, Loss>> {
        self.stop_if_interrupted()?;
        let mut post = match self.posts.remove(&task.post()) {
            Some(post) => post,
            None => self.start(task.post())?,
        };
        post.worker.send(request);
        // After an interruption, the run still waits for a sample, but not for a check, which can be
        // repeated.
        let patient = matches!(request, Request::Cast { .. } | Request::Anchor);
        let answer = self.wait(post.worker.as_mut(), patient)?;
        match &answer {
            // All samples of a launch must come from the same workers, so a launch that has lost a worker is
            // repeated.
            Ok(reply) if is_failed_launch(reply) => self.losses += 1,
            Ok(_) => drop(self.posts.insert(task.post(), post)),
            Err(_) => {}
        }
        Ok(answer)
    }

    /// Starts a worker and waits until its device is open. If no worker can be started, the error ends the run. The
    /// run's remaining points do not count as failed, and a later session measures them.
    fn start(&mut self, post: (usize, usize)) -> Result<Post> {
        if let Some(mut worker) = self.starting.remove(&post)
            && self.opens(worker.as_mut())?.is_ok()
        {
            return Ok(Post { worker, ready: HashSet::new() });
        }
        let mut worker = self.spawn(post)?;
        let why = match self.opens(worker.as_mut())? {
            Ok(()) => return Ok(Post { worker, ready: HashSet::new() }),
            Err(Loss::Died(death)) => death.describe(),
            Err(Loss::HungFor(limit)) => format!("did not open its device in {} s", limit.as_secs_f64()),
        };
        Err(Error::run(format!("a worker process could not start: it {why}")).with_help(STILL_RESPONDS))
    }

    /// Starts the process of a worker.
    fn spawn(&mut self, post: (usize, usize)) -> Result<Box<dyn Worker>> {
        if self.afresh.remove(&post) {
            self.spawner.compile_afresh();
        }
        self.spawner.spawn(post.0)
    }

    /// Waits until a worker has opened its device. The inner error says that the worker died or hung.
    fn opens(&self, worker: &mut dyn Worker) -> Result<std::result::Result<(), Loss>> {
        match self.wait(worker, false)? {
            Ok(Reply::Started) => Ok(Ok(())),
            Ok(reply) => Err(unexpected(reply)),
            Err(loss) => Ok(Err(loss)),
        }
    }

    fn wait(&self, worker: &mut dyn Worker, patient: bool) -> Result<std::result::Result<Reply, Loss>> {
        let reply = reply_of(worker, self.limit, (!patient).then_some(self.interrupted));
        // The cause of the interruption may have ended the worker too, so the worker's death does not count as a
        // failure of the point.
        if matches!(reply, Some(Err(Loss::Died(_)))) {
            self.stop_if_interrupted()?;
        }
        reply.ok_or_else(interruption)
    }

    fn stop_if_interrupted(&self) -> Result<()> {
        if self.interrupted.load(Ordering::Relaxed) { Err(interruption()) } else { Ok(()) }
    }

    /// Counts the loss of a worker, and returns the failure of the worker's point; `None` if the point should be tried
    /// again.
    fn refusal(&mut self, task: Task<'_>, loss: Loss) -> Option<PointFailure> {
        self.losses += 1;
        let end = loss.describe();
        if matches!(loss, Loss::HungFor(_)) {
            let reason = format!(
                "the worker process {end}; if the point needs more time, raise `raycl run --hang-limit`"
            );
            return Some(PointFailure::new(Outcome::TimedOut, reason));
        }
        let deaths = self.deaths.entry((task.job, task.point)).or_default();
        *deaths += 1;
        if *deaths < ATTEMPTS && self.given_up < PATIENCE {
            self.afresh.insert(task.post());
            return None;
        }
        self.given_up += 1;
        let died = if *deaths > 1 {
            "a worker process died on both attempts; the second one"
        } else {
            "the worker process"
        };
        let reason = format!("{died} {end}");
        Some(PointFailure::new(Outcome::Crashed, reason))
    }
}

fn interruption() -> Error {
    Error::interrupted("the run was ended")
}

/// Returns true if a reply says that a device refused or failed to run a point's kernel.
fn is_failed_launch(reply: &Reply) -> bool {
    match reply {
        Reply::Checked { record, ready: false } => record.outcome == Outcome::LaunchFailed,
        Reply::Refused(failure) => failure.outcome == Outcome::LaunchFailed,
        _ => false,
    }
}

/// Tells all workers to end, so that they end at the same time. Dropping a worker waits until the worker has ended.
fn dismiss(mut workers: Vec<Box<dyn Worker>>) {
    workers.iter_mut().for_each(|worker| worker.dismiss());
}

/// Returns the error for a reply that does not match its request. A reply that does not match its request
/// usually reports an error of the worker.
fn unexpected(reply: Reply) -> Error {
    match reply {
        Reply::Failed { message, help } => Error::run(message).with_help(help),
        Reply::Refused(failure) => Error::run(failure.reason).with_help(STILL_RESPONDS),
        _ => Error::fault("a worker process sent a reply that does not match the request"),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests;
