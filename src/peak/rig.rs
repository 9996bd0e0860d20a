//! Shared parts of the measurements: building programs of `cl/peak/`, and timing a kernel with enough loops.
//! A *loop* here means one iteration of a kernel's loop.

use crate::clock::ms_since;
use crate::device::Device;
use crate::error::{Error, Result};
use crate::launch::{LaunchError, Queue, Refused};
use crate::program::{BuiltProgram, ProgramCache, ProgramSpec, Sources};
use ocl::builders::KernelBuilder;
use ocl::enums::{KernelWorkGroupInfo, KernelWorkGroupInfoResult, ProfilingInfo, ProfilingInfoResult};
use ocl::{Buffer, Event, Kernel, MemFlags, Program};
use std::time::Instant;

/// A compiled program of `cl/peak/`.
pub struct PeakProgram {
    program: Program,
    /// The paths of those kernel files of the program that the user added or changed.
    own_files: Vec<String>,
}

/// An open device whose peak rates are measured.
pub struct Rig<'a> {
    /// The device whose peak rates are measured.
    pub device: &'a Device,
    /// The command queue of the device.
    pub queue: Queue,
    sources: &'a Sources,
}

/// Number of repeats of every measurement.
const REPEATS: usize = 9;
/// The number of loops is doubled until a kernel launch takes at least `LONG_ENOUGH_MS` (or has `MOST_LOOPS`
/// loops), so that the timer's resolution and the cost of the launch are negligible.
const LONG_ENOUGH_MS: f64 = 20.0;
/// If a kernel launch takes more than `WITHOUT_TIMES_MS` by the host's clock, but no time by the device's
/// clock, the device's clock is assumed not to run.
const WITHOUT_TIMES_MS: f64 = 1000.0;
/// The reason of a failure if the device's clock does not run.
pub const NO_TIMES: &str = "by the device's clock, the kernels take no time";
/// The largest number of loops in a kernel launch.
const MOST_LOOPS: i32 = 1 << 24;

/// Returns the error for a measurement in which OpenCL failed.
pub fn failed(error: impl Into<LaunchError>) -> Error {
    failed_because(&error.into().to_string())
}

/// Returns the error for a measurement that failed for this reason.
pub fn failed_because(reason: &str) -> Error {
    Error::run(format!("the device's peak rates could not be measured: {reason}"))
        .with_help("choose another device with --device; `raycl devices` lists all devices")
}

impl<'a> Rig<'a> {
    /// Opens a device, so that its peak rates can be measured.
    pub fn open(device: &'a Device, sources: &'a Sources) -> Result<Self> {
        Ok(Self { device, queue: Queue::open(device)?, sources })
    }

    /// Returns the number of work-items per work-group. On a CPU whose lanes are elements of vectors, a
    /// work-group has 1 work-item. On other devices, whose lanes are work-items, a work-group has many
    /// work-items. With Mesa's driver, CPUs report no vectors, so their lanes are work-items too.
    pub fn group(&self) -> usize {
        let limits = &self.device.info.limits;
        if limits.is_cpu && limits.native_width > 1 { 1 } else { self.large_group() }
    }

    /// Returns the largest number of work-items per work-group that the device allows, up to 256. This number
    /// of work-items is a power of two.
    pub fn large_group(&self) -> usize {
        self.device.info.limits.group(256)
    }

    /// Returns a number of work-items that keeps every compute unit busy, and that fills whole work-groups.
    pub fn items(&self) -> usize {
        let groups_a_unit = if self.device.info.limits.is_cpu { 4 } else { 32 };
        self.device.info.limits.compute_units.max(1) as usize * groups_a_unit * self.group()
    }

    /// Returns the number of floats per vector: the device's native width if it is above 1, else `otherwise`.
    /// The native width is 1 on devices whose lanes are work-items.
    pub fn width(&self, otherwise: u32) -> u32 {
        let own = self.device.info.limits.native_width;
        if own > 1 { own } else { otherwise }
    }

    /// Builds a program from a file in `cl/`, with the macros in `defines`.
    ///
    /// # Errors
    ///
    /// The error is an input error (a mistake of the user) if the program contains one of the user's files and does not
    /// compile.
    pub fn program(&self, file: &str, defines: &[(&str, u64)]) -> Result<PeakProgram> {
        let (source, files) = self.sources.read_joined(file)?;
        let defines: String = defines.iter().map(|(name, value)| format!("-D {name}={value} ")).collect();
        let options = format!("{defines}-cl-std=CL1.2 -cl-kernel-arg-info");
        let spec = ProgramSpec { source, options, files };
        let built =
            BuiltProgram::build(&self.queue.context, self.queue.device, &spec, &ProgramCache::default());
        let error = match built {
            Ok(BuiltProgram { program, .. }) => {
                return Ok(PeakProgram { program, own_files: self.sources.changed_paths(&spec.files) });
            }
            Err(error) => error.located(self.sources, &spec),
        };
        Err(match error.has_own_file {
            true => Refused::Build(error).into_error(&self.device.info),
            false => failed_because(&format!("{file}: {error}")),
        })
    }

    /// Makes a kernel of `items` work-items in work-groups of `group` work-items; `add` adds the kernel's arguments.
    ///
    /// # Errors
    ///
    /// Fails if the compiled kernel does not support work-groups of `group` work-items, or if OpenCL cannot make the
    /// kernel. The error is an input error (a mistake of the user) if one of the user's kernel files lacks the kernel,
    /// or changes its parameters.
    pub fn kernel<'b>(
        &self,
        PeakProgram { program, own_files }: &'b PeakProgram,
        name: &str,
        [items, group]: [usize; 2],
        add: impl FnOnce(&mut KernelBuilder<'b>),
    ) -> Result<Kernel> {
        let mut kernel = Kernel::builder();
        kernel.program(program).name(name).queue(self.queue.commands.clone());
        kernel.global_work_size(items).local_work_size(group);
        // SAFETY: every caller's arguments follow the parameters in cl/peak/. `ocl`'s own check is switched
        // off, since this check does not support pointers to vectors.
        unsafe { kernel.disable_arg_type_check() };
        add(&mut kernel);
        let kernel =
            kernel.build().map_err(|error| match LaunchError::of_kernel(name, own_files, error) {
                error @ LaunchError::OwnKernel(_) => {
                    Refused::at("making a kernel")(error).into_error(&self.device.info)
                }
                error => failed(error),
            })?;
        match kernel.wg_info(self.queue.device, KernelWorkGroupInfo::WorkGroupSize) {
            Ok(KernelWorkGroupInfoResult::WorkGroupSize(most)) if most < group => {
                Err(failed_because(&too_many(name, [group, most])))
            }
            _ => Ok(kernel),
        }
    }

    /// Makes a buffer of `len` zeros.
    pub fn buffer<T: ocl::OclPrm>(&self, len: usize) -> Result<Buffer<T>> {
        let buffer = Buffer::builder()
            .queue(self.queue.commands.clone())
            .flags(MemFlags::READ_WRITE)
            .len(len.max(1))
            .fill_val(T::default())
            .build();
        buffer.map_err(failed)
    }

    /// Launches a kernel once. Returns the time in milliseconds on the device's clock and on the host's
    /// clock.
    pub fn launch(&self, kernel: &Kernel) -> Result<(f64, f64)> {
        let start = Instant::now();
        let mut event = Event::empty();
        // SAFETY: the kernels of cl/peak/ stay within the buffers that are bound as their arguments, and
        // these buffers are still alive.
        unsafe { kernel.cmd().queue(&self.queue.commands).enew(&mut event).enq() }.map_err(failed)?;
        self.queue.commands.finish().map_err(failed)?;
        let host_ms = ms_since(start);
        let read = |info| match event.profiling_info(info) {
            Ok(ProfilingInfoResult::Start(ns) | ProfilingInfoResult::End(ns)) => Ok(ns),
            Ok(_) => Err(failed_because("the driver reported no time")),
            Err(error) => Err(failed(error)),
        };
        let ns = read(ProfilingInfo::End)?.saturating_sub(read(ProfilingInfo::Start)?);
        Ok((ns as f64 * 1e-6, host_ms))
    }

    /// Returns the seconds per loop of a kernel, one value per repeat, and the number of loops. The kernel's argument 0
    /// is the number of loops. `before` is called with the number of loops before each kernel launch.
    pub fn per_loop(
        &self,
        kernel: &Kernel,
        mut before: impl FnMut(i32) -> Result<()>,
    ) -> Result<(Vec<f64>, i32)> {
        looped(|loops| {
            before(loops)?;
            kernel.set_arg(0, loops).map_err(failed)?;
            self.launch(kernel)
        })
    }
}

/// Returns the message about a kernel that supports only `most` work-items per work-group, not `group`.
fn too_many(name: &str, [group, most]: [usize; 2]) -> String {
    format!(
        "the measurement needs work-groups of {group} work-items; the compiled kernel {name} supports at most {most}"
    )
}

/// Returns the seconds per loop, one value per repeat, and the number of loops. `timed_ms` gets a number of
/// loops, runs them, and returns the time in milliseconds on the device's clock and on the host's.
fn looped(mut timed_ms: impl FnMut(i32) -> Result<(f64, f64)>) -> Result<(Vec<f64>, i32)> {
    let mut loops = 256;
    // The first launch of a kernel is not counted, since it may include the kernel's compilation.
    timed_ms(loops)?;
    loop {
        let (device_ms, host_ms) = timed_ms(loops)?;
        if device_ms <= 0.0 && host_ms > WITHOUT_TIMES_MS {
            return Err(failed_because(NO_TIMES));
        }
        if device_ms >= LONG_ENOUGH_MS || loops >= MOST_LOOPS {
            break;
        }
        loops *= 2;
    }
    let seconds = repeat(|| timed_ms(loops).map(|(ms, _)| ms * 1e-3 / f64::from(loops)))?;
    Ok((seconds, loops))
}

/// Runs a measurement `REPEATS` times, and returns all results.
pub fn repeat<T>(mut once: impl FnMut() -> Result<T>) -> Result<Vec<T>> {
    (0..REPEATS).map(|_| once()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kernel_is_timed_with_loops_that_take_twenty_milliseconds() {
        // In this test, each loop takes a microsecond, and the first kernel launch also takes a second for
        // compilation.
        let mut launches = Vec::new();
        let looped_run = looped(|loops| {
            launches.push(loops);
            let device_ms = if launches.len() == 1 { 1000.0 } else { 1e-3 * f64::from(loops) };
            Ok((device_ms, device_ms))
        });
        let (seconds, loops) = looped_run.expect("it is measured");
        // 20,000 loops take `LONG_ENOUGH_MS`. 2^15 is the first power of two that is larger than 20,000.
        assert_eq!((loops, seconds.len(), launches.len()), (1 << 15, 9, 1 + 8 + 9));
        assert!(seconds.iter().all(|seconds| (seconds - 1e-6).abs() < 1e-15), "{seconds:?}");
        // If the clock shows no time for the loops, the number of loops stops growing at `MOST_LOOPS`.
        assert_eq!(looped(|_| Ok((0.0, 0.0))).expect("it is measured").1, 1 << 24);
    }

    #[test]
    fn a_device_whose_clock_does_not_run_is_given_up_after_a_launch_of_a_second() {
        let mut longest_ms = 0.0;
        let error = looped(|loops| {
            longest_ms = f64::from(loops);
            Ok((0.0, longest_ms))
        });
        let message = error.expect_err("it has no times").to_string();
        assert!(message.ends_with(NO_TIMES) && longest_ms == 1024.0, "{message} {longest_ms}");
    }

    #[test]
    fn the_limit_of_a_kernel_is_named() {
        let expected = "the measurement needs work-groups of 256 work-items; the compiled kernel copy supports at most 16";
        assert_eq!(too_many("copy", [256, 16]), expected);
    }

    #[test]
    fn a_mistake_in_a_kernel_file_of_the_user_is_reported_with_its_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("peak/vector.cl");
        std::fs::create_dir(folder.path().join("peak")).expect("a folder");
        let right = Sources::Embedded.read("peak/vector.cl").expect("a kernel file");
        std::fs::write(&file, format!("mistake(;\n{right}")).expect("a file");
        let device = crate::device::discover(&Sources::Embedded).expect("devices").remove(0);
        let sources = Sources::Folder(folder.path().to_owned());
        let rig = Rig::open(&device, &sources).expect("a device");
        let error = rig.program("peak/fma.cl", &[("WIDTH", 1), ("GROUP", 1)]);
        let error = error.err().expect("it does not compile");
        let message = error.to_string();
        assert_eq!(error.exit_code(), 2, "{message}");
        assert!(message.starts_with("a kernel file does not compile: "), "{message}");
        assert!(message.contains(&format!("{}:1:", file.display())), "{message}");
        // Programs that do not contain the user's file are raycl's own.
        assert!(rig.program("peak/launch.cl", &[]).is_ok());
        let error = rig.program("peak/latency.cl", &[]).err().expect("it lacks the define ENTRIES");
        assert_eq!(error.exit_code(), 1, "{error}");
    }

    #[test]
    fn a_kernel_that_a_file_of_the_user_lacks_or_changes_is_the_users_mistake() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("peak/launch.cl");
        std::fs::create_dir(folder.path().join("peak")).expect("a folder");
        let text = Sources::Embedded.read("peak/launch.cl").expect("a kernel file");
        let device = crate::device::discover(&Sources::Embedded).expect("devices").remove(0);
        let sources = Sources::Folder(folder.path().to_owned());
        let rig = Rig::open(&device, &sources).expect("a device");
        let out = rig.buffer::<i32>(1).expect("a buffer");
        for (from, to, said) in [
            ("void nothing(", "void something(", "defines no kernel `nothing`"),
            ("const int mark)", "const int mark, int more)", "has other parameters than raycl's kernel"),
            // The driver refuses the argument, since the argument has another size than the parameter.
            ("const int mark)", "const long mark)", "has other parameters than raycl's kernel"),
        ] {
            assert_eq!(text.matches(from).count(), 1, "{from}");
            std::fs::write(&file, text.replace(from, to)).expect("a file");
            let program = rig.program("peak/launch.cl", &[]).expect("a program");
            let kernel = rig.kernel(&program, "nothing", [1, 1], |kernel| {
                kernel.arg(&out).arg(7_i32);
            });
            let error = kernel.expect_err("raycl's kernel is missing");
            let message = error.to_string();
            assert_eq!(error.exit_code(), 2, "{message}");
            assert!(message.contains(said) && message.contains(&file.display().to_string()), "{message}");
        }
    }

    #[test]
    fn a_launchs_times_are_milliseconds_of_which_the_hosts_include_the_devices() {
        let device = crate::device::discover(&Sources::Embedded).expect("devices").remove(0);
        let rig = Rig::open(&device, &Sources::Embedded).expect("a device");
        let program = rig.program("peak/launch.cl", &[]).expect("a program");
        let out = rig.buffer::<i32>(1).expect("a buffer");
        let kernel = rig.kernel(&program, "nothing", [1, 1], |kernel| {
            kernel.arg(&out).arg(7_i32);
        });
        let kernel = kernel.expect("a kernel");
        for _ in 0..5 {
            let start = Instant::now();
            let (device_ms, host_ms) = rig.launch(&kernel).expect("it runs");
            let all_ms = ms_since(start);
            assert!(device_ms <= host_ms && host_ms <= all_ms, "{device_ms} {host_ms} {all_ms}");
        }
    }
}
