//! What the end of a child process says: whether a driver may have ended it, and its exit code.

use crate::child::{crash, signal};
use crate::device::patience::HUNG;
use std::process::ExitStatus;

/// Returns a text that says how a process ended, if a driver may have ended it; otherwise `None`.
pub fn drivers_doing(status: ExitStatus) -> Option<String> {
    if status.code() == Some(HUNG) {
        return Some("a driver did not answer".to_owned());
    }
    if let Some(code) = status.code().filter(|code| !is_own(*code)) {
        return Some(format!("raycl's child process ended with the exit code {code}, probably in a driver"));
    }
    let (signal, name) = crash(status)?;
    Some(format!("raycl's child process crashed, probably in a driver: {name} (signal {signal})"))
}

/// Returns true if raycl itself can end a process with this exit code: 0, 1 and 2, 101 after a panic, and 128
/// or more after a signal. The caller handles the exit code [`HUNG`] itself. If a process ends with a code
/// that is neither raycl's own nor [`HUNG`], a library has ended the process. For example, Mesa's compiler of
/// SPIR-V ends the process with 8 if the compiler does not know an instruction.
fn is_own(code: i32) -> bool {
    matches!(code, 0..=2 | 101 | 128..)
}

/// Returns the exit code of a process, or 128 plus the number of the signal that ended it, as shells do.
pub fn exit_code(status: ExitStatus) -> i32 {
    status.code().unwrap_or_else(|| 128 + signal(status).map_or(0, |(signal, _)| signal))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt as _;

    #[test]
    fn an_exit_code_that_raycl_never_has_is_a_drivers_doing() {
        let doing = |code: i32| drivers_doing(ExitStatus::from_raw(code << 8));
        for code in [0, 1, 2, 101, 128, 130, 143, 255] {
            assert_eq!(doing(code), None, "{code}");
        }
        assert_eq!(doing(124).as_deref(), Some("a driver did not answer"));
        for code in [3, 8, 100, 102, 127] {
            let expected =
                format!("raycl's child process ended with the exit code {code}, probably in a driver");
            assert_eq!(doing(code), Some(expected));
        }
    }

    #[test]
    fn a_process_that_a_signal_ended_has_128_plus_the_signal_as_exit_code() {
        let of_wait = |status| exit_code(ExitStatus::from_raw(status));
        // The status that the system call `wait` returns has the number of the signal in its low bits, and the exit
        // code above these bits.
        assert_eq!([of_wait(2), of_wait(15), of_wait(2 << 8), of_wait(0)], [130, 143, 2, 0]);
    }
}
