//! Reads the scene while the driver starts, and builds the program that the scene will probably need.

use super::timeline::Timeline;
use super::{Args, guess, hurry, large_mesh, load, may_be_shown, sampling, target, timed};
use crate::cli::choice::one_device_with;
use crate::device::{Device, DeviceInfo, LaneTest};
use crate::error::{Error, Result};
use crate::image::check_alpha;
use crate::launch::{HostTree, Queue, ShowProgram};
use crate::program::{BuiltProgram, ProgramCache, ProgramSpec, Sources};
use crate::scene::Loaded;
use crate::strategy::{Strategy, Workload};
use std::sync::mpsc::channel;
use std::thread::Builder;

/// A scene and an open device.
pub struct Opened {
    pub loaded: Loaded,
    pub device: Device,
    pub queue: Queue,
    /// Time for reading the scene and making its triangles.
    pub load_ms: f64,
    /// Time for starting the driver and opening the device, while the scene is read.
    pub start_ms: f64,
    /// The program that the scene will probably need, built while the scene is being loaded. `None` if no
    /// program could be guessed, or if its build failed. If `early` is `None`, raycl builds the scene's
    /// program later.
    pub early: Option<(ProgramSpec, BuiltProgram)>,
    /// The tree, and the strategy for which it was built. The thread that loads the scene builds the tree, while
    /// another thread opens the queue and builds the program. If no tree was built while the scene was
    /// loaded, `tree` is `None`, and raycl builds the tree later if the strategy needs one.
    pub tree: Option<(Strategy, HostTree)>,
    /// The program for the display transform (from radiance to 8-bit colours), if the device applies this transform.
    pub show: Option<ShowProgram>,
    /// The program for the display transform, if a background process is to compile this program for later commands.
    /// `None` if the program is not needed or is compiled already, or if this picture waits until the program is
    /// compiled.
    pub show_later: Option<ProgramSpec>,
}

impl Opened {
    /// Adds the parts of the work that [`open`] did to the timeline. If two parts ran in parallel, the time in which
    /// both ran counts once. The parts are, in this order: loading the scene, starting the driver, building the
    /// program, building the tree. The time of a part begins to count when all parts before it in this list have ended.
    pub fn tell(&self, timeline: &mut Timeline) {
        let show_ms = self.show.as_ref().map_or(0.0, ShowProgram::build_ms);
        let build_ms = self.early.as_ref().map_or(0.0, |(_, program)| program.build_ms) + show_ms;
        timeline.ends_with("tree", &parts(self.load_ms, self.start_ms, build_ms));
    }
}

/// Computes the parts of the timeline from three durations: of loading the scene, of starting the driver, and
/// of building the program after the driver has started. The time of a part counts from the moment
/// when all parts before it in the list have ended. If the part itself had ended by then, the returned time is
/// negative, and [`Timeline::ends_with`] counts it as 0.
fn parts(load_ms: f64, start_ms: f64, build_ms: f64) -> [(&'static str, f64); 3] {
    let waited_ms = start_ms + build_ms - load_ms.max(start_ms);
    [("load", load_ms), ("discover", start_ms - load_ms), ("build", waited_ms)]
}

/// Loads the scene while the driver starts. Starting the driver takes about 30 ms on one core. Builds the tree and the
/// program early if possible. Fails if the picture is transparent, but its file cannot have an alpha channel.
pub fn open(args: &Args, sources: &Sources) -> Result<Opened> {
    // The thread that casts also starts the driver, since not every driver can be used from a second thread
    // (Oclgrind's checks crash).
    std::thread::scope(|scope| {
        let (send_device, device_receiver) = channel();
        let read = move || {
            let (loaded, load_ms) = timed(|| load(args));
            let tree = |loaded: &Loaded| early_tree(args, &device_receiver.recv().ok()?, loaded);
            let tree = loaded.as_ref().ok().and_then(tree);
            (loaded, load_ms, tree)
        };
        let scene = Builder::new().spawn_scoped(scope, read).map_err(|error| Error::no_thread(&error))?;
        let (opened, start_ms) = timed(|| -> Result<_> {
            let hurries = hurry::may_on_a_gpu(args, guess::sampling(args));
            let lane_test = if hurries { LaneTest::Later } else { LaneTest::Now };
            let device = one_device_with(args.subject.device.as_deref(), sources, lane_test)?;
            // Sending fails if the thread that loads the scene has failed already; the error of this thread
            // is returned below.
            let _ = send_device.send(device.info.clone());
            let queue = Queue::open(&device)?;
            Ok((device, queue))
        });
        drop(send_device);
        let early = opened.as_ref().ok().and_then(|(device, queue)| early(args, sources, device, queue));
        let show = opened.as_ref().ok().map(|(device, queue)| show(args, sources, device, queue));
        let (loaded, load_ms, tree) = scene.join().map_err(|_| Error::fault("reading the scene panicked"))?;
        let (loaded, (device, queue)) = (loaded?, opened?);
        let (show, show_later) = show.transpose()?.unwrap_or_default();
        // The file format of a transparent picture must have an alpha channel. For moving pictures,
        // `Sink::check_alpha` checks this.
        if loaded.scene.transparent && !args.motion.moves() {
            check_alpha(&target(args))?;
        }
        Ok(Opened { loaded, device, queue, load_ms, start_ms, early, tree, show, show_later })
    })
}

/// Builds the tree of the requested strategy or, without a request, of the fastest strategy. Returns `None`
/// if the strategy needs no tree, or if the tree cannot be built or must be built later.
fn early_tree(args: &Args, device: &DeviceInfo, loaded: &Loaded) -> Option<(Strategy, HostTree)> {
    // Verification and layers need more memory, so the tree is built later, after a check that there is enough memory.
    if args.verify.is_some() || args.layers.is_some() {
        return None;
    }
    let scene = &loaded.scene;
    let samples = sampling(args, loaded.is_bare).most;
    let task = args.subject.task(scene, samples);
    let (strategy, local_size) = large_mesh::strategy(args, device, task).ok()?;
    let workload = Workload::of(scene, args.subject.size(), local_size);
    Some((
        strategy,
        HostTree::ahead(
            &scene.mesh,
            &strategy,
            &workload,
            &device.limits,
            large_mesh::tree_use(args, scene, samples),
        )?,
    ))
}

/// Builds the guessed program or, if the picture may be cast with [`hurry::QUICK`] and the guessed program is not
/// compiled yet, the program of [`hurry::QUICK`]. Returns `None` if no program can be guessed. If the build fails, this
/// function reports no error: raycl later builds the program that the scene needs, and reports the errors of that later
/// build.
fn early(
    args: &Args,
    sources: &Sources,
    device: &Device,
    queue: &Queue,
) -> Option<(ProgramSpec, BuiltProgram)> {
    let cache = guess::cache(args);
    let spec = guess::likely(&cache, args, sources, &device.info)?;
    let programs = ProgramCache::of(cache.clone(), &device.info);
    let hurries = hurry::may(args, &device.info, guess::sampling(args))
        && !BuiltProgram::is_cached(queue.device, &spec, &programs);
    let spec = if hurries { guess::quick(&cache, args, sources, &device.info)? } else { spec };
    let built = BuiltProgram::build(&queue.context, queue.device, &spec, &programs).ok()?;
    Some((spec, built))
}

/// Returns the program for the display transform (from radiance to 8-bit colours) if the device does not share the
/// host's memory, and the picture is needed only in 8-bit colours. If the device's compiler refuses raycl's own
/// program, the host applies the transform. If [`hurry::may`] returns true and the program is not compiled yet, the
/// picture does not wait for the program. In this case, the function returns the uncompiled program as the second
/// value.
///
/// # Errors
///
/// Fails if the program contains one of the user's kernel files and does not compile.
fn show(
    args: &Args,
    sources: &Sources,
    device: &Device,
    queue: &Queue,
) -> Result<(Option<ShowProgram>, Option<ProgramSpec>)> {
    if queue.shares_memory || !(args.motion.moves() || may_be_shown(args, &target(args))) {
        return Ok((None, None));
    }
    let programs = ProgramCache::of(guess::cache(args), &device.info);
    let spec = ShowProgram::spec(sources, queue)?;
    let hurries = hurry::may(args, &device.info, guess::sampling(args));
    if hurries && !BuiltProgram::is_cached(queue.device, &spec, &programs) {
        return Ok((None, Some(spec)));
    }
    Ok((ShowProgram::usable(queue, &spec, &programs, (sources, &device.info))?, None))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::discover;
    use clap::Parser as _;

    #[derive(clap::Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn a_display_kernel_of_the_user_is_built_or_its_mistake_is_reported_with_its_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("display/show.cl");
        std::fs::create_dir(folder.path().join("display")).expect("a folder");
        let device = discover(&Sources::Embedded).expect("devices").remove(0);
        // Only a device with memory of its own uses the kernel for the display transform.
        let queue = Queue::open(&device).expect("a queue").with_separate_memory(1 << 20);
        let args = Command::parse_from(["render", "a.obj", "--cl-dir", "mine"]).args;
        let sources = Sources::Folder(folder.path().to_owned());
        let shown = |text: &str| {
            std::fs::write(&file, text).expect("a file");
            show(&args, &sources, &device, &queue)
        };
        let right = Sources::Embedded.read("display/show.cl").expect("a kernel file");
        assert!(matches!(shown(&right), Ok((Some(_), None))));
        let red = "bytes[3 * i] = shown(pixel.x, smallest, at_least);";
        assert_eq!(right.matches(red).count(), 1);
        let error = shown(&right.replace(red, "bytes[3 * i] = ;")).expect_err("it does not compile");
        let message = error.to_string();
        assert_eq!(error.exit_code(), 2, "{message}");
        assert!(message.starts_with("a kernel file does not compile: "), "{message}");
        assert!(message.contains(&format!("{}:", file.display())), "{message}");
        // The mistake that prevents compilation may also be in a file that the user's kernel file includes.
        let included = folder.path().join("display/mine.cl");
        std::fs::write(&included, "uchar mine(;\n").expect("a file");
        let included_first = format!("#include \"display/mine.cl\"\n{right}");
        let message = shown(&included_first).expect_err("it does not compile").to_string();
        assert!(message.contains(&format!("{}:1", included.display())), "{message}");
    }

    #[test]
    fn a_device_converts_the_frames_of_every_moving_picture() {
        let device = discover(&Sources::Embedded).expect("devices").remove(0);
        let queue = Queue::open(&device).expect("a queue").with_separate_memory(1 << 20);
        for name in ["a.png", "a.apng", "-"] {
            let args = Command::parse_from(["render", "a.obj", "--turntable", "4", "-o", name]).args;
            assert!(
                matches!(show(&args, &Sources::Embedded, &device, &queue), Ok((Some(_), None))),
                "{name}"
            );
        }
    }

    #[test]
    fn work_that_is_done_while_the_scene_is_loaded_takes_no_time_of_its_own() {
        let times = |load_ms, start_ms, build_ms| {
            let parts = parts(load_ms, start_ms, build_ms);
            assert_eq!(parts.map(|(part, _)| part), ["load", "discover", "build"]);
            parts.map(|(_, ms)| ms.max(0.0))
        };
        assert_eq!(times(10.0, 30.0, 5.0), [10.0, 20.0, 5.0]);
        assert_eq!(times(33.0, 30.0, 5.0), [33.0, 0.0, 2.0]);
        assert_eq!(times(50.0, 30.0, 5.0), [50.0, 0.0, 0.0]);
    }
}
