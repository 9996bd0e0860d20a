//! A validated experiment.

use std::fmt;
use std::path::PathBuf;

use crate::device::{DeviceKind, DeviceLimits};
use crate::entry::entry;
use crate::error::Result;
use crate::printer::line;
use crate::scene::{Loaded, Sampling, Scene, Setting, Shot, load_scene_named_in};
use crate::strategy::Strategy;

/// A question, and the scenes, devices, image sizes and strategies whose combinations are measured to answer it.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// The config's file name without its extension.
    pub name: String,
    /// The path of the config file.
    pub path: PathBuf,
    /// The question that the experiment answers; the config's name if it states none.
    pub question: String,
    /// The expected answer, written before measuring; empty if the config states none.
    pub expectation: String,
    /// The scenes to be measured. Each scene's file existed when the config was read.
    pub scenes: Vec<SceneChoice>,
    /// The scenes that were removed from `scenes` because their content equals that of an earlier scene, as
    /// indices into the config's list of scenes.
    pub left_out: Vec<usize>,
    /// True if scenes are compared with each other. Scenes that are compared are measured in the same rounds.
    pub compare_scenes: bool,
    /// Words that select devices; "all" selects every usable device. Empty if the config names no devices.
    pub devices: Vec<DeviceWord>,
    /// Image sizes in pixels: across, down.
    pub image_sizes: Vec<[u32; 2]>,
    /// The strategies to compare; no two names are equal.
    pub strategies: Vec<NamedStrategy>,
    /// Casters on the host. Baselines are measured in the same rounds as the kernels, unless the experiment
    /// is divided into shards or distributed over several devices.
    pub baselines: Vec<Baseline>,
    /// Limits of a smaller device to imitate.
    pub emulate: Emulate,
    /// How often and how long each point is measured: limits on samples and time.
    pub timing: Timing,
    /// The text of the config file.
    pub source: String,
    /// The `--set` options, each as a line of TOML.
    pub overrides: Vec<String>,
}

impl Experiment {
    /// Returns the elements of `strategies` that have the local size `local_size`, and the same value on
    /// every axis as the element with the index `index`. Several elements are returned if the config lists
    /// the strategy under several names.
    pub fn names_of(&self, index: usize, local_size: [u32; 2]) -> impl Iterator<Item = &NamedStrategy> {
        let wanted = self.strategies.get(index).map(|named| named.strategy);
        let is_wanted = move |named: &&NamedStrategy| {
            Some(named.strategy) == wanted && named.local_sizes.contains(&local_size)
        };
        self.strategies.iter().filter(is_wanted)
    }

    /// Returns notes on strategies that equal an earlier strategy of the config: both have the same value on every axis
    /// (see [`Self::names_of`]). At the local sizes that both strategies have, the later strategy is measured under the
    /// name of the earlier strategy. A strategy has one note for each name under which it is measured.
    pub fn notes_on_equal_strategies(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for (index, copy) in self.strategies.iter().enumerate() {
            let mut measured_as: Vec<(&str, Vec<[u32; 2]>)> = Vec::new();
            for &size in &copy.local_sizes {
                let Some(first) = self.names_of(index, size).next() else { continue };
                let first = first.name.as_str();
                entry(&mut measured_as, |(name, _)| *name == first, || (first, Vec::new())).1.push(size);
            }
            measured_as.retain(|(first, _)| *first != copy.name);
            notes.extend(measured_as.iter().map(|(first, sizes)| copy.note_on_equal(first, sizes)));
        }
        notes
    }

    /// Removes the scenes at these indices in the config's list of scenes. The function may be called only
    /// once, while the list of scenes is still complete.
    pub fn leave_out(&mut self, indices: Vec<usize>) {
        let mut index = 0..;
        self.scenes.retain(|_| index.next().is_none_or(|index| !indices.contains(&index)));
        self.left_out = indices;
    }

    /// Returns the first image size of each shape (ratio of width to height).
    pub fn shapes(&self) -> Vec<[u32; 2]> {
        let mut shapes: Vec<[u32; 2]> = Vec::new();
        for &size in &self.image_sizes {
            if !shapes.iter().any(|&known| have_one_shape(known, size)) {
                shapes.push(size);
            }
        }
        shapes
    }
}

/// Returns true if images of two sizes have the same ratio of width to height.
pub fn have_one_shape([width, height]: [u32; 2], [other_width, other_height]: [u32; 2]) -> bool {
    u64::from(width) * u64::from(other_height) == u64::from(other_width) * u64::from(height)
}

/// A word that selects devices. Two words are equal if their texts are equal.
#[derive(Clone, Debug)]
pub struct DeviceWord {
    /// The word's text, as the user wrote it.
    pub text: String,
    /// The word's location for messages: `FILE:LINE`, or `--set:1` if the option `--set` contains the word.
    pub location: String,
}

impl PartialEq for DeviceWord {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

/// A scene file, values to change in it, and the number of samples per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneChoice {
    /// The path of the scene file.
    pub path: PathBuf,
    /// The folder of the config that names the file; empty if no config names the file.
    pub named_in: PathBuf,
    /// The values to set in the scene file, with their locations in the config.
    pub overrides: Vec<Setting>,
    /// The number of samples per pixel.
    pub samples: u32,
    /// The end of the scene's name, which distinguishes the scene from other scenes made from the same file:
    /// `+triangles=1000`.
    pub suffix: String,
    /// The largest number of triangles that a tree can index. Loading fails if the scene has more triangles.
    /// The limit on triangles is `None` unless the scene is the config's only scene, every strategy needs a
    /// tree, and there is no baseline.
    pub most_triangles: Option<u64>,
    /// The scene's name in results, which differs from the names of the experiment's other scenes; `None` before the
    /// scenes are loaded.
    pub name: Option<String>,
    /// The hashes of the scene ([`Self::hash`]): if raycl places the camera, one hash for each shape of the images,
    /// otherwise a single hash. Empty before the scenes are loaded.
    pub hashes: Vec<String>,
    /// Notes on other scenes of the config with the same content.
    pub notes: Vec<String>,
}

impl SceneChoice {
    /// Returns the choice of a scene file without changed values, with one sample per pixel.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            named_in: PathBuf::new(),
            overrides: Vec::new(),
            samples: 1,
            suffix: String::new(),
            most_triangles: None,
            name: None,
            hashes: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Sets the number of samples per pixel. If a pixel has several samples, the scene's name states their
    /// number.
    #[must_use]
    pub(super) fn with_samples(mut self, samples: u32) -> Self {
        self.samples = samples;
        if samples > 1 {
            self.suffix.push_str(&format!("+samples={samples}"));
        }
        self
    }

    /// Returns how many samples each pixel gets.
    pub fn sampling(&self) -> Sampling {
        Sampling::all(self.samples)
    }

    /// Returns the hash that identifies the loaded `scene` in results. With one sample per pixel, the
    /// returned hash is that of the scene's content, as in records of raycl's versions that always cast one
    /// sample. With several samples per pixel, the hash also depends on the number of samples, since scenes
    /// with different numbers of samples are different scenes in results.
    pub fn hash(&self, scene: &Scene) -> String {
        let content = scene.content_hash();
        match self.samples {
            1 => content,
            samples => {
                blake3::hash(format!("{content} {samples} samples").as_bytes()).to_hex()[..16].to_owned()
            }
        }
    }

    /// Loads the scene with the changed values, for images of this size: if raycl places the camera, the camera depends
    /// on the shape of the images, as in the pictures of `raycl render`.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`load_scene_named_in`].
    pub fn load(&self, [width, height]: [u32; 2]) -> Result<Loaded> {
        let aspect = f64::from(width) / f64::from(height);
        let shot = Shot { aspect, most_triangles: self.most_triangles, ..Shot::SQUARE };
        let mut loaded = load_scene_named_in(&self.named_in, &self.path, &self.overrides, shot)?;
        loaded.scene.name.push_str(&self.suffix);
        loaded.notes.extend_from_slice(&self.notes);
        Ok(loaded)
    }

    /// Returns the scene's name for progress and logs: its name in results or, before the scenes are loaded, the
    /// name of the scene's file without its extension, followed by `suffix` (such as `+triangles=1000`).
    pub fn label(&self) -> String {
        let stem = || self.path.file_stem().unwrap_or_default().to_string_lossy();
        self.name.clone().unwrap_or_else(|| line(&stem()).into_owned() + &self.suffix)
    }
}

/// A strategy as the config names it, with its local sizes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedStrategy {
    /// The strategy's name in reports.
    pub name: String,
    /// The preset's name; `None` if an axis differs from the preset.
    pub preset: Option<String>,
    /// The strategy: one value of every axis.
    pub strategy: Strategy,
    /// Local sizes: work-items of a work-group, across and down.
    pub local_sizes: Vec<[u32; 2]>,
    /// The only kind of device on which the strategy is measured: the kind for which its preset is meant.
    /// `None` if the preset is meant for all kinds of devices, or if the config or the command line asks for
    /// all kinds of devices.
    pub meant_for: Option<DeviceKind>,
}

impl NamedStrategy {
    /// Returns a note that says that the strategy `first` is measured in place of this strategy at the local sizes
    /// `sizes`, because both strategies have the same value on every axis.
    fn note_on_equal(&self, first: &str, sizes: &[[u32; 2]]) -> String {
        let sizes = match sizes.len() == self.local_sizes.len() {
            true => String::new(),
            false => {
                let all: Vec<String> =
                    sizes.iter().map(|[across, down]| format!("{across}x{down}")).collect();
                format!("at {}, ", all.join(", "))
            }
        };
        format!("Strategy {} equals {first} on all axes; {sizes}raycl measures only {first}.", self.name)
    }

    /// Returns why the strategy is not measured on devices of this kind; `None` if it is measured on them.
    pub fn not_for(&self, kind: DeviceKind) -> Option<String> {
        let meant = self.meant_for.filter(|meant| *meant != kind)?;
        Some(format!(
            "meant for {}; to measure the strategy on this device too, set any_kind = true in the experiment, or in \
             the strategy's [[strategy]] entry",
            meant.plural()
        ))
    }
}

/// A caster on the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Baseline {
    /// One core, single precision: the serial baseline that was promised in the paper that raycl reproduces.
    Serial,
    /// One core, double precision: the reference against which images are verified.
    SerialF64,
    /// All cores, single precision.
    Parallel,
}

impl Baseline {
    /// Every baseline.
    pub const ALL: &[Self] = &[Self::Serial, Self::SerialF64, Self::Parallel];

    /// Returns the baseline's name in configs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Serial => "serial",
            Self::SerialF64 => "serial-f64",
            Self::Parallel => "parallel",
        }
    }

    /// Returns the name that a record's `strategy` contains. Unlike the name in configs, the name in records
    /// always includes the precision.
    pub fn strategy(self) -> &'static str {
        match self {
            Self::Serial => "serial-f32",
            Self::SerialF64 => "serial-f64",
            Self::Parallel => "parallel-f32",
        }
    }
}

/// Limits of a smaller device to imitate. The limits of an imitated device can only lower the limits of the
/// real device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Emulate {
    /// Size in bytes of a work-group's `__local` memory.
    pub local_bytes: Option<u64>,
    /// Size in bytes of the `__constant` memory of a kernel.
    pub constant_bytes: Option<u64>,
}

impl Emulate {
    /// Returns the limits of `device`. If a limit of the imitated device is smaller, it replaces the limit of `device`,
    /// and the result says that this limit is emulated.
    pub fn apply(&self, device: DeviceLimits) -> DeviceLimits {
        let lower =
            |own: u64, cap: Option<u64>| cap.filter(|cap| *cap < own).map_or((own, false), |cap| (cap, true));
        let (local_bytes, local_is_emulated) = lower(device.local_bytes, self.local_bytes);
        let (constant_bytes, constant_is_emulated) = lower(device.constant_bytes, self.constant_bytes);
        DeviceLimits { local_bytes, local_is_emulated, constant_bytes, constant_is_emulated, ..device }
    }
}

impl fmt::Display for Emulate {
    /// Formats the limits for the key of a point's record: `local_bytes=49152 constant_bytes=-`; `-` means
    /// the device's own limit.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = |limit: Option<u64>| limit.map_or("-".to_string(), |bytes| bytes.to_string());
        write!(f, "local_bytes={} constant_bytes={}", text(self.local_bytes), text(self.constant_bytes))
    }
}

/// How often and how long each point is measured: limits on samples and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Number of frames that each point casts in a launch before the point's first sample. A point casts fewer frames
    /// if the warm-up frames would take over a tenth of the time limit. Even with `warmup = 0`, a point casts one frame
    /// if a step of the device's timer is longer than 1 ns.
    pub warmup: u32,
    /// Number of launches: measurements of a group, each by new worker processes. The group's samples are
    /// divided among the launches. With one launch, results are only preliminary.
    pub launches: u32,
    /// Smallest number of samples of a point, unless `time_limit_ms` ends the sampling earlier.
    pub min_samples: u32,
    /// Largest number of samples of a point, divided equally among the launches. A launch whose part is less than five
    /// may take five samples (or `max_samples`, if that is less than five), so a point may get more than `max_samples`.
    pub max_samples: u32,
    /// Time limit for samples, in milliseconds per point. A group of N points is not sampled further when its samples
    /// have taken N times this limit in all.
    pub time_limit_ms: f64,
    /// Seed of two random orders: that of the groups in each launch after the first, and that of the points in a round.
    pub seed: u64,
    /// Limit of the relative standard deviation (standard deviation divided by mean) of a point's samples. If each
    /// point of a group is below this limit, and a launch has its part of `min_samples`, the launch stops sampling the
    /// group.
    pub relative_sigma: f64,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            warmup: 2,
            launches: 4,
            min_samples: 10,
            max_samples: 100,
            time_limit_ms: 5000.0,
            seed: 1,
            relative_sigma: 0.005,
        }
    }
}

impl fmt::Display for Timing {
    /// Formats all settings for the key of a point's record, as `name=value`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { warmup, launches, min_samples, max_samples, time_limit_ms, seed, relative_sigma } = self;
        write!(
            f,
            "warmup={warmup} launches={launches} min_samples={min_samples} max_samples={max_samples} \
             time_limit_ms={time_limit_ms} seed={seed} relative_sigma={relative_sigma}"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_scene_with_other_values_ends_in_the_suffix() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dots.toml");
        let object = "[[object]]\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, 2]]\n";
        std::fs::write(&path, object).unwrap();
        let choice = SceneChoice { suffix: "+crease=40".to_owned(), ..SceneChoice::file(&path) };
        assert_eq!(choice.load([8, 5]).unwrap().scene.name, "dots+crease=40");
        assert_eq!(choice.label(), "dots+crease=40");
        assert_eq!(SceneChoice::file(&path).load([8, 5]).unwrap().scene.name, "dots");
    }

    #[test]
    fn a_shape_of_more_triangles_than_can_be_cast_is_not_made() {
        let terrain = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/terrain.toml");
        let choice = SceneChoice { most_triangles: Some(10), ..SceneChoice::file(terrain) };
        let error = choice.load([8, 5]).expect_err("it has more");
        assert!(error.to_string().contains("expected at most 10"), "{error}");
    }

    #[test]
    fn a_strategy_for_cpus_is_not_measured_on_gpus() {
        let named = |meant_for| NamedStrategy {
            name: "wide".to_owned(),
            preset: None,
            strategy: crate::strategy::preset("wide").unwrap().strategy,
            local_sizes: vec![[1, 1]],
            meant_for,
        };
        let reason = named(Some(DeviceKind::Cpu)).not_for(DeviceKind::Gpu).unwrap();
        assert!(
            reason.starts_with(
                "meant for CPUs; to measure the strategy on this device too, set any_kind = true"
            ),
            "{reason}"
        );
        assert_eq!(named(Some(DeviceKind::Cpu)).not_for(DeviceKind::Cpu), None);
        assert_eq!(named(None).not_for(DeviceKind::Gpu), None);
    }

    #[test]
    fn records_and_configs_name_the_casters_on_the_host() {
        let names = Baseline::ALL.iter().map(|baseline| (baseline.name(), baseline.strategy()));
        let expected = [("serial", "serial-f32"), ("serial-f64", "serial-f64"), ("parallel", "parallel-f32")];
        assert_eq!(names.collect::<Vec<_>>(), expected);
    }

    #[test]
    fn a_points_key_names_each_emulated_limit() {
        let emulate = Emulate { local_bytes: Some(49152), constant_bytes: None };
        assert_eq!(emulate.to_string(), "local_bytes=49152 constant_bytes=-");
        let emulate = Emulate { local_bytes: None, constant_bytes: Some(7) };
        assert_eq!(emulate.to_string(), "local_bytes=- constant_bytes=7");
    }

    /// A record's key depends on the settings of the timing. If the defaults changed, raycl would measure
    /// points again whose records were stored with the old defaults.
    #[test]
    fn the_default_timing_is_that_of_stored_records() {
        let expected = "warmup=2 launches=4 min_samples=10 max_samples=100 time_limit_ms=5000 seed=1 relative_sigma=0.005";
        assert_eq!(Timing::default().to_string(), expected);
    }
}
