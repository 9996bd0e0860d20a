//! The strategy that the user names with `--strategy` and `--set`, or that raycl chooses.

use super::set_keys::is_axis;
use crate::device::DeviceLimits;
use crate::error::{Error, Result};
use crate::strategy::{AXES, Axis as _, Intersector, PRESETS, Strategy, Task, fastest, preset, preset_names};
use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use std::ffi::OsStr;

/// A parser for clap that accepts any text; [`parse_strategy`] parses the text later. This parser also tells
/// clap the names of the presets, so that shells can complete these names.
#[derive(Clone)]
pub struct StrategyText;

impl TypedValueParser for StrategyText {
    type Value = String;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> std::result::Result<String, clap::Error> {
        StringValueParser::new().parse_ref(command, argument, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(PRESETS.iter().map(|preset| PossibleValue::new(preset.name).help(preset.about))))
    }
}

/// Parses the text of a strategy: a preset (`naive`), values of axes (`vectors=local`), or both (`deferred,width=4`).
/// As in the names of records, a `+` may stand for a comma. Without a preset, the values of the axes change the preset
/// `deferred`. Returns an error in four cases: the text names neither a preset nor an axis; a part after the first has
/// no `=`; a preset, an axis or a value is unknown; or an axis has two values. Does not check whether the values
/// contradict each other.
pub fn parse_strategy(text: &str) -> Result<Strategy> {
    let parts: Vec<&str> = text.split([',', '+']).map(str::trim).filter(|part| !part.is_empty()).collect();
    let (named, axes) = match parts.split_first() {
        Some((first, rest)) if !first.contains('=') => (Some(*first), rest),
        Some(_) => (None, &parts[..]),
        None => return Err(no_strategy(text)),
    };
    let mut strategy = preset(named.unwrap_or("deferred"))?.strategy;
    for (index, part) in axes.iter().enumerate() {
        let (axis, value) = part.split_once('=').ok_or_else(|| no_axis(part, named, axes))?;
        strategy.set(axis.trim(), value.trim())?;
        let is_same =
            |other: &&&str| other.split_once('=').is_some_and(|(name, _)| name.trim() == axis.trim());
        if let Some(before) = axes[..index].iter().find(is_same) {
            let message = format!("the strategy sets the axis '{}' twice: {before} and {part}", axis.trim());
            return Err(Error::input(message).with_help("give each axis one value"));
        }
    }
    Ok(strategy)
}

/// Returns the error for `part`, a part of a strategy's text that should have the form `axis=value` but has
/// no `=`. `named` is the preset at the beginning of the text, if there is one, and `axes` are all parts of
/// the text except this preset. The advice depends on `part`. If `part` is a second preset, the advice says
/// that a strategy has only one preset. If `part` is a preset but the text begins with none, the advice is to
/// write `part` at the beginning. If `part` is the name of an axis, the advice lists the values of this axis.
/// If `part` is neither a preset nor an axis, the advice shows the form of a strategy's text.
fn no_axis(part: &str, named: Option<&str>, axes: &[&str]) -> Error {
    let error = Error::input(format!("'{part}' in the strategy does not have the form axis=value"));
    error.with_help(match (preset(part), named) {
        (Ok(_), Some(first)) => format!(
            "a strategy has only one preset, but '{part}' is a second one: leave out one of the two. Only `raycl compile` takes several strategies, each with an option of its own: --strategy {first} --strategy {part}"
        ),
        (Ok(_), None) => {
            // Besides `part`, the suggested strategy has only the parts with `=`: a part without `=` is another preset
            // or a mistake.
            let others: Vec<&str> = axes.iter().copied().filter(|other| other.contains('=')).collect();
            format!("name the preset first: {part},{}", others.join(","))
        }
        (Err(_), _) => match AXES.iter().find(|axis| axis.name == part) {
            Some(axis) => {
                let values: Vec<_> = axis.values().into_iter().map(|(value, _)| value).collect();
                format!("give the axis a value: {part} = {}", values.join(" or "))
            }
            None => {
                "name at most one preset, then axes with their values: deferred,width=4".to_owned()
            }
        },
    })
}

/// Returns the error for a text that names no strategy. In most cases, the text is empty because the user wrote a shell
/// variable that is not set.
fn no_strategy(text: &str) -> Error {
    Error::input(format!("'{text}' names no strategy: it has neither a preset nor the value of an axis")).with_help(
        "name a preset (naive), values of axes (width=4), or both (deferred,width=4); `raycl strategies` lists them",
    )
}

/// Returns a strategy and its local size. `text` names the strategy, and `set` has the keys and values of the options
/// `--set`. Without `text`, the function [`fastest`] chooses the strategy for a device with these `limits` and for
/// `task` (the properties of the scene and the picture that matter for the choice). If `set` requests the watertight
/// ray-triangle test, the function [`fastest`] chooses a strategy with this test. Finally, each axis that `set` names
/// gets its value in `set`. If the strategy that [`fastest`] chose does not allow the values in `set`, the error's
/// advice is to name another strategy or, if no preset allows these values, to change one of the values.
pub fn chosen_strategy(
    text: Option<&str>,
    set: &[(String, String)],
    limits: &DeviceLimits,
    task: Task,
) -> Result<(Strategy, [u32; 2])> {
    let asked =
        |(key, value): &(String, String)| key == "intersector" && value == Intersector::WATERTIGHT.name();
    let task = Task { watertight: task.watertight || set.iter().any(asked), ..task };
    let (best, best_local) = fastest(limits, &task)?;
    let strategy = requested_strategy(text, set, best)?;
    strategy.check().map_err(|error| match text {
        None if best.check().is_ok() => error.with_help(another_strategy(&best, set)),
        _ => error,
    })?;
    if strategy == best {
        return Ok((strategy, best_local));
    }
    Ok((strategy, strategy.usual_local_size(limits)))
}

/// Returns the advice in the error message if `chosen`, the strategy that raycl chose, does not allow the
/// values in `set` (the values of `--set`). `chosen` may differ from every preset, for example in its width, so the
/// advice names the preset that is most similar to `chosen`. The advice also names a preset that allows the values in
/// `set`: `deferred`, if possible. If no preset allows the values in `set`, the advice is to change these values.
fn another_strategy(chosen: &Strategy, set: &[(String, String)]) -> String {
    let own = chosen.axes();
    let differences =
        |strategy: &Strategy| strategy.axes().into_iter().filter(|axis| !own.contains(axis)).count();
    let name = PRESETS
        .iter()
        .min_by_key(|preset| differences(&preset.strategy))
        .map_or("a strategy", |preset| preset.name);
    let allows = |name: &&str| {
        requested_strategy(Some(*name), set, *chosen).is_ok_and(|strategy| strategy.contradiction().is_none())
    };
    match ["deferred"].into_iter().chain(preset_names()).find(allows) {
        Some(other) => format!(
            "raycl chose {name} for this device; name another strategy with --strategy, such as `--strategy {other}`"
        ),
        None => format!(
            "raycl chose {name} for this device, and no preset allows these values of --set: change one of these values; `raycl strategies` lists the values of each axis"
        ),
    }
}

/// Returns the strategy that `text` names, or `otherwise` if there is no text. Each axis that `set` names gets its
/// value in `set`.
pub fn requested_strategy(
    text: Option<&str>,
    set: &[(String, String)],
    otherwise: Strategy,
) -> Result<Strategy> {
    let mut strategy = text.map_or(Ok(otherwise), parse_strategy)?;
    for (axis, value) in set.iter().filter(|(key, _)| is_axis(key)) {
        strategy.set(axis, value)?;
    }
    Ok(strategy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_watertight_test_that_is_set_takes_the_fastest_watertight_strategy() {
        let limits = crate::device::EXAMPLE_LIMITS;
        let of = |watertight| fastest(&limits, &Task { watertight, ..Task::default() }).unwrap();
        let set = [("intersector".to_owned(), Intersector::WATERTIGHT.name().to_owned())];
        let chosen = chosen_strategy(None, &set, &limits, Task::default()).unwrap();
        assert_eq!(chosen, of(true));
        // The chosen strategy differs from the fastest strategy not only in the ray-triangle test, but also in another
        // axis.
        assert_ne!(Strategy { intersector: Intersector::WATERTIGHT, ..of(false).0 }, chosen.0);
    }

    #[test]
    fn a_test_that_is_set_and_is_not_watertight_changes_only_the_test_of_the_fastest_strategy() {
        let limits = crate::device::EXAMPLE_LIMITS;
        let (best, _) = fastest(&limits, &Task::default()).unwrap();
        let set = [("intersector".to_owned(), Intersector::MOLLER_TRUMBORE.name().to_owned())];
        let (chosen, _) = chosen_strategy(None, &set, &limits, Task::default()).unwrap();
        assert_eq!(chosen, Strategy { intersector: Intersector::MOLLER_TRUMBORE, ..best });
    }

    #[test]
    fn strategies() -> Result<()> {
        assert_eq!(parse_strategy("naive")?, preset("naive")?.strategy);
        let mut wide = preset("deferred")?.strategy;
        wide.set("width", "4")?;
        assert_eq!(parse_strategy("deferred,width=4")?, wide);
        assert_eq!(parse_strategy("deferred+width=4")?, wide, "the name in tables and records");
        assert_eq!(parse_strategy("width=4")?, wide);
        for (text, help) in [
            ("deferred,4", "name at most one preset, then axes with their values"),
            ("width=4,4", "name at most one preset, then axes with their values"),
            ("wide,width", "give the axis a value: width = 1 or 2 or 4"),
            ("width=4,culling", "give the axis a value: culling = none or back"),
            ("naive,local-vectors", "a strategy has only one preset, but 'local-vectors' is a second one"),
            ("width=4,naive", "name the preset first: naive,width=4"),
            ("width=4,naive,culling=none", "name the preset first: naive,width=4,culling=none"),
            ("width=4,naive,wide", "name the preset first: naive,width=4"),
        ] {
            let error = parse_strategy(text).expect_err(text);
            assert!(error.to_string().contains("does not have the form axis=value"), "{error}");
            assert!(error.remedy().starts_with(help), "{}", error.remedy());
            if let Some(named) = error.remedy().strip_prefix("name the preset first: ") {
                assert!(parse_strategy(named).is_ok(), "{named}");
            }
        }
        for text in ["deferred,width=4,width=8", "width=4, width = 8"] {
            let error = parse_strategy(text).expect_err(text);
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains("the axis 'width' twice: width=4 and width"), "{error}");
        }
        for empty in ["", " ", ","] {
            let error = parse_strategy(empty).expect_err(empty);
            assert!(error.exit_code() == 2 && error.to_string().contains("names no strategy"), "{error}");
        }
        Ok(())
    }

    #[test]
    fn a_named_strategy_is_changed_by_set_and_has_groups_of_8_by_8_unless_it_casts_tiles() {
        let limits = crate::device::EXAMPLE_LIMITS;
        let chosen = |name: &str, set: &[(String, String)]| {
            chosen_strategy(Some(name), set, &limits, Task::default()).unwrap()
        };
        let wide = [("width".to_owned(), "4".to_owned())];
        assert_eq!(chosen("deferred", &wide), (parse_strategy("deferred,width=4").unwrap(), [8, 8]));
        assert_eq!(chosen("tile", &[]).1, [1, 1]);
    }

    #[test]
    fn an_axis_that_the_chosen_strategy_does_not_allow_needs_a_named_strategy() {
        let gpu = DeviceLimits {
            lane_operations: crate::device::LaneOperations::Ptx,
            ..crate::device::EXAMPLE_LIMITS
        };
        let cpu = DeviceLimits { is_cpu: true, native_width: 16, ..crate::device::EXAMPLE_LIMITS };
        let wide = [("width".to_owned(), "4".to_owned())];
        // For a picture of 2^24 pixels on a GPU, raycl chooses large tiles and separate passes. No preset has
        // this combination of values.
        let task = Task::covering(1026, 1 << 24);
        for (limits, name) in [(&cpu, "tile"), (&gpu, "tile-group")] {
            let error = chosen_strategy(None, &wide, limits, task).expect_err("tiles do not have this width");
            let words = format!("raycl chose {name} for this device; name another strategy with --strategy");
            assert!(error.exit_code() == 2 && error.remedy().starts_with(&words), "{}", error.remedy());
            let named = chosen_strategy(Some(name), &wide, limits, task).expect_err("the user chose tiles");
            assert!(named.remedy().starts_with("change one of these axes"), "{}", named.remedy());
            assert!(chosen_strategy(Some("deferred"), &wide, limits, task).is_ok(), "{name}");
        }
    }

    #[test]
    fn the_strategy_that_the_remedy_names_allows_the_value_that_the_chosen_one_does_not() {
        let usual = crate::device::EXAMPLE_LIMITS;
        let gpu = DeviceLimits { lane_operations: crate::device::LaneOperations::Ptx, ..usual };
        let cpu = DeviceLimits { is_cpu: true, native_width: 16, ..usual };
        let tasks = [12, 1026].map(|triangles| Task::covering(triangles, 1 << 24));
        let cases = [usual, gpu, cpu].map(|limits| tasks.map(|task| (limits, task))).concat();
        let values = AXES.iter().flat_map(|axis| {
            axis.values().into_iter().map(move |(value, _)| (axis.name.to_owned(), value.to_owned()))
        });
        let mut named = Vec::new();
        for set in values.map(|value| [value]) {
            for (limits, task) in &cases {
                let Err(error) = chosen_strategy(None, &set, limits, *task) else { continue };
                let remedy = error.remedy();
                let name = remedy.split_once("such as `--strategy ").map(|(_, name)| name.replace('`', ""));
                let name = name.unwrap_or_else(|| panic!("{set:?}: {remedy}"));
                let other = chosen_strategy(Some(&name), &set, limits, *task);
                assert!(other.is_ok(), "{set:?}: {remedy}");
                named.push(name);
            }
        }
        for name in ["deferred", "naive", "tile"] {
            assert!(named.iter().any(|other| other == name), "{name} is not in {named:?}");
        }
    }

    #[test]
    fn values_that_no_preset_allows_are_to_be_changed() {
        let cpu = DeviceLimits { is_cpu: true, native_width: 16, ..crate::device::EXAMPLE_LIMITS };
        let set = [("traversal", "bvh"), ("tile", "8x8")];
        let set = set.map(|(axis, value)| (axis.to_owned(), value.to_owned()));
        let task = Task::covering(1026, 1 << 24);
        let error = chosen_strategy(None, &set, &cpu, task).expect_err("bvh casts no tiles");
        let words = "raycl chose tile for this device, and no preset allows these values of --set: change";
        assert!(error.exit_code() == 2 && error.remedy().starts_with(words), "{}", error.remedy());
    }

    #[test]
    fn a_chosen_strategy_that_set_changes_has_the_usual_local_size() {
        let limits = crate::device::EXAMPLE_LIMITS;
        let chosen = |set: &[(String, String)]| chosen_strategy(None, set, &limits, Task::default()).unwrap();
        let (best, best_local) = chosen(&[]);
        let (changed, local) = chosen(&[("culling".to_owned(), "back".to_owned())]);
        assert_eq!(changed, Strategy { culling: crate::strategy::Culling::Back, ..best });
        assert_eq!([best_local, local], [[16, 8], [8, 8]]);
    }
}
