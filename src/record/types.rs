//! One point's record. `docs/format.md` documents every field.

use super::place::Place;
use crate::manifest;
use crate::program::CompiledKernel;
use crate::sensor::SensorReading;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What `device` says in the records of baselines.
pub const HOST: &str = "host";

/// What came of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The image was right and was timed.
    Measured,
    /// The device cannot hold it; `reason` has the arithmetic.
    Infeasible,
    /// Its preset is meant for devices of another kind: neither built nor timed.
    OtherKind,
    /// The device's compiler refused the program.
    BuildFailed,
    /// The device refused or failed to run the kernel.
    LaunchFailed,
    /// The image differs from the reference's on certain pixels: never timed.
    WrongImage,
    /// One frame took longer than a point may.
    TimedOut,
    /// The process that ran it died; also what a record is until it says otherwise.
    #[default]
    Crashed,
}

impl Outcome {
    /// Its name in records.
    pub fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Infeasible => "infeasible",
            Self::OtherKind => "other-kind",
            Self::BuildFailed => "build-failed",
            Self::LaunchFailed => "launch-failed",
            Self::WrongImage => "wrong-image",
            Self::TimedOut => "timed-out",
            Self::Crashed => "crashed",
        }
    }

    /// Whether a run with this outcome succeeded: it was measured, or it was foreseen that it cannot or need not be.
    pub fn is_fine(self) -> bool {
        matches!(self, Self::Measured | Self::Infeasible | Self::OtherKind)
    }
}

/// All that was found about one point.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Record {
    /// The measurement's name: a hash of everything that decides it.
    pub key: String,
    /// When the point stopped, RFC 3339.
    pub timestamp: Option<String>,
    /// The scene's name.
    pub scene: String,
    /// A hash of all in the scene that decides the picture: what tells scenes apart.
    #[serde(default)]
    pub scene_hash: Option<String>,
    /// The scene's file, as the config's folder leads to it.
    #[serde(default)]
    pub scene_file: Option<String>,
    /// The values set in it, each as a line of TOML.
    #[serde(default)]
    pub scene_values: Vec<String>,
    /// The device's name; [`HOST`] for a baseline.
    pub device: String,
    /// Which of several devices of this kind it was measured on, where points were spread over them.
    #[serde(default)]
    pub measured_on: Option<String>,
    /// The machine it was measured on, where an experiment is measured on several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub host: Option<String>,
    /// The attempt that measured it, where a folder was put together of several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attempt: Option<String>,
    /// The block of the plan that it was measured in, where the plan is cut into blocks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub block: Option<u32>,
    /// The key of the point that all blocks of its group measure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub control: Option<String>,
    /// Whether it was measured to compare its block with others, and the point's own record is another.
    #[serde(default, skip_serializing_if = "is_false")]
    pub is_control: bool,
    /// The strategy's name in the config.
    pub name: String,
    /// The preset it is, if it is one.
    pub preset: Option<String>,
    /// Which of two folders of kernels it was made of, where they are compared.
    #[serde(default)]
    pub kernels_of: Option<String>,
    /// The axes spelled out; for a baseline "serial-f32", "serial-f64" or "parallel-f32".
    pub strategy: String,
    /// Work-items of a work-group across and down; none for a baseline.
    pub local_size: Option<[u32; 2]>,
    /// Pixels across and down.
    pub image_size: [u32; 2],
    /// Triangles in the scene.
    pub triangles: Option<u64>,
    /// Lights in the scene.
    pub lights: Option<u64>,
    /// What was passed over or made up when the scene was read, such as missing normals.
    #[serde(default)]
    pub scene_notes: Vec<String>,
    /// What came of it.
    pub outcome: Outcome,
    /// Why it was not measured.
    pub reason: Option<String>,
    /// What to mind in reading a measured time.
    pub warning: Option<String>,
    /// The median of `samples_ms`.
    pub median_ms: Option<f64>,
    /// Their first quartile.
    pub q1_ms: Option<f64>,
    /// Their third quartile.
    pub q3_ms: Option<f64>,
    /// The 95% interval of the median, by how far launches and what is in them lie apart: low, high.
    #[serde(default)]
    pub interval_ms: Option<[f64; 2]>,
    /// The device time of every frame, in the order taken.
    #[serde(default)]
    pub samples_ms: Vec<f64>,
    /// The launch that each of them was taken in, by its number in the folder; empty in files of earlier versions: one launch.
    #[serde(default)]
    pub sample_launches: Vec<u32>,
    /// When each of them was taken, since the rounds of its launch began.
    #[serde(default)]
    pub samples_at_ms: Vec<f64>,
    /// Where it stands among what was measured with it. Found when a folder is read, and in no file.
    #[serde(skip)]
    pub place: Option<Place>,
    /// Which rule ended the sampling.
    pub stop_reason: Option<String>,
    /// The median of the primary pass, where passes are separate.
    pub primary_ms: Option<f64>,
    /// The median of the shadow pass, where passes are separate; it shades too, where `shade_ms` is none.
    pub shadow_ms: Option<f64>,
    /// The median of the shading pass, where it is apart from shadow rays.
    #[serde(default)]
    pub shade_ms: Option<f64>,
    /// The median of the host's clock around the same frames.
    pub host_median_ms: Option<f64>,
    /// Building the program, up to what the driver compiles at its first launch where it was built ahead; for a program that
    /// an earlier point has had built, taking it from the cache.
    pub build_ms: Option<f64>,
    /// Whether the program was kept since an earlier build, and nothing was compiled; none in records of earlier versions.
    #[serde(default)]
    pub build_from_cache: Option<bool>,
    /// Checking it in its first launch: build, first frame, comparing with the reference.
    #[serde(default)]
    pub check_ms: Option<f64>,
    /// Device time of preparing records of triangles, where that is done once per scene; part of no frame.
    #[serde(default)]
    pub records_ms: Option<f64>,
    /// Primary rays per second of the primary pass, or of the frame where passes are fused: two things, which is why no view
    /// shows it. See [`Self::primary_rays_per_s`] and [`Self::frame_rays_per_s`].
    pub rays_per_s: Option<f64>,
    /// Shadow rays of a frame: one per light for every pixel that hits.
    pub shadow_rays: Option<u64>,
    /// Shadow rays per second, where passes are separate.
    pub shadow_rays_per_s: Option<f64>,
    /// Primary ray-triangle tests per second; shadow tests are not counted.
    pub tests_per_s: Option<f64>,
    /// The largest relative difference from the reference on certain pixels.
    pub max_difference: Option<f64>,
    /// Where that is: column, row.
    pub worst_pixel: Option<[u32; 2]>,
    /// Pixels whose radiance a tiny nudge of the ray changes: compared with the range their nudges span.
    pub uncertain_pixels: Option<u64>,
    /// Those of them that look like none of the pixel's nudges; verification bounds them.
    pub unexplained_pixels: Option<u64>,
    /// `__local` bytes a work-group needs.
    pub local_bytes: Option<u64>,
    /// `__constant` bytes needed.
    pub constant_bytes: Option<u64>,
    /// Global scratch or heap bytes needed.
    pub scratch_bytes: Option<u64>,
    /// Private bytes of a work-group's working vectors.
    pub private_bytes: Option<u64>,
    /// The picture, relative to the results' folder.
    pub image: Option<String>,
    /// The hash of its values, to the last bit: later launches have to cast the same.
    #[serde(default)]
    pub image_hash: Option<String>,
    /// The picture of its differences from the reference.
    pub difference_image: Option<String>,
    /// The reference's picture.
    pub reference_image: Option<String>,
    /// The reference with uncertain pixels marked.
    pub certainty_image: Option<String>,
    /// How many triangles each pixel's rays are tested against, in false colour.
    pub tests_image: Option<String>,
    /// How many nodes of a tree each pixel's rays visit, in false colour.
    pub nodes_image: Option<String>,
    /// Frames of each timed sample, where one alone is too short for the device's timer.
    #[serde(default)]
    pub batch: Option<u32>,
    /// The threads that the device cast with, where that is known: of PoCL.
    #[serde(default)]
    pub threads: Option<u32>,
    /// What the compiler made of the frame's kernels, in their order.
    #[serde(default)]
    pub kernels: Vec<CompiledKernel>,
    /// Floating-point operations of a ray-triangle test, a multiply-add counting as one.
    #[serde(default)]
    pub operations_per_test: Option<u32>,
    /// Multiply-adds per second that the device was measured to do.
    #[serde(default)]
    pub fma_per_s: Option<f64>,
    /// `tests_per_s` x `operations_per_test` over `fma_per_s`.
    #[serde(default)]
    pub limit_fraction: Option<f64>,
    /// The mean of what the device's sensors showed while its samples were taken.
    #[serde(default)]
    pub sensed: Option<SensorReading>,
    /// Samples that were taken while the device throttled.
    #[serde(default)]
    pub throttled_samples: Option<u32>,
    /// The hash of source, defines and build options.
    pub program_hash: Option<String>,
    /// The seed of the order of rounds.
    pub seed: Option<u64>,
    /// The git revision that raycl was built from, "-dirty" where the tree was changed.
    #[serde(default)]
    pub revision: Option<String>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_false(value: &bool) -> bool {
    !value
}

/// The JSON schema of a line of `records.jsonl`.
pub fn schema() -> serde_json::Value {
    crate::schema::of_json::<Record>("raycl record")
}

impl Record {
    /// Its strategy's value of an axis: the one reader of what `strategy` spells out.
    pub fn axis(&self, axis: &str) -> Option<&str> {
        axes(&self.strategy).find(|(name, _)| *name == axis).map(|(_, value)| value)
    }

    /// Whether each of its rays is tested against every triangle, so that tests can be counted.
    pub fn tests_every_triangle(&self) -> bool {
        self.is_baseline() || self.axis("traversal") == Some("exhaustive")
    }

    /// Whether its rays walk a tree, each by itself or a tile of them together.
    pub fn walks_tree(&self) -> bool {
        matches!(self.axis("traversal"), Some("bvh" | "tile"))
    }

    /// The kernel that casts primary rays, alone or with the rest of the frame, by the manifest.
    pub fn main_kernel(&self) -> Option<&CompiledKernel> {
        self.kernels.iter().find(|kernel| manifest::is_main(&kernel.name))
    }

    /// Primary rays per second of the primary pass; none where passes are fused.
    pub fn primary_rays_per_s(&self) -> Option<f64> {
        Some(self.pixels() / positive(self.primary_ms)? * 1e3)
    }

    /// Rays of the frame, primary and shadow, per second of the frame: the same thing for every strategy. None where the
    /// shadow rays were not counted, as those of baselines in records of earlier versions.
    pub fn frame_rays_per_s(&self) -> Option<f64> {
        Some((self.pixels() + self.shadow_rays? as f64) / positive(self.median_ms)? * 1e3)
    }

    fn pixels(&self) -> f64 {
        self.image_size.iter().map(|side| f64::from(*side)).product()
    }

    /// Whether it is a caster on the host.
    pub fn is_baseline(&self) -> bool {
        self.device == HOST
    }
}

fn positive(ms: Option<f64>) -> Option<f64> {
    ms.filter(|ms| *ms > 0.0)
}

/// What a strategy's text of before an axis was there stands for.
const BEFORE: [(&str, &str); 1] = [("records", "each-test")];

/// The axes that a strategy's text spells out, and their values, then those it is too old to know; none of a baseline's.
pub fn axes(strategy: &str) -> impl Iterator<Item = (&str, &str)> {
    let told = move || strategy.split_whitespace().filter_map(|part| part.split_once('='));
    let is_untold = move |(axis, _): &(&str, &str)| {
        told().any(|(name, _)| name == "traversal") && told().all(|(name, _)| name != *axis)
    };
    told().chain(BEFORE.into_iter().filter(is_untold))
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
        assert_eq!(Record { shadow_rays: None, ..fused }.frame_rays_per_s(), None);
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
        }
    }
}
