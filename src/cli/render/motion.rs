//! `raycl render --turntable`: renders a turning scene as numbered pictures, one animated picture, or a
//! stream for an encoder.

mod frames;

use super::judge::refuse_not_finite;
use super::opening::{Opened, open};
use super::{Args, ms_since};
use crate::device::Device;
use crate::error::{Error, Result};
use crate::image::{Movie, Radiance};
use crate::launch::{Caster, Prepared, Refused};
use crate::program::Sources;
use crate::scene::{Loaded, Orbit, Sampling, Scene};
use crate::shard::Asked;
use crate::strategy::Strategy;
use frames::{Frames, Numbered};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Instant;

/// Options for moving pictures.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Moving pictures")]
pub struct Motion {
    /// Turn the scene once in this many frames: numbered PNGs, an .apng, or with `-o -` a y4m stream for an encoder
    #[arg(long, value_name = "FRAMES", conflicts_with_all = ["watch", "devices", "verify", "repeat"], value_parser = clap::value_parser!(u32).range(1..=100_000))]
    turntable: Option<u32>,
    /// Render only frames A to B, both included; the first is 1
    #[arg(long, value_name = "A..B", requires = "turntable", value_parser = frames::parse)]
    frames: Option<Frames>,
    /// Render only one of several equal parts, such as 3/16; auto takes both numbers from the launcher
    /// (Slurm, MPI), auto/16 only the first
    #[arg(long, value_name = "N/OF", requires = "turntable")]
    shard: Option<Asked>,
    /// Frames per second of an .apng or a y4m stream
    #[arg(long, default_value_t = 30, requires = "turntable", value_parser = clap::value_parser!(u16).range(1..=1000))]
    rate: u16,
}

impl Motion {
    /// Whether the scene turns.
    pub fn turns(&self) -> bool {
        self.turntable.is_some()
    }

    /// Returns the frames that this process renders.
    fn share(&self, all: Frames) -> Result<Option<Frames>> {
        match self.shard {
            None => Ok(Some(all)),
            Some(asked) => Ok(all.of_shard(asked.resolve(&|name| std::env::var(name).ok())?)),
        }
    }
}

/// Reports that there are more processes than frames, so that this one has none to render.
fn nothing_to_do(args: &Args, all: Frames) -> Result<()> {
    let text = format!("this shard has no frame of {}..{}: nothing to do", all.first, all.last);
    match (args.json, args.quiet) {
        (true, _) => {
            crate::cli::print_json(&serde_json::json!({ "frames": 0, "skipped": 0, "notes": [text] }))
        }
        (false, true) => Ok(()),
        (false, false) => crate::cli::print(text),
    }
}

/// The report at the end; the fields of `--json`.
#[derive(Serialize)]
struct Report {
    scene: String,
    triangles: usize,
    device: String,
    strategy: String,
    image_size: [u32; 2],
    /// Number of frames that were cast.
    frames: u32,
    /// Number of frames that existed already.
    skipped: u32,
    /// Median device time of a frame.
    frame_ms: f64,
    /// Time of the whole command.
    total_ms: f64,
    /// Number of frames divided by the time from the first cast to the last write.
    frames_per_s: f64,
    output: String,
    notes: Vec<String>,
}

/// The output for frames.
enum Sink {
    Numbered(Numbered),
    Movie(Movie),
}

/// Renders the requested frames that do not exist yet.
pub fn run(args: &Args) -> Result<()> {
    let start = Instant::now();
    let count = args.motion.turntable.unwrap_or(1);
    let all = args.motion.frames.unwrap_or(Frames { first: 1, last: count }).within(count)?;
    let Some(wanted) = args.motion.share(all)? else { return nothing_to_do(args, all) };
    let sink = sink(args, wanted, count)?;
    let sources = Sources::of(args.subject.cl_dir.clone())?;
    let Opened { loaded, device, queue, .. } = open(args, &sources)?;
    let sampling = super::sampling(args, loaded.dressed);
    let Loaded { scene, orbit, notes, .. } = loaded;
    if scene.transparent {
        sink.check_alpha()?;
    }
    let scene = Arc::new(scene);
    let (strategy, local_size) = args.subject.strategy(&device.info, args.subject.task(&scene))?;
    let missing = match &sink {
        Sink::Numbered(numbered) => {
            numbered.missing(&keys(args, (&scene, sampling), &strategy, wanted, count))?
        }
        Sink::Movie(_) => wanted.numbers().map(|number| (number, String::new())).collect(),
    };
    let (frames, skipped) = (missing.len() as u32, wanted.len() - missing.len() as u32);
    let mut frame_ms = Vec::new();
    let mut seconds = 0.0;
    let mut output = sink.name();
    if frames > 0 {
        let mut session =
            crate::launch::Session::new(queue, &device.info, &sources, Arc::clone(&scene)).sampling(sampling);
        let prepared = args.subject.prepare(&mut session, &strategy, local_size);
        let prepared = prepared.map_err(|refused| refused.into_error(&device.info.name))?;
        let shown = Shown { device: &device, prepared: &prepared, scene: &scene, orbit, count, sampling };
        let casting = Instant::now();
        frame_ms = shown.cast_into(sink, &missing)?;
        seconds = casting.elapsed().as_secs_f64();
    } else {
        output.push_str(" (nothing to do)");
    }
    let report = Report {
        scene: scene.name.clone(),
        triangles: scene.mesh.triangles.len(),
        device: device.info.label.clone(),
        strategy: strategy.to_string(),
        image_size: args.subject.size(),
        frames,
        skipped,
        frame_ms: crate::measure::Summary::of(&frame_ms).map_or(0.0, |summary| summary.median_ms),
        total_ms: ms_since(start),
        frames_per_s: if seconds > 0.0 { f64::from(frames) / seconds } else { 0.0 },
        output,
        notes,
    };
    let streams = args.output.as_ref().is_some_and(|output| output.as_os_str() == "-");
    match (args.json, args.quiet) {
        _ if streams => crate::cli::tell(args.quiet, text(&report)),
        (true, _) => crate::cli::print_json(&report),
        (false, true) => Ok(()),
        (false, false) => crate::cli::print(text(&report)),
    }
}

/// Chooses the output by the file's name.
fn sink(args: &Args, wanted: Frames, count: u32) -> Result<Sink> {
    let target = super::target(args);
    let ending = target.path().extension().unwrap_or_default().to_ascii_lowercase();
    let size = args.subject.size();
    if args.motion.shard.is_some() && (target.is_standard_output() || ending != "png") {
        return Err(Error::input(
            "--shard needs numbered pictures, since two processes cannot write to one file",
        )
        .with_help("name them NAME.png, which writes NAME-0001.png and so on; encoders read these"));
    }
    if target.is_standard_output() {
        return Ok(Sink::Movie(Movie::y4m(target, size, args.motion.rate)));
    }
    if ending == "apng" {
        target.check()?;
        return Ok(Sink::Movie(Movie::apng(target, size, args.motion.rate, wanted.len())));
    }
    if ending != "png" {
        let message = format!("'{}' is not a valid name for moving pictures", target.path().display());
        return Err(Error::input(message).with_help(
            "NAME.png writes NAME-0001.png and so on, NAME.apng one animated picture, `-o -` a y4m stream",
        ));
    }
    Ok(Sink::Numbered(Numbered::new(&target, args.force, wanted, count)?))
}

impl Sink {
    fn name(&self) -> String {
        match self {
            Self::Numbered(numbered) => numbered.name(),
            Self::Movie(movie) => movie.name(),
        }
    }

    /// Refuses a stream, which has no alpha channel.
    fn check_alpha(&self) -> Result<()> {
        if !matches!(self, Self::Movie(movie) if movie.is_stream()) {
            return Ok(());
        }
        let message = "a y4m stream has no alpha channel, which a transparent background needs";
        Err(Error::input(message)
            .with_help("NAME.png writes NAME-0001.png and so on, NAME.apng one animated picture"))
    }
}

/// Returns the key of each frame: a hash of the scene's content, the strategy, the angle and raycl's version.
fn keys(
    args: &Args,
    (scene, sampling): (&Scene, Sampling),
    strategy: &Strategy,
    wanted: Frames,
    count: u32,
) -> Vec<(u32, String)> {
    let (width, height, version) = (args.subject.width, args.subject.height, env!("CARGO_PKG_VERSION"));
    let Sampling { first, most } = sampling;
    let shared = format!(
        "{version} {} {strategy} {width}x{height} samples {first}-{most} turntable {count}",
        scene.content_hash()
    );
    let kernels = args.subject.cl_dir.as_ref().map(|folder| folder.display().to_string()).unwrap_or_default();
    let key =
        |number| blake3::hash(format!("{shared} {kernels} frame {number}").as_bytes()).to_hex().to_string();
    wanted.numbers().map(|number| (number, key(number))).collect()
}

/// A scene on a device, ready to be rendered from several angles.
struct Shown<'a> {
    device: &'a Device,
    prepared: &'a Prepared,
    scene: &'a Scene,
    orbit: Orbit,
    count: u32,
    /// Number of samples per pixel.
    sampling: Sampling,
}

/// A frame to be written: its number, key and image.
type Cast = (u32, String, Radiance);

impl Shown<'_> {
    /// Casts frames; each is encoded while the next one is cast. Returns their device times. The driver is
    /// only used on this thread.
    fn cast_into(&self, sink: Sink, frames: &[(u32, String)]) -> Result<Vec<f64>> {
        let refused = |refused: Refused| refused.into_error(&self.device.info.name);
        let caster = self.prepared.caster().map_err(refused)?;
        let display = self.scene.display;
        let name = PathBuf::from(sink.name());
        std::thread::scope(|scope| {
            let (sender, receiver): (SyncSender<Cast>, Receiver<Cast>) = sync_channel(1);
            let writer = scope.spawn(move || match sink {
                Sink::Numbered(numbered) => receiver
                    .iter()
                    .try_for_each(|(number, key, image)| numbered.save(number, &key, &image, display)),
                Sink::Movie(movie) => movie.write(receiver.iter().map(|(_, _, image)| image), display),
            });
            let mut times = Vec::with_capacity(frames.len());
            let mut cast = || -> Result<()> {
                for (number, key) in frames {
                    let (image, ms) = self.frame(&caster, *number).map_err(refused)?;
                    refuse_not_finite(&image, &name)?;
                    times.push(ms);
                    // If the writer has ended, its error is returned below.
                    if sender.send((*number, key.clone(), image)).is_err() {
                        break;
                    }
                }
                Ok(())
            };
            let done = cast();
            drop(sender);
            let written = writer.join().map_err(|_| Error::fault("writing the frames panicked"))?;
            done?;
            written.map(|()| times)
        })
    }

    fn frame(&self, caster: &Caster, number: u32) -> std::result::Result<(Radiance, f64), Refused> {
        let part = f64::from(number - 1) / f64::from(self.count);
        let (camera, lights) = self.orbit.at(self.scene, part);
        if lights != self.scene.lights || self.orbit.with_lights {
            self.prepared.move_lights(&lights).map_err(Refused::at("moving the lights"))?;
        }
        let cast = caster.cast_samples(&camera, &self.sampling);
        let times = cast.map_err(Refused::at("the launch"))?;
        let (image, _) = caster.read().map_err(Refused::at("reading the image"))?;
        Ok((image, times.frame_ms))
    }
}

fn text(report: &Report) -> String {
    let [width, height] = report.image_size;
    let mut lines = vec![
        format!("scene     {}: {} triangles", report.scene, report.triangles),
        format!("device    {}", report.device),
        format!(
            "size      {width} x {height} pixels, {} frames, {} of which existed already",
            report.frames, report.skipped
        ),
        format!("kernel    {:10.2} ms, the median frame", report.frame_ms),
        format!("total     {:10.2} ms", report.total_ms),
        format!("speed     {:.1} frames/s", report.frames_per_s),
    ];
    lines.extend(report.notes.iter().map(|note| format!("note      {note}")));
    lines.push(format!("pictures  {}", report.output));
    lines.join("\n")
}
