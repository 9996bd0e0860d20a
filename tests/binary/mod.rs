//! Code that tests of the binary share: it runs the binary in a temporary folder, on the test device.

use assert_cmd::Command;
use image::{Rgb, RgbImage};
use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// The time limit of a process. Only a process that hangs reaches this limit, even on a slow and busy
/// machine.
pub const LIMIT: Duration = Duration::from_secs(600);

/// Waits until `so` returns true; fails after the time limit.
#[track_caller]
pub fn until(what: &str, mut so: impl FnMut() -> bool) {
    let start = Instant::now();
    while !so() {
        assert!(start.elapsed() < LIMIT, "waited {} s in vain until {what}", LIMIT.as_secs());
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Returns what a process printed until it ended. A process that hangs is killed, and the test fails.
#[track_caller]
pub fn finish(child: Child) -> Output {
    finish_within(LIMIT, child)
}

/// Returns what a process printed until it ended, like `finish`, but with another time limit.
#[track_caller]
pub fn finish_within(limit: Duration, child: Child) -> Output {
    let process = child.id();
    let (sender, ended) = channel();
    std::thread::spawn(move || sender.send(child.wait_with_output()));
    match ended.recv_timeout(limit) {
        Ok(output) => output.expect("the output of a process"),
        Err(_) => {
            kill(process);
            panic!("process {process} has not ended in {} s", limit.as_secs())
        }
    }
}

/// Runs a program to its end and returns what it printed.
#[track_caller]
pub fn run(command: &mut std::process::Command) -> Output {
    let command = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    finish(command.spawn().unwrap_or_else(|error| panic!("{command:?}: {error}")))
}

/// Copies a program, so that the copy can be started at once. A separate process writes the copy. If a thread
/// of this process wrote the copy, any process that another thread starts meanwhile would inherit the open
/// file, and Linux would refuse to start the copy ("Text file busy").
#[track_caller]
pub fn copy_program(from: &str, to: &Path) {
    let output = run(std::process::Command::new("cp").arg(from).arg(to));
    assert!(output.status.success(), "{output:?}");
}

/// Sends SIGINT, as Ctrl-C does.
#[cfg(unix)]
pub fn send_interrupt(process: u32) {
    use rustix::process::{Pid, Signal, kill_process};
    let process = Pid::from_raw(process as i32).expect("a process has a number");
    kill_process(process, Signal::INT).expect("the process lives");
}

#[cfg(unix)]
fn kill(process: u32) {
    use rustix::process::{Pid, Signal, kill_process};
    // If the process has ended meanwhile, the signal fails, which does no harm.
    let _ = Pid::from_raw(process as i32).map(|process| kill_process(process, Signal::KILL));
}

#[cfg(not(unix))]
fn kill(_: u32) {}

/// One triangle in front of the camera, under one light.
pub const TRIANGLE: &str = r#"name = "little"

[camera]
z_near = 0.1

[[light]]
position = [1, 3, 1]
power = 10

[[object]]
vertices = [[0, 1, -2], [-1.9, -1, -2], [1.6, -0.5, -2]]
faces = [[0, 1, 2]]
"#;

/// A config that measures `points` (lines of TOML) on the scene [`TRIANGLE`]. The scene must be stored under
/// the name scene.toml in the config's folder. One launch takes `samples` samples after `warmup` frames.
pub fn config(points: &str, warmup: u32, samples: u32) -> String {
    format!(
        "question = \"?\"\nexpectation = \"!\"\nscenes = [\"scene.toml\"]\n{points}\n[timing]\nlaunches = 1\n\
         warmup = {warmup}\nmin_samples = {samples}\nmax_samples = {samples}\n"
    )
}

/// Makes a folder with the scene and the config of one point, whose measurement takes almost no time.
pub fn one_point() -> WorkFolder {
    let points = "image_sizes = [[8, 5]]\nlocal_sizes = [4]\nstrategies = [\"deferred\"]\n";
    WorkFolder::with(&[("scene.toml", TRIANGLE), ("config.toml", &config(points, 0, 1))])
}

/// Returns a text that selects the device on which tests run: PoCL, or the device that RAYCL_TEST_DEVICE names.
pub fn device() -> String {
    std::env::var("RAYCL_TEST_DEVICE").unwrap_or_else(|_| "portable computing language".to_owned())
}

/// Returns the environment variable that turns off optimisation in PoCL's compiler; `None` for PoCL 7 and later.
/// Kernels that are wrong with optimisation are wrong without it, too, and their compilation takes two fifths less
/// time. PoCL 7.1 cannot load kernels that were compiled without optimisation, since their helper functions then still
/// call `get_global_id`.
pub fn without_optimisation() -> Option<(&'static str, &'static str)> {
    let driver = crate::common::device().info.driver;
    let major = driver.split('.').next().and_then(|number| number.parse::<u32>().ok());
    major.is_none_or(|major| major < 7).then_some(("POCL_EXTRA_BUILD_FLAGS", "-cl-opt-disable"))
}

/// Returns the full path of a file of the repository.
pub fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A folder in which raycl finds no settings, so that the settings of the machine's user do not affect tests.
pub const NO_SETTINGS: &str = concat!(env!("CARGO_TARGET_TMPDIR"), "/no-settings");

/// Returns a command that runs the binary without the user's settings.
pub fn program() -> std::process::Command {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_raycl"));
    command.env("XDG_CONFIG_HOME", NO_SETTINGS).env_remove("RAYCL_DEVICE").env_remove("RAYCL_RESULTS");
    // Normally, a run leaves out samples during which the host moved a virtual machine's processors to other
    // cores. The runs of raycl's tests keep such samples, so that the number of samples does not depend on
    // the machine.
    command.env("RAYCL_MOVED_SAMPLES", "keep");
    command
}

/// A folder that the binary runs in.
pub struct WorkFolder(tempfile::TempDir);

impl WorkFolder {
    /// Makes an empty folder.
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    /// Makes a folder with these files.
    pub fn with(files: &[(&str, &str)]) -> Self {
        let folder = Self::new();
        files.iter().for_each(|(name, text)| folder.write(name, text));
        folder
    }

    /// Writes a file, and makes the folders that it lies in.
    pub fn write(&self, name: &str, text: &str) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, text).unwrap_or_else(|error| panic!("{name}: {error}"));
    }

    /// Returns the path of a file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Returns the text of a file in the folder.
    pub fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Returns the lines of a file in the folder, each parsed as JSON.
    pub fn json_lines(&self, name: &str) -> Vec<serde_json::Value> {
        self.text(name).lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect()
    }

    /// Makes a folder for `--cl-dir` with one kernel file in which a part of the text is replaced. Returns the
    /// folder's name.
    pub fn kernels(&self, file: &str, from: &str, to: &str) -> String {
        self.kernels_of(&format!("cl/{file}"), file, from, to)
    }

    /// Like `kernels`, makes a folder with one kernel file in which `to` replaces `from`. The file's text
    /// comes from `of`, which may be any file of the repository. In the folder for `--cl-dir`, this file is
    /// named `file`.
    pub fn kernels_of(&self, of: &str, file: &str, from: &str, to: &str) -> String {
        let text = std::fs::read_to_string(repository(of)).expect("a kernel file");
        assert!(text.contains(from), "{of} no longer says {from}");
        self.write(&format!("kernels/{file}"), &text.replacen(from, to, 1));
        "kernels".to_owned()
    }

    /// Fails unless verification notices that a part of a kernel file was replaced: rendering `scene.toml` must
    /// report a wrong picture. The picture's width and height are prime numbers, so that tiles and blocks of rays
    /// extend beyond its edges.
    #[track_caller]
    pub fn notices(&self, change: (&str, &str, &str), strategy: &str, options: &[&str]) {
        self.notices_in(["61", "43"], change, strategy, options);
    }

    /// Fails unless verification notices a change of a kernel file, like `notices`, but in a picture of
    /// another width and height.
    #[track_caller]
    pub fn notices_in(
        &self,
        [width, height]: [&str; 2],
        (file, from, to): (&str, &str, &str),
        strategy: &str,
        options: &[&str],
    ) {
        let (kernels, device) = (self.kernels(file, from, to), device());
        let usual = ["render", "scene.toml", "--width", width, "--height", height, "--device", &device];
        let ends = ["-o", "wrong.png", "--force", "--quiet", "--strategy", strategy, "--cl-dir", &kernels];
        let mut command = self.raycl(&[&usual[..], &ends, options].concat());
        let output = command.envs(without_optimisation()).assert().code(1).get_output().clone();
        has(&String::from_utf8_lossy(&output.stderr), &["the picture is wrong: "]);
        // The folder of changed kernels is removed. If the folder stayed, the kernels of the next call would
        // contain the change of this call too, since the next call may change another file.
        std::fs::remove_dir_all(self.path(&kernels)).expect("the folder of kernels");
    }

    /// Renders `scene.toml` at 72 x 45 pixels, and returns the picture and the standard output.
    pub fn picture(&self, options: &[&str]) -> (RgbImage, String) {
        let device = device();
        let usual = ["render", "scene.toml", "--width", "72", "--height", "45", "--device", &device];
        let said = self.output(&[&usual, &["-o", "out.png", "--force"][..], options].concat());
        (image::open(self.path("out.png")).expect("a picture").to_rgb8(), said)
    }

    /// Returns a command that runs the binary in this folder.
    pub fn raycl(&self, arguments: &[&str]) -> Command {
        let mut command = Command::from_std(program());
        command.args(arguments).current_dir(self.0.path()).env("NO_COLOR", "1").timeout(LIMIT);
        // Each folder has its own subfolder for the locks of devices, so that tests do not wait for each other.
        command.env("RAYCL_LOCK_DIR", self.path(".locks"));
        // Tests must not depend on programs that other tests or versions have stored in the cache, so tests
        // use no cache. Tests that need the cache set a size above 0.
        command.env("RAYCL_CACHE_MIB", "0");
        command
    }

    /// Runs the binary with these arguments, checks that it succeeds, and returns its standard output.
    pub fn output(&self, arguments: &[&str]) -> String {
        let output = self.raycl(arguments).assert().success().get_output().clone();
        String::from_utf8(output.stdout).expect("UTF-8")
    }

    /// Runs the binary with these arguments, checks that it ends with this exit code and prints nothing to standard
    /// output, and returns its standard error.
    pub fn mistake(&self, arguments: &[&str], code: i32) -> String {
        let output = self.raycl(arguments).assert().code(code).get_output().clone();
        assert!(output.stdout.is_empty(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stdout));
        let message = String::from_utf8(output.stderr).expect("UTF-8");
        assert!(!message.contains("panicked"), "{message}");
        message
    }
}

/// Returns the number of pixels that differ in some channel by more than one step; rounding may cause a difference of
/// one step.
pub fn apart(a: &RgbImage, b: &RgbImage) -> usize {
    let apart = |(a, b): &(&Rgb<u8>, &Rgb<u8>)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 1);
    a.pixels().zip(b.pixels()).filter(apart).count()
}

/// Fails unless `text` contains all texts of `parts`, in any order.
#[track_caller]
pub fn has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part:?} is not in:\n{text}");
    }
}
