//! Reads from `/proc` how much processor time other processes take while raycl measures. The module also
//! measures the core-to-core latency. raycl measures the processor time of other processes and the
//! core-to-core latency only on Linux.

#[cfg(target_os = "linux")]
mod core_to_core;
mod processor_time;

pub use processor_time::processor_time;

use crate::clock::ms_since;
use std::path::Path;
use std::time::Instant;

/// Processor time in clock ticks of the system, counted from an arbitrary moment in the past.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Ticks {
    /// Time that processors spent on all processes and on interrupts.
    busy: f64,
    /// Time taken by other virtual machines on the same hardware.
    stolen: f64,
    /// All time, idle or not, of all processors.
    all: f64,
    /// Time spent by this process and its child processes (the workers), including child processes that have
    /// ended.
    own: f64,
}

/// The processor time that other processes took during an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Length of the interval in milliseconds.
    pub ms: f64,
    /// Mean number of processors that other processes, and interrupts, kept busy: 1.5 means one and a half
    /// processors.
    pub others: f64,
    /// Mean number of processors that other virtual machines on the same hardware took from this virtual
    /// machine.
    pub stolen: f64,
    /// Number of processors of this machine.
    pub processors: usize,
    /// The system's load average of the last minute: the mean number of threads that ran, waited to run, or
    /// waited for a disk. `None` if the system does not report the load average.
    pub load_1m: Option<f64>,
    /// Core-to-core latency at the end of the interval, in nanoseconds; `None` if this latency cannot be
    /// measured.
    pub core_to_core_ns: Option<f64>,
}

/// Measures the processor time that other processes take between one reading and the next.
pub struct Watch {
    since: Instant,
    before: Option<Ticks>,
}

/// The shortest interval between two readings, in milliseconds. Shorter intervals contain too few clock ticks
/// for a result.
const SHORTEST_MS: f64 = 200.0;

impl Watch {
    /// Takes the first reading of the processor times.
    pub fn start() -> Self {
        Self { since: Instant::now(), before: ticks() }
    }

    /// Returns the processor time that other processes took since the last reading; `None` if the system does not
    /// report this time or the interval is too short.
    pub fn look(&mut self) -> Option<Load> {
        let ms = ms_since(self.since);
        if ms < SHORTEST_MS {
            return None;
        }
        let (before, now) = (self.before?, ticks()?);
        *self = Self { since: Instant::now(), before: Some(now) };
        between(before, now, ms).map(|load| Load { core_to_core_ns: core_to_core_ns(), ..load })
    }
}

fn between(before: Ticks, now: Ticks, ms: f64) -> Option<Load> {
    let all = now.all - before.all;
    let processors = processors()?;
    let part = |ticks: f64| (ticks / all * processors as f64).max(0.0);
    let busy = now.busy - before.busy;
    // `own` (the time of raycl's own processes) is read process by process, so the time of a worker that ends
    // during the reading may be missing in this reading. Of two readings of `own`, the later one may
    // therefore be smaller than the earlier one.
    let own = (now.own - before.own).max(0.0);
    (all > 0.0).then(|| Load {
        ms,
        others: part(busy - own),
        stolen: part(now.stolen - before.stolen),
        processors,
        load_1m: text("/proc/loadavg").and_then(|line| line.split(' ').next()?.parse().ok()),
        core_to_core_ns: None,
    })
}

/// Returns the time in nanoseconds in which a cache line moves from one processor to another; `None` if this
/// time cannot be measured. This measurement usually takes less than half a millisecond. If other programs
/// keep the processors busy, the measurement ends without a result after about 5 ms.
#[cfg(target_os = "linux")]
pub fn core_to_core_ns() -> Option<f64> {
    core_to_core::core_to_core_ns()
}

/// Returns `None`, since the core-to-core latency is measured only on Linux.
#[cfg(not(target_os = "linux"))]
pub fn core_to_core_ns() -> Option<f64> {
    None
}

fn text(path: impl AsRef<Path>) -> Option<String> {
    std::fs::read_to_string(path).ok()
}

fn ticks() -> Option<Ticks> {
    Some(Ticks { own: own_ticks(), ..machine_ticks(&text("/proc/stat")?)? })
}

fn processors() -> Option<usize> {
    let stat = text("/proc/stat")?;
    let is_one = |line: &&str| line.starts_with("cpu") && !line.starts_with("cpu ");
    Some(stat.lines().filter(is_one).count()).filter(|count| *count > 0)
}

/// Returns the processor times in the first line of `stat`, the text of `/proc/stat`. In the result, `own` is 0. The
/// line's numbers are user, nice, system, idle, iowait, irq, softirq, steal.
fn machine_ticks(stat: &str) -> Option<Ticks> {
    let numbers: Vec<f64> = stat
        .lines()
        .find_map(|line| line.strip_prefix("cpu "))?
        .split_whitespace()
        .filter_map(|number| number.parse().ok())
        .collect();
    let &[user, nice, system, idle, iowait, irq, softirq, stolen, ..] = numbers.as_slice() else {
        return None;
    };
    let busy = user + nice + system + irq + softirq;
    Some(Ticks { busy, stolen, all: busy + idle + iowait + stolen, own: 0.0 })
}

/// Returns the processor time of this process and of its child processes. When this process has waited for
/// the end of a child process, the system adds the child's time to the time of this process.
fn own_ticks() -> f64 {
    let mut all = process_ticks("self");
    for task in std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten() {
        let children = text(task.path().join("children")).unwrap_or_default();
        all += children.split_whitespace().map(process_ticks).sum::<f64>();
    }
    all
}

fn process_ticks(process: &str) -> f64 {
    text(format!("/proc/{process}/stat")).and_then(|stat| user_and_system(&stat)).unwrap_or(0.0)
}

/// Returns the sum of fields 14 to 17 of a process's `stat`. Fields 14 and 15 are the user and system time of
/// the process. Fields 16 and 17 are the user and system time of those child processes that have ended and
/// for which the process has waited. Field 2, the process's name in brackets, may contain any character, but
/// the last closing bracket of the line always ends the name.
fn user_and_system(stat: &str) -> Option<f64> {
    let after_name = &stat[stat.rfind(')')? + 1..];
    let times: Vec<f64> =
        after_name.split_whitespace().skip(11).take(4).filter_map(|ticks| ticks.parse().ok()).collect();
    (times.len() == 4).then(|| times.iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_read_from_what_the_system_writes() {
        let stat = "cpu  100 10 50 800 20 3 7 10 0 0\ncpu0 50 5 25 400 10 1 3 5 0 0\n";
        let ticks = machine_ticks(stat).expect("ticks");
        assert_eq!((ticks.busy, ticks.stolen, ticks.all), (170.0, 10.0, 1000.0));
        assert_eq!(machine_ticks("cpu  1 2\n"), None);
        let process = "7 (a) b (c) S 1 7 7 0 -1 0 1 2 3 4 30 12 9 9 20 0 1 0";
        assert_eq!(user_and_system(process), Some(60.0));
        assert_eq!(user_and_system("7 (a) S 1 7 7 0 -1 0 1 2 3 4 30 12 9"), None);
        assert_eq!(user_and_system("nothing"), None);
    }

    #[test]
    fn what_this_process_took_is_not_others() {
        let before = Ticks { busy: 100.0, stolen: 0.0, all: 1000.0, own: 50.0 };
        let now = Ticks { busy: 200.0, stolen: 20.0, all: 1200.0, own: 150.0 };
        if let Some(load) = between(before, now, 1000.0) {
            assert!(load.others.abs() < 1e-9, "{load:?}");
            assert!((load.stolen - 0.1 * load.processors as f64).abs() < 1e-9, "{load:?}");
        }
        assert!(between(now, now, 1000.0).is_none(), "no time, no load");
    }

    /// The shell's child process ends after one second of processor time, the limit that `ulimit` sets. On usual
    /// systems, a second has a hundred ticks.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_process_has_the_time_of_its_child_processes_that_have_ended() {
        use std::io::BufRead as _;
        use std::process::{Command, Stdio};
        let script = "(ulimit -c 0; ulimit -t 1 && while :; do :; done); echo; read line";
        let mut command = Command::new("sh");
        command.args(["-c", script]).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut shell = command.spawn().expect("a shell");
        let mut line = String::new();
        let said = shell.stdout.take().expect("its output");
        std::io::BufReader::new(said).read_line(&mut line).expect("a line");
        let ticks = process_ticks(&shell.id().to_string());
        drop(shell.stdin.take());
        shell.wait().expect("it ends");
        assert!(line == "\n" && ticks > 50.0, "{line:?} {ticks}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_machine_reports_its_ticks_and_processors() {
        assert!(ticks().is_some_and(|ticks| ticks.own >= 0.0 && ticks.all >= ticks.busy));
        assert!(processors().is_some());
    }
}
