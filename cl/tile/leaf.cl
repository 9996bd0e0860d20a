// Leaves of a tile's walk.

#if ROUNDED_PLANES
#include "tile/planes.cl"
#else
#include "tile/sheared.cl"
#endif

// Those of `vectors` whose rays are all done.
uint vectors_done(const Bundle *bundle, uint vectors) {
    uint done = 0;
    for (; vectors; vectors &= vectors - 1) {
        const int vector = LOWEST_BIT(vectors);
        done |= ANY(bundle->nearness[vector] < FAR) ? 0 : 1u << vector;
    }
    return done;
}

// Tests a leaf's triangles with the live vectors. Returns those in which something changed; with `any`, those that are
// done.
uint test_leaf(Bundle *bundle, const SurfaceTree *tree, uint word, uint live, const int any) {
    const int first = LEAF_FIRST(word), end = first + LEAF_COUNT(word);
    uint changed = 0;
    for (int place = first; place < end; place++) {
        const uint now = test_triangle(bundle, &tree->tree, place, live, any);
        if (any) {
            const uint done = vectors_done(bundle, now);
            changed |= done;
            live &= ~done;
        } else {
            changed |= now;
            // What was hit will be shaded. Without a branch, which would be hard to foresee.
            const __global float4 *surface = tree->surfaces + 3 * (size_t)(now ? place : first);
            FETCH(surface), FETCH(surface + 2);
        }
    }
    return changed;
}
