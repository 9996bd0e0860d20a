//! Reads pictures from folders of results, to embed them in a page.

use super::merged::Origins;
use crate::image::picture_reader;
use crate::numbers::by;
use crate::record::{Record, read_inside};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// The largest number of bytes that all embedded pictures of a page may take together, apart from the small pictures
/// at the top. With this limit, the page usually stays below 15 MB. Of the pictures that would exceed the limit, the
/// page shows only the paths.
const PICTURE_BYTES: usize = 9_000_000;
/// Width in pixels of the small picture of each scene at the top of a report.
const THUMBNAIL: u32 = 120;

/// A picture on a page.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The kind of picture, such as "reference", "naive" or "uncertain pixels".
    pub kind: String,
    /// The picture's caption.
    pub caption: String,
    /// The picture as a `data:` URL; `None` if the picture's file cannot be read, or if the picture was left out
    /// to keep the page small.
    pub data: Option<String>,
    /// The picture's path in its folder of results.
    pub path: String,
}

/// The pictures of one scene at one image size.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The scene's name.
    pub name: String,
    /// The image size as text, such as "800 x 500".
    pub size: String,
    /// Number of triangles, if known.
    pub triangles: Option<u64>,
    /// The scene's pictures.
    pub pictures: Vec<Picture>,
}

/// Reads the pictures of a page. A picture's data is left out if, with this data, the page's pictures would
/// exceed `PICTURE_BYTES`.
#[derive(Debug, Default)]
pub struct Pictures {
    /// The bytes that the page's embedded pictures take so far, without the small pictures at the top of the
    /// page.
    spent: usize,
    /// The picture files that were read, by folder and path; `None` for a file that cannot be read.
    read: HashMap<(PathBuf, String), Option<File>>,
}

/// The contents of a picture file.
#[derive(Debug)]
struct File {
    bytes: Vec<u8>,
    hash: blake3::Hash,
}

impl Pictures {
    /// Returns the contents of the file `path` in a folder; `None` if the file cannot be read, or lies
    /// outside the folder.
    fn file(&mut self, folder: &Path, path: &str) -> Option<&File> {
        let read = || {
            let bytes = read_inside(folder, path).ok()?;
            Some(File { hash: blake3::hash(&bytes), bytes })
        };
        self.read.entry((folder.to_owned(), path.to_owned())).or_insert_with(read).as_ref()
    }

    /// Returns true if the folder contains the file `path`, and this file can be read. Returns false if
    /// `path` is `None`.
    pub fn has(&mut self, folder: &Path, path: Option<&str>) -> bool {
        path.is_some_and(|path| self.file(folder, path).is_some())
    }

    /// Returns a picture for the page. The picture's data is left out if, with this data, the page's pictures would
    /// exceed `PICTURE_BYTES`.
    pub fn picture(&mut self, folder: &Path, path: &str, kind: String, caption: String) -> Picture {
        Picture { kind, caption, data: self.whole(folder, path), path: path.to_owned() }
    }

    /// Returns a small version of a picture as a `data:` URL; `None` if the picture cannot be read.
    pub fn thumbnail(&mut self, folder: &Path, path: &str) -> Option<String> {
        let picture = picture_reader(&self.file(folder, path)?.bytes, None).ok()?.decode().ok()?;
        let height = (THUMBNAIL * picture.height()).div_ceil(picture.width().max(1));
        let small = picture.thumbnail(THUMBNAIL, height.max(1)).to_rgb8();
        let mut bytes = Cursor::new(Vec::new());
        small.write_to(&mut bytes, image::ImageFormat::Png).ok()?;
        Some(png_address(bytes.get_ref()))
    }

    fn whole(&mut self, folder: &Path, path: &str) -> Option<String> {
        let spent = self.spent;
        let bytes = &self.file(folder, path)?.bytes;
        let cost = bytes.len() * 4 / 3;
        if spent + cost > PICTURE_BYTES {
            return None;
        }
        let address = png_address(bytes);
        self.spent += cost;
        Some(address)
    }

    /// Returns the pictures of every scene and image size: the reference, the uncertain pixels, and the cost
    /// of rays (triangle tests and tree nodes). Also returns, for each strategy, its picture and the picture
    /// of the differences from the reference. Each record's pictures come from the record's own folder. If
    /// several records have the same picture under the same name, the picture is shown only once.
    pub fn gallery(&mut self, records: &[Record], origins: &Origins<'_>) -> Vec<Scene> {
        let mut scenes: Vec<Scene> = Vec::new();
        let mut shown: Vec<(usize, String, Option<blake3::Hash>)> = Vec::new();
        for record in records {
            let Some(folder) = origins.folder(record) else { continue };
            let from =
                origins.label(record).map_or(String::new(), |label| format!(" From the folder '{label}'."));
            let size = by(record.image_size);
            let index = scenes.iter().position(|scene| scene.name == record.scene && scene.size == size);
            let index = index.unwrap_or_else(|| {
                scenes.push(Scene {
                    name: record.scene.clone(),
                    size,
                    triangles: record.triangles,
                    pictures: Vec::new(),
                });
                scenes.len() - 1
            });
            for (path, kind, caption) in pictures_of(record) {
                let content = (index, path.clone(), self.file(folder, &path).map(|file| file.hash));
                if !shown.contains(&content) {
                    shown.push(content);
                    scenes[index].pictures.push(self.picture(folder, &path, kind, caption + &from));
                }
            }
        }
        scenes.retain(|scene| !scene.pictures.is_empty());
        for scene in &mut scenes {
            scene.pictures.sort_by_key(|picture| order(&picture.kind));
        }
        scenes
    }
}

fn order(kind: &str) -> usize {
    ["reference", "uncertain pixels", "cost: triangles, without a tree", "cost: triangles", "cost: nodes"]
        .iter()
        .position(|known| kind.starts_with(known))
        .unwrap_or(9)
}

fn pictures_of(record: &Record) -> Vec<(String, String, String)> {
    let who = if record.is_baseline() { &record.strategy } else { &record.name };
    let uncertain = record.uncertain_pixels.unwrap_or(0);
    let differs =
        record.max_difference.map_or(String::new(), |most| format!(" The largest difference is {most:.1e}."));
    let pictures = [
        (
            &record.reference_image,
            "reference".to_owned(),
            "The reference picture, cast on the host in double precision.".to_owned(),
        ),
        (
            &record.certainty_image,
            "uncertain pixels".to_owned(),
            format!(
                "Orange: {uncertain} uncertain pixels, whose values change if their rays are moved slightly, or if another small change is made, for example to the shadow bias. At an uncertain pixel, a strategy's image should have a value in the range of values that such small changes yield; only a few pixels may lie outside this range."
            ),
        ),
        (&record.tests_image, format!("cost: triangles, {}", traversal(record)), tests_caption(record)),
        (
            &record.nodes_image,
            "cost: nodes of a tree".to_owned(),
            "The number of tree nodes that the rays of each pixel visit, counted on the host. Dark means few, light means many."
                .to_owned(),
        ),
        (&record.image, who.clone(), format!("Cast on {}.", record.device)),
        (
            &record.difference_image,
            format!("difference: {who}"),
            format!("Relative differences from the reference, on a logarithmic scale from dark (1e-6) to bright (1). Black pixels differ by less than 1e-6, and red pixels have a value that is not finite.{differs}"),
        ),
    ];
    let present =
        pictures.into_iter().filter_map(|(path, kind, caption)| Some((path.clone()?, kind, caption)));
    present.collect()
}

/// Returns "without a tree" or "with a tree", depending on how the rays of a record's strategy find
/// triangles.
fn traversal(record: &Record) -> &'static str {
    if record.tests_every_triangle() { "without a tree" } else { "with a tree" }
}

fn tests_caption(record: &Record) -> String {
    let how = if record.tests_every_triangle() {
        "a primary ray tests every triangle, and a shadow ray stops at the first triangle that it hits \
         (in a scene with cut-outs, a shadow ray is counted as if it tested every triangle)"
    } else {
        "only triangles in leaves that the rays reach"
    };
    format!(
        "The number of triangles that the rays of each pixel are tested against, counted on the host: {how}. Shadow rays are counted only for the nearest hit of each primary ray, although kernels with eager shading also cast shadow rays from other hits. Dark means few, light means many."
    )
}

/// Returns the `data:` URL with which a page embeds a PNG file.
fn png_address(bytes: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(bytes))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::super::merged::merged;
    use super::*;
    use crate::record::Folder;
    use crate::record::fixtures::measured;

    /// Returns a folder with pictures of the given names, each of 400 x 100 pixels.
    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            image::RgbImage::new(400, 100).save(folder.path().join(name)).unwrap();
        }
        folder
    }

    #[test]
    fn each_picture_of_a_scene_is_shown_once_and_the_reference_first() {
        let folder = folder(&["reference.png", "naive.png", "wide.png"]);
        let with = |name: &str, scene: &str, image: &str| Record {
            scene: scene.into(),
            image: Some(image.into()),
            reference_image: Some("reference.png".into()),
            ..measured("gpu", name, 8, 1.0)
        };
        let records = [
            with("naive", "teapot", "naive.png"),
            with("naive", "teapot", "naive.png"),
            with("wide", "teapot", "wide.png"),
            Record { image_size: [80, 50], ..with("naive", "teapot", "naive.png") },
            Record { image: None, reference_image: None, ..with("naive", "room", "") },
        ];
        let path = folder.path().to_owned();
        let folders = [Folder { path, records: records.to_vec(), ..Folder::default() }];
        let scenes = Pictures::default().gallery(&records, &Origins::of(&folders));
        let shown = |scene: &Scene| scene.pictures.iter().map(|one| one.path.clone()).collect::<Vec<_>>();
        assert_eq!(
            scenes.iter().map(|one| (&*one.name, &*one.size)).collect::<Vec<_>>(),
            [("teapot", "800 x 500"), ("teapot", "80 x 50")]
        );
        assert_eq!(shown(&scenes[0]), ["reference.png", "naive.png", "wide.png"]);
        assert_eq!(shown(&scenes[1]), ["reference.png", "naive.png"]);
        assert!(scenes[0].pictures.iter().all(|one| one.data.is_some()));
    }

    /// Returns the gallery of two folders, in which the scenes with the hashes `hashes` have the same name.
    /// The pictures in the two folders have the same file names. The two references are equal, but the two
    /// pictures of `naive` differ.
    fn of_two_folders(hashes: [&str; 2]) -> Vec<Scene> {
        let parent = tempfile::tempdir().unwrap();
        let folder = |label: &str, hash: &str, grey: u8| {
            let path = parent.path().join(label);
            std::fs::create_dir(&path).unwrap();
            for (name, grey) in [("reference.png", 7), ("naive.png", grey)] {
                image::RgbImage::from_pixel(3, 2, image::Rgb([grey; 3])).save(path.join(name)).unwrap();
            }
            let record = Record {
                key: label.into(),
                scene_hash: Some(hash.into()),
                image: Some("naive.png".into()),
                reference_image: Some("reference.png".into()),
                ..measured("gpu", "naive", 8, 1.0)
            };
            Folder { path, label: label.into(), records: vec![record], ..Folder::default() }
        };
        let folders = [folder("before", hashes[0], 1), folder("after", hashes[1], 2)];
        Pictures::default().gallery(&merged(&folders), &Origins::of(&folders))
    }

    #[test]
    fn pictures_come_from_their_records_own_folder() {
        let data = |scene: &Scene, path: &str| -> Vec<_> {
            let own = scene.pictures.iter().filter(|one| one.path == path);
            own.map(|one| one.data.clone().unwrap()).collect()
        };
        let two = of_two_folders(["1", "2"]);
        let names: Vec<_> = two.iter().map(|scene| scene.name.as_str()).collect();
        assert_eq!(names, ["teapot (before)", "teapot (after)"]);
        assert_ne!(data(&two[0], "naive.png"), data(&two[1], "naive.png"));
        assert_eq!(data(&two[0], "reference.png"), data(&two[1], "reference.png"));
        let one = of_two_folders(["1", "1"]);
        let captions: Vec<_> = one[0].pictures.iter().map(|one| one.caption.as_str()).collect();
        let expected = [
            "The reference picture, cast on the host in double precision. From the folder 'before'.",
            "Cast on gpu (before). From the folder 'before'.",
            "Cast on gpu (after). From the folder 'after'.",
        ];
        assert_eq!((one.len(), captions), (1, expected.to_vec()));
        let [before, after] = &data(&one[0], "naive.png")[..] else { panic!("two pictures") };
        assert_ne!(before, after);
    }

    #[test]
    fn pictures_of_all_records_together_are_sorted_by_their_kind() {
        let folder = folder(&["naive.png", "nodes.png"]);
        let records = [
            Record { image: Some("naive.png".into()), ..measured("gpu", "naive", 8, 1.0) },
            Record { nodes_image: Some("nodes.png".into()), ..measured("gpu", "bvh", 8, 1.0) },
        ];
        let path = folder.path().to_owned();
        let folders = [Folder { path, records: records.to_vec(), ..Folder::default() }];
        let scenes = Pictures::default().gallery(&records, &Origins::of(&folders));
        let paths: Vec<&str> = scenes[0].pictures.iter().map(|picture| picture.path.as_str()).collect();
        assert_eq!(paths, ["nodes.png", "naive.png"]);
    }

    #[test]
    fn a_picture_that_would_make_the_page_too_large_has_no_data() {
        let folder = folder(&["a.png"]);
        let cost = std::fs::read(folder.path().join("a.png")).unwrap().len() * 4 / 3;
        let have_data = |room: usize| {
            let mut pictures = Pictures { spent: 9_000_000 - room, ..Pictures::default() };
            let mut has_data =
                || pictures.picture(folder.path(), "a.png", String::new(), String::new()).data.is_some();
            [has_data(), has_data()]
        };
        assert_eq!([cost - 1, cost, 2 * cost].map(have_data), [[false, false], [true, false], [true, true]]);
    }

    #[test]
    fn each_picture_of_a_record_is_shown_under_its_own_kind() {
        let named = |name: &str| Some(format!("{name}.png"));
        let record = Record {
            strategy: "traversal=exhaustive".into(),
            reference_image: named("a"),
            certainty_image: named("b"),
            tests_image: named("c"),
            nodes_image: named("d"),
            image: named("e"),
            difference_image: named("f"),
            ..measured("gpu", "naive", 8, 1.0)
        };
        let shown: Vec<String> =
            pictures_of(&record).into_iter().map(|(path, kind, _)| format!("{path}, {kind}")).collect();
        let expected = [
            "a.png, reference",
            "b.png, uncertain pixels",
            "c.png, cost: triangles, without a tree",
            "d.png, cost: nodes of a tree",
            "e.png, naive",
            "f.png, difference: naive",
        ];
        assert_eq!(shown, expected);
    }

    #[test]
    fn kinds_of_pictures_have_an_order() {
        let kinds = [
            "naive",
            "cost: nodes of a tree",
            "cost: triangles, with a tree",
            "cost: triangles, without a tree",
            "uncertain pixels",
            "reference",
        ];
        assert!(kinds.map(order).is_sorted_by(|one, next| one > next), "{:?}", kinds.map(order));
    }

    #[test]
    fn a_picture_is_there_only_if_it_lies_in_the_folder() {
        let folder = folder(&["a.png"]);
        let elsewhere = tempfile::tempdir().unwrap();
        image::RgbImage::new(4, 1).save(elsewhere.path().join("b.png")).unwrap();
        let outside = elsewhere.path().join("b.png").display().to_string();
        let mut pictures = Pictures::default();
        let has = [Some("a.png"), Some("b.png"), Some(outside.as_str()), Some("../a.png"), None]
            .map(|path| pictures.has(folder.path(), path));
        assert_eq!(has, [true, false, false, false, false], "{}", folder.path().display());
    }

    #[test]
    fn a_thumbnail_keeps_the_pictures_shape() {
        let folder = folder(&["a.png"]);
        let address = Pictures::default().thumbnail(folder.path(), "a.png").unwrap();
        let bytes = STANDARD.decode(address.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
        let small = image::load_from_memory(&bytes).unwrap();
        assert_eq!((small.width(), small.height()), (THUMBNAIL, THUMBNAIL / 4));
    }

    #[test]
    fn a_damaged_picture_has_no_thumbnail() {
        let folder = folder(&["a.png"]);
        std::fs::write(folder.path().join("b.png"), crate::image::ODD_PALETTE).unwrap();
        let mut pictures = Pictures::default();
        let has = |name: &str| pictures.thumbnail(folder.path(), name).is_some();
        assert_eq!(["a.png", "b.png"].map(has), [true, false]);
    }

    #[test]
    fn a_picture_of_tests_says_whether_rays_walk_a_tree() {
        let of = |strategy: &str| {
            traversal(&Record { strategy: strategy.into(), ..measured("gpu", "naive", 8, 1.0) })
        };
        assert_eq!(["traversal=exhaustive", "traversal=bvh"].map(of), ["without a tree", "with a tree"]);
    }
}
