//! Counts nodes that raycl draws wrongly because it does not support an extension.

use super::left_out::{Counted, notes_on};
use super::transforms::PlacedNode;
use gltf::json::Root;
use gltf::json::scene::Node;
use serde_json::Value;

/// The extension that places several copies of a node's mesh.
const INSTANCES: &str = "EXT_mesh_gpu_instancing";
/// The extension that hides a node and its descendants.
const VISIBILITY: &str = "KHR_node_visibility";

/// Returns true if this module writes notes on the nodes that have this extension.
pub(super) fn are_noted(extension: &str) -> bool {
    [INSTANCES, VISIBILITY].contains(&extension)
}

/// Returns notes on the nodes `placed` of the shown scene.
pub(super) fn notes(root: &Root, placed: &[PlacedNode]) -> impl Iterator<Item = String> {
    let has_mesh = |number: &usize| root.nodes[*number].mesh.is_some();
    let nodes = || placed.iter().map(|(node, _)| node.value());
    let has_instances = |number: &usize| extension(&root.nodes[*number], INSTANCES).is_some();
    let is_hidden = hidden(root, placed);
    let counts: [Counted; 2] = [
        (
            nodes().filter(has_mesh).filter(has_instances).count(),
            "node with a mesh and EXT_mesh_gpu_instancing",
            "drawn without instances, only once per node",
        ),
        (
            nodes().filter(has_mesh).filter(|number| is_hidden[*number]).count(),
            "node with a mesh, hidden by KHR_node_visibility,",
            "drawn nevertheless",
        ),
    ];
    notes_on(counts)
}

/// Returns a note on lights of nodes that the extension [`VISIBILITY`] hides. The note is true only if the file's lights
/// are used.
pub(super) fn note_lights(root: &Root, placed: &[PlacedNode]) -> impl Iterator<Item = String> {
    let is_hidden = hidden(root, placed);
    let has_light = |node: &Node| node.extensions.as_ref().is_some_and(|of| of.khr_lights_punctual.is_some());
    let lights = placed.iter().map(|(node, _)| node.value()).filter(|number| has_light(&root.nodes[*number]));
    let count = lights.filter(|number| is_hidden[*number]).count();
    notes_on([(count, "light, hidden by KHR_node_visibility,", "used nevertheless")])
}

/// Returns, for each node of the file, whether it is in the shown scene and the extension [`VISIBILITY`] hides it. In
/// `placed`, a parent comes before its children.
fn hidden(root: &Root, placed: &[PlacedNode]) -> Vec<bool> {
    let mut is_hidden = vec![false; root.nodes.len()];
    for number in placed.iter().map(|(node, _)| node.value()) {
        let node = &root.nodes[number];
        is_hidden[number] |=
            extension(node, VISIBILITY).is_some_and(|of| of["visible"] == Value::Bool(false));
        if is_hidden[number] {
            node.children.iter().flatten().for_each(|child| is_hidden[child.value()] = true);
        }
    }
    is_hidden
}

fn extension<'a>(node: &'a Node, name: &str) -> Option<&'a Value> {
    node.extensions.as_ref()?.others.get(name)
}
