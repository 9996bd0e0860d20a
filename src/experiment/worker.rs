//! A worker: a process that builds programs, checks points and times points, on one device or on the host. If a driver
//! aborts, crashes or hangs, this process ends, but the run continues. Requests arrive on standard input, replies go to
//! standard output.

use super::asleep::Asleep;
use super::check::Checker;
use super::draft::Drafter;
use super::point_failure::PointFailure;
use super::protocol::{Job, Phase, Reply, Request};
use super::request_handler::RequestHandler;
use super::{Pictures, Plan};
use crate::cache::Cache;
use crate::config;
use crate::device::{Device, DeviceInfo, Hardware, LaneTest, forget_failures, pick_one, tell_panics};
use crate::error::{Error, Result};
use crate::program::Sources;
use crate::record::Outcome;
use serde::de::DeserializeOwned;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::io::BufRead as _;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, channel};

/// Runs a worker: reads its job from standard input, and serves requests until standard input ends. If the job cannot
/// be done, for example because its device is not found, replies with the error.
pub fn serve() -> Result<()> {
    ignore_interrupts()?;
    tell_panics(refuse);
    let lines = input_lines()?;
    let Ok(line) = lines.recv() else { return Ok(()) };
    let job: Job = parse(&line)?;
    match work(&job, &lines) {
        Ok(()) => Ok(()),
        Err(error) => reply(&Reply::of_error(&error)),
    }
}

/// Opens the device that the job (the worker's task) names, and serves requests.
fn work(job: &Job, lines: &Receiver<String>) -> Result<()> {
    let sources = Sources::of(job.cl_dir.clone())?;
    let mut experiment = config::parse(&job.config, job.text.clone(), &job.overrides)?;
    experiment.leave_out(job.left_out.clone());
    let drafter = Drafter { experiment: &experiment, sources: &sources };
    let plan = Plan::new(&experiment, job.device_count);
    if let Some(frame_ms) = job.asleep_ms {
        let mut asleep = Asleep::new(drafter, plan, frame_ms);
        return answer(job, lines, |request| asleep.answer(request));
    }
    let device = job.device.as_deref().map(|identity| find(identity, &job.hardware, &sources)).transpose()?;
    let checker = Checker::open(drafter, device.as_ref(), Pictures::of(&job.folder))?.telling(tell);
    let mut handler = RequestHandler::new(drafter, plan, checker, job.stands_for.clone());
    answer(job, lines, |request| handler.answer(request))
}

/// Sends the first reply, and then serves requests until the run sends no more.
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
        forget_failures();
        reply(&answer(&request).unwrap_or_else(|error| Reply::of_error(&error)))?;
    }
    Ok(())
}

/// Ignores SIGINT and SIGTERM. Ctrl-C in a terminal reaches every process of the run. SIGTERM reaches every
/// process too if a program, such as a cluster's scheduler, sends it to the whole process group. The run
/// decides when its workers end, and ends them by closing their standard input.
fn ignore_interrupts() -> Result<()> {
    for (signal, name) in [(SIGINT, "SIGINT"), (SIGTERM, "SIGTERM")] {
        signal_hook::flag::register(signal, Arc::new(AtomicBool::new(false)))
            .map_err(|error| Error::fault(format!("cannot ignore {name}: {error}")))?;
    }
    Ok(())
}

/// Reads standard input line by line. At the end of standard input, the run has ended or no longer needs this
/// worker, so the process ends at once, even while a driver hangs.
fn input_lines() -> Result<Receiver<String>> {
    let (sender, lines) = channel();
    let read = move || {
        for line in std::io::stdin().lock().lines().map_while(std::result::Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
        signal_hook::low_level::exit(0);
    };
    std::thread::Builder::new().spawn(read).map_err(|error| Error::no_thread(&error))?;
    Ok(lines)
}

/// Opens the device with which the run began. This is the device whose identity is `identity`, and whose
/// UUID and PCI address do not contradict `hardware`. Returns an error if this device is not listed any
/// more.
fn find(identity: &str, hardware: &Hardware, sources: &Sources) -> Result<Device> {
    let choose = |infos: &[DeviceInfo]| Ok(index_of(identity, hardware, infos));
    pick_one(&Cache::of_user(), sources, LaneTest::Now, choose)?.ok_or_else(|| gone(identity))
}

/// Returns the error if the device with which the run began is not listed any more.
fn gone(identity: &str) -> Error {
    let error = Error::run(format!("the run's device is not listed any more (identity: `{identity}`)"));
    error.with_help(
        "the device is missing, another device has taken its place (with another UUID or PCI address), or \
         its driver was updated, which changes the identity; `raycl devices` lists the available devices; \
         finished measurements are saved",
    )
}

fn index_of(identity: &str, hardware: &Hardware, infos: &[DeviceInfo]) -> Option<usize> {
    let fits = |info: &DeviceInfo| info.identity() == identity && may_be(&info.hardware, hardware);
    infos.iter().position(fits)
}

/// Returns true if two descriptions may belong to the same device: neither the UUIDs nor the PCI addresses differ. If a
/// UUID or a PCI address is unknown, it is ignored in the comparison.
fn may_be(one: &Hardware, other: &Hardware) -> bool {
    let agree =
        |one: &Option<String>, other: &Option<String>| one.is_none() || other.is_none() || one == other;
    agree(&one.uuid, &other.uuid) && agree(&one.pci_bus, &other.pci_bus)
}

fn parse<T: DeserializeOwned>(line: &str) -> Result<T> {
    serde_json::from_str(line)
        .map_err(|error| Error::fault(format!("a worker process received an invalid request: {error}")))
}

/// Sends a reply to the process that started this worker.
fn reply(reply: &Reply) -> Result<()> {
    send(reply, &mut std::io::stdout().lock())
}

/// Tells the run that another phase of the work on the current request begins.
fn tell(phase: Phase) {
    // An error of sending is ignored here. Sending the reply to the request will fail too, and will report
    // the error.
    let _ = reply(&Reply::Begins(phase));
}

/// Replies to the current request that the device failed. The crate `ocl` has panicked, and this process will
/// end.
fn refuse(reason: &str) {
    // An error of sending is ignored: if no process reads the reply, no process needs the reply.
    let _ = reply(&Reply::Refused(PointFailure::new(Outcome::LaunchFailed, reason)));
}

/// Writes a reply on a new line, since a driver may have left an unfinished line. Writing fails if the process that
/// reads the replies was killed, which is no bug.
fn send(reply: &Reply, out: &mut impl std::io::Write) -> Result<()> {
    let line = serde_json::to_string(reply)
        .map_err(|error| Error::fault(format!("a worker process could not make its reply: {error}")))?;
    writeln!(out, "\n{line}").and_then(|()| out.flush()).map_err(|error| {
        Error::run(format!("a worker process could not send its reply: {error}"))
            .with_help("the process that started the worker has probably ended; start it again with --resume")
    })
}

#[cfg(test)]
mod tests {
    use super::super::asleep;
    use super::*;

    #[test]
    fn a_reply_that_nobody_reads_is_no_bug() {
        let mut without_room: &mut [u8] = &mut [];
        let error = send(&Reply::Started, &mut without_room).unwrap_err();
        assert!(error.to_string().starts_with("a worker process could not send its reply: "), "{error}");
        assert!(!error.remedy().contains("bug") && error.exit_code() == 1, "{}", error.remedy());
    }

    #[test]
    fn the_error_for_a_device_that_is_gone_states_its_identity_and_the_possible_causes() {
        let error = gone("PoCL | 3.0 | cpu | 6.0");
        assert!(error.to_string().contains("`PoCL | 3.0 | cpu | 6.0`"), "{error}");
        for cause in ["missing", "another UUID", "driver was updated"] {
            assert!(error.remedy().contains(cause), "{}", error.remedy());
        }
    }

    #[test]
    fn if_one_of_several_equal_devices_disappears_no_other_one_is_used_in_its_place() {
        let device = |twins_before, uuid: Option<&str>, pci_bus: Option<&str>| DeviceInfo {
            twins_before,
            hardware: Hardware {
                uuid: uuid.map(str::to_owned),
                pci_bus: pci_bus.map(str::to_owned),
                ..Hardware::default()
            },
            ..asleep::device(1.0)
        };
        let index =
            |wanted: &DeviceInfo, infos: &[DeviceInfo]| index_of(&wanted.identity(), &wanted.hardware, infos);
        let both = [device(0, Some("a"), Some("1")), device(1, Some("b"), Some("2"))];
        assert_eq!([index(&both[0], &both), index(&both[1], &both)], [Some(0), Some(1)]);
        // In this loop, only the second device is left, so it has the identity that the first device had in
        // `both`.
        for left in [device(0, Some("b"), None), device(0, None, Some("2"))] {
            assert_eq!(index(&both[0], &[left]), None);
        }
        for unknown in [device(0, None, None), device(0, Some("a"), None)] {
            assert_eq!(index(&both[0], &[unknown]), Some(0));
        }
        // When the run began, the driver reported neither a UUID nor a PCI address.
        assert_eq!(index(&device(0, None, None), &both), Some(0));
    }
}
