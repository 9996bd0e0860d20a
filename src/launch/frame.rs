//! The device times of one frame.

use ocl::Event;
use ocl::enums::{ProfilingInfo, ProfilingInfoResult};
use serde::{Deserialize, Serialize};

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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameTimes {
    /// Device time: the sum over its commands of their end less their start.
    pub frame_ms: f64,
    /// The primary part, where the strategy separates it.
    pub primary_ms: Option<f64>,
    /// The shadow part, where the strategy separates it.
    pub shadow_ms: Option<f64>,
    /// The same frame by the host's clock, from enqueueing to completion.
    pub host_ms: f64,
}

/// How long a finished command ran, in milliseconds of the device's clock.
fn duration_ms(event: &Event) -> ocl::Result<f64> {
    let read = |info| match event.profiling_info(info)? {
        ProfilingInfoResult::Start(ns) | ProfilingInfoResult::End(ns) => Ok::<_, ocl::Error>(ns),
        _ => Ok(0),
    };
    Ok(read(ProfilingInfo::End)?.saturating_sub(read(ProfilingInfo::Start)?) as f64 * 1e-6)
}

impl FrameTimes {
    /// Sums the times of a frame's finished commands. What lies between commands, where some drivers
    /// compile a kernel that they launch for the first time, is in `host_ms` only.
    pub fn of(steps: &[(Phase, Event)], host_ms: f64) -> ocl::Result<Self> {
        let mut durations_ms = Vec::with_capacity(steps.len());
        for (phase, event) in steps {
            durations_ms.push((*phase, duration_ms(event)?));
        }
        let of_phase = |wanted: Phase| {
            let times = durations_ms.iter().filter(|(phase, _)| *phase == wanted).map(|(_, ms)| ms);
            times.copied().reduce(|sum, ms| sum + ms)
        };
        Ok(Self {
            frame_ms: durations_ms.iter().map(|(_, ms)| ms).sum(),
            primary_ms: of_phase(Phase::Primary),
            shadow_ms: of_phase(Phase::Shadow),
            host_ms,
        })
    }
}
