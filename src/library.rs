//! The stable interface for other programs: cast a picture, read hits, run an experiment.

use crate::cli::choice::{chosen_strategy, one_device};
use crate::cli::{Cli, prepare_for_drivers, run};
use crate::device::{Device, DeviceInfo, guarded, report_panics};
use crate::error::{Error, Result};
use crate::image::{Radiance, check_alpha, check_image, check_target, save};
use crate::launch::{Refused, Session};
use crate::memory::Available;
use crate::output::{Choice, Target};
use crate::own_program::is_worker;
use crate::printer;
use crate::program::Sources;
use crate::record::Record;
use crate::reference::cost::Cost;
use crate::reference::layers::{Layers, PixelHit, layers};
use crate::scene::{Display, Loaded, MAX_POWER, Scene, SkyPicture};
use crate::settings::check_variables;
use crate::strategy::{Culling, Task};
use std::mem::ManuallyDrop;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The largest width or height of a picture in pixels, as for `raycl render`.
const MAX_SIDE: u32 = 65_536;
/// Bytes per pixel that [`hits`] needs: two counts, a hit (which may be missing), and the layers (11 numbers of 4
/// bytes) that are made from the counts and the hit.
const LAYERS_BYTES: u64 = (size_of::<Cost>() + size_of::<Option<PixelHit>>() + 11 * 4) as u64;
/// The note that is added to the remedies of errors that name options of the command `raycl`.
const OPTIONS: &str = "(options such as --device belong to the command `raycl`; a program passes arguments to raycl's functions instead)";

/// True if this process has called [`serve_if_worker`].
static SERVES: AtomicBool = AtomicBool::new(false);

/// A scene and an open device, ready to cast pictures.
pub struct Raycaster {
    device: Device,
    /// The scene on the open device; `None` after the driver has failed.
    session: Option<Session>,
    scene: Arc<Scene>,
}

/// A picture and the time that its frame took.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Radiance at every pixel.
    pub radiance: Radiance,
    /// Number of pixels whose ray hit something.
    pub hit_pixels: usize,
    /// Device time of the frame.
    pub frame_ms: f64,
    display: Display,
}

impl Raycaster {
    /// Opens a device for a scene. `device` is a part of the device's name, platform or vendor, a kind of
    /// device (`cpu`, `gpu` or `accelerator`), or the label that `raycl devices` shows for one of several
    /// devices with the same name. `open` uses the first usable device that matches. If `device` is `None`, the device
    /// that the environment variable `RAYCL_DEVICE` names is used. If this variable is not set, a GPU is used if a GPU
    /// is usable, else a CPU, else an accelerator. Of several GPUs, raycl prefers those with memory of their own. Of
    /// several GPUs with memory of their own, raycl prefers those with a vendor's driver. Of devices that are equal in
    /// kind, memory and driver, the device with the most compute units is used.
    ///
    /// `open` does not limit the threads of PoCL (an OpenCL driver for CPUs). If a program calls
    /// [`serve_if_worker`] before `open`, PoCL starts no more threads than the program may run at the same
    /// time, unless the user's environment variables say otherwise. `raycl render` limits PoCL's threads in the same
    /// way.
    ///
    /// The crate `ocl` panics at some failures of a driver. `open` and [`Self::cast`] turn these panics of
    /// `ocl` into errors. To turn panics into errors, the first call of `open` sets a panic hook, which hides
    /// the panics that become errors; all other panics reach the hook that was set before. A program that
    /// sets a panic hook of its own should set the hook before the first call of `open`.
    ///
    /// # Errors
    ///
    /// Fails if
    ///
    /// - the scene has a mistake, such as no triangle, an index out of bounds, or a number that is not finite or not in
    ///   its range (scenes from [`load_scene`](crate::load_scene) have no such mistake, unless the program changed
    ///   them),
    /// - one of raycl's environment variables, such as `RAYCL_CACHE_MIB`, has a value that cannot be used,
    /// - no device matches, or no device is usable,
    /// - the driver fails.
    pub fn open(scene: Scene, device: Option<&str>) -> Result<Self> {
        check_scene(&scene)?;
        check_variables()?;
        let (sources, scene) = (Sources::Embedded, Arc::new(scene));
        let open = || -> Result<(Device, Session)> {
            let device = one_device(device, &sources)?;
            let session = Session::open(&device, &sources, Arc::clone(&scene))?;
            Ok((device, session))
        };
        let (device, session) = guarded(open).flatten().map_err(for_programs)?;
        Ok(Self { device, session: Some(session), scene })
    }

    /// Returns the device's name.
    pub fn device(&self) -> &str {
        &self.device.info.name
    }

    /// Casts a picture of `size` pixels (across, down). The strategy is written as for `raycl render --strategy`: a
    /// preset (`naive`), values of axes (`width=4`), or both (`deferred,width=4`). If `strategy` is `None`, raycl uses
    /// the strategy that it expects to be the fastest for the device and the scene. Compiled programs are stored in
    /// raycl's cache.
    ///
    /// # Errors
    ///
    /// Fails if
    ///
    /// - the width or the height is not from 1 to 65,536,
    /// - the strategy has an unknown name or value, or its values contradict each other,
    /// - the strategy does not support the device or the scene,
    /// - casting needs more memory than the device or the host has,
    /// - the driver fails.
    ///
    /// After a failed launch, the `Raycaster` casts no more pictures: open another `Raycaster`. The scene and the
    /// device memory of the failed `Raycaster` are not freed, since freeing could fail too.
    ///
    /// One kind of failure still ends the process: if a driver refuses to free several objects, the crate
    /// `ocl` panics while it handles a panic, and Rust aborts the process. After a failed launch, raycl frees
    /// few objects, so an abort is unlikely. But raycl cannot prevent an abort if the driver fails while
    /// raycl opens a device, prepares a picture or drops a `Raycaster`. A panic of `ocl` while a `Raycaster`
    /// is dropped is not turned into an error.
    pub fn cast(&mut self, strategy: Option<&str>, size: [u32; 2]) -> Result<Picture> {
        check_size(size)?;
        let Some(session) = self.session.as_mut() else { return Err(closed()) };
        let (info, scene) = (&self.device.info, &*self.scene);
        let error = match guarded(|| cast_once(session, info, scene, strategy, size)) {
            Ok(Ok(picture)) => return Ok(picture),
            Ok(Err(Failed::Refused(error))) => return Err(for_programs(error)),
            Ok(Err(Failed::Lost(error))) | Err(error) => error,
        };
        // After a driver has broken down, freeing an object would panic.
        std::mem::forget(self.session.take());
        Err(for_programs(error))
    }
}

/// Why a picture could not be cast.
enum Failed {
    /// No kernel was launched, so casting other pictures may succeed.
    Refused(Error),
    /// A launch, or reading its picture, failed. The driver or its device may be broken.
    Lost(Error),
}

/// Casts a picture, as [`Raycaster::cast`] does.
fn cast_once(
    session: &mut Session,
    info: &DeviceInfo,
    scene: &Scene,
    strategy: Option<&str>,
    size: [u32; 2],
) -> std::result::Result<Picture, Failed> {
    let refused = |refused: Refused| Failed::Refused(refused.into_error(info));
    let lost = |refused: Refused| Failed::Lost(refused.into_error(info));
    let task = Task::of(scene, size, false);
    let chosen = chosen_strategy(strategy, &[], &info.limits, task);
    let (strategy, local_size) = chosen.map_err(Failed::Refused)?;
    let prepared = session.prepare_fitting(&strategy, size, local_size).map_err(refused)?;
    let caster = prepared.caster().map_err(refused)?;
    // If the launch fails, `prepared` and `caster` are not freed: freeing an object of a broken driver would
    // panic.
    let (prepared, caster) = (ManuallyDrop::new(prepared), ManuallyDrop::new(caster));
    let times = caster.cast().map_err(Refused::at("the launch")).map_err(lost)?;
    let (radiance, hit_pixels) = caster.read().map_err(Refused::at("reading the image")).map_err(lost)?;
    drop(ManuallyDrop::into_inner(caster));
    drop(ManuallyDrop::into_inner(prepared));
    Ok(Picture { radiance, hit_pixels, frame_ms: times.frame_ms, display: scene.display })
}

/// Returns the error for a picture that a caller requests after the driver has failed.
fn closed() -> Error {
    Error::run("the driver failed in an earlier call of `cast`, so this Raycaster casts no more pictures")
        .with_help("open another Raycaster; if that fails too, `raycl devices` lists other devices")
}

/// If an error's message or remedy names options of the command `raycl`, adds to the remedy a note on what
/// replaces these options in a program.
fn for_programs(error: Error) -> Error {
    let remedy = error.remedy();
    // An option is found by the space before it. The text begins with a space, since a message may begin with
    // an option.
    let text = format!(" {error} {remedy}");
    if !text.contains(" --") && !text.contains("`--") {
        return error;
    }
    let remedy = format!("{remedy} {OPTIONS}");
    error.with_help(remedy)
}

/// Checks a scene that a program may have made or changed. [`Scene::validate`] checks everything that a
/// scene's file can set, except the picture of the sky. This function also checks the picture of the sky, and
/// the values that only programs can set.
fn check_scene(scene: &Scene) -> Result<()> {
    scene.validate()?;
    let mistake = |what: &str, expected: &str| Err(Error::input(format!("{what}; expected {expected}")));
    let camera = &scene.camera;
    if !camera.shift.iter().all(|pixels| pixels.abs() <= MAX_SIDE as f32) {
        let [across, down] = camera.shift;
        return mistake(
            &format!("the camera's `shift` is [{across}, {down}]"),
            "numbers of pixels from -65,536 to 65,536; it is usually [0, 0]",
        );
    }
    if !(0.0..=1.0).contains(&camera.cone_share) {
        let share = camera.cone_share;
        return mistake(&format!("the camera's `cone_share` is {share}"), "a number from 0 to 1");
    }
    if camera.covers.is_some_and(|size| size.contains(&0)) {
        return mistake("the camera's `covers` has a side of 0 pixels", "at least 1, or None");
    }
    scene.sky.iter().filter_map(|sky| sky.picture.as_deref()).try_for_each(check_sky_picture)
}

/// Refuses a picture of the sky in four cases: it has no texels; its number of texels does not match its size; a texel
/// has a number that is not from 0 to [`MAX_POWER`]; or `ahead`, the direction of the picture's middle, is not a unit
/// vector.
fn check_sky_picture(picture: &SkyPicture) -> Result<()> {
    let SkyPicture { size: [across, down], texels, ahead, .. } = picture;
    let count = texels.len() as u64;
    if count == 0 || u64::from(*across) * u64::from(*down) != count {
        return Err(Error::input(format!(
            "the sky's picture has {across} x {down} texels, but its list `texels` has {count}; expected one element \
             per texel, and at least one texel"
        )));
    }
    if let Some(wrong) = picture.wrong_value(MAX_POWER) {
        let message = format!("the sky's picture has {wrong}; expected values from 0 to {MAX_POWER:e}");
        return Err(Error::input(message));
    }
    if (ahead.length() - 1.0).abs() < 1e-3 {
        return Ok(());
    }
    let message = format!("the middle of the sky's picture is towards {ahead}, which is not a unit vector");
    Err(Error::input(message))
}

/// Returns an error if a picture cannot have this size, in pixels across and down.
fn check_size([across, down]: [u32; 2]) -> Result<()> {
    let sides = 1..=MAX_SIDE;
    if sides.contains(&across) && sides.contains(&down) {
        return Ok(());
    }
    let message =
        format!("a picture cannot have {across} x {down} pixels; expected 1 to 65,536 in each direction");
    Err(Error::input(message).with_help("choose another size"))
}

impl Picture {
    /// Writes the picture in the format of the file's extension. PNG and JPEG files contain the picture after the
    /// scene's display transform; EXR and HDR files contain linear radiance. A file that raycl did not make, or that
    /// somebody has changed, is never replaced. If the path is `-`, a PNG is written to standard output.
    ///
    /// # Errors
    ///
    /// Fails if
    ///
    /// - the extension names no supported format,
    /// - the file cannot be written, or `path` names an existing file that must not be replaced,
    /// - the format cannot hold the picture: a JPEG has at most 65,535 pixels in each direction, raycl can write an HDR
    ///   only with finite numbers and without rows of 32,768 pixels, and JPEG and HDR have no alpha channel, which a
    ///   transparent background needs,
    /// - the program has changed `radiance` so that its lists do not match its size.
    pub fn save(&self, path: &Path) -> Result<()> {
        let target = Target::new(path, Choice::without_force("save(OTHER_PATH)"));
        check_target(&target, [self.radiance.width, self.radiance.height])?;
        check_image(&self.radiance, &target)?;
        if !self.radiance.coverage.is_empty() {
            check_alpha(&target)?;
        }
        save(&self.radiance, self.display, &target)
    }
}

/// Returns layers that describe each pixel: what its ray hits (depth, normal, base colour, triangle and
/// object), and how many triangle tests and nodes its rays need in a tree. The rays are cast on the host in
/// double precision, without a device. [`Raycaster::open`] takes the scene out of `loaded`, so call `hits`
/// before `open`, or clone the scene.
///
/// # Errors
///
/// Fails if the scene has a mistake (see [`Raycaster::open`]), or more triangles than a tree can index
/// (33,554,432). Also fails if the width or the height is not from 1 to 65,536, or if the layers do not fit
/// into memory.
pub fn hits(loaded: &Loaded, size: [u32; 2]) -> Result<Layers> {
    check_size(size)?;
    check_scene(&loaded.scene)?;
    check_room(size, &Available::read())?;
    layers(&loaded.scene, &loaded.object_starts, size, Culling::None)
}

/// Returns an error if the layers of a picture do not fit into memory.
fn check_room([across, down]: [u32; 2], available: &Available) -> Result<()> {
    let bytes = u64::from(across).saturating_mul(u64::from(down)).saturating_mul(LAYERS_BYTES);
    let sum = format!("{LAYERS_BYTES} B x {across} x {down} pixels");
    available.hold(bytes, "finding the hits of a picture", &sum)
}

/// Runs an experiment as `raycl run CONFIG --out OUT --device WORD...` does, and writes the same files,
/// including the report. With `resume`, continues an interrupted run. Worker processes measure the
/// experiment's points. Each worker process is the calling program, started again; therefore the program's
/// `main` must begin with [`serve_if_worker`]. raycl sets the environment variable `RAYCL_WORKER` for its
/// workers. In a process with the variable `RAYCL_WORKER`, `run_experiment` fails, so that a worker process
/// never starts workers of its own. `run_experiment` also fails in a program that has not called
/// `serve_if_worker`, since the workers of such a program could not measure points.
///
/// The function prints nothing, not even the notes that `raycl run` prints on damaged lines of a journal or
/// on devices without locks. If another process measures on one of the experiment's devices, the function
/// waits until this device is free.
///
/// As soon as the first call of this function has read its config and checked its folder, Ctrl-C (SIGINT) and
/// SIGTERM no longer end the process: they interrupt the run. A second signal, at least 0.3 seconds after the
/// first, ends the process. A signal between two calls of this function interrupts the second call.
///
/// # Errors
///
/// Fails if
///
/// - the config has a mistake ([`Error::in_a_line`] returns the message with the file and the line),
/// - the folder `out` contains files that are not results, or `resume` is false although the folder contains results,
/// - one of raycl's environment variables, such as `RAYCL_LOCK_DIR`, has a value that cannot be used,
/// - the path `out` is an empty text, or one of the two paths is not UTF-8,
/// - a file cannot be written,
/// - the run is interrupted,
/// - the calling process is a worker, or has not called `serve_if_worker`.
///
/// A failure of a single point of the experiment is not an error: the point's record states the reason.
pub fn run_experiment(config: &Path, out: &Path, devices: &[&str], resume: bool) -> Result<Vec<Record>> {
    if is_worker() {
        return Err(Error::input(
            "run_experiment started this process as a worker, which cannot run an experiment itself",
        )
        .with_help("call raycl::serve_if_worker first in `main`: in a worker process, this function does the worker's task and ends the process"));
    }
    check_paths(config, out)?;
    if !SERVES.load(Ordering::Relaxed) {
        return Err(Error::input(
            "run_experiment was called in a program that has not called serve_if_worker",
        )
        .with_help("call raycl::serve_if_worker first in `main`: each of raycl's workers is the same program, started again"));
    }
    check_variables()?;
    let devices: Vec<String> = devices.iter().map(|&word| word.to_owned()).collect();
    let mut arguments = run::Args::of(config.to_owned(), out, &devices, &[]);
    arguments.resume = resume;
    let measured = printer::muted(|| -> Result<Vec<Record>> {
        let (out, records) = run::measure_resumably(&arguments, &mut ())?;
        run::write_report(&arguments, &out)?;
        Ok(records)
    });
    // The caller learns of the interruption from this error, so the stored interruption is cleared: the
    // interruption must not end the next run as well.
    if matches!(measured, Err(Error::Interrupted { .. })) {
        run::forget_interruption();
    }
    measured.map_err(for_programs)
}

/// Returns an error if the path `out` is an empty text, or if one of the two paths is not UTF-8: workers
/// receive the paths as JSON, which is UTF-8.
fn check_paths(config: &Path, out: &Path) -> Result<()> {
    if out.as_os_str().is_empty() {
        return Err(Error::input("the path of the folder of results is empty")
            .with_help("name a folder, such as `results/first`; `.` is the current folder"));
    }
    match [config, out].into_iter().find(|path| path.to_str().is_none()) {
        Some(path) => Err(Error::input(format!("the path {} is not UTF-8", path.display()))
            .with_help("rename the file or folder, or use a symbolic link whose path is UTF-8")),
        None => Ok(()),
    }
}

/// If raycl started this process as a worker, does the worker's task and then ends the process. The task is
/// to measure points, to list devices, or to compile a program. raycl starts a worker with the argument
/// `worker` and the environment variable `RAYCL_WORKER`. In other processes, sets the environment variables
/// that `raycl run` sets for drivers. These variables limit the number of threads of PoCL (an OpenCL driver
/// for CPUs), pin these threads where possible, and keep PoCL 7 from adding barriers to the loops of kernels. If
/// PoCL cannot use its default folder for compiled kernels, another variable names a folder that PoCL can use.
/// Call this function first in the `main` of a program that runs experiments, before the program starts a
/// thread.
pub fn serve_if_worker() {
    SERVES.store(true, Ordering::Relaxed);
    if !is_worker() || std::env::args_os().nth(1).is_none_or(|word| word != "worker") {
        prepare_for_drivers(true);
        return;
    }
    report_panics();
    let code = match Cli::read().and_then(Cli::run) {
        Ok(()) => 0,
        Err(error) => {
            printer::tell(format!("{error}; {}", error.remedy()));
            i32::from(error.exit_code())
        }
    };
    std::process::exit(code);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::fixtures;
    use crate::scene::{Sky, load_scene};
    use glam::Vec3;

    fn loaded() -> Loaded {
        load_scene(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml")).unwrap()
    }

    /// Returns a scene under a picture of the sky with this size, these texels and this direction.
    fn under(size: [u32; 2], texels: &[[f32; 3]], ahead: Vec3) -> Scene {
        let picture = SkyPicture { size, texels: texels.into(), ahead, is_seen: false };
        let [zenith, horizon, up] = [Vec3::ZERO, Vec3::ZERO, Vec3::Y];
        let sky = Sky { zenith, horizon, up, reach: 1.0, picture: Some(Arc::new(picture)) };
        Scene { sky: Some(sky), ..fixtures::single_triangle() }
    }

    /// Returns the message with which both `open` and `hits` refuse a scene.
    #[track_caller]
    fn refusal(scene: Scene) -> String {
        let loaded = Loaded { scene: scene.clone(), ..loaded() };
        let errors = [Raycaster::open(scene, None).err(), hits(&loaded, [8, 5]).err()];
        let [one, other] = errors.map(Option::unwrap);
        assert_eq!((one.exit_code(), one.to_string()), (2, other.to_string()));
        one.to_string()
    }

    #[test]
    fn a_scene_that_a_program_changed_is_checked_before_it_is_used() {
        let changed = |change: fn(&mut Scene)| {
            let mut scene = fixtures::single_triangle();
            change(&mut scene);
            refusal(scene)
        };
        let index = "a triangle names a vertex, normal or material that does not exist";
        assert!(changed(|scene| scene.mesh_mut().triangles[0].material = 2_000_000_000).contains(index));
        assert!(changed(|scene| scene.mesh_mut().triangles[0].positions[1] = 3_000).contains(index));
        assert!(changed(|scene| scene.mesh_mut().triangles.clear()).contains("no triangles"));
        assert!(changed(|scene| scene.camera.position.x = f32::NAN).contains("the camera is at"));
        assert!(changed(|scene| scene.camera.tan_half_fov = f32::NAN).contains("tan_half_fov is NaN"));
        assert!(changed(|scene| scene.camera.shift = [f32::NAN, 1e30]).contains("`shift` is [NaN, 1"));
        assert!(changed(|scene| scene.camera.shift = [0.0, 1e30]).contains("`shift` is [0, 1"));
        assert!(changed(|scene| scene.camera.cone_share = f32::NAN).contains("`cone_share` is NaN"));
        assert!(changed(|scene| scene.camera.cone_share = 1.5).contains("`cone_share` is 1.5"));
        assert!(changed(|scene| scene.camera.covers = Some([0, 5])).contains("`covers`"));
        assert!(check_scene(&fixtures::single_triangle()).is_ok());
    }

    #[test]
    fn a_picture_of_the_sky_has_as_many_texels_as_its_size_says() {
        let white = [[1.0; 3]; 8];
        assert!(check_scene(&under([4, 2], &white, Vec3::X)).is_ok());
        for (size, texels) in [([4, 2], 7), ([4, 3], 8), ([0, 5], 0)] {
            let message = refusal(under(size, &white[..texels], Vec3::X));
            assert!(message.contains(&format!("its list `texels` has {texels};")), "{message}");
        }
        for ahead in [Vec3::NAN, 2.0 * Vec3::X] {
            assert!(refusal(under([4, 2], &white, ahead)).contains("not a unit vector"), "{ahead}");
        }
    }

    #[test]
    fn the_texels_of_a_picture_of_the_sky_are_radiances() {
        let of = |value: f32| {
            let mut texels = [[1.0; 3]; 8];
            texels[6][1] = value;
            under([4, 2], &texels, Vec3::X)
        };
        assert!([0.0, MAX_POWER].into_iter().all(|value| check_scene(&of(value)).is_ok()));
        for (value, shown) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (-0.5, "-0.5"), (2e28, "2e28")] {
            let texel = format!("a value of [1.0, {shown}, 1.0] in column 2, row 1 (from 0)");
            let expected = format!("the sky's picture has {texel}; expected values from 0 to 1e28");
            assert_eq!(refusal(of(value)), expected);
        }
    }

    #[test]
    fn a_picture_has_as_many_pixels_as_the_commands_allow() {
        assert!(check_size([1, 65_536]).is_ok() && check_size([65_536, 1]).is_ok());
        let loaded = loaded();
        for size in [[0, 5], [5, 0], [65_537, 1], [1, 65_537], [u32::MAX; 2]] {
            let error = hits(&loaded, size).unwrap_err();
            let expected =
                format!("{} x {} pixels; expected 1 to 65,536 in each direction", size[0], size[1]);
            assert!(error.exit_code() == 2 && error.to_string().ends_with(&expected), "{error}");
        }
        let mut caster = Raycaster::open(loaded.scene, None).unwrap();
        assert_eq!(caster.cast(Some("naive"), [0, 5]).unwrap_err().exit_code(), 2);
        let picture = caster.cast(Some("naive"), [8, 5]).unwrap();
        assert_eq!((picture.radiance.pixels.len(), picture.radiance.width), (40, 8));
    }

    #[test]
    fn layers_that_do_not_fit_into_memory_are_refused() {
        let check = |bytes| {
            let available = Available { bytes, source: "a test".to_owned() };
            check_room([65_536, 65_536], &available).map_err(|error| error.to_string())
        };
        assert_eq!(check(88 << 32), Ok(()));
        let message = check((88 << 32) - 1).unwrap_err();
        assert!(message.contains("(88 B x 65536 x 65536 pixels = 377957122048 B)"), "{message}");
    }

    /// The pattern names every field of `Layers`. If a layer is added, this test therefore does not compile
    /// until the test counts this layer.
    #[test]
    fn every_layer_counts_as_memory() {
        let Layers { size, depth, normal, albedo, triangle, object, tests, nodes } =
            hits(&loaded(), [8, 5]).unwrap();
        let of_numbers = [triangle, object, tests, nodes].map(|numbers| size_of_val(&numbers[..]));
        let of_values = [size_of_val(&depth[..]), size_of_val(&normal[..]), size_of_val(&albedo[..])];
        let bytes: usize = of_numbers.iter().chain(&of_values).sum();
        let of_hit = size_of::<Cost>() + size_of::<Option<PixelHit>>();
        assert_eq!(LAYERS_BYTES as usize, of_hit + bytes / (size[0] * size[1]) as usize);
    }

    #[test]
    fn a_picture_that_a_program_changed_is_saved_only_if_it_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let radiance = Radiance::new(4, 2);
        let mut picture = Picture { radiance, hit_pixels: 0, frame_ms: 0.0, display: Display::default() };
        let mut save = |width, height, name: &str| {
            (picture.radiance.width, picture.radiance.height) = (width, height);
            let path = folder.path().join(name);
            picture.save(&path).map_err(|error| (error.exit_code(), path.exists()))
        };
        for name in ["a.png", "a.jpg", "a.exr", "a.hdr"] {
            for [width, height] in [[0, 2], [4, 0], [4, 3], [8, 2], [70_000, 1]] {
                assert_eq!(save(width, height, name), Err((2, false)), "{name}, {width} x {height}");
            }
            assert_eq!(save(4, 2, name), Ok(()), "{name}");
        }
    }

    #[test]
    fn paths_that_no_run_can_use_are_refused_at_once() {
        let refused = |config: &Path, out: &Path| {
            let error = run_experiment(config, out, &[], false).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            error.to_string()
        };
        let [config, out] = ["a.toml", "out"].map(Path::new);
        assert_eq!(refused(config, Path::new("")), "the path of the folder of results is empty");
        #[cfg(unix)]
        {
            use std::os::unix::ffi::OsStrExt as _;
            let other = Path::new(std::ffi::OsStr::from_bytes(b"t\xff"));
            for (config, out) in [(other, out), (config, other)] {
                let message = refused(config, out);
                assert!(message.ends_with(" is not UTF-8"), "{message}");
            }
        }
        // The program of these tests has not called `serve_if_worker`.
        assert!(refused(config, out).ends_with("has not called serve_if_worker"));
    }

    #[test]
    fn an_error_that_names_an_option_says_that_programs_have_none() {
        let remedy = |message: &str, help: &str| {
            for_programs(Error::input(message).with_help(help)).remedy().to_owned()
        };
        assert_eq!(remedy("a", "try again"), "try again");
        assert_eq!(remedy("a", "give another --out"), format!("give another --out {OPTIONS}"));
        for message in ["--device: no device matches 'x'", "a is too large for --width", "`--out` is empty"] {
            assert_eq!(remedy(message, "try again"), format!("try again {OPTIONS}"), "{message}");
        }
    }
}
