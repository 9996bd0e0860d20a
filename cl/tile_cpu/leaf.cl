// Tests the rays of a tile against the triangles of a leaf.

#if CUTOUTS
// Returns the lanes of `hits` whose ray hits the surface of a triangle and not a hole. `index` is the triangle's index
// in leaf order. With `any`, the rays start at a light. A point computed from a distant light has lost its last digits,
// so the point in the mask is computed from the other end of the ray, a hit that the light may reach.
Mask solid_in_tile(const Bundle *bundle, int vector, int index, Mask hits, const int any) {
    const Vec3 direction = vec3(bundle->x[vector], bundle->y[vector], bundle->z[vector]);
    return solid_on_rays(&bundle->tree->masks, leaf_triangle(bundle->tree, index), leaf_corners(bundle->tree, index),
                         any ? bundle->hit[vector] : splat(bundle->origin), direction, hits);
}
#define SOLID_IN_TILE(bundle, vector, index, hits, any) solid_in_tile(bundle, vector, index, hits, any)
#else
#define SOLID_IN_TILE(bundle, vector, index, hits, any) hits
#endif

#include "tile_cpu/intersect/{intersector}.cl"
#ifndef FEW_VECTORS
#error "FEW_VECTORS: up to so many vectors, a triangle is tested against rays without testing vectors_near first"
#endif

// Returns a bit for each vector of rays in `vectors` whose rays are all finished.
static uint vectors_done(const Bundle *bundle, uint vectors) {
    uint done = 0;
    for (; vectors; vectors &= vectors - 1) {
        const int vector = LOWEST_BIT(vectors);
        done |= ANY(bundle->inv_t[vector] < FAR) ? 0 : 1u << vector;
    }
    return done;
}

// Tests the prepared triangles whose bits are set in `worth` against the vectors of rays whose bits are set in `live`.
// With `many`, each triangle is tested against the vectors' intervals of directions first. Returns a bit for each
// vector, like test_prepared.
INLINED uint test_worth(Bundle *bundle, const SurfaceTree *tree, const Prepared *prepared, uint worth, int first,
                        uint live, const int any, const int many) {
    uint changed = 0;
    for (; worth; worth &= worth - 1) {
        const int lane = LOWEST_BIT(worth);
        const uint near = many ? vectors_near(bundle, prepared, lane, live) : live;
        const uint now = test_triangle(bundle, prepared, lane, first + lane, near, any);
        if (any) {
            // A vector of rays is removed from `live` when all its shadow rays are blocked.
            const uint done = vectors_done(bundle, now);
            changed |= done;
            live &= ~done;
        } else {
            changed |= now;
            // The hit's normals are prefetched for shading. The prefetch is not under a condition, since the processor
            // could not predict the branch.
            fetch_normals(&tree->normals, tree->tree.leaves, now ? first + lane : first);
        }
    }
    return changed;
}

// Does the same as test_worth with `many`. The function is not inlined, so that its code takes no registers from the
// inlined loop over few vectors of rays.
__attribute__((noinline)) uint test_with_many(Bundle *bundle, const SurfaceTree *tree, const Prepared *prepared,
                                              uint worth, int first, uint live, const int any) {
    return test_worth(bundle, tree, prepared, worth, first, live, any, 1);
}

// Tests up to PREPARED of a leaf's triangles against the vectors of rays in `live`. Returns one bit for each vector.
// Without `any`, a bit is 1 if one of the vector's rays hit a triangle; with `any`, it is 1 if the triangles have
// blocked the vector's last unfinished rays.
uint test_prepared(Bundle *bundle, const SurfaceTree *tree, int first, int count, uint live, const int any) {
    Prepared prepared;
    // At the end of a leaf, `count` may be less than PREPARED. Bits from `count` on belong to triangles of other
    // leaves, or to the padding after the last leaf.
    const uint worth = prepare_triangles(bundle, &tree->tree, first, any, &prepared) & ((1u << count) - 1);
    return popcount(live) > FEW_VECTORS ? test_with_many(bundle, tree, &prepared, worth, first, live, any)
                                        : test_worth(bundle, tree, &prepared, worth, first, live, any, 0);
}

// Tests all of a leaf's triangles against the vectors of rays in `live`. Returns a bit for each vector, like
// test_prepared.
static uint test_leaf(Bundle *bundle, const SurfaceTree *tree, uint word, uint live, const int any) {
    const int end = LEAF_FIRST(word) + LEAF_COUNT(word);
    uint changed = 0;
    // The loop prepares PREPARED triangles at a time. Each triangle is tested against all vectors in `live` while its
    // prepared numbers are in registers.
    for (int first = LEAF_FIRST(word); first < end; first += PREPARED) {
        const uint now = test_prepared(bundle, tree, first, min(PREPARED, end - first), live, any);
        changed |= now;
        if (any) live &= ~now;
    }
    return changed;
}
