// A tile of rays with a common origin (the eye, or a light) walks the tree together, as in tile.cl; but here a group of
// 32 work-items owns the tile. Lane i has RAYS of its rays, tests child i of a node and prepares triangle i of a leaf.
// The group's stack, and the triangles that its rays have to test, lie in __local memory.
//
// A pass takes rays that run along one axis of the scene, say z. Seen from their origin a ray is then the points
// (x z, y z, z), z > 0, where x and y are its slopes; what is nearest has the largest 1/z, which over a triangle
// is linear in x and y. So is whatever tells inside from outside.

#include "shared/lanes.cl"

#if WIDTH != 1 || TILE_X % 8 || TILE_Y % 4
#error "a group's tile consists of blocks of 8 x 4 rays, WIDTH 1"
#endif
#if NODE_WIDTH != GROUP_LANES
#error "a group walks a tree of 32 children a node"
#endif
#ifndef WATERTIGHT
#error "WATERTIGHT: 0 or 1: whether intersector = watertight"
#endif

#define RAYS (TILE_X * TILE_Y / GROUP_LANES)
#define EACH_RAY(ray) _Pragma("unroll") for (int ray = 0; ray < RAYS; ray++)
#define HAS(bits, ray) (((bits) >> (ray)) & 1u)

// Rays join a pass if the axis has more than this part of their direction; the leader's has at least a third.
#define ALONG_AXIS 0.25f
// Where rays are grouped: how many times further from the leader than its nearest neighbour they may be.
#define NEIGHBOURS 16.0f

#include "traversal/tile_group_shaft.cl"

// A lane's rays in a pass. A ray that takes no part, or is done, has nearest = FAR.
typedef struct {
    float x[RAYS], y[RAYS];
    float nearest[RAYS]; // 1/z of the nearest hit so far, or of where the ray ends
    float ceiling[RAYS]; // 1/z from which on nothing is seen
    int place[RAYS];     // the nearest triangle so far, in leaf order
} Beam;

// A lane's rays before they are grouped: directions of any length, and the 1/t in units of these at which all of them
// begin (FAR at the origin itself) and end (0 if they do not).
typedef struct {
    float x[RAYS], y[RAYS], z[RAYS];
    float per_begin, per_end;
} Ways;

// The part of a direction along a pass's axis, if it lies well along it, else 0.
INLINED float depth_of(const Shaft *shaft, float x, float y, float z) {
    const float depth = shaft->sign * component(x, y, z, shaft->along);
    return depth > ALONG_AXIS * (fabs(x) + fabs(y) + fabs(z)) ? depth : 0.0f;
}

#if WATERTIGHT
#include "traversal/tile_group_watertight.cl"
#else
#include "traversal/tile_group_moller_trumbore.cl"
#endif

// How near, in slopes, another ray comes to a leader's at (x, y), of which this lane has `own`. A lane without any
// says FAR.
INLINED float nearest_neighbour(const Shaft *shaft, const Ways *ways, uint todo, uint own, float x, float y) {
    float least = FAR;
    EACH_RAY(ray) {
        const float depth = depth_of(shaft, ways->x[ray], ways->y[ray], ways->z[ray]);
        if (!HAS(todo & ~own, ray) || depth <= 0.0f) continue;
        const float per_depth = 1.0f / depth;
        const float across = component(ways->x[ray], ways->y[ray], ways->z[ray], shaft->across) * per_depth;
        const float down = component(ways->x[ray], ways->y[ray], ways->z[ray], shaft->down) * per_depth;
        least = fmin(least, fabs(across - x) + fabs(down - y));
    }
    return least;
}

// Chooses the rays of `todo` that go with some leader's, and makes their shaft and beam. With `close`, they must be
// close to it in direction. Returns this lane's; a leader's own ray is among them, unless it has no direction.
INLINED uint begin_pass(const Group *group, Uniform3 origin, const Ways *ways, uint todo, const int close,
                Shaft *shaft, Beam *beam) {
    const uint lanes = lane_ballot(group, todo != 0);
    const int leader = HAS(lanes, 16) ? 16 : LOWEST_BIT(lanes); // from the middle of the tile, if it can be
    const uint first = todo & (0u - todo);
    Uniform3 way = uniform3(0.0f, 0.0f, 0.0f);
    EACH_RAY(ray) if (HAS(first, ray)) way = uniform3(ways->x[ray], ways->y[ray], ways->z[ray]);
    way.x = lane_get_float(group, way.x, leader);
    way.y = lane_get_float(group, way.y, leader);
    way.z = lane_get_float(group, way.z, leader);
    aim(origin, way, shaft);

    const float per_leader = 1.0f / fabs(component(way.x, way.y, way.z, shaft->along));
    const float leader_x = component(way.x, way.y, way.z, shaft->across) * per_leader;
    const float leader_y = component(way.x, way.y, way.z, shaft->down) * per_leader;
    float tolerance = FAR;
    if (close) {
        const uint own = group->lane == leader ? first : 0;
        const float least = nearest_neighbour(shaft, ways, todo, own, leader_x, leader_y);
        tolerance = fmin(lane_least_positive(group, least), 1e30f) * NEIGHBOURS + 2.0f * SLOPE_ROUNDING;
    }

    uint joining = 0;
    float low_x = FAR, high_x = -FAR, low_y = FAR, high_y = -FAR;
    EACH_RAY(ray) {
        const float depth = depth_of(shaft, ways->x[ray], ways->y[ray], ways->z[ray]);
        const float per_depth = depth > 0.0f ? 1.0f / depth : 0.0f;
        const float x = component(ways->x[ray], ways->y[ray], ways->z[ray], shaft->across) * per_depth;
        const float y = component(ways->x[ray], ways->y[ray], ways->z[ray], shaft->down) * per_depth;
        const int joins = HAS(todo, ray) && depth > 0.0f && fabs(x - leader_x) < tolerance &&
                          fabs(y - leader_y) < tolerance;
        joining |= joins ? 1u << ray : 0u;
        low_x = joins ? fmin(low_x, x) : low_x;
        high_x = joins ? fmax(high_x, x) : high_x;
        low_y = joins ? fmin(low_y, y) : low_y;
        high_y = joins ? fmax(high_y, y) : high_y;
        beam->x[ray] = x;
        beam->y[ray] = y;
        beam->nearest[ray] = joins ? ways->per_end * per_depth : FAR;
        beam->ceiling[ray] = fmin(ways->per_begin * per_depth, FAR);
    }
    widen(shaft, lane_min(group, low_x), lane_max(group, high_x), lane_min(group, low_y), lane_max(group, high_y));
    return joining;
}

// What a lane found of its child of a node.
typedef struct {
    int met;
    float entry; // z at which the shaft enters it
    uint word;
} Child;

// Whether the shaft meets this lane's child of a node nearer than reach. Errs towards a hit.
INLINED Child meet_child(const Group *group, const Tree *tree, const Shaft *shaft, uint node, float reach) {
    const __global float *child = tree->nodes + group->lane;
    const uint at = NODE_STRIDE * node; // below 2^32: a node has more than 32 triangles below it
    const __global float *x_rows = child + (at + 2 * NODE_WIDTH * shaft->across);
    const __global float *y_rows = child + (at + 2 * NODE_WIDTH * shaft->down);
    const __global float *z_rows = child + (at + 2 * NODE_WIDTH * shaft->along);
    const float left = x_rows[0] - shaft->x, right = x_rows[NODE_WIDTH] - shaft->x;
    const float top = y_rows[0] - shaft->y, bottom = y_rows[NODE_WIDTH] - shaft->y;
    const float z0 = MULTIPLY_ADD(shaft->sign, z_rows[0], -shaft->z);
    const float z1 = MULTIPLY_ADD(shaft->sign, z_rows[NODE_WIDTH], -shaft->z);
    const float near = fmax(fmin(z0, z1), 0.0f), far = fmax(z0, z1);
    Child result;
    result.word = as_uint(child[at + CHILD_ROW]);
    result.entry = near;
    result.met = (far >= near) & (near < reach) & (right >= fmin(shaft->low_x * near, shaft->low_x * far)) &
                 (left <= fmax(shaft->high_x * near, shaft->high_x * far)) &
                 (bottom >= fmin(shaft->low_y * near, shaft->low_y * far)) &
                 (top <= fmax(shaft->high_y * near, shaft->high_y * far));
    return result;
}

// Puts the children that were met on the stack, nearest last where they are sorted, but for the one to visit
// next, whose word it returns.
INLINED uint push(const Group *group, Child child, uint met, const int sorted, __local uint2 *stack, int *waiting) {
    if (!(met & (met - 1))) return lane_get(group, child.word, LOWEST_BIT(met));
    // An entry is not negative: its bits are ordered as it is, and the last five make it the lane's own.
    const uint key = (as_uint(child.entry) & ~31u) | (uint)group->lane;
    const int rank = sorted ? lane_rank(group, key, met) : BITS_BEFORE(group, met);
    const int others = popcount(met) - 1;
    if (child.met && rank) stack[*waiting + others - rank] = (uint2)(child.word, as_uint(child.entry));
    *waiting += others;
    lane_sync(group);
    const uint nearest = lane_ballot(group, child.met && !rank);
    return lane_get(group, child.word, LOWEST_BIT(nearest));
}

// Tests a leaf's triangles with the beam, those that the shaft cannot rule out. With `any`, a ray that hits one is done;
// otherwise the nearest hit is kept. Returns whether any triangle was tested.
INLINED int visit_leaf(const Group *group, const Tree *tree, const Shaft *shaft, Beam *beam, uint word, float worst,
               const int any, __local float4 *candidates) {
    const int first = LEAF_FIRST(word);
    Candidate own;
    int wanted = 0;
    if (group->lane < LEAF_COUNT(word)) wanted = prepare(shaft, tree, first + group->lane, worst, any, &own);
    lane_sync(group); // the last leaf's triangles have been tested
    if (wanted) store_candidate(own, candidates + 3 * group->lane);
    const uint tested = lane_ballot(group, wanted);
    lane_sync(group);
    for (uint left = tested; left; left &= left - 1) {
        const int slot = LOWEST_BIT(left);
        const Candidate triangle = load_candidate(candidates + 3 * slot);
        EACH_RAY(ray) {
            float per_depth;
            const int hit = meets(&triangle, beam->x[ray], beam->y[ray], beam->nearest[ray], beam->ceiling[ray], any,
                                  &per_depth);
            beam->nearest[ray] = hit ? (any ? FAR : per_depth) : beam->nearest[ray];
            if (!any) beam->place[ray] = hit ? first + slot : beam->place[ray];
        }
    }
    return tested != 0;
}

// The least 1/z that a hit must have to matter to any ray of the group.
INLINED float worst_of(const Group *group, const Beam *beam) {
    float worst = FAR;
    EACH_RAY(ray) worst = fmin(worst, beam->nearest[ray]);
    return lane_least_positive(group, worst);
}

// z beyond which no hit matters.
INLINED float reach_of(float worst) { return worst > 0.0f ? fmin(1.00001f / worst, FAR) : FAR; }

// Walks the tree with a pass's beam: to the nearest hit of each ray, or with `any` to some. Each word taken from the stack
// costs one of `budget`; returns whether it was enough.
INLINED int walk(const Group *group, const Tree *tree, const Shaft *shaft, Beam *beam, const int any, int *budget,
         __local uint2 *stack, __local float4 *candidates) {
    float worst = worst_of(group, beam), reach = reach_of(worst);
    uint word = 0;
    int waiting = 0, enough = 1, going = worst < FAR;
    while (going) {
        uint met = 0;
        if (!IS_LEAF(word)) {
            const Child child = meet_child(group, tree, shaft, word, reach);
            met = lane_ballot(group, child.met);
            if (met) word = push(group, child, met, !any, stack, &waiting);
        } else if (visit_leaf(group, tree, shaft, beam, word, worst, any, candidates)) {
            worst = worst_of(group, beam);
            reach = reach_of(worst);
            going = worst < FAR;
        }
        if (met || !going) continue;
        // Nothing to go on to: back to the nearest node or leaf that can still matter.
        float entry = FAR;
        while (waiting && entry >= reach) {
            const uint2 top = stack[--waiting];
            word = top.x;
            entry = as_float(top.y);
        }
        going = entry < reach;
        if (any && going && --*budget < 0) enough = going = 0;
    }
    lane_sync(group); // the stack has been read
    return enough;
}

// Whether anything blocks one ray, which is a beam of its own: each lane tests its own child or triangle with it.
INLINED int is_blocked(const Group *group, const Tree *tree, const Shaft *shaft, float x, float y, float nearest,
               __local uint2 *stack) {
    const float reach = reach_of(nearest);
    uint word = 0;
    int waiting = 0, going = 1, blocked = 0;
    while (going) {
        uint met = 0;
        if (!IS_LEAF(word)) {
            const Child child = meet_child(group, tree, shaft, word, reach);
            met = lane_ballot(group, child.met);
            if (met) word = push(group, child, met, 0, stack, &waiting);
        } else {
            int hit = 0;
            Candidate own;
            float per_depth;
            if (group->lane < LEAF_COUNT(word) &&
                prepare(shaft, tree, LEAF_FIRST(word) + group->lane, nearest, 1, &own))
                hit = meets(&own, x, y, nearest, FAR, 1, &per_depth);
            blocked = lane_any(group, hit);
        }
        if (met) continue;
        going = waiting && !blocked;
        if (going) word = stack[--waiting].x;
    }
    lane_sync(group); // the stack has been read
    return blocked;
}

#include "traversal/tile_group_frame.cl"
