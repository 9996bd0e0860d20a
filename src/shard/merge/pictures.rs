//! Copies the pictures that records name from the attempts' folders to the merged folder.

use crate::error::{Error, Result, shortened};
use crate::printer;
use crate::record::{Record, own_folder, read_inside, write_page};
use crate::words::counted;
use std::collections::HashSet;
use std::io::{Error as IoError, ErrorKind};
use std::path::{Component, Path};

/// A picture that could not be copied.
#[derive(Debug)]
pub struct Lost {
    /// The picture's path in the folder that is merged.
    path: String,
    /// The reason why the picture could not be copied.
    why: IoError,
}

/// Copies a record's pictures from its attempt's folder to the folder `out`. If `out` already has an
/// identical file of the same name, the picture is not copied again. If `out` has a different file of the
/// same name, a hash of the picture's bytes is added to the picture's name, in `out` and in the record. The
/// attempt may come from a stranger, so a picture is left out if its path leads out of the attempt's folder,
/// even if only through a link. A picture that cannot be read is left out, too. Returns all pictures that
/// were left out. Fails if a folder into which a picture would be copied is a link.
pub fn copy(out: &Path, attempt: &Path, record: &mut Record) -> Result<Vec<Lost>> {
    let pictures = [
        &mut record.image,
        &mut record.difference_image,
        &mut record.reference_image,
        &mut record.certainty_image,
        &mut record.tests_image,
        &mut record.nodes_image,
    ];
    let mut lost = Vec::new();
    for name in pictures.into_iter().flatten() {
        let bytes = match read(attempt, name) {
            Ok(bytes) => bytes,
            // A picture may be lost with its machine. If a picture is lost, the times in its record are used
            // nevertheless.
            Err(why) => {
                let place = attempt.file_name().unwrap_or_default().to_string_lossy();
                lost.push(Lost { path: format!("parts/{place}/{name}"), why });
                continue;
            }
        };
        let (mut target, mut path) = (name.clone(), out.join(&name));
        if read_inside(out, name).is_ok_and(|there| there != bytes) {
            target = with_hash(name, &bytes);
            path = out.join(&target);
        }
        if !path.exists() {
            own_folders_of(out, &target)?;
            write_page(&path, &bytes)?;
        }
        *name = target;
    }
    Ok(lost)
}

/// Returns a note, a single line, on the pictures that could not be copied; `None` if there are none. A picture that
/// several records name counts once.
pub fn note(lost: &[Lost]) -> Option<String> {
    let Lost { path, why } = lost.first()?;
    let paths: HashSet<&str> = lost.iter().map(|one| one.path.as_str()).collect();
    let first = shortened(printer::line(path));
    Some(format!("{} could not be copied; the first is {first}: {why}.", counted(paths.len(), "picture")))
}

/// Reads a record's picture from the folder of the record's attempt. Fails if the picture's path might lead out of
/// the folder.
fn read(attempt: &Path, name: &str) -> std::io::Result<Vec<u8>> {
    if !stays_inside(name) {
        return Err(IoError::new(ErrorKind::InvalidInput, "its path may lead out of the attempt's folder"));
    }
    read_inside(attempt, name)
}

/// Returns true if a path in a record is relative, has no `..` and does not begin with `./`. Such a relative
/// path without `..` can lead out of the record's folder only through a link of the file system.
fn stays_inside(name: &str) -> bool {
    Path::new(name).components().all(|part| matches!(part, Component::Normal(_)))
}

/// Makes the folders between `out` and the file `name`, a path relative to `out`. Fails if one of these folders
/// is a link.
fn own_folders_of(out: &Path, name: &str) -> Result<()> {
    let mut folder = out.to_owned();
    for part in Path::new(name).parent().into_iter().flat_map(Path::components) {
        folder.push(part);
        own_folder(&folder)
            .map_err(|error| Error::run(format!("cannot make {}: {error}", folder.display())))?;
    }
    Ok(())
}

fn with_hash(name: &str, bytes: &[u8]) -> String {
    let hash = blake3::hash(bytes).to_hex();
    match name.rsplit_once('.') {
        Some((stem, ending)) => format!("{stem}-{}.{ending}", &hash[..8]),
        None => format!("{name}-{}", &hash[..8]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn copied(out: &Path, attempt: &Path) -> Option<String> {
        let mut record = Record { image: Some("images/a.png".into()), ..Record::default() };
        copy(out, attempt, &mut record).unwrap();
        record.image
    }

    #[test]
    fn pictures_of_one_name_and_two_contents_are_both_kept_and_copied_once() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let attempt = |name: &str, bytes: &str| {
            let attempt = folder.path().join(name);
            std::fs::create_dir_all(attempt.join("images")).unwrap();
            std::fs::write(attempt.join("images/a.png"), bytes).unwrap();
            attempt
        };
        let (one, same, other) = (attempt("one", "x"), attempt("same", "x"), attempt("other", "y"));
        for _ in 0..2 {
            let names = [&one, &same, &other].map(|attempt| copied(&out, attempt).unwrap());
            assert_eq!([names[0].as_str(), names[1].as_str()], ["images/a.png"; 2]);
            assert!(names[2].starts_with("images/a-"), "{names:?}");
            assert_eq!(std::fs::read_dir(out.join("images")).unwrap().count(), 2);
        }
        assert!(!stays_inside("../a.png") && !stays_inside("/a.png") && stays_inside("images/a.png"));
    }

    /// Copies a record's picture with the path `name`, which a stranger may have chosen, from `parts/attempt`
    /// to `merged/out` in a temporary folder. The files `b.png` and `images/a.png` are in the attempt's
    /// folder, and `a.png` is beside it. `prepare` is called with the temporary folder before the picture is
    /// copied. Returns the result, and the paths of all files and links of the temporary folder that are not
    /// in `parts`.
    fn strangers(name: &str, prepare: impl Fn(&Path)) -> (Result<Vec<Lost>>, Vec<String>) {
        let parent = tempfile::tempdir().unwrap();
        let [out, attempt] = ["merged/out", "parts/attempt"].map(|name| parent.path().join(name));
        for folder in [&out, &attempt.join("images"), &attempt.join("far/away")] {
            std::fs::create_dir_all(folder).unwrap();
        }
        for file in ["parts/a.png", "parts/attempt/b.png", "parts/attempt/images/a.png"] {
            std::fs::write(parent.path().join(file), file).unwrap();
        }
        prepare(parent.path());
        let mut record = Record { image: Some(name.into()), ..Record::default() };
        let result = copy(&out, &attempt, &mut record);
        assert_eq!(record.image.as_deref(), Some(name));
        let mut files = Vec::new();
        let mut folders = vec![parent.path().to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let entry = entry.unwrap();
                match entry.file_type().unwrap().is_dir() {
                    true => folders.push(entry.path()),
                    false => files.push(entry.path()),
                }
            }
        }
        let names = files.iter().map(|file| file.strip_prefix(parent.path()).unwrap().display().to_string());
        (result, names.filter(|name| !name.starts_with("parts/")).collect())
    }

    #[test]
    fn a_strangers_record_copies_no_picture_from_or_to_another_folder() {
        let (result, files) = strangers("images/a.png", |_| {});
        assert!(result.is_ok() && files == ["merged/out/images/a.png"], "{result:?} {files:?}");
        for name in ["../a.png", "/etc/hostname", "images/../b.png", "images/../../a.png", ""] {
            let (result, files) = strangers(name, |_| {});
            assert!(result.is_ok() && files.is_empty(), "{name}: {result:?} {files:?}");
        }
    }

    #[test]
    #[cfg(unix)]
    fn a_strangers_links_lead_nowhere_else() {
        use std::os::unix::fs::symlink;
        let link = |target: &str, at: &str| {
            let (target, at) = (target.to_owned(), at.to_owned());
            move |parent: &Path| symlink(&target, parent.join(&at)).unwrap()
        };
        // In the attempt's folder, the path `deep/../../b.png` leads to `b.png`. In the folder `out`, the
        // path `deep/../../b.png` would lead out of the folder.
        let deep = link("far/away", "parts/attempt/deep");
        let (result, files) = strangers("deep/../../b.png", deep);
        assert!(result.is_ok() && files.is_empty(), "{result:?} {files:?}");
        // The attempt's picture is a link to another file, or to a device whose file never ends.
        for target in ["../../a.png", "/dev/zero"] {
            let (result, files) = strangers("images/new.png", link(target, "parts/attempt/images/new.png"));
            assert!(result.is_ok() && files.is_empty(), "{target}: {result:?} {files:?}");
        }
        // In `out`, a folder on the picture's path is a link, or the file at the picture's path is a device.
        let new = |parent: &Path| {
            for folder in ["elsewhere/images", "parts/attempt/images/images"] {
                std::fs::create_dir_all(parent.join(folder)).unwrap();
            }
            std::fs::write(parent.join("parts/attempt/images/images/a.png"), "new").unwrap();
            symlink("../../elsewhere", parent.join("merged/out/images")).unwrap();
        };
        for name in ["images/a.png", "images/images/a.png"] {
            let (result, files) = strangers(name, new);
            let message = result.unwrap_err().to_string();
            assert!(message.contains("out/images: it is a link"), "{message}");
            assert_eq!(files, ["merged/out/images"]);
        }
        let device = |parent: &Path| {
            std::fs::create_dir(parent.join("merged/out/images")).unwrap();
            symlink("/dev/zero", parent.join("merged/out/images/a.png")).unwrap();
        };
        let (result, files) = strangers("images/a.png", device);
        assert!(result.is_ok() && files == ["merged/out/images/a.png"], "{result:?} {files:?}");
    }

    #[test]
    fn every_picture_of_a_record_is_copied_and_a_lost_one_is_left_out_with_a_note() {
        let folder = tempfile::tempdir().unwrap();
        let [out, attempt] = ["out", "attempt"].map(|name| folder.path().join(name));
        std::fs::create_dir_all(attempt.join("images")).unwrap();
        let names = ["image", "difference", "reference", "certainty", "tests", "nodes"];
        for name in names {
            std::fs::write(attempt.join(format!("images/{name}.png")), name).unwrap();
        }
        let picture = |name: &str| Some(format!("images/{name}.png"));
        let mut record = Record {
            image: picture("image"),
            difference_image: picture("difference"),
            reference_image: picture("reference"),
            certainty_image: picture("certainty"),
            tests_image: picture("tests"),
            nodes_image: picture("nodes"),
            ..Record::default()
        };
        let before = record.clone();
        assert!(copy(&out, &attempt, &mut record).unwrap().is_empty());
        assert_eq!(record, before);
        for name in names {
            assert_eq!(std::fs::read_to_string(out.join(format!("images/{name}.png"))).unwrap(), name);
        }
        assert_eq!(note(&[]), None);
        let mut record = Record { image: picture("lost"), ..Record::default() };
        let mut lost = copy(&out, &attempt, &mut record).unwrap();
        assert_eq!(record.image, picture("lost"));
        lost.extend(copy(&out, &attempt, &mut record).unwrap());
        let noted = note(&lost).unwrap();
        let first = "1 picture could not be copied; the first is parts/attempt/images/lost.png: ";
        assert!(noted.starts_with(first) && noted.len() > first.len() + 1, "{noted}");
        record.image = Some("../a.png".into());
        lost.extend(copy(&out, &attempt, &mut record).unwrap());
        assert_eq!(note(&lost).unwrap(), noted.replace("1 picture", "2 pictures"));
        let outside = note(&lost[2..]).unwrap();
        assert!(outside.ends_with("parts/attempt/../a.png: its path may lead out of the attempt's folder."));
    }

    #[test]
    fn a_note_has_a_strangers_name_on_one_line_and_without_its_middle() {
        let path = format!("parts/one/images/a\nnote: forged{}.png", "x".repeat(5000));
        let noted = note(&[Lost { path, why: ErrorKind::NotFound.into() }]).unwrap();
        assert!(noted.contains(r"parts/one/images/a\u000anote: forgedxx"), "{noted}");
        assert!(noted.contains("xx.png: ") && noted.len() < 600 && !noted.contains('\n'), "{noted}");
    }
}
