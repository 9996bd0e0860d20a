//! Reads the parts of glTF meshes (primitives). Each part has one material.

use super::Parsed;
use super::accessors::Numbers;
use super::materials::white;
use super::skins::{Influences, OddVertices, Skin};
use crate::scene::files::colours::is_outside;
use crate::scene::files::origin::are_coarse;
use glam::{DVec3, Vec3};
use gltf::json::accessor::Accessor;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root};
use std::collections::BTreeSet;

/// A part of a mesh (a primitive in glTF), in the coordinates of its node or, if a skin places it, of the scene.
pub(super) struct Part {
    pub positions: Vec<DVec3>,
    /// The normals: one per position, or none at all.
    pub normals: Vec<DVec3>,
    /// The colours in linear light: one per position, or none at all.
    pub colours: Vec<Vec3>,
    /// The number of the file's vertices that have a colour and belong to a triangle.
    pub coloured: usize,
    /// The number of vertices that belong to a triangle and have a colour with channels outside 0 to 1.
    pub outside: usize,
    /// True if the file stores the colours as whole numbers that it does not call normalised.
    pub has_whole_colours: bool,
    /// True if some of the colours have an alpha below 1.
    pub is_clear: bool,
    /// Texture coordinates: one pair per position, or none at all.
    pub coordinates: Vec<[f32; 2]>,
    /// The sets of joints and weights, until a skin places the part.
    pub influences: Vec<Influences>,
    /// True if a skin has placed the part.
    pub is_placed: bool,
    pub triangles: Vec<[u32; 3]>,
    /// The index of the material in `Materials::list`: the file's materials begin at 1. A part without a
    /// material has the index 0 or, if the part has colours, the index that [`white`] returns.
    pub material: u32,
    /// The primitive's accessors that store nothing, so that all their elements are zero.
    pub empty: Vec<usize>,
    /// True if the list of indices asks for normalised numbers, which glTF does not allow for indices.
    pub has_normalised_indices: bool,
    /// Number of triangles that were left out, since they name a position that does not exist.
    pub dangling: usize,
    /// Number of corners after the last whole triangle.
    pub spare: usize,
    /// Number of texture coordinates that are not finite.
    pub odd_coordinates: usize,
    /// The numbers of vertices whose joints or weights are not as glTF demands.
    pub odd_vertices: OddVertices,
    /// Number of sets of joints without weights, and of sets of weights without joints, of a part with a skin.
    pub unpaired: usize,
}

/// Upper limits of a part's sizes, computed from the numbers of elements of its accessors.
#[derive(Default)]
pub(super) struct Sizes {
    /// The number of elements of all accessors together.
    pub elements: u64,
    pub triangles: u64,
    /// The number of positions that triangles use.
    pub positions: u64,
}

/// The accessors of a primitive that raycl reads. A field is `None` if the primitive does not have this accessor, or if
/// raycl does not need it.
struct Used {
    positions: Option<Index<Accessor>>,
    normals: Option<Index<Accessor>>,
    colours: Option<Index<Accessor>>,
    coordinates: Option<Index<Accessor>>,
    indices: Option<Index<Accessor>>,
    /// The sets of joints and their weights.
    influences: Vec<[Index<Accessor>; 2]>,
    /// The number of sets of joints without weights, and of sets of weights without joints.
    unpaired: usize,
}

impl Used {
    fn of(primitive: &Primitive, set: Option<u32>, is_skinned: bool) -> Self {
        let attribute = |wanted: Semantic| primitive.attributes.get(&Checked::Valid(wanted)).copied();
        let sets = primitive.attributes.keys().filter_map(|semantic| match semantic {
            Checked::Valid(Semantic::Joints(set) | Semantic::Weights(set)) => Some(*set),
            _ => None,
        });
        let sets: BTreeSet<u32> = sets.filter(|_| is_skinned).collect();
        let pair =
            |set: &u32| Some([attribute(Semantic::Joints(*set))?, attribute(Semantic::Weights(*set))?]);
        let influences: Vec<_> = sets.iter().filter_map(pair).collect();
        Self {
            positions: attribute(Semantic::Positions),
            normals: attribute(Semantic::Normals),
            colours: attribute(Semantic::Colors(0)),
            coordinates: set.and_then(|set| attribute(Semantic::TexCoords(set))),
            indices: primitive.indices,
            unpaired: sets.len() - influences.len(),
            influences,
        }
    }

    fn all(&self) -> impl Iterator<Item = Index<Accessor>> {
        let single = [self.positions, self.normals, self.colours, self.coordinates, self.indices];
        single.into_iter().flatten().chain(self.influences.iter().flatten().copied())
    }

    /// Returns the indices of the accessors in `self` that store nothing.
    fn empty(&self, numbers: &Numbers<'_>) -> Vec<usize> {
        self.all().filter(|index| numbers.is_empty(*index)).map(|index| index.value()).collect()
    }
}

impl Part {
    /// Reads a primitive. `set` is the index of the set of texture coordinates that the texture of the primitive's
    /// material uses. Joints are read if `is_skinned` is true. Returns `None` for lines, points and a primitive without
    /// positions. Returns an error if a list of normals, colours, texture coordinates, joints or weights that is read
    /// does not have one element per position.
    pub fn read(
        numbers: &Numbers<'_>,
        primitive: &Primitive,
        set: Option<u32>,
        is_skinned: bool,
    ) -> Parsed<Option<Self>> {
        let used = Used::of(primitive, set, is_skinned);
        // A primitive is left out if it has no positions, or if its mode is not triangles, strips or fans.
        // Positions from extensions are not read.
        let (Some(mode), Some(index)) = (mode_of(primitive), used.positions) else { return Ok(None) };
        let vectors = |index: Index<Accessor>| {
            Ok::<_, String>(numbers.attribute::<3>(index)?.into_iter().map(DVec3::from_array).collect())
        };
        let positions: Vec<DVec3> = vectors(index)?;
        let normals: Vec<DVec3> = used.normals.map(vectors).transpose()?.unwrap_or_default();
        let colours = used.colours.map(|index| colours(numbers, index)).transpose()?;
        let (colours, is_clear) = colours.unwrap_or_default();
        let coordinates = used.coordinates.map(|index| coordinates(numbers, index)).transpose()?;
        let coordinates = coordinates.unwrap_or_default();
        let odd_coordinates =
            coordinates.iter().filter(|pair| !pair.iter().all(|value| value.is_finite())).count();
        let counts = [
            ("normals", used.normals, normals.len()),
            ("colours", used.colours, colours.len()),
            ("texture coordinates", used.coordinates, coordinates.len()),
        ];
        for (what, list, count) in counts {
            if list.is_some() && count != positions.len() {
                return Err(format!("{count} {what} for {} positions", positions.len()));
            }
        }
        let influences = used.influences.iter().map(|set| Influences::read(numbers, *set, positions.len()));
        let influences = influences.collect::<Parsed<Vec<_>>>()?;
        let indices = corners(numbers, used.indices, positions.len())?;
        let material = material(numbers.root, primitive, !colours.is_empty())?;
        let (triangles, dangling) = existing(triangles(mode, &indices), positions.len());
        let empty = used.empty(numbers);
        let part = Self {
            triangles,
            positions,
            normals,
            colours,
            coloured: 0,
            outside: 0,
            has_whole_colours: used.colours.is_some_and(|index| numbers.is_whole(index)),
            is_clear,
            coordinates,
            influences,
            is_placed: false,
            material,
            empty,
            has_normalised_indices: used.indices.is_some_and(|index| numbers.is_normalised(index)),
            dangling,
            spare: spare(mode, indices.len()),
            odd_coordinates,
            odd_vertices: OddVertices::default(),
            unpaired: used.unpaired,
        };
        let mut part = part.compact();
        part.coloured = part.colours.len();
        part.outside = part.colours.iter().filter(|colour| is_outside(colour)).count();
        Ok(Some(part))
    }

    /// Returns the part as it is shown: its skin, if it has one, has placed the vertices, and every triangle has
    /// normals.
    pub fn placed(self, skin: Option<&Skin>) -> Self {
        let part = if let Some(skin) = skin { self.placed_by(skin) } else { self };
        if part.normals.is_empty() { part.flat() } else { part }
    }

    /// Returns true if the primitive has no corners, so that it has no triangles either.
    pub fn has_no_corners(&self) -> bool {
        self.triangles.is_empty() && self.dangling == 0 && self.spare == 0
    }

    /// Returns true if the file's positions are too coarse for the shapes of most triangles.
    pub fn is_coarse(&self) -> bool {
        are_coarse(&self.triangles, |corners| corners.map(|corner| self.positions[corner as usize].as_vec3()))
    }

    /// Returns upper limits of the sizes of a primitive, without reading its buffers.
    pub fn largest(numbers: &Numbers<'_>, primitive: &Primitive) -> Sizes {
        let used = Used::of(primitive, Some(0), true);
        let (Some(mode), Some(index)) = (mode_of(primitive), used.positions) else { return Sizes::default() };
        let vertices = numbers.count(index);
        let corners = used.indices.map_or(vertices, |index| numbers.count(index));
        let triangles = if mode == Mode::Triangles { corners / 3 } else { corners };
        // Without normals, each triangle has its own positions.
        let positions = if used.normals.is_some() { vertices.min(3 * triangles) } else { 3 * triangles };
        Sizes { elements: used.all().map(|index| numbers.count(index)).sum(), triangles, positions }
    }

    /// Removes positions that no triangle uses. Several primitives may share one list of positions, and each
    /// may use only a part of the list.
    fn compact(self) -> Self {
        let mut is_used = vec![false; self.positions.len()];
        self.triangles.as_flattened().iter().for_each(|corner| is_used[*corner as usize] = true);
        if is_used.iter().all(|is_used| *is_used) {
            return self;
        }
        let mut next = 0;
        let number = |is_used: &bool| {
            let number = next;
            next += u32::from(*is_used);
            number
        };
        let numbers: Vec<u32> = is_used.iter().map(number).collect();
        let triangles = self.triangles.iter().map(|corners| corners.map(|corner| numbers[corner as usize]));
        let sets = self.influences.into_iter().map(|Influences { joints, weights }| Influences {
            joints: only(joints, &is_used),
            weights: only(weights, &is_used),
        });
        Self {
            triangles: triangles.collect(),
            positions: only(self.positions, &is_used),
            normals: only(self.normals, &is_used),
            colours: only(self.colours, &is_used),
            coordinates: only(self.coordinates, &is_used),
            influences: sets.collect(),
            ..self
        }
    }

    /// Moves the part to the scene's coordinates. A part without joints is not moved.
    fn placed_by(mut self, skin: &Skin) -> Self {
        let sets = std::mem::take(&mut self.influences);
        self.is_placed = !sets.is_empty();
        if self.is_placed {
            let Self { positions, normals, triangles, .. } = &mut self;
            self.odd_vertices = skin.place(&sets, positions, normals, triangles);
        }
        self
    }

    /// Gives every triangle its own corners and the normal of its plane, since a mesh without normals has
    /// flat faces (glTF 2.0, 3.7.2.1). The normal of a triangle without area is the z axis, since zero normals count as
    /// mistakes of the file.
    fn flat(self) -> Self {
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        let (mut colours, mut coordinates) = (Vec::new(), Vec::new());
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|corner| self.positions[corner as usize]);
            positions.extend([a, b, c]);
            normals.extend([(b - a).cross(c - a).normalize_or(DVec3::Z); 3]);
            if !self.colours.is_empty() {
                colours.extend(corners.map(|corner| self.colours[corner as usize]));
            }
            if !self.coordinates.is_empty() {
                coordinates.extend(corners.map(|corner| self.coordinates[corner as usize]));
            }
        }
        let triangles = (0..positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        Self { positions, normals, colours, coordinates, triangles, ..self }
    }
}

/// Returns true if a primitive has sets of colours besides `COLOR_0`.
pub(super) fn has_other_colours(primitive: &Primitive) -> bool {
    let is_other = |semantic: &Checked<Semantic>| matches!(semantic, Checked::Valid(Semantic::Colors(1..)));
    primitive.attributes.keys().any(is_other)
}

/// Returns the mode of a primitive of triangles; `None` for any other primitive, such as lines.
pub(super) fn mode_of(primitive: &Primitive) -> Option<Mode> {
    match primitive.mode {
        Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => Some(mode),
        _ => None,
    }
}

/// Returns the index of a primitive's material in `Materials::list` (see [`Part::material`]).
fn material(root: &Root, primitive: &Primitive, has_colours: bool) -> Parsed<u32> {
    let Some(index) = primitive.material else { return Ok(if has_colours { white(root) } else { 0 }) };
    match root.get(index) {
        Some(_) => Ok(index.value() as u32 + 1),
        None => Err(format!("material {} does not exist", index.value())),
    }
}

/// Returns those elements of `list` for which `is_used` is true.
fn only<T>(list: Vec<T>, is_used: &[bool]) -> Vec<T> {
    list.into_iter().zip(is_used).filter(|(_, is_used)| **is_used).map(|(element, _)| element).collect()
}

/// Reads texture coordinates, which are measured from the texture's upper left corner.
fn coordinates(numbers: &Numbers<'_>, index: Index<Accessor>) -> Parsed<Vec<[f32; 2]>> {
    Ok(numbers.attribute::<2>(index)?.into_iter().map(|pair| pair.map(|value| value as f32)).collect())
}

/// Returns linear colours without their alpha, and true if at least one alpha is below 1.
fn colours(numbers: &Numbers<'_>, index: Index<Accessor>) -> Parsed<(Vec<Vec3>, bool)> {
    let colour = |red: f64, green: f64, blue: f64| DVec3::new(red, green, blue).as_vec3();
    Ok(match numbers.components(index) {
        4 => {
            let colours = numbers.colours::<4>(index)?;
            let is_clear = colours.iter().any(|[.., alpha]| *alpha < 1.0);
            (colours.into_iter().map(|[r, g, b, _]| colour(r, g, b)).collect(), is_clear)
        }
        _ => (numbers.colours::<3>(index)?.into_iter().map(|[r, g, b]| colour(r, g, b)).collect(), false),
    })
}

/// Returns the indices of the corners' positions, in order: the values of `indices` or, without `indices`,
/// the numbers from 0 to `count` - 1.
fn corners(numbers: &Numbers<'_>, indices: Option<Index<Accessor>>, count: usize) -> Parsed<Vec<u32>> {
    let Some(index) = indices else { return Ok((0..count as u32).collect()) };
    Ok(numbers.indices(index)?.into_iter().map(|[index]| index as u32).collect())
}

/// Returns the triangles whose three positions exist, and the number of triangles that were left out. `count`
/// is the number of positions.
fn existing(all: Vec<[u32; 3]>, count: usize) -> (Vec<[u32; 3]>, usize) {
    let total = all.len();
    let exists = |corner: &u32| (*corner as usize) < count;
    let existing: Vec<_> = all.into_iter().filter(|corners| corners.iter().all(exists)).collect();
    let dangling = total - existing.len();
    (existing, dangling)
}

/// Returns the number of corners after the last whole triangle, for a primitive with `corners` corners.
fn spare(mode: Mode, corners: usize) -> usize {
    match mode {
        Mode::Triangles => corners % 3,
        _ if corners < 3 => corners,
        _ => 0,
    }
}

fn triangles(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    let strip = |(index, window): (usize, &[u32])| {
        let [a, b, c] = [window[0], window[1], window[2]];
        if index.is_multiple_of(2) { [a, b, c] } else { [b, a, c] }
    };
    match mode {
        Mode::TriangleStrip => corners.windows(3).enumerate().map(strip).collect(),
        Mode::TriangleFan => corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]]).collect(),
        _ => corners.chunks_exact(3).map(|corner| [corner[0], corner[1], corner[2]]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::buffers::Bytes;
    use super::*;

    #[test]
    fn strips_and_fans_keep_the_orientation_of_their_first_triangle() {
        let corners = [0, 1, 2, 3, 4];
        assert_eq!(triangles(Mode::TriangleStrip, &corners), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
        assert_eq!(triangles(Mode::TriangleFan, &corners), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        assert_eq!(
            triangles(Mode::Triangles, &corners),
            [[0, 1, 2]],
            "two corners are too few for another one"
        );
        let spare = |mode| [2, 3, 5].map(|corners| spare(mode, corners));
        assert_eq!([spare(Mode::Triangles), spare(Mode::TriangleFan)], [[2, 0, 2], [2, 0, 0]]);
    }

    #[test]
    fn a_colour_is_clear_if_its_alpha_is_below_one_by_any_amount() {
        let text = r#"{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 8}],
"bufferViews": [{"buffer": 0, "byteLength": 8}], "accessors": [
{"bufferView": 0, "componentType": 5121, "normalized": true, "count": 2, "type": "VEC4"}]}"#;
        let root: Root = serde_json::from_str(text).unwrap();
        for (alpha, expected) in [(255, false), (254, true), (128, true), (0, true)] {
            let bytes = [255, 0, 0, 255, 0, 255, 0, alpha];
            let buffers = [Bytes::new(bytes[..].into())];
            let numbers = Numbers::of_file(&root, &buffers);
            let (colours, is_clear) = colours(&numbers, Index::new(0)).unwrap();
            assert_eq!((&colours[..], is_clear), (&[Vec3::X, Vec3::Y][..], expected), "{alpha}");
        }
    }

    #[test]
    fn a_primitive_uses_no_more_positions_than_it_has_or_than_its_triangles_have_corners() {
        let text = r#"{"asset": {"version": "2.0"}, "accessors": [
{"componentType": 5126, "count": 100, "type": "VEC3"}, {"componentType": 5123, "count": 6, "type": "SCALAR"},
{"componentType": 5123, "count": 600, "type": "SCALAR"}]}"#;
        let root: Root = serde_json::from_str(text).unwrap();
        let numbers = Numbers::of_file(&root, &[]);
        let positions = |attributes: &str, indices: u32| {
            let text = format!(r#"{{"attributes": {{{attributes}}}, "indices": {indices}}}"#);
            Part::largest(&numbers, &serde_json::from_str(&text).unwrap()).positions
        };
        let smooth = r#""POSITION": 0, "NORMAL": 0"#;
        assert_eq!([positions(smooth, 1), positions(smooth, 2)], [6, 100]);
        // Without normals, each triangle has its own positions.
        let flat = r#""POSITION": 0"#;
        assert_eq!([positions(flat, 1), positions(flat, 2)], [6, 600]);
    }

    #[test]
    fn a_strip_has_almost_as_many_triangles_as_corners_and_a_list_a_third_of_them() {
        let text = r#"{"asset": {"version": "2.0"}, "accessors": [
{"componentType": 5126, "count": 100, "type": "VEC3"}, {"componentType": 5123, "count": 6, "type": "SCALAR"}]}"#;
        let root: Root = serde_json::from_str(text).unwrap();
        let numbers = Numbers::of_file(&root, &[]);
        let sizes = |mode: u32| {
            let text = format!(r#"{{"attributes": {{"POSITION": 0}}, "indices": 1, "mode": {mode}}}"#);
            let sizes = Part::largest(&numbers, &serde_json::from_str(&text).unwrap());
            (sizes.elements, sizes.triangles, sizes.positions)
        };
        // The modes are triangles, a strip and a fan. The number of elements is the sum over both accessors:
        // 100 positions and 6 indices.
        assert_eq!([4, 5, 6].map(sizes), [(106, 2, 6), (106, 6, 18), (106, 6, 18)]);
    }
}
