// meaning: at every hit nearer than the best so far, as the paper does
// shades: each-nearer-hit
//
// Shades every hit that is nearer than the hits found before it, as the paper does. Where surfaces hide each other,
// shadow rays are also cast for hidden hits, and their results are discarded.

void on_nearer_hit(Working *working, const Scene *scene, int triangle, const Hit *hit, Mask nearer) {
    // Only the lanes of `nearer` hit this triangle; the other lanes keep the weights of their nearest hit.
    const Vec3 weights = vec3(1.0f - hit->w1 - hit->w2, hit->w1, hit->w2);
    working_set(working, WEIGHTS, select3(nearer, weights, working_get(working, WEIGHTS)));
    Lanes column[FLOATS_OF_SURFACE];
    for (int lane = 0; lane < WIDTH; lane++) gather_surface(&scene->geometry, triangle, lane, column);
    const Surface surface = TEXTURED(surface_of(column), &scene->textures,
                                     SELECT(nearer, (varying_int)(triangle), (varying_int)(NO_HIT)), hit->w1, hit->w2,
                                     working_get(working, RAY_DIRECTION), hit->t);
    // A nearer hit that is found later overwrites this result. The earlier hit's shadow rays were then cast in vain.
    shade(working, scene, &surface, hit->t, nearer);
}

void after_closest_hit(Working *working, const Scene *scene, const Nearest *nearest, Mask hits) {}
