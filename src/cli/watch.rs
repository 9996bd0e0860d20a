//! Repeats an action whenever a file changes.

use crate::error::{Error, Result};
use crate::printer;
use notify::RecursiveMode;
use notify::{EventKind, Watcher as _};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// Extensions of files that affect the picture.
const SOURCES: [&str; 10] = ["toml", "obj", "mtl", "ply", "stl", "gltf", "glb", "bin", "gz", "cl"];
/// Editors write a file in several steps; it is complete this long after the last of them.
const QUIET: Duration = Duration::from_millis(80);

/// Files that are watched.
pub struct Watched {
    changes: Receiver<()>,
    /// The watcher, which ends when this is dropped.
    _watcher: notify::RecommendedWatcher,
}

impl Watched {
    /// Watches the source files in `folders`, or also below them.
    pub fn new(folders: &[(PathBuf, RecursiveMode)]) -> Result<Self> {
        let failed = |error: notify::Error| {
            Error::run(format!("files cannot be watched: {error}")).with_help("render without --watch")
        };
        let (sender, changes) = channel();
        let tell = move |event: notify::Result<notify::Event>| {
            if event.is_ok_and(|event| matters(&event)) {
                // The receiver is gone only when the program ends.
                let _ = sender.send(());
            }
        };
        let mut watcher = notify::recommended_watcher(tell).map_err(failed)?;
        for (folder, depth) in folders {
            watcher.watch(folder, *depth).map_err(failed)?;
        }
        Ok(Self { changes, _watcher: watcher })
    }

    /// Returns whether a file has changed since the last call. If so, the pause after the change is over too.
    pub fn has_changed(&self) -> bool {
        self.changes.try_recv().is_ok() && quiet(&self.changes)
    }
}

/// Returns the folders whose files affect a picture: the folder of its scene, and the folder of kernels.
pub fn folders(scene: &Path, kernels: Option<&Path>) -> Vec<(PathBuf, RecursiveMode)> {
    let folder = scene.parent().filter(|folder| !folder.as_os_str().is_empty());
    let of_scene = (folder.unwrap_or(Path::new(".")).to_owned(), RecursiveMode::NonRecursive);
    let of_kernels = kernels.map(|folder| (folder.to_owned(), RecursiveMode::Recursive));
    std::iter::once(of_scene).chain(of_kernels).collect()
}

/// Acts once, then again after every change to a source file in `folders`, or also below them. A failed
/// action is reported and does not end the loop, since the next change may correct the mistake. Unless it is
/// `quiet`, it says each time that it waits.
pub fn watch(
    folders: &[(PathBuf, RecursiveMode)],
    quiet: bool,
    mut action: impl FnMut() -> Result<()>,
) -> Result<()> {
    let watched = Watched::new(folders)?;
    loop {
        if let Err(error) = action() {
            printer::tell(format!("{:?}", miette::Report::new(error)));
        }
        super::tell(quiet, "waiting for a change (Ctrl-C ends)")?;
        if !next_change(&watched.changes) {
            return Ok(());
        }
    }
}

/// Returns whether an event changes a source of the picture. The picture itself, in the same folder, does not
/// count.
fn matters(event: &notify::Event) -> bool {
    let changes = matches!(event.kind, EventKind::Create(_) | EventKind::Modify(_) | EventKind::Remove(_));
    let source = |path: &PathBuf| is_source(path);
    changes && event.paths.iter().any(source)
}

fn is_source(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str());
    extension.is_some_and(|extension| SOURCES.contains(&extension))
}

/// Waits for a change, and then until changes have paused; returns false if no more changes can come.
fn next_change(changes: &Receiver<()>) -> bool {
    changes.recv().is_ok() && quiet(changes)
}

/// Waits for the pause after a change; returns false if no more changes can come.
fn quiet(changes: &Receiver<()>) -> bool {
    loop {
        match changes.recv_timeout(QUIET) {
            Ok(()) => {}
            Err(RecvTimeoutError::Timeout) => return true,
            Err(RecvTimeoutError::Disconnected) => return false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Only reached if the test hangs.
    const LIMIT: Duration = Duration::from_secs(120);

    #[test]
    fn an_edited_scene_is_noticed_and_a_picture_is_not() {
        let folder = tempfile::tempdir().expect("a folder");
        let place = folder.path().to_owned();
        let (told, seen) = channel();
        std::thread::spawn(move || {
            watch(&[(place, RecursiveMode::NonRecursive)], true, move || {
                told.send(()).map_err(|_| Error::run("over"))
            })
        });
        assert!(seen.recv_timeout(LIMIT).is_ok(), "it acts at the start");
        std::fs::write(folder.path().join("picture.png"), "png").expect("it writes");
        assert!(seen.recv_timeout(Duration::from_millis(400)).is_err(), "a picture is no source");
        std::fs::write(folder.path().join("scene.toml"), "changed").expect("it writes");
        assert!(seen.recv_timeout(LIMIT).is_ok(), "a change is noticed");
    }

    #[test]
    fn the_steps_of_one_change_are_one_action() {
        let (sender, changes) = channel();
        for _ in 0..3 {
            sender.send(()).expect("a change");
        }
        assert!(next_change(&changes));
        assert!(changes.try_recv().is_err(), "all three belong to it");
        drop(sender);
        assert!(!next_change(&changes), "nobody is left who could change anything");
    }
}
