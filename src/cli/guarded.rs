//! Protects commands from OpenCL drivers that crash, or that hang while they list their devices. A command that starts
//! drivers does its work in a child process. If a driver seems to have ended the child process, raycl loads each driver
//! alone, to find the drivers that fail. raycl then starts the work again without these drivers.

mod allocator;
mod ending;
mod errors;
#[cfg(unix)]
mod signals;
#[cfg(unix)]
mod terminal;

use crate::cache::Cache;
use crate::child::{crash, signal};
use crate::device::drivers::{Driver, crash_advice, installed, only};
use crate::device::patience::{GUARDED, HUNG};
use crate::error::{Error, Result};
use crate::experiment::why_devices_are_not_listed;
use crate::own_program::own_program;
use crate::printer;
use crate::program::AFRESH;
use crate::threads::cores;
use allocator::{ALLOCATOR, allocator_settings};
use ending::{drivers_doing, exit_code};
use errors::{
    ended_by_signal, kernels_doing, no_driver_alone, no_list, not_together, or_clear_cache, still_failing,
};
#[cfg(unix)]
use signals::Parent;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitStatus;

/// The number of the first process of a system or a container. Unlike other processes, the first process is not ended
/// by a signal, such as SIGTERM, for which it has no handler.
const FIRST_PROCESS: u32 = 1;

/// The remedy if a command that reads its scene from standard input cannot run again.
const SCENE_AS_FILE: &str = "give the scene as a file instead of `-`; raycl can then restart the command itself, \
    without the drivers that fail";
/// The remedy if a command that writes frames to standard output cannot run again.
const FRAMES_AS_FILES: &str = "set the environment variable OCL_ICD_VENDORS to a folder that contains only the .icd \
    files of the other drivers; or let `raycl render` write its frames to files (`-o NAME.png`): raycl can then \
    restart the command itself, without the drivers that fail";

/// Returns true if this process is the child process that [`run`] starts.
pub fn is_inside() -> bool {
    std::env::var_os(GUARDED).is_some()
}

/// The properties of a command that decide how it runs in a child process, and what may have crashed the
/// child process.
pub struct Guarded<'a> {
    /// True if the command reads standard input. A command that reads standard input cannot run again, since
    /// standard input can be read only once.
    pub reads_standard_input: bool,
    /// True if the command writes frames to standard output, one by one. Such a command cannot run again, since the
    /// reader of the frames would get the frames of both runs in one stream.
    pub streams: bool,
    /// True if the command loads compiled programs from raycl's cache. If the command does not, no stored program can
    /// have crashed the command, which therefore need not run again without the stored programs.
    pub loads_stored_programs: bool,
    /// The scene file of `raycl render` and `raycl view`; `None` for other commands. With a scene file, the allocator
    /// of the child process gets its own settings ([`allocator_settings`]), unless the user has set `GLIBC_TUNABLES`.
    /// Commands that only measure run without these settings, as the worker processes of `raycl run` do.
    pub shown_scene: Option<&'a Path>,
    /// Where the command shows pictures while it runs.
    pub screen: Screen,
    /// The folder of the user's kernel files, if the command uses one. If the child process crashes, a
    /// mistake in the user's kernel files is a more likely cause than a mistake in a driver.
    pub cl_dir: Option<&'a Path>,
}

/// Where a command shows pictures while it runs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Screen {
    /// The command shows no pictures while it runs. (Only `raycl view` shows pictures while it runs.)
    None,
    /// The command shows its pictures in the terminal (`raycl view --terminal`). On Unix, the terminal is
    /// restored after the child process has ended in any way, if standard input and standard output are a
    /// terminal.
    Terminal,
    /// The command shows its pictures in a window (`raycl view` without `--terminal`).
    Window,
}

impl Guarded<'_> {
    fn opens_window(&self) -> bool {
        self.screen == Screen::Window
    }

    /// Returns why the command cannot run a second time, and the remedy; `None` if it can.
    fn runs_once(&self) -> Option<[&'static str; 2]> {
        if self.reads_standard_input {
            return Some(["standard input cannot be read again", SCENE_AS_FILE]);
        }
        self.streams.then_some(["frames may have been written to standard output already", FRAMES_AS_FILES])
    }

    /// Returns true if the command may run a second time, with the same drivers, after a crash that seems to be a
    /// driver's. `raycl view` may not run a second time, for two reasons: the window may have crashed instead of the
    /// driver, and if the user has seen the view end, the view must not begin again by itself. A command that loads no
    /// stored programs may not run a second time either, since it would only crash again.
    fn may_run_again(&self) -> bool {
        self.runs_once().is_none() && self.screen == Screen::None && self.loads_stored_programs
    }
}

/// Runs this process's command line in a child process; `command` describes this command line. If a driver seems to
/// have ended the child process, raycl runs the command line again, in a second child process without the drivers that
/// fail. If no driver fails when it is loaded alone, raycl may run the command line again without the compiled programs
/// in its cache ([`with_all_drivers`]). If the exit code of the last child process is 0, returns. Otherwise, ends this
/// process with this exit code.
///
/// # Errors
///
/// Fails if a driver seems to have ended the child process, and the command cannot run again, for example because every
/// driver fails. Also fails if the command runs again in a second child process, and a driver seems to have ended the
/// second child process too.
pub fn run(command: &Guarded<'_>) -> Result<()> {
    let settings = allocator(command.shown_scene, std::env::var_os(ALLOCATOR).is_some(), cores());
    let allocator = settings.map(|settings| (ALLOCATOR, settings.into()));
    let parent = Parent::new(command.screen)?;
    let status = attempt(allocator.as_slice(), &parent)?;
    if drivers_doing(status).is_none() {
        return end_as(status);
    }
    end_as(without_broken(status, command, &parent)?)
}

/// Returns the settings of the allocator for a command that shows `scene`; `None` if the command shows no scene, or if
/// the user has chosen the settings.
fn allocator(scene: Option<&Path>, has_own: bool, processors: usize) -> Option<String> {
    let scene = scene.filter(|_| !has_own)?;
    // A scene without a length, such as standard input, counts as small.
    let bytes = scene.metadata().map_or(0, |metadata| metadata.len());
    Some(allocator_settings(processors, bytes))
}

/// Loads each driver alone. If some drivers fail, runs the command again without these drivers. If no driver fails,
/// continues with [`with_all_drivers`]. Returns an error if every driver fails, if the command cannot run again, or if
/// a driver seems to have ended the second attempt too. Otherwise, returns the exit status of the second attempt.
/// `status` is the exit status of the first attempt.
fn without_broken(status: ExitStatus, command: &Guarded<'_>, parent: &Parent) -> Result<ExitStatus> {
    let mut good = Vec::new();
    let mut broken = Vec::new();
    for driver in installed() {
        match why_broken(&driver)? {
            None => good.push(driver),
            Some(why) => broken.push((driver, why)),
        }
    }
    if broken.is_empty() {
        return with_all_drivers(status, command, parent, &good);
    }
    let cause = drivers_doing(status).unwrap_or_default();
    // A process that writes frames to a stream ends with `HUNG` only while it waits for a driver before the first
    // frame, so the stream is still empty.
    let stream_is_empty = !command.reads_standard_input && status.code() == Some(HUNG);
    let runs_once = command.runs_once().filter(|_| !stream_is_empty);
    let what = if runs_once.is_some() { "fails" } else { "is left out of the drivers that raycl loads" };
    for (driver, why) in &broken {
        printer::tell(format!("note: the driver {driver} {what}: {why}"));
    }
    if good.is_empty() {
        return Err(Error::run(format!("{cause}, and no other driver is left")).with_help(crash_advice(0)));
    }
    if let Some([why, remedy]) = runs_once {
        return Err(Error::run(format!("{cause}, and {why}")).with_help(remedy));
    }
    let folder = tempfile::tempdir().map_err(no_list)?;
    let status = attempt(&only(&good, folder.path()).map_err(no_list)?, parent)?;
    let opens_window = command.opens_window();
    match drivers_doing(status) {
        None => Ok(status),
        Some(cause) => Err(kernels_doing(status, command.cl_dir, opens_window)
            .unwrap_or_else(|| still_failing(status, &cause, opens_window, &good))),
    }
}

/// Continues after an attempt that a driver seems to have ended, if it is unknown which driver failed: each driver in
/// `drivers` lists its devices without failing if only this driver is loaded. If the first attempt crashed, this
/// function may run the command a second time, without the compiled programs in raycl's cache ([`ended_afresh`]).
/// Returns the exit status of the second attempt. `status` is the exit status of the first attempt.
///
/// # Errors
///
/// Fails if this function does not run the command a second time, or if a driver seems to have ended the second
/// attempt, too. The error names the probable cause.
fn with_all_drivers(
    status: ExitStatus,
    command: &Guarded<'_>,
    parent: &Parent,
    drivers: &[Driver],
) -> Result<ExitStatus> {
    let cause = drivers_doing(status).unwrap_or_default();
    let opens_window = command.opens_window();
    if drivers.len() > 1 && why_devices_are_not_listed(&[])?.is_some() {
        return Err(not_together(&cause, drivers));
    }
    if let Some(error) = kernels_doing(status, command.cl_dir, opens_window) {
        return Err(error);
    }
    if command.may_run_again()
        && crash(status).is_some()
        && let Some(status) = ended_afresh(&cause, parent)?
    {
        return Ok(status);
    }
    let error = no_driver_alone(status, &cause, opens_window, drivers);
    let loads_stored = command.loads_stored_programs && Cache::of_user().is_usable();
    let may_be_cache = loads_stored && !command.may_run_again() && crash(status).is_some();
    Err(if may_be_cache { or_clear_cache(error) } else { error })
}

/// Runs the command again in a new child process. The new process compiles the programs that it needs, and removes the
/// stored versions of these programs from raycl's cache, since a stored program may have crashed the driver. Returns
/// the exit status of the new process, or `None` if a driver seems to have ended the new process, too. If raycl cannot
/// use the cache, returns `None` without running the command. `cause` says how the first process ended.
fn ended_afresh(cause: &str, parent: &Parent) -> Result<Option<ExitStatus>> {
    if !Cache::of_user().is_usable() {
        return Ok(None);
    }
    printer::tell(format!(
        "note: {cause}; a compiled program in raycl's cache may be the cause: raycl removes this program, and runs the command again"
    ));
    let status = attempt(&[(AFRESH, "1".into())], parent)?;
    Ok(drivers_doing(status).is_none().then_some(status))
}

/// Runs the command line of this process once, in a child process that also has the environment variables
/// `variables`. Returns the exit status of the child process. If `parent` lends its terminal (for `raycl view
/// --terminal`), the terminal is restored after the child process has ended.
fn attempt(variables: &[(&str, OsString)], parent: &Parent) -> Result<ExitStatus> {
    let mut command = own_program()?;
    let own_number = std::process::id().to_string();
    command.args(std::env::args_os().skip(1)).env(GUARDED, own_number).envs(variables.iter().cloned());
    parent.run(&mut command)
}

/// Returns why a driver that is loaded alone cannot list its devices; `None` if it can list them.
fn why_broken(driver: &Driver) -> Result<Option<String>> {
    let folder = tempfile::tempdir().map_err(no_list)?;
    let alone = only(std::slice::from_ref(driver), folder.path()).map_err(no_list)?;
    why_devices_are_not_listed(&alone)
}

/// This process, which runs the command in child processes. On systems other than Unix, this process has no
/// handlers of signals and restores no terminal.
#[cfg(not(unix))]
struct Parent;

#[cfg(not(unix))]
impl Parent {
    fn new(_: Screen) -> Result<Self> {
        Ok(Self)
    }

    fn run(&self, command: &mut std::process::Command) -> Result<ExitStatus> {
        command.status().map_err(|error| errors::not_started(&error))
    }
}

/// Ends this process with the [`exit_code`] of another process, or returns if that code is 0. If a signal other than
/// SIGINT ended the other process, first prints an error that names the signal. If SIGINT (Ctrl-C) ended the other
/// process, SIGINT ends this process too, so that a shell that runs a script ends the script. (SIGINT cannot end a
/// container's first process, which ends with the exit code 130 instead.) If this function ends the process, no
/// destructor runs, so the caller must have removed its temporary folders.
fn end_as(status: ExitStatus) -> Result<()> {
    // The shell sees only how this process ends, not how the child process ended. Therefore only this process can tell
    // the user which signal ended the child process.
    if let Some(error) = ended_by_signal(status) {
        printer::tell(format!("{:?}", miette::Report::new(error)));
    }
    if ends_with_sigint(status, std::process::id()) {
        // If this process cannot end itself with SIGINT, its exit code still contains the signal's number.
        let _ = signal_hook::low_level::emulate_default_handler(signal_hook::consts::SIGINT);
    }
    match exit_code(status) {
        0 => Ok(()),
        code => std::process::exit(code),
    }
}

/// Returns true if the process with the number `own` must end itself with SIGINT, because SIGINT ended the
/// child process with the exit status `status`.
fn ends_with_sigint(status: ExitStatus, own: u32) -> bool {
    own != FIRST_PROCESS && signal(status).is_some_and(|(_, name)| name == "SIGINT")
}

/// Makes the system end this process when its parent process ends. If the parent has ended already, ends this
/// process at once.
#[cfg(target_os = "linux")]
pub fn ends_with_its_parent() {
    use rustix::process::{Signal, set_parent_process_death_signal};
    // If the system cannot send a signal at the parent's end, this process continues after its parent has
    // ended.
    let _ = set_parent_process_death_signal(Some(Signal::TERM));
    if is_orphan(std::env::var(GUARDED).ok().as_deref(), std::os::unix::process::parent_id()) {
        std::process::exit(1);
    }
}

/// Returns true if the process that started this one has ended; false if no process of raycl started this one.
/// `guarded` is the value of the variable [`GUARDED`]: the number of the process that started this one. `parent` is the
/// number of the present parent process.
#[cfg(target_os = "linux")]
fn is_orphan(guarded: Option<&str>, parent: u32) -> bool {
    guarded.and_then(|number| number.parse::<u32>().ok()).is_some_and(|number| number != parent)
}

/// Does nothing on systems other than Linux: there, this process continues after its parent has ended.
#[cfg(not(target_os = "linux"))]
pub fn ends_with_its_parent() {}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_process_whose_parent_is_not_the_one_that_started_it_is_an_orphan() {
        assert!(is_orphan(Some("7"), 1) && !is_orphan(Some("7"), 7));
        assert!(!is_orphan(None, 1) && !is_orphan(Some("yes"), 1));
    }

    #[test]
    fn the_allocator_is_set_for_the_scene_that_is_shown_unless_the_user_has_set_it() {
        let file = tempfile::NamedTempFile::new().expect("a file");
        assert_eq!(allocator(Some(file.path()), false, 3), Some(allocator_settings(3, 0)));
        assert_eq!(allocator(Some(Path::new("-")), false, 3), Some(allocator_settings(3, 0)));
        assert_eq!(allocator(Some(file.path()), true, 3), None);
        assert_eq!(allocator(None, false, 3), None);
        // The file gets its length without being written, so its bytes take no space on the disk.
        let large = 1 << 30;
        file.as_file().set_len(large).expect("a file with a hole");
        assert_eq!(allocator(Some(file.path()), false, 3), Some(allocator_settings(3, large)));
        assert_ne!(allocator_settings(3, large), allocator_settings(3, 0));
    }

    #[test]
    fn a_command_runs_again_only_if_its_input_and_output_are_not_used_up() {
        let usual = || Guarded {
            reads_standard_input: false,
            streams: false,
            loads_stored_programs: true,
            shown_scene: None,
            screen: Screen::None,
            cl_dir: None,
        };
        let again = |command: Guarded<'_>| (command.runs_once().is_none(), command.may_run_again());
        let command = |reads_standard_input, streams, screen| {
            again(Guarded { reads_standard_input, streams, screen, ..usual() })
        };
        assert_eq!(command(false, false, Screen::None), (true, true));
        assert_eq!(command(true, false, Screen::None), (false, false));
        assert_eq!(command(false, true, Screen::None), (false, false));
        for screen in [Screen::Terminal, Screen::Window] {
            assert_eq!(command(false, false, screen), (true, false));
        }
        // Without the drivers that fail, a command may run again even if it loads no stored programs.
        assert_eq!(again(Guarded { loads_stored_programs: false, ..usual() }), (true, false));
    }

    #[test]
    fn only_sigint_ends_this_process_too_and_never_the_first_process_of_a_container() {
        use std::os::unix::process::ExitStatusExt as _;
        // The status that the system call `wait` returns has the number of the signal in its low bits, and the exit
        // code above these bits.
        let ends = |status: i32, own: u32| ends_with_sigint(ExitStatus::from_raw(status), own);
        let (sigint, sigterm, code_2) = (2, 15, 2 << 8);
        assert!(ends(sigint, 7) && !ends(sigint, FIRST_PROCESS));
        assert!(!ends(sigterm, 7) && !ends(code_2, 7) && !ends(0, 7));
    }
}
