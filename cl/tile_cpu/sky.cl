// Casts the rays from a tile's hits to the sky.

#include "tile_cpu/single_ray.cl"

#if ENVIRONMENT
// Adds the light that shiny surfaces mirror from the picture of the sky, at the hits of one vector of rays.
void add_mirrored_sky(const Lighting *lighting, const Shaded *shaded, const Pixels *pixels, Mask hits, Vec3 *sum) {
    const Vec3 mirrored = mirrored_sky(&lighting->soft, lighting->light_count + 1, pixels->x, pixels->y, &shaded->surface,
                                       shaded->normal, shaded->to_eye);
    *sum = select3(hits, add(*sum, mirrored), *sum);
}
#endif

// Adds to `sum` the light of the sky that each hit reflects. A hit casts at most one ray. The probability density of
// the ray's direction is proportional to the direction's cosine with the normal, so the light to add is k_L
// (`lambertian`) times the sky's radiance in this direction.
void add_sky(CAST_PARAMETERS const Bundle *bundle, const SurfaceTree *tree, const Lighting *lighting, int2 image_size,
             const Shaded *shaded, Vec3 *sum) {
    const float reach = reach_of_sky(&lighting->soft) - lighting->bias;
    Vec3 point;
    int is_chosen = 0;
    for (int vector = 0; vector < VECTORS; vector++) {
        const Mask hits = bundle->leaf_index[vector] != NO_HIT;
        if (!ANY(hits)) continue;
        const Shaded *own = shaded + vector;
        if (IS_UNOCCLUDED(&lighting->soft)) {
            // In a picture of unoccluded light, the sky adds its mean light, and no ray is cast.
            const Vec3 arriving = multiply(own->surface.lambertian, mean_of_sky(&lighting->soft, own->normal));
            sum[vector] = select3(hits, add(sum[vector], arriving), sum[vector]);
            continue;
        }
        const Pixels pixels = tile_pixels(CAST_ARGUMENTS vector, image_size);
#if ENVIRONMENT
        add_mirrored_sky(lighting, own, &pixels, hits, sum + vector);
#endif
        if (!is_chosen) {
            point = point_of_sphere(&lighting->soft, lighting->light_count, pixels.x, pixels.y);
            is_chosen = VECTORS_SHARE_POINTS;
        }
        const Vec3 direction = direction_to_sky(point, own->normal);
        const Vec3 from = along(own->point, (varying)(lighting->bias), direction);
        // Rays that point below the surface are not cast.
        Mask open = hits & (dot3(direction, own->normal) > 0.0f);
        open &= !are_stopped_alone(&tree->tree, &from, &direction, reach, open);
        // The rays that nothing has stopped reach the sky.
        const Vec3 received = multiply(own->surface.lambertian, radiance_of_sky(&lighting->soft, direction));
        sum[vector] = select3(open, add(sum[vector], received), sum[vector]);
    }
}
