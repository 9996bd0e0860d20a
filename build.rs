//! Sets environment variables that the compiler builds into the program. RAYCL_GIT_REVISION is the revision
//! of the sources, with `-dirty` if tracked files have changed. In a package, it is the revision that cargo
//! wrote into the package; in a folder that is neither a package nor raycl's own git repository, it is not
//! set. `raycl -V` prints RAYCL_VERSION. RAYCL_BUILD describes the compiler and its options, which decide how
//! fast casters on the host are.

use std::path::Path;
use std::process::Command;

/// The files and folders from which the program is built. The program embeds the kernels of cl/, the scenes of scenes/
/// and some files of configs/.
pub(crate) const SOURCES: [&str; 7] =
    ["build.rs", "Cargo.toml", "Cargo.lock", "src", "cl", "configs", "scenes"];

fn main() {
    // Cargo runs this program in the folder of Cargo.toml.
    let folder = Path::new(".");
    // Cargo runs this program again if one of these files changes. A commit changes HEAD's log; staging and
    // most git commands change the index. An edit changes neither, so the sources are included: otherwise
    // `-dirty` would only be set at the next commit.
    for path in SOURCES {
        println!("cargo:rerun-if-changed={path}");
    }
    for name in ["HEAD", "index", "logs/HEAD"] {
        if let Some(path) = git(folder, &["rev-parse", "--git-path", name]).filter(|path| exists(path)) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    let revision = revision(folder);
    if let Some(revision) = &revision {
        println!("cargo:rustc-env=RAYCL_GIT_REVISION={revision}");
    }
    println!("cargo:rustc-env=RAYCL_VERSION={}", version(revision.as_deref()));
    println!("cargo:rustc-env=RAYCL_BUILD={}", build());
}

/// Returns the revision of the sources in a folder. The package's own revision comes first, because another
/// project's repository can contain the package, and then tracks its files.
pub(crate) fn revision(folder: &Path) -> Option<String> {
    of_package(folder).or_else(|| of_repository(folder))
}

/// Returns the revision that `cargo package` wrote into the package:
/// `{"git": {"sha1": "...", "dirty": true}, ...}`.
fn of_package(folder: &Path) -> Option<String> {
    let text = std::fs::read_to_string(folder.join(".cargo_vcs_info.json")).ok()?;
    let hash: String = text.split_once("\"sha1\": \"")?.1.chars().take(12).collect();
    let dirty = if text.contains("\"dirty\": true") { "-dirty" } else { "" };
    hash.chars().all(|c| c.is_ascii_hexdigit()).then(|| hash + dirty)
}

/// Returns the revision of raycl's repository; `None` if raycl was unpacked inside another repository: then
/// raycl's folder is not the repository's uppermost one, or the repository does not track raycl's files.
fn of_repository(folder: &Path) -> Option<String> {
    let top = git(folder, &["rev-parse", "--show-toplevel"])?;
    if Path::new(&top).canonicalize().ok()? != folder.canonicalize().ok()? {
        return None;
    }
    git(folder, &["ls-files", "--error-unmatch", "Cargo.toml"])?;
    let head = git(folder, &["rev-parse", "--short=12", "HEAD"])?;
    let changes = git(folder, &["status", "--porcelain", "--untracked-files=no"]);
    Some(if changes.is_some() { head + "-dirty" } else { head })
}

/// Returns the version for users: "0.1.0 (0123456789ab)", "0.1.0 (0123456789ab, with uncommitted changes)",
/// or "0.1.0" if the revision is unknown.
fn version(revision: Option<&str>) -> String {
    let number = std::env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let Some(revision) = revision else { return number };
    match revision.strip_suffix("-dirty") {
        Some(commit) => format!("{number} ({commit}, with uncommitted changes)"),
        None => format!("{number} ({revision})"),
    }
}

/// Returns the profile, target, options and compiler of this build: "profile release, opt-level 3,
/// x86_64-unknown-linux-gnu, features fxsr,sse,sse2, flags -Ctarget-cpu=native, rustc 1.90.0". Parts that
/// cargo does not report are empty.
fn build() -> String {
    let variable = |name: &str| std::env::var(name).unwrap_or_default();
    let rustc = Command::new(variable("RUSTC")).arg("--version").output().map(|output| output.stdout);
    let rustc = rustc.map_or(String::new(), |text| String::from_utf8_lossy(&text).trim().to_owned());
    format!(
        "profile {}, opt-level {}, {}, features {}, flags {}, {rustc}",
        profile(&variable("OUT_DIR")).unwrap_or(variable("PROFILE")),
        variable("OPT_LEVEL"),
        variable("TARGET"),
        variable("CARGO_CFG_TARGET_FEATURE"),
        variable("CARGO_ENCODED_RUSTFLAGS").replace('\u{1f}', " "),
    )
}

/// Returns the profile's own name, which is part of OUT_DIR: target/PROFILE/build/raycl-HASH/out. (The
/// variable PROFILE is "release" for every profile that inherits from `release`.)
fn profile(out_dir: &str) -> Option<String> {
    let folder = Path::new(out_dir).ancestors().nth(3)?;
    Some(folder.file_name()?.to_str()?.to_owned())
}

/// Returns whether a path exists. If a path given to cargo did not exist, cargo would run this program every
/// time.
fn exists(path: &str) -> bool {
    Path::new(path).exists()
}

/// Returns the output of a git command in a folder; `None` if git is not installed, the command fails, or it
/// prints nothing.
fn git(folder: &Path, arguments: &[&str]) -> Option<String> {
    // Without this variable, `git status` may write the index, so that cargo would compile raycl again.
    let mut command = Command::new("git");
    command.env("GIT_OPTIONAL_LOCKS", "0").arg("-C").arg(folder).args(arguments);
    let output = command.output().ok()?;
    if !output.status.success() {
        return None;
    }
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    Some(text).filter(|text| !text.is_empty())
}
