// Every ray tests every triangle. Included twice: with ANY_HIT 1 it defines any_hit, with ANY_HIT 0 closest_hit.
//
// A ray is read from the working vectors at each test, as in the paper's kernel; the strategy chooses the memory of
// these vectors. A shadow ray runs from P to the light; with planes prepared for an origin, it runs from the light to
// P.

#if ANY_HIT
// Returns the lanes of `wanted` whose ray hits anything nearer than t_max. The ray starts at the distance `bias` from
// the working vector P, in the direction w_i.
Mask any_hit(const Working *working, const Scene *scene, int origin, varying t_max, Mask wanted) {
    Probe probe = prepare_probe((varying)(0.0f), working_get(working, TO_LIGHT));
    // Lanes that have hit nothing yet. A lane is finished at its first hit on any triangle.
    Mask open = wanted;
#else
// Finds the nearest hit at t > t_min for the rays in the working vectors.
void closest_hit(Working *working, const Scene *scene, varying t_min, Mask wanted, Nearest *nearest) {
    Probe probe = prepare_probe(t_min, working_get(working, RAY_DIRECTION));
    const int origin = 0;
    nearest->t = SELECT(wanted, (varying)(FAR), (varying)(0.0f)); // other lanes accept no hit
    nearest->triangle = (varying_int)(NO_HIT);
#endif
#if PLANES_OF_ORIGIN
    probe.overlap = overlap_of(origin);
#endif
    // If triangles are streamed through __local memory, the loop is over tiles; otherwise one tile has all triangles.
    for (int first = 0; first < scene->geometry.count; first += TILE_STEP(scene)) {
        stage_tile(scene, origin, first);
        int end = min(TILE_STEP(scene), scene->geometry.count - first);
#if ANY_HIT
        // Nothing is left to find, but the loop over tiles continues: stage_tile has barriers, which all work-items
        // must reach.
        if (!ANY(open)) end = 0;
#endif
#if STREAM_TILES && PLANES_OF_ORIGIN
#pragma unroll 4 // 5% faster on a GPU than 8 or 2, or what its compiler chooses
#elif STREAM_TILES
#pragma unroll 8 // 7% faster on a GPU than the 4 its compiler chooses
#endif
        for (int k = 0; k < end; k++) {
            // All work-items test the same triangle at the same time, so that one load serves all of them.
            const Row row = row_in_tile(scene, origin, first, k);
            Hit hit;
#if ANY_HIT
            const Vec3 to_light = working_get(working, TO_LIGHT);
#if PLANES_OF_ORIGIN
            // These planes were prepared for rays from the light: the same segment, in the reverse direction.
            const Vec3 direction = negate(to_light);
            const Vec3 from = direction; // unused: the planes know their origin
#else
            const Vec3 direction = to_light;
            // The ray starts at a distance from the surface, so that the triangle that was just hit does not shadow
            // itself.
            const Vec3 from = along(working_get(working, POINT), (varying)(scene->bias), to_light);
#endif
            if (!intersect(&probe, from, direction, row, t_max, &hit)) continue;
            open &= !SOLID(&scene->textures, first + k, hit);
            if (!ANY(open)) break;
#else
            const Vec3 from = working_get(working, RAY_ORIGIN);
            const Vec3 direction = working_get(working, RAY_DIRECTION);
            if (!intersect(&probe, from, direction, row, nearest->t, &hit)) continue;
#if CUTOUTS
            hit.lanes = SOLID(&scene->textures, first + k, hit);
#endif
            // A lane may pass the edges but hit the plane behind its nearest hit, or before t_min.
            if (!ANY(hit.lanes)) continue;
            nearest->t = SELECT(hit.lanes, hit.t, nearest->t);
            nearest->triangle = SELECT(hit.lanes, (varying_int)(first + k), nearest->triangle);
            // With shading = eager, shading happens here, at every improvement; with deferred, this does nothing.
            on_nearer_hit(working, scene, first + k, &hit, hit.lanes);
#endif
        }
    }
#if ANY_HIT
    return wanted & !open;
#endif
}
