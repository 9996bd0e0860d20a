// The rays from a light to a tile's hits.

// The direction from hits to a light. (Inlined functions write a structure to a pointer. If they returned the
// structure, LLVM would insert an instruction that the simulator Oclgrind lacks.)
typedef struct {
    Vec3 to_light;                  // the unit vector towards the light
    varying distance, per_distance; // the light's distance and its reciprocal
    varying cosine;                 // of the angle between to_light and the normal
#if AREA_LIGHTS
    varying share;                  // share_towards: the light's brightness in the direction from light to hit
#endif
} LightDirection;

INLINED void find_light_direction(const Lighting *lighting, int light, const Shaded *shaded,
                                  LightDirection *direction) {
    const Vec3 offset = subtract(splat(LOAD3(lighting->lights + LIGHT_FLOATS * light)), shaded->point);
    direction->distance = sqrt(dot3(offset, offset));
    direction->per_distance = 1.0f / direction->distance;
    direction->to_light = scale(offset, direction->per_distance);
    direction->cosine = dot3(direction->to_light, shaded->normal);
#if AREA_LIGHTS
    direction->share = share_towards(lighting->lights + LIGHT_FLOATS * light, direction->to_light);
#endif
}

// Computes the radiance that the hits in `lit` reflect to the eye if nothing blocks the light.
INLINED void find_unblocked_radiance(const Lighting *lighting, int light, const Shaded *shaded,
                                     const LightDirection *direction, Mask lit, Vec3 *radiance) {
    const Vec3 f = reflectance(&shaded->surface, direction->to_light, shaded->to_eye, shaded->normal, lit);
    const Vec3 power = splat(LOAD3(lighting->lights + LIGHT_FLOATS * light + 3));
    // The radiance is power / (4 pi r^2) times the cosine times f. The power is divided first, as in cast/shade.cl: its
    // product with f may be too large for single precision.
    const varying per_distance = direction->per_distance;
    varying spread = direction->cosine * (per_distance * per_distance * (0.25f * M_1_PI_F));
#if AREA_LIGHTS
    spread *= direction->share;
#endif
    *radiance = multiply(scale(power, spread), f);
}

#if SAMPLED // the host leaves out an include only if the condition is one of its defines (src/program/include.rs)
#if SHADES_ONCE
#include "tile_cpu/shade_once.cl"
#include "tile_cpu/light_once.cl"
#endif
#endif

// Computes the rays from a light to the hits of a vector of rays, the interval of their directions, and (in `arriving`)
// the radiance that the hits reflect to the eye if nothing blocks the light. Returns the lanes that the light can
// reach.
Mask light_vector(Bundle *bundle, Slices *slices, const Lighting *lighting, int light, int vector, const Shaded *shaded,
                  Mask hits, Vec3 *arriving) {
    LightDirection direction;
    find_light_direction(lighting, light, shaded, &direction);
    // A light that is behind the surface, or nearer to the hit than the bias, contributes nothing.
    Mask lit = hits & (direction.cosine > 0.0f) & (direction.distance > lighting->bias);
#if AREA_LIGHTS
    lit &= direction.share > 0.0f; // the back of an area light is dark
#endif
    if (!ANY(lit)) return lit;
    find_unblocked_radiance(lighting, light, shaded, &direction, lit, arriving);
    // The shadow ray starts at the light, so that all rays of the tile have a common origin again. All directions have
    // length 1. Bounds of rounding errors are proportional to the length of the tile's longest direction. If a
    // direction were as long as the way from the light to the hit, one distant hit would make these bounds far too
    // large for hits near the light.
    bundle->x[vector] = -direction.to_light.x;
    bundle->y[vector] = -direction.to_light.y;
    bundle->z[vector] = -direction.to_light.z;
#if CUTOUTS
    bundle->hit[vector] = shaded->point;
#endif
    // On the ray, the hit is at t = direction.distance. The ray ends shortly before the hit: at (1 - gap) times this t.
    const varying gap = gap_before_hit(lighting->bias * direction.per_distance, 1.0f / direction.cosine);
    bundle->inv_t[vector] = SELECT(lit, direction.per_distance / (1.0f - gap), (varying)(FAR));
    ((float *)slices->reach)[vector] = most_lane(SELECT(lit, direction.distance, (varying)(0.0f)));
    const varying *components[3] = {bundle->x, bundle->y, bundle->z};
    for (int axis = 0; axis < 3; axis++) {
        const varying component = components[axis][vector];
        // `slices` has one lane per vector of rays. The lane `vector` gets the interval of this vector's directions.
        ((float *)slices->low[axis])[vector] = least_lane(SELECT(lit, component, (varying)(FAR)));
        ((float *)slices->high[axis])[vector] = most_lane(SELECT(lit, component, (varying)(-FAR)));
    }
    prepare_rays(bundle, vector, lit);
    return lit;
}

// Prepares the tile's rays from a light: they start at the light, and no vector of rays has a ray yet.
static void begin_light_rays(Bundle *bundle, Slices *slices, const Lighting *lighting, int light) {
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
}

// Computes the rays from a light to the hits of the vectors in `hit`. In programs without soft and emitted light, the
// hits are computed together with the first light's rays, and stored for the other lights. Returns the vectors with at
// least one ray, one bit each.
static uint make_light_rays(Bundle *bundle, Slices *slices, const SurfaceTree *tree, const Lighting *lighting, int light,
                     float4 eye, uint hit, Shaded *shaded, Vec3 *arriving) {
    uint open = 0;
    for (uint left = hit; left; left &= left - 1) {
        const int vector = LOWEST_BIT(left);
        const Mask hits = bundle->leaf_index[vector] != NO_HIT;
#if SOFT || EMISSIVE
        const Shaded *surface = shaded + vector; // computed by shade_tile, before all lights
#else
        Shaded *surface = shaded + (lighting->light_count > 1 ? vector : 0); // with a single light, hits are not stored
        if (light == 0) find_hits_of_vector(tree, lighting, eye, bundle, vector, hits, surface);
#endif
        const Mask lit = light_vector(bundle, slices, lighting, light, vector, surface, hits, arriving + vector);
        open |= ANY(lit) ? 1u << vector : 0;
    }
    return open;
}

// Finds the vectors of rays in `open` that are scattered: their hits lie far apart. This function is called after all
// rays from a light have been made.
void find_scattered(CAST_PARAMETERS Bundle *bundle, const Slices *slices, CAMERA_PARAMETERS, uint open) {
    const Uniform3 eye_to_light = uniform_difference(bundle->origin, uniform3(eye.x, eye.y, eye.z));
    const float block_side = (BLOCK_X >> SUBPIXEL_BITS) * pixel_side(step_x, step_y);
    set_scattered(bundle, open & scattered_vectors(slices, eye_to_light, block_side));
}
