//! The table of kernel families.

use super::Fact::Planes;
use super::Supported::{AllBut, FilesIn, Only};
use super::define_lists::*;
use super::kernels::{CAST_KERNELS, RASTER_KERNELS, TILE_CPU_KERNELS, TILE_GPU_KERNELS};
use super::{Family, Rule};

/// All kernel families. `Strategy::family` determines the family of a strategy.
pub static FAMILIES: [&Family; 5] = [&EXHAUSTIVE, &BVH, &RASTER, &TILE_CPU, &TILE_GPU];

/// The kernels that test each primary ray against every triangle, and each shadow ray against one triangle after
/// another until the shadow ray hits one.
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

/// The kernels that rasterise triangles. Shadow rays of this family are cast without a tree: they are tested
/// against one triangle after another.
pub static RASTER: Family = Family {
    name: "raster",
    label: "traversal = raster",
    entry: "raster/entry.cl",
    kernels: RASTER_KERNELS,
    defines: &[COMMON_DEFINES, CAST_DEFINES],
    rules: &[
        only("shading", &["deferred"], "finds the nearest triangle of every pixel before it shades"),
        only("passes", &["separate"], "finds the nearest triangle of every pixel before it shades"),
        only(
            "triangles",
            &["global", "constant"],
            "reads each triangle once in each kernel for primary rays, so __local memory would save nothing",
        ),
        only(
            "intersector",
            &["moller-trumbore"],
            "uses its own edge functions for primary rays, and moller-trumbore for shadow rays",
        ),
        only("records", &["each-test"], "reads each triangle once in each kernel for primary rays"),
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
    kernels: TILE_CPU_KERNELS,
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
        // The rule about the strategy's axis `width` is the first, because messages give the reason of the
        // first rule that a strategy breaks. If the width is wrong, a message about the value of another axis
        // would mislead, since this value may be allowed with another width. Tiles with `width = 1` belong to
        // the family `TILE_GPU`.
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
    kernels: TILE_GPU_KERNELS,
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

/// The defines of programs with `CAST_KERNELS`. The host defines the macros of `TREE_DEFINES` only if the strategy has
/// a tree.
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

const NO_TREE: &str = "uses no tree, so only the default value is allowed";
const NO_TILES: &str = "casts no tiles of rays, so only the default value is allowed";
const LEAF_ORDER: &str =
    "reads copies of the triangles' corners from global memory, in the order of its tree's leaves";
const NORMALS_ONLY: &str =
    "reads corners in the order of its tree's leaves, and normals with a file of cl/tile_cpu/layout/";
const SHADES_ONCE: &str = "shades only the nearest hit of each ray";
const PREPARES_A_TILE: &str = "prepares a leaf's triangles itself, once for all rays of a tile";
const OWN_EDGES: &str = "uses its own edge functions, without the paper's tolerances";

const fn rule(axis: &'static str, takes: super::Supported, because: &'static str) -> Rule {
    Rule { axis, takes, because }
}

const fn only(axis: &'static str, values: &'static [&'static str], because: &'static str) -> Rule {
    rule(axis, Only(values), because)
}
