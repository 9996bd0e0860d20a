//! Protects commands from OpenCL drivers that crash or hang while they list their devices. A command that starts
//! drivers does its work in a child process. If a driver ends the child process, raycl tries the drivers one by one,
//! and starts the work again without the drivers that fail.

#[cfg(unix)]
mod terminal;

use crate::cache::Cache;
use crate::device::drivers::{Driver, crash_advice, installed, only};
use crate::device::full_disk_advice;
use crate::device::patience::{GUARDED, HUNG};
use crate::error::{Error, Result, limit_advice};
use crate::experiment::why_devices_are_not_listed;
use crate::memory::{address_space_limit, readable};
use crate::own_program::own_program;
use crate::printer;
use crate::program::AFRESH;
use crate::sources::{Sources, some_of};
use crate::threads::cores;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitStatus;
#[cfg(unix)]
use terminal::LentTerminal;

/// The environment variable for settings of glibc's memory allocator. glibc reads the variable only when a process
/// starts, so raycl sets it for the child process of `render` or `view`. If the user has set the variable, raycl leaves
/// it unchanged. glibc 2.35 and later obey these settings; older versions and other C libraries ignore them.
const ALLOCATOR: &str = "GLIBC_TUNABLES";

/// Returns the value of [`ALLOCATOR`] for a machine with this number of processors.
///
/// `hugetlb` lets the allocator ask the system for huge pages. The first access to each page of new memory
/// causes a page fault, and the faults of small pages took a fifth of the time of a short command. `top_pad`
/// lets the allocator extend its heaps by 2 MiB at a time. With `mmap_threshold`, the memory of an allocation
/// of at least 4 MiB is not part of a heap, and goes back to the system when the allocation is freed. Without
/// this setting, glibc raises the threshold to as much as 32 MiB, and a picture of ten million triangles took
/// 125 MiB more memory. `arena_max` limits the number of heaps to the number of processors; without this
/// setting, glibc makes up to eight times as many heaps. With two heaps instead of five, and a `top_pad` of 2
/// MiB instead of 16 MiB, the same picture took 50 MiB less memory and the same time.
fn allocator_settings(processors: usize) -> String {
    let malloc = ["hugetlb=1", "top_pad=2097152", "mmap_threshold=4194304"].map(str::to_owned);
    let settings = malloc.into_iter().chain([format!("arena_max={processors}")]);
    settings.map(|setting| format!("glibc.malloc.{setting}")).collect::<Vec<_>>().join(":")
}

/// Returns true if this process is the child process that [`run`] starts.
pub fn is_inside() -> bool {
    std::env::var_os(GUARDED).is_some()
}

/// The properties of a command that decide how it runs in a child process, and what may have crashed it.
pub struct Guarded<'a> {
    /// True if the command reads standard input. It then cannot run again, since its input can be read only once.
    pub reads_standard_input: bool,
    /// True for `raycl render` and `raycl view`: the allocator of the child process uses huge pages, unless the user
    /// has set `GLIBC_TUNABLES`. Commands that only measure run without huge pages, as the worker processes of `raycl
    /// run` do.
    pub shows_pictures: bool,
    /// Where the command shows pictures while it runs.
    pub screen: Screen,
    /// The folder of the user's kernel files, if the command uses one. If the child process crashes, a mistake in these
    /// files is a more likely cause than a mistake in a driver.
    pub cl_dir: Option<&'a Path>,
}

/// Where a command shows pictures while it runs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Screen {
    /// Nowhere, for all commands except `raycl view`.
    None,
    /// In the terminal, for `raycl view --terminal`. The terminal is restored after the child process has ended in any
    /// way. It is restored only on Unix, and only if standard input and standard output are a terminal.
    Terminal,
    /// In a window, for `raycl view` without `--terminal`.
    Window,
}

impl Guarded<'_> {
    fn opens_window(&self) -> bool {
        self.screen == Screen::Window
    }
}

/// Runs this process's command line, that of `command`, in a child process. If the child's exit code is 0, returns;
/// otherwise, ends this process with this exit code. If a driver ends the child process, raycl runs the command line
/// again without the drivers that fail.
///
/// # Errors
///
/// Fails if a driver ended the child process, and the command cannot run again without the failing drivers, for example
/// because every driver fails. Also fails if a driver ends the second child process.
pub fn run(command: &Guarded<'_>) -> Result<()> {
    let sets_allocator = command.shows_pictures && std::env::var_os(ALLOCATOR).is_none();
    let allocator = sets_allocator.then(|| (ALLOCATOR, allocator_settings(cores()).into()));
    let terminal = match command.screen {
        Screen::Terminal => LentTerminal::new().map_err(not_lent)?,
        Screen::None | Screen::Window => None,
    };
    let status = attempt(allocator.as_slice(), terminal.as_ref())?;
    if drivers_doing(status).is_none() {
        return end_as(status);
    }
    end_as(without_broken(status, command, terminal.as_ref())?)
}

/// Tries the drivers one by one. If some of them fail, runs the command again without them. If none fails,
/// the command may run again without the compiled programs in raycl's cache ([`ended_afresh`]). Returns the
/// exit status of the second attempt. `status` is the exit status of the first attempt.
fn without_broken(
    status: ExitStatus,
    command: &Guarded<'_>,
    terminal: Option<&LentTerminal>,
) -> Result<ExitStatus> {
    let opens_window = command.opens_window();
    let mut good = Vec::new();
    let mut broken = Vec::new();
    for driver in installed() {
        match why_broken(&driver)? {
            None => good.push(driver),
            Some(why) => broken.push((driver, why)),
        }
    }
    let cause = drivers_doing(status).unwrap_or_default();
    if broken.is_empty() {
        if good.len() > 1 && why_devices_are_not_listed(&[])?.is_some() {
            return Err(not_together(&cause, &good));
        }
        if let Some(error) = kernels_doing(status, command.cl_dir, opens_window) {
            return Err(error);
        }
        let may_run_again = !command.reads_standard_input && !opens_window && terminal.is_none();
        if may_run_again
            && crash(status).is_some()
            && let Some(status) = ended_afresh(&cause)?
        {
            return Ok(status);
        }
        let error = no_driver_alone(status, &cause, opens_window, &good);
        let may_be_cache = !may_run_again && crash(status).is_some() && Cache::of_user().is_usable();
        return Err(if may_be_cache { or_clear_cache(error) } else { error });
    }
    for (driver, why) in &broken {
        printer::tell(format!("note: the driver {driver} is left out: {why}"));
    }
    if good.is_empty() {
        return Err(Error::run(format!("{cause}, and no other driver is left")).with_help(crash_advice(0)));
    }
    if command.reads_standard_input {
        return Err(Error::run(format!("{cause}, and standard input cannot be read again"))
            .with_help("name a file instead of `-`: raycl then runs again without the drivers that fail"));
    }
    let folder = tempfile::tempdir().map_err(no_list)?;
    let status = attempt(&only(&good, folder.path()).map_err(no_list)?, terminal)?;
    match drivers_doing(status) {
        None => Ok(status),
        Some(cause) => Err(kernels_doing(status, command.cl_dir, opens_window)
            .unwrap_or_else(|| still_failing(status, &cause, opens_window, &good))),
    }
}

/// Runs the command again in a new child process. The new process compiles its programs again and removes the
/// stored programs from raycl's cache, since one of them may have crashed the driver. Returns the exit status
/// of the new process, or `None` if a driver ended the new process too. If raycl cannot use the cache,
/// returns `None` without running the command. `cause` says how the first process ended.
fn ended_afresh(cause: &str) -> Result<Option<ExitStatus>> {
    if !Cache::of_user().is_usable() {
        return Ok(None);
    }
    printer::tell(format!(
        "note: {cause}; a compiled program in raycl's cache may be the cause, so it is removed, and the command runs again"
    ));
    let status = attempt(&[(AFRESH, "1".into())], None)?;
    Ok(drivers_doing(status).is_none().then_some(status))
}

/// Returns `error` with one more remedy: to remove the compiled programs from raycl's cache.
fn or_clear_cache(error: Error) -> Error {
    let remedies = format!(
        "{}; or remove the compiled programs from raycl's cache with `raycl cache clear`, since one of them may crash the \
         driver",
        error.remedy()
    );
    error.with_help(remedies)
}

/// Returns the error for a process that crashed while the folder `cl_dir` contained kernel files that the
/// user added or changed. Returns `None` if the process did not crash, if `cl_dir` is `None`, or if all
/// kernel files in the folder equal built-in files. The message names the first few added or changed files,
/// and the number of the others. A named file need not be part of the crashed program: this process does not
/// know which files the program includes. If `opens_window` is true, the library that opens the window may
/// have crashed instead, so the remedy names this cause too.
fn kernels_doing(status: ExitStatus, cl_dir: Option<&Path>, opens_window: bool) -> Option<Error> {
    let (signal, name) = crash(status)?;
    let sources = Sources::Folder(cl_dir?.to_owned());
    let files = sources.changed_paths(&sources.own_files().unwrap_or_default());
    if files.is_empty() {
        return None;
    }
    Some(
        Error::run(format!(
            "raycl's child process crashed: {name} (signal {signal}). The folder of --cl-dir has kernel files that are \
             not built in, or that differ from the built-in files: {}",
            some_of(&files)
        ))
        .with_help(if opens_window { window_or(OWN_KERNELS) } else { OWN_KERNELS.to_owned() }),
    )
}

/// Returns the error for drivers that list their devices when each driver is loaded alone, but fail when all
/// are loaded together. `cause` says how the process ended.
fn not_together(cause: &str, drivers: &[Driver]) -> Error {
    let names: Vec<_> = drivers.iter().map(ToString::to_string).collect();
    Error::run(format!("{cause}: the drivers {} cannot be loaded together", names.join(", "))).with_help(
        "each driver alone lists its devices: set the environment variable OCL_ICD_VENDORS to a folder that contains the .icd file of one driver",
    )
}

/// Returns the error if every one of these drivers lists its devices when it is loaded alone. `cause` says
/// how the process ended. If the process crashed and `opens_window` is true, the library that opens the
/// window (the crate minifb) may have crashed: it frees memory twice on a display whose pixels do not have 32
/// bits. raycl opens no window on a display if it knows that the display's pixels do not have 32 bits, but
/// raycl cannot ask every display.
fn no_driver_alone(status: ExitStatus, cause: &str, opens_window: bool, drivers: &[Driver]) -> Error {
    let advice = advice_for(drivers, full_disk_advice());
    match crash(status).filter(|_| opens_window) {
        Some((signal, name)) => Error::run(format!(
            "raycl's child process crashed, in its window or in a driver: {name} (signal {signal})"
        ))
        .with_help(window_or(&advice)),
        None => Error::run(format!("{cause}, although each driver alone lists its devices without failing"))
            .with_help(advice),
    }
}

/// Returns the error for a process that failed again, although it used only these drivers. Each of these
/// drivers lists its devices when it is loaded alone, so raycl does not know which driver failed. `cause`
/// says how the process ended.
fn still_failing(status: ExitStatus, cause: &str, opens_window: bool, drivers: &[Driver]) -> Error {
    let advice = format!(
        "each of the other drivers lists its devices when it is loaded alone: {}",
        advice_for(drivers, full_disk_advice())
    );
    Error::run(format!("{cause}, even without the drivers that were left out"))
        .with_help(if opens_window && crash(status).is_some() { window_or(&advice) } else { advice })
}

/// Returns the remedies after a crash of a process that opens a window: first [`WINDOW`], which names the display as
/// the possible cause, then `advice`.
fn window_or(advice: &str) -> String {
    format!("{WINDOW}; if the window opened, {advice}")
}

/// Returns the advice for the user if every one of these drivers lists its devices when it is loaded alone.
/// `full_disk` is the advice about a full disk, given if the disk with PoCL's folder for compiled kernels is
/// full. A full disk disturbs no other driver than PoCL, so this advice is left out if PoCL is not among the
/// drivers.
fn advice_for(drivers: &[Driver], full_disk: Option<String>) -> String {
    let of_pocl = full_disk.filter(|_| drivers.iter().any(Driver::is_pocl));
    of_pocl.into_iter().chain([otherwise(address_space_limit())]).collect::<Vec<_>>().join("; or ")
}

/// Returns the advice for the user if every driver lists its devices when it is loaded alone.
/// `address_space_bytes` is the limit that the user has set on the address space of processes; the advice
/// names this limit, because drivers can fail to start their threads in a small address space.
fn otherwise(address_space_bytes: Option<u64>) -> String {
    let another = "try another device (`raycl devices` lists all devices, --device chooses one), another --strategy or a smaller --local-size";
    match address_space_bytes {
        Some(bytes) => format!(
            "this process may use only {} of address space, in which a driver may not fit: remove the limit with `ulimit -v unlimited`; or {another}",
            readable(bytes)
        ),
        None => another.to_owned(),
    }
}

/// Runs the command line of this process once, in a child process that also has the environment variables
/// `variables`. Returns the exit status of the child process. If `terminal` is given (for `raycl view
/// --terminal`), the terminal is restored after the child process has ended.
fn attempt(variables: &[(&str, OsString)], terminal: Option<&LentTerminal>) -> Result<ExitStatus> {
    let mut command = own_program()?;
    let own_number = std::process::id().to_string();
    command.args(std::env::args_os().skip(1)).env(GUARDED, own_number).envs(variables.iter().cloned());
    let mut child = command.spawn().map_err(|error| not_started(&error))?;
    match terminal {
        Some(terminal) => terminal.wait(&mut child),
        None => child.wait().map_err(not_awaited),
    }
}

/// Returns why a driver that is loaded alone cannot list its devices; `None` if it can list them.
fn why_broken(driver: &Driver) -> Result<Option<String>> {
    let folder = tempfile::tempdir().map_err(no_list)?;
    let alone = only(std::slice::from_ref(driver), folder.path()).map_err(no_list)?;
    why_devices_are_not_listed(&alone)
}

/// Returns a text that says how a process ended, if a driver may have ended it; otherwise `None`.
fn drivers_doing(status: ExitStatus) -> Option<String> {
    if status.code() == Some(HUNG) {
        return Some("a driver did not answer".to_owned());
    }
    let (signal, name) = crash(status)?;
    Some(format!("raycl's child process crashed, probably in a driver: {name} (signal {signal})"))
}

/// Returns the number and the name of the signal with which a process crashed; `None` if the process did not crash.
fn crash(status: ExitStatus) -> Option<(i32, &'static str)> {
    signal(status).filter(|(_, name)| CRASHES.contains(name))
}

/// Signals that result from a fault of the process itself. Other signals, such as SIGTERM, come from outside the
/// process, so they are not the driver's fault.
const CRASHES: [&str; 7] = ["SIGABRT", "SIGBUS", "SIGFPE", "SIGILL", "SIGSEGV", "SIGSYS", "SIGTRAP"];

/// The remedy after a crash of a process that used kernel files of the user.
const OWN_KERNELS: &str = "a mistake in a kernel file of yours is more likely than one in the driver: look for writes and reads out of bounds, for barriers that not all work-items of a group reach, and for a `bytes_per_ray` that is too small. The same command without --cl-dir shows whether raycl's own kernels crash too. Oclgrind, a simulator, reports accesses out of bounds with their lines: `oclgrind --build-options -cl-opt-disable raycl ... --device oclgrind`";
/// The first remedy after a crash of a process that opens a window.
const WINDOW: &str = "if no window opened, the display may be the cause: a window needs a display with 24-bit colours; --terminal shows the scene in this terminal instead";
/// The remedy after SIGKILL.
const OUT_OF_MEMORY: &str = "the system sends this signal if memory runs out (`dmesg` then says so): a smaller picture or scene needs less memory";
/// The remedy after a signal from outside the process other than SIGKILL and SIGINT, for example SIGTERM.
const FROM_OUTSIDE: &str =
    "another process sent this signal, or a limit was reached (`ulimit -a` shows the limits)";

/// On systems other than Unix, raycl does not restore the terminal, so this type has no values.
#[cfg(not(unix))]
enum LentTerminal {}

#[cfg(not(unix))]
impl LentTerminal {
    fn new() -> std::io::Result<Option<Self>> {
        Ok(None)
    }

    fn wait(&self, child: &mut std::process::Child) -> Result<ExitStatus> {
        child.wait().map_err(not_awaited)
    }
}

#[cfg(unix)]
fn signal(status: ExitStatus) -> Option<(i32, &'static str)> {
    use std::os::unix::process::ExitStatusExt as _;
    let signal = status.signal()?;
    Some((signal, signal_hook::low_level::signal_name(signal).unwrap_or("a signal without a name")))
}

#[cfg(not(unix))]
fn signal(_: ExitStatus) -> Option<(i32, &'static str)> {
    None
}

/// Ends this process with the [`exit_code`] of another process, or returns if that code is 0. If SIGINT (Ctrl-C) ended
/// the other process, SIGINT ends this process too: a shell that runs a script then ends the script. If this function
/// ends the process, no destructor runs, so the caller must have removed its temporary folders.
fn end_as(status: ExitStatus) -> Result<()> {
    // Only this process can tell the user about the signal. The child process has ended, and the shell sees only that
    // this process exits.
    if let Some(error) = ended_by_signal(status) {
        printer::tell(format!("{:?}", miette::Report::new(error)));
    }
    if signal(status).is_some_and(|(_, name)| name == "SIGINT") {
        // If this process cannot end itself with SIGINT, its exit code still contains the signal's number.
        let _ = signal_hook::low_level::emulate_default_handler(signal_hook::consts::SIGINT);
    }
    match exit_code(status) {
        0 => Ok(()),
        code => std::process::exit(code),
    }
}

/// Returns an error that names the signal that ended the process. Returns `None` if no signal ended the
/// process, and after SIGINT, which comes from the user's Ctrl-C.
fn ended_by_signal(status: ExitStatus) -> Option<Error> {
    let (signal, name) = signal(status).filter(|(_, name)| *name != "SIGINT")?;
    let error = Error::run(format!("raycl's child process was ended by {name} (signal {signal})"));
    Some(error.with_help(if name == "SIGKILL" { OUT_OF_MEMORY } else { FROM_OUTSIDE }))
}

/// Returns the exit code of a process, or 128 plus the number of the signal that ended it, as shells do.
fn exit_code(status: ExitStatus) -> i32 {
    status.code().unwrap_or_else(|| 128 + signal(status).map_or(0, |(signal, _)| signal))
}

/// Makes the system end this process when its parent process ends. If the parent has ended already, ends this
/// process at once.
#[cfg(target_os = "linux")]
pub fn ends_with_its_parent() {
    use rustix::process::{Signal, set_parent_process_death_signal};
    // If the system does not support this signal, the work continues after the parent's end.
    let _ = set_parent_process_death_signal(Some(Signal::TERM));
    if is_orphan(std::env::var(GUARDED).ok().as_deref(), std::os::unix::process::parent_id()) {
        std::process::exit(1);
    }
}

/// Returns true if the process that started this one has ended. `guarded` is the value of the variable
/// [`GUARDED`]: the number of the process that started this one. `parent` is the number of the present parent
/// process.
#[cfg(target_os = "linux")]
fn is_orphan(guarded: Option<&str>, parent: u32) -> bool {
    guarded.and_then(|number| number.parse::<u32>().ok()).is_some_and(|number| number != parent)
}

/// Does nothing on systems other than Linux: the work continues after the parent's end.
#[cfg(not(target_os = "linux"))]
pub fn ends_with_its_parent() {}

fn not_started(error: &std::io::Error) -> Error {
    Error::run(format!("the child process that runs the command could not be started: {error}")).with_help(
        limit_advice(error).unwrap_or(
            "check that raycl's executable can be read and run, and that `ulimit -u` allows more processes",
        ),
    )
}

fn not_awaited(error: impl std::fmt::Display) -> Error {
    Error::run(format!("waiting for the child process that runs the command failed: {error}"))
}

fn not_lent(error: impl std::fmt::Display) -> Error {
    Error::run(format!("the terminal could not be prepared for the child process: {error}"))
        .with_help("run the command again, or leave out --terminal to open a window")
}

fn no_list(error: impl std::fmt::Display) -> Error {
    Error::run(format!("the list of drivers for the child process could not be written: {error}"))
        .with_help("free up space in the folder for temporary files, or set TMPDIR to another folder")
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt as _;

    #[cfg(target_os = "linux")]
    #[test]
    fn a_process_whose_parent_is_not_the_one_that_started_it_is_an_orphan() {
        assert!(is_orphan(Some("7"), 1) && !is_orphan(Some("7"), 7));
        assert!(!is_orphan(None, 1) && !is_orphan(Some("yes"), 1));
    }

    #[test]
    fn a_small_address_space_is_reported_where_every_driver_alone_works() {
        let limited = otherwise(Some(1_500_000_000));
        assert!(limited.contains("only 1.5 GB") && limited.contains("ulimit -v unlimited"), "{limited}");
        assert!(otherwise(None).starts_with("try another device") && limited.ends_with(&otherwise(None)));
    }

    #[test]
    fn a_crash_of_a_process_that_opens_a_window_is_not_blamed_on_a_driver_alone() {
        let message_and_remedy = |status, opens_window| {
            let error =
                no_driver_alone(ExitStatus::from_raw(status), "a driver did not answer", opens_window, &[]);
            (error.to_string(), error.remedy().to_owned())
        };
        let (message, remedy) = message_and_remedy(11, true);
        let expected = "raycl's child process crashed, in its window or in a driver: SIGSEGV (signal 11)";
        assert_eq!(message, expected);
        assert!(remedy.starts_with(WINDOW) && remedy.contains("if the window opened, "), "{remedy}");
        for (status, opens_window) in [(11, false), (HUNG << 8, true)] {
            let (message, remedy) = message_and_remedy(status, opens_window);
            assert!(message.starts_with("a driver did not answer, although each driver alone"), "{message}");
            assert!(!remedy.contains("window") && remedy.contains("--device"), "{remedy}");
        }
    }

    #[test]
    fn the_cache_is_named_beside_the_other_remedies() {
        let error = or_clear_cache(Error::run("it crashed").with_help("try another device"));
        assert!(error.remedy().starts_with("try another device; or "), "{}", error.remedy());
        assert!(error.remedy().contains("`raycl cache clear`"), "{}", error.remedy());
    }

    #[test]
    fn a_failure_without_the_drivers_that_were_left_out_blames_no_other_driver() {
        let crashed = "raycl's child process crashed";
        let error = |status, opens_window| {
            still_failing(ExitStatus::from_raw(status), crashed, opens_window, &[Driver::Icd("a.icd".into())])
        };
        let expected = format!("{crashed}, even without the drivers that were left out");
        let advice = "each of the other drivers lists its devices when it is loaded alone: ";
        assert_eq!((error(11, false).to_string(), error(11, false).exit_code()), (expected, 1));
        for (status, opens_window) in [(11, false), (HUNG << 8, true)] {
            let error = error(status, opens_window);
            assert!(error.remedy().starts_with(advice), "{}", error.remedy());
            assert!(error.remedy().contains("--device"), "{}", error.remedy());
        }
        let in_window = error(11, true);
        assert!(in_window.remedy().starts_with(&format!("{WINDOW}; if the window opened, {advice}")));
    }

    #[test]
    fn the_allocator_has_at_most_one_heap_per_processor() {
        let expected = "glibc.malloc.hugetlb=1:glibc.malloc.top_pad=2097152:glibc.malloc.mmap_threshold=4194304:glibc.malloc.arena_max=16";
        assert_eq!(allocator_settings(16), expected);
    }

    #[test]
    fn drivers_that_only_fail_together_are_named_with_the_variable_that_selects_one() {
        let drivers = ["one.icd", "other.icd"].map(|file| Driver::Icd(file.into()));
        let error = not_together("a driver did not answer", &drivers);
        let expected = "a driver did not answer: the drivers one.icd, other.icd cannot be loaded together";
        assert_eq!((error.to_string().as_str(), error.exit_code()), (expected, 1));
        assert!(error.remedy().contains("OCL_ICD_VENDORS"), "{}", error.remedy());
    }

    #[test]
    fn a_full_disk_of_pocls_folder_is_reported_only_if_pocl_is_among_the_drivers() {
        let advice =
            |name: &str| advice_for(&[Driver::Library(name.into())], Some("the disk is full".into()));
        let other = otherwise(address_space_limit());
        assert_eq!(advice("libpocl.so.2"), format!("the disk is full; or {other}"));
        assert_eq!(advice("libnvidia-opencl.so.1"), other);
    }

    #[test]
    fn a_crash_with_kernel_files_of_the_user_is_blamed_on_these_files_first() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("cast")).expect("a folder");
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("a file");
        write("cast/shade.cl", &Sources::Embedded.read("cast/shade.cl").expect("a kernel file"));
        let error_with = |folder: Option<&Path>| kernels_doing(ExitStatus::from_raw(11), folder, false);
        // A kernel file that equals the built-in file cannot be the cause of the crash.
        assert!(error_with(None).is_none() && error_with(Some(folder.path())).is_none());
        write("cast/entry.cl", "// mine\n");
        let error = error_with(Some(folder.path())).expect("a message");
        let entry = folder.path().join("cast/entry.cl");
        let message = "raycl's child process crashed: SIGSEGV (signal 11). The folder of --cl-dir has kernel files \
            that are not built in, or that differ from the built-in files";
        assert_eq!(error.to_string(), format!("{message}: {}", entry.display()));
        for part in ["out of bounds", "barriers", "`bytes_per_ray`", "without --cl-dir", "oclgrind"] {
            assert!(error.remedy().contains(part), "{part}: {}", error.remedy());
        }
        // If the process opens a window, the library that opens the window may have crashed.
        let in_window =
            kernels_doing(ExitStatus::from_raw(11), Some(folder.path()), true).expect("a message");
        assert_eq!(in_window.to_string(), error.to_string());
        assert_eq!(in_window.remedy(), format!("{WINDOW}; if the window opened, {OWN_KERNELS}"));
        // If a driver does not answer, the process has not crashed.
        for opens_window in [false, true] {
            let hung = ExitStatus::from_raw(HUNG << 8);
            assert!(kernels_doing(hung, Some(folder.path()), opens_window).is_none());
        }
    }

    #[test]
    fn every_signal_that_ends_the_child_process_is_reported_except_that_of_ctrl_c() {
        let error_of = |status| ended_by_signal(ExitStatus::from_raw(status));
        let killed = error_of(9).expect("a message");
        assert_eq!(killed.to_string(), "raycl's child process was ended by SIGKILL (signal 9)");
        assert!(killed.remedy().contains("memory runs out"), "{}", killed.remedy());
        let ended = error_of(15).expect("a message");
        assert_eq!(ended.to_string(), "raycl's child process was ended by SIGTERM (signal 15)");
        assert!(ended.remedy().contains("ulimit -a"), "{}", ended.remedy());
        assert!(error_of(2).is_none() && error_of(2 << 8).is_none() && error_of(0).is_none());
    }

    #[test]
    fn a_process_that_a_signal_ended_has_128_plus_the_signal_as_exit_code() {
        let of_wait = |status| exit_code(ExitStatus::from_raw(status));
        // The status that the system call `wait` returns has the number of the signal in its low bits, and the exit
        // code above these bits.
        assert_eq!([of_wait(2), of_wait(15), of_wait(2 << 8), of_wait(0)], [130, 143, 2, 0]);
    }
}
