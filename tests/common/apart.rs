//! Runs a test in a separate process.

use crate::binary::finish_within;
use std::process::{Command, Stdio};
use std::time::Duration;

/// The environment variable that is set in a process that runs a single test.
pub const MARK: &str = "RAYCL_TEST_APART";
/// The time limit of a test. Only a test that hangs reaches this limit, although a test may build a hundred
/// programs on a slow and busy machine.
const LIMIT: Duration = Duration::from_secs(3600);

/// The first line of a test that runs in a separate process. Within one process, PoCL compiles one kernel at
/// a time, so that tests of many kernels would leave all cores but one idle. If a driver crashes, only the
/// test in which the driver crashed fails.
macro_rules! apart {
    () => {
        fn here() {}
        if $crate::common::apart::has_run(std::any::type_name_of_val(&here)) {
            return;
        }
    };
}
pub(crate) use apart;

/// Starts this program again for the calling test alone, and returns true if the test passed there. In the
/// new process, this function returns false, so that the test runs there. `here` is the path of a function
/// inside the test, such as `all::kernels::presets::here`.
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
    // The program also succeeds if no test has this name, so the number of passed tests is checked too.
    let passed = output.status.success() && said.contains("test result: ok. 1 passed");
    assert!(passed, "{name} ended with {}:\n{said}\n{complained}", output.status);
    true
}
