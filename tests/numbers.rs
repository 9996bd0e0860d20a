//! Numbers that bring other casters down: very small and very large scenes, lights on surfaces, cameras inside and on
//! triangles, normals of no length.

use crate::common::apart::apart;
use crate::common::{COMMON_LOCAL_SIZE, Stand, compiles_soon, scene};
use glam::Vec3;
use raycl::image::Radiance;
use raycl::reference::reference;
use raycl::scene::{Camera, Scene, load_scene};
use raycl::strategy::{Epsilons, PRESETS, Strategy};
use raycl::verify::verify;

const SIZE: [u32; 2] = [30, 20];
const LOCAL: [u32; 2] = COMMON_LOCAL_SIZE;

/// The same scene in other units: lengths times `factor`, powers times its square.
fn scaled(scene: &Scene, factor: f32) -> Scene {
    let mut scene = scene.clone();
    scene.mesh.positions.iter_mut().for_each(|position| *position *= factor);
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

/// Every preset that promises to know no scale.
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
                // The reference of the scene as it was, not of the scaled one.
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

/// Casts a scene with every preset: no value is NaN, infinite or negative, and the references are finite too.
fn finite_everywhere(what: &str, scene: Scene) {
    scene.validate().unwrap_or_else(|error| panic!("{what}: {error}"));
    for culling in [raycl::strategy::Culling::None, raycl::strategy::Culling::Back] {
        assert!(all_finite(&reference(&scene, SIZE, culling).radiance), "{what}: the reference");
    }
    let stand = Stand::new(scene, SIZE);
    for strategy in presets() {
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
    // Half way between two opposite normals the interpolated one has no length.
    let normal = scene.mesh.normals[0];
    for (at, other) in scene.mesh.normals.iter_mut().enumerate() {
        *other = if at % 2 == 0 { normal } else { -normal };
    }
    finite_everywhere("opposite normals", scene);
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
    scene.mesh.positions.extend(needle);
    for positions in [[0, 0, 0], [0, 1, 1], [count, count + 1, count + 2]] {
        let mut flat = first;
        flat.positions = positions;
        scene.mesh.triangles.push(flat);
    }
    finite_everywhere("triangles of no area", scene);
}
