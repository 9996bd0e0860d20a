// Woop, Benthin and Wald's test as single rays have it: its shear is a ray's own, so a tile shares nothing of it.

// Tests a leaf's triangle with the rays of the live vectors. With `any`, a ray that hits it is done; otherwise
// the nearest hit is kept. Returns the vectors in which something changed.
uint test_triangle(Bundle *bundle, const Tree *tree, int place, uint live, const int any) {
    Row row = leaf_corners(tree, place);
    if (any) { // rays come from the light, and meet the backs of what faces it
        const Uniform3 b = row.b;
        row.b = row.c;
        row.c = b;
    }
    uint changed = 0;
    for (; live; live &= live - 1) {
        const int vector = LOWEST_BIT(live);
        const Vec3 direction = vec3(bundle->x[vector], bundle->y[vector], bundle->z[vector]);
        const varying nearness = bundle->nearness[vector];
        const varying t_max = 1.0f / max(nearness, (varying)(LEAST_NEARNESS));
        const Probe probe = prepare_probe((varying)(1.0f / bundle->too_near), direction);
        Hit hit;
        const Mask hits = (nearness < FAR) & intersect(&probe, splat(bundle->origin), direction, row, t_max, &hit);
        if (!ANY(hits)) continue;
        bundle->nearness[vector] = SELECT(hits, any ? (varying)(FAR) : 1.0f / hit.t, nearness);
        if (!any) bundle->place[vector] = SELECT(hits, (varying_int)(place), bundle->place[vector]);
        changed |= 1u << vector;
    }
    return changed;
}
