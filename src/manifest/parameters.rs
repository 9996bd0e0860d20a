//! The parameters of kernels, in groups. Kernels may share a group.

use super::Fact;
use super::Fact::{
    Always, CornerColours, CutOut, Heap, Indexed, Planes, Records, Sampled, Scratch, Soft, Soup, Textured,
    Tree,
};

/// A parameter of a kernel. `Arguments::bind` (`src/launch/arguments.rs`) binds the argument with the same name to
/// the parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// The condition under which kernels have this parameter.
    pub when: Fact,
    /// The parameter's type in OpenCL C. A word in capitals is a macro that a kernel file of the strategy defines:
    /// the files in `cl/cast/triangles/` define SOURCE_SPACE.
    pub of_type: &'static str,
    /// The parameter's name.
    pub name: &'static str,
}

const fn p(when: Fact, of_type: &'static str, name: &'static str) -> Parameter {
    Parameter { when, of_type, name }
}

const SOURCE_FLOATS: &str = "SOURCE_SPACE const float *restrict";
const SOURCE_INDICES: &str = "SOURCE_SPACE const Index *restrict";
const FLOATS: &str = "const __global float *restrict";
const QUADS: &str = "const __global float4 *restrict";
const INTS: &str = "const __global int *restrict";
const WORDS: &str = "const __global uint *restrict";

/// The triangles, in the strategy's layout.
pub const GEOMETRY: &[Parameter] = &[
    p(Soup, SOURCE_FLOATS, "soup"),
    p(Indexed, SOURCE_FLOATS, "position_set"),
    p(Indexed, SOURCE_FLOATS, "normal_set"),
    p(Indexed, SOURCE_INDICES, "position_indices"),
    p(Indexed, SOURCE_INDICES, "normal_indices"),
    p(Indexed, SOURCE_INDICES, "material_indices"),
    p(Indexed, SOURCE_FLOATS, "material_set"),
    p(Always, "const int", "triangle_count"),
];
/// The lights, and the shadow bias: the gap between a hit and the near end of the hit's shadow ray.
pub const LIGHTS: &[Parameter] =
    &[p(Always, FLOATS, "lights"), p(Always, "const int", "light_count"), p(Always, "const float", "bias")];
/// The triangles' planes, prepared for the eye and for each light.
pub const PREPARED: &[Parameter] = &[p(Planes, QUADS, "prepared")];
/// The records of triangles: data for the ray-triangle test, prepared before the first frame.
pub const RECORDS: &[Parameter] = &[p(Records, FLOATS, "records")];
pub const RECORDS_OUT: &[Parameter] = &[p(Records, "__global float *restrict", "records")];
/// The nodes of a tree, and the triangles in its leaves.
pub const TREE: &[Parameter] = &[p(Tree, FLOATS, "nodes"), p(Tree, FLOATS, "leaves")];
/// The triangles' normals in leaf order, and the materials, for tiles that work-items share.
pub const SURFACES: &[Parameter] = &[
    p(Always, FLOATS, "surfaces"),
    p(Always, FLOATS, "materials"),
    p(Always, "const int", "material_count"),
];
/// The triangles' normals in the strategy's layout, and the materials, for tiles whose rays are in vectors.
pub const NORMALS: &[Parameter] = &[
    p(Soup, FLOATS, "surfaces"),
    p(Indexed, FLOATS, "normal_set"),
    p(Indexed, WORDS, "mesh_triangles"),
    p(Always, FLOATS, "materials"),
    p(Always, "const int", "material_count"),
];
/// The triangles' texture coordinates, all textures, and the ray cone of a pixel, which determines the mip level.
pub const TEXTURES: &[Parameter] = &[
    p(Textured, QUADS, "texture_rows"),
    p(Textured, WORDS, "texture_words"),
    p(Textured, "const float4", "cone"),
];
/// The colours of the triangles' corners.
pub const COLOURS: &[Parameter] = &[p(CornerColours, WORDS, "corner_colours")];
/// The texture coordinates and the textures, for those kernels with `traversal = tile` that test whether rays pass
/// through the holes of cut-outs. The names of these parameters differ from the names of the parameters for shading.
pub const MASKS: &[Parameter] = &[p(CutOut, QUADS, "mask_rows"), p(CutOut, WORDS, "mask_words")];
/// The sky, the lights' radii, the number of the sample that is cast, and the number of samples in this sample's round.
/// The first samples of a pixel are one round, and the pixel's later samples are another round. For unoccluded light,
/// the number of samples in the round is 0.
pub const SOFT: &[Parameter] = &[p(Soft, FLOATS, "soft"), p(Soft, "const uint2", "sample")];
/// For each block of pixels, the largest number of samples that each of its pixels gets. A further parameter
/// is the number of samples per pixel that the image has from earlier frames.
pub const SAMPLES: &[Parameter] = &[p(Sampled, WORDS, "wanted"), p(Sampled, "const uint", "earlier")];
/// The base-2 logarithm of the number of sub-pixels across a pixel in this frame, the number of samples that
/// the frame casts per pixel, and the position of each lane's sample in its pixel.
pub const SUBPIXELS: &[Parameter] = &[
    p(Sampled, "const uint", "subpixel_bits"),
    p(Sampled, "const uint", "samples_of_frame"),
    p(Sampled, "const float16", "sample_x"),
    p(Sampled, "const float16", "sample_y"),
];
/// Parameters for tiles that are each shared by 32 work-items. `subpixel_bits` is the base-2 logarithm of the
/// number of sub-pixels across a pixel in this frame. `samples_of_frame` is the number of samples that the
/// frame casts per pixel. `positions` has the position (x and y) of each sample in its pixel. The frame casts
/// only the rough blocks of pixels, which `rough` lists, or all blocks if `rough_count` is 0.
pub const TILE_SUBPIXELS: &[Parameter] = &[
    p(Sampled, "const uint", "subpixel_bits"),
    p(Sampled, "const uint", "samples_of_frame"),
    p(Sampled, FLOATS, "positions"),
    p(Sampled, WORDS, "rough"),
    p(Sampled, "const uint", "rough_count"),
];
/// For each pixel, how many samples of earlier frames hit something.
pub const HITS_BEFORE: &[Parameter] = &[p(Sampled, "__global uint *restrict", "hits_before")];
/// `means` is the image after the first samples. `exposure` and `tone` are the display's exposure and the
/// coefficients of its tone curve. `most` is the number of samples per pixel in rough blocks (blocks in which
/// neighbouring pixels differ), and `first` is this number in all other blocks. `alpha_scale` is the
/// displayed value of an alpha of 1: 255, or 0 if the background is not transparent. The kernel writes each
/// block's number of samples per pixel into `wanted`, and lists the rough blocks in `rough`.
pub const MARK_ROUGH: &[Parameter] = &[
    p(Sampled, QUADS, "means"),
    p(Sampled, "const float", "exposure"),
    p(Sampled, "const float4", "tone"),
    p(Sampled, "const float", "alpha_scale"),
    p(Sampled, "const uint", "first"),
    p(Sampled, "const uint", "most"),
    p(Sampled, "__global uint *restrict", "wanted"),
    p(Sampled, "__global uint *restrict", "rough"),
    p(Sampled, "volatile __global uint *", "rough_counter"),
];
/// The half picture (half the width and height) with unoccluded light, and the size of half pictures.
pub const HALF_LIGHT: &[Parameter] =
    &[p(Always, QUADS, "half_unoccluded"), p(Always, "const int2", "half_size")];
/// The half picture (half the width and height) with shadows.
pub const HALF_LIGHT_LIT: &[Parameter] = &[p(Always, QUADS, "half_lit")];
/// For each pixel of the half pictures, the fraction of the unoccluded light that arrives.
pub const RATIOS: &[Parameter] = &[p(Always, QUADS, "ratios")];
pub const RATIOS_OUT: &[Parameter] = &[p(Always, "__global float4 *restrict", "ratios")];
/// The triangles' planes, prepared for the eye and for the lights of one round (lights are processed in rounds). Each
/// origin (the eye or a light) has a row for each coordinate axis (x, y and z); a row has four floats per triangle.
/// `prepared_row` is the number of triangles in a row.
pub const PREPARED_ROWS: &[Parameter] =
    &[p(Planes, QUADS, "prepared"), p(Planes, "const int", "prepared_row")];
/// The parameters that describe the camera. Functions that kernels call have the same parameters for the
/// camera.
pub const CAMERA: &[Parameter] = &[
    p(Always, "const float4", "eye"),
    p(Always, "const float4", "corner"),
    p(Always, "const float4", "step_x"),
    p(Always, "const float4", "step_y"),
];
pub const SIZE: &[Parameter] = &[p(Always, "const int2", "image_size")];
pub const IMAGE: &[Parameter] =
    &[p(Always, "const float4", "background"), p(Always, "__global float4 *restrict", "image")];
pub const NEAREST_OUT: &[Parameter] = &[p(Always, "__global int *restrict", "nearest_triangle")];
pub const NEAREST_IN: &[Parameter] = &[p(Always, INTS, "nearest_triangle")];
/// The buffer of the working vectors, if the working vectors need a buffer.
pub const WORKING: &[Parameter] = &[
    p(Scratch, "__global float *", "scratch"),
    p(Heap, "__global float *", "heap"),
    p(Heap, "volatile __global uint *", "heap_top"),
    p(Heap, "const uint", "heap_size"),
];
pub const RAYS: &[Parameter] = &[p(Always, QUADS, "rays"), p(Always, "const int", "ray_count")];
pub const LIGHTS_ONLY: &[Parameter] = &[p(Always, FLOATS, "lights")];
pub const PREPARED_OUT: &[Parameter] = &[p(Always, "__global float4 *restrict", "prepared")];
pub const DEPTH: &[Parameter] = &[p(Always, "volatile __global int *", "depth")];
pub const DEPTH_TO_NEAREST: &[Parameter] =
    &[p(Always, "const __global int *", "depth"), p(Always, "volatile __global int *", "nearest_triangle")];

// Parameters of kernels that cast the rays of tiles. `TILE_NEAREST_OUT` and `TILE_NEAREST_IN` are for all kernels with
// tiles. The parameters after them are for tiles that work-items share.
pub const TILE_NEAREST_OUT: &[Parameter] = &[p(Always, "__global int *restrict", "nearest")];
pub const TILE_NEAREST_IN: &[Parameter] = &[p(Always, INTS, "nearest")];
pub const FIRST_LIGHT: &[Parameter] = &[p(Always, "const int", "first_light")];
pub const SHADOW_RESULTS: &[Parameter] = &[
    p(Always, "__global uint *restrict", "lit"),
    p(Always, "__global uint2 *restrict", "queue"),
    p(Always, "__global uint *restrict", "queued"),
];
pub const LEFTOVER: &[Parameter] = &[
    p(Always, "__global uint *restrict", "lit"),
    p(Always, "const __global uint2 *restrict", "queue"),
    p(Always, WORDS, "queued"),
];
pub const SHADED_BY: &[Parameter] = &[
    p(Always, WORDS, "lit"),
    p(Always, "const __global uint2 *restrict", "queue"),
    p(Always, WORDS, "queued"),
    p(Always, "const int", "queue_rows"),
];
pub const TILE_PREPARE: &[Parameter] = &[
    p(Always, FLOATS, "lights"),
    p(Always, FLOATS, "leaves"),
    p(Always, "const int", "count"),
    p(Always, "const float4", "eye"),
    p(Always, "const int", "first_origin"),
    p(Always, "const int", "first_light"),
    p(Always, "__global float4 *restrict", "prepared"),
    p(Always, "__global uint *restrict", "queued"),
];

/// Parameters of the kernel that tests how work-items exchange values. This kernel belongs to no family.
pub const PROBE_LANES: &[Parameter] = &[p(Always, "__global uint *", "answers")];

/// Returns a parameter list in OpenCL C as a macro: `#define CAST_FRAME_PARAMETERS const float4 eye, ...`
pub fn parameter_macro<'a>(name: &str, parameters: impl Iterator<Item = &'a Parameter>) -> String {
    let list: Vec<_> =
        parameters.map(|Parameter { of_type, name, .. }| format!("{of_type} {name}")).collect();
    format!("#define {}_PARAMETERS {}\n", name.to_uppercase(), list.join(", "))
}
