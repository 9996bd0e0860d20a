//! Turns panics of the crate `ocl` into errors of a command, or of a call of the library. The crate `ocl` panics if
//! OpenCL returns a status that the crate does not know, and if an OpenCL object cannot be freed. After a driver has
//! broken down, no OpenCL object can be freed. Without this module, the panic when an object is freed would hide the
//! error that broke the driver, and a second panic would abort the process.

use super::DeviceInfo;
use super::errors::{EXECUTING, without_frame};
use crate::error::Error;
use crate::printer;
use crate::threads::locked;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, resume_unwind, set_hook, take_hook};
use std::sync::{Mutex, MutexGuard, Once, OnceLock};

/// The advice to a user if a driver breaks down in a program that uses raycl as a library.
const BROKEN_IN_LIBRARY: &str = "the driver, or its device, may be broken: try again, or open another device (`raycl devices` lists all devices)";
/// The advice to a user if a driver breaks down in a command of raycl.
const BROKEN: &str = "the driver, or its device, may be broken: run the command again; `raycl devices` lists all devices, and --device chooses one";

/// The data that this process keeps for the error message in case its OpenCL driver breaks down.
struct Known {
    /// The devices that this process has opened.
    devices: Vec<String>,
    /// The latest error that OpenCL returned; `None` if OpenCL returned no error, or if this process has handled the
    /// latest error and gone on.
    failure: Option<String>,
}

static KNOWN: Mutex<Known> = Mutex::new(Known { devices: Vec::new(), failure: None });
/// The function that this process calls with the error's text before a panic of the crate `ocl` ends the
/// process. In a worker process, the function passes the text to the run that waits for the worker. In a
/// process that shows pictures in a terminal, the function restores the terminal before the text is printed.
static TOLD: OnceLock<fn(&str)> = OnceLock::new();

thread_local! {
    /// The message of a panic that [`caught`] catches in this thread. The outer `Option` is `None` while the
    /// thread does not run `caught`, and the inner `Option` is `None` before the panic.
    static CAUGHT: RefCell<Option<Option<String>>> = const { RefCell::new(None) };
}

/// Lets a panic of the crate `ocl` end this process with a message and the exit code of a run that failed. The process
/// ends at once, without freeing OpenCL objects. Panics outside the crate `ocl` are handled as usual. A panic that
/// `caught` catches does not end the process.
pub fn report_panics() {
    let usual = take_hook();
    set_hook(Box::new(move |panic: &PanicHookInfo<'_>| match of_ocl(panic) {
        Some(message) if is_caught(&message) => {}
        Some(message) => end(&message),
        None => usual(panic),
    }));
}

/// Calls `work` for a program that uses raycl as a library.
///
/// # Errors
///
/// Fails if the crate `ocl` panics in `work`. Panics outside the crate `ocl` propagate to the caller. While
/// a panic unwinds, the freeing of an OpenCL object may cause a second panic. Rust then aborts the
/// process; raycl cannot prevent the abort. If the program has replaced the panic hook that the first call of
/// this function sets, panics of the crate `ocl` propagate to the caller, too.
pub(crate) fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, Error> {
    hide_caught_panics();
    forget_failures();
    caught(work).map_err(|message| Error::run(reason(&message, &known())).with_help(BROKEN_IN_LIBRARY))
}

/// Sets a panic hook that stores the message of a panic of the crate `ocl` if [`caught`] catches this panic.
/// All other panics reach the hook that the program has set before. Further calls do not set the hook again.
fn hide_caught_panics() {
    static SET: Once = Once::new();
    // `set_hook` panics if the calling thread is panicking.
    if std::thread::panicking() {
        return;
    }
    SET.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |panic: &PanicHookInfo<'_>| {
            let is_hidden = of_ocl(panic).is_some_and(|message| is_caught(&message));
            if !is_hidden {
                usual(panic);
            }
        }));
    });
}

/// Sets the function that is called with the error's text before a panic of the crate `ocl` ends this
/// process.
pub(crate) fn tell_panics(told: fn(&str)) {
    // A second call would have no effect, but a process calls this function only once.
    let _ = TOLD.set(told);
}

/// Remembers that this process uses a device, for the error message if the driver breaks down.
pub(crate) fn note_device(info: &DeviceInfo) {
    let name = format!("{} ({}, driver {})", info.common_name(), info.platform, info.driver);
    let mut known = known();
    if !known.devices.contains(&name) {
        known.devices.push(name);
    }
}

/// Stores the latest error that OpenCL returned. If the crate `ocl` panics later, the message about the panic names
/// this error as the failure that came first.
pub(crate) fn note_failure(message: &str) {
    known().failure = Some(message.to_owned());
}

/// Stores an error of the crate `ocl` as the latest OpenCL error, and returns the error. Functions that own
/// buffers call `noted` before they return an error: their buffers are freed before a caller could store the
/// error, and freeing a buffer may panic.
pub(crate) fn noted<E: std::fmt::Display>(error: E) -> E {
    note_failure(&without_frame(&error.to_string()));
    error
}

/// Forgets the latest OpenCL error. Callers call this function when they have handled the error and go on, so
/// that messages about later panics do not name this error as the cause.
pub(crate) fn forget_failures() {
    known().failure = None;
}

fn known() -> MutexGuard<'static, Known> {
    locked(&KNOWN)
}

/// Calls `work`. Returns the message of a panic of the crate `ocl` as an error, if [`report_panics`] or
/// [`guarded`] was called before. Panics of other code propagate to the caller. `work` may itself call
/// `caught`.
pub(super) fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    let outer = CAUGHT.replace(Some(None));
    let result = catch_unwind(AssertUnwindSafe(work));
    let message = CAUGHT.replace(outer).flatten();
    result.map_err(|panic| message.unwrap_or_else(|| resume_unwind(panic)))
}

/// Stores the message of a panic, and returns true, if [`caught`] catches the panic. Returns false outside `caught`,
/// and for a second panic inside `caught`. The second panic happens while the first panic unwinds and OpenCL objects
/// are freed. After the second panic, the process ends: the hook of [`report_panics`] ends it, or Rust aborts it.
fn is_caught(message: &str) -> bool {
    CAUGHT.with_borrow_mut(|caught| match caught {
        Some(first @ None) => {
            *first = Some(message.to_owned());
            true
        }
        _ => false,
    })
}

/// Returns the message of a panic of the crate `ocl`; `None` for panics of other code.
fn of_ocl(panic: &PanicHookInfo<'_>) -> Option<String> {
    let payload = panic.payload();
    let text = payload.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or_default();
    is_in_ocl(panic.location()?.file()).then(|| meaning(text))
}

/// Returns true if a source file belongs to the crate `ocl` or to one of its parts. The folder that contains
/// `src` is named after the crate, usually with the crate's version.
fn is_in_ocl(file: &str) -> bool {
    let parts: Vec<&str> = file.split(['/', '\\']).collect();
    let src = parts.iter().rposition(|part| *part == "src");
    let folder = src.and_then(|src| parts.get(src.checked_sub(1)?)).copied().unwrap_or_default();
    ["ocl", "ocl-core"].contains(&folder) || folder.starts_with("ocl-core-") || folder.starts_with("ocl-0.")
}

/// Returns what a panic's message says about the driver.
fn meaning(text: &str) -> String {
    let unknown = text.split_once("Invalid error code: '").and_then(|(_, rest)| rest.split_once('\''));
    match (unknown, text.find(EXECUTING)) {
        (Some((status, _)), _) => format!("a function of OpenCL returned the unknown status {status}"),
        (None, Some(start)) => without_frame(&text[start..]),
        _ if text.contains("`None` value") => "a function of OpenCL returned an unknown status".to_owned(),
        _ => format!("the crate `ocl` stopped: {}", text.lines().next().unwrap_or_default()),
    }
}

/// Returns the text of the error for the user: the devices that this process has opened, the latest error that OpenCL
/// returned, and the panic that followed.
fn reason(message: &str, Known { devices, failure }: &Known) -> String {
    let first = failure.as_ref().map(|failure| format!("{failure}; after that, ")).unwrap_or_default();
    let used = if devices.is_empty() { String::new() } else { format!(", on {}", devices.join(" or ")) };
    format!("the OpenCL driver failed{used}: {first}{message}")
}

/// Ends this process with a message. No destructor runs, since freeing OpenCL objects would make the crate
/// `ocl` panic again.
fn end(message: &str) -> ! {
    let error = Error::run(reason(message, &known())).with_help(BROKEN);
    if let Some(told) = TOLD.get() {
        told(&error.to_string());
    }
    let code = i32::from(error.exit_code());
    // If standard error is closed, the message is lost.
    printer::tell(format!("{:?}", miette::Report::new(error)));
    signal_hook::low_level::exit(code)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panics_of_the_crate_ocl_are_told_from_others_by_their_file() {
        for file in [
            "/root/.cargo/registry/src/index.crates.io-1949cf8c6b5b557f/ocl-core-0.11.5/src/types/abs.rs",
            "/a/registry/src/x/ocl-0.19.7/src/standard/queue.rs",
            "C:\\a\\ocl-core-0.11.5\\src\\functions.rs",
            "vendor/ocl/src/lib.rs",
        ] {
            assert!(is_in_ocl(file), "{file}");
        }
        for file in ["src/device/panics.rs", "/a/ocl-0.19.7/x/rayon-1.12.0/src/lib.rs", "src/lib.rs", ""] {
            assert!(!is_in_ocl(file), "{file}");
        }
    }

    #[test]
    fn a_panics_message_is_the_function_and_its_status_as_far_as_they_are_known() {
        let unknown = "ocl_core::Error::err_status: Invalid error code: '-1108'. Aborting.";
        assert_eq!(meaning(unknown), "a function of OpenCL returned the unknown status -1108");
        let dropped = "called `Result::unwrap()` on an `Err` value: Api(\n\n#### OPENCL ERROR ####\n\n\
            Error executing function: clReleaseEvent  \n\nStatus error code: CL_OUT_OF_RESOURCES (-5)  \n\n####)";
        assert_eq!(meaning(dropped), "clReleaseEvent returned CL_OUT_OF_RESOURCES (-5)");
        let none = "called `Option::unwrap()` on a `None` value";
        assert_eq!(meaning(none), "a function of OpenCL returned an unknown status");
        assert_eq!(meaning("a text\nb"), "the crate `ocl` stopped: a text");
    }

    #[test]
    fn the_reason_begins_with_the_error_that_broke_the_driver() {
        let known = Known { devices: vec!["gpu".into()], failure: Some("clFinish returned -36".into()) };
        let expected = "the OpenCL driver failed, on gpu: clFinish returned -36; after that, clX returned -5";
        assert_eq!(reason("clX returned -5", &known), expected);
        let nothing = Known { devices: Vec::new(), failure: None };
        assert_eq!(reason("clX returned -5", &nothing), "the OpenCL driver failed: clX returned -5");
    }

    #[test]
    fn only_the_first_panic_is_caught() {
        assert!(!is_caught("a"), "nothing is to be caught");
        let inside = caught(|| [is_caught("b"), is_caught("c")]);
        assert_eq!(inside, Ok([true, false]));
        assert!(!is_caught("d"), "nothing is to be caught any more");
    }

    #[test]
    fn after_an_inner_call_the_outer_one_still_catches() {
        let inside = caught(|| (caught(|| is_caught("a")), is_caught("b")));
        assert_eq!(inside, Ok((Ok(true), true)));
    }

    #[test]
    fn the_library_passes_results_and_other_panics_on() {
        assert_eq!(guarded(|| 7).ok(), Some(7));
        let other = catch_unwind(|| guarded(|| -> u32 { panic!("of somebody else") }));
        assert!(other.is_err(), "only panics of the crate `ocl` are errors");
    }

    #[test]
    fn an_error_after_which_the_work_went_on_is_forgotten() {
        let message = "clX returned -5, in a test";
        assert_eq!(noted(message), message);
        forget_failures();
        // Another test may store its own error at the same time.
        let failure = known().failure.clone();
        assert_ne!(failure.as_deref(), Some(message));
    }

    #[test]
    fn the_library_forgets_the_errors_of_earlier_calls() {
        let message = "clX returned -6, before a call";
        assert_eq!(noted(message), message);
        let failure = guarded(|| known().failure.clone()).expect("no panic");
        assert_ne!(failure.as_deref(), Some(message));
    }
}
