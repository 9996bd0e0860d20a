//! Tests with the bytes of small files of many formats.

use super::*;
use crate::reader::Damaged;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write as _;

/// Recognises a file with these bytes. Returns the name of the file's format, or a word for the file's type.
fn called(bytes: &[u8]) -> &'static str {
    match FileType::of(bytes, bytes.len() as u64) {
        FileType::Foreign(Foreign { name, .. }) => name,
        FileType::Mesh(format) => format.name(),
        FileType::Toml => "toml",
        FileType::Utf16 => "utf-16",
        FileType::Unclear => "unclear",
    }
}

/// Returns bytes padded with zeros to a length.
fn padded(bytes: &[u8], length: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes.resize(length, 0);
    bytes
}

/// Returns a binary STL file of one triangle whose header begins like an ASCII file's.
fn binary_stl() -> Vec<u8> {
    let mut bytes = padded(b"solid made by a program", 80);
    bytes.extend(1_u32.to_le_bytes());
    padded(&bytes, 84 + 50)
}

/// Returns the outermost chunk and the version chunk of a 3DS file.
fn scene_3ds() -> Vec<u8> {
    padded(b"MM\x10\0\0\0\x02\0\x0a\0\0\0\x03\0\0\0", 16)
}

#[test]
fn endings_of_scenes_and_meshes() {
    let may_be = |name: &str| may_be_scene(Path::new(name));
    assert!(["a.toml", "a.TOML.gz", "a.obj", "a.Glb", "a.stl.gz"].into_iter().all(may_be));
    assert!(!["a.mtl", "a.png.gz", "toml", "a"].into_iter().any(may_be));
}

#[test]
fn meshes_and_scenes_of_other_formats() {
    let cases: &[(&[u8], &str)] = &[
        (b"ply\nformat ascii 1.0\nelement vertex 3\n", "a PLY mesh"),
        (b"ply\r\nformat ascii 1.0\r\n", "a PLY mesh"),
        (b"ply\nformat binary_little_endian 1.0\nend_header\n\0\0\x80\x3f", "a PLY mesh"),
        (b"solid cube\n facet normal 0 0 1\n  outer loop\n", "an STL mesh"),
        (b"solid\nendsolid\n", "an STL mesh"),
        (b"SOLID CUBE\n FACET NORMAL 0 0 1\n  OUTER LOOP\n", "an STL mesh"),
        (&binary_stl(), "an STL mesh"),
        (br#"{"asset":{"version":"2.0"},"scene":0}"#, "a glTF scene (JSON)"),
        (b"{\n  \"accessors\": [ { \"bufferView\": 0 } ]", "a glTF scene (JSON)"),
        (b"glTF\x02\0\0\0\x10\0\0\0", "a binary glTF scene (GLB)"),
        (b"OFF\n3 1 0\n0 0 0\n", "an OFF mesh"),
        (b"# made by hand\nCOFF\n3 1 0\n", "an OFF mesh"),
        (b"Kaydara FBX Binary  \0\x1a\0", "an FBX scene (binary)"),
        (b"; FBX 7.3.0 project file\n", "an FBX scene (ASCII)"),
        (b"<?xml version=\"1.0\"?>\n<COLLADA xmlns=\"x\">", "a COLLADA scene"),
        (&scene_3ds(), "a 3DS scene"),
        (b"BLENDER-v279REND", "a Blender file"),
        (b"#usda 1.0\n(\n", "a USD scene (ASCII, usda)"),
        (b"PXR-USDC\0\x08", "a USD scene (binary, usdc)"),
        (b"PK\x03\x04\x0a\0\0\0\0\0scene.usdc", "a USD package (usdz)"),
        (b"Ogawa\xff\0\x01", "an Alembic scene"),
        (b"\x89HDF\r\n\x1a\n\0", "an HDF5 file, such as an older Alembic scene"),
        (b"# vtk DataFile Version 3.0\nx\nASCII\n", "a VTK file"),
        (b"<VTKFile type=\"PolyData\">", "a VTK file (XML)"),
        (b"<?xml version='1.0'?><!DOCTYPE X3D PUBLIC 'x' 'y'><X3D>", "an X3D scene"),
        (b"#VRML V2.0 utf8\n", "a VRML scene"),
        (b"PK\x03\x04\x14\0\0\0\x08\x003D/3dmodel.model", "a 3MF model"),
        (b"<!-- <b> --><scene version=\"0.6.0\">", "a Mitsuba scene (XML)"),
        (b"# pbrt\nLookAt 0 0 0 0 0 1 0 1 0\n", "a pbrt scene"),
        (b"Film \"rgb\" \"integer xresolution\" [ 400 ]\n", "a pbrt scene"),
        (b"  0\nSECTION\n  2\nHEADER\n", "a DXF drawing"),
        (b"# Blender MTL File\nnewmtl a\nKd 1 1 1\n", "an MTL material file"),
        (b"newmtl a\nKd 1 1 1\nusemtl a\nv 0 0 0\nv 1 0 0\n", "an OBJ mesh"),
        (b"newmtl v\r\nKd 1 1 1\r\n\tv\t0 0 0\r\n", "an OBJ mesh"),
    ];
    for (bytes, name) in cases {
        assert_eq!(called(bytes), *name, "{:?}", String::from_utf8_lossy(bytes));
    }
}

/// Returns a first line of an IGES file.
fn iges() -> Vec<u8> {
    format!("{:72}S{:7}\n", "a part", 1).into_bytes()
}

/// Returns bytes with a signature at an offset.
fn at(offset: usize, signature: &[u8]) -> Vec<u8> {
    [padded(b"", offset).as_slice(), signature].concat()
}

#[test]
fn point_clouds_models_of_cad_and_simulations_and_volumes() {
    let cases: &[(&[u8], &str)] = &[
        (b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "a Gmsh mesh (MSH)"),
        (b"MeshVersionFormatted 2\nDimension 3\n", "a Medit mesh"),
        (b"*Heading\n a job\n*Node\n1, 0., 0., 0.\n", "an Abaqus mesh (INP)"),
        (b"*NODE, NSET=ALL\n1, 0., 0., 0.\n", "an Abaqus mesh (INP)"),
        (b"AC3Db\nMATERIAL \"\" rgb 1 1 1\n", "an AC3D model"),
        (b"*3DSMAX_ASCIIEXPORT 200\n", "a 3ds Max scene (ASE)"),
        (b"VERSION .7\nFIELDS x y z\n", "a point cloud (PCD)"),
        (b"LASF\0\0\0\0", "a point cloud (LAS or LAZ)"),
        (b"ISO-10303-21;\nHEADER;\n", "a STEP model"),
        (&iges(), "an IGES model"),
        (b"PK\x03\x04\x14\0\0\0\x08\0Document.xml", "a FreeCAD model"),
        (b"\xff\xfe\xff\x0eS\0k\0e\0t\0c\0h\0U\0p\0 \0", "a SketchUp model"),
        (b"ObjectType = Image\nNDims = 3\n", "a volume (MetaImage)"),
        (&at(344, b"n+1\0"), "a volume (NIfTI)"),
        (&at(208, b"MAP "), "a volume (MRC or CCP4)"),
    ];
    for (bytes, name) in cases {
        assert_eq!(called(bytes), *name, "{:?}", String::from_utf8_lossy(bytes));
    }
}

#[test]
fn text_and_bytes_without_a_signature_are_named_by_their_extension_or_as_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let opened = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        match Opened::at(&path).unwrap().filetype {
            FileType::Foreign(Foreign { name, .. }) => name,
            FileType::Unclear => "unclear",
            other => panic!("{name}: {other:?}"),
        }
    };
    let numbers = "a list of numbers, such as points without triangles";
    for text in ["0 0 1\n", "1.5,-2e3,0.25,7\n1,2,3,4", "3\n0 0 1\n", "# points\nx;y;z\n1;2;3\n"] {
        assert_eq!(opened("a.txt", text.as_bytes()), numbers, "{text}");
        assert_eq!(opened("a.obj", text.as_bytes()), "unclear", "{text}");
    }
    for text in
        ["", "\n", "3\n", "1 2\n3 4\n", "x y z\na b c\n", "some text of words\n1 2 3\n", "0 0 1\n0 0 x\n"]
    {
        assert_eq!(opened("a.txt", text.as_bytes()), "unclear", "{text}");
    }
    assert_eq!(opened("a.xyz", b"C 0 0 1\n"), "a list of points or atoms (XYZ)");
    assert_eq!(opened("a.splat", b"\x01\x02\0\x03"), "a scene of Gaussian splats");
    assert_eq!(opened("a.blend", b"\x28\xb5\x2f\xfd\x04\0"), "a Blender file");
    assert_eq!(opened("a.splat", b"GIF8"), "a GIF picture");
    assert_eq!(opened("a.xyz", b" \n"), "unclear", "empty files have a message of their own");
}

#[test]
fn pictures_archives_programs_and_other_text() {
    let cases: &[(&[u8], &str)] = &[
        (b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR", "a PNG picture"),
        (b"\xff\xd8\xff\xe0\0\x10JFIF", "a JPEG picture"),
        (b"\x76\x2f\x31\x01\x02\0\0\0", "an EXR picture"),
        (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", "an HDR picture"),
        (b"RIFF\x24\0\0\0WEBPVP8 ", "a WebP picture"),
        (b"MM\0*\0\0\0\x08", "a TIFF picture"),
        (b"<svg xmlns=\"x\">", "an SVG picture"),
        (b"PK\x03\x04\x14\0\0\0\x08\0mesh.obj", "a zip archive"),
        (b"\x1f\x8b\x08\0\0\0\0\0", "a gzip archive"),
        (b"\x28\xb5\x2f\xfd\x04\0", "a zstd archive"),
        (b"\x7fELF\x02\x01\x01\0", "a program or library (ELF)"),
        (b"\x01\x02\0\x03 nothing known", "a binary file of an unknown kind"),
        (b"{\"outcome\": \"measured\"}\n", "a JSON file"),
        (b"[1, 2]", "a JSON file"),
        (b"[[1, 2], [3, 4]]", "a JSON file"),
        (b"<?xml version='1.0'?><other/>", "an XML file"),
        (b"<!DOCTYPE html><HTML><p>404", "a web page (HTML), perhaps the error page of a download"),
        (b"version https://git-lfs.github.com/spec/v1\noid", "a Git LFS pointer, not the file itself"),
        (b"\xff\xfev\0 \x000\0", "utf-16"),
        (b"\xfe\xff\0v\0 ", "utf-16"),
        (b"v\0 \x000\0 \x000\0\n\0", "utf-16"),
    ];
    for (bytes, name) in cases {
        assert_eq!(called(bytes), *name, "{:?}", String::from_utf8_lossy(bytes));
    }
}

#[test]
fn what_raycl_reads_is_not_taken_for_something_else() {
    let cases: &[(&[u8], &str)] = &[
        (b"# Blender v2.79\nmtllib a.mtl\no A\nv 0 0 0\n", "an OBJ mesh"),
        (b"\xef\xbb\xbfg name=other\nv 0 0 0\n", "an OBJ mesh"),
        (b"usemtl a=b\nv 0 0 0\r\nf 1 2 3", "an OBJ mesh"),
        (b"v 0 0 0 \0\nv 1 0 0\n", "an OBJ mesh"),
        (b"\r\r  f 1 2 3\r", "an OBJ mesh"),
        (b"# a scene\n\n[[object]]\nshape = \"sphere\"\n", "toml"),
        (b"[camera]\nz_near = 0.1\n", "toml"),
        (b"v = 1\n", "toml"),
        (b"solid = 1\n", "toml"),
        (b"camera.position = [0, 0, 1]\n", "toml"),
        (b"\"question\" = \"Is it {}?\"\n", "toml"),
        (b"question=\"<a>\"\n", "toml"),
        (b"", "unclear"),
        (b" \n\n# only a comment\n", "unclear"),
        (b"G\xe4nse, a note in Latin-1\nv 0 0 0\n", "unclear"),
    ];
    for (bytes, name) in cases {
        assert_eq!(called(bytes), *name, "{:?}", String::from_utf8_lossy(bytes));
    }
}

#[test]
fn a_signature_after_text_is_a_word_of_the_text() {
    for (at, word) in [(4, "ftyp"), (8, "WEBP"), (128, "DICM"), (208, "MAP "), (257, "ustar")] {
        let scene = format!("{:.<at$}{word}\n[[object]]\n", "#");
        let mesh = format!("{:.<at$}{word}\nv 0 0 0\n", "#");
        assert_eq!([called(scene.as_bytes()), called(mesh.as_bytes())], ["toml", "an OBJ mesh"], "{word}");
    }
    let header = "ply\nformat binary_little_endian 1.0\ncomment ";
    let binary_ply = format!("{header:.<208}MAP of a town\nend_header\n\0\0");
    assert_eq!(called(binary_ply.as_bytes()), "a PLY mesh");
}

#[test]
fn a_signature_after_binary_bytes_is_not_a_word() {
    let after = |bytes: &[u8], at: usize, signature: &[u8]| [&padded(bytes, at)[..], signature].concat();
    let cases: [(Vec<u8>, &str); 6] = [
        (b"RIFF\x24\x01\x02\x03WEBPVP8 ".to_vec(), "a WebP picture"),
        (b"\0\0\0\x20ftypheic".to_vec(), "a film or a picture (MP4, HEIC or AVIF)"),
        (b"FORM\0\x12AALWO2TAGS".to_vec(), "a LightWave object"),
        (after(b"", 128, b"DICM\x02\0"), "a volume (DICOM)"),
        (after(b"\x40\0\0\0", 208, b"MAP \x44\x44"), "a volume (MRC or CCP4)"),
        (after(b"mesh.obj", 257, b"ustar\x0000"), "a tar archive"),
    ];
    for (bytes, name) in cases {
        assert_eq!(called(&bytes), name);
    }
}

#[test]
fn every_signature_is_recognised_and_named_in_two_short_lines() {
    for &(at, bytes, name, _) in signatures::SIGNATURES {
        let mut file = padded(b"", at);
        file.extend_from_slice(bytes);
        assert_eq!(called(&file), name);
        let refusal = FileType::of(&file, file.len() as u64).refusal("mesh.xyz", Wanted::Scene);
        let Some(Error::Input(input)) = refusal else { panic!("{name} is read") };
        let help = input.help;
        assert!(input.message.starts_with(&format!("mesh.xyz is {name}, which")), "{}", input.message);
        assert!(help.starts_with("raycl reads scenes (TOML) and meshes (OBJ, PLY, STL, glTF)"), "{help}");
        assert!(input.message.len() < 100 && help.len() < 140 && !(input.message + &help).contains('\n'));
    }
}

#[test]
fn a_scene_and_an_experiment_are_told_apart() {
    let (scene, experiment) = ("[[object]]\nshape = \"sphere\"\n", "question = \"?\"\nscenes = []\n");
    let path = Path::new("a.toml");
    assert!(scene_instead(path, scene).is_some() && experiment_instead(path, experiment).is_some());
    for text in ["", "name = 1\n", "not toml", &format!("{experiment}{scene}"), "[package]\n"] {
        assert!(scene_instead(path, text).is_none() && experiment_instead(path, text).is_none(), "{text}");
    }
}

#[test]
fn a_file_that_was_mistaken_for_another_is_quoted_in_the_command_that_reads_it() {
    let (scene, experiment) = ("[[object]]\nshape = \"sphere\"\n", "question = \"?\"\nscenes = []\n");
    for (name, word) in [("my file", "'my file'"), ("-f", "./-f")] {
        let path = Path::new(name);
        let mesh = FileType::Mesh(MeshFormat::Stl).refusal(name, Wanted::Experiment);
        for (error, command) in [
            (scene_instead(path, scene), "render"),
            (experiment_instead(path, experiment), "run"),
            (mesh, "render"),
        ] {
            let error = error.unwrap();
            assert!(error.to_string().starts_with(&format!("{name} is a")), "{error}");
            assert!(error.remedy().starts_with(&format!("`raycl {command} {word}` ")), "{}", error.remedy());
        }
    }
}

#[test]
fn the_name_of_a_packed_mesh_says_its_format() {
    let format = |name: &str| MeshFormat::from_ending(Path::new(name));
    for name in ["part.stl", "part.stl.gz", "PART.STL.GZ"] {
        assert_eq!(format(name), Some(MeshFormat::Stl), "{name}");
    }
    assert_eq!([format("part.gz"), format("stl.gz"), format("part.stl.zip")], [None; 3]);
}

#[test]
fn a_packed_file_that_is_cut_off_or_changed_is_damaged() {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let whole = encoder.finish().unwrap();
    let [mut short, mut shorter, mut changed] = [(); 3].map(|()| whole.clone());
    short.truncate(whole.len() - 1);
    shorter.truncate(whole.len() - 12);
    changed[whole.len() - 8] ^= 1;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj.gz");
    for bytes in [short, shorter, changed] {
        std::fs::write(&path, bytes).unwrap();
        let error = Opened::at(&path).unwrap_err();
        assert!(
            Damaged::caused(&error) && error.to_string().starts_with("it cannot be unpacked ("),
            "{error}"
        );
    }
    std::fs::write(&path, whole).unwrap();
    assert_eq!(Opened::at(&path).unwrap().filetype, FileType::Mesh(MeshFormat::Obj));
    assert!(!Damaged::caused(&Opened::at(folder.path()).unwrap_err()));
}

#[test]
fn json_is_gltf_if_it_has_one_of_the_keys_of_gltf() {
    let of = |text: &str| FileType::of(text.as_bytes(), text.len() as u64);
    for text in [
        r#"{"asset": {"version": "2.0"}}"#,
        r#"{"bufferViews": []}"#,
        r#"{"buffers": [{"byteLength": 1}]}"#,
        r#"{"accessors": []}"#,
    ] {
        assert_eq!(of(text), FileType::Mesh(MeshFormat::Gltf), "{text}");
    }
    for text in ["{}", r#"{"asset": 1}"#, r#"{"version": 1}"#] {
        assert_ne!(of(text), FileType::Mesh(MeshFormat::Gltf), "{text}");
    }
}

#[test]
fn what_a_command_cannot_read_is_refused_with_what_it_reads() {
    let (stl, toml) = (FileType::Mesh(MeshFormat::Stl), FileType::Toml);
    let zip = b"PK\x03\x04\x14\0\0\0\x08\0mesh.obj";
    let [fbx, gif, zip] = [&b"; FBX 7"[..], b"GIF8", zip].map(|head| FileType::of(head, 99));
    let reads = [
        "raycl reads scenes (TOML) and meshes (OBJ, PLY, STL, glTF), also as .gz",
        "the key `mesh` of an [[object]] accepts OBJ, PLY, STL and glTF, also as .gz",
        "`raycl run` reads experiments (TOML), such as configs/quick.toml",
    ];
    let export = "; export the file as glTF or OBJ, for example with Blender or assimp";
    let [scene, mesh, experiment] = [Wanted::Scene, Wanted::Mesh, Wanted::Experiment];
    let foreign = "an FBX scene (ASCII), which raycl does not read";
    let run = format!("`raycl render a.x` renders this mesh; {}", reads[2]);
    for (filetype, wanted, is, help) in [
        (fbx, scene, foreign, format!("{}{export}", reads[0])),
        (fbx, mesh, foreign, format!("{}{export}", reads[1])),
        (fbx, experiment, foreign, reads[2].to_owned()),
        (gif, mesh, "a GIF picture, which raycl does not read", reads[1].to_owned()),
        (
            zip,
            experiment,
            "a zip archive, which raycl does not read",
            format!("{}; unpack the file first", reads[2]),
        ),
        (stl, experiment, "an STL mesh, not an experiment", run),
        (toml, mesh, "a TOML file, not a mesh", reads[1].to_owned()),
    ] {
        let error = filetype.refusal("a.x", wanted).unwrap();
        assert_eq!((error.to_string(), error.remedy()), (format!("a.x is {is}"), help.as_str()));
    }
    for wanted in [scene, mesh, experiment] {
        let error = FileType::Utf16.refusal("a.x", wanted).unwrap();
        assert_eq!(
            error.to_string(),
            "a.x:1: UTF-16 or UTF-32 text, which raycl does not read; expected UTF-8"
        );
        assert_eq!(error.remedy(), "save the file as UTF-8");
        assert!(FileType::Unclear.refusal("a.x", wanted).is_none());
    }
    let read = [(stl, scene), (stl, mesh), (toml, scene), (toml, experiment)];
    assert!(read.iter().all(|(filetype, wanted)| filetype.refusal("a.x", *wanted).is_none()));
}

#[test]
fn an_unknown_file_named_stl_is_one_and_a_picture_named_stl_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let opened = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        Opened::at(&path).unwrap().filetype
    };
    let unknown = b"\x01\x02\0\x03 nothing known";
    assert_eq!(opened("a.stl", unknown), FileType::Mesh(MeshFormat::Stl));
    assert!(matches!(opened("a.unknown", unknown), FileType::Foreign(Foreign { name: UNKNOWN, .. })));
    assert!(matches!(opened("b.stl", b"GIF89a"), FileType::Foreign(Foreign { name: "a GIF picture", .. })));
    assert_eq!(opened("b.gltf", b"v 0 0 0\n"), FileType::Mesh(MeshFormat::Obj), "the contents go first");
}

#[test]
fn text_may_have_some_control_characters() {
    let text = |controls: &str| called(format!("strange words {controls}").as_bytes());
    assert_eq!(text("\u{1}"), "unclear");
    assert_eq!(text("\u{1}\u{2}\u{3}"), UNKNOWN, "more than a tenth");
    assert_eq!(text("\t\u{c}\u{1b}\t\u{c}\u{1b}"), "unclear", "tabs, page ends and escapes are text");
    assert_eq!(called(b"strange words and one zero byte \0"), UNKNOWN);
}

#[test]
fn a_3ds_scene_may_begin_with_any_chunk_if_its_length_is_right() {
    let file = |said: u32, length: usize| {
        let head = [b"MM", &said.to_le_bytes()[..], b"\x00\xb0"].concat();
        called(&padded(&head, length))
    };
    assert_eq!(file(300, 300), "a 3DS scene");
    assert_ne!(file(300, 301), "a 3DS scene");
    assert_eq!(called(&padded(b"MM\x10\0\0\0\x3d\x3d", 99)), "a 3DS scene", "an editor chunk");
}
