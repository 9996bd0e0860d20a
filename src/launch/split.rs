//! One frame on several devices: a band of its rows on each.

use super::band::{Band, cut};
use super::{Caster, DeviceScene, DeviceTree, FrameTimes, LaunchError, Queue, Setup};
use crate::device::Device;
use crate::error::{Error, Result};
use crate::image::Radiance;
use crate::program::{BuiltProgram, ProgramSpec, Sources};
use crate::scene::Scene;
use crate::strategy::{Requirements, Strategy, Workload};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Parts of the trial frame whose costs are measured.
const PARTS: usize = 32;
/// Rows of pixels of the first trial frame; each later one has twice as many, until it takes long enough.
const TRIAL_ROWS: u32 = 256;
/// A shorter frame does not fill a device, and tells nothing of where the work lies.
const TRIAL_MS: f64 = 5.0;

/// What is cast.
pub struct Split<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// How.
    pub strategy: &'a Strategy,
    /// At which sizes; the stack's is filled in.
    pub workload: Workload,
    /// Where kernels come from.
    pub sources: &'a Sources,
    /// How often the frame is cast.
    pub repeat: u32,
}

/// A device's part of a frame.
#[derive(Clone, Debug)]
pub struct Share {
    /// The device's label.
    pub device: String,
    /// Its rows of pixels: the first, and the one after the last.
    pub rows: [u32; 2],
    /// Opening the device, building the tree and the program.
    pub build_ms: f64,
    /// Bringing the scene to the device.
    pub upload_ms: f64,
    /// The times of each cast.
    pub frames: Vec<FrameTimes>,
    /// Bringing its rows back.
    pub read_ms: f64,
}

/// A device that is ready to cast.
struct Stand {
    label: String,
    queue: Queue,
    program: BuiltProgram,
    scene: DeviceScene,
    tree: Option<DeviceTree>,
    workload: Workload,
    build_ms: f64,
}

fn failed(error: impl std::fmt::Display) -> Error {
    Error::run(format!("a device failed: {error}"))
}

impl Split<'_> {
    /// Casts the frame on all devices at once; the image, how many pixels hit, and each device's share.
    pub fn cast(&self, devices: &[Device]) -> Result<(Radiance, usize, Vec<Share>)> {
        let stands = at_once(devices, |device| self.stand(device))?;
        let Some(first) = stands.first() else { return Err(failed("there is none")) };
        let trial = self.trial(first)?;
        // Speeds are frames a millisecond.
        let speeds = at_once(&stands, |stand| self.whole_ms(stand, &trial).map(|ms| 1.0 / ms))?;
        let costs = self.costs(first, &trial)?;
        let bands = cut(self.group_rows(&self.workload), &costs, &speeds);
        let pairs: Vec<(&Stand, Band)> =
            stands.iter().zip(bands).filter(|(_, band)| !band.is_empty()).collect();
        let parts = at_once(&pairs, |(stand, band)| self.cast_band(stand, band.clone()))?;
        let [width, height] = self.workload.image_size;
        let mut image = Radiance { width, height, pixels: Vec::new() };
        let (mut hits, mut shares) = (0, Vec::new());
        for (part, part_hits, share) in parts {
            image.pixels.extend(part.pixels);
            hits += part_hits;
            shares.push(share);
        }
        Ok((image, hits, shares))
    }

    fn group_rows(&self, workload: &Workload) -> usize {
        workload.global_size(self.strategy)[1] / workload.local_size[1] as usize
    }

    fn stand(&self, device: &Device) -> Result<Stand> {
        let start = Instant::now();
        let mut workload = self.workload;
        Requirements::check(self.strategy, &workload, &device.info.limits).map_err(|infeasible| {
            Error::input(format!("{} cannot hold this: {}", device.info.label, infeasible.reason))
        })?;
        let queue = Queue::open(device.platform, device.device)?;
        let tree = DeviceTree::build(&queue, &self.scene.mesh, self.strategy).map_err(failed)?;
        workload.stack_size = tree.as_ref().map_or(0, |tree| tree.stack_size);
        let spec = ProgramSpec::new(self.sources, self.strategy, &workload, device.info.builtins())?;
        let program = BuiltProgram::build(&queue.context, queue.device, &spec).map_err(failed)?;
        let scene = DeviceScene::upload(&queue, self.scene, self.strategy).map_err(failed)?;
        let build_ms = start.elapsed().as_secs_f64() * 1e3 - scene.upload_ms;
        Ok(Stand { label: device.info.label.clone(), queue, program, scene, tree, workload, build_ms })
    }

    fn caster(
        &self,
        stand: &Stand,
        workload: &Workload,
        band: Band,
    ) -> std::result::Result<Caster, LaunchError> {
        let Stand { queue, program, scene: uploaded, tree, .. } = stand;
        let (strategy, scene, tree) = (self.strategy, self.scene, tree.as_ref());
        Caster::of_band(Setup { queue, program, strategy, workload, scene, uploaded, tree }, Some(band))
    }

    /// The frame in as few pixels as keep a device busy for a while, or in all of its own.
    fn trial(&self, stand: &Stand) -> Result<Workload> {
        let [width, height] = stand.workload.image_size;
        let mut rows = TRIAL_ROWS;
        loop {
            let smaller = height.div_ceil(rows).max(1);
            let image_size = [width.div_ceil(smaller), height.div_ceil(smaller)];
            let trial = Workload { image_size, ..stand.workload };
            if smaller == 1 || self.whole_ms(stand, &trial)? >= TRIAL_MS {
                return Ok(trial);
            }
            rows *= 2;
        }
    }

    /// What a whole frame takes.
    fn whole_ms(&self, stand: &Stand, trial: &Workload) -> Result<f64> {
        let caster = self.caster(stand, trial, 0..self.group_rows(trial)).map_err(failed)?;
        fastest_ms(&caster)
    }

    /// What each part of the trial frame takes, from top to bottom.
    fn costs(&self, stand: &Stand, trial: &Workload) -> Result<Vec<f64>> {
        let rows = self.group_rows(trial);
        let mut costs = Vec::new();
        for part in 0..PARTS {
            let band = rows * part / PARTS..rows * (part + 1) / PARTS;
            if band.is_empty() {
                // Fewer rows than parts: shared equally.
                return Ok(Vec::new());
            }
            let groups = band.len() as f64;
            let caster = self.caster(stand, trial, band).map_err(failed)?;
            // Parts differ by a row: their cost is that of a row.
            costs.push(fastest_ms(&caster)? / groups);
        }
        Ok(costs)
    }

    fn cast_band(&self, stand: &Stand, band: Band) -> Result<(Radiance, usize, Share)> {
        let workload = &stand.workload;
        let height = workload.image_size[1];
        let row_pixels = workload.group_height(self.strategy);
        let rows = [band.start, band.end].map(|row| (row as u32 * row_pixels).min(height));
        let caster = self.caster(stand, workload, band).map_err(failed)?;
        cast_first(&caster)?;
        let frames = (0..self.repeat.max(1)).map(|_| caster.cast().map_err(failed)).collect::<Result<_>>()?;
        let start = Instant::now();
        let (part, hits) = caster.read_rows(rows).map_err(failed)?;
        let share = Share {
            device: stand.label.clone(),
            rows,
            build_ms: stand.build_ms,
            upload_ms: stand.scene.upload_ms + stand.tree.as_ref().map_or(0.0, |tree| tree.upload_ms),
            frames,
            read_ms: start.elapsed().as_secs_f64() * 1e3,
        };
        Ok((part, hits, share))
    }
}

/// The first cast, which may compile: one device at a time. PoCL 3.1 counts a kernel's users wrongly where two devices of
/// one process compile it at once, and aborts when they let go of it.
fn cast_first(caster: &Caster) -> Result<()> {
    static TURN: Mutex<()> = Mutex::new(());
    // Nothing is guarded but the turn, so that a holder's panic spoils nothing.
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    caster.cast().map(drop).map_err(failed)
}

/// The fastest of a few casts after one that may compile.
fn fastest_ms(caster: &Caster) -> Result<f64> {
    cast_first(caster)?;
    let times = (0..3).map(|_| caster.cast().map_err(failed)).collect::<Result<Vec<_>>>()?;
    Ok(times.iter().map(|times| times.frame_ms).fold(f64::INFINITY, f64::min).max(1e-6))
}

/// Does the same with each, each in a thread of its own.
fn at_once<A: Sync, B: Send>(all: &[A], work: impl Fn(&A) -> Result<B> + Sync) -> Result<Vec<B>> {
    let work = &work;
    std::thread::scope(|scope| {
        let threads: Vec<_> = all.iter().map(|one| scope.spawn(move || work(one))).collect();
        let ended = |thread: std::thread::ScopedJoinHandle<'_, Result<B>>| {
            thread.join().unwrap_or_else(|_| Err(failed("its thread panicked")))
        };
        threads.into_iter().map(ended).collect()
    })
}
