//! The report that `raycl render` prints at its end, as JSON or as text.

use super::casting::Cast;
use super::timeline::{Part, Timeline};
use crate::device::{Device, DeviceInfo};
use crate::launch::{FrameTimes, Prepared};
use crate::memory::readable;
use crate::scene::Scene;
use crate::strategy::{Strategy, preset_of};
use crate::verify::hardly_verified;
use crate::words::{counted, rate};
use serde::Serialize;

/// The report of `raycl render`. With `--json`, raycl prints an object with these fields.
#[derive(Debug, Default, Serialize)]
pub struct Report {
    /// The scene's name.
    pub scene: String,
    /// Number of triangles in the scene.
    pub triangles: usize,
    /// Number of lights in the scene.
    pub lights: usize,
    /// The device's name.
    pub device: String,
    /// Number of threads with which the device cast, if known (PoCL reports this number).
    pub threads: Option<u32>,
    /// The preset that equals the strategy; null if there is none.
    pub preset: Option<&'static str>,
    /// The value of every axis of the strategy.
    pub strategy: String,
    /// Work-items per work-group, across and down.
    pub local_size: [u32; 2],
    /// Pixels of the picture, across and down.
    pub image_size: [u32; 2],
    /// The largest number of samples per pixel; device times include all samples.
    pub samples: u32,
    /// The mean number of samples per pixel, which is smaller than `samples` if some pixels get fewer samples than
    /// others.
    pub mean_samples: f64,
    /// Number of samples of soft light per pixel of the half picture with shadows; 0 if soft light is not cast at
    /// half resolution.
    pub half_light_samples: u32,
    /// Time for reading the scene and making its triangles.
    pub load_ms: f64,
    /// Time from the end of reading the scene until the drivers have listed their devices and the device is open.
    pub discover_ms: f64,
    /// Time for building the tree over the triangles; 0 without a tree.
    pub tree_ms: f64,
    /// Time for building the program or reading it from the cache, without the time in which the scene was still
    /// being loaded. Some drivers compile a kernel only when it first starts; this time is included.
    pub build_ms: f64,
    /// True if the program came from the cache and nothing was compiled.
    pub build_from_cache: bool,
    /// Time for uploading the scene.
    pub upload_ms: f64,
    /// Device time for preparing records of triangles (data for the ray-triangle test), once per scene; 0 if the
    /// strategy uses no such records.
    pub records_ms: f64,
    /// Device time of the primary pass, if there is one.
    pub primary_ms: Option<f64>,
    /// Device time of the shadow pass, if there is one; it includes shading if `shade_ms` is null.
    pub shadow_ms: Option<f64>,
    /// Device time of the shading pass; null if the kernel that shades also casts all shadow rays.
    pub shade_ms: Option<f64>,
    /// Device time of the whole frame.
    pub frame_ms: f64,
    /// Time for reading the image back.
    pub read_ms: f64,
    /// Time for encoding and writing the picture and, with `--layers`, for computing and writing the layers.
    pub save_ms: f64,
    /// The parts of the command's work with their durations, one after the other, from the start of the
    /// process to this report.
    pub parts: Vec<Part>,
    /// The time of the whole command: the sum of the durations in `parts`.
    pub total_ms: f64,
    /// The number of primary and shadow rays of a frame, divided by the frame's device time in seconds.
    pub frame_rays_per_s: f64,
    /// The number of primary rays, divided by the time of the primary pass in seconds; null if there is no primary
    /// pass.
    pub primary_rays_per_s: Option<f64>,
    /// The number of shadow rays, divided by the time of the shadow pass in seconds; null if there is no shadow pass.
    pub shadow_rays_per_s: Option<f64>,
    /// The number of primary rays, multiplied by the number of triangles and divided by the time in seconds of the
    /// primary pass, or of the frame if passes are fused. Null unless every primary ray is tested against every
    /// triangle.
    pub tests_per_s: Option<f64>,
    /// Number of timed frames; the times of the frame and of its passes are medians over these frames.
    pub frames: u32,
    /// True if a first frame was cast before the timed frames and its time was discarded.
    #[serde(skip)]
    pub has_untimed_frame: bool,
    /// Largest use of the host's memory, predicted.
    pub host_bytes: u64,
    /// Size of the device's buffers, predicted; on a CPU they are part of the host's memory.
    pub device_bytes: u64,
    /// Largest use of the host's memory, measured; null if the system does not report it.
    pub peak_bytes: Option<u64>,
    /// The result of `--verify`.
    pub verified: Option<Verification>,
    /// The path of the picture.
    pub output: String,
    /// Remarks for the user: parts of the scene's file that were ignored or replaced by defaults, lights with a radius
    /// that were treated as points, a raycl built from uncommitted sources, and the like.
    pub notes: Vec<String>,
}

/// The result of `--verify`.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Verification {
    /// The picture agrees with the reference.
    Right(Verified),
    /// The picture is wrong. The command ends with an error after its report.
    Wrong {
        /// The message that says what is wrong with the picture.
        wrong: String,
    },
}

impl Verification {
    /// Formats the result for a person.
    pub fn text(&self) -> String {
        match self {
            Self::Right(verified) => verified.text(),
            Self::Wrong { wrong } => format!("verified  {wrong}"),
        }
    }

    /// Returns a note if the picture is right, but was hardly verified because too few of its pixels are certain.
    pub fn note(&self) -> Option<String> {
        let Self::Right(verified) = self else { return None };
        let Verified { uncertain_pixels, pixels, uncertain_hits, hits, .. } = *verified;
        let reason = hardly_verified([uncertain_pixels, pixels], [uncertain_hits, hits])?;
        Some(format!("the picture was hardly verified: {reason}"))
    }
}

/// The numbers that `--verify` reports if the picture agrees with the reference.
#[derive(Debug, Default, Serialize)]
pub struct Verified {
    /// The largest relative difference that the verification found. If soft light was not cast in half
    /// pictures (of half the width and height), this field has the largest difference from the reference over all
    /// certain pixels, whose values do not depend on rounding; null if no pixel is certain. If soft light was cast in
    /// half pictures, raycl compares twice, and this field has the larger of the two differences; it is never null. The
    /// first comparison: the pictures from which the filter made the final picture are compared with the reference, in
    /// their certain pixels. The second comparison: the host applies the filter of the final picture to the pictures
    /// that the device cast, and all pixels of the final picture are compared with the host's result.
    pub max_difference: Option<f64>,
    /// Number of uncertain pixels: those whose radiance may depend on rounding. Uncertain pixels of half
    /// pictures (soft light at half the width and height) are not counted.
    pub uncertain_pixels: usize,
    /// Number of uncertain pixels whose rays hit something in the reference.
    pub uncertain_hits: usize,
    /// Number of pixels that were compared.
    pub pixels: usize,
    /// Number of pixels that were compared and whose rays hit something in the reference.
    pub hits: usize,
    /// Number of pixels in the picture.
    pub of_pixels: usize,
}

impl Verified {
    /// Formats the result for a person.
    fn text(&self) -> String {
        let sample = match self.pixels < self.of_pixels {
            true => format!("{} of {} pixels, chosen at random, ", self.pixels, self.of_pixels),
            false => String::new(),
        };
        let difference = match self.max_difference {
            Some(difference) => format!("largest relative difference {difference:.1e}"),
            None => "no pixel is certain".to_owned(),
        };
        format!(
            "verified  {sample}against the reference picture: {difference}, {} uncertain",
            counted(self.uncertain_pixels, "pixel")
        )
    }
}

/// Returns the number of events per second if `count` events took `ms` milliseconds.
fn per_s(count: f64, ms: f64) -> f64 {
    count / ms * 1e3
}

/// Returns the number of ray-triangle tests of primary rays per second, if each ray is tested against all
/// triangles. The number of tests is divided by the time of the primary pass or, if passes are fused, by the
/// time of the frame.
fn tests_per_s(primary_rays: f64, triangles: usize, times: &FrameTimes) -> f64 {
    per_s(primary_rays * triangles as f64, times.primary_ms.unwrap_or(times.frame_ms))
}

impl Report {
    /// Returns a report with the fields that are known after casting. The caller sets the fields that casting
    /// does not determine, such as `output` and `notes`.
    pub fn of(scene: &Scene, device: &Device, strategy: &Strategy, prepared: &Prepared, cast: &Cast) -> Self {
        let workload = &prepared.workload;
        let triangles = scene.mesh.triangles.len();
        let [primary_rays, shadow_rays] = cast.rays(workload.image_size, scene.shadow_rays_per_hit());
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
            build_from_cache: prepared.program.from_cache,
            upload_ms: prepared.upload_ms(),
            records_ms: cast.records_ms,
            primary_ms: cast.times.primary_ms,
            shadow_ms: cast.times.shadow_ms,
            shade_ms: cast.times.shade_ms,
            frame_ms: cast.times.frame_ms,
            has_untimed_frame: cast.has_untimed_frame,
            read_ms: cast.read_ms,
            samples: cast.sampling.most,
            mean_samples: cast.mean_samples(),
            half_light_samples: cast.sampling.half_light,
            frame_rays_per_s: per_s(primary_rays + shadow_rays, cast.times.frame_ms),
            primary_rays_per_s: cast.times.primary_ms.map(|ms| per_s(primary_rays, ms)),
            shadow_rays_per_s: cast.times.shadow_ms.map(|ms| per_s(shadow_rays, ms)),
            tests_per_s: strategy
                .tests_every_triangle()
                .then(|| tests_per_s(primary_rays, triangles, &cast.times)),
            host_bytes: prepared.host_bytes,
            device_bytes: prepared.device_bytes(),
            ..Self::default()
        }
    }

    /// Returns this report with the parts of the command's time.
    pub fn with_times(self, timeline: Timeline) -> Self {
        let times = ["load", "discover", "build", "save"].map(|part| timeline.ms(part));
        let [load_ms, discover_ms, build_ms, save_ms] = times;
        let (parts, total_ms) = timeline.into_parts();
        Self { load_ms, discover_ms, build_ms, save_ms, parts, total_ms, ..self }
    }

    /// Formats the report for a person.
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
        if self.mean_samples < f64::from(self.samples) {
            let soft = match self.half_light_samples {
                0 => String::new(),
                samples => {
                    format!("; for soft light {samples} per pixel of a picture of half the width and height")
                }
            };
            lines.push(format!(
                "samples   {:.2} per pixel on average, {} at most{soft}",
                self.mean_samples, self.samples
            ));
        }
        let parts = self.parts.iter().map(|Part { part, ms }| (*part, *ms));
        let often_zero = ["tree", "records", "wait", "keep", "report"];
        let shown = parts.filter(|&(part, ms)| !often_zero.contains(&part) || ms >= 0.005);
        for (part, ms) in shown.chain([("total", self.total_ms), ("kernel", self.frame_ms)]) {
            lines.push(format!("{part:<8}{ms:11.2} ms{}", self.remark(part)));
        }
        let speeds = self.speeds();
        lines.extend((!speeds.is_empty()).then(|| format!("speed     {}", speeds.join(", "))));
        lines.push(format!("memory    {}", self.memory()));
        lines.extend(self.verified.iter().map(Verification::text));
        lines.extend(self.notes.iter().map(|note| format!("note      {note}")));
        lines.push(format!("picture   {}", self.output));
        lines.join("\n")
    }

    /// Returns the remark that the report prints beside a part of the command's time; an empty text if there
    /// is none.
    fn remark(&self, part: &str) -> String {
        match part {
            "kernel" => self.kernel_remark(),
            "build" if self.build_from_cache => " (from the cache)".to_owned(),
            "casting" if self.frames > 1 => {
                let first = if self.has_untimed_frame { " after a first one that is not timed" } else { "" };
                format!(" ({} timed frames{first})", self.frames)
            }
            _ => String::new(),
        }
    }

    /// Returns the remark on a frame's device time: the times of the frame's passes, and the number of frames over
    /// which the printed time is the median. Returns an empty text if the passes have no times of their own and there
    /// is only one frame.
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

    /// Returns the rates as texts. A rate whose time is 0 by the device's clock is left out.
    fn speeds(&self) -> Vec<String> {
        let rates = [
            (Some(self.frame_rays_per_s), "rays", " of the frame"),
            (self.primary_rays_per_s, "rays", " primary"),
            (self.shadow_rays_per_s, "rays", " shadow"),
            (self.tests_per_s, "tests", ""),
        ];
        let known = rates.into_iter().filter_map(|(value, what, of)| Some((value?, what, of)));
        let finite = known.filter(|(value, ..)| value.is_finite());
        finite.map(|(value, what, of)| rate(value, what) + of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::DeviceKind;
    use crate::device::tests::example;

    #[test]
    fn counts_and_rates_read_well() {
        assert_eq!(counted(1, "triangle"), "1 triangle");
        assert_eq!(counted(0, "light"), "0 lights");
        assert_eq!(rate(12.6e9, "tests"), "12.60 Gtests/s");
        assert_eq!(rate(232_000.0, "rays"), "232.00 krays/s");
        assert_eq!(rate(0.0, "rays"), "0.00 rays/s");
    }

    #[test]
    fn tests_per_second_are_those_of_the_primary_pass_if_there_is_one() {
        let fused = FrameTimes { frame_ms: 8.0, ..FrameTimes::default() };
        let separate = FrameTimes { primary_ms: Some(2.0), ..fused };
        assert_eq!([&fused, &separate].map(|times| tests_per_s(100.0, 4, times)), [50_000.0, 200_000.0]);
    }

    #[test]
    fn the_kernels_time_says_what_it_is_made_of() {
        let fused = Report { frames: 1, ..Report::default() };
        assert_eq!(fused.kernel_remark(), "");
        let separate =
            Report { frames: 5, primary_ms: Some(1.0), shadow_ms: Some(0.25), ..Report::default() };
        assert_eq!(separate.kernel_remark(), " (primary 1.00, shadow 0.25, median of 5)");
    }

    #[test]
    fn a_part_says_what_is_special_about_it() {
        let plain = Report { frames: 1, ..Report::default() };
        let cached =
            Report { frames: 5, has_untimed_frame: true, build_from_cache: true, ..Report::default() };
        assert_eq!(["build", "casting", "load"].map(|part| plain.remark(part)), [""; 3]);
        let casting = " (5 timed frames after a first one that is not timed)";
        assert_eq!(
            ["build", "casting", "load"].map(|part| cached.remark(part)),
            [" (from the cache)", casting, ""]
        );
        // A first frame that takes more than 1 s counts as one of the timed frames.
        let long = Report { frames: 5, ..Report::default() };
        assert_eq!(long.remark("casting"), " (5 timed frames)");
    }

    #[test]
    fn the_mean_number_of_samples_is_printed_if_it_is_below_the_largest() {
        let text = |mean_samples| {
            let report = Report { samples: 16, mean_samples, ..Report::default() };
            report.text(&example("PoCL", "cpu", DeviceKind::Cpu, 2))
        };
        let line = "\nsamples   4.50 per pixel on average, 16 at most\n";
        assert!(text(4.5).contains(line), "{}", text(4.5));
        assert!(!text(16.0).contains("samples"), "{}", text(16.0));
    }

    #[test]
    fn memory_and_speeds_name_what_they_are_of() {
        let report = Report {
            host_bytes: 3_000_000,
            device_bytes: 2_000_000,
            peak_bytes: Some(4_000_000),
            frame_rays_per_s: 1e3,
            primary_rays_per_s: Some(2e3),
            shadow_rays_per_s: Some(3e3),
            tests_per_s: Some(4e3),
            ..Report::default()
        };
        assert_eq!(report.memory(), "host 3.0 MB predicted, 4.0 MB used at most; device 2.0 MB predicted");
        let speeds =
            ["1.00 krays/s of the frame", "2.00 krays/s primary", "3.00 krays/s shadow", "4.00 ktests/s"];
        assert_eq!(report.speeds(), speeds);
        let timeless =
            Report { frame_rays_per_s: f64::INFINITY, tests_per_s: Some(f64::NAN), ..Report::default() };
        assert!(timeless.speeds().is_empty(), "{:?}", timeless.speeds());
    }

    #[test]
    fn a_sample_of_the_pixels_is_distinguished_from_all_of_them() {
        let text = |pixels| {
            let max_difference = Some(1.5e-6);
            Verified { max_difference, uncertain_pixels: 1, pixels, of_pixels: 40, ..Verified::default() }
                .text()
        };
        let result = "against the reference picture: largest relative difference 1.5e-6, 1 pixel uncertain";
        assert_eq!(text(40), format!("verified  {result}"));
        assert_eq!(text(10), format!("verified  10 of 40 pixels, chosen at random, {result}"));
    }

    #[test]
    fn a_picture_without_certain_pixels_has_a_note_but_no_difference() {
        let of_hits = |max_difference, uncertain_pixels, [uncertain_hits, hits]: [usize; 2]| {
            let [pixels, of_pixels] = [40; 2];
            let verified =
                Verified { max_difference, uncertain_pixels, uncertain_hits, pixels, hits, of_pixels };
            Verification::Right(verified)
        };
        let verification =
            |max_difference, uncertain_pixels| of_hits(max_difference, uncertain_pixels, [0, 0]);
        let none = verification(None, 40);
        let text = "verified  against the reference picture: no pixel is certain, 40 pixels uncertain";
        assert_eq!(none.text(), text);
        let note = none.note().unwrap_or_default();
        assert!(note.starts_with("the picture was hardly verified: 0 of 40 pixels were certain"), "{note}");
        assert_eq!(verification(Some(0.0), 36).note(), None);
        let note = of_hits(Some(0.0), 20, [20, 20]).note().unwrap_or_default();
        assert!(note.contains(": 0 of 20 pixels with a surface were certain or nearly certain;"), "{note}");
        let wrong = Verification::Wrong { wrong: "it is black".to_owned() };
        assert_eq!(wrong.note(), None);
    }
}
