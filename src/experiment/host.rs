//! Baselines: the serial and the parallel casters on the host, timed by the host's clock. The module also
//! finds the properties of the host that affect the times of baselines.

use crate::clock::ms_since;
use crate::config::Baseline;
use crate::image::Radiance;
use crate::launch::FrameTimes;
use crate::record::{HOST, Host};
use crate::reference::{cast_parallel_f32, cast_serial_f32, cast_serial_f64, fingerprint};
use crate::scene::{Sampling, Scene};
use std::time::Instant;

/// The machine and the program, as part of a baseline's key.
pub struct Identity {
    /// The word `host` and the model of the processor, with a separator.
    pub device: String,
    /// The number of cores that raycl may use, and the number of threads of the parallel caster.
    pub state: String,
    /// The hash of the baselines' source, and the Rust compiler with its options.
    pub program: String,
}

impl Identity {
    /// Returns the identity of this process on this machine.
    pub fn of_this_process() -> Self {
        let Host { cpu, cores, .. } = Host::read();
        Self {
            device: format!("{HOST} | {cpu}"),
            state: format!("{cores} cores | {} threads", rayon::current_num_threads()),
            program: format!("{} | {}", fingerprint(), env!("RAYCL_BUILD")),
        }
    }
}

/// Returns a text with the host's properties that are in the keys of baselines: the processor's model, the
/// numbers of cores and threads, and a hash of the program. `raycl merge` shows the text beside serial casters too,
/// which have a single thread, so the text says whose threads are counted.
pub fn host_identity() -> String {
    let Identity { device, state, program } = Identity::of_this_process();
    let hash = blake3::hash(program.as_bytes()).to_hex();
    // The number of threads is the last part of `state`.
    format!("{device} | {state} of the parallel caster | built {}", &hash[..8])
}

/// Returns why a baseline cannot cast a scene with this number of samples per pixel; `None` if the baseline
/// can cast the scene.
pub fn refusal(baseline: Baseline, sampling: &Sampling) -> Option<String> {
    let (name, samples) = (baseline.strategy(), sampling.most);
    (samples > 1)
        .then(|| format!("{name} casts only one sample per pixel, but the scene has samples = {samples}"))
}

/// Casts one frame on the host, with one sample per pixel. Returns the picture and the frame's times.
pub fn cast(baseline: Baseline, scene: &Scene, size: [u32; 2]) -> (Radiance, FrameTimes) {
    let caster = match baseline {
        Baseline::Serial => cast_serial_f32,
        Baseline::SerialF64 => cast_serial_f64,
        Baseline::Parallel => cast_parallel_f32,
    };
    let start = Instant::now();
    let image = caster(scene, size);
    let frame_ms = ms_since(start);
    (image, FrameTimes::whole(frame_ms, frame_ms))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::fixtures;

    #[test]
    fn only_the_baseline_in_double_precision_casts_another_picture() {
        let (scene, size) = (fixtures::figure_4(), [80, 50]);
        let picture = |baseline| cast(baseline, &scene, size).0;
        assert_eq!(picture(Baseline::SerialF64), cast_serial_f64(&scene, size));
        assert_ne!(picture(Baseline::SerialF64), picture(Baseline::Serial));
        assert_eq!(picture(Baseline::Parallel), picture(Baseline::Serial));
    }

    #[test]
    fn another_source_of_the_baselines_is_another_program() {
        let program = Identity::of_this_process().program;
        assert!(program.starts_with(&format!("{} | ", fingerprint())), "{program}");
    }

    #[test]
    fn another_number_of_threads_is_another_state_of_the_host() {
        let state = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Identity::of_this_process().state)
        };
        assert!(state(2).ends_with(" cores | 2 threads"), "{}", state(2));
        assert_ne!(state(2), state(3));
    }

    #[test]
    fn the_hosts_identity_says_whose_threads_are_counted() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let identity = pool.install(host_identity);
        assert!(identity.contains(" cores | 2 threads of the parallel caster | built "), "{identity}");
    }
}
