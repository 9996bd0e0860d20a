// Prepares and tests a leaf's triangle for the rays of a pass, as in cast/intersect/watertight.cl: corners are sheared
// so that the ray becomes the z axis, and edge functions are differences of two products, each rounded separately. For
// all rays of a pass, z is the axis of the pass, not the axis of the largest component of a ray's own direction. The
// test stays watertight: a ray has the same axis for all triangles, so a corner that two triangles share is sheared in
// the same way. A prepared triangle contains the corners' coordinates along the three axes of the pass, relative to the
// origin. The fourth component of the corner `a` is a sign. For front faces, `det` (the sum of the edge functions) has
// this sign. This sign is reversed in two cases: for rays that run against the axis (their coordinates are mirrored),
// and for shadow rays (they are tested from their light). A prepared triangle:
//
//     a: | x y z sign |     b: | x y z 0 |     c: | x y z 0 |

#include "common/in_plane.cl"

// Returns the largest product of `turn` (1 or -1) and v . (x, y, 1), for all (x, y) in the box around the slopes of a
// shaft.
INLINED float most_turned(const Shaft *shaft, Uniform3 v, float turn) {
    return most_of(shaft, uniform_scale(v, turn));
}

// Prepares the triangle at an index in leaf order. Returns 1 if any ray of the shaft may hit the triangle at a 1/z
// greater than `worst` (the smallest 1/z at which a hit matters), else 0. The function's bounds allow for many times
// the rounding error of is_hit, so that no triangle is excluded for which is_hit returns 1.
INLINED int prepare(const Shaft *shaft, const Tree *tree, int index, float worst, const int any, Candidate *triangle) {
    Uniform3 a, b, c;
    const int used = load_corners(shaft, tree, index, &a, &b, &c);
    a = seen(shaft, a), b = seen(shaft, b), c = seen(shaft, c);
    triangle->a = quad(a, any ? -shaft->sign : shaft->sign);
    triangle->b = quad(b, 0.0f);
    triangle->c = quad(c, 0.0f);
    const Uniform3 e1 = uniform_difference(b, a), e2 = uniform_difference(c, a);
    // The three edge functions at (x, y, 1) are the dot products of (x, y, 1) with u, v and w. Their sum is the dot
    // product with n = u + v + w. z times this sum is a . n.
    const Uniform3 v = uniform_cross(e2, a), w = uniform_cross(a, e1), n = uniform_cross(e1, e2);
    const Uniform3 u = uniform_difference(uniform_difference(n, v), w);
    const float distance = uniform_size(a), size1 = uniform_size(e1), size2 = uniform_size(e2);
    const float rounding = 16.0f * ROUNDING * shaft->longest;
    const float slack = rounding * (distance + size1 + size2) * (size1 + size2);
    const float doubt = rounding * (distance + size1 + size2) * size1 * size2;
    const float height = uniform_dot(a, n), size = fabs(height) - doubt;
    // If the triangle is seen edge-on, is_hit decides. But if the rays start in the triangle's plane, and a corner is
    // behind their start, the triangle is excluded.
    if (size <= 0.0f)
        return fmin(fmin(a.z, b.z), c.z) >= 0.0f || !starts_in_plane(vec3(a.x, a.y, a.z), vec3(n.x, n.y, n.z));
    const float turn = height < 0.0f ? -1.0f : 1.0f;
    return used & (most_turned(shaft, u, turn) >= -slack) & (most_turned(shaft, v, turn) >= -slack) &
           (most_turned(shaft, w, turn) >= -slack) &
           (most_turned(shaft, n, turn) + rounding * size1 * size2 >= worst * size * 0.99999f);
}

// Returns 1 if a ray hits the triangle at a 1/z greater than `nearest`, else 0. If `any` is 0 (only the nearest hit
// counts), 1/z must also be less than `ceiling`. `*per_depth` receives 1/z or, with `any`, 0.
INLINED int is_hit(const Candidate *triangle, float x, float y, float nearest, float ceiling, const int any,
                   float *per_depth) {
    const float4 a = triangle->a, b = triangle->b, c = triangle->c;
    // The shear moves the ray to (0, 0) at every depth. Each corner is sheared according to its own depth.
    const float ax = MULTIPLY_ADD(-x, a.z, a.x), ay = MULTIPLY_ADD(-y, a.z, a.y);
    const float bx = MULTIPLY_ADD(-x, b.z, b.x), by = MULTIPLY_ADD(-y, b.z, b.y);
    const float cx = MULTIPLY_ADD(-x, c.z, c.x), cy = MULTIPLY_ADD(-y, c.z, c.y);
    const float u = cx * by - cy * bx;
    const float v = ax * cy - ay * cx;
    const float w = bx * ay - by * ax;
    const float det = u + v + w;
    const float depth = MULTIPLY_ADD(u, a.z, MULTIPLY_ADD(v, b.z, w * c.z)); // the hit's z times det
    const float size = fabs(det), turned = det < 0.0f ? -depth : depth;
    int inside = (fmin(fmin(u, v), w) >= 0.0f) | (fmax(fmax(u, v), w) <= 0.0f);
    inside &= (det != 0.0f) & (turned > 0.0f) & (size > nearest * turned) & (any || size < ceiling * turned);
#if CULL_BACK
    inside &= det * a.w > 0.0f;
#endif
    *per_depth = any ? 0.0f : size / turned;
    return inside;
}
