//! The errors, with their remedies, for a child process that crashed, hung, was ended by a signal or could
//! not be run.

use crate::child::{crash, signal};
use crate::device::drivers::Driver;
use crate::device::folder_advice;
use crate::error::{Error, limit_advice};
use crate::memory::{address_space_limit, readable};
use crate::sources::{OWN_KERNELS, Sources};
use std::path::Path;
use std::process::ExitStatus;

/// The first remedy after a crash of a process that opens a window.
const WINDOW: &str = "if no window opened, the display or its libraries may be the cause: `--terminal` shows the scene in this terminal, without a window";
/// The remedy if SIGKILL ended the child process.
const OUT_OF_MEMORY: &str = "the system sends this signal if memory runs out (`dmesg` then says so): a smaller picture or scene needs less memory";
/// The remedy after a signal from outside the process other than SIGKILL and SIGINT, for example SIGTERM.
const FROM_OUTSIDE: &str =
    "another process sent this signal, or a limit was reached (`ulimit -a` shows the limits)";

/// Returns the error for a process that crashed while the folder `cl_dir` contained kernel files that the
/// user added or changed. Returns `None` if the process did not crash, if `cl_dir` is `None`, or if all
/// kernel files in the folder equal built-in files. The message names the first few added or changed files,
/// and the number of the others. A named file need not be part of the crashed program: this process does not
/// know which files the program includes. If `opens_window` is true, the library that opens the window may
/// have crashed instead of the kernels, so the remedy also names the window as a possible cause.
pub fn kernels_doing(status: ExitStatus, cl_dir: Option<&Path>, opens_window: bool) -> Option<Error> {
    let (signal, name) = crash(status)?;
    let suspects = Sources::Folder(cl_dir?.to_owned()).suspects()?;
    let error = Error::run(format!("raycl's child process crashed: {name} (signal {signal}); {suspects}"));
    Some(error.with_help(if opens_window { window_or(OWN_KERNELS) } else { OWN_KERNELS.to_owned() }))
}

/// Returns the error for drivers that list their devices when each driver is loaded alone, but fail when all
/// drivers are loaded together. `cause` says how the process ended.
pub fn not_together(cause: &str, drivers: &[Driver]) -> Error {
    let names: Vec<_> = drivers.iter().map(ToString::to_string).collect();
    Error::run(format!("{cause}: the drivers {} cannot be loaded together", names.join(", "))).with_help(
        "each driver lists its devices if it is loaded alone: set the environment variable OCL_ICD_VENDORS to a folder that contains the .icd file of one driver",
    )
}

/// Returns the error for a process that failed although each driver in `drivers` lists its devices when it is
/// loaded alone. `cause` says how the process ended. If the process crashed and `opens_window` is true, the
/// library that opens the window (the crate minifb) may have crashed: minifb frees memory twice on a display
/// whose pixels do not have 32 bits. raycl opens no window on a display if it knows that the display's pixels
/// do not have 32 bits, but raycl cannot ask every display.
pub fn no_driver_alone(status: ExitStatus, cause: &str, opens_window: bool, drivers: &[Driver]) -> Error {
    let advice = advice_for(drivers, folder_advice());
    match crash(status).filter(|_| opens_window) {
        Some((signal, name)) => Error::run(format!(
            "raycl's child process crashed, in its window or in a driver: {name} (signal {signal})"
        ))
        .with_help(window_or(&advice)),
        None => Error::run(format!("{cause}, although each driver alone lists its devices without failing"))
            .with_help(advice),
    }
}

/// Returns the error for a process that failed again, although it used only the drivers in `drivers`. Each
/// driver in `drivers` lists its devices when it is loaded alone, so raycl does not know which driver failed.
/// `cause` says how the process ended.
pub fn still_failing(status: ExitStatus, cause: &str, opens_window: bool, drivers: &[Driver]) -> Error {
    let advice = format!(
        "each of the other drivers lists its devices when it is loaded alone: {}",
        advice_for(drivers, folder_advice())
    );
    Error::run(format!("{cause}, even without the drivers that were left out"))
        .with_help(if opens_window && crash(status).is_some() { window_or(&advice) } else { advice })
}

/// Returns `error` with one more remedy: to remove the compiled programs from raycl's cache.
pub fn or_clear_cache(error: Error) -> Error {
    let remedies = format!(
        "{}; or remove the compiled programs from raycl's cache with `raycl cache clear`, since one of them may crash the \
         driver",
        error.remedy()
    );
    error.with_help(remedies)
}

/// Returns the remedies after a crash of a process that opens a window: first [`WINDOW`], which names the display as
/// the possible cause, then `advice`.
fn window_or(advice: &str) -> String {
    format!("{WINDOW}; if the window opened, {advice}")
}

/// Returns the advice for the user if each driver in `drivers` lists its devices when it is loaded alone. `full_disk`
/// is the advice about PoCL's folder for compiled kernels. `full_disk` is given if the folder's disk is full, or if the
/// disk is mounted with the option noexec (then no kernel in the folder can run). Only PoCL uses this folder, so the
/// advice is left out if PoCL is not among the drivers.
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
            "this process may use only {} of address space, which may be too little for a driver: remove the limit with `ulimit -v unlimited`; or {another}",
            readable(bytes)
        ),
        None => another.to_owned(),
    }
}

/// Returns an error that names the signal that ended the process. Returns `None` if no signal ended the
/// process, and after SIGINT, which comes from the user's Ctrl-C.
pub fn ended_by_signal(status: ExitStatus) -> Option<Error> {
    let (signal, name) = signal(status).filter(|(_, name)| *name != "SIGINT")?;
    let error = Error::run(format!("raycl's child process was ended by {name} (signal {signal})"));
    Some(error.with_help(if name == "SIGKILL" { OUT_OF_MEMORY } else { FROM_OUTSIDE }))
}

pub fn not_started(error: &std::io::Error) -> Error {
    Error::run(format!("the child process that runs the command could not be started: {error}")).with_help(
        limit_advice(error).unwrap_or(
            "check that raycl's executable can be read and run, and that `ulimit -u` allows more processes",
        ),
    )
}

#[cfg(unix)]
pub fn not_handled(error: impl std::fmt::Display) -> Error {
    Error::run(format!("raycl could not install handlers of signals such as SIGTERM: {error}"))
}

#[cfg(unix)]
pub fn not_awaited(error: impl std::fmt::Display) -> Error {
    Error::run(format!("raycl could not wait for the child process that runs the command: {error}"))
}

pub fn no_list(error: impl std::fmt::Display) -> Error {
    Error::run(format!("the list of drivers for the child process could not be written: {error}"))
        .with_help("free up space in the folder for temporary files, or set TMPDIR to another folder")
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::device::patience::HUNG;
    use std::os::unix::process::ExitStatusExt as _;

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
        let both = ["libnvidia-opencl.so.1", "libpocl.so.2"].map(|name| Driver::Library(name.into()));
        let advice_for_both = advice_for(&both, Some("the disk is full".into()));
        assert_eq!(advice_for_both, format!("the disk is full; or {other}"));
    }

    #[test]
    fn if_a_limit_prevents_the_child_process_the_remedy_names_this_limit() {
        use rustix::io::Errno;
        let remedy = |errno: Errno| {
            let error = std::io::Error::from_raw_os_error(errno.raw_os_error());
            not_started(&error).remedy().to_owned()
        };
        assert!(remedy(Errno::MFILE).contains("`ulimit -n 1024`"), "{}", remedy(Errno::MFILE));
        assert!(remedy(Errno::AGAIN).contains("`ulimit -u` allows more"), "{}", remedy(Errno::AGAIN));
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
        let message = "raycl's child process crashed: SIGSEGV (signal 11); the folder of --cl-dir has kernel files \
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
        // If the process ended because a driver did not answer, the process has not crashed, so there is no
        // error about a crash.
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
}
