//! Checks whether the launcher of this process (the program that started it, such as `mpirun`) is still alive. A
//! scheduler that has lost a job step does not look for the step's processes again. If processes did not check their
//! launcher, a process of a lost job step would go on measuring the same points as the process that replaces it. The
//! measurements of one of the two processes would then be useless, since a merge uses only one record of each point.

use super::{Asked, Attempt, End};
use crate::error::{Error, Result};
use crate::printer;
use std::time::Duration;

/// The time between two checks whether the launcher is alive.
const LOOK_UP: Duration = Duration::from_millis(500);
/// Launchers, and programs that start processes on a machine for a launcher. A launcher need not be the
/// parent of this process: the launcher may have started a shell that started this process.
const LAUNCHERS: [&str; 12] = [
    "slurmstepd",
    "orted",
    "prted",
    "prte",
    "mpirun",
    "mpiexec",
    "orterun",
    "prterun",
    "hydra_pmi_proxy",
    "mpiexec.hydra",
    "pmi_proxy",
    "hq",
];

/// Shells. The end of a shell does not mean that the launcher has ended: a user may have closed an
/// interactive shell, and a script may end before the processes that it started.
const SHELLS: [&str; 8] = ["sh", "bash", "dash", "zsh", "ksh", "fish", "tcsh", "busybox"];

/// Starts a thread that checks, for as long as this process runs, whether the launcher and all processes between the
/// launcher and this process are alive. If no ancestor of this process is a known launcher, the thread checks only
/// the parent. If one of the checked processes has ended, the thread records the loss of the launcher in the
/// attempt's folder and ends this process with exit code 1. The workers end with the process, and the points that are
/// being measured get no record. No process is checked in two cases. In the first case, no ancestor of this process
/// is a known launcher, the parent is a shell, and the user gave the shard's number. In the second case, the parent
/// is process 1, the first process of a container or of the system. No check is needed then, since all other
/// processes end with process 1. On systems other than Linux, no process is ever checked.
///
/// # Errors
///
/// Fails if no thread can be started.
pub fn watch_launcher(attempt: &Attempt, asked: Asked) -> Result<()> {
    let (chain, attempt) = (Chain::of_this_process(asked), attempt.clone());
    if chain.is_empty() {
        return Ok(());
    }
    let watch = move || {
        loop {
            std::thread::sleep(LOOK_UP);
            if let Some(lost) = chain.lost() {
                // If the attempt's folder cannot be written to, only the message below reports the loss of
                // the launcher.
                let _ = attempt.ended(&End::LauncherLost(lost.clone()));
                // Standard error may be a pipe whose reader, the launcher, has ended; `tell` ignores errors.
                printer::tell(printer::plain(&format!(
                    "launcher lost: {lost}, so raycl ends; if the scheduler does not start this shard again, start it yourself"
                )));
                std::process::exit(1);
            }
        }
    };
    // The thread runs for as long as the process, so no code waits for the thread's end.
    std::thread::Builder::new().spawn(watch).map(drop).map_err(|error| Error::no_thread(&error))
}

/// A process. The start time distinguishes a process from a later process with the same ID.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Process {
    id: u32,
    name: String,
    parent: u32,
    began: String,
}

/// The chain of processes from this process's parent up to the launcher, the first ancestor that is one of
/// [`LAUNCHERS`]. If no ancestor is a launcher, the chain contains at most the parent.
#[derive(Clone, Debug, Default)]
struct Chain(Vec<Process>);

impl Chain {
    fn of_this_process(asked: Asked) -> Self {
        Self::from(parent(), asked, &read)
    }

    /// Returns the chain of processes that begins at process `id`. The returned chain is empty if neither a
    /// launcher nor the parent should be checked.
    fn from(mut id: u32, asked: Asked, read: &dyn Fn(u32) -> Option<Process>) -> Self {
        let mut chain: Vec<Process> = Vec::new();
        while let Some(process) = Some(id).filter(|id| *id > 1).and_then(read) {
            id = process.parent;
            let is_launcher = LAUNCHERS.contains(&process.name.as_str());
            chain.push(process);
            if is_launcher {
                return Self(chain);
            }
        }
        chain.truncate(1);
        chain.retain(|parent| asked.is_auto() || !SHELLS.contains(&parent.name.as_str()));
        Self(chain)
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Searches the chain, from the parent up to the launcher, for a process that has ended. Returns a text about the
    /// first such process; `None` if all processes of the chain are alive.
    fn lost(&self) -> Option<String> {
        self.lost_by(&read)
    }

    fn lost_by(&self, read: &dyn Fn(u32) -> Option<Process>) -> Option<String> {
        let lives = |process: &&Process| read(process.id).is_some_and(|now| now.began == process.began);
        let gone = self.0.iter().find(|process| !lives(process))?;
        Some(format!("{} (process {}) has ended", gone.name, gone.id))
    }
}

#[cfg(unix)]
fn parent() -> u32 {
    std::os::unix::process::parent_id()
}

#[cfg(not(unix))]
fn parent() -> u32 {
    0
}

/// Reads a process from Linux's `/proc`. Returns `None` on other systems, and if the process has ended. A zombie (a
/// process that has ended, but whose parent has not waited for it yet) counts as ended, too.
fn read(id: u32) -> Option<Process> {
    parse(id, &std::fs::read_to_string(format!("/proc/{id}/stat")).ok()?)
}

/// Parses the text of `/proc/ID/stat`, which `proc(5)` describes: ID, name in brackets, state, parent, ..., and in
/// field 22 the start time. Returns `None` if the process has ended (state `Z` or `X`), or if the text has another
/// form.
fn parse(id: u32, stat: &str) -> Option<Process> {
    let (before, after) = stat.rsplit_once(')')?;
    let name = before.split_once('(')?.1.to_owned();
    let fields: Vec<&str> = after.split_whitespace().collect();
    let is_gone = matches!(*fields.first()?, "Z" | "X");
    let process =
        Process { id, name, parent: fields.get(1)?.parse().ok()?, began: (*fields.get(19)?).to_owned() };
    (!is_gone).then_some(process)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn process(id: u32, name: &str, parent: u32, began: &str) -> Process {
        Process { id, name: name.into(), parent, began: began.into() }
    }

    #[test]
    fn the_chain_goes_up_to_the_launcher_or_is_the_parent() {
        let table = [
            process(9, "bash", 7, "3"),
            process(7, "slurmstepd", 1, "2"),
            process(20, "bash", 19, "5"),
            process(19, "sshd", 1, "4"),
            // In a container, the first process may be a launcher. A container ends with its first process,
            // so raycl does not check whether the first process has ended.
            process(1, "mpirun", 0, "1"),
        ];
        let read = |id: u32| table.iter().find(|process| process.id == id).cloned();
        let given = "3/4".parse().expect("a shard");
        let names =
            |id, asked| Chain::from(id, asked, &read).0.into_iter().map(|p| p.name).collect::<Vec<_>>();
        assert_eq!(names(9, given), ["bash", "slurmstepd"]);
        assert!(
            names(20, given).is_empty(),
            "a shell may end before a process that it started with an explicit shard number"
        );
        assert_eq!(
            names(20, Asked::Auto(None)),
            ["bash"],
            "with --shard auto, the parent is checked even if it is a shell"
        );
        assert_eq!(names(19, given), ["sshd"]);
        assert!(names(1, given).is_empty(), "the first process never ends");
        let chain = Chain::from(9, given, &read);
        assert_eq!(chain.lost_by(&read), None);
        let without = |id: u32| read(id).filter(|process| process.id != 7);
        assert_eq!(chain.lost_by(&without).as_deref(), Some("slurmstepd (process 7) has ended"));
        let another = |id: u32| read(id).map(|process| Process { began: "99".into(), ..process });
        assert!(chain.lost_by(&another).is_some(), "another process has the same ID now");
    }

    #[test]
    fn every_launcher_is_checked_and_no_shell_that_started_a_given_shard() {
        let given = "3/4".parse().expect("a shard");
        let length = |name: &str| {
            let table = [process(9, "python3", 7, "3"), process(7, name, 5, "2"), process(5, "sshd", 1, "1")];
            let read = |id: u32| table.iter().find(|process| process.id == id).cloned();
            [9, 7].map(|id| Chain::from(id, given, &read).0.len())
        };
        // Slurm, Open MPI and its successor PRRTE, MPICH's Hydra, HyperQueue.
        let launchers = "slurmstepd orted prted prte mpirun mpiexec orterun prterun hydra_pmi_proxy mpiexec.hydra \
                         pmi_proxy hq";
        for name in launchers.split_whitespace() {
            assert_eq!(length(name), [2, 1], "{name}");
        }
        for name in "sh bash dash zsh ksh fish tcsh busybox".split(' ') {
            assert_eq!(length(name), [1, 0], "{name}");
        }
    }

    #[test]
    fn what_linux_tells_is_read_and_a_zombie_is_gone() {
        let fields = "1 1 1 0 -1 0 0 0 0 0 0 0 0 0 20 0 1 0 777 0";
        let stat = |state: &str| format!("42 (a (b) c) {state} 7 {fields}");
        let process = parse(42, &stat("S")).expect("a process");
        assert_eq!((process.name.as_str(), process.parent), ("a (b) c", 7));
        assert_eq!([parse(42, &stat("Z")), parse(42, &stat("X"))], [None, None]);
        #[cfg(target_os = "linux")]
        assert_eq!(read(std::process::id()).expect("this process").parent, parent());
    }
}
