//! Plots and exports in a folder of results that belong to an earlier plan.

use std::path::Path;

/// Where a page's plots and exports lie, beside it.
pub const FOLDERS: [&str; 2] = ["plots", "exports"];

/// What a report's plots and exports begin with.
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

/// And what they end with.
const ENDINGS: [&str; 3] = [".svg", ".png", ".json"];

/// Removes files of a report that are not written any more. What cannot be removed does no harm.
pub fn remove(results: &Path, is_written: impl Fn(&str) -> bool) {
    for folder in FOLDERS {
        for entry in std::fs::read_dir(results.join(folder)).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let own = BEGINNINGS.iter().any(|beginning| name.starts_with(beginning))
                && ENDINGS.iter().any(|ending| name.ends_with(ending));
            let file = entry.file_type().is_ok_and(|kind| kind.is_file());
            if own && file && !is_written(&format!("{folder}/{name}")) {
                // It is shown nowhere.
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}
