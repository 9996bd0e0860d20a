// Each work-item's rays walk the tree together: one ray, or a packet of WIDTH. Included twice: with ANY_HIT 1 it
// defines any_hit, with ANY_HIT 0 closest_hit, as exhaustive.cl does.

#if ANY_HIT
// The reciprocals of a direction; where a component is nearly zero, of something small.
varying safe_reciprocal(varying d) {
    return 1.0f / SELECT(fabs(d) < 1e-20f, (varying)(1e-20f), d);
}

typedef struct {
    Vec3 origin, per_direction;
} BoxProbe;

BoxProbe prepare_box_probe(Vec3 origin, Vec3 direction) {
    BoxProbe probe;
    probe.origin = origin;
    probe.per_direction = vec3(safe_reciprocal(direction.x), safe_reciprocal(direction.y), safe_reciprocal(direction.z));
    return probe;
}

// Lanes whose ray meets a child's box nearer than reach, and where it enters. Errs towards a hit: the far side is
// moved out by more than its rounding (Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013).
Mask enter_box(const BoxProbe *probe, const __global float *box, varying reach, varying *entry) {
    const Vec3 o = probe->origin, per = probe->per_direction;
    const varying x0 = (box[0] - o.x) * per.x, x1 = (box[NODE_WIDTH] - o.x) * per.x;
    const varying y0 = (box[2 * NODE_WIDTH] - o.y) * per.y, y1 = (box[3 * NODE_WIDTH] - o.y) * per.y;
    const varying z0 = (box[4 * NODE_WIDTH] - o.z) * per.z, z1 = (box[5 * NODE_WIDTH] - o.z) * per.z;
    const varying near = max(max(min(x0, x1), min(y0, y1)), max(min(z0, z1), (varying)(0.0f)));
    const varying far = min(min(max(x0, x1), max(y0, y1)), max(z0, z1)) * 1.0000005f;
    *entry = near;
    return (near <= far) & (near <= reach);
}

// The least of the lanes that are set.
float least_of(varying values, Mask mask) {
    Lanes lanes;
    lanes.all = SELECT(mask, values, (varying)(FAR));
    float least = lanes.each[0];
    for (int lane = 1; lane < WIDTH; lane++) least = min(least, lanes.each[lane]);
    return least;
}

// A child waiting to be visited.
typedef struct {
    uint word;
    float entry;
} Waiting;

// Lanes of `wanted` that hit anything nearer than t_max, from `bias` along w_i off the working vector P.
Mask any_hit(const Working *working, const Scene *scene, int origin, varying t_max, Mask wanted) {
    const Vec3 along_ray = working_get(working, TO_LIGHT);
    const Vec3 from = along(working_get(working, POINT), (varying)(scene->bias), along_ray);
    const Probe probe = prepare_probe((varying)(0.0f), along_ray);
    Mask open = wanted;
#define REACH SELECT(open, t_max, (varying)(-1.0f))
#else
// Finds the nearest hit at t_min < t of the rays in the working vectors.
void closest_hit(Working *working, const Scene *scene, varying t_min, Mask wanted, Nearest *nearest) {
    const Vec3 from = working_get(working, RAY_ORIGIN);
    const Probe probe = prepare_probe(t_min, working_get(working, RAY_DIRECTION));
    const Vec3 along_ray = working_get(working, RAY_DIRECTION);
    nearest->t = (varying)(FAR);
    nearest->triangle = (varying_int)(NO_HIT);
#define REACH SELECT(wanted, nearest->t, (varying)(-1.0f))
#endif
    const BoxProbe box_probe = prepare_box_probe(from, along_ray);
    Waiting stack[STACK_SIZE];
    int waiting = 0;
    uint word = 0;
    for (;;) {
        if (IS_LEAF(word)) {
            const int first = LEAF_FIRST(word), end = first + LEAF_COUNT(word);
            for (int place = first; place < end; place++) {
                const Row row = row_of(leaf_corners(&scene->tree, place));
                Hit hit;
#if ANY_HIT
                const Vec3 to_light = working_get(working, TO_LIGHT);
                const Vec3 start = along(working_get(working, POINT), (varying)(scene->bias), to_light);
                if (intersect(&probe, start, to_light, row, t_max, &hit)) open &= !hit.lanes;
#else
                if (!intersect(&probe, working_get(working, RAY_ORIGIN), working_get(working, RAY_DIRECTION), row,
                               nearest->t, &hit))
                    continue;
                const Mask nearer = wanted & hit.lanes;
                if (!ANY(nearer)) continue;
                const int triangle = leaf_triangle(&scene->tree, place);
                nearest->t = SELECT(nearer, hit.t, nearest->t);
                nearest->triangle = SELECT(nearer, (varying_int)(triangle), nearest->triangle);
                on_nearer_hit(working, scene, triangle, &hit, nearer);
#endif
            }
#if ANY_HIT
            if (!ANY(open)) break;
#endif
        } else {
            // Children that are met go onto the stack, nearest last.
            const __global float *node = scene->tree.nodes + NODE_STRIDE * (size_t)word;
            const int below = waiting;
            const varying reach = REACH;
            for (int child = 0; child < NODE_WIDTH; child++) {
                varying entry;
                const Mask met = enter_box(&box_probe, node + child, reach, &entry);
                if (!ANY(met)) continue;
                const float at = least_of(entry, met);
                int place = waiting++;
                for (; place > below && stack[place - 1].entry < at; place--) stack[place] = stack[place - 1];
                stack[place].word = as_uint(node[CHILD_ROW + child]);
                stack[place].entry = at;
            }
        }
        // The nearest child that can still hold a nearer hit.
#if !ANY_HIT
        const varying reach = REACH;
        while (waiting && !ANY((varying)(stack[waiting - 1].entry) <= reach)) waiting--;
#endif
        if (!waiting) break;
        word = stack[--waiting].word;
    }
#undef REACH
#if ANY_HIT
    return wanted & !open;
#endif
}
