// The watertight ray-triangle test of Woop, Benthin and Wald, for the rays of a tile. The test shears a triangle's
// corners so that the ray becomes a coordinate axis. Here, all rays of a vector use one axis, their common axis, along
// which all of them run in the same direction. All rays start at one origin, so the corners relative to the origin are
// the same for all rays. With a common axis, a ray's shear takes only two products per corner. Vectors whose rays have
// no common axis use the test of cast/intersect/watertight.cl, which chooses an axis for each ray.

#define NO_AXIS 3

// Returns the component along one axis of the directions of a vector's rays.
static varying along_axis(const Bundle *bundle, int vector, int axis) {
    return axis == 0 ? bundle->x[vector] : axis == 1 ? bundle->y[vector] : bundle->z[vector];
}

// Finds the common axis of a vector's rays: an axis along which all of them run in the same direction. If several axes
// are possible, chooses the axis with the largest `along` (explained below). Then computes the rays' shears.
void prepare_rays(Bundle *bundle, int vector, Mask rays) {
    float longest = 0.0f;
    bundle->shears.axis[vector] = NO_AXIS;
    for (int axis = 0; axis < 3; axis++) {
        // `along` is the smallest absolute value of the rays' components along the axis `axis`. If rays run in both
        // directions, `along` is 0 or negative.
        const varying component = along_axis(bundle, vector, axis);
        const float least = least_lane(SELECT(rays, component, (varying)(FAR)));
        const float most = most_lane(SELECT(rays, component, (varying)(-FAR)));
        const float along = least > 0.0f ? least : -most;
        if (along <= longest) continue;
        longest = along;
        bundle->shears.axis[vector] = axis;
        bundle->shears.forward[vector] = least > 0.0f ? 1.0f : -1.0f;
    }
    const int axis = bundle->shears.axis[vector];
    if (axis == NO_AXIS) return;
    // The shear is x' = x - (d_x / d_z) z, where z is the common axis. The factors of z are computed once per ray. If
    // rays run against the axis, the coordinate x' is mirrored, so that front and back faces are not swapped.
    const varying per = -1.0f / along_axis(bundle, vector, axis);
    bundle->shears.x[vector] = along_axis(bundle, vector, (axis + 1) % 3) * per * bundle->shears.forward[vector];
    bundle->shears.y[vector] = along_axis(bundle, vector, (axis + 2) % 3) * per;
}

// Returns the lanes of a vector whose ray hits a triangle nearer than all earlier hits. `*inv_t` receives 1 / t of the
// hits. The corners a, b and c are relative to the origin.
Mask intersect_sheared(const Bundle *bundle, int vector, const float *a, const float *b, const float *c,
                       varying *inv_t) {
    const int along = bundle->shears.axis[vector], across = (along + 1) % 3, up = (along + 2) % 3;
    const float forward = bundle->shears.forward[vector];
    const varying x = bundle->shears.x[vector], y = bundle->shears.y[vector];
    // Computes the corners' sheared coordinates, in which the ray is the point (0, 0).
    const varying ax = forward * a[across] + x * a[along], ay = a[up] + y * a[along];
    const varying bx = forward * b[across] + x * b[along], by = b[up] + y * b[along];
    const varying cx = forward * c[across] + x * c[along], cy = c[up] + y * c[along];
    // An edge function is exactly opposite in the neighbouring triangle, since each product is rounded separately.
    const varying u = cx * by - cy * bx;
    const varying v = ax * cy - ay * cx;
    const varying w = bx * ay - by * ax;
    const varying det = u + v + w;
#if CULL_BACK
    const Mask inside = (min(min(u, v), w) >= 0.0f) & (det > 0.0f);
#else
    const Mask inside = ((min(min(u, v), w) >= 0.0f) | (max(max(u, v), w) <= 0.0f)) & (det != 0.0f);
#endif
    if (!ANY(inside)) return inside;
    const varying za = u * a[along], zb = v * b[along], zc = w * c[along];
    *inv_t = det * along_axis(bundle, vector, along) / (za + zb + zc);
    const Mask hits = inside & (*inv_t > bundle->inv_t[vector]) & (*inv_t < bundle->too_near);
    // As in cast/intersect/watertight.cl, a ray that starts in the triangle's plane misses.
    const Mask doubt = hits & cancels(za, zb, zc, NEAR_START);
    if (!ANY(doubt)) return hits;
    return hits & !(doubt & starts_in_plane(splat(LOAD3(a)), splat(normal_of(LOAD3(a), LOAD3(b), LOAD3(c)))));
}

// Does the same as intersect_sheared for a vector whose rays have no common axis.
Mask intersect_single(const Bundle *bundle, int vector, Corners corners, varying *inv_t) {
    const Vec3 direction = vec3(bundle->x[vector], bundle->y[vector], bundle->z[vector]);
    const varying t_max = 1.0f / max(bundle->inv_t[vector], (varying)(LEAST_INV_T));
    const Probe probe = prepare_probe((varying)(1.0f / bundle->too_near), direction);
    Hit hit;
    if (!intersect(&probe, splat(bundle->origin), direction, row_of(corners), t_max, &hit)) return (Mask)(0);
    *inv_t = 1.0f / hit.t;
    return hit.lanes & (bundle->inv_t[vector] < FAR);
}

// A prepared triangle consists of its corners, and of its corners relative to the rays' origin.
#define PREPARED 1
typedef struct {
    Corners corners;
    float a[3], b[3], c[3];
} Prepared;

// Prepares the triangle at `first` in leaf order. Returns a word with one bit for the triangle, which is always 1: no
// triangle is excluded here.
uint prepare_triangles(const Bundle *bundle, const Tree *tree, int first, const int any, Prepared *prepared) {
    Corners corners = leaf_corners(tree, first);
    if (any) { // rays run from the light, not to it: swapping corners swaps front and back faces
        const Uniform3 b = corners.b;
        corners.b = corners.c;
        corners.c = b;
    }
    const Uniform3 o = bundle->origin;
    prepared->corners = corners;
    prepared->a[0] = corners.a.x - o.x, prepared->a[1] = corners.a.y - o.y, prepared->a[2] = corners.a.z - o.z;
    prepared->b[0] = corners.b.x - o.x, prepared->b[1] = corners.b.y - o.y, prepared->b[2] = corners.b.z - o.z;
    prepared->c[0] = corners.c.x - o.x, prepared->c[1] = corners.c.y - o.y, prepared->c[2] = corners.c.z - o.z;
    return 1;
}

// With more than FEW_VECTORS vectors of rays, a triangle is first tested against the intervals of the vectors'
// directions. Testing sixteen intervals takes about as long as testing four vectors, so with few vectors, this test
// does not pay.
#define FEW_VECTORS (4 * PARTS)
// A bound of a volume's (determinant's) rounding error, divided by the product of the three vectors' 1-norms. The bound
// also covers the errors of intersect_sheared, which grow with the angle between a ray and the common axis.
#define VOLUME_ROUNDING 2e-5f

// Tests vectors of rays against a plane through the rays' origin. A plane's positive side is the side to which `normal`
// points. Returns `live` without the vectors of rays whose rays all certainly run on the negative side. `normal` is a
// cross product of two vectors, and `size` is the product of these two vectors' 1-norms (uniform_size).
static uint vectors_inside(const Bundle *bundle, Uniform3 normal, float size, uint live) {
    for (int part = 0; part < PARTS; part++) {
        const float16 inside = largest_product(bundle, part, normal.x, normal.y, normal.z);
        live &= ~(LANE_BITS16(inside < -VOLUME_ROUNDING * size * bundle->longest) << (16 * part));
    }
    return live;
}

// Returns `live` without the vectors of rays whose interval of directions lies outside one edge of the triangle.
uint vectors_near(const Bundle *bundle, const Prepared *prepared, int lane, uint live) {
    const Uniform3 a = LOAD3(prepared->a), b = LOAD3(prepared->b), c = LOAD3(prepared->c);
    const float size_a = uniform_size(a), size_b = uniform_size(b), size_c = uniform_size(c);
    const Uniform3 ab = uniform_cross(a, b);
    const float volume = uniform_dot(ab, c);
    // If the origin lies nearly in the triangle's plane, it is uncertain which side of an edge's plane is the inner
    // side, so no vector of rays is excluded.
    if (fabs(volume) <= VOLUME_ROUNDING * (size_a * size_b * size_c)) return live;
    const float sign = volume > 0.0f ? 1.0f : -1.0f;
    live = vectors_inside(bundle, uniform_scale(ab, sign), size_a * size_b, live);
    live = vectors_inside(bundle, uniform_scale(uniform_cross(b, c), sign), size_b * size_c, live);
    return vectors_inside(bundle, uniform_scale(uniform_cross(c, a), sign), size_c * size_a, live);
}

// Tests the prepared triangle against the rays of the vectors in `live`, like test_triangle in edge_planes.cl.
uint test_triangle(Bundle *bundle, const Prepared *prepared, int lane, int index, uint live, const int any) {
    uint changed = 0;
    for (; live; live &= live - 1) {
        const int vector = LOWEST_BIT(live);
        varying inv_t;
        // A vector of rays uses the same test for all triangles, so that none of its rays slips through the edge that
        // two triangles share.
        const Mask met = bundle->shears.axis[vector] == NO_AXIS
                             ? intersect_single(bundle, vector, prepared->corners, &inv_t)
                             : intersect_sheared(bundle, vector, prepared->a, prepared->b, prepared->c, &inv_t);
        const Mask hits = SOLID_IN_TILE(bundle, vector, index, met, any);
        if (!ANY(hits)) continue;
        bundle->inv_t[vector] = SELECT(hits, any ? (varying)(FAR) : inv_t, bundle->inv_t[vector]);
        if (!any) bundle->leaf_index[vector] = SELECT(hits, (varying_int)(index), bundle->leaf_index[vector]);
        changed |= 1u << vector;
    }
    return changed;
}
