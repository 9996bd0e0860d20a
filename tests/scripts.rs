//! The scripts that install programs. In these tests, functions of bash take the place of programs that would
//! change the machine or need the network: a function that is exported replaces the program of its name in
//! each script that bash starts. With such functions, the tests also run the scripts that make the notes of
//! releases and the book (raycl's documents as HTML pages).

use crate::binary::{WorkFolder, has, repository, run};
use std::process::{Command, Output};

/// Runs lines of bash in the folder. `$REPOSITORY` is the repository's folder.
fn bash(folder: &WorkFolder, lines: &str) -> Output {
    let mut command = Command::new("bash");
    command.args(["-euc", lines]).current_dir(folder.path("")).env("REPOSITORY", env!("CARGO_MANIFEST_DIR"));
    run(&mut command)
}

/// Runs lines of bash that must succeed, and returns what they print to standard output.
#[track_caller]
fn succeeds(folder: &WorkFolder, lines: &str) -> String {
    let output = bash(folder, lines);
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Runs lines of bash that must fail, and returns what they print to standard error.
#[track_caller]
fn fails(folder: &WorkFolder, lines: &str) -> String {
    let output = bash(folder, lines);
    assert!(!output.status.success(), "{output:?}");
    String::from_utf8(output.stderr).expect("UTF-8")
}

/// In German, apt-cache prints "Installationskandidat" instead of "Candidate".
#[test]
fn packages_are_known_in_every_language() {
    let lines = r#"
        unset LC_ALL
        apt-cache() { if [ "${LC_ALL-}" = C ]; then echo "  Candidate: 1.0"; else echo "  Installationskandidat: 1.0"; fi; }
        eval "$(grep '^knows()' "$REPOSITORY/.ci/setup")"
        knows oclgrind"#;
    succeeds(&WorkFolder::new(), lines);
}

#[test]
fn a_missing_folder_for_temporary_files_is_named() {
    let lines = r#"
        cargo() { :; }
        sudo() { false; }
        export -f cargo sudo
        TMPDIR=$PWD/nowhere "$REPOSITORY/.ci/setup""#;
    has(&fails(&WorkFolder::new(), lines), &["/nowhere/"]);
}

/// Returns lines of bash that start `.ci/setup --test` as a user who is not root. The system lacks only Oclgrind, and
/// its apt knows no package of Oclgrind. An attempt to install Debian 12's package of Oclgrind fails.
fn setup_without_oclgrind(sudo: &str) -> String {
    format!(
        r#"
        mkdir bin temporary
        for program in cat chmod env grep mkdir mktemp rm; do ln -s "$(command -v $program)" bin; done
        printf '#!/bin/sh\ncase "$*" in *oclgrind*) exit 100; esac\n' >bin/apt-get
        chmod +x bin/apt-get
        for program in cargo cc tmux Xvfb; do eval "$program() {{ :; }}; export -f $program"; done
        ldconfig() {{ echo libOpenCL.so.1 libX11.so.6 libXcursor.so.1; }}
        grep() {{ [ "${{2-}}" = pocl ] || command grep "$@"; }}
        apt-cache() {{ [ "$2" = oclgrind ] || echo "Candidate: 1"; }}
        id() {{ echo 1000; }}
        {sudo}
        export -f ldconfig grep apt-cache id
        PATH=$PWD/bin TMPDIR=$PWD/temporary "$BASH" "$REPOSITORY/.ci/setup" --test"#
    )
}

#[test]
fn without_root_and_a_package_of_oclgrind_no_package_is_advised() {
    let said = fails(&WorkFolder::new(), &setup_without_oclgrind(""));
    has(&said, &["Oclgrind is missing", "as root", "  .ci/setup --test\n"]);
    assert!(!said.contains("apt-get install"), "{said}");
}

/// apt stores files that belong to root in the temporary folder. The script therefore removes this folder as root, even
/// if apt fails.
#[test]
fn the_list_of_another_systems_packages_is_removed() {
    let folder = WorkFolder::new();
    let sudo = "sudo() { echo \"sudo $*\" >>log; \"$@\"; }; export -f sudo";
    fails(&folder, &setup_without_oclgrind(sudo));
    let log = std::fs::read_to_string(folder.path("log")).expect("what was done as root");
    has(&log, &["apt-get -qy -o Dir::Etc::SourceList=", " oclgrind\n", "sudo rm -rf "]);
    let left = std::fs::read_dir(folder.path("temporary")).expect("the temporary folder");
    assert_eq!(left.count(), 0);
}

/// `PATH=/none` hides the programs of this machine, which may include Slurm.
#[test]
fn slurm_is_installed_as_root_and_without_questions() {
    let folder = WorkFolder::new();
    let install = r#"
        id() { echo 1000; }
        export -f id
        PATH=/none "$BASH" "$REPOSITORY/tests/slurm/setup""#;
    let said = succeeds(&folder, &format!("sudo() {{ echo \"sudo $*\"; }}; export -f sudo; {install}"));
    has(&said, &["sudo env DEBIAN_FRONTEND=noninteractive apt-get -q install ", " slurm-wlm "]);
    has(&fails(&folder, install), &["Install them as root"]);
}

/// In this test, two programs take the place of Python. The program that always fails stands for a Python without pip;
/// the program that always succeeds stands for a complete Python.
#[test]
fn an_unfinished_virtual_environment_is_made_again() {
    for script in [r#"python/run" "$PWD/made""#, r#"mitsuba/run" . "$PWD/made""#] {
        let lines = r#"
            mkdir -p made/venv/bin
            program() { printf '#!/bin/sh\nexit %s\n' "$1" >"$2"; chmod +x "$2"; }
            program 1 made/venv/bin/python
            python3() { program 0 "$4/bin/python"; }
            export -f program python3
            "$REPOSITORY/tests/"#;
        succeeds(&WorkFolder::new(), &format!("{lines}{script}"));
    }
}

#[test]
fn intels_runtime_is_not_installed_without_its_library() {
    let folder = WorkFolder::new();
    let lines = r#"
        mkdir .ci
        cp "$REPOSITORY/.ci/test-intel" .ci
        python3() { mkdir -p "$3/bin"; printf '#!/bin/sh\n' >"$3/bin/pip"; chmod +x "$3/bin/pip"; }
        cargo() { :; }
        export -f python3 cargo
        INTEL_VERSION=1.0 .ci/test-intel"#;
    has(&fails(&folder, lines), &["1.0", "libintelocl.so"]);
    assert!(!folder.path("target/intel-opencl/installed-1.0").exists());
}

#[test]
fn a_packaged_rust_is_not_copied_to_a_bare_system() {
    let require = |sysroot: &str| {
        format!(
            r#"
            id() {{ echo 0; }}
            debootstrap() {{ :; }}
            rustc() {{ echo {sysroot}; }}
            eval "$(sed -n '/^require()/,/^}}/p' "$REPOSITORY/.ci/bare")"
            require"#
        )
    };
    has(&fails(&WorkFolder::new(), &require("/usr")), &["rustup"]);
    succeeds(&WorkFolder::new(), &require("/root/.rustup/toolchains/stable"));
}

#[test]
fn fuzzing_names_a_missing_compiler() {
    let lines = r#"
        unset CXX
        dirname() { echo "$PWD"; }
        cargo-fuzz() { :; }
        export -f dirname cargo-fuzz
        PATH=/none "$BASH" "$REPOSITORY/.ci/fuzz""#;
    has(&fails(&WorkFolder::new(), lines), &["a C++ compiler (c++) is missing"]);
}

#[test]
fn a_release_has_only_its_own_notes() {
    let folder = WorkFolder::with(&[
        ("Cargo.toml", "[package]\nrust-version = \"1.90\"\nversion = \"0.2.0\"\n"),
        ("CHANGELOG.md", "# Changelog\n\n## 0.2.0 - 2026-12-24\n\n- new\n\n## 0.1.0\n\n- old\n"),
    ]);
    let notes = |tag: &str| format!("mkdir -p .ci; cp \"$REPOSITORY/.ci/notes\" .ci; .ci/notes {tag}");
    assert_eq!(succeeds(&folder, &notes("v0.2.0")), "## 0.2.0 - 2026-12-24\n\n- new\n");
    has(&fails(&folder, &notes("v0.1.0")), &["the tag is v0.1.0", "expected the tag v0.2.0"]);
    folder.write("CHANGELOG.md", "# Changelog\n\n## Unreleased\n\n- 0.2.0\n");
    has(&fails(&folder, &notes("v0.2.0")), &["CHANGELOG.md has no section", "## 0.2.0"]);
}

/// A page of the book is one folder further from the repository's root than its source in docs/.
#[test]
fn links_of_the_book_lead_out_of_it() {
    let folder = WorkFolder::new();
    let lines = r#"
        mkdir .ci
        cp "$REPOSITORY/.ci/book" .ci
        mdbook() {
            mkdir -p target/book
            echo '<a href="view.html#keys"></a><a href="../src/a.rs"></a><a href="../cl"></a>' >target/book/a.html
            echo '<a href="../tests/README.html#run"></a><a href="https://a.org/../b.html"></a>' >>target/book/a.html
        }
        export -f mdbook
        .ci/book
        cat target/book/a.html"#;
    let expected = r#"<a href="view.html#keys"></a><a href="../../src/a.rs"></a><a href="../../cl"></a>
<a href="../../tests/README.md#run"></a><a href="https://a.org/../b.html"></a>
"#;
    assert_eq!(succeeds(&folder, lines), expected);
}

/// cargo's settings may name another folder for builds than `target`, and a folder's name may have blanks.
#[test]
fn the_makefile_starts_the_binary_that_it_has_built() {
    let makefile = std::fs::read_to_string(repository("Makefile")).expect("the Makefile");
    has(
        &makefile,
        &["\nTARGET_DIR = \"$${CARGO_TARGET_DIR:-target}\"\nRAYCL = $(TARGET_DIR)/release/raycl\n"],
    );
    assert_eq!(makefile.matches("CARGO_TARGET_DIR").count(), 1, "{makefile}");
    let builds = makefile.lines().filter(|line| line.contains("cargo build") || line.contains("--no-run"));
    for build in builds {
        assert!(build.ends_with(" --target-dir $(TARGET_DIR)"), "{build}");
    }
}
