//! Baselines: the serial and the parallel caster on the host, timed by its clock; and what decides their times.

use crate::config::Baseline;
use crate::image::Radiance;
use crate::launch::FrameTimes;
use crate::record::{HOST, Host};
use crate::reference::{cast_parallel_f32, cast_serial_f32, cast_serial_f64, fingerprint};
use crate::scene::Scene;
use std::time::Instant;

/// What a baseline's key has of the machine and the program.
pub struct Identity {
    /// The processor.
    pub device: String,
    /// Cores it may use, and threads.
    pub state: String,
    /// The text it is compiled from, and how.
    pub program: String,
}

impl Identity {
    /// The identity of this process on this machine.
    pub fn of_this_process() -> Self {
        let Host { cpu, cores, .. } = Host::read();
        Self {
            device: format!("{HOST} | {cpu}"),
            state: format!("{cores} cores | {} threads", rayon::current_num_threads()),
            program: format!("{} | {}", fingerprint(), env!("RAYCL_BUILD")),
        }
    }
}

/// What tells this kind of host from others: what keys of its casters have of it.
pub fn host_identity() -> String {
    let Identity { device, state, program } = Identity::of_this_process();
    format!("{device} | {state} | built {}", &blake3::hash(program.as_bytes()).to_hex()[..8])
}

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
