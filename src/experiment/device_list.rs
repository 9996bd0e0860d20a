//! Lists devices in a child process. If a driver crashes, only the child process that lists devices ends. The
//! child process has a second purpose: the run's own process never starts a driver, so workers inherit no
//! state of a driver. Inherited state can do harm: after a process has started NVIDIA's driver (version 580),
//! the driver lists no device in the process's children.

use super::protocol::{DeviceList, Listed};
use crate::cache::Cache;
use crate::child::output_within;
use crate::device;
use crate::device::drivers::{crash_advice, installed};
use crate::device::patience::Patience;
use crate::error::{Error, Result};
use crate::own_program::own_worker;
use crate::sources::Sources;
use std::ffi::OsString;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

/// The time limit for listing the devices, which is far longer than drivers need.
const LIMIT: Duration = Duration::from_secs(120);

/// Returns all devices, as listed by a child process. If the child process sends no valid answer, a second child
/// process is started, since something other than a driver may have ended the first.
pub fn find_devices(cl_dir: Option<&Path>) -> Result<Vec<Listed>> {
    let answer = match ask(cl_dir)? {
        Ok(answer) => answer,
        Err(_) => ask(cl_dir)?.map_err(failed)?,
    };
    answer.result()
}

fn failed(why: impl std::fmt::Display) -> Error {
    Error::run(format!("the devices could not be listed: {why}"))
        .with_help(crash_advice(installed().len().saturating_sub(1)))
}

/// Lists the devices in a child process that has the environment variables `variables`. Returns `None` if the
/// process sends a valid answer, and otherwise the reason why it sends none.
///
/// # Errors
///
/// Fails if the child process cannot be started.
pub fn why_devices_are_not_listed(variables: &[(&str, OsString)]) -> Result<Option<String>> {
    let answer = ask_with(None, variables)?;
    Ok(answer.err())
}

fn ask(cl_dir: Option<&Path>) -> Result<std::result::Result<DeviceList, String>> {
    ask_with(cl_dir, &[])
}

/// Returns the child process's answer. If the process sent no valid answer, the inner error states how the process
/// ended, or that the process did not answer within the time limit.
fn ask_with(
    cl_dir: Option<&Path>,
    variables: &[(&str, OsString)],
) -> Result<std::result::Result<DeviceList, String>> {
    let mut command = own_worker()?;
    command.arg("--list").envs(variables.iter().cloned());
    if let Some(folder) = cl_dir {
        command.arg("--cl-dir").arg(folder);
    }
    command.stdin(Stdio::null()).stderr(Stdio::piped()).stdout(Stdio::piped());
    let not_started =
        |error: std::io::Error| Error::not_started("the process that lists the devices", &error);
    let child = command.spawn().map_err(not_started)?;
    let output = output_within(child, LIMIT).map_err(not_started)?;
    let Some(output) = output else {
        return Ok(Err(format!("a driver has not answered for {} s", LIMIT.as_secs())));
    };
    // The answer is the last line of the output, since a driver may print lines before the answer.
    let text = String::from_utf8_lossy(&output.stdout);
    Ok(serde_json::from_str(last_line(&text).unwrap_or_default()).map_err(|_| {
        let words = String::from_utf8_lossy(&output.stderr);
        let last_words = last_line(&words).unwrap_or("it printed nothing");
        format!("a driver ended the process that lists the devices ({}; {last_words})", output.status)
    }))
}

/// Returns the last line that is not blank; `None` if there is no such line.
fn last_line(text: &str) -> Option<&str> {
    text.lines().rev().map(str::trim).find(|line| !line.is_empty())
}

/// Returns the line with which a child process answers [`find_devices`].
pub fn list_devices(sources: &Sources) -> Result<String> {
    serde_json::to_string(&DeviceList::from(listed(sources))).map_err(|error| Error::fault(error.to_string()))
}

fn listed(sources: &Sources) -> Result<Vec<Listed>> {
    let _patience = Patience::begin()?;
    // The list is stored in the user's cache, where the run's other processes find it.
    let devices = device::list(&Cache::of_user(), sources)?;
    Ok(devices.into_iter().map(|device| Listed::of(device, sources)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_answer_is_the_last_line_that_is_not_blank() {
        assert_eq!(last_line("a driver's words\n\n {\"answer\": 1} \n \n"), Some("{\"answer\": 1}"));
        assert_eq!([last_line(""), last_line(" \n\n")], [None, None]);
    }
}
