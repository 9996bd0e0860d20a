// Scattered vectors are vectors of shadow rays whose hits lie far apart, as at the edge between two surfaces. The
// directions of a scattered vector's rays differ so much that bounds of the directions exclude few boxes, so each ray
// is tested against the boxes.

// The hits of a vector are far apart if, seen from the light, they spread over more than SCATTERED widths of the
// vector's block of pixels. (The width of the block is measured at the hits' distance from the eye.)
#define SCATTERED 8.0f

// Returns the approximate width of a pixel at a depth of 1: the largest component of the steps between pixels.
static float pixel_side(float4 step_x, float4 step_y) {
    const float4 longer = max(fabs(step_x), fabs(step_y));
    return max(max(longer.x, longer.y), longer.z);
}

// Returns the vectors of rays whose hits lie far apart, one bit each. `directions` contains the intervals of the
// directions (of length 1 or less) from a light to the hits, and bounds of the distances between light and hits.
// `block_side` is the width of a vector's block of pixels at a depth of 1.
static uint scattered_vectors(const Slices *directions, Uniform3 eye_to_light, float block_side) {
    const float offset[3] = {eye_to_light.x, eye_to_light.y, eye_to_light.z};
    uint scattered = 0;
    for (int part = 0; part < PARTS; part++) {
        // `distance_squared` is the squared distance from the eye to about the middle of the hits of a vector of rays.
        float16 apart = (float16)(0.0f), distance_squared = (float16)(0.0f);
        const float16 reach = directions->reach[part];
        for (int axis = 0; axis < 3; axis++) {
            const float16 low = directions->low[axis][part], high = directions->high[axis][part];
            const float16 away = offset[axis] + 0.5f * (low + high) * reach;
            apart = max(apart, (high - low) * reach);
            distance_squared += away * away;
        }
        // Squares are compared, to avoid a square root. A vector is scattered if `apart` > SCATTERED * (width of the
        // block at the hits' distance from the eye).
        const float most = SCATTERED * block_side;
        scattered |= LANE_BITS16(apart * apart > most * most * distance_squared) << (16 * part);
    }
    return scattered;
}

// Returns the reciprocal of a direction's component. A component that is nearly zero is replaced by NO_DIRECTION, so
// that the reciprocal is finite.
static varying reciprocal(varying component) {
    return 1.0f / SELECT(fabs(component) < NO_DIRECTION, (varying)(NO_DIRECTION), component);
}

// Stores the set of vectors of rays whose hits lie far apart and, for rays_enter, the reciprocals of their directions.
static void set_scattered(Bundle *bundle, uint vectors) {
    bundle->scattered = vectors;
    for (; vectors; vectors &= vectors - 1) {
        const int vector = LOWEST_BIT(vectors);
        bundle->per[0][vector] = reciprocal(bundle->x[vector]);
        bundle->per[1][vector] = reciprocal(bundle->y[vector]);
        bundle->per[2][vector] = reciprocal(bundle->z[vector]);
    }
}

// Tests the rays of scattered vectors against a child's box. `vectors` has a bit for each of these vectors. In the
// result, a vector's bit is set if at least one of the vector's unfinished rays enters the box before the ray's end.
static uint rays_enter(const Bundle *bundle, const Boxes *boxes, int child, uint vectors) {
    uint met = 0;
    for (; vectors; vectors &= vectors - 1) {
        const int vector = LOWEST_BIT(vectors);
        varying entry = (varying)(0.0f), leave = (varying)(FAR);
        for (int axis = 0; axis < 3; axis++) {
            // This is the slab test (Kay and Kajiya 1986) of sixteen rays against one box.
            const varying per = bundle->per[axis][vector];
            const varying a = boxes->near[axis][child] * per, b = boxes->far[axis][child] * per;
            entry = max(entry, min(a, b));
            leave = min(leave, max(a, b));
        }
        // The ray ends at t = 1 / inv_t. In lanes of finished rays, inv_t is FAR; finished rays enter no box.
        const Mask open = bundle->inv_t[vector] < FAR;
        const varying inv_t = SELECT(open, bundle->inv_t[vector], (varying)(0.0f));
        met |= ANY(open & (entry <= leave * OUTWARDS) & (entry * inv_t <= OUTWARDS)) ? 1u << vector : 0;
    }
    return met;
}
