// Radiance towards the eye at a hit: Hughes et al., Computer Graphics, chapter 15. Its readable twin in f64 is
// src/reference/.

// base to the power of exponent, neither of them negative: the built-in pow has to ask for more, and is not as precise.
varying power_of(varying base, varying exponent) {
    const varying at_zero = SELECT(exponent > 0.0f, (varying)(0.0f), (varying)(1.0f));
    return SELECT(base > 0.0f, exp2(exponent * log2(base)), at_zero);
}

// f(w_i, w_o, n): k_L / pi, and with a highlight (k_L + k_G (s + 8) max(0, n.w_h)^s / 8) / pi.
Vec3 reflectance(const Surface *surface, Vec3 to_light, Vec3 to_eye, Vec3 normal, Mask lit) {
    Vec3 sum = surface->lambertian;
    const Mask glossy = lit & (surface->kind > 0.0f);
    if (ANY(glossy)) {
        const Vec3 half_way = normalize_or_zero(add(to_light, to_eye));
        const varying cosine = max(dot3(normal, half_way), (varying)(0.0f));
        const varying s = surface->shininess;
        const varying highlight = (s + 8.0f) * power_of(cosine, s) * 0.125f;
        sum = select3(glossy, add(sum, scale(surface->glossy, highlight)), sum);
    }
    return scale(sum, (varying)(M_1_PI_F));
}

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
        const __global float *at = scene->lights + 6 * light;
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
