//! Finds the git commit that is checked out in the repository of a file or a folder, and whether the file or folder has
//! been changed since this commit.
//!
//! The repository may come from a stranger. The file `.git/config` of a repository can name programs that git runs when
//! it reads the index (`core.fsmonitor`), converts a file (`filter.NAME.clean`) or fetches an object that is missing
//! (`remote.NAME`). The commands of this module read no index, convert nothing and fetch nothing, so git runs none of
//! these programs.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};

/// The state of a file or folder that the commit does not contain.
const IN_NO_COMMIT: &str = "in no commit";

/// Environment variables that would make git use another repository than that of the folder in which git starts.
/// Some of these variables would make git use this folder's repository, but with another index, other objects or
/// another tree of files. Git sets some of these variables for hooks.
const REDIRECTIONS: [&str; 6] = [
    "GIT_DIR",
    "GIT_WORK_TREE",
    "GIT_COMMON_DIR",
    "GIT_INDEX_FILE",
    "GIT_OBJECT_DIRECTORY",
    "GIT_ALTERNATE_OBJECT_DIRECTORIES",
];

/// Returns the commit and the state of a file: "0123456789ab, unchanged", "0123456789ab, changed since" or "in no
/// commit". Returns `None` if there is no such file, if no repository with a commit contains the file, or if git is not
/// installed. A file that git converts at checkout always counts as changed, for example a file with converted line
/// ends, or a file in Git LFS. (This function does not convert the file back, since git may run a program to do so.)
pub fn git_state(file: &Path) -> Option<String> {
    let file = file.canonicalize().ok()?;
    let (folder, name) = (file.parent()?, file.file_name()?);
    let commit = commit(folder)?;
    let mut object = OsString::from("HEAD:./");
    object.push(name);
    let Some(committed) = answer(git(folder).args(["rev-parse", "--verify", "--quiet"]).arg(object)) else {
        return Some(IN_NO_COMMIT.to_owned());
    };
    let present = answer(hash_object(folder).arg(name));
    Some(state(&commit, present == Some(committed)))
}

/// Returns the commit and the state of a folder, like [`git_state`]. Of the files in the folder and its subfolders,
/// only those with the extension `extension` (without a dot) count. `files` contains the names of these files:
/// their paths relative to the folder, with `/` as separator. A file that is a symbolic link always counts as
/// changed, since the commit contains only the link.
pub fn git_state_of_folder(folder: &Path, files: &[String], extension: &str) -> Option<String> {
    let commit = commit(folder)?;
    let tree = answer(git(folder).args(["ls-tree", "-r", "-z", "HEAD"]))?;
    let has_extension = |name: &str| Path::new(name).extension().is_some_and(|own| own == extension);
    let committed: BTreeMap<&str, &str> =
        tree.split('\0').filter_map(entry).filter(|(name, _)| has_extension(name)).collect();
    if committed.is_empty() {
        return Some(IN_NO_COMMIT.to_owned());
    }
    // If git cannot read one of the files, `hashes` is empty.
    let hashes = answer(hash_object(folder).args(files)).unwrap_or_default();
    let present: BTreeMap<&str, &str> = files.iter().map(String::as_str).zip(hashes.lines()).collect();
    Some(state(&commit, present == committed))
}

fn state(commit: &str, is_unchanged: bool) -> String {
    format!("{commit}, {}", if is_unchanged { "unchanged" } else { "changed since" })
}

/// Returns the name and the hash of a file in a line of `git ls-tree`: mode, kind and hash, separated by spaces, then a
/// tab and the name.
fn entry(line: &str) -> Option<(&str, &str)> {
    let (about, name) = line.split_once('\t')?;
    Some((name, about.rsplit(' ').next()?))
}

fn commit(folder: &Path) -> Option<String> {
    answer(git(folder).args(["rev-parse", "--short=12", "HEAD"]))
}

/// Returns a command that prints the hash of each file whose name is added to it. The files are not converted.
fn hash_object(folder: &Path) -> Command {
    let mut command = git(folder);
    command.args(["hash-object", "--no-filters", "--"]);
    command
}

/// Returns a git command for the repository of a folder. The command fetches nothing, because its list of
/// allowed protocols is empty. An empty list forbids even the protocols that the repository's configuration
/// allows.
fn git(folder: &Path) -> Command {
    let mut command = Command::new("git");
    for name in REDIRECTIONS {
        command.env_remove(name);
    }
    command.env("GIT_ALLOW_PROTOCOL", "").env("GIT_NO_LAZY_FETCH", "1");
    command.args(["-c", "core.fsmonitor=false", "-C"]).arg(folder);
    command
}

/// Returns the output of a git command; `None` if git is missing or the command fails.
fn answer(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::OsStr;

    /// Runs a git command that must succeed.
    fn run(folder: &Path, arguments: &[&str]) {
        let identity = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"];
        answer(git(folder).args(identity).args(arguments)).unwrap_or_else(|| panic!("git {arguments:?}"));
    }

    /// Makes a repository whose only commit contains these files, with their names as texts.
    fn repository(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        files.iter().for_each(|name| write(&folder, name, name));
        run(folder.path(), &["init", "-q"]);
        run(folder.path(), &["add", "."]);
        run(folder.path(), &["commit", "-q", "--allow-empty", "-m", "a"]);
        folder
    }

    fn write(folder: &tempfile::TempDir, name: &str, text: &str) {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, text).expect("it writes");
    }

    /// Returns the state after the commit's hash; `None` outside a repository.
    fn without_commit(state: Option<String>) -> Option<String> {
        state.map(|state| state.split_once(", ").map_or(state.clone(), |(_, state)| state.to_owned()))
    }

    fn of_file(folder: &tempfile::TempDir, name: &str) -> Option<String> {
        without_commit(git_state(&folder.path().join(name)))
    }

    #[test]
    fn a_file_is_unchanged_changed_or_in_no_commit() {
        let outside = tempfile::tempdir().expect("a folder");
        write(&outside, "a.toml", "one");
        assert_eq!(of_file(&outside, "a.toml"), None, "there is no repository");
        let folder = repository(&["a.toml", "inner/b..c.toml"]);
        write(&folder, "new.toml", "new");
        run(folder.path(), &["add", "new.toml"]);
        let states =
            || ["a.toml", "inner/b..c.toml", "new.toml"].map(|name| of_file(&folder, name).expect("git"));
        assert_eq!(states(), ["unchanged", "unchanged", IN_NO_COMMIT]);
        write(&folder, "a.toml", "other");
        assert_eq!(states(), ["changed since", "unchanged", IN_NO_COMMIT]);
        run(folder.path(), &["add", "a.toml"]);
        assert_eq!(states()[0], "changed since", "a staged change");
        let commit = git_state(&folder.path().join("a.toml")).expect("git");
        assert_eq!(commit.find(','), Some(12), "{commit}");
    }

    #[test]
    fn a_folder_is_changed_by_changed_new_and_removed_files_of_its_kind() {
        let folder = repository(&["kernels/a.cl", "kernels/inner/b.cl", "kernels/notes.txt", "c.cl"]);
        let state = |folder: &Path, files: &[&str]| {
            let files: Vec<String> = files.iter().map(|name| (*name).to_owned()).collect();
            without_commit(git_state_of_folder(folder, &files, "cl")).expect("git")
        };
        let kernels = folder.path().join("kernels");
        let of_kernels = |files: &[&str]| state(&kernels, files);
        assert_eq!(of_kernels(&["a.cl", "inner/b.cl"]), "unchanged");
        assert_eq!(of_kernels(&["a.cl"]), "changed since", "a file was removed");
        write(&folder, "kernels/notes.txt", "other");
        write(&folder, "kernels/new.cl", "new");
        assert_eq!(of_kernels(&["a.cl", "inner/b.cl"]), "unchanged", "a text is no kernel");
        assert_eq!(of_kernels(&["a.cl", "inner/b.cl", "new.cl"]), "changed since", "a file is new");
        write(&folder, "kernels/inner/b.cl", "other");
        assert_eq!(of_kernels(&["a.cl", "inner/b.cl"]), "changed since");
        assert_eq!(of_kernels(&["a.cl", "missing.cl"]), "changed since", "a file cannot be read");
        write(&folder, "others/d.cl", "new");
        assert_eq!(state(&folder.path().join("others"), &["d.cl"]), IN_NO_COMMIT);
    }

    #[test]
    fn git_runs_no_program_that_the_configuration_of_a_repository_names() {
        let folder = repository(&["a.toml", "a.cl"]);
        let trap = folder.path().join("trap");
        let springs = format!("touch '{}'; cat", trap.display());
        write(&folder, ".gitattributes", "* filter=evil");
        run(folder.path(), &["config", "core.fsmonitor", &springs]);
        run(folder.path(), &["config", "filter.evil.clean", &springs]);
        // The second text is as long as the first: git sees the difference only if it reads the file.
        for text in ["a.toml", "b.toml"] {
            write(&folder, "a.toml", text);
            assert!(git_state(&folder.path().join("a.toml")).is_some());
            assert!(git_state_of_folder(folder.path(), &["a.cl".to_owned()], "cl").is_some());
        }
        assert!(!trap.exists(), "git ran a program");
        run(folder.path(), &["status"]);
        assert!(trap.exists(), "git runs the program of the filter");
    }

    #[test]
    fn a_missing_object_is_not_fetched() {
        let folder = repository(&["inner/a.toml"]);
        let trap = folder.path().join("trap");
        let tree = answer(git(folder.path()).args(["rev-parse", "HEAD:inner"])).expect("a tree");
        let (start, rest) = tree.split_at(2);
        std::fs::remove_file(folder.path().join(".git/objects").join(start).join(rest)).expect("an object");
        let url = format!("ext::touch {}", trap.display());
        for (key, value) in [
            ("core.repositoryFormatVersion", "1"),
            ("extensions.partialClone", "origin"),
            ("remote.origin.promisor", "true"),
            ("remote.origin.url", url.as_str()),
            ("protocol.ext.allow", "always"),
        ] {
            run(folder.path(), &["config", key, value]);
        }
        assert_eq!(of_file(&folder, "inner/a.toml").as_deref(), Some(IN_NO_COMMIT));
        assert!(!trap.exists(), "git ran a program");
    }

    #[test]
    fn git_uses_the_repository_of_the_folder_also_in_a_hook() {
        let command = git(Path::new("a"));
        let removed = |name: &str| command.get_envs().any(|variable| variable == (OsStr::new(name), None));
        assert!(REDIRECTIONS.iter().all(|name| removed(name)) && removed("GIT_DIR"));
    }
}
