//! The files from which scenes are read. Commands that render a scene again after a change watch these files.

use crate::reader::in_canonical_folder;
use crate::threads::locked;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use std::time::SystemTime;

/// The files of all scenes that this process has read.
pub(crate) static INPUTS: Inputs = Inputs::new();

/// Paths of files that were read, or that would have been read if they existed.
#[derive(Debug)]
pub(crate) struct Inputs(Mutex<BTreeSet<PathBuf>>);

impl Inputs {
    /// Returns an empty list.
    pub const fn new() -> Self {
        Self(Mutex::new(BTreeSet::new()))
    }

    /// Adds a file's path, with a canonical folder. If the path is a link, adds the link's target too.
    pub fn add(&self, path: &Path) {
        let names = [in_canonical_folder(path), path.canonicalize().ok()];
        self.held().extend(names.into_iter().flatten());
    }

    /// Returns true if the file was added. The folder in `path` must be canonical.
    pub fn contains(&self, path: &Path) -> bool {
        self.held().contains(path)
    }

    /// Returns the folders of the files.
    pub fn folders(&self) -> BTreeSet<PathBuf> {
        self.held().iter().filter_map(|path| path.parent()).map(Path::to_owned).collect()
    }

    /// Returns true if a file of this folder was added and has been modified at or after the time `since`. The path of
    /// the folder must be canonical.
    pub fn modified_since(&self, folder: &Path, since: SystemTime) -> bool {
        let modified = |path: &PathBuf| path.metadata().and_then(|metadata| metadata.modified());
        let is_later = |path: &PathBuf| modified(path).is_ok_and(|at| at >= since);
        self.held().iter().any(|path| path.parent() == Some(folder) && is_later(path))
    }

    fn held(&self) -> MutexGuard<'_, BTreeSet<PathBuf>> {
        locked(&self.0)
    }
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
}
