//! The stable interface for other programs: cast a picture, read hits, run an experiment.

use crate::cli::choice::{chosen_strategy, one_device};
use crate::cli::{Cli, prepare_for_drivers, run};
use crate::device::Device;
use crate::device_lock::check_folder;
use crate::error::{Error, Result};
use crate::image::{Radiance, check_alpha, save};
use crate::launch::{Refused, Session};
use crate::output::{Choice, Target};
use crate::own_program::is_worker;
use crate::printer;
use crate::program::Sources;
use crate::record::Record;
use crate::reference::layers::{Layers, layers};
use crate::scene::{Display, Loaded, Scene};
use crate::strategy::{Culling, Task};
use std::path::Path;
use std::sync::Arc;

/// A scene and an open device, ready to cast pictures.
pub struct Raycaster {
    device: Device,
    session: Session,
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
    /// devices with the same name. The first device that matches is used. If `device` is `None`, the device
    /// that the environment variable `RAYCL_DEVICE` names is used. If this variable is not set, a GPU is used
    /// if there is one, else an accelerator, else a CPU. Of several such devices, the one with the most
    /// compute units is used.
    ///
    /// # Errors
    ///
    /// Fails if no device matches, or none is usable.
    pub fn open(scene: Scene, device: Option<&str>) -> Result<Self> {
        let sources = Sources::Embedded;
        let device = one_device(device, &sources)?;
        let scene = Arc::new(scene);
        let session = Session::open(&device, &sources, Arc::clone(&scene))?;
        Ok(Self { device, session, scene })
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
    /// Fails if the strategy has an unknown name or value, if its values contradict each other, if it needs more memory
    /// than the device or the host has, or if the driver fails.
    pub fn cast(&mut self, strategy: Option<&str>, size: [u32; 2]) -> Result<Picture> {
        let task = Task::of(&self.scene, size, false);
        let (strategy, local_size) = chosen_strategy(strategy, &[], &self.device.info.limits, task)?;
        let refused = |refused: Refused| refused.into_error(&self.device.info);
        let prepared = self.session.prepare(&strategy, size, local_size).map_err(refused)?;
        let caster = prepared.caster().map_err(refused)?;
        let times = caster.cast().map_err(Refused::at("the launch")).map_err(refused)?;
        let read = caster.read().map_err(Refused::at("reading the image"));
        let (radiance, hit_pixels) = read.map_err(refused)?;
        Ok(Picture { radiance, hit_pixels, frame_ms: times.frame_ms, display: self.scene.display })
    }
}

impl Picture {
    /// Writes the picture in the format of the file's extension. PNG and JPEG files contain the picture after the
    /// scene's display transform; EXR and HDR files contain linear radiance. A file that raycl did not make, or that
    /// somebody has changed, is never replaced.
    ///
    /// # Errors
    ///
    /// Fails if the extension names no supported format, if the file cannot be written, or if a file exists that is not
    /// replaced. Also fails if the scene's background is transparent and the format has no alpha channel.
    pub fn save(&self, path: &Path) -> Result<()> {
        let target = Target::new(path, Choice::without_force("save(OTHER_PATH)"));
        if !self.radiance.coverage.is_empty() {
            check_alpha(&target)?;
        }
        save(&self.radiance, self.display, &target)
    }
}

/// Returns what the ray of each pixel hits: depth, normal, triangle and object. The rays are cast on the host
/// in double precision, without a device.
///
/// # Errors
///
/// Fails if the scene has more triangles than a tree can index (33,554,432).
pub fn hits(loaded: &Loaded, size: [u32; 2]) -> Result<Layers> {
    layers(&loaded.scene, &loaded.object_starts, size, Culling::None)
}

/// Runs an experiment as `raycl run CONFIG --out OUT --device WORD...` does. With `resume`, continues an interrupted
/// run. Worker processes measure the points. Each worker process is the calling program, started again; therefore the
/// program's `main` must begin with [`serve_if_worker`]. raycl sets the environment variable `RAYCL_WORKER` for its
/// workers. Where this variable is set, `run_experiment` fails: otherwise, a program without `serve_if_worker` would
/// start itself again and again.
///
/// From the first call on, Ctrl-C (SIGINT) and SIGTERM interrupt the run instead of ending the process; a second signal
/// ends the process. A signal between two calls of this function interrupts the second call.
///
/// # Errors
///
/// Fails if the config has a mistake (the message names its line), if the folder `out` contains files that
/// are not results, or if the environment variable `RAYCL_LOCK_DIR` is not an absolute path. Also fails if
/// the run is interrupted, or if the calling process is a worker. A point that fails is not an error: its
/// record states the reason.
pub fn run_experiment(config: &Path, out: &Path, devices: &[&str], resume: bool) -> Result<Vec<Record>> {
    if is_worker() {
        return Err(Error::input(
            "run_experiment started this process as a worker, which cannot run an experiment itself",
        )
        .with_help("call raycl::serve_if_worker first in `main`: it does the work of a worker and ends it"));
    }
    check_folder()?;
    let devices: Vec<String> = devices.iter().map(|&word| word.to_owned()).collect();
    let mut arguments = run::Args::of(config.to_owned(), out, &devices, &[]);
    arguments.resume = resume;
    let measured = run::measure_resumably(&arguments, &mut ());
    // The caller learns of the interruption from this error, so the interruption must not end the next run as well.
    if matches!(measured, Err(Error::Interrupted { .. })) {
        run::forget_interruption();
    }
    Ok(measured?.1)
}

/// If raycl started this process as a worker, does the worker's task and then ends the process. The task is
/// to measure points, to list devices, or to compile a program. raycl starts a worker with the argument
/// `worker` and the environment variable `RAYCL_WORKER`. In other processes, sets the environment variables
/// that `raycl run` sets for drivers: they limit and pin the threads of PoCL (an OpenCL driver for CPUs), and
/// give it a folder that it can write. Call this function first in the `main` of a program that runs
/// experiments, before the program starts a thread.
pub fn serve_if_worker() {
    if !is_worker() || std::env::args_os().nth(1).is_none_or(|word| word != "worker") {
        prepare_for_drivers(true);
        return;
    }
    let code = match Cli::read().and_then(Cli::run) {
        Ok(()) => 0,
        Err(error) => {
            printer::tell(format!("{error}; {}", error.remedy()));
            i32::from(error.exit_code())
        }
    };
    std::process::exit(code);
}
