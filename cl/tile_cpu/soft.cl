// Rays of a tile without a common origin: to points of a light with a radius, and to the sky. Each vector of 16 rays
// traverses the tree separately, like a packet.

#include "cast/bvh_node.cl"

// Returns the lanes of `wanted` whose ray is stopped before t_max.
Mask are_stopped(const Tree *tree, Vec3 from, Vec3 way, varying t_max, Mask wanted) {
    const BoxProbe probe = prepare_box_probe(from, way);
    Waiting stack[STACK_SIZE];
    Mask open = wanted;
    uint word = 0;
    int waiting = 0;
    for (;;) {
        if (IS_LEAF(word)) {
            const int first = LEAF_FIRST(word), end = first + LEAF_COUNT(word);
            for (int place = first; place < end; place++)
                open &= !SOLID_ON_RAYS(&tree->masks, leaf_triangle(tree, place), leaf_corners(tree, place), from, way,
                                       is_stopped_by(leaf_corners(tree, place), from, way, t_max));
            if (!ANY(open)) break;
        } else {
            const __global float *node = tree->nodes + NODE_STRIDE * (size_t)word;
            waiting = push_met_children(&probe, node, SELECT(open, t_max, (varying)(-1.0f)), stack, waiting);
        }
        if (!waiting) break;
        word = stack[--waiting].word;
    }
    return wanted & !open;
}

// Adds the light of a source with a radius to the sums of a tile's vectors, from a different point of it for each
// pixel.
void add_soft_light(const Bundle *bundle, const SurfaceTree *tree, const Lighting *lighting, int light, int2 image_size,
                    const Shaded *shaded, Vec3 *sum) {
    const __global float *at = lighting->lights + LIGHT_FLOATS * light;
    for (int vector = 0; vector < VECTORS; vector++) {
        const Mask hits = bundle->place[vector] != NO_HIT;
        if (!ANY(hits)) continue;
        const Shaded *own = shaded + vector;
        const Pixels pixels = tile_pixels(vector, image_size);
        const Vec3 position = add(splat(LOAD3(at)), off_middle(&lighting->soft, light, pixels.x, pixels.y));
        const Vec3 offset = subtract(position, own->point);
        const varying squared = dot3(offset, offset);
        const varying distance = sqrt(squared);
        const Vec3 way = scale(offset, 1.0f / distance);
        const varying cosine = dot3(way, own->normal);
        Mask lit = hits & (cosine > 0.0f) & (distance > lighting->bias);
        if (!ANY(lit)) continue;
        const Vec3 from = along(own->point, (varying)(lighting->bias), way);
        lit &= !are_stopped(&tree->tree, from, way, distance - lighting->bias, lit);
        const Vec3 f = reflectance(&own->surface, way, own->to_eye, own->normal, lit);
        const Vec3 received = scale(multiply(splat(LOAD3(at + 3)), f), cosine / (4.0f * M_PI_F * squared));
        sum[vector] = select3(lit, add(sum[vector], received), sum[vector]);
    }
}

#if SKY
// Adds the light of the sky, from a direction whose probability is proportional to its cosine with the normal, so
// that k_L times its radiance arrives.
void add_sky(const Bundle *bundle, const SurfaceTree *tree, const Lighting *lighting, int2 image_size, const Shaded *shaded,
             Vec3 *sum) {
    const Soft *soft = &lighting->soft;
    const varying t_max = (varying)(reach_of_sky(soft) - lighting->bias);
    for (int vector = 0; vector < VECTORS; vector++) {
        const Mask hits = bundle->place[vector] != NO_HIT;
        if (!ANY(hits)) continue;
        const Shaded *own = shaded + vector;
        const Pixels pixels = tile_pixels(vector, image_size);
        const Vec3 way = way_to_sky(soft, lighting->light_count, pixels.x, pixels.y, own->normal);
        Mask lit = hits & (dot3(way, own->normal) > 0.0f);
        const Vec3 from = along(own->point, (varying)(lighting->bias), way);
        lit &= !are_stopped(&tree->tree, from, way, t_max, lit);
        const Vec3 received = multiply(own->surface.lambertian, radiance_of_sky(soft, way));
        sum[vector] = select3(lit, add(sum[vector], received), sum[vector]);
#if ENVIRONMENT
        const Vec3 mirrored = mirrored_sky(soft, lighting->light_count + 1, pixels.x, pixels.y, &own->surface, own->normal,
                                           own->to_eye);
        sum[vector] = select3(hits, add(sum[vector], mirrored), sum[vector]);
#endif
    }
}
#endif
