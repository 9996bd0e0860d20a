//! Tests with mesh files of several formats: damaged files cause no panic, normals are generated or changed, and
//! notes and errors quote nothing from files of others.

use super::*;
use glam::Vec3;
use std::path::PathBuf;

const PERMITTED: Permitted = Permitted { beyond: false, quotes: true, scaled: false };

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/meshes").join(name)
}

fn parse(format: MeshFormat, bytes: &[u8]) -> Result<MeshFile> {
    let reach = Reach { folder: Path::new("/nowhere"), permitted: PERMITTED };
    let named = Named { name: "a", quotes: true };
    match format {
        MeshFormat::Obj => obj::parse("a", reach, bytes),
        MeshFormat::Ply => ply::parse(named, bytes, Limit::Usual),
        MeshFormat::Stl => stl::parse(named, bytes, Limit::Usual),
        MeshFormat::Gltf | MeshFormat::Glb => gltf::parse("a", reach, bytes),
    }
}

#[test]
fn files_cut_off_anywhere_and_with_any_byte_changed_do_not_panic() {
    for name in ["cube.ply", "cube.stl", "two.gltf", "two.glb"] {
        let path = fixture(name);
        let opened = Opened::at(&path).unwrap();
        let format = format(&opened, &path).unwrap();
        let whole = opened.bytes(Kind::Mesh).unwrap();
        assert!(parse(format, &whole).is_ok(), "{name}");
        for offset in 0..whole.len() {
            let _ = parse(format, &whole[..offset]);
            for byte in [b'0', b'9', b'-', b' ', 0xff] {
                let mut changed = whole.clone();
                changed[offset] = byte;
                // If a changed file is read, every corner of its triangles must be a vertex that exists.
                if let Ok(file) = parse(format, &changed) {
                    let count = file.mesh.positions.len();
                    let corners = file.mesh.triangles.iter().flat_map(|triangle| triangle.positions);
                    assert!(corners.into_iter().all(|corner| (corner as usize) < count), "{name} {offset}");
                }
            }
        }
    }
}

/// The two triangles meet at 90 degrees.
#[test]
fn triangles_that_share_no_vertices_are_smooth_up_to_the_crease_and_keep_the_colours_of_their_corners() {
    let corners = ["0 0 0", "0 1 0", "-1 0 -1", "0 1 0", "0 0 0", "1 0 -1"];
    let colours = ["1 0 0", "0 1 0"].map(|colour| [colour; 3]);
    let coloured = corners.iter().zip(colours.as_flattened());
    let vertices: String = coloured.map(|(corner, colour)| format!("v {corner} {colour}\n")).collect();
    let obj = format!("{vertices}f 1 2 3\nf 4 5 6\n");
    let header = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 2\nproperty list uchar int vertex_indices\nend_header\n";
    let ply = format!("{header}{}\n3 0 1 2\n3 3 4 5\n", corners.join("\n"));
    let folder = tempfile::tempdir().unwrap();
    let mesh = |name: &str, text: &str, format, crease| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let mut mesh = super::read(&path, Opened::at(&path).unwrap(), format, PERMITTED).unwrap().mesh;
        crate::scene::normals::complete(&mut mesh, crease);
        mesh
    };
    for (name, text, format) in [("a.obj", &obj, MeshFormat::Obj), ("a.ply", &ply, MeshFormat::Ply)] {
        let smooth = mesh(name, text, format, None);
        let sharp = mesh(name, text, format, Some(40.0));
        assert_eq!(smooth.positions.len(), 4, "{name}");
        for triangle in [0, 1] {
            assert_eq!(smooth.corner_normals(&smooth.triangles[triangle])[..2], [Vec3::Z; 2], "{name}");
            assert_ne!(sharp.corner_normals(&sharp.triangles[triangle])[0], Vec3::Z, "{name}");
        }
    }
    let mesh = mesh("a.obj", &obj, MeshFormat::Obj, None);
    let colours = mesh.triangles.iter().map(|triangle| mesh.material(triangle).lambertian);
    assert_eq!(colours.collect::<Vec<_>>(), [Vec3::X, Vec3::Y]);
}

#[test]
fn a_mesh_of_which_nothing_can_be_seen_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let notes = |faces: &str| {
        std::fs::write(&path, format!("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\n{faces}")).unwrap();
        let file = super::read(&path, Opened::at(&path).unwrap(), MeshFormat::Obj, PERMITTED).unwrap();
        file.notes.into_iter().filter(|note| !note.contains("that no face uses")).collect::<Vec<_>>()
    };
    assert_eq!(
        notes("f 1 2 3\nf 1 1 2\n"),
        ["nothing is visible, since none of the mesh's 2 triangles has an area"]
    );
    assert_eq!(notes("f 1 2 3\nf 1 2 4\n"), Vec::<String>::new());
    // In both triangles, the angle at the first corner has the sine 1e-7. In the first triangle, the two
    // sides at the first corner are equally long. In the second triangle, the two sides at the first corner
    // are 1 and 10000 units long.
    for thin in ["v 0 0 0\nv 10000 0 0\nv 10000 0.001 0\n", "v 0 0 0\nv 1 0 0\nv 10000 0.001 0\n"] {
        let noted = notes(&format!("{thin}f 5 6 7\n"));
        assert_eq!(noted, ["nothing is visible, since the mesh's only triangle has no area"], "{thin}");
    }
    // No corner of this triangle is at the origin.
    let shifted = "v 1 1 0\nv 2 1 0\nv 4 1 0\n";
    assert_eq!(
        notes(&format!("{shifted}f 5 6 7\n")),
        ["nothing is visible, since the mesh's only triangle has no area"]
    );
}

/// Returns a GLB of two triangles that form a square, with these normals at its four corners.
fn square_with_normals(normals: [[f32; 3]; 4]) -> Vec<u8> {
    let json = br#"{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "mode": 5}]}],
"buffers": [{"byteLength": 96}], "bufferViews": [{"buffer": 0, "byteLength": 96}], "accessors": [
{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
{"bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 4, "type": "VEC3"}]}"#;
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let values = [positions, normals].into_iter().flatten().flatten();
    let data: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
    let length = |bytes: usize| (bytes as u32).to_le_bytes();
    let parts: [&[u8]; 8] = [
        b"glTF\x02\0\0\0",
        &length(28 + json.len() + data.len()),
        &length(json.len()),
        b"JSON",
        json,
        &length(data.len()),
        b"BIN\0",
        &data,
    ];
    parts.concat()
}

/// Returns a PLY or an OBJ of the same square.
fn text_with_normals(format: MeshFormat, normals: [[f32; 3]; 4]) -> String {
    let positions = ["0 0 0", "1 0 0", "0 1 0", "1 1 0"];
    let normals = normals.map(|[x, y, z]| format!("{x} {y} {z}"));
    if format == MeshFormat::Obj {
        let lines = positions.iter().zip(&normals).map(|(at, normal)| format!("v {at}\nvn {normal}\n"));
        return lines.chain(["f 1//1 2//2 3//3\nf 3//3 2//2 4//4\n".to_owned()]).collect();
    }
    let vertices = positions.iter().zip(&normals).map(|(at, normal)| format!("{at} {normal}\n"));
    let properties: String =
        ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property float {name}\n")).concat();
    format!(
        "ply\nformat ascii 1.0\nelement vertex 4\n{properties}element face 2\n\
         property list uchar int vertex_indices\nend_header\n{}3 0 1 2\n3 2 1 3\n",
        vertices.collect::<String>()
    )
}

#[test]
fn a_normal_without_direction_becomes_that_of_the_plane_at_its_corner_and_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let tilted = [0.6, 0.0, 0.8];
    let noted = |triangles: &str| {
        vec![format!("{triangles} changed: each such normal becomes the normal of its triangle's plane")]
    };
    let one = noted("1 triangle with a normal that is zero or not finite is");
    let two = noted("2 triangles with a normal that is zero or not finite are");
    for format in [MeshFormat::Obj, MeshFormat::Ply, MeshFormat::Glb] {
        for odd in [[0.0; 3], [f32::NAN; 3], [f32::INFINITY, 0.0, 0.0]] {
            // In an OBJ, numbers that are not finite have a note of their own.
            if format == MeshFormat::Obj && odd != [0.0; 3] {
                continue;
            }
            let all = [odd; 4];
            let [first, second, none] = [Some(0), Some(1), None].map(|changed| {
                let mut normals = [tilted; 4];
                changed.into_iter().for_each(|corner: usize| normals[corner] = odd);
                normals
            });
            for (normals, notes) in [(none, &vec![]), (first, &one), (second, &two), (all, &two)] {
                let path = folder.path().join("a");
                match format {
                    MeshFormat::Glb => std::fs::write(&path, square_with_normals(normals)).unwrap(),
                    _ => std::fs::write(&path, text_with_normals(format, normals)).unwrap(),
                }
                let mut file = super::read(&path, Opened::at(&path).unwrap(), format, PERMITTED).unwrap();
                assert_eq!(file.notes, *notes, "{format:?} {normals:?}");
                crate::scene::normals::complete(&mut file.mesh, None);
                let expected =
                    [0, 1, 2].map(
                        |corner: usize| {
                            if normals[corner] == tilted { Vec3::from_array(tilted) } else { Vec3::Z }
                        },
                    );
                let actual = file.mesh.corner_normals(&file.mesh.triangles[0]);
                assert!(
                    actual.iter().zip(expected).all(|(a, b)| a.distance(b) < 1e-6),
                    "{format:?} {actual:?}"
                );
            }
        }
    }
}

/// In the first file, the two triangles lie on each other, so their normals cancel each other.
#[test]
fn generated_normals_and_those_of_triangles_without_area_cause_no_note() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    for faces in ["f 1 2 3\nf 1 3 2\n", "vn 0 0 0\nf 1 2 3\nf 1//1 1//1 2//1\n"] {
        std::fs::write(&path, format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{faces}")).unwrap();
        let file = super::read(&path, Opened::at(&path).unwrap(), MeshFormat::Obj, PERMITTED).unwrap();
        assert_eq!(file.notes, Vec::<String>::new(), "{faces}");
    }
}

#[test]
fn a_file_of_others_is_read_and_nothing_of_its_text_is_quoted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.stl");
    std::fs::write(&path, "solid a\nfacet\nvertex secret 0 0\n").unwrap();
    let permitted = Permitted { quotes: false, ..PERMITTED };
    let opened = Opened::at(&path).unwrap();
    let error = super::read(&path, opened, MeshFormat::Stl, permitted).err().unwrap().to_string();
    let expected = "a.stl:3: not a number in a vertex; expected a finite decimal number";
    assert!(error.ends_with(expected) && !error.contains("secret"), "{error}");
}

#[test]
fn notes_that_quote_nothing_are_added_for_a_file_of_others() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        property uchar alpha\nelement face 1\nproperty list uchar int vertex_indices\nelement secret 1\n\
        property int secret\nend_header\n0 0 0 255\n1 0 0 255\n0 1 0 9\n3 0 1 2\n7\n";
    std::fs::write(&path, text).unwrap();
    let notes = |quotes| {
        let permitted = Permitted { quotes, ..PERMITTED };
        super::read(&path, Opened::at(&path).unwrap(), MeshFormat::Ply, permitted).unwrap().notes
    };
    let alpha = "alpha of 1 vertex is not used: every surface is opaque".to_owned();
    let others =
        "elements other than `vertex`, `face` and `tristrips`, and second definitions of these, are left out";
    assert_eq!(notes(true), [alpha.clone(), format!("{others} (`secret` 1)")]);
    assert_eq!(notes(false), [alpha, others.to_owned()]);
}

#[test]
fn a_scene_of_two_cubes_is_one_mesh_of_two_parts_in_both_forms() {
    let read = |name: &str| {
        let opened = Opened::at(&fixture(name)).unwrap();
        let format = format(&opened, Path::new(name)).unwrap();
        super::read(&fixture(name), opened, format, PERMITTED).unwrap()
    };
    let (text, binary) = (read("two.gltf"), read("two.glb"));
    assert_eq!(text.mesh, binary.mesh);
    assert_eq!((text.mesh.triangles.len(), text.more_starts, text.lights.len()), (24, vec![12], 1));
}

#[test]
fn the_ending_of_a_compressed_file_is_that_before_gz() {
    let note = |name: &str| unexpected_ending(Some(MeshFormat::Obj), Path::new(name));
    assert_eq!(["a.gz", "a.obj.gz"].map(note), [None, None]);
    let expected = "read as an OBJ mesh, because of its contents and despite its name";
    assert_eq!(note("a.stl.gz").as_deref(), Some(expected));
}

/// Returns the same triangles as an OBJ, as a PLY and as an STL.
fn in_three_formats(triangles: &[[&str; 3]]) -> [(MeshFormat, String); 3] {
    let corners = || triangles.as_flattened().iter();
    let (vertices, faces) = (3 * triangles.len(), triangles.len());
    let lines = |before: &str| corners().map(|corner| format!("{before}{corner}\n")).collect::<String>();
    let face = |first: usize| [first, first + 1, first + 2].map(|corner| corner.to_string()).join(" ");
    let lines_of_faces = |before: &str, first: usize| {
        (0..faces).map(|number| format!("{before} {}\n", face(3 * number + first))).collect::<String>()
    };
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    );
    let facet = |[a, b, c]: &[&str; 3]| {
        format!("facet\nouter loop\nvertex {a}\nvertex {b}\nvertex {c}\nendloop\nendfacet\n")
    };
    let facets: String = triangles.iter().map(facet).collect();
    [
        (MeshFormat::Obj, lines("v ") + &lines_of_faces("f", 1)),
        (MeshFormat::Ply, header + &lines("") + &lines_of_faces("3", 0)),
        (MeshFormat::Stl, format!("solid a\n{facets}endsolid a\n")),
    ]
}

/// The files have a triangle at the origin, and two others that are far away or near.
#[test]
fn triangles_that_single_precision_distorts_are_counted_in_every_format() {
    let notes = |side: &str, far: &str| {
        let far = |x: &str, y: &str| format!("{far}{x} {y} 0");
        let [a, b, c] = [far(".1", "0"), far(side, "0"), far(".1", "0.3")];
        let triangles = [["0 0 0", "1 0 0", "0 1 0"], [&a, &b, &c], [&a, &c, &b]];
        in_three_formats(&triangles).map(|(format, text)| parse(format, text.as_bytes()).unwrap().notes)
    };
    let note = "2 of 3 triangles are shown with inexact shapes: at their distance from the origin, they are too small for \
                single precision";
    assert_eq!(notes(".4", "5400000"), [[note]; 3]);
    // Single precision stores these corners exactly, or nearly so.
    assert_eq!(notes(".4", "54"), [[""; 0]; 3]);
    assert_eq!(notes("00.4", "5400000"), [[""; 0]; 3]);
    let whole = [["0 0 0", "1 0 0", "0 1 0"], ["8000000 0 0", "8000003 0 0", "8000000 3 0"]];
    for (format, text) in in_three_formats(&[whole[0], whole[1], whole[1]]) {
        assert_eq!(parse(format, text.as_bytes()).unwrap().notes, [""; 0]);
    }
}

#[test]
fn a_bare_mesh_of_every_format_may_lie_beyond_the_limit_of_coordinates() {
    let permitted = Permitted { scaled: true, ..PERMITTED };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh");
    let read = |format, text: &str, permitted| {
        std::fs::write(&path, text).unwrap();
        super::read(&path, Opened::at(&path).unwrap(), format, permitted)
    };
    let far = [["10000000000000 0 0", "10000000000001 0 0", "10000000000000 1 0"]];
    let near = |format, text: &str| {
        let file = read(format, text, permitted).unwrap();
        let [a, b, c] = file.mesh.corners(&file.mesh.triangles[0]);
        (file.placement.origin.x.floor(), b - a, c - a)
    };
    for (format, text) in in_three_formats(&far) {
        assert_eq!(near(format, &text), (1e13, Vec3::X, Vec3::Y), "{format:?}");
        let error = read(format, &text, PERMITTED).err().unwrap().to_string();
        assert!(error.contains("within +-1e12"), "{error}");
    }
}
