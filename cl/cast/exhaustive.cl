// Every primary ray is tested against every triangle. A work-item tests its shadow rays to a light against one triangle
// after another, until all these rays are blocked. A program includes this file twice. The file defines any_hit if
// ANY_HIT is 1, and closest_hit if ANY_HIT is 0.
//
// The work-items of a warp test the same triangle at the same time, so that one load serves all of them. A ray is read
// from the working vectors at each test, as in the kernel of the student paper; the strategy chooses the memory of the
// working vectors. Without PLANES_OF_ORIGIN, a shadow ray runs from the hit P to the light. With PLANES_OF_ORIGIN, a
// shadow ray runs from the light to P, because the planes of the edges were computed for rays that start at the light.
//
// If triangles are streamed through __local memory in tiles, the loop over a tile is unrolled by 8 or, with
// PLANES_OF_ORIGIN, by 4. On a GPU, the compiler by itself unrolls by 4; unrolling by 8 makes casting 7% faster. With
// PLANES_OF_ORIGIN, unrolling by 4 makes casting 5% faster than unrolling by 8, by 2, or by the compiler's own choice.

#if ANY_HIT
// Returns the lanes of `wanted` whose ray hits anything at a distance less than t_max from its start. Without
// PLANES_OF_ORIGIN, the ray runs in the direction TO_LIGHT, and starts at the distance `bias` from the working vector
// POINT, so that the triangle at POINT does not shadow itself. `open` contains the lanes that have hit nothing yet: a
// lane is finished at its first hit on any triangle.
Mask any_hit(const Working *working, const Scene *scene, int origin, varying t_max, Mask wanted) {
    Probe probe = prepare_probe((varying)(0.0f), working_get(working, TO_LIGHT));
    Mask open = wanted;
#else
// For each lane of `wanted`, stores the ray's nearest hit at t > t_min in `nearest`, or NO_HIT if the ray hits nothing.
// The rays are in the working vectors. Lanes that are not in `wanted` begin with a nearest hit at t = 0, so that they
// accept no hit.
void closest_hit(Working *working, const Scene *scene, varying t_min, Mask wanted, Nearest *nearest) {
    Probe probe = prepare_probe(t_min, working_get(working, RAY_DIRECTION));
    const int origin = 0;
    nearest->t = SELECT(wanted, (varying)(FAR), (varying)(0.0f));
    nearest->triangle = (varying_int)(NO_HIT);
#endif
#if PLANES_OF_ORIGIN
    probe.overlap = overlap_of(origin);
#endif
    // If triangles are streamed through __local memory, the loop is over tiles (groups of triangles); otherwise one
    // tile contains all triangles.
    for (int first = 0; first < scene->geometry.count; first += TILE_STEP(scene)) {
        stage_tile(scene, origin, first);
        int end = min(TILE_STEP(scene), scene->geometry.count - first);
#if ANY_HIT
        // If no lane is open (every ray has hit something), nothing is left to find. Even then, the loop over tiles
        // continues, because all work-items must reach stage_tile's barriers.
        if (!ANY(open)) end = 0;
#endif
#if STREAM_TILES && PLANES_OF_ORIGIN
#pragma unroll 4
#elif STREAM_TILES
#pragma unroll 8
#endif
        for (int k = 0; k < end; k++) {
            const Row row = row_in_tile(scene, origin, first, k);
            Hit hit;
#if ANY_HIT
            const Vec3 to_light = working_get(working, TO_LIGHT);
#if PLANES_OF_ORIGIN
            // The planes of the triangle's edges were prepared for the reverse shadow ray, which starts at the light.
            // The planes contain the light, so the test needs no origin, and never uses `from`.
            const Vec3 direction = negate(to_light);
            const Vec3 from = direction;
#else
            const Vec3 direction = to_light;
            const Vec3 from = along(working_get(working, POINT), (varying)(scene->bias), to_light);
#endif
            if (!intersect(&probe, from, direction, row, t_max, &hit)) continue;
#if PLANES_OF_ORIGIN
            // Computed from a distant light, a hit is inexact. To look up holes, the hit is computed again, from P.
            open &= !SOLID_ON_RAYS(&scene->textures, first + k, corners(&scene->geometry, first + k),
                                   working_get(working, POINT), to_light, hit.lanes);
#else
            open &= !SOLID(&scene->textures, first + k, hit);
#endif
            if (!ANY(open)) break;
#else
            const Vec3 from = working_get(working, RAY_ORIGIN);
            const Vec3 direction = working_get(working, RAY_DIRECTION);
            if (!intersect(&probe, from, direction, row, nearest->t, &hit)) continue;
#if CUTOUTS
            hit.lanes = SOLID(&scene->textures, first + k, hit);
#endif
            // A ray that passes the edge tests still misses if it meets the triangle's plane before t_min, or behind
            // its nearest hit so far.
            if (!ANY(hit.lanes)) continue;
            nearest->t = SELECT(hit.lanes, hit.t, nearest->t);
            nearest->triangle = SELECT(hit.lanes, (varying_int)(first + k), nearest->triangle);
            // With eager shading, on_nearer_hit shades every hit that is nearer than the ray's earlier hits. With
            // deferred shading, on_nearer_hit does nothing.
            on_nearer_hit(working, scene, first + k, &hit, hit.lanes);
#endif
        }
    }
#if ANY_HIT
    return wanted & !open;
#endif
}
