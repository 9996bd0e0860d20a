//! Pictures with a transparent background: their alpha channel is the share of a pixel that surfaces cover.

use crate::binary::{TRIANGLE, WorkFolder, device, has, repository};
use crate::common::soon;
use image::{Rgb32FImage, Rgba32FImage};

const STRATEGIES: [&str; 5] = ["deferred", "wide-common-origin", "bvh", "tile", "tile-group"];

fn render(folder: &WorkFolder, options: &[&str]) -> String {
    let (scene, device) = (scene(), device());
    let usual = ["render", &scene, "--width", "61", "--height", "43", "--device", &device, "--force"];
    folder.output(&[&usual[..], options].concat())
}

fn scene() -> String {
    repository("scenes/still-life.toml").display().to_string()
}

fn opaque(folder: &WorkFolder, background: &str, strategy: &str) -> Rgb32FImage {
    let set = format!("background={background}");
    render(folder, &["--set", &set, "--samples", "4", "--strategy", strategy, "-o", "out.exr"]);
    image::open(folder.path("out.exr")).expect("a picture").to_rgb32f()
}

fn transparent(folder: &WorkFolder, options: &[&str], name: &str) -> Rgba32FImage {
    render(folder, &[&["--background", "transparent", "-o", name][..], options].concat());
    let picture = image::open(folder.path(name)).expect("a picture");
    assert!(picture.color().has_alpha(), "{name}");
    picture.to_rgba32f()
}

/// In front of a background of radiance b, a pixel is the radiance of its surfaces plus b times the share of the pixel
/// that no surface covers.
#[test]
fn alpha_is_what_a_background_does_not_show_through_in_every_family() {
    let folder = WorkFolder::new();
    for strategy in soon(STRATEGIES) {
        let picture =
            transparent(&folder, &["--samples", "4", "--strategy", strategy, "--verify=300"], "out.exr");
        let [white, black] = ["0.5", "0"].map(|background| opaque(&folder, background, strategy));
        let mut partly = 0;
        for (x, y, pixel) in picture.enumerate_pixels() {
            let [red, green, blue, alpha] = pixel.0;
            assert_eq!([red, green, blue], black[(x, y)].0, "{strategy}: ({x}, {y})");
            let through = (white[(x, y)].0[1] - black[(x, y)].0[1]) / 0.5;
            assert!((1.0 - alpha - through).abs() < 1e-5, "{strategy}: ({x}, {y}) {alpha} {through}");
            partly += usize::from(alpha > 0.0 && alpha < 1.0);
        }
        assert!(partly > 50, "{strategy}: {partly}");
    }
}

/// An unlit surface has the same colour as a transparent background, so only alpha shows its edges.
#[test]
fn edges_of_a_dark_surface_get_more_samples() {
    let (folder, device) = (WorkFolder::with(&[("scene.toml", TRIANGLE)]), device());
    let usual = ["render", "scene.toml", "--width", "61", "--height", "43", "--device", &device];
    let dark = ["--set", "light.0.power=0", "--background", "transparent", "-o", "out.exr", "--force"];
    for strategy in soon(["bvh", "tile", "tile-group"]) {
        let sampled = ["--samples", "16", "--adaptive", "--verify", "--strategy", strategy];
        folder.output(&[&usual[..], &dark, &sampled].concat());
        let picture = image::open(folder.path("out.exr")).expect("a picture").to_rgba32f();
        let partly = picture.pixels().filter(|pixel| pixel.0[3] > 0.0 && pixel.0[3] < 1.0).count();
        assert!(partly > 50, "{strategy}: {partly}");
    }
}

/// The changed kernel halves the alpha of every fourth pixel. Colours, and which pixels show a surface, stay the same.
#[test]
fn a_wrong_alpha_is_a_wrong_picture() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let halved =
        ("tile_cpu/store_tile.cl", "(float4)(r.x, g.x, b.x, h.x)", "(float4)(r.x, g.x, b.x, 0.5f * h.x)");
    folder.notices(halved, "tile", &["--background", "transparent", "--samples", "4", "--verify"]);
}

/// With many lights, the strategy `tile-group` adds light to the picture in several rounds, with a few of the
/// lights in each round.
#[test]
fn a_surface_under_many_lights_covers_its_pixel_once() {
    let (folder, device) = (WorkFolder::new(), device());
    let scene = repository("scenes/many-lights.toml").display().to_string();
    let coverage = |strategy: &str| -> Vec<f32> {
        let usual = ["render", &scene, "--width", "45", "--height", "29", "--device", &device, "--force"];
        let more = ["--background", "transparent", "--strategy", strategy, "-o", "out.exr"];
        folder.output(&[&usual[..], &more].concat());
        let picture = image::open(folder.path("out.exr")).expect("a picture").to_rgba32f();
        picture.pixels().map(|pixel| pixel.0[3]).collect()
    };
    let expected = coverage("bvh");
    assert!(expected.contains(&0.0) && expected.contains(&1.0));
    for strategy in soon(["tile", "tile-group"]) {
        assert!(coverage(strategy) == expected, "{strategy}");
    }
}

#[test]
fn a_png_has_the_colour_of_the_covered_part() {
    let folder = WorkFolder::new();
    let exr = transparent(&folder, &["--samples", "4"], "out.exr");
    let png = transparent(&folder, &["--samples", "4"], "out.png");
    // Applies the scene's display transform (exposure 15, gamma 2.2).
    let shown = |radiance: f32, alpha: f32| (15.0 * radiance / alpha).clamp(0.0, 1.0).powf(1.0 / 2.2);
    for (x, y, pixel) in exr.enumerate_pixels() {
        let [red, .., alpha] = pixel.0;
        let [shown_red, .., shown_alpha] = png[(x, y)].0;
        assert!((alpha - shown_alpha).abs() <= 0.5 / 255.0 + 1e-6, "({x}, {y})");
        let expected = if alpha > 0.0 { shown(red, alpha) } else { 0.0 };
        assert!((expected - shown_red).abs() <= 1.1 / 255.0, "({x}, {y}): {expected}, {shown_red}");
    }
    // With a single sample, the device may apply the display transform itself.
    let whole = transparent(&folder, &[], "out.png");
    assert!(whole.pixels().all(|pixel| pixel.0[3] == 0.0 || pixel.0[3] == 1.0));
}

#[test]
fn formats_without_alpha_are_refused_by_name() {
    let folder = WorkFolder::new();
    let (scene, device) = (scene(), device());
    let refused = |options: &[&str]| {
        let usual = ["render", &scene, "--device", &device, "--background", "transparent"];
        folder.mistake(&[&usual[..], options].concat(), 2)
    };
    has(&refused(&["-o", "out.jpg"]), &["'out.jpg': a JPEG has no alpha channel", "'out.png' or 'out.exr'"]);
    has(&refused(&["-o", "out.hdr"]), &["'out.hdr': an HDR has no alpha channel"]);
    has(&refused(&["--turntable", "4", "-o", "-"]), &["a y4m stream has no alpha channel", "NAME.apng"]);
    let devices = ["render", &scene, "--devices", &device, "--background", "transparent", "-o", "out.jpg"];
    has(&folder.mistake(&devices, 2), &["'out.jpg': a JPEG has no alpha channel"]);
    let unknown = ["render", &scene, "--device", &device, "--background", "none"];
    has(
        &folder.mistake(&unknown, 2),
        &["neither a display colour such as", "nor \"black\", \"white\" or \"transparent\""],
    );
}

#[test]
fn frames_bands_and_layers_have_alpha_too() {
    let folder = WorkFolder::new();
    let (scene, device) = (scene(), device());
    let cast = |options: &[&str]| {
        let usual = ["render", &scene, "--width", "61", "--height", "43", "--background", "transparent"];
        folder.output(&[&usual[..], options].concat());
    };
    cast(&["--device", &device, "--turntable", "2", "-o", "turn.png"]);
    cast(&["--device", &device, "--turntable", "2", "-o", "turn.apng"]);
    cast(&["--devices", &device, "-o", "bands.png"]);
    cast(&["--device", &device, "-o", "one.png", "--layers", "layers.exr"]);
    for name in ["turn-0001.png", "turn-0002.png", "turn.apng", "bands.png", "one.png", "layers.exr"] {
        let bytes = std::fs::read(folder.path(name)).expect("a file");
        let picture = image::load_from_memory(&bytes).expect("a picture");
        assert!(picture.color().has_alpha(), "{name}");
        let clear = picture.to_rgba32f().pixels().filter(|pixel| pixel.0[3] == 0.0).count();
        assert!(clear > 100 && clear < 61 * 43 - 100, "{name}: {clear}");
    }
}
