//! What a process inherits from the process that started it: ignored signals, the mode of its standard
//! streams, and open files. raycl repairs inherited settings that would disturb its own work. If a child
//! process of raycl outlives the command, the child process closes the files that it inherited; otherwise
//! these files would stay in use.

/// Makes raycl independent of two settings that it inherits: an ignored SIGCHLD, and non-blocking standard
/// streams. With an ignored SIGCHLD, raycl could not wait for its own child processes. With a non-blocking
/// standard stream, raycl could not wait until the stream has data or space. This function must be called
/// before the process starts another process.
#[cfg(unix)]
pub fn repair() {
    heed_child_processes();
    wait_for_streams();
}

/// Does nothing: only Unix has SIGCHLD and non-blocking standard streams.
#[cfg(not(unix))]
pub fn repair() {}

/// Installs a handler for SIGCHLD if this process ignores the signal, or if the system does not say whether
/// it does. If a process ignored SIGCHLD, the system would discard the exit statuses of its child processes.
/// Processes that this process starts have no handler, and do not ignore the signal.
#[cfg(unix)]
fn heed_child_processes() {
    use signal_hook::consts::SIGCHLD;
    use std::sync::{Arc, atomic::AtomicBool};
    // A handler may interrupt system calls of drivers, so it is installed only if this process may ignore
    // SIGCHLD.
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    if may_ignore(SIGCHLD, &status) {
        // If the handler cannot be installed, raycl may have to report later that it cannot wait for a child
        // process.
        let _ = signal_hook::flag::register(SIGCHLD, Arc::new(AtomicBool::new(false)));
    }
}

/// Returns true if a process ignores the signal with the number `signal`, or if `status` does not say whether
/// it does. `status` is the text of the process's file /proc/self/status.
#[cfg(unix)]
fn may_ignore(signal: i32, status: &str) -> bool {
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok());
    ignored.is_none_or(|bits| bits & (1 << (signal - 1)) != 0)
}

/// Makes standard input, standard output and standard error blocking, so that reading waits for data and
/// writing waits for space. A pipe or a terminal that raycl shares with another process, such as node.js, can
/// be non-blocking. The flag for non-blocking belongs to the open pipe or terminal, not to a process. If the
/// process that started raycl uses the same terminal or the same end of the pipe, its streams therefore
/// become blocking as well.
#[cfg(unix)]
fn wait_for_streams() {
    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    use rustix::stdio::{stderr, stdin, stdout};
    for stream in [stdin(), stdout(), stderr()] {
        if let Ok(flags) = fcntl_getfl(stream)
            && flags.contains(OFlags::NONBLOCK)
        {
            // If the system refuses to make a stream blocking, reading from it or writing to it may fail later, with a
            // message.
            let _ = fcntl_setfl(stream, flags.difference(OFlags::NONBLOCK));
        }
    }
}

/// On systems with `/proc`, closes all files that this process inherited, except its standard streams. If the
/// inherited files stayed open, locks or pipes of the parent process would stay in use as long as this
/// process lives. After closing files, the function replaces standard output by `/dev/null`. The process that
/// reads standard output then notices that the files are closed. When this function is called, no code of
/// this process may be using any file other than the standard streams.
#[cfg(unix)]
pub(crate) fn leave_files() {
    let listed = std::fs::read_dir("/proc/self/fd").into_iter().flatten();
    let numbers: Vec<i32> =
        listed.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok()).collect();
    // The list also contains the descriptor of the listing itself, which is closed by now.
    let is_open = |number: &i32| std::fs::symlink_metadata(format!("/proc/self/fd/{number}")).is_ok();
    for number in numbers.into_iter().filter(|number| *number > 2 && is_open(number)) {
        // SAFETY: the caller ensures that no object of this process owns any descriptor other than those of
        // the standard streams.
        unsafe { rustix::io::close(number) };
    }
    // If `/dev/null` cannot be opened, the reader of standard output waits until this process ends.
    if let Ok(nowhere) = std::fs::File::options().write(true).open("/dev/null") {
        let _ = rustix::stdio::dup2_stdout(&nowhere);
    }
}

/// Does nothing on systems other than Unix: the process keeps the files that it inherited.
#[cfg(not(unix))]
pub(crate) fn leave_files() {}

#[cfg(all(test, unix))]
mod tests {
    use super::may_ignore;

    #[test]
    fn a_process_that_ignores_a_signal_is_recognised_by_its_status() {
        let status =
            |bits: &str| format!("Name:\traycl\nSigBlk:\t0000000000010000\nSigIgn:\t{bits}\nSigCgt:\t0\n");
        // The signal with the number 17 is bit 16.
        assert!(may_ignore(17, &status("0000000000010000")) && may_ignore(17, &status("0000000000011000")));
        assert!(!may_ignore(17, &status("0000000000001000")) && !may_ignore(17, &status("0000000000028000")));
        assert!(may_ignore(17, "") && may_ignore(17, &status("unknown")));
    }
}
