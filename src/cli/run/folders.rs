//! The default folder for results.

use crate::settings::results;
use std::path::PathBuf;

/// Returns the latest folder of this name to continue with, or a new one.
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
