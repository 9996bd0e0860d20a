//! raycl works whatever it inherits from the process that started it: ignored signals, non-blocking streams, the
//! process ID of a container's first process. raycl's background processes close the files that they inherit from
//! their caller.

use crate::binary::{TRIANGLE, WorkFolder, device, finish, program, run, until};
use crate::view::Tmux;
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::process::{Pid, Signal, kill_process};
use std::io::{Read as _, Write as _};
use std::os::fd::AsFd;
use std::path::Path;
use std::process::{Command, Stdio};

/// Returns a command that runs in `folder`: the words `starter`, which start a program, followed by raycl and
/// its `arguments`.
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

/// A command that runs another command as the first process of a container. Without [`AS_USER`], only root
/// may run this `unshare`.
const CONTAINER: [&str; 5] = ["unshare", "--pid", "--fork", "--kill-child", "--mount-proc"];
/// Options with which users other than root can make containers, if the system lets them.
const AS_USER: [&str; 2] = ["--user", "--map-root-user"];

/// Returns a command that runs another command as the first process of a container. If the system makes no containers,
/// returns `None`, and prints that a test is left out and why.
fn container() -> Option<Vec<&'static str>> {
    let mut why = String::new();
    for options in [&AS_USER[..], &[]] {
        let starter = [&CONTAINER[..], options].concat();
        match Command::new(starter[0]).args(&starter[1..]).arg("true").output() {
            Ok(output) if output.status.success() => return Some(starter),
            Ok(output) => why = String::from_utf8_lossy(&output.stderr).trim_end().to_owned(),
            Err(error) => why = error.to_string(),
        }
    }
    // The line is not printed by `eprintln!`, since what a test prints in this way is hidden if the test passes.
    let _ = writeln!(
        std::io::stderr(),
        "left out: a test of tests/inherited.rs, since `unshare` cannot make a container here: {why}"
    );
    None
}

/// Sends a signal to the first process of the container that a process of `unshare` has made.
fn signal_in(unshare: u32, signal: Signal) {
    let children = std::fs::read_to_string(format!("/proc/{unshare}/task/{unshare}/children"));
    let raycl = children.expect("a list of processes").trim().parse().ok().and_then(Pid::from_raw);
    kill_process(raycl.expect("one process"), signal).expect("the process lives");
}

/// Starts a container, calls `wait`, sends the signal to the container's first process, and checks the exit
/// code. Returns what raycl wrote to standard error.
#[track_caller]
fn ends_with(signal: Signal, code: i32, mut command: Command, wait: impl Fn()) -> String {
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = command.spawn().expect("it starts");
    wait();
    signal_in(child.id(), signal);
    let output = finish(child);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{signal:?}: {said}");
    said.into_owned()
}

/// Of all signals except SIGKILL and SIGSTOP, a container's first process gets only those for which it has a handler.
#[test]
fn as_the_first_process_of_a_container_render_ends_with_the_signal_that_it_gets() {
    let Some(container) = container() else { return };
    let device = device();
    let render = [
        &["render", "scene.toml", "--turntable", "3000", "-o", "a.png", "--device", &device][..],
        &["--width", "64", "--height", "40", "--quiet"],
    ];
    for (signal, code) in [(Signal::TERM, 143), (Signal::INT, 130), (Signal::HUP, 129)] {
        let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
        let command = started_by(&container, &render.concat(), &folder);
        ends_with(signal, code, command, || {
            until("the first frame is written", || folder.path("a-0001.png").exists());
        });
    }
}

/// The code of a driver. The driver crashes the process that runs the user's command. After the crash, raycl
/// tries this driver alone, but the driver does not answer.
const HANGS_ALONE: &str =
    "if (getenv(\"RAYCL_GUARDED\")) abort(); if (symlink(\"/\", \"tried\")) abort(); for (;;) pause()";

#[test]
fn as_the_first_process_of_a_container_raycl_ends_with_a_signal_while_it_tries_drivers() {
    let Some(container) = container() else { return };
    let folder = WorkFolder::new();
    let vendors = crate::hostile::driver(&folder, HANGS_ALONE);
    let mut command = started_by(&container, &["devices"], &folder);
    command.env("OCL_ICD_VENDORS", vendors);
    ends_with(Signal::TERM, 143, command, || until("the driver is tried", || folder.path("tried").exists()));
}

/// The driver of this test crashes the first process that runs the user's command. When raycl tries the
/// driver alone, it works. In the second process that runs the command, the driver does not answer.
#[test]
fn as_the_first_process_of_a_container_raycl_ends_its_second_attempt_when_it_gets_a_signal() {
    let Some(container) = container() else { return };
    let folder = WorkFolder::new();
    let body = "if (!getenv(\"RAYCL_GUARDED\")) return; if (!getenv(\"RAYCL_COMPILE_AFRESH\")) abort(); \
                if (symlink(\"/\", \"again\")) abort(); for (;;) pause()";
    let vendors = crate::hostile::driver(&folder, body);
    let mut command = started_by(&container, &["devices"], &folder);
    // The command runs again only if raycl can use its cache.
    command.env("RAYCL_CACHE_MIB", "64").env("XDG_CACHE_HOME", folder.path("cache"));
    command.env("OCL_ICD_VENDORS", vendors);
    let again = || until("the command runs again", || folder.path("again").exists());
    let said = ends_with(Signal::TERM, 143, command, again);
    // raycl itself goes on until the child process has ended, and tells what ended the child process.
    assert!(said.contains("was ended by SIGTERM"), "{said}");
}

/// raycl has its own signal handlers while it lends its terminal to a child process, and later while it tries
/// each driver alone.
#[test]
fn as_the_first_process_of_a_container_a_view_in_a_terminal_ends_with_the_code_of_its_signal() {
    let Some(container) = container() else { return };
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let path = |name: &str| folder.path(name).display().to_string();
    let vendors = crate::hostile::driver(&folder, HANGS_ALONE).display().to_string();
    let (container, raycl) = (container.join(" "), env!("CARGO_BIN_EXE_raycl"));
    // A process in the background of a shell reads from the terminal only if its standard input is explicitly
    // the terminal.
    let command = format!(
        "cd '{}'; OCL_ICD_VENDORS='{vendors}' {container} '{raycl}' view scene.toml --terminal </dev/tty & \
         echo $! >process; wait $!; echo $? >code",
        path("")
    );
    let _tmux = Tmux::start(&folder, &command);
    until("the driver is tried", || folder.path("tried").exists());
    signal_in(folder.text("process").trim().parse().expect("the number of a process"), Signal::TERM);
    until("it has ended", || std::fs::read_to_string(path("code")).is_ok_and(|code| code.ends_with('\n')));
    assert_eq!(folder.text("code"), "143\n");
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
    // The test empties the pipe only after raycl has switched the full pipe to blocking writes, or has failed.
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
    // Without any input, the background process gets no valid task, so it ends.
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
