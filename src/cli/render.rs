//! `raycl render`: a picture of a scene, now.

use super::choice::{is_axis, one_device, parse_assignment, parse_size, parse_strategy};
use crate::device::Device;
use crate::error::{Error, Result};
use crate::image::{Radiance, save};
use crate::launch::{Caster, DeviceScene, DeviceTree, FrameTimes, Queue};
use crate::measure::Summary;
use crate::program::{BuiltProgram, ProgramSpec, Sources};
use crate::reference::reference;
use crate::scene::{Scene, load_scene_with};
use crate::strategy::{Requirements, Strategy, Workload, fastest};
use crate::verify::verify;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments of `raycl render`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl render scenes/teapot.toml -o teapot.png
  raycl render bunny.obj -o bunny.exr --width 1920 --height 1080
  raycl render scenes/teapot.toml --strategy naive --local-size 8x8 --repeat 20
  raycl render scenes/teapot.toml --set camera.position='[0, 1, 1]' --set width=4")]
pub struct Args {
    /// A scene TOML or an OBJ file
    scene: PathBuf,
    /// Where to save the picture: .png, .jpg, .exr or .hdr [default: the scene's name, .png]
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Pixels across
    #[arg(long, default_value_t = 1280, value_parser = clap::value_parser!(u32).range(1..=65536))]
    width: u32,
    /// Pixels down
    #[arg(long, default_value_t = 800, value_parser = clap::value_parser!(u32).range(1..=65536))]
    height: u32,
    /// A word of the device's name, platform or vendor, or cpu or gpu [default: the most capable one]
    #[arg(long)]
    device: Option<String>,
    /// A preset, axes, or both: naive; deferred,width=4 [default: the fastest for the device]
    #[arg(long)]
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
    /// Compare the picture with the serial reference; exit 1 where it is wrong
    #[arg(long)]
    verify: bool,
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

/// What a render reports; its fields are those of `--json`.
#[derive(Debug, Serialize)]
struct Report {
    scene: String,
    triangles: usize,
    device: String,
    strategy: String,
    local_size: [u32; 2],
    image_size: [u32; 2],
    load_ms: f64,
    tree_ms: f64,
    build_ms: f64,
    upload_ms: f64,
    primary_ms: Option<f64>,
    shadow_ms: Option<f64>,
    frame_ms: f64,
    save_ms: f64,
    total_ms: f64,
    primary_rays_per_s: f64,
    shadow_rays_per_s: Option<f64>,
    tests_per_s: Option<f64>,
    frames: u32,
    output: String,
    notes: Vec<String>,
}

/// Renders one picture.
pub fn run(args: Args) -> Result<()> {
    let start = Instant::now();
    let size = [args.width, args.height];
    let output = args.output.clone().unwrap_or_else(|| default_output(&args));
    let loaded = load_scene_with(&args.scene, &scene_overrides(&args)?)?;
    let load_ms = ms_since(start);
    let scene = &loaded.scene;
    let device = one_device(args.device.as_deref())?;
    let (strategy, local_size) = strategy(&args, &device)?;
    let mut workload = Workload::of(scene, size, local_size);
    Requirements::check(&strategy, &workload, &device.info.limits).map_err(|infeasible| {
        Error::input(format!("{} cannot hold this: {}", device.info.name, infeasible.reason))
    })?;

    let sources = args.cl_dir.clone().map_or(Sources::Embedded, Sources::Folder);
    let cast = cast(&args, &device, scene, &strategy, &mut workload, &sources)?;
    if args.verify {
        check(scene, &cast.image, &strategy)?;
    }
    let save_start = Instant::now();
    save(&cast.image, scene.display, &output)?;
    let save_ms = ms_since(save_start);

    let pixels = f64::from(size[0]) * f64::from(size[1]);
    let primary_ms = cast.times.primary_ms.unwrap_or(cast.times.frame_ms);
    let per_s = |count: f64, ms: f64| count / ms * 1e3;
    let report = Report {
        scene: scene.name.clone(),
        triangles: scene.mesh.triangles.len(),
        device: device.info.name.clone(),
        strategy: strategy.to_string(),
        local_size,
        image_size: size,
        load_ms,
        tree_ms: cast.tree_ms,
        build_ms: cast.build_ms,
        upload_ms: cast.upload_ms,
        primary_ms: cast.times.primary_ms,
        shadow_ms: cast.times.shadow_ms,
        frame_ms: cast.times.frame_ms,
        save_ms,
        total_ms: ms_since(start),
        primary_rays_per_s: per_s(pixels, primary_ms),
        shadow_rays_per_s: cast.times.shadow_ms.map(|ms| per_s((cast.hits * scene.lights.len()) as f64, ms)),
        tests_per_s: strategy
            .tests_every_triangle()
            .then(|| per_s(pixels * scene.mesh.triangles.len() as f64, primary_ms)),
        frames: args.repeat,
        output: output.display().to_string(),
        notes: loaded.notes.clone(),
    };
    match (args.json, args.quiet) {
        (true, _) => super::print_json(&report),
        (false, true) => Ok(()),
        (false, false) => super::print(text(&report, &device)),
    }
}

fn default_output(args: &Args) -> PathBuf {
    PathBuf::from(args.scene.file_stem().unwrap_or_default()).with_extension("png")
}

fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// The `--set`s that mean the scene, their values read as TOML where they are TOML and as text otherwise.
fn scene_overrides(args: &Args) -> Result<Vec<(String, toml::Value)>> {
    let of_scene = args.set.iter().filter(|(key, _)| !is_axis(key));
    let value = |text: &str| {
        let parsed: Option<toml::Table> = toml::from_str(&format!("value = {text}")).ok();
        parsed.and_then(|mut table| table.remove("value")).unwrap_or_else(|| text.into())
    };
    Ok(of_scene.map(|(key, text)| (key.clone(), value(text))).collect())
}

/// The strategy and local size asked for, or the fastest for the device.
fn strategy(args: &Args, device: &Device) -> Result<(Strategy, [u32; 2])> {
    let (best, best_local) = fastest(&device.info.limits)?;
    let mut strategy = match &args.strategy {
        Some(text) => parse_strategy(text)?,
        None => best,
    };
    for (axis, value) in args.set.iter().filter(|(key, _)| is_axis(key)) {
        strategy.set(axis, value)?;
    }
    strategy.check()?;
    let usual = if strategy == best { best_local } else { [8, 8] };
    Ok((strategy, args.local_size.unwrap_or(usual)))
}

/// A cast frame and what it took.
struct Cast {
    image: Radiance,
    hits: usize,
    times: FrameTimes,
    tree_ms: f64,
    build_ms: f64,
    upload_ms: f64,
}

fn cast(
    args: &Args,
    device: &Device,
    scene: &Scene,
    strategy: &Strategy,
    workload: &mut Workload,
    sources: &Sources,
) -> Result<Cast> {
    let failed = |what: &str, error: &dyn std::fmt::Display| Error::run(format!("{what} failed: {error}"));
    let build_start = Instant::now();
    let queue = Queue::open(device.platform, device.device)?;
    let open_ms = ms_since(build_start);
    let tree =
        DeviceTree::build(&queue, &scene.mesh, strategy).map_err(|error| failed("the tree", &error))?;
    workload.stack_size = tree.as_ref().map_or(0, |tree| tree.stack_size);
    let build_start = Instant::now();
    let spec = ProgramSpec::new(sources, strategy, workload, device.info.supports_reduce_builtin())?;
    let program = BuiltProgram::build(&queue.context, queue.device, &spec)
        .map_err(|error| failed("the build", &error))?;
    let mut build_ms = open_ms + ms_since(build_start);
    let device_scene = DeviceScene::upload(&queue, scene, strategy.layout)
        .map_err(|error| failed("uploading the scene", &error))?;
    let caster = Caster::new(&queue, &program, strategy, workload, scene, &device_scene, tree.as_ref())
        .map_err(|error| failed("preparing the frame", &error))?;
    let mut frames = Vec::new();
    for _ in 0..args.repeat {
        frames.push(caster.cast().map_err(|error| failed("the launch", &error))?);
    }
    // Some drivers compile a kernel when it is first launched: that is build time too.
    if let Some(first) = frames.first() {
        build_ms += (first.host_ms - first.frame_ms).max(0.0);
    }
    let (image, hits) = caster.read().map_err(|error| failed("reading the image", &error))?;
    let upload_ms = device_scene.upload_ms + tree.as_ref().map_or(0.0, |tree| tree.upload_ms);
    let tree_ms = tree.map_or(0.0, |tree| tree.build_ms);
    Ok(Cast { image, hits, times: medians(&frames), tree_ms, build_ms, upload_ms })
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
        host_ms: median(&|frame| Some(frame.host_ms)).unwrap_or(0.0),
    }
}

fn check(scene: &Scene, image: &Radiance, strategy: &Strategy) -> Result<()> {
    let expected = reference(scene, [image.width, image.height], strategy.culling);
    let verdict = verify(image, &expected, scene.display);
    if verdict.ok {
        return Ok(());
    }
    Err(Error::run(format!("the picture is wrong: {}", verdict.reason.unwrap_or_default())))
}

/// The report as a person reads it.
fn text(report: &Report, device: &Device) -> String {
    let [width, height] = report.image_size;
    let [x, y] = report.local_size;
    let mut lines = vec![
        format!("scene     {}, {} triangles", report.scene, report.triangles),
        format!("device    {}", device.info.describe()),
        format!("strategy  {}", report.strategy),
        format!("size      {width} x {height} pixels, local size {x} x {y}"),
        format!("load      {:9.2} ms", report.load_ms),
        format!("tree      {:9.2} ms", report.tree_ms),
        format!("build     {:9.2} ms", report.build_ms),
        format!("upload    {:9.2} ms", report.upload_ms),
        format!("kernel    {:9.2} ms{}", report.frame_ms, kernel_parts(report)),
        format!("save      {:9.2} ms", report.save_ms),
        format!("total     {:9.2} ms", report.total_ms),
        format!("rays      {:9.2} Mrays/s primary{}", report.primary_rays_per_s * 1e-6, other_rates(report)),
    ];
    lines.extend(report.notes.iter().map(|note| format!("note      {note}")));
    lines.push(format!("picture   {}", report.output));
    lines.join("\n")
}

fn kernel_parts(report: &Report) -> String {
    let median = if report.frames > 1 { format!(", median of {}", report.frames) } else { String::new() };
    match (report.primary_ms, report.shadow_ms) {
        (Some(primary), Some(shadow)) => format!(" (primary {primary:.2}, shadow {shadow:.2}{median})"),
        _ if report.frames > 1 => format!(" (median of {})", report.frames),
        _ => String::new(),
    }
}

fn other_rates(report: &Report) -> String {
    let shadow = report.shadow_rays_per_s.map(|rate| format!(", {:.2} Mrays/s shadow", rate * 1e-6));
    let tests = report.tests_per_s.map(|rate| format!(", {:.2} Gtests/s", rate * 1e-9));
    shadow.into_iter().chain(tests).collect()
}
