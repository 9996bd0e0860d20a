//! Restores the terminal after a child process has shown pictures in it. If a driver crashes or a signal ends
//! the child process, the terminal stays in raw mode, shows its alternate screen and reports the movements of
//! the mouse. The code in this file runs in the parent process and makes the terminal usable again.

use crate::view::screen::leave_terminal;
use rustix::stdio::stdin;
use rustix::termios::{OptionalActions, Termios, tcgetattr, tcsetattr};
use std::io::{IsTerminal as _, Write as _};

/// The escape codes that end an incomplete picture and select the terminal's default colours.
const END_OF_PICTURE: &[u8] = b"\x1b\\\x1b[0m";

/// A terminal that child processes use, one after another.
pub struct LentTerminal {
    /// The terminal's mode before the first child process.
    mode: Termios,
}

impl LentTerminal {
    /// Returns the terminal; `None` if standard input or standard output is not a terminal.
    pub fn new() -> Option<Self> {
        let mode = tcgetattr(stdin()).ok()?;
        std::io::stdout().is_terminal().then_some(Self { mode })
    }

    /// Restores the terminal after a child process, unless the child process has restored it.
    pub fn restore(&self) {
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
