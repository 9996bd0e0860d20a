//! Layers, which `raycl render --layers` writes beside a picture: for each pixel, the depth, the normal, the base
//! colour, the numbers of the triangle and its object, and the costs of the ray.

use crate::binary::{TRIANGLE, WorkFolder, device, has};
use exr::prelude::{FlatSamples, read_first_flat_layer_from_file};

const SIZE: [&str; 4] = ["--width", "40", "--height", "25"];

fn render(folder: &WorkFolder, options: &[&str]) {
    let device = device();
    folder.output(&[&["render", "scene.toml", "--device", &device], &SIZE[..], options].concat());
}

/// Returns a folder with a scene of two objects: a triangle at z = -2, and the ground.
fn new_folder() -> WorkFolder {
    let rest = "material = { k_l = [0.25, 0.5, 0.75] }\n[[object]]\nshape = \"ground\"\n";
    WorkFolder::with(&[("scene.toml", &format!("{TRIANGLE}{rest}"))])
}

#[test]
fn one_exr_holds_all_layers_and_the_picture() {
    let folder = new_folder();
    render(&folder, &["--layers", "all.exr", "-o", "picture.exr"]);
    let read = read_first_flat_layer_from_file(folder.path("all.exr")).expect("an EXR");
    assert_eq!(read.layer_data.encoding.compression, exr::prelude::Compression::ZIP16);
    let channel = |name: &str| {
        let named = read.layer_data.channel_data.list.iter().find(|channel| channel.name.eq(name));
        &named.unwrap_or_else(|| panic!("no channel {name}")).sample_data
    };
    let floats = |name: &str| match channel(name) {
        FlatSamples::F32(values) => values.clone(),
        other => panic!("{name}: {other:?}"),
    };
    let words = |name: &str| match channel(name) {
        FlatSamples::U32(values) => values.clone(),
        other => panic!("{name}: {other:?}"),
    };
    let (middle, corner, sky) = (12 * 40 + 20, 24 * 40 + 39, 0);
    assert!((floats("Z")[middle] - 2.0).abs() < 1e-6 && floats("Z")[sky].is_infinite());
    assert_eq!([floats("N.X")[corner], floats("N.Y")[corner], floats("N.Z")[corner]], [0.0, 1.0, 0.0]);
    assert_eq!([words("triangle")[middle], words("triangle")[sky]], [0, u32::MAX]);
    assert_eq!([words("object")[middle], words("object")[corner], words("object")[sky]], [0, 1, u32::MAX]);
    assert!(words("tests")[middle] > 0 && words("nodes")[middle] > 0);
    let albedo = |pixel: usize| ["albedo.R", "albedo.G", "albedo.B"].map(|name| floats(name)[pixel]);
    assert_eq!([albedo(middle), albedo(sky)], [[0.25, 0.5, 0.75], [0.0; 3]]);
    let picture = image::open(folder.path("picture.exr")).expect("a picture").to_rgb32f();
    let reds: Vec<f32> = picture.pixels().map(|pixel| pixel.0[0]).collect();
    assert_eq!(floats("R"), reds);
}

/// The texels are alternately black and white, and much smaller than a pixel. A pixel's base colour is the
/// mean of black and white in linear light (displayed as 188), times the material's colour.
#[test]
fn the_base_colour_is_that_of_the_texture_under_the_whole_pixel() {
    let object = "\n[[object]]\nmesh = \"quad.obj\"\ntranslation = [0, 0, -1.5]\n";
    let (obj, mtl) = (
        "mtllib quad.mtl\nusemtl m\nv -3 -3 0\nv 3 -3 0\nv 3 3 0\nv -3 3 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n",
        "newmtl m\nKd 0.5 0.5 1\nmap_Kd squares.png\n",
    );
    let scene = format!("{TRIANGLE}{object}");
    let folder = WorkFolder::with(&[("scene.toml", &scene), ("quad.obj", obj), ("quad.mtl", mtl)]);
    let squares = image::GrayImage::from_fn(512, 512, |x, y| image::Luma([255 * ((x + y) % 2) as u8]));
    squares.save(folder.path("squares.png")).expect("a picture");
    render(&folder, &["--layers", "a.png"]);
    let albedo = image::open(folder.path("a-albedo.png")).expect("a picture").to_rgb8();
    for pixel in [(20, 12), (11, 7), (30, 20)] {
        let [red, green, blue] = albedo[pixel].0;
        assert!(red == green && red.abs_diff(137) <= 1 && blue.abs_diff(188) <= 1, "{pixel:?}: {red} {blue}");
    }
}

#[test]
fn pngs_are_one_of_each_and_files_of_others_stay() {
    let folder = new_folder();
    render(&folder, &["--layers", "a.png"]);
    let size =
        |name: &str| image::image_dimensions(folder.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    for name in ["a-depth.png", "a-normal.png", "a-albedo.png", "a-triangle.png", "a-object.png"] {
        assert_eq!(size(name), (40, 25), "{name}");
    }
    for name in ["a-tests.png", "a-nodes.png"] {
        assert_eq!(size(name), (40, 25 + 18), "{name} has a scale below");
    }
    let [depth, ..] = ["depth", "normal", "albedo", "triangle", "object"].map(|name| {
        let picture = image::open(folder.path(&format!("a-{name}.png"))).expect("a picture").to_rgb8();
        assert_eq!(picture[(0, 0)].0, [0; 3], "nothing is hit, so {name} is black");
        picture
    });
    assert!(depth[(20, 12)].0 > depth[(39, 20)].0, "the triangle is nearer than the ground behind it");
    std::fs::write(folder.path("a-nodes.png"), "mine").expect("a file");
    let message = folder.mistake(&["render", "scene.toml", "--layers", "a.png"], 2);
    has(&message, &["'a-nodes.png' exists", "--layers FILE"]);
    has(
        &folder.mistake(&["render", "scene.toml", "--layers", "a.tif"], 2),
        &["NAME.exr for one file with all layers"],
    );
}

#[test]
fn a_layer_does_not_replace_the_picture() {
    let folder = new_folder();
    for picture in ["a-depth.png", "./a-depth.png", "a-nodes.png"] {
        let message = folder.mistake(&["render", "scene.toml", "-o", picture, "--layers", "a.png"], 2);
        has(&message, &["is both the picture and a layer", "`-o FILE`", "`--layers FILE`"]);
        assert!(!folder.path(picture).exists(), "{picture}");
    }
    // One EXR file holds both the picture and the layers.
    render(&folder, &["-o", "all.exr", "--layers", "./all.exr"]);
    let read = read_first_flat_layer_from_file(folder.path("all.exr")).expect("an EXR");
    let has_channel =
        |name: &str| read.layer_data.channel_data.list.iter().any(|channel| channel.name.eq(name));
    assert!(has_channel("R") && has_channel("Z"));
}

/// The order of the triangle's corners is reversed, so that the camera sees the triangle's back.
#[test]
fn layers_show_what_the_strategy_shows_of_backs() {
    let folder =
        WorkFolder::with(&[("scene.toml", &TRIANGLE.replace("faces = [[0, 1, 2]]", "faces = [[2, 1, 0]]"))]);
    let depth = |strategy: &str| {
        render(&folder, &["--layers", "all.exr", "-o", "picture.png", "--strategy", strategy]);
        let read = read_first_flat_layer_from_file(folder.path("all.exr")).expect("an EXR");
        let depth = read.layer_data.channel_data.list.iter().find(|channel| channel.name.eq("Z"));
        match depth.map(|channel| channel.sample_data.clone()) {
            Some(FlatSamples::F32(values)) => values[12 * 40 + 20],
            other => panic!("{other:?}"),
        }
    };
    assert!((depth("naive,culling=none") - 2.0).abs() < 1e-6);
    assert!(depth("naive,culling=back").is_infinite());
}

/// Layers take more of the host's memory than the picture, so raycl adds up the layers' bytes before it
/// casts.
#[test]
fn the_predicted_memory_of_the_host_includes_the_layers() {
    let (folder, device) = (new_folder(), device());
    let predicted = |options: &[&str]| {
        let usual = ["render", "scene.toml", "--device", &device, "-o", "picture.png", "--json"];
        let said = folder.output(&[&usual, &SIZE[..], options].concat());
        let report: serde_json::Value = serde_json::from_str(&said).expect("JSON");
        report["host_bytes"].as_u64().expect("a number of bytes")
    };
    assert!(predicted(&["--layers", "all.exr"]) > predicted(&[]));
}
