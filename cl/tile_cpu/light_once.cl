// The light on pixels that are shaded once (shade_once.cl).

// Stores the intervals of the shadow rays' directions in `slices`, and two numbers per pixel, per_reach and end. The
// rays from the light meet the pixel's hits at t = 1 / per_reach. The rays end shortly before, at t = 1 / end. Returns
// the pixels that the light can reach.
uint bound_rays_once(const OncePixels *once, const Lighting *lighting, int light, Slices *slices, varying *per_reach,
                     varying *end) {
    const Vec3 from = splat(LOAD3(lighting->lights + LIGHT_FLOATS * light));
    uint open = 0;
    for (int part = 0; part < PARTS; part++) {
        Mask lit = LANES_OF(once->vectors, part);
        if (!ANY(lit)) continue;
        LightDirection direction;
        find_light_direction(lighting, light, once->mean + part, &direction);
        lit &= direction.cosine > 0.0f; // shade_alike has already compared the light's distance with the bias
        open |= LANE_BITS16(lit) << (16 * part);
        // All hits of a pixel get the same t, `reach`, which is at least their distance from the light. The directions
        // of the pixel's rays therefore need no square root, and are at most 1 long.
        const varying reach = direction.distance + once->radius[part];
        per_reach[part] = 1.0f / reach;
        const varying gap = gap_before_hit(lighting->bias * direction.per_distance, 1.0f / direction.cosine);
        end[part] = per_reach[part] / (1.0f - gap);
        const varying rounding = 1e-6f * (fabs(from.x) + fabs(from.y) + fabs(from.z)) * per_reach[part];
        const Vec3 low = scale(subtract(once->low[part], from), per_reach[part]);
        const Vec3 high = scale(subtract(once->high[part], from), per_reach[part]);
        const varying least[3] = {low.x, low.y, low.z}, most[3] = {high.x, high.y, high.z};
        for (int axis = 0; axis < 3; axis++) {
            slices->low[axis][part] = SELECT(lit, least[axis] - rounding, slices->low[axis][part]);
            slices->high[axis][part] = SELECT(lit, most[axis] + rounding, slices->high[axis][part]);
        }
        slices->reach[part] = SELECT(lit, reach, slices->reach[part]);
    }
    return open;
}

// Returns the value that belongs to one vector of rays, from an array of float16 with one lane for each vector of rays.
#define VALUE_OF(array, vector) (((const float *)(array))[vector])

// Computes the rays from a light to the samples of pixels that are shaded once. When the first light's rays are made,
// `bundle` still has the directions from the eye. The samples' hits are computed from these directions. If there are
// more lights, the hits are kept in `shaded`. Returns the vectors of rays that the light can reach, one bit each.
uint make_rays_once(const OncePixels *once, const FrameSamples *samples, Bundle *bundle, Slices *slices,
                    const Lighting *lighting, int light, float4 eye, Shaded *shaded) {
    if (!once->vectors) return 0;
    const Vec3 from = splat(LOAD3(lighting->lights + LIGHT_FLOATS * light)), origin = splat(LOAD3((const float *)&eye));
    varying per_reach[PARTS], end[PARTS];
    const uint open = bound_rays_once(once, lighting, light, slices, per_reach, end);
    const int several = lighting->light_count > 1; // later lights then need the hits of all pixels shaded once
    for (uint left = several && light == 0 ? once->vectors : open; left; left &= left - 1) {
        const int vector = LOWEST_BIT(left);
        Vec3 *hit = &shaded[several ? vector : 0].point; // with a single light, no hit is needed later
        if (light == 0) {
            const Vec3 d = vec3(bundle->x[vector], bundle->y[vector], bundle->z[vector]);
            const varying inv_t = d.x * VALUE_OF(once->inverse_depth[0], vector) +
                                  d.y * VALUE_OF(once->inverse_depth[1], vector) +
                                  d.z * VALUE_OF(once->inverse_depth[2], vector);
            *hit = along(origin, 1.0f / inv_t, d);
        }
        if (!(open >> vector & 1u)) continue; // only later lights need these hits
        const Vec3 direction = scale(subtract(*hit, from), (varying)(VALUE_OF(per_reach, vector)));
        bundle->x[vector] = direction.x, bundle->y[vector] = direction.y, bundle->z[vector] = direction.z;
        bundle->inv_t[vector] = SELECT(samples->filled, (varying)(VALUE_OF(end, vector)), (varying)(FAR));
        prepare_rays(bundle, vector, samples->filled);
    }
    return open;
}

// Shades the samples in `reached` of one vector of rays, each at its own hit, and adds the reflected radiance to `sum`.
void add_to_samples(const FrameSamples *samples, const Bundle *bundle, const SurfaceTree *tree,
                    const Lighting *lighting, int light, CAMERA_PARAMETERS, int2 image_size, int vector, Mask reached,
                    Vec3 *sum) {
    // The bundle (the tile's rays) now has the rays from the light, so the directions from the eye are computed again.
    const Pixels pixels = tile_pixels(samples, vector, image_size);
    const varying x = RAY_X(pixels), y = RAY_Y(pixels);
    const Vec3 across = splat(LOAD3((const float *)&step_x)), down = splat(LOAD3((const float *)&step_y));
    const Vec3 d = along(along(splat(LOAD3((const float *)&corner)), x, across), y, down);
    Shaded shaded;
    find_surface_points(tree, lighting, eye, &d, bundle->leaf_index[vector], reached, &shaded);
    LightDirection direction;
    find_light_direction(lighting, light, &shaded, &direction);
    Vec3 arriving;
    find_unblocked_radiance(lighting, light, &shaded, &direction, reached, &arriving);
    *sum = select3(reached, add(*sum, arriving), *sum);
}

// Adds a light to the pixels that are shaded once. `open` has a bit for each vector of rays to which this light casts
// rays. If the light reaches all samples of a pixel, the radiance that the pixel reflects is added to `once->sum`. If
// the light reaches only some of the samples, the radiance of each reached sample is added to `sum`.
void add_light_once(OncePixels *once, const FrameSamples *samples, const Bundle *bundle, const SurfaceTree *tree,
                    const Lighting *lighting, int light, CAMERA_PARAMETERS, int2 image_size, uint open, Vec3 *sum) {
    const uint all = LANE_BITS16(samples->filled); // lanes without a sample have no ray
    uint whole = 0;
    for (uint left = open & once->vectors; left; left &= left - 1) {
        const int vector = LOWEST_BIT(left);
        const Mask reached = bundle->inv_t[vector] < FAR; // the rays of all other lanes are blocked, or were not cast
        const uint bits = LANE_BITS16(reached);
        if (bits == all) whole |= 1u << vector;
        if (bits == all || !bits) continue; // the second loop shades pixels in full light, up to 16 together
        once->split |= 1u << vector;
        add_to_samples(samples, bundle, tree, lighting, light, eye, corner, step_x, step_y, image_size, vector, reached,
                       sum + vector);
    }
    for (int part = 0; part < PARTS; part++) {
        const Mask pixels = LANES_OF(whole, part);
        if (!ANY(pixels)) continue; // shading costs the same for one pixel as for 16
        const Shaded *mean = once->mean + part;
        LightDirection direction;
        find_light_direction(lighting, light, mean, &direction);
        Vec3 arriving;
        find_unblocked_radiance(lighting, light, mean, &direction, pixels, &arriving);
        once->sum[0][part] += SELECT(pixels, arriving.x, (varying)(0.0f));
        once->sum[1][part] += SELECT(pixels, arriving.y, (varying)(0.0f));
        once->sum[2][part] += SELECT(pixels, arriving.z, (varying)(0.0f));
    }
}

// For each pixel that is shaded once and is not in `split`, computes the sum of its samples, and stores it in `sums`.
// Returns these pixels. In a pixel of `split`, at least one light reaches only some of the samples. The function adds
// the radiance from the lights that reach all samples (`once->sum`) to each of this pixel's samples in `sum`. The
// caller then adds up the samples.
static uint sum_once(const OncePixels *once, const FrameSamples *samples, float4 *sums, Vec3 *sum) {
    for (uint left = once->vectors; left; left &= left - 1) {
        const int vector = LOWEST_BIT(left);
        const Uniform3 mean = uniform3(VALUE_OF(once->sum[0], vector), VALUE_OF(once->sum[1], vector),
                                       VALUE_OF(once->sum[2], vector));
        if (once->split >> vector & 1u) sum[vector] = add(sum[vector], splat(mean));
        else sums[vector] = (float)samples->count * (float4)(mean.x, mean.y, mean.z, 1.0f); // all samples are equal
    }
    return once->vectors & ~once->split;
}
