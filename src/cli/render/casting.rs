//! Casts the frame of a picture on one device, and reads the image from the device.

use super::Args;
use super::timeline::Timeline;
use crate::cli::turn::hold;
use crate::device::Device;
use crate::error::Result;
use crate::image::{Incoming, Radiance};
use crate::launch::{Caster, FrameTimes, LaunchError, LightParts, Prepared, Refused, ShowProgram};
use crate::output::Target;
use crate::scene::{Display, SampleCounts, Sampling, Scene};

/// An image that was read from a device.
pub enum Picture {
    /// Radiance, as the device computed it.
    Radiance(Radiance),
    /// Colours in 8 bits, which arrived in bands of rows.
    Incoming(Incoming),
}

/// How an image is converted to 8 bits, and where it is saved.
pub struct Shows<'a> {
    pub display: Display,
    pub target: &'a Target,
    /// The program that converts the image on a device whose memory is separate from the host's; `None` if the host
    /// converts the image.
    pub program: Option<&'a ShowProgram>,
}

/// The times and counts of a cast frame.
pub struct Cast {
    pub hits: usize,
    pub times: FrameTimes,
    /// True if a first frame was cast before the timed frames and its time was discarded.
    pub has_untimed_frame: bool,
    pub records_ms: f64,
    pub read_ms: f64,
    /// Number of samples per pixel.
    pub sampling: Sampling,
    /// How many samples the pixels of each block got; `None` if sampling was not adaptive.
    pub counts: Option<SampleCounts>,
    /// The pictures from which the filter of soft light makes the final picture. raycl reads these input
    /// pictures of the filter from the device only if two conditions hold: soft light is cast at half
    /// resolution, and the final picture is verified.
    pub parts: Option<LightParts>,
}

impl Cast {
    /// Returns how many samples per pixel were requested. If sampling was adaptive, also returns how many samples the
    /// pixels of each block got.
    pub fn sampled(&self) -> (Sampling, Option<&SampleCounts>) {
        (self.sampling, self.counts.as_ref())
    }

    /// Returns the number of samples that pixels got on average.
    pub fn mean_samples(&self) -> f64 {
        self.counts.as_ref().map_or(f64::from(self.sampling.most), SampleCounts::mean)
    }

    /// Returns the number of primary rays and the number of shadow rays of a picture of `size`. Each hit has
    /// `per_hit` shadow rays. Soft light at half resolution needs three pictures: one of full size, and two half
    /// pictures (of half the width and height). Of these three pictures, only the half picture with shadows has
    /// shadow rays.
    pub fn rays(&self, size: [u32; 2], per_hit: usize) -> [f64; 2] {
        let [pixels, half_pixels] =
            [1, 2].map(|by| size.iter().map(|side| f64::from(side.div_ceil(by))).product::<f64>());
        let hits = self.hits as f64 * per_hit as f64;
        match f64::from(self.sampling.half_light) {
            0.0 => [pixels * self.mean_samples(), hits * self.mean_samples()],
            samples => [
                pixels * self.mean_samples() + (samples + 1.0) * half_pixels,
                hits * samples * half_pixels / pixels.max(1.0),
            ],
        }
    }
}

/// The first frame often takes longer than later frames, because the device uses its memory for the first time, and
/// may still compile kernels. If several frames are cast, the first frame's time therefore counts only if it is above
/// `LONG_FRAME_MS`: the additional time is then a negligible part of this time.
const LONG_FRAME_MS: f64 = 1000.0;

/// Returns true if the first frame counts as one of the requested frames. The first frame counts in two cases: only one
/// frame is requested, or the first frame takes longer than `LONG_FRAME_MS`.
fn counts(first: &FrameTimes, repeat: u32) -> bool {
    repeat == 1 || first.frame_ms > LONG_FRAME_MS
}

/// Casts and times the frame as often as `--repeat` says, and reads the image from the device. If the time of the first
/// frame does not count (see `counts`), one additional frame is cast. If sampling is adaptive, also reads the numbers
/// of samples. With `--verify`, if soft light is cast at half resolution, also casts and reads the pictures that
/// [`Cast::parts`] describes. If several frames are timed, this process locks the device, so that no other process
/// measures on it meanwhile.
pub fn cast(
    args: &Args,
    device: &Device,
    prepared: &Prepared,
    (scene, shows): (&Scene, Option<Shows<'_>>),
    timeline: &mut Timeline,
) -> Result<(Picture, Cast)> {
    let refused = |refused: Refused| refused.into_error(&device.info);
    let caster = prepared.caster().map_err(refused)?;
    let records_ms = caster.records_ms().unwrap_or(0.0);
    timeline.ends_with("buffers", &[("records", records_ms)]);
    // A single frame is not a measurement, so this process need not lock the device against other measuring
    // processes.
    let _held = (args.repeat > 1).then(|| hold(&[&device.info], args.no_wait)).transpose()?;
    timeline.ends("wait");
    let sampling = prepared.sampling;
    let frame = || -> Result<FrameTimes> {
        let cast = caster.cast_samples(&scene.camera, &sampling);
        cast.map_err(Refused::at("the launch")).map_err(refused)
    };
    let first = frame()?;
    // Some drivers compile a kernel when it first starts. Therefore the difference between the first frame's time on
    // the host and its device time is added to the build time.
    let compile_ms = (first.host_ms - first.frame_ms).max(0.0);
    timeline.ends_with("casting", &[("build", compile_ms)]);
    let mut frames: Vec<_> = Some(first).filter(|first| counts(first, args.repeat)).into_iter().collect();
    let has_untimed_frame = frames.is_empty();
    while frames.len() < args.repeat as usize {
        frames.push(frame()?);
    }
    timeline.ends("casting");
    let reading = Refused::at("reading the image");
    let (image, hits) = read(&caster, shows.as_ref()).map_err(&reading).map_err(refused)?;
    let counts = if sampling.is_adaptive() {
        caster.sample_counts().map_err(&reading).map_err(refused)?
    } else {
        None
    };
    timeline.ends("read");
    let parts = args.verify.map(|_| caster.cast_parts(&scene.camera, &sampling));
    let parts = parts.transpose().map_err(Refused::at("the launch")).map_err(refused)?.flatten();
    if parts.is_some() {
        timeline.ends("verify");
    }
    let read_ms = timeline.ms("read");
    let times = medians(&frames);
    Ok((image, Cast { hits, times, has_untimed_frame, records_ms, read_ms, sampling, counts, parts }))
}

/// Reads the last frame's image, and counts the pixels whose rays hit a triangle. The image has 8 bits per
/// channel if `shows` is given and all pixels are finite. If `shows` (which describes the conversion to 8
/// bits) is `None`, or if a pixel is not finite, the image contains radiance.
fn read(caster: &Caster, shows: Option<&Shows<'_>>) -> std::result::Result<(Picture, usize), LaunchError> {
    if let Some(shows) = shows
        && let Some(shown) = read_shown(caster, shows)?
    {
        return Ok(shown);
    }
    let (image, hits) = caster.read()?;
    Ok((Picture::Radiance(image), hits))
}

/// Reads the last frame's image in 8 bits, and counts the pixels whose rays hit a triangle. Returns `None` if
/// a pixel is not finite.
fn read_shown(
    caster: &Caster,
    Shows { display, target, program }: &Shows<'_>,
) -> std::result::Result<Option<(Picture, usize)>, LaunchError> {
    let mut incoming = Incoming::new(target, caster.size());
    let together = incoming.rows_together();
    let hits = caster.show(*program, *display, together, |rows| incoming.take(rows))?;
    Ok(hits.map(|hits| (Picture::Incoming(incoming), hits)))
}

/// Returns the median over `frames` of each time in [`FrameTimes`], such as the time of the primary pass. The
/// processor time is left out, because it is measured only in experiments.
pub fn medians(frames: &[FrameTimes]) -> FrameTimes {
    FrameTimes {
        frame_ms: FrameTimes::median_of(frames, |frame| Some(frame.frame_ms)).unwrap_or(0.0),
        primary_ms: FrameTimes::median_of(frames, |frame| frame.primary_ms),
        shadow_ms: FrameTimes::median_of(frames, |frame| frame.shadow_ms),
        shade_ms: FrameTimes::median_of(frames, |frame| frame.shade_ms),
        host_ms: FrameTimes::median_of(frames, |frame| Some(frame.host_ms)).unwrap_or(0.0),
        ..FrameTimes::default()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::device::discover;
    use crate::launch::{Queue, Session};
    use crate::output::Choice;
    use crate::program::{ProgramCache, Sources};
    use crate::scene::load_scene;
    use crate::strategy::preset;
    use std::path::Path;
    use std::sync::Arc;

    /// The number of bytes that the tests transfer at a time (a piece). The frame, the scene's triangles and the tree
    /// are each larger than a piece, so each of them is transferred in several pieces.
    const PIECE_BYTES: usize = 1000;

    /// Calls a function with a caster for a small picture of a scene. With `is_apart`, the device is treated as if its
    /// memory were separate from the host's, even if the device is a CPU.
    fn with_caster<T>(
        strategy: &str,
        is_apart: bool,
        work: impl FnOnce(&Caster, &ShowProgram, Display) -> T,
    ) -> T {
        with_caster_of([75, 61], strategy, is_apart, work)
    }

    fn with_caster_of<T>(
        size: [u32; 2],
        strategy: &str,
        is_apart: bool,
        work: impl FnOnce(&Caster, &ShowProgram, Display) -> T,
    ) -> T {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/still-life.toml");
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let queue = Queue::open(&device).unwrap();
        let queue = if is_apart { queue.with_separate_memory(PIECE_BYTES) } else { queue };
        let spec = ShowProgram::spec(&Sources::Embedded, &queue).unwrap();
        let show = ShowProgram::build(&queue, &spec, &ProgramCache::default(), &Sources::Embedded).unwrap();
        let mut session = Session::new(queue, &device.info, &Sources::Embedded, Arc::clone(&scene));
        let strategy = preset(strategy).unwrap().strategy;
        let prepared = session.prepare(&strategy, size, [1, 1]).map_err(|refused| refused.reason()).unwrap();
        let caster = prepared.caster().map_err(|refused| refused.reason()).unwrap();
        caster.cast().unwrap();
        work(&caster, &show, scene.display)
    }

    #[derive(clap::Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn a_cast_frame_has_its_own_times_and_a_first_launchs_rest_counts_as_compiling() {
        use clap::Parser as _;
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/still-life.toml");
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let mut session = Session::open(&device, &Sources::Embedded, Arc::clone(&scene)).unwrap();
        let strategy = preset("bvh").unwrap().strategy;
        let prepared =
            session.prepare(&strategy, [75, 61], [1, 1]).map_err(|refused| refused.reason()).unwrap();
        let cast_with = |more: &[&str]| {
            let args = Command::parse_from([&["render", "still-life.toml"], more].concat()).args;
            let mut timeline = Timeline::begin();
            let (picture, cast) = cast(&args, &device, &prepared, (&scene, None), &mut timeline).unwrap();
            assert!(matches!(picture, Picture::Radiance(_)));
            (cast, timeline)
        };
        let (cast, timeline) = cast_with(&[]);
        let compile_ms = (cast.times.host_ms - cast.times.frame_ms).max(0.0);
        assert!((timeline.ms("build") - compile_ms).abs() < 1e-9, "{} {compile_ms}", timeline.ms("build"));
        assert_eq!(cast.read_ms, timeline.ms("read"));
        assert!(cast.hits > 0 && cast.parts.is_none() && cast.counts.is_none());
        assert_eq!(timeline.ms("verify"), 0.0);
    }

    #[test]
    fn a_first_frame_warms_up_only_for_others() {
        let [short, long] = [1.0, 1001.0].map(|ms| FrameTimes::whole(ms, ms));
        assert_eq!([counts(&short, 1), counts(&short, 2), counts(&long, 2)], [true, false, true]);
    }

    #[test]
    fn what_goes_in_pieces_arrives_as_what_goes_at_once() {
        // `deferred` transfers triangles without a tree; `bvh` transfers a tree and its triangles; `tile` transfers a
        // tree, its triangles, and their surfaces in separate buffers.
        for strategy in ["deferred", "bvh", "tile"] {
            let [apart, shared] = [true, false]
                .map(|is_apart| with_caster(strategy, is_apart, |caster, _, _| caster.read().unwrap()));
            assert!(apart == shared, "{strategy}: {} hits apart, {} shared", apart.1, shared.1);
            assert!(apart.1 > 0);
        }
    }

    #[test]
    fn a_picture_that_comes_in_pieces_is_the_same_file() {
        with_caster("bvh", true, |caster, show, display| {
            let folder = tempfile::tempdir().unwrap();
            let saved = |name: &str, program: Option<&ShowProgram>| {
                let path = folder.path().join(name);
                let target = Target::new(&path, Choice::new(false, "-o FILE"));
                let shows = Shows { display, target: &target, program };
                let (picture, hits) = read(caster, Some(&shows)).unwrap();
                assert!(matches!(picture, Picture::Incoming(_)));
                super::super::save_picture(picture, display, &target).unwrap();
                (std::fs::read(path).unwrap(), hits)
            };
            for ending in ["png", "jpg"] {
                let [shown, read] = [("device", Some(show)), ("host", None)]
                    .map(|(name, program)| saved(&format!("{name}.{ending}"), program));
                assert!(
                    shown == read,
                    "{ending}: the files or the hits differ: {} hits with the device's picture, {} with the host's",
                    shown.1,
                    read.1
                );
            }
        });
    }

    #[test]
    fn a_frame_in_8_bits_is_the_same_from_the_device_and_the_host() {
        with_caster("bvh", true, |caster, show, display| {
            let [device, host] =
                [Some(show), None].map(|program| caster.read_8_bits(program, display).unwrap());
            assert!(device.is_some() && device == host);
            let (image, hits) = caster.read().unwrap();
            assert!(host == Some((crate::image::to_rgb8(&image, display), hits)));
        });
    }

    /// The host converts this picture in three pieces for a PNG, and in two for a JPEG, whose pieces consist of whole
    /// bands of rows.
    #[test]
    fn a_picture_that_the_host_converts_in_pieces_is_the_whole_picture() {
        with_caster_of([700, 500], "bvh", false, |caster, _, display| {
            let (image, hits) = caster.read().unwrap();
            let whole = crate::image::to_rgb8(&image, display);
            let folder = tempfile::tempdir().unwrap();
            let saved = |name: &str, picture: &dyn Fn(&Target) -> Picture| {
                let path = folder.path().join(name);
                let target = Target::new(&path, Choice::new(false, "-o FILE"));
                super::super::save_picture(picture(&target), display, &target).unwrap();
                image::open(path).unwrap().into_rgb8()
            };
            let in_pieces = |target: &Target| {
                let (picture, read_hits) =
                    read(caster, Some(&Shows { display, target, program: None })).unwrap();
                assert!(matches!(picture, Picture::Incoming(_)) && read_hits == hits);
                picture
            };
            let at_once = |_: &Target| Picture::Radiance(image.clone());
            assert!(saved("a.png", &in_pieces) == whole);
            assert!(saved("a.jpg", &in_pieces) == saved("b.jpg", &at_once));
            assert!(caster.read_8_bits(None, display).unwrap() == Some((whole, hits)));
        });
    }

    #[test]
    fn a_picture_of_half_the_size_has_a_pixel_for_an_odd_row_or_column() {
        let cast = Cast {
            hits: 9,
            times: FrameTimes::default(),
            has_untimed_frame: false,
            records_ms: 0.0,
            read_ms: 0.0,
            sampling: Sampling { half_light: 2, ..Sampling::ONE },
            counts: None,
            parts: None,
        };
        // Each of the 2 x 2 pixels of the half pictures adds three primary rays to the nine primary rays of
        // the whole picture, and has four shadow rays: two lights with two samples each.
        assert_eq!(cast.rays([3, 3], 2), [21.0, 16.0]);
        // Without half pictures and with four samples per pixel, the nine pixels of the picture have 36 primary rays
        // and 72 shadow rays.
        let whole = Cast { sampling: Sampling::all(4), ..cast };
        assert_eq!(whole.rays([3, 3], 2), [36.0, 72.0]);
    }

    #[test]
    fn each_time_has_its_own_median() {
        let frame = |ms: f64| FrameTimes {
            primary_ms: Some(10.0 * ms),
            shadow_ms: Some(20.0 * ms),
            shade_ms: Some(30.0 * ms),
            ..FrameTimes::whole(ms, 40.0 * ms)
        };
        let times = medians(&[5.0, 1.0, 3.0].map(frame));
        assert_eq!((times.frame_ms, times.host_ms), (3.0, 120.0));
        assert_eq!([times.primary_ms, times.shadow_ms, times.shade_ms], [30.0, 60.0, 90.0].map(Some));
    }
}
