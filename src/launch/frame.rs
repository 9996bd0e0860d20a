//! The device times of one frame.

use crate::sensor::SensorReading;
use ocl::Event;
use ocl::enums::{ProfilingInfo, ProfilingInfoResult};
use serde::{Deserialize, Serialize};

/// What a step of a frame is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Finding what primary rays hit, with its preparation.
    Primary,
    /// Shadow rays, with shading where that is not apart.
    Shadow,
    /// Shading, where it has a kernel of its own.
    Shade,
    /// Both in one kernel.
    Whole,
}

/// The times of one frame, in milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameTimes {
    /// Device time: the sum over its commands of their end less their start.
    pub frame_ms: f64,
    /// The primary part, where the strategy separates it.
    pub primary_ms: Option<f64>,
    /// The shadow part, where the strategy separates it.
    pub shadow_ms: Option<f64>,
    /// Shading, where it is apart from shadow rays; beside it, where tiles are shared and passes fused, shadow rays that were
    /// left over are cast.
    pub shade_ms: Option<f64>,
    /// The same frame by the host's clock, from enqueueing to completion.
    pub host_ms: f64,
    /// Frames of the batch that these times are the mean of; none for one frame alone.
    pub batch: Option<u32>,
    /// What the device's sensors showed meanwhile.
    pub sensed: Option<SensorReading>,
}

/// How long a finished command ran, in milliseconds of the device's clock.
pub(crate) fn duration_ms(event: &Event) -> ocl::Result<f64> {
    let read = |info| match event.profiling_info(info)? {
        ProfilingInfoResult::Start(ns) | ProfilingInfoResult::End(ns) => Ok::<_, ocl::Error>(ns),
        _ => Ok(0),
    };
    Ok(read(ProfilingInfo::End)?.saturating_sub(read(ProfilingInfo::Start)?) as f64 * 1e-6)
}

impl FrameTimes {
    /// The times of a frame that is not made of passes.
    pub fn whole(frame_ms: f64, host_ms: f64) -> Self {
        Self { frame_ms, host_ms, ..Self::default() }
    }

    /// The times of two frames together.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        let both = |a: Option<f64>, b: Option<f64>| a.map(|a| a + b.unwrap_or(0.0)).or(b);
        Self {
            frame_ms: self.frame_ms + other.frame_ms,
            primary_ms: both(self.primary_ms, other.primary_ms),
            shadow_ms: both(self.shadow_ms, other.shadow_ms),
            shade_ms: both(self.shade_ms, other.shade_ms),
            host_ms: self.host_ms + other.host_ms,
            ..Self::default()
        }
    }

    /// Milliseconds of the host's clock that the sample took, all frames of its batch together.
    pub fn elapsed_ms(&self) -> f64 {
        self.host_ms * f64::from(self.batch.unwrap_or(1))
    }

    /// Its shortest part: a pass where there are passes.
    pub fn shortest_ms(&self) -> f64 {
        let passes = [self.primary_ms, self.shadow_ms, self.shade_ms];
        passes.into_iter().flatten().fold(self.frame_ms, f64::min)
    }

    /// Sums the times of finished commands and divides by the `frames` that they are of. What lies between commands,
    /// where some drivers compile a kernel that they launch for the first time, is in `host_ms` only.
    pub fn of(steps: &[(Phase, Event)], host_ms: f64, frames: u32) -> ocl::Result<Self> {
        let frames = frames.max(1);
        let mut durations_ms = Vec::with_capacity(steps.len());
        for (phase, event) in steps {
            durations_ms.push((*phase, duration_ms(event)? / f64::from(frames)));
        }
        let of_phase = |wanted: Phase| {
            let times = durations_ms.iter().filter(|(phase, _)| *phase == wanted).map(|(_, ms)| ms);
            times.copied().reduce(|sum, ms| sum + ms)
        };
        Ok(Self {
            frame_ms: durations_ms.iter().map(|(_, ms)| ms).sum(),
            primary_ms: of_phase(Phase::Primary),
            shadow_ms: of_phase(Phase::Shadow),
            shade_ms: of_phase(Phase::Shade),
            host_ms: host_ms / f64::from(frames),
            batch: (frames > 1).then_some(frames),
            sensed: None,
        })
    }
}
