//! The versions of a kernel in PoCL's binary. PoCL compiles a kernel separately for each local size with
//! which the kernel is launched. When a program's binary is queried, PoCL also compiles a version of the
//! kernel for any local size. The version for any local size reads the local size at run time, and therefore
//! has other instructions.

use crate::launch::Caster;
use crate::program::BuiltProgram;
use ocl::Kernel;

/// The bytes with which PoCL's binaries begin.
const MAGIC: &[u8] = b"poclbin\0";
/// The length in bytes of the longest path that raycl expects in PoCL's binary.
const LONGEST: usize = 1024;

/// Returns true if `binary` is a program's binary that PoCL made.
pub fn is_pocls(binary: &[u8]) -> bool {
    binary.starts_with(MAGIC)
}

/// Returns a program's binary, which includes the versions of the kernels for the local sizes of a frame.
/// PoCL compiles a kernel for a local size only when the kernel is launched with this local size, so this
/// function first casts the frame of `caster`.
pub fn binary_of_frame(program: &BuiltProgram, caster: &Caster) -> Vec<u8> {
    // If the frame cannot be cast, the binary lacks the kernels' versions for the frame's local sizes, and a
    // note in the listings says so.
    let _ = caster.cast();
    program.binary()
}

/// Returns the name of the version of a kernel whose ELF file begins at byte `at` of `binary`. A version's
/// name is the name of the folder from which PoCL took the ELF file: "8-8-1-goffs0-smallgrid" for the local
/// size 8 x 8, the global offset 0 and fewer than 65,535 work-items across and down, and "0-0-0" for any
/// local size. The returned name is empty if the binary has an unknown layout. Returns `None` if PoCL did not
/// make the binary.
pub fn version(binary: &[u8], at: usize) -> Option<String> {
    is_pocls(binary).then(|| folder(binary, at).unwrap_or_default())
}

/// Returns the name of the folder of the file whose bytes begin at byte `at`. Before the file's bytes, the
/// binary has the length of the file's path, the path ("/cast_frame/8-8-1-goffs0/cast_frame.so"), and the
/// length of the file. Both lengths are 32-bit numbers.
fn folder(binary: &[u8], at: usize) -> Option<String> {
    let end = at.checked_sub(4)?;
    let length_at = |at: usize| Some(u32::from_le_bytes(binary.get(at..at + 4)?.try_into().ok()?) as usize);
    let starts = (1..=LONGEST).map_while(|length| end.checked_sub(length));
    let start = starts.filter(|start| *start >= 4).find(|start| length_at(start - 4) == Some(end - start))?;
    let path = std::str::from_utf8(binary.get(start..end)?).ok()?;
    path.split('/').rev().nth(1).map(str::to_owned)
}

/// Returns true if `version` is the name of a version that PoCL compiled for `local_size`. Returns false if
/// `local_size` is `None`, that is, if the driver chooses the local size.
pub fn is_for(version: &str, local_size: Option<[usize; 3]>) -> bool {
    let Some([x, y, z]) = local_size else { return false };
    let rest = version.strip_prefix(&format!("{x}-{y}-{z}"));
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
}

/// Returns the local size with which a frame launches a kernel; `None` if the driver chooses the local size.
pub fn local_size(kernel: &Kernel) -> Option<[usize; 3]> {
    kernel.default_local_work_size().to_lens().ok()
}

/// Returns the global and local sizes of a frame's kernels as text. The texts of two frames differ if PoCL
/// compiles different versions of the kernels for these frames.
pub fn sizes(caster: &Caster) -> String {
    let sizes = |kernel: &Kernel| (kernel.default_global_work_size(), kernel.default_local_work_size());
    format!("{:?}", caster.kernels().map(sizes).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a binary that contains one file, and the offset of this file in the binary.
    fn binary(magic: &[u8], path: &str, file: &[u8]) -> (Vec<u8>, usize) {
        let length = |bytes: &[u8]| u32::try_from(bytes.len()).unwrap_or(0).to_le_bytes();
        let before = [magic, b"kernel", &length(path.as_bytes()), path.as_bytes(), &length(file)].concat();
        let at = before.len();
        ([&before, file].concat(), at)
    }

    #[test]
    fn a_version_is_the_folder_of_its_file_and_empty_in_an_unknown_layout() {
        let version_of = |magic: &[u8], path: &str, moved: usize| {
            let (binary, at) = binary(magic, path, b"\x7fELF and more");
            version(&binary, at + moved)
        };
        for (path, folder) in [
            ("/cast_frame/8-8-1-goffs0-smallgrid/cast_frame.so", "8-8-1-goffs0-smallgrid"),
            ("/k/0-0-0/k.so", "0-0-0"),
            ("k.so", ""),
        ] {
            assert_eq!(version_of(MAGIC, path, 0).as_deref(), Some(folder), "{path}");
            assert_eq!(version_of(MAGIC, path, 1).as_deref(), Some(""), "{path}");
            assert_eq!(version_of(b"another\0", path, 0), None, "{path}");
        }
        assert_eq!(version(MAGIC, 3).as_deref(), Some(""));
    }

    #[test]
    fn a_version_is_for_its_own_local_size_only() {
        let (own, any) = ("8-8-1-goffs0-smallgrid", "0-0-0");
        for (version, local_size, expected) in [
            (own, Some([8, 8, 1]), true),
            ("8-8-1", Some([8, 8, 1]), true),
            (own, Some([8, 8, 2]), false),
            ("8-8-16-goffs0", Some([8, 8, 1]), false),
            (any, Some([8, 8, 1]), false),
            ("", Some([8, 8, 1]), false),
            (own, None, false),
        ] {
            assert_eq!(is_for(version, local_size), expected, "{version} {local_size:?}");
        }
    }
}
