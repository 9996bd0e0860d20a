//! Casts one frame on several devices, a band of rows on each.

use super::band::{Band, Cost, balance, rows};
use super::{Caster, FrameTimes, LaunchError, Prepared, Refused, Session};
use crate::clock::ms_since;
use crate::device::{Device, DeviceInfo, forget_failures};
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

/// Number of parts into which a trial frame is divided, if it has at least as many rows of work-groups. The
/// cost of each part is measured. A trial frame is cast only to find out how fast the devices are.
const PARTS: usize = 32;
/// Largest number of pixel rows in the first trial frame. The limit doubles for each later trial frame, until
/// a trial frame takes the fastest device at least [`TRIAL_MS`].
const TRIAL_ROWS: u32 = 256;
/// Trial frames become larger until one takes the fastest device at least this time, or has the size of the full frame.
/// A frame that takes less time would not keep all processors of a device busy, and would not show how the cost is
/// distributed over the frame's rows.
const TRIAL_MS: f64 = 5.0;
/// Number of casts per measurement. The measurement's result is the smallest or the median time of these
/// `CASTS` casts.
const CASTS: usize = 3;
/// Unless all devices must be used ([`Split::every_device`]), a device is left out if it takes more than this
/// many times as long as the fastest device. Such a slow device could save at most a tenth of the frame's time, and
/// would cost time if its rows took slightly longer than measured.
const SLOWEST: f64 = 10.0;
/// The step in which a device casts a frame, for messages.
const LAUNCH: &str = "the launch";
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
    /// The number of times that the frame is cast and timed, after a first cast that is not timed. If `repeat` is 0,
    /// the frame is cast and timed once.
    pub repeat: u32,
    /// True if the image is verified against the reference.
    pub verifies: bool,
    /// True if devices that slow the frame down are used too, and if it is an error that a device fails or cannot be
    /// prepared.
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
    /// The times of each timed cast of the device's part of the frame.
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
    /// Devices that were left out: they could not be prepared, they failed, they would have slowed the frame down, or
    /// the frame has too few rows.
    pub left_out: Vec<LeftOut>,
}

/// A device's part of a frame: its rows of pixels, the number of its pixels that hit something, and its times.
type Part = (Radiance, usize, Share);

/// A device that failed, with the reason, and the error that ends the command if the command needs this device. The
/// error names the device.
type Lost = (LeftOut, Error);

/// Why the devices did not cast a frame together.
#[derive(Debug)]
enum Failure {
    /// One of the devices failed.
    Device(Lost),
    /// This process failed: no device is to blame.
    Process(Error),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Process(error)
    }
}

/// The result of work on devices that are ready.
type Tried<T> = std::result::Result<T, Failure>;

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
    fn caster(&self, image_size: [u32; 2], [first, end]: [u32; 2]) -> Tried<Caster> {
        let group = self.group_height();
        let band: Band = (first / group) as usize..end.div_ceil(group) as usize;
        let caster = self.prepared.caster_of(&self.at(image_size), Some(band));
        caster.map_err(|refused| self.refused(refused))
    }

    /// Returns the failure of this device for the reason `refused`.
    fn refused(&self, refused: Refused) -> Failure {
        let error = refused.into_error(&self.info);
        Failure::Device(lost(&self.info, error.to_string(), error))
    }

    /// Returns a function that converts an error of the step `step` to the failure of this device.
    fn failed(&self, step: &'static str) -> impl Fn(LaunchError) -> Failure {
        move |error| self.refused(Refused::at(step)(error))
    }

    /// Casts the first frame of a caster, in which the driver may compile. Only one device at a time casts the
    /// first frame of a caster. If two devices of one process compile a kernel at the same time, PoCL 3.1
    /// miscounts the users of the kernel, and aborts when the devices release the kernel.
    fn cast_first(&self, caster: &Caster) -> Tried<()> {
        static TURN: Mutex<()> = Mutex::new(());
        // The lock guards no data: it only makes the devices cast one after another. A panic of the thread that holds
        // the lock is therefore harmless.
        let _turn = locked(&TURN);
        caster.cast().map(drop).map_err(self.failed(LAUNCH))
    }

    /// Returns the shortest device time of a few casts, in milliseconds. The first cast, in which the driver may
    /// compile, is not timed.
    fn fastest_ms(&self, caster: &Caster) -> Tried<f64> {
        self.cast_first(caster)?;
        Ok(self.cast_times(caster)?.into_iter().fold(f64::INFINITY, f64::min).max(1e-6))
    }

    /// Returns the device times of a few casts, in milliseconds.
    fn cast_times(&self, caster: &Caster) -> Tried<Vec<f64>> {
        let cast = |_| caster.cast().map(|times| times.frame_ms).map_err(self.failed(LAUNCH));
        (0..CASTS).map(cast).collect()
    }

    /// Returns the number of pixel rows in a work-group.
    fn group_height(&self) -> u32 {
        self.prepared.workload.group_height(&self.strategy)
    }

    /// Measures how long the device takes for a whole frame of `image_size`, in milliseconds.
    fn whole_ms(&self, image_size: [u32; 2]) -> Tried<f64> {
        self.fastest_ms(&self.caster(image_size, [0, image_size[1]])?)
    }

    /// Measures the time per row of pixels for each part of a frame, from top to bottom. Returns an empty
    /// list if there are fewer rows of work-groups than parts.
    fn parts(&self, image_size: [u32; 2]) -> Tried<Vec<f64>> {
        let (group, height) = (self.group_height(), image_size[1]);
        let groups = height.div_ceil(group) as usize;
        let end = |part: usize| ((groups * part / PARTS) as u32 * group).min(height);
        if groups < PARTS {
            return Ok(Vec::new());
        }
        let part_ms = |part: usize| -> Tried<f64> {
            let rows = [end(part), end(part + 1)];
            // The parts of the frame may differ in height by a row of work-groups, so a part's cost is given
            // per row of pixels.
            Ok(self.fastest_ms(&self.caster(image_size, rows)?)? / f64::from(rows[1] - rows[0]))
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

impl Split<'_> {
    /// Casts the frame on several devices at the same time. Leaves out devices for which the frame has too few rows.
    /// Unless `every_device` is true, also leaves out devices that cannot be prepared or fail, and devices that would
    /// slow the frame down.
    pub fn cast(&self, castings: &[Casting]) -> Result<Whole> {
        let (ready, lost) = self.all_ready(castings)?;
        self.cast_ready(ready, lost)
    }

    /// Casts the frame on devices that are ready; `lost` are the devices that failed before. If a device fails, it is
    /// left out, and the others begin again. If all devices have failed, or if `every_device` is true and a device has
    /// failed, returns the error of the first device in `lost`.
    fn cast_ready(&self, mut ready: Vec<Ready>, mut lost: Vec<Lost>) -> Result<Whole> {
        loop {
            if ready.is_empty() || self.every_device && !lost.is_empty() {
                return Err(lost.into_iter().next().map_or_else(no_device, |(_, error)| error));
            }
            match self.cast_together(&ready) {
                Ok((parts, others)) => {
                    let left_out = lost.into_iter().map(|(left_out, _)| left_out).chain(others).collect();
                    return Ok(joined(self.image_size, parts, left_out));
                }
                Err(Failure::Process(error)) => return Err(error),
                Err(Failure::Device((left_out, error))) => {
                    // The device's OpenCL objects are never freed: after a device has failed, freeing an
                    // object may fail too, and such a failure may end the process.
                    ready.extract_if(.., |one| one.info.label == left_out.device).for_each(std::mem::forget);
                    forget_failures();
                    lost.push((left_out, error));
                }
            }
        }
    }

    /// Casts the frame on devices that are ready. Returns the parts of the frame, and the devices that are left out
    /// because they would slow the frame down, or because the frame has too few rows for them.
    fn cast_together(&self, ready: &[Ready]) -> Tried<(Vec<Part>, Vec<LeftOut>)> {
        let (team, mut left_out) = self.team(ready)?;
        let rows = team.rows(self.image_size[1]);
        let (pairs, idle): (Vec<(&Ready, [u32; 2])>, Vec<_>) =
            team.ready.into_iter().zip(rows).partition(|(_, [first, end])| first < end);
        left_out.extend(
            idle.into_iter()
                .map(|(ready, _)| LeftOut { device: ready.info.label.clone(), reason: NO_ROWS.to_owned() }),
        );
        let parts = at_once(&pairs, |(ready, rows)| self.cast_rows(ready, *rows))?;
        Ok((parts.into_iter().collect::<Tried<_>>()?, left_out))
    }

    /// Prepares the devices. Returns the devices that are ready, and those that cannot be prepared.
    fn all_ready(&self, castings: &[Casting]) -> Result<(Vec<Ready>, Vec<Lost>)> {
        let (mut ready, mut all_lost) = (Vec::new(), Vec::new());
        let results = at_once(castings, |casting| self.ready(casting))?;
        for (casting, result) in castings.iter().zip(results) {
            match result {
                Ok(one) => ready.push(one),
                Err(error) => all_lost.push(lost(&casting.device.info, not_ready(&error), error)),
            }
        }
        Ok((ready, all_lost))
    }

    fn ready(&self, casting: &Casting) -> Result<Ready> {
        let start = Instant::now();
        let Casting { device, strategy, local_size } = casting;
        // If there are several devices, each casts trial frames before its part of the frame. Trees are
        // therefore built for many frames.
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
    fn team<'a>(&self, ready: &'a [Ready]) -> Tried<(Team<'a>, Vec<LeftOut>)> {
        let costs = vec![Cost { whole_ms: 1.0, parts: Vec::new() }; ready.len()];
        let mut team = Team { ready: ready.iter().collect(), costs };
        let mut left_out = Vec::new();
        let trial = self.trial(&mut team, &mut left_out)?;
        if team.ready.len() > 1 {
            let parts = at_once(&team.ready, |ready| ready.parts(trial))?;
            for (cost, parts) in team.costs.iter_mut().zip(parts) {
                cost.parts = parts?;
            }
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
    /// [`TRIAL_MS`], until it is the full frame, or until the team has one device. The function measures the
    /// time that each device takes for each trial frame (the frame, usually at a smaller size). Moves devices
    /// that are much slower than the fastest from `team` to `left_out`: for a larger frame, the difference
    /// would be even larger. If `every_device` is true, no device is moved.
    fn trial(&self, team: &mut Team<'_>, left_out: &mut Vec<LeftOut>) -> Tried<[u32; 2]> {
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

    fn cast_rows(&self, ready: &Ready, rows: [u32; 2]) -> Tried<Part> {
        let caster = ready.caster(self.image_size, rows)?;
        ready.cast_first(&caster)?;
        let cast = || caster.cast_samples(&self.scene.camera, &self.sampling).map_err(ready.failed(LAUNCH));
        let frames = (0..self.repeat.max(1)).map(|_| cast()).collect::<Tried<_>>()?;
        let start = Instant::now();
        let (part, hits) = caster.read_rows(rows).map_err(ready.failed("reading the image"))?;
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

/// Returns the error if no device was given. This would be a bug in raycl: if the user's patterns match no
/// usable device, raycl reports this before it casts.
fn no_device() -> Error {
    Error::fault("no device was given to cast the frame")
}

/// Returns the device that is lost because of `error`, and the error with the device's label. `reason` says why the
/// device is left out if the command can go on without it.
fn lost(info: &DeviceInfo, reason: String, error: Error) -> Lost {
    let device = info.label.clone();
    let is_named = error.to_string().contains(&device);
    let error = if is_named { error } else { error.preceded_by(&format!("on {device}: ")) };
    (LeftOut { device, reason }, error)
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
fn joined([width, height]: [u32; 2], parts: Vec<Part>, left_out: Vec<LeftOut>) -> Whole {
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
fn together_ms(team: &Team<'_>, image_size: [u32; 2]) -> Tried<f64> {
    let rows = team.rows(image_size[1]);
    let pairs: Vec<(&Ready, [u32; 2])> =
        team.ready.iter().copied().zip(rows).filter(|(_, [first, end])| first < end).collect();
    let all_there = Barrier::new(pairs.len());
    let times = at_once(&pairs, |(ready, rows)| -> Tried<f64> {
        let caster = ready.caster(image_size, *rows);
        let caster = caster.and_then(|caster| ready.cast_first(&caster).map(|()| caster));
        // The thread of a device that failed must reach the barrier, too: the other threads wait at the
        // barrier for all threads.
        all_there.wait();
        let mut times = ready.cast_times(&caster?)?;
        times.sort_unstable_by(f64::total_cmp);
        Ok(times[times.len() / 2])
    })?;
    times.into_iter().try_fold(0.0, |longest, ms| Ok(f64::max(longest, ms?)))
}

/// Calls `work` for each element, in a separate thread per element.
fn at_once<A: Sync, B: Send>(all: &[A], work: impl Fn(&A) -> B + Sync) -> Result<Vec<B>> {
    in_threads(all, Builder::new, work)
}

/// Calls `work` for each element, in a separate thread per element. `builder` returns the [`Builder`] that
/// starts the next thread. The calls of `work` may wait for each other, so no call begins before all threads
/// have started.
fn in_threads<A: Sync, B: Send>(
    all: &[A],
    mut builder: impl FnMut() -> Builder,
    work: impl Fn(&A) -> B + Sync,
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
        let panicked = || Error::fault("a thread that used a device panicked");
        threads.into_iter().map(|thread| thread.join().ok().flatten().ok_or_else(panicked)).collect()
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
        let castings = castings(&[("a", "naive"), ("b", "naive"), ("c", "naive")]);
        let ready = split.all_ready(&castings).unwrap().0;
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
    fn a_frame_needs_a_device() {
        let error = split(1).cast(&[]).err().expect("there is no device");
        assert_eq!(error.to_string(), "no device was given to cast the frame");
        assert!(error.exit_code() == 1 && error.remedy().contains("a bug in raycl"), "{}", error.remedy());
    }

    /// Returns two devices that are ready. When a caster is made for the second device, the device fails,
    /// because its work-groups are too large.
    fn the_second_fails(split: &Split<'_>) -> Vec<Ready> {
        let castings = castings(&[("cpu-a", "deferred"), ("cpu-b", "deferred")]);
        let mut ready = split.all_ready(&castings).unwrap().0;
        ready[1].prepared.workload.local_size = [1 << 20, 1];
        ready
    }

    #[test]
    fn a_device_that_fails_is_left_out_with_the_reason_unless_all_are_wanted() {
        let some = Split { every_device: false, ..split(1) };
        let whole = some.cast_ready(the_second_fails(&some), Vec::new()).unwrap();
        assert_eq!((whole.shares.len(), whole.shares[0].rows), (1, [0, SIZE[1]]));
        assert_eq!((whole.shares[0].device.as_str(), whole.left_out.len()), ("cpu-a", 1));
        let LeftOut { device, reason } = &whole.left_out[0];
        let said = "preparing the frame failed: the local size has 1048576 work-items";
        assert!(device == "cpu-b" && reason.starts_with(said), "{device}: {reason}");
        // A device that is ready holds the scene until the device is freed.
        assert!(Arc::strong_count(&some.scene) > 1, "a device that failed may break down when it is freed");
        let every = split(1);
        let error = every.cast_ready(the_second_fails(&every), Vec::new()).err().unwrap();
        assert!(error.to_string().starts_with(&format!("on cpu-b: {said}")), "{error}");
        let mut ready = the_second_fails(&some);
        let alone = some.cast_ready(vec![ready.remove(1)], Vec::new()).err().unwrap();
        assert_eq!((alone.to_string(), alone.exit_code()), (error.to_string(), 2));
    }

    #[test]
    fn a_failure_names_its_device_and_has_the_exit_code_and_the_advice_of_its_cause() {
        let split = split(1);
        let ready = split.ready(&castings(&[("cpu-a", "naive")])[0]).unwrap();
        let heap = LaunchError::HeapExhausted { used: 2, size: 1, has_own_file: true };
        for (error, code, advice) in [
            (heap, 2, "docs/own-kernels.md"),
            (LaunchError::OpenCl("clFinish returned -5".to_owned()), 1, "another --strategy"),
        ] {
            let reason = format!("reading the image failed: {error}");
            let Failure::Device((left_out, error)) = ready.failed("reading the image")(error) else {
                panic!("the device is to blame")
            };
            assert_eq!((left_out.device.as_str(), left_out.reason.as_str()), ("cpu-a", reason.as_str()));
            assert_eq!((error.to_string(), error.exit_code()), (format!("on cpu-a: {reason}"), code));
            assert!(error.remedy().contains(advice), "{}", error.remedy());
        }
    }

    #[test]
    fn an_error_that_names_its_device_does_not_name_it_again() {
        let device = castings(&[("cpu-a", "naive")]).remove(0).device;
        let named = |message: &str| lost(&device.info, String::new(), Error::input(message)).1.to_string();
        assert_eq!(named("cpu-a cannot cast this frame"), "cpu-a cannot cast this frame");
        assert_eq!(named("the build failed"), "on cpu-a: the build failed");
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
    fn work_at_once_keeps_its_order_and_a_panic_is_an_error() {
        assert_eq!(at_once(&[3, 1, 2], |number| 10 * number).unwrap(), [30, 10, 20]);
        let failing = at_once(&[1, 2], |number| if *number == 2 { Err("full") } else { Ok(()) });
        assert_eq!(failing.unwrap(), [Ok(()), Err("full")]);
        let panicking = at_once(&[1, 2], |number| assert_eq!(*number, 1, "a test's panic"));
        assert_eq!(panicking.unwrap_err().to_string(), "a thread that used a device panicked");
    }

    #[test]
    fn no_work_begins_if_the_system_refuses_a_thread() {
        // No address space can hold a stack of this size.
        let refused = Builder::new().stack_size(1 << (usize::BITS - 1));
        let mut builders = [Builder::new(), refused].into_iter();
        let has_begun = AtomicBool::new(false);
        let work = |_: &i32| has_begun.store(true, Ordering::Relaxed);
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
