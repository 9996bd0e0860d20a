//! The input of the OpenCL compiler: source text and options, with a hash of both. Source text and options depend on
//! the strategy and on the workload (the properties of a scene, an image and a work-group that determine the program).

use super::defines::value_of;
use super::source::Joiner;
use crate::device::Builtins;
use crate::error::{Error, Result};
use crate::manifest::{CAMERA, parameter_macro};
use crate::sources::{Chain, Sources};
use crate::strategy::{Axis, Copied, Math, Strategy, Workload};
use std::slice;

/// Everything that determines a compiled program, except the compiler itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramSpec {
    /// The source in OpenCL C.
    pub source: String,
    /// The compiler's options, in a fixed order: first the defines, then all other options.
    pub options: String,
    /// The files under `cl/` that the source consists of.
    pub files: Vec<String>,
}

impl ProgramSpec {
    /// Makes the compiler's input for a strategy and a workload. A size of the scene, such as its number of
    /// triangles or the depth of its tree, becomes a define only if it determines the length of an array in
    /// the kernels. Scenes of different sizes can therefore use the same program.
    pub fn new(
        sources: &Sources,
        strategy: &Strategy,
        workload: &Workload,
        builtins: Builtins,
    ) -> Result<Self> {
        let mut spec = Self::unchecked(sources, strategy, workload, builtins)?;
        spec.source += &check_of_staging(sources, strategy, &spec.files)?;
        Ok(spec)
    }

    /// Makes the compiler's input as [`Self::new`] does, but leaves out the check of the user's kernel file
    /// for the strategy's axis `triangles`. The check consists of `#error` lines, which stop the compiler if
    /// the file's macros disagree with the key `copied` in the file's header. `raycl kernel` prints the
    /// program without these `#error` lines, so that a user whose file fails the check can look for the cause
    /// in the printed program.
    pub fn unchecked(
        sources: &Sources,
        strategy: &Strategy,
        workload: &Workload,
        builtins: Builtins,
    ) -> Result<Self> {
        let names = strategy.family().defines(|fact| strategy.holds_of(fact, workload));
        let value = |name| {
            let value = value_of(name, strategy, workload, builtins);
            value
                .map(|value| (name, value))
                .ok_or_else(|| Error::fault(format!("no value for the kernels' macro {name}")))
        };
        let defines = names.map(value).collect::<Result<Vec<_>>>()?;
        let mut joiner = Joiner {
            sources,
            strategy,
            defines: &defines,
            text: parameter_lists(strategy, workload),
            files: Vec::new(),
            chain: Chain::default(),
        };
        joiner.add(strategy.family().entry)?;
        let (source, files) = (joiner.text, joiner.files);
        Ok(Self { source, options: options(strategy, builtins, &defines), files })
    }

    /// Returns a hash of the source and the options: 16 hexadecimal digits.
    pub fn hash(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.options.as_bytes()).update(b"\0").update(self.source.as_bytes());
        hasher.finalize().to_hex()[..16].to_string()
    }
}

fn options(strategy: &Strategy, builtins: Builtins, defines: &[(&'static str, u64)]) -> String {
    let mut options: Vec<String> = defines.iter().map(|(name, value)| format!("-D {name}={value}")).collect();
    options.push(strategy.lane_operations(builtins).standard(builtins.opencl_3).to_owned());
    options.push("-cl-kernel-arg-info".to_owned());
    if strategy.math == Math::Fast {
        options.push("-cl-fast-relaxed-math".to_owned());
    }
    options.join(" ")
}

/// Returns `#error` lines at which a compiler stops if the macros of the user's file of the axis `triangles`
/// disagree with the file's header. Without these `#error` lines, a file that disagrees with its header could
/// make a wrong picture, since the host makes defines such as `TRIANGLES` from the header. Returns no lines
/// if the program does not contain a user's file of the axis `triangles`, or if this file equals the built-in
/// file.
fn check_of_staging(sources: &Sources, strategy: &Strategy, files: &[String]) -> Result<String> {
    let file = format!("cast/triangles/{}.cl", strategy.triangles.name().replace('-', "_"));
    if !files.contains(&file) || sources.changed_paths(slice::from_ref(&file)).is_empty() {
        return Ok(String::new());
    }
    let text = sources.read(&file)?;
    let key = text.lines().position(|line| line.trim_start_matches('/').trim_start().starts_with("copied:"));
    // The compiler must report the error at the line of the header that has the key `copied`. A directive
    // `#line` states the number of the next line, which is the `#if`. The `#error` comes one line after the
    // `#if`, so the `#if` must get the number of the line before `copied`. This number is `key`, because
    // `key` is the index of the line of `copied`, counted from 0, and `#line` counts lines from 1.
    let line = key.unwrap_or(0).max(1);
    let copied = strategy.triangles.copied();
    let macros = [
        ("STAGE_VERTICES", matches!(copied, Copied::Scene | Copied::Vertices)),
        ("STAGE_NORMALS", matches!(copied, Copied::Scene | Copied::Normals)),
        ("STAGE_MATERIALS", copied == Copied::Scene),
        ("STREAM_TILES", copied == Copied::Rows),
    ];
    let check = |(name, is_set): (&str, bool)| {
        let value = u8::from(is_set);
        let why = format!("`copied` in the header of this file requires {name} to be {value}");
        format!("#line {line} \"{file}\"\n#if {name} != {value}\n#error \"{why}\"\n#endif\n")
    };
    Ok(macros.map(check).concat())
}

/// Returns macros for parameter lists, made from [`crate::manifest`]: one macro with the parameters that
/// describe the camera, and one macro for each kernel that this strategy and workload need.
fn parameter_lists(strategy: &Strategy, workload: &Workload) -> String {
    let kernels = strategy.family().kernels.iter().filter(|kernel| strategy.holds_of(kernel.when, workload));
    let lists = kernels.map(|kernel| kernel.parameter_macro(|fact| strategy.holds_of(fact, workload)));
    let head = "#line 1 \"the manifest's parameters\"\n".to_owned();
    [head, parameter_macro("CAMERA", CAMERA.iter())].into_iter().chain(lists).collect()
}

#[cfg(test)]
mod tests {
    use super::super::preprocess::preprocess;
    use super::*;
    use crate::strategy::preset;
    use std::collections::BTreeMap;

    #[test]
    fn another_source_or_other_options_make_another_hash() {
        let hash = |source: &str, options: &str| {
            ProgramSpec { source: source.into(), options: options.into(), files: Vec::new() }.hash()
        };
        assert_eq!(hash("text", "-D A=1"), hash("text", "-D A=1"));
        assert_ne!(hash("text", "-D A=1"), hash("text", "-D A=2"));
        assert_ne!(hash("text", "-D A=1"), hash("text ", "-D A=1"));
    }

    #[test]
    fn the_macros_of_a_users_file_of_triangles_agree_with_its_header() {
        let (folder, file) = (tempfile::tempdir().unwrap(), "cast/triangles/local.cl");
        std::fs::create_dir_all(folder.path().join("cast/triangles")).unwrap();
        let sources = Sources::Folder(folder.path().to_owned());
        let text = Sources::Embedded.read(file).unwrap();
        let strategy = preset("local-triangles").unwrap().strategy;
        let spec_of = |sources: &Sources| {
            ProgramSpec::new(sources, &strategy, &Workload::CUBE, Builtins::default()).unwrap()
        };
        for (from, to, expected) in [
            ("copied: scene", "copied: nothing", Some("STAGE_VERTICES to be 0")),
            ("copied: scene", "copied: vertices", Some("STAGE_NORMALS to be 0")),
            ("STAGE_MATERIALS 1", "STAGE_MATERIALS 0", Some("STAGE_MATERIALS to be 1")),
            ("meaning: ", "meaning: mine: ", None),
        ] {
            assert_eq!(text.matches(from).count(), 1, "{from}");
            std::fs::write(folder.path().join(file), text.replace(from, to)).unwrap();
            let spec = sources.values().unwrap().during(|| spec_of(&sources));
            let error = preprocess(&spec.source, &spec.options, &BTreeMap::new()).err();
            let message = error.map(|error| error.to_string());
            let as_expected = match (&message, expected) {
                (Some(text), Some(why)) => {
                    text.starts_with(&format!("{file}, line 3: #error \""))
                        && text.ends_with(&format!("{why}\""))
                }
                (message, expected) => message.is_none() && expected.is_none(),
            };
            assert!(as_expected, "{to}: {message:?}");
        }
        // Programs of built-in files get no lines that check a header, so that the programs' hashes stay
        // equal to the hashes in stored records.
        assert!(!spec_of(&Sources::Embedded).source.contains("in the header of this file"));
    }

    #[test]
    fn options_are_the_defines_the_standard_and_relaxed_mathematics_only_where_asked_for() {
        let mut strategy =
            crate::strategy::preset("naive").unwrap_or_else(|error| panic!("{error}")).strategy;
        let of = |strategy: &Strategy| options(strategy, Builtins::default(), &[("A", 1), ("B", 22)]);
        assert_eq!(of(&strategy), "-D A=1 -D B=22 -cl-std=CL1.2 -cl-kernel-arg-info");
        strategy.math = Math::Fast;
        assert_eq!(of(&strategy), "-D A=1 -D B=22 -cl-std=CL1.2 -cl-kernel-arg-info -cl-fast-relaxed-math");
    }

    #[test]
    fn a_users_file_that_copies_only_normals_agrees_with_its_header() {
        let (folder, file) = (tempfile::tempdir().unwrap(), "cast/triangles/split_normals.cl");
        std::fs::create_dir_all(folder.path().join("cast/triangles")).unwrap();
        let text = Sources::Embedded.read(file).unwrap().replace("meaning: ", "meaning: mine: ");
        std::fs::write(folder.path().join(file), text).unwrap();
        let sources = Sources::Folder(folder.path().to_owned());
        let strategy = preset("split-normals").unwrap().strategy;
        let spec = sources
            .values()
            .unwrap()
            .during(|| ProgramSpec::new(&sources, &strategy, &Workload::CUBE, Builtins::default()).unwrap());
        assert!(spec.source.contains("#if STAGE_NORMALS != 1\n"), "the file is checked");
        let error = preprocess(&spec.source, &spec.options, &BTreeMap::new()).err();
        assert_eq!(error.map(|error| error.to_string()), None);
    }
}
