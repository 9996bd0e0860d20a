//! `raycl strategies`: lists every axis with its values, and every preset.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Map, Value, json};

use crate::device::DeviceKind;
use crate::error::Result;
use crate::sources::Sources;
use crate::strategy::{AXES, AxisInfo, PRESETS, Preset};

/// Arguments of `raycl strategies`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl strategies
  raycl render scenes/teapot.toml --strategy naive
  raycl render scenes/teapot.toml --strategy deferred,width=4,layout=soup

In the config of an experiment, the list strategies = [\"naive\"] names presets. To change axes of a preset, add a table [[strategy]] with the preset and these axes; each axis has one value or a list of values.")]
pub struct Args {
    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
    /// A folder of kernel files, laid out like the folder cl/ of raycl's repository. The files in this folder
    /// replace the built-in kernel files of the same names. A file with a new name in the folder of an axis of
    /// strategies, such as cast/vectors/, adds a value to this axis
    #[arg(long, value_name = "DIR")]
    cl_dir: Option<PathBuf>,
}

/// Lists axes and presets.
pub fn run(args: Args) -> Result<()> {
    Sources::of(args.cl_dir)?;
    if args.json {
        return super::print_json(&json!({
            "axes": AXES.iter().map(axis_json).collect::<Vec<_>>(),
            "presets": PRESETS.iter().map(preset_json).collect::<Vec<_>>(),
        }));
    }
    super::print(text().trim_end())
}

fn axis_json(axis: &AxisInfo) -> Value {
    let value = |(name, about)| json!({ "name": name, "about": about });
    let values: Vec<_> = axis.values().into_iter().map(value).collect();
    json!({ "name": axis.name, "about": axis.about, "values": values })
}

fn preset_json(preset: &Preset) -> Value {
    let axes: Map<_, _> =
        preset.strategy.axes().into_iter().map(|(axis, value)| (axis.to_owned(), value.into())).collect();
    let meant_for = preset.meant_for.map(DeviceKind::name);
    json!({ "name": preset.name, "about": preset.about, "meant_for": meant_for, "axes": axes })
}

fn text() -> String {
    let mut text =
        "A strategy has one value on each axis. Below, \"the paper\" is the student paper whose experiments \
        raycl repeats, and \"the book\" is Computer Graphics: Principles and Practice.\n\n"
            .to_owned();
    for axis in AXES {
        text += &axis_text(axis);
    }
    let Some((first, others)) = PRESETS.split_first() else { return text };
    text += &format!(
        "Presets are named strategies. Each preset except the first is shown with only those axes in which it differs from {}.\n\n",
        first.name
    );
    text += &preset_text(first, &spelled(&first.strategy.axes()));
    for preset in others {
        text += &preset_text(preset, &spelled(&difference(first, preset)));
    }
    text
}

fn axis_text(axis: &AxisInfo) -> String {
    let values = axis.values();
    let wide = values.iter().map(|(name, _)| name.len()).max().unwrap_or_default();
    let mut text = format!("{}: {}\n", axis.name, axis.about);
    for (name, about) in values {
        // Writing to a `String` cannot fail, so the result is ignored.
        let _ = writeln!(text, "  {name:wide$}  {about}");
    }
    text + "\n"
}

fn preset_text(preset: &Preset, axes: &str) -> String {
    let kind = preset.meant_for.map(|kind| format!(" (meant for {})", kind.plural())).unwrap_or_default();
    format!("{}: {}{kind}\n  {axes}\n", preset.name, preset.about)
}

/// Returns the axes of `preset` whose values differ from those of `base`.
fn difference(base: &Preset, preset: &Preset) -> Vec<(&'static str, &'static str)> {
    let pairs = preset.strategy.axes().into_iter().zip(base.strategy.axes());
    pairs.filter(|(own, other)| own != other).map(|(own, _)| own).collect()
}

fn spelled(axes: &[(&str, &str)]) -> String {
    axes.iter().map(|(axis, value)| format!("{axis}={value}")).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_and_preset_has_its_line() {
        let text = text();
        for axis in AXES {
            assert!(text.contains(&format!("\n\n{}: {}", axis.name, axis.about)), "{}", axis.name);
            for (name, about) in axis.values() {
                assert!(
                    text.lines().any(|line| line.starts_with(&format!("  {name} ")) && line.ends_with(about))
                );
            }
        }
        for preset in PRESETS {
            assert!(text.contains(&format!("\n{}: {}", preset.name, preset.about)), "{}", preset.name);
        }
    }

    #[test]
    fn a_preset_and_the_first_differ_where_it_says() {
        for preset in PRESETS {
            let mut strategy = PRESETS[0].strategy;
            for (axis, value) in difference(&PRESETS[0], preset) {
                strategy.set(axis, value).unwrap();
            }
            assert_eq!(strategy, preset.strategy, "{}", preset.name);
        }
    }

    #[test]
    fn a_preset_is_listed_with_its_own_values() {
        let text = text();
        for preset in &PRESETS[1..] {
            let head = format!("\n{}: {}", preset.name, preset.about);
            let (_, after) = text.split_once(&head).expect(preset.name);
            let axes = after.lines().nth(1).unwrap_or_default();
            assert_eq!(axes.trim(), spelled(&difference(&PRESETS[0], preset)), "{}", preset.name);
        }
    }
}
