// Triangles are prepared once for all rays, eight at a time, a lane each: with S = O - V0, the planes e2 x e1, e2 x S and
// S x e1 give a, a w1 and a w2 of Moeller and Trumbore as dot products with a ray's direction, and a t, their height, is
// the same for all. What lies in front of the rays has an a of that sign, so that none asks for signs.

#define PREPARED 8

typedef struct {
    float a[3][PREPARED], w1[3][PREPARED], w2[3][PREPARED];
    float slack1[PREPARED], slack2[PREPARED]; // rounding that is allowed w1 and w2
    float edge_on[PREPARED];                  // the least a of a ray that does not see it edge-on
    float per_height[PREPARED];               // 1 / t = a per_height
} Prepared;

typedef struct {
    float8 x, y, z;
} Lanes3;

Lanes3 lanes_difference(Lanes3 a, Lanes3 b) {
    Lanes3 d;
    d.x = a.x - b.x, d.y = a.y - b.y, d.z = a.z - b.z;
    return d;
}

Lanes3 lanes_cross(Lanes3 a, Lanes3 b) {
    Lanes3 c;
    c.x = a.y * b.z - a.z * b.y, c.y = a.z * b.x - a.x * b.z, c.z = a.x * b.y - a.y * b.x;
    return c;
}

float8 lanes_size(Lanes3 a) { return fabs(a.x) + fabs(a.y) + fabs(a.z); } // the 1-norm

// One corner of eight triangles, seen from the origin. Past the leaf's last there are others, or padding.
Lanes3 load_corners(const __global float4 *rows, Uniform3 origin) {
    const float16 a = (float16)(rows[0], rows[3], rows[6], rows[9]);
    const float16 b = (float16)(rows[12], rows[15], rows[18], rows[21]);
    const float8 xz = a.even, xz2 = b.even, yw = a.odd, yw2 = b.odd;
    Lanes3 corner;
    corner.x = (float8)(xz.even, xz2.even) - origin.x;
    corner.y = (float8)(yw.even, yw2.even) - origin.y;
    corner.z = (float8)(xz.odd, xz2.odd) - origin.z;
    return corner;
}

void store_plane(Lanes3 plane, int8 sign, float to[3][PREPARED]) {
    vstore8(as_float8(as_int8(plane.x) ^ sign), 0, to[0]);
    vstore8(as_float8(as_int8(plane.y) ^ sign), 0, to[1]);
    vstore8(as_float8(as_int8(plane.z) ^ sign), 0, to[2]);
}

// Prepares the triangles from `first` on. Returns those that a ray can hit: a bit each.
uint prepare_triangles(const Bundle *bundle, const Tree *tree, int first, const int any, Prepared *prepared) {
    const __global float4 *rows = (const __global float4 *)tree->leaves + 3 * (size_t)first;
    const Lanes3 a = load_corners(rows, bundle->origin);
    const Lanes3 b = load_corners(rows + 1, bundle->origin);
    const Lanes3 c = load_corners(rows + 2, bundle->origin);
    const Lanes3 e1 = lanes_difference(b, a), e2 = lanes_difference(c, a);
    const Lanes3 v = lanes_cross(e1, a); // S is -a
    const float8 height = e2.x * v.x + (e2.y * v.y + e2.z * v.z);
    const int8 sign = as_int8(height) & (int8)(int)0x80000000;
    store_plane(lanes_cross(e2, e1), sign, prepared->a);
    store_plane(lanes_cross(a, e2), sign, prepared->w1);
    store_plane(v, sign, prepared->w2);
    vstore8(1.0f / fabs(height), 0, prepared->per_height);
    // Weights are allowed their rounding error, as in the other fast tests.
    const float8 size1 = lanes_size(e1), size2 = lanes_size(e2);
    const float8 rounding = (any ? SHADOW_SLACK : 1.0f) * ROUNDING * bundle->longest * lanes_size(a);
    vstore8(rounding * size2, 0, prepared->slack1);
    vstore8(rounding * size1, 0, prepared->slack2);
    vstore8(1e-5f * bundle->longest * size1 * size2, 0, prepared->edge_on);
#if CULL_BACK
    return LANE_BITS8(any ? height < 0.0f : height > 0.0f);
#else
    return LANE_BITS8(height != 0.0f);
#endif
}

// Tests a prepared triangle with the rays of the live vectors. With `any`, a ray that hits it is done; otherwise
// the nearest hit is kept. Returns the vectors in which something changed.
uint test_triangle(Bundle *bundle, const Prepared *prepared, int lane, int place, uint live, const int any) {
    const float ax = prepared->a[0][lane], ay = prepared->a[1][lane], az = prepared->a[2][lane];
    const float ux = prepared->w1[0][lane], uy = prepared->w1[1][lane], uz = prepared->w1[2][lane];
    const float vx = prepared->w2[0][lane], vy = prepared->w2[1][lane], vz = prepared->w2[2][lane];
    const float slack1 = prepared->slack1[lane], slack2 = prepared->slack2[lane];
    const float slack = 2.0f * (slack1 + slack2); // w1 and w2 have theirs already
    const float edge_on = prepared->edge_on[lane], per_height = prepared->per_height[lane];
    uint changed = 0;
    for (; live; live &= live - 1) {
        const int vector = LOWEST_BIT(live);
        const varying x = bundle->x[vector], y = bundle->y[vector], z = bundle->z[vector];
        const varying a = x * ax + (y * ay + z * az);
        const varying w1 = x * ux + (y * uy + (z * uz + slack1));
        const varying w2 = x * vx + (y * vy + (z * vz + slack2));
        const varying nearness = a * per_height;
        // One comparison instead of six: masks wait for one another longer than minima do.
        const varying inside = min(min(w1, w2), a + slack - (w1 + w2));
        const varying seen =
            min(a - edge_on, min(nearness - bundle->nearness[vector], bundle->too_near - nearness));
        const Mask hits = min(inside, seen) >= 0.0f;
        if (any) {
            if (!ANY(hits)) continue;
            bundle->nearness[vector] = SELECT(hits, (varying)(FAR), bundle->nearness[vector]);
            changed |= 1u << vector;
        } else {
            // No branch: hits are frequent where a tile meets a leaf, and hard to foresee.
            bundle->nearness[vector] = SELECT(hits, nearness, bundle->nearness[vector]);
            bundle->place[vector] = SELECT(hits, (varying_int)(place), bundle->place[vector]);
            changed |= ANY(hits) ? 1u << vector : 0;
        }
    }
    return changed;
}

// Planes ask for nothing but directions.
void prepare_rays(Bundle *bundle, int vector, Mask rays) {}
