//! Ends a child process if this process gets a signal that ends processes.

use super::FIRST_PROCESS;
use super::errors::{not_awaited, not_started};
use crate::error::{Error, Result};
use rustix::process::{Pid, Signal, kill_process};
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::flag::register_conditional_shutdown;
use signal_hook::iterator::Signals;
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::Builder;

/// The signals with which a user, a shell or the system ends processes.
pub const ENDING: [i32; 4] = [SIGHUP, SIGINT, SIGQUIT, SIGTERM];

/// Runs a child process to its end. If this process is the first process of a container, a signal in [`ENDING`] ends
/// the child process, and the returned status says that this signal ended it: without a handler, the first process of
/// a container does not get these signals. Any other process is ended by them, and its child process ends with it.
pub fn run_to_end(command: &mut Command) -> Result<ExitStatus> {
    let is_first = std::process::id() == FIRST_PROCESS;
    let signals = is_first.then(|| Signals::new(ENDING)).transpose().map_err(not_awaited)?;
    let mut child = command.spawn().map_err(|error| not_started(&error))?;
    match signals {
        Some(signals) => wait_with(signals, &mut child, Builder::new()),
        None => child.wait().map_err(not_awaited),
    }
}

/// If this process is the first process of a container, lets each signal in [`ENDING`] end it from now on. The exit
/// code is then 128 plus the signal's number, and the system ends all other processes of the container. This function
/// is for the search for drivers that fail, which starts child processes without [`run_to_end`].
pub fn end_at_signals() -> Result<()> {
    if std::process::id() != FIRST_PROCESS {
        return Ok(());
    }
    let always = Arc::new(AtomicBool::new(true));
    for signal in ENDING {
        register_conditional_shutdown(signal, 128 + signal, Arc::clone(&always)).map_err(not_awaited)?;
    }
    Ok(())
}

/// Waits until a child process has ended. Meanwhile, the thread that `listener` starts waits for `signals`,
/// and ends the child process after each of them. Returns the child's exit status or, if signals arrived, a
/// status that says that the first of them ended the child process. If the thread cannot be started, kills
/// the child process and returns an error.
pub fn wait_with(mut signals: Signals, child: &mut Child, listener: Builder) -> Result<ExitStatus> {
    let process = Pid::from_child(child);
    let handle = signals.handle();
    std::thread::scope(|scope| {
        let listen = || {
            signals.forever().fold(None, |first, signal| {
                // Whichever signal arrived, the child process gets SIGTERM: LLVM, which PoCL uses, can catch the
                // first SIGQUIT and ignore it. If the child process has ended meanwhile, it does not matter that
                // sending the signal fails.
                let _ = kill_process(process, Signal::TERM);
                first.or(Some(signal))
            })
        };
        let listener = listener.spawn_scoped(scope, listen);
        if listener.is_err() {
            // If the child process has ended meanwhile, it does not matter that it cannot be killed.
            let _ = child.kill();
        }
        let ended = child.wait();
        handle.close();
        let received = listener.map_err(|error| Error::no_thread(&error))?.join().ok().flatten();
        ended.map(|status| received.map_or(status, ExitStatus::from_raw)).map_err(not_awaited)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use signal_hook::consts::{SIGURG, SIGWINCH};

    #[test]
    fn if_no_thread_can_wait_for_signals_the_child_process_is_killed() {
        // No address space can hold such a stack.
        let refused = Builder::new().stack_size(1 << (usize::BITS - 1));
        let mut child = Command::new("sleep").arg("1000").spawn().expect("it starts");
        // A signal with a handler no longer ends the process of the tests, so this handler is for another signal.
        let signals = Signals::new([SIGURG]).expect("a handler");
        let error = wait_with(signals, &mut child, refused).expect_err("there is no thread");
        assert!(error.to_string().starts_with("a thread could not be started: "), "{error}");
        let status = child.try_wait().expect("a status").expect("it has ended");
        assert_eq!(status.signal(), Some(9));
    }

    #[test]
    fn a_signal_ends_the_child_process_and_counts_as_the_one_that_ended_it() {
        let signals = Signals::new([SIGWINCH]).expect("a handler");
        let mut child = Command::new("sleep").arg("1000").spawn().expect("it starts");
        signal_hook::low_level::raise(SIGWINCH).expect("a signal");
        let status = wait_with(signals, &mut child, Builder::new()).expect("a status");
        assert_eq!(status.signal(), Some(SIGWINCH));
        let own = child.try_wait().expect("a status").expect("it has ended");
        assert_eq!(own.signal(), Some(SIGTERM));
    }
}
