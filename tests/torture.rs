//! Bad, odd and hostile OBJ files. Rendering each of these files yields a picture without NaN, or an error
//! that names file, line and reason, but never a panic or a crash.

use std::path::{Path, PathBuf};

/// The files that must yield a picture, by the numbers at the beginning of their names.
const SHOWN: [u32; 53] = [
    6, 7, 9, 10, 11, 12, 13, 14, 17, 28, 29, 30, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 44, 45, 46, 49, 50,
    51, 52, 53, 54, 55, 56, 57, 58, 59, 60, 61, 62, 63, 64, 66, 67, 69, 72, 73, 74, 78, 79, 80, 81, 82, 83,
];

/// The result of rendering one of the OBJ files.
enum End {
    Picture,
    Refused(String),
}

/// Renders a file, and returns the result; an `Err` if raycl crashed or wrote a wrong picture or message.
fn render(path: &Path, folder: &Path) -> Result<End, String> {
    let picture = folder.join("picture.exr");
    let _ = std::fs::remove_file(&picture);
    let mut command = crate::binary::program();
    command.arg("render").arg(path).args(["--width", "24", "--height", "16", "--quiet", "--output"]);
    let output = crate::binary::run(command.arg(&picture).env("RAYCL_CACHE_MIB", "0"));
    let said = String::from_utf8(output.stderr).map_err(|_| "an error that is not UTF-8")?;
    if said.chars().any(|c| c.is_control() && c != '\n') {
        return Err(format!("control characters in {said:?}"));
    }
    match output.status.code() {
        Some(0) => all_finite(&picture).map(|()| End::Picture),
        Some(2) if said.contains("panicked") => Err(said),
        Some(2) => Ok(End::Refused(said)),
        _ => Err(format!("{}: {said}", output.status)),
    }
}

fn all_finite(picture: &Path) -> Result<(), String> {
    let image = image::open(picture).map_err(|error| error.to_string())?.to_rgb32f();
    let (width, height) = image.dimensions();
    let finite = image.as_raw().iter().all(|value| value.is_finite());
    ((width, height) == (24, 16) && finite)
        .then_some(())
        .ok_or_else(|| "a picture with NaN or infinity".to_owned())
}

/// Returns true if an error names an OBJ or MTL file and a line, followed by some text. Line breaks may be
/// anywhere in the error.
fn is_helpful(said: &str) -> bool {
    let text: String = said.chars().filter(|c| !c.is_whitespace() && *c != '│').collect();
    let position = text.match_indices(".obj:").chain(text.match_indices(".mtl:")).next();
    position.is_some_and(|(at, ending)| {
        let rest = &text[at + ending.len()..];
        rest.starts_with(|c: char| c.is_ascii_digit()) && rest.len() > 20
    })
}

/// Writes two files that are too long to be stored in the repository.
fn generated(folder: &Path) -> Vec<PathBuf> {
    let triangle = "v 0 0 -2\nv 1 0 -2\nv 0 1 -2\n";
    let long_line = format!("#{}\n{triangle}f 1 2 3\n", "x".repeat(1_000_000));
    let groups: String = (0..10_000).map(|i| format!("g group{i}\nusemtl material{i}\nf 1 2 3\n")).collect();
    let files = [("74_long_line_1MB.obj", long_line), ("79_10k_groups.obj", format!("{triangle}{groups}"))];
    let write = |(name, text): (&str, String)| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("a file");
        path
    };
    files.into_iter().map(write).collect()
}

fn number(path: &Path) -> u32 {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name[..2].parse().expect("a number before the name")
}

#[test]
fn every_file_ends_in_a_picture_or_in_a_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let stored = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/obj");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(stored).expect("the files").map(|entry| entry.expect("a file").path()).collect();
    files.extend(generated(folder.path()));
    files.retain(|path| path.extension().is_some_and(|ending| ending == "obj"));
    files.sort_by_key(|path| number(path));
    assert!(files.len() >= 83, "only {} files", files.len());
    let mut wrong = Vec::new();
    for path in &files {
        let expected = SHOWN.contains(&number(path));
        match render(path, folder.path()) {
            Ok(End::Picture) if expected => {}
            Ok(End::Refused(said)) if !expected && is_helpful(&said) => {}
            Ok(End::Picture) => wrong.push(format!("{}: a picture", path.display())),
            Ok(End::Refused(said)) | Err(said) => wrong.push(format!("{}: {said}", path.display())),
        }
    }
    assert!(wrong.is_empty(), "{} of {} files:\n{}", wrong.len(), files.len(), wrong.join("\n"));
}
