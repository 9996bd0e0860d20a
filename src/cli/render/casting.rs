//! Casting the frame and reading it.

use super::Args;
use super::timeline::Timeline;
use crate::cli::turn::hold;
use crate::device::Device;
use crate::error::Result;
use crate::image::Radiance;
use crate::launch::{FrameTimes, Prepared, Refused};
use crate::measure::Summary;
use crate::scene::{Display, Scene, pixel_samples};
use image::RgbImage;

/// An image as it is saved.
pub enum Picture {
    Radiance(Radiance),
    Shown(RgbImage),
}

/// A cast frame and its times.
pub struct Cast {
    pub image: Picture,
    pub hits: usize,
    pub times: FrameTimes,
    pub from_cache: bool,
    pub records_ms: f64,
    pub read_ms: f64,
    /// Samples of each pixel.
    pub samples: u32,
}

/// The first frame pays for memory that is touched, and often for code that is compiled, for the first time: it
/// is timed only where it took longer than this, beside which neither counts.
const LONG_FRAME_MS: f64 = 1000.0;

/// Casts the frame, as often as asked for, and reads the image.
pub fn cast(
    args: &Args,
    device: &Device,
    prepared: &Prepared,
    (scene, shown): (&Scene, Option<Display>),
    timeline: &mut Timeline,
) -> Result<Cast> {
    let refused = |refused: Refused| refused.into_error(&device.info.name);
    let caster = prepared.caster().map_err(refused)?;
    let records_ms = caster.records_ms().unwrap_or(0.0);
    timeline.ends_with("buffers", &[("records", records_ms)]);
    // A picture alone disturbs, but it is no measurement: it never waits.
    let _held = (args.repeat > 1).then(|| hold(&[&device.info], args.no_wait)).transpose()?;
    let samples = pixel_samples(prepared.samples);
    let mut summed = None;
    let mut frame = || -> Result<FrameTimes> {
        let launched = Refused::at("the launch");
        if samples.len() == 1 {
            return caster.cast().map_err(launched).map_err(refused);
        }
        let (image, hits, times) =
            caster.cast_samples(&scene.camera, &samples).map_err(launched).map_err(refused)?;
        summed = Some((image, hits));
        Ok(times)
    };
    let first = frame()?;
    // Some drivers compile a kernel when it is first launched: that is build time too.
    let compile_ms = (first.host_ms - first.frame_ms).max(0.0);
    timeline.ends_with("casting", &[("build", compile_ms)]);
    let mut frames: Vec<_> = Some(first).filter(|first| first.frame_ms > LONG_FRAME_MS).into_iter().collect();
    while frames.len() < args.repeat as usize {
        frames.push(frame()?);
    }
    timeline.ends("casting");
    let unreadable = Refused::at("reading the image");
    let read = || -> std::result::Result<(Picture, usize), Refused> {
        // The mean of several samples is here already.
        if let Some((image, hits)) = summed {
            return Ok((Picture::Radiance(image), hits));
        }
        let shown =
            shown.map(|display| caster.read_shown(display)).transpose().map_err(&unreadable)?.flatten();
        if let Some((picture, hits)) = shown {
            return Ok((Picture::Shown(picture), hits));
        }
        let (image, hits) = caster.read().map_err(&unreadable)?;
        Ok((Picture::Radiance(image), hits))
    };
    let (image, hits) = read().map_err(refused)?;
    timeline.ends("read");
    let from_cache = prepared.program.from_cache;
    let read_ms = timeline.ms("read");
    let (times, samples) = (medians(&frames), prepared.samples);
    Ok(Cast { image, hits, times, from_cache, records_ms, read_ms, samples })
}

/// The medians of each part.
pub fn medians(frames: &[FrameTimes]) -> FrameTimes {
    let median = |time: &dyn Fn(&FrameTimes) -> Option<f64>| {
        let times: Vec<f64> = frames.iter().filter_map(time).collect();
        Summary::of(&times).map(|summary| summary.median_ms)
    };
    FrameTimes {
        frame_ms: median(&|frame| Some(frame.frame_ms)).unwrap_or(0.0),
        primary_ms: median(&|frame| frame.primary_ms),
        shadow_ms: median(&|frame| frame.shadow_ms),
        shade_ms: median(&|frame| frame.shade_ms),
        host_ms: median(&|frame| Some(frame.host_ms)).unwrap_or(0.0),
        ..FrameTimes::default()
    }
}
