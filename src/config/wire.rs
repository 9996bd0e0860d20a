//! The config as TOML spells it. Numbers are wide and sizes unchecked, so that
//! `validate` can say at their place what is wrong with them.

use std::collections::BTreeMap;
use std::fmt;

use serde::Deserialize;
use serde::de::{self, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use toml::Spanned;

use crate::strategy::AXES;

/// The whole file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    pub question: Spanned<String>,
    pub expectation: Spanned<String>,
    #[serde(default)]
    pub scenes: Vec<Spanned<String>>,
    #[serde(default)]
    pub scene: Vec<SceneEntry>,
    #[serde(default)]
    pub compare_scenes: bool,
    pub devices: Option<Spanned<Vec<Spanned<String>>>>,
    pub image_sizes: Spanned<Vec<Spanned<Size>>>,
    #[serde(default)]
    pub local_sizes: Vec<Spanned<Size>>,
    #[serde(default)]
    pub strategies: Vec<Spanned<String>>,
    #[serde(default)]
    pub strategy: Vec<Spanned<StrategyEntry>>,
    #[serde(default)]
    pub any_kind: bool,
    #[serde(default)]
    pub baselines: Vec<Spanned<String>>,
    #[serde(default)]
    pub emulate: Emulate,
    #[serde(default)]
    pub timing: Timing,
}

/// A `[[scene]]`: a file, and values to set in it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneEntry {
    pub file: Spanned<String>,
    #[serde(default)]
    pub set: BTreeMap<Spanned<String>, Spanned<SceneValues>>,
}

/// One value or a list of them; a value that is a list itself stands in a list.
#[derive(Deserialize)]
#[serde(untagged)]
pub enum SceneValues {
    List(Vec<toml::Value>),
    One(toml::Value),
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Emulate {
    pub local_bytes: Option<Spanned<i64>>,
    pub constant_bytes: Option<Spanned<i64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    pub warmup: Option<Spanned<i64>>,
    pub launches: Option<Spanned<i64>>,
    pub min_samples: Option<Spanned<i64>>,
    pub max_samples: Option<Spanned<i64>>,
    pub time_limit_ms: Option<Spanned<f64>>,
    pub seed: Option<Spanned<i64>>,
    pub relative_sigma: Option<Spanned<f64>>,
}

/// `8` for 8 x 8, or `[64, 1]`.
pub enum Size {
    Square(i64),
    List(Vec<Spanned<i64>>),
}

/// A name or a number.
pub struct Choice(pub String);

/// One choice or a list of them.
pub enum Choices {
    One(String),
    List(Vec<Spanned<Choice>>),
}

/// A `[[strategy]]`: the keys below, and any axis.
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
    /// Every key it may have.
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
