//! Scenes and rays that show mistakes of rounding at edges: rays aimed at edges and vertices of closed meshes, rays
//! that pass just outside edges, and nets whose edges and vertices lie on the rays of an image's pixels.

use glam::{DVec3, Vec3};
use raycl::launch::Ray;
use raycl::scene::{Camera, Light, Mesh, Scene, Triangle};

/// Returns a repeatable random number below 2^24.
pub fn random(state: &mut u32) -> u32 {
    *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    *state >> 8
}

/// Returns a random number from 0 to 1.
fn fraction(state: &mut u32) -> f32 {
    random(state) as f32 / (1 << 24) as f32
}

fn add(mesh: &mut Mesh, corners: [u32; 3]) {
    mesh.triangles.push(Triangle { positions: corners, normals: corners, material: 0 });
}

/// Returns the sine and the cosine of `step` of `steps` equal parts of a full turn.
fn turn(step: u32, steps: u32) -> (f32, f32) {
    (2.0 * std::f32::consts::PI * (step % steps) as f32 / steps as f32).sin_cos()
}

const SPHERE: Vec3 = Vec3::new(0.013, -0.007, 0.021);
const TORUS: Vec3 = Vec3::new(2.983, 0.011, 0.005);

/// The points at which rays start: two points outside the sphere and the torus, one near the sphere's centre,
/// one inside the sphere close to its surface, and one inside the torus.
pub const ORIGINS: [Vec3; 5] = [
    Vec3::new(1.3, 0.2, 3.0),
    Vec3::new(-0.3, 2.6, 0.7),
    Vec3::new(0.1, 0.2, 0.3),
    Vec3::new(0.98, 0.03, 0.11),
    Vec3::new(3.83, 0.52, 0.12),
];

/// Returns a sphere of radius 1 around `centre`: 960 triangles, of which 32 meet at each pole.
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

/// Returns a tilted ring of radius 1 and thickness 0.7 around `centre`: 1,024 triangles, concave at the hole.
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

/// Returns a scene of a sphere and a torus beside it.
pub fn closed_meshes() -> Scene {
    let mut mesh = sphere(SPHERE);
    mesh.append(torus(TORUS));
    let mut scene = super::scene("sphere.toml");
    scene.mesh = Mesh { materials: scene.mesh.materials[..1].to_vec(), ..mesh }.into();
    scene
}

/// Returns `count` rays from `origin` towards points on edges of a mesh, and the distances of these points
/// from `origin`. About every fifth of the points is a vertex. Every ray must hit a triangle at the point
/// towards which the ray goes, or at a point that is nearer to `origin`.
pub fn rays_at_edges(mesh: &Mesh, origin: Vec3, count: usize) -> (Vec<Ray>, Vec<f32>) {
    let mut state = 1;
    std::iter::repeat_with(|| ray_at_an_edge(mesh, origin, &mut state)).flatten().take(count).unzip()
}

/// Returns a ray from `origin` towards a random point on an edge, and the point's distance. Returns `None` if
/// the ray meets the surface at such a small angle that it may miss the edge.
fn ray_at_an_edge(mesh: &Mesh, origin: Vec3, state: &mut u32) -> Option<(Ray, f32)> {
    let triangle = &mesh.triangles[random(state) as usize % mesh.triangles.len()];
    let corners = mesh.corners(triangle);
    let edge = random(state) as usize % 3;
    let along = if random(state).is_multiple_of(5) { 0.0 } else { fraction(state) };
    let offset = corners[edge].lerp(corners[(edge + 1) % 3], along) - origin;
    let direction = offset.normalize();
    // At both ends of the edge that the ray meets, the ray must come from the same side of the surface, and
    // not at a small angle to the surface.
    let normals = mesh.corner_normals(triangle);
    let crossing = [edge, (edge + 1) % 3].map(|corner| normals[corner].dot(direction));
    let crosses = crossing[0].abs() > 0.25 && crossing[1].abs() > 0.25 && crossing[0] * crossing[1] > 0.0;
    crosses.then(|| (Ray { origin, direction, t_min: 0.0 }, offset.length()))
}

/// Returns true if `nearest`, the nearest triangle that a traversal found for a ray, is not farther away than `target`
/// (by more than a thousandth). Returns false if it is farther away, or if no triangle was found.
pub fn is_stopped(mesh: &Mesh, ray: &Ray, target: f32, nearest: Option<u32>) -> bool {
    let Some(triangle) = nearest.map(|index| &mesh.triangles[index as usize]) else { return false };
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    let normal = (b - a).cross(c - a);
    let t = normal.dot(a - ray.origin.as_dvec3()) / normal.dot(ray.direction.as_dvec3());
    t < f64::from(target) * 1.001
}

/// Returns a net (a grid of triangles) over an image of `side` x `side` pixels. The net has a vertex on the
/// ray of every second pixel across and down, and a few vertices beyond the image. The rays of a quarter of
/// the pixels meet vertices, and all others meet edges. `corner` takes a position in the image, in pixels,
/// and returns the place of a vertex on the ray through this position.
fn net(side: u32, corner: impl Fn(f64, f64) -> Vec3) -> Mesh {
    let across = side / 2 + 5;
    let coordinate = |i: u32| 2.0 * f64::from(i) - 3.5;
    let mut mesh = Mesh { normals: vec![Vec3::Z], ..Mesh::default() };
    mesh.positions =
        (0..across * across).map(|i| corner(coordinate(i % across), coordinate(i / across))).collect();
    for row in 0..across - 1 {
        for column in 0..across - 1 {
            let [a, b] = [row * across + column, (row + 1) * across + column];
            add_flat(&mut mesh, [a, a + 1, b + 1]);
            add_flat(&mut mesh, [a, b + 1, b]);
        }
    }
    mesh
}

fn add_flat(mesh: &mut Mesh, positions: [u32; 3]) {
    mesh.triangles.push(Triangle { positions, normals: [0; 3], material: 0 });
}

/// Returns a number from 0 to 1 that looks random, but depends only on x and y.
fn jitter(x: f64, y: f64) -> f64 {
    let mixed = (x * 12.9898 + y * 78.233).sin() * 43758.5453;
    mixed - mixed.floor()
}

/// The size of a sliver in [`slivers_beside_the_rays`], relative to the sliver's distance from the camera.
const SLIVER: f64 = 1e-3;

/// Returns a scene with a sliver beside each ray of an image: a triangle that the camera sees almost edge-on, so that
/// it looks about as narrow as a rounding error. The ray lies in the sliver's plane (up to rounding), but passes the
/// sliver at a distance of at least half the sliver's size ([`SLIVER`]). No ray of the image therefore hits a sliver.
pub fn slivers_beside_the_rays(side: u32) -> Scene {
    let frame = Camera::PAPER.pixel_frame(side, side);
    let mut mesh = Mesh { normals: vec![Vec3::Z], ..Mesh::default() };
    let mut state = 1;
    let mut within = |low: f64, high: f64| low + (high - low) * f64::from(fraction(&mut state));
    for pixel in 0..side * side {
        let [x, y] = [pixel % side, pixel / side].map(|coordinate| f64::from(coordinate) + 0.5);
        let direction = frame.direction(x, y).normalize();
        let (sin, cos) = within(0.0, std::f64::consts::TAU).sin_cos();
        let (right, up) = direction.any_orthonormal_pair();
        let [across, off_plane] = [right * cos + up * sin, up * cos - right * sin];
        let away = direction + off_plane * 10.0_f64.powf(within(-6.0, -4.5));
        let shift = within(1.0, 3.0);
        let first = mesh.positions.len() as u32;
        for _ in 0..3 {
            let offset = across * (shift + within(-0.5, 0.5)) + away * within(-0.5, 0.5);
            mesh.positions.push((direction + offset * SLIVER).as_vec3());
        }
        add_flat(&mut mesh, [first, first + 1, first + 2]);
    }
    before_black(mesh, Camera::PAPER, Vec3::new(0.0, 0.0, -4.0))
}

fn before_black(mesh: Mesh, camera: Camera, light: Vec3) -> Scene {
    let mut scene = super::scene("sphere.toml");
    let materials = scene.mesh.materials[..1].to_vec();
    scene.mesh = Mesh { materials, ..mesh }.into();
    scene.camera = camera;
    scene.lights = vec![Light { position: light, power: Vec3::ONE, radius: 0.0, area: None }];
    scene.background = Vec3::ZERO;
    scene
}

/// Returns a scene with a net (a grid of triangles) in front of the camera of the student paper that raycl
/// reproduces. The paper's camera is at the origin, so that the vertices are as exact as possible. The net is
/// lit from behind, so that no shadow rays are cast. If `is_flat` is false, the net is crumpled (its vertices
/// have different depths), so that the boxes of the tree have depths of all sizes. If `is_flat` is true, the
/// boxes have no depth: a ray enters and leaves a box at the same point.
pub fn net_before_the_eye(side: u32, is_flat: bool) -> Scene {
    let frame = Camera::PAPER.pixel_frame(side, side);
    let depth = |x, y| if is_flat { 1.3 } else { 1.0 + jitter(x, y) };
    let mesh = net(side, |x, y| (frame.direction(x, y) * depth(x, y)).as_vec3());
    before_black(mesh, Camera::PAPER, Vec3::new(0.0, 0.0, -4.0))
}

/// Returns a scene of a floor seen from below, a light above it and, if `shaded`, a net between floor and
/// light. The shadow rays start at the points of the floor that the pixels' centres show, and meet the
/// vertices and edges of the net.
pub fn net_before_the_light(side: u32, shaded: bool) -> Scene {
    let (from, to) = (Vec3::new(0.3, 0.2, -3.0), Vec3::new(0.1, 0.0, 0.0));
    let camera = Camera::looking_at(from, to, Vec3::Y, 50.0, true).expect("a camera");
    let frame = camera.pixel_frame(side, side);
    let light = DVec3::new(0.2, -0.3, 2.5);
    let floor = |x: f64, y: f64| {
        let direction = frame.direction(x, y);
        frame.eye + direction * (-frame.eye.z / direction.z)
    };
    let mut mesh = Mesh { normals: vec![Vec3::Z], ..Mesh::default() };
    if shaded {
        mesh = net(side, |x, y| light.lerp(floor(x, y), 0.3 + 0.3 * jitter(x, y)).as_vec3());
    }
    let first = mesh.positions.len() as u32;
    let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]];
    mesh.positions.extend(corners.map(|[x, y]| Vec3::new(x, y, 0.0)));
    add_flat(&mut mesh, [first, first + 1, first + 2]);
    add_flat(&mut mesh, [first, first + 2, first + 3]);
    before_black(mesh, camera, light.as_vec3())
}

/// Returns a triangle, and rays from one point that pass just outside the triangle's edges. A ray passes an
/// edge at `part` times the distance from the rays' common point to the edge.
pub fn rays_beside_edges(part: f32) -> (Scene, Vec<Ray>) {
    let corners = [Vec3::new(-1.0, -0.9, 0.0), Vec3::new(1.1, -0.8, 0.1), Vec3::new(0.2, 1.2, -0.2)];
    let origin = Vec3::new(0.1, 0.05, 3.0);
    let mut scene = super::scene("sphere.toml");
    let materials = scene.mesh.materials[..1].to_vec();
    let mut mesh =
        Mesh { positions: corners.to_vec(), normals: vec![Vec3::Z; 3], materials, ..Mesh::default() };
    add(&mut mesh, [0, 1, 2]);
    scene.mesh = mesh.into();
    let ray = |number: u16| {
        let edge = usize::from(number) % 3;
        let [from, to] = [corners[edge], corners[(edge + 1) % 3]].map(Vec3::as_dvec3);
        let start = origin.as_dvec3();
        let offset = from.lerp(to, 0.05 + 0.9 * f64::from(number) / 2000.0) - start;
        // This direction is perpendicular to the plane through the edge and the origin. `inwards` is 1 if the
        // direction points to the triangle's side of this plane, and -1 otherwise.
        let outwards = (from - start).cross(to - start).normalize();
        let inwards = outwards.dot(corners[(edge + 2) % 3].as_dvec3() - start).signum();
        let direction = (offset - outwards * inwards * f64::from(part) * offset.length()).normalize();
        Ray { origin, direction: direction.as_vec3(), t_min: 0.0 }
    };
    (scene, (0..2000).map(ray).collect())
}
