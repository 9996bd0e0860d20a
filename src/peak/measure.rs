//! Measures the peak rates, one per function. Each of these functions checks the numbers that its kernel
//! computed. The check shows that the kernel did the work. A *loop* here means one iteration of a kernel's loop.

use super::rig::{NO_TIMES, PeakProgram, Rig, failed, failed_because, repeat};
use super::{Figure, Peak};
use crate::device::{Device, DeviceLimits};
use crate::error::Result;
use crate::memory::Available;
use crate::program::Sources;
use ocl::Kernel;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng as _;
use std::time::{Duration, Instant};

/// The values of CHAINS and STEPS in cl/peak/fma.cl: in each iteration of the loop, a work-item computes CHAINS
/// independent chains of STEPS multiply-adds of vectors.
const CHAINS: u64 = 16;
const FMA_STEPS: u64 = 8;
/// The value of STEPS in cl/peak/latency.cl: the number of operations in an iteration of the loop; each
/// operation needs the result of the operation before it.
const STEPS: i32 = 16;
/// The value of SLOTS in cl/peak/local.cl: the number of vectors that a work-item reads in an iteration of the loop.
const SLOTS: u64 = 8;
/// Size in bytes of a buffer that does not fit into any cache. On a device with little memory, a smaller buffer is
/// used.
const LARGE_BYTES: u64 = 512 << 20;
/// If a device shares the host's memory, a large buffer takes at most this fraction, `1 / HOST_FRACTION`, of the memory
/// that is available. A measurement has up to two large buffers or lists at a time, and the driver's compiler also
/// needs memory.
const HOST_FRACTION: u64 = 8;
/// The distance in bytes between neighbouring entries of the pointer chase in global memory: a cache line. In
/// a pointer chase, each read yields the index of the entry that is read next.
const LINE_BYTES: usize = 128;
/// Number of entries of the pointer chases in private and `__local` memory. In a pointer chase, each read
/// yields the index of the entry that is read next. `ENTRIES` is a prime, so that no pointer chase ends at
/// the entry at which it began. The last entry that a pointer chase reads therefore shows that the chase ran.
const ENTRIES: u64 = 61;
/// Number of kernel launches in a batch.
const BATCH: u32 = 500;

/// Measures all peak rates of a device, in a few seconds on a GPU.
pub fn measure(device: &Device, sources: &Sources) -> Result<Peak> {
    let rig = Rig::open(device, sources)?;
    let [launch_device_us, launch_host_us, launch_batched_us] = launch(&rig)?;
    let chases = rig.program("peak/latency.cl", &[("ENTRIES", ENTRIES)])?;
    let info = &device.info;
    Ok(Peak {
        device: info.label.clone(),
        platform: info.platform.clone(),
        driver: info.driver.clone(),
        state: Some(info.state()),
        timestamp: jiff::Timestamp::now().to_string(),
        raycl_version: env!("CARGO_PKG_VERSION").to_owned(),
        max_clock_mhz: info.hardware.max_clock_mhz,
        fma_per_s: fma(&rig)?,
        copy_bytes_per_s: copy(&rig)?,
        local_bytes_per_s: local(&rig)?,
        launch_device_us,
        launch_host_us,
        launch_batched_us,
        private_ns: chain(&rig, &chases)?,
        private_array_ns: chase(&rig, &chases, "chase_private")?,
        local_ns: chase(&rig, &chases, "chase_local")?,
        global_ns: chase_global(&rig, &chases)?,
    })
}

/// Returns the rate: the work per loop divided by the seconds per loop. Repeats that took no time by the device's clock
/// are left out. Returns an error if all repeats took no time.
fn rates(work: f64, seconds: &[f64]) -> Result<Figure> {
    let rates: Vec<f64> = seconds.iter().filter(|s| **s > 0.0).map(|s| work / s).collect();
    match rates.is_empty() {
        true => Err(failed_because(NO_TIMES)),
        false => Ok(Figure::of(&rates)),
    }
}

/// Returns the nanoseconds per step of a pointer chase or chain, from the seconds per loop of `STEPS` steps.
fn latency(seconds: &[f64]) -> Figure {
    Figure::of(&seconds.iter().map(|s| s * 1e9 / f64::from(STEPS)).collect::<Vec<_>>())
}

fn expect(what: &str, actual: f64, expected: f64) -> Result<()> {
    let close = (actual - expected).abs() <= 1e-3 * expected.abs();
    if close { Ok(()) } else { Err(failed_because(&format!("{what} returned {actual}, not {expected}"))) }
}

fn fma(rig: &Rig<'_>) -> Result<Figure> {
    let (items, group, width) = (rig.items(), rig.group(), u64::from(rig.width(1)));
    let program = rig.program("peak/fma.cl", &[("WIDTH", width), ("GROUP", group as u64)])?;
    let out = rig.buffer::<f32>(items)?;
    let kernel = rig.kernel(&program, "fma_rate", [items, group], |kernel| {
        kernel.arg(0_i32).arg(0.5_f32).arg(1.0_f32).arg(&out);
    })?;
    let (seconds, _) = rig.per_loop(&kernel, |_| Ok(()))?;
    let last_sum = || -> Result<f64> {
        let mut sums = vec![0.0; items];
        out.read(&mut sums).enq().map_err(failed)?;
        Ok(f64::from(sums[items - 1]))
    };
    let chains = CHAINS * width;
    // Each chain computes x = 0.5 x + 1 again and again, and converges to 1 / (1 - 0.5) = 2.
    expect("multiply-adds", last_sum()?, 2.0 * chains as f64)?;
    // After a single loop of multiply-adds, the chains have not converged to 2, so the sum of their values
    // depends on the number of steps.
    kernel.set_arg(0, 1_i32).map_err(failed)?;
    rig.launch(&kernel)?;
    expect("a loop of multiply-adds", last_sum()?, after_a_loop(group - 1, width))?;
    multiplied(items, width, &seconds)
}

/// Returns the sum of all elements of the vectors that a work-item has computed (one vector per chain) after
/// one loop of multiply-adds. `item` is the work-item's index in its work-group. Chain i begins at `item` +
/// i, and each step halves the chain's distance from its limit, 2.
fn after_a_loop(item: usize, width: u64) -> f64 {
    let distances: f64 = (0..CHAINS).map(|chain| (item as u64 + chain) as f64 - 2.0).sum();
    width as f64 * (2.0 * CHAINS as f64 + distances / f64::from(1_u32 << FMA_STEPS))
}

/// Returns the multiply-adds per second. In each loop, every work-item computes with vectors of `width`
/// floats. `seconds` are the seconds per loop.
fn multiplied(items: usize, width: u64, seconds: &[f64]) -> Result<Figure> {
    rates((items as u64 * CHAINS * width * FMA_STEPS) as f64, seconds)
}

/// Returns the size in bytes of a large buffer that fits easily into the device's memory: a whole number of mebibytes.
///
/// # Errors
///
/// Fails if a buffer of one mebibyte exceeds the device's limit. Also fails if the device shares the host's memory, and
/// fewer than `HOST_FRACTION` mebibytes of this memory are available.
fn large_bytes(rig: &Rig<'_>) -> Result<usize> {
    let host = rig.queue.shares_memory.then(Available::read);
    fitting_bytes(&rig.device.info.limits, host.as_ref())
}

/// Returns the same size as [`large_bytes`]. `host` is the host's memory; `None` if the device has memory of
/// its own.
fn fitting_bytes(limits: &DeviceLimits, host: Option<&Available>) -> Result<usize> {
    if limits.allocation_bytes < 1 << 20 {
        let most = limits.allocation_bytes;
        return Err(failed_because(&format!(
            "a buffer of {} B is needed, but the device's limit is {most} B",
            1 << 20
        )));
    }
    let mut bytes = LARGE_BYTES.min(limits.global_bytes / 16).min(limits.allocation_bytes);
    if let Some(host) = host {
        let sum = format!("{HOST_FRACTION} x {} B", 1 << 20);
        host.hold(HOST_FRACTION << 20, "the measurement of peak rates", &sum)?;
        bytes = bytes.min(host.bytes / HOST_FRACTION);
    }
    Ok((bytes as usize / (1 << 20)).max(1) << 20)
}

fn copy(rig: &Rig<'_>) -> Result<Figure> {
    let width = rig.width(4);
    let group = rig.large_group();
    let program = rig.program("peak/copy.cl", &[("WIDTH", u64::from(width)), ("GROUP", group as u64)])?;
    let floats = large_bytes(rig)? / 4;
    let (from, to) = (rig.buffer::<f32>(floats)?, rig.buffer::<f32>(floats)?);
    from.cmd().fill(1.5, None).enq().map_err(failed)?;
    // The last float differs from all others. A copy ends with this float only if the whole buffer was
    // copied.
    from.cmd().write(&[2.5_f32][..]).offset(floats - 1).enq().map_err(failed)?;
    // The buffer's size is a whole number of mebibytes, so the buffer's vectors fill whole work-groups.
    let kernel = rig.kernel(&program, "copy", [floats / width as usize, group], |kernel| {
        kernel.arg(&from).arg(&to);
    })?;
    rig.launch(&kernel)?;
    let seconds = repeat(|| rig.launch(&kernel).map(|(ms, _)| ms * 1e-3))?;
    let mut last = [0.0_f32];
    to.cmd().read(&mut last[..]).offset(floats - 1).enq().map_err(failed)?;
    expect("the copy", f64::from(last[0]), 2.5)?;
    copied(floats, &seconds)
}

/// Returns the bytes per second of a copy, which reads and writes each float.
fn copied(floats: usize, seconds: &[f64]) -> Result<Figure> {
    rates(2.0 * 4.0 * floats as f64, seconds)
}

fn local(rig: &Rig<'_>) -> Result<Figure> {
    let width = u64::from(rig.width(4));
    let item_bytes = 2 * SLOTS * width * 4;
    let local_bytes = rig.device.info.limits.local_bytes;
    if local_bytes < item_bytes {
        return Err(failed_because(&format!(
            "a work-item needs {item_bytes} B of __local memory, but the device's limit is {local_bytes} B"
        )));
    }
    let group = rig.group().min((local_bytes / item_bytes) as usize);
    let items = rig.items() / group * group;
    let program = rig.program("peak/local.cl", &[("WIDTH", width), ("GROUP", group as u64)])?;
    let out = rig.buffer::<f32>(items)?;
    let kernel = rig.kernel(&program, "local_rate", [items, group], |kernel| {
        kernel.arg(0_i32).arg(&out);
    })?;
    let (seconds, loops) = rig.per_loop(&kernel, |_| Ok(()))?;
    let mut sums = vec![0.0; items];
    out.read(&mut sums).enq().map_err(failed)?;
    // A sum of floats that are the same power of two stops growing after 2^24 of them: rounding then discards
    // every further summand.
    let reads = f64::from(loops).min(f64::from(1 << 24));
    let expected = reads * (SLOTS * width) as f64 * own_number(group - 1);
    expect("__local reads", f64::from(sums[items - 1]), expected)?;
    read_locally(items, width, &seconds)
}

/// Returns the number with which a work-item fills its vectors in `__local` memory; `item` is the work-item's
/// index in its work-group. A work-item that read its neighbour's vectors would find another number there.
fn own_number(item: usize) -> f64 {
    f64::from(1 << (item % 4))
}

/// Returns the bytes per second. In each loop, every work-item reads vectors of `width` floats. `seconds` are
/// the seconds per loop.
fn read_locally(items: usize, width: u64, seconds: &[f64]) -> Result<Figure> {
    rates((items as u64 * SLOTS * width * 4) as f64, seconds)
}

/// Measures the time of a single kernel launch on the device's clock and on the host's. The function also
/// measures the mean time of many kernel launches in a row. All times are in microseconds.
fn launch(rig: &Rig<'_>) -> Result<[Figure; 3]> {
    let program = rig.program("peak/launch.cl", &[])?;
    let out = rig.buffer::<i32>(1)?;
    let kernel = rig.kernel(&program, "nothing", [1, 1], |kernel| {
        kernel.arg(&out).arg(7_i32);
    })?;
    rig.launch(&kernel)?;
    let single = repeat(|| {
        // A single kernel launch after a pause is not typical, so the shortest time of several consecutive launches is
        // used.
        let row: Vec<(f64, f64)> = (0..20).map(|_| rig.launch(&kernel)).collect::<Result<_>>()?;
        Ok(shortest_us(&row))
    })?;
    let batched = repeat(|| batch(rig, &kernel))?;
    let mut mark = [0];
    out.read(&mut mark[..]).enq().map_err(failed)?;
    expect("a launch", f64::from(mark[0]), 7.0)?;
    let [on_device, on_host] = figures(&single);
    Ok([on_device, on_host, Figure::of(&batched)])
}

/// Summarises the times on the device's clock (the first of each pair) and the times on the host's clock (the
/// second).
fn figures(pairs: &[(f64, f64)]) -> [Figure; 2] {
    let (on_device, on_host): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
    [on_device, on_host].map(|times| Figure::of(&times))
}

/// Returns the shortest time on the device's clock and the shortest time on the host's, in microseconds.
fn shortest_us(row_ms: &[(f64, f64)]) -> (f64, f64) {
    let best = |of: fn(&(f64, f64)) -> f64| row_ms.iter().map(of).fold(f64::INFINITY, f64::min);
    (best(|one| one.0) * 1e3, best(|one| one.1) * 1e3)
}

fn batch(rig: &Rig<'_>, kernel: &Kernel) -> Result<f64> {
    let start = Instant::now();
    for _ in 0..BATCH {
        // SAFETY: as in `Rig::launch`, the kernel stays within the buffers that are bound as its arguments,
        // and these buffers are still alive.
        unsafe { kernel.cmd().queue(&rig.queue.commands).enq() }.map_err(failed)?;
    }
    rig.queue.commands.finish().map_err(failed)?;
    Ok(each_us(start.elapsed()))
}

/// Returns the mean time of a kernel launch in a batch, in microseconds.
fn each_us(all: Duration) -> f64 {
    all.as_secs_f64() * 1e6 / f64::from(BATCH)
}

fn chain(rig: &Rig<'_>, program: &PeakProgram) -> Result<Figure> {
    let out = rig.buffer::<f32>(1)?;
    let kernel = rig.kernel(program, "chain_private", [1, 1], |kernel| {
        kernel.arg(0_i32).arg(0.5_f32).arg(1.0_f32).arg(&out);
    })?;
    let (seconds, _) = rig.per_loop(&kernel, |_| Ok(()))?;
    let mut value = [0.0_f32];
    out.read(&mut value[..]).enq().map_err(failed)?;
    expect("the chain", f64::from(value[0]), 2.0)?;
    Ok(latency(&seconds))
}

/// Number of entries by which a step of a pointer chase advances. Any stride works that is not a multiple of
/// the number of entries, `ENTRIES`.
const STRIDE: i32 = 13;

fn chase(rig: &Rig<'_>, program: &PeakProgram, name: &'static str) -> Result<Figure> {
    let out = rig.buffer::<i32>(1)?;
    let kernel = rig.kernel(program, name, [1, 1], |kernel| {
        kernel.arg(0_i32).arg(STRIDE).arg(&out);
    })?;
    let (seconds, loops) = rig.per_loop(&kernel, |_| Ok(()))?;
    let mut at = [0];
    out.read(&mut at[..]).enq().map_err(failed)?;
    let expected = (i64::from(loops) * i64::from(STEPS) * i64::from(STRIDE)) % ENTRIES as i64;
    expect(name, f64::from(at[0]) + 1.0, expected as f64 + 1.0)?;
    Ok(latency(&seconds))
}

/// Chases pointers in one random cycle through all cache lines of a large buffer. Each kernel launch continues
/// where the previous one ended.
fn chase_global(rig: &Rig<'_>, program: &PeakProgram) -> Result<Figure> {
    let stride = LINE_BYTES / 4;
    let lines = large_bytes(rig)? / LINE_BYTES;
    let next = cycle(lines, stride);
    let buffer = rig.buffer::<i32>(next.len())?;
    buffer.write(&next).enq().map_err(failed)?;
    let out = rig.buffer::<i32>(1)?;
    let kernel = rig.kernel(program, "chase_global", [1, 1], |kernel| {
        kernel.arg(0_i32).arg(0_i32).arg(&buffer).arg(&out);
    })?;
    // A kernel launch has at most 2^24 loops (`MOST_LOOPS`), so the number of steps fits into an `i32`.
    let (mut at, mut steps) = (0_i32, 0_i32);
    let (seconds, _) = rig.per_loop(&kernel, |loops| {
        for _ in 0..steps {
            at = next[at as usize];
        }
        steps = loops * STEPS;
        kernel.set_arg(1, at).map_err(failed)
    })?;
    let mut end = [0];
    out.read(&mut end[..]).enq().map_err(failed)?;
    for _ in 0..steps {
        at = next[at as usize];
    }
    expect("the chase", f64::from(end[0]) + 1.0, f64::from(at) + 1.0)?;
    Ok(latency(&seconds))
}

/// Returns a list in which `lines` entries, `stride` elements apart, form one random cycle: each entry
/// contains the index of the next entry of the cycle.
fn cycle(lines: usize, stride: usize) -> Vec<i32> {
    let mut order: Vec<usize> = (1..lines).collect();
    order.shuffle(&mut ChaCha8Rng::seed_from_u64(1));
    let mut next = vec![0_i32; lines * stride];
    let mut at = 0;
    for line in order {
        next[at] = (line * stride) as i32;
        at = line * stride;
    }
    next
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{EXAMPLE_LIMITS, discover};
    use crate::launch::alone::{reported_local_bytes, reports_local_memory};

    #[test]
    fn a_cycle_visits_every_line_once() {
        let next = cycle(1000, 32);
        let (mut at, mut visited) = (0_usize, 0);
        loop {
            at = next[at] as usize;
            visited += 1;
            assert_eq!(at % 32, 0);
            if at == 0 {
                break;
            }
        }
        assert_eq!(visited, 1000);
        // A device may fetch neighbouring cache lines ahead. In a random cycle of 1000 cache lines, only
        // about one line is followed by its neighbour in memory.
        let is_neighbour = |line: &usize| next[32 * line] as usize == 32 * ((line + 1) % 1000);
        let in_order = (0..1000).filter(is_neighbour).count();
        assert!(in_order < 10, "{in_order} of 1000 lines are followed by their neighbours");
    }

    #[test]
    fn bytes_read_and_bytes_written_both_count_as_copied() {
        let rate = copied(1000, &[0.5; 5]).unwrap();
        assert!((rate.median - 16_000.0).abs() < 1e-6, "{rate:?}");
    }

    #[test]
    fn multiply_adds_and_reads_are_counted_as_the_kernels_do_them() {
        // Each of ten work-items has 16 chains of 8 steps with vectors of 4 floats. A loop takes half a second.
        assert_eq!(multiplied(10, 4, &[0.5; 5]).unwrap().median, 2.0 * 10.0 * 16.0 * 8.0 * 4.0);
        // Each of ten work-items reads 8 vectors of 4 floats of 4 bytes.
        assert_eq!(read_locally(10, 4, &[0.5; 5]).unwrap().median, 2.0 * 10.0 * 8.0 * 4.0 * 4.0);
        let defines = |file: &str, name: &str, value: u64| {
            let text = Sources::Embedded.read(file).expect("a file");
            text.lines().any(|line| line.split_whitespace().eq(["#define", name, &value.to_string()]))
        };
        assert!(defines("peak/fma.cl", "CHAINS", CHAINS) && defines("peak/fma.cl", "STEPS", FMA_STEPS));
        assert!(
            defines("peak/local.cl", "SLOTS", SLOTS) && defines("peak/latency.cl", "STEPS", STEPS as u64)
        );
    }

    /// Each expected number is the sum of the values that a work-item's 16 chains of multiply-adds have after
    /// eight steps. In the first work-item, the chains begin at the numbers 0 to 15.
    #[test]
    fn a_loop_of_multiply_adds_moves_each_chain_eight_steps_towards_its_limit() {
        assert_eq!(after_a_loop(0, 1), 32.0 + (120.0 - 32.0) / 256.0);
        assert_eq!(after_a_loop(10, 4), 4.0 * (32.0 + (280.0 - 32.0) / 256.0));
    }

    /// A measurement compiles the kernel `fma_rate` with vectors of only one width, which depends on the
    /// device, so this test compiles the kernel with vectors of every width.
    #[test]
    fn vectors_of_every_width_have_as_many_floats_as_are_counted() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let rig = Rig::open(&device, &Sources::Embedded).unwrap();
        let out = rig.buffer::<f32>(1).unwrap();
        for width in [1, 2, 4, 8, 16] {
            let program = rig.program("peak/fma.cl", &[("WIDTH", width), ("GROUP", 1)]).unwrap();
            let kernel = rig.kernel(&program, "fma_rate", [1, 1], |kernel| {
                kernel.arg(1_i32).arg(0.5_f32).arg(1.0_f32).arg(&out);
            });
            rig.launch(&kernel.unwrap()).unwrap();
            let mut sum = [0.0_f32];
            out.read(&mut sum[..]).enq().unwrap();
            let (actual, expected) = (f64::from(sum[0]), after_a_loop(0, width));
            assert!((actual - expected).abs() < 1e-3 * expected, "{width}: {actual}, expected {expected}");
        }
    }

    /// On most CPUs, a measurement has one work-item per work-group, so this test runs a larger work-group.
    #[test]
    fn each_work_item_reads_its_own_vectors_in_local_memory() {
        const GROUP: usize = 8;
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let rig = Rig::open(&device, &Sources::Embedded).unwrap();
        let out = rig.buffer::<f32>(GROUP).unwrap();
        let program = rig.program("peak/local.cl", &[("WIDTH", 4), ("GROUP", GROUP as u64)]).unwrap();
        let kernel = rig.kernel(&program, "local_rate", [GROUP, GROUP], |kernel| {
            kernel.arg(3_i32).arg(&out);
        });
        rig.launch(&kernel.unwrap()).unwrap();
        let mut sums = [0.0_f32; GROUP];
        out.read(&mut sums[..]).enq().unwrap();
        // In each of three loops, a work-item reads 8 vectors of 4 floats.
        let expected: Vec<f64> = (0..GROUP).map(|item| 3.0 * 8.0 * 4.0 * own_number(item)).collect();
        assert_eq!(sums.map(f64::from).to_vec(), expected);
    }

    /// The pointer chases in private and `__local` memory end at the same entry, so their results cannot show
    /// which memory contains the entries.
    #[test]
    fn only_the_chase_in_local_memory_has_its_entries_there() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let rig = Rig::open(&device, &Sources::Embedded).unwrap();
        let program = rig.program("peak/latency.cl", &[("ENTRIES", ENTRIES)]).unwrap();
        let out = rig.buffer::<i32>(1).unwrap();
        let has_entries = |name: &str| {
            let kernel = rig.kernel(&program, name, [1, 1], |kernel| {
                kernel.arg(0_i32).arg(STRIDE).arg(&out);
            });
            reported_local_bytes(&kernel.unwrap(), rig.queue.device) >= 4 * ENTRIES
        };
        let expected = [false, reports_local_memory()];
        assert_eq!(["chase_private", "chase_local"].map(has_entries), expected);
    }

    #[test]
    fn launches_are_reported_in_microseconds() {
        assert_eq!(shortest_us(&[(0.25, 0.5), (0.125, 0.75), (0.5, 1.0)]), (125.0, 500.0));
        assert_eq!(
            figures(&[(1.0, 10.0), (2.0, 20.0), (9.0, 90.0)]).map(|figure| figure.median),
            [2.0, 20.0]
        );
        // 500 launches in a second take two milliseconds each.
        assert!((each_us(Duration::from_secs(1)) - 2000.0).abs() < 1e-9);
    }

    #[test]
    fn a_device_whose_lanes_are_work_items_can_be_measured() {
        let mut device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        // On a device with only 16 MiB of memory, the large buffers have one mebibyte.
        device.info.limits = DeviceLimits { native_width: 1, global_bytes: 16 << 20, ..device.info.limits };
        let rig = Rig::open(&device, &Sources::Embedded).unwrap();
        assert!(copy(&rig).is_ok_and(|rate| rate.median > 0.0));
    }

    #[test]
    fn a_rate_is_work_by_time_and_a_latency_is_the_time_of_a_step() {
        // The repeat with 0 s per loop has no rate, so three of the four repeats remain.
        let rate = rates(10.0, &[2.0, 0.0, 4.0, 5.0]).unwrap();
        assert_eq!((rate.median, rate.repeats), (2.5, 3));
        let error = rates(10.0, &[0.0; 9]).unwrap_err().to_string();
        assert!(error.ends_with("by the device's clock, the kernels take no time"), "{error}");
        // A loop of 16 steps takes 3.2 microseconds, so a step takes 200 nanoseconds.
        assert!((latency(&[3.2e-6; 3]).median - 200.0).abs() < 1e-9);
    }

    #[test]
    fn a_result_that_is_off_by_more_than_a_thousandth_is_no_result() {
        assert!(expect("it", 1000.9, 1000.0).is_ok() && expect("it", -1000.9, -1000.0).is_ok());
        let error = expect("it", 1002.0, 1000.0).expect_err("another value").to_string();
        assert!(error.contains("it returned 1002, not 1000"), "{error}");
    }

    #[test]
    fn a_limit_of_the_device_that_is_too_small_is_named() {
        let mut device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let own = device.info.limits;
        device.info.limits = DeviceLimits { local_bytes: 7, allocation_bytes: 1024, ..own };
        let rig = Rig::open(&device, &Sources::Embedded).unwrap();
        let message = copy(&rig).unwrap_err().to_string();
        assert!(message.ends_with("1048576 B is needed, but the device's limit is 1024 B"), "{message}");
        let message = local(&rig).unwrap_err().to_string();
        assert!(message.ends_with("of __local memory, but the device's limit is 7 B"), "{message}");
    }

    #[test]
    fn work_fits_the_device_that_is_measured() {
        let mut device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let own = device.info.limits;
        let mut sizes = |limits: DeviceLimits| {
            device.info.limits = limits;
            let rig = Rig::open(&device, &Sources::Embedded).unwrap();
            // The host's free memory, which differs from machine to machine, is left out.
            (rig.group(), rig.items(), rig.width(4), fitting_bytes(&limits, None).unwrap())
        };
        let gpu = DeviceLimits {
            is_cpu: false,
            work_group_size: 1024,
            compute_units: 3,
            native_width: 1,
            global_bytes: 1 << 40,
            allocation_bytes: 1 << 40,
            ..own
        };
        assert_eq!(sizes(gpu), (256, 3 * 32 * 256, 4, 512 << 20));
        let small = DeviceLimits { work_group_size: 64, allocation_bytes: (5 << 20) + 7, ..gpu };
        assert_eq!(sizes(small), (64, 3 * 32 * 64, 4, 5 << 20));
        let cpu =
            DeviceLimits { is_cpu: true, native_width: 8, global_bytes: 64 << 20, compute_units: 2, ..gpu };
        assert_eq!(sizes(cpu), (1, 2 * 4, 8, 4 << 20));
    }

    #[test]
    fn a_device_that_shares_the_hosts_memory_gets_a_part_of_what_is_free() {
        let limits = DeviceLimits { global_bytes: 1 << 40, allocation_bytes: 1 << 40, ..EXAMPLE_LIMITS };
        let of = |mebibytes: u64| {
            let host = Available { bytes: mebibytes << 20, source: "a test".to_owned() };
            fitting_bytes(&limits, Some(&host))
        };
        assert_eq!([8, 85, 1 << 20].map(|mebibytes| of(mebibytes).unwrap() >> 20), [1, 10, 512]);
        let message = of(7).unwrap_err().to_string();
        assert!(message.contains("(8 x 1048576 B = 8388608 B)") && message.contains("a test"), "{message}");
    }
}
