//! Builds OpenCL programs in advance, before the points of an experiment that use these programs are checked. A
//! *builder* is a group of child processes that compile programs, one program at a time. A thread of the run gives
//! these processes their work. A run usually has several builders, since a driver compiles only one program at a time
//! in each process. A program that many points of the experiment use is requested only once.

mod builder;
mod room;
#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests;

pub use builder::Builder;
pub(super) use room::Room;

use super::protocol::Built;
use crate::accel::FINGERPRINT;
use crate::clock::{LOOK_UP, ms_since};
use crate::device_lock::LockName;
use crate::error::{Error, Result};
use crate::printer::muted_as_here;
use crate::program::ProgramCache;
use crate::threads::locked;
use crate::words::counted;
use builder::{Patience, Pool};
use std::collections::{BTreeSet, HashMap, HashSet, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A builder that has run out of work keeps its processes if the scenes of its last programs were small, since new
/// processes would have to start their drivers again. A scene is small if the memory for builders has room for
/// `PLENTY` times as many builders as the run has. Here, a builder's memory is only the memory for the copies of the
/// scene that its processes hold. The memory that programs and drivers need is not counted, since this need is the same
/// for every scene.
const PLENTY: usize = 4;

/// A program, identified by its job (the task of the workers of one device, with one folder of kernels) and
/// by the hash of its source and options. A program that traverses a tree also depends on the size of the
/// traversal's stack. The hash does not contain the size of the stack, which depends on the scene. A program
/// that traverses a tree is therefore also identified by its scene.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Program {
    /// The number of the job (the task of the workers of one device) that uses the program.
    pub job: usize,
    /// The hash of the program's source and build options, as far as these are known before the tree is
    /// built.
    pub hash: String,
    /// The hash of the scene, if the program uses a tree.
    pub scene: Option<String>,
}

impl Program {
    /// Returns the program's name in its device's cache of programs.
    fn name(&self) -> String {
        let tree = self.scene.as_ref().map(|scene| format!("{scene} {FINGERPRINT}"));
        format!("{} {}", self.hash, tree.unwrap_or_default())
    }
}

/// A request to build a program, with a point of the experiment that uses the program.
pub struct Order {
    /// The program to be built.
    pub program: Program,
    /// The index in the plan of a point that uses the program.
    pub point: usize,
    /// How many builders fit into memory. The processes of a builder hold the point's scene while they compile
    /// programs.
    pub room: Room,
}

/// A point of an experiment that may need a program.
pub trait Needs {
    /// Returns a request to build the point's program. Returns `None` if the point is cast on the host, without a
    /// program, or if the point does not fit on the device.
    fn order(&self) -> Option<Order>;
    /// Receives the result of building the program; `None` if the program was not built, or if another point
    /// has received the result.
    fn hears(&mut self, built: Option<Built>);
}

#[derive(Default)]
struct State {
    waiting: VecDeque<Order>,
    /// All programs that were requested so far.
    ordered: HashSet<Program>,
    /// Programs for which no point has to wait any longer, each with the result of the build. The result of a
    /// build is `None` if the program was already stored or could not be built, or if the process that built
    /// the program died or hung. A point that waits for its program takes the result from this map, and leaves
    /// `None` in the map.
    done: HashMap<Program, Option<Built>>,
    /// The devices for which builders may begin to build programs. Each device is named by its lock.
    free: BTreeSet<LockName>,
    closed: bool,
}

/// The numbers of programs that were compiled or taken from the cache so far, and the times for building programs and
/// for waiting.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Number of programs that were compiled.
    pub compiled: usize,
    /// Number of programs that came from the cache.
    pub from_cache: usize,
    /// Sum of the build times of the programs that builders built.
    pub work_ms: f64,
    /// Time that the run spent waiting until programs were built.
    pub waited_ms: f64,
}

impl Tally {
    /// Formats the counts for a person; `None` if no program was compiled or taken from the cache.
    pub fn text(&self) -> Option<String> {
        let Self { compiled, from_cache, work_ms, waited_ms } = *self;
        let seconds = |ms: f64| format!("{:.1} s", 1e-3 * ms);
        (compiled + from_cache > 0).then(|| {
            format!(
                "Built: {} compiled, {from_cache} taken from the cache; this took {} of work in all, and the run waited {} for programs",
                counted(compiled, "program"),
                seconds(work_ms),
                seconds(waited_ms)
            )
        })
    }
}

/// The programs that a run needs. The run requests programs, and builders build the programs that no earlier
/// run has stored.
#[derive(Default)]
pub struct Ahead {
    /// For each job (the task of the workers of one device): the stored programs of its device.
    stored: Vec<ProgramCache>,
    /// The lock of the device of each job (the task of the workers of one device). A process holds this lock
    /// while it measures on the device. If `locks` has no lock for a job, builders may always use the job's
    /// device.
    locks: Vec<LockName>,
    state: Mutex<State>,
    changed: Condvar,
    tally: Mutex<Tally>,
}

/// Ends the builders when a run ends, also after an error or an interruption.
struct Closing<'a>(&'a Ahead);

impl Drop for Closing<'_> {
    fn drop(&mut self) {
        let mut state = locked(&self.0.state);
        state.closed = true;
        state.waiting.clear();
        self.0.changed.notify_all();
    }
}

impl Ahead {
    /// Makes the empty list of a run's programs. `stored[i]` contains the stored programs of job `i`'s device, and
    /// `locks[i]` is the lock of this device. Builders begin no program for a device before [`Self::go_on`] names the
    /// device's lock.
    pub fn new(stored: Vec<ProgramCache>, locks: Vec<LockName>) -> Self {
        Self { stored, locks, ..Self::default() }
    }

    /// Calls `work` while builders run in parallel. `limit` is the longest time for building a program.
    ///
    /// # Errors
    ///
    /// Fails, without calling `work`, if a thread for a builder cannot be started.
    pub fn beside<R>(
        &self,
        builders: Vec<Builder>,
        limit: Duration,
        interrupted: &AtomicBool,
        work: impl FnOnce() -> R,
    ) -> Result<R> {
        std::thread::scope(|scope| {
            let _closing = Closing(self);
            let count = builders.len();
            for (number, builder) in builders.into_iter().enumerate() {
                let serve = move || self.serve([number, count], builder, &Patience { limit, interrupted });
                let started = std::thread::Builder::new().spawn_scoped(scope, muted_as_here(serve));
                started.map_err(|error| Error::no_thread(&error))?;
            }
            Ok(work())
        })
    }

    /// Returns the numbers and times of the programs that were compiled or taken from the cache so far.
    pub fn tally(&self) -> Tally {
        *locked(&self.tally)
    }

    /// Lets builders begin to build programs for the devices with these locks. Usually, the caller has first
    /// found out that no other process measures on the devices.
    pub fn go_on(&self, devices: &[LockName]) {
        locked(&self.state).free.extend(devices.iter().cloned());
        self.changed.notify_all();
    }

    /// Lets builders begin no more programs for the devices with these locks, because another process
    /// measures on these devices. Builders still complete the programs that they are building.
    pub fn pause(&self, devices: &[LockName]) {
        locked(&self.state).free.retain(|device| !devices.contains(device));
    }

    /// Requests the programs that these points of the experiment need, in the order of the points. A program that was
    /// requested before is not requested again, and a stored program is not built.
    pub fn order<'a, N: Needs + 'a>(&self, points: impl IntoIterator<Item = &'a N>) {
        let mut state = locked(&self.state);
        for order in points.into_iter().filter_map(N::order) {
            if !state.ordered.insert(order.program.clone()) {
                continue;
            }
            if self.is_stored(&order.program) {
                // Each worker takes a stored program from the cache, so no builder has to build a stored
                // program.
                self.counted(|tally| tally.from_cache += 1);
                state.done.insert(order.program, None);
            } else {
                state.waiting.push_back(order);
            }
        }
        self.changed.notify_all();
    }

    /// Requests the program of a point of the experiment, and waits until the program is built or cannot be built. The
    /// first point that waits for a program receives the result of the build; later points with the same program
    /// receive `None`. Returns at once for a point that needs no program. Returns an error if the user interrupts the
    /// run.
    pub fn need(&self, point: &mut impl Needs, interrupted: &AtomicBool) -> Result<()> {
        let start = Instant::now();
        self.order([&*point]);
        let Some(Order { program, .. }) = point.order() else { return Ok(()) };
        let mut state = locked(&self.state);
        while !state.done.contains_key(&program) {
            if interrupted.load(Ordering::Relaxed) {
                return Err(Error::interrupted("the run was ended"));
            }
            let waited = self.changed.wait_timeout(state, LOOK_UP);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        point.hears(state.done.get_mut(&program).and_then(Option::take));
        drop(state);
        self.counted(|tally| tally.waited_ms += ms_since(start));
        Ok(())
    }

    /// Does the work of one builder: builds programs until the run ends. If a process of the builder dies or
    /// hangs while it builds a program, this program stays unbuilt. The worker that measures a point with an
    /// unbuilt program builds the program, and reports any error. `number` is the builder's number, and
    /// `count` the number of builders.
    fn serve(&self, [number, count]: [usize; 2], builder: Builder, patience: &Patience<'_>) {
        let mut usual = Pool::new(builder.usual);
        let mut without_driver_cache = Pool::new(builder.without_driver_cache);
        let mut is_tight = false;
        while self.has_next(number) {
            while let Some(order) = self.next(number) {
                is_tight |= order.room.scenes < PLENTY * count;
                let mut built = usual.build(&order, patience);
                // If `lacks_log` is set, no compiler printed the program's number of registers, probably because
                // the driver took the program from its own cache. A process that does not use the driver's cache
                // then compiles the program again.
                if built.as_ref().is_some_and(|built| built.lacks_log) {
                    built = without_driver_cache.build(&order, patience);
                }
                self.finish(order.program, built);
            }
            // If memory is tight, the builder's idle processes end. Each of these processes still holds a scene, and
            // the points that are being timed may need the scene's memory.
            if std::mem::take(&mut is_tight) {
                usual.end();
                without_driver_cache.end();
            }
        }
    }

    /// Waits until there is a program that the builder `number` (counted from 0) may begin to build, and
    /// returns true. Returns false if the run has ended.
    fn has_next(&self, number: usize) -> bool {
        let mut state = locked(&self.state);
        while !state.closed && self.index_of_next(&state, number).is_none() {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        !state.closed
    }

    /// Takes the next program that the builder `number` may begin to build. Returns `None` if the builder may
    /// not begin any waiting program now.
    fn next(&self, number: usize) -> Option<Order> {
        let mut state = locked(&self.state);
        let index = self.index_of_next(&state, number)?;
        state.waiting.remove(index)
    }

    /// Returns the index of the first waiting program that the builder `number` may begin to build. A builder compiles
    /// programs in processes of its own. The builder with the number `number` may begin a program only under two
    /// conditions: more than `number` builders that hold the program's scene fit into memory, and no other process
    /// measures on the program's device. Returns `None` if the builder may not begin any waiting program.
    fn index_of_next(&self, state: &State, number: usize) -> Option<usize> {
        let may_begin =
            |order: &Order| number < order.room.builders && self.is_free(state, order.program.job);
        state.waiting.iter().position(may_begin)
    }

    /// Returns true if builders may begin to build programs on a job's device.
    fn is_free(&self, state: &State, job: usize) -> bool {
        self.locks.get(job).is_none_or(|lock| state.free.contains(lock))
    }

    fn finish(&self, program: Program, built: Option<Built>) {
        if let Some(built) = &built {
            self.counted(|tally| {
                tally.work_ms += built.build_ms;
                *if built.from_cache { &mut tally.from_cache } else { &mut tally.compiled } += 1;
            });
            if let (Some(programs), Some(key)) = (self.stored.get(program.job), &built.key) {
                programs.name(&program.name(), key);
            }
        }
        locked(&self.state).done.insert(program, built);
        self.changed.notify_all();
    }

    /// Returns the number of programs that the run has requested so far.
    #[cfg(test)]
    pub(super) fn ordered(&self) -> usize {
        locked(&self.state).ordered.len()
    }

    /// Returns true if builders may begin to build programs on a job's device.
    #[cfg(test)]
    pub(super) fn may_build_on(&self, job: usize) -> bool {
        self.is_free(&locked(&self.state), job)
    }

    fn is_stored(&self, program: &Program) -> bool {
        self.stored.get(program.job).is_some_and(|programs| programs.has(&program.name()))
    }

    fn counted(&self, count: impl FnOnce(&mut Tally)) {
        count(&mut locked(&self.tally));
    }
}
