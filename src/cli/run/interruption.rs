//! Notices that the user interrupts this process's runs, by Ctrl-C (SIGINT) or SIGTERM.

use crate::error::{Error, Result};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// The exit code of raycl if a second SIGINT (Ctrl-C) or SIGTERM ends it.
const INTERRUPTED: i32 = 130;

/// The flag that a signal sets, and that all runs of this process share. If each run had a flag of its own, a
/// signal between two runs of `raycl reproduce` would set only the flags of finished runs. Nobody would read
/// these flags any more.
static FLAG: OnceLock<std::io::Result<Arc<AtomicBool>>> = OnceLock::new();

/// Returns the flag that the first SIGINT or SIGTERM sets; a second signal ends the process at once.
pub fn interrupt_flag() -> Result<Arc<AtomicBool>> {
    let known = FLAG.get_or_init(registered).as_ref().cloned();
    known.map_err(|error| Error::fault(format!("raycl cannot handle Ctrl-C: {error}")))
}

/// Clears the flag that a signal has set, so that a program that continues after an interrupted run can start
/// another run.
pub fn forget_interruption() {
    if let Some(Ok(interrupted)) = FLAG.get() {
        interrupted.store(false, Ordering::Relaxed);
    }
}

/// Returns a new flag. Installs handlers for SIGINT and SIGTERM: the first signal sets the flag, and the
/// second ends raycl.
fn registered() -> std::io::Result<Arc<AtomicBool>> {
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // The order of the two calls matters: on a signal, the handler registered first ends raycl if the flag is
        // already set; the handler registered second then sets the flag.
        flag::register_conditional_shutdown(signal, INTERRUPTED, Arc::clone(&interrupted))?;
        flag::register(signal, Arc::clone(&interrupted))?;
    }
    Ok(interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_runs_of_a_process_share_the_flag_and_it_can_be_cleared() {
        let flags = [(); 2].map(|()| interrupt_flag().expect("a flag"));
        assert!(Arc::ptr_eq(&flags[0], &flags[1]));
        flags[0].store(true, Ordering::Relaxed);
        forget_interruption();
        assert!(!flags[1].load(Ordering::Relaxed));
    }
}
