// Radiance towards the eye at a hit, from all lights that reach it.

// Sums the lights that reach `active` lanes' hits, at distance t and with the working vectors' weights, into
// the working vector RADIANCE of these lanes.
void shade(Working *working, const Scene *scene, const Surface *surface, varying t, Mask active) {
    const Vec3 weights = working_get(working, WEIGHTS);
    const Vec3 direction = working_get(working, RAY_DIRECTION);
    working_set(working, POINT, along(working_get(working, RAY_ORIGIN), t, direction));
    working_set(working, NORMAL,
                normalize_or_zero(along(along(scale(surface->n0, weights.x), weights.y, surface->n1), weights.z,
                                        surface->n2)));
    const varying zero = (varying)(0.0f);
    working_set(working, RADIANCE, select3(active, vec3(zero, zero, zero), working_get(working, RADIANCE)));

    for (int light = 0; light < scene->light_count; light++) {
        const __global float *at = scene->lights + LIGHT_FLOATS * light;
        const Vec3 offset = subtract(splat(LOAD3(at)), working_get(working, POINT));
        const varying squared = dot3(offset, offset);
        const varying distance = sqrt(squared);
        working_set(working, TO_LIGHT, scale(offset, 1.0f / distance));
        const varying cosine = dot3(working_get(working, TO_LIGHT), working_get(working, NORMAL));
        // A light on the surface, nearer than the bias, does not reach it.
        Mask lit = active & (cosine > 0.0f) & (distance > scene->bias);
#if !STREAM_TILES // there, every work-item has to meet the barriers
        if (!ANY(lit)) continue;
#endif
        lit &= !any_hit(working, scene, 1 + light, distance - scene->bias, lit);
        // Here and not before the loop: where any_hit has barriers, a compiler for CPUs negates only after them, and then
        // the direction of another work-item, which is left in a register.
        working_set(working, TO_EYE, negate(working_get(working, RAY_DIRECTION)));
        const varying spread = 1.0f / (4.0f * M_PI_F * squared);
        working_set(working, INCOMING, scale(splat(LOAD3(at + 3)), spread));
        const Vec3 f = reflectance(surface, working_get(working, TO_LIGHT), working_get(working, TO_EYE),
                                   working_get(working, NORMAL), lit);
        const Vec3 received = scale(multiply(working_get(working, INCOMING), f), cosine);
        const Vec3 sum = working_get(working, RADIANCE);
        working_set(working, RADIANCE, select3(lit, add(sum, received), sum));
    }
}
