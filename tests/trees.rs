//! Traversals with a tree, compared with the reference: many lights, interiors, hills, and extreme meshes.

use crate::common::apart::apart;
use crate::common::{Stand, compiles_soon, is_long};
use glam::Vec3;
use raycl::program::frame_kernels;
use raycl::scene::{Scene, Triangle, load_scene, load_scene_with};
use raycl::strategy::{Intersector, Passes, Strategy, TileSize, preset};
use std::path::Path;

/// The size of the tests' images. Neither the width nor the height is a multiple of a tile's.
const SIZE: [u32; 2] = [75, 47];

fn of(name: &str) -> Strategy {
    preset(name).expect("a preset").strategy
}

fn with_trees() -> impl Iterator<Item = (Strategy, [u32; 2])> {
    let all = [("tile", [1, 1]), ("bvh-packet", [4, 4]), ("bvh", [8, 8]), ("tile-group", [32, 1])];
    all.into_iter()
        .map(|(name, local_size)| (of(name), local_size))
        .filter(|(strategy, _)| compiles_soon(strategy))
}

/// Returns a scene of the repository whose first object has about `triangles` triangles.
fn coarse(name: &str, triangles: i64) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let overrides = [("object.0.triangles".to_owned(), toml::Value::from(triangles))];
    load_scene_with(&path, &overrides).expect("a scene of the repository").scene
}

fn agrees(scene: Scene) {
    let name = scene.name.clone();
    let mut stand = Stand::new(scene, SIZE);
    for (strategy, local_size) in with_trees() {
        let verdict = stand.check(&strategy, local_size).expect("a device that holds it");
        assert!(verdict.ok, "{name}, {strategy}: {:?}", verdict.reason);
    }
}

#[test]
fn many_lights_an_interior_and_hills() {
    apart!();
    for (scene, triangles, lights) in
        [("many-lights.toml", 2_000, 32), ("atrium.toml", 9_000, 4), ("terrain-10m.toml", 20_000, 1)]
    {
        let scene = coarse(scene, triangles);
        assert_eq!(scene.lights.len(), lights, "{}", scene.name);
        agrees(scene);
    }
}

/// The strategy `tile-group` processes lights in rounds, and casts shadow rays to several lights in each
/// round. The number of lights in a round depends on the tile's size, because one word has a bit for each
/// light and each ray of a work-item. With the tiles of this test, 32 lights take two to eleven rounds.
#[test]
fn rounds_of_lights_of_every_tile() {
    apart!();
    let shared = of("tile-group");
    let mut stand = Stand::new(coarse("many-lights.toml", 2_000), SIZE);
    let all = [
        (TileSize::T8x4, Intersector::COMMON_ORIGIN, 2),
        (TileSize::T16x16, Intersector::COMMON_ORIGIN, 11),
        (TileSize::T8x8, Intersector::EDGE_PLANES, 3),
    ];
    for (tile, intersector, rounds) in all.into_iter().take(if is_long() { 3 } else { 1 }) {
        // The tests above include strategies with fused passes. A CPU's compiler takes longer for fused than for
        // separate passes.
        let strategy = Strategy { tile, passes: Passes::Separate, intersector, ..shared };
        assert_eq!(32_usize.div_ceil(strategy.lights_of_round()), rounds, "{strategy}");
        let verdict = stand.check(&strategy, [32, 1]).expect("a device that holds it");
        assert!(verdict.ok, "{strategy}: {:?}", verdict.reason);
        // The frame starts some kernels once in each round, but each kernel is compiled once.
        let prepared = stand.build(&strategy, [32, 1]).expect("a device that holds it");
        let made = prepared.made(&prepared.caster().expect("a caster"), "", "");
        let names: Vec<&str> = made.iter().map(|kernel| kernel.name.as_str()).collect();
        assert_eq!(names, frame_kernels(&strategy, &prepared.workload), "{strategy}");
    }
}

/// Returns a scene in another unit of length. The scaled scene has the same picture as the original one.
fn scaled(mut scene: Scene, scale: f32) -> Scene {
    scene.mesh_mut().positions.iter_mut().for_each(|point| *point *= scale);
    scene.camera.position *= scale;
    scene.camera.z_near *= scale;
    scene.shadow_bias *= scale;
    for light in &mut scene.lights {
        light.position *= scale;
        light.power *= scale * scale;
    }
    scene.name = format!("{} times {scale}", scene.name);
    scene
}

#[test]
fn coordinates_from_a_millionth_to_a_million() {
    apart!();
    for scale in [1e-6, 1e6] {
        agrees(scaled(crate::common::scene("gourd.toml"), scale));
    }
}

/// Returns a scene after a change of its triangles.
fn with_triangles(change: impl FnOnce(&mut Scene)) -> Scene {
    let mut scene = crate::common::scene("gourd.toml");
    change(&mut scene);
    scene
}

#[test]
fn one_triangle_and_coincident_and_degenerate_ones() {
    apart!();
    agrees(crate::common::scene("triangle.toml"));
    agrees(with_triangles(|scene| {
        // Each triangle occurs twelve times. No plane separates the copies of a triangle, so some leaves have
        // more triangles than usual.
        let all = scene.mesh.triangles.clone();
        scene.mesh_mut().triangles =
            all.iter().flat_map(|triangle| std::iter::repeat_n(*triangle, 12)).collect();
    }));
    agrees(with_triangles(|scene| {
        // Adds, for each triangle, a triangle that is a point and a triangle that is a line. In addition,
        // adds a thousand triangles, each of which is a point at the same position.
        let all = scene.mesh.triangles.clone();
        let flat = |positions: [u32; 3], triangle: &Triangle| Triangle { positions, ..*triangle };
        for triangle in &all {
            let [a, b, _] = triangle.positions;
            scene.mesh_mut().triangles.push(flat([a, a, a], triangle));
            scene.mesh_mut().triangles.push(flat([a, b, a], triangle));
        }
        scene.mesh_mut().triangles.extend(std::iter::repeat_n(flat([0, 0, 0], &all[0]), 1000));
    }));
}

#[test]
fn no_triangle_is_all_background() {
    apart!();
    let scene = with_triangles(|scene| scene.mesh_mut().triangles.clear());
    let background = scene.background.to_array();
    let stand = Stand::new(scene, SIZE);
    for (strategy, local_size) in with_trees() {
        let image = stand.cast(&strategy, local_size).expect("an image");
        assert!(image.pixels.iter().all(|pixel| *pixel == background), "{strategy}");
    }
}

#[test]
fn every_width_of_node_and_size_of_leaf_and_tile_gives_the_same_picture() {
    apart!();
    let mut stand = Stand::new(coarse("interior.toml", 3_000), SIZE);
    let base = |name| preset(name).expect("a preset").strategy;
    let mut points = Vec::new();
    for (node_width, leaf_size) in [("2", "4"), ("32", "32")] {
        points.push((base("bvh-packet"), [("node_width", node_width), ("leaf_size", leaf_size)]));
    }
    // A ray that is cast alone is tested against 16 of a node's children at a time.
    points.push((base("bvh"), [("node_width", "32"), ("leaf_size", "4")]));
    for (node_width, tile) in [("16", "8x8"), ("16", "16x16")] {
        points.push((base("tile"), [("node_width", node_width), ("tile", tile)]));
    }
    for (mut strategy, axes) in points {
        axes.iter().for_each(|(axis, value)| strategy.set(axis, value).expect("a value"));
        let verdict = stand.check(&strategy, [1, 1]).expect("a device that holds it");
        assert!(verdict.ok, "{strategy}: {:?}", verdict.reason);
    }
}

#[test]
fn the_scene_of_ten_million_is_what_it_says_and_made_anew_each_time() {
    apart!();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/terrain-10m.toml");
    let text = std::fs::read_to_string(&path).expect("the scene");
    assert!(text.contains("triangles = 10_000_000"), "{text}");
    let [one, other] = [(); 2].map(|()| coarse("terrain-10m.toml", 50_000));
    assert_eq!(one.mesh, other.mesh);
    // Loading the scene with all its triangles takes half a minute if raycl is not optimised; loading the smaller hills
    // of terrain.toml runs the same code.
    let hills = load_scene(&path.with_file_name("terrain.toml")).expect("the hills").scene;
    assert!(hills.mesh.positions.iter().all(|point: &Vec3| point.is_finite()));
}
