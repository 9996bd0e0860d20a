//! The ends of rays: at the near plane, at lights, and at objects that hover just above a surface. Five scenes have one
//! of these three kinds of ends. Their pictures must be correct with every traversal, and with five ray-triangle tests.
//! The table tests/mutants/kernels.toml lists changes to the kernels that the tests of this file notice.

use crate::common::apart::apart;
use crate::common::{COMMON_LOCAL_SIZE, Stand, compiles_soon, one_preset_of_each_family, soon};
use glam::{Vec3, vec3};
use raycl::launch::Ray;
use raycl::reference::reference;
use raycl::scene::{Scene, load_scene};
use raycl::strategy::{Culling, Epsilons, Intersector, Strategy, Traversal, Width, preset};
use raycl::verify::verify;
use std::path::Path;

const SIZE: [u32; 2] = [61, 43];

fn scene(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
    load_scene(&path).expect("a scene").scene
}

/// Returns strategies of every kernel family, and of ray packets, with each of five ray-triangle tests that they
/// support. `make test` leaves out strategies that take long to compile.
fn strategies() -> Vec<Strategy> {
    let tests = [
        Intersector::MOLLER_TRUMBORE,
        Intersector::WATERTIGHT,
        Intersector::COMMON_ORIGIN,
        Intersector::PIXEL_LINEAR,
        Intersector::EDGE_PLANES,
    ];
    one_preset_of_each_family()
        .into_iter()
        .chain([preset("bvh-packet").expect("a preset")])
        .flat_map(|preset| tests.map(|intersector| Strategy { intersector, ..preset.strategy }))
        .filter(|strategy| strategy.contradiction().is_none() && compiles_soon(strategy))
        .collect()
}

fn is_right_in_all(name: &str) {
    let mut stand = Stand::new(scene(name), SIZE);
    let strategies = strategies();
    assert!(strategies.len() >= 10, "{}", strategies.len());
    for strategy in strategies {
        let local_size = if strategy.traversal == Traversal::Tile { [1, 1] } else { COMMON_LOCAL_SIZE };
        let verdict = stand.check(&strategy, local_size).unwrap_or_else(|why| panic!("{strategy}: {why}"));
        assert!(verdict.ok, "{name}, {strategy}: {verdict:?}");
    }
}

#[test]
fn nothing_nearer_than_the_near_plane_is_seen() {
    is_right_in_all("near.toml");
}

#[test]
fn triangles_that_extend_behind_the_eye_are_seen_in_front_of_it() {
    is_right_in_all("behind.toml");
    is_right_in_all("vast.toml");
}

#[test]
fn shadow_rays_end_at_lights_and_meet_all_before() {
    is_right_in_all("lights.toml");
    is_right_in_all("hovering.toml");
}

/// Rounding moves the ends of shadow rays from this light by more than the bias. The reference therefore does
/// not know which of the shadow rays reach the surface, and verification accepts dark pixels. All surfaces
/// that the camera sees are lit. A black pixel shows a shadow, since the background is not black.
#[test]
fn surfaces_far_from_their_light_do_not_shadow_themselves() {
    apart!();
    let stand = Stand::new(scene("distant.toml"), SIZE);
    for name in soon(["bvh", "wide-common-origin", "tile", "tile-group"]) {
        let local_size = match name {
            "tile" => [1, 1],
            "tile-group" => [32, 1],
            _ => COMMON_LOCAL_SIZE,
        };
        let strategy = preset(name).expect("a preset").strategy;
        let (image, hits) = stand.cast_and_count(&strategy, local_size).expect("an image");
        let black = image.pixels.iter().filter(|pixel| pixel[1] <= 0.0).count();
        assert!(hits > 1000 && black < 16, "{name}: of {hits} pixels with a surface, {black} are black");
    }
}

#[test]
fn surfaces_whose_boxes_overlap_are_distinguished() {
    is_right_in_all("layers.toml");
    // The rays of a packet are numbered. The ray that enters a box before all others may be the one with the
    // last number. A kernel that ignores the ray with the last number casts a wrong picture of this scene
    // with packets of four rays.
    let four = Strategy { width: Width::W4, ..preset("bvh").expect("a preset").strategy };
    let verdict = Stand::new(scene("layers.toml"), SIZE).check(&four, [4, 4]).expect("a strategy that fits");
    assert!(verdict.ok, "{four}: {verdict:?}");
}

/// A camera's rays all begin at its near plane. Of rays that a caller provides, each begins at a distance of
/// its own. The rays of this test meet the sheet at a distance of 0.9, and the wall at a distance of 4.
#[test]
fn a_given_ray_begins_at_a_distance_of_its_own() {
    let stand = Stand::new(scene("near.toml"), SIZE);
    let [origin, direction] = [vec3(-1.0, -0.5, 0.0), Vec3::NEG_Z];
    let rays = [0.0, 0.89, 0.91, 3.99, 4.01].map(|t_min| Ray { origin, direction, t_min });
    let [wall, sheet] = [Some(1), Some(2)];
    let of = |name| preset(name).expect("a preset").strategy;
    // `strategies` leaves out the ray-triangle test `five-vectors`, so no other test of this file notices a
    // `five-vectors` that ignores `t_min`.
    let intersector = Intersector::FIVE_VECTORS;
    let five_vectors = Strategy { intersector, epsilons: Epsilons::Paper, ..of("deferred") };
    for strategy in [of("deferred"), five_vectors, of("wide-common-origin"), of("bvh-packet")] {
        let built = stand.build_for_rays(&strategy, COMMON_LOCAL_SIZE).expect("a strategy that fits");
        let hits = built.cast_rays(&rays).expect("a cast");
        assert_eq!(hits, [sheet, sheet, wall, wall, None], "{strategy}");
    }
}

#[test]
fn a_near_plane_elsewhere_is_another_picture() {
    let right = reference(&scene("near.toml"), SIZE, Culling::None);
    for z_near in [1e-3, 0.8, 1.4] {
        let mut scene = scene("near.toml");
        scene.camera.z_near = z_near;
        let other = reference(&scene, SIZE, Culling::None);
        let verdict = verify(&other.radiance, None, &right, scene.display);
        assert!(verdict.wrong_pixels > 40, "{z_near}: {verdict:?}");
    }
}
