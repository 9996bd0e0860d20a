//! `raycl render`: a picture of a scene, now.

mod judge;
mod report;
mod split;

use super::choice::{
    StrategyText, is_axis, one_device, parse_assignment, parse_size, parse_strategy, refuse_misspelt_axis,
};
use super::turn::hold;
use super::watch::{RecursiveMode, watch};
use crate::device::Device;
use crate::error::{Error, Result};
use crate::image::{Radiance, check_target, save};
use crate::launch::{FrameTimes, Prepared, Queue, Refused, Session};
use crate::measure::Summary;
use crate::memory::peak_bytes;
use crate::output::{Choice, Target};
use crate::program::Sources;
use crate::record::dirty_program;
use crate::scene::{Loaded, load_scene_with};
use crate::strategy::{Strategy, Traversal, fastest};
use judge::{check, refuse_not_finite};
use report::Report;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Arguments of `raycl render`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl render scenes/teapot.toml -o teapot.png
  raycl render bunny.obj -o bunny.exr --width 1920 --height 1080
  raycl render scenes/teapot.toml --strategy naive --local-size 8x8 --repeat 20
  raycl render scenes/teapot.toml --set camera.position='[0, 1, 1]' --set width=4
  raycl render dragon.obj --width 16384 --height 16384 --devices nvidia --repeat 10
  raycl render scenes/gourd.toml --json --repeat 10 | jq .frame_rays_per_s

`raycl strategies` lists presets and axes, `raycl devices` the devices.")]
pub struct Args {
    /// A scene TOML or an OBJ file
    scene: PathBuf,
    /// Where to save the picture: .png, .jpg, .exr or .hdr [default: the scene's name, .png]
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Replace a file that raycl did not make, or that was changed since
    #[arg(long)]
    force: bool,
    /// Pixels across
    #[arg(long, default_value_t = 1280, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=65536))]
    width: u32,
    /// Pixels down
    #[arg(long, default_value_t = 800, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=65536))]
    height: u32,
    /// A word of the device's name, platform or vendor, or cpu or gpu [default: the most capable one]
    #[arg(long)]
    device: Option<String>,
    /// Cast the frame on all devices that this means, a band of its rows on each: all, gpu, a word of their name
    #[arg(long, value_name = "NAME", conflicts_with_all = ["device", "watch"])]
    devices: Option<String>,
    /// A preset, axes, or both: naive; deferred,width=4 [default: the fastest for the device]
    #[arg(long, value_parser = StrategyText, hide_possible_values = true)]
    strategy: Option<String>,
    /// Work-items of a work-group
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    local_size: Option<[u32; 2]>,
    /// Change an axis of the strategy or a value of the scene
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse_assignment)]
    set: Vec<(String, String)>,
    /// Cast the frame this many times and give medians
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    repeat: u32,
    /// With --repeat, end at once where another process measures on the device, instead of waiting for it
    #[arg(long)]
    no_wait: bool,
    /// Compare the picture with the serial reference; exit 1 where it is wrong
    #[arg(long)]
    verify: bool,
    /// Render again whenever the scene's folder, or a kernel of --cl-dir, changes; Ctrl-C ends it
    #[arg(long, conflicts_with = "json")]
    watch: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Print nothing but errors
    #[arg(short, long)]
    quiet: bool,
    /// Use the kernels of this folder instead of those built in
    #[arg(long, value_name = "DIR")]
    cl_dir: Option<PathBuf>,
}

/// Renders one picture, or with `--watch` one after every change.
pub fn run(args: Args) -> Result<()> {
    if let Some(devices) = &args.devices {
        return split::run(&args, devices);
    }
    if !args.watch {
        return render(&args);
    }
    let folder = args.scene.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut folders = vec![(folder.unwrap_or(Path::new(".")).to_owned(), RecursiveMode::NonRecursive)];
    folders.extend(args.cl_dir.clone().map(|folder| (folder, RecursiveMode::Recursive)));
    watch(&folders, || render(&args))
}

fn render(args: &Args) -> Result<()> {
    let start = Instant::now();
    let target = target(args);
    check_target(&target)?;
    let sources = Sources::of(args.cl_dir.clone())?;
    let Opened { loaded, device, queue, load_ms, discover_ms } = open(args, &sources)?;
    let Loaded { scene, notes } = loaded;
    let scene = Arc::new(scene);
    let (strategy, local_size) = strategy(args, &device, scene.mesh.triangles.len())?;
    let session = Session::new(queue, &device.info, &sources, Arc::clone(&scene)).verifying(args.verify);
    let prepared = prepare(args, session, &strategy, local_size);
    let prepared = prepared.map_err(|refused| refused.into_error(&device.info.name))?;
    let cast = cast(args, &device, &prepared)?;
    let (saved, save_ms) = timed(|| save(&cast.image, scene.display, &target));
    saved?;
    refuse_not_finite(&cast.image, target.path())?;
    let verified =
        args.verify.then(|| check(&scene, (&cast.image, cast.hits), &strategy, target.path())).transpose()?;
    let report = Report {
        load_ms,
        discover_ms,
        save_ms,
        total_ms: ms_since(start),
        frames: args.repeat,
        host_bytes: prepared.host_bytes,
        device_bytes: prepared.device_bytes(),
        peak_bytes: peak_bytes(),
        verified,
        output: target.path().display().to_string(),
        notes: notes.into_iter().chain(dirty_program()).collect(),
        ..Report::of(&scene, &device, &strategy, &prepared, &cast)
    };
    match (args.json, args.quiet) {
        (true, _) => super::print_json(&report),
        (false, true) => Ok(()),
        (false, false) => super::print(report.text(&device.info)),
    }
}

/// A scene and an open device.
struct Opened {
    loaded: Loaded,
    device: Device,
    queue: Queue,
    load_ms: f64,
    discover_ms: f64,
}

/// Loads the scene while the drivers start, which takes them some 30 ms on one core.
fn open(args: &Args, sources: &Sources) -> Result<Opened> {
    // The driver stays on the thread that casts: not every one may be moved (Oclgrind's checks crash).
    std::thread::scope(|scope| {
        let scene = scope.spawn(|| timed(|| load_scene_with(&args.scene, &scene_overrides(args)?)));
        let (opened, open_ms) = timed(|| -> Result<_> {
            let device = one_device(args.device.as_deref(), sources)?;
            let queue = Queue::open(device.platform, device.device)?;
            Ok((device, queue))
        });
        let (loaded, load_ms) = scene.join().map_err(|_| Error::fault("reading the scene panicked"))?;
        let (loaded, (device, queue)) = (loaded?, opened?);
        // What loading hides of it took no time.
        let discover_ms = (open_ms - load_ms).max(0.0);
        Ok(Opened { loaded, device, queue, load_ms, discover_ms })
    })
}

/// Builds and uploads. Where the local size is free, as many tiles share a work-group as fit.
fn prepare(
    args: &Args,
    mut session: Session,
    strategy: &Strategy,
    [across, mut down]: [u32; 2],
) -> std::result::Result<Prepared, Refused> {
    let may_shrink = strategy.shares_tiles() && args.local_size.is_none();
    loop {
        match session.prepare(strategy, [args.width, args.height], [across, down]) {
            Err(Refused::Device(_)) if may_shrink && down > 1 => down /= 2,
            other => return other,
        }
    }
}

/// What `work` gives, and how long it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, ms_since(start))
}

/// Where the picture goes: under the scene's name unless told.
fn target(args: &Args) -> Target {
    let default = || PathBuf::from(args.scene.file_stem().unwrap_or_default()).with_extension("png");
    let choice = Choice { force: args.force, elsewhere: "-o FILE" };
    Target::new(args.output.clone().unwrap_or_else(default), choice)
}

fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// The `--set`s that mean the scene, their values read as TOML where they are TOML and as text otherwise.
fn scene_overrides(args: &Args) -> Result<Vec<(String, toml::Value)>> {
    let of_scene = || args.set.iter().filter(|(key, _)| !is_axis(key));
    of_scene().try_for_each(|(key, _)| refuse_misspelt_axis(key))?;
    let value = |text: &str| {
        let parsed: Option<toml::Table> = toml::from_str(&format!("value = {text}")).ok();
        parsed.and_then(|mut table| table.remove("value")).unwrap_or_else(|| text.into())
    };
    Ok(of_scene().map(|(key, text)| (key.clone(), value(text))).collect())
}

/// The strategy and local size asked for, or the fastest for the device.
fn strategy(args: &Args, device: &Device, triangles: usize) -> Result<(Strategy, [u32; 2])> {
    let pixels = args.width as usize * args.height as usize;
    let (best, best_local) = fastest(&device.info.limits, triangles, pixels)?;
    let mut strategy = match &args.strategy {
        Some(text) => parse_strategy(text)?,
        None => best,
    };
    for (axis, value) in args.set.iter().filter(|(key, _)| is_axis(key)) {
        strategy.set(axis, value)?;
    }
    strategy.check()?;
    // A tile is work enough for a work-group.
    let tiles = strategy.traversal == Traversal::Tile;
    let usual = if strategy == best {
        best_local
    } else {
        strategy.local_size(&device.info.limits, if tiles { [1, 1] } else { [8, 8] })
    };
    Ok((strategy, args.local_size.unwrap_or(usual)))
}

/// A cast frame and what it took.
struct Cast {
    image: Radiance,
    hits: usize,
    times: FrameTimes,
    build_ms: f64,
    records_ms: f64,
    read_ms: f64,
}

/// The first frame pays for memory that is touched, and often for code that is compiled, for the first time: it
/// is timed only where it took longer than this, beside which neither counts.
const LONG_FRAME_MS: f64 = 1000.0;

fn cast(args: &Args, device: &Device, prepared: &Prepared) -> Result<Cast> {
    let refused = |refused: Refused| refused.into_error(&device.info.name);
    let caster = prepared.caster().map_err(refused)?;
    // A picture alone disturbs, but it is no measurement: it never waits.
    let _held = (args.repeat > 1).then(|| hold(&[&device.info], args.no_wait)).transpose()?;
    let frame = || caster.cast().map_err(Refused::at("the launch")).map_err(refused);
    let first = frame()?;
    // Some drivers compile a kernel when it is first launched: that is build time too.
    let build_ms = prepared.program.build_ms + (first.host_ms - first.frame_ms).max(0.0);
    let mut frames: Vec<_> = Some(first).filter(|first| first.frame_ms > LONG_FRAME_MS).into_iter().collect();
    while frames.len() < args.repeat as usize {
        frames.push(frame()?);
    }
    let (read, read_ms) = timed(|| caster.read());
    let (image, hits) = read.map_err(Refused::at("reading the image")).map_err(refused)?;
    let records_ms = caster.records_ms().unwrap_or(0.0);
    Ok(Cast { image, hits, times: medians(&frames), build_ms, records_ms, read_ms })
}

fn medians(frames: &[FrameTimes]) -> FrameTimes {
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
