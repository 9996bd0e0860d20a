//! The kernels of each family, with their parameters.

use super::Fact::{self, Always, Environment, Fused, GivenRays, HalfLight, Planes, Sampled, Separate};
use super::Role::{
    ApplyLight, Background, FilterLight, Frame, Leftover, Mark, Prepare, Primary, Rays, Resolve, Shade,
    Shadow,
};
use super::parameters::*;
use super::{Kernel, Parameter, Role};

/// The kernels for rays that a work-item casts one by one, or together in the lanes of a vector.
pub const CAST_KERNELS: &[Kernel] = &[
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
        &[
            GEOMETRY, LIGHTS, PREPARED, RECORDS, TREE, TEXTURES, COLOURS, SOFT, CAMERA, SIZE, IMAGE, SAMPLES,
            WORKING,
        ],
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
            COLOURS,
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
            GEOMETRY, LIGHTS, PREPARED, RECORDS, TREE, TEXTURES, COLOURS, SOFT, CAMERA, SIZE, IMAGE, SAMPLES,
            NEAREST_IN, WORKING,
        ],
    ),
    kernel_if(
        GivenRays,
        "cast_rays",
        Rays,
        &[GEOMETRY, LIGHTS, PREPARED, RECORDS, TREE, TEXTURES, COLOURS, SOFT, RAYS, NEAREST_OUT, WORKING],
    ),
    SHOW_SKY,
    MARK_KERNEL,
    FILTER_KERNEL,
    APPLY_KERNEL,
];

/// The kernels that rasterise triangles.
pub const RASTER_KERNELS: &[Kernel] = &[
    kernel("raster_depth", Primary, &[GEOMETRY, CAMERA, SIZE, DEPTH]),
    kernel("raster_nearest", Resolve, &[GEOMETRY, CAMERA, SIZE, DEPTH_TO_NEAREST]),
    kernel(
        "shade_nearest",
        Shade,
        &[
            GEOMETRY, LIGHTS, PREPARED, RECORDS, TREE, COLOURS, CAMERA, SIZE, IMAGE, SAMPLES, NEAREST_IN,
            WORKING,
        ],
    ),
    MARK_KERNEL,
];

/// The kernels that cast the rays of tiles, with one work-item per tile.
pub const TILE_CPU_KERNELS: &[Kernel] = &[
    kernel_if(
        Fused,
        "tile_frame",
        Frame,
        &[LIGHTS, TREE, NORMALS, MASKS, TEXTURES, COLOURS, SOFT, CAMERA, SIZE, IMAGE, SAMPLES, SUBPIXELS],
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
            COLOURS,
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
];

/// The kernels that cast the rays of tiles, with 32 work-items per tile.
pub const TILE_GPU_KERNELS: &[Kernel] = &[
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
            COLOURS,
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
];

/// The kernel that adds the sky's picture where rays have hit nothing. Every family that supports a sky has this
/// kernel.
const SHOW_SKY: Kernel = Kernel {
    name: "show_sky",
    role: Background,
    when: Environment,
    parameters: &[SOFT, CAMERA, SIZE, IMAGE, SAMPLES, HITS_BEFORE],
};

/// The kernel that decides which pixels get more samples. This kernel is the same in all kernel families.
const MARK_KERNEL: Kernel =
    Kernel { name: "mark_rough", role: Mark, when: Sampled, parameters: &[SIZE, MARK_ROUGH] };

/// The kernel that filters the ratio of the two half pictures of soft light. `APPLY_KERNEL` multiplies the whole
/// picture by the filtered ratio.
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
