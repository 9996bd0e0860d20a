//! Casts one frame on several devices, a band of rows on each.

use super::band::{Band, Cost, balance, rows};
use super::{Caster, FrameTimes, Prepared, Session};
use crate::clock::ms_since;
use crate::device::{Device, DeviceInfo};
use crate::error::{Error, Result};
use crate::image::Radiance;
use crate::program::Sources;
use crate::scene::{Sampling, Scene};
use crate::strategy::{Strategy, Workload};
use crate::threads::locked;
use std::sync::mpsc::channel;
use std::sync::{Arc, Barrier, Mutex};
use std::thread::Builder;
use std::time::Instant;

/// Number of parts into which a trial frame is divided. The cost of each part is measured. A trial frame is cast only
/// to find out how fast the devices are.
const PARTS: usize = 32;
/// Largest number of pixel rows in the first trial frame. The limit doubles for each later trial frame, until a trial
/// frame takes at least [`TRIAL_MS`].
const TRIAL_ROWS: u32 = 256;
/// Minimum time of a trial frame. A shorter frame would not keep all processors of a device busy, and would not show
/// how the cost is distributed over the frame's rows.
const TRIAL_MS: f64 = 5.0;
/// Number of casts per measurement. The measurement's result is the smallest or the median time of these
/// `CASTS` casts.
const CASTS: usize = 3;
/// A device is left out if it takes more than this many times as long as the fastest device. The slow device
/// could save at most a tenth of the frame's time. The slow device would cost time if its rows took slightly
/// longer than measured.
const SLOWEST: f64 = 10.0;
/// The reason why a device casts no part if the frame has too few rows for all devices.
const NO_ROWS: &str = "its part of the frame would be less than one row of work-groups";

/// A frame to be cast by several devices.
pub struct Split<'a> {
    /// The scene that the devices cast.
    pub scene: Arc<Scene>,
    /// The frame's width and height in pixels.
    pub image_size: [u32; 2],
    /// Says how many samples each pixel gets. All pixels get the same number of samples, and soft light is
    /// cast at full resolution: adaptive samples and half resolution would need pixels of neighbouring bands.
    pub sampling: Sampling,
    /// The kernel files from which the devices' programs are built.
    pub sources: &'a Sources,
    /// The number of times that the frame is cast.
    pub repeat: u32,
    /// True if the image is verified against the reference.
    pub verifies: bool,
    /// True if devices that slow the frame down are used too, and a device that cannot be prepared is an error.
    pub every_device: bool,
}

/// A device that the user chose for casting, with its strategy and its local size.
#[derive(Clone, Debug)]
pub struct Casting {
    /// The device that casts a part of the frame.
    pub device: Device,
    /// The strategy with which the device casts.
    pub strategy: Strategy,
    /// Local size: work-items of a work-group, across and down.
    pub local_size: [u32; 2],
}

/// A device's part of a frame, with its times.
#[derive(Clone, Debug)]
pub struct Share {
    /// The device's label.
    pub device: String,
    /// The strategy with which the device cast its part of the frame.
    pub strategy: Strategy,
    /// Local size: work-items of a work-group, across and down.
    pub local_size: [u32; 2],
    /// The device's pixel rows: the first row, and the row after the last one.
    pub rows: [u32; 2],
    /// Time for opening the device, building the tree and the program, and preparing records of triangles.
    pub build_ms: f64,
    /// Time for uploading the scene to the device.
    pub upload_ms: f64,
    /// The times of each cast of the device's part of the frame.
    pub frames: Vec<FrameTimes>,
    /// Time for reading the device's rows back.
    pub read_ms: f64,
}

/// A device that was chosen for casting, but casts no part of the frame.
#[derive(Clone, Debug, serde::Serialize)]
pub struct LeftOut {
    /// The device's label.
    pub device: String,
    /// Why the device casts no part of the frame.
    pub reason: String,
}

/// A frame that several devices have cast: the result of [`Split::cast`].
pub struct Whole {
    /// The frame's image.
    pub image: Radiance,
    /// Number of pixels that hit something.
    pub hits: usize,
    /// The part of the frame that each device has cast, with its times.
    pub shares: Vec<Share>,
    /// Devices that were left out: they could not be prepared, they would have slowed the frame down, or the frame has
    /// too few rows.
    pub left_out: Vec<LeftOut>,
}

/// A device that is ready to cast.
struct Ready {
    info: DeviceInfo,
    strategy: Strategy,
    prepared: Prepared,
    build_ms: f64,
}

impl Ready {
    /// Returns the workload for a frame of another size.
    fn at(&self, image_size: [u32; 2]) -> Workload {
        Workload { image_size, ..self.prepared.workload }
    }

    /// Makes a caster for the pixel rows from `first` to `end` of a frame. The rows are extended to whole
    /// work-groups.
    fn caster(&self, image_size: [u32; 2], [first, end]: [u32; 2]) -> Result<Caster> {
        let group = self.group_height();
        let band: Band = (first / group) as usize..end.div_ceil(group) as usize;
        let caster = self.prepared.caster_of(&self.at(image_size), Some(band));
        caster.map_err(|refused| refused.into_error(&self.info))
    }

    /// Returns the number of pixel rows in a work-group.
    fn group_height(&self) -> u32 {
        self.prepared.workload.group_height(&self.strategy)
    }

    /// Measures how long the device takes for a whole frame of `image_size`, in milliseconds.
    fn whole_ms(&self, image_size: [u32; 2]) -> Result<f64> {
        fastest_ms(&self.caster(image_size, [0, image_size[1]])?)
    }

    /// Measures the time per row of pixels for each part of a frame, from top to bottom. Returns an empty
    /// list if there are fewer rows of work-groups than parts.
    fn parts(&self, image_size: [u32; 2]) -> Result<Vec<f64>> {
        let (group, height) = (self.group_height(), image_size[1]);
        let groups = height.div_ceil(group) as usize;
        let end = |part: usize| ((groups * part / PARTS) as u32 * group).min(height);
        if groups < PARTS {
            return Ok(Vec::new());
        }
        let part_ms = |part: usize| {
            let rows = [end(part), end(part + 1)];
            // The parts of the frame may differ in height by a row of work-groups, so a part's cost is given
            // per row of pixels.
            Ok(fastest_ms(&self.caster(image_size, rows)?)? / f64::from(rows[1] - rows[0]))
        };
        (0..PARTS).map(part_ms).collect()
    }
}

/// The devices that cast a frame together, and the cost of the frame on each device.
struct Team<'a> {
    ready: Vec<&'a Ready>,
    costs: Vec<Cost>,
}

impl Team<'_> {
    /// Returns the rows of pixels that each device of the team casts, in a frame of `height` rows.
    fn rows(&self, height: u32) -> Vec<[u32; 2]> {
        let groups: Vec<u32> = self.ready.iter().map(|ready| ready.group_height()).collect();
        rows(&balance(&self.costs).0, height, &groups)
    }

    /// Returns the time that the fastest device alone takes for the frame.
    fn alone_ms(&self) -> f64 {
        self.costs.iter().map(|cost| cost.whole_ms).fold(f64::INFINITY, f64::min)
    }

    /// Removes the slowest device from the team. Returns this device with the reason for its removal.
    /// `reason` turns the time in milliseconds that the slowest device takes for a whole trial frame into the
    /// text of the reason. Returns `None` if the team is empty.
    fn without_slowest(&mut self, reason: impl Fn(f64) -> String) -> Option<LeftOut> {
        let whole_ms = |index: &usize| self.costs[*index].whole_ms;
        let slowest = (0..self.ready.len()).max_by(|a, b| whole_ms(a).total_cmp(&whole_ms(b)))?;
        let (ready, cost) = (self.ready.remove(slowest), self.costs.remove(slowest));
        Some(LeftOut { device: ready.info.label.clone(), reason: reason(cost.whole_ms) })
    }
}

fn failed(error: impl std::fmt::Display) -> Error {
    Error::run(format!("a device failed: {error}"))
        .with_help("leave this device out of --devices; to find out which device it is, cast on each device alone, with --device; `raycl devices` lists all devices")
}

impl Split<'_> {
    /// Casts the frame on several devices at the same time. Leaves out devices for which the frame has too few rows.
    /// Unless `every_device` is true, also leaves out devices that cannot be prepared, and devices that would slow the
    /// frame down.
    pub fn cast(&self, castings: &[Casting]) -> Result<Whole> {
        let (ready, mut left_out) = self.all_ready(castings)?;
        let (team, slow) = self.team(&ready)?;
        left_out.extend(slow);
        let rows = team.rows(self.image_size[1]);
        let (pairs, idle): (Vec<(&Ready, [u32; 2])>, Vec<_>) =
            team.ready.into_iter().zip(rows).partition(|(_, [first, end])| first < end);
        left_out.extend(
            idle.into_iter()
                .map(|(ready, _)| LeftOut { device: ready.info.label.clone(), reason: NO_ROWS.to_owned() }),
        );
        let parts = at_once(&pairs, |(ready, rows)| self.cast_rows(ready, *rows))?;
        Ok(joined(self.image_size, parts, left_out))
    }

    /// Prepares the devices. A device that cannot be prepared is left out with the reason. Returns the first device's
    /// error if no device can be prepared, or if `every_device` is true and a device cannot be prepared.
    fn all_ready(&self, castings: &[Casting]) -> Result<(Vec<Ready>, Vec<LeftOut>)> {
        let (mut ready, mut left_out, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        let results = at_once(castings, |casting| Ok(self.ready(casting)))?;
        for (casting, result) in castings.iter().zip(results) {
            match result {
                Ok(one) => ready.push(one),
                Err(error) => {
                    let (device, reason) = (casting.device.info.label.clone(), not_ready(&error));
                    left_out.push(LeftOut { device, reason });
                    errors.push(error);
                }
            }
        }
        if ready.is_empty() || self.every_device && !errors.is_empty() {
            return Err(errors.into_iter().next().unwrap_or_else(|| failed("no device was given")));
        }
        Ok((ready, left_out))
    }

    fn ready(&self, casting: &Casting) -> Result<Ready> {
        let start = Instant::now();
        let Casting { device, strategy, local_size } = casting;
        // Each device casts trial frames before its part of the frame, so its tree is built for many frames.
        let session = Session::open(device, self.sources, Arc::clone(&self.scene))?;
        let session = session.among_twins(device.info.program_twin()).with_sampling(self.sampling);
        let prepared = session.verifying(self.verifies).prepare(strategy, self.image_size, *local_size);
        let prepared = prepared.map_err(|refused| refused.into_error(&device.info))?;
        let build_ms = ms_since(start) - prepared.upload_ms();
        Ok(Ready { info: device.info.clone(), strategy: *strategy, prepared, build_ms })
    }

    /// Returns the devices that will cast, and the devices that are left out. Devices that are much slower
    /// than the fastest are left out first ([`Self::trial`]). After that, all remaining devices cast a trial
    /// frame (the frame, usually at a smaller size) together. If all remaining devices together are not
    /// faster than the fastest device alone, the slowest device is left out, and the others cast the trial
    /// frame again. Devices are left out until the remaining devices are faster together, or until one device
    /// remains. If `every_device` is true, no device is left out.
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
            left_out.extend(team.without_slowest(|_| no_gain(together_ms, alone_ms)));
        }
        Ok((team, left_out))
    }

    /// Returns the size of a trial frame. The trial frame grows until it takes the fastest device at least
    /// [`TRIAL_MS`], until it is the full frame, or until the team has one device. The function measures the time that
    /// each device takes for each trial frame (the frame, usually at a smaller size). Moves devices that are much
    /// slower than the fastest from `team` to `left_out`, unless `every_device` is true: for a larger frame, the
    /// difference would be even larger.
    fn trial(&self, team: &mut Team<'_>, left_out: &mut Vec<LeftOut>) -> Result<[u32; 2]> {
        let mut rows = TRIAL_ROWS;
        loop {
            let (trial, smaller) = trial_size(self.image_size, rows);
            if team.ready.len() == 1 {
                return Ok(trial);
            }
            // The devices cast one after another, since devices of one machine may share its cores.
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
        let cast = || caster.cast_samples(&self.scene.camera, &self.sampling).map_err(failed);
        let frames = (0..self.repeat.max(1)).map(|_| cast()).collect::<Result<_>>()?;
        let start = Instant::now();
        let (part, hits) = caster.read_rows(rows).map_err(failed)?;
        let share = Share {
            device: ready.info.label.clone(),
            strategy: ready.strategy,
            local_size: ready.prepared.workload.local_size,
            rows,
            build_ms: ready.build_ms + caster.records_ms().unwrap_or(0.0),
            upload_ms: ready.prepared.upload_ms(),
            frames,
            read_ms: ms_since(start),
        };
        Ok((part, hits, share))
    }
}

/// Returns the reason why a device that cannot be prepared is left out.
fn not_ready(error: &Error) -> String {
    format!("it cannot be prepared: {error}")
}

/// Returns why the slowest device is left out if all devices together take at least as long for a trial frame
/// as the fastest device alone.
fn no_gain(together_ms: f64, alone_ms: f64) -> String {
    format!(
        "a trial frame took {together_ms:.3} ms on this device and the others together, and {alone_ms:.3} ms on the fastest device alone"
    )
}

/// Returns the size of a trial frame that has at most `rows` rows of pixels. Also returns the factor by which the width
/// and the height of the trial frame are smaller than those of the full frame.
fn trial_size([width, height]: [u32; 2], rows: u32) -> ([u32; 2], u32) {
    let smaller = height.div_ceil(rows).max(1);
    ([width.div_ceil(smaller), height.div_ceil(smaller)], smaller)
}

/// Joins the parts of a frame, from top to bottom.
fn joined([width, height]: [u32; 2], parts: Vec<(Radiance, usize, Share)>, left_out: Vec<LeftOut>) -> Whole {
    let mut image = Radiance { width, height, pixels: Vec::new(), coverage: Vec::new() };
    let (mut hits, mut shares) = (0, Vec::new());
    for (part, part_hits, share) in parts {
        match image.pixels.is_empty() {
            true => image.pixels = part.pixels,
            false => image.pixels.extend(part.pixels),
        }
        image.coverage.extend(part.coverage);
        hits += part_hits;
        shares.push(share);
    }
    Whole { image, hits, shares, left_out }
}

/// Returns the time in milliseconds of the slowest device when all devices cast their rows of a frame at the same time.
/// A device's time is the median of a few casts.
fn together_ms(team: &Team<'_>, image_size: [u32; 2]) -> Result<f64> {
    let rows = team.rows(image_size[1]);
    let pairs: Vec<(&Ready, [u32; 2])> =
        team.ready.iter().copied().zip(rows).filter(|(_, [first, end])| first < end).collect();
    let all_there = Barrier::new(pairs.len());
    let times = at_once(&pairs, |(ready, rows)| {
        let caster = ready.caster(image_size, *rows).and_then(|caster| cast_first(&caster).map(|()| caster));
        // The thread of a device that failed must reach the barrier, too: the other threads wait at the
        // barrier for all threads.
        all_there.wait();
        let mut times = cast_times(&caster?)?;
        times.sort_unstable_by(f64::total_cmp);
        Ok(times[times.len() / 2])
    })?;
    Ok(times.into_iter().fold(0.0, f64::max))
}

/// Casts the first frame of a caster, in which the driver may compile. Only one device at a time casts the
/// first frame of a caster. If two devices of one process compile a kernel at the same time, PoCL 3.1
/// miscounts the users of the kernel, and aborts when the devices release the kernel.
fn cast_first(caster: &Caster) -> Result<()> {
    static TURN: Mutex<()> = Mutex::new(());
    // The lock guards no data, but only makes the devices cast one after another, so a panic of the thread
    // that holds the lock is harmless.
    let _turn = locked(&TURN);
    caster.cast().map(drop).map_err(failed)
}

/// Returns the shortest device time of a few casts, in milliseconds. The first cast, in which the driver may
/// compile, is not timed.
fn fastest_ms(caster: &Caster) -> Result<f64> {
    cast_first(caster)?;
    Ok(cast_times(caster)?.into_iter().fold(f64::INFINITY, f64::min).max(1e-6))
}

/// Returns the device times of a few casts, in milliseconds.
fn cast_times(caster: &Caster) -> Result<Vec<f64>> {
    (0..CASTS).map(|_| caster.cast().map(|times| times.frame_ms).map_err(failed)).collect()
}

/// Calls `work` for each element, in a separate thread per element.
fn at_once<A: Sync, B: Send>(all: &[A], work: impl Fn(&A) -> Result<B> + Sync) -> Result<Vec<B>> {
    in_threads(all, Builder::new, work)
}

/// Calls `work` for each element, in a separate thread per element. `builder` makes the builder that starts a
/// thread. The calls of `work` may wait for each other, so no call begins before all threads have started.
fn in_threads<A: Sync, B: Send>(
    all: &[A],
    mut builder: impl FnMut() -> Builder,
    work: impl Fn(&A) -> Result<B> + Sync,
) -> Result<Vec<B>> {
    let work = &work;
    std::thread::scope(|scope| {
        let started = all.iter().map(|one| {
            let (sender, begins) = channel::<()>();
            let thread = builder().spawn_scoped(scope, move || begins.recv().ok().map(|()| work(one)));
            thread.map(|thread| (sender, thread)).map_err(|error| Error::no_thread(&error))
        });
        // If a thread cannot be started, the senders are dropped, so the other threads end without calling `work`.
        let started = started.collect::<Result<Vec<_>>>()?;
        let begun = started.into_iter().map(|(sender, thread)| {
            // The thread waits for this message, so sending it does not fail.
            let _ = sender.send(());
            thread
        });
        let threads: Vec<_> = begun.collect();
        let panicked = || Err(failed("its thread panicked"));
        threads.into_iter().map(|thread| thread.join().ok().flatten().unwrap_or_else(panicked)).collect()
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::device::discover;
    use crate::reference::fixtures;
    use crate::strategy::preset;
    use std::sync::atomic::{AtomicBool, Ordering};

    /// Width and height of the tests' frame in pixels. With work-groups of two pixel rows, there are 31 rows
    /// of work-groups, one fewer than [`PARTS`].
    const SIZE: [u32; 2] = [24, 61];
    const LOCAL_SIZE: [u32; 2] = [4, 2];

    /// Returns this machine's first device several times. An element of `names` consists of the name that the
    /// device gets, and of a strategy's name.
    fn castings(names: &[(&str, &str)]) -> Vec<Casting> {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let casting = |&(name, strategy): &(&str, &str)| {
            let mut device = device.clone();
            device.info.label = name.to_owned();
            Casting { device, strategy: preset(strategy).unwrap().strategy, local_size: LOCAL_SIZE }
        };
        names.iter().map(casting).collect()
    }

    fn split(repeat: u32) -> Split<'static> {
        Split {
            scene: Arc::new(fixtures::pyramid_upper()),
            image_size: SIZE,
            sampling: Sampling::ONE,
            sources: &Sources::Embedded,
            repeat,
            verifies: false,
            every_device: true,
        }
    }

    #[test]
    fn each_device_casts_its_rows_as_often_as_asked_and_says_how() {
        let castings = castings(&[("one", "deferred"), ("two", "naive")]);
        let (single, both) = (&split(1).cast(&castings[..1]).unwrap(), split(3).cast(&castings).unwrap());
        let frames = |whole: &Whole| whole.shares.iter().map(|share| share.frames.len()).collect::<Vec<_>>();
        assert_eq!((frames(single), frames(&both)), (vec![1], vec![3, 3]));
        for (share, casting) in both.shares.iter().zip(&castings) {
            assert_eq!((&share.device, share.strategy), (&casting.device.info.label, casting.strategy));
            assert_eq!(share.local_size, LOCAL_SIZE);
            assert!(share.frames.iter().all(|times| times.frame_ms > 0.0));
        }
        let rows: Vec<[u32; 2]> = both.shares.iter().map(|share| share.rows).collect();
        assert_eq!((rows[0][0], rows[0][1], rows[1][1]), (0, rows[1][0], SIZE[1]));
        assert_eq!((both.image.width, both.image.height), (SIZE[0], SIZE[1]));
        assert!(both.hits > 0 && both.hits == single.hits && both.left_out.is_empty());
    }

    #[test]
    fn a_device_for_which_the_frame_has_no_rows_is_left_out_with_the_reason() {
        let castings = castings(&[("one", "naive"), ("two", "naive")]);
        // The frame has one row of work-groups.
        let whole = Split { image_size: [24, LOCAL_SIZE[1]], ..split(1) }.cast(&castings).unwrap();
        let reasons: Vec<&str> = whole.left_out.iter().map(|left_out| left_out.reason.as_str()).collect();
        assert_eq!((whole.shares.len(), reasons), (1, vec![NO_ROWS]));
        assert_ne!(whole.shares[0].device, whole.left_out[0].device);
    }

    #[test]
    fn a_team_leaves_out_its_slowest_device_and_is_compared_with_its_fastest() {
        let split = split(1);
        let ready =
            at_once(&castings(&[("a", "naive"), ("b", "naive"), ("c", "naive")]), |one| split.ready(one));
        let ready = ready.unwrap();
        let cost = |whole_ms| Cost { whole_ms, parts: Vec::new() };
        let costs = [4.0, 12.0, 6.0].map(cost).into();
        let mut team = Team { ready: ready.iter().collect(), costs };
        assert_eq!(team.alone_ms(), 4.0);
        // In 2 ms, the devices cast a half, a sixth and a third of the frame. Rows of work-groups are 2 pixels high.
        assert_eq!(team.rows(60), [[0, 30], [30, 40], [40, 60]]);
        let left_out = team.without_slowest(|ms| format!("{ms} ms")).unwrap();
        assert_eq!((left_out.device.as_str(), left_out.reason.as_str()), ("b", "12 ms"));
        let left: Vec<(&str, f64)> = team
            .ready
            .iter()
            .zip(&team.costs)
            .map(|(one, cost)| (one.info.label.as_str(), cost.whole_ms))
            .collect();
        assert_eq!(left, [("a", 4.0), ("c", 6.0)]);
        // The parts of a frame are measured only if each part has at least one row of work-groups.
        let parts = [61, 64, 63, 62].map(|height| ready[0].parts([8, height]).unwrap().len());
        assert_eq!(parts, [0, PARTS, PARTS, 0]);
    }

    #[test]
    fn a_frame_needs_a_device_and_a_device_that_fails_is_to_be_left_out() {
        let error = split(1).cast(&[]).err().expect("there is no device");
        assert_eq!(error.to_string(), "a device failed: no device was given");
        assert!(error.remedy().contains("leave this device out of --devices"), "{}", error.remedy());
    }

    #[test]
    fn a_device_that_cannot_be_prepared_is_left_out_with_the_reason_unless_all_are_wanted() {
        let mut castings = castings(&[("one", "naive"), ("two", "naive")]);
        castings[1].local_size = [1 << 20, 1];
        let some = Split { every_device: false, ..split(1) };
        let whole = some.cast(&castings).unwrap();
        assert_eq!((whole.shares.len(), whole.shares[0].rows), (1, [0, SIZE[1]]));
        assert_eq!(whole.left_out.len(), 1);
        assert_eq!(whole.left_out[0].device, castings[1].device.info.label);
        let reason = &whole.left_out[0].reason;
        assert!(reason.starts_with("it cannot be prepared: ") && reason.contains("1048576"), "{reason}");
        assert!(split(1).cast(&castings).is_err() && some.cast(&castings[1..]).is_err());
    }

    #[test]
    fn a_device_that_makes_the_others_slower_is_left_out_with_both_times() {
        let reason = no_gain(7.0, 5.25);
        let [together, alone] =
            ["7.000 ms on this device and the others together", "5.250 ms on the fastest"];
        assert_eq!(reason, format!("a trial frame took {together}, and {alone} device alone"));
    }

    #[test]
    fn a_trial_frame_is_a_smaller_picture_of_the_same_shape() {
        assert_eq!(trial_size([1000, 1024], 256), ([250, 256], 4));
        assert_eq!(trial_size([1000, 1025], 256), ([200, 205], 5));
        assert_eq!(trial_size([1000, 256], 256), ([1000, 256], 1));
        assert_eq!(trial_size([7, 0], 256), ([7, 0], 1));
    }

    #[test]
    fn work_at_once_keeps_its_order_and_a_failure_or_a_panic_is_an_error() {
        assert_eq!(at_once(&[3, 1, 2], |number| Ok(10 * number)).unwrap(), [30, 10, 20]);
        let failing = at_once(&[1, 2], |number| if *number == 2 { Err(Error::run("full")) } else { Ok(()) });
        assert_eq!(failing.unwrap_err().to_string(), "full");
        let panicking =
            at_once(&[1, 2], |number| if *number == 2 { panic!("a test's panic") } else { Ok(()) });
        assert_eq!(panicking.unwrap_err().to_string(), "a device failed: its thread panicked");
    }

    #[test]
    fn no_work_begins_if_the_system_refuses_a_thread() {
        // No address space can hold a stack of this size.
        let refused = Builder::new().stack_size(1 << (usize::BITS - 1));
        let mut builders = [Builder::new(), refused].into_iter();
        let has_begun = AtomicBool::new(false);
        let work = |_: &i32| {
            has_begun.store(true, Ordering::Relaxed);
            Ok(())
        };
        let error = in_threads(&[1, 2], || builders.next().unwrap(), work).unwrap_err();
        assert!(!has_begun.into_inner());
        assert!(error.to_string().starts_with("a thread could not be started: "), "{error}");
        assert_eq!(error.exit_code(), 1);
    }

    #[test]
    fn a_joined_frame_has_the_pixels_and_the_hits_of_all_its_parts() {
        let part = |rows: [u32; 2], hits: usize| {
            let height = rows[1] - rows[0];
            let pixels = (rows[0]..rows[1]).map(|row| [row as f32; 3]).collect();
            let share = Share {
                device: "a device".into(),
                strategy: preset("deferred").unwrap().strategy,
                local_size: [1, 1],
                rows,
                build_ms: 0.0,
                upload_ms: 0.0,
                frames: Vec::new(),
                read_ms: 0.0,
            };
            let coverage = (rows[0]..rows[1]).map(|row| row as f32).collect();
            (Radiance { width: 1, height, pixels, coverage }, hits, share)
        };
        let whole = joined([1, 6], vec![part([0, 3], 3), part([3, 5], 1), part([5, 6], 0)], Vec::new());
        assert_eq!((whole.image.width, whole.image.height), (1, 6));
        assert_eq!(whole.image.coverage, [0.0_f32, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(whole.image.pixels, [0.0_f32, 1.0, 2.0, 3.0, 4.0, 5.0].map(|row| [row; 3]));
        assert_eq!((whole.hits, whole.shares.len()), (4, 3));
    }
}
