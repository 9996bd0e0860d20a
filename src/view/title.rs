//! The line of text that `raycl view` shows beside the picture.

use super::Live;
use crate::printer;
use crate::strategy::{Strategy, short_name};
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
    // Both rates are 0 until they are measured. Later, the rate of frames is 0 while nothing is cast.
    let [has_frames, has_rays] = [frames_per_s + rays_per_s, rays_per_s].map(|rate| rate > 0.0);
    let parts = [
        live.scene().name.clone(),
        short_name(&live.strategy()),
        format!("{across}x{down}"),
        if has_rays { rate(rays_per_s, "rays") } else { "- rays/s".to_owned() },
        if has_frames { format!("{frames_per_s:.0} frames/s") } else { "- frames/s".to_owned() },
        format!("{cast} of {samples} samples"),
    ];
    // The device comes last: its name may be long.
    let device = live.device_name();
    let line = first.chain(parts).chain(note).chain([device]).collect::<Vec<_>>().join(" | ");
    printer::line(&line).into_owned()
}

/// The line that is shown while raycl lists the devices, opens another device, and compiles a program for this device.
pub const OPENING: &str = "opening the next device ...";

/// Returns the line that is shown while raycl changes the strategy or the local size, or reads changed files if
/// `--cl-dir` is given. raycl may then have to compile the program of `strategy`.
pub fn compiling(strategy: &Strategy) -> String {
    printer::line(&format!("compiling {} ...", short_name(strategy))).into_owned()
}
