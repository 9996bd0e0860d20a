//! The types that a config's TOML is read into. Numbers have wide types and sizes are unchecked, so that the module
//! `validate` can report every mistake with its location.

use std::collections::BTreeMap;
use std::fmt;

use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::{self, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use toml::Spanned;

use super::schema::{Anything, BaselineName, ImageSize, LocalSize, PresetName, SampleNumbers};
use super::validate::{MOST_LAUNCHES, MOST_SAMPLES};
use crate::strategy::AXES;

/// An experiment measures every combination of its scenes, image sizes, strategies, local sizes and devices. raycl
/// verifies the picture of each combination, then measures the combination's time.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// The question that the experiment answers, in a sentence [default: the name of the file, without `.toml`].
    #[schemars(with = "Option<String>", length(min = 1))]
    pub question: Option<Spanned<String>>,
    /// The answer that the author of the experiment expects, written before measuring [default: none].
    #[schemars(with = "Option<String>", length(min = 1))]
    pub expectation: Option<Spanned<String>>,
    /// Scene files. A scene file's path is relative to the folder of the experiment file.
    #[serde(default)]
    #[schemars(with = "Vec<String>")]
    pub scenes: Vec<Spanned<String>>,
    /// Scene files with changed values.
    #[serde(default)]
    pub scene: Vec<SceneEntry>,
    /// Measure all scenes in the same rounds, so that their times can be compared [default: false].
    #[serde(default)]
    pub compare_scenes: bool,
    /// Words that select devices, such as "all", a kind ("cpu", "gpu", "accelerator"), or a part of the name of a
    /// device, platform or vendor; docs/experiments.md lists all forms of a word [default: the device that
    /// RAYCL_DEVICE or the user's settings file names, else all].
    #[schemars(with = "Option<Vec<String>>", length(min = 1))]
    pub devices: Option<Spanned<Vec<Spanned<String>>>>,
    /// Widths and heights in pixels: 512 for a square, or [800, 500].
    #[schemars(with = "Vec<ImageSize>", length(min = 1))]
    pub image_sizes: Spanned<Vec<Spanned<Size>>>,
    /// Work-items per work-group: 8 for 8 x 8, or [64, 1].
    #[serde(default)]
    #[schemars(with = "Vec<LocalSize>")]
    pub local_sizes: Vec<Spanned<Size>>,
    /// Names of presets; `raycl strategies` lists them.
    #[serde(default)]
    #[schemars(with = "Vec<PresetName>")]
    pub strategies: Vec<Spanned<String>>,
    /// Presets with changed axes; a list of values makes one strategy per value.
    #[serde(default)]
    #[schemars(with = "Vec<StrategyEntry>")]
    pub strategy: Vec<Spanned<StrategyEntry>>,
    /// Also measure presets on kinds of devices that they are not meant for [default: false].
    #[serde(default)]
    pub any_kind: bool,
    /// Ray casters that run on the host without OpenCL. raycl measures baselines in the same rounds as the
    /// kernels, unless the experiment is divided into shards or distributed over several devices.
    #[serde(default)]
    #[schemars(with = "Vec<BaselineName>")]
    pub baselines: Vec<Spanned<String>>,
    /// Memory limits of a smaller device, which raycl imitates: a point that needs more memory is not
    /// measured.
    #[serde(default)]
    pub emulate: Emulate,
    /// How often and how long each point is measured: limits on samples and time.
    #[serde(default)]
    pub timing: Timing,
}

/// A scene file, and values to change in it.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneEntry {
    /// The scene file. The scene file's path is relative to the folder of the experiment file.
    #[schemars(with = "String")]
    pub file: Spanned<String>,
    /// New values of keys of the scene file, such as "object.0.triangles"; a list makes one scene per value.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, Anything>")]
    pub set: BTreeMap<Spanned<String>, Spanned<SceneValues>>,
    /// Samples per pixel, like `raycl render --samples`; a list makes one scene per number [default: 1]. With
    /// several samples, lights with a radius or edges cast soft shadows.
    #[schemars(with = "Option<SampleNumbers>")]
    pub samples: Option<Spanned<Numbers>>,
}

/// One value or a list of values. A value that is itself a list must be inside another list: `[[0, 1, 2]]`.
#[derive(Deserialize)]
#[serde(untagged)]
pub enum SceneValues {
    List(Vec<toml::Value>),
    One(toml::Value),
}

/// Limits of a smaller device to imitate. These limits never raise the device's own limits.
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Emulate {
    /// Bytes of `__local` memory that a work-group of the imitated device can have [default: the real
    /// device's limit].
    #[schemars(with = "Option<u32>")]
    pub local_bytes: Option<Spanned<i64>>,
    /// Bytes of `__constant` memory that a kernel of the imitated device can have [default: the real device's
    /// limit].
    #[schemars(with = "Option<u32>")]
    pub constant_bytes: Option<Spanned<i64>>,
}

/// How often and how long each point is measured: limits on samples and time.
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// Number of frames that each point casts in a launch before the point's first sample [default: 2]. A
    /// point casts fewer frames before its first sample if these frames take over a tenth of `time_limit_ms`.
    /// Even with `warmup = 0`, a point casts one frame if a step of the device's timer is longer than 1 ns.
    #[schemars(with = "Option<u32>", range(max = 1000))]
    pub warmup: Option<Spanned<i64>>,
    /// Number of launches [default: 4]. In each launch, new worker processes measure the points. A point's
    /// samples are divided among the launches. With 1 launch, the 95% intervals are too narrow.
    #[schemars(with = "Option<u32>", range(min = 1, max = MOST_LAUNCHES))]
    pub launches: Option<Spanned<i64>>,
    /// Smallest number of samples of a point, unless `time_limit_ms` ends the sampling earlier [default: 10].
    #[schemars(with = "Option<u32>", range(min = 1, max = MOST_SAMPLES))]
    pub min_samples: Option<Spanned<i64>>,
    /// Largest number of samples of a point, divided equally among the launches [default: 100]. A launch whose part
    /// is less than five may take five samples (or `max_samples`, if that is less than five), so a point may get
    /// more than `max_samples`.
    #[schemars(with = "Option<u32>", range(min = 1, max = MOST_SAMPLES))]
    pub max_samples: Option<Spanned<i64>>,
    /// Time limit for samples, in milliseconds per point [default: 5000]. A group of N points is not sampled further
    /// when its samples have taken N times this limit in all.
    #[schemars(with = "Option<f64>", range(min = 1, max = 1e8))]
    pub time_limit_ms: Option<Spanned<f64>>,
    /// Seed of two random orders: the order of the groups of points in each launch after the first, and the order
    /// of the points in a round [default: 1].
    #[schemars(with = "Option<u32>")]
    pub seed: Option<Spanned<i64>>,
    /// Limit of the relative standard deviation (standard deviation divided by mean) of a point's samples [default:
    /// 0.005]. If each point of a group is below this limit, and a launch has its part of `min_samples`, the launch
    /// stops sampling the group.
    #[schemars(with = "Option<f64>", range(min = 0, max = 1))]
    pub relative_sigma: Option<Spanned<f64>>,
}

/// A size in a config: `8` (which means 8 x 8), or `[64, 1]`.
pub enum Size {
    Square(i64),
    List(Vec<Spanned<i64>>),
}

/// A whole number, or a list of whole numbers.
pub enum Numbers {
    One(i64),
    List(Vec<Spanned<i64>>),
}

/// A value of an axis: a name or a number.
pub struct Choice(pub String);

/// One value of an axis, or a list of values.
pub enum Choices {
    One(String),
    List(Vec<Spanned<Choice>>),
}

/// A `[[strategy]]` entry. The keys of a `[[strategy]]` entry are `name`, `preset`, `local_sizes`, `any_kind`
/// and the names of the axes.
#[derive(Default)]
pub struct StrategyEntry {
    pub name: Option<Spanned<String>>,
    pub preset: Option<Spanned<String>>,
    pub local_sizes: Option<Spanned<Vec<Spanned<Size>>>>,
    pub any_kind: bool,
    pub axes: Vec<(Spanned<String>, Spanned<Choices>)>,
    pub unknown: Vec<Spanned<String>>,
}

impl<'de> Deserialize<'de> for Size {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct SizeVisitor;
        impl<'de> Visitor<'de> for SizeVisitor {
            type Value = Size;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a size: a whole number (a square) or [across, down]")
            }
            fn visit_i64<E: de::Error>(self, side: i64) -> Result<Size, E> {
                Ok(Size::Square(side))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Size, A::Error> {
                Ok(Size::List(elements(&mut seq)?))
            }
        }
        deserializer.deserialize_any(SizeVisitor)
    }
}

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumbersVisitor;
        impl<'de> Visitor<'de> for NumbersVisitor {
            type Value = Numbers;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a whole number or a list of whole numbers")
            }
            fn visit_i64<E: de::Error>(self, number: i64) -> Result<Numbers, E> {
                Ok(Numbers::One(number))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Numbers, A::Error> {
                Ok(Numbers::List(elements(&mut seq)?))
            }
        }
        deserializer.deserialize_any(NumbersVisitor)
    }
}

impl<'de> Deserialize<'de> for Choice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ChoiceVisitor;
        impl Visitor<'_> for ChoiceVisitor {
            type Value = Choice;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an axis's value: a string or a whole number")
            }
            fn visit_str<E: de::Error>(self, name: &str) -> Result<Choice, E> {
                Ok(Choice(name.into()))
            }
            fn visit_i64<E: de::Error>(self, number: i64) -> Result<Choice, E> {
                Ok(Choice(number.to_string()))
            }
        }
        deserializer.deserialize_any(ChoiceVisitor)
    }
}

impl<'de> Deserialize<'de> for Choices {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ChoicesVisitor;
        impl<'de> Visitor<'de> for ChoicesVisitor {
            type Value = Choices;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an axis's value (a string or a whole number) or a list of values")
            }
            fn visit_str<E: de::Error>(self, name: &str) -> Result<Choices, E> {
                Ok(Choices::One(name.into()))
            }
            fn visit_i64<E: de::Error>(self, number: i64) -> Result<Choices, E> {
                Ok(Choices::One(number.to_string()))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Choices, A::Error> {
                Ok(Choices::List(elements(&mut seq)?))
            }
        }
        deserializer.deserialize_any(ChoicesVisitor)
    }
}

impl StrategyEntry {
    /// Returns every key that is allowed in a `[[strategy]]` entry.
    pub fn known_keys() -> Vec<&'static str> {
        ["name", "preset", "local_sizes", "any_kind"]
            .into_iter()
            .chain(AXES.iter().map(|axis| axis.name))
            .collect()
    }
}

impl<'de> Deserialize<'de> for StrategyEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct EntryVisitor;
        impl<'de> Visitor<'de> for EntryVisitor {
            type Value = StrategyEntry;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table: a preset and axes")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<StrategyEntry, A::Error> {
                let mut entry = StrategyEntry::default();
                while let Some(key) = map.next_key::<Spanned<String>>()? {
                    match key.get_ref().as_str() {
                        "name" => entry.name = Some(map.next_value()?),
                        "preset" => entry.preset = Some(map.next_value()?),
                        "local_sizes" => entry.local_sizes = Some(map.next_value()?),
                        "any_kind" => entry.any_kind = map.next_value()?,
                        axis if AXES.iter().any(|info| info.name == axis) => {
                            let choices = map.next_value()?;
                            entry.axes.push((key, choices));
                        }
                        _ => {
                            map.next_value::<IgnoredAny>()?;
                            entry.unknown.push(key);
                        }
                    }
                }
                Ok(entry)
            }
        }
        deserializer.deserialize_map(EntryVisitor)
    }
}

fn elements<'de, A: SeqAccess<'de>, T: Deserialize<'de>>(seq: &mut A) -> Result<Vec<T>, A::Error> {
    let mut list = Vec::new();
    while let Some(element) = seq.next_element()? {
        list.push(element);
    }
    Ok(list)
}
