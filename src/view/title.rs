//! The line of text beside the picture.

use super::Live;
use crate::printer;
use crate::strategy::preset_of;
use crate::words::rate;

/// Returns the line: the scene, the strategy, the local size, the speeds, the samples, the texts in `more`, and the
/// device.
pub fn line(live: &Live, [frames_per_s, rays_per_s]: [f64; 2], more: impl Iterator<Item = String>) -> String {
    let [across, down] = live.local_size();
    let [cast, samples] = live.progress();
    let parts = [
        live.scene().name.clone(),
        preset_of(&live.strategy()).map_or_else(|| live.strategy().to_string(), str::to_owned),
        format!("{across}x{down}"),
        rate(rays_per_s, "rays"),
        format!("{frames_per_s:.0} frames/s"),
        format!("{cast} of {samples} samples"),
    ];
    // The device comes last: its name may be long, and a terminal cuts the line.
    let device = live.device().common_name();
    let line = parts.into_iter().chain(more).chain([device]).collect::<Vec<_>>().join(" | ");
    printer::line(&line).into_owned()
}
