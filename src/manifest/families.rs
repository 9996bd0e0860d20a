//! The table of kernel families.

use super::Fact::{self, Always, Environment, Fused, GivenRays, HalfLight, Planes, Sampled, Separate};
use super::Role::{
    ApplyLight, Background, FilterLight, Frame, Leftover, Mark, Prepare, Primary, Rays, Resolve, Shade,
    Shadow,
};
use super::Values::{AllBut, FilesIn, Only};
use super::define_lists::*;
use super::parameters::*;
use super::{Family, Kernel, Parameter, Role, Rule};

/// All families. `Strategy::family` determines the family of a strategy.
pub static FAMILIES: [&Family; 5] = [&EXHAUSTIVE, &BVH, &RASTER, &TILE_CPU, &TILE_GPU];

/// The kernels whose rays are each tested against every triangle.
pub static EXHAUSTIVE: Family = Family {
    name: "exhaustive",
    label: "traversal = exhaustive",
    entry: "cast/entry.cl",
    kernels: CAST_KERNELS,
    defines: CAST_KERNELS_DEFINES,
    rules: &[
        only("node_width", &["8"], NO_TREE),
        only("leaf_size", &["4"], NO_TREE),
        only("tile", &["32x16"], NO_TILES),
        rule("intersector", FilesIn("cast/intersect/", None), "casts no tiles, and this test is for tiles"),
    ],
};

/// The kernels whose rays, alone or in packets, walk a tree.
pub static BVH: Family = Family {
    name: "bvh",
    label: "traversal = bvh",
    entry: "cast/entry.cl",
    kernels: CAST_KERNELS,
    defines: CAST_KERNELS_DEFINES,
    rules: &[
        only("triangles", &["global"], LEAF_ORDER),
        only("layout", &["soup"], LEAF_ORDER),
        only("tile", &["32x16"], NO_TILES),
        rule(
            "intersector",
            FilesIn("cast/intersect/", Some(Planes)),
            "tests each ray against few triangles, so it prepares no planes for all rays of a frame or tile",
        ),
    ],
};

/// The kernels that rasterise triangles. Their shadow rays are tested against every triangle.
pub static RASTER: Family = Family {
    name: "raster",
    label: "traversal = raster",
    entry: "raster/entry.cl",
    kernels: &[
        kernel("raster_depth", Primary, &[GEOMETRY, CAMERA, SIZE, DEPTH]),
        kernel("raster_nearest", Resolve, &[GEOMETRY, CAMERA, SIZE, DEPTH_TO_NEAREST]),
        kernel(
            "shade_nearest",
            Shade,
            &[GEOMETRY, LIGHTS, PREPARED, RECORDS, TREE, CAMERA, SIZE, IMAGE, SAMPLES, NEAREST_IN, WORKING],
        ),
        MARK_KERNEL,
    ],
    defines: &[COMMON_DEFINES, CAST_DEFINES],
    rules: &[
        only("shading", &["deferred"], "finds the nearest triangle of every pixel before it shades"),
        only("passes", &["separate"], "finds the nearest triangle of every pixel before it shades"),
        only(
            "triangles",
            &["global", "constant"],
            "reads each triangle once, so there is nothing to keep in __local memory",
        ),
        only(
            "intersector",
            &["moller-trumbore"],
            "uses its own edge functions for primary rays, and moller-trumbore for shadow rays",
        ),
        only("records", &["each-test"], "reads each triangle once for all primary rays"),
        only(
            "math",
            &["strict"],
            "needs exactly equal depths in two kernels, and exactly opposite edges in two triangles, which math = fast does not preserve",
        ),
        only("node_width", &["8"], NO_TREE),
        only("leaf_size", &["4"], NO_TREE),
        only("tile", &["32x16"], NO_TILES),
    ],
};

/// The kernels whose tiles of rays walk a tree, with one work-item per tile. The rays of a tile are in
/// vectors.
pub static TILE_CPU: Family = Family {
    name: "tile-cpu",
    label: "traversal = tile with vectors of rays (width = 16)",
    entry: "tile_cpu/entry.cl",
    kernels: &[
        kernel_if(
            Fused,
            "tile_frame",
            Frame,
            &[LIGHTS, TREE, NORMALS, MASKS, TEXTURES, SOFT, CAMERA, SIZE, IMAGE, SAMPLES, SUBPIXELS],
        ),
        kernel_if(
            Separate,
            "tile_primary",
            Primary,
            &[LIGHTS, TREE, NORMALS, MASKS, CAMERA, SIZE, SAMPLES, SUBPIXELS, TILE_NEAREST_OUT],
        ),
        kernel_if(
            Separate,
            "tile_shade",
            Shade,
            &[
                LIGHTS,
                TREE,
                NORMALS,
                MASKS,
                TEXTURES,
                SOFT,
                CAMERA,
                SIZE,
                IMAGE,
                SAMPLES,
                SUBPIXELS,
                TILE_NEAREST_IN,
            ],
        ),
        SHOW_SKY,
        MARK_KERNEL,
        FILTER_KERNEL,
        APPLY_KERNEL,
    ],
    defines: &[
        COMMON_DEFINES,
        TEXTURE_DEFINES,
        SOFT_DEFINES,
        SIGN_DEFINES,
        TREE_DEFINES,
        PASSES_DEFINES,
        TILE_DEFINES,
        VECTOR_DEFINES,
    ],
    rules: &[
        // This rule is the first. If no tile can be cast with the width, the message therefore gives this
        // rule's reason, and not the reason of a rule about values that another width allows. Tiles with
        // `width = 1` belong to the family `TILE_GPU`.
        only("width", &["1", "16"], "fills vectors of 16 rays; with width = 1, work-items share a tile"),
        only("vectors", &["private"], "keeps a tile's rays in private memory"),
        only("shading", &["deferred"], SHADES_ONCE),
        only("triangles", &["global"], LEAF_ORDER),
        rule("layout", FilesIn("tile_cpu/layout/", None), NORMALS_ONLY),
        rule("intersector", FilesIn("tile_cpu/intersect/", Some(Planes)), PREPARES_A_TILE),
        only("records", &["each-test"], PREPARES_A_TILE),
        only("epsilons", &["relative"], OWN_EDGES),
        only("node_width", &["8", "16"], "tests a node's children as one vector"),
        rule(
            "tile",
            AllBut(&["8x4"]),
            "needs tiles of at least 8x8 pixels, since smaller tiles give a work-item too little work",
        ),
    ],
};

/// The kernels whose tiles of rays walk a tree, 32 work-items per tile.
pub static TILE_GPU: Family = Family {
    name: "tile-gpu",
    label: "traversal = tile shared by 32 work-items (width = 1)",
    entry: "tile_gpu/entry.cl",
    kernels: &[
        Kernel { name: "tile_prepare", role: Prepare, when: Planes, parameters: &[TILE_PREPARE] },
        kernel_if(
            Fused,
            "tile_cast",
            Frame,
            &[
                LIGHTS,
                TREE,
                SURFACES,
                MASKS,
                PREPARED_ROWS,
                CAMERA,
                SIZE,
                SAMPLES,
                TILE_SUBPIXELS,
                SOFT,
                FIRST_LIGHT,
                TILE_NEAREST_OUT,
                SHADOW_RESULTS,
            ],
        ),
        kernel_if(
            Separate,
            "tile_primary",
            Primary,
            &[
                LIGHTS,
                TREE,
                SURFACES,
                MASKS,
                PREPARED_ROWS,
                CAMERA,
                SIZE,
                SAMPLES,
                TILE_SUBPIXELS,
                TILE_NEAREST_OUT,
            ],
        ),
        kernel(
            "tile_shadow",
            Shadow,
            &[
                LIGHTS,
                TREE,
                SURFACES,
                MASKS,
                PREPARED_ROWS,
                CAMERA,
                SIZE,
                SAMPLES,
                TILE_SUBPIXELS,
                SOFT,
                FIRST_LIGHT,
                TILE_NEAREST_IN,
                SHADOW_RESULTS,
            ],
        ),
        kernel_if(
            Fact::Leftover,
            "tile_left_over",
            Leftover,
            &[
                LIGHTS,
                TREE,
                SURFACES,
                MASKS,
                PREPARED_ROWS,
                CAMERA,
                SIZE,
                SAMPLES,
                TILE_SUBPIXELS,
                SOFT,
                FIRST_LIGHT,
                TILE_NEAREST_IN,
                LEFTOVER,
            ],
        ),
        kernel(
            "tile_shade",
            Shade,
            &[
                LIGHTS,
                TREE,
                SURFACES,
                MASKS,
                TEXTURES,
                SOFT,
                PREPARED_ROWS,
                CAMERA,
                SIZE,
                FIRST_LIGHT,
                IMAGE,
                SAMPLES,
                TILE_SUBPIXELS,
                TILE_NEAREST_IN,
                SHADED_BY,
            ],
        ),
        SHOW_SKY,
        MARK_KERNEL,
        FILTER_KERNEL,
        APPLY_KERNEL,
    ],
    defines: &[
        COMMON_DEFINES,
        TEXTURE_DEFINES,
        SOFT_DEFINES,
        SIGN_DEFINES,
        TREE_DEFINES,
        PASSES_DEFINES,
        TILE_DEFINES,
        GROUP_DEFINES,
    ],
    rules: &[
        only("vectors", &["private"], "keeps a tile's rays in private memory"),
        only("shading", &["deferred"], SHADES_ONCE),
        only("triangles", &["global"], LEAF_ORDER),
        only("layout", &["soup"], LEAF_ORDER),
        rule("intersector", FilesIn("tile_gpu/intersect/", None), PREPARES_A_TILE),
        only("records", &["each-test"], PREPARES_A_TILE),
        only("epsilons", &["relative"], OWN_EDGES),
        only("node_width", &["32"], "tests one child of a node with each of the 32 work-items"),
        rule(
            "tile",
            AllBut(&["32x16"]),
            "keeps a tile in the registers of the 32 work-items, which hold at most 16x16 pixels",
        ),
    ],
};

/// The kernel that shows the sky's picture in pixels whose rays have hit nothing. Every family that supports a sky has
/// this kernel.
const SHOW_SKY: Kernel = Kernel {
    name: "show_sky",
    role: Background,
    when: Environment,
    parameters: &[SOFT, CAMERA, SIZE, IMAGE, SAMPLES, HITS_BEFORE],
};

/// The kernels for rays that a work-item casts one by one, or together in the lanes of a vector.
const CAST_KERNELS: &[Kernel] = &[
    Kernel {
        name: "prepare_records",
        role: Role::Records,
        when: Fact::Records,
        parameters: &[GEOMETRY, TREE, RECORDS_OUT],
    },
    Kernel {
        name: "prepare_origins",
        role: Prepare,
        when: Planes,
        parameters: &[GEOMETRY, LIGHTS_ONLY, CAMERA, PREPARED_OUT],
    },
    kernel_if(
        Fused,
        "cast_frame",
        Frame,
        &[GEOMETRY, LIGHTS, PREPARED, RECORDS, TREE, TEXTURES, SOFT, CAMERA, SIZE, IMAGE, SAMPLES, WORKING],
    ),
    kernel_if(
        Separate,
        "cast_primary",
        Primary,
        &[
            GEOMETRY,
            LIGHTS,
            PREPARED,
            RECORDS,
            TREE,
            TEXTURES,
            SOFT,
            CAMERA,
            SIZE,
            SAMPLES,
            NEAREST_OUT,
            WORKING,
        ],
    ),
    kernel_if(
        Separate,
        "shade_nearest",
        Shade,
        &[
            GEOMETRY, LIGHTS, PREPARED, RECORDS, TREE, TEXTURES, SOFT, CAMERA, SIZE, IMAGE, SAMPLES,
            NEAREST_IN, WORKING,
        ],
    ),
    kernel_if(
        GivenRays,
        "cast_rays",
        Rays,
        &[GEOMETRY, LIGHTS, PREPARED, RECORDS, TREE, TEXTURES, SOFT, RAYS, NEAREST_OUT, WORKING],
    ),
    SHOW_SKY,
    MARK_KERNEL,
    FILTER_KERNEL,
    APPLY_KERNEL,
];

/// The defines of programs with `CAST_KERNELS`. The host gives `TREE_DEFINES` only to a strategy with a tree.
const CAST_KERNELS_DEFINES: &[Defines] = &[
    COMMON_DEFINES,
    TEXTURE_DEFINES,
    SOFT_DEFINES,
    SIGN_DEFINES,
    CAST_DEFINES,
    PASSES_DEFINES,
    RAYS_DEFINES,
    TREE_DEFINES,
];

/// The kernel that decides which pixels get more samples. All families have the same kernel.
const MARK_KERNEL: Kernel =
    Kernel { name: "mark_rough", role: Mark, when: Sampled, parameters: &[SIZE, MARK_ROUGH] };

/// The kernels that filter soft light, which was cast at half resolution, and apply it to the whole picture.
const FILTER_KERNEL: Kernel = Kernel {
    name: "filter_half_light",
    role: FilterLight,
    when: HalfLight,
    parameters: &[HALF_LIGHT, HALF_LIGHT_LIT, RATIOS_OUT],
};
const APPLY_KERNEL: Kernel = Kernel {
    name: "apply_half_light",
    role: ApplyLight,
    when: HalfLight,
    parameters: &[HALF_LIGHT, RATIOS, SIZE, IMAGE],
};

const NO_TREE: &str = "uses no tree, so only the default value is allowed";
const NO_TILES: &str = "casts no tiles of rays, so only the default value is allowed";
const LEAF_ORDER: &str = "reads whole triangles from global memory, in the order of its tree's leaves";
const NORMALS_ONLY: &str =
    "reads corners in the order of its tree's leaves, and has files for the normals alone";
const SHADES_ONCE: &str = "shades only the nearest hit of each ray";
const PREPARES_A_TILE: &str = "prepares a leaf's triangles itself, once for all rays of a tile";
const OWN_EDGES: &str = "uses its own edge functions, without the paper's tolerances";

const fn kernel(name: &'static str, role: Role, parameters: &'static [&'static [Parameter]]) -> Kernel {
    kernel_if(Always, name, role, parameters)
}

const fn kernel_if(
    when: Fact,
    name: &'static str,
    role: Role,
    parameters: &'static [&'static [Parameter]],
) -> Kernel {
    Kernel { name, role, when, parameters }
}

const fn rule(axis: &'static str, takes: super::Values, because: &'static str) -> Rule {
    Rule { axis, takes, because }
}

const fn only(axis: &'static str, values: &'static [&'static str], because: &'static str) -> Rule {
    rule(axis, Only(values), because)
}
