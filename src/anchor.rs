//! The usual anchor is a kernel that never changes: the user's kernel files (`--cl-dir`) do not replace it. (Without
//! the times of this kernel, baselines or other points serve as the anchor.) A run with several launches times this
//! kernel on each device. In each launch, raycl runs the kernel after the device's first sample, and then after every
//! six further samples. If a round (one sample of each point) has fewer than six samples on the device, raycl runs the
//! kernel once per round instead of after every six samples. Two runs can be compared by the ratios of their times to
//! the anchor's time, even if the machine's speed changed between the runs.

use crate::clock::ms_since;
use crate::device::DeviceInfo;
use crate::error::{Error, Result};
use crate::launch::{FrameTimes, LaunchError, Queue, duration_ms};
use crate::program::Sources;
use ocl::prm::Float4;
use ocl::{Buffer, Event, Kernel, MemFlags, Program};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::time::Instant;

/// The source file of the anchor's kernel.
const FILE: &str = "anchor/spheres.cl";
/// Number of spheres that each ray is tested against.
const SPHERES: usize = 1024;
/// Number of rays that the anchor casts per compute unit of the device. Casting all rays takes a few milliseconds on a
/// CPU and about 0.2 ms on a large GPU.
const RAYS_PER_UNIT: usize = 4096;
/// Number of rays whose hit distances are computed on the host, too, and compared with those that the kernel
/// found.
const CHECKED: usize = 4096;
/// Largest number of compared rays for which the kernel's distance may differ from the host's. Host and
/// device round differently, and rounding may decide whether a ray that grazes a sphere hits it.
const MOST_GRAZING: usize = CHECKED / 100;
/// The distance that the kernel writes for a miss (MISS in the kernel).
const MISS: f32 = 1e30;

/// Returns the anchor's name in `anchors.jsonl`: a hash of the kernel's source, the compiler options, the
/// number of rays, and the device with its settings. Two anchors have equal names if the same device does the
/// same work with the same settings.
pub fn name(device: &DeviceInfo) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    let rays = rays(device.limits.compute_units);
    let options = options(device.limits.usual_group());
    for part in [text()?, options, rays.to_string(), device.identity(), device.state()] {
        hasher.update(part.as_bytes());
        hasher.update(&[0]);
    }
    Ok(hasher.finalize().to_hex()[..32].to_owned())
}

/// The anchor, built for one device.
pub struct Anchor {
    queue: Queue,
    kernel: Kernel,
    // The kernel reads these buffers, so the buffers must live as long as the kernel does.
    _spheres: Buffer<Float4>,
    _distances: Buffer<f32>,
}

impl Anchor {
    /// Builds the kernel, runs it once, and compares the distances that the kernel found with distances computed on the
    /// host. Fails if too many distances differ.
    pub fn build(queue: &Queue, compute_units: u32) -> Result<Self> {
        Self::of_text(queue, compute_units, &text()?)
    }

    fn of_text(queue: &Queue, compute_units: u32, text: &str) -> Result<Self> {
        let program = Program::builder()
            .src(text)
            .cmplr_opt(options(queue.group))
            .devices(queue.device)
            .build(&queue.context)
            .map_err(failed)?;
        let rays = rays(compute_units);
        let spheres = spheres();
        let on_device: Vec<Float4> =
            spheres.iter().map(|[x, y, z, squared]| Float4::new(*x, *y, *z, *squared)).collect();
        let buffer = |len| Buffer::<f32>::builder().queue(queue.commands.clone()).len(len).build();
        let distances = buffer(rays).map_err(failed)?;
        let uploaded = Buffer::builder()
            .queue(queue.commands.clone())
            .flags(MemFlags::READ_ONLY)
            .len(on_device.len())
            .copy_host_slice(&on_device)
            .build()
            .map_err(failed)?;
        let kernel = Kernel::builder()
            .program(&program)
            .name("cast_at_spheres")
            .queue(queue.commands.clone())
            .global_work_size(rays)
            .local_work_size(queue.group)
            .arg(&uploaded)
            .arg(&distances)
            .build()
            .map_err(failed)?;
        let anchor = Self { queue: queue.clone(), kernel, _spheres: uploaded, _distances: distances };
        anchor.run()?;
        let mut distances = vec![0.0; CHECKED.min(rays)];
        anchor._distances.read(&mut distances).enq().map_err(failed)?;
        check(&distances, &spheres)?;
        Ok(anchor)
    }

    /// Runs the kernel once, waits until it has ended, and returns its times.
    pub fn run(&self) -> Result<FrameTimes> {
        let start = Instant::now();
        let mut event = Event::empty();
        // SAFETY: the kernel reads `SPHERES` elements of the first buffer, and writes one element of the
        // second buffer per work-item. The buffers have at least these numbers of elements, and live as long
        // as `self`.
        unsafe { self.kernel.cmd().queue(&self.queue.commands).enew(&mut event).enq() }.map_err(failed)?;
        self.queue.commands.finish().map_err(failed)?;
        let host_ms = ms_since(start);
        Ok(FrameTimes::whole(duration_ms(&event).map_err(failed)?, host_ms))
    }
}

fn failed(error: impl Into<LaunchError>) -> Error {
    failed_because(&error.into().to_string())
}

/// Returns the error which says that the anchor failed, and states `reason`.
pub fn failed_because(reason: &str) -> Error {
    Error::run(format!("the anchor, a kernel that is timed with the points, failed: {reason}")).with_help(
        "the points' times are correct without the anchor; instead of the anchor's time, `raycl compare` uses the times of baselines or, if there are none, those of other points",
    )
}

fn text() -> Result<String> {
    Sources::Embedded.read(FILE)
}

/// Returns the compiler options for the anchor's kernel; `group` is the number of work-items in a work-group,
/// a power of two that divides the number of rays.
fn options(group: usize) -> String {
    format!("-D SPHERES={SPHERES} -D GROUP={group} -cl-std=CL1.2")
}

fn rays(compute_units: u32) -> usize {
    compute_units.max(1) as usize * RAYS_PER_UNIT
}

/// Returns centres and squared radii of spheres scattered in front of the eye. The spheres are the same in every run.
fn spheres() -> Vec<[f32; 4]> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut sphere = || {
        let depth: f32 = rng.random_range(4.0..40.0);
        let [x, y] = [(); 2].map(|()| depth * rng.random_range(-1.0_f32..1.0));
        let radius: f32 = depth * rng.random_range(0.01..0.06);
        [x, y, depth, radius * radius]
    };
    (0..SPHERES).map(|_| sphere()).collect()
}

/// Compares the distances that the kernel found for the first rays with distances computed on the host.
/// Returns an error if the distances of the kernel and of the host differ for more than `MOST_GRAZING` rays.
fn check(distances: &[f32], spheres: &[[f32; 4]]) -> Result<()> {
    let agrees = |(ray, distance): (usize, &f32)| {
        let expected = nearest(ray, spheres);
        (distance - expected).abs() <= 1e-3 * expected
    };
    let wrong = distances.iter().enumerate().filter(|ray| !agrees(*ray)).count();
    match wrong <= MOST_GRAZING {
        true => Ok(()),
        false => Err(failed_because(&format!(
            "{wrong} of {} rays found a different distance on the device than on the host",
            distances.len()
        ))),
    }
}

/// Returns the distance that the kernel should find for one ray: the distance of the nearest sphere or, if
/// the ray misses all spheres, [`MISS`].
fn nearest(ray: usize, spheres: &[[f32; 4]]) -> f32 {
    let at = |index: usize| (index % 64) as f32 / 32.0 - 1.0;
    let direction = [at(ray), at(ray / 64), 1.0];
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let length_squared = dot(direction, direction);
    let mut nearest = MISS;
    for [x, y, z, radius_squared] in spheres {
        let centre = [*x, *y, *z];
        let along = dot(direction, centre);
        let discriminant = along * along - length_squared * (dot(centre, centre) - radius_squared);
        let distance = (along - discriminant.sqrt()) / length_squared;
        // On a miss the distance is NaN, and NaN > 0.0 is false.
        if distance > 0.0 && distance < nearest {
            nearest = distance;
        }
    }
    nearest
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::device::{DeviceKind, DeviceLimits, discover, tests::example};

    fn queue() -> (Queue, u32) {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let units = device.info.limits.compute_units;
        (Queue::open(&device).unwrap(), units)
    }

    #[test]
    fn rays_hit_spheres_and_miss_them_as_on_the_host() {
        let (queue, units) = queue();
        let times = Anchor::build(&queue, units).unwrap().run().unwrap();
        assert!(times.frame_ms > 0.0 && times.host_ms > 0.0);
        let spheres = spheres();
        let hits = (0..CHECKED).filter(|ray| nearest(*ray, &spheres) < MISS).count();
        assert!((CHECKED / 2..CHECKED).contains(&hits), "{hits} of {CHECKED}");
    }

    #[test]
    fn the_anchor_runs_on_a_device_with_small_work_groups_under_another_name() {
        let (queue, units) = queue();
        assert!(Anchor::build(&queue.in_groups_of(8), units).is_ok());
        let device = example("PoCL", "a CPU", DeviceKind::Cpu, 4);
        let limits = DeviceLimits { work_group_size: 8, ..device.limits };
        assert_ne!(name(&device).unwrap(), name(&DeviceInfo { limits, ..device }).unwrap());
    }

    #[test]
    fn a_kernel_that_casts_otherwise_is_no_anchor() {
        let (queue, units) = queue();
        for (right, wrong) in [
            ("distance < nearest", "distance > nearest"),
            ("along - sqrt", "along + sqrt"),
            ("- sphere.w", ""),
        ] {
            let text = text().unwrap();
            assert!(text.contains(right));
            let broken = Anchor::of_text(&queue, units, &text.replace(right, wrong));
            let said = broken.err().expect("it is wrong").to_string();
            assert!(said.contains("found a different distance"), "{said}");
        }
    }

    #[test]
    fn a_device_with_other_cores_threads_or_settings_has_another_anchor() {
        let device = example("PoCL", "a CPU", DeviceKind::Cpu, 4);
        let others = [
            DeviceInfo { cores: Some(2), ..device.clone() },
            DeviceInfo { threads: Some(2), ..device.clone() },
            DeviceInfo { settings: vec!["POCL_AFFINITY=1".into()], ..device.clone() },
            DeviceInfo { driver: "3.2".into(), ..device.clone() },
        ];
        let own = name(&device).unwrap();
        others.iter().for_each(|other| assert_ne!(name(other).unwrap(), own, "{}", other.state()));
    }
}
