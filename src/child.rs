//! Waits for child processes, up to a time limit or until the caller no longer needs a process's output.
//! Distinguishes crashes from the other ways in which a process can end.

use crate::threads::locked;
use std::io::{Read, Result as IoResult, Write, copy};
use std::process::{Child, ExitStatus, Output};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::thread::{Builder, sleep};
use std::time::{Duration, Instant};

/// The longest wait for the end of a process that was killed. Linux does not end a process while a driver in
/// Linux's kernel keeps the process in uninterruptible sleep, which may last for ever.
const KILLED: Duration = Duration::from_secs(10);

/// The longest wait for the end of the output of a process that has ended. The output ends later than the process if
/// a program that the process started still runs and has inherited the output streams.
const REST: Duration = Duration::from_secs(1);

/// Calls `ended` until it returns a process's status, and returns this status. Returns `None` if the process
/// has not ended within `limit`.
pub fn status_within<T>(
    limit: Duration,
    mut ended: impl FnMut() -> IoResult<Option<T>>,
) -> IoResult<Option<T>> {
    let start = Instant::now();
    loop {
        match ended()? {
            None if start.elapsed() < limit => sleep(Duration::from_millis(2)),
            status => return Ok(status),
        }
    }
}

/// Kills a process, and returns its status when it has ended. Returns `None` if the process has not ended
/// within [`KILLED`]; the process then still exists.
pub fn kill(child: &mut Child) -> IoResult<Option<ExitStatus>> {
    child.kill()?;
    status_within(KILLED, || child.try_wait())
}

/// Waits until a process ends, and returns its output. If the process runs for longer than `limit`, kills it
/// and returns `None`.
pub fn output_within(child: Child, limit: Duration) -> IoResult<Option<Output>> {
    let start = Instant::now();
    output_unless(child, Duration::from_millis(5), &mut || start.elapsed() > limit)
}

/// Waits until a process ends, and returns its output. During the wait, the function calls `is_over` once per
/// `interval`. If `is_over` returns true, the function kills the process and returns `None`. The function
/// also kills the process if the system refuses a thread that would read the process's output; the function
/// then returns an error. If the output does not end within [`REST`] after the end of the process, the function
/// returns the output that was read until then.
pub fn output_unless(
    mut child: Child,
    interval: Duration,
    is_over: &mut dyn FnMut() -> bool,
) -> IoResult<Option<Output>> {
    let stdout = child.stdout.take().map(reading).transpose();
    let stderr = child.stderr.take().map(reading).transpose();
    let (stdout, stderr) = match (stdout, stderr) {
        (Ok(stdout), Ok(stderr)) => (stdout, stderr),
        // The system refused a thread that would read an output stream. Without this `kill`, the process
        // would run on after the function has returned.
        (Err(error), _) | (_, Err(error)) => {
            kill(&mut child)?;
            return Err(error);
        }
    };
    loop {
        if let Some(status) = child.try_wait()? {
            let until = Instant::now() + REST;
            let [stdout, stderr] = [stdout, stderr].map(|stream| words_of(stream, until));
            return Ok(Some(Output { status, stdout, stderr }));
        }
        if is_over() {
            kill(&mut child)?;
            return Ok(None);
        }
        sleep(interval);
    }
}

/// Returns the number and the name of the signal with which a process crashed; `None` if the process did not crash.
pub fn crash(status: ExitStatus) -> Option<(i32, &'static str)> {
    signal(status).filter(|(_, name)| CRASHES.contains(name))
}

/// Signals that result from a fault of the process itself, so a driver may be the cause. Most other signals, such as
/// SIGTERM, come from outside the process.
const CRASHES: [&str; 7] = ["SIGABRT", "SIGBUS", "SIGFPE", "SIGILL", "SIGSEGV", "SIGSYS", "SIGTRAP"];

/// Returns the number and the name of the signal that ended a process; `None` if no signal ended it.
#[cfg(unix)]
pub fn signal(status: ExitStatus) -> Option<(i32, &'static str)> {
    use std::os::unix::process::ExitStatusExt as _;
    let signal = status.signal()?;
    Some((signal, signal_hook::low_level::signal_name(signal).unwrap_or("a signal without a name")))
}

/// Returns `None`: on systems other than Unix, no signal ends a process.
#[cfg(not(unix))]
pub fn signal(_: ExitStatus) -> Option<(i32, &'static str)> {
    None
}

/// A stream that another thread reads.
struct Reading {
    heard: Heard,
    /// Nothing is sent through this channel. The channel is closed at the stream's end.
    ended: Receiver<()>,
}

/// The bytes that were read from a stream so far.
#[derive(Clone, Default)]
struct Heard(Arc<Mutex<Vec<u8>>>);

impl Write for Heard {
    fn write(&mut self, bytes: &[u8]) -> IoResult<usize> {
        locked(&self.0).write(bytes)
    }

    fn flush(&mut self) -> IoResult<()> {
        Ok(())
    }
}

/// Reads a stream to its end in another thread. Otherwise, the stream's pipe could fill up, and the child process
/// would wait until somebody reads from the pipe.
fn reading(mut from: impl Read + Send + 'static) -> IoResult<Reading> {
    let (heard, (open, ended)) = (Heard::default(), channel::<()>());
    let mut to = heard.clone();
    Builder::new().spawn(move || {
        let _ = copy(&mut from, &mut to);
        drop(open);
    })?;
    Ok(Reading { heard, ended })
}

/// Returns all bytes of a stream. If the stream has not ended by the time `until`, returns the bytes that were read
/// from it until then.
fn words_of(stream: Option<Reading>, until: Instant) -> Vec<u8> {
    let Some(Reading { heard, ended }) = stream else { return Vec::new() };
    let _ = ended.recv_timeout(until.saturating_duration_since(Instant::now()));
    std::mem::take(&mut *locked(&heard.0))
}

#[cfg(all(test, unix))]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt as _;
    use std::process::{Command, Stdio};

    fn shell(script: &str, limit: Duration) -> Option<Output> {
        let mut command = Command::new("sh");
        command.args(["-c", script]).stdout(Stdio::piped()).stderr(Stdio::piped());
        output_within(command.spawn().unwrap(), limit).unwrap()
    }

    #[test]
    fn a_process_that_hangs_is_ended_and_one_that_speaks_is_heard() {
        assert!(shell("exec sleep 1000", Duration::from_millis(50)).is_none());
        let spoke = shell("head -c 300000 /dev/zero; echo no >&2; exit 3", Duration::from_secs(120)).unwrap();
        assert_eq!((spoke.stdout.len(), spoke.status.code()), (300_000, Some(3)));
        assert_eq!(spoke.stderr, b"no\n");
    }

    #[test]
    fn a_program_that_outlives_the_process_and_keeps_its_output_open_is_not_waited_for() {
        let spoke = shell("sleep 1000 & echo $!", Duration::from_secs(120)).unwrap();
        let sleeper = String::from_utf8(spoke.stdout).unwrap();
        assert!(spoke.status.success() && sleeper.trim().parse::<u32>().is_ok(), "{sleeper}");
        let killed = shell(&format!("kill {sleeper}"), Duration::from_secs(120)).unwrap();
        assert!(
            killed.status.success(),
            "the program no longer ran: the function has waited for the program's end"
        );
    }

    #[test]
    fn a_process_that_not_even_a_kill_ends_is_waited_for_only_until_the_limit() {
        let never = || Ok(None::<ExitStatus>);
        assert_eq!(status_within(Duration::from_millis(5), never).unwrap(), None);
        let mut looks = 0;
        let third = || {
            looks += 1;
            Ok((looks == 3).then_some("ended"))
        };
        assert_eq!(status_within(Duration::from_secs(120), third).unwrap(), Some("ended"));
    }

    #[test]
    fn a_process_crashes_by_signals_of_its_own_faults_and_not_by_others() {
        use signal_hook::consts::{SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGSEGV, SIGSYS, SIGTRAP};
        use signal_hook::consts::{SIGHUP, SIGINT, SIGKILL, SIGPIPE, SIGQUIT, SIGTERM};
        let is_crash = |signal: &i32| crash(ExitStatus::from_raw(*signal)).is_some();
        assert!([SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGSEGV, SIGSYS, SIGTRAP].iter().all(is_crash));
        assert!(![SIGHUP, SIGINT, SIGKILL, SIGPIPE, SIGQUIT, SIGTERM].iter().any(is_crash));
    }

    #[test]
    fn a_process_is_killed_as_soon_as_it_is_over() {
        let child = Command::new("sleep").arg("1000").stdin(Stdio::null()).spawn().unwrap();
        let mut looks = 0;
        let ended = output_unless(child, Duration::from_millis(1), &mut || {
            looks += 1;
            looks == 3
        });
        assert!(ended.unwrap().is_none());
        assert_eq!(looks, 3);
    }
}
