// Rays without a common origin: to points of a light with a radius, and to the sky. All of these rays are leftover
// shadow rays: a group casts them one at a time, and each lane tests one child of a node or one triangle of a leaf.

// The sources of light: the scene's lights and, after the last light, the sky. `light_count` is the number of the
// scene's lights, and `first_light` is the first light of the round (see shadow.cl). In functions, `light` is counted
// from the first light of the round, and `source` from the first light of the scene.
typedef struct {
    Soft soft;
    int light_count, first_light;
} Sources;
#define SOURCE_COUNT(light_count) ((light_count) + SKY)

// Returns whether the rays of a source have no common origin.
INLINED int goes_apart(const Sources *sources, int light) {
    const int source = sources->first_light + light;
    return source >= sources->light_count || radius_of(&sources->soft, source) > 0.0f;
}

// Returns whether something stops a ray before t_max.
INLINED int is_stopped(Group *group, const Tree *tree, Vec3 from, Vec3 way, float t_max, __local uint2 *stack) {
    // A shaft around this ray alone: its box of slopes is a point.
    Shaft shaft;
    aim(group, tree, origin_at(uniform3(from.x, from.y, from.z), 0), uniform3(way.x, way.y, way.z), &shaft);
    const float depth = fabs(component(way.x, way.y, way.z, shaft.along)), per_depth = reciprocal(depth);
    const float x = component(way.x, way.y, way.z, shaft.across) * per_depth;
    const float y = component(way.x, way.y, way.z, shaft.down) * per_depth;
    widen(&shaft, x, x, y, y);
    const float reach = t_max < FAR ? 1.00001f * t_max * depth : FAR;
    uint word = 0;
    int waiting = 0, going = 1, stopped = 0;
    while (going) {
        uint met = 0;
        if (!IS_LEAF(word)) {
            // Each lane tests one child. Any hit is enough, so children are not sorted.
            const Child child = meet_child(group, tree, &shaft, word, reach);
            met = lane_ballot(group, child.met);
            if (met) word = push(group, child, met, 0, stack, &waiting);
        } else {
            // Each lane tests one triangle; a single hit of any lane ends the search.
            const int own = LEAF_FIRST(word) + group->lane;
            const int hit = group->lane < LEAF_COUNT(word) &&
                            SOLID_ON_RAYS(&tree->masks, leaf_triangle(tree, own), leaf_corners(tree, own), from, way,
                                          is_stopped_by(leaf_corners(tree, own), from, way, t_max));
            stopped = lane_any(group, hit);
        }
        if (met) continue;
        going = waiting && !stopped;
        if (going) word = stack[--waiting].x;
    }
    lane_sync(group); // the stack has been read by all lanes
    return stopped;
}

// The ray from a hit to a point of a light or to the sky, as it was chosen for this sample of the pixel: its unit
// direction and its length.
typedef struct {
    Vec3 way;
    float distance;
    int is_sky;
} Sight;

// Returns the ray from a hit to a source.
INLINED Sight sight_of(const Sources *sources, int light, const __global float *at, const Meeting *meeting) {
    const Soft *soft = &sources->soft;
    const int source = sources->first_light + light;
    Sight sight;
    sight.is_sky = source >= sources->light_count;
#if SKY
    // A ray to the sky only has a direction; its length is the reach of the sky.
    if (sight.is_sky) {
        const Vec3 normal = normalize_or_zero(meeting->normal);
        sight.way = way_to_sky(soft, source, meeting->pixel.x, meeting->pixel.y, normal);
        sight.distance = reach_of_sky(soft);
        return sight;
    }
#endif
    // A ray to a light ends at a point of the light's ball.
    const Vec3 position = add(load_vec3(at), off_middle(soft, source, meeting->pixel.x, meeting->pixel.y));
    const Vec3 offset = subtract(position, meeting->point);
    sight.distance = sqrt(dot3(offset, offset));
    sight.way = scale(offset, 1.0f / sight.distance);
    return sight;
}

// Returns whether a source is visible from a pixel's hit.
INLINED int reaches(Group *group, const Tree *tree, const Sources *sources, int light, const __global float *at,
                    const Meeting *meeting, float bias, __local uint2 *stack) {
    const Sight sight = sight_of(sources, light, at, meeting);
    // A light that is nearer than the bias counts as hidden. The sky has no position, so only the direction of the ray
    // to it is tested.
    const int faces_it = (dot3(sight.way, meeting->normal) > 0.0f) & (sight.is_sky | (sight.distance > bias));
    return faces_it && !is_stopped(group, tree, along(meeting->point, bias, sight.way), sight.way, sight.distance - bias, stack);
}
