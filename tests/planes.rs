//! Lights and cameras in the planes of triangles, on triangles and just above them. If a light or a camera
//! lies there, rounding decides some pixels. The reference must mark these pixels as uncertain. With every
//! family of kernels, the certain pixels must agree with the reference.

use crate::common::{COMMON_LOCAL_SIZE, Stand, compiles_soon, scene, soon};
use glam::{Vec3, vec3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use raycl::reference::reference;
use raycl::scene::{Scene, load_scene};
use raycl::strategy::{Culling, Intersector, Passes, Shading, Strategy, Traversal, preset};
use std::fmt::Write as _;

/// The size of the tests' images. The width and the height are odd, so that rays run along planes of
/// symmetry.
const SIZE: [u32; 2] = [161, 101];

fn strategies() -> Vec<Strategy> {
    let names = [
        "naive",
        "deferred",
        "bvh",
        "wide",
        "wide-common-origin",
        "raster",
        "tile",
        "tile-watertight",
        "tile-group",
        "tile-group-watertight",
    ];
    let all = names.map(|name| preset(name).expect("a preset").strategy);
    all.into_iter().filter(compiles_soon).collect()
}

/// Returns the scene of Figure 4 of the student paper that raycl reproduces, with its light at another
/// position.
fn lit_from(x: f32, y: f32, z: f32) -> Scene {
    let mut scene = scene("figure-4.toml");
    scene.lights[0].position = vec3(x, y, z);
    scene
}

/// Returns the scene of the student paper's Figure 4, seen from within the plane of its triangle.
fn seen_along_the_triangle() -> Scene {
    let mut scene = scene("figure-4.toml");
    let camera = &mut scene.camera;
    (camera.position, camera.forward, camera.right) = (vec3(3.0, 0.0, -2.0), Vec3::NEG_X, Vec3::NEG_Z);
    scene
}

/// Returns a line for each strategy that casts the scene wrong.
fn wrong(name: &str, scene: Scene) -> Vec<String> {
    wrong_at(SIZE, name, scene)
}

/// Returns a line for each strategy that casts the scene wrong, as `wrong` does, but for pictures of another
/// size.
fn wrong_at(size: [u32; 2], name: &str, scene: Scene) -> Vec<String> {
    wrong_with(strategies(), size, name, scene)
}

/// Returns a line for each of these strategies that casts the scene wrong.
fn wrong_with(strategies: Vec<Strategy>, size: [u32; 2], name: &str, scene: Scene) -> Vec<String> {
    let mut stand = Stand::new(scene, size);
    let check = |strategy: Strategy| {
        let local_size = if strategy.traversal == Traversal::Tile { [1, 1] } else { COMMON_LOCAL_SIZE };
        let verdict = stand.check(&strategy, local_size).unwrap_or_else(|why| panic!("{strategy}: {why}"));
        verdict.reason.map(|reason| format!("{name}, {strategy}: {reason}"))
    };
    strategies.into_iter().filter_map(check).collect()
}

/// With the common-origin intersector, the three edge functions divided by their sum are the hit's weights only if all
/// three planes were multiplied by the same factor. Eager shading interpolates normals with these weights; so does
/// `tile-group`, to find the lights that a hit faces.
#[test]
fn normals_of_long_triangles_are_interpolated_with_the_weights_of_the_hit() {
    let [wide, tile_group] =
        ["wide-common-origin", "tile-group"].map(|name| preset(name).expect("a preset").strategy);
    let eager = Strategy { shading: Shading::EAGER, passes: Passes::Fused, ..wide };
    let strategies = [eager, tile_group].into_iter().filter(compiles_soon).collect();
    let wrong = wrong_with(strategies, [61, 43], "a plank", scene("../tests/data/plank.toml"));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_needle_is_no_longer_than_its_long_edges() {
    let wrong = wrong_at([61, 43], "a needle", scene("../tests/data/needle.toml"));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn lights_and_cameras_in_planes_are_verified_right() {
    let wrong: Vec<String> = [
        ("a light in the ground", lit_from(0.2, -1.0, -2.5)),
        ("a light in the ground beside the picture", lit_from(-4.0, -1.0, -2.0)),
        ("a light in the triangle's plane", lit_from(1.5, 0.9, -2.0)),
        ("a light on the triangle", lit_from(-0.1, 0.0, -2.0)),
        ("a light just over the ground", lit_from(0.2, -0.999, -2.5)),
        ("tangent light", lit_from(30.0, -0.999, -10.0)),
        ("a camera in the triangle's plane", seen_along_the_triangle()),
        ("a camera in the ground's plane", scene("../tests/data/in-the-ground.toml")),
        ("a camera in a slope's plane", scene("../tests/data/in-a-slope.toml")),
        ("a road from a driver's seat", scene("../tests/data/road.toml")),
        ("a triangle with distant corners", scene("../tests/data/long-triangle.toml")),
    ]
    .into_iter()
    .flat_map(|(name, scene)| wrong(name, scene))
    .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// All pixels of this picture are uncertain, so verification would accept a picture in which the eye sees the ground.
/// The watertight test finds out that rays start in the ground's plane, and sees only the ball.
#[test]
fn the_watertight_test_does_not_see_the_ground_in_whose_plane_the_eye_lies() {
    const SIZE: [u32; 2] = [61, 43];
    let scene = scene("../tests/data/in-the-ground.toml");
    let expected = reference(&scene, SIZE, Culling::None).hits;
    assert!((100..1000).contains(&expected), "{expected} pixels of the ball");
    let stand = Stand::new(scene, SIZE);
    let names = ["deferred", "bvh", "tile-watertight", "tile-group-watertight"];
    let watertight =
        |name| Strategy { intersector: Intersector::WATERTIGHT, ..preset(name).expect("a preset").strategy };
    for strategy in names.map(watertight).into_iter().filter(compiles_soon) {
        let local_size = if strategy.traversal == Traversal::Tile { [1, 1] } else { COMMON_LOCAL_SIZE };
        let seen = stand.cast_and_count(&strategy, local_size).expect("it fits").1;
        assert!(seen.abs_diff(expected) < 8, "{strategy}: {seen} pixels with a hit, not {expected}");
    }
}

/// The bound below which a triangle is too narrow to be hit (`LEAST_VISIBLE`) is computed from one corner. The near
/// part of the road (long, narrow triangles) must be hit even if the corner for the bound is far away. `tile` also has
/// a bound for each ray, which contains the factor `EDGE_ON_ROUNDING`. Because of this second bound, rays of `tile` do
/// not hit the far part of the road.
#[test]
fn a_narrow_road_is_seen_if_its_far_corners_come_first() {
    let stand = Stand::new(narrow_road(), [151, 107]);
    let hits = |name: &str| {
        let strategy = preset(name).expect("a preset").strategy;
        stand.cast_and_count(&strategy, [4, 4]).expect("it fits").1
    };
    let expected = hits("tile-watertight");
    for name in soon(["tile", "wide-common-origin", "tile-group"]) {
        let seen = hits(name);
        assert!(expected > 100 && seen > expected / 12, "{name}: {seen} of {expected}");
    }
}

/// Returns a road 35,000 times as long as wide. The first corner of each of the road's triangles is at the road's far
/// end.
fn narrow_road() -> Scene {
    let mut scene = scene("../tests/data/road.toml");
    let mesh = scene.mesh_mut();
    for position in &mut mesh.positions {
        *position *= vec3(0.1, 1.0, 3.5);
    }
    let is_near: Vec<bool> = mesh.positions.iter().map(|position| position.z > -1.0).collect();
    for triangle in &mut mesh.triangles {
        while is_near[triangle.positions[0] as usize] {
            triangle.positions.rotate_left(1);
            triangle.normals.rotate_left(1);
        }
    }
    scene
}

/// Returns long, thin triangles, a light that nearly touches the ground, and one that is far away. Rounding errors
/// in this scene are much larger than the nudges of a pixel's ray.
fn thin_triangles(seed: u64) -> Scene {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut point = |half: f32| Vec3::from_array([(); 3].map(|()| random.random_range(-half..half)));
    let mut text = String::from("name = \"thin\"\nshadow_bias = 1e-4\n[camera]\nz_near = 0.01\n");
    for light in [vec3(point(2.0).x, -0.999_98, -2.0), point(1.0) * 300.0] {
        let _ = writeln!(text, "[[light]]\nposition = {:?}\npower = 10", light.to_array());
    }
    let mut mesh = String::from("v -9 -1 6\nv 9 -1 6\nv 0 -1.001 -20\n");
    let mut faces = String::from("f 1 2 3\n");
    for first in (4..).step_by(3).take(24) {
        let (middle, half) = (vec3(0.0, 0.0, -2.0) + point(2.0), point(3.0));
        for corner in [middle - half, middle + half, middle + point(0.02)] {
            let _ = writeln!(mesh, "v {} {} {}", corner.x, corner.y, corner.z);
        }
        let _ = writeln!(faces, "f {first} {} {}", first + 1, first + 2);
    }
    with_mesh(&text, &(mesh + &faces))
}

/// Returns a scene with the text `text` and with one more object, an OBJ.
fn with_mesh(text: &str, obj: &str) -> Scene {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("a file");
    write("mesh.obj", obj);
    write("scene.toml", &format!("{text}[[object]]\nobj = \"mesh.obj\"\n"));
    load_scene(&folder.path().join("scene.toml")).expect("a scene").scene
}

/// Returns a triangle whose normals turn away from the eye, although light reaches the triangle. The
/// direction halfway between the direction to the light and the direction to the eye points behind the
/// surface, so there is no highlight, except with a shininess of 0.
fn turned_away(shininess: f32) -> Scene {
    let mut scene = scene("../tests/data/turned.toml");
    scene.mesh_mut().materials.iter_mut().for_each(|material| material.shininess = shininess);
    scene
}

#[test]
fn a_surface_has_no_highlight_behind_it_unless_its_shininess_is_0() {
    let of = |shininess: f32| wrong(&format!("normals turned away, {shininess}"), turned_away(shininess));
    let wrong = [of(2.0), of(0.0)].concat();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn thin_triangles_and_distant_lights_are_verified_right() {
    let wrong: Vec<String> =
        (0..4).flat_map(|seed| wrong(&format!("seed {seed}"), thin_triangles(seed))).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Returns the scene still-life.toml with another camera. The camera stands outside the box around the scene, and
/// looks at the box's centre in the direction `forward`, a unit vector along a coordinate axis.
fn seen_along(forward: Vec3) -> Scene {
    let mut scene = scene("still-life.toml");
    let (low, high) = scene.mesh.bounds().expect("triangles");
    let camera = &mut scene.camera;
    camera.position = 0.5 * (low + high) - 0.8 * (high - low).length() * forward;
    (camera.forward, camera.right) = (forward, vec3(forward.z, forward.x, forward.y));
    camera.up = camera.right.cross(forward);
    scene
}

/// The watertight ray-triangle test swaps coordinates so that it looks along the axis nearest to the ray.
/// Swapping coordinates must not turn the front of a triangle into its back. The camera of this test
/// therefore looks along each axis in both directions. Each time, culling must remove the same triangles as
/// in the reference.
#[test]
fn backs_are_culled_whatever_axis_a_ray_is_nearest_to() {
    for forward in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
        let mut stand = Stand::new(seen_along(forward), [61, 41]);
        for name in ["watertight", "bvh"] {
            let usual = preset(name).expect("a preset").strategy;
            let strategy = Strategy { intersector: Intersector::WATERTIGHT, culling: Culling::Back, ..usual };
            let verdict = stand.check(&strategy, COMMON_LOCAL_SIZE).unwrap_or_else(|why| panic!("{why}"));
            assert_eq!(verdict.reason, None, "{strategy}, along {forward}");
        }
    }
}

/// In this view, the rays of four by four neighbouring pixels run in both directions along every coordinate axis. In
/// tiles on CPUs, the watertight test uses a common axis for the rays of a vector: an axis along which all these rays
/// run in the same direction. If there is no such axis, as in this view, the test chooses an axis for each ray.
#[test]
fn rays_without_a_common_axis_meet_the_nearest_surface() {
    let wrong = wrong_at([6, 5], "a very wide view", scene("../tests/data/wide-view.toml"));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
