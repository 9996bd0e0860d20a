//! Chooses the folder for results if the user names none.

use crate::settings::results;
use std::io::ErrorKind;
use std::path::PathBuf;

/// If `resume` is true and there is a folder of results for the config `name`, returns the latest such folder.
/// Otherwise returns the path of a new folder.
pub fn default_folder(name: &str, resume: bool) -> PathBuf {
    let free = free_folder(name);
    let latest =
        (1..).map(|number| numbered_folder(name, number)).take_while(|folder| *folder != free).last();
    latest.filter(|_| resume).unwrap_or(free)
}

/// Makes the folder of a new run for the config `name`, and returns its path. Runs that begin at the same
/// time get different folders, because only one run can make a folder of a given name. If a folder cannot be
/// made for another reason than that it exists, returns its path; a later attempt to write there reports the
/// reason.
pub fn new_folder(name: &str) -> PathBuf {
    let is_taken = |folder: &PathBuf| {
        let _ = folder.parent().map(std::fs::create_dir_all);
        std::fs::create_dir(folder).is_err_and(|error| error.kind() == ErrorKind::AlreadyExists)
    };
    let folder = |number| numbered_folder(name, number);
    (1..).map(folder).find(|folder| !is_taken(folder)).unwrap_or_else(|| folder(1))
}

/// Returns `results/NAME`, or the first of `results/NAME-2`, ... that does not exist.
fn free_folder(name: &str) -> PathBuf {
    let folder = |number| numbered_folder(name, number);
    (1..).map(folder).find(|folder| !folder.exists()).unwrap_or_else(|| folder(1))
}

fn numbered_folder(name: &str, number: u32) -> PathBuf {
    match number {
        1 => results().join(name),
        _ => results().join(format!("{name}-{number}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_folder_is_gone_on_with_and_a_new_run_takes_the_next_name() {
        let parent = tempfile::tempdir().unwrap();
        // If the name is an absolute path, `results` is not put before the name.
        let name = parent.path().join("quick").display().to_string();
        let numbered = |ending: &str| PathBuf::from(format!("{name}{ending}"));
        let default_folders = || [true, false].map(|resume| default_folder(&name, resume));
        assert_eq!(default_folders(), [numbered(""), numbered("")]);
        for ending in ["", "-2", "-3"] {
            std::fs::create_dir(numbered(ending)).unwrap();
        }
        assert_eq!(default_folders(), [numbered("-3"), numbered("-4")]);
    }

    #[test]
    fn runs_that_begin_at_once_make_different_folders() {
        let parent = tempfile::tempdir().unwrap();
        let name = |path: &str| parent.path().join(path).display().to_string();
        let quick = name("results/quick");
        let mut folders: Vec<PathBuf> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..3).map(|_| scope.spawn(|| new_folder(&quick))).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        folders.sort();
        assert_eq!(folders, ["", "-2", "-3"].map(|ending| PathBuf::from(format!("{quick}{ending}"))));
        assert!(folders.iter().all(|folder| folder.is_dir()));
        // The reason why a folder cannot be made is reported later.
        std::fs::write(parent.path().join("file"), "").unwrap();
        assert_eq!(new_folder(&name("file/quick")), parent.path().join("file/quick"));
    }
}
