//! What other programs may build upon: casting a picture, reading hits, running an experiment.

use crate::cli::choice::{chosen_strategy, one_device};
use crate::cli::{Cli, run};
use crate::device::Device;
use crate::error::Result;
use crate::image::{Radiance, save};
use crate::launch::{Refused, Session};
use crate::output::{Choice, Target};
use crate::printer;
use crate::program::Sources;
use crate::record::Record;
use crate::reference::layers::{Layers, layers};
use crate::scene::{Display, Loaded, Scene};
use crate::strategy::{Culling, Task};
use std::path::Path;
use std::sync::Arc;

/// A scene on an open device, ready to be cast.
pub struct Raycaster {
    device: Device,
    session: Session,
    scene: Arc<Scene>,
}

/// A picture and how long it took.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Radiance at every pixel.
    pub radiance: Radiance,
    /// Pixels whose ray hit something.
    pub hit_pixels: usize,
    /// Device time of the frame.
    pub frame_ms: f64,
    display: Display,
}

impl Raycaster {
    /// Opens a device for a scene: the first that matches a word of its name, platform or vendor, or `cpu` or `gpu`; without a
    /// word the one that `RAYCL_DEVICE` names, or the most capable one.
    ///
    /// # Errors
    /// If no device matches, or none is usable.
    pub fn open(scene: Scene, device: Option<&str>) -> Result<Self> {
        let sources = Sources::Embedded;
        let device = one_device(device, &sources)?;
        let scene = Arc::new(scene);
        let session = Session::open(&device, &sources, Arc::clone(&scene))?;
        Ok(Self { device, session, scene })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        &self.device.info.name
    }

    /// Casts a picture of so many pixels across and down, by a strategy as `raycl render --strategy` takes it (a preset, axes, or
    /// both: `naive`, `deferred,width=4`), or the fastest that is known for the device and the scene. Programs are compiled once
    /// and kept, as raycl itself does.
    ///
    /// # Errors
    /// If the strategy contradicts itself, if device or host cannot hold it, or if the driver fails.
    pub fn cast(&mut self, strategy: Option<&str>, size: [u32; 2]) -> Result<Picture> {
        let task = Task::of(&self.scene, size, false);
        let (strategy, local_size) = chosen_strategy(strategy, &[], &self.device.info.limits, task)?;
        let refused = |refused: Refused| refused.into_error(&self.device.info.name);
        let prepared = self.session.prepare(&strategy, size, local_size).map_err(refused)?;
        let caster = prepared.caster().map_err(refused)?;
        let times = caster.cast().map_err(Refused::at("the launch")).map_err(refused)?;
        let read = caster.read().map_err(Refused::at("reading the image"));
        let (radiance, hit_pixels) = read.map_err(refused)?;
        Ok(Picture { radiance, hit_pixels, frame_ms: times.frame_ms, display: self.scene.display })
    }
}

impl Picture {
    /// Writes it as the file's ending says: PNG and JPEG as the scene's display shows it, EXR and HDR as radiance. A file that
    /// raycl did not make stays.
    ///
    /// # Errors
    /// If the ending is none of these, or the file cannot be written or is another program's.
    pub fn save(&self, path: &Path) -> Result<()> {
        let choice = Choice { force: false, elsewhere: "another path" };
        save(&self.radiance, self.display, &Target::new(path, choice))
    }
}

/// What each pixel's ray hits: depth, normal, triangle, object. Cast on the host in double precision, without a device.
///
/// # Errors
/// If the scene has more triangles than a tree can name.
pub fn hits(loaded: &Loaded, size: [u32; 2]) -> Result<Layers> {
    layers(&loaded.scene, &loaded.object_starts, size, Culling::None)
}

/// Runs an experiment as `raycl run CONFIG --out OUT --device WORD...` does, and goes on where an interrupted one ended if `resume` is set.
/// Points are measured in processes of their own: this program, started again. Its `main` therefore begins with
/// [`serve_if_worker`].
///
/// # Errors
/// A mistake in the config, with its line; a folder that holds something else; an interruption. A point that fails is a record
/// with its reason, and no error.
pub fn run_experiment(config: &Path, out: &Path, devices: &[&str], resume: bool) -> Result<Vec<Record>> {
    let devices: Vec<String> = devices.iter().map(|&word| word.to_owned()).collect();
    let arguments = run::Args::of(config.to_owned(), out, &devices, &[], [resume, false]);
    Ok(run::measure(&arguments, &mut ())?.1)
}

/// The first line of the `main` of a program that runs experiments. Where the process was started as a worker of one, it measures
/// and ends; otherwise nothing happens.
pub fn serve_if_worker() {
    if std::env::args_os().nth(1).is_none_or(|word| word != "worker") {
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
