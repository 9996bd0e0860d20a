//! Drivers that fail: a small library in C, which is loaded before OpenCL's loader (`LD_PRELOAD`), replaces
//! functions of OpenCL.

use crate::binary::{WorkFolder, device, has, one_point, run};
use crate::examples::example;
use assert_cmd::Command;
use std::path::PathBuf;

/// A status that the crate `ocl` does not know: CL_COMMAND_TERMINATED_ITSELF_WITH_FAILURE_ARM.
const UNKNOWN: &str = "returned the unknown status -1108";

/// Compiles a library from these functions in C.
fn library(folder: &WorkFolder, functions: &str) -> PathBuf {
    let [source, library] = ["fault.c", "fault.so"].map(|name| folder.path(name));
    let includes = "#define _GNU_SOURCE\n#include <dlfcn.h>\n#include <fcntl.h>\n#include <stdlib.h>\n#include <string.h>\n";
    std::fs::write(&source, format!("{includes}{functions}\n")).expect("a source");
    let mut compiler = std::process::Command::new("cc");
    let built = run(compiler.args(["-w", "-shared", "-fPIC", "-o"]).args([&library, &source]).arg("-ldl"));
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    library
}

/// Returns a command that runs in a folder with the scene scene.toml and the config config.toml. In the
/// command's process, the C code `functions` replaces functions of OpenCL.
fn with_faults(functions: &str, arguments: &[&str]) -> (WorkFolder, Command) {
    let folder = one_point();
    let library = library(&folder, functions);
    let mut command = folder.raycl(arguments);
    command.env("LD_PRELOAD", library);
    (folder, command)
}

/// Checks that `render` ends with exit code 1 if the C code `functions` replaces functions of OpenCL. Returns
/// the message of `render`.
#[track_caller]
fn refused(functions: &str) -> String {
    let device = device();
    let picture =
        ["render", "scene.toml", "-o", "a.png", "--width", "8", "--height", "5", "--device", &device];
    let (folder, mut command) = with_faults(functions, &picture);
    let output = command.assert().code(1).get_output().clone();
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    assert!(!said.contains("panicked") && !folder.path("a.png").exists(), "{said}");
    has(&said, &["help: "]);
    said
}

#[test]
fn a_status_that_the_crate_ocl_does_not_know_is_an_error_like_others() {
    has(&refused("int clFinish() { return -1108; }"), &[UNKNOWN, "the OpenCL driver failed, on "]);
}

/// The example `cast` is a program that uses raycl as a library. The `main` of `cast` returns the error, so the error's
/// message is broken into several lines.
#[test]
fn a_program_that_uses_the_library_gets_a_failure_of_the_driver_as_an_error() {
    let folder = one_point();
    let library = library(&folder, "int clEnqueueNDRangeKernel() { return -1108; }");
    let mut command = example(&folder, "cast", &["scene.toml", "a.png", &device()]);
    let output = run(command.env("LD_PRELOAD", library));
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(1), "{said}");
    let words: Vec<&str> = said.split_whitespace().filter(|word| !["│", "|"].contains(word)).collect();
    has(&words.join(" "), &["the OpenCL driver failed, on ", UNKNOWN, "try again, or open another device"]);
    assert!(!said.contains("panicked") && !folder.path("a.png").exists(), "{said}");
}

#[test]
fn after_a_breakdown_the_first_error_is_reported_although_nothing_can_be_freed() {
    let finish = "static int broken;\nint clFinish() { broken = 1; return -36; }\n";
    let release = |name: &str| {
        format!(
            "int {name}(void *object) {{
                 int (*next)(void *) = dlsym(RTLD_NEXT, \"{name}\");
                 return broken ? -36 : next(object);
             }}\n"
        )
    };
    let all = ["MemObject", "Kernel", "Program", "Event", "CommandQueue", "Context"];
    let all = all.map(|object| release(&format!("clRelease{object}"))).concat();
    let said = refused(&format!("{finish}{all}"));
    has(&said, &["clFinish returned CL_INVALID_COMMAND_QUEUE (-36)", "after that, clRelease"]);
}

#[test]
fn a_device_that_breaks_down_in_a_run_fails_its_points_with_the_status() {
    let device = device();
    let arguments = ["run", "config.toml", "--out", "out", "--device", &device, "--quiet"];
    let (folder, mut command) = with_faults("int clEnqueueNDRangeKernel() { return -1108; }", &arguments);
    command.assert().code(1);
    let records = folder.json_lines("out/records.jsonl");
    assert_eq!(records.len(), 1);
    assert_eq!(records[0]["outcome"], "launch-failed", "{}", records[0]);
    has(records[0]["reason"].as_str().expect("a reason"), &[UNKNOWN]);
}

/// Returns a function in C that replaces OpenCL's function for a program's build log. The log is `text`, a
/// string literal in C.
fn build_log(text: &str) -> String {
    format!(
        "int clGetProgramBuildInfo(void *p, void *d, unsigned what, size_t size, void *value, size_t *needed) {{
             static const char text[] = {text};
             if (needed) *needed = sizeof text;
             if (value) memcpy(value, text, sizeof text);
             return 0;
         }}
         int clBuildProgram() {{ return -11; }}"
    )
}

#[test]
fn a_failed_build_says_what_the_compiler_said_or_that_it_said_nothing() {
    let failed = "the build of the kernels failed: ";
    has(&refused(&build_log("\"\"")), &[failed, "the compiler rejects the program without a message"]);
    has(&refused(&build_log("\"a.cl:1: \\xe9\"")), &[failed, "a.cl:1: \u{fffd}"]);
    let said = refused("int clBuildProgram() { return -6; }");
    has(&said, &[failed, "clBuildProgram returned CL_OUT_OF_HOST_MEMORY (-6)", "a smaller picture or scene"]);
    assert!(!said.contains("khronos"), "{said}");
}

#[test]
fn a_driver_that_fails_to_list_its_devices_is_not_to_be_installed() {
    let functions = "int clGetDeviceIDs() { return -6; }";
    let status = "clGetDeviceIDs returned CL_OUT_OF_HOST_MEMORY (-6)";
    let said = refused(functions);
    has(&said, &["no OpenCL device was found", status, "a driver is installed, but could not list"]);
    let (_folder, mut command) = with_faults(functions, &["devices"]);
    let output = command.assert().success().get_output().clone();
    has(&String::from_utf8_lossy(&output.stdout), &["could not be listed: ", status]);
}

#[test]
fn a_device_whose_version_cannot_be_read_is_unusable() {
    let functions =
        "int clGetDeviceInfo(void *device, unsigned what, size_t size, void *value, size_t *needed) {
        static const char text[] = \"garbage\\nx\";
        int (*next)(void *, unsigned, size_t, void *, size_t *) = dlsym(RTLD_NEXT, \"clGetDeviceInfo\");
        if (what != 0x102F) return next(device, what, size, value, needed);
        if (needed) *needed = sizeof text;
        if (value) memcpy(value, text, sizeof text);
        return 0;
    }";
    let (_folder, mut command) = with_faults(functions, &["devices"]);
    let output = command.assert().success().get_output().clone();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    has(&text, &["(unusable)", "its version of OpenCL cannot be read: 'garbage x'", "can be used."]);
}

#[test]
fn a_local_size_that_raycl_chose_becomes_smaller_if_the_kernel_supports_fewer_work_items() {
    let functions = "int clGetKernelWorkGroupInfo(void *kernel, void *device, unsigned what, size_t size,
            void *value, size_t *needed) {
        int (*next)(void *, void *, unsigned, size_t, void *, size_t *) =
            dlsym(RTLD_NEXT, \"clGetKernelWorkGroupInfo\");
        int status = next(kernel, device, what, size, value, needed);
        if (what == 0x11B0 && value) *(size_t *)value = 2;
        return status;
    }";
    let device = device();
    let usual = ["render", "scene.toml", "-o", "a.png", "--width", "8", "--height", "5", "--device", &device];
    let naive = ["--strategy", "naive"];
    let (folder, mut command) = with_faults(functions, &[&usual[..], &naive].concat());
    command.assert().success();
    assert!(folder.path("a.png").is_file());
    let requested = ["--local-size", "4"];
    let (_folder, mut command) = with_faults(functions, &[&usual[..], &naive, &requested].concat());
    let output = command.assert().code(2).get_output().clone();
    has(&String::from_utf8_lossy(&output.stderr), &["supports at most 2", "choose another --local-size"]);
}

/// A function in C with which the driver crashes when it loads a stored program. The function first writes
/// the file `crashed`, which shows that the function was called.
const CRASHING: &str = "void *clCreateProgramWithBinary() { creat(\"crashed\", 0600); abort(); }";

/// Runs a command with `arguments`, after `raycl run` has stored the program that the command needs. The
/// driver crashes when it loads the stored program. The C code `faults` replaces further functions of OpenCL.
/// The command must end with the exit code `code`. Returns the command's folder, and the text that the
/// command printed.
#[track_caller]
fn with_a_bad_stored_program(faults: &str, code: i32, arguments: &[&str]) -> (WorkFolder, String) {
    let device = device();
    let functions = format!("{CRASHING}\n{faults}");
    let (folder, mut crashing) = with_faults(&functions, &[arguments, &["--device", &device]].concat());
    let mut storing =
        folder.raycl(&["run", "config.toml", "--out", "stored", "--device", &device, "--quiet"]);
    for command in [&mut storing, &mut crashing] {
        command.env("RAYCL_CACHE_MIB", "64").env("XDG_CACHE_HOME", folder.path("cache"));
    }
    storing.assert().success();
    let said = String::from_utf8(crashing.assert().code(code).get_output().stderr.clone()).expect("UTF-8");
    assert!(folder.path("crashed").exists(), "no stored program was loaded: {said}");
    (folder, said)
}

#[test]
fn a_run_compiles_a_stored_program_that_crashes_the_driver_again() {
    let (folder, _) = with_a_bad_stored_program("", 0, &["run", "config.toml", "--out", "out", "--quiet"]);
    let records = folder.json_lines("out/records.jsonl");
    assert_eq!(records[0]["outcome"], "measured", "{}", records[0]);
}

/// The arguments that cast a picture with the stored program.
const PICTURE: [&str; 12] = [
    "render",
    "scene.toml",
    "-o",
    "a.png",
    "--width",
    "8",
    "--height",
    "5",
    "--strategy",
    "deferred",
    "--local-size",
    "4",
];

#[test]
fn a_picture_is_cast_again_without_a_stored_program_that_crashes_the_driver() {
    let (folder, said) = with_a_bad_stored_program("", 0, &PICTURE);
    has(&said, &["note: ", "a compiled program in raycl's cache may be the cause"]);
    assert!(folder.path("a.png").is_file());
}

#[test]
fn frames_for_an_encoder_are_not_cast_again_after_a_crash() {
    let stream = [&PICTURE[..3], &["-", "--turntable", "2"], &PICTURE[4..]].concat();
    let (_folder, said) = with_a_bad_stored_program("", 1, &stream);
    has(&said, &["each driver alone", "`raycl cache clear`"]);
    assert!(!said.contains("runs again"), "{said}");
}

#[test]
fn if_the_second_attempt_fails_without_a_crash_its_message_is_the_last_one() {
    let faults = "int clFinish(void *queue) {
        int (*next)(void *) = dlsym(RTLD_NEXT, \"clFinish\");
        return getenv(\"RAYCL_COMPILE_AFRESH\") ? -1108 : next(queue);
    }";
    let (_folder, said) = with_a_bad_stored_program(faults, 1, &PICTURE);
    has(&said, &["note: ", UNKNOWN]);
    assert!(!said.contains("each driver alone"), "{said}");
}
