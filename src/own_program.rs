//! The running program, started once more: as a worker, to list devices, or to compile a program and store it in the
//! cache.

use crate::error::{Error, Result};
use std::path::PathBuf;
use std::process::Command;

/// Returns a command that starts this program, even if its file was replaced or removed since it started (by a newer
/// build, say). Lists of processes show the started program as `raycl`.
pub fn own_program() -> Result<Command> {
    #[cfg_attr(not(unix), expect(unused_mut))]
    let mut command = Command::new(file()?);
    #[cfg(unix)]
    std::os::unix::process::CommandExt::arg0(&mut command, "raycl");
    Ok(command)
}

fn file() -> Result<PathBuf> {
    let running = PathBuf::from("/proc/self/exe");
    if running.exists() {
        return Ok(running);
    }
    std::env::current_exe().map_err(|error| {
        Error::run(format!("cannot find raycl's own executable file: {error}"))
            .with_help("start raycl by its full path")
    })
}
