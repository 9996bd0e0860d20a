//! The files from which scenes are read. Commands that render a scene again after a change watch these files.

use crate::reader::in_canonical_folder;
use crate::threads::locked;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use std::time::SystemTime;

/// The files of all scenes that this process has read.
pub(crate) static INPUTS: Inputs = Inputs::new();

/// Files that were read, or that would have been read if they existed. Pictures that a mesh names but that raycl does
/// not use are included, whether they exist or not.
#[derive(Debug)]
pub(crate) struct Inputs(Mutex<Files>);

#[derive(Debug)]
struct Files {
    /// The paths of the files. In each path, the folder's part is canonical (absolute, without links and `..`).
    paths: BTreeSet<PathBuf>,
    /// Maps each path that contains a link or `..`, or whose folder is missing, to the result of [`leads_to`]
    /// when the path was last checked.
    targets: BTreeMap<PathBuf, Option<PathBuf>>,
}

impl Inputs {
    /// Returns an empty list.
    pub const fn new() -> Self {
        Self(Mutex::new(Files { paths: BTreeSet::new(), targets: BTreeMap::new() }))
    }

    /// Adds a file's path, after making the folder's part canonical. If the path is a link, adds the link's target too.
    pub fn add(&self, path: &Path) {
        let names = [in_canonical_folder(path), path.canonicalize().ok()];
        let mut held = self.held();
        if let Ok(named) = std::path::absolute(path) {
            // A path without links need not be checked: it leads to the same file until the file or one of its
            // folders is replaced.
            match leads_to(path) {
                Some(target) if target == named => held.targets.remove(&named),
                target => held.targets.insert(named, target),
            };
        }
        held.paths.extend(names.into_iter().flatten());
    }

    /// Returns true if the file was added. The folder's part of `path` must be canonical.
    pub fn contains(&self, path: &Path) -> bool {
        self.held().paths.contains(path)
    }

    /// Returns true if the path of a file now leads to another file than at the last call of this function. A path that
    /// was added after the last call is compared with the file to which it led when it was added. A path leads to
    /// another file, for example, after a link in the path (to the file or to a folder) was replaced.
    pub fn lead_elsewhere(&self) -> bool {
        let mut is_any_new = false;
        for (path, target) in &mut self.held().targets {
            let now = leads_to(path);
            is_any_new |= *target != now;
            *target = now;
        }
        is_any_new
    }

    /// Returns the folders of the files.
    pub fn folders(&self) -> BTreeSet<PathBuf> {
        self.held().paths.iter().filter_map(|path| path.parent()).map(Path::to_owned).collect()
    }

    /// Returns true if a file of this folder was added and has been modified at or after the time `since`. The path of
    /// the folder must be canonical.
    pub fn modified_since(&self, folder: &Path, since: SystemTime) -> bool {
        let modified = |path: &PathBuf| path.metadata().and_then(|metadata| metadata.modified());
        let is_later = |path: &PathBuf| modified(path).is_ok_and(|at| at >= since);
        self.held().paths.iter().any(|path| path.parent() == Some(folder) && is_later(path))
    }

    fn held(&self) -> MutexGuard<'_, Files> {
        locked(&self.0)
    }
}

/// Returns the canonical path of the file to which `path` leads, or of the missing file; `None` if the file's folder
/// is missing. A file that is made later, such as a picture that raycl writes, therefore does not change where its
/// path leads.
fn leads_to(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok().or_else(|| in_canonical_folder(path))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::scene::load_scene;
    use std::time::Duration;

    #[test]
    fn every_file_of_a_scene_is_added_even_if_it_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().canonicalize().unwrap().join(name);
        std::fs::create_dir(path("part")).unwrap();
        std::fs::write(path("scene.toml"), "[[object]]\nmesh = \"part/a.obj\"\n").unwrap();
        std::fs::write(path("part/a.mtl"), "newmtl wood\nmap_Kd wood.png\n").unwrap();
        let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
        let mesh = format!("mtllib a.mtl\nusemtl wood\n{corners}f 1/1 2/1 3/1\n");
        std::fs::write(path("part/a.obj"), mesh).unwrap();
        let _ = load_scene(&path("part/../scene.toml"));
        for name in ["scene.toml", "part/a.obj", "part/a.mtl", "part/wood.png"] {
            assert!(INPUTS.contains(&path(name)), "{name}");
        }
        assert!(!INPUTS.contains(&path("part/other.png")));
        assert!(INPUTS.folders().is_superset(&BTreeSet::from([path(""), path("part")])));
    }

    #[test]
    fn a_picture_is_added_even_if_raycl_does_not_use_it_or_it_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().canonicalize().unwrap().join(name);
        std::fs::create_dir(path("part")).unwrap();
        let existing = ["bump.png", "a normal.png", "part/shine.png", "unused.png"];
        ["shine.png", "off.png"]
            .iter()
            .chain(&existing)
            .for_each(|name| std::fs::write(path(name), "").unwrap());
        let used = "newmtl used\nmap_Bump -bm 0.5 bump.png\nnorm a normal.png\nmap_Ks part\\shine.png\n";
        // The name `part/missing.png` may mean this file, or `missing.png` without the folder. Both are missing.
        let unused = "newmtl unused\nmap_Kd unused.png\nmap_Ke part/missing.png\nmap_aat off.png\n";
        std::fs::write(path("a.mtl"), format!("{used}{unused}")).unwrap();
        std::fs::write(path("a.obj"), "mtllib a.mtl\nusemtl used\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
            .unwrap();
        std::fs::write(path("scene.toml"), "[[object]]\nmesh = \"a.obj\"\n").unwrap();
        let _ = load_scene(&path("scene.toml"));
        for name in existing.iter().chain(&["part/missing.png", "missing.png"]) {
            assert!(INPUTS.contains(&path(name)), "{name}");
        }
        for name in ["shine.png", "off.png"] {
            assert!(!INPUTS.contains(&path(name)), "{name}");
        }
    }

    #[test]
    fn only_modified_files_that_were_added_and_lie_in_the_folder_count() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().canonicalize().unwrap().join(name);
        std::fs::create_dir(path("part")).unwrap();
        let inputs = Inputs::new();
        ["a.obj", "missing.obj"].iter().for_each(|name| inputs.add(&path(name)));
        for name in ["a.obj", "other.obj", "part/a.obj"] {
            std::fs::write(path(name), "").unwrap();
        }
        let modified = path("a.obj").metadata().unwrap().modified().unwrap();
        let later = modified + Duration::from_nanos(1_000);
        for (name, at, expected) in [("", modified, true), ("", later, false), ("part", modified, false)] {
            assert_eq!(inputs.modified_since(&path(name), at), expected, "{name} {at:?}");
        }
        inputs.add(&path("part/a.obj"));
        assert!(inputs.modified_since(&path("part"), SystemTime::UNIX_EPOCH));
    }

    #[test]
    #[cfg(unix)]
    fn a_link_is_added_with_the_file_to_which_it_leads() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().canonicalize().unwrap().join(name);
        ["own", "other"].iter().for_each(|name| std::fs::create_dir(path(name)).unwrap());
        std::fs::write(path("other/a.obj"), "").unwrap();
        std::os::unix::fs::symlink("../other/a.obj", path("own/link.obj")).unwrap();
        let inputs = Inputs::new();
        inputs.add(&path("own/../own/link.obj"));
        assert!(inputs.contains(&path("own/link.obj")) && inputs.contains(&path("other/a.obj")));
        assert_eq!(inputs.folders(), BTreeSet::from([path("other"), path("own")]));
    }

    #[test]
    #[cfg(unix)]
    fn a_link_that_is_replaced_leads_elsewhere_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().canonicalize().unwrap().join(name);
        for name in ["first", "second"] {
            std::fs::create_dir(path(name)).unwrap();
            std::fs::write(path(name).join("a.obj"), "").unwrap();
        }
        let link_to = |name: &str| {
            let _ = std::fs::remove_file(path("link"));
            std::os::unix::fs::symlink(name, path("link")).unwrap();
        };
        link_to("first");
        let inputs = Inputs::new();
        ["link/a.obj", "first/a.obj"].iter().for_each(|name| inputs.add(&path(name)));
        assert!(!inputs.lead_elsewhere());
        for target in ["second", "nothing", "first"] {
            link_to(target);
            assert_eq!([inputs.lead_elsewhere(), inputs.lead_elsewhere()], [true, false], "{target}");
        }
        inputs.add(&path("link/new.png"));
        std::fs::write(path("link/new.png"), "").unwrap();
        assert!(!inputs.lead_elsewhere(), "a new file is no new link");
        link_to("second");
        ["link/a.obj", "link/new.png"].iter().for_each(|name| inputs.add(&path(name)));
        assert!(!inputs.lead_elsewhere(), "the files to which the link now leads were read");
    }
}
