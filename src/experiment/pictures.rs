//! Saves the pictures of a run in the folder `images/` of its folder of results.

use crate::error::{Error, Result};
use crate::image::{Radiance, picture_reader, save, save_rgb8, to_rgb8, to_rgba8};
use crate::output::Target;
use crate::record::file_name;
use crate::scene::Display;
use image::{DynamicImage, RgbImage, RgbaImage};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Saves pictures in a folder of results, without replacing other pictures.
pub struct Pictures {
    folder: PathBuf,
    /// Paths of saved pictures by the pictures' hashes, so that measured points with identical images share a
    /// file.
    saved: HashMap<blake3::Hash, String>,
}

impl Pictures {
    /// Makes a `Pictures` that saves pictures in `folder`, a folder of results.
    pub fn of(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), saved: HashMap::new() }
    }

    /// Returns a hash of all bits of a picture.
    pub fn hash(image: &Radiance) -> String {
        hash(image).to_hex()[..32].to_owned()
    }

    /// Saves a picture in the folder of results, under the first free name of `names`. A name is free if no
    /// other picture has it. If no name is free, the picture's hash is added to the last name. If this
    /// `Pictures` has already saved an equal picture, writes no file. Returns the file's path, relative to the
    /// folder of results.
    pub fn picture(&mut self, names: &[&str], image: &Radiance, display: Display) -> Result<String> {
        let hash = hash(image);
        if let Some(path) = self.saved.get(&hash) {
            return Ok(path.clone());
        }
        let shown = to_rgba8(image, display).unwrap_or_else(|| opaque(to_rgb8(image, display)));
        let path = self.free_path(names, &shown, &hash);
        save(image, display, &self.target(&path)?)?;
        self.saved.insert(hash, path.clone());
        Ok(path)
    }

    /// Saves a drawing (a picture that no caster made, such as a picture of differences) under `name`. If
    /// another picture already has the name `name`, the drawing's hash is added to the drawing's name.
    /// Returns the file's path.
    pub fn drawing(&self, name: &str, drawn: &RgbImage) -> Result<String> {
        let path = self.free_path(&[name], &opaque(drawn.clone()), &blake3::hash(drawn.as_raw()));
        save_rgb8(drawn, &self.target(&path)?)?;
        Ok(path)
    }

    /// Returns the target for a picture with this path. Returns an error if the folder of pictures, which the run has
    /// made, was removed.
    fn target(&self, path: &str) -> Result<Target> {
        let file = self.folder.join(path);
        match file.parent() {
            Some(folder) if !folder.is_dir() => Err(Error::removed(folder)),
            _ => Ok(Target::of_results(file)),
        }
    }

    /// Returns the path for the first free name of `names`. If no name is free, the picture's hash is added to the last
    /// name.
    fn free_path(&self, names: &[&str], shown: &RgbaImage, hash: &blake3::Hash) -> String {
        let by_hash = format!("{}-{}", names.last().unwrap_or(&"picture"), &hash.to_hex()[..8]);
        let read = |path: &String| {
            let bytes = std::fs::read(self.folder.join(path)).ok()?;
            picture_reader(&bytes, None).ok()?.decode().ok()
        };
        // A name is free if its file is missing, cannot be read, or has the same picture.
        let free = |path: &String| read(path).is_none_or(|there| there.to_rgba8() == *shown);
        names.iter().map(|name| path_of(name)).find(free).unwrap_or_else(|| path_of(&by_hash))
    }

    /// Saves a picture under `name`, unless a picture with this name exists already; `make` draws the picture.
    /// Returns the path of the picture's file.
    pub fn picture_once(&self, name: &str, make: impl FnOnce() -> RgbImage) -> Result<String> {
        let path = path_of(name);
        if !self.folder.join(&path).exists() {
            save_rgb8(&make(), &self.target(&path)?)?;
        }
        Ok(path)
    }
}

fn opaque(picture: RgbImage) -> RgbaImage {
    DynamicImage::from(picture).into_rgba8()
}

fn path_of(name: &str) -> String {
    format!("images/{}.png", file_name(name))
}

fn hash(image: &Radiance) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    for value in image.pixels.as_flattened().iter().chain(&image.coverage) {
        hasher.update(&value.to_le_bytes());
    }
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_with_long_names_have_short_files_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        let long = "é".repeat(300);
        let pictures = Pictures::of(folder.path());
        let drawn = RgbImage::from_pixel(3, 2, image::Rgb([7; 3]));
        let paths = ["a", "b"].map(|end| pictures.drawing(&format!("{long}{end}"), &drawn).unwrap());
        assert_ne!(paths[0], paths[1]);
        for path in &paths {
            assert!(folder.path().join(path).is_file(), "{path}");
        }
        assert_eq!(paths[0], path_of(&format!("{long}a")), "the name is the same in every process");
    }

    #[test]
    fn a_folder_of_pictures_that_was_removed_during_the_run_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let images = folder.path().join("images");
        let error = Pictures::of(folder.path()).drawing("a", &RgbImage::new(1, 1)).unwrap_err();
        let what = "or its folder was removed or replaced while this run wrote to it";
        assert_eq!((error.to_string(), error.exit_code()), (format!("{} {what}", images.display()), 1));
        assert!(error.remedy().contains("If it was removed, its results are lost"), "{}", error.remedy());
        std::fs::create_dir(images).unwrap();
        assert!(Pictures::of(folder.path()).drawing("a", &RgbImage::new(1, 1)).is_ok());
    }

    /// A picture with the hash of a verified picture is not verified again, so different pictures must have
    /// different hashes.
    #[test]
    fn pictures_that_differ_in_alpha_alone_have_hashes_and_files_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        let clear = Radiance { coverage: vec![0.0; 6], ..Radiance::new(3, 2) };
        let hidden = Radiance { coverage: vec![1.0; 6], ..clear.clone() };
        assert_ne!(Pictures::hash(&clear), Pictures::hash(&hidden));
        for _ in 0..2 {
            let mut pictures = Pictures::of(folder.path());
            let mut save = |image| pictures.picture(&["a", "a-8x8"], image, Display::default()).unwrap();
            assert_eq!([save(&clear), save(&hidden)], ["images/a.png", "images/a-8x8.png"]);
        }
    }

    #[test]
    fn equal_pictures_share_a_file_and_others_never_do() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        let black = Radiance::new(3, 2);
        let white = Radiance { pixels: vec![[1.0; 3]; 6], ..black.clone() };
        let grey = Radiance { pixels: vec![[0.01; 3]; 6], ..black.clone() };
        for _ in 0..2 {
            // The loop's second iteration imitates a new worker, which has no list of saved pictures.
            let mut pictures = Pictures::of(folder.path());
            let mut save = |image| pictures.picture(&["a", "a-8x8"], image, Display::default()).unwrap();
            assert_eq!(save(&black), "images/a.png");
            assert_eq!(save(&black), "images/a.png");
            assert_eq!(save(&white), "images/a-8x8.png");
            assert!(save(&grey).starts_with("images/a-8x8-"));
        }
        assert_eq!(std::fs::read_dir(folder.path().join("images")).unwrap().count(), 3);
        let pictures = Pictures::of(folder.path());
        let [one, other] = [[1; 3], [2; 3]].map(|colour| RgbImage::from_pixel(3, 2, image::Rgb(colour)));
        for _ in 0..2 {
            assert_eq!(pictures.drawing("b", &one).unwrap(), "images/b.png");
            assert!(pictures.drawing("b", &other).unwrap().starts_with("images/b-"));
        }
    }

    #[test]
    fn a_picture_that_exists_is_not_made_again() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        let pictures = Pictures::of(folder.path());
        let made = std::cell::Cell::new(0);
        for _ in 0..2 {
            let make = || {
                made.set(made.get() + 1);
                RgbImage::from_pixel(3, 2, image::Rgb([7; 3]))
            };
            assert_eq!(pictures.picture_once("a b", make).unwrap(), "images/a-b.png");
            assert!(folder.path().join("images/a-b.png").exists());
        }
        assert_eq!(made.get(), 1);
    }
}
