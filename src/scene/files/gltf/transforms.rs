//! Computes the transforms of the nodes of a glTF file.

use super::Flaw;
use super::locals::Local;
use glam::{DMat3, DMat4, DVec4};
use gltf::json::scene::{Node, Scene};
use gltf::json::{Index, Root};

/// The remedy for a node that occurs in several places of the scene.
const ONE_PARENT: &str = "glTF allows a node at most one parent: export the scene with one node per \
     place (several nodes may name the same mesh)";

/// A node of the scene, and the transform from the node's coordinates to the scene's coordinates.
pub(super) type PlacedNode = (Index<Node>, DMat4);

/// Returns the file's default scene or, if this scene does not exist, the first scene.
pub(super) fn shown_scene(root: &Root) -> Option<&Scene> {
    root.scene.and_then(|scene| root.get(scene)).or(root.scenes.first())
}

/// Returns the nodes of the shown scene. If the file has no scene, returns the nodes without a parent and their
/// descendants, which must be all nodes of the file. A parent comes before its children. `locals` has the transforms of
/// all nodes of the file.
pub(super) fn placed(root: &Root, locals: &[Local]) -> Result<Vec<PlacedNode>, Flaw> {
    let scene = shown_scene(root);
    let mut next: Vec<PlacedNode> = match scene {
        Some(scene) => scene.nodes.iter().map(|node| (*node, DMat4::IDENTITY)).collect(),
        None => roots(root).map(|node| (node, DMat4::IDENTITY)).collect(),
    };
    next.reverse();
    let (mut placed, mut visited) = (Vec::new(), vec![false; root.nodes.len()]);
    // The list `next` has the nodes that are still to be visited. Recursive calls are not used, since they
    // could overflow the call stack: nodes may be nested arbitrarily deep.
    while let Some((index, parent)) = next.pop() {
        let number = index.value();
        let node = root.get(index).ok_or_else(|| format!("node {number} does not exist"))?;
        if std::mem::replace(&mut visited[number], true) {
            let twice = Flaw::from(format!("node {number} occurs twice in the scene; expected once"));
            return Err(twice.with_remedy(ONE_PARENT));
        }
        let transform = parent * local(locals, index);
        if !transform.is_finite() {
            return Err(format!("node {number} has a transform that is not finite").into());
        }
        placed.push((index, transform));
        next.extend(node.children.iter().flatten().rev().map(|child| (*child, transform)));
    }
    match visited.iter().position(|is_visited| !is_visited) {
        Some(number) if scene.is_none() => {
            Err(format!("node {number} descends from a node that descends from itself").into())
        }
        _ => Ok(placed),
    }
}

/// Returns the transform of every node of the file to the coordinates of the scene, by the node's index. `placed` has
/// the nodes of the shown scene. The transform of any other node is the product of its ancestors' transforms and its
/// own transform. The result is `None` if a node has a parent but no ancestor without a parent, because ancestors of
/// the node form a cycle.
pub(super) fn worlds(root: &Root, locals: &[Local], placed: &[PlacedNode]) -> Vec<Option<DMat4>> {
    let mut worlds = vec![None; root.nodes.len()];
    placed.iter().for_each(|(node, transform)| worlds[node.value()] = Some(*transform));
    let mut next: Vec<PlacedNode> = roots(root).map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((index, above)) = next.pop() {
        let (Some(node), Some(world @ None)) = (root.get(index), worlds.get_mut(index.value())) else {
            continue;
        };
        let transform = above * local(locals, index);
        *world = Some(transform);
        next.extend(node.children.iter().flatten().map(|child| (*child, transform)));
    }
    worlds
}

/// Returns the transform from a node's coordinates to the coordinates of its parent. `locals` has the transforms of all
/// nodes of the file.
fn local(locals: &[Local], node: Index<Node>) -> DMat4 {
    locals.get(node.value()).map_or(DMat4::IDENTITY, |local| local.0)
}

fn roots(root: &Root) -> impl Iterator<Item = Index<Node>> {
    let nodes = has_parent(root).into_iter().enumerate();
    nodes.filter(|(_, has_parent)| !has_parent).map(|(number, _)| Index::new(number as u32))
}

/// Returns, for each node of the file, whether the node is a child of another node.
pub(super) fn has_parent(root: &Root) -> Vec<bool> {
    let mut has_parent = vec![false; root.nodes.len()];
    for child in root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
        if let Some(known) = has_parent.get_mut(child.value()) {
            *known = true;
        }
    }
    has_parent
}

/// Returns true if the last row of a matrix is 0 0 0 1, except for rounding.
pub(super) fn is_affine(matrix: &DMat4) -> bool {
    matrix.row(3).abs_diff_eq(DVec4::W, 1e-6)
}

/// Returns the matrix with the last row 0 0 0 1.
pub(super) fn affine(mut matrix: DMat4) -> DMat4 {
    let DMat4 { x_axis, y_axis, z_axis, w_axis } = &mut matrix;
    (x_axis.w, y_axis.w, z_axis.w, w_axis.w) = (0.0, 0.0, 0.0, 1.0);
    matrix
}

/// Returns the matrix that transforms normals: the matrix of cofactors of `linear`, negated if the
/// determinant is negative. The returned matrix is the inverse transpose of `linear` times a positive factor.
/// Unlike the inverse of `linear`, the returned matrix also exists if the transform flattens the mesh.
pub(super) fn normal_matrix(linear: DMat3) -> DMat3 {
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let turned = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    if linear.determinant() < 0.0 { turned * -1.0 } else { turned }
}
