//! The pictures that a run saves for each image: the image, the reference, the reference's certain pixels,
//! the differences from the reference, and the cost of each pixel.

use super::Pictures;
use crate::error::Result;
use crate::image::{Radiance, counts, difference_image, to_rgb8};
use crate::record::Record;
use crate::reference::{Reference, cost};
use crate::scene::{Display, Scene};
use crate::strategy::Culling;
use ::image::{Rgb, RgbImage};
use std::cell::LazyCell;

/// The colour of uncertain pixels, which stands out from any grey, also for colour-blind readers.
const UNCERTAIN: [u8; 3] = [255, 128, 0];
/// Images with more than `COST_PIXELS` pixels get no pictures of costs. Pictures of costs of a larger image
/// would take minutes on the host, and would show no more than pictures of costs of a smaller image.
const COST_PIXELS: u64 = 4_000_000;

/// Saves the pictures of an image: the image itself, its differences from the reference, the reference, the certain
/// pixels and the costs of rays. Identical images that one worker casts share their files. Adds the names of the
/// pictures to the image's record.
pub fn keep(
    pictures: &mut Pictures,
    record: &mut Record,
    image: &Radiance,
    expected: &Reference,
    scene: &Scene,
    culling: Culling,
) -> Result<()> {
    let [width, height] = record.image_size;
    let prefix = format!("{}-{width}x{height}", scene.name);
    let sides = if culling == Culling::None { "" } else { "-culled" };
    let reference = format!("{prefix}-reference{sides}");
    record.reference_image = Some(pictures.picture(&[&reference], &expected.radiance, scene.display)?);
    let name = format!("{prefix}-{}-{}", record.device, record.name);
    let local = record.local_size.map_or(String::new(), |[x, y]| format!("-{x}x{y}"));
    let path = pictures.picture(&[&name, &format!("{name}{local}")], image, scene.display)?;
    let stem = path.trim_start_matches("images/").trim_end_matches(".png").to_owned();
    record.image = Some(path);
    let certainty = certainty(expected, scene.display);
    record.certainty_image = Some(pictures.drawing(&format!("{prefix}-certain{sides}"), &certainty)?);
    keep_costs(pictures, record, scene, culling, [&prefix, sides])?;
    let difference = difference_image(image, &expected.radiance);
    record.difference_image = Some(pictures.drawing(&format!("{stem}-difference{sides}"), &difference)?);
    Ok(())
}

/// Returns the reference picture in grey, with the uncertain pixels (which rounding may decide) marked in
/// colour.
fn certainty(expected: &Reference, display: Display) -> RgbImage {
    let mut picture = to_rgb8(&expected.radiance, display);
    for (pixel, certain) in picture.pixels_mut().zip(&expected.certain) {
        let grey = pixel.0.iter().map(|channel| u32::from(*channel)).sum::<u32>() / 3;
        // Certain pixels are half as bright, so that the marks stand out.
        *pixel = Rgb(if *certain { [(grey / 2) as u8; 3] } else { UNCERTAIN });
    }
    picture
}

/// Saves pictures of the cost of each pixel's rays. One picture shows how many ray-triangle tests a pixel's rays take.
/// Without a tree, a primary ray is tested against all triangles; with a tree, it is tested against the triangles in
/// the leaves that it reaches. With a tree, a second picture shows the number of nodes that the rays visit. A
/// rasteriser casts no primary rays, so no pictures of rays' costs are saved for a rasteriser. Pictures of costs are
/// also left out if the image has more than [`COST_PIXELS`] pixels, or if the strategy needs a tree but the scene has
/// no triangles.
fn keep_costs(
    pictures: &Pictures,
    record: &mut Record,
    scene: &Scene,
    culling: Culling,
    [prefix, sides]: [&str; 2],
) -> Result<()> {
    let size = record.image_size;
    // Each picture of costs is drawn only once, since counting tests and nodes takes long. The picture's name
    // contains the scene's hash, so another scene of the same name has its own pictures.
    let content = record
        .scene_hash
        .as_deref()
        .map_or(String::new(), |hash| format!("-{}", hash.get(..8).unwrap_or(hash)));
    let sides = format!("{sides}{content}");
    if u64::from(size[0]) * u64::from(size[1]) > COST_PIXELS {
        return Ok(());
    }
    if record.tests_every_triangle() {
        let name = format!("{prefix}-tests-exhaustive{sides}");
        let costs = || cost::exhaustive(scene, cost::Grid::all(size), culling);
        let draw = || counts(size, costs().iter().map(|cost| cost.tests));
        record.tests_image = Some(pictures.picture_once(&name, draw)?);
    } else if record.walks_tree() && !scene.mesh.triangles.is_empty() {
        // The rays' costs are counted only if the picture of tests or the picture of nodes is missing, and
        // only once for both pictures. `in_tree` fails only if the scene has more triangles than a tree can
        // index. raycl refuses strategies with a tree for a scene of this size, so `in_tree` does not fail
        // here.
        let costs = LazyCell::new(|| cost::in_tree(scene, size, culling).unwrap_or_default());
        let tests = || counts(size, costs.iter().map(|cost| cost.tests));
        record.tests_image = Some(pictures.picture_once(&format!("{prefix}-tests-tree{sides}"), tests)?);
        let nodes = || counts(size, costs.iter().map(|cost| cost.nodes));
        record.nodes_image = Some(pictures.picture_once(&format!("{prefix}-nodes-tree{sides}"), nodes)?);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::reference;
    use crate::scene::load_scene;
    use std::path::Path;

    #[test]
    fn costs_and_doubts_are_drawn_where_they_are() {
        let scene = load_scene(Path::new("scenes/still-life.toml")).expect("it loads").scene;
        let size = [64, 40];
        let costs = cost::in_tree(&scene, size, Culling::None).expect("a small scene");
        let picture = counts(size, costs.iter().map(|cost| cost.nodes));
        let different = |row: u32| {
            picture.rows().nth(row as usize).expect("a row").any(|p| p.0 != picture.get_pixel(0, row).0)
        };
        assert!((0..40).any(different), "all rays cost the same");
        let expected = reference(&scene, size, Culling::None);
        let marked =
            certainty(&expected, scene.display).pixels().filter(|pixel| pixel.0 == UNCERTAIN).count();
        assert_eq!(marked, expected.doubts.len());
    }

    #[test]
    fn images_of_many_pixels_get_no_pictures_of_costs() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("images")).expect("a folder");
        let pictures = Pictures::of(folder.path());
        let scene = crate::reference::fixtures::random(1, 1);
        let strategy = crate::strategy::preset("naive").expect("a preset").strategy.to_string();
        let mut record = Record { image_size: [1000, 4001], strategy, ..Record::default() };
        keep_costs(&pictures, &mut record, &scene, Culling::None, ["a", ""]).expect("it saves nothing");
        assert_eq!((record.tests_image, record.nodes_image), (None, None));
    }

    #[test]
    fn pictures_are_named_after_their_point_and_those_without_back_faces_are_others() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("images")).expect("a folder");
        let mut pictures = Pictures::of(folder.path());
        let scene = crate::reference::fixtures::random(30, 1);
        let mut record_of = |strategy: &str, culling| {
            let strategy = crate::strategy::preset(strategy).expect("a preset").strategy;
            let mut record = Record {
                name: "mine".to_owned(),
                device: "a device".to_owned(),
                image_size: [12, 8],
                scene_hash: Some("0123456789".to_owned()),
                strategy: strategy.to_string(),
                ..Record::default()
            };
            let expected = reference(&scene, [12, 8], culling);
            let mut image = expected.radiance.clone();
            image.pixels[0] = [1.0; 3];
            keep(&mut pictures, &mut record, &image, &expected, &scene, culling).expect("it saves");
            record
        };
        let record = record_of("naive", Culling::None);
        let saved = [
            record.reference_image,
            record.image,
            record.certainty_image,
            record.tests_image,
            record.difference_image,
            record.nodes_image,
        ];
        let names = [
            "random-triangles-12x8-reference",
            "random-triangles-12x8-a-device-mine",
            "random-triangles-12x8-certain",
            "random-triangles-12x8-tests-exhaustive-01234567",
            "random-triangles-12x8-a-device-mine-difference",
        ];
        let paths = names.map(|name| Some(format!("images/{name}.png")));
        assert_eq!(saved[..5], paths);
        assert_eq!(saved[5], None);
        assert!(saved.iter().flatten().all(|path| folder.path().join(path).is_file()));
        let culled = record_of("bvh", Culling::Back);
        let ends = |path: &Option<String>, end: &str| path.as_ref().is_some_and(|path| path.ends_with(end));
        assert!(ends(&culled.reference_image, "-reference-culled.png"), "{:?}", culled.reference_image);
        assert!(ends(&culled.tests_image, "-tests-tree-culled-01234567.png"), "{:?}", culled.tests_image);
        assert!(ends(&culled.nodes_image, "-nodes-tree-culled-01234567.png"), "{:?}", culled.nodes_image);
    }

    #[test]
    fn pictures_of_costs_and_of_differences_show_what_their_names_say() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("images")).expect("a folder");
        let (scene, size) = (crate::reference::fixtures::random(30, 1), [12, 8]);
        let strategy = crate::strategy::preset("bvh").expect("a preset").strategy.to_string();
        let mut record = Record { image_size: size, strategy, ..Record::default() };
        let expected = reference(&scene, size, Culling::None);
        let mut image = expected.radiance.clone();
        image.pixels[0] = [1.0; 3];
        let mut pictures = Pictures::of(folder.path());
        keep(&mut pictures, &mut record, &image, &expected, &scene, Culling::None).expect("it saves");
        let saved = |path: &Option<String>| {
            let path = folder.path().join(path.as_ref().expect("a picture"));
            ::image::open(path).expect("a picture").into_rgb8()
        };
        let costs = cost::in_tree(&scene, size, Culling::None).expect("a small scene");
        let tests = counts(size, costs.iter().map(|cost| cost.tests));
        let nodes = counts(size, costs.iter().map(|cost| cost.nodes));
        assert!(tests != nodes, "the test needs different pictures");
        assert!(saved(&record.tests_image) == tests && saved(&record.nodes_image) == nodes);
        assert!(saved(&record.difference_image) == difference_image(&image, &expected.radiance));
    }
}
