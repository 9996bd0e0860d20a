//! The times of one frame, on the device's and on the host's clock.

use crate::measure::median_of;
use crate::numbers::significant;
use crate::sensor::SensorReading;
use ocl::Event;
use ocl::enums::{ProfilingInfo, ProfilingInfoResult};
use serde::{Deserialize, Serialize};

/// The pass (a part of a frame's work) to which a command of the frame belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// Finding the hits of primary rays, including all earlier commands of the frame (which prepare planes or clear
    /// buffers).
    Primary,
    /// Casting shadow rays, including shading if no separate kernel shades.
    Shadow,
    /// Shading, if it has its own kernel.
    Shade,
    /// Casting primary rays and shadow rays in one kernel, including shading if no separate kernel shades. Also the
    /// work of kernels that belong to no other pass, such as the filter of soft light at half resolution.
    Whole,
}

/// The times of one frame, in milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameTimes {
    /// Device time: the sum of the durations of the frame's commands.
    pub frame_ms: f64,
    /// Time for primary rays; `None` if the kernel that casts them also casts shadow rays.
    pub primary_ms: Option<f64>,
    /// Time for shadow rays; `None` if the kernel that casts them also casts primary rays, or if no kernel casts them.
    /// If `shade_ms` is `None`, the time for shadow rays includes shading.
    pub shadow_ms: Option<f64>,
    /// Time for shading; `None` if the kernel that shades also casts all shadow rays. Only strategies whose
    /// work-items share tiles have a time for shading. The time for shading includes leftover shadow rays if
    /// passes are fused and a frame casts one ray per pixel at a time: the shading kernel then casts these
    /// rays too.
    pub shade_ms: Option<f64>,
    /// Time for the frame on the host's clock, from enqueueing to completion.
    pub host_ms: f64,
    /// Processor time that the process used for the frame; `None` outside experiments, or if the frame was cast by a
    /// device other than a CPU.
    pub processor_ms: Option<f64>,
    /// Number of frames over which these times are averaged; `None` for a single frame.
    pub batch: Option<u32>,
    /// Readings of the device's sensors during the frame; `None` outside experiments, or if there are no readings.
    pub sensed: Option<SensorReading>,
}

/// A frame's time on the device's clock is impossible if it exceeds this multiple of the time on the host's clock.
/// [`TOLERANCE_MS`] says which differences are too small to count.
const IMPOSSIBLY_LONG: f64 = 1.5;
/// A sample's time on the device's clock is possible if it exceeds the time on the host's clock by at most this many
/// milliseconds. A device time of 0 is possible if the sample took at most this time by the host's clock.
const TOLERANCE_MS: f64 = 1.0;
/// A device time of 0 is impossible if, by the host's clock, the sample took more than this many steps of the device's
/// timer (and more than [`TOLERANCE_MS`]).
const MANY_STEPS: f64 = 1000.0;

/// Returns the duration of a finished command in milliseconds, on the device's clock.
pub(crate) fn duration_ms(event: &Event) -> ocl::Result<f64> {
    let read = |info| match event.profiling_info(info)? {
        ProfilingInfoResult::Start(ns) | ProfilingInfoResult::End(ns) => Ok::<_, ocl::Error>(ns),
        _ => Ok(0),
    };
    Ok(read(ProfilingInfo::End)?.saturating_sub(read(ProfilingInfo::Start)?) as f64 * 1e-6)
}

impl FrameTimes {
    /// Returns the times of a frame that has no separate passes.
    pub fn whole(frame_ms: f64, host_ms: f64) -> Self {
        Self { frame_ms, host_ms, ..Self::default() }
    }

    /// Returns the median of the frames' times. `time` returns one of a frame's times, or `None` if the frame lacks
    /// this time. Returns `None` if all frames lack the selected time.
    pub(crate) fn median_of(frames: &[Self], time: impl Fn(&Self) -> Option<f64>) -> Option<f64> {
        median_of(&frames.iter().filter_map(time).collect::<Vec<_>>())
    }

    /// Returns the sums of the times of two frames. If only one of the frames has a time, the sum is this
    /// time. `processor_ms`, `batch` and `sensed` are `None`.
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

    /// Returns the mean times per frame of `frames` frames, whose total times are `self`.
    #[must_use]
    pub fn per_frame(&self, frames: u32) -> Self {
        let mean = |total_ms: f64| total_ms / f64::from(frames.max(1));
        Self {
            frame_ms: mean(self.frame_ms),
            primary_ms: self.primary_ms.map(mean),
            shadow_ms: self.shadow_ms.map(mean),
            shade_ms: self.shade_ms.map(mean),
            host_ms: mean(self.host_ms),
            batch: (frames > 1).then_some(frames),
            ..Self::default()
        }
    }

    /// Returns how long the sample took by the host's clock, in milliseconds: the time of all frames of the
    /// sample's batch.
    pub fn elapsed_ms(&self) -> f64 {
        self.host_ms * f64::from(self.batch.unwrap_or(1))
    }

    /// Returns why the driver's times are impossible; `None` if these times are possible. The time on the
    /// host's clock includes the time on the device's clock, so the time on the device's clock cannot be much longer.
    /// For a long sample, the time on the device's clock cannot be 0. `timer_ns` is a step of the device's timer in
    /// nanoseconds; `None` if it is unknown.
    pub fn why_impossible(&self, timer_ns: Option<u64>) -> Option<String> {
        let (device_ms, host_ms, frames) = (self.frame_ms, self.host_ms, f64::from(self.batch.unwrap_or(1)));
        if device_ms > IMPOSSIBLY_LONG * host_ms && (device_ms - host_ms) * frames > TOLERANCE_MS {
            return Some(format!(
                "the driver's times are wrong: by the driver's profiling, a frame takes {} ms, but by the host's clock, \
                 it takes {} ms",
                significant(device_ms, 3),
                significant(host_ms, 3)
            ));
        }
        let many_ms = timer_ns.map(|step_ns| (MANY_STEPS * step_ns as f64 * 1e-6).max(TOLERANCE_MS));
        let has_no_time = device_ms <= 0.0 && many_ms.is_some_and(|many_ms| self.elapsed_ms() > many_ms);
        has_no_time.then(|| {
            format!(
                "the driver reports no times: by its profiling, a frame takes 0 ms, but by the host's clock, it takes \
                 {} ms",
                significant(host_ms, 3)
            )
        })
    }

    /// Returns the time of the shortest pass (primary rays, shadow rays or shading), or of the whole frame if
    /// the frame has no separate passes.
    pub fn shortest_ms(&self) -> f64 {
        let passes = [self.primary_ms, self.shadow_ms, self.shade_ms];
        passes.into_iter().flatten().fold(self.frame_ms, f64::min)
    }

    /// Returns the mean times per frame of the finished commands `steps`, which belong to `frames` frames.
    /// `host_ms` is the host's time for all `frames` frames together. Only the host's time includes the time
    /// between commands. Between two commands, some drivers compile a kernel that is started for the first
    /// time.
    pub fn of(steps: &[(Pass, Event)], host_ms: f64, frames: u32) -> ocl::Result<Self> {
        let frames = frames.max(1);
        let mut durations_ms = Vec::with_capacity(steps.len());
        for (pass, event) in steps {
            durations_ms.push((*pass, duration_ms(event)? / f64::from(frames)));
        }
        let of_pass = |wanted: Pass| {
            let times = durations_ms.iter().filter(|(pass, _)| *pass == wanted).map(|(_, ms)| ms);
            times.copied().reduce(|sum, ms| sum + ms)
        };
        Ok(Self {
            frame_ms: durations_ms.iter().map(|(_, ms)| ms).sum(),
            primary_ms: of_pass(Pass::Primary),
            shadow_ms: of_pass(Pass::Shadow),
            shade_ms: of_pass(Pass::Shade),
            host_ms: host_ms / f64::from(frames),
            batch: (frames > 1).then_some(frames),
            ..Self::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_times_of_two_frames_add_up_pass_by_pass() {
        let whole = FrameTimes::whole;
        let first = FrameTimes { primary_ms: Some(1.0), shadow_ms: Some(2.0), ..whole(3.0, 4.0) };
        let second = FrameTimes { primary_ms: Some(8.0), shade_ms: Some(16.0), ..whole(24.0, 32.0) };
        let both = FrameTimes {
            primary_ms: Some(9.0),
            shadow_ms: Some(2.0),
            shade_ms: Some(16.0),
            ..whole(27.0, 36.0)
        };
        assert_eq!(first.and(&second), both);
        assert_eq!(FrameTimes::default().and(&first), first);
        let mean = FrameTimes {
            primary_ms: Some(2.25),
            shadow_ms: Some(0.5),
            shade_ms: Some(4.0),
            batch: Some(4),
            ..whole(6.75, 9.0)
        };
        assert_eq!(both.per_frame(4), mean);
        assert_eq!(both.per_frame(1), both);
    }

    #[test]
    fn a_frame_cannot_take_longer_on_the_device_than_on_the_host_nor_no_time_at_all() {
        let why =
            |device_ms, host_ms, timer_ns| FrameTimes::whole(device_ms, host_ms).why_impossible(timer_ns);
        for possible in [(1.0, 1.2), (1.4, 1.0), (0.9, 0.1), (0.01, 50.0), (0.0, 0.9)] {
            assert_eq!(why(possible.0, possible.1, Some(1)), None, "{possible:?}");
        }
        // A time on the device's clock is impossible if it exceeds one and a half times the time on the host's clock,
        // and if the difference is more than a millisecond.
        assert_eq!(why(1400.0, 1000.0, None), None);
        assert!(why(1600.0, 1000.0, None).is_some());
        let long = why(1208.0, 1.25, None).expect("it is impossible");
        assert!(long.contains("a frame takes 1208 ms, but by the host's clock, it takes 1.25 ms"), "{long}");
        let none = why(0.0, 2.0, Some(1)).expect("it is impossible");
        assert!(none.starts_with("the driver reports no times: ") && none.ends_with(" 2.00 ms"), "{none}");
        // A timer with steps of 10 us may report 0 for a frame of 2 ms: most of the 2 ms may be the time for starting
        // the frame's kernels. A frame of more than 1000 steps (10 ms) cannot take 0 ms.
        assert_eq!([why(0.0, 2.0, Some(10_000)), why(0.0, 9.0, Some(10_000))], [None, None]);
        assert!(why(0.0, 11.0, Some(10_000)).is_some());
        assert_eq!(why(0.0, 2.0, None), None);
        let batch = FrameTimes { batch: Some(256), ..FrameTimes::whole(0.0, 0.05) };
        assert!(batch.why_impossible(Some(1)).is_some());
    }

    /// The differences between device time and host time of a batch's frames are added up. A difference that is
    /// possible for a single frame may therefore be impossible if each frame of a batch has this difference.
    #[test]
    fn the_differences_of_all_frames_of_a_batch_count_together() {
        let why = |batch| FrameTimes { batch, ..FrameTimes::whole(0.9, 0.1) }.why_impossible(None);
        assert_eq!(why(None), None);
        let long = why(Some(2)).expect("it is impossible");
        assert!(long.contains("a frame takes 0.900 ms, but by the host's clock"), "{long}");
    }

    #[test]
    fn a_batch_takes_as_long_as_all_its_frames() {
        let frame = FrameTimes::whole(1.0, 1.5);
        assert_eq!(frame.elapsed_ms(), 1.5);
        assert_eq!(FrameTimes { batch: Some(8), ..frame }.elapsed_ms(), 12.0);
    }
}
