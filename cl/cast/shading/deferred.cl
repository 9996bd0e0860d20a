// meaning: once, at the nearest hit
// shades: nearest-hit
//
// Shades each ray once, at its nearest hit.

void on_nearer_hit(Working *working, const Scene *scene, int triangle, const Hit *hit, Mask nearer) {}

void after_closest_hit(Working *working, const Scene *scene, const Nearest *nearest, Mask hits) {
    // Of the nearest hit that the search has found, only the triangle's number is used: t and the weights are computed
    // again, from the ray and the triangle.
    const Hit hit = intersect_planes(&scene->geometry, nearest->triangle, working_get(working, RAY_ORIGIN),
                                     working_get(working, RAY_DIRECTION));
    working_set(working, WEIGHTS, vec3(1.0f - hit.w1 - hit.w2, hit.w1, hit.w2));
    const Surface own = COLOURED(gather_surfaces(&scene->geometry, nearest->triangle), scene->corner_colours,
                                 nearest->triangle, hit.w1, hit.w2);
    const Surface surface = TEXTURED(own, &scene->textures, nearest->triangle, hit.w1, hit.w2,
                                     working_get(working, RAY_DIRECTION), hit.t);
    shade(working, scene, &surface, TRIANGLE_ARGUMENT(nearest->triangle) hit.t, hits);
}
