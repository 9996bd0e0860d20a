// The kernels of a frame cast in tiles that groups own: the nearest hits, their shading, and the shadow rays that were
// left over. tile_group.cl walks the tree for all of them.

// Shadow rays of a tile are cast in at most so many passes, each of rays close to each other, and with so many words from
// the stack for one light. Past silhouettes that is never enough: what is left over has a group to each ray.
#define SHADOW_PASSES 4
#define SHADOW_BUDGET 48
// A word tells the lights that a ray's shadow rays were left over for; further ones are cast to the end.
#define LIGHTS_OF_WORD 32

// A group with its stack, and with the triangles of a leaf that its rays have to test.
#define STACK_LOCALS                            \
    GROUP_LOCALS                                 \
    __local uint2 stacks[LOCAL_Y][STACK_SIZE]; \
    Group group;                                 \
    BIND_GROUP(group)                            \
    __local uint2 *stack = stacks[group.number];
#define LEAF_LOCALS                                             \
    __local float4 leaf_quads[LOCAL_Y][3 * GROUP_LANES]; \
    __local float4 *candidates = leaf_quads[group.number];

typedef struct {
    int x, y, inside;
} Pixel;

// The pixel of a lane's ray: a tile is blocks of 8 x 4 pixels.
INLINED Pixel tile_pixel(const Group *group, int ray, int2 image_size) {
    const int across = TILE_X / 8, lane = forgotten(group->lane);
    Pixel pixel;
    pixel.x = (int)get_group_id(0) * TILE_X + ray % across * 8 + lane % 8;
    pixel.y = ((int)get_group_id(1) * LOCAL_Y + group->number) * TILE_Y + ray / across * 4 + lane / 8;
    pixel.inside = (pixel.x < image_size.x) & (pixel.y < image_size.y);
    return pixel;
}

INLINED size_t index_of(Pixel pixel, int2 image_size) { return (size_t)pixel.y * image_size.x + pixel.x; }

// The tile's rays from the eye. Returns those inside the image.
INLINED uint camera_ways(const Group *group, CAMERA_PARAMETERS, int2 image_size, Ways *ways) {
    uint inside = 0;
    EACH_RAY(ray) {
        const Pixel pixel = tile_pixel(group, ray, image_size);
        const float x = pixel.x + 0.5f, y = pixel.y + 0.5f;
        ways->x[ray] = corner.x + x * step_x.x + y * step_y.x;
        ways->y[ray] = corner.y + x * step_x.y + y * step_y.y;
        ways->z[ray] = corner.z + x * step_x.z + y * step_y.z;
        inside |= pixel.inside ? 1u << ray : 0u;
    }
    ways->per_begin = eye.w > 0.0f ? 1.0f / eye.w : FAR;
    ways->per_end = 0.0f;
    return inside;
}

// The place in leaf order of every pixel's nearest triangle, or NO_HIT.
__kernel GROUP_SHAPE GROUP_ATTRIBUTE void tile_primary(TILE_PARAMETERS, CAMERA_PARAMETERS, const int2 image_size,
                                                       __global int *restrict nearest) {
    STACK_LOCALS
    LEAF_LOCALS
    Tree tree;
    tree.nodes = nodes;
    tree.leaves = leaves;
    const Uniform3 origin = uniform3(eye.x, eye.y, eye.z);
    uint done = 0;
    int unlimited = 0;
    Beam beam;
    EACH_RAY(ray) beam.place[ray] = NO_HIT;
    for (;;) { // once, unless the tile is so wide that its rays run along several axes
        Ways ways;
        Shaft shaft;
        const uint todo = camera_ways(&group, eye, corner, step_x, step_y, image_size, &ways) & ~done;
        if (!lane_any(&group, todo != 0)) break;
        const uint active = begin_pass(&group, origin, &ways, todo, 0, &shaft, &beam);
        if (!lane_any(&group, active != 0)) break;
        walk(&group, &tree, &shaft, &beam, 0, &unlimited, stack, candidates);
        done |= active;
    }
    EACH_RAY(ray) {
        const Pixel pixel = tile_pixel(&group, ray, image_size);
        if (pixel.inside) nearest[index_of(pixel, image_size)] = beam.place[ray];
    }
}

INLINED Vec3 load_vec3(const __global float *at) { return vec3(at[0], at[1], at[2]); }

// What a light sends to a hit if nothing is in between, and the ray from the light to it.
typedef struct {
    int lit;
    Vec3 radiance;
    Vec3 way; // from the light to where the shadow ray ends, a bias before the hit
} Arrival;

INLINED void load_material(const __global float *material, Surface *surface) {
    surface->lambertian = load_vec3(material);
    surface->glossy = load_vec3(material + 3);
    surface->shininess = material[6];
    surface->kind = material[7];
}

INLINED Arrival arrive(const Tree *tree, const __global float4 *surfaces, const __global float *materials, Ray ray, int place,
               const __global float *light, float bias) {
    const __global float4 *corners = (const __global float4 *)tree->leaves + 3 * (size_t)place;
    const __global float4 *normals = surfaces + 3 * (size_t)place;
    const float4 a = corners[0], b = corners[1], c = corners[2];
    const float4 na = normals[0], nb = normals[1], nc = normals[2];
    const Vec3 v0 = vec3(a.x, a.y, a.z);
    const Vec3 e1 = subtract(vec3(b.x, b.y, b.z), v0), e2 = subtract(vec3(c.x, c.y, c.z), v0);
    const Hit hit = meet_plane(v0, e1, e2, ray.origin, ray.direction);
    const Vec3 point = along(ray.origin, hit.t, ray.direction);
    const Vec3 n0 = vec3(na.x, na.y, na.z), n1 = vec3(nb.x, nb.y, nb.z), n2 = vec3(nc.x, nc.y, nc.z);
    const Vec3 normal = normalize_or_zero(along(along(scale(n0, 1.0f - hit.w1 - hit.w2), hit.w1, n1), hit.w2, n2));
    const Vec3 offset = subtract(load_vec3(light), point);
    const float squared = dot3(offset, offset), distance = sqrt(squared);
    const Vec3 to_light = scale(offset, 1.0f / distance);
    const float cosine = dot3(to_light, normal);
    Arrival arrival;
    arrival.lit = (cosine > 0.0f) & (distance > bias);
    arrival.way = scale(offset, bias / distance - 1.0f);
    Surface surface;
    load_material(materials + 8 * as_int(b.w), &surface);
    const Vec3 f = reflectance(&surface, to_light, negate(ray.direction), normal, arrival.lit);
    arrival.radiance = scale(multiply(load_vec3(light + 3), f), cosine / (4.0f * M_PI_F * squared));
    return arrival;
}

// Casts a tile's shadow rays from a light. Returns those that nothing blocks; `*left` are those not known of.
INLINED uint unblocked(const Group *group, const Tree *tree, Uniform3 light, const Ways *ways, const uint lit,
               const int may_leave, __local uint2 *stack, __local float4 *candidates, uint *left) {
    uint todo = lit, blocked = 0;
    int budget = may_leave ? SHADOW_BUDGET : INT_MAX;
    *left = 0;
    for (int pass = 0; lane_any(group, todo != 0); pass++) {
        if (may_leave && (pass == SHADOW_PASSES || budget <= 0)) break;
        Shaft shaft;
        Beam beam;
        const uint active = begin_pass(group, light, ways, todo, 1, &shaft, &beam);
        if (!lane_any(group, active != 0)) break;
        const int enough = walk(group, tree, &shaft, &beam, 1, &budget, stack, candidates);
        EACH_RAY(ray) {
            const int done = beam.nearest[ray] >= FAR;
            blocked |= HAS(active, ray) && done ? 1u << ray : 0u;
            *left |= HAS(active, ray) && !done && !enough ? 1u << ray : 0u;
        }
        todo &= ~active;
    }
    *left |= todo;
    return lit & ~blocked & ~*left;
}

// Adds this lane's pixel to the queue, if it has lights left over; the group asks for room together.
INLINED void leave(const Group *group, Pixel pixel, int2 image_size, uint lights, __global uint2 *queue, __global int *queued) {
    const uint leaving = lane_ballot(group, lights != 0);
    int first = 0;
    if (leaving && group->lane == 0) first = atomic_add(queued, (int)popcount(leaving));
    first = (int)lane_get(group, (uint)first, 0);
    if (lights) queue[first + (int)BITS_BEFORE(group, leaving)] = (uint2)((uint)index_of(pixel, image_size), lights);
}

INLINED Ray pixel_ray(CAMERA_PARAMETERS, Pixel pixel) {
    Pixels one;
    one.x = pixel.x;
    one.y = pixel.y;
    one.inside = pixel.inside;
    return camera_ray(eye, corner, step_x, step_y, one);
}

// What a light sends to the tile's hits if nothing is in between, and the rays to them. Returns those that it lights.
INLINED uint light_ways(const Group *group, const Tree *tree, const __global float4 *surfaces,
                        const __global float *materials, CAMERA_PARAMETERS, int2 image_size,
                        const __global int *nearest, const __global float *light, float bias, Ways *ways,
                        Vec3 *arriving, uint *hits) {
    uint lit = 0;
    *hits = 0;
    ways->per_begin = FAR;
    ways->per_end = 1.0f;
    EACH_RAY(ray) {
        ways->x[ray] = ways->y[ray] = ways->z[ray] = 0.0f;
        arriving[ray] = vec3(0.0f, 0.0f, 0.0f);
        const Pixel pixel = tile_pixel(group, ray, image_size);
        const int place = pixel.inside ? nearest[index_of(pixel, image_size)] : NO_HIT;
        if (place == NO_HIT) continue;
        *hits |= 1u << ray;
        const Ray from_eye = pixel_ray(eye, corner, step_x, step_y, pixel);
        const Arrival arrival = arrive(tree, surfaces, materials, from_eye, place, light, bias);
        lit |= arrival.lit ? 1u << ray : 0u;
        ways->x[ray] = arrival.way.x, ways->y[ray] = arrival.way.y, ways->z[ray] = arrival.way.z;
        arriving[ray] = arrival.radiance;
    }
    return lit;
}

// A pixel that no light reaches.
INLINED float4 unlit(int hit, float4 background) {
    return hit ? (float4)(0.0f, 0.0f, 0.0f, 1.0f) : (float4)(background.xyz, 0.0f);
}

// Shades a tile's nearest hits: for each light, what arrives at them if nothing is in between, and a walk from the light
// to find where something is. The image itself holds the sum over lights, so that registers need not.
__kernel GROUP_SHAPE GROUP_ATTRIBUTE void tile_shade(TILE_PARAMETERS, CAMERA_PARAMETERS, const int2 image_size,
                                                     const float4 background, __global float4 *restrict image,
                                                     const __global int *restrict nearest,
                                                     __global uint2 *restrict queue, __global int *restrict queued) {
    STACK_LOCALS
    LEAF_LOCALS
    Tree tree;
    tree.nodes = nodes;
    tree.leaves = leaves;
    uint left_over[RAYS];
    EACH_RAY(ray) left_over[ray] = 0;
    for (int light = 0; light < light_count; light++) {
        const __global float *at = lights + 6 * light;
        Ways ways;
        Vec3 arriving[RAYS];
        uint hits, left;
        const uint lit = light_ways(&group, &tree, surfaces, materials, eye, corner, step_x, step_y, image_size,
                                    nearest, at, bias, &ways, arriving, &hits);
        const uint clear =
            unblocked(&group, &tree, LOAD3(at), &ways, lit, light < LIGHTS_OF_WORD, stack, candidates, &left);
        EACH_RAY(ray) {
            left_over[ray] |= HAS(left, ray) << (light % LIGHTS_OF_WORD);
            const Pixel pixel = tile_pixel(&group, ray, image_size);
            const Vec3 sent = arriving[ray];
            const float4 received = HAS(clear, ray) ? (float4)(sent.x, sent.y, sent.z, 0.0f) : (float4)(0.0f);
            __global float4 *own = image + index_of(pixel, image_size);
            if (pixel.inside && light == 0) *own = unlit(HAS(hits, ray), background) + received;
            else if (pixel.inside && HAS(clear, ray)) *own += received;
        }
    }
    EACH_RAY(ray) {
        const Pixel pixel = tile_pixel(&group, ray, image_size);
        const size_t at = index_of(pixel, image_size);
        if (pixel.inside && light_count == 0) image[at] = unlit(nearest[at] != NO_HIT, background);
    }
    for (int ray = 0; ray < RAYS; ray++)
        leave(&group, tile_pixel(&group, ray, image_size), image_size, left_over[ray], queue, queued);
}

// Casts the shadow rays that were left over, a group to each, and adds what they find to the image. A pixel is in the
// queue once, with a bit for each of its lights.
__kernel GROUP_SHAPE GROUP_ATTRIBUTE void tile_left_over(TILE_PARAMETERS, CAMERA_PARAMETERS, const int2 image_size,
                                                         __global float4 *restrict image,
                                                         const __global int *restrict nearest,
                                                         const __global uint2 *restrict queue,
                                                         const __global int *restrict queued) {
    STACK_LOCALS
    Tree tree;
    tree.nodes = nodes;
    tree.leaves = leaves;
    const int groups = (int)get_num_groups(0) * LOCAL_Y, count = *queued;
    for (int i = (int)get_group_id(0) * LOCAL_Y + group.number; i < count; i += groups) {
        const uint2 entry = queue[i];
        Pixel pixel;
        pixel.x = (int)entry.x % image_size.x;
        pixel.y = (int)entry.x / image_size.x;
        pixel.inside = 1;
        const Ray from_eye = pixel_ray(eye, corner, step_x, step_y, pixel);
        Vec3 sum = vec3(0.0f, 0.0f, 0.0f);
        for (uint left = entry.y; left; left &= left - 1) {
            const __global float *at = lights + 6 * LOWEST_BIT(left);
            const Arrival arrival = arrive(&tree, surfaces, materials, from_eye, nearest[entry.x], at, bias);
            const Uniform3 way = uniform3(arrival.way.x, arrival.way.y, arrival.way.z);
            Shaft shaft;
            aim(LOAD3(at), way, &shaft);
            const float per_depth = 1.0f / fabs(component(way.x, way.y, way.z, shaft.along));
            const float x = component(way.x, way.y, way.z, shaft.across) * per_depth;
            const float y = component(way.x, way.y, way.z, shaft.down) * per_depth;
            widen(&shaft, x, x, y, y);
            if (!is_blocked(&group, &tree, &shaft, x, y, per_depth, stack))
                sum = add(sum, arrival.radiance);
        }
        if (group.lane == 0) image[entry.x] += (float4)(sum.x, sum.y, sum.z, 0.0f);
    }
}
