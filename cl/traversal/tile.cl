// A tile of rays with a common origin (the eye, or a light) walks the tree together. A work-item owns the tile, as
// VECTORS vectors of WIDTH rays in private memory; a bit of a `live` mask stands for a vector.
//
// A node's children are tested at once against the interval of the tile's directions, then child by child against
// the intervals of its vectors, at once too; a vector's own rays are tested only where few vectors are left. A leaf's
// triangle is prepared once a tile: with A = V0 - O, the planes e2 x e1, e2 x -A and -A x e1 give a, a w1 and a w2 of
// Moeller and Trumbore as dot products with a ray's direction, and a t is the same for all.

#define VECTORS (TILE_X * TILE_Y / WIDTH)
#if WIDTH != 16 || VECTORS > 32
#error "tiles consist of at most 32 vectors of 16 rays"
#endif
#define ALL_VECTORS (VECTORS == 32 ? 0xffffffffu : (1u << (VECTORS & 31)) - 1u)
// Lanes of the vectors below are a tile's vectors, 16 at a time.
#define PARTS ((VECTORS + 15) / 16)
// With so few live vectors, their rays are tested rather than their intervals.
#define FEW_VECTORS 4

#if NODE_WIDTH == 8
typedef float8 Children;
typedef int8 ChildMask;
#define LOAD_CHILDREN(row) vload8(0, row)
#define CHILD_BITS(mask) ((uint)REDUCE_OR8((mask) & (int8)(1, 2, 4, 8, 16, 32, 64, 128)))
#elif NODE_WIDTH == 16
typedef float16 Children;
typedef int16 ChildMask;
#define LOAD_CHILDREN(row) vload16(0, row)
#define CHILD_BITS(mask) LANE_BITS(mask)
#else
#error "tiles walk a tree of 8 or 16 children a node"
#endif

#ifdef HAS_REDUCE_OR
#define REDUCE_OR8(m) __builtin_reduce_or(m)
#else
int reduce_or4(int4 m) { return (m.x | m.y) | (m.z | m.w); }
#define REDUCE_OR8(m) reduce_or4((m).lo | (m).hi)
#endif
#define LANE_BITS(mask) \
    ((uint)ANY((mask) & (int16)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768)))
#define LOWEST_BIT(bits) (31 - clz((bits) & (0u - (bits))))
#define LANES ((int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))

#ifndef PREFETCH
#error "PREFETCH: 1 where the compiler has __builtin_prefetch for global memory, else 0"
#endif
#if PREFETCH
#define FETCH(pointer) __builtin_prefetch((const void *)(size_t)(pointer), 0, 3)
#else
#define FETCH(pointer) (void)0
#endif
// The four cache lines that a node of eight children or the first triangles of a leaf fill.
#define FETCH_LINES(pointer) FETCH(pointer), FETCH((pointer) + 16), FETCH((pointer) + 32), FETCH((pointer) + 48)

typedef struct {
    Uniform3 origin;
    float t_min;
    float longest; // of the directions, the largest component
    varying x[VECTORS], y[VECTORS], z[VECTORS];             // directions, of any length
    varying per_x[VECTORS], per_y[VECTORS], per_z[VECTORS]; // their reciprocals
    varying reach[VECTORS];      // t of the nearest hit so far, or of the light; negative: the ray is done
    varying_int place[VECTORS];  // the nearest triangle so far, in leaf order
} Bundle;

// Where the reciprocals of some directions lie. `mixed`: their signs differ, so that nothing is known.
typedef struct {
    float low[3], high[3];
    int mixed[3], negative[3];
    float longest; // of the directions, the largest component
} Cone;

// The intervals of each vector's reciprocals, and how far its rays reach at most; a lane is a vector.
typedef struct {
    float16 low[3][PARTS], high[3][PARTS];
    float16 reach[PARTS];
} Slices;

float least_lane(float16 v) {
    const float8 a = min(v.lo, v.hi);
    const float4 b = min(a.lo, a.hi);
    const float2 c = min(b.lo, b.hi);
    return min(c.x, c.y);
}

float most_lane(float16 v) {
    const float8 a = max(v.lo, v.hi);
    const float4 b = max(a.lo, a.hi);
    const float2 c = max(b.lo, b.hi);
    return max(c.x, c.y);
}

void set_lane(float16 *parts, int vector, float value) {
    for (int part = 0; part < PARTS; part++)
        parts[part] = LANES == (int16)(vector - 16 * part) ? (float16)(value) : parts[part];
}

void find_signs(Cone *cone) {
    for (int axis = 0; axis < 3; axis++) {
        cone->mixed[axis] = cone->low[axis] <= 0.0f && cone->high[axis] >= 0.0f;
        cone->negative[axis] = cone->high[axis] < 0.0f;
    }
}

// The interval of 1 / (corner + x step_x + y step_y) over a rectangle of pixels, a little widened.
void bound_reciprocal(float corner, float step_x, float step_y, float4 pixels, Cone *cone, int axis) {
    const float x0 = pixels.x * step_x, x1 = pixels.z * step_x, y0 = pixels.y * step_y, y1 = pixels.w * step_y;
    const float least = corner + min(x0, x1) + min(y0, y1), most = corner + max(x0, x1) + max(y0, y1);
    cone->longest = max(cone->longest, max(fabs(least), fabs(most)));
    cone->low[axis] = -FAR;
    cone->high[axis] = FAR;
    if (least * most <= 0.0f) return;
    const float a = 1.0f / most, b = 1.0f / least;
    cone->low[axis] = a - 2e-6f * fabs(a);
    cone->high[axis] = b + 2e-6f * fabs(b);
}

// The directions through a rectangle of pixels (x0, y0, x1, y1), without making any ray.
Cone camera_cone(float4 corner, float4 step_x, float4 step_y, float4 pixels) {
    Cone cone;
    cone.longest = 0.0f;
    bound_reciprocal(corner.x, step_x.x, step_y.x, pixels, &cone, 0);
    bound_reciprocal(corner.y, step_x.y, step_y.y, pixels, &cone, 1);
    bound_reciprocal(corner.z, step_x.z, step_y.z, pixels, &cone, 2);
    find_signs(&cone);
    return cone;
}

// The intervals of each vector's live rays. A vector without any gets an empty one.
void slice(const Bundle *bundle, Slices *slices) {
    for (int part = 0; part < PARTS; part++) slices->reach[part] = (float16)(-1.0f);
    for (int vector = 0; vector < VECTORS; vector++) {
        const Mask live = bundle->reach[vector] > 0.0f;
        const varying *axes[3] = {bundle->per_x, bundle->per_y, bundle->per_z};
        for (int axis = 0; axis < 3; axis++) {
            const varying per = axes[axis][vector];
            set_lane(slices->low[axis], vector, least_lane(SELECT(live, per, (varying)(FAR))));
            set_lane(slices->high[axis], vector, most_lane(SELECT(live, per, (varying)(-FAR))));
        }
        set_lane(slices->reach, vector, most_lane(bundle->reach[vector]));
    }
}

// The directions of the rays that are not done.
Cone bundle_cone(const Bundle *bundle) {
    varying low[3], high[3];
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = (varying)(FAR);
        high[axis] = (varying)(-FAR);
    }
    for (int vector = 0; vector < VECTORS; vector++) {
        const Mask going = bundle->reach[vector] > 0.0f;
        if (!ANY(going)) continue; // it may have no directions at all
        const varying *axes[3] = {bundle->per_x, bundle->per_y, bundle->per_z};
        for (int axis = 0; axis < 3; axis++) {
            const varying per = axes[axis][vector];
            low[axis] = min(low[axis], SELECT(going, per, low[axis]));
            high[axis] = max(high[axis], SELECT(going, per, high[axis]));
        }
    }
    Cone cone;
    for (int axis = 0; axis < 3; axis++) {
        cone.low[axis] = least_lane(low[axis]);
        cone.high[axis] = most_lane(high[axis]);
    }
    find_signs(&cone);
    return cone;
}

void finish_directions(Bundle *bundle, int vector) {
    bundle->per_x[vector] = safe_reciprocal(bundle->x[vector]);
    bundle->per_y[vector] = safe_reciprocal(bundle->y[vector]);
    bundle->per_z[vector] = safe_reciprocal(bundle->z[vector]);
}

// Vectors with a ray that meets a box, whose sides lie at near[] and far[] from the origin. Each ray is asked.
uint rays_meet(const Bundle *bundle, const Cone *cone, const float *near, const float *far, uint live) {
    uint met = 0;
    while (live) {
        const int vector = LOWEST_BIT(live);
        live &= live - 1;
        const varying x0 = near[0] * bundle->per_x[vector], x1 = far[0] * bundle->per_x[vector];
        const varying y0 = near[1] * bundle->per_y[vector], y1 = far[1] * bundle->per_y[vector];
        const varying z0 = near[2] * bundle->per_z[vector], z1 = far[2] * bundle->per_z[vector];
        const varying entry = max(max(min(x0, x1), min(y0, y1)), max(min(z0, z1), (varying)(0.0f)));
        const varying leave = min(max(x0, x1), min(max(y0, y1), max(z0, z1))) * 1.0000005f;
        met |= ANY((entry <= leave) & (entry <= bundle->reach[vector])) ? 1u << vector : 0;
    }
    return met;
}

// The same by the vectors' intervals, all at once; needs a cone that is not mixed.
uint slices_meet(const Slices *slices, const float *near, const float *far) {
    uint met = 0;
    for (int part = 0; part < PARTS; part++) {
        float16 entry = (float16)(0.0f), leave = slices->reach[part];
        for (int axis = 0; axis < 3; axis++) {
            const float16 low = slices->low[axis][part], high = slices->high[axis][part];
            entry = max(entry, min(near[axis] * low, near[axis] * high));
            leave = min(leave, max(far[axis] * low, far[axis] * high) * 1.0000005f);
        }
        met |= LANE_BITS(entry <= leave) << (16 * part);
    }
    return met;
}

// Tests a leaf's triangle with the rays of the live vectors. With `any`, a ray that hits it is done; otherwise
// the nearest hit is kept. Returns the vectors in which something changed.
uint test_triangle(Bundle *bundle, const Tree *tree, int place, uint live, const int any) {
    const Row row = leaf_corners(tree, place);
    const Uniform3 e1 = uniform_difference(row.b, row.a), e2 = uniform_difference(row.c, row.a);
    const Uniform3 s = uniform_difference(bundle->origin, row.a);
    const Uniform3 n = uniform_cross(e2, e1);
    Uniform3 u = uniform_cross(e2, s), v = uniform_cross(s, e1);
    const float height = uniform_dot(e2, v);
    // Weights are allowed their rounding error, as in the other fast tests; less on the long way from a light, where it
    // would darken what lies beside a grazed edge. (Measured: with all of it, or with none, a pixel in two million is
    // wrong on one of bunny, teapot and terrain; with a quarter, none.)
    const float rounding = (any ? 0.25f : 1.0f) * ROUNDING * uniform_size(s) * bundle->longest;
    const float slack1 = rounding * uniform_size(e2), slack2 = rounding * uniform_size(e1);
    const float edge_on = 1e-5f * uniform_size(e1) * uniform_size(e2) * bundle->longest;
    uint changed = 0;
    while (live) {
        const int vector = LOWEST_BIT(live);
        live &= live - 1;
        const varying x = bundle->x[vector], y = bundle->y[vector], z = bundle->z[vector];
        const varying a = x * n.x + (y * n.y + z * n.z);
        const varying_int sign = sign_bit(a);
        const varying size = flip_sign(a, sign);
        const varying w1 = flip_sign(x * u.x + (y * u.y + z * u.z), sign);
        const varying w2 = flip_sign(x * v.x + (y * v.y + z * v.z), sign);
        const varying depth = flip_sign((varying)(height), sign);
        const varying reach = bundle->reach[vector];
        Mask hits = (min(w1 + slack1, w2 + slack2) >= 0.0f) & (w1 + w2 <= size + (slack1 + slack2)) &
                    (depth > size * bundle->t_min) & (depth < reach * size) & (size > edge_on);
#if CULL_BACK
        hits &= any ? a < 0.0f : a > 0.0f;
#endif
        if (any) {
            if (!ANY(hits)) continue;
            bundle->reach[vector] = SELECT(hits, (varying)(-1.0f), reach);
            changed |= 1u << vector;
        } else {
            // No branch: hits are frequent where a tile meets a leaf, and hard to foresee.
            bundle->reach[vector] = SELECT(hits, depth / size, reach);
            bundle->place[vector] = SELECT(hits, (varying_int)(place), bundle->place[vector]);
            changed |= ANY(hits) ? 1u << vector : 0;
        }
    }
    return changed;
}

typedef struct {
    uint word;
    float entry;
    uint live;
} WaitingTile;

// The reach of each vector, after hits.
void update_reach(const Bundle *bundle, Slices *slices, uint changed) {
    while (changed) {
        const int vector = LOWEST_BIT(changed);
        changed &= changed - 1;
        set_lane(slices->reach, vector, most_lane(bundle->reach[vector]));
    }
}

// Vectors that reach further than `entry`.
uint reaching(const Slices *slices, float entry) {
    uint bits = 0;
    for (int part = 0; part < PARTS; part++) bits |= LANE_BITS(slices->reach[part] > entry) << (16 * part);
    return bits;
}

float furthest(const Slices *slices) {
    float16 most = slices->reach[0];
    for (int part = 1; part < PARTS; part++) most = max(most, slices->reach[part]);
    return most_lane(most);
}

// Puts the children of a node that vectors of `live` meet on the stack, the nearest last.
int push_children(const Bundle *bundle, const Slices *slices, const Cone *cone, const Tree *tree, uint word, uint live,
                  const int any, WaitingTile *stack, int waiting) {
    const __global float *node = tree->nodes + NODE_STRIDE * (size_t)word;
    const float *o = (const float *)&bundle->origin;
    Children sides[3][2]; // near, far
    Children entry = (Children)(0.0f), leave = (Children)(any ? FAR : furthest(slices));
    int mixed = 0;
    for (int axis = 0; axis < 3; axis++) {
        const int negative = cone->negative[axis];
        sides[axis][0] = LOAD_CHILDREN(node + (2 * axis + negative) * NODE_WIDTH) - o[axis];
        sides[axis][1] = LOAD_CHILDREN(node + (2 * axis + 1 - negative) * NODE_WIDTH) - o[axis];
        mixed |= cone->mixed[axis];
        if (cone->mixed[axis]) continue;
        entry = max(entry, min(sides[axis][0] * cone->low[axis], sides[axis][0] * cone->high[axis]));
        leave = min(leave, max(sides[axis][1] * cone->low[axis], sides[axis][1] * cone->high[axis]) * 1.0000005f);
    }
    float near[NODE_WIDTH][3], far[NODE_WIDTH][3], entries[NODE_WIDTH];
    for (int child = 0; child < NODE_WIDTH; child++) {
        entries[child] = ((const float *)&entry)[child];
        for (int axis = 0; axis < 3; axis++) {
            near[child][axis] = ((const float *)&sides[axis][0])[child];
            far[child][axis] = ((const float *)&sides[axis][1])[child];
        }
    }
    uint met = CHILD_BITS(entry <= leave);
    const int few = any || mixed || popcount(live) <= FEW_VECTORS;
    const int below = waiting;
    while (met) {
        const int child = LOWEST_BIT(met);
        met &= met - 1;
        const uint child_word = as_uint(node[CHILD_ROW + child]);
        if (child_word == 0x80000000u) continue; // a place that is not used
        uint vectors = live;
        if (few) vectors = rays_meet(bundle, cone, near[child], far[child], live);
        else vectors &= slices_meet(slices, near[child], far[child]);
        if (!vectors) continue;
        if (IS_LEAF(child_word)) FETCH_LINES(tree->leaves + LEAF_ROW * (size_t)LEAF_FIRST(child_word));
        else FETCH_LINES(tree->nodes + NODE_STRIDE * (size_t)child_word);
        int place = waiting++;
        if (!any)
            for (; place > below && stack[place - 1].entry < entries[child]; place--) stack[place] = stack[place - 1];
        stack[place].word = child_word;
        stack[place].entry = entries[child];
        stack[place].live = vectors;
    }
    return waiting;
}

// Walks the tree with a bundle whose rays are made. Returns the vectors with a ray that is not done.
uint walk(Bundle *bundle, Slices *slices, const Cone *cone, const Tree *tree, WaitingTile *stack, int waiting,
          uint open, const int any) {
    while (waiting) {
        const WaitingTile next = stack[--waiting];
        uint live = any ? next.live & open : next.live & reaching(slices, next.entry);
        if (!live) continue;
        if (!IS_LEAF(next.word)) {
            waiting = push_children(bundle, slices, cone, tree, next.word, live, any, stack, waiting);
            continue;
        }
        const int first = LEAF_FIRST(next.word), end = first + LEAF_COUNT(next.word);
        uint changed = 0;
        for (int place = first; place < end; place++) {
            const uint now = test_triangle(bundle, tree, place, live, any);
            changed |= now;
            if (!any) continue;
            for (uint left = now; left; left &= left - 1) {
                const int vector = LOWEST_BIT(left);
                if (!ANY(bundle->reach[vector] > 0.0f)) open &= ~(1u << vector);
            }
            live &= open;
        }
        if (any && !open) return 0;
        if (!any && changed) update_reach(bundle, slices, changed);
    }
    return open;
}

#include "traversal/tile_frame.cl"
