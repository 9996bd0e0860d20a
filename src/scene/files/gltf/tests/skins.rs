//! Tests of skinned meshes.

use super::*;
use glam::Mat4;
use std::fmt::Write as _;

/// A list in the buffer of a file: its bytes, and the keys of its accessor.
type List = (Vec<u8>, &'static str);

/// A bar along y, which is a single triangle. The first corner belongs to the lower joint, the third to the upper
/// joint, and the second to both. The upper joint is turned by 90 degrees about z, from y to -x.
struct Bar {
    nodes: String,
    skins: String,
    attributes: String,
    lists: Vec<List>,
}

fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

const UPPER: &str = r#""translation": [0, 1, 0], "rotation": [0, 0, 0.70710678, 0.70710678]"#;
const JOINTS: &str = r#""componentType": 5121, "count": 3, "type": "VEC4""#;
const VEC4: &str = r#""componentType": 5126, "count": 3, "type": "VEC4""#;
const VEC3: &str = r#""componentType": 5126, "count": 3, "type": "VEC3""#;
const MAT4: &str = r#""componentType": 5126, "count": 2, "type": "MAT4""#;
/// The indices of the lists in [`Bar::lists`].
const JOINT: usize = 1;
const WEIGHT: usize = 2;
const INVERSE: usize = 3;
/// The corners of the bar before joints move them.
const STORED: [Vec3; 3] = [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.0, 2.0, 0.0)];
/// The corners of the bar where its joints place them.
const PLACED: [Vec3; 3] = [Vec3::ZERO, Vec3::new(0.5, 1.5, 0.0), Vec3::new(-1.0, 1.0, 0.0)];

impl Bar {
    fn new() -> Self {
        let inverses = [Mat4::IDENTITY, Mat4::from_translation(Vec3::NEG_Y)];
        let inverses = inverses.map(|matrix| matrix.to_cols_array());
        Self {
            nodes: format!(r#"{{"mesh": 0, "skin": 0}}, {{"children": [2]}}, {{{UPPER}}}"#),
            skins: r#"{"joints": [1, 2], "inverseBindMatrices": 3}"#.to_owned(),
            attributes: r#""POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2"#.to_owned(),
            lists: vec![
                (floats(STORED.map(|corner| corner.to_array()).as_flattened()), VEC3),
                (vec![0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0], JOINTS),
                (floats(&[1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), VEC4),
                (floats(inverses.as_flattened()), MAT4),
            ],
        }
    }

    fn with(mut self, list: usize, bytes: Vec<u8>, keys: &'static str) -> Self {
        self.lists[list] = (bytes, keys);
        self
    }

    /// Adds a list of the attribute `name`.
    fn and(mut self, name: &str, bytes: Vec<u8>, keys: &'static str) -> Self {
        write!(self.attributes, r#", "{name}": {}"#, self.lists.len()).unwrap();
        self.lists.push((bytes, keys));
        self
    }

    fn replace(mut self, from: &str, to: &str) -> Self {
        for text in [&mut self.nodes, &mut self.skins, &mut self.attributes] {
            *text = text.replace(from, to);
        }
        self
    }

    fn read(&self) -> Result<MeshFile> {
        let Self { nodes, skins, attributes, lists } = self;
        let (mut data, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
        for (number, (bytes, keys)) in lists.iter().enumerate() {
            let (start, length) = (data.len(), bytes.len());
            views.push(format!(r#"{{"buffer": 0, "byteOffset": {start}, "byteLength": {length}}}"#));
            // A list without bytes becomes an accessor without data.
            let view = if bytes.is_empty() { String::new() } else { format!(r#""bufferView": {number}, "#) };
            accessors.push(format!("{{{view}{keys}}}"));
            data.extend_from_slice(bytes);
        }
        let (length, data) = (data.len(), STANDARD.encode(data));
        read(&format!(
            r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{nodes}], "skins": [{skins}],
"meshes": [{{"primitives": [{{"attributes": {{{attributes}}}}}]}}],
"buffers": [{{"byteLength": {length}, "uri": "data:application/octet-stream;base64,{data}"}}],
"bufferViews": [{}], "accessors": [{}]}}"#,
            views.join(","),
            accessors.join(",")
        ))
    }

    /// Returns the corners in the file's coordinates, and the notes.
    fn shown(&self) -> ([Vec3; 3], Vec<String>) {
        let file = self.read().unwrap();
        let origin = file.placement.origin.as_vec3();
        (corners(&file.mesh).map(|corner| corner + origin), file.notes)
    }

    #[track_caller]
    fn assert_shown(&self, expected: [Vec3; 3], notes: &[&str]) {
        let (corners, noted) = self.shown();
        let is_near = corners.iter().zip(expected).all(|(corner, expected)| corner.distance(expected) < 1e-6);
        assert!(is_near, "{corners:?}, expected {expected:?}");
        assert_eq!(noted, notes);
    }

    fn normals(&self) -> [Vec3; 3] {
        let mesh = self.read().unwrap().mesh;
        mesh.corner_normals(&mesh.triangles[0])
    }
}

#[test]
fn joints_place_a_skinned_mesh_and_the_transform_of_its_own_node_has_no_effect() {
    Bar::new().assert_shown(PLACED, &[]);
    let turned =
        r#""skin": 0, "translation": [0, 0, 5], "rotation": [0.6, 0, 0, 0.8], "scale": [100, -100, 100]"#;
    Bar::new().replace(r#""skin": 0"#, turned).assert_shown(PLACED, &[]);
}

/// The shown scene has only node 0, the node of the mesh.
#[test]
fn joints_outside_the_shown_scene_have_the_transforms_of_all_their_ancestors() {
    let above = r#"{"children": [2]}, {"children": [3], "translation": [0, 0, 7]}"#;
    let bar = Bar::new().replace(r#"{"children": [2]}"#, above).replace("[1, 2]", "[2, 3]");
    bar.assert_shown(PLACED.map(|corner| corner + Vec3::Z * 7.0), &[]);
    // Here, the joints are the node of the mesh and its child, so they are in the shown scene.
    let below = r#"{"mesh": 0, "skin": 0, "children": [1], "translation": [0, 0, 7]}, "#;
    let bar = Bar::new()
        .replace("[1, 2]", "[0, 1]")
        .replace(r#"{"mesh": 0, "skin": 0}, {"children": [2]}, "#, below);
    bar.assert_shown(PLACED.map(|corner| corner + Vec3::Z * 7.0), &[]);
}

#[test]
fn without_inverse_bind_matrices_vertices_are_stored_in_the_coordinates_of_their_joints() {
    let expected = [Vec3::ZERO, Vec3::new(0.0, 1.5, 0.0), Vec3::new(-2.0, 1.0, 0.0)];
    Bar::new().replace(r#", "inverseBindMatrices": 3"#, "").assert_shown(expected, &[]);
}

#[test]
fn weights_of_any_type_count_in_proportion_to_their_sum() {
    let bytes = [255, 0, 0, 0, 127, 127, 0, 0, 255, 0, 0, 0];
    let u8s = r#""componentType": 5121, "normalized": true, "count": 3, "type": "VEC4""#;
    Bar::new().with(WEIGHT, bytes.into(), u8s).assert_shown(PLACED, &[]);
    let note =
        "3 vertices with weights whose sum is not 1 are placed with these weights divided by their sum";
    Bar::new().with(WEIGHT, bytes.into(), JOINTS).assert_shown(PLACED, &[note]);
    let u16s = r#""componentType": 5123, "normalized": true, "count": 3, "type": "VEC4""#;
    let weights = [65_535_u16, 0, 0, 0, 32_767, 32_767, 0, 0, 65_535, 0, 0, 0];
    let words = |numbers: [u16; 12]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    Bar::new().with(WEIGHT, words(weights), u16s).assert_shown(PLACED, &[]);
    let weights = floats(&[9.0, 0.0, 0.0, 0.0, 3.0, 3.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0]);
    Bar::new().with(WEIGHT, weights, VEC4).assert_shown(PLACED, &[note]);
    let joints = r#""componentType": 5123, "count": 3, "type": "VEC4""#;
    Bar::new().with(JOINT, words([0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0]), joints).assert_shown(PLACED, &[]);
}

#[test]
fn all_sets_of_joints_count() {
    let first = floats(&[1.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let second = floats(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0]);
    let bar = Bar::new().with(WEIGHT, first, VEC4).and("JOINTS_1", vec![1; 12], JOINTS);
    bar.and("WEIGHTS_1", second, VEC4).assert_shown(PLACED, &[]);
}

#[test]
fn a_set_of_joints_or_weights_without_the_other_is_ignored_with_a_note() {
    let note = |sets| format!("{sets} of joints (JOINTS_n) or of weights (WEIGHTS_n) without the other");
    let joints = || Bar::new().and("JOINTS_1", vec![1; 12], JOINTS);
    joints().assert_shown(PLACED, &[&format!("{} is ignored", note("1 set"))]);
    let weights = floats(&[1.0; 12]);
    let both = joints().and("WEIGHTS_2", weights.clone(), VEC4);
    both.assert_shown(PLACED, &[&format!("{} are ignored", note("2 sets"))]);
    // Joints of a mesh without a skin place nothing.
    Bar::new().and("WEIGHTS_1", weights, VEC4).replace(r#", "skin": 0"#, "").assert_shown(STORED, &[]);
}

#[test]
fn inverse_bind_matrices_without_data_are_zeros_and_noted() {
    let bar = Bar::new().with(INVERSE, Vec::new(), MAT4);
    let bar = bar.and("NORMAL", floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]), VEC3);
    let (_, notes) = bar.shown();
    assert_eq!(notes, ["1 accessor without data is read as zeros"]);
}

#[test]
fn the_last_row_of_an_inverse_bind_matrix_is_not_used() {
    let mut inverses = [Mat4::IDENTITY, Mat4::from_translation(Vec3::NEG_Y)];
    inverses[1].x_axis.w = 3.0;
    inverses[1].w_axis.w = 0.5;
    let inverses = floats(inverses.map(|matrix| matrix.to_cols_array()).as_flattened());
    let note = "1 joint with an inverse bind matrix whose last row is not 0 0 0 1 is used as if this row were \
                0 0 0 1; the file must store the matrix column by column";
    Bar::new().with(INVERSE, inverses, MAT4).assert_shown(PLACED, &[note]);
}

/// Another node places the same mesh with the same skin.
#[test]
fn a_skinned_mesh_that_two_nodes_place_is_noted_once() {
    let weights = floats(&[9.0, 0.0, 0.0, 0.0, 3.0, 3.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0]);
    let twice = r#"{"mesh": 0, "skin": 0, "children": [3]}"#;
    let mut bar = Bar::new().with(WEIGHT, weights, VEC4).replace(r#"{"mesh": 0, "skin": 0}"#, twice);
    bar.nodes.push_str(r#", {"mesh": 0, "skin": 0}"#);
    let note =
        "3 vertices with weights whose sum is not 1 are placed with these weights divided by their sum";
    bar.assert_shown(PLACED, &[note]);
}

#[test]
fn normals_stay_perpendicular_to_the_surface() {
    let with = |normal: [f32; 3]| Bar::new().and("NORMAL", floats([normal; 3].as_flattened()), VEC3);
    let is_near = |normals: [Vec3; 3], expected: [Vec3; 3]| {
        normals.iter().zip(expected).all(|(normal, expected)| normal.distance(expected.normalize()) < 1e-6)
    };
    let normals = with([1.0, 0.0, 0.0]).normals();
    assert!(is_near(normals, [Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]), "{normals:?}");
    let wide = with([1.0, 1.0, 0.0]).replace(r#"{"children": [2]}"#, r#"{"scale": [2, 1, 1]}"#);
    let normal = wide.normals()[0];
    assert!(normal.distance(Vec3::new(1.0, 2.0, 0.0).normalize()) < 1e-6, "{normal}");
    // Without normals, the triangle has the normal of its plane after the joints have moved its corners.
    let bent = Bar::new().replace("[0, 0, 0.70710678, 0.70710678]", "[0.70710678, 0, 0, 0.70710678]");
    bent.assert_shown([Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.0, 1.0, 1.0)], &[]);
    let normals = bent.normals();
    assert!(is_near(normals, [Vec3::new(1.0, -1.0, 1.0); 3]), "{normals:?}");
}

#[test]
fn joints_that_mirror_a_triangle_change_the_order_of_its_corners() {
    let mirror = |bar: Bar| bar.replace(r#"{"children": [2]}"#, r#"{"children": [2], "scale": [-1, 1, 1]}"#);
    let expected = [PLACED[0], PLACED[2], PLACED[1]].map(|corner| corner * Vec3::new(-1.0, 1.0, 1.0));
    let normals = floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    for bar in [Bar::new(), Bar::new().and("NORMAL", normals, VEC3)] {
        let bar = mirror(bar);
        bar.assert_shown(expected, &[]);
        let normals = bar.normals();
        assert!(normals.iter().all(|normal| normal.distance(Vec3::Z) < 1e-6), "{normals:?}");
    }
}

#[test]
fn joints_and_weights_that_are_not_valid_are_left_out_and_their_vertices_counted() {
    let note = |vertices: &str| {
        format!(
            "{vertices} with joints or weights that are not valid {} placed by the valid joints or, if no joint \
             of a vertex is valid, by the skin's first valid joint",
            if vertices.starts_with("1 ") { "is" } else { "are" }
        )
    };
    // The second corner's upper joint does not exist, so only the lower joint places this corner.
    let bar = Bar::new().with(JOINT, vec![0, 0, 0, 0, 0, 7, 0, 0, 1, 0, 0, 0], JOINTS);
    bar.assert_shown([PLACED[0], STORED[1], PLACED[2]], &[&note("1 vertex")]);
    // A joint with a weight of 0 need not exist.
    Bar::new().with(JOINT, vec![0, 7, 7, 7, 0, 1, 7, 7, 1, 7, 7, 7], JOINTS).assert_shown(PLACED, &[]);
    for weight in [f32::NAN, f32::INFINITY, -0.5] {
        let weights = floats(&[0.0, 0.0, 0.0, 0.0, 0.5, weight, 0.0, 0.0, weight, 0.0, 0.0, 0.0]);
        Bar::new().with(WEIGHT, weights, VEC4).assert_shown(STORED, &[&note("3 vertices")]);
    }
    let joints = floats(&[-1.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, f32::NAN, 0.0, 0.0, 0.0]);
    Bar::new().with(JOINT, joints, VEC4).assert_shown(STORED, &[&note("3 vertices")]);
    // The upper joint has no inverse bind matrix, or one that is not finite.
    let one = floats(Mat4::IDENTITY.to_cols_array().as_slice());
    let short = Bar::new().with(INVERSE, one.clone(), r#""componentType": 5126, "count": 1, "type": "MAT4""#);
    let infinite = Bar::new().with(INVERSE, [one, floats(&[f32::INFINITY; 16])].concat(), MAT4);
    for bar in [short, infinite] {
        bar.assert_shown(STORED, &[&note("2 vertices")]);
        // No vertex uses the upper joint.
        bar.with(JOINT, vec![0; 12], JOINTS).assert_shown(STORED, &[]);
    }
}

#[test]
fn a_skinned_position_that_is_not_finite_is_reported_as_the_file_has_it() {
    let positions = floats(&[f32::NAN, -0.5, 0.25, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0]);
    let error = Bar::new().with(0, positions, VEC3).read().err().map(|error| error.to_string());
    let error = error.unwrap_or_default();
    assert!(error.contains("a vertex of mesh 0 is at [NaN, -0.5, 0.25]"), "{error}");
}

#[test]
fn a_skinned_mesh_without_joints_has_the_transform_of_its_node() {
    let moved = || Bar::new().replace(r#""skin": 0"#, r#""skin": 0, "translation": [0, 0, 5]"#);
    let note = "1 primitive that its skin does not place is shown with the transform of the mesh's node";
    let invalid = moved().with(INVERSE, floats(&[f32::NAN; 32]), MAT4);
    for bar in [moved().replace("[1, 2]", "[]"), invalid] {
        bar.assert_shown(STORED.map(|corner| corner + Vec3::Z * 5.0), &[note]);
    }
    let unpaired = "1 set of joints (JOINTS_n) or of weights (WEIGHTS_n) without the other is ignored";
    let bar = moved().replace(r#", "WEIGHTS_0": 2"#, "");
    bar.assert_shown(STORED.map(|corner| corner + Vec3::Z * 5.0), &[note, unpaired]);
    let unskinned = moved().replace(r#""skin": 0, "#, "");
    unskinned.assert_shown(STORED.map(|corner| corner + Vec3::Z * 5.0), &[]);
}

#[test]
fn damaged_skins_are_refused_with_what_is_wrong() {
    let two = r#""componentType": 5121, "count": 2, "type": "VEC4""#;
    for (bar, message) in [
        (Bar::new().replace(r#""skin": 0"#, r#""skin": 3"#), "skin 3 does not exist"),
        (Bar::new().replace("[1, 2]", "[1, 9]"), "skin 0: node 9 does not exist"),
        (Bar::new().replace(UPPER, r#""children": [1]"#), "skin 0: node 1 descends from itself"),
        (
            Bar::new().with(INVERSE, vec![0; 128], r#""componentType": 5125, "count": 2, "type": "MAT4""#),
            "skin 0: accessor 3: its componentType is 5125",
        ),
        (Bar::new().with(JOINT, vec![0; 8], two), "node 0: 2 joints for 3 positions"),
        (Bar::new().with(WEIGHT, vec![1; 8], two), "node 0: 2 weights for 3 positions"),
    ] {
        let error = bar.read().err().map(|error| error.to_string()).unwrap_or_default();
        assert!(error.contains(message), "{error}, expected {message}");
    }
}
