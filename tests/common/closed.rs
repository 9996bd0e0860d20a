//! Closed meshes, and rays and pixels aimed at their edges and vertices.

use glam::Vec3;
use raycl::launch::Ray;
use raycl::scene::{Camera, Mesh, Scene, Triangle};

/// A repeatable random number below 2^24.
pub fn random(state: &mut u32) -> u32 {
    *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    *state >> 8
}

/// A number in 0 .. 1.
fn fraction(state: &mut u32) -> f32 {
    random(state) as f32 / (1 << 24) as f32
}

fn add(mesh: &mut Mesh, corners: [u32; 3]) {
    mesh.triangles.push(Triangle { positions: corners, normals: corners, material: 0 });
}

/// A point of the unit circle.
fn turn(step: u32, steps: u32) -> (f32, f32) {
    (2.0 * std::f32::consts::PI * (step % steps) as f32 / steps as f32).sin_cos()
}

/// A sphere of radius 1 about `centre`: 960 triangles, of which 32 meet at each pole.
fn sphere(centre: Vec3) -> Mesh {
    let (bands, rings) = (16, 32);
    let point = |ring, band| {
        let ((sin, cos), (height_sin, height_cos)) = (turn(ring, rings), turn(band, 2 * bands));
        Vec3::new(height_sin * cos, height_cos, height_sin * sin)
    };
    let index = |ring: u32, band: u32| match band {
        0 => 0,
        _ if band == bands => 1,
        _ => 2 + (band - 1) * rings + ring % rings,
    };
    let mut mesh = Mesh { normals: vec![Vec3::Y, Vec3::NEG_Y], ..Default::default() };
    for band in 1..bands {
        mesh.normals.extend((0..rings).map(|ring| point(ring, band)));
    }
    mesh.positions = mesh.normals.iter().map(|normal| centre + *normal).collect();
    for (band, ring) in (0..bands).flat_map(|band| (0..rings).map(move |ring| (band, ring))) {
        let [a, b] = [index(ring, band), index(ring + 1, band)];
        let [c, d] = [index(ring, band + 1), index(ring + 1, band + 1)];
        if band > 0 {
            add(&mut mesh, [a, b, d]);
        }
        if band + 1 < bands {
            add(&mut mesh, [a, d, c]);
        }
    }
    mesh
}

/// A ring of radius 1 and thickness 0.7 about `centre`, tilted: 1,024 triangles, concave where the hole is.
fn torus(centre: Vec3) -> Mesh {
    let (around, across) = (32, 16);
    let tilt = glam::Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.7);
    let mut mesh = Mesh::default();
    for (i, j) in (0..around).flat_map(|i| (0..across).map(move |j| (i, j))) {
        let ((sin, cos), (up, out)) = (turn(i, around), turn(j, across));
        let normal = Vec3::new(out * cos, up, out * sin);
        mesh.positions.push(centre + tilt * (Vec3::new(cos, 0.0, sin) + 0.35 * normal));
        mesh.normals.push(tilt * normal);
        let index = |i: u32, j: u32| i % around * across + j % across;
        let [a, b] = [index(i, j), index(i + 1, j)];
        let [c, d] = [index(i, j + 1), index(i + 1, j + 1)];
        add(&mut mesh, [a, b, d]);
        add(&mut mesh, [a, d, c]);
    }
    mesh
}

/// Two scenes of one closed mesh each.
pub fn closed_scenes() -> [Scene; 2] {
    [sphere(Vec3::new(0.013, -0.007, 0.021)), torus(Vec3::new(-0.017, 0.011, 0.005))].map(|mesh| {
        let mut scene = super::scene("sphere.toml");
        scene.mesh = Mesh { materials: scene.mesh.materials[..1].to_vec(), ..mesh };
        scene
    })
}

/// Rays from one point towards points on edges, every fifth towards a vertex: each has to hit a closed surface.
pub fn rays_at_edges(scene: &Scene, origin: Vec3, count: usize) -> Vec<Ray> {
    let mesh = &scene.mesh;
    let mut rays = Vec::with_capacity(count);
    let mut state = 1;
    while rays.len() < count {
        let triangle = &mesh.triangles[random(&mut state) as usize % mesh.triangles.len()];
        let corners = mesh.corners(triangle);
        let edge = random(&mut state) as usize % 3;
        let along = if random(&mut state).is_multiple_of(5) { 0.0 } else { fraction(&mut state) };
        let target = corners[edge].lerp(corners[(edge + 1) % 3], along);
        // Grazing rays may pass a surface by: keep those that cross it, from either side.
        let direction = (target - origin).normalize();
        let normals = mesh.corner_normals(triangle);
        let crossing = [edge, (edge + 1) % 3].map(|corner| normals[corner].dot(direction));
        if crossing[0].abs() > 0.25 && crossing[1].abs() > 0.25 && crossing[0] * crossing[1] > 0.0 {
            rays.push(Ray { origin, direction, t_min: 0.0 });
        }
    }
    rays
}

/// A crumpled wall that fills the view of the paper's camera, for images of `side` pixels across and down. Its
/// vertices lie behind the centres of every second pixel, each at its own depth: a quarter of an image's primary rays
/// is aimed at vertices, the rest at edges.
pub fn wall_of_pixels(side: u32) -> Scene {
    let mut scene = super::scene("sphere.toml");
    let mut mesh = Mesh { materials: scene.mesh.materials[..1].to_vec(), ..Default::default() };
    let step = 2.0 / side as f32;
    // One more than is seen on every side.
    let points = side.div_ceil(2) + 2;
    let mut state = 1;
    for (down, across) in (0..points).flat_map(|down| (0..points).map(move |across| (down, across))) {
        let at = |place: u32| (2.0 * place as f32 - 1.5) * step - 1.0;
        let depth = 1.0 + fraction(&mut state);
        mesh.positions.push(depth * Vec3::new(at(across), -at(down), -1.0));
        mesh.normals.push(Vec3::Z);
        if down > 0 && across > 0 {
            let d = down * points + across;
            let [a, b, c] = [d - points - 1, d - points, d - 1];
            add(&mut mesh, [a, c, d]);
            add(&mut mesh, [a, d, b]);
        }
    }
    scene.mesh = mesh;
    scene.camera = Camera::PAPER;
    scene
}
