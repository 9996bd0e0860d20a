//! Finds the git commit that is checked out in the repository of a file or a folder, and whether the file or folder has
//! been changed since this commit.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};

/// Returns the commit and the state of a file or folder: "0123456789ab, unchanged", "0123456789ab, changed
/// since" or "in no commit". Returns `None` outside a repository, or if git is not installed.
pub fn git_state(path: &Path) -> Option<String> {
    let path = path.canonicalize().ok()?;
    let folder = if path.is_dir() { path.as_path() } else { path.parent()? };
    let commit = git(folder, &["rev-parse", "--short=12", "HEAD"])?;
    let path = path.as_os_str();
    if git_of(folder, &["ls-files"], path)?.is_empty() {
        return Some("in no commit".to_owned());
    }
    let changes = git_of(folder, &["status", "--porcelain", "--untracked-files=all"], path)?;
    Some(format!("{commit}, {}", if changes.is_empty() { "unchanged" } else { "changed since" }))
}

fn git(folder: &Path, arguments: &[&str]) -> Option<String> {
    answer(Command::new("git").arg("-C").arg(folder).args(arguments))
}

fn git_of(folder: &Path, arguments: &[&str], path: &OsStr) -> Option<String> {
    answer(Command::new("git").arg("-C").arg(folder).args(arguments).arg("--").arg(path))
}

/// Returns the output of a git command; `None` if git is missing or the command fails. The command only reads
/// the repository, and does not lock the repository.
fn answer(command: &mut Command) -> Option<String> {
    let command = command.env("GIT_OPTIONAL_LOCKS", "0").stdin(Stdio::null());
    let output = command.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(folder: &Path, arguments: &[&str]) {
        let identity = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"];
        let all: Vec<&str> = identity.into_iter().chain(arguments.iter().copied()).collect();
        git(folder, &all).unwrap_or_else(|| panic!("git {arguments:?}"));
    }

    #[test]
    fn a_file_is_unchanged_changed_or_in_no_commit() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a.toml");
        std::fs::write(&file, "one").expect("it writes");
        assert_eq!(git_state(&file), None, "there is no repository");
        run(folder.path(), &["init", "-q"]);
        run(folder.path(), &["commit", "-q", "--allow-empty", "-m", "empty"]);
        assert_eq!(git_state(&file).as_deref(), Some("in no commit"));
        run(folder.path(), &["add", "a.toml"]);
        run(folder.path(), &["commit", "-q", "-m", "a"]);
        assert!(
            git_state(&file).is_some_and(|state| state.ends_with(", unchanged")),
            "{:?}",
            git_state(&file)
        );
        assert!(git_state(folder.path()).is_some_and(|state| state.ends_with(", unchanged")));
        std::fs::write(&file, "two").expect("it writes");
        assert!(git_state(&file).is_some_and(|state| state.ends_with(", changed since")));
    }

    #[test]
    fn staged_changes_and_new_files_are_changes() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a.toml");
        let is_changed = || git_state(folder.path()).is_some_and(|state| state.ends_with(", changed since"));
        std::fs::write(&file, "one").expect("it writes");
        run(folder.path(), &["init", "-q"]);
        run(folder.path(), &["add", "a.toml"]);
        run(folder.path(), &["commit", "-q", "-m", "a"]);
        assert!(!is_changed(), "{:?}", git_state(folder.path()));
        std::fs::write(&file, "two").expect("it writes");
        run(folder.path(), &["add", "a.toml"]);
        assert!(is_changed(), "a staged change: {:?}", git_state(folder.path()));
        run(folder.path(), &["commit", "-q", "-m", "b"]);
        assert!(!is_changed(), "{:?}", git_state(folder.path()));
        std::fs::write(folder.path().join("b.toml"), "new").expect("it writes");
        assert!(is_changed(), "a new file: {:?}", git_state(folder.path()));
    }
}
