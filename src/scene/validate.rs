//! What every scene keeps to, however it was made.

use super::mesh::{Mesh, PARALLEL_TRIANGLES};
use super::{Camera, Light, Material, Scene};
use crate::error::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;

/// Coordinates lie within plus and minus this: intersection multiplies three of
/// them, which must stay below f32's 3.4e38.
pub const MAX_COORDINATE: f32 = 1e12;

impl Scene {
    /// Checks what every later room takes for granted: finite numbers in their
    /// ranges, indices in bounds, a camera with a direction. [`super::load_scene`]
    /// has done so already; a scene made in code should be checked once.
    ///
    /// # Errors
    /// The first thing that is wrong, in words.
    pub fn validate(&self) -> Result<()> {
        let numbers = [
            ("the background", self.background.min_element(), self.background.is_finite()),
            ("shadow_bias", self.shadow_bias, self.shadow_bias.is_finite()),
            ("the exposure", self.display.exposure, self.display.exposure.is_finite()),
        ];
        for (what, value, finite) in numbers {
            require(finite && value >= 0.0, || {
                format!("{what} is {value}; expected a finite value of at least 0")
            })?;
        }
        let gamma = self.display.gamma;
        require(gamma > 0.0 && gamma.is_finite(), || format!("gamma is {gamma}; expected more than 0"))?;
        check_camera(&self.camera)?;
        self.lights.iter().try_for_each(check_light)?;
        check_mesh(&self.mesh)
    }
}

fn require(holds: bool, message: impl FnOnce() -> String) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::input(message())) }
}

fn in_range(position: Vec3) -> bool {
    // A comparison with NaN is false.
    position.is_finite() && position.abs().max_element() <= MAX_COORDINATE
}

fn check_camera(camera: &Camera) -> Result<()> {
    let at = camera.position;
    require(in_range(at), || {
        format!("the camera is at {at}; expected coordinates within +-{MAX_COORDINATE:e}")
    })?;
    let units = [camera.right, camera.up, camera.forward];
    let orthonormal = units.iter().all(|v| (v.length() - 1.0).abs() < 1e-3)
        && units[0].cross(units[1]).dot(-units[2]) > 0.999;
    require(orthonormal, || "the camera's axes are no orthonormal basis".to_owned())?;
    let tan = camera.tan_half_fov;
    require(tan > 0.0 && tan.is_finite(), || {
        "the field of view is not between 0 and 180 degrees".to_owned()
    })?;
    let near = camera.z_near;
    require(near >= 0.0 && near.is_finite(), || {
        format!("z_near is {near}; expected a distance of at least 0")
    })
}

fn check_light(light: &Light) -> Result<()> {
    let (at, power) = (light.position, light.power);
    require(in_range(at), || {
        format!("a light is at {at}; expected coordinates within +-{MAX_COORDINATE:e}")
    })?;
    let valid = power.is_finite() && power.min_element() >= 0.0;
    require(valid, || format!("a light's power is {power}; expected finite values of at least 0"))
}

fn check_material(material: &Material) -> Result<()> {
    let numbers = material.to_floats();
    require(numbers.iter().all(|value| value.is_finite() && *value >= 0.0), || {
        format!(
            "a material has {numbers:?} (k_L, k_G, shininess, kind); expected finite values of at least 0"
        )
    })
}

fn check_mesh(mesh: &Mesh) -> Result<()> {
    require(!mesh.triangles.is_empty(), || "the scene has no triangles".to_owned())?;
    mesh.materials.iter().try_for_each(check_material)?;
    let far = mesh.positions.par_iter().with_min_len(PARALLEL_TRIANGLES).find_first(|p| !in_range(**p));
    require(far.is_none(), || {
        let position = far.copied().unwrap_or_default();
        format!("a vertex is at {position}; expected coordinates within +-{MAX_COORDINATE:e}")
    })?;
    let usable = |n: &Vec3| n.is_finite() && *n != Vec3::ZERO;
    let usable = mesh.normals.par_iter().with_min_len(PARALLEL_TRIANGLES).all(usable);
    require(usable, || "a normal is zero or not finite".to_owned())?;
    let (positions, normals) = (mesh.positions.len(), mesh.normals.len());
    let materials = mesh.materials.len();
    let bounded = mesh.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES).all(|t| {
        t.positions.iter().all(|&i| (i as usize) < positions)
            && t.normals.iter().all(|&i| (i as usize) < normals)
            && (t.material as usize) < materials
    });
    require(bounded, || "a triangle names a vertex, normal or material that does not exist".to_owned())
}
