// Computes the radiance that leaves a hit towards the eye: the emitted radiance, and what the surface reflects from the
// sky and from all lights that are visible from the hit.

#if PLANES_OF_ORIGIN
#include "common/shadow_end.cl"
#endif

// Stores in the working vector RADIANCE the radiance that leaves the hits of `active` lanes towards the eye. The hits
// are at distance t along the rays; their weights are in the working vector WEIGHTS. Let d be a ray's direction, w_i
// the direction to a light, and w_o = -d the direction to the eye:
//
//     P = origin + t d     n = w0 n0 + w1 n1 + w2 n2, of unit length
//     L_i = power / (4 pi r^2), since a point light's power is spread over a sphere of radius r
//           (an area light: times share_towards, see common/area_light.cl)
//     L_o += L_i f(w_i, w_o, n) (n . w_i), one light's term of the reflection equation
//
// With smooth shadows, the hit P is moved onto a smooth surface before it is lit (smooth_shadows.cl).
void shade(Working *working, const Scene *scene, const Surface *surface, TRIANGLE_PARAMETER varying t, Mask active) {
    const Vec3 weights = working_get(working, WEIGHTS);
    const Vec3 direction = working_get(working, RAY_DIRECTION);
    Vec3 point = along(working_get(working, RAY_ORIGIN), t, direction);
#if SMOOTH_SHADOWS
    move_hits(&scene->geometry, triangle, surface, weights, &point);
#endif
    working_set(working, POINT, point);
    working_set(working, NORMAL,
                normalize_or_zero(along(along(scale(surface->n0, weights.x), weights.y, surface->n1), weights.z,
                                        surface->n2)));
    // With shading = eager, RADIANCE may contain the radiance of a more distant hit, so RADIANCE is overwritten by the
    // emitted radiance, which is 0 without EMISSIVE.
#if EMISSIVE
    const Vec3 emitted = surface->emitted;
#else
    const varying zero = (varying)(0.0f);
    const Vec3 emitted = vec3(zero, zero, zero);
#endif
    working_set(working, RADIANCE, select3(active, emitted, working_get(working, RADIANCE)));

    for (int light = 0; light < scene->light_count; light++) {
        const __global float *at = scene->lights + LIGHT_FLOATS * light;
#if SOFT
        const Pixels pixels = own_pixels((int2)(0, 0));
        const Vec3 position = add(splat(LOAD3(at)), off_middle(&scene->soft, light, at, pixels.x, pixels.y));
        const Vec3 offset = subtract(position, working_get(working, POINT));
#else
        const Vec3 offset = subtract(splat(LOAD3(at)), working_get(working, POINT));
#endif
        const varying squared = dot3(offset, offset);
        const varying distance = sqrt(squared);
        working_set(working, TO_LIGHT, scale(offset, 1.0f / distance));
        const varying cosine = dot3(working_get(working, TO_LIGHT), working_get(working, NORMAL));
        // A light that is behind the surface, or nearer to the hit than the bias, contributes nothing and needs no
        // shadow ray. If tiles of triangles are streamed through __local memory, the work-item continues anyway, since
        // all work-items must reach the barriers in any_hit.
        Mask lit = active & (cosine > 0.0f) & (distance > scene->bias);
#if AREA_LIGHTS
        // The back of an area light is dark, so hits behind the light need no shadow ray.
        const varying share = share_towards(at, working_get(working, TO_LIGHT));
        lit &= share > 0.0f;
#else
        const float share = 1.0f;
#endif
#if !STREAM_TILES
        if (!ANY(lit)) continue;
#endif
        // The shadow ray's length is `distance - bias`, since it connects the light and a point at the distance `bias`
        // from the hit. The number of the light's origin is 1 + light, since the eye is origin 0.
        const varying length = distance - scene->bias;
#if PLANES_OF_ORIGIN
        // The shadow ray is cast from the light, and ends a small distance before the hit.
        const varying end = distance * (1.0f - gap_before_hit(scene->bias / distance, 1.0f / cosine));
#else
        const varying end = length;
#endif
#if SOFT && PLANES_OF_ORIGIN
        if (radius_of(&scene->soft, light) > 0.0f) lit &= !any_hit_apart(working, scene, length, lit);
        else if (!IS_UNOCCLUDED(&scene->soft)) lit &= !any_hit(working, scene, 1 + light, end, lit);
#else
#if SOFT
        if (!IS_UNOCCLUDED(&scene->soft))
#endif
            lit &= !any_hit(working, scene, 1 + light, end, lit);
#endif
        // TO_EYE is set inside the loop, although its value is the same for all lights. If TO_EYE is set before the
        // loop, one compiler moves the store behind the barriers in any_hit, and then stores another work-item's value.
        working_set(working, TO_EYE, negate(working_get(working, RAY_DIRECTION)));
        const varying spread = share / (4.0f * M_PI_F * squared);
        working_set(working, INCOMING, scale(splat(LOAD3(at + 3)), spread));
        const Vec3 f = reflectance(surface, working_get(working, TO_LIGHT), working_get(working, TO_EYE),
                                   working_get(working, NORMAL), lit);
        const Vec3 received = scale(multiply(working_get(working, INCOMING), f), cosine);
        const Vec3 sum = working_get(working, RADIANCE);
        working_set(working, RADIANCE, select3(lit, add(sum, received), sum));
    }
#if SKY
    add_sky(working, scene, surface, active);
#endif
}
