// Traversals of the tree by a group of 32 lanes: with all rays of a pass (the packet: see entry.cl), or with one ray.

// The result of testing the shaft (the pass's rays) against this lane's child of a node.
typedef struct {
    int met;     // 1 if the shaft meets the child's box, else 0
    float entry; // the z of the box's near side, or 0 if the origin is beyond it: no ray enters the box at a smaller z
    uint word;   // the child's word in the node: see common/tree.cl
} Child;

// Each lane tests one child of a node. Returns whether the shaft (the volume of a pass's rays) meets the box of this
// lane's child at a z that is less than `reach`. The test may report a child that the shaft misses, but never overlooks
// a child that the shaft meets.
INLINED Child test_child(Group *group, const Tree *tree, const Shaft *shaft, uint node, float reach) {
    const uint at = NODE_STRIDE * node; // less than 2^32: a tree has at most 2^25 triangles, and far fewer nodes
    const __global float *x_rows = tree->nodes + (at + shaft->x_rows);
    const __global float *y_rows = tree->nodes + (at + shaft->y_rows);
    // The sides of the child's box are made relative to the rays' origin. Lane i reads column i of each row, so 32
    // lanes read 128 contiguous bytes.
    const float left = x_rows[0] - shaft->x, right = x_rows[NODE_WIDTH] - shaft->x;
    const float top = y_rows[0] - shaft->y, bottom = y_rows[NODE_WIDTH] - shaft->y;
    const float first = MULTIPLY_ADD(shaft->sign, tree->nodes[at + shaft->near_row], -shaft->z);
    const float far = MULTIPLY_ADD(shaft->sign, tree->nodes[at + shaft->far_row], -shaft->z);
    const float near = fmax(first, 0.0f);
    Child result;
    result.word = as_uint(tree->nodes[at + CHILD_ROW + group->lane]);
    result.entry = near;
    // Along x, the shaft lies between two planes, x = low_x * z and x = high_x * z. In the child's box, the least and
    // the greatest x of a plane are at z = near and z = far, in either order. The shaft can meet the box only if the
    // box overlaps the range from the least x of the low plane to the greatest x of the high plane. Likewise along y.
    result.met = (far >= near) & (near < reach) & (right >= fmin(shaft->low_x * near, shaft->low_x * far)) &
                 (left <= fmax(shaft->high_x * near, shaft->high_x * far)) &
                 (bottom >= fmin(shaft->low_y * near, shaft->low_y * far)) &
                 (top <= fmax(shaft->high_y * near, shaft->high_y * far));
    return result;
}

// Returns the word of the child to visit next, and pushes the remaining children that the shaft meets onto the stack.
// If `sorted`, the nearest child is visited next, and the nearest of the pushed children is on top of the stack.
//
// An example of a node, with seven lanes instead of 32:
//
//     lane              0  1  2  3  4  5  6
//     meets its child   -  x  -  -  x  x  -      lane_ballot: 0b0110010
//     entry                5        2  9
//     rank                 1        0  2         number of nearer children among those met
//
//     lane 4's child is visited next; the stack grows by popcount - 1 = 2:   | ... | lane 5 | lane 1 |  <- top
//
// If the shaft meets only one child, this child is visited next, and the stack is unchanged.
//
// If children are not sorted (because any hit is enough), a lane's rank is the number of set bits below the lane's own
// bit: in the example, lane 1 has rank 0, lane 4 has rank 1, and lane 5 has rank 2.
INLINED uint push(Group *group, Child child, uint met, const int sorted, __local uint2 *stack, int *waiting) {
    if (!(met & (met - 1))) return lane_get(group, child.word, LOWEST_BIT(met));
    // Entries are not negative, so their bits, read as integers, have the same order as their values. The last five
    // bits are replaced by the lane's number, so that keys are unique:
    //
    //     31 ............ 5 | 4 .. 0
    //     bits of the entry | lane
    const uint key = (as_uint(child.entry) & ~31u) | (uint)group->lane;
    const int rank = sorted ? lane_rank(group, key, met) : BITS_BEFORE(group, met);
    const int others = popcount(met) - 1;
    if (child.met && rank) stack[*waiting + others - rank] = (uint2)(child.word, as_uint(child.entry));
    *waiting += others;
    // Waits until all lanes have written to the stack, since later, lanes read entries that other lanes wrote.
    lane_sync(group);
    const uint nearest = lane_ballot(group, child.met && !rank);
    return lane_get(group, child.word, LOWEST_BIT(nearest));
}

#if CUTOUTS
// Returns 1 if a ray hits the surface of a triangle, and 0 if the ray hits a hole. The ray has the slopes x and y, runs
// through `point`, and is known to meet the triangle. `index` is the triangle's index in leaf order.
INLINED int solid_in_packet(const Tree *tree, const Shaft *shaft, int index, Vec3 point, float x, float y) {
    Corners corners;
    load_corners(shaft, tree, index, &corners.a, &corners.b, &corners.c);
    return solid_on_rays(&tree->masks, leaf_triangle(tree, index), corners, point, vec3(x, y, 1.0f), 1);
}
#define SOLID_IN_PACKET(tree, shaft, index, point, x, y, hit) (hit && solid_in_packet(tree, shaft, index, point, x, y))
#define USES_LANES(any) 1 // whether candidates->lanes is read: here, for a triangle's mask or index
#else
#define SOLID_IN_PACKET(tree, shaft, index, point, x, y, hit) hit
#define USES_LANES(any) !any // candidates->lanes is read only for the nearest triangle's index
#endif

// A leaf's triangles against which a group's rays are tested, stored without gaps, and the lanes that prepared them.
typedef struct {
    __local float4 *quads; // three float4 for each triangle
    __local int *lanes;
} Candidates;

// Tests a pass's rays against those triangles of a leaf that the shaft does not exclude. With `any`, a ray that hits a
// triangle is finished; otherwise the hit is stored if it is nearer. Returns 1 if any triangle was tested, else 0.
INLINED int visit_leaf(Group *group, const Tree *tree, const Shaft *shaft, RayPacket *packet, uint word, float worst,
               const int any, const Candidates *candidates) {
    const int first = LEAF_FIRST(word);
    Candidate own;
    int wanted = 0;
    // Each lane prepares one triangle for all rays of the pass, and finds out whether any of these rays may hit it.
    if (group->lane < LEAF_COUNT(word)) wanted = prepare(shaft, tree, first + group->lane, worst, any, &own);
    const uint tested = lane_ballot(group, wanted);
    lane_sync(group); // all lanes have tested the previous leaf's triangles, which are now overwritten
    if (wanted) {
        // Compaction by ballot: a lane's triangle is stored after the triangles of lower lanes, without gaps.
        const int at = BITS_BEFORE(group, tested);
        store_candidate(own, candidates->quads + 3 * at);
        if (USES_LANES(any)) candidates->lanes[at] = group->lane;
    }
    lane_sync(group);
    const int count = popcount(tested);
    int hit_candidate[RAYS];
    EACH_RAY(ray) hit_candidate[ray] = -1;
#pragma unroll 4
    for (int k = 0; k < count; k++) {
        // Each lane tests its own rays against every stored triangle. All lanes read the same triangle at the same
        // time, so one read of __local memory serves all lanes.
        const Candidate triangle = load_candidate(candidates->quads + 3 * k);
        EACH_RAY(ray) {
            float per_depth;
            const int hit = SOLID_IN_PACKET(tree, shaft, first + candidates->lanes[k], packet->point[ray],
                                            packet->x[ray], packet->y[ray],
                                            is_hit(&triangle, packet->x[ray], packet->y[ray], packet->nearest[ray],
                                                   packet->ceiling[ray], any, &per_depth));
            packet->nearest[ray] = hit ? (any ? FAR : per_depth) : packet->nearest[ray];
            hit_candidate[ray] = hit ? k : hit_candidate[ray];
        }
    }
    // The nearest triangle's index is read only now: once per ray instead of once per hit.
    if (!any) {
        EACH_RAY(ray)
            if (hit_candidate[ray] >= 0) packet->leaf_index[ray] = first + candidates->lanes[hit_candidate[ray]];
    }
    return count != 0;
}

// Returns the smallest 1/z at which a hit matters: the smallest 1/z of the nearest hits of all rays of the group. For a
// ray that has hit nothing, the 1/z of the ray's end counts (0 for rays from the eye).
INLINED float worst_of(Group *group, const RayPacket *packet) {
    float worst = FAR;
    EACH_RAY(ray) worst = fmin(worst, packet->nearest[ray]);
    return lane_least_positive(group, worst);
}

// Returns 1 if any of this lane's rays still needs a hit, else 0.
INLINED int is_looking(const RayPacket *packet) {
    int looking = 0;
    EACH_RAY(ray) looking |= packet->nearest[ray] < FAR;
    return looking;
}

// Returns the z beyond which no hit matters, rounded up. `worst` is the smallest 1/z at which a hit matters.
INLINED float reach_of(float worst) { return worst > 0.0f ? fmin(1.00001f * reciprocal(worst), FAR) : FAR; }

// Walks the tree with the rays of a pass, and finds the nearest hit of each ray or, with `any`, any hit. With `any`,
// each node or leaf that is taken from the stack and visited uses up one unit of `budget`. Returns 1 if `budget` was
// enough for the whole walk, else 0.
INLINED int walk(Group *group, const Tree *tree, const Shaft *shaft, RayPacket *packet, const int any, int *budget,
         __local uint2 *stack, const Candidates *candidates) {
    float worst = worst_of(group, packet), reach = reach_of(worst);
    uint word = 0;
    int waiting = 0, enough = 1, going = worst < FAR;
    while (going) {
        uint met = 0;
        if (!IS_LEAF(word)) {
            const Child child = test_child(group, tree, shaft, word, reach);
            met = lane_ballot(group, child.met);
            if (met) word = push(group, child, met, !any, stack, &waiting);
        } else if (visit_leaf(group, tree, shaft, packet, word, worst, any, candidates)) {
            going = any ? lane_any(group, is_looking(packet)) : 1;
            if (!any) worst = worst_of(group, packet);
            reach = reach_of(worst);
        }
        if (met || !going) continue;
        // Continues with the topmost node or leaf of the stack that is not behind the nearest hits of all rays. The
        // stack's entries above this node or leaf are dropped.
        float entry = FAR;
        while (waiting && entry >= reach) {
            const uint2 top = stack[--waiting];
            word = top.x;
            entry = as_float(top.y);
        }
        going = entry < reach;
        // If the budget is used up, the remaining rays become leftover shadow rays. These rays are few, but take long,
        // so it is faster if a whole group of 32 lanes casts each of them.
        if (any && going && --*budget < 0) enough = going = 0;
    }
    lane_sync(group); // the stack has been read
    return enough;
}

// Returns 1 if anything blocks a single ray from a light, else 0. All lanes work on this ray: lane i tests the ray
// against child i of a node, or against triangle i of a leaf. `end` is the hit to which the ray runs.
INLINED int is_blocked(Group *group, const Tree *tree, const Shaft *shaft, Vec3 end, float x, float y, float nearest,
               __local uint2 *stack) {
    const float reach = reach_of(nearest);
    uint word = 0;
    int waiting = 0, going = 1, blocked = 0;
    while (going) {
        uint met = 0;
        if (!IS_LEAF(word)) {
            const Child child = test_child(group, tree, shaft, word, reach);
            met = lane_ballot(group, child.met);
            if (met) word = push(group, child, met, 0, stack, &waiting);
        } else {
            // Each lane prepares one triangle and tests the ray against it.
            int hit = 0;
            Candidate own;
            float per_depth;
            if (group->lane < LEAF_COUNT(word) &&
                prepare(shaft, tree, LEAF_FIRST(word) + group->lane, nearest, 1, &own))
                hit = SOLID_IN_PACKET(tree, shaft, LEAF_FIRST(word) + group->lane, point_along_axes(shaft, end), x, y,
                                      is_hit(&own, x, y, nearest, FAR, 1, &per_depth));
            blocked = lane_any(group, hit);
        }
        if (met) continue;
        going = waiting && !blocked;
        if (going) word = stack[--waiting].x;
    }
    lane_sync(group); // the stack has been read
    return blocked;
}
