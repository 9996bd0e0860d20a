//! Writes the layers of a picture to files: all layers and the picture to one EXR, or each layer to a separate PNG.
//! Each layer has one property of each pixel; the pixel's colour is not a layer. Five layers describe the pixel's hit:
//! depth, normal, base colour, triangle and object. Two layers contain the numbers of ray-triangle tests and of visited
//! tree nodes of the pixel's rays.

use super::colour::{COUNT_SCALE_HEIGHT, draw_count_scale, viridis};
use super::{Radiance, save_rgb8};
use crate::error::{Error, Result};
use crate::output::{Target, mark};
use crate::reference::layers::{Layers, NOTHING};
use crate::scene::srgb_value;
use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Text, WritableImage as _};
use image::{Rgb, RgbImage};
use std::fs::File;
use std::io::{BufWriter, Error as IoError, Result as IoResult, Write as _};

/// The suffix of each layer's PNG file name.
const NAMES: [&str; 7] = ["depth", "normal", "albedo", "triangle", "object", "tests", "nodes"];

/// Returns the files to which layers are written. A target NAME.exr gets all layers and the picture, so this
/// file may be the same as `picture`. For a target NAME.png, each layer has a separate file, such as
/// NAME-depth.png.
///
/// # Errors
///
/// Returns a user error if the target has another extension, if the file of a layer would replace `picture`,
/// or if a file may not be written.
pub fn layer_targets(target: &Target, picture: &Target) -> Result<Vec<Target>> {
    let path = target.path();
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    let targets = if ending == "exr" {
        vec![target.clone()]
    } else if ending == "png" {
        let layers = NAMES.map(|name| target.with_ending(&format!("-{name}.png")));
        layers.iter().try_for_each(|layer| refuse_picture(layer, picture))?;
        layers.to_vec()
    } else {
        let message = format!("'{}' is not a valid name for layers", path.display());
        return Err(Error::input(message).with_help(
            "use NAME.exr for one file with all layers, or NAME.png for one file per layer, such as NAME-depth.png",
        ));
    };
    targets.iter().try_for_each(Target::check)?;
    Ok(targets)
}

/// Returns an error if the file of a layer would replace the picture.
fn refuse_picture(layer: &Target, picture: &Target) -> Result<()> {
    if !layer.is_same_file(picture) {
        return Ok(());
    }
    let message = format!("'{}' is both the picture and a layer; expected two files", layer.path().display());
    Err(Error::input(message).with_help(
        "choose another `-o FILE` or `--layers FILE`; one .exr file may hold the picture and all layers",
    ))
}

/// Writes the layers and, in an EXR, the picture too.
pub fn save_layers(image: &Radiance, layers: &Layers, targets: &[Target]) -> Result<()> {
    if let [all] = targets {
        return all.write(|file| exr(image, layers, file));
    }
    let pictures = [
        grey(layers),
        directions(layers),
        colours(layers),
        numbers(layers, &layers.triangle),
        numbers(layers, &layers.object),
        counts(layers.size, layers.tests.iter().copied()),
        counts(layers.size, layers.nodes.iter().copied()),
    ];
    targets.iter().zip(&pictures).try_for_each(|(target, picture)| save_rgb8(picture, target))
}

/// Writes one EXR, compressed without loss in blocks of 16 lines (ZIP). The EXR stores lines instead of
/// tiles, because simple readers of EXR files cannot read tiles.
fn exr(image: &Radiance, layers: &Layers, file: &mut File) -> IoResult<()> {
    let floats = |name: &str, values: Vec<f32>| AnyChannel::new(name, FlatSamples::F32(values));
    let words = |name: &str, values: &[u32]| AnyChannel::new(name, FlatSamples::U32(values.to_vec()));
    let of = |pixels: &[[f32; 3]], channel: usize| pixels.iter().map(|pixel| pixel[channel]).collect();
    let alpha = (!image.coverage.is_empty()).then(|| floats("A", image.coverage.clone()));
    let channels = [
        floats("R", of(&image.pixels, 0)),
        floats("G", of(&image.pixels, 1)),
        floats("B", of(&image.pixels, 2)),
        floats("Z", layers.depth.clone()),
        floats("N.X", of(&layers.normal, 0)),
        floats("N.Y", of(&layers.normal, 1)),
        floats("N.Z", of(&layers.normal, 2)),
        floats("albedo.R", of(&layers.albedo, 0)),
        floats("albedo.G", of(&layers.albedo, 1)),
        floats("albedo.B", of(&layers.albedo, 2)),
        words("triangle", &layers.triangle),
        words("object", &layers.object),
        words("tests", &layers.tests),
        words("nodes", &layers.nodes),
    ];
    let size = layers.size.map(|side| side as usize);
    let channels = AnyChannels::sort(channels.into_iter().chain(alpha).collect());
    let mut exr = Image::from_encoded_channels((size[0], size[1]), Encoding::SMALL_LOSSLESS, channels);
    exr.layer_data.attributes.comments = Some(Text::from(mark::blank().as_str()));
    let mut writer = BufWriter::new(file);
    exr.write().to_buffered(&mut writer).map_err(IoError::other)?;
    writer.flush()
}

fn picture(layers: &Layers, colour: impl Fn(usize) -> [u8; 3]) -> RgbImage {
    let [width, height] = layers.size;
    RgbImage::from_fn(width, height, |x, y| Rgb(colour((y * width + x) as usize)))
}

/// Returns a picture of the depths, from white (nearest) to dark grey (farthest). Pixels without a hit are
/// black.
fn grey(layers: &Layers) -> RgbImage {
    let seen = || layers.depth.iter().copied().filter(|depth| depth.is_finite());
    let (near, far) = (seen().fold(f32::INFINITY, f32::min), seen().fold(0.0, f32::max));
    picture(layers, |pixel| {
        let depth = layers.depth[pixel];
        // If all depths are equal, every hit is a nearest hit, and is white.
        let part = if near < far { (far - depth) / (far - near) } else { 1.0 };
        let value = if depth.is_finite() { 40.0 + 215.0 * part } else { 0.0 };
        [value.round() as u8; 3]
    })
}

/// Returns a picture of the normals: each component from -1 to 1 becomes a colour channel from 0 to 255. Pixels
/// without a hit, and hits whose normal is zero, are black.
fn directions(layers: &Layers) -> RgbImage {
    picture(layers, |pixel| match layers.normal[pixel] {
        [0.0, 0.0, 0.0] => [0; 3],
        normal => normal.map(|component| (127.5 + 127.5 * component).round() as u8),
    })
}

/// Returns a picture of the base colours in sRGB, so that a texture on a white surface has the 8-bit colours of
/// the texture's file. Base colours above 1 are shown as 1.
fn colours(layers: &Layers) -> RgbImage {
    picture(layers, |pixel| layers.albedo[pixel].map(srgb_value))
}

/// Returns a picture of numbers (such as triangle numbers), in which consecutive numbers have different
/// colours. Pixels without a hit are black.
fn numbers(layers: &Layers, numbers: &[u32]) -> RgbImage {
    picture(layers, |pixel| match numbers[pixel] {
        NOTHING => [0; 3],
        number => {
            // Multiplicative hashing (Knuth, volume 3, section 6.4) makes a colour from a pixel's number,
            // such as the number of its triangle.
            let bits = number.wrapping_add(1).wrapping_mul(2_654_435_769).to_be_bytes();
            [bits[0], bits[1], bits[2]].map(|byte| 48 + byte / 5 * 4)
        }
    })
}

/// Returns a picture of one number per pixel in false colours, dark for 0, with a colour scale below the
/// picture.
pub fn counts([width, height]: [u32; 2], counts: impl Iterator<Item = u32> + Clone) -> RgbImage {
    let most = counts.clone().max().unwrap_or(0).max(1);
    let mut picture = RgbImage::new(width, height + COUNT_SCALE_HEIGHT);
    for (pixel, count) in picture.pixels_mut().zip(counts) {
        *pixel = Rgb(viridis(f64::from(count) / f64::from(most)));
    }
    draw_count_scale(&mut picture, height, most);
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_and_nodes_are_pictures_of_their_own() {
        let layers = Layers {
            size: [2, 1],
            depth: vec![1.0; 2],
            normal: vec![[0.0, 0.0, 1.0]; 2],
            albedo: vec![[0.5; 3]; 2],
            triangle: vec![0; 2],
            object: vec![0; 2],
            tests: vec![0, 5],
            nodes: vec![9, 0],
        };
        let folder = tempfile::tempdir().unwrap();
        let target = |name: &str| Target::of_results(folder.path().join(name));
        let targets = layer_targets(&target("a.png"), &target("picture.png")).unwrap();
        save_layers(&Radiance::new(2, 1), &layers, &targets).unwrap();
        let shown = |name: &str| {
            let picture = image::open(folder.path().join(name)).unwrap().to_rgb8();
            [picture[(0, 0)].0, picture[(1, 0)].0]
        };
        assert_eq!(shown("a-tests.png"), [viridis(0.0), viridis(1.0)]);
        assert_eq!(shown("a-nodes.png"), [viridis(1.0), viridis(0.0)]);
    }

    #[test]
    fn an_exr_holds_each_value_under_its_own_name() {
        let layers = Layers {
            size: [1, 1],
            depth: vec![1.0],
            normal: vec![[0.25, 0.5, 0.75]],
            albedo: vec![[0.5, 0.125, 1.5]],
            triangle: vec![1],
            object: vec![2],
            tests: vec![3],
            nodes: vec![7],
        };
        let picture = Radiance { pixels: vec![[0.1, 0.2, 0.3]], ..Radiance::new(1, 1) };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        save_layers(&picture, &layers, &[Target::of_results(&path)]).unwrap();
        let file = exr::prelude::read_first_flat_layer_from_file(&path).unwrap();
        let samples = |name: &str| {
            let mut channels = file.layer_data.channel_data.list.iter();
            channels.find(|channel| channel.name.eq(name)).map(|channel| channel.sample_data.clone())
        };
        let value = |name: &str| match samples(name) {
            Some(FlatSamples::F32(values)) => values[0],
            other => panic!("{name}: {other:?}"),
        };
        let number = |name: &str| match samples(name) {
            Some(FlatSamples::U32(values)) => values[0],
            other => panic!("{name}: {other:?}"),
        };
        assert_eq!(["R", "G", "B"].map(value), [0.1, 0.2, 0.3]);
        assert_eq!(["triangle", "object", "tests", "nodes"].map(number), [1, 2, 3, 7]);
        assert_eq!(["N.X", "N.Y", "N.Z"].map(value), [0.25, 0.5, 0.75]);
        assert_eq!(["albedo.R", "albedo.G", "albedo.B"].map(value), [0.5, 0.125, 1.5]);
        // In an EXR file, a bit in the second byte of the version number says whether the file has tiles.
        assert_eq!(std::fs::read(&path).unwrap()[5] & 0x02, 0, "its blocks are tiles");
    }

    /// Returns the grey values that show a row of depths.
    fn greys(depth: &[f32]) -> Vec<u8> {
        let layers = Layers { size: [depth.len() as u32, 1], depth: depth.to_vec(), ..Layers::default() };
        grey(&layers).pixels().map(|pixel| pixel.0[0]).collect()
    }

    #[test]
    fn the_nearest_depth_is_white_even_if_there_is_no_other() {
        assert_eq!(greys(&[1.0, 3.0, 2.0, f32::INFINITY]), [255, 40, 148, 0]);
        assert_eq!(greys(&[2.0, f32::INFINITY, 2.0]), [255, 0, 255]);
        assert_eq!(greys(&[f32::INFINITY]), [0]);
    }

    #[test]
    fn consecutive_numbers_have_different_colours_and_nothing_is_black() {
        let picture = numbers(&Layers { size: [3, 1], ..Layers::default() }, &[NOTHING, 0, 1]);
        let colours: Vec<[u8; 3]> = picture.pixels().map(|pixel| pixel.0).collect();
        assert_eq!(colours, [[0; 3], [172, 92, 144], [96, 136, 240]]);
    }

    #[test]
    fn no_layer_takes_the_pictures_path() {
        let folder = tempfile::tempdir().unwrap();
        let target = |name: &str| Target::of_results(folder.path().join(name));
        let layers = |name: &str, picture: &str| layer_targets(&target(name), &target(picture));
        let names = |targets: Vec<Target>| -> Vec<String> {
            targets.iter().map(|one| one.path().file_name().unwrap().to_string_lossy().into_owned()).collect()
        };
        assert!(names(layers("a.png", "b.png").unwrap()).contains(&"a-depth.png".to_owned()));
        let error = layers("a.png", "a-depth.png").unwrap_err().to_string();
        assert!(error.contains("a-depth.png' is both the picture and a layer"), "{error}");
        assert_eq!(names(layers("a.exr", "a.exr").unwrap()), ["a.exr"], "one file may hold all");
        assert!(layers("a.txt", "b.png").is_err());
    }

    #[test]
    fn the_parts_of_a_normal_are_red_green_and_blue() {
        let normal = vec![[1.0, -1.0, 0.0], [0.0, 0.5, -0.5], [0.0; 3]];
        let layers = Layers { size: [3, 1], normal, ..Layers::default() };
        let shown: Vec<[u8; 3]> = directions(&layers).pixels().map(|pixel| pixel.0).collect();
        assert_eq!(shown, [[255, 0, 128], [128, 191, 64], [0; 3]]);
    }

    #[test]
    fn base_colours_are_srgb_without_exposure() {
        let albedo = vec![[1.0, 0.5, 0.0], [2.0, 0.215_86, -1.0]];
        let layers = Layers { size: [2, 1], albedo, ..Layers::default() };
        let shown: Vec<[u8; 3]> = colours(&layers).pixels().map(|pixel| pixel.0).collect();
        assert_eq!(shown, [[255, 188, 0], [255, 128, 0]]);
    }

    #[test]
    fn each_layer_stands_in_the_file_of_its_name() {
        let layers = Layers {
            size: [3, 2],
            depth: vec![1.0, 2.0, f32::INFINITY, 1.0, 1.0, 1.0],
            normal: vec![[0.0, 0.0, 1.0]; 6],
            albedo: vec![[0.0; 3], [1.0; 3], [1.0; 3], [1.0; 3], [1.0; 3], [1.0; 3]],
            triangle: vec![NOTHING, 1, 1, 1, 1, 1],
            object: vec![1, 1, NOTHING, 1, 1, 1],
            tests: vec![4; 6],
            nodes: vec![4; 6],
        };
        let folder = tempfile::tempdir().unwrap();
        let target = |name: &str| Target::of_results(folder.path().join(name));
        let targets = layer_targets(&target("a.PNG"), &target("picture.png")).unwrap();
        save_layers(&Radiance::new(3, 2), &layers, &targets).unwrap();
        let shown = |name: &str| image::open(folder.path().join(name)).unwrap().to_rgb8();
        let black =
            |name: &str| -> Vec<bool> { shown(name).pixels().map(|pixel| pixel.0 == [0; 3]).collect() };
        assert_eq!(black("a-depth.png"), [false, false, true, false, false, false]);
        assert_eq!(black("a-triangle.png"), [true, false, false, false, false, false]);
        assert_eq!(black("a-object.png"), [false, false, true, false, false, false]);
        assert_eq!(black("a-albedo.png"), [true, false, false, false, false, false]);
        assert_eq!(shown("a-normal.png")[(2, 1)].0, [128, 128, 255]);
        assert_eq!(shown("a-depth.png")[(1, 0)].0, [40; 3], "the farthest");
    }
}
