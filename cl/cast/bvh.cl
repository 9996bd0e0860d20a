// Each work-item traverses the tree with one ray, or with a packet of WIDTH rays that walk the tree together. A program
// includes this file twice. The file defines any_hit if ANY_HIT is 1, and closest_hit if ANY_HIT is 0.

#if ANY_HIT
// Returns the lanes of `wanted` whose ray hits anything at a distance less than t_max from its start. The rays run in
// the direction TO_LIGHT. The rays start at the distance `bias` from POINT, so that the triangle at POINT does not
// shadow itself. (POINT and TO_LIGHT are working vectors.)
Mask any_hit(const Working *working, const Scene *scene, int origin, varying t_max, Mask wanted) {
    const Vec3 along_ray = working_get(working, TO_LIGHT);
    const Vec3 from = along(working_get(working, POINT), (varying)(scene->bias), along_ray);
    const Probe probe = prepare_probe((varying)(0.0f), along_ray);
    Mask open = wanted;
#define REACH SELECT(open, t_max, (varying)(-1.0f))
#else
// For each lane of `wanted`, stores the ray's nearest hit at t > t_min in `nearest`, or NO_HIT if the ray hits nothing.
// The rays are in the working vectors.
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
    // Node 0 is the root. The stack contains the nodes and leaves that are still to be visited. The nearest child of a
    // node lies above the node's other children.
    uint word = 0;
    for (;;) {
        if (IS_LEAF(word)) {
            // In leaf order, the triangles of a leaf follow each other without gaps.
            const int first = LEAF_FIRST(word), end = first + LEAF_COUNT(word);
            for (int index = first; index < end; index++) {
#if RECORDS_ONCE
                Row row;
                LOAD_ROW(row, scene->records + ROW_UNITS * (size_t)index)
#else
                const Row row = row_of(leaf_corners(&scene->tree, index));
#endif
                Hit hit;
#if ANY_HIT
                const Vec3 to_light = working_get(working, TO_LIGHT);
                const Vec3 start = along(working_get(working, POINT), (varying)(scene->bias), to_light);
                if (intersect(&probe, start, to_light, row, t_max, &hit))
                    open &= !SOLID(&scene->textures, leaf_triangle(&scene->tree, index), hit);
#else
                if (!intersect(&probe, working_get(working, RAY_ORIGIN), working_get(working, RAY_DIRECTION), row,
                               nearest->t, &hit))
                    continue;
                // The rays of all lanes are tested, but lanes that are not in `wanted` store no hit.
                const Mask nearer = wanted & SOLID(&scene->textures, leaf_triangle(&scene->tree, index), hit);
                if (!ANY(nearer)) continue;
                const int triangle = leaf_triangle(&scene->tree, index);
                nearest->t = SELECT(nearer, hit.t, nearest->t);
                nearest->triangle = SELECT(nearer, (varying_int)(triangle), nearest->triangle);
                // With eager shading, on_nearer_hit shades every hit that is nearer than the ray's earlier hits. With
                // deferred shading, on_nearer_hit does nothing.
                on_nearer_hit(working, scene, triangle, &hit, nearer);
#endif
            }
#if ANY_HIT
            if (!ANY(open)) break;
#endif
        } else {
            waiting = push_met_children(&box_probe, scene->tree.nodes + NODE_STRIDE * (size_t)word, REACH, stack, waiting);
        }
#if !ANY_HIT
        const varying reach = REACH;
        // A child leaves the stack unvisited if every ray has found a hit nearer than the child's box.
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
