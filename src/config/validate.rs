//! Checks the values that were read into the types of the module `wire`, and makes an experiment from them.

use std::ops::RangeInclusive;
use std::path::Path;

use toml::Spanned;

use super::document::Document;
use super::lists::{distinct, not_empty};
use super::numbers::{real, whole};
use super::sizes::{image_sizes, local_sizes};
use super::types::{Baseline, DeviceWord, Emulate, Experiment, Timing};
use super::{scenes, strategies, wire};
use crate::accel::WideBvh;
use crate::error::{Error, Result, meant};
use crate::printer::line;

/// The largest number of launches of a group.
pub(super) const MOST_LAUNCHES: i64 = 100;
/// The largest number of samples of a point.
pub(super) const MOST_SAMPLES: i64 = 1_000_000;

/// Returns the experiment that `wire` (the values read from the config) describes. Makes all checks that need neither a
/// device nor a loaded scene.
pub fn experiment(wire: wire::Experiment, path: &Path, document: &Document) -> Result<Experiment> {
    let mut scenes = scenes::expand(document, &wire, path)?;
    let local_sizes = local_sizes(document, &wire.local_sizes)?;
    let strategies = strategies::expand(document, &wire, &local_sizes)?;
    let baselines = baselines(document, &wire.baselines)?;
    if strategies.is_empty() && baselines.is_empty() {
        let place = document.override_of(&["strategies", "strategy", "baselines"]);
        let error = document.error(place, "there is nothing to measure", "no strategy and no baseline");
        return Err(error.with_help("add strategies = [\"naive\"]; `raycl strategies` lists the presets"));
    }
    // A scene that is too large for a tree is refused only if nothing else can be measured: if it is the only scene,
    // every strategy needs a tree, and there is no baseline. Otherwise, the points that need a tree of this scene are
    // recorded as infeasible, and the other points are measured.
    if let ([scene], []) = (&mut scenes[..], &baselines[..])
        && strategies.iter().all(|named| named.strategy.needs_tree())
    {
        scene.most_triangles = Some(WideBvh::MAX_INDEX as u64);
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let stated = |text: &Option<Spanned<String>>, key| {
        text.as_ref().map(|text| sentence(document, text, key)).transpose()
    };
    Ok(Experiment {
        path: path.to_path_buf(),
        question: stated(&wire.question, "question")?.unwrap_or_else(|| name.clone()),
        expectation: stated(&wire.expectation, "expectation")?.unwrap_or_default(),
        name,
        scenes,
        left_out: Vec::new(),
        compare_scenes: wire.compare_scenes,
        devices: devices(document, wire.devices)?,
        image_sizes: image_sizes(document, &wire.image_sizes)?,
        strategies,
        baselines,
        emulate: emulate(document, &wire.emulate)?,
        timing: timing(document, &wire.timing)?,
        source: document.text().to_string(),
        overrides: document.override_lines(),
    })
}

/// Returns a text without the white space around it. Returns an error if no text is left.
pub(super) fn sentence(document: &Document, text: &Spanned<String>, key: &str) -> Result<String> {
    let trimmed = text.get_ref().trim();
    if trimmed.is_empty() {
        let message = format!("the {key} is empty");
        return Err(document.error(text.span(), message, "expected some text"));
    }
    Ok(trimmed.to_string())
}

/// Returns an error if a strategy's name is empty, or contains a line break or another control character. Lines
/// of results contain the name, so a line break in the name could forge a line.
pub(super) fn refuse_name(document: &Document, name: &Spanned<String>) -> Result<()> {
    sentence(document, name, "name")?;
    if !name.get_ref().contains(char::is_control) {
        return Ok(());
    }
    let message = format!(
        "the name '{}' contains a control character, such as a line break or a tab",
        line(name.get_ref())
    );
    Err(document.error(name.span(), message, "expected one line of text"))
}

fn devices(document: &Document, list: Option<Spanned<Vec<Spanned<String>>>>) -> Result<Vec<DeviceWord>> {
    let Some(list) = list else { return Ok(Vec::new()) };
    not_empty(
        document,
        &list,
        "devices",
        "one word: \"all\", a kind of device, or a part of a device's name",
    )?;
    for device in list.get_ref() {
        sentence(document, device, "device")?;
    }
    let word = |device: Spanned<String>| DeviceWord {
        location: document.location_of(device.span()),
        text: device.into_inner(),
    };
    Ok(distinct(list.into_inner().into_iter().map(word).collect()))
}

fn baselines(document: &Document, list: &[Spanned<String>]) -> Result<Vec<Baseline>> {
    let names: Vec<_> = Baseline::ALL.iter().map(|baseline| baseline.name()).collect();
    let parse = |name: &Spanned<String>| {
        let known = Baseline::ALL.iter().copied().find(|baseline| baseline.name() == name.get_ref());
        known.ok_or_else(|| {
            let message =
                format!("'{}' is not a baseline; expected one of {}", name.get_ref(), names.join(", "));
            let error = document.error(name.span(), message, "no such baseline");
            match meant(name.get_ref(), names.iter().copied()) {
                Some(meant) => error.with_help(meant),
                None => error,
            }
        })
    };
    Ok(distinct(list.iter().map(parse).collect::<Result<_>>()?))
}

fn emulate(document: &Document, wire: &wire::Emulate) -> Result<Emulate> {
    let bytes = |value: &Option<Spanned<i64>>, what: &str| {
        let check = |value: &Spanned<i64>| {
            whole(document, *value.get_ref(), value.span(), what, &(0..=i64::from(u32::MAX))).map(u64::from)
        };
        value.as_ref().map(check).transpose()
    };
    Ok(Emulate {
        local_bytes: bytes(&wire.local_bytes, "local_bytes")?,
        constant_bytes: bytes(&wire.constant_bytes, "constant_bytes")?,
    })
}

/// Returns the error for a `min_samples` that is larger than `max_samples`; `None` if one of these two values is not
/// set or is out of range. If one of the two values is in the file and the other in `--set`, the error marks the value
/// in `--set`, and says where the value in the file is.
fn contradiction(document: &Document, wire: &wire::Timing) -> Option<Error> {
    let (min, max) = (wire.min_samples.as_ref()?, wire.max_samples.as_ref()?);
    if min.get_ref() <= max.get_ref() || *max.get_ref() < 1 || *min.get_ref() > MOST_SAMPLES {
        return None;
    }
    let is_of_set = |value: &Spanned<i64>| document.is_override(&value.span());
    let (min_key, max_key) = ("min_samples", "max_samples");
    let (key, value, relation, other_key, other) = match is_of_set(max) && !is_of_set(min) {
        true => (max_key, max, "less", min_key, min),
        false => (min_key, min, "larger", max_key, max),
    };
    let (here, there) = (value.get_ref(), other.get_ref());
    let message = format!("{key} {here} is {relation} than {other_key} {there}");
    let label = format!("{other_key} is {there} in {}", document.location_of(other.span()));
    let remedy = match is_of_set(value) && !is_of_set(other) {
        true => format!("set the other value, too: --set timing.{other_key}={here}"),
        false => format!("lower {min_key}, or raise {max_key}"),
    };
    Some(document.error(value.span(), message, label).with_help(remedy))
}

fn timing(document: &Document, wire: &wire::Timing) -> Result<Timing> {
    if let Some(error) = contradiction(document, wire) {
        return Err(error);
    }
    let default = Timing::default();
    let count =
        |value: &Option<Spanned<i64>>, what: &str, range: RangeInclusive<i64>, default: u32| match value {
            Some(value) => whole(document, *value.get_ref(), value.span(), what, &range),
            None => Ok(default),
        };
    let max_samples = count(&wire.max_samples, "max_samples", 1..=MOST_SAMPLES, default.max_samples)?;
    let least = default.min_samples.min(max_samples);
    let min_samples = count(&wire.min_samples, "min_samples", 1..=MOST_SAMPLES, least)?;
    Ok(Timing {
        warmup: count(&wire.warmup, "warmup", 0..=1000, default.warmup)?,
        launches: count(&wire.launches, "launches", 1..=MOST_LAUNCHES, default.launches)?,
        min_samples,
        max_samples: max_samples.max(min_samples),
        time_limit_ms: real(
            document,
            &wire.time_limit_ms,
            "time_limit_ms",
            1.0..=1e8,
            default.time_limit_ms,
        )?,
        seed: count(&wire.seed, "seed", 0..=i64::from(u32::MAX), 1)?.into(),
        relative_sigma: real(
            document,
            &wire.relative_sigma,
            "relative_sigma",
            0.0..=1.0,
            default.relative_sigma,
        )?,
    })
}
