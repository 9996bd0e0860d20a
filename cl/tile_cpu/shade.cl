// Shades a tile's nearest hits.

// The lights and materials that shading needs.
typedef struct {
    const __global float *lights;
    int light_count;
    float bias;
    const __global float *materials;
#if TEXTURES
    Textures textures;
#endif
#if SOFT
    Soft soft;
#endif
} Lighting;

// Returns one material, with the same values in all lanes.
Surface one_material(const __global float *material) {
    Surface surface;
    surface.lambertian = splat(LOAD3(material));
    surface.glossy = splat(LOAD3(material + 3));
    surface.shininess = (varying)(material[6]);
    surface.kind = (varying)(material[7]);
    return surface;
}

// Returns the materials of a vector's hits, one per lane. Usually, all hits have the same material.
Surface gather_materials(const Lighting *lighting, varying numbers, Mask hits) {
    IntLanes at;
    at.all = AS_INT(numbers);
    // If all hits share a material, it is loaded once; otherwise each lane loads its own.
    const int first = at.each[LOWEST_BIT(LANE_BITS16(hits))];
    if (!ANY(hits & (at.all != first))) return one_material(lighting->materials + MATERIAL_FLOATS * first);
    // Lanes without a hit load the first hit's material, so that every address is valid.
    at.all = SELECT(hits, at.all, (varying_int)(first));
    Lanes column[MATERIAL_FLOATS];
    for (int lane = 0; lane < WIDTH; lane++)
        for (int i = 0; i < MATERIAL_FLOATS; i++) column[i].each[lane] = lighting->materials[MATERIAL_FLOATS * at.each[lane] + i];
    Surface surface;
    surface.lambertian = vec3(column[0].all, column[1].all, column[2].all);
    surface.glossy = vec3(column[3].all, column[4].all, column[5].all);
    surface.shininess = column[6].all;
    surface.kind = column[7].all;
    return surface;
}

// The hits of a vector's rays, and the surface at each hit.
typedef struct {
    Vec3 point, normal, to_eye;
    Surface surface;
} Shaded;

// Computes a vector's hits from its rays and the triangles that the rays hit. `corner` and `normal` are columns
// (vectors) with the triangles' corners and normals, as gather_rows returns them.
INLINED void compute_surface_points(const Lighting *lighting, Vec3 origin, Vec3 direction, const varying *corner,
                                    const varying *normal, Mask hits, Shaded *shaded) {
    const Vec3 v0 = vec3(corner[0], corner[1], corner[2]);
    const Vec3 e1 = subtract(vec3(corner[4], corner[5], corner[6]), v0);
    const Vec3 e2 = subtract(vec3(corner[8], corner[9], corner[10]), v0);
    // t and weights are computed again, as in every strategy with shading = deferred, so that the picture does not
    // depend on the test that found the triangle.
    const Hit hit = intersect_plane(v0, e1, e2, origin, direction);
    shaded->point = along(origin, hit.t, direction);
    const Vec3 n0 = vec3(normal[0], normal[1], normal[2]);
    const Vec3 n1 = vec3(normal[4], normal[5], normal[6]);
    const Vec3 n2 = vec3(normal[8], normal[9], normal[10]);
    shaded->normal = normalize_or_zero(along(along(scale(n0, 1.0f - hit.w1 - hit.w2), hit.w1, n1), hit.w2, n2));
    shaded->to_eye = negate(direction);
    shaded->surface = TEXTURED(gather_materials(lighting, corner[7], hits), &lighting->textures,
                               SELECT(hits, AS_INT(corner[3]), (varying_int)(NO_HIT)), hit.w1, hit.w2, direction, hit.t);
}

// Loads the triangles that a vector's rays from the eye hit, and computes the hits.
void find_surface_points(const SurfaceTree *tree, const Lighting *lighting, float4 eye, const Bundle *bundle,
                         int vector, Mask hits, Shaded *shaded) {
    const Vec3 origin = splat(LOAD3((const float *)&eye));
    // The directions in the bundle have depth 1 (a component of 1 along the view direction), not length 1.
    const Vec3 d = vec3(bundle->x[vector], bundle->y[vector], bundle->z[vector]);
    const Vec3 direction = scale(d, 1.0f / sqrt(dot3(d, d)));
    const varying_int index = bundle->leaf_index[vector];
    // Lanes without a hit gather another lane's triangle, so that every address is valid.
    IntLanes indices;
    indices.all = index;
    const int first = indices.each[LOWEST_BIT(LANE_BITS16(hits))];
    const varying_int safe = SELECT(hits, index, (varying_int)(first));
    const __global float *corners = tree->tree.leaves;
    varying corner[12], normal[12];
    if (!ANY(safe != first)) {
        // All lanes have the same triangle. The triangle is loaded once, and is in registers while the hits are
        // computed.
        spread_row(corners + ROW_FLOATS * (size_t)first, ROW_FLOATS / 3, corner);
        spread_normals(&tree->normals, first, as_int(corners[ROW_FLOATS * (size_t)first + 3]), normal);
        compute_surface_points(lighting, origin, direction, corner, normal, hits, shaded);
    } else {
        gather_rows(corners, ROW_FLOATS / 3, safe, corner);
        gather_normals(&tree->normals, safe, AS_INT(corner[3]), normal);
        compute_surface_points(lighting, origin, direction, corner, normal, hits, shaded);
    }
}

// Computes the rays from a light to a vector's hits, the interval of their directions, and (in `arriving`) the radiance
// that the hits reflect to the eye if nothing blocks the light. Returns the lanes that the light can reach.
Mask light_vector(Bundle *bundle, Slices *slices, const Lighting *lighting, int light, int vector, const Shaded *shaded,
                  Mask hits, Vec3 *arriving) {
    const Vec3 offset = subtract(splat(LOAD3(lighting->lights + LIGHT_FLOATS * light)), shaded->point);
    const varying squared = dot3(offset, offset);
    const varying distance = sqrt(squared);
    const varying per_distance = 1.0f / distance;
    const Vec3 to_light = scale(offset, per_distance);
    // A light that is behind the surface, or nearer to the hit than the bias, contributes nothing.
    const varying cosine = dot3(to_light, shaded->normal);
    const Mask lit = hits & (cosine > 0.0f) & (distance > lighting->bias);
    if (!ANY(lit)) return lit;
    const Vec3 f = reflectance(&shaded->surface, to_light, shaded->to_eye, shaded->normal, lit);
    const Vec3 power = splat(LOAD3(lighting->lights + LIGHT_FLOATS * light + 3));
    // If nothing blocks the light, the radiance is power / (4 pi r^2) times f times the cosine.
    *arriving = scale(multiply(power, f), cosine * (per_distance * per_distance * (0.25f * M_1_PI_F)));
    // The shadow ray starts at the light, so that all rays of the tile have a common origin again. All directions have
    // length 1: bounds of rounding errors are relative to the longest direction of the tile, and would be far too large
    // for rays to hits near the light if directions had the lengths of the rays.
    bundle->x[vector] = -to_light.x;
    bundle->y[vector] = -to_light.y;
    bundle->z[vector] = -to_light.z;
    // The shadow ray ends shortly before t = distance, which is the hit.
    const varying gap = gap_before_hit(lighting->bias * per_distance, 1.0f / cosine);
    bundle->inv_t[vector] = SELECT(lit, per_distance / (1.0f - gap), (varying)(FAR));
    ((float *)slices->reach)[vector] = most_lane(SELECT(lit, distance, (varying)(0.0f)));
    const varying *components[3] = {bundle->x, bundle->y, bundle->z};
    for (int axis = 0; axis < 3; axis++) {
        const varying component = components[axis][vector];
        // The vector's interval of directions is one lane of the slices.
        ((float *)slices->low[axis])[vector] = least_lane(SELECT(lit, component, (varying)(FAR)));
        ((float *)slices->high[axis])[vector] = most_lane(SELECT(lit, component, (varying)(-FAR)));
    }
    prepare_rays(bundle, vector, lit);
    return lit;
}

// Computes the rays from a light to the hits of the tile's vectors. Without soft light, the hits are computed for the
// first light, and stored for the other lights. Returns the vectors with at least one ray, one bit each.
uint make_light_rays(CAST_PARAMETERS Bundle *bundle, Slices *slices, const SurfaceTree *tree, const Lighting *lighting,
                     int light, CAMERA_PARAMETERS, int2 image_size, uint hit, Shaded *shaded, Vec3 *arriving) {
    for (int part = 0; part < PARTS; part++) {
        for (int axis = 0; axis < 3; axis++) {
            slices->low[axis][part] = (float16)(FAR);
            slices->high[axis][part] = (float16)(-FAR);
        }
        slices->reach[part] = (float16)(0.0f);
    }
    bundle->longest = 1.0f;
    bundle->origin = LOAD3(lighting->lights + LIGHT_FLOATS * light);
    bundle->too_near = FAR;
    // The vectors in which at least one hit faces the light.
    uint open = 0;
    for (uint left = hit; left; left &= left - 1) {
        const int vector = LOWEST_BIT(left);
        const Mask hits = bundle->leaf_index[vector] != NO_HIT;
#if SOFT
        const Shaded *surface = shaded + vector; // computed by shade_tile, before all lights
#else
        Shaded *surface = shaded + (lighting->light_count > 1 ? vector : 0); // with a single light, hits are not stored
        if (light == 0) find_surface_points(tree, lighting, eye, bundle, vector, hits, surface);
#endif
        const Mask lit = light_vector(bundle, slices, lighting, light, vector, surface, hits, arriving + vector);
        open |= ANY(lit) ? 1u << vector : 0;
    }
    const Uniform3 eye_to_light = uniform_difference(bundle->origin, uniform3(eye.x, eye.y, eye.z));
    const float block_side = (BLOCK_X >> SUBPIXEL_BITS) * pixel_side(step_x, step_y);
    set_scattered(bundle, open & scattered_vectors(slices, eye_to_light, block_side));
    return open;
}

// With PREFETCH, STREAM16 stores 16 floats without writing them to the caches, since nothing reads the image again
// before the next sample or the next kernel.
#if PREFETCH
#define STREAM16(value, to) __builtin_nontemporal_store(value, (__global float16 *)(to))
#else
#define STREAM16(value, to) vstore16(value, 0, (__global float *)(to))
#endif

// Stores one row of a block: four pixels, with the lanes `lanes` (such as s0123). `row` points to the row's first
// pixel.
#define STORE_PIXELS(lanes, row)                                          \
    STREAM16(MEAN_WITH(vload16(0, (__global float *)(row)),               \
                       interleave(red.lanes, green.lanes, blue.lanes, hit.lanes)), row)

#if SAMPLED
float sum_of_lanes(float16 v) {
    const float8 a = v.lo + v.hi;
    const float4 b = a.lo + a.hi;
    const float2 c = b.lo + b.hi;
    return c.x + c.y;
}

// Returns four sums, each over the 2 x 2 neighbouring lanes that are the sub-pixels of one pixel.
float4 sums_of_squares(float16 v) {
    // Adds neighbours across, then down:
    //
    //      0  1  2  3                 0 1                 0 1
    //      4  5  6  7        ->       2 3        ->       2 3
    //      8  9 10 11                 4 5
    //     12 13 14 15                 6 7
    //     4 rows of 4                 4 rows of 2         2 rows of 2
    const float8 across = v.even + v.odd;
    return across.s0145 + across.s2367;
}

// Updates a pixel's mean of `earlier` samples by `count` new samples, whose sum is `sum`.
void add_samples(__global float4 *mean, float4 sum, uint earlier, int count) {
    const float per_sample = 1.0f / (float)(earlier + count);
    *mean = earlier ? *mean + (sum - (float)count * *mean) * per_sample : sum * per_sample;
}

// Adds this frame's samples of a vector's pixels to the pixels' means in the image.
void store_subpixels(const FrameSamples *samples, __global float4 *restrict image, int2 image_size, float4 background,
                     const Vec3 *sum, const Pixels *pixels, Mask hits) {
    // Sub-pixels without a sample add nothing; samples that hit nothing add the background.
    const varying red = SELECT(hits, sum->x, SELECT(samples->filled, (varying)(background.x), (varying)(0.0f)));
    const varying green = SELECT(hits, sum->y, SELECT(samples->filled, (varying)(background.y), (varying)(0.0f)));
    const varying blue = SELECT(hits, sum->z, SELECT(samples->filled, (varying)(background.z), (varying)(0.0f)));
    const varying hit = SELECT(hits, (varying)(1.0f), (varying)(0.0f));
    const int x = pixels->x.s0, y = pixels->y.s0;
    if (x >= image_size.x || y >= image_size.y) return;
    __global float4 *mean = image + (size_t)y * image_size.x + x;
    if (samples->bits == 2) {
        // All lanes belong to one pixel.
        const float4 total = (float4)(sum_of_lanes(red), sum_of_lanes(green), sum_of_lanes(blue), sum_of_lanes(hit));
        add_samples(mean, total, samples->earlier, samples->count);
        return;
    }
    // Otherwise the vector has 2 x 2 pixels, of which some may lie outside the image.
    const float4 r = sums_of_squares(red), g = sums_of_squares(green), b = sums_of_squares(blue), h = sums_of_squares(hit);
    const int right = x + 1 < image_size.x, below = y + 1 < image_size.y;
    add_samples(mean, (float4)(r.x, g.x, b.x, h.x), samples->earlier, samples->count);
    if (right) add_samples(mean + 1, (float4)(r.y, g.y, b.y, h.y), samples->earlier, samples->count);
    mean += image_size.x;
    if (below) add_samples(mean, (float4)(r.z, g.z, b.z, h.z), samples->earlier, samples->count);
    if (right && below) add_samples(mean + 1, (float4)(r.w, g.w, b.w, h.w), samples->earlier, samples->count);
}
#endif

// Stores the radiance of a vector of a tile, like store_radiance. If the block lies inside the image, and the image's
// width is a multiple of four pixels, the function stores four pixels of a row at a time.
void store_block(CAST_PARAMETERS __global float4 *restrict image, int2 image_size, float4 background,
                 const Vec3 *sum, const Pixels *pixels, Mask hits) {
#if SAMPLED
    if (samples->bits) {
        store_subpixels(samples, image, image_size, background, sum, pixels, hits);
        return;
    }
    const uint earlier = samples->earlier;
#endif
    const int x = pixels->x.s0, y = pixels->y.s0;
    // At the border of the image, or if rows do not begin at multiples of four pixels, pixels are stored one by one.
    if (image_size.x % BLOCK_X || x >= image_size.x || y + BLOCK_Y > image_size.y) {
        store_radiance(EARLIER_ARGUMENT image, image_size, background, *sum, *pixels, hits);
        return;
    }
    const varying red = SELECT(hits, sum->x, (varying)(background.x));
    const varying green = SELECT(hits, sum->y, (varying)(background.y));
    const varying blue = SELECT(hits, sum->z, (varying)(background.z));
    const varying hit = SELECT(hits, (varying)(1.0f), (varying)(0.0f));
    __global float4 *row = image + (size_t)y * image_size.x + x;
    STORE_PIXELS(s0123, row);
    STORE_PIXELS(s4567, row + image_size.x);
    STORE_PIXELS(s89ab, row + 2 * image_size.x);
    STORE_PIXELS(scdef, row + 3 * image_size.x);
}

// Stores the background in all pixels of the tile.
void store_background(CAST_PARAMETERS __global float4 *restrict image, int2 image_size, float4 background) {
    const Vec3 none = splat(uniform3(0.0f, 0.0f, 0.0f));
    EACH_CAST(vector) {
        const Pixels pixels = tile_pixels(CAST_ARGUMENTS vector, image_size);
        store_block(CAST_ARGUMENTS image, image_size, background, &none, &pixels, (Mask)(0));
    }
}

#if SOFT
#include "tile_cpu/soft.cl"
#endif

// Shades a tile. For each light, computes the radiance that the tile's hits reflect without shadows. Then traverses the
// tree from the light to find the hits that are in shadow.
void shade_tile(CAST_PARAMETERS Bundle *bundle, const SurfaceTree *tree, const Lighting *lighting, CAMERA_PARAMETERS,
                int2 image_size, float4 background, __global float4 *restrict image) {
    Shaded shaded[VECTORS];
    Vec3 sum[VECTORS], arriving[VECTORS];
    uint hit = 0;
    for (int vector = 0; vector < VECTORS; vector++) {
        sum[vector] = splat(uniform3(0.0f, 0.0f, 0.0f));
        hit |= ANY(bundle->leaf_index[vector] != NO_HIT) ? 1u << vector : 0;
    }
#if SOFT
    // Several kinds of light need the hits, so the hits are computed once here, before the loop over lights.
    for (uint left = hit; left; left &= left - 1) {
        const int vector = LOWEST_BIT(left);
        find_surface_points(tree, lighting, eye, bundle, vector, bundle->leaf_index[vector] != NO_HIT, shaded + vector);
    }
#endif
    for (int light = 0; light < lighting->light_count; light++) {
#if SOFT
        if (radius_of(&lighting->soft, light) > 0.0f) {
            add_soft_light(CAST_ARGUMENTS bundle, tree, lighting, light, image_size, shaded, sum);
            continue;
        }
#endif
        Slices slices;
        const uint open = make_light_rays(CAST_ARGUMENTS bundle, &slices, tree, lighting, light, eye, corner, step_x, step_y,
                                          image_size, hit, shaded, arriving);
        // If no hit of the tile faces this light, there is nothing to add.
        if (!open) continue;
#if SOFT
        if (!IS_UNOCCLUDED(&lighting->soft))
#endif
        {
            const TileInterval interval = interval_of_tile(&slices);
            finish_slices(bundle, &slices);
            walk(bundle, &slices, &interval, tree, open, 1);
        }
        for (uint left = open; left; left &= left - 1) {
            const int vector = LOWEST_BIT(left);
            // inv_t is FAR in lanes whose shadow ray is blocked, and in lanes without a shadow ray. All other lanes add
            // their light.
            sum[vector] = select3(bundle->inv_t[vector] < FAR, add(sum[vector], arriving[vector]), sum[vector]);
        }
    }
#if SKY
    add_sky(CAST_ARGUMENTS bundle, tree, lighting, image_size, shaded, sum);
#endif
    EACH_CAST(vector) {
        const Pixels pixels = tile_pixels(CAST_ARGUMENTS vector, image_size);
        store_block(CAST_ARGUMENTS image, image_size, background, sum + vector, &pixels,
                    bundle->leaf_index[vector] != NO_HIT);
    }
}
