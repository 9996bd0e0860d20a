//! A test in a process of its own.

use crate::binary::finish_within;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Set in the process that runs one test.
const MARK: &str = "RAYCL_TEST_APART";
/// Only a test that hangs takes this long: a test builds up to a hundred programs, even on a slow machine with other
/// work.
const LIMIT: Duration = Duration::from_secs(3600);

/// The first line of a test that runs in a process of its own. PoCL compiles one kernel at a time in a process, so
/// that tests which compile many would leave all cores but one idle. If a driver crashes, only the test in which it
/// crashed fails.
macro_rules! apart {
    () => {
        fn here() {}
        if $crate::common::apart::has_run(std::any::type_name_of_val(&here)) {
            return;
        }
    };
}
pub(crate) use apart;

/// Starts this program again for the calling test alone, and returns true if the test passed there. In that second
/// process, returns false, so that the test runs. The test is the function around `here`:
/// `all::kernels::presets::here`.
#[track_caller]
pub fn has_run(here: &str) -> bool {
    if std::env::var_os(MARK).is_some() {
        return false;
    }
    let path = here.trim_end_matches("::here");
    let (_, name) = path.split_once("::").expect("a path within this program");
    let program = std::env::current_exe().expect("the path of this program");
    let mut command = Command::new(program);
    command.args([name, "--exact", "--nocapture"]).env(MARK, "1");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let output = finish_within(LIMIT, command.spawn().expect("this program starts"));
    let (said, complained) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    // If no test has this name, the program succeeds too, so the number of passed tests is checked.
    let passed = output.status.success() && said.contains("test result: ok. 1 passed");
    assert!(passed, "{name} ended with {}:\n{said}\n{complained}", output.status);
    true
}
