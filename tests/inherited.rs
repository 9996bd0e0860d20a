//! raycl works whatever it inherits from the process that started it: ignored signals, streams that do not wait, the
//! number of a container's first process. Its background processes leave the files of their caller.

use crate::binary::{TRIANGLE, WorkFolder, device, finish, program, run, until};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::process::{Pid, Signal, kill_process};
use std::io::{Read as _, Write as _};
use std::os::fd::AsFd;
use std::path::Path;
use std::process::{Command, Stdio};

/// Returns a command that lets the command line `starter` start raycl with these arguments, in the folder.
fn started_by(starter: &[&str], arguments: &[&str], folder: &WorkFolder) -> Command {
    let raycl = program();
    let mut command = Command::new(starter[0]);
    command.args(&starter[1..]).arg(raycl.get_program()).args(arguments).current_dir(folder.path(""));
    command.envs(raycl.get_envs().filter_map(|(name, value)| Some((name, value?))));
    command.env("NO_COLOR", "1").env("RAYCL_LOCK_DIR", folder.path(".locks")).env("RAYCL_CACHE_MIB", "0");
    command
}

#[test]
fn a_caller_that_ignores_sigchld_gets_exit_code_0() {
    let (folder, device) = (WorkFolder::with(&[("scene.toml", TRIANGLE)]), device());
    let render =
        ["render", "scene.toml", "--width", "16", "--height", "10", "-o", "a.png", "--device", &device];
    for arguments in [&render[..], &["devices"]] {
        let output = run(&mut started_by(&["env", "--ignore-signal=CHLD"], arguments, &folder));
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    assert!(folder.path("a.png").exists());
}

/// A command that runs another command as the first process of a container.
const CONTAINER: [&str; 7] =
    ["unshare", "--user", "--map-root-user", "--pid", "--fork", "--kill-child", "--mount-proc"];

/// Returns true if this machine lets `unshare` make a container. Otherwise, says that a test is left out.
fn makes_containers() -> bool {
    let is_allowed = Command::new(CONTAINER[0]).args(&CONTAINER[1..]).arg("true").status();
    let is_allowed = is_allowed.is_ok_and(|status| status.success());
    if !is_allowed {
        eprintln!("left out: this machine does not let `unshare` make a container");
    }
    is_allowed
}

/// Starts a container, waits by `wait`, sends the signal to the container's first process, and checks the exit code.
#[track_caller]
fn ends_with(signal: Signal, code: i32, mut command: Command, wait: impl Fn()) {
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = command.spawn().expect("it starts");
    wait();
    let children = format!("/proc/{0}/task/{0}/children", child.id());
    let children = std::fs::read_to_string(children).expect("a list of processes");
    let raycl = children.trim().parse().ok().and_then(Pid::from_raw).expect("one process");
    kill_process(raycl, signal).expect("the process lives");
    let output = finish(child);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{signal:?}: {said}");
}

/// The system gives the first process of a container only signals for which it has a handler.
#[test]
fn as_the_first_process_of_a_container_render_ends_with_the_signal_that_it_gets() {
    if !makes_containers() {
        return;
    }
    let device = device();
    let render = [
        &["render", "scene.toml", "--turntable", "3000", "-o", "a.png", "--device", &device][..],
        &["--width", "64", "--height", "40", "--quiet"],
    ];
    for (signal, code) in [(Signal::TERM, 143), (Signal::INT, 130), (Signal::HUP, 129)] {
        let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
        let command = started_by(&CONTAINER, &render.concat(), &folder);
        ends_with(signal, code, command, || {
            until("the first frame is written", || folder.path("a-0001.png").exists());
        });
    }
}

/// The driver of this test crashes the process that runs the command. When raycl then tries the driver alone, it does
/// not answer.
#[test]
fn as_the_first_process_of_a_container_raycl_ends_with_a_signal_while_it_tries_drivers() {
    if !makes_containers() {
        return;
    }
    let folder = WorkFolder::new();
    let body =
        "if (getenv(\"RAYCL_GUARDED\")) abort(); if (symlink(\"/\", \"tried\")) abort(); for (;;) pause()";
    let vendors = crate::hostile::driver(&folder, body);
    let mut command = started_by(&CONTAINER, &["devices"], &folder);
    command.env("OCL_ICD_VENDORS", vendors);
    ends_with(Signal::TERM, 143, command, || until("the driver is tried", || folder.path("tried").exists()));
}

fn flags(stream: impl AsFd) -> OFlags {
    fcntl_getfl(stream).expect("the flags")
}

#[test]
fn streams_that_do_not_wait_are_made_to_wait() {
    let (input, _writer_of_input) = std::io::pipe().expect("a pipe");
    let (mut output, mut full) = std::io::pipe().expect("a pipe");
    fcntl_setfl(&input, flags(&input) | OFlags::NONBLOCK).expect("a flag");
    fcntl_setfl(&full, flags(&full) | OFlags::NONBLOCK).expect("a flag");
    while full.write(&[b' '; 4096]).is_ok_and(|written| written > 0) {}
    let [stdin, stdout] = [
        Stdio::from(input.try_clone().expect("the same pipe")),
        Stdio::from(full.try_clone().expect("the same pipe")),
    ];
    let mut child = program().arg("strategies").stdin(stdin).stdout(stdout).spawn().expect("raycl starts");
    // Only after raycl has begun to wait for space, or has failed, is the pipe emptied.
    until("raycl waits for space", || {
        !flags(&full).contains(OFlags::NONBLOCK) || child.try_wait().expect("a status").is_some()
    });
    drop(full);
    let mut text = String::new();
    output.read_to_string(&mut text).expect("text");
    assert!(child.wait().expect("a status").success(), "{text}");
    assert!(text.contains("deferred"), "{text}");
    assert!(!flags(&input).contains(OFlags::NONBLOCK), "standard input does not wait");
}

/// Returns the command that starts a background process, which reads its task from standard input.
fn background(starter: &[&str], folder: &WorkFolder) -> Command {
    let mut command = started_by(starter, &["worker", "--keep"], folder);
    command.env("RAYCL_WORKER", "1").stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

#[test]
fn a_background_process_closes_the_files_of_its_caller() {
    let folder = WorkFolder::new();
    let mut command = background(&["sh", "-c", "exec \"$@\" 7</dev/zero", "sh"], &folder);
    let mut child = command.spawn().expect("it starts");
    let process = child.id();
    let open = |number: u8| std::fs::read_link(format!("/proc/{process}/fd/{number}"));
    until("standard output is replaced", || open(1).is_ok_and(|file| file == Path::new("/dev/null")));
    assert!(open(7).is_err(), "the file of the caller is still open");
    // A task that ends at once is not valid, so the process ends.
    drop(child.stdin.take());
    finish(child);
}

#[test]
fn a_background_process_does_not_make_a_removed_cache_again() {
    let folder = WorkFolder::new();
    let mut command = background(&["env"], &folder);
    command.env("RAYCL_CACHE_MIB", "64").env("XDG_CACHE_HOME", folder.path("removed"));
    let mut child = command.env("POCL_CACHE_DIR", folder.path("kernels")).spawn().expect("it starts");
    let task = r#"{"device":"none","lanes":"barriers","program":null,"recompile":false}"#;
    let mut input = child.stdin.take().expect("standard input");
    input.write_all(task.as_bytes()).expect("the process reads its task");
    drop(input);
    let output = finish(child);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(!folder.path("removed").exists() && !folder.path("kernels").exists(), "a folder was made again");
}
