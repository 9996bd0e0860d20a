//! Soft lights and the sky, in every kernel family that supports them.

use crate::binary::{WorkFolder, device, has, repository};
use crate::common::{due, is_long};
use image::RgbImage;

/// A square over the ground, a light with a radius above the square, and a point light.
const SQUARE: &str = "[camera]
position = [0, 1.2, 1.5]
look_at = [0, -0.7, -3]
[[light]]
position = [0, 3, -3]
power = 60
radius = 0.6
[[light]]
position = [3, 2, 0]
power = 10
[[object]]
vertices = [[-0.7, 0, -3.7], [0.7, 0, -3.7], [0.7, 0, -2.3], [-0.7, 0, -2.3]]
faces = [[0, 3, 2, 1]]
[[object]]
shape = \"ground\"
";

/// A ball on the ground, under a sky instead of lights.
const SKY: &str = "[camera]
position = [0, 1.2, 1.5]
look_at = [0, -0.7, -3]
[sky]
zenith = 0.05
horizon = [0.02, 0.03, 0.04]
[[object]]
shape = \"sphere\"
triangles = 60
scale = 0.6
translation = [0, -0.3, -3]
[[object]]
shape = \"ground\"
";

fn render(folder: &WorkFolder, options: &[&str]) -> (RgbImage, String) {
    let device = device();
    let usual = ["render", "scene.toml", "--width", "60", "--height", "40", "--device", &device];
    let said = folder.output(&[&usual, &["-o", "a.png", "--force"][..], options].concat());
    (image::open(folder.path("a.png")).expect("a picture").to_rgb8(), said)
}

fn picture(folder: &WorkFolder, options: &[&str]) -> RgbImage {
    render(folder, options).0
}

/// Strategies that differ in how they cast rays: one by one and in vectors, with and without planes through a
/// common origin, with and without a tree, in fused and in separate passes.
const FAMILIES: [&str; 5] = ["tile", "bvh", "naive", "wide-common-origin", "tile,passes=separate"];

/// The changed kernel treats every ray to the sky that it casts alone as blocked. A ray from flat ground meets no box
/// of the tree, so it is not cast.
#[test]
fn rays_to_the_sky_that_meet_no_box_are_not_cast() {
    let scene = "[camera]\nposition = [0, 1.2, 1.5]\nlook_at = [0, -0.7, -3]\n\
        [sky]\nzenith = 0.05\n[[object]]\nshape = \"ground\"\n";
    let folder = WorkFolder::with(&[("scene.toml", scene)]);
    let options = ["--samples", "4", "--strategy", "tile"];
    let right = picture(&folder, &options);
    let kernels = folder.kernels(
        "tile_cpu/single_ray.cl",
        "    int waiting = 1;",
        "    if (1) return 1;\n    int waiting = 1;",
    );
    assert!(picture(&folder, &[&options[..], &["--cl-dir", &kernels]].concat()) == right, "a ray was cast");
    std::fs::write(folder.path("scene.toml"), SKY).expect("the scene is written");
    let right = picture(&folder, &options);
    assert!(picture(&folder, &[&options[..], &["--cl-dir", &kernels]].concat()) != right, "no ray was cast");
}

#[test]
fn lights_with_a_radius_are_soft_and_every_sample_agrees_with_the_reference() {
    let folder = WorkFolder::with(&[("scene.toml", SQUARE)]);
    let hard = picture(&folder, &["--samples", "1", "--verify"]);
    let point = ["--samples", "16", "--set", "light.0.radius=0"];
    let sharp = picture(&folder, &[&point[..], &["--verify"]].concat());
    for strategy in due(FAMILIES) {
        let soft = picture(&folder, &["--samples", "16", "--strategy", strategy, "--verify=600"]);
        // Penumbras lie on the ground around the square's shadow, and nowhere else.
        let differing =
            soft.pixels().zip(sharp.pixels()).filter(|(a, b)| a.0[1].abs_diff(b.0[1]) > 8).count();
        assert!((20..600).contains(&differing), "{strategy}: {differing}");
    }
    let differing = hard.pixels().zip(sharp.pixels()).filter(|(a, b)| a.0[1].abs_diff(b.0[1]) > 60).count();
    assert!(differing < 120, "{differing}");
    let said = render(&folder, &[]).1;
    assert!(said.contains("1 light has a radius: with one sample per pixel"), "{said}");
    let device = device();
    for options in [["--devices", &device], ["--turntable", "1"]] {
        let usual = ["render", "scene.toml", "--width", "60", "--height", "40", "-o", "b.png"];
        let said = folder.output(&[&usual[..], &options].concat());
        assert!(said.contains("1 light has a radius"), "{options:?}: {said}");
    }
    folder.mistake(&["render", "scene.toml", "--set", "light.0.radius=-1"], 2);
}

/// If all pixels used the same points of the light, four samples would produce a penumbra of four steps.
#[test]
fn each_pixel_sees_another_point_of_a_light() {
    let folder = WorkFolder::with(&[("scene.toml", SQUARE)]);
    let soft = picture(&folder, &["--samples", "4"]);
    // Counts grain: pixels that are brighter than both neighbours, or darker than both. At a smooth edge or a
    // step, no pixel is brighter or darker than both neighbours.
    let grains = |picture: &RgbImage| {
        let value = |x: u32, y: u32| i32::from(picture[(x, y)].0[1]);
        let positions = (0..40).flat_map(|y| (1..59).map(move |x| (x, y)));
        let is_grain = |&(x, y): &(u32, u32)| {
            let [left, right] = [x - 1, x + 1].map(|beside| value(x, y) - value(beside, y));
            left.abs().min(right.abs()) > 5 && left.signum() == right.signum()
        };
        positions.filter(is_grain).count()
    };
    let sharp = picture(&folder, &["--samples", "4", "--set", "light.0.radius=0"]);
    assert!(grains(&soft) > grains(&sharp) + 15, "{} {}", grains(&soft), grains(&sharp));
}

#[test]
fn a_sky_darkens_where_things_are_near_and_every_family_agrees_with_the_reference() {
    let folder = WorkFolder::with(&[("scene.toml", SKY)]);
    for strategy in due(FAMILIES) {
        // The cases are several samples, one sample, and a sky whose `reach` (the distance within which
        // surfaces block it) is less than the shadow bias.
        for more in [["--samples", "4"], ["--samples", "1"], ["--set", "sky.reach=1e-9"]] {
            picture(&folder, &[&["--verify=500", "--strategy", strategy][..], &more].concat());
        }
    }
    let shown = picture(&folder, &["--samples", "64"]);
    let ground = |picture: &RgbImage, x: u32, y: u32| i32::from(picture[(x, y)].0[1]);
    // The ground is darker beside the ball than far from it.
    let (beside, far) = (ground(&shown, 30, 22), ground(&shown, 4, 30));
    assert!(beside + 15 < far, "{beside} {far}");
    let near = picture(&folder, &["--samples", "64", "--set", "sky.reach=0.001"]);
    assert!((ground(&near, 30, 22) - ground(&near, 4, 30)).abs() < 6);
    let device = device();
    let raster = ["render", "scene.toml", "--device", &device, "--strategy", "raster"];
    has(&folder.mistake(&raster, 2), &["traversal = raster does not support a sky, which the scene has"]);
    for wrong in ["sky.zenith=-1", "sky.reach=0", "sky.colour=1"] {
        folder.mistake(&["render", "scene.toml", "--set", wrong], 2);
    }
}

/// The sky's zenith is in the direction of the camera's `up`. In the changed kernel of this test, it is in the
/// direction of the y axis.
#[test]
fn the_zenith_is_where_the_cameras_up_is() {
    let folder = WorkFolder::with(&[("scene.toml", SKY)]);
    let turned = ["--verify=500", "--set", "camera.up=[0, 0, 1]"];
    for strategy in ["bvh", "tile"] {
        picture(&folder, &[&turned[..], &["--strategy", strategy]].concat());
    }
    let up = "dot3(direction, splat(LOAD3(soft->numbers + 6)))";
    folder.notices(("common/soft.cl", up, "direction.y"), "bvh", &turned);
}

/// The numbers that choose the rays of a pixel depend on all bits of the pixel's column and row. In each changed
/// kernel of this test, the numbers depend only on the lowest eight bits of the column or of the row. The field of
/// view of the high picture is so narrow that the picture's lowest rows show the ground.
#[test]
fn the_pixels_at_the_ends_of_a_wide_or_high_picture_have_samples_of_their_own() {
    let folder = WorkFolder::with(&[("scene.toml", SKY)]);
    let options = ["--samples", "4", "--verify=500", "--set"];
    for (size, view, from, to) in [
        (["300", "12"], "camera.fov_x_degrees=60", "AS_UINT(x) & 0xffffu", "AS_UINT(x) & 0xffu"),
        (["12", "300"], "camera.fov_x_degrees=3", "AS_UINT(y) & 0xffffu", "AS_UINT(y) & 0xffu"),
    ] {
        let options = [&options[..], &[view]].concat();
        for strategy in due(FAMILIES) {
            let sized = ["--width", size[0], "--height", size[1], "--strategy", strategy];
            let usual = ["render", "scene.toml", "-o", "a.png", "--force", "--device", &device()];
            folder.output(&[&usual[..], &sized, &options[..]].concat());
        }
        folder.notices_in(size, ("common/soft.cl", from, to), "bvh", &options);
    }
}

/// Leaves of up to 32 triangles are tested eight triangles at a time. In this scene, hills float above the
/// ground.
#[test]
fn rays_to_the_sky_meet_all_triangles_of_large_leaves() {
    let hills = "[[object]]\nshape = \"terrain\"\ntriangles = 300\ntranslation = [0, 1, -3]\n";
    let folder = WorkFolder::with(&[("scene.toml", &format!("{SKY}{hills}"))]);
    let (strategy, options) = ("tile,leaf_size=32", ["--verify=500", "--samples", "4"]);
    picture(&folder, &[&options[..], &["--strategy", strategy]].concat());
    let first_eight = ("tile_cpu/single_ray.cl", "end; first += TOGETHER", "end; first = end");
    folder.notices(first_eight, strategy, &options);
}

#[test]
fn an_open_surface_has_the_skys_radiance_times_its_own_colour() {
    let scene = "[camera]\nposition = [0, 2, -4]\nlook_at = [0, 0, -4]\nup = [0, 0, -1]\n[sky]\nzenith = 0.03\n\
                 [[object]]\nshape = \"ground\"\nmaterial = { k_l = 0.5 }\n[display]\nexposure = 30\ngamma = 1\n";
    let folder = WorkFolder::with(&[("scene.toml", scene)]);
    // The expected value is 255 x 30 (exposure) x 0.03 (the sky's radiance) x 0.5 (the ground's reflectance),
    // in whatever direction the ray to the sky runs.
    assert_eq!(picture(&folder, &["--verify"])[(30, 20)].0, [114; 3]);
}

/// At coordinates as large as those of this scene, rounding moves hits off the square by a few thousandths.
/// The shadow bias of a scene near the origin (a ten-thousandth of the diagonal) would be less than that.
/// Shadow rays must start at a greater distance from the square than rounding moves hits.
#[test]
fn far_from_the_origin_a_surface_does_not_hide_the_sky_from_itself() {
    let left = "[49998, 49999.7, 49998], [49998, 49999.7, 50002]";
    let right = "[50002, 50000.3, 50002], [50002, 50000.3, 49998]";
    let scene = format!(
        "[camera]\nposition = [50000, 50001.5, 50003]\nlook_at = [50000, 50000, 50000]\n[sky]\nzenith = 0.5\n\
         [[object]]\nvertices = [{left}, {right}]\nfaces = [[0, 1, 2, 3]]\n[display]\nexposure = 2\ngamma = 1\n"
    );
    let folder = WorkFolder::with(&[("scene.toml", &scene)]);
    for strategy in ["tile", "bvh"] {
        let shown = picture(&folder, &["--samples", "16", "--strategy", strategy]);
        let middle = (20..30).flat_map(|y| (22..38).map(move |x| (x, y)));
        let values: Vec<u32> = middle.map(|at| u32::from(shown[at].0[1])).collect();
        // The expected value is 255 x 2 (exposure) x 0.5 (the sky's radiance) x 0.8 (the square's
        // reflectance). Each pixel has 16 rays to the sky, and may lose the few of these rays that graze the
        // square.
        let mean = f64::from(values.iter().sum::<u32>()) / values.len() as f64;
        assert!((mean / 204.0 - 1.0).abs() < 0.01, "{strategy}: {mean}");
        assert!(values.iter().all(|value| *value > 170), "{strategy}: {values:?}");
    }
}

/// Some strategies have tiles that work-items share. Only this test of this file compares pictures by the unchanged
/// kernels of such strategies with the reference: PoCL takes long to compile the kernels of such tiles. The tests of
/// changed kernels below expect a wrong picture, so they do not notice a kernel that is wrong even without the change.
#[test]
fn tiles_that_work_items_share_agree_with_the_reference() {
    let folder = where_shadow_rays_end();
    let (device, cache) = (device(), folder.path("cache"));
    let usual = ["render", "scene.toml", "--width", "60", "--height", "40", "--device", &device, "--force"];
    let ends = ["-o", "a.png", "--strategy", "tile-group", "--samples", "2", "--verify"];
    // Both pictures use the first picture's program. If the sky's `reach` (the distance within which surfaces block it)
    // is less than the shadow bias, nothing occludes the sky.
    for reach in ["sky.reach=1.2", "sky.reach=0.3"] {
        let mut command = folder.raycl(&[&usual[..], &ends, &["--set", reach]].concat());
        command.env("RAYCL_CACHE_MIB", "64").env("XDG_CACHE_HOME", &cache).assert().success();
    }
    // In the changed kernel, rays run past the light, or farther than the sky's reach. PoCL takes half a minute to
    // compile this kernel.
    if is_long() {
        let farther = ("tile_gpu/soft.cl", "sight.distance - bias, stack);", "sight.distance, stack);");
        folder.notices(farther, "tile-group", &["--samples", "2", "--verify"]);
    }
    // Lights are processed in rounds (a round is the lights that a frame processes together). The sky belongs to the
    // second round, and comes after the lights of this round. In each round, the lights are numbered from the round's
    // first light.
    let lights: String =
        (0..16).map(|x| format!("[[light]]\nposition = [{x}, 3, -2]\npower = 3\n")).collect();
    folder.write("scene.toml", &format!("{lights}{SQUARE}[sky]\nzenith = 0.05\nhorizon = 0.02\n"));
    let mut command = folder.raycl(&[&usual[..], &ends].concat());
    command.env("RAYCL_CACHE_MIB", "64").env("XDG_CACHE_HOME", &cache).assert().success();
    // PoCL takes half a minute to compile the changed kernel.
    if is_long() {
        let kernels = folder.kernels(
            "tile_gpu/soft.cl",
            "const int source = sources->first_light + light;\n    return",
            "const int source = light;\n    return",
        );
        let message = folder.mistake(&[&usual[..], &ends, &["--quiet", "--cl-dir", &kernels]].concat(), 1);
        has(&message, &["the picture is wrong: "]);
    }
}

/// Returns a folder with the scene of tests/data/lights.toml, in which the shadow bias is large, and a panel
/// is just behind a light. Lights get a very small radius. The scene gets a sky whose reach is about the
/// distance between the scene's last triangle and the panel behind a light.
fn where_shadow_rays_end() -> WorkFolder {
    let lights = std::fs::read_to_string(repository("tests/data/lights.toml")).expect("a scene");
    let soft = lights.replace("power =", "radius = 0.02\npower =");
    WorkFolder::with(&[("scene.toml", &format!("{soft}\n[sky]\nzenith = 0.5\nhorizon = 0.3\nreach = 1.2\n"))])
}

#[test]
fn rays_to_a_ball_and_to_the_sky_end_where_they_should() {
    let folder = where_shadow_rays_end();
    for strategy in FAMILIES {
        picture(&folder, &["--strategy", strategy, "--samples", "2", "--verify"]);
    }
}

/// Each change is one mistake in a kernel: in the choice of a sample point, in the received light, in the
/// occlusion, or in the test of a box or a triangle.
#[test]
fn a_broken_soft_light_or_sky_is_a_wrong_picture() {
    let of_both = format!("{SKY}[[light]]\nposition = [0, 3, -3]\npower = 60\nradius = 0.6\n");
    let folder = WorkFolder::with(&[("scene.toml", &of_both)]);
    for (file, from, to, strategy) in due([
        ("common/soft.cl", "bits ^= bits >> 4 & 0x0f0f0f0fu;", "", "tile"),
        ("common/soft.cl", "sqrt(u.x) * sinpi(2.0f * u.z)", "sqrt(u.x) * sinpi(2.0f * u.y)", "tile"),
        ("common/soft.cl", "return normalize_or_zero(add(normal, point));", "return point;", "deferred"),
        ("cast/soft.cl", "open &= !SOLID_ON_RAYS", "open &= SOLID_ON_RAYS", "wide-common-origin"),
        (
            "cast/soft.cl",
            "received = multiply(surface->lambertian,",
            "received = multiply(surface->glossy,",
            "deferred",
        ),
        ("tile_cpu/soft.cl", "end = first + LEAF_COUNT(word);", "end = first + 1;", "tile"),
        ("tile_cpu/soft.cl", "const float first = negative ?", "const float first = !negative ?", "tile"),
        ("tile_cpu/sky.cl", "open &= !are_stopped_alone", "open &= are_stopped_alone", "tile"),
        ("tile_cpu/single_ray.cl", "(2 * axis + negative) * NODE_WIDTH", "2 * axis * NODE_WIDTH", "tile"),
        ("tile_cpu/single_ray.cl", "min(min(x2, y2), z2)", "min(x2, y2) * 0.0f", "tile"),
        ("common/soft.cl", "flip_sign(dot3(*direction, r), sign)", "dot3(*direction, r)", "tile"),
        ("tile_cpu/single_ray.cl", "(float16)(v.y, v.y)", "(float16)(v.x, v.y)", "tile"),
        ("tile_gpu/soft.cl", "faces_it && !is_stopped", "faces_it && is_stopped", "tile-group"),
    ]) {
        folder.notices((file, from, to), strategy, &["--verify=400", "--samples", "2"]);
    }
    // The following changes have a visible effect only if a packet's rays to a large light pass many small boxes.
    let fine = of_both.replace("triangles = 60", "triangles = 2000").replace("radius = 0.6", "radius = 2.5");
    let narrower = (
        "tile_cpu/soft.cl",
        "min(near * bounds->per_low[axis], near * bounds->per_high[axis])",
        "near * bounds->per_low[axis]",
    );
    let never_mixed = ("tile_cpu/soft.cl", "bounds->per_low[axis] < 0.0f && !bounds->negative[axis];", "0;");
    let folder = WorkFolder::with(&[("scene.toml", &fine)]);
    let options = ["--verify", "--samples", "2"];
    has(&render(&folder, &[&options[..], &["--strategy", "tile"]].concat()).1, &["verified"]);
    for change in [narrower, never_mixed] {
        folder.notices(change, "tile", &options);
    }
}

/// A floor between three walls. Walls stop some of a tile's rays to the sky; the tile's other rays reach the sky.
const HALF_OPEN: &str = "[camera]
position = [0, 1.5, 4]
look_at = [0, 0.5, 0]
[sky]
zenith = 0.05
horizon = [0.02, 0.03, 0.04]
[[object]]
vertices = [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]]
faces = [[0, 1, 2, 3]]
[[object]]
vertices = [[-2, 0, -2], [2, 0, -2], [2, 3, -2], [-2, 3, -2]]
faces = [[0, 1, 2, 3]]
[[object]]
vertices = [[2, 0, 2], [2, 0, -2], [2, 3, -2], [2, 3, 2]]
faces = [[0, 1, 2, 3]]
[[object]]
vertices = [[-2, 0, 2], [-2, 0, -2], [-2, 3, -2], [-2, 3, 2]]
faces = [[0, 1, 2, 3]]
";

#[test]
fn a_stopped_ray_to_the_sky_stops_no_other() {
    let folder = WorkFolder::with(&[("scene.toml", HALF_OPEN)]);
    let device = device();
    for strategy in ["bvh-packet", "tile", "tile,passes=separate"] {
        let usual =
            ["render", "scene.toml", "--width", "161", "--height", "93", "--device", &device, "--force"];
        folder.output(&[&usual[..], &["-o", "a.png", "--verify", "--strategy", strategy]].concat());
    }
}

/// Rays from the ground to the light hit the square from below, on its back.
#[test]
fn the_back_of_a_surface_stops_no_soft_light_where_backs_are_not_seen() {
    let folder = WorkFolder::with(&[("scene.toml", SQUARE)]);
    for strategy in ["wide-common-origin,culling=back", "bvh-packet,culling=back", "tile,culling=back"] {
        picture(&folder, &["--strategy", strategy, "--samples", "2", "--verify"]);
    }
    let both_sides = ("common/soft.cl", "stopped &= a > 0.0f;", "");
    folder.notices(both_sides, "tile,culling=back", &["--verify", "--samples", "2"]);
}

/// Each changed kernel lets shadow rays end too far away: it does not subtract the shadow bias from their length.
#[test]
fn a_soft_ray_that_ends_elsewhere_is_a_wrong_picture() {
    let folder = where_shadow_rays_end();
    for (file, from, to, strategy) in [
        (
            "cast/soft.cl",
            "(varying)(reach_of_sky(&scene->soft) - scene->bias)",
            "(varying)(reach_of_sky(&scene->soft))",
            "bvh",
        ),
        (
            "tile_cpu/soft.cl",
            "from, to_light, distance - lighting->bias, lit)",
            "from, to_light, distance, lit)",
            "tile",
        ),
        (
            "tile_cpu/sky.cl",
            "reach_of_sky(&lighting->soft) - lighting->bias",
            "reach_of_sky(&lighting->soft)",
            "tile",
        ),
    ] {
        folder.notices((file, from, to), strategy, &["--verify", "--samples", "2"]);
    }
}

/// A mesh of four faces, 1 unit high, that stands on one of its faces.
const TETRAHEDRON: &str = "v 0 1 0\nv -1 0 1\nv 1 0 1\nv 0 0 -1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n";

#[test]
fn a_bare_mesh_stands_on_a_ground_in_soft_light_unless_it_is_to_be_plain() {
    let folder = WorkFolder::with(&[("mesh.obj", TETRAHEDRON)]);
    let device = device();
    let size = ["--width", "64", "--height", "40", "--force", "--device", &device, "-o", "a.png"];
    let of = |options: &[&str]| {
        let said = folder.output(&[&["render", "mesh.obj", "--json"], &size[..], options].concat());
        let report: serde_json::Value = serde_json::from_str(&said).expect("JSON");
        (image::open(folder.path("a.png")).expect("a picture").to_rgb8(), report)
    };
    let (dressed, report) = of(&["--verify"]);
    assert_eq!((&report["triangles"], &report["samples"]), (&30.into(), &6.into()));
    // The ground is grey and fills the picture, no pixel is overexposed, and surfaces that the key light does not
    // reach are not black.
    let values = || dressed.pixels().map(|pixel| pixel.0[1]);
    assert!(
        values().min() > Some(5) && values().max() < Some(250),
        "{:?} {:?}",
        values().min(),
        values().max()
    );
    assert!((90..220).contains(&dressed[(3, 36)].0[1]), "{:?}", dressed[(3, 36)]);
    let (plain, report) = of(&["--plain"]);
    assert_eq!(
        (&report["triangles"], &report["samples"], &report["lights"]),
        (&4.into(), &1.into(), &2.into())
    );
    assert_ne!(plain[(3, 36)], dressed[(3, 36)]);
    assert_eq!(of(&["--plain", "--samples", "1"]).0, plain);
    // raycl adds no ground if the user sets a background, or if the eye is below the mesh.
    for options in [["--background", "black"], ["--elevation", "-30"]] {
        assert_eq!(of(&options).1["triangles"], 4, "{options:?}");
    }
    assert_eq!(of(&["--background", "black"]).0[(3, 36)].0, [0; 3]);
    // If the user sets a light, this light replaces the lights, the sky and the ground that raycl would add.
    let own = of(&["--set", "light.0.position=[1, 4, 3]", "--set", "light.0.power=100"]).1;
    assert_eq!((&own["triangles"], &own["lights"], &own["samples"]), (&4.into(), &1.into(), &6.into()));
}

/// With a sky, the program has soft lights even with one sample per pixel. With one sample under a sky,
/// however, a light's radius has no effect.
#[test]
fn with_one_sample_under_a_sky_lights_are_points() {
    let sky = "[sky]\nzenith = 0.05\nhorizon = [0.02, 0.03, 0.04]\n";
    let folder = WorkFolder::with(&[("scene.toml", &format!("{SQUARE}{sky}"))]);
    let of = |more: &[&str]| picture(&folder, &[&["--samples", "1", "--verify"], more].concat());
    let points = ["--set", "light.0.radius=0", "--set", "light.1.radius=0.6"];
    for strategy in ["bvh", "tile"] {
        let own = ["--strategy", strategy];
        assert_eq!(of(&own), of(&[&own[..], &points].concat()), "{strategy}");
        let change = ("common/soft.cl", "return SAMPLED &&", "return");
        folder.notices(change, strategy, &["--verify", "--samples", "1"]);
    }
}
