//! Takes the locks of the devices on which the points of a group are measured.

use super::device_of;
use crate::device_lock::{Held, LockName, LockWait};
use crate::error::Result;
use crate::experiment::Run;
use crate::experiment::asleep;
use crate::experiment::pending::PendingPoint;
use crate::experiment::result_sink::ResultSink;
use std::sync::atomic::AtomicBool;

/// Returns one name of a lock per point: the lock of the point's device. Baselines and points that are
/// measured on CPUs share the lock of the host's processors. Devices that only tests use ([`asleep`]) have no
/// lock.
pub(super) fn lock_names(run: &Run<'_>, points: &[PendingPoint]) -> Vec<LockName> {
    let awake = points
        .iter()
        .filter(|pending| device_of(run, pending).is_none_or(|device| !asleep::is_asleep(device)));
    awake.map(|pending| LockName::of(device_of(run, pending))).collect()
}

/// Takes the locks `devices`. While another process holds one of the locks, this function tells the sink (the receiver
/// of results and messages) that the run waits. At the first wait for this other process, the sink receives a line to
/// print. At later waits for the same process, the sink receives the line only as a description of the run's current
/// work. While another process holds one of the locks, builders (processes that compile programs) begin no program for
/// the devices with the locks `devices`, because compiling would disturb the other process's measurement.
pub(super) fn take_locks(
    run: &Run<'_>,
    devices: Vec<LockName>,
    sink: &mut impl ResultSink,
    interrupted: &AtomicBool,
) -> Result<Vec<Held>> {
    let pause = || run.ahead.into_iter().for_each(|ahead| ahead.pause(&devices));
    let mut tells = |waiting: LockWait<'_>| match waiting {
        LockWait::For(line) => {
            pause();
            sink.says(line);
        }
        LockWait::Again(line) => {
            pause();
            sink.works_on(line);
        }
        LockWait::Still => sink.waits(),
    };
    let held = run.locks.take_all_telling(devices.clone(), &mut tells, interrupted);
    // Builders (processes that compile programs) may go on compiling programs, whether or not the locks could
    // be taken. With `--spread`, each device has a thread of its own, and the run ends only when all these
    // threads have ended. If builders stayed paused after a failure to take locks, another device's thread
    // that shares a lock might wait for a program that no builder builds.
    run.ahead.into_iter().for_each(|ahead| ahead.go_on(&devices));
    held
}
