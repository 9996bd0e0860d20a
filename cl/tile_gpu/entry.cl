// A tile of rays with a common origin (the eye, or a light) walks the tree together, as in tile_cpu/; but here a group of
// 32 work-items owns the tile. Lane i has RAYS of its rays, tests child i of a node and prepares triangle i of a leaf.
// The group's stack, and the triangles that its rays have to test, lie in __local memory.
//
// A pass takes rays that run along one axis of the scene, say z. Seen from their origin a ray is then the points
// (x z, y z, z), z > 0, where x and y are its slopes; what is nearest has the largest 1/z, which over a triangle
// is linear in x and y. So is whatever tells inside from outside.

#if !defined(TILE_X) || !defined(TILE_Y)
#error "TILE_X, TILE_Y: pixels of a tile across and down"
#endif
#ifndef CULL_BACK
#error "CULL_BACK: 0 or 1: whether culling = back"
#endif
#ifndef WATERTIGHT
#error "WATERTIGHT: 0 or 1: whether intersector = watertight"
#endif
#if !defined(LIGHT_FLOATS) || !defined(MATERIAL_FLOATS)
#error "LIGHT_FLOATS, MATERIAL_FLOATS: floats of a light, and of a material"
#endif

#include "common/work_group.cl"
#include "common/width.cl"
#include "common/vec3.cl"
#include "common/camera.cl"
#include "common/hit.cl"
#include "common/rows.cl"
#if WATERTIGHT
#include "common/exact_signs.cl"
#endif
#include "common/tree.cl"
#include "common/meet_plane.cl"
#include "common/reflectance.cl"
#include "common/lanes.cl"

#if WIDTH != 1 || TILE_X % 8 || TILE_Y % 4
#error "a group's tile consists of blocks of 8 x 4 rays, WIDTH 1"
#endif
#if NODE_WIDTH != GROUP_LANES
#error "a group walks a tree of 32 children a node"
#endif
#ifndef PLANES_OF_ORIGIN
#error "PLANES_OF_ORIGIN: 0 or 1: whether a row a triangle is prepared for the eye and each light"
#endif

#define RAYS (TILE_X * TILE_Y / GROUP_LANES)
#define EACH_RAY(ray) _Pragma("unroll") for (int ray = 0; ray < RAYS; ray++)
#define HAS(bits, ray) (((bits) >> (ray)) & 1u)

// Rays join a pass if the axis has more than this part of their direction; the leader's has at least a third.
#define ALONG_AXIS 0.25f
// Where rays are grouped: how many times further from the leader than those beside it they may be: as far as pixels of a
// tile are.
#define NEIGHBOURS ((float)TILE_X)
// A leader is sought here first: in the middle of the lanes' 8 x 4 pixels.
#define MIDDLE_LANE 20

#include "tile_gpu/shaft.cl"

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

#include "tile_gpu/intersect/{intersector}.cl"

// How far apart, in slopes, a leader's ray and those of the pixels beside it are: in its row and its column the nearer
// one, and of the two the further. Each lane says how far from the leader's its ray is. FAR without any beside it.
INLINED float spacing_at(const Group *group, float distance, int leader) {
    const int row = leader & ~7;
    const float left = lane_get_float(group, distance, row | ((leader - 1) & 7));
    const float right = lane_get_float(group, distance, row | ((leader + 1) & 7));
    const float above = lane_get_float(group, distance, (leader - 8) & 31);
    const float below = lane_get_float(group, distance, (leader + 8) & 31);
    const float across = fmin(left, right), down = fmin(above, below);
    return fmax(across, down) < FAR ? fmax(across, down) : fmin(across, down);
}

// Chooses the rays of `todo` that go with some leader's, and makes their shaft and beam. With `close`, they must be
// close to it in direction. Returns this lane's; a leader's own ray is among them, unless it has no direction.
INLINED uint begin_pass(const Group *group, const Tree *tree, Origin origin, const Ways *ways, uint todo,
                        const int close, Shaft *shaft, Beam *beam) {
    const uint lanes = lane_ballot(group, todo != 0);
    const int leader = HAS(lanes, MIDDLE_LANE) ? MIDDLE_LANE : LOWEST_BIT(lanes);
    const uint first = lane_get(group, todo & (0u - todo), leader); // the leader's first ray, and those in its place
    Uniform3 way = uniform3(0.0f, 0.0f, 0.0f);
    EACH_RAY(ray) if (HAS(first, ray)) way = uniform3(ways->x[ray], ways->y[ray], ways->z[ray]);
    const Uniform3 own = way;
    way.x = lane_get_float(group, way.x, leader);
    way.y = lane_get_float(group, way.y, leader);
    way.z = lane_get_float(group, way.z, leader);
    aim(group, tree, origin, way, shaft);

    const float per_leader = reciprocal(fabs(component(way.x, way.y, way.z, shaft->along)));
    const float leader_x = component(way.x, way.y, way.z, shaft->across) * per_leader;
    const float leader_y = component(way.x, way.y, way.z, shaft->down) * per_leader;
    float tolerance = FAR;
    if (close) {
        const float depth = depth_of(shaft, own.x, own.y, own.z), per_depth = reciprocal(depth);
        const float x = component(own.x, own.y, own.z, shaft->across) * per_depth;
        const float y = component(own.x, own.y, own.z, shaft->down) * per_depth;
        const int beside = (todo & first) && depth > 0.0f;
        const float spacing = spacing_at(group, beside ? fabs(x - leader_x) + fabs(y - leader_y) : FAR, leader);
        tolerance = (spacing < FAR ? NEIGHBOURS * spacing : 0.0f) + 2.0f * SLOPE_ROUNDING;
    }

    uint joining = 0;
    float low_x = FAR, high_x = -FAR, low_y = FAR, high_y = -FAR;
    EACH_RAY(ray) {
        const float depth = depth_of(shaft, ways->x[ray], ways->y[ray], ways->z[ray]);
        const float per_depth = depth > 0.0f ? reciprocal(depth) : 0.0f;
        const float x = component(ways->x[ray], ways->y[ray], ways->z[ray], shaft->across) * per_depth;
        const float y = component(ways->x[ray], ways->y[ray], ways->z[ray], shaft->down) * per_depth;
        const int joins = HAS(todo, ray) && depth > 0.0f &&
                          (!close || (fabs(x - leader_x) < tolerance && fabs(y - leader_y) < tolerance));
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
    const uint at = NODE_STRIDE * node; // below 2^32: a node has more than 32 triangles below it
    const __global float *x_rows = tree->nodes + (at + shaft->x_rows);
    const __global float *y_rows = tree->nodes + (at + shaft->y_rows);
    const float left = x_rows[0] - shaft->x, right = x_rows[NODE_WIDTH] - shaft->x;
    const float top = y_rows[0] - shaft->y, bottom = y_rows[NODE_WIDTH] - shaft->y;
    const float first = MULTIPLY_ADD(shaft->sign, tree->nodes[at + shaft->near_row], -shaft->z);
    const float far = MULTIPLY_ADD(shaft->sign, tree->nodes[at + shaft->far_row], -shaft->z);
    const float near = fmax(first, 0.0f);
    Child result;
    result.word = as_uint(tree->nodes[at + CHILD_ROW + group->lane]);
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

// Triangles that a group's rays have to test, side by side, and the lanes that prepared them.
typedef struct {
    __local float4 *quads; // three each
    __local int *lanes;
} Candidates;

// Tests a leaf's triangles with the beam, those that the shaft cannot rule out. With `any`, a ray that hits one is done;
// otherwise the nearest hit is kept. Returns whether any triangle was tested.
INLINED int visit_leaf(const Group *group, const Tree *tree, const Shaft *shaft, Beam *beam, uint word, float worst,
               const int any, const Candidates *candidates) {
    const int first = LEAF_FIRST(word);
    Candidate own;
    int wanted = 0;
    if (group->lane < LEAF_COUNT(word)) wanted = prepare(shaft, tree, first + group->lane, worst, any, &own);
    const uint tested = lane_ballot(group, wanted);
    lane_sync(group); // the last leaf's triangles have been tested
    if (wanted) {
        const int at = BITS_BEFORE(group, tested);
        store_candidate(own, candidates->quads + 3 * at);
        if (!any) candidates->lanes[at] = group->lane;
    }
    lane_sync(group);
    const int count = popcount(tested);
    int found[RAYS];
    EACH_RAY(ray) found[ray] = -1;
#pragma unroll 4
    for (int k = 0; k < count; k++) {
        const Candidate triangle = load_candidate(candidates->quads + 3 * k);
        EACH_RAY(ray) {
            float per_depth;
            const int hit = meets(&triangle, beam->x[ray], beam->y[ray], beam->nearest[ray], beam->ceiling[ray], any,
                                  &per_depth);
            beam->nearest[ray] = hit ? (any ? FAR : per_depth) : beam->nearest[ray];
            found[ray] = hit ? k : found[ray];
        }
    }
    if (!any) {
        EACH_RAY(ray) if (found[ray] >= 0) beam->place[ray] = first + candidates->lanes[found[ray]];
    }
    return count != 0;
}

// The least 1/z that a hit must have to matter to any ray of the group.
INLINED float worst_of(const Group *group, const Beam *beam) {
    float worst = FAR;
    EACH_RAY(ray) worst = fmin(worst, beam->nearest[ray]);
    return lane_least_positive(group, worst);
}

// Whether any of this lane's rays still looks for a hit.
INLINED int is_looking(const Beam *beam) {
    int looking = 0;
    EACH_RAY(ray) looking |= beam->nearest[ray] < FAR;
    return looking;
}

// z beyond which no hit matters.
INLINED float reach_of(float worst) { return worst > 0.0f ? fmin(1.00001f * reciprocal(worst), FAR) : FAR; }

// Walks the tree with a pass's beam: to the nearest hit of each ray, or with `any` to some. Each word taken from the stack
// costs one of `budget`; returns whether it was enough.
INLINED int walk(const Group *group, const Tree *tree, const Shaft *shaft, Beam *beam, const int any, int *budget,
         __local uint2 *stack, const Candidates *candidates) {
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
            going = any ? lane_any(group, is_looking(beam)) : 1;
            if (!any) worst = worst_of(group, beam);
            reach = reach_of(worst);
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

#include "tile_gpu/frame.cl"
