//! Tells the program which revision it is built from: RAYCL_GIT_REVISION, `-dirty` where tracked files differ. Outside a
//! git repository it is the one that cargo wrote into the package; without both it is not set. RAYCL_VERSION is what
//! `raycl -V` prints. And how it is built, which decides how fast casters on the host are: RAYCL_BUILD.

use std::process::Command;

fn main() {
    // A commit moves HEAD's log, staging and most commands touch the index. An edit touches neither, but changes
    // a file below, without which "dirty" would be noticed at the next commit only.
    for path in ["build.rs", "Cargo.toml", "Cargo.lock", "src", "cl"] {
        println!("cargo:rerun-if-changed={path}");
    }
    for name in ["HEAD", "index", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", name]).filter(|path| exists(path)) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    let revision = of_repository().or_else(of_package);
    if let Some(revision) = &revision {
        println!("cargo:rustc-env=RAYCL_GIT_REVISION={revision}");
    }
    println!("cargo:rustc-env=RAYCL_VERSION={}", version(revision.as_deref()));
    println!("cargo:rustc-env=RAYCL_BUILD={}", build());
}

/// The revision of the repository that this is. raycl unpacked inside somebody else's repository has none of its own.
fn of_repository() -> Option<String> {
    git(&["ls-files", "--error-unmatch", "Cargo.toml"])?;
    git(&["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"])
}

/// The revision that `cargo package` wrote into the package: `{"git": {"sha1": "...", "dirty": true}, ...}`.
fn of_package() -> Option<String> {
    let text = std::fs::read_to_string(".cargo_vcs_info.json").ok()?;
    let hash: String = text.split_once("\"sha1\": \"")?.1.chars().take(12).collect();
    let dirty = if text.contains("\"dirty\": true") { "-dirty" } else { "" };
    hash.chars().all(|c| c.is_ascii_hexdigit()).then(|| hash + dirty)
}

/// "0.1.0 (0123456789ab)", "0.1.0 (0123456789ab, with uncommitted changes)", or "0.1.0" of an unknown revision.
fn version(revision: Option<&str>) -> String {
    let number = std::env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let Some(revision) = revision else { return number };
    match revision.strip_suffix("-dirty") {
        Some(commit) => format!("{number} ({commit}, with uncommitted changes)"),
        None => format!("{number} ({revision})"),
    }
}

/// "profile release, opt-level 3, x86_64-unknown-linux-gnu, features fxsr,sse,sse2, flags -Ctarget-cpu=native, rustc 1.89.0": parts that
/// cargo does not tell are empty.
fn build() -> String {
    let told = |name: &str| std::env::var(name).unwrap_or_default();
    let rustc = Command::new(told("RUSTC")).arg("--version").output().map(|output| output.stdout);
    let rustc = rustc.map_or(String::new(), |text| String::from_utf8_lossy(&text).trim().to_owned());
    format!(
        "profile {}, opt-level {}, {}, features {}, flags {}, {rustc}",
        profile(&told("OUT_DIR")).unwrap_or(told("PROFILE")),
        told("OPT_LEVEL"),
        told("TARGET"),
        told("CARGO_CFG_TARGET_FEATURE"),
        told("CARGO_ENCODED_RUSTFLAGS").replace('\u{1f}', " "),
    )
}

/// The profile by its own name: PROFILE says "release" of all that inherit from it. OUT_DIR is target/PROFILE/build/raycl-HASH/out.
fn profile(out_dir: &str) -> Option<String> {
    let folder = std::path::Path::new(out_dir).ancestors().nth(3)?;
    Some(folder.file_name()?.to_str()?.to_owned())
}

/// A path that is not there would make cargo run this every time.
fn exists(path: &str) -> bool {
    std::path::Path::new(path).exists()
}

/// What git says, if there is git and it has something to say.
fn git(arguments: &[&str]) -> Option<String> {
    let output =
        Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    Some(text).filter(|text| !text.is_empty())
}
