//! Tests with irregular and invalid OBJ files. Generated valid files are also read with the crate `tobj`, and both
//! results are compared.

mod materials;
mod odd;

use super::*;
use crate::filetype::Opened;
use crate::scene::{Material, files, normals};
use proptest::prelude::*;
use std::path::Path;

/// Reads a mesh. The notes on all parts of the file are shown.
fn parse(name: &str, reach: Reach<'_>, bytes: &[u8]) -> Result<MeshFile> {
    let mut file = super::parse(name, reach, bytes)?;
    file.keep_notes(|_| true);
    Ok(file)
}

fn read(text: &str) -> Result<MeshFile> {
    completed(text.as_bytes())
}

/// Parses a file and adds generated normals.
fn completed(bytes: &[u8]) -> Result<MeshFile> {
    let mut file = parse("test.obj", nowhere(), bytes)?;
    normals::complete(&mut file.mesh, None);
    Ok(file)
}

fn nowhere() -> Reach<'static> {
    Reach {
        folder: Path::new("/nowhere"),
        permitted: Permitted { beyond: false, quotes: true, scaled: false },
    }
}

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

fn message(text: &str) -> String {
    read(text).err().map(|error| error.to_string()).unwrap_or_default()
}

#[test]
fn mistakes_name_file_line_value_and_what_was_expected() {
    let cases = [
        (String::new(), "test.obj:1: no triangles"),
        (format!("{CORNERS}l 1 2 3\n"), "test.obj:5: no triangles; the file has 3 vertices"),
        ("v nan 0 0\nf 1 1 1\n".to_owned(), "test.obj:1: `nan` in a vertex; expected a finite"),
        ("\nv 0 1e400 0\nf 1 1 1\n".to_owned(), "test.obj:2: `1e400`"),
        ("v 0 0 0\nv 0 0\nf 1 1 2\n".to_owned(), "test.obj:2: a vertex with 2 numbers; expected three"),
        ("v 1\nf 1 1 1\n".to_owned(), "test.obj:1: a vertex with 1 number; expected three"),
        ("v 1e38 0 0\nf 1 1 1\n".to_owned(), "test.obj:1: vertex (1e38"),
        ("v nan 0 0\nv 0 0 0\n".to_owned(), "test.obj:3: no triangles; the file has 2 vertices"),
        (format!("{CORNERS}f 0 1 2\n"), "test.obj:4: vertex index `0`"),
        (
            format!("{CORNERS}f 1 2 4\n"),
            "test.obj:4: vertex index `4` in `4` does not exist; expected 1 to 3",
        ),
        (format!("{CORNERS}f -4 -2 -1\n"), "expected -3 to -1"),
        (format!("{CORNERS}f 1 2 99999999999999999999999\n"), "expected 1 to 3"),
        (format!("{CORNERS}f 1//x 2//0 3//0\n"), "`x` in `1//x` is not an index"),
        (format!("{CORNERS}f 1 2 \\"), "test.obj:4: no triangles; the file has 3 vertices"),
        (format!("{CORNERS}f 1 2\n"), "test.obj:5: no triangles; the file has 3 vertices"),
        (format!("{CORNERS}f 1 4\nf 1 2 3\n"), "test.obj:4: vertex index `4`"),
        (format!("{CORNERS}f 1 2 3.5\n"), "`3.5` in `3.5` is not an index"),
        (format!("{CORNERS}f / / /\n"), "is not an index"),
        (format!("{CORNERS}f 1/1/1/1 2 3\n"), "test.obj:4: `1/1/1/1` has too many slashes"),
        (format!("{CORNERS}f 1/x/1 2 3\n"), "test.obj:4: `x` in `1/x/1` is not an index; expected a whole"),
        (
            format!("f 1 2 9\n{CORNERS}"),
            "test.obj:1: vertex index `9` in `9` does not exist; expected 1 to 3",
        ),
        (
            format!("f -1 -2 -3\n{CORNERS}"),
            "test.obj:1: vertex index `-1` in `-1` does not exist; expected 1 to 3 (no vertex precedes this line, so a \
             negative index refers to none)",
        ),
        (
            format!("{CORNERS}f 1 2 -9\n"),
            "`-9` does not exist; expected -3 to -1 (before this line, the file has 3 vertices)",
        ),
        ("f 1 2 3\n".to_owned(), "vertex index `1` in `1` does not exist; the file has 0 vertices"),
        (
            format!("{CORNERS}fo 1 2 4\n"),
            "test.obj:4: vertex index `4` in `4` does not exist; expected 1 to 3",
        ),
        (format!("{CORNERS}foo 1 2 3\n"), "with at least three corners; unknown keywords: `foo`"),
        (
            "V 0 0 0\nV 1 0 0\nV 0 1 0\nF 1 2 3\n".to_owned(),
            "no triangles; the file has 0 vertices and no face (`f`) with at least three corners; unknown keywords: `F` 1, `V` 3; did \
             you mean `v`, `f`?",
        ),
        (format!("{CORNERS}F 1 2 3\n"), "unknown keywords: `F`; did you mean `f`?"),
    ];
    for (text, expected) in cases {
        assert!(message(&text).contains(expected), "{text:?}: {}", message(&text));
    }
}

#[test]
fn a_concave_face_of_too_many_corners_is_reported_with_its_own_remedy() {
    let count = MAX_CONCAVE_CORNERS + 2;
    // The corners lie alternately on a large circle and on a small circle.
    let vertex = |i: usize| {
        let (radius, angle) = ([1.0, 0.5][i % 2], std::f64::consts::TAU * i as f64 / count as f64);
        format!("v {} {} 0\n", radius * angle.cos(), radius * angle.sin())
    };
    let face: String = (1..=count).map(|number| format!(" {number}")).collect();
    let text = (0..count).map(vertex).collect::<String>() + "f" + &face + "\n";
    let error_of = |quotes| {
        let permitted = Permitted { beyond: false, quotes, scaled: false };
        parse("test.obj", Reach { permitted, ..nowhere() }, text.as_bytes()).err().unwrap()
    };
    let expected = "at most 32768 corners in a concave face: divide it into smaller faces";
    let start = format!("test.obj:{}: ", count + 1);
    let shown = error_of(true);
    assert_eq!(
        shown.to_string(),
        format!("{start}a concave face of {count} corners; expected at most 32768")
    );
    assert_eq!(shown.remedy(), format!("expected {expected}"));
    assert_eq!(error_of(false).to_string(), format!("{start}expected {expected}"));
}

#[test]
fn a_long_line_of_blanks_is_an_empty_file_that_is_named_once() {
    assert_eq!(message(&" ".repeat(1_000)), "test.obj:1: no triangles; the file is empty");
}

#[test]
fn odd_but_clear_files_are_read() {
    let same = [
        "\u{feff}v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n".as_bytes().to_vec(),
        b"v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r".to_vec(),
        b"# C:\\\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 \\\n2 \\\n3".to_vec(),
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 \\ \n2 \\\t \n 3".to_vec(),
        b"v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 \\ \r\n3\r\n".to_vec(),
        b"  v 0 0 0 # a\n\tv 1 0 0 1 0 0\nv 0 1 0\n f 1/ 2// 3/7 # b".to_vec(),
        b"o G\xe4nse\nusemtl\ng\np 1\nl 1 2\nfoo bar\nf 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n".to_vec(),
    ];
    for text in same {
        let file = completed(&text).unwrap();
        assert_eq!(file.mesh.positions, [glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y]);
        assert_eq!(file.mesh.triangles[0].positions, [0, 1, 2]);
        assert_eq!(file.mesh.corner_normals(&file.mesh.triangles[0]), [glam::Vec3::Z; 3]);
    }
}

#[test]
fn a_face_may_have_the_keyword_of_older_versions() {
    let [older, usual] =
        ["fo", "f"].map(|face| read(&format!("{CORNERS}v 1 1 0\n{face} 1 2 4 3\n")).unwrap());
    assert_eq!((older.mesh.triangles.len(), older.notes.len()), (2, 0), "{:?}", older.notes);
    assert_eq!(older.mesh, usual.mesh);
}

#[test]
fn a_comment_does_not_continue_a_line() {
    let text = "v 0 0 0 # from C:\\\nv 1 0 0\nv 0 1 0\nf 1 \\\n2 # and D:\\\nv 9 9 9\nf 1 \\\n2 3\n";
    let mesh = read(text).unwrap().mesh;
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (4, 1));
    assert_eq!(mesh.corners(&mesh.triangles[0]), [Vec3::ZERO, Vec3::X, Vec3::Y]);
}

#[test]
fn a_mistake_after_continued_lines_has_its_own_line() {
    for end in ["\\\n", "\\ \t\n"] {
        let text = format!("v 0 0 {end}{end}0\nv 1 0 x\nf 1 1 2\n");
        assert!(message(&text).contains("test.obj:4: `x`"), "{text:?}");
    }
}

#[test]
fn normals_that_the_file_lacks_are_made_and_noted() {
    for face in ["f 1//1 2//2 3//3", "f 1//1 2//1 3//-1", "f 1//2 2 3", "f 1//0 2//0 3//0"] {
        let file = read(&format!("{CORNERS}{face}\n{face}\nf 1 2 3\n")).unwrap();
        assert_eq!(file.mesh.corner_normals(&file.mesh.triangles[0]), [glam::Vec3::Z; 3]);
        let [note] = &file.notes[..] else { panic!("{:?}", file.notes) };
        assert!(
            note.starts_with("line 4: 2 faces name normals (vn) that do not exist in the file"),
            "{note}"
        );
    }
    let some = read(&format!("{CORNERS}vn 1 0 0\nf 1//1 2//1 3//1\nf 1//1 2//1 3//2\n")).unwrap();
    assert_eq!(some.mesh.corner_normals(&some.mesh.triangles[0]), [glam::Vec3::X; 3]);
    assert_eq!(some.mesh.corner_normals(&some.mesh.triangles[1]), [glam::Vec3::Z; 3]);
    assert!(some.notes[0].starts_with("line 6: 1 face names normals"), "{:?}", some.notes);
}

#[test]
fn negative_indices_count_back_from_the_last_of_their_own_kind() {
    let file = read(&format!("{CORNERS}vn 1 0 0\nvn 0 1 0\nf -3//-2 -2//-2 -1//-1\n")).unwrap();
    let triangle = &file.mesh.triangles[0];
    assert_eq!(triangle.positions, [0, 1, 2]);
    assert_eq!(file.mesh.corner_normals(triangle), [Vec3::X, Vec3::X, Vec3::Y]);
}

#[test]
fn faces_of_fewer_than_three_corners_are_left_out_and_noted() {
    let file = read(&format!("{CORNERS}f 1 2\nf 1 2 3\nf 3\nf\n")).unwrap();
    assert_eq!(file.mesh.triangles.len(), 1);
    assert_eq!(file.notes, ["line 4: 3 faces of fewer than three corners are left out"]);
}

#[test]
fn vertices_of_two_numbers_lie_in_a_plane_if_all_are_so() {
    let file = read("v 500000 5400000\nv 500001 5400000\nv 500000 5400001 # far\nf 1 2 3\n").unwrap();
    assert_eq!(file.mesh.positions[1] - file.mesh.positions[0], Vec3::X);
    assert_eq!(file.mesh.positions[2].z, 0.0);
    assert_eq!(file.notes, ["3 vertices with two numbers each: z is 0"]);
    let error = read("v 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n").err().unwrap().to_string();
    assert!(error.contains("test.obj:1: a vertex with 2 numbers"), "{error}");
}

#[test]
fn normals_at_some_corners_only_are_generated_at_all() {
    let file = read(&format!("{CORNERS}vn 1 0 0\nf 1//1 2 3\n")).unwrap();
    assert_eq!(file.mesh.corner_normals(&file.mesh.triangles[0]), [glam::Vec3::Z; 3]);
    let [note] = &file.notes[..] else { panic!("{:?}", file.notes) };
    assert!(note.starts_with("line 5: 1 face has a normal index at some corners only"), "{note}");
    assert_eq!(read(&format!("{CORNERS}vn 1 0 0\nf 1//1 2//1 3//1\n")).unwrap().notes, [""; 0]);
}

#[test]
fn faces_with_normals_at_some_corners_only_are_counted() {
    let file = read(&format!("{CORNERS}vn 1 0 0\nf 1 2 3\nf 1//1 2 3\nf 1 2//1 3\n")).unwrap();
    let [note] = &file.notes[..] else { panic!("{:?}", file.notes) };
    assert!(note.starts_with("line 6: 2 faces have a normal index at some corners only"), "{note}");
}

/// Returns the notes for an OBJ file that contains `obj` and then one triangle, with the MTL file `mtl`.
fn notes_of(obj: &str, mtl: &str) -> Vec<String> {
    with_materials(obj, mtl).notes
}

/// Reads an OBJ file that contains `obj` and then one triangle, with the MTL file `mtl`.
fn with_materials(obj: &str, mtl: &str) -> MeshFile {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.mtl"), mtl).unwrap();
    let reach =
        Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes: true, scaled: false } };
    let text = format!("mtllib m.mtl\n{CORNERS}{obj}\nf 1 2 3\n");
    parse("test.obj", reach, text.as_bytes()).unwrap()
}

#[test]
fn a_picture_takes_the_place_of_no_colour_and_of_black_and_is_multiplied_by_any_other() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::new(1, 1).save(folder.path().join("dot.png")).unwrap();
    let reach =
        Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes: true, scaled: false } };
    for (colour, lambertian) in [("", 1.0), ("Kd 0 0 0\n", 1.0), ("Kd 0.5 0.5 0.5\n", 0.5)] {
        let mtl = format!("newmtl a\n{colour}map_Kd dot.png\n");
        std::fs::write(folder.path().join("m.mtl"), mtl).unwrap();
        let text = format!("mtllib m.mtl\n{CORNERS}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
        let mesh = parse("test.obj", reach, text.as_bytes()).unwrap().mesh;
        assert_eq!(mesh.material(&mesh.triangles[0]).lambertian, Vec3::splat(lambertian), "{colour:?}");
    }
}

#[test]
fn what_a_material_asks_for_is_noted_by_name_and_count() {
    let cases = [
        ("map_Ks -s 2 2 2 a.png", "1 material asks for textures (map_Ks)"),
        ("map_Ka a.png\nbump b.png\nnorm c.png", "asks for textures (bump 1, map_Ka 1, norm 1)"),
        ("d 0.5", "asks for transparency (d)"),
        ("d -halo 0.5", "asks for transparency (d)"),
        ("Tr 0.1", "asks for transparency (Tr)"),
        ("Tf 0.5 1 1", "asks for transparency (Tf)"),
        ("Ka 0.2 0.2 0.2", "asks for ambient light (Ka)"),
        ("Pr 0", "asks for physically based shading (Pr)"),
        ("Pr 0.5\nPm 1", "asks for physically based shading (Pm 1, Pr 1)"),
        ("illum 0", "asks for a colour without light (illum 0)"),
        ("illum 1\nKs 1 1 1", "asks for no highlight (illum 1)"),
        ("illum 3", "asks for mirror reflections (illum 3)"),
        ("illum 7\nNi 1.5", "asks for refraction (illum 7)"),
        ("illum 10", "asks for a surface that shows only shadows (illum 10)"),
        ("illum 42", "asks for an unknown illumination model (illum 42)"),
        ("Kq 1 1 1\nKq 1 1 1", "unknown keywords of 1 material are ignored (`Kq`)"),
    ];
    for (lines, expected) in cases {
        let notes = notes_of("usemtl a", &format!("newmtl a\n{lines}\n"));
        assert!(notes.len() == 1 && notes[0].contains(expected), "{lines}: {notes:?}");
    }
}

#[test]
fn each_keyword_that_asks_for_something_is_noted_unless_it_says_off() {
    let of_materials = [
        (&["illum 3", "illum 5", "illum 8"][..], "mirror reflections"),
        (&["illum 4", "illum 6", "illum 7", "illum 9"], "refraction"),
        (&["Pr 0.9", "Pm 1", "Ps 1", "Pc 1", "aniso 1"], "physically based shading"),
        (&["bump a", "disp a", "decal a", "norm a", "refl a"], "textures"),
    ];
    for (lines, expected) in of_materials {
        for line in lines {
            let notes = notes_of("usemtl a", &format!("newmtl a\n{line}\n"));
            let expected = format!("1 material asks for {expected} (");
            assert!(notes.len() == 1 && notes[0].starts_with(&expected), "{line}: {notes:?}");
        }
    }
    assert_eq!(notes_of("usemtl a", "newmtl a\nmap_aat on\n"), [""; 0]);
    for keyword in ["bevel", "c_interp", "d_interp", "lod", "usemap"] {
        let notes = ["", " off", " 0", " 1"].map(|value| notes_of(&format!("{keyword}{value}"), "").len());
        assert_eq!(notes, [0, 0, 0, 1], "{keyword}");
    }
}

#[test]
fn what_a_material_has_and_needs_not_be_done_is_not_noted() {
    let mtl = "# map_Kd\nnewmtl a\nmap_Ks\nbump # none\nKa 0 0 0\nKd 1 1 1\nKs 0.5 0.5 0.5\nNs 10\nKe 0 0 0\nNi 1.45\nd 1\nTr 0\nTf 1 1 1\n\
               illum 2\nPm 0\nPr 1\nPc 0\nPcr 0.03\naniso 0\nanisor 0.5\nsharpness 60\nnewmtl b\nillum 1\nKs 0 0 0\n";
    assert_eq!(notes_of("usemtl a\nf 1 2 3\nusemtl b", mtl), Vec::<String>::new());
    // The fourth number is not part of the colour, so the colour is black and asks for no ambient light.
    let four = notes_of("usemtl a\nf 1 2 3", "newmtl a\nKa 0 0 0 1\n");
    assert!(four.iter().all(|note| !note.contains("ambient")), "{four:?}");
    // A material that no face uses adds no note, although its texture does not exist.
    assert_eq!(notes_of("usemtl a", "newmtl a\nnewmtl b\nmap_Kd b.png\n"), Vec::<String>::new());
}

#[test]
fn materials_that_ask_for_the_same_are_counted() {
    let mtl: String = (0..3).map(|i| format!("newmtl m{i}\nmap_Ks {i}.png\nmap_Ks {i}.png\n")).collect();
    let notes = notes_of("usemtl m0\nf 1 2 3\nusemtl m1\nf 1 2 3\nusemtl m2", &mtl);
    assert_eq!(notes.len(), 1);
    assert!(notes[0].starts_with("3 materials ask for textures (map_Ks), which"), "{notes:?}");
}

#[test]
fn what_a_mesh_asks_for_is_noted_by_name_and_count() {
    let cases = [
        ("l 1 2\nl 2 3", "2 statements ask for lines (l)"),
        ("p 1", "1 statement asks for points (p)"),
        (
            "#MRGB ff00ff00\n# MRGB\n#MRGB ffff0000",
            "2 statements ask for colours of vertices in comments (#MRGB), which raycl does not support",
        ),
        ("cstype bezier\ndeg 3\ncurv 0 1 1 2\nsurf 0 1 0 1 1\nend", "curves and surfaces (curv 1, surf 1)"),
        ("usemap wood", "asks for textures (usemap)"),
        ("bevel on\nlod 3\nshadow_obj a", "display attributes (bevel 1, lod 1, shadow_obj 1)"),
        ("call other.obj", "asks for another file or command (call)"),
        ("foo\nbar", "unknown keywords of 2 statements are ignored (`bar` 1, `foo` 1)"),
        ("s off", "smoothing groups (s) are not read: 1 triangle without normals"),
        ("s 1\nf 1 2 3\ns 2", "smoothing groups (s) are not read: 2 triangles"),
        ("f 1 2 3\ns 1\nf 1 2 3\ns 0", "smoothing groups (s) are not read: 3 triangles"),
        // By the specification, faces before the first line `s` are not smooth.
        ("f 1 2 3\ns 1", "smoothing groups (s) are not read: 2 triangles"),
        (
            "usemtl None",
            "is defined in no MTL file (material `None`): the default, k_L 0.8 (grey), is used, unless the scene sets",
        ),
        (
            "usemtl b\nusemtl a",
            "2 materials named by `usemtl` are defined in no MTL file (for example material `a`)",
        ),
    ];
    for (lines, expected) in cases {
        let notes = notes_of(lines, "");
        assert!(notes.len() == 1 && notes[0].contains(expected), "{lines}: {notes:?}");
    }
    let forms = [
        ("Ka spectral a.rfl", "Ka"),
        ("Ka xyz 0 0 0", "Ka"),
        ("Tf spectral a.rfl", "Tf"),
        ("Tf xyz 1 1 1", "Tf"),
    ];
    for (line, key) in forms {
        let notes = notes_of("usemtl a", &format!("newmtl a\n{line}\n"));
        assert!(notes.len() == 1 && notes[0].contains(&format!("({key})")), "{line}: {notes:?}");
    }
    let without =
        "o a\ng b c\ns 1\nmg off\nvt 0 0\nv 0 0 0 1\nvp 1\nbevel off\nusemap off\n# l 1 2\n\nf 1/1 2/1 3/1";
    assert_eq!(notes_of(without, ""), Vec::<String>::new());
    // Only triangles without normals become smooth, so a group without such triangles causes no note.
    for fine in ["s off\ns 1", "s 1\nf 1 2 3\ns 2\ns 1", "s off\nvn 0 0 1\nf 1//1 2//1 3//1\ns 1"] {
        assert_eq!(notes_of(fine, ""), Vec::<String>::new(), "{fine}");
    }
    assert_eq!(read(&format!("{CORNERS}f 1 2 3\ns off\n")).unwrap().notes, Vec::<String>::new());
    let last_lacks_normals = "s off\nvn 0 0 1\nf 1//1 2//1 3//1";
    assert_eq!(notes_of(last_lacks_normals, "").len(), 1);
}

#[test]
fn vertices_have_the_colours_of_their_own_lines_and_are_white_without() {
    let text = format!(
        "{CORNERS}v 0 0 1 0 255 0\nv 1 0 1 0 255 0\nv 0 1 1 0 255 0\nv 0 0 2 0 0 255\nv 1 0 2 0 0 255\nv 0 1 2 0 0 255\n\
         v 0 0 3\nv 1 0 3\nv 0 1 3\nf 1 2 3\nf 4 5 6\nf 7 8 9\nf 10 11 12\n"
    );
    let mesh = read(&text).unwrap().mesh;
    let colours: Vec<Vec3> =
        mesh.triangles.iter().map(|triangle| mesh.material(triangle).lambertian).collect();
    assert_eq!(colours, [Vec3::ONE, Vec3::Y, Vec3::Z, Vec3::ONE]);
}

#[test]
fn without_its_material_a_mesh_shows_only_the_colours_of_its_vertices_and_its_notes_say_so() {
    let file = |colour: &str| {
        let vertices = CORNERS.replace('\n', &format!(" {colour}\n"));
        read(&format!("mtllib none.mtl\nusemtl a\n{vertices}f 1 2 3\n")).unwrap()
    };
    let says =
        |note: &String| ["only the vertices' colours are shown", "grey"].map(|what| note.contains(what));
    for (colour, shown, expected) in
        [("1 0 0", Vec3::X, [true, false]), ("", Vec3::splat(0.8), [false, true])]
    {
        let file = file(colour);
        assert_eq!(file.mesh.material(&file.mesh.triangles[0]).lambertian, shown, "{colour}");
        assert_eq!(file.notes.iter().map(says).collect::<Vec<_>>(), [expected; 2], "{:?}", file.notes);
    }
}

#[test]
fn the_colours_of_a_file_have_one_range() {
    let colours = |text: &str| -> Vec<f32> {
        let mesh = read(text).unwrap().mesh;
        mesh.triangles.iter().map(|triangle| mesh.material(triangle).lambertian.x).collect()
    };
    let triangles = |first: &str, second: &str| {
        let vertices =
            |colour: &str| ["0 0 0", "1 0 0", "0 1 0"].map(|at| format!("v {at} {colour}\n")).concat();
        format!("{}{}f 1 2 3\nf 4 5 6\n", vertices(first), vertices(second))
    };
    let bytes = colours(&triangles("1 1 1", "255 255 255"));
    assert!(bytes[0] < 0.001 && bytes[1] == 1.0, "{bytes:?}");
    let fractions = colours(&triangles("1 1 1", "1.001 0 0"));
    assert_eq!(fractions, [1.0, 1.0], "a channel slightly above 1 is still a fraction");
}

#[test]
fn colours_of_vertices_that_are_changed_or_not_used_are_noted() {
    let notes = |first: &str, others: &str| {
        read(&format!("v 0 0 0 {first}\nv 1 0 0 {others}\nv 0 1 0 {others}\nf 1 2 3\n")).unwrap().notes
    };
    let limited = "1 vertex with a colour outside 0 to 1 is shown with channels limited to this range";
    let alpha = "alpha of 1 vertex is not used: every surface is opaque";
    let odd = "line 1: colours of 1 vertex are not used: expected three finite numbers after x, y and z";
    let white = "1 vertex without a colour is shown in white";
    let weight = "line 1: a single number other than 1 after `v x y z` is ignored (1 line)";
    for (first, expected) in [
        ("", vec![white]),
        ("0.5", vec![weight, white]),
        ("0 0.5 1.001 1", vec![]),
        ("0 1.2 0", vec![limited]),
        ("0 -0.5 0", vec![limited]),
        ("0 0.5 1 0.9", vec![alpha]),
        ("0 0.5 1 nan", vec![alpha]),
        ("1.2 0 0 0.9", vec![limited, alpha]),
        ("nan 0 0", vec![white, odd]),
        ("0 1e400 0", vec![white, odd]),
        ("0 0 1.#INF", vec![white, odd]),
        ("0.5 0.5", vec![white, odd]),
        ("red", vec![white, odd]),
    ] {
        assert_eq!(notes(first, "1 1 1 1"), expected, "{first}");
    }
    let two = |note: &str| vec![note.replace("1 vertex", "2 vertices").replace(" is shown", " are shown")];
    assert_eq!(notes("0 9 255 255", "0 9 255 254"), two(alpha));
    assert_eq!(notes("0 9 255 255", "0 9 256 255"), two(limited));
    assert_eq!(notes("", "red"), two(&odd.replace("line 1", "line 2")));
}

#[test]
fn colours_of_vertices_that_no_triangle_uses_have_no_effect() {
    for unused in ["1 0 0", "255 0 0", "-1 0 0", "1 0 0 0.5", "red", "0.5 0.5"] {
        let file = read(&format!("{CORNERS}v 5 5 5 {unused}\nf 1 2 3\n")).unwrap();
        assert_eq!(file.mesh.material(&file.mesh.triangles[0]).lambertian, Vec3::splat(0.8), "{unused}");
        assert_eq!(file.notes, [""; 0], "{unused}");
        let used = "v 0 0 0 0 1 0\nv 1 0 0 0 1 0\nv 0 1 0 0 1 0\n";
        let file = read(&format!("{used}v 5 5 5 {unused}\nv 6 6 6\nf 1 2 3\n")).unwrap();
        assert_eq!(file.mesh.material(&file.mesh.triangles[0]).lambertian, Vec3::Y, "{unused}");
        assert_eq!(file.notes, [""; 0], "{unused}");
    }
}

#[test]
fn a_textured_triangle_whose_vertices_have_colours_is_noted_unless_they_are_white() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::new(1, 1).save(folder.path().join("dot.png")).unwrap();
    std::fs::write(folder.path().join("m.mtl"), "newmtl a\nmap_Kd dot.png\nnewmtl b\nKd 1 1 1\n").unwrap();
    let notes = |colour: &str| {
        let vertices = CORNERS.replace('\n', &format!(" {colour}\n"));
        let faces = "usemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n";
        let text = format!("mtllib m.mtl\n{vertices}vt 0 0\n{faces}");
        parse("test.obj", Reach { folder: folder.path(), ..nowhere() }, text.as_bytes()).unwrap().notes
    };
    let expected = "textures of 1 triangle are multiplied by the colours of vertices, although many programs show the \
                    texture alone; a scene that sets `k_l = 1` (for a bare mesh, --set object.0.material.k_l=1) leaves these colours out";
    assert_eq!(notes("0.5 1 1"), [expected]);
    assert_eq!([notes("1 1 1"), notes("255 255 255"), notes("")].concat(), [""; 0]);
}

#[test]
fn faces_without_a_material_are_noted_if_the_file_has_materials() {
    let red = "newmtl a\nKd 1 0 0\n";
    let default = "the default, k_L 0.8 (grey), is used, unless the scene sets another `k_l`";
    let none = format!(
        "no `usemtl` selects a material for the faces, so 2 materials of the MTL files are not used: {default}"
    );
    assert_eq!(notes_of("", &format!("{red}newmtl b\n")), [none.as_str()]);
    let early = format!("2 triangles before the first `usemtl` have no material: {default}");
    assert_eq!(notes_of("f 1 2 3\nf 1 2 3\nusemtl a", red), [early.as_str()]);
    let coloured = notes_of("v 0 0 1 1 0 0\nf 1 2 4\nusemtl a\nf 1 2 4", red);
    let shown = "only the vertices' colours are shown, unless the scene sets a `k_l`";
    assert!(coloured.iter().any(|note| note.ends_with(shown)), "{coloured:?}");
    for (obj, mtl) in [("", ""), ("usemtl a\nf 1 2 3", red), ("", "newmtl\nKd 1 0 0\n")] {
        assert_eq!(notes_of(obj, mtl), [""; 0], "{obj} {mtl}");
    }
}

#[test]
fn normals_that_no_face_names_are_noted() {
    let expected = "2 normals (vn) are not used, since no face names a normal (as `f 1//1 2//2 3//3` would); normals \
                    are computed from the faces' shape instead";
    assert_eq!(notes_of("vn 0 0 1\nvn 0 0 1", ""), [expected]);
    // Another note concerns normals that are named, but cannot be used.
    for named in [
        "vn 0 0 1\nf 1//1 2//1 3//1",
        "vn 0 0 1\nf 1//1 2 3",
        "vn 0 0 1\nf 1//2 2//2 3//2",
        "vn 0 0 x\nf 1//1 2//1 3//1",
    ] {
        let notes = notes_of(named, "");
        assert!(!notes.iter().any(|note| note.contains("no face names a normal")), "{named}: {notes:?}");
    }
}

#[test]
fn vertices_that_no_face_uses_are_noted_if_they_are_most() {
    let notes = |more: &str| read(&format!("{CORNERS}{more}f 1 2 3\n")).unwrap().notes;
    let point = "v 5 5 5\n";
    assert_eq!(notes(&point.repeat(4)), ["4 vertices that no face uses are not drawn"]);
    assert_eq!(notes(&point.repeat(3)), [""; 0]);
    // Vertices of statements that are not supported have a note on these statements.
    for (line, of_line) in
        [("l 4 5 6 7", "lines (l)"), ("p 4 5 6 7", "points (p)"), ("curv 0 1 4 5 6 7", "curves")]
    {
        let noted = notes(&format!("{}{line}\n", point.repeat(4)));
        assert!(noted.len() == 1 && noted[0].contains(of_line), "{noted:?}");
    }
    // Vertices that are not valid have a note of their own.
    let invalid = notes(&"v nan 0 0\n".repeat(4));
    assert!(
        invalid.len() == 1 && invalid[0].ends_with("4 such vertices that no face uses are ignored"),
        "{invalid:?}"
    );
}

#[test]
fn a_range_of_colours_that_is_doubtful_is_noted() {
    let notes = |red: &str| {
        read(&format!("v 0 0 0 {red} 1 1\nv 1 0 0 1 1 1\nv 0 1 0 1 1 1\nf 1 2 3\n")).unwrap().notes
    };
    assert_eq!(
        notes("1.6"),
        ["channels of colours are read as numbers from 0 to 255, not from 0 to 1, since one of them is 1.6"]
    );
    assert_eq!(notes("15").len(), 1);
    assert_eq!([notes("1"), notes("16"), notes("200")].concat(), [""; 0]);
}

#[test]
fn lines_with_more_numbers_than_are_read_are_counted() {
    let text =
        "v 0 0 0 1 1 1 1 7\nv 1 0 0 1 1 1 1\nv 0 1 0 1 1 1 1 # 7 8\nvn 0 0 1 5\nvn 0 0 1\nf 1//1 2//1 3//1\n";
    let expected = "line 1: numbers after the seventh of `v` or the third of `vn` are ignored (2 lines)";
    assert_eq!(read(text).unwrap().notes, [expected]);
    let weights = read("v 0 0 0 2\nv 1 0 0 1\nv 0 1 0 1.0\nv 0 0 1 0\nf 1 2 3\n").unwrap().notes;
    assert_eq!(weights, ["line 1: a single number other than 1 after `v x y z` is ignored (2 lines)"]);
    let textured = |coordinates: &str| {
        let mut notes = notes_of(coordinates, "newmtl a\nmap_Kd a.png\n");
        notes.retain(|note| note.contains("vt"));
        notes
    };
    let expected = "line 6: numbers after the second of `vt` are ignored (2 lines)";
    assert_eq!(textured("vt 0 0 0.000\nvt 1 1 0.5\nvt 1 1 0 x\nvt 0 1"), [expected]);
    assert_eq!(textured("vt 0 0 0.000\nvt 1 1 -0\nvt 0 1 # 1"), [""; 0]);
    assert_eq!(textured("vt nan 0 1").len(), 1);
}

#[test]
fn lines_without_a_name_are_counted() {
    let red = "newmtl a\nKd 1 0 0\n";
    let expected = "line 6: `usemtl` without a name selects the default material (2 lines)";
    let file = with_materials("usemtl a\nusemtl\nusemtl # none", red);
    assert_eq!(file.mesh.material(&file.mesh.triangles[0]).lambertian, Vec3::splat(0.8));
    assert_eq!(file.notes, [expected]);
    assert_eq!(notes_of("usemtl", &format!("newmtl\n{red}")), [""; 0], "a material has the empty name");
    assert_eq!(notes_of("mtllib\nmtllib # none", ""), ["2 `mtllib` lines without a name are ignored"]);
}

#[test]
fn notes_stay_short_and_counts_are_readable() {
    let words: String = (0..1_000).map(|i| format!("word{i}{}\n", "x".repeat(100))).collect();
    let notes = notes_of(&words, "");
    assert!(notes.len() == 1 && notes[0].len() < 600, "{notes:?}");
    assert!(notes_of(&"p 1\n".repeat(40_000), "")[0].contains("40,000 statements ask for points"));
}

#[test]
fn many_chunks_read_as_one() {
    let mut text = String::new();
    for i in 0..40_000 {
        text.push_str(&format!("v {i} 0 0\nv {i} 1 0\nv {i} 0 1\nf -3 -2 -1\n"));
    }
    let file = read(&text).unwrap();
    assert_eq!(file.mesh.triangles.len(), 40_000);
    for (i, triangle) in (0..).zip(&file.mesh.triangles) {
        assert_eq!(triangle.positions, [3 * i, 3 * i + 1, 3 * i + 2]);
    }
    text.push_str("f 1 2 oops\n");
    assert!(message(&text).contains("test.obj:160001:"));
}

#[test]
fn pieces_that_are_read_in_groups_give_the_triangles_of_all_pieces_at_once() {
    let faces = (0..40_000).map(|i| format!("v {i} 0 0\nv {i} 1 0\nv {i} 0 1\nf -3 -2 -1\n"));
    let text: String = faces.collect();
    let source = Source { name: "test.obj", text: text.as_bytes(), quotes: true };
    let chunks = text::chunks(source.text);
    let points: Vec<_> = chunks.iter().map(|chunk| points::read(chunk, &Reading::USUAL)).collect();
    let starts = faces::starts(&points, &[]);
    let total = starts[points.len()];
    let mut mesh = Mesh::default();
    add_points(&mut mesh, &points, total);
    let materials = std::collections::HashMap::new();
    let context = FaceContext {
        positions: &mesh.positions,
        odd_normals: &[],
        total,
        materials: &materials,
        mapped: false,
    };
    let triangles = |at_a_time| read_faces(&source, &context, &chunks, &starts, at_a_time).unwrap().0;
    let all = triangles(chunks.len());
    assert_eq!(all.len(), 40_000);
    assert!(chunks.len() > 3, "three pieces at a time are not all pieces");
    for at_a_time in 1..=3 {
        assert!(triangles(at_a_time) == all, "{at_a_time} pieces at a time");
    }
}

/// Generates OBJ files with vertices, normals and triangles. All files contain one large triangle at the
/// origin, so that no mesh is far enough from the origin to be moved.
fn obj_text() -> impl Strategy<Value = String> {
    let vertex = prop::array::uniform3(1e-2_f32..1e3);
    let counts = (prop::collection::vec(vertex, 3..40), prop::collection::vec(any::<[u32; 6]>(), 1..60));
    counts.prop_map(|(vertices, faces)| {
        let mut text = String::new();
        for [x, y, z] in &vertices {
            text.push_str(&format!("v {x} {y} {z}\nvn {z} {x} {y}\n"));
        }
        let count = vertices.len() as u32;
        text.push_str("v 0 0 0\nv 1000 0 0\nv 0 1000 1000\nf -3//1 -2//1 -1//1\n");
        for face in faces {
            let [a, b, c, d, e, f] = face.map(|index| 1 + index % count);
            text.push_str(&format!("f {a}//{d} {b}//{e} {c}//{f}\n"));
        }
        text
    })
}

proptest! {
    #[test]
    fn good_files_read_as_tobj_reads_them(text in obj_text()) {
        let ours = read(&text).unwrap().mesh;
        let options = tobj::LoadOptions { triangulate: true, ..tobj::LoadOptions::default() };
        let load = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| unreachable!());
        let theirs = &load.unwrap().0[0].mesh;
        let corner = |list: &[f32], index: u32| {
            let at = 3 * index as usize;
            glam::Vec3::new(list[at], list[at + 1], list[at + 2])
        };
        for (at, triangle) in ours.triangles.iter().enumerate() {
            for i in 0..3 {
                let position = corner(&theirs.positions, theirs.indices[3 * at + i]);
                prop_assert_eq!(ours.corners(triangle)[i], position);
                let normal = corner(&theirs.normals, theirs.normal_indices[3 * at + i]);
                prop_assert_eq!(ours.corner_normals(triangle)[i], normal);
            }
        }
        prop_assert_eq!(3 * ours.triangles.len(), theirs.indices.len());
    }

    #[test]
    fn no_text_makes_it_panic(text in "([vf#lp\\\\ ]|vn|usemtl|mtllib|[0-9/. \n-]|nan|1e9){0,60}") {
        let _ = read(&text);
    }
}

#[test]
fn coloured_triangles_whose_material_is_not_white_are_noted() {
    let note = |kd: &str, colour: &str| {
        let corners = CORNERS.replace('\n', &format!(" {colour}\n"));
        let obj = format!("usemtl a\n{corners}f -3 -2 -1\nusemtl b");
        let mut notes = notes_of(&obj, &format!("newmtl a\n{kd}\nnewmtl b\nKd 1 1 1\n"));
        notes.retain(|note| note.contains("multiplied"));
        notes
    };
    let expected = "colours of vertices are multiplied by those of materials (Kd) on 1 triangle, although many programs \
                    show them alone";
    assert_eq!(note("Kd 0.8 0.8 0.8", "1 0 0"), [expected]);
    assert_eq!(note("Kd 1 1 0", "0 0 1"), [expected]);
    let plain = ["0 0 0", "1 1 1"].map(|colour| note("Kd 0.5 0.5 0.5", colour));
    assert_eq!([plain.concat(), note("Kd 1 1 1", "1 0 0")].concat(), [""; 0]);
}

#[test]
fn a_textured_triangle_with_a_single_coloured_vertex_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::new(1, 1).save(folder.path().join("dot.png")).unwrap();
    std::fs::write(folder.path().join("m.mtl"), "newmtl a\nmap_Kd dot.png\n").unwrap();
    let vertices = CORNERS.replacen('\n', " 0.5 1 1\n", 1);
    let text = format!("mtllib m.mtl\n{vertices}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
    let notes =
        parse("test.obj", Reach { folder: folder.path(), ..nowhere() }, text.as_bytes()).unwrap().notes;
    let expected = "textures of 1 triangle are multiplied by the colours of vertices";
    assert!(notes.iter().any(|note| note.starts_with(expected)), "{notes:?}");
}

#[test]
fn a_colour_that_is_not_valid_is_noted_even_if_no_other_vertex_has_one() {
    let notes = read(&format!("{}f 1 2 3\n", CORNERS.replacen('\n', " red\n", 1))).unwrap().notes;
    let expected = "line 1: colours of 1 vertex are not used: expected three finite numbers after x, y and z";
    assert_eq!(notes, [expected]);
}

/// The file is so large that it is read in several pieces.
#[test]
fn faces_of_a_material_that_is_not_defined_do_not_precede_the_first_usemtl() {
    let faces = "f 1 2 3\n".repeat(100_000);
    let notes = notes_of(&format!("usemtl none\n{faces}"), "newmtl a\nKd 1 0 0\n");
    assert!(notes.len() == 1 && notes[0].contains("(material `none`)"), "{notes:?}");
}
