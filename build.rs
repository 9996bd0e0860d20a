//! Tells the program which revision it is built from: RAYCL_GIT_REVISION, `-dirty` where tracked files differ. Outside a
//! git repository, or without git, it is not set. And how it is built, which decides how fast casters on the host are: RAYCL_BUILD.

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
    // raycl unpacked inside somebody else's repository has no revision of its own.
    let tracked = git(&["ls-files", "--error-unmatch", "Cargo.toml"]).is_some();
    if let Some(revision) =
        git(&["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]).filter(|_| tracked)
    {
        println!("cargo:rustc-env=RAYCL_GIT_REVISION={revision}");
    }
    println!("cargo:rustc-env=RAYCL_BUILD={}", build());
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
