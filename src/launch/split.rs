//! One frame on several devices: a band of its rows on each.

use super::band::{Band, cut};
use super::{Caster, FrameTimes, Prepared, Session};
use crate::device::Device;
use crate::error::{Error, Result};
use crate::image::Radiance;
use crate::program::Sources;
use crate::scene::Scene;
use crate::strategy::{Strategy, Workload};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Parts of the trial frame whose costs are measured.
const PARTS: usize = 32;
/// Rows of pixels of the first trial frame; each later one has twice as many, until it takes long enough.
const TRIAL_ROWS: u32 = 256;
/// A shorter frame does not fill a device, and does not show where the work lies.
const TRIAL_MS: f64 = 5.0;

/// What is cast.
pub struct Split<'a> {
    /// The scene.
    pub scene: Arc<Scene>,
    /// The strategy.
    pub strategy: Strategy,
    /// Pixels across and down.
    pub image_size: [u32; 2],
    /// Work-items of a work-group across and down.
    pub local_size: [u32; 2],
    /// Where kernels come from.
    pub sources: &'a Sources,
    /// How often the frame is cast.
    pub repeat: u32,
    /// Whether the image is compared with the reference.
    pub verifies: bool,
}

/// A device's part of a frame.
#[derive(Clone, Debug)]
pub struct Share {
    /// The device's label.
    pub device: String,
    /// Its rows of pixels: the first, and the one after the last.
    pub rows: [u32; 2],
    /// Opening the device, building the tree and the program, and preparing records of triangles.
    pub build_ms: f64,
    /// Bringing the scene to the device.
    pub upload_ms: f64,
    /// The times of each cast.
    pub frames: Vec<FrameTimes>,
    /// Bringing its rows back.
    pub read_ms: f64,
}

/// A device that is ready to cast.
struct PreparedDevice {
    label: String,
    prepared: Prepared,
    build_ms: f64,
}

impl PreparedDevice {
    /// A caster of some rows of work-groups of a frame of other sizes.
    fn caster(&self, workload: &Workload, band: Band) -> Result<Caster> {
        self.prepared.caster_of(workload, Some(band)).map_err(|refused| refused.into_error(&self.label))
    }
}

fn failed(error: impl std::fmt::Display) -> Error {
    Error::run(format!("a device failed: {error}"))
        .with_help("leave it out of --devices; `raycl devices` lists them")
}

impl Split<'_> {
    /// Casts the frame on all devices at once; the image, how many pixels hit, and each device's share.
    pub fn cast(&self, devices: &[Device]) -> Result<(Radiance, usize, Vec<Share>)> {
        let devices_ready = at_once(devices, |device| self.ready(device))?;
        let Some(first) = devices_ready.first() else { return Err(failed("there is none")) };
        let trial = self.trial(first)?;
        // Speeds are frames per millisecond.
        let speeds = at_once(&devices_ready, |ready| self.whole_ms(ready, &trial).map(|ms| 1.0 / ms))?;
        let costs = self.costs(first, &trial)?;
        let bands = cut(self.group_rows(&first.prepared.workload), &costs, &speeds);
        let pairs: Vec<(&PreparedDevice, Band)> =
            devices_ready.iter().zip(bands).filter(|(_, band)| !band.is_empty()).collect();
        let parts = at_once(&pairs, |(ready, band)| self.cast_band(ready, band.clone()))?;
        let [width, height] = self.image_size;
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
        workload.global_size(&self.strategy)[1] / workload.local_size[1] as usize
    }

    fn ready(&self, device: &Device) -> Result<PreparedDevice> {
        let start = Instant::now();
        let label = device.info.label.clone();
        let session = Session::open(device, self.sources, Arc::clone(&self.scene))?;
        let prepared =
            session.verifying(self.verifies).prepare(&self.strategy, self.image_size, self.local_size);
        let prepared = prepared.map_err(|refused| refused.into_error(&label))?;
        let build_ms = start.elapsed().as_secs_f64() * 1e3 - prepared.upload_ms();
        Ok(PreparedDevice { label, prepared, build_ms })
    }

    /// The frame in as few pixels as keep a device busy for a while, or in all of its own.
    fn trial(&self, ready: &PreparedDevice) -> Result<Workload> {
        let [width, height] = self.image_size;
        let mut rows = TRIAL_ROWS;
        loop {
            let smaller = height.div_ceil(rows).max(1);
            let image_size = [width.div_ceil(smaller), height.div_ceil(smaller)];
            let trial = Workload { image_size, ..ready.prepared.workload };
            if smaller == 1 || self.whole_ms(ready, &trial)? >= TRIAL_MS {
                return Ok(trial);
            }
            rows *= 2;
        }
    }

    /// What a whole frame takes.
    fn whole_ms(&self, ready: &PreparedDevice, trial: &Workload) -> Result<f64> {
        fastest_ms(&ready.caster(trial, 0..self.group_rows(trial))?)
    }

    /// What each part of the trial frame takes, from top to bottom.
    fn costs(&self, ready: &PreparedDevice, trial: &Workload) -> Result<Vec<f64>> {
        let rows = self.group_rows(trial);
        let mut costs = Vec::new();
        for part in 0..PARTS {
            let band = rows * part / PARTS..rows * (part + 1) / PARTS;
            if band.is_empty() {
                // Fewer rows than parts: shared equally.
                return Ok(Vec::new());
            }
            let groups = band.len() as f64;
            // Parts differ by a row: their cost is that of a row.
            costs.push(fastest_ms(&ready.caster(trial, band)?)? / groups);
        }
        Ok(costs)
    }

    fn cast_band(&self, ready: &PreparedDevice, band: Band) -> Result<(Radiance, usize, Share)> {
        let workload = &ready.prepared.workload;
        let height = self.image_size[1];
        let row_pixels = workload.group_height(&self.strategy);
        let rows = [band.start, band.end].map(|row| (row as u32 * row_pixels).min(height));
        let caster = ready.caster(workload, band)?;
        cast_first(&caster)?;
        let frames = (0..self.repeat.max(1)).map(|_| caster.cast().map_err(failed)).collect::<Result<_>>()?;
        let start = Instant::now();
        let (part, hits) = caster.read_rows(rows).map_err(failed)?;
        let share = Share {
            device: ready.label.clone(),
            rows,
            build_ms: ready.build_ms + caster.records_ms().unwrap_or(0.0),
            upload_ms: ready.prepared.upload_ms(),
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
    // The lock guards no data, only the order, so a panic of its holder does no harm.
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
