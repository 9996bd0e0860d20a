// The end of a round of lights (see shadow.cl): after tiles have cast their shadow rays, the kernels in this file cast
// the shadow rays that tiles left over, and shade the hits.

// Casts a pixel's leftover shadow rays, one at a time, each by the whole group. `leftover` has a bit for each leftover
// shadow ray (see shadow.cl). Returns the bits of the rays whose lights reach the pixel.
INLINED uint cast_leftover(SOURCES_PARAMETER Group *group, const Tree *tree, const __global float *surfaces,
                           CAMERA_PARAMETERS, EyeRay eye_ray, int leaf_index, const __global float *lights,
                           uint leftover, float bias, __local uint2 *stack) {
    uint reached = 0;
    for (uint left = leftover; left; left &= left - 1) {
        const int light = LIGHT_OF_BIT(LOWEST_BIT(left));
        const __global float *at = lights + LIGHT_FLOATS * light;
#if SOFT
        // A ray to a light with an extent, or to the sky, starts at the hit, not at the light, and needs no planes that
        // were prepared for the light.
        if (lacks_common_origin(sources, light)) {
            const Ray from_eye = unit_ray(eye, corner, step_x, step_y, eye_ray);
            SurfacePoint hit = surface_point_of(tree, surfaces, from_eye, leaf_index);
            hit.pixel = eye_ray;
            if (reaches(group, tree, sources, light, at, &hit, bias, stack))
                reached |= left & (0u - left);
            continue;
        }
#endif
        const SurfacePoint surface_point =
            surface_point_for_lights(tree, surfaces, eye, corner, step_x, step_y, eye_ray, leaf_index);
        // Computes the ray from the light to the hit again. This ray is the only one in its shaft, so the box around
        // the slopes of the shaft's rays is a point. The ray ends at t = 1, where 1/z is `per_depth`.
        const Vec3 direction = direction_to_hit(surface_point, subtract(load_vec3(at), surface_point.point), bias);
        Shaft shaft;
        aim(group, tree, origin_at(LOAD3(at), 1 + light), uniform3(direction.x, direction.y, direction.z), &shaft);
        const float per_depth = reciprocal(fabs(component(direction.x, direction.y, direction.z, shaft.along)));
        const float x = component(direction.x, direction.y, direction.z, shaft.across) * per_depth;
        const float y = component(direction.x, direction.y, direction.z, shaft.down) * per_depth;
        widen(&shaft, x, x, y, y);
        // `left & (0u - left)` is the lowest set bit of `left`, which belongs to this light.
        if (!is_blocked(group, tree, &shaft, surface_point.point, x, y, per_depth, stack))
            reached |= left & (0u - left);
    }
    return reached;
}

// A loop of one group of lanes over its entries of the queue of leftover shadow rays. `groups` groups share the queue.
// Each of them casts every `groups`-th entry, from its own `first` on. The step is never larger than the rest of the
// queue, so that `i` cannot overflow.
#define FOR_QUEUED(i, first, groups, count) for (uint i = first; i < count; i += min(groups, count - i))

// Returns the ray from the eye that has the index `index` (see index_of).
INLINED EyeRay ray_of(Group *group, uint index, int2 grid) {
    return ray_at(group, (int2)((int)(index % (uint)grid.x), (int)(index / (uint)grid.x)), grid);
}

#if LEFTOVER_KERNEL
// Casts the leftover shadow rays. The queue has one entry for each ray from the eye that has leftover shadow rays. One
// group casts all leftover shadow rays of an entry.
__kernel GROUP_SHAPE GROUP_ATTRIBUTE void tile_left_over(TILE_LEFT_OVER_PARAMETERS) {
    STACK_LOCALS
    TREE_OF_TILES
    BIND_SOURCES
    const uint groups = (uint)get_num_groups(0) * LOCAL_Y, count = *queued;
    const uint first = (uint)get_group_id(0) * LOCAL_Y + group.number;
    FOR_QUEUED(i, first, groups, count) {
        const uint2 entry = queue[i];
        const uint reached = cast_leftover(SOURCES_ARGUMENT &group, &tree, surfaces, eye, corner, step_x, step_y,
                                           ray_of(&group, entry.x, GRID_OF(image_size)), nearest[entry.x],
                                           lights + LIGHT_FLOATS * first_light, entry.y, bias, stack);
        // Only this group writes the element of `lit` for this ray from the eye, so no atomic operation is needed.
        if (group.lane == 0) lit[entry.x] = (lit[entry.x] & ~SOME_LEFTOVER) | reached;
    }
}
#endif

// Emitted light is added in the first round of lights.
#if EMISSIVE
#define EMITS(first_light) ((first_light) == 0)
#define EMITS_PARAMETER int emits,
#define EMITS_ARGUMENT EMITS(first_light),
#else
#define EMITS(first_light) 0
#define EMITS_PARAMETER
#define EMITS_ARGUMENT
#endif
// HAS_LIGHT is not 0 if a pixel may get light in a round of lights: from lights that reach the pixel's hit, from a
// surface that emits light, or from the picture of the sky. Shiny surfaces mirror the picture of the sky in the round
// of lights that includes the sky.
#if ENVIRONMENT
#define SHOWS_SKY(sources) ((sources)->light_count < (sources)->first_light + LIGHTS_OF_ROUND)
#define HAS_LIGHT(reached, leaf_index) \
    ((reached) || ((leaf_index) != NO_HIT && (EMITS(first_light) || SHOWS_SKY(sources))))
#elif EMISSIVE
#define HAS_LIGHT(reached, leaf_index) ((reached) || ((leaf_index) != NO_HIT && EMITS(first_light)))
#else
#define HAS_LIGHT(reached, leaf_index) reached
#endif

INLINED void load_material(const __global float *material, Surface *surface) {
    surface->lambertian = load_vec3(material);
    surface->glossy = load_vec3(material + 3);
    surface->shininess = material[6];
    surface->kind = material[7];
#if EMISSIVE
    surface->emitted = load_vec3(material + 8);
    surface->emission_texture = material[11];
#endif
}

// Returns the radiance that a hit reflects to the eye from the lights whose bits are set in `reached`.
INLINED Vec3 arriving(SOURCES_PARAMETER const __global float *lights, uint reached, const Surface *surface,
                      SurfacePoint surface_point, Vec3 to_eye) {
    Vec3 sum = vec3(0.0f, 0.0f, 0.0f);
    // Each step takes the lowest set bit of `reached`, which belongs to the next light that reaches the hit.
    for (; reached; reached &= reached - 1) {
        const __global float *light = lights + LIGHT_FLOATS * LIGHT_OF_BIT(LOWEST_BIT(reached));
#if SOFT
        const Sight sight = sight_of(sources, LIGHT_OF_BIT(LOWEST_BIT(reached)), light, &surface_point);
#if SKY
        if (sight.is_sky) {
            const Vec3 radiance = IS_UNOCCLUDED(&sources->soft) ? mean_of_sky(&sources->soft, surface_point.normal)
                                                                : radiance_of_sky(&sources->soft, sight.direction);
            sum = add(sum, multiply(surface->lambertian, radiance));
            continue;
        }
#endif
        const Vec3 offset = scale(sight.direction, sight.distance);
#else
        const Vec3 offset = subtract(load_vec3(light), surface_point.point);
#endif
        const float squared = dot3(offset, offset);
        const Vec3 to_light = scale(offset, 1.0f / sqrt(squared));
        const float cosine = max(dot3(to_light, surface_point.normal), 0.0f); // negative only by rounding
        const Vec3 f = reflectance(surface, to_light, to_eye, surface_point.normal, 1);
#if AREA_LIGHTS
        const float share = share_towards(light, to_light);
#else
        const float share = 1.0f;
#endif
        // The power is divided first, as in cast/shade.cl: its product with f may be too large for single precision.
        sum = add(sum, multiply(scale(load_vec3(light + 3), share * cosine / (4.0f * M_PI_F * squared)), f));
    }
    return sum;
}

// The additional parameters of functions that shade with textures, including the comma after the parameters.
#if TEXTURES
#define TEXTURE_PARAMETERS const __global float4 *texture_rows, const __global uint *texture_words, float4 cone,
#define TEXTURE_ARGUMENTS texture_rows, texture_words, cone,
#else
#define TEXTURE_PARAMETERS
#define TEXTURE_ARGUMENTS
#endif
// The additional parameter of functions that shade with colours of corners, including the comma after the parameter.
#if CORNER_COLOURS
#define COLOUR_PARAMETER const __global uint *corner_colours,
#define COLOUR_ARGUMENT corner_colours,
#else
#define COLOUR_PARAMETER
#define COLOUR_ARGUMENT
#endif
// The additional parameters of shade_pixel for textures, colours of corners, emitted light and soft light.
#define SHADE_PARAMETERS TEXTURE_PARAMETERS COLOUR_PARAMETER EMITS_PARAMETER SOURCES_PARAMETER
#define SHADE_ARGUMENTS TEXTURE_ARGUMENTS COLOUR_ARGUMENT EMITS_ARGUMENT SOURCES_ARGUMENT

// Adds to `sum` the radiance that a pixel's hit sends to the eye in a round of lights. `reached` has a bit for each
// light of the round that reaches the hit.
INLINED void shade_pixel(SHADE_PARAMETERS const Tree *tree, const __global float *surfaces,
                         const __global float *materials, CAMERA_PARAMETERS, EyeRay eye_ray, int leaf_index,
                         const __global float *lights, uint reached, float4 *sum) {
    // Only the triangle's index in leaf order was stored, so the hit is computed again.
    const Ray from_eye = unit_ray(eye, corner, step_x, step_y, eye_ray);
    SurfacePoint surface_point = surface_point_of(tree, surfaces, from_eye, leaf_index);
    surface_point.normal = normalize_or_zero(surface_point.normal);
#if SOFT
    surface_point.pixel = eye_ray;
#endif
    Surface surface;
    load_material(materials + MATERIAL_FLOATS * surface_point.material, &surface);
#if CORNER_COLOURS
    surface = COLOURED(surface, corner_colours, surface_point.triangle, surface_point.w1, surface_point.w2);
#endif
#if TEXTURES
    Textures textures;
    textures.rows = texture_rows;
    textures.words = texture_words;
    textures.cone = cone;
    surface = TEXTURED(surface, &textures, surface_point.triangle, surface_point.w1, surface_point.w2,
                       from_eye.direction, surface_point.t);
#endif
    Vec3 received = arriving(SOURCES_ARGUMENT lights, reached, &surface, surface_point, negate(from_eye.direction));
#if ENVIRONMENT
    // Shiny surfaces also mirror the picture of the sky, once per frame.
    if (SHOWS_SKY(sources))
        received = add(received, mirrored_sky(&sources->soft, sources->light_count + 1, eye_ray.x, eye_ray.y, &surface,
                                              surface_point.normal, negate(from_eye.direction)));
#endif
#if EMISSIVE
    if (emits) received = add(received, surface.emitted);
#endif
    *sum += (float4)(received.x, received.y, received.z, 0.0f);
}

// AFTER_ROUND returns a pixel's value after a round of lights. `mean` is the pixel's value before the round of lights.
// `sum` is the light from the lights of the round, added up over the pixel's samples in this frame. With several
// samples per pixel, a pixel's value is the mean of all samples so far. The first round of lights of a frame adds the
// frame's samples to the mean. Later rounds of lights add their light to the same samples.
#if SAMPLED
#define SAMPLES_SO_FAR ((float)earlier + (float)SAMPLES_OF_FRAME)
#define AFTER_ROUND(mean, sum)                                                                    \
    (first_light ? (mean) + (sum) / SAMPLES_SO_FAR                                                \
     : earlier   ? (mean) + ((sum) - (float)SAMPLES_OF_FRAME * (mean)) / SAMPLES_SO_FAR           \
                 : (sum) / SAMPLES_SO_FAR)
#else
#define AFTER_ROUND(mean, sum) (first_light ? (mean) + (sum) : (sum))
#endif

// Returns the ray from the eye through one sample of a pixel. `ray` is the pixel's number among the lane's pixels.
// `row` is the row of work-groups that contains the tile.
INLINED EyeRay sample_in_row(Group *group, int row, int ray, int sample, int2 grid) {
#if SAMPLED
    const int last = (1 << group->bits) - 1;
    const int2 first = position_in_row(group, row, ray) << group->bits;
    return ray_at(group, first + (int2)(sample & last, sample >> group->bits), grid);
#else
    return ray_at(group, position_in_row(group, row, ray), grid);
#endif
}

// Shades the nearest hits by those lights of one round of lights that reach them. AFTER_ROUND combines the result with
// the image. If no other kernel has cast the leftover shadow rays, the first `queue_rows` rows of work-groups cast
// these rays and shade their pixels. Each leftover shadow ray takes long. While these rays are cast, the work-groups of
// all other rows shade the pixels without leftover shadow rays.
__kernel GROUP_SHAPE GROUP_ATTRIBUTE void tile_shade(TILE_SHADE_PARAMETERS) {
    STACK_LOCALS
    TREE_OF_TILES
    BIND_SOURCES
    const __global float *lights_of_round = lights + LIGHT_FLOATS * first_light;
    // The value of a pixel whose hit gets no light. The value's fourth component is 1, since it counts hits.
    const float4 dark = (float4)(0.0f, 0.0f, 0.0f, 1.0f);
    if ((int)get_group_id(1) < queue_rows) {
        const uint across = (uint)get_num_groups(0) * LOCAL_Y, groups = across * queue_rows;
        const uint first = (uint)get_group_id(1) * across + (uint)get_group_id(0) * LOCAL_Y + group.number;
        const uint count = *queued;
        FOR_QUEUED(i, first, groups, count) {
            const uint2 entry = queue[i];
            const EyeRay eye_ray = ray_of(&group, entry.x, GRID_OF(image_size));
            const int leaf_index = nearest[entry.x];
            uint reached = cast_leftover(SOURCES_ARGUMENT &group, &tree, surfaces, eye, corner, step_x, step_y, eye_ray,
                                         leaf_index, lights_of_round, entry.y, bias, stack);
            if (group.lane == 0) {
                // Adds the lights whose shadow rays were cast by a tile, and are not blocked.
                reached |= lit[entry.x] & ~SOME_LEFTOVER;
                float4 sum = first_light ? (float4)(0.0f) : dark;
                shade_pixel(SHADE_ARGUMENTS &tree, surfaces, materials, eye, corner, step_x, step_y, eye_ray,
                            leaf_index, lights_of_round, reached, &sum);
                image[entry.x] = AFTER_ROUND(image[entry.x], sum);
            }
        }
    } else {
        const int row = (int)get_global_id(1) / LOCAL_Y - queue_rows;
        const int2 grid = GRID_OF(image_size);
        float4 sum[RAYS];
        uint waiting = 0; // one bit per pixel of this lane: set if the pixel is queued, so that another group stores it
        int pixels = 0; // number of this lane's pixels that get samples
        EACH_RAY(ray) {
            sum[ray] = (float4)(0.0f);
            pixels += sample_in_row(&group, row, ray, 0, grid).inside;
        }
        for (int sample = 0; pixels && sample < SAMPLES_OF_FRAME; sample++) {
            int leaf_index[RAYS];
            uint reached[RAYS];
            EACH_RAY(ray) { // all loads come first, so that they overlap
                const EyeRay eye_ray = sample_in_row(&group, row, ray, sample, grid);
                leaf_index[ray] = eye_ray.inside ? nearest[index_of(eye_ray, grid)] : NO_HIT;
            }
            EACH_RAY(ray) {
                const EyeRay eye_ray = sample_in_row(&group, row, ray, sample, grid);
                reached[ray] =
                    leaf_index[ray] != NO_HIT && SOURCE_COUNT(light_count) ? lit[index_of(eye_ray, grid)] : 0;
                waiting |= reached[ray] & SOME_LEFTOVER ? 1u << ray : 0u;
            }
            EACH_RAY(ray) {
                const EyeRay eye_ray = sample_in_row(&group, row, ray, sample, grid);
                // In the first round of lights, a pixel begins as background or as a surface without light.
                if (!first_light) sum[ray] += leaf_index[ray] == NO_HIT ? (float4)(background.xyz, 0.0f) : dark;
                if (HAS_LIGHT(reached[ray], leaf_index[ray]))
                    shade_pixel(SHADE_ARGUMENTS &tree, surfaces, materials, eye, corner, step_x, step_y, eye_ray,
                                leaf_index[ray], lights_of_round, reached[ray] & ~SOME_LEFTOVER, &sum[ray]);
            }
        }
        EACH_RAY(ray) {
            const EyeRay first = sample_in_row(&group, row, ray, 0, grid);
            const uint at = (uint)(first.y >> SUBPIXEL_BITS) * (uint)image_size.x + (uint)(first.x >> SUBPIXEL_BITS);
            if (first.inside && !HAS(waiting, ray)) image[at] = AFTER_ROUND(image[at], sum[ray]);
        }
    }
}
