//! Taking the locks of devices for a command that measures on them itself.

use crate::device::DeviceInfo;
use crate::device_lock::{Held, LockName, Locks};
use crate::error::Result;
use std::sync::atomic::AtomicBool;

/// Holds devices until dropped. If another process measures on one, it waits and names that process on standard error, or
/// with `no_wait` ends at once. Ctrl-C ends the whole command, which has measured nothing yet.
pub fn hold(devices: &[&DeviceInfo], no_wait: bool) -> Result<Vec<Held>> {
    let mut says = |line: &str| crate::printer::tell(line);
    let names = devices.iter().map(|device| LockName::of(Some(device))).collect();
    Locks::of_machine(!no_wait).take_all(names, &mut says, &AtomicBool::new(false))
}
