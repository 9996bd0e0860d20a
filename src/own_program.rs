//! Makes commands that start another process of the running program, for example a worker, or a child process
//! that measures peak rates.

use crate::device::drivers::LIBRARIES;
use crate::error::{Error, Result};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The value that the environment variable with the name [`LIBRARIES`] had before any driver was loaded: the
/// names of drivers' libraries.
static LIBRARIES_AT_FIRST: OnceLock<Option<OsString>> = OnceLock::new();

/// Stores the value of the variable that names drivers' libraries. Processes that raycl starts later get the
/// stored value of this variable. This function must be called before a driver is loaded: some loaders split
/// the variable's value in place, so that the environment contains only the first name afterwards.
pub fn remember_libraries() {
    LIBRARIES_AT_FIRST.get_or_init(|| std::env::var_os(LIBRARIES));
}

/// The environment variable that is set for the workers that raycl starts.
const WORKER: &str = "RAYCL_WORKER";

/// The remedy if /proc is not mounted.
const NO_PROC: &str = "raycl finds its own executable file through the folder /proc, which is not mounted: mount it with `mount -t proc proc /proc`";

/// Returns true if raycl started this process as a worker.
pub fn is_worker() -> bool {
    std::env::var_os(WORKER).is_some()
}

/// Returns a command that starts this program as a worker. The variable [`WORKER`] distinguishes a worker of
/// raycl from a program that uses raycl as a library and has `worker` as its first argument.
pub fn own_worker() -> Result<Command> {
    let mut command = own_program()?;
    command.arg("worker").env(WORKER, "1");
    Ok(command)
}

/// Returns a command that starts this program. On systems with /proc, the command does so even if the program's file
/// was replaced or removed after the program started, for example by a newer build. In lists of processes with their
/// arguments, the started program is called `raycl`.
pub fn own_program() -> Result<Command> {
    let mut command = Command::new(file()?);
    #[cfg(unix)]
    std::os::unix::process::CommandExt::arg0(&mut command, "raycl");
    if let Some(libraries) = LIBRARIES_AT_FIRST.get().and_then(Option::as_ref) {
        command.env(LIBRARIES, libraries);
    }
    Ok(command)
}

fn file() -> Result<PathBuf> {
    let running = PathBuf::from("/proc/self/exe");
    if running.exists() {
        return Ok(running);
    }
    std::env::current_exe().map_err(|error| {
        let message = format!("cannot find raycl's own executable file: {error}");
        Error::run(message).with_help(advice(Path::new("/proc/self").exists()))
    })
}

/// Returns the remedy if this program's file is not found. `has_proc` is true if the system shows processes in /proc.
fn advice(has_proc: bool) -> &'static str {
    if cfg!(target_os = "linux") && !has_proc { NO_PROC } else { "start raycl by its full path" }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn without_proc_the_advice_is_to_mount_it() {
        assert!(advice(false).contains("mount -t proc proc /proc"));
        assert_eq!(advice(true), "start raycl by its full path");
    }
}
