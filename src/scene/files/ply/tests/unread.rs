//! Tests of notes and errors on parts of a PLY file that raycl does not read.

use super::*;

/// Returns an ASCII file of one triangle. `vertex` and `face` are further properties of vertices and faces, one per
/// line, each with the value 0.
fn triangle_with(vertex: &str, face: &str) -> String {
    let zeros = |lines: &str| " 0".repeat(lines.lines().count());
    let (of_vertex, of_face) = (zeros(vertex), zeros(face));
    let corners: String = ["0 0 0", "1 0 0", "0 1 0"].map(|corner| format!("{corner}{of_vertex}\n")).concat();
    format!(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n{vertex}\
         element face 1\nproperty list uchar int vertex_indices\n{face}end_header\n{corners}3 0 1 2{of_face}\n"
    )
}

fn properties(names: &[&str]) -> String {
    names.iter().map(|name| format!("property float {name}\n")).collect()
}

fn notes(text: &str) -> Vec<String> {
    parse("a.ply", text.as_bytes()).unwrap().notes
}

#[test]
fn properties_that_are_not_read_are_named_and_counted() {
    for (vertex, face, expected) in [
        (&[][..], &[][..], &[][..]),
        (&["quality"], &[], &["1 property of 3 vertices is not read (`quality`)"]),
        (
            &["s", "t", "texture(u)"],
            &[],
            &["3 properties of 3 vertices are not read (`s`, `t`, `texture(u)`)"],
        ),
        (&[], &["nx", "ny", "nz"], &["3 properties of 1 face are not read (`nx`, `ny`, `nz`)"]),
        (&[], &["alpha"], &["1 property of 1 face is not read (`alpha`)"]),
        (
            &["s"],
            &["texnumber"],
            &["1 property of 3 vertices is not read (`s`)", "1 property of 1 face is not read (`texnumber`)"],
        ),
        (
            &["red", "green", "blue", "r", "g", "b"],
            &[],
            &["3 properties of 3 vertices are not read (`r`, `g`, `b`)"],
        ),
        (
            &["a1", "a2", "a3", "a4", "a5", "a6", "a7", "a8", "a9", "a10"],
            &[],
            &[
                "10 properties of 3 vertices are not read (`a1`, `a2`, `a3`, `a4`, `a5`, `a6`, `a7`, `a8` and 2 more)",
            ],
        ),
    ] {
        let text = triangle_with(&properties(vertex), &properties(face));
        assert_eq!(notes(&text), expected);
    }
    let text = triangle_with(&properties(&["secret"]), "");
    let withheld =
        super::super::parse(Named { name: "a.ply", quotes: false }, text.as_bytes(), Limit::Usual).unwrap();
    assert_eq!(withheld.notes, ["1 property of 3 vertices is not read"]);
}

/// raycl reads a normal's coordinates only from numbers, so a list with the name `nx` is not read.
#[test]
fn a_list_is_no_number() {
    let text = triangle_with("property list uchar float nx\nproperty float ny\nproperty float nz\n", "");
    let incomplete =
        "vertices have only 2 of the properties nx, ny, nz, so raycl reads none of these properties";
    assert_eq!(notes(&text), [incomplete, "1 property of 3 vertices is not read (`nx`)"]);
}

#[test]
fn colours_of_strips_are_named() {
    let colours = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let text = PAINTED.replace("indices\nend_header", &format!("indices\n{colours}end_header"));
    let text = text.replace("3 0 2 4\n", "3 0 2 4 255 0 0\n");
    assert_eq!(notes(&text), ["3 properties of 1 strip are not read (`red`, `green`, `blue`)"]);
}

#[test]
fn normals_may_have_other_names() {
    let read = |names: &[&str]| {
        parse("a.ply", triangle_with(&properties(names), "").replace("0 0 0\n", "0 0 1\n").as_bytes())
    };
    let usual = read(&["nx", "ny", "nz"]).unwrap();
    assert_eq!(usual.mesh.normals.len(), 3);
    for names in [["NX", "NY", "NZ"], ["normal_x", "normal_y", "normal_z"], ["Normal_X", "ny", "Nz"]] {
        let file = read(&names).unwrap();
        assert_eq!((file.mesh, file.notes), (usual.mesh.clone(), usual.notes.clone()), "{names:?}");
    }
    let both = notes(&triangle_with(&properties(&["nx", "ny", "nz", "normal_x"]), ""));
    assert_eq!(both, ["1 property of 3 vertices is not read (`normal_x`)"]);
}

#[test]
fn two_properties_for_the_same_value_are_refused() {
    let list = |name: &str| format!("property list uchar int {name}\n");
    for (vertex, face, expected) in [
        (
            "",
            &*list("vertex_index"),
            "`face` has two lists of corners, `vertex_indices` and `vertex_index`; expected one",
        ),
        (
            "",
            &*list("vertex_indices"),
            "`face` has two lists of corners, `vertex_indices` and `vertex_indices`;",
        ),
        ("property float x\n", "", "`vertex` has two properties `x`; expected one of them"),
    ] {
        let error = parse("a.ply", triangle_with(vertex, face).as_bytes()).err().unwrap();
        assert!(error.to_string().starts_with(&format!("a.ply: {expected}")), "{error}");
    }
    // A number with the name `vertex_index` is not a second list of corners, so it causes no error.
    let number = notes(&triangle_with("", "property int vertex_index\n"));
    assert_eq!(number, ["1 property of 1 face is not read (`vertex_index`)"]);
    // Two properties with the same name cause no error if raycl reads neither of them.
    let twice = notes(&triangle_with(&properties(&["s", "s"]), ""));
    assert_eq!(twice, ["2 properties of 3 vertices are not read (`s`, `s`)"]);
}

#[test]
fn text_after_the_last_property_of_a_line_is_noted() {
    let plain = triangle_with("", "");
    for (from, to, expected) in [
        ("0 1 0\n", "0 1 0 255\n", "text after the last property is ignored in 1 line"),
        ("3 0 1 2\n", "3 0 1 2 3 1 3 2\n", "text after the last property is ignored in 1 line"),
        (" 0\n", " 0 7 7\n", "text after the last property is ignored in 3 lines"),
    ] {
        assert_eq!(notes(&plain.replace(from, to)), [expected], "{to}");
    }
    assert_eq!(notes(&plain.replace(" 0\n", " 0 \n")), [""; 0]);
}

#[test]
fn a_version_that_raycl_does_not_know_is_noted() {
    let text = triangle_with("", "").replace("ascii 1.0", "ascii 2.0");
    assert_eq!(notes(&text), ["the header states version 2.0 of PLY; the file is read as version 1.0"]);
}
