//! Tests of MTL files: the folders from which they are read, and the materials that they define.

use super::*;

/// Makes a folder with a mesh, and an MTL file outside this folder. The mesh names its MTL file `library`. Returns
/// whether the MTL file was read, and the notes on the mesh.
#[cfg(unix)]
fn through(library: &str, beyond: bool) -> (bool, Vec<String>) {
    let outer = tempfile::tempdir().unwrap();
    let inner = outer.path().join("mesh");
    std::fs::create_dir(&inner).unwrap();
    std::fs::write(outer.path().join("outer.mtl"), "newmtl x\nKd 0.25 0.5 1\n").unwrap();
    std::os::unix::fs::symlink("../outer.mtl", inner.join("link.mtl")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", inner.join("endless.mtl")).unwrap();
    let path = inner.join("test.obj");
    std::fs::write(&path, format!("mtllib {library}\nusemtl x\n{CORNERS}f 1 2 3\n")).unwrap();
    let opened = Opened::at(&path).unwrap();
    let permitted = Permitted { beyond, quotes: true, scaled: false };
    let file = files::read(&path, opened, crate::filetype::MeshFormat::Obj, permitted).unwrap();
    let material = *file.mesh.material(&file.mesh.triangles[0]);
    (material != crate::scene::Material::default(), file.notes)
}

#[test]
#[cfg(unix)]
fn a_material_file_outside_the_folder_is_read_only_where_that_is_allowed() {
    for library in ["../outer.mtl", "link.mtl", "..\\outer.mtl", "../mesh/../outer.mtl"] {
        let (read, notes) = through(library, false);
        assert!(!read && notes[0].contains("outside_materials"), "{library}: {notes:?}");
        assert_eq!(through(library, true), (true, Vec::new()), "{library}");
    }
    let (read, notes) = through("endless.mtl", true);
    assert!(!read && notes[0].contains("not an ordinary file"), "{notes:?}");
}

#[test]
fn a_material_file_outside_the_folder_or_missing_is_a_note() {
    for library in ["../../etc/passwd", "/etc/passwd", "none.mtl", "a b.mtl", "."] {
        let file = read(&format!("mtllib {library}\nusemtl x\n{CORNERS}f 1 2 3\n")).unwrap();
        assert!(file.notes.len() >= 2, "{library}: {:?}", file.notes);
        assert_eq!(*file.mesh.material(&file.mesh.triangles[0]), crate::scene::Material::default());
    }
}

#[test]
fn a_material_may_have_the_empty_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.mtl"), "newmtl b\nKd 1 0 0\nnewmtl \nKd 0 1 0\n").unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, format!("mtllib a.mtl\nusemtl \n{CORNERS}f 1 2 3\n")).unwrap();
    let opened = Opened::at(&path).unwrap();
    let permitted = Permitted { beyond: false, quotes: true, scaled: false };
    let file = files::read(&path, opened, crate::filetype::MeshFormat::Obj, permitted).unwrap();
    assert_eq!(file.mesh.material(&file.mesh.triangles[0]).lambertian, Vec3::Y);
    assert_eq!(file.notes, Vec::<String>::new());
}

/// Each of the last two names is one letter in Shift-JIS, two bytes. raycl decodes such names as Latin-1, in which
/// the second byte is a Unicode blank.
#[test]
fn a_name_keeps_the_unicode_blanks_around_it() {
    let names: [&[u8]; 6] =
        [b"a\xa0", b"\x85a", "\u{3000}".as_bytes(), "\u{3000}a\u{2003}".as_bytes(), b"\x82\xa0", b"\x83\x85"];
    for name in names {
        let folder = tempfile::tempdir().unwrap();
        let mtl = [&b"newmtl "[..], name, b"\nKd 0.25 0 0\nnewmtl a\nKd 1 0 0\n"].concat();
        std::fs::write(folder.path().join("a.mtl"), mtl).unwrap();
        let obj = [&b"mtllib a.mtl\nusemtl "[..], name, b"\n", CORNERS.as_bytes(), b"f 1 2 3\n"].concat();
        let file = parse("test.obj", Reach { folder: folder.path(), ..nowhere() }, &obj).unwrap();
        let red = file.mesh.material(&file.mesh.triangles[0]).lambertian.x;
        assert_eq!((red, file.notes), (0.25, Vec::<String>::new()), "{name:?}");
    }
}

#[test]
fn a_material_file_that_is_something_else_is_named() {
    let notes = notes_of("usemtl a", "\u{89}not a PNG");
    assert!(!notes.is_empty());
    let folder = tempfile::tempdir().unwrap();
    let text = format!("mtllib m.mtl\n{CORNERS}f 1 2 3\n");
    let utf16: Vec<u8> = "\u{feff}newmtl a\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    for (bytes, expected) in [
        (&b"\x89PNG\r\n\x1a\n"[..], "`m.mtl` is a PNG picture and is not read"),
        (&utf16[..], "`m.mtl` is UTF-16 or UTF-32 text and is not read; save it as UTF-8: "),
    ] {
        std::fs::write(folder.path().join("m.mtl"), bytes).unwrap();
        let permitted = Permitted { beyond: false, quotes: true, scaled: false };
        let reach = Reach { folder: folder.path(), permitted };
        let notes = parse("test.obj", reach, text.as_bytes()).unwrap().notes;
        assert!(notes[0].contains(expected), "{notes:?}");
    }
}

#[test]
fn a_highlight_without_strength_is_none_and_a_grey_is_three_values() {
    let folder = tempfile::tempdir().unwrap();
    let reach = || Reach {
        folder: folder.path(),
        permitted: Permitted { beyond: false, quotes: true, scaled: false },
    };
    let material = |mtl: &str| {
        std::fs::write(folder.path().join("m.mtl"), format!("newmtl a\n{mtl}")).unwrap();
        let text = format!("mtllib m.mtl\n{CORNERS}usemtl a\nf 1 2 3\n");
        let mesh = parse("test.obj", reach(), text.as_bytes()).unwrap().mesh;
        *mesh.material(&mesh.triangles[0])
    };
    let half = Vec3::splat(0.5);
    assert_eq!(material("Kd 0.5\nKs 0 0 0\nNs 7\n"), Material::lambertian(half));
    assert_eq!(material("Kd 0.5\nNs 7\n"), Material::lambertian(half));
    assert_eq!(material("Kd 0.5\nKs 0.25\nNs 7\n"), Material::blinn_phong(half, Vec3::splat(0.25), 7.0));
    let emitted = Vec3::new(2.0, 0.0, 0.5);
    assert_eq!(material("Kd 0.5\nKe 2 0 0.5\n"), Material { emitted, ..Material::lambertian(half) });
    assert_eq!(material("Kd 0.5\nke 3\n").emitted, Vec3::splat(3.0));
    // An emission texture that cannot be read emits nothing.
    for factor in ["", "Ke 1\n"] {
        let unlit = material(&format!("Kd 0.5\n{factor}map_Ke none.png\n"));
        assert_eq!(unlit, Material::lambertian(half), "{factor}");
    }
}

#[test]
fn a_material_file_that_is_missing_is_noted_once() {
    let text = format!("mtllib no.mtl\nmtllib no.mtl\n{CORNERS}f 1 2 3\n");
    let notes = parse("test.obj", nowhere(), text.as_bytes()).unwrap().notes;
    assert_eq!(notes.iter().filter(|note| note.contains("no.mtl")).count(), 1, "{notes:?}");
}

#[test]
fn each_corner_has_the_texture_coordinates_that_its_face_names() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::new(1, 1).save(folder.path().join("dot.png")).unwrap();
    std::fs::write(folder.path().join("m.mtl"), "newmtl a\nmap_Kd dot.png\n").unwrap();
    let reach =
        Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes: true, scaled: false } };
    let mapped = |lines: &str| {
        let text = format!("mtllib m.mtl\nusemtl a\n{CORNERS}{lines}");
        parse("test.obj", reach, text.as_bytes()).unwrap().mesh.textures.mapped
    };
    // In OBJ, the second coordinate in a texture is measured upwards from the texture's lower edge; if this
    // coordinate is missing, it is 0. Negative indices of texture coordinates count backwards from the last
    // texture coordinate. Because of the fourth vertex, the number of vertices differs from the number of
    // texture coordinates.
    let coordinates = "v 0 0 1\nvt 0.25 0\nvt 0.5\nvt 0 0.75\n";
    for face in ["f 1/1 2/2 3/3", "f 1/-3 2/-2 3/-1", "f 1/1/ 2/2/ 3/3/"] {
        let rows = mapped(&format!("{coordinates}{face}\n"));
        assert_eq!(rows[0].corners, [[0.25, 1.0], [0.5, 1.0], [0.0, 0.25]], "{face}");
        assert_eq!((rows[0].texture, rows[0].mask), (Some(0), None));
    }
    let rows = mapped(&format!("{coordinates}f 1/1 2/2 3/3\nf 1 2 3\n"));
    assert_eq!(rows[1], crate::scene::Mapped::NONE);
}

/// A picture repeats, so a whole number may be added to all coordinates.
#[test]
fn texture_coordinates_far_from_0_place_a_picture_as_exactly_as_near_ones() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::new(1, 1).save(folder.path().join("dot.png")).unwrap();
    let reach =
        Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes: true, scaled: false } };
    let mapped = |options: &str, coordinates: &str| {
        std::fs::write(folder.path().join("m.mtl"), format!("newmtl a\nmap_Kd {options} dot.png\n")).unwrap();
        let text = format!("mtllib m.mtl\nusemtl a\n{CORNERS}{coordinates}f 1/1 2/2 3/3\n");
        parse("test.obj", reach, text.as_bytes()).unwrap().mesh.textures.mapped
    };
    let near = "vt 0.1 0.2\nvt 2.3 0.2\nvt 2.3 0.35\n";
    let far = "vt 1000000.1 -999999.8\nvt 1000002.3 -999999.8\nvt 1000002.3 -999999.65\n";
    let expected = mapped("", near);
    assert_eq!(expected[0].corners, [[0.1, 0.8], [2.3, 0.8], [2.3, 0.65]]);
    assert_eq!([mapped("", far), mapped("-o 1000000 -1000000", near)], [expected.clone(), expected]);
}

/// A texture is multiplied by white if `Kd` is missing or black. Triangles without coordinates show no
/// texture.
#[test]
fn triangles_without_texture_coordinates_keep_the_colour_of_their_material() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::new(1, 1).save(folder.path().join("dot.png")).unwrap();
    let reach =
        Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes: true, scaled: false } };
    let read = |colour: &str, faces: &str| {
        std::fs::write(folder.path().join("m.mtl"), format!("newmtl a\n{colour}map_Kd dot.png\n")).unwrap();
        let text = format!("mtllib m.mtl\nusemtl a\n{CORNERS}vt 0 0\n{faces}");
        let mesh = parse("test.obj", reach, text.as_bytes()).unwrap().mesh;
        let reds: Vec<f32> = mesh.triangles.iter().map(|one| mesh.material(one).lambertian.x).collect();
        (reds, mesh.materials.len())
    };
    let (plain, textured) = ("f 1 2 3\n", "f 1/1 2/1 3/1\n");
    let both = [plain, textured, plain].concat();
    assert_eq!(read("", &both), (vec![0.8, 1.0, 0.8], 3));
    assert_eq!(read("Kd 0 0 0\n", &both), (vec![0.0, 1.0, 0.0], 3));
    assert_eq!(read("Kd 0.5 0.5 0.5\n", &both), (vec![0.5; 3], 2), "no copy is needed");
    assert_eq!(read("", textured), (vec![1.0], 2), "no copy is needed");
}

#[test]
fn a_texture_coordinate_that_is_not_valid_counts_as_missing() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::new(1, 1).save(folder.path().join("dot.png")).unwrap();
    std::fs::write(folder.path().join("m.mtl"), "newmtl a\nmap_Kd dot.png\n").unwrap();
    let read = |lines: &str, quotes: bool| {
        let permitted = Permitted { beyond: false, quotes, scaled: false };
        let text = format!("mtllib m.mtl\nusemtl a\n{CORNERS}{lines}");
        parse("test.obj", Reach { folder: folder.path(), permitted }, text.as_bytes()).unwrap()
    };
    let text = "vt 0 1\nvt nan 0\nvt 0 x\nf 1/1 2/1 3/1\nf 1/1 2/2 3/1\nf 1/3 2/1 3/-1\n";
    let MeshFile { mesh, notes, .. } = read(text, true);
    let is_mapped: Vec<_> = mesh.textures.mapped.iter().map(|row| row.texture.is_some()).collect();
    assert_eq!(is_mapped, [true, false, false]);
    let ignored = "2 such texture coordinates are ignored";
    let expected = "in a texture coordinate (vt); expected a finite decimal number";
    let unmapped =
        "2 triangles have a texture but no texture coordinates: their materials' own colour is used";
    assert_eq!(notes, [format!("line 7: `nan` {expected}: {ignored}"), unmapped.to_owned()]);
    let withheld = "line 7: the line is not valid; expected `vt u v`: two finite numbers";
    assert_eq!(read(text, false).notes, [format!("{withheld}: {ignored}"), unmapped.to_owned()]);
    // No triangle uses the second texture coordinate, so the only note is that this coordinate is ignored.
    assert_eq!(read("vt 0 1\nvt nan 0\nf 1/1 2/1 3/1\n", true).notes.len(), 1);
    let windows = read("vt 1.#QNAN 1.#QNAN\nf 1/1 2/1 3/1\n", true);
    assert_eq!(
        windows.notes[0],
        format!("line 6: `1.#QNAN` {expected}: 1 such texture coordinate is ignored")
    );
}

/// Reads a mesh file with the lines `obj` and then one triangle. Returns the red channel of the triangle's
/// material, and the notes on the file. The folder of the mesh file has two MTL files, `my paints.mtl`
/// and `#1.mtl`, which both contain the text `mtl`.
fn red(mtl: &str, obj: &str) -> (f32, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    for name in ["my paints.mtl", "#1.mtl"] {
        std::fs::write(folder.path().join(name), mtl).unwrap();
    }
    let permitted = Permitted { beyond: false, quotes: true, scaled: false };
    let text = format!("{obj}\n{CORNERS}f 1 2 3\n");
    let file = parse("test.obj", Reach { folder: folder.path(), permitted }, text.as_bytes()).unwrap();
    (file.mesh.material(&file.mesh.triangles[0]).lambertian.x, file.notes)
}

#[test]
fn a_comment_may_follow_a_name() {
    let mtl = "newmtl red # paint\nKd 0.25 0 0 # dark\nnewmtl Material #25\nKd 0.5 0 0\nnewmtl Material #26\nKd 0.75 0 0\n";
    for (obj, expected) in [
        ("mtllib my paints.mtl\nusemtl red", 0.25),
        ("mtllib my paints.mtl # lib\nusemtl red # walls", 0.25),
        ("mtllib my paints.mtl\nusemtl red # paint", 0.25),
        ("mtllib #1.mtl\nusemtl Material #25", 0.5),
        ("mtllib #1.mtl # lib\nusemtl Material #26 # roof", 0.75),
        ("mtllib my paints.mtl #lib\nusemtl Material #25", 0.5),
    ] {
        assert_eq!(red(mtl, obj), (expected, Vec::new()), "{obj}");
    }
    // If the material `red` and the material `red # paint` are both defined, the name `red` means the
    // material `red`, whichever of the two is defined first.
    let both = format!("newmtl red\nKd 1 0 0\n{mtl}");
    assert_eq!(red(&both, "mtllib my paints.mtl\nusemtl red # walls").0, 1.0);
    assert_eq!(red(&both, "mtllib my paints.mtl\nusemtl red # paint").0, 0.25);
    let (grey, notes) = red(mtl, "mtllib none.mtl # lib\nusemtl red # walls");
    assert_eq!(grey, 0.8);
    assert!(notes[0].starts_with("MTL file `none.mtl` cannot be read (") && notes.len() == 2, "{notes:?}");
    assert!(notes[1].contains("(material `red`)"), "{notes:?}");
    // In a `usemtl` line, a `#` without a blank after it begins a comment only if the text before the `#` is the name
    // of a known material.
    assert_eq!(red(&both, "mtllib #1.mtl\nusemtl red #walls"), (1.0, Vec::new()));
    // The name of a material may be empty, and a comment may follow the empty name.
    let nameless = "newmtl # nameless\nKd 0.5 0 0\n";
    assert_eq!(red(nameless, "mtllib #1.mtl\nusemtl # none"), (0.5, Vec::new()));
}

#[test]
fn a_material_whose_name_has_a_number_sign_is_not_taken_for_another() {
    let numbered = "newmtl Material #25\nKd 0.5 0 0\nnewmtl Material #26\nKd 0.75 0 0\n";
    let (mtllib, missing) = ("mtllib #1.mtl", "1 material named by `usemtl` is defined in no MTL file");
    for (mtl, obj, name) in [
        (numbered, format!("{mtllib}\nusemtl Material #27"), "Material #27"),
        (numbered, format!("{mtllib}\nusemtl Material"), "Material"),
        ("newmtl #1\nKd 0.5 0 0\n", format!("{mtllib}\nusemtl #2"), "#2"),
        ("", "usemtl #2".to_owned(), "#2"),
        ("newmtl \nKd 0.5 0 0\n", format!("{mtllib}\nusemtl #2"), "#2"),
    ] {
        let (grey, notes) = red(mtl, &obj);
        assert_eq!((grey, notes.len()), (0.8, 1), "{obj}: {notes:?}");
        assert!(notes[0].starts_with(&format!("{missing} (material `{name}`)")), "{obj}: {notes:?}");
    }
    let (grey, notes) = red("newmtl #1\nKd 0.5 0 0\n", mtllib);
    assert!(grey == 0.8 && notes.len() == 1 && notes[0].starts_with("no `usemtl`"), "{notes:?}");
    assert_eq!(red("newmtl #1\nKd 0.5 0 0\n", "mtllib #1.mtl\nusemtl #1"), (0.5, Vec::new()));
    let (_, notes) = red("", "mtllib #3.mtl");
    assert!(notes[0].starts_with("MTL file `#3.mtl` cannot be read ("), "{notes:?}");
}

#[test]
fn a_picture_may_lie_beside_its_material_file_and_have_a_number_sign_in_its_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("mats")).unwrap();
    let sizes =
        [("mats/wood.png", 1), ("wood #2.png", 2), ("mats/#3.png", 3), ("mats/bark.png", 4), ("bark.png", 5)];
    for (name, size) in sizes {
        image::RgbImage::new(size, 1).save(folder.path().join(name)).unwrap();
    }
    for (library, name, width) in [
        ("mats/m.mtl", "wood.png", 1),
        ("mats\\m.mtl", "wood.png # old", 1),
        ("mats/m.mtl", "C:\\work\\wood.png", 1),
        ("mats/m.mtl", "wood #2.png", 2),
        ("mats/m.mtl", "C:\\work\\wood #2.png", 2),
        ("mats/m.mtl", "#3.png", 3),
        // The mesh's folder is searched before the MTL file's folder.
        ("mats/m.mtl", "bark.png", 5),
        ("mats/m.mtl", "mats/bark.png", 4),
    ] {
        std::fs::write(folder.path().join("mats/m.mtl"), format!("newmtl a\nmap_Kd {name}\n")).unwrap();
        let permitted = Permitted { beyond: false, quotes: true, scaled: false };
        let text = format!("mtllib {library}\nusemtl a\n{CORNERS}vt 0 0\nf 1/1 2/1 3/1\n");
        let file = parse("test.obj", Reach { folder: folder.path(), permitted }, text.as_bytes()).unwrap();
        let widths: Vec<u32> = file.mesh.textures.list.iter().map(|texture| texture.size[0]).collect();
        assert_eq!(widths, [width], "{library} {name}");
        let is_doubtful = name.contains("work") || name == "bark.png";
        assert_eq!(file.notes.len(), usize::from(is_doubtful), "{library} {name}: {:?}", file.notes);
    }
}

/// The folder of the mesh, `mesh`, has pictures and MTL files whose namesakes are in other folders.
#[test]
fn a_namesake_in_another_folder_is_noted() {
    let outer = tempfile::tempdir().unwrap();
    let inner = outer.path().join("mesh");
    std::fs::create_dir_all(inner.join("mats")).unwrap();
    for (name, mtl) in [("m.mtl", true), ("a.png", false), ("b.png", false), ("c.png", false)] {
        for folder in [&inner, &inner.join("mats"), outer.path()] {
            let path = folder.join(name);
            if mtl {
                std::fs::write(path, "newmtl a\n").unwrap();
            } else {
                image::RgbImage::new(1, 1).save(path).unwrap();
            }
        }
    }
    std::fs::write(inner.join("b.png"), "no picture").unwrap();
    std::fs::remove_file(inner.join("mats/c.png")).unwrap();
    let notes = |library: &str, picture: &str, quotes: bool| {
        for folder in [&inner, &inner.join("mats")] {
            std::fs::write(folder.join("used.mtl"), format!("newmtl a\n{picture}\n")).unwrap();
        }
        let permitted = Permitted { beyond: false, quotes, scaled: false };
        let text = format!("mtllib {library}\nusemtl a\n{CORNERS}vt 0 0\nf 1/1 2/1 3/1\n");
        parse("test.obj", Reach { folder: &inner, permitted }, text.as_bytes()).unwrap().notes
    };
    for (library, picture, used, unused) in [
        ("used.mtl", "map_Kd ../a.png", "a.png", "../a.png"),
        ("used.mtl", "map_Kd \"../a.png\"", "a.png", "../a.png"),
        ("mats/used.mtl", "map_Kd x/a.png", "a.png", "x/a.png"),
        ("mats/used.mtl", "map_Kd a.png", "a.png", "mats/a.png"),
        ("mats/used.mtl", "map_Kd b.png", "mats/b.png", "b.png"),
        ("used.mtl", "map_Ke ../c.png", "c.png", "../c.png"),
    ] {
        let noted = notes(library, picture, true);
        let expected = format!("for 1 texture, another file may be meant: `{used}` is used, not `{unused}`");
        let is_named = noted.iter().filter(|note| **note == expected).count();
        assert_eq!((noted.len(), is_named), (1, 1), "{picture}: {noted:?}");
        assert_eq!(notes(library, picture, false), ["for 1 texture, another file may be meant"]);
    }
    // The name of a picture beside the MTL file means no file of the same name in a folder further inside.
    std::fs::create_dir(inner.join("mats/mats")).unwrap();
    for name in ["mats/d.png", "mats/mats/d.png"] {
        image::RgbImage::new(1, 1).save(inner.join(name)).unwrap();
    }
    assert_eq!(notes("mats/used.mtl", "map_Kd d.png", true), [""; 0]);
    let expected = "for 1 texture, another file may be meant: `mats/d.png` is used, not `mats/mats/d.png`";
    assert_eq!(notes("mats/used.mtl", "map_Kd mats/d.png", true), [expected]);
    let expected = "for 1 MTL file, another file may be meant: `m.mtl` is used, not `../m.mtl`";
    assert_eq!(notes("../m.mtl", "", true), [expected]);
    for (library, picture) in [
        ("m.mtl", ""),
        ("used.mtl", "map_Kd a.png"),
        ("used.mtl", "map_Kd ./a.png"),
        ("used.mtl", "map_Kd c.png"),
    ] {
        assert_eq!(notes(library, picture, true), [""; 0], "{library} {picture}");
    }
}

#[test]
fn lines_before_the_first_newmtl_are_counted() {
    let notes = notes_of("usemtl a", "# head\n\nKd 0 1 0\nmap_Kd none.png\nd 0.5\nnewmtl a\nKd 1 0 0\n");
    assert_eq!(notes.len(), 1, "{notes:?}");
    assert!(notes[0].ends_with("m.mtl:3: lines before the first newmtl are not read (3 lines)"), "{notes:?}");
}

#[test]
fn lines_that_replace_another_value_are_counted() {
    let first = "newmtl a\nKd 1 0 0\nKd 0 1 0\nmap_Kd a.png\nmap_Kd b.png\nKd 0 1 0\nNs 1\n";
    let mtl = format!("{first}newmtl b\nKd 1 0 0\nKd 1.0 0 0\nNs 2\n");
    let notes = notes_of("usemtl a\nf 1 2 3\nusemtl b", &mtl);
    let expected = "m.mtl:3: a later line replaces another value in the same material: Kd, map_Kd (2 lines)";
    assert!(notes.len() == 2 && notes[0].ends_with(expected), "the second is on b.png: {notes:?}");
    for line in ["Ks 1\nKs 0", "illum 1\nillum 2", "Ke 1\nke 2", "map_d a.png\nmap_d b.png"] {
        let replaced = |material: &str| {
            let mut notes = notes_of(&format!("usemtl {material}"), &format!("newmtl a\n{line}\nnewmtl b\n"));
            notes.retain(|note| note.contains("replaces another value"));
            notes.len()
        };
        assert_eq!((replaced("a"), replaced("b")), (1, 0), "{line}");
    }
}

#[test]
fn materials_with_several_definitions_that_differ_are_counted() {
    let several_of = |obj: &str, mtl: &str| {
        let mut notes = notes_of(obj, mtl);
        notes.retain(|note| note.contains("several definitions"));
        // The file is in a temporary folder, whose name is not known.
        let without_folder = |note: &String| {
            note.split_once("last one in ")
                .map(|(start, path)| format!("{start}last one in {}", path.rsplit('/').next().unwrap()))
        };
        notes.iter().filter_map(without_folder).collect::<Vec<_>>()
    };
    let several = |mtl: &str| several_of("usemtl a\nf 1 2 3\nusemtl b", mtl);
    let one = "1 material has several definitions that differ: only one definition per material is used \
               (for `a`, the last one in m.mtl)";
    let two = "2 materials have several definitions that differ: only one definition per material is used \
               (for example, for `a`, the last one in m.mtl)";
    let cases: [(&str, &[&str]); 8] = [
        ("newmtl a\nKd 1\nnewmtl a\nKd 0\n", &[one]),
        ("newmtl a\nKd 1\nnewmtl a\nKd 1.0\n", &[]),
        ("newmtl a\nmap_Kd a.png\nnewmtl a\nmap_Kd a.png\n", &[]),
        ("newmtl a\nmap_Kd a.png\nnewmtl a\nmap_Kd b.png\n", &[one]),
        ("newmtl a\nd 0.5\nnewmtl a\n", &[one]),
        ("newmtl a # one\nKd 1\nnewmtl a # two\nKd 0\n", &[one]),
        ("newmtl a\nKd 0.5\nnewmtl a # one\nKd 1\nnewmtl a # two\nKd 0\n", &[]),
        ("newmtl a\nnewmtl b\nnewmtl b\nKd 1\nnewmtl a\nKd 1\n", &[two]),
    ];
    for (mtl, expected) in cases {
        assert_eq!(several(mtl), expected, "{mtl}");
    }
    assert_eq!(several_of("usemtl b", cases[7].0), [one.replace("`a`", "`b`")], "`a` is not used");
}

#[test]
fn parts_of_pictures_that_are_not_used_are_noted_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut texels = image::RgbaImage::new(2, 1);
    for name in ["clear.png", "clear2.png"] {
        texels.save(folder.path().join(name)).unwrap();
    }
    texels.pixels_mut().for_each(|texel| texel.0[3] = 255);
    texels.save(folder.path().join("opaque.png")).unwrap();
    let notes = |mtl: &str| {
        std::fs::write(folder.path().join("m.mtl"), mtl).unwrap();
        let permitted = Permitted { beyond: false, quotes: true, scaled: false };
        let faces = "usemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n";
        let text = format!("mtllib m.mtl\n{CORNERS}vt 0 0\n{faces}");
        parse("test.obj", Reach { folder: folder.path(), permitted }, text.as_bytes()).unwrap().notes
    };
    let one = "alpha of 1 texture is not used (`clear.png`): without a map_d, a surface has no holes";
    let two =
        "alpha of 2 textures is not used (for example `clear.png`): without a map_d, a surface has no holes";
    let cases: [(&str, &[&str]); 6] = [
        ("newmtl a\nmap_Kd clear.png\nnewmtl b\nmap_Kd -clamp on clear.png\n", &[one]),
        // The alpha of an emission texture (`map_Ke`) causes no note, since nobody expects it to make holes.
        ("newmtl a\nmap_Ke clear.png\nnewmtl b\n", &[]),
        ("newmtl a\nmap_Kd clear.png\nnewmtl b\nmap_Kd clear2.png\n", &[two]),
        ("newmtl a\nmap_Kd opaque.png\nnewmtl b\n", &[]),
        ("newmtl a\nmap_Kd clear.png\nmap_d clear.png\nnewmtl b\n", &[]),
        ("newmtl a\nmap_Kd clear.png\nmap_d clear.png\nnewmtl b\nmap_Kd clear.png\n", &[one]),
    ];
    for (mtl, expected) in cases {
        assert_eq!(notes(mtl), expected, "{mtl}");
    }
    for (name, alphas) in [("half.png", [160, 160]), ("hole.png", [0, 255])] {
        texels.pixels_mut().zip(alphas).for_each(|(texel, alpha)| texel.0[3] = alpha);
        texels.save(folder.path().join(name)).unwrap();
    }
    let partial =
        "partial opacity of 1 texture is not used (`half.png`): every point is either opaque or a hole";
    assert_eq!(notes("newmtl a\nmap_d half.png\nnewmtl b\nmap_d half.png\n"), [partial]);
    assert_eq!(notes("newmtl a\nmap_d hole.png\nnewmtl b\n"), [""; 0]);
    let black = |key: &str, materials: &str| {
        format!(
            "{key} 0 0 0 beside map_{key} is read as {key} 1 1 1, since black would hide the texture ({materials})"
        )
    };
    assert_eq!(notes("newmtl a\nKd 0 0 0\nmap_Kd opaque.png\nnewmtl b\n"), [black("Kd", "1 material")]);
    let both = "Kd 0\nKe 0\nmap_Kd opaque.png\nmap_Ke opaque.png\n";
    let noted = notes(&format!("newmtl a\n{both}newmtl b\n{both}"));
    assert_eq!(noted, [black("Kd", "2 materials"), black("Ke", "2 materials")]);
    let missing = notes("newmtl a\nKd 0 0 0\nmap_Kd none.png\nnewmtl b\nKd 0 0 0\nmap_d opaque.png\n");
    assert!(missing.len() == 1 && missing[0].contains("`none.png` cannot be read"), "{missing:?}");
}

#[test]
fn a_material_file_is_read_once_however_often_it_is_named() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.mtl"), "newmtl x\nKd nan\n").unwrap();
    let reach =
        Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes: true, scaled: false } };
    let text = format!("mtllib a.mtl\nmtllib a.mtl\nmtllib ./a.mtl a.mtl\nusemtl x\n{CORNERS}f 1 2 3\n");
    let file = parse("test.obj", reach, text.as_bytes()).unwrap();
    assert_eq!((file.mesh.materials.len(), file.notes.len()), (2, 1), "{:?}", file.notes);
}

#[test]
fn of_several_material_files_the_last_line_counts_and_its_first_file() {
    let folder = tempfile::tempdir().unwrap();
    for (name, colour) in [("a", 0.25), ("b", 0.5)] {
        std::fs::write(folder.path().join(format!("{name}.mtl")), format!("newmtl x\nKd {colour}\n"))
            .unwrap();
    }
    std::fs::write(folder.path().join("c.mtl"), "newmtl x\nKd 0.75\nnewmtl x\nKd 1\n").unwrap();
    let reach =
        Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes: true, scaled: false } };
    for (lines, expected) in [
        ("mtllib a.mtl b.mtl", 0.25),
        ("mtllib b.mtl a.mtl", 0.5),
        ("mtllib a.mtl\nmtllib b.mtl", 0.5),
        ("mtllib a.mtl\nmtllib b.mtl\nmtllib a.mtl", 0.25),
        ("mtllib b.mtl\nmtllib none.mtl a.mtl b.mtl", 0.25),
        ("mtllib c.mtl a.mtl", 1.0),
    ] {
        let text = format!("{lines}\nusemtl x\n{CORNERS}f 1 2 3\n");
        let mesh = parse("test.obj", reach, text.as_bytes()).unwrap().mesh;
        assert_eq!(mesh.material(&mesh.triangles[0]).lambertian.x, expected, "{lines}");
    }
}

#[test]
fn a_material_has_its_three_channels_or_the_default() {
    let folder = tempfile::tempdir().unwrap();
    let reach = || Reach {
        folder: folder.path(),
        permitted: Permitted { beyond: false, quotes: true, scaled: false },
    };
    let read = |line: &str| {
        std::fs::write(folder.path().join("m.mtl"), format!("newmtl a\n{line}\n")).unwrap();
        let text = format!("mtllib m.mtl\n{CORNERS}usemtl a\nf 1 2 3\n");
        let file = parse("test.obj", reach(), text.as_bytes()).unwrap();
        (*file.mesh.material(&file.mesh.triangles[0]), file.notes)
    };
    assert_eq!(read("Kd 0.25 0.5 0.75").0.lambertian, Vec3::new(0.25, 0.5, 0.75));
    assert_eq!(read("Ks 0.25 0.5 0.75").0.glossy, Vec3::new(0.25, 0.5, 0.75));
    let (colour, shininess) = ("one or three numbers from 0 to 1e6", "a number from 0 to 1e6");
    let grey = "Without Kd, the diffuse reflectance is 0.8 (grey), or 1 if there is a texture";
    let dull = "Without Ks, there is no highlight";
    let usual = "Without Ns, the shininess is 100";
    for (line, found, expected, instead) in [
        ("Kd 1 2", "Kd with 2 numbers", colour, grey),
        ("Kd", "Kd with 0 numbers", colour, grey),
        ("Kd 0.5 -1 0", "`-1` in Kd", colour, grey),
        ("Kd nan nan nan", "`nan` in Kd", colour, grey),
        ("Kd 1.#QNAN 0 0", "`1.#QNAN` in Kd", colour, grey),
        ("Kd 3e38", "`3e38` in Kd", colour, grey),
        (
            "Kd spectral a.rfl 1",
            "`Kd spectral` is a form of colours that raycl does not support",
            colour,
            grey,
        ),
        ("Kd xyz .1 .2 .3", "`Kd xyz` is a form of colours that raycl does not support", colour, grey),
        ("Ks x", "`x` in Ks", colour, dull),
        ("Ks 1\nNs -1", "`-1` in Ns", shininess, usual),
        ("Ks 1\nNs 1e39", "`1e39` in Ns", shininess, usual),
        ("Ks 1\nNs 1.#INF", "`1.#INF` in Ns", shininess, usual),
        ("Ks 1\nNs", "Ns with 0 numbers", shininess, usual),
    ] {
        let (material, notes) = read(line);
        let number = 1 + line.lines().count();
        let end =
            format!("m.mtl:{number}: {found} (expected {expected}). raycl ignores 1 such line. {instead}.");
        assert!(notes.len() == 1 && notes[0].ends_with(&end), "{line}: {notes:?}");
        let glossy = Vec3::splat(if line.starts_with("Ks 1") { 1.0 } else { 0.0 });
        assert_eq!((material.lambertian, material.glossy), (Vec3::splat(0.8), glossy), "{line}");
        assert!(glossy == Vec3::ZERO || material.shininess == 100.0, "{line}");
    }
}

#[test]
fn lines_with_unusable_values_are_counted_by_kind_and_the_others_are_used() {
    let mtl = "newmtl a\nKd 0.5\nKd x\nKe nan 0 0\nd inf\nTf spectral a.rfl\nKd xyz 1 1 1\nd -halo 0.5\nTr 0 x\nnewmtl b\nKd -1\nKd y\n";
    let mut notes = notes_of("usemtl a\nf 1 2 3\nusemtl b", mtl);
    notes.retain(|note| note.contains("raycl ignores "));
    let kinds = [
        ("m.mtl:3: `x` in Kd (expected ", "raycl ignores 3 such lines. "),
        (
            "m.mtl:4: `nan` in Ke (expected one or three numbers from 0 to 1e6). ",
            "raycl ignores 1 such line. Without Ke, the surface emits no light",
        ),
        (
            "m.mtl:5: `inf` in d (expected a finite number). ",
            "raycl ignores 1 such line. raycl does not support transparency: ",
        ),
        ("m.mtl:7: `Kd xyz` is a form", "raycl ignores 1 such line. "),
    ];
    assert_eq!(notes.len(), kinds.len(), "{notes:?}");
    for (note, (start, end)) in notes.iter().zip(kinds) {
        assert!(note.contains(start) && note.contains(end), "{note}");
    }
    let file = with_materials("usemtl a", mtl);
    assert_eq!(file.mesh.material(&file.mesh.triangles[0]).lambertian, Vec3::splat(0.5));
    let of_used = notes_of("usemtl b", mtl);
    let second =
        "m.mtl:11: `-1` in Kd (expected one or three numbers from 0 to 1e6). raycl ignores 2 such lines. ";
    assert!(of_used.len() == 1 && of_used[0].contains(second), "{of_used:?}");
}

/// An MTL file outside the mesh's folder may be somebody else's, so its text is not quoted.
#[test]
fn a_mistake_in_a_material_file_is_quoted_only_inside_the_meshs_folder() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    for path in [folder.path(), &inner] {
        let mtl = "newmtl a\nKd secret\nnewmtl secret\nKd 1\nnewmtl secret\n";
        std::fs::write(path.join("a.mtl"), mtl).unwrap();
    }
    let notes = |library: &str, quotes: bool| {
        let reach = Reach { folder: &inner, permitted: Permitted { beyond: true, quotes, scaled: false } };
        let text = format!("mtllib {library}\n{CORNERS}usemtl a\nf 1 2 3\nusemtl secret\nf 1 2 3\n");
        parse("test.obj", reach, text.as_bytes()).unwrap().notes.concat()
    };
    assert!(notes("a.mtl", true).contains("secret"));
    for (library, quotes, name) in
        [("../a.mtl", true, "a.mtl"), ("a.mtl", false, "its MTL file"), ("../a.mtl", false, "its MTL file")]
    {
        let note = notes(library, quotes);
        let start = format!(
            "{name}:2: a line with Kd cannot be used (expected one or three numbers from 0 to 1e6). "
        );
        assert!(note.contains(&start) && !note.contains("secret"), "{note}");
    }
}

#[test]
fn a_map_d_that_names_another_picture_than_map_kd_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let tga = crate::image::tga([4, 7, 10, 50], [0; 2], 2);
    std::fs::write(folder.path().join("undefined.tga"), tga).unwrap();
    for name in ["dark.png", "other.png"] {
        image::RgbImage::from_pixel(1, 1, image::Rgb([10, 7, 4])).save(folder.path().join(name)).unwrap();
    }
    let reach =
        Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes: true, scaled: false } };
    // The other material comes first, and its mask is made of brightness.
    let read = |colour: &str, mask: &str| {
        let mtl = format!("newmtl b\nmap_d {mask}\nnewmtl a\nmap_Kd {colour}\nmap_d {mask}\n");
        std::fs::write(folder.path().join("m.mtl"), mtl).unwrap();
        let faces = "vt 0 0\nusemtl b\nf 1/1 2/1 3/1\nusemtl a\nf 1/1 2/1 3/1\n";
        parse("test.obj", reach, format!("mtllib m.mtl\n{CORNERS}{faces}").as_bytes()).unwrap().notes
    };
    for (colour, mask) in [
        ("dark.png", "dark.png"),
        ("undefined.tga", "undefined.tga"),
        ("./dark.png", "dark.png"),
        ("dark.png", "C:\\maps\\dark.png"),
    ] {
        let note = format!(
            "mask of 1 texture is not used (`{mask}`): map_Kd names the same picture, which is opaque"
        );
        assert!(read(colour, mask).contains(&note), "{:?}", read(colour, mask));
    }
    assert_eq!(read("dark.png", "other.png"), [""; 0]);
}

#[test]
fn a_picture_that_is_missing_is_noted_once_and_one_of_its_name_in_the_folder_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::new(1, 1).save(folder.path().join("dot.png")).unwrap();
    let reach =
        Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes: true, scaled: false } };
    let read = |mtl: &str, faces: &str| {
        std::fs::write(folder.path().join("m.mtl"), mtl).unwrap();
        let text = format!("mtllib m.mtl\n{CORNERS}vt 0 0\nusemtl a\n{faces}");
        let file = parse("test.obj", reach, text.as_bytes()).unwrap();
        (file.mesh.textures.list.len(), file.notes)
    };
    let face = "f 1/1 2/1 3/1\n";
    for (name, named) in [("C:\\work\\dot.png", 1), ("/home/somebody/dot.png", 1), ("dot.png", 0)] {
        let (count, notes) = read(&format!("newmtl a\nmap_Kd {name}\n"), face);
        assert_eq!((count, notes.len()), (1, named), "{name}");
        let expected = format!("for 1 texture, another file may be meant: `dot.png` is used, not `{name}`");
        assert!(notes.iter().all(|note| *note == expected), "{notes:?}");
    }
    let (count, notes) = read("newmtl a\nmap_Kd none.png\nmap_d no.png\n", face);
    assert_eq!((count, notes.len()), (0, 2), "{notes:?}");
    assert!(notes[0].contains("m.mtl:2: texture `none.png` cannot be read ("), "{notes:?}");
    assert!(notes[0].ends_with("): its material's own colour is used"), "{notes:?}");
    assert!(notes[1].contains("m.mtl:3: mask `no.png` cannot be read ("), "{notes:?}");
    assert!(notes[1].ends_with("): its surface has no holes"), "{notes:?}");
    let (_, notes) = read("newmtl a\nmap_Kd none.png\nmap_d none.png\n", face);
    let starts =
        ["m.mtl:2: texture `none.png` cannot be read (", "m.mtl:3: mask `none.png` cannot be read ("];
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert!(notes.iter().zip(starts).all(|(note, start)| note.contains(start)), "{notes:?}");
    let textured = "newmtl a\nmap_Kd dot.png\n";
    let one = "1 triangle has a texture but no texture coordinates: its material's own colour is used";
    assert_eq!(read(textured, "f 1 2 3\nf 1/1 2/1 3/1\n").1, [one]);
    let two = "2 triangles have a texture but no texture coordinates: their materials' own colour is used";
    assert_eq!(read(textured, "f 1 2 3\nf 1/1 2/1 3\nf 1/1 2/1 3/1\n").1, [two]);
}

#[test]
fn triangles_on_which_an_emission_texture_gives_no_light_are_counted_in_the_note() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::new(1, 1).save(folder.path().join("dot.png")).unwrap();
    let library =
        "newmtl lamp\nKe 1 1 1\nmap_Ke dot.png\nnewmtl wall\nmap_Kd dot.png\nnewmtl fence\nmap_d mask.png\n";
    std::fs::write(folder.path().join("m.mtl"), library).unwrap();
    image::RgbImage::new(2, 1).save(folder.path().join("mask.png")).unwrap();
    let reach =
        Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes: true, scaled: false } };
    let notes = |faces: &str| {
        let text = format!("mtllib m.mtl\n{CORNERS}vt 0 0\n{faces}usemtl lamp\nf 1/1 2/1 3/1\n");
        parse("test.obj", reach, text.as_bytes()).unwrap().notes
    };
    let one = "1 triangle has a texture but no texture coordinates: its material's own colour is used; the emission \
               texture gives no light on it";
    assert_eq!(notes("usemtl lamp\nf 1 2 3\n"), [one]);
    let three = "3 triangles have a texture but no texture coordinates: their materials' own colour is used; the \
                 emission texture gives no light on 2 of them";
    assert_eq!(notes("usemtl wall\nf 1 2 3\nusemtl lamp\nf 1 2 3\nf 1 2 3\n"), [three]);
    let masked = "1 triangle has a texture but no texture coordinates: its material's own colour is used; the mask \
                  makes no holes in it";
    assert_eq!(notes("usemtl fence\nf 1 2 3\n"), [masked]);
}

#[test]
fn of_many_files_that_are_missing_the_first_are_noted_and_the_others_counted() {
    let folder = tempfile::tempdir().unwrap();
    let all = |of: fn(usize) -> String| (0..1_000).map(of).collect::<String>();
    std::fs::write(
        folder.path().join("m.mtl"),
        all(|number| format!("newmtl a{number}\nmap_Kd none{number}.png\n")),
    )
    .unwrap();
    let faces = all(|number| format!("usemtl a{number}\nf 1/1 2/1 3/1\n"));
    let others = all(|number| format!("mtllib no{number}.mtl\n"));
    let text = format!("{others}mtllib m.mtl\n{CORNERS}vt 0 0\n{faces}");
    let permitted = Permitted { beyond: false, quotes: true, scaled: false };
    let reach = Reach { folder: folder.path(), permitted };
    let notes = parse("test.obj", reach, text.as_bytes()).unwrap().notes;
    assert_eq!(notes.len(), 8, "{notes:?}");
    assert!(notes[2].starts_with("MTL file `no2.mtl` cannot be read ("), "{notes:?}");
    assert_eq!(notes[3], "997 more MTL files cannot be used either");
    assert!(notes[6].contains("m.mtl:6: texture `none2.png` cannot be read ("), "{notes:?}");
    assert_eq!(notes[7], "997 more textures cannot be used either");
}

/// Returns the notes on a mesh of six triangles with the materials `a0` to `a5`. `material` returns the text
/// of a material in the MTL file.
fn notes_on_six(material: impl Fn(usize) -> String) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.mtl"), (0..6).map(material).collect::<String>()).unwrap();
    let faces: String = (0..6).map(|number| format!("usemtl a{number}\nf 1/1 2/1 3/1\n")).collect();
    let permitted = Permitted { beyond: false, quotes: true, scaled: false };
    let reach = Reach { folder: folder.path(), permitted };
    let text = format!("mtllib m.mtl\n{CORNERS}vt 0 0\n{faces}");
    parse("test.obj", reach, text.as_bytes()).unwrap().notes
}

#[test]
fn missing_pictures_whose_long_names_begin_alike_are_counted_separately_and_named_by_their_ends() {
    let path = |number: usize| format!("C:\\Users\\somebody\\Documents\\Road Objects\\Lights\\t{number}.png");
    let material = |number: usize| format!("newmtl a{number}\nmap_Kd {}\n", path(number));
    let notes = notes_on_six(material);
    assert_eq!(notes.len(), 4, "{notes:?}");
    for (number, note) in notes[..3].iter().enumerate() {
        let start = format!("m.mtl:{}: texture `{}` cannot be read (", 2 * number + 2, path(number));
        assert!(note.contains(&start), "{note}");
    }
    assert_eq!(notes[3], "3 more textures cannot be used either");
}

#[test]
fn a_file_that_many_materials_name_is_noted_once() {
    let material = |number: usize| {
        let file = if number == 5 { "leaf.png" } else { "bark.png" };
        format!("newmtl a{number}\nmap_Kd {file}\n")
    };
    let notes = notes_on_six(material);
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert!(notes[0].contains("m.mtl:2: texture `bark.png`"), "{notes:?}");
    assert!(notes[1].contains("m.mtl:12: texture `leaf.png`"), "{notes:?}");
}

#[test]
fn a_texture_without_a_file_or_without_the_numbers_of_an_option_is_noted_by_its_line() {
    let [file, numbers] = ["the name of a picture", "one to three finite numbers"]
        .map(|expected| format!(" (expected {expected}). raycl ignores 1 such line. Without "));
    let [colour, mask] = ["map_Kd, the material's own colour is used", "map_d, the surface has no holes"];
    for (line, found, expected, instead) in [
        ("map_Kd", "map_Kd without a file", &file, colour),
        ("map_Kd -s 1 1 1 # none", "map_Kd without a file", &file, colour),
        ("map_d -mm 0 1", "map_d without a file", &file, mask),
        ("map_Kd -s nan a.png", "`nan` after map_Kd -s", &numbers, colour),
        ("map_Kd -o 1 inf a.png", "`inf` after map_Kd -o", &numbers, colour),
        ("map_d -s x a.png", "`x` after map_d -s", &numbers, mask),
    ] {
        let notes = notes_of("usemtl a", &format!("newmtl a\n{line}\n"));
        let expected = format!("m.mtl:2: {found}{expected}{instead}.");
        assert!(notes.len() == 1 && notes[0].ends_with(&expected), "{line}: {notes:?}");
    }
}

#[test]
fn a_mask_or_an_emission_texture_that_is_placed_differently_is_noted() {
    let places = |mtl: &str| -> Vec<String> {
        let notes = notes_of("usemtl a", &format!("newmtl a\n{mtl}"));
        notes.into_iter().filter(|note| note.contains("different scales, offsets or wrap modes")).collect()
    };
    let cases = [
        ("map_Kd -s 2 2 a.png\nmap_d -s 2 2 b.png\nmap_Ke -s 2 2 c.png\n", ""),
        ("map_Kd -s 2 2 a.png\nmap_d b.png\n", "(map_d)"),
        ("map_Kd a.png\nmap_Ke -clamp on c.png\n", "(map_Ke)"),
        ("map_d b.png\nmap_Ke -o 0.5 c.png\n", "(map_Ke)"),
        ("map_Kd -s 2 2 a.png\nmap_d b.png\nmap_Ke c.png\n", "(map_Ke 1, map_d 1)"),
    ];
    for (mtl, keywords) in cases {
        let notes = places(mtl);
        assert_eq!(notes.len(), usize::from(!keywords.is_empty()), "{mtl}: {notes:?}");
        assert!(notes.iter().all(|note| note.contains(keywords)), "{mtl}: {notes:?}");
    }
}

#[test]
fn only_the_last_line_of_a_texture_counts_with_its_options() {
    let mtl = "newmtl a\nmap_Kd -mm 0 2 a.png\nmap_Kd a.png\nmap_d -mm 0 2 b.png\n";
    let notes = notes_of("usemtl a", mtl);
    let options: Vec<_> = notes.iter().filter(|note| note.contains("options of textures")).collect();
    assert!(options.len() == 1 && options[0].contains(" (map_d -mm), "), "{notes:?}");
}

#[test]
fn values_after_those_of_a_colour_or_a_shininess_are_noted() {
    let file = with_materials("usemtl a", "newmtl a\nKd 0.25 0.5 0.75 1\nKs 1 1 1 extra\nNs 10 20\n");
    let material = file.mesh.material(&file.mesh.triangles[0]);
    assert_eq!((material.lambertian, material.glossy), (Vec3::new(0.25, 0.5, 0.75), Vec3::ONE));
    assert_eq!(material.shininess, 10.0);
    let expected =
        "m.mtl:2: values after the third of Kd, Ks or Ke, or after the first of Ns, are not read (3 lines)";
    assert!(file.notes.len() == 1 && file.notes[0].ends_with(expected), "{:?}", file.notes);
    let expected = "m.mtl:2: a Kd or Ks of 16 or more is read as a reflectance (1 is white), not as a channel from 0 \
                    to 255 (2 lines)";
    let bright = notes_of("usemtl a", "newmtl a\nKd 200 0 0\nKs 16\nKe 200 0 0\n");
    assert!(bright.len() == 1 && bright[0].ends_with(expected), "{bright:?}");
    let usual = notes_of("usemtl a", "newmtl a\nKd 1.6 15 0.5 # 20\nKs 1 1 1 # white\nNs 10\n");
    assert_eq!(usual, Vec::<String>::new());
}

#[test]
fn a_value_after_the_third_of_a_colour_is_no_channel_from_0_to_255() {
    let notes = notes_of("usemtl a", "newmtl a\nKd 1 1 1 20\n");
    assert!(notes.len() == 1 && notes[0].contains("values after the third of Kd"), "{notes:?}");
}
