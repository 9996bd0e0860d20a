//! Pages' companions of an earlier plan: a plot or an export of a scene that is no longer shown goes.

use std::collections::HashSet;
use std::path::Path;

/// What a report's plots and exports begin with; other files of the same folders are left alone.
const OWN: [&str; 9] = [
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

/// Removes a report's own files that are not among `written`. What cannot be removed does no harm.
pub fn remove_stale(folder: &Path, written: &HashSet<String>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let own = OWN.iter().any(|beginning| name.starts_with(beginning));
        let file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if own && file && !written.contains(&name) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}
