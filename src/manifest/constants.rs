//! Constants that the host and the kernels share. Kernels receive them as defines.

use crate::accel::TRIANGLE_WORDS;
use crate::scene::Material;

/// The triangle number of a ray that hits nothing.
pub const NO_HIT: i32 = i32::MAX;
/// Number of floats in a row: a triangle of a leaf, or the planes prepared for a triangle and an origin.
pub const ROW_FLOATS: usize = TRIANGLE_WORDS;
/// Number of working vectors of a ray, with three floats each: the paper's arrays.
pub const WORKING_VECTORS: usize = 9;
/// Number of floats of a triangle without shared vertices: corners 9, normals 9, material 8.
pub const SOUP_FLOATS: usize = 18 + Material::FLOATS;
/// Number of floats of a light: position and power.
pub const LIGHT_FLOATS: usize = 6;
/// Number of floats of the sky, which precede the lights' radii: its radiance at zenith and horizon, the
/// upward direction, its reach.
pub const SOFT_HEAD_FLOATS: usize = 10;
/// Number of words that describe a texture, before its texels.
pub const TEXTURE_HEAD_WORDS: usize = 4;
/// Side in pixels of the blocks whose pixels get equally many samples. Vectors of tiles are such blocks.
pub const SAMPLED_BLOCK: u32 = 4;
/// The difference of neighbouring pixels as displayed, in 8-bit steps, from which they get more samples.
pub const ROUGH_STEPS: u32 = 30;
/// Number of pixels of the half picture, across and down, after which the points of lights and the directions of the sky
/// repeat. The filter covers as many.
pub const INTERLEAVED: u32 = 4;
/// How fast a pixel counts less for that filter as its unoccluded light differs.
pub const HALF_LIGHT_SHARPNESS: u32 = 50;
/// Number of work-items that share a tile.
pub const GROUP_LANES: u32 = 32;
/// Number of triangles in a tile that is streamed through `__local` memory.
pub const TILE_TRIANGLES: u64 = 256;
