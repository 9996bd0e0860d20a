//! The device times of one frame.

use ocl::Event;
use ocl::enums::{ProfilingInfo, ProfilingInfoResult};

/// What a step of a frame is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Finding what primary rays hit, with its preparation.
    Primary,
    /// Shading and shadow rays.
    Shadow,
    /// Both in one kernel.
    Whole,
}

/// The times of one frame, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTimes {
    /// Device time from the first command's start to the last one's end.
    pub frame_ms: f64,
    /// The primary part, where the strategy separates it.
    pub primary_ms: Option<f64>,
    /// The shadow part, where the strategy separates it.
    pub shadow_ms: Option<f64>,
    /// The same frame by the host's clock, from enqueueing to completion.
    pub host_ms: f64,
}

/// Start and end of a finished command, in nanoseconds of the device's clock.
fn interval_ns(event: &Event) -> ocl::Result<(u64, u64)> {
    let read = |info| match event.profiling_info(info)? {
        ProfilingInfoResult::Start(ns) | ProfilingInfoResult::End(ns) => Ok::<_, ocl::Error>(ns),
        _ => Ok(0),
    };
    Ok((read(ProfilingInfo::Start)?, read(ProfilingInfo::End)?))
}

impl FrameTimes {
    /// Reads the timestamps of a frame's finished commands, in their order.
    pub fn of(steps: &[(Phase, Event)], host_ms: f64) -> ocl::Result<Self> {
        let mut intervals = Vec::with_capacity(steps.len());
        for (phase, event) in steps {
            intervals.push((*phase, interval_ns(event)?));
        }
        let span_ms = |wanted: &dyn Fn(Phase) -> bool| {
            let of_phase =
                || intervals.iter().filter(|(phase, _)| wanted(*phase)).map(|(_, interval)| interval);
            let start = of_phase().map(|(start, _)| *start).min()?;
            let end = of_phase().map(|(_, end)| *end).max()?;
            Some(end.saturating_sub(start) as f64 * 1e-6)
        };
        Ok(Self {
            frame_ms: span_ms(&|_| true).unwrap_or(0.0),
            primary_ms: span_ms(&|phase| phase == Phase::Primary),
            shadow_ms: span_ms(&|phase| phase == Phase::Shadow),
            host_ms,
        })
    }
}
