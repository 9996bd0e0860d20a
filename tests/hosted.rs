//! Tests of the files with which other machines test, build and install raycl. Every command in the workflows
//! of the hosted CI and in the container file exists. Archives and packages are complete, and the licences of
//! others' files are named. The program states the right revision (commit) of its source, and the citation
//! file names the version of this crate.

use crate::binary::{WorkFolder, has, repository, run};
use clap::Parser as _;
use std::collections::BTreeSet;
use std::fs::{read_dir, read_to_string};
use std::process::Command;
use yaml_rust2::{Yaml, YamlLoader};

/// The crate's build script.
#[path = "../build.rs"]
#[allow(dead_code, reason = "tests use only a part of it")]
mod build_script;

fn yaml(path: &str) -> Yaml {
    let text = read_to_string(repository(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
    YamlLoader::load_from_str(&text).unwrap_or_else(|error| panic!("{path}: {error}")).remove(0)
}

/// Returns the jobs of a workflow, each with its steps.
fn jobs(path: &str) -> Vec<(String, Vec<Yaml>)> {
    let workflow = yaml(path);
    assert!(workflow["on"].as_hash().is_some_and(|on| !on.is_empty()), "{path}: no event starts it");
    let jobs = workflow["jobs"].as_hash().unwrap_or_else(|| panic!("{path} has no jobs")).iter();
    jobs.map(|(name, job)| {
        let name = name.as_str().expect("a name").to_owned();
        assert!(job["runs-on"].as_str().is_some(), "{path}: {name} runs nowhere");
        (name, job["steps"].as_vec().expect("steps").clone())
    })
    .collect()
}

const WORKFLOWS: [&str; 2] = [".github/workflows/ci.yml", ".github/workflows/release.yml"];

/// Further programs that workflows may start. They exist on the machines that run the workflows.
const ELSEWHERE: [&str; 8] = ["apt-get", "curl", "sh", "echo", "cd", "git", "sha256sum", "gh"];

/// Fails unless each program in a line of shell exists on the machine that runs it, and has the requested
/// target or command.
fn check(line: &str) {
    let makefile = read_to_string(repository("Makefile")).expect("the Makefile");
    for command in line.split("&&").flat_map(|part| part.split('|')).map(str::trim) {
        let words: Vec<&str> = command.split_whitespace().collect();
        match words[0] {
            "make" => assert!(makefile.contains(&format!("\n{}: ", words[1])), "make has no {}", words[1]),
            "target/release/raycl" => {
                let parsed = raycl::cli::Cli::try_parse_from(&words);
                let shown = parsed.err().is_none_or(|error| error.exit_code() == 0);
                assert!(shown, "raycl refuses {line}");
            }
            script if script.starts_with(".ci/") => {
                assert!(repository(script).is_file(), "there is no {script}")
            }
            program => assert!(ELSEWHERE.contains(&program), "nothing provides {program}, of {line}"),
        }
    }
}

#[test]
fn every_command_of_the_workflows_exists() {
    for path in WORKFLOWS {
        for (job, steps) in jobs(path) {
            for step in &steps {
                let [run, uses] = ["run", "uses"].map(|key| step[key].as_str());
                assert!(run.is_some() != uses.is_some(), "{path}, {job}: {step:?}");
                run.into_iter().for_each(check);
                // Each use of an action must name a version: GitHub rejects a workflow that uses an action
                // without a version.
                assert!(uses.is_none_or(|action| action.contains('@')), "{path}, {job}: {uses:?}");
            }
        }
    }
}

/// The least major versions of GitHub's actions that workflows may use. Earlier versions of these actions
/// need Node 20, which GitHub removed from its machines in 2026.
const LEAST_VERSIONS: [(&str, u32); 3] =
    [("actions/checkout", 5), ("actions/upload-artifact", 6), ("actions/download-artifact", 7)];

/// Labels of machines that GitHub no longer offers, or will not offer from April 2027.
const RETIRED: [&str; 3] = ["ubuntu-20.04", "ubuntu-22.04", "ubuntu-22.04-arm"];

#[test]
fn the_workflows_use_neither_retired_machines_nor_retired_actions() {
    for path in WORKFLOWS {
        for (job, steps) in jobs(path) {
            for action in steps.iter().filter_map(|step| step["uses"].as_str()) {
                let (name, version) = action.split_once("@v").expect("a version");
                let known = LEAST_VERSIONS.iter().find(|(known, _)| *known == name);
                let least = known.map_or(0, |(_, least)| *least);
                let major: u32 = version.parse().expect("a major version");
                assert!(major >= least, "{path}, {job}: {action} is older than version {least}");
            }
        }
        let text = read_to_string(repository(path)).expect("a workflow");
        let retired = text.split_whitespace().find(|word| RETIRED.contains(word));
        assert_eq!(retired, None, "{path}");
    }
}

#[test]
fn every_job_has_a_time_limit_and_only_publishing_may_write() {
    for path in WORKFLOWS {
        let workflow = yaml(path);
        assert_eq!(workflow["permissions"]["contents"].as_str(), Some("read"), "{path}");
        for (name, job) in workflow["jobs"].as_hash().expect("jobs") {
            let name = name.as_str().expect("a name");
            assert!(job["timeout-minutes"].as_i64().is_some(), "{path}: {name} has no time limit");
            let writes = job["permissions"]["contents"].as_str() == Some("write");
            assert_eq!(writes, name == "publish", "{path}: {name}");
        }
    }
}

#[test]
fn the_workflows_lint_test_and_release_for_both_processors() {
    let runs = |path: &str, job: &str| -> Vec<String> {
        let (_, steps) = jobs(path).into_iter().find(|(name, _)| name == job).expect("the job");
        steps.iter().filter_map(|step| step["run"].as_str()).map(str::to_owned).collect()
    };
    assert!(runs(WORKFLOWS[0], "lint").contains(&"make lint".to_owned()));
    assert!(runs(WORKFLOWS[0], "test").contains(&"make test".to_owned()));
    assert!(runs(WORKFLOWS[1], "binary").iter().any(|run| run.starts_with(".ci/archive ")));
    // Before a job builds or publishes anything, `.ci/notes` checks that the tag names this version.
    for job in ["binary", "publish"] {
        assert!(runs(WORKFLOWS[1], job).iter().any(|run| run.starts_with(".ci/notes ")), "{job}");
    }
    let release = yaml(WORKFLOWS[1]);
    let machines = release["jobs"]["binary"]["strategy"]["matrix"]["include"].as_vec().expect("machines");
    let targets: Vec<_> = machines.iter().filter_map(|machine| machine["target"].as_str()).collect();
    assert_eq!(targets, ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu"]);
}

#[test]
fn the_container_file_copies_what_is_there() {
    let text = read_to_string(repository("Containerfile")).expect("the file");
    let sources: Vec<&str> = text.split_whitespace().filter(|word| word.starts_with("/raycl/")).collect();
    assert!(sources.len() > 1, "{text}");
    has(&text, &["/raycl/target/THIRD-PARTY.txt", "/LICENSE-DejaVu"]);
    for source in sources.iter().filter(|source| !source.contains("/target/")) {
        assert!(repository(&source["/raycl/".len()..]).is_file(), "there is no {source}");
    }
    let makefile = read_to_string(repository("Makefile")).expect("the Makefile");
    for target in text.lines().filter_map(|line| line.strip_prefix("RUN make ")) {
        assert!(makefile.contains(&format!("\n{target}: ")), "make has no {target}");
    }
    for command in text.lines().filter_map(|line| line.strip_prefix("RUN .ci/")) {
        let script = command.split(' ').next().expect("a name");
        assert!(repository(".ci").join(script).is_file(), "there is no .ci/{script}");
    }
    // The container installs the OpenCL loader and PoCL from the same packages as `make setup`.
    let setup = read_to_string(repository(".ci/setup")).expect("the script");
    for package in ["ocl-icd-libopencl1", "pocl-opencl-icd"] {
        has(&text, &[package]);
        has(&setup, &[package]);
    }
}

#[test]
fn the_citation_is_of_this_version() {
    let citation = yaml("CITATION.cff");
    assert_eq!(citation["version"].as_str(), Some(env!("CARGO_PKG_VERSION")));
    assert_eq!(citation["cff-version"].as_str(), Some("1.2.0"));
    let licences: Vec<_> =
        citation["license"].as_vec().expect("licences").iter().filter_map(Yaml::as_str).collect();
    assert_eq!(licences.join(" OR "), env!("CARGO_PKG_LICENSE"));
    for key in ["message", "title"] {
        assert!(citation[key].as_str().is_some_and(|text| !text.is_empty()), "{key}");
    }
    assert!(citation["authors"][0]["name"].as_str().is_some());
}

/// `.ci/licences` checks that no crate needs a later version of Rust than Cargo.toml names.
#[test]
fn documents_name_the_version_of_rust_that_cargo_demands() {
    let version = concat!("Rust ", env!("CARGO_PKG_RUST_VERSION"), " or later");
    for page in ["README.md", "CONTRIBUTING.md"] {
        let text = read_to_string(repository(page)).expect("a page");
        has(&text.replace("[Rust](https://rustup.rs)", "Rust"), &[version]);
    }
}

/// Packs an archive, and returns the names of its files and folders, without the archive's own folder.
#[cfg(unix)]
fn archived() -> BTreeSet<String> {
    let folder = WorkFolder::new();
    // The tests' own binary is large. The test therefore packs a short script that starts the binary.
    folder.write("raycl", concat!("#!/bin/sh\nexec '", env!("CARGO_BIN_EXE_raycl"), "' \"$@\"\n"));
    let executable = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(folder.path("raycl"), executable).expect("permissions");
    // A shell function takes the place of Python, which a minimal Debian does not contain.
    let lines = r#"
        python3() { echo "$@"; }
        export -f python3
        "$REPOSITORY/.ci/archive" raycl raycl-here
        tar -tzf raycl-here.tar.gz"#;
    let mut pack = Command::new("bash");
    pack.env("XDG_CONFIG_HOME", crate::binary::NO_SETTINGS).env("REPOSITORY", env!("CARGO_MANIFEST_DIR"));
    let packed = run(pack.args(["-euc", lines]).current_dir(folder.path("")));
    assert!(packed.status.success(), "{packed:?}");
    let listed = String::from_utf8(packed.stdout).expect("UTF-8");
    let names = listed.lines().filter_map(|line| line.strip_prefix("raycl-here/"));
    names.map(|name| name.trim_end_matches('/').to_owned()).collect()
}

/// An archive for distribution contains the program, its manual pages, its completions and all licences. The
/// archive also contains everything to which its readme refers, except pictures and records, which are large.
#[cfg(unix)]
#[test]
fn an_archive_holds_the_binary_its_pages_its_completions_and_its_documents() {
    let names = archived();
    let manual = ["share/man/man1/raycl.1", "share/man/man1/raycl-render.1"];
    let licences = ["LICENSE", "LICENSE-APACHE", "LICENSE-MIT", "LICENSE-DejaVu", "THIRD-PARTY.txt"];
    let licences = licences.map(|name| format!("share/doc/raycl/{name}"));
    let others = ["bin/raycl", "share/bash-completion/completions/raycl"];
    for name in manual.into_iter().chain(licences.iter().map(String::as_str)).chain(others) {
        assert!(names.contains(name), "{name} is not in {names:?}");
    }
    assert!(!names.iter().any(|name| name.contains("b3sum")), "{names:?}");
    let readme = read_to_string(repository("README.md")).expect("the readme");
    for link in crate::book::links(&readme) {
        let file = link.split('#').next().expect("a file").trim_end_matches('/');
        let large = file.starts_with("docs/images/") || file == "docs/results";
        let there = file.is_empty() || large || names.contains(&format!("share/doc/raycl/{file}"));
        assert!(there, "README.md of the archive names {link}, which is not in the archive");
    }
}

/// The file LICENSE names every file in src/report/assets, except those that raycl's developers wrote.
#[test]
fn the_licence_names_the_files_of_others() {
    const OWN: [&str; 1] = ["published_runtimes.csv"];
    let licence = read_to_string(repository("LICENSE")).expect("the licence");
    for entry in read_dir(repository("src/report/assets")).expect("the assets") {
        let name = entry.expect("an entry").file_name().into_string().expect("UTF-8");
        assert!(OWN.contains(&name.as_str()) || licence.contains(&name), "LICENSE does not name {name}");
    }
    has(&licence, &["newell_teapot_patches.json", "three.js authors"]);
    let font = read_to_string(repository("src/report/assets/LICENSE-DejaVu")).expect("the font's licence");
    has(&font, &["Bitstream Vera Fonts Copyright", "Arev Fonts Copyright"]);
}

/// `cargo package` packs the Makefile, so it must also pack the scripts that the Makefile starts.
#[test]
fn the_package_has_the_scripts_that_its_makefile_starts() {
    let manifest: toml::Table =
        read_to_string(repository("Cargo.toml")).expect("Cargo.toml").parse().expect("TOML");
    let excluded = manifest["package"]["exclude"].as_array().expect("a list");
    let makefile = read_to_string(repository("Makefile")).expect("the Makefile");
    let words = makefile.split_whitespace().map(|word| word.trim_start_matches('@'));
    let scripts: BTreeSet<&str> = words.filter(|word| word.starts_with(".ci/")).collect();
    assert!(scripts.contains(".ci/setup"), "{scripts:?}");
    for script in scripts {
        assert!(repository(script).is_file(), "there is no {script}");
        let left_out = excluded.iter().filter_map(toml::Value::as_str).any(|path| script.starts_with(path));
        assert!(!left_out, "Cargo.toml excludes {script} from the package");
    }
}

/// If an edit of an embedded file did not start the build script, the revision would lack `-dirty`.
#[test]
fn the_build_script_watches_all_files_that_the_program_embeds() {
    let root = repository("").canonicalize().expect("the repository");
    let mut embedded = BTreeSet::new();
    for file in crate::microscope::files(&root.join("src")) {
        // Some files of src/ are not Rust code. Those that are not even text count as empty.
        let text = read_to_string(&file).unwrap_or_default();
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        for start in ["include_str!(\"", "include_bytes!(\"", "include_dir!(\"$CARGO_MANIFEST_DIR/"] {
            let folder = if start.contains('$') { root.as_path() } else { file.parent().expect("a folder") };
            let names = code.split(start).skip(1).filter_map(|rest| rest.split('"').next());
            let paths = names.map(|name| folder.join(name).canonicalize().expect("an embedded file"));
            embedded.extend(paths.map(|path| path.strip_prefix(&root).expect("a file of raycl").to_owned()));
        }
    }
    assert!(embedded.len() > 10, "{embedded:?}");
    for path in embedded {
        let is_watched = build_script::SOURCES.iter().any(|source| path.starts_with(source));
        assert!(is_watched, "build.rs does not name {}", path.display());
    }
}

/// A package in another project's repository has the revision that its .cargo_vcs_info.json names, or no revision. It
/// never has the repository's.
#[test]
fn the_revision_is_not_that_of_another_repository() {
    let folder = WorkFolder::new();
    let git = |arguments: &[&str]| {
        let mut git = Command::new("git");
        git.args(["-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false"]);
        let output = run(git.args(arguments).current_dir(folder.path("")));
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).expect("UTF-8").trim().to_owned()
    };
    let revision = |path: &str| build_script::revision(&folder.path(path));
    folder.write("Cargo.toml", "");
    folder.write("vendor/raycl/Cargo.toml", "");
    git(&["init", "--quiet"]);
    git(&["add", "--all"]);
    git(&["commit", "--quiet", "--message", "both"]);
    assert_eq!(revision("."), Some(git(&["rev-parse", "--short=12", "HEAD"])));
    assert_eq!(revision("vendor/raycl"), None);
    // A file that is written again with the same text counts as unchanged. The build script does not update git's index
    // because of such a file: after an update of the index, cargo would compile raycl again.
    let index = || std::fs::read(folder.path(".git/index")).expect("the index");
    let before = index();
    folder.write("Cargo.toml", "");
    let head = git(&["rev-parse", "--short=12", "HEAD"]);
    assert_eq!((revision("."), index() == before), (Some(head.clone()), true));
    folder.write("Cargo.toml", "[package]");
    assert_eq!(revision("."), Some(head + "-dirty"));
    let package = r#"{ "git": { "sha1": "0123456789abcdef0123456789abcdef01234567" }, "path_in_vcs": "" }"#;
    for path in [".", "vendor/raycl"] {
        folder.write(&format!("{path}/.cargo_vcs_info.json"), package);
        assert_eq!(revision(path).as_deref(), Some("0123456789ab"), "{path}");
    }
}
