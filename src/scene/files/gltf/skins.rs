//! Places the vertices of skinned meshes. A skin is a list of nodes, its joints. The joints place the vertices instead
//! of the mesh's own node, whose transform has no effect (glTF 2.0, 3.7.3).

use super::Parsed;
use super::accessors::Numbers;
use super::locals::Local;
use super::transforms::{PlacedNode, affine, is_affine, normal_matrix, worlds};
use glam::{DMat3, DMat4, DVec3};
use gltf::json::accessor::Accessor;
use gltf::json::{Index, skin};
use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap};

/// A skin whose joints have the transforms that the file's nodes have without animations.
pub(super) struct Skin {
    /// For each joint, the transform from the mesh's coordinates to the scene's coordinates: the product of the joint's
    /// transform and its inverse bind matrix. `None` if the skin's list of these matrices is too short for this joint,
    /// or if the product is not finite. If the skin has no such list, the matrices are the identity.
    joints: Vec<Option<DMat4>>,
    /// The first transform in `joints` that is not `None`.
    first: DMat4,
}

/// A set of joints (`JOINTS_n`) and weights (`WEIGHTS_n`): for each vertex, the indices of four joints in the skin's
/// list, and the weights of these joints.
pub(super) struct Influences {
    pub joints: Vec<[f64; 4]>,
    pub weights: Vec<[f64; 4]>,
}

/// If a vertex's weights have the sum 1 and are rounded to 8 bits, their sum then differs from 1 by at most `ROUNDED`.
const ROUNDED: f64 = 0.02;

/// The numbers of a part's vertices whose joints or weights are not as glTF demands.
#[derive(Default)]
pub(super) struct OddVertices {
    /// The number of vertices with joints or weights that are not valid.
    pub influences: usize,
    /// The number of other vertices whose weights have another sum than 1.
    pub sums: usize,
}

/// The skins of the nodes of a scene.
pub(super) struct Skins {
    /// The skins by their indices in the file, without the skins that have no valid joints.
    pub list: HashMap<usize, Skin>,
    /// For those skins whose list of inverse bind matrices stores nothing: the list's accessor. All matrices of such a
    /// list are zero.
    pub empty: BTreeSet<usize>,
    /// The number of inverse bind matrices whose last row is not 0 0 0 1. Matrices that are not finite, and lists that
    /// store nothing, do not count.
    pub rows: usize,
}

/// Reads the skins of the nodes `placed`. `locals` has the transforms of all nodes of the file.
pub(super) fn of_nodes(numbers: Numbers<'_>, locals: &[Local], placed: &[PlacedNode]) -> Parsed<Skins> {
    let nodes = placed.iter().filter_map(|(node, _)| numbers.root.get(*node));
    let used: Vec<_> = nodes.filter(|node| node.mesh.is_some()).filter_map(|node| node.skin).collect();
    let worlds = if used.is_empty() { Vec::new() } else { worlds(numbers.root, locals, placed) };
    let (mut skins, mut matrices) = (HashMap::new(), HashMap::new());
    for index in used {
        // Many nodes may name the same skin.
        if skins.contains_key(&index.value()) {
            continue;
        }
        let within = |what: String| format!("skin {}{what}", index.value());
        let skin = numbers.root.get(index).ok_or_else(|| within(" does not exist".to_owned()))?;
        let joints =
            joints(&numbers, skin, &worlds, &mut matrices).map_err(|what| within(format!(": {what}")))?;
        let first = joints.iter().flatten().next().copied();
        skins.insert(index.value(), first.map(|first| Skin { joints, first }));
    }
    let is_empty = |index: &usize| numbers.is_empty(Index::new(*index as u32));
    let (empty, stored): (Vec<_>, Vec<_>) = matrices.into_iter().partition(|(index, _)| is_empty(index));
    let stored = stored.iter().flat_map(|(_, list)| list).map(DMat4::from_cols_array);
    Ok(Skins {
        list: skins.into_iter().filter_map(|(index, skin)| Some((index, skin?))).collect(),
        empty: empty.into_iter().map(|(index, _)| index).collect(),
        rows: stored.filter(|matrix| matrix.is_finite() && !is_affine(matrix)).count(),
    })
}

/// Returns, for each joint of a skin, the transform from the mesh's coordinates to the scene's coordinates: see
/// [`Skin::joints`]. `matrices` has the lists of inverse bind matrices that were read so far, by their accessors: many
/// skins may name the same list.
fn joints(
    numbers: &Numbers<'_>,
    skin: &skin::Skin,
    worlds: &[Option<DMat4>],
    matrices: &mut HashMap<usize, Vec<[f64; 16]>>,
) -> Parsed<Vec<Option<DMat4>>> {
    let inverses = match skin.inverse_bind_matrices {
        Some(index) => Some(&*match matrices.entry(index.value()) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(free) => free.insert(numbers.attribute(index)?),
        }),
        None => None,
    };
    let inverse = |number: usize| match inverses {
        Some(inverses) => inverses.get(number).map(DMat4::from_cols_array).map(affine),
        None => Some(DMat4::IDENTITY),
    };
    let joint = |(number, node): (usize, &Index<_>)| {
        let node = node.value();
        let world = worlds.get(node).ok_or_else(|| format!("node {node} does not exist"))?;
        let world = world.ok_or_else(|| format!("node {node} descends from itself"))?;
        Ok(inverse(number).map(|inverse| world * inverse).filter(DMat4::is_finite))
    };
    skin.joints.iter().enumerate().map(joint).collect()
}

impl Influences {
    /// Reads a set of joints and weights. Returns an error if the set does not have `count` vertices.
    pub fn read(
        numbers: &Numbers<'_>,
        [joints, weights]: [Index<Accessor>; 2],
        count: usize,
    ) -> Parsed<Self> {
        // Joints may have any type of component, because indices that are not valid are noticed later.
        let set = Self { joints: numbers.of::<4>(joints)?, weights: numbers.attribute::<4>(weights)? };
        match [("joints", set.joints.len()), ("weights", set.weights.len())].iter().find(|(_, n)| *n != count)
        {
            Some((what, number)) => Err(format!("{number} {what} for {count} positions")),
            None => Ok(set),
        }
    }

    /// Returns pairs of the index of a joint and its weight, for one vertex.
    fn of(&self, vertex: usize) -> impl Iterator<Item = (f64, f64)> {
        self.joints[vertex].into_iter().zip(self.weights[vertex])
    }
}

impl Skin {
    /// Moves vertices from the mesh's coordinates to the scene's coordinates, and swaps two corners of each mirrored
    /// triangle. `normals` may be empty.
    pub fn place(
        &self,
        sets: &[Influences],
        positions: &mut [DVec3],
        normals: &mut [DVec3],
        triangles: &mut [[u32; 3]],
    ) -> OddVertices {
        let (mut odd, mut is_mirrored) = (OddVertices::default(), Vec::with_capacity(positions.len()));
        for (vertex, position) in positions.iter_mut().enumerate() {
            let transform = self.blended(sets, vertex, &mut odd);
            *position = transform.transform_point3(*position);
            let linear = DMat3::from_mat4(transform);
            is_mirrored.push(linear.determinant() < 0.0);
            if let Some(normal) = normals.get_mut(vertex) {
                *normal = (normal_matrix(linear) * *normal).normalize_or_zero();
            }
        }
        for corners in triangles {
            // Different joints may place the corners of a triangle, so that only some of the corners are mirrored. The
            // majority of the corners decides.
            if corners.iter().filter(|corner| is_mirrored[**corner as usize]).count() > 1 {
                corners.swap(1, 2);
            }
        }
        odd
    }

    /// Returns the mean of the transforms of a vertex's joints, weighted by the joints' weights. Joints that do not
    /// exist or have no transform, and weights that are negative or not finite, do not count. If no joint with a weight
    /// above 0 remains, the result is the transform of the skin's first valid joint. The vertex is counted in `odd` if
    /// its joints or weights are not as glTF demands.
    fn blended(&self, sets: &[Influences], vertex: usize, odd: &mut OddVertices) -> DMat4 {
        let (mut sum, mut total, mut is_odd) = (DMat4::ZERO, 0.0, false);
        for (joint, weight) in sets.iter().flat_map(|set| set.of(vertex)).filter(|(_, weight)| *weight != 0.0)
        {
            match self.joint(joint).filter(|_| weight > 0.0 && weight.is_finite()) {
                Some(transform) => {
                    sum += *transform * weight;
                    total += weight;
                }
                None => is_odd = true,
            }
        }
        let is_odd = is_odd || total <= 0.0;
        odd.influences += usize::from(is_odd);
        odd.sums += usize::from(!is_odd && (total - 1.0).abs() > ROUNDED);
        if total > 0.0 { sum * total.recip() } else { self.first }
    }

    fn joint(&self, index: f64) -> Option<&DMat4> {
        let is_index = index >= 0.0 && index.fract() == 0.0;
        self.joints.get(index as usize).filter(|_| is_index)?.as_ref()
    }
}
