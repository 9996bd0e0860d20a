//! What an experiment is, once it is known to make sense.

use std::fmt;
use std::path::PathBuf;

use crate::device::{DeviceKind, DeviceLimits};
use crate::error::Result;
use crate::scene::{Loaded, load_scene_named_in};
use crate::strategy::Strategy;

/// A question and the product of axes that answers it.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// The config's file stem.
    pub name: String,
    /// The config file.
    pub path: PathBuf,
    /// What is asked.
    pub question: String,
    /// What is expected, written down before measuring.
    pub expectation: String,
    /// Scenes; each one's file was there when the config was read.
    pub scenes: Vec<SceneChoice>,
    /// Whether scenes are compared with each other, and so measured in the same rounds.
    pub compare_scenes: bool,
    /// Words that devices are chosen by; "all" is every usable one. Empty where the config names none.
    pub devices: Vec<String>,
    /// Pixels across and down.
    pub image_sizes: Vec<[u32; 2]>,
    /// What is compared; names differ.
    pub strategies: Vec<NamedStrategy>,
    /// Casters on the host, measured beside the kernels.
    pub baselines: Vec<Baseline>,
    /// The smaller device to imitate.
    pub emulate: Emulate,
    /// How long and how often each point is measured.
    pub timing: Timing,
    /// The config's text.
    pub source: String,
    /// The values laid over it, each as a line of TOML.
    pub overrides: Vec<String>,
}

/// A scene file, and the values that are set in it.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneChoice {
    /// The file.
    pub path: PathBuf,
    /// The folder of the config that names it.
    pub named_in: PathBuf,
    /// Dotted keys of the scene and their values.
    pub overrides: Vec<(String, toml::Value)>,
    /// What is added to the scene's name, to tell it from the others of the same file: `+triangles=1000`.
    pub suffix: String,
}

impl SceneChoice {
    /// A file as it is.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), named_in: PathBuf::new(), overrides: Vec::new(), suffix: String::new() }
    }

    /// Reads the file and sets the values.
    ///
    /// # Errors
    /// As [`load_scene_named_in`].
    pub fn load(&self) -> Result<Loaded> {
        let mut loaded = load_scene_named_in(&self.named_in, &self.path, &self.overrides)?;
        loaded.scene.name.push_str(&self.suffix);
        Ok(loaded)
    }

    /// For progress and logs: the file's stem with the suffix.
    pub fn label(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned() + &self.suffix
    }
}

/// A strategy as a config names it, and the local sizes it runs at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedStrategy {
    /// What reports call it.
    pub name: String,
    /// The preset it is, or `None` where an axis differs from the preset's.
    pub preset: Option<String>,
    /// Its value of every axis.
    pub strategy: Strategy,
    /// Work-items of a work-group across and down.
    pub local_sizes: Vec<[u32; 2]>,
    /// The kind of device that it is measured on: its preset's, unless the config or the command line asks for all.
    pub meant_for: Option<DeviceKind>,
}

impl NamedStrategy {
    /// Why it is not measured on devices of this kind, if so.
    pub fn not_for(&self, kind: DeviceKind) -> Option<String> {
        let meant = self.meant_for.filter(|meant| *meant != kind)?;
        Some(format!("meant for {}; any_kind = true in its entry measures it all the same", meant.plural()))
    }
}

/// A caster on the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Baseline {
    /// One core, single precision: the serial baseline the paper promised.
    Serial,
    /// One core, double precision: the reference that images are compared with.
    SerialF64,
    /// All cores, single precision.
    Parallel,
}

impl Baseline {
    /// Every baseline.
    pub const ALL: &[Self] = &[Self::Serial, Self::SerialF64, Self::Parallel];

    /// Its name in configs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Serial => "serial",
            Self::SerialF64 => "serial-f64",
            Self::Parallel => "parallel",
        }
    }

    /// Its name in a record's `strategy`, with the precision spelled out.
    pub fn strategy(self) -> &'static str {
        match self {
            Self::Serial => "serial-f32",
            Self::SerialF64 => "serial-f64",
            Self::Parallel => "parallel-f32",
        }
    }
}

/// Limits of a smaller device to imitate; they never raise a device's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Emulate {
    /// `__local` bytes a work-group may use.
    pub local_bytes: Option<u64>,
    /// `__constant` bytes a kernel may use.
    pub constant_bytes: Option<u64>,
}

impl Emulate {
    /// The limits of `device` under these.
    pub fn apply(&self, device: DeviceLimits) -> DeviceLimits {
        let lower = |own: u64, cap: Option<u64>| cap.map_or(own, |cap| cap.min(own));
        DeviceLimits {
            local_bytes: lower(device.local_bytes, self.local_bytes),
            constant_bytes: lower(device.constant_bytes, self.constant_bytes),
            ..device
        }
    }
}

impl fmt::Display for Emulate {
    /// For keys: `local_bytes=49152 constant_bytes=-`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = |limit: Option<u64>| limit.map_or("-".to_string(), |bytes| bytes.to_string());
        write!(f, "local_bytes={} constant_bytes={}", text(self.local_bytes), text(self.constant_bytes))
    }
}

/// How long and how often each point is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Frames cast before the first sample.
    pub warmup: u32,
    /// Worker processes that a group is measured in, one after another; they share the samples. One is a look.
    pub launches: u32,
    /// Samples of a point before stopping is considered, unless the time is up.
    pub min_samples: u32,
    /// Samples of a point after which its group stops in any case.
    pub max_samples: u32,
    /// Time a point may spend on its samples, in the mean of its group.
    pub time_limit_ms: f64,
    /// The seed of the order of launches and rounds.
    pub seed: u64,
    /// A group stops when the standard deviation over the mean is below this for each of its points.
    pub relative_sigma: f64,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            warmup: 2,
            launches: 3,
            min_samples: 10,
            max_samples: 100,
            time_limit_ms: 5000.0,
            seed: 1,
            relative_sigma: 0.005,
        }
    }
}

impl fmt::Display for Timing {
    /// For keys: every setting, `name=value`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { warmup, launches, min_samples, max_samples, time_limit_ms, seed, relative_sigma } = self;
        write!(
            f,
            "warmup={warmup} launches={launches} min_samples={min_samples} max_samples={max_samples} \
             time_limit_ms={time_limit_ms} seed={seed} relative_sigma={relative_sigma}"
        )
    }
}
