// Prepares a leaf's triangle for the rays of a pass (rays that run mainly along one axis: see entry.cl), and tests rays
// against it. The test needs the planes through the rays' origin and the triangle's edges, as in
// tile_gpu/intersect/edge_planes.cl, but loads them from a table. The kernel tile_prepare computes the table: once per
// frame for the eye, and once per round of lights (see shadow.cl) for the round's lights. For each origin, the table
// has three arrays, one for each axis. For each triangle, an array has a quad (float4): the components, along the
// array's axis, of the three planes and of the linear function 1/z. Three loads, one per array, read all planes of a
// triangle, whatever the pass's axes.

// The table of planes for one origin (the eye or a light). In each array, the triangles are in leaf order, so that
// neighbouring lanes load neighbouring quads:
//
//                 triangle 0               triangle 1               ...
//     x's array   u.x  v.x  w.x  (1/z).x   u.x  v.x  w.x  (1/z).x
//     y's array   u.y  v.y  w.y  (1/z).y   ...
//     z's array   u.z  v.z  w.z  (1/z).z
//
// For rays that run mainly along x, the table's arrays are read in the order y, z, x. Permuting the axes therefore
// costs no instruction.
#include "common/planes_of_origin.cl"

// The overlap of neighbouring triangles, in units of the usual overlap, which planes_of scales to 1.
// tile_gpu/intersect/edge_planes.cl has half of the usual overlap, too, and explains why.
#define OVERLAP 0.5f

// Bounds four linear functions at once: a triangle's three planes and 1/z. `plane` has, for each of the four functions,
// the coefficient of one slope (x or y per unit of z). This slope lies between `low` and `high`. Returns, for each
// function, `rest` plus the largest value of the coefficient times the slope. For a coefficient p, the largest value is
// p times the middle of the interval, plus |p| times half the interval's width.
INLINED float4 most_along(float4 plane, float low, float high, float4 rest) {
    const float middle = 0.5f * (low + high), half_width = 0.5f * (high - low);
    float4 most;
    most.x = MULTIPLY_ADD(fabs(plane.x), half_width, MULTIPLY_ADD(plane.x, middle, rest.x));
    most.y = MULTIPLY_ADD(fabs(plane.y), half_width, MULTIPLY_ADD(plane.y, middle, rest.y));
    most.z = MULTIPLY_ADD(fabs(plane.z), half_width, MULTIPLY_ADD(plane.z, middle, rest.z));
    most.w = MULTIPLY_ADD(fabs(plane.w), half_width, MULTIPLY_ADD(plane.w, middle, rest.w));
    return most;
}

// Prepares the triangle at an index in leaf order. The prepared triangle contains the planes' components along the
// pass's axes. Returns 1 if any ray of the shaft (the pass's rays) may hit the triangle at a 1/z greater than `worst`
// (the smallest 1/z at which a hit matters), else 0.
INLINED int prepare(const Shaft *shaft, const Tree *tree, int index, float worst, const int any, Candidate *triangle) {
    const __global float4 *quads = shaft->planes;
    const uint at = (uint)index; // three arrays have fewer than 2^32 quads
    const float4 across = quads[shaft->across_row + at], down = quads[shaft->down_row + at];
    const float4 along = quads[shaft->along_row + at];
    const float overlap = OVERLAP * shaft->longest;
    triangle->a = across;
    triangle->b = down;
    // A ray's direction is (x, y, 1), so is_hit adds the third component of a plane as it is. The overlap, by which the
    // three edge planes move outwards, is added to their third components here, once per triangle instead of per ray.
    triangle->c.x = MULTIPLY_ADD(shaft->sign, along.x, overlap);
    triangle->c.y = MULTIPLY_ADD(shaft->sign, along.y, overlap);
    triangle->c.z = MULTIPLY_ADD(shaft->sign, along.z, overlap);
    triangle->c.w = shaft->sign * along.w;
    const float4 most = most_along(across, shaft->low_x, shaft->high_x,
                                   most_along(down, shaft->low_y, shaft->high_y, triangle->c));
    // If all rays of the pass (the shaft) are outside the same edge, no ray hits. If the triangle is behind the nearest
    // hits of all rays, its own hits do not matter. (The factor 1.00001 allows for the rounding of 1/z.)
    return (most.x >= 0.0f) & (most.y >= 0.0f) & (most.z >= 0.0f) & (most.w * 1.00001f > worst);
}

// Returns 1 if a ray hits the triangle at a 1/z greater than `nearest`, else 0. If `any` is 0 (only the nearest hit
// counts), 1/z must also be less than `ceiling`. `*per_depth` receives 1/z. Eight multiply-adds give the three edge
// functions and 1/z.
INLINED int is_hit(const Candidate *triangle, float x, float y, float nearest, float ceiling, const int any,
                   float *per_depth) {
    const float4 a = triangle->a, b = triangle->b, c = triangle->c;
    const float u = MULTIPLY_ADD(a.x, x, MULTIPLY_ADD(b.x, y, c.x));
    const float v = MULTIPLY_ADD(a.y, x, MULTIPLY_ADD(b.y, y, c.y));
    const float w = MULTIPLY_ADD(a.z, x, MULTIPLY_ADD(b.z, y, c.z));
    *per_depth = MULTIPLY_ADD(a.w, x, MULTIPLY_ADD(b.w, y, c.w));
    // `outside` is negative if any of the three edge functions is negative, since the bitwise or joins their sign bits.
    const int outside = as_int(u) | as_int(v) | as_int(w);
    return outside >= 0 && *per_depth > nearest && (any || *per_depth < ceiling);
}

// Each work-item computes the planes of one triangle for one origin. Dimension 0 of the index space numbers the
// triangles, dimension 1 the origins from `first_origin` on. Origin 0 is the eye; all others are lights of a round of
// lights (see shadow.cl). The kernel also empties the queue of leftover shadow rays, so that no separate command is
// needed for this.
__kernel void tile_prepare(TILE_PREPARE_PARAMETERS) {
    const int index = get_global_id(0), origin = first_origin + (int)get_global_id(1);
    if (get_global_id(0) == 0 && get_global_id(1) == 0) *queued = 0;
    if (index >= count) return;
    const Uniform3 from =
        origin ? LOAD3(lights + LIGHT_FLOATS * (first_light + origin - 1)) : uniform3(eye.x, eye.y, eye.z);
    Tree tree;
    tree.leaves = leaves;
    // The last argument of planes_of, the sign for front faces, is negative for rays from the eye. A shadow ray runs
    // from a hit to the light, but is tested in the opposite direction, from the light. The sign is therefore reversed
    // for shadow rays.
    const Row row = planes_of(leaf_corners(&tree, index), from, origin ? 1.0f : -1.0f);
    __global float4 *quads = prepared + 3 * (size_t)origin * count + index;
    quads[0] = (float4)(row.a.x, row.b.x, row.c.x, row.u);
    quads[count] = (float4)(row.a.y, row.b.y, row.c.y, row.v);
    quads[2 * (size_t)count] = (float4)(row.a.z, row.b.z, row.c.z, row.w);
}
