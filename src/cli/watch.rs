//! Repeats an action whenever a file changes.

use crate::error::{Error, Result, is_forbidden, limit_advice};
use crate::printer;
use crate::reader::{folder_of, in_canonical_folder};
use crate::scene::Inputs;
use notify::RecursiveMode;
use notify::{ErrorKind, EventKind, Watcher as _};
use std::collections::BTreeSet;
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel};
use std::time::{Duration, Instant, SystemTime};

/// Extensions of files whose changes count even if raycl has not read the files. Extensions of pictures are
/// not listed: a picture counts only if raycl has read it, for example as a texture. So raycl does not render
/// again when another command writes a picture.
const SOURCES: [&str; 10] = ["toml", "obj", "mtl", "ply", "stl", "gltf", "glb", "bin", "gz", "cl"];
/// Editors write a file in several steps. The changes count as complete when no file has changed for this time.
const QUIET: Duration = Duration::from_millis(80);
/// The remedy if the system watches no further folders for this user.
const MORE_WATCHES: &str = "the system may limit the number of watched files; on Linux, raise \
    fs.inotify.max_user_watches with sysctl";
/// The remedy if the system allows this user or this process no further watcher.
const MORE_WATCHERS: &str = "the system may limit the number of programs that watch files; on Linux, raise \
    fs.inotify.max_user_instances with sysctl";
/// The remedy if this process may not watch a folder.
const READABLE: &str = "a folder can be watched only if you may read it";
/// The remedy if a folder cannot be watched for another reason.
const BY_HAND: &str = "start the command again after each change of a file; leave out --watch if you gave it";
/// The interval at which a waiting command checks whether watched folders have been replaced.
const LOOK_UP: Duration = Duration::from_millis(500);

/// The files and folders that a command watches for changes.
pub struct Watched {
    /// Receives the time of each change of a watched file.
    changes: Receiver<Instant>,
    /// The time of the last change that has not been reported yet; `None` if every change has been reported.
    changed_at: Option<Instant>,
    /// The watcher. Files are watched until `watcher` is dropped.
    watcher: notify::RecommendedWatcher,
    /// The folders that are watched.
    folders: Vec<Folder>,
    /// The number of folders that were given to [`Watched::new`]. The given folders come first in `folders`;
    /// the folders of files that raycl has read follow.
    given: usize,
    /// The folders of files that raycl has read. Unless the system refuses, each of these folders is watched: by
    /// itself, or by the watch on a folder that was given to [`Watched::new`].
    of_inputs: BTreeSet<PathBuf>,
    /// The time of the last call of [`Self::follow`], which begins to watch the folders of the files that raycl has
    /// read; before the first call, the time of [`Self::new`]. Files that were read after this time may lie in folders
    /// that are not watched yet.
    since: SystemTime,
    inputs: &'static Inputs,
}

/// A folder that is watched.
struct Folder {
    /// The path as it was given, which may contain links.
    named: PathBuf,
    /// The canonical path of the folder to which `named` led when the watch began.
    path: PathBuf,
    depth: RecursiveMode,
    /// The identity of the folder when the watch began; `None` if the folder did not exist then.
    identity: Option<Identity>,
}

impl Watched {
    /// Watches all files of `inputs` (the files that raycl has read). In `folders`, and in the folders of the files
    /// that raycl has read, also watches other files whose extension is in `SOURCES`. If a folder's mode is recursive,
    /// the files in its subfolders are watched too. The files of `written`, which the command itself writes, are not
    /// watched.
    pub fn new(
        folders: &[(PathBuf, RecursiveMode)],
        written: &[PathBuf],
        inputs: &'static Inputs,
    ) -> Result<Self> {
        let mut folders: Vec<_> = folders
            .iter()
            .map(|(folder, depth)| {
                Ok(Folder { path: resolved(folder)?, ..Folder::new(folder.clone(), *depth) })
            })
            .collect::<Result<_>>()?;
        let (sender, changes) = channel();
        let written: Vec<PathBuf> = written.iter().filter_map(|path| in_canonical_folder(path)).collect();
        let tell = move |event: notify::Result<notify::Event>| {
            if event.is_ok_and(|event| matters(&event, &written, inputs)) {
                // Sending fails only if the receiver is gone, which happens only when the program ends.
                let _ = sender.send(Instant::now());
            }
        };
        let mut watcher = notify::recommended_watcher(tell).map_err(unwatchable)?;
        if let Err(error) = check_thread(&changes) {
            // If the system refused the watcher's thread, dropping the watcher would cause a panic, so the watcher is
            // never dropped.
            std::mem::forget(watcher);
            return Err(error);
        }
        for folder in &mut folders {
            folder.watch(&mut watcher).map_err(unwatchable)?;
        }
        let (given, of_inputs, since) = (folders.len(), BTreeSet::new(), SystemTime::now());
        Ok(Self { changes, changed_at: None, watcher, folders, given, of_inputs, since, inputs })
    }

    /// Returns true if a file has changed since the function last returned true, and no file has changed for
    /// the time `QUIET`. The function does not wait, so that a viewer obeys its user even while a large file
    /// is being written.
    pub fn has_changed(&mut self) -> bool {
        self.follow();
        is_complete(&self.changes, &mut self.changed_at, Instant::now())
    }

    /// Begins to watch again the folders that have been replaced since the last call; each replacement counts as a
    /// change. A folder also counts as replaced if a link in its path now leads to another folder. The function also
    /// begins to watch the folders of files that have been read since the last call. If one of these files was modified
    /// after the last call, but before its folder was watched, this modification counts as a change too. A change is
    /// also counted if a link in the path of any file that raycl has read now leads elsewhere. The folder to which the
    /// link now leads is watched once the file has been read again.
    fn follow(&mut self) {
        if self.inputs.lead_elsewhere() {
            self.changed_at = Some(Instant::now());
        }
        for folder in &mut self.folders {
            if folder.identity != identity(&folder.named) {
                // The watch on the replaced folder may have ended together with that folder. If the folder is
                // missing now, watching fails, and a later call watches the folder once it exists.
                let _ = self.watcher.unwatch(&folder.path);
                let _ = folder.watch(&mut self.watcher);
                self.changed_at = Some(Instant::now());
            }
        }
        // Each new folder is compared only with the folders that were given to `new`. The folders of `inputs` contain
        // no duplicates, so a new folder cannot be equal to one of the other watched folders.
        let of_inputs = self.inputs.folders();
        for path in of_inputs.difference(&self.of_inputs) {
            if !self.folders[..self.given].iter().any(|watched| watched.covers(path)) {
                let mut folder = Folder::new(path.clone(), RecursiveMode::NonRecursive);
                // If a folder cannot be watched, the other folders are still watched.
                let _ = folder.watch(&mut self.watcher);
                self.folders.push(folder);
                if self.inputs.modified_since(path, self.since) {
                    self.changed_at = Some(Instant::now());
                }
            }
        }
        (self.of_inputs, self.since) = (of_inputs, SystemTime::now());
    }

    /// Waits for a change, then waits until no file has changed for the time `QUIET`, and returns true.
    /// Returns false if no more changes can come.
    fn next_change(&mut self) -> bool {
        while self.changed_at.take().is_none() {
            match self.changes.recv_timeout(LOOK_UP) {
                Ok(at) => self.changed_at = Some(at),
                Err(RecvTimeoutError::Timeout) => self.follow(),
                Err(RecvTimeoutError::Disconnected) => return false,
            }
        }
        quiet(&self.changes)
    }
}

impl Folder {
    /// Returns a folder that is not watched yet.
    fn new(named: PathBuf, depth: RecursiveMode) -> Self {
        Self { path: named.clone(), named, depth, identity: None }
    }

    /// Begins to watch the folder to which the path `named` now leads. If there is no such folder, the last known path
    /// stays.
    fn watch(&mut self, watcher: &mut notify::RecommendedWatcher) -> notify::Result<()> {
        // If the folder is replaced after this line, the next comparison of identities detects the replacement.
        self.identity = identity(&self.named);
        if let Ok(path) = self.named.canonicalize() {
            self.path = path;
        }
        watcher.watch(&self.path, self.depth)
    }

    /// Returns true if the watch on this folder includes `folder`: the same folder or, if the watch is
    /// recursive, a folder inside it.
    fn covers(&self, folder: &Path) -> bool {
        let Self { path, depth, .. } = self;
        path == folder || *depth == RecursiveMode::Recursive && folder.starts_with(path)
    }
}

/// The properties that distinguish a folder from another folder that later gets the same path: the number of
/// the disk, the number of the folder on the disk, and the time of the folder's creation. The time of
/// creation is needed because a file system may give a new folder the number (inode) of a removed folder.
type Identity = ([u64; 2], Option<SystemTime>);

/// Returns the identity of the folder that now has the path `folder`; `None` if there is no such folder.
fn identity(folder: &Path) -> Option<Identity> {
    let metadata = folder.metadata().ok()?;
    Some((numbers(&metadata), metadata.created().ok()))
}

/// Returns the number of the disk with the folder, and the number of the folder on this disk.
#[cfg(unix)]
fn numbers(metadata: &Metadata) -> [u64; 2] {
    use std::os::unix::fs::MetadataExt as _;
    [metadata.dev(), metadata.ino()]
}

/// On systems other than Unix, only the time of creation distinguishes folders.
#[cfg(not(unix))]
fn numbers(_: &Metadata) -> [u64; 2] {
    [0; 2]
}

/// Returns the canonical path of a folder. The path by which a folder is watched must be canonical: the paths in events
/// begin with the folder's path, and are compared with canonical paths. Returns an error if the folder cannot be read.
fn resolved(folder: &Path) -> Result<PathBuf> {
    folder.canonicalize().map_err(|error| {
        let otherwise = "check the path of the scene, and that of --cl-dir if it is given";
        Error::unreadable_folder(folder, &error, otherwise)
    })
}

/// Returns the error for files that cannot be watched. The remedy fits the reason, which `error` states.
fn unwatchable(mut error: notify::Error) -> Error {
    let what = match std::mem::take(&mut error.paths).first() {
        Some(folder) => format!("the folder `{}`", folder.display()),
        None => "files".to_owned(),
    };
    let remedy = match &error.kind {
        ErrorKind::MaxFilesWatch => MORE_WATCHES.to_owned(),
        ErrorKind::Io(refused) if is_forbidden(refused) => READABLE.to_owned(),
        ErrorKind::Io(refused) => {
            limit_advice(refused).map_or(BY_HAND.to_owned(), |advice| format!("{MORE_WATCHERS}; or {advice}"))
        }
        _ => BY_HAND.to_owned(),
    };
    let why = error.to_string();
    Error::run(format!("{what} cannot be watched: {}", why.trim_end_matches('.'))).with_help(remedy)
}

/// Returns the folders that are watched from the start: the scene's folder without its subfolders, and the
/// folder of kernels with its subfolders.
pub fn folders(scene: &Path, kernels: Option<&Path>) -> Vec<(PathBuf, RecursiveMode)> {
    let of_scene = (folder_of(scene).to_owned(), RecursiveMode::NonRecursive);
    let of_kernels = kernels.map(|folder| (folder.to_owned(), RecursiveMode::Recursive));
    std::iter::once(of_scene).chain(of_kernels).collect()
}

/// Calls `action` once, and again after every change of a watched file. If an action fails, the error is
/// printed and the loop continues, since the next change of a file may correct the mistake. Unless `quiet` is
/// set, prints a line before each wait for a change.
pub fn watch(mut watched: Watched, quiet: bool, mut action: impl FnMut() -> Result<()>) -> Result<()> {
    loop {
        let done = action();
        watched.follow();
        if let Err(error) = done {
            printer::tell(format!("{:?}", miette::Report::new(error)));
        }
        if !quiet {
            printer::tell("waiting until a file changes (Ctrl-C ends raycl)");
        }
        if !watched.next_change() {
            return Ok(());
        }
    }
}

/// Returns true if `event` is a change of a file that raycl has read or whose extension is in `SOURCES`.
/// Changes of the files in `written`, such as the picture itself, do not count.
fn matters(event: &notify::Event, written: &[PathBuf], inputs: &Inputs) -> bool {
    let changes = matches!(event.kind, EventKind::Create(_) | EventKind::Modify(_) | EventKind::Remove(_));
    let source = |path: &PathBuf| !written.contains(path) && (is_source(path) || inputs.contains(path));
    changes && event.paths.iter().any(source)
}

fn is_source(path: &Path) -> bool {
    path.extension().is_some_and(|ending| SOURCES.iter().any(|usual| ending.eq_ignore_ascii_case(usual)))
}

/// Returns true if a file has changed, and no file has changed for the time `QUIET` before `now`. `changed_at` is the
/// time of the latest change that earlier calls have found. If `changes` has a later change, this function stores the
/// time of that change in `changed_at`. If this function returns true, it sets `changed_at` to `None`.
fn is_complete(changes: &Receiver<Instant>, changed_at: &mut Option<Instant>, now: Instant) -> bool {
    *changed_at = changes.try_iter().last().or(*changed_at);
    changed_at.take_if(|at| now.duration_since(*at) >= QUIET).is_some()
}

/// Returns an error if the system has refused the thread of the watcher that sends `changes`. If the thread
/// is refused, the crate notify reports no error, but panics when the watcher is used. If the thread does not
/// exist, the sender of `changes` has been dropped, which this function detects.
fn check_thread(changes: &Receiver<Instant>) -> Result<()> {
    match changes.try_recv() {
        Err(TryRecvError::Disconnected) => {
            let refused = std::io::Error::other("the system refused it");
            Err(Error::not_started("the thread that watches files", &refused))
        }
        _ => Ok(()),
    }
}

/// Waits until no file has changed for the time `QUIET`, and returns true. Returns false if no more changes
/// can come.
fn quiet(changes: &Receiver<Instant>) -> bool {
    loop {
        match changes.recv_timeout(QUIET) {
            Ok(_) => {}
            Err(RecvTimeoutError::Timeout) => return true,
            Err(RecvTimeoutError::Disconnected) => return false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The longest wait for a change. A test reaches this limit only if it hangs.
    const LIMIT: Duration = Duration::from_secs(120);

    /// Watches a folder in a thread. The function `watch` calls an action at the start and after each change
    /// of a file. The returned receiver gets a message for each call of the action except the first.
    fn watching(folder: PathBuf) -> Receiver<()> {
        static INPUTS: Inputs = Inputs::new();
        let (sender, seen) = channel();
        std::thread::spawn(move || {
            let watched = Watched::new(&[(folder, RecursiveMode::NonRecursive)], &[], &INPUTS)?;
            watch(watched, true, move || sender.send(()).map_err(|_| Error::run("over")))
        });
        assert!(seen.recv_timeout(LIMIT).is_ok(), "it acts at the start");
        seen
    }

    #[test]
    fn scenes_meshes_materials_and_kernels_are_sources_and_pictures_are_not() {
        let is_source = |ending: &str| is_source(&Path::new("a").with_extension(ending));
        assert!("toml obj mtl ply stl gltf glb bin gz cl OBJ".split(' ').all(is_source));
        assert!(!"png jpg exr hdr txt".split(' ').any(is_source));
    }

    #[test]
    fn a_watcher_whose_thread_the_system_has_refused_is_an_error() {
        let (sender, changes) = channel();
        assert!(check_thread(&changes).is_ok());
        drop(sender);
        let error = check_thread(&changes).expect_err("there is no thread");
        let expected = "the thread that watches files could not be started: the system refused it";
        assert_eq!(error.to_string(), expected);
        assert!(error.exit_code() == 1 && error.remedy().contains("`ulimit -u`"), "{}", error.remedy());
    }

    #[cfg(unix)]
    #[test]
    fn what_cannot_be_watched_is_named_with_the_remedy_for_the_reason() {
        use rustix::io::Errno;
        let refused =
            |errno: Errno| notify::Error::io(std::io::Error::from_raw_os_error(errno.raw_os_error()));
        let of = |error: notify::Error| {
            let error = unwatchable(error);
            (error.to_string(), error.remedy().to_owned())
        };
        let (message, remedy) = of(refused(Errno::MFILE));
        assert!(message.starts_with("files cannot be watched: ") && message.ends_with("24)"), "{message}");
        assert!(remedy.contains("max_user_instances") && remedy.contains("`ulimit -n 1024`"), "{remedy}");
        let (message, remedy) = of(refused(Errno::ACCESS).add_path("a/b".into()));
        assert!(message.starts_with("the folder `a/b` cannot be watched: "), "{message}");
        assert_eq!(remedy, READABLE);
        let (message, remedy) = of(notify::Error::new(ErrorKind::MaxFilesWatch).add_path("a".into()));
        assert_eq!(message, "the folder `a` cannot be watched: OS file watch limit reached");
        assert_eq!(remedy, MORE_WATCHES);
        assert_eq!(of(refused(Errno::NOSYS)).1, BY_HAND);
    }

    #[test]
    fn an_edited_scene_is_noticed_and_a_picture_is_not() {
        let folder = tempfile::tempdir().expect("a folder");
        let seen = watching(folder.path().to_owned());
        std::fs::write(folder.path().join("picture.png"), "png").expect("it writes");
        assert!(seen.recv_timeout(Duration::from_millis(400)).is_err(), "a picture is no source");
        std::fs::write(folder.path().join("SCENE.TOML"), "changed").expect("it writes");
        assert!(seen.recv_timeout(LIMIT).is_ok(), "a change is noticed");
    }

    /// Changes a file again and again until the watcher reacts, that is, until `acts` returns true.
    fn change_until(path: &Path, mut acts: impl FnMut() -> bool) {
        let start = Instant::now();
        while !acts() {
            assert!(start.elapsed() < LIMIT, "a change of {} is not noticed", path.display());
            std::fs::write(path, "changed").expect("it writes");
            std::thread::sleep(2 * QUIET);
        }
    }

    #[test]
    fn a_folder_that_was_removed_or_renamed_is_watched_again_when_it_exists_again() {
        let folder = tempfile::tempdir().expect("a folder");
        for renames in [false, true] {
            let path = folder.path().join(format!("renamed-{renames}"));
            std::fs::create_dir(&path).expect("a folder");
            let seen = watching(path.clone());
            let other = folder.path().join("other");
            let gone = if renames { std::fs::rename(&path, other) } else { std::fs::remove_dir(&path) };
            gone.expect("the folder goes away");
            std::fs::create_dir(&path).expect("another folder");
            // The removal of the folder and its return cause at most two actions, so at least the third
            // action is caused by a change of the file in the new folder.
            for _ in 0..3 {
                change_until(&path.join("scene.toml"), || seen.try_recv().is_ok());
            }
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_that_leads_to_another_folder_is_followed() {
        static INPUTS: Inputs = Inputs::new();
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().canonicalize().expect("it exists").join(name);
        let link_to = |name| std::os::unix::fs::symlink(path(name), path("link")).expect("a link");
        ["a", "b"].iter().for_each(|name| std::fs::create_dir(path(name)).expect("a folder"));
        link_to("a");
        let given = [(path("link"), RecursiveMode::NonRecursive)];
        let mut watched = Watched::new(&given, &[], &INPUTS).expect("it watches");
        let mut followed = || {
            watched.follow();
            (watched.folders[0].path.clone(), watched.changed_at.take().is_some())
        };
        assert_eq!(followed(), (path("a"), false));
        std::fs::remove_file(path("link")).expect("the link goes away");
        assert_eq!(followed(), (path("a"), true));
        link_to("b");
        assert_eq!([followed(), followed()], [(path("b"), true), (path("b"), false)]);
    }

    /// The folder that contains the link is not watched, so no event reports that the link was replaced.
    #[cfg(unix)]
    #[test]
    fn a_link_in_the_path_of_a_file_that_leads_elsewhere_is_a_change() {
        static INPUTS: Inputs = Inputs::new();
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        let link_to = |name| std::os::unix::fs::symlink(path(name), path("link")).expect("a link");
        for name in ["a", "b"] {
            std::fs::create_dir(path(name)).expect("a folder");
            std::fs::write(path(name).join("mesh.obj"), "").expect("it writes");
        }
        link_to("a");
        INPUTS.add(&path("link/mesh.obj"));
        let mut watched = Watched::new(&[], &[], &INPUTS).expect("it watches");
        watched.follow();
        watched.changed_at = None;
        std::fs::remove_file(path("link")).expect("the link goes away");
        link_to("b");
        for expected in [true, false] {
            watched.follow();
            assert_eq!(watched.changed_at.take().is_some(), expected);
        }
    }

    #[test]
    fn files_of_other_folders_are_watched_once_they_are_read() {
        static INPUTS: Inputs = Inputs::new();
        let [scene, other] = [0; 2].map(|_| tempfile::tempdir().expect("a folder"));
        let folder = scene.path().to_owned();
        let texture = other.path().join("wood.png");
        let read = texture.clone();
        let (sender, seen) = channel();
        std::thread::spawn(move || {
            let watched = Watched::new(&[(folder, RecursiveMode::NonRecursive)], &[], &INPUTS)?;
            watch(watched, true, move || {
                INPUTS.add(&read);
                sender.send(()).map_err(|_| Error::run("over"))
            })
        });
        assert!(seen.recv_timeout(LIMIT).is_ok(), "it acts at the start");
        change_until(&texture, || seen.try_recv().is_ok());
    }

    #[test]
    fn a_folder_of_files_that_were_read_is_added_once_and_not_beside_a_given_folder() {
        static INPUTS: Inputs = Inputs::new();
        let [scene, other] = [0; 2].map(|_| tempfile::tempdir().expect("a folder"));
        let given = [(scene.path().to_owned(), RecursiveMode::NonRecursive)];
        let mut watched = Watched::new(&given, &[], &INPUTS).expect("it watches");
        for path in [scene.path().join("a.png"), other.path().join("b.png"), other.path().join("c.png")] {
            INPUTS.add(&path);
            watched.follow();
        }
        let other = other.path().canonicalize().expect("a folder");
        assert_eq!(watched.folders.iter().skip(1).map(|folder| &folder.path).collect::<Vec<_>>(), [&other]);
        assert_eq!((watched.given, watched.of_inputs.len()), (1, 2));
    }

    #[test]
    fn a_file_that_was_modified_before_its_folder_was_watched_has_changed() {
        static INPUTS: Inputs = Inputs::new();
        let folders = [0; 2].map(|_| tempfile::tempdir().expect("a folder"));
        let mut watched = Watched::new(&[], &[], &INPUTS).expect("it watches");
        let (start, day) = (watched.since, Duration::from_secs(86_400));
        for (folder, modified, counts) in
            [(&folders[0], start - day, false), (&folders[1], start + day, true)]
        {
            let path = folder.path().join("wood.png");
            let file = std::fs::File::create(&path).expect("a file");
            file.set_modified(modified).expect("its time is set");
            INPUTS.add(&path);
            for expected in [counts, false] {
                watched.follow();
                assert_eq!(watched.changed_at.take().is_some(), expected, "{modified:?} {start:?}");
            }
        }
        watched.since = SystemTime::UNIX_EPOCH;
        watched.follow();
        assert_ne!(
            watched.since,
            SystemTime::UNIX_EPOCH,
            "older changes of the next folder's files do not count"
        );
    }

    #[test]
    fn a_written_file_is_left_out_even_if_it_was_read() {
        static INPUTS: Inputs = Inputs::new();
        let folder = tempfile::tempdir().expect("a folder");
        let [texture, picture] = ["wood.png", "picture.png"].map(|name| folder.path().join(name));
        let folders = folders(&folder.path().join("scene.toml"), None);
        let written = [picture.clone()];
        let mut watched = Watched::new(&folders, &written, &INPUTS).expect("it watches");
        INPUTS.add(&texture);
        INPUTS.add(&picture);
        std::fs::write(&picture, "png").expect("it writes");
        std::thread::sleep(Duration::from_millis(400));
        assert!(!watched.has_changed(), "a picture that it writes is no source");
        change_until(&texture, || watched.has_changed());
    }

    #[test]
    fn a_folder_is_watched_with_its_subfolders_if_this_is_asked_for() {
        static INPUTS: Inputs = Inputs::new();
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().canonicalize().expect("it exists");
        for (depth, covers) in [(RecursiveMode::NonRecursive, false), (RecursiveMode::Recursive, true)] {
            let watched = Watched::new(&[(path.clone(), depth)], &[], &INPUTS).expect("it can be watched");
            assert_eq!(watched.folders[0].covers(&path.join("cast")), covers);
        }
    }

    #[test]
    fn a_missing_folder_is_a_mistake_that_names_it() {
        static INPUTS: Inputs = Inputs::new();
        let folder = tempfile::tempdir().expect("a folder");
        let missing = folder.path().join("missing");
        let scene = folders(&missing.join("scene.toml"), None);
        let kernels = folders(&folder.path().join("scene.toml"), Some(&missing));
        for folders in [scene, kernels] {
            let error = Watched::new(&folders, &[], &INPUTS).err().expect("a folder is missing");
            let message = error.to_string();
            assert_eq!(error.exit_code(), 2, "{message}");
            assert!(
                message.starts_with(&format!("cannot read the folder `{}`: ", missing.display())),
                "{message}"
            );
            assert!(error.remedy().starts_with("check the path of the scene"), "{}", error.remedy());
        }
        // The error's remedy suggests the folder `misssing`. The remedy does not suggest `missin`, whose name
        // is equally similar to `missing`, because `missin` is a file.
        std::fs::write(folder.path().join("missin"), "").expect("a file");
        let meant = folder.path().join("misssing");
        std::fs::create_dir(&meant).expect("a folder");
        let error = resolved(&missing).expect_err("the folder is missing");
        assert_eq!(error.remedy(), format!("did you mean `{}`?", meant.display()));
    }

    #[test]
    fn a_folder_is_watched_with_another_only_if_it_is_the_same_or_below_it() {
        let covers =
            |watched: &str, depth, folder: &str| Folder::new(watched.into(), depth).covers(Path::new(folder));
        assert!(covers("/a", RecursiveMode::NonRecursive, "/a"));
        assert!(!covers("/a", RecursiveMode::NonRecursive, "/a/b"));
        assert!(covers("/a", RecursiveMode::Recursive, "/a/b"));
        assert!(!covers("/a", RecursiveMode::Recursive, "/ab"));
    }

    #[test]
    fn a_file_that_is_being_written_has_changed_when_it_is_complete() {
        let (sender, changes) = channel();
        let (start, mut changed_at) = (Instant::now(), None);
        let at = |ms| start + Duration::from_millis(ms);
        let mut is_complete = |ms| is_complete(&changes, &mut changed_at, at(ms));
        assert!(!is_complete(1000), "nothing has changed");
        for ms in [1010, 1020] {
            sender.send(at(ms)).expect("a change");
        }
        assert!(!is_complete(1050));
        sender.send(at(1060)).expect("a change");
        assert_eq!([1100, 1139, 1140, 1300].map(&mut is_complete), [false, false, true, false]);
        sender.send(at(1310)).expect("a change");
        assert!(is_complete(2000), "a second change");
    }

    #[test]
    fn the_steps_of_one_change_are_one_action() {
        static INPUTS: Inputs = Inputs::new();
        let (sender, changes) = channel();
        let mut watched = Watched::new(&[], &[], &INPUTS).expect("it watches");
        watched.changes = changes;
        for _ in 0..3 {
            sender.send(Instant::now()).expect("a change");
        }
        assert!(watched.next_change());
        assert!(watched.changes.try_recv().is_err(), "all three messages belong to one change");
        drop(sender);
        assert!(!watched.next_change(), "no sender is left, so no more changes can come");
    }
}
