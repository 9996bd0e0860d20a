//! The functions that the fuzz targets of tests/fuzz/ call: each reads its input as raycl reads one kind of file. The
//! tests here call these functions with files of the repository, from which fuzzing starts, too.

use raycl::config::parse;
use raycl::experiment::Plan;
use raycl::program::preprocess::{canonical, preprocess, read};
use raycl::record::{JsonLines, Record, Sample, read_lines, summary_csv, summary_markdown, summary_terminal};
use raycl::scene::load_scene;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("a file");
    path
}

/// Reads an experiment's TOML, and makes the plan of the experiment. The process runs in the repository's folder.
pub fn config(text: &str) {
    let path = Path::new("configs/test.toml");
    if let Ok(experiment) = parse(path, text.to_owned(), &[]) {
        let points = experiment.scenes.len() * experiment.image_sizes.len() * experiment.strategies.len();
        if points < 10_000 {
            Plan::new(&experiment, 2);
        }
    }
}

/// Reads the input as a journal of samples, and as a journal of records. Records that can be read can be summarised,
/// and their journal can still be read after a line is appended.
pub fn journal(bytes: &[u8], folder: &Path) {
    let path = write(folder, "records.jsonl", bytes);
    let _ = read_lines::<Sample>(&path);
    if let Ok(read) = read_lines::<Record>(&path) {
        let _ = summary_csv(&read.lines);
        summary_markdown(&read.lines, &[], "?", "!");
        let _ = summary_terminal(&read.lines, false);
        let mut journal = JsonLines::append_to(&path).expect("a journal");
        journal.append(&Record::default()).expect("a line");
        let again = read_lines::<Record>(&path).expect("what was read before");
        assert_eq!((again.lines.len(), again.torn), (read.lines.len() + 1, false));
    }
}

/// Preprocesses a kernel's source, and lays the result out as `raycl kernel` does.
pub fn kernel(text: &str) {
    if let Ok(program) = preprocess(text, "-D LOCAL_X=8 -DRAYS", &BTreeMap::new()) {
        read(&program.lines, None);
        read(&program.lines, Some(&["cast"]));
        canonical(&program.text());
    }
}

/// Reads a mesh file of any format. raycl recognises the format by the file's content.
pub fn mesh(bytes: &[u8], folder: &Path) {
    load(&write(folder, "mesh", bytes));
}

/// Reads an OBJ file as a bare mesh. An input is the OBJ file and, after a line `====`, its MTL file.
pub fn obj(bytes: &[u8], folder: &Path) {
    let cut = bytes.windows(5).position(|window| window == b"====\n");
    let (obj, mtl) = cut.map_or((bytes, &b""[..]), |at| (&bytes[..at], &bytes[at + 5..]));
    write(folder, "m.mtl", mtl);
    load(&write(folder, "mesh.obj", obj));
}

/// Reads a scene's TOML. Inputs that may generate large meshes are skipped: these meshes are slow, but not wrong.
pub fn scene(bytes: &[u8], folder: &Path) {
    let digits = bytes.split(|byte| !byte.is_ascii_digit()).map(<[u8]>::len).max().unwrap_or(0);
    let names_triangles = || bytes.windows(9).any(|window| window == b"triangles");
    if digits <= 4 && !(digits > 2 && bytes.contains(&b'e') && names_triangles()) {
        load(&write(folder, "scene.toml", bytes));
    }
}

fn load(path: &Path) {
    if let Ok(loaded) = load_scene(path) {
        loaded.scene.validate().expect("a loaded scene is valid");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Calls `read` with the contents of the files of less than 8192 bytes in a folder of the repository, each as it is
    /// and cut in half. Returns the number of files.
    fn of_files(folder: &str, read: impl Fn(&[u8], &Path)) -> usize {
        let temporary = tempfile::tempdir().expect("a temporary folder");
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        let paths = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
        let files =
            paths.filter(|path| path.metadata().is_ok_and(|file| file.is_file() && file.len() < 8192));
        files
            .inspect(|path| {
                let bytes = std::fs::read(path).expect("a file");
                read(&bytes, temporary.path());
                read(&bytes[..bytes.len() / 2], temporary.path());
            })
            .count()
    }

    fn as_text(read: impl Fn(&str)) -> impl Fn(&[u8], &Path) {
        move |bytes, _| read(&String::from_utf8_lossy(bytes))
    }

    #[test]
    fn the_functions_of_the_fuzz_targets_accept_files_of_the_repository() {
        assert!(of_files("configs", as_text(config)) > 5);
        assert!(of_files("cl/common", as_text(kernel)) > 5);
        assert!(of_files("tests/data/journal", journal) > 2);
        assert!(of_files("tests/data/meshes", mesh) > 2);
        assert!(of_files("tests/data/obj", obj) > 50);
        assert!(of_files("scenes", scene) > 5);
    }
}
