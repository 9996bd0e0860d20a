//! The memory for the trees that `raycl view` builds on the host. A device that casts the pictures uses other trees.

use crate::error::Result;
use crate::memory::Available;
use crate::scene::Mesh;
use crate::strategy::REFERENCE_BYTES;

/// Returns an error if the available memory does not hold `trees` trees over a mesh. For the message, `what` names
/// the purpose of the trees.
pub fn check_room(mesh: &Mesh, trees: u64, what: &str, available: &Available) -> Result<()> {
    let (per_triangle, triangles) = (trees * REFERENCE_BYTES, mesh.triangles.len() as u64);
    available.hold(per_triangle * triangles, what, &format!("{per_triangle} B x {triangles} triangles"))
}
