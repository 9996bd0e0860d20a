// A tree as src/accel/wide.rs lays it out, and its triangles in leaf order as src/accel/triangles.rs does.

#if !defined(NODE_WIDTH) || !defined(STACK_SIZE)
#error "NODE_WIDTH: children of a node, 2 to 32; STACK_SIZE: entries that the deepest way down the tree can need"
#endif

#define NODE_STRIDE (NODE_WIDTH <= 8 ? 8 * NODE_WIDTH : 7 * NODE_WIDTH) // words
#define CHILD_ROW (6 * NODE_WIDTH)
#define IS_LEAF(word) ((int)(word) < 0)
#define LEAF_FIRST(word) ((word) & 0x1ffffff)
#define LEAF_COUNT(word) (((word) >> 25) & 63)
#define LEAF_ROW 12 // words a triangle: v0, its number; v1, its material; v2

typedef struct {
    const __global float *nodes;
    const __global float *leaves;
} Tree;

// The corners of the triangle at a place of leaf order.
Corners leaf_corners(const Tree *tree, int place) {
    const __global float *at = tree->leaves + LEAF_ROW * (size_t)place;
    Corners corners;
    corners.a = LOAD3(at);
    corners.b = LOAD3(at + 4);
    corners.c = LOAD3(at + 8);
    return corners;
}

int leaf_triangle(const Tree *tree, int place) { return as_int(tree->leaves[LEAF_ROW * (size_t)place + 3]); }
