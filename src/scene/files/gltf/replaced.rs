//! Counts values in the JSON of a glTF file that raycl ignores or replaces, since they contradict others or are not
//! valid.

use super::left_out::{Counted, notes_on};
use super::transforms::{has_parent, is_affine, shown_scene};
use glam::{DMat4, DQuat};
use gltf::json::Root;
use gltf::json::scene::Node;

/// If a rotation of length 1 is rounded to 8 bits, its length then differs from 1 by at most `ROUNDED`.
const ROUNDED: f64 = 1e-2;

/// Returns notes on nodes, images and buffer views that contradict themselves or have values that are not valid.
pub(super) fn notes(root: &Root) -> impl Iterator<Item = String> {
    let [nodes, others] = [of_nodes(root), of_data(root)];
    notes_on(nodes.into_iter().chain(others))
}

fn of_nodes(root: &Root) -> Vec<Counted> {
    let count = |is_odd: fn(&Node) -> bool| root.nodes.iter().filter(|node| is_odd(node)).count();
    vec![
        (
            count(has_row),
            "node with a matrix whose last row is not 0 0 0 1",
            "placed without this row; the file must store the matrix column by column",
        ),
        (
            count(has_both),
            "node with a matrix and a translation, rotation or scale",
            "placed by the matrix alone",
        ),
        (
            count(is_rotated_oddly),
            "node with a rotation whose length is not 1",
            "turned by the rotation divided by its length; a rotation of length 0 is ignored",
        ),
        (
            children_in_scene(root),
            "node of the scene with a parent outside the scene",
            "placed without the transform of this parent",
        ),
    ]
}

fn of_data(root: &Root) -> Vec<Counted> {
    let doubled = root.images.iter().filter(|image| image.uri.is_some() && image.buffer_view.is_some());
    let unspaced = |stride: &gltf::json::buffer::Stride| stride.0 == 0;
    let unspaced = root.buffer_views.iter().filter(|view| view.byte_stride.as_ref().is_some_and(unspaced));
    vec![
        (doubled.count(), "image with both a uri and a bufferView", "used without the bufferView"),
        (unspaced.count(), "buffer view with a byteStride of 0", "read without gaps between elements"),
    ]
}

fn has_row(node: &Node) -> bool {
    node.matrix.is_some_and(|matrix| !is_affine(&DMat4::from_cols_array(&matrix.map(f64::from))))
}

fn has_both(node: &Node) -> bool {
    node.matrix.is_some() && (node.translation.is_some() || node.rotation.is_some() || node.scale.is_some())
}

fn is_rotated_oddly(node: &Node) -> bool {
    let length = |rotation: [f32; 4]| DQuat::from_array(rotation.map(f64::from)).length();
    let is_odd = |rotation| (length(rotation) - 1.0).abs() > ROUNDED;
    node.matrix.is_none() && node.rotation.is_some_and(|rotation| is_odd(rotation.0))
}

/// Returns the number of nodes in the list of the shown scene that are children of other nodes. These other nodes are
/// outside the scene, because no node may occur twice in the scene.
fn children_in_scene(root: &Root) -> usize {
    let Some(scene) = shown_scene(root) else { return 0 };
    let has_parent = has_parent(root);
    scene.nodes.iter().filter(|node| has_parent.get(node.value()).is_some_and(|has| *has)).count()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[track_caller]
    fn assert_noted(keys: &str, expected: &[&str]) {
        let root: Root =
            serde_json::from_str(&format!(r#"{{"asset": {{"version": "2.0"}}, {keys}}}"#)).unwrap();
        assert_eq!(notes(&root).collect::<Vec<_>>(), expected, "{keys}");
    }

    #[test]
    fn transforms_that_are_not_used_as_they_are_stated_are_noted() {
        let row = "1 node with a matrix whose last row is not 0 0 0 1 is placed without this row; the file must store \
                   the matrix column by column";
        let matrix =
            |last: &str| format!(r#""nodes": [{{"matrix": [1,0,0,{last}, 0,1,0,0, 0,0,1,0, 5,6,7,1]}}]"#);
        assert_noted(&matrix("0.0000001"), &[]);
        assert_noted(&matrix("3"), &[row]);
        assert_noted(r#""nodes": [{"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,0.5]}]"#, &[row]);
        let both = r#""nodes": [{"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1], "scale": [1, 1, 1]}]"#;
        let note = "1 node with a matrix and a translation, rotation or scale is placed by the matrix alone";
        assert_noted(both, &[note]);
        let rotations = |list: &[&str]| {
            let nodes = list.iter().map(|rotation| format!(r#"{{"rotation": {rotation}}}"#));
            format!(r#""nodes": [{}]"#, nodes.collect::<Vec<_>>().join(","))
        };
        assert_noted(&rotations(&["[0, 0, 0.709, 0.701]", "[0, 0.995, 0, 0]"]), &[]);
        let note = "2 nodes with a rotation whose length is not 1 are turned by the rotation divided by its length; a \
                    rotation of length 0 is ignored";
        assert_noted(&rotations(&["[0, 0, 2, 1]", "[0, 0, 0, 1]", "[0, 0, 0, 0]"]), &[note]);
    }

    #[test]
    fn a_node_whose_parent_is_outside_the_scene_is_noted() {
        let scene =
            |node: u32| format!(r#""scenes": [{{"nodes": [{node}]}}], "nodes": [{{}}, {{"children": [0]}}]"#);
        assert_noted(&scene(1), &[]);
        let note = "1 node of the scene with a parent outside the scene is placed without the transform of this parent";
        assert_noted(&scene(0), &[note]);
        assert_noted(r#""nodes": [{}, {"children": [0]}]"#, &[]);
    }

    #[test]
    fn images_of_two_sources_and_strides_of_0_are_noted() {
        assert_noted(r#""images": [{"uri": "a.png"}, {"bufferView": 0}]"#, &[]);
        let note = "1 image with both a uri and a bufferView is used without the bufferView";
        assert_noted(r#""images": [{"uri": "a.png", "bufferView": 0}]"#, &[note]);
        let views = |stride: u32| {
            format!(r#""bufferViews": [{{"buffer": 0, "byteLength": 4, "byteStride": {stride}}}]"#)
        };
        assert_noted(&views(4), &[]);
        assert_noted(
            &views(0),
            &["1 buffer view with a byteStride of 0 is read without gaps between elements"],
        );
    }
}
