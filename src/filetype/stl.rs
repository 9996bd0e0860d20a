//! Recognises binary STL files: 80 arbitrary bytes, a count, and 50 bytes per triangle, without a signature.

use glam::Vec3;

/// Number of bytes before the triangles.
const HEADER_BYTES: usize = 84;
/// Number of bytes of a triangle: a normal, three corners and two further bytes.
const TRIANGLE_BYTES: usize = 50;

/// Returns true if a file of `length` bytes has exactly the length that its count of triangles requires.
pub(super) fn is_whole(head: &[u8], length: u64) -> bool {
    whole_length(head) == Some(length)
}

/// Returns true if a file is shorter than its count of triangles requires, but begins with triangles. Bytes
/// count as triangles if all normals are unit vectors or zero, all corners have coordinates of a usual size,
/// and at least one triangle has three different corners. Files of other types almost never begin with bytes
/// that count as triangles.
pub(super) fn is_cut_off(head: &[u8], length: u64) -> bool {
    if whole_length(head).is_none_or(|whole| whole <= length) {
        return false;
    }
    let triangles = || head[HEADER_BYTES..].chunks_exact(TRIANGLE_BYTES).map(vectors);
    triangles().all(is_triangle) && triangles().any(|[_, a, b, c]| a != b && b != c && c != a)
}

/// Returns the length in bytes that a file must have according to the count of triangles in its header.
/// Returns `None` if `head` is shorter than the header.
fn whole_length(head: &[u8]) -> Option<u64> {
    let &[a, b, c, d] = head.get(HEADER_BYTES - 4..HEADER_BYTES)? else { return None };
    let triangles = u64::from(u32::from_le_bytes([a, b, c, d]));
    Some(HEADER_BYTES as u64 + TRIANGLE_BYTES as u64 * triangles)
}

/// Returns a triangle's normal and its corners.
fn vectors(triangle: &[u8]) -> [Vec3; 4] {
    let float =
        |at: usize| f32::from_le_bytes([triangle[at], triangle[at + 1], triangle[at + 2], triangle[at + 3]]);
    [0, 12, 24, 36].map(|at| Vec3::new(float(at), float(at + 4), float(at + 8)))
}

/// Returns true if the normal is a unit vector or zero, and each coordinate of the corners is 0 or of a usual
/// size.
fn is_triangle([normal, corners @ ..]: [Vec3; 4]) -> bool {
    let is_usual = |x: f32| x == 0.0 || (1e-30..1e30).contains(&x.abs());
    let has_normal = normal == Vec3::ZERO || (normal.length_squared() - 1.0).abs() < 0.02;
    has_normal && corners.iter().all(|corner| corner.to_array().into_iter().all(is_usual))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a file with the count of triangles `said` in its header, and with one triangle for each
    /// normal.
    fn file(said: u32, normals: &[Vec3]) -> Vec<u8> {
        let mut bytes = vec![0; HEADER_BYTES - 4];
        bytes.extend(said.to_le_bytes());
        for normal in normals {
            let vectors = [*normal, Vec3::ONE, Vec3::X, Vec3::new(0.0, 2.5, -3.0)];
            bytes.extend(vectors.iter().flat_map(Vec3::to_array).flat_map(f32::to_le_bytes));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn is_cut(bytes: &[u8]) -> bool {
        is_cut_off(bytes, bytes.len() as u64)
    }

    #[test]
    fn a_file_that_ends_early_is_known_by_its_triangles() {
        let mut cut = file(9, &[Vec3::ZERO, Vec3::Z, Vec3::splat(0.577)]);
        assert!(is_cut(&cut));
        cut.truncate(HEADER_BYTES + TRIANGLE_BYTES + 7);
        assert!(is_cut(&cut), "part of a triangle remains");
        assert!(is_whole(&file(2, &[Vec3::Z; 2]), 184) && !is_cut(&file(2, &[Vec3::Z; 2])));
        assert!(!is_cut(&file(1, &[Vec3::Z; 2])), "it is too long");
    }

    #[test]
    fn other_bytes_are_no_triangles() {
        assert!(!is_cut(&file(9, &[])), "there is no whole triangle");
        assert!(!is_cut(&file(9, &[Vec3::Z, Vec3::splat(3.0)])), "a normal is too long");
        let mut odd = file(9, &[Vec3::Z]);
        odd[HEADER_BYTES + 12..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(!is_cut(&odd), "a corner is not finite");
        let mut zeros = file(9, &[Vec3::Z]);
        zeros[HEADER_BYTES..].fill(0);
        assert!(!is_cut(&zeros) && !is_cut(&[0; 50]), "no triangle has three different corners");
    }

    #[test]
    fn triangles_with_two_equal_corners_are_no_triangles() {
        for [from, to] in [[12, 24], [24, 36], [12, 36]] {
            let mut flat = file(9, &[Vec3::Z]);
            let corner = flat[HEADER_BYTES + from..][..12].to_vec();
            flat[HEADER_BYTES + to..][..12].copy_from_slice(&corner);
            assert!(!is_cut(&flat), "{from} and {to}");
        }
    }

    #[test]
    fn every_byte_of_the_count_counts() {
        let said = 0x0102_0304;
        assert!(is_whole(&file(said, &[]), 84 + 50 * u64::from(said)));
        assert!(!is_whole(&file(said, &[]), 84 + 50 * u64::from(said) - 1));
    }
}
