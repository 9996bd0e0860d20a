//! The report of `raycl render`: as JSON, and as text.

use super::casting::Cast;
use super::timeline::Part;
use crate::device::{Device, DeviceInfo};
use crate::launch::Prepared;
use crate::memory::readable;
use crate::scene::Scene;
use crate::strategy::{Strategy, preset_of};
use crate::words::{counted, rate};
use serde::Serialize;

/// The fields of `--json`.
#[derive(Debug, Default, Serialize)]
pub struct Report {
    /// The scene's name.
    pub scene: String,
    /// Triangles in it.
    pub triangles: usize,
    /// Lights in it.
    pub lights: usize,
    /// The device's name.
    pub device: String,
    /// The threads that the device cast with, where that is known: of PoCL.
    pub threads: Option<u32>,
    /// The preset, where the strategy is one unchanged.
    pub preset: Option<&'static str>,
    /// Every axis of the strategy.
    pub strategy: String,
    /// Work-items of a work-group across and down.
    pub local_size: [u32; 2],
    /// Pixels across and down.
    pub image_size: [u32; 2],
    /// Samples of each pixel; device times are of all together.
    pub samples: u32,
    /// Reading the scene and making its triangles.
    pub load_ms: f64,
    /// Waiting, after the scene was read, for the drivers to list their devices and the device to open.
    pub discover_ms: f64,
    /// Building the tree over the triangles; 0 where the traversal has none.
    pub tree_ms: f64,
    /// Building the program, including code that a driver compiles at the first launch.
    pub build_ms: f64,
    /// Whether the program was kept since an earlier build, and nothing was compiled.
    pub build_from_cache: bool,
    /// Bringing the scene to the device.
    pub upload_ms: f64,
    /// Device time of preparing records of triangles, once per scene; 0 where tests prepare them.
    pub records_ms: f64,
    /// Device time of the primary pass, where the strategy has one.
    pub primary_ms: Option<f64>,
    /// Device time of the shadow pass, where the strategy has one; it shades too, where `shade_ms` is none.
    pub shadow_ms: Option<f64>,
    /// Device time of the shading pass, where it is apart from shadow rays.
    pub shade_ms: Option<f64>,
    /// Device time of the whole frame.
    pub frame_ms: f64,
    /// Bringing the image back.
    pub read_ms: f64,
    /// Writing the picture.
    pub save_ms: f64,
    /// Parts that follow each other, from the start of the process to this report.
    pub parts: Vec<Part>,
    /// Their sum: the whole command.
    pub total_ms: f64,
    /// Primary and shadow rays of a frame over its time.
    pub frame_rays_per_s: f64,
    /// Primary rays over the primary pass, where there is one.
    pub primary_rays_per_s: Option<f64>,
    /// Over the shadow pass, where there is one.
    pub shadow_rays_per_s: Option<f64>,
    /// Primary rays x triangles over the primary pass, or the frame where passes are fused; none where not every triangle is tested.
    pub tests_per_s: Option<f64>,
    /// Frames the times are medians of.
    pub frames: u32,
    /// The largest use of the host's memory, as predicted.
    pub host_bytes: u64,
    /// The device's buffers, as predicted; on a CPU they are part of the host's memory.
    pub device_bytes: u64,
    /// The largest use of the host's memory, as measured; none where the system does not report it.
    pub peak_bytes: Option<u64>,
    /// The result of `--verify`.
    pub verified: Option<Verified>,
    /// The picture.
    pub output: String,
    /// Parts of the scene's file that were ignored or replaced by defaults, and whether raycl was built from a tree with changes.
    pub notes: Vec<String>,
}

/// How a right picture compares with the serial reference.
#[derive(Debug, Serialize)]
pub struct Verified {
    /// The largest relative difference over the pixels that the reference is certain of.
    pub max_difference: f64,
    /// Pixels that it is not certain of.
    pub uncertain_pixels: usize,
    /// Pixels that were compared.
    pub pixels: usize,
    /// Those that the picture has.
    pub of_pixels: usize,
}

impl Verified {
    /// As a person reads it.
    pub fn text(&self) -> String {
        let sample = match self.pixels < self.of_pixels {
            true => format!("{} of {} pixels, chosen at random, ", self.pixels, self.of_pixels),
            false => String::new(),
        };
        format!(
            "verified  {sample}against the serial reference: largest difference {:.1e} relative, {} uncertain",
            self.max_difference,
            counted(self.uncertain_pixels, "pixel")
        )
    }
}

impl Report {
    /// The fields that casting knows; the command fills in the rest.
    pub fn of(scene: &Scene, device: &Device, strategy: &Strategy, prepared: &Prepared, cast: &Cast) -> Self {
        let workload = &prepared.workload;
        let [width, height] = workload.image_size;
        let triangles = scene.mesh.triangles.len();
        let pixels = f64::from(width) * f64::from(height) * f64::from(cast.samples);
        let primary_ms = cast.times.primary_ms.unwrap_or(cast.times.frame_ms);
        let shadow_rays = (cast.hits * scene.shadow_rays_per_hit()) as f64 * f64::from(cast.samples);
        let per_s = |count: f64, ms: f64| count / ms * 1e3;
        Self {
            scene: scene.name.clone(),
            triangles,
            lights: scene.lights.len(),
            device: device.info.label.clone(),
            threads: device.info.threads,
            preset: preset_of(strategy),
            strategy: strategy.to_string(),
            local_size: workload.local_size,
            image_size: workload.image_size,
            tree_ms: prepared.tree_ms(),
            build_from_cache: cast.from_cache,
            upload_ms: prepared.upload_ms(),
            records_ms: cast.records_ms,
            primary_ms: cast.times.primary_ms,
            shadow_ms: cast.times.shadow_ms,
            shade_ms: cast.times.shade_ms,
            frame_ms: cast.times.frame_ms,
            read_ms: cast.read_ms,
            samples: cast.samples,
            frame_rays_per_s: per_s(pixels + shadow_rays, cast.times.frame_ms),
            primary_rays_per_s: cast.times.primary_ms.map(|ms| per_s(pixels, ms)),
            shadow_rays_per_s: cast.times.shadow_ms.map(|ms| per_s(shadow_rays, ms)),
            tests_per_s: strategy
                .tests_every_triangle()
                .then(|| per_s(pixels * triangles as f64, primary_ms)),
            ..Self::default()
        }
    }

    /// The report as a person reads it.
    pub fn text(&self, device: &DeviceInfo) -> String {
        let ([width, height], [x, y]) = (self.image_size, self.local_size);
        let preset = self.preset.map(|name| format!("{name}: ")).unwrap_or_default();
        let mut lines = vec![
            format!(
                "scene     {}: {}, {}",
                self.scene,
                counted(self.triangles, "triangle"),
                counted(self.lights, "light")
            ),
            format!("device    {}", device.describe()),
            format!("strategy  {preset}{}", self.strategy),
            format!("size      {width} x {height} pixels, local size {x} x {y}"),
        ];
        let parts = self.parts.iter().map(|Part { part, ms }| (*part, *ms));
        let shown =
            parts.filter(|&(part, ms)| !["tree", "records", "keep", "report"].contains(&part) || ms >= 0.005);
        for (part, ms) in shown.chain([("total", self.total_ms), ("kernel", self.frame_ms)]) {
            lines.push(format!("{part:<8}{ms:11.2} ms{}", self.remark(part)));
        }
        lines.push(format!("speed     {}", self.speeds().join(", ")));
        lines.push(format!("memory    {}", self.memory()));
        lines.extend(self.verified.iter().map(Verified::text));
        lines.extend(self.notes.iter().map(|note| format!("note      {note}")));
        lines.push(format!("picture   {}", self.output));
        lines.join("\n")
    }

    /// The remark on a part.
    fn remark(&self, part: &str) -> String {
        match part {
            "kernel" => self.kernel_remark(),
            "build" if self.build_from_cache => " (from the cache)".to_owned(),
            "casting" if self.frames > 1 => format!(" ({} frames and a first one)", self.frames),
            _ => String::new(),
        }
    }

    /// The parts of the kernel's time.
    fn kernel_remark(&self) -> String {
        let parts = [("primary", self.primary_ms), ("shadow", self.shadow_ms), ("shading", self.shade_ms)]
            .into_iter();
        let parts = parts.filter_map(|(name, ms)| ms.map(|ms| format!("{name} {ms:.2}")));
        let median = (self.frames > 1).then(|| format!("median of {}", self.frames));
        let remarks: Vec<_> = parts.chain(median).collect();
        if remarks.is_empty() { String::new() } else { format!(" ({})", remarks.join(", ")) }
    }

    fn memory(&self) -> String {
        let peak =
            self.peak_bytes.map(|bytes| format!(", {} used at most", readable(bytes))).unwrap_or_default();
        let [host, device] = [self.host_bytes, self.device_bytes].map(readable);
        format!("host {host} predicted{peak}; device {device} predicted")
    }

    fn speeds(&self) -> Vec<String> {
        let frame = format!("{} of the frame", rate(self.frame_rays_per_s, "rays"));
        let primary = self.primary_rays_per_s.map(|value| format!("{} primary", rate(value, "rays")));
        let shadow = self.shadow_rays_per_s.map(|value| format!("{} shadow", rate(value, "rays")));
        let tests = self.tests_per_s.map(|value| rate(value, "tests"));
        std::iter::once(frame).chain(primary).chain(shadow).chain(tests).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_rates_read_well() {
        assert_eq!(counted(1, "triangle"), "1 triangle");
        assert_eq!(counted(0, "light"), "0 lights");
        assert_eq!(rate(12.6e9, "tests"), "12.60 Gtests/s");
        assert_eq!(rate(232_000.0, "rays"), "232.00 krays/s");
        assert_eq!(rate(0.0, "rays"), "0.00 rays/s");
    }

    #[test]
    fn the_kernels_time_says_what_it_is_made_of() {
        let fused = Report { frames: 1, ..Report::default() };
        assert_eq!(fused.kernel_remark(), "");
        let separate =
            Report { frames: 5, primary_ms: Some(1.0), shadow_ms: Some(0.25), ..Report::default() };
        assert_eq!(separate.kernel_remark(), " (primary 1.00, shadow 0.25, median of 5)");
    }
}
