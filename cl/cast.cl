// The entry points. They own the argument lists and the __local declarations, and call what the axes provide.
// {braces} name an axis: the host puts the file of the strategy's value there.

#if !defined(LOCAL_X) || !defined(LOCAL_Y)
#error "LOCAL_X, LOCAL_Y: work-items of a work-group across and down"
#endif
#if !defined(CULL_BACK) || !defined(PAPER_EPSILONS) || !defined(FAST_MATH)
#error "CULL_BACK, PAPER_EPSILONS, FAST_MATH: 0 or 1"
#endif
#if !defined(RASTER) || !defined(TREE) || !defined(TILES)
#error "RASTER, TREE, TILES: 0 or 1: whether triangles are rasterised, rays walk a tree, rays walk it in tiles"
#endif
#ifndef TRIANGLES
#error "TRIANGLES: triangles of the scene where it is copied to __local memory, else 0"
#endif

#include "shared/width.cl"
#include "shared/vec3.cl"
#include "shared/camera.cl"
#include "shared/hit.cl"
#include "vectors/names.cl"
#include "vectors/{vectors}.cl"
#include "triangles/{triangles}.cl"
#include "triangles/staging.cl"
#include "layout/rows.cl"
#include "layout/{layout}.cl"
#include "intersect/{intersector}.cl"
#if TREE
#include "shared/tree.cl"
#endif
#include "triangles/rows.cl"
#include "shared/gather.cl"
#include "shared/reflectance.cl"
#if !TILES // which cast and shade in ways of their own
#define ANY_HIT 1
#include "traversal/{traversal}.cl"
#undef ANY_HIT
#include "shared/shade.cl"
#include "shading/{shading}.cl"
#define ANY_HIT 0
#include "traversal/{traversal}.cl"
#undef ANY_HIT
#endif

#if PLANES_OF_ORIGIN
#define PREPARED_PARAMETER , const __global float4 *restrict prepared
#define PREPARED_ROW , const int prepared_row
#define BIND_PREPARED(scene) scene.prepared = prepared;
#else
#define PREPARED_PARAMETER
#define PREPARED_ROW
#define BIND_PREPARED(scene)
#endif

#if TREE
#define TREE_PARAMETERS , const __global float *restrict nodes, const __global float *restrict leaves
#define BIND_TREE(scene)     \
    scene.tree.nodes = nodes;  \
    scene.tree.leaves = leaves;
#else
#define TREE_PARAMETERS
#define BIND_TREE(scene)
#endif

#define SCENE_PARAMETERS                                                                                   \
    GEOMETRY_PARAMETERS, const __global float *restrict lights, const int light_count, const float bias      \
        PREPARED_PARAMETER TREE_PARAMETERS
#define TILE_PARAMETERS                                                                                          \
    const __global float *restrict lights, const int light_count, const float bias,                                 \
        const __global float *restrict nodes, const __global float *restrict leaves,                                \
        const __global float4 *restrict surfaces, const __global float *restrict materials,                         \
        const int material_count PREPARED_PARAMETER PREPARED_ROW
#define SCENE_LOCALS GEOMETRY_LOCALS TILE_LOCALS
#define BIND_SCENE(scene)            \
    BIND_GEOMETRY(scene.geometry)    \
    scene.lights = lights;           \
    scene.light_count = light_count; \
    scene.bias = bias;               \
    BIND_PREPARED(scene)             \
    BIND_TREE(scene)                 \
    BIND_TILE(scene)                 \
    if (STAGE_VERTICES || STAGE_NORMALS || STAGE_MATERIALS) barrier(CLK_LOCAL_MEM_FENCE);

#define GROUP_SHAPE __attribute__((reqd_work_group_size(LOCAL_X, LOCAL_Y, 1)))

#if LINEAR_IN_PIXEL
#define search_ray ray_in_pixels
#else
#define search_ray camera_ray
#endif

// Puts rays into the working vectors and says from where their hits count.
varying begin_rays(Working *working, Ray ray) {
    const varying zero = (varying)(0.0f);
    working_set(working, RAY_ORIGIN, ray.origin);
    working_set(working, RAY_DIRECTION, ray.direction);
    working_set(working, WEIGHTS, vec3(zero, zero, zero));
    working_set(working, RADIANCE, vec3(zero, zero, zero));
    return ray.t_min;
}

// Writes radiance and, as the fourth component, 1 where the ray hit and 0 where it did not.
void store_radiance(__global float4 *image, int2 image_size, float4 background, Vec3 sum, Pixels pixels, Mask hits) {
    Lanes red, green, blue, hit;
    IntLanes x, y, inside;
    red.all = SELECT(hits, sum.x, (varying)(background.x));
    green.all = SELECT(hits, sum.y, (varying)(background.y));
    blue.all = SELECT(hits, sum.z, (varying)(background.z));
    hit.all = SELECT(hits, (varying)(1.0f), (varying)(0.0f));
    x.all = pixels.x;
    y.all = pixels.y;
    inside.all = pixels.inside;
    for (int lane = 0; lane < WIDTH; lane++)
        if (inside.each[lane])
            image[(size_t)y.each[lane] * image_size.x + x.each[lane]] =
                (float4)(red.each[lane], green.each[lane], blue.each[lane], hit.each[lane]);
}

// What a pass leaves for the next: a number a pixel, its nearest triangle or that one's place in leaf order.
void store_nearest(__global int *nearest, int2 image_size, Pixels pixels, varying_int numbers) {
    IntLanes x, y, inside, number;
    x.all = pixels.x;
    y.all = pixels.y;
    inside.all = pixels.inside;
    number.all = numbers;
    for (int lane = 0; lane < WIDTH; lane++)
        if (inside.each[lane]) nearest[(size_t)y.each[lane] * image_size.x + x.each[lane]] = number.each[lane];
}

varying_int load_nearest(const __global int *nearest, int2 image_size, Pixels pixels) {
    IntLanes x, y, inside, number;
    x.all = pixels.x;
    y.all = pixels.y;
    inside.all = pixels.inside;
    for (int lane = 0; lane < WIDTH; lane++)
        number.each[lane] =
            inside.each[lane] ? nearest[(size_t)y.each[lane] * image_size.x + x.each[lane]] : NO_HIT;
    return number.all;
}

#if !TILES
// A whole frame: primary rays, shading, shadow rays.
__kernel GROUP_SHAPE void cast_frame(SCENE_PARAMETERS, CAMERA_PARAMETERS, const int2 image_size,
                                     const float4 background, __global float4 *restrict image WORKING_PARAMETERS) {
    SCENE_LOCALS
    WORKING_LOCALS
    Scene scene;
    BIND_SCENE(scene)
    Working working;
    BIND_WORKING(working)
    const Pixels pixels = own_pixels(image_size);
    const varying t_min = begin_rays(&working, search_ray(eye, corner, step_x, step_y, pixels));
    Nearest nearest;
    closest_hit(&working, &scene, t_min, pixels.inside, &nearest);
#if LINEAR_IN_PIXEL
    begin_rays(&working, camera_ray(eye, corner, step_x, step_y, pixels));
#endif
    const Mask hits = pixels.inside & (nearest.triangle != NO_HIT);
    after_closest_hit(&working, &scene, &nearest, hits);
    store_radiance(image, image_size, background, working_get(&working, RADIANCE), pixels, hits);
}

// The nearest triangle of every pixel, or NO_HIT.
__kernel GROUP_SHAPE void cast_primary(SCENE_PARAMETERS, CAMERA_PARAMETERS, const int2 image_size,
                                       __global int *restrict nearest_triangle WORKING_PARAMETERS) {
    SCENE_LOCALS
    WORKING_LOCALS
    Scene scene;
    BIND_SCENE(scene)
    Working working;
    BIND_WORKING(working)
    const Pixels pixels = own_pixels(image_size);
    const varying t_min = begin_rays(&working, search_ray(eye, corner, step_x, step_y, pixels));
    Nearest nearest;
    closest_hit(&working, &scene, t_min, pixels.inside, &nearest);
    store_nearest(nearest_triangle, image_size, pixels, nearest.triangle);
}

// Shades the nearest triangle of every pixel, whoever found it.
__kernel GROUP_SHAPE void shade_nearest(SCENE_PARAMETERS, CAMERA_PARAMETERS, const int2 image_size,
                                        const float4 background, __global float4 *restrict image,
                                        const __global int *restrict nearest_triangle WORKING_PARAMETERS) {
    SCENE_LOCALS
    WORKING_LOCALS
    Scene scene;
    BIND_SCENE(scene)
    Working working;
    BIND_WORKING(working)
    const Pixels pixels = own_pixels(image_size);
    begin_rays(&working, camera_ray(eye, corner, step_x, step_y, pixels));
    Nearest nearest;
    nearest.t = (varying)(FAR);
    nearest.triangle = load_nearest(nearest_triangle, image_size, pixels);
    const Mask hits = nearest.triangle != NO_HIT;
    after_closest_hit(&working, &scene, &nearest, hits);
    store_radiance(image, image_size, background, working_get(&working, RADIANCE), pixels, hits);
}

// Casts any rays, for tests and for who wants more than pictures: a ray is origin.xyz, t_min, direction.xyz, 0.
__kernel GROUP_SHAPE void cast_rays(SCENE_PARAMETERS, const __global float4 *restrict rays, const int ray_count,
                                    __global int *restrict nearest_triangle WORKING_PARAMETERS) {
    SCENE_LOCALS
    WORKING_LOCALS
    Scene scene;
    BIND_SCENE(scene)
    Working working;
    BIND_WORKING(working)
    const int first = (int)(get_global_id(1) * get_global_size(0) + get_global_id(0)) * WIDTH;
    Lanes ray[7];
    IntLanes triangle;
    for (int lane = 0; lane < WIDTH; lane++) {
        const int at = min(first + lane, ray_count - 1);
        const float4 from = rays[2 * at], to = rays[2 * at + 1];
        ray[0].each[lane] = from.x, ray[1].each[lane] = from.y, ray[2].each[lane] = from.z;
        ray[3].each[lane] = to.x, ray[4].each[lane] = to.y, ray[5].each[lane] = to.z;
        ray[6].each[lane] = from.w;
    }
    working_set(&working, RAY_ORIGIN, vec3(ray[0].all, ray[1].all, ray[2].all));
    working_set(&working, RAY_DIRECTION, vec3(ray[3].all, ray[4].all, ray[5].all));
    Nearest nearest;
    closest_hit(&working, &scene, ray[6].all, (varying_int)(first) == first, &nearest);
    triangle.all = nearest.triangle;
    for (int lane = 0; lane < WIDTH; lane++)
        if (first + lane < ray_count) nearest_triangle[first + lane] = triangle.each[lane];
}

#endif

#if PLANES_OF_ORIGIN && !TILES
// The planes of every triangle (first dimension) for the eye and each light (second dimension).
__kernel void prepare_origins(GEOMETRY_PARAMETERS, const __global float *restrict lights, CAMERA_PARAMETERS,
                              __global float4 *restrict prepared) {
    const int triangle = get_global_id(0);
    const int origin = get_global_id(1);
    if (triangle >= triangle_count) return;
    const Uniform3 from = origin ? LOAD3(lights + 6 * (origin - 1)) : uniform3(eye.x, eye.y, eye.z);
    const __global float *at = soup + SOUP_STRIDE * triangle;
    Corners corners;
    corners.a = LOAD3(at);
    corners.b = LOAD3(at + 3);
    corners.c = LOAD3(at + 6);
    // A shadow ray runs towards the light: its front faces are those that face away from the light.
    Row row = planes_of(corners, from, origin ? 1.0f : -1.0f);
#if LINEAR_IN_PIXEL
    if (!origin) row = row_along_pixels(row, corner, step_x, step_y);
#endif
    STORE_ROW(row, prepared + 3 * ((size_t)origin * triangle_count + triangle))
}
#endif

#if RASTER
#include "traversal/raster.cl"
#endif
#if TILES && WIDTH == 1
#include "traversal/tile_group.cl"
#elif TILES
#include "traversal/tile.cl"
#endif
