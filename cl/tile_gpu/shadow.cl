// Casts the shadow rays of a round of lights (lights that a frame processes together). Shadow rays are tested from
// a light to the hits that face it. Only rays without a common origin (soft.cl) start at hits.

// SHADOW_PASSES and SHADOW_BUDGET limit the work for one tile and one light: the number of passes, and the number of
// nodes and leaves that all passes together take from the stack. A pass casts rays that are close to each other. At
// silhouettes, some shadow rays remain undecided when one of these limits is reached. Such leftover shadow rays are
// cast later, after the rays of all tiles, one at a time, each by a whole group of 32 lanes.
#define SHADOW_PASSES 4
#define SHADOW_BUDGET 32
// A lane's word contains the results of the lane's shadow rays. For each light of the round of lights, the word has one
// bit for each of the lane's rays from the eye. The word's size limits the number of lights per round. A pixel's word
// contains the results for one ray of the lane: every RAYS-th bit of the lane's word, one for each light. Bit 31 of a
// pixel's word is set if some of the pixel's shadow rays are leftover shadow rays.
#ifndef LIGHTS_OF_ROUND
#error "LIGHTS_OF_ROUND: lights whose shadow rays are cast at a time"
#endif
#define SOME_LEFTOVER 0x80000000u
// With two rays per lane, bit 2 * light + ray of a lane's word belongs to that light and that ray:
//
//     bit   ...  5  4  3  2  1  0
//     light      2  2  1  1  0  0
//     ray        1  0  1  0  1  0
//
// BITS_OF_PIXEL(word, 1) returns the pixel's word of ray 1: it shifts the bits of ray 1 to bits 0, 2, 4, ... and clears
// all other bits. (0xffffffff / 3 is 0x55555555, in which every second bit is set.)
#define BITS_OF_LIGHT(bits, light) ((bits) << RAYS * (light))
#define LIGHT_OF_BIT(bit) ((bit) / RAYS)
#define BITS_OF_PIXEL(bits, ray) ((bits) >> (ray) & 0xffffffffu / ((1u << RAYS) - 1u))

INLINED Vec3 load_vec3(const __global float *at) { return vec3(at[0], at[1], at[2]); }

// The hit of a ray from the eye on its nearest triangle; the normal may have any length.
typedef struct {
    Vec3 point, normal;
    int material;
#if TEXTURES || CORNER_COLOURS
    int triangle;
    float w1, w2; // the weights of the triangle's second and third corner
    float t;
#endif
#if SOFT
    EyeRay pixel; // with soft light, the grid of rays has one ray per pixel of the image
#endif
} SurfacePoint;

// Computes the hit of a ray on the triangle at an index in leaf order.
INLINED SurfacePoint surface_point_of(const Tree *tree, const __global float *surfaces, Ray ray, int leaf_index) {
    const __global float4 *corners = (const __global float4 *)tree->leaves + 3 * (size_t)leaf_index;
    const __global float *normals = surfaces + NORMAL_FLOATS * (size_t)leaf_index;
    const float4 a = corners[0], b = corners[1], c = corners[2];
    const Vec3 v0 = vec3(a.x, a.y, a.z);
    const Vec3 e1 = subtract(vec3(b.x, b.y, b.z), v0), e2 = subtract(vec3(c.x, c.y, c.z), v0);
    // t and weights are computed again, as in every strategy with shading = deferred, so that the picture does not
    // depend on the test that found the triangle.
    const Hit hit = intersect_plane(v0, e1, e2, ray.origin, ray.direction);
    const Vec3 n0 = load_vec3(normals), n1 = load_vec3(normals + 3), n2 = load_vec3(normals + 6);
    SurfacePoint surface_point;
    surface_point.point = along(ray.origin, hit.t, ray.direction);
    surface_point.normal = along(along(scale(n0, 1.0f - hit.w1 - hit.w2), hit.w1, n1), hit.w2, n2);
#if SMOOTH_SHADOWS
    const Vec3 all_corners[3] = {v0, vec3(b.x, b.y, b.z), vec3(c.x, c.y, c.z)}, all_normals[3] = {n0, n1, n2};
    const float weights[3] = {1.0f - hit.w1 - hit.w2, hit.w1, hit.w2};
    move_to_smooth_surface(all_corners, all_normals, weights, &surface_point.point);
#endif
    surface_point.material = as_int(b.w);
#if TEXTURES || CORNER_COLOURS
    surface_point.triangle = as_int(a.w);
    surface_point.w1 = hit.w1;
    surface_point.w2 = hit.w2;
    surface_point.t = hit.t;
#endif
    return surface_point;
}

// Returns a ray from the eye with a direction of length 1.
INLINED Ray unit_ray(CAMERA_PARAMETERS, EyeRay eye_ray) {
    Pixels one;
#if SAMPLED
    one.x = one.y = 0;
    one.sample_x = eye_ray.ray_x;
    one.sample_y = eye_ray.ray_y;
#else
    one.x = eye_ray.x;
    one.y = eye_ray.y;
#endif
    one.inside = eye_ray.inside;
    return camera_ray(eye, corner, step_x, step_y, &one);
}

// Returns the hit of a ray from the eye. Callers may use only the hit's point and normal. Point and normal determine
// which lights the surface faces, and where the shadow rays from these lights end.
INLINED SurfacePoint surface_point_for_lights(const Tree *tree, const __global float *surfaces, CAMERA_PARAMETERS,
                                              EyeRay eye_ray, int leaf_index) {
    // The triangle's edge planes give t and weights quickly. In slivers (thin triangles), the rounding errors of t and
    // weights are too large for shading. Smooth shadows also need the triangle's corners.
#if PLANES_OF_ORIGIN && !SMOOTH_SHADOWS
    const __global float4 *planes = planes_for(tree, 0) + leaf_index;
    const __global float *normals = surfaces + NORMAL_FLOATS * (size_t)leaf_index;
    const float4 along_x = planes[0], along_y = planes[tree->row], along_z = planes[2 * (size_t)tree->row];
    const Vec3 n0 = load_vec3(normals), n1 = load_vec3(normals + 3), n2 = load_vec3(normals + 6);
    const Vec3 direction = direction_of(corner, step_x, step_y, eye_ray);
    // `inside` has four dot products: 1 / t, and the three weights, which are not yet divided by their sum.
    const float4 inside = along_x * direction.x + along_y * direction.y + along_z * direction.z;
    SurfacePoint surface_point;
    surface_point.point = along(vec3(eye.x, eye.y, eye.z), reciprocal(inside.w), direction);
    surface_point.normal = along(along(scale(n0, inside.x), inside.y, n1), inside.z, n2);
    surface_point.material = 0;
    return surface_point;
#else
    return surface_point_of(tree, surfaces, unit_ray(eye, corner, step_x, step_y, eye_ray), leaf_index);
#endif
}

// Returns 1 if a hit needs a shadow ray to a light, else 0: the surface must face the light, and the hit's distance
// from the light must exceed the bias. `offset` points from the hit to the light.
INLINED int faces(SurfacePoint surface_point, Vec3 offset, float bias) {
    return (dot3(offset, surface_point.normal) > 0.0f) & (dot3(offset, offset) > bias * bias);
}

// Returns the vector from a light to the end of its shadow ray, shortly before the hit. `offset` points from the hit to
// the light.
INLINED Vec3 direction_to_hit(SurfacePoint surface_point, Vec3 offset, float bias) {
    const float per_distance = rsqrt(dot3(offset, offset));
    // The cosine is divided by the normal's length, which need not be 1.
    const float cosine = dot3(offset, surface_point.normal) * per_distance *
                         rsqrt(dot3(surface_point.normal, surface_point.normal));
    return scale(offset, gap_before_hit(bias * per_distance, reciprocal(cosine)) - 1.0f);
}

#if SOFT
#include "tile_gpu/soft.cl"
#endif
// The additional parameter of functions in programs with soft light, including the comma after the parameter.
#if SOFT // with soft light, a frame adds one sample to each pixel
#if SAMPLED
#define BIND_LANE_SAMPLE own_sources.soft.lane_sample = 0;
#else
#define BIND_LANE_SAMPLE
#endif
#define SOURCES_PARAMETER const Sources *sources,
#define SOURCES_ARGUMENT sources,
#define BIND_SOURCES                       \
    Sources own_sources;                   \
    own_sources.soft.numbers = soft;       \
    own_sources.soft.sample = sample;      \
    BIND_LANE_SAMPLE                       \
    own_sources.light_count = light_count; \
    own_sources.first_light = first_light; \
    const Sources *sources = &own_sources;
#else
#define SOURCES_PARAMETER
#define SOURCES_ARGUMENT
#define BIND_SOURCES
#define SOURCE_COUNT(light_count) light_count
#endif

// Computes the rays from a light to the tile's hits. Returns the hits in `wanted` that need a shadow ray, one bit each.
INLINED uint light_directions(Group *group, const Tree *tree, const __global float *surfaces, CAMERA_PARAMETERS,
                              int2 grid, const __global int *nearest, Vec3 light, float bias, uint wanted,
                              Directions *directions) {
    uint cast = 0;
    directions->per_begin = FAR;
    directions->per_end = 1.0f; // a direction reaches to the ray's end (direction_to_hit), so the ray ends at t = 1
    EACH_RAY(ray) { // no branch, so that the loads of all rays overlap
        const EyeRay eye_ray = tile_ray(group, ray, grid);
        const int hit = HAS(wanted, ray) != 0;
        const int leaf_index = hit ? nearest[index_of(eye_ray, grid)] : 0;
        const SurfacePoint surface_point =
            surface_point_for_lights(tree, surfaces, eye, corner, step_x, step_y, eye_ray, leaf_index);
        const Vec3 offset = subtract(light, surface_point.point);
        const Vec3 direction = direction_to_hit(surface_point, offset, bias);
        cast |= hit & faces(surface_point, offset, bias) ? 1u << ray : 0u;
        directions->x[ray] = direction.x, directions->y[ray] = direction.y, directions->z[ray] = direction.z;
#if CUTOUTS
        directions->point[ray] = surface_point.point;
#endif
    }
    return cast;
}

// Casts the shadow rays from a light to a tile's hits. Returns the rays that nothing blocks, one bit each. `*left`
// receives the undecided rays, for which the tile did not find out whether something blocks them. Each pass computes
// the rays again, and reads the indices of the hit triangles again. Storing the rays and indices would take registers
// during the traversal, and more than one pass is rare.
INLINED uint unblocked(Group *group, const Tree *tree, const __global float *surfaces, CAMERA_PARAMETERS,
                       int2 grid, const __global int *nearest, uint hits, Origin light, float bias,
                       __local uint2 *stack, const Candidates *candidates, uint *left) {
    uint todo = hits, clear = 0;
    int budget = SHADOW_BUDGET;
    *left = 0;
    for (int pass = 0; lane_any(group, todo != 0) && pass < SHADOW_PASSES && budget > 0; pass++) {
        Shaft shaft;
        RayPacket packet;
        Directions directions;
        // Only hits that face the light have a shadow ray.
        todo = light_directions(group, tree, surfaces, eye, corner, step_x, step_y, grid, nearest,
                                vec3(light.at.x, light.at.y, light.at.z), bias, todo, &directions);
        if (lane_any(group, todo != 0)) {
            // A pass takes one ray as its leader and casts the rays close to the leader; all other rays wait for the
            // next pass.
            const uint active = begin_pass(group, tree, light, &directions, todo, 1, &shaft, &packet);
            const int enough = walk(group, tree, &shaft, &packet, 1, &budget, stack, candidates);
            EACH_RAY(ray) {
                // If something blocks the ray, its `nearest` is FAR. If the budget (of nodes and leaves to visit) was
                // not enough, all rays that nothing has blocked so far are undecided.
                const int open = HAS(active, ray) && packet.nearest[ray] < FAR;
                clear |= open && enough ? 1u << ray : 0u;
                *left |= open && !enough ? 1u << ray : 0u;
            }
            todo &= ~active;
        }
    }
    *left |= todo;
    return clear;
}

#if SOFT
// Returns the hits that face a source (a light or the sky), one bit each. In pictures of unoccluded light, every hit
// that faces a source receives this source's light.
INLINED uint faces_source(Group *group, const Tree *tree, const __global float *surfaces, CAMERA_PARAMETERS, int2 grid,
                          const __global int *nearest, uint hits, const Sources *sources, const __global float *lights,
                          int light, float bias) {
    const int source = sources->first_light + light;
    if (source >= sources->light_count) return hits; // every hit faces the sky
    Directions directions;
    return light_directions(group, tree, surfaces, eye, corner, step_x, step_y, grid, nearest,
                            load_vec3(lights + LIGHT_FLOATS * source), bias, hits, &directions);
}
#endif

// Adds this lane's ray from the eye to the queue if the ray has leftover shadow rays. In `lights`, the bits of the
// leftover shadow rays' lights are set. One lane reserves the queue's entries for all lanes of the group.
INLINED void enqueue(Group *group, EyeRay eye_ray, int2 grid, uint lights, __global uint2 *queue,
                     __global uint *queued) {
    const uint enqueuing = lane_ballot(group, lights != 0);
    // The function continues even if no lane has a ray to enqueue. (One compiler fails if a function with barriers
    // returns early.)
    uint first = 0;
    // One atomic operation per group is enough: a lane with a ray to enqueue finds its place in the queue by its rank
    // among such lanes.
    if (enqueuing && group->lane == 0) first = atomic_add(queued, popcount(enqueuing));
    first = lane_get(group, first, 0);
    if (lights) queue[first + BITS_BEFORE(group, enqueuing)] = (uint2)(index_of(eye_ray, grid), lights);
}

// The buffers for the results of shadow rays.
typedef struct {
    __global uint *lit;    // the pixel's word of each ray from the eye that hits something
    __global uint2 *queue; // the index of a ray from the eye with leftover shadow rays, and the bits of their lights
    __global uint *queued; // number of entries in the queue
} ShadowResults;

// Casts the shadow rays of a round of lights, from the light `first_light` on. In a pixel's word, a light's bit is set
// if the pixel's hit faces the light, and nothing blocks the light. Adds leftover shadow rays to the queue.
INLINED void find_lit(Group *group, const Tree *tree, const __global float *surfaces, CAMERA_PARAMETERS,
                      int2 grid, const __global int *nearest, uint hits, const __global float *lights,
                      int light_count, int first_light, float bias, __local uint2 *stack, const Candidates *candidates,
                      SOURCES_PARAMETER ShadowResults results) {
    uint reached = 0, leftover = 0;
    const int end = min(SOURCE_COUNT(light_count) - first_light, LIGHTS_OF_ROUND);
    for (int light = 0; light < end; light++) {
        uint left;
#if SOFT
        if (IS_UNOCCLUDED(&sources->soft)) {
            reached |= BITS_OF_LIGHT(faces_source(group, tree, surfaces, eye, corner, step_x, step_y, grid, nearest, hits,
                                                  sources, lights, light, bias), light);
            continue;
        }
        if (lacks_common_origin(sources, light)) {
            // All rays without a common origin become leftover shadow rays.
            leftover |= BITS_OF_LIGHT(hits, light);
            continue;
        }
#endif
        const Origin origin = origin_at(LOAD3(lights + LIGHT_FLOATS * (first_light + light)), 1 + light);
        // Lights are processed one after the other. The results for a light are shifted to the light's bits in
        // `reached` and `leftover`.
        const uint clear = unblocked(group, tree, surfaces, eye, corner, step_x, step_y, grid, nearest, hits, origin,
                                     bias, stack, candidates, &left);
        reached |= BITS_OF_LIGHT(clear, light);
        leftover |= BITS_OF_LIGHT(left, light);
    }
    EACH_RAY(ray) {
        const EyeRay eye_ray = tile_ray(group, ray, grid);
        // The pixel's word has a bit for each light that reaches the pixel, and bit 31 if the pixel is in the queue.
        const uint left = BITS_OF_PIXEL(leftover, ray) ? SOME_LEFTOVER : 0u;
        if (HAS(hits, ray)) results.lit[index_of(eye_ray, grid)] = BITS_OF_PIXEL(reached, ray) | left;
    }
    for (int ray = 0; ray < RAYS; ray++)
        enqueue(group, tile_ray(group, ray, grid), grid, BITS_OF_PIXEL(leftover, ray), results.queue, results.queued);
}

#define BIND_RESULTS       \
    ShadowResults results; \
    results.lit = lit;     \
    results.queue = queue; \
    results.queued = queued;

// Casts the shadow rays from the lights of one round of lights to the nearest hits.
__kernel GROUP_SHAPE GROUP_ATTRIBUTE void tile_shadow(TILE_SHADOW_PARAMETERS) {
    STACK_LOCALS
    LEAF_LOCALS
    TREE_OF_TILES
    BIND_RESULTS
    BIND_SOURCES
    const int2 grid = GRID_OF(image_size);
    uint hits = 0;
    EACH_RAY(ray) {
        const EyeRay eye_ray = tile_ray(&group, ray, grid);
        hits |= eye_ray.inside && nearest[index_of(eye_ray, grid)] != NO_HIT ? 1u << ray : 0u;
    }
    find_lit(&group, &tree, surfaces, eye, corner, step_x, step_y, GRID_OF(image_size), nearest, hits, lights, light_count,
             first_light, bias, stack, &candidates, SOURCES_ARGUMENT results);
}

#if FUSED
// Casts rays from the eye, then shadow rays. While the last tiles' rays from the eye are cast, the shadow rays of other
// tiles are already cast, too.
__kernel GROUP_SHAPE GROUP_ATTRIBUTE void tile_cast(TILE_CAST_PARAMETERS) {
    STACK_LOCALS
    LEAF_LOCALS
    TREE_OF_TILES
    BIND_RESULTS
    BIND_SOURCES
    const uint hits =
        find_nearest(&group, &tree, eye, corner, step_x, step_y, GRID_OF(image_size), stack, &candidates, nearest);
    find_lit(&group, &tree, surfaces, eye, corner, step_x, step_y, GRID_OF(image_size), nearest, hits, lights, light_count,
             first_light, bias, stack, &candidates, SOURCES_ARGUMENT results);
}
#endif
