//! What a point's frames amount to.

use crate::launch::FrameTimes;
use crate::measure::{StopReason, Summary};
use crate::record::{Outcome, Record};

/// Writes what a point's frames amount to into its record.
pub fn complete(record: &mut Record, frames: &[FrameTimes], reason: StopReason) {
    let median = |time: &dyn Fn(&FrameTimes) -> Option<f64>| {
        let times: Vec<f64> = frames.iter().filter_map(time).collect();
        Summary::of(&times).map(|summary| summary.median_ms)
    };
    record.outcome = Outcome::Measured;
    record.stop_reason = Some(reason.name().to_owned());
    record.samples_ms = frames.iter().map(|frame| frame.frame_ms).collect();
    if let Some(summary) = Summary::of(&record.samples_ms) {
        record.median_ms = Some(summary.median_ms);
        record.q1_ms = Some(summary.q1_ms);
        record.q3_ms = Some(summary.q3_ms);
        record.ci95_ms = Some(summary.ci95_ms);
    }
    record.host_median_ms = median(&|frame| Some(frame.host_ms));
    record.primary_ms = median(&|frame| frame.primary_ms);
    record.shadow_ms = median(&|frame| frame.shadow_ms);
    rates(record);
}

/// Rays and tests a second. Where a strategy does not separate primary rays, the whole frame's time counts.
fn rates(record: &mut Record) {
    let pixels = f64::from(record.image_size[0]) * f64::from(record.image_size[1]);
    let Some(primary_ms) = record.primary_ms.or(record.median_ms).filter(|ms| *ms > 0.0) else { return };
    record.rays_per_s = Some(pixels / primary_ms * 1e3);
    if record.tests_every_triangle() {
        record.tests_per_s = record.triangles.map(|triangles| pixels * triangles as f64 / primary_ms * 1e3);
    }
    if let (Some(rays), Some(ms)) = (record.shadow_rays, record.shadow_ms.filter(|ms| *ms > 0.0)) {
        record.shadow_rays_per_s = Some(rays as f64 / ms * 1e3);
    }
}
