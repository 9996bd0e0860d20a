//! Baselines: the serial and the parallel caster on the host, timed by its clock.

use crate::config::Baseline;
use crate::image::Radiance;
use crate::launch::FrameTimes;
use crate::reference::{cast_parallel_f32, cast_serial_f32, cast_serial_f64};
use crate::scene::Scene;
use std::time::Instant;

/// Casts one frame on the host.
pub fn cast(baseline: Baseline, scene: &Scene, size: [u32; 2]) -> (Radiance, FrameTimes) {
    let caster = match baseline {
        Baseline::Serial => cast_serial_f32,
        Baseline::SerialF64 => cast_serial_f64,
        Baseline::Parallel => cast_parallel_f32,
    };
    let start = Instant::now();
    let image = caster(scene, size);
    let frame_ms = start.elapsed().as_secs_f64() * 1e3;
    (image, FrameTimes::whole(frame_ms, frame_ms))
}
