//! Chooses the folder for results if the user names none.

use crate::reader::{self, folder_of};
use crate::record::journals::ENVIRONMENT;
use crate::settings::results;
use serde_json::Value;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The largest number that raycl appends to the name of a folder of results. If a folder's name ends with a
/// larger number, such as a year or a date (`quick-2026`), the user has probably chosen this name.
const MAX_NUMBER: u32 = 999;

/// If `resume` is true, returns the latest folder of results for the config `name`: the folder with the highest number.
/// If `resume` is false, or if no folder has results of this config, returns the path of a new folder.
pub fn default_folder(name: &str, resume: bool) -> PathBuf {
    let latest = if resume { latest_number(name) } else { None };
    latest.map_or_else(|| free_folder(name), |number| numbered_folder(name, number))
}

/// Returns the highest number in the name of a folder of results for the config `name`; `None` if there is no
/// such folder. The function looks at all folders: the user may have deleted folders with lower numbers, and some of
/// the folders may belong to other configs.
fn latest_number(name: &str) -> Option<u32> {
    let first = numbered_folder(name, 1);
    let stem = first.file_name()?.to_str()?;
    let entries = std::fs::read_dir(folder_of(&first)).ok()?.flatten();
    let numbers = entries.filter_map(|entry| number_of(entry.file_name().to_str()?, stem));
    numbers.filter(|number| may_be_of(&numbered_folder(name, *number), stem)).max()
}

/// Returns true if `folder` is a folder whose results may be those of the config `name`: its
/// `environment.json` names this config, or names none. The folder `sweep-2` may be the second folder of the
/// config `sweep`, or the first folder of a config `sweep-2`.
fn may_be_of(folder: &Path, name: &str) -> bool {
    let text = reader::bytes(&folder.join(ENVIRONMENT), reader::Kind::Results).unwrap_or_default();
    let environment: Value = serde_json::from_slice(&text).unwrap_or_default();
    let config = environment["config_path"].as_str().and_then(|path| Path::new(path).file_stem());
    folder.is_dir() && config.is_none_or(|config| config == name)
}

/// Returns the number in a folder's name: 1 for the name `stem`, and N for `stem-N`; `None` for all other names.
fn number_of(folder: &str, stem: &str) -> Option<u32> {
    let ending = folder.strip_prefix(stem)?;
    if ending.is_empty() {
        return Some(1);
    }
    let digits = ending.strip_prefix('-')?;
    let number: u32 = digits.parse().ok()?;
    ((2..=MAX_NUMBER).contains(&number) && number.to_string() == digits).then_some(number)
}

/// Makes the folder of a new run for the config `name`, and returns its path. Runs that begin at the same
/// time get different folders, because only one run can make a folder of a given name. If a folder does not exist, but
/// cannot be made, returns its path; a later attempt to write into this folder reports the reason.
pub fn new_folder(name: &str) -> PathBuf {
    let is_taken = |folder: &PathBuf| {
        let _ = folder.parent().map(std::fs::create_dir_all);
        std::fs::create_dir(folder).is_err_and(|error| error.kind() == ErrorKind::AlreadyExists)
    };
    numbered_folders(name).find(|folder| !is_taken(folder)).unwrap_or_else(|| numbered_folder(name, 1))
}

/// Returns the path of a new folder: `results/NAME` or `results/NAME-N`. N is the first number, after the highest
/// number of this config's folders, for which no file or folder exists.
fn free_folder(name: &str) -> PathBuf {
    numbered_folders(name).find(|folder| !folder.exists()).unwrap_or_else(|| numbered_folder(name, 1))
}

/// Returns the paths of possible new folders for the config `name`, in ascending order. The numbers of the new folders
/// are higher than those of all existing folders of this config. A path may be in use by a folder of another config.
fn numbered_folders(name: &str) -> impl Iterator<Item = PathBuf> {
    let first = latest_number(name).map_or(1, |number| number + 1);
    (first..).map(move |number| numbered_folder(name, number))
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
        // The number of a deleted folder is not used again if there is a folder with a higher number. So the
        // folder with the highest number in its name is the latest folder.
        std::fs::remove_dir(numbered("-2")).unwrap();
        assert_eq!(default_folders(), [numbered("-3"), numbered("-4")]);
        // Folders with the endings below do not count as folders of the config `quick`. Neither does the file
        // `quick-4`, but its name is taken.
        for other in ["-1", "-05", "-+5", "-6a", "er-7", "-", "-2026", "-20261128"] {
            std::fs::create_dir(numbered(other)).unwrap();
        }
        std::fs::write(numbered("-4"), "").unwrap();
        assert_eq!(default_folders(), [numbered("-3"), numbered("-5")]);
        std::fs::create_dir(numbered("-12")).unwrap();
        std::fs::remove_dir(numbered("")).unwrap();
        assert_eq!(default_folders(), [numbered("-12"), numbered("-13")]);
        // The folder quick-20 belongs to another config, which is called quick-20. The folder quick-30
        // belongs to the config quick.
        let other = ("-20", "quick-20", ["-12", "-13"]);
        for (ending, config, latest) in [other, ("-30", "quick", ["-30", "-31"])] {
            std::fs::create_dir(numbered(ending)).unwrap();
            let environment = format!(r#"{{"config_path": "configs/{config}.toml"}}"#);
            std::fs::write(numbered(ending).join("environment.json"), environment).unwrap();
            assert_eq!(default_folders(), latest.map(numbered));
        }
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
        // `new_folder` also returns the path of a folder that cannot be made. The reason why the folder
        // cannot be made is reported later.
        std::fs::write(parent.path().join("file"), "").unwrap();
        assert_eq!(new_folder(&name("file/quick")), parent.path().join("file/quick"));
    }
}
