//! The default folder for results.

use crate::settings::results;
use std::path::PathBuf;

/// If `resume` is true and there is a folder of results for the config `name`, returns the latest such folder.
/// Otherwise returns the path of a new folder.
pub fn default_folder(name: &str, resume: bool) -> PathBuf {
    let free = free_folder(name);
    let latest =
        (1..).map(|number| numbered_folder(name, number)).take_while(|folder| *folder != free).last();
    latest.filter(|_| resume).unwrap_or(free)
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
        let place = tempfile::tempdir().unwrap();
        // If the name is an absolute path, `results` is not put before the name.
        let name = place.path().join("quick").display().to_string();
        let numbered = |ending: &str| PathBuf::from(format!("{name}{ending}"));
        let found = || [true, false].map(|resume| default_folder(&name, resume));
        assert_eq!(found(), [numbered(""), numbered("")]);
        for ending in ["", "-2", "-3"] {
            std::fs::create_dir(numbered(ending)).unwrap();
        }
        assert_eq!(found(), [numbered("-3"), numbered("-4")]);
    }
}
