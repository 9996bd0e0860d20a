//! `raycl view`: shows a scene from all around, in a window.

use super::subject::Subject;
use super::watch::{Watched, folders};
use crate::error::{Error, Result};
use crate::filetype::STANDARD_INPUT;
use crate::scene::INPUTS;
use crate::view::screen::{Graphics, Screen, Terminal, Window};
use crate::view::{Live, Total, Until, Viewer, keys};
use serde::Serialize;

/// Arguments of `raycl view`.
#[derive(Debug, clap::Args)]
#[command(after_help = after_help())]
pub struct Args {
    #[command(flatten)]
    subject: Subject,
    /// Samples per pixel that add up while nothing moves, 1 to 1024
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1024))]
    samples: u32,
    /// Show the scene in this terminal, in its size. HOW says how the terminal draws; without HOW, raycl asks
    /// the terminal
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, conflicts_with_all = ["width", "height"])]
    terminal: Option<Option<Graphics>>,
    /// Let the eye go around the scene, one degree per frame
    #[arg(long)]
    spin: bool,
    /// End after this many frames, or when all samples are cast
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// End after this many seconds
    #[arg(long, value_parser = parse_seconds)]
    seconds: Option<f64>,
    /// Print one JSON object at the end
    #[arg(long)]
    json: bool,
    /// Print nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

fn after_help() -> String {
    let keys: Vec<String> = keys::lines().map(|line| format!("  {line}")).collect();
    format!(
        "Keys:\n{}\n\nThe left button orbits, the right one pans, the wheel zooms. The scene and the kernels \
         are read again when they change.\n\nExamples:\n  raycl view scenes/teapot.toml\n  raycl view \
         bunny.obj --plain --width 1280 --height 720\n  raycl view scenes/table.toml --spin --seconds 10 \
         --json",
        keys.join("\n")
    )
}

fn parse_seconds(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("expected a positive number of seconds".to_owned()),
    }
}

/// The fields of `--json`.
#[derive(Serialize)]
struct Report {
    scene: String,
    triangles: usize,
    device: String,
    /// Every axis of the last strategy.
    strategy: String,
    /// Work-items of a work-group across and down.
    local_size: [u32; 2],
    image_size: [u32; 2],
    /// The number of frames that were shown.
    frames: u32,
    /// The time from the first frame to the last.
    seconds: f64,
    /// The number of frames after the first, divided by this time.
    frames_per_s: f64,
    /// The median device time of a frame.
    frame_ms: f64,
    /// Primary and shadow rays, divided by the device time.
    rays_per_s: f64,
}

/// Shows a scene until the user ends it.
pub fn run(args: Args) -> Result<()> {
    if args.subject.scene.as_os_str() == STANDARD_INPUT {
        return Err(Error::input("standard input cannot be watched")
            .with_help("name the scene's file instead of `-`"));
    }
    if let Some(graphics) = args.terminal {
        let terminal = Terminal::open(graphics)?;
        let [width, height] = terminal.size();
        let subject = Subject { width, height, ..args.subject };
        return show(Args { subject, ..args }, terminal);
    }
    let title = format!("raycl {}", args.subject.scene.display());
    let window = Window::open(&crate::printer::line(&title), args.subject.size())?;
    show(args, window)
}

fn show(args: Args, screen: impl Screen) -> Result<()> {
    let Args { subject, samples, spin, frames, seconds, json, quiet, .. } = args;
    let mut watched = Watched::new(&folders(&subject.scene, subject.cl_dir.as_deref()), &[], &INPUTS)?;
    let viewer = Viewer::new(Live::open(subject, samples)?, screen, spin);
    let (live, total) = viewer.run(Until { frames, seconds }, || watched.has_changed())?;
    let report = report(&live, total);
    match (json, quiet) {
        (true, _) => super::print_json(&report),
        (false, true) => Ok(()),
        (false, false) => super::print(text(&report)),
    }
}

fn report(live: &Live, total: Total) -> Report {
    let Total { frames, seconds, frames_per_s, frame_ms, rays_per_s } = total;
    Report {
        scene: live.scene().name.clone(),
        triangles: live.scene().mesh.triangles.len(),
        device: live.device().label.clone(),
        strategy: live.strategy().to_string(),
        local_size: live.local_size(),
        image_size: live.size(),
        frames,
        seconds,
        frames_per_s,
        frame_ms,
        rays_per_s,
    }
}

fn text(report: &Report) -> String {
    let ([width, height], [x, y]) = (report.image_size, report.local_size);
    [
        format!("scene     {}: {} triangles", report.scene, report.triangles),
        format!("device    {}", report.device),
        format!("strategy  {}", report.strategy),
        format!("size      {width} x {height} pixels, local size {x} x {y}"),
        format!("kernel    {:10.2} ms, the median of {} frames", report.frame_ms, report.frames),
        format!(
            "speed     {:.1} frames/s, {}",
            report.frames_per_s,
            crate::words::rate(report.rays_per_s, "rays")
        ),
    ]
    .join("\n")
}
