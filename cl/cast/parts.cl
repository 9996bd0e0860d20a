// This file includes the parts of kernels that cast rays: common files, and one file for each of several axes of the
// strategy. Macros assign the kernels' arguments to structures. In an include, the name of an axis in {braces} is
// replaced by the strategy's value. The host leaves out an include under `#if NAME` if it defines NAME as 0.

#ifndef CULL_BACK
#error "CULL_BACK: 0 or 1: whether culling = back"
#endif
#ifndef TREE
#error "TREE: 0 or 1: whether rays walk a tree"
#endif
#if !defined(PLANES_OF_ORIGIN) || !defined(LINEAR_IN_PIXEL)
#error "PLANES_OF_ORIGIN: 0 or 1: whether a row per triangle is prepared for the eye and each light; LINEAR_IN_PIXEL: 0 or 1: whether the rows for the eye consist of functions of the pixel"
#endif
#ifndef RECORDS_ONCE
#error "RECORDS_ONCE: 0 or 1: whether the data that a test reads of each triangle is prepared once per scene"
#endif
#ifndef TRIANGLES
#error "TRIANGLES: number of triangles if a work-group copies them to __local memory, else 0"
#endif
#include "common/scene_defines.cl"

#include "common/work_group.cl"
#include "common/width.cl"
#include "common/vec3.cl"
#include "common/camera.cl"
#include "common/hit.cl"
#if SAMPLED
#include "common/samples.cl"
#include "common/mark_rough.cl"
#endif
#include "cast/working.cl"
#include "cast/vectors/{vectors}.cl"
#include "cast/triangles/{triangles}.cl"
#include "cast/staging.cl"
#include "common/rows.cl"
#if TEXTURES
#include "common/textures.cl"
#else
#define TEXTURED(surface, textures, triangle, w1, w2, direction, t) surface
#endif
#if AREA_LIGHTS
#include "common/area_light.cl"
#endif
#if CORNER_COLOURS
#include "common/corner_colours.cl"
#else
#define COLOURED(surface, colours, triangle, w1, w2) surface
#endif
#if SOFT
#include "common/soft.cl"
#endif
#include "cast/layout/{layout}.cl"
#include "cast/intersect/{intersector}.cl"
#if TREE
#include "common/tree.cl"
#endif
#include "cast/scene.cl"
#if SMOOTH_SHADOWS
#include "common/smooth_shadows.cl"
#endif
#include "cast/gather.cl"
#if CUTOUTS
#include "common/cutouts.cl"
#else
#define SOLID(textures, triangle, hit) hit.lanes
#define SOLID_ON_RAYS(textures, triangle, corners, from, direction, hits) hits
#endif
#include "common/reflectance.cl"
#if TREE
#include "cast/bvh_node.cl"
#endif
#define ANY_HIT 1
#if TREE
#include "cast/bvh.cl"
#else
#include "cast/exhaustive.cl"
#endif
#undef ANY_HIT
#if SOFT
#include "cast/soft.cl"
#endif
#include "cast/shade.cl"
#include "cast/shading/{shading}.cl"
#define ANY_HIT 0
#if TREE
#include "cast/bvh.cl"
#else
#include "cast/exhaustive.cl"
#endif
#undef ANY_HIT

#if PLANES_OF_ORIGIN
#define BIND_PREPARED(scene) scene.prepared = prepared;
#else
#define BIND_PREPARED(scene)
#endif

#if RECORDS_ONCE
#define BIND_RECORDS(scene) scene.records = (const __global ROW_UNIT *)records;
#else
#define BIND_RECORDS(scene)
#endif

#if TREE
#define BIND_TREE(scene)     \
    scene.tree.nodes = nodes;  \
    scene.tree.leaves = leaves;
#else
#define BIND_TREE(scene)
#endif

#if TEXTURES
#define BIND_TEXTURES(scene)            \
    scene.textures.rows = texture_rows; \
    scene.textures.words = texture_words; \
    scene.textures.cone = cone;
#else
#define BIND_TEXTURES(scene)
#endif

#if CORNER_COLOURS
#define BIND_COLOURS(scene) scene.corner_colours = corner_colours;
#else
#define BIND_COLOURS(scene)
#endif

#if SOFT
#define BIND_SOFT(scene)         \
    scene.soft.numbers = soft; \
    scene.soft.sample = sample;
#else
#define BIND_SOFT(scene)
#endif

#define SCENE_LOCALS GEOMETRY_LOCALS TILE_LOCALS
#define BIND_SCENE(scene)            \
    BIND_GEOMETRY(scene.geometry)    \
    scene.lights = lights;           \
    scene.light_count = light_count; \
    scene.bias = bias;               \
    BIND_PREPARED(scene)             \
    BIND_RECORDS(scene)              \
    BIND_TREE(scene)                 \
    BIND_TEXTURES(scene)             \
    BIND_COLOURS(scene)              \
    BIND_SOFT(scene)                 \
    BIND_TILE(scene)                 \
    if (STAGE_VERTICES || STAGE_NORMALS || STAGE_MATERIALS) barrier(CLK_LOCAL_MEM_FENCE);

// The first lines of every kernel that casts rays.
#define SCENE_AND_WORKING  \
    SCENE_LOCALS           \
    WORKING_LOCALS         \
    Scene scene;           \
    BIND_SCENE(scene)      \
    Working working;       \
    BIND_WORKING(working)

#if LINEAR_IN_PIXEL
#define search_ray ray_in_pixels
#else
#define search_ray camera_ray
#endif

// Returns `pixels` with a narrower mask `inside`: only pixels that get another sample count as inside the image.
#if SAMPLED
static Pixels wanted_pixels(Pixels pixels, int2 image_size, const __global uint *wanted, uint earlier) {
    IntLanes x, y, inside;
    x.all = pixels.x;
    y.all = pixels.y;
    inside.all = pixels.inside;
    for (int lane = 0; lane < WIDTH; lane++)
        if (inside.each[lane] && !is_wanted(wanted, earlier, image_size, x.each[lane], y.each[lane])) inside.each[lane] = 0;
    pixels.inside = inside.all;
    return pixels;
}
#define CAST_PIXELS wanted_pixels(own_pixels(image_size), image_size, wanted, earlier)
#else
#define CAST_PIXELS own_pixels(image_size)
#endif

// Stores rays in the working vectors. Returns t_min: hits at this distance or nearer are ignored.
static varying begin_rays(Working *working, Ray ray) {
    const varying zero = (varying)(0.0f);
    working_set(working, RAY_ORIGIN, ray.origin);
    working_set(working, RAY_DIRECTION, ray.direction);
    // Later, all lanes read the vectors WEIGHTS and RADIANCE, even lanes that hit nothing, so both need a first value.
    working_set(working, WEIGHTS, vec3(zero, zero, zero));
    working_set(working, RADIANCE, vec3(zero, zero, zero));
    return ray.t_min;
}

#include "common/store_radiance.cl"
#if HALF_LIGHT
#include "common/pixel_rows.cl"
#include "common/half_light.cl"
#endif

// Stores one number per pixel for the pass that shades: the number of the pixel's nearest triangle, or NO_HIT. Even
// with a tree, the stored number is the triangle's number in the mesh, not its index in leaf order.
static void store_nearest(__global int *nearest, int2 image_size, Pixels pixels, varying_int numbers) {
    IntLanes x, y, inside, number;
    x.all = pixels.x;
    y.all = pixels.y;
    inside.all = pixels.inside;
    number.all = numbers;
    for (int lane = 0; lane < WIDTH; lane++)
        if (inside.each[lane]) nearest[(size_t)y.each[lane] * image_size.x + x.each[lane]] = number.each[lane];
}

// Returns the number of each pixel's nearest triangle, as store_nearest has stored it, or NO_HIT.
static varying_int load_nearest(const __global int *nearest, int2 image_size, Pixels pixels) {
    IntLanes x, y, inside, number;
    x.all = pixels.x;
    y.all = pixels.y;
    inside.all = pixels.inside;
    // Lanes outside the image count as rays that hit nothing, so that they are not shaded.
    for (int lane = 0; lane < WIDTH; lane++)
        number.each[lane] =
            inside.each[lane] ? nearest[(size_t)y.each[lane] * image_size.x + x.each[lane]] : NO_HIT;
    return number.all;
}

#if ENVIRONMENT
#include "common/show_sky.cl"
#endif
