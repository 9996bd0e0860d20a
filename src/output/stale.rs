//! Removes plots and exports of earlier plans from a folder of results.

use std::path::Path;

/// The subfolders for a page's plots and exports.
pub const FOLDERS: [&str; 2] = ["plots", "exports"];

/// Prefixes of the names of a report's plots and exports.
const BEGINNINGS: [&str; 9] = [
    "devices",
    "heat-",
    "kernel-tuner-",
    "local-size-",
    "occupancy-",
    "pixels",
    "samples-",
    "scenes",
    "triangles",
];

/// Extensions of those names.
const ENDINGS: [&str; 3] = [".svg", ".png", ".json"];

/// Removes a report's files that are no longer written. Files that cannot be removed do no harm.
pub fn remove(results: &Path, is_written: impl Fn(&str) -> bool) {
    for folder in FOLDERS {
        for entry in std::fs::read_dir(results.join(folder)).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let own = BEGINNINGS.iter().any(|beginning| name.starts_with(beginning))
                && ENDINGS.iter().any(|ending| name.ends_with(ending));
            let file = entry.file_type().is_ok_and(|kind| kind.is_file());
            if own && file && !is_written(&format!("{folder}/{name}")) {
                // A file that remains is not shown anywhere.
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}
