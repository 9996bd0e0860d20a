//! Starts workers as child processes, and exchanges messages with them through pipes.

use super::protocol::{Job, Reply, Request};
use super::waiting::{Death, Spawner, Wait, Worker};
use crate::child::{crash, kill, status_within};
use crate::device::{folder_advice, is_pocl};
use crate::error::{Error, Result};
use crate::own_program::own_worker;
use crate::printer;
use crate::program::{AFRESH, CACHE_DISABLE};
use crate::sources::Sources;
use serde::Serialize;
use std::ffi::OsString;
use std::io::{BufRead as _, BufReader, Read, Result as IoResult, Write as _};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

/// The number of bytes that are stored from the end of a worker's standard error.
const LAST_WORDS_BYTES: usize = 2000;
/// The longest time that a worker may take to end by itself. After this time, raycl kills the worker.
const FAREWELL: Duration = Duration::from_secs(1);
/// What happened to a worker that the system cannot end.
const NOT_ENDED: &str = "did not end, although raycl killed it";

/// Starts workers as processes of this program.
pub struct Processes {
    jobs: Vec<Job>,
    /// True if workers use the driver's cache of programs. The driver's cache contains no compiler messages,
    /// and therefore no numbers of registers.
    driver_cache: bool,
    /// True if the worker that is started next must compile its programs again instead of using stored
    /// programs.
    afresh: bool,
}

impl Processes {
    /// Makes a `Processes`; `jobs[i]` is the job (the device and the folder of kernels) of the workers that
    /// `spawn(i)` starts.
    #[must_use]
    pub fn new(jobs: Vec<Job>) -> Self {
        Self { jobs, driver_cache: false, afresh: false }
    }

    /// Lets workers use the driver's cache of programs. Builders (groups of processes that compile programs before
    /// points need them) store machine code in this cache for the workers that measure. A worker that measures may use
    /// the driver's cache if builders store its programs in raycl's own cache, together with the compiler's messages.
    #[must_use]
    pub fn using_driver_cache(self) -> Self {
        Self { driver_cache: true, ..self }
    }

    /// Returns the command that starts a worker. `disabled` is the user's value of the environment variable
    /// that disables the driver's cache; `None` if the variable is not set.
    fn command(&self, disabled: Option<OsString>) -> Result<Command> {
        let mut command = own_worker()?;
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // The end of a worker's standard error goes into records, where a backtrace would be too
        // long.
        command.env("RUST_BACKTRACE", "0");
        // A compiler prints numbers of registers only when it compiles, so raycl disables the driver's cache
        // unless `driver_cache` is set. If the user has set the environment variable that disables the
        // driver's cache, raycl leaves the variable unchanged: the value may be 0, which enables the cache.
        if !self.driver_cache && disabled.is_none() {
            command.env(CACHE_DISABLE, "1");
        }
        Ok(command)
    }
}

impl Spawner for Processes {
    fn spawn(&mut self, job: usize) -> Result<Box<dyn Worker>> {
        let not_started = |error: std::io::Error| Error::not_started("a worker process", &error);
        let line = self.jobs.get(job).map(line_of).transpose()?;
        let mut command = self.command(std::env::var_os(CACHE_DISABLE))?;
        if std::mem::take(&mut self.afresh) {
            command.env(AFRESH, "1");
        }
        let mut child = command.spawn().map_err(not_started)?;
        let no_thread = |error: std::io::Error| Error::no_thread(&error);
        let replies = child.stdout.take().map(read_replies).transpose().map_err(no_thread)?;
        let last_words = child.stderr.take().map(read_last_words).transpose().map_err(no_thread)?;
        let cl_dir = self.jobs.get(job).and_then(|job| job.cl_dir.clone());
        let mut worker = WorkerProcess {
            requests: child.stdin.take(),
            replies: replies.unwrap_or_else(|| channel().1),
            last_words,
            uses_pocl: self.jobs.get(job).and_then(|job| job.device.as_deref()).is_some_and(is_pocl),
            sources: cl_dir.map_or(Sources::Embedded, Sources::Folder),
            child,
        };
        if let Some(line) = line {
            worker.write(&line);
        }
        if let Some(job) = self.jobs.get_mut(job)
            && job.fault.is_some_and(|fault| fault.once)
        {
            job.fault = None;
        }
        Ok(Box::new(worker))
    }

    fn compile_afresh(&mut self) {
        self.afresh = true;
    }
}

/// A worker's process and its pipes.
struct WorkerProcess {
    child: Child,
    requests: Option<ChildStdin>,
    replies: Receiver<Reply>,
    last_words: Option<JoinHandle<String>>,
    /// True if PoCL is the driver of the worker's device.
    uses_pocl: bool,
    /// The kernel files of the worker's job.
    sources: Sources,
}

/// Reads replies until the worker closes its standard output. Lines that a driver writes to the standard
/// output are skipped.
fn read_replies(out: impl Read + Send + 'static) -> IoResult<Receiver<Reply>> {
    let (sender, replies) = channel();
    Builder::new().spawn(move || {
        for line in BufReader::new(out).split(b'\n').map_while(std::result::Result::ok) {
            if let Ok(reply) = serde_json::from_slice(&line)
                && sender.send(reply).is_err()
            {
                break;
            }
        }
    })?;
    Ok(replies)
}

fn read_last_words(mut err: impl Read + Send + 'static) -> IoResult<JoinHandle<String>> {
    Builder::new().spawn(move || {
        let (mut words, mut piece) = (Vec::new(), [0; 4096]);
        while let Ok(length @ 1..) = err.read(&mut piece) {
            words.extend_from_slice(&piece[..length]);
            words.drain(..words.len().saturating_sub(LAST_WORDS_BYTES));
        }
        String::from_utf8_lossy(&words).trim().to_owned()
    })
}

/// Returns a message for a worker as a line of JSON.
///
/// # Errors
///
/// Fails if the message has a path that is not UTF-8. `raycl run` and the library refuse paths that are not
/// UTF-8.
fn line_of(message: &impl Serialize) -> Result<Vec<u8>> {
    let mut line = serde_json::to_vec(message)
        .map_err(|error| Error::fault(format!("a worker process cannot get its task as JSON: {error}")))?;
    line.push(b'\n');
    Ok(line)
}

impl WorkerProcess {
    /// Writes a line to the worker. If the worker has ended, the write fails without an error. When raycl
    /// later waits for the worker's reply, the wait reports the worker's end.
    fn write(&mut self, line: &[u8]) {
        if let Some(requests) = &mut self.requests {
            let _ = requests.write_all(line).and_then(|()| requests.flush());
        }
    }

    /// Waits for the end of a worker that has closed its standard output, and returns how the worker died. If the
    /// worker crashed, the cause names the kernel files that the user added or changed.
    fn death(&mut self) -> Death {
        let end = self.end();
        let has_crashed = matches!(&end, Ok(Some(status)) if crash(*status).is_some());
        let suspects = has_crashed.then(|| self.sources.suspects()).flatten();
        let Death { cause, last_words } = death_of(end, self.last_words.take());
        // PoCL ends the process if it cannot store a compiled kernel, for example because the disk is full.
        let advice = self.uses_pocl.then(folder_advice).flatten();
        let cause = std::iter::once(cause).chain(advice).chain(suspects).collect::<Vec<_>>().join("; ");
        Death { cause, last_words }
    }

    /// Waits for the process's end. A process that has not ended within [`FAREWELL`] is killed. Returns `None`
    /// if the process does not end even then.
    fn end(&mut self) -> IoResult<Option<ExitStatus>> {
        match status_within(FAREWELL, || self.child.try_wait())? {
            None => kill(&mut self.child),
            status => Ok(status),
        }
    }
}

/// Returns how a worker died. `end` is the result of [`WorkerProcess::end`]. The thread `last_words` reads the
/// worker's standard error. If the worker has not ended, its standard error stays open, so this function does
/// not wait for the thread.
fn death_of(end: IoResult<Option<ExitStatus>>, last_words: Option<JoinHandle<String>>) -> Death {
    let cause = match end {
        Ok(Some(status)) => cause(status),
        Ok(None) => return Death { cause: NOT_ENDED.to_owned(), last_words: String::new() },
        Err(error) => format!("was lost ({error})"),
    };
    let last_words = last_words.and_then(|thread| thread.join().ok()).unwrap_or_default();
    Death { cause, last_words }
}

impl Worker for WorkerProcess {
    fn send(&mut self, request: &Request) {
        match line_of(request) {
            Ok(line) => self.write(&line),
            // A request that cannot be written as a line is not sent. The worker would then send no reply,
            // and the run would wait until the time limit. Closing the worker's standard input ends the
            // worker, and the run notices this end at once.
            Err(_) => self.requests = None,
        }
    }

    fn wait(&mut self, limit: Duration) -> Wait {
        match self.replies.recv_timeout(limit) {
            Ok(reply) => Wait::Reply(reply),
            Err(RecvTimeoutError::Timeout) => Wait::Silence,
            Err(RecvTimeoutError::Disconnected) => Wait::Dead(self.death()),
        }
    }

    fn dismiss(&mut self) {
        self.requests = None;
    }
}

/// Dropping a `WorkerProcess` closes the worker's standard input, so that the worker ends by itself. A worker
/// that has not ended within [`FAREWELL`] is killed. A worker that does not end even then stays behind.
impl Drop for WorkerProcess {
    fn drop(&mut self) {
        self.requests = None;
        if let Ok(None) = self.end() {
            let who = format!("a worker process (process {})", self.child.id());
            printer::tell(format!("note: {who} {NOT_ENDED}; the process may disturb later measurements"));
        }
    }
}

#[cfg(unix)]
fn cause(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt as _;
    match status.signal() {
        Some(signal) => match signal_hook::low_level::signal_name(signal) {
            Some(name) => format!("was killed by {name}"),
            None => format!("was killed by signal {signal}"),
        },
        None => format!("ended with {status}"),
    }
}

#[cfg(not(unix))]
fn cause(status: ExitStatus) -> String {
    format!("ended with {status}")
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn workers_compile_without_the_drivers_cache_unless_builders_or_users_choose_it() {
        let disables = |processes: &Processes, of_user: Option<&str>| {
            let command = processes.command(of_user.map(OsString::from)).unwrap();
            assert!(command.get_args().eq(["worker"]));
            for (name, value) in [("RUST_BACKTRACE", "0"), ("RAYCL_WORKER", "1")] {
                assert!(command.get_envs().any(|set| set == (name.as_ref(), Some(value.as_ref()))), "{name}");
            }
            let set: Vec<_> = command.get_envs().filter(|(name, _)| *name == CACHE_DISABLE).collect();
            set.iter().any(|(_, value)| *value == Some("1".as_ref()))
        };
        let plain = Processes::new(Vec::new());
        assert!(disables(&plain, None) && !disables(&plain, Some("0")));
        assert!(!disables(&plain.using_driver_cache(), None));
    }

    #[cfg(unix)]
    #[test]
    fn a_worker_whose_job_is_not_text_is_not_started() {
        use std::os::unix::ffi::OsStringExt as _;
        let config = std::path::PathBuf::from(OsString::from_vec(b"t\xff.toml".to_vec()));
        let error = Processes::new(vec![Job { config, ..Job::default() }]).spawn(0).err().unwrap();
        assert!(error.to_string().contains("as JSON"), "{error}");
    }

    #[test]
    fn replies_are_read_between_a_drivers_lines() {
        let replies = read_replies(&b"{\"star\n\n\"started\"\nready\n{\"built\":null}"[..]).unwrap();
        let next = || replies.recv_timeout(Duration::from_secs(120)).ok();
        assert_eq!([next(), next(), next()], [Some(Reply::Started), Some(Reply::Built(None)), None]);
    }

    #[test]
    fn the_last_words_of_a_process_that_does_not_end_are_not_waited_for() {
        let (end, until_the_end) = channel::<()>();
        let speaks = Builder::new().spawn(move || {
            let _ = until_the_end.recv_timeout(Duration::from_secs(120));
            "it ended".to_owned()
        });
        assert_eq!(death_of(Ok(None), speaks.ok()).describe(), "did not end, although raycl killed it");
        drop(end);
    }

    #[cfg(unix)]
    #[test]
    fn only_a_crash_of_a_worker_is_blamed_on_the_kernel_files_of_the_user() {
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join("mine.cl");
        std::fs::write(&own, "// mine\n").unwrap();
        let cause_of = |signal: &str, sources: Sources| {
            let mut child = Command::new("sh").args(["-c", &format!("kill -s {signal} $$")]).spawn().unwrap();
            // On a busy machine, the process may need longer than [`FAREWELL`] to end.
            child.wait().unwrap();
            let replies = channel().1;
            let mut worker =
                WorkerProcess { child, requests: None, replies, last_words: None, uses_pocl: false, sources };
            let Wait::Dead(death) = worker.wait(Duration::from_secs(120)) else { panic!("it lives") };
            death.describe()
        };
        let folder = || Sources::Folder(folder.path().to_owned());
        let files = "the folder of --cl-dir has kernel files that are not built in, or that differ from the built-in \
                     files";
        let crashed = format!("was killed by SIGSEGV; {files}: {}", own.display());
        assert_eq!(cause_of("SEGV", folder()), crashed);
        assert_eq!(cause_of("SEGV", Sources::Embedded), "was killed by SIGSEGV");
        // Linux may have killed the worker because memory ran out.
        assert_eq!(cause_of("KILL", folder()), "was killed by SIGKILL");
    }

    #[test]
    fn last_words_are_the_end_of_what_was_said() {
        let said = |text: String| read_last_words(std::io::Cursor::new(text)).unwrap().join().unwrap();
        assert_eq!(said(" oh\n".into()), "oh");
        let long: String = (0..3000).map(|n| char::from(b'a' + (n % 26) as u8)).collect();
        assert_eq!(said(long.clone()), long[1000..]);
    }
}
