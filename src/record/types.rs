//! Defines the record of a point. A line of `records.jsonl` is a record, even if the point could not be measured.
//! `docs/format.md` documents every field that is stored.

use super::axes::axes;
use super::outcome::Outcome;
use super::relative_times::RelativeTimes;
use crate::manifest;
use crate::numbers::by;
use crate::program::CompiledKernel;
use crate::sensor::SensorReading;
use crate::strategy::{Axis as _, Infeasible, Traversal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The value of `device` in the records of baselines.
pub const HOST: &str = "host";

/// The result of one point of an experiment. A point is a combination of a scene, a device, a strategy, a
/// local size and an image size. An optional field is null or absent if its value is unknown, or if the field
/// does not apply to the point.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Record {
    /// The key of the measurement: a hash that identifies what was measured. The hash covers, for example,
    /// the scene, the device with its driver, the strategy, the local size, the image size, the program and
    /// the timing settings.
    pub key: String,
    /// When the measurement of the point ended, in the format of RFC 3339.
    pub timestamp: Option<String>,
    /// The scene's name.
    pub scene: String,
    /// A hash of everything in the scene that affects the picture, and of the number of samples per pixel if it
    /// is larger than 1. Scenes with equal hashes yield the same picture.
    #[serde(default)]
    pub scene_hash: Option<String>,
    /// The path of the scene's file: the config's folder, followed by the path in the config.
    #[serde(default)]
    pub scene_file: Option<String>,
    /// The values that the config sets in the scene, each as a line of TOML.
    #[serde(default)]
    pub scene_values: Vec<String>,
    /// The device's name; "host" for a baseline (a ray caster that runs on the host without OpenCL).
    pub device: String,
    /// The device's kind: cpu, gpu, accelerator or other; null for a baseline.
    #[serde(default)]
    pub device_kind: Option<String>,
    /// The device that measured the point, if points were distributed over several devices of one
    /// kind.
    #[serde(default)]
    pub measured_on: Option<String>,
    /// The machine that measured the point, if the experiment is divided into shards. If several machines
    /// measured launches of the point, a record that `raycl merge` wrote has the names of all these machines,
    /// separated by `, `.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub host: Option<String>,
    /// The attempt that measured the point (the process that measured the point's shard), if `raycl merge`
    /// wrote the record.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attempt: Option<String>,
    /// The number of the block in which the point was measured, if the experiment was run with shards or
    /// `--spread`. A block is a whole group of points or a part of a group.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub block: Option<u32>,
    /// The key of the control point of the point's group. If a group of points is divided into blocks, its
    /// control point is measured in every block.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub control: Option<String>,
    /// True if the point is a control point that was measured only so that a block of points can be compared
    /// with other blocks. The point's result is in another record, in which `is_control` is absent.
    #[serde(default, skip_serializing_if = "is_false")]
    pub is_control: bool,
    /// The strategy's name in the config, followed by the axes that have several values in the config. If the
    /// config gives the strategy no name, `name` consists of the preset's name, and of the axes that differ
    /// from the preset or have several values in the config. If the run compares two folders of kernels, the
    /// label of the folder of the point's kernels follows in brackets. For a baseline, `name` is the baseline's
    /// name in the config.
    pub name: String,
    /// The name of the preset that is the point's strategy. Null for a baseline, for a strategy that differs from
    /// its preset on an axis, and in a run that compares two folders of kernels.
    pub preset: Option<String>,
    /// The label of the folder with the source files of the point's kernels, if the run compares two such
    /// folders.
    #[serde(default)]
    pub kernels_of: Option<String>,
    /// The strategy's value on every axis, such as "traversal=bvh width=1 ..."; for a baseline "serial-f32",
    /// "serial-f64" or "parallel-f32".
    pub strategy: String,
    /// Work-items per work-group, across and down; null for a baseline.
    pub local_size: Option<[u32; 2]>,
    /// Image size in pixels: across, down.
    pub image_size: [u32; 2],
    /// Number of triangles in the scene.
    pub triangles: Option<u64>,
    /// Number of lights in the scene.
    pub lights: Option<u64>,
    /// Number of samples per pixel; absent if it is 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples_per_pixel: Option<u32>,
    /// Notes on the scene, of two kinds. Notes of the first kind say what raycl ignored, replaced by a default
    /// or otherwise interpreted in the scene's files, such as missing normals. Notes of the second kind name a
    /// scene of the experiment that has the same content and was therefore not measured.
    #[serde(default)]
    pub scene_notes: Vec<String>,
    /// What happened to the point, such as `measured` or `infeasible`.
    pub outcome: Outcome,
    /// The reason why the point has no time.
    pub reason: Option<String>,
    /// A warning about the measured time.
    pub warning: Option<String>,
    /// The median of `samples_ms`.
    pub median_ms: Option<f64>,
    /// The first quartile of `samples_ms`.
    pub q1_ms: Option<f64>,
    /// The third quartile of `samples_ms`.
    pub q3_ms: Option<f64>,
    /// The 95% interval of the median time in milliseconds (low, high), computed from the differences between
    /// launches and from the usual difference between runs.
    #[serde(default)]
    pub interval_ms: Option<[f64; 2]>,
    /// The samples, in the order of measurement. A sample is the device time of a frame or, if a sample
    /// consists of several frames (see `batch`), their mean device time; for a baseline, the time on the host's
    /// clock. Preempted samples (see `preempted_samples`) are left out. Samples and launches with an unusual
    /// core-to-core latency (see `moved_samples` and `moved_launches`) are left out, too.
    #[serde(default)]
    pub samples_ms: Vec<f64>,
    /// For each sample in `samples_ms`, the number of the launch that took it (launches are counted over the
    /// whole folder of results). The list is empty in records of early versions of raycl, which measured
    /// only one launch.
    #[serde(default)]
    pub sample_launches: Vec<u32>,
    /// When each sample was measured, in milliseconds since the rounds of its launch began.
    #[serde(default)]
    pub samples_at_ms: Vec<f64>,
    /// The record's times relative to the times of the records that were measured together with this record.
    /// raycl computes these times when it reads a folder, and does not store them.
    #[serde(skip)]
    pub relative_times: Option<RelativeTimes>,
    /// The name of the rule that ended the sampling in the last launch, such as "time-limit".
    pub stop_reason: Option<String>,
    /// The median time of the primary pass, if passes are separate.
    pub primary_ms: Option<f64>,
    /// The median time of the shadow pass, if passes are separate. The shadow pass includes shading if
    /// `shade_ms` is null.
    pub shadow_ms: Option<f64>,
    /// The median time of the shading pass, if the frame has one. With `traversal=tile` and fused passes, the
    /// shading pass may also cast leftover shadow rays.
    #[serde(default)]
    pub shade_ms: Option<f64>,
    /// The median time, on the host's clock, of the frames in `samples_ms`.
    pub host_median_ms: Option<f64>,
    /// Time for building the program. If the program was built for this point, the time includes running
    /// a kernel once, because drivers may compile a kernel when it first runs. For all other points with the
    /// same program, `build_ms` is the time for taking the program from raycl's cache. If raycl's cache is not
    /// used, `build_ms` is only the time for compiling.
    pub build_ms: Option<f64>,
    /// True if the program came from raycl's cache and nothing was compiled; null in records of earlier
    /// versions.
    #[serde(default)]
    pub build_from_cache: Option<bool>,
    /// Time to check the point in the first launch: to build its program or take it from the cache, to cast a
    /// frame, and to compare the frame with the reference.
    #[serde(default)]
    pub check_ms: Option<f64>,
    /// With `records=once`: the device time for preparing, for each triangle, the data that a ray-triangle test
    /// reads. This data is prepared before the first frame, so the time is not part of a frame.
    #[serde(default)]
    pub records_ms: Option<f64>,
    /// The number of primary rays, divided by the time of the primary pass or, if passes are fused, of the
    /// whole frame in seconds. The rate of a pass and the rate of a frame cannot be compared, so no page
    /// shows `rays_per_s`; summaries in CSV contain it.
    pub rays_per_s: Option<f64>,
    /// Number of shadow rays of a frame: one per light for every primary ray that hits something, and one more per such
    /// ray if the scene has a sky.
    pub shadow_rays: Option<u64>,
    /// Shadow rays per second, if passes are separate.
    pub shadow_rays_per_s: Option<f64>,
    /// Ray-triangle tests of primary rays per second; tests of shadow rays are not counted.
    pub tests_per_s: Option<f64>,
    /// The largest relative difference from the reference on pixels that are certain (that do not depend on rounding).
    pub max_difference: Option<f64>,
    /// The wrong pixel with the largest difference or, if no pixel is wrong, the certain pixel with the largest
    /// difference: column, row. Null if no certain pixel differs from the reference.
    pub worst_pixel: Option<[u32; 2]>,
    /// Number of uncertain pixels: their radiance in the reference changes noticeably if their rays are moved
    /// very slightly, or if another small change is made. Nearly certain pixels are not counted. Verification
    /// compares the device's value of an uncertain pixel with the range of values that the reference yields
    /// under such small changes.
    pub uncertain_pixels: Option<u64>,
    /// Number of pixels whose rays hit something in the reference.
    #[serde(default)]
    pub hits: Option<u64>,
    /// Number of uncertain pixels whose rays hit something in the reference.
    #[serde(default)]
    pub uncertain_hits: Option<u64>,
    /// Number of pixels whose values are outside the range of values that the reference yields if rays are
    /// moved slightly, or if another small change is made; only pixels that depend on such changes (uncertain
    /// and nearly certain pixels) count. If this number exceeds a limit, the image counts as wrong.
    pub unexplained_pixels: Option<u64>,
    /// Bytes of `__local` memory that a work-group needs.
    pub local_bytes: Option<u64>,
    /// Bytes of `__constant` memory that the point's kernels need.
    pub constant_bytes: Option<u64>,
    /// Bytes of global memory that the working vectors of all rays need (as a scratch buffer or a heap); 0 if
    /// these vectors are in other memory.
    pub scratch_bytes: Option<u64>,
    /// Bytes of private memory that all work-items of a work-group together need for their working vectors or
    /// their tiles' rays; 0 if the vectors or rays need not be stored for all work-items at the same time.
    pub private_bytes: Option<u64>,
    /// The path of the picture that the point cast, relative to the folder of results. The fields whose names
    /// end in `_image` also contain paths relative to the folder of results.
    pub image: Option<String>,
    /// The hash of all pixels' values in the point's picture. If a later launch casts a different picture,
    /// raycl compares the new picture with the reference too.
    #[serde(default)]
    pub image_hash: Option<String>,
    /// The path of a picture that shows how much each pixel of the point's picture differs from the
    /// reference.
    pub difference_image: Option<String>,
    /// The path of the picture that the reference cast.
    pub reference_image: Option<String>,
    /// The path of a grey copy of the reference's picture in which all uncertain and nearly certain pixels are
    /// marked.
    pub certainty_image: Option<String>,
    /// The path of a picture that shows in false colour against how many triangles each pixel's rays are
    /// tested. The host counts these tests. For a strategy with a tree, the host counts them in a tree of its
    /// own, so the strategy's kernels may make more or fewer tests.
    pub tests_image: Option<String>,
    /// The path of a picture that shows in false colour how many nodes of the tree each pixel's rays visit. The
    /// tree is the host's own, as for `tests_image`.
    pub nodes_image: Option<String>,
    /// Number of frames per sample, if a single frame is too short for the device's timer.
    #[serde(default)]
    pub batch: Option<u32>,
    /// Number of threads with which the device executed kernels; known only for PoCL on a CPU.
    #[serde(default)]
    pub threads: Option<u32>,
    /// Properties of the frame's compiled kernels, in the order in which they first run.
    #[serde(default)]
    pub kernels: Vec<CompiledKernel>,
    /// Number of floating-point operations of a ray-triangle test; a multiply-add counts as one.
    #[serde(default)]
    pub operations_per_test: Option<u32>,
    /// Bytes of the triangle that a ray-triangle test reads, divided by the number of rays of a work-item,
    /// since a work-item reads a triangle once for all its rays. The number of bytes is null for a baseline,
    /// and if primary rays are not tested against every triangle.
    #[serde(default)]
    pub triangle_bytes_per_test: Option<f64>,
    /// The memory that contains the triangles that tests read: `global`, `__constant` or `__local`.
    #[serde(default)]
    pub triangle_memory: Option<String>,
    /// Bytes of the ray that a ray-triangle test reads from `__local` or global memory; 0 with private vectors.
    #[serde(default)]
    pub ray_bytes_per_test: Option<f64>,
    /// The memory that contains the rays that tests read: `global`, `__local`, or `registers` with private
    /// vectors.
    #[serde(default)]
    pub ray_memory: Option<String>,
    /// The device's measured peak rate of multiply-adds per second.
    #[serde(default)]
    pub fma_per_s: Option<f64>,
    /// The fraction of the device's peak rate of multiply-adds that the ray-triangle tests reach:
    /// `tests_per_s` x `operations_per_test` / `fma_per_s`.
    #[serde(default)]
    pub limit_fraction: Option<f64>,
    /// The means of the readings of the device's sensors (clock, power, temperature) while the samples were
    /// measured.
    #[serde(default)]
    pub sensed: Option<SensorReading>,
    /// Number of samples that were left out because other programs probably used the processors at the same time; null
    /// if the processor time of the samples is unknown.
    #[serde(default)]
    pub preempted_samples: Option<u32>,
    /// The median, over the samples that were not left out, of a sample's processor time divided by its elapsed time;
    /// null if the processor time is unknown. If other programs delay a sample, the ratio of processor time
    /// to elapsed time becomes smaller.
    #[serde(default)]
    pub utilization: Option<f64>,
    /// Number of samples that were left out because the core-to-core latency was unusual. Probably, the processors of a
    /// virtual machine were further apart than in other samples of the run, or shared a core. Samples of the launches
    /// that `moved_launches` counts are not included. Null if it is unknown how far apart the processors were.
    #[serde(default)]
    pub moved_samples: Option<u32>,
    /// Number of launches of the record's group that were left out. raycl leaves out a whole launch if fewer than five
    /// samples of some point of the group remain in the launch after the rule of `moved_samples` was applied. Null if
    /// it is unknown how far apart the processors were.
    #[serde(default)]
    pub moved_launches: Option<u32>,
    /// Number of samples that were measured while the device throttled.
    #[serde(default)]
    pub throttled_samples: Option<u32>,
    /// The hash of the point's program: of its source, its defines and its build options.
    pub program_hash: Option<String>,
    /// The seed of two random orders: the order of the groups of points in each launch after the first, and the
    /// order of the points in each round.
    pub seed: Option<u64>,
    /// The git revision from which raycl was built, with "-dirty" if there were uncommitted changes.
    #[serde(default)]
    pub revision: Option<String>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_false(value: &bool) -> bool {
    !value
}

/// Returns the JSON schema of a line of `records.jsonl`.
pub fn schema() -> serde_json::Value {
    crate::schema::of_json::<Record>("raycl record")
}

impl Record {
    /// Returns the names of the machines that measured the point. Returns no name if the record names no
    /// machine.
    pub fn hosts(&self) -> impl Iterator<Item = &str> {
        self.host.iter().flat_map(|names| names.split(", "))
    }

    /// Returns true if the outcome is not a failure, and would be the same at any other moment. Returns false
    /// if the point lacked memory that other programs, or other points of the run, may have used only
    /// temporarily.
    pub fn is_final(&self) -> bool {
        let is_of_the_moment = self.outcome == Outcome::Infeasible
            && self.reason.as_deref().is_some_and(Infeasible::is_of_the_moment);
        self.outcome.is_fine() && !is_of_the_moment
    }

    /// Returns true if the point exceeded a limit of the device that may differ between sessions.
    pub fn is_of_the_session(&self) -> bool {
        let reason = self.reason.as_deref();
        self.outcome == Outcome::Infeasible && reason.is_some_and(Infeasible::is_of_the_session)
    }

    /// Returns the record's rank among the records that several attempts have of the same point. The record
    /// with the lowest rank becomes the point's result.
    pub fn rank(&self) -> u8 {
        match self.outcome {
            // A wrong image has the lowest rank, so that the record of another attempt cannot hide the error.
            Outcome::WrongImage => 0,
            Outcome::Measured => 1,
            // If one attempt lacked memory at one moment or in one session, its record must not hide that
            // another attempt had enough memory and failed.
            Outcome::Infeasible if self.is_of_the_session() || !self.is_final() => 4,
            // A limit of the device, and a program that the compiler rejects, are the same for all attempts,
            // whereas other failures may be due to a single attempt.
            Outcome::Infeasible | Outcome::BuildFailed => 2,
            Outcome::LaunchFailed | Outcome::TimedOut | Outcome::Crashed => 3,
            // The attempt did not try to measure the point, but another attempt may have tried.
            Outcome::OtherKind => 5,
        }
    }

    /// Returns the value of an axis in the record's strategy; `None` if the strategy does not have the axis.
    /// If the record was written before raycl had the axis, the value describes what raycl did at that time
    /// (see `axes`).
    pub fn axis(&self, axis: &str) -> Option<&str> {
        axes(&self.strategy).find(|(name, _)| *name == axis).map(|(_, value)| value)
    }

    /// Returns the point's traversal; `None` for a baseline, and if this version of raycl does not have the traversal
    /// that the record names.
    fn traversal(&self) -> Option<Traversal> {
        let name = self.axis("traversal")?;
        Traversal::all().into_iter().find(|traversal| traversal.name() == name)
    }

    /// Returns true if the point's strategy or baseline tests every primary ray against every triangle. The
    /// number of tests of a frame's primary rays is then known.
    pub fn tests_every_triangle(&self) -> bool {
        self.is_baseline() || self.traversal().is_some_and(Traversal::tests_every_triangle)
    }

    /// Returns true if the point's strategy uses a tree. In some of these strategies, each ray traverses
    /// the tree separately; in others, the rays of a packet or a tile traverse it together.
    pub fn walks_tree(&self) -> bool {
        self.traversal().is_some_and(Traversal::walks_tree)
    }

    /// Returns true if the point's strategy rasterises primary rays: one work-item finds the pixels that a
    /// triangle covers.
    pub fn rasterises(&self) -> bool {
        self.traversal().is_some_and(Traversal::rasterises)
    }

    /// Returns the main kernel, which casts the primary rays (or rasterises triangles instead), and in some strategies
    /// also casts shadow rays and shades. Returns `None` if the record describes no main kernel.
    pub fn main_kernel(&self) -> Option<&CompiledKernel> {
        self.kernels.iter().find(|kernel| manifest::is_main(&kernel.name))
    }

    /// Returns the main kernel if its work-groups have the point's local size; `None` for rasterisers. The
    /// work-groups of a rasteriser's main kernel have a fixed size, so the kernel's occupancy does not depend
    /// on the point's local size. In records of earlier versions of raycl, the occupancy of a rasteriser is
    /// wrong: it was predicted for the point's local size, although the driver chose another size.
    pub fn main_kernel_of_local_size(&self) -> Option<&CompiledKernel> {
        self.main_kernel().filter(|_| !self.rasterises())
    }

    /// Returns the primary rays per second of the primary pass; `None` if passes are fused.
    pub fn primary_rays_per_s(&self) -> Option<f64> {
        Some(self.primary_rays() / positive(self.primary_ms)? * 1e3)
    }

    /// Returns the number of rays of a frame, primary and shadow, divided by the frame's time in seconds. The
    /// rate of all rays of a frame can be compared between all strategies, whether or not their passes are
    /// fused. Returns `None` if the shadow rays were not counted, as for baselines in records of earlier
    /// versions of raycl.
    pub fn frame_rays_per_s(&self) -> Option<f64> {
        Some((self.primary_rays() + self.shadow_rays? as f64) / positive(self.median_ms)? * 1e3)
    }

    /// Returns the number of pixels of the image.
    pub fn pixels(&self) -> f64 {
        self.image_size.iter().map(|side| f64::from(*side)).product()
    }

    /// Returns the number of primary rays of a frame: one for each sample of each pixel.
    pub fn primary_rays(&self) -> f64 {
        self.pixels() * f64::from(self.samples_per_pixel.unwrap_or(1))
    }

    /// Returns the point's local size as it follows the strategy's name in a sentence: " at 16 x 16". Returns an empty
    /// text for a baseline, which has no local size.
    pub fn at_local_size(&self) -> String {
        self.local_size.map_or(String::new(), |size| format!(" at {}", by(size)))
    }

    /// Returns true if the point's strategy is the preset `naive`.
    pub fn is_naive(&self) -> bool {
        self.preset.as_deref() == Some("naive")
    }

    /// Returns the time of all samples together, in milliseconds. The function does not use `sum`, which returns
    /// -0.0 if there are no samples.
    pub fn samples_total_ms(&self) -> f64 {
        self.samples_ms.iter().fold(0.0, |total, ms| total + ms)
    }

    /// Returns true if the record is the result of a baseline (a caster on the host that uses no OpenCL).
    pub fn is_baseline(&self) -> bool {
        self.device == HOST
    }
}

fn positive(ms: Option<f64>) -> Option<f64> {
    ms.filter(|ms| *ms > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_from_before_an_axis_was_there_has_what_was_then() {
        let of = |strategy: &str| Record { strategy: strategy.to_owned(), ..Record::default() };
        let (old, new) = (of("traversal=bvh vectors=private"), of("traversal=bvh records=once"));
        assert_eq!((old.axis("records"), old.axis("vectors")), (Some("each-test"), Some("private")));
        assert_eq!((new.axis("records"), new.axis("vectors")), (Some("once"), None));
        assert_eq!(of("serial-f32").axis("records"), None);
    }

    #[test]
    fn rays_per_second_are_one_thing_in_all_rows() {
        let fused = Record {
            image_size: [800, 500],
            median_ms: Some(10.0),
            shadow_rays: Some(200_000),
            ..Record::default()
        };
        let separate = Record { primary_ms: Some(4.0), shadow_ms: Some(6.0), ..fused.clone() };
        assert_eq!([&fused, &separate].map(Record::frame_rays_per_s), [Some(6e7), Some(6e7)]);
        assert_eq!([&fused, &separate].map(Record::primary_rays_per_s), [None, Some(1e8)]);
        assert_eq!(Record { shadow_rays: None, ..fused.clone() }.frame_rays_per_s(), None);
        // Every sample of a pixel has a primary ray.
        let [fused, separate] =
            [fused, separate].map(|record| Record { samples_per_pixel: Some(4), ..record });
        assert_eq!(fused.frame_rays_per_s(), Some(1.8e8));
        assert_eq!(separate.primary_rays_per_s(), Some(4e8));
    }

    #[test]
    fn what_prepares_triangles_is_not_the_main_kernel() {
        let kernel = |name: &str| CompiledKernel { name: name.to_owned(), ..CompiledKernel::default() };
        for (names, main) in [
            (&["tile_prepare", "tile_cast", "tile_shade"][..], Some("tile_cast")),
            (&["prepare_origins", "cast_primary", "shade_nearest"], Some("cast_primary")),
            (&["raster_depth", "raster_nearest", "shade_nearest"], Some("raster_depth")),
            (&[], None),
        ] {
            let record =
                Record { kernels: names.iter().map(|name| kernel(name)).collect(), ..Record::default() };
            assert_eq!(record.main_kernel().map(|kernel| kernel.name.as_str()), main);
            let raster = Record { strategy: "traversal=raster".into(), ..record.clone() };
            assert_eq!(raster.main_kernel_of_local_size(), None);
            assert_eq!(record.main_kernel_of_local_size(), record.main_kernel());
        }
    }

    #[test]
    fn only_what_no_other_moment_changes_is_final() {
        let is_final = |outcome, reason: &str| {
            Record { outcome, reason: Some(reason.to_owned()), ..Record::default() }.is_final()
        };
        let beside = |words: &str| format!("global memory: 2 B > 1 B, in addition to 3 B {words}");
        assert!(is_final(Outcome::Infeasible, "global memory: 2 B > 1 B") && is_final(Outcome::Measured, ""));
        assert!(!is_final(Outcome::Infeasible, "the host's memory (casting): 2 B > 1 B according to a test"));
        for words in [Infeasible::BESIDE_OTHERS, "that other points hold"] {
            assert!(!is_final(Outcome::Infeasible, &beside(words)), "{words}");
        }
        assert!(!is_final(Outcome::Crashed, "no"));
    }

    #[test]
    fn casters_differ_in_which_triangles_they_test() {
        let of = |device: &str, strategy: &str| {
            let record = Record { device: device.into(), strategy: strategy.into(), ..Record::default() };
            (record.tests_every_triangle(), record.walks_tree(), record.rasterises())
        };
        assert_eq!(of(HOST, "serial-f32"), (true, false, false));
        assert_eq!(of("gpu", "traversal=exhaustive"), (true, false, false));
        assert_eq!(of("gpu", "traversal=raster"), (false, false, true));
        assert_eq!([of("gpu", "traversal=bvh"), of("gpu", "traversal=tile")], [(false, true, false); 2]);
        assert_eq!(of("gpu", "traversal=of-a-later-version"), (false, false, false));
    }
}
