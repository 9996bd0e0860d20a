// meaning: planes through edges and a tile's origin, prepared for all rays of the tile when it reaches a leaf
// record_floats: 12
// prepared_for: tile
// exact_signs: no
// operations: 9
// contradicts: epsilons=paper because the paper's epsilons are numbers of the moller-trumbore test
//
// Triangles are prepared once for all rays of a tile, eight at a time, each in one lane. Let Q and P be two successive
// corners, relative to the rays' origin. The plane through Q, P and the origin has the normal 2 P x Q, which is
// computed as (P - Q) x (P + Q). A ray with the direction d lies on the edge's inner side if d . normal has the same
// sign as the triangle's height (see below). The neighbouring triangle has the same plane for the shared edge, with the
// opposite sign, to the last bit. (Embree's robust mode uses the same planes.) At a vertex, rounding could let a ray
// slip through, so neighbouring triangles overlap a little: after the planes are scaled, 1 is added to each dot
// product. Let e1 and e2 be two of the triangle's edges. If a ray meets the triangle's plane at t, d . (e2 x e1) times
// t is the triangle's height, the same for all rays. A hit lies in front of the ray's origin if d . (e2 x e1) and the
// height have the same sign. All planes, and the normal e2 x e1, are multiplied by the sign of the height when they are
// prepared, not at each test. The number `a` is the dot product of d and this normal, so it is positive for hits in
// front of the origin.

#define PREPARED TOGETHER

// Eight prepared triangles; a triangle is a column of each array.
typedef struct {
    float a[3][PREPARED];        // the triangles' normals: `a` is a normal's dot product with a direction
    float edges[3][3][PREPARED]; // the planes of the edges
    float edge_on[PREPARED];     // if `a` is not larger, the triangle is edge-on or behind the origin
    float per_height[PREPARED];  // 1 / t is the product of `a` and per_height
} Prepared;

// Returns one corner of each of eight triangles, relative to the rays' origin.
static Lanes3 lanes_seen(Lanes3 corner, Uniform3 origin) {
    Lanes3 from;
    from.x = (float8)(origin.x), from.y = (float8)(origin.y), from.z = (float8)(origin.z);
    return lanes_difference(corner, from);
}

// Returns the normal of the plane through the origin and an edge. The edge's ends p and q are relative to the origin;
// `edge` is p - q. Swapping p and q changes the signs of the normal's components, and nothing else.
static Lanes3 edge_plane(Lanes3 edge, Lanes3 p, Lanes3 q) { return lanes_cross(edge, lanes_sum(p, q)); }

// Stores one plane of each of eight triangles, multiplied by `by`.
static void store_plane(Lanes3 plane, float8 by, float to[3][PREPARED]) {
    vstore8(plane.x * by, 0, to[0]);
    vstore8(plane.y * by, 0, to[1]);
    vstore8(plane.z * by, 0, to[2]);
}

// Returns, for each of eight triangles, 1 / overlap, with the sign bit `sign`: the factor for the plane of one edge.
// `size` is the edge's size (1-norm), and `longer` is the size of the longer one of e1 and e2. `slack` is the overlap
// (see SHARED_EDGE_SLACK) divided by the edge's size; the overlap has the unit of the dot products. A float consists of
// the sign (bit 31), the exponent (bits 30 to 23) and the digits (bits 22 to 0). The mask 0x7f800000 rounds the overlap
// down to a power of two; dividing by this power does not round. The overlap is at least FLT_MIN, so its exponent is
// not 0, and no division is by 0. The factor makes the rounded overlap 1.
static float8 per_overlap(float8 slack, float8 size, float8 longer, int8 sign) {
    const float8 overlap = max(slack * min(longer, OVERLAP_EDGES * size), FLT_MIN);
    return as_float8(as_int8(1.0f / as_float8(as_int8(overlap) & 0x7f800000)) | sign);
}

// Prepares the eight triangles from `first` on, in leaf order. Returns the triangles that a ray can hit, one bit each.
// Edges are computed from the stored corners, because corners relative to a distant origin have lost their last digits.
uint prepare_triangles(const Bundle *bundle, const Tree *tree, int first, const int any, Prepared *prepared) {
    const __global float4 *rows = (const __global float4 *)tree->leaves + 3 * (size_t)first;
    const Lanes3 corner_a = load_corners(rows), corner_b = load_corners(rows + 1), corner_c = load_corners(rows + 2);
    const Lanes3 e1 = lanes_difference(corner_b, corner_a), e2 = lanes_difference(corner_c, corner_a);
    const Lanes3 e3 = lanes_difference(corner_c, corner_b);
    // All rays of the tile share the origin, so the origin is subtracted from each corner once for all rays.
    const Lanes3 a = lanes_seen(corner_a, bundle->origin);
    const Lanes3 b = lanes_seen(corner_b, bundle->origin);
    const Lanes3 c = lanes_seen(corner_c, bundle->origin);
    const Lanes3 n = lanes_cross(e2, e1);
    // `height` is the signed distance of the origin from the triangle's plane, times the length of the normal n. Its
    // sign shows on which side of the plane the origin is. All stored planes are multiplied by this sign.
    const float8 height = a.x * n.x + (a.y * n.y + a.z * n.z);
    const int8 sign = as_int8(height) & (int8)(int)0x80000000;
    const float8 size1 = lanes_size(e1), size2 = lanes_size(e2), longer = max(size1, size2);
    const float8 distance = lanes_size(a), slack = SHARED_EDGE_SLACK * bundle->longest * distance;
    const float8 least = LEAST_VISIBLE(distance, longer);
    // For a ray's direction d and the normal n, 1 / t = (d . n) / height. The stored normal is n times the sign of
    // `height`. The number `a` is the dot product of d and this stored normal, so 1 / t = a / |height|. `a` is positive
    // if the ray meets the triangle's plane in front of the ray's origin.
    store_plane(n, as_float8(as_int8((float8)(1.0f)) | sign), prepared->a);
    store_plane(edge_plane(e1, b, a), per_overlap(slack, size1, longer, sign), prepared->edges[0]);
    store_plane(edge_plane(e3, c, b), per_overlap(slack, lanes_size(e3), longer, sign), prepared->edges[1]);
    store_plane(edge_plane(lanes_difference(corner_a, corner_c), a, c), per_overlap(slack, size2, longer, sign),
                prepared->edges[2]);
    vstore8(1.0f / fabs(height), 0, prepared->per_height);
    vstore8(EDGE_ON_ROUNDING * bundle->longest * size1 * size2, 0, prepared->edge_on);
#if CULL_BACK
    // Shadow rays run towards the light, but are tested from the light, so front and back faces are swapped.
    return LANE_BITS8(any ? height < -least : height > least);
#else
    return LANE_BITS8(fabs(height) > least);
#endif
}

// With more than FEW_VECTORS vectors of rays, a triangle is first tested against the intervals of the vectors'
// directions. Testing sixteen intervals takes about as long as testing six vectors, so with few vectors, this test does
// not pay.
#define FEW_VECTORS (6 * PARTS)

// Returns upper bounds of the products of an edge's plane and the directions of sixteen vectors of rays.
INLINED float16 largest_inside(const Bundle *bundle, int part, const float edge[3][PREPARED], int lane) {
    return largest_product(bundle, part, edge[0][lane], edge[1][lane], edge[2][lane]);
}

// Returns `live` without the vectors of rays whose interval of directions lies outside one edge of a prepared triangle.
uint vectors_near(const Bundle *bundle, const Prepared *prepared, int lane, uint live) {
    uint outside = 0;
    for (int part = 0; part < PARTS; part++) {
        const float16 inside = min(min(largest_inside(bundle, part, prepared->edges[0], lane),
                                       largest_inside(bundle, part, prepared->edges[1], lane)),
                                   largest_inside(bundle, part, prepared->edges[2], lane));
        // `inside` is compared with -2, not with 0: test_triangle adds 1 for the overlap of neighbouring triangles, and
        // another 1 allows for rounding in the sum.
        outside |= LANE_BITS16(inside < -2.0f) << (16 * part);
    }
    return live & ~outside;
}

// Tests a prepared triangle against the rays of the vectors in `live`. `lane` is the triangle's lane in `prepared`, and
// `index` its index in leaf order. With `any`, a ray that hits the triangle is finished; otherwise the hit becomes the
// ray's nearest hit. Returns the vectors in which a ray hit, one bit each.
uint test_triangle(Bundle *bundle, const Prepared *prepared, int lane, int index, uint live, const int any) {
    // The floats of the triangle are loaded into registers once, for the tests of all vectors of rays in `live`.
    const float ax = prepared->a[0][lane], ay = prepared->a[1][lane], az = prepared->a[2][lane];
    const float ux = prepared->edges[0][0][lane], uy = prepared->edges[0][1][lane], uz = prepared->edges[0][2][lane];
    const float vx = prepared->edges[1][0][lane], vy = prepared->edges[1][1][lane], vz = prepared->edges[1][2][lane];
    const float wx = prepared->edges[2][0][lane], wy = prepared->edges[2][1][lane], wz = prepared->edges[2][2][lane];
    const float edge_on = prepared->edge_on[lane], per_height = prepared->per_height[lane];
    uint changed = 0;
    for (; live; live &= live - 1) {
        const int vector = LOWEST_BIT(live);
        const varying x = bundle->x[vector], y = bundle->y[vector], z = bundle->z[vector];
        const varying a = x * ax + (y * ay + z * az);
        // u, v, w: one dot product per edge, plus 1 for the overlap of triangles. All three are at least 0 inside.
        const varying u = 1.0f + x * ux + y * uy + z * uz;
        const varying v = 1.0f + x * vx + y * vy + z * vz;
        const varying w = 1.0f + x * wx + y * wy + z * wz;
        const varying inv_t = a * per_height;
        // Two minima, `inside` and `seen`, are tested instead of six numbers, since operations on masks take longer.
        // `seen` is 0 if an earlier hit of the ray has the same distance. This earlier hit is kept, so `seen` must be
        // above 0.
        const varying inside = min(min(u, v), w);
        const varying seen =
            min(a - edge_on, min(inv_t - bundle->inv_t[vector], bundle->too_near - inv_t));
        const Mask hits = SOLID_IN_TILE(bundle, vector, index, (inside >= 0.0f) & (seen > 0.0f), any);
        if (any) {
            if (!ANY(hits)) continue;
            bundle->inv_t[vector] = SELECT(hits, (varying)(FAR), bundle->inv_t[vector]);
            changed |= 1u << vector;
        } else {
            // The hits are stored without a branch: when a tile reaches a leaf, hits are frequent, and a processor
            // would predict the branch badly.
            bundle->inv_t[vector] = SELECT(hits, inv_t, bundle->inv_t[vector]);
            bundle->leaf_index[vector] = SELECT(hits, (varying_int)(index), bundle->leaf_index[vector]);
            changed |= ANY(hits) ? 1u << vector : 0;
        }
    }
    return changed;
}

// Does nothing, since the edge-planes test needs nothing of a ray but its direction.
void prepare_rays(Bundle *bundle, int vector, Mask rays) {}
