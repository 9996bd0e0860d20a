//! Formats that are recognised by a signature in their first bytes.

use super::{FileType, Foreign, MeshFormat, stl, text};

/// The advice for files that contain a mesh.
pub(super) const EXPORT: &str = "export the file as glTF or OBJ, for example with Blender or assimp";
/// The advice for files in a program's own format, which few other programs read.
pub(super) const OWN: &str = "export the file as glTF or OBJ from the program that made it";
/// The advice for files of CAD programs. Such files describe curved surfaces without triangles.
pub(super) const CAD: &str = "export a mesh (STL) from the file, with FreeCAD for example";
/// The advice for files with the meshes of simulations, such as finite elements.
pub(super) const CONVERT: &str = "convert the file to PLY, with meshio or ParaView for example";
/// The advice for files that contain points, but no triangles.
pub(super) const POINTS: &str = "make triangles of the file's points, with MeshLab for example";
/// The advice for files with volumes (a density at each point of a grid).
pub(super) const SURFACE: &str = "extract the surface as PLY or STL, with ParaView for example";
/// The texts of advice that tell the user how to get a mesh from a file, and that serve several formats. The list
/// lacks the texts for single formats.
pub(super) const TO_MESH: [&str; 6] = [EXPORT, OWN, CAD, CONVERT, POINTS, SURFACE];
pub(super) const UNPACK: &str = "unpack the file first";
/// The advice for a web server's error page that was downloaded instead of a file.
pub(super) const DOWNLOAD: &str = "download the file again, with the address of the file itself";

/// A signature's offset and bytes, the format's name, and advice for the user.
type Signature = (usize, &'static [u8], &'static str, &'static str);

pub(super) const SIGNATURES: &[Signature] = &[
    (0, b"Kaydara FBX Binary", "an FBX scene (binary)", EXPORT),
    (0, b"; FBX", "an FBX scene (ASCII)", EXPORT),
    (0, b"BLENDER-v", "a Blender file", EXPORT),
    (0, b"BLENDER_v", "a Blender file", EXPORT),
    (0, b"BLENDER17", "a Blender file", EXPORT),
    (0, b"PXR-USDC", "a USD scene (binary, usdc)", EXPORT),
    (0, b"#usda", "a USD scene (ASCII, usda)", EXPORT),
    (0, b"Ogawa", "an Alembic scene", EXPORT),
    (0, b"\x89HDF\r\n\x1a\n", "an HDF5 file, such as an older Alembic scene", EXPORT),
    (0, b"# vtk DataFile", "a VTK file", CONVERT),
    (0, b"#VRML", "a VRML scene", EXPORT),
    (0, b"#X3D", "an X3D scene", EXPORT),
    (0, b"# .PCD", "a point cloud (PCD)", POINTS),
    (0, b"LASF", "a point cloud (LAS or LAZ)", POINTS),
    (0, b"ASTM-E57", "a point cloud (E57)", POINTS),
    (0, b"DRACO", "a Draco mesh", "decode the file to PLY or OBJ, with draco_decoder"),
    (0, b"//Maya ASCII", "a Maya scene (ASCII)", OWN),
    (0, b"FOR4", "a Maya scene (binary)", OWN),
    (0, b"FOR8", "a Maya scene (binary)", OWN),
    (0, b"QC4DC4D6", "a Cinema 4D scene", OWN),
    (0, b"3D Geometry File Format", "a Rhino model", OWN),
    (0, SKETCHUP, "a SketchUp model", OWN),
    (0, b"\x7fNSJb", "a Houdini geometry", OWN),
    (0, b"AC3D", "an AC3D model", OWN),
    (0, b"xof 0", "a DirectX mesh", OWN),
    (0, b"IDP2", "a Quake mesh (MD2)", OWN),
    (0, b"IDP3", "a Quake mesh (MD3)", OWN),
    (0, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an OLE file, such as a 3ds Max or SolidWorks file", OWN),
    (0, b"ISO-10303-21", "a STEP model", CAD),
    (0, b"**ABCDEFGH", "a Parasolid model", CAD),
    (0, b"DBRep_DrawableShape", "an Open CASCADE model (BREP)", CAD),
    (0, b"CASCADE Topology", "an Open CASCADE model (BREP)", CAD),
    (0, b"AC10", "an AutoCAD drawing (DWG)", CAD),
    (0, b"$MeshFormat", "a Gmsh mesh (MSH)", CONVERT),
    (0, b"$Comments", "a Gmsh mesh (MSH)", CONVERT),
    (0, b"$NOD", "a Gmsh mesh (MSH)", CONVERT),
    (0, b"MeshVersionFormatted", "a Medit mesh", CONVERT),
    (8, b"LWO2", "a LightWave object", OWN),
    (8, b"LWOB", "a LightWave object", OWN),
    (8, b"LWO3", "a LightWave object", OWN),
    (8, b"LXOB", "a Modo scene", OWN),
    (344, b"n+1\0", "a volume (NIfTI)", SURFACE),
    (208, b"MAP ", "a volume (MRC or CCP4)", SURFACE),
    (0, b"NRRD000", "a volume (NRRD)", SURFACE),
    (0, b"ObjectType = Image", "a volume (MetaImage)", SURFACE),
    (128, b"DICM", "a volume (DICOM)", SURFACE),
    (0, b"\x20BDV", "a volume (OpenVDB)", SURFACE),
    (0, b"VOX ", "a model of voxels (VOX)", OWN),
    (0, b"#binvox", "a volume (binvox)", SURFACE),
    (0, b"\x89PNG\r\n\x1a\n", "a PNG picture", ""),
    (0, b"\xff\xd8\xff", "a JPEG picture", ""),
    (0, b"\x76\x2f\x31\x01", "an EXR picture", ""),
    (0, b"#?RADIANCE", "an HDR picture", ""),
    (0, b"#?RGBE", "an HDR picture", ""),
    (0, b"GIF8", "a GIF picture", ""),
    (0, b"II*\0", "a TIFF picture", ""),
    (0, b"MM\0*", "a TIFF picture", ""),
    (8, b"WEBP", "a WebP picture", ""),
    (0, b"8BPS", "a Photoshop picture", ""),
    (0, b"P3\n", "a PPM picture", ""),
    (0, b"P6\n", "a PPM picture", ""),
    (0, b"DDS ", "a DDS picture", ""),
    (4, b"ftyp", "a film or a picture (MP4, HEIC or AVIF)", ""),
    (0, b"PF\n", "a PFM picture", ""),
    (0, b"%PDF", "a PDF document", ""),
    (0, b"\x93NUMPY", "a NumPy array", ""),
    (0, b"404: Not Found", "the error page of a download", DOWNLOAD),
    (0, b"\x1f\x8b", "a gzip archive", UNPACK),
    (0, b"BZh", "a bzip2 archive", UNPACK),
    (0, b"\xfd7zXZ\0", "an xz archive", UNPACK),
    (0, b"\x28\xb5\x2f\xfd", "a zstd archive", UNPACK),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", UNPACK),
    (0, b"Rar!", "a RAR archive", UNPACK),
    (257, b"ustar", "a tar archive", UNPACK),
    (0, b"\x7fELF", "a program or library (ELF)", ""),
    (0, b"\xcf\xfa\xed\xfe", "a program or library (Mach-O)", ""),
    (0, b"MZ\x90\0", "a program or library (Windows)", ""),
    (0, b"\0asm", "a WebAssembly module", ""),
    (
        0,
        b"version https://git-lfs",
        "a Git LFS pointer, not the file itself",
        "`git lfs pull` downloads the file",
    ),
];

/// Returns the format of a file of `length` bytes that begins with `head`; `None` if the file has no known
/// signature.
pub(super) fn recognise(head: &[u8], length: u64) -> Option<FileType> {
    if is_utf16(head) && !head.starts_with(SKETCHUP) {
        return Some(FileType::Utf16);
    }
    let foreign = |name, remedy| Some(FileType::Foreign(Foreign { name, remedy }));
    if head.starts_with(b"glTF") {
        return Some(FileType::Mesh(MeshFormat::Glb));
    }
    if head.starts_with(b"PK\x03\x04") {
        let (name, remedy) = archive(head);
        return foreign(name, remedy);
    }
    if is_iges(head) {
        return foreign("an IGES model", CAD);
    }
    if is_3ds(head, length) {
        return foreign("a 3DS scene", EXPORT);
    }
    if stl::is_whole(head, length) {
        return Some(FileType::Mesh(MeshFormat::Stl));
    }
    let found = SIGNATURES.iter().find(|signature| has(head, signature));
    found.and_then(|&(_, _, name, remedy)| foreign(name, remedy))
}

/// Returns true if a file that begins with `head` has the signature. A signature at an offset above 0 follows binary
/// bytes. After text, the same bytes are a word of the text, such as a word of a comment.
fn has(head: &[u8], &(at, bytes, ..): &Signature) -> bool {
    let is_signature =
        |(before, rest): (&[u8], &[u8])| rest.starts_with(bytes) && (at == 0 || text::is_binary(before));
    head.split_at_checked(at).is_some_and(is_signature)
}

/// Returns true if a file begins with a byte order mark of UTF-16 (in little-endian UTF-32, the mark begins with
/// the same two bytes), or with ASCII characters that are each followed by a zero byte.
fn is_utf16(head: &[u8]) -> bool {
    let every_second_is_zero =
        |text: &[u8]| text.len() >= 8 && text.chunks_exact(2).all(|pair| matches!(pair, [b'\t'..=b'~', 0]));
    head.starts_with(&[0xff, 0xfe])
        || head.starts_with(&[0xfe, 0xff])
        || every_second_is_zero(&head[..head.len().min(64)])
}

/// The first bytes of a SketchUp model, which look like UTF-16.
const SKETCHUP: &[u8] = b"\xff\xfe\xff\x0eS\0k\0e\0t\0c\0h\0U\0p\0";

/// For each type of zip file: a part of the name of a file in the archive (this part shows the type), the
/// type's name, and advice for the user.
const ARCHIVES: &[(&[u8], &str, &str)] = &[
    (b"3D/3dmodel.model", "a 3MF model", EXPORT),
    (b"3dmanufacturing", "a 3MF model", EXPORT),
    (b".usdc", "a USD package (usdz)", EXPORT),
    (b".usda", "a USD package (usdz)", EXPORT),
    (b".amf", "an AMF model (packed)", EXPORT),
    (b"Document.xml", "a FreeCAD model", CAD),
];

/// Returns the type of a zip file, and advice for the user. The names of the file's first entries show the type.
fn archive(head: &[u8]) -> (&'static str, &'static str) {
    let known = ARCHIVES.iter().find(|(entry, ..)| contains(head, entry));
    known.map_or(("a zip archive", UNPACK), |&(_, name, remedy)| (name, remedy))
}

/// Returns true for an IGES file: its lines have 80 characters. The last eight characters of a line are the letter of a
/// section (`S` in the first line) and the line's number.
fn is_iges(head: &[u8]) -> bool {
    let number = head.get(73..80).and_then(|number| std::str::from_utf8(number).ok());
    head.get(72) == Some(&b'S') && number.is_some_and(|number| number.trim() == "1")
}

/// Returns true for a 3DS file: it begins with the main chunk (`MM`), which is as long as the file, or begins with a
/// version chunk or an editor chunk.
fn is_3ds(head: &[u8], length: u64) -> bool {
    let Some(&[b'M', b'M', a, b, c, d, low, high]) = head.get(..8) else { return false };
    let size = u64::from(u32::from_le_bytes([a, b, c, d]));
    size == length || matches!(u16::from_le_bytes([low, high]), 0x0002 | 0x3d3d)
}

/// Returns true if the bytes `text` contain the bytes `part`.
pub(super) fn contains(text: &[u8], part: &[u8]) -> bool {
    text.windows(part.len()).any(|window| window == part)
}
