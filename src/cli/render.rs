//! `raycl render`: renders a picture or a moving picture of a scene.

mod casting;
mod guess;
mod hurry;
mod judge;
pub(super) mod keeping;
mod large_mesh;
mod motion;
mod opening;
mod report;
mod split;
mod timeline;
mod turn;

use super::choice::whole;
use super::subject::Subject;
use super::watch::{Watched, folders, watch};
use crate::clock::ms_since;
use crate::device::{Device, DeviceInfo};
use crate::error::{Error, Result};
use crate::filetype::{STANDARD_INPUT, unpacked_name};
use crate::image::{Radiance, check_target, holds_radiance, layer_targets, save, save_layers, shows_8_bits};
use crate::launch::Session;
use crate::memory::peak_bytes;
use crate::output::{Choice, Target};
use crate::program::Sources;
use crate::record::dirty_program;
use crate::reference::layers::layers;
use crate::scene::{Display, INPUTS, Light, Loaded, Sampling, Scene};
use crate::strategy::Strategy;
use crate::words::counted;
use casting::{Cast, Picture, Shows, cast};
use judge::{check, verified};
use motion::Motion;
use notify::RecursiveMode;
use opening::{Opened, open};
use report::{Report, Verification};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;
use timeline::Timeline;

/// Arguments of `raycl render`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl render scenes/teapot.toml -o teapot.png
  raycl render bunny.obj -o bunny.exr --width 1920 --height 1080
  raycl render model.glb --azimuth 120 --elevation 10 --background white
  mkdir -p turn && raycl render dragon.ply --turntable 120 -o turn/dragon.png
  raycl render scenes/roll.toml --animate -o roll.apng
  zcat part.stl.gz | raycl render - -o - --up z > part.png
  raycl render scenes/teapot.toml --strategy naive --local-size 8x8 --repeat 20
  raycl render scenes/teapot.toml --set camera.position='[0, 1, 1]' --strategy deferred,width=4
  raycl render dragon.obj --width 16384 --height 16384 --devices nvidia --repeat 10
  raycl render scenes/gourd.toml --json --repeat 10 | jq .frame_rays_per_s

`raycl strategies` lists the presets and axes; `raycl devices` lists the devices.")]
pub struct Args {
    #[command(flatten)]
    pub(super) subject: Subject,
    /// Where to save the picture: .png, .jpg, .exr or .hdr; - writes a PNG to standard output [default: the name of the
    /// scene's file, with the extension .png; for a scene from standard input, picture.png]
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Also write layers. For each pixel, the layers contain depth, normal and base colour, the numbers of the triangle
    /// and the object, and the counts of triangle tests and visited tree nodes. NAME.exr gets all layers. For NAME.png,
    /// each layer gets a file of its own, such as NAME-depth.png. Not with --devices, --turntable or --animate
    #[arg(long, value_name = "FILE", conflicts_with_all = ["devices", motion::MOVING])]
    layers: Option<PathBuf>,
    /// Replace existing files even if they were not written by raycl, or were changed after raycl wrote them
    #[arg(long)]
    force: bool,
    /// Cast the frame on several devices, a band of rows on each. NAME selects the devices: part of a name, platform or
    /// vendor; a label in `raycl devices`; a kind (cpu, gpu, accelerator); or all. For a bare mesh (a mesh file),
    /// --devices without --samples implies --plain. Not with --device or --watch
    #[arg(long, value_name = "NAME", conflicts_with_all = ["device", "watch"])]
    devices: Option<String>,
    /// With --devices: use all selected devices, even if one of them slows the frame down. If a device fails or cannot
    /// be prepared, the command fails too. (A device still casts nothing if the frame has too few rows for all
    /// devices.) Without this option, raycl leaves out devices that slow the frame down, fail or cannot be prepared
    #[arg(long, requires = "devices", conflicts_with_all = ["device", "watch", "layers", "adaptive", motion::MOVING])]
    every_device: bool,
    #[command(flatten)]
    motion: Motion,
    /// Samples per pixel, 1 to 1024. More samples make edges and soft shadows smoother. With most strategies, N samples
    /// take about N times as long as one. With strategies that cast the rays of a tile of pixels together (traversal =
    /// tile), 16 samples take only 6 to 9 times as long on a CPU, unless the scene has a sky or soft shadows. The
    /// samples' positions are distributed like the weights of a Blackman-Harris filter that is 1.5 pixels wide
    /// [default: 1; with --adaptive, 16. For a bare mesh without --adaptive, --plain or --devices: 6 where neighbouring
    /// pixels differ, and 1 elsewhere]
    #[arg(long, value_parser = whole::<u32>(1..=1024))]
    samples: Option<u32>,
    /// Cast one sixteenth of the samples (rounded up) for every pixel, and the other samples only where neighbouring
    /// pixels differ. Not with --devices [default number of samples: 16]
    #[arg(long, conflicts_with = "devices")]
    adaptive: bool,
    /// Cast the frame this many times, 1 to 1,000,000, and report the median times. If the number is above 1,
    /// raycl first casts one additional frame, which is not timed, to warm up the device. But if the first cast takes
    /// more than a second, raycl counts its time, and casts no additional frame. With --devices, each device always
    /// casts one additional frame, to warm up
    #[arg(long, default_value_t = 1, value_parser = whole::<u32>(1..=1_000_000))]
    repeat: u32,
    /// With --repeat: if another process is measuring on the device, end at once instead of waiting for it
    #[arg(long, requires = "repeat", conflicts_with = motion::MOVING)]
    no_wait: bool,
    /// Compare the picture with the reference picture, which the host casts in double precision, and exit with code 1
    /// if the picture is wrong. With =N, compare only N random pixels
    #[arg(long, value_name = "N", num_args = 0..=1, require_equals = true, value_parser = whole::<u32>(1..=u32::MAX))]
    verify: Option<Option<u32>>,
    /// Render the picture again whenever a file of the scene or a kernel file of --cl-dir changes; Ctrl-C ends the
    /// command. Not with --json, or with a scene from standard input
    #[arg(long, conflicts_with = "json")]
    watch: bool,
    /// Print one JSON object instead of text; the object goes to standard error if the picture goes to
    /// standard output
    #[arg(long)]
    json: bool,
    /// Print only errors, lines about waiting for other processes and, with --json, the JSON object
    #[arg(short, long)]
    quiet: bool,
}

impl Args {
    /// Returns true if the scene comes from standard input.
    pub(super) fn reads_standard_input(&self) -> bool {
        self.subject.reads_standard_input()
    }

    /// Returns true if the picture is cast several times, in order to be timed.
    pub(super) fn repeats(&self) -> bool {
        self.repeat > 1
    }

    /// Returns true if the frames of a moving picture go to standard output.
    pub(super) fn streams(&self) -> bool {
        self.motion.moves() && target(self).is_standard_output()
    }
}

/// Renders one picture, or the frames of a moving picture. With `--watch`, renders the picture again after every
/// change.
pub fn run(args: Args) -> Result<()> {
    if let Some(devices) = &args.devices {
        return split::run(&args, devices);
    }
    if args.motion.moves() {
        return motion::run(&args);
    }
    if !args.watch {
        return render(&args);
    }
    if args.reads_standard_input() {
        return Err(Error::input("standard input cannot be watched")
            .with_help("name the scene's file instead of `-`"));
    }
    let watched = Watched::new(&watched_folders(&args), &written(&args), &INPUTS)?;
    watch(watched, args.quiet, || render(&args))
}

/// Returns the folders that `--watch` watches before the first picture is rendered.
fn watched_folders(args: &Args) -> Vec<(PathBuf, RecursiveMode)> {
    folders(&args.subject.scene, args.subject.cl_dir.as_deref())
}

/// Returns the paths of the files that the command writes.
fn written(args: &Args) -> Vec<PathBuf> {
    targets(args).iter().map(|target| target.path().to_owned()).collect()
}

/// Returns the files that the command writes for a picture: first the files of the picture's layers, then the
/// file of the picture itself.
fn targets(args: &Args) -> Vec<Target> {
    let picture = target(args);
    let mut targets = layer_files(args, &picture).unwrap_or_default();
    targets.push(picture);
    targets
}

fn render(args: &Args) -> Result<()> {
    let mut timeline = if args.watch { Timeline::begin() } else { Timeline::of_process() };
    let target = target(args);
    check_target(&target, args.subject.size())?;
    let layer_targets = layer_files(args, &target)?;
    let sources = Sources::of(args.subject.cl_dir.clone())?;
    timeline.ends("start");
    let opened = open(args, &sources)?;
    opened.tell(&mut timeline);
    let Opened { loaded, mut device, queue, early, tree, show, show_later, .. } = opened;
    let sampling = sampling(args, loaded.is_bare);
    let Loaded { scene, mut notes, object_starts, .. } = loaded;
    let scene = Arc::new(scene);
    test_lanes(args, &mut device, &sources, &scene, sampling)?;
    let fastest = large_mesh::strategy(args, &device.info, args.subject.task(&scene, sampling.most))?;
    let session = Session::new(queue, &device.info, &sources, Arc::clone(&scene)).with_sampling(sampling);
    let tree_was_built = tree.is_some();
    let session = session.verifying(args.verify.is_some()).with_layers(args.layers.is_some());
    let mut session = session.with_program(early).with_tree(tree).rounding_stacks();
    session = session.with_tree_use(large_mesh::tree_use(args, &scene, sampling.most));
    let ((strategy, local_size), later) = hurry::choose(args, &device.info, &scene, &mut session, fastest);
    let prepared = args.subject.prepare(&mut session, &strategy, local_size);
    let prepared = prepared.map_err(|refused| refused.into_error(&device.info))?;
    let tree_ms = if tree_was_built && later.is_none() { 0.0 } else { prepared.tree_ms() };
    let parts = [("tree", tree_ms), ("build", prepared.build_wait_ms), ("upload", prepared.upload_ms())];
    timeline.ends_with("buffers", &parts);
    let shows = Shows { display: scene.display, target: &target, program: show.as_ref() };
    let shows = (may_be_shown(args, &target) && !scene.transparent).then_some(shows);
    let (picture, cast) = cast(args, &device, &prepared, (&scene, shows), &mut timeline)?;
    let radiance = save_picture(picture, scene.display, &target)?;
    if let (Some(image), false) = (&radiance, layer_targets.is_empty()) {
        let layer_images = layers(&scene, &object_starts, args.subject.size(), strategy.culling)?;
        save_layers(image, &layer_images, &layer_targets)?;
    }
    timeline.ends("save");
    let (verified, wrong) = judged(args, &scene, radiance.as_ref(), (&strategy, &cast), &target);
    timeline.ends(if args.verify.is_some() { "verify" } else { "report" });
    let keep = || keeping::for_the_next_start(args, &device, &prepared, &strategy, (later, show_later));
    let keeping_notes = wrong.is_none().then(keep).unwrap_or_default();
    notes.extend(empty(&scene, cast.hits, wrong.is_some()));
    notes.extend(last_notes(args, &scene, sampling, verified.as_ref()).chain(keeping_notes));
    timeline.ends("keep");
    let report = Report {
        frames: args.repeat,
        peak_bytes: peak_bytes(),
        verified,
        output: target.path().display().to_string(),
        notes: with_wrong_times(notes, &cast, &device.info),
        ..Report::of(&scene, &device, &strategy, &prepared, &cast)
    };
    tell(args, &report.with_times(timeline), &device.info, wrong)
}

/// Tests the device's lane operations, by which work-items exchange values. Does not test them if the module
/// `hurry` may choose the strategy ([`hurry::may_cast`]). In this case, raycl casts the picture with the
/// preset [`hurry::QUICK`], which uses no lane operations, or with a stored program. An earlier command tested the lane
/// operations before it compiled the stored program.
fn test_lanes(
    args: &Args,
    device: &mut Device,
    sources: &Sources,
    scene: &Scene,
    sampling: Sampling,
) -> Result<()> {
    if hurry::may_cast(args, &device.info, scene, sampling) {
        return Ok(());
    }
    device.test_lanes(sources)
}

/// Checks a picture's values and, with `--verify`, compares it with the reference. Returns what the report says about
/// the verification and, if the picture is wrong, the error with which the command ends after the report.
fn judged(
    args: &Args,
    scene: &Scene,
    image: Option<&Radiance>,
    (strategy, cast): (&Strategy, &Cast),
    target: &Target,
) -> (Option<Verification>, Option<Error>) {
    let Some(image) = image else { return (None, None) };
    verified(image, target, args.verify, |some| {
        check(scene, (image, cast.hits), (strategy, cast.sampled()), cast.parts.as_ref(), target, some)
    })
}

/// Saves a picture. Returns the picture's radiance, or `None` if `picture` has only the 8-bit colours for the
/// screen.
fn save_picture(picture: Picture, display: Display, target: &Target) -> Result<Option<Radiance>> {
    match picture {
        Picture::Radiance(image) => save(&image, display, target).map(|()| Some(image)),
        Picture::Incoming(picture) => picture.save(target).map(|()| None),
    }
}

/// Returns true if the command needs only the picture's 8-bit colours for the screen, which a device can
/// compute. Verification, layers and some file formats need the picture's radiance, not only its 8-bit
/// colours.
fn may_be_shown(args: &Args, target: &Target) -> bool {
    args.verify.is_none() && args.layers.is_none() && shows_8_bits(target)
}

/// Prints the report; to standard error if the picture goes to standard output. If the picture is wrong, then
/// returns the error `wrong`. If the picture is right and `--watch` is not given, ends the process.
fn tell(args: &Args, report: &Report, device: &DeviceInfo, wrong: Option<Error>) -> Result<()> {
    let streams = target(args).is_standard_output();
    super::print_report(report, || report.text(device), streams, (args.json, args.quiet))?;
    if let Some(wrong) = wrong {
        return Err(wrong);
    }
    if !args.watch {
        super::end_at_once();
    }
    Ok(())
}

/// Returns `notes`, with one more note if the driver's times cannot be right.
fn with_wrong_times(mut notes: Vec<String>, cast: &Cast, device: &DeviceInfo) -> Vec<String> {
    notes.extend(cast.times.why_impossible(device.hardware.timer_resolution_ns));
    notes
}

/// Returns the notes about soft light with one sample, about options without effect, about the verification, and about
/// a raycl that was built from uncommitted sources.
fn last_notes(
    args: &Args,
    scene: &Scene,
    sampling: Sampling,
    verified: Option<&Verification>,
) -> impl Iterator<Item = String> {
    let of_picture = hard(scene, sampling.most).into_iter().chain(undisplayed(args, sampling));
    let of_picture = of_picture.chain(unadapted(args, sampling));
    of_picture.chain(verified.and_then(Verification::note)).chain(dirty_program())
}

/// Returns a note if the picture shows no surface, for example because it shows a sheet edge-on. `hits` is the number
/// of pixels whose rays hit a surface. Returns no note if the picture is wrong (`is_wrong`): the rays may then hit
/// surfaces that the kernels did not find.
fn empty(scene: &Scene, hits: usize, is_wrong: bool) -> Option<String> {
    let is_empty = hits == 0 && !scene.mesh.triangles.is_empty();
    (is_empty && !is_wrong).then(|| {
        "the picture shows no surface: no ray from the eye hits one; to see the scene from another direction, use \
         --azimuth and --elevation"
            .to_owned()
    })
}

/// Returns a note if options for the display change no surface in the picture, since the picture's file contains
/// radiance. Returns no note if sampling is adaptive, since the options for the display then decide which pixels get
/// more samples. The note names only the values of surfaces, because the options do change the radiance of a background
/// such as `#204060`.
fn undisplayed(args: &Args, sampling: Sampling) -> Option<String> {
    let (options, target) = (args.subject.display_options(), target(args));
    let is_useless = holds_radiance(target.path()) && !sampling.is_adaptive();
    (is_useless && !options.is_empty()).then(|| {
        let change = if options.len() == 1 { "does not change" } else { "do not change" };
        let (options, name) = (options.join(" and "), target.path().display());
        format!(
            "{options} {change} the values of surfaces in '{name}': the file contains radiance; a .png or .jpg contains displayed colours"
        )
    })
}

/// Returns a note if `--adaptive` is given with a single sample per pixel.
fn unadapted(args: &Args, sampling: Sampling) -> Option<String> {
    (args.adaptive && !sampling.is_adaptive())
        .then(|| "--adaptive has no effect with --samples 1: no pixel can get more samples".to_owned())
}

/// Returns a note if each pixel gets only one sample, and the scene has a sky, or lights with an extent (a radius or
/// edges). With one sample, lights with an extent are treated as points, and the sky's light is grainy. Returns `None`
/// in all other cases.
fn hard(scene: &Scene, samples: u32) -> Option<String> {
    let count = |is: fn(&Light) -> bool| scene.lights.iter().filter(|light| is(light)).count();
    let (soft, areas) = (count(Light::has_extent), count(|light| light.area.is_some()));
    let grain = scene.sky.as_ref().map(|_| "the sky's light is grainy");
    let extent = match areas {
        0 => "a radius",
        areas if areas == soft => "edges",
        _ => "a radius or edges",
    };
    let message = match (soft, grain) {
        (0, None) => return None,
        (0, Some(grain)) => format!("with one sample per pixel, {grain}; --samples 16 shows less grain"),
        (lights, grain) => {
            let (lights, are) = match lights {
                1 => ("1 light has", "it as a point"),
                _ => ("several lights have", "them as points"),
            };
            let grain = grain.map_or_else(String::new, |grain| format!(", and {grain}"));
            format!(
                "{lights} {extent}: with one sample per pixel, raycl treats {are}{grain}; --samples 16 shows soft shadows"
            )
        }
    };
    (samples == 1).then_some(message)
}

/// Returns the result of `work`, and its duration in milliseconds.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, ms_since(start))
}

/// Returns the picture's path; the default is the name of the scene's file with the extension `.png`, or `picture.png`
/// for standard input.
fn target(args: &Args) -> Target {
    let scene = unpacked_name(&args.subject.scene);
    let stem = match scene.file_stem() {
        Some(stem) if stem != STANDARD_INPUT => stem,
        _ => "picture".as_ref(),
    };
    let choice = Choice::new(args.force, "-o FILE");
    // For the stem `part.v1`, `with_extension` would return `part.png` instead of `part.v1.png`.
    let mut default = stem.to_owned();
    default.push(".png");
    Target::new(args.output.clone().unwrap_or_else(|| default.into()), choice)
}

/// Returns the files that `--layers` requests; an empty list without `--layers`. The .png file of a layer
/// must not have the path of the picture. The .exr file of all layers may have the path of the picture, since
/// the .exr file also contains the picture.
fn layer_files(args: &Args, picture: &Target) -> Result<Vec<Target>> {
    let choice = Choice::new(args.force, "--layers FILE");
    args.layers.as_ref().map_or(Ok(Vec::new()), |path| layer_targets(&Target::new(path, choice), picture))
}

/// Returns an error if `target`, a file that the command writes, is a file of the scene that [`load`] has
/// loaded.
fn refuse_scene_file(target: &Target) -> Result<()> {
    target.check_unread("a file of the scene", |path| INPUTS.contains(path))
}

/// Returns true if the command may replace a file. `frames` is the number of frames of the scene's animation.
fn may_replace(args: &Args, frames: u32) -> bool {
    if args.motion.moves() {
        return motion::may_replace(args, frames);
    }
    targets(args).iter().any(|target| target.path().exists())
}

/// Loads the scene. If the scene is animated and `--animate` is not given, loads its first frame; if there are further
/// frames, a note says so. For a still picture, fails if a file of the picture is a file of the scene. If the command
/// may replace a file, also finds the image files (such as textures) that only later frames of the scene use, so that
/// none of them is replaced. If the command replaces nothing, raycl does not search for these image files, since the
/// search reads the meshes and pictures of later frames, which may be large.
fn load(args: &Args) -> Result<Loaded> {
    let mut loaded = args.subject.load(args.motion.turns(), is_dressed(args))?;
    if let Some(animation) = &mut loaded.animation
        && may_replace(args, animation.frames)
    {
        animation.find_files();
    }
    if let Some(animation) = loaded.animation.as_ref().filter(|_| args.motion.animates()) {
        loaded.notes.extend(animation.notes_on_tracks());
    }
    if !args.motion.moves() {
        targets(args).iter().try_for_each(refuse_scene_file)?;
    }
    if !args.motion.animates()
        && let Some(animation) = loaded.animation.take().filter(|animation| animation.frames > 1)
    {
        let frames = counted(animation.frames as usize, "frame");
        loaded.notes.push(match args.motion.turns() {
            true => format!(
                "the turntable shows the scene as in the first of {frames}: --animate instead of --turntable renders all"
            ),
            false => format!("the picture shows the first of {frames}: --animate renders all"),
        });
    }
    Ok(loaded)
}

/// Returns true if a bare mesh without lights gets soft light, a sky and usually a ground. With `--plain`, a
/// bare mesh never gets soft light, a sky or a ground. With `--devices`, a bare mesh gets soft light only if
/// `--samples` is given: without `--samples`, the pixels of a bare mesh in soft light have different numbers
/// of samples, and raycl cannot divide a picture with different numbers of samples among several devices.
fn is_dressed(args: &Args) -> bool {
    !args.subject.look.plain && (args.devices.is_none() || args.samples.is_some())
}

/// Returns the number of samples per pixel. With `--samples`, every pixel gets the given number; with `--adaptive`, the
/// given number is the largest that a pixel gets. Without `--samples`, the number is [`ADAPTIVE_SAMPLES`] with
/// `--adaptive`, [`MESH_SAMPLES`] for a bare mesh without `--plain` or `--devices`, and 1 otherwise.
fn sampling(args: &Args, is_bare: bool) -> Sampling {
    match args.samples {
        None if is_bare && is_dressed(args) && !args.adaptive => MESH_SAMPLES,
        samples if args.adaptive => Sampling::adaptive(samples.unwrap_or(ADAPTIVE_SAMPLES)),
        samples => Sampling::all(samples.unwrap_or(1)),
    }
}

/// The default numbers of samples per pixel of a bare mesh, with lights from its file or with lights that raycl adds.
/// The shadows of soft light are cast in half pictures (of half the width and height); everything else is cast at full
/// size.
const MESH_SAMPLES: Sampling = Sampling { first: 1, most: 6, half_light: 2 };
/// The largest number of samples per pixel with `--adaptive`, if `--samples` is not given.
const ADAPTIVE_SAMPLES: u32 = 16;

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn only_repeated_frames_wait_for_a_device() {
        let is_accepted = |more: &[&str]| {
            Command::try_parse_from([&["render", "a.toml", "--no-wait"], more].concat()).is_ok()
        };
        assert!(is_accepted(&["--repeat", "2"]));
        assert!(!is_accepted(&[]));
    }

    #[test]
    fn a_picture_is_not_left_to_the_device_if_its_radiance_is_needed() {
        let may_be_shown = |more: &[&str]| {
            let args = Command::parse_from([&["render", "a.toml", "-o"], more].concat()).args;
            may_be_shown(&args, &target(&args))
        };
        assert!(may_be_shown(&["a.png"]) && may_be_shown(&["a.jpg"]));
        for more in [&["a.exr"][..], &["a.png", "--verify"], &["a.png", "--layers", "b.exr"]] {
            assert!(!may_be_shown(more), "{more:?}");
        }
    }

    fn args(words: &[&str]) -> Args {
        Command::parse_from([&["render"], words].concat()).args
    }

    #[test]
    fn samples_are_those_asked_for_and_a_bare_mesh_has_defaults_of_its_own() {
        let of = |more: &[&str], is_bare| sampling(&args(&[&["a.obj"], more].concat()), is_bare);
        let usual_of_meshes = Sampling { first: 1, most: 6, half_light: 2 };
        assert_eq!([of(&[], false), of(&[], true)], [Sampling::ONE, usual_of_meshes]);
        assert_eq!([of(&["--plain"], true), of(&["--devices", "all"], true)], [Sampling::ONE; 2]);
        for is_bare in [false, true] {
            assert_eq!(of(&["--samples", "4"], is_bare), Sampling::all(4));
            assert_eq!(of(&["--adaptive"], is_bare), Sampling::adaptive(16));
            assert_eq!(of(&["--adaptive", "--samples", "64"], is_bare), Sampling::adaptive(64));
        }
    }

    #[test]
    fn several_devices_light_a_mesh_softly_only_with_a_number_of_samples() {
        let dressed = |more: &[&str]| is_dressed(&args(&[&["a.obj"], more].concat()));
        assert!(dressed(&[]) && dressed(&["--samples", "1"]) && !dressed(&["--plain"]));
        assert!(!dressed(&["--devices", "all"]) && dressed(&["--devices", "all", "--samples", "4"]));
        assert!(!dressed(&["--plain", "--devices", "all", "--samples", "4"]));
    }

    #[test]
    fn a_picture_is_named_after_its_scene_and_its_files_are_not_watched() {
        let named = |words: &[&str]| target(&args(words)).path().display().to_string();
        assert_eq!(named(&["scenes/teapot.toml"]), "teapot.png");
        assert_eq!(named(&["a/mesh.obj.gz"]), "mesh.png");
        assert_eq!(named(&["a/part.v1.stl"]), "part.v1.png");
        assert_eq!(named(&["-"]), "picture.png");
        assert_eq!(named(&["a.toml", "-o", "b/c.exr"]), "b/c.exr");
        let files = |words: &[&str]| written(&args(words));
        assert_eq!(files(&["a.toml"]), ["a.png"].map(PathBuf::from));
        assert_eq!(files(&["a.toml", "--layers", "b.exr"]), ["b.exr", "a.png"].map(PathBuf::from));
    }

    /// Reading the files that only later frames of an animation need (such as textures) may take long. Before the first
    /// frame, raycl therefore looks for these files only if `may_replace` returns true.
    #[test]
    fn a_file_may_be_replaced_only_if_it_exists_and_a_numbered_picture_only_with_force() {
        let folder = tempfile::tempdir().expect("a folder");
        let replaces = |name: &str, more: &str| {
            let output = folder.path().join(name).display().to_string();
            let words: Vec<&str> =
                ["a.toml", "-o", &output].into_iter().chain(more.split_whitespace()).collect();
            may_replace(&args(&words), 3)
        };
        let all = [("f.png", "--force"), ("f.png", "--animate --force"), ("f.apng", "--animate")];
        assert!(all.iter().all(|(name, more)| !replaces(name, more)));
        for name in ["f.png", "f.apng"] {
            std::fs::write(folder.path().join(name), "").expect("a file");
        }
        assert_eq!(all.map(|(name, more)| replaces(name, more)), [true, false, true]);
        std::fs::write(folder.path().join("f-0002.png"), "").expect("a file");
        for (more, expected) in [
            ("--animate --force", true),
            ("--animate", false),
            ("--animate --force --frames 3", false),
            ("--animate --force --frames 2..9", false),
            ("--animate --force --shard 1/3", false),
            ("--animate --force --shard 2/3", true),
            ("--turntable 2 --force", true),
            ("--turntable 1 --force", false),
        ] {
            assert_eq!(replaces("f.png", more), expected, "{more}");
        }
        assert!(!may_replace(&args(&["a.toml", "--animate", "--force", "-o", "-"]), 3));
    }

    #[test]
    fn a_still_picture_replaces_no_file_that_only_a_later_frame_uses() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name).display().to_string();
        let sky = Radiance { pixels: vec![[1.0; 3]; 2], ..Radiance::new(2, 1) };
        for name in ["day.hdr", "night.hdr"] {
            let target = Target::new(path(name), Choice::new(false, "-o FILE"));
            save(&sky, Display::default(), &target).expect("a picture");
        }
        let scene = "[sky]\npicture = \"day.hdr\"\n[[object]]\nshape = \"sphere\"\ntriangles = 20\n";
        let track = "[[animation.track]]\npath = \"sky.picture\"\nvalues = [\"day.hdr\", \"night.hdr\"]\n";
        std::fs::write(path("a.toml"), format!("{scene}[animation]\nframes = 3\n{track}")).expect("a file");
        let scene = path("a.toml");
        let loaded = |name: &str| load(&args(&[scene.as_str(), "-o", path(name).as_str(), "--force"]));
        let refused = loaded("night.hdr").err().map(|error| error.to_string()).unwrap_or_default();
        assert!(refused.ends_with("night.hdr' is a file of the scene, and is not replaced"), "{refused}");
        assert!(loaded("evening.hdr").is_ok(), "nothing is replaced");
    }

    #[test]
    fn a_note_on_the_first_frame_names_only_options_that_can_be_combined() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name).display().to_string();
        let scene =
            "[[light]]\nposition = [0, 5, 0]\npower = 9\n[[object]]\nshape = \"sphere\"\ntriangles = 20\n";
        std::fs::write(path("a.toml"), format!("{scene}[animation]\nframes = 3\n")).expect("a file");
        let (scene, output) = (path("a.toml"), path("a.png"));
        let notes = |more: &[&str]| {
            let words = [&[scene.as_str(), "-o", output.as_str()], more].concat();
            load(&args(&words)).expect("a scene").notes.join("\n")
        };
        let [still, turning] = [notes(&[]), notes(&["--turntable", "2"])];
        assert!(still.contains("the picture shows the first of 3 frames: --animate renders all"), "{still}");
        let first =
            "the turntable shows the scene as in the first of 3 frames: --animate instead of --turntable";
        assert!(turning.contains(first) && !turning.contains("the picture"), "{turning}");
        assert!(!notes(&["--animate"]).contains("--animate"));
        let no_track = "the animation has no track, so all frames are equal";
        assert!(notes(&["--animate"]).contains(no_track) && !still.contains(no_track));
    }

    #[test]
    fn only_with_one_sample_a_note_says_that_soft_lights_are_points_and_a_sky_is_grainy() {
        let with = |radii: &[f32]| {
            let scene = crate::reference::fixtures::single_triangle();
            let light = scene.lights[0];
            let lights = radii.iter().map(|&radius| crate::scene::Light { radius, ..light }).collect();
            Scene { lights, ..scene }
        };
        assert_eq!(hard(&with(&[0.0, 0.0]), 1), None);
        assert_eq!(hard(&with(&[0.5, 0.5]), 2), None);
        assert!(hard(&with(&[0.0, 0.5]), 1).is_some_and(|note| note.starts_with("1 light has a radius:")));
        assert!(
            hard(&with(&[0.5, 0.5]), 1).is_some_and(|note| note.starts_with("several lights have a radius:"))
        );
        let under_sky = |radii: &[f32], samples| {
            let (one, up) = (glam::Vec3::ONE, glam::Vec3::Y);
            let sky = crate::scene::Sky { zenith: one, horizon: one, up, reach: 1.0, picture: None };
            hard(&Scene { sky: Some(sky), ..with(radii) }, samples)
        };
        let grainy = "with one sample per pixel, the sky's light is grainy; --samples 16 shows less grain";
        assert_eq!(under_sky(&[0.0], 1).as_deref(), Some(grainy));
        let both = under_sky(&[0.5], 1).unwrap_or_default();
        assert!(both.contains("treats it as a point, and the sky's light is grainy; --samples 16"), "{both}");
        assert_eq!(under_sky(&[0.5], 2), None);
        let with_area = |radii: &[f32]| {
            let edges = [glam::Vec3::X, glam::Vec3::Y];
            let mut scene = with(radii);
            scene.lights[0].area = Some(crate::scene::Area { shape: Default::default(), edges });
            hard(&scene, 1)
        };
        assert!(with_area(&[0.0, 0.0]).is_some_and(|note| note.starts_with("1 light has edges:")));
        let both = with_area(&[0.0, 0.5]);
        assert!(both.is_some_and(|note| note.starts_with("several lights have a radius or edges:")));
    }

    #[test]
    fn adaptive_sampling_with_one_sample_is_noted() {
        let noted = |options: &[&str]| {
            let args = args(&[&["a.toml"], options].concat());
            unadapted(&args, sampling(&args, false)).is_some()
        };
        assert!(noted(&["--adaptive", "--samples", "1"]));
        assert!(
            !noted(&["--adaptive", "--samples", "2"])
                && !noted(&["--adaptive"])
                && !noted(&["--samples", "1"])
        );
    }

    #[test]
    fn options_for_the_display_are_noted_if_the_picture_is_not_displayed() {
        let of = |more: &[&str], sampling: Sampling| {
            undisplayed(&args(&[&["a.toml"], more].concat()), sampling).unwrap_or_default()
        };
        let both = ["-o", "b.exr", "--exposure", "8", "--tone", "filmic"];
        let start = "--exposure 8 and --tone filmic do not change the values of surfaces in 'b.exr': the file contains radiance;";
        assert!(of(&both, Sampling::ONE).starts_with(start), "{}", of(&both, Sampling::ONE));
        let set = of(&["-o", "b.HDR", "--set", "display.gamma=1"], Sampling::all(4));
        assert!(
            set.starts_with("--set display.gamma=1 does not change the values of surfaces in 'b.HDR'"),
            "{set}"
        );
        assert_eq!(of(&both, Sampling::adaptive(16)), "");
        assert_eq!(of(&["-o", "b.exr", "--background", "#204060"], Sampling::ONE), "");
        for name in ["b.png", "b.jpg", "b.apng", "-"] {
            assert_eq!(of(&["-o", name, "--exposure", "8"], Sampling::ONE), "", "{name}");
        }
        let (args, scene) =
            (args(&[&["a.toml"], &both[..]].concat()), crate::reference::fixtures::single_triangle());
        assert!(last_notes(&args, &scene, Sampling::ONE, None).any(|note| note.starts_with(start)));
    }

    #[test]
    fn a_picture_without_surfaces_is_noted() {
        let scene = crate::reference::fixtures::single_triangle();
        let note = empty(&scene, 0, false);
        assert!(note.is_some_and(|note| note.starts_with("the picture shows no surface: ")));
        assert_eq!([empty(&scene, 1, false), empty(&scene, 0, true)], [None, None]);
        let mut without = scene;
        without.mesh_mut().triangles.clear();
        assert_eq!(empty(&without, 0, false), None);
    }

    #[test]
    fn the_folder_of_the_scene_is_watched_and_all_folders_of_the_kernels() {
        let of = |words: &[&str]| watched_folders(&args(words));
        let scene = (PathBuf::from("a"), RecursiveMode::NonRecursive);
        assert_eq!(of(&["a/b.toml", "--watch"]), std::slice::from_ref(&scene));
        let kernels = (PathBuf::from("own/cl"), RecursiveMode::Recursive);
        assert_eq!(of(&["a/b.toml", "--watch", "--cl-dir", "own/cl"]), [scene, kernels]);
    }

    #[test]
    fn a_file_that_cannot_be_written_is_refused_before_the_scene_is_read() {
        let refused = |more: &[&str]| {
            let error = run(args(&[&["missing.toml"], more].concat())).expect_err("there is no scene");
            error.to_string()
        };
        assert!(refused(&[]).contains("missing.toml"), "{}", refused(&[]));
        for more in [&[][..], &["--devices", "all"]] {
            let wide = refused(&[&["-o", "a.jpg", "--width", "65536", "--height", "1"], more].concat());
            assert!(wide.contains("65536 x 1 pixels; a JPEG has at most 65535"), "{more:?}: {wide}");
        }
        let moving = refused(&["-o", "a.jpg", "--turntable", "2"]);
        assert_eq!(moving, "'a.jpg' is not a valid name for moving pictures");
        let layers = refused(&["--layers", "a.tif"]);
        assert!(layers.contains("a.tif"), "{layers}");
    }
}
