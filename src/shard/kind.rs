//! The kinds of device that take part in an experiment, with the keys and names of their points. Each kind of
//! device has a file, written by the first shard that measures on a device of this kind.

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
/// that affects times. The host's processors are a kind of device too.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Kind {
    /// The name that records give to devices of this kind.
    pub device: String,
    /// The platform, the device, the driver, and every property of the device that affects times.
    pub identity: String,
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

    /// Returns all kinds of device in a folder: first the kinds of host, then the other kinds, both sorted by
    /// file name. If several kinds of device have points with equal keys, only the first of these kinds is
    /// returned.
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
        // Two kinds of device have points with equal keys if the kinds differ only in the build of raycl or
        // in the device's name on its machine.
        let mut seen = HashSet::new();
        kinds.retain(|kind| seen.insert(kind.keys()));
        Ok(kinds)
    }

    fn keys(&self) -> Vec<String> {
        self.points.iter().map(|point| point.planned.key.clone()).collect()
    }

    /// Returns, for each kind of device, a text with its differences from other kinds of the same name, or
    /// `None` if no other kind has this name. The text lists those parts of the kind's `identity` that not
    /// all kinds of the same name have. If `identity` has the same parts in all kinds of the same name, the
    /// text is "another program".
    pub fn distinctions(kinds: &[Self]) -> Vec<Option<String>> {
        let parts = |kind: &Self| kind.identity.split(" | ").map(str::to_owned).collect::<Vec<_>>();
        let of = |kind: &Self| {
            let namesakes: Vec<_> =
                kinds.iter().filter(|other| other.device == kind.device).map(parts).collect();
            let own: Vec<String> = parts(kind)
                .into_iter()
                .filter(|part| !namesakes.iter().all(|other| other.contains(part)))
                .map(|part| in_singular(&part))
                .collect();
            (namesakes.len() > 1)
                .then(|| if own.is_empty() { "another program".to_owned() } else { own.join(", ") })
        };
        kinds.iter().map(of).collect()
    }
}

/// Returns the error for a file of a kind of device that has no complete line.
fn no_points(path: &Path) -> Error {
    let message =
        format!("{} has no complete line, but must list the points of a kind of device", path.display());
    Error::input(message).with_help(
        "copy the file again from the machine that wrote it. If that machine no longer has the file, delete the file here: the next shard on a device of this kind then writes it again",
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
            let kind = Kind { device: device.into(), identity: identity.into(), points };
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
    fn kinds_with_the_same_identity_differ_in_their_programs() {
        let kind = |key: &str| {
            let planned = PlannedPoint { key: key.into(), ..PlannedPoint::default() };
            Kind {
                device: "cpu".into(),
                identity: "PoCL | x".into(),
                points: vec![KindPoint { point: 0, planned }],
            }
        };
        let actual = Kind::distinctions(&[kind("a"), kind("b")]);
        assert_eq!(actual, [Some("another program".to_owned()), Some("another program".to_owned())]);
    }
}
