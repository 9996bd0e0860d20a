//! The strategies of a config: presets by name, and the strategies of `[[strategy]]` entries.

use std::ops::Range;

use toml::Spanned;

use super::document::Document;
use super::sizes::local_sizes;
use super::types::NamedStrategy;
use super::validate::refuse_name;
use super::wire::{self, Choices, StrategyEntry};
use crate::device::DeviceKind;
use crate::error::Result;
use crate::strategy::{AXES, Preset, Strategy, preset};

/// The position in a config at which the key `local_sizes` applies to every strategy without local sizes of its own.
const TOP: &str = "at the top of the experiment's file";

/// A variant of a preset, which has no name yet. A variant begins as a copy of the preset of a `[[strategy]]` entry,
/// and then gets the values of the entry, axis by axis.
#[derive(Clone)]
struct Variant {
    strategy: Strategy,
    /// The axes that differ from the preset, or that have several values in the `[[strategy]]` entry, as
    /// `axis=value`. The strategy's name contains these axes, unless the entry sets a name (see [`full_name`]).
    named_axes: Vec<String>,
}

/// Returns every strategy of the config: first the presets of `strategies`, then the strategies of the
/// `[[strategy]]` entries. Returns an error if two strategies have the same name, or if a strategy has no
/// local sizes.
pub fn expand(
    document: &Document,
    config: &wire::Experiment,
    sizes: &[[u32; 2]],
) -> Result<Vec<NamedStrategy>> {
    let mut all: Vec<NamedStrategy> = Vec::new();
    let mut add = |strategies: Vec<NamedStrategy>, span: Range<usize>, position: &str| {
        for strategy in strategies {
            if all.iter().any(|other| other.name == strategy.name) {
                let message = format!("two strategies have the name '{}'", strategy.name);
                let error = document.error(span, message, "the second is here");
                return Err(error.with_help("rename one of the two with name = \"...\", or remove one"));
            }
            if strategy.local_sizes.is_empty() {
                let message = format!("strategy '{}' has no local sizes", strategy.name);
                let error = document.error(span, message, "a strategy without a local size would never run");
                let setting = "set local_sizes = [8, 16] (8 x 8 and 16 x 16 work-items)";
                return Err(error.with_help(format!("{setting} {position}")));
            }
            all.push(strategy);
        }
        Ok(())
    };
    for name in &config.strategies {
        let preset = find(document, name)?;
        add(vec![whole_preset(preset, sizes, meant_for(document, config, name))], name.span(), TOP)?;
    }
    let in_entry = format!("in this [[strategy]] table, or {TOP}");
    for entry in &config.strategy {
        add(product(document, config, entry, sizes)?, entry.span(), &in_entry)?;
    }
    Ok(all)
}

/// Returns the only kind of device on which the preset `name` is measured. Returns `None` if the preset is measured on
/// every kind of device. A preset is measured on every kind of device in three cases: the preset is meant for every
/// kind, the config has `any_kind = true`, or `--set` names the preset. Also returns `None` if there is no such preset.
fn meant_for(document: &Document, config: &wire::Experiment, name: &Spanned<String>) -> Option<DeviceKind> {
    let any = config.any_kind || document.is_override(&name.span());
    find(document, name).ok().filter(|_| !any)?.meant_for
}

fn find(document: &Document, name: &Spanned<String>) -> Result<&'static Preset> {
    preset(name.get_ref()).map_err(|error| {
        let error = match entry_instead(name.get_ref()) {
            Some(remedy) => error.with_help(remedy),
            None => error,
        };
        document.located(name.span(), error, "no such preset")
    })
}

/// Returns the remedy if the config has a strategy in the form of `--strategy`, such as `deferred,width=4`, in place of
/// a preset's name. The remedy states the keys of a `[[strategy]]` entry. Returns `None` if `text` is not a preset with
/// changed axes in this form.
fn entry_instead(text: &str) -> Option<String> {
    let parts: Vec<&str> = text.split([',', '+']).map(str::trim).filter(|part| !part.is_empty()).collect();
    let (base, axes) = match parts.split_first()? {
        (first, axes) if !first.contains('=') => (*first, axes),
        _ => ("deferred", &parts[..]),
    };
    if axes.is_empty() || preset(base).is_err() {
        return None;
    }
    let axes: Option<Vec<String>> = axes.iter().map(|part| key_of(part)).collect();
    Some(format!("in a config, write [[strategy]] with preset = {base:?} and {}", axes?.join(" and ")))
}

/// Converts `part`, a value of an axis in the form of `--strategy` (such as `width=4`), to a line of a config. Returns
/// `None` if `part` has no `=`.
fn key_of(part: &str) -> Option<String> {
    let (axis, value) = part.split_once('=')?;
    let (axis, value) = (axis.trim(), value.trim());
    Some(match value.parse::<u32>() {
        Ok(number) => format!("{axis} = {number}"),
        Err(_) => format!("{axis} = {value:?}"),
    })
}

fn whole_preset(preset: &Preset, sizes: &[[u32; 2]], meant_for: Option<DeviceKind>) -> NamedStrategy {
    NamedStrategy {
        name: preset.name.into(),
        preset: Some(preset.name.into()),
        strategy: preset.strategy,
        local_sizes: sizes.to_vec(),
        meant_for,
    }
}

/// Returns a strategy for every combination of the values in a `[[strategy]]` entry.
fn product(
    document: &Document,
    config: &wire::Experiment,
    entry: &Spanned<StrategyEntry>,
    sizes: &[[u32; 2]],
) -> Result<Vec<NamedStrategy>> {
    let span = entry.span();
    let entry = entry.get_ref();
    if let Some(key) = entry.unknown.first() {
        return Err(document.unknown_key(key.span(), key.get_ref(), &StrategyEntry::known_keys()));
    }
    if let Some(name) = &entry.name {
        refuse_name(document, name)?;
    }
    let Some(name) = &entry.preset else {
        let error = document.error(span, "this strategy has no preset", "preset = \"...\" belongs here");
        return Err(error.with_help("name the preset from which this strategy takes the value of every axis that it does not set; `raycl strategies` lists all presets"));
    };
    let preset = find(document, name)?;
    let sizes = match &entry.local_sizes {
        Some(own) => local_sizes(document, own.get_ref())?,
        None => sizes.to_vec(),
    };
    let mut variants = vec![Variant { strategy: preset.strategy, named_axes: Vec::new() }];
    for axis in AXES {
        if let Some((_, choices)) = entry.axes.iter().find(|(key, _)| key.get_ref() == axis.name) {
            variants = vary(document, axis.name, choices, variants, preset)?;
        }
    }
    let meant_for = meant_for(document, config, name).filter(|_| !entry.any_kind);
    let finish = |variant| {
        let named = named(document, entry, variant, preset, &sizes, span.clone());
        named.map(|named| NamedStrategy { meant_for, ..named })
    };
    variants.into_iter().map(finish).collect()
}

/// Returns one variant of the preset for every combination of a variant in `variants` and a value in `choices`, which
/// are values of `axis`. Returns an error if `choices` is an empty list, lists a value twice, or contains a value that
/// the axis does not have.
fn vary(
    document: &Document,
    axis: &str,
    choices: &Spanned<Choices>,
    variants: Vec<Variant>,
    preset: &Preset,
) -> Result<Vec<Variant>> {
    let (values, listed): (Vec<(&str, Range<usize>)>, bool) = match choices.get_ref() {
        Choices::One(value) => (vec![(value, choices.span())], false),
        Choices::List(list) => {
            (list.iter().map(|choice| (choice.get_ref().0.as_str(), choice.span())).collect(), list.len() > 1)
        }
    };
    if values.is_empty() {
        return Err(document.error(
            choices.span(),
            format!("'{axis}' is empty"),
            "expected at least one value",
        ));
    }
    for (at, (value, span)) in values.iter().enumerate() {
        if values[..at].iter().any(|(earlier, _)| earlier == value) {
            let message = format!("'{axis}' lists the value '{value}' twice");
            let error = document.error(span.clone(), message, "the second is here");
            return Err(error.with_help("remove one of the two"));
        }
    }
    let mut varied = Vec::new();
    for variant in variants {
        for (value, span) in &values {
            let mut variant = variant.clone();
            let set = variant.strategy.set(axis, value);
            set.map_err(|error| document.located(span.clone(), error, "no such value"))?;
            if listed || !preset.strategy.axes().contains(&(axis, value)) {
                variant.named_axes.push(format!("{axis}={value}"));
            }
            varied.push(variant);
        }
    }
    Ok(varied)
}

/// Returns the strategy that a variant of the preset describes, with its name. Fails if the strategy's combination of
/// values is not allowed.
fn named(
    document: &Document,
    entry: &StrategyEntry,
    variant: Variant,
    preset: &Preset,
    sizes: &[[u32; 2]],
    span: Range<usize>,
) -> Result<NamedStrategy> {
    if let Some(reason) = variant.strategy.contradiction() {
        let what = [&[format!("preset={}", preset.name)], variant.named_axes.as_slice()].concat().join(" ");
        let message = format!("this combination of values is not allowed: {reason}");
        let sets =
            variant.strategy.sole_remedies().into_iter().map(|(axis, value)| format!("{axis} = {value:?}"));
        let allows = match sets.collect::<Vec<_>>().join(" or ") {
            none if none.is_empty() => none,
            some => format!("{some} allows it; or "),
        };
        return Err(document.error(span, message, format!("asks for {what}")).with_help(format!(
            "{allows}change one of the axes that the message names; if lists give combinations that are not allowed, \
             write a [[strategy]] entry for each allowed combination instead"
        )));
    }
    Ok(NamedStrategy {
        name: full_name(entry, &variant, preset),
        preset: (variant.strategy == preset.strategy).then(|| preset.name.into()),
        strategy: variant.strategy,
        local_sizes: sizes.to_vec(),
        meant_for: preset.meant_for,
    })
}

/// Returns the name that the `[[strategy]]` entry sets, followed by the axes for which the entry lists
/// several values. If the `[[strategy]]` entry sets no name, returns the preset's name, followed by the axes
/// with several values and by every axis that differs from the preset.
fn full_name(entry: &StrategyEntry, variant: &Variant, preset: &Preset) -> String {
    let Some(name) = &entry.name else {
        return [&[preset.name.to_string()], variant.named_axes.as_slice()].concat().join("+");
    };
    let listed = |named_axis: &&String| {
        entry.axes.iter().any(|(axis, choices)| {
            let several = matches!(choices.get_ref(), Choices::List(list) if list.len() > 1);
            several && named_axis.starts_with(&format!("{}=", axis.get_ref()))
        })
    };
    let named_axes = variant.named_axes.iter().filter(listed).cloned();
    std::iter::once(name.get_ref().clone()).chain(named_axes).collect::<Vec<_>>().join("+")
}
