//! Restores the terminal after a child process has shown pictures in it. If a driver crashes or a signal ends
//! the child process, the terminal stays in raw mode, shows its alternate screen and reports the movements of
//! the mouse. The code in this file runs in the parent process and makes the terminal usable again.

use super::errors::not_awaited;
use super::signals::{ENDING, wait_with};
use crate::error::Result;
use crate::view::screen::leave_terminal;
use rustix::stdio::stdin;
use rustix::termios::{OptionalActions, Termios, tcgetattr, tcsetattr};
use signal_hook::flag::register_conditional_default;
use signal_hook::iterator::Signals;
use std::io::{IsTerminal as _, Write as _};
use std::process::{Child, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Builder;

/// The codes that end an incomplete picture and select the usual colours.
const END_OF_PICTURE: &[u8] = b"\x1b\\\x1b[0m";

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
