// Shadow rays without a common origin: to points of a light with an extent, and to the sky.

#if PLANES_OF_ORIGIN
// Returns the lanes of `wanted` whose ray is blocked before t_max, like any_hit. Planes prepared for an origin are of
// no use for rays without a common origin. Each triangle is therefore tested by its corners (is_stopped_by).
Mask any_hit_apart(const Working *working, const Scene *scene, varying t_max, Mask wanted) {
    Mask open = wanted;
    for (int triangle = 0; triangle < scene->geometry.count && ANY(open); triangle++) {
        // The working vectors are read again for every triangle, as in any_hit: strategies differ in the memory of
        // these vectors, and the measured times include the reads.
        const Vec3 direction = working_get(working, TO_LIGHT);
        const Vec3 from = along(working_get(working, POINT), (varying)(scene->bias), direction);
        open &= !SOLID_ON_RAYS(&scene->textures, triangle, corners(&scene->geometry, triangle), from, direction,
                               is_stopped_by(corners(&scene->geometry, triangle), from, direction, t_max));
    }
    return wanted & !open;
}
#else
#define any_hit_apart(working, scene, t_max, wanted) any_hit(working, scene, 0, t_max, wanted)
#endif

#if SKY
// Adds the sky's light to the working vector RADIANCE of `active` lanes. Each lane casts one ray. The probability
// density of the ray's direction is proportional to the direction's cosine with the normal. Because of this density, a
// ray that nothing blocks adds the sky's radiance in the ray's direction, times k_L (surface->lambertian).
void add_sky(Working *working, const Scene *scene, const Surface *surface, Mask active) {
    const Pixels pixels = own_pixels((int2)(0, 0));
    const Vec3 normal = working_get(working, NORMAL);
    if (IS_UNOCCLUDED(&scene->soft)) {
        // In a picture of unoccluded light, the sky adds its mean light, and no ray is cast.
        const Vec3 arriving = multiply(surface->lambertian, mean_of_sky(&scene->soft, normal));
        const Vec3 before = working_get(working, RADIANCE);
        working_set(working, RADIANCE, select3(active, add(before, arriving), before));
        return;
    }
    const Vec3 direction =
        direction_to_sky(point_of_sphere(&scene->soft, scene->light_count, pixels.x, pixels.y), normal);
    working_set(working, TO_LIGHT, direction);
    // Rounding, or a normal of zero, may give a direction that is not above the surface.
    Mask lit = active & (dot3(direction, normal) > 0.0f);
    lit &= !any_hit_apart(working, scene, (varying)(reach_of_sky(&scene->soft) - scene->bias), lit);
    const Vec3 received = multiply(surface->lambertian, radiance_of_sky(&scene->soft, working_get(working, TO_LIGHT)));
    const Vec3 sum = working_get(working, RADIANCE);
    working_set(working, RADIANCE, select3(lit, add(sum, received), sum));
#if ENVIRONMENT
    // Shiny surfaces also mirror the picture of the sky.
    const Vec3 mirrored = mirrored_sky(&scene->soft, scene->light_count + 1, pixels.x, pixels.y, surface,
                                       working_get(working, NORMAL), negate(working_get(working, RAY_DIRECTION)));
    const Vec3 before = working_get(working, RADIANCE);
    working_set(working, RADIANCE, select3(active, add(before, mirrored), before));
#endif
}
#endif
