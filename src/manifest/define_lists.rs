//! The macros that the host defines for kernel programs, in lists. Kernel families may share a list.

use super::Fact::{
    self, Always, AreaLights, CornerColours, CutOut, HalfLight, Indexed, Sampled, Soft, Soup, Textured,
    Tiled, Tree,
};

/// Names of macros, each with the condition under which the host defines the macro for a program.
pub type Defines = &'static [(Fact, &'static str)];

pub const COMMON_DEFINES: Defines = &[
    (Always, "WIDTH"),
    (Always, "BLOCK_X"),
    (Always, "LOCAL_X"),
    (Always, "LOCAL_Y"),
    (Always, "CULL_BACK"),
    (Always, "REDUCE_BUILTIN"),
    (Always, "NO_HIT"),
    (Always, "RECORD_FLOATS"),
    (Always, "LIGHT_FLOATS"),
    (Always, "MATERIAL_FLOATS"),
    (Always, "PLANES_OF_ORIGIN"),
    (Always, "TEXTURES"),
    (Always, "CORNER_COLOURS"),
    (CornerColours, "COLOUR_STEPS"),
    (Always, "EMISSIVE"),
    (Always, "CUTOUTS"),
    (Always, "SOFT"),
    (Always, "SKY"),
    (Always, "SMOOTH_SHADOWS"),
    (Always, "SAMPLED"),
    (Sampled, "SAMPLED_BLOCK"),
    (Sampled, "ROUGH_STEPS"),
    (Always, "HALF_LIGHT"),
    (HalfLight, "HALF_LIGHT_SHARPNESS"),
    (HalfLight, "INTERLEAVED"),
    (Always, "ENVIRONMENT"),
    (Always, "AREA_LIGHTS"),
    (AreaLights, "AREA_DISC"),
];
pub const TEXTURE_DEFINES: Defines = &[
    (Textured, "TEXTURE_HEAD_WORDS"),
    (Textured, "WRAP_REPEAT"),
    (Textured, "WRAP_CLAMP"),
    (Textured, "WRAP_MIRROR"),
    (Textured, "MIPS"),
    (CutOut, "LEAST_ALPHA_UNIT"),
];
pub const SOFT_DEFINES: Defines = &[(Soft, "SOFT_HEAD_FLOATS")];
/// Defines for ray-triangle tests that rely on the exact signs of computed values (`cl/common/exact_signs.cl`).
pub const SIGN_DEFINES: Defines = &[(Always, "FAST_MATH")];
pub const CAST_DEFINES: Defines = &[
    (Always, "PAPER_EPSILONS"),
    (Always, "TREE"),
    (Always, "LINEAR_IN_PIXEL"),
    (Always, "RECORDS_ONCE"),
    (Always, "WORKING_VECTORS"),
    (Always, "TRIANGLES"),
    (Soup, "SOUP_STRIDE"),
    (Indexed, "INDEX_BITS"),
    (Indexed, "POSITIONS"),
    (Indexed, "NORMALS"),
    (Indexed, "MATERIALS"),
    (Tiled, "TILE_TRIANGLES"),
];
/// The define of the kernel families that support both fused passes (one kernel casts primary and shadow
/// rays) and separate passes.
pub const PASSES_DEFINES: Defines = &[(Always, "FUSED")];
/// The define of those kernel families that have an additional kernel, which casts rays that the caller
/// provides.
pub const RAYS_DEFINES: Defines = &[(Always, "GIVEN_RAYS")];
pub const TREE_DEFINES: Defines = &[
    (Tree, "ROW_FLOATS"),
    (Tree, "NODE_WIDTH"),
    (Tree, "NODE_STRIDE"),
    (Tree, "STACK_SIZE"),
    (Tree, "LEAF_COUNT_SHIFT"),
    (Tree, "LEAF_MOST"),
];
pub const TILE_DEFINES: Defines =
    &[(Always, "TILE_X"), (Always, "TILE_Y"), (Always, "WATERTIGHT"), (Always, "NORMAL_FLOATS")];
pub const VECTOR_DEFINES: Defines = &[
    (Always, "PREFETCH"),
    (Always, "UNUSED_WORD"),
    (Always, "PADDING_ROWS"),
    (Indexed, "MESH_WORDS"),
    (Indexed, "MESH_NORMALS"),
];
pub const GROUP_DEFINES: Defines = &[
    (Always, "GROUP_LANES"),
    (Always, "TILES_ACROSS"),
    (Always, "LIGHTS_OF_ROUND"),
    (Always, "LANE_OPERATIONS"),
    (Always, "LEFTOVER_KERNEL"),
];
