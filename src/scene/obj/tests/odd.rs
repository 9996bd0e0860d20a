//! Tests of unusual vertices and normals: vertices and normals that are not valid, very large coordinates, and
//! vertices that no face uses.

use super::*;

const BAD: [(&str, &str); 7] = [
    ("v nan nan nan 9 9 255", "`nan` in a vertex; expected a finite decimal number"),
    ("v inf -inf inf", "`inf` in a vertex; expected a finite decimal number"),
    ("v 0 0 -1.#IND", "`-1.#IND` in a vertex; expected a finite decimal number"),
    ("v 1e30 1e30 1e30", "vertex (1e30, 1e30, 1e30) is out of range; expected coordinates within +-1e12, "),
    ("v 1e300 0 0", "`1e300` in a vertex; expected a number within +-1e12"),
    ("v 0 0", "a vertex with 2 numbers; expected three: x y z"),
    ("v", "a vertex with 0 numbers; expected three: x y z"),
];

#[test]
fn a_vertex_that_is_not_valid_is_ignored_unless_a_face_uses_the_vertex() {
    for (line, found) in BAD {
        for (text, corners) in [
            (format!("{CORNERS}{line}\nf 1 2 3\n"), [0, 1, 2]),
            (format!("#\n#\n#\n{line}\n{CORNERS}f 2 3 4\nf 1 2\n"), [1, 2, 3]),
        ] {
            let file = read(&text).unwrap();
            assert!(file.notes[0].starts_with(&format!("line 4: {found}")), "{line}: {:?}", file.notes);
            assert!(file.notes[0].ends_with(": 1 such vertex that no face uses is ignored"), "{line}");
            assert_eq!(file.mesh.triangles[0].positions, corners, "{line}");
            assert_eq!(file.mesh.material(&file.mesh.triangles[0]).lambertian, Vec3::splat(0.8), "{line}");
            let inside = |p: &Vec3| p.min_element() >= 0.0 && p.max_element() <= 1.0;
            assert!(file.mesh.positions.iter().all(inside), "{line}: {:?}", file.mesh.positions);
        }
        let used = message(&format!("{CORNERS}v nan\n{line}\nf 1 2 3\nf 1 2 5\n"));
        assert!(used.contains(&format!("test.obj:5: {found}")), "{line}: {used}");
    }
}

#[test]
fn vertices_that_no_face_uses_are_counted_and_quoted_only_where_that_is_permitted() {
    let text = format!("{CORNERS}v nan 0 0\nv 0 0\nf 1 2 3\nvn 0 1\nvn x\n");
    let notes = |quotes| {
        let reach = Reach {
            folder: Path::new("/nowhere"),
            permitted: Permitted { beyond: false, quotes, scaled: false },
        };
        parse("test.obj", reach, text.as_bytes()).unwrap().notes
    };
    let vertices = ": 2 such vertices that no face uses are ignored";
    let normals = ": 2 such normals are ignored; normals of faces that name such a normal are computed from the \
                   faces' shape";
    let found = [
        "line 4: `nan` in a vertex; expected a finite decimal number",
        "line 7: a normal with 2 numbers; expected three: x y z",
    ];
    assert_eq!(notes(true), [format!("{}{vertices}", found[0]), format!("{}{normals}", found[1])]);
    let found = [
        "line 4: the line is not valid; expected `v x y z`: three finite numbers within +-1e12",
        "line 7: the line is not valid; expected `vn x y z`: three finite numbers",
    ];
    assert_eq!(notes(false), [format!("{}{vertices}", found[0]), format!("{}{normals}", found[1])]);
}

#[test]
fn a_mesh_far_from_its_origin_keeps_its_placement_beside_vertices_that_are_not_valid() {
    let corners = "v 500000.25 5400000 7\nv 500001.25 5400000 7\nv 500000.25 5400001 7\n";
    let plain = read(&format!("{corners}f 1 2 3\n")).unwrap();
    assert_ne!(plain.placement, Placement::IDENTITY);
    for (line, _) in BAD {
        let odd = read(&format!("{line}\n{corners}f 2 3 4\n")).unwrap();
        assert_eq!(odd.placement, plain.placement, "{line}");
        assert_eq!(odd.mesh.positions[1..], plain.mesh.positions, "{line}");
        assert_eq!(odd.mesh.positions[0], plain.mesh.positions[0], "{line}");
        let used = message(&format!("{line}\n{corners}f 1 2 3\n"));
        assert!(used.starts_with("test.obj:1: "), "{line}: {used}");
    }
}

/// One of the mesh's two faces has all its corners at one vertex. If this face counted, the mesh would not be moved,
/// and rounding would join the corners of the other face.
#[test]
fn a_mesh_far_from_its_origin_is_placed_without_faces_that_no_ray_hits() {
    let corners = "v 500000.25 5400000 7\nv 500000.26 5400000 7\nv 500000.25 5400000.01 7\n";
    let plain = read(&format!("{corners}f 1 2 3\n")).unwrap();
    for far in ["0 0 0", "1e11 0 0"] {
        let file = read(&format!("{corners}v {far}\nf 4 4 4\nf 1 2 3\n")).unwrap();
        assert_eq!(file.placement, plain.placement, "{far}");
        assert_eq!(file.mesh.positions[..3], plain.mesh.positions, "{far}");
        assert_eq!(file.notes, plain.notes, "{far}");
    }
}

#[test]
fn vertices_of_two_numbers_get_z_0_even_if_another_vertex_is_not_valid() {
    let file = read("v 0 0\nv 1 0\nv 0 1\nv nan 1\nv 1 2 x\nf 1 2 3\n").unwrap();
    assert_eq!(file.mesh.corners(&file.mesh.triangles[0]), [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(file.notes[0], "3 vertices with two numbers each: z is 0");
    assert!(file.notes[1].starts_with("line 4: `nan` in a vertex"), "{:?}", file.notes);
    assert!(file.notes[1].ends_with(": 2 such vertices that no face uses are ignored"), "{:?}", file.notes);
}

#[test]
fn a_normal_that_is_not_valid_counts_as_missing() {
    for (line, found) in [
        ("vn nan nan nan", "`nan` in a normal; expected a finite decimal number"),
        ("vn inf 0 0", "`inf` in a normal; expected a finite decimal number"),
        ("vn 1.#QNAN 0 0", "`1.#QNAN` in a normal; expected a finite decimal number"),
        ("vn 0 0 1e300", "`1e300` in a normal; expected a number within +-3.4028235e38"),
        ("vn 0 x 1", "`x` in a normal; expected a finite decimal number"),
        ("vn 0", "a normal with 1 number; expected three: x y z"),
        ("vn", "a normal with 0 numbers; expected three: x y z"),
    ] {
        let text =
            format!("{CORNERS}vn 1 0 0\n{line}\nf 1//1 2//1 3//1\nf 1//1 2//1 3//2\nf 1//2 2//2 3//-1\n");
        let file = read(&text).unwrap();
        let normals = |triangle: usize| file.mesh.corner_normals(&file.mesh.triangles[triangle]);
        assert_eq!(
            [normals(0), normals(1), normals(2)],
            [[Vec3::X; 3], [Vec3::Z; 3], [Vec3::Z; 3]],
            "{line}"
        );
        let [note] = &file.notes[..] else { panic!("{line}: {:?}", file.notes) };
        assert!(note.starts_with(&format!("line 5: {found}: 1 such normal is ignored; ")), "{note}");
        let file = parse("test.obj", nowhere(), text.as_bytes()).unwrap();
        assert_eq!(file.mesh.triangles[1].normals, [normals::MISSING; 3]);
    }
}

#[test]
fn vertices_and_normals_of_later_pieces_have_their_own_numbers() {
    let mut text = String::new();
    for i in 0..40_000 {
        text.push_str(&format!("v {i} 0 0\nv {i} 1 0\nv {i} 0 1\nvn 1 0 0\nf -3//-1 -2//-1 -1//-1\n"));
    }
    text.push_str("v 0 0 nan\nvn 0 nan 0\nf 1//-1 2//-1 3//-1\n");
    let file = parse("test.obj", nowhere(), text.as_bytes()).unwrap();
    assert!(file.notes[0].starts_with("line 200001: `nan` in a vertex"), "{:?}", file.notes);
    assert!(file.notes[1].starts_with("line 200002: `nan` in a normal"), "{:?}", file.notes);
    let (last, others) = file.mesh.triangles.split_last().unwrap();
    assert_eq!(last.normals, [normals::MISSING; 3]);
    assert!(others.iter().zip(0..).all(|(triangle, number)| triangle.normals == [number; 3]));
    text.push_str("f 1 2 120001\n");
    assert!(message(&text).contains("test.obj:200001: `nan`"));
}

#[test]
fn a_mesh_that_may_be_scaled_can_have_coordinates_of_any_size() {
    let parsed = |text: &str, scaled| {
        let permitted = Permitted { beyond: false, quotes: true, scaled };
        parse("m.obj", Reach { folder: Path::new("/nowhere"), permitted }, text.as_bytes())
    };
    for size in ["1e13", "3e38", "1e39", "1e300"] {
        let text = format!("v 0 0 0\nv {size} 0 0\nv 0 {size} 0\nf 1 2 3\n");
        let file = parsed(&text, true).unwrap();
        let side = file.mesh.positions[1].x - file.mesh.positions[0].x;
        assert!((1.4..3.0).contains(&side) && file.placement.scale < 1e-12, "{size}: {side}");
        let unscaled = parsed(&text, false).err().unwrap().to_string();
        assert!(unscaled.starts_with("m.obj:2: "), "{unscaled}");
    }
    let too_large = |scaled| parsed("v 0 0 0\nv 1e50 1e301 0\nv 0 1 0\nf 1 2 3\n", scaled).err().unwrap();
    for (scaled, number, limit) in [(true, "1e301", "1e300"), (false, "1e50", "1e12")] {
        let error = too_large(scaled);
        let message = format!("m.obj:2: `{number}` in a vertex; expected a number within +-{limit}");
        assert_eq!(error.to_string(), message);
        let form = format!("expected `v x y z`: three finite numbers within +-{limit}");
        assert_eq!(error.remedy(), form);
    }
    // A vertex far from the origin that no face uses does not cause the mesh to be scaled.
    let unused = parsed("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1e20 0 0\nf 1 2 3\n", true).unwrap();
    assert_eq!((unused.placement.scale, unused.mesh.positions[1]), (1.0, Vec3::X));
    assert!(unused.notes.iter().any(|note| note.contains("1 such vertex")), "{:?}", unused.notes);
}

#[test]
fn a_vertex_that_no_face_uses_does_not_decide_where_the_mesh_is_and_how_large() {
    let map = "v 500000 5400000 200\nv 500000.01 5400000 200\nv 500100 5400080 205\n";
    let (unit, tiny) = (CORNERS, "v 0 0 0\nv 2e-9 0 0\nv 0 2e-9 0\n");
    let wide = "v 0 0 0\nv 1e6 0 0\nv 0 1e6 0\n";
    let (near, far) = ("v 0 0 0\nv 1 0 0", "v 1e11 0 0");
    let moved = "v 990 0 0\nv 1010 0 0\nv 990 1 0\n";
    let cases =
        [(map, "v 0 0 0"), (moved, "v 1100 0 0"), (unit, far), (wide, far), (tiny, near), (tiny, far)];
    for (corners, unused) in cases {
        let plain = read(&format!("{corners}f 1 2 3\n")).unwrap();
        let beside = read(&format!("{corners}{unused}\nf 1 2 3\n")).unwrap();
        assert_eq!(beside.placement, plain.placement, "{corners}{unused}");
        assert_eq!(beside.mesh.positions[..3], plain.mesh.positions[..], "{corners}{unused}");
        assert_eq!(beside.notes, plain.notes, "{corners}{unused}");
        crate::scene::validate::check_positions(&beside.mesh).unwrap();
    }
    // This file is so large that it is read in several pieces. The index of its unused vertex counts the vertices of
    // all earlier pieces, too.
    let mut text = String::new();
    for i in 0..40_000 {
        text.push_str(&format!("v {i} 5400000 0\nv {i} 5400000.25 0\nv {i} 5400000 1\nf -3 -2 -1\n"));
    }
    let plain = read(&text).unwrap();
    assert_ne!(plain.placement, Placement::IDENTITY);
    let beside = read(&format!("{text}v 0 0 0\n")).unwrap();
    assert_eq!(beside.placement, plain.placement);
    assert_eq!(beside.mesh.positions[..120_000], plain.mesh.positions[..]);
}

#[test]
fn a_continuation_at_the_end_of_the_file_continues_nothing() {
    let reach = Reach {
        folder: Path::new("/nowhere"),
        permitted: Permitted { beyond: false, quotes: true, scaled: false },
    };
    for end in ["\\", "\\ ", "\\\t\n"] {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 {end}");
        let file = parse("m.obj", reach, text.as_bytes()).unwrap();
        assert_eq!(file.mesh.triangles.len(), 1, "{text:?}");
    }
}
