// Woop, Benthin and Wald's test for a tile. The rays of a vector share the axis that they are sheared along, so that a
// corner costs two products; corners seen from the origin are the same for all. Vectors whose rays share no axis
// are tested as single rays are.

#define NO_AXIS 3

varying along_axis(const Bundle *bundle, int vector, int axis) {
    return axis == 0 ? bundle->x[vector] : axis == 1 ? bundle->y[vector] : bundle->z[vector];
}

// Finds the axis that a vector's rays run along most of all, all the same way, and their shears.
void prepare_rays(Bundle *bundle, int vector, Mask rays) {
    float longest = 0.0f;
    bundle->shears.axis[vector] = NO_AXIS;
    for (int axis = 0; axis < 3; axis++) {
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
    const varying per = -1.0f / along_axis(bundle, vector, axis);
    bundle->shears.x[vector] = along_axis(bundle, vector, (axis + 1) % 3) * per * bundle->shears.forward[vector];
    bundle->shears.y[vector] = along_axis(bundle, vector, (axis + 2) % 3) * per;
}

// Rays of a vector that hit the triangle of corners a, b, c, seen from the origin, and 1 / t there.
Mask meet_sheared(const Bundle *bundle, int vector, const float *a, const float *b, const float *c,
                  varying *nearness) {
    const int along = bundle->shears.axis[vector], across = (along + 1) % 3, up = (along + 2) % 3;
    const float forward = bundle->shears.forward[vector];
    const varying x = bundle->shears.x[vector], y = bundle->shears.y[vector];
    const varying ax = forward * a[across] + x * a[along], ay = a[up] + y * a[along];
    const varying bx = forward * b[across] + x * b[along], by = b[up] + y * b[along];
    const varying cx = forward * c[across] + x * c[along], cy = c[up] + y * c[along];
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
    *nearness = det * along_axis(bundle, vector, along) / (u * a[along] + v * b[along] + w * c[along]);
    return inside & (*nearness > bundle->nearness[vector]) & (*nearness < bundle->too_near);
}

// The same for a vector without an axis.
Mask meet_single(const Bundle *bundle, int vector, Row row, varying *nearness) {
    const Vec3 direction = vec3(bundle->x[vector], bundle->y[vector], bundle->z[vector]);
    const varying t_max = 1.0f / max(bundle->nearness[vector], (varying)(LEAST_NEARNESS));
    const Probe probe = prepare_probe((varying)(1.0f / bundle->too_near), direction);
    Hit hit;
    const Mask hits = intersect(&probe, splat(bundle->origin), direction, row, t_max, &hit);
    *nearness = 1.0f / hit.t;
    return hits & (bundle->nearness[vector] < FAR);
}

// Tests a leaf's triangle with the rays of the live vectors. With `any`, a ray that hits it is done; otherwise
// the nearest hit is kept. Returns the vectors in which something changed.
uint test_triangle(Bundle *bundle, const Tree *tree, int place, uint live, const int any) {
    Row row = leaf_corners(tree, place);
    if (any) { // rays come from the light, and meet the backs of what faces it
        const Uniform3 b = row.b;
        row.b = row.c;
        row.c = b;
    }
    const Uniform3 o = bundle->origin;
    const float a[3] = {row.a.x - o.x, row.a.y - o.y, row.a.z - o.z};
    const float b[3] = {row.b.x - o.x, row.b.y - o.y, row.b.z - o.z};
    const float c[3] = {row.c.x - o.x, row.c.y - o.y, row.c.z - o.z};
    uint changed = 0;
    for (; live; live &= live - 1) {
        const int vector = LOWEST_BIT(live);
        varying nearness;
        const Mask hits = bundle->shears.axis[vector] == NO_AXIS ? meet_single(bundle, vector, row, &nearness)
                                                          : meet_sheared(bundle, vector, a, b, c, &nearness);
        if (!ANY(hits)) continue;
        bundle->nearness[vector] = SELECT(hits, any ? (varying)(FAR) : nearness, bundle->nearness[vector]);
        if (!any) bundle->place[vector] = SELECT(hits, (varying_int)(place), bundle->place[vector]);
        changed |= 1u << vector;
    }
    return changed;
}
