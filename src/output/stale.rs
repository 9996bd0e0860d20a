//! Removes the plots and exports of earlier reports from a folder of results.

use std::path::Path;

/// The subfolders that contain a report's plots and exports.
pub const FOLDERS: [&str; 2] = ["plots", "exports"];

/// Prefixes of the names of a report's plots and exports. The two exports that every report writes
/// (`t4-results.json`, `points.csv`) are left out of this list, since a new report replaces them.
const BEGINNINGS: [&str; 12] = [
    "devices",
    "heat-",
    "kernel-tuner-",
    "local-size-",
    "losses-by-device",
    "occupancy-",
    "pixels",
    "roofline",
    "samples-",
    "scenes",
    "strategies-by-device",
    "triangles",
];

/// Extensions of the names of a report's plots and exports.
const ENDINGS: [&str; 3] = [".svg", ".png", ".json"];

/// Removes plots and exports of earlier reports that the new report did not write. Plots and exports that
/// cannot be removed stay, but no page shows them.
pub fn remove(results: &Path, is_written: impl Fn(&str) -> bool) {
    for folder in FOLDERS {
        for entry in std::fs::read_dir(results.join(folder)).into_iter().flatten().flatten() {
            let name = format!("{folder}/{}", entry.file_name().to_string_lossy());
            let file = entry.file_type().is_ok_and(|kind| kind.is_file());
            if file && is_of_report(&name) && !is_written(&name) {
                // If the plot or export cannot be removed, it stays in the folder, but no page shows it.
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

/// Returns true if `name` is the name of a report's plot, or of an export that not every report has. The
/// plots of `raycl reproduce` and `raycl compare` have other names, so they are not removed.
pub fn is_of_report(name: &str) -> bool {
    let in_folder = FOLDERS.iter().find_map(|folder| name.strip_prefix(folder)?.strip_prefix('/'));
    in_folder.is_some_and(|name| {
        BEGINNINGS.iter().any(|beginning| name.starts_with(beginning))
            && ENDINGS.iter().any(|ending| name.ends_with(ending))
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn plots_and_exports_of_earlier_plans_go_and_a_users_own_files_stay() {
        let results = tempfile::tempdir().unwrap();
        for folder in FOLDERS {
            std::fs::create_dir(results.path().join(folder)).unwrap();
        }
        let files = [
            "plots/scenes.svg",
            "plots/pixels-earlier.png",
            "plots/mine.svg",
            "plots/scenes.txt",
            "exports/kernel-tuner-earlier.json",
            "exports/notes.json",
        ];
        for name in files {
            std::fs::write(results.path().join(name), "").unwrap();
        }
        remove(results.path(), |name| name == "plots/scenes.svg");
        let left: Vec<_> = files.into_iter().filter(|name| results.path().join(name).exists()).collect();
        assert_eq!(left, ["plots/scenes.svg", "plots/mine.svg", "plots/scenes.txt", "exports/notes.json"]);
    }

    /// A user may have put a link to another report's plot in the place of a plot.
    #[cfg(unix)]
    #[test]
    fn links_stay() {
        let results = tempfile::tempdir().unwrap();
        std::fs::create_dir(results.path().join("plots")).unwrap();
        let link = results.path().join("plots/scenes.svg");
        std::os::unix::fs::symlink("/nowhere/scenes.svg", &link).unwrap();
        remove(results.path(), |_| false);
        assert!(link.is_symlink());
    }
}
