//! Restores the terminal after a child process has shown pictures in it. If a driver crashes or a signal ends the child
//! process, the terminal stays in raw mode, shows its alternate screen and reports the movements of the mouse. The
//! parent process, which runs this code, then makes the terminal usable again.

use crate::view::screen::leave_terminal;
use rustix::process::{Pid, Signal, kill_process};
use rustix::stdio::stdin;
use rustix::termios::{OptionalActions, Termios, tcgetattr, tcsetattr};
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::flag::register_conditional_default;
use signal_hook::iterator::Signals;
use std::io::{IsTerminal as _, Result, Write as _};
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The codes that end a picture that was written only in part, and that select the usual colours.
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
    pub fn new() -> Result<Option<Self>> {
        let (Ok(mode), true) = (tcgetattr(stdin()), std::io::stdout().is_terminal()) else { return Ok(None) };
        let is_back = Arc::new(AtomicBool::new(true));
        for signal in ENDING {
            register_conditional_default(signal, Arc::clone(&is_back))?;
        }
        Ok(Some(Self { mode, is_back }))
    }

    /// Waits until a child process that uses the terminal has ended, then restores the terminal. If this process gets a
    /// signal in [`ENDING`] (signals that end processes) while it waits, it does not end, but ends the child process.
    /// The returned status then says that this signal ended the child process.
    pub fn wait(&self, child: &mut Child) -> Result<ExitStatus> {
        let process = Pid::from_child(child);
        let mut signals = Signals::new(ENDING)?;
        let handle = signals.handle();
        self.is_back.store(false, Ordering::SeqCst);
        let ended = std::thread::scope(|scope| {
            let listener = scope.spawn(|| {
                signals.forever().fold(None, |first, signal| {
                    // Whichever signal arrived, the child process gets SIGTERM: LLVM, which PoCL uses, can catch the
                    // first SIGQUIT and ignore it. If the child process has ended meanwhile, it does not matter that
                    // sending the signal fails.
                    let _ = kill_process(process, Signal::TERM);
                    first.or(Some(signal))
                })
            });
            let ended = child.wait();
            handle.close();
            let received = listener.join().ok().flatten();
            ended.map(|status| received.map_or(status, ExitStatus::from_raw))
        });
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
        // Reports of the mouse that nobody has read are discarded: the user's shell would take them for typed text.
        let _ = tcsetattr(stdin(), OptionalActions::Flush, &self.mode);
    }
}
