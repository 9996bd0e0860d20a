//! Builds programs before the points that use them are checked. Several processes build programs, since a driver
//! compiles only one program at a time in each process. Each program is built once, even if many points use it.

mod builder;
#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests;

pub use builder::Builder;

use super::protocol::Built;
use crate::accel::FINGERPRINT;
use crate::error::{Error, Result};
use crate::program::Kept;
use builder::{Patience, Pool};
use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The interval at which a waiting thread checks whether the user has interrupted the run.
const LOOK_UP: Duration = Duration::from_millis(100);
/// A program, identified by its device and the hash of its source and options. A program that traverses a tree also
/// depends on the depth of the traversal's stack. The hash does not contain this depth; the depth follows from the
/// scene, so such a program is also identified by its scene.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Program {
    /// The number of the worker that measures on the program's device.
    pub device: usize,
    /// The hash of the source and the options, as far as they are known before the tree is built.
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

/// A program to be built, and a point that uses it.
pub struct Order {
    /// The program.
    pub program: Program,
    /// The point's index in the plan.
    pub point: usize,
}

/// A point that needs a program.
pub trait Needs {
    /// Returns the program. Returns `None` for a caster on the host, or if the point does not fit on the device.
    fn order(&self) -> Option<Order>;
    /// Receives the result of building the program, if it was built for this point.
    fn hears(&mut self, built: Option<Built>);
}

#[derive(Default)]
struct State {
    waiting: VecDeque<Order>,
    /// All programs that were requested so far.
    ordered: HashSet<Program>,
    /// Programs for which no point has to wait any more, each with the result of building it. The result is `None` if
    /// the program was already stored or could not be built, if its builder died or hung, or if a point has taken the
    /// result. A point that waits for its program takes the result from here.
    done: HashMap<Program, Option<Built>>,
    closed: bool,
}

/// Counts of the programs built so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Number of programs that were compiled.
    pub compiled: usize,
    /// Number of programs that came from the cache.
    pub kept: usize,
    /// Sum of the build times of all programs.
    pub work_ms: f64,
    /// Time for which the run waited for programs.
    pub waited_ms: f64,
}

impl Tally {
    /// Formats the counts for a person; `None` if no program was compiled or taken from the cache.
    pub fn text(&self) -> Option<String> {
        let Self { compiled, kept, work_ms, waited_ms } = *self;
        let programs = |count: usize| format!("{count} program{}", if count == 1 { "" } else { "s" });
        let seconds = |ms: f64| format!("{:.1} s", 1e-3 * ms);
        (compiled + kept > 0).then(|| {
            format!(
                "Built: {} compiled, {kept} taken from the cache; this took {} of work in all, and the run waited {} for programs",
                programs(compiled),
                seconds(work_ms),
                seconds(waited_ms)
            )
        })
    }
}

/// The programs of a run: the run requests them, and builders build those that no earlier run has stored.
#[derive(Default)]
pub struct Ahead {
    /// The stored programs of each worker's device.
    kept: Vec<Kept>,
    state: Mutex<State>,
    changed: Condvar,
    tally: Mutex<Tally>,
}

/// Ends the builders when a run ends, for whatever reason.
struct Closing<'a>(&'a Ahead);

impl Drop for Closing<'_> {
    fn drop(&mut self) {
        let mut state = self.0.locked();
        state.closed = true;
        state.waiting.clear();
        self.0.changed.notify_all();
    }
}

impl Ahead {
    /// Makes the empty list of a run's programs. `kept[i]` contains the stored programs of worker `i`'s device.
    pub fn new(kept: Vec<Kept>) -> Self {
        Self { kept, ..Self::default() }
    }

    /// Calls `work` while builders run in parallel. `limit` is the longest time for building a program.
    pub fn beside<R>(
        &self,
        builders: Vec<Builder>,
        limit: Duration,
        interrupted: &AtomicBool,
        work: impl FnOnce() -> R,
    ) -> R {
        std::thread::scope(|scope| {
            let _closing = Closing(self);
            for builder in builders {
                scope.spawn(move || self.serve(builder, &Patience { limit, interrupted }));
            }
            work()
        })
    }

    /// Returns the counts of the programs built so far.
    pub fn tally(&self) -> Tally {
        *self.tally.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Requests the programs of points, in the order of the points.
    pub fn order<'a, N: Needs + 'a>(&self, points: impl IntoIterator<Item = &'a N>) {
        let mut state = self.locked();
        for order in points.into_iter().filter_map(N::order) {
            if !state.ordered.insert(order.program.clone()) {
                continue;
            }
            if self.is_stored(&order.program) {
                // Nothing has to be built: each worker takes the program from the cache.
                self.counted(|tally| tally.kept += 1);
                state.done.insert(order.program, None);
            } else {
                state.waiting.push_back(order);
            }
        }
        self.changed.notify_all();
    }

    /// Requests the program of a point and waits until it is built. The point for which the program was built
    /// receives the result.
    pub fn need(&self, point: &mut impl Needs, interrupted: &AtomicBool) -> Result<()> {
        let start = Instant::now();
        self.order([&*point]);
        let Some(Order { program, .. }) = point.order() else { return Ok(()) };
        let mut state = self.locked();
        while !state.done.contains_key(&program) {
            if interrupted.load(Ordering::Relaxed) {
                return Err(Error::interrupted("the run was ended"));
            }
            let waited = self.changed.wait_timeout(state, LOOK_UP);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        point.hears(state.done.get_mut(&program).and_then(Option::take));
        drop(state);
        self.counted(|tally| tally.waited_ms += start.elapsed().as_secs_f64() * 1e3);
        Ok(())
    }

    /// Does the work of one builder: builds programs until the run ends. If a process dies or hangs, its program stays
    /// unbuilt. The worker that measures the point then builds the program itself, and reports any error.
    fn serve(&self, builder: Builder, patience: &Patience<'_>) {
        let mut usual = Pool::new(builder.usual);
        let mut without_driver_cache = Pool::new(builder.without_driver_cache);
        while let Some(order) = self.next() {
            let mut built = usual.build(&order, patience);
            // If `lacks_log` is set, the driver took the program from the driver's own cache, and no compiler printed
            // the program's number of registers. A process without this cache then compiles the program again.
            if built.as_ref().is_some_and(|built| built.lacks_log) {
                built = without_driver_cache.build(&order, patience);
            }
            self.finish(order.program, built);
        }
    }

    fn next(&self) -> Option<Order> {
        let mut state = self.locked();
        while state.waiting.is_empty() && !state.closed {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.waiting.pop_front()
    }

    fn finish(&self, program: Program, built: Option<Built>) {
        if let Some(built) = &built {
            self.counted(|tally| {
                tally.work_ms += built.build_ms;
                *if built.from_cache { &mut tally.kept } else { &mut tally.compiled } += 1;
            });
            if let (Some(kept), Some(key)) = (self.kept.get(program.device), &built.key) {
                kept.name(&program.name(), key);
            }
        }
        self.locked().done.insert(program, built);
        self.changed.notify_all();
    }

    /// Returns the number of programs that were requested.
    #[cfg(test)]
    pub(super) fn ordered(&self) -> usize {
        self.locked().ordered.len()
    }

    fn is_stored(&self, program: &Program) -> bool {
        self.kept.get(program.device).is_some_and(|kept| kept.has(&program.name()))
    }

    fn counted(&self, count: impl FnOnce(&mut Tally)) {
        count(&mut self.tally.lock().unwrap_or_else(PoisonError::into_inner));
    }

    fn locked(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
