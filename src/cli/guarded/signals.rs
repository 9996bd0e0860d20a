//! Runs the command in child processes, and ends the running child process if this process gets a signal such
//! as SIGTERM.

use super::errors::{not_awaited, not_handled, not_started};
use super::terminal::LentTerminal;
use super::{FIRST_PROCESS, Screen};
use crate::error::{Error, Result};
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process, waitid};
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::flag::{register_conditional_default, register_conditional_shutdown};
use signal_hook::iterator::Signals;
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Builder;

/// The signals, except SIGKILL, with which a user, a shell or the system usually ends processes. (No process can handle
/// SIGKILL.)
const ENDING: [i32; 4] = [SIGHUP, SIGINT, SIGQUIT, SIGTERM];

/// This process, which runs the command in child processes, one after another.
pub struct Parent {
    /// The terminal that the child processes use; `None` if no terminal must be restored after a child
    /// process.
    terminal: Option<LentTerminal>,
    /// True while no child process runs the command. While `is_alone` is true, a signal in [`ENDING`] ends
    /// this process at once. `None` if this process has no handlers of the signals in [`ENDING`]: such a signal then
    /// ends this process at any time, and on Linux, its child process ends with it.
    is_alone: Option<Arc<AtomicBool>>,
}

impl Parent {
    /// Prepares this process for child processes that show pictures on this screen. This process gets
    /// handlers of the signals in [`ENDING`] in two cases. If this process lends its terminal to the child
    /// processes, the handlers are needed because the terminal must be restored before this process ends. If this
    /// process is the first process of a container, the handlers are needed because the system delivers to this process
    /// only signals that have a handler.
    pub fn new(screen: Screen) -> Result<Self> {
        let terminal = if screen == Screen::Terminal { LentTerminal::new() } else { None };
        let has_handlers = terminal.is_some() || std::process::id() == FIRST_PROCESS;
        let is_alone = has_handlers.then(handled).transpose().map_err(not_handled)?;
        Ok(Self { terminal, is_alone })
    }

    /// Runs a child process to its end, then restores the terminal. If this process has handlers of the
    /// signals in [`ENDING`], and gets one of these signals while the child process runs, this process ends
    /// the child process and continues. In the returned status, the signal that this process got counts as
    /// the signal that ended the child process.
    ///
    /// # Errors
    ///
    /// Fails if the system refuses to install the signal handlers, to start the child process, or to start
    /// the thread that waits for signals. If one of these three steps fails, no child process is left.
    pub fn run(&self, command: &mut Command) -> Result<ExitStatus> {
        let Some(is_alone) = &self.is_alone else {
            let mut child = command.spawn().map_err(|error| not_started(&error))?;
            return child.wait().map_err(not_awaited);
        };
        // The handlers are installed before `is_alone` becomes false. If `is_alone` became false before the
        // handlers were installed, a signal that arrives in between would be lost.
        let signals = Signals::new(ENDING).map_err(not_handled)?;
        is_alone.store(false, Ordering::SeqCst);
        let is_over = || {
            if let Some(terminal) = &self.terminal {
                terminal.restore();
            }
            is_alone.store(true, Ordering::SeqCst);
        };
        match command.spawn() {
            Ok(mut child) => wait_with(signals, &mut child, Builder::new(), is_over),
            Err(error) => {
                is_over();
                Err(not_started(&error))
            }
        }
    }
}

/// Sets handlers of the signals in [`ENDING`]. The returned flag is true at first. While the flag is true, each signal
/// in [`ENDING`] ends this process. If this process is the first process of a container, the signal's handler ends it
/// with the exit code 128 plus the signal's number, since a signal without a handler cannot end the first process. When
/// the first process exits, the system ends all other processes of the container.
fn handled() -> std::io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(true));
    for signal in ENDING {
        if std::process::id() == FIRST_PROCESS {
            register_conditional_shutdown(signal, 128 + signal, Arc::clone(&flag))?;
        } else {
            register_conditional_default(signal, Arc::clone(&flag))?;
        }
    }
    Ok(flag)
}

/// Waits until a child process has ended, then calls `is_over`. Meanwhile, a thread waits for `signals`; for each
/// signal that arrives, the thread sends SIGTERM to the child process. (`listener` starts this thread.) Returns the
/// child's exit status or, if signals arrived, a status that says that the first signal ended the child
/// process. If the thread cannot be started, kills the child process and returns an error. The child
/// process's number stays in use until the thread has ended, so the thread never ends another process.
fn wait_with(
    mut signals: Signals,
    child: &mut Child,
    listener: Builder,
    is_over: impl FnOnce(),
) -> Result<ExitStatus> {
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
            // If the child process has ended meanwhile, it cannot be killed; this failure does not matter.
            let _ = child.kill();
        }
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
        let ended = rustix::io::retry_on_intr(|| waitid(WaitId::Pid(process), options));
        is_over();
        handle.close();
        let received = listener.map(|listener| listener.join().ok().flatten());
        let status = ended.map_err(std::io::Error::from).and_then(|_| child.wait());
        let received = received.map_err(|error| Error::no_thread(&error))?;
        status.map(|status| received.map_or(status, ExitStatus::from_raw)).map_err(not_awaited)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use signal_hook::consts::{SIGURG, SIGWINCH};

    #[test]
    fn if_no_thread_can_wait_for_signals_the_child_process_is_killed() {
        // No address space can hold such a large stack, so the system refuses to start the thread.
        let refused = Builder::new().stack_size(1 << (usize::BITS - 1));
        let mut child = Command::new("sleep").arg("1000").spawn().expect("it starts");
        // Once a signal has a handler, it no longer ends the process of the tests. Therefore the test
        // installs a handler for SIGURG, a signal that ends no process anyway.
        let signals = Signals::new([SIGURG]).expect("a handler");
        let error = wait_with(signals, &mut child, refused, || ()).expect_err("there is no thread");
        assert!(error.to_string().starts_with("a thread could not be started: "), "{error}");
        let status = child.try_wait().expect("a status").expect("it has ended");
        assert_eq!(status.signal(), Some(9));
    }

    #[test]
    fn a_signal_ends_the_child_process_and_counts_as_the_one_that_ended_it() {
        let signals = Signals::new([SIGWINCH]).expect("a handler");
        let mut child = Command::new("sleep").arg("1000").spawn().expect("it starts");
        signal_hook::low_level::raise(SIGWINCH).expect("a signal");
        let mut is_over = false;
        let status = wait_with(signals, &mut child, Builder::new(), || is_over = true).expect("a status");
        assert!(is_over);
        assert_eq!(status.signal(), Some(SIGWINCH));
        let own = child.try_wait().expect("a status").expect("it has ended");
        assert_eq!(own.signal(), Some(SIGTERM));
    }
}
