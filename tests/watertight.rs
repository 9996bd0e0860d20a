//! Rays aimed at the edges and vertices of a closed sphere: the watertight intersector leaks none of them, and the
//! others' leaks are counted, so that the test is known to be able to fail.
#![allow(missing_docs, reason = "a test binary has no documentation")]

mod common;

use common::Stand;
use glam::Vec3;
use raycl::launch::{Ray, cast_rays};
use raycl::scene::Scene;
use raycl::strategy::{Intersector, NodeWidth, Strategy, Traversal, Triangles, Width, preset};

/// A closed sphere of radius 1 about `centre`, and nothing else.
fn sphere(centre: Vec3) -> Scene {
    let mut scene = common::scene("sphere.toml");
    let bands = 16;
    let rings = 2 * bands;
    let point = |ring: u32, band: u32| {
        let (theta, phi) = (
            std::f32::consts::PI * band as f32 / bands as f32,
            2.0 * std::f32::consts::PI * (ring % rings) as f32 / rings as f32,
        );
        Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
    };
    let mut mesh = raycl::scene::Mesh { materials: scene.mesh.materials[..1].to_vec(), ..Default::default() };
    let pole = |band: u32| band == 0 || band == bands;
    let index = |ring: u32, band: u32| match band {
        0 => 0,
        _ if band == bands => 1,
        _ => 2 + (band - 1) * rings + ring % rings,
    };
    mesh.normals = [point(0, 0), point(0, bands)].into();
    for band in 1..bands {
        mesh.normals.extend((0..rings).map(|ring| point(ring, band)));
    }
    mesh.positions = mesh.normals.iter().map(|normal| centre + *normal).collect();
    let mut add = |corners: [u32; 3]| {
        mesh.triangles.push(raycl::scene::Triangle { positions: corners, normals: corners, material: 0 });
    };
    for band in 0..bands {
        for ring in 0..rings {
            let [a, b] = [index(ring, band), index(ring + 1, band)];
            let [c, d] = [index(ring, band + 1), index(ring + 1, band + 1)];
            if !pole(band) {
                add([a, b, d]);
            }
            if !pole(band + 1) {
                add([a, d, c]);
            }
        }
    }
    scene.mesh = mesh;
    scene
}

/// Rays from one point outside towards points on edges and at vertices that it sees from there or not: each line
/// through a closed surface has to hit it.
fn rays(scene: &Scene, origin: Vec3, count: usize) -> Vec<Ray> {
    let mesh = &scene.mesh;
    let mut rays = Vec::with_capacity(count);
    let mut state = 1_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 8
    };
    while rays.len() < count {
        let triangle = &mesh.triangles[random() as usize % mesh.triangles.len()];
        let corners = mesh.corners(triangle);
        let edge = random() as usize % 3;
        // Every fifth ray is aimed at a vertex.
        let along = if random() % 5 == 0 { 0.0 } else { random() as f32 / (1 << 24) as f32 };
        let target = corners[edge].lerp(corners[(edge + 1) % 3], along);
        // Grazing rays pass a convex surface by: keep those that enter it.
        let direction = (target - origin).normalize();
        let outward = mesh.corner_normals(triangle)[edge];
        if outward.dot(direction).abs() > 0.2 {
            rays.push(Ray { origin, direction, t_min: 0.0 });
        }
    }
    rays
}

fn leaks(scene: &Scene, strategy: &Strategy, origins: &[Vec3], count: usize) -> usize {
    let stand = Stand::new(scene.clone(), [64, 64]);
    let local_size = [8, 2];
    let built = stand.build(strategy, local_size).expect("a strategy that fits");
    let leaked = |&origin: &Vec3| {
        let rays = rays(scene, origin, count / origins.len());
        let (program, tree) = (&built.program, built.tree.as_ref());
        let hits = cast_rays(&stand.queue, program, strategy, local_size, &built.scene, tree, &rays);
        let hits = hits.expect("a cast");
        hits.iter().filter(|hit| hit.is_none()).count()
    };
    origins.iter().map(leaked).sum()
}

const ORIGINS: [Vec3; 4] = [
    Vec3::new(0.0, 0.0, 3.0),
    Vec3::new(2.0, 1.5, -1.0),
    Vec3::new(-0.3, 2.6, 0.7),
    Vec3::new(0.1, 0.2, 0.3), // inside
];

#[test]
fn the_watertight_test_leaks_none_of_ten_thousand_rays() {
    let scene = sphere(Vec3::new(0.013, -0.007, 0.021));
    let exhaustive = preset("watertight").expect("a preset").strategy;
    let tree = Strategy { traversal: Traversal::Bvh, ..exhaustive };
    for strategy in [
        exhaustive,
        Strategy { width: Width::W16, ..exhaustive },
        Strategy { width: Width::W4, triangles: Triangles::Tiled, ..exhaustive },
        tree,
        Strategy { node_width: NodeWidth::N2, ..tree },
        Strategy { width: Width::W16, ..tree },
    ] {
        assert_eq!(leaks(&scene, &strategy, &ORIGINS, 10_000), 0, "{strategy}");
    }
}

#[test]
fn the_papers_test_leaks_so_the_rays_do_probe_edges() {
    let scene = sphere(Vec3::new(0.013, -0.007, 0.021));
    let paper = preset("private").expect("a preset").strategy;
    assert!(leaks(&scene, &paper, &ORIGINS, 10_000) > 10);
    // The fast tests overlap along edges, which leaks less but promises nothing.
    for intersector in [Intersector::MollerTrumbore, Intersector::CommonOrigin] {
        let mut strategy = preset("deferred").expect("a preset").strategy;
        strategy.intersector = intersector;
        println!("{strategy}: {} leaks", leaks(&scene, &strategy, &ORIGINS, 10_000));
    }
}
