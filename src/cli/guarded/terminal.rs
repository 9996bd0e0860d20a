//! Restores the terminal after a child process has shown pictures in it. If a driver crashes or a signal ends
//! the child process, the terminal stays in raw mode, shows its alternate screen and reports the movements of
//! the mouse. The code in this file runs in the parent process and makes the terminal usable again.

use super::errors::not_awaited;
use crate::error::{Error, Result};
use crate::view::screen::leave_terminal;
use rustix::process::{Pid, Signal, kill_process};
use rustix::stdio::stdin;
use rustix::termios::{OptionalActions, Termios, tcgetattr, tcsetattr};
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::flag::register_conditional_default;
use signal_hook::iterator::Signals;
use std::io::{IsTerminal as _, Write as _};
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Builder;

/// The codes that end an incomplete picture and select the usual colours.
const END_OF_PICTURE: &[u8] = b"\x1b\\\x1b[0m";

/// The signals with which a user, a shell or the system ends processes.
const ENDING: [i32; 4] = [SIGHUP, SIGINT, SIGQUIT, SIGTERM];

/// A terminal that child processes use, one after another.
pub struct LentTerminal {
    /// The terminal's mode before the first child process.
    mode: Termios,
    /// True while no child process uses the terminal. While this value is true, a signal in [`ENDING`] ends this
    /// process at once.
    is_back: Arc<AtomicBool>,
}

impl LentTerminal {
    /// Returns the terminal; `None` if standard input or standard output is not a terminal.
    pub fn new() -> std::io::Result<Option<Self>> {
        let (Ok(mode), true) = (tcgetattr(stdin()), std::io::stdout().is_terminal()) else { return Ok(None) };
        let is_back = Arc::new(AtomicBool::new(true));
        for signal in ENDING {
            register_conditional_default(signal, Arc::clone(&is_back))?;
        }
        Ok(Some(Self { mode, is_back }))
    }

    /// Waits until a child process that uses the terminal has ended, then restores the terminal. If this
    /// process gets a signal in [`ENDING`] (signals that end processes) while it waits, this process goes on,
    /// but ends the child process. The returned status then says that this signal ended the child process.
    ///
    /// # Errors
    ///
    /// Fails if the system refuses the handlers of these signals, or the thread that waits for the signals.
    /// In both cases, the child process has been killed.
    pub fn wait(&self, child: &mut Child) -> Result<ExitStatus> {
        self.is_back.store(false, Ordering::SeqCst);
        let ended = match Signals::new(ENDING) {
            Ok(signals) => wait_with(signals, child, Builder::new()),
            Err(error) => {
                // If the child process has ended meanwhile, it does not matter that it cannot be killed.
                let _ = child.kill().and_then(|()| child.wait());
                Err(not_awaited(error))
            }
        };
        self.restore();
        self.is_back.store(true, Ordering::SeqCst);
        ended
    }

    /// Restores the terminal, unless the child process has done so.
    fn restore(&self) {
        if tcgetattr(stdin()).is_ok_and(|now| now.local_modes == self.mode.local_modes) {
            return;
        }
        let mut out = std::io::stdout();
        // If this output fails, the failure is ignored, since a message in the same terminal would fail too.
        let _ = out.write_all(END_OF_PICTURE).and_then(|()| leave_terminal(&mut out));
        // Reports of the mouse that no process has read are discarded: the user's shell would take them for
        // typed text.
        let _ = tcsetattr(stdin(), OptionalActions::Flush, &self.mode);
    }
}

/// Waits until a child process has ended. Meanwhile, the thread that `listener` starts waits for `signals`,
/// and ends the child process after each of them. Returns the child's exit status or, if signals arrived, a
/// status that says that the first of them ended the child process. If the thread cannot be started, kills
/// the child process and returns an error.
fn wait_with(mut signals: Signals, child: &mut Child, listener: Builder) -> Result<ExitStatus> {
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
    use signal_hook::consts::SIGURG;
    use std::process::Command;

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
}
