//! The scene a ray is cast through: triangles, materials, lights, a camera.
//!
//! A [`Scene`] is validated when it is made: every number is finite, every
//! index in bounds, every triangle has normals. Nothing after it checks again.
//! Its `f32` values are the truth for device and reference alike.

mod camera;
mod material;
mod mesh;

pub use camera::{Camera, PixelFrame};
pub use material::{Material, MaterialKind};
pub use mesh::{Mesh, Triangle};

use glam::Vec3;

/// A light at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Where it is, in the scene's units.
    pub position: Vec3,
    /// Its power in red, green and blue.
    pub power: Vec3,
}

/// How radiance becomes 8-bit values: `trunc(255 * clamp(exposure * L, 0, 1)^(1/gamma))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Display {
    /// The factor before the curve; the paper's is 15.
    pub exposure: f32,
    /// The exponent's inverse; the paper's is 2.2.
    pub gamma: f32,
}

impl Default for Display {
    fn default() -> Self {
        Self { exposure: 15.0, gamma: 2.2 }
    }
}

/// The radiance of a ray that hits nothing, in the paper's figures.
pub const PAPER_BACKGROUND: Vec3 = Vec3::new(0.0022, 0.0032, 0.0053);

/// A validated scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// What reports call it.
    pub name: String,
    /// All triangles, with their two index sets and materials.
    pub mesh: Mesh,
    /// The lights, in the order of the file.
    pub lights: Vec<Light>,
    /// From where it is seen.
    pub camera: Camera,
    /// The radiance of a ray that hits nothing.
    pub background: Vec3,
    /// How far a shadow ray starts from its surface, in the scene's units.
    pub shadow_bias: f32,
    /// How radiance is shown.
    pub display: Display,
}

impl Scene {
    /// A hash of everything that decides the picture's radiance.
    pub fn content_hash(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        let mut floats = |values: &[f32]| {
            for value in values {
                hasher.update(&value.to_le_bytes());
            }
        };
        for vector in self.mesh.positions.iter().chain(&self.mesh.normals) {
            floats(&vector.to_array());
        }
        for material in &self.mesh.materials {
            floats(&material.to_floats());
        }
        for light in &self.lights {
            floats(&light.position.to_array());
            floats(&light.power.to_array());
        }
        let camera = &self.camera;
        for vector in [camera.position, camera.right, camera.up, camera.forward, self.background] {
            floats(&vector.to_array());
        }
        floats(&[camera.tan_half_fov, f32::from(camera.fov_is_vertical), camera.z_near, self.shadow_bias]);
        for triangle in &self.mesh.triangles {
            for index in triangle.positions.iter().chain(&triangle.normals).chain([&triangle.material]) {
                hasher.update(&index.to_le_bytes());
            }
        }
        hasher.finalize().to_hex()[..16].to_string()
    }
}
