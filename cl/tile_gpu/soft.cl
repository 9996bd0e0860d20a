// Rays without a common origin: to points of a light with a radius or edges, and to the sky. No tile casts these rays.
// They are leftover shadow rays, which a group of 32 lanes casts one at a time. Each lane of the group tests the ray
// against one child of a node, or one triangle of a leaf.

// The sources of light: the scene's lights and, after the last light, the sky. `light_count` is the number of the
// scene's lights, and `first_light` is the first light of the round of lights (see shadow.cl). In this file, `light` is
// a source's number in the round, and `source` its number in the scene.
typedef struct {
    Soft soft;
    int light_count, first_light;
} Sources;
#define SOURCE_COUNT(light_count) ((light_count) + SKY)

// Returns 1 if the rays of a source (a light or the sky) have no common origin, else 0.
INLINED int lacks_common_origin(const Sources *sources, int light) {
    const int source = sources->first_light + light;
    return source >= sources->light_count || radius_of(&sources->soft, source) > 0.0f;
}

// Returns 1 if something stops a ray before t_max, else 0.
INLINED int is_stopped(Group *group, const Tree *tree, Vec3 from, Vec3 direction, float t_max, __local uint2 *stack) {
    // The shaft (a volume around rays) contains only this ray, so the box around its rays' slopes is a point.
    Shaft shaft;
    aim(group, tree, origin_at(uniform3(from.x, from.y, from.z), 0), uniform3(direction.x, direction.y, direction.z),
        &shaft);
    const float depth = fabs(component(direction.x, direction.y, direction.z, shaft.along));
    const float per_depth = reciprocal(depth);
    const float x = component(direction.x, direction.y, direction.z, shaft.across) * per_depth;
    const float y = component(direction.x, direction.y, direction.z, shaft.down) * per_depth;
    widen(&shaft, x, x, y, y);
    const float reach = t_max < FAR ? 1.00001f * t_max * depth : FAR;
    uint word = 0;
    int waiting = 0, going = 1, stopped = 0;
    while (going) {
        uint met = 0;
        if (!IS_LEAF(word)) {
            // Each lane tests one child. Any hit is enough, so children are not sorted.
            const Child child = test_child(group, tree, &shaft, word, reach);
            met = lane_ballot(group, child.met);
            if (met) word = push(group, child, met, 0, stack, &waiting);
        } else {
            // Each lane tests one triangle; a single hit of any lane ends the search.
            const int own = LEAF_FIRST(word) + group->lane;
            const int hit = group->lane < LEAF_COUNT(word) &&
                            SOLID_ON_RAYS(&tree->masks, leaf_triangle(tree, own), leaf_corners(tree, own), from,
                                          direction, is_stopped_by(leaf_corners(tree, own), from, direction, t_max));
            stopped = lane_any(group, hit);
        }
        if (met) continue;
        going = waiting && !stopped;
        if (going) word = stack[--waiting].x;
    }
    lane_sync(group); // the stack has been read by all lanes
    return stopped;
}

// The shadow ray of a pixel's sample: its unit direction and its length. The ray runs from the hit to a point of a
// light, or to the sky.
typedef struct {
    Vec3 direction;
    float distance;
    int is_sky;
} Sight;

// Returns the ray from a hit to a source (a light or the sky).
INLINED Sight sight_of(const Sources *sources, int light, const __global float *at, const SurfacePoint *surface_point) {
    const Soft *soft = &sources->soft;
    const int source = sources->first_light + light;
    Sight sight;
    sight.is_sky = source >= sources->light_count;
#if SKY
    // A ray to the sky ends at the sky's reach, the distance up to which surfaces block the sky.
    if (sight.is_sky) {
        const Vec3 normal = normalize_or_zero(surface_point->normal);
        sight.direction = direction_to_sky(
            point_of_sphere(soft, source, surface_point->pixel.x, surface_point->pixel.y), normal);
        sight.distance = reach_of_sky(soft);
        return sight;
    }
#endif
    // A ray to a light ends at a point of the light's ball or surface.
    const Vec3 off = off_middle(soft, source, at, surface_point->pixel.x, surface_point->pixel.y);
    const Vec3 position = add(load_vec3(at), off);
    const Vec3 offset = subtract(position, surface_point->point);
    sight.distance = sqrt(dot3(offset, offset));
    sight.direction = scale(offset, 1.0f / sight.distance);
    return sight;
}

// Returns 1 if a source (a light or the sky) is visible from a pixel's hit, else 0.
INLINED int reaches(Group *group, const Tree *tree, const Sources *sources, int light, const __global float *at,
                    const SurfacePoint *surface_point, float bias, __local uint2 *stack) {
    const Sight sight = sight_of(sources, light, at, surface_point);
    // A light that is nearer than the bias counts as hidden. The sky has no position, so only the direction of its ray
    // is tested.
    int faces_it = (dot3(sight.direction, surface_point->normal) > 0.0f) & (sight.is_sky | (sight.distance > bias));
#if AREA_LIGHTS
    // The sky is not a light, so the array of lights contains no numbers for the sky.
    if (!sight.is_sky) faces_it &= share_towards(at, sight.direction) > 0.0f; // the back of an area light is dark
#endif
    return faces_it && !is_stopped(group, tree, along(surface_point->point, bias, sight.direction), sight.direction,
                                   sight.distance - bias, stack);
}
