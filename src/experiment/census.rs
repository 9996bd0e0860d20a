//! Finding devices in a process of their own. A driver that fails while it is listed takes that process down, not the
//! run; and a run that has never started a driver hands nothing of one to its workers: NVIDIA's (580) lists no device
//! in a process whose parent has started it.

use super::protocol::Census;
use crate::device::{DeviceInfo, discover};
use crate::error::{Error, Result};
use std::process::{Command, Stdio};

/// Every device, as a process of its own finds them.
pub fn find_devices() -> Result<Vec<DeviceInfo>> {
    let failed = |why: &dyn std::fmt::Display| Error::run(format!("the devices could not be listed: {why}"));
    let program = std::env::current_exe().map_err(|error| failed(&error))?;
    let mut command = Command::new(program);
    command.args(["worker", "--list"]).stdin(Stdio::null()).stderr(Stdio::piped()).stdout(Stdio::piped());
    let output = command.output().map_err(|error| failed(&error))?;
    // Drivers may print lines of their own before ours, the last.
    let text = String::from_utf8_lossy(&output.stdout);
    let last = text.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or_default();
    match serde_json::from_str(last) {
        Ok(Census::Devices(devices)) => Ok(devices),
        Ok(Census::Failed { message, help }) => Err(match help {
            Some(help) => Error::run(message).with_help(help),
            None => Error::run(message),
        }),
        Err(_) => {
            let words = String::from_utf8_lossy(&output.stderr);
            let last_words = words.lines().next_back().unwrap_or("it said nothing");
            Err(failed(&format!("a driver ended the process that asked ({}; {last_words})", output.status)))
        }
    }
}

/// Lists the devices on standard output, for [`find_devices`].
pub fn list_devices() -> Result<()> {
    let census = match discover() {
        Ok(devices) => Census::Devices(devices.into_iter().map(|device| device.info).collect()),
        Err(error) => {
            let help = miette::Diagnostic::help(&error).map(|help| help.to_string());
            Census::Failed { message: error.to_string(), help }
        }
    };
    let line = serde_json::to_string(&census).map_err(|error| Error::run(error.to_string()))?;
    crate::cli::print(format!("\n{line}"))
}
