// Casts a single ray of a tile. The ray traverses the tree alone. Rays to the sky run in all directions, so a packet of
// such rays would visit many nodes that only few of its rays meet. A single ray tests all children of a node together,
// and eight triangles of a leaf together.

typedef struct {
    float from[3], direction[3]; // the origin and the unit direction
    float reach;                 // triangles beyond this distance do not stop the ray
    // The following fields are for the test against boxes. `origin` contains the ray's origin, and `per_direction` the
    // reciprocals of its direction, with the same value in all lanes. For each axis, `near_row` and `far_row` are
    // offsets in a node, in floats. The sides of the children's boxes at which the ray enters begin at `near_row`; the
    // sides at which it leaves begin at `far_row`. A ray towards smaller x enters a box at the side with the larger x.
    Children origin[3], per_direction[3];
    int near_row[3], far_row[3];
} SingleRay;

// Prepares the test against boxes. `per_direction` contains the reciprocals of the direction's components.
static void prepare_single_ray(SingleRay *ray, const float *per_direction) {
    for (int axis = 0; axis < 3; axis++) {
        const int negative = per_direction[axis] < 0.0f;
        ray->origin[axis] = (Children)(ray->from[axis]);
        ray->per_direction[axis] = (Children)(per_direction[axis]);
        ray->near_row[axis] = (2 * axis + negative) * NODE_WIDTH;
        ray->far_row[axis] = (2 * axis + 1 - negative) * NODE_WIDTH;
    }
}

// Returns the t at which the ray crosses a side of each child's box, one lane per child. `row` is the offset of the
// boxes' sides in the node (`near_row` or `far_row` of `axis`).
static Children pass_side(const SingleRay *ray, const __global float *node, int axis, int row) {
    return (LOAD_CHILDREN(node + row) - ray->origin[axis]) * ray->per_direction[axis];
}

// Returns one bit for each child of a node: 1 if the ray meets the child's box at a t from 0 to `ray->reach`. This is
// the slab test (Kay and Kajiya 1986) with one child per lane.
static uint single_ray_enters(const SingleRay *ray, const __global float *node) {
    const Children x = pass_side(ray, node, 0, ray->near_row[0]), x2 = pass_side(ray, node, 0, ray->far_row[0]);
    const Children y = pass_side(ray, node, 1, ray->near_row[1]), y2 = pass_side(ray, node, 1, ray->far_row[1]);
    const Children z = pass_side(ray, node, 2, ray->near_row[2]), z2 = pass_side(ray, node, 2, ray->far_row[2]);
    const Children entry = max(max(x, y), max(z, (Children)(0.0f)));
    const Children leave = min(min(min(x2, y2), z2) * OUTWARDS, (Children)(ray->reach));
    return CHILD_BITS((entry <= leave) & (AS_WORDS(LOAD_CHILDREN(node + CHILD_ROW)) != UNUSED_CHILD));
}

// Returns `v` with its eight lanes twice, in lanes 0 to 7 and in lanes 8 to 15.
static Vec3 in_both_halves(Lanes3 v) { return vec3((float16)(v.x, v.x), (float16)(v.y, v.y), (float16)(v.z, v.z)); }

// Returns which of the eight triangles from `first` on stop the ray, one bit each. Bits 8 to 15 repeat bits 0 to 7.
uint triangles_stopping(const SingleRay *ray, const Tree *tree, int first) {
    const __global float4 *rows = (const __global float4 *)tree->leaves + 3 * (size_t)first;
    const Lanes3 a = load_corners(rows);
    const Lanes3 b = lanes_difference(load_corners(rows + 1), a), c = lanes_difference(load_corners(rows + 2), a);
    const Vec3 corner = in_both_halves(a), e1 = in_both_halves(b), e2 = in_both_halves(c);
    const float8 size1 = lanes_size(b), size2 = lanes_size(c);
    // Each lane tests one triangle; all lanes have the same ray.
    const Vec3 from = splat(LOAD3(ray->from)), direction = splat(LOAD3(ray->direction));
    return LANE_BITS16(stops(&corner, &e1, &e2, (float16)(size1, size1), (float16)(size2, size2), &from, &direction,
                             (varying)(ray->reach)));
}

#if CUTOUTS
// Returns the bits of `hits` for the triangles that the ray hits at their surface and not at a hole. Bit 0 belongs to
// the triangle `first`.
uint solid_of_leaf(const SingleRay *ray, const Tree *tree, int first, uint hits) {
    const Vec3 from = splat(LOAD3(ray->from)), direction = splat(LOAD3(ray->direction));
    uint solid = 0;
    for (uint left = hits; left; left &= left - 1) {
        const int index = first + LOWEST_BIT(left);
        const Mask hit = solid_on_rays(&tree->masks, leaf_triangle(tree, index), leaf_corners(tree, index), from,
                                       direction, (Mask)(-1));
        solid |= ANY(hit) ? left & (0u - left) : 0;
    }
    return solid;
}
#define SOLID_OF_LEAF(ray, tree, first, hits) solid_of_leaf(ray, tree, first, hits)
#else
#define SOLID_OF_LEAF(ray, tree, first, hits) hits
#endif

// Returns 1 if any triangle of a leaf stops the ray, else 0.
static int leaf_stops(const SingleRay *ray, const Tree *tree, uint word) {
    const int end = LEAF_FIRST(word) + LEAF_COUNT(word);
    for (int first = LEAF_FIRST(word); first < end; first += TOGETHER) {
        // Clears bits 8 to 15. In the last iteration, also clears the bits after the leaf's last triangle: they belong
        // to triangles of other leaves, or to padding.
        const uint own = (1u << min(end - first, TOGETHER)) - 1;
        if (SOLID_OF_LEAF(ray, tree, first, triangles_stopping(ray, tree, first) & own)) return 1;
    }
    return 0;
}

// Returns 1 if any triangle of the tree stops the ray, else 0.
int is_stopped_alone(const SingleRay *ray, const Tree *tree) {
    uint stack[STACK_SIZE];
    int waiting = 1;
    stack[0] = 0; // the root
    while (waiting) {
        const uint word = stack[--waiting];
        if (IS_LEAF(word)) {
            if (leaf_stops(ray, tree, word)) return 1;
            continue;
        }
        const __global float *node = tree->nodes + NODE_STRIDE * (size_t)word;
        // Any hit is enough, so children are not sorted.
        for (uint met = single_ray_enters(ray, node); met; met &= met - 1) {
            stack[waiting] = as_uint(node[CHILD_ROW + LOWEST_BIT(met)]);
            fetch_child(tree, stack[waiting++]);
        }
    }
    return 0;
}

// Returns the lanes of `wanted` whose ray enters the box of a child of the tree's root before t = `reach`. All lanes
// are tested together, against one box after another. Rays that enter no box, such as most rays from the ground around
// an object, then need not be cast one by one.
Mask rays_entering_root(const Tree *tree, const BoxProbe *probe, float reach, Mask wanted) {
    const varying own_reach = SELECT(wanted, (varying)(reach), (varying)(-1.0f));
    const uint used = CHILD_BITS(AS_WORDS(LOAD_CHILDREN(tree->nodes + CHILD_ROW)) != UNUSED_CHILD);
    Mask entering = (Mask)(0);
    for (uint left = used; left && ANY(wanted & !entering); left &= left - 1) {
        varying entry;
        entering |= enter_box(probe, tree->nodes + LOWEST_BIT(left), own_reach, &entry);
    }
    return entering;
}

// Returns the lanes of `wanted` whose ray is stopped by a triangle before t = `reach`. Each ray that enters the box of
// a child of the root is cast alone.
Mask are_stopped_alone(const Tree *tree, const Vec3 *from, const Vec3 *direction, float reach, Mask wanted) {
    const BoxProbe probe = prepare_box_probe(*from, *direction);
    const varying numbers[9] = {from->x, from->y, from->z, direction->x, direction->y, direction->z,
                                probe.per_direction.x, probe.per_direction.y, probe.per_direction.z};
    IntLanes stopped;
    stopped.all = (varying_int)(0);
    for (uint left = LANE_BITS16(rays_entering_root(tree, &probe, reach, wanted)); left; left &= left - 1) {
        const int lane = LOWEST_BIT(left);
        SingleRay ray;
        float per_direction[3];
        // Reads this ray's lane of each vector in `numbers`, by the lane's address in memory.
        for (int axis = 0; axis < 3; axis++) {
            ray.from[axis] = ((const float *)(numbers + axis))[lane];
            ray.direction[axis] = ((const float *)(numbers + 3 + axis))[lane];
            per_direction[axis] = ((const float *)(numbers + 6 + axis))[lane];
        }
        ray.reach = reach;
        prepare_single_ray(&ray, per_direction);
        stopped.each[lane] = is_stopped_alone(&ray, tree) ? -1 : 0;
    }
    return stopped.all;
}
