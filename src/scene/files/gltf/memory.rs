//! Checks the memory that the meshes of a glTF file need. Even a small file can have many triangles, since
//! many nodes may place the same mesh, and many primitives may name the same accessors.

use super::accessors::Numbers;
use super::nodes::meshes_of;
use super::primitives::{Part, Sizes};
use super::textures::ColourMap;
use super::transforms::PlacedNode;
use crate::error::Result;
use crate::memory::Available;
use crate::scene::Mapped;
use crate::scene::mesh::Triangle;
use glam::{DMat4, DVec3, Vec3};
use gltf::json::mesh::Primitive;
use std::collections::BTreeMap;

/// Memory for a position of the whole mesh, in bytes: the position in double and in single precision, its
/// normal and its colour.
const POSITION_BYTES: u64 = (size_of::<DVec3>() + 3 * size_of::<Vec3>()) as u64;
/// Memory for an element of an accessor while its primitive is read, in bytes: at most four numbers in double
/// precision.
const ELEMENT_BYTES: u64 = size_of::<[f64; 4]>() as u64;
/// Memory for a position of a primitive after reading, in bytes: the position, its normal, its colour and its
/// texture coordinates.
const READ_BYTES: u64 = (2 * size_of::<DVec3>() + size_of::<Vec3>() + size_of::<[f32; 2]>()) as u64;

/// Memory for a joint or an inverse bind matrix, in bytes.
const MATRIX_BYTES: u64 = size_of::<DMat4>() as u64;

/// Refuses a file whose meshes do not fit into the host's memory. A mesh counts as often as nodes place it.
pub(super) fn hold(
    name: &str,
    numbers: Numbers<'_>,
    placed: &[PlacedNode],
    maps: &[Option<ColourMap>],
) -> Result<()> {
    let (stored, read) = needed(numbers, placed, maps);
    let skins = skins(numbers);
    let sum = format!(
        "{stored} B for the meshes of all nodes + {read} B for reading the largest primitive + {skins} B for skins"
    );
    let all = stored.saturating_add(read).saturating_add(skins);
    Available::read().hold(all, &format!("reading {name}"), &sum)
}

/// Returns the memory for the joints of all skins and for their lists of inverse bind matrices, in bytes. Skins that
/// name the same list share it.
fn skins(numbers: Numbers<'_>) -> u64 {
    let skins = &numbers.root.skins;
    let joints: u64 = skins.iter().map(|skin| skin.joints.len() as u64).sum();
    let lists = skins.iter().filter_map(|skin| skin.inverse_bind_matrices);
    let lists: BTreeMap<_, _> = lists.map(|index| (index.value(), numbers.count(index))).collect();
    let matrices = lists.values().fold(joints, |sum, count| sum.saturating_add(*count));
    MATRIX_BYTES.saturating_mul(matrices)
}

/// Returns the memory for the whole mesh and the memory for reading its largest primitive, in bytes.
fn needed(numbers: Numbers<'_>, placed: &[PlacedNode], maps: &[Option<ColourMap>]) -> (u64, u64) {
    let mapped = if maps.iter().any(Option::is_some) { size_of::<Mapped>() } else { 0 };
    let triangle = (size_of::<Triangle>() + mapped) as u64;
    let of_primitive = |primitive: &Primitive| {
        let Sizes { elements, triangles, positions } = Part::largest(&numbers, primitive);
        // The sizes of the buffers in memory limit the three counts, so the two sums of bytes fit into 64
        // bits.
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use glam::DMat4;
    use gltf::json::{Index, Root};

    /// The meshes are a primitive of 2 triangles, a primitive of 200 triangles, and both primitives together.
    /// Without normals, each triangle has three positions of its own.
    #[test]
    fn a_mesh_counts_as_often_as_it_is_placed_and_only_the_largest_primitive_is_read_at_a_time() {
        let text = r#"{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}, {"mesh": 1}, {"mesh": 2}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]},
{"primitives": [{"attributes": {"POSITION": 0}, "indices": 2}]},
{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}, {"attributes": {"POSITION": 0}, "indices": 2}]}],
"accessors": [{"componentType": 5126, "count": 100, "type": "VEC3"},
{"componentType": 5123, "count": 6, "type": "SCALAR"}, {"componentType": 5123, "count": 600, "type": "SCALAR"}]}"#;
        let root: Root = serde_json::from_str(text).unwrap();
        let of_nodes = |nodes: &[u32]| {
            let placed: Vec<PlacedNode> =
                nodes.iter().map(|node| (Index::new(*node), DMat4::IDENTITY)).collect();
            needed(Numbers::of_file(&root, &[]), &placed, &[])
        };
        let triangle = size_of::<Triangle>() as u64;
        let small = 2 * triangle + 6 * POSITION_BYTES;
        let large = 200 * triangle + 600 * POSITION_BYTES;
        assert_eq!(of_nodes(&[0]), (small, 106 * ELEMENT_BYTES + 6 * READ_BYTES));
        let read = 700 * ELEMENT_BYTES + 600 * READ_BYTES;
        assert_eq!(of_nodes(&[2]), (small + large, read));
        assert_eq!(of_nodes(&[0, 1, 0]), (2 * small + large, read));
    }

    /// The skins have 4 joints together, and the two lists of inverse bind matrices have 101 elements.
    #[test]
    fn the_joints_of_all_skins_and_each_list_of_inverse_bind_matrices_are_counted() {
        let text = r#"{"asset": {"version": "2.0"}, "nodes": [{}], "skins": [
{"joints": [0, 0], "inverseBindMatrices": 0}, {"joints": [0], "inverseBindMatrices": 1}, {"joints": [0], "inverseBindMatrices": 0}],
"accessors": [{"componentType": 5126, "count": 100, "type": "MAT4"},
{"componentType": 5126, "count": 1, "type": "MAT4"}]}"#;
        let root: Root = serde_json::from_str(text).unwrap();
        assert_eq!(skins(Numbers::of_file(&root, &[])), 105 * MATRIX_BYTES);
    }
}
