//! Layers of a picture: numbers that describe what the ray through each pixel's centre hits, and what the pixel costs.
//! The layers are computed on the host in double precision, whatever device casts the picture.

use super::cast::Caster;
use super::cost::{self, Cost};
use super::count;
use super::intersect::Hit;
use super::real::Vector as _;
use super::tree::Tree;
use crate::error::Result;
use crate::scene::{Mesh, Scene};
use crate::strategy::Culling;
use glam::DVec3;
use rayon::prelude::*;

/// The number in `Layers::triangle` and `Layers::object` for a pixel whose ray hits nothing.
pub const NOTHING: u32 = u32::MAX;

/// The layers of a picture. Each list contains one element per pixel, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layers {
    /// Image size in pixels: across, down.
    pub size: [u32; 2],
    /// Depth along the viewing direction in the scene's units; infinite without a hit.
    pub depth: Vec<f32>,
    /// The interpolated normal, of length 1; zero without a hit, and where the corners' normals cancel out.
    pub normal: Vec<[f32; 3]>,
    /// The diffuse reflectance: the material's k_L times the colours of the corners and of the texture, in linear
    /// light; zero without a hit.
    pub albedo: Vec<[f32; 3]>,
    /// The number of the triangle in the scene, from 0; [`NOTHING`] without a hit.
    pub triangle: Vec<u32>,
    /// The number of the object in the scene, from 0; [`NOTHING`] without a hit.
    pub object: Vec<u32>,
    /// How many triangle tests the pixel's rays need in a tree: the sum over the primary ray and all shadow rays.
    pub tests: Vec<u32>,
    /// How many nodes the pixel's rays visit in a tree: the sum over the primary ray and all shadow rays. Leaves do not
    /// count.
    pub nodes: Vec<u32>,
}

/// Returns the layers of a scene. `object_starts` contains the number of each object's first triangle, in
/// ascending order.
///
/// # Errors
///
/// Fails if the scene has more triangles than a tree can index.
pub fn layers(scene: &Scene, object_starts: &[u32], size: [u32; 2], culling: Culling) -> Result<Layers> {
    // `in_tree` frees its tree before `pixel_hits` builds another one: trees of large meshes take gigabytes.
    let costs: Vec<Cost> = cost::in_tree(scene, size, culling)?;
    let hits = pixel_hits(scene, size, culling);
    let object = |triangle: u32| object_of(object_starts, triangle);
    Ok(Layers {
        size,
        depth: hits.iter().map(|hit| hit.map_or(f32::INFINITY, |hit| hit.depth)).collect(),
        normal: hits.iter().map(|hit| hit.map_or([0.0; 3], |hit| hit.normal)).collect(),
        albedo: hits.iter().map(|hit| hit.map_or([0.0; 3], |hit| hit.albedo)).collect(),
        triangle: hits.iter().map(|hit| hit.map_or(NOTHING, |hit| hit.triangle)).collect(),
        object: hits.iter().map(|hit| hit.map_or(NOTHING, |hit| object(hit.triangle))).collect(),
        tests: costs.iter().map(|cost| cost.tests).collect(),
        nodes: costs.iter().map(|cost| cost.nodes).collect(),
    })
}

/// What the layers show of a pixel's hit.
#[derive(Clone, Copy, Debug)]
pub struct PixelHit {
    depth: f32,
    normal: [f32; 3],
    albedo: [f32; 3],
    triangle: u32,
}

/// Returns the hit of each pixel's ray; `None` if the ray hits nothing.
fn pixel_hits(scene: &Scene, size: [u32; 2], culling: Culling) -> Vec<Option<PixelHit>> {
    let caster = Caster::<f64>::new(scene, size, Tree::new(&scene.mesh, culling));
    let forward = scene.camera.forward.as_dvec3();
    let look = |index: usize| -> Option<PixelHit> {
        let [x, y] = cost::pixel_at(index, size[0]).map(|coordinate| f64::from(coordinate) + 0.5);
        let (ray, hit) = caster.look(x, y);
        let hit = hit?;
        let normal = normal_at(&scene.mesh, &hit);
        let depth = (ray.direction * hit.t).dot(forward);
        let albedo = caster.base_colour(&ray, &hit);
        Some(PixelHit {
            depth: depth as f32,
            normal: normal.to_f32(),
            albedo: albedo.to_f32(),
            triangle: hit.triangle,
        })
    };
    (0..count(size)).into_par_iter().map(look).collect()
}

/// Returns the interpolated normal of a hit, of length 1; zero where the corners' normals cancel out.
pub fn normal_at(mesh: &Mesh, hit: &Hit<f64>) -> DVec3 {
    let corners = mesh.corner_normals(&mesh.triangles[hit.triangle as usize]).map(|normal| normal.as_dvec3());
    let normal: DVec3 = corners.iter().zip(hit.weights).map(|(normal, weight)| *normal * weight).sum();
    normal.normalize_or_zero()
}

/// Returns the number of the object to which a triangle belongs. `object_starts` contains the number of each
/// object's first triangle, in ascending order.
pub fn object_of(object_starts: &[u32], triangle: u32) -> u32 {
    object_starts.partition_point(|start| *start <= triangle).saturating_sub(1) as u32
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::super::fixtures;
    use super::*;

    #[test]
    fn a_triangle_before_the_ground() {
        // Triangle 0 lies in the plane z = -2. Triangles 2 and 3 are the ground, the plane y = -1, whose normal points
        // up.
        let scene = fixtures::figure_4();
        let layers = layers(&scene, &[0, 1, 2], [80, 80], Culling::None).unwrap();
        let at = |x: usize, y: usize| y * 80 + x;
        let middle = at(40, 40);
        assert!((layers.depth[middle] - 2.0).abs() < 1e-6 && layers.object[middle] < 2);
        let ground = at(70, 75);
        assert_eq!((layers.object[ground], layers.normal[ground]), (2, [0.0, 1.0, 0.0]));
        assert!(layers.triangle[ground] == 2 || layers.triangle[ground] == 3);
        let sky = at(2, 2);
        assert_eq!((layers.triangle[sky], layers.object[sky]), (NOTHING, NOTHING));
        let own = |pixel: usize| {
            scene.mesh.material(&scene.mesh.triangles[layers.triangle[pixel] as usize]).lambertian.to_array()
        };
        assert_eq!(
            [layers.albedo[middle], layers.albedo[ground], layers.albedo[sky]],
            [own(middle), own(ground), [0.0; 3]]
        );
        assert!(layers.depth[sky].is_infinite() && layers.normal[sky] == [0.0; 3]);
        assert!(layers.tests[middle] > 0 && layers.nodes[middle] > 0);
        let costs = cost::in_tree(&scene, [80, 80], Culling::None).unwrap();
        assert!(costs.iter().any(|cost| cost.tests != cost.nodes));
        assert!(costs.iter().map(|cost| cost.tests).eq(layers.tests.iter().copied()));
        assert!(costs.iter().map(|cost| cost.nodes).eq(layers.nodes.iter().copied()));
    }

    /// Rays go through the centres of pixels. If two triangles meet at the border between the two pixels of a picture,
    /// the pixels therefore see different triangles.
    #[test]
    fn pixels_are_seen_at_their_centres() {
        use glam::Vec3;
        let halves = |[a, b]: [Vec3; 2]| {
            let mut scene = fixtures::single_triangle();
            let mesh = scene.mesh_mut();
            let corners = |towards: Vec3| [a, b, towards * 100.0].map(|corner| corner + Vec3::NEG_Z * 2.0);
            let across = (b - a).cross(Vec3::Z).normalize();
            mesh.positions = [corners(-across), corners(across)].concat();
            let of = |first| crate::scene::Triangle {
                positions: [first, first + 1, first + 2],
                normals: [0; 3],
                material: 0,
            };
            mesh.triangles = vec![of(0), of(3)];
            scene
        };
        let upright = halves([Vec3::NEG_Y * 50.0, Vec3::Y * 50.0]);
        assert_eq!(layers(&upright, &[0, 1], [2, 1], Culling::None).unwrap().triangle, [0, 1]);
        let level = halves([Vec3::NEG_X * 50.0, Vec3::X * 50.0]);
        assert_eq!(layers(&level, &[0, 1], [1, 2], Culling::None).unwrap().triangle, [0, 1]);
    }
}
