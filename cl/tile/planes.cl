// A triangle is prepared once for all rays: with S = O - V0, the planes e2 x e1, e2 x S and S x e1 give a, a w1 and a w2
// of Moeller and Trumbore as dot products with a ray's direction, and a t, their height, is the same for all. What lies
// in front of the rays has an a of that sign, so that none asks for signs.

typedef struct {
    Uniform3 a, w1, w2;   // the planes
    float slack1, slack2; // rounding that is allowed w1 and w2
    float edge_on;        // the least a of a ray that does not see it edge-on
    float per_height;     // 1 / t = a per_height
} Planes;

// Planes ask for nothing but directions.
void prepare_rays(Bundle *bundle, int vector, Mask rays) {}

// Makes a triangle's planes; 0 where no ray can hit it.
__attribute__((always_inline)) int prepare_triangle(const Bundle *bundle, const Tree *tree, int place, const int any,
                                                    Planes *planes) {
    const Row row = leaf_corners(tree, place);
    const Uniform3 e1 = uniform_difference(row.b, row.a), e2 = uniform_difference(row.c, row.a);
    const Uniform3 s = uniform_difference(bundle->origin, row.a);
    const Uniform3 v = uniform_cross(s, e1);
    const float height = uniform_dot(e2, v), sign = height < 0.0f ? -1.0f : 1.0f;
    planes->a = uniform_scale(uniform_cross(e2, e1), sign);
    planes->w1 = uniform_scale(uniform_cross(e2, s), sign);
    planes->w2 = uniform_scale(v, sign);
    planes->per_height = 1.0f / fabs(height);
    // Weights are allowed their rounding error, as in the other fast tests; less on the long way from a light, where it
    // would darken what lies beside a grazed edge. (Measured: with all of it, or with none, a pixel in two million is
    // wrong on one of bunny, teapot and terrain; with a quarter, none.)
    const float size1 = uniform_size(e1), size2 = uniform_size(e2);
    const float rounding = (any ? 0.25f : 1.0f) * ROUNDING * uniform_size(s) * bundle->longest;
    planes->slack1 = rounding * size2;
    planes->slack2 = rounding * size1;
    planes->edge_on = 1e-5f * size1 * size2 * bundle->longest;
#if CULL_BACK
    return any ? height < 0.0f : height > 0.0f;
#else
    return height != 0.0f;
#endif
}

// Tests a leaf's triangle with the rays of the live vectors. With `any`, a ray that hits it is done; otherwise
// the nearest hit is kept. Returns the vectors in which something changed.
uint test_triangle(Bundle *bundle, const Tree *tree, int place, uint live, const int any) {
    Planes planes;
    if (!prepare_triangle(bundle, tree, place, any, &planes)) return 0;
    const float slack = 2.0f * (planes.slack1 + planes.slack2); // w1 and w2 have theirs already
    uint changed = 0;
    for (; live; live &= live - 1) {
        const int vector = LOWEST_BIT(live);
        const varying x = bundle->x[vector], y = bundle->y[vector], z = bundle->z[vector];
        const varying a = x * planes.a.x + (y * planes.a.y + z * planes.a.z);
        const varying w1 = x * planes.w1.x + (y * planes.w1.y + (z * planes.w1.z + planes.slack1));
        const varying w2 = x * planes.w2.x + (y * planes.w2.y + (z * planes.w2.z + planes.slack2));
        const varying nearness = a * planes.per_height;
        // One comparison instead of six: masks wait for one another longer than minima do.
        const varying inside = min(min(w1, w2), a + slack - (w1 + w2));
        const varying seen =
            min(a - planes.edge_on, min(nearness - bundle->nearness[vector], bundle->too_near - nearness));
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
