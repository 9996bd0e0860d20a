// Tests which children of a node are hit by rays. Because of rounding, the tests may report a child that no ray hits,
// but they never miss a child that a ray hits.

// Returns the reciprocal of a direction's component. A component that is nearly zero is replaced by 1e-20, so that the
// reciprocal is finite.
static varying safe_reciprocal(varying d) {
    return 1.0f / SELECT(fabs(d) < 1e-20f, (varying)(1e-20f), d);
}

// Each lane's ray, as the slab test needs it: the origin, and the reciprocals of the direction's components.
typedef struct {
    Vec3 origin, per_direction;
} BoxProbe;

static BoxProbe prepare_box_probe(Vec3 origin, Vec3 direction) {
    BoxProbe probe;
    probe.origin = origin;
    probe.per_direction = vec3(safe_reciprocal(direction.x), safe_reciprocal(direction.y), safe_reciprocal(direction.z));
    return probe;
}

// An entry of the traversal's stack: a node's child that the rays still have to visit.
typedef struct {
    uint word;   // the child's word in the node: see common/tree.cl
    float entry; // the smallest t at which a ray enters the child's box
} Waiting;

// Pushes a child of a node onto the stack. `waiting` is the number of the stack's entries; `below` is the number of
// entries before the first child of this node was pushed. Returns the new number of the stack's entries.
static int push_child(Waiting *stack, int below, int waiting, uint word, float entry) {
    int slot = waiting;
    // Insertion sort: children of this node that the rays enter earlier than the new child move up, so that the nearest
    // child is on top.
    for (; slot > below && stack[slot - 1].entry < entry; slot--) stack[slot] = stack[slot - 1];
    stack[slot].word = word;
    stack[slot].entry = entry;
    return waiting + 1;
}

#if WIDTH == 1
// One ray is tested against up to 16 children at the same time, one lane per child. One load of a vector reads the same
// side (for example the side with the least x) of the boxes of up to 16 children.

#define CHILD_LANES (NODE_WIDTH < 16 ? NODE_WIDTH : 16)
#if NODE_WIDTH == 2
typedef float2 BoxLanes;
#elif NODE_WIDTH == 4
typedef float4 BoxLanes;
#elif NODE_WIDTH == 8
typedef float8 BoxLanes;
#else
typedef float16 BoxLanes;
#endif
typedef union {
    BoxLanes all;
    float each[CHILD_LANES];
} EachBox;

// Returns, for each child, the t at which a ray crosses one side of the child's box: one lane per child.
static BoxLanes pass_sides(const __global float *sides, float origin, float per_direction) {
    return (*(const __global BoxLanes *)sides - origin) * per_direction;
}

// Pushes onto the stack those children of a node whose boxes the ray enters before t = `reach`. The nearest of these
// children is pushed to the top of the stack. Returns the new number of the stack's entries.
int push_met_children(const BoxProbe *probe, const __global float *node, float reach, Waiting *stack, int waiting) {
    const Vec3 o = probe->origin, per = probe->per_direction;
    const int below = waiting;
    for (int first = 0; first < NODE_WIDTH; first += CHILD_LANES) {
        const __global float *box = node + first;
        // This is the slab test (Kay and Kajiya 1986), with one lane per child. Along each axis, the test computes the
        // two values of t at which the ray crosses the sides of a child's box.
        const BoxLanes x0 = pass_sides(box, o.x, per.x), x1 = pass_sides(box + NODE_WIDTH, o.x, per.x);
        const BoxLanes y0 = pass_sides(box + 2 * NODE_WIDTH, o.y, per.y), y1 = pass_sides(box + 3 * NODE_WIDTH, o.y, per.y);
        const BoxLanes z0 = pass_sides(box + 4 * NODE_WIDTH, o.z, per.z), z1 = pass_sides(box + 5 * NODE_WIDTH, o.z, per.z);
        EachBox entry, leave, word;
        // A ray enters a box when it enters the last of three slabs, and leaves the box when it first leaves a slab.
        entry.all = max(max(min(x0, x1), min(y0, y1)), max(min(z0, z1), (BoxLanes)(0.0f)));
        leave.all = min(min(min(max(x0, x1), max(y0, y1)), max(z0, z1)) * OUTWARDS, (BoxLanes)(reach));
        word.all = *(const __global BoxLanes *)(box + CHILD_ROW);
#pragma unroll
        for (int child = 0; child < CHILD_LANES; child++)
            if (entry.each[child] <= leave.each[child])
                waiting = push_child(stack, below, waiting, as_uint(word.each[child]), entry.each[child]);
    }
    return waiting;
}
#else
// Returns the lanes whose ray enters a child's box before t = `reach`. `entry` receives the t at which each ray enters
// the box.
static Mask enter_box(const BoxProbe *probe, const __global float *box, varying reach, varying *entry) {
    const Vec3 o = probe->origin, per = probe->per_direction;
    // This is the slab test (Kay and Kajiya 1986), with one lane per ray. Along each axis, the test computes the two
    // values of t at which each ray crosses the sides of the box.
    const varying x0 = (box[0] - o.x) * per.x, x1 = (box[NODE_WIDTH] - o.x) * per.x;
    const varying y0 = (box[2 * NODE_WIDTH] - o.y) * per.y, y1 = (box[3 * NODE_WIDTH] - o.y) * per.y;
    const varying z0 = (box[4 * NODE_WIDTH] - o.z) * per.z, z1 = (box[5 * NODE_WIDTH] - o.z) * per.z;
    const varying near = max(max(min(x0, x1), min(y0, y1)), max(min(z0, z1), (varying)(0.0f)));
    const varying far = min(min(max(x0, x1), max(y0, y1)), max(z0, z1)) * OUTWARDS;
    *entry = near;
    return (near <= far) & (near <= reach);
}

// Returns the smallest value in the lanes that are set in the mask.
static float least_of(varying values, Mask mask) {
    Lanes lanes;
    // Lanes that are not set in the mask get FAR, the largest float, so that they do not count.
    lanes.all = SELECT(mask, values, (varying)(FAR));
    float least = lanes.each[0];
    for (int lane = 1; lane < WIDTH; lane++) least = min(least, lanes.each[lane]);
    return least;
}

// Pushes onto the stack those children of a node whose boxes at least one ray enters before t = `reach` of this ray.
// The nearest of these children is pushed to the top of the stack. Returns the new number of the stack's entries.
int push_met_children(const BoxProbe *probe, const __global float *node, varying reach, Waiting *stack, int waiting) {
    const int below = waiting;
    for (int child = 0; child < NODE_WIDTH; child++) {
        varying entry;
        const Mask met = enter_box(probe, node + child, reach, &entry);
        // If one ray enters the box, the whole packet visits the child. The child's `entry` is the smallest t at which
        // one of the rays enters its box.
        if (ANY(met)) waiting = push_child(stack, below, waiting, as_uint(node[CHILD_ROW + child]), least_of(entry, met));
    }
    return waiting;
}
#endif
