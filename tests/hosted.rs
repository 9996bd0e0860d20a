//! Tests of the files for other machines. Every command in the workflows of the hosted CI, in the container file and
//! in the script for archives exists, and the citation file names this version. The folder .ci is in the repository,
//! but not in the package.

use crate::binary::{WorkFolder, has, repository};
use clap::Parser as _;
use std::fs::read_to_string;
use yaml_rust2::{Yaml, YamlLoader};

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

/// Programs that exist on the machines on which these commands run.
const ELSEWHERE: [&str; 9] = ["apt-get", "curl", "sh", "echo", "cd", "git", "rustup", "sha256sum", "gh"];

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
                // An action must have a version, so that it does not change by itself.
                assert!(uses.is_none_or(|action| action.contains('@')), "{path}, {job}: {uses:?}");
            }
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
    let release = yaml(WORKFLOWS[1]);
    let machines = release["jobs"]["binary"]["strategy"]["matrix"]["include"].as_vec().expect("machines");
    let targets: Vec<_> = machines.iter().filter_map(|machine| machine["target"].as_str()).collect();
    assert_eq!(targets, ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu"]);
}

#[test]
fn the_container_file_copies_what_is_there() {
    let text = read_to_string(repository("Containerfile")).expect("the file");
    let copied = text.lines().filter_map(|line| line.strip_prefix("COPY --from=build "));
    let sources: Vec<&str> =
        copied.flat_map(|line| line.split(' ')).filter(|word| word.starts_with("/raycl/")).collect();
    assert!(sources.len() > 1, "{text}");
    for source in sources.iter().filter(|source| !source.contains("/target/")) {
        assert!(repository(&source["/raycl/".len()..]).is_file(), "there is no {source}");
    }
    let makefile = read_to_string(repository("Makefile")).expect("the Makefile");
    for target in text.lines().filter_map(|line| line.strip_prefix("RUN make ")) {
        assert!(makefile.contains(&format!("\n{target}: ")), "make has no {target}");
    }
    // The container installs the same two packages as `make setup`.
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

/// An archive for distribution contains the program, its manual pages and its completions.
#[cfg(unix)]
#[test]
fn an_archive_holds_the_binary_its_pages_and_its_completions() {
    let folder = WorkFolder::new();
    // The tests' own binary is large. The test packs a short script instead, which starts this binary.
    folder.write("raycl", concat!("#!/bin/sh\nexec '", env!("CARGO_BIN_EXE_raycl"), "' \"$@\"\n"));
    let executable = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(folder.path("raycl"), executable).expect("permissions");
    let mut pack = std::process::Command::new("bash");
    pack.env("XDG_CONFIG_HOME", crate::binary::NO_SETTINGS);
    pack.arg(repository(".ci/archive")).args(["raycl", "raycl-here"]).current_dir(folder.path(""));
    let packed = crate::binary::run(&mut pack);
    assert!(packed.status.success(), "{packed:?}");
    let mut list = std::process::Command::new("tar");
    let listed = crate::binary::run(list.args(["-tzf", "raycl-here.tar.gz"]).current_dir(folder.path("")));
    let names = String::from_utf8(listed.stdout).expect("UTF-8");
    has(
        &names,
        &["bin/raycl\n", "man1/raycl.1\n", "man1/raycl-render.1\n", "completions/raycl\n", "LICENSE-MIT\n"],
    );
    assert!(!names.contains("b3sum"), "{names}");
}

/// Checking the fuzz targets takes half a minute if it shares compiled crates with the lints, and five minutes
/// otherwise. Only programs that are built with the same profile share compiled crates.
#[test]
fn the_fuzz_targets_are_compiled_as_the_crate_is() {
    let profile = |path: &str| {
        let text = read_to_string(repository(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
        let manifest: toml::Table = text.parse().unwrap_or_else(|error| panic!("{path}: {error}"));
        manifest["profile"]["dev"].clone()
    };
    assert_eq!(profile("tests/fuzz/Cargo.toml"), profile("Cargo.toml"));
}
