//! One frame on several devices: a band of its rows on each.

use super::band::{Band, Cost, balance, rows};
use super::{Caster, FrameTimes, Prepared, Session};
use crate::device::Device;
use crate::error::{Error, Result};
use crate::image::Radiance;
use crate::program::Sources;
use crate::scene::Scene;
use crate::strategy::{Strategy, Workload};
use std::sync::{Arc, Barrier, Mutex, PoisonError};
use std::time::Instant;

/// Parts of the trial frame whose costs are measured.
const PARTS: usize = 32;
/// Rows of pixels of the first trial frame; each later one has twice as many, until it takes long enough.
const TRIAL_ROWS: u32 = 256;
/// A shorter frame does not fill a device, and does not show where the work lies.
const TRIAL_MS: f64 = 5.0;
/// Casts of which the fastest, or the median, counts.
const CASTS: usize = 3;
/// A device that takes more times as long as the fastest one could save a tenth of the frame at most, and costs more if its rows take
/// a little longer than was measured.
const SLOWEST: f64 = 10.0;

/// What is cast.
pub struct Split<'a> {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Pixels across and down.
    pub image_size: [u32; 2],
    /// Where kernels come from.
    pub sources: &'a Sources,
    /// How often the frame is cast.
    pub repeat: u32,
    /// Whether the image is compared with the reference.
    pub verifies: bool,
    /// Whether those devices cast, too, that slow the frame.
    pub every_device: bool,
}

/// A device, and how it casts.
#[derive(Clone, Debug)]
pub struct Casting {
    /// The device.
    pub device: Device,
    /// How.
    pub strategy: Strategy,
    /// Work-items of a work-group across and down.
    pub local_size: [u32; 2],
}

/// A device's part of a frame.
#[derive(Clone, Debug)]
pub struct Share {
    /// The device's label.
    pub device: String,
    /// How it casts.
    pub strategy: Strategy,
    /// Work-items of a work-group across and down.
    pub local_size: [u32; 2],
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

/// A device without a part.
#[derive(Clone, Debug, serde::Serialize)]
pub struct LeftOut {
    /// The device's label.
    pub device: String,
    /// Why.
    pub reason: String,
}

/// A frame that several devices cast.
pub struct Whole {
    /// Its image.
    pub image: Radiance,
    /// Pixels that hit something.
    pub hits: usize,
    /// What each device did.
    pub shares: Vec<Share>,
    /// Devices that would have slowed the frame.
    pub left_out: Vec<LeftOut>,
}

/// A device that is ready to cast.
struct Ready {
    label: String,
    strategy: Strategy,
    prepared: Prepared,
    build_ms: f64,
}

impl Ready {
    /// The workload of a frame of other sizes.
    fn at(&self, image_size: [u32; 2]) -> Workload {
        Workload { image_size, ..self.prepared.workload }
    }

    /// A caster of some rows of pixels of a frame of some size, and of what is left of their work-groups.
    fn caster(&self, image_size: [u32; 2], [first, end]: [u32; 2]) -> Result<Caster> {
        let group = self.group_height();
        let band: Band = (first / group) as usize..end.div_ceil(group) as usize;
        let caster = self.prepared.caster_of(&self.at(image_size), Some(band));
        caster.map_err(|refused| refused.into_error(&self.label))
    }

    /// Rows of pixels of a work-group.
    fn group_height(&self) -> u32 {
        self.prepared.workload.group_height(&self.strategy)
    }

    /// What a whole frame takes.
    fn whole_ms(&self, image_size: [u32; 2]) -> Result<f64> {
        fastest_ms(&self.caster(image_size, [0, image_size[1]])?)
    }

    /// What each part of a frame takes, from top to bottom; nothing where there are fewer rows of work-groups than parts.
    fn parts(&self, image_size: [u32; 2]) -> Result<Vec<f64>> {
        let (group, height) = (self.group_height(), image_size[1]);
        let groups = height.div_ceil(group) as usize;
        let end = |part: usize| ((groups * part / PARTS) as u32 * group).min(height);
        if groups < PARTS {
            return Ok(Vec::new());
        }
        let part_ms = |part: usize| {
            let rows = [end(part), end(part + 1)];
            // Parts differ by a row of work-groups: their cost is that of a row.
            Ok(fastest_ms(&self.caster(image_size, rows)?)? / f64::from(rows[1] - rows[0]))
        };
        (0..PARTS).map(part_ms).collect()
    }
}

/// Devices that cast together, and what is known of each.
struct Team<'a> {
    ready: Vec<&'a Ready>,
    costs: Vec<Cost>,
}

impl Team<'_> {
    /// Each device's rows of a frame.
    fn rows(&self, height: u32) -> Vec<[u32; 2]> {
        let groups: Vec<u32> = self.ready.iter().map(|ready| ready.group_height()).collect();
        rows(&balance(&self.costs).0, height, &groups)
    }

    /// What the fastest takes for the frame alone.
    fn alone_ms(&self) -> f64 {
        self.costs.iter().map(|cost| cost.whole_ms).fold(f64::INFINITY, f64::min)
    }

    /// Takes out the slowest.
    fn without_slowest(&mut self, reason: impl Fn(f64) -> String) -> Option<LeftOut> {
        let whole_ms = |place: &usize| self.costs[*place].whole_ms;
        let slowest = (0..self.ready.len()).max_by(|a, b| whole_ms(a).total_cmp(&whole_ms(b)))?;
        let (ready, cost) = (self.ready.remove(slowest), self.costs.remove(slowest));
        Some(LeftOut { device: ready.label.clone(), reason: reason(cost.whole_ms) })
    }
}

fn failed(error: impl std::fmt::Display) -> Error {
    Error::run(format!("a device failed: {error}"))
        .with_help("leave it out of --devices; `raycl devices` lists them")
}

impl Split<'_> {
    /// Casts the frame at once on all devices that make it faster.
    pub fn cast(&self, castings: &[Casting]) -> Result<Whole> {
        let ready = at_once(castings, |casting| self.ready(casting))?;
        if ready.is_empty() {
            return Err(failed("there is none"));
        }
        let (team, left_out) = self.team(&ready)?;
        let rows = team.rows(self.image_size[1]);
        let pairs: Vec<(&Ready, [u32; 2])> =
            team.ready.into_iter().zip(rows).filter(|(_, [first, end])| first < end).collect();
        let parts = at_once(&pairs, |(ready, rows)| self.cast_rows(ready, *rows))?;
        let [width, height] = self.image_size;
        let mut image = Radiance { width, height, pixels: Vec::new() };
        let (mut hits, mut shares) = (0, Vec::new());
        for (part, part_hits, share) in parts {
            match image.pixels.is_empty() {
                true => image.pixels = part.pixels,
                false => image.pixels.extend(part.pixels),
            }
            hits += part_hits;
            shares.push(share);
        }
        Ok(Whole { image, hits, shares, left_out })
    }

    fn ready(&self, casting: &Casting) -> Result<Ready> {
        let start = Instant::now();
        let Casting { device, strategy, local_size } = casting;
        let label = device.info.label.clone();
        let session = Session::open(device, self.sources, Arc::clone(&self.scene))?;
        let prepared = session.verifying(self.verifies).prepare(strategy, self.image_size, *local_size);
        let prepared = prepared.map_err(|refused| refused.into_error(&label))?;
        let build_ms = start.elapsed().as_secs_f64() * 1e3 - prepared.upload_ms();
        Ok(Ready { label, strategy: *strategy, prepared, build_ms })
    }

    /// The devices that are to cast: all, or those that make the frame faster than the fastest alone casts it, as trials tell.
    fn team<'a>(&self, ready: &'a [Ready]) -> Result<(Team<'a>, Vec<LeftOut>)> {
        let costs = vec![Cost { whole_ms: 1.0, parts: Vec::new() }; ready.len()];
        let mut team = Team { ready: ready.iter().collect(), costs };
        let mut left_out = Vec::new();
        let trial = self.trial(&mut team, &mut left_out)?;
        if team.ready.len() > 1 {
            let parts = at_once(&team.ready, |ready| ready.parts(trial))?;
            team.costs.iter_mut().zip(parts).for_each(|(cost, parts)| cost.parts = parts);
        }
        while team.ready.len() > 1 && !self.every_device {
            let (together_ms, alone_ms) = (together_ms(&team, trial)?, team.alone_ms());
            if together_ms < alone_ms {
                break;
            }
            let reason = |_| {
                format!(
                    "with its rows a trial frame took {together_ms:.3} ms, the fastest device alone {alone_ms:.3} ms"
                )
            };
            left_out.extend(team.without_slowest(reason));
        }
        Ok((team, left_out))
    }

    /// Pixels of a trial frame: as few as keep the fastest device busy for a while, or all. Measures what each device takes for it, and
    /// leaves out those that are much slower: a larger frame would show that all the more.
    fn trial(&self, team: &mut Team<'_>, left_out: &mut Vec<LeftOut>) -> Result<[u32; 2]> {
        let [width, height] = self.image_size;
        let mut rows = TRIAL_ROWS;
        loop {
            let smaller = height.div_ceil(rows).max(1);
            let trial = [width.div_ceil(smaller), height.div_ceil(smaller)];
            if team.ready.len() == 1 {
                return Ok(trial);
            }
            // One after another: devices of one machine may share its cores.
            for (ready, cost) in team.ready.iter().zip(&mut team.costs) {
                cost.whole_ms = ready.whole_ms(trial)?;
            }
            let fastest_ms = team.alone_ms();
            while !self.every_device && team.costs.iter().any(|cost| cost.whole_ms > SLOWEST * fastest_ms) {
                let times =
                    |ms: f64| format!("it takes {:.1} times as long as the fastest device", ms / fastest_ms);
                left_out.extend(team.without_slowest(times));
            }
            if smaller == 1 || fastest_ms >= TRIAL_MS {
                return Ok(trial);
            }
            rows *= 2;
        }
    }

    fn cast_rows(&self, ready: &Ready, rows: [u32; 2]) -> Result<(Radiance, usize, Share)> {
        let caster = ready.caster(self.image_size, rows)?;
        cast_first(&caster)?;
        let frames = (0..self.repeat.max(1)).map(|_| caster.cast().map_err(failed)).collect::<Result<_>>()?;
        let start = Instant::now();
        let (part, hits) = caster.read_rows(rows).map_err(failed)?;
        let share = Share {
            device: ready.label.clone(),
            strategy: ready.strategy,
            local_size: ready.prepared.workload.local_size,
            rows,
            build_ms: ready.build_ms + caster.records_ms().unwrap_or(0.0),
            upload_ms: ready.prepared.upload_ms(),
            frames,
            read_ms: start.elapsed().as_secs_f64() * 1e3,
        };
        Ok((part, hits, share))
    }
}

/// What the longest device takes when all cast their rows of a frame at once.
fn together_ms(team: &Team<'_>, image_size: [u32; 2]) -> Result<f64> {
    let rows = team.rows(image_size[1]);
    let pairs: Vec<(&Ready, [u32; 2])> =
        team.ready.iter().copied().zip(rows).filter(|(_, [first, end])| first < end).collect();
    let all_there = Barrier::new(pairs.len());
    let times = at_once(&pairs, |(ready, rows)| {
        let caster = ready.caster(image_size, *rows).and_then(|caster| cast_first(&caster).map(|()| caster));
        // One that failed is waited for, too.
        all_there.wait();
        let mut times = cast_times(&caster?)?;
        times.sort_unstable_by(f64::total_cmp);
        Ok(times[times.len() / 2])
    })?;
    Ok(times.into_iter().fold(0.0, f64::max))
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
    Ok(cast_times(caster)?.into_iter().fold(f64::INFINITY, f64::min).max(1e-6))
}

/// Device times of a few casts.
fn cast_times(caster: &Caster) -> Result<Vec<f64>> {
    (0..CASTS).map(|_| caster.cast().map(|times| times.frame_ms).map_err(failed)).collect()
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
