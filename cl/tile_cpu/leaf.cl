// Leaves of a tile's walk.

#include "tile_cpu/intersect/{intersector}.cl"

// Those of `vectors` whose rays are all done.
uint vectors_done(const Bundle *bundle, uint vectors) {
    uint done = 0;
    for (; vectors; vectors &= vectors - 1) {
        const int vector = LOWEST_BIT(vectors);
        done |= ANY(bundle->inv_t[vector] < FAR) ? 0 : 1u << vector;
    }
    return done;
}

// Tests up to PREPARED of a leaf's triangles with the live vectors. Returns those in which something changed; with
// `any`, those that are done.
uint test_prepared(Bundle *bundle, const SurfaceTree *tree, int first, int count, uint live, const int any) {
    Prepared prepared;
    // The last of a leaf's eights may be partial: bits past `count` are other leaves' triangles.
    uint worth = prepare_triangles(bundle, &tree->tree, first, any, &prepared) & ((1u << count) - 1);
    uint changed = 0;
    for (; worth; worth &= worth - 1) {
        const int lane = LOWEST_BIT(worth);
        const uint now = test_triangle(bundle, &prepared, lane, first + lane, live, any);
        if (any) {
            // A vector leaves when all its shadow rays are blocked.
            const uint done = vectors_done(bundle, now);
            changed |= done;
            live &= ~done;
        } else {
            changed |= now;
            // The nearest hit will be shaded, and its normals are fetched ahead. No branch: the processor could not predict it.
            const __global float4 *surface = tree->surfaces + 3 * (size_t)(now ? first + lane : first);
            FETCH(surface), FETCH(surface + 2);
        }
    }
    return changed;
}

// The same for a whole leaf.
uint test_leaf(Bundle *bundle, const SurfaceTree *tree, uint word, uint live, const int any) {
    const int end = LEAF_FIRST(word) + LEAF_COUNT(word);
    uint changed = 0;
    // PREPARED triangles at a time, each tested by all live vectors while its planes are in registers.
    for (int first = LEAF_FIRST(word); first < end; first += PREPARED) {
        const uint now = test_prepared(bundle, tree, first, min(PREPARED, end - first), live, any);
        changed |= now;
        if (any) live &= ~now;
    }
    return changed;
}
