//! Scenes for tests, built in code: the small scenes of the student paper that raycl reproduces, random
//! triangles, and a sphere.

use crate::scene::{
    Camera, Display, Light, Mapped, Material, Mesh, PAPER_BACKGROUND, Scene, Texture, Textures, Triangle,
    Wrap,
};
use glam::{Vec3, vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The first scene of the student paper: one glossy triangle.
pub(crate) fn single_triangle() -> Scene {
    scene("single triangle", upright(glossy(vec3(2.5, 2.0, 0.0))), vec3(1.0, 3.0, 1.0))
}

/// The triangle of the student paper's first scene, with normals that point to a light behind it. A copy of
/// the triangle lies between the triangle and the light, `gap` behind the triangle. The shadow bias is 0.01.
pub(crate) fn lit_from_behind(gap: f32) -> Scene {
    let mut scene = single_triangle();
    scene.mesh_mut().normals.fill(Vec3::NEG_Z);
    scene.lights[0].position = vec3(0.0, 0.0, -4.0);
    scene.shadow_bias = 1e-2;
    let mut behind = (*scene.mesh).clone();
    behind.positions.iter_mut().for_each(|corner| corner.z -= gap);
    scene.mesh_mut().append(behind);
    scene
}

/// The scene of the student paper's Figure 4: the triangle of the paper's first scene in green, a copy of
/// this triangle with the opposite orientation, and the ground.
pub(crate) fn figure_4() -> Scene {
    let mut mesh = upright(glossy(vec3(0.0, 0.6, 0.0)));
    let mut twin = mesh.triangles[0];
    twin.positions.swap(1, 2);
    twin.normals.swap(1, 2);
    mesh.triangles.push(twin);
    mesh.append(ground());
    scene("figure 4", mesh, vec3(1.0, 3.0, 1.0))
}

/// The scene of the upper picture in the student paper's Figure 3.
pub(crate) fn pyramid_upper() -> Scene {
    pyramid("pyramid upper", vec3(1.0, 3.0, 1.0))
}

/// The scene of the lower picture in the student paper's Figure 3, with the larger shadow bias that this
/// scene needs.
pub(crate) fn pyramid_lower() -> Scene {
    Scene { shadow_bias: 1e-2, ..pyramid("pyramid lower", vec3(3.0, 0.95, -1.5)) }
}

/// Small triangles at random positions in front of the camera, each with its own normals.
pub(crate) fn random(triangles: usize, seed: u64) -> Scene {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut vector = move |half: f32| Vec3::from_array([(); 3].map(|()| random.random_range(-half..half)));
    let mut mesh = Mesh { materials: vec![glossy(vec3(0.5, 0.6, 0.7))], ..Mesh::default() };
    for _ in 0..triangles {
        let centre = vec3(0.0, 0.0, -4.0) + vector(2.0);
        let corners = [(); 3].map(|()| centre + vector(0.4));
        let normals = [(); 3].map(|()| vector(1.0));
        add(&mut mesh, corners, normals);
    }
    scene("random triangles", mesh, vec3(1.0, 3.0, 1.0))
}

/// A closed sphere of `4 * bands^2` triangles, on the ground.
pub(crate) fn sphere(bands: usize) -> Scene {
    let centre = vec3(0.0, 0.0, -2.5);
    let at = |i: usize, j: usize| {
        let (polar, turn) = (i as f32 / bands as f32, j as f32 / bands as f32);
        let ((sin_p, cos_p), (sin_t, cos_t)) =
            ((polar * std::f32::consts::PI).sin_cos(), (turn * std::f32::consts::PI).sin_cos());
        vec3(sin_p * cos_t, cos_p, sin_p * sin_t)
    };
    let mut mesh = Mesh { materials: vec![glossy(vec3(0.5, 0.6, 0.7))], ..Mesh::default() };
    for (i, j) in (0..bands).flat_map(|i| (0..2 * bands).map(move |j| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        add(&mut mesh, [a, b, c].map(|n| centre + n), [a, b, c]);
        add(&mut mesh, [a, c, d].map(|n| centre + n), [a, c, d]);
    }
    mesh.append(ground());
    scene("sphere", mesh, vec3(2.0, 3.0, 1.0))
}

/// Turns the mesh's first `count` triangles into holes: their mask is transparent everywhere.
pub(crate) fn make_holes(mesh: &mut Mesh, count: usize) {
    let clear = Texture {
        size: [1, 1],
        wrap: [Wrap::Repeat; 2],
        least_alpha: u16::MAX / 2,
        texels: vec![0_u32].into(),
    };
    let mut mapped = vec![Mapped::NONE; mesh.triangles.len()];
    mapped[..count].fill(Mapped { mask: Some(0), ..Mapped::NONE });
    mesh.textures = Textures { list: vec![clear], mapped };
}

fn scene(name: &str, mesh: Mesh, light: Vec3) -> Scene {
    Scene {
        name: name.into(),
        mesh: mesh.into(),
        lights: vec![Light { position: light, power: Vec3::splat(10.0), radius: 0.0, area: None }],
        camera: Camera::PAPER,
        sky: None,
        background: PAPER_BACKGROUND,
        transparent: false,
        shadow_bias: 1e-4,
        smooth_shadows: false,
        display: Display::default(),
    }
}

fn glossy(lambertian: Vec3) -> Material {
    Material::blinn_phong(lambertian, Vec3::splat(0.2), 100.0)
}

fn upright(material: Material) -> Mesh {
    let mut mesh = Mesh { materials: vec![material], ..Mesh::default() };
    let corners = [vec3(0.0, 1.0, -2.0), vec3(-1.9, -1.0, -2.0), vec3(1.6, -0.5, -2.0)];
    let normals = [vec3(0.0, 0.6, 1.0), vec3(-0.4, -0.4, 1.0), vec3(0.4, -0.4, 1.0)];
    add(&mut mesh, corners, normals);
    mesh
}

fn ground() -> Mesh {
    let mut mesh = Mesh { materials: vec![Material::lambertian(Vec3::splat(0.8))], ..Mesh::default() };
    let at = |x, z| vec3(x, -1.0, z);
    let [a, b, c, d] = [at(-10.0, -0.01), at(10.0, -0.01), at(10.0, -10.0), at(-10.0, -10.0)];
    add(&mut mesh, [a, b, c], [Vec3::Y; 3]);
    add(&mut mesh, [a, c, d], [Vec3::Y; 3]);
    mesh
}

fn pyramid(name: &str, light: Vec3) -> Scene {
    let mut mesh = Mesh { materials: vec![glossy(vec3(2.5, 0.2, 2.0))], ..Mesh::default() };
    let apex = vec3(0.0, 2.0, -3.5);
    let [front, left, right] = [vec3(0.0, -1.0, -2.0), vec3(-2.0, -1.0, -3.0), vec3(2.0, -1.0, -3.0)];
    add(&mut mesh, [apex, left, front], [vec3(1.0, 2.0, 1.0); 3]);
    add(&mut mesh, [apex, front, right], [Vec3::Z; 3]);
    add(&mut mesh, [apex, right, left], [Vec3::NEG_Z; 3]);
    add(&mut mesh, [front, left, right], [Vec3::NEG_Y; 3]);
    mesh.append(ground());
    scene(name, mesh, light)
}

/// Adds a triangle of the mesh's first material.
fn add(mesh: &mut Mesh, corners: [Vec3; 3], normals: [Vec3; 3]) {
    let (p, n) = (mesh.positions.len() as u32, mesh.normals.len() as u32);
    mesh.positions.extend(corners);
    mesh.normals.extend(normals);
    mesh.triangles.push(Triangle { positions: [p, p + 1, p + 2], normals: [n, n + 1, n + 2], material: 0 });
}
