//! `raycl render --turntable` and `--animate`: renders the frames of a turning or an animated scene as numbered
//! pictures, one animated picture, or a stream for an encoder.

mod film;
mod frames;
mod sink;
mod stage;

use super::judge::refuse_not_finite;
use super::opening::{Opened, open};
use super::{Args, last_notes};
use crate::cli::choice::whole;
use crate::clock::ms_since;
use crate::device::common_name;
use crate::error::{Error, Result};
use crate::image::Frame;
use crate::measure::median_of;
use crate::program::Sources;
use crate::shard::Asked;
use crate::words::{counted, counted_of_were};
use film::{Film, Keys};
use frames::Frames;
use serde::Serialize;
use sink::Sink;
use stage::Stage;
use std::sync::Arc;
use std::sync::mpsc::sync_channel;
use std::thread::Builder;
use std::time::Instant;

/// The frames per second if neither an option nor the scene sets them.
const USUAL_RATE: u16 = 30;

/// The heading of the options for moving pictures in the help. Every option names the heading itself: if the
/// struct had the heading, clap would also apply it to the options after the struct.
const HEADING: &str = "Moving pictures";

/// Options for moving pictures.
#[derive(Debug, clap::Args)]
pub struct Motion {
    /// Move the camera once around the centre of the scene's bounding box in FRAMES frames, 1 to 100,000. The output is
    /// numbered PNGs, an .apng, or (with `-o -`) a y4m stream for a video encoder. Not with --animate, --watch,
    /// --devices, --verify, --repeat or --layers
    #[arg(long, help_heading = HEADING, value_name = "FRAMES", group = MOVING, conflicts_with_all = STILL, value_parser = whole::<u32>(1..=100_000))]
    turntable: Option<u32>,
    /// Render the frames of the animation that the table [animation] of the scene's file describes. The output is
    /// numbered PNGs, an .apng, or (with `-o -`) a y4m stream for a video encoder. Not with --turntable,
    /// --watch, --devices, --verify, --repeat or --layers
    #[arg(long, help_heading = HEADING, group = MOVING, conflicts_with_all = STILL)]
    animate: bool,
    /// With --turntable or --animate: render only frames A to B, both included; the first frame has the number 1
    #[arg(long, help_heading = HEADING, value_name = "A..B", requires = MOVING, value_parser = frames::parse)]
    frames: Option<Frames>,
    /// With --turntable or --animate: render only one part of the frames: 3/16 is part 3 of 16. With auto, both numbers
    /// come from the program that started the processes (such as Slurm or MPI); with auto/16, only the number of the
    /// part comes from this program
    #[arg(long, help_heading = HEADING, value_name = "N/OF", requires = MOVING)]
    shard: Option<Asked>,
    /// With --turntable or --animate: frames per second of an .apng or a y4m stream, a whole number, 1 to 1000
    /// [default: with --animate, the rate of the scene's animation, if it states one; else 30]
    #[arg(long, help_heading = HEADING, requires = MOVING, value_parser = whole::<u16>(1..=1000))]
    rate: Option<u16>,
}

/// The name of the group of options that make pictures move.
pub(super) const MOVING: &str = "moving";
/// Options that conflict with `--turntable` and `--animate`. `--layers`, `--every-device` and `--no-wait`
/// conflict with `--turntable` and `--animate` too; `render.rs` declares these three conflicts.
const STILL: [&str; 4] = ["watch", "devices", "verify", "repeat"];

impl Motion {
    /// Returns true if frames are rendered instead of a single picture.
    pub fn moves(&self) -> bool {
        self.turns() || self.animates()
    }

    /// Returns true if the scene's animation is rendered.
    pub fn animates(&self) -> bool {
        self.animate
    }

    /// Returns true if the frames of a turntable are rendered.
    pub fn turns(&self) -> bool {
        self.turntable.is_some()
    }

    /// Returns the frames per second: the value of `--rate` or, without this option, the rate of the scene's
    /// animation (`of_scene`). If the animation has no rate either, returns [`USUAL_RATE`].
    fn frames_per_s(&self, of_scene: Option<u16>) -> u16 {
        self.rate.or(of_scene).unwrap_or(USUAL_RATE)
    }

    /// Returns the frames of `--frames` or, without this option, all `count` frames. With `--shard`, all
    /// processes together render the returned frames. Returns an error if `--frames` names frames after the
    /// last one.
    fn asked(&self, count: u32) -> Result<Frames> {
        self.frames.unwrap_or(Frames { first: 1, last: count }).within(count)
    }

    /// Returns the part of the frames `all` that this process renders. Returns `None` if this process has no frame,
    /// because there are fewer frames than processes. With `--shard auto`, the program that started the processes (such
    /// as Slurm or MPI) states the shard in environment variables. Returns an error if these variables state no valid
    /// shard.
    fn share(&self, all: Frames) -> Result<Option<Frames>> {
        match self.shard {
            None => Ok(Some(all)),
            Some(asked) => Ok(all.of_shard(asked.resolve(&|name| std::env::var(name).ok())?)),
        }
    }
}

/// Returns true if rendering the frames may replace a file. `frames` is the number of frames of the scene's
/// animation.
pub fn may_replace(args: &Args, frames: u32) -> bool {
    let count = args.motion.turntable.unwrap_or(frames);
    let wanted = args.motion.asked(count).and_then(|all| args.motion.share(all));
    // If this process has no frame to render, this function returns false, since nothing is written. If
    // `--frames` or `--shard` has a mistake, this function returns false, too; `run` reports the mistake
    // later.
    wanted.is_ok_and(|wanted| wanted.is_some_and(|wanted| Sink::may_replace(args, wanted, count)))
}

/// Tells the user that this process of `--shard` has no frame to render, because there are fewer frames than
/// processes.
fn nothing_to_do(args: &Args, all: Frames) -> Result<()> {
    let text = format!(
        "this shard renders nothing: there are fewer frames to render (frames {} to {}) than shards",
        all.first, all.last
    );
    match (args.json, args.quiet) {
        (true, _) => {
            crate::cli::print_json(&serde_json::json!({ "frames": 0, "skipped": 0, "notes": [text] }))
        }
        (false, true) => Ok(()),
        (false, false) => crate::cli::print(text),
    }
}

/// The report at the end of the command. With `--json`, raycl prints an object with these fields. If this process has
/// no frame to render, [`nothing_to_do`] prints an object with only the fields `frames`, `skipped` and `notes`.
#[derive(Serialize)]
struct Report {
    scene: String,
    triangles: usize,
    device: String,
    strategy: String,
    image_size: [u32; 2],
    /// Number of frames that were cast.
    frames: u32,
    /// Number of frames that were not cast, because their files existed already.
    skipped: u32,
    /// Median device time of a frame; null if no frame was cast.
    frame_ms: Option<f64>,
    /// Time from the start of [`run`] to this report.
    total_ms: f64,
    /// Number of frames that were cast, divided by the time in seconds from the first upload to the last write; null
    /// if no frame was cast.
    frames_per_s: Option<f64>,
    output: String,
    notes: Vec<String>,
}

/// Renders the requested frames. If the frames become numbered pictures, leaves out each frame whose file already
/// shows this frame.
pub fn run(args: &Args) -> Result<()> {
    let start = Instant::now();
    Sink::check(args)?;
    if let Some(all) = frames_of_others(args)? {
        return nothing_to_do(args, all);
    }
    let sources = Sources::of(args.subject.cl_dir.clone())?;
    let Opened { mut loaded, device, queue, early, tree, show, .. } = open(args, &sources)?;
    let sampling = super::sampling(args, loaded.is_bare);
    let (first, notes) = (loaded.scene.clone(), std::mem::take(&mut loaded.notes));
    let (strategy, local_size) =
        args.subject.strategy(&device.info, args.subject.task(&first, sampling.most))?;
    let mut film = Film::of(args, loaded)?;
    let all = args.motion.asked(film.count())?;
    let Some(wanted) = args.motion.share(all)? else { return nothing_to_do(args, all) };
    film.check(wanted.first, wanted.last)?;
    let sink = sink(args, &film, wanted, first.transparent)?;
    let mut keys = Keys::of(args, &film, sampling, &strategy, &sources);
    let missing = missing(&sink, wanted, (&mut film, &mut keys))?;
    let output = if missing.is_empty() { format!("{} (unchanged)", sink.name()) } else { sink.name() };
    let stage = Stage {
        args,
        device: &device,
        sources: &sources,
        queue,
        strategy,
        local_size,
        sampling,
        program: early,
        tree: tree.map(|tree| (Arc::clone(&first.mesh), tree)),
        show,
        ready: None,
    };
    let (frame_ms, seconds, closed) = cast_into(stage, sink, (&mut film, &mut keys), &missing)?;
    let frames = frame_ms.len() as u32;
    let notes = film.notes(notes).into_iter().chain(closed_early(closed, frames, missing.len()));
    let report = Report {
        scene: first.name.clone(),
        triangles: first.mesh.triangles.len(),
        device: device.info.label.clone(),
        strategy: strategy.to_string(),
        image_size: args.subject.size(),
        frames,
        skipped: wanted.len() - missing.len() as u32,
        frame_ms: median_of(&frame_ms),
        total_ms: ms_since(start),
        frames_per_s: (frames > 0).then(|| f64::from(frames) / seconds),
        output,
        notes: notes.chain(last_notes(args, &first, sampling, None)).collect(),
    };
    tell(args, &report)
}

/// Returns the requested frames of a turntable if `--shard` gives this process none of them, and `None` otherwise.
/// For an animation, returns `None`: its number of frames is known only after the scene is loaded.
fn frames_of_others(args: &Args) -> Result<Option<Frames>> {
    let Some(count) = args.motion.turntable else { return Ok(None) };
    let all = args.motion.asked(count)?;
    Ok(args.motion.share(all)?.is_none().then_some(all))
}

/// Returns the output (`Sink`) into which the frames `wanted` of a film are written. Fails if the background
/// is transparent and the output has no alpha channel.
fn sink(args: &Args, film: &Film, wanted: Frames, transparent: bool) -> Result<Sink> {
    let sink = Sink::of(args, wanted, film.count(), args.motion.frames_per_s(film.rate()))?;
    if transparent {
        sink.check_alpha()?;
    }
    Ok(sink)
}

/// Returns the numbers of the frames that are still to be cast. If the frames become numbered pictures, a frame is left
/// out if its file has the frame's key; without `--force`, a file with another key, or without a key, is an error. A
/// movie (a single file or a stream) needs all frames.
fn missing(sink: &Sink, wanted: Frames, (film, keys): (&mut Film, &mut Keys)) -> Result<Vec<u32>> {
    match sink {
        Sink::Numbered(numbered) => numbered.missing(|number| Ok(keys.key(&*film.scene(number)?, number))),
        Sink::Movie(_) => Ok(wanted.numbers().collect()),
    }
}

/// Returns a note if the reader of a stream closed the stream before all frames were written, even if all frames of a
/// short stream had been cast by then. The reader is usually an encoder that needs no more frames, so this is no error.
fn closed_early(closed: bool, cast: u32, wanted: usize) -> Option<String> {
    let were_cast = || counted_of_were(cast as usize, wanted, "frame");
    closed.then(|| format!("the reader closed the stream after {} cast", were_cast()))
}

/// Prints the report; to standard error if the frames go to standard output.
fn tell(args: &Args, report: &Report) -> Result<()> {
    let streams = args.output.as_ref().is_some_and(|output| output.as_os_str() == "-");
    crate::cli::print_report(report, || text(report), streams, (args.json, args.quiet))
}

/// Casts frames; each frame is encoded while the next one is cast. Returns the frames' device times in milliseconds,
/// the seconds from the first upload to the last write, and true if the reader of a stream closed the stream early.
/// Only the calling thread uses the driver.
fn cast_into(
    mut stage: Stage<'_>,
    sink: Sink,
    (film, keys): (&mut Film, &mut Keys),
    frames: &[u32],
) -> Result<(Vec<f64>, f64, bool)> {
    let start = Instant::now();
    let has_keys = matches!(sink, Sink::Numbered(_));
    let size = stage.args.subject.size();
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(1);
        let write = move || if frames.is_empty() { Ok(false) } else { sink.write(size, receiver) };
        let writer = Builder::new().spawn_scoped(scope, write).map_err(|error| Error::no_thread(&error))?;
        let mut times = Vec::with_capacity(frames.len());
        let mut cast = || -> Result<()> {
            for &number in frames {
                let scene = film.scene(number)?;
                let cast = stage.cast(&scene);
                let (frame, ms) = cast.map_err(|refused| refused.into_error(&stage.device.info))?;
                if let Frame::Radiance(image, _) = &frame {
                    refuse_not_finite(image, &format!("frame {number} was not written"))?;
                }
                times.push(ms);
                let key = if has_keys { keys.key(&scene, number) } else { String::new() };
                // If the thread that writes frames has failed and ended, sending fails too; the error of this
                // thread is returned below.
                if sender.send((number, key, frame)).is_err() {
                    break;
                }
            }
            Ok(())
        };
        let done = cast();
        drop(sender);
        let written = writer.join().map_err(|_| Error::fault("writing the frames panicked"))?;
        done?;
        written.map(|closed| (times, start.elapsed().as_secs_f64(), closed))
    })
}

fn text(report: &Report) -> String {
    let [width, height] = report.image_size;
    let mut lines = vec![
        format!("scene     {}: {}", report.scene, counted(report.triangles, "triangle")),
        format!("device    {}", common_name(&report.device)),
        format!("strategy  {}", report.strategy),
        format!("size      {width} x {height} pixels, {}", all_frames(report)),
    ];
    let kernel = |ms: f64| format!("kernel    {ms:10.2} ms{}", kernel_remark(report));
    lines.extend(report.frame_ms.map(kernel));
    lines.push(format!("total     {:10.2} ms", report.total_ms));
    lines.extend(report.frames_per_s.map(|rate| format!("speed     {rate:.1} frames/s")));
    lines.extend(report.notes.iter().map(|note| format!("note      {note}")));
    lines.push(format!("pictures  {}", report.output));
    lines.join("\n")
}

/// Returns the number of all frames, and how many of them existed already.
fn all_frames(report: &Report) -> String {
    let all = report.frames + report.skipped;
    let existed = match (report.skipped, report.frames) {
        (0, _) => String::new(),
        (1, 0) => ", which existed already".to_owned(),
        (_, 0) => ", all of which existed already".to_owned(),
        (skipped, _) => format!(", {skipped} of which existed already"),
    };
    counted(all as usize, "frame") + &existed
}

/// Returns a remark that the kernel's time is a median, if several frames were cast.
fn kernel_remark(report: &Report) -> &'static str {
    if report.frames > 1 { ", the median of the cast frames" } else { "" }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text_of(frames: u32, skipped: u32) -> String {
        text(&Report {
            scene: "little".to_owned(),
            triangles: 1,
            device: "a device".to_owned(),
            strategy: "naive".to_owned(),
            image_size: [48, 30],
            frames,
            skipped,
            frame_ms: (frames > 0).then_some(1.5),
            total_ms: 20.0,
            frames_per_s: (frames > 0).then_some(4.0),
            output: "a.png".to_owned(),
            notes: vec!["a remark".to_owned()],
        })
    }

    #[test]
    fn without_a_range_all_frames_are_asked_for() {
        let frames = |first, last| Frames { first, last };
        let motion = |frames| Motion { turntable: Some(9), animate: false, frames, shard: None, rate: None };
        assert_eq!(motion(None).asked(9).ok(), Some(frames(1, 9)));
        assert_eq!(motion(Some(frames(3, 5))).asked(9).ok(), Some(frames(3, 5)));
        assert!(motion(Some(frames(3, 10))).asked(9).is_err());
    }

    #[test]
    fn the_rate_is_that_of_the_option_or_of_the_scene_or_the_usual_one() {
        let motion = |rate| Motion { turntable: None, animate: true, frames: None, shard: None, rate };
        let rates = |rate| [Some(24), None].map(|of_scene| motion(rate).frames_per_s(of_scene));
        assert_eq!([rates(Some(60)), rates(None)], [[60, 60], [24, 30]]);
    }

    #[test]
    fn a_closed_stream_is_noted_even_if_all_frames_were_cast() {
        assert_eq!([closed_early(false, 2, 2), closed_early(false, 1, 1)], [None, None]);
        for (cast, wanted, were) in [(1, 5, "1 of 5 frames was"), (2, 2, "2 of 2 frames were")] {
            let expected = format!("the reader closed the stream after {were} cast");
            assert_eq!(closed_early(true, cast, wanted), Some(expected));
        }
    }

    #[test]
    fn all_frames_are_counted_and_then_those_that_existed() {
        for (frames, skipped, expected) in [
            (4, 0, "48 x 30 pixels, 4 frames\n"),
            (2, 2, "48 x 30 pixels, 4 frames, 2 of which existed already\n"),
            (0, 4, "48 x 30 pixels, 4 frames, all of which existed already\n"),
            (1, 0, "48 x 30 pixels, 1 frame\n"),
            (0, 1, "48 x 30 pixels, 1 frame, which existed already\n"),
        ] {
            let text = text_of(frames, skipped);
            assert!(text.contains(expected), "{text}");
        }
    }

    #[test]
    fn times_of_frames_are_printed_only_if_one_was_cast() {
        assert!(!text_of(0, 4).contains("kernel") && !text_of(0, 4).contains("speed"));
        assert!(text_of(1, 3).contains("1.50 ms\n") && text_of(1, 3).contains("4.0 frames/s"));
        assert!(text_of(2, 2).contains("1.50 ms, the median of the cast frames\n"));
        assert!(text_of(0, 4).ends_with("note      a remark\npictures  a.png"), "{}", text_of(0, 4));
        assert!(text_of(1, 0).contains("device    a device\nstrategy  naive\nsize"), "{}", text_of(1, 0));
    }
}
