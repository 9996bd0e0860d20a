//! The pictures a run keeps of each image: what was cast, what it ought to be, where that is certain, where they
//! differ, and what each pixel costs.

use super::Pictures;
use crate::accel::{Bvh, WideBvh};
use crate::error::Result;
use crate::image::{COUNT_SCALE_HEIGHT, Radiance, difference_image, draw_count_scale, to_rgb8, viridis};
use crate::record::Record;
use crate::reference::Reference;
use crate::reference::intersect::moller_trumbore;
use crate::reference::ray::Frame;
use crate::scene::{Display, Scene};
use crate::strategy::Culling;
use ::image::{Rgb, RgbImage};
use rayon::prelude::*;

/// What marks uncertain pixels: a colour that shows on any grey, for any eye.
const UNCERTAIN: [u8; 3] = [255, 128, 0];
/// Triangles a leaf of the tree that costs are counted in.
const LEAF: usize = 4;

/// Saves an image's pictures, unless an equal one has them already, and names them in its record.
pub fn keep(
    pictures: &mut Pictures,
    record: &mut Record,
    image: &Radiance,
    expected: &Reference,
    scene: &Scene,
    culling: Culling,
) -> Result<()> {
    let [width, height] = record.image_size;
    let place = format!("{}-{width}x{height}", scene.name);
    let sides = if culling == Culling::None { "" } else { "-culled" };
    let reference = format!("{place}-reference{sides}");
    record.reference_image = Some(pictures.picture(&[&reference], &expected.radiance, scene.display)?);
    let name = format!("{place}-{}-{}", record.device, record.name);
    let local = record.local_size.map_or(String::new(), |[x, y]| format!("-{x}x{y}"));
    let path = pictures.picture(&[&name, &format!("{name}{local}")], image, scene.display)?;
    let stem = path.trim_start_matches("images/").trim_end_matches(".png").to_owned();
    record.image = Some(path);
    let certainty = || certainty(expected, scene.display);
    record.certainty_image = Some(pictures.picture_once(&format!("{place}-certain{sides}"), certainty)?);
    if let Some(tree) = tree(scene) {
        let cost = || cost(scene, &tree, record.image_size, culling);
        record.cost_image = Some(pictures.picture_once(&format!("{place}-cost{sides}"), cost)?);
    }
    let difference = || difference_image(image, &expected.radiance);
    record.difference_image = Some(pictures.picture_once(&format!("{stem}-difference{sides}"), difference)?);
    Ok(())
}

/// The reference in grey with its uncertain pixels marked.
fn certainty(expected: &Reference, display: Display) -> RgbImage {
    let mut picture = to_rgb8(&expected.radiance, display);
    for (pixel, certain) in picture.pixels_mut().zip(&expected.certain) {
        let grey = pixel.0.iter().map(|channel| u32::from(*channel)).sum::<u32>() / 3;
        // Half as bright, so that the marks stand out.
        *pixel = Rgb(if *certain { [(grey / 2) as u8; 3] } else { UNCERTAIN });
    }
    picture
}

/// A binary tree over the scene's triangles; none of an empty scene, or of one too large for it.
fn tree(scene: &Scene) -> Option<WideBvh> {
    if scene.mesh.triangles.is_empty() {
        return None;
    }
    WideBvh::new(&Bvh::build(&scene.mesh, LEAF), 2, LEAF).ok()
}

/// Nodes and triangles that each pixel's primary ray tests in a tree, dark for few, over a scale.
fn cost(scene: &Scene, tree: &WideBvh, [width, height]: [u32; 2], culling: Culling) -> RgbImage {
    let frame = Frame::<f64>::new(&scene.camera.pixel_frame(width, height));
    let count = |pixel: u32| {
        let ray = frame.primary(f64::from(pixel % width) + 0.5, f64::from(pixel / width) + 0.5);
        let walk = tree.closest_hit(ray.origin, ray.direction, ray.far, |triangle, reach| {
            let corners = scene.mesh.corners(&scene.mesh.triangles[triangle as usize]).map(|c| c.as_dvec3());
            let (t, _) = moller_trumbore(&ray, corners, culling)?;
            (t < reach).then_some(t)
        });
        walk.nodes + walk.triangles
    };
    let counts: Vec<u32> = (0..width * height).into_par_iter().map(count).collect();
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    let mut picture = RgbImage::new(width, height + COUNT_SCALE_HEIGHT);
    for (pixel, count) in picture.pixels_mut().zip(&counts) {
        *pixel = Rgb(viridis(f64::from(*count) / f64::from(most)));
    }
    draw_count_scale(&mut picture, height, most);
    picture
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
        let tree = tree(&scene).expect("it has triangles");
        let picture = cost(&scene, &tree, size, Culling::None);
        let different = |row: u32| {
            picture.rows().nth(row as usize).expect("a row").any(|p| p.0 != picture.get_pixel(0, row).0)
        };
        assert!((0..40).any(different), "all rays cost the same");
        let expected = reference(&scene, size, Culling::None);
        let marked =
            certainty(&expected, scene.display).pixels().filter(|pixel| pixel.0 == UNCERTAIN).count();
        assert_eq!(marked, expected.doubts.len());
    }
}
