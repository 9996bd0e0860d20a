//! Checks the memory that the meshes of a glTF file need. Even a small file can have many triangles, since
//! many nodes may place the same mesh, and many primitives may name the same accessors.

use super::accessors::Numbers;
use super::nodes::{PlacedNode, meshes_of};
use super::primitives::{Part, Sizes};
use super::textures::ColourMap;
use crate::error::Result;
use crate::memory::Available;
use crate::scene::Mapped;
use crate::scene::mesh::Triangle;
use glam::{DVec3, Vec3};
use gltf::json::mesh::Primitive;

/// Memory for a position of the whole mesh, in bytes: the position in double and in single precision, its
/// normal and its colour.
const POSITION_BYTES: u64 = (size_of::<DVec3>() + 3 * size_of::<Vec3>()) as u64;
/// Memory for an element of an accessor while its primitive is read, in bytes: at most four numbers in double
/// precision.
const ELEMENT_BYTES: u64 = size_of::<[f64; 4]>() as u64;
/// Memory for a position of a primitive after reading, in bytes: the position, its normal, its colour and its
/// texture coordinates.
const READ_BYTES: u64 = (2 * size_of::<DVec3>() + size_of::<Vec3>() + size_of::<[f32; 2]>()) as u64;

/// Refuses a file whose meshes do not fit into the host's memory. A mesh counts as often as nodes place it.
pub(super) fn hold(
    name: &str,
    numbers: Numbers<'_>,
    placed: &[PlacedNode],
    maps: &[Option<ColourMap>],
) -> Result<()> {
    let (stored, read) = needed(numbers, placed, maps);
    let sum = format!("{stored} B for all nodes + {read} B for reading a primitive");
    Available::read().hold(stored.saturating_add(read), &format!("reading {name}"), &sum)
}

/// Returns the memory for the whole mesh and the memory for reading its largest primitive, in bytes.
fn needed(numbers: Numbers<'_>, placed: &[PlacedNode], maps: &[Option<ColourMap>]) -> (u64, u64) {
    let mapped = if maps.iter().any(Option::is_some) { size_of::<Mapped>() } else { 0 };
    let triangle = (size_of::<Triangle>() + mapped) as u64;
    let of_primitive = |primitive: &Primitive| {
        let Sizes { elements, triangles, positions } = Part::largest(&numbers, primitive);
        // No count is larger than the number of bytes in memory, so these sums fit into 64 bits.
        (triangle * triangles + POSITION_BYTES * positions, ELEMENT_BYTES * elements + READ_BYTES * positions)
    };
    let of_mesh = |primitives: &[Primitive]| {
        let all = primitives.iter().map(of_primitive);
        all.fold((0, 0), |(stored, read): (u64, u64), (more, other)| {
            (stored.saturating_add(more), read.max(other))
        })
    };
    // The memory of each mesh is computed only once, even if many nodes place the mesh.
    let meshes: Vec<_> = numbers.root.meshes.iter().map(|mesh| of_mesh(&mesh.primitives)).collect();
    let all = meshes_of(numbers.root, placed).into_iter().filter_map(|mesh| meshes.get(mesh.value()));
    all.fold((0, 0), |(stored, read), (more, other)| (stored.saturating_add(*more), read.max(*other)))
}
