//! Constants that the host and the kernels share. Kernels receive the constants as defines.

use crate::accel::TRIANGLE_WORDS;
use crate::scene::Material;

/// The triangle number of a ray that hits nothing.
pub const NO_HIT: i32 = i32::MAX;
/// Number of floats in a row. A row contains a triangle of a leaf, or the planes that are prepared for a triangle and a
/// common origin of rays.
pub const ROW_FLOATS: usize = TRIANGLE_WORDS;
/// Number of working vectors of a ray (its origin, direction, normal and others), with three floats each. The
/// student paper that raycl reproduces keeps the working vectors of rays in arrays.
pub const WORKING_VECTORS: usize = 9;
/// Returns the number of floats of a triangle without shared vertices: 9 for the corners, 9 for the normals, and 8 for
/// the material. If surfaces of the scene emit light (`emissive`), the material has more than 8 floats.
pub const fn soup_floats(emissive: bool) -> usize {
    18 + Material::floats(emissive)
}

/// Number of floats of a light: position and power.
pub const LIGHT_FLOATS: usize = 6;
/// Number of floats of a light in a scene with area lights: position, power, four times the normal of the light's
/// front, two edges, and the shape.
pub const AREA_LIGHT_FLOATS: usize = 16;
/// Number of floats that describe the sky: its radiance at zenith and horizon, the upward direction, and its reach
/// (surfaces farther away do not block the sky). If the sky is a picture, other floats take the place of the radiance:
/// the index of the picture's first texel in the buffer, the picture's size, and the direction of the picture's middle.
/// In the buffer, the lights' radii follow these floats of the sky.
pub const SOFT_HEAD_FLOATS: usize = 10;
/// Number of words that describe a texture, before its texels.
pub const TEXTURE_HEAD_WORDS: usize = 4;
/// The side, in pixels, of a square block of pixels. All pixels of a block get the same number of samples. If
/// each pixel has one ray, the 16 rays of a vector in a tile cover one block.
pub const SAMPLED_BLOCK: u32 = 4;
/// A block of pixels gets more samples if two neighbouring pixels, in the block or directly around it, differ
/// in a channel by more than `ROUGH_STEPS`, on a scale from 0 to 255 with a gamma of 2. If raycl casts several
/// samples per pixel before it looks for such blocks, `ROUGH_STEPS` is divided by the square root of the number of
/// these first samples, since chance affects a mean of samples less than a single sample.
pub const ROUGH_STEPS: u32 = 30;
/// The half picture is a picture of half the width and height. The sample points of lights and the directions
/// of the sky repeat after `INTERLEAVED` pixels of the half picture, across and down. Across and down, the
/// filter of soft light covers `INTERLEAVED` + 1 pixels. The filter's two outermost pixels have half weight.
pub const INTERLEAVED: u32 = 4;
/// How strongly the filter of soft light lowers the weight of a pixel whose unoccluded light differs from the
/// unoccluded light of the filtered pixel.
pub const HALF_LIGHT_SHARPNESS: u32 = 50;
/// Number of work-items that share a tile.
pub const GROUP_LANES: u32 = 32;
/// Number of triangles that a work-group copies into `__local` memory at a time with `triangles = tiled`.
pub const TILE_TRIANGLES: u64 = 256;
