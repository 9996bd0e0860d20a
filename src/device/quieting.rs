//! Keeps compilers from printing to the terminal.

use super::is_pocl;
use ocl::Device;
use ocl::enums::{DeviceInfo, DeviceInfoResult};
#[cfg(unix)]
use rustix::{io::dup, stdio::dup2_stderr};
#[cfg(unix)]
use std::{fs::File, os::fd::OwnedFd};

/// Returns a compiler option that stops PoCL's compiler from printing to the terminal, or an empty text for
/// other compilers. PoCL's compiler prints the number of warnings, as in "2 warnings generated.", to the terminal
/// instead of a log. The number of warnings that PoCL's compiler prints includes warnings in PoCL's own headers.
pub fn quieting(device: Device) -> &'static str {
    let platform = device.info(DeviceInfo::Platform).ok().and_then(|info| match info {
        DeviceInfoResult::Platform(platform) => ocl::Platform::new(platform).name().ok(),
        _ => None,
    });
    if platform.is_some_and(|name| is_pocl(&name)) { "-w" } else { "" }
}

/// Discards standard error as long as this value lives. PoCL's compiler prints remarks while it generates debug
/// information, and no option stops these remarks.
#[cfg(unix)]
pub struct Hush {
    stderr: Option<OwnedFd>,
}

#[cfg(unix)]
impl Hush {
    /// Begins to discard what is written to standard error. If standard error cannot be redirected, its text
    /// stays visible.
    pub fn begin() -> Self {
        let begin = || {
            let stderr = dup(rustix::stdio::stderr()).ok()?;
            let nowhere = File::options().write(true).open("/dev/null").ok()?;
            dup2_stderr(&nowhere).ok()?;
            Some(stderr)
        };
        Self { stderr: begin() }
    }
}

#[cfg(unix)]
impl Drop for Hush {
    fn drop(&mut self) {
        let _ = self.stderr.take().map(dup2_stderr);
    }
}

/// On systems other than Unix, `Hush` does not discard standard error.
#[cfg(not(unix))]
pub struct Hush;

#[cfg(not(unix))]
impl Hush {
    /// Does nothing, since this system is not Unix.
    pub fn begin() -> Self {
        Self
    }
}
