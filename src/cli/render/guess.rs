//! Guesses which program a scene's picture needs, so that the program can be built while the scene is being read. The
//! guess is the program that this scene needed last time. For a new OBJ file, the guess follows from the file's size.
//! A wrong guess costs only the time in which the wrong program is built.

use super::{Args, hurry, is_dressed, large_mesh};
use crate::cache::Cache;
use crate::cli::subject::Subject;
use crate::device::DeviceInfo;
use crate::filetype::unpacked_name;
use crate::launch::ROUNDED_STACK;
use crate::program::{ProgramSpec, Sources};
use crate::scene::Sampling;
use crate::strategy::{Requirements, Strategy, Task, Workload, preset};
use serde::{Deserialize, Serialize};
use std::time::SystemTime;

/// The kind of cache entries that store guesses.
const KIND: &str = "guess";
/// Bytes per triangle of an OBJ file with positions only: the file of the Stanford bunny has 35 bytes per
/// triangle, and the file of the dragon has 36.
const BYTES_OF_TRIANGLE: u64 = 35;
/// The share of a picture's pixels that a bare mesh usually covers, as `Scene::covered_share` estimates it.
/// In pictures of 640 x 400 pixels, the Stanford bunny covers a share of 0.38, and the dragon 0.37.
const USUAL_COVERED_SHARE: f64 = 0.375;
/// Most bare meshes with fewer than `USUAL_FINE_TRIANGLES` triangles are coarse. In the default light, a coarse mesh
/// gets smooth shadows.
const USUAL_FINE_TRIANGLES: u64 = 20_000;
/// The number of stack entries that are enough to traverse most trees, if the traversal's stack is in
/// `__local` memory.
const USUAL_LOCAL_STACK: usize = 64;

/// What determines a program and cannot be derived from the command's arguments alone: the strategy and the
/// workload.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Remembered {
    /// The name of each axis, and the name of the strategy's value on this axis.
    axes: Vec<(String, String)>,
    /// The workload with which the program was last used: the properties of the scene, the image and the work-group on
    /// which a program depends.
    workload: Workload,
}

/// Returns the user's cache, or no cache with `--cl-dir` or `--watch`, because the user is then probably editing
/// kernels or the scene.
pub fn cache(args: &Args) -> Cache {
    if args.subject.cl_dir.is_some() || args.watch { Cache::none() } else { Cache::of_user() }
}

/// Returns the program to compile while the scene is being read; `None` if no guess is possible.
pub fn likely(cache: &Cache, args: &Args, sources: &Sources, device: &DeviceInfo) -> Option<ProgramSpec> {
    let (strategy, workload) = last_time(cache, args, device).or_else(|| by_file(args, device))?;
    spec(args, sources, device, &strategy, workload)
}

/// Returns the program that the preset [`hurry::QUICK`] needs for the scene. The scene is not read yet, so
/// the function guesses the scene's properties on which the program depends. Returns `None` if the function
/// cannot guess these properties. If [`hurry::may`] returns true and the program of [`likely`] is not
/// compiled yet, raycl compiles the program of [`hurry::QUICK`] early, instead of the program of [`likely`].
pub fn quick(cache: &Cache, args: &Args, sources: &Sources, device: &DeviceInfo) -> Option<ProgramSpec> {
    let (_, known) = last_time(cache, args, device).or_else(|| by_file(args, device))?;
    let (strategy, local_size) = hurry::quick(device)?;
    let workload = Workload { local_size, stack_size: usual_stack(&strategy), ..known };
    spec(args, sources, device, &strategy, workload)
}

fn spec(
    args: &Args,
    sources: &Sources,
    device: &DeviceInfo,
    strategy: &Strategy,
    known: Workload,
) -> Option<ProgramSpec> {
    // The program of a strategy that copies all triangles to `__local` memory contains the number of triangles. This
    // number is not known before the scene is read.
    if strategy.triangles.are_staged() {
        return None;
    }
    let image_size = args.subject.size();
    let workload = Workload { image_size, ..known };
    // If the device cannot cast this workload, for example because the strategy does not allow the work-group, no
    // program is guessed: it might not compile, and the compiler would print an error before raycl's own message.
    Requirements::check(strategy, &workload, &device.limits).ok()?;
    ProgramSpec::new(sources, strategy, &workload, device.builtins()).ok()
}

/// Stores which program a scene needed, so that the next command with this scene can guess this program.
pub fn remember(cache: &Cache, args: &Args, device: &DeviceInfo, strategy: &Strategy, workload: &Workload) {
    let owned = |(axis, value): (&str, &str)| (axis.to_owned(), value.to_owned());
    let axes = strategy.axes().into_iter().map(owned).collect();
    let now = Remembered { axes, workload: *workload };
    if let (Some(key), Ok(bytes)) = (key(args, device), serde_json::to_vec(&now))
        && remembered(cache, args, device).as_ref() != Some(&now)
    {
        cache.put(KIND, &key, &bytes);
    }
}

fn remembered(cache: &Cache, args: &Args, device: &DeviceInfo) -> Option<Remembered> {
    serde_json::from_slice(&cache.get(KIND, &key(args, device)?)?).ok()
}

fn last_time(cache: &Cache, args: &Args, device: &DeviceInfo) -> Option<(Strategy, Workload)> {
    let Remembered { axes, workload } = remembered(cache, args, device)?;
    let mut strategy = preset("naive").ok()?.strategy;
    axes.iter().try_for_each(|(axis, value)| strategy.set(axis, value)).ok()?;
    Some((strategy, workload))
}

/// Returns the strategy and the workload for an OBJ file. The number of triangles is estimated from the file's size.
/// Returns `None` if the file is not an OBJ file, if its size is unknown, or if no strategy can be chosen.
fn by_file(args: &Args, device: &DeviceInfo) -> Option<(Strategy, Workload)> {
    if args.subject.scene.extension()? != "obj" {
        return None;
    }
    let triangles = args.subject.scene.metadata().ok()?.len() / BYTES_OF_TRIANGLE;
    // The camera of a bare mesh is outside the mesh, as `Task::default()` assumes.
    let pixels = args.subject.width as usize * args.subject.height as usize;
    let sky = is_dressed(args);
    let covered_pixels = (pixels as f64 * USUAL_COVERED_SHARE) as usize;
    let task = Task { triangles: triangles as usize, pixels, covered_pixels, soft: sky, ..Task::default() };
    let (strategy, local_size) = large_mesh::strategy(args, device, task).ok()?;
    let stack_size = usual_stack(&strategy);
    let sampling = sampling(args);
    let many_samples = sampling.most > 1;
    let (soft_lights, half_light) = (sky && many_samples, sky && sampling.half_light > 0);
    let known = Workload {
        // A bare mesh has lights, unless the user sets a sky or an empty list of lights. The program does not depend
        // on the number of lights as long as there is at least one light.
        lights: 1,
        local_size,
        stack_size,
        soft_lights,
        sky,
        smooth_shadows: sky && triangles < USUAL_FINE_TRIANGLES,
        many_samples,
        half_light,
        ..Workload::default()
    };
    Some((strategy, known))
}

/// Returns the number of stack entries that are enough to traverse most trees; 0 if the strategy has no tree.
fn usual_stack(strategy: &Strategy) -> usize {
    match (strategy.needs_tree(), strategy.shares_tiles()) {
        (false, _) => 0,
        (true, true) => USUAL_LOCAL_STACK,
        (true, false) => ROUNDED_STACK,
    }
}

/// Returns the number of samples per pixel. The default number for a bare mesh may differ from the
/// default number for a scene file. The file's name decides whether the file counts as a bare mesh, since the file
/// has not been read yet.
pub fn sampling(args: &Args) -> Sampling {
    let is_scene = unpacked_name(&args.subject.scene).extension().is_some_and(|ending| ending == "toml");
    super::sampling(args, !is_scene)
}

/// Returns a text that identifies the scene's file in its present state, the device, and those arguments that most
/// often affect which program is chosen. Other arguments, such as `--azimuth` and `--repeat`, seldom affect this
/// choice; if they do, the guess may be wrong. Returns `None` if the file's state is unknown, as for standard input.
fn key(args: &Args, device: &DeviceInfo) -> Option<String> {
    let path = args.subject.scene.canonicalize().ok()?;
    let metadata = path.metadata().ok()?;
    let changed = metadata.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    let Subject { width, height, strategy, local_size, set, .. } = &args.subject;
    let samples = (args.samples, args.adaptive);
    Some(format!(
        "{}\n{} bytes, {changed:?}\n{width}x{height} {strategy:?} {local_size:?} {set:?} {}\n{}",
        path.display(),
        metadata.len(),
        format_args!("{samples:?} samples, dressed {}", is_dressed(args)),
        device.identity()
    ))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::device::{DeviceKind, discover, tests::example};
    use crate::launch::Session;
    use clap::Parser;
    use std::path::Path;
    use std::sync::Arc;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn args(scene: &Path, more: &[&str]) -> Args {
        let scene = scene.to_str().unwrap();
        Command::parse_from([&["render", scene], more].concat()).args
    }

    #[test]
    fn what_a_scene_needed_is_known_until_anything_that_chooses_changes() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::at(&folder.path().join("raycl"), 1 << 20);
        let [device, other] = ["PoCL", "Other"].map(|name| example(name, "cpu", DeviceKind::Cpu, 2));
        let scene = folder.path().join("scene.toml");
        std::fs::write(&scene, "as it is").unwrap();
        let likely = |more: &[&str], device| likely(&cache, &args(&scene, more), &Sources::Embedded, device);
        assert_eq!(likely(&[], &device), None, "a scene may hold anything");
        let tree = preset("bvh").unwrap().strategy;
        let workload = Workload { stack_size: 96, local_size: [8, 4], ..Workload::default() };
        remember(&cache, &args(&scene, &[]), &device, &tree, &workload);
        let known = likely(&[], &device).unwrap();
        let needed = ProgramSpec::new(&Sources::Embedded, &tree, &workload, device.builtins()).unwrap();
        assert_eq!(known, needed);
        assert_eq!(likely(&["--width", "99"], &device), None);
        for more in [
            &["--height", "99"][..],
            &["--strategy", "naive"],
            &["--local-size", "8x8"],
            &["--set", "width=4"],
            &["--samples", "4"],
            &["--adaptive"],
            &["--plain"],
        ] {
            assert_eq!(likely(more, &device), None, "{more:?}");
        }
        assert_eq!(likely(&[], &other), None);
        // The function `quick` guesses another program for this scene. This program has the same strategy as the
        // program `known`, but another local size and stack size.
        let quick = quick(&cache, &args(&scene, &[]), &Sources::Embedded, &device).unwrap();
        let (strategy, local_size) = hurry::quick(&device).unwrap();
        let of_quick = Workload { local_size, stack_size: ROUNDED_STACK, ..workload };
        let expected = ProgramSpec::new(&Sources::Embedded, &strategy, &of_quick, device.builtins()).unwrap();
        assert_eq!(quick, expected);
        // A file whose length has changed counts as another scene, even if its modification time is the same.
        let changed = scene.metadata().unwrap().modified().unwrap();
        std::fs::write(&scene, "as it is now").unwrap();
        std::fs::File::options().append(true).open(&scene).unwrap().set_modified(changed).unwrap();
        assert_eq!(likely(&[], &device), None);
    }

    #[test]
    fn kernels_that_are_being_edited_leave_nothing_in_the_cache() {
        let of = |more: &[&str]| cache(&args(Path::new("a.toml"), more)).folder().map(Path::to_owned);
        let user = Cache::of_user().folder().map(Path::to_owned);
        assert_eq!([of(&[]), of(&["--watch"]), of(&["--cl-dir", "cl"])], [user, None, None]);
    }

    #[test]
    fn only_a_mesh_is_guessed_to_have_several_samples() {
        let of = |scene: &str, more: &[&str]| sampling(&args(Path::new(scene), more)).most;
        assert_eq!([of("a.toml", &[]), of("a.toml.gz", &[]), of("a.toml", &["--samples", "2"])], [1, 1, 2]);
        assert_eq!([of("a.obj", &[]), of("-", &[]), of("a.obj", &["--plain"])], [6, 6, 1]);
        assert_eq!(of("a.toml", &["--adaptive"]), 16);
    }

    #[test]
    fn a_mesh_is_guessed_by_its_size() {
        let folder = tempfile::tempdir().unwrap();
        let device = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        let mesh = folder.path().join("mesh.obj");
        let spec = |bytes: usize| {
            std::fs::write(&mesh, vec![b'#'; bytes]).unwrap();
            likely(&Cache::none(), &args(&mesh, &["--plain"]), &Sources::Embedded, &device).unwrap()
        };
        let (small, large) = (spec(100), spec(1_000_000));
        assert!(!small.options.contains("STACK_SIZE"), "{}", small.options);
        assert!(large.options.contains("STACK_SIZE=128"), "{}", large.options);
    }

    #[test]
    fn no_program_is_guessed_for_a_work_group_that_the_strategy_does_not_allow() {
        let folder = tempfile::tempdir().unwrap();
        let device = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        let mesh = folder.path().join("mesh.obj");
        std::fs::write(&mesh, "#").unwrap();
        let is_guessed = |local_size: &str| {
            let args = args(&mesh, &["--plain", "--strategy", "tile-group", "--local-size", local_size]);
            likely(&Cache::none(), &args, &Sources::Embedded, &device).is_some()
        };
        assert_eq!(["32x1", "5x5"].map(is_guessed), [true, false]);
    }

    /// A program that copies all triangles to `__local` memory contains the number of triangles, which is not
    /// known before the scene is read.
    #[test]
    fn no_program_is_guessed_that_copies_all_triangles_to_local_memory() {
        let folder = tempfile::tempdir().unwrap();
        let device = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        let mesh = folder.path().join("mesh.obj");
        std::fs::write(&mesh, "#").unwrap();
        let is_guessed = |triangles: &str| {
            let more = ["--plain", "--strategy", "deferred", "--local-size", "8x4", "--set", triangles];
            likely(&Cache::none(), &args(&mesh, &more), &Sources::Embedded, &device).is_some()
        };
        assert_eq!(["triangles=global", "triangles=local"].map(is_guessed), [true, false]);
    }

    /// If the guess for a new mesh were wrong, the first command with this mesh would compile two programs.
    #[test]
    fn the_guess_for_a_new_mesh_is_the_program_that_its_picture_needs() {
        let folder = tempfile::tempdir().unwrap();
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let mesh = folder.path().join("mesh.obj");
        std::fs::write(&mesh, waves(60)).unwrap();
        for more in [&[][..], &["--plain"], &["--samples", "4"]] {
            let args = args(&mesh, more);
            let loaded = super::super::load(&args).unwrap();
            let sampling = super::super::sampling(&args, loaded.is_bare);
            let task = args.subject.task(&loaded.scene, sampling.most);
            let (strategy, local_size) = args.subject.strategy(&device.info, task).unwrap();
            let session = Session::open(&device, &Sources::Embedded, Arc::new(loaded.scene)).unwrap();
            let mut session = session.with_sampling(sampling).rounding_stacks();
            let workload = session.workload(&strategy, args.subject.size(), local_size);
            let needed =
                session.spec(&strategy, &workload.map_err(|refused| refused.reason()).unwrap()).unwrap();
            let guess = likely(&Cache::none(), &args, &Sources::Embedded, &device.info).unwrap();
            assert_eq!(guess.options, needed.options, "{more:?}");
            assert!(guess == needed, "{more:?}");
        }
    }

    /// Returns an OBJ file of 2 `side`^2 triangles.
    fn waves(side: usize) -> String {
        let heights = (0..=side * (side + 2)).map(|i| ((i % (side + 1)) as f32, (i / (side + 1)) as f32));
        let mut text: String =
            heights.map(|(x, z)| format!("v {x} {:.4} {z}\n", (x * z / 7.0).sin())).collect();
        for (x, z) in (0..side * side).map(|i| (i % side, i / side)) {
            let first = 1 + x + z * (side + 1);
            let [right, below] = [first + 1, first + side + 1];
            text += &format!("f {first} {right} {below}\nf {right} {} {below}\n", below + 1);
        }
        text
    }

    #[test]
    fn a_mesh_is_guessed_to_have_soft_light_only_with_a_sky_and_several_samples() {
        let folder = tempfile::tempdir().unwrap();
        let device = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        let mesh = folder.path().join("mesh.obj");
        std::fs::write(&mesh, "#").unwrap();
        let is_soft = |more: &[&str]| by_file(&args(&mesh, more), &device).unwrap().1.soft_lights;
        assert!(is_soft(&[]));
        assert!(!is_soft(&["--samples", "1"]) && !is_soft(&["--plain", "--samples", "4"]));
    }
}
