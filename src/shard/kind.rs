//! The kinds of device that take part in an experiment, with the keys and names of their points. For each version of
//! raycl, each kind of device has a file of its own. The first shard that measures with this version on a device of
//! this kind writes the file.

use crate::error::{Error, Result};
use crate::existing;
use crate::record::{PlannedPoint, read_lines, write_new};
use crate::words::in_singular;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// The name of the folder in which each kind has its file.
pub(super) const FOLDER: &str = "kinds";

/// A kind of device: all devices that have the same platform, name and driver, and are equal in every other property
/// that affects times. If raycl finds several such devices on one machine, the second and each later one is a kind of
/// its own. The host's processors are a kind of device too.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Kind {
    /// The name that records give to devices of this kind.
    pub device: String,
    /// The platform, the device, the driver, and every property of the device that affects times.
    pub identity: String,
    /// The version of raycl that wrote the file of this kind, with the git revision if it is known; absent in files of
    /// earlier versions. Two versions may store points of the same devices under different keys.
    pub raycl: Option<String>,
    /// The points that are measured on this kind of device, in the plan's order.
    pub points: Vec<KindPoint>,
}

/// A point of the plan on a kind of device.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KindPoint {
    /// The point's index in the plan.
    pub point: usize,
    /// The key of the point on this kind of device, and the point's names.
    #[serde(flatten)]
    pub planned: PlannedPoint,
}

impl Kind {
    /// Returns the path of the file of a kind of device. The file's name consists of the device's name and a
    /// hash of everything that identifies the kind of device, including the version of raycl.
    pub fn file(out: &Path, device: &str, identity: &str) -> PathBuf {
        let program = option_env!("RAYCL_GIT_REVISION").unwrap_or(env!("CARGO_PKG_VERSION"));
        let hash = blake3::hash(format!("{device}\n{identity}\n{program}").as_bytes()).to_hex();
        let words: Vec<&str> =
            device.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
        out.join(FOLDER).join(format!("{}-{}.jsonl", words.join("-").to_lowercase(), &hash[..8]))
    }

    /// Writes this kind of device to its file, `path`, unless another shard has already written the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        let failed =
            |error: &dyn std::fmt::Display| Error::run(format!("cannot write {}: {error}", path.display()));
        std::fs::create_dir_all(path.parent().unwrap_or(Path::new("."))).map_err(|error| failed(&error))?;
        let mut text = serde_json::to_vec(self).map_err(|error| failed(&error))?;
        text.push(b'\n');
        write_new(path, &text).map(|_| ())
    }

    /// Returns all kinds of device in a folder: first the kinds of host, then the other kinds, both sorted by file
    /// name. If the points of several kinds of device have the same keys in the same order, only the first of these
    /// kinds is returned.
    pub fn all(out: &Path) -> Result<Vec<Self>> {
        let mut files = existing::entries(&out.join(FOLDER))?;
        files.retain(|path| path.extension().is_some_and(|ending| ending == "jsonl"));
        files.sort();
        // The file of a kind of device has a single line with all points of this kind. A file whose line is
        // damaged or missing is an error: without the line, a merge would leave out all points of this kind
        // of device.
        let lines = |path: &PathBuf| -> Result<Vec<Self>> {
            let lines = read_lines(path)?.refuse_if_all_damaged(path)?.lines;
            if lines.is_empty() { Err(no_points(path)) } else { Ok(lines) }
        };
        let read: Result<Vec<_>> = files.iter().map(lines).collect();
        let mut kinds: Vec<Self> = read?.into_iter().flatten().collect();
        kinds.sort_by_key(|kind| kind.device != crate::record::HOST);
        // The points of two kinds of device can have the same keys although the kinds have different files. For
        // example, two versions of raycl may compute the same keys, or machines may give different names to equal
        // devices.
        let mut seen = HashSet::new();
        kinds.retain(|kind| seen.insert(kind.keys()));
        Ok(kinds)
    }

    fn keys(&self) -> Vec<String> {
        self.points.iter().map(|point| point.planned.key.clone()).collect()
    }

    /// Returns, for each kind of device, a text with its differences from other kinds of the same name, or
    /// `None` if no other kind has this name. No two kinds of the same name have the same text.
    pub fn distinctions(kinds: &[Self]) -> Vec<Option<String>> {
        kinds.iter().map(|kind| kind.distinction(kinds)).collect()
    }

    fn distinction(&self, kinds: &[Self]) -> Option<String> {
        let namesakes: Vec<&Self> = kinds.iter().filter(|other| other.device == self.device).collect();
        let mut differences = self.differences(&namesakes);
        differences.extend(self.program(&namesakes));
        (!differences.is_empty()).then(|| differences.join(", "))
    }

    /// Returns those parts of this kind's `identity` that at least one of the namesakes (kinds of the same name) lacks.
    /// If no namesake lacks a part of this kind's `identity`, returns the parts that this kind lacks, such as "without
    /// POCL_WORK_GROUP_METHOD=cbs". `namesakes` contains this kind, too.
    fn differences(&self, namesakes: &[&Self]) -> Vec<String> {
        let is_own = |part: &&str| !namesakes.iter().all(|other| other.has(part));
        let own: Vec<String> = self.parts().filter(is_own).map(in_singular).collect();
        if !own.is_empty() {
            return own;
        }
        let mut seen = HashSet::new();
        let parts = namesakes.iter().flat_map(|other| other.parts());
        let lacks = parts.filter(|part| !self.has(part) && seen.insert(*part));
        lacks.map(|part| format!("without {}", in_singular(part))).collect()
    }

    /// Returns the version of raycl that distinguishes this kind from its twins (namesakes with the same `identity`);
    /// `None` if this kind has no twin. If a twin's version is unknown, or is that of another twin, the twins are
    /// numbered instead: "program 1", "program 2".
    fn program(&self, namesakes: &[&Self]) -> Option<String> {
        let twins: Vec<&Self> =
            namesakes.iter().copied().filter(|other| other.identity == self.identity).collect();
        let versions: HashSet<&String> = twins.iter().filter_map(|twin| twin.raycl.as_ref()).collect();
        let version = self.raycl.as_ref().filter(|_| versions.len() == twins.len());
        let number = twins.iter().position(|twin| std::ptr::eq(*twin, self))? + 1;
        let program =
            version.map_or_else(|| format!("program {number}"), |version| format!("raycl {version}"));
        (twins.len() > 1).then_some(program)
    }

    fn parts(&self) -> impl Iterator<Item = &str> {
        self.identity.split(" | ")
    }

    fn has(&self, part: &str) -> bool {
        self.parts().any(|own| own == part)
    }
}

/// Returns the error for a file without a complete line; the file should list the points of a kind of device.
fn no_points(path: &Path) -> Error {
    let message =
        format!("{} has no complete line, but must list the points of a kind of device", path.display());
    Error::input(message).with_help(
        "copy the file again from the machine that wrote it. If that machine no longer has the file, delete the file here: the next shard with the same version of raycl on a device of this kind then writes it again",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_of_one_name_are_distinguished_by_what_differs() {
        let kind = |device: &str, identity: &str| Kind {
            device: device.into(),
            identity: identity.into(),
            ..Kind::default()
        };
        let kinds =
            [kind("cpu", "PoCL | 1 compute units"), kind("cpu", "PoCL | 2 compute units"), kind("gpu", "x")];
        let actual = Kind::distinctions(&kinds);
        assert_eq!(actual, [Some("1 compute unit".to_owned()), Some("2 compute units".to_owned()), None]);
    }

    #[test]
    fn a_kind_is_written_once_and_the_host_is_read_first() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        for (device, point) in [("asleep (1)", 1), ("host", 2), ("host", 3)] {
            let planned = PlannedPoint { key: point.to_string(), ..PlannedPoint::default() };
            let kind =
                Kind { device: device.into(), points: vec![KindPoint { point, planned }], ..Kind::default() };
            kind.write(&Kind::file(out, device, "x")).unwrap();
        }
        let kinds = Kind::all(out).unwrap();
        let actual: Vec<_> = kinds.iter().map(|kind| (kind.device.as_str(), kind.points[0].point)).collect();
        assert_eq!(actual, [("host", 2), ("asleep (1)", 1)]);
        assert!(Kind::all(&out.join("nothing")).unwrap().is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_of_kinds_that_cannot_be_listed_is_not_an_empty_one() {
        let folder = tempfile::tempdir().unwrap();
        let kinds = folder.path().join(FOLDER);
        std::os::unix::fs::symlink(&kinds, &kinds).unwrap();
        let error = Kind::all(folder.path()).unwrap_err();
        assert!(error.to_string().starts_with(&format!("cannot read {}", kinds.display())), "{error}");
    }

    #[test]
    fn a_kinds_file_without_a_line_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = Kind::file(folder.path(), "gpu", "x");
        let kind = Kind { device: "gpu".into(), ..Kind::default() };
        kind.write(&path).unwrap();
        let text = std::fs::read(&path).unwrap();
        for lost in [&[][..], &text[..text.len() - 2]] {
            std::fs::write(&path, lost).unwrap();
            let error = Kind::all(folder.path()).unwrap_err();
            let expected = format!("{} has no complete line", path.display());
            assert!(error.exit_code() == 2 && error.to_string().starts_with(&expected), "{error}");
        }
    }

    #[test]
    fn kinds_with_the_same_points_are_one() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        for (device, identity) in [("cpu", "one build"), ("cpu", "another build"), ("gpu", "x")] {
            let planned = PlannedPoint { key: device.into(), ..PlannedPoint::default() };
            let points = vec![KindPoint { point: 0, planned }];
            let kind = Kind { device: device.into(), identity: identity.into(), points, ..Kind::default() };
            kind.write(&Kind::file(out, device, identity)).unwrap();
        }
        let kinds = Kind::all(out).unwrap();
        let mut devices: Vec<_> = kinds.iter().map(|kind| kind.device.as_str()).collect();
        devices.sort_unstable();
        assert_eq!(devices, ["cpu", "gpu"]);
    }

    #[test]
    fn a_kinds_file_is_named_by_its_device_and_is_another_for_another_identity() {
        let file = |device: &str, identity: &str| Kind::file(Path::new("out"), device, identity);
        let name = file("NVIDIA H200 (1)", "a").file_name().unwrap().to_string_lossy().into_owned();
        assert!(name.starts_with("nvidia-h200-1-") && name.ends_with(".jsonl"), "{name}");
        assert_eq!(file("a", "b"), file("a", "b"));
        assert_ne!(file("a", "b"), file("a", "c"));
        assert_ne!(file("a b", "c"), file("a-b", "c"));
    }

    #[test]
    fn a_kind_without_a_part_of_its_own_is_named_by_what_it_lacks() {
        let kind = |identity: &str| Kind { identity: identity.into(), ..Kind::default() };
        let texts = |kinds: &[Kind]| Kind::distinctions(kinds).into_iter().flatten().collect::<Vec<_>>();
        let (usual, cbs) = (kind("PoCL | 2 threads"), "POCL_WORK_GROUP_METHOD=cbs");
        let others = [usual.clone(), kind(&format!("PoCL | 2 threads | {cbs}"))];
        assert_eq!(texts(&others), [format!("without {cbs}"), cbs.to_owned()]);
        let [_, one] = others;
        let two = Kind { identity: format!("{} | X=1", one.identity), ..Kind::default() };
        let expected = [format!("without {cbs}, without X=1"), cbs.to_owned(), format!("{cbs}, X=1")];
        assert_eq!(texts(&[usual, one, two]), expected, "each missing part is named once");
    }

    /// Two versions of raycl may measure on equal devices, but store the points under different keys.
    #[test]
    fn kinds_with_the_same_identity_differ_in_their_programs() {
        let kind = |identity: &str, version: Option<&str>| Kind {
            identity: identity.into(),
            raycl: version.map(str::to_owned),
            ..Kind::default()
        };
        let of = |versions: [Option<&str>; 2]| {
            Kind::distinctions(&versions.map(|version| kind("PoCL | x", version)))
        };
        let texts = |texts: [&str; 2]| texts.map(|text| Some(text.to_owned()));
        let named = texts(["raycl 0.1.0 (4187d7cfd81b)", "raycl 0.2.0"]);
        assert_eq!(of([Some("0.1.0 (4187d7cfd81b)"), Some("0.2.0")]), named);
        for unknown in [[None, None], [Some("0.2.0"), None], [Some("0.2.0"), Some("0.2.0")]] {
            assert_eq!(of(unknown), texts(["program 1", "program 2"]), "{unknown:?}");
        }
        let kinds = [kind("PoCL | x", None), kind("PoCL | y", None), kind("PoCL | x", None)];
        let expected = ["x, program 1", "y", "x, program 2"].map(|text| Some(text.to_owned()));
        assert_eq!(Kind::distinctions(&kinds), expected);
    }
}
