//! Tests whether surfaces lie all around the eye, as in a room. In a room, more rays hit something than in a
//! picture of an object, and shadow rays are longer. In a room, the fastest strategies are therefore not the
//! same as for a picture of an object (`src/strategy/fastest.rs`). On a turntable, an eye in a room sees the
//! walls from inside, so the walls' normals must point inwards (`assemble.rs`).

use super::{Mesh, Scene};
use glam::Vec3;

/// Largest number of triangles that are tested. In a scene with more triangles, only every n-th triangle is
/// tested.
const LOOKED_AT: usize = 4096;

impl Scene {
    /// Returns true if surfaces lie all around the eye: if each of the eight octants around the camera's
    /// position contains a triangle's corner.
    pub fn encloses_eye(&self) -> bool {
        encloses(&self.mesh, self.camera.position)
    }
}

/// Returns true if each of the eight octants around the eye contains a triangle's corner. The planes between
/// the octants are perpendicular to the scene's axes.
pub(super) fn encloses(mesh: &Mesh, eye: Vec3) -> bool {
    let step = mesh.triangles.len().div_ceil(LOOKED_AT).max(1);
    let mut octants = [false; 8];
    for triangle in mesh.triangles.iter().step_by(step) {
        for corner in mesh.corners(triangle) {
            let [x, y, z] =
                (corner.as_dvec3() - eye.as_dvec3()).to_array().map(|along| usize::from(along > 0.0));
            octants[x | y << 1 | z << 2] = true;
        }
    }
    octants.iter().all(|seen| *seen)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use crate::scene::load_scene;
    use std::path::Path;

    #[test]
    fn halls_enclose_the_eye_and_tables_do_not() {
        let encloses = |name: &str| {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
            load_scene(&path).unwrap().scene.encloses_eye()
        };
        assert!(encloses("interior.toml") && encloses("atrium.toml"));
        for name in ["still-life.toml", "teapot.toml", "triangle.toml", "terrain.toml", "table.toml"] {
            assert!(!encloses(name), "{name}");
        }
    }
}
