// Bounds of a tile's rays: intervals of their directions, for the whole tile (a TileInterval) and for each of its
// vectors (Slices).

// The ends of an interval of reciprocals are moved outwards by RECIPROCAL_ROUNDING times their value, which is more
// than the rounding error of a reciprocal.
#define RECIPROCAL_ROUNDING 3e-7f
// A component of a direction counts as zero if its absolute value is less than NO_DIRECTION.
#define NO_DIRECTION 1e-20f
// The smallest value of 1 / t: a lower bound of 1 / t keeps t finite.
#define LEAST_INV_T 1e-37f

// Bounds of the reciprocals of the components of a tile's directions. An axis is *mixed* if components of both signs,
// or zeros, occur along it. Along a mixed axis, each reciprocal is less than low or greater than high. Along all other
// axes, the reciprocals lie between low and high.
typedef struct {
    float low[3], high[3];
    int mixed[3], negative[3]; // negative: all rays run towards smaller coordinates
} TileInterval;

// An interval for each vector of rays, with one lane per vector. At first, the intervals contain directions;
// finish_slices converts them to intervals of reciprocals, as in a TileInterval. Lanes without rays have the empty
// interval from FAR to -FAR.
typedef struct {
    float16 low[3][PARTS], high[3][PARTS];
    float16 reach[PARTS]; // the largest t at which something can be hit
} Slices;

#if NODE_WIDTH == 8
typedef float8 Children;
typedef uint8 ChildWords;
#define LOAD_CHILDREN(row) vload8(0, row)
#define STORE_CHILDREN(children, to) vstore8(children, 0, to)
#define AS_WORDS(children) as_uint8(children)
#define CHILD_BITS(mask) LANE_BITS8(mask)
#elif NODE_WIDTH == 16
typedef float16 Children;
typedef uint16 ChildWords;
#define LOAD_CHILDREN(row) vload16(0, row)
#define STORE_CHILDREN(children, to) vstore16(children, 0, to)
#define AS_WORDS(children) as_uint16(children)
#define CHILD_BITS(mask) LANE_BITS16(mask)
#else
#error "tiles walk a tree of 8 or 16 children per node"
#endif
#ifndef UNUSED_WORD
#error "UNUSED_WORD: the word of a child that does not exist"
#endif
#define UNUSED_CHILD ((uint)UNUSED_WORD)

// The boxes of a node's children, relative to the rays' origin. Rays enter a box at the side `near` and leave it at
// `far`; along mixed axes, some rays do the opposite. `entry` is a lower bound of the t at which the tile's rays enter
// a child's box.
typedef struct {
    float near[3][NODE_WIDTH], far[3][NODE_WIDTH];
    Children entry;
} Boxes;

// Converts intervals of directions to intervals of their reciprocals, and widens the results by more than the rounding
// error. 1 / d decreases as d grows, so the ends are swapped. If the interval contains zero, the reciprocals form two
// half-lines. If an end of the interval is zero, its reciprocal is stored as FAR or -FAR. Empty intervals (low > high)
// stay empty.
static void invert_intervals(float16 *low, float16 *high) {
    const float16 least = *low, most = *high;
    // If the interval contains zero (`mixed`), the reciprocals lie below 1 / least or above 1 / most.
    const int16 none = least > most, mixed = (least <= NO_DIRECTION) & (most >= -NO_DIRECTION);
    const float16 down = 1.0f / SELECT(mixed, least, most), up = 1.0f / SELECT(mixed, most, least);
    const float16 a = SELECT(mixed & (least >= -NO_DIRECTION), (float16)(-FAR), down - RECIPROCAL_ROUNDING * fabs(down));
    const float16 b = SELECT(mixed & (most <= NO_DIRECTION), (float16)(FAR), up + RECIPROCAL_ROUNDING * fabs(up));
    *low = SELECT(none, (float16)(FAR), a);
    *high = SELECT(none, (float16)(-FAR), b);
}

// Finds the least value of `low` and the greatest value of `high` over all vectors of rays of a tile. The arrays have
// one lane per vector of rays, in PARTS elements: the function combines first the elements, and then their lanes.
static void whole_tile(const float16 *low, const float16 *high, float *least, float *most) {
    float16 l = low[0], h = high[0];
    for (int part = 1; part < PARTS; part++) l = min(l, low[part]), h = max(h, high[part]);
    *least = least_lane(l);
    *most = most_lane(h);
}

// Returns the interval of a whole tile (see TileInterval), from the intervals of directions of its vectors of rays.
TileInterval interval_of_tile(const Slices *directions) {
    TileInterval interval;
    for (int axis = 0; axis < 3; axis++) {
        float least, most;
        whole_tile(directions->low[axis], directions->high[axis], &least, &most);
        interval.mixed[axis] = least <= NO_DIRECTION && most >= -NO_DIRECTION;
        interval.negative[axis] = !interval.mixed[axis] && most < 0.0f;
        float16 low = (float16)(least), high = (float16)(most);
        invert_intervals(&low, &high);
        interval.low[axis] = low.s0;
        interval.high[axis] = high.s0;
    }
    return interval;
}

// The half width of an interval of directions is increased by PRODUCT_ROUNDING times the interval's larger end (in
// absolute value). This increase of the half width is more than the rounding errors of a direction's dot product with a
// normal, and of the bound that largest_product computes.
#define PRODUCT_ROUNDING 2e-6f

// Converts `slices` from intervals of directions to intervals of reciprocals. First, stores the intervals' middles and
// half widths in the bundle. (In lanes without rays, high - low would overflow, so each end is halved first.)
static void finish_slices(Bundle *bundle, Slices *slices) {
    for (int axis = 0; axis < 3; axis++) {
        for (int part = 0; part < PARTS; part++) {
            float16 *low = &slices->low[axis][part], *high = &slices->high[axis][part];
            bundle->middle[axis][part] = 0.5f * *high + 0.5f * *low;
            bundle->half_width[axis][part] =
                0.5f * *high - 0.5f * *low + PRODUCT_ROUNDING * max(fabs(*low), fabs(*high));
            invert_intervals(low, high);
        }
    }
}

// Returns upper bounds of the dot products of a normal (x, y, z) with the directions of rays: one lane for each of 16
// vectors of rays.
INLINED float16 largest_product(const Bundle *bundle, int part, float x, float y, float z) {
    // The dot product is largest at a corner of the box of directions: along each axis, at the end of the interval to
    // which the normal points.
    const float16 middle =
        x * bundle->middle[0][part] + (y * bundle->middle[1][part] + z * bundle->middle[2][part]);
    return middle + fabs(x) * bundle->half_width[0][part] +
           (fabs(y) * bundle->half_width[1][part] + fabs(z) * bundle->half_width[2][part]);
}

// Returns the children of a node that the tile's rays may enter before t = `reach`, one bit each.
uint children_overlap(const TileInterval *interval, Uniform3 origin, const __global float *node, float reach,
                      Boxes *boxes) {
    const float o[3] = {origin.x, origin.y, origin.z};
    Children entry = (Children)(0.0f), leave = (Children)(reach);
    for (int axis = 0; axis < 3; axis++) {
        // Rays towards smaller coordinates reach the box's high side first. Unless the axis is mixed (rays run both
        // ways along it), all rays of the tile reach the same side first.
        const int negative = interval->negative[axis];
        const Children near = LOAD_CHILDREN(node + (2 * axis + negative) * NODE_WIDTH) - o[axis];
        const Children far = LOAD_CHILDREN(node + (2 * axis + 1 - negative) * NODE_WIDTH) - o[axis];
        STORE_CHILDREN(near, boxes->near[axis]);
        STORE_CHILDREN(far, boxes->far[axis]);
        if (interval->mixed[axis]) {
            // Along a mixed axis, rays with 1/d >= high enter the box at `near`, and rays with 1/d <= low at `far`.
            // Each of the two products is positive only if the outside of its side faces the origin. If the origin lies
            // between the two sides, no product is positive.
            entry = max(entry, max(near * interval->high[axis], far * interval->low[axis]));
        } else {
            // A ray crosses a side at t = side * (1 / d). The earliest entry and the latest exit occur at ends of the
            // interval of 1 / d.
            entry = max(entry, min(near * interval->low[axis], near * interval->high[axis]));
            leave = min(leave, max(far * interval->low[axis], far * interval->high[axis]) * OUTWARDS);
        }
    }
    boxes->entry = entry;
    return CHILD_BITS((entry <= leave) & (AS_WORDS(LOAD_CHILDREN(node + CHILD_ROW)) != UNUSED_CHILD));
}

// Returns the vectors of rays with a ray that may enter the box of a node's child, one bit each.
static uint slices_overlap(const Slices *slices, const TileInterval *interval, const Boxes *boxes, int child) {
    uint met = 0;
    for (int part = 0; part < PARTS; part++) {
        // This is the slab test of children_overlap, but for a single child: each lane tests the interval of one vector
        // of rays.
        float16 entry = (float16)(0.0f), leave = (float16)(FAR);
        for (int axis = 0; axis < 3; axis++) {
            const float16 low = slices->low[axis][part], high = slices->high[axis][part];
            const float16 near = (float16)(boxes->near[axis][child]), far = (float16)(boxes->far[axis][child]);
            float16 first = min(near * low, near * high), last = max(far * low, far * high);
            if (interval->mixed[axis]) { // the rays of a vector that is not mixed may run in either direction
                const int16 mixed = (low < 0.0f) & (high > 0.0f);
                first = SELECT(mixed, max(near * high, far * low), min(first, min(far * low, far * high)));
                last = SELECT(mixed, (float16)(FAR), max(last, max(near * low, near * high)));
            }
            entry = max(entry, first);
            leave = min(leave, last);
        }
        // A vector of rays is also excluded if all its rays have already hit something nearer than the box.
        met |= LANE_BITS16(entry <= min(leave * OUTWARDS, slices->reach[part])) << (16 * part);
    }
    return met;
}

// Returns the vectors of rays whose reach (the largest t at which something can be hit) exceeds `entry`, one bit each.
static uint reaching(const Slices *slices, float entry) {
    uint bits = 0;
    for (int part = 0; part < PARTS; part++) bits |= LANE_BITS16(slices->reach[part] > entry) << (16 * part);
    return bits;
}

// Returns the largest reach (the largest t at which something can be hit) of all vectors of rays.
static float furthest(const Slices *slices) {
    float16 most = slices->reach[0];
    for (int part = 1; part < PARTS; part++) most = max(most, slices->reach[part]);
    return most_lane(most);
}

// Updates the reach (the largest t at which something can be hit) of vectors whose rays have hit something.
static void update_reach(const Bundle *bundle, Slices *slices, uint changed) {
    for (; changed; changed &= changed - 1) {
        const int vector = LOWEST_BIT(changed);
        // The reach of a vector of rays is the largest t of its rays. This ray has the smallest 1 / t.
        const float reach = 1.0f / max(least_lane(bundle->inv_t[vector]), LEAST_INV_T);
        for (int part = 0; part < PARTS; part++)
            // The statement compares all lanes' numbers with the vector's number, to select the vector's lane. Writing
            // the lane by its index would move `slices` from registers to memory.
            slices->reach[part] = LANES == (int16)(vector - 16 * part) ? (float16)(reach) : slices->reach[part];
    }
}
