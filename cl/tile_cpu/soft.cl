// Rays of a tile without a common origin: to points of a light with an extent, and to the sky. The 16 rays of a vector
// to points of a light traverse the tree together, as a packet. Rays to the sky are first tested against the boxes of
// the root's children. Those that meet a box traverse the tree one by one (single_ray.cl).

#include "cast/bvh_node.cl"

// The bounds of a packet. For each axis: the interval of the rays' origins (low, high), and the interval of the
// reciprocals of their directions (per_low, per_high). If rays run in both directions along an axis, the axis is mixed
// and excludes no box.
typedef struct {
    float low[3], high[3], per_low[3], per_high[3];
    int mixed[3], negative[3]; // negative: all rays run towards smaller coordinates
} PacketBounds;

// Computes the bounds of a packet's `rays` along one axis.
void bound_axis(varying origin, varying per_direction, Mask rays, int axis, PacketBounds *bounds) {
    // Lanes that are not in `rays` get values that widen no interval.
    bounds->low[axis] = least_lane(SELECT(rays, origin, (varying)(FAR)));
    bounds->high[axis] = most_lane(SELECT(rays, origin, (varying)(-FAR)));
    bounds->per_low[axis] = least_lane(SELECT(rays, per_direction, (varying)(FAR)));
    bounds->per_high[axis] = most_lane(SELECT(rays, per_direction, (varying)(-FAR)));
    bounds->negative[axis] = bounds->per_high[axis] < 0.0f;
    bounds->mixed[axis] = bounds->per_low[axis] < 0.0f && !bounds->negative[axis];
}

// Returns the children of a node that rays of the packet may enter before t = `reach`, one bit each.
uint packet_enters(const PacketBounds *bounds, const __global float *node, float reach) {
    Children entry = (Children)(0.0f), leave = (Children)(reach);
    for (int axis = 0; axis < 3; axis++) {
        if (bounds->mixed[axis]) continue;
        const int negative = bounds->negative[axis];
        // Along this axis, the rays' origins lie in an interval. Rays that start at the interval's end nearest to the
        // box enter the box first; rays that start at the opposite end leave the box last.
        const float first = negative ? bounds->low[axis] : bounds->high[axis];
        const float last = negative ? bounds->high[axis] : bounds->low[axis];
        const Children near = LOAD_CHILDREN(node + (2 * axis + negative) * NODE_WIDTH) - first;
        const Children far = LOAD_CHILDREN(node + (2 * axis + 1 - negative) * NODE_WIDTH) - last;
        entry = max(entry, min(near * bounds->per_low[axis], near * bounds->per_high[axis]));
        leave = min(leave, max(far * bounds->per_low[axis], far * bounds->per_high[axis]) * OUTWARDS);
    }
    return CHILD_BITS((entry <= leave) & (AS_WORDS(LOAD_CHILDREN(node + CHILD_ROW)) != UNUSED_CHILD));
}

// Returns the lanes of `wanted` whose ray is stopped by a triangle before t_max.
Mask are_stopped(const Tree *tree, Vec3 from, Vec3 direction, varying t_max, Mask wanted) {
    const BoxProbe probe = prepare_box_probe(from, direction);
    const float reach = most_lane(SELECT(wanted, t_max, (varying)(-1.0f)));
    PacketBounds bounds;
    bound_axis(from.x, probe.per_direction.x, wanted, 0, &bounds);
    bound_axis(from.y, probe.per_direction.y, wanted, 1, &bounds);
    bound_axis(from.z, probe.per_direction.z, wanted, 2, &bounds);
    uint stack[STACK_SIZE];
    Mask open = wanted;
    uint word = 0;
    int waiting = 0;
    for (;;) {
        if (IS_LEAF(word)) {
            // All rays of the packet are tested against each triangle. Rays that a triangle has stopped enter no more
            // boxes (see own_reach).
            const int first = LEAF_FIRST(word), end = first + LEAF_COUNT(word);
            for (int index = first; index < end; index++)
                open &= !SOLID_ON_RAYS(&tree->masks, leaf_triangle(tree, index), leaf_corners(tree, index), from,
                                       direction, is_stopped_by(leaf_corners(tree, index), from, direction, t_max));
            if (!ANY(open)) break;
        } else {
            const __global float *node = tree->nodes + NODE_STRIDE * (size_t)word;
            const varying own_reach = SELECT(open, t_max, (varying)(-1.0f));
            // First, the whole packet is tested against all children together. Then, the packet's single rays are
            // tested child by child. Any hit is enough, so children are not sorted.
            for (uint met = packet_enters(&bounds, node, reach); met; met &= met - 1) {
                const int child = LOWEST_BIT(met);
                varying entry;
                if (!ANY(enter_box(&probe, node + child, own_reach, &entry))) continue;
                stack[waiting] = as_uint(node[CHILD_ROW + child]);
                fetch_child(tree, stack[waiting++]);
            }
        }
        if (!waiting) break;
        word = stack[--waiting];
    }
    return wanted & !open;
}

// Whether all vectors of a tile use the same points of a light or of the sky. With soft light at half resolution, the
// points repeat every INTERLEAVED pixels, across and down, and a vector's 16 rays cover 4 x 4 pixels if pixels are not
// divided into sub-pixels.
#if HALF_LIGHT && BLOCK_X % INTERLEAVED == 0 && BLOCK_Y % INTERLEAVED == 0
#define VECTORS_SHARE_POINTS (SUBPIXEL_BITS == 0)
#else
#define VECTORS_SHARE_POINTS 0
#endif

// Adds to `sum` the radiance that a tile's hits reflect from a light with an extent. The array `sum` has one element
// per vector of rays. Each sample of a pixel has its own point of the light. In half pictures (of half the width and
// height), the points repeat every 4 pixels, across and down.
void add_soft_light(CAST_PARAMETERS const Bundle *bundle, const SurfaceTree *tree, const Lighting *lighting, int light,
                    int2 image_size, const Shaded *shaded, Vec3 *sum) {
    const __global float *at = lighting->lights + LIGHT_FLOATS * light;
    Vec3 position;
    int is_chosen = 0;
    for (int vector = 0; vector < VECTORS; vector++) {
        const Mask hits = bundle->leaf_index[vector] != NO_HIT;
        if (!ANY(hits)) continue;
        // Each lane's ray runs to a point of the light, chosen by the lane's pixel and sample.
        if (!is_chosen) {
            const Pixels pixels = tile_pixels(CAST_ARGUMENTS vector, image_size);
            position = add(splat(LOAD3(at)), off_middle(&lighting->soft, light, at, pixels.x, pixels.y));
            is_chosen = VECTORS_SHARE_POINTS;
        }
        const Shaded *own = shaded + vector;
        const Vec3 offset = subtract(position, own->point);
        const varying squared = dot3(offset, offset);
        const varying distance = sqrt(squared);
        const Vec3 to_light = scale(offset, 1.0f / distance);
        const varying cosine = dot3(to_light, own->normal);
        // A light that is behind the surface, or nearer to the hit than the bias, needs no ray.
        Mask lit = hits & (cosine > 0.0f) & (distance > lighting->bias);
#if AREA_LIGHTS
        const varying share = share_towards(at, to_light);
        lit &= share > 0.0f; // the back of an area light is dark
#else
        const float share = 1.0f;
#endif
        if (!ANY(lit)) continue;
        const Vec3 from = along(own->point, (varying)(lighting->bias), to_light);
        lit &= !are_stopped(&tree->tree, from, to_light, distance - lighting->bias, lit);
        const Vec3 f = reflectance(&own->surface, to_light, own->to_eye, own->normal, lit);
        // The power is divided first, as in cast/shade.cl: its product with f may be too large for single precision.
        const varying spread = share * cosine / (4.0f * M_PI_F * squared);
        const Vec3 received = multiply(scale(splat(LOAD3(at + 3)), spread), f);
        sum[vector] = select3(lit, add(sum[vector], received), sum[vector]);
    }
}

#if SKY
#include "tile_cpu/sky.cl"
#endif
