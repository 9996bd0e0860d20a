//! Numbers that host and kernels agree on. Kernels have them as defines.

use crate::accel::TRIANGLE_WORDS;
use crate::scene::Material;

/// The triangle of a ray that hits nothing.
pub const NO_HIT: i32 = i32::MAX;
/// Floats of a row: a leaf's triangle, or what is prepared of a triangle for an origin.
pub const ROW_FLOATS: usize = TRIANGLE_WORDS;
/// Working vectors of a ray, of three floats each: the paper's arrays.
pub const WORKING_VECTORS: usize = 9;
/// Floats of a triangle of the soup: corners 9, normals 9, material 8.
pub const SOUP_FLOATS: usize = 18 + Material::FLOATS;
/// Floats of a light: position and power.
pub const LIGHT_FLOATS: usize = 6;
/// Floats of the sky, before the lights' radii: its radiance at zenith and horizon, the direction up, its reach.
pub const SOFT_HEAD_FLOATS: usize = 10;
/// Words that tell of a texture before its texels.
pub const TEXTURE_HEAD_WORDS: usize = 4;
/// Work-items that share a tile.
pub const GROUP_LANES: u32 = 32;
/// Triangles of a tile where triangles are streamed through `__local` memory.
pub const TILE_TRIANGLES: u64 = 256;
