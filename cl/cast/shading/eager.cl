// meaning: at every hit nearer than the best so far, as the paper does
// shades: each-nearer-hit
//
// Shades every hit that is nearer than its ray's earlier hits, as in the student paper that raycl reproduces. If a
// still nearer hit follows, the radiance and the shadow rays of the earlier hit were computed in vain.

void on_nearer_hit(Working *working, const Scene *scene, int triangle, const Hit *hit, Mask nearer) {
    // Only the lanes of `nearer` have a nearer hit on this triangle; all other lanes keep their weights.
    const Vec3 weights = vec3(1.0f - hit->w1 - hit->w2, hit->w1, hit->w2);
    working_set(working, WEIGHTS, select3(nearer, weights, working_get(working, WEIGHTS)));
    Lanes column[FLOATS_OF_SURFACE];
    for (int lane = 0; lane < WIDTH; lane++) gather_surface(&scene->geometry, triangle, lane, column);
    const varying_int own_triangle = SELECT(nearer, (varying_int)(triangle), (varying_int)(NO_HIT));
    const Surface own =
        COLOURED(surface_of(column), scene->corner_colours, own_triangle, hit->w1, hit->w2);
    const Surface surface = TEXTURED(own, &scene->textures, own_triangle, hit->w1, hit->w2,
                                     working_get(working, RAY_DIRECTION), hit->t);
    // If a nearer hit is found later, its radiance overwrites the radiance of this hit.
    shade(working, scene, &surface, TRIANGLE_ARGUMENT((varying_int)(triangle)) hit->t, nearer);
}

void after_closest_hit(Working *working, const Scene *scene, const Nearest *nearest, Mask hits) {}
