//! Counts parts of a glTF file that the picture leaves out or shows differently, and writes notes on these
//! parts.

use super::Parsed;
use super::primitives::{Part, mode_of};
use crate::words::{counted, counted_are};
use gltf::json::Root;
use gltf::json::mesh::Primitive;
use gltf::json::validation::Checked;
use std::collections::BTreeSet;

/// The number of parts of a kind, the name of one such part, and what raycl does with it.
pub(super) type Counted = (usize, &'static str, &'static str);

/// Returns a note for each kind of which there are parts.
pub(super) fn notes_on(counts: impl IntoIterator<Item = Counted>) -> impl Iterator<Item = String> {
    counts
        .into_iter()
        .filter(|(count, ..)| *count > 0)
        .map(|(count, what, done)| format!("{} {done}", counted_are(count, what)))
}

/// The number of parts of each kind that the picture leaves out or shows differently.
#[derive(Default)]
pub(super) struct LeftOut {
    pub orthographic: usize,
    /// The number of cameras without a known type, or without the values of their type.
    pub odd_cameras: usize,
    /// The number of cameras whose transform leaves no viewing direction.
    pub flat_cameras: usize,
    /// The number of nodes with a camera that are not in the shown scene, and of cameras that no node names.
    pub other_cameras: usize,
    pub spots: usize,
    /// The number of lights without a known type.
    pub odd_lights: usize,
    pub ranges: usize,
    /// The number of lights whose intensity times colour is 0.
    pub dark: usize,
    /// The number of directional lights whose transform leaves no direction.
    pub flat_lights: usize,
    /// The number of nodes with a light that are not in the shown scene, and of lights that no node names.
    pub other_lights: usize,
    /// The number of nodes with a mesh that are not in the shown scene, which has other meshes.
    pub other_meshes: usize,
    /// The number of meshes that no node names, if the shown scene has other meshes.
    pub nodeless: usize,
    /// The number of primitives whose node has a skin that does not place them. The reason is that the primitive has no
    /// joints and weights, or that no joint of the skin is valid.
    pub unskinned: usize,
    /// The number of vertices with joints or weights that are not valid.
    pub odd_influences: usize,
    /// The number of vertices whose weights have another sum than 1.
    pub odd_sums: usize,
    /// The number of inverse bind matrices whose last row is not 0 0 0 1.
    pub odd_inverses: usize,
    /// The number of sets of joints without weights, and of sets of weights without joints.
    pub unpaired: usize,
    pub targets: usize,
    pub clear_colours: usize,
    /// The number of primitives with `COLOR_1`, `COLOR_2` and so on.
    pub other_colours: usize,
    /// The number of primitives whose colours are whole numbers that the file does not call normalised.
    pub whole_colours: usize,
    pub lines_and_points: usize,
    /// The number of primitives without a known mode.
    pub odd_modes: usize,
    /// The number of primitives of triangles without positions.
    pub unpositioned: usize,
    /// The number of primitives of triangles with an empty list of indices, or without indices and with an empty list
    /// of positions.
    pub cornerless: usize,
    /// The number of meshes without primitives.
    pub partless: usize,
    /// The accessors that store nothing.
    pub empty: BTreeSet<usize>,
    /// The number of primitives whose indices are normalised.
    pub normalised: usize,
    pub dangling: usize,
    /// The number of corners after the last whole triangle of a primitive.
    pub spare: usize,
    pub odd_coordinates: usize,
    /// The number of triangles whose texture coordinates are so far from 0 that single precision stores them
    /// inexactly.
    pub coarse: usize,
    /// The number of primitives whose positions are so far from 0 that single precision stores most triangles with
    /// inexact shapes.
    pub coarse_shapes: usize,
    /// The number of nodes with a mesh whose shape changes when its positions are rounded to single precision.
    pub distorted: usize,
    /// The number of the file's meshes, if the file's scene contains none of them.
    pub unplaced: usize,
}

impl LeftOut {
    /// Adds those counts of the primitive `part` (a part of a mesh) that do not depend on its skin.
    pub fn add(&mut self, part: &Part) {
        self.odd_coordinates += part.odd_coordinates;
        self.empty.extend(&part.empty);
        self.normalised += usize::from(part.has_normalised_indices);
        self.whole_colours += usize::from(part.has_whole_colours);
        self.dangling += part.dangling;
        self.spare += part.spare;
    }

    /// Adds those counts of the primitive `part` (a part of a mesh) that depend on its skin.
    pub fn add_skinned(&mut self, part: &Part) {
        self.odd_influences += part.odd_vertices.influences;
        self.odd_sums += part.odd_vertices.sums;
        self.unpaired += part.unpaired;
        self.empty.extend(&part.empty);
    }

    /// Counts a primitive that is not drawn.
    pub fn add_undrawn(&mut self, primitive: &Primitive) {
        let count = match primitive.mode {
            Checked::Invalid => &mut self.odd_modes,
            _ if mode_of(primitive).is_some() => &mut self.unpositioned,
            _ => &mut self.lines_and_points,
        };
        *count += 1;
    }

    /// Returns an error if no triangle remains (`triangles` is 0) and some triangles were left out because
    /// they name positions that do not exist.
    pub fn check(&self, triangles: usize) -> Parsed<()> {
        if triangles == 0 && self.dangling > 0 {
            let triangles = counted_are(self.dangling, "triangle with a position that does not exist");
            return Err(format!("no triangle remains; {triangles} left out"));
        }
        Ok(())
    }

    pub fn notes(&self) -> impl Iterator<Item = String> {
        notes_on(self.unseen().into_iter().chain(self.skinned()).chain(self.primitives()))
    }

    /// Returns the counts of cameras and lights that are not used, and of meshes that no node of the scene places.
    fn unseen(&self) -> [Counted; 8] {
        [
            (self.unplaced, "mesh that no node of the scene places", "shown without a transform"),
            (self.orthographic, "orthographic camera", "not used: all views are in perspective"),
            (self.odd_cameras, "camera of an unknown type or without the values of its type", "not used"),
            (
                self.flat_cameras,
                "camera without a viewing direction",
                "left out: the scales of nodes must not be 0",
            ),
            (self.other_cameras, "camera without a place in the shown scene", "not used"),
            (self.other_lights, "light without a place in the shown scene", "not used"),
            (self.other_meshes, "node with a mesh, outside the shown scene,", "left out"),
            (self.nodeless, "mesh that no node names", "left out"),
        ]
    }

    /// Returns notes that are true only if the file's lights are used.
    pub fn light_notes(&self) -> impl Iterator<Item = String> {
        notes_on([
            (
                self.odd_lights,
                "light of an unknown type",
                "shown as a point light; expected directional, point or spot",
            ),
            (self.spots, "spot light", "shown as shining in all directions"),
            (self.ranges, "light with a range", "shown without it"),
            (self.dark, "light with an intensity or colour of 0", "left out"),
            (
                self.flat_lights,
                "directional light without a direction",
                "shown as shining along -y: the scales of nodes must not be 0",
            ),
        ])
    }

    /// Returns the counts of skins and of the vertices that they place.
    fn skinned(&self) -> [Counted; 5] {
        [
            (
                self.unskinned,
                "primitive that its skin does not place",
                "shown with the transform of the mesh's node",
            ),
            (
                self.odd_influences,
                "vertex with joints or weights that are not valid",
                "placed by the valid joints or, if no joint of a vertex is valid, by the skin's first valid joint",
            ),
            (
                self.odd_sums,
                "vertex with weights whose sum is not 1",
                "placed with these weights divided by their sum",
            ),
            (
                self.odd_inverses,
                "joint with an inverse bind matrix whose last row is not 0 0 0 1",
                "used as if this row were 0 0 0 1; the file must store the matrix column by column",
            ),
            (
                self.unpaired,
                "set of joints (JOINTS_n) or of weights (WEIGHTS_n) without the other",
                "ignored",
            ),
        ]
    }

    /// Returns the counts of primitives (parts of meshes), and of their triangles and accessors.
    fn primitives(&self) -> [Counted; 17] {
        [
            (
                self.distorted,
                "node with a mesh, far from the origin,",
                "shown with an inexact shape: positions are stored in single precision",
            ),
            (
                self.coarse_shapes,
                "primitive with coarse positions",
                "shown with triangles that may have inexact shapes: the file stores positions in single precision, \
                 which is coarse for such large coordinates",
            ),
            (self.targets, "primitive with morph targets", "shown without them"),
            (self.clear_colours, "primitive with alpha in its COLOR_0", "shown without this alpha"),
            (self.other_colours, "primitive with colours other than COLOR_0", "shown without these colours"),
            (
                self.whole_colours,
                "primitive with whole numbers in COLOR_0, but without `normalized`,",
                "shown as if they were normalised",
            ),
            (self.lines_and_points, "primitive of lines or points", "left out"),
            (self.odd_modes, "primitive of an unknown mode", "left out"),
            (self.unpositioned, "primitive of triangles without positions", "left out"),
            (self.cornerless, "primitive of triangles without corners", "left out"),
            (self.partless, "mesh without primitives", "left out"),
            (self.empty.len(), "accessor without data", "read as zeros"),
            (self.normalised, "primitive with normalised indices", "shown as if they were not normalised"),
            (self.dangling, "triangle with a position that does not exist", "left out"),
            (self.spare, "corner after the last whole triangle", "left out"),
            (self.odd_coordinates, "texture coordinate with a number that is not finite", "ignored"),
            (
                self.coarse,
                "triangle with texture coordinates beyond +-4096",
                "shown with an inexact texture: in single precision, such numbers have steps of at least 1/2048; \
                 expected numbers near 0",
            ),
        ]
    }
}

/// Returns a note on which scene is shown, if the file has several scenes or if its default scene does not exist.
/// Returns `None` otherwise.
pub(super) fn other_scenes(root: &Root) -> Option<String> {
    let shown = match root.scene {
        Some(scene) if scene.value() >= root.scenes.len() => {
            let scenes = counted(root.scenes.len(), "scene");
            let instead = if root.scenes.is_empty() { "all nodes are" } else { "the first is" };
            let default = format!("the file's default is scene {}, counted from 0", scene.value());
            return Some(format!("{default}, but the file has {scenes}: {instead} shown"));
        }
        Some(scene) => {
            format!("of which the file's default is shown (scene {}, counted from 0)", scene.value())
        }
        None => "of which the first is shown".to_owned(),
    };
    (root.scenes.len() > 1).then(|| format!("the file has {} scenes, {shown}", root.scenes.len()))
}

#[cfg(test)]
mod tests {
    use super::super::skins::OddVertices;
    use super::*;

    #[test]
    fn several_parts_of_a_kind_are_counted_in_the_plural() {
        let notes = |count| -> Vec<String> {
            LeftOut { odd_coordinates: count, dangling: count, ..LeftOut::default() }.notes().collect()
        };
        let one = [
            "1 triangle with a position that does not exist is left out",
            "1 texture coordinate with a number that is not finite is ignored",
        ];
        let two = [
            "2 triangles with a position that does not exist are left out",
            "2 texture coordinates with a number that is not finite are ignored",
        ];
        assert_eq!([notes(1), notes(2)], [one, two]);
    }

    #[test]
    fn the_counts_of_all_parts_of_a_mesh_are_added() {
        let part = |count| Part {
            positions: Vec::new(),
            normals: Vec::new(),
            colours: Vec::new(),
            coloured: 0,
            outside: 0,
            has_whole_colours: false,
            is_clear: false,
            coordinates: Vec::new(),
            influences: Vec::new(),
            is_placed: false,
            triangles: Vec::new(),
            material: 0,
            empty: vec![count, 7],
            has_normalised_indices: true,
            dangling: 10 * count,
            spare: 100 * count,
            odd_coordinates: 1000 * count,
            odd_vertices: OddVertices { influences: 10_000 * count, sums: 1_000_000 * count },
            unpaired: 100_000 * count,
        };
        let mut all = LeftOut::default();
        [1, 2].map(part).iter().for_each(|part| {
            all.add(part);
            all.add_skinned(part);
        });
        assert_eq!([all.empty.len(), all.dangling, all.spare, all.odd_coordinates], [3, 30, 300, 3000]);
        assert_eq!([all.odd_influences, all.unpaired, all.odd_sums], [30_000, 300_000, 3_000_000]);
        assert_eq!(all.normalised, 2);
    }
}
