//! Takes the locks of devices, for commands that measure on devices in their own process instead of in
//! workers.

use crate::device::DeviceInfo;
use crate::device_lock::{Held, LockName, Locks};
use crate::error::Result;
use std::sync::atomic::AtomicBool;

/// Takes the devices' locks, which are held until the returned values are dropped. If another process is
/// measuring on a device, this function names that process on standard error and waits for it. If `no_wait`
/// is true, this function does not wait, but returns an error. While the function waits, Ctrl-C ends the
/// whole command.
pub fn hold(devices: &[&DeviceInfo], no_wait: bool) -> Result<Vec<Held>> {
    let mut says = |line: &str| crate::printer::tell(line);
    let names = devices.iter().map(|device| LockName::of(Some(device))).collect();
    Locks::of_machine(!no_wait).take_all(names, &mut says, &AtomicBool::new(false))
}
