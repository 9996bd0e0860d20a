//! Copies the pictures of records.

use crate::error::{Error, Result};
use crate::record::{Record, own_folder, write_page};
use std::path::{Component, Path, PathBuf};

/// Copies a record's pictures from its attempt's folder. If an identical file of the same name exists, the picture is
/// not copied again. If a different file of that name exists, a hash of the picture's bytes is added to the copy's
/// name, also in the record.
pub fn copy(out: &Path, attempt: &Path, record: &mut Record) -> Result<()> {
    let pictures = [
        &mut record.image,
        &mut record.difference_image,
        &mut record.reference_image,
        &mut record.certainty_image,
        &mut record.tests_image,
        &mut record.nodes_image,
    ];
    for name in pictures.into_iter().flatten() {
        if !stays_inside(name) {
            continue;
        }
        // A picture may be lost with its machine; the record's times are still used.
        let Ok(bytes) = std::fs::read(attempt.join(&name)) else { continue };
        let (mut target, mut path) = (name.clone(), out.join(&name));
        if std::fs::read(&path).is_ok_and(|there| there != bytes) {
            target = with_hash(name, &bytes);
            path = out.join(&target);
        }
        if !path.exists() {
            let folder = path.parent().map_or_else(|| out.to_owned(), PathBuf::from);
            own_folder(&folder)
                .map_err(|error| Error::run(format!("cannot make {}: {error}", folder.display())))?;
            write_page(&path, &bytes)?;
        }
        *name = target;
    }
    Ok(())
}

/// Returns whether a path in a record leads to a file inside the record's folder.
fn stays_inside(name: &str) -> bool {
    Path::new(name).components().all(|part| matches!(part, Component::Normal(_)))
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

    #[test]
    fn every_picture_of_a_record_is_copied_and_a_lost_one_is_left_out() {
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
        copy(&out, &attempt, &mut record).unwrap();
        assert_eq!(record, before);
        for name in names {
            assert_eq!(std::fs::read_to_string(out.join(format!("images/{name}.png"))).unwrap(), name);
        }
        let mut lost = Record { image: picture("lost"), ..Record::default() };
        copy(&out, &attempt, &mut lost).unwrap();
        assert_eq!(lost.image, picture("lost"));
    }
}
