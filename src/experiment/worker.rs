//! A worker: the process in which the points of one device run. If a driver aborts, crashes or hangs, this process
//! ends, but the run continues. Requests arrive on standard input, replies go to standard output.

use super::asleep::Asleep;
use super::check::Checker;
use super::draft::Drafter;
use super::protocol::{Job, Reply, Request};
use super::request_handler::RequestHandler;
use super::{Pictures, Plan};
use crate::cache::Cache;
use crate::config;
use crate::device::{Device, DeviceInfo, LaneTest, pick_one};
use crate::error::{Error, Result};
use crate::program::Sources;
use serde::de::DeserializeOwned;
use std::io::{BufRead as _, Write as _};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, channel};

/// Serves requests until standard input ends.
pub fn serve() -> Result<()> {
    ignore_interrupts()?;
    let lines = input_lines();
    let Ok(line) = lines.recv() else { return Ok(()) };
    let job: Job = parse(&line)?;
    match work(&job, &lines) {
        Ok(()) => Ok(()),
        Err(error) => reply(&Reply::of_error(&error)),
    }
}

/// Opens the job's device and serves requests.
fn work(job: &Job, lines: &Receiver<String>) -> Result<()> {
    let sources = Sources::of(job.cl_dir.clone())?;
    let experiment = config::parse(&job.config, job.text.clone(), &job.overrides)?;
    let drafter = Drafter { experiment: &experiment, sources: &sources };
    let plan = Plan::new(&experiment, job.device_count);
    if let Some(frame_ms) = job.asleep_ms {
        let mut asleep = Asleep::new(drafter, plan, frame_ms);
        return answer(job, lines, |request| asleep.answer(request));
    }
    let device = job.device.as_deref().map(|identity| find(identity, &sources)).transpose()?;
    let checker = Checker::open(drafter, device.as_ref(), Pictures::of(&job.folder))?;
    let mut handler = RequestHandler::new(drafter, plan, checker, job.stands_for.clone());
    answer(job, lines, |request| handler.answer(request))
}

/// Serves requests until there are no more.
fn answer(
    job: &Job,
    lines: &Receiver<String>,
    mut answer: impl FnMut(&Request) -> Result<Reply>,
) -> Result<()> {
    reply(&Reply::Started)?;
    while let Ok(line) = lines.recv() {
        let request: Request = parse(&line)?;
        if let (Some(fault), Some((step, point))) = (&job.fault, request.step()) {
            fault.strike(step, point, &job.folder);
        }
        reply(&answer(&request).unwrap_or_else(|error| Reply::of_error(&error)))?;
    }
    Ok(())
}

/// Ignores SIGINT. Ctrl-C in a terminal reaches every process, but the run decides when its workers end.
fn ignore_interrupts() -> Result<()> {
    signal_hook::flag::register(signal_hook::consts::SIGINT, Arc::new(AtomicBool::new(false)))
        .map(|_| ())
        .map_err(|error| Error::fault(format!("cannot ignore SIGINT: {error}")))
}

/// Reads standard input line by line. The end of standard input means that the run has ended. The process then ends at
/// once, since a worker that hangs in a driver would otherwise never end.
fn input_lines() -> Receiver<String> {
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(std::result::Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
        signal_hook::low_level::exit(0);
    });
    lines
}

fn find(identity: &str, sources: &Sources) -> Result<Device> {
    let gone = || {
        Error::run("the device has disappeared: its driver no longer lists it")
            .with_help("`raycl devices` lists the available devices; finished measurements are saved")
    };
    let place = |infos: &[DeviceInfo]| Ok(infos.iter().position(|info| info.identity() == identity));
    pick_one(&Cache::of_user(), sources, LaneTest::Now, place)?.ok_or_else(gone)
}

fn parse<T: DeserializeOwned>(line: &str) -> Result<T> {
    serde_json::from_str(line)
        .map_err(|error| Error::fault(format!("a worker process received an invalid request: {error}")))
}

/// Writes a reply on a new line, since a driver may have left an unfinished line.
fn reply(reply: &Reply) -> Result<()> {
    let unwritable = |error: &dyn std::fmt::Display| {
        Error::fault(format!("a worker process could not send its reply: {error}"))
    };
    let line = serde_json::to_string(reply).map_err(|error| unwritable(&error))?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "\n{line}").and_then(|()| out.flush()).map_err(|error| unwritable(&error))
}
