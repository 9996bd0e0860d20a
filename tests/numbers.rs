//! Numbers at which other ray casters fail: very small and very large scenes, lights on surfaces, cameras
//! inside meshes and on triangles, normals of length zero.

use crate::binary::WorkFolder;
use crate::common::apart::apart;
use crate::common::{COMMON_LOCAL_SIZE, Stand, compiles_soon, scene, soon};
use glam::Vec3;
use raycl::image::Radiance;
use raycl::program::Sources;
use raycl::reference::reference;
use raycl::scene::{Camera, Scene, Triangle, load_scene};
use raycl::strategy::{Culling, Epsilons, Intersector, PRESETS, Strategy, preset};
use raycl::verify::verify;

const SIZE: [u32; 2] = [30, 20];
const LOCAL: [u32; 2] = COMMON_LOCAL_SIZE;

/// Returns the same scene in other units: multiplies lengths by `factor`, and the lights' powers by the
/// square of `factor`.
fn scaled(scene: &Scene, factor: f32) -> Scene {
    let mut scene = scene.clone();
    scene.mesh_mut().positions.iter_mut().for_each(|position| *position *= factor);
    for light in &mut scene.lights {
        light.position *= factor;
        light.power *= factor * factor;
    }
    scene.camera.position *= factor;
    scene.camera.z_near *= factor;
    scene.shadow_bias *= factor;
    scene
}

fn presets() -> impl Iterator<Item = Strategy> {
    PRESETS.iter().map(|preset| preset.strategy).filter(compiles_soon)
}

/// Returns the presets of [`presets`] whose results do not depend on the scene's scale.
fn scale_free() -> impl Iterator<Item = Strategy> {
    presets().filter(|strategy| strategy.epsilons == Epsilons::Relative)
}

fn all_finite(image: &Radiance) -> bool {
    image.pixels.as_flattened().iter().all(|value| value.is_finite() && *value >= 0.0)
}

#[test]
fn a_scene_in_other_units_gives_the_same_picture() {
    apart!();
    for name in ["still-life.toml", "pyramid-lower.toml"] {
        let original = scene(name);
        for factor in [1e-4, 1e4] {
            let stand = Stand::new(scaled(&original, factor), SIZE);
            for strategy in scale_free() {
                let image = stand.cast(&strategy, LOCAL).expect("it fits");
                // The reference is cast for the original scene, not for the scaled one.
                let verdict =
                    verify(&image, None, &reference(&original, SIZE, strategy.culling), original.display);
                assert!(verdict.ok, "{name} x {factor}: {strategy}: {:?}", verdict.reason);
            }
        }
    }
}

#[test]
fn a_scene_scaled_by_a_power_of_two_gives_the_same_bits() {
    apart!();
    let original = scene("pyramid-lower.toml");
    let at = |factor| Stand::new(scaled(&original, factor), SIZE);
    let stands = [at(1.0), at(1.0 / 16384.0), at(16384.0)];
    for strategy in scale_free() {
        let [one, small, large] =
            stands.each_ref().map(|stand| stand.cast(&strategy, LOCAL).expect("it fits"));
        assert!(one == small && one == large, "{strategy}");
    }
}

/// Casts a scene with the presets of [`presets`], and checks that no value is NaN, infinite or negative, neither in the
/// images nor in the references.
fn finite_everywhere(what: &str, scene: Scene) {
    finite_at(SIZE, what, scene, presets());
}

/// Checks a scene like [`finite_everywhere`], but at another size, and with these strategies.
fn finite_at(size: [u32; 2], what: &str, scene: Scene, strategies: impl Iterator<Item = Strategy>) {
    scene.validate().unwrap_or_else(|error| panic!("{what}: {error}"));
    for culling in [Culling::None, Culling::Back] {
        assert!(all_finite(&reference(&scene, size, culling).radiance), "{what}: the reference");
    }
    let stand = Stand::new(scene, size);
    for strategy in strategies {
        let image = stand.cast(&strategy, LOCAL).expect("it fits");
        assert!(all_finite(&image), "{what}: {strategy}");
    }
}

#[test]
fn a_light_on_a_surface_or_at_a_corner() {
    apart!();
    let scene = scene("pyramid-lower.toml");
    let corners = scene.mesh.corners(&scene.mesh.triangles[0]);
    let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
    for (what, position) in [("on", centre), ("at a corner", corners[0])] {
        let mut lit = scene.clone();
        lit.lights[0].position = position;
        finite_everywhere(&format!("a light {what}"), lit);
    }
}

#[test]
fn a_light_at_the_eye() {
    apart!();
    let mut scene = scene("pyramid-lower.toml");
    scene.lights[0].position = scene.camera.position;
    finite_everywhere("a light at the eye", scene);
}

#[test]
fn a_camera_inside_a_mesh_on_a_triangle_and_at_a_corner() {
    apart!();
    let scene = scene("pyramid-lower.toml");
    let corners = scene.mesh.corners(&scene.mesh.triangles[0]);
    let middle = scene.mesh.positions.iter().copied().sum::<Vec3>() / scene.mesh.positions.len() as f32;
    let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
    for (what, position) in [("inside", middle), ("on a triangle", centre), ("at a corner", corners[0])] {
        for z_near in [0.0, scene.camera.z_near] {
            let camera = Camera { position, z_near, ..scene.camera };
            finite_everywhere(&format!("a camera {what}"), Scene { camera, ..scene.clone() });
        }
    }
}

#[test]
fn a_bias_of_nothing_and_a_bias_larger_than_the_scene() {
    apart!();
    for bias in [0.0, 100.0] {
        let scene = Scene { shadow_bias: bias, ..scene("pyramid-lower.toml") };
        finite_everywhere(&format!("a bias of {bias}"), scene);
    }
}

#[test]
fn normals_that_cancel_out_between_corners() {
    apart!();
    let mut scene = scene("triangle.toml");
    // Half-way between two opposite normals, the interpolated normal has length zero.
    let normal = scene.mesh.normals[0];
    for (at, other) in scene.mesh_mut().normals.iter_mut().enumerate() {
        *other = if at % 2 == 0 { normal } else { -normal };
    }
    finite_everywhere("opposite normals", scene);
}

/// Returns a triangle of the brightest material, lit by the strongest light from straight ahead and far away. In the
/// middle of a picture with an odd width and height, the eye sees the middle of the highlight. There, the product of
/// the light's power and the reflectance is larger than any number in single precision, but the radiance is not.
fn brightest_highlight(radius: f32) -> Scene {
    let mut scene = scene("triangle.toml");
    let mesh = scene.mesh_mut();
    mesh.normals.fill(Vec3::Z);
    for material in &mut mesh.materials {
        (material.lambertian, material.glossy, material.shininess) =
            (Vec3::splat(1e6), Vec3::splat(1e6), 1e6);
    }
    let light = &mut scene.lights[0];
    (light.position, light.power, light.radius) = (1e12 * Vec3::Z, Vec3::splat(1e28), radius);
    scene
}

#[test]
fn the_brightest_highlight_of_the_strongest_light() {
    apart!();
    let size = [SIZE[0] + 1, SIZE[1] + 1];
    finite_at(size, "a point light", brightest_highlight(0.0), presets());
    let soft = soon(["deferred", "tile", "tile-group"]).map(|name| preset(name).expect("a preset").strategy);
    finite_at(size, "a soft light", brightest_highlight(1.0), soft);
}

#[test]
fn normals_of_no_length_in_a_file() {
    apart!();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("zero.obj");
    let text = "v 0 1 -2\nv -1 -1 -2\nv 1 -1 -2\nvn 0 0 0\nvn 1e-38 0 0\nvn 0 0 1\nf 1//1 2//2 3//3\nf 1//1 2//1 3//1\n";
    std::fs::write(&path, text).expect("a file");
    match load_scene(&path) {
        Ok(loaded) => finite_everywhere("normals of no length", loaded.scene),
        Err(error) => assert_eq!(error.exit_code(), 2, "{error}"),
    }
}

#[test]
fn triangles_of_no_area_and_needles() {
    apart!();
    let mut scene = scene("pyramid-lower.toml");
    let count = scene.mesh.positions.len() as u32;
    let first = scene.mesh.triangles[0];
    let needle = [Vec3::new(-0.5, 0.0, -2.0), Vec3::new(0.5, 1e-7, -2.0), Vec3::new(0.5, 0.0, -2.0)];
    scene.mesh_mut().positions.extend(needle);
    for positions in [[0, 0, 0], [0, 1, 1], [count, count + 1, count + 2]] {
        let mut flat = first;
        flat.positions = positions;
        scene.mesh_mut().triangles.push(flat);
    }
    finite_everywhere("triangles of no area", scene);
}

/// Returns a scene of triangles that are about as narrow as a rounding error, each along a row of pixels.
/// `at_points` is the normal at each triangle's narrow tip; this normal may make the tips darker than the
/// other corners.
fn needles(at_points: Vec3) -> Scene {
    let mut scene = scene("triangle.toml");
    let corners = (0..64).flat_map(|row| {
        let (slope, width) = ((row as f32 - 31.5) / 32.0, 1e-7 * (1 << (row % 8)) as f32);
        let (near, far) = (1.5 + 0.01 * row as f32, 2.5 - 0.013 * row as f32);
        [[-1.2, slope * near, -near], [1.2, slope * far + width, -far], [1.2, slope * far, -far]]
    });
    let material = scene.mesh.triangles[0].material;
    let mesh = scene.mesh_mut();
    // The triangles have no highlight, since a highlight may be brighter between the corners than at every corner.
    mesh.materials.iter_mut().for_each(|material| material.glossy = Vec3::ZERO);
    mesh.positions = corners.map(Vec3::from_array).collect();
    mesh.normals = vec![at_points, Vec3::Z];
    let all = (0..64).map(|number| [3 * number, 3 * number + 1, 3 * number + 2]);
    mesh.triangles = all.map(|positions| Triangle { positions, normals: [0, 1, 1], material }).collect();
    scene.camera = Camera { z_near: 0.0, ..Camera::PAPER };
    scene.lights[0].position = Vec3::new(0.0, 3.0, 1.0);
    scene
}

/// Casts narrow triangles twice: once with a normal of their own at the tips, and once with the brightest
/// corner's normal at all corners. Returns true if the first picture is nowhere brighter than the second
/// picture. Rounding gives narrow triangles arbitrary weights, but interpolated normals must stay between the
/// corners' normals.
fn are_no_brighter_than_their_brightest_corner(sources: &Sources) -> bool {
    let deferred = preset("deferred").expect("a preset").strategy;
    let strategy = Strategy { intersector: Intersector::WATERTIGHT, ..deferred };
    let of = |normal| {
        let stand = Stand::of(sources, needles(normal), [64, 64], |builtins| builtins);
        stand.cast(&strategy, LOCAL).expect("it fits")
    };
    let (mixed, bright) = (of(Vec3::new(0.0, -0.8, 0.6)), of(Vec3::Z));
    assert!(bright.pixels.iter().filter(|pixel| pixel[0] > 0.0).count() > 100);
    mixed.pixels.iter().zip(&bright.pixels).all(|(mixed, bright)| mixed[0] <= bright[0] * 1.0001)
}

#[test]
fn weights_of_needles_are_clamped_to_the_triangle() {
    apart!();
    assert!(are_no_brighter_than_their_brightest_corner(&Sources::Embedded));
    let work_folder = WorkFolder::new();
    let folder = work_folder.kernels("common/intersect_plane.cl", "zero), one - hit.w1);", "zero), one);");
    assert!(!are_no_brighter_than_their_brightest_corner(&Sources::Folder(work_folder.path(&folder))));
}

/// Returns a sphere on the ground, lit by a light at this distance. The light's power grows with the square
/// of the distance, so the light arrives equally strongly from any distance.
fn lit_from(distance: f32) -> Scene {
    let mut scene = scene("sphere.toml");
    let light = &mut scene.lights[0];
    light.position = distance * Vec3::new(0.3, 0.9, 0.3).normalize();
    light.power = Vec3::splat(distance * distance);
    scene
}

/// Returns which fraction of the pixels of a strategy's image is at least a tenth darker than expected.
fn dark_share(stand: &Stand, strategy: &Strategy, expected: &Radiance) -> f64 {
    let image = stand.cast(strategy, LOCAL).expect("it fits");
    let pairs = image.pixels.iter().zip(&expected.pixels);
    pairs.filter(|(cast, expected)| cast[0] < 0.9 * expected[0]).count() as f64 / image.pixels.len() as f64
}

/// Returns the scene of sphere.toml with everything a thousand times smaller, except the ground. The light is close to
/// the sphere. Tiles at the sphere's outline have shadow rays whose lengths differ by a factor of about a thousand.
fn small_sphere_on_a_large_ground() -> Scene {
    let mut scene = scene("sphere.toml");
    let ground = scene.mesh.triangles.len() - 2;
    let mesh = scene.mesh_mut();
    let of_ground: Vec<u32> =
        mesh.triangles[ground..].iter().flat_map(|triangle| triangle.positions).collect();
    for (number, position) in mesh.positions.iter_mut().enumerate() {
        if !of_ground.contains(&(number as u32)) {
            *position *= 1e-3;
        }
    }
    scene.camera.z_near *= 1e-3;
    scene.shadow_bias *= 1e-3;
    scene.lights[0].position *= 1e-3;
    scene.lights[0].power *= 1e-6;
    scene
}

/// Bounds of rounding errors in tiles are relative to the longest direction of a tile. If directions were as
/// long as the shadow rays, such bounds would enlarge triangles near the light too much.
#[test]
fn shadow_rays_of_very_different_lengths_are_right_in_one_tile() {
    apart!();
    let size = [320, 200];
    let scene = small_sphere_on_a_large_ground();
    let strategies = ["tile", "tile-watertight", "tile-group", "bvh"];
    let strategies = strategies.map(|name| preset(name).expect("a preset").strategy);
    let expected = reference(&scene, size, strategies[0].culling);
    let verdict_of = |kernels: &Sources, strategy: &Strategy| {
        let stand = Stand::of(kernels, scene.clone(), size, |builtins| builtins);
        verify(&stand.cast(strategy, LOCAL).expect("it fits"), None, &expected, scene.display)
    };
    for strategy in strategies {
        let verdict = verdict_of(&Sources::Embedded, &strategy);
        assert!(verdict.ok, "{strategy}: {verdict:?}");
    }
    let work_folder = WorkFolder::new();
    let folder =
        work_folder.kernels("tile_cpu/light_rays.cl", "bundle->longest = 1.0f;", "bundle->longest = 3e4f;");
    let verdict = verdict_of(&Sources::Folder(work_folder.path(&folder)), &strategies[0]);
    assert!(!verdict.ok, "with bounds for longer directions: {verdict:?}");
}

/// A shadow ray from a distant light ends before the hit, so it does not meet a surface that is nearer to the
/// hit than this end. A shadow ray that starts at the hit, not at the light, meets a surface so near to the
/// hit. The shadow near the point where the sphere touches the ground is therefore uncertain, and a picture
/// is right with this shadow and without it.
#[test]
fn shadows_of_a_distant_light_are_right_wherever_their_rays_start() {
    apart!();
    let size = [240, 150];
    let scene = lit_from(1e5);
    let strategies = soon(["bvh", "tile", "tile-watertight", "tile-group", "wide-common-origin"]);
    let strategies: Vec<_> = strategies.map(|name| preset(name).expect("a preset").strategy).collect();
    let expected = reference(&scene, size, strategies[0].culling);
    let stand = Stand::of(&Sources::Embedded, scene.clone(), size, |builtins| builtins);
    for strategy in strategies {
        let image = stand.cast(&strategy, LOCAL).expect("it fits");
        let verdict = verify(&image, None, &expected, scene.display);
        assert!(verdict.ok, "{strategy}: {verdict:?}");
    }
}

/// Rounding changes the distance between a surface and a distant light by more than the shadow bias. If the
/// bias alone decided where shadow rays end, many pixels would be dark (speckles). The pixels that speckles
/// would make dark are uncertain, so `verify` cannot notice speckles. This test counts dark pixels instead.
#[test]
fn a_distant_light_makes_no_speckles() {
    apart!();
    let strategy = |name| preset(name).expect("a preset").strategy;
    // No strategy of this test culls backs.
    let expected = reference(&lit_from(1e5), SIZE, Culling::None).radiance;
    let stand = Stand::new(lit_from(1e5), SIZE);
    for name in soon(["bvh", "tile", "tile-watertight", "tile-group", "wide-common-origin"]) {
        let dark = dark_share(&stand, &strategy(name), &expected);
        assert!(dark < 0.01, "{name}: {dark}");
    }
    let work_folder = WorkFolder::new();
    let bias_only = "bias_per_distance + 0.0f * (";
    let folder = work_folder.kernels("common/shadow_end.cl", "max(bias_per_distance, ", bias_only);
    let kernels = Sources::Folder(work_folder.path(&folder));
    let stand = Stand::of(&kernels, lit_from(1e5), SIZE, |builtins| builtins);
    // In tiles, a surface blocks a shadow ray only before the ray's end, not at the end. With the bias alone,
    // rounding therefore makes fewer pixels dark with `tile` than with other strategies.
    for (name, least) in [("tile", 0.01), ("wide-common-origin", 0.1)] {
        let dark = dark_share(&stand, &strategy(name), &expected);
        assert!(dark > least, "{name} with the bias alone: {dark}");
    }
}
