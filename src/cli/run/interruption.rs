//! Notices that the user interrupts this process's runs, by Ctrl-C (SIGINT) or SIGTERM.

use crate::error::{Error, Result};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use signal_hook::iterator::Signals;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::{Builder, sleep};
use std::time::Duration;

/// The exit code of raycl if a second SIGINT (Ctrl-C) or SIGTERM ends it.
const INTERRUPTED: i32 = 130;
/// A later signal is treated as the user's second signal only if it arrives at least the time `APART` after the first
/// signal. The program `timeout` sends its signal twice within microseconds: to its child process, and to the process
/// group of this child.
const APART: Duration = Duration::from_millis(300);

/// The flags that signals set, and that all runs of this process share. One `raycl reproduce` consists of several runs.
/// If each run had flags of its own, a signal between two of these runs would set only the flags of finished runs.
/// Nobody would read these flags any more.
static FLAGS: OnceLock<std::io::Result<Flags>> = OnceLock::new();

struct Flags {
    /// True after the first signal.
    interrupted: Arc<AtomicBool>,
    /// True if the next signal ends the process at once.
    ends_at_once: Arc<AtomicBool>,
}

/// Returns the flag that the first SIGINT or SIGTERM sets; a second signal, at least `APART` later, ends the process at
/// once.
pub fn interrupt_flag() -> Result<Arc<AtomicBool>> {
    let known = FLAGS.get_or_init(registered).as_ref();
    known
        .map(|flags| Arc::clone(&flags.interrupted))
        .map_err(|error| Error::fault(format!("raycl cannot handle Ctrl-C: {error}")))
}

/// Clears the flags that a signal has set, so that a program that continues after an interrupted run can start
/// another run.
pub fn forget_interruption() {
    if let Some(Ok(Flags { interrupted, ends_at_once })) = FLAGS.get() {
        interrupted.store(false, Ordering::Relaxed);
        ends_at_once.store(false, Ordering::Relaxed);
    }
}

/// Returns new flags. Installs handlers for SIGINT and SIGTERM: the first signal sets the flag `interrupted`, and the
/// second ends raycl. A thread waits for the first signal, and then for the time `APART`. Only then does the thread set
/// the flag because of which the next signal ends raycl.
fn registered() -> std::io::Result<Flags> {
    let [interrupted, ends_at_once] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
    for signal in [SIGINT, SIGTERM] {
        flag::register_conditional_shutdown(signal, INTERRUPTED, Arc::clone(&ends_at_once))?;
        flag::register(signal, Arc::clone(&interrupted))?;
    }
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    let [is_set, next_ends] = [&interrupted, &ends_at_once].map(Arc::clone);
    let wait = move || {
        for _ in signals.forever() {
            sleep(APART);
            // If the flag was cleared meanwhile, the next signal counts as a first signal again.
            next_ends.store(is_set.load(Ordering::Relaxed), Ordering::Relaxed);
        }
    };
    Builder::new().name("signals".to_owned()).spawn(wait)?;
    Ok(Flags { interrupted, ends_at_once })
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
