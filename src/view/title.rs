//! The line of text that `raycl view` shows beside the picture.

use super::Live;
use crate::printer;
use crate::strategy::{PRESETS, Preset, Strategy};
use crate::words::rate;

/// Returns the line: the texts in `first`, the scene, the strategy, the local size, the speeds, the samples, the note,
/// and the device. A terminal may cut the end of the line, so `first` has the texts that the user needs most.
pub fn line(
    live: &Live,
    [frames_per_s, rays_per_s]: [f64; 2],
    first: impl Iterator<Item = String>,
    note: Option<String>,
) -> String {
    let [across, down] = live.local_size();
    let [cast, samples] = live.progress();
    let parts = [
        live.scene().name.clone(),
        short(&live.strategy()),
        format!("{across}x{down}"),
        rate(rays_per_s, "rays"),
        format!("{frames_per_s:.0} frames/s"),
        format!("{cast} of {samples} samples"),
    ];
    // The device comes last: its name may be long.
    let device = live.device().common_name();
    let line = first.chain(parts).chain(note).chain([device]).collect::<Vec<_>>().join(" | ");
    printer::line(&line).into_owned()
}

/// Returns the line that is shown while the program of a strategy is compiled.
pub fn compiling(strategy: &Strategy) -> String {
    printer::line(&format!("compiling {} ...", short(strategy))).into_owned()
}

/// Returns a strategy as the option `--strategy` accepts it, in few words: the preset that differs in the fewest axes,
/// and the strategy's values of these axes, as in `deferred,width=4`.
fn short(strategy: &Strategy) -> String {
    let own = strategy.axes();
    let differing = |preset: &Preset| -> Vec<String> {
        let pairs = own.iter().zip(preset.strategy.axes());
        let others = pairs.filter(|(own, of_preset)| **own != *of_preset);
        others.map(|((axis, value), _)| format!("{axis}={value}")).collect()
    };
    let all = PRESETS.iter().map(|preset| (preset.name, differing(preset)));
    match all.min_by_key(|(_, axes)| axes.len()) {
        Some((name, axes)) => [vec![name.to_owned()], axes].concat().join(","),
        None => strategy.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::choice::parse_strategy;
    use crate::strategy::preset_of;

    #[test]
    fn a_strategy_is_named_by_the_nearest_preset_and_the_axes_that_differ() {
        for preset in PRESETS {
            assert_eq!(preset_of(&preset.strategy), Some(short(&preset.strategy).as_str()));
            let mut culls = preset.strategy;
            culls.set("culling", "back").expect("an axis");
            let text = short(&culls);
            assert_eq!(text.matches('=').count(), 1, "{text}");
            assert!(text.ends_with(",culling=back"), "{text}");
            assert_eq!(parse_strategy(&text).expect("a strategy"), culls, "{text}");
        }
    }
}
