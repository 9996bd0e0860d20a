//! Measures core-to-core latency: how long a cache line takes to move from one processor to another. A
//! virtual machine's processors are threads of its host. The host may move these threads: two of them may
//! then share a core, or run on distant cores. Each move of a virtual machine's processor may change the
//! core-to-core latency, and the speed of all kernels that share data between work-groups.

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use std::hint::spin_loop;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::Builder;
use std::time::{Duration, Instant};

/// The number of round trips in one timed piece of the measurement. A timed piece of the measurement takes
/// tens of microseconds, so few pieces are interrupted.
const ROUND_TRIPS: u32 = 100;
/// The number of timed pieces; the result is computed from the time of the fastest piece.
const PIECES: u32 = 5;
/// If the measurement takes longer than `PATIENCE`, the processors are assumed to be busy with other
/// programs, and the measurement has no result.
const PATIENCE: Duration = Duration::from_millis(5);
/// The number of reads of the shared word between two reads of the clock.
const LOOKS: u32 = 64;

/// The word by which two threads take turns. The word shares no cache line with other data. The word is
/// aligned to two cache lines, since some processors fetch two lines at once.
#[repr(align(128))]
struct Word(AtomicU32);

const PING: u32 = 0;
const PONG: u32 = 1;
const OVER: u32 = 2;

/// Returns the time in nanoseconds that a cache line takes to move from one processor to another: half a round trip.
/// The two processors are the first ones on which the calling thread may run. Returns `None` if the thread may run on
/// only one processor, if the system does not pin threads or cannot start another thread, or if other programs keep the
/// processors busy.
pub fn core_to_core_ns() -> Option<f64> {
    between(two_processors()?, [Builder::new(), Builder::new()])
}

/// Measures the core-to-core latency between two processors, with a thread on each processor.
fn between([first, second]: [usize; 2], [timer, partner]: [Builder; 2]) -> Option<f64> {
    let (word, end) = (Word(AtomicU32::new(PING)), Instant::now() + PATIENCE);
    std::thread::scope(|scope| {
        let answering = || {
            let pinned = pin(second);
            while pinned && pass(&word, [PONG, PING], end) {}
            word.0.store(OVER, Ordering::Release);
        };
        partner.spawn_scoped(scope, answering).ok()?;
        let timing = || {
            let pinned = pin(first);
            let piece = |_| if pinned { piece_ns(&word, end) } else { None };
            let fastest = (0..PIECES).map(piece).try_fold(f64::INFINITY, |least, ns| Some(least.min(ns?)));
            word.0.store(OVER, Ordering::Release);
            fastest
        };
        let Ok(timed) = timer.spawn_scoped(scope, timing) else {
            // The thread that times the round trips could not start. Storing `OVER` ends the exchange, so
            // that the answering thread does not wait for the timing thread.
            word.0.store(OVER, Ordering::Release);
            return None;
        };
        timed.join().ok().flatten()
    })
}

/// Returns the mean time of half a round trip in nanoseconds; `None` if the exchange ends too early (`pass`
/// returns false).
fn piece_ns(word: &Word, end: Instant) -> Option<f64> {
    let start = Instant::now();
    for _ in 0..ROUND_TRIPS {
        if !pass(word, [PING, PONG], end) {
            return None;
        }
    }
    Some(one_way_ns(start.elapsed()))
}

/// Returns the mean time of half a round trip in nanoseconds. All round trips of one timed piece together
/// took the time `elapsed`.
fn one_way_ns(elapsed: Duration) -> f64 {
    elapsed.as_nanos() as f64 / f64::from(2 * ROUND_TRIPS)
}

/// Waits until it is this thread's turn, then gives the turn to the other thread. The shared word `word`
/// equals `own` during this thread's turn, and `others` during the other thread's turn. Returns false if the
/// threads no longer take turns (`OVER`), or if the other thread does not give the turn back before the time
/// `end`.
fn pass(word: &Word, [own, others]: [u32; 2], end: Instant) -> bool {
    let looks = || {
        (0..LOOKS).any(|_| {
            spin_loop();
            word.0.load(Ordering::Acquire) != others
        })
    };
    while !looks() {
        if Instant::now() > end {
            return false;
        }
    }
    word.0.compare_exchange(own, others, Ordering::AcqRel, Ordering::Relaxed).is_ok()
}

fn two_processors() -> Option<[usize; 2]> {
    let own = sched_getaffinity(None).ok()?;
    let mut processors = (0..CpuSet::MAX_CPU).filter(|processor| own.is_set(*processor));
    Some([processors.next()?, processors.next()?])
}

/// Pins the calling thread to a processor. Returns false if the system refuses to pin the thread.
fn pin(processor: usize) -> bool {
    let mut only = CpuSet::new();
    only.set(processor);
    sched_setaffinity(None, &only).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cache_line_takes_some_nanoseconds_and_this_thread_stays_where_it_was() {
        let processors = || sched_getaffinity(None).map(|own| own.count()).ok();
        let before = processors();
        // While other programs run, `core_to_core_ns` may find no moment in which both processors are free.
        if let Some(ns) = core_to_core_ns() {
            assert!(ns > 1.0 && ns < 1e6, "{ns} ns");
        }
        assert_eq!(processors(), before);
    }

    #[test]
    fn a_round_trip_is_two_ways() {
        assert_eq!(one_way_ns(ROUND_TRIPS * Duration::from_nanos(200)), 100.0);
    }

    #[test]
    fn without_one_of_its_threads_there_is_no_result() {
        let Some(processors) = two_processors() else { return };
        // No address space can hold a stack of this size.
        let refused = || Builder::new().stack_size(1 << (usize::BITS - 1));
        assert_eq!(between(processors, [Builder::new(), refused()]), None);
        assert_eq!(between(processors, [refused(), Builder::new()]), None);
    }

    #[test]
    fn a_turn_that_is_over_is_not_passed_on() {
        let word = Word(AtomicU32::new(OVER));
        let end = Instant::now() + PATIENCE;
        assert!(!pass(&word, [PING, PONG], end));
        word.0.store(PING, Ordering::Release);
        assert!(pass(&word, [PING, PONG], end));
        assert_eq!(word.0.load(Ordering::Acquire), PONG);
        assert!(!pass(&word, [PING, PONG], end), "nobody passes it back");
    }
}
