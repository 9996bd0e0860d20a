//! Formats that are recognised by a signature in their first bytes.

use super::{FileType, Foreign, MeshFormat, stl};

/// The advice for files that contain a mesh.
pub(super) const EXPORT: &str = "export it as glTF or OBJ, with Blender for example";
const UNPACK: &str = "unpack it first";

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
    (0, b"# vtk DataFile", "a VTK file", EXPORT),
    (0, b"#VRML", "a VRML scene", EXPORT),
    (0, b"#X3D", "an X3D scene", EXPORT),
    (0, b"# .PCD", "a point cloud (PCD)", ""),
    (0, b"DRACO", "a Draco mesh", EXPORT),
    (0, b"//Maya ASCII", "a Maya scene (ASCII)", EXPORT),
    (0, b"ISO-10303-21", "a STEP model", EXPORT),
    (8, b"LWO2", "a LightWave object", EXPORT),
    (8, b"LWOB", "a LightWave object", EXPORT),
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
    (0, b"P6\n", "a PPM picture", ""),
    (0, b"PF\n", "a PFM picture", ""),
    (0, b"%PDF", "a PDF document", ""),
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
    if is_utf16(head) {
        return Some(FileType::Utf16);
    }
    let foreign = |name, remedy| Some(FileType::Foreign(Foreign { name, remedy }));
    if head.starts_with(b"glTF") {
        return Some(FileType::Mesh(MeshFormat::Glb));
    }
    if head.starts_with(b"PK\x03\x04") {
        return foreign(archive(head), if archive(head) == ZIP { UNPACK } else { EXPORT });
    }
    if is_3ds(head, length) {
        return foreign("a 3DS scene", EXPORT);
    }
    if stl::is_whole(head, length) {
        return Some(FileType::Mesh(MeshFormat::Stl));
    }
    let begins = |&&(at, bytes, ..): &&Signature| head.get(at..).is_some_and(|rest| rest.starts_with(bytes));
    SIGNATURES.iter().find(begins).and_then(|&(_, _, name, remedy)| foreign(name, remedy))
}

/// Returns true for UTF-16 text, which begins with a byte order mark, or has a zero byte after each Latin
/// character.
fn is_utf16(head: &[u8]) -> bool {
    let every_second_is_zero =
        |text: &[u8]| text.len() >= 8 && text.chunks_exact(2).all(|pair| matches!(pair, [b'\t'..=b'~', 0]));
    head.starts_with(&[0xff, 0xfe])
        || head.starts_with(&[0xfe, 0xff])
        || every_second_is_zero(&head[..head.len().min(64)])
}

const ZIP: &str = "a zip archive";

/// Returns the type of a zip file, which follows from the names of its first entries.
fn archive(head: &[u8]) -> &'static str {
    if contains(head, b"3D/3dmodel.model") || contains(head, b"3dmanufacturing") {
        "a 3MF model"
    } else if contains(head, b".usdc") || contains(head, b".usda") {
        "a USD package (usdz)"
    } else {
        ZIP
    }
}

/// Returns true for a 3DS file: the outermost chunk is as long as the file, or begins with a version chunk or
/// an editor chunk.
fn is_3ds(head: &[u8], length: u64) -> bool {
    let Some(&[b'M', b'M', a, b, c, d, low, high]) = head.get(..8) else { return false };
    let size = u64::from(u32::from_le_bytes([a, b, c, d]));
    size == length || matches!(u16::from_le_bytes([low, high]), 0x0002 | 0x3d3d)
}

/// Returns true if `text` contains `part`.
pub(super) fn contains(text: &[u8], part: &[u8]) -> bool {
    text.windows(part.len()).any(|window| window == part)
}
