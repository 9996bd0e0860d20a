// Shades a tile's nearest hits.

#if SOFT
#include "tile_cpu/soft.cl"
#endif

#if SHADES_ONCE
#define ONCE_VECTORS (once.vectors)
#else
#define ONCE_VECTORS 0u
#endif

// Shades a tile. A hit's radiance begins with the emitted radiance. For each light, computes the radiance that the
// tile's hits reflect without shadows. Then traverses the tree with rays from the light to find the hits in shadow.
void shade_tile(CAST_PARAMETERS Bundle *bundle, const SurfaceTree *tree, const Lighting *lighting, CAMERA_PARAMETERS,
                int2 image_size, float4 background, __global float4 *restrict image) {
    Shaded shaded[VECTORS];
    Vec3 sum[VECTORS], arriving[VECTORS];
    uint hit = 0;
    for (int vector = 0; vector < VECTORS; vector++) {
        sum[vector] = splat(uniform3(0.0f, 0.0f, 0.0f));
        hit |= ANY(bundle->leaf_index[vector] != NO_HIT) ? 1u << vector : 0; // other vectors need no light
    }
#if SOFT || EMISSIVE
    // Soft light and emitted light need the hits, so the hits are computed once here, before the loop over lights.
    for (uint left = hit; left; left &= left - 1) {
        const int vector = LOWEST_BIT(left);
        find_hits_of_vector(tree, lighting, eye, bundle, vector, bundle->leaf_index[vector] != NO_HIT, shaded + vector);
#if EMISSIVE
        sum[vector] = shaded[vector].surface.emitted;
#endif
    }
#endif
#if SHADES_ONCE
    OncePixels once;
    find_once(&once, samples, bundle, tree, lighting, eye, corner, step_x, step_y, hit);
#endif
    for (int light = 0; light < lighting->light_count; light++) {
#if SOFT
        if (radius_of(&lighting->soft, light) > 0.0f) {
            add_soft_light(CAST_ARGUMENTS bundle, tree, lighting, light, image_size, shaded, sum);
            continue; // rays to an extended light have no common origin, so they need another traversal
        }
#endif
        Slices slices;
        begin_light_rays(bundle, &slices, lighting, light);
        uint open = make_light_rays(bundle, &slices, tree, lighting, light, eye, hit & ~ONCE_VECTORS, shaded, arriving);
#if SHADES_ONCE
        open |= make_rays_once(&once, samples, bundle, &slices, lighting, light, eye, shaded);
#endif
        find_scattered(CAST_ARGUMENTS bundle, &slices, eye, corner, step_x, step_y, open);
        // If no hit of the tile faces this light, the light adds nothing.
        if (!open) continue;
#if SOFT
        if (!IS_UNOCCLUDED(&lighting->soft))
#endif
        {
            const TileInterval interval = interval_of_tile(&slices);
            finish_slices(bundle, &slices);
            walk(bundle, &slices, &interval, tree, open, 1); // 1: any hit blocks the light, not only the nearest
        }
#if SHADES_ONCE
        add_light_once(&once, samples, bundle, tree, lighting, light, eye, corner, step_x, step_y, image_size, open,
                       sum);
#endif
        for (uint left = open & ~ONCE_VECTORS; left; left &= left - 1) {
            const int vector = LOWEST_BIT(left);
            // inv_t is FAR in lanes whose shadow ray is blocked, and in lanes without a shadow ray. Lanes whose inv_t
            // is less than FAR receive light.
            sum[vector] = select3(bundle->inv_t[vector] < FAR, add(sum[vector], arriving[vector]), sum[vector]);
        }
    }
#if SKY
    add_sky(CAST_ARGUMENTS bundle, tree, lighting, image_size, shaded, sum);
#endif
#if SAMPLED
    if (IS_PIXEL_A_VECTOR(samples)) {
        float4 sums[VECTORS];
        uint left = samples->cast; // not the pixels that already have enough samples
#if SHADES_ONCE
        left &= ~sum_once(&once, samples, sums, sum);
#endif
        for (; left; left &= left - 1) {
            const int vector = LOWEST_BIT(left);
            sums[vector] = sum_of_samples(samples, background, sum + vector, bundle->leaf_index[vector] != NO_HIT);
        }
        store_sums(samples, sums, image, image_size);
        return; // each vector was one pixel, so there are no blocks of pixels to store
    }
#endif
    EACH_CAST(vector) {
        const Pixels pixels = tile_pixels(CAST_ARGUMENTS vector, image_size);
        store_block(CAST_ARGUMENTS image, image_size, background, sum + vector, &pixels,
                    bundle->leaf_index[vector] != NO_HIT);
    }
}
