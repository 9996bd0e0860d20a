//! Mip levels: textures that are seen from far away, in every kernel family that supports textures.

use crate::binary::{WorkFolder, apart, has, repository};
use crate::common::{due, one_preset_of_each_family, soon};
use image::{Rgb, RgbImage};

const OFF: [&str; 2] = ["--set", "mip_levels=false"];
/// Rows of a picture in which the floor is so far away that a pixel covers a longer part of the floor than one square
/// of the chequers.
const FAR: std::ops::Range<u32> = 25..30;

/// Returns a folder with a chequered floor that is seen at a grazing angle, and a wall in front of it.
fn floor() -> WorkFolder {
    folder_of("chequers")
}

/// Returns a folder with the scene of tests/data that has this name, and with the scene's other files.
fn folder_of(name: &str) -> WorkFolder {
    let folder = WorkFolder::new();
    for ending in ["toml", "obj", "mtl", "png"] {
        let file = format!("{name}.{ending}");
        std::fs::copy(repository("tests/data").join(&file), folder.path(&file)).expect("a copy");
    }
    change(&folder, &format!("{name}.toml"), "scene.toml", &[]);
    folder
}

/// Writes a copy of a file under another name, with some parts of its text replaced.
fn change(folder: &WorkFolder, file: &str, name: &str, texts: &[(&str, &str)]) {
    let mut text = folder.text(file);
    for (from, to) in texts {
        assert!(text.contains(from), "{file} no longer says {from}");
        text = text.replace(from, to);
    }
    folder.write(name, &text);
}

/// Returns the root mean square difference of the 8-bit channels (0 to 255), in some rows to the right of the
/// wall.
fn error(a: &RgbImage, b: &RgbImage, rows: std::ops::Range<u32>) -> f64 {
    let positions: Vec<_> = rows.flat_map(|y| (36..a.width()).map(move |x| (x, y))).collect();
    let squared = |position: &(u32, u32)| {
        let channels =
            a.get_pixel(position.0, position.1).0.into_iter().zip(b.get_pixel(position.0, position.1).0);
        channels.map(|(a, b)| f64::from(a.abs_diff(b)).powi(2)).sum::<f64>()
    };
    (positions.iter().map(squared).sum::<f64>() / (3 * positions.len()) as f64).sqrt()
}

#[test]
fn every_family_takes_the_reference_s_levels() {
    let folder = floor();
    let (expected, _) = folder.picture(&["--verify"]);
    for strategy in due(soon([
        "naive",
        "naive,layout=indexed16,vectors=global",
        "deferred,passes=separate",
        "tiled-common-origin",
        "wide-common-origin,intersector=pixel-linear",
        "bvh",
        "bvh-packet,passes=separate",
        "tile",
        "tile,passes=separate,intersector=watertight",
        "tile-group",
        "tile-group-watertight,passes=separate",
    ])) {
        let (picture, _) = folder.picture(&["--verify", "--strategy", strategy]);
        assert!(apart(&picture, &expected) <= 8, "{strategy}: {}", apart(&picture, &expected));
    }
}

/// The texture of this scene has eight mip levels below the full picture; no other texture of these tests has
/// more than six. The rays meet the scene's floor from behind. The mip level must not depend on the side from
/// which rays meet the floor. tests/mutants/kernels.toml has changes to kernels that only the eight levels,
/// or rays from behind, reveal.
#[test]
fn a_floor_that_rays_meet_from_behind_takes_the_last_levels_of_a_large_picture() {
    let folder = folder_of("stripes");
    // The rasteriser does not support textures.
    let families = one_preset_of_each_family().into_iter().map(|preset| preset.name);
    for strategy in soon(families.filter(|name| *name != "raster")) {
        folder.picture(&["--verify", "--strategy", strategy]);
    }
}

#[test]
fn samples_have_narrower_cones_in_soft_light_too() {
    let folder = floor();
    let soft = ("8e4]", "8e4]\nradius = 20\n[sky]\nzenith = 0.02");
    change(&folder, "scene.toml", "scene.toml", &[soft]);
    for strategy in due(soon(["tile", "bvh-packet", "deferred", "tile-group"])) {
        folder.picture(&["--verify", "--samples", "4", "--strategy", strategy]);
        folder.picture(&["--verify", "--samples", "8", "--adaptive", "--strategy", strategy]);
    }
}

#[test]
fn a_distant_chequer_is_close_to_its_mean() {
    let folder = floor();
    let one = folder.picture(&[]).0;
    let aliased = folder.picture(&OFF).0;
    let exact = folder.picture(&[&OFF[..], &["--samples", "256"]].concat()).0;
    let [with, without] = [&one, &aliased].map(|picture| error(picture, &exact, FAR));
    assert!(4.0 * with < without, "{with} with mip levels, {without} without");
    // With several samples per pixel, ray cones are narrower, so the picture is sharper than with one sample.
    let several = folder.picture(&["--samples", "64"]).0;
    let sharp = error(&several, &exact, 36..45);
    assert!(sharp < 4.0 && 2.0 * sharp < error(&one, &exact, 36..45), "{sharp}");
}

#[test]
fn where_texels_are_larger_than_pixels_nothing_changes() {
    let folder = floor();
    let [with, without] = [folder.picture(&[]).0, folder.picture(&OFF).0];
    // The wall is in the left half of the picture. The wall hides the rows at the horizon, and some rows
    // above and below them.
    let wall = |picture: &RgbImage| image::imageops::crop_imm(picture, 16, 17, 12, 11).to_image();
    assert_eq!(wall(&with), wall(&without));
    let shades = wall(&with).pixels().map(|pixel| pixel.0).collect::<std::collections::BTreeSet<_>>().len();
    assert!(shades > 5 && with != without, "{shades}");
}

/// In this texture, opaque squares ("leaves") of one colour lie between transparent texels of another colour.
/// The background has a third colour.
#[test]
fn masks_keep_their_holes_and_colours_keep_clear_of_transparent_texels() {
    let folder = floor();
    change(&folder, "chequers.mtl", "chequers.mtl", &[("map_Kd", "map_d chequers.png\nmap_Kd")]);
    let leaves = image::RgbaImage::from_fn(32, 32, |x, y| match (x / 8 + y / 8) % 3 {
        0 => image::Rgba([20, 200, 20, 255]),
        _ => image::Rgba([250, 0, 250, 0]),
    });
    leaves.save(folder.path("chequers.png")).expect("a picture");
    change(&folder, "scene.toml", "scene.toml", &[("[0.01, 0.02, 0.05]", "\"#0000ff\"")]);
    let holes = |options: &[&str]| {
        let picture = folder.picture(&[&["--verify"], options].concat()).0;
        let hole = |pixel: &Rgb<u8>| pixel.0 == [0, 0, 255];
        (picture.pixels().map(hole).collect::<Vec<_>>(), picture)
    };
    let [(with, picture), (without, _)] = [holes(&[]), holes(&OFF)];
    assert!(with == without && with[72 * 24..].iter().any(|hole| *hole));
    // Far away, a leaf covers about a pixel and is read from a level of few texels. The leaf is still green,
    // although texels at the leaf's edge are mixed with texels around it.
    let rows = FAR.start * 72..FAR.end * 72;
    let leaf = |index: u32| picture.get_pixel(index % 72, index / 72).0;
    let leaves: Vec<_> = rows.filter(|index| !with[*index as usize]).map(leaf).collect();
    let green = leaves.iter().filter(|leaf| leaf[1] > leaf[0]).count();
    assert!(leaves.len() > 50 && 10 * green > 9 * leaves.len(), "{green} of {}", leaves.len());
}

/// Each changed kernel makes one mistake: it uses a mip level of another size, gives two levels the same weight, uses a
/// wrong ray cone, or reads texels of the previous level.
#[test]
fn a_broken_level_is_a_wrong_picture() {
    let folder = floor();
    let changes = [
        ("log2(width / across)", "log2(width / across) + 0.5f"),
        ("log2(width / across)", "log2(width)"),
        ("rest = 1.0f - part;", "rest = part;"),
        ("const int last = (int)(head[3] >> 12 & 15);", "const int last = (int)(head[3] >> 13 & 15);"),
        ("level.first += (uint)(level.width * level.height);", "level.first += (uint)level.width;"),
        ("const varying width = t *", "const varying width ="),
    ];
    let all = ["deferred", "tile"].into_iter().flat_map(|strategy| changes.map(|change| (strategy, change)));
    for (strategy, (from, to)) in due(all) {
        folder.notices(("common/textures.cl", from, to), strategy, &["--verify"]);
    }
}

/// If a picture has few rows or few columns, its last mip levels are one texel high or wide.
#[test]
fn levels_of_pictures_with_few_rows_or_columns_keep_one_of_them() {
    let folder = floor();
    for (size, from, to) in [
        ([64, 4], "level.height = max(level.height / 2, 1)", "level.height = level.height / 2"),
        ([4, 64], "level.width = max(level.width / 2, 1)", "level.width = level.width / 2"),
    ] {
        let pixel = |x: u32, y: u32| Rgb([(60 * x % 256) as u8, (50 * y % 256) as u8, 200]);
        RgbImage::from_fn(size[0], size[1], pixel).save(folder.path("chequers.png")).expect("a picture");
        for strategy in ["deferred", "tile"] {
            folder.picture(&["--verify", "--strategy", strategy]);
        }
        folder.notices(("common/textures.cl", from, to), "deferred", &["--verify"]);
    }
}

#[test]
fn an_option_that_is_misspelt_is_refused() {
    let folder = floor();
    change(&folder, "scene.toml", "scene.toml", &[("background", "mip_levels = 3\nbackground")]);
    has(&folder.mistake(&["render", "scene.toml"], 2), &["scene.toml:3", "mip_levels"]);
}
