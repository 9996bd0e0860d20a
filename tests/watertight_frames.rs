//! Frames whose every pixel is aimed at an edge or a vertex: tiles cast no single rays, so that this is how their leaks
//! are seen, beside those of every other way down the tree.
#![allow(missing_docs, reason = "a test binary has no documentation")]

mod common;

use common::Stand;
use glam::{DVec3, Vec3};
use raycl::scene::{Camera, Light, Mesh, Scene, Triangle};
use raycl::strategy::{Intersector, Passes, Strategy, TileSize, preset};

/// 60,516 pixels, in tiles that are not all whole.
const SIDE: u32 = 246;

/// A net over an image: a corner on the ray of every other pixel, both ways, and a little beyond; edges run through
/// the others. `corner` says where the ray through a pixel's centre has it.
fn net(corner: impl Fn(f64, f64) -> Vec3) -> Mesh {
    let across = SIDE / 2 + 5;
    let place = |i: u32| 2.0 * f64::from(i) - 3.5;
    let mut mesh = Mesh { normals: vec![Vec3::Z], ..Mesh::default() };
    mesh.positions = (0..across * across).map(|i| corner(place(i % across), place(i / across))).collect();
    for row in 0..across - 1 {
        for column in 0..across - 1 {
            let [a, b] = [row * across + column, (row + 1) * across + column];
            for positions in [[a, a + 1, b + 1], [a, b + 1, b]] {
                mesh.triangles.push(Triangle { positions, normals: [0; 3], material: 0 });
            }
        }
    }
    mesh
}

/// A number from 0 to 1 that follows from two others.
fn jitter(x: f64, y: f64) -> f64 {
    let mixed = (x * 12.9898 + y * 78.233).sin() * 43758.5453;
    mixed - mixed.floor()
}

fn scene_of(mesh: Mesh, camera: Camera, light: Vec3) -> Scene {
    let mut scene = common::scene("sphere.toml");
    let materials = scene.mesh.materials[..1].to_vec();
    scene.mesh = Mesh { materials, ..mesh };
    scene.camera = camera;
    scene.lights = vec![Light { position: light, power: Vec3::ONE }];
    scene.background = Vec3::ZERO;
    scene
}

fn camera(from: Vec3, to: Vec3) -> Camera {
    Camera::looking_at(from, to, Vec3::Y, 50.0, true).expect("a camera")
}

/// A crumpled net before the camera.
fn net_before_the_eye() -> Scene {
    let camera = camera(Vec3::new(0.1, -0.2, 3.0), Vec3::new(-0.4, 0.3, 0.0));
    let frame = camera.pixel_frame(SIDE, SIDE);
    let mesh = net(|x, y| (frame.eye + frame.direction(x, y) * (2.0 + jitter(x, y))).as_vec3());
    scene_of(mesh, camera, Vec3::new(0.0, 0.0, 4.0))
}

/// A floor seen from below, a light above it, and if `shaded` a net between the two, with its corners and edges on the
/// way to the middles of pixels.
fn net_before_the_light(shaded: bool) -> Scene {
    let camera = camera(Vec3::new(0.3, 0.2, -3.0), Vec3::new(0.1, 0.0, 0.0));
    let frame = camera.pixel_frame(SIDE, SIDE);
    let light = DVec3::new(0.2, -0.3, 2.5);
    let floor = |x: f64, y: f64| {
        let direction = frame.direction(x, y);
        frame.eye + direction * (-frame.eye.z / direction.z)
    };
    let mut mesh = Mesh { normals: vec![Vec3::Z], ..Mesh::default() };
    if shaded {
        mesh = net(|x, y| light.lerp(floor(x, y), 0.3 + 0.3 * jitter(x, y)).as_vec3());
    }
    let first = mesh.positions.len() as u32;
    let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]];
    mesh.positions.extend(corners.map(|[x, y]| Vec3::new(x, y, 0.0)));
    for positions in [[first, first + 1, first + 2], [first, first + 2, first + 3]] {
        mesh.triangles.push(Triangle { positions, normals: [0; 3], material: 0 });
    }
    scene_of(mesh, camera, light.as_vec3())
}

/// Pixels of a frame that are lit, and that hit something.
fn lit_and_hit(scene: Scene, strategy: &Strategy) -> (usize, usize) {
    let stand = Stand::new(scene, [SIDE, SIDE]);
    let local_size = [1, 1];
    let (image, hits) = stand.cast_and_count(strategy, local_size).expect("a strategy that fits");
    let lit = image.pixels.iter().filter(|pixel| pixel.iter().any(|channel| *channel > 0.0)).count();
    (lit, hits)
}

fn ways(intersector: Intersector) -> Vec<Strategy> {
    let of = |name| Strategy { intersector, ..preset(name).expect("a preset").strategy };
    let tile = of("tile");
    vec![
        of("wide"),
        of("bvh"),
        of("bvh-packet"),
        tile,
        Strategy { tile: TileSize::T8x8, ..tile },
        Strategy { tile: TileSize::T16x16, passes: Passes::Separate, ..tile },
        of("tile-group"),
    ]
}

const PIXELS: usize = (SIDE * SIDE) as usize;

#[test]
fn watertight_frames_leak_no_pixel() {
    for strategy in ways(Intersector::Watertight) {
        let (_, hits) = lit_and_hit(net_before_the_eye(), &strategy);
        assert_eq!(PIXELS - hits, 0, "primary rays that slip through: {strategy}");
        let (lit, hits) = lit_and_hit(net_before_the_light(true), &strategy);
        assert_eq!((lit, hits), (0, PIXELS), "shadow rays that slip through: {strategy}");
    }
}

#[test]
fn the_other_test_is_counted() {
    // Overlap by rounding, or edges that neighbours share, let few through, but promise nothing:
    // `cargo test --test watertight_frames -- --nocapture`.
    for strategy in ways(Intersector::MollerTrumbore) {
        let (_, hits) = lit_and_hit(net_before_the_eye(), &strategy);
        let (lit, _) = lit_and_hit(net_before_the_light(true), &strategy);
        println!("{} of {PIXELS} primary, {lit} shadow rays: {strategy}", PIXELS - hits);
        assert!(PIXELS - hits < PIXELS / 100 && lit < PIXELS / 100, "{strategy}");
    }
}

#[test]
fn without_its_net_the_floor_is_lit() {
    let (lit, hits) = lit_and_hit(net_before_the_light(false), &preset("tile").expect("a preset").strategy);
    assert_eq!((lit, hits), (PIXELS, PIXELS));
}
